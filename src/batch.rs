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

use glam::{DQuat, DVec3};
use rayon::prelude::*;

use crate::ensemble::Ensemble;
use crate::error::Result;
use crate::inertia::principal_axes;
use crate::memory;
use crate::method::{Method, Status};
use crate::plan::group::Members;
use crate::real::Scalar;
use crate::torque::{self, Kind, Torque, TorqueTable};
use crate::vector::TwoWords;

mod appended;
mod groups;

pub(crate) use groups::{load_body, load_combinations, load_invariants, load_state, store_state};

/// The arithmetic that a batch is integrated in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
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

    /// The precision.
    pub fn precision(&self) -> Precision {
        match self {
            AnyBatch::F32(_) => Precision::F32,
            AnyBatch::F64(_) => Precision::F64,
        }
    }
}

/// What leads from a scaled state back to the user's axes and units; where moments of inertia change in time, at the time that
/// it is made for, which is 0 at first ([`BodyFrame::at`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyFrame {
    /// Principal moments in units of 2^`moment_exponent` kg m², ascending; of a linear rotor those that it is integrated
    /// with, I, I, I ([`crate::torque::linear_rotor`]).
    pub scaled_moments: DVec3,
    /// Whether the body is a linear rotor, whose axis is the first principal one.
    pub is_linear_rotor: bool,
    /// Rotates principal coordinates to body coordinates.
    pub principal_to_body: DQuat,
    /// k: moments are in units of 2^k kg m².
    pub moment_exponent: i32,
    /// r: rates are in units of 2^r rad/s.
    pub rate_exponent: i32,
}

/// One body's state in the user's axes and units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyState {
    /// Unit quaternion that rotates body coordinates to world.
    pub orientation: DQuat,
    /// Angular velocity in body axes, rad/s.
    pub angular_velocity_body: DVec3,
    /// Angular momentum in world axes, N m s.
    pub angular_momentum_world: DVec3,
    /// Rotational kinetic energy, J.
    pub kinetic_energy: f64,
    /// |q| − 1 of the orientation as it was integrated, before it was normalised for output.
    pub norm_error: f64,
    /// What the integrator had to say of this body.
    pub status: Status,
}

impl BodyState {
    /// Not a number in every place, so that a state that was never written cannot pass for one.
    pub(crate) const UNKNOWN: Self = Self {
        orientation: DQuat::NAN,
        angular_velocity_body: DVec3::NAN,
        angular_momentum_world: DVec3::NAN,
        kinetic_energy: f64::NAN,
        norm_error: f64::NAN,
        status: Status::Valid,
    };
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
pub(crate) fn scaled_by_power_of_two(x: f64, n: i32) -> f64 {
    let power = |n: i32| f64::from_bits(((1023 + n) as u64) << 52);
    let half = (n / 2).clamp(-1000, 1000);
    x * power(half) * power((n - half).clamp(-1000, 1000))
}

/// ⌊log₂ x⌋ for x > 0, 0 for x = 0.
pub(crate) fn binary_exponent(x: f64) -> i32 {
    if x == 0.0 {
        return 0;
    }
    let exponent = |x: f64| ((x.to_bits() >> 52) & 0x7ff) as i32 - 1023;
    if x >= f64::MIN_POSITIVE { exponent(x) } else { exponent(scaled_by_power_of_two(x, 200)) - 200 }
}

/// The frame of one body and its initial state in it.
pub(crate) fn prepare_body(
    ensemble: &Ensemble,
    torques: &[Torque],
    body: usize,
) -> (BodyFrame, [f64; STATE_COMPONENTS]) {
    let mut axes = principal_axes(&ensemble.inertia()[body]);
    let is_linear_rotor = ensemble.is_linear_rotor(body);
    if is_linear_rotor {
        axes.moments = DVec3::splat(0.5 * axes.moments.y + 0.5 * axes.moments.z);
    }
    let moment_exponent = binary_exponent(axes.moments.y);
    let scaled_moments =
        DVec3::from_array(axes.moments.to_array().map(|i| scaled_by_power_of_two(i, -moment_exponent)));
    let omega_body = ensemble.angular_velocity_body()[body];
    let rate = omega_body.abs().max_element().max(torque::rate_of(torques, body, axes.moments.y));
    let rate_exponent = binary_exponent(rate);
    let omega_body = DVec3::from_array(omega_body.to_array().map(|w| scaled_by_power_of_two(w, -rate_exponent)));
    let mut omega = axes.principal_to_body.conjugate() * omega_body;
    if is_linear_rotor {
        omega.x = 0.0;
    }
    let m = scaled_moments * omega;
    let q = (ensemble.orientation()[body] * axes.principal_to_body).normalize();
    let principal_to_body = axes.principal_to_body;
    let frame = BodyFrame { scaled_moments, is_linear_rotor, principal_to_body, moment_exponent, rate_exponent };
    (frame, [q.x, q.y, q.z, q.w, m.x, m.y, m.z])
}

/// The state of one body at the start, by the same route as every later one.
pub(crate) fn initial_state(ensemble: &Ensemble, body: usize) -> BodyState {
    let (frame, scaled) = prepare_body(ensemble, &[], body);
    frame.body_state(scaled)
}

impl BodyFrame {
    /// The frame of a body that is already scaled and in its principal axes.
    pub(crate) const UNIT: Self = Self {
        scaled_moments: DVec3::ONE,
        is_linear_rotor: false,
        principal_to_body: DQuat::IDENTITY,
        moment_exponent: 0,
        rate_exponent: 0,
    };

    /// The principal moments of the body's tensor, in units of 2^`moment_exponent` kg m², ascending.
    pub(crate) fn tensor_moments(&self) -> DVec3 {
        if self.is_linear_rotor { self.scaled_moments * DVec3::new(0.0, 1.0, 1.0) } else { self.scaled_moments }
    }

    /// The scaled parameters: 1/I₁, 1/I₂, 1/I₃ and 2^r.
    fn parameters(&self) -> [f64; PARAMETER_COMPONENTS] {
        let inverse = self.scaled_moments.recip();
        [inverse.x, inverse.y, inverse.z, scaled_by_power_of_two(1.0, self.rate_exponent)]
    }

    /// Body coordinates to principal.
    pub(crate) fn to_principal(self, vector_body: DVec3) -> DVec3 {
        self.principal_to_body.conjugate() * vector_body
    }

    /// `x` in SI units, whose dimension is (kg m²)^`moments` · s^−`rates`, in the body's own units.
    pub(crate) fn scaled(&self, x: f64, moments: i32, rates: i32) -> f64 {
        scaled_by_power_of_two(x, -(self.moment_exponent * moments + self.rate_exponent * rates))
    }

    /// A torque (N m) in the body's own units, component by component.
    pub(crate) fn scaled_torque(&self, torque: DVec3) -> DVec3 {
        DVec3::from_array(torque.to_array().map(|x| self.scaled(x, 1, 2)))
    }

    /// The frame with the moments that the body has at `time`, s: of another one where `torques` hold moments that change.
    /// `body` is its index in the scene.
    #[must_use]
    pub fn at(&self, torques: &[Torque], body: usize, time: f64) -> Self {
        Self { scaled_moments: torque::variable_inertia::scaled_moments_at(torques, body, self, time), ..*self }
    }

    /// The state in the user's axes and units from a scaled one (`[q x, y, z, w, m x, y, z]`, see [`StateWords`]).
    pub fn body_state(&self, scaled: [f64; STATE_COMPONENTS]) -> BodyState {
        let q = DQuat::from_xyzw(scaled[0], scaled[1], scaled[2], scaled[3]);
        // A linear rotor has no spin; a method that turns about one axis after another makes some, of its own error.
        let along = if self.is_linear_rotor { 0.0 } else { scaled[4] };
        let m = DVec3::new(along, scaled[5], scaled[6]);
        let norm = q.length();
        let unit = q * (1.0 / norm);
        let omega = m / self.scaled_moments;
        let scale = |v: DVec3, n: i32| DVec3::from_array(v.to_array().map(|x| scaled_by_power_of_two(x, n)));
        BodyState {
            orientation: (unit * self.principal_to_body.conjugate()).normalize(),
            angular_velocity_body: scale(self.principal_to_body * omega, self.rate_exponent),
            angular_momentum_world: scale(unit * m, self.moment_exponent + self.rate_exponent),
            kinetic_energy: scaled_by_power_of_two(0.5 * m.dot(omega), self.moment_exponent + 2 * self.rate_exponent),
            norm_error: norm - 1.0,
            status: Status::Valid,
        }
    }
}

/// Brings an ensemble without torques into principal axes and scales it, in `f64`, and writes it as columns of
/// `precision`.
///
/// # Errors
///
/// [`crate::Error::TooManyBodies`] where the memory does not suffice.
pub fn prepare(ensemble: &Ensemble, precision: Precision) -> Result<(Vec<BodyFrame>, AnyBatch)> {
    prepare_with(ensemble, &[], 0.0, precision)
}

/// As [`prepare`], with torques that act over a span of `span` seconds. The torques' parameters must be valid.
///
/// # Errors
///
/// As [`prepare`].
pub fn prepare_with(
    ensemble: &Ensemble,
    torques: &[Torque],
    span: f64,
    precision: Precision,
) -> Result<(Vec<BodyFrame>, AnyBatch)> {
    prepare_members(ensemble, torques, span, &Members::All(ensemble.len()), precision)
}

/// As [`prepare_with`], of some bodies of the ensemble, one a row. A body's row does not depend on the others.
///
/// # Errors
///
/// As [`prepare`].
pub fn prepare_members(
    ensemble: &Ensemble,
    torques: &[Torque],
    span: f64,
    members: &Members,
    precision: Precision,
) -> Result<(Vec<BodyFrame>, AnyBatch)> {
    Ok(match precision {
        Precision::F32 => {
            let (frames, batch) = prepare_columns::<f32>(ensemble, torques, span, members)?;
            (frames, AnyBatch::F32(batch))
        }
        Precision::F64 => {
            let (frames, batch) = prepare_columns::<f64>(ensemble, torques, span, members)?;
            (frames, AnyBatch::F64(batch))
        }
    })
}

/// Bytes that [`prepare`] takes for one body, frames included.
pub fn bytes_per_body(precision: Precision) -> usize {
    let columns = match precision {
        Precision::F32 => (state_columns::<f32>() + parameter_columns::<f32>()) * size_of::<f32>(),
        Precision::F64 => (state_columns::<f64>() + parameter_columns::<f64>()) * size_of::<f64>(),
    };
    columns + size_of::<BodyFrame>()
}

/// Bytes that [`prepare_with`] takes for one body under some torques, frames included.
pub(crate) fn bytes_per_body_under(precision: Precision, torques: &[Torque], span: f64) -> usize {
    let of_torques = match precision {
        Precision::F32 => torque::bytes_per_body::<f32>(&TorqueTable::new(torques, 0, STRIDE_UNIT, span, false)),
        Precision::F64 => torque::bytes_per_body::<f64>(&TorqueTable::new(torques, 0, STRIDE_UNIT, span, false)),
    };
    bytes_per_body(precision) + of_torques
}

/// Bodies that one task prepares; small enough to balance, large enough to stream.
const BLOCK: usize = 4096;

/// The fewest bodies that are worth a task of their own when states are read.
const READ_TASK: usize = 1024;

fn prepare_columns<T: Scalar>(
    ensemble: &Ensemble,
    torques: &[Torque],
    span: f64,
    members: &Members,
) -> Result<(Vec<BodyFrame>, Batch<T>)> {
    let body_count = members.len();
    let precision = if T::WORDS == 1 { Precision::F64 } else { Precision::F32 };
    let has_linear_rotors =
        ensemble.has_linear_rotors() && (0..body_count).any(|row| ensemble.is_linear_rotor(members.body(row)));
    let stride = body_count.next_multiple_of(STRIDE_UNIT);
    let table = TorqueTable::new(torques, parameter_columns::<T>(), stride, span, has_linear_rotors);
    let row = bytes_per_body(precision) + torque::bytes_per_body::<T>(&table);
    memory::require(body_count, body_count.saturating_mul(row), "the columns of the kernels")?;
    let mut batch = Batch::<T>::at_rest_with(body_count, table);
    let mut frames = Vec::with_capacity(body_count);
    for start in (0..body_count).step_by(BLOCK) {
        let end = (start + BLOCK).min(body_count);
        let rows: Vec<_> =
            (start..end).into_par_iter().map(|row| prepare_body(ensemble, torques, members.body(row))).collect();
        for (offset, (frame, state)) in rows.into_iter().enumerate() {
            let row = start + offset;
            batch.set_row(row, &frame.parameters(), &state);
            let Batch { stride, parameters, torques: table, .. } = &mut batch;
            let orientation = DQuat::from_xyzw(state[0], state[1], state[2], state[3]);
            table.write_body(torques, members.body(row), row, &frame, orientation, |column, number| {
                parameters[column * *stride + row] = T::from_f64(number);
            });
            frames.push(frame);
        }
    }
    Ok((frames, batch))
}

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
        let stride = self.stride;
        for (component, &number) in parameters.iter().enumerate() {
            let (value, residue) = T::two_words(number);
            self.parameters[component * stride + body] = value;
            if T::WORDS == 2 && component < 3 {
                self.parameters[(PARAMETER_COMPONENTS + component) * stride + body] = residue;
            }
        }
        for (component, &number) in state.iter().enumerate() {
            let (value, residue) = T::two_words(number);
            self.state[component * stride + body] = value;
            if T::WORDS == 2 {
                self.state[(STATE_COMPONENTS + component) * stride + body] = residue;
            }
        }
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
