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
//! # Layout
//!
//! Component c of body i is at `c * stride + i`. A number that is carried in two words has its residue `residue`
//! columns further on; in `f64` there are no residue columns.

use glam::DVec3;
use rayon::prelude::*;

use crate::kernel::method::{Method, Status};
use crate::math::clock::Clock;
use crate::math::real::Scalar;
use crate::math::vector::TwoWords;
use crate::torque::{Kind, TorqueTable};

mod appended;
mod frame;
mod groups;
mod prepare;
mod user_axes;

pub(crate) use frame::unit_product;
pub use frame::{BodyFrame, BodyState};
pub(crate) use groups::{load_body, load_combinations, load_invariants, load_state, store_state};
pub(crate) use prepare::{
    ORDER_BLOCK, Prepared, bytes_per_body_under, frame_of, initial_state, prepare_acting, prepare_ordered,
};
pub use prepare::{bytes_per_body, prepare, prepare_members, prepare_with};
pub(crate) use user_axes::{USER_BODIES, UserAxes, UserBlock, UserColumns};

/// The arithmetic that a batch is integrated in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "study", derive(serde::Serialize), serde(rename_all = "lowercase"))]
pub enum Precision {
    /// 32-bit floating point, states and parameters carried in two words.
    F32,
    /// 64-bit floating point.
    F64,
}

impl Precision {
    /// Both, narrow first.
    pub const ALL: [Precision; 2] = [Precision::F32, Precision::F64];

    /// The name in study files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Precision::F32 => "f32",
            Precision::F64 => "f64",
        }
    }
}

impl std::fmt::Display for Precision {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(self.name())
    }
}

/// Columns of the state: orientation x, y, z, w, then angular momentum x, y, z.
pub const STATE_COMPONENTS: usize = 7;
/// Columns of the parameters: 1/I₁, 1/I₂, 1/I₃, then the reference rate; residues of 1/I follow in `f32`.
pub const PARAMETER_COMPONENTS: usize = 4;

/// The parameter column of the reference rate, rad/s: a power of two.
pub(crate) const RATE_COLUMN: usize = 3;

/// Number of state columns of an element type: the components' words, then the status.
pub const fn state_columns<T: Scalar>() -> usize {
    STATE_COMPONENTS * T::WORDS + 1
}

/// The state column that holds the number of a [`Status`].
pub const fn status_column<T: Scalar>() -> usize {
    STATE_COMPONENTS * T::WORDS
}

/// Columns that [`Batch::append_invariants`] adds to the parameters: |m|² and the kinetic energy at the start.
pub const INVARIANT_COLUMNS: usize = 2;

/// Number of parameter columns of an element type.
pub const fn parameter_columns<T: Scalar>() -> usize {
    PARAMETER_COMPONENTS + 3 * (T::WORDS - 1)
}

/// Bodies a stride is rounded up to: a multiple of every lane count and of the workgroup size.
pub const STRIDE_UNIT: usize = 64;

/// The scaled bodies of an ensemble as columns of one element type, ready for an engine.
#[derive(Clone, Debug, PartialEq)]
pub struct Batch<T> {
    /// Number of bodies.
    pub body_count: usize,
    /// Distance between the starts of two columns; at least `body_count`. The rows between are bodies at rest.
    pub stride: usize,
    /// Parameters, shape `[parameter_columns + torques.columns(), stride]`; [`INVARIANT_COLUMNS`] more after
    /// [`Batch::append_invariants`].
    pub parameters: Vec<T>,
    /// State, shape `[state_columns, stride]`.
    pub state: Vec<T>,
    /// The torques; their columns stand behind the bodies' own parameters.
    pub torques: TorqueTable,
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
        match self {
            AnyBatch::F32(batch) => batch.body_count,
            AnyBatch::F64(batch) => batch.body_count,
        }
    }

    /// The torques.
    pub fn torques(&self) -> &TorqueTable {
        match self {
            AnyBatch::F32(batch) => &batch.torques,
            AnyBatch::F64(batch) => &batch.torques,
        }
    }

    /// The first body's number in a parameter column; 0 without bodies.
    pub(crate) fn first_parameter(&self, column: usize) -> f64 {
        match self {
            AnyBatch::F32(batch) => batch.parameters.get(column * batch.stride).map_or(0.0, |x| f64::from(*x)),
            AnyBatch::F64(batch) => batch.parameters.get(column * batch.stride).copied().unwrap_or(0.0),
        }
    }

    /// A body's number in a parameter column.
    pub(crate) fn parameter(&self, column: usize, body: usize) -> f64 {
        match self {
            AnyBatch::F32(batch) => f64::from(batch.parameters[column * batch.stride + body]),
            AnyBatch::F64(batch) => batch.parameters[column * batch.stride + body],
        }
    }

    /// The raw state of all bodies.
    pub(crate) fn states(&self) -> StateWords {
        match self {
            AnyBatch::F32(batch) => batch.read(0..batch.body_count),
            AnyBatch::F64(batch) => batch.read(0..batch.body_count),
        }
    }

    /// The same bodies at another time of their way, in these states: what of theirs the element type does not hold is left out.
    pub(crate) fn at(&self, states: &StateWords, clock: Clock) -> Self {
        match self {
            AnyBatch::F32(batch) => AnyBatch::F32(batch.at(states, clock)),
            AnyBatch::F64(batch) => AnyBatch::F64(batch.at(states, clock)),
        }
    }

    /// The first body so many times, for kernels that each look at something else of its step.
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

/// The raw state of some bodies as an engine holds it, exactly, in `f64`.
///
/// Columns as in [`Batch::state`], one row a body: x, y, z, w of the orientation (principal axes to world), then the
/// angular momentum in principal axes, scaled.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StateWords {
    /// First words.
    pub value: Vec<[f64; STATE_COMPONENTS]>,
    /// Second words; zero in `f64`.
    pub residue: Vec<[f64; STATE_COMPONENTS]>,
    /// What the steps so far had to say of each body.
    pub status: Vec<Status>,
}

impl StateWords {
    /// Number of bodies.
    pub fn len(&self) -> usize {
        self.value.len()
    }

    /// Whether there are no bodies.
    pub fn is_empty(&self) -> bool {
        self.value.is_empty()
    }

    /// The state of one body, both words added.
    pub fn combined(&self, body: usize) -> [f64; STATE_COMPONENTS] {
        std::array::from_fn(|component| self.value[body][component] + self.residue[body][component])
    }
}

/// x · 2^n, exactly as long as the result is a normal number.
#[inline]
pub(crate) fn scaled_by_power_of_two(x: f64, n: i32) -> f64 {
    let [first, second] = power_of_two_factors(n);
    x * first * second
}

/// [`scaled_by_power_of_two`] of each component.
#[inline]
pub(crate) fn vector_scaled_by_power_of_two(v: DVec3, n: i32) -> DVec3 {
    let [first, second] = power_of_two_factors(n);
    v * first * second
}

/// Two numbers whose product is 2^n, as one alone may be out of range.
#[inline]
fn power_of_two_factors(n: i32) -> [f64; 2] {
    let power = |n: i32| f64::from_bits(((1023 + n) as u64) << 52);
    let half = (n / 2).clamp(-1000, 1000);
    [power(half), power((n - half).clamp(-1000, 1000))]
}

/// ⌊log₂ x⌋ for x > 0, 0 for x = 0.
#[inline]
pub(crate) fn binary_exponent(x: f64) -> i32 {
    if x == 0.0 {
        return 0;
    }
    let exponent = |x: f64| ((x.to_bits() >> 52) & 0x7ff) as i32 - 1023;
    if x >= f64::MIN_POSITIVE { exponent(x) } else { exponent(scaled_by_power_of_two(x, 200)) - 200 }
}

/// The fewest bodies that are worth a task of their own when states are read.
const READ_TASK: usize = 1024;

impl<T: Scalar> Batch<T> {
    /// A batch of spherical bodies at rest, without torques.
    pub fn at_rest(body_count: usize) -> Self {
        Self::at_rest_with(body_count, TorqueTable::none(0.0))
    }

    fn at_rest_with(body_count: usize, torques: TorqueTable) -> Self {
        let stride = body_count.next_multiple_of(STRIDE_UNIT);
        let columns = parameter_columns::<T>() + torques.columns();
        let mut batch = Self {
            body_count,
            stride,
            parameters: vec![T::default(); columns * stride],
            state: vec![T::default(); state_columns::<T>() * stride],
            torques,
        };
        batch.parameters[..3 * stride].fill(T::from_f64(1.0));
        for column in batch.torques.ratio_columns() {
            batch.parameters[column * stride..][..stride].fill(T::from_f64(1.0));
        }
        batch.state[3 * stride..4 * stride].fill(T::from_f64(1.0));
        batch
    }

    /// Sets one body: `[1/I₁, 1/I₂, 1/I₃, rate]` and `[q x, y, z, w, m x, y, z]`, all scaled.
    pub fn set_row(&mut self, body: usize, parameters: &[f64; PARAMETER_COMPONENTS], state: &[f64; STATE_COMPONENTS]) {
        let Self { stride, parameters: own_parameters, state: own_state, .. } = self;
        let parameter = |column: usize, number| own_parameters[column * *stride + body] = number;
        store_row(parameters, state, parameter, |column, number| own_state[column * *stride + body] = number);
    }

    /// As [`AnyBatch::at`].
    fn at(&self, states: &StateWords, clock: Clock) -> Self {
        let mut batch = self.clone();
        batch.torques.start_at(clock);
        for body in 0..states.len() {
            let mut store =
                |column: usize, number: f64| batch.state[column * batch.stride + body] = T::from_f64(number);
            let words = if T::WORDS == 2 { states.value[body] } else { states.combined(body) };
            words.into_iter().enumerate().for_each(|(component, word)| store(component, word));
            if T::WORDS == 2 {
                let residue = states.residue[body].into_iter().enumerate();
                residue.for_each(|(component, word)| store(STATE_COMPONENTS + component, word));
            }
            store(status_column::<T>(), states.status[body].code());
        }
        batch
    }

    /// Number of parameter columns.
    pub fn parameter_columns(&self) -> usize {
        self.parameters.len().checked_div(self.stride).unwrap_or(parameter_columns::<T>())
    }

    /// The most iterations of loops in one step of `method`: its own, and in each evaluation of the torques one for each
    /// instance and as many more as there are draws of noise.
    pub fn loops_of_a_step(&self, method: Method) -> u32 {
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
            let rows = bodies.clone().into_par_iter().with_min_len(READ_TASK);
            rows.map(|body| std::array::from_fn(|component| value(body, first + component))).collect()
        };
        StateWords {
            value: words(0),
            residue: if T::WORDS == 2 { words(STATE_COMPONENTS) } else { vec![[0.0; STATE_COMPONENTS]; bodies.len()] },
            status: bodies.clone().map(|body| Status::from_code(value(body, status_column::<T>()))).collect(),
        }
    }
}

/// A step size in the two words of an element type.
pub(crate) fn two_words<T: Scalar>(dt: f64) -> TwoWords<T> {
    let (value, residue) = T::two_words(dt);
    TwoWords { value, residue }
}

/// Hands the columns of one body's scaled parameters and state to `parameter` and `component`, with their numbers.
fn store_row<T: Scalar>(
    parameters: &[f64; PARAMETER_COMPONENTS],
    state: &[f64; STATE_COMPONENTS],
    mut parameter: impl FnMut(usize, T),
    mut component: impl FnMut(usize, T),
) {
    for (column, &number) in parameters.iter().enumerate() {
        let (value, residue) = T::two_words(number);
        parameter(column, value);
        if T::WORDS == 2 && column < 3 {
            parameter(PARAMETER_COMPONENTS + column, residue);
        }
    }
    for (column, &number) in state.iter().enumerate() {
        let (value, residue) = T::two_words(number);
        component(column, value);
        if T::WORDS == 2 {
            component(STATE_COMPONENTS + column, residue);
        }
    }
}

/// Some rows of every column.
pub(crate) type ColumnPart<'a, T> = Vec<&'a mut [T]>;

/// Of columns that are `stride` apart the given rows, `count` rows a part.
pub(crate) fn column_parts<T>(
    columns: &mut [T],
    stride: usize,
    rows: std::ops::Range<usize>,
    count: usize,
) -> Vec<ColumnPart<'_, T>> {
    let number = columns.len().checked_div(stride).unwrap_or(0);
    let mut parts: Vec<_> = (0..rows.len().div_ceil(count)).map(|_| Vec::with_capacity(number)).collect();
    if stride > 0 {
        for column in columns.chunks_exact_mut(stride) {
            for (part, rows) in parts.iter_mut().zip(column[rows.clone()].chunks_mut(count)) {
                part.push(rows);
            }
        }
    }
    parts
}
