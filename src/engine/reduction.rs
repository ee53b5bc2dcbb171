//! What a session says of its bodies without handing all of them over.

use std::ops::Range;

use crate::bodies::BodyFrame;
use crate::bodies::columns::StateWords;
use crate::error::Result;
use crate::kernel::observe::{Partial, Statistic, merge_all};

/// The rows of a session by the blocks of bodies that they belong to ([`crate::bodies::Blocks`]). A row has a place: places follow the order
/// of the bodies, rows may follow another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlockRows {
    /// The place after the last of each block.
    ends: Vec<usize>,
    /// The row of each place, where that is another number.
    rows: Option<Vec<u32>>,
}

impl BlockRows {
    /// Blocks that end before the places `ends`, ascending; `rows` are the rows of all places where they have another order.
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

/// A session that reduces its state where it is.
pub trait Reduce: Send {
    /// Makes ready for [`Reduce::reduce`]: the statistics wanted, the frames of all rows, the blocks that they belong to, and the spin
    /// rate, rad/s, beyond which a body is marked.
    ///
    /// # Errors
    ///
    /// [`crate::Error::TooManyBodies`] where memory does not suffice; [`crate::Error::Device`] where the device fails.
    fn watch(&mut self, statistics: &[Statistic], frames: &[BodyFrame], blocks: &BlockRows, fastest: f64)
    -> Result<()>;

    /// For each block the statistics watched, of its bodies that did not fail, as the state stands; extremes name places. What is said
    /// of a block depends on its bodies alone.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Device`] where the device is lost.
    fn reduce(&mut self) -> Result<Vec<Vec<Partial<f64>>>>;

    /// The places that the last [`Reduce::reduce`] marked.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Device`] where the device is lost.
    fn marked(&mut self) -> Result<Marked>;

    /// Says that the state of a range of bodies is read next, as it is now: an engine may bring it to the host meanwhile.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Device`] where the device is lost.
    fn prefetch(&mut self, _bodies: Range<usize>) -> Result<()> {
        Ok(())
    }

    /// The raw state of some rows.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Device`] where the device is lost.
    fn read_rows(&mut self, rows: &[usize]) -> Result<StateWords>;
}

/// Of several partial results of each of some statistics, which follow each other, one.
pub(crate) fn merged(partials: &[Vec<Partial<f64>>], statistics: usize) -> Vec<Partial<f64>> {
    let of_statistic = |index: usize| merge_all(&partials.iter().map(|of_part| of_part[index]).collect::<Vec<_>>());
    (0..statistics).map(of_statistic).collect()
}

/// Places of a session's rows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Marked {
    /// Those whose state is no longer finite, or of which a step said that it failed.
    pub failed: Vec<usize>,
    /// Those of the others that spin faster than the rate watched.
    pub faster: Vec<usize>,
}

/// [`Reduce`] of a session by the one within it, in a field; `checked` by one of its own functions before a result is given.
macro_rules! reduces_within {
    ($session:ident, $inner:ident $(, $checked:ident)?) => {
        impl $crate::engine::reduction::Reduce for $session {
            fn watch(
                &mut self,
                statistics: &[$crate::kernel::observe::Statistic],
                frames: &[$crate::bodies::BodyFrame],
                blocks: &$crate::engine::reduction::BlockRows,
                fastest: f64,
            ) -> $crate::error::Result<()> {
                self.$inner.watch(statistics, frames, blocks, fastest)
            }

            fn reduce(&mut self) -> $crate::error::Result<Vec<Vec<$crate::kernel::observe::Partial<f64>>>> {
                $(self.$checked()?;)?
                self.$inner.reduce()
            }

            fn marked(&mut self) -> $crate::error::Result<$crate::engine::reduction::Marked> {
                self.$inner.marked()
            }

            fn prefetch(&mut self, bodies: std::ops::Range<usize>) -> $crate::error::Result<()> {
                self.$inner.prefetch(bodies)
            }

            fn read_rows(
                &mut self,
                rows: &[usize],
            ) -> $crate::error::Result<$crate::bodies::columns::StateWords> {
                $(self.$checked()?;)?
                self.$inner.read_rows(rows)
            }
        }
    };
}

pub(crate) use reduces_within;
