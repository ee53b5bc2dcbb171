//! What tests compare with the recorded text of a kind: its formula on the numbers of one body, and the graph of the text; and the
//! sum of torques in an arithmetic chosen by the test.

use super::formula::{Formula, FormulaTask, MOST_PHASES, Role, Row};
use super::{Kind, shader};
use crate::expression::wgsl::Argument;
use crate::expression::{Graph, Node};
use crate::math::quaternion::Quaternion;
use crate::math::real::Scalar;
use crate::math::vector::Vector;

/// The kernel of a kind as a text, with the source of the text.
#[derive(Clone, Debug)]
pub struct Twin {
    /// The kind.
    pub kind: Kind,
    /// Names of its parameters, with the number of columns of each.
    pub columns: Vec<(&'static str, usize)>,
    /// Names of its phases.
    pub phases: &'static [&'static str],
    /// The recorded operations.
    pub graph: Graph,
    /// The nodes of the torque's components.
    pub outputs: Vec<Node>,
    /// The arguments of the text's function, in order.
    pub arguments: Vec<Argument>,
    /// The text's name.
    pub file: &'static str,
    /// The text.
    pub text: String,
}

/// The twins of all kinds that are torques.
pub fn twins() -> Vec<Twin> {
    let torques = Kind::ALL.iter().filter(|kind| kind.role() == Role::Torque);
    torques.map(|&kind| kind.with(Taken { kind })).collect()
}

impl Twin {
    /// The formula on scalars: the torque of one body with these columns and phases (turns).
    pub fn torque<T: Scalar>(
        &self,
        row: &[T],
        phases: &[T],
        orientation: Quaternion<T>,
        angular_velocity_principal: Vector<T>,
    ) -> Vector<T> {
        self.kind.with(Evaluated { row, phases, orientation, angular_velocity_principal })
    }
}

struct Taken {
    kind: Kind,
}

impl FormulaTask for Taken {
    type Output = Twin;
    fn run<F: Formula>(self) -> Twin {
        let kind = self.kind;
        let (graph, outputs, arguments) = shader::recording::<F>().unwrap_or_default();
        let text = shader::functions(|of| of == kind).pop().map_or_else(String::new, |(_, text)| text);
        let columns = F::COLUMNS.iter().map(|column| (column.name, column.numbers)).collect();
        Twin { kind, columns, phases: F::PHASES, graph, outputs, arguments, file: kind.file(), text }
    }
}

struct Evaluated<'s, T: Scalar> {
    row: &'s [T],
    phases: &'s [T],
    orientation: Quaternion<T>,
    angular_velocity_principal: Vector<T>,
}

/// Columns of one body.
struct Numbers<'s, T>(&'s [T]);

impl<T: Scalar> Row<T> for Numbers<'_, T> {
    fn number(&self, column: usize) -> T {
        self.0[column]
    }
}

impl<T: Scalar> FormulaTask for Evaluated<'_, T> {
    type Output = Vector<T>;
    fn run<F: Formula>(self) -> Vector<T> {
        let mut phases = [T::splat(0.0); MOST_PHASES];
        phases[..F::PHASES.len()].copy_from_slice(&self.phases[..F::PHASES.len()]);
        let row = Numbers(self.row);
        F::torque(&row, &F::epoch(&row, phases), self.orientation, self.angular_velocity_principal)
    }
}
