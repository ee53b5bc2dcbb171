//! The equations of motion of a scene's bodies as one graph, from which their Taylor series follow.
//!
//! ```text
//! m' = m × ω + τ,   q' = ½ q ω,   ω = I⁻¹ m (and what internal dissipation adds)
//! ```
//!
//! in principal axes and in the units of each body's own scale ([`crate::engine::batch`]): a unit of time is the reciprocal of the
//! reference rate. If a torque depends on the position or the velocity of the centre of mass ([`super::coupled`]), these obey x' = v, v' =
//! a, in m and m/s along the world's axes and in the same unit of time. Inputs are the state, the columns of the batch by their numbers,
//! and the table's phases in turns by their numbers (for a ramp its progress), which advance uniformly; the time, if it is read, is in
//! seconds. Every formula records itself. For series, columns that the scene's parameters set to 0, 1 or −1 for all bodies are constants, so that an
//! orbit without eccentricity or a dipole without tilt has no terms of those.

use super::Kind;
use super::expressed::{Given, Whole};
use super::formula::{Epoch, Following, Formula, FormulaTask, MOST_PHASES, Role, Row};
use super::internal_dissipation::internal_dissipation;
use super::linear_rotor::across_axis;
use super::table::{Instance, TorqueTable};
use super::variable_inertia::{Change, ChangeAt, changed_motion};
use crate::bodies::columns::RATE_COLUMN;
use crate::expression::graph::{Binary, Operation, Unary};
use crate::expression::jet::{Equations, Lowered, lowered, lowered_by_directions};
use crate::expression::{Dependence, Fault, Graph, Input, InputKind, Node, Recorder, Symbol};
use crate::kernel::rigid_body::{Body, Correction};
use crate::kernel::torque_kernel::Motion;
use crate::math::quaternion::Quaternion;
use crate::math::real::{Function, Real};
use crate::math::vector::{TwoWords, Vector};

/// The equations of motion under the torques of a table.
#[derive(Clone, Debug)]
pub(crate) struct RecordedMotion {
    graph: Graph,
    momentum_rate: [Node; 3],
    angular_velocity: [Node; 3],
    /// The rates of the position and of the velocity, if they are states.
    centre: Option<[Node; 6]>,
    /// Whether a torque, or a force on a centre of mass that is a state, depends on the attitude.
    needs_attitude: bool,
    /// Whether phases advance alike for all bodies.
    is_time_shared: bool,
}

/// Operations of one evaluation that depend on more than parameters, in additions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Operations {
    pub all: f64,
    /// Operations that depend only on time and parameters, if the time is the same for all bodies: tiles with equal steps do them once.
    pub of_shared_time: f64,
}

/// The order at which ways to form series are compared, and the ratio of step lengths with directions and with orientations: a direction
/// turns at the rate of the body, an orientation's components at half of it, so that their steps are longer, by 6 to 12 % under a gravity
/// gradient on an ellipse at tolerances of 1e-13 to 1e-5.
const USUAL_ORDER: usize = 15;
const LONGER_STEPS: f64 = 1.1;

impl RecordedMotion {
    /// Records the torques of a table.
    ///
    /// # Errors
    ///
    /// If the formulas together have more operations than a graph may.
    pub fn new(table: &TorqueTable) -> Result<Self, Fault> {
        Self::record(table, false)
    }

    /// The same for series: columns that are 0, 1 or −1 for all bodies are taken as such, so that a field without tilt or an orbit without
    /// eccentricity has no terms of those.
    ///
    /// # Errors
    ///
    /// As [`RecordedMotion::new`].
    pub fn for_series(table: &TorqueTable) -> Result<Self, Fault> {
        Self::record(table, true)
    }

    fn record(table: &TorqueTable, knows_columns: bool) -> Result<Self, Fault> {
        let (graph, outputs) = Graph::record::<Fault>(|recorder| {
            let (omega, rate, centre) = recorded(table, recorder, knows_columns);
            let rotation = [rate, omega].map(|vector| [vector.x, vector.y, vector.z]).concat();
            Ok([rotation, centre.into_iter().flatten().collect()].concat())
        })?;
        let needs_attitude = graph.dependence_of(&outputs).intersects(Dependence::ATTITUDE);
        let part = |first: usize| [outputs[first], outputs[first + 1], outputs[first + 2]];
        let centre = outputs.get(6..12).map(|outputs| std::array::from_fn(|part| outputs[part]));
        let is_time_shared = (0..table.phase_count()).all(|phase| table.rate_is_shared(phase));
        Ok(Self { momentum_rate: part(0), angular_velocity: part(3), centre, graph, needs_attitude, is_time_shared })
    }

    /// Operations of one evaluation: a division or a root counts as ten additions, a function as twenty-five, sine and cosine of Kepler's
    /// equation as two hundred (fitted to `rk8` under gravity gradients on an ellipse and on a circle), unless the table says that the orbits
    /// of all bodies are circles. The table is that of the motion.
    pub fn operations(&self, table: &TorqueTable) -> Operations {
        let rotation = [self.momentum_rate, self.angular_velocity].concat();
        let outputs = [&rotation[..], self.centre.as_ref().map_or(&[], |rates| &rates[..])].concat();
        let is_zero = |node: Node| match self.graph.operation(node) {
            Operation::Input(input) if input.kind == InputKind::Parameter => {
                table.known(usize::from(input.index)) == Some(0.0)
            }
            _ => false,
        };
        let of_node = |node: Node| {
            if self.graph.dependence(node).is_within(Dependence::PARAMETERS) {
                return 0.0;
            }
            match self.graph.operation(node) {
                Operation::Constant(_) | Operation::Truth(_) | Operation::Input(_) => 0.0,
                Operation::Unary(Unary::Sqrt, _) | Operation::Binary(Binary::Div, ..) => 10.0,
                Operation::Function2(Function::KeplerSin | Function::KeplerCos, _, eccentricity) => {
                    if is_zero(eccentricity) { 12.5 } else { 100.0 }
                }
                Operation::Function(..) | Operation::Function2(..) => 25.0,
                _ => 1.0,
            }
        };
        let mut operations = Operations::default();
        for node in self.graph.live(&outputs) {
            let own = of_node(node);
            operations.all += own;
            if self.is_time_shared && self.graph.dependence(node).is_within(Dependence::TIME | Dependence::PARAMETERS) {
                operations.of_shared_time += own;
            }
        }
        operations
    }

    /// The operations, and the nodes of the components of dm/dt and of the rate at which the axes turn.
    pub fn graph(&self) -> (&Graph, [Node; 6]) {
        let ([a, b, c], [d, e, f]) = (self.momentum_rate, self.angular_velocity);
        (&self.graph, [a, b, c, d, e, f])
    }

    /// The motion as rows and operations on them. The states are the angular momentum; if torques depend on the attitude, the orientation
    /// or, if that is less work, the directions that they depend on; and, if torques depend on them, position and velocity. The results are
    /// the components of the angular velocity. `with_attitude`: the orientation is a state in any case.
    ///
    /// # Errors
    ///
    /// If a formula has no Taylor series.
    pub fn lowered(&self, with_attitude: bool) -> Result<Lowered, Fault> {
        let states = |kind| (0..3).map(move |part| Input::new(kind, part));
        let of_centre =
            states(InputKind::Position).chain(states(InputKind::Velocity)).zip(self.centre.into_iter().flatten());
        let equations = Equations {
            rates: states(InputKind::AngularMomentum).zip(self.momentum_rate).chain(of_centre).collect(),
            angular_velocity: Some(self.angular_velocity),
            has_orientation: self.needs_attitude || with_attitude,
            outputs: Vec::new(),
        };
        let whole = lowered(&self.graph, &equations)?;
        let may_replace = self.needs_attitude && !with_attitude;
        let by_directions = if may_replace { lowered_by_directions(&self.graph, &equations)? } else { None };
        let is_less =
            |other: &Lowered| LONGER_STEPS * other.step_seconds(USUAL_ORDER) < whole.step_seconds(USUAL_ORDER);
        Ok(by_directions.filter(is_less).unwrap_or(whole))
    }
}

/// ω and m', and x' and v' if they are states.
fn recorded(
    table: &TorqueTable,
    recorder: &Recorder,
    knows_columns: bool,
) -> (Vector<Symbol>, Vector<Symbol>, Option<[Symbol; 6]>) {
    let input = |kind, index: usize| recorder.input(Input::new(kind, index as u16));
    let vector = |kind, first: usize| Vector::new(input(kind, first), input(kind, first + 1), input(kind, first + 2));
    let part = |index| input(InputKind::Orientation, index);
    let recording =
        Recording { table, recorder, knows_columns, q: Quaternion::new(part(0), part(1), part(2), part(3)) };
    let inverse_moments = TwoWords { value: vector(InputKind::Parameter, 0), residue: Vector::zero() };
    let (body, m) = (Body::new(inverse_moments), vector(InputKind::AngularMomentum, 0));
    let change = table.change().map(|moments| {
        let row = recording.row(moments);
        let at = match table.formula_of_moments() {
            Some(formula) => {
                let none = Vector::zero();
                ChangeAt::by_formula(&row, recording.evaluated(moments, &formula.whole, none, none))
            }
            None => {
                let done = moments.kind.with(EpochOf { recording: &recording, instance: moments }).number;
                ChangeAt::smoothly_by_law(&row, done)
            }
        };
        (Change::of_row(&row), at)
    });
    let none = Correction::none();
    let mut motion = match &change {
        Some((change, at)) => changed_motion(&body, change, at.share, &none, m),
        None => Motion::rigid(body.angular_velocity(m, &none), body.gyroscopic_term(m, &none)),
    };
    if let Some(instance) = table.instance(Kind::InternalDissipation) {
        let slip = internal_dissipation(recording.row(instance).number(0), m, motion.angular_velocity);
        motion = motion.with_slip(m, slip);
    }
    let mut sum = Vector::zero();
    for instance in table.list() {
        let omega = motion.angular_velocity;
        sum = instance.kind.with(Added { recording: &recording, instance, change: change.as_ref(), omega, sum });
    }
    let centre = table.coupling().and_then(|(instance, formula)| {
        let ratio = change.as_ref().map_or(Vector::zero(), |(change, at)| change.moment_ratio(at.share));
        let acceleration = recording.evaluated(instance, formula.acceleration.as_ref()?, motion.axes_rate, ratio);
        let unit_of_time = Symbol::splat(1.0) / input(InputKind::Parameter, RATE_COLUMN);
        let [v, a] = [vector(InputKind::Velocity, 0), acceleration].map(|rate| rate * unit_of_time);
        Some([v.x, v.y, v.z, a.x, a.y, a.z])
    });
    (motion.axes_rate, motion.gyroscopic_term + sum, centre)
}

/// The inputs of formulas.
struct Recording<'a> {
    table: &'a TorqueTable,
    recorder: &'a Recorder,
    /// Whether columns that are known and phases that stand still are constants.
    knows_columns: bool,
    q: Quaternion<Symbol>,
}

impl Recording<'_> {
    fn row(&self, instance: &Instance) -> SymbolRow<'_> {
        SymbolRow { recording: self, first: instance.first }
    }

    /// A phase, not reduced to a turn: formulas of it are periodic.
    fn phase(&self, instance: &Instance, phase: usize) -> Symbol {
        if self.knows_columns && self.table.is_still(instance, phase) {
            return Symbol::splat(0.0);
        }
        self.recorder.input(Input::new(InputKind::Phase, (instance.first_phase + phase) as u16))
    }

    /// The results of an instance's formula, if it is data.
    fn evaluated(
        &self,
        instance: &Instance,
        Whole { graph: part, instructions }: &Whole,
        omega: Vector<Symbol>,
        ratio: Vector<Symbol>,
    ) -> Vector<Symbol> {
        let first = instance.kind.parameters();
        let given = |input: Input| {
            let inputs = instructions.program.inputs().iter().zip(&instructions.inputs);
            inputs.into_iter().find(|(known, _)| **known == input).map(|(_, given)| *given)
        };
        let q = self.q;
        let replayed = part.graph.replayed(&part.outputs, u16::MAX, |input| match given(input) {
            Some(Given::Column(column)) => self.row(instance).number(first + column),
            Some(Given::Phase(phase)) => self.phase(instance, phase),
            Some(Given::Orientation(part)) => [q.x, q.y, q.z, q.w][part],
            Some(Given::AngularVelocity(part)) => [omega.x, omega.y, omega.z][part],
            Some(Given::MomentRatio(part)) => [ratio.x, ratio.y, ratio.z][part],
            Some(Given::Position(part)) => self.recorder.input(Input::new(InputKind::Position, part as u16)),
            Some(Given::Velocity(part)) => self.recorder.input(Input::new(InputKind::Velocity, part as u16)),
            Some(Given::Time | Given::Epoch(_)) | None => self.recorder.input(Input::new(InputKind::Time, 0)),
        });
        Vector::new(replayed.outputs[0], replayed.outputs[1], replayed.outputs[2])
    }
}

/// The columns of one instance.
struct SymbolRow<'a> {
    recording: &'a Recording<'a>,
    first: usize,
}

impl Row<Symbol> for SymbolRow<'_> {
    fn number(&self, column: usize) -> Symbol {
        let Recording { table, recorder, knows_columns, .. } = self.recording;
        let column = self.first + column;
        match table.known(column) {
            Some(value) if *knows_columns => Symbol::splat(value),
            _ => recorder.input(Input::new(InputKind::Parameter, column as u16)),
        }
    }
}

/// What depends on the time, for one instance.
struct EpochOf<'s, 'a> {
    recording: &'s Recording<'a>,
    instance: &'s Instance,
}

impl FormulaTask for EpochOf<'_, '_> {
    type Output = Epoch<Symbol>;
    fn run<F: Formula>(self) -> Epoch<Symbol> {
        let Self { recording, instance } = self;
        let mut phases = [Symbol::splat(0.0); MOST_PHASES];
        for (number, phase) in phases.iter_mut().enumerate().take(F::PHASES.len()) {
            *phase = recording.phase(instance, number);
            if F::IS_PROGRESS {
                *phase = phase.max(Symbol::splat(0.0)).min(Symbol::splat(1.0));
            }
        }
        F::epoch(&recording.row(instance), phases)
    }
}

/// Adds one more torque to a sum.
struct Added<'s, 'a> {
    recording: &'s Recording<'a>,
    instance: &'s Instance,
    /// If the moments change: the change, and how far it has progressed.
    change: Option<&'s (Change<Symbol>, ChangeAt<Symbol>)>,
    omega: Vector<Symbol>,
    sum: Vector<Symbol>,
}

impl FormulaTask for Added<'_, '_> {
    type Output = Vector<Symbol>;
    fn run<F: Formula>(self) -> Vector<Symbol> {
        let Self { recording, instance, change, omega, sum } = self;
        let (row, q) = (recording.row(instance), recording.q);
        match F::ROLE {
            Role::Projection => across_axis(row.number(0), sum),
            Role::Expression => {
                let ratio = change.map_or(Vector::zero(), |(change, at)| change.moment_ratio(at.share));
                sum + recording.evaluated(instance, &recording.table.expressed(instance.index).whole, omega, ratio)
            }
            Role::Torque => {
                let at = EpochOf { recording, instance }.run::<F>();
                match change {
                    Some((_, change)) if F::FOLLOWS_MOMENTS => {
                        sum + F::torque(&Following { row: &row, gained: change.gained }, &at, q, omega)
                    }
                    _ => sum + F::torque(&row, &at, q, omega),
                }
            }
            // The moments and dissipation belong to the motion; noise is drawn only for equal steps.
            Role::Noise | Role::Slip | Role::Moments => sum,
        }
    }
}
