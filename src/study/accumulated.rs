//! Quantities that add up over time: `integral` and `sign_changes` of a `[[quantity]]`.

use super::custom::{formula_at, reads_orbit, with_orbit};
use super::observed::tables;
use super::reader::{Node, Table};
use super::torque::{StudyParameter, StudyTorque};
use crate::error::Result;
use crate::torque::control::Accumulation;
use crate::torque::{Parameter, Parameters, Value};

/// The keys, with what they mean.
pub(super) const KINDS: [(&str, Accumulation); 2] =
    [("integral", Accumulation::Integral), ("sign_changes", Accumulation::SignChanges)];

/// What adds up in a table `[[quantity]]`, with its formula; `None` if nothing does.
pub(super) fn kind<'a>(table: &Table<'a>) -> Option<(Accumulation, Node<'a>)> {
    KINDS.iter().find_map(|&(key, accumulation)| Some((accumulation, table.find(key)?)))
}

/// The time between two evaluations of the formula, s.
pub(super) fn every(table: &Table<'_>) -> Result<f64> {
    const EXPECTED: &str = "expected the time between two evaluations of the formula (s), above zero";
    table.need("every", EXPECTED)?.positive_quantity("s", EXPECTED)
}

/// The place in the file of a quantity of the list.
pub(super) fn path(place: usize) -> String {
    format!("quantity[{}]", place + 1)
}

/// Whether anything asks for the quantity of a table `[[quantity]]`: what adds up for nobody would only make steps shorter.
fn is_wanted(root: &Table<'_>, table: &Table<'_>) -> bool {
    let Some(name) = table.find("name") else { return false };
    let is_name = |node: &Node<'_>| node.string("").is_ok_and(|text| name.string("").is_ok_and(|name| name == text));
    let output = root.find("output").and_then(|node| node.any_table());
    let lists = ["statistics", "columns"].iter().filter_map(|key| output.as_ref()?.find(key)?.elements()).flatten();
    let of_tables = ["histogram", "event"].iter().filter_map(|key| tables(root, key).ok()).flatten();
    lists.chain(of_tables.filter_map(|table| table.find("quantity"))).any(|node| is_name(&node))
}

/// The laws by which the quantities of a study add up that are asked for, in their order; they follow its `torques` torques.
pub(super) fn read(root: &Table<'_>, torques: usize) -> Result<Vec<StudyTorque>> {
    let mut found = Vec::new();
    for (place, table) in tables(root, "quantity")?.into_iter().enumerate() {
        let Some((accumulation, node)) = kind(&table).filter(|_| is_wanted(root, &table)) else { continue };
        let text = node.string("expected a formula, as text")?;
        let (mut parameters, mut values) = (Parameters::new(), Vec::new());
        if reads_orbit(text) {
            parameters = with_orbit(parameters, &mut values, &node)?;
        }
        let every = every(&table)?;
        let (model, of_model) =
            accumulation.model(parameters, text, every).map_err(|error| formula_at(&node, &error))?;
        // Those of the law itself are numbers.
        let rest = model.declaration().parameters.iter().zip(&of_model).skip(values.len());
        let number = |value: &Value| match value {
            Value::Number(Parameter::Shared(number)) => *number,
            _ => 0.0,
        };
        values.extend(rest.map(|(declared, value)| StudyParameter::of_number(&declared.name, number(value))));
        found.push(StudyTorque::of_quantity(model, values, torques + found.len(), path(place)));
    }
    Ok(found)
}
