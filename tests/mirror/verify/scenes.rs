//! Adaptive steps, projected ones, closed forms, centres of mass, and accuracies that are asked for.

use glam::DVec3;
use polhode::bodies::ensemble::Translation;
use polhode::engine::Engine;
use polhode::math::Precision;
use polhode::scene::AdaptiveSteps;
use polhode::verify::Field;
use polhode::{Force, Method, Outputs, Scene, Torque};

use super::grid::{GRID_DT, GRID_STEPS};
use super::{BODIES, DT, SEED, adaptive, agreed, common, ramp, scene, smooth_torques, smooth_torques_alone, steps};

fn adaptive_attempts_agree(engine: &Engine) {
    for torques in [Vec::new(), smooth_torques(), smooth_torques_alone(), vec![ramp()]] {
        for (precision, tolerance) in [(Precision::F64, 1e-10), (Precision::F64, 1e-6), (Precision::F32, 1e-4)] {
            let what = format!("{} torques, {precision}, {tolerance:e}", torques.len());
            let report = agreed(engine, &adaptive(&torques, tolerance, precision), &steps(40), &what);
            let undecided: u64 =
                report.groups.iter().flat_map(|group| &group.comparisons).map(|one| one.undecided).sum();
            println!("{what}: {undecided} undecided");
            let fields: Vec<Field> =
                report.groups[0].comparisons[0].largest.iter().map(|largest| largest.field).collect();
            assert!(fields.contains(&Field::Decision) && fields.contains(&Field::NextStep), "{fields:?}");
        }
    }
}

#[test]
fn adaptive_steps_agree_attempt_by_attempt_in_lanes() {
    adaptive_attempts_agree(&Engine::cpu());
    let steps_by_series = AdaptiveSteps { tolerance: 1e-12, least_step: None };
    for torques in [Vec::new(), smooth_torques(), smooth_torques_alone(), vec![ramp()]] {
        let torques: Vec<_> = torques.into_iter().filter(|torque| torque.name() != "log-spring").collect();
        agreed(&Engine::cpu(), &scene(&torques).taylor(steps_by_series), &steps(20), "taylor");
    }
}

#[test]
fn adaptive_steps_agree_attempt_by_attempt_on_a_gpu() {
    adaptive_attempts_agree(&common::gpu());
}

#[test]
fn projected_steps_closed_forms_and_flights_agree() {
    let masses = vec![2.0; BODIES];
    let velocity: Vec<DVec3> = (0..BODIES).map(|body| DVec3::new(1.0, 0.1 * body as f64, -3.0)).collect();
    let flying = |ensemble: polhode::Ensemble| {
        let position = vec![DVec3::ZERO; BODIES];
        let translation = Translation { mass: masses.clone(), position, velocity: velocity.clone() };
        ensemble.with_translation(translation).expect("valid")
    };
    let ensemble = || common::asymmetric_ensemble(BODIES, SEED);
    for engine in [Engine::cpu(), common::gpu()] {
        let free = || Scene::new(ensemble()).until(1.0).outputs(Outputs::Every(0.1));
        for method in [Method::Rk4, Method::Rk8, Method::Cf4, Method::Splitting4] {
            agreed(&engine, &free().projected(method, DT), &steps(20), &format!("projected {method}"));
        }
        for precision in Precision::ALL {
            agreed(&engine, &free().precision(Some(precision)), &steps(10), "closed form");
            let thrust = Scene::new(flying(ensemble()))
                .until(1.0)
                .force(Force::thrust(DVec3::new(0.3, 0.2, -0.1)))
                .force(Force::quadratic_drag(0.2))
                .force(Force::gravity(DVec3::new(0.0, 0.0, -9.8)))
                .torque(Torque::linear_drag(0.01))
                .pinned(Method::Rk4, DT, Some(precision));
            let report = agreed(&engine, &thrust, &steps(20), "thrust");
            let carries = polhode::engine::Backend::carries_centres(&engine);
            let compared = report.groups[0].comparisons.iter().flat_map(|one| &one.largest);
            let centres =
                compared.filter(|largest| [Field::Position, Field::Velocity].contains(&largest.field)).count();
            assert_eq!(centres, if carries { 2 } else { 0 }, "{report}");
        }
    }
}

/// Centres of mass are stepped beside the rotation by any method's kernel.
#[test]
fn centres_of_mass_agree_beside_every_method_on_a_gpu() {
    let gpu = common::gpu();
    let ensemble = common::asymmetric_ensemble(BODIES, SEED);
    let velocity: Vec<DVec3> = (0..BODIES).map(|body| DVec3::new(1.0, 0.1 * body as f64, -3.0)).collect();
    let translation = Translation { mass: vec![2.0; BODIES], position: vec![DVec3::ZERO; BODIES], velocity };
    let flying = ensemble.with_translation(translation).expect("valid");
    for method in Method::ALL {
        for precision in Precision::ALL {
            let scene = Scene::new(flying.clone())
                .until(1.0)
                .force(Force::thrust(DVec3::new(0.3, 0.2, -0.1)))
                .force(Force::quadratic_drag(0.2))
                .force(Force::linear_drag(0.1))
                .force(Force::gravity(DVec3::new(0.0, 0.0, -9.8)))
                .torque(Torque::linear_drag(0.01))
                .pinned(method, GRID_DT, Some(precision));
            let report = agreed(&gpu, &scene, &steps(GRID_STEPS), &format!("{method} in {precision}, flying"));
            let compared = report.groups[0].comparisons.iter().flat_map(|one| &one.largest);
            let centres = compared.filter(|one| [Field::Position, Field::Velocity].contains(&one.field)).count();
            assert_eq!(centres, 2, "{report}");
        }
    }
}

#[test]
fn an_accuracy_that_is_asked_for_is_compared_as_it_is_planned() {
    let torques = [Torque::linear_drag(0.05), Torque::heavy_top(0.1, DVec3::new(0.0, 0.0, 0.1), -9.8 * DVec3::Z)];
    for engine in [Engine::cpu(), common::gpu()] {
        for accuracy in [1e-3, 1e-9] {
            let scene = scene(&torques).accuracy(polhode::Accuracy::attitude(accuracy));
            agreed(&engine, &scene, &steps(8), &format!("{accuracy:e}"));
        }
    }
}
