//! What in a step a fault is traced to.

use glam::DVec3;
use polhode::engine::Engine;
use polhode::math::Precision;
use polhode::scene::AdaptiveSteps;
use polhode::verify::{Culprit, Field, Onset, Options, verify};
use polhode::{Method, Scene, Torque};

use super::{DT, adaptive, faulty, scene, steps};

/// Orientations turn twice as fast.
pub const HALF_ANGLE: (&str, &str, &str) =
    ("rigid_body.wgsl", "product_vector(q, angular_velocity * 0.5)", "product_vector(q, angular_velocity)");

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
    let time = ("method/rk4.wgsl", "let middle = epoch(step_index, 0.5);", "let middle = epoch(step_index, 0.25);");
    let stage = ("method/rk4.wgsl", "axpy_vector(k2.m, half, m)", "axpy_vector(k2.m, dt.value, m)");
    for precision in Precision::ALL {
        let found = planted(HALF_ANGLE, precision);
        assert_eq!(found, (Culprit::Method, Onset::Slope(Field::Orientation)), "{precision}");
        let found = planted(time, precision);
        assert_eq!(found, (Culprit::Torques(vec![1]), Onset::Stage(Field::AngularMomentum, 2)), "{precision}");
        let (culprit, found) = planted(stage, precision);
        assert_eq!(culprit, Culprit::Method, "{precision}");
        assert!(matches!(found, Onset::Stage(_, 2..)), "{precision}: {found:?}");
    }
    // The second word forgotten: what is lost is a rounding of the state, however short the step.
    let compensation =
        ("real_f32.wgsl", "TwoWordsVector(value, corrected - taken)", "TwoWordsVector(value, vector(0.0, 0.0, 0.0))");
    assert!(matches!(planted(compensation, Precision::F32).1, Onset::State(Field::AngularMomentum) | Onset::NotFound));
}

/// The same of adaptive steps, attempt by attempt: a fault in the error estimate or in the controller leaves the states alone.
#[test]
fn a_fault_in_an_attempt_is_traced() {
    let torques = [Torque::linear_drag(0.3), Torque::sinusoidal(DVec3::X, DVec3::Y, 3.0)];
    let traced = |engine: &Engine, scene: &Scene, options: &Options| {
        let report = verify(engine, scene, options).expect("both sides run");
        let parting = report.parting().unwrap_or_else(|| panic!("nothing was noticed: {report}"));
        (parting.culprit.clone(), parting.onset)
    };
    let by_series = || scene(&torques).taylor(AdaptiveSteps { tolerance: 1e-12, least_step: None }).skipping(false);
    let [sine, cosine] = [[1.001, 1.0], [1.0, 1.001]].map(|[s, c]| Torque::sinusoidal(s * DVec3::X, c * DVec3::Y, 3.0));
    for (twin, expected) in
        [(cosine, Onset::Slope(Field::AngularMomentum)), (sine, Onset::Stage(Field::AngularMomentum, 2))]
    {
        for scene in [adaptive(&torques, 1e-10, Precision::F64), by_series()] {
            let options = Options { twin_torques: Some(vec![torques[0].clone(), twin.clone()]), ..steps(2) };
            assert_eq!(traced(&Engine::cpu(), &scene, &options), (Culprit::Torques(vec![1]), expected));
        }
    }
    let planted = |patch: (&str, &str, &str), precision: Precision| {
        let tolerance = if precision == Precision::F32 { 1e-4 } else { 1e-10 };
        traced(&faulty(&[patch]), &adaptive(&torques, tolerance, precision), &steps(4))
    };
    let time = ("method/rk8.wgsl", "epoch_at(place, 0.6)", "epoch_at(place, 0.5)");
    let estimate =
        ("method/rk8_adaptive.wgsl", "1.664377182454986536961530415", "1.664377182454986536961530415 * 1.01");
    let controller = ("method/rk8_adaptive.wgsl", "var step = controller.step;", "var step = 1.01 * controller.step;");
    for precision in Precision::ALL {
        assert_eq!(planted(HALF_ANGLE, precision), (Culprit::Method, Onset::Slope(Field::Orientation)), "{precision}");
        let (culprit, onset) = planted(time, precision);
        // In f32 roundings may hide it in the next shorter step.
        let hidden = precision == Precision::F32 && onset == Onset::NotFound;
        assert!(hidden || onset == Onset::Stage(Field::AngularMomentum, 2), "{precision}: {onset:?}");
        assert_eq!(culprit, Culprit::Torques(vec![1]), "{precision}");
        assert_eq!(planted(estimate, precision), (Culprit::Method, Onset::Controller), "{precision}");
        assert_eq!(planted(controller, precision), (Culprit::Method, Onset::Controller), "{precision}");
    }
}

/// Of projected steps, whether it is the projection: the same step without it agrees then.
#[test]
fn a_fault_in_a_projected_step_is_traced() {
    let traced = |patch: (&str, &str, &str)| {
        let free = scene(&[]).projected(Method::Rk4, DT);
        let report = verify(&faulty(&[patch]), &free, &steps(2)).expect("both sides run");
        let parting = report.parting().unwrap_or_else(|| panic!("{patch:?} went unnoticed"));
        (parting.culprit.clone(), parting.onset)
    };
    let root = ("method/projection.wgsl", "let size = sqrt(", "let size = 1.001 * sqrt(");
    assert_eq!(traced(root), (Culprit::Projection, Onset::State(Field::AngularMomentum)));
    assert_eq!(traced(HALF_ANGLE), (Culprit::Method, Onset::Slope(Field::Orientation)));
}
