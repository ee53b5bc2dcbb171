//! The bodies of a group in a session.

use std::ops::{ControlFlow, Range};

use glam::DVec3;

use super::adaptive_work::GroupWork;
use super::reading::{FormStates, FramesAt, WriteState, each_in_lanes};
use super::session_rows::SessionRows;
use crate::bodies::BodyFrame;
use crate::bodies::columns::StateWords;
use crate::engine::watch::{Job, Watch};
use crate::engine::{End, Observer, Progress, Session, StepCounts};
use crate::error::{Error, Result};

/// A session with what its group needs to read it.
pub(super) struct SessionRun {
    pub session: Box<dyn Session>,
    /// By the group's rows.
    pub frames: Vec<BodyFrame>,
    /// Whether the session moves the centres of mass.
    pub moves_centres: bool,
    /// Adaptive steps of the bodies that were left out.
    left_out: Vec<StepCounts>,
    /// The rows that were last read of a session with an order of its own, since its bodies were advanced.
    last_read: Option<(Range<usize>, StateWords)>,
}

impl SessionRun {
    pub fn new(session: Box<dyn Session>, frames: Vec<BodyFrame>, moves_centres: bool) -> Self {
        Self { session, frames, moves_centres, left_out: Vec::new(), last_read: None }
    }

    /// Advances its bodies. A few are stepped without a watching thread.
    pub fn advance_to(&mut self, end: End, observer: &mut Observer<'_>) -> Result<()> {
        /// Body-steps that take less time than starting a thread.
        const FEW: u64 = 1 << 8;
        self.last_read = None;
        let steps = end.steps.steps;
        let total = steps.saturating_mul(self.session.body_count() as u64);
        if (1..=FEW).contains(&total)
            && let Some(job) = self.session.job_to(end)?
        {
            job(&Watch::default());
            return match observer(Progress { done: total, total }) {
                ControlFlow::Continue(()) => Ok(()),
                ControlFlow::Break(()) => Err(Error::Interrupted { steps }),
            };
        }
        self.session.advance_to(end, observer)
    }

    /// The same as a job for the host's threads, if the engine works on them.
    pub fn job_to(&mut self, end: End) -> Result<Option<Job<'_>>> {
        self.last_read = None;
        self.session.job_to(end)
    }

    /// Keeps only these of the session's rows.
    pub fn keep(&mut self, rows: &[usize]) -> Result<()> {
        let counts = self.session.counts()?.into_iter().enumerate();
        self.left_out.extend(counts.filter(|(row, _)| rows.binary_search(row).is_err()).map(|(_, counts)| counts));
        self.last_read = None;
        self.session.keep(rows)
    }

    /// The adaptive steps of its bodies, in the order in which they are advanced side by side.
    pub fn work(&mut self) -> Result<GroupWork> {
        let mut counts = self.session.counts()?;
        counts.extend(&self.left_out);
        Ok(GroupWork { counts, side_by_side: self.session.side_by_side(), imbalance: self.session.imbalance()? })
    }

    /// Passes the function that forms the states in some of the group's rows to `then`, for at most one piece at a
    /// time; `now` gives the frame of a row's body at the present time.
    pub fn with_states(
        &mut self,
        rows: &Range<usize>,
        own: &SessionRows,
        now: &FramesAt<'_>,
        then: &mut dyn FnMut(Range<usize>, &FormStates<'_>),
    ) -> Result<()> {
        let mut start = rows.start;
        while start < rows.end {
            let piece = own.piece(&(start..rows.end));
            let read = own.session_rows(&piece);
            let words = match self.last_read.take() {
                Some((last, words)) if last == read => words,
                _ => self.session.read(read.clone())?,
            };
            let (end, frames) = (piece.end.min(rows.end), &self.frames);
            let scaled = |row: usize, session_row: usize| {
                let place = session_row - read.start;
                (now.frame(&frames[row], row), words.combined(place), words.status[place])
            };
            then(start..end, &|rows, write| {
                if own.is_all() {
                    return each_in_lanes(rows, false, |row| scaled(row, own.at_start(row)), write);
                }
                let pairs = own.pairs(rows);
                let write: &mut WriteState<'_> = &mut |place, state| write(pairs[place].0, state);
                each_in_lanes(0..pairs.len(), false, |place| scaled(pairs[place].0, pairs[place].1), write);
            });
            if own.is_ordered() {
                self.last_read = Some((read, words));
            }
            start = end;
        }
        Ok(())
    }

    /// Announces that some of the group's rows are read next: requests the piece of the first of them if it is not here
    /// already.
    pub fn prefetch(&mut self, rows: &Range<usize>, own: &SessionRows) -> Result<()> {
        let read = own.session_rows(&own.piece(rows));
        if rows.is_empty() || self.last_read.as_ref().is_some_and(|(last, _)| *last == read) {
            return Ok(());
        }
        self.session.prefetch(read)
    }

    /// Position (m) and velocity (m/s), world axes, of the bodies in those of the group's rows that the session still
    /// has, if it moves them.
    pub fn centres(&mut self, rows: Range<usize>, own: &SessionRows) -> Result<Vec<(usize, (DVec3, DVec3))>> {
        let pairs = if self.moves_centres { own.pairs(rows) } else { Vec::new() };
        let session_rows = pairs.iter().map(|&(_, own)| own);
        let Some((first, last)) = session_rows.clone().min().zip(session_rows.max()) else { return Ok(Vec::new()) };
        let centres = self.session.read_centres(first..last + 1)?;
        Ok(pairs.into_iter().map(|(row, own)| (row, centres[own - first])).collect())
    }
}
