//! Tables of states, which a separate thread forms and writes while the run continues to compute.

use std::ops::Range;
use std::sync::mpsc::{Receiver, Sender, SyncSender, TrySendError, channel, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use crate::error::{Error, Result};
use crate::plan::Plan;
use crate::record::OutputState;
use crate::record::column::{Layout, StateRows};
use crate::record::csv_file::CsvFile;
use crate::record::folder::OutputFolder;
use crate::record::npz_file::{NpzFile, Times};
#[cfg(feature = "parquet")]
use crate::record::parquet_file::ParquetStates;
use crate::run::observed::Evaluator;
use crate::study::{Format, Output};

/// Wall time of writing tables, s.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WriteTime {
    pub format: f64,
    pub disk: f64,
}

/// Returns the result of `work` and adds its time to `seconds`.
pub(super) fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> T) -> T {
    let clock = Instant::now();
    let done = work();
    *seconds += clock.elapsed().as_secs_f64();
    done
}

/// A table of states that is being written, in any format.
#[derive(Debug)]
pub(super) enum TableFile {
    Csv(CsvFile),
    Npz(NpzFile),
    #[cfg(feature = "parquet")]
    Parquet(Box<ParquetStates>),
}

impl TableFile {
    /// Begins a table of the bodies in a range, counted as in the whole to which they belong.
    pub fn begin(
        folder: &mut OutputFolder,
        (stem, format): (&str, Format),
        bodies: Range<usize>,
        layout: &Layout,
        times: Times<'_>,
    ) -> Result<Self> {
        let name = format!("{stem}.{}", format.name());
        Ok(match format {
            Format::Csv => TableFile::Csv(CsvFile::begin(folder.begin(&name)?, layout)?),
            Format::Npz => TableFile::Npz(NpzFile::begin(folder.begin(&name)?, bodies, times, layout)?),
            #[cfg(feature = "parquet")]
            Format::Parquet => TableFile::Parquet(Box::new(ParquetStates::begin(folder, stem, layout)?)),
        })
    }

    /// Appends the rows of `states`, bodies from `first_body` on, whose `derived` values are as [`Layout::turn`] takes
    /// them; `rows` provides memory.
    fn append_states(
        &mut self,
        (layout, rows): (&Layout, &mut StateRows),
        (time, first_body): (f64, usize),
        (states, derived): (&[OutputState], &[&[f64]]),
        spent: &mut WriteTime,
    ) -> Result<()> {
        #[cfg(feature = "parquet")]
        if let TableFile::Parquet(file) = self {
            return timed(&mut spent.disk, || file.write_states(layout, (time, first_body), states, derived));
        }
        timed(&mut spent.format, || rows.fill(layout, states, derived));
        self.append(time, first_body, rows, spent)
    }

    /// Appends the rows of the bodies from `first_body` on.
    pub fn append(&mut self, time: f64, first_body: usize, rows: &StateRows, spent: &mut WriteTime) -> Result<()> {
        match self {
            TableFile::Csv(file) => {
                timed(&mut spent.format, || file.format(time, first_body, rows));
                timed(&mut spent.disk, || file.write())
            }
            TableFile::Npz(file) => timed(&mut spent.disk, || file.write(rows)),
            #[cfg(feature = "parquet")]
            TableFile::Parquet(file) => timed(&mut spent.disk, || file.write(time, first_body, rows)),
        }
    }

    pub fn finish(self) -> Result<()> {
        match self {
            TableFile::Csv(file) => file.finish(),
            TableFile::Npz(file) => file.finish(),
            #[cfg(feature = "parquet")]
            TableFile::Parquet(file) => file.finish(),
        }
    }
}

/// The tables of states that a study asks for, while they are written.
pub(super) struct StateTables<'p> {
    layout: Layout,
    /// Forms the derived quantities of the tables.
    evaluator: Option<Evaluator<'p>>,
    final_state: Option<TableFile>,
    snapshots: Option<TableFile>,
    /// The table of final states of all bodies of a study, to which the run of some bodies appends.
    of_all: Option<&'p mut TableFile>,
    /// The index of the first body in the whole study.
    first_body: usize,
    /// The index of the last output.
    last: usize,
    spent: WriteTime,
    /// Kept to reuse its memory.
    rows: StateRows,
}

/// Some states at an output time.
struct Message {
    index: usize,
    time: f64,
    first_body: usize,
    states: Vec<OutputState>,
    /// Numbers of the own state of sampled torques, by number, then by body.
    own: Vec<Vec<f64>>,
}

impl<'p> StateTables<'p> {
    pub fn begin(
        folder: &mut OutputFolder,
        output: &Output,
        layout: Layout,
        plan: &'p Plan<'_>,
        of_all: Option<&'p mut TableFile>,
    ) -> Result<Self> {
        let (times, ensemble) = (plan.times(), plan.scene().ensemble());
        let first_body = plan.scene().part().first_body;
        let bodies = first_body..first_body + ensemble.len();
        let mut table = |wanted: bool, stem: &str, times: Times<'_>| {
            let of = (stem, output.format);
            wanted.then(|| TableFile::begin(folder, of, bodies.clone(), &layout, times)).transpose()
        };
        let (final_state, snapshots) = (
            table(output.final_state, "final", Times::One(plan.scene().end()))?,
            table(output.snapshots, "snapshots", Times::Many(times))?,
        );
        let quantities = &layout.quantities;
        let evaluator = (!quantities.is_empty()).then(|| Evaluator::new(plan.scene(), quantities)).transpose()?;
        let (last, spent, rows) = (times.len() - 1, WriteTime::default(), StateRows::default());
        Ok(Self { layout, evaluator, final_state, snapshots, of_all, first_body, last, spent, rows })
    }

    /// Writes the states that `run` passes to its queue while it continues. If writing fails, that is the error,
    /// whatever error the run then reports because of the closed queue.
    pub fn while_running<T>(self, run: impl FnOnce(&mut StateQueue) -> Result<T>) -> Result<(T, WriteTime)> {
        let at_end = self.final_state.is_some() || self.of_all.is_some();
        let wants = Wants { always: self.snapshots.is_some(), at_end, last: self.last };
        thread::scope(|scope| {
            let (sender, receiver) = sync_channel(QUEUED);
            let (emptied, room) = channel();
            let mut queue = StateQueue { sender, room, wants };
            let writer = scope.spawn(|| self.write_all(receiver, emptied));
            let done = run(&mut queue);
            drop(queue);
            help_until(|| writer.is_finished());
            let spent = writer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
            Ok((done?, spent))
        })
    }

    /// Returns vectors whose states are written through `emptied`.
    fn write_all(mut self, messages: Receiver<Message>, emptied: Sender<Vec<OutputState>>) -> Result<WriteTime> {
        for message in messages {
            self.write(&message)?;
            // The run may have ended.
            let _ = emptied.send(message.states);
        }
        let Self { final_state, snapshots, mut spent, .. } = self;
        timed(&mut spent.disk, || final_state.into_iter().chain(snapshots).try_for_each(TableFile::finish))?;
        Ok(spent)
    }

    fn write(&mut self, Message { index, time, first_body, states, own }: &Message) -> Result<()> {
        let at_end = *index == self.last;
        let derived: Vec<Vec<f64>> = timed(&mut self.spent.format, || {
            let own: Vec<&[f64]> = own.iter().map(Vec::as_slice).collect();
            let values = self.evaluator.as_ref().map(|evaluator| evaluator.values(*first_body, *time, states, &own));
            let of = |place: usize| values.iter().flat_map(move |values| values.of(place)).flat_map(|(_, part)| part);
            (0..self.layout.quantities.len()).map(|place| of(place).copied().collect()).collect()
        });
        let derived: Vec<&[f64]> = derived.iter().chain(own).map(Vec::as_slice).collect();
        let of = (*time, self.first_body + first_body);
        let final_states = self.final_state.iter_mut().chain(self.of_all.as_deref_mut());
        for table in self.snapshots.iter_mut().chain(final_states.filter(|_| at_end)) {
            table.append_states((&self.layout, &mut self.rows), of, (states, &derived), &mut self.spent)?;
        }
        Ok(())
    }
}

/// Blocks of states that may wait for the writing thread, so that neither it nor the run waits for the other's slowest
/// block.
const QUEUED: usize = 4;

/// Which states the tables have.
#[derive(Clone, Copy)]
struct Wants {
    always: bool,
    at_end: bool,
    last: usize,
}

/// Passes states to the writing thread.
pub(super) struct StateQueue {
    sender: SyncSender<Message>,
    /// Vectors whose states are written, for reuse.
    room: Receiver<Vec<OutputState>>,
    wants: Wants,
}

impl StateQueue {
    pub fn wants(&self, index: usize) -> bool {
        self.wants.always || self.wants.at_end && index == self.wants.last
    }

    /// Takes the states, with the own state of sampled torques, and leaves a vector whose memory can be reused. Waits
    /// if the writing thread is behind.
    ///
    /// # Errors
    ///
    /// [`Error::Interrupted`] where the writing thread has failed, which keeps its error.
    pub fn push(
        &self,
        index: usize,
        time: f64,
        first_body: usize,
        states: &mut Vec<OutputState>,
        own: Vec<Vec<f64>>,
    ) -> Result<()> {
        let states = std::mem::replace(states, self.room.try_recv().unwrap_or_default());
        let mut message = Message { index, time, first_body, states, own };
        if rayon::current_thread_index().is_none() {
            return self.sender.send(message).map_err(|_| Error::Interrupted { steps: 0 });
        }
        loop {
            match self.sender.try_send(message) {
                Ok(()) => return Ok(()),
                Err(TrySendError::Full(back)) => message = back,
                Err(TrySendError::Disconnected(_)) => return Err(Error::Interrupted { steps: 0 }),
            }
            help();
        }
    }
}

/// Waits; if this is a thread of the pool that formats rows, it helps there meanwhile, as in a pool of one thread
/// nobody else can.
fn help_until(is_done: impl Fn() -> bool) {
    while rayon::current_thread_index().is_some() && !is_done() {
        help();
    }
}

fn help() {
    if rayon::yield_now() != Some(rayon::Yield::Executed) {
        thread::sleep(Duration::from_micros(200));
    }
}
