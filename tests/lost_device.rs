//! A device that is lost, or hangs, in the middle of a run: the run ends with an error that says how far it came, and the former result
//! is left as it was.

#![cfg(feature = "study")]

mod common;

use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

use common::kernel::open_device;
use glam::DVec3;
use polhode::bodies::ensemble::Translation;
use polhode::engine::gpu::{GpuOptions, SliceLimits, wgpu};
use polhode::engine::{End, Engine, unobserved};
use polhode::math::Precision;
use polhode::record::{OutputFolder, Report};
use polhode::run::{Checkpoint, run_to_folder};
use polhode::scene::AdaptiveSteps;
use polhode::study::{Output, Study, problem};
use polhode::{Accuracy, Error, Force, Method, Outputs, Plan, Scene, Statistic, Torque};

/// More than one workgroup.
const BODIES: usize = 70;

const OUTPUTS: usize = 4;

/// The longest that a run may take from the loss of its device to its end.
const LONGEST_END: Duration = Duration::from_secs(10);

/// A scene for each kind of session: stepped, with centres of mass, adaptive, in closed form, and with statistics that are formed on the
/// device.
fn scenes() -> Vec<(&'static str, Scene)> {
    let free = || {
        let scene = Scene::new(problem::free(BODIES, 1).expect("valid bodies")).until(OUTPUTS as f64);
        scene.outputs(Outputs::Every(1.0))
    };
    let flying = || {
        let translation = Translation {
            mass: vec![1.0; BODIES],
            position: vec![DVec3::ZERO; BODIES],
            velocity: vec![DVec3::ZERO; BODIES],
        };
        let ensemble = problem::free(BODIES, 1).and_then(|ensemble| ensemble.with_translation(translation));
        let scene = Scene::new(ensemble.expect("valid bodies")).until(OUTPUTS as f64).outputs(Outputs::Every(1.0));
        scene.torque(Torque::linear_drag(0.01)).force(Force::thrust(DVec3::X))
    };
    let drag = Torque::linear_drag(0.01);
    let steps = AdaptiveSteps { tolerance: 1e-5, least_step: None };
    let f32 = Some(Precision::F32);
    vec![
        ("stepped", free().torque(drag.clone()).pinned(Method::Rk4, 0.01, f32)),
        ("with centres of mass", flying().pinned(Method::Rk4, 0.01, f32)),
        ("adaptive", free().torque(drag.clone()).adaptive(steps, f32)),
        ("closed form", free().accuracy(Accuracy::attitude(1e-4))),
        (
            "statistics",
            free().torque(drag).statistics([Statistic::SpinRate]).without_states().pinned(Method::Rk4, 0.01, f32),
        ),
    ]
}

/// Runs a scene on a device of its own into `folder`; the device is lost when the run reports progress for the `loss`-th time. Gives
/// how often it did, and how long after that the run ended.
fn run(scene: &Scene, folder: &Path, loss: Option<usize>) -> (Result<Report, Error>, usize, Duration) {
    let (device, queue) = open_device(wgpu::Features::SHADER_F64);
    let options = GpuOptions { slice: SliceLimits { steps: 20, ..SliceLimits::default() }, ..GpuOptions::default() };
    let engine = Engine::gpu_on(device.clone(), queue, options).expect("opened");
    let plan = Plan::new(scene, &engine).expect("a plan");
    let keeps = scene.keeps_states();
    let output = Output { final_state: keeps, snapshots: keeps, ..Output::default() };
    let place = OutputFolder::create(folder, true).expect("a folder");
    let (mut calls, mut since) = (0, Instant::now());
    let done = run_to_folder(&engine, &plan, None, &output, place, Instant::now(), &mut |_| {
        if loss == Some(calls) {
            device.destroy();
            since = Instant::now();
        }
        calls += 1;
        ControlFlow::Continue(())
    });
    (done, calls, since.elapsed())
}

/// Names and bytes of the files in a folder.
fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let name = |path: &Path| path.file_name().expect("a name").to_string_lossy().into_owned();
    let mut files: Vec<_> = entries.map(|path| (name(&path), fs::read(&path).expect("a file"))).collect();
    files.sort();
    files
}

#[test]
fn a_device_that_is_lost_in_a_run_leaves_the_former_result() {
    let mut losses = 0;
    for (name, scene) in scenes() {
        let workspace = tempfile::tempdir().expect("a folder");
        let folder = workspace.path().join("out");
        let (done, calls, _) = run(&scene, &folder, None);
        done.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(calls >= OUTPUTS, "{name}: {calls} calls");
        let former = files(&folder);
        let mut failed = 0;
        for loss in [0, calls / 3, 2 * calls / 3] {
            let (done, _, duration) = run(&scene, &folder, Some(loss));
            assert!(duration < LONGEST_END, "{name}, lost at {loss} of {calls}: {duration:?}");
            let Err(error) = done else {
                // What came behind the loss was the recomputed sample's.
                assert!(loss > 0, "{name}: nothing of the run was left to do");
                continue;
            };
            let Error::DeviceInRun { done, outputs, bodies, .. } = error else { panic!("{name}, {loss}: {error}") };
            assert!((outputs, bodies) == (OUTPUTS, BODIES) && done <= OUTPUTS, "{name}: {error}");
            assert!(!error.is_input() && error.to_string().contains(" outputs of 70 bodies were done"), "{error}");
            failed += 1;
            assert!(files(&folder) == former, "{name}, lost at {loss} of {calls}: the former result is touched");
            assert_eq!(fs::read_dir(workspace.path()).expect("a folder").count(), 1, "{name}: something is left");
        }
        assert!(failed > 0, "{name}: no run met the loss");
        losses += failed;
    }
    println!("{losses} devices lost in a run; no result lost or half written");
}

/// A study's pieces on a device of its own, which is lost when they report progress for the `loss`-th time; gives how often they did.
fn advance(study: &Study, folder: &Path, loss: Option<usize>) -> (Result<Checkpoint, Error>, usize) {
    let (device, queue) = open_device(wgpu::Features::SHADER_F64);
    let options = GpuOptions { slice: SliceLimits { steps: 20, ..SliceLimits::default() }, ..GpuOptions::default() };
    let engine = Engine::gpu_on(device.clone(), queue, options).expect("opened");
    let found = Checkpoint::find(folder, study).expect("none, or sound pieces");
    let begun = || {
        let scene = study.scene().expect("a scene");
        let plan = Plan::new(&scene, &engine).expect("a plan");
        Checkpoint::begin(folder, &plan).expect("begun")
    };
    let mut checkpoint = found.unwrap_or_else(begun);
    let mut calls = 0;
    let done = checkpoint.advance(
        &engine,
        study,
        Duration::from_nanos(1),
        &mut |_, _, _| ControlFlow::Continue(()),
        &mut |_| {
            if loss == Some(calls) {
                device.destroy();
            }
            calls += 1;
            ControlFlow::Continue(())
        },
    );
    (done.map(|()| checkpoint), calls)
}

#[test]
fn pieces_go_on_after_a_device_was_lost() {
    let text = "[bodies]\ncount = 300\ninertia = [1, 2, 2.5]\norientation = { distribution = \"uniform\" }\n\
                angular_velocity = { distribution = \"normal\", mean = 0, sigma = 0.5 }\n[[torque]]\nmodel = \"linear-drag\"\n\
                coefficient = 0.01\n[time]\nend = 1.0\n[accuracy]\nmethod = \"rk4\"\ndt = 0.01\nprecision = \"f32\"\n";
    let workspace = tempfile::tempdir().expect("a folder");
    let study = Study::parse(&workspace.path().join("study.toml"), text).expect("a study");
    let place = workspace.path().join("pieces");
    let finish = |checkpoint: Checkpoint, name: &str| {
        let results = workspace.path().join(name);
        let folder = OutputFolder::create(&results, false).expect("a folder");
        checkpoint.finish(folder, &mut |_| ControlFlow::Continue(())).expect("merged");
        fs::read(results.join("final.csv")).expect("a table")
    };
    // What a kill leaves while the pieces of a finished run are removed.
    fs::create_dir_all(place.join("bodies-0-0")).expect("made");
    fs::write(place.join("plan.json.removed"), "{}").expect("written");
    let (undisturbed, calls) = advance(&study, &place, None);
    let whole = finish(undisturbed.expect("a checkpoint"), "whole");
    let mut resumed = 0;
    for loss in [0, calls / 3, 2 * calls / 3] {
        let (lost, _) = advance(&study, &place, Some(loss));
        let error = lost.expect_err("the device is lost");
        assert!(matches!(error, Error::DeviceInRun { .. } | Error::Device { .. }), "{error}");
        let done = Checkpoint::find(&place, &study).expect("sound pieces").expect("a checkpoint").bodies_done();
        assert!(done < 300, "{loss} of {calls}");
        resumed += usize::from(done > 0);
        let (rest, _) = advance(&study, &place, None);
        assert!(finish(rest.expect("a checkpoint"), &format!("resumed-{loss}")) == whole, "lost at {loss} of {calls}");
    }
    assert!(resumed > 0, "no loss came behind a piece");
}

#[test]
fn a_device_that_is_lost_before_a_run_is_an_error_of_the_run() {
    for (name, scene) in scenes() {
        let (device, queue) = open_device(wgpu::Features::SHADER_F64);
        let engine = Engine::gpu_on(device.clone(), queue, GpuOptions::default()).expect("opened");
        let plan = Plan::new(&scene, &engine).expect("a plan");
        device.destroy();
        let error = engine.run(&plan).err().unwrap_or_else(|| panic!("{name}: it ran"));
        assert!(
            matches!(error, Error::DeviceInRun { done: 0, outputs: OUTPUTS, bodies: BODIES, .. }),
            "{name}: {error}"
        );
    }
}

#[test]
fn a_device_that_gives_no_answer_in_time_is_an_error() {
    let (device, queue) = open_device(wgpu::Features::SHADER_F64);
    let slice = SliceLimits { longest_wait: Duration::from_nanos(1), ..SliceLimits::default() };
    let patient = GpuOptions::default();
    let hasty = GpuOptions { slice, ..GpuOptions::default() };
    let batch = || common::asymmetric_batch(BODIES, 1, Precision::F32);
    // A nanosecond is no time for the probe, or for the steps behind it.
    let error = Engine::gpu_on(device.clone(), queue.clone(), hasty)
        .and_then(|engine| {
            engine.start(batch(), Method::Rk8)?.advance_to(End::of_steps(0.01, 100_000), &mut unobserved)
        })
        .expect_err("no answer");
    assert!(matches!(error, Error::Device { .. }), "{error:?}");
    assert!(error.to_string().ends_with(": hangs: it gave no answer in 1ns"), "{error}");
    // The device is sound all the same.
    let engine = Engine::gpu_on(device, queue, patient).expect("opened");
    let mut session = engine.start(batch(), Method::Rk8).expect("started");
    session.advance_to(End::of_steps(0.01, 10), &mut unobserved).expect("advanced");
}
