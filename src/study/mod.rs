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
//! * `inertia`, one of
//!   * a shape of constant density with `mass` (kg) or `density` (kg/m³): `sphere`, `spherical-shell`, `circular-plate`
//!     (`radius`), `ellipsoid` (`semi_axes`), `box` (`edges`), `cylinder`, `cone` (`radius`, `height`), `tube` (`inner_radius`,
//!     `outer_radius`, `height`), `capsule` (`radius`, `length`), `torus` (`major_radius`, `minor_radius`), `rectangular-plate`
//!     (`width`, `depth`), `rod` (`length`), `point`, all about z and as in [`crate::bodies::inertia::Shape`], or `tetrahedron`
//!     (`corners`, four places);
//!   * a closed surface `{ mesh = "hull.stl", mass = ... }` (STL or OBJ, beside the study; or `density`), with `scale = 0.001`
//!     where the file is in millimetres, and `shell = true` for a thin skin of that mass, which may be open;
//!   * the convex hull of points `{ hull = "corners.csv", mass = ... }` (or `density`; columns `x`, `y`, `z`), with `scale`;
//!   * point masses `{ points = "atoms.csv" }` (columns `mass`, `x`, `y`, `z`), with `scale`, and `mass` to scale them to;
//!   * parts `{ parts = [{ shape = ..., mass = ..., position = [x, y, z], orientation = [x, y, z, w] }, ...] }`, each a
//!     shape, mesh, hull or points as above, turned by its orientation about its own origin and put at its position;
//!     `hole = true` takes a part away; `mass` or `density` beside `parts` scales the whole;
//!   * moments along the body axes `[ixx, iyy, izz]`; `{ moments = ... }` with each drawn from a distribution, which may break
//!     the triangle inequality and is then refused; `{ moments = [...], scatter = 0.05 }`, whose every draw is a valid tensor with
//!     that relative deviation ([`crate::bodies::inertia::scattered_moments`]);
//!   * a tensor `{ ixx = ..., iyy = ..., izz = ..., ixy = ..., ixz = ..., iyz = ... }`, where `ixy` is the tensor's element
//!     −∫ρxy, also with `scatter`, which leaves its principal axes as they are.
//!
//!   Matter may lie anywhere in the frame in which it is described. The body's frame has the axes of that frame and its origin
//!   at the centre of mass: the offset is removed, and `position` and `velocity` are those of the centre of mass (a point p of
//!   the description is at `position` + R (p − centre) in the world). `polhode inertia` prints the centre.
//!
//!   A body whose least moment vanishes (`rod`, two points) is a linear rotor: it has no spin about its axis, and an angular
//!   velocity along it is refused; a torque along it has no effect.
//! * `repair_triangle_inequality = 0.01`: replaces a tensor that breaks I₁ + I₂ ≥ I₃ by the nearest that does not, if that
//!   changes it by at most this fraction; `report.json` and the terminal say how many were repaired.
//! * `orientation`: a quaternion `[x, y, z, w]`, `{ axis = [x, y, z], angle = radians }`, or uniform on SO(3);
//!   default: body axes along world axes. `angular_velocity`: body axes, rad/s.
//! * `position`, `velocity` (world axes) and `mass`: for bodies that move through space. `[force]` acts on every body's
//!   centre of mass: `constant = [fx, fy, fz]` in world axes (N), `gravity = [gx, gy, gz]` in world axes (m/s²),
//!   `linear_drag` against the velocity (N s/m). Or a list `[[force]]`, each with a `model` and its parameters
//!   ([`crate::torque::force`] has the equations): `constant` (`force`, world axes), `gravity` (`acceleration`), `linear-drag` and
//!   `quadratic-drag` (`coefficient`, N s/m and N s²/m²), `thrust` (`force`, body axes), `custom` (`force`, a formula in world axes, and
//!   `parameters`; `docs/custom-torques.md`). Parameters have the same forms as those of torques.
//! * `[[torque]]`, any number of them: a `model` and its parameters. The table in [`crate::torque`] lists the models with their
//!   equations and keys; a key with a dot belongs to a table, `orbit = { radius = 7.0e6, inclination = 0.9 }`. A parameter is a
//!   number or vector for all bodies, a distribution, or a column of the table of bodies: `{ column = "drag" }`, or
//!   `{ columns = ["tx", "ty", "tz"] }` for a vector, with four for an orientation. The tables of a list hold plain numbers:
//!   `facets = [{ area = 0.02, normal = [0, 0, 1], centre = [0, 0, 0.15], solar = { specular = 0.1, diffuse = 0.3 } }]`.
//! * A number, a vector or an orientation may be a distribution: [`distribution`] lists them all. `[correlated.NAME]` declares numbers that
//!   are drawn together.
//! * A custom torque with `every` (s), and `delay` (s, default 0), is sampled ([`crate::torque::control`]): `sample` has the names and
//!   formulas of values that are computed at samples and held, `state` the names and initial values of the torque's own state, `d_NAME` or
//!   `next_NAME` the law of each state. Tables of states have a column for each of its numbers, `torque1_h_x`, before `stopped_at` and
//!   `status`. Each is a quantity of that name, and formulas of quantities may use the whole vector, `torque1_h`.
//! * `[orbit]`: `mu` and the keys of a torque's `orbit`, for all torques that need an orbit and state neither. With `j2` the orbit drifts
//!   ([`crate::torque::orbit::drift`]).
//! * `[[sweep]]` and `[design]`: parameters that take several values in one run ([`sweep`]); `{ sweep = "name" }` stands for a number.
//! * `[output] initial = true` writes `initial.csv`: the initial state of each body, and what was drawn for it. `bodies.carry =
//!   ["operator"]` copies further columns of the table of bodies to it.
//! * `statistics`: any quantities ([`Quantity`] has the list with formulas and units). `statistics.csv` has one row for each output time:
//!   `t`, `count` (bodies that did not fail) and for each quantity, such as `spin_rate`, the columns `spin_rate_mean`,
//!   `spin_rate_standard_deviation` (over the bodies as they are), `spin_rate_min`, `spin_rate_max`, `spin_rate_min_body`,
//!   `spin_rate_max_body` and, with `quantiles = [5, 50, 95]` (percent), `spin_rate_q5` and so on; before these a column such as `dot_count`,
//!   bodies with a finite value, for quantities that some may lack ([`Quantity::may_be_undefined`]); `statistics.npz` has an array of shape
//!   `[outputs]` for each. With `final = false`, no snapshots and only `kinetic_energy`, `spin_rate` and `angular_momentum`, statistics are
//!   all that leaves the device; for anything else the states are read at every output time.
//! * `[[histogram]]`, any number of them: `quantity`, `low`, `high`, `bins` (50) and `scale` (`linear` or `log`). `histograms.csv` has a
//!   row for each output time, histogram and bin: `t`, `histogram` (from 0), `quantity`, `low`, `high`, `count`; the rows for values
//!   outside the bins have an infinite edge.
//! * `[[event]]`, any number of them: a `name`, a `quantity`, and one of `below`, `above`, `falls_below`, `rises_above`, `crosses` with a
//!   level ([`Condition`]); `occurrence = 3` for the third time; `action = "stop"` (default `"record"`): a body that has the event stays in
//!   its state from then on, and tables of states have the column `stopped_at`, s. Each interval between output times is searched for
//!   events ([`Event`]). `events.csv` has a row for each body and event that it had: `event`, `body`, `t`, `known_to`
//!   ([`EventTime`](crate::record::EventTime)), and the state at that time; `survival.csv` has for each event and output time the
//!   `remaining` bodies, the `share` that has not had it, and its 95 % confidence interval `low`, `high`
//!   ([`EventRecord::survival`](crate::record::EventRecord::survival)); `times.csv` has for each event the number of `bodies`, how many
//!   `had` it, and the times (s) `t10`, `t50`, `t90` by which 10, 50 and 90 % had it, with 95 % confidence intervals `t10_low`,
//!   `t10_high` and so on ([`EventRecord::times_by`](crate::record::EventRecord::times_by)).
//! * `accuracy.mean`, `accuracy.quantile`: the greatest error of the integration in means and quantiles, as a part of the quantity's
//!   standard deviation over the bodies; `accuracy.event_time`: in the mean time of an event, as a part of the span
//!   ([`StatisticalAccuracy`]). Alone they decide how steps are chosen; beside `attitude` or a method, the report says whether they are
//!   met. A study that writes no states and sets nothing else asks for 1e-3 for each that applies.
//! * `[[quantity]]`: a quantity of the study's own, with a `name`: a `formula` with its `unit`, a number formed from `attitude`,
//!   `angular_velocity`, `angular_momentum`, `inertia`, `time` and the own state of sampled torques (the language is that of
//!   `docs/custom-torques.md`); or the angle between an `axis` of the body and a `direction` of the world; or `euler = "zxz"`, `angle = 2`
//!   and, if the turns are about the world's axes, `about = "world"`.
//! * Tables of states end in a column `status` (followed by `cell` in sweeps): 0, or the number of the reason why the body has failed, and
//!   then its numbers are NaN (for [`Status::CentreNotFinite`] only position and velocity, as long as the rotation is good): 1
//!   `not_converged`, 2 `step_too_long`, 3 `step_below_limit`, 4 `not_finite`, 5 `centre_not_finite` ([`Status`]); or 6 `stopped`, if an
//!   event has stopped it and the numbers are good. If bodies have failed, `failed.csv` (or `.npz`, `.parquet`) has a row for each: `body`,
//!   `t` when it failed, `status`, `reason` (its word), `known_to`, the last good state (`last_good_t`, where 0 is the start, and `qx qy qz
//!   qw wx wy wz`), and `cause`: for formulas of the study's own the torque, the operation that gave no finite number, and what it read.
//!   With `known_to` = `step`, `t` is the end of the first step that failed and the state is that before it, or both are where adaptive
//!   steps stopped; with `output`, `t` is the output at which the failure was seen and the state the last that was read
//!   ([`KnownTo`](crate::record::KnownTo)). If only statistics leave the device, failures are looked for at the end. `[failures] allow = 3`
//!   allows that many bodies to fail before the exit status is 1.
//! * `[checkpoint] every = "10 min"`: the run is computed and written some bodies at a time, in portions of about that wall time, so that
//!   `polhode run --resume` continues where it was stopped ([`Checkpoint`](crate::run::Checkpoint)).
//! * [`table`] describes tables of bodies; what a table does not hold may be drawn.
//!
//! Every draw is a function of seed, body and column only ([`draw`]), so a study with fewer bodies contains the first bodies of a larger
//! one.

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

mod accuracy;
mod bodies;
pub(crate) mod checksum;
mod context;
mod custom;
pub mod distribution;
pub mod draw;
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
use distribution::Correlated;
use draw::Draw;
use force::StudyForce;
use observed::StudyObserved;
use reader::{FileText, Node, Place, Table};
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
        let own = torque::own_parts(&torques);
        let observed = StudyObserved::read(root, output_table.as_ref(), &own)?;
        if checks.is_some() && !observed.has_events() {
            return Err(refuse_checks(&time_node));
        }
        check_orbit_use(root)?;
        let translates = bodies.translates() || !forces.is_empty();
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

    /// The title, if the study has one.
    pub fn title(&self) -> Option<&str> {
        self.title.as_deref()
    }

    /// The seed of all draws.
    pub fn seed(&self) -> u64 {
        self.seed
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
    let torques = root.find("torque").map(|node| torque::read(&node)).transpose()?.unwrap_or_default();
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
