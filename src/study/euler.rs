//! Sequences of Euler angles in studies: `euler = "zyx"`, and the frame of their axes.

use super::reader::{Node, Table};
use crate::bodies::toolkit::{Axis, EulerSequence, TurnedAxes};
use crate::error::Result;

/// The key that names the axes, and the one that names their frame.
pub(super) const EULER: &str = "euler";
pub(super) const ABOUT: &str = "about";

/// The sequence whose axes `node` names, in the frame that the table says: the body's by default.
pub(super) fn sequence(table: &Table<'_>, node: &Node<'_>) -> Result<EulerSequence> {
    const EXPECTED: &str = "expected three axes, no two neighbouring ones equal, such as \"zyx\" or \"zxz\"";
    let axis = |letter: char| match letter {
        'x' => Some(Axis::X),
        'y' => Some(Axis::Y),
        'z' => Some(Axis::Z),
        _ => None,
    };
    let axes: Option<Vec<Axis>> = node.string(EXPECTED)?.chars().map(axis).collect();
    let axes: Option<[Axis; 3]> = axes.and_then(|axes| axes.try_into().ok());
    let about = match table.find(ABOUT).map(|node| node.choice(&["body", "world"])).transpose()? {
        Some("world") => TurnedAxes::World,
        _ => TurnedAxes::Body,
    };
    let sequence = axes.and_then(|axes| EulerSequence::new(axes, about).ok());
    sequence.ok_or_else(|| node.refuse(EXPECTED))
}
