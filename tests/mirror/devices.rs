//! Opening adapters: what is found, what is refused, and what a failure leaves behind.

use crate::common;

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use common::kernel::open_device;
use polhode::Error;
use polhode::engine::gpu::{AdapterKind, ChunkLimits, Gpu, GpuOptions, SliceLimits, wgpu};
use polhode::engine::{Choice, End, Engine, EngineKind, devices, unobserved};
use polhode::kernel::method::Method;
use polhode::math::Precision;

#[test]
fn devices_lists_adapters_with_what_the_probe_found() {
    let devices = devices();
    assert!(!devices.adapters.is_empty(), "tests need a Vulkan driver (Mesa's lavapipe will do)");
    for (index, adapter) in devices.adapters.iter().enumerate() {
        println!("{adapter:#?}");
        assert_eq!(adapter.index, index);
        assert!(adapter.limits.binding_bytes > 0 && adapter.limits.workgroups > 0);
        let arithmetic = adapter.arithmetic.as_ref().expect("opened");
        assert!(arithmetic.f32.two_sum_barrier, "the barrier holds on {}", adapter.name);
        assert_eq!(arithmetic.f64.is_some(), adapter.float64);
        let holds = arithmetic.f64.is_none_or(|probe| probe.two_sum_barrier);
        assert!(holds || !adapter.int64, "the barrier of 64-bit integers holds on {}", adapter.name);
        assert!(adapter.precisions().contains(&Precision::F32));
    }
    assert_eq!(devices.cpu.kind, EngineKind::Cpu);
    let auto = Engine::auto().expect("opened").description();
    match devices.auto {
        Choice::Gpu { index, kind } => {
            assert!(kind.is_real());
            assert_eq!((auto.kind, &auto.name), (EngineKind::Gpu, &devices.adapters[index].name));
        }
        _ => assert_eq!(auto.kind, EngineKind::Cpu),
    }
}

#[test]
fn a_software_adapter_is_taken_only_when_asked_for() {
    let devices = devices();
    let Some(software) = devices.adapters.iter().find(|adapter| adapter.kind == AdapterKind::Software) else {
        common::skipped("a_software_adapter_is_taken_only_when_asked_for", "no software adapter on this machine");
        return;
    };
    if devices.adapters.iter().all(|adapter| !adapter.kind.is_real()) {
        let error = Engine::gpu(GpuOptions::default()).expect_err("no real GPU");
        assert!(matches!(error, Error::NoAdapter { found, .. } if found == devices.adapters.len()), "{error}");
        assert_eq!(devices.auto, Choice::CpuOnlySoftware);
    }
    let options = GpuOptions { adapter: Some(software.index), ..GpuOptions::default() };
    assert!(Engine::gpu(options).expect("asked for by index").description().software);
}

#[test]
fn an_index_that_no_adapter_has_is_refused() {
    let error = Engine::gpu(GpuOptions { adapter: Some(99), ..GpuOptions::default() }).expect_err("refused");
    assert_eq!(error, Error::NoAdapter { wanted: "with index 99".into(), found: devices().adapters.len() });
}

#[test]
fn a_device_of_the_callers_gives_the_same_bits() {
    let (device, queue) = open_device(wgpu::Features::SHADER_F64);
    let borrowed = Engine::gpu_on(device, queue, GpuOptions::default()).expect("opened");
    let own = common::gpu();
    for precision in Precision::ALL {
        let batch = common::asymmetric_batch(70, 31, precision);
        let expected = common::advanced(&own, &batch, Method::Rk4, 0.01, 20);
        let found = common::advanced(&borrowed, &batch, Method::Rk4, 0.01, 20);
        assert_eq!(common::compare::first_bit_difference(&expected, &found), None, "{precision}");
    }
}

#[test]
fn f64_on_a_device_without_it_is_refused_and_the_alternatives_are_named() {
    let (device, queue) = open_device(wgpu::Features::empty());
    let engine = Engine::gpu_on(device, queue, GpuOptions::default()).expect("opened");
    assert_eq!(engine.precisions(), [Precision::F32]);
    assert_eq!(engine.description().arithmetic.expect("probed").f64, None);
    let error = engine.start(common::asymmetric_batch(3, 1, Precision::F64), Method::Rk4).err().expect("refused");
    assert!(matches!(&error, Error::PrecisionUnavailable { precision: Precision::F64, .. }), "{error:?}");
    let text = error.to_string();
    assert!(text.contains("f32") && text.contains("CPU engine"), "{text}");
}

#[test]
fn beside_a_cpu_a_device_without_f64_has_it() {
    let (device, queue) = open_device(wgpu::Features::empty());
    let gpu = Gpu::on(device, queue, GpuOptions::default()).expect("opened");
    let engine = Engine::paired(gpu);
    assert_eq!(engine.precisions(), Precision::ALL);
    let on_host = engine.description().on_host.expect("f64 is on the CPU");
    assert!(on_host.contains("f64 on the CPU, as the adapter cannot compute in it"), "{on_host}");
    let batch = common::asymmetric_batch(70, 31, Precision::F64);
    let [expected, found] =
        [Engine::cpu(), engine].map(|engine| common::advanced(&engine, &batch, Method::Rk4, 0.01, 20));
    assert_eq!(common::compare::first_bit_difference(&expected, &found), None);
}

#[test]
fn a_lost_device_is_an_error_and_not_a_panic() {
    let (device, queue) = open_device(wgpu::Features::SHADER_F64);
    let engine = Engine::gpu_on(device.clone(), queue, GpuOptions::default()).expect("opened");
    let mut session = engine.start(common::asymmetric_batch(70, 1, Precision::F32), Method::Rk4).expect("started");
    session.advance_to(End::of_steps(0.01, 3), &mut unobserved).expect("advanced");
    device.destroy();
    let lost = |error: Error| assert!(matches!(error, Error::Device { .. }), "{error:?}");
    lost(session.advance_to(End::of_steps(0.01, 3), &mut unobserved).expect_err("lost"));
    lost(session.read(0..70).expect_err("lost"));
    lost(engine.start(common::asymmetric_batch(70, 1, Precision::F32), Method::Dlm).err().expect("lost"));
}

/// Bytes that buffers take on a device, where its driver says so.
fn allocated(device: &wgpu::Device) -> u64 {
    device.poll(wgpu::PollType::wait_indefinitely()).expect("waited");
    device.generate_allocator_report().expect("a Vulkan device reports").total_allocated_bytes
}

#[test]
fn more_bodies_than_the_memory_allowed_are_refused_and_nothing_is_left_allocated() {
    let (device, queue) = open_device(wgpu::Features::SHADER_F64);
    let options = GpuOptions { memory: Some(6 << 20), ..GpuOptions::default() };
    let engine = Engine::gpu_on(device.clone(), queue, options).expect("opened");
    let before = allocated(&device);
    let error = engine.start(common::asymmetric_batch(100_000, 1, Precision::F32), Method::Rk4).err().expect("refused");
    assert!(
        matches!(error, Error::TooManyBodies { bodies: 100_000, available, needed, .. } if available == 6 << 20 && needed > available),
        "{error:?}"
    );
    assert_eq!(allocated(&device), before);
    let session = engine.start(common::asymmetric_batch(1000, 1, Precision::F32), Method::Rk4).expect("started");
    assert!(allocated(&device) > before);
    drop(session);
    assert_eq!(allocated(&device), before);
}

#[test]
fn no_bodies_take_no_memory() {
    let (device, queue) = open_device(wgpu::Features::empty());
    let engine = Engine::gpu_on(device.clone(), queue, GpuOptions::default()).expect("opened");
    let before = allocated(&device);
    let batch = common::asymmetric_batch(0, 1, Precision::F32);
    let mut session = engine.start(batch, Method::Rk4).expect("started");
    session.advance_to(End::of_steps(0.01, 5), &mut unobserved).expect("advanced");
    assert!(session.read(0..0).expect("read").is_empty());
    assert_eq!(allocated(&device), before);
}

#[test]
fn limits_without_room_for_one_workgroup_are_refused() {
    let options = GpuOptions {
        chunk: ChunkLimits { binding_bytes: Some(64 * 14 * 4 - 1), ..ChunkLimits::default() },
        ..common::any_adapter()
    };
    let engine = common::gpu_with(options);
    let error = engine.start(common::asymmetric_batch(3, 1, Precision::F32), Method::Rk4).err().expect("refused");
    assert!(matches!(error, Error::Setting { field: "chunk bytes", .. }), "{error:?}");
}

#[test]
fn a_step_that_is_not_above_zero_is_refused() {
    let mut session =
        common::gpu().start(common::asymmetric_batch(3, 1, Precision::F32), Method::Rk4).expect("started");
    for dt in [0.0, -0.01, f64::NAN, f64::INFINITY, 1e-40] {
        let error = session.advance_to(End::of_steps(dt, 1), &mut unobserved).expect_err("refused");
        assert!(matches!(error, Error::Setting { field: "dt", .. }), "{dt}: {error:?}");
    }
}

#[test]
fn an_observer_sees_progress_and_can_stop() {
    let options = GpuOptions { slice: SliceLimits { steps: 10, ..SliceLimits::default() }, ..common::any_adapter() };
    let engine = common::gpu_with(options);
    let mut session = engine.start(common::asymmetric_batch(70, 1, Precision::F32), Method::Rk4).expect("started");
    let mut seen = Vec::new();
    let mut watch = |progress: polhode::engine::Progress| {
        seen.push(progress);
        ControlFlow::Continue(())
    };
    session.advance_to(End::of_steps(0.01, 95), &mut watch).expect("advanced");
    assert!(seen.len() >= 10, "{seen:?}");
    assert!(seen.windows(2).all(|pair| pair[0].done < pair[1].done), "{seen:?}");
    assert!(seen.iter().all(|progress| progress.total == 95 * 70));
    assert_eq!(seen.last().map(|progress| progress.done), Some(95 * 70));
    let error = session.advance_to(End::of_steps(0.01, 95), &mut |_| ControlFlow::Break(())).expect_err("stopped");
    assert!(matches!(error, Error::Interrupted { steps } if (1..95).contains(&steps)), "{error:?}");
}

#[test]
fn long_work_is_cut_so_that_an_observer_is_asked_often() {
    /// Between two calls: the slice is to take 50 ms; the rest is room for a machine that is busy with other tests.
    const LONGEST_SILENCE: Duration = Duration::from_secs(1);
    let mut session =
        common::gpu().start(common::asymmetric_batch(4099, 1, Precision::F32), Method::Dlm).expect("started");
    let (mut last, mut longest, mut calls) = (Instant::now(), Duration::ZERO, 0);
    let mut watch = |_| {
        longest = longest.max(last.elapsed());
        last = Instant::now();
        calls += 1;
        ControlFlow::Continue(())
    };
    session.advance_to(End::of_steps(0.01, 10_000), &mut watch).expect("advanced");
    println!("{calls} submissions, the longest {longest:?}");
    assert!(longest < LONGEST_SILENCE, "{longest:?}");
}
