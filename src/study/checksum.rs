//! Checksums of parts of files.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;

/// The CRC-32 of a range of a file, read in pieces.
pub(crate) fn crc32(file: &mut File, bytes: Range<u64>) -> io::Result<u32> {
    file.seek(SeekFrom::Start(bytes.start))?;
    let mut left = file.take(bytes.end - bytes.start);
    let (mut checksum, mut buffer) = (crc32fast::Hasher::new(), vec![0; 1 << 18]);
    loop {
        match left.read(&mut buffer)? {
            0 => return Ok(checksum.finalize()),
            count => checksum.update(&buffer[..count]),
        }
    }
}
