//! Parameters of torques and forces: shared by all bodies, drawn, or columns of the table of bodies.

use std::collections::BTreeSet;

use glam::{DQuat, DVec3};

use super::bodies::Bodies;
use super::distribution::{Orientation, Scalar, Vector};
use super::draw::{Column, Draw};
use super::inertia::Inertia;
use super::reader::Node;
use crate::bodies::inertia::InertiaTensor;
use crate::error::Result;
use crate::math::parallel;
use crate::torque::Parameter;

/// A number of each body: drawn, or a column of the table of bodies.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Number {
    Drawn(Scalar),
    Column(String),
}

/// A vector of each body: drawn, or three columns of the table of bodies.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Triple {
    Drawn(Vector),
    Columns([String; 3]),
}

/// An orientation of each body: drawn, or four columns of the table of bodies.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Turn {
    Drawn(Orientation),
    Columns([String; 4]),
}

/// An inertia tensor of each body.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Tensor {
    /// Moments along the body axes.
    Moments(Triple),
    /// As in `bodies`.
    Inertia(Inertia),
}

impl Number {
    /// Reads a number in `unit`, an SI unit; columns are in SI units.
    pub(super) fn read(node: &Node<'_>, unit: &str) -> Result<Self> {
        if let Some(table) = node.any_table().filter(|table| table.find("distribution").is_none())
            && let Some(column) = table.find("column")
        {
            table.only(&["column"])?;
            let name = column.string("expected the name of a column of the table of bodies")?;
            return Ok(Number::Column(name.to_owned()));
        }
        Scalar::read(node, unit).map(Number::Drawn)
    }
}

impl Triple {
    pub(super) fn read(node: &Node<'_>, unit: &str) -> Result<Self> {
        const EXPECTED: &str = "expected the names of three columns of the table of bodies";
        match columns(node, EXPECTED)? {
            Some(names) => Ok(Triple::Columns(names)),
            None => {
                refuse_single_columns(node)?;
                Vector::read(node, unit).map(Triple::Drawn)
            }
        }
    }
}

impl Turn {
    pub(super) fn read(node: &Node<'_>) -> Result<Self> {
        const EXPECTED: &str = "expected the names of four columns of the table of bodies (x, y, z, w)";
        match columns(node, EXPECTED)? {
            Some(names) => Ok(Turn::Columns(names)),
            None => Orientation::read(node).map(Turn::Drawn),
        }
    }
}

impl Tensor {
    pub(super) fn read(node: &Node<'_>) -> Result<Self> {
        if node.any_table().is_some_and(|table| table.find("columns").is_some()) {
            return Triple::read(node, "kg m²").map(Tensor::Moments);
        }
        Ok(match Inertia::read(node)? {
            Inertia::Moments(moments) => Tensor::Moments(Triple::Drawn(moments)),
            inertia => Tensor::Inertia(inertia),
        })
    }
}

/// The names in `{ columns = [...] }`, if the value has that form.
fn columns<const N: usize>(node: &Node<'_>, expected: &'static str) -> Result<Option<[String; N]>> {
    let table = node.any_table().filter(|table| table.find("distribution").is_none());
    let Some((table, columns)) = table.and_then(|table| table.find("columns").map(|found| (table, found))) else {
        return Ok(None);
    };
    table.only(&["columns"])?;
    let names = columns.elements().ok_or_else(|| columns.refuse(expected))?;
    let names: Vec<String> = names.iter().map(|name| Ok(name.string(expected)?.to_owned())).collect::<Result<_>>()?;
    names.try_into().map(Some).map_err(|_| columns.refuse(expected))
}

/// Refuses a vector of which a column gives one component, or all: `[{ column = "x" }, 0, 0]`, `{ column = "x" }`.
fn refuse_single_columns(node: &Node<'_>) -> Result<()> {
    let column = |node: &Node<'_>| {
        let table = node.any_table().filter(|table| table.find("distribution").is_none())?;
        table.find("column").map(|column| column.string("").map_or_else(|_| "...".to_owned(), str::to_owned))
    };
    let names: Vec<Option<String>> = match node.elements() {
        Some(components) => components.iter().map(column).collect(),
        None => vec![column(node)],
    };
    if names.iter().all(Option::is_none) {
        return Ok(());
    }
    let name = |place: usize| names.get(place).cloned().flatten().unwrap_or_else(|| "...".to_owned());
    let named = [0, 1, 2].map(|place| format!("{:?}", name(place))).join(", ");
    Err(node.refuse(format!(
        "expected {{ columns = [{named}] }}: a vector is read from three columns of the table of bodies, none of them a number"
    )))
}

/// The sources of parameters: draws and the table of bodies.
pub(super) struct Source<'a> {
    /// The study's draws.
    pub draw: Draw,
    /// The bodies, with their table if there is one.
    pub bodies: &'a Bodies,
    /// The owner of the parameters.
    pub of: Owner,
}

/// The owner of drawn parameters; draws of different owners are independent.
#[derive(Clone, Copy, Debug)]
pub(super) enum Owner {
    /// The torque of this index, from 0.
    Torque(usize),
    /// The force of this index, from 0.
    Force(usize),
    /// The orbit that the study states once, for all torques that need one.
    Orbit,
}

impl<'a> Source<'a> {
    pub(super) fn of(bodies: &'a Bodies, draw: Draw, of: Owner) -> Self {
        Self { draw, bodies, of }
    }

    /// The same for the study's orbit.
    pub(super) fn of_orbit(&self) -> Self {
        Self { of: Owner::Orbit, ..*self }
    }

    /// The values, for all bodies, of the `parameter`-th parameter of the torque or force, a number.
    pub(super) fn number(&self, number: &Number, parameter: usize) -> Parameter<f64> {
        match number {
            Number::Drawn(Scalar::Constant(value)) => Parameter::Shared(*value),
            Number::Drawn(scalar) => {
                let column = self.column(parameter);
                Parameter::PerBody(
                    parallel::rows(self.bodies.count, 1, &|body| scalar.sample(self.draw, body, column, 0)).into(),
                )
            }
            Number::Column(name) => {
                let rows = self.rows(name);
                Parameter::PerBody((0..self.bodies.count).map(|body| rows[self.bodies.row(body)]).collect())
            }
        }
    }

    pub(super) fn vector(&self, vector: &Triple, parameter: usize) -> Parameter<DVec3> {
        match vector {
            Triple::Drawn(Vector::Components([Scalar::Constant(x), Scalar::Constant(y), Scalar::Constant(z)])) => {
                Parameter::Shared(DVec3::new(*x, *y, *z))
            }
            Triple::Drawn(vector) => {
                let column = self.column(parameter);
                Parameter::PerBody(
                    parallel::rows(self.bodies.count, 1, &|body| vector.sample(self.draw, body, column)).into(),
                )
            }
            Triple::Columns(names) => {
                let [x, y, z] = names.each_ref().map(|name| self.rows(name));
                let rows = (0..self.bodies.count).map(|body| self.bodies.row(body));
                Parameter::PerBody(rows.map(|row| DVec3::new(x[row], y[row], z[row])).collect())
            }
        }
    }

    pub(super) fn rotation(&self, rotation: &Turn, parameter: usize) -> Parameter<DQuat> {
        match rotation {
            Turn::Drawn(Orientation::Constant(orientation)) => Parameter::Shared(*orientation),
            Turn::Drawn(orientation) => {
                let column = self.column(parameter);
                Parameter::PerBody(
                    parallel::rows(self.bodies.count, 1, &|body| orientation.sample_as(self.draw, body, column)).into(),
                )
            }
            Turn::Columns(names) => {
                let columns = names.each_ref().map(|name| self.rows(name));
                let rows = (0..self.bodies.count).map(|body| self.bodies.row(body));
                Parameter::PerBody(rows.map(|row| DQuat::from_array(columns.map(|rows| rows[row]))).collect())
            }
        }
    }

    /// A tensor described as a body's own inertia is, with the same draws, comes from the same numbers, so that a body that is
    /// large before a change is large after it.
    pub(super) fn tensor(&self, tensor: &Tensor, parameter: usize) -> Parameter<InertiaTensor> {
        match tensor {
            Tensor::Moments(moments) => match self.vector(moments, parameter) {
                Parameter::Shared(moments) => Parameter::Shared(moments.into()),
                Parameter::PerBody(column) => {
                    Parameter::PerBody(column.iter().map(|&moments| InertiaTensor::from(moments)).collect())
                }
            },
            Tensor::Inertia(Inertia::Tensor(tensor)) => Parameter::Shared(*tensor),
            Tensor::Inertia(inertia) => {
                Parameter::PerBody(parallel::rows(self.bodies.count, 1, &|body| inertia.sample(self.draw, body)).into())
            }
        }
    }

    fn column(&self, parameter: usize) -> Column {
        match self.of {
            Owner::Torque(torque) => Column::Torque { torque: torque as u16, parameter: parameter as u16 },
            Owner::Orbit => Column::Orbit { parameter: parameter as u16 },
            Owner::Force(force) => Column::Force { force: force as u16, parameter: parameter as u16 },
        }
    }

    /// The rows of a column; the table was read with all columns that torques name.
    fn rows(&self, name: &str) -> &[f64] {
        self.bodies.table.as_ref().and_then(|table| table.extra(name)).unwrap_or_default()
    }
}

impl Number {
    /// Adds the name of the column that it is read from, if it is.
    pub(super) fn columns(&self, names: &mut BTreeSet<String>) {
        if let Number::Column(name) = self {
            names.insert(name.clone());
        }
    }
}

impl Triple {
    /// Adds the names of the columns that it is read from, if it is.
    pub(super) fn columns(&self, names: &mut BTreeSet<String>) {
        if let Triple::Columns(columns) = self {
            names.extend(columns.iter().cloned());
        }
    }
}
