//! A sample of a run's bodies, recomputed more accurately.

use std::collections::{BTreeMap, BTreeSet};

use crate::bodies::frame::{attitude_error, initial_state};
use crate::bodies::{BodyState, Members, Status};
use crate::engine::watch::Watch;
use crate::engine::{Observer, Progress};
use crate::error::{Error, Result};
use crate::kernel::free_motion::FreeMotion;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::math::Quantiles;
use crate::math::parallel;
use crate::plan::errors::Errors;
use crate::plan::recomputation::{
    EQUAL_FOR_ADAPTIVE, MOST_REFINEMENT, REFERENCE_ANGLE, WITH_WORK, finer, follows_by_series, has_finer, is_damped,
    is_piecewise, shorter_by, steps_of_series,
};
use crate::plan::subset::{SubsetStates, Watcher, propagate_subset};
use crate::plan::{Group, Interval, Plan, Stratified, TorqueSet, Treatment, rate_of_body, steps_over};
use crate::record::RecomputedSample;
use crate::run::torque_work::{self, Alike, Recomputed, Work};
use crate::scene::AdaptiveSteps;
use crate::scene::{Accuracy, Part, Scene, Stepping};
use crate::torque::Torque;

/// Stopped bodies that are followed side by side between two checks whether to continue.
const ALONE: usize = 64;

/// Two computations of a body that end in attitudes this near to each other, rad, have followed the same motion.
const SAME_MOTION: f64 = 1e-5;

/// The bodies of a plan whose motion is recomputed: for a part of a scene those in the sample of the whole, so that all
/// parts together recompute the same bodies as one run.
pub(super) fn sample_of_part(plan: &Plan<'_>) -> Stratified {
    let (Part { first_body, .. }, body_count) = (plan.scene().part(), plan.scene().ensemble().len());
    plan.sample().within(&(first_body..first_body + body_count))
}

/// The bodies of the sample on which the work of torques is integrated although series follow them: some typical driven ones.
fn with_work(plan: &Plan<'_>) -> BTreeSet<u32> {
    let is_driven = |body: u32| !TorqueSet::acting_on(plan.scene().torques(), body as usize).is_empty();
    let count = if plan.recomputation().balances { WITH_WORK } else { 0 };
    sample_of_part(plan).filtered(is_driven).typical(count).into_iter().collect()
}

/// A body of the sample at the end, or at its stop, with the work of torques if any act on it.
pub(super) struct Reference {
    pub body: usize,
    pub state: BodyState,
    pub work: Option<Work>,
}

/// Recomputes the bodies of a sample on the CPU in `f64`: torque-free ones by the closed form, the others by Taylor series or, where these are
/// too dear, by finer steps of the run's own method. Those that random or sampled torques act on, or whose centres of mass take part, are
/// followed as the run does it: in equal steps by `rk8` in the steps of [`alike`], or in finer adaptive steps. Bodies that an event has stopped
/// are followed to their times (s) in `stops`. Of some bodies the final states may be `known` from a recomputation in the steps of
/// [`Plan::recomputing_treatment`], which are then used unless the run's steps are about as fine.
pub(super) fn recomputed(
    plan: &Plan<'_>,
    sample: &[u32],
    stops: &BTreeMap<u32, f64>,
    known: &BTreeMap<usize, BodyState>,
    observer: &mut Observer<'_>,
) -> Result<Vec<Reference>> {
    let scene = plan.scene();
    let nothing = BTreeMap::new();
    let has_work = with_work(plan);
    let mut references = Vec::with_capacity(sample.len());
    for group in plan.groups() {
        let members: Vec<u32> = sample.iter().copied().filter(|&body| contains(group, body as usize)).collect();
        let acting = |&body: &u32| !TorqueSet::acting_on(scene.torques(), body as usize).is_empty();
        let stepped = group.treatment.precision_of_steps().is_some();
        let (driven, free): (Vec<u32>, Vec<u32>) = members.into_iter().partition(|body| stepped && acting(body));
        references.extend(closed_form(scene, &free, stops));
        let at_start = |body: &u32| stops.get(body).is_some_and(|&time| time <= 0.0);
        let (standing, driven): (Vec<u32>, Vec<u32>) = driven.into_iter().partition(at_start);
        references.extend(standing.into_iter().map(|body| {
            let state = initial_state(scene.ensemble(), body as usize);
            Reference { body: body as usize, state, work: None }
        }));
        if !driven.is_empty() {
            let torques = group.class.torques.of(scene.torques());
            let known = match group.treatment {
                Treatment::Adaptive { method, steps, .. }
                    if !has_finer(&torques, scene.ensemble(), (method, &steps)) =>
                {
                    &nothing
                }
                _ => known,
            };
            references.extend(match group.treatment {
                _ if follows_by_series(&torques) => {
                    by_series(plan, (group, &torques), (driven, stops), (known, &has_work), observer)?
                }
                Treatment::Adaptive { method, steps, .. } => {
                    adaptively(plan, (group, &torques), (driven, stops), known, (method, &steps), observer)?
                }
                _ => in_equal_steps(plan, group, &torques, (driven, stops), observer)?,
            });
        }
    }
    references.sort_by_key(|reference| reference.body);
    Ok(references)
}

/// Recomputes bodies under sampled torques, or with their centres of mass, in adaptive steps. In these the work of torques cannot be integrated
/// along with the motion; that takes equal steps, at least as many as the body's adaptive ones, unless they would take too long.
fn adaptively(
    plan: &Plan<'_>,
    (group, torques): (&Group, &[Torque]),
    (members, stops): (Vec<u32>, &BTreeMap<u32, f64>),
    known: &BTreeMap<usize, BodyState>,
    (method, steps): (Method, &AdaptiveSteps),
    observer: &mut Observer<'_>,
) -> Result<Vec<Reference>> {
    let scene = plan.scene();
    let is_coupled = torques.iter().any(Torque::is_coupled);
    let by_series = is_coupled || is_piecewise(torques, scene.ensemble());
    let (treatment, times) = match by_series {
        true => finer_series(plan, steps),
        false => (plan.recomputing_treatment(group, torques), plan.ends_of_steps(method).to_vec()),
    };
    let is_finer = has_finer(torques, scene.ensemble(), (method, steps));
    if by_series || is_finer && !plan.recomputation().balances {
        let (mut states, members) = of_known(members, stops, known);
        states.extend(propagated(plan, torques, (members, stops), (&treatment, &times), observer)?.states);
        return Ok(states.into_iter().map(|(body, state)| Reference { body, state, work: None }).collect());
    }
    let found = propagated(plan, torques, (members, stops), (&treatment, &times), observer)?;
    // By number of steps and, for stopped bodies, by body.
    let mut alike: BTreeMap<(u64, Option<u32>), Vec<u32>> = BTreeMap::new();
    for ((body, _), counts) in found.states.iter().zip(&found.counts) {
        let body = *body as u32;
        let own = stops.contains_key(&body).then_some(body);
        alike.entry((counts.accepted.max(1).next_power_of_two(), own)).or_default().push(body);
    }
    let in_equal_steps = |((count, own), members): ((u64, Option<u32>), Vec<u32>)| {
        let (steps, end) = (count.saturating_mul(EQUAL_FOR_ADAPTIVE), own.map_or(scene.end(), |body| stops[&body]));
        Alike { members, intervals: vec![steps_over(end, end / steps as f64)], end }
    };
    let equal = torque_work::recomputed(scene, torques, alike.into_iter().map(in_equal_steps).collect(), observer)?;
    let equal: BTreeMap<usize, Recomputed> = equal.into_iter().map(|found| (found.body, found)).collect();
    let reference = |(body, state): (usize, BodyState)| match equal.get(&body) {
        Some(found) => Reference { body, state: if is_finer { state } else { found.state }, work: Some(found.work) },
        None => Reference { body, state, work: None },
    };
    Ok(found.states.into_iter().map(reference).collect())
}

/// The states of those bodies that are known and that the run has not stopped, and the other bodies.
fn of_known(
    members: Vec<u32>,
    stops: &BTreeMap<u32, f64>,
    known: &BTreeMap<usize, BodyState>,
) -> (Vec<(usize, BodyState)>, Vec<u32>) {
    let state = |body: u32| known.get(&(body as usize)).copied().filter(|_| !stops.contains_key(&body));
    let others = members.iter().copied().filter(|&body| state(body).is_none()).collect();
    (members.into_iter().filter_map(|body| Some((body as usize, state(body)?))).collect(), others)
}

/// Bodies by adaptive `rk8`, with the work of torques on those that it does not lose.
fn by_rk8(
    plan: &Plan<'_>,
    torques: &[Torque],
    (members, stops): (&[u32], &BTreeMap<u32, f64>),
    steps: AdaptiveSteps,
    observer: &mut Observer<'_>,
) -> Result<Vec<Reference>> {
    let scene = plan.scene();
    let times = [plan.breaks(), &[scene.end()]].concat();
    let to_end = |&body: &u32| (body, stops.get(&body).copied().unwrap_or(scene.end()));
    let members: Vec<(u32, f64)> = members.iter().map(to_end).collect();
    let found = torque_work::recomputed_adaptively(scene, torques, (members, &times), steps, observer)?;
    let reference = |Recomputed { body, state, work }| {
        let work = (state.status == Status::Valid).then_some(work);
        Reference { body, state, work }
    };
    Ok(found.into_iter().map(reference).collect())
}

/// Recomputes bodies by Taylor series, finer ones than the run's if it takes such, which need fewer steps than `rk8` and err less near rounding;
/// by finer steps of `rk8` if the run takes such and series are too dear. `rk8` follows those that series lose, those that an event has stopped,
/// those whose motion is strongly damped, unless the run itself takes series or formulas decide between cases, and, if that is not too much, some
/// of the others, for the work of torques on them: in equal steps if the run takes such.
fn by_series(
    plan: &Plan<'_>,
    (group, torques): (&Group, &[Torque]),
    (members, stops): (Vec<u32>, &BTreeMap<u32, f64>),
    (known, has_work): (&BTreeMap<usize, BodyState>, &BTreeSet<u32>),
    observer: &mut Observer<'_>,
) -> Result<Vec<Reference>> {
    let scene = plan.scene();
    let steps_of_rk8 = steps_of_series(scene, &group.treatment).1;
    // Where formulas decide between cases, only series end their steps there.
    let decides = is_piecewise(torques, scene.ensemble());
    let (treatment, times) = match group.treatment {
        Treatment::Adaptive { method: Method::Taylor, steps, .. } => finer_series(plan, &steps),
        _ => (plan.recomputing_treatment(group, torques), [plan.breaks(), &[scene.end()]].concat()),
    };
    let is_braked = |body: usize| !decides && is_damped(scene, torques, body, &group.treatment);
    let goes_by_series = treatment.method() == Some(Method::Taylor);
    let is_for_rk8 = |body: &u32| !decides && stops.contains_key(body) || goes_by_series && is_braked(*body as usize);
    let (left, going): (Vec<u32>, Vec<u32>) = members.into_iter().partition(is_for_rk8);
    let (mut found, going) = of_known(going, stops, known);
    found.extend(propagated(plan, torques, (going, stops), (&treatment, &times), observer)?.states);
    let needs_rk8 = |(body, state): &(usize, BodyState)| !state.is_sound() || has_work.contains(&(*body as u32));
    let others = found.iter().filter(|found| needs_rk8(found)).map(|(body, _)| *body as u32);
    let others = [left, others.collect()].concat();
    let by_rk8 = match group.treatment {
        Treatment::Adaptive { .. } => by_rk8(plan, torques, (&others, stops), steps_of_rk8, observer)?,
        _ => by_equal_steps(plan, group, torques, (others, stops), observer)?,
    };
    let mut by_rk8: BTreeMap<usize, Reference> =
        by_rk8.into_iter().map(|reference| (reference.body, reference)).collect();
    let reference = |(body, state): (usize, BodyState)| match by_rk8.remove(&body) {
        Some(other) if !state.is_sound() => other,
        Some(other) => Reference { body, state, work: work_if_same(&state, other) },
        None => Reference { body, state, work: None },
    };
    let mut references: Vec<Reference> = found.into_iter().map(reference).collect();
    references.extend(by_rk8.into_values());
    Ok(references)
}

/// The work of torques along one motion of a body, if it is the one that ends in `state`.
fn work_if_same(state: &BodyState, other: Reference) -> Option<Work> {
    other.work.filter(|_| attitude_error(state, &other.state) <= SAME_MOTION)
}

/// Recomputes bodies in equal steps of `rk8`, with the work of torques. Where formulas of sampled torques decide between cases, their states
/// are those of Taylor series, which end their steps there. Bodies that an event has stopped stay as they are.
fn in_equal_steps(
    plan: &Plan<'_>,
    group: &Group,
    torques: &[Torque],
    (members, stops): (Vec<u32>, &BTreeMap<u32, f64>),
    observer: &mut Observer<'_>,
) -> Result<Vec<Reference>> {
    let scene = plan.scene();
    let references = by_equal_steps(plan, group, torques, (members, stops), observer)?;
    let is_wanted = |reference: &&Reference| {
        !stops.contains_key(&(reference.body as u32)) && !is_damped(scene, torques, reference.body, &group.treatment)
    };
    let wanted: Vec<u32> = references.iter().filter(is_wanted).map(|reference| reference.body as u32).collect();
    if wanted.is_empty() || !is_piecewise(torques, scene.ensemble()) {
        return Ok(references);
    }
    let (treatment, times) = (treatment_by(steps_of_series(scene, &group.treatment).0), plan.advance_times());
    let (members, watcher) = (Members::Some(wanted), Watcher::Observer(observer));
    let found = propagate_subset(scene, times, torques, &members, &treatment, watcher)?.states;
    let found: BTreeMap<usize, BodyState> = found.into_iter().filter(|(_, state)| state.is_sound()).collect();
    let corrected = |reference: Reference| match found.get(&reference.body) {
        Some(&state) => Reference { body: reference.body, state, work: work_if_same(&state, reference) },
        None => reference,
    };
    Ok(references.into_iter().map(corrected).collect())
}

/// Bodies by `rk8` in the equal steps of [`alike`], with the work of torques.
fn by_equal_steps(
    plan: &Plan<'_>,
    group: &Group,
    torques: &[Torque],
    members: (Vec<u32>, &BTreeMap<u32, f64>),
    observer: &mut Observer<'_>,
) -> Result<Vec<Reference>> {
    let found = torque_work::recomputed(plan.scene(), torques, alike(plan, group, torques, members), observer)?;
    let reference = |Recomputed { body, state, work }| Reference { body, state, work: Some(work) };
    Ok(found.into_iter().map(reference).collect())
}

/// Propagates bodies, each to its own stop if an event has stopped it.
fn propagated(
    plan: &Plan<'_>,
    torques: &[Torque],
    (members, stops): (Vec<u32>, &BTreeMap<u32, f64>),
    (treatment, times): (&Treatment, &[f64]),
    observer: &mut Observer<'_>,
) -> Result<SubsetStates> {
    let scene = plan.scene();
    let (stopped, members): (Vec<u32>, Vec<u32>) = members.into_iter().partition(|body| stops.contains_key(body));
    let members = Members::Some(members);
    let mut found = propagate_subset(scene, times, torques, &members, treatment, Watcher::Observer(observer))?;
    // Each of these has its own end and is followed alone, so that parts of a study give the same results as one run.
    for some in stopped.chunks(ALONE) {
        let alone = |&body: &u32| {
            let before = times.iter().copied().take_while(|&time| time < stops[&body]);
            let times: Vec<f64> = before.chain([stops[&body]]).collect();
            let member = Members::Some(vec![body]);
            propagate_subset(scene, &times, torques, &member, treatment, Watcher::Watch(&Watch::default()))
        };
        for of_body in parallel::map(some.len(), |index| alone(&some[index])) {
            let of_body = of_body?;
            found.states.extend(of_body.states);
            found.counts.extend(of_body.counts);
        }
        if observer(Progress { done: 0, total: 1 }).is_break() {
            return Err(Error::Interrupted { steps: 0 });
        }
    }
    Ok(found)
}

/// Finer series than a run's, and the times at which their steps end, which are those of the run's.
pub(super) fn finer_series(plan: &Plan<'_>, steps: &AdaptiveSteps) -> (Treatment, Vec<f64>) {
    (treatment_by(finer(Method::Taylor, steps)), plan.ends_of_steps(Method::Taylor).to_vec())
}

fn treatment_by(steps: AdaptiveSteps) -> Treatment {
    Treatment::Adaptive { method: Method::Taylor, precision: Precision::F64, steps }
}

/// Bodies of a group by the steps in which they are recomputed by `rk8`.
///
/// One interval of equal steps: half the run's longest step if its method is of order 6 or more, else the longest step
/// itself; halved until `rk8` follows the body's own rates. The other bodies in the sample have no influence, so parts
/// of a study give the same results as one run. A random torque is constant over each of the run's steps, so these must
/// then be used.
fn alike(
    plan: &Plan<'_>,
    group: &Group,
    torques: &[Torque],
    (members, stops): (Vec<u32>, &BTreeMap<u32, f64>),
) -> Vec<Alike> {
    let of_run = (0..plan.advance_times().len()).map(|index| group.treatment.interval(plan.span_before(index)));
    let scene = plan.scene();
    let end_of = |own: Option<u32>| own.map_or(scene.end(), |body| stops[&body]);
    let own = |body: u32| stops.contains_key(&body).then_some(body);
    if torques.iter().any(Torque::is_random) {
        let mut by_end: BTreeMap<Option<u32>, Vec<u32>> = BTreeMap::new();
        members.into_iter().for_each(|body| by_end.entry(own(body)).or_default().push(body));
        let of_run: Vec<Interval> = of_run.collect();
        // A stop is known only to an output.
        let until = |end: f64| plan.advance_times().partition_point(|&time| time <= end);
        let as_run = |(own, members)| {
            let end = end_of(own);
            Alike { members, intervals: of_run[..until(end)].to_vec(), end }
        };
        return by_end.into_iter().map(as_run).collect();
    }
    let longest = of_run.filter(|interval| interval.steps > 0).map(|interval| interval.dt).fold(0.0, f64::max);
    let coarse = match group.treatment {
        Treatment::Stepped { method, .. } => longest / shorter_by(method),
        _ => longest,
    };
    let mut by_halvings: BTreeMap<(i32, Option<u32>), Vec<u32>> = BTreeMap::new();
    for body in members {
        let step_of_body = REFERENCE_ANGLE / rate_of_body(scene, torques, body as usize).0;
        let step = |halvings: i32| coarse * 0.5_f64.powi(halvings);
        let is_enough =
            |halvings: &i32| step(*halvings) <= step_of_body || step(*halvings) * MOST_REFINEMENT <= longest;
        let halvings = (0..).find(is_enough).unwrap_or(0);
        by_halvings.entry((halvings, own(body))).or_default().push(body);
    }
    let in_steps = |((halvings, own), members)| {
        let end = end_of(own);
        Alike { members, intervals: vec![steps_over(end, coarse * 0.5_f64.powi(halvings))], end }
    };
    by_halvings.into_iter().map(in_steps).collect()
}

/// Torque-free bodies at the end, or at their stop; a body whose phases the closed form does not resolve has no state.
fn closed_form(scene: &Scene, members: &[u32], stops: &BTreeMap<u32, f64>) -> Vec<Reference> {
    // The energy does not depend on the phases.
    let wanted = match scene.stepping() {
        Stepping::Accuracy(accuracy) => {
            accuracy.attitude.into_iter().chain(accuracy.angular_velocity).fold(f64::INFINITY, f64::min)
        }
        Stepping::Statistics(_) | Stepping::Pinned { .. } | Stepping::Adaptive { .. } => 1.0,
    };
    let reference = |&body: &u32| {
        let end = stops.get(&body).copied().unwrap_or(scene.end());
        let body = body as usize;
        let is_resolved = phase_error(scene, body) <= LEAST_PART * wanted;
        let state = if is_resolved { FreeMotion::of_body(scene.ensemble(), body).at(end) } else { BodyState::UNKNOWN };
        Reference { body, state, work: None }
    };
    parallel::map(members.len(), |index| reference(&members[index]))
}

/// The greatest error of a recomputation that can still measure the requested errors, as a fraction of these.
const LEAST_PART: f64 = 0.1;

/// The possible error of the phases of a torque-free body at the end, rad: its constants have a relative resolution of
/// 2⁻⁹⁶ ([`crate::kernel::free_motion`]), so that beyond 2⁹⁶ rad (8e28) no digit of a phase is known.
fn phase_error(scene: &Scene, body: usize) -> f64 {
    let spin = scene.ensemble().angular_velocity_body()[body].length();
    crate::math::power_of_two::scaled_by_power_of_two(spin * scene.end(), -96)
}

fn contains(group: &Group, body: usize) -> bool {
    !group.members.rows(body..body + 1).is_empty()
}

impl Errors {
    /// The figures of a run, `lost` bodies of whose sample have failed and `diverged` could not be recomputed; `failed`
    /// is the share of all its bodies that have failed, `all` the number of the whole study's bodies, and `same_draws`
    /// as in [`RecomputedSample`].
    pub(crate) fn into_recomputed_sample(
        mut self,
        target: Option<&Accuracy>,
        same_draws: bool,
        (lost, diverged): (usize, usize),
        (failed, all): (f64, usize),
    ) -> RecomputedSample {
        let is_measured = !self.attitude.is_empty() && !same_draws && diverged == 0;
        let says = target.filter(|_| lost > 0 || is_measured);
        let is_whole = |target: &Accuracy| lost == 0 && failed <= 1.0 - 0.01 * target.percentile;
        if self.weights.is_empty() {
            self.weights = vec![1.0; self.attitude.len()];
        }
        let of_centres = |values: &[f64]| Quantiles::weighted(values, &self.weights_of_centres);
        let (position, velocity) = (of_centres(&self.position), of_centres(&self.velocity));
        let of = |values: &[f64]| Quantiles::weighted(values, &self.weights);
        let [attitude, angular_velocity, kinetic_energy] =
            [&self.attitude, &self.angular_velocity, &self.energy].map(|values| of(values));
        RecomputedSample {
            bodies: self.attitude.len(),
            lost,
            diverged,
            target: target.copied(),
            beyond: target.map_or(0, |target| self.beyond(target)),
            share_beyond: target.map_or(0.0, |target| self.share_beyond(target)),
            effective: self.effective(),
            same_draws,
            met: says.and_then(|target| if is_whole(target) { self.meets(target, all) } else { Some(false) }),
            attitude,
            angular_velocity,
            kinetic_energy,
            translating: self.position.len(),
            position,
            velocity,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_lost_bodies_has_not_met_its_target() {
        let asked = Accuracy::attitude(1e-6);
        let met =
            |lost, failed| Errors::default().into_recomputed_sample(Some(&asked), false, (lost, 0), (failed, 9)).met;
        assert_eq!([met(0, 0.0), met(1, 0.5), met(1, 1e-9)], [None, Some(false), Some(false)]);
        let mut errors = Errors::default();
        errors.attitude.push(1e-9);
        errors.angular_velocity.push(0.0);
        errors.energy.push(0.0);
        assert_eq!(
            errors.into_recomputed_sample(Some(&asked), false, (0, 0), (0.02, 9)).met,
            Some(false),
            "more than the percentile leaves out"
        );
    }

    /// 99 % of 20 bodies are all of them. In a sample from more bodies, one beyond the error may be chance.
    #[test]
    fn a_sample_of_all_bodies_leaves_nothing_to_chance() {
        let met = |beyond: usize, count: usize, all: usize| {
            let attitude = (0..count).map(|body| if body < beyond { 1e-3 } else { 1e-9 }).collect();
            let errors =
                Errors { attitude, angular_velocity: vec![0.0; count], energy: vec![0.0; count], ..Errors::default() };
            errors.into_recomputed_sample(Some(&Accuracy::attitude(1e-6)), false, (0, 0), (0.0, all)).met
        };
        assert_eq!([met(0, 20, 20), met(1, 20, 20), met(1, 20, 21)], [Some(true), Some(false), None]);
        assert_eq!([met(1, 100, 100), met(2, 100, 100), met(2, 100, 101)], [Some(true), Some(false), None]);
        assert_eq!([met(0, 64, 101), met(1, 64, 101), met(3, 64, 101)], [Some(true), None, Some(false)]);
        assert_eq!([met(4, 400, 9999), met(5, 400, 9999), met(9, 400, 9999)], [Some(true), None, Some(false)]);
    }
}
