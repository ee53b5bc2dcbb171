//! Classes of bodies by their principal moments.

use glam::DVec3;

/// The kind of rotor that a body is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum InertiaClass {
    /// No inertia at all: a point.
    Point,
    /// I₁ = 0, I₂ = I₃: a line of mass, which has no spin about itself.
    LinearRotor,
    /// I₁ = I₂ = I₃.
    Spherical,
    /// I₁ < I₂ = I₃: elongated.
    Prolate,
    /// I₁ = I₂ < I₃: flattened.
    Oblate,
    /// Three different moments.
    Asymmetric,
}

/// The class of principal `moments` (ascending, kg m²); moments that differ by at most `relative_tolerance` of the
/// largest count as equal, and a moment of at most that as vanished.
pub fn classify(moments: DVec3, relative_tolerance: f64) -> InertiaClass {
    let bound = relative_tolerance * moments.z;
    if moments.z == 0.0 {
        InertiaClass::Point
    } else if moments.x <= bound && moments.z - moments.y <= bound {
        InertiaClass::LinearRotor
    } else {
        match (moments.y - moments.x <= bound, moments.z - moments.y <= bound) {
            (true, true) => InertiaClass::Spherical,
            (false, true) => InertiaClass::Prolate,
            (true, false) => InertiaClass::Oblate,
            (false, false) => InertiaClass::Asymmetric,
        }
    }
}
