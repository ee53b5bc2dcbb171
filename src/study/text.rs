//! Text files that are read as a whole or refused: those that were cut, and endless ones.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use crate::error::{Error, FileAction, Result};

/// The message for a table that was cut, or looks like it.
pub(crate) const CUT: &str =
    "the last line does not end in a newline, so the table may be cut: add a newline if it is whole";

/// The message for a cell that extends over the end of a line, which would hide rows.
pub(crate) const OPEN_QUOTE: &str = "a quotation mark is not closed on its line";

/// The greatest size, MiB, of a file that is read into memory as a whole.
const MOST_MEBIBYTES: u64 = 64;

/// The most bytes in a line of a table: a file without line ends has no rows.
const LONGEST_LINE: usize = 1 << 20;

/// Reads a whole text of limited size.
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

/// The bytes of a table as its reader consumes them; they show whether the table ended properly.
#[derive(Debug)]
pub(crate) struct Lines<R> {
    source: R,
    /// Bytes since the last line end.
    length: usize,
    ended: bool,
    /// The current line, from 1.
    line: u64,
    /// Whether the last line ended in a carriage return, which a line feed may follow.
    after_return: bool,
    /// Lines that are neither empty nor comments, read but not yet asked for.
    rows: VecDeque<u64>,
}

impl<R> Lines<R> {
    pub(crate) fn new(source: R) -> Self {
        Self { source, length: 0, ended: false, line: 1, after_return: false, rows: VecDeque::new() }
    }

    /// The current line, from 1.
    pub(crate) fn line(&self) -> u64 {
        self.line
    }

    /// The line, from 1, of the next row, if each row is a line that is neither empty nor begins with `#`.
    pub(crate) fn next_row(&mut self) -> u64 {
        self.rows.pop_front().unwrap_or(self.line)
    }

    /// Records the lines in some further bytes.
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

    /// Whether the end was reached in the middle of a line.
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
