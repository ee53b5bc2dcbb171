//! Forms the statistics of a group where its states are, and reads single bodies.

use super::GroupRun;
use crate::bodies::blocks::cut;
use crate::bodies::{BodyState, Status};
use crate::engine::reduction::{AskedOfBodies, BlockRows, Formed, Marked};
use crate::error::Result;
use crate::kernel::observe::{self, Partial, Statistic};
use crate::run::output_statistics::FromStates;
use crate::run::session_run::SessionRun;

/// Bodies whose states are read at once if statistics are formed on the host.
const BLOCK: usize = 1 << 12;

impl GroupRun<'_> {
    /// Prepares for [`GroupRun::reduce`]; a body that spins faster than `fastest` rad/s is marked.
    pub fn watch(&mut self, statistics: &[Statistic], fastest: f64) -> Result<()> {
        let bodies = self.members.len();
        let bytes = bodies.saturating_mul(observe::bytes_per_body(statistics.len()));
        crate::bodies::memory::require(bodies, bytes, "the columns of the statistics")?;
        let blocks = self.block_rows();
        let Some(SessionRun { session, frames, .. }) = self.session() else { return Ok(()) };
        session.watch(statistics, frames, &blocks, fastest)
    }

    /// The session's rows, grouped by the blocks of bodies; places are the group's rows.
    fn block_rows(&self) -> BlockRows {
        self.rows.blocks(self.ends.clone())
    }

    /// Statistics of its bodies in their present states, by block; extremes name bodies.
    pub fn reduce(&mut self, statistics: &[Statistic]) -> Result<Vec<Vec<Partial<f64>>>> {
        let mut found = match self.session() {
            Some(run) => run.session.reduce()?,
            None => self.reduce_on_host(statistics)?,
        };
        for found in found.iter_mut().flatten().filter(|found| found.count > 0) {
            for extreme in [&mut found.least, &mut found.greatest] {
                extreme.body = self.members.body(extreme.body as usize) as u32;
            }
        }
        Ok(found)
    }

    /// The same, formed on the host; extremes name rows of the group.
    fn reduce_on_host(&mut self, statistics: &[Statistic]) -> Result<Vec<Vec<Partial<f64>>>> {
        let blocks = self.block_rows();
        let blocks = (0..blocks.count()).map(|block| blocks.places(block)).collect();
        let mut found = FromStates::new(statistics, blocks);
        self.each_piece(&mut |start, states| found.push(start, states, |state| state))?;
        Ok(found.finish())
    }

    /// Passes the states of its bodies piece by piece to `take`, each piece with its first row.
    fn each_piece(&mut self, take: &mut dyn FnMut(usize, &[BodyState])) -> Result<()> {
        for rows in cut(self.members.len(), BLOCK, &self.ends) {
            take(rows.start, &self.read_range(&rows)?);
        }
        Ok(())
    }

    /// Prepares for [`GroupRun::gather`]; the constants of `asked` are by body. `false` if the session does not form
    /// the quantities.
    pub fn watch_quantities(&mut self, asked: &AskedOfBodies<'_>) -> Result<bool> {
        let (members, blocks) = (self.members, self.block_rows());
        let of_place = |input, place| (asked.constant)(input, members.body(place));
        let Some(SessionRun { session, frames, .. }) = self.session() else { return Ok(false) };
        session.watch_quantities(&AskedOfBodies { constant: &of_place, ..*asked }, frames, &blocks)
    }

    /// The results for its bodies in their present states, by block; extremes name bodies.
    pub fn gather(&mut self) -> Result<Formed> {
        let time = self.time;
        let mut formed = self.session().map_or_else(|| Ok(Formed::default()), |run| run.session.gather(time))?;
        for moments in formed.moments.iter_mut().flatten().filter(|moments| moments.count > 0) {
            for (_, body) in [&mut moments.least, &mut moments.greatest] {
                *body = self.members.body(*body);
            }
        }
        Ok(formed)
    }

    /// The bodies that failed and those that spin faster than the watched rate, as found by the last [`GroupRun::reduce`].
    pub fn marked(&mut self, fastest: f64) -> Result<Marked> {
        let mut marked = match self.session() {
            Some(run) => run.session.marked()?,
            None => self.marked_on_host(fastest)?,
        };
        for row in marked.failed.iter_mut().chain(&mut marked.faster) {
            *row = self.members.body(*row);
        }
        Ok(marked)
    }

    fn marked_on_host(&mut self, fastest: f64) -> Result<Marked> {
        let mut marked = Marked::default();
        self.each_piece(&mut |start, states| {
            for (row, state) in (start..).zip(states) {
                if !state.is_sound() {
                    marked.failed.push(row);
                } else if state.angular_velocity_body.length() > fastest {
                    marked.faster.push(row);
                }
            }
        })?;
        Ok(marked)
    }

    /// The reasons of the failures that [`GroupRun::marked`] has found, in no particular order.
    pub fn reasons(&mut self, mut failed: Vec<usize>) -> Result<Vec<(usize, Status)>> {
        /// The most bodies that are read one by one; for more, whole blocks are read.
        const FEW: usize = 256;
        // A failure that only the device finds is beyond its own range of numbers.
        let reason = |state: &BodyState| match state.status {
            Status::Valid => Status::NotFinite,
            status => status,
        };
        if failed.len() <= FEW {
            let bodies: Vec<u32> = failed.iter().map(|&body| body as u32).collect();
            let states = self.read_bodies(&bodies)?;
            return Ok(states.iter().map(|(body, state)| (*body, reason(state))).collect());
        }
        failed.sort_unstable();
        let (members, mut reasons) = (self.members, Vec::with_capacity(failed.len()));
        self.each_piece(&mut |start, states| {
            let bodies = (start..).zip(states).map(|(row, state)| (members.body(row), state));
            let failed = bodies.filter(|(body, _)| failed.binary_search(body).is_ok());
            reasons.extend(failed.map(|(body, state)| (body, reason(state))));
        })?;
        Ok(reasons)
    }

    /// The states of those of its bodies that are among `bodies` and were not left out.
    pub fn read_bodies(&mut self, bodies: &[u32]) -> Result<Vec<(usize, BodyState)>> {
        let row = |&body: &u32| {
            let row = self.members.rows(body as usize..body as usize + 1).next()?;
            Some((row, self.rows.session_row(row)?))
        };
        let (rows, own): (Vec<usize>, Vec<usize>) = bodies.iter().filter_map(row).unzip();
        let states = match self.session() {
            Some(SessionRun { session, frames, .. }) => {
                let words = session.read_rows(&own)?;
                rows.iter().enumerate().map(|(index, &row)| frames[row].state_of(&words, index)).collect()
            }
            None => {
                let mut states = Vec::with_capacity(rows.len());
                for &row in &rows {
                    states.extend(self.read_range(&(row..row + 1))?);
                }
                states
            }
        };
        Ok(rows.into_iter().map(|row| self.members.body(row)).zip(states).collect())
    }

    /// The session, if it can reduce. It cannot if moments change, as only the host forms frames at a time.
    fn session(&mut self) -> Option<&mut SessionRun> {
        if self.varies { None } else { self.motion.session_mut() }
    }
}
