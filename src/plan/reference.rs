//! What a pilot compares with: the same bodies by `rk8` in `f64`, refined until it no longer changes; in adaptive steps where
//! the bodies may take them and their tolerances have room for it.

use super::choice::{Rule, Scheme};
use super::cost::COSTS;
use super::pilot::{Found, Pilot};
use super::sampled::States;
use crate::batch::Precision;
use crate::error::Result;
use crate::method::Method;
use crate::method::rk8_adaptive::least_tolerance;
use crate::run::shadow::Standing;

/// What the reference may change when its steps are halved, as a part of the target. Its own error is then less by the
/// 2⁸ of its order, or it is that of rounding, against which no candidate can be measured.
const SETTLED: f64 = 0.02;
/// The error that the first reference aims at, as a part of the target.
const AIM: f64 = 1e-2;
/// The least that it aims at, rad: rounding in `f64`.
const LEAST: f64 = 1e-15;
/// How often its steps are halved.
const HALVINGS: usize = 6;

/// A tolerance that is greater by this factor is the least one again when its steps are halved.
const COARSER: f64 = 128.0;
/// What the error of a reference may be, as a part of [`SETTLED`], where its step is chosen by what few bodies showed: the
/// others' may then be ten times theirs.
const MARGIN: f64 = 0.1;
/// An attitude error, rad, from which on it no longer grows in proportion to what causes it.
pub(super) const SATURATED: f64 = 0.1;
/// The most by which a coefficient shrinks at once.
const LEAST_CORRECTION: f64 = 1e-8;

/// The motion of a pilot's bodies as well as it is needed.
pub(super) struct Reference {
    /// The states at the end.
    pub states: States,
    /// The steps of half of which the states are, and what halving them changed.
    coarser: Rule,
    change: Standing,
}

impl Reference {
    /// Steps the pilot's bodies finer until that changes nothing.
    pub fn new(pilot: &Pilot<'_>) -> Result<Self> {
        if pilot.allows(Scheme::Adaptive) {
            let (found, is_limited) = Self::by(pilot, Scheme::Adaptive)?;
            // Adaptive steps may not follow what dies away; equal ones do.
            let follows = !is_limited && found.change.part <= 1.0;
            if follows || is_saturated(&found.change) {
                return Ok(found);
            }
        }
        Ok(Self::by(pilot, Scheme::Equal(Method::Rk8))?.0)
    }

    /// By steps of one kind, and whether there were no smaller tolerances before it had settled.
    fn by(pilot: &Pilot<'_>, scheme: Scheme) -> Result<(Self, bool)> {
        let cost = COSTS.iter().find(|cost| cost.scheme == scheme).unwrap_or(&COSTS[0]);
        let rule = pilot.rule(cost, Some(Precision::F64));
        let mut coarser = Rule { attitude: (AIM * rule.attitude).max(LEAST), ..rule };
        let least = least_tolerance(Precision::F64);
        if scheme == Scheme::Adaptive && coarser.tolerance(Precision::F64) == least {
            // There is none below that it could be compared with, but there are some above.
            coarser = Rule { coefficient: coarser.attitude / (COARSER * least), ..coarser };
        }
        let mut states = None;
        let mut last = Standing { part: f64::INFINITY, ..Standing::default() };
        for _ in 0..HALVINGS {
            let finer = halved(&coarser);
            let is_limited = finer.adapts_like(&coarser, Precision::F64);
            if is_limited {
                return Ok((Self { states: states.unwrap_or_default(), coarser, change: last }, is_limited));
            }
            let fine = || pilot.stepped(&finer);
            let (coarse, fine) = match states.take() {
                Some(states) => (states, fine()?.states),
                // Side by side, as few bodies are not enough for all cores.
                None => {
                    let (coarse, fine) = rayon::join(|| pilot.stepped(&coarser), fine);
                    (coarse?.states, fine?.states)
                }
            };
            let change = pilot.standing(&coarse, &fine);
            states = Some(fine);
            // What halving does not lessen is rounding, or so large that it cannot be more.
            let stays = change.part > 0.5 * last.part && !is_saturated(&change);
            let is_settled = change.part <= SETTLED || stays;
            last = change;
            if is_settled {
                break;
            }
            coarser = finer;
        }
        Ok((Self { states: states.unwrap_or_default(), coarser, change: last }, false))
    }

    /// What was found where the motion amplifies errors so much that no steps in `f64` follow it to what is asked for.
    pub fn lost(&self, pilot: &Pilot<'_>) -> Option<Found> {
        // The reference aims at less than is asked for.
        let rule = Rule { attitude: pilot.accuracy.strictest(), ..self.coarser };
        let Standing { part, worst, attitude } = self.change;
        let found = || Found { rule, part, worst, attitude, bodies: pilot.bodies.len(), steps: None };
        (part > 1.0).then(found)
    }

    /// Steps that are fine enough for a reference of bodies like the pilot's.
    pub fn rule_for_others(&self, pilot: &Pilot<'_>) -> Result<Rule> {
        if self.change.part > SETTLED {
            return Ok(halved(&self.coarser));
        }
        let needed = (self.change.part / (MARGIN * SETTLED)).clamp(LEAST_CORRECTION, 1.0);
        let longer = Rule { coefficient: needed * self.coarser.coefficient, ..self.coarser };
        // Far beyond the steps that were tried the error may not go as the order says.
        let holds = pilot.standing(&pilot.stepped(&longer)?.states, &self.states).part <= SETTLED;
        Ok(if holds { longer } else { self.coarser })
    }
}

/// Whether a change is by an angle that says nothing any more.
fn is_saturated(change: &Standing) -> bool {
    change.attitude >= SATURATED
}

/// A rule with steps half as long, or a tolerance that leads to such.
fn halved(rule: &Rule) -> Rule {
    let order = rule.scheme.method().order() as i32;
    Rule { coefficient: rule.coefficient * 2.0_f64.powi(order), longest_angle: 0.5 * rule.longest_angle, ..*rule }
}
