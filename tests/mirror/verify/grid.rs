//! The grid: methods, torques, precisions, engines.

use polhode::engine::Engine;
use polhode::math::Precision;
use polhode::torque::variable_inertia::{InertiaChange, Law};
use polhode::verify::{Options, Report};
use polhode::{Method, Scene, Torque};

use super::common::measured::stays_within_measured;
use super::common::torques::{every_torque, every_torque_where, middle_moments};
use super::{SEED, agreed, common, steps};

pub fn follows_slip(method: Method) -> bool {
    matches!(method, Method::Rk4 | Method::Rk8 | Method::Cf4)
}

/// Whether a method lets torques act at frozen attitudes, by what their sum depends on.
fn kicks(method: Method) -> bool {
    matches!(method, Method::Dlm | Method::Splitting2 | Method::Splitting4 | Method::Splitting6)
}

/// A step of the grid, s: its second word in `f32` is not zero.
pub const GRID_DT: f64 = 1.0 / 60.0;
pub const GRID_STEPS: u64 = 20;
/// Number of torques of [`every_torque`], and moments that change.
const KINDS: usize = 25;
/// The gravity gradients among them.
const GRADIENTS: [usize; 3] = [8, 9, 21];
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
    assert_eq!(all.len() + 1, KINDS, "KINDS is one more than the torques of every_torque: two would act on one body");
    assert!(GRADIENTS.iter().all(|&place| all[place].name() == "gravity-gradient"), "GRADIENTS has other places");
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

/// Steps fifteen times as long, s, whose bounds hang on how slopes hand on what they are off by; a few of them.
const LONG_DT: f64 = 0.25;
const LONG_STEPS: u64 = 4;

pub fn grid_scene(torques: &[Torque], bodies: usize, (method, dt): (Method, f64), precision: Precision) -> Scene {
    let scene = Scene::new(common::asymmetric_ensemble(bodies, SEED)).until(1.0).skipping(false);
    let scene = torques.iter().fold(scene, |scene, torque| scene.torque(torque.clone()));
    scene.pinned(method, dt, Some(precision))
}

/// The largest part of its derived bound that a difference came to in f32 and in f64, over 100 draws of a body under each set of torques, on
/// lanes and on lavapipe (docs/grid.md, whose command writes the table anew).
pub fn measured(method: Method, precision: Precision) -> f64 {
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
        _ => panic!("{method}: not measured; `bash tests/grid.sh` prints the largest parts"),
    };
    if precision == Precision::F32 { narrow } else { wide }
}

/// The same at [`LONG_DT`], by the command of [`largest_parts_at_long_steps`].
fn measured_at_long_steps(method: Method, precision: Precision) -> f64 {
    let [narrow, wide] = match method {
        Method::Rk4 => [4.57e-2, 6.43e-2],
        Method::Rk8 => [1.11e-2, 1.07e-2],
        Method::Cf4 => [2.82e-2, 2.61e-2],
        Method::Splitting2 => [2.52e-2, 1.90e-2],
        Method::Splitting4 => [8.74e-3, 9.14e-3],
        Method::Splitting6 => [6.44e-3, 4.84e-3],
        Method::ImplicitMidpoint => [2.95e-2, 2.80e-2],
        Method::Dlm => [3.41e-2, 5.67e-2],
        Method::ExplicitEuler => [1.64e-2, 9.89e-3],
        Method::GyroNewton => [7.54e-3, 1.19e-2],
        Method::ClampedEuler => [5.43e-2, 5.32e-2],
        Method::Spiral => [1.36e-2, 2.24e-2],
        _ => panic!("{method}: not measured; the test `largest_parts_at_long_steps` prints the rows"),
    };
    if precision == Precision::F32 { narrow } else { wide }
}

fn agrees_under_every_torque(engine: &Engine, method: Method) {
    for (name, torques) in sets(method) {
        for precision in Precision::ALL {
            let what = format!("{method} in {precision}, {name}");
            agrees_at(engine, &torques, (method, GRID_DT, GRID_STEPS), measured(method, precision), precision, &what);
            if name == "each torque alone" {
                let part = measured_at_long_steps(method, precision);
                let what = format!("{what}, long steps");
                agrees_at(engine, &torques, (method, LONG_DT, LONG_STEPS), part, precision, &what);
            }
        }
    }
}

fn agrees_at(
    engine: &Engine,
    torques: &[Torque],
    (method, dt, count): (Method, f64, u64),
    part: f64,
    precision: Precision,
    what: &str,
) {
    let scene = grid_scene(torques, GRID_BODIES, (method, dt), precision);
    within_measured(engine, &scene, &steps(count), part, precision, what);
}

/// Both sides agree, within four times the part of their bounds that was measured.
pub fn within_measured(
    engine: &Engine,
    scene: &Scene,
    options: &Options,
    part: f64,
    precision: Precision,
    what: &str,
) -> Report {
    let report = agreed(engine, scene, options, what);
    stays_within_measured(engine, precision, what, report.largest_part(), part);
    report
}

/// A test of each method, so that they run side by side. On the CPU engine the twin itself steps the last ones, with which there is nothing
/// to compare.
macro_rules! grid {
    ($($name:ident: $method:ident,)*; $($scalar:ident: $own:ident,)*) => {
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
            $(#[test]
            fn $scalar() {
                agrees_under_every_torque(&common::gpu(), Method::$own);
            })*
        }

        #[test]
        fn every_method_has_its_place_in_the_grid() {
            assert_eq!([$(Method::$method,)* $(Method::$own,)*], Method::ALL);
        }
    };
}

every_method!(grid);

/// Draws of a body for each cell of the table.
const DRAWS: usize = 100;

/// A cell: the largest difference in ulps of the largest component, and the largest part of its bound.
fn cell(engine: &Engine, torques: &[Torque], method: Method, precision: Precision) -> (f64, f64) {
    let scene = grid_scene(torques, DRAWS, (method, GRID_DT), precision);
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

#[test]
#[ignore = "prints what `measured_at_long_steps` holds: cargo test --test mirror verify::grid::largest_parts -- --ignored --nocapture"]
fn largest_parts_at_long_steps() {
    let engines = [Engine::cpu(), common::gpu()];
    for method in Method::ALL {
        let parts = Precision::ALL.map(|precision| {
            let of = |engine: &Engine| {
                let torques = torques_of(method, DRAWS, |torque, body| body % KINDS == torque);
                let scene = grid_scene(&torques, DRAWS, (method, LONG_DT), precision);
                agreed(engine, &scene, &steps(LONG_STEPS), &format!("{method} in {precision}")).largest_part()
            };
            engines.iter().map(of).fold(0.0, f64::max)
        });
        println!("Method::{method:?} => [{:.2e}, {:.2e}],", parts[0], parts[1]);
    }
}
