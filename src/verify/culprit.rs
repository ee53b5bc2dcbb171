//! Which torque a difference comes from: the step is taken again under some of the torques only, on both sides and from the same
//! state. On a GPU these are the same shaders, put together with fewer torques.

use super::compare::Comparison;
use super::onset::{Onset, onset};
use super::stage::Found;
use crate::error::Result;

/// Where a difference comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Culprit {
    /// Nothing was tried: the difference is none of a step.
    NotSought,
    /// The sides part without any torque.
    Method,
    /// The sides part where a free body's step is projected, and agree in the same step without the projection.
    Projection,
    /// Each of these torques of the scene parts alone, and without torques the sides agree.
    Torques(Vec<usize>),
    /// No torque parts alone, but the sides agree if one of these is left out.
    OnlyTogetherWith(Vec<usize>),
    /// No torque parts alone, and none can be left out.
    Together,
}

/// A step, or an attempt at one, of one body, which both sides can take again from the same state.
pub(super) trait Retaken {
    /// How the sides differ after a part of the step, 1 for the whole of it, under these torques alone.
    fn compared(&self, acting: &[usize], part: f64) -> Result<Comparison>;

    /// The evaluation in which the sides part under these torques alone, of which shorter steps say so much, or why none is named.
    fn stage(&self, acting: &[usize], onset: Option<Onset>) -> Result<Found>;

    /// How often the step is halved at the least where its parts are compared.
    fn least_halvings(&self) -> u32 {
        0
    }
}

/// What a difference was traced to.
#[derive(Clone, Debug)]
pub(super) struct Traced {
    pub culprit: Culprit,
    /// `None` where the states agree under the culprit.
    pub onset: Option<Onset>,
    pub stage: Found,
}

/// Which of the torques makes the sides part in a step, and what in the step is at fault.
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

/// Which of the torques; `parts` says whether the sides part under some of them.
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
