//! Quantities, their statistics and histograms, formed on the device, against the same of the states read back.

use crate::common;

use glam::{DQuat, DVec3};
use polhode::engine::gpu::{GpuOptions, Patch};
use polhode::record::Record;
use polhode::scene::{AdaptiveSteps, Histogram};
use polhode::torque::{Parameters, Sampling};
use polhode::{Engine, Ensemble, Method, Outputs, Plan, Precision, Quantity, Scene, Torque};

/// Pieces of many blocks, and so many bodies that moments of blocks are less than states.
const BODIES: usize = 20_003;

/// How far a statistic may be from that of the host, relative to its spread and mean: roundings of f64 in sums of another order, and of
/// formulas that an adapter may fuse.
const BOUND: f64 = 1e-11;

/// Bodies that such roundings may put into another bin.
const STRAYS: u64 = 2;

fn quantities() -> Vec<Quantity> {
    let mut all: Vec<Quantity> = Quantity::NAMED.to_vec();
    all.retain(|quantity| !matches!(quantity, Quantity::PotentialEnergy | Quantity::TotalEnergy));
    all.push(Quantity::axis_angle("pointing", DVec3::Z, DVec3::new(1.0, 2.0, 3.0)).expect("axes"));
    all.push(
        Quantity::formula("stretched", "1", "inertia.xx * norm(angular_momentum) + sin(time)").expect("a formula"),
    );
    let since = "norm(angular_velocity - initial_angular_velocity) + (conjugate(initial_attitude) * attitude).w";
    all.push(Quantity::formula("since_start", "1", since).expect("a formula"));
    // Half of the bodies have none.
    all.push(Quantity::formula("undefined", "1", "sqrt(angular_velocity.y)").expect("a formula"));
    all
}

fn histograms() -> [Histogram; 3] {
    [
        Histogram::logarithmic(Quantity::SpinRate, 0.1, 3.0, 37).expect("bins"),
        Histogram::linear(Quantity::Yaw, -3.0, 3.0, 50).expect("bins"),
        // Without an edge at zero, where rounding alone says on which side a linear rotor is.
        Histogram::linear(Quantity::SeparatrixDistance, -1.0, 1.0, 9).expect("bins"),
    ]
}

/// Asks all of that of a scene, at some times.
fn asked(scene: Scene) -> Scene {
    let scene = scene.until(2.0).outputs(Outputs::Every(0.5)).without_states().statistics(quantities());
    histograms().into_iter().fold(scene, Scene::histogram)
}

/// What is found where it is formed on the device, or of states read back, with the bytes that came back.
fn found(engine: &Engine, scene: &Scene) -> (Record, u64) {
    let plan = Plan::new(scene, engine).expect("planned");
    let record = engine.run(&plan).expect("run");
    let bytes = record.trust().traffic.bytes_read;
    (record, bytes)
}

fn options(forms_quantities: bool) -> GpuOptions {
    GpuOptions { forms_quantities: Some(forms_quantities), ..common::any_adapter() }
}

/// Whether an adapter forms quantities at all.
fn is_formed(test: &str) -> bool {
    let has_f64 = common::gpu().precisions().contains(&Precision::F64);
    if !has_f64 {
        common::skipped(test, "the adapter has no f64");
    }
    has_f64
}

/// The first thing in which two records differ.
fn difference(expected: &Record, found: &Record) -> Option<String> {
    for (expected, found) in expected.statistics().iter().zip(found.statistics()) {
        let time = expected.time;
        if expected.count != found.count {
            return Some(format!("{} bodies and {} at {time} s", expected.count, found.count));
        }
        for (expected, found) in expected.summaries.iter().zip(&found.summaries) {
            if expected.count != found.count {
                let quantity = &expected.quantity;
                return Some(format!("{} and {} bodies with {quantity} at {time} s", found.count, expected.count));
            }
            let scale = expected.mean.abs().max(expected.standard_deviation);
            let pairs = [
                ("mean", expected.mean, found.mean, scale),
                ("deviation", expected.standard_deviation, found.standard_deviation, scale),
                ("least", expected.min, found.min, expected.min.abs().max(scale)),
                ("greatest", expected.max, found.max, expected.max.abs().max(scale)),
            ];
            for (name, expected_number, number, scale) in pairs {
                let off = (number - expected_number).abs();
                if off.is_nan() || off > BOUND * scale {
                    let quantity = &expected.quantity;
                    return Some(format!("{name} of {quantity} at {time} s: {number:e} and {expected_number:e}"));
                }
            }
            // Others have extremes that several bodies reach, up to roundings.
            let is_spread = matches!(expected.quantity, Quantity::SpinRate | Quantity::KineticEnergy | Quantity::Yaw);
            if is_spread && (expected.min_body, expected.max_body) != (found.min_body, found.max_body) {
                return Some(format!("extremes of {} at {time} s", expected.quantity));
            }
        }
    }
    for (expected, found) in expected.histograms().iter().flatten().zip(found.histograms().iter().flatten()) {
        let moved: u64 = expected.counts.iter().zip(&found.counts).map(|(a, b)| a.abs_diff(*b)).sum();
        if moved > 2 * STRAYS || expected.counts.iter().sum::<u64>() != found.counts.iter().sum::<u64>() {
            return Some(format!("a histogram at {} s: {:?} and {:?}", expected.time, expected.counts, found.counts));
        }
    }
    None
}

fn drag() -> Torque {
    Torque::linear_drag(5e-5)
}

/// Equal steps, adaptive ones and closed forms in both precisions.
fn scenes() -> Vec<(&'static str, Scene)> {
    let bodies = || common::asymmetric_ensemble(BODIES, 3);
    let adaptive = |precision, tolerance| {
        let steps = AdaptiveSteps { tolerance, least_step: None };
        Scene::new(bodies()).torque(drag()).adaptive(steps, Some(precision))
    };
    let law = Torque::pd_attitude(1e-4, 1e-4, DQuat::IDENTITY, 1e-4, Sampling::every(0.3));
    vec![
        ("rk4 in f32", Scene::new(bodies()).torque(drag()).pinned(Method::Rk4, 0.05, Some(Precision::F32))),
        ("rk8 in f64", Scene::new(bodies()).torque(drag()).pinned(Method::Rk8, 0.1, Some(Precision::F64))),
        ("adaptive in f32", adaptive(Precision::F32, 1e-4)),
        ("adaptive in f64", adaptive(Precision::F64, 1e-8)),
        ("closed forms", Scene::new(bodies())),
        ("a sampled torque", Scene::new(bodies()).torque(law).pinned(Method::Rk8, 0.1, Some(Precision::F64))),
        ("linear rotors", Scene::new(rotors()).torque(drag()).pinned(Method::Rk8, 0.1, Some(Precision::F64))),
    ]
}

/// Linear rotors of the size of molecules beside rigid bodies.
fn rotors() -> Ensemble {
    let rigid = common::asymmetric_ensemble(BODIES, 3);
    Ensemble::from_fn(BODIES, |body| {
        let (q, omega) = (rigid.orientation()[body], rigid.angular_velocity_body()[body]);
        match body % 3 {
            0 => (DVec3::new(0.0, 1.0, 1.0), q, omega.with_x(0.0)),
            _ => (DVec3::new(1.0, 1.5, 2.0), q, omega),
        }
    })
    .expect("valid bodies")
}

#[test]
fn what_the_device_forms_is_what_states_say_and_less_comes_back() {
    if !is_formed("quantities on the device") {
        return;
    }
    let [reading, forming] = [false, true].map(|forms| common::gpu_with(options(forms)));
    for (name, scene) in scenes() {
        let scene = asked(scene);
        let (expected, all) = found(&reading, &scene);
        let (found, bytes) = found(&forming, &scene);
        assert_eq!(difference(&expected, &found), None, "{name}");
        assert_eq!(found.statistics().len(), 4, "{name}");
        assert_eq!(found.statistics()[1].count, BODIES, "{name}");
        let counts = found.statistics()[1].summaries.iter().map(|summary| summary.count).collect::<Vec<_>>();
        let (undefined, others) = counts.split_last().expect("quantities");
        assert!((1..BODIES).contains(undefined) && others.iter().all(|&count| count == BODIES), "{name}: {counts:?}");
        // The last output is read all the same. Of three others half of some 60 bytes a body is less than what is saved.
        assert!(all - bytes > 90 * BODIES as u64, "{name}: {bytes} of {all} bytes");
    }
}

#[test]
fn bodies_that_fail_are_in_no_figure() {
    if !is_formed("quantities of failed bodies on the device") {
        return;
    }
    let ends: Vec<f64> = (0..BODIES).map(|body| if body % 97 == 5 { 0.7 } else { 1e9 }).collect();
    let parameters = Parameters::new().number("end", ends).expect("a name");
    let torque = Torque::custom("sqrt(end - time) * 1e-9 * angular_velocity", parameters).expect("a formula");
    let bodies = common::asymmetric_ensemble(BODIES, 3);
    let scene = asked(Scene::new(bodies).torque(torque).pinned(Method::Rk4, 0.1, Some(Precision::F64)));
    let [(expected, _), (found, _)] = [false, true].map(|forms| found(&common::gpu_with(options(forms)), &scene));
    assert_eq!(difference(&expected, &found), None);
    let failed = (0..BODIES).filter(|body| body % 97 == 5).count();
    let counts: Vec<usize> = found.statistics().iter().map(|statistics| statistics.count).collect();
    assert_eq!(counts, [BODIES, BODIES - failed, BODIES - failed, BODIES - failed]);
    assert_eq!(found.trust().failed_bodies.len(), failed);
}

#[test]
fn where_the_device_has_no_room_states_are_read() {
    if !is_formed("quantities beyond the device's memory") {
        return;
    }
    let formula = |index: usize| Quantity::formula(&format!("q{index}"), "1", &format!("{index} * time + inertia.yy"));
    let many: Vec<Quantity> = (0..60).map(|index| formula(index).expect("a formula")).collect();
    let scene = Scene::new(common::asymmetric_ensemble(BODIES, 3)).torque(drag()).pinned(Method::Rk4, 0.1, None);
    let scene = asked(scene).statistics(many);
    // Enough for the bodies, not for so many quantities of each.
    let memory = Some(8 << 20);
    let engine = |forms| common::gpu_with(GpuOptions { memory, ..options(forms) });
    let [(expected, all), (found, bytes)] = [false, true].map(|forms| found(&engine(forms), &scene));
    assert_eq!(difference(&expected, &found), None);
    assert_eq!(bytes, all);
}

#[test]
fn faults_in_the_shader_are_found() {
    if !is_formed("faults planted in quantities on the device") {
        return;
    }
    let bodies = common::asymmetric_ensemble(BODIES, 3);
    let scene = asked(Scene::new(bodies).torque(drag()).pinned(Method::Rk4, 0.1, Some(Precision::F64)));
    let (expected, _) = found(&common::gpu_with(options(false)), &scene);
    let faults = [
        ("let deviation = formed[start + offset] - own.mean;", "let deviation = formed[start + offset];"),
        ("both.mean = a.mean + difference * share;", "both.mean = a.mean;"),
        ("if (edges[first_edge + middle] <= value) {", "if (edges[first_edge + middle] <= value * 1.01) {"),
        ("quaternion(-turn.x, -turn.y, -turn.z, turn.w)", "turn"),
        ("rotated(unit, m) * column_at(ANGULAR_MOMENTUM_UNIT, place)", "rotated(unit, m)"),
        ("let side = WORKGROUP * (quantity % 2u);", "let side = 0u;"),
    ];
    for (from, to) in faults {
        let patch = Patch { file: "gather.wgsl".to_owned(), from: from.to_owned(), to: to.to_owned() };
        let engine = common::gpu_with(GpuOptions { patches: vec![patch], ..options(true) });
        let (found, _) = found(&engine, &scene);
        assert!(difference(&expected, &found).is_some(), "{to}");
    }
}
