//! What a run says of its progress, and how it ends where nobody wants to wait.

use std::ops::ControlFlow;
use std::time::Instant;

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

/// Springs that pull on centres of mass: half of the work is theirs, and takes seconds.
fn springs(count: usize) -> Scene {
    let translation =
        Translation { mass: vec![1.0; count], position: vec![DVec3::X; count], velocity: vec![DVec3::ZERO; count] };
    let ensemble = bodies(count).with_translation(translation).expect("centres of mass");
    Scene::new(ensemble).force(Force::custom("-position", Parameters::new()).expect("a force")).until(300.0)
}

#[test]
fn centres_of_mass_are_waited_for_with_news_of_them() {
    let scene = springs(3000);
    let engine = Engine::cpu();
    let plan = Plan::new(&scene, &engine).expect("a plan");
    let mut seen = Vec::new();
    let done = run_into(&engine, &plan, &mut Nowhere, &mut |Progress { done, total }| {
        seen.push((done, total));
        ControlFlow::Continue(())
    });
    done.expect("a run");
    assert!(seen.windows(2).all(|pair| pair[0].0 <= pair[1].0), "{seen:?}");
    let early = seen.iter().filter(|(done, total)| 0 < *done && 2 * done < *total).count();
    assert!(early > 0, "{seen:?}");
}

#[test]
fn who_breaks_is_not_asked_again() {
    let scene = springs(30_000);
    let engine = Engine::cpu();
    let plan = Plan::new(&scene, &engine).expect("a plan");
    let (mut asked, mut since) = (0, None);
    let stopped = run_into(&engine, &plan, &mut Nowhere, &mut |_| {
        asked += 1;
        since = Some(Instant::now());
        ControlFlow::Break(())
    });
    assert!(matches!(stopped, Err(Error::Interrupted { .. })), "{:?}", stopped.map(|trust| trust.body_steps));
    assert_eq!(asked, 1);
    println!("it ended after {:?}", since.map(|since| since.elapsed()));
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
