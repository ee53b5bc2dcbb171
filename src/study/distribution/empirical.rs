//! Rows of a table, drawn with replacement.

use std::fs::File;
use std::path::Path;

use csv::StringRecord;

use crate::error::{Error, FileAction, InputFault, Result};
use crate::study::draw::{Column, Draw};
use crate::study::rows::{Rows, input_error};

/// The rows of N columns of a CSV file; every body takes one, all with equal probability.
#[derive(Clone, Debug, PartialEq)]
pub struct Empirical<const N: usize> {
    rows: Vec<[f64; N]>,
    /// Hash of the file's name: bodies take the same row for all columns of one file, and rows of different files are
    /// independent.
    block: u32,
}

impl<const N: usize> Empirical<N> {
    /// Reads the columns `names` of the file at `path`, SI units; `name` is the file's name in the study, on which draws depend.
    ///
    /// # Errors
    ///
    /// [`Error::File`] if the file cannot be read; [`Error::Input`] with line and column if a column is missing, a number is not finite,
    /// there is no row, or the last line does not end in a newline.
    pub fn read(path: &Path, name: &str, names: &[&str; N]) -> Result<Self> {
        let file = File::open(path).map_err(|error| Error::file(path, FileAction::Read, &error))?;
        let mut table = Rows::new(path, file)?;
        let (header, line) = (table.header().clone(), table.header_line());
        let mut places = [0; N];
        for (place, wanted) in places.iter_mut().zip(names) {
            *place = header.iter().position(|found| found == *wanted).ok_or_else(|| {
                let known: Vec<&str> = header.iter().collect();
                input_error(path, line, wanted, InputFault::unknown(wanted, &known))
            })?;
        }
        let (mut rows, mut record) = (Vec::new(), StringRecord::new());
        while table.read(&mut record)? {
            let mut row = [0.0; N];
            for (number, &place) in row.iter_mut().zip(&places) {
                let field = &record[place];
                *number = field.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(|| {
                    let value = if field.is_empty() { "(empty)".to_owned() } else { field.to_owned() };
                    table.refused(
                        &header[place],
                        InputFault::Value { value, expected: "expected a finite number".into() },
                    )
                })?;
            }
            rows.push(row);
        }
        table.finish()?;
        if rows.is_empty() {
            let fault = InputFault::Missing { expected: "expected one row at least".into() };
            return Err(input_error(path, line, names[0], fault));
        }
        Ok(Self { rows, block: fnv_1a(name) })
    }

    /// The row of `body`.
    pub(super) fn row(&self, draw: Draw, body: usize) -> [f64; N] {
        let [a, b, ..] = draw.bits(body, Column::Rows, self.block);
        let bits = u64::from(a) << 32 | u64::from(b);
        // ⌊n x⌋ of a 64-bit fraction x: in a table of a million rows the probabilities are equal to 1e-13.
        let index = (u128::from(bits) * self.rows.len() as u128) >> 64;
        self.rows[index as usize]
    }
}

/// A 32-bit hash of a name (G. Fowler, L. C. Noll, K.-P. Vo; RFC 9923).
pub(super) fn fnv_1a(name: &str) -> u32 {
    name.bytes().fold(0x811c_9dc5, |hash: u32, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}
