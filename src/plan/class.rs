//! Classes of bodies: which parts of the equations of motion a body needs.
//!
//! A body is put into a simpler class than the general one where the error of treating it so stays within a tolerance. Each bound
//! below is rigorous: the angle between two rotations whose rates in body axes are ω(t) and ω̃(t) grows no faster than
//! |ω − ω̃|, so the attitude error is at most ∫|ω − ω̃| dt. With m the angular momentum in principal axes, L = |m| (which
//! a free body keeps), t the span and 1/I the inverse moments, every simpler motion below is a *regular precession*
//!
//! ```text
//! ω̃ = a m̃ + λ e_k,   m̃(t) = R_k(−λ t) m(0)
//! ```
//!
//! that keeps the angular momentum exactly; classes differ in a, λ and k (`kernel/free_motion/precession.rs`).

use glam::DVec3;

use super::driven::TorqueSet;
use crate::bodies::BodyFrame;
use crate::kernel::free_motion::Rotations;
use crate::math::power_of_two::scaled_by_power_of_two;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// What a body's inertia and spin make of its free motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Shape {
    /// It hardly turns over the span: nothing is computed.
    AtRest,
    /// Three equal moments, or a linear rotor: no gyroscopic term.
    Spherical,
    /// Spin about a principal axis: a plain rotation.
    Steady,
    /// Two equal moments: two uniform rotations.
    Axisymmetric,
    /// The general case: elliptic functions or steps.
    Asymmetric,
}

impl Shape {
    /// All shapes, the simplest first.
    pub const ALL: [Shape; 5] =
        [Shape::AtRest, Shape::Spherical, Shape::Steady, Shape::Axisymmetric, Shape::Asymmetric];

    /// The rotations that make up the free motion of a body of a class simpler than [`Shape::Asymmetric`].
    pub(crate) fn rotations(self) -> Rotations {
        match self {
            Shape::AtRest => Rotations::None,
            Shape::Spherical | Shape::Steady => Rotations::Precession,
            Shape::Axisymmetric | Shape::Asymmetric => Rotations::PrecessionAndSpin,
        }
    }

    /// The axis of a body of this class, given its frame and its scaled angular momentum along principal axes, over `span` seconds.
    pub(crate) fn axis_of(self, frame: &BodyFrame, angular_momentum_principal: DVec3, span: f64) -> Axis {
        // The axes as `bound` finds them, without the bounds, which cost more than everything else done for the body.
        match self {
            Shape::AtRest => return 0,
            Shape::Spherical => return 1,
            Shape::Steady | Shape::Axisymmetric | Shape::Asymmetric => {}
        }
        let span = scaled_by_power_of_two(span, frame.rate_exponent);
        FreeBody { moments: frame.scaled_moments, angular_momentum_principal, span }.bound(self).axis
    }

    /// The name in tables and reports.
    pub fn name(self) -> &'static str {
        match self {
            Shape::AtRest => "at rest",
            Shape::Spherical => "spherical",
            Shape::Steady => "steady",
            Shape::Axisymmetric => "axisymmetric",
            Shape::Asymmetric => "asymmetric",
        }
    }
}

/// The class of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Class {
    /// Its free motion.
    pub shape: Shape,
    /// The torques that act on it. The shape of a driven body is not classified and is [`Shape::Asymmetric`].
    pub torques: TorqueSet,
    /// Whether it is a linear rotor, which takes no torque about its axis.
    pub is_linear_rotor: bool,
    /// Whether its centre of mass moves too, which a constant force lets it do in closed form.
    pub translates: bool,
}

impl Class {
    /// Whether a torque acts.
    pub fn is_driven(&self) -> bool {
        !self.torques.is_empty()
    }
}

/// The error that a simpler class can cause over a span.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Bound {
    /// Attitude error, rad.
    #[cfg_attr(feature = "study", serde(deserialize_with = "or_infinite"))]
    pub attitude: f64,
    /// Error of the angular velocity, relative to the greatest spin rate that the motion can have.
    #[cfg_attr(feature = "study", serde(deserialize_with = "or_infinite"))]
    pub angular_velocity: f64,
    /// Error of the kinetic energy, relative.
    #[cfg_attr(feature = "study", serde(deserialize_with = "or_infinite"))]
    pub energy: f64,
}

/// JSON has no infinity, which is written as `null`.
#[cfg(feature = "study")]
fn or_infinite<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(<Option<f64> as serde::Deserialize>::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
}

impl Bound {
    /// A bound within no finite tolerance.
    pub const NONE: Self = Self { attitude: f64::INFINITY, angular_velocity: f64::INFINITY, energy: f64::INFINITY };

    /// The error of a set-up that is wrong by `error`, rad.
    pub(super) fn of_set_up(error: f64) -> Self {
        Self { attitude: error, angular_velocity: error, energy: error }
    }

    /// Whether an attitude error of at least `least`, with allowance for rounding, exceeds this bound.
    #[inline(always)]
    pub(super) fn is_far<R: Real>(&self, least: R) -> R::Mask {
        R::splat((1.0 + 1e-6) * self.attitude).less_than(least)
    }

    /// Whether no component exceeds that of `tolerance`.
    pub fn within(&self, tolerance: &Self) -> bool {
        self.attitude <= tolerance.attitude
            && self.angular_velocity <= tolerance.angular_velocity
            && self.energy <= tolerance.energy
    }

    /// The greater of both, component by component.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self {
            attitude: self.attitude.max(other.attitude),
            angular_velocity: self.angular_velocity.max(other.angular_velocity),
            energy: self.energy.max(other.energy),
        }
    }
}

/// The axis of a regular precession, from 0: the one along which a steady body spins, or that of symmetry.
pub type Axis = usize;

/// A free body and a span, in units of the body's own scale.
#[derive(Clone, Copy, Debug)]
pub struct FreeBody {
    /// I₁ ≤ I₂ ≤ I₃.
    pub moments: DVec3,
    /// m at the start, principal axes.
    pub angular_momentum_principal: DVec3,
    /// t.
    pub span: f64,
}

/// A class, its axis, and the error bound of treating a body as its member.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// The class.
    pub shape: Shape,
    /// The axis of a steady or axisymmetric body.
    pub axis: Axis,
    /// The bound; zero for [`Shape::Asymmetric`].
    pub bound: Bound,
}

impl FreeBody {
    /// The simplest class whose bound is within `tolerance`.
    pub fn verdict(&self, tolerance: &Bound) -> Verdict {
        // Most bodies are far from every simpler class, which a few products show.
        let least = FreeLanes::from(self).least_attitudes();
        let far = least.map(|least| tolerance.is_far(least));
        let simpler = Shape::ALL[..4].iter().zip(far).filter(|&(_, far)| !far).map(|(&shape, _)| self.bound(shape));
        simpler.into_iter().find(|verdict| verdict.bound.within(tolerance)).unwrap_or(Verdict {
            shape: Shape::Asymmetric,
            axis: 0,
            bound: Bound::default(),
        })
    }

    /// The bound on treating the body as a member of `shape`, with the axis for which it is least.
    pub fn bound(&self, shape: Shape) -> Verdict {
        let (axis, bound) = match shape {
            Shape::AtRest => (0, self.rest_bound()),
            Shape::Spherical => (1, self.spherical_bound()),
            Shape::Steady => least((0..3).map(|axis| (axis, self.steady_bound(axis)))),
            Shape::Axisymmetric => least([0, 2].map(|axis| (axis, self.axisymmetric_bound(axis))).into_iter()),
            Shape::Asymmetric => (0, Bound::default()),
        };
        Verdict { shape, axis, bound }
    }

    /// The error of the closed form where its constants are formed in one word ([`crate::kernel::free_motion::SetUp`]).
    ///
    /// Its rates and phases are then wrong by some roundings, and each becomes as many radians as the body turns. Roundings of the
    /// two terms of L² − 2T I₂ count in units of their difference, which decides the regime and the period; those of moments that
    /// are not entries of a diagonal tensor count in units of the moments' own differences too. The number of roundings is
    /// measured (`tests/set_up.rs`).
    pub fn set_up_bound(&self, is_diagonal: bool) -> Bound {
        Bound::of_set_up(FreeLanes::from(self).set_up_error(is_diagonal))
    }

    /// The greatest |ω| that the motion can reach: 2T ≥ I₁ ω².
    pub fn greatest_rate(&self) -> f64 {
        FreeLanes::from(self).greatest_rate()
    }

    fn twice_energy(&self) -> f64 {
        (self.angular_momentum_principal / self.moments).dot(self.angular_momentum_principal)
    }

    /// A bound with this attitude error; the error of the rate is divided by the greatest rate.
    fn relative(&self, attitude: f64, rate: f64, energy: f64) -> Bound {
        let greatest = self.greatest_rate();
        let ratio = |x: f64, scale: f64| if x == 0.0 { 0.0 } else { x / scale };
        // A value that overflowed bounds nothing.
        let sound = |x: f64| if x.is_nan() { f64::INFINITY } else { x };
        Bound {
            attitude: sound(attitude),
            angular_velocity: sound(ratio(rate, greatest)),
            energy: sound(ratio(energy, self.twice_energy())),
        }
    }

    /// The body is left as it is: it turns by at most the greatest rate times the span. The angular velocity is kept in
    /// body axes, where |ω̇| ≤ κ L²/I₁ with κ the spread of the inverse moments.
    fn rest_bound(&self) -> Bound {
        let rate = self.greatest_rate();
        let (first, third) = (self.moments.x.recip(), self.moments.z.recip());
        let change = (first - third) * self.angular_momentum_principal.length_squared() * first * self.span;
        self.relative(rate * self.span, change.min(2.0 * rate), 0.0)
    }

    /// a = 1/I₂, λ = 0. With κ = max |1/I_i − 1/I₂|, |ṁ| = |m × (I⁻¹ − a) m| ≤ κ L², so
    /// |ω − ω̃| ≤ κ L + a κ L² t.
    fn spherical_bound(&self) -> Bound {
        let inverse = self.moments.recip();
        let (a, l, t) = (inverse.y, self.angular_momentum_principal.length(), self.span);
        let kappa = (inverse.x - a).max(a - inverse.z);
        let rate = kappa * l * (1.0 + a * l * t);
        self.relative(kappa * l * t * (1.0 + 0.5 * a * l * t), rate, 0.0)
    }

    /// a = 1/I_k, λ = 0. With p the part of m across the axis, |ω − ω̃| ≤ c p + (p + p₀ + |Δm_k|)/I_k, where
    /// c = max |1/I_i − 1/I_k|. About an outer axis Σ |1/I_i − 1/I_k| m_i² is kept and bounds p; about any axis
    /// |ṗ| ≤ L c p does. |ṁ_k| ≤ |1/I_i − 1/I_j| p²/2, and from L² = m_k² + p² it changes by at most p²/(√2 L) as long as
    /// p² ≤ L²/2.
    fn steady_bound(&self, axis: Axis) -> Bound {
        let inverse = self.moments.recip().to_array();
        let m = self.angular_momentum_principal.to_array();
        let (l, t) = (self.angular_momentum_principal.length(), self.span);
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        let p0 = m[i].hypot(m[j]);
        if p0 == 0.0 {
            return Bound::default();
        }
        let (ci, cj) = ((inverse[i] - inverse[axis]).abs(), (inverse[j] - inverse[axis]).abs());
        let c = ci.max(cj);
        let grown = p0 * (l * c * t).exp();
        let kept = if axis == 1 || ci.min(cj) == 0.0 {
            f64::INFINITY
        } else {
            ((ci * m[i] * m[i] + cj * m[j] * m[j]) / ci.min(cj)).sqrt()
        };
        let p = grown.min(kept).min(l);
        let turned = if p * p <= 0.5 * l * l { p * p / (std::f64::consts::SQRT_2 * l) } else { 2.0 * l };
        let along = turned.min(0.5 * (inverse[i] - inverse[j]).abs() * p * p * t);
        let rate = c * p + (p + p0 + along) * inverse[axis];
        self.relative(rate * t, rate, 0.0)
    }

    /// a = (1/I_i + 1/I_j)/2, λ = (1/I_k − a) m_k(0). With κ = |1/I_i − 1/I_j| and g = |1/I_k − a|, |ṁ_k| ≤ κ L²/2, and
    /// in axes that turn with m̃ the part of m across the axis departs by at most g κ L³ t²/4 + κ L² t/4, as that
    /// rotation keeps lengths; |ω − ω̃| ≤ κ L/2 + a (that) + κ L² t/(2 I_k).
    fn axisymmetric_bound(&self, axis: Axis) -> Bound {
        let inverse = self.moments.recip().to_array();
        let (l, t) = (self.angular_momentum_principal.length(), self.span);
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        let a = 0.5 * (inverse[i] + inverse[j]);
        let (kappa, g) = ((inverse[i] - inverse[j]).abs(), (inverse[axis] - a).abs());
        if kappa == 0.0 {
            return Bound::default();
        }
        let angle = l * t;
        let attitude =
            kappa * angle * (0.5 + a * (g * angle * angle / 12.0 + angle / 8.0) + 0.25 * inverse[axis] * angle);
        let rate = kappa * l * (0.5 + a * (g * angle * angle / 4.0 + angle / 4.0) + 0.5 * inverse[axis] * angle);
        self.relative(attitude, rate, kappa * l * l)
    }
}

/// [`FreeBody`]s of a lane group, or one of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct FreeLanes<R> {
    pub moments: Vector<R>,
    pub angular_momentum_principal: Vector<R>,
    pub span: R,
}

impl From<&FreeBody> for FreeLanes<f64> {
    fn from(body: &FreeBody) -> Self {
        let vector = |v: DVec3| Vector::new(v.x, v.y, v.z);
        let (moments, m) = (vector(body.moments), vector(body.angular_momentum_principal));
        Self { moments, angular_momentum_principal: m, span: body.span }
    }
}

impl<R: Real> FreeLanes<R> {
    /// What the attitude bounds of the first four of [`Shape::ALL`] do not fall below, except by rounding: their first terms.
    #[inline(always)]
    pub fn least_attitudes(&self) -> [R; 4] {
        let Self { moments, angular_momentum_principal: m, span } = *self;
        let (half, one, two) = (R::splat(0.5), R::splat(1.0), R::splat(2.0));
        let (i1, i2, i3) = (one / moments.x, one / moments.y, one / moments.z);
        let (m1, m2, m3) = (m.x.abs() * span, m.y.abs() * span, m.z.abs() * span);
        let turned = m.plain_dot(m).sqrt() * span;
        // p is not less than the greater of its two components.
        let steady = |a: R, b: R, axis: R, c: R| a.max(b) * (c + two * axis);
        let (spread_12, spread_23, spread_13) = (i1 - i2, i2 - i3, i1 - i3);
        [
            turned * i3,
            turned * spread_12.max(spread_23),
            steady(m2, m3, i1, spread_13)
                .min(steady(m3, m1, i2, spread_12.max(spread_23)))
                .min(steady(m1, m2, i3, spread_13)),
            half * turned * spread_12.min(spread_23),
        ]
    }

    /// As [`FreeBody::greatest_rate`].
    #[inline(always)]
    fn greatest_rate(&self) -> R {
        let (i, m) = (self.moments, self.angular_momentum_principal);
        let omega = Vector::new(m.x / i.x, m.y / i.y, m.z / i.z);
        (omega.plain_dot(m) / i.x).sqrt()
    }

    /// The error of the closed form, rad, as in [`FreeBody::set_up_bound`].
    #[inline(always)]
    pub fn set_up_error(&self, is_diagonal: bool) -> R {
        let (i, m) = (self.moments, self.angular_momentum_principal);
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let omega = Vector::new(m.x / i.x, m.y / i.y, m.z / i.z);
        let third = i.z * (i.z - i.y) * omega.z * omega.z;
        let first = i.x * (i.y - i.x) * omega.x * omega.x;
        let difference = third - first;
        let rounded = if is_diagonal { zero } else { R::splat(4.0) * i.z * i.z * omega.plain_dot(omega) };
        let terms = third + first + rounded;
        // Where all terms vanish nothing is lost; NaN stays NaN.
        let vanishes = terms.less_than(R::splat(f64::MIN_POSITIVE));
        let lost = R::select(vanishes, zero, terms / difference.abs());
        let nearest = R::select(difference.less_than(zero), i.y - i.x, i.z - i.y);
        let lost_in_moments = if is_diagonal { zero } else { i.z / nearest };
        let angle = self.greatest_rate() * self.span;
        let error = R::splat(SET_UP_ROUNDINGS * f64::EPSILON) * (one + lost + lost_in_moments) * (one + angle);
        let infinity = R::splat(f64::INFINITY);
        R::select(error.less_than(infinity), error, infinity)
    }
}

/// Number of roundings in a set-up in one word.
const SET_UP_ROUNDINGS: f64 = 8.0;

/// The axis with the least bound on the attitude.
fn least(bounds: impl Iterator<Item = (Axis, Bound)>) -> (Axis, Bound) {
    bounds.fold((0, Bound::NONE), |best, next| if next.1.attitude < best.1.attitude { next } else { best })
}
