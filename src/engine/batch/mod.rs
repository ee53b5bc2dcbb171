//! Bodies as the kernels see them: principal axes, scaled, by column.
//!
//! # Scaling
//!
//! Moments from 1e-46 to 1e38 kg m² and spins from 1e-9 to 1e15 rad/s must work in `f32`. Each body is measured in
//! its own units, both powers of two, so that no digit changes: 2^k kg m², the power of two below its middle moment,
//! and 2^r rad/s, the power of two below its spin rate or, where that is greater, below the rate to which the scene's torques
//! bring it within about a radian. Angular momentum is in units of 2^(k+r), and the step size
//! becomes dt · 2^r, formed in the kernel from the column `rate`.
//!
//! [`crate::bodies::columns`] defines the order of columns and rows.

use crate::bodies::Status;
use crate::bodies::columns::{
    RATE_COLUMN, STATE_COMPONENTS, StateWords, keep_rows, parameter_columns, state_columns, status_column, stride_of,
};
use crate::engine::controlled::Written;
use crate::kernel::method::Method;
use crate::math::clock::Clock;
use crate::math::parallel;
use crate::math::real::Scalar;
use crate::math::{Precision, of_either};
use crate::torque::{Kind, TorqueTable};

mod appended;
mod groups;
mod prepare;

pub(crate) use groups::{load_body, load_combinations, load_invariants, load_state, store_state};
pub(crate) use prepare::{Prepared, bytes_per_body_under, frame_of, ordered_together, prepare_acting, prepare_ordered};
pub use prepare::{bytes_per_body, prepare, prepare_members, prepare_with};

/// The scaled bodies of an ensemble as columns of one element type, ready for an engine.
#[derive(Clone, Debug, PartialEq)]
pub struct Batch<T> {
    /// Number of bodies.
    pub body_count: usize,
    /// Distance between the starts of two columns; at least `body_count`. The remaining rows are bodies at rest.
    pub stride: usize,
    /// Parameters, shape `[parameter_columns + torques.columns(), stride]`; [`INVARIANT_COLUMNS`](crate::bodies::columns::INVARIANT_COLUMNS) more after
    /// [`Batch::append_invariants`].
    pub parameters: Vec<T>,
    /// State, shape `[state_columns, stride]`.
    pub state: Vec<T>,
    /// The torques; their columns follow the bodies' own parameters.
    pub torques: TorqueTable,
    /// Rows before which engines that hold bodies in chunks may cut, ascending; if empty, they may cut anywhere.
    pub ends: Vec<usize>,
}

/// A batch of either precision.
#[derive(Clone, Debug, PartialEq)]
pub enum AnyBatch {
    /// In `f32`.
    F32(Batch<f32>),
    /// In `f64`.
    F64(Batch<f64>),
}

impl AnyBatch {
    /// Number of bodies.
    pub fn body_count(&self) -> usize {
        of_either!(AnyBatch, self, batch => batch.body_count)
    }

    /// The torques.
    pub fn torques(&self) -> &TorqueTable {
        of_either!(AnyBatch, self, batch => &batch.torques)
    }

    /// Bytes of its columns.
    pub(crate) fn bytes(&self) -> usize {
        of_either!(AnyBatch, self, batch => size_of_val(&batch.parameters[..]) + size_of_val(&batch.state[..]))
    }

    /// Sets where engines that hold bodies in chunks may cut.
    pub(crate) fn cut_at(&mut self, ends: Vec<usize>) {
        of_either!(AnyBatch, self, batch => batch.ends = ends)
    }

    /// The value of the first body in a parameter column; 0 without bodies.
    pub(crate) fn first_parameter(&self, column: usize) -> f64 {
        of_either!(AnyBatch, self, batch => batch.parameters.get(column * batch.stride).map_or(0.0, |x| x.to_f64()))
    }

    /// The value of a body in a parameter column.
    pub(crate) fn parameter(&self, column: usize, body: usize) -> f64 {
        of_either!(AnyBatch, self, batch => batch.parameters[column * batch.stride + body].to_f64())
    }

    /// Writes columns of parameters of some bodies.
    pub(crate) fn write_parameters(&mut self, written: &Written) {
        of_either!(AnyBatch, self, batch => batch.write_parameters(written))
    }

    /// The raw state of all bodies.
    pub(crate) fn states(&self) -> StateWords {
        of_either!(AnyBatch, self, batch => batch.read(0..batch.body_count))
    }

    /// The same bodies at another time, in these states, as far as the element type holds them.
    pub(crate) fn at(&self, states: &StateWords, clock: Clock) -> Self {
        match self {
            AnyBatch::F32(batch) => AnyBatch::F32(batch.at(states, clock)),
            AnyBatch::F64(batch) => AnyBatch::F64(batch.at(states, clock)),
        }
    }

    /// The first body `body_count` times, for tapped kernels, each of which shows another view of its step.
    pub(crate) fn repeated(&self, body_count: usize) -> Self {
        match self {
            AnyBatch::F32(batch) => AnyBatch::F32(batch.repeated(body_count)),
            AnyBatch::F64(batch) => AnyBatch::F64(batch.repeated(body_count)),
        }
    }

    /// The precision.
    pub fn precision(&self) -> Precision {
        match self {
            AnyBatch::F32(_) => Precision::F32,
            AnyBatch::F64(_) => Precision::F64,
        }
    }
}

/// The fewest bodies that are worth a task of their own when states are read.
const READ_TASK: usize = 1024;

impl<T: Scalar> Batch<T> {
    /// A batch of spherical bodies at rest, without torques.
    pub fn at_rest(body_count: usize) -> Self {
        Self::at_rest_with(body_count, TorqueTable::none(0.0))
    }

    fn at_rest_with(body_count: usize, torques: TorqueTable) -> Self {
        let stride = stride_of(body_count);
        let columns = parameter_columns::<T>() + torques.columns();
        let mut batch = Self {
            body_count,
            stride,
            parameters: vec![T::default(); columns * stride],
            state: vec![T::default(); state_columns::<T>() * stride],
            torques,
            ends: Vec::new(),
        };
        batch.parameters[..3 * stride].fill(T::from_f64(1.0));
        for column in batch.torques.ratio_columns() {
            batch.parameters[column * stride..][..stride].fill(T::from_f64(1.0));
        }
        batch.state[3 * stride..4 * stride].fill(T::from_f64(1.0));
        batch
    }

    /// Keeps only some rows, ascending, which move to the front in their order.
    pub(crate) fn keep(&mut self, rows: &[usize]) {
        let before = std::mem::replace(&mut self.body_count, rows.len());
        keep_rows(&mut self.parameters, self.stride, rows);
        keep_rows(&mut self.state, self.stride, rows);
        self.torques.keep(rows);
        self.ends.clear();
        // As in rows without a body: there is nothing to do in them.
        let rates = &mut self.parameters[RATE_COLUMN * self.stride..][..self.stride];
        rates[rows.len()..before].fill(T::default());
    }

    /// As [`AnyBatch::at`].
    fn at(&self, states: &StateWords, clock: Clock) -> Self {
        let mut batch = self.clone();
        batch.torques.start_at(clock);
        batch.set_states(states);
        batch
    }

    /// Sets the states of the bodies, one for each row, as far as the element type holds them.
    pub(crate) fn set_states(&mut self, states: &StateWords) {
        let own = self.state.chunks_exact_mut(self.stride.max(1)).take(state_columns::<T>());
        parallel::for_each_task(own, |column, own| {
            let word = |body: usize| match column {
                _ if column == status_column::<T>() => states.status[body].code(),
                STATE_COMPONENTS.. => states.residue_of(body)[column - STATE_COMPONENTS],
                _ if T::WORDS == 2 => states.value[body][column],
                _ => states.value[body][column] + states.residue_of(body)[column],
            };
            own.iter_mut().zip(0..states.len()).for_each(|(own, body)| *own = T::from_f64(word(body)));
        });
    }

    /// Writes columns of parameters of some bodies.
    pub(crate) fn write_parameters(&mut self, written: &Written) {
        for (index, column) in written.columns.iter().enumerate() {
            let first = (written.first_column + index) * self.stride + written.first_row;
            let own = &mut self.parameters[first..first + column.len()];
            own.iter_mut().zip(column).for_each(|(own, &number)| *own = T::from_f64(number));
        }
    }

    /// Number of parameter columns.
    pub fn parameter_columns(&self) -> usize {
        self.parameters.len().checked_div(self.stride).unwrap_or(parameter_columns::<T>())
    }

    /// The most iterations of loops in one step of `method`: its own, and in each evaluation of the torques one for
    /// each instance and one for each draw of noise.
    pub(crate) fn loops_of_a_step(&self, method: Method) -> u32 {
        let instances: usize = Kind::ALL.iter().map(|&kind| self.torques.instances(kind).count).sum();
        let noise = self.torques.instances(Kind::WhiteNoise);
        let draws: f64 = (0..noise.count)
            .map(|instance| {
                let column = noise.first + instance * Kind::WhiteNoise.columns() + 1;
                self.parameters.get(column * self.stride).map_or(0.0, |draws| draws.to_f64())
            })
            .sum();
        let own = f64::from(method.most_loops(self.torques.is_empty()));
        (own + f64::from(method.most_evaluations()) * (instances as f64 + draws)).min(f64::from(u32::MAX)) as u32
    }

    /// The raw state of a range of bodies.
    pub fn read(&self, bodies: std::ops::Range<usize>) -> StateWords {
        let value = |body: usize, component: usize| self.state[component * self.stride + body].to_f64();
        let words = |first: usize| -> Vec<[f64; STATE_COMPONENTS]> {
            let of_row = |row: usize| std::array::from_fn(|component| value(bodies.start + row, first + component));
            parallel::rows(bodies.len(), READ_TASK, &of_row)
        };
        let status = |row: usize| Status::from_code(value(bodies.start + row, status_column::<T>()));
        StateWords {
            value: words(0),
            residue: if T::WORDS == 2 { words(STATE_COMPONENTS) } else { Vec::new() },
            status: parallel::rows(bodies.len(), READ_TASK, &status),
        }
    }
}
