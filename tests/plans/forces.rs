//! Plans for bodies whose centres of mass move under forces that have no closed form.

use glam::{DQuat, DVec3};
use polhode::bodies::ensemble::Translation;
use polhode::scene::{Condition, Event};
use polhode::torque::Parameters;
use polhode::{Accuracy, Engine, Ensemble, Force, Method, Outputs, Plan, Precision, Quantity, Record, Scene, Torque};

const BODIES: usize = 40;

/// Bodies of 10 kg that spin about their third axis, and nutate.
fn bodies() -> Scene {
    let spin = |body: usize| DVec3::new(0.1 - 0.002 * body as f64, 0.05, -0.4 - 0.01 * body as f64);
    let ensemble = Ensemble::from_fn(BODIES, |body| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, spin(body)));
    let translation =
        Translation { mass: vec![10.0; BODIES], position: vec![DVec3::ZERO; BODIES], velocity: vec![DVec3::X; BODIES] };
    Scene::new(ensemble.expect("bodies").with_translation(translation).expect("masses"))
}

fn run(scene: &Scene) -> Record {
    let engine = Engine::cpu();
    engine.run(&Plan::new(scene, &engine).expect("a plan")).expect("a run")
}

/// The greatest distance, m, and angle, rad, between the final states of two runs.
fn apart(a: &Record, b: &Record) -> (f64, f64) {
    let (a, b) = (a.final_state(), b.final_state());
    let distances = a.positions().iter().zip(b.positions()).map(|(x, y)| x.distance(*y));
    let turned = a.orientations().iter().zip(b.orientations()).map(|(p, q)| p.conjugate() * *q);
    let angles = turned.map(|q| 2.0 * q.xyz().length().min(1.0).asin());
    (distances.fold(0.0, f64::max), angles.fold(0.0, f64::max))
}

/// Thrust turns with bodies on which a torque acts: both are integrated together, by series, and as near as fine equal steps say.
#[test]
fn thrust_on_driven_bodies_is_planned_by_series() {
    let torque = || Torque::constant_body(DVec3::new(0.01, 0.0, 0.02));
    let driven = |force: Force| bodies().until(60.0).torque(torque()).force(force);
    let parameters = Parameters::new().number("c", 0.3).expect("a parameter");
    let own = Force::custom("c * to_world(vec(0, 1, 0)) - 0.01 * velocity", parameters).expect("a force");
    for force in [Force::thrust(DVec3::new(1.0, 0.0, 0.5)), own] {
        let scene = driven(force).accuracy(Accuracy::attitude(1e-9));
        let engine = Engine::cpu();
        let plan = Plan::new(&scene, &engine).expect("a plan");
        assert_eq!(plan.method(), Method::Taylor);
        let explained = plan.explain().to_string();
        assert!(explained.contains("turns with the body") && !explained.contains("centre of mass"), "{explained}");
        let planned = engine.run(&plan).expect("a run");
        assert_eq!(planned.trust().recomputed_sample.met, Some(true), "{}", planned.trust().recomputed_sample);
        // A method that is named is taken.
        let pinned = run(&scene.clone().pinned(Method::Rk8, 2e-3, Some(Precision::F64)));
        assert_eq!(pinned.trust().adaptive, None);
        let (distance, angle) = apart(&planned, &pinned);
        assert!(distance < 1e-8 && angle < 1e-9, "{distance} m, {angle} rad");
    }
    // Neither a torque added later nor one stated before changes what is stated.
    let scene = driven(Force::thrust(DVec3::X)).torque(Torque::linear_drag(0.01));
    let explained = Plan::new(&scene, &Engine::cpu()).expect("a plan").explain();
    assert_eq!(explained.classes[0].torques, ["constant-body", "linear-drag"]);
}

/// The total energy of the rotation stays known where all torques have a potential.
#[test]
fn the_energy_of_bodies_under_thrust_is_balanced() {
    let dipole = Torque::magnetic_dipole(DVec3::X, DVec3::new(0.0, 0.0, 0.2));
    let scene = bodies().until(20.0).torque(dipole).force(Force::thrust(DVec3::X)).accuracy(Accuracy::attitude(1e-9));
    let balance = run(&scene).trust().balance;
    assert_eq!(balance.conservative_bodies, BODIES);
    assert!(balance.total_energy.max < 1e-9, "{balance:?}");
}

/// What a plan expects contains the time of moving centres of mass, in the run and in the sample that is recomputed.
#[test]
fn centres_of_mass_count_in_the_expected_time() {
    let engine = Engine::cpu();
    let seconds = |force: Option<Force>, end: f64| {
        let scene = force.into_iter().fold(bodies(), Scene::force).until(end).accuracy(Accuracy::attitude(1e-6));
        let explained = Plan::new(&scene, &engine).expect("a plan").explain();
        (explained.seconds().expect("known"), explained.sample.seconds.expect("known"))
    };
    let swinging = || {
        let text = "vec(0, 0, 1) * cos(20 * time) - 100 * position";
        Force::custom(text, Parameters::new()).expect("a force")
    };
    let (without, sample_without) = seconds(None, 1000.0);
    for force in [swinging(), Force::thrust(DVec3::X)] {
        let (with, sample) = seconds(Some(force.clone()), 1000.0);
        assert!(with > 100.0 * without && sample > 0.1 * with, "{without}, {with}, {sample}");
        assert!(sample > 100.0 * sample_without, "{sample_without}, {sample}");
        let (longer, _) = seconds(Some(force), 4000.0);
        assert!((3.0..5.0).contains(&(longer / with)), "{with}, {longer}");
    }
}

/// A force that turns with driven bodies leaves their events' times as near as without it, though positions between outputs are not known.
#[test]
fn events_of_bodies_under_thrust_are_located() {
    let slow = || Event::new("slow", Quantity::SpinRate, Condition::Falls(0.3)).expect("a level");
    let scene = || bodies().torque(Torque::linear_drag(0.05)).event(slow()).until(60.0).outputs(Outputs::Every(20.0));
    let [with, without] = [scene().force(Force::thrust(DVec3::X)), scene()].map(|scene| {
        let record = run(&scene.accuracy(Accuracy::attitude(1e-9)));
        record.events()[0].occurrences.iter().map(|event| (event.body, event.time)).collect::<Vec<_>>()
    });
    assert_eq!((with.len(), without.len()), (BODIES, BODIES));
    // The spins differ by some 1e-9 of themselves, and fall by 0.02 to 0.05 of themselves in a second.
    for ((body, time), (other, expected)) in with.into_iter().zip(without) {
        assert!(body == other && (time - expected).abs() < 1e-7, "body {body}: {time} s, {expected} s");
    }
}
