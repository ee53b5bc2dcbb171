//! Torques resolved to columns.

use glam::DQuat;

use super::formula::Role;
use super::kind::Kind;
use super::{Torque, VelocityDependence};
use crate::batch::BodyFrame;
use crate::clock::{Clock, Fraction, RATE_DIGITS, digits};
use crate::real::Scalar;

/// The column of a ramp's parameters that holds ramps per tick.
pub(crate) const PER_TICK: usize = 12;

/// Where the instances of one kind have their columns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Instances {
    /// Number of instances.
    pub count: usize,
    /// First parameter column of the first instance; those of the others follow.
    pub first: usize,
    first_phase: usize,
}

/// One instance, for a loop over what there is rather than over all that there could be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Instance {
    pub kind: Kind,
    /// Its number among those of its kind.
    pub index: usize,
    /// Its first parameter column.
    pub first: usize,
}

/// The torques of a scene as a kernel sees them: how many of each kind, and where their columns are.
///
/// The columns stand behind the bodies' own in [`crate::batch::Batch::parameters`].
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueTable {
    clock: Clock,
    kinds: [Instances; Kind::ALL.len()],
    columns: usize,
    phases: Vec<PhaseRates>,
    /// The kinds of the scene's torques, in their order: to find one may take a look at all bodies.
    torque_kinds: Vec<Kind>,
    /// All instances, in the order of their kinds.
    list: Vec<Instance>,
    /// Whether moments of inertia change in time.
    varies_inertia: bool,
    /// Whether every body's axes turn at I⁻¹ m with the moments that it starts with.
    is_rigid: bool,
}

/// The exact rate of one phase of one instance; of a ramp the tick at which it starts.
#[derive(Clone, Debug, PartialEq)]
enum PhaseRates {
    Shared(u128),
    PerBody(Vec<u128>),
}

impl TorqueTable {
    /// The table of no torque, over a span of `span` seconds.
    pub fn none(span: f64) -> Self {
        Self::new(&[], 0, 0, span, false)
    }

    /// The layout of `torques` with columns from `first_column` on, for bodies of which there are `stride` rows;
    /// `has_linear_rotors` says whether one of them is a linear rotor.
    pub(crate) fn new(
        torques: &[Torque],
        first_column: usize,
        stride: usize,
        span: f64,
        has_linear_rotors: bool,
    ) -> Self {
        let mut table = Self {
            clock: Clock::new(span),
            kinds: [Instances::default(); Kind::ALL.len()],
            columns: 0,
            phases: Vec::new(),
            torque_kinds: torques.iter().map(Torque::kind).collect(),
            list: Vec::new(),
            varies_inertia: false,
            is_rigid: true,
        };
        for &kind in &table.torque_kinds {
            let instances = &mut table.kinds[kind as usize];
            instances.count = if kind.merges() { 1 } else { instances.count + 1 };
        }
        table.varies_inertia =
            [Kind::InertiaRamp, Kind::InertiaOscillation].map(|kind| table.instances(kind).count) != [0, 0];
        table.is_rigid = !table.varies_inertia && table.instances(Kind::InternalDissipation).count == 0;
        // A constant torque is projected in its columns, and drag has no part along an axis without spin.
        table.kinds[Kind::LinearRotor as usize].count = usize::from(has_linear_rotors && !table.is_common());
        for &kind in Kind::ALL {
            let instances = &mut table.kinds[kind as usize];
            instances.first = first_column + table.columns;
            instances.first_phase = table.phases.len();
            table.columns += instances.count * kind.columns();
            let first = instances.first;
            let instance = |index| Instance { kind, index, first: first + index * kind.columns() };
            table.list.extend((0..instances.count).map(instance));
            let of_kind = torques.iter().zip(&table.torque_kinds).filter(|(_, of)| **of == kind && kind.phases() > 0);
            for (torque, _) in of_kind {
                let (model, values) = torque.parts();
                for phase in 0..kind.phases() {
                    table.phases.push(if torque.phase_rates_are_shared() {
                        PhaseRates::Shared(table.exact_rate(kind, model.phase_rates(values, 0)[phase]))
                    } else {
                        PhaseRates::PerBody(vec![0; stride])
                    });
                }
            }
        }
        table
    }

    /// The clock at the start of the run.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// Where the instances of a kind have their columns.
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

    /// Whether there is nothing but torques that are constant in body axes and linear drag.
    pub fn is_common(&self) -> bool {
        Kind::ALL
            .iter()
            .all(|&kind| self.instances(kind).count == 0 || matches!(kind, Kind::ConstantBody | Kind::LinearDrag))
    }

    /// How the torques together depend on the angular velocity.
    pub fn velocity_dependence(&self) -> VelocityDependence {
        let kinds = self.list.iter().map(|instance| instance.kind);
        let mut reading = kinds.filter(|kind| kind.role() == Role::Torque && kind.needs().angular_velocity);
        match (reading.next(), reading.next()) {
            (None, _) => VelocityDependence::None,
            (Some(Kind::LinearDrag), None) => VelocityDependence::LinearDrag,
            _ => VelocityDependence::General,
        }
    }

    /// Hands one body's row to `store(column, number)`, for every column of the table, and gives the exact rates of those of its
    /// phases whose rates are the body's own, in their order. `body` is its index in the scene.
    pub(crate) fn write_body(
        &self,
        torques: &[Torque],
        body: usize,
        frame: &BodyFrame,
        orientation: DQuat,
        mut store: impl FnMut(usize, f64),
    ) -> Vec<u128> {
        let mut row = Vec::new();
        let mut exact = Vec::new();
        for &kind in Kind::ALL {
            let instances = self.instances(kind);
            if instances.count == 0 {
                continue;
            }
            row.clear();
            row.resize(instances.count * kind.columns(), 0.0);
            let of_kind = torques.iter().zip(&self.torque_kinds).filter(|(_, of)| **of == kind);
            for (index, (torque, _)) in of_kind.enumerate() {
                let start = if kind.merges() { 0 } else { index * kind.columns() };
                let own = &mut row[start..start + kind.columns()];
                let (model, values) = torque.parts();
                model.columns(values, body, frame, orientation, own);
                let rates = model.phase_rates(values, body);
                for (phase, &rates) in rates[..kind.phases()].iter().enumerate() {
                    let rate = self.exact_rate(kind, rates);
                    let number = self.phase_number(kind, index, phase);
                    if matches!(self.phases[number], PhaseRates::PerBody(_)) {
                        exact.push(rate);
                    }
                    let columns = &mut own[kind.parameters() + phase * (RATE_DIGITS + 1)..];
                    columns[..RATE_DIGITS].copy_from_slice(&digits(rate));
                    columns[RATE_DIGITS] = rates.0 / std::f64::consts::TAU;
                    if kind == Kind::InertiaRamp {
                        columns[RATE_DIGITS] = rates.1.recip();
                        own[PER_TICK] = (rates.1 * self.clock.ticks_per_second()).recip();
                    }
                }
            }
            if kind == Kind::LinearRotor {
                row.fill(if frame.is_linear_rotor { 0.0 } else { 1.0 });
            }
            for (column, &number) in row.iter().enumerate() {
                store(instances.first + column, number);
            }
        }
        exact
    }

    /// Sets the exact rates of the rows from `first` on, row by row as [`TorqueTable::write_body`] gives them.
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

    /// What a kernel needs to know of a phase exactly, from its rate in two words or from a ramp's start and duration.
    fn exact_rate(&self, kind: Kind, (high, low): (f64, f64)) -> u128 {
        if kind == Kind::InertiaRamp { u128::from(self.clock.ticks_at(high)) } else { self.clock.rate(high, low) }
    }

    /// Whether every body's axes turn at I⁻¹ m with the moments that it starts with.
    #[inline(always)]
    pub fn is_rigid(&self) -> bool {
        self.is_rigid
    }

    /// Whether moments of inertia change in time.
    #[inline(always)]
    pub(crate) fn varies_inertia(&self) -> bool {
        self.varies_inertia
    }

    /// Columns of ratios, which are 1 in the rows that are no bodies, as kernels divide by them.
    pub(crate) fn ratio_columns(&self) -> impl Iterator<Item = usize> + use<> {
        let of_inertia = [Kind::InertiaRamp, Kind::InertiaOscillation].map(|kind| (kind, self.instances(kind)));
        of_inertia.into_iter().flat_map(|(kind, instances)| {
            (0..instances.count)
                .flat_map(move |index| (0..3).map(move |axis| instances.first + index * kind.columns() + axis))
        })
    }

    /// Number of phases of all instances.
    pub(crate) fn phase_count(&self) -> usize {
        self.phases.len()
    }

    /// The number of a phase among all, in the order of the list of instances.
    #[inline(always)]
    pub(crate) fn phase_number(&self, kind: Kind, instance: usize, phase: usize) -> usize {
        self.instances(kind).first_phase + instance * kind.phases() + phase
    }

    /// The first column of the ramp of inertia whose progress stands in a phase's place.
    #[inline(always)]
    pub(crate) fn ramp_of(&self, number: usize) -> Option<usize> {
        let ramp = self.instances(Kind::InertiaRamp);
        (ramp.count > 0 && number == ramp.first_phase).then_some(ramp.first)
    }

    /// The exact rate of a phase by its number, for the bodies from `first` on.
    #[inline(always)]
    pub(crate) fn fraction(&self, number: usize, first: usize) -> Fraction<'_> {
        match &self.phases[number] {
            PhaseRates::Shared(fraction) => Fraction::Shared(*fraction),
            PhaseRates::PerBody(fractions) => Fraction::PerBody(&fractions[first..]),
        }
    }

    /// Whether all bodies have the same rate of a phase, by its number.
    pub(crate) fn rate_is_shared(&self, number: usize) -> bool {
        matches!(self.phases[number], PhaseRates::Shared(_))
    }

    /// The column of a phase's rounded rate, turns/s, or ramps/s.
    #[inline(always)]
    pub(crate) fn rate_column(&self, kind: Kind, instance: usize, phase: usize) -> usize {
        let first = self.instances(kind).first + instance * kind.columns();
        first + kind.parameters() + phase * (RATE_DIGITS + 1) + RATE_DIGITS
    }
}

/// The rate (rad/s) to which the torques bring a body from rest, in about a radian; 0 without torques.
pub(crate) fn rate_of(torques: &[Torque], body: usize, middle_moment: f64) -> f64 {
    torques
        .iter()
        .map(|torque| torque.parts())
        .map(|(model, values)| model.rate(values, body, middle_moment))
        .filter(|rate| rate.is_finite())
        .fold(0.0, f64::max)
}

/// Bytes that the table takes for one body beside the columns.
pub(crate) fn bytes_per_body<T: Scalar>(table: &TorqueTable) -> usize {
    let per_body = table.phases.iter().filter(|rates| matches!(rates, PhaseRates::PerBody(_))).count();
    table.columns * size_of::<T>() + per_body * size_of::<u128>()
}
