//! The initial data of bodies: `initial.<format>`, one row per body, and `cells.<format>`, one row per cell of a sweep.

use crate::bodies::inertia::{InertiaTensor, principal_axes};
use crate::error::Result;
use crate::record::folder::OutputFolder;
use crate::record::table_file::{self, TableColumn};
use crate::scene::Scene;
use crate::study::{Design, Format, Study};
use crate::torque::{Parameter, Value};

/// Writes `initial`: body, its cell, name and carried columns; inertia tensor (body axes, kg m²), principal moments (kg m²) and axes
/// (quaternion, principal to body); mass (kg) of bodies that translate; orientation, angular velocity, position and velocity at t = 0;
/// and every parameter of a torque or force that bodies do not share.
pub(super) fn write_initial(
    folder: &mut OutputFolder,
    format: Format,
    study: Option<&Study>,
    scene: &Scene,
) -> Result<()> {
    let (ensemble, first_body) = (scene.ensemble(), scene.part().first_body);
    let mut columns = vec![TableColumn::whole("body", move |body| (first_body + body) as u64)];
    if let Some(design) = study.and_then(Study::design) {
        columns.push(TableColumn::whole("cell", |body| design.cell_of(first_body + body) as u64));
    }
    let bodies = study.map(Study::bodies);
    if let Some((bodies, table)) = bodies.and_then(|bodies| Some((bodies, bodies.table.as_ref()?))) {
        for (index, name) in table.carried().enumerate() {
            columns.push(TableColumn::text(name, move |body| table.carried_text(index, bodies.row(body))));
        }
    }
    let unsigned = |tensor: InertiaTensor| tensor.to_array().map(|element| element + NO_SIGN);
    columns.extend(components("", TENSOR, move |body| unsigned(ensemble.inertia()[body])));
    let axes = move |body: usize| principal_axes(&ensemble.inertia()[body]);
    columns.extend(components("", ["i1", "i2", "i3"], move |body| axes(body).moments.to_array()));
    columns.extend(components("", ["ax", "ay", "az", "aw"], move |body| axes(body).principal_to_body.to_array()));
    columns.extend(components("", ["qx", "qy", "qz", "qw"], |body| ensemble.orientation()[body].to_array()));
    columns.extend(components("", ["wx", "wy", "wz"], |body| ensemble.angular_velocity_body()[body].to_array()));
    if let Some(translation) = ensemble.translation() {
        columns.push(TableColumn::number("mass", |body| translation.mass[body]));
        columns.extend(components("", ["x", "y", "z"], |body| translation.position[body].to_array()));
        columns.extend(components("", ["vx", "vy", "vz"], |body| translation.velocity[body].to_array()));
    }
    for (index, torque) in scene.torques().iter().enumerate() {
        for parameter in torque.declaration().parameters_of_study() {
            if let Some(value) = torque.parameter(&parameter.name) {
                push_value(&mut columns, &format!("torque[{}].{}", index + 1, parameter.name), value);
            }
        }
    }
    for (index, force) in scene.forces().iter().enumerate() {
        for (name, value) in force.parameters() {
            push_value(&mut columns, &format!("force[{}].{name}", index + 1), &value);
        }
    }
    table_file::write(folder, "initial", format, ensemble.len(), &columns)
}

/// Writes `cells`: the cell, its number of bodies, and the value of each axis (SI units).
pub(super) fn write_cells(folder: &mut OutputFolder, format: Format, design: &Design, body_count: usize) -> Result<()> {
    let cells = design.cells();
    let bodies = |cell: usize| (body_count / cells + usize::from(cell < body_count % cells)) as u64;
    let mut columns = vec![TableColumn::whole("cell", |cell| cell as u64), TableColumn::whole("bodies", bodies)];
    columns.extend(design.axes().iter().map(|axis| TableColumn::number(axis.name(), |cell| axis.value(cell))));
    table_file::write(folder, "cells", format, cells, &columns)
}

/// The least number of numbers in a row of `initial`.
pub(super) const LEAST_NUMBERS: u64 = 20;

/// Adding it makes a negative zero positive and leaves other numbers unchanged.
const NO_SIGN: f64 = 0.0;

const TENSOR: [&str; 6] = ["ixx", "iyy", "izz", "ixy", "ixz", "iyz"];

/// A column for each component of a value, by body; `start` is what their names begin with.
fn components<'a, const N: usize>(
    start: &str,
    names: [&str; N],
    value: impl Fn(usize) -> [f64; N] + Clone + Sync + 'a,
) -> [TableColumn<'a>; N] {
    std::array::from_fn(|place| {
        let value = value.clone();
        TableColumn::number(format!("{start}{}", names[place]), move |body| value(body)[place])
    })
}

/// The columns of a value that bodies do not share: one for a number, else one for each component.
fn push_value(columns: &mut Vec<TableColumn<'_>>, name: &str, value: &Value) {
    let start = format!("{name}.");
    // A cloned column shares its data.
    match value.clone() {
        Value::Number(Parameter::PerBody(column)) => columns.push(TableColumn::number(name, move |body| column[body])),
        Value::Vector(Parameter::PerBody(column)) => {
            columns.extend(components(&start, ["x", "y", "z"], move |body| column[body].to_array()));
        }
        Value::Rotation(Parameter::PerBody(column)) => {
            columns.extend(components(&start, ["x", "y", "z", "w"], move |body| column[body].to_array()));
        }
        Value::Tensor(Parameter::PerBody(column)) => {
            columns.extend(components(&start, TENSOR, move |body| column[body].to_array()));
        }
        // Matrices and lists of studies are the same for all bodies.
        _ => {}
    }
}
