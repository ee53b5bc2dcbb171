//! The evaluations of one step on either side: of an engine by its tapped kernel, of its scalar twin by a torque kernel that records
//! its inputs and results.
//!
//! Bodies without torques are tapped under one of zero strength, so that their orientations are seen too: [`TorqueKernel::motion`] does
//! not read them.

use std::cell::RefCell;

use super::subject::Side;
use crate::engine::batch::{AnyBatch, Batch, load_body, load_state};
use crate::engine::tap::{Evaluations, MotionCall, TorqueCall, VIEWS};
use crate::engine::{End, unobserved};
use crate::error::Result;
use crate::kernel::method::cf4::Cf4;
use crate::kernel::method::clamped_euler::ClampedEuler;
use crate::kernel::method::dlm::Dlm;
use crate::kernel::method::explicit_euler::ExplicitEuler;
use crate::kernel::method::gyro_newton::GyroNewton;
use crate::kernel::method::implicit_midpoint::ImplicitMidpoint;
use crate::kernel::method::rk4::Rk4;
use crate::kernel::method::rk8::Rk8;
use crate::kernel::method::rk8_adaptive::{Controller, Timed, attempt};
use crate::kernel::method::spiral::Spiral;
use crate::kernel::method::splitting::Splitting;
use crate::kernel::method::{Method, Step};
use crate::kernel::rigid_body::{Body, Correction, Invariants, State, orientation_rate};
use crate::kernel::torque_kernel::{Motion, TorqueKernel, VelocityDependence};
use crate::math::clock::Clock;
use crate::math::of_either;
use crate::math::quaternion::Quaternion;
use crate::math::real::Scalar;
use crate::math::vector::{TwoWords, Vector, two_words, two_words_of};
use crate::scene::AdaptiveSteps;
use crate::torque::sum::{Source, Torques};

/// What is tapped: a step of a given length, s, or an attempt of one body towards a time, s.
#[derive(Clone, Copy, Debug)]
pub(super) enum Tap {
    Step { method: Method, dt: f64 },
    Attempt { steps: AdaptiveSteps, end: f64, controller: Controller<f64> },
}

impl Tap {
    /// The evaluations of an engine, as many as `expected` has; `None` if the engine has no tapped kernels.
    pub fn of_side(self, side: &Side<'_>, batch: &AnyBatch, expected: &Evaluations) -> Result<Option<Evaluations>> {
        let rows = VIEWS * expected.torques.len().max(expected.motions.len()).max(1);
        let repeated = batch.repeated(rows);
        let states = side.with(|engine| -> Result<_> {
            match self {
                Tap::Step { method, dt } => {
                    let Some(mut session) = engine.start_tapped(repeated, method)? else { return Ok(None) };
                    session.advance_to(End::of_steps(dt, 1), &mut unobserved)?;
                    session.read(0..rows).map(Some)
                }
                Tap::Attempt { steps, end, controller } => {
                    let Some(mut session) = engine.start_adaptive_tapped(repeated, steps)? else { return Ok(None) };
                    session.attempt(end, &mut vec![controller; rows])?;
                    session.read(0..rows).map(Some)
                }
            }
        })?;
        Ok(states.map(|states| Evaluations::from_rows(&states)))
    }

    /// The evaluations of the twin, for the first body of a batch.
    pub fn of_twin(self, batch: &AnyBatch) -> Evaluations {
        of_either!(AnyBatch, batch, batch => self.of_scalars(batch))
    }

    fn of_scalars<T: Scalar>(self, batch: &Batch<T>) -> Evaluations {
        let evaluations = RefCell::default();
        match self {
            Tap::Step { method, dt } => OneStep { batch, dt, evaluations: &evaluations }.by(method),
            Tap::Attempt { steps, end, controller } => {
                attempted(batch, &steps, &batch.torques.clock().at(end), &controller, &evaluations);
            }
        }
        let mut evaluations = evaluations.into_inner();
        let has_orientation_rates = match self {
            Tap::Step { method, .. } => steps_components(method),
            Tap::Attempt { .. } => true,
        };
        if has_orientation_rates {
            evaluations.orientation_rates = evaluations.torques.iter().map(orientation_rate_at).collect();
        }
        evaluations
    }
}

/// Whether the slopes of a method have a dq/dt, by which it moves the quaternion's components
/// ([`crate::kernel::method::slope::rates`]).
fn steps_components(method: Method) -> bool {
    match method {
        Method::Rk4 | Method::Rk8 => true,
        Method::Cf4
        | Method::Splitting2
        | Method::Splitting4
        | Method::Splitting6
        | Method::ImplicitMidpoint
        | Method::Dlm
        | Method::ExplicitEuler
        | Method::GyroNewton
        | Method::ClampedEuler
        | Method::Spiral
        | Method::Taylor => false,
    }
}

/// dq/dt in the methods in whose slopes it occurs.
fn orientation_rate_at(call: &TorqueCall) -> [f64; 4] {
    let ([x, y, z, w], [a, b, c]) = (call.orientation, call.angular_velocity);
    let rate = orientation_rate(Quaternion::new(x, y, z, w), Vector::new(a, b, c));
    [rate.x, rate.y, rate.z, rate.w]
}

/// Torques that record their inputs and results.
struct Tapped<'a, T: Scalar> {
    torques: Torques<'a, T>,
    /// Seconds in the unit of times after the start of a step.
    seconds: f64,
    evaluations: &'a RefCell<Evaluations>,
}

impl<T: Scalar> Clone for Tapped<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T: Scalar> Copy for Tapped<'_, T> {}

type StartOf<'a, T> = <Torques<'a, T> as TorqueKernel<T>>::Start;
type EpochOf<'a, T> = <Torques<'a, T> as TorqueKernel<T>>::Epoch;

fn numbers<T: Scalar>(v: Vector<T>) -> [f64; 3] {
    [v.x, v.y, v.z].map(Scalar::to_f64)
}

impl<'a, T: Scalar> TorqueKernel<T> for Tapped<'a, T> {
    type Start = StartOf<'a, T>;
    /// With the time since the start of the step, s.
    type Epoch = (EpochOf<'a, T>, f64);
    const FREE: bool = false;

    fn start(&self, step: u64) -> StartOf<'a, T> {
        self.torques.start(step)
    }

    fn epoch(&self, start: &StartOf<'a, T>, fraction: f64) -> (EpochOf<'a, T>, f64) {
        (self.torques.epoch(start, fraction), fraction * self.seconds)
    }

    fn torque(&self, epoch: &Self::Epoch, body: &Body<T>, q: Quaternion<T>, omega: Vector<T>) -> Vector<T> {
        let torque = self.torques.torque(&epoch.0, body, q, omega);
        self.evaluations.borrow_mut().torques.push(TorqueCall {
            elapsed: epoch.1,
            orientation: [q.x, q.y, q.z, q.w].map(Scalar::to_f64),
            angular_velocity: numbers(omega),
            torque: numbers(torque),
        });
        torque
    }

    fn velocity_dependence(&self) -> VelocityDependence {
        self.torques.velocity_dependence()
    }

    fn drag_coefficient(&self) -> T {
        self.torques.drag_coefficient()
    }

    fn motion(&self, epoch: &Self::Epoch, body: &Body<T>, correction: &Correction<T>, m: Vector<T>) -> Motion<T> {
        let motion = self.torques.motion(&epoch.0, body, correction, m);
        self.evaluations.borrow_mut().motions.push(MotionCall {
            angular_momentum: numbers(m),
            angular_velocity: numbers(motion.axes_rate),
            gyroscopic_term: numbers(motion.gyroscopic_term),
        });
        motion
    }
}

impl<'a, T: Scalar> Timed<T> for Tapped<'a, T> {
    fn start_at(&self, time: TwoWords<T>) -> StartOf<'a, T> {
        self.torques.start_at(time)
    }

    fn epoch_after(&self, start: &StartOf<'a, T>, elapsed: T) -> Self::Epoch {
        (self.torques.epoch_after(start, elapsed), elapsed.to_f64() * self.seconds)
    }
}

/// A step of the first body of a batch.
struct OneStep<'a, T> {
    batch: &'a Batch<T>,
    dt: f64,
    evaluations: &'a RefCell<Evaluations>,
}

impl<T: Scalar> OneStep<'_, T> {
    fn by(self, method: Method) {
        match method {
            Method::Rk4 => self.taken::<Rk4>(),
            Method::Rk8 => self.taken::<Rk8>(),
            Method::Cf4 => self.taken::<Cf4>(),
            Method::Splitting2 => self.taken::<Splitting<2>>(),
            Method::Splitting4 => self.taken::<Splitting<4>>(),
            Method::Splitting6 => self.taken::<Splitting<6>>(),
            Method::ImplicitMidpoint => self.taken::<ImplicitMidpoint>(),
            Method::Dlm => self.taken::<Dlm>(),
            Method::ExplicitEuler => self.taken::<ExplicitEuler>(),
            Method::GyroNewton => self.taken::<GyroNewton>(),
            Method::ClampedEuler => self.taken::<ClampedEuler>(),
            Method::Spiral => self.taken::<Spiral>(),
            // It has no equal steps.
            Method::Taylor => {}
        }
    }

    fn taken<M: Step>(self) {
        let Self { batch, dt, evaluations } = self;
        let source = source_of(batch, dt);
        let workspace = source.workspace::<T>();
        let torques = Torques::new(source.group(0, &workspace));
        let tapped = Tapped { torques, seconds: dt, evaluations };
        let (body, state, rate) = first_row(batch);
        let dt = two_words::<T>(dt).times(rate);
        let zero = T::splat(0.0);
        // Only for free bodies.
        let invariants = Invariants { angular_momentum_squared: zero, kinetic_energy: zero };
        let prepared = M::prepare::<T, Tapped<'_, T>>(&body, &invariants, dt);
        M::step(&body, &prepared, &tapped, 0, dt, state);
    }
}

/// The source of a batch's torques, in equal steps of `dt` s.
fn source_of<T: Scalar>(batch: &Batch<T>, dt: f64) -> Source<'_, T> {
    let Batch { parameters, stride, torques, .. } = batch;
    Source { table: torques, parameters, stride: *stride, clock: torques.clock(), dt }
}

/// The first body, its state and its reference rate.
fn first_row<T: Scalar>(batch: &Batch<T>) -> (Body<T>, State<T>, T) {
    let (body, rate) = load_body(|column| batch.parameters[column * batch.stride]);
    (body, load_state(|column| batch.state[column * batch.stride]), rate)
}

/// The attempt of a controller in the interval from the batch's time to `end`.
fn attempted<T: Scalar>(
    batch: &Batch<T>,
    steps: &AdaptiveSteps,
    end: &Clock,
    controller: &Controller<f64>,
    evaluations: &RefCell<Evaluations>,
) {
    let source = source_of(batch, 0.0);
    let workspace = source.workspace::<T>();
    let (body, state, rate) = first_row(batch);
    let torques = Torques::new(source.group(0, &workspace));
    let tapped = Tapped { torques, seconds: 1.0 / rate.to_f64(), evaluations };
    let (value, residue) = source.clock.seconds_until(end);
    let steps = steps.over(value, end.seconds());
    let (span, limits) = (two_words_of::<T>(value, residue).times(rate), steps.limits(rate));
    let number = T::from_f64;
    let controller = Controller {
        step: number(controller.step),
        left: TwoWords { value: number(controller.left.value), residue: number(controller.left.residue) },
        retried: number(controller.retried),
        accepted: number(controller.accepted),
        rejected: number(controller.rejected),
    };
    attempt(&body, &tapped, span, &limits, controller, state);
}
