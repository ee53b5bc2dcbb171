//! Custom torques with a sampling time and a state: `every`, `delay`, `state`, `sample`, `d_h`, `next_b`.

use glam::DVec3;

use super::{formula, formula_at, parameters, refused, value};
use crate::error::Result;
use crate::expression::{Expression, Fault, Shape};
use crate::study::distribution::Vector;
use crate::study::parameter::Triple;
use crate::study::reader::{Node, Table};
use crate::study::torque::{StudyParameter, StudyValue};
use crate::torque::{ModelRef, SampledLaw};

/// Keys that only sampled torques have.
const OWN: [&str; 4] = ["every", "delay", "state", "sample"];
/// The prefix of a state's name in the key of its law.
const RATE: &str = "d_";
const NEXT: &str = "next_";

/// The torque and its parameters; `None` if nothing in it is sampled.
pub(super) fn read(table: &Table<'_>) -> Result<Option<(ModelRef, Vec<StudyParameter>)>> {
    let is_law = |key: &str| key.starts_with(RATE) || key.starts_with(NEXT);
    let laws: Vec<(String, Node<'_>)> = table.nodes().into_iter().filter(|(key, _)| is_law(key)).collect();
    if laws.is_empty() && OWN.iter().all(|key| table.find(key).is_none()) {
        return Ok(None);
    }
    let known = ["model", "parameters", "torque"].into_iter().chain(OWN).chain(laws.iter().map(|(key, _)| &**key));
    table.only(&known.collect::<Vec<_>>())?;
    let every = table.need("every", "expected the sampling period (s), which own state and sampled values need")?;
    let every_s = every.positive_quantity("s", "expected a period above zero (s)")?;
    let delay_s = match table.find("delay") {
        Some(node) => not_negative(&node)?,
        None => 0.0,
    };
    let (own, mut values) = parameters(table)?;
    let refuse = |node: &Node<'_>, fault: Fault| refused(node, &fault);
    let mut law = SampledLaw::new(own, every_s, delay_s).map_err(|fault| refuse(&every, fault))?;
    values.push(StudyParameter::of_number("every", every_s));
    values.push(StudyParameter::of_number("delay", delay_s));
    let mut names = Vec::new();
    for (name, node) in entries(table, "state", "expected a table of names and what they start as")? {
        let initial = value(&node)?;
        law = match initial {
            StudyValue::Number(_) => law.number(&name, 0.0),
            StudyValue::Vector(_) => law.vector(&name, DVec3::ZERO),
            _ => return Err(node.refuse("expected a number or a vector")),
        }
        .map_err(|fault| refuse(&node, fault))?;
        values.push(StudyParameter::new(format!("state.{name}"), initial));
        names.push((name, node));
    }
    let samples = entries(table, "sample", "expected a table of names and formulas, which are evaluated at samples")?;
    for (name, node) in samples {
        let formula = of_either_shape(&node, &law)?;
        values.push(zero(&format!("sample.{name}"), formula.shape()));
        law = law.sampled(&name, formula).map_err(|fault| refuse(&node, fault))?;
    }
    for (key, node) in &laws {
        let (name, is_rate) = match key.strip_prefix(RATE) {
            Some(name) => (name, true),
            None => (key.strip_prefix(NEXT).unwrap_or(key), false),
        };
        let shape = law.shape_of(name).map_err(|fault| match fault {
            Fault::UnknownName { .. } => node.refuse(format!("expected `{name}` in the table `state`")),
            fault => refuse(node, fault),
        })?;
        let formula = formula(node, law.symbols_of_laws(), shape)?;
        law = if is_rate { law.with_rate(name, formula) } else { law.with_next(name, formula) }
            .map_err(|fault| refuse(node, fault))?;
    }
    // A state without a law is reported where it is declared.
    if let Some((name, node)) = names.iter().find(|(name, _)| law.shape_of(name).is_ok()) {
        return Err(refuse(node, Fault::StateLaw { name: name.clone() }));
    }
    let node = table.need("torque", "expected a formula of a vector in body axes (N m)")?;
    let law = law.with_rates().map_err(|fault| refuse(&node, fault))?;
    let torque = formula(&node, law.symbols(), Shape::Vector)?;
    let (model, of_model) = law.model(torque, None).map_err(|fault| refuse(&node, fault))?;
    // Rates and the time of the last change start as zeros.
    let rest = model.declaration().parameters.iter().zip(&of_model).skip(values.len());
    values.extend(rest.map(|(declared, value)| {
        let shape = if value.as_vector().is_some() { Shape::Vector } else { Shape::Number };
        zero(&declared.name, shape)
    }));
    Ok(Some((model, values)))
}

/// A time that is not negative, s.
fn not_negative(node: &Node<'_>) -> Result<f64> {
    const EXPECTED: &str = "expected a delay that is not negative (s)";
    let delay = node.quantity("s", EXPECTED)?;
    if delay >= 0.0 { Ok(delay) } else { Err(node.refuse(EXPECTED)) }
}

/// The entries of a table, if it exists.
fn entries<'a>(table: &Table<'a>, key: &str, expected: &'static str) -> Result<Vec<(String, Node<'a>)>> {
    let Some(node) = table.find(key) else { return Ok(Vec::new()) };
    Ok(node.any_table().ok_or_else(|| node.refuse(expected))?.nodes())
}

/// A vector formula or, if the text is not one, a number formula.
fn of_either_shape(node: &Node<'_>, law: &SampledLaw) -> Result<Expression> {
    let text = node.string("expected a formula, as text")?;
    let parsed = |shape| Expression::parse(text, law.symbols_at_samples(), shape);
    parsed(Shape::Vector).or_else(|error| parsed(Shape::Number).map_err(|_| formula_at(node, &error)))
}

fn zero(key: &str, shape: Shape) -> StudyParameter {
    match shape {
        Shape::Vector => {
            StudyParameter::new(key.to_owned(), StudyValue::Vector(Triple::Drawn(Vector::constant(DVec3::ZERO))))
        }
        _ => StudyParameter::of_number(key, 0.0),
    }
}
