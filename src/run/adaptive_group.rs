//! A group of bodies in adaptive steps, ordered by expected work.

use std::ops::Range;
use std::time::Instant;

use glam::DVec3;

use super::kept::Kept;
use super::reading::{FormStates, FramesAt, WriteState, each_in_lanes};
use crate::bodies::BodyFrame;
use crate::bodies::blocks::cut;
use crate::bodies::columns::StateWords;
use crate::engine::adaptive_session::{AdaptiveSession, StepCounts};
use crate::engine::batch::{Prepared, ordered_together, prepare_ordered};
use crate::engine::controlled::Controls;
use crate::engine::reduction::BlockRows;
use crate::engine::watch::Job;
use crate::engine::{Backend, Observer, Session};
use crate::error::Result;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::math::Spread;
use crate::plan::Group;
use crate::plan::subset::{order_by_work, ordered_controls, start};
use crate::record::{AdaptiveWork, WallTime};
use crate::scene::AdaptiveSteps;
use crate::scene::Scene;

/// The bodies of a group in the order of their expected work, so that those advanced side by side finish together.
pub(super) struct AdaptiveGroupRun {
    session: Box<dyn AdaptiveSession>,
    /// By the group's rows, the order in which states are read.
    frames: Vec<BodyFrame>,
    /// The session's row of each of the group's rows. Both are in the same range of `cuts`, so that outputs are
    /// assembled piece by piece in bounded memory.
    session_rows: Vec<u32>,
    /// The group's rows in pieces that are ordered separately and end where blocks of bodies do.
    cuts: Vec<Range<usize>>,
    /// The rows that the session still has, out of those that it had at first, to which `session_rows` refers.
    kept: Kept,
    /// Steps of the bodies that were left out.
    left_out: Vec<StepCounts>,
    /// Whether its session integrates centres of mass.
    is_coupled: bool,
    /// The piece of rows that was last read since the bodies were advanced.
    last_read: Option<(usize, StateWords)>,
}

impl AdaptiveGroupRun {
    pub fn start(
        engine: &dyn Backend,
        scene: &Scene,
        group: &Group,
        (method, precision): (Method, Precision),
        (steps, ends): (AdaptiveSteps, &[usize]),
        wall_time: &mut WallTime,
    ) -> Result<Self> {
        let clock = Instant::now();
        let members = &group.members;
        let mut session_rows = vec![0; members.len()];
        let by_work =
            |start: usize, prepared: &[Prepared]| order_by_work(scene, members, start, prepared, &mut session_rows);
        let torques = group.class.torques.of(scene.torques());
        let cuts = cut(members.len(), ordered_together(engine.description().kind), ends);
        let ordered = (&cuts[..], by_work);
        let (frames, mut batch) =
            prepare_ordered(scene.ensemble(), &torques, scene.end(), members, precision, ordered)?;
        let controls = ordered_controls(&torques, &mut batch, &frames, members, &session_rows);
        wall_time.prepare += clock.elapsed().as_secs_f64();
        let frames = session_rows.iter().map(|&session_row| frames[session_row as usize]).collect();
        let is_coupled = batch.torques().is_coupled();
        let clock = Instant::now();
        let session = Controls::around_adaptive(controls, start(engine, (method, group.is_dense), batch, steps)?);
        wall_time.start += clock.elapsed().as_secs_f64();
        let (kept, left_out, last_read) = (Kept::default(), Vec::new(), None);
        Ok(Self { session, frames, session_rows, cuts, kept, left_out, is_coupled, last_read })
    }

    /// Position (m) and velocity (m/s), world axes, of the body in one of the group's rows, if the session integrates
    /// them.
    pub fn centre(&mut self, row: usize) -> Result<Option<(DVec3, DVec3)>> {
        let Some(row) = self.session_row(row).filter(|_| self.is_coupled) else { return Ok(None) };
        Ok(self.session.read_centres(row..row + 1)?.pop())
    }

    /// Whether centres of mass are part of the state.
    pub fn is_coupled(&self) -> bool {
        self.is_coupled
    }

    pub fn advance_to(&mut self, time: f64, observer: &mut Observer<'_>) -> Result<()> {
        self.last_read = None;
        self.session.advance_to(time, observer)
    }

    /// The same as a job for the host's threads, if the engine works on them.
    pub fn job_to(&mut self, time: f64) -> Result<Option<Job<'_>>> {
        self.last_read = None;
        self.session.job_to(time)
    }

    /// The session.
    pub fn session(&self) -> &dyn Session {
        &*self.session
    }

    /// The session, and the frames of the group's rows.
    pub fn session_mut(&mut self) -> (&mut dyn Session, &[BodyFrame]) {
        (&mut *self.session, &self.frames)
    }

    /// Bodies that the session has.
    pub fn body_count(&self) -> usize {
        self.kept.count(self.session_rows.len())
    }

    /// Leaves out bodies, given by the group's rows; see [`super::group_run::GroupRun::leave_out`].
    pub fn leave_out(&mut self, stands: &dyn Fn(usize) -> bool) -> Result<usize> {
        let before = self.body_count();
        let mut standing = vec![false; self.session_rows.len()];
        for (row, &place) in self.session_rows.iter().enumerate() {
            standing[place as usize] = stands(row);
        }
        let Some(moving) = self.kept.next(standing.len(), |place| standing[place]) else { return Ok(0) };
        let counts = self.session.counts()?;
        let is_left_out = |row: &usize| standing[self.kept.row(*row)];
        self.left_out.extend((0..before).filter(is_left_out).map(|row| counts[row]));
        self.last_read = None;
        self.session.keep(&moving)?;
        self.kept.keep(&moving);
        Ok(before - moving.len())
    }

    /// The session's row of one of the group's, if the session still has it.
    pub fn session_row(&self, row: usize) -> Option<usize> {
        self.kept.session_row(self.session_rows[row] as usize)
    }

    /// The session's rows by blocks that end before these of the group's rows.
    pub fn blocks(&self, ends: Vec<usize>) -> BlockRows {
        BlockRows::new(ends, Some(self.session_rows.clone()))
    }

    /// The piece of a row.
    fn cut_of(&self, row: usize) -> usize {
        self.cuts.partition_point(|cut| cut.end <= row)
    }

    /// The frames of the group's rows at the start.
    pub fn frames(&self) -> &[BodyFrame] {
        &self.frames
    }

    /// Passes the function that forms the states in some of the group's rows to `then`, for at most one piece at a
    /// time; `now` gives the frame of a row's body at the present time.
    pub fn with_states(
        &mut self,
        rows: &Range<usize>,
        now: &FramesAt<'_>,
        then: &mut dyn FnMut(Range<usize>, &FormStates<'_>),
    ) -> Result<()> {
        let mut start = rows.start;
        while start < rows.end {
            let number = self.cut_of(start);
            let block = self.cuts[number].clone();
            let words = match self.last_read.take() {
                Some((last, words)) if last == number => words,
                _ => self.session.read(self.kept.session_rows(&block))?,
            };
            let end = block.end.min(rows.end);
            let Self { frames, session_rows, kept, .. } = &*self;
            let (frames, session_rows) = (&frames[..], &session_rows[..]);
            let first = kept.session_rows(&block).start;
            let scaled = |row: usize, session_row: usize| {
                let place = session_row - first;
                (now.frame(&frames[row], row), words.combined(place), words.status[place])
            };
            then(start..end, &|rows, write| {
                if kept.is_all() {
                    return each_in_lanes(rows, false, |row| scaled(row, session_rows[row] as usize), write);
                }
                let own = rows.filter_map(|row| Some((row, kept.session_row(session_rows[row] as usize)?)));
                let own: Vec<(usize, usize)> = own.collect();
                let write: &mut WriteState<'_> = &mut |place, state| write(own[place].0, state);
                each_in_lanes(0..own.len(), false, |place| scaled(own[place].0, own[place].1), write);
            });
            self.last_read = Some((number, words));
            start = end;
        }
        Ok(())
    }

    /// Announces that some of the group's rows are read next: requests the piece of the first of them if it is not here
    /// already.
    pub fn prefetch(&mut self, rows: Range<usize>) -> Result<()> {
        let number = self.cut_of(rows.start);
        if rows.is_empty() || self.last_read.as_ref().is_some_and(|(last, _)| *last == number) {
            return Ok(());
        }
        let piece = self.kept.session_rows(&self.cuts[number]);
        self.session.prefetch(piece)
    }

    /// The time of the body in one of the group's rows, s, if the session can tell it.
    pub fn reached(&self, row: usize) -> Option<f64> {
        let row = self.session_row(row)?;
        self.session.reached().map(|reached| reached[row])
    }

    /// The steps that the bodies in some of the group's rows have tried.
    pub fn attempts(&mut self, rows: &[usize]) -> Result<Vec<u64>> {
        let counts = self.session.counts()?;
        let of_row = |&row: &usize| self.session_row(row).map_or(0, |row| counts[row].attempts());
        Ok(rows.iter().map(of_row).collect())
    }

    /// The steps of its bodies, in the order in which they are advanced side by side.
    pub fn work(&mut self) -> Result<GroupWork> {
        let mut counts = self.session.counts()?;
        counts.extend(&self.left_out);
        Ok(GroupWork {
            accepted: counts.iter().map(|counts| counts.accepted).collect(),
            rejected: counts.iter().map(|counts| counts.rejected).collect(),
            side_by_side: self.session.side_by_side(),
            imbalance: self.session.imbalance()?,
        })
    }
}

/// Steps of the bodies of one group.
pub(super) struct GroupWork {
    accepted: Vec<u64>,
    rejected: Vec<u64>,
    side_by_side: usize,
    imbalance: f64,
}

/// The work of all groups together; `None` without any.
pub(super) fn total_work(group_runs: Vec<GroupWork>, flagged: usize) -> Option<AdaptiveWork> {
    let side_by_side = group_runs.iter().map(|group_run| group_run.side_by_side).max()?;
    let (mut own, mut with_waiting) = (0.0, 0.0);
    for group_run in &group_runs {
        let attempts = group_run.accepted.iter().chain(&group_run.rejected).sum::<u64>() as f64;
        own += attempts;
        with_waiting += attempts * group_run.imbalance;
    }
    let spread = |of: fn(&GroupWork) -> &Vec<u64>| {
        Spread::of(group_runs.iter().flat_map(|group_run| of(group_run).clone()).collect())
    };
    Some(AdaptiveWork {
        accepted: spread(|group_run| &group_run.accepted),
        rejected: spread(|group_run| &group_run.rejected),
        flagged,
        side_by_side,
        imbalance: if own > 0.0 { with_waiting / own } else { 1.0 },
    })
}
