//! What a run says of its progress, and how it ends where nobody wants to wait.

use std::ops::ControlFlow;

use glam::{DQuat, DVec3};
use polhode::bodies::ensemble::Translation;
use polhode::engine::Progress;
use polhode::run::run_into;
use polhode::scene::Outputs;
use polhode::torque::Parameters;
use polhode::{Engine, Ensemble, Error, Force, Plan, Scene};

use crate::common::Nowhere;

fn bodies(count: usize) -> Ensemble {
    Ensemble::from_fn(count, |_| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::new(1.0, 0.1, 0.0)))
        .expect("bodies")
}

/// Springs pull on centres of mass for so long that no machine gets to the end: who waits is told of those that have arrived, and is not asked
/// again once it breaks.
#[test]
fn centres_of_mass_are_waited_for_with_news_of_them() {
    const BODIES: usize = 100_000;
    let translation =
        Translation { mass: vec![1.0; BODIES], position: vec![DVec3::X; BODIES], velocity: vec![DVec3::ZERO; BODIES] };
    let ensemble = bodies(BODIES).with_translation(translation).expect("centres of mass");
    let force = Force::custom("-position", Parameters::new()).expect("a force");
    let scene = Scene::new(ensemble).force(force).until(3000.0);
    let engine = Engine::cpu();
    let plan = Plan::new(&scene, &engine).expect("a plan");
    let mut seen = Vec::new();
    let stopped = run_into(&engine, &plan, &mut Nowhere, &mut |Progress { done, total }| {
        seen.push((done, total));
        if done == 0 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    assert!(matches!(stopped, Err(Error::Interrupted { .. })), "{:?}", stopped.map(|trust| trust.body_steps));
    let (last, before) = seen.split_last().expect("news");
    assert!(0 < last.0 && 2 * last.0 < last.1 && before.iter().all(|news| news.0 == 0), "{seen:?}");
}

/// 11 TB of states: a run that keeps them is refused before it begins.
#[test]
fn outputs_that_do_not_fit_into_memory_are_refused() {
    let scene = Scene::new(bodies(200_000)).until(1000.0).outputs(Outputs::Every(1e-3));
    let engine = Engine::cpu();
    let plan = Plan::new(&scene, &engine).expect("a plan");
    let refused = engine.run(&plan);
    assert!(matches!(refused, Err(Error::TooManyBodies { bodies: 200_000, .. })), "{:?}", refused.map(|_| ()));
}
