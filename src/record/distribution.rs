//! Histograms at an output time.

/// How many bodies were in each bin of a histogram at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct HistogramCounts {
    /// The time, s.
    pub time: f64,
    /// Bodies below the first edge, in each bin, and at or above the last edge; those that have failed or lack the quantity are in none.
    pub counts: Vec<u64>,
}

impl HistogramCounts {
    /// Bodies below the first edge.
    pub fn below(&self) -> u64 {
        self.counts.first().copied().unwrap_or(0)
    }

    /// Bodies in each bin.
    pub fn bins(&self) -> &[u64] {
        self.counts.get(1..self.counts.len() - 1).unwrap_or_default()
    }

    /// Bodies at or above the last edge.
    pub fn above(&self) -> u64 {
        self.counts.last().copied().unwrap_or(0)
    }
}
