//! `[[torque]]` in study files: one reader for all models, driven by their declarations.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use glam::{DMat3, DVec3};

use super::bodies::Bodies;
use super::custom;
use super::distribution::{Scalar, Vector};
use super::draw::Draw;
use super::orbit;
use super::parameter::{Number, Owner, Source, Tensor, Triple, Turn};
use super::reader::{Node, Table};
use crate::error::{Result, Text};
use crate::torque::Model;
use crate::torque::control::{self, OwnPart, is_accumulation};
use crate::torque::declaration::in_brackets;
use crate::torque::registry::MODELS;
use crate::torque::{ModelRef, ParameterDeclaration, Preset, Shape, Torque, ValidationContext, Validity, Value};

/// A torque of a study, with parameters not yet drawn.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct StudyTorque {
    model: ModelRef,
    /// In the order of the model's parameters.
    parameters: Vec<StudyParameter>,
    /// Index among the study's torques, from 0; enters the draws.
    index: usize,
    /// Its place in the file.
    path: String,
}

/// A parameter that is not yet drawn.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct StudyParameter {
    /// Its key in the file.
    key: String,
    value: StudyValue,
    /// Whether it belongs to the table `[orbit]`, whose draws all torques share.
    is_of_orbit: bool,
    /// Whether the study states it.
    is_stated: bool,
}

impl StudyParameter {
    pub(super) fn new(key: String, value: StudyValue) -> Self {
        Self { key, value, is_of_orbit: false, is_stated: false }
    }

    /// One number for all bodies.
    pub(super) fn of_number(key: &str, number: f64) -> Self {
        Self::new(key.to_owned(), StudyValue::Number(Number::Drawn(Scalar::Constant(number))))
    }

    /// Whether the study states it, so that it may have another value than its default.
    pub(super) fn is_stated(&self) -> bool {
        self.is_stated
    }

    /// Its value, if it is one number for all bodies.
    pub(super) fn constant(&self) -> Option<f64> {
        match self.value {
            StudyValue::Number(Number::Drawn(Scalar::Constant(value))) => Some(value),
            _ => None,
        }
    }

    /// Adds the names of the columns of the table of bodies that it reads.
    pub(super) fn columns(&self, names: &mut BTreeSet<String>) {
        match &self.value {
            StudyValue::Number(number) => number.columns(names),
            StudyValue::Vector(vector) | StudyValue::Tensor(Tensor::Moments(vector)) => vector.columns(names),
            StudyValue::Rotation(Turn::Columns(columns)) => names.extend(columns.iter().cloned()),
            _ => {}
        }
    }

    /// Its value for all bodies.
    pub(super) fn drawn(&self, source: &Source<'_>, declared: &ParameterDeclaration, seed: u64) -> Value {
        match self.is_of_orbit {
            true => self.value.drawn(&source.of_orbit(), declared, seed),
            false => self.value.drawn(source, declared, seed),
        }
    }
}

// A scene has few of these, so that the unused space in the smaller variants does not matter.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug, PartialEq)]
pub(super) enum StudyValue {
    Number(Number),
    Vector(Triple),
    Rotation(Turn),
    Matrix(DMat3),
    Tensor(Tensor),
    Whole(u64),
    List(Vec<Vec<StudyParameter>>),
    /// The study's seed.
    Seed,
    Absent,
}

/// The names of all models.
static NAMES: LazyLock<Vec<&'static str>> =
    LazyLock::new(|| MODELS.iter().flat_map(|model| model.declaration().names()).chain([custom::NAME]).collect());

/// Reads the list `[[torque]]`.
pub(super) fn read(node: &Node<'_>) -> Result<Vec<StudyTorque>> {
    const EXPECTED: &str = "expected tables [[torque]]";
    let elements = node.elements().ok_or_else(|| node.refuse(EXPECTED))?;
    elements
        .into_iter()
        .enumerate()
        .map(|(index, mut element)| {
            element.path = format!("torque[{}]", index + 1);
            let table = element.any_table().ok_or_else(|| element.refuse(EXPECTED))?;
            let path = element.path;
            let name = table.need("model", "expected the name of a torque's model")?.choice(&NAMES)?;
            if name == custom::NAME {
                let (model, parameters) = custom::read(&table)?;
                return Ok(StudyTorque { parameters, model, index, path });
            }
            let model = model(&table, name)?;
            let parameters = parameters(&table, "model", &model.declaration().parameters)?;
            Ok(StudyTorque { parameters, model, index, path })
        })
        .collect()
}

fn model(table: &Table<'_>, name: &str) -> Result<ModelRef> {
    let named = MODELS.iter().find(|model| model.declaration().names().any(|known| known == name));
    let unknown = || table.need("model", "expected the name of a model").map(|node| node.refuse("expected a model"));
    named.map(|model| ModelRef::Built(*model)).ok_or_else(|| unknown().unwrap_or_else(|error| error))
}

/// The parameters of a table; the key `other` is read elsewhere.
fn parameters(table: &Table<'_>, other: &str, declared: &[ParameterDeclaration]) -> Result<Vec<StudyParameter>> {
    let keys = keys_below(declared, "").into_iter().map(|(key, _)| key);
    table.only(&std::iter::once(other).filter(|other| !other.is_empty()).chain(keys).collect::<Vec<_>>())?;
    check_choices(table, declared)?;
    // A torque that does not state an orbit uses the study's.
    let own_orbit = ["mu", "orbit"].into_iter().any(|key| table.find(key).is_some());
    let of_study = table.context().orbit().filter(|_| !own_orbit);
    let read = |parameter: &ParameterDeclaration| -> Result<StudyParameter> {
        let shared = of_study.and_then(|orbit| orbit.iter().find(|(name, _)| *name == parameter.name));
        if let Some((_, shared)) = shared.filter(|_| is_of_orbit(&parameter.name)) {
            table.context().note_orbit_use();
            return Ok(shared.clone());
        }
        let (key, node) = find(table, declared, parameter)?;
        let is_stated = node.is_some();
        let value = match (node, parameter.default) {
            (Some(node), _) => {
                if orbit::is_angle(&parameter.name) {
                    orbit::check_angle(&node)?;
                }
                StudyValue::read(&node, parameter)?
            }
            (None, Some(preset)) => StudyValue::preset(parameter.shape, preset),
            (None, None) => StudyValue::Absent,
        };
        Ok(StudyParameter { is_stated, ..StudyParameter::new(key.to_owned(), value) })
    };
    declared.iter().map(read).collect()
}

/// The table in which a study states the orbit once.
pub(super) const ORBIT: &str = "orbit";

/// Whether a parameter of a model belongs to its orbit.
fn is_of_orbit(name: &str) -> bool {
    name == "mu" || name.starts_with("orbit.")
}

/// The parameters of the table `[orbit]`, each with its name in models.
pub(super) fn orbit_of_study(node: &Node<'_>) -> Result<Vec<(String, StudyParameter)>> {
    let table = node.any_table().ok_or_else(|| node.refuse("expected a table [orbit]"))?;
    let of_model = |model: &&dyn Model| -> Vec<ParameterDeclaration> {
        let parameters = model.declaration().parameters.iter();
        parameters.filter(|parameter| is_of_orbit(&parameter.name)).cloned().collect()
    };
    let all = MODELS.iter().map(of_model).find(|parameters| parameters.len() > 1).unwrap_or_default();
    let own = |name: &Text| Text::from(name.strip_prefix("orbit.").unwrap_or(name).to_owned());
    let declared: Vec<ParameterDeclaration> = all
        .iter()
        .map(|parameter| {
            let mut own_key = parameter.clone();
            own_key.name = own(&parameter.name);
            if let Some(other) = &mut own_key.other_key {
                other.name = own(&other.name);
                other.excludes.iter_mut().for_each(|excluded| *excluded = own(excluded));
            }
            own_key
        })
        .collect();
    let read = parameters(&table, "", &declared)?;
    let named = read
        .into_iter()
        .zip(&all)
        .map(|(parameter, declared)| (declared.name.to_string(), StudyParameter { is_of_orbit: true, ..parameter }));
    Ok(named.collect())
}

/// The tables of a list; messages count them from 1.
fn list(node: &Node<'_>, parameter: &ParameterDeclaration) -> Result<Vec<Vec<StudyParameter>>> {
    let elements = node.elements().ok_or_else(|| node.refuse(parameter.expected()))?;
    if !parameter.valid.holds(elements.len() as f64) {
        return Err(node.refuse(parameter.expected()));
    }
    let read = |(index, mut element): (usize, Node<'_>)| {
        element.path = format!("{}[{}]", element.path, index + 1);
        let table = element.any_table().ok_or_else(|| element.refuse("expected a table"))?;
        parameters(&table, "", &parameter.elements)
    };
    elements.into_iter().enumerate().map(read).collect()
}

/// Table and key in a parameter's name; the table is empty at the top level.
fn split(name: &str) -> (&str, &str) {
    name.split_once('.').unwrap_or(("", name))
}

/// The keys of a table, each with the first parameter that it belongs to; at the top level including the keys of tables.
fn keys_below<'a>(declared: &'a [ParameterDeclaration], table: &str) -> Vec<(&'a str, &'a ParameterDeclaration)> {
    let mut keys: Vec<(&str, &ParameterDeclaration)> = Vec::new();
    for parameter in declared {
        for name in std::iter::once(&parameter.name).chain(parameter.other_key.as_ref().map(|other| &other.name)) {
            let key = match split(name) {
                (of, key) if of == table => key,
                (of, _) if table.is_empty() => of,
                _ => continue,
            };
            if !keys.iter().any(|(known, _)| *known == key) {
                keys.push((key, parameter));
            }
        }
    }
    keys
}

/// Refuses none or several of the keys that exclude each other.
fn check_choices(table: &Table<'_>, declared: &[ParameterDeclaration]) -> Result<()> {
    let keys = keys_below(declared, "");
    for (_, first) in keys.iter().filter(|(_, parameter)| parameter.choice.is_some()) {
        let of_choice = keys.iter().filter(|(_, parameter)| parameter.choice == first.choice);
        let mut names: Vec<&str> = of_choice.clone().map(|(_, parameter)| parameter.alternative()).collect();
        names.dedup();
        let mut given = of_choice.filter(|(key, _)| table.find(key).is_some());
        match given.next() {
            None => drop(table.need(names[0], format!("expected `{}`", names.join("` or `")))?),
            Some((key, one)) => {
                if let Some((other, _)) = given.find(|(_, other)| other.alternative() != one.alternative()) {
                    table.exclusive(other, key)?;
                }
            }
        }
    }
    Ok(())
}

/// The key of a parameter, and its value if it has one.
fn find<'a, 'p>(
    table: &Table<'a>,
    declared: &[ParameterDeclaration],
    parameter: &'p ParameterDeclaration,
) -> Result<(&'p str, Option<Node<'a>>)> {
    let (group, key) = split(&parameter.name);
    let members = keys_below(declared, group);
    let own = match table.find(group) {
        _ if group.is_empty() => None,
        Some(node) => Some(node),
        None if parameter.choice.is_some() || members.iter().all(|(_, member)| member.default.is_some()) => {
            return Ok((&parameter.name, None));
        }
        None => Some(table.need(group, of_group(&members))?),
    };
    let within = match &own {
        Some(node) => {
            let keys: Vec<&str> = members.iter().map(|(key, _)| *key).collect();
            node.table(of_group(&members), &keys)?
        }
        None => table.clone(),
    };
    let other = parameter.other_key.as_ref().map(|other| (other, split(&other.name).1));
    if let Some((other, other_key)) = other {
        for excluded in std::iter::once(key).chain(other.excludes.iter().map(|name| split(name).1)) {
            within.exclusive(other_key, excluded)?;
        }
        if let Some(node) = within.find(other_key) {
            return Ok((&other.name, Some(node)));
        }
    }
    let is_at_choice = group.is_empty() && parameter.choice.is_some();
    let node = match (within.find(key), other, own) {
        (None, ..) if parameter.default.is_some() || is_at_choice => None,
        (None, Some((_, other_key)), Some(own)) => {
            return Err(own.refuse(format!("expected `{other_key}` or `{key}`{}", in_brackets(&parameter.unit))));
        }
        _ => Some(within.need(key, needed(parameter))?),
    };
    Ok((&parameter.name, node))
}

/// The text of a refusal for a missing key.
fn needed(parameter: &ParameterDeclaration) -> Text {
    format!("expected {}{}", parameter.with_axes(), in_brackets(&parameter.unit)).into()
}

/// The text of a refusal for a missing table.
fn of_group(members: &[(&str, &ParameterDeclaration)]) -> Text {
    let members = members.iter().filter(|(_, member)| member.default.is_none());
    // Keys of the same parameter are alternatives.
    let mut text = String::new();
    let mut last = None;
    for (key, member) in members {
        let between = if last.is_none() {
            ""
        } else if last == Some(&member.name) {
            " or "
        } else {
            ", "
        };
        text += &format!("{between}{key} = {}", member.unit);
        last = Some(&member.name);
    }
    format!("expected {{ {text} }}").into()
}

impl StudyValue {
    fn read(node: &Node<'_>, parameter: &ParameterDeclaration) -> Result<Self> {
        let is_table = node.any_table().is_some();
        let unit = &parameter.unit;
        // A value of the wrong shape is refused with the parameter's description.
        let refused = || Err(node.refuse(needed(parameter)));
        Ok(match parameter.shape {
            Shape::Number if !parameter.per_body => {
                StudyValue::Number(Number::Drawn(Scalar::Constant(node.quantity(unit, needed(parameter))?)))
            }
            Shape::Vector if !parameter.per_body => {
                StudyValue::Vector(Triple::Drawn(Vector::constant(node.vector(unit, needed(parameter))?)))
            }
            Shape::List => StudyValue::List(list(node, parameter)?),
            Shape::Number if is_table || node.is_number() => StudyValue::Number(Number::read(node, unit)?),
            Shape::Vector if is_table || node.elements().is_some() => StudyValue::Vector(Triple::read(node, unit)?),
            Shape::Rotation if is_table || node.elements().is_some() => StudyValue::Rotation(Turn::read(node)?),
            Shape::Tensor => StudyValue::Tensor(Tensor::read(node)?),
            Shape::Matrix => {
                let expected = format!("expected three rows of three finite numbers{}", in_brackets(&parameter.unit));
                let rows = node.elements().filter(|rows| rows.len() == 3);
                let rows = rows.ok_or_else(|| node.refuse(expected.clone()))?;
                let rows: Vec<DVec3> =
                    rows.iter().map(|row| row.vector(unit, expected.clone())).collect::<Result<_>>()?;
                StudyValue::Matrix(DMat3::from_cols(rows[0], rows[1], rows[2]).transpose())
            }
            Shape::Whole => {
                let number = node.whole(parameter.expected())?;
                if parameter.valid != Validity::Finite && !parameter.valid.holds(number as f64) {
                    return Err(node.refuse(parameter.expected()));
                }
                StudyValue::Whole(number)
            }
            Shape::Number | Shape::Vector | Shape::Rotation => return refused(),
        })
    }

    fn preset(shape: Shape, preset: Preset) -> Self {
        match (shape, preset) {
            (_, Preset::Seed) => StudyValue::Seed,
            (_, Preset::Whole(number)) => StudyValue::Whole(number),
            (Shape::Vector, Preset::Number(x)) => StudyValue::Vector(Triple::Drawn(Vector::constant(DVec3::splat(x)))),
            (_, Preset::Number(x)) => StudyValue::Number(Number::Drawn(Scalar::Constant(x))),
        }
    }
}

impl StudyValue {
    /// The value of a parameter for all bodies.
    fn drawn(&self, source: &Source<'_>, declared: &ParameterDeclaration, seed: u64) -> Value {
        let number = declared.draw.into();
        match self {
            StudyValue::Number(value) => Value::Number(source.number(value, number)),
            StudyValue::Vector(value) => Value::Vector(source.vector(value, number)),
            StudyValue::Rotation(value) => Value::Rotation(source.rotation(value, number)),
            StudyValue::Matrix(value) => Value::Matrix((*value).into()),
            StudyValue::Tensor(value) => Value::Tensor(source.tensor(value, number)),
            StudyValue::Whole(value) => Value::Whole(*value),
            StudyValue::List(list) => {
                let row = |row: &Vec<StudyParameter>| {
                    let values = declared.elements.iter().zip(row);
                    values.map(|(declared, parameter)| parameter.drawn(source, declared, seed)).collect()
                };
                Value::List(list.iter().map(row).collect())
            }
            StudyValue::Seed => Value::Whole(seed),
            StudyValue::Absent => Value::Absent,
        }
    }
}

/// The parts of the own state of some torques.
pub(super) fn own_parts(torques: &[StudyTorque]) -> Vec<OwnPart> {
    control::own_parts(torques.iter().map(|torque| torque.model.declaration()))
}

/// The indices of the torques that have a potential.
pub(super) fn with_potential(torques: &[StudyTorque]) -> impl Iterator<Item = usize> {
    torques.iter().filter(|torque| torque.model.has_potential()).map(|torque| torque.index)
}

impl StudyTorque {
    /// A law by which a quantity adds up, stated at `path`.
    pub(super) fn of_quantity(model: ModelRef, parameters: Vec<StudyParameter>, index: usize, path: String) -> Self {
        Self { model, parameters, index, path }
    }

    /// Its place in the file.
    pub(super) fn path(&self) -> &str {
        &self.path
    }

    /// Whether it is a law by which a quantity adds up.
    pub(super) fn is_accumulation(&self) -> bool {
        is_accumulation(self.model.declaration())
    }

    /// Adds the names of the columns of the table of bodies that the torque reads.
    pub(super) fn columns(&self, names: &mut BTreeSet<String>) {
        self.parameters.iter().for_each(|parameter| parameter.columns(names));
    }

    /// The name of its model, if bodies under it turn about a fixed point other than the centre of mass.
    pub(super) fn pivot(&self) -> Option<&str> {
        let declaration = self.model.declaration();
        declaration.has_pivot.then_some(&*declaration.name)
    }

    /// Whether it has no seed of its own, but takes one of the study's.
    pub(super) fn takes_seed(&self) -> bool {
        self.parameters.iter().any(|parameter| matches!(parameter.value, StudyValue::Seed))
    }

    /// The torque with its parameters drawn.
    pub(super) fn torque(&self, draw: Draw, seed: u64, bodies: &Bodies) -> Result<Torque> {
        let source = Source::of(bodies, draw, Owner::Torque(self.index));
        let declaration = self.model.declaration();
        let declared = declaration.parameters.iter().zip(&self.parameters);
        let values: Vec<Value> =
            declared.map(|(declared, parameter)| parameter.drawn(&source, declared, seed)).collect();
        let context =
            ValidationContext { torque: self.index, model: declaration.name.clone(), body_count: bodies.count };
        let is_stated = |name: &str| declaration.position(name).is_some_and(|place| self.parameters[place].is_stated);
        let value = |name: &str| values.get(declaration.position(name)?);
        orbit::check_pericentre(value, is_stated(orbit::RADIUS), &context)?;
        let made = self.model.made_for(&values, &context);
        made.unwrap_or_else(|| Ok(Torque::of_model(self.model.clone(), values)))
    }

    /// The key in the file of a parameter that was found not to be valid.
    pub(super) fn key(&self, name: &str) -> String {
        let parameter = self.model.declaration().position(name).and_then(|place| self.parameters.get(place));
        if let Some(parameter) = parameter.filter(|parameter| parameter.is_of_orbit) {
            return format!("{ORBIT}.{}", parameter.key);
        }
        format!("{}.{}", self.path, parameter.map_or(name, |parameter| &parameter.key))
    }
}
