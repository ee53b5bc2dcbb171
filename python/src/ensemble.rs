//! Tables of bodies.

use std::sync::Arc;

use glam::DQuat;
use polhode::Ensemble;
use polhode::bodies::ensemble::Translation;
use polhode::bodies::inertia::InertiaTensor;
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arrays::{self, Column, SYMMETRY_TOLERANCE, View, moved_rows, quaternion_at, vector_at, views};
use crate::errors;

/// A table of rigid bodies, valid in every row; scenes share it.
#[pyclass(frozen, module = "polhode._native", name = "Bodies")]
pub(crate) struct Bodies(pub(crate) Arc<Ensemble>);

/// Columns of the position or velocity; zero where there are none.
fn vectors(py: Python<'_>, name: &str, columns: Option<&[Column<'_>]>, count: usize) -> PyResult<Vec<glam::DVec3>> {
    let Some(columns) = columns else { return Ok(vec![glam::DVec3::ZERO; count]) };
    let columns = views(py, name, columns, 3, count)?;
    Ok((0..count).map(|row| vector_at(&columns, row)).collect())
}

/// The tensor at a row, of three, six or nine columns: moments; xx, yy, zz, xy, xz, yz; and of nine yx, zx, zy behind these.
fn tensor_at(columns: &[View<'_>], row: usize) -> InertiaTensor {
    let mut elements = [0.0; 6];
    elements.iter_mut().zip(columns).for_each(|(element, column)| *element = column[row]);
    InertiaTensor::from_array(elements)
}

/// Refuses the first tensor of nine columns that is not symmetric.
fn check_symmetry(py: Python<'_>, columns: &[View<'_>], count: usize) -> PyResult<()> {
    const ELEMENTS: [&str; 3] = ["[0, 1]", "[0, 2]", "[1, 2]"];
    if columns.len() < 9 {
        return Ok(());
    }
    let fault = |row: usize| {
        let largest = columns.iter().fold(0.0_f64, |largest, column| largest.max(column[row].abs()));
        (0..3).find(|&element| {
            let skew = (columns[3 + element][row] - columns[6 + element][row]).abs();
            skew.is_finite() && skew > SYMMETRY_TOLERANCE * largest
        })
    };
    match (0..count).into_par_iter().find_map_first(|row| fault(row).map(|element| (row, element))) {
        None => Ok(()),
        Some((row, element)) => {
            let (name, upper, lower) = (ELEMENTS[element], columns[3 + element][row], columns[6 + element][row]);
            let message = format!(
                "body {row}: inertia{name} = {upper}, but {lower} across the diagonal: expected a symmetric tensor"
            );
            Err(errors::input(py, message))
        }
    }
}

#[pymethods]
impl Bodies {
    #[new]
    #[pyo3(signature = (count, inertia, orientation, angular_velocity, mass, position, velocity, repair))]
    #[allow(clippy::too_many_arguments, reason = "the groups of columns that a table has")]
    fn new(
        py: Python<'_>,
        count: usize,
        inertia: Vec<Column<'_>>,
        orientation: Option<Vec<Column<'_>>>,
        angular_velocity: Vec<Column<'_>>,
        mass: Option<Column<'_>>,
        position: Option<Vec<Column<'_>>>,
        velocity: Option<Vec<Column<'_>>>,
        repair: Option<f64>,
    ) -> PyResult<Self> {
        let inertia = views(py, "inertia", &inertia, inertia.len(), count)?;
        check_symmetry(py, &inertia, count)?;
        let orientation = match &orientation {
            Some(columns) => Some(views(py, "orientation", columns, 4, count)?),
            None => None,
        };
        let angular_velocity = views(py, "angular_velocity", &angular_velocity, 3, count)?;
        let body = |row: usize| {
            let turned = orientation.as_ref().map_or(DQuat::IDENTITY, |columns| quaternion_at(columns, row));
            (tensor_at(&inertia, row), turned, vector_at(&angular_velocity, row))
        };
        let made = match repair {
            Some(limit) => Ensemble::from_fn_repaired(count, limit, body),
            None => Ensemble::from_fn(count, body),
        };
        let mut ensemble = made.map_err(|error| errors::of_library(py, &error))?;
        if let Some(mass) = mass {
            let mass = views(py, "mass", std::slice::from_ref(&mass), 1, count)?;
            let translation = Translation {
                mass: mass[0].to_vec(),
                position: vectors(py, "position", position.as_deref(), count)?,
                velocity: vectors(py, "velocity", velocity.as_deref(), count)?,
            };
            ensemble = ensemble.with_translation(translation).map_err(|error| errors::of_library(py, &error))?;
        }
        Ok(Self(Arc::new(ensemble)))
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    /// Tensors, shape (n, 3, 3).
    fn inertia<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::tensors(py, self.0.inertia().iter().copied())
    }

    /// Quaternions x, y, z, w, shape (n, 4).
    fn orientation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        moved_rows(py, self.0.orientation().to_vec(), &[self.0.len()])
    }

    /// Angular velocities in body axes, shape (n, 3).
    fn angular_velocity<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        moved_rows(py, self.0.angular_velocity_body().to_vec(), &[self.0.len()])
    }

    /// Masses, positions and velocities, where the bodies move through space.
    fn translation<'py>(&self, py: Python<'py>) -> PyResult<Option<[Bound<'py, PyAny>; 3]>> {
        let Some(translation) = self.0.translation() else { return Ok(None) };
        let rows = [self.0.len()];
        Ok(Some([
            arrays::moved(py, translation.mass.clone(), &rows)?,
            moved_rows(py, translation.position.clone(), &rows)?,
            moved_rows(py, translation.velocity.clone(), &rows)?,
        ]))
    }

    /// How many tensors were repaired, the greatest relative change, and the greatest that was allowed.
    fn repairs(&self) -> Option<(usize, f64, f64)> {
        let repairs = self.0.repairs()?;
        Some((repairs.bodies, repairs.largest_relative_change, repairs.limit))
    }
}
