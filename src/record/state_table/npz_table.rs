//! Arrays as [`crate::record::npz_file`] writes them: not compressed, one for each column.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use super::Values;
use super::{Shape, TableRows, read_failed, wrong};
use crate::error::Result;
use crate::record::column::StateRows;
use crate::study::checksum::crc32;

/// The location of an array's numbers.
#[derive(Debug)]
struct Array {
    name: String,
    /// The type of its elements, as NumPy writes it.
    element: String,
    offset: u64,
    /// Number of elements.
    count: u64,
    /// The range of bytes that the archive's checksum covers: NumPy's header and the numbers.
    summed: Range<u64>,
    /// That checksum.
    checksum: u32,
}

/// All arrays of an archive written by a run, by name.
pub(super) fn columns(path: &Path) -> Result<Vec<(String, Values)>> {
    let mut file = File::open(path).map_err(|error| read_failed(path, &error))?;
    let table = NpzTable::listed(path, &mut file)?;
    let mut read = Vec::with_capacity(table.arrays.len());
    for array in table.arrays {
        let unknown = || wrong(path, format!("{}: its elements are of an unknown type {}", array.name, array.element));
        let width = width(&array.element).ok_or_else(unknown)? as usize;
        let mut bytes = vec![0; (array.summed.end - array.summed.start) as usize];
        let filled = file.seek(SeekFrom::Start(array.summed.start)).and_then(|_| file.read_exact(&mut bytes));
        filled.map_err(|error| read_failed(path, &error))?;
        array.check(path, crc32fast::hash(&bytes))?;
        let bytes = &bytes[(array.offset - array.summed.start) as usize..];
        let cells = bytes.chunks_exact(width.max(1));
        let values = match array.element.split_at(2) {
            ("<f", "8") => Values::Numbers(words(bytes).map(f64::from_bits).collect()),
            ("<u", "8") => Values::Numbers(words(bytes).map(|word| word as f64).collect()),
            ("<i", "8") => Values::Numbers(words(bytes).map(|word| word as i64 as f64).collect()),
            ("|u", "1") => Values::Numbers(bytes.iter().map(|&byte| f64::from(byte)).collect()),
            ("|S", _) => Values::Texts(cells.map(|cell| text(cell.iter().map(|&byte| byte.into()))).collect()),
            ("<U", _) => Values::Texts(cells.map(|cell| text(cell.chunks_exact(4).filter_map(letter))).collect()),
            _ => return Err(unknown()),
        };
        read.push((array.name, values));
    }
    Ok(read)
}

/// The letters before the zeros that pad an element.
fn text(letters: impl Iterator<Item = char>) -> String {
    letters.take_while(|&letter| letter != '\0').collect()
}

fn letter(bytes: &[u8]) -> Option<char> {
    char::from_u32(word(bytes, 0)?)
}

#[derive(Debug)]
pub(super) struct NpzTable {
    arrays: Vec<Array>,
    names: Vec<String>,
}

impl Array {
    /// Refuses bytes with another checksum than the archive states.
    fn check(&self, path: &Path, found: u32) -> Result<()> {
        match found == self.checksum {
            true => Ok(()),
            false => Err(wrong(path, format!("{}: it is not as it was written: its sum differs", self.name))),
        }
    }
}

impl NpzTable {
    /// The arrays of an archive; all bytes are read once to verify their checksums.
    pub fn open(path: &Path, file: &mut File) -> Result<Self> {
        let table = Self::listed(path, file)?;
        for array in &table.arrays {
            let found = crc32(file, array.summed.clone()).map_err(|error| read_failed(path, &error))?;
            array.check(path, found)?;
        }
        Ok(table)
    }

    /// The arrays of an archive, whose checksums the caller verifies.
    pub fn listed(path: &Path, file: &mut File) -> Result<Self> {
        let length = file.metadata().map_err(|error| read_failed(path, &error))?.len();
        let mut bytes = |offset: u64, count: usize| -> Result<Vec<u8>> {
            let mut bytes = vec![0; count.min(length.saturating_sub(offset) as usize)];
            let read = file.seek(SeekFrom::Start(offset)).and_then(|_| file.read_exact(&mut bytes));
            read.map_err(|error| read_failed(path, &error))?;
            Ok(bytes)
        };
        // APPNOTE 4.3.16: the end of the directory, written without a comment, preceded by that of ZIP64, if any.
        const END: usize = 22;
        const LOCATOR: usize = 20;
        const END_ZIP64: usize = 56;
        let cut = || wrong(path, "it is cut, or no archive of arrays that a run has written");
        let whole = (END + LOCATOR + END_ZIP64).min(length as usize);
        let tail = bytes(length - whole as u64, whole)?;
        let end = tail.len().checked_sub(END).filter(|&end| word(&tail, end) == Some(0x0605_4b50)).ok_or_else(cut)?;
        let wide = end.checked_sub(LOCATOR + END_ZIP64).filter(|&wide| word(&tail, wide) == Some(0x0606_4b50));
        let (count, size, start) = match wide {
            Some(wide) => (long(&tail, wide + 24), long(&tail, wide + 40), long(&tail, wide + 48)),
            None => (
                short(&tail, end + 10).map(u64::from),
                word(&tail, end + 12).map(u64::from),
                word(&tail, end + 16).map(u64::from),
            ),
        };
        let (Some(count), Some(size), Some(start)) = (count, size, start) else { return Err(cut()) };
        let directory = bytes(start, size as usize)?;
        let (mut arrays, mut at) = (Vec::new(), 0);
        for _ in 0..count {
            let entry = central(&directory, &mut at).filter(|entry| entry.local <= length).ok_or_else(cut)?;
            // The local header's own fields may differ in length from those of the directory.
            let local = bytes(entry.local, LOCAL)?;
            let fields = short(&local, 26).zip(short(&local, 28)).ok_or_else(cut)?;
            let array = entry.local + LOCAL as u64 + u64::from(fields.0) + u64::from(fields.1);
            let header = bytes(array, 10)?;
            let text_length = short(&header, 8).filter(|_| header.starts_with(b"\x93NUMPY\x01\x00")).ok_or_else(cut)?;
            let text = bytes(array + 10, text_length.into())?;
            let text = String::from_utf8_lossy(&text);
            let (count, element) = elements(&text).zip(element(&text)).ok_or_else(cut)?;
            let offset = array + 10 + u64::from(text_length);
            let size = width(&element).and_then(|width| count.checked_mul(width)).ok_or_else(cut)?;
            let end = offset.checked_add(size).filter(|&end| end <= length).ok_or_else(cut)?;
            let name = entry.name.strip_suffix(".npy").unwrap_or(&entry.name).to_owned();
            arrays.push(Array { name, element, offset, count, summed: array..end, checksum: entry.checksum });
        }
        let names = arrays.iter().map(|array| array.name.clone()).collect();
        Ok(Self { arrays, names })
    }

    pub fn names(&self) -> &[String] {
        &self.names
    }

    pub fn read(
        &mut self,
        path: &Path,
        file: &mut File,
        (first, count): (u64, usize),
        shape: Shape,
    ) -> Result<TableRows> {
        let (bodies, times) = (self.arrays[0].count, self.arrays[1].count);
        let end = first.saturating_add(count as u64).min(bodies.saturating_mul(times));
        let rows = first.min(end)..end;
        let mut bytes = |array: &Array, element: &str, rows: Range<u64>| -> Result<Vec<u8>> {
            let width = width(element).filter(|_| array.element == element && rows.end <= array.count);
            let width =
                width.ok_or_else(|| wrong(path, format!("{}: it is not a column of a run's states", array.name)))?;
            let mut bytes = vec![0; ((rows.end - rows.start) * width) as usize];
            let read = file.seek(SeekFrom::Start(array.offset + rows.start * width));
            read.and_then(|_| file.read_exact(&mut bytes)).map_err(|error| read_failed(path, &error))?;
            Ok(bytes)
        };
        let states = 2 + usize::from(shape.has_cells);
        let own = &self.arrays[states..states + shape.columns];
        let own = own.iter().map(|array| Ok(words(&bytes(array, "<f8", rows.clone())?).map(f64::from_bits).collect()));
        let own = own.collect::<Result<Vec<_>>>()?;
        let status = bytes(&self.arrays[states + shape.columns], "|u1", rows.clone())?;
        if rows.is_empty() {
            return Ok(TableRows { rows: StateRows { numbers: own, status }, ..TableRows::default() });
        }
        let outputs = rows.start / bodies..(rows.end - 1) / bodies + 1;
        // Of several outputs, all bodies.
        let own_bodies = match outputs.end - outputs.start {
            1 => rows.start % bodies..(rows.end - 1) % bodies + 1,
            _ => 0..bodies,
        };
        let indices: Vec<u64> = words(&bytes(&self.arrays[0], "<u8", own_bodies.clone())?).collect();
        let times: Vec<f64> = words(&bytes(&self.arrays[1], "<f8", outputs.clone())?).map(f64::from_bits).collect();
        Ok(TableRows {
            bodies: rows.clone().map(|row| indices[(row % bodies - own_bodies.start) as usize] as usize).collect(),
            times: rows.map(|row| times[(row / bodies - outputs.start) as usize]).collect(),
            rows: StateRows { numbers: own, status },
        })
    }
}

/// Bytes of a local header without name and extra fields.
const LOCAL: usize = 30;

/// An array's entry in the directory.
struct Entry {
    name: String,
    checksum: u32,
    /// Offset of its local header.
    local: u64,
}

/// The next entry of the directory (APPNOTE 4.3.12, 4.5.3).
fn central(directory: &[u8], at: &mut usize) -> Option<Entry> {
    const FIXED: usize = 46;
    if word(directory, *at)? != 0x0201_4b50 {
        return None;
    }
    let [name, extra, comment] = [28, 30, 32].map(|field| short(directory, *at + field).map(usize::from));
    let (name, extra) = (name?, extra?);
    let (checksum, size, offset) = (word(directory, *at + 16)?, word(directory, *at + 24)?, word(directory, *at + 42)?);
    let text = String::from_utf8_lossy(directory.get(*at + FIXED..*at + FIXED + name)?).into_owned();
    let offset = if offset == u32::MAX {
        // After both sizes, if these are wide too.
        let fields = *at + FIXED + name + 4;
        long(directory, if size == u32::MAX { fields + 16 } else { fields })?
    } else {
        offset.into()
    };
    *at += FIXED + name + extra + comment?;
    Some(Entry { name: text, checksum, local: offset })
}

/// Number of elements by the shape in a header's text.
fn elements(header: &str) -> Option<u64> {
    let shape = header.split_once("'shape': (")?.1.split_once(')')?.0;
    let sizes = shape.split(',').map(str::trim).filter(|size| !size.is_empty());
    sizes.map(|size| size.parse::<u64>().ok()).try_fold(1_u64, |count, size| count.checked_mul(size?))
}

/// Numbers of eight bytes, as bits.
fn words(bytes: &[u8]) -> impl Iterator<Item = u64> {
    bytes.chunks_exact(8).map(|cell| u64::from_le_bytes(std::array::from_fn(|place| cell[place])))
}

/// Bytes of an element of this type, as NumPy writes it.
fn width(element: &str) -> Option<u64> {
    let (kind, size) = element.split_at_checked(2)?;
    let size: u64 = size.parse().ok()?;
    if kind == "<U" { size.checked_mul(4) } else { Some(size) }
}

/// The type of the elements, from a header's text.
fn element(header: &str) -> Option<String> {
    Some(header.split_once("'descr': '")?.1.split_once('\'')?.0.to_owned())
}

fn short(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?))
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

fn long(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(bytes.get(at..at + 8)?.try_into().ok()?))
}
