//! Finds a root between two points at which a function has different signs.

/// Brackets a change of sign: false position with the weights of N. Anderson and Å. Björck (*BIT* 13 (1973) 253), and a
/// bisection whenever the bracket has not shrunk to less than half in three steps, so that it always closes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bracket {
    /// The end on the side where the search began, and the value there.
    pub start: (f64, f64),
    /// The other one.
    pub end: (f64, f64),
    /// Which end was kept the last time.
    stayed: Option<bool>,
    /// The width three steps ago, and the steps since.
    width: f64,
    steps: u32,
}

impl Bracket {
    /// Between two points.
    pub fn new(start: (f64, f64), end: (f64, f64)) -> Self {
        Self { start, end, stayed: None, width: f64::INFINITY, steps: 0 }
    }

    /// The next point to evaluate; `None` once the bracket is no wider than `tolerance`.
    pub fn next(&mut self, tolerance: f64) -> Option<f64> {
        let ((a, value_a), (b, value_b)) = (self.start, self.end);
        let width = (b - a).abs();
        if width <= tolerance {
            return None;
        }
        self.steps += 1;
        let middle = 0.5 * a + 0.5 * b;
        let secant = a + (b - a) * (value_a / (value_a - value_b));
        let mut next = secant;
        if self.steps.is_multiple_of(3) {
            if width > 0.5 * self.width {
                next = middle;
            }
            self.width = width;
        }
        // Keeps a distance from the ends, so that the point differs from them and may be on the other side of the root.
        let (low, high) = (a.min(b), a.max(b));
        let margin = 0.5 * tolerance;
        next = next.clamp(low + margin, high - margin);
        if !next.is_finite() {
            next = middle;
        }
        (next > low && next < high).then_some(next)
    }

    /// Takes the value at a point inside; `is_past` says whether it is on the side of the end.
    pub fn take(&mut self, at: f64, value: f64, is_past: bool) {
        let (replaced, kept) =
            if is_past { (&mut self.end, &mut self.start) } else { (&mut self.start, &mut self.end) };
        if self.stayed == Some(is_past) {
            let ratio = 1.0 - value / replaced.1;
            kept.1 *= if ratio > 0.0 { ratio } else { 0.5 };
        }
        *replaced = (at, value);
        self.stayed = Some(is_past);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn root(f: impl Fn(f64) -> f64, a: f64, b: f64, tolerance: f64) -> (f64, u32) {
        let mut bracket = Bracket::new((a, f(a)), (b, f(b)));
        let past = f(b) < 0.0;
        let mut evaluations = 0;
        while let Some(next) = bracket.next(tolerance) {
            let value = f(next);
            bracket.take(next, value, (value < 0.0) == past);
            evaluations += 1;
            assert!(evaluations < 300, "it does not close: {bracket:?}");
        }
        (bracket.end.0, evaluations)
    }

    #[test]
    fn roots_of_smooth_functions_take_few_steps() {
        let (found, steps) = root(|x| x.cos(), 0.0, 3.0, 1e-14);
        assert!((found - std::f64::consts::FRAC_PI_2).abs() < 2e-14 && steps <= 10, "{found}, {steps}");
        let (found, steps) = root(|x| (-x).exp() - 0.5, 0.0, 50.0, 1e-13);
        assert!((found - 2.0_f64.ln()).abs() < 2e-13 && steps <= 20, "{found}, {steps}");
    }

    #[test]
    fn roots_of_others_are_found_all_the_same() {
        for (f, expected) in [
            ((|x| if x < 0.7 { 1.0 } else { -1e-9 }) as fn(f64) -> f64, 0.7),
            (|x| 0.25 - x.powi(21), 0.25_f64.powf(1.0 / 21.0)),
            (|x| (0.3 - x).powi(3), 0.3),
            (|x| 1e300 * (0.1 - x), 0.1),
        ] {
            let (found, _) = root(f, 0.0, 2.0, 1e-12);
            assert!((found - expected).abs() <= 2e-12, "{found}, {expected}");
        }
    }
}
