//! Columns of some bodies in adaptive steps, and how far they have come.

use std::ops::Range;

use super::super::buffers::{
    DeviceScalar, INPUT_AND_OUTPUT, OUTPUT, Place, SETTINGS, Upload, bind, buffer, upload_batch, write_parameters,
};
use super::super::device::{Device, Refusal};
use super::super::reading::{Reader, keep_rows, read_columns};
use super::super::session::DeviceChunk;
use super::control::{ADVANCE_GROUPS, Bodies, COMPACT_GROUPS, Control, GROUP_ENTRIES, TALLY_BYTES};
use super::{Layouts, Round};
use crate::bodies::columns::{STRIDE_UNIT, state_columns};
use crate::engine::StepCounts;
use crate::engine::batch::Batch;
use crate::engine::controlled::Written;
use crate::error::Result;
use crate::kernel::method::rk8_adaptive::{Controller, LEAST_STEP};
use crate::math::clock::Clock;
use crate::math::real::Scalar;
use crate::math::vector::{TwoWords, two_words_of};
use crate::scene::AdaptiveSteps;

/// Columns of a controller on the device: step, left (two words), retried.
const CONTROLLER_COLUMNS: usize = 4;

/// Words of a body's counts: steps taken and steps refused, low word first.
const COUNT_COLUMNS: usize = 4;

/// Bytes of a body's row in the widest buffer, and in all of them.
pub(super) fn row_bytes<T: Scalar>(parameters: usize) -> (usize, usize) {
    let words = size_of::<u32>();
    let rows = [
        parameters * size_of::<T>(),
        state_columns::<T>() * size_of::<T>(),
        CONTROLLER_COLUMNS * size_of::<T>(),
        COUNT_COLUMNS * words,
        // Two lists and the outcomes.
        words,
        words,
        words,
    ];
    (rows.into_iter().max().unwrap_or(0), rows.into_iter().sum())
}

/// The interval that bodies are brought through, in an element type's words.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interval<T> {
    span: [T; 2],
    tolerance: T,
    least_step: T,
    least_step_in_seconds: bool,
    ticks: u64,
    tick_scale: T,
}

impl<T: Scalar> Interval<T> {
    pub fn new(start: &Clock, end: &Clock, steps: &AdaptiveSteps) -> Self {
        let (value, residue) = start.seconds_until(end);
        let (span, steps) = (two_words_of::<T>(value, residue), steps.over(value, end.seconds()));
        Self {
            span: [span.value, span.residue],
            tolerance: T::from_f64(steps.tolerance),
            least_step: T::from_f64(steps.least_step.unwrap_or(LEAST_STEP)),
            least_step_in_seconds: steps.least_step.is_some(),
            ticks: start.ticks(),
            // A run has about 2^60 ticks: their number in a second would leave the range of f32.
            tick_scale: T::from_f64(crate::math::power_of_two::scaled_by_power_of_two(start.ticks_per_second(), -60)),
        }
    }
}

/// Some bodies in buffers of their own.
pub(super) struct Chunk {
    /// Index of the first body.
    pub first: usize,
    /// Number of bodies.
    pub bodies: usize,
    pub stride: usize,
    pub state: wgpu::Buffer,
    /// Rows from here on have not been tried in this interval.
    untried: u32,
    /// Length of the list of bodies under way.
    listed: u32,
    /// Attempts since rows were last added to the list.
    made: u32,
    /// Which of the lists and control blocks the next round reads.
    turn: usize,
    parameters: wgpu::Buffer,
    controllers: wgpu::Buffer,
    counts: wgpu::Buffer,
    lists: [wgpu::Buffer; 2],
    controls: [wgpu::Buffer; 2],
    outcomes: wgpu::Buffer,
    tallies: wgpu::Buffer,
    settings: wgpu::Buffer,
    /// Of `adaptive.wgsl` and of `compact.wgsl`, by turn.
    bind_groups: [[wgpu::BindGroup; 2]; 2],
}

impl Chunk {
    pub fn new<T: Scalar>(
        device: &Device,
        layouts: &Layouts,
        Range { start: first, end }: Range<usize>,
        parameter_columns: usize,
    ) -> Result<Self, Refusal> {
        let bodies = end - first;
        let stride = bodies.next_multiple_of(STRIDE_UNIT);
        let reals = |columns: usize| (columns * stride * size_of::<T>()) as u64;
        let words = |columns: usize| (columns * stride * size_of::<u32>()) as u64;
        let parameters = buffer(device, "parameters", reals(parameter_columns), INPUT_AND_OUTPUT)?;
        let state = buffer(device, "state", reals(state_columns::<T>()), INPUT_AND_OUTPUT)?;
        // Zeros, as the device fills new buffers: nothing tried, nothing counted.
        let controllers = buffer(device, "controllers", reals(CONTROLLER_COLUMNS), INPUT_AND_OUTPUT)?;
        let counts = buffer(device, "counts", words(COUNT_COLUMNS), INPUT_AND_OUTPUT)?;
        let lists = [buffer(device, "list", words(1), OUTPUT)?, buffer(device, "list", words(1), OUTPUT)?];
        let outcomes = buffer(device, "outcomes", words(1), OUTPUT)?;
        let tallies = (stride as u64).div_ceil(u64::from(GROUP_ENTRIES)) * TALLY_BYTES;
        let tallies = buffer(device, "tallies", tallies, OUTPUT)?;
        let control =
            || buffer(device, "control", size_of::<Control>() as u64, INPUT_AND_OUTPUT | wgpu::BufferUsages::INDIRECT);
        let controls = [control()?, control()?];
        let settings = buffer(device, "settings", settings_bytes::<T>(), SETTINGS)?;
        let bound = |turn: usize| {
            let (list, next_list) = (&lists[turn], &lists[1 - turn]);
            let (control, next_control) = (&controls[turn], &controls[1 - turn]);
            let advance = [&settings, &parameters, &state, &controllers, &counts, list, &outcomes, control];
            let compact = [control, next_control, list, next_list, &outcomes, &tallies];
            let advance = bind(device, "adaptive", &layouts.advance, advance)?;
            Ok([advance, bind(device, "adaptive", &layouts.compact, compact)?])
        };
        let bind_groups = [bound(0)?, bound(1)?];
        Ok(Self {
            first,
            bodies,
            stride,
            state,
            untried: bodies as u32,
            listed: 0,
            made: 0,
            turn: 0,
            parameters,
            controllers,
            counts,
            lists,
            controls,
            outcomes,
            tallies,
            settings,
            bind_groups,
        })
    }

    /// Uploads the bodies' parameters and states; rows that are no bodies are NaN.
    pub fn upload<T: Scalar>(&self, upload: &mut Upload<'_>, batch: &Batch<T>) -> Result<()> {
        upload_batch(upload, batch, &self.parameters, &self.place())
    }

    /// Puts all bodies at the start of an interval.
    pub fn start_interval<T: Scalar>(&mut self, device: &Device, interval: &Interval<T>) {
        (self.untried, self.listed) = (0, 0);
        device.write(&self.settings, 0, &settings(self.stride as u32, interval));
    }

    /// Its bodies that have not come to the end of the interval.
    pub fn left(&self) -> usize {
        (self.bodies as u32 - self.untried + self.listed) as usize
    }

    /// The bodies of the next submission: those under way, and of the others as many as make up `most`.
    pub fn next_bodies(&self, most: usize) -> Bodies {
        let most = u32::try_from(most).unwrap_or(u32::MAX);
        let fresh = most.saturating_sub(self.listed).min(self.bodies as u32 - self.untried);
        Bodies { listed: self.listed, fresh, first_fresh: self.untried, starts: true }
    }

    /// All its bodies, which stand where their controllers say.
    pub fn all_bodies(&self) -> Bodies {
        Bodies { listed: 0, fresh: self.bodies as u32, first_fresh: 0, starts: false }
    }

    /// Adds a submission's rounds to an encoder, and a copy of what comes of them to `target`.
    pub fn encode(
        &self,
        device: &Device,
        encoder: &mut wgpu::CommandEncoder,
        round: &Round,
        control: &Control,
        target: &wgpu::Buffer,
    ) {
        device.write(&self.controls[self.turn], 0, bytemuck::bytes_of(control));
        let rounds = control.rounds();
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        for number in 0..rounds {
            let turn = (self.turn + number) % 2;
            let (block, [advance, compact]) = (&self.controls[turn], &self.bind_groups[turn]);
            // The size of the first round is known; those of the others are in the blocks that the device writes.
            let dispatch = |pass: &mut wgpu::ComputePass<'_>, [groups, _, _]: [u32; 3], place: u64| match number {
                0 => device.dispatch(pass, groups),
                _ => device.dispatch_indirect(pass, block, place),
            };
            pass.set_pipeline(&round.advance);
            pass.set_bind_group(0, advance, &[]);
            dispatch(&mut pass, control.advance_groups, ADVANCE_GROUPS);
            pass.set_bind_group(0, compact, &[]);
            for pipeline in &round.compact {
                pass.set_pipeline(pipeline);
                dispatch(&mut pass, control.compact_groups, COMPACT_GROUPS);
            }
        }
        drop(pass);
        encoder.copy_buffer_to_buffer(
            &self.controls[(self.turn + rounds) % 2],
            0,
            target,
            0,
            size_of::<Control>() as u64,
        );
    }

    /// Attempts since rows were last added, where a submission adds as many as `bodies` says.
    pub fn made_by(&self, bodies: &Bodies) -> u32 {
        if bodies.fresh > 0 { 0 } else { self.made }
    }

    /// Notes what a submission left; gives the number of bodies that have arrived.
    pub fn take(&mut self, asked: &Control, left: &Control) -> usize {
        self.turn = (self.turn + asked.rounds()) % 2;
        self.untried = self.untried.max(asked.first_fresh + asked.fresh);
        (self.listed, self.made) = (left.listed, left.made);
        (asked.listed + asked.fresh - left.listed) as usize
    }

    /// Puts its bodies where these controllers, of all bodies, say.
    pub fn take_controllers<T: Scalar>(&self, device: &Device, controllers: &[Controller<f64>]) -> Result<()> {
        let own = &controllers[self.first..self.first + self.bodies];
        let columns = [
            |own: &Controller<f64>| own.step,
            |own: &Controller<f64>| own.left.value,
            |own: &Controller<f64>| own.left.residue,
            |own: &Controller<f64>| own.retried,
        ];
        let numbers: Vec<T> = columns.iter().flat_map(|of| own.iter().map(|own| T::from_f64(of(own)))).collect();
        let mut upload = Upload::new(device);
        upload.columns(&self.controllers, self.stride, &numbers, own.len(), 0..own.len(), T::from_f64(f64::NAN))?;
        upload.finish()
    }

    /// Reads where its bodies stand into their places among `controllers`, but for their counts.
    pub fn give_controllers<T: Scalar>(
        &self,
        device: &Device,
        reader: &mut Reader,
        controllers: &mut [Controller<f64>],
    ) -> Result<()> {
        let block = reader.block(CONTROLLER_COLUMNS * size_of::<T>());
        for first in (0..self.bodies).step_by(block) {
            let rows = first..(first + block).min(self.bodies);
            let own = &mut controllers[self.first + rows.start..self.first + rows.end];
            let place = (0..CONTROLLER_COLUMNS, rows);
            read_columns(device, &self.controllers, self.stride, reader.staging(), place, |numbers: &[T]| {
                let count = own.len();
                for (row, own) in own.iter_mut().enumerate() {
                    let number = |column: usize| numbers[column * count + row].to_f64();
                    (own.step, own.retried) = (number(0), number(3));
                    own.left = TwoWords { value: number(1), residue: number(2) };
                }
            })?;
        }
        Ok(())
    }

    /// The counts of its bodies, appended to `counts`.
    pub fn read_counts(&self, device: &Device, reader: &mut Reader, counts: &mut Vec<StepCounts>) -> Result<()> {
        let block = reader.block(COUNT_COLUMNS * size_of::<u32>());
        for first in (0..self.bodies).step_by(block) {
            let rows = first..(first + block).min(self.bodies);
            let place = (0..COUNT_COLUMNS, rows.clone());
            read_columns(device, &self.counts, self.stride, reader.staging(), place, |words: &[u32]| {
                let count = |column: usize, row: usize| {
                    let word = |column: usize| u64::from(words[column * rows.len() + row]);
                    word(column) | (word(column + 1) << 32)
                };
                let of_row = |row| StepCounts { accepted: count(0, row), rejected: count(2, row) };
                counts.extend((0..rows.len()).map(of_row));
            })?;
        }
        Ok(())
    }
}

impl DeviceChunk for Chunk {
    fn place(&self) -> Place<'_> {
        Place { first: self.first, bodies: self.bodies, stride: self.stride, state: &self.state }
    }

    fn move_rows<T: DeviceScalar>(&self, device: &Device, reader: &mut Reader, rows: &[usize]) -> Result<()> {
        let of = (self.stride, self.bodies);
        for columns in [&self.parameters, &self.state, &self.controllers] {
            keep_rows::<T>(device, columns, of, reader.staging(), rows)?;
        }
        keep_rows::<u32>(device, &self.counts, of, reader.staging(), rows)
    }

    fn set_bodies(&mut self, bodies: Range<usize>) {
        (self.first, self.bodies) = (bodies.start, bodies.len());
        // All have arrived.
        (self.untried, self.listed) = (self.bodies as u32, 0);
    }

    fn write_parameters<T: DeviceScalar>(&self, device: &Device, written: &Written) -> Result<()> {
        write_parameters::<T>(device, &self.parameters, &self.place(), written)
    }

    fn destroy(&self) {
        let own = [&self.parameters, &self.state, &self.controllers, &self.counts, &self.outcomes, &self.tallies];
        let blocks = self.lists.iter().chain(&self.controls).chain([&self.settings]);
        own.into_iter().chain(blocks).for_each(wgpu::Buffer::destroy);
    }
}

/// The uniform block of `adaptive.wgsl`: in either precision its members follow each other without gaps.
fn settings<T: Scalar>(stride: u32, interval: &Interval<T>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut put = |part: &[u8]| bytes.extend_from_slice(part);
    put(bytemuck::cast_slice(&[stride, 0_u32]));
    put(bytemuck::cast_slice(&[interval.span[0], interval.span[1], interval.tolerance, interval.least_step]));
    let ticks = [interval.ticks as u32, (interval.ticks >> 32) as u32];
    put(bytemuck::cast_slice(&[u32::from(interval.least_step_in_seconds), 0, ticks[0], ticks[1]]));
    put(bytemuck::bytes_of(&interval.tick_scale));
    bytes.resize(settings_bytes::<T>() as usize, 0);
    bytes
}

/// Its members of 32 bits, and those of the element type.
const SETTINGS_WORDS: usize = 6;
const SETTINGS_REALS: usize = 5;

/// Its size, a multiple of the alignment of its members.
fn settings_bytes<T: Scalar>() -> u64 {
    ((SETTINGS_WORDS * size_of::<u32>() + SETTINGS_REALS * size_of::<T>()) as u64).next_multiple_of(8)
}
