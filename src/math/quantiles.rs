//! How numbers are distributed over bodies.

/// Median, 99th percentile and maximum over the bodies that did not fail.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct Quantiles {
    /// Half of the bodies are at or below it.
    pub median: f64,
    /// 99 in 100 are at or below it.
    pub p99: f64,
    /// All are at or below it.
    pub max: f64,
}

impl Quantiles {
    /// Those that no body is behind.
    #[cfg(feature = "study")]
    pub(crate) const UNKNOWN: Self = Self { median: f64::NAN, p99: f64::NAN, max: f64::NAN };

    /// The quantiles of `values`, which are reordered; 0 if there are none. No value may be NaN.
    pub fn of(values: &mut [f64]) -> Self {
        if values.is_empty() {
            return Self::default();
        }
        let (middle, place) = (index(values.len(), 0.5), index(values.len(), 0.99));
        // The values after it are not less, and only these are searched for the next quantile.
        let (_, &mut median, above) = values.select_nth_unstable_by(middle, f64::total_cmp);
        let Some(place) = place.checked_sub(middle + 1) else {
            return Self { median, p99: median, max: greatest(above).unwrap_or(median) };
        };
        let (_, &mut p99, above) = above.select_nth_unstable_by(place, f64::total_cmp);
        Self { median, p99, max: greatest(above).unwrap_or(p99) }
    }

    /// The quantiles of values with weights; 0 if there are none. No value may be NaN.
    pub(crate) fn weighted(values: &[f64], weights: &[f64]) -> Self {
        let mut ordered: Vec<(f64, f64)> = values.iter().copied().zip(weights.iter().copied()).collect();
        ordered.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let total: f64 = ordered.iter().map(|(_, weight)| weight).sum();
        let below = |part: f64| {
            let mut sum = 0.0;
            // With an allowance for rounding: for equal weights the rank is the same as without weights.
            let wanted = part * total * (1.0 - 1e-12);
            let reached = ordered.iter().find(|(_, weight)| {
                sum += weight;
                sum >= wanted
            });
            reached.or(ordered.last()).map_or(0.0, |(value, _)| *value)
        };
        Self { median: below(0.5), p99: below(0.99), max: ordered.last().map_or(0.0, |(value, _)| *value) }
    }

    /// The smallest of `values`, which are reordered, with at least `part` of all at or below it; 0 where there are none.
    pub(crate) fn rank(values: &mut [f64], part: f64) -> f64 {
        if values.is_empty() {
            return 0.0;
        }
        let index = index(values.len(), part);
        *values.select_nth_unstable_by(index, f64::total_cmp).1
    }
}

fn greatest(values: &[f64]) -> Option<f64> {
    values.iter().copied().max_by(f64::total_cmp)
}

/// The index, among `count` sorted values (at least one), of the first with at least `part` of all at or before it.
fn index(count: usize, part: f64) -> usize {
    ((part * count as f64).ceil() as usize).clamp(1, count) - 1
}

impl std::fmt::Display for Quantiles {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{:.1e} (p99 {:.1e}, max {:.1e})", self.median, self.p99, self.max)
    }
}

/// How a count is distributed over bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "study", derive(serde::Serialize, serde::Deserialize))]
pub struct Spread {
    /// The total over all bodies.
    pub total: u64,
    /// The least of any body.
    pub min: u64,
    /// Half of the bodies are at or below it.
    pub median: u64,
    /// The greatest of any body.
    pub max: u64,
}

impl Spread {
    /// The spread of one count for each body; zeros without bodies.
    pub(crate) fn of(mut counts: Vec<u64>) -> Self {
        counts.sort_unstable();
        let at = |index: usize| counts.get(index).copied().unwrap_or(0);
        Self {
            total: counts.iter().sum(),
            min: at(0),
            median: at(counts.len().saturating_sub(1) / 2),
            max: at(counts.len().saturating_sub(1)),
        }
    }
}

impl std::fmt::Display for Spread {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{} (min {}, median {}, max {} a body)", self.total, self.min, self.median, self.max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_sorted_values() {
        for count in [1, 2, 3, 10, 99, 100, 101, 1000] {
            // A permutation, as 7919 is a prime.
            let mut values: Vec<f64> = (0..count).map(|index| (index * 7919 % count) as f64).collect();
            let rank = |part: f64| ((part * count as f64).ceil() - 1.0).max(0.0);
            let expected = Quantiles { median: rank(0.5), p99: rank(0.99), max: (count - 1) as f64 };
            assert_eq!(Quantiles::of(&mut values), expected, "{count}");
        }
        assert_eq!(Quantiles::of(&mut []), Quantiles::default());
        assert!(Quantiles::of(&mut [0.0, f64::NAN, 1.0]).max.is_nan());
    }
}
