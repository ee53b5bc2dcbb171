//! Studies: scenes described in files, and ensembles drawn from distributions.
//!
//! # Study files
//!
//! A study is a TOML file. Numbers are in SI units, or texts with a unit: `"30 deg"`, `"2 rpm"`, `"7000 km"` ([`mod@unit`]). Only `[bodies]`
//! and `[time]` are required.
//!
//! ```toml
//! title = "Tumbling upper stages"     # for reports
//! seed = 42                           # default 0; the same seed gives the same bodies, on every machine
//!
//! [bodies]
//! count = 1000                        # or: file = "bodies.csv", a table of bodies beside the study
//! inertia = { shape = "cylinder", mass = 1400.0, radius = 1.2, height = 6.5 }
//! orientation = { distribution = "uniform" }
//! angular_velocity = { distribution = "normal", mean = [0, 0, 0.1], sigma = [0.02, 0.02, 0.05] }
//!
//! [time]
//! end = 600.0
//! outputs = { every = 60.0 }          # or { times = [0.1, 1.0] }; none: the end only; start = true: the start too
//!
//! [accuracy]
//! attitude = 1e-6                     # rad; or: method = "rk4", dt = 0.01, precision = "f32"
//! energy = 1e-9                       # relative, beside the attitude; so is angular_velocity
//! percentile = 99                     # of the bodies, the default
//!                                     # or: mean = 1e-3, quantile = 1e-3, event_time = 1e-3, of what is asked of all bodies together
//!                                     # or: method = "rk8" or "taylor", tolerance = 1e-9 and, where wanted, least_step = 1e-6
//!                                     # or: method = "rk8", dt = 0.01, projection = true, for free bodies near the separatrix
//!
//! [output]
//! initial = true                      # initial.csv: moments, states and what was drawn of all bodies at t = 0
//! final = true                        # final.csv: all bodies at the end (the default)
//! snapshots = true                    # snapshots.csv: all bodies at all output times
//! statistics = ["kinetic_energy", "spin_rate"]   # statistics.csv: over all bodies at all output times
//! format = "csv"                      # or "npz", "parquet"
//! ```
//!
//! `polhode run --help` has all keys and the columns of all tables. What they mean is described
//!
//! * below: units, bodies, distributions, torques and forces, orbits, sweeps ([`mod@unit`], [`distribution`], [`sweep`], [`table`]);
//!   [`crate::bodies::inertia::Shape`] has the shapes with their axes, [`crate::bodies::inertia::scattered_moments`] those with a `scatter`;
//! * in [`crate::torque`], with its equation, for each `model` of a `[[torque]]`; in [`crate::torque::force`] for a `[[force]]`, in
//!   [`crate::torque::control`] for sampled torques, in [`crate::torque::orbit::drift`] for an orbit with `j2`, in `docs/custom-torques.md`
//!   for formulas;
//! * in `docs/questions.md`: `statistics`, `quantiles`, `[[quantity]]`, `[[histogram]]`, `[[event]]` and the errors asked for them, as
//!   [`Quantity`], [`Quantity::may_be_undefined`], [`Condition`], [`Event`], [`StatisticalAccuracy`] and
//!   [`EventRecord`](crate::record::EventRecord) do;
//! * in [`Status`] and [`KnownTo`](crate::record::KnownTo): why bodies fail, and how well it is known when; where only statistics leave the
//!   device, failures are looked for at the end;
//! * in [`Checkpoint`](crate::run::Checkpoint): `[checkpoint]`.
//!
//! Every draw is a function of seed, body and column only ([`draw`]), so a study with fewer bodies contains the first bodies of a larger
//! one.
//!
#![doc = include_str!("../../docs/inputs.md")]

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

#[cfg(doc)]
use crate::bodies::Status;
#[cfg(doc)]
use crate::error::Error;
use crate::error::InputError;
use crate::error::InputFault;
use crate::error::Result;
use crate::math::Precision;
#[cfg(doc)]
use crate::scene::{Condition, Event, Quantity, StatisticalAccuracy};
use crate::scene::{Outputs, Part};

mod accumulated;
mod accuracy;
mod bodies;
pub(crate) mod checksum;
mod context;
mod custom;
pub mod distribution;
pub mod draw;
mod euler;
mod force;
mod inertia;
mod location;
mod mass_file;
mod models;
pub(crate) mod observed;
mod orbit;
mod output;
mod parameter;
#[cfg(feature = "parquet")]
pub(crate) mod parquet_reader;
#[cfg(feature = "parquet")]
pub(crate) mod parquet_sums;
mod parts;
mod points;
pub mod problem;
mod reader;
mod rows;
mod scene;
mod shape_kind;
mod solid;
pub mod sweep;
pub mod table;
pub(crate) mod text;
mod time;
mod torque;
pub mod unit;

pub use bodies::Bodies;
pub use distribution::{AngularVelocity, Orientation, Scalar, Vector};
pub use inertia::Inertia;
pub use mass_file::{CLASS_TOLERANCE, MassFileOptions, MassReport, TensorAbout};
pub use models::{describe_models, models_table};
pub use output::{Format, Output, OutputColumn};
pub use points::read_points;
pub use solid::Solid;
pub use sweep::Design;
pub use table::BodyTable;
pub use unit::describe_units;

use accuracy::{StudyAccuracy, accuracy};
use bodies::check_carried;
use distribution::Correlated;
use draw::Draw;
use force::StudyForce;
use observed::StudyObserved;
use reader::{FileText, Node, Place, Table, texts};
use text::read_text;
use time::{StudyTime, refuse_checks, time};
use torque::StudyTorque;

/// The keys of a study.
const KEYS: [&str; 17] = [
    "title",
    "seed",
    "bodies",
    "torque",
    "force",
    "time",
    "accuracy",
    "output",
    "failures",
    "checkpoint",
    "quantity",
    "histogram",
    "event",
    "sweep",
    "design",
    "correlated",
    "orbit",
];

/// The attitude error, rad, asked for if a study sets none.
pub(crate) const DEFAULT_ATTITUDE: f64 = 1e-6;

/// A study that was read from a file.
///
/// ```
/// use std::path::Path;
///
/// use polhode::study::Study;
/// use polhode::{Engine, Plan};
///
/// let text = "
///     [bodies]
///     count = 3
///     inertia = [1.0, 2.0, 2.5]
///     angular_velocity = { distribution = 'direction', magnitude = 0.1 }
///     [time]
///     end = 10.0
/// ";
/// let study = Study::parse(Path::new("study.toml"), text)?;
/// let scene = study.scene()?;
/// let engine = Engine::cpu();
/// let record = engine.run(&Plan::new(&scene, &engine)?)?;
/// assert_eq!(record.final_state().len(), 3);
/// # Ok::<(), polhode::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Study {
    file: PathBuf,
    text: Arc<str>,
    /// The place of every key, for messages about values that are found to be wrong later.
    places: BTreeMap<String, Place>,
    title: Option<String>,
    seed: u64,
    design: Option<Arc<Design>>,
    bodies: Bodies,
    /// The place of the bodies in the study as it was read.
    part: Part,
    torques: Vec<StudyTorque>,
    forces: Vec<StudyForce>,
    end: f64,
    outputs: Outputs,
    accuracy: StudyAccuracy,
    output: Output,
    starts: bool,
    /// The time between two checks for events, s, beside those at outputs.
    checks: Option<f64>,
    observed: StudyObserved,
    failures: u64,
    checkpoint: Option<Duration>,
}

impl Study {
    /// Reads a study file, and the table of bodies that it names.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where a file cannot be read; [`Error::Input`] with file, line, key and value where it does not
    /// describe a study.
    pub fn read(file: &Path) -> Result<Self> {
        let text = read_text(file)?;
        Self::parse(file, &text)
    }

    /// Reads a study from its text; `file` is its name in messages, and tables of bodies are searched beside it.
    ///
    /// # Errors
    ///
    /// As [`Study::read`].
    pub fn parse(file: &Path, text: &str) -> Result<Self> {
        FileText::new(file, text).parse(|root| Self::from_root(file, text, &root))
    }

    fn from_root(file: &Path, text: &str, root: &Table<'_>) -> Result<Self> {
        root.only(&KEYS)?;
        let mut places = BTreeMap::new();
        root.places(&mut places);

        let title = root.find("title").map(|node| node.string("expected a text")).transpose()?.map(str::to_owned);
        let TorquesOfStudy { seed, design, torques } = torques(root)?;
        let mut columns = BTreeSet::new();
        torques.iter().for_each(|torque| torque.columns(&mut columns));
        let forces = root.find("force").map(|node| force::read(&node)).transpose()?.unwrap_or_default();
        forces.iter().for_each(|force| force.columns(&mut columns));
        let described = root.need("bodies", "expected a table that describes the bodies")?;
        let initial = root.find("output").and_then(|output| output.any_table()?.find("initial"));
        let is_initial_wanted =
            initial.map(|node| node.boolean("expected true or false")).transpose()?.unwrap_or(false);
        let bodies = Bodies::read(&described, is_initial_wanted, |name, carried| {
            let folder = file.parent().unwrap_or(Path::new(""));
            BodyTable::read_with(&folder.join(name), usize::MAX, &columns, carried)
        })?;
        if bodies.inertia.as_ref().is_some_and(Inertia::is_about_the_centre)
            && let Some(model) = torques.iter().find_map(StudyTorque::pivot)
            && let Some(inertia) = described.any_table().and_then(|table| table.find("inertia"))
        {
            return Err(inertia.refuse(format!(
                "{model} turns bodies about a pivot, and this is the tensor about the centre of mass: add \
                 about = [x, y, z], the pivot in body axes from the centre of mass (m)"
            )));
        }
        if bodies.table.is_none()
            && let Some(name) = columns.first()
        {
            let expected = "torques or forces read columns of the table of bodies: name its file here";
            let key = format!("bodies.file (column {name})");
            let line = places.get("bodies").map_or(1, |place| place.line);
            return Err(InputError {
                file: file.to_owned(),
                line,
                key,
                fault: InputFault::Missing { expected: expected.into() },
            }
            .into());
        }
        let time_node = root.need("time", "expected a table with the end of the simulated span")?;
        let StudyTime { end, outputs, starts, checks } = time(&time_node)?;
        let accuracy = root.find("accuracy").map(|node| accuracy(&node)).transpose()?.unwrap_or_default();
        if let Some(design) = &design {
            design.check_use(root)?;
        }
        let output_table = root.find("output").map(|node| output::table(&node)).transpose()?;
        let cells = design.as_ref().map(|design| design.cells());
        let observed = StudyObserved::read(root, output_table.as_ref(), &torques, cells)?;
        if checks.is_some() && !observed.has_events() {
            return Err(refuse_checks(&time_node));
        }
        check_orbit_use(root)?;
        let translates = bodies.translates() || !forces.is_empty();
        check_carried(&described, translates)?;
        let output = output_table.as_ref().map(|table| output::read(table, &observed, translates)).transpose()?;
        let failures = root.find("failures").map(|node| failures(&node)).transpose()?.unwrap_or(0);
        let checkpoint = root.find("checkpoint").map(|node| checkpoint(&node)).transpose()?;
        let output = output.unwrap_or_default();
        Ok(Self {
            file: file.to_owned(),
            text: text.into(),
            places,
            title,
            seed,
            part: Part { first_body: 0, of: bodies.count },
            design,
            bodies,
            torques,
            forces,
            end,
            outputs,
            starts,
            checks,
            accuracy,
            output,
            observed,
            failures,
            checkpoint,
        })
    }

    /// The file's name as it was given.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Whether an existing file is the study's own, or one that it names, such as its table of bodies or a mesh.
    pub fn names_file(&self, file: &Path) -> bool {
        let Ok(file) = file.canonicalize() else { return false };
        let beside = self.file.parent().unwrap_or(Path::new(""));
        let named = texts(&self.text).into_iter().map(|name| beside.join(name));
        named.chain([self.file.clone()]).any(|named| named.canonicalize().is_ok_and(|named| named == file))
    }

    /// The title, if the study has one.
    pub fn title(&self) -> Option<&str> {
        self.title.as_deref()
    }

    /// The seed of all draws.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Whether statistics and histograms are formed of each cell of a sweep too; `None` without a sweep, or where the study asks for none.
    pub(crate) fn forms_by_cell(&self) -> Option<bool> {
        self.design.as_ref().and_then(|_| self.observed.forms_by_cell())
    }

    /// The design, if the study sweeps over parameters.
    pub fn design(&self) -> Option<&Arc<Design>> {
        self.design.as_ref()
    }

    /// The draws of the study.
    pub(crate) fn draw(&self) -> Draw {
        let common = self.design.as_ref().filter(|design| design.has_common_draws());
        let draw = Draw::new(self.seed).counted_from(self.part.first_body);
        draw.common_to(common.map_or(1, |design| design.cells()))
    }

    /// The bodies, not yet drawn.
    pub fn bodies(&self) -> &Bodies {
        &self.bodies
    }

    /// The text of the file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Which files a run writes.
    pub fn output(&self) -> &Output {
        &self.output
    }

    /// How many bodies may fail in a run that counts as successful.
    pub fn allowed_failures(&self) -> u64 {
        self.failures
    }

    /// The approximate time of a run between checkpoints, if the study asks for any.
    pub fn checkpoint(&self) -> Option<Duration> {
        self.checkpoint
    }

    /// The same study with the first `most` of its bodies.
    #[must_use]
    pub fn truncated(self, most: usize) -> Self {
        let mut first = self.part(0..most);
        first.part.of = first.bodies.count;
        first
    }

    /// A part of the study: the bodies of a range. They are drawn, move and are counted as in the whole; no other bodies are
    /// drawn.
    #[must_use]
    pub fn part(mut self, bodies: Range<usize>) -> Self {
        let end = bodies.end.min(self.bodies.count);
        let bodies = bodies.start.min(end)..end;
        self.part.first_body += bodies.start;
        self.bodies = self.bodies.part(&bodies);
        self
    }

    /// The same study in this arithmetic, whatever the file says.
    #[must_use]
    pub fn with_precision(mut self, wanted: Precision) -> Self {
        self.accuracy.precision = Some(wanted);
        self
    }
}

/// The torques of a study, and what their values depend on.
pub(super) struct TorquesOfStudy {
    seed: u64,
    design: Option<Arc<Design>>,
    torques: Vec<StudyTorque>,
}

/// Reads the torques, with the seed, the sweeps, the correlated draws and the orbit that they may refer to.
fn torques(root: &Table<'_>) -> Result<TorquesOfStudy> {
    let seed = root
        .find("seed")
        .map(|node| node.whole("expected a whole number that is not negative"))
        .transpose()?
        .unwrap_or(0);
    let design = Design::read(root, Draw::new(seed))?.map(Arc::new);
    design.iter().for_each(|design| root.context().set_design(design.clone()));
    root.context().set_correlated(Correlated::read_all(root)?);
    let orbit = root.find(torque::ORBIT);
    if let Some(orbit) = &orbit {
        root.context().set_orbit(torque::orbit_of_study(orbit)?);
    }
    let mut torques = root.find("torque").map(|node| torque::read(&node)).transpose()?.unwrap_or_default();
    torques.extend(accumulated::read(root, torques.len())?);
    Ok(TorquesOfStudy { seed, design, torques })
}

/// Refuses an orbit that nothing in the study needs.
fn check_orbit_use(root: &Table<'_>) -> Result<()> {
    const UNUSED: &str = "no torque takes this orbit, and no formula reads orbit_position or orbit_velocity: expected one that does, and states \
                          no orbit of its own";
    let is_used = root.context().is_orbit_used();
    root.find(torque::ORBIT).filter(|_| !is_used).map_or(Ok(()), |orbit| Err(orbit.refuse(UNUSED)))
}

fn checkpoint(node: &Node<'_>) -> Result<Duration> {
    const EXPECTED: &str =
        "expected { every = \"10 min\" }: about how long a run may take from one checkpoint to the next";
    let every = node.table(EXPECTED, &["every"])?.need("every", EXPECTED)?;
    let seconds = every.positive_quantity("s", "expected a time above zero (s)")?;
    Duration::try_from_secs_f64(seconds).map_err(|_| every.refuse("expected a time that a run may take (s)"))
}

fn failures(node: &Node<'_>) -> Result<u64> {
    let table = node.table("expected a table [failures]", &["allow"])?;
    let allow =
        table.find("allow").map(|node| node.whole("expected the number of bodies that may fail")).transpose()?;
    Ok(allow.unwrap_or(0))
}
