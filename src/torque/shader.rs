//! The torques of a table as WGSL: a function for each kind, recorded from its formula, and their sum.
//!
//! The text of a kind is named after its file here, so that errors of a compiler and planted faults find it.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::sync::OnceLock;

use super::Needs;
use super::expressed::{Expressed, Given, needs};
use super::formula::{Column, Formula, FormulaTask, MOST_PHASES, Role, Row};
use super::table::{Instance, TorqueTable};
use crate::expression::wgsl::{self, Argument, Signature, WgslError};
use crate::expression::{Fault, Graph, Input, InputKind, Recorder, Shape, Symbol};
use crate::math::clock::{RATE_DIGITS, seconds_per_word};
use crate::math::quaternion::Quaternion;
use crate::math::vector::Vector;
use crate::torque::Kind;

/// The functions of the kinds of torque that are wanted, one text for each kind: file and text.
pub(crate) fn functions(wanted: impl Fn(Kind) -> bool) -> Vec<(&'static str, String)> {
    let torques = Kind::ALL.iter().filter(|&&kind| kind.role() == Role::Torque && wanted(kind));
    torques.map(|&kind| (kind.file(), kind.with(Text { kind }))).collect()
}

impl Kind {
    /// What it depends on, found from its formula; for what is not a torque, from its role. A formula that is data has its own dependences.
    pub(crate) fn needs(self) -> Needs {
        static FOUND: [OnceLock<Needs>; Kind::ALL.len()] = [const { OnceLock::new() }; Kind::ALL.len()];
        match self.role() {
            Role::Torque => *FOUND[self as usize].get_or_init(|| self.with(NeedsOf)),
            Role::Slip => Needs::ANGULAR_VELOCITY,
            Role::Noise | Role::Moments => Needs::TIME,
            Role::Projection | Role::Expression => Needs::NOTHING,
        }
    }
}

struct NeedsOf;

impl FormulaTask for NeedsOf {
    type Output = Needs;
    fn run<F: Formula>(self) -> Needs {
        // A formula that cannot be recorded would be a bug; it is assumed to depend on everything.
        let everything = Needs { attitude: true, angular_velocity: true, time: true, position: false };
        recorded::<F>().map_or(everything, |Recorded { graph, outputs, .. }| needs(graph.dependence_of(&outputs)))
    }
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
            Role::Expression => {
                let call = custom_call(table.expressed(instance.index), &instance, "epoch.instant");
                format!("    sum = sum + {call};\n")
            }
            Role::Noise | Role::Slip | Role::Moments => continue,
        };
        text += &line;
    }
    text += "    return sum;\n}\n";
    let share = match (table.change(), table.formula_of_moments()) {
        (Some(change), Some(formula)) => custom_call(formula, change, "instant"),
        _ => "vector(0.0, 0.0, 0.0)".to_owned(),
    };
    let comment = "// The parts of themselves that the reciprocal moments have gained, by a formula of the scene's own; 0 without one.";
    text + &format!("\n{comment}\nfn formula_share(instant: Instant) -> vector {{\n    return {share};\n}}\n")
}

/// The functions of the formulas that are data, if there are any; `declared` are the names in the shaders' own files. Constants outside the
/// range of `f32` are refused.
pub(crate) fn custom_functions(table: &TorqueTable, declared: &BTreeSet<String>) -> Result<String, WgslError> {
    let mut text = String::new();
    let stems = Kind::ALL.iter().map(|kind| kind.stem().to_owned());
    let generated = ["torque_terms", "formula_share", "seconds"].map(str::to_owned);
    let own = table.list().iter().map(custom_name);
    let declared: BTreeSet<String> = declared.iter().cloned().chain(stems).chain(generated).chain(own).collect();
    for instance in table.list().iter().filter(|instance| instance.kind.role() == Role::Expression) {
        let expressed = table.expressed(instance.index);
        let comment =
            vec!["A formula of the scene's own, along principal axes and in the body's own units.".to_owned()];
        text += &expressed.shader(&custom_name(instance), comment, &declared)?;
        text.push('\n');
    }
    if let (Some(change), Some(formula)) = (table.change(), table.formula_of_moments()) {
        let comment = "The parts I0/I - 1 of themselves that the reciprocal moments have gained, by a formula of the scene's own.";
        text += &formula.shader(&custom_name(change), vec![comment.to_owned()], &declared)?;
        text.push('\n');
    }
    if table.reads_time() {
        let [upper, lower] = seconds_per_word(table.clock().ticks_per_second());
        // Twin: `seconds` in src/math/clock.rs.
        let _ = writeln!(
            text,
            "// The time, s.\nfn seconds(instant: Instant) -> real {{\n    return mul_add(real(instant.ticks.y), \
             {upper:?}, real(instant.ticks.x) * {lower:?}) + instant.elapsed;\n}}"
        );
    }
    Ok(text)
}

fn custom_name(instance: &Instance) -> String {
    match instance.kind.role() {
        Role::Moments => "custom_moments".to_owned(),
        _ => format!("custom_{}", instance.index + 1),
    }
}

/// A call of the function of a formula that is data; `instant` is the text of the time.
fn custom_call(formula: &Expressed, instance: &Instance, instant: &str) -> String {
    let first = instance.first + instance.kind.parameters();
    let argument = |given: Given| match given {
        Given::Column(column) => format!("torque_column({}u)", first + column),
        Given::Phase(phase) => {
            let column = instance.first + instance.parameters + phase * (RATE_DIGITS + 1);
            format!("phase({column}u, torque_body, {instant})")
        }
        Given::Time => format!("seconds({instant})"),
        Given::MomentRatio(_) => "moment_ratio(epoch.change.share)".to_owned(),
        Given::Orientation(_) => "orientation".to_owned(),
        Given::AngularVelocity(_) => "angular_velocity_principal".to_owned(),
        // The whole formula computes the first itself; only series have the others, and no shader is written for them.
        Given::Epoch(_) | Given::Position(_) | Given::Velocity(_) => "0.0".to_owned(),
    };
    let given = formula.arguments();
    let arguments: Vec<String> = given.into_iter().map(|(_, given)| argument(given)).collect();
    format!("{}({})", custom_name(instance), arguments.join(", "))
}

/// The arguments of a formula, found by recording it.
struct Recorded {
    graph: Graph,
    outputs: Vec<crate::expression::Node>,
    /// Its arguments in order, without those that it does not read.
    arguments: Vec<(Argument, Source)>,
}

/// Where an argument of a kind's function comes from.
#[derive(Clone, Copy)]
enum Source {
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
        offer(column.name, InputKind::Parameter, first, column.numbers, Source::Column(first, column));
        first += column.numbers;
    }
    for (index, name) in F::PHASES.iter().enumerate() {
        offer(name, InputKind::Phase, index, 1, Source::Phase(index));
    }
    offer("orientation", InputKind::Orientation, 0, 4, Source::Orientation);
    offer("angular_velocity_principal", InputKind::AngularVelocity, 0, 3, Source::AngularVelocity);
    Ok(Recorded { graph, outputs, arguments })
}

/// The operations of a formula, the nodes of the torque's components, and the arguments of its function.
pub(crate) fn recording<F: Formula>() -> Option<(Graph, Vec<crate::expression::Node>, Vec<Argument>)> {
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
        // A built-in formula without a text is a bug; the test `every_kind_has_a_text_of_its_own` guards against it.
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
                Source::Column(0, Column { numbers: 3, .. }) if F::FOLLOWS_MOMENTS && varies => {
                    format!("gradient_coefficients({first}u, epoch.change.gained)")
                }
                Source::Column(column, Column { numbers, .. }) => {
                    let function = match numbers {
                        1 => "torque_column",
                        3 => "torque_vector",
                        _ => "torque_quaternion",
                    };
                    format!("{function}({}u)", first + column)
                }
                Source::Phase(index) => {
                    let column = first + F::PARAMETERS + index * (RATE_DIGITS + 1);
                    format!("phase({column}u, torque_body, epoch.instant)")
                }
                Source::Orientation => "orientation".to_owned(),
                Source::AngularVelocity => "angular_velocity_principal".to_owned(),
            };
            // Writing to a string cannot fail.
            let _ = write!(text, "{comma}{argument}");
        }
        text + ")"
    }
}
