//! `verify` agrees over whole scenes where the kernels agree, and finds and names faults that are planted on one side.

mod common;
#[path = "support/desk.rs"]
mod desk;

use std::path::Path;
use std::process::Command;

use common::torques::{each_torque_alone, every_torque, every_torque_where, middle_moments};
use glam::DVec3;
use polhode::batch::Precision;
use polhode::engine::Engine;
use polhode::engine::adaptive::AdaptiveSteps;
use polhode::engine::gpu::{GpuOptions, Patch};
use polhode::ensemble::Translation;
use polhode::study::{Study, problem};
use polhode::torque::variable_inertia::{InertiaChange, Law};
use polhode::verify::{Culprit, Field, Onset, Options, Report, verify};
use polhode::{Error, Force, Method, Outputs, Scene, Torque};

/// Fills no lane group of any width.
const BODIES: usize = 19;
const SEED: u64 = 7;
const DT: f64 = 1.0 / 64.0;

const EXAMPLES: [&str; 11] = [
    "aero_table",
    "bdot",
    "booms",
    "debris",
    "intermediate_axis",
    "pointing",
    "relaxing",
    "spacecraft",
    "thruster",
    "tumbling",
    "wobbling_disc",
];

fn steps(steps: u64) -> Options {
    Options { steps, ..Options::default() }
}

/// Free bodies for a time, outputs at two times.
fn scene(torques: &[Torque]) -> Scene {
    let scene = Scene::new(common::asymmetric_ensemble(BODIES, SEED)).until(1.0).outputs(Outputs::Every(0.5));
    torques.iter().fold(scene, |scene, torque| scene.torque(torque.clone()))
}

fn all_torques() -> Vec<Torque> {
    every_torque(&middle_moments(BODIES, SEED))
}

fn agreed(engine: &Engine, scene: &Scene, options: &Options, what: &str) -> Report {
    let report = verify(engine, scene, options).unwrap_or_else(|error| panic!("{what}: {error}"));
    assert!(report.agrees() && report.compared() > 0, "{what}: {report}");
    println!("{what}: at most {:.3} of the bound, {} numbers", report.largest_part(), report.compared());
    report
}

fn example(name: &str, bodies: usize) -> Scene {
    let file = desk::example(name);
    Study::read(Path::new(&file)).expect("a study").truncated(bodies).scene().expect("a scene")
}

#[test]
fn every_example_study_agrees_on_the_cpu() {
    for name in EXAMPLES {
        agreed(&Engine::cpu(), &example(name, 8), &steps(6), name);
    }
}

#[test]
fn every_example_study_agrees_on_a_gpu() {
    let gpu = common::gpu();
    for name in EXAMPLES {
        agreed(&gpu, &example(name, 4), &steps(4), name);
    }
}

#[test]
fn what_is_not_compared_is_listed() {
    let text = agreed(&Engine::cpu(), &example("thruster", 3), &steps(2), "thruster").to_string();
    assert!(text.contains("centres of mass: not compared"), "{text}");
    let text = agreed(&Engine::cpu(), &example("relaxing", 3), &steps(2), "relaxing").to_string();
    assert!(text.contains("not compared: statistics"), "{text}");
}

#[test]
fn the_examples_are_all_there() {
    let folder = format!("{}/examples/studies", env!("CARGO_MANIFEST_DIR"));
    let names = std::fs::read_dir(folder).expect("the examples").map(|entry| entry.expect("an entry").file_name());
    let studies = names.filter(|name| name.to_string_lossy().ends_with(".toml")).count();
    assert_eq!(studies, EXAMPLES.len());
}

/// Moments that change while the steps are compared.
fn ramp() -> Torque {
    Torque::variable_inertia(InertiaChange::factor(0.6), Law::ramp(0.05, 0.3))
}

fn follows_slip(method: Method) -> bool {
    matches!(method, Method::Rk4 | Method::Rk8 | Method::Cf4)
}

/// Whether a method lets torques act at frozen attitudes, by what their sum depends on.
fn kicks(method: Method) -> bool {
    matches!(method, Method::Dlm | Method::Splitting2 | Method::Splitting4 | Method::Splitting6)
}

// --- the grid: methods, torques, precisions, engines ---

/// A step of the grid, s: its second word in `f32` is not zero.
const GRID_DT: f64 = 1.0 / 60.0;
const GRID_STEPS: u64 = 20;
/// Torques of [`every_torque`], and moments that change.
const KINDS: usize = 20;
/// The gravity gradients among them.
const GRADIENTS: [usize; 2] = [8, 9];
/// A body for each torque that acts alone, and one that feels the first as well: they fill no lane group of any width.
const GRID_BODIES: usize = KINDS + 1;

/// Moments that change, of the bodies where `acts` says so.
fn ramp_where(bodies: usize, acts: impl Fn(usize) -> bool) -> Torque {
    let factor: Vec<f64> = (0..bodies).map(|body| if acts(body) { 0.6 } else { 1.0 }).collect();
    Torque::variable_inertia(InertiaChange::factor(factor), Law::ramp(0.05, 0.3))
}

/// What a method can follow of every torque and of moments that change, where `acts` says so of the number of a torque and of a body.
fn torques_of(method: Method, bodies: usize, acts: impl Fn(usize, usize) -> bool) -> Vec<Torque> {
    let all = every_torque_where(&middle_moments(bodies, SEED), &acts);
    if follows_slip(method) {
        return [all, vec![ramp_where(bodies, |body| acts(KINDS - 1, body))]].concat();
    }
    all.into_iter().filter(|torque| torque.leaves_rigid()).collect()
}

/// A constant torque in body axes and drag: they have a kernel of their own, and drag is the only one that reads the velocity.
fn drag_alone(bodies: usize) -> Vec<Torque> {
    let all = every_torque(&middle_moments(bodies, SEED));
    vec![all[0].clone(), all[3].clone()]
}

/// Torques of which one depends on the attitude and one on the time, and none on the velocity.
fn no_velocity(bodies: usize) -> Vec<Torque> {
    let all = every_torque(&middle_moments(bodies, SEED));
    vec![all[2].clone(), all[6].clone()]
}

/// What every equal-step method is compared under.
fn sets(method: Method) -> Vec<(&'static str, Vec<Torque>)> {
    // The last body feels no gravity gradient: rates of orbits are then each body's own, as where each torque acts alone, and both
    // sets have one kernel.
    let all = |torque: usize, body: usize| !(GRADIENTS.contains(&torque) && body == GRID_BODIES - 1);
    let mut sets = vec![
        ("free", Vec::new()),
        ("all torques", torques_of(method, GRID_BODIES, all)),
        ("each torque alone", torques_of(method, GRID_BODIES, |torque, body| body % KINDS == torque)),
    ];
    // Their kernel's torque is the same function under every method; only kicks ask what it depends on.
    if kicks(method) || method == Method::Rk4 {
        sets.push(("drag alone", drag_alone(GRID_BODIES)));
    }
    if kicks(method) {
        sets.push(("no velocity", no_velocity(GRID_BODIES)));
    }
    sets
}

fn grid_scene(torques: &[Torque], bodies: usize, method: Method, precision: Precision) -> Scene {
    let scene = Scene::new(common::asymmetric_ensemble(bodies, SEED)).until(1.0).skipping(false);
    let scene = torques.iter().fold(scene, |scene, torque| scene.torque(torque.clone()));
    scene.pinned(method, GRID_DT, Some(precision))
}

/// The largest part of its derived bound that a difference came to in f32 and in f64, over 100 draws of a body under each set of torques, on
/// lanes and on lavapipe (docs/grid.md, whose command writes the table anew).
fn measured(method: Method, precision: Precision) -> f64 {
    let [narrow, wide] = match method {
        Method::Rk4 => [0.123, 0.341],
        Method::Rk8 => [0.100, 0.174],
        Method::Cf4 => [0.086, 0.142],
        Method::Splitting2 => [0.087, 0.096],
        Method::Splitting4 => [0.092, 0.081],
        Method::Splitting6 => [0.092, 0.081],
        Method::ImplicitMidpoint => [0.088, 0.079],
        Method::Dlm => [0.115, 0.218],
        Method::ExplicitEuler => [0.083, 0.096],
        Method::GyroNewton => [0.088, 0.072],
        Method::ClampedEuler => [0.200, 0.190],
        Method::Spiral => [0.073, 0.071],
        _ => panic!("{method} takes no equal steps"),
    };
    if precision == Precision::F32 { narrow } else { wide }
}

/// What a difference may come to: bounds are derived, and beyond four times what was measured something has changed.
const MEASURED_TIMES: f64 = 4.0;

fn agrees_under_every_torque(engine: &Engine, method: Method) {
    for (name, torques) in sets(method) {
        for precision in Precision::ALL {
            let what = format!("{method} in {precision}, {name}");
            let scene = grid_scene(&torques, GRID_BODIES, method, precision);
            let report = agreed(engine, &scene, &steps(GRID_STEPS), &what);
            let allowed = MEASURED_TIMES * measured(method, precision);
            assert!(report.largest_part() <= allowed, "{what}: more than {allowed} of the bound: {report}");
        }
    }
}

/// A test of each method, so that they run side by side.
macro_rules! grid {
    ($($name:ident: $method:ident,)*) => {
        mod in_lanes_under_every_torque {
            use super::*;
            $(#[test]
            fn $name() {
                agrees_under_every_torque(&Engine::cpu(), Method::$method);
            })*
        }

        mod on_a_gpu_under_every_torque {
            use super::*;
            $(#[test]
            fn $name() {
                agrees_under_every_torque(&common::gpu(), Method::$method);
            })*
        }

        #[test]
        fn every_method_has_its_place_in_the_grid() {
            assert_eq!([$(Method::$method),*], Method::ALL);
        }
    };
}

grid! {
    rk4: Rk4,
    rk8: Rk8,
    cf4: Cf4,
    splitting2: Splitting2,
    splitting4: Splitting4,
    splitting6: Splitting6,
    implicit_midpoint: ImplicitMidpoint,
    dlm: Dlm,
    explicit_euler: ExplicitEuler,
    gyro_newton: GyroNewton,
    clamped_euler: ClampedEuler,
    spiral: Spiral,
}

/// Draws of a body for each cell of the table.
const DRAWS: usize = 100;

/// A cell: the largest difference in ulps of the largest component, and the largest part of its bound.
fn cell(engine: &Engine, torques: &[Torque], method: Method, precision: Precision) -> (f64, f64) {
    let scene = grid_scene(torques, DRAWS, method, precision);
    let report = agreed(engine, &scene, &steps(GRID_STEPS), &format!("{method} in {precision}"));
    let judged = report.groups.iter().flat_map(|group| &group.comparisons).filter(|comparison| comparison.judged);
    let ulps = judged.flat_map(|comparison| &comparison.largest).map(|largest| largest.ulps).fold(0.0, f64::max);
    (ulps, report.largest_part())
}

#[test]
#[ignore = "writes the table of docs/grid.md: bash tests/grid.sh"]
fn the_grid() {
    let names = every_torque(&[1.0]).iter().map(|torque| torque.name().to_owned()).collect::<Vec<_>>();
    for (name, engine) in [("CPU lanes", Engine::cpu()), ("GPU", common::gpu())] {
        for precision in Precision::ALL {
            println!("## {name}, {} ({precision})", engine.description().name);
            let methods: Vec<String> = Method::ALL.iter().map(|method| format!("`{method}`")).collect();
            println!("| torque | {} |", methods.join(" | "));
            println!("| --- |{}", " --- |".repeat(methods.len()));
            let mut worst = vec![0.0_f64; Method::ALL.len()];
            let mut row = |name: &str, torques: &dyn Fn(Method) -> Option<Vec<Torque>>| {
                let cells = Method::ALL.iter().zip(&mut worst).map(|(&method, worst)| match torques(method) {
                    Some(torques) => {
                        let (ulps, part) = cell(&engine, &torques, method, precision);
                        *worst = worst.max(part);
                        format!("{ulps:.2} ({part:.3})")
                    }
                    None => "–".to_owned(),
                });
                println!("| {name} | {} |", cells.collect::<Vec<_>>().join(" | "));
            };
            row("none", &|_| Some(Vec::new()));
            // One kernel for all of them; one without strength stands for none.
            for (number, name) in names.iter().enumerate() {
                row(name, &|method| {
                    let is_followed = follows_slip(method) || every_torque(&[1.0])[number].leaves_rigid();
                    is_followed.then(|| torques_of(method, DRAWS, |torque, _| torque == number))
                });
            }
            row("variable-inertia", &|method| {
                follows_slip(method).then(|| torques_of(method, DRAWS, |torque, _| torque == KINDS - 1))
            });
            row("all at once", &|method| Some(torques_of(method, DRAWS, |_, _| true)));
            row("constant-body and linear-drag", &|_| Some(drag_alone(DRAWS)));
            row("constant-world and sinusoidal", &|_| Some(no_velocity(DRAWS)));
            let worst: Vec<String> = worst.iter().map(|part| format!("({part:.3})")).collect();
            println!("| largest part | {} |", worst.join(" | "));
        }
    }
}

fn adaptive(torques: &[Torque], tolerance: f64, precision: Precision) -> Scene {
    scene(torques).adaptive(AdaptiveSteps { tolerance, least_step: None }, Some(precision)).skipping(false)
}

/// Every torque that has a meaning between equal steps.
fn smooth(torques: Vec<Torque>) -> Vec<Torque> {
    torques.into_iter().filter(|torque| !torque.is_random()).collect()
}

fn smooth_torques() -> Vec<Torque> {
    smooth(all_torques())
}

/// Each of them on a body of its own.
fn smooth_torques_alone() -> Vec<Torque> {
    smooth(each_torque_alone(&middle_moments(BODIES, SEED), BODIES))
}

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

// --- planted faults ---

/// A torque that is a part in a thousand stronger for the twin.
fn stronger(torque: &Torque, scale: &[f64]) -> Option<Torque> {
    let others = every_torque(&scale.iter().map(|moment| 1.001 * moment).collect::<Vec<_>>());
    let own = every_torque(scale);
    let place = own.iter().position(|other| other == torque)?;
    Some(others[place].clone()).filter(|other| other != torque)
}

/// Plants a thousandth in a torque of the twin's among others; it must be found and named.
fn is_named(torque: &Torque, fault: &Torque, others: &[Torque], method: Method, precision: Precision) {
    let own: Vec<Torque> = std::iter::once(torque).chain(others).cloned().collect();
    let twins = std::iter::once(fault).chain(others).cloned().collect();
    let scene = scene(&own).pinned(method, DT, Some(precision)).skipping(false);
    let options = Options { twin_torques: Some(twins), ..steps(5) };
    let report = verify(&Engine::cpu(), &scene, &options).expect("both sides run");
    let parting = report.parting().unwrap_or_else(|| panic!("{} in {precision} went unnoticed", torque.name()));
    assert_eq!(parting.culprit, Culprit::Torques(vec![0]), "{} in {precision}: {report}", torque.name());
}

#[test]
fn a_thousandth_of_one_torque_is_found_and_named() {
    let scale = middle_moments(BODIES, SEED);
    let own = all_torques();
    let mut tried = 0;
    for (place, torque) in own.iter().enumerate() {
        let Some(fault) = stronger(torque, &scale) else { continue };
        let others = [&own[..place], &own[place + 1..]].concat();
        is_named(torque, &fault, &others, Method::Rk8, Precision::F64);
        // Roundings of strong torques hide as much of a weak one in f32.
        let other = Torque::sinusoidal(DVec3::splat(1e-3), DVec3::ZERO, 2.0);
        is_named(torque, &fault, &[other], Method::Rk4, Precision::F32);
        tried += 1;
    }
    assert!(tried >= 12, "{tried} faults were planted");
}

#[test]
fn a_thousandth_of_one_torque_is_found_in_adaptive_steps() {
    let own = [Torque::linear_drag(0.3), Torque::heavy_top(0.4, DVec3::new(0.1, 0.0, 0.2), -9.8 * DVec3::Z)];
    let twins = vec![own[0].clone(), Torque::heavy_top(0.4004, DVec3::new(0.1, 0.0, 0.2), -9.8 * DVec3::Z)];
    for (precision, tolerance) in [(Precision::F64, 1e-10), (Precision::F32, 1e-4)] {
        let options = Options { twin_torques: Some(twins.clone()), ..steps(5) };
        let report = verify(&Engine::cpu(), &adaptive(&own, tolerance, precision), &options).expect("both sides run");
        let parting = report.parting().unwrap_or_else(|| panic!("{precision}: it went unnoticed"));
        assert_eq!(parting.culprit, Culprit::Torques(vec![1]), "{report}");
    }
}

/// A GPU with a shader text changed.
fn faulty(patches: &[(&str, &str, &str)]) -> Engine {
    let patches = patches
        .iter()
        .map(|&(file, from, to)| Patch { file: file.to_owned(), from: from.to_owned(), to: to.to_owned() })
        .collect();
    common::gpu_with(GpuOptions { patches, ..common::any_adapter() })
}

#[test]
fn a_fault_in_the_shader_of_any_torque_is_named() {
    let scale = middle_moments(BODIES, SEED);
    let own = every_torque(&scale);
    for twin in polhode::torque::twin::twins() {
        // Its first instance between two other torques.
        let Some(torque) = own.iter().find(|torque| torque.name() == named(twin.file)) else { continue };
        let torques =
            [Torque::matrix_drag(glam::DMat3::IDENTITY * 0.01), torque.clone(), Torque::constant_world(DVec3::X)];
        let torques: Vec<Torque> =
            torques.into_iter().filter(|other| other == torque || other.name() != torque.name()).collect();
        let place = torques.iter().position(|other| other == torque).expect("it is there");
        let engine = faulty(&[(twin.file, "    return ", "    return 1.001 * ")]);
        let scene = scene(&torques).pinned(Method::Rk4, DT, Some(Precision::F32)).skipping(false);
        let report = verify(&engine, &scene, &steps(2)).expect("both sides run");
        let parting = report.parting().unwrap_or_else(|| panic!("{} went unnoticed", twin.file));
        assert_eq!(parting.culprit, Culprit::Torques(vec![place]), "{}: {report}", twin.file);
    }
}

/// The model whose kernel a file holds.
fn named(file: &str) -> String {
    let stem = file.trim_start_matches("torque/").trim_end_matches(".wgsl").replace('_', "-");
    if stem == "gravity-gradient-kepler" { "none".to_owned() } else { stem }
}

/// The report must name step 1 and no torque: each of these faults shows at once.
fn is_found(patches: &[(&str, &str, &str)], method: Method, precision: Precision) {
    is_found_in(DT, patches, method, precision);
}

fn is_found_in(dt: f64, patches: &[(&str, &str, &str)], method: Method, precision: Precision) {
    let scene = scene(&[]).pinned(method, dt, Some(precision)).skipping(false);
    let report = verify(&faulty(patches), &scene, &steps(3)).expect("both sides run");
    let parting = report.parting().unwrap_or_else(|| panic!("{patches:?} went unnoticed"));
    assert_eq!((parting.step, &parting.culprit), (1, &Culprit::Method), "{patches:?}: {report}");
}

#[test]
fn faults_of_the_motion_are_found_at_the_first_step() {
    let flipped = [("rigid_body.wgsl", "a.zxy, a.yzx", "a.yzx, a.zxy")];
    is_found(&flipped, Method::Rk4, Precision::F32);
    is_found(&flipped, Method::Rk4, Precision::F64);
    let dropped = ("method/slope.wgsl", "var m_rate = motion.gyroscopic_term", "var m_rate = vector(0.0, 0.0, 0.0)");
    is_found(&[dropped], Method::Rk4, Precision::F32);
    let half_angle =
        ("rigid_body.wgsl", "product_vector(q, angular_velocity * 0.5)", "product_vector(q, angular_velocity)");
    is_found(&[half_angle], Method::Rk4, Precision::F32);
    is_found(&[("method/dlm.wgsl", "sin_cos(angle * 0.25)", "sin_cos(angle * 0.5)")], Method::Dlm, Precision::F32);
    // (v, 0) q in place of q (v, 0): the cross product changes its sign.
    let order = (
        "quaternion.wgsl",
        "mul_add(q.w, v.x, mul_add(q.y, v.z, -(q.z * v.y)))",
        "mul_add(q.w, v.x, mul_add(q.z, v.y, -(q.y * v.z)))",
    );
    is_found(&[order], Method::Rk4, Precision::F32);
}

/// Without its residue a state loses up to half an ulp, many times the roundings of the increment of a short step.
#[test]
fn compensation_left_out_is_found_at_the_first_step() {
    for (from, to) in [
        ("TwoWordsVector(value, rounded_vector(corrected - taken))", "TwoWordsVector(value, vector(0.0, 0.0, 0.0))"),
        (
            "TwoWordsQuaternion(value, rounded_quaternion(corrected - taken))",
            "TwoWordsQuaternion(value, quaternion(0.0, 0.0, 0.0, 0.0))",
        ),
    ] {
        is_found_in(DT / 256.0, &[("real_f32.wgsl", from, to)], Method::Rk4, Precision::F32);
    }
}

/// Where in a step a fault is: in the slope of a torque, in that of the orientation, in a stage behind the first, in no slope.
#[test]
fn a_fault_is_traced_to_a_slope_or_a_stage() {
    let torques = [Torque::linear_drag(0.3), Torque::sinusoidal(DVec3::X, DVec3::Y, 3.0)];
    let onset = |engine: &Engine, torques: &[Torque], options: &Options, precision: Precision| {
        let scene = scene(torques).pinned(Method::Rk4, DT, Some(precision)).skipping(false);
        let report = verify(engine, &scene, options).expect("both sides run");
        let parting = report.parting().expect("a fault is planted");
        (parting.culprit.clone(), parting.onset)
    };
    // At t = 0 the cosine is 1 and the sine, which grows with the time, 0.
    let [sine, cosine] = [[1.001, 1.0], [1.0, 1.001]].map(|[s, c]| Torque::sinusoidal(s * DVec3::X, c * DVec3::Y, 3.0));
    for (precision, twin, expected) in [
        (Precision::F32, &cosine, Onset::Slope(Field::AngularMomentum)),
        (Precision::F64, &cosine, Onset::Slope(Field::AngularMomentum)),
        // In f32 roundings hide it in the next shorter step.
        (Precision::F64, &sine, Onset::Stage(Field::AngularMomentum, 2)),
    ] {
        let options = Options { twin_torques: Some(vec![torques[0].clone(), twin.clone()]), ..steps(2) };
        let found = onset(&Engine::cpu(), &torques, &options, precision);
        assert_eq!(found, (Culprit::Torques(vec![1]), expected), "{precision}");
    }
    let planted = |patch: (&str, &str, &str), precision| onset(&faulty(&[patch]), &torques, &steps(2), precision);
    let half_angle =
        ("rigid_body.wgsl", "product_vector(q, angular_velocity * 0.5)", "product_vector(q, angular_velocity)");
    let time = ("method/rk4.wgsl", "let middle = epoch(step_index, 0.5);", "let middle = epoch(step_index, 0.25);");
    let stage = ("method/rk4.wgsl", "axpy_vector(k2.m, half, m)", "axpy_vector(k2.m, dt.value, m)");
    for precision in Precision::ALL {
        let found = planted(half_angle, precision);
        assert_eq!(found, (Culprit::Method, Onset::Slope(Field::Orientation)), "{precision}");
        let found = planted(time, precision);
        assert_eq!(found, (Culprit::Torques(vec![1]), Onset::Stage(Field::AngularMomentum, 2)), "{precision}");
        let (culprit, found) = planted(stage, precision);
        assert_eq!(culprit, Culprit::Method, "{precision}");
        assert!(matches!(found, Onset::Stage(_, 2..)), "{precision}: {found:?}");
    }
    // The second word forgotten: what is lost is a rounding of the state, however short the step.
    let compensation = (
        "real_f32.wgsl",
        "TwoWordsVector(value, rounded_vector(corrected - taken))",
        "TwoWordsVector(value, vector(0.0, 0.0, 0.0))",
    );
    assert!(matches!(planted(compensation, Precision::F32).1, Onset::State(Field::AngularMomentum) | Onset::NotFound));
}

#[test]
fn faults_of_the_controller_are_found() {
    let file = "method/rk8_adaptive.wgsl";
    for (from, to) in [
        ("1.664377182454986536961530415", "1.664377182454986536961530415 * 1.01"),
        ("let step = select(controller.step", "let step = 1.01 * select(controller.step"),
        ("min(factor, 1.0), 0.5 < controller.retried", "min(factor, 1.0), 2.5 < controller.retried"),
        ("remaining.residue + (left.residue - h.residue)", "(left.residue - h.residue)"),
        ("refused || (taken", "refused && (taken"),
    ] {
        let ensemble = problem::free(64, SEED).expect("valid");
        // The least step is within reach, so that the flag matters.
        let coarse = AdaptiveSteps { tolerance: 1e-10, least_step: Some(0.5) };
        let fine = AdaptiveSteps { tolerance: 1e-5, least_step: None };
        let found = [coarse, fine].into_iter().any(|adaptive| {
            let scene = Scene::new(ensemble.clone()).until(3.0).adaptive(adaptive, Some(Precision::F64));
            !verify(&faulty(&[(file, from, to)]), &scene, &steps(60)).expect("both sides run").agrees()
        });
        assert!(found, "{from} -> {to} went unnoticed");
    }
}

// --- what is asked for ---

#[test]
fn a_body_and_a_first_step_are_picked_out() {
    let own = [Torque::linear_drag(0.3), Torque::sinusoidal(DVec3::X, DVec3::Y, 3.0)];
    let twins = vec![own[0].clone(), Torque::sinusoidal(1.001 * DVec3::X, DVec3::Y, 3.0)];
    let scene = scene(&own).pinned(Method::Rk4, DT, Some(Precision::F64));
    let options = Options { from_step: 30, body: Some(5), twin_torques: Some(twins), ..steps(8) };
    let report = verify(&Engine::cpu(), &scene, &options).expect("both sides run");
    assert_eq!((report.bodies, report.groups.len(), report.groups[0].steps.clone()), (1, 1, 30..38));
    let parting = report.parting().expect("the torques differ");
    // From before the output at 0.5 s to behind it.
    assert_eq!((parting.body, parting.step, parting.time), (5, 31, 30.0 * DT));
    assert_eq!(parting.culprit, Culprit::Torques(vec![1]));
}

#[test]
fn what_compares_nothing_is_refused() {
    let scene = scene(&[]).pinned(Method::Rk4, DT, None);
    let refusal = |options: Options| match verify(&Engine::cpu(), &scene, &options) {
        Err(Error::Setting { field, .. }) => field,
        other => panic!("{options:?}: {other:?}"),
    };
    assert_eq!(refusal(steps(0)), "steps");
    assert_eq!(refusal(Options { body: Some(BODIES), ..steps(1) }), "body");
    assert_eq!(refusal(Options { from_step: 64, ..steps(1) }), "from_step");
}

/// A text whose numbers and lanes are those of no machine.
fn without_numbers(text: &str) -> String {
    let mut lines: Vec<String> = Vec::new();
    for line in text.lines() {
        let line = if line.contains(", as planned") {
            "N bodies on the CPU, as planned".to_owned()
        } else if let (true, Some((_, rest))) = (line.contains("lanes ("), line.split_once(" against ")) {
            format!("  CPU lanes against {rest}")
        } else if line.contains(" at most") && line.contains("(body") || line.ends_with(" equal") {
            format!("{} ...", line[..28].trim_end())
        } else if line.contains(" apart, ") {
            "      # expected: # apart, # allowed".to_owned()
        } else {
            line.to_owned()
        };
        // Lanes of every width say the same.
        if line.is_empty() || !lines.contains(&line) {
            lines.push(line);
        }
    }
    lines.join("\n")
}

#[test]
fn the_report_reads_well() {
    let own = [Torque::linear_drag(0.3), Torque::sinusoidal(DVec3::X, DVec3::Y, 3.0)];
    let twins = vec![own[0].clone(), Torque::sinusoidal(1.001 * DVec3::X, DVec3::Y, 3.0)];
    let scene = scene(&own).pinned(Method::Rk4, DT, Some(Precision::F64));
    let report = verify(&Engine::cpu(), &scene, &steps(8)).expect("both sides run");
    insta::assert_snapshot!(without_numbers(&report.to_string()), @r"
    N bodies on the CPU, as planned

    19 driven, rk4 in f64, steps of 1.562e-2 s at most; torque 1 (linear-drag), torque 2 (sinusoidal)
      steps 1 to 8 of 64
      CPU lanes against the scalar twin: 609 numbers
        orientation ...
        norm of the quaternion ...
        angular momentum ...
        status ...
        steps in one call ...

    not compared: what a run's report says of it: drift, balance, error estimate
    verdict: they agree
    ");
    let options = Options { twin_torques: Some(twins), body: Some(3), ..steps(8) };
    let report = verify(&Engine::cpu(), &scene, &options).expect("both sides run");
    insta::assert_snapshot!(without_numbers(&report.to_string()), @r"
    N bodies on the CPU, as planned

    1 driven, rk4 in f64, steps of 1.562e-2 s at most; torque 1 (linear-drag), torque 2 (sinusoidal)
      steps 1 to 8 of 64
      CPU lanes against the scalar twin: 33 numbers
        orientation ...
        norm of the quaternion ...
        angular momentum ...
        status ...
        steps in one call ...
        THEY PART at step 1 (t = 0e0 s), body 3: angular momentum z
          # expected: # apart, # allowed
          it comes from torque 2 (sinusoidal), which parts alone
          it falls as the step to the power 2: the slope of the angular momentum, right at the start, at a later stage

    not compared: what a run's report says of it: drift, balance, error estimate
    verdict: THEY DO NOT AGREE
    ");
    let json: serde_json::Value = serde_json::from_str(&report.to_json()).expect("JSON");
    assert_eq!(json["groups"][0]["comparisons"][0]["parting"]["torques"][0], 1);
}

const STUDY: &str = "
[bodies]
count = 5
inertia = [1.0, 2.0, 2.5]
angular_velocity = { distribution = 'normal', mean = [1, 0, 0], sigma = 0.3 }
[[torque]]
model = 'sinusoidal'
sine = [0.1, 0.2, 0.3]
rate = 2.0
[time]
end = 2.0
[accuracy]
method = 'rk8'
dt = 0.05
";

#[test]
fn the_command_compares_a_study() {
    let desk = desk::Desk::new(STUDY);
    for engine in ["cpu", "gpu"] {
        let text = desk.done(&["verify", "study.toml", "--engine", engine, "--steps", "5"]);
        assert!(text.contains("torque 1 (sinusoidal)") && text.contains("verdict: they agree"), "{text}");
        let text =
            desk.done(&["verify", "study.toml", "--engine", engine, "--from-step", "20", "--body", "3", "--json"]);
        let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(
            (&value["agrees"], &value["bodies"], &value["groups"][0]["first"]),
            (&true.into(), &1.into(), &21.into())
        );
    }
    let line = desk.refused(&["verify", "study.toml", "--engine", "cpu", "--steps", "0"], 2);
    assert_eq!(line, "error: steps = 0.0: one step or more is needed, as nothing would be compared\n");
    desk.refused(&["verify", "study.toml", "--engine", "cpu", "--body", "5"], 2);
    desk.refused(&["verify", "study.toml", "--engine", "cpu", "--from-step", "40"], 2);
}

#[test]
fn without_an_adapter_nothing_is_called_checked() {
    let desk = desk::Desk::new(STUDY);
    let run = |arguments: &[&str]| {
        // The loader of Vulkan finds no driver.
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("polhode"));
        command.env("VK_DRIVER_FILES", "/nonexistent").env("VK_ICD_FILENAMES", "/nonexistent");
        command.current_dir(desk.folder()).args(arguments).output().expect("the command starts")
    };
    for arguments in [&["verify", "study.toml"] as &[&str], &["verify", "study.toml", "--engine", "gpu"]] {
        let output = run(arguments);
        let errors = desk::words(&output.stderr);
        assert_eq!((output.status.code(), errors.lines().count()), (Some(1), 1), "{errors}");
        assert!(errors.starts_with("error: no GPU adapter") && errors.contains("--engine cpu"), "{errors}");
    }
    assert!(run(&["verify", "study.toml", "--engine", "cpu"]).status.success());
}
