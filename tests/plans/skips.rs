//! Every skip from both sides of its condition: taken just inside, with the result of a run without skipping; not taken just outside.
//!
//! The classes of free bodies are in `plan.rs`, states that statistics do without in `statistics.rs`.

use std::ops::ControlFlow;

use glam::{DQuat, DVec3};
use polhode::bodies::ensemble::Translation;
use polhode::engine::gpu::GpuOptions;
use polhode::plan::{Plan, SkipName, Treatment};
use polhode::record::{OutputState, Record, Sink};
use polhode::run::run_into;
use polhode::torque::Torque;
use polhode::{Accuracy, Engine, Ensemble, Force, Method, Outputs, Precision, Result, Scene};

const BODIES: usize = 70;
const SPAN: f64 = 3.0;
/// Asked for where nothing is pinned, rad.
const TARGET: f64 = 1e-7;
/// Both ways are within the target of the truth in 99 of 100 bodies, and the worst of 70 within a few times that.
const BOTH_WAYS: f64 = 4.0 * TARGET;

fn ensemble() -> Ensemble {
    Ensemble::from_fn(BODIES, |body| {
        let x = body as f64;
        let omega = DVec3::new(0.7 + 0.01 * x, -1.1, 0.4 + 0.02 * x);
        (DVec3::new(1.0, 2.0, 2.5), DQuat::from_rotation_x(0.1 * x), omega)
    })
    .expect("valid bodies")
}

fn translation() -> Translation {
    let vector = |body: usize| DVec3::new(body as f64, 1.0, -2.0);
    Translation {
        mass: (0..BODIES).map(|body| 1.0 + 0.1 * body as f64).collect(),
        position: (0..BODIES).map(vector).collect(),
        velocity: (0..BODIES).map(|body| 0.3 * vector(body)).collect(),
    }
}

fn scene(ensemble: Ensemble) -> Scene {
    Scene::new(ensemble).until(SPAN).accuracy(Accuracy::attitude(TARGET))
}

fn run(scene: &Scene) -> Record {
    let engine = Engine::cpu();
    engine.run(&Plan::new(scene, &engine).expect("a valid plan")).expect("runs")
}

/// Bodies that a skip concerns; 0 where it is not taken.
fn skipped(scene: &Scene, name: SkipName) -> usize {
    let plan = Plan::new(scene, &Engine::cpu()).expect("a valid plan");
    plan.skips().iter().find(|skip| skip.name == name).map_or(0, |skip| skip.bodies)
}

fn greatest_difference(a: &Record, b: &Record) -> f64 {
    let angle = |body| {
        let relative: DQuat = a.final_state().orientation(body).conjugate() * b.final_state().orientation(body);
        2.0 * DVec3::new(relative.x, relative.y, relative.z).length().atan2(relative.w.abs())
    };
    (0..a.final_state().len()).map(angle).fold(0.0, f64::max)
}

fn drag(coefficient: f64) -> Torque {
    Torque::linear_drag((0..BODIES).map(|body| if body == 0 { coefficient } else { 0.0 }).collect::<Vec<_>>())
}

#[test]
fn a_torque_of_no_strength_has_no_code_and_the_least_that_there_is_has() {
    for name in [SkipName::Torque, SkipName::Free] {
        let without = scene(ensemble()).torque(drag(0.0));
        assert_eq!(skipped(&without, name), BODIES, "{name}");
        let with = scene(ensemble()).torque(drag(f64::MIN_POSITIVE));
        assert_eq!(skipped(&with, name), BODIES - 1, "{name}");
        assert_eq!(skipped(&without.clone().skipping(false), name), 0, "{name}, without skipping");
    }
    let scene = scene(ensemble()).torque(drag(0.0));
    let (found, all) = (run(&scene), run(&scene.clone().skipping(false)));
    assert_eq!(found.trust().body_steps, 0);
    assert!(all.trust().body_steps > 0);
    let difference = greatest_difference(&found, &all);
    assert!(difference <= BOTH_WAYS, "{difference:e}");
}

#[test]
fn without_masses_nothing_moves_and_with_them_the_rotation_is_the_same_to_the_bit() {
    let still = scene(ensemble());
    let moving = scene(ensemble().with_translation(translation()).expect("valid"));
    assert_eq!(skipped(&still, SkipName::Translation), BODIES);
    assert_eq!(skipped(&moving, SkipName::Translation), 0);
    let (a, b) = (run(&still), run(&moving));
    assert!(a.final_state().positions().is_empty());
    assert_eq!(b.final_state().positions().len(), BODIES);
    assert_eq!(a.final_state().orientations(), b.final_state().orientations());
}

/// One step of order 4 of dv/dt = a − b v errs by (b h)⁵/120 of the velocity; here b h is at most 0.04, over some hundred
/// steps, and rounding remains.
const TRANSLATION_STEPS: f64 = 1e-9;

#[test]
fn positions_in_closed_form_are_those_of_small_steps() {
    let forces = || {
        scene(ensemble().with_translation(translation()).expect("valid"))
            .force(Force::gravity(DVec3::new(0.0, 0.0, -9.81)))
            .force(Force::linear_drag(0.4))
            .pinned(Method::Rk4, 0.05, Some(Precision::F64))
            .outputs(Outputs::Every(0.5))
    };
    let long = forces().skipping(false);
    assert_eq!(skipped(&forces(), SkipName::TranslationSteps), BODIES);
    assert_eq!(skipped(&long, SkipName::TranslationSteps), 0);
    let (found, all) = (run(&forces()), run(&long));
    let mut greatest: f64 = 0.0;
    for (a, b) in found.snapshots().iter().zip(all.snapshots()) {
        for body in 0..BODIES {
            greatest = greatest.max((a.positions()[body] - b.positions()[body]).length());
            greatest = greatest.max((a.velocities()[body] - b.velocities()[body]).length());
        }
    }
    assert!(greatest > 0.0, "both ways are the same code");
    // Positions of up to 100 m and velocities of up to 40 m/s.
    assert!(greatest < 100.0 * TRANSLATION_STEPS, "{greatest:e}");
}

#[test]
fn times_that_nobody_asks_for_are_not_recorded_and_change_nothing() {
    // Steps of 1/64 s hit every time, so that the end must be the same to the bit.
    let pinned = |outputs| scene(ensemble()).pinned(Method::Rk4, 1.0 / 64.0, Some(Precision::F64)).outputs(outputs);
    let (end, more) = (pinned(Outputs::End), pinned(Outputs::Times(vec![1.0])));
    assert_eq!(skipped(&end, SkipName::Outputs), BODIES);
    assert_eq!(skipped(&more, SkipName::Outputs), 0);
    let (a, b, c) = (run(&end), run(&more), run(&end.clone().skipping(false)));
    assert_eq!((a.snapshots().len(), b.snapshots().len()), (1, 2));
    assert_eq!(a.final_state(), b.final_state());
    assert_eq!(a.final_state(), c.final_state());
}

/// Takes some of the outputs and does nothing with them.
struct Wanting(fn(usize, usize) -> bool);

impl Sink for Wanting {
    fn wants(&mut self, index: usize, count: usize, _: f64) -> bool {
        self.0(index, count)
    }
    fn bodies(&mut self, _: usize, _: f64, _: usize, _: &[OutputState]) -> Result<()> {
        Ok(())
    }
}

#[test]
fn outputs_that_nobody_wants_do_not_leave_the_device() {
    let options = GpuOptions { software: true, ..GpuOptions::default() };
    let engine = Engine::gpu(options).expect("tests need a Vulkan driver");
    let outputs = Outputs::Every(0.5);
    // One table: seven components in two words each and a status, of f32.
    let table = (BODIES * 15 * size_of::<f32>()) as u64;
    let pinned = scene(ensemble()).pinned(Method::Rk4, 0.125, Some(Precision::F32)).outputs(outputs.clone());
    let closed_form = scene(ensemble()).accuracy(Accuracy::attitude(1e-5)).outputs(outputs);
    for scene in [pinned, closed_form] {
        let plan = Plan::new(&scene, &engine).expect("valid");
        let bytes = |wants: fn(usize, usize) -> bool| {
            let mut sink = Wanting(wants);
            run_into(&engine, &plan, &mut sink, &mut |_| ControlFlow::Continue(())).expect("runs").traffic.bytes_read
        };
        assert_eq!(plan.times().len(), 6);
        assert_eq!(bytes(|_, _| true), 6 * table);
        assert_eq!(bytes(|index, count| index + 1 == count || index == 2), 2 * table);
        assert_eq!(bytes(|index, count| index + 1 == count), table);
    }
}

/// Two kinds of bodies, one `ratio` times as fast as the other, all driven.
fn two_rates(ratio: f64) -> Scene {
    let bodies = Ensemble::from_fn(BODIES, |body| {
        let omega = DVec3::new(0.7, -1.1, 0.4) * if body % 2 == 0 { 1.0 } else { ratio };
        (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, omega)
    });
    scene(bodies.expect("valid")).until(100.0).torque(Torque::linear_drag(0.01))
}

/// The same in equal steps, which alone follow a random torque; it does less than rounding.
fn two_rates_in_equal_steps(ratio: f64) -> Scene {
    two_rates(ratio).torque(Torque::white_noise(1e-20, 1)).without_pilot()
}

#[test]
fn bodies_that_choose_their_steps_are_one_group_and_slower_ones_step_less() {
    let scene = two_rates(8.0);
    let plan = Plan::new(&scene, &Engine::cpu()).expect("valid");
    assert!(matches!(plan.groups(), [group] if matches!(group.treatment, Treatment::Adaptive { .. })));
    assert_eq!(skipped(&scene, SkipName::Steps), BODIES);
    assert_eq!(skipped(&scene.clone().skipping(false), SkipName::Steps), 0);
    let (found, all) = (run(&scene), run(&scene.clone().skipping(false)));
    let steps = found.trust().adaptive.expect("adaptive steps").accepted;
    assert!(4 * steps.median < steps.max, "half of the bodies are slow: {steps}");
    assert!(found.trust().body_steps < all.trust().body_steps);
    let difference = greatest_difference(&found, &all);
    assert!(difference <= BOTH_WAYS, "{difference:e}");
}

#[test]
fn bodies_of_one_equal_step_are_one_group_and_slower_ones_step_less() {
    let two_rates = two_rates_in_equal_steps;
    let groups = |ratio: f64| Plan::new(&two_rates(ratio), &Engine::cpu()).expect("valid").groups().len();
    let (mut inside, mut outside) = (1.0, 2.0);
    assert_eq!((groups(inside), groups(outside)), (1, 2));
    while outside - inside > 1e-12 {
        let middle = 0.5 * (inside + outside);
        if groups(middle) == 1 { inside = middle } else { outside = middle }
    }
    assert_eq!(skipped(&two_rates(inside), SkipName::Steps), 0);
    assert_eq!(skipped(&two_rates(outside), SkipName::Steps), BODIES / 2, "the slower half");
    let (found, all) = (run(&two_rates(outside)), run(&two_rates(outside).skipping(false)));
    assert!(found.trust().body_steps < all.trust().body_steps);
    let difference = greatest_difference(&found, &all);
    assert!(difference <= BOTH_WAYS, "{difference:e}");
}
