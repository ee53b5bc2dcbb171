//! Text files that are read as a whole or refused: those that were cut, and those without end.

use std::collections::VecDeque;
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
    /// The line under way, from 1.
    line: u64,
    /// Whether the last line ended in a carriage return, to which a line feed may belong.
    after_return: bool,
    /// Lines that are neither empty nor comments, as far as they have been read and nobody has asked for them.
    rows: VecDeque<u64>,
}

impl<R> Lines<R> {
    pub(crate) fn new(source: R) -> Self {
        Self { source, length: 0, ended: false, line: 1, after_return: false, rows: VecDeque::new() }
    }

    /// The line under way, from 1.
    pub(crate) fn line(&self) -> u64 {
        self.line
    }

    /// The line, from 1, of the next row, where each row is a line that is neither empty nor begins with `#`.
    pub(crate) fn next_row(&mut self) -> u64 {
        self.rows.pop_front().unwrap_or(self.line)
    }

    /// Takes note of the lines in some further bytes.
    fn note(&mut self, mut bytes: &[u8]) {
        let is_end = |byte: &u8| matches!(byte, b'\n' | b'\r');
        while let Some(&first) = bytes.first() {
            if self.length == 0 {
                if std::mem::take(&mut self.after_return) && first == b'\n' {
                    bytes = &bytes[1..];
                    continue;
                }
                if !is_end(&first) && first != b'#' {
                    self.rows.push_back(self.line);
                }
            }
            match bytes.iter().position(is_end) {
                Some(end) => {
                    (self.length, self.after_return) = (0, bytes[end] == b'\r');
                    self.line += 1;
                    bytes = &bytes[end + 1..];
                }
                None => {
                    self.length += bytes.len();
                    bytes = &[];
                }
            }
        }
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
        self.note(&buffer[..count]);
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
    fn rows_have_their_lines_behind_comments_and_empty_lines() {
        let text = "# a\n\nb\r\n\r\n#\nc\rd\n\n\n# e\nf";
        for size in 1..8 {
            let mut lines = Lines::new(text.as_bytes());
            let mut buffer = vec![0; size];
            while lines.read(&mut buffer).expect("short lines") > 0 {}
            assert_eq!([0; 4].map(|_| lines.next_row()), [3, 6, 7, 11], "{size} bytes at a time");
            assert_eq!(lines.line(), 11);
        }
    }

    #[test]
    fn a_line_without_end_is_refused() {
        let error = io::copy(&mut Lines::new(io::repeat(b'1')), &mut io::sink()).expect_err("no end");
        assert_eq!(error.kind(), io::ErrorKind::InvalidData);
    }
}
