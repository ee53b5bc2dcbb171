//! Histograms: how many bodies have a quantity in each of several intervals.

use crate::error::{Error, Result};
use crate::scene::Quantity;

/// The most bins of a histogram.
pub const MOST_BINS: usize = 100_000;

/// A histogram of a quantity over all bodies, at every output time.
///
/// Bin k holds the values from edge k up to, but not including, edge k + 1; values below the first edge, and those at or above the last,
/// are counted apart.
///
/// ```
/// use polhode::scene::Histogram;
/// use polhode::Quantity;
///
/// let histogram = Histogram::linear(Quantity::SpinRate, 0.0, 2.0, 4)?;
/// assert_eq!(histogram.edges(), [0.0, 0.5, 1.0, 1.5, 2.0]);
/// # Ok::<(), polhode::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    quantity: Quantity,
    edges: Vec<f64>,
    is_logarithmic: bool,
    search: Search,
}

/// Where the search for the bin of a value begins; from there it goes along the edges.
#[derive(Clone, Debug, PartialEq)]
enum Search {
    /// Bins for each unit of a value.
    Linear { per_unit: f64 },
    /// Of positive numbers, whose bits without the last `shift`, less `first`, count the entries of a table of bins.
    Bits { shift: u32, first: u64, bins: Vec<u32> },
}

impl Search {
    /// Among bins of equal width.
    fn linear(edges: &[f64]) -> Self {
        let bins = edges.len() - 1;
        Self::Linear { per_unit: bins as f64 / (edges[bins] - edges[0]) }
    }

    /// Among bins of equal ratio, above zero.
    fn logarithmic(edges: &[f64]) -> Self {
        /// Entries of the table for each bin: few values lie beyond the bin of their entry.
        const ENTRIES: u64 = 8;
        let bins = edges.len() - 1;
        let [low, high] = [edges[0].to_bits(), edges[bins].to_bits()];
        let most = ENTRIES * bins as u64;
        let shift = (0..52).find(|&shift| (high >> shift) - (low >> shift) < most).unwrap_or(52);
        let first = low >> shift;
        // The bin of the least value that has an entry's bits.
        let bin = |key: u64| {
            let least = f64::from_bits(key << shift);
            edges.partition_point(|&edge| edge <= least).clamp(1, bins) as u32 - 1
        };
        Self::Bits { shift, first, bins: (first..=high >> shift).map(bin).collect() }
    }

    /// A bin at or near that of a value in [low, high).
    fn guess(&self, edges: &[f64], value: f64) -> usize {
        match self {
            Self::Linear { per_unit } => (((value - edges[0]) * per_unit) as usize).min(edges.len() - 2),
            Self::Bits { shift, first, bins } => bins[((value.to_bits() >> shift) - first) as usize] as usize,
        }
    }
}

impl Histogram {
    /// Bins of equal width from `low` to `high`.
    ///
    /// # Errors
    ///
    /// [`Error::Setting`] where the ends are not finite numbers in ascending order, or there is no bin or more than [`MOST_BINS`].
    pub fn linear(quantity: Quantity, low: f64, high: f64, bins: usize) -> Result<Self> {
        let part = |k: usize| k as f64 / bins as f64;
        // Exact at both ends; `low + (high - low) * part` would lose one of them.
        Self::new(quantity, (low, high, bins), false, |k| low * (1.0 - part(k)) + high * part(k))
    }

    /// Bins of equal ratio from `low`, above zero, to `high`.
    ///
    /// # Errors
    ///
    /// As [`Histogram::linear`].
    pub fn logarithmic(quantity: Quantity, low: f64, high: f64, bins: usize) -> Result<Self> {
        if low <= 0.0 {
            return Err(Error::Setting { field: "low", value: low, expected: "expected a number above zero" });
        }
        let (first, last) = (low.ln(), high.ln());
        Self::new(quantity, (low, high, bins), true, |k| {
            let part = k as f64 / bins as f64;
            (first * (1.0 - part) + last * part).exp()
        })
    }

    fn new(
        quantity: Quantity,
        (low, high, bins): (f64, f64, usize),
        is_logarithmic: bool,
        edge: impl Fn(usize) -> f64,
    ) -> Result<Self> {
        let refused = |field, value, expected| Err(Error::Setting { field, value, expected });
        if !low.is_finite() {
            return refused("low", low, "expected a finite number");
        }
        if !(high.is_finite() && high > low) {
            return refused("high", high, "expected a finite number above `low`");
        }
        if bins == 0 || bins > MOST_BINS {
            return refused("bins", bins as f64, "expected 1 to 100000 bins");
        }
        let mut edges: Vec<f64> = (0..=bins).map(edge).collect();
        (edges[0], edges[bins]) = (low, high);
        if edges.windows(2).any(|pair| pair[1] <= pair[0]) {
            return refused("bins", bins as f64, "expected fewer bins: two edges are the same number");
        }
        let search = if is_logarithmic { Search::logarithmic(&edges) } else { Search::linear(&edges) };
        Ok(Self { quantity, edges, is_logarithmic, search })
    }

    /// The quantity.
    pub fn quantity(&self) -> &Quantity {
        &self.quantity
    }

    /// The edges of the bins, ascending, one more than there are bins.
    pub fn edges(&self) -> &[f64] {
        &self.edges
    }

    /// Whether the bins are of equal ratio.
    pub fn is_logarithmic(&self) -> bool {
        self.is_logarithmic
    }

    /// Number of bins.
    pub fn bins(&self) -> usize {
        self.edges.len() - 1
    }

    /// The bin of a finite value: 0 is below the first edge, then come the bins, then everything at or above the last edge.
    pub(crate) fn place(&self, value: f64) -> usize {
        let (low, high) = (self.edges[0], self.edges[self.bins()]);
        if value < low {
            return 0;
        }
        if value >= high {
            return self.bins() + 1;
        }
        let mut bin = self.search.guess(&self.edges, value);
        // The guess may be off, as the edges are rounded.
        while value < self.edges[bin] {
            bin -= 1;
        }
        while value >= self.edges[bin + 1] {
            bin += 1;
        }
        bin + 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_in_the_bin_between_their_edges() {
        let histograms = [
            Histogram::linear(Quantity::SpinRate, -1e-3, 0.3, 37),
            Histogram::linear(Quantity::SpinRate, -1e300, 1e300, 1000),
            Histogram::logarithmic(Quantity::SpinRate, 1e-300, 1e300, 1000),
            Histogram::logarithmic(Quantity::SpinRate, 0.1, 0.2, 3),
        ];
        for histogram in histograms.map(|histogram| histogram.expect("valid")) {
            let edges = histogram.edges();
            for (k, &edge) in edges.iter().enumerate() {
                assert_eq!(histogram.place(edge), k + 1, "edge {k}, {edge:e}");
                assert_eq!(histogram.place(edge.next_down()), k, "below edge {k}, {edge:e}");
            }
        }
    }

    #[test]
    fn what_is_no_histogram_is_refused() {
        let refused = [
            Histogram::linear(Quantity::SpinRate, 1.0, 1.0, 3),
            Histogram::linear(Quantity::SpinRate, 0.0, f64::NAN, 3),
            Histogram::linear(Quantity::SpinRate, f64::NEG_INFINITY, 1.0, 3),
            Histogram::linear(Quantity::SpinRate, 0.0, 1.0, 0),
            Histogram::linear(Quantity::SpinRate, 0.0, 1.0, MOST_BINS + 1),
            Histogram::linear(Quantity::SpinRate, 1.0, 1.0 + 4.0 * f64::EPSILON, 100),
            Histogram::logarithmic(Quantity::SpinRate, 0.0, 1.0, 3),
        ];
        assert!(refused.iter().all(Result::is_err));
    }
}
