//! Derived quantities, their statistics, quantiles and histograms, against formulas written out here, from the states of the same run.

use std::mem::discriminant;

use glam::{DMat3, DQuat, DVec3};
use polhode::bodies::inertia::principal_axes;
use polhode::bodies::toolkit::{Axis, EulerSequence, TurnedAxes};
use polhode::record::{QUANTILE_ERROR, Record};
use polhode::scene::Histogram;
use polhode::torque::variable_inertia::{InertiaChange, Law};
use polhode::{Engine, Ensemble, Method, Outputs, Plan, Precision, Quantity, Scene, Torque};

use crate::common;

const BODIES: usize = 1500;

/// Bodies with full tensors of any size, whose axes are not principal ones.
fn ensemble() -> Ensemble {
    let plain = common::asymmetric_ensemble(BODIES, 5);
    Ensemble::from_fn(BODIES, |body| {
        let turn = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(3.0, 1.0, 2.0).normalize(), body as f64));
        let tensor = turn * DMat3::from(plain.inertia()[body]) * turn.transpose();
        (tensor, plain.orientation()[body], plain.angular_velocity_body()[body])
    })
    .expect("valid bodies")
}

/// A quantity and the same by a formula of its own: of tensor, attitude, angular velocity, time and potential energy.
type Case = (Quantity, fn(DMat3, DQuat, DVec3, f64, f64) -> f64);

const AXIS: DVec3 = DVec3::new(1.0, -2.0, 0.5);
const DIRECTION: DVec3 = DVec3::new(-0.3, 0.0, 4.0);

fn dynamic_inertia(tensor: DMat3, omega: DVec3) -> f64 {
    (tensor * omega).length_squared() / omega.dot(tensor * omega)
}

fn latitude(tensor: DMat3, omega: DVec3, axis: usize) -> f64 {
    let axes = principal_axes(&polhode::bodies::inertia::InertiaTensor::from(tensor));
    let (momentum, axis) = (tensor * omega, axes.axis_body(axis));
    momentum.dot(axis).atan2(momentum.cross(axis).length())
}

fn cases() -> Vec<Case> {
    let sequence = EulerSequence::new([Axis::Z, Axis::X, Axis::Z], TurnedAxes::World).expect("a sequence");
    let euler = Quantity::EulerAngle { name: "second".into(), sequence, index: 1 };
    let formula = "norm(to_world(inertia * angular_velocity)) + time * attitude.w";
    let formula = formula.replace("inertia * angular_velocity", "angular_momentum");
    vec![
        (Quantity::KineticEnergy, |tensor, _, omega, _, _| 0.5 * omega.dot(tensor * omega)),
        (Quantity::SpinRate, |_, _, omega, _, _| omega.length()),
        (Quantity::AngularMomentum, |tensor, _, omega, _, _| (tensor * omega).length()),
        (Quantity::AngularMomentumWorld(2), |tensor, q, omega, _, _| (q * (tensor * omega)).z),
        (Quantity::AngularVelocityBody(0), |_, _, omega, _, _| omega.x),
        (Quantity::Nutation, |tensor, _, omega, _, _| omega.angle_between(tensor * omega)),
        (Quantity::DynamicInertia, |tensor, _, omega, _, _| dynamic_inertia(tensor, omega)),
        (Quantity::SeparatrixDistance, |tensor, _, omega, _, _| {
            let tensor = polhode::bodies::inertia::InertiaTensor::from(tensor);
            let moments = principal_axes(&tensor).moments;
            let excess = dynamic_inertia(DMat3::from(tensor), omega) - moments.y;
            excess / if excess > 0.0 { moments.z - moments.y } else { moments.y - moments.x }
        }),
        (Quantity::Latitude(0), |tensor, _, omega, _, _| latitude(tensor, omega, 0)),
        (Quantity::Latitude(1), |tensor, _, omega, _, _| latitude(tensor, omega, 1)),
        (Quantity::Latitude(2), |tensor, _, omega, _, _| latitude(tensor, omega, 2)),
        (Quantity::Yaw, |_, q, _, _, _| (q * DVec3::X).y.atan2((q * DVec3::X).x)),
        (Quantity::Pitch, |_, q, _, _, _| -(q * DVec3::X).z.asin()),
        (Quantity::Roll, |_, q, _, _, _| (q * DVec3::Y).z.atan2((q * DVec3::Z).z)),
        (euler, |_, q, _, _, _| (q * DVec3::Z).z.acos()),
        (Quantity::axis_angle("pointing", AXIS, DIRECTION).expect("directions"), |_, q, _, _, _| {
            (q * AXIS).angle_between(DIRECTION)
        }),
        (Quantity::PotentialEnergy, |_, _, _, _, potential| potential),
        (Quantity::TotalEnergy, |tensor, _, omega, _, potential| 0.5 * omega.dot(tensor * omega) + potential),
        (Quantity::formula("mixed", "1", &formula).expect("a formula"), |tensor, q, omega, time, _| {
            (q * (tensor * omega)).length() + time * q.w
        }),
    ]
}

/// The first moment grows beyond the others, so that the axes change places.
#[test]
fn latitudes_are_those_above_the_equators_of_the_time() {
    let (moments, changed) = (DVec3::new(1.0, 2.0, 2.5), DVec3::new(3.0, 2.0, 2.5));
    let change = Torque::variable_inertia(InertiaChange::tensor(changed), Law::ramp(1.0, 2.0));
    let omega = DVec3::new(0.3, 0.5, -0.2);
    let ensemble = Ensemble::from_columns(&[moments], &[DQuat::IDENTITY], &[omega]).expect("valid");
    let latitudes = [0, 1, 2].map(Quantity::Latitude);
    let scene = Scene::new(ensemble).until(5.0).torque(change).statistics(&latitudes);
    let scene = scene.pinned(Method::Rk8, 0.01, Some(Precision::F64));
    let engine = Engine::cpu();
    let plan = Plan::new(&scene, &engine).expect("a plan");
    let record = engine.run(&plan).expect("a run");
    let momentum = record.final_state().orientation(0).inverse() * (moments * omega);
    let tensor = polhode::bodies::inertia::InertiaTensor::from_principal_moments(changed);
    for (axis, quantity) in latitudes.iter().enumerate() {
        let expected = momentum.normalize().dot(principal_axes(&tensor).axis_body(axis)).asin();
        let found = record.statistics().last().and_then(|last| last.of(quantity)).expect("asked for").mean;
        assert!((found - expected).abs() < 1e-11, "{quantity}: {found}, not {expected}");
    }
}

#[test]
fn every_named_quantity_is_written_out_here() {
    let written: Vec<_> = cases().iter().map(|(quantity, _)| discriminant(quantity)).collect();
    for quantity in Quantity::NAMED {
        assert!(written.contains(&discriminant(quantity)), "{quantity}: give its formula in `cases`");
    }
}

/// Runs a heavy top of all bodies and keeps states and what is asked of them.
fn recorded(engine: &Engine, histograms: &[Histogram]) -> (Scene, Record) {
    let scene = Scene::new(ensemble()).until(1.0).outputs(Outputs::Every(0.5));
    let scene = scene.torque(Torque::heavy_top(0.002, DVec3::new(0.1, 0.0, 0.3), DVec3::new(0.0, 0.0, -9.81)));
    let scene = scene.pinned(Method::Rk8, 0.02, Some(Precision::F64));
    let scene = scene.statistics(cases().iter().map(|(quantity, _)| quantity));
    let scene = scene.quantiles(&[50.0, 1.0, 99.9]).expect("percentages");
    let scene = histograms.iter().cloned().fold(scene, Scene::histogram);
    let record = engine.run(&Plan::new(&scene, engine).expect("a plan")).expect("a run");
    (scene, record)
}

/// The values of a case at an output, body by body.
fn values(scene: &Scene, record: &Record, output: usize, case: &Case) -> Vec<f64> {
    let snapshot = &record.snapshots()[output];
    let value = |body: usize| {
        let (q, omega) = (snapshot.orientation(body), snapshot.angular_velocity_body(body));
        let potential = scene.torques()[0].potential_energy(body, q).expect("a potential");
        (case.1)(DMat3::from(scene.ensemble().inertia()[body]), q, omega, snapshot.time(), potential)
    };
    (0..BODIES).map(value).collect()
}

/// Relative to the largest of the values, with what an arc cosine of a formula here loses near its ends: √ε.
const ROUNDING: f64 = 1e-11;
const NEAR_ENDS: f64 = 3e-8;

#[test]
fn statistics_of_every_quantity() {
    for engine in [Engine::cpu(), Engine::cpu_scalar(), common::gpu()] {
        let (scene, record) = recorded(&engine, &[]);
        for (output, statistics) in record.statistics().iter().enumerate() {
            assert_eq!(statistics.count, BODIES);
            for case in cases() {
                let expected = values(&scene, &record, output, &case);
                let name = case.0.name();
                let found = statistics.of(&case.0).unwrap_or_else(|| panic!("{name} was asked for"));
                let largest = expected.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
                let uses_arc = ["nutation", "pitch", "second", "pointing"].contains(&name);
                let bound = largest * if uses_arc { NEAR_ENDS } else { ROUNDING };
                let mean = expected.iter().sum::<f64>() / BODIES as f64;
                let squares: f64 = expected.iter().map(|x| (x - mean).powi(2)).sum();
                let least = expected.iter().copied().fold(f64::INFINITY, f64::min);
                let greatest = expected.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                for (figure, found, expected) in [
                    ("mean", found.mean, mean),
                    ("standard deviation", found.standard_deviation, (squares / BODIES as f64).sqrt()),
                    ("least", found.min, least),
                    ("greatest", found.max, greatest),
                ] {
                    assert!((found - expected).abs() <= bound, "{name}, {figure}: {found:e}, expected {expected:e}");
                }
                let at_least = expected[found.min_body.expect("a body")];
                assert!((at_least - least).abs() <= bound, "{name}: the least is another body's");

                let mut sorted = expected;
                sorted.sort_by(f64::total_cmp);
                for (percent, quantile) in scene.wanted_quantiles().iter().zip(&found.quantiles) {
                    let rank = (0.01 * percent * BODIES as f64).ceil() as usize;
                    let expected = sorted[rank - 1];
                    let bound = bound + QUANTILE_ERROR * expected.abs();
                    assert!((quantile - expected).abs() <= bound, "{name}, {percent} %: {quantile:e}, {expected:e}");
                }
            }
        }
    }
}

#[test]
fn formulas_read_the_start_of_each_body() {
    let text = "dot(to_world(vec(1, -2, 0.5)), rotate(initial_attitude, vec(-0.3, 0, 4))) \
                + norm(angular_velocity - initial_angular_velocity)";
    let since = Quantity::formula("since", "1", text).expect("a formula");
    for engine in [Engine::cpu(), Engine::cpu_scalar(), common::gpu()] {
        let scene = Scene::new(ensemble()).until(1.0).outputs(Outputs::Every(0.5)).statistics([&since]);
        let scene = scene.torque(Torque::linear_drag(0.1)).pinned(Method::Rk8, 0.02, Some(Precision::F64));
        let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
        for (snapshot, statistics) in record.snapshots().iter().zip(record.statistics()) {
            let value = |body: usize| {
                let start = (scene.ensemble().orientation()[body], scene.ensemble().angular_velocity_body()[body]);
                let (q, omega) = (snapshot.orientation(body), snapshot.angular_velocity_body(body));
                (q * AXIS).dot(start.0 * DIRECTION) + (omega - start.1).length()
            };
            let mean = (0..BODIES).map(value).sum::<f64>() / BODIES as f64;
            let found = statistics.of(&since).expect("it was asked for").mean;
            assert!((found - mean).abs() <= 1e-11 * mean.abs().max(1.0), "{found:e}, expected {mean:e}");
        }
    }
}

#[test]
fn histograms_count_every_body_once() {
    let histograms = [
        Histogram::linear(Quantity::Yaw, -3.0, 3.0, 7).expect("a histogram"),
        Histogram::logarithmic(Quantity::KineticEnergy, 1e-3, 1e2, 40).expect("a histogram"),
    ];
    let (scene, record) = recorded(&Engine::cpu(), &histograms);
    let all = cases();
    assert_eq!(record.histograms().len(), record.snapshots().len());
    for (output, found) in record.histograms().iter().enumerate() {
        for (histogram, found) in histograms.iter().zip(found) {
            let case = all.iter().find(|(quantity, _)| quantity == histogram.quantity()).expect("a case");
            let expected = values(&scene, &record, output, case);
            let within = |low: f64, high: f64| expected.iter().filter(|x| (low..high).contains(*x)).count() as u64;
            let edges = histogram.edges();
            let bins: Vec<u64> = edges.windows(2).map(|pair| within(pair[0], pair[1])).collect();
            assert_eq!(found.bins(), bins);
            assert_eq!(found.below(), within(f64::NEG_INFINITY, edges[0]));
            assert_eq!(found.above(), within(edges[edges.len() - 1], f64::INFINITY));
            assert_eq!(found.counts.iter().sum::<u64>(), BODIES as u64);
            assert!(found.below() + found.above() > 0 && bins.iter().filter(|count| **count > 0).count() > 5);
        }
    }
}

/// Whether states are written too, and how many threads there are, changes no bit.
#[test]
fn statistics_do_not_depend_on_threads() {
    let histogram = Histogram::linear(Quantity::Yaw, -3.0, 3.0, 7).expect("a histogram");
    let of_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let (_, record) = recorded(&Engine::cpu(), std::slice::from_ref(&histogram));
            (format!("{:?}", record.statistics()), record.histograms().to_vec())
        })
    };
    assert_eq!(of_threads(1), of_threads(3));
}
