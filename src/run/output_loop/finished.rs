//! The end of a run: what it says of its own accuracy.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::time::Instant;

use super::Run;
use crate::bodies::Status;
use crate::engine::{Observer, Progress};
use crate::error::{Error, Result};
use crate::plan::errors::Errors;
use crate::record::{Drift, FailedBody, Sink, Trust};
use crate::run::balance::push_rest;
use crate::run::group_run::GroupRun;
use crate::run::observed::{Comparison, compare_events, recomputed_observation};
use crate::run::recomputed_centres::recomputed_centres;
use crate::run::recomputed_sample::recomputed;
use crate::run::{adaptive_work, failure_causes, failure_times};
use crate::scene::Stepping;
use crate::torque::Torque;

impl Run<'_> {
    pub(super) fn finished(self, sink: &mut dyn Sink, observer: &mut Observer<'_>) -> Result<Trust> {
        let Self { engine, plan, observation, comparison, mut group_runs, done, total, mut end, failures, .. } = self;
        let Self { sample, sampled, sampled_centres, sampled_stops, mut wall_time, traffic, fallback, .. } = self;
        let scene = plan.scene();
        let body_count = scene.ensemble().len();
        let mut works = Vec::new();
        for group_run in &mut group_runs {
            works.extend(group_run.adaptive_work()?);
        }
        let adaptive = adaptive_work::total_work(&works, failures.count(Status::StepBelowLimit));
        let traffic = engine.traffic().since(traffic);
        let waited = traffic.waited_for_pipelines.as_secs_f64().min(wall_time.compute);
        (wall_time.start, wall_time.compute) = (wall_time.start + waited, wall_time.compute - waited);
        let mut failures = failures.finish();
        let stopped = |failed: &&FailedBody| failed.reason == Status::StepBelowLimit;
        let stopped: Vec<usize> = failures.iter().filter(stopped).map(|failed| failed.body).collect();
        let mut attempts = BTreeMap::new();
        if !stopped.is_empty() {
            for group_run in &mut group_runs {
                attempts.extend(group_run.attempts(&stopped)?);
            }
        }
        let spared = group_runs.iter().map(GroupRun::spared).fold(0, u64::saturating_add);
        drop(group_runs);

        let clock = Instant::now();
        let attempts = |body: usize| attempts.get(&body).copied().unwrap_or(u64::MAX);
        failure_times::find(plan, &mut failures, &attempts, &mut |_| observer(Progress { done, total }))?;
        failure_causes::find(plan, &mut failures);
        // The drift's quantiles are formed during the recomputation, whose few bodies do not keep all cores busy.
        let (mut drift, gathered) = (Drift::default(), std::mem::take(&mut end.drift));
        let has_failed = |body: usize| failures.binary_search_by_key(&body, |failed| failed.body).is_ok();
        // A body that has failed has no state to compare, and what it failed of may take very many steps.
        let is_left = |place: &usize| sampled[*place].is_sound() && !has_failed(sample.bodies[*place] as usize);
        let of_sample = if plan.recomputes() { sampled.len() } else { 0 };
        let left: Vec<usize> = (0..of_sample).filter(is_left).collect();
        let recomputed_bodies: Vec<u32> = left.iter().map(|&place| sample.bodies[place]).collect();
        let report = &mut |_| observer(Progress { done, total });
        let mut events = observation.map(|observation| observation.finish(&failures));
        let has_events = events.as_ref().is_some_and(|events| !events.is_empty());
        let compared = comparison.as_ref().map_or(&sample.bodies[..], Comparison::bodies);
        let outputs = comparison.as_ref().map_or(&[][..], Comparison::outputs);
        let is_left = |body: u32| !has_failed(body as usize);
        let (observed, recomputed) = rayon::in_place_scope(|scope| {
            scope.spawn(|_| drift = gathered.finish());
            let observed = match comparison.is_some() || has_events && plan.recomputes() {
                true => recomputed_observation(plan, (compared, &is_left), outputs, report)?,
                false => None,
            };
            // What the observation has followed to the end need not be followed again.
            let known = observed.as_ref().map(|observed| Cow::Borrowed(&observed.states)).unwrap_or_default();
            let recomputed = recomputed(plan, &recomputed_bodies, &sampled_stops, &known, report)?;
            Ok::<_, Error>((observed, recomputed))
        })?;
        let recomputed_centres = recomputed_centres(plan, &recomputed_bodies, &sampled_stops, report)?;
        if let (Some(events), Some(observed)) = (&mut events, &observed) {
            let left: Vec<u32> = compared.iter().copied().filter(|&body| is_left(body)).collect();
            compare_events(events, &left, observed, scene.end());
        }
        let failed = failures.len();
        let of_run = events.as_deref().unwrap_or_default();
        let statistics = comparison.map(|comparison| comparison.finish(of_run, observed.as_ref(), has_failed, failed));
        if let Some(events) = events {
            sink.events(events)?;
        }
        let mut errors = Errors::default();
        let (lost, mut diverged) = (of_sample - left.len(), 0);
        for (&place, reference) in left.iter().zip(&recomputed) {
            let (state, centre) = (&sampled[place], sampled_centres[place]);
            if !reference.state.is_sound() {
                // There is no state to compare with.
                diverged += 1;
            } else {
                let weight = sample.weight_of(reference.body);
                errors.push_weighted(state, &reference.state, weight);
                if let (Some(centre), Some(reference)) = (centre, recomputed_centres.get(&reference.body)) {
                    errors.push_centre(centre, *reference, weight);
                }
                push_rest(&mut end.balance, scene, (reference.body, weight), state, reference.work.as_ref());
            }
        }
        let draws = scene.torques().iter().any(Torque::is_random);
        let target = match scene.stepping() {
            Stepping::Accuracy(accuracy) => Some(accuracy),
            Stepping::Statistics(_) | Stepping::Pinned { .. } | Stepping::Adaptive { .. } => None,
        };
        let failed = (failures.len() as f64 / body_count.max(1) as f64, scene.part().of);
        let recomputed_sample = errors.into_recomputed_sample(target.as_ref(), draws, (lost, diverged), failed);
        wall_time.recomputed_sample = clock.elapsed().as_secs_f64();
        Ok(Trust {
            engine: engine.description(),
            fallback,
            method: plan.method(),
            precision: plan.precision(),
            longest_step: plan.longest_step(),
            parts: plan.parts(),
            body_steps: plan.body_steps().saturating_sub(spared)
                + adaptive.map_or(0, |work| work.accepted.total + work.rejected.total),
            adaptive,
            traffic,
            drift,
            balance: end.balance.finish(),
            recomputed_sample,
            statistics,
            failed_bodies: failures.iter().map(|failed| failed.body).collect(),
            failures,
            outside_usable_region: end.outside_usable_region,
            wall_time,
        })
    }
}
