//! Finds which formula of a scene made a body fail, and the cause.
//!
//! The last good state is extrapolated to the time of the failure with the angular acceleration from the formulas,
//! which are evaluated on the way in `f64`. The first without a finite result is named, with the operation and the
//! numbers that it reads. If states are known only at outputs, only formulas of the time are examined. Numbers that
//! exceed only the range of `f32` are not found.

use glam::{DQuat, DVec3};

use crate::bodies::Status;
use crate::plan::Plan;
use crate::record::{FailedBody, KnownTo};
use crate::torque::Torque;
use crate::torque::custom::HostState;
use crate::torque::variable_inertia::tensor_at;

/// The most bodies that are examined.
const MOST_BODIES: usize = 1000;
/// The number of times examined between the last good state and the failure: within a step, and between outputs.
const IN_STEP: u32 = 16;
const BETWEEN_OUTPUTS: u32 = 256;
/// The times examined after adaptive steps stopped, as fractions of the span, doubled from the first to the last.
const BEHIND: [f64; 2] = [1e-15, 1e-5];

/// Names the causes of those failures for which one is found.
pub(super) fn find(plan: &Plan<'_>, failures: &mut [FailedBody]) {
    let torques = plan.scene().stated_torques();
    // The values of sampled torques when a body failed are not kept, nor is the position of its centre of mass.
    let is_unknown = |torque: &Torque| torque.is_sampled() || torque.is_coupled();
    if !torques.iter().any(Torque::is_expressed) || torques.iter().any(is_unknown) {
        return;
    }
    for failed in failures.iter_mut().take(MOST_BODIES) {
        failed.cause = cause(plan, torques, failed);
    }
}

fn cause(plan: &Plan<'_>, torques: &[Torque], failed: &FailedBody) -> Option<String> {
    let (body, scene) = (failed.body, plan.scene());
    let of_time_alone = failed.known_to == KnownTo::Output;
    let times = times(failed, scene.end())?;
    let initial = scene.ensemble().inertia()[body];
    let state = |elapsed: f64, angular_acceleration: DVec3| {
        let omega = failed.angular_velocity_body + angular_acceleration * elapsed;
        let turned = (failed.angular_velocity_body + omega) * (0.5 * elapsed);
        let orientation = failed.orientation * DQuat::from_scaled_axis(turned);
        let time = failed.last_good_time + elapsed;
        let tensor = tensor_at(torques, body, initial, time);
        let centre = (DVec3::ZERO, DVec3::ZERO);
        HostState { orientation, angular_velocity_body: omega, initial, tensor, time, centre }
    };
    let start = state(0.0, DVec3::ZERO);
    let torque: DVec3 = torques.iter().filter_map(|torque| torque.of_formula(body, &start)).sum();
    let omega = start.angular_velocity_body;
    let momentum_rate = torque - omega.cross(start.tensor * omega);
    let acceleration = Some(start.tensor.to_matrix().inverse() * momentum_rate).filter(|found| found.is_finite());
    times.into_iter().find_map(|elapsed| {
        let at = state(elapsed, acceleration.unwrap_or(DVec3::ZERO));
        torques.iter().enumerate().find_map(|(index, torque)| {
            let needs = torque.needs();
            if of_time_alone && (needs.attitude || needs.angular_velocity) {
                return None;
            }
            let fault = torque.fault_of_formula(body, &at)?;
            Some(format!("torque[{}] ({}): {fault}", index + 1, torque.name()))
        })
    })
}

/// Seconds after the last good state at which formulas are examined, the last slightly after the failure, as times of
/// kernels are rounded; `None` if no formula can cause such a failure.
fn times(failed: &FailedBody, span: f64) -> Option<Vec<f64>> {
    let elapsed = failed.time - failed.last_good_time;
    let parts = |count: u32| (0..=count + 1).map(|part| elapsed * f64::from(part) / f64::from(count)).collect();
    match (failed.reason, failed.known_to) {
        (Status::StepBelowLimit, KnownTo::Step) => {
            let [first, last] = BEHIND.map(|part| part * span.max(failed.time));
            let doubled = std::iter::successors(Some(first), |time| Some(2.0 * time)).take_while(|&time| time < last);
            Some(std::iter::once(0.0).chain(doubled).collect())
        }
        (Status::NotFinite | Status::NotConverged | Status::StepTooLong, KnownTo::Step) => Some(parts(IN_STEP)),
        (Status::CentreNotFinite | Status::Valid | Status::Stopped, _) => None,
        _ => Some(parts(BETWEEN_OUTPUTS)),
    }
}
