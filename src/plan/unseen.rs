//! What a sample says of errors that it has not seen.
//!
//! The standard error of a mean describes how a sample scatters only if its greatest members are not far greater than the others. Where
//! motion near a separatrix makes a few bodies in a thousand err a thousand times as much as the median, most samples have none of them,
//! and their standard error is too small by as much as they matter.

/// The quantile of Student's distribution of `freedom` degrees that is exceeded as often as `z` of a normal distribution, by the first two
/// terms in the inverse number of degrees (E. A. Cornish and R. A. Fisher, *Rev. Inst. Int. Stat.* 5 (1938) 307); 2 % too small for z = 3.5 and seven
/// degrees.
pub(super) fn student(z: f64, freedom: f64) -> f64 {
    let square = z * z;
    let first = 0.25 * (square + 1.0);
    let second = (5.0 * square + 16.0).mul_add(square, 3.0) / 96.0;
    z * (1.0 + (first + second / freedom) / freedom)
}

/// The fewest numbers from which a tail is extended.
const LEAST_TAIL: usize = 5;

/// How many standard errors the tail's exponent is taken to be heavier than it was found.
const CAUTION: f64 = 1.0;

/// How far the mean of `all` numbers may lie beside that of the sample `values`, because of numbers greater than any of the sample.
///
/// The greatest √n of the sample (at least five) are taken to follow a power law, P(|x| > y) ~ y^(-1/γ), with γ by the estimator of B. M. Hill,
/// *Ann. Statist.* 3 (1975) 1163, and one of its standard errors more. Two parts are added: a single number that is so great that
/// one of `all` exceeds it with the probability `risk`, but at most `greatest`; and for γ > 1/2, where the variance of the law is infinite and a
/// standard error says little, up to twice what the numbers between the sample's greatest and that one add to the mean of the law.
pub(super) fn unseen(values: &[f64], weights: &[f64], (all, greatest, risk): (f64, f64, f64)) -> f64 {
    let count = values.len();
    let tail = ((count as f64).sqrt() as usize).max(LEAST_TAIL);
    if tail >= count || count as f64 >= all {
        return 0.0;
    }
    let mut sizes: Vec<(f64, f64)> = values.iter().zip(weights).map(|(value, weight)| (value.abs(), *weight)).collect();
    sizes.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (of_sample, least) = (sizes[0].0, sizes[tail].0);
    let weight: f64 = sizes[..tail].iter().map(|(_, weight)| weight).sum();
    let log_excess: f64 = sizes[..tail].iter().map(|(size, weight)| weight * (size / least).ln()).sum();
    let exponent = log_excess / weight * (1.0 + CAUTION / (tail as f64).sqrt());
    // No tail: the sizes are alike, all 0, or only a few differ from 0, which the standard error describes.
    if !(exponent > 0.0 && exponent.is_finite()) {
        return 0.0;
    }
    let part = weight / weights.iter().sum::<f64>();
    let single = (least * (all * part / risk).powf(exponent)).min(greatest);
    // The integral of x dF from the sample's greatest number to the single one, for F = part (least / x)^(1 / γ).
    let power = 1.0 - exponent.recip();
    let at = |size: f64| (least / size).powf(exponent.recip()) * size;
    let between = match power.abs() < 1e-6 {
        true => least * (single / of_sample).ln() / exponent,
        false => (at(single) - at(of_sample)) / (power * exponent),
    };
    let heaviness = (2.0 * exponent - 1.0).clamp(0.0, 1.0);
    (single / all + 2.0 * heaviness * part * between.max(0.0)) * (1.0 - count as f64 / all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::sampling::mixed;

    #[test]
    fn student_is_that_of_the_tables() {
        // Two-sided 0.1 % and 5 %: NIST/SEMATECH, *e-Handbook of Statistical Methods*, 1.3.6.7.2.
        for (z, freedom, t, bound) in
            [(3.290527, 10.0, 4.587, 0.02), (3.290527, 100.0, 3.390, 1e-3), (1.959964, 10.0, 2.228, 5e-3)]
        {
            assert!((student(z, freedom) / t - 1.0).abs() < bound, "{z}, {freedom}: {}", student(z, freedom));
        }
    }

    /// Sizes u^-γ of a power law, with signs.
    fn power_law(seed: u64, count: usize, exponent: f64) -> Vec<f64> {
        let uniform = |k: u64| ((mixed(seed << 32 | k) >> 11) as f64 + 0.5) * 2.0_f64.powi(-53);
        let sign = |k: u64| if mixed(!(seed << 32 | k)) & 1 == 0 { 1.0 } else { -1.0 };
        (0..count as u64).map(|k| sign(k) * uniform(k).powf(-exponent)).collect()
    }

    /// The shares of samples whose interval of two standard errors has the mean of all, without and with what is unseen, and the mean ratio of the
    /// two widths.
    fn covered(exponent: f64) -> (f64, f64, f64) {
        let (mut without, mut with, mut ratio) = (0, 0, 0.0);
        const SAMPLES: usize = 300;
        for seed in 0..SAMPLES {
            let all = power_law(seed as u64 + 1, 4000, exponent);
            let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
            let sample = &all[..160];
            let own = mean(sample);
            let variance = sample.iter().map(|value| (value - own).powi(2)).sum::<f64>() / 159.0;
            let width = 1.96 * (variance / 160.0).sqrt();
            let more = unseen(sample, &[1.0; 160], (4000.0, f64::MAX, 0.05));
            let off = (own - mean(&all)).abs();
            without += usize::from(off <= width);
            with += usize::from(off <= width + more);
            ratio += (width + more) / width;
        }
        (without as f64 / SAMPLES as f64, with as f64 / SAMPLES as f64, ratio / SAMPLES as f64)
    }

    #[test]
    fn heavy_tails_are_allowed_for_and_light_ones_cost_little() {
        let (without, with, _) = covered(1.5);
        assert!(without < 0.85 && with > 0.93, "{without}, {with}");
        let (_, with, ratio) = covered(0.2);
        assert!(with > 0.93 && ratio < 1.1, "{with}, {ratio}");
    }

    #[test]
    fn nothing_is_unseen_where_all_is_seen_or_alike() {
        let sizes = power_law(1, 100, 1.0);
        assert_eq!(unseen(&sizes, &[1.0; 100], (100.0, 1e9, 0.05)), 0.0);
        assert_eq!(unseen(&[0.5; 100], &[1.0; 100], (1e4, 1.0, 0.05)), 0.0);
        assert_eq!(unseen(&[0.0; 100], &[1.0; 100], (1e4, 1.0, 0.05)), 0.0);
        assert_eq!(unseen(&[1.0, 2.0], &[1.0; 2], (1e4, 1.0, 0.05)), 0.0);
        let most = unseen(&sizes, &[1.0; 100], (1e4, 200.0, 0.05));
        assert!(most < unseen(&sizes, &[1.0; 100], (1e4, 1e9, 0.05)), "{most}");
        // Weights count as repeated numbers do, as far as the number of members has no part.
        let doubled = unseen(&sizes, &[2.0; 100], (1e4, 200.0, 0.05));
        assert_eq!(most, doubled);
    }
}
