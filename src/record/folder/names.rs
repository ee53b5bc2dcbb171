//! Names of a result's files, and of a run's temporary ones until it is complete.

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};
use std::path::{Path, PathBuf};

use super::super::part_file::{BLOCKS, EVENTS, PART};

/// The file that appears last, when a run is complete.
pub const REPORT: &str = "report.json";
/// The file that repeats a run.
pub const PLAN: &str = "plan.json";

/// Stems of the tables that a run may write.
const TABLES: [&str; 12] = [
    "final",
    "snapshots",
    "statistics",
    "statistics_by_cell",
    "failed",
    "events",
    "survival",
    "times",
    "histograms",
    "histograms_by_cell",
    "initial",
    "cells",
];
/// Extensions of tables, also those that this build does not write.
const TABLE_ENDINGS: [&str; 3] = ["csv", "npz", "parquet"];
/// Stems of the pictures that are drawn of a run.
const PICTURES: [&str; 9] =
    ["run", "final", "statistics", "means", "means_by_cell", "histograms", "survival", "times_by_cell", "map"];
/// The prefix of the number of a body in the stem of its pictures.
const PICTURE_OF_BODY: &str = "run-body-";
/// Extensions of pictures.
const PICTURE_ENDINGS: [&str; 2] = ["svg", "png"];

/// The extension of the folder that a run writes to.
pub(super) const PARTIAL: &str = "partial";
/// The extension of the folder of a former result while it is being replaced.
pub(super) const FORMER: &str = "former";
/// The extension of a complete result that could not be renamed.
pub(super) const KEPT: &str = "kept";

/// Whether a file with this name belongs to a run, or is a picture of one, and is replaced with it.
pub(super) fn is_result(name: &str) -> bool {
    let Some((stem, ending)) = name.rsplit_once('.') else { return false };
    let body = stem.strip_prefix(PICTURE_OF_BODY).unwrap_or_default();
    let of_body = !body.is_empty() && body.bytes().all(|digit| digit.is_ascii_digit());
    [PLAN, REPORT, PART, BLOCKS, EVENTS].contains(&name)
        || TABLES.contains(&stem) && TABLE_ENDINGS.contains(&ending)
        || (PICTURES.contains(&stem) || of_body) && PICTURE_ENDINGS.contains(&ending)
}

/// The prefix of the names of lock and temporary folders of a target.
pub(super) fn prefix(target: &Path, in_place: bool) -> PathBuf {
    let name = target.file_name().unwrap_or_default();
    if in_place {
        return target.join(".polhode");
    }
    let mut prefix = std::ffi::OsString::from(".");
    prefix.push(name);
    prefix.push(".polhode");
    target.with_file_name(prefix)
}

/// The prefix with a suffix.
pub(super) fn with_suffix(prefix: &Path, suffix: &str) -> PathBuf {
    let mut path = prefix.as_os_str().to_owned();
    path.push("-");
    path.push(suffix);
    path.into()
}

/// Digits of [`random`].
pub(super) const RANDOM_DIGITS: usize = 16;

/// A number that no other run has, in any container, from the seed of the standard library's hash maps.
pub(super) fn random() -> String {
    format!("{:016x}", RandomState::new().build_hasher().finish())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::Format;

    #[test]
    fn tables_of_every_format_are_results() {
        for format in Format::ALL {
            let name = format!("final.{}", format.name());
            assert!(
                is_result(&name),
                "{name} would stay behind when a run is replaced: list its ending in TABLE_ENDINGS"
            );
        }
    }
}
