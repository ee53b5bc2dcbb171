//! The results of a run, in memory and in files.

use glam::{DQuat, DVec3};

use crate::bodies::BodyState;
use crate::bodies::Status;
use crate::engine::{Description, DeviceFault, Traffic};
use crate::error::Result;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::math::Quantiles;
use crate::math::parallel;
use crate::plan::{Part, listed};
use crate::scene::Accuracy;

mod adaptive_work;
mod balance;
#[cfg(feature = "study")]
pub(crate) mod column;
#[cfg(feature = "study")]
pub(crate) mod csv_file;
#[cfg(feature = "study")]
pub(crate) mod date;
mod distribution;
mod drift;
mod events;
mod failed;
#[cfg(feature = "study")]
pub(crate) mod failed_file;
#[cfg(feature = "study")]
pub(crate) mod folder;
mod gathered;
#[cfg(feature = "study")]
mod lock;
#[cfg(feature = "study")]
pub(crate) mod npz_file;
#[cfg(feature = "study")]
pub(crate) mod observed_files;
#[cfg(feature = "parquet")]
pub(crate) mod parquet_file;
#[cfg(feature = "study")]
pub(crate) mod part_file;
#[cfg(feature = "study")]
pub mod report;
#[cfg(feature = "study")]
pub(crate) mod shard;
mod sink;
#[cfg(feature = "study")]
mod state_table;
mod statistical_sample;
mod statistics;
#[cfg(feature = "study")]
pub(crate) mod statistics_file;
#[cfg(feature = "study")]
mod table;
#[cfg(feature = "study")]
pub(crate) mod table_file;

pub use crate::math::QUANTILE_ERROR;
pub use adaptive_work::AdaptiveWork;
pub use balance::Balance;
pub(crate) use balance::{BalanceGatherer, change_of_total};
#[cfg(feature = "study")]
pub use column::{CELL, ROTATION_COLUMNS, STATUS, STOPPED_AT, TRANSLATION_COLUMNS};
pub use distribution::HistogramCounts;
pub use drift::Drift;
pub(crate) use drift::{BodyDrift, Conserved, DriftGatherer};
pub use events::{Censored, EventErrors, EventOccurrence, EventRecord, EventTime, Survival, TimeBy};
pub use failed::{FailedBody, KnownTo};
#[cfg(feature = "study")]
pub use folder::{OutputFolder, PLAN, REPORT, Traces};
pub use gathered::{Gathered, OfCell};
#[cfg(feature = "study")]
pub use report::Report;
#[cfg(feature = "study")]
pub use shard::{Shard, ShardState, is_complete, ranges, status};
pub use sink::Sink;
#[cfg(feature = "study")]
pub use state_table::{StateRow, StateTable};
pub use statistical_sample::StatisticalSample;
pub use statistics::{Statistics, Summary};
#[cfg(feature = "study")]
pub use table::{Table, read};

/// One body at an output time.
///
/// All numbers of a body that has failed are NaN, so that they cannot be mistaken for results. If only the centre of mass is
/// lost ([`Status::CentreNotFinite`]), only position and velocity are NaN, as long as the rotation is good. The last good state is in
/// [`Trust::failures`]. A body that an event has stopped ([`Status::Stopped`]) stays in the state of the event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutputState {
    /// Attitude and rotation.
    pub rotation: BodyState,
    /// Position (m) and velocity (m/s) of the centre of mass, world axes, if the ensemble translates.
    pub translation: Option<(DVec3, DVec3)>,
    /// When an event stopped the body, s; the state is that of this time. `None` if none has.
    pub stopped_at: Option<f64>,
}

impl OutputState {
    /// The output of a body under way.
    pub(crate) fn moving(rotation: BodyState, translation: Option<(DVec3, DVec3)>) -> Self {
        Self { rotation, translation, stopped_at: None }
    }

    /// The status of the body.
    pub fn status(&self) -> Status {
        let is_finite = |(position, velocity): (DVec3, DVec3)| position.is_finite() && velocity.is_finite();
        match self.rotation.status {
            status if status.is_good() && !self.rotation.is_finite() => Status::NotFinite,
            status if status.is_good() && !self.translation.is_none_or(is_finite) => Status::CentreNotFinite,
            status => status,
        }
    }

    /// The time, s, of the state at an output at `time`.
    pub(crate) fn time(&self, time: f64) -> f64 {
        self.stopped_at.unwrap_or(time)
    }
}

/// The states of all bodies at one time, by column.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snapshot {
    time: f64,
    orientation: Vec<DQuat>,
    angular_velocity_body: Vec<DVec3>,
    position: Vec<DVec3>,
    velocity: Vec<DVec3>,
    status: Vec<Status>,
    stopped_at: Vec<f64>,
}

impl Snapshot {
    /// Bytes for each body.
    pub(crate) fn bytes(has_centres: bool) -> usize {
        let of_centre = if has_centres { 2 * size_of::<DVec3>() } else { 0 };
        size_of::<DQuat>() + size_of::<DVec3>() + size_of::<Status>() + of_centre
    }

    /// The time, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Number of bodies.
    pub fn len(&self) -> usize {
        self.orientation.len()
    }

    /// Whether there are no bodies.
    pub fn is_empty(&self) -> bool {
        self.orientation.is_empty()
    }

    /// Unit quaternion that rotates body `body`'s coordinates to world.
    ///
    /// # Panics
    ///
    /// If there is no such body.
    pub fn orientation(&self, body: usize) -> DQuat {
        self.orientation[body]
    }

    /// Angular velocity of body `body` in body axes, rad/s.
    ///
    /// # Panics
    ///
    /// If there is no such body.
    pub fn angular_velocity_body(&self, body: usize) -> DVec3 {
        self.angular_velocity_body[body]
    }

    /// Orientations, shape `[body_count]`.
    pub fn orientations(&self) -> &[DQuat] {
        &self.orientation
    }

    /// Angular velocities in body axes, rad/s, shape `[body_count]`.
    pub fn angular_velocities_body(&self) -> &[DVec3] {
        &self.angular_velocity_body
    }

    /// Positions of the centres of mass, m, world axes; empty if the ensemble does not translate.
    pub fn positions(&self) -> &[DVec3] {
        &self.position
    }

    /// Velocities of the centres of mass, m/s, world axes; empty if the ensemble does not translate.
    pub fn velocities(&self) -> &[DVec3] {
        &self.velocity
    }

    /// The status of each body, shape `[body_count]`; the numbers of one that has failed are NaN ([`OutputState`]).
    pub fn statuses(&self) -> &[Status] {
        &self.status
    }

    /// When an event stopped each body, s, shape `[body_count]`: NaN for bodies that none has stopped; empty if no body was stopped.
    pub fn stopped_at(&self) -> &[f64] {
        &self.stopped_at
    }

    pub(crate) fn with_capacity(time: f64, body_count: usize) -> Self {
        let (orientation, angular_velocity_body) = (Vec::with_capacity(body_count), Vec::with_capacity(body_count));
        Self { time, orientation, angular_velocity_body, status: Vec::with_capacity(body_count), ..Self::default() }
    }

    /// Appends the next bodies.
    pub(crate) fn extend(&mut self, states: &[OutputState]) {
        let before = self.orientation.len();
        if !self.stopped_at.is_empty() || states.iter().any(|state| state.stopped_at.is_some()) {
            self.stopped_at.resize(before, f64::NAN);
            self.stopped_at.extend(states.iter().map(|state| state.stopped_at.unwrap_or(f64::NAN)));
        }
        let rows = states.len();
        parallel::extend_by_rows(&mut self.orientation, rows, TAKEN, &|row| states[row].rotation.orientation);
        parallel::extend_by_rows(&mut self.angular_velocity_body, rows, TAKEN, &|row| {
            states[row].rotation.angular_velocity_body
        });
        parallel::extend_by_rows(&mut self.status, rows, TAKEN, &|row| states[row].status());
        // All bodies of an ensemble translate, or none.
        if states.first().is_some_and(|state| state.translation.is_some()) {
            let centres = || states.iter().filter_map(|state| state.translation);
            self.position.extend(centres().map(|(position, _)| position));
            self.velocity.extend(centres().map(|(_, velocity)| velocity));
        }
    }
}

/// Number of bodies that one task copies into a snapshot.
const TAKEN: usize = 1 << 11;

/// Wall time of a run by phase, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct WallTime {
    /// Principal axes, scaling, columns.
    pub prepare: f64,
    /// Opening the session: upload and shader compilation.
    pub start: f64,
    /// Integration; for torque-free bodies evaluated when read, also set-up and transformation to the user's axes, which are one piece.
    pub compute: f64,
    /// Reading states back and transforming them to the user's axes and units.
    pub read: f64,
    /// Finding the times of events, and passing statistics and histograms to the sink.
    pub observe: f64,
    /// Passing states to the sink.
    #[cfg_attr(feature = "study", serde(skip))]
    pub write: f64,
    /// Recomputing the sample of bodies, and meanwhile the quantiles of the drift.
    pub recomputed_sample: f64,
}

/// The errors of a run's states at the end, estimated from a sample of its bodies that was recomputed on the CPU in `f64`: torque-free
/// bodies by the closed form, the others by Taylor series, at a thousandth of the run's tolerance if it took series itself and near rounding
/// otherwise. Under random torques equal steps are repeated by `rk8` with the run's draws; under sampled ones they are half as long if the
/// run's method is of order 6 or more, and adaptive steps are finer.
///
/// Of stepped bodies the sample has more of the fastest and of the slowest, so that it includes some if 2 % of all err more than the rest.
/// Figures are those of all bodies: each of the sample's counts as many as it stands for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct RecomputedSample {
    /// Bodies behind the figures; those that failed are left out.
    pub bodies: usize,
    /// Bodies of the sample that failed.
    pub lost: usize,
    /// Bodies of the sample whose recomputation failed, so that their errors are not known.
    pub diverged: usize,
    /// Attitude error, rad.
    pub attitude: Quantiles,
    /// Error of the angular velocity in body axes, relative to its magnitude.
    pub angular_velocity: Quantiles,
    /// Error of the rotational kinetic energy, relative.
    pub kinetic_energy: Quantiles,
    /// Bodies behind the next two figures: those of `bodies` that translate and whose centres of mass could be recomputed.
    pub translating: usize,
    /// Error of the position of the centre of mass, m. It is 0 if positions have a closed form ([`crate::torque::force`]), which the run
    /// uses too. No target can be set for it.
    pub position: Quantiles,
    /// Error of the velocity of the centre of mass, m/s, likewise.
    pub velocity: Quantiles,
    /// The errors that were asked for; `None` where method and step were pinned.
    pub target: Option<Accuracy>,
    /// Bodies of the sample that exceed one of them.
    pub beyond: usize,
    /// The share of all bodies that do, estimated from the sample, 0 to 1.
    pub share_beyond: f64,
    /// The number of evenly drawn bodies that would say as much: the sample has more of the fastest and slowest bodies, each of which
    /// stands for fewer.
    pub effective: f64,
    /// Whether a random torque acts. The sample is then recomputed with the draws of the run's own steps, so that the errors do not include
    /// the effect of other draws with other steps.
    pub same_draws: bool,
    /// Whether the errors asked for are met, as far as the sample tells: no greater share of it exceeds one than the percentile leaves out.
    /// They are not met if a greater share does than chance explains in one of 20 samples (for 99 of 100 bodies, 5 of 192), if a body of the
    /// sample has failed, or more of all bodies than the percentile leaves out. `None` if this is not known: if a greater share exceeds
    /// them, but chance may explain it (2 to 4 of 192), if the sample is too small for the percentile (20 bodies for 99 %, 640 for 99.9 %; all
    /// of them for 100 %), without bodies, if some could not be recomputed, and if a random torque acts.
    pub met: Option<bool>,
}

impl std::fmt::Display for RecomputedSample {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.bodies {
            0 => write!(formatter, "attitude error not known")?,
            bodies => write!(formatter, "attitude error {} rad in {bodies} bodies", self.attitude)?,
        }
        match (self.met, &self.target) {
            (Some(true), Some(target)) => write!(formatter, ", as asked for ({target})"),
            (Some(false), Some(target)) => write!(formatter, ", NOT MET ({target})"),
            _ => Ok(()),
        }
    }
}

/// Records that a run continued on another engine after a fault of its device ([`crate::Engine::with_fallback`]).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
#[non_exhaustive]
pub struct FellBack {
    /// The output time from which it continued, s; 0 if there was none yet.
    pub time: f64,
    /// The fault, and the engine that continued.
    #[cfg_attr(feature = "study", serde(flatten))]
    pub fault: DeviceFault,
}

impl std::fmt::Display for FellBack {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let DeviceFault { adapter, reason, engine, .. } = &self.fault;
        write!(formatter, "from {} s on {engine}, after a fault of {adapter}: {reason}", self.time)
    }
}

/// A run's work and its trust figures.
#[derive(Clone, Debug, PartialEq)]
pub struct Trust {
    /// The engine that the run began on.
    pub engine: Description,
    /// The change to another engine; `None` if the first one did everything.
    pub fallback: Option<FellBack>,
    /// The integrator of the stepped bodies (of most of them, if there are several); if none is stepped, the one that would be used.
    pub method: Method,
    /// The arithmetic of the stepped bodies (of most of them, if it differs).
    pub precision: Precision,
    /// The longest step, s.
    pub longest_step: f64,
    /// Methods and arithmetic with the number of their bodies, most bodies first.
    pub parts: Vec<Part>,
    /// Steps of all bodies together.
    pub body_steps: u64,
    /// Adaptive steps; `None` if no body took any.
    pub adaptive: Option<AdaptiveWork>,
    /// Transfers between host and device, if the engine's other sessions are idle; all 0 on the CPU.
    pub traffic: Traffic,
    /// Drift at the end of what bodies conserve.
    pub drift: Drift,
    /// What remains of the changes of energy and angular momentum after the torques' contribution is subtracted.
    pub balance: Balance,
    /// Errors estimated from a sample of bodies.
    pub recomputed_sample: RecomputedSample,
    /// Errors of statistics and event times; `None` if none are asked for ([`crate::Scene::statistical_accuracy`]).
    pub statistics: Option<StatisticalSample>,
    /// Bodies that have failed, ascending: those of `failures`.
    pub failed_bodies: Vec<usize>,
    /// Why and when bodies failed, by body: those whose state or centre of mass was not finite at an output that was read, or for
    /// which a step reported failure.
    pub failures: Vec<FailedBody>,
    /// Bodies that turn further in a pinned step, at the start or at the end, than the method's usable region allows
    /// ([`crate::kernel::method::Properties::usable_angle`]); 0 if the library chose the step.
    pub outside_usable_region: usize,
    /// Wall time by phase.
    pub wall_time: WallTime,
}

impl std::fmt::Display for Trust {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            formatter,
            "{} on {}: {}, {}",
            listed(&self.parts),
            self.engine.name,
            self.recomputed_sample,
            self.drift
        )?;
        if let Some(fallback) = &self.fallback {
            write!(formatter, ", {fallback}")?;
        }
        if let Some(statistics) = &self.statistics {
            write!(formatter, ", {statistics}")?;
        }
        if self.balance.bodies > 0 {
            write!(formatter, ", {}", self.balance)?;
        }
        if self.outside_usable_region > 0 {
            let (count, method) = (self.outside_usable_region, self.method);
            let angle = method.properties().usable_angle;
            write!(formatter, ", {count} turn by more than {angle} rad a step, beyond the usable region of {method}")?;
        }
        write!(formatter, ", {} failed", self.failed_bodies.len())
    }
}

/// The states that a run was asked for, in memory, and its trust figures.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    snapshots: Vec<Snapshot>,
    statistics: Vec<Statistics>,
    histograms: Vec<Vec<HistogramCounts>>,
    by_cell: Vec<Vec<OfCell>>,
    events: Vec<EventRecord>,
    trust: Trust,
}

impl Record {
    pub(crate) fn new(memory: Memory, trust: Trust) -> Self {
        let Memory { snapshots, statistics, histograms, by_cell, events, .. } = memory;
        Self { snapshots, statistics, histograms, by_cell, events, trust }
    }

    /// All bodies at all output times, in order; the last one is the end. Empty if the scene keeps no states.
    pub fn snapshots(&self) -> &[Snapshot] {
        &self.snapshots
    }

    /// All bodies at the end.
    ///
    /// # Panics
    ///
    /// If the scene keeps no states ([`crate::Scene::without_states`]); otherwise a run records its end.
    pub fn final_state(&self) -> &Snapshot {
        let Some(last) = self.snapshots.last() else { panic!("the scene keeps no states: Scene::without_states") };
        last
    }

    /// The statistics at all output times, in order; empty if the scene asks for none.
    pub fn statistics(&self) -> &[Statistics] {
        &self.statistics
    }

    /// The histograms at all output times, in order: at each time those of the scene in their order; empty if it asks for none.
    pub fn histograms(&self) -> &[Vec<HistogramCounts>] {
        &self.histograms
    }

    /// Statistics and histograms of the bodies of each cell at all output times, in order: at each time those of all cells; empty if the scene
    /// does not ask for them ([`crate::Scene::by_cell`]).
    pub fn by_cell(&self) -> &[Vec<OfCell>] {
        &self.by_cell
    }

    /// The events, in the scene's order.
    pub fn events(&self) -> &[EventRecord] {
        &self.events
    }

    /// What was done, and its trust figures.
    pub fn trust(&self) -> &Trust {
        &self.trust
    }
}

/// Keeps every output in memory.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    pub(crate) keeps_states: bool,
    pub(crate) body_count: usize,
    pub(crate) snapshots: Vec<Snapshot>,
    pub(crate) statistics: Vec<Statistics>,
    pub(crate) histograms: Vec<Vec<HistogramCounts>>,
    pub(crate) by_cell: Vec<Vec<OfCell>>,
    pub(crate) events: Vec<EventRecord>,
}

impl Sink for Memory {
    fn wants(&mut self, _: usize, _: usize, _: f64) -> bool {
        self.keeps_states
    }

    fn statistics(&mut self, _: usize, statistics: &Statistics) -> Result<()> {
        self.statistics.push(statistics.clone());
        Ok(())
    }

    fn histograms(&mut self, _: usize, histograms: &[HistogramCounts]) -> Result<()> {
        self.histograms.push(histograms.to_vec());
        Ok(())
    }

    fn by_cell(&mut self, _: usize, cells: Vec<OfCell>) -> Result<()> {
        self.by_cell.push(cells);
        Ok(())
    }

    fn events(&mut self, events: Vec<EventRecord>) -> Result<()> {
        self.events = events;
        Ok(())
    }

    fn bodies(&mut self, _: usize, time: f64, first_body: usize, states: &[OutputState]) -> Result<()> {
        if first_body == 0 {
            self.snapshots.push(Snapshot::with_capacity(time, self.body_count));
        }
        self.snapshots.last_mut().into_iter().for_each(|snapshot| snapshot.extend(states));
        Ok(())
    }
}
