//! The own state of sampled torques at output times.

use super::group_run::GroupRun;
use super::observed::Stops;
use crate::plan::Plan;
use crate::plan::own_state::OwnStates;
use crate::record::OutputState;
use crate::torque::Torque;
use crate::torque::control::is_accumulation;

/// A number of the own state of a sampled torque ([`crate::torque::SampledLaw`]) at an output time.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct OwnState {
    /// The torque's place in the scene.
    pub torque: usize,
    /// The state's name, followed by `_x`, `_y` or `_z` for a component of a vector.
    pub name: String,
    /// Values of all bodies, shape `[body_count]`: for bodies that an event has stopped, those at the stop; NaN for
    /// bodies on which the torque does not act.
    pub values: Vec<f64>,
}

/// The own state of all bodies at the output time `time`, s, by number; `stops` has the bodies that an event has
/// stopped.
pub(super) fn own_columns(
    plan: &Plan<'_>,
    own_states: &OwnStates,
    group_runs: &[GroupRun<'_>],
    (time, stops): (f64, Option<&Stops>),
) -> Vec<Vec<f64>> {
    let mut columns = vec![vec![f64::NAN; plan.scene().ensemble().len()]; own_states.numbers().len()];
    for (group, group_run) in plan.groups().iter().zip(group_runs) {
        let Some(controls) = group_run.controls() else { continue };
        own_states
            .each((group.class.torques, controls), time, &mut |number, body, value| columns[number][body] = value);
    }
    if let Some(stops) = stops {
        stops.hold_own(&mut columns);
    }
    columns
}

/// The same with names, without what quantities keep that add up.
pub(super) fn named(torques: &[Torque], own_states: &OwnStates, columns: Vec<Vec<f64>>) -> Vec<OwnState> {
    let numbers = own_states.numbers().iter().zip(columns);
    let numbers = numbers.filter(|(own, _)| !is_accumulation(torques[own.torque].declaration()));
    numbers.map(|(own, values)| OwnState { torque: own.torque, name: own.name.clone(), values }).collect()
}

/// A column of some bodies, with NaN for those that have failed.
pub(super) fn of_sound(values: &[f64], states: &[OutputState]) -> Vec<f64> {
    let of = |(value, state): (&f64, &OutputState)| if state.rotation.is_sound() { *value } else { f64::NAN };
    values.iter().zip(states).map(of).collect()
}
