//! A sample of a run's bodies, recomputed more accurately.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::bodies::BodyState;
use crate::bodies::Members;
use crate::engine::Observer;
use crate::error::Result;
use crate::kernel::free_motion::FreeMotion;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::math::Quantiles;
use crate::plan::errors::Errors;
use crate::plan::recomputation::{EQUAL_FOR_ADAPTIVE, MOST_REFINEMENT, REFERENCE_ANGLE, finer, is_finer, shorter_by};
use crate::plan::sampling::sample;
use crate::plan::subset::{Watcher, propagate_subset};
use crate::plan::{Group, Plan, TorqueSet, Treatment, steps_over};
use crate::record::RecomputedSample;
use crate::run::torque_work::{self, Alike, Recomputed, Work};
use crate::scene::AdaptiveSteps;
use crate::scene::{Accuracy, Part, Scene, Stepping};
use crate::torque::{self, Torque};

/// Selects the bodies whose motion is recomputed; fixed, so that two runs of a plan are checked on the same bodies.
pub(super) const SAMPLE_SEED: u64 = 0;

/// The bodies of a plan whose motion is recomputed: of a part of a scene those that are in the sample of the whole, so that all parts together
/// recompute what one run does.
pub(super) fn sample_of_part(plan: &Plan<'_>) -> Vec<u32> {
    let (Part { first_body, of }, body_count) = (plan.scene().part(), plan.scene().ensemble().len());
    let all = sample(of, plan.recomputation().bodies, SAMPLE_SEED);
    let own = |body: &usize| (first_body..first_body + body_count).contains(body);
    let own = all.into_iter().map(|body| body as usize).filter(own);
    own.map(|body| (body - first_body) as u32).collect()
}

/// A body of the sample at the end, and, of a body on which torques act, what they did to it.
pub(super) struct Reference {
    pub body: usize,
    pub state: BodyState,
    pub work: Option<Work>,
}

/// The bodies of a sample recomputed on the CPU in `f64`: torque-free ones by the closed form, the others by `rk8` in the
/// steps of [`alike`], or, where the run's steps are adaptive, in adaptive steps too.
pub(super) fn recomputed(plan: &Plan<'_>, sample: &[u32], observer: &mut Observer<'_>) -> Result<Vec<Reference>> {
    let scene = plan.scene();
    let mut references = Vec::with_capacity(sample.len());
    for group in plan.groups() {
        let members: Vec<u32> = sample.iter().copied().filter(|&body| contains(group, body as usize)).collect();
        let acting = |&body: &u32| !TorqueSet::acting_on(scene.torques(), body as usize).is_empty();
        let stepped = group.treatment.precision_of_steps().is_some();
        let (driven, free): (Vec<u32>, Vec<u32>) = members.into_iter().partition(|body| stepped && acting(body));
        references.extend(closed_form(scene, &free));
        if !driven.is_empty() {
            let torques = group.class.torques.of(scene.torques());
            if let Treatment::Adaptive { method, steps, .. } = group.treatment {
                references.extend(adaptively(plan, &torques, driven, (method, &steps), observer)?);
                continue;
            }
            let found = torque_work::recomputed(scene, &torques, alike(plan, group, &torques, driven), observer)?;
            let reference = |Recomputed { body, state, work }| Reference { body, state, work: Some(work) };
            references.extend(found.into_iter().map(reference));
        }
    }
    references.sort_by_key(|reference| reference.body);
    Ok(references)
}

/// Bodies recomputed in adaptive steps; what torques do to them on the way in equal ones, of which each body takes at least as
/// many as it has chosen, unless that would take too long.
fn adaptively(
    plan: &Plan<'_>,
    torques: &[Torque],
    members: Vec<u32>,
    (method, steps): (Method, &AdaptiveSteps),
    observer: &mut Observer<'_>,
) -> Result<Vec<Reference>> {
    let scene = plan.scene();
    let fine = finer(method, steps);
    let found = propagate_subset(
        scene,
        plan.times(),
        torques,
        &Members::Some(members),
        &Treatment::Adaptive { method: Method::Rk8, precision: Precision::F64, steps: fine },
        Watcher::Observer(observer),
    )?;
    let is_finer = is_finer(&fine, steps);
    if is_finer && !plan.recomputation().balances {
        return Ok(found.states.into_iter().map(|(body, state)| Reference { body, state, work: None }).collect());
    }
    let mut alike: BTreeMap<u64, Vec<u32>> = BTreeMap::new();
    for ((body, _), counts) in found.states.iter().zip(&found.counts) {
        alike.entry(counts.accepted.max(1).next_power_of_two()).or_default().push(*body as u32);
    }
    let in_equal_steps = |(count, members): (u64, Vec<u32>)| {
        let steps = count.saturating_mul(EQUAL_FOR_ADAPTIVE);
        Alike { members, intervals: vec![steps_over(scene.end(), scene.end() / steps as f64)] }
    };
    let equal = torque_work::recomputed(scene, torques, alike.into_iter().map(in_equal_steps).collect(), observer)?;
    let equal: BTreeMap<usize, Recomputed> = equal.into_iter().map(|found| (found.body, found)).collect();
    let reference = |(body, state): (usize, BodyState)| match equal.get(&body) {
        Some(found) => Reference { body, state: if is_finer { state } else { found.state }, work: Some(found.work) },
        None => Reference { body, state, work: None },
    };
    Ok(found.states.into_iter().map(reference).collect())
}

/// Bodies of a group by the steps in which they are recomputed by `rk8`.
///
/// One interval of equal steps, of half the longest that the run takes where its method is of order 6 or more, else as
/// long as that one; halved until `rk8` follows the body's own rates. What other bodies are in the sample changes nothing, so that parts
/// of a study find what one run does. A random torque is a constant over each of the run's steps, so that the steps then have to be the
/// run's.
fn alike(plan: &Plan<'_>, group: &Group, torques: &[Torque], members: Vec<u32>) -> Vec<Alike> {
    let of_run = (0..plan.times().len()).map(|index| group.treatment.interval(plan.span_before(index)));
    if torques.iter().any(Torque::is_random) {
        return vec![Alike { members, intervals: of_run.collect() }];
    }
    let scene = plan.scene();
    let longest = of_run.filter(|interval| interval.steps > 0).map(|interval| interval.dt).fold(0.0, f64::max);
    let coarse = match group.treatment {
        Treatment::Stepped { method, .. } => longest / shorter_by(method),
        _ => longest,
    };
    let rate = |body: usize| {
        let middle_moment = crate::bodies::inertia::principal_axes(&scene.ensemble().inertia()[body]).moments.y;
        let spin = scene.ensemble().angular_velocity_body()[body].length();
        let growth =
            torque::variable_inertia::spin_growth(torques, body, &scene.ensemble().inertia()[body], scene.end());
        let driven =
            torque::rate_of(torques, body, middle_moment).max(torque::damping_of(torques, body, middle_moment));
        (spin * growth).max(driven)
    };
    let mut by_halvings: BTreeMap<i32, Vec<u32>> = BTreeMap::new();
    for body in members {
        let own = REFERENCE_ANGLE / rate(body as usize);
        let step = |halvings: i32| coarse * 0.5_f64.powi(halvings);
        let is_enough = |halvings: &i32| step(*halvings) <= own || step(*halvings) * MOST_REFINEMENT <= longest;
        let halvings = (0..).find(is_enough).unwrap_or(0);
        by_halvings.entry(halvings).or_default().push(body);
    }
    let in_steps = |(halvings, members)| {
        let intervals = vec![steps_over(scene.end(), coarse * 0.5_f64.powi(halvings))];
        Alike { members, intervals }
    };
    by_halvings.into_iter().map(in_steps).collect()
}

/// Torque-free bodies at the end; those whose phases the closed form does not resolve have no state.
fn closed_form(scene: &Scene, members: &[u32]) -> Vec<Reference> {
    // The energy does not depend on the phases.
    let wanted = match scene.stepping() {
        Stepping::Accuracy(accuracy) => {
            accuracy.attitude.into_iter().chain(accuracy.angular_velocity).fold(f64::INFINITY, f64::min)
        }
        Stepping::Statistics(_) | Stepping::Pinned { .. } | Stepping::Adaptive { .. } => 1.0,
    };
    let reference = |&body: &u32| {
        let body = body as usize;
        let is_resolved = phase_error(scene, body) <= LEAST_PART * wanted;
        let state =
            if is_resolved { FreeMotion::of_body(scene.ensemble(), body).at(scene.end()) } else { BodyState::UNKNOWN };
        Reference { body, state, work: None }
    };
    members.par_iter().map(reference).collect()
}

/// The part of the errors asked for that a recomputation may be wrong by and still measure them.
const LEAST_PART: f64 = 0.1;

/// How far the phases of a torque-free body may be off at the end, rad: its constants are resolved to 2⁻⁹⁶ of themselves
/// ([`crate::kernel::free_motion`]), so that beyond 2⁹⁶ rad (8e28) no digit of a phase is known.
fn phase_error(scene: &Scene, body: usize) -> f64 {
    let spin = scene.ensemble().angular_velocity_body()[body].length();
    crate::math::power_of_two::scaled_by_power_of_two(spin * scene.end(), -96)
}

fn contains(group: &Group, body: usize) -> bool {
    !group.members.rows(body..body + 1).is_empty()
}

impl Errors {
    /// What a run says of itself, of whose sample `lost` bodies have failed and `diverged` could not be recomputed, and of all of its
    /// bodies the part `failed`; `all` is the number of the whole study's, `same_draws` as in [`RecomputedSample`].
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
        RecomputedSample {
            bodies: self.attitude.len(),
            lost,
            diverged,
            target: target.copied(),
            beyond: target.map_or(0, |target| self.beyond(target)),
            same_draws,
            met: says.map(|target| is_whole(target) && self.meets(target, all)),
            attitude: Quantiles::of(&mut self.attitude),
            angular_velocity: Quantiles::of(&mut self.angular_velocity),
            kinetic_energy: Quantiles::of(&mut self.energy),
            translating: self.position.len(),
            position: Quantiles::of(&mut self.position),
            velocity: Quantiles::of(&mut self.velocity),
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

    /// Of 20 bodies 99 % are all of them. As a sample of more, one beyond is no wonder.
    #[test]
    fn a_sample_of_all_bodies_leaves_nothing_to_chance() {
        let met = |beyond: usize, count: usize, all: usize| {
            let attitude = (0..count).map(|body| if body < beyond { 1e-3 } else { 1e-9 }).collect();
            let errors =
                Errors { attitude, angular_velocity: vec![0.0; count], energy: vec![0.0; count], ..Errors::default() };
            errors.into_recomputed_sample(Some(&Accuracy::attitude(1e-6)), false, (0, 0), (0.0, all)).met
        };
        assert_eq!([met(0, 20, 20), met(1, 20, 20), met(1, 20, 21)], [Some(true), Some(false), Some(true)]);
        assert_eq!([met(1, 100, 100), met(2, 100, 100), met(2, 100, 101)], [Some(true), Some(false), Some(true)]);
    }
}
