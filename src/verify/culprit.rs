//! Finds the torque that causes a difference: the step is repeated under only some of the torques, on both sides and from the same
//! state. On a GPU these are the same shaders, assembled with fewer torques.

use super::compare::Comparison;
use super::onset::{Onset, onset};
use super::stage::Found;
use crate::error::Result;

/// The cause of a difference.
#[derive(Clone, Debug, PartialEq)]
pub enum Culprit {
    /// Not sought: the difference does not belong to a step.
    NotSought,
    /// The sides part without any torque.
    Method,
    /// The sides part if a free body's step is projected, and agree in the same step without the projection.
    Projection,
    /// The sides part under each of these torques of the scene alone, and agree without torques.
    Torques(Vec<usize>),
    /// No torque alone makes the sides part, but they agree if one of these is left out.
    OnlyTogetherWith(Vec<usize>),
    /// No torque alone makes the sides part, and none can be left out.
    Together,
}

/// A step, or an attempt at one, of one body, which both sides can repeat from the same state.
pub(super) trait Retaken {
    /// How the sides differ after a part of the step, 1 for the whole step, under only these torques.
    fn compared(&self, acting: &[usize], part: f64) -> Result<Comparison>;

    /// The evaluation in which the sides part under only these torques, or why none is named; `onset` is the finding from shorter steps.
    fn stage(&self, acting: &[usize], onset: Option<Onset>) -> Result<Found>;

    /// The least number of halvings of the step when its parts are compared.
    fn least_halvings(&self) -> u32 {
        0
    }
}

/// The cause of a difference.
#[derive(Clone, Debug)]
pub(super) struct Traced {
    pub culprit: Culprit,
    /// `None` if the states agree under the culprit.
    pub onset: Option<Onset>,
    pub stage: Found,
}

/// Finds which of the torques makes the sides part in a step, and what in the step is at fault.
pub(super) fn traced(torques: &[usize], step: &dyn Retaken) -> Result<Traced> {
    let culprit = culprit(torques, &mut |acting| Ok(step.compared(acting, 1.0)?.parting.is_some()))?;
    let acting = match &culprit {
        Culprit::NotSought | Culprit::Method | Culprit::Projection => &[],
        Culprit::Torques(torques) => torques.as_slice(),
        Culprit::OnlyTogetherWith(_) | Culprit::Together => torques,
    };
    let onset = onset(step.least_halvings(), &mut |part| step.compared(acting, part))?;
    Ok(Traced { onset, stage: step.stage(acting, onset)?, culprit })
}

/// Finds the torque; `parts` says whether the sides part under some of them.
fn culprit(torques: &[usize], parts: &mut dyn FnMut(&[usize]) -> Result<bool>) -> Result<Culprit> {
    if parts(&[])? {
        return Ok(Culprit::Method);
    }
    let mut alone = Vec::new();
    for &torque in torques {
        if parts(&[torque])? {
            alone.push(torque);
        }
    }
    if !alone.is_empty() {
        return Ok(Culprit::Torques(alone));
    }
    let mut needed = Vec::new();
    for &torque in torques {
        let others: Vec<usize> = torques.iter().copied().filter(|&other| other != torque).collect();
        if !parts(&others)? {
            needed.push(torque);
        }
    }
    Ok(if needed.is_empty() { Culprit::Together } else { Culprit::OnlyTogetherWith(needed) })
}
