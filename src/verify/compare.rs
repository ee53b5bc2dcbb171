//! Differences between two states of one body, and their record.

use super::culprit::{Culprit, Traced};
use super::onset::Onset;
use super::stage::{NoStage, Stage};
use crate::bodies::columns::{STATE_COMPONENTS, StateWords};
use crate::math::Precision;

/// What is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// The orientation, principal axes to world: the deviation of its quaternion perpendicular to itself.
    Orientation,
    /// The norm of its quaternion.
    Norm,
    /// The angular momentum in principal axes, in units of the body's own scale.
    AngularMomentum,
    /// The status of the body after the step ([`crate::bodies::Status`]), as a number.
    Status,
    /// For an adaptive step: whether it was accepted, 1 or 0.
    Decision,
    /// The adaptive step to be tried next, in units of the body's own scale.
    NextStep,
    /// What remains of the interval, in units of the body's own scale.
    Left,
    /// Steps in one call compared with steps one by one, to the bit: the first number of the state that differs.
    Cuts,
    /// The position of the centre of mass, m, world axes.
    Position,
    /// Its velocity, m/s, world axes.
    Velocity,
}

impl Field {
    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Field::Orientation => "orientation",
            Field::Norm => "norm of the quaternion",
            Field::AngularMomentum => "angular momentum",
            Field::Status => "status",
            Field::Decision => "decision",
            Field::NextStep => "next step",
            Field::Left => "rest of the interval",
            Field::Cuts => "steps in one call",
            Field::Position => "position",
            Field::Velocity => "velocity",
        }
    }

    /// The name of one of its components; empty if it is one number.
    pub fn component(self, component: usize) -> &'static str {
        match self {
            Field::Orientation | Field::AngularMomentum | Field::Position | Field::Velocity => {
                ["x", "y", "z", "w"][component.min(3)]
            }
            Field::Cuts => ["qx", "qy", "qz", "qw", "mx", "my", "mz"][component.min(6)],
            _ => "",
        }
    }
}

/// The values of both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Gap {
    pub field: Field,
    pub component: usize,
    pub expected: f64,
    pub found: f64,
    /// Infinite if one side is NaN.
    pub difference: f64,
    /// The largest component of the vector, in whose ulps the difference is counted.
    pub size: f64,
}

impl Gap {
    /// The gap of a single number.
    pub fn number(field: Field, expected: f64, found: f64) -> Self {
        let difference = if expected.to_bits() == found.to_bits() { 0.0 } else { (found - expected).abs() };
        let difference = if difference.is_finite() { difference } else { f64::INFINITY };
        Self { field, component: 0, expected, found, difference, size: expected.abs() }
    }

    /// The gap of a vector: the component with the greatest difference.
    pub fn vector(field: Field, expected: &[f64], found: &[f64], off: &[f64]) -> Self {
        let size = expected.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        let mut gap = Self { field, component: 0, expected: expected[0], found: found[0], difference: 0.0, size };
        for (component, &off) in off.iter().enumerate() {
            let difference = if off.is_finite() { off.abs() } else { f64::INFINITY };
            if difference > gap.difference {
                let (expected, found) = (expected[component], found[component]);
                gap = Self { component, expected, found, difference, ..gap };
            }
        }
        gap
    }
}

/// The gaps between two states of a body: across the quaternion, along it, and in the angular momentum.
pub(super) fn gaps(expected: &[f64; STATE_COMPONENTS], found: &[f64; STATE_COMPONENTS]) -> [Gap; 3] {
    let off: [f64; STATE_COMPONENTS] = std::array::from_fn(|component| found[component] - expected[component]);
    let (q, q_off) = (&expected[..4], &off[..4]);
    // Squares of a quaternion that a step has torn off the unit sphere may overflow; scaling by a power of two rounds nothing.
    let largest = |q: &[f64]| power_of_two(q.iter().fold(f64::MIN_POSITIVE, |size, x| size.max(x.abs())));
    let scale = largest(q);
    let dot = |a: &[f64], b: &[f64], scale: f64| a.iter().zip(b).map(|(a, b)| (a / scale) * (b / scale)).sum::<f64>();
    let along = dot(q, q_off, scale) / dot(q, q, scale);
    let across: Vec<f64> = q_off.iter().zip(q).map(|(off, q)| off - along * q).collect();
    let norm = |q: &[f64]| dot(q, q, largest(q)).sqrt() * largest(q);
    let norms = Gap { difference: along.abs(), ..Gap::number(Field::Norm, norm(q), norm(&found[..4])) };
    [
        Gap::vector(Field::Orientation, q, &found[..4], &across),
        Gap { difference: if along.is_finite() { norms.difference } else { f64::INFINITY }, ..norms },
        Gap::vector(Field::AngularMomentum, &expected[4..], &found[4..], &off[4..]),
    ]
}

/// The first number in which states differ in a bit of either word.
pub(super) fn first_bit_difference(expected: &StateWords, found: &StateWords) -> Option<(usize, Gap)> {
    for row in 0..expected.len() {
        let residues = [expected.residue_of(row), found.residue_of(row)];
        for [expected, found] in [[expected.value[row], found.value[row]], residues] {
            for component in 0..STATE_COMPONENTS {
                let (expected, found) = (expected[component], found[component]);
                if expected.to_bits() != found.to_bits() {
                    return Some((row, Gap { component, ..Gap::number(Field::Cuts, expected, found) }));
                }
            }
        }
    }
    None
}

/// The largest difference seen in one field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Largest {
    /// The field.
    pub field: Field,
    /// The difference, in the field's units.
    pub difference: f64,
    /// The same in ulps of the vector's largest component, in the precision of the group.
    pub ulps: f64,
    /// The largest ratio of any difference to its own bound, not necessarily that of this one; `None` if there is no bound.
    pub of_bound: Option<f64>,
    /// The body.
    pub body: usize,
    /// The step, from 1.
    pub step: u64,
}

/// Where two sides part by more than the bound.
#[derive(Clone, Debug, PartialEq)]
pub struct Parting {
    /// The step, from 1: for equal steps since the start, for adaptive ones the attempt, for a closed form the output time.
    pub step: u64,
    /// The time at its start, s; for a closed form the time of the output.
    pub time: f64,
    /// The body.
    pub body: usize,
    /// What differs.
    pub field: Field,
    /// The component that differs the most.
    pub component: &'static str,
    /// The value of the side under test.
    pub found: f64,
    /// The value of the side that it is compared with.
    pub expected: f64,
    /// How far apart they are, in the sense of the field.
    pub difference: f64,
    /// The bound.
    pub bound: f64,
    /// The torque that causes it.
    pub culprit: Culprit,
    /// What in the step causes it.
    pub onset: Onset,
    /// The evaluation in which the sides part, or why none is named.
    pub stage: std::result::Result<Stage, NoStage>,
}

/// Two sides, and how far apart they were.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// The side under test, and the side that it is compared with.
    pub sides: [String; 2],
    /// Whether a difference beyond the bound is a fault; between the twin and the reference it is not.
    pub judged: bool,
    /// Numbers that were compared, one for each body, step and field.
    pub compared: u64,
    /// Steps of a body whose state was compared with a bound.
    pub decided: u64,
    /// Steps of a body whose bound is not known, as a decision hangs on rounding or the torques are too long to be recorded together: only
    /// NaN is a fault in them.
    pub undecided: u64,
    /// Steps after which the body is lost: numbers have overflowed, or the same components are NaN on both sides. It is then not
    /// compared.
    pub lost: u64,
    /// The largest differences, one for each field.
    pub largest: Vec<Largest>,
    /// The first difference beyond the bound.
    pub parting: Option<Parting>,
}

/// Where a difference was found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub body: usize,
    pub step: u64,
    pub time: f64,
}

impl Comparison {
    pub(super) fn new(sides: [String; 2], judged: bool) -> Self {
        Self { sides, judged, compared: 0, decided: 0, undecided: 0, lost: 0, largest: Vec::new(), parting: None }
    }

    /// Whether a body's state was compared with a bound in any step; also true if there was no step.
    pub(super) fn decides(&self) -> bool {
        self.decided > 0 || self.undecided + self.lost == 0
    }

    /// Enters a difference; returns whether it is the first beyond its bound.
    pub(super) fn enter(&mut self, gap: &Gap, bound: Option<f64>, precision: Precision, place: Place) -> bool {
        let bound = finite(bound);
        self.compared += 1;
        let ulps = gap.difference / ulp(gap.size, precision);
        let part = bound.map(|bound| if gap.difference == 0.0 { 0.0 } else { gap.difference / bound });
        let new = Largest {
            field: gap.field,
            difference: gap.difference,
            ulps,
            of_bound: part,
            body: place.body,
            step: place.step,
        };
        match self.largest.iter_mut().find(|largest| largest.field == gap.field) {
            None => self.largest.push(new),
            Some(largest) => {
                let of_bound = largest.of_bound.into_iter().chain(part).reduce(f64::max);
                if gap.difference > largest.difference {
                    *largest = new;
                }
                largest.of_bound = of_bound;
            }
        }
        if !(self.judged && excess(gap, bound).is_some() && self.parting.is_none()) {
            return false;
        }
        self.part(gap, bound, place);
        true
    }

    /// Records a difference as the one in which the sides part.
    pub(super) fn part(&mut self, gap: &Gap, bound: Option<f64>, place: Place) {
        self.parting = Some(Parting {
            step: place.step,
            time: place.time,
            body: place.body,
            field: gap.field,
            component: gap.field.component(gap.component),
            found: gap.found,
            expected: gap.expected,
            difference: gap.difference,
            bound: bound.unwrap_or(f64::INFINITY),
            culprit: Culprit::NotSought,
            onset: Onset::NotFound,
            stage: Err(NoStage::NotSought),
        });
    }

    /// Records which torque causes the parting, and what in the step; `agreed` applies if the states agree under the culprit.
    pub(super) fn blame(&mut self, traced: Traced, agreed: Onset) {
        if let Some(parting) = &mut self.parting {
            let Traced { culprit, onset, stage } = traced;
            (parting.culprit, parting.onset, parting.stage) = (culprit, onset.unwrap_or(agreed), stage);
        }
    }
}

/// A bound that is NaN bounds nothing.
fn finite(bound: Option<f64>) -> Option<f64> {
    bound.filter(|bound| bound.is_finite())
}

/// The ratio of a difference to its bound, if it exceeds that; without a bound, a NaN on only one side exceeds it.
pub(super) fn excess(gap: &Gap, bound: Option<f64>) -> Option<f64> {
    match finite(bound) {
        Some(bound) => (gap.difference > bound).then(|| gap.difference / bound.max(f64::MIN_POSITIVE)),
        None => gap.difference.is_infinite().then_some(f64::INFINITY),
    }
}

/// Whether a body is lost, so that nothing can be concluded from it: the same components are not finite on both sides, or others are where
/// numbers are so large that the order of the operations decides which products overflow. For a body of moderate numbers, a NaN on only one
/// side is a fault.
pub(super) fn is_lost(expected: &[f64], found: &[f64], precision: Precision) -> bool {
    if expected.iter().chain(found).all(|x| x.is_finite()) {
        return false;
    }
    let greatest = match precision {
        Precision::F32 => f64::from(f32::MAX),
        Precision::F64 => f64::MAX,
    };
    let is_large = |x: &f64| x.is_finite() && x.abs() >= greatest.powf(1.0 / FACTORS);
    let coincide = expected.iter().zip(found).all(|(a, b)| a.is_finite() == b.is_finite());
    coincide || expected.iter().chain(found).any(is_large)
}

/// The most factors in the products that the stages of one step form from the numbers of a state at its end.
const FACTORS: f64 = 8.0;

/// The distance between neighbouring numbers at `x` ≥ 0; below the least normal number, the distance there.
fn ulp(x: f64, precision: Precision) -> f64 {
    let (least, digits) = match precision {
        Precision::F32 => (f64::from(f32::MIN_POSITIVE), f64::from(f32::EPSILON)),
        Precision::F64 => (f64::MIN_POSITIVE, f64::EPSILON),
    };
    digits * power_of_two(x.max(least))
}

/// The greatest power of two that is at most a normal number.
fn power_of_two(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & (0x7ff << 52))
}
