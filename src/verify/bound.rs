//! How far two correct kernels may part in one step, computed for each body from its own numbers.
//!
//! Both sides take the step from the same bits, so they part only by roundings of this step: compilers re-associate, and some fuse products
//! and sums. The slopes dm/dt and ω of a body are recorded as one graph ([`RecordedMotion`]), and a running error bound
//! ([`super::running`]) says how far roundings may take each. It uses the sizes of the terms of sums, so that torques that cancel keep
//! their roundings. The inputs of a stage have roundings of the stages before it, so the slopes' bounds are computed twice, the second time
//! for inputs that are off by as much as the first time says.
//!
//! A step of h then parts by at most
//!
//! ```text
//! |Δm| ≤ 2 (W h (e_m + R u |m'|) + P u |m|),   |Δq| ≤ 2 (½ W h (e_ω + R u |ω|) + P u)
//! ```
//!
//! with u the unit roundoff, W the sum of the magnitudes of the method's weights, R the roundings in combining its slopes, and P those of
//! the state itself (`Counts` has the numbers). A state in two words of `f32` loses only roundings of the second word, u² relative to it.
//! The factor 2 is for the two sides.
//!
//! The bound is of first order in the errors passed on by slopes, and does not apply to a step outside the method's range: there is none if
//! the quaternion is off the unit sphere by a factor of 2, or if an implicit step turns a body by more than [`LONGEST_IMPLICIT_TURN`]. In
//! long steps it is far above what is observed, as roundings cancel (measured in tests/mirror/verify/grid.rs).

use super::running::bounds_within;
use crate::bodies::columns::{RATE_COLUMN, STATE_COMPONENTS};
use crate::engine::batch::{AnyBatch, Batch};
use crate::expression::{Input, InputKind};
use crate::kernel::method::Method;
use crate::math::clock::Ticks;
use crate::math::real::Scalar;
use crate::math::{Precision, of_either};
use crate::torque::motion::RecordedMotion;
use crate::torque::sum::Source;
use crate::torque::{Kind, TorqueTable};

/// Counts of the roundings in combining a method's slopes.
#[derive(Clone, Copy, Debug)]
struct Counts {
    /// The sum of the magnitudes of its weights, and 1 for what stages pass on.
    weights: f64,
    /// Roundings of an increment.
    increment: f64,
    /// Roundings of the state.
    state: f64,
    /// Whether the state is carried in two words of `f32`.
    compensated: bool,
}

impl Counts {
    fn of(method: Method, free: bool) -> Self {
        let counts = |weights, increment, state| Self { weights, increment, state, compensated: true };
        // Substeps of the splittings under torques; without torques, all three are one free flow.
        let flow = |substeps: f64| {
            let substeps = if free { 1.0 } else { substeps };
            counts(1.0 + 2.0 * substeps, 16.0, 4.0 * substeps)
        };
        match method {
            Method::Rk4 => counts(2.0, 8.0, 2.0),
            // Some of its weights are as large as 6.
            Method::Rk8 => counts(14.0, 8.0, 2.0),
            Method::Cf4 => counts(4.0, 16.0, 4.0),
            Method::Splitting2 => flow(2.0),
            Method::Splitting4 => flow(7.0),
            Method::Splitting6 => flow(12.0),
            // Newton's method ends with a residual of some roundings.
            Method::ImplicitMidpoint | Method::Dlm => counts(4.0, 16.0, 8.0),
            Method::ExplicitEuler | Method::GyroNewton | Method::ClampedEuler | Method::Spiral => {
                Self { compensated: false, ..counts(4.0, 16.0, 8.0) }
            }
            // A sum of up to 31 coefficients, each formed from all before it.
            Method::Taylor => counts(4.0, 64.0, 4.0),
        }
    }
}

/// The longest turn in a step, rad, up to which Newton's method is assumed to find the same solution of an implicit step on all sides.
const LONGEST_IMPLICIT_TURN: f64 = 2.0;
/// Roundings of the inputs of a stage.
const STAGE_ROUNDINGS: f64 = 3.0;
/// Roundings of a time in a step, once for each side.
const TIME_ROUNDINGS: f64 = 8.0;
/// Roundings of a phase, in turns of at most one.
const PHASE_ROUNDINGS: f64 = 4.0;
/// Error of a draw of white noise in ulps (tests/mirror/torque_parity.rs); its components are below 7, hence so many units of roundoff.
const DRAW_ULPS: f64 = 16.0;
const DRAW_ROUNDINGS: f64 = 2.0 * DRAW_ULPS * 4.0;
/// Roundings of |q|² and of the correction that follows from it, along q.
const NORM_ROUNDINGS: f64 = 8.0;
/// Roundings of a projected component, where nothing cancels.
const PROJECTION_ROUNDINGS: f64 = 16.0;

/// The bounds of a group's steps.
pub(super) struct StepBounds {
    motion: Option<RecordedMotion>,
    counts: Counts,
    unit_roundoff: f64,
    least: f64,
    two_words: bool,
    projected: bool,
    is_implicit: bool,
}

/// How far a body's state may part in one step, in units of its own scale.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowBound {
    /// The quaternion across itself: the attitude.
    pub across: f64,
    /// The quaternion along itself.
    pub norm: f64,
    /// The angular momentum.
    pub momentum: f64,
    /// The slopes that it follows from.
    pub slopes: Slopes,
}

impl RowBound {
    /// Whether it bounds anything: for numbers near overflow it may not be finite.
    pub fn is_finite(&self) -> bool {
        [self.across, self.norm, self.momentum].iter().all(|bound| bound.is_finite())
    }
}

/// How far the inputs and results of an evaluation may differ between two sides; in units of the body's own scale, the time in s.
#[derive(Clone, Copy, Debug)]
pub(super) struct EvaluationBounds {
    pub time: f64,
    pub orientation: f64,
    pub angular_momentum: f64,
    pub angular_velocity: f64,
    /// For the gyroscopic term and for the torque.
    pub angular_momentum_rate: f64,
    pub orientation_rate: f64,
}

/// The slopes of one body, as magnitudes, with their error bounds.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Slopes {
    pub momentum_rate: f64,
    pub momentum_rate_error: f64,
    pub rate: f64,
    pub rate_error: f64,
    pub momentum: f64,
}

impl Slopes {
    fn or(self, other: Self) -> Self {
        Self {
            momentum_rate: self.momentum_rate.max(other.momentum_rate),
            momentum_rate_error: self.momentum_rate_error.max(other.momentum_rate_error),
            rate: self.rate.max(other.rate),
            rate_error: self.rate_error.max(other.rate_error),
            momentum: self.momentum.max(other.momentum),
        }
    }
}

/// A body at the start and at the end of a step of `dt` s, as its twin takes it.
pub(super) struct Stepped<'a> {
    pub row: usize,
    /// Ticks of the clock at its start.
    pub ticks: u64,
    pub dt: f64,
    pub start: &'a [f64; STATE_COMPONENTS],
    pub end: &'a [f64; STATE_COMPONENTS],
}

impl StepBounds {
    /// The bounds of steps under the torques of a table.
    pub fn new(table: &TorqueTable, method: Method, precision: Precision, projected: bool) -> Self {
        let (unit_roundoff, least, two_words) = match precision {
            Precision::F32 => (f32::UNIT_ROUNDOFF, f64::from(f32::MIN_POSITIVE), true),
            Precision::F64 => (f64::UNIT_ROUNDOFF, f64::MIN_POSITIVE, false),
        };
        let counts = Counts::of(method, table.is_empty());
        let is_implicit = matches!(method, Method::ImplicitMidpoint | Method::Dlm);
        Self {
            motion: RecordedMotion::new(table).ok(),
            counts,
            unit_roundoff,
            least,
            two_words,
            projected,
            is_implicit,
        }
    }

    /// Whether the torques could be recorded; otherwise no step has a bound.
    pub fn are_known(&self) -> bool {
        self.motion.is_some()
    }

    /// The unit roundoff of the arithmetic.
    pub fn unit_roundoff(&self) -> f64 {
        self.unit_roundoff
    }

    /// Values below this may be taken for zero.
    pub fn least(&self) -> f64 {
        self.least
    }

    /// The bound of one body's step; `None` if a decision of the torques hangs on rounding, if a torque is too long to be recorded
    /// beside the others, or if the step is so long that the method leaves its range, where roundings are magnified beyond what is counted
    /// here.
    pub fn of(&self, batch: &AnyBatch, step: &Stepped<'_>) -> Option<RowBound> {
        let (counts, u) = (self.counts, self.unit_roundoff);
        if ![step.start, step.end].into_iter().all(is_near_unit_sphere) {
            return None;
        }
        let slopes = self.slopes(batch, step, &[])?;
        let h = step.dt * batch.parameter(RATE_COLUMN, step.row);
        // Beyond this, its equation has several solutions, and rounding decides which is found, and whether one is.
        if self.is_implicit && h * slopes.rate > LONGEST_IMPLICIT_TURN {
            return None;
        }
        let state = if self.two_words && counts.compensated { 2.0 * u * u } else { counts.state * u };
        let increments =
            |error: f64, size: f64| counts.weights * h * (error + counts.increment * u * size + self.least);
        let mut momentum =
            2.0 * (increments(slopes.momentum_rate_error, slopes.momentum_rate) + state * slopes.momentum + self.least);
        if self.projected {
            momentum = amplification(batch, step.row) * (momentum + PROJECTION_ROUNDINGS * u * slopes.momentum);
        }
        let across = 2.0 * (0.5 * increments(slopes.rate_error, slopes.rate) + state + self.least);
        Some(RowBound { across, norm: across + 2.0 * NORM_ROUNDINGS * u, momentum, slopes })
    }

    /// The slopes of a step at its start and its end, and at other states in it, each with its time after the start, s.
    fn slopes(
        &self,
        batch: &AnyBatch,
        step: &Stepped<'_>,
        others: &[([f64; STATE_COMPONENTS], f64)],
    ) -> Option<Slopes> {
        let (counts, u) = (self.counts, self.unit_roundoff);
        let h = step.dt * batch.parameter(RATE_COLUMN, step.row);
        let motion = self.motion.as_ref()?;
        let at = |state, phases: &[f64]| slopes(motion, batch, step.row, phases, state, (h, counts.weights, u));
        let start = phases(batch, step.row, step.ticks);
        let mut slopes = at(step.start, &start)?.or(at(step.end, &start)?);
        let ticks_per_second = batch.torques().clock().ticks_per_second();
        for (state, elapsed) in others {
            let ticks = step.ticks + (elapsed * ticks_per_second) as u64;
            slopes = slopes.or(at(state, &phases(batch, step.row, ticks))?);
        }
        slopes.momentum_rate_error += noise_error(batch, step) * u;
        Some(slopes)
    }

    /// The bounds of the evaluations of one body's step, which take place at these states and times, as far as they are known; those of
    /// the results are what the bound of the step multiplies by its weights. `None` as in [`StepBounds::of`].
    pub fn of_evaluations(
        &self,
        batch: &AnyBatch,
        step: &Stepped<'_>,
        states: &[([f64; STATE_COMPONENTS], f64)],
    ) -> Option<EvaluationBounds> {
        let (counts, u) = (self.counts, self.unit_roundoff);
        let slopes = self.slopes(batch, step, states)?;
        let h = step.dt * batch.parameter(RATE_COLUMN, step.row);
        let answer = |error: f64, size: f64| 2.0 * (error + counts.increment * u * size + self.least);
        let angular_velocity = answer(slopes.rate_error, slopes.rate);
        let angular_momentum_rate = answer(slopes.momentum_rate_error, slopes.momentum_rate);
        // A stage is read in one word, however the state is carried.
        let stage = 2.0 * (STAGE_ROUNDINGS + counts.state) * u;
        let orientation = 0.5 * counts.weights * h * angular_velocity + stage;
        Some(EvaluationBounds {
            time: TIME_ROUNDINGS * u * step.dt,
            orientation,
            angular_momentum: counts.weights * h * angular_momentum_rate + stage * slopes.momentum + self.least,
            angular_velocity,
            angular_momentum_rate,
            orientation_rate: 0.5 * (angular_velocity + slopes.rate * orientation),
        })
    }
}

/// Whether the quaternion of a state is a unit one, except for the deviation that a usable step leaves.
fn is_near_unit_sphere(state: &[f64; STATE_COMPONENTS]) -> bool {
    let square = state[..4].iter().map(|q| q * q).sum::<f64>();
    (0.25..4.0).contains(&square)
}

/// The slopes of one body in a state.
fn slopes(
    motion: &RecordedMotion,
    batch: &AnyBatch,
    row: usize,
    phases: &[f64],
    state: &[f64; STATE_COMPONENTS],
    (h, weights, u): (f64, f64, f64),
) -> Option<Slopes> {
    let (graph, outputs) = motion.graph();
    let norm = |numbers: &[f64]| numbers.iter().map(|x| x * x).sum::<f64>().sqrt();
    let momentum = norm(&state[4..]);
    let form = |of_orientation: f64, of_momentum: f64| -> Option<Slopes> {
        let input = |input: Input| {
            let index = usize::from(input.index);
            match input.kind {
                InputKind::Parameter => (batch.parameter(index, row), 0.0),
                InputKind::Orientation => (state[index], of_orientation),
                InputKind::AngularMomentum => (state[4 + index], of_momentum),
                InputKind::Phase => (phases[index], PHASE_ROUNDINGS * u),
                InputKind::Time => {
                    let time = phases.last().copied().unwrap_or(f64::NAN);
                    (time, STAGE_ROUNDINGS * u * time.abs())
                }
                // A batch has no other inputs.
                _ => (f64::NAN, 0.0),
            }
        };
        let found = bounds_within(graph, &outputs, input, u);
        let parts: Vec<_> = found.into_iter().collect::<Option<_>>()?;
        let size = |part: std::ops::Range<usize>| norm(&parts[part].iter().map(|x| x.size()).collect::<Vec<_>>());
        let error = |part: std::ops::Range<usize>| norm(&parts[part].iter().map(|x| x.error).collect::<Vec<_>>());
        Some(Slopes {
            momentum_rate: size(0..3),
            momentum_rate_error: error(0..3),
            rate: size(3..6),
            rate_error: error(3..6),
            momentum,
        })
    };
    let (orientation, stage) = (STAGE_ROUNDINGS * u, STAGE_ROUNDINGS * u * momentum);
    let first = form(orientation, stage)?;
    let handed_on = weights * h;
    form(
        orientation + handed_on * 0.5 * (first.rate_error + u * first.rate),
        stage + handed_on * (first.momentum_rate_error + u * first.momentum_rate),
    )
}

/// The phases of a body at some ticks, in turns, followed by the time, s, if it is read.
fn phases(batch: &AnyBatch, row: usize, ticks: u64) -> Vec<f64> {
    fn of<T: Scalar>(batch: &Batch<T>, row: usize, ticks: u64) -> Vec<f64> {
        let Batch { parameters, stride, torques, .. } = batch;
        let source = Source { table: torques, parameters, stride: *stride, clock: torques.clock(), dt: 0.0 };
        let columns = source.columns::<T>(row);
        let start = |number| columns.start_phase(number, &Ticks::Equal(ticks)).to_f64();
        (0..torques.start_places()).map(start).collect()
    }
    of_either!(AnyBatch, batch, batch => of(batch, row, ticks))
}

/// How far the random torque of a step may be off, in units of roundoff.
fn noise_error(batch: &AnyBatch, step: &Stepped<'_>) -> f64 {
    let noise = batch.torques().instances(Kind::WhiteNoise);
    let of_instance = |instance: usize| {
        let first = noise.first + instance * Kind::WhiteNoise.columns();
        let [intensity, draws] = [first, first + 1].map(|column| batch.parameter(column, step.row));
        DRAW_ROUNDINGS * intensity * draws / step.dt.sqrt()
    };
    (0..noise.count).map(of_instance).sum()
}

/// The factor by which a projection may magnify the error of one component of the angular momentum: it computes the others as
/// (g₁/g₂)^½ times it, with the coefficients g of Euler's equations.
fn amplification(batch: &AnyBatch, row: usize) -> f64 {
    let inverse = [0, 1, 2].map(|axis| batch.parameter(axis, row));
    let g = [inverse[2] - inverse[1], inverse[0] - inverse[2], inverse[1] - inverse[0]].map(f64::abs);
    let least = g.into_iter().filter(|&g| g > 0.0).fold(f64::INFINITY, f64::min);
    let greatest = g.into_iter().fold(0.0, f64::max);
    if least.is_finite() { 1.0 + (greatest / least).sqrt() } else { 1.0 }
}
