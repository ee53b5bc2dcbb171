//! The forces of a study: the table `[force]`, or the list `[[force]]`.

use std::collections::BTreeSet;
use std::sync::LazyLock;

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

/// A model with one parameter: its name, the parameter's key in the list and what is expected there.
type Known = (&'static str, &'static str, &'static str, fn(&Node<'_>) -> Result<Model>);

static KNOWN: [Known; 5] = [
    ("constant", "force", "expected a vector in world axes (N)", |node| Triple::read(node, "N").map(Model::Constant)),
    ("gravity", "acceleration", "expected a vector in world axes (m/s²)", |node| {
        Triple::read(node, "m/s²").map(Model::Gravity)
    }),
    ("linear-drag", "coefficient", "expected the coefficient (N s/m)", |node| {
        Number::read(node, "N s/m").map(Model::LinearDrag)
    }),
    ("quadratic-drag", "coefficient", "expected the coefficient (N s²/m²)", |node| {
        Number::read(node, "N s²/m²").map(Model::QuadraticDrag)
    }),
    ("thrust", "force", "expected a vector in body axes (N)", |node| Triple::read(node, "N").map(Model::Thrust)),
];

/// The names of the models.
static NAMES: LazyLock<Vec<&'static str>> =
    LazyLock::new(|| KNOWN.iter().map(|known| known.0).chain([custom::NAME]).collect());

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
    // Of the first of the known models.
    const KEYS: [&str; 3] = ["constant", "gravity", "linear_drag"];
    let table = node.table("expected a table [force] or tables [[force]]", &KEYS)?;
    let mut models = Vec::new();
    for (key, (.., read)) in KEYS.into_iter().zip(&KNOWN) {
        if let Some(node) = table.find(key) {
            models.push((key, read(&node)?));
        }
    }
    if models.is_empty() {
        table.need("constant", "expected a vector in world axes (N), or `gravity` or `linear_drag`")?;
    }
    let force = |(index, (key, model))| StudyForce { model, index, place: "force".to_owned(), key };
    Ok(models.into_iter().enumerate().map(force).collect())
}

/// One force of the list, and the key of its parameter.
fn of_list(table: &Table<'_>) -> Result<(Model, &'static str)> {
    let name = table.need("model", "expected the name of a force's model")?.choice(&NAMES)?;
    let Some((_, key, expected, read)) = KNOWN.iter().find(|known| known.0 == name) else {
        let (force, parameters) = custom::read_force(table)?;
        return Ok((Model::Custom(force, parameters), ""));
    };
    table.only(&["model", key])?;
    Ok((read(&table.need(key, *expected)?)?, key))
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
