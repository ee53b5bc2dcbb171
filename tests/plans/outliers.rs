//! A few bodies that are far faster than all others.

use std::path::Path;

use glam::{DQuat, DVec3};
use polhode::study::Study;
use polhode::{Accuracy, Engine, Ensemble, Plan, Scene, Torque};

/// They take thousands of times the steps of the others, and more than a hundred thousand: that is no reason to give them up.
#[test]
fn few_fast_bodies_reach_the_end() {
    const BODIES: usize = 400;
    let spin = |body: usize| match body % 200 {
        7 => DVec3::new(100.0, 1.0, -30.0),
        place => DVec3::new(0.01, 1e-4 * place as f64, -0.005),
    };
    let ensemble = Ensemble::from_fn(BODIES, |body| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, spin(body)));
    let torque = Torque::magnetic_dipole(DVec3::new(0.1, 0.0, 0.0), DVec3::new(0.0, 0.0, 0.01));
    let scene = Scene::new(ensemble.expect("bodies")).torque(torque).until(1000.0).accuracy(Accuracy::attitude(1e-8));
    let engine = Engine::cpu();
    let record = engine.run(&Plan::new(&scene, &engine).expect("within reach")).expect("a run");
    assert!(record.trust().failures.is_empty(), "{:?}", record.trust().failures);
    assert_ne!(record.trust().recomputed_sample.met, Some(false), "{}", record.trust().recomputed_sample);
}

/// Of 2,000 bodies 5 turn at 100 rad/s: they do not decide whether 99 % meet a target, though one of them may be in the pilot's sample. Their time
/// counts: they take over ten times as long as all others.
#[test]
fn few_fast_bodies_leave_targets_within_reach() {
    const STUDY: &str = "seed = 1\n[bodies]\ncount = 2000\ninertia = [1, 2, 3]\norientation = { distribution = \"uniform\" }\n\
        [bodies.angular_velocity]\ndistribution = \"mixture\"\nweights = [0.001, 0.999]\n\
        of = [{ distribution = \"normal\", mean = 100, sigma = 1 }, { distribution = \"normal\", mean = 0, sigma = 0.01 }]\n\
        [[torque]]\nmodel = \"magnetic-dipole\"\nmoment = [0.1, 0, 0]\nfield = [0, 0, 0.01]\n\
        [time]\nend = 1000\noutputs = { every = 10 }\n[accuracy]\nattitude = 1e-6\n";
    let study = Study::parse(Path::new("study.toml"), STUDY).expect("a study");
    let scene = study.scene().expect("a scene");
    let is_fast = |body: usize| scene.ensemble().angular_velocity_body()[body].length() > 50.0;
    let slow = (0..2000).find(|&first| !(first..first + 100).any(is_fast)).expect("a hundred slow ones in a row");
    let engine = Engine::cpu();
    for target in [1e-5, 1e-6, 1e-7, 1e-8] {
        let scene = scene.clone().accuracy(Accuracy::attitude(target));
        let plan = Plan::new(&scene, &engine).unwrap_or_else(|error| panic!("{target}: {error}"));
        let seconds = plan.explain().seconds().expect("known");
        let slow = scene.only(slow..slow + 100);
        let of_slow = Plan::new(&slow, &engine).expect("a plan").explain().seconds().expect("known");
        assert!(seconds > 3.0 * 20.0 * of_slow, "{target}: {seconds}, {of_slow}");
    }
}
