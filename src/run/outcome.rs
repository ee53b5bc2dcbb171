//! How a run went, as far as neither its cut into parts nor the machine changes it: what the metadata of tables say of it.

use serde::Serialize;
use serde_json::Value;

use crate::plan::Plan;
use crate::plan::sampling::is_plausible;
use crate::record::folder::Metadata;
use crate::record::report::{AccuracyReport, FailureReport};
use crate::record::{FailedBody, Trust};

/// What one run of all bodies and the merged parts of one say alike.
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
    /// How many bodies have failed for which reason.
    pub failures: Vec<FailureReport>,
}

impl Outcome {
    /// Of one run.
    pub fn of(plan: &Plan<'_>, trust: &Trust) -> Self {
        let bodies = plan.scene().ensemble().len();
        let accuracy = AccuracyReport::of(&trust.recomputed_sample, trust.failures.len());
        let accuracy = serde_json::to_value(accuracy).unwrap_or_default();
        Self {
            bodies,
            outputs: plan.times().len(),
            span: plan.scene().end(),
            accuracy: MergedAccuracy::of(std::iter::once(&accuracy), &trust.failures, bodies),
            failures: FailureReport::of(&trust.failures),
        }
    }

    /// The entry of the metadata.
    pub fn metadata(&self) -> Metadata {
        vec![("polhode.report".to_owned(), serde_json::to_string(self).unwrap_or_default())]
    }
}

/// Errors at the end of a sample of bodies that was recomputed more accurately: those of all parts' samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MergedAccuracy {
    /// Bodies behind the figures.
    pub bodies: usize,
    /// The greatest attitude error, rad.
    pub attitude_max: Option<f64>,
    /// The greatest error of the angular velocity, relative.
    pub angular_velocity_max: Option<f64>,
    /// The greatest error of the kinetic energy, relative.
    pub kinetic_energy_max: Option<f64>,
    /// Bodies that are beyond one of the errors asked for.
    pub beyond: usize,
    /// Whether the sample agrees with what was asked for; `null` where nothing was asked for, or nothing is known.
    pub met: Option<bool>,
}

impl MergedAccuracy {
    /// What the samples of all parts say together, as their reports have it.
    pub(super) fn of<'a>(
        parts: impl Iterator<Item = &'a Value> + Clone,
        failures: &[FailedBody],
        bodies: usize,
    ) -> Self {
        let sum = |key: &str| parts.clone().filter_map(|part| part[key].as_u64()).sum::<u64>() as usize;
        let max = |key: &str| parts.clone().filter_map(|part| part[key]["max"].as_f64()).reduce(f64::max);
        let percentile = parts.clone().find_map(|part| part["target"]["percentile"].as_f64());
        let draws = parts.clone().any(|part| part["same_draws"].as_bool() == Some(true));
        let (sampled, beyond) = (sum("bodies"), sum("beyond"));
        let is_known = sum("lost") > 0 || (sampled > 0 && !draws && sum("diverged") == 0);
        let met = |percentile: f64| {
            let part = 0.01 * percentile;
            let failed = failures.len() as f64 / bodies.max(1) as f64;
            sum("lost") == 0 && failed <= 1.0 - part && is_plausible(beyond, sampled, part)
        };
        Self {
            bodies: sampled,
            attitude_max: max("attitude"),
            angular_velocity_max: max("angular_velocity"),
            kinetic_energy_max: max("kinetic_energy"),
            beyond,
            met: percentile.filter(|_| is_known).map(met),
        }
    }
}
