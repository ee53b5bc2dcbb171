//! Mass properties of shapes, meshes, points and parts, one row a body.

use std::path::PathBuf;

use glam::{DMat3, DQuat, DVec3};
use numpy::PyReadonlyArrayDyn;
use polhode::Error;
use polhode::bodies::inertia::{
    InertiaTensor, MassProperties, Part, Shape, compose, convex_hull, point_masses, principal_axes, read_mesh,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::arrays::{Column, View, moved, moved_rows, tensors, vector_at, views};
use crate::errors;

/// Mass properties as arrays, one row a body.
fn arrays<'py>(py: Python<'py>, rows: &[MassProperties]) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    let shape = [rows.len()];
    all.set_item("mass", moved(py, rows.iter().map(|row| row.mass).collect::<Vec<f64>>(), &shape)?)?;
    all.set_item("volume", moved(py, rows.iter().map(|row| row.volume).collect::<Vec<f64>>(), &shape)?)?;
    all.set_item("centre_of_mass", moved_rows(py, rows.iter().map(|row| row.centre_of_mass).collect(), &shape)?)?;
    all.set_item("inertia", tensors(py, rows.iter().map(|row| row.inertia))?)?;
    Ok(all)
}

fn raised(py: Python<'_>) -> impl Fn(Error) -> PyErr {
    move |error| errors::of_library(py, &error)
}

/// The shape of these lengths; a vector of lengths is three of them.
fn shape(name: &str, lengths: &[f64]) -> Option<Shape> {
    let vector = |at: usize| DVec3::from_slice(&lengths[at..at + 3]);
    Some(match (name, lengths) {
        ("point", []) => Shape::Point,
        ("rod", &[length]) => Shape::Rod { length },
        ("sphere", &[radius]) => Shape::Sphere { radius },
        ("spherical_shell", &[radius]) => Shape::SphericalShell { radius },
        ("circular_plate", &[radius]) => Shape::CircularPlate { radius },
        ("ellipsoid", [_, _, _]) => Shape::Ellipsoid { semi_axes: vector(0) },
        ("box", [_, _, _]) => Shape::Box { edges: vector(0) },
        ("cylinder", &[radius, height]) => Shape::Cylinder { radius, height },
        ("cone", &[radius, height]) => Shape::Cone { radius, height },
        ("tube", &[inner_radius, outer_radius, height]) => Shape::Tube { inner_radius, outer_radius, height },
        ("capsule", &[radius, length]) => Shape::Capsule { radius, length },
        ("torus", &[major_radius, minor_radius]) => Shape::Torus { major_radius, minor_radius },
        ("rectangular_plate", &[width, depth]) => Shape::RectangularPlate { width, depth },
        ("tetrahedron", [_, _, _, _, _, _, _, _, _, _, _, _]) => {
            Shape::Tetrahedron { corners: [vector(0), vector(3), vector(6), vector(9)] }
        }
        _ => return None,
    })
}

/// Mass properties of a shape whose lengths are columns; `amount` is the mass, or else the density.
#[pyfunction]
pub(crate) fn shape_mass_properties<'py>(
    py: Python<'py>,
    name: &str,
    lengths: Vec<Column<'py>>,
    amount: Column<'py>,
    is_density: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let amount = amount.as_array();
    let lengths = views(py, name, &lengths, lengths.len(), amount.len())?;
    let row = |row: usize| {
        let of_row: Vec<f64> = lengths.iter().map(|column: &View<'_>| column[row]).collect();
        let shape = shape(name, &of_row).ok_or(row)?;
        let properties = match is_density {
            true => shape.mass_properties_of_density(amount[row]),
            false => shape.mass_properties(amount[row]),
        };
        Ok(properties.map_err(|error| (row, error)))
    };
    let rows: Result<Vec<_>, usize> = (0..amount.len()).into_par_iter().map(row).collect();
    let rows = rows.map_err(|_| errors::input(py, format!("{name}: expected a shape with its lengths")))?;
    let rows: Result<Vec<MassProperties>, (usize, Error)> = rows.into_iter().collect();
    let refused = |(row, error): (usize, Error)| match amount.len() {
        1 => errors::of_library(py, &error),
        _ => errors::input(py, format!("row {row}: {error}")),
    };
    arrays(py, &rows.map_err(refused)?)
}

/// Of a closed surface or a thin skin in a file; or of its density.
#[pyfunction]
pub(crate) fn mesh_mass_properties<'py>(
    py: Python<'py>,
    file: PathBuf,
    mass: Option<f64>,
    density: Option<f64>,
    scale: f64,
    shell: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let found = py.detach(|| {
        let mesh = read_mesh(&file)?;
        let mesh = if scale == 1.0 { mesh } else { mesh.scaled(scale)? };
        match (mass, density) {
            (Some(mass), _) if shell => mesh.shell_mass_properties(mass),
            (Some(mass), _) => mesh.mass_properties(mass),
            (None, density) => mesh.mass_properties_of_density(density.unwrap_or(f64::NAN)),
        }
    });
    arrays(py, &[found.map_err(raised(py))?])
}

/// Points as they are given in rows of three.
fn points(view: &PyReadonlyArrayDyn<'_, f64>) -> Vec<DVec3> {
    view.as_array().rows().into_iter().map(|row| DVec3::new(row[0], row[1], row[2])).collect()
}

/// Of the convex hull of points, shape (n, 3).
#[pyfunction]
pub(crate) fn hull_mass_properties<'py>(
    py: Python<'py>,
    corners: PyReadonlyArrayDyn<'py, f64>,
    mass: Option<f64>,
    density: Option<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let corners = points(&corners);
    let found = py.detach(|| {
        let mesh = convex_hull(&corners)?;
        match mass {
            Some(mass) => mesh.mass_properties(mass),
            None => mesh.mass_properties_of_density(density.unwrap_or(f64::NAN)),
        }
    });
    arrays(py, &[found.map_err(raised(py))?])
}

/// Of point masses.
#[pyfunction]
pub(crate) fn points_mass_properties<'py>(
    py: Python<'py>,
    masses: Column<'py>,
    positions: PyReadonlyArrayDyn<'py, f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let masses: Vec<(f64, DVec3)> = masses.as_array().iter().copied().zip(points(&positions)).collect();
    arrays(py, &[point_masses(&masses).map_err(raised(py))?])
}

/// A part: mass, volume, centre of mass, inertia, orientation, position, and whether it is a hole.
type GivenPart = (f64, f64, [f64; 3], [[f64; 3]; 3], [f64; 4], [f64; 3], bool);

/// Of a body that is put together from parts.
#[pyfunction]
pub(crate) fn composed_mass_properties<'py>(py: Python<'py>, parts: Vec<GivenPart>) -> PyResult<Bound<'py, PyDict>> {
    let part = |(mass, volume, centre, inertia, orientation, position, is_hole): GivenPart| {
        let inertia = InertiaTensor::from(DMat3::from_cols_array_2d(&inertia));
        let properties = MassProperties { mass, volume, centre_of_mass: DVec3::from_array(centre), inertia };
        let orientation = DQuat::from_array(orientation);
        Part { properties, orientation: orientation.normalize(), position: DVec3::from_array(position), is_hole }
    };
    let parts: Vec<Part> = parts.into_iter().map(part).collect();
    arrays(py, &[compose(&parts).map_err(raised(py))?])
}

/// Principal moments, shape (n, 3), and the rotations from principal to body axes, x, y, z, w, shape (n, 4), of tensors that are given as six
/// columns: xx, yy, zz, xy, xz, yz.
#[pyfunction]
pub(crate) fn principal<'py>(
    py: Python<'py>,
    count: usize,
    columns: Vec<Column<'py>>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let columns = views(py, "inertia", &columns, 6, count)?;
    let axes = |row: usize| {
        let (diagonal, products) = (vector_at(&columns, row), vector_at(&columns[3..], row));
        let elements = [diagonal.x, diagonal.y, diagonal.z, products.x, products.y, products.z];
        let axes = principal_axes(&InertiaTensor::from_array(elements));
        (axes.moments, axes.principal_to_body)
    };
    let (moments, rotations): (Vec<DVec3>, Vec<DQuat>) = (0..count).into_par_iter().map(axes).unzip();
    Ok((moved_rows(py, moments, &[count])?, moved_rows(py, rotations, &[count])?))
}
