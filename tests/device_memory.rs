//! Memory that a batch on the device does not find. Alone in its file, since it limits the whole process.
#![cfg(target_os = "linux")]

mod common;

use std::process::Command;

use common::kernel::open_device;
use polhode::Error;
use polhode::engine::Engine;
use polhode::engine::batch::{AnyBatch, Batch};
use polhode::engine::gpu::{AdapterKind, GpuOptions, wgpu};
use polhode::kernel::method::Method;
use polhode::math::Precision;

/// Bytes of address space that this process uses.
fn address_space() -> u64 {
    let pages = std::fs::read_to_string("/proc/self/statm").expect("Linux has it");
    let pages: u64 = pages.split_whitespace().next().expect("a field").parse().expect("a number");
    pages * 4096
}

fn limit_address_space(limit: &str) {
    let status = Command::new("prlimit")
        .args([format!("--pid={}", std::process::id()), format!("--as={limit}:unlimited")])
        .status()
        .expect("util-linux is there");
    assert!(status.success());
}

fn allocated(device: &wgpu::Device) -> u64 {
    device.poll(wgpu::PollType::wait_indefinitely()).expect("waited");
    device.generate_allocator_report().expect("a Vulkan device reports").total_allocated_bytes
}

#[test]
fn memory_that_is_not_there_is_an_error_and_nothing_is_left_allocated() {
    let (device, queue) = open_device(wgpu::Features::empty());
    if AdapterKind::from(device.adapter_info().device_type) != AdapterKind::Software {
        // Only a software adapter's memory is this process's own, which can be limited.
        common::skipped(
            "memory_that_is_not_there_is_an_error",
            "the adapter is real, and its memory cannot be limited",
        );
        return;
    }
    let engine = Engine::gpu_on(device.clone(), queue, GpuOptions::default()).expect("opened");
    let bodies = 8_000_000;
    let batch = AnyBatch::F32(Batch::at_rest(bodies));
    let before = allocated(&device);
    // Room for some of the chunks but not for all: they take 672 MB. The limit is known before any work; a driver that refuses
    // though there seems to be room gives the other error.
    limit_address_space(&(address_space() + (300 << 20)).to_string());
    let error = engine.start(batch, Method::Rk4).err();
    limit_address_space("unlimited");
    match &error {
        Some(
            Error::DeviceMemory { bodies: found, needed, .. } | Error::TooManyBodies { bodies: found, needed, .. },
        ) => {
            assert_eq!(*found, bodies);
            assert!(*needed >= bodies as u64 * 84, "{needed}");
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(allocated(&device), before);
    // The device is as good as before.
    common::advanced(&engine, &common::asymmetric_batch(70, 1, Precision::F32), Method::Rk4, 0.01, 3);
}
