//! Tables of states as an archive of NumPy arrays.
//!
//! An `.npz` file is a ZIP archive with one `.npy` file for each array. Every array's size is known beforehand, so each has its place in
//! the archive from the start and is filled in as states arrive, whatever their number: nothing is kept in memory and nothing is written
//! twice. The archive is not compressed (random last digits do not compress), and contains no date, so that equal states make equal bytes.
//!
//! Sources: PKWARE, *APPNOTE.TXT*, version 6.3.10, sections 4.3, 4.4.4 and 4.5.3 (ZIP64); NumPy enhancement proposal 1,
//! *A Simple File Format for NumPy Arrays*, format version 1.0.

use std::ops::Range;

use super::column::{self, Layout, StateRows};
use super::folder::OutputFile;
use crate::error::Result;

/// Sizes and offsets of this value or more are written in ZIP64 fields.
const WIDE: u64 = u32::MAX as u64;

/// An array's file in the archive.
#[derive(Debug)]
struct Entry {
    name: String,
    /// Offset of its local header.
    offset: u64,
    /// Offset of the next bytes.
    position: u64,
    /// Bytes of the file, header of the array included.
    size: u64,
    checksum: crc32fast::Hasher,
}

/// A ZIP archive of files of known sizes, all open at once.
#[derive(Debug)]
pub(crate) struct Archive {
    file: OutputFile,
    entries: Vec<Entry>,
    end: u64,
    /// The least size that needs ZIP64 fields.
    wide: u64,
}

impl Archive {
    pub(crate) fn new(file: OutputFile) -> Self {
        Self { file, entries: Vec::new(), end: 0, wide: WIDE }
    }

    /// Reserves the place of a file of `size` bytes.
    pub(crate) fn reserve(&mut self, name: String, size: u64) {
        let offset = self.end;
        let mut entry = Entry { name, offset, position: 0, size, checksum: crc32fast::Hasher::new() };
        entry.position = offset + self.local_header(&entry).len() as u64;
        self.end = entry.position + size;
        self.entries.push(entry);
    }

    /// Appends bytes to a file.
    pub(crate) fn append(&mut self, entry: usize, bytes: &[u8]) -> Result<()> {
        let entry = &mut self.entries[entry];
        self.file.write_at(entry.position, bytes)?;
        entry.position += bytes.len() as u64;
        entry.checksum.update(bytes);
        Ok(())
    }

    fn is_wide(&self, entry: &Entry) -> bool {
        entry.size >= self.wide
    }

    /// APPNOTE 4.3.7.
    fn local_header(&self, entry: &Entry) -> Vec<u8> {
        let wide = self.is_wide(entry);
        let mut bytes = 0x0403_4b50_u32.to_le_bytes().to_vec();
        bytes.extend(self.common_fields(entry, wide));
        let extra = if wide { zip64_extra(&[entry.size, entry.size]) } else { Vec::new() };
        bytes.extend((extra.len() as u16).to_le_bytes());
        bytes.extend(entry.name.as_bytes());
        bytes.extend(extra);
        bytes
    }

    /// The fields from "version needed" to "file name length", which both kinds of header share.
    fn common_fields(&self, entry: &Entry, wide: bool) -> Vec<u8> {
        const NEEDED_PLAIN: u16 = 20;
        const NEEDED_ZIP64: u16 = 45;
        // APPNOTE 4.4.4, bit 11: the name is UTF-8.
        let flags: u16 = if entry.name.is_ascii() { 0 } else { 1 << 11 };
        const STORED: u16 = 0;
        const MIDNIGHT: u16 = 0;
        const FIRST_OF_JANUARY_1980: u16 = 0x0021;
        let needed = if wide || entry.offset >= self.wide { NEEDED_ZIP64 } else { NEEDED_PLAIN };
        let size = if wide { u32::MAX } else { entry.size as u32 };
        let mut bytes = Vec::new();
        for field in [needed, flags, STORED, MIDNIGHT, FIRST_OF_JANUARY_1980] {
            bytes.extend(field.to_le_bytes());
        }
        for field in [entry.checksum.clone().finalize(), size, size] {
            bytes.extend(field.to_le_bytes());
        }
        bytes.extend((entry.name.len() as u16).to_le_bytes());
        bytes
    }

    /// APPNOTE 4.3.12.
    fn central_header(&self, entry: &Entry) -> Vec<u8> {
        const MADE_BY: u16 = 45;
        let wide = self.is_wide(entry);
        let far = entry.offset >= self.wide;
        let mut fields = Vec::new();
        if wide {
            fields.extend([entry.size, entry.size]);
        }
        if far {
            fields.push(entry.offset);
        }
        let extra = if fields.is_empty() { Vec::new() } else { zip64_extra(&fields) };
        let mut bytes = 0x0201_4b50_u32.to_le_bytes().to_vec();
        bytes.extend(MADE_BY.to_le_bytes());
        bytes.extend(self.common_fields(entry, wide));
        bytes.extend((extra.len() as u16).to_le_bytes());
        // Comment length, disk number, internal and external attributes: none.
        bytes.extend([0; 2 + 2 + 2 + 4]);
        bytes.extend((if far { u32::MAX } else { entry.offset as u32 }).to_le_bytes());
        bytes.extend(entry.name.as_bytes());
        bytes.extend(extra);
        bytes
    }

    /// Writes all headers, now that the checksums are known.
    pub(crate) fn finish(mut self) -> Result<()> {
        for index in 0..self.entries.len() {
            let (offset, header) = (self.entries[index].offset, self.local_header(&self.entries[index]));
            self.file.write_at(offset, &header)?;
        }
        let mut tail: Vec<u8> = self.entries.iter().flat_map(|entry| self.central_header(entry)).collect();
        let (count, size, start) = (self.entries.len() as u64, tail.len() as u64, self.end);
        let wide = start >= self.wide;
        if wide {
            tail.extend(zip64_end(count, size, start));
        }
        // APPNOTE 4.3.16: end of central directory, of one disk, without comment.
        tail.extend(0x0605_4b50_u32.to_le_bytes());
        tail.extend([0; 2 + 2]);
        tail.extend((count as u16).to_le_bytes());
        tail.extend((count as u16).to_le_bytes());
        tail.extend((size as u32).to_le_bytes());
        tail.extend((if wide { u32::MAX } else { start as u32 }).to_le_bytes());
        tail.extend([0; 2]);
        self.file.write_at(start, &tail)?;
        self.file.finish()
    }
}

/// APPNOTE 4.5.3.
fn zip64_extra(fields: &[u64]) -> Vec<u8> {
    let mut bytes = vec![0x01, 0x00];
    bytes.extend((8 * fields.len() as u16).to_le_bytes());
    bytes.extend(fields.iter().flat_map(|field| field.to_le_bytes()));
    bytes
}

/// APPNOTE 4.3.14 and 4.3.15: the ZIP64 end of central directory and its locator.
fn zip64_end(count: u64, size: u64, start: u64) -> Vec<u8> {
    const VERSION: u16 = 45;
    const REST_OF_RECORD: u64 = 44;
    let mut bytes = 0x0606_4b50_u32.to_le_bytes().to_vec();
    bytes.extend(REST_OF_RECORD.to_le_bytes());
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend([0; 4 + 4]);
    for field in [count, count, size, start] {
        bytes.extend(field.to_le_bytes());
    }
    bytes.extend(0x0706_4b50_u32.to_le_bytes());
    bytes.extend([0; 4]);
    bytes.extend((start + size).to_le_bytes());
    bytes.extend(1_u32.to_le_bytes());
    bytes
}

/// The header of a `.npy` file: magic, version 1.0, and a Python dictionary padded to a multiple of 64 bytes.
pub(crate) fn npy_header(element: &str, shape: &[usize]) -> Vec<u8> {
    let mut sizes: String = shape.iter().map(|size| format!("{size}, ")).collect();
    if shape.len() > 1 {
        sizes.truncate(sizes.len() - 2);
    }
    let sizes = sizes.trim_end();
    let mut text = format!("{{'descr': '{element}', 'fortran_order': False, 'shape': ({sizes}), }}");
    const PREFIX: usize = 10;
    let length = (PREFIX + text.len() + 1).next_multiple_of(64) - PREFIX;
    text.extend(std::iter::repeat_n(' ', length - text.len() - 1));
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes
}

/// A table being written, one array for each column.
///
/// `body` has shape `[bodies]`; `t` has shape `[outputs]`, and the other columns `[outputs, bodies]`; for a single output, `t` is a scalar
/// and the other columns have shape `[bodies]`. `status` consists of bytes. In sweeps there is also `cell` of shape `[bodies]`.
#[derive(Debug)]
pub(crate) struct NpzFile {
    archive: Archive,
    /// Number of entries before those of the states: `body`, `t` and, in sweeps, `cell`.
    leading_entries: usize,
}

impl NpzFile {
    /// Begins a table of some bodies over output times, or at one time.
    pub(crate) fn begin(file: OutputFile, bodies: Range<usize>, times: Times<'_>, layout: &Layout) -> Result<Self> {
        let cells = layout.cells;
        let body_count = bodies.len();
        let mut archive = Archive::new(file);
        let (time_shape, state_shape) = match times {
            Times::One(_) => (vec![], vec![body_count]),
            Times::Many(times) => (vec![times.len()], vec![times.len(), body_count]),
        };
        let times = times.as_slice();
        let arrays = [("body", "<u8", vec![body_count]), ("t", "<f8", time_shape)]
            .into_iter()
            .chain(cells.map(|_| (column::CELL, "<u8", vec![body_count])))
            .chain(layout.names().map(|name| (name, "<f8", state_shape.clone())))
            .chain([(column::STATUS, "|u1", state_shape.clone())]);
        let mut headers = Vec::new();
        for (name, element, shape) in arrays {
            let header = npy_header(element, &shape);
            let element_bytes = if name == column::STATUS { 1 } else { 8 };
            let bytes = element_bytes * shape.iter().map(|&size| size as u64).product::<u64>();
            archive.reserve(format!("{name}.npy"), header.len() as u64 + bytes);
            headers.push(header);
        }
        for (entry, header) in headers.iter().enumerate() {
            archive.append(entry, header)?;
        }
        const BLOCK: usize = 1 << 16;
        for start in bodies.clone().step_by(BLOCK) {
            let block = start..(start + BLOCK).min(bodies.end);
            let bytes: Vec<u8> = block.clone().flat_map(|body| (body as u64).to_le_bytes()).collect();
            archive.append(0, &bytes)?;
            if let Some(cells) = cells {
                let bytes: Vec<u8> = block.flat_map(|body| ((body % cells) as u64).to_le_bytes()).collect();
                archive.append(2, &bytes)?;
            }
        }
        for times in times.chunks(BLOCK) {
            let bytes: Vec<u8> = times.iter().flat_map(|time| time.to_le_bytes()).collect();
            archive.append(1, &bytes)?;
        }
        Ok(Self { archive, leading_entries: 2 + usize::from(cells.is_some()) })
    }

    /// Appends rows, in the order of outputs and bodies.
    pub(crate) fn write(&mut self, rows: &StateRows) -> Result<()> {
        for (column, numbers) in rows.numbers.iter().enumerate() {
            let entry = self.leading_entries + column;
            if cfg!(target_endian = "little") {
                self.archive.append(entry, bytemuck::cast_slice(numbers))?;
            } else {
                let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
                self.archive.append(entry, &bytes)?;
            }
        }
        self.archive.append(self.leading_entries + rows.numbers.len(), &rows.status)
    }

    pub(crate) fn finish(self) -> Result<()> {
        self.archive.finish()
    }
}

/// The times of a table.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Times<'a> {
    /// One time, so that the table has no axis of time.
    One(f64),
    /// Any number of them.
    Many(&'a [f64]),
}

impl Times<'_> {
    fn as_slice(&self) -> &[f64] {
        match self {
            Times::One(time) => std::slice::from_ref(time),
            Times::Many(times) => times,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::super::folder::OutputFolder;
    use super::*;

    /// Writes two files of some hundred bytes alternately, with ZIP64 fields from `wide` bytes on, and reads them back.
    fn round_trip(wide: u64) {
        let folder = tempfile::tempdir().unwrap();
        let mut output = OutputFolder::create(folder.path(), false).unwrap();
        let mut archive = Archive::new(output.begin("a.npz").unwrap());
        archive.wide = wide;
        let contents: Vec<Vec<u8>> =
            (0..3_u8).map(|file| (0..300_u16).map(|n| (n as u8).wrapping_mul(file + 3)).collect()).collect();
        for (file, bytes) in contents.iter().enumerate() {
            archive.reserve(format!("{file}.npy"), bytes.len() as u64);
        }
        for start in (0..300).step_by(100) {
            for (file, bytes) in contents.iter().enumerate() {
                archive.append(file, &bytes[start..start + 100]).unwrap();
            }
        }
        archive.finish().unwrap();
        output.commit().unwrap();

        let mut read = zip::ZipArchive::new(std::fs::File::open(folder.path().join("a.npz")).unwrap()).unwrap();
        assert_eq!(read.len(), contents.len());
        for (file, bytes) in contents.iter().enumerate() {
            let mut found = Vec::new();
            // Reading to the end checks size and checksum.
            read.by_name(&format!("{file}.npy")).unwrap().read_to_end(&mut found).unwrap();
            assert!(found == *bytes, "file {file}");
        }
    }

    #[test]
    fn an_archive_reads_back() {
        round_trip(WIDE);
    }

    #[test]
    fn an_archive_of_wide_files_reads_back() {
        round_trip(200);
    }

    #[test]
    fn an_archive_with_far_files_reads_back() {
        // The first file is narrow and near; the later ones and the directory lie beyond the limit.
        round_trip(301);
    }

    #[test]
    fn array_headers_are_those_that_numpy_writes() {
        for (shape, text) in [(&[] as &[usize], "()"), (&[7], "(7,)"), (&[3, 10], "(3, 10)")] {
            let header = npy_header("<f8", shape);
            assert_eq!(header.len() % 64, 0);
            assert_eq!(&header[..8], b"\x93NUMPY\x01\x00");
            let found = String::from_utf8(header[10..].to_vec()).unwrap();
            assert!(
                found.starts_with(&format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {text}, }}")),
                "{found}"
            );
            assert!(found.ends_with('\n'));
        }
    }
}
