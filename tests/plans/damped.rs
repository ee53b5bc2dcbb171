//! Damped bodies over long times: they come to rest early, and neither the time of planning nor what it foretells goes by how they begin.

use polhode::{Accuracy, Engine, Plan, Scene, Torque};

use crate::common::asymmetric_ensemble;
use crate::common::torques::middle_moments;

const BODIES: usize = 20;

#[test]
fn bodies_that_drag_stops_early_are_planned_by_what_they_do_in_the_whole_time() {
    // They turn by some two thousand radians; at their first rates it would be ten million.
    let ensemble = asymmetric_ensemble(BODIES, 3);
    let drag: Vec<f64> = middle_moments(BODIES, 3).iter().map(|moment| 1e-3 * moment).collect();
    let scene = Scene::new(ensemble).torque(Torque::linear_drag(drag)).until(5e6).accuracy(Accuracy::attitude(1e-6));
    let engine = Engine::cpu();
    let plan = Plan::new(&scene, &engine).expect("within reach");
    let record = engine.run(&plan).expect("a run");
    let recomputed = record.trust().recomputed_sample;
    assert_eq!(recomputed.met, Some(true), "{recomputed}");
    let foretold = plan.explain().classes[0].steps.median as f64;
    let taken = record.trust().body_steps as f64 / BODIES as f64;
    assert!(foretold > 0.3 * taken && foretold < 3.0 * taken, "{foretold:e}, {taken:e}");
}
