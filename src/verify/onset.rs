//! Where in a step sides part: it is taken again in a half, a quarter and so on of its size, from the same state, and the power of the step
//! with which the difference falls says how far behind the start it arises.
//!
//! Of a step of h, a fault in a slope y' that every stage shares leaves a difference in proportion to h. One that is in what a later stage
//! reads (another time, another weight of the stages before it) leaves the slope at the start as it is, and a difference in proportion to
//! h² or a higher power. What is in no slope but in how an increment is added to the state does not fall.

use super::compare::{Comparison, Field};
use crate::error::Result;

/// Where in a step a difference arises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Onset {
    /// Nothing was tried, or roundings hide the difference in shorter steps.
    NotFound,
    /// In no slope: it does not fall with the step.
    State(Field),
    /// In the slope of this field at every stage, or in the weights of the stages: it falls as the step.
    Slope(Field),
    /// In the slope of this field at a later stage: it falls as this power of the step.
    Stage(Field, u32),
}

/// How often the step is halved.
const HALVINGS: u32 = 8;
/// What a difference must be of its bound to be told from roundings.
const CLEAR: f64 = 8.0;

impl Onset {
    /// In words; empty where it was not found.
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
                "it falls as the step to the power {power}: the slope of the {}, right at the start, at a later stage",
                field.name()
            ),
        }
    }
}

/// Finds it; `compared` says how two sides differ after a step of a part of the size.
pub(super) fn onset(compared: &mut dyn FnMut(f64) -> Result<Comparison>) -> Result<Onset> {
    let fields = [Field::AngularMomentum, Field::Orientation];
    let mut differences = fields.map(|_| Vec::new());
    for halving in 0..=HALVINGS {
        let found = compared(0.5_f64.powi(halving as i32))?;
        for (field, differences) in fields.iter().zip(&mut differences) {
            let largest = found.largest.iter().find(|largest| largest.field == *field);
            let clear = largest.filter(|largest| largest.of_bound.is_some_and(|part| part > CLEAR));
            // Behind the first one that roundings hide nothing is told from them.
            if let (Some(largest), true) = (clear, differences.len() == halving as usize) {
                differences.push(largest.difference);
            }
        }
    }
    // Of the shortest steps, where higher powers have died away.
    let power = |differences: &[f64]| match differences {
        [.., longer, shorter] if longer.is_finite() => Some((longer / shorter).log2().round().max(0.0) as u32),
        _ => None,
    };
    let powers = fields.iter().zip(&differences).filter_map(|(&field, found)| Some((power(found)?, field)));
    // A slope of the angular momentum turns the orientation one power of the step later.
    Ok(match powers.min_by_key(|&(power, _)| power) {
        None => Onset::NotFound,
        Some((0, field)) => Onset::State(field),
        Some((1, field)) => Onset::Slope(field),
        Some((power, field)) => Onset::Stage(field, power),
    })
}
