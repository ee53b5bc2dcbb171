//! The files of a part of a study beside its tables, from which those of the whole are made.

use std::fs;
use std::ops::Range;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::column::{Layout, Named};
use super::failed::KnownTo;
use super::{Censored, EventErrors, EventOccurrence, EventRecord, EventTime, FailedBody, Gathered, Statistics};
use crate::bodies::{Blocks, Status};
use crate::error::{Error, Result};
use crate::kernel::observe::Partial;
use crate::plan::PlanDocument;
use crate::scene::Event;
use crate::study::text::read_text;
use crate::study::{Format, Study};

/// The file that describes a part.
pub(crate) const PART: &str = "part.json";

/// The data of a part's bodies from which statistics, quantiles and histograms are computed, one line for each output.
pub(crate) const BLOCKS: &str = "blocks.jsonl";

/// The events of a part's bodies, one entry for each event.
pub(crate) const EVENTS: &str = "part_events.json";

/// The keys of the texts of the study and of the plan in the metadata of files.
pub(crate) const STUDY_TEXT: &str = "polhode.study";
pub(crate) const PLAN_TEXT: &str = "polhode.plan";

/// The version of the layout of all three.
pub(crate) const FORMAT: u32 = 7;

/// The last key of [`PART`]: a CRC-32 of all the text before it, in eight hexadecimal digits.
const SUM: &str = ",\"sum\":\"";

/// An upper limit on the number of bodies of a run, which is counted in 32 bits.
const MOST_BODIES: usize = u32::MAX as usize;

/// An upper limit on exponents of two of any number or its square.
const MOST_EXPONENT: u32 = 1 << 13;

/// The contents of [`PART`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PartFile {
    pub format: u32,
    pub polhode: String,
    pub first_body: usize,
    pub bodies: usize,
    /// The number of bodies of all parts.
    pub body_count: usize,
    /// The columns of tables of states between `t` and `status`.
    pub columns: Vec<Named>,
    /// Number of cells of the study's design, if it has one.
    pub cells: Option<usize>,
    /// The metadata of the run, for files that carry them.
    pub metadata: Vec<(String, String)>,
    /// Output times, s.
    pub times: Vec<f64>,
    pub final_state: bool,
    pub snapshots: bool,
    /// Whether there is a table of initial states.
    pub initial: bool,
    pub output_format: String,
    /// How many bodies of all parts may fail.
    pub allowed_failures: u64,
    pub failures: Vec<FailureEntry>,
    pub files: Vec<FileEntry>,
}

/// A file of a part as it was written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FileEntry {
    pub name: String,
    pub bytes: u64,
    /// CRC-32, as in ZIP archives.
    pub checksum: u32,
}

/// A body that has failed ([`FailedBody`]), counted as in the whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FailureEntry {
    body: usize,
    reason: u8,
    time: f64,
    known_to_step: bool,
    last_good_time: f64,
    orientation: [f64; 4],
    angular_velocity_body: [f64; 3],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    cause: Option<String>,
}

impl From<&FailedBody> for FailureEntry {
    fn from(failed: &FailedBody) -> Self {
        Self {
            body: failed.body,
            reason: failed.reason.number(),
            time: failed.time,
            known_to_step: failed.known_to == KnownTo::Step,
            last_good_time: failed.last_good_time,
            orientation: failed.orientation.to_array(),
            angular_velocity_body: failed.angular_velocity_body.to_array(),
            cause: failed.cause.clone(),
        }
    }
}

impl From<&FailureEntry> for FailedBody {
    fn from(entry: &FailureEntry) -> Self {
        Self {
            body: entry.body,
            reason: Status::from_code(f64::from(entry.reason)),
            time: entry.time,
            known_to: if entry.known_to_step { KnownTo::Step } else { KnownTo::Output },
            last_good_time: entry.last_good_time,
            orientation: glam::DQuat::from_array(entry.orientation),
            angular_velocity_body: glam::DVec3::from_array(entry.angular_velocity_body),
            cause: entry.cause.clone(),
        }
    }
}

impl PartFile {
    pub fn to_json(&self) -> String {
        // Keys are fixed and values finite numbers and strings, so serialisation cannot fail.
        let text = serde_json::to_string(self).unwrap_or_default();
        let text = text.trim_end_matches('}');
        format!("{text}{SUM}{:08x}\"}}\n", crc32fast::hash(text.as_bytes()))
    }

    /// Reads the description in a part's folder.
    ///
    /// # Errors
    ///
    /// [`Error::File`]; [`Error::Table`] if it is of another release, is not as it was written, or contains values that no run writes.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(PART);
        let text = read_text(&path)?;
        let wrong = |reason: String| Error::Table { path: path.clone(), reason };
        let cut = |error: serde_json::Error| wrong(format!("expected what a run of a part writes: {error}"));
        if let Some(reason) = other_release(&text).map_err(cut)? {
            return Err(wrong(format!("{reason}: run the part again")));
        }
        let text = unsealed(&text).ok_or_else(|| wrong("it is not as its run wrote it: its sum differs".to_owned()))?;
        let part: Self = serde_json::from_str(&text).map_err(cut)?;
        match part.fault() {
            Some(what) => Err(wrong(format!("expected {what}, as a run of a part writes them"))),
            None => Ok(part),
        }
    }

    /// That a part's description is of another release, if it can be read so far.
    pub fn other_release(folder: &Path) -> Option<Error> {
        let path = folder.join(PART);
        let reason = other_release(&read_text(&path).ok()?).ok()??;
        Some(Error::Table { path, reason })
    }

    /// The same if its files are there and as long as they were written; their sums are compared where they are merged.
    pub fn with_files(self, folder: &Path) -> Result<Self> {
        let is_as_written = |file: &FileEntry| {
            fs::metadata(folder.join(&file.name)).is_ok_and(|found| found.is_file() && found.len() == file.bytes)
        };
        match self.files.iter().find(|file| !is_as_written(file)) {
            None => Ok(self),
            Some(file) => {
                let reason =
                    "it is missing, or not as long as the part wrote it: run the part again with --force".to_owned();
                Err(Error::Table { path: folder.join(&file.name), reason })
            }
        }
    }

    /// A fault that no run produces, whatever its study.
    fn fault(&self) -> Option<&'static str> {
        let is_in_order = |bodies: Option<usize>| bodies.is_some_and(|end| end <= self.body_count);
        let is_plain = |name: &str| Path::new(name).file_name().is_some_and(|plain| plain == name);
        let is_reason = |reason: u8| Status::ALL.iter().any(|status| !status.is_good() && status.number() == reason);
        let checks = [
            (
                self.bodies > 0
                    && self.body_count <= MOST_BODIES
                    && is_in_order(self.first_body.checked_add(self.bodies)),
                "some of all bodies",
            ),
            (!self.times.is_empty() && self.times.is_sorted_by(|a, b| a < b), "ascending times"),
            (self.cells.is_none_or(|cells| (1..=self.body_count).contains(&cells)), "no more cells than bodies"),
            (
                self.failures.iter().all(|failed| self.has(failed.body) && is_reason(failed.reason))
                    && self.failures.is_sorted_by(|a, b| a.body < b.body),
                "failed bodies of its own, each with a reason",
            ),
            (self.files.iter().all(|file| is_plain(&file.name)), "names of files beside it"),
        ];
        checks.into_iter().find(|(is_so, _)| !is_so).map(|(_, expected)| expected)
    }

    /// Whether a body, counted as in the whole, belongs to the part.
    fn has(&self, body: usize) -> bool {
        body.checked_sub(self.first_body).is_some_and(|own| own < self.bodies)
    }

    /// The tables that were asked for: those of the end, and those of all output times.
    pub fn tables(&self) -> (bool, bool) {
        (self.final_state, self.snapshots)
    }

    /// Their format; `None` for one that this build does not write.
    pub fn output_format(&self) -> Option<Format> {
        Format::ALL.iter().copied().find(|format| format.name() == self.output_format)
    }

    /// Its blocks, among those of the whole.
    fn blocks(&self) -> Range<usize> {
        let size = Blocks::of(self.body_count).size();
        self.first_body / size..(self.first_body + self.bodies).div_ceil(size)
    }

    /// The columns of tables of states between `t` and `status`.
    pub fn layout(&self) -> Layout {
        Layout::of_columns(self.columns.clone(), self.cells)
    }

    /// A text that the metadata hold.
    pub fn entry(&self, key: &str) -> Option<&str> {
        self.metadata.iter().find(|(name, _)| name == key).map(|(_, value)| value.as_str())
    }

    /// What a part has that does not follow a plan, or belong to a study, in words.
    pub fn mismatch(&self, plan: Option<&PlanDocument>, study: Option<&Study>) -> Option<&'static str> {
        if plan.is_some_and(|plan| self.entry(PLAN_TEXT) != Some(plan.text())) {
            return Some("it follows another plan");
        }
        study
            .is_some_and(|study| self.entry(STUDY_TEXT) != Some(study.text()))
            .then_some("it is of another text of the study")
    }

    /// The first difference, in words, in what parts of one run must share.
    pub fn difference(&self, other: &Self) -> Option<&'static str> {
        let same = [
            (self.entry(PLAN_TEXT) == other.entry(PLAN_TEXT), "the plan differs"),
            (self.body_count == other.body_count, "the number of bodies differs"),
            (self.times == other.times, "output times differ"),
            (self.tables() == other.tables() && self.output_format == other.output_format, "[output] differs"),
            (self.initial == other.initial, "output.initial differs"),
            (self.columns == other.columns, "output.columns differ"),
            (self.metadata == other.metadata, "the text of the study differs"),
            (self.allowed_failures == other.allowed_failures, "failures.allow differs"),
        ];
        same.into_iter().find(|(same, _)| !same).map(|(_, name)| name)
    }
}

/// The release of a part's description, if it is not this one.
fn other_release(text: &str) -> serde_json::Result<Option<String>> {
    #[derive(Deserialize)]
    struct Head {
        format: u32,
        polhode: String,
    }
    let head: Head = serde_json::from_str(text)?;
    let release = env!("CARGO_PKG_VERSION");
    let is_other = head.format != FORMAT || head.polhode != release;
    Ok(is_other.then(|| format!("it is of polhode {}, this is {release}", head.polhode)))
}

/// A text without its checksum; `None` if that differs or is missing.
fn unsealed(text: &str) -> Option<String> {
    let (before, after) = text.rsplit_once(SUM)?;
    let sum = after.strip_suffix("\"}\n")?;
    (sum == format!("{:08x}", crc32fast::hash(before.as_bytes()))).then(|| format!("{before}}}"))
}

/// The contents of a line of [`BLOCKS`]: a part's blocks at an output time.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BlocksLine {
    pub time: f64,
    /// Statistics formed where the states are, by block.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub blocks: Vec<Vec<Partial<f64>>>,
    /// What is computed from the states, with bodies counted as in the part.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gathered: Option<Gathered>,
}

impl BlocksLine {
    /// From a part; `first_body` is the index of its first body in the whole.
    pub fn of_blocks(time: f64, blocks: &[Vec<Partial<f64>>], first_body: usize) -> Self {
        let mut blocks = blocks.to_vec();
        for partial in blocks.iter_mut().flatten().filter(|partial| partial.count > 0) {
            partial.least.body += first_body as u32;
            partial.greatest.body += first_body as u32;
        }
        Self { time, blocks, gathered: None }
    }

    /// Whether a part can have written it at an output time.
    pub fn is_of(&self, part: &PartFile, time: f64) -> bool {
        let is_within =
            |index: usize| self.blocks.iter().map(|block| block[index].count as usize).sum::<usize>() <= part.bodies;
        let statistics = self.blocks.first().map_or(0, Vec::len);
        self.time == time
            && self.blocks.iter().flatten().all(|partial| is_of(partial, part))
            && self.blocks.iter().all(|block| block.len() == statistics)
            && (0..statistics).all(is_within)
            && self.gathered.as_ref().is_none_or(|gathered| gathered.is_of(part.bodies, &part.blocks()))
    }

    pub fn of_gathered(time: f64, gathered: Gathered) -> Self {
        Self { time, blocks: Vec::new(), gathered: Some(gathered) }
    }

    pub fn to_line(&self) -> String {
        // Keys are fixed and numbers finite, so serialisation cannot fail.
        serde_json::to_string(self).unwrap_or_default() + "\n"
    }
}

/// Whether statistics can be those of bodies of a part.
fn is_of(partial: &Partial<f64>, part: &PartFile) -> bool {
    let extremes = [partial.least, partial.greatest];
    let is_power = |exponent: i32| exponent.unsigned_abs() <= MOST_EXPONENT;
    partial.count == 0
        || (partial.faster <= partial.count
            && is_power(partial.exponent)
            && partial.squares >= 0.0
            && extremes.iter().all(|extreme| is_power(extreme.exponent) && part.has(extreme.body as usize)))
}

/// An event of a part's bodies: an entry of [`EVENTS`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct EventEntry {
    occurrences: Vec<OccurrenceEntry>,
    /// The bodies that failed without having had it, and when.
    censored: Vec<(usize, f64)>,
    /// The bodies that another event stopped before, and when.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    stopped: Vec<(usize, f64)>,
    errors: EventErrors,
}

/// The body, the time and how it is known, the orientation and the angular velocity.
type OccurrenceEntry = (usize, f64, u8, [f64; 4], [f64; 3]);

impl EventEntry {
    /// From a part; `first_body` is the index of its first body in the whole.
    pub fn new(record: &EventRecord, first_body: usize) -> Self {
        let occurrence = |found: &EventOccurrence| {
            let known_to = EventTime::ALL.iter().position(|known| *known == found.known_to).unwrap_or(0) as u8;
            let (orientation, velocity) = (found.orientation.to_array(), found.angular_velocity_body.to_array());
            (first_body + found.body, found.time, known_to, orientation, velocity)
        };
        let censored = |stopped: bool| {
            let own = record.censored.iter().filter(|censored| censored.stopped == stopped);
            own.map(|censored| (first_body + censored.body, censored.time)).collect()
        };
        Self {
            occurrences: record.occurrences.iter().map(occurrence).collect(),
            censored: censored(false),
            stopped: censored(true),
            errors: record.errors.clone(),
        }
    }

    /// Whether it can belong to bodies of a part: each has the event once, fails or is stopped, at a time of the run.
    pub fn is_of(&self, part: &PartFile) -> bool {
        let end = part.times.last().copied().unwrap_or_default();
        let EventErrors { bodies: sampled, compared, differing, unnoticed, searched, times } = &self.errors;
        let occurred = self.occurrences.iter().map(|&(body, time, ..)| (body, time));
        let all: Vec<(usize, f64)> = occurred.chain(self.censored.iter().chain(&self.stopped).copied()).collect();
        let mut bodies: Vec<usize> = all.iter().map(|&(body, _)| body).collect();
        bodies.sort_unstable();
        bodies.is_sorted_by(|a, b| a < b)
            && all.iter().all(|&(body, time)| part.has(body) && (0.0..=end).contains(&time))
            && compared.checked_add(*differing).is_some_and(|had| had <= *sampled)
            && *sampled <= part.bodies
            && *unnoticed <= compared + differing
            && times.len() <= compared + unnoticed
            && (0.0..=1.0).contains(searched)
            && times.iter().all(|error| *error >= 0.0)
    }

    /// The events of all parts together; `None` if one is not as it was written.
    pub fn merged(event: &Event, bodies: usize, parts: &[Self]) -> Option<EventRecord> {
        let occurrence = |&(body, time, known_to, orientation, velocity): &OccurrenceEntry| {
            Some(EventOccurrence {
                body,
                time,
                known_to: *EventTime::ALL.get(usize::from(known_to))?,
                orientation: glam::DQuat::from_array(orientation),
                angular_velocity_body: glam::DVec3::from_array(velocity),
            })
        };
        let found = parts.iter().flat_map(|part| &part.occurrences).map(occurrence);
        let mut occurrences = found.collect::<Option<Vec<_>>>()?;
        occurrences.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.body.cmp(&b.body)));
        let of = |stopped: bool| move |&(body, time): &(usize, f64)| Censored { body, time, stopped };
        let failed = parts.iter().flat_map(|part| &part.censored).map(of(false));
        let mut censored: Vec<Censored> =
            failed.chain(parts.iter().flat_map(|part| &part.stopped).map(of(true))).collect();
        censored.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.body.cmp(&b.body)));
        let errors = EventErrors::together(parts.iter().map(|part| part.errors.clone()));
        Some(EventRecord { event: event.clone(), bodies, occurrences, censored, errors })
    }
}

impl Statistics {
    /// The same with bodies counted as in the whole that they are a part of.
    pub(crate) fn counted_from(mut self, first_body: usize) -> Self {
        for summary in &mut self.summaries {
            summary.min_body = summary.min_body.map(|body| first_body + body);
            summary.max_body = summary.max_body.map(|body| first_body + body);
        }
        self
    }
}
