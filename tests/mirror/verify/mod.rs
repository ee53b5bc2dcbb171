//! `verify` agrees over whole scenes where the kernels agree, and finds and names faults that are planted on one side.

use crate::common;
use crate::workspace;
/// Hands the names of tests and the methods, first those that have lanes, to a macro.
macro_rules! every_method {
    ($with:ident) => {
        $with! {
            rk4: Rk4,
            rk8: Rk8,
            cf4: Cf4,
            splitting2: Splitting2,
            splitting4: Splitting4,
            splitting6: Splitting6,
            implicit_midpoint: ImplicitMidpoint,
            dlm: Dlm,
            ;
            explicit_euler: ExplicitEuler,
            gyro_newton: GyroNewton,
            clamped_euler: ClampedEuler,
            spiral: Spiral,
        }
    };
}

mod alone;
mod attempts;
mod faults;
mod grid;
mod lost;
mod onset;
mod requests;
mod scenes;
mod stage;
mod studies;

use common::torques::{each_torque_alone, every_torque, middle_moments};
use polhode::engine::Engine;
use polhode::engine::gpu::{GpuOptions, Patch};
use polhode::math::Precision;
use polhode::scene::AdaptiveSteps;
use polhode::torque::variable_inertia::{InertiaChange, Law};
use polhode::verify::{Options, Report, verify};
use polhode::{Outputs, Scene, Torque};

/// Fills no lane group of any width; one for each torque of [`every_torque`] at least.
const BODIES: usize = 25;
const SEED: u64 = 7;
const DT: f64 = 1.0 / 64.0;

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

/// Every state must be held against a bound, and no difference beyond its own: without, any finite number would pass.
fn agreed(engine: &Engine, scene: &Scene, options: &Options, what: &str) -> Report {
    let report = verify(engine, scene, options).unwrap_or_else(|error| panic!("{what}: {error}"));
    assert!(report.agrees(), "{what}: {report}");
    for side in report.groups.iter().flat_map(|group| &group.comparisons).filter(|side| side.judged) {
        assert_eq!((side.undecided, side.lost), (0, 0), "{what}: {report}");
    }
    println!("{what}: at most {:.3} of the bound, {} numbers", report.largest_part(), report.compared());
    report
}

/// Moments that change while the steps are compared.
fn ramp() -> Torque {
    Torque::variable_inertia(InertiaChange::factor(0.6), Law::ramp(0.05, 0.3))
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
    let all = each_torque_alone(&middle_moments(BODIES, SEED), BODIES);
    assert!(all.len() <= BODIES, "{} torques act on {BODIES} bodies: some on none", all.len());
    smooth(all)
}

/// A GPU with a shader text changed.
fn faulty(patches: &[(&str, &str, &str)]) -> Engine {
    let patches = patches
        .iter()
        .map(|&(file, from, to)| Patch { file: file.to_owned(), from: from.to_owned(), to: to.to_owned() })
        .collect();
    common::gpu_with(GpuOptions { patches, ..common::any_adapter() })
}
