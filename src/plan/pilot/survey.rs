//! Surveys: more bodies than a pilot follows finely, in loose steps, which show how much more the most sensitive ones err.
//!
//! Errors of adaptive steps go as their tolerance, so that one body errs so many times as much as another in any of them, and loose ones cost
//! a fraction of the run's. Where some bodies amplify errors by many orders of magnitude and others do not, a few bodies hardly show it: of
//! 300 CubeSats that tumble for six hours under two torques, one in a hundred errs 1e6 times as much as half of them. The logarithms of their
//! errors in steps at 1e-6 and at 1e-10 had a correlation of 0.9.

use super::Pilot;
use crate::bodies::frame::attitude_error;
use crate::error::Result;
use crate::math::{Precision, Quantiles};
use crate::plan::choice::{Classification, Rule, Scheme};
use crate::plan::cost::Cost;
use crate::plan::reference::SATURATED;
use crate::plan::sampling::{sample, upper_rank};

/// The tolerance of the steps, and a stricter one where errors no longer grow in proportion to their cause.
const TOLERANCE: f64 = 1e-5;
const STRICTER: f64 = 1e-9;
/// The factor in the tolerance of the steps with which these are compared.
const FINER: f64 = 1e-2;

/// One body in this many takes part, or as many as take these seconds of a core of the table; at least twice as many as the pilot has, and
/// [`MOST_BODIES`] at most.
const ONE_IN: usize = 16;
const FREE_SECONDS: f64 = 2e-3;
const MOST_BODIES: usize = 64;
/// If the greatest error is this many times the median, [`MOST_BODIES`] take part.
const HEAVY: f64 = 30.0;

/// What a survey shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::plan) struct Survey {
    /// Number of bodies, those of the pilot among them.
    pub bodies: usize,
    /// The greatest of their errors as a multiple of the median.
    pub spread: f64,
    /// Their error at the percentile asked for as a multiple of that of the pilot's bodies.
    pub excess: f64,
    /// Whether that error no longer grows in proportion to its cause.
    is_saturated: bool,
    /// The tolerance of the steps.
    tolerance: f64,
}

impl Pilot<'_> {
    /// The steps of a survey: `rk8`, whose loose steps are the cheaper ones, or series. `None` if bodies may choose neither, and where formulas
    /// decide between cases: errors of the steps that pass a decision do not go as the tolerance.
    fn surveying_scheme(&self) -> Option<Scheme> {
        let mut schemes = [Scheme::ADAPTIVE_RK8, Scheme::TAYLOR].into_iter();
        schemes.find(|scheme| self.allows(*scheme)).filter(|_| !self.work.is_piecewise())
    }

    /// Whether there can be a survey.
    pub(super) fn surveys(&self) -> bool {
        self.surveying_scheme().is_some()
    }

    /// A survey of a class; `None` if loose steps tell nothing.
    pub(super) fn surveyed(
        &self,
        class: &[u32],
        classification: impl Fn(u32) -> Classification,
    ) -> Result<Option<Survey>> {
        let Some(scheme) = self.surveying_scheme() else { return Ok(None) };
        let most = MOST_BODIES.min(self.enough());
        let of_body =
            self.seconds(&self.loose(scheme, TOLERANCE), Cost::shipped(scheme), None) / self.bodies.len() as f64;
        let affordable = (self.all / ONE_IN).max((0.5 * FREE_SECONDS / of_body) as usize);
        let count = affordable.max(2 * self.bodies.len()).min(most);
        let survey = |count: usize, tolerance: f64| self.survey(class, &classification, count, (scheme, tolerance));
        let Some(first) = survey(count, TOLERANCE)? else { return Ok(None) };
        let second = match first.is_saturated {
            true => survey(most, STRICTER)?,
            false if first.spread > HEAVY && count < most => survey(most, TOLERANCE)?,
            false => None,
        };
        Ok(Some(second.unwrap_or(first)))
    }

    /// The survey with as many bodies as the percentile needs.
    pub(super) fn surveyed_further(
        &self,
        class: &[u32],
        classification: impl Fn(u32) -> Classification,
        survey: Survey,
    ) -> Result<Option<Survey>> {
        let Some(scheme) = self.surveying_scheme() else { return Ok(None) };
        self.survey(class, classification, self.enough(), (scheme, survey.tolerance))
    }

    /// Steps at a tolerance.
    fn loose(&self, scheme: Scheme, tolerance: f64) -> Rule {
        let rule = self.rule(Cost::shipped(scheme), Some(Precision::F64));
        Rule { coefficient: rule.attitude / tolerance, ..rule }
    }

    /// A survey of `count` bodies and the pilot's in steps at a tolerance; `None` if their errors are nothing or not known.
    fn survey(
        &self,
        class: &[u32],
        classification: impl Fn(u32) -> Classification,
        count: usize,
        (scheme, tolerance): (Scheme, f64),
    ) -> Result<Option<Survey>> {
        let [rule, finer] = [1.0, FINER].map(|part| self.loose(scheme, part * tolerance));
        let own: Vec<u32> = self.bodies.iter().map(|(body, _)| *body).collect();
        let drawn = sample(class.len(), count.min(class.len()), super::SEED).into_iter();
        let mut bodies: Vec<u32> = drawn.map(|index| class[index as usize]).chain(own.iter().copied()).collect();
        bodies.sort_unstable();
        bodies.dedup();
        let surveyed = Self { bodies: bodies.into_iter().map(|body| (body, classification(body))).collect(), ..*self };
        let (coarse, fine) = (surveyed.stepped(&rule)?.states, surveyed.stepped(&finer)?.states);
        let (mut of_all, mut of_own) = (Vec::with_capacity(coarse.len()), Vec::with_capacity(own.len()));
        for (body, state) in &coarse {
            if let Some(reference) = fine.get(body).filter(|reference| reference.is_sound() && state.is_sound()) {
                let error = attitude_error(state, reference);
                of_all.push(error);
                of_own.extend(own.contains(&(*body as u32)).then_some(error));
            }
        }
        let part = 0.01 * self.accuracy.percentile;
        let at_percentile = |errors: &mut Vec<f64>| {
            let count = errors.len();
            let rank = if count < self.all { upper_rank(count, part) as f64 / count as f64 } else { part };
            Quantiles::rank(errors, rank)
        };
        let (bodies, error) = (of_all.len(), at_percentile(&mut of_all));
        let (excess, is_saturated) = (error / at_percentile(&mut of_own), error >= SATURATED);
        // Bodies at rest err by nothing.
        of_all.retain(|error| *error > 0.0);
        let [median, greatest] = [0.5, 1.0].map(|rank| Quantiles::rank(&mut of_all, rank));
        let survey = Survey { bodies, spread: greatest / median, excess: excess.max(1.0), is_saturated, tolerance };
        Ok(excess.is_finite().then_some(survey))
    }
}
