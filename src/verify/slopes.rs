//! Finds the slope of a step in which two sides part, for an engine that shows none of its evaluations, such as CPU lanes.
//!
//! At each state and time at which the twin evaluates a slope, both sides take steps of a half, a quarter and so on of the size. If their
//! difference falls in proportion to the step ([`super::onset`]), the slope with which these steps start is at fault; if it falls faster,
//! that slope agrees. The first of the twin's evaluations whose slope does not agree is named. It is tested as the first slope of a step:
//! if a kernel has a fault only in the slopes of its later stages, all are found to agree, and their weights, times and states are what
//! remains.

use super::compare::Field;
use super::onset::Onset;
use super::stage::{Found, NoStage, Shown, Stage, Term, compared_of};
use crate::bodies::Status;
use crate::bodies::columns::StateWords;
use crate::engine::batch::AnyBatch;
use crate::engine::tap::Evaluations;
use crate::error::Result;
use crate::kernel::method::Method;
use crate::kernel::method::taylor::order_of;

/// A state at which the twin evaluates a slope, and the time since the start of the step, s.
type Evaluated = (StateWords, f64);

/// The states of a single body at which a slope is evaluated. Methods that use the torque alone compute the angular velocity themselves;
/// the angular momentum follows from it.
fn states(evaluations: &Evaluations, twin: &AnyBatch) -> Vec<Evaluated> {
    let of = |(index, torque): (usize, &crate::engine::tap::TorqueCall)| {
        let momentum = match evaluations.motions.get(index) {
            Some(motion) => motion.angular_momentum,
            None => std::array::from_fn(|axis| {
                let inverse = twin.parameter(axis, 0);
                if inverse == 0.0 { 0.0 } else { torque.angular_velocity[axis] / inverse }
            }),
        };
        let ([x, y, z, w], [a, b, c]) = (torque.orientation, momentum);
        let value = vec![[x, y, z, w, a, b, c]];
        let words = StateWords { value, residue: Vec::new(), status: vec![Status::Valid] };
        (words, torque.elapsed)
    };
    evaluations.torques.iter().enumerate().map(of).collect()
}

/// The term of a slope that differs in a field, under torques that are at fault or without torques.
fn term(field: Field, under_torques: bool) -> Term {
    match field {
        Field::Orientation => Term::OrientationRate,
        _ if under_torques => Term::Torque,
        _ => Term::GyroscopicTerm,
    }
}

/// What two sides repeat: a step of a method under some torques.
pub(super) struct SlopesOf<'a> {
    pub method: Method,
    /// Whether torques act that are at fault.
    pub under_torques: bool,
    /// The finding from shorter steps from the start of the whole.
    pub onset: Option<Onset>,
    /// The twin's evaluations of the whole step.
    pub evaluations: &'a Evaluations,
    /// The single body, as the twin takes it.
    pub twin: &'a AnyBatch,
}

impl SlopesOf<'_> {
    /// The first slope that differs; `onset_from` gives the finding from shorter steps from a state and a time.
    pub fn first(&self, onset_from: &mut dyn FnMut(&StateWords, f64) -> Result<Option<Onset>>) -> Result<Found> {
        let Self { method, under_torques, onset, evaluations, twin } = *self;
        match onset {
            None => return Ok(Err(NoStage::StatesAgree)),
            Some(Onset::State(_)) => return Ok(Err(NoStage::NoSlope)),
            _ => {}
        }
        let of = compared_of(method, evaluations.torques.len());
        let is_stage = !evaluations.motions.is_empty();
        // A free flow does not consist of evaluations of the torque.
        if of == 0 || !(is_stage || under_torques) {
            return Ok(Err(NoStage::NoEvaluations));
        }
        let stage = |number, term| Ok(Ok(Stage { number, of, is_stage, term, shown: Shown::ShortSteps }));
        for (index, (state, elapsed)) in states(evaluations, twin).iter().take(of).enumerate() {
            match onset_from(state, *elapsed)? {
                Some(Onset::Slope(field)) => return stage(index + 1, term(field, under_torques)),
                Some(Onset::NotFound) => return Ok(Err(NoStage::Hidden)),
                _ => {}
            }
        }
        match onset {
            Some(Onset::Stage(..)) => stage(of, Term::Weights),
            _ => Ok(Err(NoStage::Hidden)),
        }
    }
}

/// The first coefficient of a series that differs, from the finding of shorter steps.
pub(super) fn first_coefficient(onset: Option<Onset>, tolerance: f64, under_torques: bool) -> Found {
    let of = order_of(tolerance);
    let (number, field) = match onset {
        None | Some(Onset::Controller) => return Err(NoStage::StatesAgree),
        Some(Onset::State(_)) => return Err(NoStage::NoSlope),
        Some(Onset::NotFound) => return Err(NoStage::Hidden),
        Some(Onset::Slope(field)) => (1, field),
        Some(Onset::Stage(field, power)) => (power as usize, field),
    };
    Ok(Stage { number, of, is_stage: false, term: term(field, under_torques), shown: Shown::Series })
}
