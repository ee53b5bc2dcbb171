//! What a pilot compares with: the same bodies by `rk8` in `f64`, refined until it no longer changes.

use super::choice::Rule;
use super::cost::{COSTS, Cost};
use super::pilot::{Pilot, States};
use crate::batch::Precision;
use crate::error::Result;
use crate::method::Method;

/// What the reference may change when its steps are halved, as a part of the target. Its own error is then less by the
/// 2⁸ of its order, or it is that of rounding, against which no candidate can be measured.
const SETTLED: f64 = 0.02;
/// The error that the first reference aims at, as a part of the target.
const AIM: f64 = 1e-2;
/// The least that it aims at, rad: rounding in `f64`.
const LEAST: f64 = 1e-15;
/// How often its steps are halved.
const HALVINGS: usize = 6;

/// What the error of a reference may be, as a part of [`SETTLED`], where its step is chosen by what few bodies showed: the
/// others' may then be ten times theirs.
const MARGIN: f64 = 0.1;
/// The most by which a coefficient shrinks at once.
const LEAST_CORRECTION: f64 = 1e-8;

/// The motion of a pilot's bodies as well as it is needed.
pub(super) struct Reference {
    /// The states at the end.
    pub states: States,
    /// The steps of half of which the states are, and what halving them changed.
    coarser: Rule,
    change: f64,
}

impl Reference {
    /// Steps the pilot's bodies finer until that changes nothing.
    pub fn new(pilot: &Pilot<'_>) -> Result<Self> {
        let cost: &Cost = COSTS.iter().find(|cost| cost.method == Method::Rk8).unwrap_or(&COSTS[0]);
        let rule = pilot.rule(cost, Some(Precision::F64));
        let mut coarser = Rule { attitude: (AIM * rule.attitude).max(LEAST), ..rule };
        let mut states = pilot.stepped(&coarser)?;
        let mut last = f64::INFINITY;
        for _ in 0..HALVINGS {
            let finer = halved(&coarser);
            let coarse = std::mem::replace(&mut states, pilot.stepped(&finer)?);
            let change = pilot.part(&coarse, &states);
            // What halving does not lessen is rounding.
            if change <= SETTLED || change > 0.5 * last {
                return Ok(Self { states, coarser, change });
            }
            (coarser, last) = (finer, change);
        }
        Ok(Self { states, coarser, change: last })
    }

    /// Steps that are fine enough for a reference of bodies like the pilot's.
    pub fn rule_for_others(&self, pilot: &Pilot<'_>) -> Result<Rule> {
        if self.change > SETTLED {
            return Ok(halved(&self.coarser));
        }
        let needed = (self.change / (MARGIN * SETTLED)).clamp(LEAST_CORRECTION, 1.0);
        let longer = Rule { coefficient: needed * self.coarser.coefficient, ..self.coarser };
        // Far beyond the steps that were tried the error may not go as the order says.
        let holds = pilot.part(&pilot.stepped(&longer)?, &self.states) <= SETTLED;
        Ok(if holds { longer } else { self.coarser })
    }
}

/// Half the steps of a rule.
fn halved(rule: &Rule) -> Rule {
    let order = rule.method.order() as i32;
    Rule { coefficient: rule.coefficient * 2.0_f64.powi(order), longest_angle: 0.5 * rule.longest_angle, ..*rule }
}
