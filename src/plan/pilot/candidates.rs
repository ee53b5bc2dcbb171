//! The kinds of steps that a pilot tries, and what is expected of them.

use std::cmp::Ordering;

use super::{Found, Pilot};
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::plan::choice::{Rule, Scheme, narrowest};
use crate::plan::cost::Cost;
use crate::plan::reference::Reference;
use crate::torque::Torque;
use crate::torque::force::Force;

/// Equal steps are no candidate if fewer bodies than this are tried and adaptive steps have been found good enough for the
/// reference: a few bodies hardly include the one in a hundred that errs a thousand times more in steps of one length.
const LEAST_OF_EQUAL: usize = 64;

/// The angle, rad, over which methods are compared where there is no sample.
const NOMINAL_ANGLE: f64 = 10.0;

/// The angle, rad, over which the table's coefficients of adaptive steps were measured: that of the fastest bodies there.
const TABULATED_ANGLE: f64 = 50.0;

/// The least number of equal steps that half of the bodies take in the pilot's span, if it is shorter than the run's: longer steps would be
/// cut at its end, and err less than the run's steps do.
const LEAST_STEPS: f64 = 4.0;

impl<'a> Pilot<'a> {
    /// The candidates, each with the coefficient that is expected and the time, s, that the table predicts for it.
    pub(super) fn expected(&self, reference: &Reference) -> Vec<(Rule, &'a Cost, f64, f64)> {
        // Between the coefficients of the free and the driven problem, scaled by how much harder this one was found to be.
        let expected = |start: &Rule, cost: &Cost| match start.scheme {
            Scheme::Adaptive(_) => start.coefficient,
            Scheme::Equal(_) => self.difficulty * (cost.free.coefficient * cost.driven.coefficient).sqrt(),
        };
        let seconds = |start: &Rule, cost: &Cost, coefficient: f64| {
            // The reference has taken such steps already if it is of this kind.
            let known = reference.coarse.as_ref().filter(|(rule, _)| rule.scheme == start.scheme);
            self.seconds_in_run(&Rule { coefficient, ..*start }, cost, known.and_then(|(_, sampled)| sampled.steps))
        };
        let are_few = self.bodies.len() < LEAST_OF_EQUAL.min(self.all);
        let has_others = self.allows(Scheme::TAYLOR);
        let is_candidate = |rule: &Rule| match rule.scheme {
            // A few bodies may not come to where formulas decide otherwise.
            scheme if are_few && has_others && self.may_leap(scheme) => false,
            scheme => scheme.is_adaptive() || !(are_few && reference.is_adaptive()),
        };
        let candidates = self.candidates().into_iter().filter(|(rule, _)| is_candidate(rule));
        let candidates = candidates.map(|(start, cost)| (start, cost, expected(&start, cost)));
        let with_seconds = |(start, cost, coefficient)| (start, cost, coefficient, seconds(&start, cost, coefficient));
        candidates.map(with_seconds).collect()
    }

    /// A rule with steps so long that they take no more than `limit` seconds: if it misses the target, the candidate costs more.
    pub(super) fn within(&self, start: Rule, cost: &Cost, limit: f64) -> Rule {
        let mut rule = start;
        while self.seconds_in_run(&rule, cost, None) > limit && !rule.takes_longest(self) {
            rule.coefficient /= rule.level();
        }
        rule
    }

    /// Orders results: those that meet the target first, the cheaper before the dearer; then those that miss it, the more accurate first.
    pub(super) fn order(&self, a: &Found, b: &Found) -> Ordering {
        let seconds = |found: &Found| {
            self.costs
                .of(found.rule.scheme)
                .map_or(f64::INFINITY, |cost| self.seconds_in_run(&found.rule, cost, found.steps))
        };
        let same = || if a.misses() { a.part.total_cmp(&b.part) } else { seconds(a).total_cmp(&seconds(b)) };
        a.misses().cmp(&b.misses()).then_with(same)
    }

    /// The rule of equal steps that is the cheapest by the shipped table. It depends only on the target and the torques, not on
    /// the bodies; a tolerance of adaptive steps would depend on how far these turn.
    pub fn tabulated(&self) -> Found {
        // Only Taylor series integrate them.
        if self.is_coupled() {
            let rule = self.rule(Cost::shipped(Scheme::TAYLOR), Some(Precision::F64));
            return Found::untried(rule);
        }
        let seconds = |(rule, cost): &(Rule, &Cost)| {
            let precision = rule.precision.unwrap_or_else(|| narrowest(rule.attitude, NOMINAL_ANGLE));
            self.step_seconds(rule, cost, precision) / rule.longest_step(1.0, NOMINAL_ANGLE)
        };
        let equal = self.candidates().into_iter().filter(|(rule, _)| !rule.scheme.is_adaptive());
        let cheapest = equal.min_by(|a, b| seconds(a).total_cmp(&seconds(b)));
        let fallback = || self.rule(Cost::shipped(Scheme::Equal(Method::Rk8)), self.precision);
        let rule = cheapest.map_or_else(fallback, |(rule, _)| rule);
        Found::untried(rule)
    }

    /// Whether a formula computes anything from the time alone, other than through phases.
    pub fn reads_time(&self) -> bool {
        self.torques.iter().any(Torque::reads_time)
    }

    /// Whether centres of mass are part of the motion.
    pub(super) fn is_coupled(&self) -> bool {
        self.torques.iter().any(Torque::is_coupled)
    }

    /// Every method that can follow the torques, in `f32` where its floor allows and in `f64`.
    pub(super) fn candidates(&self) -> Vec<(Rule, &'a Cost)> {
        let mut candidates = Vec::new();
        for cost in self.costs.rows().iter().filter(|cost| self.allows(cost.scheme)) {
            let wide = if cost.scheme == Scheme::TAYLOR { Some(Precision::F64) } else { None };
            let rule = self.rule(cost, self.precision.or(wide));
            candidates.push((rule, cost));
            if self.has_narrow(&rule) && rule.precision.is_none() {
                candidates.push((self.rule(cost, Some(Precision::F64)), cost));
            }
        }
        candidates
    }

    /// Whether a rule steps some of the bodies in `f32`.
    pub(super) fn has_narrow(&self, rule: &Rule) -> bool {
        self.bodies.iter().any(|(_, classification)| !rule.is_wide(classification.rate * self.scene.end()))
    }

    /// Whether this kind of steps can follow the torques on the bodies.
    pub fn allows(&self, scheme: Scheme) -> bool {
        if self.is_coupled() {
            return scheme == Scheme::TAYLOR;
        }
        match scheme {
            Scheme::Equal(method) => !method.properties().rigid_only || self.torques.iter().all(Torque::leaves_rigid),
            Scheme::Adaptive(method) => {
                let has_series = self.forms_series && self.precision != Some(Precision::F32) && self.work.has_series();
                let is_formed = match method {
                    Method::Taylor => has_series,
                    // They may pass what fades and comes back, each body at times of its own.
                    _ => !(has_series && self.work.may_fade()),
                };
                self.may_adapt() && is_formed
            }
        }
    }

    /// Whether this kind of steps can follow the bodies here, in `f64` on the CPU, though the run's engine or precision may not.
    pub fn can_follow(&self, scheme: Scheme) -> bool {
        self.allows(scheme) || scheme == Scheme::TAYLOR && self.may_adapt() && self.work.has_series()
    }

    /// Whether bodies may choose their steps.
    fn may_adapt(&self) -> bool {
        let draws = self.torques.iter().any(Torque::is_random);
        let thrust = self.scene.forces().iter().any(Force::needs_attitude);
        self.scene.may_skip() && !draws && !thrust
    }

    /// Whether steps of this kind may pass, within a step, the place where a formula decides otherwise: only those of series end there.
    pub fn may_leap(&self, scheme: Scheme) -> bool {
        self.work.is_piecewise() && scheme != Scheme::TAYLOR
    }

    /// The rule that the table gives, before bodies are tried. Errors of adaptive steps add up over the angle that bodies turn.
    pub fn rule(&self, cost: &Cost, precision: Option<Precision>) -> Rule {
        let fastest = self.bodies.iter().map(|(_, classification)| classification.rate).fold(0.0, f64::max);
        let longer = match cost.scheme {
            Scheme::Equal(_) => 1.0,
            Scheme::Adaptive(_) => {
                self.difficulty * (fastest * self.scene.end() / self.slowing / TABULATED_ANGLE).max(1.0)
            }
        };
        let longest_angle = if self.span < self.scene.end() && !cost.scheme.is_adaptive() {
            cost.longest_angle.min(self.median_rate() * self.span / LEAST_STEPS)
        } else {
            cost.longest_angle
        };
        Rule {
            scheme: cost.scheme,
            coefficient: longer * cost.coefficient(self.torques.is_empty()),
            longest_angle,
            attitude: self.accuracy.strictest(),
            precision,
        }
    }

    /// The median rate, rad/s, of the bodies that turn; infinite if none does.
    pub(super) fn median_rate(&self) -> f64 {
        let rates = self.bodies.iter().map(|(_, classification)| classification.rate);
        let mut rates: Vec<f64> = rates.filter(|rate| *rate > 0.0).collect();
        rates.sort_by(f64::total_cmp);
        rates.get(rates.len() / 2).copied().unwrap_or(f64::INFINITY)
    }
}
