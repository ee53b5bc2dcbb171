//! Adaptive steps, projected ones, closed forms, centres of mass, and accuracies that are asked for.

use glam::{DQuat, DVec3};
use polhode::bodies::ensemble::Translation;
use polhode::engine::Engine;
use polhode::math::Precision;
use polhode::plan::Treatment;
use polhode::scene::AdaptiveSteps;
use polhode::torque::flat_plates::{Facet, Surface};
use polhode::verify::{Field, Report, verify};
use polhode::{Force, Method, Outputs, Scene, Torque};

use super::common::measured::{SEEDS, stays_within_measured};
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

/// A scene of so many bodies, what is measured of it, and steps that are compared.
struct Case {
    name: String,
    precision: Precision,
    scene: Scene,
    steps: u64,
}

fn case(name: impl Into<String>, precision: Precision, scene: Scene, steps: u64) -> Case {
    Case { name: name.into(), precision, scene, steps }
}

/// Whether a method's steps can be projected.
fn is_projectable(method: Method) -> bool {
    polhode::engine::projected::check(Precision::F64, true, method).is_ok()
}

fn free(bodies: usize) -> Scene {
    Scene::new(common::asymmetric_ensemble(bodies, SEED)).until(1.0).outputs(Outputs::Every(0.1))
}

/// Steps of every method that can be projected.
fn projected(bodies: usize) -> Vec<Case> {
    let methods = Method::ALL.into_iter().filter(|&method| is_projectable(method));
    let of = |method| case(format!("projected {method}"), Precision::F64, free(bodies).projected(method, DT), 20);
    methods.map(of).collect()
}

/// The closed form by elliptic functions, and the two rotations of axisymmetric bodies.
fn closed_forms(bodies: usize) -> Vec<Case> {
    let symmetric = polhode::Ensemble::from_fn(bodies, |body| {
        let x = (body as f64 + 0.5) / bodies as f64;
        let moments =
            if body % 2 == 0 { DVec3::new(1.0, 1.0, 0.2 + 1.6 * x) } else { DVec3::new(0.1 + 1.8 * x, 1.0, 1.0) };
        (moments, DQuat::from_xyzw(x, -0.5, 0.3, 0.8).normalize(), DVec3::new(1.0 - x, 0.3 + x, -2.0 * x))
    });
    let symmetric = Scene::new(symmetric.expect("valid bodies")).until(1.0).outputs(Outputs::Every(0.1));
    let of = |precision| {
        [
            case("closed form", precision, free(bodies).precision(Some(precision)), 10),
            case("precession", precision, symmetric.clone().precision(Some(precision)), 10),
        ]
    };
    Precision::ALL.into_iter().flat_map(of).collect()
}

/// Steps in which `rk4` truncates |q| by far more than roundings.
pub const LONG_STEP: f64 = 0.1;

/// Bodies under every force that an engine takes along, and a torque.
pub fn flying(bodies: usize, method: Method, dt: f64, precision: Precision) -> Scene {
    let velocity: Vec<DVec3> = (0..bodies).map(|body| DVec3::new(1.0, 0.1 * body as f64, -3.0)).collect();
    let translation = Translation { mass: vec![2.0; bodies], position: vec![DVec3::ZERO; bodies], velocity };
    let ensemble = common::asymmetric_ensemble(bodies, SEED).with_translation(translation).expect("valid");
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
fn flights(bodies: usize) -> Vec<Case> {
    let steps_of = Method::ALL.map(|method| (method, GRID_DT)).into_iter().chain([(Method::Rk4, LONG_STEP)]);
    let of = |(method, dt)| {
        let name = if dt == GRID_DT { format!("flying {method}") } else { format!("flying {method}, long steps") };
        Precision::ALL.map(|precision| case(name.clone(), precision, flying(bodies, method, dt, precision), GRID_STEPS))
    };
    steps_of.flat_map(of).collect()
}

/// Bodies without extent across an axis, which is none of their own: no torque turns them about it.
fn rotors(bodies: usize) -> Vec<Case> {
    let of_body = |body: usize| {
        let angle = 0.3 * body as f64;
        let axis = DVec3::new(angle.sin(), 0.4, angle.cos()).normalize();
        let spin = DVec3::new(0.5, -0.3 + 0.02 * body as f64, 0.8);
        let ends = [(1.5, DVec3::ZERO), (0.5, 2.0 * axis)];
        let inertia = polhode::bodies::inertia::point_masses(&ends).expect("a rotor").inertia;
        (inertia, DQuat::from_xyzw(0.1, -0.5, 0.3, 0.8).normalize(), spin - axis * axis.dot(spin))
    };
    let ensemble = polhode::Ensemble::from_fn(bodies, of_body).expect("valid bodies");
    let torques = [
        Torque::linear_drag(0.05),
        Torque::heavy_top(0.3, DVec3::new(0.1, 0.2, 0.3), -9.8 * DVec3::Z),
        Torque::gravity_gradient(polhode::torque::Orbit::circular(1.0, 1.3)),
    ];
    let scene = |torques: &[Torque]| {
        let scene = Scene::new(ensemble.clone()).until(1.0).outputs(Outputs::Every(0.25));
        torques.iter().fold(scene, |scene, torque| scene.torque(torque.clone()))
    };
    let methods = [Method::Rk4, Method::Rk8, Method::Cf4, Method::Splitting4, Method::ImplicitMidpoint, Method::Dlm];
    let mut cases = Vec::new();
    for precision in Precision::ALL {
        for method in methods {
            for (what, torques) in [("free", &[][..]), ("driven", &torques[..])] {
                let scene = scene(torques).pinned(method, DT, Some(precision)).skipping(false);
                cases.push(case(format!("{what} rotors, {method}"), precision, scene, 20));
            }
        }
        let tolerance = if precision == Precision::F32 { 1e-4 } else { 1e-10 };
        let adaptive = AdaptiveSteps { tolerance, least_step: None };
        let scene = scene(&torques).adaptive(adaptive, Some(precision)).skipping(false);
        cases.push(case("driven rotors, attempts", precision, scene, 20));
    }
    cases
}

/// Plates of every surface, whose torque has a kink where light leaves one.
fn plates(bodies: usize) -> Vec<Case> {
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
    let of = |method| {
        let scene = free(bodies).torque(light.clone()).skipping(false);
        Precision::ALL.map(|precision| {
            case(format!("plates, {method}"), precision, scene.clone().pinned(method, DT, Some(precision)), 20)
        })
    };
    [Method::Rk4, Method::Rk8, Method::Splitting4].into_iter().flat_map(of).collect()
}

/// The largest part of its bound that a difference came to in each case, over 100 draws of a body, in lanes and on lavapipe, in `f32` and in `f64`
/// (the command of [`largest_parts_of_scenes`]); 0 where it is not compared.
const MEASURED: [(&str, [f64; 2]); 37] = [
    ("projected rk4", [0.0, 2.88e-1]),
    ("projected rk8", [0.0, 1.17e-1]),
    ("projected cf4", [0.0, 8.19e-2]),
    ("projected splitting2", [0.0, 7.92e-2]),
    ("projected splitting4", [0.0, 7.92e-2]),
    ("projected splitting6", [0.0, 7.92e-2]),
    ("closed form", [2.85e-1, 2.49e-1]),
    ("precession", [1.18e-1, 1.18e-1]),
    ("flying rk4", [8.98e-2, 2.70e-1]),
    ("flying rk8", [5.80e-2, 1.35e-1]),
    ("flying cf4", [6.20e-2, 7.86e-2]),
    ("flying splitting2", [8.01e-2, 5.24e-2]),
    ("flying splitting4", [7.59e-2, 7.00e-2]),
    ("flying splitting6", [7.61e-2, 6.32e-2]),
    ("flying implicit_midpoint", [8.15e-2, 6.56e-2]),
    ("flying dlm", [8.51e-2, 1.86e-1]),
    ("flying explicit_euler", [1.07e-1, 5.97e-2]),
    ("flying gyro_newton", [6.49e-2, 7.26e-2]),
    ("flying clamped_euler", [1.47e-1, 1.78e-1]),
    ("flying spiral", [5.64e-2, 6.95e-2]),
    ("flying rk4, long steps", [6.56e-2, 1.77e-1]),
    ("free rotors, rk4", [7.35e-2, 2.68e-1]),
    ("driven rotors, rk4", [6.08e-2, 2.84e-1]),
    ("free rotors, rk8", [6.02e-2, 1.45e-1]),
    ("driven rotors, rk8", [3.34e-2, 4.29e-2]),
    ("free rotors, cf4", [6.14e-2, 8.92e-2]),
    ("driven rotors, cf4", [5.65e-2, 7.33e-2]),
    ("free rotors, splitting4", [6.16e-2, 8.94e-2]),
    ("driven rotors, splitting4", [4.65e-2, 2.70e-2]),
    ("free rotors, implicit_midpoint", [8.55e-2, 5.20e-2]),
    ("driven rotors, implicit_midpoint", [5.72e-2, 5.00e-2]),
    ("free rotors, dlm", [6.14e-2, 1.97e-1]),
    ("driven rotors, dlm", [5.67e-2, 1.49e-1]),
    ("driven rotors, attempts", [1.0, 3.04e-1]),
    ("plates, rk4", [8.20e-2, 2.61e-1]),
    ("plates, rk8", [5.85e-2, 1.03e-1]),
    ("plates, splitting4", [7.82e-2, 3.20e-2]),
];

/// What was measured of a case.
fn measured(case: &Case) -> f64 {
    let found = MEASURED.iter().find(|(name, _)| *name == case.name);
    found.unwrap_or_else(|| panic!("{}: not in MEASURED, whose numbers `largest_parts_of_scenes` prints", case.name)).1
        [usize::from(case.precision == Precision::F64)]
}

fn agree(engine: &Engine, case: &Case) -> Report {
    let report = agreed(engine, &case.scene, &steps(case.steps), &format!("{} in {}", case.name, case.precision));
    stays_within_measured(engine, case.precision, &case.name, report.largest_part(), measured(case));
    report
}

fn agree_on_both(cases: &[Case]) {
    for engine in [Engine::cpu(), common::gpu()] {
        cases.iter().for_each(|case| drop(agree(&engine, case)));
    }
}

#[test]
fn projected_steps_agree_under_every_method_that_has_them() {
    let cases = projected(BODIES);
    assert_eq!(cases.len(), 6, "projected methods");
    agree_on_both(&cases);
}

#[test]
fn closed_forms_agree() {
    for engine in [Engine::cpu(), common::gpu()] {
        for case in closed_forms(BODIES) {
            let report = agree(&engine, &case);
            let is_precession = matches!(report.groups[0].treatment, Treatment::RegularPrecession);
            assert_eq!(is_precession, case.name == "precession", "{report}");
        }
    }
}

#[test]
fn centres_of_mass_agree_beside_every_method_on_a_gpu() {
    let gpu = common::gpu();
    for case in flights(BODIES) {
        let report = agree(&gpu, &case);
        let compared = report.groups[0].comparisons.iter().flat_map(|one| &one.largest);
        let centres = compared.filter(|one| [Field::Position, Field::Velocity].contains(&one.field)).count();
        assert_eq!(centres, 2, "{report}");
    }
}

#[test]
fn the_cpu_engine_moves_no_centres_of_mass_and_says_so() {
    let report = agreed(&Engine::cpu(), &flying(BODIES, Method::Rk4, GRID_DT, Precision::F64), &steps(2), "flying");
    let compared = report.groups[0].comparisons.iter().flat_map(|one| &one.largest);
    assert!(!compared.map(|one| one.field).any(|field| [Field::Position, Field::Velocity].contains(&field)));
    assert!(report.to_string().contains("centres of mass: not compared"), "{report}");
}

#[test]
fn linear_rotors_agree() {
    agree_on_both(&rotors(BODIES));
}

#[test]
fn plates_that_turn_into_the_light_agree() {
    agree_on_both(&plates(BODIES));
}

#[test]
#[ignore = "prints what `MEASURED` holds: cargo test --test mirror verify::scenes::largest -- --ignored --nocapture"]
fn largest_parts_of_scenes() {
    let engines = [Engine::cpu(), common::gpu()];
    let draws = SEEDS as usize;
    let cases = [projected(draws), closed_forms(draws), flights(draws), rotors(draws), plates(draws)];
    let mut found: Vec<(String, [f64; 2])> = Vec::new();
    for Case { name, precision, scene, steps: count } in cases.into_iter().flatten() {
        let of = |engine: &Engine| {
            let report = verify(engine, &scene, &steps(count)).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert!(report.agrees(), "{name} in {precision}: {report}");
            report.largest_part()
        };
        let largest = engines.iter().map(of).fold(0.0, f64::max);
        let place = found.iter().position(|(other, _)| *other == name).unwrap_or_else(|| {
            found.push((name.clone(), [0.0; 2]));
            found.len() - 1
        });
        found[place].1[usize::from(precision == Precision::F64)] = largest;
    }
    found.iter().for_each(|(name, [narrow, wide])| println!("(\"{name}\", [{narrow:.2e}, {wide:.2e}]),"));
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
