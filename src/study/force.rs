//! The forces of a study: the table `[force]`, or the list `[[force]]`.

use std::collections::BTreeSet;

use super::bodies::Bodies;
use super::custom;
use super::draw::Draw;
use super::parameter::{Number, Owner, Source, Triple};
use super::reader::{Node, Table};
use super::torque::StudyParameter;
use crate::error::Result;
use crate::torque::force::{CustomForce, Force};

/// A force of a study, with parameters not yet drawn.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct StudyForce {
    model: Model,
    /// Index among the study's forces, from 0; enters the draws.
    index: usize,
    /// Its place in the file.
    place: String,
    /// The key of its parameter there; empty if it may have several.
    key: &'static str,
}

/// The model that was read.
#[derive(Clone, Debug, PartialEq)]
enum Model {
    Constant(Triple),
    Gravity(Triple),
    LinearDrag(Number),
    QuadraticDrag(Number),
    Thrust(Triple),
    Custom(CustomForce, Vec<StudyParameter>),
}

/// The names of the models.
const MODELS: &[&str] = &["constant", "gravity", "linear-drag", "quadratic-drag", "thrust", custom::NAME];

/// Reads the table or the list.
pub(super) fn read(node: &Node<'_>) -> Result<Vec<StudyForce>> {
    let Some(elements) = node.elements() else { return of_table(node) };
    elements
        .into_iter()
        .enumerate()
        .map(|(index, mut element)| {
            let place = format!("force[{}]", index + 1);
            element.path.clone_from(&place);
            let table = element.any_table().ok_or_else(|| element.refuse("expected tables [[force]]"))?;
            let (model, key) = of_list(&table)?;
            Ok(StudyForce { model, index, place, key })
        })
        .collect()
}

/// The forces of the table, whose keys are their names.
fn of_table(node: &Node<'_>) -> Result<Vec<StudyForce>> {
    let table = node.table("expected a table [force] or tables [[force]]", &["constant", "gravity", "linear_drag"])?;
    let mut models = Vec::new();
    if let Some(constant) = table.find("constant") {
        models.push(("constant", Model::Constant(Triple::read(&constant, "N")?)));
    }
    if let Some(gravity) = table.find("gravity") {
        models.push(("gravity", Model::Gravity(Triple::read(&gravity, "m/s²")?)));
    }
    if let Some(drag) = table.find("linear_drag") {
        models.push(("linear_drag", Model::LinearDrag(Number::read(&drag, "N s/m")?)));
    }
    if models.is_empty() {
        table.need("constant", "expected a vector in world axes (N), or `gravity` or `linear_drag`")?;
    }
    let force = |(index, (key, model))| StudyForce { model, index, place: "force".to_owned(), key };
    Ok(models.into_iter().enumerate().map(force).collect())
}

/// One force of the list, and the key of its parameter.
fn of_list(table: &Table<'_>) -> Result<(Model, &'static str)> {
    const WORLD: &str = "expected a vector in world axes (N)";
    let parameter = |known: &'static [&'static str], expected| {
        table.only(known)?;
        table.need(known[1], expected).map(|node| (node, known[1]))
    };
    Ok(match table.need("model", "expected the name of a force's model")?.choice(MODELS)? {
        "constant" => {
            let (node, key) = parameter(&["model", "force"], WORLD)?;
            (Model::Constant(Triple::read(&node, "N")?), key)
        }
        "gravity" => {
            let (node, key) = parameter(&["model", "acceleration"], "expected a vector in world axes (m/s²)")?;
            (Model::Gravity(Triple::read(&node, "m/s²")?), key)
        }
        "linear-drag" => {
            let (node, key) = parameter(&["model", "coefficient"], "expected the coefficient (N s/m)")?;
            (Model::LinearDrag(Number::read(&node, "N s/m")?), key)
        }
        "quadratic-drag" => {
            let (node, key) = parameter(&["model", "coefficient"], "expected the coefficient (N s²/m²)")?;
            (Model::QuadraticDrag(Number::read(&node, "N s²/m²")?), key)
        }
        "thrust" => {
            let (node, key) = parameter(&["model", "force"], "expected a vector in body axes (N)")?;
            (Model::Thrust(Triple::read(&node, "N")?), key)
        }
        _ => {
            let (force, parameters) = custom::read_force(table)?;
            (Model::Custom(force, parameters), "")
        }
    })
}

impl StudyForce {
    /// Adds the names of the columns of the table of bodies that the force reads.
    pub(super) fn columns(&self, names: &mut BTreeSet<String>) {
        match &self.model {
            Model::Constant(vector) | Model::Gravity(vector) | Model::Thrust(vector) => vector.columns(names),
            Model::LinearDrag(number) | Model::QuadraticDrag(number) => number.columns(names),
            Model::Custom(_, parameters) => parameters.iter().for_each(|parameter| parameter.columns(names)),
        }
    }

    /// The force with its parameters drawn.
    pub(super) fn force(&self, draw: Draw, seed: u64, bodies: &Bodies) -> Force {
        let source = Source::of(bodies, draw, Owner::Force(self.index));
        match &self.model {
            Model::Constant(force) => Force::constant(source.vector(force, 0)),
            Model::Gravity(acceleration) => Force::gravity(source.vector(acceleration, 0)),
            Model::LinearDrag(coefficient) => Force::linear_drag(source.number(coefficient, 0)),
            Model::QuadraticDrag(coefficient) => Force::quadratic_drag(source.number(coefficient, 0)),
            Model::Thrust(force) => Force::thrust(source.vector(force, 0)),
            Model::Custom(force, parameters) => {
                let declared = force.declarations().iter().zip(parameters);
                let values = declared.map(|(declared, parameter)| parameter.drawn(&source, declared, seed));
                Force::Custom(force.with_values(values.collect()))
            }
        }
    }

    /// The keys in the file for a parameter or, failing that, for the force itself.
    pub(super) fn keys(&self, parameter: &str) -> [String; 2] {
        let key = match &self.model {
            Model::Custom(..) => format!("{}.parameters.{parameter}", self.place),
            _ => format!("{}.{}", self.place, self.key),
        };
        [key, self.place.clone()]
    }
}
