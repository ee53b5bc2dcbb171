//! The outcome of a run, for the metadata of tables, as far as it depends neither on the division into parts nor on the
//! machine.

use serde::Serialize;
use serde_json::Value;

use crate::plan::Plan;
use crate::plan::sampling::verdict;
use crate::record::folder::Metadata;
use crate::record::report::{AccuracyReport, FailureReport};
use crate::record::{FailedBody, Trust};

/// The facts that are the same for one run of all bodies and for its merged parts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Outcome {
    /// Number of bodies.
    pub bodies: usize,
    /// Number of output times.
    pub outputs: usize,
    /// Simulated time, s.
    pub span: f64,
    /// Errors at the end.
    pub accuracy: MergedAccuracy,
    /// The numbers of failed bodies by reason.
    pub failures: Vec<FailureReport>,
}

impl Outcome {
    /// The outcome of one run.
    pub fn of(plan: &Plan<'_>, trust: &Trust) -> Self {
        let bodies = plan.scene().ensemble().len();
        let accuracy = AccuracyReport::of(&trust.recomputed_sample, trust.failures.len());
        let accuracy = serde_json::to_value(accuracy).unwrap_or_default();
        Self {
            bodies,
            outputs: plan.times().len(),
            span: plan.scene().end(),
            accuracy: MergedAccuracy::of(std::iter::once((&accuracy, bodies)), &trust.failures, bodies),
            failures: FailureReport::of(&trust.failures),
        }
    }

    /// The entry of the metadata.
    pub fn metadata(&self) -> Metadata {
        vec![("polhode.report".to_owned(), serde_json::to_string(self).unwrap_or_default())]
    }
}

/// Errors at the end of the recomputed samples of all parts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MergedAccuracy {
    /// Number of bodies in the samples.
    pub bodies: usize,
    /// The greatest attitude error, rad.
    pub attitude_max: Option<f64>,
    /// The greatest error of the angular velocity, relative.
    pub angular_velocity_max: Option<f64>,
    /// The greatest error of the kinetic energy, relative.
    pub kinetic_energy_max: Option<f64>,
    /// Bodies that exceed one of the requested errors.
    pub beyond: usize,
    /// Whether the samples agree with the requested errors; `null` where none were requested, or nothing is known.
    pub met: Option<bool>,
}

impl MergedAccuracy {
    /// Combines the samples of all parts, from their reports.
    ///
    /// Each part comes with the number of its bodies, for which its sample stands.
    pub(super) fn of<'a>(
        all: impl Iterator<Item = (&'a Value, usize)> + Clone,
        failures: &[FailedBody],
        bodies: usize,
    ) -> Self {
        let parts = all.clone().map(|(part, _)| part);
        let sum = |key: &str| parts.clone().filter_map(|part| part[key].as_u64()).sum::<u64>() as usize;
        let max = |key: &str| parts.clone().filter_map(|part| part[key]["max"].as_f64()).reduce(f64::max);
        let percentile = parts.clone().find_map(|part| part["target"]["percentile"].as_f64());
        let draws = parts.clone().any(|part| part["same_draws"].as_bool() == Some(true));
        let (sampled, beyond) = (sum("bodies"), sum("beyond"));
        let is_known = sum("lost") > 0 || (sampled > 0 && !draws && sum("diverged") == 0);
        let (share, effective) = together(all);
        let met = |percentile: f64| {
            let part = 0.01 * percentile;
            let failed = failures.len() as f64 / bodies.max(1) as f64;
            let is_whole = sum("lost") == 0 && failed <= 1.0 - part;
            if is_whole { verdict(share, effective, part) } else { Some(false) }
        };
        Self {
            bodies: sampled,
            attitude_max: max("attitude"),
            angular_velocity_max: max("angular_velocity"),
            kinetic_energy_max: max("kinetic_energy"),
            beyond,
            met: percentile.filter(|_| is_known).and_then(met),
        }
    }
}

/// The share of all bodies that exceed the requested errors, and the number of evenly drawn bodies that would carry as
/// much information as the samples of all parts.
fn together<'a>(parts: impl Iterator<Item = (&'a Value, usize)>) -> (f64, f64) {
    let (mut bodies, mut beyond, mut squares) = (0.0, 0.0, 0.0);
    for (part, count) in parts {
        let number = |key: &str| part[key].as_f64().filter(|number| number.is_finite());
        let (Some(share), Some(effective)) = (number("share_beyond"), number("effective").filter(|&x| x > 0.0)) else {
            continue;
        };
        let count = count as f64;
        bodies += count;
        beyond += share * count;
        squares += count * count / effective;
    }
    if bodies > 0.0 { (beyond / bodies, bodies * bodies / squares) } else { (0.0, 0.0) }
}
