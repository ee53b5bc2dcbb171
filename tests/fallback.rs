//! Runs that go on on the CPU after their device was lost, hangs or has no memory: what they give is what the device would have given, nothing
//! is handed on twice, and they say what happened.

#![cfg(feature = "study")]

mod common;

use std::cell::Cell;
use std::ops::ControlFlow;
use std::rc::Rc;
use std::time::{Duration, Instant};

use common::kernel::open_device;
use glam::DVec3;
use polhode::bodies::ensemble::Translation;
use polhode::engine::gpu::{GpuOptions, SliceLimits, wgpu};
use polhode::engine::{Engine, EngineKind, Fallback, devices};
use polhode::math::Precision;
use polhode::record::{EventRecord, OutputFolder, OutputState, Sink, Statistics, Trust};
use polhode::run::{Checkpoint, Run, run_into, run_to_folder};
use polhode::scene::{AdaptiveSteps, Condition, Event};
use polhode::study::{Output, Study, problem};
use polhode::torque::{Parameters, SampledLaw};
use polhode::{Accuracy, Ensemble, Error, Force, Method, Outputs, Plan, Quantity, Result, Scene, Statistic, Torque};

/// More than one workgroup.
const BODIES: usize = 70;

/// Output times, a second apart.
const OUTPUTS: usize = 5;

/// Engines round differently; over the some hundred steps of these runs, in numbers of the size of 1, that comes to less than this in `f64`.
const ROUNDINGS_F64: f64 = 1e-12;

/// As above in `f32` with compensated states: torques and rates are rounded to 6e-8.
const ROUNDINGS_F32: f64 = 1e-5;

/// Times of events are found to 1e-12 of the span.
const LOCATED: f64 = 1e-11;

/// Adaptive steps keep 1e-9 a step, and a run of this length takes less than 100 of them.
const STEP_TOLERANCE: f64 = 1e-9;
const ADAPTIVE: f64 = 1e-7;

fn free() -> Ensemble {
    problem::free(BODIES, 1).expect("valid bodies")
}

fn flying() -> Ensemble {
    let at = |x: f64| (0..BODIES).map(|body| DVec3::new(x, 0.1 * body as f64, -1.0)).collect();
    let translation = Translation { mass: vec![2.0; BODIES], position: at(3.0), velocity: at(0.5) };
    free().with_translation(translation).expect("a translation")
}

fn until_the_end(ensemble: Ensemble) -> Scene {
    Scene::new(ensemble).until(OUTPUTS as f64).outputs(Outputs::Every(1.0))
}

/// A torque whose value is that of the time.
fn timed() -> Torque {
    let text = "vec(0.2 * cos(3 * time), 0.1 * sin(2 * time), 0.05 * time)";
    Torque::custom(text, Parameters::new()).expect("a formula")
}

/// A torque that is held between samples, and delayed.
fn sampled() -> Torque {
    let law = SampledLaw::new(Parameters::new(), 0.3, 0.1).expect("times");
    law.sample_vector("u", "-0.3 * angular_velocity").and_then(|law| law.torque("u")).expect("a law")
}

/// A scene of each kind of session, and how far a run that went on may be from one that did not have to.
fn scenes() -> Vec<(&'static str, Scene, f64)> {
    let drag = || Torque::linear_drag(0.05);
    let pinned = |scene: Scene, precision: Precision| scene.pinned(Method::Rk4, 0.01, Some(precision));
    let steps = AdaptiveSteps { tolerance: STEP_TOLERANCE, least_step: None };
    let slow = || Event::new("slow", Quantity::SpinRate, Condition::Below(1.0)).expect("a level");
    let noise = || Torque::white_noise(0.1, 7);
    let f64 = Precision::F64;
    vec![
        ("equal steps", pinned(until_the_end(free()).torque(drag()).torque(timed()), f64), ROUNDINGS_F64),
        ("in f32", pinned(until_the_end(free()).torque(drag()).torque(timed()), Precision::F32), ROUNDINGS_F32),
        ("noise", pinned(until_the_end(free()).torque(noise()).torque(timed()), f64), ROUNDINGS_F64),
        ("sampled", pinned(until_the_end(free()).torque(sampled()).torque(timed()), f64), ROUNDINGS_F64),
        ("projected", until_the_end(free()).projected(Method::Rk8, 0.01), ROUNDINGS_F64),
        ("stopping", pinned(until_the_end(free()).torque(drag()).event(slow().stopping()), f64), LOCATED),
        (
            "centres of mass",
            pinned(until_the_end(flying()).torque(timed()).force(Force::thrust(DVec3::X)), f64),
            ROUNDINGS_F64,
        ),
        (
            "centres of mass in f32",
            pinned(until_the_end(flying()).torque(timed()).force(Force::thrust(DVec3::X)), Precision::F32),
            ROUNDINGS_F32,
        ),
        ("adaptive", until_the_end(free()).torque(drag()).torque(timed()).adaptive(steps, Some(f64)), ADAPTIVE),
        (
            "adaptive, sampled, stopping",
            until_the_end(free()).torque(sampled()).event(slow().stopping()).adaptive(steps, Some(f64)),
            ADAPTIVE,
        ),
        ("closed form", until_the_end(free()).accuracy(Accuracy::attitude(1e-4)), ROUNDINGS_F32),
        ("closed form, stopping", until_the_end(free()).event(turned().stopping()), ROUNDINGS_F32),
        (
            "statistics",
            pinned(until_the_end(free()).torque(drag()).statistics([Statistic::SpinRate]).without_states(), f64),
            ROUNDINGS_F64,
        ),
        (
            "statistics of closed forms",
            until_the_end(free()).statistics([Statistic::SpinRate]).without_states().accuracy(Accuracy::attitude(1e-4)),
            ROUNDINGS_F32,
        ),
    ]
}

fn turned() -> Event {
    Event::new("turned", Quantity::SpinRate, Condition::Falls(1.2)).expect("a level")
}

/// What a run hands on.
#[derive(Default)]
struct Taken {
    keeps_states: bool,
    states: Vec<(f64, Vec<OutputState>)>,
    statistics: Vec<Statistics>,
    /// Of progress so far, and as the last output was handed on.
    reports: Rc<Cell<usize>>,
    reports_of_outputs: usize,
    events: Vec<EventRecord>,
}

impl Sink for Taken {
    fn wants(&mut self, _: usize, _: usize, _: f64) -> bool {
        self.keeps_states
    }

    fn bodies(&mut self, index: usize, time: f64, first_body: usize, states: &[OutputState]) -> Result<()> {
        if first_body == 0 {
            assert_eq!(index, self.states.len(), "an output is handed on twice, or left out");
            self.states.push((time, Vec::new()));
        }
        assert_eq!(first_body, self.states[index].1.len(), "bodies are handed on twice, or left out");
        self.states[index].1.extend(states);
        self.reports_of_outputs = self.reports.get();
        Ok(())
    }

    fn statistics(&mut self, index: usize, statistics: &Statistics) -> Result<()> {
        assert_eq!(index, self.statistics.len(), "statistics are handed on twice, or left out");
        self.statistics.push(statistics.clone());
        self.reports_of_outputs = self.reports.get();
        Ok(())
    }

    fn events(&mut self, events: Vec<EventRecord>) -> Result<()> {
        assert!(self.events.is_empty());
        self.events = events;
        Ok(())
    }
}

/// A device of its own, with an engine on it.
fn opened(fallback: Fallback) -> (wgpu::Device, Engine) {
    let (device, queue) = open_device(wgpu::Features::SHADER_F64);
    let options = GpuOptions { slice: SliceLimits { steps: 20, ..SliceLimits::default() }, ..GpuOptions::default() };
    (device.clone(), Engine::gpu_on(device, queue, options).expect("opened").with_fallback(fallback))
}

/// Runs a scene on a device of its own, which is lost when the run reports progress for the `loss`-th time.
fn run(scene: &Scene, fallback: Fallback, loss: Option<usize>) -> Result<(Taken, Trust)> {
    let (device, engine) = opened(fallback);
    let plan = Plan::new(scene, &engine).expect("a plan");
    let mut taken = Taken { keeps_states: scene.keeps_states(), ..Taken::default() };
    let (reports, mut done) = (Rc::clone(&taken.reports), 0);
    let trust = run_into(&engine, &plan, &mut taken, &mut |progress| {
        if loss == Some(reports.get()) {
            device.destroy();
        }
        assert!(progress.done >= done, "progress goes back from {done} to {}", progress.done);
        done = progress.done;
        reports.set(reports.get() + 1);
        ControlFlow::Continue(())
    });
    trust.map(|trust| (taken, trust))
}

/// The greatest difference of two states, in any of their numbers, each in units of the greatest of its vector or 1.
fn difference(one: &OutputState, other: &OutputState) -> f64 {
    assert_eq!(one.status(), other.status());
    assert_eq!(one.stopped_at.is_some(), other.stopped_at.is_some());
    let vectors = |state: &OutputState| {
        let (q, (x, v)) = (state.rotation.orientation, state.translation.unwrap_or_default());
        [DVec3::new(q.x, q.y, q.z), DVec3::X * q.w, state.rotation.angular_velocity_body, x, v]
    };
    // Both signs are the same orientation.
    let sign = if one.rotation.orientation.dot(other.rotation.orientation) < 0.0 { -1.0 } else { 1.0 };
    let mut pairs: Vec<(DVec3, DVec3)> = vectors(one).into_iter().zip(vectors(other)).collect();
    pairs[..2].iter_mut().for_each(|(one, _)| *one *= sign);
    let stops = [one, other].map(|state| state.stopped_at.unwrap_or(0.0) * DVec3::X);
    pairs.push((stops[0], stops[1]));
    let relative = |(one, other): &(DVec3, DVec3)| (*one - *other).length() / one.length().max(1.0);
    pairs.iter().map(relative).inspect(|found| assert!(found.is_finite())).fold(0.0, f64::max)
}

/// The greatest difference of all that two runs have handed on; up to `same` seconds there may be none.
fn greatest_difference(name: &str, found: &Taken, expected: &Taken, same: f64) -> f64 {
    let mut greatest = 0.0_f64;
    assert_eq!(found.states.len(), expected.states.len(), "{name}");
    for ((time, found), (_, expected)) in found.states.iter().zip(&expected.states) {
        assert_eq!(found.len(), BODIES, "{name}");
        let own = found.iter().zip(expected).map(|(found, expected)| difference(found, expected)).fold(0.0, f64::max);
        assert!(
            *time > same || own == 0.0,
            "{name}: what was handed on before the fault differs by {own:e} at {time} s"
        );
        greatest = greatest.max(own);
    }
    assert_eq!(found.statistics.len(), expected.statistics.len(), "{name}");
    for (found, expected) in found.statistics.iter().zip(&expected.statistics) {
        assert_eq!((found.count, found.summaries.len()), (expected.count, expected.summaries.len()), "{name}");
        for (found, expected) in found.summaries.iter().zip(&expected.summaries) {
            let figures = |summary: &polhode::record::Summary| [summary.mean, summary.standard_deviation, summary.max];
            let pairs = figures(found).into_iter().zip(figures(expected));
            greatest = pairs.map(|(one, other)| (one - other).abs()).fold(greatest, f64::max);
        }
    }
    assert_eq!(found.events.len(), expected.events.len(), "{name}");
    for (found, expected) in found.events.iter().zip(&expected.events) {
        let bodies = |event: &EventRecord| {
            let mut bodies: Vec<usize> = event.occurrences.iter().map(|one| one.body).collect();
            bodies.sort_unstable();
            bodies
        };
        assert_eq!(bodies(found), bodies(expected), "{name}: an event is lost, or counted twice");
    }
    greatest
}

#[test]
fn runs_go_on_where_a_device_is_lost() {
    for (name, scene, bound) in scenes() {
        let plain = run(&scene, Fallback::None, None);
        let (plain, _) = plain.unwrap_or_else(|error| panic!("{name}: {error}"));
        let sound = run(&scene, Fallback::Cpu, None);
        let (sound, trust) = sound.unwrap_or_else(|error| panic!("{name}: {error}"));
        let calls = sound.reports_of_outputs;
        assert_eq!(trust.fallback, None, "{name}");
        let changed = greatest_difference(name, &sound, &plain, f64::INFINITY);
        assert!(changed == 0.0, "{name}: a sound device's results change by {changed:e} as the CPU stands by");
        let work = (trust.body_steps, trust.adaptive.map(|work| work.accepted.total > 0));
        let (mut fell_back, mut greatest, mut times) = (0, 0.0_f64, Vec::new());
        for loss in [0, 1, calls / 4, calls / 3, calls / 2, 2 * calls / 3, 3 * calls / 4] {
            let found = run(&scene, Fallback::Cpu, Some(loss));
            let (found, trust) = found.unwrap_or_else(|error| panic!("{name}, lost at {loss} of {calls}: {error}"));
            let since = trust.fallback.as_ref().map_or(f64::INFINITY, |fallback| fallback.time);
            let own = greatest_difference(name, &found, &sound, since);
            assert!(own <= bound, "{name}, lost at {loss} of {calls}, from {since} s: off by {own:e}");
            greatest = greatest.max(own);
            let Some(fallback) = &trust.fallback else { continue };
            assert!(fallback.fault.engine.starts_with("CPU, ") && !fallback.fault.reason.is_empty(), "{fallback}");
            assert_eq!(trust.engine.kind, EngineKind::Gpu, "{name}: the engine is the one that it began on");
            assert!(trust.to_string().contains("after a fault of "), "{trust}");
            assert!(trust.failures.is_empty(), "{name}: {:?}", trust.failures);
            let own_work = (trust.body_steps, trust.adaptive.map(|work| work.accepted.total > 0));
            assert!(trust.adaptive.is_some() || own_work == work, "{name}: {own_work:?} steps, not {work:?}");
            fell_back += 1;
            times.push(since);
        }
        // From the start and from an output between it and the end.
        assert!(fell_back >= 4 && times[0] == 0.0, "{name}: {times:?}");
        assert!(times.iter().any(|time| (1.0..OUTPUTS as f64).contains(time)), "{name}: {times:?}");
        println!("{name}: went on from {times:?} s, {greatest:.1e} off at the most");
    }
}

#[test]
fn a_run_whose_device_is_lost_before_it_is_the_cpus() {
    for (name, scene, bound) in scenes() {
        let (device, engine) = opened(Fallback::Cpu);
        let plan = Plan::new(&scene, &engine).expect("a plan");
        device.destroy();
        let mut taken = [0, 1].map(|_| Taken { keeps_states: scene.keeps_states(), ..Taken::default() });
        let [own, of_cpu] = &mut taken;
        let mut go_on = |_| ControlFlow::Continue(());
        let trust = run_into(&engine, &plan, own, &mut go_on).unwrap_or_else(|error| panic!("{name}: {error}"));
        run_into(&Engine::cpu(), &plan, of_cpu, &mut go_on).expect("runs");
        // Centres of mass are moved by the same steps, whose attitudes come by another route.
        let bound = if name.starts_with("centres") { bound } else { 0.0 };
        let found = greatest_difference(name, own, of_cpu, -1.0);
        assert!(found <= bound, "{name}: {found:e} from the CPU's own");
        assert_eq!(trust.fallback.map(|fallback| fallback.time), Some(0.0), "{name}");
        // Nor does a later run try the device again.
        let again = engine.run(&plan).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(again.trust().fallback.as_ref().map(|fallback| fallback.time), Some(0.0), "{name}");
    }
}

#[test]
fn pieces_with_checkpoints_go_on() {
    let text = "[bodies]\ncount = 300\ninertia = [1, 2, 2.5]\norientation = { distribution = \"uniform\" }\n\
                angular_velocity = { distribution = \"normal\", mean = 0, sigma = 0.5 }\n[[torque]]\nmodel = \"linear-drag\"\n\
                coefficient = 0.01\n[time]\nend = 1.0\n[accuracy]\nmethod = \"rk4\"\ndt = 0.01\nprecision = \"f64\"\n";
    let workspace = tempfile::tempdir().expect("a folder");
    let study = Study::parse(&workspace.path().join("study.toml"), text).expect("a study");
    let (device, engine) = opened(Fallback::Cpu);
    let scene = study.scene().expect("a scene");
    let plan = Plan::new(&scene, &engine).expect("a plan");
    let mut checkpoint = Checkpoint::begin(&workspace.path().join("pieces"), &plan).expect("begun");
    let mut pieces = 0;
    let mut begun = |_: &Checkpoint, _, _: &_| {
        if pieces == 1 {
            device.destroy();
        }
        pieces += 1;
        ControlFlow::Continue(())
    };
    let mut go_on = |_| ControlFlow::Continue(());
    checkpoint.advance(&engine, &study, Duration::from_nanos(1), &mut begun, &mut go_on).expect("goes on");
    let results = OutputFolder::create(&workspace.path().join("out"), false).expect("a folder");
    let merged = checkpoint.finish(results, &mut |_| ControlFlow::Continue(())).expect("merged");
    assert!(pieces > 2, "{pieces} pieces");
    let counts: Vec<(bool, usize)> =
        merged.engines.iter().map(|(name, &parts)| (name.contains(", after a fault CPU, "), parts)).collect();
    assert_eq!(counts, [(false, 1), (true, pieces - 1)], "{:?}", merged.engines);
}

#[test]
fn the_cpu_engine_stays_as_it_is() {
    let (_, scene, _) = scenes().swap_remove(0);
    let engine = Engine::cpu();
    let plan = Plan::new(&scene, &engine).expect("a plan");
    let record = engine.run(&plan).expect("runs");
    let guarded = engine.clone().with_fallback(Fallback::Cpu).run(&plan).expect("runs");
    assert_eq!(record.final_state(), guarded.final_state());
    assert_eq!(guarded.trust().fallback, None);
}

#[test]
fn a_run_goes_on_where_a_device_hangs() {
    const MANY: usize = 50_000;
    // Shorter than a submission of so many bodies: on a software adapter some hundred steps, on a GPU some thousand.
    let is_real = devices().adapters.first().is_some_and(|adapter| adapter.kind.is_real());
    let (longest_wait, span) =
        if is_real { (Duration::from_micros(500), 10.0) } else { (Duration::from_millis(20), 0.5) };
    let slice = SliceLimits { longest_wait, duration: Duration::from_secs(2), ..SliceLimits::default() };
    // The probe may take longer on a busy machine.
    let open = || {
        let (device, queue) = open_device(wgpu::Features::SHADER_F64);
        Engine::gpu_on(device, queue, GpuOptions { slice, ..GpuOptions::default() }).ok()
    };
    let engine = (0..500).find_map(|_| open()).expect("opened").with_fallback(Fallback::Cpu);
    let scene = Scene::new(problem::free(MANY, 1).expect("valid bodies")).until(span).torque(Torque::linear_drag(0.05));
    let scene = scene.pinned(Method::Rk4, 0.001, Some(Precision::F64));
    let plan = Plan::new(&scene, &engine).expect("a plan");
    let record = engine.run(&plan).expect("goes on");
    let fallback = record.trust().fallback.as_ref().expect("it says so");
    assert_eq!(fallback.fault.reason, format!("hangs: it gave no answer in {longest_wait:?}"));
    assert_eq!(fallback.time, 0.0);
    assert!(record.final_state() == Engine::cpu().run(&plan).expect("runs").final_state());
}

#[test]
fn what_cannot_go_on_says_why() {
    let scene = until_the_end(flying()).torque(Torque::internal_dissipation(0.1)).force(Force::thrust(DVec3::X));
    let scene = scene.pinned(Method::Rk4, 0.01, Some(Precision::F64));
    run(&scene, Fallback::Cpu, None).expect("runs");
    for loss in [0, 2] {
        let error = run(&scene, Fallback::Cpu, Some(loss)).map(|(_, trust)| trust).expect_err("it cannot go on");
        assert!(matches!(error, Error::DeviceInRun { .. }), "{error:?}");
        let why = "cannot go on on the CPU, as the device moved centres of mass along bodies that are not rigid";
        assert!(error.to_string().contains(why), "{error}");
    }
}

#[test]
fn an_interrupt_ends_a_run_that_has_gone_on() {
    let (_, scene, _) = scenes().swap_remove(0);
    let (device, engine) = opened(Fallback::Cpu);
    let plan = Plan::new(&scene, &engine).expect("a plan");
    device.destroy();
    let mut run = Run::start(&engine, &plan).expect("started");
    assert_eq!(run.next().expect("an output").expect("on the CPU").time, 1.0);
    let stopped = run_into(&engine, &plan, &mut Taken::default(), &mut |_| ControlFlow::Break(()));
    assert!(matches!(stopped, Err(Error::Interrupted { .. })));
}

#[test]
fn the_report_says_that_a_run_has_gone_on() {
    let (_, scene, _) = scenes().swap_remove(0);
    let workspace = tempfile::tempdir().expect("a folder");
    let report = |is_lost: bool| {
        let (device, engine) = opened(Fallback::Cpu);
        let plan = Plan::new(&scene, &engine).expect("a plan");
        let place = OutputFolder::create(&workspace.path().join("out"), true).expect("a folder");
        let output = Output { final_state: true, snapshots: true, ..Output::default() };
        let report = run_to_folder(&engine, &plan, None, &output, place, Instant::now(), &mut |progress| {
            // How often progress is reported depends on the machine.
            if is_lost && 2 * progress.done >= progress.total {
                device.destroy();
            }
            ControlFlow::Continue(())
        });
        report.expect("a report").to_string()
    };
    let json = || -> serde_json::Value {
        let text = std::fs::read_to_string(workspace.path().join("out/report.json")).expect("a report");
        serde_json::from_str(&text).expect("JSON")
    };
    let sound = report(false);
    assert!(!sound.contains("FALLBACK") && json().get("fallback").is_none(), "{sound}");
    let lost = report(true);
    let fallback = json()["fallback"].clone();
    let time = fallback["time"].as_f64().expect("a time");
    assert!((1.0..OUTPUTS as f64).contains(&time), "{fallback}");
    assert_eq!(json()["engine"]["kind"], "gpu");
    assert_eq!(json()["engine"]["adapter"], fallback["adapter"]);
    let [adapter, reason, engine] =
        ["adapter", "reason", "engine"].map(|key| fallback[key].as_str().expect("a text").to_owned());
    let line = format!("\n  FALLBACK from {time} s on {engine}, after a fault of {adapter}: {reason}\n");
    assert!(lost.contains(&line), "{lost}");
}
