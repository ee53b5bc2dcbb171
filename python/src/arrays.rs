//! Columns that come from NumPy and go there.

use bytemuck::{Pod, cast_vec};
use glam::{DMat3, DQuat, DVec3};
use numpy::ndarray::{ArrayView1, ArrayViewD};
use numpy::{Element, PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArrayDyn};
use polhode::bodies::inertia::InertiaTensor;
use polhode::torque::Parameter;
use pyo3::prelude::*;

use crate::errors;

/// One number a body. Any strides will do, so that nothing has to be copied before it is read.
pub(crate) type Column<'py> = PyReadonlyArray1<'py, f64>;

/// What a column holds.
pub(crate) type View<'a> = ArrayView1<'a, f64>;

/// The columns of three components at a row.
pub(crate) fn vector_at(columns: &[View<'_>], row: usize) -> DVec3 {
    DVec3::new(columns[0][row], columns[1][row], columns[2][row])
}

/// The columns of four components at a row: x, y, z, w.
pub(crate) fn quaternion_at(columns: &[View<'_>], row: usize) -> DQuat {
    DQuat::from_xyzw(columns[0][row], columns[1][row], columns[2][row], columns[3][row])
}

/// Refuses columns of other numbers or lengths.
pub(crate) fn views<'a>(
    py: Python<'_>,
    name: &str,
    columns: &'a [Column<'_>],
    wanted: usize,
    rows: usize,
) -> PyResult<Vec<View<'a>>> {
    let views: Vec<View<'a>> = columns.iter().map(|column| column.as_array()).collect();
    if views.len() != wanted {
        return Err(errors::input(py, format!("{name}: {} components: expected {wanted}", views.len())));
    }
    match views.iter().find(|view| view.len() != rows) {
        Some(view) => Err(errors::input(py, format!("{name}: {} rows: expected {rows}, one a body", view.len()))),
        None => Ok(views),
    }
}

/// A vector of ours as an array of this shape; the memory changes hands.
pub(crate) fn moved<'py, T: Element>(py: Python<'py>, numbers: Vec<T>, shape: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    Ok(PyArray1::from_vec(py, numbers).reshape(shape.to_vec())?.into_any())
}

/// The same of rows of numbers, whose components become the last axis.
pub(crate) fn moved_rows<'py, R: Pod>(py: Python<'py>, rows: Vec<R>, shape: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    let mut rows = rows;
    // Rows become numbers in place; only what was reserved beyond them is given back.
    rows.shrink_to_fit();
    let components = size_of::<R>() / size_of::<f64>();
    let shape: Vec<usize> = shape.iter().copied().chain([components]).collect();
    moved(py, cast_vec::<R, f64>(rows), &shape)
}

/// Tensors as an array of shape `(…, 3, 3)`.
pub(crate) fn tensors<'py>(
    py: Python<'py>,
    tensors: impl ExactSizeIterator<Item = InertiaTensor>,
) -> PyResult<Bound<'py, PyAny>> {
    let shape = [tensors.len(), 3, 3];
    let numbers = tensors.flat_map(|tensor| tensor.to_matrix().to_cols_array()).collect();
    moved(py, numbers, &shape)
}

/// Numbers as a tensor: three moments along the axes, or nine elements row by row; `None` where these are not symmetric.
pub(crate) fn tensor(numbers: &[f64]) -> Option<InertiaTensor> {
    if let [x, y, z] = *numbers {
        return Some(InertiaTensor::from_principal_moments(DVec3::new(x, y, z)));
    }
    let [xx, xy, xz, yx, yy, yz, zx, zy, zz] = *<&[f64; 9]>::try_from(numbers).ok()?;
    let largest = numbers.iter().fold(0.0_f64, |largest, element| largest.max(element.abs()));
    let skew = (xy - yx).abs().max((xz - zx).abs()).max((yz - zy).abs());
    // Not finite: the library says which element.
    let is_symmetric = !(skew.is_finite() && skew > SYMMETRY_TOLERANCE * largest);
    is_symmetric.then(|| InertiaTensor::from_array([xx, yy, zz, xy, xz, yz]))
}

/// How far two elements of a tensor that should be equal may be apart, of the largest element: rounding of the products that it
/// was formed by.
pub(crate) const SYMMETRY_TOLERANCE: f64 = 1e-12;

/// A parameter that is given for all bodies, as an array of `shape`, or for each, with one axis before it.
pub(crate) fn parameter<V: Clone>(
    array: &PyReadonlyArrayDyn<'_, f64>,
    shape: &[usize],
    of_row: impl Fn(&[f64]) -> Option<V>,
) -> Option<Parameter<V>> {
    let view: ArrayViewD<'_, f64> = array.as_array();
    if view.shape() == shape {
        let numbers: Vec<f64> = view.iter().copied().collect();
        return of_row(&numbers).map(Parameter::Shared);
    }
    if view.ndim() == shape.len() + 1 && view.shape()[1..] == *shape {
        let row = |row: ArrayViewD<'_, f64>| of_row(&row.iter().copied().collect::<Vec<f64>>());
        let column: Option<Vec<V>> = view.outer_iter().map(row).collect();
        return column.map(|column| Parameter::PerBody(column.into()));
    }
    None
}

/// Three numbers.
pub(crate) fn vector(numbers: &[f64]) -> Option<DVec3> {
    <[f64; 3]>::try_from(numbers).ok().map(DVec3::from_array)
}

/// Four numbers, x, y, z, w.
pub(crate) fn quaternion(numbers: &[f64]) -> Option<DQuat> {
    <[f64; 4]>::try_from(numbers).ok().map(DQuat::from_array)
}

/// Nine numbers, row by row.
pub(crate) fn matrix(numbers: &[f64]) -> Option<DMat3> {
    <&[f64; 9]>::try_from(numbers).ok().map(|numbers| DMat3::from_cols_array(numbers).transpose())
}
