//! What a session reports of its bodies without handing over their states.

use std::ops::Range;

use crate::expression::{Graph, Input, Node};
use crate::kernel::observe::{Partial, merge_all};
use crate::math::Moments;

/// The rows of a session, grouped by the blocks of bodies that they belong to ([`crate::bodies::Blocks`]). Each row has
/// a place: places follow the order of the bodies, rows may follow another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlockRows {
    /// The place after the last of each block.
    ends: Vec<usize>,
    /// The row of each place, if rows have another order.
    rows: Option<Vec<u32>>,
}

impl BlockRows {
    /// Blocks that end before the places `ends`, ascending; `rows` are the rows of all places if they have another
    /// order.
    pub fn new(ends: Vec<usize>, rows: Option<Vec<u32>>) -> Self {
        Self { ends, rows }
    }

    /// One block of all rows.
    pub fn one(rows: usize) -> Self {
        Self::new(vec![rows], None)
    }

    /// Number of places.
    pub fn len(&self) -> usize {
        self.ends.last().copied().unwrap_or(0)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of blocks; some may be empty.
    pub fn count(&self) -> usize {
        self.ends.len()
    }

    /// The places of a block.
    ///
    /// # Panics
    ///
    /// If there is no such block.
    pub fn places(&self, block: usize) -> Range<usize> {
        if block == 0 { 0..self.ends[0] } else { self.ends[block - 1]..self.ends[block] }
    }

    /// The row of a place.
    ///
    /// # Panics
    ///
    /// If there is no such place.
    pub fn row(&self, place: usize) -> usize {
        self.rows.as_ref().map_or(place, |rows| rows[place] as usize)
    }
}

/// The results wanted of the bodies of a session at an output time.
#[doc(hidden)]
#[derive(Clone, Copy)]
pub struct AskedOfBodies<'a> {
    /// The formulas of the quantities.
    pub graph: &'a Graph,
    /// The quantities; first those that have statistics.
    pub outputs: &'a [Node],
    /// The constants of a body that the formulas read: parameters and the inertia tensor.
    pub constants: &'a [Input],
    /// How many of them have statistics.
    pub statistics: usize,
    /// For each histogram its quantity and its edges.
    pub histograms: &'a [(usize, &'a [f64])],
    /// Gives one of the constants for the body in a place.
    pub constant: &'a (dyn Fn(Input, usize) -> f64 + Sync),
}

/// The results of the bodies of a session at an output time.
#[doc(hidden)]
#[derive(Clone, Debug, Default)]
pub struct Formed {
    /// Bodies that have not failed.
    pub(crate) sound: usize,
    /// By block, then by statistic.
    pub(crate) moments: Vec<Vec<Moments>>,
    /// The counts of each histogram: below its edges, of its bins, above them.
    pub(crate) histograms: Vec<Vec<u64>>,
}

/// Merges consecutive partial results into one for each statistic.
pub(crate) fn merged(partials: &[Vec<Partial<f64>>], statistics: usize) -> Vec<Partial<f64>> {
    let of_statistic = |index: usize| merge_all(&partials.iter().map(|of_part| of_part[index]).collect::<Vec<_>>());
    (0..statistics).map(of_statistic).collect()
}

/// Places of a session's rows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Marked {
    /// Those whose state is no longer finite, or one of whose steps reported a failure.
    pub failed: Vec<usize>,
    /// Those of the others that spin faster than the watched rate.
    pub faster: Vec<usize>,
}
