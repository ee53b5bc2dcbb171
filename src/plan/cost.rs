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
    /// two, of the free and the forced problem of the design page, the greater.
    pub coefficient: f64,
    /// No step turns a body further than this, rad: beyond it the error does not behave as the order says.
    pub longest_angle: f64,
    /// Time of a step of a free body, s, of one core with AVX-512, in `f32` and `f64`.
    pub free_seconds: [f64; 2],
    /// The same under a constant torque and linear drag.
    pub driven_seconds: [f64; 2],
}

/// The methods that a plan chooses among.
///
/// Measured with `RAYON_NUM_THREADS=1 cargo bench --bench costs`.
pub const COSTS: &[Cost] = &[
    Cost {
        method: Method::Rk4,
        coefficient: 1e-3,
        longest_angle: 0.5,
        free_seconds: [2.6e-9, 4.6e-9],
        driven_seconds: [4e-9, 7e-9],
    },
    Cost {
        method: Method::Rk8,
        coefficient: 1e-7,
        longest_angle: 1.5,
        free_seconds: [12e-9, 20e-9],
        driven_seconds: [16e-9, 30e-9],
    },
];

/// Time of one evaluation of a torque-free motion at an output time, s, of one core: by elliptic functions in an
/// arithmetic, or, without one, as a regular precession (`cargo bench --bench costs`).
pub fn evaluation_seconds(closed_form: Option<Precision>) -> f64 {
    match closed_form {
        None => 2e-7,
        Some(Precision::F32) => 2e-8,
        Some(Precision::F64) => 5e-8,
    }
}

impl Cost {
    /// Time of a step, s.
    pub fn step_seconds(&self, precision: Precision, free: bool) -> f64 {
        let seconds = if free { self.free_seconds } else { self.driven_seconds };
        seconds[usize::from(precision == Precision::F64)]
    }
}

/// The row of a method, where the table has one.
pub fn cost_of(method: Method) -> Option<&'static Cost> {
    COSTS.iter().find(|cost| cost.method == method)
}
