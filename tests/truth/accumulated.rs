//! Quantities that add up in the course of the motion, against their closed forms.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use polhode::record::Record;
use polhode::scene::{Condition, Event};
use polhode::torque::control::Accumulation;
use polhode::{Accuracy, Engine, Ensemble, Outputs, Plan, Quantity, Scene, Torque};

fn run(scene: &Scene) -> Record {
    let engine = Engine::cpu();
    let plan = Plan::new(scene, &engine).expect("a plan");
    engine.run(&plan).expect("a run")
}

fn one(moments: DVec3, omega: DVec3) -> Scene {
    let ensemble = Ensemble::from_columns(&[moments], &[DQuat::IDENTITY], &[omega]).expect("a body");
    Scene::new(ensemble).accuracy(Accuracy::attitude(1e-10))
}

fn means(record: &Record, quantity: &Quantity) -> Vec<(f64, f64)> {
    let of = |at: &polhode::record::Statistics| (at.time, at.of(quantity).expect("asked for").mean);
    record.statistics().iter().map(of).collect()
}

/// The spin of a sphere under linear drag decays with the rate c/I. The trapezoidal rule's error is h²/12 times the change of the rate of
/// what is integrated, to fourth order. Between two samples the last interval is a part of one.
#[test]
fn the_revolutions_of_a_sphere_under_drag() {
    let (rate, spin, every) = (0.2, 3.0, 0.25);
    let scene = one(DVec3::ONE, DVec3::new(0.0, 0.0, spin)).torque(Torque::linear_drag(rate)).until(20.0);
    let formula =
        "# Turns; not radians.\nlet w = angular_velocity; # rad/s; body axes\nnorm(w) / (2 * pi) # the end; of it";
    let (scene, revolutions) =
        scene.accumulating(Accumulation::Integral, ("revolutions", "1"), formula, every).expect("a formula");
    // At samples and between them; the first before the first sample.
    let times = vec![0.1, 0.25, 0.3, 1.0, 1.9, 5.0, 12.5, 20.0];
    let record = run(&scene.outputs(Outputs::Times(times)).statistics([&revolutions]));
    for (time, found) in means(&record, &revolutions) {
        let value = |time: f64| spin * (-rate * time).exp() / TAU;
        let samples = (time / every).floor() as u32;
        let ends = (0..=samples).map(|sample| every * f64::from(sample)).chain([time]);
        let trapezoids = ends.clone().zip(ends.skip(1)).map(|(a, b)| 0.5 * (b - a) * (value(a) + value(b)));
        let rule: f64 = trapezoids.sum();
        assert!((found - rule).abs() < 1e-9 * rule, "{time} s: {found}, {rule}");
        let exact = spin * (1.0 - (-rate * time).exp()) / rate / TAU;
        let error = every * every / 12.0 * rate * (value(0.0) - value(time));
        assert!((found - exact).abs() < 1.01 * error, "{time} s: {found}, {exact}, {error:e}");
    }
}

/// A symmetric body: the component of its angular momentum across the axis turns with the rate Ω = (1 − I₃/I₁) ω₃.
#[test]
fn the_sign_changes_of_what_turns_at_a_known_rate() {
    let (moments, omega) = (DVec3::new(1.0, 1.0, 1.75), DVec3::new(0.5, 0.0, 2.0));
    let rate: f64 = (1.0 - moments.z / moments.x) * omega.z;
    let scene = one(moments, omega).until(40.0).outputs(Outputs::Every(1.1));
    let (scene, changes) =
        scene.accumulating(Accumulation::SignChanges, ("changes", "1"), "angular_momentum.x", 0.3).expect("a formula");
    let third = Event::new("third", changes.clone(), Condition::Above(2.5)).expect("a level");
    let record = run(&scene.statistics([&changes]).event(third));
    // cos(Ωt) changes its sign at odd multiples of a quarter turn.
    let expected = |time: f64| (rate.abs() * time / std::f64::consts::PI + 0.5).floor();
    let found = means(&record, &changes);
    assert_eq!(found.len(), 37);
    assert!(found.iter().all(|&(time, found)| found == expected(time)), "{found:?}");
    assert!(found.last().expect("an output").1 == 19.0, "{found:?}");
    let time = record.events()[0].occurrences[0].time;
    let exact = 2.5 * std::f64::consts::PI / rate.abs();
    assert!((time - exact).abs() < 1e-9, "{time} s, {exact} s");
}

/// Two sums with periods of their own, of two bodies of which one stops: its sums stop with it.
#[test]
fn sums_stop_with_the_body() {
    let spins = [1.0, 2.0];
    let bodies = spins.map(|spin| DVec3::new(0.0, 0.0, spin));
    let ensemble = Ensemble::from_columns(&[DVec3::ONE; 2], &[DQuat::IDENTITY; 2], &bodies).expect("bodies");
    let scene = Scene::new(ensemble).accuracy(Accuracy::attitude(1e-9)).until(10.0).outputs(Outputs::Every(2.5));
    let (scene, turned) =
        scene.accumulating(Accumulation::Integral, ("turned", "rad"), "angular_velocity.z", 0.4).expect("a formula");
    let (scene, age) = scene.accumulating(Accumulation::Integral, ("age", "s"), "1", 0.7).expect("a formula");
    let event = Event::new("turned", turned.clone(), Condition::Above(12.0)).expect("a level").stopping();
    let record = run(&scene.event(event).statistics([&turned, &age]));
    // The second body stops after 6 s.
    let ages = [2.5, 5.0, 6.75, 8.0];
    let angles = [3.75, 7.5, 9.75, 11.0];
    for ((found, expected), name) in
        [(means(&record, &age), ages), (means(&record, &turned), angles)].iter().zip(["age", "turned"])
    {
        let error =
            found.iter().zip(expected).map(|((_, found), expected)| (found - expected).abs()).fold(0.0, f64::max);
        assert!(found.len() == 4 && error < 1e-9, "{name}: {found:?}");
    }
}
