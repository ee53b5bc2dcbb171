//! One torque alone, with its parameters in registers.
//!
//! A class of bodies on which nothing else acts has a kernel of its own. In the kernel of every kind ([`super::Torques`]) the torque is a
//! function that each stage of a step calls, with all registers put by and taken up again; that takes ten times as long as most torques
//! themselves. What such a torque makes of the time alone, it makes once for all stages at that time.

use super::columns::StepTime;
use super::{Columns, Kind};
use crate::batch::RATE_COLUMN;
use crate::clock::{phase_after, phases_at};
use crate::method::rk8_adaptive::Timed;
use crate::quaternion::Quaternion;
use crate::real::{Outlined, Real};
use crate::rigid_body::{Body, Correction};
use crate::torque::constant_body::constant_body;
use crate::torque::constant_world::constant_world;
use crate::torque::eddy_current::eddy_current;
use crate::torque::gravity_gradient_kepler::place_and_cube;
use crate::torque::heavy_top::heavy_top;
use crate::torque::internal_dissipation::internal_dissipation;
use crate::torque::linear_drag::linear_drag;
use crate::torque::log_spring::log_spring;
use crate::torque::magnetic_dipole::magnetic_dipole;
use crate::torque::matrix_drag::matrix_drag;
use crate::torque::orbit::{circular_place, gradient_torque};
use crate::torque::orbiting_dipole::DipoleField;
use crate::torque::quadratic_drag::quadratic_drag;
use crate::torque::sine_spring::sine_spring;
use crate::torque::sinusoidal::sinusoidal;
use crate::torque::variable_inertia::{Change, changed_motion, inertia_oscillation, inertia_ramp, ramp_progress};
use crate::torque::{Environment, Motion};
use crate::vector::{TwoWords, Vector};

/// Evaluates an expression with `KIND`, a constant, the number of the only torque's kind, and `otherwise` where there are several
/// torques, or one that [`super::Common`] takes; `otherwise` always in the crate's unit tests, which are compiled apart and would take
/// twice as long to build (`tests/kinds.rs` steps every kind both ways).
macro_rules! of_kinds {
    // Those that may act in steps of a body's own.
    (timed $table:expr, $number:ident => $then:expr, $otherwise:expr) => {
        $crate::torque::sum::of_kinds!(@match $table, $number, $then, $otherwise,
            ConstantWorld MatrixDrag QuadraticDrag Sinusoidal GravityGradient GravityGradientKepler HeavyTop MagneticDipole
            OrbitingDipole EddyCurrent SineSpring LogSpring InternalDissipation InertiaRamp InertiaOscillation)
    };
    ($table:expr, $number:ident => $then:expr, $otherwise:expr) => {
        $crate::torque::sum::of_kinds!(@match $table, $number, $then,
            $crate::torque::sum::of_kinds!(timed $table, $number => $then, $otherwise), WhiteNoise)
    };
    (@match $table:expr, $number:ident, $then:expr, $otherwise:expr, $($kind:ident)*) => {
        match $table.only_kind() {
            $(#[cfg(not(test))]
            Some($crate::torque::Kind::$kind) => {
                const $number: usize = $crate::torque::Kind::$kind as usize;
                $then
            })*
            _ => $otherwise,
        }
    };
}
pub(crate) use of_kinds;

/// The most parameters and phases of a kind.
const MOST: [usize; 2] = {
    let (mut parameters, mut phases, mut kind) = (0, 0, 0);
    while kind < Kind::ALL.len() {
        let kind_of = Kind::ALL[kind];
        if kind_of.parameters() > parameters {
            parameters = kind_of.parameters();
        }
        if kind_of.phases() > phases {
            phases = kind_of.phases();
        }
        kind += 1;
    }
    [parameters, phases]
};
const MOST_PARAMETERS: usize = MOST[0];
const MOST_PHASES: usize = MOST[1];

/// The torque of the kind with number `KIND`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Held<'a, R: Real, const KIND: usize> {
    columns: Columns<'a, R>,
    parameters: [R; MOST_PARAMETERS],
    /// Of its phases, turns/s; of a ramp ramps/s.
    rates: [R; MOST_PHASES],
}

/// The start of a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HeldStart<R> {
    /// Turns; of a ramp its progress.
    phases: [R; MOST_PHASES],
    noise: Vector<R>,
    /// Seconds in the unit that later times are given in.
    seconds: R,
}

/// What follows from the time alone: of an oscillating torque and of noise the torque in principal axes, of a place on an orbit its
/// direction or the field there in world axes, with (a/r)³; of moments that change the part of the change that is done.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HeldEpoch<R> {
    vector: Vector<R>,
    number: R,
}

impl<'a, R: Real, const KIND: usize> Held<'a, R, KIND> {
    /// The parameters of a lane group.
    #[inline(always)]
    #[cfg_attr(test, allow(dead_code))]
    pub(crate) fn load(columns: Columns<'a, R>) -> Self {
        let kind = Self::KIND;
        let first = columns.source.table.instances(kind).first;
        let zero = R::splat(0.0);
        let (mut parameters, mut rates) = ([zero; MOST_PARAMETERS], [zero; MOST_PHASES]);
        for (index, parameter) in parameters.iter_mut().enumerate().take(kind.parameters()) {
            *parameter = columns.column(first + index);
        }
        for (phase, rate) in rates.iter_mut().enumerate().take(kind.phases()) {
            *rate = columns.column(columns.source.table.rate_column(kind, 0, phase));
        }
        Self { columns, parameters, rates }
    }

    const KIND: Kind = Kind::ALL[KIND];

    #[inline(always)]
    fn vector(&self, first: usize) -> Vector<R> {
        Vector::new(self.parameters[first], self.parameters[first + 1], self.parameters[first + 2])
    }

    #[inline(always)]
    fn quaternion(&self, first: usize) -> Quaternion<R> {
        let p = &self.parameters;
        Quaternion::new(p[first], p[first + 1], p[first + 2], p[first + 3])
    }

    /// The phases at the start of a step.
    #[inline(always)]
    fn start_phases(&self, start: StepTime<'_, R>) -> [R; MOST_PHASES] {
        let kind = Self::KIND;
        let mut phases = [R::splat(0.0); MOST_PHASES];
        let numbered = phases.iter_mut().enumerate().take(kind.phases());
        match start {
            StepTime::Equal(_) => {
                let ticks = self.columns.ticks(start);
                for (index, phase) in numbered {
                    let table = self.columns.source.table;
                    let fraction = table.fraction(table.phase_number(kind, 0, index), self.columns.first);
                    *phase = if matches!(Self::KIND, Kind::InertiaRamp) {
                        self.columns.progress_at(fraction, &ticks, table.instances(kind).first)
                    } else {
                        phases_at(fraction, &ticks)
                    };
                }
            }
            // Once for twelve stages, and lane by lane.
            StepTime::Own(_) if kind.phases() > 0 => {
                self.columns.form_start_phases(start);
                for (index, phase) in numbered {
                    *phase = self.columns.start_phases[index].get();
                }
            }
            StepTime::Own(_) => {}
        }
        phases
    }

    #[inline(always)]
    fn at(&self, start: &HeldStart<R>, elapsed: R) -> HeldEpoch<R> {
        let p = &self.parameters;
        let phase = |index: usize| phase_after(start.phases[index], self.rates[index], elapsed);
        let (vector, number) = match Self::KIND {
            Kind::Sinusoidal => (sinusoidal(self.vector(0), self.vector(3), phase(0)), R::splat(0.0)),
            Kind::GravityGradient => (circular_place(self.vector(3), self.vector(6), phase(0)), R::splat(0.0)),
            Kind::GravityGradientKepler => {
                let (x_world, y_world) = (&self.vector(3), &self.vector(6));
                R::outlined(OrbitPlace { x_world, y_world, eccentricity: p[10], start: p[11], phase: phase(0) })
            }
            Kind::OrbitingDipole => {
                let field = &DipoleField::of_row(|index| p[index]);
                let at = FieldAt { field, orbit_phase: phase(0), rotation_phase: phase(1) };
                (R::outlined(at), R::splat(0.0))
            }
            Kind::WhiteNoise => (start.noise, R::splat(0.0)),
            Kind::InertiaRamp => {
                let progress = ramp_progress(start.phases[0], self.rates[0], elapsed);
                (Vector::zero(), inertia_ramp(progress))
            }
            Kind::InertiaOscillation => (Vector::zero(), inertia_oscillation(phase(0))),
            Kind::ConstantBody
            | Kind::LinearDrag
            | Kind::ConstantWorld
            | Kind::MatrixDrag
            | Kind::QuadraticDrag
            | Kind::HeavyTop
            | Kind::MagneticDipole
            | Kind::EddyCurrent
            | Kind::SineSpring
            | Kind::LogSpring
            | Kind::InternalDissipation
            | Kind::LinearRotor => (Vector::zero(), R::splat(0.0)),
        };
        HeldEpoch { vector, number }
    }
}

impl<R: Real, const KIND: usize> Environment<R> for Held<'_, R, KIND> {
    type Start = HeldStart<R>;
    type Epoch = HeldEpoch<R>;
    const FREE: bool = false;

    #[inline(always)]
    fn start(&self, step: u64) -> HeldStart<R> {
        let noise = if matches!(Self::KIND, Kind::WhiteNoise) { self.columns.noise(step) } else { Vector::zero() };
        HeldStart { phases: self.start_phases(StepTime::Equal(step)), noise, seconds: R::splat(1.0) }
    }

    #[inline(always)]
    fn epoch(&self, start: &HeldStart<R>, fraction: f64) -> HeldEpoch<R> {
        self.at(start, R::splat(fraction * self.columns.source.dt))
    }

    #[inline(always)]
    fn torque(&self, epoch: &HeldEpoch<R>, _: &Body<R>, q: Quaternion<R>, omega: Vector<R>) -> Vector<R> {
        let p = &self.parameters;
        match Self::KIND {
            Kind::ConstantBody => constant_body(self.vector(0)),
            Kind::LinearDrag => linear_drag(p[0], omega),
            Kind::ConstantWorld => constant_world(self.vector(0), q),
            Kind::MatrixDrag => matrix_drag(self.vector(0), self.vector(3), omega),
            Kind::QuadraticDrag => quadratic_drag(p[0], omega),
            Kind::Sinusoidal | Kind::WhiteNoise => epoch.vector,
            Kind::GravityGradient => gradient_torque(self.vector(0), epoch.vector, q),
            Kind::GravityGradientKepler => gradient_torque(self.vector(0) * epoch.number, epoch.vector, q),
            Kind::HeavyTop => heavy_top(self.vector(0), self.vector(3), q),
            Kind::MagneticDipole => magnetic_dipole(self.vector(0), self.vector(3), q),
            Kind::OrbitingDipole => magnetic_dipole(self.vector(0), epoch.vector, q),
            Kind::EddyCurrent => eddy_current(p[0], self.vector(1), q, omega),
            Kind::SineSpring => sine_spring(p[0], self.quaternion(1), q),
            Kind::LogSpring => log_spring(p[0], self.quaternion(1), q),
            // The first three are in the motion, the last takes from other torques.
            Kind::InternalDissipation | Kind::InertiaRamp | Kind::InertiaOscillation | Kind::LinearRotor => {
                Vector::zero()
            }
        }
    }

    #[inline(always)]
    fn motion(&self, epoch: &HeldEpoch<R>, body: &Body<R>, correction: &Correction<R>, m: Vector<R>) -> Motion<R> {
        if matches!(Self::KIND, Kind::InertiaRamp | Kind::InertiaOscillation) {
            let change = Change {
                kappa: self.vector(0),
                difference: TwoWords { value: self.vector(3), residue: self.vector(6) },
            };
            return changed_motion(body, &change, epoch.number, correction, m);
        }
        let omega = body.angular_velocity(m, correction);
        let rigid = Motion { angular_velocity: omega, gyroscopic_term: body.gyroscopic_term(m, correction) };
        if Self::KIND != Kind::InternalDissipation {
            return rigid;
        }
        let slip = internal_dissipation(self.parameters[0], m, omega);
        Motion {
            angular_velocity: rigid.angular_velocity + slip,
            gyroscopic_term: rigid.gyroscopic_term + m.cross(slip),
        }
    }
}

impl<R: Real, const KIND: usize> Timed<R> for Held<'_, R, KIND> {
    #[inline(always)]
    fn start_at(&self, time: TwoWords<R>) -> HeldStart<R> {
        let seconds = R::splat(1.0) / self.columns.column(RATE_COLUMN);
        let time = TwoWords { value: time.value * seconds, residue: time.residue * seconds };
        HeldStart { phases: self.start_phases(StepTime::Own(&time)), noise: Vector::zero(), seconds }
    }

    #[inline(always)]
    fn epoch_after(&self, start: &HeldStart<R>, elapsed: R) -> HeldEpoch<R> {
        self.at(start, elapsed * start.seconds)
    }
}

/// [`place_and_cube`] as a function of its own.
struct OrbitPlace<'s, R> {
    x_world: &'s Vector<R>,
    y_world: &'s Vector<R>,
    eccentricity: R,
    start: R,
    phase: R,
}

impl<R: Real> Outlined for OrbitPlace<'_, R> {
    type Output = (Vector<R>, R);
    #[inline(always)]
    fn run(self) -> (Vector<R>, R) {
        place_and_cube(*self.x_world, *self.y_world, self.eccentricity, self.start, self.phase)
    }
}

/// [`DipoleField::at`] as a function of its own.
struct FieldAt<'s, R> {
    field: &'s DipoleField<R>,
    orbit_phase: R,
    rotation_phase: R,
}

impl<R: Real> Outlined for FieldAt<'_, R> {
    type Output = Vector<R>;
    #[inline(always)]
    fn run(self) -> Vector<R> {
        self.field.at(self.orbit_phase, self.rotation_phase)
    }
}
