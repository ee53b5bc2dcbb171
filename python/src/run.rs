//! Runs of scenes and studies.

use std::path::{Path, PathBuf};
use std::time::Instant;

use polhode::engine::gpu::GpuOptions;
use polhode::engine::{Choice, devices};
use polhode::record::report::{EventReport, StatisticsReport, StudyReport};
use polhode::record::{FailedBody, OutputFolder, Report};
use polhode::run::{run_into, run_to_folder};
use polhode::scene::AdaptiveSteps;
use polhode::study::Study;
use polhode::{Accuracy, Engine, Method, Outputs, Plan, Precision, Result, Scene};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{moved, moved_rows};
use crate::columns::{Columns, Wanted};
use crate::ensemble::Bodies;
use crate::errors;
use crate::observed::Asked;
use crate::torque::{PyForce, PyTorque};
use crate::worker::{self, Watch};

/// An engine that is ready for work.
#[pyclass(frozen, module = "polhode._native", name = "OpenEngine")]
pub(crate) struct OpenEngine(Engine);

#[pymethods]
impl OpenEngine {
    /// "cpu" or "gpu".
    #[getter]
    fn kind(&self) -> &'static str {
        self.0.description().kind.name()
    }

    /// The adapter's or the processor's instruction set and cores, in words.
    #[getter]
    fn name(&self) -> String {
        self.0.description().name
    }

    /// Driver and its version; empty on the CPU.
    #[getter]
    fn driver(&self) -> String {
        self.0.description().driver
    }

    /// Whether a software adapter plays the GPU.
    #[getter]
    fn software(&self) -> bool {
        self.0.description().software
    }

    /// Precisions that it can compute in.
    #[getter]
    fn precisions(&self) -> Vec<&'static str> {
        self.0.precisions().iter().map(|precision| precision.name()).collect()
    }
}

/// Opens the engine of this name, on this adapter where one is given.
#[pyfunction]
pub(crate) fn open_engine(py: Python<'_>, name: &str, adapter: Option<usize>) -> PyResult<OpenEngine> {
    let options = GpuOptions { adapter, software: true, ..GpuOptions::default() };
    let opened = match (name, adapter) {
        ("cpu", None) => Ok(Engine::cpu()),
        ("cpu", Some(_)) => return Err(errors::input(py, "engine: the CPU engine has no adapter: give one of them")),
        ("auto", None) => py.detach(Engine::auto),
        ("auto" | "gpu", _) => py.detach(|| Engine::gpu(options)),
        _ => return Err(errors::input(py, format!("engine = {name:?}: expected \"auto\", \"cpu\" or \"gpu\""))),
    };
    opened.map(OpenEngine).map_err(|error| errors::of_library(py, &error))
}

/// The adapters of this machine and what `auto` takes, as a list of dicts and a sentence.
#[pyfunction]
pub(crate) fn adapters(py: Python<'_>) -> PyResult<(Vec<Bound<'_, PyDict>>, String)> {
    let found = py.detach(devices);
    let described = |adapter: &polhode::engine::Adapter| {
        let described = PyDict::new(py);
        described.set_item("index", adapter.index)?;
        described.set_item("name", &adapter.name)?;
        described.set_item("backend", &adapter.backend)?;
        described.set_item("driver", &adapter.driver)?;
        described.set_item("kind", adapter.kind.to_string())?;
        described.set_item("precisions", adapter.precisions().iter().map(|of| of.name()).collect::<Vec<_>>())?;
        Ok(described)
    };
    let auto: &Choice = &found.auto;
    Ok((found.adapters.iter().map(described).collect::<PyResult<_>>()?, auto.to_string()))
}

/// How steps are chosen, as Python has it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Stepping {
    attitude: Option<f64>,
    angular_velocity: Option<f64>,
    energy: Option<f64>,
    percentile: f64,
    method: Option<String>,
    dt: Option<f64>,
    tolerance: Option<f64>,
    least_step: Option<f64>,
    precision: Option<String>,
    projection: bool,
}

impl Stepping {
    fn applied_to(&self, scene: Scene) -> std::result::Result<Scene, String> {
        let precision = match self.precision.as_deref() {
            None | Some("auto") => None,
            Some("f32") => Some(Precision::F32),
            Some("f64") => Some(Precision::F64),
            Some(other) => return Err(format!("precision = {other:?}: expected \"auto\", \"f32\" or \"f64\"")),
        };
        let Some(name) = self.method.as_deref() else {
            let Self { attitude, angular_velocity, energy, percentile, .. } = *self;
            let accuracy = Accuracy { attitude, angular_velocity, energy, percentile };
            return Ok(scene.accuracy(accuracy).precision(precision));
        };
        let methods = || Method::ALL.into_iter().chain([Method::Taylor]);
        let Some(method) = methods().find(|method| method.name() == name) else {
            let names: Vec<&str> = methods().map(Method::name).collect();
            return Err(format!("method = {name:?}: expected {}", names.join(", ")));
        };
        match (self.tolerance, self.dt) {
            (Some(_), Some(_)) => Err("dt excludes tolerance: give one of them".to_owned()),
            (Some(_), None) if !Method::ADAPTIVE.contains(&method) => Err(format!(
                "method = {name:?}: methods with adaptive steps are \"rk8\" and \"taylor\": expected one of them, or dt instead of tolerance"
            )),
            (Some(tolerance), None) => {
                let steps = AdaptiveSteps { tolerance, least_step: self.least_step };
                Ok(match (method, precision) {
                    (Method::Taylor, None) => scene.taylor(steps),
                    (Method::Taylor, precision) => scene.taylor(steps).precision(precision),
                    _ => scene.adaptive(steps, precision),
                })
            }
            (None, _) if method == Method::Taylor => {
                Err("the steps of \"taylor\" are adaptive: give a tolerance instead of dt".to_owned())
            }
            (None, Some(dt)) if self.projection => Ok(scene.projected(method, dt).precision(precision)),
            (None, Some(dt)) => Ok(scene.pinned(method, dt, precision)),
            (None, None) => {
                Err(format!("method = {name:?}: expected dt beside it (s), or for \"rk8\" and \"taylor\" a tolerance"))
            }
        }
    }
}

/// What Python knows of a scene.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Parts<'py> {
    bodies: Bound<'py, Bodies>,
    torques: Vec<Bound<'py, PyTorque>>,
    forces: Vec<Bound<'py, PyForce>>,
    end: f64,
    every: Option<f64>,
    times: Option<Vec<f64>>,
    asked: Asked,
    states: bool,
    skip: bool,
}

impl Parts<'_> {
    fn scene(&self, py: Python<'_>, stepping: &Stepping) -> PyResult<Scene> {
        let outputs = match (self.every, &self.times) {
            (Some(interval), _) => Outputs::Every(interval),
            (None, Some(times)) => Outputs::Times(times.clone()),
            (None, None) => Outputs::End,
        };
        let scene = Scene::new(self.bodies.get().0.clone()).until(self.end).outputs(outputs);
        let scene = self.asked.applied_to(py, scene)?.skipping(self.skip);
        let scene = if self.states { scene } else { scene.without_states() };
        let scene = self.forces.iter().fold(scene, |scene, force| scene.force(force.get().force.clone()));
        let scene = self.torques.iter().fold(scene, |scene, torque| scene.torque(torque.get().torque.clone()));
        stepping.applied_to(scene).map_err(|message| errors::input(py, message))
    }
}

/// What a run leaves behind.
struct Outcome {
    columns: Columns,
    failures: Vec<FailedBody>,
    report: Report,
}

impl Outcome {
    fn into_dict<'py>(self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        self.columns.into_arrays(py, &all)?;
        all.set_item("failures", failures(py, &self.failures)?)?;
        all.set_item("report", self.report.to_json())?;
        all.set_item("summary", self.report.to_string())?;
        Ok(all)
    }
}

/// One array a column, one row a body that has failed.
fn failures<'py>(py: Python<'py>, failed: &[FailedBody]) -> PyResult<Bound<'py, PyDict>> {
    let rows = [failed.len()];
    let all = PyDict::new(py);
    all.set_item("body", moved(py, failed.iter().map(|of| of.body as i64).collect(), &rows)?)?;
    all.set_item("t", moved(py, failed.iter().map(|of| of.time).collect::<Vec<f64>>(), &rows)?)?;
    all.set_item("status", moved(py, failed.iter().map(|of| of.reason.number()).collect::<Vec<u8>>(), &rows)?)?;
    all.set_item("reason", failed.iter().map(|of| of.reason.name()).collect::<Vec<_>>())?;
    all.set_item("known_to", failed.iter().map(|of| of.known_to.name()).collect::<Vec<_>>())?;
    all.set_item("last_good_t", moved(py, failed.iter().map(|of| of.last_good_time).collect::<Vec<f64>>(), &rows)?)?;
    all.set_item("orientation", moved_rows(py, failed.iter().map(|of| of.orientation).collect(), &rows)?)?;
    let angular_velocities = failed.iter().map(|of| of.angular_velocity_body).collect();
    all.set_item("angular_velocity", moved_rows(py, angular_velocities, &rows)?)?;
    all.set_item("cause", failed.iter().map(|of| of.cause.as_deref()).collect::<Vec<_>>())?;
    Ok(all)
}

/// Runs a plan into columns.
fn run_plan(
    engine: &Engine,
    plan: &Plan<'_>,
    study: Option<&Study>,
    wanted: Wanted,
    since: Instant,
    watch: &Watch,
) -> Result<Outcome> {
    let before = since.elapsed().as_secs_f64();
    let cells = study.and_then(Study::design).map(|design| design.cells());
    let mut columns = Columns::for_plan(plan, wanted, cells)?;
    let trust = run_into(engine, plan, &mut columns, &mut |progress| watch.observe(progress))?;
    let failures = trust.failures.clone();
    let mut report = Report::new(study.map(StudyReport::of), plan, trust);
    report.statistics = StatisticsReport::of(columns.statistics());
    let end = plan.scene().end();
    report.events = columns.events().iter().map(|record| EventReport::new(record, end)).collect();
    report.wall_time.study = (before - report.wall_time.plan).max(0.0);
    report.wall_time.total = since.elapsed().as_secs_f64();
    Ok(Outcome { columns, failures, report })
}

/// Runs a scene.
#[pyfunction]
pub(crate) fn run<'py>(
    py: Python<'py>,
    scene: Parts<'py>,
    stepping: Stepping,
    engine: &OpenEngine,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let wanted = if scene.states { Wanted::All } else { Wanted::None };
    let scene = scene.scene(py, &stepping)?;
    let engine = engine.0.clone();
    let outcome = worker::run(py, progress.as_ref(), move |watch| {
        let since = Instant::now();
        let plan = Plan::new(&scene, &engine)?;
        watch.goes_on()?;
        run_plan(&engine, &plan, None, wanted, since, watch)
    })?;
    outcome.map_err(|error| errors::of_library(py, &error))?.into_dict(py)
}

/// What will run, what is skipped and why.
#[pyfunction]
pub(crate) fn explain<'py>(
    py: Python<'py>,
    scene: Parts<'py>,
    stepping: Stepping,
    engine: &OpenEngine,
) -> PyResult<String> {
    let scene = scene.scene(py, &stepping)?;
    let engine = engine.0.clone();
    let text = worker::run(py, None, move |_| Ok(Plan::new(&scene, &engine)?.explain().to_string()))?;
    text.map_err(|error: polhode::Error| errors::of_library(py, &error))
}

/// Reads a study from its text, where there is one, or else its file.
fn read_study(file: &Path, text: Option<&str>) -> Result<Study> {
    match text {
        Some(text) => Study::parse(file, text),
        None => Study::read(file),
    }
}

/// Runs a study; into a folder, as the command does, where one is named.
#[pyfunction]
#[pyo3(signature = (file, text, precision, skip, engine, out, force, progress))]
#[allow(clippy::too_many_arguments, reason = "the options of the command")]
pub(crate) fn run_study<'py>(
    py: Python<'py>,
    file: PathBuf,
    text: Option<String>,
    precision: Option<&str>,
    skip: bool,
    engine: &OpenEngine,
    out: Option<PathBuf>,
    force: bool,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let precision = match precision {
        None | Some("auto") => None,
        Some("f32") => Some(Precision::F32),
        Some("f64") => Some(Precision::F64),
        Some(other) => {
            return Err(errors::input(py, format!("precision = {other:?}: expected \"auto\", \"f32\" or \"f64\"")));
        }
    };
    let engine = engine.0.clone();
    let outcome = worker::run(py, progress.as_ref(), move |watch| {
        let since = Instant::now();
        let mut study = read_study(&file, text.as_deref())?;
        if let Some(precision) = precision {
            study = study.with_precision(precision);
        }
        // The folder is tried before anything that takes long.
        let folder = out.map(|out| OutputFolder::create(&out, force)).transpose()?;
        let scene = study.scene()?.skipping(skip);
        watch.goes_on()?;
        let plan = Plan::new(&scene, &engine).map_err(|error| study.located(error))?;
        watch.goes_on()?;
        let output = study.output();
        let Some(folder) = folder else {
            let wanted = match (output.snapshots, output.final_state) {
                (true, _) => Wanted::All,
                (false, true) => Wanted::End,
                (false, false) => Wanted::None,
            };
            return run_plan(&engine, &plan, Some(&study), wanted, since, watch);
        };
        let observe = &mut |progress| watch.observe(progress);
        let report = run_to_folder(&engine, &plan, Some(&study), output, folder, since, observe)?;
        Ok(Outcome { columns: Columns::default(), failures: Vec::new(), report })
    })?;
    outcome.map_err(|error| errors::of_library(py, &error))?.into_dict(py)
}

/// The bodies of a study, drawn or read.
#[pyfunction]
pub(crate) fn study_bodies(py: Python<'_>, file: PathBuf, text: Option<String>) -> PyResult<Bodies> {
    let read = worker::run(py, None, move |_| read_study(&file, text.as_deref())?.ensemble())?;
    read.map(|ensemble| Bodies(ensemble.into())).map_err(|error| errors::of_library(py, &error))
}
