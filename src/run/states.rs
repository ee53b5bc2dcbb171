//! States of some bodies, from all groups of a run.

use std::ops::Range;

use glam::DVec3;

use super::group_run::GroupRun;
use super::reading;
use super::translation::Centres;
use crate::bodies::BodyState;
use crate::error::Result;
use crate::math::parallel;
use crate::record::OutputState;

/// The most bodies whose states are filled before they are overwritten: that takes next to no time.
const FEW_BODIES: usize = 1 << 12;

/// Writes the states of some bodies, in the user's axes and units, to `states`, and their initial states to `initial`.
/// Each body belongs to one group, so every place is overwritten. Vectors of few bodies are filled with what no body has first, so that a missing
/// body or a part of its state is noticed.
pub(super) fn read_states(
    group_runs: &mut [GroupRun<'_>],
    centres: &Centres<'_>,
    bodies: &Range<usize>,
    states: &mut Vec<OutputState>,
    mut initial: Option<&mut Vec<BodyState>>,
) -> Result<()> {
    make_room(states, bodies.len(), OutputState::moving(BodyState::UNKNOWN, None));
    if let Some(initial) = &mut initial {
        make_room(initial, bodies.len(), BodyState::UNKNOWN);
    }
    if bodies.len() <= FEW_BODIES {
        let nowhere = Some((DVec3::NAN, DVec3::NAN));
        states.fill(OutputState { stopped_at: Some(f64::NAN), ..OutputState::moving(BodyState::UNKNOWN, nowhere) });
        initial.iter_mut().for_each(|initial| initial.fill(BodyState::UNKNOWN));
    }
    group_runs
        .iter_mut()
        .try_for_each(|group_run| group_run.read(bodies, states, initial.as_mut().map(|initial| &mut initial[..])))?;
    if centres.are_moving() {
        parallel::for_each_mut(states, reading::TASK, |place, state| {
            state.translation = centres.of_body(bodies.start + place)
        });
    }
    if group_runs.iter().any(GroupRun::has_centres) {
        for (state, centre) in states.iter_mut().zip(stepped_centres(group_runs, bodies)?) {
            state.translation = centre.or(state.translation.filter(|_| centres.are_moving()));
        }
    }
    Ok(())
}

/// The initial states of some bodies.
pub(super) fn initial_states(group_runs: &[GroupRun<'_>], bodies: &Range<usize>, initial: &mut Vec<BodyState>) {
    make_room(initial, bodies.len(), BodyState::UNKNOWN);
    group_runs.iter().for_each(|group_run| group_run.read_initial(bodies, initial));
}

/// The centres of mass of some bodies, if they are stepped along the rotation.
fn stepped_centres(group_runs: &mut [GroupRun<'_>], bodies: &Range<usize>) -> Result<Vec<Option<(DVec3, DVec3)>>> {
    let mut stepped = vec![None; bodies.len()];
    group_runs.iter_mut().try_for_each(|group_run| group_run.read_centres(bodies, &mut stepped))?;
    Ok(stepped)
}

/// The centres of mass of a sample's bodies; `None` for bodies that do not translate.
pub(super) fn centres_of(
    sample: &[u32],
    group_runs: &mut [GroupRun<'_>],
    centres: &Centres<'_>,
) -> Result<Vec<Option<(DVec3, DVec3)>>> {
    let has_stepped = group_runs.iter().any(GroupRun::has_centres);
    let mut centre = |&body: &u32| -> Result<_> {
        let body = body as usize;
        let stepped = if has_stepped { stepped_centres(group_runs, &(body..body + 1))?.pop().flatten() } else { None };
        Ok(stepped.or_else(|| centres.of_body(body)))
    };
    sample.iter().map(&mut centre).collect()
}

/// The bodies whose centres of mass are not finite, examined `block` bodies at a time.
pub(super) fn lost_centres(
    group_runs: &mut [GroupRun<'_>],
    centres: &Centres<'_>,
    body_count: usize,
    block: usize,
) -> Result<Vec<usize>> {
    let is_lost = |centre: Option<(DVec3, DVec3)>| centre.is_some_and(|(x, v)| !(x.is_finite() && v.is_finite()));
    let mut lost = Vec::new();
    if centres.are_moving() {
        let of_piece = |_, bodies: Range<usize>| bodies.filter(|&body| is_lost(centres.of_body(body))).collect();
        lost.extend(parallel::map_tasks::<_, Vec<usize>>(parallel::pieces(body_count), of_piece).concat());
    }
    if group_runs.iter().any(GroupRun::has_centres) {
        for start in (0..body_count).step_by(block) {
            let bodies = start..(start + block).min(body_count);
            let stepped = stepped_centres(group_runs, &bodies)?;
            lost.extend(bodies.zip(stepped).filter(|&(_, centre)| is_lost(centre)).map(|(body, _)| body));
        }
    }
    Ok(lost)
}

/// Brings a vector to a length. If it grows, all cores touch the new memory together, which takes longer than filling
/// it.
pub(super) fn make_room<T: Copy + Send + Sync>(places: &mut Vec<T>, len: usize, unknown: T) {
    places.truncate(len);
    parallel::extend_by_rows(places, len.saturating_sub(places.len()), reading::TASK, &|_| unknown);
}
