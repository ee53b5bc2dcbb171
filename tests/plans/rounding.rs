//! Targets near rounding: met, or refused as out of reach.

use std::path::Path;

use glam::{DQuat, DVec3};
use polhode::record::Record;
use polhode::scene::AdaptiveSteps;
use polhode::study::Study;
use polhode::{Accuracy, Engine, Ensemble, Error, Method, Plan, Scene, Torque};

use crate::support::attitude_error;

fn run(scene: &Scene) -> Record {
    let engine = Engine::cpu();
    let plan = Plan::new(scene, &engine).expect("a plan");
    engine.run(&plan).expect("a run")
}

/// Near rounding two sequences of steps are as far apart as either is from the motion: finer steps do not lessen that, and plans that thought so
/// missed what they promised by a factor of ten.
#[test]
fn rounding_is_not_taken_for_an_error_that_finer_steps_lessen() {
    const TOPS: &str = "seed = 6\n[bodies]\ncount = 10\n\
        inertia = { moments = [0.01, 0.011, 0.02], scatter = 0.02 }\n\
        orientation = { distribution = \"uniform\" }\n\
        angular_velocity = { distribution = \"normal\", mean = [0, 0, 30], sigma = 3 }\n\
        [[torque]]\nmodel = \"heavy-top\"\nmass = 0.5\ncentre = [0, 0, 0.04]\ngravity = [0, 0, -9.81]\n\
        [time]\nend = 100\noutputs = { every = 10 }\n[accuracy]\n";
    let engine = Engine::cpu();
    let mut refused = 0;
    for attitude in [1e-12, 1e-11, 1e-9] {
        let study =
            Study::parse(Path::new("study.toml"), &format!("{TOPS}attitude = {attitude:e}\n")).expect("a study");
        let scene = study.scene().expect("a scene");
        match Plan::new(&scene, &engine) {
            Ok(plan) => {
                let recomputed = engine.run(&plan).expect("a run").trust().recomputed_sample;
                assert_eq!(recomputed.met, Some(true), "{attitude:e}: {recomputed}");
            }
            Err(Error::AccuracyOutOfReach { factor, .. }) => {
                assert!(attitude < 1e-9 && factor > 1.0 && factor * attitude < 1e-8, "{attitude:e}: {factor:e}");
                refused += 1;
            }
            Err(error) => panic!("{attitude:e}: {error}"),
        }
    }
    assert!(refused >= 1, "1e-12 rad over 3000 rad is below rounding");
}

/// Spins about the axis of the greatest moment, which drag slows down: the angle is ω₀ I/c (1 − exp(−c t/I)).
const SPINNING: usize = 100;
const DRAG: f64 = 1e-3;
const SPAN: f64 = 432_000.0;

fn spin(body: usize) -> (f64, f64) {
    (600.0 + body as f64, 0.02 + 0.18 * body as f64 / SPINNING as f64)
}

fn spinning() -> Scene {
    let body = |body: usize| {
        let (moment, rate) = spin(body);
        (DVec3::new(400.0, 500.0, moment), DQuat::IDENTITY, DVec3::Z * rate)
    };
    let scene = Scene::new(Ensemble::from_fn(SPINNING, body).expect("bodies"));
    scene.torque(Torque::linear_drag(DRAG)).until(SPAN)
}

/// The 99th percentile of the true errors, rad.
fn true_error(record: &Record) -> f64 {
    let error = |body: usize| {
        let (moment, rate) = spin(body);
        let angle = rate * moment / DRAG * -(-DRAG * SPAN / moment).exp_m1();
        attitude_error(record.final_state().orientation(body), DQuat::from_rotation_z(angle))
    };
    let mut errors: Vec<f64> = (0..SPINNING).map(error).collect();
    errors.sort_by(f64::total_cmp);
    errors[SPINNING - 2]
}

/// At the least tolerance no other is finer, and the same steps once more would round alike: the sample's series are finer than any that a
/// study may ask for.
#[test]
fn errors_by_rounding_are_reported() {
    let finest = AdaptiveSteps { tolerance: 2e-15, least_step: None };
    let record = run(&spinning().taylor(finest).recompute(SPINNING));
    let (found, exact) = (record.trust().recomputed_sample.attitude.p99, true_error(&record));
    assert!(exact > 1e-10 && exact < 1e-8, "{exact:e}");
    assert!(found > exact / 3.0 && found < 3.0 * exact, "{found:e}, {exact:e}");
}

/// Series at their finest keep to the target; a pilot of few bodies over a part of the time, with margins for the others, does not show that.
#[test]
fn what_series_meet_near_rounding_is_planned_and_met() {
    let scene = spinning().accuracy(Accuracy::attitude(1e-8));
    let record = run(&scene);
    let recomputed = record.trust().recomputed_sample;
    assert_eq!(recomputed.met, Some(true), "{recomputed}");
    let exact = true_error(&record);
    assert!(exact <= 1e-8, "{exact:e}");
}

/// Thin plates about whose normal two moments are almost alike: what series leave out at the least tolerance that a study may ask for is more
/// than rounding.
#[test]
fn series_of_plans_are_finer_where_it_takes_that() {
    const PLATES: &str = "seed = 1\n[bodies]\ncount = 30\ninertia = [1e-4, 1, 1.0001]\n\
        orientation = { distribution = \"uniform\" }\n\
        angular_velocity = { distribution = \"direction\", magnitude = { distribution = \"uniform\", low = 0.02, high = 0.2 } }\n\
        [[torque]]\nmodel = \"constant-body\"\ntorque = [1e-4, 1e-4, 1e-4]\n\
        [time]\nend = 300\n[accuracy]\nattitude = 3e-9\n";
    let scene = Study::parse(Path::new("study.toml"), PLATES).and_then(|study| study.scene()).expect("a scene");
    let record = run(&scene);
    let recomputed = record.trust().recomputed_sample;
    assert_eq!(recomputed.met, Some(true), "{recomputed}");
}

/// Rounding in a million equal steps adds up to more than in the few of series, which a comparison of equal steps with finer ones over a part of
/// the time does not show.
#[test]
fn equal_steps_are_not_taken_for_more_accurate_than_their_rounding() {
    const DEBRIS: &str = "seed = 2\n[bodies]\ncount = 100\n\
        inertia = { moments = [400.0, 500.0, 600.0], scatter = 0.1 }\n\
        orientation = { distribution = \"uniform\" }\n\
        angular_velocity = { distribution = \"direction\", magnitude = { distribution = \"uniform\", low = 0.02, high = 0.2 } }\n\
        [[torque]]\nmodel = \"magnetic-dipole\"\nmoment = [0, 0, 1]\nfield = [0, 3e-5, 0]\n\
        [time]\nend = 40000.0\n[accuracy]\nattitude = 5e-11\n";
    let scene = Study::parse(Path::new("study.toml"), DEBRIS).and_then(|study| study.scene()).expect("a scene");
    let engine = Engine::cpu();
    // If all bodies take the same steps these are equal, and err by some 2e-10 rad.
    match Plan::new(&scene.clone().skipping(false), &engine) {
        Err(Error::AccuracyOutOfReach { factor, .. }) => assert!((2.0..20.0).contains(&factor), "{factor:e}"),
        other => panic!("{:?}", other.map(|plan| plan.method())),
    }
    let plan = Plan::new(&scene, &engine).expect("a plan");
    assert_eq!(plan.method(), Method::Taylor);
    let recomputed = engine.run(&plan).expect("a run").trust().recomputed_sample;
    assert_eq!(recomputed.met, Some(true), "{recomputed}");
    // What the plan foretells is of the size of what the run shows.
    let foretold = plan.explain().classes[0].error.expect("a pilot");
    assert!(
        foretold > 0.1 * recomputed.attitude.p99 && foretold < 10.0 * recomputed.attitude.p99,
        "{foretold:e}, {recomputed}"
    );
}
