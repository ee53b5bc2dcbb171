//! Custom torques of position and velocity: they are those of the translation in closed form, or the centre of mass is integrated with the
//! rotation (truth of that: `tests/truth/translation/coupled.rs`), or the torque is refused.

use crate::common;

use common::random::Random;
use glam::{DQuat, DVec3};
use polhode::bodies::ensemble::Translation;
use polhode::engine::batch::prepare_with;
use polhode::engine::{Backend, Engine};
use polhode::torque::{Parameters, SampledLaw, Torque};
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
    let law =
        SampledLaw::new(Parameters::new(), 0.4, 0.1).expect("a law").sample_vector("u", "position").expect("a formula");
    let sampled = law.torque("0.1 * to_body(u)").expect("a torque");
    insta::assert_snapshot!(refusal(dragged().torque(sampled)), @"torque 1 (custom): it is sampled, and its position and velocity have no closed form: expected forces that are constant, gravity or linear drag, or a torque that is formed at every time");
}

/// Bodies whose positions have no closed form.
fn dragged() -> Scene {
    Scene::new(bodies()).force(Force::gravity(DVec3::X)).force(Force::quadratic_drag(0.1)).until(1.0)
}

#[test]
fn what_cannot_integrate_them_with_the_rotation_is_refused() {
    let scene = || dragged().torque(Torque::custom(TORQUE, Parameters::new()).expect("a formula"));
    let (cpu, gpu) = (Engine::cpu(), common::gpu());
    let refusal = |scene: Scene, engine: &Engine| Plan::new(&scene, engine).expect_err("refused").to_string();
    let steps = polhode::scene::AdaptiveSteps { tolerance: 1e-9, least_step: None };
    insta::assert_snapshot!(refusal(scene().pinned(Method::Rk4, 0.01, None), &cpu), @r#"rk4: torque 1 (custom) names a position or velocity that has no closed form under force 2 (quadratic-drag), which series alone integrate: use method "taylor" with a tolerance, or accuracy.attitude without a method"#);
    insta::assert_snapshot!(refusal(scene().adaptive(steps, None), &cpu), @r#"rk8: torque 1 (custom) names a position or velocity that has no closed form under force 2 (quadratic-drag), which series alone integrate: use method "taylor" with a tolerance, or accuracy.attitude without a method"#);
    insta::assert_snapshot!(refusal(scene().taylor(steps), &gpu), @r#"taylor: torque 1 (custom) names a position or velocity that has no closed form under force 2 (quadratic-drag), which series alone integrate, on the CPU: use engine "cpu" or "auto""#);
    insta::assert_snapshot!(refusal(scene(), &gpu), @r#"taylor: torque 1 (custom) names a position or velocity that has no closed form under force 2 (quadratic-drag), which series alone integrate, on the CPU: use engine "cpu" or "auto""#);
    insta::assert_snapshot!(refusal(scene().precision(Some(Precision::F32)), &cpu), @r#"taylor: torque 1 (custom) names a position or velocity that has no closed form under force 2 (quadratic-drag), which series alone integrate, in f64: use precision "f64" or "auto""#);
    insta::assert_snapshot!(refusal(scene().torque(Torque::white_noise(0.1, 3)), &cpu), @"taylor: torque 1 (custom) names a position or velocity that has no closed form under force 2 (quadratic-drag), which series alone integrate, in steps that have no draws of white noise: leave out one of the two");
    // Without skipping, without a pilot and in statistics they are integrated all the same.
    for scene in [scene().skipping(false), scene().without_pilot(), scene()] {
        assert_eq!(Plan::new(&scene, &cpu).expect("a plan").method(), Method::Taylor);
    }
}

/// Engines themselves refuse a batch whose centres of mass are part of the state.
#[test]
fn no_session_but_of_series_takes_them() {
    let scene = dragged().torque(Torque::custom(TORQUE, Parameters::new()).expect("a formula"));
    let batch = || prepare_with(scene.ensemble(), scene.torques(), 1.0, Precision::F64).expect("columns").1;
    let steps = polhode::scene::AdaptiveSteps { tolerance: 1e-9, least_step: None };
    for engine in [Engine::cpu(), Engine::cpu_scalar(), common::gpu()] {
        let refusals = [
            engine.start(batch(), Method::Rk8).err().map(|error| error.to_string()),
            engine.start_adaptive(batch(), steps).err().map(|error| error.to_string()),
        ];
        for refusal in refusals {
            let refusal = refusal.expect("refused");
            assert!(refusal.contains("which series alone integrate"), "{refusal}");
        }
    }
    assert!(Engine::cpu().start_taylor(batch(), steps).is_ok());
}

/// A part of the bodies, of every lane width and one by one.
#[test]
fn lanes_and_single_bodies_integrate_them_alike() {
    let scene = dragged().until(END).torque(Torque::custom(TORQUE, Parameters::new()).expect("a formula"));
    let scene = scene.taylor(polhode::scene::AdaptiveSteps { tolerance: 1e-13, least_step: None });
    let ends = |engine: Engine| {
        let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("runs");
        (record.final_state().positions().to_vec(), record.final_state().orientations().to_vec())
    };
    let (lanes, single) = (ends(Engine::cpu()), ends(Engine::cpu_scalar()));
    for body in 0..BODIES {
        assert!(lanes.0[body].distance(single.0[body]) < 1e-11, "body {body}");
        assert!(lanes.1[body].dot(single.1[body]).abs() > 1.0 - 1e-15, "body {body}");
    }
}
