//! The own state of sampled torques at output times.

use super::group_run::GroupRun;
use crate::plan::Plan;
use crate::record::OutputState;
use crate::torque::control;

/// A number of the own state of a sampled torque ([`crate::torque::SampledLaw`]) at an output time.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct OwnState {
    /// The torque's place in the scene.
    pub torque: usize,
    /// The state's name, and for a component of a vector `_x`, `_y` or `_z` behind it.
    pub name: String,
    /// Of all bodies, shape `[body_count]`; NaN of those that an event has stopped, and of those on which the torque does not act.
    pub values: Vec<f64>,
}

/// The own state at the output time that the bodies stand at, s.
pub(super) fn own_state(plan: &Plan<'_>, group_runs: &[GroupRun<'_>], time: f64) -> Vec<OwnState> {
    let torques = plan.scene().torques();
    let nothing = vec![f64::NAN; plan.scene().ensemble().len()];
    let own = control::own_state(torques);
    let mut all: Vec<OwnState> = own.map(|(torque, name)| OwnState { torque, name, values: nothing.clone() }).collect();
    for (group, group_run) in plan.groups().iter().zip(group_runs) {
        let Some(controls) = group_run.controls() else { continue };
        // A group has the laws of the torques that act on it.
        let acts = |&torque: &usize| group.class.torques.contains(torque) && torques[torque].is_sampled();
        let acting = (0..torques.len()).filter(acts);
        let first = |torque: usize| all.iter().position(|own| own.torque == torque).unwrap_or(0);
        let firsts: Vec<usize> = acting.map(first).collect();
        controls.own_state(time, &mut |(law, number), body, value| {
            all[firsts[law] + number].values[body] = value;
        });
    }
    all
}

/// A column of some bodies without those that have failed or were stopped.
pub(super) fn of_moving(values: &[f64], states: &[OutputState]) -> Vec<f64> {
    let of = |(value, state): (&f64, &OutputState)| {
        if state.rotation.is_sound() && state.stopped_at.is_none() { *value } else { f64::NAN }
    };
    values.iter().zip(states).map(of).collect()
}
