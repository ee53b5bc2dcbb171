//! The pilot: a few bodies of a class, integrated ahead, to find the step that meets an accuracy.
//!
//! For each candidate method a sample of the class's bodies is stepped on the CPU with the steps that the class would take, and
//! compared with a much finer reference. As the error goes as the step to the method's order, the measured error corrects
//! the coefficient of the method's [`Rule`]; once more stepped, it must then be within the target. The candidate that
//! needs the least time is taken.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use super::choice::{Look, Rule, narrowest};
use super::cost::{COSTS, Cost};
use super::group::{Members, Treatment, level_of, step_of};
use crate::batch::{BodyState, Precision};
use crate::error::Result;
use crate::run::alone::states_at_end;
use crate::run::shadow::{Errors, sample};
use crate::scene::{Accuracy, Scene};
use crate::torque::Torque;

/// The most bodies of a class in its pilot.
const MOST_BODIES: usize = 128;
/// The least, as far as there are so many.
const LEAST_BODIES: usize = 32;
/// At most every so many-th body, so that the pilot stays small beside the run.
const ONE_IN: usize = 16;

/// What part of the target the sample's error is brought to. The percentile of the sample is not that of the class: among
/// 128 bodies the 99th percentile is the second largest error, which scatters by a factor of two.
const AIM: f64 = 0.25;
/// What part of the target is good enough.
const ENOUGH: f64 = 0.5;
/// How often a coefficient is corrected.
const CORRECTIONS: usize = 5;
/// The reference's error as a part of the target.
const REFERENCE: f64 = 1e-3;
/// The least error that a reference in `f64` is asked for, rad.
const LEAST_REFERENCE: f64 = 1e-14;
/// Output times beyond which the pilot goes to the end in one go.
const MOST_TIMES: usize = 1000;
/// A candidate that is this much dearer before its pilot is not tried.
const HOPELESS: f64 = 30.0;

/// What a pilot found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// How the class is stepped.
    pub rule: Rule,
    /// The sample's error as a part of the target, at the percentile asked for.
    pub part: f64,
    /// Bodies behind it.
    pub bodies: usize,
}

/// A class's bodies and what is asked of them.
pub(super) struct Pilot<'a> {
    pub scene: &'a Scene,
    pub accuracy: &'a Accuracy,
    pub times: &'a [f64],
    pub torques: &'a [Torque],
    pub precision: Option<Precision>,
    /// The sample with the looks at them.
    pub bodies: Vec<(u32, Look)>,
}

/// The bodies of a pilot among those of a class.
pub(super) fn pilot_sample(class: &[u32], seed: u64) -> Vec<u32> {
    let count = (class.len() / ONE_IN).clamp(LEAST_BODIES, MOST_BODIES).min(class.len());
    sample(class.len(), count, seed).into_iter().map(|index| class[index as usize]).collect()
}

impl Pilot<'_> {
    /// The cheapest rule that meets the target in the sample; the most accurate where none does.
    pub fn fly(&self) -> Result<Found> {
        let reference = self.reference()?;
        let mut best: Option<(Found, f64)> = None;
        for cost in COSTS {
            let start = self.rule(cost);
            let hopeless = best
                .is_some_and(|(found, seconds)| found.part <= 1.0 && self.seconds(&start, cost) > HOPELESS * seconds);
            if hopeless {
                continue;
            }
            let found = self.calibrated(start, &reference)?;
            let seconds = self.seconds(&found.rule, cost);
            let better = best.is_none_or(|(other, other_seconds)| match (found.part <= 1.0, other.part <= 1.0) {
                (true, true) => seconds < other_seconds,
                (met, other_met) => !other_met && (met || found.part < other.part),
            });
            if better {
                best = Some((found, seconds));
            }
        }
        let fallback = Found { rule: self.rule(&COSTS[0]), part: 1.0, bodies: 0 };
        Ok(best.map_or(fallback, |(found, _)| found))
    }

    fn rule(&self, cost: &Cost) -> Rule {
        Rule {
            method: cost.method,
            coefficient: cost.coefficient,
            longest_angle: cost.longest_angle,
            attitude: self.accuracy.strictest(),
            precision: self.precision,
        }
    }

    /// The rule with the coefficient that the sample needs.
    fn calibrated(&self, start: Rule, reference: &BTreeMap<usize, BodyState>) -> Result<Found> {
        let mut rule = start;
        let mut found = Found { rule, part: f64::INFINITY, bodies: self.bodies.len() };
        for _ in 0..=CORRECTIONS {
            let part = self.part(&self.stepped(&rule)?, reference);
            if part < found.part {
                found = Found { rule, part, bodies: self.bodies.len() };
            } else if rule.precision.is_none() && part > 1.0 {
                // Finer steps did not help: rounding in f32 does not.
                rule = Rule { precision: Some(Precision::F64), ..start };
                continue;
            }
            if (0.1 * AIM..=ENOUGH).contains(&part) || (part < AIM && rule.takes_longest(self)) {
                break;
            }
            // A sample without any error would make the coefficient vanish.
            rule.coefficient *= (part / AIM).clamp(1e-4, 1e6);
        }
        Ok(found)
    }

    /// The states of the sample under a rule.
    fn stepped(&self, rule: &Rule) -> Result<BTreeMap<usize, BodyState>> {
        let span = self.scene.end();
        let mut groups: BTreeMap<(Option<i32>, bool), Vec<u32>> = BTreeMap::new();
        for (body, look) in &self.bodies {
            let step = rule.longest_step(look.rate, span);
            let level = (step < span).then(|| level_of(step));
            groups.entry((level, rule.is_wide(look.rate * span))).or_default().push(*body);
        }
        let mut states = BTreeMap::new();
        for ((level, wide), members) in groups {
            let treatment = Treatment::Stepped {
                method: rule.method,
                precision: if wide { Precision::F64 } else { Precision::F32 },
                longest_step: level.map_or(span, step_of),
            };
            let members = Members::Some(members);
            let mut go_on = |_| ControlFlow::Continue(());
            states.extend(states_at_end(self.scene, &self.times(), self.torques, &members, &treatment, &mut go_on)?);
        }
        Ok(states)
    }

    fn times(&self) -> Vec<f64> {
        if self.times.len() <= MOST_TIMES { self.times.to_vec() } else { vec![self.scene.end()] }
    }

    fn reference(&self) -> Result<BTreeMap<usize, BodyState>> {
        let rule = self.rule(&COSTS[0]);
        let attitude = (REFERENCE * rule.attitude).max(LEAST_REFERENCE);
        self.stepped(&Rule { attitude, precision: Some(Precision::F64), ..rule })
    }

    /// The error at the percentile asked for, as a part of the target; the greatest of those asked for.
    fn part(&self, states: &BTreeMap<usize, BodyState>, reference: &BTreeMap<usize, BodyState>) -> f64 {
        let mut errors = Errors::default();
        for (body, state) in states {
            if let Some(reference) = reference.get(body) {
                errors.push(state, reference);
            }
        }
        errors.part_of(self.accuracy)
    }

    /// Time that the sample's steps take, s.
    fn seconds(&self, rule: &Rule, cost: &Cost) -> f64 {
        let span = self.scene.end();
        let body = |look: &Look| {
            let wide = rule.is_wide(look.rate * span);
            let steps = (span / rule.longest_step(look.rate, span)).ceil();
            let precision = if wide { Precision::F64 } else { Precision::F32 };
            steps * cost.step_seconds(precision, self.torques.is_empty())
        };
        self.bodies.iter().map(|(_, look)| body(look)).sum()
    }
}

impl Rule {
    /// Whether every body of a pilot takes the longest step there is.
    fn takes_longest(&self, pilot: &Pilot<'_>) -> bool {
        let longer = Rule { coefficient: 1e-4 * self.coefficient, ..*self };
        let span = pilot.scene.end();
        pilot.bodies.iter().all(|(_, look)| longer.longest_step(look.rate, span) <= self.longest_step(look.rate, span))
    }

    /// Whether a body that turns by `angle` rad is stepped in `f64`.
    pub(super) fn is_wide(&self, angle: f64) -> bool {
        self.precision.unwrap_or_else(|| narrowest(self.attitude, angle)) == Precision::F64
    }
}
