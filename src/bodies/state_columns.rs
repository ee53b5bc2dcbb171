//! The numbers of a state, as named in tables.

use std::iter;

/// Columns of every table of states after `body` and `t`: orientation (body to world), angular velocity (body axes, rad/s), angular
/// momentum (world axes, N m s), rotational kinetic energy (J).
pub const ROTATION_COLUMNS: [&str; 11] = ["qx", "qy", "qz", "qw", "wx", "wy", "wz", "lx", "ly", "lz", "kinetic_energy"];

/// Columns that follow if the ensemble translates: position (m) and velocity (m/s), world axes.
pub const TRANSLATION_COLUMNS: [&str; 6] = ["x", "y", "z", "vx", "vy", "vz"];

/// The column after the numbers in every table of states: the number of the body's status ([`crate::bodies::Status`]), 0 if all is well.
/// Numbers of a body that has failed are NaN.
pub const STATUS: &str = "status";

/// The column before [`STATUS`] in studies with an event that stops bodies: when it stopped the body, s; NaN if none has.
pub const STOPPED_AT: &str = "stopped_at";

/// The column after [`STATUS`] in studies that sweep: the cell that contains the body, from 0.
pub const CELL: &str = "cell";

/// The names of the columns between `t` and `status`.
pub(crate) fn names(translates: bool) -> impl Iterator<Item = &'static str> {
    let translation: &[&str] = if translates { &TRANSLATION_COLUMNS } else { &[] };
    ROTATION_COLUMNS.iter().chain(translation).copied()
}

/// The names of the columns of initial states, apart from carried ones and those of drawn parameters.
pub(crate) fn of_initial(translates: bool, is_swept: bool) -> impl Iterator<Item = &'static str> {
    const MATTER: [&str; 13] = ["ixx", "iyy", "izz", "ixy", "ixz", "iyz", "i1", "i2", "i3", "ax", "ay", "az", "aw"];
    let translation = translates.then(|| iter::once("mass").chain(TRANSLATION_COLUMNS));
    let state = ROTATION_COLUMNS[..7].iter().copied().chain(translation.into_iter().flatten());
    iter::once("body").chain(is_swept.then_some(CELL)).chain(MATTER).chain(state)
}

/// The unit and the meaning, with its frame, of the column with this name in any table of bodies; `None` for other names.
pub(crate) fn meaning(name: &str) -> Option<(&'static str, &'static str)> {
    Some(match name {
        "qx" | "qy" | "qz" | "qw" => ("1", "orientation, a unit quaternion that rotates body coordinates to world"),
        "wx" | "wy" | "wz" => ("rad/s", "angular velocity, body axes"),
        "lx" | "ly" | "lz" => ("kg m²/s", "angular momentum, world axes"),
        "kinetic_energy" => ("J", "rotational kinetic energy"),
        "x" | "y" | "z" => ("m", "position of the centre of mass, world axes"),
        "vx" | "vy" | "vz" => ("m/s", "velocity of the centre of mass, world axes"),
        "mass" => ("kg", "mass"),
        "ixx" | "iyy" | "izz" | "ixy" | "ixz" | "iyz" => ("kg m²", "element of the inertia tensor, body axes"),
        "i1" | "i2" | "i3" => ("kg m²", "principal moment of inertia, ascending"),
        "ax" | "ay" | "az" | "aw" => {
            ("1", "principal axes, a unit quaternion that rotates principal coordinates to body")
        }
        _ => return None,
    })
}
