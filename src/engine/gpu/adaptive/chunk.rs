//! Columns of some bodies in adaptive steps, and the list of those that are under way.

use std::ops::Range;

use super::super::buffers::{Place, STAGING_BYTES, WORKGROUP_SIZE, buffer, write_columns};
use super::super::device::{Device, Refusal};
use super::super::reading::read_columns;
use crate::bodies::columns::{STRIDE_UNIT, state_columns};
use crate::engine::adaptive_session::{StepCounts, two_words_of};
use crate::engine::batch::Batch;
use crate::error::Result;
use crate::kernel::method::rk8_adaptive::{Controller, LEAST_STEP};
use crate::math::clock::Clock;
use crate::math::real::Scalar;
use crate::math::vector::TwoWords;
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
        let span = two_words_of::<T>(value, residue);
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
    /// Rows of the bodies under way, in order.
    pub list: Vec<u32>,
    /// Whether no body has been advanced in this interval yet.
    starts: bool,
    /// The most attempts of a body in this interval so far.
    made: u32,
    parameters: wgpu::Buffer,
    controllers: wgpu::Buffer,
    counts: wgpu::Buffer,
    list_buffer: wgpu::Buffer,
    outcomes: wgpu::Buffer,
    settings: wgpu::Buffer,
    bind_group: wgpu::BindGroup,
}

/// Attempts of the first dispatch of an interval: of fewer, the cost of loading and storing a body is a part that counts.
const FIRST_ATTEMPTS: u32 = 8;

/// What a dispatch says of a body: its attempts, and in this bit whether it is still under way.
const UNDER_WAY: u32 = 1 << 31;

/// What the bodies of a list did in a dispatch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Tally {
    /// Attempts of all bodies.
    pub attempts: u64,
    /// The same with those that bodies waited for the slowest of their workgroup.
    pub held: u64,
    /// The most of a body.
    pub longest: u32,
    /// Bodies that have nothing left to do.
    pub finished: usize,
}

impl Chunk {
    pub fn new<T: Scalar>(
        device: &Device,
        layout: &wgpu::BindGroupLayout,
        first: usize,
        bodies: usize,
        parameter_columns: usize,
    ) -> std::result::Result<Self, Refusal> {
        let stride = bodies.next_multiple_of(STRIDE_UNIT);
        let reals = |columns: usize| (columns * stride * size_of::<T>()) as u64;
        let words = |columns: usize| (columns * stride * size_of::<u32>()) as u64;
        let input = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let output = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let parameters = buffer(device, "parameters", reals(parameter_columns), input)?;
        let state = buffer(device, "state", reals(state_columns::<T>()), input | output)?;
        // Zeros, as the device fills new buffers: nothing tried, nothing counted.
        let controllers = buffer(device, "controllers", reals(CONTROLLER_COLUMNS), input | output)?;
        let counts = buffer(device, "counts", words(COUNT_COLUMNS), output)?;
        let list_buffer = buffer(device, "list", words(1), input)?;
        let outcomes = buffer(device, "outcomes", words(1), output)?;
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let settings = buffer(device, "settings", settings_bytes::<T>(), uniform)?;
        let buffers = [&settings, &parameters, &state, &controllers, &counts, &list_buffer, &outcomes];
        let entries: [_; BINDINGS] = std::array::from_fn(|binding| wgpu::BindGroupEntry {
            binding: binding as u32,
            resource: buffers[binding].as_entire_binding(),
        });
        let bind_group = device.scoped(|| {
            device.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("adaptive"),
                layout,
                entries: &entries,
            })
        })?;
        Ok(Self {
            first,
            bodies,
            stride,
            state,
            list: Vec::new(),
            starts: false,
            made: 0,
            parameters,
            controllers,
            counts,
            list_buffer,
            outcomes,
            settings,
            bind_group,
        })
    }

    /// Where its state is.
    pub fn place(&self) -> Place<'_> {
        Place { first: self.first, bodies: self.bodies, stride: self.stride, state: &self.state }
    }

    /// Uploads the bodies' parameters and states; rows that are no bodies are NaN.
    pub fn upload<T: Scalar>(&self, device: &Device, batch: &Batch<T>) -> Result<()> {
        let rows = self.first..self.first + self.bodies;
        let nan = T::from_f64(f64::NAN);
        write_columns(device, &self.parameters, self.stride, &batch.parameters, batch.stride, rows.clone(), nan)?;
        write_columns(device, &self.state, self.stride, &batch.state, batch.stride, rows, nan)
    }

    /// Puts all bodies at the start of an interval.
    pub fn start_interval(&mut self) {
        self.list = (0..self.bodies as u32).collect();
        self.starts = true;
        self.made = 0;
    }

    /// Puts its bodies where these controllers, of all bodies, say.
    pub fn take_controllers<T: Scalar>(&mut self, device: &Device, controllers: &[Controller<f64>]) -> Result<()> {
        self.list = (0..self.bodies as u32).collect();
        self.starts = false;
        let own = &controllers[self.first..self.first + self.bodies];
        let columns = [
            |own: &Controller<f64>| own.step,
            |own: &Controller<f64>| own.left.value,
            |own: &Controller<f64>| own.left.residue,
            |own: &Controller<f64>| own.retried,
        ];
        let numbers: Vec<T> = columns.iter().flat_map(|of| own.iter().map(|own| T::from_f64(of(own)))).collect();
        write_columns(device, &self.controllers, self.stride, &numbers, own.len(), 0..own.len(), T::from_f64(f64::NAN))
    }

    /// Reads where its bodies stand into their places among `controllers`, but for their counts; gives the bytes moved.
    pub fn give_controllers<T: Scalar>(
        &self,
        device: &Device,
        staging: &wgpu::Buffer,
        controllers: &mut [Controller<f64>],
    ) -> Result<u64> {
        let block = staging.size() as usize / (CONTROLLER_COLUMNS * size_of::<T>());
        let mut bytes = 0;
        for first in (0..self.bodies).step_by(block) {
            let rows = first..(first + block).min(self.bodies);
            let own = &mut controllers[self.first + rows.start..self.first + rows.end];
            let place = (0..CONTROLLER_COLUMNS, rows);
            bytes += read_columns(device, &self.controllers, self.stride, staging, place, |numbers: &[T]| {
                let count = own.len();
                for (row, own) in own.iter_mut().enumerate() {
                    let number = |column: usize| numbers[column * count + row].to_f64();
                    (own.step, own.retried) = (number(0), number(3));
                    own.left = TwoWords { value: number(1), residue: number(2) };
                }
            })?;
        }
        Ok(bytes)
    }

    /// The most attempts of the next dispatch: as many as its bodies have made in this interval, so that one that has arrived
    /// holds its workgroup for no more attempts than its own. The number of dispatches is the logarithm of the attempts.
    pub fn next_attempts(&self) -> u32 {
        self.made.max(FIRST_ATTEMPTS)
    }

    /// Sets the uniform block and the list for the next submission.
    pub fn set<T: Scalar>(&mut self, queue: &wgpu::Queue, interval: &Interval<T>, attempts: u32) {
        let starts = std::mem::take(&mut self.starts);
        let settings = settings(self.list.len() as u32, self.stride as u32, attempts, starts, interval);
        queue.write_buffer(&self.settings, 0, &settings);
        queue.write_buffer(&self.list_buffer, 0, bytemuck::cast_slice(&self.list));
    }

    /// Adds the dispatch of the list to a pass.
    pub fn dispatch(&self, pass: &mut wgpu::ComputePass<'_>) {
        pass.set_bind_group(0, &self.bind_group, &[]);
        pass.dispatch_workgroups((self.list.len() as u32).div_ceil(WORKGROUP_SIZE), 1, 1);
    }

    /// Bytes of the outcomes of the list.
    pub fn outcome_bytes(&self) -> u64 {
        size_of_val(self.list.as_slice()) as u64
    }

    /// Copies the outcomes of the list to `target` from byte `offset` on.
    pub fn copy_outcomes(&self, encoder: &mut wgpu::CommandEncoder, target: &wgpu::Buffer, offset: u64) {
        encoder.copy_buffer_to_buffer(&self.outcomes, 0, target, offset, self.outcome_bytes());
    }

    /// Keeps the bodies that are still under way in the list.
    pub fn compact(&mut self, outcomes: &[u32]) -> Tally {
        let tally = tally(outcomes, WORKGROUP_SIZE as usize);
        self.made = self.made.saturating_add(tally.longest);
        let mut outcome = outcomes.iter();
        self.list.retain(|_| outcome.next().is_some_and(|outcome| outcome & UNDER_WAY != 0));
        tally
    }

    /// The counts of its bodies, appended to `counts`; gives the bytes moved.
    pub fn read_counts(&self, device: &Device, staging: &wgpu::Buffer, counts: &mut Vec<StepCounts>) -> Result<u64> {
        let bytes = (COUNT_COLUMNS * self.stride * size_of::<u32>()) as u64;
        let mut encoder =
            device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("counts") });
        encoder.copy_buffer_to_buffer(&self.counts, 0, staging, 0, bytes);
        let commands = device.scoped(|| encoder.finish()).map_err(|refusal| device.refused(refusal))?;
        device.read(commands, staging, 0..bytes, |view| {
            let words: &[u32] = bytemuck::cast_slice(view);
            let count = |column: usize, row: usize| {
                let word = |column: usize| u64::from(words[column * self.stride + row]);
                word(column) | (word(column + 1) << 32)
            };
            counts.extend((0..self.bodies).map(|row| StepCounts { accepted: count(0, row), rejected: count(2, row) }));
        })?;
        Ok(bytes)
    }

    /// Gives its memory back.
    pub fn destroy(&self) {
        let own = [&self.parameters, &self.state, &self.controllers, &self.counts, &self.list_buffer, &self.outcomes];
        own.into_iter().chain([&self.settings]).for_each(wgpu::Buffer::destroy);
    }
}

/// Bytes of the buffer through which `bodies` bodies are read, `group` of whose outcomes are read at a time.
pub(super) fn staging_bytes<T: Scalar>(bodies: usize, group: usize) -> u64 {
    let row = state_columns::<T>() * size_of::<T>();
    let stride = bodies.next_multiple_of(STRIDE_UNIT);
    let states = (STAGING_BYTES / row / STRIDE_UNIT * STRIDE_UNIT).min(stride) * row;
    states.max(stride.min(group) * size_of::<u32>()) as u64
}

/// What the bodies of a list did, in workgroups of `group`.
fn tally(outcomes: &[u32], group: usize) -> Tally {
    let attempts = |outcome: &u32| outcome & !UNDER_WAY;
    let mut tally = Tally::default();
    for beside in outcomes.chunks(group) {
        let longest = beside.iter().map(attempts).max().unwrap_or(0);
        tally.attempts += beside.iter().map(|outcome| u64::from(attempts(outcome))).sum::<u64>();
        tally.held += u64::from(longest) * beside.len() as u64;
        tally.longest = tally.longest.max(longest);
        tally.finished += beside.iter().filter(|outcome| *outcome & UNDER_WAY == 0).count();
    }
    tally
}

/// Bindings of `adaptive.wgsl`.
pub(super) const BINDINGS: usize = 7;

/// Which of them hold what is only read, from the second on; the first is the uniform block.
pub(super) const READ_ONLY: [bool; BINDINGS] = [true, true, false, false, false, true, false];

/// The uniform block of `adaptive.wgsl`: in either precision its members follow each other without gaps.
fn settings<T: Scalar>(listed: u32, stride: u32, attempts: u32, starts: bool, interval: &Interval<T>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut put = |part: &[u8]| bytes.extend_from_slice(part);
    put(bytemuck::cast_slice(&[listed, stride, attempts, 0_u32]));
    put(bytemuck::cast_slice(&[interval.span[0], interval.span[1], interval.tolerance, interval.least_step]));
    let ticks = [interval.ticks as u32, (interval.ticks >> 32) as u32];
    put(bytemuck::cast_slice(&[u32::from(interval.least_step_in_seconds), u32::from(starts), ticks[0], ticks[1]]));
    put(bytemuck::bytes_of(&interval.tick_scale));
    bytes.resize(settings_bytes::<T>() as usize, 0);
    bytes
}

/// Its members of 32 bits, and those of the element type.
const SETTINGS_WORDS: usize = 8;
const SETTINGS_REALS: usize = 5;

/// Its size, a multiple of the alignment of its members.
fn settings_bytes<T: Scalar>() -> u64 {
    ((SETTINGS_WORDS * size_of::<u32>() + SETTINGS_REALS * size_of::<T>()) as u64).next_multiple_of(8)
}

/// Chunks whose bodies are advanced together: from the first with bodies under way on, as many as fit.
pub(super) fn next_group(lists: impl Iterator<Item = usize>, group_bodies: usize) -> Vec<usize> {
    let mut bodies = 0;
    let mut group = Vec::new();
    for (index, listed) in lists.enumerate().filter(|&(_, listed)| listed > 0) {
        bodies += listed;
        if !group.is_empty() && bodies > group_bodies {
            break;
        }
        group.push(index);
    }
    group
}

/// Rows of a chunk that lie in a range of bodies.
pub(super) fn rows_in(chunk: &Chunk, bodies: &Range<usize>) -> Range<usize> {
    let start = bodies.start.max(chunk.first);
    let end = bodies.end.min(chunk.first + chunk.bodies).max(start);
    start - chunk.first..end - chunk.first
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tally_counts_waiting_by_workgroup() {
        let under_way = |attempts: u32| attempts | UNDER_WAY;
        // Two workgroups of two, and one body alone.
        let outcomes = [under_way(4), 1, 0, 3, under_way(2)];
        let expected = Tally { attempts: 10, held: 8 + 6 + 2, longest: 4, finished: 3 };
        assert_eq!(tally(&outcomes, 2), expected);
    }

    #[test]
    fn groups_pass_over_chunks_without_bodies_under_way() {
        let group = |lists: &[usize], most| next_group(lists.iter().copied(), most);
        assert_eq!(group(&[0, 5, 0, 7, 3], 12), [1, 3]);
        assert_eq!(group(&[20, 1], 12), [0]);
        assert_eq!(group(&[0, 0], 12), Vec::<usize>::new());
    }
}
