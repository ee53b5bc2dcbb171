//! Tables that are written as a whole: events, survival, histograms, bodies that have failed.

use super::folder::OutputFolder;
use super::npz_file::{Archive, npy_header};
use crate::error::Result;
use crate::study::Format;

/// A column of a table.
pub(crate) enum Column<'a> {
    /// Numbers.
    Numbers(Box<dyn Fn(usize) -> f64 + 'a>),
    /// Whole numbers.
    Counts(Box<dyn Fn(usize) -> u64 + 'a>),
    /// Whole numbers below 256.
    Codes(Box<dyn Fn(usize) -> u8 + 'a>),
    /// Words of at most so many bytes: arrays hold them filled up with zeros.
    Words(usize, Box<dyn Fn(usize) -> &'a str + 'a>),
}

impl<'a> Column<'a> {
    pub fn numbers(of_row: impl Fn(usize) -> f64 + 'a) -> Self {
        Self::Numbers(Box::new(of_row))
    }

    pub fn counts(of_row: impl Fn(usize) -> u64 + 'a) -> Self {
        Self::Counts(Box::new(of_row))
    }

    pub fn codes(of_row: impl Fn(usize) -> u8 + 'a) -> Self {
        Self::Codes(Box::new(of_row))
    }

    pub fn words(longest: usize, of_row: impl Fn(usize) -> &'a str + 'a) -> Self {
        Self::Words(longest.max(1), Box::new(of_row))
    }

    /// The type of its elements in arrays, and their size.
    fn element(&self) -> (String, usize) {
        match self {
            Self::Numbers(_) => ("<f8".to_owned(), 8),
            Self::Counts(_) => ("<u8".to_owned(), 8),
            Self::Codes(_) => ("|u1".to_owned(), 1),
            Self::Words(longest, _) => (format!("|S{longest}"), *longest),
        }
    }

    fn append_bytes(&self, row: usize, bytes: &mut Vec<u8>) {
        match self {
            Self::Numbers(number) => bytes.extend(number(row).to_le_bytes()),
            Self::Counts(count) => bytes.extend(count(row).to_le_bytes()),
            Self::Codes(code) => bytes.push(code(row)),
            Self::Words(longest, word) => {
                let end = bytes.len() + longest;
                bytes.extend(word(row).bytes().take(*longest));
                bytes.resize(end, 0);
            }
        }
    }

    fn append_text(&self, row: usize, text: &mut String, number: &mut zmij::Buffer) {
        match self {
            Self::Numbers(of_row) => text.push_str(number.format(of_row(row))),
            Self::Counts(count) => text.push_str(itoa::Buffer::new().format(count(row))),
            Self::Codes(code) => text.push_str(itoa::Buffer::new().format(code(row))),
            Self::Words(_, word) => {
                let word = word(row);
                if word.contains([',', '"', '\n', '\r']) {
                    *text += &format!("\"{}\"", word.replace('"', "\"\""));
                } else {
                    *text += word;
                }
            }
        }
    }
}

/// Text or bytes that are written at once.
const PIECE: usize = 1 << 20;

/// Writes a table of so many rows.
pub(crate) fn write(
    folder: &mut OutputFolder,
    stem: &str,
    format: Format,
    rows: usize,
    columns: &[(&str, Column<'_>)],
) -> Result<()> {
    let mut file = folder.begin(&format!("{stem}.{}", format.name()))?;
    match format {
        Format::Csv => {
            let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
            let mut text = names.join(",") + "\n";
            let mut number = zmij::Buffer::new();
            for row in 0..rows {
                for (place, (_, column)) in columns.iter().enumerate() {
                    if place > 0 {
                        text.push(',');
                    }
                    column.append_text(row, &mut text, &mut number);
                }
                text.push('\n');
                if text.len() > PIECE {
                    file.write(text.as_bytes())?;
                    text.clear();
                }
            }
            file.write(text.as_bytes())?;
            file.finish()
        }
        Format::Npz => {
            let mut archive = Archive::new(file);
            let header = |column: &Column<'_>| npy_header(&column.element().0, &[rows]);
            for (name, column) in columns {
                let size = header(column).len() + rows * column.element().1;
                archive.reserve(format!("{name}.npy"), size as u64);
            }
            for (entry, (_, column)) in columns.iter().enumerate() {
                let mut bytes = header(column);
                for row in 0..rows {
                    column.append_bytes(row, &mut bytes);
                    if bytes.len() > PIECE {
                        archive.append(entry, &bytes)?;
                        bytes.clear();
                    }
                }
                archive.append(entry, &bytes)?;
            }
            archive.finish()
        }
    }
}
