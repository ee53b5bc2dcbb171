//! The table of bodies that have failed, one row for each.

use super::FailedBody;
use super::folder::OutputFolder;
use super::table_file::{self, TableColumn};
use crate::error::Result;
use crate::study::Format;

/// Writes the table: the body, when it failed (s), the number and the word of the reason, the word for how precisely the time is known, the
/// time of its last known good state (s; 0 is the start), and its orientation (body to world) and angular velocity (body axes, rad/s) then;
/// and the formula that gave no finite number, with what it read, if known.
pub(crate) fn write(folder: &mut OutputFolder, format: Format, failures: &[FailedBody]) -> Result<()> {
    let mut columns = vec![
        TableColumn::whole("body", |row| failures[row].body as u64),
        TableColumn::number("t", |row| failures[row].time),
        TableColumn::code("status", |row| failures[row].reason.number()),
        TableColumn::text("reason", |row| failures[row].reason.name()),
        TableColumn::text("known_to", |row| failures[row].known_to.name()),
        TableColumn::number("last_good_t", |row| failures[row].last_good_time),
    ];
    columns.extend(TableColumn::of_rotation(|row| (failures[row].orientation, failures[row].angular_velocity_body)));
    columns.push(TableColumn::text("cause", |row| failures[row].cause.as_deref().unwrap_or_default()));
    table_file::write(folder, "failed", format, failures.len(), &columns)
}
