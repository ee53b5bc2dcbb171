//! Compares the work of the torques with the changes of the bodies' energy and angular momentum.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use glam::{DQuat, DVec3};

use crate::bodies::BodyState;
use crate::bodies::frame::initial_state;
use crate::error::{Error, Result};
use crate::math::parallel;
use crate::plan::{ActingTorques, Plan, TorqueSet};
use crate::record::{Balance, BalanceGatherer, change_of_total};
use crate::run::recomputed_sample::{recomputed, sample_of_part};
use crate::run::torque_work::Work;
use crate::scene::Scene;
use crate::torque::variable_inertia;

/// The balance of bodies that have these orientations (body to world) and angular velocities (rad/s, body axes) when a
/// plan's scene ends, wherever they were computed; shape `[body_count]`. Every run reports its own in
/// [`crate::record::Trust::balance`].
///
/// # Errors
///
/// [`Error::ColumnLength`] where a slice does not have one row for each body; [`Error::TooManyBodies`] where the memory
/// does not suffice.
pub fn balance(plan: &Plan<'_>, orientation: &[DQuat], angular_velocity_body: &[DVec3]) -> Result<Balance> {
    let ensemble = plan.scene().ensemble();
    let columns = [("orientation", orientation.len()), ("angular_velocity_body", angular_velocity_body.len())];
    for (column, found) in columns {
        if found != ensemble.len() {
            return Err(Error::ColumnLength { column: column.into(), expected: ensemble.len(), found });
        }
    }
    let state = |body: usize| {
        let (orientation, omega) = (orientation[body].normalize(), angular_velocity_body[body]);
        let initial = ensemble.inertia()[body];
        let tensor = variable_inertia::tensor_at(plan.scene().torques(), body, initial, plan.scene().end());
        let momentum = tensor * omega;
        BodyState {
            orientation,
            angular_velocity_body: omega,
            angular_momentum_world: orientation * momentum,
            kinetic_energy: 0.5 * omega.dot(momentum),
            ..BodyState::UNKNOWN
        }
    };
    let mut gatherer = BalanceGatherer::default();
    let sample = sample_of_part(plan);
    let (stops, known) = (BTreeMap::new(), BTreeMap::new());
    for reference in recomputed(plan, &sample.bodies, &stops, &known, &mut |_| ControlFlow::Continue(()))? {
        let (of, work) = ((reference.body, sample.weight_of(reference.body)), reference.work.as_ref());
        push_rest(&mut gatherer, plan.scene(), of, &state(reference.body), work);
    }
    let acting = ActingTorques::of(plan.scene().torques());
    let changes = parallel::rows(ensemble.len(), 1, &|body| {
        total_energy_change(plan.scene(), acting.on(body), body, &initial_state(ensemble, body), &state(body))
    });
    changes.into_iter().flatten().for_each(|change| gatherer.push_total(change));
    Ok(gatherer.finish())
}

/// Adds what remains of a body's changes after the torques' work is subtracted, or nothing if no torque acted. The body
/// counts as `weight`.
pub(super) fn push_rest(
    gatherer: &mut BalanceGatherer,
    scene: &Scene,
    (body, weight): (usize, f64),
    state: &BodyState,
    work: Option<&Work>,
) {
    let Some(work) = work else { return };
    let start = initial_state(scene.ensemble(), body);
    let energy = state.kinetic_energy - start.kinetic_energy - work.energy;
    let given: DVec3 = state.angular_momentum_world - start.angular_momentum_world - work.angular_momentum_world;
    gatherer.push_rest((energy.abs(), work.greatest_energy), (given.length(), work.greatest_angular_momentum), weight);
}

/// The relative difference of a body's kinetic plus potential energy between two states, if the torques `acting` on it
/// all have a potential.
pub(super) fn total_energy_change(
    scene: &Scene,
    acting: TorqueSet,
    body: usize,
    start: &BodyState,
    end: &BodyState,
) -> Option<f64> {
    if acting.is_empty() {
        return None;
    }
    let potential = |state: &BodyState| -> Option<f64> {
        let torques = scene.torques().iter().enumerate().filter(|(index, _)| acting.contains(*index));
        torques.map(|(_, torque)| torque.potential_energy(body, state.orientation)).sum()
    };
    Some(change_of_total((start.kinetic_energy, potential(start)?), (end.kinetic_energy, potential(end)?)))
}
