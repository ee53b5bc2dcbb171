//! The sum of a scene's torques. Twin: `shaders/torque/sum.wgsl`.

mod held;
mod turning;

pub(crate) use held::{Held, of_kinds};

use std::cell::Cell;

use super::constant_body::constant_body;
use super::constant_world::constant_world;
use super::eddy_current::eddy_current;
use super::gravity_gradient::gravity_gradient;
use super::gravity_gradient_kepler::gravity_gradient_kepler;
use super::heavy_top::heavy_top;
use super::linear_drag::linear_drag;
use super::linear_rotor::across_axis;
use super::log_spring::log_spring;
use super::magnetic_dipole::magnetic_dipole;
use super::matrix_drag::matrix_drag;
use super::orbiting_dipole::{DipoleField, orbiting_dipole};
use super::quadratic_drag::quadratic_drag;
use super::sine_spring::sine_spring;
use super::sinusoidal::sinusoidal;
use super::table::Instance;
use super::white_noise::{NoiseKey, minus_log, noise_words, normal_vector, uniform_parts, uniform_turns};
use super::{Environment, Kind, Motion, TorqueTable, VelocityDependence};
use crate::batch::RATE_COLUMN;
use crate::clock::{Clock, Instant, phase, phase_after, phases_at, ticks_in};
use crate::method::rk8_adaptive::Timed;
use crate::quaternion::Quaternion;
use crate::real::{Outlined, Real, Scalar};
use crate::rigid_body::{Body, Correction};
use crate::vector::{TwoWords, Vector};

/// A torque that is constant in body axes, and linear drag: the set that most scenes have, held in registers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Common<R> {
    constant: Vector<R>,
    drag: R,
}

impl<R: Real> Common<R> {
    /// The parameters of a lane group; `column` loads a parameter column.
    #[inline(always)]
    pub(crate) fn load(table: &TorqueTable, column: impl Fn(usize) -> R) -> Self {
        let constant = table.instances(Kind::ConstantBody);
        let drag = table.instances(Kind::LinearDrag);
        Self {
            constant: if constant.count == 0 {
                Vector::zero()
            } else {
                Vector::new(column(constant.first), column(constant.first + 1), column(constant.first + 2))
            },
            drag: if drag.count == 0 { R::splat(0.0) } else { column(drag.first) },
        }
    }
}

impl<R: Real> Environment<R> for Common<R> {
    type Epoch = ();
    const FREE: bool = false;

    #[inline(always)]
    fn epoch(&self, _: u64, _: f64) {}

    #[inline(always)]
    fn torque(&self, _: &(), _: &Body<R>, _: Quaternion<R>, angular_velocity_principal: Vector<R>) -> Vector<R> {
        angular_velocity_principal.axpy(-self.drag, self.constant)
    }

    #[inline(always)]
    fn velocity_dependence(&self) -> VelocityDependence {
        VelocityDependence::LinearDrag
    }

    #[inline(always)]
    fn drag_coefficient(&self) -> R {
        self.drag
    }
}

/// Any number of torques of any kind, read from columns. The counts are the same for all bodies, so that each branch goes
/// one way for a whole run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Torques<'a, R: Real> {
    table: &'a TorqueTable,
    parameters: &'a [R::Scalar],
    stride: usize,
    /// First body of the lane group.
    first: usize,
    /// At step 0 of the current interval.
    clock: Clock,
    /// A step in the clock's units.
    units: u128,
    /// A step in seconds.
    dt: f64,
    /// Room for the phases at the start of a step that each lane starts when it likes; empty for equal steps.
    start_phases: &'a [Cell<R>],
}

/// A time, the random torque that is constant over the step that it belongs to, and the part of the change of the moments of
/// inertia that is done by then; 0 where they do not change.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Epoch<'a, R: Copy> {
    time: Time<'a, R>,
    noise: Vector<R>,
    change_done: R,
}

/// When torques are asked for.
#[derive(Clone, Copy, Debug)]
enum Time<'a, R: Copy> {
    /// At one instant for all lanes.
    Equal(Instant<R>),
    /// `elapsed` seconds after each lane's own start, where its phases are these, in turns.
    Own { start_phases: &'a [Cell<R>], elapsed: R },
}

/// The start of a step that each lane starts when it likes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StepStart<'a, R: Copy> {
    /// The phases there, in turns, by their number in the table.
    phases: &'a [Cell<R>],
    /// Seconds in a unit of the body's own time: a power of two.
    seconds: R,
}

impl<'a, R: Real> Torques<'a, R> {
    /// The torques on the lane group from body `first` on, in steps of `dt` seconds from `clock` on.
    #[inline(always)]
    pub(crate) fn new(
        table: &'a TorqueTable,
        parameters: &'a [R::Scalar],
        stride: usize,
        first: usize,
        clock: Clock,
        dt: f64,
    ) -> Self {
        Self { table, parameters, stride, first, clock, units: clock.units(dt), dt, start_phases: &[] }
    }

    /// The torques on the lane group from body `first` on, in steps of any size from `clock` on. `start_phases` has room
    /// for the table's phases.
    #[inline(always)]
    pub(crate) fn timed(
        table: &'a TorqueTable,
        parameters: &'a [R::Scalar],
        stride: usize,
        first: usize,
        clock: Clock,
        start_phases: &'a [Cell<R>],
    ) -> Self {
        Self { table, parameters, stride, first, clock, units: 0, dt: 0.0, start_phases }
    }

    #[inline(always)]
    fn column(&self, column: usize) -> R {
        R::load(&self.parameters[column * self.stride + self.first..])
    }

    #[inline(always)]
    fn vector(&self, column: usize) -> Vector<R> {
        Vector::new(self.column(column), self.column(column + 1), self.column(column + 2))
    }

    #[inline(always)]
    fn quaternion(&self, column: usize) -> Quaternion<R> {
        Quaternion::new(self.column(column), self.column(column + 1), self.column(column + 2), self.column(column + 3))
    }

    /// The first columns of all instances of a kind.
    #[inline(always)]
    fn firsts(&self, kind: Kind) -> impl Iterator<Item = (usize, usize)> + use<R> {
        let instances = self.table.instances(kind);
        (0..instances.count).map(move |index| (index, instances.first + index * kind.columns()))
    }

    #[inline(always)]
    fn phase(&self, kind: Kind, instance: usize, phase_index: usize, time: &Time<'a, R>) -> R {
        let rate = self.table.rate(kind, instance, phase_index, self.first, |column| self.column(column));
        match time {
            Time::Equal(instant) => phase(rate, instant),
            Time::Own { start_phases, elapsed } => {
                let start = start_phases[self.table.phase_number(kind, instance, phase_index)].get();
                phase_after(start, rate.turns_per_second, *elapsed)
            }
        }
    }

    /// Forms all phases at `time` (s, after the clock), lane by lane.
    #[inline(always)]
    fn form_start_phases(&self, time: TwoWords<R>) {
        let mut words = [[R::Scalar::default(); MOST_LANES]; 2];
        time.value.store(&mut words[0]);
        time.residue.store(&mut words[1]);
        let mut ticks = [0; MOST_LANES];
        for (lane, ticks) in ticks[..R::LANES].iter_mut().enumerate() {
            let time = TwoWords { value: words[0][lane], residue: words[1][lane] };
            *ticks = self.clock.ticks().wrapping_add(ticks_in(time, self.clock.ticks_per_second()));
        }
        for (number, phase) in self.start_phases.iter().enumerate() {
            let fraction = self.table.fraction(number, self.first);
            phase.set(match self.table.ramp_of(number) {
                Some(first) => self.progress_at(fraction, |lane| ticks[lane], first),
                None => phases_at(fraction, &ticks),
            });
        }
    }

    /// The torque of all instances of white noise over the step of an instant.
    #[inline(always)]
    fn noise(&self, step: u64) -> Vector<R> {
        let mut sum = Vector::zero();
        let inverse_root = R::splat(1.0 / self.dt.sqrt());
        for (_, first) in self.firsts(Kind::WhiteNoise) {
            let draws = self.parameters[(first + 1) * self.stride + self.first].to_f64() as u64;
            let mut draw_sum = Vector::zero();
            for draw in 0..draws {
                draw_sum = draw_sum + self.normal_vector(first, step.wrapping_mul(draws).wrapping_add(draw));
            }
            sum = draw_sum.axpy(self.column(first) * inverse_root, sum);
        }
        sum
    }

    /// One draw of every lane.
    #[inline(always)]
    fn normal_vector(&self, first: usize, draw: u64) -> Vector<R> {
        let word = |lane: usize, word: usize| {
            let digit = |column: usize| {
                self.parameters[(first + 2 + 2 * word + column) * self.stride + self.first + lane].to_f64() as u32
            };
            digit(0) | (digit(1) << 16)
        };
        let mut words = [[0_u32; 4]; MOST_LANES];
        for (lane, words) in words[..R::LANES].iter_mut().enumerate() {
            let key = NoiseKey { body: [word(lane, 0), word(lane, 1)], seed: [word(lane, 2), word(lane, 3)] };
            *words = noise_words(key, draw);
        }
        let logarithm = |index: usize| {
            minus_log(
                R::from_lanes(|lane| uniform_parts(words[lane][index]).0),
                R::from_lanes(|lane| uniform_parts(words[lane][index]).1),
            )
        };
        let angle = |index: usize| R::from_lanes(|lane| uniform_turns(words[lane][index]));
        normal_vector([logarithm(0), logarithm(2)], [angle(1), angle(3)])
    }

    #[inline(always)]
    fn sum(
        &self,
        epoch: &Epoch<'a, R>,
        orientation: Quaternion<R>,
        angular_velocity_principal: Vector<R>,
    ) -> Vector<R> {
        let (q, omega, time) = (orientation, angular_velocity_principal, &epoch.time);
        let mut sum = epoch.noise;
        for &Instance { kind, index, first: c } in self.table.list() {
            let torque = match kind {
                Kind::ConstantBody => constant_body(self.vector(c)),
                Kind::LinearDrag => linear_drag(self.column(c), omega),
                Kind::ConstantWorld => constant_world(self.vector(c), q),
                Kind::MatrixDrag => matrix_drag(self.vector(c), self.vector(c + 3), omega),
                Kind::QuadraticDrag => quadratic_drag(self.column(c), omega),
                Kind::Sinusoidal => sinusoidal(self.vector(c), self.vector(c + 3), self.phase(kind, index, 0, time)),
                Kind::GravityGradient => {
                    let phase = self.phase(kind, index, 0, time);
                    let coefficients = self.gradient_coefficients(c, epoch.change_done);
                    gravity_gradient(coefficients, self.vector(c + 3), self.vector(c + 6), phase, q)
                }
                Kind::GravityGradientKepler => {
                    let phase = self.phase(kind, index, 0, time);
                    let (x, y) = (self.vector(c + 3), self.vector(c + 6));
                    let (eccentricity, start) = (self.column(c + 10), self.column(c + 11));
                    let coefficients = self.gradient_coefficients(c, epoch.change_done);
                    gravity_gradient_kepler(coefficients, x, y, eccentricity, start, phase, q)
                }
                Kind::HeavyTop => heavy_top(self.vector(c), self.vector(c + 3), q),
                Kind::MagneticDipole => magnetic_dipole(self.vector(c), self.vector(c + 3), q),
                Kind::OrbitingDipole => {
                    let field = DipoleField {
                        x_world: self.vector(c + 3),
                        y_world: self.vector(c + 6),
                        eccentricity: self.column(c + 9),
                        start: self.column(c + 10),
                        sin_tilt: self.column(c + 11),
                        cos_tilt: self.column(c + 12),
                        azimuth: self.column(c + 13),
                    };
                    let orbit_phase = self.phase(kind, index, 0, time);
                    let rotation_phase = self.phase(kind, index, 1, time);
                    orbiting_dipole(self.vector(c), &field, orbit_phase, rotation_phase, q)
                }
                Kind::EddyCurrent => eddy_current(self.column(c), self.vector(c + 1), q, omega),
                Kind::SineSpring => sine_spring(self.column(c), self.quaternion(c + 1), q),
                Kind::LogSpring => log_spring(self.column(c), self.quaternion(c + 1), q),
                // The last of all: it holds for the whole sum.
                Kind::LinearRotor => {
                    sum = across_axis(self.column(c), sum);
                    continue;
                }
                // White noise belongs to the epoch, dissipation and the moments to the motion.
                Kind::WhiteNoise | Kind::InternalDissipation | Kind::InertiaRamp | Kind::InertiaOscillation => continue,
            };
            sum = sum + torque;
        }
        sum
    }
}

/// [`Torques::sum`] as a function of its own. What goes to such functions goes by reference: copies of it would cost more than most
/// torques.
struct Sum<'s, 'a, R: Real> {
    torques: &'s Torques<'a, R>,
    epoch: &'s Epoch<'a, R>,
    orientation: &'s Quaternion<R>,
    angular_velocity_principal: &'s Vector<R>,
}

impl<R: Real> Outlined for Sum<'_, '_, R> {
    type Output = Vector<R>;
    #[inline(always)]
    fn run(self) -> Vector<R> {
        self.torques.sum(self.epoch, *self.orientation, *self.angular_velocity_principal)
    }
}

/// [`Torques::form_start_phases`] as a function of its own.
struct FormStartPhases<'s, 'a, R: Real> {
    torques: &'s Torques<'a, R>,
    time: &'s TwoWords<R>,
}

impl<R: Real> Outlined for FormStartPhases<'_, '_, R> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        self.torques.form_start_phases(*self.time);
    }
}

/// [`Torques::noise`] as a function of its own.
struct Noise<'s, 'a, R: Real> {
    torques: &'s Torques<'a, R>,
    step: u64,
}

impl<R: Real> Outlined for Noise<'_, '_, R> {
    type Output = Vector<R>;
    #[inline(always)]
    fn run(self) -> Vector<R> {
        self.torques.noise(self.step)
    }
}

/// Lanes of the widest vector.
const MOST_LANES: usize = 16;

impl<'a, R: Real> Environment<R> for Torques<'a, R> {
    type Epoch = Epoch<'a, R>;
    const FREE: bool = false;

    #[inline(always)]
    fn epoch(&self, step: u64, fraction: f64) -> Epoch<'a, R> {
        let now = self.clock.now().wrapping_add(self.units.wrapping_mul(u128::from(step)));
        let step = self.clock.step().wrapping_add(step);
        let instant = Instant { ticks: (now >> 64) as u64, elapsed: R::splat(fraction * self.dt) };
        let noise = if self.table.instances(Kind::WhiteNoise).count == 0 {
            Vector::zero()
        } else {
            R::outlined(Noise { torques: self, step })
        };
        self.epoch_at(Time::Equal(instant), noise)
    }

    #[inline(always)]
    fn torque(
        &self,
        epoch: &Epoch<'a, R>,
        _: &Body<R>,
        orientation: Quaternion<R>,
        angular_velocity_principal: Vector<R>,
    ) -> Vector<R> {
        let (orientation, angular_velocity_principal) = (&orientation, &angular_velocity_principal);
        R::outlined(Sum { torques: self, epoch, orientation, angular_velocity_principal })
    }

    #[inline(always)]
    fn velocity_dependence(&self) -> VelocityDependence {
        self.table.velocity_dependence()
    }

    #[inline(always)]
    fn drag_coefficient(&self) -> R {
        let mut sum = R::splat(0.0);
        for (_, c) in self.firsts(Kind::LinearDrag) {
            sum = sum + self.column(c);
        }
        sum
    }

    #[inline(always)]
    fn motion(&self, epoch: &Epoch<'a, R>, body: &Body<R>, correction: &Correction<R>, m: Vector<R>) -> Motion<R> {
        self.turning_at(epoch, body, correction, m).motion
    }
}

impl<R: Real> Timed<R> for Common<R> {
    type Start = ();

    #[inline(always)]
    fn start_at(&self, _: TwoWords<R>) {}

    #[inline(always)]
    fn epoch_after(&self, (): &(), _: R) {}
}

impl<'a, R: Real> Timed<R> for Torques<'a, R> {
    type Start = StepStart<'a, R>;

    #[inline(always)]
    fn start_at(&self, time: TwoWords<R>) -> StepStart<'a, R> {
        let seconds = R::splat(1.0) / self.column(RATE_COLUMN);
        if !self.start_phases.is_empty() {
            let time = TwoWords { value: time.value * seconds, residue: time.residue * seconds };
            R::outlined(FormStartPhases { torques: self, time: &time });
        }
        StepStart { phases: self.start_phases, seconds }
    }

    #[inline(always)]
    fn epoch_after(&self, start: &StepStart<'a, R>, elapsed: R) -> Epoch<'a, R> {
        let time = Time::Own { start_phases: start.phases, elapsed: elapsed * start.seconds };
        self.epoch_at(time, Vector::zero())
    }
}
