//! A run as an iterator over its output times hands on what a run as a whole records.

use glam::{DQuat, DVec3};
use polhode::engine::Backend;
use polhode::record::Record;
use polhode::run::Run;
use polhode::scene::{Condition, Event, Histogram};
use polhode::{Accuracy, Engine, Ensemble, Outputs, Plan, Quantity, Scene, Torque};

const BODIES: usize = 70;
const OUTPUTS: usize = 5;

/// Bodies that a drag slows down, some below the event's level.
fn scene() -> Scene {
    let ensemble = Ensemble::from_fn(BODIES, |body| {
        let omega = DVec3::new(0.4 + 0.01 * body as f64, -0.3, 0.2);
        (DVec3::new(1.0, 2.0, 2.5), DQuat::from_rotation_x(0.1 * body as f64), omega)
    });
    let scene = Scene::new(ensemble.expect("valid bodies")).torque(Torque::linear_drag(0.2));
    scene.until(OUTPUTS as f64).outputs(Outputs::Every(1.0)).accuracy(Accuracy::attitude(1e-6))
}

fn observed(scene: Scene) -> Scene {
    let slow = Event::new("slow", Quantity::SpinRate, Condition::Falls(0.5)).expect("a level");
    let rates = Histogram::linear(Quantity::SpinRate, 0.0, 1.5, 10).expect("bins");
    scene.statistics([Quantity::SpinRate]).quantiles(&[5.0, 50.0]).expect("percentages").histogram(rates).event(slow)
}

/// Takes `before` outputs from the iterator, and the rest by `finish`.
fn compare(engine: &dyn Backend, plan: &Plan<'_>, record: &Record, before: usize) {
    let mut run = Run::start(engine, plan).expect("started");
    assert_eq!(run.size_hint(), (OUTPUTS, Some(OUTPUTS)));
    for index in 0..before {
        let output = run.next().expect("an output").expect("no error");
        assert_eq!((output.time, run.size_hint().0), (plan.times()[index], OUTPUTS - index - 1));
        match plan.scene().keeps_states() {
            true => assert_eq!(output.states, record.snapshots()[index], "states at {} s", output.time),
            false => assert!(output.states.is_empty(), "states at {} s", output.time),
        }
        assert_eq!(output.statistics.as_ref(), record.statistics().get(index), "statistics at {} s", output.time);
        let histograms = record.histograms().get(index).map_or(&[][..], |histograms| histograms);
        assert_eq!(output.histograms, histograms, "histograms at {} s", output.time);
    }
    assert_eq!(run.next().is_none(), before == OUTPUTS);
    let (events, trust) = run.finish().expect("finished");
    assert_eq!(events, record.events());
    assert_eq!(trust.recomputed_sample, record.trust().recomputed_sample);
    assert_eq!((trust.drift, trust.body_steps), (record.trust().drift, record.trust().body_steps));
}

#[test]
fn outputs_one_by_one_are_those_of_a_run() {
    let engine = Engine::cpu();
    let reduced = scene().statistics([Quantity::SpinRate]);
    for scene in [scene(), observed(scene()), reduced.clone(), reduced.without_states()] {
        let plan = Plan::new(&scene, &engine).expect("a plan");
        let record = engine.run(&plan).expect("a run");
        [0, 2, OUTPUTS].iter().for_each(|&before| compare(&engine, &plan, &record, before));
    }
}
