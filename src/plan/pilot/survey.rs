//! Surveys: more bodies than a pilot follows finely, in loose steps, which show how much more the most sensitive ones err.
//!
//! Errors of adaptive steps go as their tolerance, so that one body errs so many times as much as another in any of them, and loose ones cost
//! a fraction of the run's. Where some bodies amplify errors by many orders of magnitude and others do not, a few bodies hardly show it: of
//! 300 CubeSats that tumble for six hours under two torques, one in a hundred errs 1e6 times as much as half of them. The logarithms of their
//! errors in steps at 1e-6 and at 1e-10 had a correlation of 0.9.

use super::Pilot;
use crate::error::Result;
use crate::math::Precision;
use crate::plan::choice::{Classification, Rule, Scheme};
use crate::plan::cost::Cost;
use crate::plan::reference::SATURATED;
use crate::plan::sampled::States;
use crate::plan::sampling::sample;

/// The greatest tolerance of the steps, the error, rad, that they are to make, and the factor by which the tolerance is reduced where errors no longer
/// grow in proportion to their cause.
const GREATEST_TOLERANCE: f64 = 1e-5;
const ERROR: f64 = 1e-3;
const STRICTER: f64 = 1e-4;
/// The factor in the tolerance of the steps with which these are compared.
const FINER: f64 = 1e-2;

/// One body in this many takes part, or as many as take these seconds of a core of the table; at least twice as many as the pilot has, and
/// [`MOST_BODIES`] at most.
const ONE_IN: usize = 32;
const FREE_SECONDS: f64 = 2e-3;
const MOST_BODIES: usize = 64;
/// If the greatest error is this many times the median, [`MOST_BODIES`] take part; but no more than one in this many of the class, or than take
/// these seconds, so that a survey of few bodies over a long time does not take as long as their run.
const HEAVY: f64 = 30.0;
const LEAST_OF_CLASS: usize = 16;
const MOST_SECONDS: f64 = 0.5;

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
    /// The kind of its steps and their tolerance.
    pub steps: (Scheme, f64),
}

impl Pilot<'_> {
    /// The kind of steps of a survey, that of a probe, or series where formulas decide between cases: errors of other steps, which pass a
    /// decision, do not go as the tolerance. `None` if bodies may not choose such steps, or end them where sampled torques change.
    pub(super) fn surveying_scheme(&self) -> Option<Scheme> {
        match self.work.is_piecewise() {
            true => Some(Scheme::TAYLOR).filter(|scheme| self.can_follow(*scheme) && self.changes() == 0.0),
            false => self.probing_scheme(),
        }
    }

    /// A survey of a class; `None` if loose steps tell nothing.
    pub(super) fn surveyed(
        &self,
        class: &[u32],
        classification: impl Fn(u32) -> Classification,
    ) -> Result<Option<Survey>> {
        let Some(scheme) = self.surveying_scheme() else { return Ok(None) };
        let expected = self.rule(Cost::shipped(scheme), Some(Precision::F64)).coefficient;
        let tolerance = (ERROR / expected).min(GREATEST_TOLERANCE);
        // Such steps cost as much as the run's, and finer ones are the same.
        if self.is_cut_short(&self.loose(scheme, FINER * tolerance)) {
            return Ok(None);
        }
        let of_body =
            self.seconds(&self.loose(scheme, tolerance), Cost::shipped(scheme), None) / self.bodies.len() as f64;
        let affordable = |one_in: usize, seconds: f64| {
            (self.all / one_in).max((0.5 * seconds / of_body) as usize).max(2 * self.bodies.len())
        };
        let most = MOST_BODIES.min(self.enough()).min(affordable(LEAST_OF_CLASS, MOST_SECONDS));
        let count = affordable(ONE_IN, FREE_SECONDS).min(most);
        let survey = |count: usize, tolerance: f64| self.survey(class, &classification, count, (scheme, tolerance));
        let Some(first) = survey(count, tolerance)? else { return Ok(None) };
        let second = match first.is_saturated {
            true => survey(most, STRICTER * tolerance)?,
            false if first.spread > HEAVY && count < most => survey(most, tolerance)?,
            false => None,
        };
        Ok(Some(second.unwrap_or(first)))
    }

    /// Steps at a tolerance.
    pub(super) fn loose(&self, scheme: Scheme, tolerance: f64) -> Rule {
        let rule = self.rule(Cost::shipped(scheme), Some(Precision::F64));
        Rule { coefficient: rule.attitude / tolerance, ..rule }
    }

    /// A survey of `count` bodies and the pilot's in steps at a tolerance; `None` if their errors are nothing or not known.
    pub(super) fn survey(
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
        let with_rate = bodies.into_iter().map(|body| (body, classification(body)));
        let surveyed = Self { bodies: with_rate.filter(|body| self.follows(body)).collect(), ..*self };
        let states = |rule: &Rule| -> Result<States> {
            let mut states = surveyed.stepped(rule)?.states;
            states.retain(|_, state| state.is_sound());
            Ok(states)
        };
        let (coarse, fine) = (states(&rule)?, states(&finer)?);
        let own = own.into_iter().filter_map(|body| Some((body as usize, *coarse.get(&(body as usize))?))).collect();
        let (mut of_all, mut of_own) = (self.errors(&coarse, &fine), self.errors(&own, &fine));
        let bodies = of_all.attitude.len();
        let error = of_all.error_ratio(self.accuracy, self.all).attitude;
        let excess = error / of_own.error_ratio(self.accuracy, self.all).attitude;
        // Bodies at rest err by nothing.
        of_all.attitude.retain(|error| *error > 0.0);
        let (spread, is_saturated) = (of_all.spread(0.0), error >= SATURATED);
        Ok(excess.is_finite().then_some(Survey {
            bodies,
            spread,
            excess: excess.max(1.0),
            is_saturated,
            steps: (scheme, tolerance),
        }))
    }
}
