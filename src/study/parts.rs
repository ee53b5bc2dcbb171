//! Bodies composed of parts, in study files.

use glam::{DQuat, DVec3};

use super::distribution::{Orientation, Vector};
use super::draw::{Column, Draw, PartColumn};
use super::reader::{Node, Table};
use super::solid::{self, DrawnUnder, FORMS, Solid, SolidFault};
use crate::bodies::inertia::Part;
use crate::error::{Error, Result};

/// A part of a body, not yet drawn.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct StudyPart {
    solid: Solid,
    position: Vector,
    orientation: Orientation,
    is_hole: bool,
    /// Index among the parts, from 0; enters the draws.
    index: u16,
}

/// The keys that place a part.
const PLACING: [&str; 3] = ["position", "orientation", "hole"];

impl StudyPart {
    /// The part of `body`.
    pub(super) fn sample(&self, draw: Draw, body: usize) -> Result<Part, SolidFault> {
        let column = |of| Column::Part { part: self.index, of };
        let columns = DrawnUnder { size: column(PartColumn::Size), matter: column(PartColumn::Matter) };
        let properties = self.solid.sample_under(columns, draw, body)?;
        Ok(Part {
            properties,
            orientation: self.orientation.sample_as(draw, body, column(PartColumn::Orientation)).normalize(),
            position: self.position.sample(draw, body, column(PartColumn::Position)),
            is_hole: self.is_hole,
        })
    }

    /// Whether nothing about it is drawn.
    pub(super) fn is_constant(&self) -> bool {
        self.solid.is_constant() && self.position.is_constant() && self.orientation.is_constant()
    }

    fn read(node: &Node<'_>, index: u16) -> Result<Self> {
        const EXPECTED: &str = "expected a part { shape = ..., mass = ..., position = [x, y, z] }, or one with mesh, hull or points instead of a shape";
        let table = node.any_table().ok_or_else(|| node.refuse(EXPECTED))?;
        let form = FORMS.into_iter().find(|form| *form != "parts" && table.find(form).is_some());
        let Some(form) = form else {
            table.only(&["shape", "mesh", "hull", "points", "mass", "density", "position", "orientation", "hole"])?;
            return Err(node.refuse(EXPECTED));
        };
        let solid = Solid::read(node, &table, form, &PLACING)?;
        let position = match table.find("position") {
            Some(position) => Vector::read(&position, "m")?,
            None => Vector::constant(DVec3::ZERO),
        };
        let orientation = match table.find("orientation") {
            Some(orientation) => Orientation::read(&orientation)?,
            None => Orientation::Constant(DQuat::IDENTITY),
        };
        let is_hole = match table.find("hole") {
            Some(hole) => hole.boolean("expected true or false: whether the part is taken away")?,
            None => false,
        };
        Ok(Self { solid, position, orientation, is_hole, index })
    }
}

/// Reads the list of parts.
pub(super) fn read(node: &Node<'_>) -> Result<Vec<StudyPart>> {
    const EXPECTED: &str = "expected a list of parts: at least one, at most 65,536";
    let elements = elements(node).filter(|elements| !elements.is_empty()).ok_or_else(|| node.refuse(EXPECTED))?;
    let part = |(index, element): (usize, Node<'_>)| {
        StudyPart::read(&element, u16::try_from(index).map_err(|_| node.refuse(EXPECTED))?)
    };
    elements.into_iter().enumerate().map(part).collect()
}

/// `error` for part `index` of the list in `table`, at the key that it concerns.
pub(super) fn refusal(table: &Table<'_>, index: usize, error: Error) -> Error {
    let element = table.find("parts").as_ref().and_then(elements).and_then(|list| list.into_iter().nth(index));
    match element.as_ref().and_then(|element| Some((element, element.any_table()?))) {
        Some((element, part)) => solid::refusal(element, &part, error),
        None => error,
    }
}

/// The elements of the list, each under its own name: `parts[1]`.
fn elements<'a>(node: &Node<'a>) -> Option<Vec<Node<'a>>> {
    let mut elements = node.elements()?;
    for (index, element) in elements.iter_mut().enumerate() {
        element.path = format!("{}[{}]", node.path, index + 1);
    }
    Some(elements)
}
