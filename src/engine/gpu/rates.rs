//! What a device computes and copies at most, by timing kernels that do nothing else, and how long it takes to reach it. Twin:
//! `shaders/rates.wgsl`.

use std::time::Instant;

use super::buffers::{INPUT, STAGING, STAGING_BYTES, bind, buffer};
use super::device::Device;
use super::shader::Source;
use crate::engine::Link;
use crate::error::{Error, Result};
use crate::math::Precision;

/// Invocations of a dispatch: as many as a large GPU holds at a time, and fewer where threads of the host compute them.
fn invocations(device: &Device) -> u32 {
    if device.kind().is_real() { 1 << 18 } else { 1 << 16 }
}

/// Operations of an invocation's iteration: eight chains of four lanes and four links, a product and a sum each.
const OPERATIONS: f64 = 256.0;
/// The most iterations: software adapters leave a shader's loops after 65,535.
const MOST_ITERATIONS: u32 = 60_000;
/// Numbers of `f32` that are copied: more than the caches of a large GPU hold.
#[cfg(feature = "bench")]
const COPIED: [u64; 2] = [1 << 24, 1 << 26];
/// Copies of a submission: on a GPU so many that the wait for it does not show.
#[cfg(feature = "bench")]
const COPIES: [u32; 2] = [1, 32];

/// What is timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kernel {
    Fused,
    Separate,
    #[cfg(feature = "bench")]
    Copy,
}

/// A kernel with its buffers.
struct Timed<'a> {
    device: &'a Device,
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    buffers: [wgpu::Buffer; 2],
    word: usize,
    invocations: u32,
}

impl<'a> Timed<'a> {
    fn new(device: &'a Device, precision: Precision, kernel: Kernel, numbers: u64) -> Result<Self> {
        let entry_point = match kernel {
            Kernel::Fused => "fused",
            Kernel::Separate => "separate",
            #[cfg(feature = "bench")]
            Kernel::Copy => "copy",
        };
        let word = match precision {
            Precision::F32 => size_of::<f32>(),
            Precision::F64 => size_of::<f64>(),
        };
        let layout = super::bindings(&device.device, "rates", &[super::READ, super::WRITTEN]);
        let pipeline_layout = super::pipeline_layout(&device.device, &layout);
        let pipeline = Source::rates(precision, entry_point).compile(device, &pipeline_layout, None)?;
        let make = || buffer(device, "rates", numbers * word as u64, INPUT).map_err(|refusal| device.refused(refusal));
        let buffers = [make()?, make()?];
        let group = bind(device, "rates", &layout, buffers.each_ref());
        let group = group.map_err(|refusal| device.refused(refusal))?;
        Ok(Self { device, pipeline, group, buffers, word, invocations: invocations(device) })
    }

    /// Wall time of some dispatches in one submission and the wait for it, s.
    fn seconds(&self, iterations: u32, dispatches: u32) -> Result<f64> {
        let numbers = [0.999_999, 1e-6, f64::from(iterations), f64::from(self.invocations)];
        let bytes: Vec<u8> = match self.word {
            4 => bytemuck::cast_slice(&numbers.map(|x| x as f32)).to_vec(),
            _ => bytemuck::cast_slice(&numbers).to_vec(),
        };
        self.device.write(&self.buffers[0], 0, &bytes);
        self.device.submit(None)?;
        let commands = self.device.encoded("rates", |encoder| {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.group, &[]);
            for _ in 0..dispatches {
                self.device.dispatch(&mut pass, self.invocations / 64);
            }
        })?;
        let clock = Instant::now();
        self.device.submit(Some(commands))?;
        Ok(clock.elapsed().as_secs_f64())
    }

    fn least_seconds(&self, iterations: u32, dispatches: u32, tries: usize) -> Result<f64> {
        (0..tries).try_fold(f64::INFINITY, |least, _| Ok(least.min(self.seconds(iterations, dispatches)?)))
    }
}

impl Drop for Timed<'_> {
    fn drop(&mut self) {
        self.buffers.iter().for_each(wgpu::Buffer::destroy);
        self.device.release();
    }
}

/// Floating-point operations a second, two for a multiply-add: the best of `tries` dispatches of about `seconds` each.
pub(crate) fn flops(device: &Device, precision: Precision, tries: usize, seconds: f64) -> Result<f64> {
    let invocations = invocations(device);
    let mut best = 0.0_f64;
    for kernel in [Kernel::Separate, Kernel::Fused] {
        let timed = Timed::new(device, precision, kernel, u64::from(invocations))?;
        // The first dispatch may contain the driver's own compilation.
        timed.seconds(1, 1)?;
        let mut iterations = 4;
        let mut taken = timed.seconds(iterations, 1)?;
        while taken < seconds && iterations < MOST_ITERATIONS {
            iterations = (iterations * 4).min(MOST_ITERATIONS);
            // A kernel that is emulated is given up once it shows.
            taken = timed.seconds(iterations, 1)?;
        }
        let rate = |taken: f64| OPERATIONS * f64::from(iterations) * f64::from(invocations) / taken;
        if rate(taken) > 0.5 * best {
            best = best.max(rate(taken.min(timed.least_seconds(iterations, 1, tries)?)));
        }
    }
    Ok(best)
}

/// Bytes by which the way to a device is timed.
const MOVED: usize = 8 << 20;
/// How often a wait and a transfer are timed; the best counts.
const WAITS: usize = 16;
const TRANSFERS: usize = 3;

/// How long it takes to reach a device.
pub(crate) fn link(device: &Device) -> Result<Link> {
    let make = |usage| buffer(device, "link", MOVED as u64, usage).map_err(|refusal| device.refused(refusal));
    let there = make(wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC)?;
    let here = make(STAGING)?;
    let mut bytes = vec![1_u8; MOVED];
    let least = |count: usize, work: &mut dyn FnMut() -> Result<()>| {
        (0..count).try_fold(f64::INFINITY, |least: f64, _| {
            let clock = Instant::now();
            work()?;
            Ok::<f64, Error>(least.min(clock.elapsed().as_secs_f64()))
        })
    };
    let measured = (|| {
        let wait = least(WAITS, &mut || {
            device.write(&there, 0, &bytes[..64]);
            device.submit(None)
        })?;
        let up = least(TRANSFERS, &mut || {
            for (index, piece) in bytes.chunks(STAGING_BYTES).enumerate() {
                device.write(&there, (index * STAGING_BYTES) as u64, piece);
            }
            device.submit(None)
        })?;
        let back = least(TRANSFERS, &mut || {
            let mut encoder = device.device.create_command_encoder(&Default::default());
            encoder.copy_buffer_to_buffer(&there, 0, &here, 0, MOVED as u64);
            device.read(encoder.finish(), &here, 0..MOVED as u64, |read| bytes.copy_from_slice(read))
        })?;
        // What a wait alone takes is no transfer; where that is all, the rate is as good as any.
        let rate = |seconds: f64| MOVED as f64 / (seconds - wait).max(0.1 * seconds);
        Ok(Link { wait, to_device: rate(up), to_host: rate(back) })
    })();
    [&there, &here].into_iter().for_each(wgpu::Buffer::destroy);
    device.release();
    measured
}

/// Bytes a second, read and written together: the best of `tries`.
#[cfg(feature = "bench")]
pub(crate) fn bandwidth(device: &Device, precision: Precision, tries: usize) -> Result<f64> {
    let word = match precision {
        Precision::F32 => size_of::<f32>(),
        Precision::F64 => size_of::<f64>(),
    } as u64;
    let real = usize::from(device.kind().is_real());
    let bytes = (COPIED[real] * size_of::<f32>() as u64).min(device.device.limits().max_storage_buffer_binding_size);
    // Four to an invocation at a time.
    let round = 4 * u64::from(invocations(device));
    let numbers = (bytes / word / round).max(1) * round;
    let timed = Timed::new(device, precision, Kernel::Copy, numbers)?;
    let copied = 2.0 * f64::from(COPIES[real]) * (numbers * word) as f64;
    Ok(copied / timed.least_seconds(0, COPIES[real], tries)?)
}

/// Gives a device work, in dispatches of some milliseconds, until `is_enough` of the rate of the last one, operations/s; gives that rate. A
/// GPU that was idle has clocks several times lower, and raises them after some tenths of a second of work.
pub(crate) fn warm_up(device: &Device, is_enough: impl Fn(f64) -> bool) -> Result<f64> {
    /// Long enough for the wait to count little, and far below the time after which drivers reset a device.
    const LEAST_SECONDS: f64 = 2e-3;
    let timed = Timed::new(device, Precision::F32, Kernel::Separate, u64::from(invocations(device)))?;
    let mut iterations = 16;
    loop {
        let seconds = timed.seconds(iterations, 1)?;
        let rate = OPERATIONS * f64::from(iterations) * f64::from(timed.invocations) / seconds;
        if seconds < LEAST_SECONDS && iterations < MOST_ITERATIONS {
            iterations = (2 * iterations).min(MOST_ITERATIONS);
        } else if is_enough(rate) {
            return Ok(rate);
        }
    }
}
