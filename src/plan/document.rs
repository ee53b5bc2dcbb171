//! `plan.json`: a plan in full, by which a run is repeated to the bit.
//!
//! A checksum tells a plan that was edited or cut off from one that a run wrote.
//!
//! The file holds what was chosen ([`Resolution`]) and the fingerprint of the scene that it was chosen for. Classes and skips are written
//! beside them for people; they follow from both and are not read back. Numbers are written with the digits that read back to the same
//! bits.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

use super::explain::ClassRow;
use super::pilot::Found;
use super::recomputation::Recomputation;
use super::resolution::{Resolution, Stepped};
use super::stratified::{PlannedSample, Stratified};
use super::times::Times;
use super::{Group, Plan, Rule, Scheme, TorqueSet, Treatment};
use crate::engine::Backend;
use crate::error::{Error, Result};
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::math::Spread;
use crate::plan::fingerprint::{Difference, SceneFingerprint};
use crate::scene::{Scene, Target};
use crate::study::text::read_text;

/// The version of the file's layout.
const FORMAT: u32 = 11;

/// The release that writes and reads plans.
const RELEASE: &str = env!("CARGO_PKG_VERSION");

/// A plan as it stands in `plan.json`.
#[derive(Clone, Debug)]
pub struct PlanDocument {
    path: PathBuf,
    text: String,
    file: PlanFile,
}

/// The keys with which every format begins.
#[derive(Deserialize)]
struct PlanHead {
    format: u32,
    polhode: String,
}

/// The file as it is read; with rows of classes and skips, as it is written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanFile<C = Value, S = Value> {
    format: u32,
    polhode: String,
    engine: String,
    scene: SceneFingerprint,
    /// The longest step of all bodies, s; infinite (`null`) where none is stepped.
    longest_step: Option<f64>,
    /// The times at which steps end because a formula of the time changes fast near them, s.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    breaks: Vec<f64>,
    /// Whether steps by series go beyond outputs, at which they are evaluated.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    dense_output: bool,
    resolution: Resolution,
    sample: SampleEntry,
    /// The checksum of all the rest ([`PlanFile::sum`]).
    sum: String,
    classes: C,
    skips: S,
}

/// The bodies that are recomputed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SampleEntry {
    count: usize,
    balances: bool,
    searched: f64,
    by_rk8: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    drawn: Option<DrawnEntry>,
}

/// The bodies if they are not drawn evenly: their numbers in one string, separated by spaces, as there may be thousands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct DrawnEntry {
    dearness: f64,
    bodies: String,
    weights: String,
}

impl SampleEntry {
    fn of(sample: &PlannedSample) -> Self {
        fn joined<T: ToString>(numbers: &[T]) -> String {
            numbers.iter().map(T::to_string).collect::<Vec<_>>().join(" ")
        }
        let entry = |Stratified { bodies, weights }: &Stratified| DrawnEntry {
            dearness: sample.dearness,
            bodies: joined(bodies),
            weights: joined(weights),
        };
        let Recomputation { bodies: count, balances, searched, by_rk8 } = sample.recomputation;
        Self { count, balances, searched, by_rk8, drawn: sample.drawn.as_ref().map(entry) }
    }

    /// The sample that the entry describes, of `all` bodies.
    fn sample(&self, all: usize) -> Result<PlannedSample, Refusal> {
        if self.count > all {
            let reason = format!("count = {}: expected at most the {all} bodies of the scene", self.count);
            return Err(Refusal { key: "count", entry: 0, reason });
        }
        if !(self.searched >= 0.0 && self.searched.is_finite()) {
            let reason = format!("searched = {:?}: expected a finite angle from 0 on (rad)", self.searched);
            return Err(Refusal { key: "searched", entry: 0, reason });
        }
        let &Self { count: bodies, balances, searched, by_rk8, .. } = self;
        let recomputation = Recomputation { bodies, balances, searched, by_rk8 };
        let drawn = self.drawn.as_ref().map(|entry| entry.drawn(all)).transpose()?;
        let dearness = self.drawn.as_ref().map_or(1.0, |entry| entry.dearness);
        Ok(PlannedSample { recomputation, dearness, drawn })
    }
}

impl DrawnEntry {
    /// The bodies that the entry names, of `all`.
    fn drawn(&self, all: usize) -> Result<Stratified, Refusal> {
        let refused = |key, expected: &str| Refusal { key, entry: 0, reason: format!("{key}: expected {expected}") };
        let bodies: Option<Vec<u32>> = self.bodies.split(' ').map(|body| body.parse().ok()).collect();
        let is_ascending = |bodies: &Vec<u32>| bodies.is_sorted_by(|a, b| a < b);
        let is_within = |bodies: &Vec<u32>| bodies.last().is_some_and(|&last| (last as usize) < all);
        let bodies = bodies.filter(is_ascending).filter(is_within);
        let bodies = bodies.ok_or_else(|| refused("bodies", "bodies of the scene in ascending order"))?;
        let weights: Option<Vec<f64>> = self.weights.split(' ').map(|weight| weight.parse().ok()).collect();
        let are_sound = |weights: &Vec<f64>| {
            weights.len() == bodies.len() && weights.iter().all(|weight| *weight > 0.0 && weight.is_finite())
        };
        let weights = weights.filter(are_sound);
        let weights = weights.ok_or_else(|| refused("weights", "a positive, finite number for each of the bodies"))?;
        if !(self.dearness >= 1.0 && self.dearness.is_finite()) {
            return Err(refused("dearness", "a finite number from 1 on"));
        }
        Ok(Stratified { bodies, weights })
    }
}

/// [`Stepped`] as one table.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SteppedEntry {
    torques: Vec<usize>,
    method: Scheme,
    coefficient: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    longest_angle: Option<f64>,
    attitude: f64,
    precision: Option<Precision>,
    part: f64,
    worst: Target,
    pilot_attitude: f64,
    pilot_bodies: usize,
    pilot_span: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pilot_steps: Option<Spread>,
}

impl From<Stepped> for SteppedEntry {
    fn from(Stepped { torques, found }: Stepped) -> Self {
        let rule = found.rule;
        Self {
            torques: torques.indices(),
            method: rule.scheme,
            coefficient: rule.coefficient,
            longest_angle: Some(rule.longest_angle).filter(|angle| angle.is_finite()),
            attitude: rule.attitude,
            precision: rule.precision,
            part: found.part,
            worst: found.worst,
            pilot_attitude: found.attitude,
            pilot_bodies: found.bodies,
            pilot_span: found.span,
            pilot_steps: found.steps,
        }
    }
}

impl TryFrom<SteppedEntry> for Stepped {
    type Error = &'static str;

    fn try_from(entry: SteppedEntry) -> Result<Self, Self::Error> {
        if !entry.torques.is_sorted_by(|a, b| a < b) {
            return Err("torques are not in ascending order");
        }
        let rule = Rule {
            scheme: entry.method,
            coefficient: entry.coefficient,
            longest_angle: entry.longest_angle.unwrap_or(f64::INFINITY),
            attitude: entry.attitude,
            precision: entry.precision,
        };
        let found = Found {
            rule,
            part: entry.part,
            worst: entry.worst,
            attitude: entry.pilot_attitude,
            bodies: entry.pilot_bodies,
            span: entry.pilot_span,
            steps: entry.pilot_steps,
        };
        Ok(Stepped { torques: TorqueSet::of_indices(entry.torques.iter().copied()), found })
    }
}

/// Reads and writes a value by its name.
macro_rules! by_name {
    ($type:ty, $key:literal, $named:expr) => {
        impl Serialize for $type {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.name())
            }
        }

        impl<'de> Deserialize<'de> for $type {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let name = String::deserialize(deserializer)?;
                $named(&*name)
                    .ok_or_else(|| serde::de::Error::custom(format!(concat!($key, " {:?} is not known"), name)))
            }
        }
    };
}

by_name!(Precision, "precision", |name| Precision::ALL.into_iter().find(|precision| precision.name() == name));
by_name!(Scheme, "method", Scheme::named);
by_name!(Method, "method", |name| {
    Method::ALL.into_iter().chain(Method::ADAPTIVE).find(|method| method.name() == name)
});

impl PlanDocument {
    /// Reads a plan file that a run wrote.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where it cannot be read; [`Error::PlanFormat`] where it is no plan of this release.
    pub fn read(path: &Path) -> Result<Self> {
        let text = read_text(path)?;
        Self::parse(path, &text)
    }

    /// Parses a plan from text; `path` is the name that messages give it.
    ///
    /// # Errors
    ///
    /// [`Error::PlanFormat`].
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let wrong = |line: usize, reason: String| Error::PlanFormat { path: path.to_owned(), line, reason };
        let fault = |error: serde_json::Error| wrong(error.line(), words_of(&error.to_string()));
        // The head is checked first: another format may hold anything.
        let head: PlanHead = serde_json::from_str(text).map_err(fault)?;
        let at = |key: &str| line_of(text, 0, key, 0);
        if head.format != FORMAT {
            return Err(wrong(at("format"), format!("its format is {}, this release reads {FORMAT}", head.format)));
        }
        if head.polhode != RELEASE {
            return Err(wrong(at("polhode"), format!("it is of polhode {}, this is {RELEASE}", head.polhode)));
        }
        let file: PlanFile = serde_json::from_str(text).map_err(fault)?;
        let document = Self { path: path.to_owned(), text: text.to_owned(), file };
        let start = text.find("\"resolution\"").unwrap_or(0);
        let refused = |Refusal { key, entry, reason }| wrong(line_of(text, start, key, entry), reason);
        document.file.check().map_err(refused)?;
        document.sample().map_err(refused)?;
        if document.file.sum != document.file.sum() {
            return Err(wrong(
                line_of(text, start, "sum", 0),
                "it is not as the run wrote it: its sum differs".to_owned(),
            ));
        }
        Ok(document)
    }

    /// The bodies that are recomputed.
    fn sample(&self) -> Result<PlannedSample, Refusal> {
        self.file.sample.sample(self.body_count())
    }

    /// The engine that the plan was made for ([`crate::engine::Description::name_of_arithmetic`]); another one may give other bits.
    pub fn engine(&self) -> &str {
        &self.file.engine
    }

    /// Whether the plan leaves out work that its scene does not need.
    pub fn may_skip(&self) -> bool {
        self.file.scene.skipping
    }

    /// The arithmetic that was asked for, where one was.
    pub fn wanted_precision(&self) -> Option<Precision> {
        self.file.scene.wanted_precision()
    }

    /// The text that was read.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Number of bodies of the scene.
    pub fn body_count(&self) -> usize {
        self.file.scene.bodies
    }

    /// Whether the plan was made for `scene`, or for the scene of which it is a part.
    pub(crate) fn is_for(&self, scene: &Scene) -> bool {
        Times::of(scene).is_ok_and(|times| self.difference(scene, times.outputs().len()).is_none())
    }

    /// The first respect in which `scene`, with so many outputs, differs from that of the plan.
    fn difference(&self, scene: &Scene, outputs: usize) -> Option<Difference> {
        let planned = self.file.scene.of_part(scene);
        let found = SceneFingerprint::of(scene, outputs).restricted_to(&planned, &self.file.scene);
        planned.first_difference(&found)
    }
}

/// What is wrong with a value of a resolution.
struct Refusal {
    key: &'static str,
    /// The entry of [`Resolution::Accuracy`] that holds it.
    entry: usize,
    reason: String,
}

/// The line, counted from 1, of the nth occurrence of a key after a position in the text; 1 if there is none.
fn line_of(text: &str, start: usize, key: &str, before: usize) -> usize {
    let found = text[start..].match_indices(&format!("\"{key}\":")).nth(before);
    found.map_or(1, |(place, _)| 1 + text[..start + place].matches('\n').count())
}

impl<C: Serialize, S: Serialize> PlanFile<C, S> {
    /// The checksum of everything else, in hexadecimal digits.
    fn sum(&self) -> String {
        let Self { format, polhode, engine, scene, longest_step, breaks, dense_output, .. } = self;
        let Self { resolution, sample, classes, skips, .. } = self;
        // Keys are fixed and values plain numbers and strings, so serialisation cannot fail. Rows have their keys in the same order as
        // those that were read back.
        let rows = [serde_json::to_value(classes), serde_json::to_value(skips)].map(Result::unwrap_or_default);
        let times = (longest_step, breaks, dense_output);
        let text = serde_json::to_string(&(format, polhode, engine, scene, times, resolution, sample, rows))
            .unwrap_or_default();
        format!("{:08x}", crc32fast::hash(text.as_bytes()))
    }
}

impl PlanFile {
    /// Refuses values that are wrong for every scene.
    fn check(&self) -> Result<(), Refusal> {
        let refused = |key: &'static str, entry: usize, value: f64, expected: &str| {
            Err(Refusal { key, entry, reason: format!("{key} = {value:?}: expected {expected}") })
        };
        let positive = |key: &'static str, value: Option<f64>| match value {
            Some(value) if !(value > 0.0 && value.is_finite()) => refused(key, 0, value, "a positive, finite number"),
            _ => Ok(()),
        };
        let not_negative = |key: &'static str, entry: usize, value: Option<f64>| match value {
            Some(value) if !(value >= 0.0 && value.is_finite()) => {
                refused(key, entry, value, "a finite number from 0 on")
            }
            _ => Ok(()),
        };
        let is_within = |time: &f64| *time > 0.0 && *time < self.scene.span;
        if !(self.breaks.iter().all(is_within) && self.breaks.is_sorted_by(|a, b| a < b)) {
            let reason = "breaks: expected times before the end in ascending order".to_owned();
            return Err(Refusal { key: "breaks", entry: 0, reason });
        }
        match &self.resolution {
            Resolution::Pinned { longest_step, .. } => positive("longest_step", Some(*longest_step)),
            Resolution::Adaptive { steps, .. } => {
                positive("tolerance", Some(steps.tolerance)).and_then(|()| positive("least_step", steps.least_step))
            }
            Resolution::Accuracy { uniform_rate, stepped, .. } => {
                not_negative("uniform_rate", 0, *uniform_rate)?;
                let count = self.scene.torques.len();
                stepped.iter().enumerate().try_for_each(|(entry, Stepped { torques, found: Found { rule, .. } })| {
                    not_negative("coefficient", entry, Some(rule.coefficient))?;
                    not_negative(
                        "longest_angle",
                        entry,
                        Some(rule.longest_angle).filter(|angle| *angle < f64::INFINITY),
                    )?;
                    let Some(index) = torques.indices().into_iter().find(|&index| index >= count) else {
                        return Ok(());
                    };
                    let reason = format!("torques holds {index}: the scene has {count} torques, counted from 0");
                    Err(Refusal { key: "torques", entry, reason })
                })
            }
        }
    }
}

impl<'a> Plan<'a> {
    /// The plan in full, as it stands in `plan.json`.
    pub fn to_json(&self) -> String {
        let explanation = self.explain();
        let limit = |x: f64| x.is_finite().then_some(x);
        let mut file: PlanFile<Vec<Value>, _> = PlanFile {
            format: FORMAT,
            polhode: RELEASE.to_owned(),
            engine: self.engine.name_of_arithmetic(),
            scene: SceneFingerprint::of(self.scene(), self.times().len()),
            longest_step: limit(self.longest_step()),
            breaks: self.breaks().to_vec(),
            dense_output: self.times.is_dense(),
            resolution: self.resolution().clone(),
            sample: SampleEntry::of(&self.sample),
            sum: String::new(),
            classes: explanation.classes.iter().map(without_seconds).collect(),
            skips: explanation.skips,
        };
        file.sum = file.sum();
        let mut text = serde_json::to_string_pretty(&file).unwrap_or_default();
        text.push('\n');
        text
    }

    /// The plan that `document` holds, for the scene that it was made for or a part of it ([`Scene::part_of`]); no pilot is run. On the
    /// same engine, a run gives the same bits.
    ///
    /// # Errors
    ///
    /// [`Error::PlanMismatch`] where the plan was made for another scene; otherwise as [`Plan::new`].
    pub fn repeated(scene: &'a Scene, engine: &dyn Backend, document: &PlanDocument) -> Result<Self> {
        let times = Self::checked(scene)?;
        if let Some(Difference { field, planned, found, remedy }) = document.difference(scene, times.outputs().len()) {
            let (path, planned, found) = (document.path.clone(), planned.into(), found.into());
            return Err(Error::PlanMismatch { path, field, planned, found, remedy });
        }
        let unknown = |Refusal { reason, .. }| Error::PlanFormat { path: document.path.clone(), line: 1, reason };
        let resolution = document.file.resolution.clone();
        let sample = document.sample().map_err(unknown)?;
        let mut times = times.with_breaks(document.file.breaks.clone());
        times.set_dense(document.file.dense_output);
        let plan = Self { sample, ..Self::resolved(scene, engine, resolution, times)? };
        // A plan made from the first bodies may lack a rule for the kind of a later one.
        let is_unknown = |group: &&Group| group.class.is_driven() && group.treatment == Treatment::RegularPrecession;
        if let Some(group) = plan.groups().iter().find(is_unknown) {
            let names = group.class.torques.of(scene.torques());
            let names: Vec<&str> = names.iter().map(|torque| torque.name()).collect();
            let names = names.join(", ");
            let reason = format!(
                "it has no rule for bodies on which these torques act together: {names}; make the plan from all bodies"
            );
            return Err(Error::PlanFormat { path: document.path.clone(), line: 1, reason });
        }
        // The longest step of the whole scene, which none of a part's bodies may take.
        Ok(Self { longest_step: document.file.longest_step.unwrap_or(f64::INFINITY), ..plan })
    }
}

/// A row without its expected wall time, which differs by machine: plans that choose the same have the same text.
fn without_seconds(row: &ClassRow) -> Value {
    let mut value = serde_json::to_value(row).unwrap_or_default();
    if let Some(entries) = value.as_object_mut() {
        entries.remove("seconds");
    }
    value
}

/// The parser's message without the position, which is reported separately.
fn words_of(error: &str) -> String {
    error.split(" at line ").next().unwrap_or(error).to_owned()
}
