//! What a session says of its bodies without handing all of them over.

use std::ops::Range;

use crate::bodies::BodyFrame;
use crate::bodies::columns::StateWords;
use crate::error::Result;
use crate::kernel::observe::{Partial, Statistic};

/// A session that reduces its state where it is.
pub trait Reduce: Send {
    /// Makes ready for [`Reduce::reduce`]: the statistics wanted, the frames of all bodies, and the spin rate, rad/s, beyond
    /// which a body is marked.
    ///
    /// # Errors
    ///
    /// [`crate::Error::TooManyBodies`] where memory does not suffice; [`crate::Error::Device`] where the device fails.
    fn watch(&mut self, statistics: &[Statistic], frames: &[BodyFrame], fastest: f64) -> Result<()>;

    /// The statistics watched, of all bodies that did not fail, as the state stands; extremes name rows of the session.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Device`] where the device is lost.
    fn reduce(&mut self) -> Result<Vec<Partial<f64>>>;

    /// The rows that the last [`Reduce::reduce`] marked.
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

/// Rows of a session, ascending.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Marked {
    /// Those whose state is no longer finite, or of which a step said that it failed.
    pub failed: Vec<usize>,
    /// Those of the others that spin faster than the rate watched.
    pub faster: Vec<usize>,
}
