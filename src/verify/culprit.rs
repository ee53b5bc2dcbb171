//! Which torque a difference comes from: the step is taken again under some of the torques only, on both sides and from the same
//! state. On a GPU these are the same shaders, put together with fewer torques.

use crate::error::Result;

/// Where a difference comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Culprit {
    /// Nothing was tried: the difference is none of a step.
    NotSought,
    /// The sides part without any torque.
    Method,
    /// Each of these torques of the scene parts alone, and without torques the sides agree.
    Torques(Vec<usize>),
    /// No torque parts alone, but the sides agree if one of these is left out.
    OnlyTogetherWith(Vec<usize>),
    /// No torque parts alone, and none can be left out.
    Together,
}

/// Finds it; `parts` says whether the sides part under some of the torques.
pub(super) fn culprit(torques: &[usize], parts: &mut dyn FnMut(&[usize]) -> Result<bool>) -> Result<Culprit> {
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
