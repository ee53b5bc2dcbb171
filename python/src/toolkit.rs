//! Attitudes and the equations of motion, row by row.

use glam::{DQuat, DVec3};
use polhode::bodies::inertia::InertiaTensor;
use polhode::bodies::toolkit;
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arrays::{Column, View, moved, moved_rows, quaternion_at, vector_at, views};
use crate::errors;

/// The angle of the rotation between two orientations, rad, row by row.
#[pyfunction]
pub(crate) fn attitude_error<'py>(
    py: Python<'py>,
    count: usize,
    first: Vec<Column<'py>>,
    second: Vec<Column<'py>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (first, second) = (views(py, "a", &first, 4, count)?, views(py, "b", &second, 4, count)?);
    let angle = |row| toolkit::attitude_error(quaternion_at(&first, row), quaternion_at(&second, row));
    moved(py, (0..count).into_par_iter().map(angle).collect::<Vec<f64>>(), &[count])
}

/// The rotation by a vector, x, y, z, w, row by row.
#[pyfunction]
pub(crate) fn exponential<'py>(
    py: Python<'py>,
    count: usize,
    vectors: Vec<Column<'py>>,
) -> PyResult<Bound<'py, PyAny>> {
    let vectors = views(py, "rotation_vector", &vectors, 3, count)?;
    let turned = |row| toolkit::exponential(vector_at(&vectors, row));
    moved_rows(py, (0..count).into_par_iter().map(turned).collect::<Vec<DQuat>>(), &[count])
}

/// The vector of a rotation, row by row.
#[pyfunction]
pub(crate) fn logarithm<'py>(
    py: Python<'py>,
    count: usize,
    rotations: Vec<Column<'py>>,
) -> PyResult<Bound<'py, PyAny>> {
    let rotations = views(py, "orientation", &rotations, 4, count)?;
    let vector = |row| toolkit::logarithm(quaternion_at(&rotations, row).normalize());
    moved_rows(py, (0..count).into_par_iter().map(vector).collect::<Vec<DVec3>>(), &[count])
}

fn tensor_at(columns: &[View<'_>], row: usize) -> InertiaTensor {
    let (diagonal, products) = (vector_at(columns, row), vector_at(&columns[3..], row));
    InertiaTensor::from_array([diagonal.x, diagonal.y, diagonal.z, products.x, products.y, products.z])
}

/// Functions of tensors (six columns) and an angular velocity, and some of another vector, all in the same axes; vectors, or numbers where they
/// give such.
#[pyfunction]
pub(crate) fn of_motion<'py>(
    py: Python<'py>,
    name: &str,
    count: usize,
    inertia: Vec<Column<'py>>,
    angular_velocity: Vec<Column<'py>>,
    other: Option<Vec<Column<'py>>>,
) -> PyResult<Bound<'py, PyAny>> {
    let tensors = views(py, "inertia", &inertia, 6, count)?;
    let spins = views(py, "angular_velocity", &angular_velocity, 3, count)?;
    let others = other.as_ref().map(|other| views(py, "other", other, 3, count)).transpose()?;
    let other = |row| others.as_ref().map_or(DVec3::ZERO, |columns| vector_at(columns, row));
    let number: Option<fn(&InertiaTensor, DVec3) -> f64> = match name {
        "rotational_kinetic_energy" => Some(toolkit::rotational_kinetic_energy),
        "momentum_angle" => Some(toolkit::momentum_angle),
        _ => None,
    };
    if let Some(number) = number {
        let row = |row| number(&tensor_at(&tensors, row), vector_at(&spins, row));
        return moved(py, (0..count).into_par_iter().map(row).collect::<Vec<f64>>(), &[count]);
    }
    let vector: fn(&InertiaTensor, DVec3, DVec3) -> DVec3 = match name {
        "angular_acceleration_body" => toolkit::angular_acceleration_body,
        "torque_of_motion" => toolkit::torque_of_motion,
        "angular_momentum" => |inertia, spin, _| toolkit::angular_momentum(inertia, spin),
        _ => return Err(errors::input(py, format!("{name}: expected a function of the toolkit"))),
    };
    let row = |row| vector(&tensor_at(&tensors, row), vector_at(&spins, row), other(row));
    moved_rows(py, (0..count).into_par_iter().map(row).collect::<Vec<DVec3>>(), &[count])
}
