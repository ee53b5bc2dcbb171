//! Torques resolved to columns.

use glam::DQuat;

use super::{Torque, VelocityDependence};
use crate::batch::BodyFrame;
use crate::clock::{Clock, Fraction, RATE_DIGITS, Rate, digits};
use crate::real::{Real, Scalar};

/// What columns a model has and which kernel function reads them.
///
/// The order is that in which the sum is formed, in Rust and in WGSL.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(usize)]
pub enum Kind {
    /// [`super::constant_body`].
    ConstantBody,
    /// [`super::linear_drag`].
    LinearDrag,
    /// [`super::constant_world`].
    ConstantWorld,
    /// [`super::matrix_drag`].
    MatrixDrag,
    /// [`super::quadratic_drag`].
    QuadraticDrag,
    /// [`super::sinusoidal`].
    Sinusoidal,
    /// [`super::gravity_gradient`].
    GravityGradient,
    /// [`super::gravity_gradient_kepler`].
    GravityGradientKepler,
    /// [`super::heavy_top`].
    HeavyTop,
    /// [`super::magnetic_dipole`].
    MagneticDipole,
    /// [`super::orbiting_dipole`].
    OrbitingDipole,
    /// [`super::eddy_current`].
    EddyCurrent,
    /// [`super::sine_spring`].
    SineSpring,
    /// [`super::log_spring`].
    LogSpring,
    /// [`super::white_noise`].
    WhiteNoise,
    /// [`super::internal_dissipation`].
    InternalDissipation,
    /// [`super::linear_rotor`], which no [`Torque`] is: last, as it changes the sum of all others.
    LinearRotor,
}

impl Kind {
    /// All kinds, in order.
    pub const ALL: [Kind; 17] = [
        Kind::ConstantBody,
        Kind::LinearDrag,
        Kind::ConstantWorld,
        Kind::MatrixDrag,
        Kind::QuadraticDrag,
        Kind::Sinusoidal,
        Kind::GravityGradient,
        Kind::GravityGradientKepler,
        Kind::HeavyTop,
        Kind::MagneticDipole,
        Kind::OrbitingDipole,
        Kind::EddyCurrent,
        Kind::SineSpring,
        Kind::LogSpring,
        Kind::WhiteNoise,
        Kind::InternalDissipation,
        Kind::LinearRotor,
    ];

    /// The stem of its files, and of the `override` constants in `shaders/torque/sum.wgsl`.
    pub const fn stem(self) -> &'static str {
        match self {
            Kind::ConstantBody => "constant_body",
            Kind::LinearDrag => "linear_drag",
            Kind::ConstantWorld => "constant_world",
            Kind::MatrixDrag => "matrix_drag",
            Kind::QuadraticDrag => "quadratic_drag",
            Kind::Sinusoidal => "sinusoidal",
            Kind::GravityGradient => "gravity_gradient",
            Kind::GravityGradientKepler => "gravity_gradient_kepler",
            Kind::HeavyTop => "heavy_top",
            Kind::MagneticDipole => "magnetic_dipole",
            Kind::OrbitingDipole => "orbiting_dipole",
            Kind::EddyCurrent => "eddy_current",
            Kind::SineSpring => "sine_spring",
            Kind::LogSpring => "log_spring",
            Kind::WhiteNoise => "white_noise",
            Kind::InternalDissipation => "internal_dissipation",
            Kind::LinearRotor => "linear_rotor",
        }
    }

    /// Columns of one instance, without its phases.
    pub const fn parameters(self) -> usize {
        match self {
            Kind::LinearDrag | Kind::QuadraticDrag | Kind::InternalDissipation | Kind::LinearRotor => 1,
            Kind::ConstantBody | Kind::ConstantWorld => 3,
            Kind::EddyCurrent => 4,
            Kind::SineSpring | Kind::LogSpring => 5,
            Kind::MatrixDrag | Kind::Sinusoidal | Kind::HeavyTop | Kind::MagneticDipole => 6,
            Kind::GravityGradient => 9,
            Kind::WhiteNoise => 10,
            Kind::GravityGradientKepler => 11,
            Kind::OrbitingDipole => 14,
        }
    }

    /// Phases of one instance; each has [`RATE_DIGITS`] columns and one for the rounded rate.
    pub const fn phases(self) -> usize {
        match self {
            Kind::Sinusoidal | Kind::GravityGradient | Kind::GravityGradientKepler => 1,
            Kind::OrbitingDipole => 2,
            _ => 0,
        }
    }

    /// All columns of one instance.
    pub const fn columns(self) -> usize {
        self.parameters() + self.phases() * (RATE_DIGITS + 1)
    }

    /// Whether several instances are one with the sum of their parameters.
    pub const fn merges(self) -> bool {
        matches!(
            self,
            Kind::ConstantBody
                | Kind::LinearDrag
                | Kind::ConstantWorld
                | Kind::MatrixDrag
                | Kind::QuadraticDrag
                | Kind::InternalDissipation
        )
    }
}

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
    /// All instances, in the order of their kinds.
    list: Vec<Instance>,
}

/// The exact rate of one phase of one instance.
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
            list: Vec::new(),
        };
        for torque in torques {
            let kind = torque.model().kind();
            let instances = &mut table.kinds[kind as usize];
            instances.count = if kind.merges() { 1 } else { instances.count + 1 };
        }
        // A constant torque is projected in its columns, and drag has no part along an axis without spin.
        table.kinds[Kind::LinearRotor as usize].count = usize::from(has_linear_rotors && !table.is_common());
        for kind in Kind::ALL {
            let instances = &mut table.kinds[kind as usize];
            instances.first = first_column + table.columns;
            instances.first_phase = table.phases.len();
            table.columns += instances.count * kind.columns();
            let first = instances.first;
            let instance = |index| Instance { kind, index, first: first + index * kind.columns() };
            table.list.extend((0..instances.count).map(instance));
            for torque in torques.iter().filter(|torque| torque.model().kind() == kind && kind.phases() > 0) {
                for phase in 0..kind.phases() {
                    table.phases.push(if torque.model().phase_rates_are_shared() {
                        let (high, low) = torque.model().phase_rates(0)[phase];
                        PhaseRates::Shared(table.clock.rate(high, low))
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
        let has = |kind| self.instances(kind).count > 0;
        if [Kind::MatrixDrag, Kind::QuadraticDrag, Kind::EddyCurrent].into_iter().any(has) {
            VelocityDependence::General
        } else if has(Kind::LinearDrag) {
            VelocityDependence::LinearDrag
        } else {
            VelocityDependence::None
        }
    }

    /// Writes one body's row: `store(column, number)` for every column of the table. `body` is its index in the scene.
    pub(crate) fn write_body(
        &mut self,
        torques: &[Torque],
        body: usize,
        row_index: usize,
        frame: &BodyFrame,
        orientation: DQuat,
        mut store: impl FnMut(usize, f64),
    ) {
        let mut row = Vec::new();
        for kind in Kind::ALL {
            let instances = self.instances(kind);
            row.clear();
            row.resize(instances.count * kind.columns(), 0.0);
            let of_kind = torques.iter().filter(|torque| torque.model().kind() == kind);
            for (index, torque) in of_kind.enumerate() {
                let start = if kind.merges() { 0 } else { index * kind.columns() };
                let own = &mut row[start..start + kind.columns()];
                torque.model().columns(body, frame, orientation, own);
                let rates = torque.model().phase_rates(body);
                for (phase, &(high, low)) in rates[..kind.phases()].iter().enumerate() {
                    let rate = self.clock.rate(high, low);
                    if let PhaseRates::PerBody(column) =
                        &mut self.phases[instances.first_phase + index * kind.phases() + phase]
                    {
                        column[row_index] = rate;
                    }
                    let columns = &mut own[kind.parameters() + phase * (RATE_DIGITS + 1)..];
                    columns[..RATE_DIGITS].copy_from_slice(&digits(rate));
                    columns[RATE_DIGITS] = high / std::f64::consts::TAU;
                }
            }
            if kind == Kind::LinearRotor {
                row.fill(if frame.is_linear_rotor { 0.0 } else { 1.0 });
            }
            for (column, &number) in row.iter().enumerate() {
                store(instances.first + column, number);
            }
        }
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

    /// The exact rate of a phase by its number, for the bodies from `first` on.
    #[inline(always)]
    pub(crate) fn fraction(&self, number: usize, first: usize) -> Fraction<'_> {
        match &self.phases[number] {
            PhaseRates::Shared(fraction) => Fraction::Shared(*fraction),
            PhaseRates::PerBody(fractions) => Fraction::PerBody(&fractions[first..]),
        }
    }

    /// The rate of a phase of an instance for the bodies from `first` on; `column` loads a parameter column.
    #[inline(always)]
    pub(crate) fn rate<R: Real>(
        &self,
        kind: Kind,
        instance: usize,
        phase: usize,
        first: usize,
        column: impl Fn(usize) -> R,
    ) -> Rate<'_, R> {
        let instances = self.instances(kind);
        let fraction = self.fraction(self.phase_number(kind, instance, phase), first);
        let rounded =
            instances.first + instance * kind.columns() + kind.parameters() + phase * (RATE_DIGITS + 1) + RATE_DIGITS;
        Rate { fraction, turns_per_second: column(rounded) }
    }
}

/// The rate (rad/s) to which the torques bring a body from rest, in about a radian; 0 without torques.
pub(crate) fn rate_of(torques: &[Torque], body: usize, middle_moment: f64) -> f64 {
    torques
        .iter()
        .map(|torque| torque.model().rate(body, middle_moment))
        .filter(|rate| rate.is_finite())
        .fold(0.0, f64::max)
}

/// Bytes that the table takes for one body beside the columns.
pub(crate) fn bytes_per_body<T: Scalar>(table: &TorqueTable) -> usize {
    let per_body = table.phases.iter().filter(|rates| matches!(rates, PhaseRates::PerBody(_))).count();
    table.columns * size_of::<T>() + per_body * size_of::<u128>()
}
