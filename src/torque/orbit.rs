//! Positions on a Kepler orbit, for torques that depend on it; one that drifts is in [`drift`].

use glam::{DMat3, DVec3};

use drift::{DRIFT, EARTH_EQUATORIAL_RADIUS};

use super::{Parameter, ParameterDeclaration, Preset, ValidationContext, Validity, Value, Values};
use crate::error::Result;
use crate::math::kepler::eccentric_anomaly;
use crate::math::quaternion::Quaternion;
use crate::math::real::{Function, Real, sin_cos};
use crate::math::vector::Vector;

pub mod drift;

/// The largest eccentricity for which the fixed number of iterations in [`eccentric_anomaly`] is enough.
pub(crate) const LARGEST_ECCENTRICITY: f64 = 0.99;

/// An orbit about a centre at the origin of the world frame, by its classical elements.
///
/// The plane and the ellipse are those of two-body motion; the body's own translation, if it has one, is not read.
#[derive(Clone, Debug, PartialEq)]
pub struct Orbit {
    /// Gravitational parameter of the centre, m³/s².
    pub mu: Parameter<f64>,
    /// Semi-major axis, or the radius of a circular orbit, m.
    pub semi_major_axis: Parameter<f64>,
    /// Eccentricity, 0 to 0.99.
    pub eccentricity: Parameter<f64>,
    /// Inclination of the plane to the world's xy plane, rad.
    pub inclination: Parameter<f64>,
    /// Right ascension of the ascending node, from the world's x axis, rad.
    pub ascending_node: Parameter<f64>,
    /// Argument of the pericentre, from the ascending node, rad.
    pub pericentre: Parameter<f64>,
    /// Mean anomaly at t = 0, rad.
    pub mean_anomaly: Parameter<f64>,
    /// J₂ of the centre, by which the node, the pericentre and the mean anomaly drift; 0 if they do not.
    pub j2: Parameter<f64>,
    /// Equatorial radius of the centre, m.
    pub equatorial_radius: Parameter<f64>,
}

impl Orbit {
    /// A circular orbit in the world's xy plane, counter-clockwise, at t = 0 on the x axis.
    pub fn circular(mu: impl Into<Parameter<f64>>, radius: impl Into<Parameter<f64>>) -> Self {
        Self::kepler(mu, radius, 0.0)
    }

    /// An elliptic orbit in the world's xy plane, counter-clockwise, at t = 0 at its pericentre on the x axis.
    pub fn kepler(
        mu: impl Into<Parameter<f64>>,
        semi_major_axis: impl Into<Parameter<f64>>,
        eccentricity: impl Into<Parameter<f64>>,
    ) -> Self {
        Self {
            mu: mu.into(),
            semi_major_axis: semi_major_axis.into(),
            eccentricity: eccentricity.into(),
            inclination: 0.0.into(),
            ascending_node: 0.0.into(),
            pericentre: 0.0.into(),
            mean_anomaly: 0.0.into(),
            j2: 0.0.into(),
            equatorial_radius: EARTH_EQUATORIAL_RADIUS.into(),
        }
    }

    /// The same orbit in a plane inclined to the world's xy plane, rad.
    #[must_use]
    pub fn inclined(mut self, inclination: impl Into<Parameter<f64>>) -> Self {
        self.inclination = inclination.into();
        self
    }

    /// The same orbit with its ascending node turned from the world's x axis, rad.
    #[must_use]
    pub fn with_ascending_node(mut self, ascending_node: impl Into<Parameter<f64>>) -> Self {
        self.ascending_node = ascending_node.into();
        self
    }

    /// The same orbit with its pericentre turned from the ascending node, rad.
    #[must_use]
    pub fn with_pericentre(mut self, pericentre: impl Into<Parameter<f64>>) -> Self {
        self.pericentre = pericentre.into();
        self
    }

    /// The same orbit, started at another mean anomaly, rad.
    #[must_use]
    pub fn with_mean_anomaly(mut self, mean_anomaly: impl Into<Parameter<f64>>) -> Self {
        self.mean_anomaly = mean_anomaly.into();
        self
    }

    /// The same orbit about an oblate centre whose axis is the world's z axis: its node, pericentre and mean anomaly drift at the secular
    /// rates of [`drift`]. `equatorial_radius` in m.
    ///
    /// ```
    /// use polhode::torque::orbit::drift::{EARTH_EQUATORIAL_RADIUS, EARTH_J2};
    /// use polhode::torque::Orbit;
    ///
    /// // Synchronous with the Sun: the node drifts by 360° a year.
    /// let orbit = Orbit::circular(3.986004418e14, 7.078e6).inclined(98.19_f64.to_radians());
    /// let orbit = orbit.with_j2(EARTH_J2, EARTH_EQUATORIAL_RADIUS);
    /// # assert_eq!(orbit.j2, EARTH_J2.into());
    /// ```
    #[must_use]
    pub fn with_j2(mut self, j2: impl Into<Parameter<f64>>, equatorial_radius: impl Into<Parameter<f64>>) -> Self {
        self.j2 = j2.into();
        self.equatorial_radius = equatorial_radius.into();
        self
    }

    /// The values in the order of [`parameters`], and those in the order of [`drift::parameters`].
    pub(super) fn values(self) -> ([Value; ELEMENTS], [Value; DRIFT]) {
        let Self { mu, semi_major_axis, eccentricity, inclination, ascending_node, pericentre, mean_anomaly, .. } =
            self;
        let elements = [mu, semi_major_axis, eccentricity, inclination, ascending_node, pericentre, mean_anomaly];
        (elements.map(Value::Number), [self.j2, self.equatorial_radius].map(Value::Number))
    }
}

/// Number of parameters that describe an orbit.
pub(super) const ELEMENTS: usize = 7;
const MU: usize = 0;
const SEMI_MAJOR_AXIS: usize = 1;
const ECCENTRICITY: usize = 2;
const INCLINATION: usize = 3;

/// The parameters of a model that has an orbit, which declares them first: `mu`, and the table `orbit`.
pub(super) fn parameters() -> [ParameterDeclaration; ELEMENTS] {
    let number = ParameterDeclaration::number;
    let or_zero = |name, unit, about| number(name, unit, about).or(Preset::Number(0.0));
    let mu = number("mu", "m³/s²", "the centre's gravitational parameter").valid(Validity::Positive);
    let size = number("orbit.semi_major_axis", "m", "the semi-major axis or radius");
    let eccentricity = or_zero("orbit.eccentricity", "1", "the eccentricity");
    [
        mu.phase_rate(),
        size.valid(Validity::Positive).or_key("orbit.radius", &["orbit.eccentricity"]).phase_rate(),
        eccentricity.valid(Validity::Range(0.0, LARGEST_ECCENTRICITY)),
        or_zero("orbit.inclination", "rad", "the plane's inclination to the world's xy plane"),
        or_zero("orbit.ascending_node", "rad", "the ascending node's angle from the world's x axis"),
        or_zero("orbit.pericentre", "rad", "the pericentre's angle from the ascending node"),
        or_zero("orbit.mean_anomaly", "rad", "the mean anomaly at t = 0"),
    ]
}

/// Refuses orbits whose numbers are valid individually but overflow or underflow `f64` together, and orbits that drift within their centre.
pub(super) fn validate(values: Values<'_>, context: &ValidationContext) -> Result<()> {
    let of_size = [MU, SEMI_MAJOR_AXIS].map(|place| values.number(place));
    let of_drift =
        [ECCENTRICITY, INCLINATION].map(|place| values.number(place)).into_iter().chain(drift::drift(values));
    let is_drifting = drift::is_drifting(values);
    let shared = of_size.into_iter().chain(of_drift.filter(|_| is_drifting)).all(Parameter::is_shared);
    for body in 0..if shared { 1 } else { context.body_count } {
        let orbit = elements(values, body);
        let (rate, _) = orbit.mean_motion();
        if !(rate.is_finite() && rate > 0.0) {
            let expected = "mu and the semi-major axis give no finite mean motion (m)";
            let body = Some(body).filter(|_| !shared);
            return Err(context.refusal(body, "orbit.semi_major_axis", orbit.semi_major_axis, expected));
        }
        if orbit.j2 != 0.0 && orbit.semi_latus_rectum() < orbit.equatorial_radius {
            let expected = "expected at most a (1 − e²): an orbit that drifts stays outside its central body (m)";
            let body = Some(body).filter(|_| !shared);
            return Err(context.refusal(body, "orbit.equatorial_radius", orbit.equatorial_radius, expected));
        }
    }
    Ok(())
}

/// Whether all orbits are circular. If each body has an eccentricity of its own they count as elliptic, whatever the values, so that a part
/// of the bodies has the kernel of the whole.
pub(super) fn is_circular(values: Values<'_>) -> bool {
    matches!(values.number(ECCENTRICITY), Parameter::Shared(e) if *e == 0.0)
}

/// The orbit of a body under a torque whose first values are those of [`parameters`] and whose last are those of [`drift::parameters`].
pub(super) fn elements(values: Values<'_>, body: usize) -> Elements {
    let [mu, semi_major_axis, eccentricity, inclination, ascending_node, pericentre, mean_anomaly] =
        std::array::from_fn(|place| values.number(place).at(body));
    let [j2, equatorial_radius] = drift::drift(values).map(|parameter| parameter.at(body));
    Elements {
        mu,
        semi_major_axis,
        eccentricity,
        inclination,
        ascending_node,
        pericentre,
        mean_anomaly,
        j2,
        equatorial_radius,
    }
}

/// One body's [`Orbit`].
pub(super) struct Elements {
    mu: f64,
    pub semi_major_axis: f64,
    pub eccentricity: f64,
    inclination: f64,
    ascending_node: f64,
    pericentre: f64,
    mean_anomaly: f64,
    j2: f64,
    equatorial_radius: f64,
}

impl Elements {
    /// √(μ/a³) in two words, rad/s: a relative error of 2⁻⁵³ in the rate puts the body off by 1e-11 rad after 1e5 rad.
    pub fn mean_motion(&self) -> (f64, f64) {
        let (mu, a) = (self.mu, self.semi_major_axis);
        let square = a * a;
        let square_low = a.mul_add(a, -square);
        let cube = square * a;
        let cube_low = square_low.mul_add(a, square.mul_add(a, -cube));
        let quotient = mu / cube;
        let quotient_low = (-quotient).mul_add(cube_low, (-quotient).mul_add(cube, mu)) / cube;
        let rate = quotient.sqrt();
        let rate_low = ((-rate).mul_add(rate, quotient) + quotient_low) / (2.0 * rate);
        // Products of tiny or huge numbers have no meaningful second word.
        (rate, if rate_low.is_finite() { rate_low } else { 0.0 })
    }

    /// √(μ/a³) at the pericentre, where the gradient is greatest: n (1 − e)^(−3/2).
    pub fn greatest_rate(&self) -> f64 {
        self.mean_motion().0 * (1.0 - self.eccentricity).powf(-1.5)
    }

    /// Unit vectors in world axes towards the pericentre, and perpendicular to it in the direction of motion.
    pub fn axes(&self) -> (DVec3, DVec3) {
        let rotation = DMat3::from_rotation_z(self.ascending_node)
            * DMat3::from_rotation_x(self.inclination)
            * DMat3::from_rotation_z(self.pericentre);
        (rotation.x_axis, rotation.y_axis)
    }

    /// The axes turned by the anomaly at t = 0, for a circular orbit.
    pub fn axes_at_start(&self) -> (DVec3, DVec3) {
        let (x, y) = self.axes();
        let (sin, cos) = self.mean_anomaly.sin_cos();
        (x * cos + y * sin, y * cos - x * sin)
    }

    /// The mean anomaly at t = 0 in turns, in [−½, ½].
    pub fn anomaly_turns(&self) -> f64 {
        turns(self.mean_anomaly)
    }
}

/// An angle in turns, in [−½, ½].
fn turns(angle: f64) -> f64 {
    let turns = angle / std::f64::consts::TAU;
    turns - turns.round()
}

/// The position of a body on its orbit.
#[derive(Clone, Copy, Debug)]
pub struct Place<R> {
    /// Unit vector from the centre, world axes.
    pub direction_world: Vector<R>,
    /// a/r: semi-major axis over distance.
    pub inverse_distance: R,
}

/// The direction of a body on a circular orbit at a phase in turns.
#[inline(always)]
pub(crate) fn circular_place<R: Real>(x_world: Vector<R>, y_world: Vector<R>, phase: R) -> Vector<R> {
    let (sin, cos) = sin_cos(phase * R::splat(std::f64::consts::TAU));
    x_world.axpy(cos, y_world * sin)
}

/// The place of a body on an elliptic orbit at a mean anomaly in turns within [−½, ½].
#[inline(always)]
pub(crate) fn kepler_place<R: Real>(x_world: Vector<R>, y_world: Vector<R>, eccentricity: R, phase: R) -> Place<R> {
    let one = R::splat(1.0);
    let (sin, cos) = kepler_sin_cos(phase * R::splat(std::f64::consts::TAU), eccentricity);
    let inverse_distance = one / (one - eccentricity * cos);
    let minor = (one - eccentricity * eccentricity).sqrt();
    let x = (cos - eccentricity) * inverse_distance;
    let y = minor * sin * inverse_distance;
    Place { direction_world: x_world.axpy(x, y_world * y), inverse_distance }
}

/// sin E and cos E of [`eccentric_anomaly`].
#[inline(always)]
pub(crate) fn kepler_sin_cos<R: Real>(mean_anomaly: R, eccentricity: R) -> (R, R) {
    let arguments = [mean_anomaly, eccentricity];
    if let (Some(sin), Some(cos)) =
        (R::recorded(Function::KeplerSin, &arguments), R::recorded(Function::KeplerCos, &arguments))
    {
        return (sin, cos);
    }
    let (_, sin, cos) = eccentric_anomaly(mean_anomaly, eccentricity);
    (sin, cos)
}

/// u × (I u) · c with u = Rᵀ `direction_world`: `coefficients` are c (I₃ − I₂), c (I₁ − I₃), c (I₂ − I₁).
#[inline(always)]
pub(super) fn gradient_torque<R: Real>(
    coefficients: Vector<R>,
    direction_world: Vector<R>,
    orientation: Quaternion<R>,
) -> Vector<R> {
    let u = orientation.rotate_inverse(direction_world);
    coefficients.scaled_by(Vector::new(u.y * u.z, u.z * u.x, u.x * u.y))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// M is recovered, and sine and cosine are those of E, to the rounding that the function's documentation states, on both sides of
    /// the eccentricity where one more iteration begins.
    #[test]
    fn keplers_equation_is_solved_to_rounding() {
        const BOUND: f64 = 4.0 * 0.5 * f64::EPSILON * std::f64::consts::PI;
        let eccentricities = [0.0, 1e-9, 0.05, 0.2, 0.4, 0.4_f64.next_up(), 0.7, 0.9, 0.9_f64.next_up(), 0.95, 0.99];
        let even = (0..=2000).map(|step| f64::from(step) / 2000.0);
        let small = (0..400).map(|step| 10.0_f64.powf(-0.03 * f64::from(step)));
        for part in even.chain(small) {
            for eccentricity in eccentricities {
                for mean in [part * std::f64::consts::PI, -part * std::f64::consts::PI] {
                    let (anomaly, sin, cos) = eccentric_anomaly(mean, eccentricity);
                    let missed = (anomaly - mean) - eccentricity * anomaly.sin();
                    assert!(missed.abs() <= BOUND, "e = {eccentricity}, M = {mean}: {missed:e}");
                    let turned = [sin - anomaly.sin(), cos - anomaly.cos()];
                    assert!(turned.iter().all(|x| x.abs() <= BOUND), "e = {eccentricity}, M = {mean}: {turned:?}");
                    let (_, narrow, _) = eccentric_anomaly(mean as f32, eccentricity as f32);
                    let slack = 4.0 * f64::from(f32::EPSILON) / (1.0 - eccentricity);
                    assert!((f64::from(narrow) - sin).abs() <= slack, "e = {eccentricity}, M = {mean} in f32");
                }
            }
        }
    }
}
