//! `model = "custom"` in study files: a torque, moments of inertia that change, or a force, given by a formula.

use super::distribution::Orientation;
use super::euler::EULER;
use super::parameter::{Number, Triple, Turn};
use super::reader::{Node, Table};
use super::torque::{StudyParameter, StudyValue};
use super::unit::ANY;
use crate::error::InputFault;
use crate::error::Result;
use crate::expression::vocabulary::{ORBIT_POSITION, ORBIT_VELOCITY};
use crate::expression::{self, Expression, Shape, Symbols, TextError};
use crate::torque::custom::ExpressionModel;
use crate::torque::custom_inertia::{self, InertiaFormulaModel};
use crate::torque::force::{CustomForce, custom};
use crate::torque::{ModelRef, Orbit, Parameters};

mod sampled;

/// The name of the model.
pub(super) const NAME: &str = "custom";

/// A torque, or moments that change, and its parameters.
pub(super) fn read(table: &Table<'_>) -> Result<(ModelRef, Vec<StudyParameter>)> {
    if let Some(read) = sampled::read(table)? {
        return Ok(read);
    }
    table.only(&["model", "parameters", "torque", "energy", "moments", "factor"])?;
    let (parameters, values) = parameters(table)?;
    for (key, shape) in [("moments", Shape::Vector), ("factor", Shape::Number)] {
        let Some(node) = table.find(key) else { continue };
        for other in ["torque", "energy", "factor"].into_iter().filter(|other| *other != key) {
            table.exclusive(key, other)?;
        }
        let refused = |fault| refused(&node, &fault);
        let symbols = custom_inertia::symbols(&parameters).map_err(refused)?;
        let formula = formula(&node, &symbols, shape)?;
        return Ok((InertiaFormulaModel::of_user(formula, &parameters).map_err(refused)?, values));
    }
    let node = table.need(
        "torque",
        "expected a formula of a vector in body axes (N m); or `moments` (kg m²) or `factor`, by which moments of inertia change",
    )?;
    let torque = formula(&node, parameters.symbols(), Shape::Vector)?;
    let energy = match table.find("energy") {
        Some(node) => Some(formula(&node, parameters.energy_symbols(), Shape::Number)?),
        None => None,
    };
    let model = ExpressionModel::of_user(torque, energy, &parameters).map_err(|fault| refused(&node, &fault))?;
    Ok((model, values))
}

/// A force without values of its parameters, and the distributions of these.
pub(super) fn read_force(table: &Table<'_>) -> Result<(CustomForce, Vec<StudyParameter>)> {
    table.only(&["model", "parameters", "force"])?;
    let (parameters, values) = parameters(table)?;
    let node = table.need("force", "expected a formula of a vector in world axes (N)")?;
    let symbols = custom::symbols(&parameters).map_err(|fault| refused(&node, &fault))?;
    let force = formula(&node, &symbols, Shape::Vector)?;
    Ok((CustomForce::new(force, parameters), values))
}

fn parameters(table: &Table<'_>) -> Result<(Parameters, Vec<StudyParameter>)> {
    let mut parameters = Parameters::new();
    let mut values = Vec::new();
    if let Some(node) = table.find("parameters") {
        let named = node.any_table().ok_or_else(|| node.refuse("expected a table of names and values"))?;
        for (name, node) in named.nodes() {
            let value = value(&node)?;
            let shape = match value {
                StudyValue::Vector(_) => Shape::Vector,
                StudyValue::Rotation(_) => Shape::Quaternion,
                _ => Shape::Number,
            };
            parameters = parameters.declared(&name, shape).map_err(|fault| refused(&node, &fault))?;
            values.push(StudyParameter::new(format!("parameters.{name}"), value));
        }
    }
    if let Some(node) = mentions_orbit(table) {
        parameters = with_orbit(parameters, &mut values, &node)?;
    }
    Ok((parameters, values))
}

/// Parameters with the study's orbit, which the formula of `node` reads, and its elements after the other values.
pub(super) fn with_orbit(
    parameters: Parameters,
    values: &mut Vec<StudyParameter>,
    node: &Node<'_>,
) -> Result<Parameters> {
    let orbit = orbit_of_study(node)?;
    // The values are drawn later; only which of them may be zero matters here.
    let (is_eccentric, drifts) = form(orbit);
    let part = |may_be: bool| if may_be { 0.5 } else { 0.0 };
    let of_form = Orbit::kepler(1.0, 1.0, part(is_eccentric)).with_j2(part(drifts), 1.0);
    values.extend(orbit.iter().map(|(_, element)| element.clone()));
    parameters.orbit(of_form).map_err(|fault| refused(node, &fault))
}

/// The first formula of a torque that reads the place or the velocity on the orbit.
fn mentions_orbit<'a>(table: &Table<'a>) -> Option<Node<'a>> {
    let is_formula = |key: &str| key == "torque" || key.starts_with("d_") || key.starts_with("next_");
    let samples = table.find("sample").and_then(|node| node.any_table());
    let of_samples = samples.iter().flat_map(|samples| samples.nodes()).map(|(_, node)| node);
    let own = table.nodes().into_iter().filter(|(key, _)| is_formula(key)).map(|(_, node)| node);
    let mut formulas = own.chain(of_samples);
    formulas.find(|node| node.string("").is_ok_and(reads_orbit))
}

/// Whether a formula reads the place or the velocity on the orbit.
pub(super) fn reads_orbit(text: &str) -> bool {
    [ORBIT_POSITION, ORBIT_VELOCITY].iter().any(|name| text.contains(name))
}

/// The study's orbit for a formula that reads it.
pub(super) fn orbit_of_study<'a>(node: &Node<'a>) -> Result<&'a [(String, StudyParameter)]> {
    const MISSING: &str = "orbit_position and orbit_velocity are those on the orbit of the study: expected a table [orbit] with mu and radius";
    let orbit = node.context().orbit().ok_or_else(|| node.refuse(MISSING))?;
    node.context().note_orbit_use();
    Ok(orbit)
}

/// Whether the study's orbit may be eccentric, and whether it may drift.
pub(super) fn form(orbit: &[(String, StudyParameter)]) -> (bool, bool) {
    let is_stated = |name: &str| orbit.iter().any(|(own, element)| own == name && element.is_stated());
    (is_stated("orbit.eccentricity"), is_stated("orbit.j2"))
}

fn refused(node: &Node<'_>, fault: &expression::Fault) -> crate::Error {
    node.fault(InputFault::Syntax { reason: fault.to_string() })
}

fn formula(node: &Node<'_>, symbols: &Symbols, shape: Shape) -> Result<Expression> {
    let text = node.string("expected a formula, as text")?;
    Expression::parse(text, symbols, shape).map_err(|error| formula_at(node, &error))
}

/// The refusal of a formula, at the line of the fault.
pub(super) fn formula_at(node: &Node<'_>, error: &TextError) -> crate::Error {
    let (reason, picture) = (error.fault.to_string(), error.picture());
    node.fault_in_text(error.line, error.column, |column| InputFault::Formula { column, reason, picture })
}

/// A number, a vector or a rotation, depending on the value.
fn value(node: &Node<'_>) -> Result<StudyValue> {
    const EXPECTED: &str = "expected a number, a vector, a rotation, a distribution or columns of the table of bodies";
    if node.is_number() {
        return Ok(StudyValue::Number(Number::read(node, ANY)?));
    }
    if let Some(elements) = node.elements() {
        return match elements.len() {
            3 => Ok(StudyValue::Vector(Triple::read(node, ANY)?)),
            4 => Ok(StudyValue::Rotation(Turn::Drawn(Orientation::read(node)?))),
            _ => Err(node.refuse(EXPECTED)),
        };
    }
    let table = node.any_table().ok_or_else(|| node.refuse(EXPECTED))?;
    if table.find("distribution").is_none()
        && let Some(columns) = table.find("columns")
    {
        return match columns.elements().map(|columns| columns.len()) {
            Some(4) => Ok(StudyValue::Rotation(Turn::read(node)?)),
            _ => Ok(StudyValue::Vector(Triple::read(node, ANY)?)),
        };
    }
    if table.find("distribution").is_none() && ["axis", "angle", EULER].iter().any(|key| table.find(key).is_some()) {
        return Ok(StudyValue::Rotation(Turn::read(node)?));
    }
    let name = table.find("distribution").and_then(|name| name.string("").ok()).unwrap_or_default();
    let has = |keys: &[&str]| keys.iter().any(|key| table.find(key).is_some());
    let has_list = |keys: &[&str]| keys.iter().any(|key| table.find(key).is_some_and(|node| node.elements().is_some()));
    match name {
        // The parts all have one shape.
        "mixture" => {
            let parts = table.find("of").and_then(|of| of.elements()).unwrap_or_default();
            return match parts.first().map(value).transpose()? {
                Some(StudyValue::Vector(_)) => Ok(StudyValue::Vector(Triple::read(node, ANY)?)),
                Some(StudyValue::Rotation(_)) => Ok(StudyValue::Rotation(Turn::read(node)?)),
                _ => Ok(StudyValue::Number(Number::read(node, ANY)?)),
            };
        }
        "rows" => {
            return match table.find("columns").and_then(|columns| columns.elements()).map(|columns| columns.len()) {
                Some(4) => Ok(StudyValue::Rotation(Turn::read(node)?)),
                Some(_) => Ok(StudyValue::Vector(Triple::read(node, ANY)?)),
                None => Ok(StudyValue::Number(Number::read(node, ANY)?)),
            };
        }
        "direction" | "von-mises-fisher" | "cone" => return Ok(StudyValue::Vector(Triple::read(node, ANY)?)),
        "scatter" => return Ok(StudyValue::Rotation(Turn::read(node)?)),
        "uniform" if !has(&["low", "high"]) => return Ok(StudyValue::Rotation(Turn::read(node)?)),
        _ => {}
    }
    if has_list(&["low", "high", "mean", "median", "mode", "sigma", "value"]) {
        return Ok(StudyValue::Vector(Triple::read(node, ANY)?));
    }
    Ok(StudyValue::Number(Number::read(node, ANY)?))
}
