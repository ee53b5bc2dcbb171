//! `variable-inertia`: principal moments that change in time while the angular momentum does not.
//!
//! A skater who draws in the arms, a satellite that extends booms, a molecule that vibrates. The state of every body is (q, m), so the
//! angular momentum is unaffected, and the rate at which the axes turn follows from it:
//!
//! ```text
//! dm/dt = m × ω + τ,   ω = I(t)⁻¹ m,   I(t) = I₀ + (I₁ − I₀) s(t),   0 ≤ s ≤ 1
//! ```
//!
//! (Liouville's equation of a body of variable moments; H. Goldstein, *Classical Mechanics*, 2nd ed., section 5-5, for the principle, and
//! P. C. Hughes, *Spacecraft Attitude Dynamics*, 1986, section 3.3, with the relative angular momentum of the parts neglected.) **The
//! internal motion carries no angular momentum of its own**, and the principal axes stay where they are in the body: parts move to and fro
//! along radii, in opposite pairs, or symmetrically about an axis. Their drive does the work dT/dt = ω·τ − ½ ω·(dI/dt) ω in addition to
//! that of the torques.
//!
//! I is linear in s, so that every intermediate tensor is that of a body if both ends are. The law s(t) is
//!
//! * a *ramp*, s = r(u) with u = (t − t₀)/Δ clamped to [0, 1] and r the polynomial of degree 13 whose first six derivatives vanish
//!   at both ends (the regularised incomplete beta function of 7 and 7; M. Abramowitz, I. A. Stegun, *Handbook of
//!   Mathematical Functions*, 26.5.1). A step that contains an end of the ramp makes an error of dt⁸ once, so that `rk8` keeps
//!   its order 8, and `rk4` and `cf4` theirs; the slope is greatest halfway, r′ = 2.94;
//! * an *oscillation*, s = ½ (1 − cos Ωt), from I₀ to I₁ and back with the period 2π/Ω.
//!
//! # Accuracy
//!
//! In `f32` 1/I is carried in two words here too. Both ends are exact to 1e-14, so that a body before or after a ramp is as
//! accurate as a rigid one; in between s is rounded, differently in each step, and the relative error of the angle turned meanwhile is
//! at most 3e-8.
//!
//! Torques that follow from the tensor (the gravity gradient) read the tensor of their time.
//!
//! Moments may also follow a formula of the user's own: [`Torque::custom_moments`].
//!
//! Methods that assume ω = I₀⁻¹ m are refused ([`crate::Error::RigidOnly`]).

use super::formula::{Column, Epoch, Formula, MOST_PHASES, Rates, Role, Row, rates};
use std::sync::LazyLock;

use glam::{DQuat, DVec3};

pub use super::inertia_change::{InertiaChange, Law};
use super::model::InertiaModel;
use super::{Declaration, Kind, Model, ParameterDeclaration, Torque, ValidationContext, Validity, Value, Values};
use crate::bodies::BodyFrame;
use crate::bodies::Ensemble;
use crate::bodies::inertia::{InertiaTensor, VANISHING_MOMENT, principal_axes};
use crate::error::Result;
use crate::error::TRIANGLE_TOLERANCE;
use crate::kernel::rigid_body::{Body, Correction};
use crate::kernel::torque_kernel::Motion;
use crate::math::real::{Real, Scalar, sin_cos};
use crate::math::vector::{TwoWords, Vector, two_difference};

/// Moments of inertia that change in time; see the [module](self). A scene has at most one.
///
/// It is not a torque, as it does not change the angular momentum, but it affects a body like one and is in the same list.
///
/// ```
/// use glam::{DQuat, DVec3};
/// use polhode::torque::variable_inertia::{InertiaChange, Law};
/// use polhode::{Engine, Ensemble, Method, Plan, Scene, Torque};
///
/// // A skater draws in the arms within two seconds and turns three times as fast.
/// let skater = Ensemble::from_columns(&[DVec3::new(12.0, 12.0, 3.0)], &[DQuat::IDENTITY], &[DVec3::Z])?;
/// let arms_in = InertiaChange::tensor(DVec3::new(10.0, 10.0, 1.0));
/// let scene = Scene::new(skater).until(5.0).torque(Torque::variable_inertia(arms_in, Law::ramp(1.0, 2.0)));
/// let scene = scene.pinned(Method::Rk4, 0.01, None);
/// let engine = Engine::cpu();
/// let record = engine.run(&Plan::new(&scene, &engine)?)?;
/// assert!((record.final_state().angular_velocity_body(0).z - 3.0).abs() < 1e-12);
/// # Ok::<(), polhode::Error>(())
/// ```
pub struct VariableInertia;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let number = ParameterDeclaration::number;
    let start = number("ramp.start", "s", "the time at which the ramp starts");
    let duration = number("ramp.duration", "s", "the ramp's duration");
    let rate = number("oscillation.rate", "rad/s", "the angular frequency Ω of the oscillation");
    let factor = number("factor", "1", "the factor by which the body's own tensor changes");
    let source = "P. C. Hughes, Spacecraft Attitude Dynamics, 1986, section 3.3";
    Declaration::new("variable-inertia", "ω = I(t)⁻¹ m, I(t) = I₀ + (I₁ − I₀) s(t)", source)
        .not_rigid()
        .note("s = ½ (1 − cos rate t), or the incomplete beta I_u(7, 7), u = (t − start)/duration")
        .only_one("the moments of a body change by one law: expected one such entry, whose parameters may be columns")
        .parameters([
            ParameterDeclaration::tensor("inertia", "the tensor after the change").choice("change").drawn_as(0),
            factor.valid(Validity::Positive).choice("change").drawn_as(0),
            start.valid(Validity::NotNegative).choice("law").drawn_as(1).phase_rate(),
            duration.valid(Validity::Positive).choice("law").drawn_as(2),
            rate.choice("law").drawn_as(3).phase_rate(),
        ])
});
const INERTIA: usize = 0;
const FACTOR: usize = 1;
const START: usize = 2;
const DURATION: usize = 3;
const RATE: usize = 4;

impl Torque {
    /// Moments of inertia that change in time by a law, while the angular momentum does not; see [`VariableInertia`].
    pub fn variable_inertia(change: InertiaChange, law: Law) -> Self {
        let (inertia, factor) = match change {
            InertiaChange::Tensor(tensor) => (Value::Tensor(tensor), Value::Absent),
            InertiaChange::Factor(factor) => (Value::Absent, Value::Number(factor)),
        };
        let [start, duration, rate] = match law {
            Law::Ramp { start, duration } => [Value::Number(start), Value::Number(duration), Value::Absent],
            Law::Oscillation { rate } => [Value::Absent, Value::Absent, Value::Number(rate)],
        };
        Self::built(&VariableInertia, [inertia, factor, start, duration, rate])
    }
}

/// The moments of one body at the end of the change.
enum End {
    /// I₁ in body axes, kg m².
    Tensor(InertiaTensor),
    /// I₁/I₀.
    Factor(f64),
}

impl End {
    fn of_body(values: Values<'_>, body: usize) -> Self {
        match values.given(INERTIA).and_then(Value::as_tensor) {
            Some(tensor) => Self::Tensor(tensor.at(body)),
            None => Self::Factor(values.number(FACTOR).at(body)),
        }
    }

    /// The moments of I₁ in units of the body's own scale and along its principal axes.
    fn scaled_moments(&self, frame: &BodyFrame) -> DVec3 {
        match self {
            Self::Factor(factor) => frame.scaled_moments * *factor,
            Self::Tensor(tensor) => {
                let tensor = tensor.rotated(frame.principal_to_body.conjugate());
                let moments = DVec3::new(tensor.xx, tensor.yy, tensor.zz);
                let moments =
                    if frame.is_linear_rotor { DVec3::splat(0.5 * moments.y + 0.5 * moments.z) } else { moments };
                DVec3::from_array(moments.to_array().map(|moment| frame.scaled(moment, 1, 0)))
            }
        }
    }
}

/// The start and duration of a ramp, s; `None` for an oscillation.
fn ramp(values: Values<'_>, body: usize) -> Option<(f64, f64)> {
    values.given(START)?;
    Some((values.number(START).at(body), values.number(DURATION).at(body)))
}

/// s at a time, s.
fn done(values: Values<'_>, body: usize, time: f64) -> f64 {
    match ramp(values, body) {
        Some((start, duration)) => {
            let progress = (time - start) / duration;
            inertia_ramp(progress.clamp(0.0, 1.0))
        }
        None => {
            // Half the phase and its rounding error, so that it is exact after any number of turns.
            let half_rate = 0.5 * values.number(RATE).at(body);
            let half_phase = half_rate * time;
            let lost = half_rate.mul_add(time, -half_phase);
            let (sin, cos) = half_phase.sin_cos();
            let sine = sin + lost * cos;
            sine * sine
        }
    }
}

impl InertiaModel for VariableInertia {
    fn tensor_at(&self, values: Values<'_>, body: usize, initial: InertiaTensor, time: f64) -> InertiaTensor {
        let changed = match End::of_body(values, body) {
            End::Tensor(tensor) => tensor,
            End::Factor(factor) => initial * factor,
        };
        initial + (changed - initial) * done(values, body, time)
    }

    fn scaled_moments_at(&self, values: Values<'_>, body: usize, frame: &BodyFrame, time: f64) -> DVec3 {
        let changed = End::of_body(values, body).scaled_moments(frame);
        frame.scaled_moments + (changed - frame.scaled_moments) * done(values, body, time)
    }

    fn spin_growth(&self, values: Values<'_>, body: usize, initial: &InertiaTensor, _: f64) -> f64 {
        match End::of_body(values, body) {
            End::Factor(factor) => factor.recip().max(1.0),
            End::Tensor(tensor) => {
                let axes = principal_axes(initial);
                let tensor = tensor.rotated(axes.principal_to_body.conjugate());
                // A linear rotor does not turn about its first axis.
                let ratios = [axes.moments.x / tensor.xx, axes.moments.y / tensor.yy, axes.moments.z / tensor.zz];
                ratios.into_iter().filter(|ratio| ratio.is_finite()).fold(1.0, f64::max)
            }
        }
    }
}

/// How far a tensor after the change may be from the body's principal axes: off-diagonal elements relative to its largest
/// element. An allowance for rounding of six elements; the axes of a body with nearly equal moments are no better determined.
const AXES_TOLERANCE: f64 = 1e-9;

const AXES: &str = "expected an inertia with the principal axes of the body's own: off-diagonal elements along them must vanish (kg m²)";
const POSITIVE: &str = "expected an inertia with positive principal moments (kg m²)";
const LINEAR: &str = "a linear rotor stays one: expected an inertia with no moment about the body's axis (kg m²)";
const TRIANGLE: &str = "no mass distribution has this inertia: I1 + I2 >= I3 is needed (this is I1 + I2 - I3, kg m²)";

impl Model for VariableInertia {
    declared!();

    fn kind(&self, values: Values<'_>) -> Kind {
        if values.given(START).is_some() { Kind::InertiaRamp } else { Kind::InertiaOscillation }
    }

    /// Both ends are checked; every tensor in between is a weighted mean of them.
    fn validate_bodies(&self, values: Values<'_>, context: &ValidationContext, ensemble: &Ensemble) -> Result<()> {
        let Some(tensor) = values.given(INERTIA).and_then(Value::as_tensor) else { return Ok(()) };
        for (body, initial) in ensemble.inertia().iter().enumerate() {
            let refused = |value, expected| Err(context.refusal(Some(body), "inertia", value, expected));
            let tensor = tensor.at(body).rotated(principal_axes(initial).principal_to_body.conjugate());
            let largest = tensor.to_array().into_iter().fold(0.0_f64, |largest, element| largest.max(element.abs()));
            let across = [tensor.xy, tensor.xz, tensor.yz].into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs()));
            if let Some(across) = across.filter(|across| across.abs() > AXES_TOLERANCE * largest) {
                return refused(across, AXES);
            }
            let mut moments = [tensor.xx, tensor.yy, tensor.zz];
            if ensemble.is_linear_rotor(body) && moments[0].abs() > AXES_TOLERANCE * largest {
                return refused(moments[0], LINEAR);
            }
            moments.sort_by(f64::total_cmp);
            let least = if ensemble.is_linear_rotor(body) { moments[1] } else { moments[0] };
            if least.is_nan() || least <= VANISHING_MOMENT * largest {
                return refused(least, POSITIVE);
            }
            let excess = moments[0] + moments[1] - moments[2];
            let tolerance = if ensemble.is_linear_rotor(body) { AXES_TOLERANCE } else { TRIANGLE_TOLERANCE };
            if excess < -tolerance * moments[2] {
                return refused(excess, TRIANGLE);
            }
        }
        Ok(())
    }

    fn acts_on(&self, values: Values<'_>, body: usize) -> bool {
        !matches!(End::of_body(values, body), End::Factor(1.0))
    }

    fn acts_on_all(&self, _: Values<'_>) -> bool {
        false
    }

    /// The greatest rate at which s changes, which a step must follow too.
    fn rate(&self, values: Values<'_>, body: usize, _: f64) -> f64 {
        ramp(values, body).map_or_else(|| values.number(RATE).at(body).abs(), |(_, duration)| STEEPEST / duration)
    }

    fn columns(&self, values: Values<'_>, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let changed_moments = End::of_body(values, body).scaled_moments(frame);
        let pairs = frame.scaled_moments.to_array().into_iter().zip(changed_moments.to_array());
        for (axis, (initial, changed)) in pairs.enumerate() {
            let difference = changed.recip() - initial.recip();
            let first_word = f64::from(difference as f32);
            out[axis] = initial / changed;
            out[3 + axis] = first_word;
            out[6 + axis] = difference - first_word;
        }
        // For the gravity gradient, which reads the true tensor.
        let gained = changed_moments - frame.scaled_moments;
        let gained = if frame.is_linear_rotor { gained * DVec3::new(0.0, 1.0, 1.0) } else { gained };
        out[9..12].copy_from_slice(&[gained.z - gained.y, gained.x - gained.z, gained.y - gained.x]);
    }

    /// For a ramp its start and duration, from which the table computes its progress.
    fn phase_rates(&self, values: Values<'_>, body: usize) -> Rates {
        let own = ramp(values, body).unwrap_or_else(|| (values.number(RATE).at(body), 0.0));
        rates([own])
    }

    fn inertia_change(&self) -> Option<&dyn InertiaModel> {
        Some(self)
    }
}

/// A body's principal moments at a time (s) in units of its own scale, along its principal axes.
pub(crate) fn scaled_moments_at(torques: &[Torque], body: usize, frame: &BodyFrame, time: f64) -> DVec3 {
    let change = torques.iter().find_map(Torque::inertia_change);
    change.map_or(frame.scaled_moments, |(model, values)| model.scaled_moments_at(values, body, frame, time))
}

/// A body's tensor at a time (s), kg m², body axes.
pub(crate) fn tensor_at(torques: &[Torque], body: usize, initial: InertiaTensor, time: f64) -> InertiaTensor {
    torques.iter().fold(initial, |tensor, torque| torque.tensor_at(body, tensor, time))
}

/// The factor by which a body may turn faster within a span (s) as its moments change; 1 if they do not.
pub(crate) fn spin_growth(torques: &[Torque], body: usize, initial: &InertiaTensor, span: f64) -> f64 {
    let change = torques.iter().find_map(Torque::inertia_change);
    change.map_or(1.0, |(model, values)| model.spin_growth(values, body, initial, span))
}

/// The greatest r′(u), 12012/4096, rounded up.
const STEEPEST: f64 = 2.94;

/// Ticks from the start of a ramp to `ticks`, rounded; negative before it.
#[inline(always)]
pub fn ticks_since<T: Scalar>(ticks: u64, start: u64) -> T {
    let difference = ticks.wrapping_sub(start);
    let (high, low) = ((difference >> 32) as i32, difference as u32);
    T::from_f64(f64::from(high)).mul_add(T::splat(4_294_967_296.0), T::from_f64(f64::from(low)))
}

/// u, clamped to [0, 1], `elapsed` seconds after it was `start`.
#[inline(always)]
pub fn ramp_progress<R: Real>(start: R, per_second: R, elapsed: R) -> R {
    per_second.mul_add(elapsed, start).max(R::splat(0.0)).min(R::splat(1.0))
}

/// r(u) = u⁷ (1 + 7w + 28w² + 84w³ + 210w⁴ + 462w⁵ + 924w⁶), w = 1 − u, for u in [0, 1]: a sum without cancellation that is 0
/// and 1 at the ends.
#[inline(always)]
pub fn inertia_ramp<R: Real>(progress: R) -> R {
    let u = progress;
    let w = R::splat(1.0) - u;
    let mut sum = R::splat(924.0);
    for coefficient in [462.0, 210.0, 84.0, 28.0, 7.0, 1.0] {
        sum = sum.mul_add(w, R::splat(coefficient));
    }
    let cube = u * u * u;
    cube * cube * u * sum
}

/// ½ (1 − cos 2πx) at a phase x in turns.
#[inline(always)]
pub fn inertia_oscillation<R: Real>(phase: R) -> R {
    let (sin, _) = sin_cos((phase * R::splat(0.5)) * R::splat(std::f64::consts::TAU));
    sin * sin
}

/// dr/du.
#[inline(always)]
pub(crate) fn ramp_slope<R: Real>(progress: R) -> R {
    let product = progress * (R::splat(1.0) - progress);
    let cube = product * product * product;
    R::splat(12012.0) * cube * cube
}

/// The derivative of ½ (1 − cos 2πx) with respect to x.
#[inline(always)]
pub(crate) fn oscillation_slope<R: Real>(phase: R) -> R {
    let (sin, _) = sin_cos(phase * R::splat(std::f64::consts::TAU));
    R::splat(std::f64::consts::PI) * sin
}

/// The change of a body's moments, from its columns.
#[derive(Clone, Copy, Debug)]
pub struct Change<R> {
    /// κ = I₀/I₁, axis by axis.
    pub kappa: Vector<R>,
    /// 1/I₁ − 1/I₀; with a second word in either precision, as columns do not know theirs.
    pub difference: TwoWords<Vector<R>>,
}

/// A body during the change.
#[derive(Clone, Copy, Debug)]
pub struct Changed<R> {
    /// The body with its present moments.
    pub body: Body<R>,
    /// I₀/I, to a few roundings.
    pub ratio: Vector<R>,
}

/// The body with the part s = `done` of its change: 1/I = 1/I₀ + (1/I₁ − 1/I₀) σ, σ = s/(s + (1 − s) κ), where σ is 0 and 1
/// at the ends, however the division rounds.
#[inline(always)]
pub fn changed_body<R: Real>(body: &Body<R>, change: &Change<R>, done: R) -> Changed<R> {
    changed_by(body, change, change.share_at(done))
}

impl<R: Real> Change<R> {
    /// The change from an instance's columns.
    #[inline(always)]
    pub(crate) fn of_row(row: &impl Row<R>) -> Self {
        Self { kappa: row.vector(0), difference: TwoWords { value: row.vector(3), residue: row.vector(6) } }
    }

    /// As [`Change::share`], and 1 at the end exactly.
    #[inline(always)]
    fn share_at(&self, done: R) -> Vector<R> {
        let one = R::splat(1.0);
        let unfinished = done.less_than(one);
        let share = self.share(done);
        Vector::new(
            R::select(unfinished, share.x, one),
            R::select(unfinished, share.y, one),
            R::select(unfinished, share.z, one),
        )
    }

    /// I/I₀, axis by axis, for these shares of the reciprocal moments' changes.
    #[inline(always)]
    pub(crate) fn moment_ratio(&self, share: Vector<R>) -> Vector<R> {
        let one = R::splat(1.0);
        let ones = Vector::new(one, one, one);
        let ratio = (self.kappa - ones).mul_add(share, ones);
        Vector::new(one / ratio.x, one / ratio.y, one / ratio.z)
    }

    /// The part of each reciprocal moment's change that is done when the part `done` of the moments' change is; 1 at the end up to
    /// rounding.
    #[inline(always)]
    fn share(&self, done: R) -> Vector<R> {
        let left = R::splat(1.0) - done;
        let kappa = self.kappa;
        Vector::new(
            done / kappa.x.mul_add(left, done),
            done / kappa.y.mul_add(left, done),
            done / kappa.z.mul_add(left, done),
        )
    }
}

#[inline(always)]
fn changed_by<R: Real>(body: &Body<R>, change: &Change<R>, share: Vector<R>) -> Changed<R> {
    let one = R::splat(1.0);
    let ones = Vector::new(one, one, one);
    let ratio = (change.kappa - ones).mul_add(share, ones);
    let (value, residue) = (body.inverse_moments.value, body.inverse_moments.residue);
    if R::Scalar::WORDS == 1 {
        let difference = change.difference.value + change.difference.residue;
        let inverse = TwoWords { value: difference.mul_add(share, value), residue };
        return Changed { body: Body::new(inverse), ratio };
    }
    let part = change.difference.value.scaled_by(share);
    let (x, x_lost) = two_difference(value.x, -part.x);
    let (y, y_lost) = two_difference(value.y, -part.y);
    let (z, z_lost) = two_difference(value.z, -part.z);
    let lost = Vector::new(x_lost, y_lost, z_lost);
    let inverse =
        TwoWords { value: Vector::new(x, y, z), residue: lost + change.difference.residue.mul_add(share, residue) };
    Changed { body: Body::new(inverse), ratio }
}

/// How far the moments have changed at a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ChangeAt<R> {
    /// The part of each reciprocal moment's change that is done.
    pub share: Vector<R>,
    /// The increase of the differences I₃ − I₂, I₁ − I₃, I₂ − I₁.
    pub gained: Vector<R>,
}

impl<R: Real> ChangeAt<R> {
    /// No change.
    #[inline(always)]
    pub fn none() -> Self {
        Self { share: Vector::zero(), gained: Vector::zero() }
    }

    /// With the part s = `done` of a change by a law.
    #[inline(always)]
    pub fn by_law(row: &impl Row<R>, done: R) -> Self {
        Self { share: Change::of_row(row).share_at(done), gained: row.vector(9) * done }
    }

    /// The same for series: without a test whether the change is at its end, which rounding could pass long before the end, as a ramp
    /// ends smoothly.
    pub fn smoothly_by_law(row: &impl Row<R>, done: R) -> Self {
        Self { share: Change::of_row(row).share(done), gained: row.vector(9) * done }
    }

    /// By a formula that gives the shares ([`super::custom_inertia`]).
    #[inline(always)]
    pub fn by_formula(row: &impl Row<R>, share: Vector<R>) -> Self {
        Self { share, gained: gained_differences(row.vector(9), share) }
    }
}

/// The increase of the differences of moments I₀ for the relative increase `share` of their reciprocals: I − I₀ = −I₀ σ/(1 + σ).
#[inline(always)]
pub fn gained_differences<R: Real>(moments: Vector<R>, share: Vector<R>) -> Vector<R> {
    let one = R::splat(1.0);
    let lost = moments.scaled_by(share);
    let lost = Vector::new(lost.x / (one + share.x), lost.y / (one + share.y), lost.z / (one + share.z));
    Vector::new(lost.y - lost.z, lost.z - lost.x, lost.x - lost.y)
}

/// The rotation of a body at an angular momentum m with these shares of its change; `correction` is the initial body's.
#[inline(always)]
pub(crate) fn changed_motion<R: Real>(
    body: &Body<R>,
    change: &Change<R>,
    share: Vector<R>,
    correction: &Correction<R>,
    m: Vector<R>,
) -> Motion<R> {
    let Changed { body: changed, ratio } = changed_by(body, change, share);
    let correction = changed.carried_correction(body, correction, ratio, m);
    Motion::rigid(changed.angular_velocity(m, &correction), changed.gyroscopic_term(m, &correction))
}

/// `variable-inertia` along a ramp.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InertiaRamp;

impl Formula for InertiaRamp {
    const STEM: &'static str = "inertia_ramp";
    const COLUMNS: &'static [Column] = &[
        Column::vector("kappa"),
        Column::vector("difference"),
        Column::vector("difference_residue"),
        Column::vector("gained"),
        Column::number("per_tick"),
    ];
    const PHASES: &'static [&'static str] = &["phase"];
    const IS_PROGRESS: bool = true;
    const ROLE: Role = Role::Moments;

    #[inline(always)]
    fn epoch<R: Real>(_: &impl Row<R>, phases: [R; MOST_PHASES]) -> Epoch<R> {
        Epoch::number(inertia_ramp(phases[0]))
    }
}

/// `variable-inertia` as an oscillation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InertiaOscillation;

impl Formula for InertiaOscillation {
    const STEM: &'static str = "inertia_oscillation";
    const COLUMNS: &'static [Column] = &[
        Column::vector("kappa"),
        Column::vector("difference"),
        Column::vector("difference_residue"),
        Column::vector("gained"),
    ];
    const PHASES: &'static [&'static str] = &["phase"];
    const ROLE: Role = Role::Moments;

    #[inline(always)]
    fn epoch<R: Real>(_: &impl Row<R>, phases: [R; MOST_PHASES]) -> Epoch<R> {
        Epoch::number(inertia_oscillation(phases[0]))
    }
}

impl BodyFrame {
    /// The frame with the moments that the body has at `time`, s, if `torques` change them; otherwise the same frame.
    /// `body` is its index in the scene.
    #[must_use]
    pub fn at(&self, torques: &[Torque], body: usize, time: f64) -> Self {
        Self { scaled_moments: scaled_moments_at(torques, body, self, time), ..*self }
    }
}
