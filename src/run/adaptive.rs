//! A group of bodies in adaptive steps, ordered by expected work.

use std::ops::Range;
use std::time::Instant;

use rayon::prelude::*;

use super::READ_BLOCK;
use crate::batch::{BodyFrame, BodyState, prepare_body, prepare_members};
use crate::engine::adaptive::{AdaptiveSession, AdaptiveSteps};
use crate::engine::reduction::Reduce;
use crate::engine::work::order;
use crate::engine::{Backend, Observer};
use crate::error::Result;
use crate::plan::{Group, Members, greatest_rate};
use crate::record::{AdaptiveWork, Spread, WallTime};
use crate::scene::Scene;

/// The bodies of a group in the order of their expected work, so that those advanced side by side finish together.
pub(super) struct AdaptiveUnit {
    session: Box<dyn AdaptiveSession>,
    /// By the session's rows.
    frames: Vec<BodyFrame>,
    /// The session's row of each of the group's rows. Both lie in the same block of [`READ_BLOCK`] rows, so that outputs
    /// are put together block by block in bounded memory.
    session_rows: Vec<u32>,
}

impl AdaptiveUnit {
    pub fn start(
        engine: &dyn Backend,
        scene: &Scene,
        group: &Group,
        precision: crate::batch::Precision,
        steps: AdaptiveSteps,
        wall_time: &mut WallTime,
    ) -> Result<Self> {
        let clock = Instant::now();
        let members = &group.members;
        let expected: Vec<f64> =
            (0..members.len()).into_par_iter().map(|row| expected_rate(scene, members.body(row))).collect();
        let mut bodies = Vec::with_capacity(members.len());
        let mut session_rows = vec![0; members.len()];
        for (block, expected) in expected.chunks(READ_BLOCK).enumerate() {
            let start = block * READ_BLOCK;
            for row in order(expected) {
                session_rows[start + row] = bodies.len() as u32;
                bodies.push(members.body(start + row) as u32);
            }
        }
        let torques = group.class.torques.of(scene.torques());
        let (frames, batch) =
            prepare_members(scene.ensemble(), &torques, scene.end(), &Members::Some(bodies), precision)?;
        wall_time.prepare += clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let session = engine.start_adaptive(batch, steps)?;
        wall_time.start += clock.elapsed().as_secs_f64();
        Ok(Self { session, frames, session_rows })
    }

    pub fn advance_to(&mut self, time: f64, observer: &mut Observer<'_>) -> Result<()> {
        self.session.advance_to(time, observer)
    }

    /// The session, and the frames of its rows.
    pub fn session(&mut self) -> (&mut dyn Reduce, &[BodyFrame]) {
        (&mut *self.session, &self.frames)
    }

    /// The session's row of one of the group's.
    pub fn session_row(&self, row: usize) -> usize {
        self.session_rows[row] as usize
    }

    /// The group's row of one of the session's, which lies in the same block.
    pub fn group_row(&self, session_row: usize) -> usize {
        let start = session_row / READ_BLOCK * READ_BLOCK;
        let end = (start + READ_BLOCK).min(self.session_rows.len());
        let found = self.session_rows[start..end].iter().position(|&row| row as usize == session_row);
        start + found.unwrap_or(0)
    }

    /// The states in some of the group's rows; `now` makes the frame of a row's body into that of the present time.
    pub fn read(
        &mut self,
        rows: &Range<usize>,
        now: impl Fn(&BodyFrame, usize) -> BodyFrame + Sync,
    ) -> Result<Vec<BodyState>> {
        let start = rows.start / READ_BLOCK * READ_BLOCK;
        let end = rows.end.next_multiple_of(READ_BLOCK).min(self.session_rows.len());
        let words = self.session.read(start..end)?;
        let state = |row: usize| {
            let own = self.session_rows[row] as usize;
            let index = own - start;
            let frame = now(&self.frames[own], row);
            BodyState { status: words.status[index], ..frame.body_state(words.combined(index)) }
        };
        Ok(rows.clone().into_par_iter().map(state).collect())
    }

    /// What its bodies took, in the order in which they stand side by side.
    pub fn work(&mut self) -> Result<UnitWork> {
        let counts = self.session.counts()?;
        Ok(UnitWork {
            accepted: counts.iter().map(|counts| counts.accepted).collect(),
            rejected: counts.iter().map(|counts| counts.rejected).collect(),
            side_by_side: self.session.side_by_side(),
            imbalance: self.session.imbalance()?,
        })
    }

    /// Bytes that were read back from a device so far.
    pub fn bytes_read(&self) -> u64 {
        self.session.bytes_read()
    }
}

/// The greatest rate of a body, rad/s. All have the same span, so this is their work up to a factor.
fn expected_rate(scene: &Scene, body: usize) -> f64 {
    let (frame, state) = prepare_body(scene.ensemble(), scene.torques(), body);
    greatest_rate(scene, body, &frame, glam::DVec3::new(state[4], state[5], state[6]))
}

/// Steps of the bodies of one unit.
pub(super) struct UnitWork {
    accepted: Vec<u64>,
    rejected: Vec<u64>,
    side_by_side: usize,
    imbalance: f64,
}

/// The work of all units together; `None` without any.
pub(super) fn total_work(units: Vec<UnitWork>, flagged: usize) -> Option<AdaptiveWork> {
    let side_by_side = units.iter().map(|unit| unit.side_by_side).max()?;
    let (mut own, mut with_waiting) = (0.0, 0.0);
    for unit in &units {
        let attempts = unit.accepted.iter().chain(&unit.rejected).sum::<u64>() as f64;
        own += attempts;
        with_waiting += attempts * unit.imbalance;
    }
    let spread = |of: fn(&UnitWork) -> &Vec<u64>| Spread::of(units.iter().flat_map(|unit| of(unit).clone()).collect());
    Some(AdaptiveWork {
        accepted: spread(|unit| &unit.accepted),
        rejected: spread(|unit| &unit.rejected),
        flagged,
        side_by_side,
        imbalance: if own > 0.0 { with_waiting / own } else { 1.0 },
    })
}
