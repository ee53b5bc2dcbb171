//! Integrators: one file each, with the same stem and function names as in `shaders/method/`.
//!
//! Each module defines a type that implements [`Step`]; only [`taylor`], which has adaptive steps only, is implemented in the CPU engine. A
//! new integrator is a file here, its twin in `shaders/method/`, one entry in [`Method`] and in [`Method::ALL`], and its row in `properties`;
//! the compiler names the other places, and `docs/extending.md` lists all. Each WGSL file names its twin in its first line. Some WGSL files
//! have stems of their own: the orders of `splitting` are separate files there, as are the parts that kernels put around a step.
//!
//! # Drift over a million steps
//!
//! Relative change of kinetic energy and of the angular momentum in the world, and | |q| − 1 |, after 10⁶ steps of 0.01 s of
//! one free asymmetric body (`asym_p01` of the golden data; ω dt ≈ 0.01), on the CPU engine. Methods other than baselines
//! carry their state in two words in `f32`. Without torque, the three splittings are the same free flow.
//! `cargo test --test truth conservation::drifts -- --nocapture` prints the table and checks it.
//!
//! | method | precision | energy | angular momentum | norm |
//! | --- | --- | --- | --- | --- |
//! | `rk4` | f32 | 1.3e-7 | 1.1e-7 | 2.1e-8 |
//! | `rk4` | f64 | 1.9e-12 | 3.6e-12 | 0 |
//! | `rk8` | f32 | 1.2e-6 | 3.1e-6 | 3.9e-8 |
//! | `rk8` | f64 | 1.1e-15 | 6.6e-14 | 1.1e-16 |
//! | `cf4` | f32 | 1.3e-7 | 5.0e-7 | 1.1e-8 |
//! | `cf4` | f64 | 1.9e-12 | 1.3e-12 | 0 |
//! | `splitting2`, `splitting4`, `splitting6` | f32 | 2.9e-8 | 3.3e-7 | 2.3e-8 |
//! | `splitting2`, `splitting4`, `splitting6` | f64 | 1.8e-14 | 4.0e-14 | 0 |
//! | `implicit_midpoint` | f32 | 1.6e-7 | 3.5e-7 | 1.7e-8 |
//! | `implicit_midpoint` | f64 | 1.3e-14 | 2.5e-14 | 0 |
//! | `dlm` | f64 | 2.9e-7 | 7.2e-14 | 0 |
//! | `explicit_euler` | f64 | not a number | | |
//! | `gyro_newton` | f64 | 1.5e-1 | 1.1e-1 | 1.1e-16 |
//! | `clamped_euler` | f64 | 1.8e-1 | 9.2e-4 | 0 |
//! | `spiral` | f64 | 1.1e-6 | 2.0e-6 | 0 |

use crate::kernel::rigid_body::{Body, Invariants, State};
use crate::kernel::torque_kernel::TorqueKernel;
use crate::math::real::Real;
use crate::math::vector::TwoWords;

pub mod cf4;
pub mod clamped_euler;
pub mod dlm;
pub mod explicit_euler;
pub mod gyro_newton;
pub mod implicit_midpoint;
pub(crate) mod kick;
pub(crate) mod midpoint;
pub(crate) mod moser_veselov;
pub(crate) mod projection;
mod properties;
pub mod rk4;
pub mod rk8;
pub mod rk8_adaptive;
pub(crate) mod slope;
pub mod spiral;
pub mod splitting;
pub mod taylor;

pub use properties::{Properties, TorqueKind};

/// How a body is advanced in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Method {
    /// The classical Runge-Kutta method of order 4; see [`rk4`].
    Rk4,
    /// Dormand and Prince's Runge-Kutta method of order 8; see [`rk8`].
    Rk8,
    /// Commutator-free Lie-group method of order 4; see [`cf4`].
    Cf4,
    /// Torque kicks around a discrete free flow, order 2; see [`splitting`].
    Splitting2,
    /// Torque kicks between discrete free flows, order 4; see [`splitting`].
    Splitting4,
    /// Torque kicks between discrete free flows, order 6; see [`splitting`].
    Splitting6,
    /// The implicit midpoint rule on the rotation group, order 2; see [`implicit_midpoint`].
    ImplicitMidpoint,
    /// Splitting into rotations about the three principal axes, order 2; see [`dlm`].
    Dlm,
    /// Euler's explicit method, order 1; see [`explicit_euler`].
    ExplicitEuler,
    /// One Newton step on the implicit gyroscopic term, order 1; see [`gyro_newton`].
    GyroNewton,
    /// Euler's explicit method with |m| restored, order 1; see [`clamped_euler`].
    ClampedEuler,
    /// Two rotations a step and a third-order angular velocity; see [`spiral`].
    Spiral,
    /// Taylor series in adaptive steps; see [`taylor`].
    Taylor,
}

impl Method {
    /// Methods with adaptive steps, in the order in which they are listed to users.
    pub const ADAPTIVE: [Method; 2] = [Method::Rk8, Method::Taylor];

    /// Methods with steps of equal length, in the order in which they are listed to users.
    pub const ALL: [Method; 12] = [
        Method::Rk4,
        Method::Rk8,
        Method::Cf4,
        Method::Splitting2,
        Method::Splitting4,
        Method::Splitting6,
        Method::ImplicitMidpoint,
        Method::Dlm,
        Method::ExplicitEuler,
        Method::GyroNewton,
        Method::ClampedEuler,
        Method::Spiral,
    ];

    /// The name in study files, on the command line and of the source files.
    pub fn name(self) -> &'static str {
        self.properties().name
    }

    /// The order of the attitude error in the step size under the torques that suit the method best.
    ///
    /// [`Properties::order_under`] says under which torques it loses order.
    pub fn order(self) -> u32 {
        self.properties().order
    }
}

impl std::fmt::Display for Method {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(self.name())
    }
}

/// A method's step, as a type, so that a loop is compiled for each method.
pub trait Step {
    /// Quantities formed once for a body and step size rather than at every step.
    type Prepared<R: Real>: Copy;

    /// Whether [`Step::prepare`] reads the invariants of a torque-free body, so that their columns are needed.
    const INVARIANTS: bool = false;

    /// Forms what all steps of `dt` have in common.
    ///
    /// It may depend on the body, on `dt` and on the invariants at the start of the run, but not on the state, so that the result does not
    /// depend on where a run is cut.
    fn prepare<R: Real, E: TorqueKernel<R>>(
        body: &Body<R>,
        invariants: &Invariants<R>,
        dt: TwoWords<R>,
    ) -> Self::Prepared<R>;

    /// Advances `state` by one step of `dt` (in units of the body's own scale), the `step_index`-th of its interval,
    /// from 0.
    fn step<R: Real, E: TorqueKernel<R>>(
        body: &Body<R>,
        prepared: &Self::Prepared<R>,
        torques: &E,
        step_index: u64,
        dt: TwoWords<R>,
        state: State<R>,
    ) -> State<R>;
}

/// A [`Step`] for which nothing is formed once.
pub trait PlainStep {
    /// Advances `state` by one step, as [`Step::step`].
    fn step<R: Real, E: TorqueKernel<R>>(
        body: &Body<R>,
        torques: &E,
        step_index: u64,
        dt: TwoWords<R>,
        state: State<R>,
    ) -> State<R>;
}

impl<M: PlainStep> Step for M {
    type Prepared<R: Real> = ();

    #[inline(always)]
    fn prepare<R: Real, E: TorqueKernel<R>>(_: &Body<R>, _: &Invariants<R>, _: TwoWords<R>) {}

    #[inline(always)]
    fn step<R: Real, E: TorqueKernel<R>>(
        body: &Body<R>,
        (): &(),
        torques: &E,
        step_index: u64,
        dt: TwoWords<R>,
        state: State<R>,
    ) -> State<R> {
        <M as PlainStep>::step(body, torques, step_index, dt, state)
    }
}
