//! The torques of a table as WGSL: a function for each kind, recorded from its formula, and their sum.
//!
//! The text of a kind is named after its file here, so that errors of a compiler and planted faults find it.

use std::fmt::Write;

use super::formula::{Column, Formula, FormulaTask, MOST_PHASES, Role, Row};
use super::table::{Instance, TorqueTable};
use crate::clock::RATE_DIGITS;
use crate::expression::wgsl::{self, Argument, Signature};
use crate::expression::{Fault, Graph, Input, InputKind, Recorder, Shape, Symbol};
use crate::quaternion::Quaternion;
use crate::torque::Kind;
use crate::vector::Vector;

/// The functions of the kinds of torque that are wanted, one text a kind: file and text.
pub(crate) fn functions(wanted: impl Fn(Kind) -> bool) -> Vec<(&'static str, String)> {
    let torques = Kind::ALL.iter().filter(|&&kind| kind.role() == Role::Torque && wanted(kind));
    torques.map(|&kind| (kind.file(), kind.with(Text { kind }))).collect()
}

/// The function `torque_terms`, which adds up the torques of a table.
pub(crate) fn terms(table: &TorqueTable) -> String {
    let mut text = "// The sum of the torques of this scene, in the order of src/torque/kind.rs, on top of `noise`.\n\
                    fn torque_terms(epoch: Epoch, orientation: quaternion, angular_velocity_principal: vector) -> vector {\n\
                    \x20   var sum = epoch.noise;\n"
        .to_owned();
    for &instance in table.list() {
        let line = match instance.kind.role() {
            Role::Torque => {
                format!("    sum = sum + {};\n", instance.kind.with(Call { instance, varies: table.varies_inertia() }))
            }
            Role::Projection => format!("    sum.x = torque_column({}u) * sum.x;\n", instance.first),
            Role::Noise | Role::Slip | Role::Moments => continue,
        };
        text += &line;
    }
    text + "    return sum;\n}\n"
}

/// What a formula needs, found by recording it.
struct Recorded {
    graph: Graph,
    outputs: Vec<crate::expression::Node>,
    /// Its arguments in order, without those that it does not read.
    arguments: Vec<(Argument, Given)>,
}

/// Where an argument comes from.
#[derive(Clone, Copy)]
enum Given {
    /// Columns from this one of the instance on.
    Column(usize, Column),
    /// The phase with this number.
    Phase(usize),
    Orientation,
    AngularVelocity,
}

/// Parameters as symbols.
struct SymbolRow<'a>(&'a Recorder);

impl Row<Symbol> for SymbolRow<'_> {
    fn number(&self, column: usize) -> Symbol {
        self.0.input(Input::new(InputKind::Parameter, column as u16))
    }
}

fn recorded<F: Formula>() -> Result<Recorded, Fault> {
    let (graph, outputs) = Graph::record::<Fault>(|recorder| {
        let input = |kind, index| recorder.input(Input::new(kind, index));
        let vector = |kind| Vector::new(input(kind, 0), input(kind, 1), input(kind, 2));
        let v = vector(InputKind::Orientation);
        let q = Quaternion::new(v.x, v.y, v.z, input(InputKind::Orientation, 3));
        let row = SymbolRow(recorder);
        let mut phases = [row.number(0); MOST_PHASES];
        for (index, phase) in phases.iter_mut().enumerate().take(F::PHASES.len()) {
            *phase = input(InputKind::Phase, index as u16);
        }
        let torque = F::torque(&row, &F::epoch(&row, phases), q, vector(InputKind::AngularVelocity));
        Ok(vec![torque.x, torque.y, torque.z])
    })?;
    let read = graph.inputs(&outputs);
    let mut arguments = Vec::new();
    let mut first = 0;
    let mut offer = |name: &str, kind, first: usize, numbers: usize, given| {
        let inputs = (first..first + numbers).map(|index| Input::new(kind, index as u16));
        if inputs.clone().any(|input| read.contains(&input)) {
            let shape = match numbers {
                1 => Shape::Number,
                3 => Shape::Vector,
                _ => Shape::Quaternion,
            };
            arguments.push((Argument::new(name, shape, inputs), given));
        }
    };
    for &column in F::COLUMNS {
        offer(column.name, InputKind::Parameter, first, column.numbers, Given::Column(first, column));
        first += column.numbers;
    }
    for (index, name) in F::PHASES.iter().enumerate() {
        offer(name, InputKind::Phase, index, 1, Given::Phase(index));
    }
    offer("orientation", InputKind::Orientation, 0, 4, Given::Orientation);
    offer("angular_velocity_principal", InputKind::AngularVelocity, 0, 3, Given::AngularVelocity);
    Ok(Recorded { graph, outputs, arguments })
}

/// The operations of a formula, the torque's components among them, and the arguments of its function.
pub(super) fn recording<F: Formula>() -> Option<(Graph, Vec<crate::expression::Node>, Vec<Argument>)> {
    let Recorded { graph, outputs, arguments } = recorded::<F>().ok()?;
    Some((graph, outputs, arguments.into_iter().map(|(argument, _)| argument).collect()))
}

/// The function of a kind.
struct Text {
    kind: Kind,
}

impl FormulaTask for Text {
    type Output = String;
    fn run<F: Formula>(self) -> String {
        let text = recorded::<F>().map_err(|fault| fault.to_string()).and_then(|recorded| {
            let signature = Signature {
                name: F::STEM.to_owned(),
                comment: vec![format!(
                    "{}, in principal axes and the body's own units; recorded from {}.",
                    F::STEM,
                    self.kind.source_file()
                )],
                parameters: recorded.arguments.into_iter().map(|(argument, _)| argument).collect(),
            };
            wgsl::function(&recorded.graph, &recorded.outputs, &signature).map_err(|error| error.to_string())
        });
        // A formula of the library that has no text is a bug of ours; `every_kind_has_a_text` holds it.
        text.unwrap_or_else(|reason| format!("// {}: {reason}\n", F::STEM))
    }
}

/// A call of the function of an instance's kind.
struct Call {
    instance: Instance,
    /// Whether moments of inertia change in time.
    varies: bool,
}

impl FormulaTask for Call {
    type Output = String;
    fn run<F: Formula>(self) -> String {
        let Self { instance: Instance { first, .. }, varies } = self;
        let arguments = recorded::<F>().map(|recorded| recorded.arguments).unwrap_or_default();
        let mut text = format!("{}(", F::STEM);
        for (place, (_, given)) in arguments.into_iter().enumerate() {
            let comma = if place == 0 { "" } else { ", " };
            let argument = match given {
                Given::Column(0, Column { numbers: 3, .. }) if F::FOLLOWS_MOMENTS && varies => {
                    format!("gradient_coefficients({first}u, epoch.change_done)")
                }
                Given::Column(column, Column { numbers, .. }) => {
                    let function = match numbers {
                        1 => "torque_column",
                        3 => "torque_vector",
                        _ => "torque_quaternion",
                    };
                    format!("{function}({}u)", first + column)
                }
                Given::Phase(index) => {
                    let column = first + F::PARAMETERS + index * (RATE_DIGITS + 1);
                    format!("phase({column}u, torque_body, epoch.instant)")
                }
                Given::Orientation => "orientation".to_owned(),
                Given::AngularVelocity => "angular_velocity_principal".to_owned(),
            };
            // Writing to a string cannot fail.
            let _ = write!(text, "{comma}{argument}");
        }
        text + ")"
    }
}
