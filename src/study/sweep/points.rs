//! Points of designs in the unit cube, each a function of seed, axis and index.

use crate::study::draw::{Column, Draw, open_unit};

/// The most axes of a design with Sobol's sequence.
pub(crate) const MOST_SOBOL_AXES: usize = POLYNOMIALS.len() + 1;

/// Primitive polynomials and first direction numbers, of axes 2, 3, ...: degree, coefficients, odd numbers m (S. Joe, F. Y. Kuo, file
/// `new-joe-kuo-6`).
const POLYNOMIALS: [(u32, u32, &[u32]); 20] = [
    (1, 0, &[1]),
    (2, 1, &[1, 3]),
    (3, 1, &[1, 3, 1]),
    (3, 2, &[1, 1, 1]),
    (4, 1, &[1, 1, 3, 3]),
    (4, 4, &[1, 3, 5, 13]),
    (5, 2, &[1, 1, 5, 5, 17]),
    (5, 4, &[1, 1, 5, 5, 5]),
    (5, 7, &[1, 1, 7, 11, 19]),
    (5, 11, &[1, 1, 5, 1, 1]),
    (5, 13, &[1, 1, 1, 3, 11]),
    (5, 14, &[1, 3, 5, 5, 31]),
    (6, 1, &[1, 3, 3, 9, 7, 49]),
    (6, 13, &[1, 1, 1, 15, 21, 21]),
    (6, 16, &[1, 3, 1, 13, 27, 49]),
    (6, 19, &[1, 1, 1, 15, 7, 5]),
    (6, 22, &[1, 3, 1, 15, 13, 25]),
    (6, 25, &[1, 1, 5, 5, 19, 61]),
    (7, 1, &[1, 3, 7, 11, 23, 15, 103]),
    (7, 4, &[1, 3, 7, 13, 13, 15, 69]),
];

/// Binary digits of a point.
const DIGITS: u32 = 32;

/// The blocks of an axis's column. They enter the counter, so they must never change.
const WITHIN: u32 = 0;
const ROUNDS: u32 = 0x100;
const FLIPS: u32 = 0x200;

/// Rounds of the permutation.
const FEISTEL_ROUNDS: u32 = 8;

/// The point of index `cell` on an axis, in (0, 1).
pub(super) fn latin_hypercube(draw: Draw, axis: u16, cell: usize, cells: usize) -> f64 {
    let stratum = permuted(draw, axis, cell, cells);
    (stratum as f64 + draw.uniform(cell, Column::Design { axis }, WITHIN)) / cells as f64
}

/// A permutation of 0 .. `size`, keyed by seed and axis: a Feistel network over the least even number of binary digits, walked
/// until it comes back below `size` (J. Black, P. Rogaway, *Ciphers with arbitrary finite domains*, 2002, section 3).
fn permuted(draw: Draw, axis: u16, index: usize, size: usize) -> usize {
    let half = usize::BITS.saturating_sub((size - 1).leading_zeros()).div_ceil(2).max(1);
    let mask = (1_usize << half) - 1;
    let mut index = index;
    loop {
        let (mut left, mut right) = (index >> half, index & mask);
        for round in 0..FEISTEL_ROUNDS {
            let [bits, ..] = draw.bits(right, Column::Design { axis }, ROUNDS + round);
            (left, right) = (right, left ^ (bits as usize & mask));
        }
        index = left << half | right;
        if index < size {
            return index;
        }
    }
}

/// The point of index `cell` on an axis, in (0, 1): Owen's scrambling of the 32 digits, followed by random digits.
pub(super) fn sobol(draw: Draw, axis: u16, cell: usize) -> f64 {
    let plain = sobol_digits(axis.into(), cell as u32);
    let column = Column::Design { axis };
    let mut scrambled = 0;
    for digit in 0..DIGITS {
        // The digits before this one, after a leading 1, so that those of different lengths differ.
        let before = (1_u64 << digit) | u64::from(plain) >> (DIGITS - digit);
        let [bits, ..] = draw.bits(before as usize, column, FLIPS);
        let own = plain >> (DIGITS - 1 - digit) & 1;
        scrambled = scrambled << 1 | (own ^ (bits & 1));
    }
    let [low, ..] = draw.bits(cell, column, WITHIN);
    open_unit(scrambled, low)
}

/// Binary digits of point `index` of the sequence on an axis, the first the highest.
fn sobol_digits(axis: usize, index: u32) -> u32 {
    let directions = directions(axis);
    (0..DIGITS).filter(|bit| index >> bit & 1 == 1).fold(0, |sum, bit| sum ^ directions[bit as usize])
}

/// The direction numbers of an axis (S. Joe, F. Y. Kuo, ACM Trans. Math. Softw. 29 (2003) 49, equation 2).
fn directions(axis: usize) -> [u32; DIGITS as usize] {
    let mut v = [0; DIGITS as usize];
    let Some(&(degree, coefficients, first)) = axis.checked_sub(1).map(|axis| &POLYNOMIALS[axis]) else {
        for (bit, v) in v.iter_mut().enumerate() {
            *v = 1 << (DIGITS as usize - 1 - bit);
        }
        return v;
    };
    let s = degree as usize;
    for i in 0..v.len() {
        v[i] = match first.get(i) {
            Some(m) => m << (DIGITS as usize - 1 - i),
            None => {
                let own = v[i - s] ^ (v[i - s] >> s);
                (1..s).filter(|k| coefficients >> (s - 1 - k) & 1 == 1).fold(own, |sum, k| sum ^ v[i - k])
            }
        };
    }
    v
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn the_plain_sequence_is_that_of_joe_and_kuo() {
        // The first eight digits on axes 1, 2, 3, 8, 14 and 21. All 21 axes of 256 points were compared with those of SciPy 1.17
        // (`scipy.stats.qmc.Sobol(21, scramble=False)`, which takes points in the order of the Gray code).
        for (index, digits) in [
            (0, [0; 6]),
            (1, [128; 6]),
            (2, [64, 192, 192, 64, 192, 192]),
            (3, [192, 64, 64, 192, 64, 64]),
            (7, [224, 224, 32, 96, 32, 160]),
            (100, [38, 198, 178, 150, 230, 86]),
        ] {
            assert_eq!([0, 1, 2, 7, 13, 20].map(|axis| sobol_digits(axis, index) >> 24), digits, "point {index}");
        }
    }

    #[test]
    fn latin_hypercubes_have_one_value_in_each_stratum() {
        for size in [1, 2, 3, 5, 17, 64, 1000] {
            for axis in [0, 1, 19] {
                let draw = Draw::new(42);
                let strata: BTreeSet<usize> =
                    (0..size).map(|cell| (latin_hypercube(draw, axis, cell, size) * size as f64) as usize).collect();
                assert_eq!(strata.len(), size, "{size} cells, axis {axis}");
            }
        }
    }

    #[test]
    fn permutations_of_axes_and_seeds_differ_and_have_no_trend() {
        let size = 1000;
        let orders: Vec<Vec<f64>> = [(1, 0), (1, 1), (2, 0)]
            .iter()
            .map(|&(seed, axis)| (0..size).map(|cell| permuted(Draw::new(seed), axis, cell, size) as f64).collect())
            .collect();
        let straight: Vec<f64> = (0..size).map(|cell| cell as f64).collect();
        // Spearman's coefficient has the standard deviation 1/√(n − 1); five of them.
        let bound = 5.0 / ((size - 1) as f64).sqrt();
        for (place, order) in orders.iter().enumerate() {
            for other in orders.iter().skip(place + 1).chain([&straight]) {
                let mean = (size - 1) as f64 / 2.0;
                let sum: f64 = order.iter().zip(other).map(|(a, b)| (a - mean) * (b - mean)).sum();
                let coefficient = sum / ((size * (size * size - 1)) as f64 / 12.0);
                assert!(coefficient.abs() < bound, "{place}: {coefficient}");
            }
        }
    }

    #[test]
    fn scrambled_points_keep_the_net_of_the_sequence() {
        // 2^m points have one in each elementary interval of size 2^-m, on one axis, and on the first two (a (0, m, 2)-net).
        let (m, draw) = (8_u32, Draw::new(3));
        let points = |axis| (0..1 << m).map(move |cell| sobol(draw, axis, cell)).collect::<Vec<f64>>();
        for axis in 0..MOST_SOBOL_AXES as u16 {
            let strata: BTreeSet<u32> = points(axis).iter().map(|x| (x * f64::from(1 << m)) as u32).collect();
            assert_eq!(strata.len(), 1 << m, "axis {axis}");
        }
        let (x, y) = (points(0), points(1));
        for split in 0..=m {
            let cells: BTreeSet<(u32, u32)> = x
                .iter()
                .zip(&y)
                .map(|(x, y)| ((x * f64::from(1 << split)) as u32, (y * f64::from(1 << (m - split))) as u32))
                .collect();
            assert_eq!(cells.len(), 1 << m, "2^{split} columns");
        }
    }

    #[test]
    fn scrambled_points_integrate_far_better_than_random_ones() {
        // ∏ (1 + (x − ½)) over five axes has the mean 1 and, for single points, the standard deviation √((13/12)^5 − 1) = 0.70.
        let count = 1024;
        let errors: Vec<f64> = (0..20)
            .map(|seed| {
                let draw = Draw::new(seed);
                let value = |cell| (0..5).map(|axis| 0.5 + sobol(draw, axis, cell)).product::<f64>();
                (0..count).map(value).sum::<f64>() / count as f64 - 1.0
            })
            .collect();
        let root_mean_square = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        // Random points give 0.022; scrambled nets fall with n^-1.5.
        assert!(root_mean_square < 0.0005, "{root_mean_square}");
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        assert!(mean.abs() < 5.0 * root_mean_square / (errors.len() as f64).sqrt(), "{mean}, of {root_mean_square}");
    }
}
