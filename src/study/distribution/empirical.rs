//! Rows of a table, drawn with replacement.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use csv::StringRecord;

use crate::error::{Error, FileAction, InputFault, Result};
use crate::study::draw::{Column, Draw};
use crate::study::reader::Node;
use crate::study::rows::{Rows, input_error};

/// The rows of N columns of a CSV file; every body takes one, all with equal probability.
#[derive(Clone, Debug, PartialEq)]
pub struct Empirical<const N: usize> {
    /// N numbers of each row, row after row.
    numbers: Arc<[f64]>,
    /// Hash of the file's name: bodies take the same row for all columns of one file, and rows of different files are
    /// independent.
    block: u32,
}

impl<const N: usize> Empirical<N> {
    /// Reads the columns `names` of the file at `path`, SI units; `name` is the file's name in the study, on which draws depend.
    ///
    /// # Errors
    ///
    /// [`Error::File`] if the file cannot be read; [`Error::Input`] with line and column if a column is missing or occurs twice, a number is
    /// not finite, there is no row, or the last line does not end in a newline.
    pub fn read(path: &Path, name: &str, names: &[&str; N]) -> Result<Self> {
        Ok(Self { numbers: numbers(path, names)?, block: fnv_1a(&plain(name)) })
    }

    /// Reads the columns `names` of the file that is called `name` in a study's value; keys that read the same columns share the numbers.
    pub(super) fn of_study(file: &Node<'_>, name: &str, names: &[&str; N]) -> Result<Self> {
        let name = plain(name);
        let path = file.beside(&name);
        let numbers = file.context().rows(&path, names, || numbers(&path, names))?;
        Ok(Self { numbers, block: fnv_1a(&name) })
    }

    /// The row of `body`.
    pub(super) fn row(&self, draw: Draw, body: usize) -> [f64; N] {
        let [a, b, ..] = draw.bits(body, Column::Rows, self.block);
        let bits = u64::from(a) << 32 | u64::from(b);
        // ⌊n x⌋ of a 64-bit fraction x: in a table of a million rows the probabilities are equal to 1e-13.
        let (rows, _) = self.numbers.as_chunks();
        let index = (u128::from(bits) * rows.len() as u128) >> 64;
        rows[index as usize]
    }
}

/// The numbers of the columns `names` of the file at `path`, row after row.
fn numbers(path: &Path, names: &[&str]) -> Result<Arc<[f64]>> {
    let file = File::open(path).map_err(|error| Error::file(path, FileAction::Read, &error))?;
    let mut table = Rows::new(path, file)?;
    let places: Vec<usize> = names
        .iter()
        .map(|wanted| {
            column(table.header(), wanted).map_err(|fault| input_error(path, table.header_line(), wanted, fault))
        })
        .collect::<Result<_>>()?;
    let (mut numbers, mut record) = (Vec::new(), StringRecord::new());
    while table.read(&mut record)? {
        for (name, &place) in names.iter().zip(&places) {
            let field = &record[place];
            let number = field.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(|| {
                let value = if field.is_empty() { "(empty)".to_owned() } else { field.to_owned() };
                table.refused(name, InputFault::Value { value, expected: "expected a finite number".into() })
            })?;
            numbers.push(number);
        }
    }
    let line = table.header_line();
    table.finish()?;
    if numbers.is_empty() {
        let fault = InputFault::Missing { expected: "expected one row at least".into() };
        return Err(input_error(path, line, names[0], fault));
    }
    Ok(numbers.into())
}

/// The place of a column in a header, in which it must stand once.
fn column(header: &StringRecord, wanted: &str) -> std::result::Result<usize, InputFault> {
    let mut places = header.iter().enumerate().filter(|(_, found)| *found == wanted).map(|(place, _)| place);
    match (places.next(), places.next()) {
        (Some(place), None) => Ok(place),
        (Some(_), Some(_)) => Err(InputFault::Syntax { reason: "this column occurs twice in the header".to_owned() }),
        (None, _) => Err(InputFault::unknown(wanted, &header.iter().collect::<Vec<_>>())),
    }
}

/// A file's name without parts that lead nowhere, so that "rr.csv" and "./rr.csv" name one file; other names are left as they are.
fn plain(name: &str) -> String {
    let root = if name.starts_with('/') { "/" } else { "" };
    let parts: Vec<&str> = name.split('/').filter(|part| !matches!(*part, "" | ".")).collect();
    root.to_owned() + &parts.join("/")
}

/// A 32-bit hash of a name (G. Fowler, L. C. Noll, K.-P. Vo; RFC 9923).
pub(super) fn fnv_1a(name: &str) -> u32 {
    name.bytes().fold(0x811c_9dc5, |hash: u32, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::reader::FileText;

    #[test]
    fn keys_that_read_the_same_columns_of_a_file_share_the_numbers() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("rows.csv"), "a,b\n1,2\n3,4\n").expect("a file");
        let file = folder.path().join("study.toml");
        FileText::new(&file, "file = 'rows.csv'")
            .parse(|root| {
                let node = root.need("file", "a file")?;
                let read = |name: &str, names: [&str; 1]| Empirical::of_study(&node, name, &names);
                let (first, again, other) =
                    (read("rows.csv", ["a"])?, read("./rows.csv", ["a"])?, read("rows.csv", ["b"])?);
                assert!(Arc::ptr_eq(&first.numbers, &again.numbers));
                assert_eq!((first.numbers.to_vec(), other.numbers.to_vec()), (vec![1.0, 3.0], vec![2.0, 4.0]));
                Ok(())
            })
            .expect("rows");
    }

    #[test]
    fn names_without_parts_that_lead_nowhere_are_left_as_they_are() {
        for name in ["rr.csv", "../a b/rr.csv", "/tmp/rr.csv", "a\\b.csv", ".hidden/r.csv"] {
            assert_eq!(plain(name), name);
        }
        for (name, expected) in
            [("./rr.csv", "rr.csv"), ("a/./b//c.csv", "a/b/c.csv"), ("/./tmp/rr.csv", "/tmp/rr.csv")]
        {
            assert_eq!(plain(name), expected);
        }
    }
}
