//! What a step costs and how accurate it is: the table that choices start from.
//!
//! A pilot (`pilot.rs`) replaces the coefficients by those of the scene at hand; the times only rank the candidates.

use crate::batch::Precision;
use crate::method::Method;

/// One method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// The integrator.
    pub method: Method,
    /// c in the attitude error c θ^order α of a body that turns by α rad in steps of θ rad; 99th percentile, with a margin of
    /// two, of the free problem of `study::problem`.
    pub coefficient: f64,
    /// Time of a step, s, of one core with AVX-512, in `f32` and `f64`.
    pub seconds: [f64; 2],
}

/// The methods that a plan chooses among, the most accurate first.
pub const COSTS: &[Cost] = &[Cost { method: Method::Rk4, coefficient: 1e-3, seconds: [2.6e-9, 4.6e-9] }];

impl Cost {
    /// Time of a step, s.
    pub fn step_seconds(&self, precision: Precision) -> f64 {
        self.seconds[usize::from(precision == Precision::F64)]
    }
}

/// The row of a method, where the table has one.
pub fn cost_of(method: Method) -> Option<&'static Cost> {
    COSTS.iter().find(|cost| cost.method == method)
}
