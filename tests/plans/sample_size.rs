//! How many bodies are recomputed under sampled torques, which take long to follow.

use glam::{DQuat, DVec3};
use polhode::run::balance;
use polhode::scene::AdaptiveSteps;
use polhode::torque::{Orbit, Sampling};
use polhode::{Engine, Ensemble, Plan, Scene, Torque};

const BODIES: usize = 300;

fn sampled(end: f64) -> Scene {
    let bodies = Ensemble::from_fn(BODIES, |_| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::X)).expect("valid");
    let field = [1e-5, 2e-5, -1e-5, 1e-5].map(Into::into);
    let coils = Torque::magnetorquers(1.0, 0.2, Orbit::circular(1e-3, 1.0), field, Sampling::every(2.0));
    let steps = AdaptiveSteps { tolerance: 1e-6, least_step: None };
    Scene::new(bodies).torque(coils).until(end).adaptive(steps, None)
}

/// The work of torques, whose integration takes as long again, is first left out.
#[test]
fn of_bodies_under_sampled_torques_fewer_are_recomputed_the_more_samples_there_are() {
    // Wherever bodies end, the balance is that of the sample, or of none.
    let (orientation, omega) = ([DQuat::IDENTITY; BODIES], [DVec3::X; BODIES]);
    // A hundred samples, a day of them, a week, of which the balance would take some seconds.
    for (end, bodies, balanced) in [(200.0, 64, Some(64)), (86_400.0, 13, Some(0)), (604_800.0, 8, None)] {
        let scene = sampled(end);
        let plan = Plan::new(&scene, &Engine::cpu()).expect("valid");
        assert_eq!(plan.explain().sample.bodies, bodies, "{end} s");
        if let Some(expected) = balanced {
            assert_eq!(balance(&plan, &orientation, &omega).expect("balanced").bodies, expected, "{end} s");
        }
    }
}
