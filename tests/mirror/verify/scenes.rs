//! Adaptive steps, projected ones, closed forms, centres of mass, and accuracies that are asked for.

use glam::{DQuat, DVec3};
use polhode::bodies::ensemble::Translation;
use polhode::engine::Engine;
use polhode::math::Precision;
use polhode::scene::AdaptiveSteps;
use polhode::torque::flat_plates::{Facet, Surface};
use polhode::verify::Field;
use polhode::{Force, Method, Outputs, Scene, Torque};

use super::grid::{GRID_DT, GRID_STEPS};
use super::{BODIES, DT, SEED, adaptive, agreed, common, ramp, scene, smooth_torques, smooth_torques_alone, steps};

fn adaptive_attempts_agree(engine: &Engine) {
    for torques in [Vec::new(), smooth_torques(), smooth_torques_alone(), vec![ramp()]] {
        for (precision, tolerance) in [(Precision::F64, 1e-10), (Precision::F64, 1e-6), (Precision::F32, 1e-4)] {
            let what = format!("{} torques, {precision}, {tolerance:e}", torques.len());
            let report = agreed(engine, &adaptive(&torques, tolerance, precision), &steps(40), &what);
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

/// Steps in which `rk4` truncates |q| by far more than roundings.
pub const LONG_STEP: f64 = 0.1;

/// Bodies under every force that an engine takes along, and a torque.
pub fn flying(method: Method, dt: f64, precision: Precision) -> Scene {
    let velocity: Vec<DVec3> = (0..BODIES).map(|body| DVec3::new(1.0, 0.1 * body as f64, -3.0)).collect();
    let translation = Translation { mass: vec![2.0; BODIES], position: vec![DVec3::ZERO; BODIES], velocity };
    let ensemble = common::asymmetric_ensemble(BODIES, SEED).with_translation(translation).expect("valid");
    Scene::new(ensemble)
        .until(1.0)
        .force(Force::thrust(DVec3::new(0.3, 0.2, -0.1)))
        .force(Force::quadratic_drag(0.2))
        .force(Force::linear_drag(0.1))
        .force(Force::gravity(DVec3::new(0.0, 0.0, -9.8)))
        .torque(Torque::linear_drag(0.01))
        .pinned(method, dt, Some(precision))
}

/// Centres of mass are stepped beside the rotation by any method's kernel, and in steps that leave a quaternion off the unit sphere.
#[test]
fn centres_of_mass_agree_beside_every_method_on_a_gpu() {
    let gpu = common::gpu();
    let steps_of = Method::ALL.map(|method| (method, GRID_DT)).into_iter().chain([(Method::Rk4, LONG_STEP)]);
    for (method, dt) in steps_of {
        for precision in Precision::ALL {
            let what = format!("{method} in {precision}, flying in steps of {dt} s");
            let report = agreed(&gpu, &flying(method, dt, precision), &steps(GRID_STEPS), &what);
            let compared = report.groups[0].comparisons.iter().flat_map(|one| &one.largest);
            let centres = compared.filter(|one| [Field::Position, Field::Velocity].contains(&one.field)).count();
            assert_eq!(centres, 2, "{report}");
        }
    }
}

/// Bodies without extent across an axis, which is none of their own: no torque turns them about it.
#[test]
fn linear_rotors_agree() {
    let of_body = |body: usize| {
        let angle = 0.3 * body as f64;
        let axis = DVec3::new(angle.sin(), 0.4, angle.cos()).normalize();
        let spin = DVec3::new(0.5, -0.3 + 0.02 * body as f64, 0.8);
        let ends = [(1.5, DVec3::ZERO), (0.5, 2.0 * axis)];
        let inertia = polhode::bodies::inertia::point_masses(&ends).expect("a rotor").inertia;
        (inertia, DQuat::from_xyzw(0.1, -0.5, 0.3, 0.8).normalize(), spin - axis * axis.dot(spin))
    };
    let ensemble = polhode::Ensemble::from_fn(BODIES, of_body).expect("valid bodies");
    let torques = [
        Torque::linear_drag(0.05),
        Torque::heavy_top(0.3, DVec3::new(0.1, 0.2, 0.3), -9.8 * DVec3::Z),
        Torque::gravity_gradient(polhode::torque::Orbit::circular(1.0, 1.3)),
    ];
    let rotors = |torques: &[Torque]| {
        let scene = Scene::new(ensemble.clone()).until(1.0).outputs(Outputs::Every(0.25));
        torques.iter().fold(scene, |scene, torque| scene.torque(torque.clone()))
    };
    for engine in [Engine::cpu(), common::gpu()] {
        for precision in Precision::ALL {
            for method in
                [Method::Rk4, Method::Rk8, Method::Cf4, Method::Splitting4, Method::ImplicitMidpoint, Method::Dlm]
            {
                for torques in [&[], &torques[..]] {
                    let scene = rotors(torques).pinned(method, DT, Some(precision)).skipping(false);
                    let what = format!("{} torques on rotors, {method} in {precision}", torques.len());
                    agreed(&engine, &scene, &steps(20), &what);
                }
            }
            let tolerance = if precision == Precision::F32 { 1e-4 } else { 1e-10 };
            let adaptive = AdaptiveSteps { tolerance, least_step: None };
            let scene = rotors(&torques).adaptive(adaptive, Some(precision)).skipping(false);
            agreed(&engine, &scene, &steps(20), &format!("attempts of rotors in {precision}"));
        }
    }
}

/// Plates of every surface, whose torque has a kink where light leaves one.
#[test]
fn plates_that_turn_into_the_light_agree() {
    let surfaces = [
        Surface::Coefficients { along: 0.7, constant: -0.2, across: 0.9 },
        Surface::Solar { specular: 0.3, diffuse: 0.4 },
        Surface::Drag { normal_accommodation: 0.9, tangential_accommodation: 0.8, wall_speed_ratio: 0.1 },
    ];
    let plates = [0, 1, 2].map(|axis| Facet {
        area: 1.0 + axis as f64,
        normal_body: DVec3::AXES[axis] + 0.2 * DVec3::ONE,
        centre_body: DVec3::AXES[(axis + 1) % 3] - 0.1 * DVec3::AXES[axis],
        surface: surfaces[axis],
    });
    let light = Torque::flat_plates(0.01, DVec3::new(0.3, -0.4, 0.2), &plates).expect("valid plates");
    for engine in [Engine::cpu(), common::gpu()] {
        for precision in Precision::ALL {
            for method in [Method::Rk4, Method::Rk8, Method::Splitting4] {
                let scene = scene(std::slice::from_ref(&light)).pinned(method, DT, Some(precision)).skipping(false);
                agreed(&engine, &scene, &steps(20), &format!("plates, {method} in {precision}"));
            }
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
