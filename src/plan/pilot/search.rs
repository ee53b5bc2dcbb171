//! The search for the cheapest rule that meets the target.
//!
//! Candidates are calibrated in the order of the times that the table predicts for them. As long as none meets the target, one that turns out
//! to need many times what is expected of the next one waits. Once one has met the target, later candidates are first tried in steps that take
//! no more time, and dropped if they miss; a pass over the sample is taken only if it may save the run more time than it takes, or if the
//! candidate's own steps were better than needed. What a method in equal steps needs corrects what is expected of the others.

use super::probe::MOST_DIFFICULTY;
use super::{Found, Pilot, Tried};
use crate::error::Result;
use crate::plan::choice::{Rule, Scheme};
use crate::plan::cost::Cost;
use crate::plan::errors::ErrorRatio;
use crate::plan::reference::Reference;
use crate::scene::Target;

/// The reference and the candidates together may take this many times what the reference alone may: otherwise, if none meets the target,
/// they would be refined without end.
pub(super) const MOST_OF_CANDIDATES: f64 = 5.0;
/// The same for passes that only look for longer steps.
const MOST_OF_TUNING: f64 = 1.0;
/// If a class takes less than this on one core, s, trying other candidates costs more than it could save.
const NEGLIGIBLE: f64 = 0.02;
/// The factor by which the time predicted for a candidate may be too long, before its first pass.
const OVERESTIMATED: f64 = 1.5;
/// As long as nothing meets the target, a candidate that needs this many times what the next one is expected to need waits: predicted times
/// are off by less.
const PATIENCE: f64 = 3.0;
/// Steps that may pass the decisions of formulas are taken only if they are cheaper by this factor than others that meet the target: what they
/// make of the bodies that the sample does not have is less certain.
const LEAPS: f64 = 2.0;

/// The part of the target to which the bound on the sample's error is brought: as levels of steps are discrete, an error of order
/// 8 comes out between this and a quarter of it.
const AIM: f64 = 0.4;
/// The part of the target that is good enough; the rest is the margin.
pub(super) const ENOUGH: f64 = 0.8;
/// Below this part a longer step is tried, or a greater tolerance, which is not restricted to levels.
const TOO_GOOD: f64 = 0.05;
const TOO_GOOD_ADAPTIVE: f64 = 0.15;
/// How often a coefficient is corrected.
const CORRECTIONS: usize = 6;
/// The greatest factor by which a coefficient grows at once: if rounding is the obstacle, steps must not become countless before that
/// shows.
const MOST_CORRECTION: f64 = 1e4;
/// The greatest factor for a candidate that is in `f32` where that is precise enough.
const MOST_NARROW_CORRECTION: f64 = 100.0;
/// The least factor: a sample without any error must not make the coefficient vanish.
const LEAST_CORRECTION: f64 = 1e-4;

/// A candidate, and what its passes over the sample have shown.
struct Calibration<'a> {
    cost: &'a Cost,
    /// The rule of the next pass, and the sample's part of the run's time that it is expected to take, s.
    rule: Rule,
    seconds: f64,
    /// How many times as long as the table says its steps take.
    slowness: f64,
    /// The coefficient that was expected, and by which factor a first pass that was just taken has shown it to be greater.
    expected: f64,
    harder: Option<f64>,
    /// The best of what was tried, and the least error of the sample itself; `None` before the first pass.
    best: Option<Tried>,
    /// The last pass's error as a part of the target, and the correction that followed.
    last: f64,
    correction: f64,
    passes: usize,
}

impl<'a> Calibration<'a> {
    fn new((rule, cost, expected, seconds): (Rule, &'a Cost, f64, f64)) -> Self {
        let (slowness, last, correction) = (1.0, f64::INFINITY, 1.0);
        Self { cost, rule, seconds, slowness, expected, harder: None, best: None, last, correction, passes: 0 }
    }

    /// The best rule so far if it is good enough.
    fn enough(&self) -> Option<&Found> {
        self.best.as_ref().map(|tried| &tried.found).filter(|found| found.part <= ENOUGH)
    }

    /// Steps the sample by the rule, and corrects the rule's coefficient; whether another pass may find a better one.
    fn pass(&mut self, pilot: &Pilot<'_>, reference: &mut Reference) -> Result<bool> {
        let (rule, cost) = (self.rule, self.cost);
        let expected = pilot.seconds(&rule, cost, None);
        reference.spent += expected;
        // The reference is always in `f64`.
        let is_known =
            |coarse: &Rule| *coarse == Rule { precision: coarse.precision, ..rule } && !pilot.has_narrow(&rule);
        let sampled = match reference.coarse.take_if(|(coarse, _)| is_known(coarse)) {
            Some((_, sampled)) => sampled,
            None => pilot.stepped(&rule)?,
        };
        self.passes += 1;
        let (ErrorRatio { part, worst, attitude }, shown) =
            pilot.error_ratio(pilot.errors(&sampled.states, &reference.states));
        // An error less than the reference's own says nothing.
        let (part, shown) = (part.max(reference.resolution()), shown.max(reference.resolution()));
        let attitude = attitude.max(reference.attitude());
        let (bodies, span) = (pilot.bodies.len(), pilot.span);
        let found = Found { rule, part, worst, attitude, bodies, span, steps: sampled.steps };
        match &mut self.best {
            Some(best) => {
                best.shown = best.shown.min(shown);
                // Of two that are good enough, prefer the one with longer steps; otherwise the more accurate.
                let improves = match (part <= ENOUGH, best.found.part <= ENOUGH) {
                    (true, true) => rule.coefficient < best.found.rule.coefficient,
                    _ => part < best.found.part,
                };
                if improves {
                    best.found = found;
                }
            }
            None => self.best = Some(Tried { found, shown }),
        }
        if self.passes == 1 {
            let needed = rule.coefficient * (part / AIM).clamp(LEAST_CORRECTION, MOST_DIFFICULTY);
            self.harder = Some(needed / self.expected);
        }
        let before = std::mem::replace(&mut self.last, part);
        let too_good = if rule.scheme.is_adaptive() { TOO_GOOD_ADAPTIVE } else { TOO_GOOD };
        if (too_good..=ENOUGH).contains(&part) || (part <= ENOUGH && rule.takes_longest(pilot)) {
            return Ok(false);
        }
        // If finer steps do not help, rounding is in the way, or no step resolves the motion. As steps come in levels, an error
        // may fall by that much less than it should.
        let stalls = part > before * (rule.level() / self.correction).max(0.5);
        if part > 1.0 && before > 1.0 && before.is_finite() && stalls {
            return Ok(false);
        }
        self.correction = (part / AIM).clamp(LEAST_CORRECTION, MOST_CORRECTION);
        // How hard the bodies are is known: what is left is rounding.
        if self.correction > MOST_NARROW_CORRECTION && pilot.has_narrow(&rule) {
            return Ok(false);
        }
        self.rule.coefficient *= self.correction;
        if rule.steps_like(&self.rule, pilot) || self.passes > CORRECTIONS {
            return Ok(false);
        }
        // Steps that took longer than the table says will do so again.
        self.slowness = pilot.seconds(&rule, cost, sampled.steps) / expected;
        self.seconds = self.slowness * pilot.seconds_in_run(&self.rule, cost, None);
        Ok(true)
    }
}

impl Pilot<'_> {
    /// The best of what the candidates give.
    pub(super) fn searched(&self) -> Result<Tried> {
        let mut reference = Reference::new(self)?;
        if let Some(tried) = reference.lost(self) {
            return Ok(tried);
        }
        let tried = self.tried(&mut reference)?;
        let best = tried.into_iter().min_by(|a, b| self.order(&a.found, &b.found));
        Ok(best.unwrap_or_else(|| Tried { found: self.tabulated(), shown: f64::INFINITY }))
    }

    /// The results of the candidates. Candidates that are expected to cost more than one that meets the target are left out.
    /// For the reference's own kind of steps, one pass is known already.
    fn tried(&self, reference: &mut Reference) -> Result<Vec<Tried>> {
        let mut waiting: Vec<_> = self.expected(reference).into_iter().map(Calibration::new).collect();
        let (mut tried, mut cheapest, mut narrow_misses) = (Vec::new(), f64::INFINITY, false);
        while !waiting.is_empty() && self.parts() * cheapest >= NEGLIGIBLE {
            // Steps that pass the decisions of formulas lose their order: others are measured by what series take. Candidates with equal
            // predicted times stay in the table's order.
            waiting.sort_by(|a, b| {
                let leaps = |candidate: &Calibration<'_>| self.may_leap(candidate.rule.scheme);
                leaps(a).cmp(&leaps(b)).then(a.seconds.total_cmp(&b.seconds))
            });
            let mut candidate = waiting.remove(0);
            let leaps = self.may_leap(candidate.rule.scheme);
            let limit = if leaps { cheapest / LEAPS } else { cheapest };
            // Where rounding in `f32` spoils one method, it spoils all.
            let is_spoilt = narrow_misses && candidate.rule.precision.is_none();
            let next = waiting.iter().find(|next| self.may_leap(next.rule.scheme) == leaps);
            let patience = next.map_or(f64::INFINITY, |next| PATIENCE * next.seconds);
            let waits = !is_spoilt && self.refine(&mut candidate, (limit, patience), reference)?;
            self.correct(&mut waiting, &mut candidate);
            if waits {
                waiting.push(candidate);
            } else {
                let is_measured = candidate.best.is_some();
                let result = candidate.best.unwrap_or_else(|| self.unmeasured(candidate.rule));
                let found = &result.found;
                narrow_misses |= is_measured && found.misses() && self.has_narrow(&found.rule);
                if !found.misses() {
                    cheapest = cheapest.min(self.seconds_in_run(&found.rule, candidate.cost, found.steps));
                }
                tried.push(result);
            }
        }
        Ok(tried)
    }

    /// The result of a candidate that no pass was taken with.
    fn unmeasured(&self, rule: Rule) -> Tried {
        let (part, worst, attitude) = (f64::INFINITY, Target::Attitude, f64::INFINITY);
        let (bodies, span) = (self.bodies.len(), self.span);
        let found = Found { rule, part, worst, attitude, bodies, span, steps: None };
        Tried { found, shown: f64::INFINITY }
    }

    /// Corrects what is expected of other methods in equal steps by what one has shown, where that is not rounding in `f32`.
    fn correct(&self, waiting: &mut [Calibration<'_>], shown: &mut Calibration<'_>) {
        let is_equal = |candidate: &Calibration<'_>| !candidate.rule.scheme.is_adaptive();
        let shows = is_equal(shown) && !self.has_narrow(&shown.rule);
        let Some(harder) = shown.harder.take().filter(|_| shows) else { return };
        for other in waiting.iter_mut().filter(|other| is_equal(other) && other.passes == 0) {
            let rule = Rule { coefficient: harder * other.expected, ..other.rule };
            other.seconds = self.seconds_in_run(&rule, other.cost, None);
        }
    }

    /// Refines a candidate until its coefficient is what the sample needs, in passes that may save time compared with a `limit` in seconds,
    /// the least time that is known to suffice. Returns whether it waits instead, because nothing is known to suffice and it needs more
    /// seconds than it is given.
    fn refine(
        &self,
        candidate: &mut Calibration<'_>,
        (limit, patience): (f64, f64),
        reference: &mut Reference,
    ) -> Result<bool> {
        if candidate.passes == 0 && candidate.rule.scheme != Scheme::TAYLOR {
            candidate.rule = self.within(candidate.rule, candidate.cost, limit);
        }
        loop {
            let own = candidate.enough().map(|found| self.seconds_in_run(&found.rule, candidate.cost, found.steps));
            let least = own.map_or(limit, |own| own.min(limit));
            let spent = reference.spent + self.seconds(&candidate.rule, candidate.cost, None);
            let most = if own.is_some() { MOST_OF_TUNING } else { MOST_OF_CANDIDATES };
            let is_spent = spent > most * self.most_seconds();
            let (expected, next) = match candidate.passes {
                0 => (candidate.seconds / OVERESTIMATED, self.seconds_in_run(&candidate.rule, candidate.cost, None)),
                _ => (candidate.seconds, candidate.seconds),
            };
            // Where steps were too good, longer ones cost less.
            let pays = own.is_some() || self.pays(candidate, expected, least);
            if is_spent || next > limit || !pays {
                return Ok(false);
            }
            if candidate.passes > 0 && least.is_infinite() && candidate.seconds > patience {
                return Ok(true);
            }
            if !candidate.pass(self, reference)? {
                return Ok(false);
            }
        }
    }

    /// Whether a candidate's next pass may save more than it takes, if the run takes `expected` seconds by it and `least` by what is known to
    /// suffice.
    fn pays(&self, candidate: &Calibration<'_>, expected: f64, least: f64) -> bool {
        let pass = candidate.slowness * self.seconds_of_pass(&candidate.rule);
        least.is_infinite() || self.parts() * (least - expected) > pass
    }

    /// How many times the sample's part of the run's time makes the class's.
    fn parts(&self) -> f64 {
        self.all as f64 / self.bodies.len() as f64 * (self.scene.end() / self.span)
    }
}
