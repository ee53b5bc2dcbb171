//! A batch on a device whose bodies take steps of their own size.
//!
//! A round advances a list of bodies by a bounded number of attempts. Those that are then still under way make the list of the next
//! round, so that a finished body holds its workgroup no longer than one round. Lists and their lengths stay on the device
//! ([`control`]): a submission has as many rounds as its time allows, and some bytes come back. No body reads what another wrote, so
//! that results depend neither on lists nor on cuts.

mod chunk;
mod control;

use std::sync::{Arc, OnceLock};
use std::time::Instant;

use super::buffers::{DeviceScalar, WORKGROUP_SIZE};
use super::device::Device;
use super::dispatch::{GROUP_BODIES, Slicer};
use super::observe::ObserveKernels;
use super::pipelines::{Kernel, Pipelines};
use super::session::{GpuSession, Kind, Start};
use super::shader::{Patch, Source};
use super::{GpuOptions, READ, UNIFORM, WRITTEN, bindings};
use crate::engine::batch::Batch;
use crate::engine::checks::check_time;
use crate::engine::{End, Observer, Progress, Session, StepCounts};
use crate::error::{Error, Result};
use crate::kernel::method::Method;
use crate::kernel::method::rk8_adaptive::Controller;
use crate::math::clock::Clock;
use crate::scene::AdaptiveSteps;
use chunk::{Chunk, Interval, row_bytes};
use control::{Bodies, Control};

/// The kernels' bindings, and their pipelines, made on first use.
#[derive(Debug, Default)]
pub(super) struct AdaptiveKernels {
    layouts: OnceLock<Layouts>,
    compact: OnceLock<[wgpu::ComputePipeline; 2]>,
    advance: Pipelines,
}

/// Bindings of `adaptive.wgsl` and of `compact.wgsl`.
#[derive(Debug)]
struct Layouts {
    advance: wgpu::BindGroupLayout,
    compact: wgpu::BindGroupLayout,
}

/// The kernels of a round, in order.
#[derive(Clone, Debug)]
struct Round {
    advance: wgpu::ComputePipeline,
    compact: [wgpu::ComputePipeline; 2],
}

/// Steps of each body's own size.
struct Adaptive {
    compact: [wgpu::ComputePipeline; 2],
    steps: AdaptiveSteps,
    /// The time that the state stands at.
    clock: Clock,
    slicer: Slicer,
    /// Attempts so far, alone and with those that bodies waited.
    attempts: u64,
    held: u64,
    /// Bodies that have come to the end of an interval so far.
    arrived: u64,
    longest: Longest,
}

impl Kind for Adaptive {
    type Chunk = Chunk;
    const CHUNK_BODIES: usize = GROUP_BODIES;
    const READ_BYTES: u64 = size_of::<Control>() as u64;

    fn advance_to<T: DeviceScalar>(
        session: &mut GpuSession<T, Self>,
        end: End,
        observer: &mut Observer<'_>,
    ) -> Result<()> {
        check_time(end.time)?;
        let end = session.kind.clock.at(end.time.max(0.0));
        if end.now() <= session.kind.clock.now() {
            return Ok(());
        }
        // Not within the time of a submission, which it would seem to take.
        session.kernel.pipeline()?;
        let interval = Interval::<T>::new(&session.kind.clock, &end, &session.kind.steps);
        for chunk in &mut session.chunks {
            chunk.start_interval(&session.device, &interval);
        }
        let seconds = session.kind.clock.seconds_until(&end).0;
        let expected = session.kind.longest.expected(seconds);
        let total = session.body_count as u64;
        let mut index = 0;
        while index < session.chunks.len() {
            if session.chunks[index].left() == 0 {
                index += 1;
                continue;
            }
            let bodies = session.chunks[index].next_bodies(session.side_by_side_bodies());
            let fitting = session.kind.slicer.fitting_steps(bodies.count() as usize);
            let made = session.chunks[index].made_by(&bodies);
            let still = expected.map_or(fitting, |expected| expected.saturating_sub(made));
            // More than was expected: as many as fit.
            let attempts = if still == 0 { fitting } else { still.min(fitting) };
            let start = Instant::now();
            let left = session.run(index, bodies, attempts)?;
            session.kind.slicer.record_attempts(left.all_held(), left.longest, start.elapsed());
            let done = total - session.chunks.iter().map(|chunk| chunk.left() as u64).sum::<u64>();
            if done < total && observer(Progress { done, total }).is_break() {
                return Err(Error::Interrupted { steps: 0 });
            }
        }
        session.kind.longest.end(seconds);
        session.kind.clock = end;
        // All is done, so there is nothing left to break off.
        let _ = observer(Progress { done: total, total });
        Ok(())
    }

    fn attempt<T: DeviceScalar>(
        session: &mut GpuSession<T, Self>,
        end: f64,
        controllers: &mut [Controller<f64>],
    ) -> Result<()> {
        check_time(end)?;
        let interval =
            Interval::<T>::new(&session.kind.clock, &session.kind.clock.at(end.max(0.0)), &session.kind.steps);
        let before = Self::counts(session)?;
        let device = Arc::clone(&session.device);
        for index in 0..session.chunks.len() {
            session.chunks[index].start_interval(&device, &interval);
            session.chunks[index].take_controllers::<T>(&device, controllers)?;
            session.run(index, session.chunks[index].all_bodies(), 1)?;
            let Some(reader) = &mut session.reader else { continue };
            session.chunks[index].give_controllers::<T>(&device, reader, controllers)?;
        }
        for ((controller, before), after) in controllers.iter_mut().zip(before).zip(Self::counts(session)?) {
            controller.accepted += (after.accepted - before.accepted) as f64;
            controller.rejected += (after.rejected - before.rejected) as f64;
        }
        Ok(())
    }

    fn counts<T: DeviceScalar>(session: &mut GpuSession<T, Self>) -> Result<Vec<StepCounts>> {
        let mut counts = Vec::with_capacity(session.body_count);
        let Some(reader) = &mut session.reader else { return Ok(counts) };
        for chunk in &session.chunks {
            chunk.read_counts(&session.device, reader, &mut counts)?;
        }
        Ok(counts)
    }

    fn side_by_side(&self) -> usize {
        WORKGROUP_SIZE as usize
    }

    fn imbalance(&self) -> f64 {
        if self.attempts > 0 { self.held as f64 / self.attempts as f64 } else { 1.0 }
    }
}

/// The most attempts that a body has made in an interval.
///
/// A round that no body needs any more costs some tens of microseconds on a GPU, for the kernels wait for each other. So an interval is
/// expected to take as many attempts as the one before, by length, and only rounds for those are submitted at first.
#[derive(Clone, Copy, Debug, Default)]
struct Longest {
    /// In the last interval: attempts in a second.
    rate: Option<f64>,
    /// In this one, so far: attempts since rows were last added.
    made: u32,
}

impl Longest {
    /// By which part more are expected.
    const MARGIN: f64 = 1.125;

    /// Attempts after which all bodies of an interval of `seconds` are expected to have arrived.
    fn expected(&self, seconds: f64) -> Option<u32> {
        // The cast saturates.
        self.rate.map(|rate| ((rate * seconds * Self::MARGIN) as u32).saturating_add(1))
    }

    /// An interval of `seconds` is over.
    fn end(&mut self, seconds: f64) {
        self.rate = Some(f64::from(self.made) / seconds);
        self.made = 0;
    }
}

impl AdaptiveKernels {
    /// Uploads a batch; on an error nothing is left allocated. `tapped`: whether an attempt leaves evaluations in place of states.
    pub fn start<T: DeviceScalar>(
        &self,
        device: &Arc<Device>,
        batch: &Batch<T>,
        steps: AdaptiveSteps,
        tapped: bool,
        options: &GpuOptions,
        observe: &Arc<ObserveKernels>,
    ) -> Result<Box<dyn Session>> {
        let layouts = self.layouts.get_or_init(|| Layouts::new(&device.device));
        let source = Source::adaptive(T::PRECISION, &batch.torques);
        let kernel = self.advance(device, layouts, source, tapped, options)?;
        let compact = self.compact(device, layouts, options)?;
        let columns = batch.parameter_columns();
        let start = Start {
            device,
            options,
            observe,
            kernel,
            body_count: batch.body_count,
            ends: &batch.ends,
            row_bytes: row_bytes::<T>(columns),
        };
        let adaptive = Adaptive {
            compact,
            steps,
            clock: batch.torques.clock(),
            slicer: Slicer::new(options.slice, batch.loops_of_a_step(Method::Rk8)),
            attempts: 0,
            held: 0,
            arrived: 0,
            longest: Longest::default(),
        };
        let new_chunk = |bodies| Chunk::new::<T>(device, layouts, bodies, columns);
        Ok(Box::new(start.session::<T, _>(adaptive, new_chunk, |chunk, upload| chunk.upload(upload, batch))?))
    }

    fn compact(&self, device: &Device, layouts: &Layouts, options: &GpuOptions) -> Result<[wgpu::ComputePipeline; 2]> {
        if let Some(pipelines) = self.compact.get() {
            return Ok(pipelines.clone());
        }
        let pipelines = compact_pipelines(device, layouts, &options.patches)?;
        Ok(self.compact.get_or_init(|| pipelines).clone())
    }

    fn advance(
        &self,
        device: &Arc<Device>,
        layouts: &Layouts,
        source: Source,
        tapped: bool,
        options: &GpuOptions,
    ) -> Result<Kernel> {
        let with_tap = |source: Source| if tapped { source.tapped() } else { source };
        let key = with_tap(source.clone()).key();
        let source = with_tap(source.patched(&options.patches)?);
        let layout = super::pipeline_layout(&device.device, &layouts.advance);
        Ok(self.advance.get(device, key, move |device| source.compile(device, &layout, Some(WORKGROUP_SIZE))))
    }
}

/// The kernels of `compact.wgsl`, in the order of their use.
fn compact_pipelines(device: &Device, layouts: &Layouts, patches: &[Patch]) -> Result<[wgpu::ComputePipeline; 2]> {
    let layout = super::pipeline_layout(&device.device, &layouts.compact);
    let [tally, compact] = Source::compact();
    let compile = |source: Source| source.patched(patches)?.compile(device, &layout, None);
    Ok([compile(tally)?, compile(compact)?])
}

impl Layouts {
    fn new(device: &wgpu::Device) -> Self {
        let advance = [UNIFORM, READ, WRITTEN, WRITTEN, WRITTEN, READ, WRITTEN, READ];
        Self {
            advance: bindings(device, "adaptive", &advance),
            compact: bindings(device, "compact", &[READ, WRITTEN, READ, WRITTEN, READ, WRITTEN]),
        }
    }
}

impl<T: DeviceScalar> GpuSession<T, Adaptive> {
    /// One submission for some bodies of a chunk: at most `attempts` attempts of each. Gives what was left.
    fn run(&mut self, index: usize, bodies: Bodies, attempts: u32) -> Result<Control> {
        let round = Round { advance: self.kernel.pipeline()?, compact: self.kind.compact.clone() };
        let Some(reader) = &mut self.reader else { return Ok(Control::default()) };
        let staging = reader.staging();
        let device = Arc::clone(&self.device);
        let chunk = &mut self.chunks[index];
        let control = Control::new(bodies, attempts, self.kind.slicer.most_steps(), chunk.made_by(&bodies));
        let commands =
            device.encoded("adaptive", |encoder| chunk.encode(&device, encoder, &round, &control, staging))?;
        let bytes = size_of::<Control>() as u64;
        let left = device.read(commands, staging, 0..bytes, bytemuck::pod_read_unaligned::<Control>)?;
        self.kind.attempts += left.all_tried();
        self.kind.held += left.all_held();
        self.kind.longest.made = self.kind.longest.made.max(left.made);
        self.kind.arrived += chunk.take(&control, &left) as u64;
        Ok(left)
    }

    /// Bodies that are advanced side by side: as many as fill a submission while each makes as many attempts as bodies have needed on
    /// average, or as pay for loading and storing it.
    fn side_by_side_bodies(&self) -> usize {
        let needed = self.kind.attempts.checked_div(self.kind.arrived).unwrap_or(u64::MAX);
        self.kind.slicer.bodies(u32::try_from(needed).unwrap_or(u32::MAX))
    }
}
