//! Samples of bodies: how they are drawn, and what a sample says about a percentile of all bodies.
//!
//! Of n bodies drawn from many, the number below the quantile of order p is binomial with probability p (W. J. Conover, *Practical
//! Nonparametric Statistics*, 3rd ed. (1999), section 3.2). A sample drawn without replacement from few bodies says more, not
//! less.

/// The accepted probability of a wrong conclusion.
const RISK: f64 = 0.05;

/// The rank, from 1, of the value in a sample of `count` that is at or above the quantile of order `part` of all bodies with a
/// probability of 95 %; the greatest rank if the sample is too small for that.
pub(crate) fn upper_rank(count: usize, part: f64) -> usize {
    // P(fewer than `rank` of the sample below the quantile) must be 1 - RISK.
    (1..=count).rev().take_while(|&rank| at_least(rank, count, part) <= RISK).last().unwrap_or(count)
}

/// The size of the smallest sample whose greatest value is at or above the quantile of order `part` of all bodies with a probability of 95
/// % (S. S. Wilks 1941); infinite for the greatest of all.
pub(crate) fn least_sample(part: f64) -> usize {
    if part < 1.0 { (RISK.ln() / part.ln()).ceil() as usize } else { usize::MAX }
}

/// Whether it is plausible that at least `part` of all bodies are at or below a value that `beyond` bodies of a sample of `count`
/// exceed; not if the chance of that many is below 5 %.
pub(crate) fn is_plausible(beyond: usize, count: usize, part: f64) -> bool {
    beyond == 0 || at_least(beyond, count, 1.0 - part) >= RISK
}

/// How many numbers of equal weights say as much as numbers of these weights (L. Kish, *Survey Sampling* (1965), section 11.7).
pub(crate) fn effective_count(weights: &[f64]) -> f64 {
    weights.iter().sum::<f64>().powi(2) / weights.iter().map(|weight| weight * weight).sum::<f64>()
}

/// As [`is_plausible`], for a share of a weighted sample that says as much as `effective` bodies drawn evenly.
pub(crate) fn is_plausible_share(share: f64, effective: f64, part: f64) -> bool {
    // A whole number of bodies, with allowance for rounding; not zero if there are some.
    let beyond = ((share * effective + 1e-6).floor() as usize).max(usize::from(share > 0.0));
    is_plausible(beyond, (effective.round() as usize).max(beyond), part)
}

/// The number of bodies in a sample from which a percentile up to the 99th is judged.
const USUAL: f64 = 64.0;

/// The fewest bodies of a sample that say anything of the quantile of order `part`: beyond the 99th percentile, in proportion to the share of
/// bodies that it leaves out; infinitely many for the greatest of all.
pub(crate) fn least_judged(part: f64) -> f64 {
    // With allowance for rounding: 0.01 times 99.9 is just above 0.999.
    if part <= 0.99 { 0.0 } else { USUAL * 0.01 / (1.0 - part) * (1.0 - 1e-9) }
}

/// A sample in which fewer bodies than this are expected beyond a percentile does not show that it is kept: 20 bodies for the 99th.
const FEWEST_BEYOND: f64 = 0.2;

/// Whether at least `part` of all bodies are at or below a value that this share of a weighted sample exceeds, which says as much as
/// `effective` bodies drawn evenly. `None` if the share is greater than that allows, but may be so by chance, and if the sample is too small
/// ([`least_judged`], [`FEWEST_BEYOND`]).
pub(crate) fn verdict(share: f64, effective: f64, part: f64) -> Option<bool> {
    // With allowance for rounding.
    if share <= (1.0 - part) * (1.0 + 1e-9) {
        let fewest = FEWEST_BEYOND / (1.0 - part) * (1.0 - 1e-9);
        return (effective >= least_judged(part).max(fewest)).then_some(true);
    }
    if is_plausible_share(share, effective, part) { None } else { Some(false) }
}

/// How many of `all` bodies a percentile, given as a part, leaves out.
pub(crate) fn left_out(part: f64, all: usize) -> usize {
    // 1 - 0.99 is just above 0.01, and 0.99 times 100 may be just above 99.
    ((1.0 - part) * all as f64 * (1.0 + 1e-12)).floor() as usize
}

/// The probability that at least `least` of `count` draws succeed, each with probability `part`.
fn at_least(least: usize, count: usize, part: f64) -> f64 {
    if part <= 0.0 {
        return if least == 0 { 1.0 } else { 0.0 };
    }
    if part >= 1.0 {
        return 1.0;
    }
    // Logarithms, as the first terms of large samples underflow.
    let (success, failure) = (part.ln(), (-part).ln_1p());
    let mut choices = 0.0_f64;
    let mut sum = 0.0;
    for successes in 0..=count {
        if successes >= least {
            sum += (choices + successes as f64 * success + (count - successes) as f64 * failure).exp();
        }
        choices += ((count - successes) as f64).ln() - (successes as f64 + 1.0).ln();
    }
    sum.min(1.0)
}

/// `count` bodies of `body_count`, ascending: the range of bodies is cut into equal parts and one is drawn from each.
pub(crate) fn sample(body_count: usize, count: usize, seed: u64) -> Vec<u32> {
    let start = |part: usize| (part as u128 * body_count as u128 / count as u128) as usize;
    (0..count)
        .map(|part| {
            let width = start(part + 1) - start(part);
            (start(part) + (mixed(seed ^ part as u64) % width as u64) as usize) as u32
        })
        .collect()
}

/// A number whose bits depend on all of `x` (G. L. Steele, D. Lea, C. H. Flood, *Fast splittable pseudorandom number
/// generators*, OOPSLA 2014, figure 16: the finaliser of SplitMix64).
pub(crate) fn mixed(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_those_of_the_tables() {
        // 299 is the size of the smallest sample whose greatest value bounds the 99th percentile (Wilks 1941).
        assert_eq!(upper_rank(64, 0.99), 64);
        assert!(0.99_f64.powi(299) <= RISK && 0.99_f64.powi(298) > RISK);
        assert_eq!(upper_rank(299, 0.99), 299);
        assert_eq!([0.99, 0.95, 0.5].map(least_sample), [299, 59, 5]);
        assert!(least_sample(1e-9) == 1 && least_sample(1.0) == usize::MAX);
        // The median from a sample of 10: P(X ≥ 9) = 11/1024, P(X ≥ 8) = 56/1024 > 0.05.
        assert_eq!(upper_rank(10, 0.5), 9);
        assert_eq!(upper_rank(10, 1.0), 10);
    }

    #[test]
    fn two_of_64_may_be_beyond_the_99th_percentile_and_three_may_not() {
        let known: f64 = 1.0 - 0.99_f64.powi(64);
        assert!((at_least(1, 64, 0.01) - known).abs() < 1e-12);
        assert!(is_plausible(2, 64, 0.99) && !is_plausible(3, 64, 0.99));
        assert!(is_plausible(0, 64, 1.0) && !is_plausible(1, 64, 1.0));
    }

    #[test]
    fn a_sample_that_is_too_small_for_a_percentile_does_not_show_it() {
        assert_eq!([64.0, 20.0, 19.0].map(|bodies| verdict(0.0, bodies, 0.99)), [Some(true), Some(true), None]);
        assert_eq!(verdict(0.0, 1.0, 0.5), Some(true));
        assert_eq!([64.0, 639.0, 640.0].map(|bodies| verdict(0.0, bodies, 0.999)), [None, None, Some(true)]);
        assert_eq!(verdict(0.0, 1e9, 1.0), None);
        assert_eq!(verdict(3.0 / 64.0, 64.0, 0.999), Some(false));
    }
}
