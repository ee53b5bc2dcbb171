//! Positions on a Kepler orbit, for torques that depend on it.
//!
//! # Drift by oblateness
//!
//! The oblateness of the centre turns an orbit's plane and its ellipse. Averaged over an orbit and to first order in J₂ (Y. Kozai, *Astron. J.*
//! 64 (1959) 367; D. A. Vallado, *Fundamentals of Astrodynamics and Applications*, 4th edition, 2013, section 9.6), with the mean motion
//! n = √(μ/a³), p = a (1 − e²) and the equatorial radius R,
//!
//! dΩ/dt = −3/2 n J₂ (R/p)² cos i, dω/dt = 3/4 n J₂ (R/p)² (4 − 5 sin² i), dM/dt = n + 3/4 n J₂ (R/p)² √(1 − e²) (2 − 3 sin² i).
//!
//! An orbit follows these rates where [`Orbit::with_j2`] asks for it; a, e and i are constant. Elements are mean ones: periodic changes
//! of the first order in J₂, some kilometres in an orbit near the Earth, and rates of the second order, J₂² n, are left out. The axis of the
//! centre's figure is the world's z axis.

use glam::{DMat3, DVec3};

use super::formula::{Column, Row};
use super::{Parameter, ParameterDeclaration, Preset, ValidationContext, Validity, Value, Values};
use crate::error::Result;
use crate::math::kepler::eccentric_anomaly;
use crate::math::quaternion::Quaternion;
use crate::math::real::{Function, Real, sin_cos};
use crate::math::vector::Vector;

/// The Earth's equatorial radius, m, that belongs to its [`EARTH_J2`].
pub const EARTH_EQUATORIAL_RADIUS: f64 = 6_378_136.3;

/// The Earth's J₂ by the field EGM-96 (D. A. Vallado, *Fundamentals of Astrodynamics and Applications*, 4th edition, 2013, table D-1).
pub const EARTH_J2: f64 = 1.082_626_7e-3;

/// The largest eccentricity for which [`eccentric_anomaly`]'s fixed number of iterations is enough.
pub const LARGEST_ECCENTRICITY: f64 = 0.99;

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
    /// J₂ of the centre, by which the node, the pericentre and the mean anomaly drift; 0 where they do not.
    pub j2: Parameter<f64>,
    /// Equatorial radius of the centre, m.
    pub equatorial_radius: Parameter<f64>,
}

impl Orbit {
    /// A circular orbit in the world's xy plane, counter-clockwise, at t = 0 on the x axis.
    pub fn circular(mu: impl Into<Parameter<f64>>, radius: impl Into<Parameter<f64>>) -> Self {
        Self::kepler(mu, radius, 0.0)
    }

    /// An elliptic orbit in the world's xy plane, counter-clockwise, at t = 0 in its pericentre on the x axis.
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

    /// The same orbit, begun at another mean anomaly, rad.
    #[must_use]
    pub fn with_mean_anomaly(mut self, mean_anomaly: impl Into<Parameter<f64>>) -> Self {
        self.mean_anomaly = mean_anomaly.into();
        self
    }

    /// The same orbit about an oblate centre whose axis is the world's z axis: its node, pericentre and mean anomaly drift at the secular
    /// rates of [the module](self). `equatorial_radius` in m.
    ///
    /// ```
    /// use polhode::torque::orbit::{EARTH_EQUATORIAL_RADIUS, EARTH_J2};
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

    /// In the order of [`parameters`], and in that of [`drift_parameters`].
    pub(super) fn values(self) -> ([Value; ELEMENTS], [Value; DRIFT]) {
        let Self { mu, semi_major_axis, eccentricity, inclination, ascending_node, pericentre, mean_anomaly, .. } =
            self;
        let elements = [mu, semi_major_axis, eccentricity, inclination, ascending_node, pericentre, mean_anomaly];
        (elements.map(Value::Number), [self.j2, self.equatorial_radius].map(Value::Number))
    }
}

/// Numbers that describe an orbit.
pub(super) const ELEMENTS: usize = 7;
const MU: usize = 0;
const SEMI_MAJOR_AXIS: usize = 1;
const ECCENTRICITY: usize = 2;
const INCLINATION: usize = 3;

/// Numbers that describe how it drifts.
pub(super) const DRIFT: usize = 2;

/// The number of the first of [`drift_parameters`] among the draws of every model, behind those of all others.
const DRIFT_DRAW: u16 = 12;

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

/// The last parameters of a model that has an orbit: how the orbit drifts.
pub(super) fn drift_parameters() -> [ParameterDeclaration; DRIFT] {
    let number = ParameterDeclaration::number;
    let j2 = number("orbit.j2", "1", "the centre's J₂, by which the orbit drifts");
    let radius = number("orbit.equatorial_radius", "m", "the centre's equatorial radius");
    [
        j2.valid(Validity::Range(-0.5, 0.5)).or(Preset::Number(0.0)).drawn_as(DRIFT_DRAW).phase_rate(),
        radius
            .valid(Validity::Positive)
            .or(Preset::Number(EARTH_EQUATORIAL_RADIUS))
            .drawn_as(DRIFT_DRAW + 1)
            .phase_rate(),
    ]
}

/// J₂ and the equatorial radius of a torque whose last values are those of [`drift_parameters`].
fn drift(values: Values<'_>) -> [&Parameter<f64>; DRIFT] {
    let first = values.values.len() - DRIFT;
    std::array::from_fn(|place| values.number(first + place))
}

/// Whether orbits drift. Where each body has a J₂ of its own they do, whatever it is, so that a part of the bodies has the kernel of all.
pub(super) fn is_drifting(values: Values<'_>) -> bool {
    match drift(values)[0] {
        Parameter::Shared(j2) => *j2 != 0.0,
        Parameter::PerBody(_) => true,
    }
}

/// Whether the rate of a phase follows from a parameter of a model that has an orbit.
pub(super) fn sets_phase_rate(values: Values<'_>, parameter: &ParameterDeclaration) -> bool {
    let of_drift = ["orbit.eccentricity", "orbit.inclination"].contains(&&*parameter.name);
    parameter.sets_phase_rate || of_drift && is_drifting(values)
}

/// Refuses orbits whose numbers are valid one by one, but leave the range of `f64` together, and orbits that drift within their centre.
pub(super) fn validate(values: Values<'_>, context: &ValidationContext) -> Result<()> {
    let of_size = [MU, SEMI_MAJOR_AXIS].map(|place| values.number(place));
    let of_drift = [ECCENTRICITY, INCLINATION].map(|place| values.number(place)).into_iter().chain(drift(values));
    let is_drifting = is_drifting(values);
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
            let expected = "expected at most a (1 − e²), as the orbit drifts about its centre from outside (m)";
            let body = Some(body).filter(|_| !shared);
            return Err(context.refusal(body, "orbit.equatorial_radius", orbit.equatorial_radius, expected));
        }
    }
    Ok(())
}

/// Whether no body's orbit is eccentric.
pub(super) fn is_circular(values: Values<'_>) -> bool {
    match values.number(ECCENTRICITY) {
        Parameter::Shared(e) => *e == 0.0,
        Parameter::PerBody(column) => column.iter().all(|e| *e == 0.0),
    }
}

/// The orbit of a body, of a torque whose first values are those of [`parameters`] and whose last are those of [`drift_parameters`].
pub(super) fn elements(values: Values<'_>, body: usize) -> Elements {
    let [mu, semi_major_axis, eccentricity, inclination, ascending_node, pericentre, mean_anomaly] =
        std::array::from_fn(|place| values.number(place).at(body));
    let [j2, equatorial_radius] = drift(values).map(|parameter| parameter.at(body));
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
    /// a (1 − e²), m.
    fn semi_latus_rectum(&self) -> f64 {
        self.semi_major_axis * (1.0 - self.eccentricity) * (1.0 + self.eccentricity)
    }

    /// Rates of the mean anomaly, of the pericentre and of the node, rad/s, in two words: of an orbit that does not drift the mean motion and
    /// zeros.
    pub fn rates(&self) -> [(f64, f64); 3] {
        let (n, n_low) = self.mean_motion();
        if self.j2 == 0.0 {
            return [(n, n_low), (0.0, 0.0), (0.0, 0.0)];
        }
        let ratio = self.equatorial_radius / self.semi_latus_rectum();
        let (sin, cos) = self.inclination.sin_cos();
        let (unit, minor) = (0.75 * n * self.j2 * ratio * ratio, (1.0 - self.eccentricity.powi(2)).sqrt());
        let anomaly_drift = unit * minor * (2.0 - 3.0 * sin * sin);
        let rate = n + anomaly_drift;
        // What the sum has lost of the smaller term.
        let rate_low = n_low + (anomaly_drift - (rate - n));
        [(rate, rate_low), (unit * (4.0 - 5.0 * sin * sin), 0.0), (-2.0 * unit * cos, 0.0)]
    }

    /// Writes the columns that [`DriftingOrbit::of_row`] reads.
    pub fn drifting_columns(&self, out: &mut [f64]) {
        let (sin, cos) = self.inclination.sin_cos();
        let [ascending_node, pericentre] = [self.ascending_node, self.pericentre].map(turns);
        out[..DRIFTING_NUMBERS].copy_from_slice(&[
            sin,
            cos,
            ascending_node,
            pericentre,
            self.eccentricity,
            self.anomaly_turns(),
        ]);
    }

    /// √(μ/a³) in two words, rad/s: a rate that is wrong by 2⁻⁵³ puts the body off by 1e-11 rad after 1e5 rad.
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
        // Products of tiny or huge numbers leave no meaningful second word.
        (rate, if rate_low.is_finite() { rate_low } else { 0.0 })
    }

    /// √(μ/a³) at the pericentre, where the gradient is greatest: n (1 − e)^(−3/2).
    pub fn greatest_rate(&self) -> f64 {
        self.mean_motion().0 * (1.0 - self.eccentricity).powf(-1.5)
    }

    /// Unit vectors in world axes towards the pericentre, and at right angles to it in the direction of motion.
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

/// Columns of [`DriftingOrbit`].
pub(super) const DRIFTING_COLUMNS: [Column; 6] = [
    Column::number("sin_inclination"),
    Column::number("cos_inclination"),
    Column::number("ascending_node"),
    Column::number("pericentre"),
    Column::number("eccentricity"),
    Column::number("start"),
];
pub(super) const DRIFTING_NUMBERS: usize = DRIFTING_COLUMNS.len();

/// The phases of an orbit that drifts, whose rates are [`Elements::rates`].
pub(super) const DRIFTING_PHASES: [&str; 3] = ["orbit_phase", "pericentre_phase", "node_phase"];

/// An orbit that drifts; angles in turns.
#[derive(Clone, Copy, Debug)]
pub struct DriftingOrbit<R> {
    /// Sine of the inclination.
    pub sin_inclination: R,
    /// Cosine of it.
    pub cos_inclination: R,
    /// Right ascension of the ascending node at t = 0.
    pub ascending_node: R,
    /// Argument of the pericentre at t = 0.
    pub pericentre: R,
    /// Eccentricity.
    pub eccentricity: R,
    /// Mean anomaly at t = 0.
    pub start: R,
}

impl<R: Real> DriftingOrbit<R> {
    /// Of an instance's columns from `first` on.
    #[inline(always)]
    pub(super) fn of_row(row: &impl Row<R>, first: usize) -> Self {
        Self {
            sin_inclination: row.number(first),
            cos_inclination: row.number(first + 1),
            ascending_node: row.number(first + 2),
            pericentre: row.number(first + 3),
            eccentricity: row.number(first + 4),
            start: row.number(first + 5),
        }
    }

    /// The direction from the centre in world axes and (a/r)³: the mean anomaly, the pericentre and the node have gone on by these phases, in
    /// turns.
    #[inline(always)]
    pub(super) fn place_and_cube(&self, [anomaly, pericentre, node]: [R; 3]) -> (Vector<R>, R) {
        let (pericentre_sin, pericentre_cos) = of_turns(pericentre + self.pericentre);
        let (node_sin, node_cos) = of_turns(node + self.ascending_node);
        // From the ascending node in the orbit's plane: towards the pericentre, and at right angles to it.
        let x_world = self.turned([pericentre_cos, pericentre_sin], [node_cos, node_sin]);
        let y_world = self.turned([-pericentre_sin, pericentre_cos], [node_cos, node_sin]);
        let anomaly = anomaly + self.start;
        let place = kepler_place(x_world, y_world, self.eccentricity, anomaly - anomaly.round());
        let cube = place.inverse_distance * place.inverse_distance * place.inverse_distance;
        (place.direction_world, cube)
    }

    /// A vector of the orbit's plane, of which the first axis is towards the ascending node, in world axes.
    #[inline(always)]
    fn turned(&self, [x, y]: [R; 2], [node_cos, node_sin]: [R; 2]) -> Vector<R> {
        let level = y * self.cos_inclination;
        Vector::new(x * node_cos - level * node_sin, x * node_sin + level * node_cos, y * self.sin_inclination)
    }
}

/// Sine and cosine of an angle in turns.
#[inline(always)]
fn of_turns<R: Real>(angle: R) -> (R, R) {
    sin_cos((angle - angle.round()) * R::splat(std::f64::consts::TAU))
}

/// Where a body is on its orbit.
#[derive(Clone, Copy, Debug)]
pub struct Place<R> {
    /// Unit vector from the centre, world axes.
    pub direction_world: Vector<R>,
    /// a/r: semi-major axis over distance.
    pub inverse_distance: R,
}

/// The direction of a body on a circular orbit at a phase in turns.
#[inline(always)]
pub fn circular_place<R: Real>(x_world: Vector<R>, y_world: Vector<R>, phase: R) -> Vector<R> {
    let (sin, cos) = sin_cos(phase * R::splat(std::f64::consts::TAU));
    x_world.axpy(cos, y_world * sin)
}

/// The place of a body on an elliptic orbit at a mean anomaly in turns within [−½, ½].
#[inline(always)]
pub fn kepler_place<R: Real>(x_world: Vector<R>, y_world: Vector<R>, eccentricity: R, phase: R) -> Place<R> {
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
pub fn kepler_sin_cos<R: Real>(mean_anomaly: R, eccentricity: R) -> (R, R) {
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

    fn about_the_earth(semi_major_axis: f64, eccentricity: f64, inclination: f64) -> Elements {
        Elements {
            mu: 3.986_004_418e14,
            semi_major_axis,
            eccentricity,
            inclination,
            ascending_node: 0.0,
            pericentre: 0.0,
            mean_anomaly: 0.0,
            j2: EARTH_J2,
            equatorial_radius: EARTH_EQUATORIAL_RADIUS,
        }
    }

    /// 360° in a tropical year of 365.2422 days, 0.9856° a day, at 98.19° and a height of 700 km; no turn of the ellipse at 63.435°, and none
    /// of the plane over the poles.
    #[test]
    fn orbits_synchronous_with_the_sun_and_of_critical_inclination() {
        let drift = |orbit: &Elements| orbit.rates().map(|(rate, low)| (rate + low).to_degrees() * 86_400.0);
        let [_, _, node] = drift(&about_the_earth(EARTH_EQUATORIAL_RADIUS + 700e3, 0.0, 98.19_f64.to_radians()));
        assert!((node - 360.0 / 365.2422).abs() < 1e-3, "{node}");
        let [_, pericentre, _] = drift(&about_the_earth(26_600e3, 0.74, 2.0_f64.atan()));
        assert!(pericentre.abs() < 1e-12, "{pericentre}");
        let [_, other, _] = drift(&about_the_earth(26_600e3, 0.74, 60.0_f64.to_radians()));
        assert!(other > 0.01, "{other}");
        let [_, _, node] = drift(&about_the_earth(7_000e3, 0.0, 90.0_f64.to_radians()));
        assert!(node.abs() < 1e-12, "{node}");
        let still = Elements { j2: 0.0, ..about_the_earth(7_000e3, 0.1, 1.0) };
        assert_eq!(still.rates(), [still.mean_motion(), (0.0, 0.0), (0.0, 0.0)]);
    }

    /// The equations of motion about an oblate centre, from the potential −μ/r (1 − J₂ (R/r)² (3 sin² φ − 1)/2), taken from one pericentre to
    /// the fortieth after it: there the changes within an orbit are the same, so that what is left of first order are the secular ones.
    #[test]
    fn the_rates_are_those_of_orbits_integrated_about_an_oblate_centre() {
        const STEPS: usize = 4000;
        const ORBITS: usize = 40;
        let (j2, radius) = (1e-4, 0.9);
        let acceleration = |x: DVec3| {
            let (r2, r) = (x.length_squared(), x.length());
            let (level, upright) = (5.0 * x.z * x.z / r2 - 1.0, 5.0 * x.z * x.z / r2 - 3.0);
            let factor = 1.5 * j2 * radius * radius / (r2 * r2 * r);
            -x / (r2 * r) + factor * DVec3::new(x.x * level, x.y * level, x.z * upright)
        };
        for (eccentricity, inclination) in [(0.2, 0.5), (0.3, 1.2), (0.2, 2.3)] {
            let orbit = Elements {
                mu: 1.0,
                semi_major_axis: 1.0,
                eccentricity,
                inclination,
                ascending_node: 0.3,
                pericentre: 0.7,
                mean_anomaly: 0.0,
                j2,
                equatorial_radius: radius,
            };
            let (towards, ahead) = orbit.axes();
            let speed = ((1.0 + eccentricity) / (1.0 - eccentricity)).sqrt();
            let (mut x, mut v, mut time) = (towards * (1.0 - eccentricity), ahead * speed, 0.0);
            let dt = std::f64::consts::TAU / STEPS as f64;
            let step = |x: DVec3, v: DVec3, dt: f64| {
                let k1 = (v, acceleration(x));
                let k2 = (v + k1.1 * (0.5 * dt), acceleration(x + k1.0 * (0.5 * dt)));
                let k3 = (v + k2.1 * (0.5 * dt), acceleration(x + k2.0 * (0.5 * dt)));
                let k4 = (v + k3.1 * dt, acceleration(x + k3.0 * dt));
                let sixth = dt / 6.0;
                let sum = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (a + (b + c) * 2.0 + d) * sixth;
                (x + sum(k1.0, k2.0, k3.0, k4.0), v + sum(k1.1, k2.1, k3.1, k4.1))
            };
            let mut passed = 0;
            while passed < ORBITS {
                let before = (x, v);
                (x, v) = step(x, v, dt);
                time += dt;
                if before.0.dot(before.1) < 0.0 && x.dot(v) >= 0.0 {
                    passed += 1;
                    if passed == ORBITS {
                        // To the pericentre itself: r · v is next to linear within a step.
                        let part = before.0.dot(before.1) / (before.0.dot(before.1) - x.dot(v));
                        time += dt * (part - 1.0);
                        (x, v) = step(before.0, before.1, dt * part);
                    }
                }
            }
            let momentum = x.cross(v);
            let node = DVec3::new(-momentum.y, momentum.x, 0.0).normalize();
            let turned = [
                node.y.atan2(node.x) - orbit.ascending_node,
                x.dot(momentum.cross(node).normalize()).atan2(x.dot(node)) - orbit.pericentre,
            ];
            let [_, pericentre, ascending_node] = orbit.rates();
            for (found, (rate, _)) in turned.into_iter().zip([ascending_node, pericentre]) {
                // Left out are terms of the order of J₂ times these, and of what J₂ makes of the elements at the start.
                let expected = rate * time;
                assert!((found - expected).abs() < 5e-3 * expected.abs(), "i = {inclination}: {found:e}, {expected:e}");
                assert!(expected.abs() > 1e-3, "i = {inclination}: {expected:e}");
            }
        }
    }

    /// M is recovered, and sine and cosine are those of E, up to the roundings that the function's documentation states; on both sides of
    /// where one more iteration begins.
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
