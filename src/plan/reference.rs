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

/// The states of the pilot's bodies at the end.
pub(super) fn states(pilot: &Pilot<'_>) -> Result<States> {
    let cost: &Cost = COSTS.iter().find(|cost| cost.method == Method::Rk8).unwrap_or(&COSTS[0]);
    let rule = pilot.rule(cost, Some(Precision::F64));
    let mut rule = Rule { attitude: (AIM * rule.attitude).max(LEAST), ..rule };
    let order = rule.method.order() as i32;
    let mut states = pilot.stepped(&rule)?;
    let mut last = f64::INFINITY;
    for _ in 0..HALVINGS {
        rule.coefficient *= 2.0_f64.powi(order);
        rule.longest_angle *= 0.5;
        let finer = pilot.stepped(&rule)?;
        let change = pilot.part(&states, &finer);
        states = finer;
        // What halving does not lessen is rounding.
        if change <= SETTLED || change > 0.5 * last {
            break;
        }
        last = change;
    }
    Ok(states)
}
