//! The Pareto front of time and error: which choices are worth making.

/// One choice: what it costs and how accurate it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Wall time, s.
    pub seconds: f64,
    /// Error, rad.
    pub error: f64,
    /// Whether it passed its check; one that did not never wins.
    pub valid: bool,
}

impl Point {
    fn counts(&self) -> bool {
        self.valid && self.seconds.is_finite() && self.error.is_finite()
    }
}

/// Indices of the valid points that no other valid point undercuts in both time and error, from the least accurate to the
/// most accurate. Of points that are equal in both, the first.
pub fn pareto(points: &[Point]) -> Vec<usize> {
    let mut indices: Vec<usize> = (0..points.len()).filter(|&index| points[index].counts()).collect();
    let key = |index: usize| (points[index].seconds, points[index].error);
    indices.sort_by(|&a, &b| key(a).0.total_cmp(&key(b).0).then(key(a).1.total_cmp(&key(b).1)));
    let mut least_error = f64::INFINITY;
    indices.retain(|&index| {
        let undercuts = points[index].error < least_error;
        least_error = least_error.min(points[index].error);
        undercuts
    });
    indices
}

/// For each power of ten between the greatest and the least error of the valid points, the exponent and the index of the
/// fastest valid point whose error is no greater, from the coarsest to the finest.
pub(crate) fn fastest_by_decade(points: &[Point]) -> Vec<(i32, usize)> {
    let front = pareto(points);
    let (Some(&coarsest), Some(&finest)) = (front.first(), front.last()) else { return Vec::new() };
    let decade = |index: usize| points[index].error.max(f64::MIN_POSITIVE).log10().ceil() as i32;
    // The front's order is that of time, so the first that is accurate enough is the fastest.
    (decade(finest)..=decade(coarsest))
        .rev()
        .filter_map(|exponent| {
            let bound = 10_f64.powi(exponent);
            front.iter().find(|&&index| points[index].error <= bound).map(|&index| (exponent, index))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(seconds: f64, error: f64, valid: bool) -> Point {
        Point { seconds, error, valid }
    }

    #[test]
    fn a_failed_row_never_wins() {
        let points = [point(1e-9, 1e-16, false), point(2.0, 1e-3, true), point(f64::NAN, 0.0, true)];
        assert_eq!(pareto(&points), [1]);
        assert_eq!(fastest_by_decade(&points), [(-3, 1)]);
        assert!(pareto(&points[..1]).is_empty());
        assert!(fastest_by_decade(&points[..1]).is_empty());
    }

    #[test]
    fn the_front_leaves_out_what_is_undercut() {
        let points = [
            point(1.0, 1e-2, true),
            point(2.0, 1e-6, true),
            point(3.0, 1e-4, true),
            point(4.0, 0.5e-9, true),
            point(1.0, 1e-2, true),
        ];
        assert_eq!(pareto(&points), [0, 1, 3]);
        let decades = fastest_by_decade(&points);
        assert_eq!(decades[0], (-2, 0));
        assert!(decades[1..5].iter().all(|&(_, index)| index == 1), "{decades:?}");
        assert_eq!(decades.last(), Some(&(-9, 3)));
    }
}
