//! `verify` agrees where the kernels agree, and finds faults that are planted in a shader.

mod common;

use polhode::batch::Precision;
use polhode::engine::gpu::{GpuOptions, Patch};
use polhode::study::problem;
use polhode::verify::{Report, verify};
use polhode::{Engine, Method};

const BODIES: usize = 67;
const STEPS: u64 = 200;
const DT: f64 = 1.0 / 64.0;

/// Verifies the GPU engine with a shader text changed.
fn verified(patches: &[(&str, &str, &str)], method: Method, precision: Precision) -> Report {
    let patches = patches
        .iter()
        .map(|&(file, from, to)| Patch { file: file.to_owned(), from: from.to_owned(), to: to.to_owned() })
        .collect();
    let engine = Engine::gpu(GpuOptions { patches, ..common::any_adapter() }).expect("a Vulkan adapter");
    let ensemble = problem::free(BODIES, 7).expect("valid");
    verify(&engine, &ensemble, method, precision, DT, STEPS).expect("both engines run")
}

#[test]
fn shader_and_twins_agree_in_every_precision() {
    // The bound is that of a compensated state; the other methods are compared in tests/parity.rs.
    for method in [Method::Rk4, Method::Dlm] {
        for precision in Precision::ALL {
            let report = verified(&[], method, precision);
            assert!(report.agrees(), "{method} in {precision}: {report:#?}");
            assert_eq!(report.comparisons.len(), 3);
        }
    }
}

/// The report must name step 1: each of these faults shows at once.
fn is_found(patches: &[(&str, &str, &str)], method: Method, precision: Precision) {
    let report = verified(patches, method, precision);
    assert!(!report.agrees(), "{patches:?} went unnoticed");
    let against_twin = report.comparisons[0].parting.expect("shader and twin part");
    let against_reference = report.comparisons[1].parting.expect("shader and reference part");
    assert_eq!((against_twin.step, against_reference.step), (1, 1), "{patches:?}");
    assert!(report.comparisons[2].parting.is_none(), "twin and reference still agree: {:?}", report.comparisons[2]);
}

#[test]
fn a_flipped_sign_of_the_gyroscopic_term_is_found_at_the_first_step() {
    let fault = [("rigid_body.wgsl", "a.zxy, a.yzx", "a.yzx, a.zxy")];
    is_found(&fault, Method::Rk4, Precision::F32);
    is_found(&fault, Method::Rk4, Precision::F64);
}

#[test]
fn a_dropped_gyroscopic_term_is_found_at_the_first_step() {
    is_found(
        &[("method/slope.wgsl", "var m_rate = motion.gyroscopic_term", "var m_rate = vector(0.0, 0.0, 0.0)")],
        Method::Rk4,
        Precision::F32,
    );
}

#[test]
fn a_wrong_half_angle_is_found_at_the_first_step() {
    is_found(
        &[("rigid_body.wgsl", "product_vector(q, angular_velocity * 0.5)", "product_vector(q, angular_velocity)")],
        Method::Rk4,
        Precision::F32,
    );
    is_found(&[("method/dlm.wgsl", "sin_cos(angle * 0.25)", "sin_cos(angle * 0.5)")], Method::Dlm, Precision::F32);
}

#[test]
fn a_quaternion_product_in_the_wrong_order_is_found_at_the_first_step() {
    // (v, 0) q in place of q (v, 0): the cross product changes its sign.
    is_found(
        &[(
            "quaternion.wgsl",
            "mul_add(q.w, v.x, mul_add(q.y, v.z, -(q.z * v.y)))",
            "mul_add(q.w, v.x, mul_add(q.z, v.y, -(q.y * v.z)))",
        )],
        Method::Rk4,
        Precision::F32,
    );
}

/// Without its residue the state loses up to half an ulp a step, a random walk; the bound, which steps as short as these
/// hardly raise, is left within the run.
#[test]
fn compensation_left_out_is_found() {
    for (file, from, to) in [
        (
            "real_f32.wgsl",
            "TwoWordsVector(value, rounded_vector(corrected - taken))",
            "TwoWordsVector(value, vector(0.0, 0.0, 0.0))",
        ),
        (
            "real_f32.wgsl",
            "TwoWordsQuaternion(value, rounded_quaternion(corrected - taken))",
            "TwoWordsQuaternion(value, quaternion(0.0, 0.0, 0.0, 0.0))",
        ),
    ] {
        let patches = vec![Patch { file: file.to_owned(), from: from.to_owned(), to: to.to_owned() }];
        let engine = Engine::gpu(GpuOptions { patches, ..common::any_adapter() }).expect("a Vulkan adapter");
        let ensemble = problem::free(BODIES, 7).expect("valid");
        let report =
            verify(&engine, &ensemble, Method::Rk4, Precision::F32, DT / 256.0, 4000).expect("both engines run");
        for comparison in &report.comparisons[..2] {
            assert!(comparison.parting.is_some(), "{to} went unnoticed: {comparison:#?}");
        }
    }
}
