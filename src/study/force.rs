//! The forces of a study: the table `[force]`, or the list `[[force]]`.

use super::reader::{Node, Table};
use crate::error::Result;
use crate::force::Force;

/// The names of the models.
const MODELS: &[&str] = &["constant", "gravity", "linear-drag", "quadratic-drag", "thrust"];

/// What a force's parameter has to be.
const FORCE_WORLD: &str = "three finite components in world axes are needed (N)";
const FORCE_BODY: &str = "three finite components in body axes are needed (N)";
const ACCELERATION: &str = "three finite components in world axes are needed (m/s²)";
const LINEAR: &str = "a finite number that is not negative is needed (N s/m)";
const QUADRATIC: &str = "a finite number that is not negative is needed (N s²/m²)";

/// Reads the table or the list.
pub(super) fn read(node: &Node<'_>) -> Result<Vec<Force>> {
    let Some(elements) = node.elements() else { return of_table(node) };
    elements
        .into_iter()
        .enumerate()
        .map(|(index, mut element)| {
            element.path = format!("force[{}]", index + 1);
            let table = element.any_table().ok_or_else(|| element.refuse("tables [[force]] are needed"))?;
            of_list(&table)
        })
        .collect()
}

/// The table, whose keys are the forces.
fn of_table(node: &Node<'_>) -> Result<Vec<Force>> {
    let table =
        node.table("a table [force] or tables [[force]] are needed", &["constant", "gravity", "linear_drag"])?;
    let mut forces = Vec::new();
    if let Some(constant) = table.find("constant") {
        forces.push(Force::constant(constant.vector(FORCE_WORLD)?));
    }
    if let Some(gravity) = table.find("gravity") {
        forces.push(Force::gravity(gravity.vector(ACCELERATION)?));
    }
    if let Some(drag) = table.find("linear_drag") {
        forces.push(Force::linear_drag(coefficient(&drag, LINEAR)?));
    }
    if forces.is_empty() {
        table.need("constant", "a vector in world axes is needed (N), or `gravity` or `linear_drag`")?;
    }
    Ok(forces)
}

/// One force of the list.
fn of_list(table: &Table<'_>) -> Result<Force> {
    match table.need("model", "the name of a force's model is needed")?.choice(MODELS)? {
        "constant" => {
            table.only(&["model", "force"])?;
            Ok(Force::constant(table.need("force", FORCE_WORLD)?.vector(FORCE_WORLD)?))
        }
        "gravity" => {
            table.only(&["model", "acceleration"])?;
            Ok(Force::gravity(table.need("acceleration", ACCELERATION)?.vector(ACCELERATION)?))
        }
        "linear-drag" => {
            table.only(&["model", "coefficient"])?;
            Ok(Force::linear_drag(coefficient(&table.need("coefficient", LINEAR)?, LINEAR)?))
        }
        "quadratic-drag" => {
            table.only(&["model", "coefficient"])?;
            Ok(Force::quadratic_drag(coefficient(&table.need("coefficient", QUADRATIC)?, QUADRATIC)?))
        }
        _ => {
            table.only(&["model", "force"])?;
            Ok(Force::thrust(table.need("force", FORCE_BODY)?.vector(FORCE_BODY)?))
        }
    }
}

/// A coefficient of drag.
fn coefficient(node: &Node<'_>, expected: &'static str) -> Result<f64> {
    let coefficient = node.number(expected)?;
    if coefficient < 0.0 { Err(node.refuse(expected)) } else { Ok(coefficient) }
}
