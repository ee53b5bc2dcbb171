//! The table of bodies that have failed, one row a body.

use glam::{DQuat, DVec3};

use super::FailedBody;
use super::folder::OutputFolder;
use super::npz_file::{Archive, npy_header};
use crate::error::Result;
use crate::study::Format;

/// The columns: the body, when it failed (s), the number and the word of the reason, the word for how sharply the time is known, the time
/// of its last good state that is known (s; 0 is the start), and its orientation (body to world) and angular velocity (body axes,
/// rad/s) then.
const COLUMNS: [&str; 13] =
    ["body", "t", "status", "reason", "known_to", "last_good_t", "qx", "qy", "qz", "qw", "wx", "wy", "wz"];

/// Columns of numbers of 64 bits from that of the last good state on.
const LAST_GOOD: usize = 8;

/// Bytes of a reason in an array, which are filled up with zeros.
const REASON_BYTES: usize = 20;

/// The same of the word for how sharply the time is known.
const KNOWN_TO_BYTES: usize = 8;

/// Writes the table.
pub(crate) fn write(folder: &mut OutputFolder, format: Format, failures: &[FailedBody]) -> Result<()> {
    let name = format!("failed.{}", format.name());
    match format {
        Format::Csv => folder.write(&name, text(failures).as_bytes()),
        Format::Npz => {
            let mut archive = Archive::new(folder.begin(&name)?);
            let arrays = COLUMNS.iter().zip(arrays(failures)).map(|(name, (element, bytes))| {
                let mut file = npy_header(&element, &[failures.len()]);
                file.extend(bytes);
                (format!("{name}.npy"), file)
            });
            for (entry, (name, file)) in arrays.enumerate() {
                archive.reserve(name, file.len() as u64);
                archive.append(entry, &file)?;
            }
            archive.finish()
        }
    }
}

fn text(failures: &[FailedBody]) -> String {
    let mut text = COLUMNS.join(",") + "\n";
    let mut number = zmij::Buffer::new();
    for failed in failures {
        text += &format!(
            "{},{},{},{},{}",
            failed.body,
            number.format(failed.time),
            failed.reason.number(),
            failed.reason.name(),
            failed.known_to.name()
        );
        for value in last_good(failed) {
            text.push(',');
            text += number.format(value);
        }
        text.push('\n');
    }
    text
}

/// The columns as arrays: the type of their elements, and their bytes.
fn arrays(failures: &[FailedBody]) -> Vec<(String, Vec<u8>)> {
    let column = |element: &str, bytes: &dyn Fn(&FailedBody) -> Vec<u8>| {
        (element.to_owned(), failures.iter().flat_map(bytes).collect::<Vec<u8>>())
    };
    let word = |word: &str, room: usize| {
        let mut bytes = word.as_bytes().to_vec();
        bytes.resize(room, 0);
        bytes
    };
    let mut arrays = vec![
        column("<u8", &|failed| (failed.body as u64).to_le_bytes().to_vec()),
        column("<f8", &|failed| failed.time.to_le_bytes().to_vec()),
        column("|u1", &|failed| vec![failed.reason.number()]),
        column(&format!("|S{REASON_BYTES}"), &|failed| word(failed.reason.name(), REASON_BYTES)),
        column(&format!("|S{KNOWN_TO_BYTES}"), &|failed| word(failed.known_to.name(), KNOWN_TO_BYTES)),
    ];
    arrays.extend((0..LAST_GOOD).map(|place| column("<f8", &|failed| last_good(failed)[place].to_le_bytes().to_vec())));
    arrays
}

fn last_good(failed: &FailedBody) -> [f64; LAST_GOOD] {
    let FailedBody { last_good_time, orientation, angular_velocity_body, .. } = *failed;
    let (DQuat { x, y, z, w }, DVec3 { x: wx, y: wy, z: wz }) = (orientation, angular_velocity_body);
    [last_good_time, x, y, z, w, wx, wy, wz]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::Status;
    use crate::record::KnownTo;

    #[test]
    fn words_fit_into_their_arrays() {
        assert!(Status::ALL.iter().all(|status| status.name().len() <= REASON_BYTES));
        assert!(KnownTo::ALL.iter().all(|known_to| known_to.name().len() <= KNOWN_TO_BYTES));
    }
}
