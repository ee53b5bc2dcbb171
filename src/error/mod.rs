//! The one error type.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

mod arithmetic;
mod inertia;
#[cfg(feature = "study")]
mod input;
mod mesh;
#[cfg(feature = "bench")]
mod rows;

pub use arithmetic::ArithmeticFault;
pub use inertia::{InertiaDefect, TRIANGLE_TOLERANCE};
#[cfg(feature = "study")]
pub(crate) use input::nearest;
#[cfg(feature = "study")]
pub use input::{InputError, InputFault};
pub use mesh::MeshDefect;
#[cfg(feature = "mesh")]
pub use mesh::{FlatArrangement, MeshFileProblem};
#[cfg(feature = "bench")]
pub use rows::RowFault;

/// Text that is static or built at run time.
pub type Text = Cow<'static, str>;

/// What was attempted with a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileAction {
    /// To read it.
    Read,
    /// To create it.
    Create,
    /// To write to it.
    Write,
    /// To remove it.
    Remove,
}

impl std::fmt::Display for FileAction {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            FileAction::Read => "read",
            FileAction::Create => "created",
            FileAction::Write => "written",
            FileAction::Remove => "removed",
        })
    }
}

/// Why something could not be done. Every variant names what was found and what would be valid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A value of one body is not valid.
    #[error("body {body}: {field} = {value:?}: {expected}")]
    Body {
        /// Index of the body, from 0.
        body: usize,
        /// Name of the field.
        field: &'static str,
        /// The value found.
        value: f64,
        /// What would be valid.
        expected: &'static str,
    },
    /// A setting is not valid.
    #[error("{field} = {value:?}: {expected}")]
    Setting {
        /// Name of the setting.
        field: &'static str,
        /// The value found.
        value: f64,
        /// What would be valid.
        expected: &'static str,
    },
    /// A parameter of a torque is not valid.
    #[error("torque {} ({model}){}: {field} = {value}: {expected}", torque + 1, of_body(*body))]
    Torque {
        /// Index of the torque in its scene, from 0.
        torque: usize,
        /// The model's name.
        model: Text,
        /// Index of the body, from 0, where the parameter is a column.
        body: Option<usize>,
        /// Name of the parameter.
        field: Text,
        /// The value found.
        value: f64,
        /// What would be valid.
        expected: Text,
    },
    /// No torque has this name.
    #[error("{name}: expected the name of a torque: {expected}")]
    UnknownModel {
        /// The name given.
        name: String,
        /// The names of all torques.
        expected: String,
    },
    /// A parameter of a torque is missing, unknown or of another shape, where a program names the torque.
    #[error("{model}: {field}: {expected}")]
    TorqueParameter {
        /// The model's name.
        model: Text,
        /// Name of the parameter.
        field: Text,
        /// What would be valid.
        expected: Text,
    },
    /// No sampled torque has this own state.
    #[error("{name}: expected a number of the own state of a sampled torque: {expected}")]
    OwnState {
        /// The name given, as tables have it.
        name: String,
        /// The names of all there are.
        expected: String,
    },
    /// A torque excludes another of its scene.
    #[error("torque {} ({model}): {expected}", torque + 1)]
    TorquePair {
        /// Index of the later torque in its scene, from 0.
        torque: usize,
        /// The model's name.
        model: Text,
        /// What would be valid.
        expected: Text,
    },
    /// A parameter of a force is not valid.
    #[error("force {} ({model}){}: {field} = {value}: {expected}", force + 1, of_body(*body))]
    Force {
        /// Index of the force in its scene, from 0.
        force: usize,
        /// The force's name.
        model: Text,
        /// Index of the body, from 0, where the parameter is a column.
        body: Option<usize>,
        /// Name of the parameter.
        field: Text,
        /// The value found.
        value: f64,
        /// What would be valid.
        expected: Text,
    },
    /// An event is to stop bodies whose centres of mass are stepped.
    #[error(
        "event {} ({name}): the force {force} moves the centres of mass in steps, and a body cannot be stopped between them: \
         use action record",
        event + 1
    )]
    StoppedCentre {
        /// The index of the event in the scene.
        event: usize,
        /// Its name.
        name: String,
        /// The force.
        force: &'static str,
    },
    /// Projection onto what a free body conserves does not apply to the scene.
    #[error("projection of {method}: {expected}")]
    Projection {
        /// The integrator.
        method: crate::kernel::method::Method,
        /// What would be valid.
        expected: &'static str,
    },
    /// An integrator of rigid bodies is asked to follow one whose axes do not turn at I⁻¹ m with the initial moments.
    #[error("torque {} ({model}): {method} integrates rigid bodies only; take rk4, rk8 or cf4", torque + 1)]
    RigidOnly {
        /// Index of the torque in its scene, from 0.
        torque: usize,
        /// The model's name.
        model: Text,
        /// The integrator.
        method: crate::kernel::method::Method,
    },
    /// A method does not support what the scene needs.
    #[error("{method}: {expected}")]
    MethodUnavailable {
        /// The integrator.
        method: crate::kernel::method::Method,
        /// What would be valid.
        expected: Text,
    },
    /// Columns that belong together differ in length.
    #[error("column {column} has {found} rows: expected {expected}, one a body")]
    ColumnLength {
        /// Name of the column.
        column: Text,
        /// Rows found.
        found: usize,
        /// Rows needed.
        expected: usize,
    },
    /// More bodies than there is memory for.
    #[error("{bodies} bodies: {purpose} needs {needed} bytes, {available} are free; take fewer bodies, or f32")]
    TooManyBodies {
        /// Number of bodies asked for.
        bodies: usize,
        /// What the memory is for.
        purpose: &'static str,
        /// Bytes needed.
        needed: u64,
        /// Bytes free.
        available: u64,
    },
    /// More output than the disk has space for.
    #[error(
        "{}: {rows} rows need {needed} bytes or more, {available} are free: write fewer snapshots, or statistics alone",
        path.display()
    )]
    DiskSpace {
        /// The output folder.
        path: PathBuf,
        /// Rows of all tables.
        rows: u64,
        /// The least number of bytes that they need.
        needed: u64,
        /// Bytes that are free.
        available: u64,
    },
    /// A force acts on bodies that have no mass.
    #[error("a force needs masses: give the bodies mass, position and velocity (kg, m, m/s)")]
    MissingMass,
    /// A plan was made for another scene.
    #[cfg(feature = "study")]
    #[error(
        "{}: {field} is {planned} in the plan, {found} in the study: {remedy}",
        path.display()
    )]
    PlanMismatch {
        /// The plan's file.
        path: PathBuf,
        /// What differs.
        field: &'static str,
        /// What the plan holds.
        planned: Box<str>,
        /// What the study has.
        found: Box<str>,
        /// How to resolve it.
        remedy: &'static str,
    },
    /// A file is not a plan of this release.
    #[cfg(feature = "study")]
    #[error("{}:{line}: {reason}: expected a plan.json written by a run of this release", path.display())]
    PlanFormat {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// The driver gave less device memory than the bodies need.
    #[error("{bodies} bodies: {adapter} has no {needed} bytes free; take fewer bodies, f32, or the CPU engine")]
    DeviceMemory {
        /// Name of the adapter.
        adapter: String,
        /// Number of bodies asked for.
        bodies: usize,
        /// Bytes needed on the device.
        needed: u64,
    },
    /// The adapter computes, but not as the kernels need it; found by the probe at start-up.
    #[error("{adapter} cannot be used in {precision}: {fault}; take another precision, or the CPU engine")]
    Arithmetic {
        /// Name of the adapter.
        adapter: String,
        /// The precision that the fault concerns.
        precision: crate::math::Precision,
        /// What the adapter gets wrong.
        fault: crate::error::ArithmeticFault,
    },
    /// The adapter has no arithmetic of the precision asked for.
    #[error("{adapter} has no {precision}: take precision f32, or the CPU engine, which has both")]
    PrecisionUnavailable {
        /// Name of the adapter.
        adapter: String,
        /// The precision asked for.
        precision: crate::math::Precision,
    },
    /// No combination of method, step and precision that the engine has meets the accuracy asked for.
    #[error(
        "out of reach: {target}: the best here ({method} in {precision}) {}: {remedy}", miss(missed.name(), *factor)
    )]
    AccuracyOutOfReach {
        /// What is asked for.
        target: Box<crate::scene::Accuracy>,
        /// The target that is missed by most.
        missed: crate::scene::Target,
        /// The error of the best candidate there, as a multiple of the one asked for; above 1, and infinite if no candidate reached the end
        /// in the steps that planning may take.
        factor: f64,
        /// The name of that candidate.
        method: &'static str,
        /// Its arithmetic.
        precision: crate::math::Precision,
        /// What would reach it.
        remedy: &'static str,
    },
    /// No steps bring the statistics within the errors asked for.
    #[error("out of reach: {target}: {}: {remedy}", missed_statistic(statistic, *factor))]
    StatisticsOutOfReach {
        /// What is asked for ([`crate::scene::StatisticalAccuracy`]).
        target: String,
        /// The key of a study that asks for the target missed by most.
        field: &'static str,
        /// The statistic with that error.
        statistic: String,
        /// The error of the best steps there, as a multiple of the one asked for; infinite if bodies were lost, `None` if steps
        /// cannot be compared.
        factor: Option<f64>,
        /// What would reach it.
        remedy: &'static str,
    },
    /// Planning has reached its time limit ([`crate::Plan::announced`]).
    #[error(
        "planning has come to the end of the {seconds} s that it may take: use a larger error or a shorter span, or name a \
         method and its steps (accuracy.method)"
    )]
    PlanningTime {
        /// The time, s.
        seconds: f64,
    },
    /// The run would take so long that it cannot be intended.
    #[error(
        "about {days:.0} days of computing are expected: use longer steps, a shorter span or fewer bodies, share the study out \
         among machines (--shard), or ask for it with --however-long"
    )]
    RunTime {
        /// The time expected, in days.
        days: f64,
    },
    /// No adapter fits what was asked for.
    #[error("no GPU adapter {wanted}: {found} found; `polhode devices` lists them, the CPU engine needs none")]
    NoAdapter {
        /// What was asked for.
        wanted: String,
        /// How many adapters there are.
        found: usize,
    },
    /// The device refused to be opened or was lost.
    #[error("device {adapter}: {reason}")]
    Device {
        /// Name of the adapter.
        adapter: String,
        /// The driver's message.
        reason: String,
    },
    /// The device was lost, or stopped answering, during a run.
    #[error(
        "device {adapter}: {reason}: {done} of {outputs} outputs of {bodies} bodies were done, of which nothing is kept: \
         run again, on another adapter or on the CPU engine if it happens again"
    )]
    DeviceInRun {
        /// Name of the adapter.
        adapter: String,
        /// The driver's message.
        reason: String,
        /// Outputs that were done.
        done: usize,
        /// Outputs of the run.
        outputs: usize,
        /// Bodies of the run.
        bodies: usize,
    },
    /// An assembled shader is not valid; this is a bug of ours.
    #[error("{file}:{line}: {message}")]
    Shader {
        /// The shader file under `shaders/`.
        file: &'static str,
        /// The line in that file, from 1.
        line: usize,
        /// The compiler's message.
        message: String,
    },
    /// The text that a patch is to replace does not occur in its shader file.
    #[error("{file}: the text to be replaced does not occur: {text}")]
    Patch {
        /// The shader file under `shaders/`.
        file: &'static str,
        /// The text looked for.
        text: String,
    },
    /// A formula is not valid: the message of a [`Fault`](crate::expression::Fault) or [`TextError`](crate::expression::TextError).
    #[error("{0}")]
    Formula(Text),
    /// A study file or a table of bodies is not valid.
    #[cfg(feature = "study")]
    #[error(transparent)]
    Input(Box<crate::error::InputError>),
    /// A file or folder could not be read or written.
    #[error("{}: cannot be {action}: {}", path.display(), file_reason(*kind, reason))]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What was attempted.
        action: FileAction,
        /// The kind of failure.
        kind: std::io::ErrorKind,
        /// The system's message.
        reason: String,
    },
    /// A table written by a run cannot be read.
    #[cfg(feature = "study")]
    #[error("{}: {reason}", path.display())]
    Table {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, and what is expected.
        reason: String,
    },
    /// A folder for output already holds something.
    #[error("{}: the output folder is not empty: name another with --out, or replace its results with --force", path.display())]
    FolderNotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// Another run writes to the output folder.
    #[error("{}: another run writes there ({holder}): wait until it has ended, or name another folder with --out", path.display())]
    FolderInUse {
        /// The folder.
        path: PathBuf,
        /// The other run's process and when it began, if known.
        holder: String,
    },
    /// A value of one item of a list (a point, a part) is not valid.
    #[error("{item} {index}: {field} = {value}: {expected}")]
    Item {
        /// The kind of item.
        item: &'static str,
        /// Number of the item, from 0.
        index: usize,
        /// Name of the field.
        field: &'static str,
        /// The value found.
        value: f64,
        /// What would be valid.
        expected: &'static str,
    },
    /// An inertia tensor is not that of a rigid body.
    #[error("inertia tensor: {0}")]
    Inertia(crate::error::InertiaDefect),
    /// A triangle mesh does not enclose a volume.
    #[error("mesh: {0}")]
    Mesh(crate::error::MeshDefect),
    /// A mesh file could not be read.
    #[cfg(feature = "mesh")]
    #[error("{}: {problem}", path.display())]
    MeshFile {
        /// The file.
        path: std::path::PathBuf,
        /// What is wrong with it.
        problem: crate::error::MeshFileProblem,
    },
    /// A file of benchmark rows does not have the format of this version.
    #[cfg(feature = "bench")]
    #[error("{}: {fault}", path.display())]
    Rows {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        fault: crate::error::RowFault,
    },
    /// Points have no convex hull with a volume.
    #[cfg(feature = "mesh")]
    #[error("convex hull: the {points} points {arrangement}: expected four points that do not lie in a plane")]
    FlatHull {
        /// Number of points given.
        points: usize,
        /// Their arrangement.
        arrangement: crate::error::FlatArrangement,
    },
    /// The caller asked to stop.
    #[error("stopped after {steps} steps")]
    Interrupted {
        /// Steps done of the current interval.
        steps: u64,
    },
}

impl Error {
    /// The error of a failed `action` on `path`.
    pub fn file(path: &Path, action: FileAction, error: &std::io::Error) -> Self {
        Error::File { path: path.to_owned(), action, kind: error.kind(), reason: error.to_string() }
    }

    /// Whether what was asked for is wrong, rather than that something failed while running.
    pub fn is_input(&self) -> bool {
        match self {
            Error::Device { .. } | Error::DeviceInRun { .. } | Error::Shader { .. } | Error::Interrupted { .. } => {
                false
            }
            Error::File { action, .. } => !matches!(action, FileAction::Write | FileAction::Remove),
            _ => true,
        }
    }
}

#[cfg(feature = "study")]
impl From<crate::error::InputError> for Error {
    fn from(error: crate::error::InputError) -> Self {
        Error::Input(Box::new(error))
    }
}

/// The system's message, followed by a remedy where one is known.
fn file_reason(kind: std::io::ErrorKind, reason: &str) -> String {
    match kind {
        std::io::ErrorKind::StorageFull => format!("{reason}; free some space, or write fewer snapshots"),
        _ => reason.to_owned(),
    }
}

/// By how much the best candidate misses a target.
fn miss(missed: &str, factor: f64) -> String {
    if factor.is_infinite() {
        return "loses bodies, or does not reach the end within the steps that planning may take".to_owned();
    }
    format!("misses the {missed} by a factor of {}", rough(factor))
}

fn missed_statistic(statistic: &str, factor: Option<f64>) -> String {
    match factor {
        Some(factor) => format!("the best here {}", miss(statistic, factor)),
        None => "steps of two sizes cannot be compared here".to_owned(),
    }
}

/// A factor above 1, rounded for a message.
fn rough(factor: f64) -> String {
    match factor {
        ..1.1 => format!("{:.3}", factor.max(1.001)),
        ..100.0 => format!("{factor:.1}"),
        _ => format!("{factor:.1e}"),
    }
}

/// The body whose value in a column is meant, as part of a message.
fn of_body(body: Option<usize>) -> String {
    body.map_or_else(String::new, |body| format!(", body {body}"))
}

/// `Result` with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;
