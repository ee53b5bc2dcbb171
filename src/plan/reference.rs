//! A pilot's reference: the same bodies in `f64`, so fine that the error is far below the one asked for. It takes the cheaper of Taylor
//! series and adaptive `rk8`, where the bodies allow such steps and the tolerances have room; otherwise `rk8` in equal steps.

use super::choice::{Rule, Scheme};
use super::cost::Cost;
use super::pilot::{Found, Pilot, Tried};
use super::sampled::{Sampled, States};
use crate::bodies::Status;
use crate::error::Result;
use crate::kernel::method::Method;
use crate::kernel::method::rk8_adaptive::least_tolerance;
use crate::math::Precision;
use crate::plan::errors::ErrorRatio;
use crate::scene::Target;

/// The reference's own error may be this fraction of the target.
const SETTLED: f64 = 0.02;
/// The error that the next refinement aims at, as a fraction of the present one.
const FINER: f64 = 1e-3;
/// The tolerance of adaptive steps from which rounding may be as great as what they leave out.
const ROUNDS: f64 = 1e-9;
/// The tolerance below which the distance of two sequences of steps is taken for rounding unless a third one shows that it is not.
const NEAR_ROUNDING: f64 = 1e-13;
/// Into how many parts each refinement of equal steps cuts intervals beside breaks.
const PARTS: usize = 3;
/// The most refinements.
const REFINEMENTS: usize = 4;

/// The attitude error, rad, from which it no longer grows in proportion to its cause.
pub(super) const SATURATED: f64 = 0.1;

/// The motion of a pilot's bodies, as accurately as needed.
pub(super) struct Reference {
    /// The states at the end.
    pub states: States,
    /// The rule that the table gives for the target, and the bodies stepped by it.
    pub coarse: Option<(Rule, Sampled)>,
    /// The finest steps that were compared, how far their states are from those of the finest steps, and the error that remains.
    rule: Rule,
    change: ErrorRatio,
    left: f64,
    /// The error that remains in the sample alone, without a margin for what it does not show.
    left_shown: f64,
    /// Whether the tolerance reached its limit before the error was small.
    is_limited: bool,
    /// Whether no finer steps of this kind lessen the error.
    is_finest: bool,
    /// Whether that difference is an angle so great that it says nothing.
    is_saturated: bool,
    /// The predicted time, s, of all passes over the sample so far.
    pub spent: f64,
}

impl Reference {
    /// Steps the pilot's bodies ever finer until the remaining error is small: in the cheapest adaptive steps, then in others
    /// as long as that does not succeed.
    pub fn new(pilot: &Pilot<'_>) -> Result<Self> {
        let (equal, most) = (Scheme::Equal(Method::Rk8), pilot.most_seconds());
        let mut schemes = Self::adaptive_schemes(pilot);
        // Adaptive steps may fail to follow a decaying motion, or to pass a switch without steps below the least; equal ones do both.
        if schemes.is_empty() || pilot.allows(equal) {
            schemes.push(equal);
        }
        let mut best: Option<Self> = None;
        for scheme in schemes {
            let spent = best.as_ref().map_or(0.0, |best| best.spent);
            let cost = Cost::shipped(scheme);
            let finer = pilot.rule(cost, Some(Precision::F64)).finer();
            let is_spent = || spent + pilot.seconds(&finer, cost, None) > most;
            if let Some(best) = best.as_ref().filter(|_| scheme == equal)
                && (is_spent() || (pilot.has_more && best.is_lost() && best.left_shown <= 1.0))
            {
                break;
            }
            let found = Self::by(pilot, scheme, most)?;
            let is_enough = found.is_enough(pilot);
            let spent = spent + found.spent;
            let better = match best {
                Some(best) if best.is_better_than(&found) => best,
                _ => found,
            };
            best = Some(Self { spent, ..better });
            if is_enough {
                break;
            }
        }
        Ok(best.expect("there is a scheme, and the first is not left out"))
    }

    /// Whether it needs no other kind of steps: it errs little, or what it errs does not come from its steps, but from the motion or from rounding,
    /// of which series have least. Series may pass what a formula computes from the time.
    fn is_enough(&self, pilot: &Pilot<'_>) -> bool {
        let is_by_series = self.rule.scheme == Scheme::TAYLOR;
        let has_room = !self.is_limited || is_by_series;
        let is_of_attitude = self.change.worst == Target::Attitude;
        let is_rounding = is_by_series && is_of_attitude && self.is_finest;
        let is_inevitable = (self.is_saturated || is_rounding) && !pilot.reads_time();
        self.arrives() && has_room && (self.left <= 1.0 || is_inevitable)
    }

    /// The attitude error, rad, that remains.
    pub fn attitude(&self) -> f64 {
        let ErrorRatio { part, attitude, .. } = self.change;
        if part > 0.0 { self.left / part * attitude } else { 0.0 }
    }

    /// Whether the error that remains is greater than the target.
    fn is_lost(&self) -> bool {
        self.left > 1.0
    }

    /// The least part of the target that an error compared with these states stands for.
    pub fn resolution(&self) -> f64 {
        if self.left > SETTLED { self.left } else { 0.0 }
    }

    fn is_better_than(&self, other: &Self) -> bool {
        (self.arrives(), -self.left) > (other.arrives(), -other.left)
    }

    /// The adaptive schemes for which the tolerances have room, the one with the cheaper reference first. Where series have no room, `rk8`
    /// has less.
    fn adaptive_schemes(pilot: &Pilot<'_>) -> Vec<Scheme> {
        let seconds = |scheme: &Scheme| {
            let cost = Cost::shipped(*scheme);
            let rule = pilot.rule(cost, Some(Precision::F64));
            let has_room = *scheme == Scheme::TAYLOR || rule == rule.with_room();
            if has_room { pilot.seconds(&rule.finer(), cost, None) } else { f64::INFINITY }
        };
        let mut schemes = vec![Scheme::TAYLOR, Scheme::ADAPTIVE_RK8];
        schemes.retain(|scheme| pilot.can_follow(*scheme));
        let leaps = |scheme: &Scheme| pilot.may_leap(*scheme);
        schemes.sort_by(|a, b| leaps(a).cmp(&leaps(b)).then(seconds(a).total_cmp(&seconds(b))));
        if schemes.first() == Some(&Scheme::TAYLOR) && !pilot.reads_time() {
            schemes.truncate(1);
        }
        schemes
    }

    /// The reference by one kind of steps within a budget of seconds.
    fn by(pilot: &Pilot<'_>, scheme: Scheme, most: f64) -> Result<Self> {
        let cost = Cost::shipped(scheme);
        let mut rule = pilot.rule(cost, Some(Precision::F64)).with_room();
        let (mut fine, start) = (pilot.stepped(&rule)?, rule);
        let (mut coarse, mut last, mut spent) = (None, f64::INFINITY, pilot.seconds(&rule, cost, fine.steps));
        let mut parts = 1;
        loop {
            let finer = rule.finer();
            parts *= PARTS;
            let before = std::mem::replace(&mut fine, pilot.stepped_in_parts(&finer, parts)?);
            let mut errors = pilot.errors(&before.states, &fine.states);
            let is_saturated = errors.error_ratio(pilot.accuracy, pilot.all).attitude >= SATURATED;
            let (change, shown) = pilot.error_ratio(errors);
            // The factor by which the error falls from one to the next, as far as their tolerances have room.
            let ratio = match scheme {
                Scheme::Adaptive(_) => finer.tolerance(Precision::F64) / rule.tolerance(Precision::F64),
                Scheme::Equal(_) => FINER,
            };
            // An error that finer steps do not lessen is rounding, unless their tolerance leaves out most digits: steps that are cut, by
            // breaks or where a formula decides otherwise, err alike at all such tolerances.
            let is_fine = !scheme.is_adaptive() || finer.tolerance(Precision::F64) < ROUNDS;
            let is_rounding = change.part > 0.5 * last && !is_saturated && is_fine;
            let left = change.part * if is_rounding { 1.0 } else { ratio };
            spent += pilot.seconds(&finer, cost, fine.steps);
            coarse.get_or_insert(before);
            let floor = pilot.rounding(&finer) / pilot.accuracy.attitude.unwrap_or(f64::INFINITY);
            let (is_rounding, left) = (is_rounding || left < floor, left.max(floor));
            // The next refinement would take the same steps.
            let is_limited = finer.adapts_like(&finer.finer(), Precision::F64);
            let next = pilot.seconds(&finer.finer(), cost, None);
            let is_last = finer.coefficient >= limit(&start) || spent + next > most;
            if left <= SETTLED || is_rounding || is_limited || is_last {
                // Steps that changes of sampled torques cut are the same at any tolerance, and round alike.
                let is_same = || {
                    finer.tolerance(Precision::F64) < NEAR_ROUNDING
                        || pilot.changes() > 0.0 && pilot.is_cut_short(&finer)
                };
                let is_near = scheme.is_adaptive() && is_same();
                let (mut is_finest, mut left) = (is_limited || is_rounding, left);
                let mut left_shown = if change.part > 0.0 { left * (shown / change.part) } else { left };
                if is_near && !is_rounding && !is_saturated {
                    spent += pilot.seconds(&finer, cost, fine.steps);
                    let others = pilot.stepped_otherwise(&finer)?.states;
                    let (rounding, shown) = pilot.error_ratio(pilot.errors(&others, &fine.states));
                    is_finest |= rounding.part > left;
                    (left, left_shown) = (left.max(rounding.part), left_shown.max(shown));
                }
                // What such steps leave out differs too between two sequences of them: finer ones may be nearer to each other.
                if left <= 1.0 || is_rounding || is_limited || is_last {
                    let coarse = coarse.map(|sampled| (start, sampled));
                    let is_limited = is_limited && left > SETTLED;
                    return Ok(Self {
                        states: fine.states,
                        coarse,
                        rule,
                        change,
                        left,
                        left_shown,
                        is_limited,
                        is_finest,
                        is_saturated,
                        spent,
                    });
                }
            }
            (rule, last) = (finer, change.part);
        }
    }

    /// Whether all bodies reach the end, with no step below the least.
    fn arrives(&self) -> bool {
        self.states.values().all(|state| state.status == Status::Valid)
    }

    /// Whether its bodies chose their steps.
    pub fn is_adaptive(&self) -> bool {
        self.rule.scheme.is_adaptive()
    }

    /// Whether the remaining error is an angle so great that it says nothing.
    pub fn is_saturated(&self) -> bool {
        self.is_saturated
    }

    /// The result if the motion amplifies errors so much that no steps in `f64` meet the target.
    pub fn lost(&self, pilot: &Pilot<'_>) -> Option<Tried> {
        let ErrorRatio { part, worst, attitude } = self.change;
        // Of bodies that have parted, no part of the distance says what remains.
        let of_change = if self.is_saturated || part <= 0.0 { 1.0 } else { self.left / part };
        let attitude = of_change * attitude;
        let part = if self.arrives() { of_change * part } else { f64::INFINITY };
        let (bodies, span) = (pilot.bodies.len(), pilot.span);
        let found = || Found { rule: self.rule, part, worst, attitude, bodies, span, steps: None };
        let shown = if self.arrives() { self.left_shown } else { f64::INFINITY };
        self.is_lost().then(|| Tried { found: found(), shown })
    }
}

impl Rule {
    /// The rule, coarsened if necessary so that finer steps exist: a tolerance has a least value.
    pub(super) fn with_room(&self) -> Self {
        let greatest = self.attitude * FINER / least_tolerance(Precision::F64);
        match self.scheme {
            Scheme::Adaptive(_) => Self { coefficient: self.coefficient.min(greatest), ..*self },
            Scheme::Equal(_) => *self,
        }
    }

    /// The rule whose error is a thousandth of this one's.
    pub(super) fn finer(&self) -> Self {
        Self { coefficient: self.coefficient / FINER, longest_angle: 0.5 * self.longest_angle, ..*self }
    }
}

/// The coefficient beyond which steps are not refined.
fn limit(start: &Rule) -> f64 {
    start.coefficient * FINER.recip().powi(REFINEMENTS as i32) * 0.99
}
