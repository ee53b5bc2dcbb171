//! A formula of the user's own, prepared for the engines.
//!
//! The formula is written in SI units and along the body's axes; kernels work along principal axes and in each body's own units. The
//! change of axes and units is recorded with the formula, so that what does not depend on the state is computed once per body
//! ([`crate::expression::Stages`]), and what is the same for all bodies is a constant. If all bodies have the same principal axes, and
//! these are the body's own, nothing is left of the change of axes.

mod shader;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use glam::{DMat3, DQuat};

use super::{Needs, Value, Values};
use crate::bodies::BodyFrame;
use crate::bodies::inertia::InertiaTensor;
use crate::expression::{
    Dependence, Expression, Fault, Graph, Input, InputKind, Node, Part, Program, Recorder, Replayed, Shape, Stages,
    Symbol,
};
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// Indices of the numbers that the host knows of a body: the reference rate, then the torque's unit.
const RATE: usize = 0;
const UNIT: usize = 1;
/// Principal axes to body axes: the matrix by rows, then the quaternion of its inverse.
const MATRIX: usize = 2;
const TO_PRINCIPAL: usize = 11;
/// xx, yy, zz, xy, xz, yz, kg m², body axes.
const INERTIA: usize = 15;
/// Principal moments, kg m².
const MOMENTS: usize = 21;
/// The user's parameters.
const USER: usize = 24;

/// Where an evaluator finds an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Given {
    /// A column, counted from the instance's first.
    Column(usize),
    /// A phase of the instance.
    Phase(usize),
    /// The time, s.
    Time,
    /// A number computed from the time.
    Epoch(usize),
    /// A component of the orientation.
    Orientation(usize),
    /// A component of the angular velocity, principal axes, the body's own units.
    AngularVelocity(usize),
    /// A principal moment relative to its initial value.
    MomentRatio(usize),
    /// A component of the position of the centre of mass, m, world axes; then of its velocity, m/s. Only series have them.
    Position(usize),
    Velocity(usize),
}

/// Instructions, and the locations of their inputs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Instructions {
    pub program: Program,
    pub inputs: Vec<Given>,
}

/// All results of a formula, as a graph and as instructions.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Whole {
    pub graph: Part,
    pub instructions: Instructions,
}

/// A recorded formula.
#[derive(Default)]
struct Recorded {
    /// The torque, or the relative increase of the reciprocal moments.
    results: Vec<Symbol>,
    /// See [`Expressed::slopes`].
    slopes: Vec<Symbol>,
    /// See [`Expressed::acceleration`].
    acceleration: Vec<Symbol>,
    /// The rates of the phases.
    rates: Vec<Symbol>,
}

/// A formula prepared for the engines.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Expressed {
    /// Indices of the host's numbers that are used as columns directly.
    raw: Vec<usize>,
    /// Computes the columns after them from the host's numbers, and the rates of the phases.
    derived: Program,
    rates: Program,
    /// What is computed once for each stage.
    pub epoch: Instructions,
    /// The torque, computed from the results of `epoch`.
    pub torque: Instructions,
    /// The torque in one piece, as a graph of what the instructions read.
    pub whole: Whole,
    /// For moments, their relative rates, 1/s; empty for a torque.
    pub slopes: Instructions,
    /// For a torque with which the centre of mass is integrated ([`super::coupled`]), the acceleration of the centre of mass, m/s², world
    /// axes.
    pub acceleration: Option<Whole>,
    needs: Needs,
}

impl Expressed {
    /// Prepares a formula of a torque. `axes` rotates principal to body axes if all bodies share the rotation, and `varies` says
    /// whether moments of inertia change in time. `acceleration` is that of the centre of mass, if it is integrated with the torque.
    ///
    /// # Errors
    ///
    /// If the result has more operations than a graph may have, or numbers that are not finite.
    pub fn new(
        expression: &Expression,
        acceleration: Option<&Expression>,
        axes: Option<DQuat>,
        varies: bool,
    ) -> Result<Self, Fault> {
        Self::recorded(expression.dependence(), |recorder| {
            let given = HostInputs::new(recorder, axes, varies);
            let (results, mut rates) = given.torque(expression.graph(), expression.outputs());
            let found = acceleration.map(|formula| given.replayed(formula.graph(), formula.outputs(), rates.len()));
            let Replayed { outputs: acceleration, rates: more } =
                found.unwrap_or(Replayed { outputs: Vec::new(), rates: Vec::new() });
            rates.extend(more);
            Ok(Recorded { results, acceleration, rates, ..Recorded::default() })
        })
    }

    /// Prepares a formula of moments: the relative increase of the reciprocal moments, and the relative rates of the moments.
    ///
    /// # Errors
    ///
    /// As [`Expressed::new`].
    pub fn of_moments(expression: &Expression, axes: Option<DQuat>) -> Result<Self, Fault> {
        let (graph, outputs) = expression.with_rates()?;
        Self::recorded(Dependence::TIME, |recorder| {
            let given = HostInputs::new(recorder, axes, false);
            let (results, slopes, rates) = given.moments(&graph, &outputs, expression.shape());
            Ok(Recorded { results, slopes, rates, ..Recorded::default() })
        })
    }

    /// Prepares a recorded formula.
    fn recorded(
        dependence: Dependence,
        record: impl FnOnce(&Recorder) -> Result<Recorded, Fault>,
    ) -> Result<Self, Fault> {
        let mut ends = [0; 3];
        let (graph, outputs) = Graph::record::<Fault>(|recorder| {
            let Recorded { results, slopes, acceleration, rates } = record(recorder)?;
            ends[0] = results.len();
            ends[1] = ends[0] + slopes.len();
            ends[2] = ends[1] + acceleration.len();
            Ok([results, slopes, acceleration, rates].concat())
        })?;
        let (outputs, rates) = outputs.split_at(ends[2]);
        let stages = graph.stages(outputs);
        let derived = Program::new(&stages.derived.graph, &stages.derived.outputs);
        let rates = Program::new(&graph, rates);
        let (main, rest) = stages.rest.outputs.split_at(ends[0]);
        let (slopes, acceleration) = rest.split_at(ends[1] - ends[0]);
        // The time-dependent values that the results themselves read.
        let read: Vec<usize> = (stages.rest.graph.inputs(main).iter())
            .filter(|input| input.kind == InputKind::Epoch)
            .map(|input| usize::from(input.index))
            .collect();
        let formed: Vec<Node> = read.iter().map(|&index| stages.epoch.outputs[index]).collect();
        let epoch = Program::new(&stages.epoch.graph, &formed);
        let torque = Program::new(&stages.rest.graph, main);
        let whole = at_once(&stages, main)?;
        let slopes = at_once(&stages, slopes)?;
        let acceleration = if acceleration.is_empty() { None } else { Some(at_once(&stages, acceleration)?) };
        let program = |part: &Part| Program::new(&part.graph, &part.outputs);
        let slopes = program(&slopes);
        let of_centre = acceleration.as_ref().map(program);
        let mut raw: Vec<usize> = [&epoch, &torque, &slopes]
            .into_iter()
            .chain(&of_centre)
            .flat_map(Program::inputs)
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
                InputKind::Epoch => Given::Epoch(read.partition_point(|&number| number < index)),
                InputKind::Orientation => Given::Orientation(index),
                InputKind::AngularVelocity => Given::AngularVelocity(index),
                InputKind::MomentRatio => Given::MomentRatio(index),
                InputKind::Position => Given::Position(index),
                InputKind::Velocity => Given::Velocity(index),
                // No other input is requested.
                _ => Given::Time,
            }
        };
        let instructions = |program: Program| {
            let inputs = program.inputs().iter().map(given).collect();
            Instructions { program, inputs }
        };
        let whole = Whole { instructions: instructions(program(&whole)), graph: whole };
        let acceleration = acceleration.zip(of_centre);
        let acceleration = acceleration.map(|(graph, program)| Whole { graph, instructions: instructions(program) });
        let (epoch, torque, slopes) = (instructions(epoch), instructions(torque), instructions(slopes));
        Ok(Self { derived, rates, epoch, torque, whole, slopes, acceleration, needs: needs(dependence), raw })
    }

    /// Parameter columns.
    pub fn columns(&self) -> usize {
        self.raw.len() + self.derived.output_count()
    }

    /// Phases.
    pub fn phases(&self) -> usize {
        self.rates.output_count()
    }

    /// Whether the rates of its phases depend only on the user's parameters, not on the body.
    pub fn rates_are_of_parameters(&self) -> bool {
        self.rates.inputs().iter().all(|input| usize::from(input.index) >= USER)
    }

    /// Whether the rate of a phase reads any of the user's numbers from `first` on.
    pub fn rates_read_from(&self, first: usize) -> bool {
        self.rates.inputs().iter().any(|input| usize::from(input.index) >= USER + first)
    }

    /// The host's numbers from which its columns are computed; [`user_number`] tells which of them are the user's.
    pub fn host_numbers_read(&self) -> Vec<usize> {
        let derived = self.derived.inputs().iter().map(|input| usize::from(input.index));
        let mut all: Vec<usize> = self.raw.iter().copied().chain(derived).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// The columns of many bodies, from the columns of the host's numbers.
    pub fn rows<'a>(&self, host: impl Fn(usize) -> &'a [f64], bodies: usize) -> Vec<Vec<f64>> {
        let read: Vec<&[f64]> = self.derived.inputs().iter().map(|input| host(usize::from(input.index))).collect();
        let raw = self.raw.iter().map(|&number| host(number)[..bodies].to_vec());
        raw.chain(self.derived.evaluate_columns(&read, bodies)).collect()
    }

    /// Whether it reads the time itself, not only phases.
    pub fn reads_time(&self) -> bool {
        let acceleration = self.acceleration.as_ref().map(|whole| &whole.instructions);
        let parts = [&self.whole.instructions, &self.slopes].into_iter().chain(acceleration);
        parts.into_iter().any(|part| part.inputs.contains(&Given::Time))
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
}

fn components(kind: InputKind, count: u16) -> impl Iterator<Item = Input> {
    (0..count).map(move |index| Input::new(kind, index))
}

/// The needs of a torque with this dependence.
pub(crate) fn needs(dependence: Dependence) -> Needs {
    Needs {
        attitude: dependence.intersects(Dependence::ATTITUDE),
        angular_velocity: dependence.intersects(Dependence::VELOCITY),
        time: dependence.intersects(Dependence::TIME),
        position: dependence.intersects(Dependence::POSITION),
    }
}

/// A body's initial tensor, kg m², body axes.
pub(crate) fn tensor_of(frame: &BodyFrame) -> InertiaTensor {
    let moments = DMat3::from_diagonal(frame.tensor_moments());
    let rotation = DMat3::from_quat(frame.principal_to_body);
    let tensor = rotation * moments * rotation.transpose();
    let [xx, yy, zz, xy, xz, yz] =
        [tensor.x_axis.x, tensor.y_axis.y, tensor.z_axis.z, tensor.y_axis.x, tensor.z_axis.x, tensor.z_axis.y]
            .map(|element| frame.scaled(element, -1, 0));
    InertiaTensor { xx, yy, zz, xy, xz, yz }
}

/// The index of a host number among the user's numbers, if it is one of those.
pub(crate) fn user_number(host: usize) -> Option<usize> {
    host.checked_sub(USER)
}

/// The host's numbers of a body, before those of the user.
pub(crate) fn host_numbers(frame: &BodyFrame) -> Vec<f64> {
    let axes = DMat3::from_quat(frame.principal_to_body).transpose().to_cols_array();
    let inverse = frame.principal_to_body.conjugate().to_array();
    let mut numbers = vec![frame.scaled(1.0, 0, -1), frame.scaled(1.0, 1, 2)];
    numbers.extend(axes);
    numbers.extend(inverse);
    numbers.extend(tensor_of(frame).to_array());
    numbers.extend(frame.tensor_moments().to_array().map(|moment| frame.scaled(moment, -1, 0)));
    numbers
}

/// The results as functions of all inputs, without values computed beforehand from the time.
fn at_once(stages: &Stages, outputs: &[Node]) -> Result<Part, Fault> {
    let (graph, outputs) = Graph::record::<Fault>(|recorder| {
        let whole = |input: Input| recorder.input(input);
        let formed = stages.epoch.graph.replayed(&stages.epoch.outputs, u16::MAX, whole).outputs;
        let results = stages.rest.graph.replayed(outputs, u16::MAX, |input| match input.kind {
            InputKind::Epoch => formed[usize::from(input.index)],
            _ => whole(input),
        });
        Ok(results.outputs)
    })?;
    Ok(Part { graph, outputs })
}

/// The inputs of a formula in SI units and along the body's axes, derived from what the host and the kernels have.
struct HostInputs<'a> {
    recorder: &'a Recorder,
    /// Rows of the matrix that rotates principal to body axes, and the inverse rotation.
    rows: [Vector<Symbol>; 3],
    to_principal: Quaternion<Symbol>,
    /// Elements xx, yy, zz, xy, xz, yz.
    inertia: [Symbol; 6],
}

impl<'a> HostInputs<'a> {
    fn new(recorder: &'a Recorder, axes: Option<DQuat>, varies: bool) -> Self {
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
                let [x, y, z, w] = inverse.to_array().map(constant);
                ([row(0), row(1), row(2)], Quaternion::new(x, y, z, w))
            }
        };
        let initial = |element: usize| host(INERTIA + element);
        let mut inertia = [0, 1, 2, 3, 4, 5].map(initial);
        if varies {
            let moment = |axis: usize| host(MOMENTS + axis) * input(InputKind::MomentRatio, axis);
            let moments = vector(moment(0), moment(1), moment(2));
            let element = |(row, column): (usize, usize)| rows[row].scaled_by(moments).dot(rows[column]);
            inertia = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(element);
        }
        Self { recorder, rows, to_principal, inertia }
    }

    fn input(&self, kind: InputKind, index: usize) -> Symbol {
        self.recorder.input(Input::new(kind, index as u16))
    }

    fn host(&self, number: usize) -> Symbol {
        self.input(InputKind::Parameter, number)
    }

    /// A torque along principal axes and in the body's own units, and the rates of its phases.
    fn torque(&self, graph: &Graph, outputs: &[Node]) -> (Vec<Symbol>, Vec<Symbol>) {
        let rows = &self.rows;
        let replayed = self.replayed(graph, outputs, 0);
        let torque = Vector::new(replayed.outputs[0], replayed.outputs[1], replayed.outputs[2]);
        let column = |axis: fn(&Vector<Symbol>) -> Symbol| Vector::new(axis(&rows[0]), axis(&rows[1]), axis(&rows[2]));
        let (x, y, z) = (column(|row| row.x), column(|row| row.y), column(|row| row.z));
        let torque = Vector::new(x.dot(torque), y.dot(torque), z.dot(torque)) * self.host(UNIT);
        (vec![torque.x, torque.y, torque.z], replayed.rates)
    }

    /// A formula of these inputs, in SI units and along the body's axes; its phases are numbered from `first_phase` on.
    fn replayed(&self, graph: &Graph, outputs: &[Node], first_phase: usize) -> Replayed {
        let rows = &self.rows;
        let q = |part| self.input(InputKind::Orientation, part);
        let attitude = Quaternion::new(q(0), q(1), q(2), q(3)).product(self.to_principal);
        let omega = |part| self.input(InputKind::AngularVelocity, part);
        let omega = Vector::new(omega(0), omega(1), omega(2));
        let omega = Vector::new(rows[0].dot(omega), rows[1].dot(omega), rows[2].dot(omega)) * self.host(RATE);
        let inertia = self.inertia;
        let momentum = Vector::new(
            Vector::new(inertia[0], inertia[3], inertia[4]).dot(omega),
            Vector::new(inertia[3], inertia[1], inertia[5]).dot(omega),
            Vector::new(inertia[4], inertia[5], inertia[2]).dot(omega),
        );
        let component = |vector: Vector<Symbol>, index| [vector.x, vector.y, vector.z][index];
        let replayed = graph.replayed(outputs, first_phase as u16, |asked| {
            let index = usize::from(asked.index);
            match asked.kind {
                InputKind::Orientation => [attitude.x, attitude.y, attitude.z, attitude.w][index],
                InputKind::AngularVelocity => component(omega, index),
                InputKind::AngularMomentum => component(momentum, index),
                _ => self.of_host(asked),
            }
        });
        // The formula's own names, which come first, are kept.
        self.recorder.name("attitude", &[attitude.x, attitude.y, attitude.z, attitude.w]);
        self.recorder.name("angular_velocity", &[omega.x, omega.y, omega.z]);
        self.recorder.name("angular_momentum", &[momentum.x, momentum.y, momentum.z]);
        replayed
    }

    /// Moments followed by their time derivatives: the results that [`Expressed::of_moments`] prepares, and the rates of the phases. A
    /// number is the factor of all three; a vector has them along the body's axes, which are the principal ones in some order.
    ///
    /// Moments that no body has become NaN, so that the body fails instead of turning on: those that are not positive or break the
    /// triangle inequality by more than [`TRIANGLE_ROUNDING`].
    fn moments(&self, graph: &Graph, outputs: &[Node], shape: Shape) -> (Vec<Symbol>, Vec<Symbol>, Vec<Symbol>) {
        let Replayed { outputs: found, rates } = graph.replayed(outputs, 0, |asked| self.of_host(asked));
        let (zero, one) = (Symbol::splat(0.0), Symbol::splat(1.0));
        let valid = |holds| Symbol::select(holds, one, -one).sqrt();
        if shape == Shape::Number {
            let (factor, slope) = (found[0], found[1]);
            let share = (one - factor) / factor * valid(zero.less_than(factor));
            return (vec![share; 3], vec![slope / factor; 3], rates);
        }
        let along = |first: usize| {
            let part = |axis: fn(&Vector<Symbol>) -> Symbol| {
                let [x, y, z] = self.rows.map(|row| axis(&row) * axis(&row));
                Vector::new(x, y, z).dot(Vector::new(found[first], found[first + 1], found[first + 2]))
            };
            [part(|row| row.x), part(|row| row.y), part(|row| row.z)]
        };
        let (moments, slopes) = (along(0), along(3));
        let [a, b, c] = moments;
        let reduced = Symbol::splat(1.0 - TRIANGLE_ROUNDING);
        let is_side = |side: Symbol, x: Symbol, y: Symbol| (side * reduced).less_than(x + y);
        let positive = zero.less_than(a) & zero.less_than(b) & zero.less_than(c);
        let valid = valid(positive & is_side(a, b, c) & is_side(b, c, a) & is_side(c, a, b));
        let share = |axis: usize| (self.host(MOMENTS + axis) - moments[axis]) / moments[axis] * valid;
        let slope = |axis: usize| slopes[axis] / moments[axis];
        ([0, 1, 2].map(share).to_vec(), [0, 1, 2].map(slope).to_vec(), rates)
    }

    /// An input that the host knows, or that kernels have directly.
    fn of_host(&self, asked: Input) -> Symbol {
        match asked.kind {
            InputKind::Inertia => self.inertia[usize::from(asked.index)],
            InputKind::Parameter => self.host(USER + usize::from(asked.index)),
            _ => self.recorder.input(asked),
        }
    }
}

/// How much, relative to itself, a moment may exceed the sum of the others: rounding in `f32`, which may affect a flat plate.
const TRIANGLE_ROUNDING: f64 = 1e-6;

/// Keyed by the bits of a rotation.
type ByAxes = Mutex<BTreeMap<[u64; 4], Arc<Expressed>>>;

/// A formula prepared for bodies of different principal axes, and for bodies that share their axes, keyed by these.
pub(crate) struct Preparations {
    /// For any axes: for constant moments, and for changing ones.
    general: [Arc<Expressed>; 2],
    by_axes: [ByAxes; 2],
}

impl Preparations {
    /// Prepares the formula with `form` for any axes, for moments that change and for those that do not.
    ///
    /// # Errors
    ///
    /// Those of `form`.
    pub fn new(form: impl Fn(bool) -> Result<Expressed, Fault>) -> Result<Self, Fault> {
        Ok(Self { general: [Arc::new(form(false)?), Arc::new(form(true)?)], by_axes: Default::default() })
    }

    /// For any axes and constant moments.
    pub fn general(&self) -> &Expressed {
        &self.general[0]
    }

    /// For these axes; `form` prepares what is missing.
    pub fn of(
        &self,
        axes: Option<DQuat>,
        varies: bool,
        form: impl FnOnce() -> Result<Expressed, Fault>,
    ) -> Arc<Expressed> {
        let general = &self.general[usize::from(varies)];
        let Some(axes) = axes else { return Arc::clone(general) };
        let mut by_axes = self.by_axes[usize::from(varies)].lock().unwrap_or_else(PoisonError::into_inner);
        let entry = by_axes.entry(axes.to_array().map(f64::to_bits));
        // Preparing with constants may fail where columns do not: a constant may not be finite, for instance.
        let formed = || form().map_or_else(|_| Arc::clone(general), Arc::new);
        Arc::clone(entry.or_insert_with(formed))
    }
}

/// The numbers of a body's parameters, in order.
pub(crate) fn numbers_of_body(values: &[Value], body: usize) -> Vec<f64> {
    let mut numbers = Vec::new();
    for value in values {
        match value {
            Value::Number(number) => numbers.push(number.at(body)),
            Value::Vector(vector) => numbers.extend(vector.at(body).to_array()),
            Value::Rotation(rotation) => numbers.extend(rotation.at(body).normalize().to_array()),
            // Formulas have no parameters of other shapes.
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
