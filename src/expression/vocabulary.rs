//! The words of the language of formulas.

/// Names of inputs, some of which may not be available.
pub(super) const INPUTS: &[&str] = &[
    "attitude",
    "angular_velocity",
    "angular_momentum",
    "inertia",
    "time",
    "position",
    "velocity",
    ORBIT_POSITION,
    ORBIT_VELOCITY,
];

/// Position and velocity on the orbit that a formula may know.
pub(crate) const ORBIT_POSITION: &str = "orbit_position";
pub(crate) const ORBIT_VELOCITY: &str = "orbit_velocity";

/// Numbers that have a name.
pub(super) const CONSTANTS: [(&str, f64); 2] = [("pi", std::f64::consts::PI), ("tau", std::f64::consts::TAU)];

/// Functions and how many arguments they take.
pub(super) const FUNCTIONS: [(&str, usize); 30] = [
    ("dot", 2),
    ("cross", 2),
    ("norm", 1),
    ("normalize", 1),
    ("vec", 3),
    ("quat", 4),
    ("conjugate", 1),
    ("rotate", 2),
    ("rotate_inverse", 2),
    ("to_body", 1),
    ("to_world", 1),
    ("sin", 1),
    ("cos", 1),
    ("tan", 1),
    ("asin", 1),
    ("acos", 1),
    ("atan2", 2),
    ("exp", 1),
    ("ln", 1),
    ("sqrt", 1),
    ("abs", 1),
    ("min", 2),
    ("max", 2),
    ("clamp", 3),
    ("step", 2),
    ("smoothstep", 3),
    ("pow", 2),
    ("select", 3),
    ("kepler_sin", 2),
    ("kepler_cos", 2),
];

/// Whether no parameter and no definition may have this name.
pub(super) fn is_reserved(name: &str) -> bool {
    name == "let"
        || INPUTS.contains(&name)
        || CONSTANTS.iter().any(|(constant, _)| *constant == name)
        || FUNCTIONS.iter().any(|(function, _)| *function == name)
}
