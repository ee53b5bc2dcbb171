//! What a device computes and copies at most, by timing kernels that do nothing else. Twin: `shaders/rates.wgsl`.

use std::time::Instant;

use super::buffers::buffer;
use super::device::Device;
use super::shader::Source;
use crate::error::Result;
use crate::math::Precision;

/// Invocations of a dispatch.
const INVOCATIONS: u32 = 1 << 16;
/// Operations of an invocation's iteration: eight chains of four lanes, a product and a sum each.
const OPERATIONS: f64 = 64.0;
/// The most iterations: software adapters leave a shader's loops after 65,535.
const MOST_ITERATIONS: u32 = 60_000;
/// Numbers that are copied: 64 MiB of `f32`.
#[cfg(feature = "bench")]
const COPIED: u64 = 1 << 24;

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
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let make = || buffer(device, "rates", numbers * word as u64, usage).map_err(|refusal| device.refused(refusal));
        let buffers = [make()?, make()?];
        let group = device.scoped(|| {
            device.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("rates"),
                layout: &layout,
                entries: &super::entries(buffers.each_ref()),
            })
        });
        let group = group.map_err(|refusal| device.refused(refusal))?;
        Ok(Self { device, pipeline, group, buffers, word })
    }

    /// Wall time of a dispatch and the wait for it, s.
    fn seconds(&self, iterations: u32) -> Result<f64> {
        let numbers = [0.999_999, 1e-6, f64::from(iterations)];
        let bytes: Vec<u8> = match self.word {
            4 => bytemuck::cast_slice(&numbers.map(|x| x as f32)).to_vec(),
            _ => bytemuck::cast_slice(&numbers).to_vec(),
        };
        self.device.write(&self.buffers[0], 0, &bytes);
        self.device.submit(None)?;
        let commands = self.device.scoped(|| {
            let mut encoder = self.device.device.create_command_encoder(&Default::default());
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.group, &[]);
            self.device.dispatch(&mut pass, INVOCATIONS / 64);
            drop(pass);
            encoder.finish()
        });
        let commands = commands.map_err(|refusal| self.device.refused(refusal))?;
        let clock = Instant::now();
        self.device.submit(Some(commands))?;
        Ok(clock.elapsed().as_secs_f64())
    }

    fn least_seconds(&self, iterations: u32, tries: usize) -> Result<f64> {
        (0..tries).try_fold(f64::INFINITY, |least, _| Ok(least.min(self.seconds(iterations)?)))
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
    let mut best = 0.0_f64;
    for kernel in [Kernel::Separate, Kernel::Fused] {
        let timed = Timed::new(device, precision, kernel, u64::from(INVOCATIONS))?;
        // The first dispatch may contain the driver's own compilation.
        timed.seconds(1)?;
        let mut iterations = 16;
        let mut taken = timed.seconds(iterations)?;
        while taken < seconds && iterations < MOST_ITERATIONS {
            iterations = (iterations * 4).min(MOST_ITERATIONS);
            // A kernel that is emulated is given up once it shows.
            taken = timed.seconds(iterations)?;
        }
        let rate = |taken: f64| OPERATIONS * f64::from(iterations) * f64::from(INVOCATIONS) / taken;
        if rate(taken) > 0.5 * best {
            best = best.max(rate(taken.min(timed.least_seconds(iterations, tries)?)));
        }
    }
    Ok(best)
}

/// Bytes a second, read and written together: the best of `tries`.
#[cfg(feature = "bench")]
pub(crate) fn bandwidth(device: &Device, precision: Precision, tries: usize) -> Result<f64> {
    let word = match precision {
        Precision::F32 => size_of::<f32>(),
        Precision::F64 => size_of::<f64>(),
    } as u64;
    // As many numbers as one binding takes.
    let numbers = COPIED.min(device.device.limits().max_storage_buffer_binding_size / word);
    let timed = Timed::new(device, precision, Kernel::Copy, numbers)?;
    Ok(2.0 * (numbers * word) as f64 / timed.least_seconds(0, tries)?)
}
