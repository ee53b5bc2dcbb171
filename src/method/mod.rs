//! Integrators: one file each, with the same stem and function names as in `shaders/method/`.
//!
//! Each module defines `step`, which advances one body by one step. A new integrator is a file here, its twin in
//! `shaders/method/`, and one entry in [`Method`].

use crate::real::Real;
use crate::rigid_body::{Body, State};
use crate::torque::Environment;
use crate::vector::TwoWords;

pub mod dlm;
pub mod rk4;

/// How a body is advanced in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Method {
    /// The classical Runge-Kutta method of order 4; see [`rk4`].
    Rk4,
    /// Splitting into rotations about the three principal axes, order 2; see [`dlm`].
    Dlm,
}

impl Method {
    /// All methods, in the order in which they are listed to users.
    pub const ALL: [Method; 2] = [Method::Rk4, Method::Dlm];

    /// The name in study files, on the command line and of the source files.
    pub fn name(self) -> &'static str {
        match self {
            Method::Rk4 => "rk4",
            Method::Dlm => "dlm",
        }
    }

    /// The order of the attitude error in the step size.
    pub fn order(self) -> u32 {
        match self {
            Method::Rk4 => 4,
            Method::Dlm => 2,
        }
    }
}

impl std::fmt::Display for Method {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(self.name())
    }
}

/// A method's step, as a type, so that each method is compiled into a loop of its own.
pub trait Step {
    /// Advances `state` by one step of `dt` (in units of the body's own scale), the `step`-th of its interval, from 0.
    fn step<R: Real, E: Environment<R>>(
        body: &Body<R>,
        environment: &E,
        step: u64,
        dt: TwoWords<R>,
        state: State<R>,
    ) -> State<R>;
}
