//! Some or all bodies of an ensemble.

use std::ops::Range;

/// The bodies of a group, ascending: all of an ensemble, or a list.
#[derive(Clone, Debug, PartialEq)]
pub enum Members {
    /// Every body.
    All(usize),
    /// Some bodies, ascending.
    Some(Vec<u32>),
}

impl Members {
    /// Number of bodies.
    pub fn len(&self) -> usize {
        match self {
            Members::All(count) => *count,
            Members::Some(list) => list.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The body in a row of the group.
    ///
    /// # Panics
    ///
    /// If there is no such row.
    pub fn body(&self, row: usize) -> usize {
        match self {
            Members::All(_) => row,
            Members::Some(list) => list[row] as usize,
        }
    }

    /// The rows of the bodies that lie in a range of the ensemble. As rows keep the ensemble's order, they are contiguous, so outputs can
    /// be read block by block in that order, in bounded memory.
    pub fn rows(&self, bodies: Range<usize>) -> Range<usize> {
        match self {
            Members::All(count) => bodies.start.min(*count)..bodies.end.min(*count),
            Members::Some(list) => {
                let row = |body: usize| list.partition_point(|&member| (member as usize) < body);
                row(bodies.start)..row(bodies.end)
            }
        }
    }
}
