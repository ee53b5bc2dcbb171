//! Point masses in CSV files: a header, then one row for each point.
//!
//! Columns, in any order: `mass` (kg), `x`, `y`, `z` (m). A column `name` is ignored. Lines that begin with `#` are comments. If only
//! positions matter, as for a convex hull, `mass` may be omitted.

use std::fs::File;
use std::path::Path;

use csv::StringRecord;
use glam::DVec3;

use super::rows::{Rows, input_error};
use crate::error::InputFault;
use crate::error::{Error, FileAction, Result};

/// All columns that a file may have.
const KNOWN: [&str; 5] = ["name", "mass", "x", "y", "z"];

/// The points of a file: mass (kg; 1 if the file has no masses) and position (m).
///
/// ```
/// use polhode::bodies::inertia::point_masses;
/// use polhode::study::read_points;
///
/// let path = std::env::temp_dir().join(format!("polhode-points-{}.csv", std::process::id()));
/// std::fs::write(&path, "name,mass,x,y,z\nO,2.66e-26,0,0,0\nC,1.99e-26,1.128e-10,0,0\n")?;
/// let molecule = point_masses(&read_points(&path)?)?;
/// std::fs::remove_file(&path)?;
/// assert!((molecule.inertia.zz / 1.448e-46 - 1.0).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// [`Error::File`] if the file cannot be read; [`Error::Input`] with line and column if a number is missing or not finite, a mass is
/// negative, there are no points, or the last line does not end in a newline, as if the file was cut.
pub fn read_points(path: &Path) -> Result<Vec<(f64, DVec3)>> {
    Ok(points_with_lines(path)?.into_iter().map(|(_, point)| point).collect())
}

/// The same, each with its line number, from 1.
pub(super) fn points_with_lines(path: &Path) -> Result<Vec<(u64, (f64, DVec3))>> {
    let file = File::open(path).map_err(|error| Error::file(path, FileAction::Read, &error))?;
    let mut rows = Rows::new(path, file)?;
    let (header, header_line) = (rows.header().clone(), rows.header_line());
    for (place, name) in header.iter().enumerate() {
        if header.iter().take(place).any(|before| before == name) {
            let fault = InputFault::Syntax { reason: "this column occurs twice in the header".to_owned() };
            return Err(input_error(path, header_line, name, fault));
        }
        if !KNOWN.contains(&name) {
            let key = if name.is_empty() { "(empty)" } else { name };
            let fault = InputFault::unknown(name, &KNOWN);
            return Err(input_error(path, header_line, key, fault));
        }
    }
    let place = |name: &str| header.iter().position(|found| found == name);
    let need = |name: &'static str| {
        let fault = InputFault::Missing { expected: "expected the columns mass, x, y and z (kg, m)".into() };
        place(name).ok_or_else(|| input_error(path, header_line, name, fault))
    };
    let (mass, places) = (place("mass"), [need("x")?, need("y")?, need("z")?]);

    let mut points = Vec::new();
    let mut record = StringRecord::new();
    while rows.read(&mut record)? {
        let number = |column: usize, least: f64, expected: &'static str| {
            let field = &record[column];
            field.parse().ok().filter(|x: &f64| x.is_finite() && *x >= least).ok_or_else(|| {
                let value = if field.is_empty() { "(empty)".to_owned() } else { field.to_owned() };
                rows.refused(&header[column], InputFault::Value { value, expected: expected.into() })
            })
        };
        let mass = match mass {
            Some(column) => number(column, 0.0, "expected a finite mass that is not negative (kg)")?,
            None => 1.0,
        };
        let coordinate = |axis: usize| number(places[axis], f64::NEG_INFINITY, "expected a finite number (m)");
        points.push((rows.line(), (mass, DVec3::new(coordinate(0)?, coordinate(1)?, coordinate(2)?))));
    }
    rows.finish()?;
    if points.is_empty() {
        let fault = InputFault::Missing { expected: "expected at least one row, a point".into() };
        return Err(input_error(path, header_line, "mass", fault));
    }
    Ok(points)
}
