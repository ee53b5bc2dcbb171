//! Torques resolved to columns.

use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::Torque;
use super::expressed::{self, Expressed};
use super::formula::Role;
use super::kind::Kind;
use crate::bodies::BodyFrame;
use crate::bodies::columns::{CENTRE_COLUMNS, keep_rows};
use crate::kernel::torque_kernel::VelocityDependence;
use crate::math::clock::{Clock, Fraction, MOST_LANES, RATE_DIGITS, digits};
use crate::math::real::Scalar;

/// The column of a ramp's parameters that holds ramps per tick.
pub(crate) const PER_TICK: usize = 12;

/// The location of the columns of a kind's instances.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Instances {
    /// Number of instances.
    pub count: usize,
    /// First parameter column of the first instance; those of the others follow.
    pub first: usize,
    /// The index of the first instance in the list of all instances.
    place: usize,
}

/// One instance, for loops over the instances that exist rather than over all kinds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Instance {
    pub kind: Kind,
    /// Its number among those of its kind.
    pub index: usize,
    /// Its first parameter column.
    pub first: usize,
    /// Parameter columns.
    pub parameters: usize,
    /// The number of its first phase.
    pub first_phase: usize,
    /// Phases.
    pub phases: usize,
}

impl Instance {
    /// The column of a phase's rounded rate, turns/s, or ramps/s.
    #[inline(always)]
    pub fn rate_column(&self, phase: usize) -> usize {
        self.first + self.parameters + phase * (RATE_DIGITS + 1) + RATE_DIGITS
    }

    fn columns(&self) -> usize {
        self.parameters + self.phases * (RATE_DIGITS + 1)
    }
}

/// The torques of a scene as a kernel reads them: how many of each kind, and where their columns are.
///
/// The columns follow the bodies' own in [`crate::engine::batch::Batch::parameters`].
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueTable {
    clock: Clock,
    kinds: [Instances; Kind::ALL.len()],
    columns: usize,
    phases: Vec<PhaseRates>,
    /// The kinds of the scene's torques, in their order, kept because finding one may require a pass over all bodies.
    torque_kinds: Vec<Kind>,
    /// All instances, in the order of their kinds.
    list: Vec<Instance>,
    /// Whether moments of inertia change in time.
    varies_inertia: bool,
    /// Whether every body's axes turn at I⁻¹ m with its initial moments.
    is_rigid: bool,
    /// The formulas of the instances of [`Kind::Custom`], followed by that of the moments if they have one.
    expressions: Vec<Arc<Expressed>>,
    /// Columns that are 0, 1 or −1 for all bodies.
    known: Vec<(usize, f64)>,
}

/// The exact rate of one phase of one instance; for a ramp the tick at which it starts.
#[derive(Clone, Debug, PartialEq)]
enum PhaseRates {
    Shared(u128),
    PerBody(Vec<u128>),
}

impl TorqueTable {
    /// The empty table, over a span of `span` seconds.
    pub fn none(span: f64) -> Self {
        Self::new(&[], 0, 0, span, Bodies { have_linear_rotors: false, axes: None })
    }

    /// The layout of `torques` with columns from `first_column` on, for `stride` rows of bodies.
    pub(crate) fn new(torques: &[Torque], first_column: usize, stride: usize, span: f64, bodies: Bodies) -> Self {
        let mut table = Self {
            clock: Clock::new(span),
            kinds: [Instances::default(); Kind::ALL.len()],
            columns: 0,
            phases: Vec::new(),
            torque_kinds: torques.iter().map(Torque::kind).collect(),
            list: Vec::new(),
            varies_inertia: false,
            is_rigid: true,
            expressions: Vec::new(),
            known: Vec::new(),
        };
        for &kind in &table.torque_kinds {
            let instances = &mut table.kinds[kind as usize];
            instances.count = if kind.merges() { 1 } else { instances.count + 1 };
        }
        table.varies_inertia = Kind::CHANGES.into_iter().any(|kind| table.instances(kind).count > 0);
        let expressed = |of: Kind| {
            let own = torques.iter().zip(&table.torque_kinds).filter(move |(_, kind)| **kind == of);
            own.filter_map(|(torque, _)| torque.expressed(bodies.axes, table.varies_inertia))
        };
        table.expressions = expressed(Kind::Custom).chain(expressed(Kind::InertiaFormula)).collect();
        table.is_rigid = !table.varies_inertia && table.instances(Kind::InternalDissipation).count == 0;
        // A constant torque is projected in its columns, and drag has no component along an axis without spin.
        table.kinds[Kind::LinearRotor as usize].count = usize::from(bodies.have_linear_rotors && !table.is_common());
        for &kind in Kind::ALL {
            let count = table.instances(kind).count;
            let instances = &mut table.kinds[kind as usize];
            (instances.first, instances.place) = (first_column + table.columns, table.list.len());
            for index in 0..count {
                let of_formula = table.formula_of(kind, index).map_or((0, 0), |of| (of.columns(), of.phases()));
                let (parameters, phases) = (kind.parameters() + of_formula.0, kind.phases() + of_formula.1);
                let (first, first_phase) = (first_column + table.columns, table.phase_count());
                let instance = Instance { kind, index, first, parameters, first_phase, phases };
                table.columns += instance.columns();
                table.list.push(instance);
                // Kinds that merge have no phases.
                let torque = if phases > 0 { table.torque_of(torques, kind, index) } else { None };
                if let Some(torque) = torque {
                    table.known.extend(known_columns(torque, &instance));
                }
                let rates = torque.map_or_else(Vec::new, |torque| table.phase_rates(torque, &instance, 0, None));
                let is_shared = torque.is_some_and(|torque| match table.formula_of(kind, index) {
                    Some(formula) => torque.values_are_shared() && formula.rates_are_of_parameters(),
                    None => torque.phase_rates_are_shared(),
                });
                for &rates in rates.iter().take(phases) {
                    table.phases.push(if is_shared {
                        PhaseRates::Shared(table.exact_rate(kind, rates))
                    } else {
                        PhaseRates::PerBody(vec![0; stride])
                    });
                }
            }
        }
        table
    }

    /// The torque of one instance.
    fn torque_of<'t>(&self, torques: &'t [Torque], kind: Kind, index: usize) -> Option<&'t Torque> {
        torques.iter().zip(&self.torque_kinds).filter(|(_, of)| **of == kind).nth(index).map(|(torque, _)| torque)
    }

    /// Rates of an instance's phases in two words, rad/s; a formula's own rates depend on its frame if they differ by body.
    fn phase_rates(
        &self,
        torque: &Torque,
        instance: &Instance,
        body: usize,
        frame: Option<&BodyFrame>,
    ) -> Vec<(f64, f64)> {
        let (model, values) = torque.parts();
        let Some(formula) = self.formula_of(instance.kind, instance.index) else {
            return model.phase_rates(values, body)[..instance.phases].to_vec();
        };
        let frame = frame.copied().unwrap_or(BodyFrame::UNIT);
        let host = expressed::host_of(values, body, &frame);
        let mut unused = vec![0.0; formula.columns()];
        formula.row(&host, &mut unused).into_iter().map(|rate| (rate, 0.0)).collect()
    }

    /// The clock at the start of the run.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// The same for a session that starts at another time of the run.
    pub(crate) fn start_at(&mut self, clock: Clock) {
        self.clock = clock;
    }

    /// The location of the columns of a kind's instances.
    pub fn instances(&self, kind: Kind) -> Instances {
        self.kinds[kind as usize]
    }

    /// All instances, in the order of their kinds.
    pub(crate) fn list(&self) -> &[Instance] {
        &self.list
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Whether there is no torque.
    pub fn is_empty(&self) -> bool {
        self.columns == 0
    }

    /// Whether there are only torques that are constant in body axes, and linear drag.
    pub fn is_common(&self) -> bool {
        Kind::ALL
            .iter()
            .all(|&kind| self.instances(kind).count == 0 || matches!(kind, Kind::ConstantBody | Kind::LinearDrag))
    }

    /// How the sum of the torques depends on the angular velocity.
    pub fn velocity_dependence(&self) -> VelocityDependence {
        let reads = |instance: &&Instance| match instance.kind.role() {
            Role::Torque => instance.kind.needs().angular_velocity,
            Role::Expression => self.expressions[instance.index].needs().angular_velocity,
            Role::Noise | Role::Slip | Role::Moments | Role::Projection => false,
        };
        let mut reading = self.list.iter().filter(reads).map(|instance| instance.kind);
        match (reading.next(), reading.next()) {
            (None, _) => VelocityDependence::None,
            (Some(Kind::LinearDrag), None) => VelocityDependence::LinearDrag,
            _ => VelocityDependence::General,
        }
    }

    /// Passes one body's row to `store(column, number)`, for every column of the table, and appends to `exact`, in their order, the exact
    /// rates of those phases whose rates differ by body. `body` is its index in the scene; `row` is working memory.
    pub(crate) fn write_body(
        &self,
        torques: &[Torque],
        body: usize,
        (frame, orientation): (&BodyFrame, DQuat),
        (row, exact): (&mut Vec<f64>, &mut Vec<u128>),
        mut store: impl FnMut(usize, f64),
    ) {
        for instance in &self.list {
            let &Instance { kind, parameters, phases, first_phase, first, .. } = instance;
            row.clear();
            row.resize(instance.columns(), 0.0);
            let of_kind = torques.iter().zip(&self.torque_kinds).filter(|(_, of)| **of == kind);
            let own = of_kind.skip(if kind.merges() { 0 } else { instance.index });
            for (torque, _) in own.take(if kind.merges() { usize::MAX } else { 1 }) {
                let (model, values) = torque.parts();
                let mut set_rates = |row: &mut [f64], phase: usize, rates: (f64, f64)| {
                    let rate = self.exact_rate(kind, rates);
                    if matches!(self.phases[first_phase + phase], PhaseRates::PerBody(_)) {
                        exact.push(rate);
                    }
                    let columns = &mut row[parameters + phase * (RATE_DIGITS + 1)..];
                    columns[..RATE_DIGITS].copy_from_slice(&digits(rate));
                    columns[RATE_DIGITS] = rates.0 / std::f64::consts::TAU;
                    if kind == Kind::InertiaRamp {
                        columns[RATE_DIGITS] = rates.1.recip();
                        row[PER_TICK] = (rates.1 * self.clock.ticks_per_second()).recip();
                    }
                };
                if let Some(formula) = self.formula_of(kind, instance.index) {
                    let (own, of_formula) = row.split_at_mut(kind.parameters());
                    model.columns(values, body, frame, orientation, own);
                    let host = expressed::host_of(values, body, frame);
                    let rates = formula.row(&host, of_formula);
                    rates.into_iter().enumerate().for_each(|(phase, rate)| set_rates(row, phase, (rate, 0.0)));
                } else {
                    model.columns(values, body, frame, orientation, row);
                    if phases > 0 {
                        let rates = model.phase_rates(values, body).into_iter().take(phases).enumerate();
                        rates.for_each(|(phase, rates)| set_rates(row, phase, rates));
                    }
                }
            }
            if kind == Kind::LinearRotor {
                row.fill(if frame.is_linear_rotor { 0.0 } else { 1.0 });
            }
            for (column, &number) in row.iter().enumerate() {
                store(first + column, number);
            }
        }
    }

    /// Sets the exact rates of the rows from `first` on, row by row as [`TorqueTable::write_body`] returns them.
    pub(crate) fn set_rates(&mut self, first: usize, rates: &[u128]) {
        let count = self.phases.iter().filter(|rates| matches!(rates, PhaseRates::PerBody(_))).count();
        let columns = self.phases.iter_mut().filter_map(|rates| match rates {
            PhaseRates::PerBody(column) => Some(column),
            PhaseRates::Shared(_) => None,
        });
        for (phase, column) in columns.enumerate() {
            for (place, &rate) in column[first..].iter_mut().zip(rates.iter().skip(phase).step_by(count)) {
                *place = rate;
            }
        }
    }

    /// Keeps some rows, ascending, which move to the front in their order.
    pub(crate) fn keep(&mut self, rows: &[usize]) {
        for phase in &mut self.phases {
            if let PhaseRates::PerBody(column) = phase {
                let stride = column.len();
                keep_rows(column, stride, rows);
            }
        }
    }

    /// The exact rate of a phase, from its rate in two words or from a ramp's start and duration.
    fn exact_rate(&self, kind: Kind, (high, low): (f64, f64)) -> u128 {
        if kind == Kind::InertiaRamp { u128::from(self.clock.ticks_at(high)) } else { self.clock.rate(high, low) }
    }

    /// Whether every body's axes turn at I⁻¹ m with its initial moments.
    #[inline(always)]
    pub(crate) fn is_rigid(&self) -> bool {
        self.is_rigid
    }

    /// Whether moments of inertia change in time.
    #[inline(always)]
    pub(crate) fn varies_inertia(&self) -> bool {
        self.varies_inertia
    }

    /// Columns of ratios by which kernels divide; they are 1 in rows that are not bodies.
    pub(crate) fn ratio_columns(&self) -> impl Iterator<Item = usize> + use<> {
        let of_inertia = Kind::CHANGES.map(|kind| (kind, self.instances(kind)));
        of_inertia.into_iter().flat_map(|(kind, instances)| {
            (0..instances.count)
                .flat_map(move |index| (0..3).map(move |axis| instances.first + index * kind.columns() + axis))
        })
    }

    /// Number of phases of all instances.
    pub(crate) fn phase_count(&self) -> usize {
        self.phases.len()
    }

    /// The only instance of a kind that a table has at most once.
    #[inline(always)]
    pub(crate) fn instance(&self, kind: Kind) -> Option<&Instance> {
        let instances = self.instances(kind);
        if instances.count > 0 { self.list.get(instances.place) } else { None }
    }

    /// The formula of an instance of [`Kind::Custom`].
    #[inline(always)]
    pub(crate) fn expressed(&self, index: usize) -> &Expressed {
        &self.expressions[index]
    }

    /// The instance with whose formula the centre of mass is integrated, and that formula; if several use the position, they have the same.
    pub(crate) fn coupling(&self) -> Option<(&Instance, &Expressed)> {
        let formulas = self.list.iter().filter(|instance| instance.kind == Kind::Custom);
        let formulas = formulas.map(|instance| (instance, &*self.expressions[instance.index]));
        formulas.into_iter().find(|(_, formula)| formula.acceleration.is_some())
    }

    /// Whether the centre of mass is part of the state.
    pub fn is_coupled(&self) -> bool {
        self.coupling().is_some()
    }

    /// The formula of the moments, if they have one.
    #[inline(always)]
    pub(crate) fn formula_of_moments(&self) -> Option<&Expressed> {
        self.instance(Kind::InertiaFormula)?;
        self.expressions.last().map(|formula| &**formula)
    }

    /// The formula of an instance, if it is data.
    fn formula_of(&self, kind: Kind, index: usize) -> Option<&Arc<Expressed>> {
        match kind {
            Kind::Custom => self.expressions.get(index),
            Kind::InertiaFormula => self.expressions.last(),
            _ => None,
        }
    }

    /// All formulas that are data: those of [`Kind::Custom`] by their index, then that of the moments.
    pub(crate) fn expressions(&self) -> &[Arc<Expressed>] {
        &self.expressions
    }

    /// The instance by which the moments change.
    #[inline(always)]
    pub(crate) fn change(&self) -> Option<&Instance> {
        if !self.varies_inertia {
            return None;
        }
        Kind::CHANGES.into_iter().find_map(|kind| self.instance(kind))
    }

    /// Whether a formula reads the time itself.
    pub(crate) fn reads_time(&self) -> bool {
        self.expressions.iter().any(|expressed| expressed.reads_time())
    }

    /// Number of values that a lane group holds at the start of a step: phases, and the time if it is read.
    #[inline(always)]
    pub(crate) fn start_places(&self) -> usize {
        self.phase_count() + usize::from(self.reads_time())
    }

    /// The first column of the ramp of inertia whose progress takes the place of this phase.
    #[inline(always)]
    pub(crate) fn ramp_of(&self, number: usize) -> Option<usize> {
        self.instance(Kind::InertiaRamp).filter(|ramp| number == ramp.first_phase).map(|ramp| ramp.first)
    }

    /// The exact rate of a phase by its number, for the bodies from `first` on.
    #[inline(always)]
    pub(crate) fn fraction(&self, number: usize, first: usize) -> Fraction<'_> {
        match &self.phases[number] {
            PhaseRates::Shared(fraction) => Fraction::Shared(*fraction),
            PhaseRates::PerBody(fractions) => Fraction::PerBody(&fractions[first..]),
        }
    }

    /// The exact rates of a phase by its number, for the bodies in these rows; `room` receives them if they differ.
    #[inline(always)]
    pub(crate) fn fractions<'r>(
        &self,
        number: usize,
        rows: &[usize],
        room: &'r mut [u128; MOST_LANES],
    ) -> Fraction<'r> {
        match &self.phases[number] {
            PhaseRates::Shared(fraction) => Fraction::Shared(*fraction),
            PhaseRates::PerBody(fractions) => {
                for (place, &row) in room.iter_mut().zip(rows) {
                    *place = fractions[row];
                }
                Fraction::PerBody(room)
            }
        }
    }

    /// The value of a column if the scene's parameters say that it is 0, 1 or −1 for all bodies, of whichever it has columns.
    pub(super) fn known(&self, column: usize) -> Option<f64> {
        self.known.iter().find(|(known, _)| *known == column).map(|(_, value)| *value)
    }

    /// Whether a phase stays at 0 for all bodies.
    pub(super) fn is_still(&self, instance: &Instance, phase: usize) -> bool {
        instance.kind != Kind::InertiaRamp && self.phases[instance.first_phase + phase] == PhaseRates::Shared(0)
    }

    /// Whether all bodies have the same rate of a phase, by its number.
    pub(crate) fn rate_is_shared(&self, number: usize) -> bool {
        matches!(self.phases[number], PhaseRates::Shared(_))
    }
}

/// The columns of what depends on the time alone that are 0, 1 or −1 in any frame, if all parameters but factors are shared.
fn known_columns(torque: &Torque, instance: &Instance) -> Vec<(usize, f64)> {
    let (kind, own) = (instance.kind, instance.kind.parameters());
    if instance.parameters > own || !torque.geometry_is_shared() {
        return Vec::new();
    }
    let turned = DQuat::from_xyzw(0.1, -0.5, 0.7, 0.5).normalize();
    let moments = DVec3::new(1.1, 1.3, 1.7);
    let other = BodyFrame {
        scaled_moments: moments,
        principal_to_body: turned,
        moment_exponent: 3,
        rate_exponent: -2,
        ..BodyFrame::UNIT
    };
    let (model, values) = torque.parts();
    let columns = |frame: &BodyFrame, orientation| {
        let mut row = vec![0.0; instance.columns()];
        model.columns(values, 0, frame, orientation, &mut row);
        row
    };
    let pairs = columns(&BodyFrame::UNIT, DQuat::IDENTITY).into_iter().zip(columns(&other, turned)).enumerate();
    let is_known = |value: f64, other: f64| value == other && [0.0, 1.0, -1.0].contains(&value);
    let known = pairs.filter(|&(column, (value, other))| kind.epoch_reads(column) && is_known(value, other));
    known.map(|(column, (value, _))| (instance.first + column, value)).collect()
}

/// What the layout of torques needs to know of the bodies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bodies {
    /// Whether one of them is a linear rotor.
    pub have_linear_rotors: bool,
    /// The rotation from principal to body axes, if it is the same for all and a custom formula uses it.
    pub axes: Option<DQuat>,
}

/// The rate (rad/s) to which the torques bring a body from rest within about a radian; 0 without torques.
pub(crate) fn rate_of(torques: &[Torque], body: usize, middle_moment: f64) -> f64 {
    torques
        .iter()
        .map(|torque| torque.parts())
        .map(|(model, values)| model.rate(values, body, middle_moment))
        .filter(|rate| rate.is_finite())
        .fold(0.0, f64::max)
}

/// The greatest rate (1/s) at which the torques slow a body down.
pub(crate) fn damping_of(torques: &[Torque], body: usize, middle_moment: f64) -> f64 {
    let of_one = |torque: &Torque| {
        let (model, values) = torque.parts();
        model.damping(values, body, middle_moment)
    };
    torques.iter().map(of_one).filter(|rate| rate.is_finite()).fold(0.0, f64::max)
}

/// Bytes that the table takes for one body in addition to the columns.
pub(crate) fn bytes_per_body<T: Scalar>(table: &TorqueTable) -> usize {
    let per_body = table.phases.iter().filter(|rates| matches!(rates, PhaseRates::PerBody(_))).count();
    let of_centre = if table.is_coupled() { CENTRE_COLUMNS * size_of::<T>() } else { 0 };
    table.columns * size_of::<T>() + per_body * size_of::<u128>() + of_centre
}
