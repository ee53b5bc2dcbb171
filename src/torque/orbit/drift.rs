//! Orbits that drift because their centre is oblate.
//!
//! The oblateness of the centre turns an orbit's plane and its ellipse. Averaged over an orbit and to first order in J₂ (Y. Kozai, *Astron. J.*
//! 64 (1959) 367; D. A. Vallado, *Fundamentals of Astrodynamics and Applications*, 4th edition, 2013, section 9.6), with the mean motion
//! n = √(μ/a³), p = a (1 − e²) and the equatorial radius R,
//!
//! dΩ/dt = −3/2 n J₂ (R/p)² cos i, dω/dt = 3/4 n J₂ (R/p)² (4 − 5 sin² i), dM/dt = n + 3/4 n J₂ (R/p)² √(1 − e²) (2 − 3 sin² i).
//!
//! An orbit follows these rates if [`Orbit::with_j2`](super::Orbit::with_j2) is set; a, e and i are constant. Elements are mean ones:
//! periodic changes of first order in J₂, some kilometres in an orbit near the Earth, and rates of second order, J₂² n, are neglected. The
//! axis of the centre's figure is the world's z axis.

use crate::math::real::{Real, sin_cos};
use crate::math::vector::Vector;
use crate::torque::formula::{Column, Row};
use crate::torque::{Parameter, ParameterDeclaration, Preset, Validity, Values};

use super::{Elements, kepler_place, turns};

/// The Earth's equatorial radius, m, that belongs to [`EARTH_J2`].
pub const EARTH_EQUATORIAL_RADIUS: f64 = 6_378_136.3;

/// The Earth's J₂ in the gravity model EGM-96 (D. A. Vallado, *Fundamentals of Astrodynamics and Applications*, 4th edition, 2013, table
/// D-1).
pub const EARTH_J2: f64 = 1.082_626_7e-3;

/// Number of parameters that describe the drift.
pub(in crate::torque) const DRIFT: usize = 2;

/// The draw number of the first of [`parameters`], in every model after those of all other parameters.
const DRIFT_DRAW: u16 = 12;

/// The last parameters of a model that has an orbit: how the orbit drifts.
pub(in crate::torque) fn parameters() -> [ParameterDeclaration; DRIFT] {
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

/// J₂ and the equatorial radius of a torque whose last values are those of [`parameters`].
pub(super) fn drift(values: Values<'_>) -> [&Parameter<f64>; DRIFT] {
    let first = values.values.len() - DRIFT;
    std::array::from_fn(|place| values.number(first + place))
}

/// Whether orbits drift. If each body has a J₂ of its own they count as drifting, whatever the values, so that a part of the bodies has the
/// kernel of the whole.
pub(in crate::torque) fn is_drifting(values: Values<'_>) -> bool {
    match drift(values)[0] {
        Parameter::Shared(j2) => *j2 != 0.0,
        Parameter::PerBody(_) => true,
    }
}

/// Whether the rate of a phase depends on a parameter of a model that has an orbit.
pub(in crate::torque) fn sets_phase_rate(values: Values<'_>, parameter: &ParameterDeclaration) -> bool {
    let of_drift = ["orbit.eccentricity", "orbit.inclination"].contains(&&*parameter.name);
    parameter.sets_phase_rate || of_drift && is_drifting(values)
}

impl Elements {
    /// a (1 − e²), m.
    pub(super) fn semi_latus_rectum(&self) -> f64 {
        self.semi_major_axis * (1.0 - self.eccentricity) * (1.0 + self.eccentricity)
    }

    /// Rates of the mean anomaly, of the pericentre and of the node, rad/s, in two words; for an orbit that does not drift the mean motion
    /// and zeros.
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
        // The part of the smaller term that the sum loses.
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
}

/// Columns of [`DriftingOrbit`].
pub(in crate::torque) const DRIFTING_COLUMNS: [Column; 6] = [
    Column::number("sin_inclination"),
    Column::number("cos_inclination"),
    Column::number("ascending_node"),
    Column::number("pericentre"),
    Column::number("eccentricity"),
    Column::number("start"),
];
pub(in crate::torque) const DRIFTING_NUMBERS: usize = DRIFTING_COLUMNS.len();

/// The phases of an orbit that drifts, whose rates are [`Elements::rates`].
pub(in crate::torque) const DRIFTING_PHASES: [&str; 3] = ["orbit_phase", "pericentre_phase", "node_phase"];

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
    /// The orbit from an instance's columns from `first` on.
    #[inline(always)]
    pub(in crate::torque) fn of_row(row: &impl Row<R>, first: usize) -> Self {
        Self {
            sin_inclination: row.number(first),
            cos_inclination: row.number(first + 1),
            ascending_node: row.number(first + 2),
            pericentre: row.number(first + 3),
            eccentricity: row.number(first + 4),
            start: row.number(first + 5),
        }
    }

    /// The direction from the centre in world axes and (a/r)³, after the mean anomaly, the pericentre and the node have advanced by these
    /// phases, in turns.
    #[inline(always)]
    pub(in crate::torque) fn place_and_cube(&self, [anomaly, pericentre, node]: [R; 3]) -> (Vector<R>, R) {
        let (pericentre_sin, pericentre_cos) = of_turns(pericentre + self.pericentre);
        let (node_sin, node_cos) = of_turns(node + self.ascending_node);
        // From the ascending node in the orbit's plane: towards the pericentre, and perpendicular to it.
        let x_world = self.turned([pericentre_cos, pericentre_sin], [node_cos, node_sin]);
        let y_world = self.turned([-pericentre_sin, pericentre_cos], [node_cos, node_sin]);
        let anomaly = anomaly + self.start;
        let place = kepler_place(x_world, y_world, self.eccentricity, anomaly - anomaly.round());
        let cube = place.inverse_distance * place.inverse_distance * place.inverse_distance;
        (place.direction_world, cube)
    }

    /// A vector of the orbit's plane, whose first axis points towards the ascending node, in world axes.
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

#[cfg(test)]
mod tests {
    use glam::DVec3;

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

    /// 360° in a tropical year of 365.2422 days, 0.9856° a day, at 98.19° and a height of 700 km; no rotation of the ellipse at 63.435°,
    /// and none of the plane over the poles.
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

    /// The equations of motion about an oblate centre, from the potential −μ/r (1 − J₂ (R/r)² (3 sin² φ − 1)/2), integrated from one
    /// pericentre to the fortieth after it: there the changes within an orbit are the same, so that only the secular first-order changes
    /// remain.
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
                        // To the pericentre itself: r · v is nearly linear within a step.
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
                // Neglected are terms of relative order J₂, and the effect of J₂ on the initial elements.
                let expected = rate * time;
                assert!((found - expected).abs() < 5e-3 * expected.abs(), "i = {inclination}: {found:e}, {expected:e}");
                assert!(expected.abs() > 1e-3, "i = {inclination}: {expected:e}");
            }
        }
    }
}
