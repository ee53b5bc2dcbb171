//! Position and velocity of a body on an orbit, as functions of the orbit's elements and the time.
//!
//! The orbit is that of two bodies, with mean anomaly M = M₀ + Ṁ t and Kepler's equation E − e sin E = M; with J₂, node, pericentre and mean
//! anomaly drift at the secular rates of first order (Y. Kozai, *Astron. J.* 64 (1959) 367; D. A. Vallado, *Fundamentals of Astrodynamics and
//! Applications*, 4th edition, 2013, section 9.6), as under torques that have an orbit. The velocity is that on the ellipse of the moment:
//! the drift itself adds at most some 1e-3 of it.

use super::symbol::Symbol;
use crate::math::real::{Function, Real, sin_cos};
use crate::math::vector::Vector;

/// Number of elements: μ (m³/s²), a (m), e, i, Ω, ω, M₀ (rad), J₂, and the equatorial radius (m).
pub(crate) const ELEMENTS: usize = 9;

/// Where a formula finds an orbit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OrbitSymbols {
    pub elements: OrbitElements,
    /// Whether the eccentricity may be other than zero.
    pub is_eccentric: bool,
    /// Whether J₂ may be other than zero.
    pub drifts: bool,
}

/// The elements of an orbit in a formula.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum OrbitElements {
    /// Parameters, from the one of this index on.
    Parameters(usize),
    /// The same numbers for all bodies.
    #[cfg(feature = "study")]
    Constants([f64; ELEMENTS]),
}

/// Position, m, and velocity, m/s, in world axes, from the centre.
#[derive(Clone, Copy)]
pub(super) struct OnOrbit {
    pub position: Vector<Symbol>,
    pub velocity: Vector<Symbol>,
}

impl OnOrbit {
    pub(super) fn at(elements: [Symbol; ELEMENTS], orbit: &OrbitSymbols, time: Symbol) -> Self {
        let number = |x: f64| Symbol::splat(x);
        let [mu, a, e, inclination, node, pericentre, anomaly, j2, radius] = elements;
        let (one, mean_motion) = (number(1.0), (mu / a).sqrt() / a);
        let (sin_i, cos_i) = sin_cos(inclination);
        let e = if orbit.is_eccentric { e } else { number(0.0) };
        let minor = (one - e * e).sqrt();
        let mut rates = [mean_motion, number(0.0), number(0.0)];
        if orbit.drifts {
            let ratio = radius / (a * (one - e * e));
            let unit = number(0.75) * mean_motion * j2 * ratio * ratio;
            let sin_squared = sin_i * sin_i;
            rates[0] = mean_motion + unit * minor * (number(2.0) - number(3.0) * sin_squared);
            rates[1] = unit * (number(4.0) - number(5.0) * sin_squared);
            rates[2] = number(-2.0) * unit * cos_i;
        }
        let mean_anomaly = rates[0] * time + anomaly;
        let (pericentre, node) = match orbit.drifts {
            true => (rates[1] * time + pericentre, rates[2] * time + node),
            false => (pericentre, node),
        };
        // Along the pericentre and at right angles to it: the place in units of a, and the velocity in units of n a.
        let ([x, y], [v_x, v_y]) = if orbit.is_eccentric {
            let sin = mean_anomaly.function_with(Function::KeplerSin, e);
            let cos = mean_anomaly.function_with(Function::KeplerCos, e);
            let speed = one / (one - e * cos);
            ([cos - e, minor * sin], [-(sin * speed), minor * cos * speed])
        } else {
            let (sin, cos) = sin_cos(mean_anomaly);
            ([cos, sin], [-sin, cos])
        };
        let ((sin_w, cos_w), (sin_node, cos_node)) = (sin_cos(pericentre), sin_cos(node));
        let in_plane = |x: Symbol, y: Symbol| {
            let (along, across) = (cos_w * x - sin_w * y, sin_w * x + cos_w * y);
            let level = across * cos_i;
            Vector::new(cos_node * along - sin_node * level, sin_node * along + cos_node * level, across * sin_i)
        };
        Self { position: in_plane(x, y) * a, velocity: in_plane(v_x, v_y) * (mean_motion * a) }
    }
}
