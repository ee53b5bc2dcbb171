//! Text files that are read as a whole or refused: those that were cut, and those without end.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use crate::error::{Error, FileAction, Result};

/// What is said of a table that was cut, or looks so.
pub(crate) const CUT: &str =
    "the last line does not end in a newline, so the table may be cut: add a newline if it is whole";

/// What is said of a cell that reaches over a line's end: rows would vanish in it.
pub(crate) const OPEN_QUOTE: &str = "a quotation mark is not closed on its line";

/// The most bytes of a file that is read into memory as a whole, MiB.
const MOST_MEBIBYTES: u64 = 64;

/// The most bytes of a table's line: in what has no line ends there are no rows to be found.
const LONGEST_LINE: usize = 1 << 20;

/// Reads a whole text of limited size.
///
/// # Errors
///
/// [`Error::File`].
pub(crate) fn read_text(path: &Path) -> Result<String> {
    let read = || {
        let mut text = String::new();
        let most = MOST_MEBIBYTES << 20;
        match File::open(path)?.take(most + 1).read_to_string(&mut text)? as u64 {
            length if length > most => {
                Err(io::Error::new(io::ErrorKind::FileTooLarge, format!("it is longer than {MOST_MEBIBYTES} MiB")))
            }
            _ => Ok(text),
        }
    };
    read().map_err(|error| Error::file(path, FileAction::Read, &error))
}

/// The bytes of a table on their way to its reader, which learns from here whether they ended as they should.
#[derive(Debug)]
pub(crate) struct Lines<R> {
    source: R,
    /// Bytes since the last line end.
    length: usize,
    ended: bool,
}

impl<R> Lines<R> {
    pub(crate) fn new(source: R) -> Self {
        Self { source, length: 0, ended: false }
    }

    /// Whether the end was reached, and in the middle of a line.
    pub(crate) fn are_cut(&self) -> bool {
        self.ended && self.length > 0
    }
}

impl<R: Read> Read for Lines<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.source.read(buffer)?;
        self.ended |= count == 0 && !buffer.is_empty();
        let is_end = |byte: &u8| matches!(byte, b'\n' | b'\r');
        self.length = match buffer[..count].iter().rposition(is_end) {
            Some(end) => count - end - 1,
            None => self.length + count,
        };
        if self.length > LONGEST_LINE {
            return Err(io::Error::new(
                io::ErrorKind::InvalidData,
                "a line is longer than a mebibyte: this is no table",
            ));
        }
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_within_a_line_is_seen_wherever_reads_fall() {
        for (text, cut) in [("", false), ("a\n", false), ("a\nb", true), ("a\r", false), ("a\nb\n", false), ("a", true)]
        {
            for size in 1..5 {
                let mut lines = Lines::new(text.as_bytes());
                let mut buffer = vec![0; size];
                while lines.read(&mut buffer).expect("short lines") > 0 {}
                assert_eq!(lines.are_cut(), cut, "{text:?}, {size} bytes at a time");
            }
        }
    }

    #[test]
    fn a_line_without_end_is_refused() {
        let error = io::copy(&mut Lines::new(io::repeat(b'1')), &mut io::sink()).expect_err("no end");
        assert_eq!(error.kind(), io::ErrorKind::InvalidData);
    }
}
