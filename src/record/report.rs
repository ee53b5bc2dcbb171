//! The contents of `report.json`.

use serde::Serialize;

use super::{AdaptiveWork, Balance, Drift, FailedBody, FellBack, RecomputedSample, Trust, WallTime};
use crate::bodies::Status;
use crate::bodies::ensemble::Repairs;
use crate::math::Quantiles;
use crate::plan::explain::ClassRow;
use crate::plan::{Part, Plan, Skip};
use crate::study::Study;

mod event_report;
mod statistical_report;
mod statistics_report;
mod summary;

pub use event_report::{EventReport, QuantityReport, StoppedReport};
pub use statistical_report::{StatisticErrorReport, StatisticalAccuracyReport};
pub use statistics_report::{StatisticsReport, SummaryReport, UndefinedReport};

/// The figures of a run, as in `report.json`; `docs/outputs.md` has its keys.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The study, if the run had one.
    pub study: Option<StudyReport>,
    /// Number of bodies.
    pub bodies: usize,
    /// Simulated time, s.
    pub span: f64,
    /// Number of output times.
    pub outputs: usize,
    /// Number of times between them at which events were checked; absent if there were none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub checks: Option<usize>,
    /// The engine that computed, or that the run began on.
    pub engine: EngineReport,
    /// The change to another engine after a fault of the device; absent if there was none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fallback: Option<FellBack>,
    /// What was computed.
    pub plan: PlanReport,
    /// Steps of all bodies together.
    pub body_steps: u64,
    /// Body-steps per second of integration; 0 if nothing was integrated.
    pub body_steps_per_second: f64,
    /// Bytes that were read back from the device; 0 on the CPU.
    pub bytes_read: u64,
    /// Bytes that were written to the device.
    pub bytes_written: u64,
    /// How often the host waited for the device.
    pub device_waits: u64,
    /// Dispatches of kernels on the device.
    pub dispatches: u64,
    /// Pipelines made since the plan, compiled or taken from `--device-cache`.
    pub pipelines: u64,
    /// Adaptive steps; `null` if no body took any.
    pub adaptive: Option<AdaptiveWork>,
    /// Wall time by phase.
    pub wall_time: WallTimeReport,
    /// Inertia tensors that were repaired before the run, if the study asks for that.
    pub repairs: Option<Repairs>,
    /// The quantities behind statistics, histograms and events; empty if the study asks for none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub quantities: Vec<QuantityReport>,
    /// Statistics at the end; `null` if the study asks for none.
    pub statistics: Option<StatisticsReport>,
    /// Events; empty if the study asks for none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub events: Vec<EventReport>,
    /// Bodies that events have stopped; absent if no event stops any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stopped: Option<StoppedReport>,
    /// Drift of what bodies conserve, from start to end; figures without bodies are `null`.
    pub drift: Drift,
    /// Changes of energy and angular momentum compared with what the torques contribute; `null` if none acts.
    pub balance: Option<BalanceReport>,
    /// Errors at the end.
    pub accuracy: AccuracyReport,
    /// Errors of statistics and event times; absent if none are asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub statistical_accuracy: Option<StatisticalAccuracyReport>,
    /// Bodies that have failed, ascending; `failed.csv` (or `.npz`, `.parquet`) has a row for each.
    pub failed_bodies: Vec<usize>,
    /// How many of them failed for which reason; empty if none has.
    pub failures: Vec<FailureReport>,
    /// How many bodies turn further in a pinned step than the method's usable region allows.
    pub outside_usable_region: usize,
    /// Files beside this one.
    pub files: Vec<String>,
    /// Versions of the software behind the results.
    pub versions: Versions,
}

/// The study that was run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StudyReport {
    /// The file as named by the caller.
    pub file: String,
    /// Its title.
    pub title: Option<String>,
    /// The seed of its draws.
    pub seed: u64,
    /// The CRC-32 of its text, in hexadecimal digits.
    pub sum: String,
    /// The axes that it sweeps over, in the order of the columns of `cells`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sweep: Vec<AxisReport>,
    /// The number of its cells; `None` without a sweep.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<usize>,
    /// Whether statistics and histograms of each cell are formed; `None` without a sweep, or where the study asks for none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub by_cell: Option<bool>,
}

/// An axis of a sweep.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct AxisReport {
    /// Its name.
    pub name: String,
    /// The SI unit of its values; `null` if the study gives none.
    pub unit: Option<String>,
}

impl StudyReport {
    /// From a study that was read.
    pub fn of(study: &Study) -> Self {
        let title = study.title().map(str::to_owned);
        let axes = study.design().map(|design| design.axes()).unwrap_or_default();
        let sweep = axes.iter().map(|axis| AxisReport { name: axis.name().to_owned(), unit: axis.si_unit() }).collect();
        let sum = format!("{:08x}", crc32fast::hash(study.text().as_bytes()));
        let (cells, by_cell) = (study.design().map(|design| design.cells()), study.forms_by_cell());
        Self { file: study.file().display().to_string(), title, seed: study.seed(), sum, sweep, cells, by_cell }
    }
}

/// The engine that computed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EngineReport {
    /// `gpu` or `cpu`.
    pub kind: &'static str,
    /// Adapter, or lanes and threads.
    pub adapter: String,
    /// Driver and version; empty on the CPU.
    pub driver: String,
    /// Whether the GPU is emulated by a software adapter.
    pub software: bool,
    /// What ran on the CPU beside a GPU, and why; `null` if nothing did.
    pub on_host: Option<String>,
}

/// What was computed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlanReport {
    /// Integrators, `closed form` and `rotation`, those that occur, joined by ` + `, that of most bodies first;
    /// empty if there are no bodies.
    pub method: String,
    /// The arithmetic, likewise: `f32 + f64` if both occur.
    pub precision: String,
    /// How many bodies each of them brings to their output times.
    pub parts: Vec<Part>,
    /// The longest equal step, s; 0 if no body takes equal steps.
    pub longest_step: f64,
    /// The most equal steps of a body; 0 if none takes them.
    pub steps: u64,
    /// What runs for which bodies.
    pub classes: Vec<ClassRow>,
    /// What is left out, and why that is safe.
    pub skips: Vec<Skip>,
}

/// Bodies that have failed for one reason.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FailureReport {
    /// The number in the column `status` of tables ([`Status`]).
    pub status: u8,
    /// Its word in the column `reason` of the table `failed`.
    pub reason: &'static str,
    /// The reason in words.
    pub meaning: String,
    /// How many bodies.
    pub bodies: usize,
    /// For the first of them for which it is known, the formula that gave no finite number, and what it reads there
    /// ([`FailedBody::cause`]).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cause: Option<String>,
}

impl FailureReport {
    /// One entry for each reason that occurs.
    pub(crate) fn of(failures: &[FailedBody]) -> Vec<Self> {
        let of_reason = |reason: &Status| Self {
            status: reason.number(),
            reason: reason.name(),
            meaning: reason.to_string(),
            bodies: failures.iter().filter(|failed| failed.reason == *reason).count(),
            cause: failures
                .iter()
                .filter(|failed| failed.reason == *reason)
                .find_map(|failed| Some(format!("body {}: {}", failed.body, failed.cause.as_deref()?))),
        };
        Status::ALL.iter().map(of_reason).filter(|report| report.bodies > 0).collect()
    }
}

/// Errors at the end.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AccuracyReport {
    /// The recomputed sample; figures without bodies are `null`.
    #[serde(flatten)]
    pub sample: RecomputedSample,
    /// Bodies of the whole run that have failed; the percentile may leave out some.
    pub failed: usize,
}

impl AccuracyReport {
    /// The report for a run in which `failed` bodies have failed.
    pub(crate) fn of(sample: &RecomputedSample, failed: usize) -> Self {
        let mut sample = *sample;
        null_without(sample.bodies, [&mut sample.attitude, &mut sample.angular_velocity, &mut sample.kinetic_energy]);
        null_without(sample.translating, [&mut sample.position, &mut sample.velocity]);
        Self { sample, failed }
    }
}

/// Wall time by phase, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct WallTimeReport {
    /// Reading the study and drawing the bodies.
    pub study: f64,
    /// Choosing methods and steps.
    pub plan: f64,
    /// The run itself; passing states to the sink is in `format` and `disk`.
    #[serde(flatten)]
    pub run: WallTime,
    /// Formatting numbers as text or bytes.
    pub format: f64,
    /// Passing bytes to the file system.
    pub disk: f64,
    /// From the study to the last file.
    pub total: f64,
}

/// The differences between the changes of energy and angular momentum and what the torques account for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BalanceReport {
    /// Driven bodies of the recomputed sample, behind the next two figures, at most 8 unless torques are random or sampled.
    pub bodies: usize,
    /// Whether the run and the recomputed sample have parted by more than 0.1 rad in half of the bodies or more. The torques' work is taken
    /// along the recomputed paths: the next two figures then show the distance of the paths, and nothing of the run's energy.
    pub parted: bool,
    /// |T − T₀ − W|, W the work of the torques, relative to the greatest kinetic energy during the motion.
    pub energy: Quantiles,
    /// |L − L₀ − ∫ R τ dt| in world axes, relative to the greatest |L| during the motion.
    pub angular_momentum_world: Quantiles,
    /// Bodies whose final state was read and whose torques all have a potential.
    pub conservative_bodies: usize,
    /// The change of kinetic plus potential energy of those, relative to the greater of T + |U| at the start and at the end;
    /// `null` if there are none.
    pub total_energy: Option<Quantiles>,
}

/// Versions of the software behind the results.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Versions {
    /// This crate.
    pub polhode: &'static str,
    /// The graphics library.
    pub wgpu: &'static str,
    /// Operating system and processor.
    pub platform: String,
}

impl Versions {
    /// Those of this build.
    pub(crate) fn here() -> Self {
        let platform = format!("{} {}", std::env::consts::OS, std::env::consts::ARCH);
        Self { polhode: env!("CARGO_PKG_VERSION"), wgpu: WGPU_VERSION, platform }
    }
}

/// The release of wgpu that this crate is built with; a test compares it with the lock file.
pub const WGPU_VERSION: &str = "30.0.1";

/// Replaces figures that no body is behind by NaN, which is `null` in `report.json`.
fn null_without<'q>(bodies: usize, all: impl IntoIterator<Item = &'q mut Quantiles>) {
    if bodies == 0 {
        all.into_iter().for_each(|figures| *figures = Quantiles::UNKNOWN);
    }
}

/// The attitude error, rad, beyond which the work of torques along a recomputed path is not that along the run's.
const PARTED: f64 = 0.1;

impl BalanceReport {
    /// `attitude`: the median attitude error of the recomputed sample, rad.
    fn of(balance: &Balance, attitude: f64) -> Option<Self> {
        let conservative_bodies = balance.conservative_bodies;
        let Balance { bodies, mut energy, mut angular_momentum_world, .. } = *balance;
        null_without(bodies, [&mut energy, &mut angular_momentum_world]);
        (bodies > 0 || conservative_bodies > 0).then(|| Self {
            bodies,
            parted: attitude > PARTED,
            energy,
            angular_momentum_world,
            conservative_bodies,
            total_energy: (conservative_bodies > 0).then_some(balance.total_energy),
        })
    }
}

impl Report {
    /// The report of a run of `plan` with these trust figures. The caller adds statistics, the names of files, and the wall times outside
    /// planning and run.
    pub fn new(study: Option<StudyReport>, plan: &Plan<'_>, trust: Trust) -> Self {
        let compute = trust.wall_time.compute;
        let explanation = plan.explain();
        let rate = trust.body_steps as f64 / compute;
        let mut drift = trust.drift;
        null_without(drift.bodies, [&mut drift.norm]);
        null_without(drift.kinetic_energy_bodies, [&mut drift.kinetic_energy]);
        null_without(drift.angular_momentum_bodies, [&mut drift.angular_momentum_world]);
        Self {
            study,
            bodies: plan.scene().ensemble().len(),
            span: plan.scene().end(),
            outputs: plan.times().len(),
            checks: plan.checks(),
            engine: EngineReport {
                kind: trust.engine.kind.name(),
                adapter: trust.engine.name,
                driver: trust.engine.driver,
                software: trust.engine.software,
                on_host: trust.engine.on_host,
            },
            fallback: trust.fallback,
            plan: PlanReport {
                method: names(trust.parts.iter().map(|part| part.method)),
                precision: names(trust.parts.iter().map(|part| part.precision.name())),
                parts: trust.parts,
                longest_step: plan.longest_equal_step(),
                steps: plan.steps(),
                classes: explanation.classes,
                skips: explanation.skips,
            },
            body_steps: trust.body_steps,
            adaptive: trust.adaptive,
            bytes_read: trust.traffic.bytes_read,
            bytes_written: trust.traffic.bytes_written,
            device_waits: trust.traffic.waits,
            dispatches: trust.traffic.dispatches,
            pipelines: trust.traffic.pipelines,
            body_steps_per_second: if trust.body_steps > 0 && rate.is_finite() { rate } else { 0.0 },
            wall_time: WallTimeReport {
                plan: plan.planning_time().as_secs_f64(),
                run: trust.wall_time,
                ..WallTimeReport::default()
            },
            repairs: plan.scene().ensemble().repairs(),
            quantities: QuantityReport::of(plan.scene().observed()),
            statistics: None,
            events: Vec::new(),
            stopped: None,
            drift,
            balance: BalanceReport::of(&trust.balance, trust.recomputed_sample.attitude.median),
            accuracy: AccuracyReport::of(&trust.recomputed_sample, trust.failures.len()),
            statistical_accuracy: trust.statistics.map(StatisticalAccuracyReport::from),
            outside_usable_region: trust.outside_usable_region,
            failures: FailureReport::of(&trust.failures),
            failed_bodies: trust.failed_bodies,
            files: Vec::new(),
            versions: Versions::here(),
        }
    }
}

/// Each name once, in the order of first occurrence.
fn names<'n>(all: impl Iterator<Item = &'n str>) -> String {
    let mut names: Vec<&str> = Vec::new();
    for name in all {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names.join(" + ")
}

impl Report {
    /// The report as JSON; a number that is not finite becomes `null`.
    pub fn to_json(&self) -> String {
        // Keys are fixed and values plain numbers and strings, so serialisation cannot fail.
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }
}
