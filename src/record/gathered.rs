//! Statistics of quantities gathered at an output time, block by block of bodies, so that parts of an ensemble can be joined.

#[cfg(feature = "study")]
use serde::{Deserialize, Serialize};

use super::{HistogramCounts, Statistics, Summary};
use crate::math::Sketch;
use crate::math::lanes::{LaneScalar, LaneTask};
use crate::math::real::Real;
use crate::scene::{Observed, Quantity};

/// Mean, deviation and extremes of some numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "study", derive(Serialize, Deserialize))]
pub(crate) struct Moments {
    count: u64,
    mean: f64,
    /// The sum of squared deviations from the mean.
    squares: f64,
    /// The extremes, with their bodies.
    least: (f64, usize),
    greatest: (f64, usize),
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
    fn counted_from(mut self, first_body: usize) -> Self {
        if self.count > 0 {
            self.least.1 += first_body;
            self.greatest.1 += first_body;
        }
        self
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

/// What is gathered for a quantity that has statistics.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "study", derive(Serialize, Deserialize))]
pub(crate) struct GatheredQuantity {
    /// By block of bodies.
    pub moments: Vec<Moments>,
    /// Empty if no quantiles are asked for.
    pub sketch: Sketch,
}

/// What is gathered from some blocks of bodies at an output time. Statistics, quantiles and histograms of all bodies are computed from it;
/// the result is the same to the bit for any number of parts.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "study", derive(Serialize, Deserialize))]
pub struct Gathered {
    /// Bodies that have not failed.
    pub(crate) bodies: usize,
    /// In the order in which statistics are asked for.
    pub(crate) quantities: Vec<GatheredQuantity>,
    /// The counts of each histogram.
    pub(crate) histograms: Vec<Vec<u64>>,
}

impl Gathered {
    /// An empty value for this many blocks.
    pub(crate) fn new(observed: &Observed, blocks: usize) -> Self {
        let quantity = GatheredQuantity { moments: vec![Moments::default(); blocks], sketch: Sketch::default() };
        Self {
            bodies: 0,
            quantities: vec![quantity; observed.statistics.len()],
            histograms: observed.histograms.iter().map(|histogram| vec![0; histogram.bins() + 2]).collect(),
        }
    }

    /// Whether it can be a result for what is asked for.
    #[cfg(feature = "study")]
    pub(crate) fn fits(&self, observed: &Observed) -> bool {
        let Observed { statistics, histograms, .. } = observed;
        self.quantities.len() == statistics.len()
            && self.histograms.len() == histograms.len()
            && self.histograms.iter().zip(histograms).all(|(counts, histogram)| counts.len() == histogram.bins() + 2)
    }

    /// Whether it can be a result for this many bodies: nothing is counted more often, and extremes belong to them.
    #[cfg(feature = "study")]
    pub(crate) fn is_of(&self, bodies: usize) -> bool {
        let within = |counts: &[u64]| {
            counts.iter().try_fold(0_u64, |sum, count| sum.checked_add(*count)).is_some_and(|sum| sum <= bodies as u64)
        };
        let is_own = |moments: &Moments| {
            let [least, greatest] = [moments.least, moments.greatest];
            moments.count == 0
                || (least.0 <= greatest.0 && moments.squares >= 0.0 && least.1 < bodies && greatest.1 < bodies)
        };
        self.bodies <= bodies
            && self.quantities.iter().all(|quantity| {
                let GatheredQuantity { moments, sketch } = quantity;
                moments.iter().all(is_own)
                    && within(&moments.iter().map(|moments| moments.count).collect::<Vec<_>>())
                    && sketch.count() <= bodies as u64
            })
            && self.histograms.iter().all(|counts| within(counts))
    }

    /// Appends what was gathered from the blocks that follow, whose bodies are counted from `first_body`.
    #[cfg(feature = "study")]
    pub(crate) fn append(&mut self, other: Self, first_body: usize) {
        self.bodies += other.bodies;
        for (own, found) in self.quantities.iter_mut().zip(other.quantities) {
            own.moments.extend(found.moments.into_iter().map(|moments| moments.counted_from(first_body)));
            own.sketch.merge(&found.sketch);
        }
        for (own, found) in self.histograms.iter_mut().zip(other.histograms) {
            own.iter_mut().zip(found).for_each(|(own, count)| *own += count);
        }
    }

    /// The statistics and histograms of all of it at `time`, s.
    pub(crate) fn summed(&self, observed: &Observed, time: f64) -> (Statistics, Vec<HistogramCounts>) {
        let summary = |(quantity, gathered): (&Quantity, &GatheredQuantity)| {
            let all = gathered.moments.iter().copied().fold(Moments::default(), Moments::merged);
            let Moments { count, mean, squares, least, greatest } = all;
            let any = count > 0;
            let or_nan = |value: f64| if any { value } else { f64::NAN };
            let quantile = |&percent: &f64| gathered.sketch.quantile(percent).clamp(least.0, greatest.0);
            Summary {
                quantity: quantity.clone(),
                mean: or_nan(mean),
                standard_deviation: or_nan((squares / count as f64).sqrt()),
                min: or_nan(least.0),
                max: or_nan(greatest.0),
                min_body: any.then_some(least.1),
                max_body: any.then_some(greatest.1),
                quantiles: observed.quantiles.iter().map(quantile).collect(),
            }
        };
        let summaries = observed.statistics.iter().zip(&self.quantities).map(summary).collect();
        let histograms = self.histograms.iter().map(|counts| HistogramCounts { time, counts: counts.clone() });
        (Statistics { time, count: self.bodies, summaries }, histograms.collect())
    }
}
