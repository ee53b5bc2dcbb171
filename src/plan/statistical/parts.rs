//! The error of one statistic of a sample's bodies, a mean or a quantile, in its parts.

use super::RISK;
use crate::math::QUANTILE_ERROR;
use crate::plan::sampling::mixed;
use crate::plan::unseen::unseen;

/// Resamples behind the standard error of a quantile (B. Efron, *Ann. Statist.* 7 (1979) 1).
const RESAMPLES: usize = 100;

/// Fixed, so that the same values give the same figures.
const SEED: u64 = 2;

/// If fewer bodies of a sample than this are beyond its quantile, or at it, the scatter of the difference is taken to be the difference at least.
const EXTREME: usize = 3;

/// A statistic's error in the quantity's unit.
pub(super) struct Parts {
    pub difference: f64,
    pub standard_error: f64,
    /// What bodies that the sample lacks may add to the difference.
    pub unseen: f64,
    pub sampling: f64,
    pub resolution: f64,
}

impl Parts {
    pub const UNKNOWN: Self = {
        let nan = f64::NAN;
        Self { difference: nan, standard_error: nan, unseen: 0.0, sampling: nan, resolution: 0.0 }
    };
}

/// What the values of a sample stand for.
pub(super) struct Stands<'v> {
    /// The number of bodies that each stands for, relative to the others.
    pub weights: &'v [f64],
    /// Number of all bodies.
    pub all: f64,
    /// The part of them whose value may be any that there is.
    pub doubtful: f64,
}

/// Mean of some numbers with their weights, their standard deviation (of n - 1 for equal weights), and the standard error of the mean if they
/// were drawn with probabilities that go inversely with the weights (W. G. Cochran, *Sampling Techniques*, 3rd ed. (1977), section 9A.3);
/// deviation and error of one number are NaN.
pub(super) fn moments(values: &[f64], weights: &[f64]) -> (f64, f64, f64) {
    let (count, total) = (values.len() as f64, weights.iter().sum::<f64>());
    let sum = |term: &dyn Fn(f64, f64) -> f64| {
        values.iter().zip(weights).map(|(value, weight)| term(*value, *weight)).sum::<f64>()
    };
    let mean = sum(&|value, weight| weight * value) / total;
    let squares = sum(&|value, weight| weight * (value - mean) * (value - mean)) / total;
    let of_mean = sum(&|value, weight| (weight * (value - mean)).powi(2)) / (total * total);
    // Of one number it is NaN, as it should be.
    let bessel = if count > 1.0 { count / (count - 1.0) } else { f64::NAN };
    (mean, (bessel * squares).sqrt(), (bessel * of_mean).sqrt())
}

/// That of a mean.
pub(super) fn of_means(as_run: &[f64], accurate: &[f64], &Stands { weights, all, doubtful }: &Stands<'_>) -> Parts {
    let differences: Vec<f64> = as_run.iter().zip(accurate).map(|(a, b)| a - b).collect();
    let (difference, _, standard_error) = moments(&differences, weights);
    let (_, own, _) = moments(accurate, weights);
    let deviations: Vec<f64> = differences.iter().map(|own| own - difference).collect();
    let extremes = |(low, high): (f64, f64), &value: &f64| (low.min(value), high.max(value));
    let (least, greatest) = as_run.iter().chain(accurate).fold((f64::MAX, f64::MIN), extremes);
    Parts {
        difference,
        // For a single difference the best estimate is the difference itself.
        standard_error: if standard_error.is_nan() { difference.abs() } else { standard_error },
        unseen: unseen(&deviations, weights, (all, greatest - least, RISK)),
        // One body says nothing of a population: NaN.
        sampling: own / all.sqrt(),
        resolution: doubtful * (greatest - least),
    }
}

/// That of a quantile, which is formed from counts if it `is_counted`.
pub(super) fn of_quantiles(
    as_run: &[f64],
    accurate: &[f64],
    (percent, is_counted): (f64, bool),
    &Stands { weights, all, doubtful }: &Stands<'_>,
) -> Parts {
    let count = accurate.len();
    let sorted = |values: &[f64]| {
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
        order
    };
    let (run_order, own_order) = (sorted(as_run), sorted(accurate));
    // The place of the value at a rank, each body counted `times` over; sums of equal weights that should be the rank itself are.
    let place = |order: &[usize], times: &[u32], rank: f64| {
        let weight = |body: &usize| weights[*body] * f64::from(times[*body]);
        let total: f64 = order.iter().map(weight).sum();
        let (mut below, wanted) = (0.0, rank * total * (1.0 - 1e-12));
        order.iter().position(|body| {
            below += weight(body);
            below > 0.0 && below >= wanted
        })
    };
    let part = 0.01 * percent;
    let quantile = |order: &[usize], values: &[f64], times: &[u32]| {
        place(order, times, part).map_or(f64::NAN, |place| values[order[place]])
    };
    let mut times = vec![1; count];
    let rank = place(&own_order, &times, part).map_or(count, |place| place + 1);
    let own = quantile(&own_order, accurate, &times);
    let difference = quantile(&run_order, as_run, &times) - own;
    // Those of doubtful value may all be above it, or all below.
    let at =
        |part: f64| place(&own_order, &times, part.clamp(0.0, 1.0)).map_or(own, |place| accurate[own_order[place]]);
    let by_doubt = if doubtful > 0.0 { (at(part + doubtful) - own).max(own - at(part - doubtful)) } else { 0.0 };
    let resampled: Vec<(f64, f64)> = (0..RESAMPLES)
        .map(|resample| {
            times.fill(0);
            for draw in 0..count {
                times[(mixed(SEED ^ (resample * count + draw) as u64) % count as u64) as usize] += 1;
            }
            let own = quantile(&own_order, accurate, &times);
            (quantile(&run_order, as_run, &times) - own, own)
        })
        .collect();
    let deviation = |values: Vec<f64>| moments(&values, &[1.0; RESAMPLES]).1;
    let of_difference = deviation(resampled.iter().map(|(difference, _)| *difference).collect());
    let of_own = deviation(resampled.iter().map(|(_, own)| *own).collect());
    // The greatest of a sample is most often also that of the resampled bodies, however much it scatters.
    let is_extreme = rank.min(count + 1 - rank) < EXTREME && (count as f64) < all;
    let least = if is_extreme || count == 1 { difference.abs() } else { 0.0 };
    Parts {
        difference,
        standard_error: of_difference.max(least),
        unseen: 0.0,
        sampling: if count > 1 { of_own * (count as f64 / all).sqrt() } else { f64::NAN },
        resolution: by_doubt + if is_counted { QUANTILE_ERROR * own.abs() } else { 0.0 },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_count_as_often_as_they_stand_for() {
        let values: [(f64, f64); 5] = [(3.0, 2.0), (1.0, 1.0), (7.0, 3.0), (2.0, 1.0), (5.0, 1.0)];
        let (own, weights): (Vec<f64>, Vec<f64>) = values.into_iter().unzip();
        let repeated: Vec<f64> = values.iter().flat_map(|(value, weight)| vec![*value; *weight as usize]).collect();
        let as_run = |values: &[f64]| values.iter().map(|value| value + 0.1 * value * value).collect::<Vec<f64>>();
        let ones = vec![1.0; repeated.len()];
        let stands = |weights| Stands { weights, all: 100.0, doubtful: 0.0 };
        let pair = [(&own, &weights), (&repeated, &ones)].map(|(values, weights)| {
            let quantiles = [0.0, 12.5, 50.0, 60.0, 100.0]
                .map(|percent| of_quantiles(&as_run(values), values, (percent, false), &stands(weights)).difference);
            (of_means(&as_run(values), values, &stands(weights)).difference, quantiles)
        });
        let [(mean, quantiles), (of_repeated, quantiles_of_repeated)] = pair;
        assert!((mean - of_repeated).abs() < 1e-14, "{mean}, {of_repeated}");
        assert_eq!(quantiles, quantiles_of_repeated);
        // Where all weights are equal, the deviation and the error are the usual ones.
        let (_, deviation, error) = moments(&own, &[2.5; 5]);
        let mean = own.iter().sum::<f64>() / 5.0;
        let usual = (own.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 4.0).sqrt();
        assert!((deviation - usual).abs() < 1e-14 && (error - usual / 5.0_f64.sqrt()).abs() < 1e-14);
    }

    #[test]
    fn bodies_of_doubtful_value_may_have_any() {
        let (values, weights): (Vec<f64>, _) = ((0..101).map(f64::from).collect(), [1.0; 101]);
        let stands = |doubtful| Stands { weights: &weights, all: 1e4, doubtful };
        let of = |doubtful| {
            let of_median = of_quantiles(&values, &values, (50.0, false), &stands(doubtful)).resolution;
            [of_means(&values, &values, &stands(doubtful)).resolution, of_median]
        };
        assert_eq!([of(0.0), of(0.1), of(1.0)], [[0.0, 0.0], [10.0, 10.0], [100.0, 50.0]]);
    }
}
