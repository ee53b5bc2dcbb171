//! The columns of output tables: `body`, `t`, numbers of the state, [`STATUS`] and, where a study sweeps, [`CELL`].

use super::OutputState;

/// Columns of every table after `body` and `t`: orientation (body to world), angular velocity (body axes, rad/s), angular
/// momentum (world axes, N m s), rotational kinetic energy (J).
pub const ROTATION_COLUMNS: [&str; 11] = ["qx", "qy", "qz", "qw", "wx", "wy", "wz", "lx", "ly", "lz", "kinetic_energy"];

/// Columns that follow where the ensemble translates: position (m) and velocity (m/s), world axes.
pub const TRANSLATION_COLUMNS: [&str; 6] = ["x", "y", "z", "vx", "vy", "vz"];

/// The column behind the numbers of every table of states: the number of what became of the body ([`crate::bodies::Status`]), 0 where all is well.
/// Numbers of a body that has failed are NaN ([`OutputState`]).
pub const STATUS: &str = "status";

/// The column behind [`STATUS`] of studies that sweep: the cell in which the body lies, from 0 ([`crate::study::sweep`]).
pub const CELL: &str = "cell";

/// The most columns of numbers.
pub(crate) const MOST_COLUMNS: usize = ROTATION_COLUMNS.len() + TRANSLATION_COLUMNS.len();

/// The names of a table's columns between `t` and `status`.
pub(crate) fn names(translates: bool) -> impl Iterator<Item = &'static str> {
    let translation: &[&str] = if translates { &TRANSLATION_COLUMNS } else { &[] };
    ROTATION_COLUMNS.iter().chain(translation).copied()
}

/// One row; columns of translation are zero where there is none.
pub(crate) fn values(state: &OutputState) -> [f64; MOST_COLUMNS] {
    let rotation = &state.rotation;
    let (q, w, l) = (rotation.orientation, rotation.angular_velocity_body, rotation.angular_momentum_world);
    let (x, v) = state.translation.unwrap_or_default();
    [q.x, q.y, q.z, q.w, w.x, w.y, w.z, l.x, l.y, l.z, rotation.kinetic_energy, x.x, x.y, x.z, v.x, v.y, v.z]
}
