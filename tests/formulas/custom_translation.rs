//! Custom torques of position and velocity: they are those of the translation in closed form, or the torque is refused.

use crate::common;

use common::random::Random;
use glam::{DQuat, DVec3};
use polhode::bodies::ensemble::Translation;
use polhode::engine::Engine;
use polhode::torque::{Parameters, Torque};
use polhode::{Ensemble, Force, Method, Plan, Precision, Scene};

const BODIES: usize = 21;
/// s; drag takes up to 0.02 to 4 of the reciprocal of its rate.
const END: f64 = 8.0;

fn bodies() -> Ensemble {
    let ensemble = Ensemble::from_fn(BODIES, |body| {
        let mut random = Random::new(5 + body as u64);
        let q = DQuat::from_array([(); 4].map(|()| random.normal())).normalize();
        (DVec3::new(1.0, 1.5, 2.0), q, DVec3::from_array([(); 3].map(|()| random.between(-1.0, 1.0))))
    });
    ensemble.and_then(|ensemble| ensemble.with_translation(translation())).expect("valid bodies")
}

fn translation() -> Translation {
    let mut random = Random::new(99);
    let mut vector = || DVec3::from_array([(); 3].map(|()| random.between(-2.0, 2.0)));
    let (position, velocity): (Vec<DVec3>, Vec<DVec3>) = (0..BODIES).map(|_| (vector(), vector())).unzip();
    Translation { mass: (0..BODIES).map(|body| 0.5 + 0.1 * body as f64).collect(), position, velocity }
}

const TORQUE: &str = "0.1 * cross(to_body(velocity), vec(0, 0, 1)) + 0.02 * to_body(position)
    + 0.1 * vec(sin(position.x), cos(2 * velocity.z), 0)";

fn orientations(scene: &Scene, engine: &Engine) -> Vec<DQuat> {
    let record = engine.run(&Plan::new(scene, engine).expect("a plan")).expect("a run");
    (0..BODIES).map(|body| record.final_state().orientation(body)).collect()
}

/// The largest difference of the ends under [`TORQUE`] and under its text with these definitions of position and velocity.
fn difference(forces: &[Force], definitions: &str, more: impl Fn(Parameters) -> Parameters, engine: &Engine) -> f64 {
    let translation = translation();
    let parameters = Parameters::new()
        .vector("x0", translation.position.clone())
        .and_then(|parameters| parameters.vector("v0", translation.velocity.clone()))
        .expect("names");
    let text = TORQUE.replace("position", "x").replace("velocity", "v");
    let written = Torque::custom(&format!("{definitions}\n{text}"), more(parameters)).expect("a formula");
    let named = Torque::custom(TORQUE, Parameters::new()).expect("a formula");
    assert!(named.needs().position && !written.needs().position);
    let ended = |torque: Torque, is_first: bool| {
        let scene = Scene::new(bodies()).until(END).pinned(Method::Rk8, 0.05, Some(Precision::F64));
        // Forces that come later count too.
        let scene = if is_first { scene.torque(torque.clone()) } else { scene };
        let scene = forces.iter().fold(scene, |scene, force| scene.force(force.clone()));
        let scene = if is_first { scene } else { scene.torque(torque) };
        assert!(!scene.torques()[0].needs().position);
        orientations(&scene, engine)
    };
    let expected = ended(written, true);
    let found = [ended(named.clone(), true), ended(named, false)];
    assert_eq!(found[0], found[1]);
    let largest = |(a, b): (&DQuat, &DQuat)| {
        (0..4).map(|part| (a.to_array()[part] - b.to_array()[part]).abs()).fold(0.0, f64::max)
    };
    expected.iter().zip(&found[0]).map(largest).fold(0.0, f64::max)
}

/// 160 steps, in which torques round by some 1e-15 each.
const BOUND: f64 = 1e-11;

#[test]
fn they_are_straight_without_forces_and_parabolas_under_gravity() {
    let engine = Engine::cpu();
    let straight = "let x = x0 + v0 * time; let v = v0;";
    assert!(difference(&[], straight, |parameters| parameters, &engine) < BOUND);
    let gravity = DVec3::new(0.3, -0.1, -0.981);
    let parabola =
        "let a = vec(0.3, -0.1, -0.981); let x = x0 + v0 * time + 0.5 * time * time * a; let v = v0 + time * a;";
    assert!(difference(&[Force::gravity(gravity)], parabola, |parameters| parameters, &engine) < BOUND);
    // What a fault would make: a hundredth of the acceleration is left out.
    let other = Force::gravity(0.99 * gravity);
    assert!(difference(&[other], parabola, |parameters| parameters, &engine) > 1e-4);
}

#[test]
fn they_follow_drag_at_any_rate() {
    let drag: Vec<f64> = (0..BODIES).map(|body| 0.002 * 1.3_f64.powi(body as i32)).collect();
    let rates: Vec<f64> = drag.iter().zip(translation().mass).map(|(drag, mass)| drag / mass).collect();
    assert!(rates[0] * END < 0.05 && rates[BODIES - 1] * END > 1.0, "{rates:?}");
    let forces = [Force::linear_drag(drag), Force::gravity(DVec3::new(0.0, 0.0, -1.0))];
    let text = "let u = exp(-b * time); let first = (1 - u) / b; let a = vec(0, 0, -1);
        let x = x0 + first * v0 + ((time - first) / b) * a; let v = u * v0 + first * a;";
    let with_rates = |parameters: Parameters| parameters.number("b", rates.clone()).expect("a name");
    // The text loses digits where b t is small: some 1e-16/(b t)² of the path.
    assert!(difference(&forces, text, with_rates, &Engine::cpu()) < 1e-9);
}

#[test]
fn taylor_series_follow_them_too() {
    let torque = Torque::custom(TORQUE, Parameters::new()).expect("a formula");
    let scene = Scene::new(bodies()).until(END).force(Force::linear_drag(0.2)).torque(torque);
    let steps = polhode::scene::AdaptiveSteps { tolerance: 1e-12, least_step: None };
    let engine = Engine::cpu();
    let expected = orientations(&scene.clone().adaptive(steps, Some(Precision::F64)), &engine);
    let found = orientations(&scene.taylor(steps), &engine);
    for (body, (expected, found)) in expected.iter().zip(&found).enumerate() {
        assert!(expected.dot(*found).abs() > 1.0 - 1e-15, "body {body}");
    }
}

#[test]
fn where_they_have_no_closed_form_the_torque_is_refused() {
    let torque = || Torque::custom(TORQUE, Parameters::new()).expect("a formula");
    let refusal = |scene: Scene| Plan::new(&scene.until(1.0), &Engine::cpu()).expect_err("refused").to_string();
    let without = Ensemble::from_fn(3, |_| (DVec3::new(1.0, 1.5, 2.0), DQuat::IDENTITY, DVec3::X)).expect("valid");
    insta::assert_snapshot!(refusal(Scene::new(without).torque(torque())), @"torque 1 (custom): its position and velocity are needed: bodies have none without a mass, a position and a velocity");
    let scene = Scene::new(bodies()).torque(torque()).force(Force::quadratic_drag(0.1));
    insta::assert_snapshot!(refusal(scene), @"torque 1 (custom): its position and velocity have no closed form: expected forces that are constant, gravity or linear drag");
}
