//! Which methods bring the bodies to their output times, and how many bodies each.

use std::fmt;

use super::Plan;
use super::group::Treatment;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::plan::{ADAPTIVE, CLOSED_FORM};

/// Bodies that are brought to their output times by one method in one arithmetic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct Part {
    /// The integrator, `closed form` or `rotation`.
    pub method: &'static str,
    /// The arithmetic.
    pub precision: Precision,
    /// Number of bodies.
    pub bodies: usize,
}

impl fmt::Display for Part {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} in {}", self.method, self.precision)
    }
}

impl Plan<'_> {
    /// Methods and arithmetic with the number of their bodies, most bodies first.
    pub fn parts(&self) -> Vec<Part> {
        let mut parts: Vec<Part> = Vec::new();
        for group in self.groups() {
            let (method, precision) = name_of(&group.treatment);
            match parts.iter_mut().find(|part| (part.method, part.precision) == (method, precision)) {
                Some(part) => part.bodies += group.members.len(),
                None => parts.push(Part { method, precision, bodies: group.members.len() }),
            }
        }
        parts.retain(|part| part.bodies > 0);
        parts.sort_by_key(|part| std::cmp::Reverse(part.bodies));
        parts
    }
}

/// All parts in one line, with the numbers of bodies where there are several parts.
pub(crate) fn listed(parts: &[Part]) -> String {
    match parts {
        [] => "nothing to do".to_owned(),
        [part] => part.to_string(),
        parts => parts.iter().map(|part| format!("{} {part}", part.bodies)).collect::<Vec<_>>().join(", "),
    }
}

/// What a table calls a regular precession in the place of a method's name.
const ROTATION: &str = "rotation";

/// What a table calls a treatment.
pub(super) fn name_of(treatment: &Treatment) -> (&'static str, Precision) {
    match *treatment {
        Treatment::RegularPrecession => (ROTATION, Precision::F64),
        Treatment::ClosedForm { precision, .. } => (CLOSED_FORM, precision),
        Treatment::Stepped { method, precision, .. } => (method.name(), precision),
        Treatment::Adaptive { method: Method::Rk8, precision, .. } => (ADAPTIVE, precision),
        Treatment::Adaptive { method, precision, .. } => (method.name(), precision),
    }
}
