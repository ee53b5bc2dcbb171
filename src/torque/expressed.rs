//! A formula of the user's own, prepared for the engines.
//!
//! The formula is written in SI units and along the body's axes; kernels work along principal axes and in each body's own units. The
//! change of axes and units is recorded with the formula, so that what does not depend on the state is formed once a body
//! ([`crate::expression::Stages`]), and what is the same for all bodies is a constant: where all bodies have the same principal axes, and
//! these are the body's own, nothing is left of it.

use glam::{DMat3, DQuat};

use super::{Needs, Value, Values};
use crate::bodies::BodyFrame;
use crate::expression::wgsl::{self, Argument, Signature};
use crate::expression::{
    Dependence, Expression, Fault, Graph, Input, InputKind, Part, Program, Recorder, Shape, Symbol,
};
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// What the host knows of a body, by number: the reference rate and the torque's unit.
const RATE: usize = 0;
const UNIT: usize = 1;
/// Principal axes to body axes: the matrix by rows, and the quaternion of its inverse.
const MATRIX: usize = 2;
const TO_PRINCIPAL: usize = 11;
/// xx, yy, zz, xy, xz, yz, kg m², body axes.
const INERTIA: usize = 15;
/// The user's parameters.
const USER: usize = 21;

/// Where an evaluator finds an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Given {
    /// A column, from the instance's first on.
    Column(usize),
    /// A phase of the instance.
    Phase(usize),
    /// The time, s.
    Time,
    /// A number formed from the time.
    Epoch(usize),
    /// A component of the orientation.
    Orientation(usize),
    /// A component of the angular velocity, principal axes, the body's own units.
    AngularVelocity(usize),
}

/// Instructions, and where their inputs are.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Instructions {
    pub program: Program,
    pub inputs: Vec<Given>,
}

/// A formula prepared for the engines.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Expressed {
    /// Numbers of the host that are columns as they are.
    raw: Vec<usize>,
    /// What forms the columns behind them from the host's numbers, and the rates of the phases.
    derived: Program,
    rates: Program,
    /// What is formed once a stage.
    pub epoch: Instructions,
    /// The torque, from what the epoch gives.
    pub torque: Instructions,
    /// The torque at once.
    pub whole: Instructions,
    whole_graph: Part,
    needs: Needs,
}

impl Expressed {
    /// Prepares a formula of a vector; `axes` rotates principal to body axes, where it is the same for all bodies.
    pub fn new(expression: &Expression, axes: Option<DQuat>) -> Result<Self, Fault> {
        let mut rate_count = 0;
        let (graph, outputs) = Graph::record::<Fault>(|recorder| {
            let (outputs, rates) = in_own_units(recorder, expression, axes);
            rate_count = rates.len();
            Ok(outputs.into_iter().chain(rates).collect())
        })?;
        let (outputs, rates) = outputs.split_at(outputs.len() - rate_count);
        let stages = graph.stages(outputs);
        let derived = Program::new(&stages.derived.graph, &stages.derived.outputs);
        let rates = Program::new(&graph, rates);
        let epoch = Program::new(&stages.epoch.graph, &stages.epoch.outputs);
        let torque = Program::new(&stages.rest.graph, &stages.rest.outputs);
        let (graph, outputs) = Graph::record::<Fault>(|recorder| {
            let whole = |input: Input| recorder.input(input);
            let formed = stages.epoch.graph.replayed(&stages.epoch.outputs, u16::MAX, whole).outputs;
            let torque = stages.rest.graph.replayed(&stages.rest.outputs, u16::MAX, |input| match input.kind {
                InputKind::Epoch => formed[usize::from(input.index)],
                _ => whole(input),
            });
            Ok(torque.outputs)
        })?;
        let whole = Program::new(&graph, &outputs);
        let mut raw: Vec<usize> = epoch
            .inputs()
            .iter()
            .chain(torque.inputs())
            .filter(|input| input.kind == InputKind::Parameter)
            .map(|input| usize::from(input.index))
            .collect();
        raw.sort_unstable();
        raw.dedup();
        let given = |input: &Input| {
            let index = usize::from(input.index);
            match input.kind {
                InputKind::Parameter => Given::Column(raw.partition_point(|&number| number < index)),
                InputKind::Derived => Given::Column(raw.len() + index),
                InputKind::Phase => Given::Phase(index),
                InputKind::Epoch => Given::Epoch(index),
                InputKind::Orientation => Given::Orientation(index),
                InputKind::AngularVelocity => Given::AngularVelocity(index),
                // Nothing else is asked for.
                _ => Given::Time,
            }
        };
        let instructions = |program: Program| {
            let inputs = program.inputs().iter().map(given).collect();
            Instructions { program, inputs }
        };
        let dependence = expression.dependence();
        let (epoch, torque, whole) = (instructions(epoch), instructions(torque), instructions(whole));
        Ok(Self {
            derived,
            rates,
            epoch,
            torque,
            whole,
            whole_graph: Part { graph, outputs },
            needs: needs(dependence),
            raw,
        })
    }

    /// The torque at once, as a graph of what [`Expressed::whole`] reads.
    pub fn whole_part(&self) -> &Part {
        &self.whole_graph
    }

    /// Parameter columns.
    pub fn columns(&self) -> usize {
        self.raw.len() + self.derived.output_count()
    }

    /// Phases.
    pub fn phases(&self) -> usize {
        self.rates.output_count()
    }

    /// Whether the rates of its phases follow from the user's parameters alone, and not from the body.
    pub fn rates_are_of_parameters(&self) -> bool {
        self.rates.inputs().iter().all(|input| usize::from(input.index) >= USER)
    }

    /// Whether it reads the time itself, besides phases.
    pub fn reads_time(&self) -> bool {
        self.whole.inputs.contains(&Given::Time)
    }

    /// What it depends on.
    pub fn needs(&self) -> Needs {
        self.needs
    }

    /// A body's columns, and the rates of its phases, rad/s.
    pub fn row(&self, host: &[f64], out: &mut [f64]) -> Vec<f64> {
        let of = |program: &Program| {
            let inputs: Vec<f64> = program.inputs().iter().map(|input| host[usize::from(input.index)]).collect();
            program.evaluate_one(&inputs)
        };
        for (column, &number) in out.iter_mut().zip(&self.raw) {
            *column = host[number];
        }
        out[self.raw.len()..self.columns()].copy_from_slice(&of(&self.derived));
        of(&self.rates)
    }

    /// Its function in WGSL.
    pub fn shader(&self, name: &str, comment: Vec<String>) -> Result<String, wgsl::WgslError> {
        let arguments = self.arguments().into_iter().map(|(argument, _)| argument).collect();
        let signature = Signature { name: name.to_owned(), comment, parameters: arguments };
        wgsl::function(&self.whole_graph.graph, &self.whole_graph.outputs, &signature)
    }

    /// The arguments of its function in WGSL, and where they are.
    pub fn arguments(&self) -> Vec<(Argument, Given)> {
        let mut arguments: Vec<(Argument, Given)> = Vec::new();
        let inputs = self.whole.program.inputs().iter().zip(&self.whole.inputs);
        for (&input, &given) in inputs {
            let (name, numbers) = match given {
                Given::Column(column) => (format!("c{column}"), 1),
                Given::Phase(phase) => (format!("phase_{phase}"), 1),
                Given::Time => ("time".to_owned(), 1),
                Given::Epoch(number) => (format!("epoch_{number}"), 1),
                Given::Orientation(_) => ("orientation".to_owned(), 4),
                Given::AngularVelocity(_) => ("angular_velocity_principal".to_owned(), 3),
            };
            if arguments.iter().any(|(argument, _)| argument.name == name) {
                continue;
            }
            let argument = match numbers {
                1 => Argument::new(name, Shape::Number, [input]),
                3 => Argument::new(name, Shape::Vector, components(input.kind, 3)),
                _ => Argument::new(name, Shape::Quaternion, components(input.kind, 4)),
            };
            arguments.push((argument, given));
        }
        arguments
    }
}

fn components(kind: InputKind, count: u16) -> impl Iterator<Item = Input> {
    (0..count).map(move |index| Input::new(kind, index))
}

/// What a dependence means for a torque.
pub(crate) fn needs(dependence: Dependence) -> Needs {
    Needs {
        attitude: dependence.intersects(Dependence::ATTITUDE),
        angular_velocity: dependence.intersects(Dependence::VELOCITY),
        time: dependence.intersects(Dependence::TIME),
        position: dependence.intersects(Dependence::POSITION),
    }
}

/// The host's numbers of a body, before those of the user.
fn host_numbers(frame: &BodyFrame) -> Vec<f64> {
    let axes = DMat3::from_quat(frame.principal_to_body).transpose().to_cols_array();
    let inverse = frame.principal_to_body.conjugate().to_array();
    let moments = DMat3::from_diagonal(frame.tensor_moments());
    let rotation = DMat3::from_quat(frame.principal_to_body);
    let tensor = rotation * moments * rotation.transpose();
    let mut numbers = vec![frame.scaled(1.0, 0, -1), frame.scaled(1.0, 1, 2)];
    numbers.extend(axes);
    numbers.extend(inverse);
    let elements =
        [tensor.x_axis.x, tensor.y_axis.y, tensor.z_axis.z, tensor.y_axis.x, tensor.z_axis.x, tensor.z_axis.y];
    numbers.extend(elements.map(|element| frame.scaled(element, -1, 0)));
    numbers
}

/// The formula along principal axes and in the body's own units, and the rates of its phases.
fn in_own_units(recorder: &Recorder, expression: &Expression, axes: Option<DQuat>) -> (Vec<Symbol>, Vec<Symbol>) {
    let input = |kind, index: usize| recorder.input(Input::new(kind, index as u16));
    let host = |number: usize| input(InputKind::Parameter, number);
    let vector = |first: Symbol, second: Symbol, third: Symbol| Vector::new(first, second, third);
    let (rows, to_principal) = match axes {
        None => {
            let row =
                |row: usize| vector(host(MATRIX + 3 * row), host(MATRIX + 3 * row + 1), host(MATRIX + 3 * row + 2));
            let q = |part: usize| host(TO_PRINCIPAL + part);
            ([row(0), row(1), row(2)], Quaternion::new(q(0), q(1), q(2), q(3)))
        }
        Some(axes) => {
            let matrix = DMat3::from_quat(axes);
            let constant = |x: f64| Symbol::splat(x);
            let row = |row: usize| {
                let row = matrix.row(row);
                vector(constant(row.x), constant(row.y), constant(row.z))
            };
            let inverse = axes.conjugate();
            let q = Quaternion::new(constant(inverse.x), constant(inverse.y), constant(inverse.z), constant(inverse.w));
            ([row(0), row(1), row(2)], q)
        }
    };
    let q = |part| input(InputKind::Orientation, part);
    let attitude = Quaternion::new(q(0), q(1), q(2), q(3)).product(to_principal);
    let omega = |part| input(InputKind::AngularVelocity, part);
    let omega = vector(omega(0), omega(1), omega(2));
    let omega = Vector::new(rows[0].dot(omega), rows[1].dot(omega), rows[2].dot(omega)) * host(RATE);
    let inertia = |element: usize| host(INERTIA + element);
    let momentum = Vector::new(
        vector(inertia(0), inertia(3), inertia(4)).dot(omega),
        vector(inertia(3), inertia(1), inertia(5)).dot(omega),
        vector(inertia(4), inertia(5), inertia(2)).dot(omega),
    );
    let component = |vector: Vector<Symbol>, index| [vector.x, vector.y, vector.z][index];
    let replayed = expression.graph().replayed(expression.outputs(), 0, |asked| {
        let index = usize::from(asked.index);
        match asked.kind {
            InputKind::Orientation => [attitude.x, attitude.y, attitude.z, attitude.w][index],
            InputKind::AngularVelocity => component(omega, index),
            InputKind::AngularMomentum => component(momentum, index),
            InputKind::Inertia => inertia(index),
            InputKind::Parameter => host(USER + index),
            _ => recorder.input(asked),
        }
    });
    let torque = Vector::new(replayed.outputs[0], replayed.outputs[1], replayed.outputs[2]);
    let column = |axis: fn(&Vector<Symbol>) -> Symbol| vector(axis(&rows[0]), axis(&rows[1]), axis(&rows[2]));
    let (x, y, z) = (column(|row| row.x), column(|row| row.y), column(|row| row.z));
    let torque = Vector::new(x.dot(torque), y.dot(torque), z.dot(torque)) * host(UNIT);
    (vec![torque.x, torque.y, torque.z], replayed.rates)
}

/// The numbers of a body's parameters, in order.
pub(crate) fn numbers_of_body(values: &[Value], body: usize) -> Vec<f64> {
    let mut numbers = Vec::new();
    for value in values {
        match value {
            Value::Number(number) => numbers.push(number.at(body)),
            Value::Vector(vector) => numbers.extend(vector.at(body).to_array()),
            Value::Rotation(rotation) => numbers.extend(rotation.at(body).normalize().to_array()),
            // No other shape is offered to formulas.
            _ => {}
        }
    }
    numbers
}

/// All numbers of the host for a body.
pub(crate) fn host_of(values: Values<'_>, body: usize, frame: &BodyFrame) -> Vec<f64> {
    let mut numbers = host_numbers(frame);
    numbers.extend(numbers_of_body(values.values, body));
    numbers
}
