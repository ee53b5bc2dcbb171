//! Mean, deviation and extremes of many numbers, of parts that are put together.

#[cfg(feature = "study")]
use std::ops::Range;

#[cfg(feature = "study")]
use serde::{Deserialize, Serialize};

use crate::math::lanes::{LaneScalar, LaneTask};
use crate::math::real::Real;

/// Mean, deviation and extremes of some numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "study", derive(Serialize, Deserialize))]
pub(crate) struct Moments {
    /// Number of finite values.
    pub count: u64,
    /// Their mean.
    pub mean: f64,
    /// The sum of squared deviations from the mean.
    pub squares: f64,
    /// The least value, with its body.
    pub least: (f64, usize),
    /// The greatest value, with its body.
    pub greatest: (f64, usize),
}

impl Moments {
    /// Adds the values of the bodies from `first_body` on; values that are not finite are left out.
    pub fn add(&mut self, first_body: usize, values: &[f64]) {
        let mut found = f64::dispatch(OfValues(values));
        if found.count == 0 {
            return;
        }
        // The body is searched only for a new extreme, as most blocks have none.
        let body = |extreme: f64| first_body + values.iter().position(|&value| value == extreme).unwrap_or(0);
        if self.count == 0 || found.least.0 < self.least.0 {
            found.least.1 = body(found.least.0);
        }
        if self.count == 0 || found.greatest.0 > self.greatest.0 {
            found.greatest.1 = body(found.greatest.0);
        }
        *self = self.merged(found);
    }

    /// The moments of both (Chan, Golub and LeVeque 1983, equation 2.1); of equal extremes the first is kept.
    pub fn merged(self, other: Self) -> Self {
        if self.count == 0 || other.count == 0 {
            return if self.count == 0 { other } else { self };
        }
        let count = self.count + other.count;
        let share = other.count as f64 / count as f64;
        let difference = other.mean - self.mean;
        Self {
            count,
            mean: self.mean + difference * share,
            squares: self.squares + other.squares + difference * difference * (self.count as f64 * share),
            least: if other.least.0 < self.least.0 { other.least } else { self.least },
            greatest: if other.greatest.0 > self.greatest.0 { other.greatest } else { self.greatest },
        }
    }

    /// The same with bodies counted as in the whole that they are a part of.
    #[cfg(feature = "study")]
    pub fn counted_from(self, first_body: usize) -> Self {
        self.renumbered(|body| body + first_body)
    }

    /// The same with other numbers of the bodies.
    pub fn renumbered(mut self, number: impl Fn(usize) -> usize) -> Self {
        if self.count > 0 {
            self.least.1 = number(self.least.1);
            self.greatest.1 = number(self.greatest.1);
        }
        self
    }
}

/// The moments of consecutive blocks, put together in pairs, pairs of pairs and so on, by the blocks' places in the whole. So the moments of
/// the whole are the same to the bit for any parts, and there are no more than two for each power of two.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "study", derive(Serialize, Deserialize))]
pub(crate) struct MomentsTree {
    /// The block after the last one.
    next: u64,
    /// The binary logarithm of the number of blocks, and their moments: in the order of the blocks.
    nodes: Vec<(u32, Moments)>,
}

impl MomentsTree {
    /// An empty one, before a block of the whole.
    pub fn before(block: usize) -> Self {
        Self { next: block as u64, nodes: Vec::new() }
    }

    /// Appends the next block.
    pub fn push(&mut self, moments: Moments) {
        self.push_node(0, moments);
    }

    /// Appends so many blocks without numbers.
    pub fn skip(&mut self, mut blocks: u64) {
        while blocks > 0 {
            let level = blocks.ilog2().min(self.next.trailing_zeros());
            self.push_node(level, Moments::default());
            blocks -= 1 << level;
        }
    }

    /// Appends the next 2^`level` blocks.
    fn push_node(&mut self, mut level: u32, mut moments: Moments) {
        let mut first = self.next;
        self.next += 1 << level;
        // The second of a pair.
        while first >> level & 1 == 1
            && let Some((_, before)) = self.nodes.pop_if(|(before, _)| *before == level)
        {
            moments = before.merged(moments);
            first -= 1 << level;
            level += 1;
        }
        self.nodes.push((level, moments));
    }

    /// Appends those of the blocks that follow, whose bodies are counted from `first_body`.
    #[cfg(feature = "study")]
    pub fn append(&mut self, other: Self, first_body: usize) {
        for (level, moments) in other.nodes {
            self.push_node(level, moments.counted_from(first_body));
        }
    }

    /// Whether it can be that of these blocks of the whole.
    #[cfg(feature = "study")]
    pub fn is_of(&self, blocks: &Range<usize>) -> bool {
        let (mut next, end) = (blocks.start as u64, blocks.end as u64);
        let are_consecutive = self.nodes.iter().all(|&(level, _)| {
            let after =
                1_u64.checked_shl(level).and_then(|count| next.checked_add(count)).filter(|after| *after <= end);
            let is_aligned = next.trailing_zeros() >= level;
            next = after.unwrap_or(end);
            is_aligned && after.is_some()
        });
        are_consecutive && next == end && self.next == end
    }

    /// The moments of consecutive blocks, which together are all.
    #[cfg(feature = "study")]
    pub fn parts(&self) -> impl Iterator<Item = &Moments> {
        self.nodes.iter().map(|(_, moments)| moments)
    }

    /// The moments of all blocks.
    pub fn all(&self) -> Moments {
        self.nodes.iter().rev().fold(Moments::default(), |after, (_, moments)| moments.merged(after))
    }
}

/// Number of partial sums. It does not depend on the lanes of the processor, so that the roundings do not either.
const PARTS: usize = 8;

/// Computes the moments of some values in two passes, without the bodies of the extremes; values that are not finite are left out.
struct OfValues<'a>(&'a [f64]);

impl LaneTask<f64> for OfValues<'_> {
    type Output = Moments;
    #[inline(always)]
    fn run<R: Real<Scalar = f64>>(self) -> Moments {
        let groups = self.0.chunks_exact(PARTS);
        let mut last = [f64::NAN; PARTS];
        last[..groups.remainder().len()].copy_from_slice(groups.remainder());
        let groups = || groups.clone().chain(std::iter::once(&last[..]));
        let (zero, infinity) = (R::splat(0.0), R::splat(f64::INFINITY));
        // Lane groups that hold the partial sums; the rest of each array is not used.
        let (mut counts, mut sums, mut squares) = ([zero; PARTS], [zero; PARTS], [zero; PARTS]);
        let (mut least, mut greatest) = ([infinity; PARTS], [-infinity; PARTS]);
        for values in groups() {
            for k in 0..PARTS / R::LANES {
                let value = R::load(&values[k * R::LANES..]);
                let is_finite = value.abs().less_than(infinity);
                counts[k] = counts[k] + R::select(is_finite, R::splat(1.0), zero);
                sums[k] = sums[k] + R::select(is_finite, value, zero);
                least[k] = R::select(is_finite & value.less_than(least[k]), value, least[k]);
                greatest[k] = R::select(is_finite & greatest[k].less_than(value), value, greatest[k]);
            }
        }
        let count: f64 = parts(&counts).iter().sum();
        if count == 0.0 {
            return Moments::default();
        }
        let mean = parts(&sums).iter().sum::<f64>() / count;
        for values in groups() {
            for k in 0..PARTS / R::LANES {
                let value = R::load(&values[k * R::LANES..]);
                let deviation = R::select(value.abs().less_than(infinity), value - R::splat(mean), zero);
                squares[k] = squares[k] + deviation * deviation;
            }
        }
        // Zeros of both signs count as one.
        let least = parts(&least).into_iter().fold(f64::INFINITY, f64::min) + 0.0;
        let greatest = parts(&greatest).into_iter().fold(f64::NEG_INFINITY, f64::max) + 0.0;
        let squares = parts(&squares).iter().sum();
        Moments { count: count as u64, mean, squares, least: (least, 0), greatest: (greatest, 0) }
    }
}

/// The partial results that the lane groups hold.
#[inline(always)]
fn parts<R: Real<Scalar = f64>>(groups: &[R; PARTS]) -> [f64; PARTS] {
    let mut numbers = [0.0; PARTS];
    for (group, numbers) in groups.iter().zip(numbers.chunks_exact_mut(R::LANES)) {
        group.store(numbers);
    }
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of both signs, some of which are none.
    fn numbers(count: usize) -> Vec<f64> {
        let number = |k: usize| match k % 13 {
            5 => f64::NAN,
            9 => f64::INFINITY,
            _ => ((k * 37) as f64).sin() + 1e3,
        };
        (0..count).map(number).collect()
    }

    #[test]
    fn moments_are_those_of_the_definition() {
        for count in [0, 1, 7, 8, 9, 64, 1003] {
            let all = numbers(count);
            let finite: Vec<f64> = all.iter().copied().filter(|x| x.is_finite()).collect();
            let mut found = Moments::default();
            found.add(100, &all);
            assert_eq!(found.count, finite.len() as u64, "{count}");
            if finite.is_empty() {
                continue;
            }
            let mean = finite.iter().map(|x| x - 1e3).sum::<f64>() / finite.len() as f64 + 1e3;
            let squares: f64 = finite.iter().map(|x| (x - mean).powi(2)).sum();
            assert!((found.mean - mean).abs() <= 1e-12 * mean, "{count}: {} and {mean}", found.mean);
            assert!(
                (found.squares - squares).abs() <= 1e-9 * (1.0 + squares),
                "{count}: {} and {squares}",
                found.squares
            );
            let least = finite.iter().copied().fold(f64::INFINITY, f64::min);
            let greatest = finite.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let body = |extreme| 100 + all.iter().position(|&x| x == extreme).expect("one of them");
            assert_eq!(found.least, (least, body(least)), "{count}");
            assert_eq!(found.greatest, (greatest, body(greatest)), "{count}");
        }
    }

    #[test]
    fn blocks_are_put_together_alike_in_any_parts() {
        let blocks: Vec<Moments> = numbers(4000)
            .chunks(37)
            .enumerate()
            .map(|(block, values)| {
                let mut moments = Moments::default();
                moments.add(37 * block, values);
                moments
            })
            .collect();
        let mut whole = MomentsTree::default();
        blocks.iter().for_each(|moments| whole.push(*moments));
        assert_eq!(blocks.len(), 109);
        assert_eq!(whole.nodes.iter().map(|(level, _)| 1 << level).collect::<Vec<_>>(), [64, 32, 8, 4, 1]);
        let mut found = Moments::default();
        found.add(0, &numbers(4000));
        assert_eq!(
            (whole.all().count, whole.all().least, whole.all().greatest),
            (found.count, found.least, found.greatest)
        );
        assert!((whole.all().mean - found.mean).abs() <= 1e-12 * found.mean);
        for ends in [vec![1], vec![64], vec![3, 50, 51, 108], (1..109).collect()] {
            let mut merged = MomentsTree::default();
            let starts = [0].into_iter().chain(ends.iter().copied());
            for (start, end) in starts.zip(ends.iter().copied().chain([109])) {
                let mut part = MomentsTree::before(start);
                let own = |moments: &Moments| moments.renumbered(|body| body - 37 * start);
                blocks[start..end].iter().for_each(|moments| part.push(own(moments)));
                assert!(part.nodes.len() <= 14, "{} nodes of {start}..{end}", part.nodes.len());
                assert!(part.is_of(&(start..end)) && !part.is_of(&(start..end + 1)) && !part.is_of(&(start + 1..end)));
                merged.append(part, 37 * start);
            }
            assert_eq!(merged, whole, "{ends:?}");
            for level in [1, 5, 7, 63, 64, u32::MAX] {
                let mut spoilt = whole.clone();
                spoilt.nodes[0].0 = level;
                assert!(!spoilt.is_of(&(0..109)), "{level}");
            }
        }
    }

    #[test]
    fn blocks_without_numbers_are_skipped_at_once() {
        let mut some = Moments::default();
        some.add(0, &[1.0, 2.0]);
        for first in [0, 3] {
            for count in [0, 1, 2, 5, 64, 100] {
                let [mut one_by_one, mut at_once] = [(); 2].map(|()| MomentsTree::before(first));
                for tree in [&mut one_by_one, &mut at_once] {
                    tree.push(some);
                }
                (0..count).for_each(|_| one_by_one.push(Moments::default()));
                at_once.skip(count);
                assert_eq!(one_by_one, at_once, "{count} after {first}");
                assert_eq!(at_once.all(), some);
            }
        }
    }

    #[test]
    fn parts_are_put_together() {
        let all = numbers(1003);
        let (mut whole, mut parts) = (Moments::default(), Moments::default());
        whole.add(0, &all);
        for (part, values) in all.chunks(100).enumerate() {
            parts.add(100 * part, values);
        }
        assert_eq!((whole.count, whole.least, whole.greatest), (parts.count, parts.least, parts.greatest));
        assert!((whole.mean - parts.mean).abs() <= 1e-12 * whole.mean);
        assert!((whole.squares - parts.squares).abs() <= 1e-9 * whole.squares);
    }
}
