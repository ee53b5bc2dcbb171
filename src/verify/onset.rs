//! Where in a step two sides begin to differ: the step is repeated from the same state in a half, a quarter and so on of its size,
//! and the power of the step with which the difference falls reveals what is at fault.
//!
//! Let h be the step. A fault in a slope y' that all stages share leaves a difference proportional to h. A fault that occurs only later in
//! the step (in the time of a later stage, or in the weights with which it is formed from those before it) leaves the slope at the start
//! unaffected: the difference is proportional to h² or to a higher power. A fault in how an increment is added to the state, or in what is
//! done to the state afterwards, does not fall with h. For an adaptive step the states may agree however short it is, while the decision,
//! or the next step, differs: then the error estimate or the controller is at fault.
//!
//! The powers do not reveal which of several later stages it is; the evaluations themselves do ([`super::Stage`]).

use super::compare::{Comparison, Field};
use crate::error::Result;

/// The part of a step that causes a difference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Onset {
    /// Not sought, or roundings hide the difference in shorter steps.
    NotFound,
    /// Not a slope: the difference in this field does not fall with the step.
    State(Field),
    /// The slope of this field at every stage, or the weights of the stages: the difference falls in proportion to the step.
    Slope(Field),
    /// The slope of this field later in the step, not at its start: the difference falls as this power of the step.
    Stage(Field, u32),
    /// For an adaptive step: its error estimate, or the controller's use of it, as the states agree.
    Controller,
}

/// The number of halvings of the step.
const HALVINGS: u32 = 8;
/// The least ratio of a difference to its bound that cannot be rounding.
const CLEAR: f64 = 8.0;
/// How far from a whole number a power may lie: roundings are up to an eighth of a difference, and the next power contributes too.
const WHOLE: f64 = 0.35;

impl Onset {
    /// The description in words; empty if it was not found.
    pub fn in_words(self) -> String {
        match self {
            Onset::NotFound => String::new(),
            Onset::State(field) => {
                format!("it does not fall with the step: no slope, but how the {} is carried over", field.name())
            }
            Onset::Slope(field) => {
                format!("it falls as the step: the slope of the {}, or the weights of the stages", field.name())
            }
            Onset::Stage(field, power) => format!(
                "it falls as the step to the power {power}: the slopes of the {} agree at the start of the step, and part later in it",
                field.name()
            ),
            Onset::Controller => {
                "the states of shorter steps agree: the error estimate, or what the controller makes of it".to_owned()
            }
        }
    }
}

/// Finds the onset from the difference of two sides after a step of a part of the size, which `compared` gives, starting with `first`
/// halvings; `None` if the states agree at any size.
pub(super) fn onset(first: u32, compared: &mut dyn FnMut(f64) -> Result<Comparison>) -> Result<Option<Onset>> {
    let fields = [Field::AngularMomentum, Field::Orientation];
    let mut differences = fields.map(|_| Vec::new());
    let (mut sizes, mut parts) = (0, false);
    for halving in first..=HALVINGS {
        let found = compared(0.5_f64.powi(halving as i32))?;
        let largest = fields.map(|field| found.largest.iter().find(|largest| largest.field == field));
        // If only one side accepts an attempt, nothing is known of the states.
        parts |= found.parting.as_ref().is_some_and(|parting| parting.field == Field::Decision);
        // An attempt that is rejected leaves them unchanged.
        if sizes == 0 && largest.iter().flatten().all(|largest| largest.difference == 0.0) {
            continue;
        }
        for (largest, differences) in largest.into_iter().zip(&mut differences) {
            let of_bound = largest.and_then(|largest| largest.of_bound).unwrap_or(0.0);
            parts |= of_bound > 1.0;
            // After the first difference that roundings hide, nothing can be concluded.
            if let (Some(largest), true) = (largest, of_bound > CLEAR && differences.len() == sizes) {
                differences.push(largest.difference);
            }
        }
        sizes += 1;
    }
    // From the shortest steps, in which the higher powers are the least. White noise goes with the root of the step: a power that is not
    // whole says nothing.
    let power = |differences: &[f64]| match differences {
        [.., longer, shorter] if longer.is_finite() => {
            let power = (longer / shorter).log2();
            ((power - power.round()).abs() < WHOLE).then_some(power.round().max(0.0) as u32)
        }
        _ => None,
    };
    let powers = fields.iter().zip(&differences).filter_map(|(&field, found)| Some((power(found)?, field)));
    // A fault in the slope of the angular momentum reaches the orientation with one more power of the step.
    Ok(match powers.min_by_key(|&(power, _)| power) {
        None if parts => Some(Onset::NotFound),
        None => None,
        Some((0, field)) => Some(Onset::State(field)),
        Some((1, field)) => Some(Onset::Slope(field)),
        Some((power, field)) => Some(Onset::Stage(field, power)),
    })
}
