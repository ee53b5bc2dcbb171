//! Equal steps that end exactly at a given time.

/// Steps of equal size from one time to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Number of steps.
    pub steps: u64,
    /// Size of each, s.
    pub dt: f64,
}

/// The fewest equal steps of at most `longest` that make up `span`; a step count within 1e-9 of a whole number is
/// taken as that number, so that 10 s in steps of 0.1 s are 100 steps although 0.1 is not a machine number.
pub(crate) fn steps_over(span: f64, longest: f64) -> Interval {
    if span <= 0.0 {
        return Interval { steps: 0, dt: longest };
    }
    let ratio = span / longest;
    let nearest = ratio.round();
    let steps = if (ratio - nearest).abs() <= 1e-9 * nearest { nearest } else { ratio.ceil() }.max(1.0);
    Interval { steps: steps as u64, dt: span / steps }
}
