//! The pilot: a few bodies of a class, integrated ahead, to find the step that meets an accuracy.
//!
//! For each candidate method a sample of the class's bodies is stepped on the CPU with the steps that the class would take, and
//! compared with a much finer reference. As the error goes as the step to the method's order, the measured error corrects
//! the coefficient of the method's [`Rule`]; once more stepped, it must then be within the target. The candidate that
//! needs the least time is taken; those that follow one that does are first tried within its time, and left if they miss.
//!
//! A few of the sample, among them the fastest, go first: from them come the reference's step, the order in which candidates
//! are tried and the coefficients that they start from, so that the whole sample is stepped a few times only.

use std::cmp::Ordering;

use super::choice::{Look, Rule, Scheme, narrowest};
use super::cost::{COSTS, Cost, Costs};
use super::reference::Reference;
use super::sampled::{Sampled, States};
use crate::batch::Precision;
use crate::error::Result;
use crate::force::Force;
use crate::record::Spread;
use crate::run::confidence::{least_sample, upper_rank};
use crate::run::shadow::{Standing, sample};
use crate::scene::{Accuracy, Scene, Target};
use crate::torque::Torque;

/// The most bodies of a class in its pilot, where the percentile asked for needs no more ([`least_sample`]).
const MOST_BODIES: usize = 1000;
/// The least, as far as there are so many: about what the 99th percentile needs.
const LEAST_BODIES: usize = 300;
/// At most every so many-th body, so that the pilot stays small beside the run.
const ONE_IN: usize = 32;
/// Bodies of the sample that go first, and places among the sample's rates at which they stand.
const SCOUTS: usize = 32;
const PLACES: usize = 4;

/// What part of the target the bound on the sample's error is brought to: as the steps' levels are apart, an error of order
/// 8 comes out between this and a quarter of it.
const AIM: f64 = 0.4;
/// What part of the target is good enough; the rest is the margin.
const ENOUGH: f64 = 0.8;
/// Below this part a longer step is tried, or a greater tolerance, which takes no level.
const TOO_GOOD: f64 = 0.05;
const TOO_GOOD_ADAPTIVE: f64 = 0.15;
/// How often a coefficient is corrected.
const CORRECTIONS: usize = 6;
/// The most by which a coefficient grows at once: where rounding is in the way, steps must not become countless before that
/// shows.
const MOST_CORRECTION: f64 = 1e4;
/// The least: a sample without any error must not make it vanish.
const LEAST_CORRECTION: f64 = 1e-4;
/// The angle, rad, over which methods are compared where no bodies are looked at.
const NOMINAL_ANGLE: f64 = 10.0;
/// The angle, rad, over which the table's coefficients of adaptive steps were measured: of the fastest bodies there.
const TABULATED_ANGLE: f64 = 50.0;
/// A candidate that is this much dearer before its pilot is not tried.
const HOPELESS: f64 = 4.0;
/// Nor one that was this much dearer for a few of the bodies.
const DEARER: f64 = 1.5;
/// Where a class takes less than this on one core, s, trying others costs more than they could save.
const NEGLIGIBLE: f64 = 0.02;

/// What a pilot found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// How the class is stepped.
    pub rule: Rule,
    /// The sample's error as a part of the target, at the percentile asked for; the greatest, where there are several targets.
    pub part: f64,
    /// Of what that error is.
    pub worst: Target,
    /// The sample's attitude error, rad, at that percentile.
    pub attitude: f64,
    /// Bodies behind it.
    pub bodies: usize,
    /// Their steps, with those that were tried again, where they chose them.
    pub steps: Option<Spread>,
}

/// A class's bodies and what is asked of them.
pub(super) struct Pilot<'a> {
    pub scene: &'a Scene,
    pub accuracy: &'a Accuracy,
    pub costs: &'a Costs,
    pub times: &'a [f64],
    pub torques: &'a [Torque],
    pub precision: Option<Precision>,
    /// Bodies of the class.
    pub all: usize,
    /// Whether a few of the sample go first. One body in a hundred that no step resolves misleads them.
    pub has_scouts: bool,
    /// The sample with the looks at them.
    pub bodies: Vec<(u32, Look)>,
}

/// Bodies in the pilot of a class.
pub(super) fn pilot_size(class: usize, accuracy: &Accuracy) -> usize {
    (class / ONE_IN).clamp(LEAST_BODIES, MOST_BODIES).max(least_sample(0.01 * accuracy.percentile)).min(class)
}

/// Bodies in the pilot of a class whose smaller pilot was lopsided.
pub(super) fn larger_pilot_size(class: usize, accuracy: &Accuracy) -> usize {
    MOST_BODIES.max(least_sample(0.01 * accuracy.percentile)).min(class)
}

/// The bodies of a pilot among those of a class; the larger pilot has all of a smaller one's.
pub(super) fn pilot_sample(class: &[u32], count: usize, accuracy: &Accuracy, seed: u64) -> Vec<u32> {
    let largest = sample(class.len(), larger_pilot_size(class.len(), accuracy), seed);
    sample(largest.len(), count, seed).into_iter().map(|index| class[largest[index as usize] as usize]).collect()
}

/// A candidate that was tried.
#[derive(Clone, Copy)]
struct Tried {
    found: Found,
    /// The sample's own percentile, of which `found.part` is the bound.
    own: f64,
}

impl Tried {
    fn misses(&self) -> bool {
        self.found.part > 1.0
    }
}

/// What a pilot comes to.
pub(super) struct Flight {
    pub found: Found,
    /// Whether there is a larger sample that is worth its time: this sample's own percentile is within the target, and the error that
    /// bounds that of all so far beyond it that the larger one will bound it more closely; or some bodies cannot be followed at all.
    pub asks_for_more: bool,
    /// What is known ahead of the larger sample.
    known: Option<Known>,
}

/// What a smaller pilot of the same class has found.
struct Known {
    /// The rule of its reference, and where that has its bodies.
    reference: Rule,
    states: States,
    /// The rule that is expected to meet the target.
    start: Rule,
}

/// How far a bound may be above the sample's own percentile: a step that is chosen by it errs that much less than asked for.
const LOPSIDED: f64 = 30.0;

impl<'a> Pilot<'a> {
    /// The cheapest rule that meets the target in the sample; the most accurate where none does.
    pub fn fly(&self) -> Result<Flight> {
        if !self.has_scouts || self.bodies.len() <= 2 * SCOUTS {
            return self.fly_at_once();
        }
        let scouts = self.scouts();
        let reference = Reference::new(&scouts)?;
        if reference.lost(&scouts).is_some() {
            // They may be more than the percentile leaves out, or one in a hundred.
            return self.fly_at_once();
        }
        let mut found = scouts.tried(scouts.candidates(), &reference.states, false, None)?;
        // What the scouts favour first, so that what follows is dearer than what is known.
        found.sort_by(|a, b| self.order(a, b));
        let (missed, met): (Vec<_>, Vec<_>) = found.into_iter().partition(Tried::misses);
        let again = |tried: &[Tried], reference: &States, ahead: Option<(Rule, Sampled)>| {
            let candidate = |tried: &Tried| Some((tried.found.rule, self.costs.of(tried.found.rule.scheme)?));
            self.tried(tried.iter().filter_map(candidate).collect(), reference, true, ahead)
        };
        let rule = reference.rule_for_others(&scouts)?;
        // Side by side, as either may be too little for all cores.
        let stepped = |tried: &Tried| -> Result<_> { Ok((tried.found.rule, self.stepped(&tried.found.rule)?)) };
        let favourite = || met.first().map(stepped).transpose();
        let (of_reference, ahead) = rayon::join(|| self.stepped(&rule), favourite);
        let (mut reference, mut reference_rule) = (of_reference?.states, Some(rule));
        let mut tried = again(&met, &reference, ahead?)?;
        let fails = |tried: &Tried| tried.misses() && !self.is_lopsided(tried);
        if tried.iter().all(fails) {
            // Others may do for as many bodies as the percentile counts, or the scouts' reference was not fine enough for all.
            let of_all = Reference::new(self)?;
            if let Some(found) = of_all.lost(self) {
                return Ok(self.lost(found));
            }
            (reference, reference_rule) = (of_all.states, None);
            let known = [met, missed].concat();
            tried.extend(again(&known, &reference, None)?);
            if tried.iter().all(fails) {
                let kind = |rule: &Rule| (rule.scheme, rule.precision);
                let is_new =
                    |(rule, _): &(Rule, &Cost)| !known.iter().any(|tried| kind(&tried.found.rule) == kind(rule));
                let others = self.candidates().into_iter().filter(is_new).collect();
                tried.extend(self.tried(others, &reference, false, None)?);
            }
        }
        Ok(self.flight(&tried, reference, reference_rule))
    }

    /// The same, of the whole sample from the start.
    fn fly_at_once(&self) -> Result<Flight> {
        let reference = Reference::new(self)?;
        if let Some(found) = reference.lost(self) {
            return Ok(self.lost(found));
        }
        let tried = self.tried(self.candidates(), &reference.states, false, None)?;
        Ok(self.flight(&tried, reference.states, None))
    }

    /// Where no reference follows as many bodies as the percentile counts; of a larger sample fewer may be lost.
    fn lost(&self, found: Found) -> Flight {
        Flight { found, asks_for_more: self.bodies.len() < larger_pilot_size(self.all, self.accuracy), known: None }
    }

    /// What the candidates that were tried come to.
    fn flight(&self, tried: &[Tried], states: States, reference: Option<Rule>) -> Flight {
        let Some(best) = tried.iter().copied().min_by(|a, b| self.order(a, b)) else {
            return Flight { found: self.tabulated(), asks_for_more: false, known: None };
        };
        let found = best.found;
        if self.is_lopsided(&best) {
            // Twice as fine as the sample's own percentile asks for.
            let coefficient = found.rule.coefficient * (2.0 * best.own / AIM).clamp(LEAST_CORRECTION, 1.0);
            let start = Rule { coefficient, ..found.rule };
            let known = reference.map(|reference| Known { reference, states, start });
            return Flight { found, asks_for_more: true, known };
        }
        // What was not chosen may have failed for a body or two.
        let asks_for_more = tried.iter().any(|tried| tried.misses() && self.is_lopsided(tried));
        Flight { found, asks_for_more, known: None }
    }

    /// Whether a larger sample would bound the errors of what was tried much more closely, and it may do.
    fn is_lopsided(&self, tried: &Tried) -> bool {
        let grows = self.bodies.len() < larger_pilot_size(self.all, self.accuracy);
        grows && tried.own <= 1.0 && tried.found.part > LOPSIDED * tried.own
    }

    /// As [`Pilot::fly`], after a smaller pilot of the class.
    pub fn fly_after(&self, smaller: Flight) -> Result<Found> {
        if let Some(Known { reference, mut states, start }) = smaller.known
            && let Some(cost) = self.costs.of(start.scheme)
        {
            let is_new = |(body, _): &&(u32, Look)| !states.contains_key(&(*body as usize));
            let others = Self { bodies: self.bodies.iter().filter(is_new).copied().collect(), ..*self };
            states.extend(others.stepped(&reference)?.states);
            let tried = self.calibrated(start, cost, f64::INFINITY, &states, false, None)?;
            if !tried.misses() {
                return Ok(tried.found);
            }
        }
        Ok(self.fly()?.found)
    }

    /// What candidates come to; those that are dearer than one that meets the target are left out, as far as that is known
    /// ahead: from the shipped table, or, where they were `tried_before`, from fewer bodies of the same class. `ahead` is
    /// the sample as it was stepped already, with its rule; it is used where that rule comes first.
    fn tried(
        &self,
        candidates: Vec<(Rule, &'a Cost)>,
        reference: &States,
        tried_before: bool,
        mut ahead: Option<(Rule, Sampled)>,
    ) -> Result<Vec<Tried>> {
        let mut tried = Vec::new();
        let mut cheapest = f64::INFINITY;
        let class = self.all as f64 / self.bodies.len() as f64;
        for (start, cost) in candidates {
            if class * cheapest < NEGLIGIBLE {
                break;
            }
            // With the coefficient of the kinder problem: the other's would rule out what its own pilot might favour.
            let kinder = cost.free.coefficient.min(cost.driven.coefficient).min(start.coefficient);
            let (coefficient, margin) = if tried_before { (start.coefficient, DEARER) } else { (kinder, HOPELESS) };
            if self.seconds(&Rule { coefficient, ..start }, cost, None) > margin * cheapest {
                continue;
            }
            let rule = self.within(start, cost, cheapest);
            let candidate = self.calibrated(rule, cost, cheapest, reference, tried_before, ahead.take())?;
            let Found { rule, steps, .. } = candidate.found;
            let before = cheapest;
            if !candidate.misses() {
                cheapest = cheapest.min(self.seconds(&rule, cost, steps));
            }
            tried.push(candidate);
            // The larger sample is for this one.
            if tried_before && self.is_lopsided(&candidate) && (candidate.misses() || cheapest < before) {
                break;
            }
        }
        Ok(tried)
    }

    /// A rule with steps so long that they take no more than `limit` seconds: if that misses the target, the candidate is dearer.
    fn within(&self, start: Rule, cost: &Cost, limit: f64) -> Rule {
        let mut rule = start;
        while self.seconds(&rule, cost, None) > limit && !rule.takes_longest(self) {
            rule.coefficient /= rule.level();
        }
        rule
    }

    /// What meets the target before what does not; of the former the cheaper, of the latter the more accurate.
    fn order(&self, a: &Tried, b: &Tried) -> Ordering {
        let seconds = |Tried { found, .. }: &Tried| {
            self.costs.of(found.rule.scheme).map_or(f64::INFINITY, |cost| self.seconds(&found.rule, cost, found.steps))
        };
        let same = || {
            if a.misses() { a.found.part.total_cmp(&b.found.part) } else { seconds(a).total_cmp(&seconds(b)) }
        };
        a.misses().cmp(&b.misses()).then_with(same)
    }

    /// The pilot with a few of its bodies: some neighbours by rate, which take steps of one or two levels and so fill lanes, at
    /// each of a few places from the fastest that the percentile counts down.
    fn scouts(&self) -> Self {
        let mut sorted = self.bodies.clone();
        sorted.sort_by(|a, b| b.1.rate.total_cmp(&a.1.rate).then(a.0.cmp(&b.0)));
        // Of a low percentile the slowest few count all the same.
        let counted = upper_rank(sorted.len(), 0.01 * self.accuracy.percentile).max(SCOUTS / PLACES);
        let left_out = sorted.len() - counted;
        let neighbours = |place: usize| {
            let first = left_out + place * (counted - SCOUTS / PLACES) / (PLACES - 1);
            sorted[first..first + SCOUTS / PLACES].iter().copied()
        };
        let bodies = (0..PLACES).flat_map(neighbours).collect();
        Self { bodies, ..*self }
    }

    /// The rule of equal steps that the shipped table takes for the cheapest. It depends on the target and the torques alone, not on
    /// the bodies; a tolerance of adaptive steps would depend on how far these turn.
    pub fn tabulated(&self) -> Found {
        let seconds = |(rule, cost): &(Rule, &Cost)| {
            let precision = rule.precision.unwrap_or_else(|| narrowest(rule.attitude, NOMINAL_ANGLE));
            cost.step_seconds(precision, self.torques.is_empty()) / rule.longest_step(1.0, NOMINAL_ANGLE)
        };
        let equal = self.candidates().into_iter().filter(|(rule, _)| rule.scheme != Scheme::Adaptive);
        let cheapest = equal.min_by(|a, b| seconds(a).total_cmp(&seconds(b)));
        let fallback = || self.rule(&COSTS[1], self.precision);
        let rule = cheapest.map_or_else(fallback, |(rule, _)| rule);
        Found { rule, part: 1.0, worst: Target::Attitude, attitude: rule.attitude, bodies: 0, steps: None }
    }

    /// Every method that can follow the torques, in `f32` where its floor allows and in `f64`.
    fn candidates(&self) -> Vec<(Rule, &'a Cost)> {
        let mut candidates = Vec::new();
        for cost in self.costs.rows().iter().filter(|cost| self.allows(cost.scheme)) {
            let rule = self.rule(cost, self.precision);
            candidates.push((rule, cost));
            let span = self.scene.end();
            let narrow = |(_, look): &(u32, Look)| !rule.is_wide(look.rate * span);
            if self.precision.is_none() && self.bodies.iter().any(narrow) {
                candidates.push((self.rule(cost, Some(Precision::F64)), cost));
            }
        }
        candidates
    }

    /// Whether steps of this kind follow what acts on the bodies.
    pub fn allows(&self, scheme: Scheme) -> bool {
        match scheme {
            Scheme::Equal(method) => !method.properties().rigid_only || self.torques.iter().all(Torque::leaves_rigid),
            Scheme::Adaptive => {
                let draws = self.torques.iter().any(Torque::is_random);
                let thrust = self.scene.forces().iter().any(Force::needs_attitude);
                self.scene.may_skip() && !draws && !thrust
            }
        }
    }

    /// The rule that the table gives, before bodies are tried. Errors of adaptive steps add up with the angle that bodies turn by.
    pub fn rule(&self, cost: &Cost, precision: Option<Precision>) -> Rule {
        let fastest = self.bodies.iter().map(|(_, look)| look.rate).fold(0.0, f64::max);
        let longer = match cost.scheme {
            Scheme::Equal(_) => 1.0,
            Scheme::Adaptive => (fastest * self.scene.end() / TABULATED_ANGLE).max(1.0),
        };
        Rule {
            scheme: cost.scheme,
            coefficient: longer * cost.coefficient(self.torques.is_empty()),
            longest_angle: cost.longest_angle,
            attitude: self.accuracy.strictest(),
            precision,
        }
    }

    /// The rule with the coefficient that the sample needs, as far as its steps take no longer than `limit` seconds, the least that
    /// is known to do. Where a larger sample would say more it is left at that if it `may_leave`. `ahead` is as in
    /// [`Pilot::tried`].
    fn calibrated(
        &self,
        start: Rule,
        cost: &Cost,
        limit: f64,
        reference: &States,
        may_leave: bool,
        mut ahead: Option<(Rule, Sampled)>,
    ) -> Result<Tried> {
        let mut rule = start;
        let found = Found {
            rule,
            part: f64::INFINITY,
            worst: Target::Attitude,
            attitude: f64::INFINITY,
            bodies: self.bodies.len(),
            steps: None,
        };
        let mut best = Tried { found, own: f64::INFINITY };
        let (mut last, mut correction) = (f64::INFINITY, 1.0);
        for _ in 0..=CORRECTIONS {
            if self.seconds(&rule, cost, None) > limit {
                break;
            }
            let sampled = match ahead.take() {
                Some((stepped, sampled)) if stepped == rule => sampled,
                _ => self.stepped(&rule)?,
            };
            let mut errors = self.errors(&sampled.states, reference);
            let Standing { part, worst, attitude } = errors.standing(self.accuracy, self.all);
            let found = Found { rule, part, worst, attitude, bodies: self.bodies.len(), steps: sampled.steps };
            let tried = Tried { found, own: errors.standing(self.accuracy, self.bodies.len()).part };
            // Of two that are good enough the one with longer steps, else the more accurate.
            let improves = match (part <= ENOUGH, best.found.part <= ENOUGH) {
                (true, true) => rule.coefficient < best.found.rule.coefficient,
                _ => part < best.found.part,
            };
            let before = std::mem::replace(&mut last, part);
            // What asks for more bodies is not given up for what misses.
            if improves || (best.misses() && self.is_lopsided(&tried)) {
                best = tried;
            }
            if may_leave && self.is_lopsided(&tried) {
                break;
            }
            let too_good = if rule.scheme == Scheme::Adaptive { TOO_GOOD_ADAPTIVE } else { TOO_GOOD };
            if (too_good..=ENOUGH).contains(&part) || (part <= ENOUGH && rule.takes_longest(self)) {
                break;
            }
            // Finer steps that do not help meet rounding, or a motion that no step resolves. As steps go by levels, an error
            // may fall by that much less than it should.
            let stalls = part > before * (rule.level() / correction).max(0.5);
            if part > 1.0 && before > 1.0 && before.is_finite() && stalls {
                break;
            }
            correction = (part / AIM).clamp(LEAST_CORRECTION, MOST_CORRECTION);
            let tried = rule;
            rule.coefficient *= correction;
            if tried.steps_like(&rule, self) {
                break;
            }
        }
        Ok(best)
    }
}
