//! Faults that are planted on one side are found, and named.

use glam::DVec3;
use polhode::engine::Engine;
use polhode::math::Precision;
use polhode::scene::AdaptiveSteps;
use polhode::study::problem;
use polhode::verify::{Culprit, Field, Options, verify};
use polhode::{Method, Scene, Torque};

use super::common::torques::{every_torque, middle_moments};
use super::scenes::{LONG_STEP, flying};
use super::{BODIES, DT, SEED, adaptive, all_torques, faulty, scene, steps};

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
    let mut skipped = Vec::new();
    for (place, torque) in own.iter().enumerate() {
        let Some(fault) = stronger(torque, &scale) else {
            skipped.push(torque.name());
            continue;
        };
        let others = [&own[..place], &own[place + 1..]].concat();
        is_named(torque, &fault, &others, Method::Rk8, Precision::F64);
        // Roundings of strong torques hide as much of a weak one in f32.
        let other = Torque::sinusoidal(DVec3::splat(1e-3), DVec3::ZERO, 2.0);
        is_named(torque, &fault, &[other], Method::Rk4, Precision::F32);
    }
    // The one without strength, and gradients, whose strength is the orbit's.
    assert_eq!(skipped, ["constant-body", "gravity-gradient", "gravity-gradient", "gravity-gradient"]);
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

#[test]
fn a_fault_in_the_shader_of_any_torque_is_named() {
    let scale = middle_moments(BODIES, SEED);
    let own = every_torque(&scale);
    let twins = polhode::torque::twin::twins();
    let mut tried = Vec::new();
    for twin in &twins {
        // Between two other torques.
        let torque = instance(&own, twin.file);
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
        tried.push(torque.name());
    }
    // No text is recorded of these: what users write has one of its own, noise and slip have files. Both gradients are of one model.
    let mut untried: Vec<&str> = own.iter().map(Torque::name).filter(|name| !tried.contains(name)).collect();
    untried.dedup();
    assert_eq!(untried, ["white-noise", "internal-dissipation", "flat-plates", "custom"]);
    assert_eq!(tried.len(), twins.len());
}

/// The first torque whose kernel a file holds; a gradient along an ellipse stands behind that along a circle.
fn instance<'a>(own: &'a [Torque], file: &str) -> &'a Torque {
    let stem = file.trim_start_matches("torque/").trim_end_matches(".wgsl").replace('_', "-");
    // Of one model those on an eccentric orbit stand behind the others, and those whose orbit drifts last.
    let found = match (stem.strip_suffix("-kepler"), stem.strip_suffix("-drifting")) {
        (Some(model), _) => own.iter().filter(|torque| torque.name() == model).nth(1),
        (_, Some(model)) => own.iter().rfind(|torque| torque.name() == model),
        (None, None) => own.iter().find(|torque| torque.name() == stem),
    };
    found.unwrap_or_else(|| panic!("{file}: no torque has its kernel"))
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

#[test]
fn centres_of_mass_along_quaternions_off_the_unit_sphere_are_found() {
    let unit = "return plainly_normalised(state.orientation.value).value;";
    let engine = faulty(&[("force/carried.wgsl", unit, "return state.orientation.value;")]);
    let report =
        verify(&engine, &flying(BODIES, Method::Rk4, LONG_STEP, Precision::F64), &steps(5)).expect("both sides run");
    let parting = report.parting().unwrap_or_else(|| panic!("it went unnoticed: {report}"));
    assert!(matches!(parting.field, Field::Position | Field::Velocity), "{report}");
}

/// Kicks in which the velocity does not matter are those of another composition.
#[test]
fn a_sum_that_is_told_to_read_the_velocity_is_found() {
    let torques = [Torque::constant_world(DVec3::X), Torque::sinusoidal(DVec3::Y, DVec3::Z, 1.75)];
    let engine = faulty(&[("torque/sum.wgsl", "return torque_velocity_dependence;", "return 2u;")]);
    let scene = scene(&torques).pinned(Method::Splitting4, DT, Some(Precision::F64)).skipping(false);
    let report = verify(&engine, &scene, &steps(3)).expect("both sides run");
    assert!(report.parting().is_some(), "{report}");
}

/// Without its residue a state loses up to half an ulp, many times the roundings of the increment of a short step.
#[test]
fn compensation_left_out_is_found_at_the_first_step() {
    for (from, to) in [
        ("TwoWordsVector(value, corrected - taken)", "TwoWordsVector(value, vector(0.0, 0.0, 0.0))"),
        ("TwoWordsQuaternion(value, corrected - taken)", "TwoWordsQuaternion(value, quaternion(0.0, 0.0, 0.0, 0.0))"),
    ] {
        is_found_in(DT / 256.0, &[("real_f32.wgsl", from, to)], Method::Rk4, Precision::F32);
    }
}

#[test]
fn faults_of_the_controller_are_found() {
    let file = "method/rk8_adaptive.wgsl";
    for (from, to) in [
        ("1.664377182454986536961530415", "1.664377182454986536961530415 * 1.01"),
        ("var step = controller.step;", "var step = 1.01 * controller.step;"),
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
            let report = verify(&faulty(&[(file, from, to)]), &scene, &steps(60)).expect("both sides run");
            report.parting().is_some()
        });
        assert!(found, "{from} -> {to} went unnoticed");
    }
}
