//! Statistics, quantiles and histograms of values as they come.

use rayon::prelude::*;

use super::evaluator::Values;
use crate::math::Sketch;
use crate::record::{HistogramCounts, Statistics, Summary};
use crate::scene::{Histogram, Observed, Quantity};

/// Mean, deviation and extremes of some numbers.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    count: u64,
    mean: f64,
    /// The sum of squared deviations from the mean.
    squares: f64,
    /// The extremes, and whose they are.
    least: (f64, usize),
    greatest: (f64, usize),
}

impl Moments {
    /// In two passes; what is not finite is left out.
    fn of(first_body: usize, values: &[f64]) -> Self {
        let is_finite = |value: &f64| f64::from(u8::from(value.is_finite()));
        let finite = |value: &f64| if value.is_finite() { *value } else { 0.0 };
        let count = sum_in_lanes(values, is_finite);
        if count == 0.0 {
            return Self::default();
        }
        let mean = sum_in_lanes(values, finite) / count;
        let squares = sum_in_lanes(values, |value| {
            let deviation = if value.is_finite() { value - mean } else { 0.0 };
            deviation * deviation
        });
        let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
        for &value in values {
            let low = if value.is_finite() { value } else { f64::INFINITY };
            let high = if value.is_finite() { value } else { f64::NEG_INFINITY };
            least = if low < least { low } else { least };
            greatest = if high > greatest { high } else { greatest };
        }
        let body = |extreme: f64| first_body + values.iter().position(|&value| value == extreme).unwrap_or(0);
        Self { count: count as u64, mean, squares, least: (least, body(least)), greatest: (greatest, body(greatest)) }
    }

    /// Of both (Chan, Golub and LeVeque 1983, equation 2.1); of equal extremes the first stays.
    fn merged(self, other: Self) -> Self {
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
}

/// A sum in eight parts, which processors form side by side, in an order that does not depend on them.
fn sum_in_lanes(values: &[f64], term: impl Fn(&f64) -> f64) -> f64 {
    let mut parts = [0.0; 8];
    let groups = values.chunks_exact(parts.len());
    let rest: f64 = groups.remainder().iter().map(&term).sum();
    for group in groups {
        for (part, value) in parts.iter_mut().zip(group) {
            *part += term(value);
        }
    }
    parts.iter().sum::<f64>() + rest
}

/// What is gathered at an output time.
pub(super) struct Distributions<'p> {
    observed: &'p Observed,
    /// The numbers among all quantities of those that have statistics, and of those of the histograms.
    statistics: Vec<usize>,
    histograms: Vec<usize>,
    gathered: Vec<Gathered>,
    counts: Vec<Vec<u64>>,
    bodies: usize,
}

/// What is gathered of a quantity.
#[derive(Clone, Default)]
struct Gathered {
    moments: Moments,
    sketch: Sketch,
}

impl<'p> Distributions<'p> {
    /// Of quantities whose numbers `number` says.
    pub fn new(observed: &'p Observed, number: impl Fn(&Quantity) -> usize) -> Self {
        let statistics = observed.statistics.iter().map(&number).collect();
        let histograms = observed.histograms.iter().map(|histogram| number(histogram.quantity())).collect();
        let mut new = Self { observed, statistics, histograms, gathered: Vec::new(), counts: Vec::new(), bodies: 0 };
        new.clear();
        new
    }

    fn clear(&mut self) {
        self.gathered = vec![Gathered::default(); self.statistics.len()];
        self.counts = self.observed.histograms.iter().map(|histogram| vec![0; histogram.bins() + 2]).collect();
        self.bodies = 0;
    }

    /// Takes the values of the bodies from `first_body` on, of which so many have not failed.
    pub fn push(&mut self, first_body: usize, values: &Values, sound: usize) {
        let has_quantiles = !self.observed.quantiles.is_empty();
        self.bodies += sound;
        self.gathered.par_iter_mut().zip(&self.statistics).for_each(|(gathered, &quantity)| {
            for (row, values) in values.of(quantity) {
                gathered.moments = gathered.moments.merged(Moments::of(first_body + row, values));
                if has_quantiles {
                    gathered.sketch.extend(values.iter().copied());
                }
            }
        });
        let histograms = self.observed.histograms.par_iter().zip(&self.histograms);
        self.counts.par_iter_mut().zip(histograms).for_each(|(counts, (histogram, &quantity))| {
            for (_, values) in values.of(quantity) {
                count(histogram, values, counts);
            }
        });
    }

    /// What was gathered at `time`, s; the next output begins.
    pub fn finish(&mut self, time: f64) -> (Statistics, Vec<HistogramCounts>) {
        let summary = |(quantity, gathered): (&Quantity, &Gathered)| {
            let Moments { count, mean, squares, least, greatest } = gathered.moments;
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
                quantiles: self.observed.quantiles.iter().map(quantile).collect(),
            }
        };
        let summaries = self.observed.statistics.iter().zip(&self.gathered).map(summary).collect();
        let statistics = Statistics { time, count: self.bodies, summaries };
        let histograms = std::mem::take(&mut self.counts).into_iter().map(|counts| HistogramCounts { time, counts });
        let histograms = histograms.collect();
        self.clear();
        (statistics, histograms)
    }
}

fn count(histogram: &Histogram, values: &[f64], counts: &mut [u64]) {
    for &value in values.iter().filter(|value| value.is_finite()) {
        counts[histogram.place(value)] += 1;
    }
}
