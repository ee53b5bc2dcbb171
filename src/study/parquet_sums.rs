//! Checksums in the footers of Parquet tables that runs write: one for each row group, and one for the footer itself.
//!
//! The writer in use makes no page checksums, and the format has none for footers. Both are stored in the footer's metadata as CRC-32,
//! eight hexadecimal digits each: those of the row groups in their order, then that of the footer, its length and the closing mark,
//! computed with [`NO_SUM`] in its own place.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;

use parquet::file::metadata::{ColumnChunkMetaData, RowGroupMetaData};
use parquet::file::reader::FileReader;
use parquet::file::serialized_reader::SerializedFileReader;

use super::checksum::crc32;

/// The result, or why the file is refused.
type Checked<T> = Result<T, String>;

/// The key of the checksums.
pub(crate) const SUMS: &str = "polhode.sums";

/// The program's name in footers; its tables have checksums.
pub(crate) const CREATED_BY: &str = "polhode version ";

/// The placeholder for the footer's checksum.
pub(crate) const NO_SUM: &str = "00000000";

/// Bytes of a footer's length and of the mark at the end of a file.
const END: u64 = 8;

/// A footer, its length and the closing mark, with the footer's own checksum, the last of `sums`, in its place.
pub(crate) fn summed_footer(footer: &[u8], sums: &str) -> Checked<Vec<u8>> {
    let (mut footer, place) = without_own_sum(footer, sums).ok_or_else(|| String::from("its footer has no sums"))?;
    let sum = format!("{:08x}", crc32fast::hash(&footer));
    footer[place].copy_from_slice(sum.as_bytes());
    Ok(footer)
}

/// The checksums of the row groups, if a run wrote the table. Refuses a footer that is not as it was written.
pub(crate) fn of_groups(file: &mut File, reader: &SerializedFileReader<File>) -> Checked<Option<Vec<u32>>> {
    let footer = footer(file).map_err(unread)?;
    let metadata = reader.metadata().file_metadata();
    let entries = metadata.key_value_metadata().into_iter().flatten();
    let Some(text) = entries.filter(|entry| entry.key == SUMS).find_map(|entry| entry.value.as_ref()) else {
        // A flipped bit may hide the checksums, or the name of the writer, but not both texts.
        let is_of_a_run = [SUMS, CREATED_BY].into_iter().any(|text| position(&footer, text).is_some());
        return if is_of_a_run { Err(String::from("its footer has no sums")) } else { Ok(None) };
    };
    // Checked in the form in which they are written: a flipped bit may turn a digit's letter into a capital.
    let number = |sum: &str| u32::from_str_radix(sum, 16).ok().filter(|number| format!("{number:08x}") == sum);
    let sums: Option<Vec<u32>> = text.split_whitespace().map(number).collect();
    let sums = sums.filter(|sums| sums.len() == reader.num_row_groups() + 1);
    let Some((&of_footer, of_groups)) = sums.as_ref().and_then(|sums| sums.split_last()) else {
        return Err(String::from("its footer has not a sum of each row group and of itself"));
    };
    match without_own_sum(&footer, text).is_some_and(|(footer, _)| crc32fast::hash(&footer) == of_footer) {
        true => Ok(Some(of_groups.to_vec())),
        false => Err(String::from("it is not as it was written: the sum of its footer differs")),
    }
}

/// Refuses a table of a run that is not as it was written.
pub(crate) fn check(file: &mut File, reader: &SerializedFileReader<File>) -> Checked<()> {
    let groups = reader.metadata().row_groups().iter().zip(of_groups(file, reader)?.unwrap_or_default());
    groups.into_iter().try_for_each(|(group, sum)| check_group(file, group, sum))
}

/// Refuses a row group whose bytes are not those that were written.
pub(crate) fn check_group(file: &mut File, group: &RowGroupMetaData, expected: u32) -> Checked<()> {
    let chunks = group.columns().iter().map(ColumnChunkMetaData::byte_range);
    let start = chunks.clone().map(|(start, _)| start).min().unwrap_or(0);
    let end = chunks.map(|(start, length)| start.saturating_add(length)).max().unwrap_or(0);
    let found = crc32(file, start..end).map_err(unread)?;
    match found == expected {
        true => Ok(()),
        false => Err(String::from("it is not as it was written: the sum of a row group differs")),
    }
}

/// The footer of a file that has one, its length and the closing mark.
fn footer(file: &mut File) -> io::Result<Vec<u8>> {
    let length = file.seek(SeekFrom::End(0))?;
    let mut of_footer = [0; 4];
    file.seek(SeekFrom::Start(length.saturating_sub(END)))?;
    file.read_exact(&mut of_footer)?;
    let start = length.saturating_sub(END + u64::from(u32::from_le_bytes(of_footer)));
    file.seek(SeekFrom::Start(start))?;
    let mut footer = Vec::new();
    file.read_to_end(&mut footer)?;
    Ok(footer)
}

/// The first position of a text.
fn position(footer: &[u8], text: &str) -> Option<usize> {
    footer.windows(text.len().max(1)).position(|bytes| bytes == text.as_bytes())
}

/// A footer with [`NO_SUM`] in place of its own checksum, which ends `sums`, and that place; `None` if they are not found.
fn without_own_sum(footer: &[u8], sums: &str) -> Option<(Vec<u8>, Range<usize>)> {
    let start = position(footer, sums)?;
    let end = start + sums.len();
    let place = end.checked_sub(NO_SUM.len()).filter(|place| *place >= start)?..end;
    let mut footer = footer.to_vec();
    footer[place.clone()].copy_from_slice(NO_SUM.as_bytes());
    Some((footer, place))
}

fn unread(error: io::Error) -> String {
    error.to_string()
}
