//! The calls that a method makes to its torques in one step, evaluation by evaluation, with arguments and results.
//!
//! Every method reaches the scene through two functions,
//! [`TorqueKernel::motion`](crate::kernel::torque_kernel::TorqueKernel::motion) and
//! [`TorqueKernel::torque`](crate::kernel::torque_kernel::TorqueKernel::torque), and forms dq/dt by a third. A tapped
//! kernel (`shaders/tap.wgsl`) counts their calls and stores one view of one evaluation in place of its body's state.
//! So that one dispatch shows a whole step, the batch holds the body once for each view of each evaluation: row i keeps
//! view i % [`VIEWS`] of evaluation i / [`VIEWS`].

use crate::bodies::columns::StateWords;

/// Views of an evaluation: the argument of `motion`, its results, the arguments of `torque`, its result with the time, dq/dt, and the
/// numbers of calls.
pub const VIEWS: usize = 6;

/// One call of `motion`, in units of the body's own scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MotionCall {
    /// m.
    pub angular_momentum: [f64; 3],
    /// The rate at which the axes turn.
    pub angular_velocity: [f64; 3],
    /// m × that rate.
    pub gyroscopic_term: [f64; 3],
}

/// One call of `torque`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TorqueCall {
    /// Time since the start of the step, s.
    pub elapsed: f64,
    pub orientation: [f64; 4],
    pub angular_velocity: [f64; 3],
    pub torque: [f64; 3],
}

/// The calls of one step, each kind in its order.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Evaluations {
    pub motions: Vec<MotionCall>,
    pub torques: Vec<TorqueCall>,
    /// dq/dt.
    pub orientation_rates: Vec<[f64; 4]>,
}

impl Evaluations {
    /// Reads the views that a tapped kernel has stored, for as many evaluations as there are rows.
    pub fn from_rows(rows: &StateWords) -> Self {
        let evaluations = rows.len() / VIEWS;
        let view = |evaluation: usize, view: usize| rows.value[VIEWS * evaluation + view];
        let vector = |numbers: [f64; 7], first: usize| [numbers[first], numbers[first + 1], numbers[first + 2]];
        let quaternion = |[x, y, z, w, ..]: [f64; 7]| [x, y, z, w];
        let calls =
            |kind: usize| if evaluations == 0 { 0 } else { (view(0, VIEWS - 1)[4 + kind] as usize).min(evaluations) };
        let motion = |evaluation| MotionCall {
            angular_momentum: vector(view(evaluation, 0), 4),
            angular_velocity: vector(view(evaluation, 1), 0),
            gyroscopic_term: vector(view(evaluation, 1), 4),
        };
        let torque = |evaluation| TorqueCall {
            elapsed: view(evaluation, 3)[0],
            orientation: quaternion(view(evaluation, 2)),
            angular_velocity: vector(view(evaluation, 2), 4),
            torque: vector(view(evaluation, 3), 4),
        };
        Self {
            motions: (0..calls(0)).map(motion).collect(),
            torques: (0..calls(1)).map(torque).collect(),
            orientation_rates: (0..calls(2)).map(|evaluation| quaternion(view(evaluation, 4))).collect(),
        }
    }
}
