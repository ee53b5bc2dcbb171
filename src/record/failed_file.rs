//! The table of bodies that have failed, one row a body.

use glam::{DQuat, DVec3};

use super::folder::OutputFolder;
use super::whole_table::{Column, write as write_table};
use super::{FailedBody, KnownTo};
use crate::bodies::Status;
use crate::error::Result;
use crate::study::Format;

/// Writes the table: the body, when it failed (s), the number and the word of the reason, the word for how sharply the time is known, the time
/// of its last good state that is known (s; 0 is the start), and its orientation (body to world) and angular velocity (body axes,
/// rad/s) then.
pub(crate) fn write(folder: &mut OutputFolder, format: Format, failures: &[FailedBody]) -> Result<()> {
    let orientation =
        |part: usize| Column::numbers(move |row: usize| DQuat::to_array(&failures[row].orientation)[part]);
    let velocity =
        |part: usize| Column::numbers(move |row: usize| DVec3::to_array(&failures[row].angular_velocity_body)[part]);
    let reasons = Status::ALL.iter().map(|status| status.name().len()).max().unwrap_or(0);
    let known_to = KnownTo::ALL.iter().map(|known_to| known_to.name().len()).max().unwrap_or(0);
    let columns = [
        ("body", Column::counts(|row| failures[row].body as u64)),
        ("t", Column::numbers(|row| failures[row].time)),
        ("status", Column::codes(|row| failures[row].reason.number())),
        ("reason", Column::words(reasons, |row| failures[row].reason.name())),
        ("known_to", Column::words(known_to, |row| failures[row].known_to.name())),
        ("last_good_t", Column::numbers(|row| failures[row].last_good_time)),
        ("qx", orientation(0)),
        ("qy", orientation(1)),
        ("qz", orientation(2)),
        ("qw", orientation(3)),
        ("wx", velocity(0)),
        ("wy", velocity(1)),
        ("wz", velocity(2)),
    ];
    write_table(folder, "failed", format, failures.len(), &columns)
}
