//! Shaders against their twins after one step and after many, under every method.
//!
//! What drivers may do to a sum is said in `parity`, which compares functions one by one.

use crate::common;

use common::compare::{Mismatch, compare_states, first_bit_difference};
use common::measured::{MEASURED_TIMES, SEEDS};
use polhode::bodies::columns::StateWords;
use polhode::engine::Engine;
use polhode::engine::batch::AnyBatch;
use polhode::engine::gpu::Patch;
use polhode::kernel::method::Method;
use polhode::math::Precision;

/// One step, by precision. In f32 the state is carried in two words, so that sides differ only by the last bits of the
/// increments, which are at most ω dt = 1/16 of the state here: four roundings of them. In f64 the state itself is
/// rounded, up to four times in the five rotations of `dlm` for each component.
const STEP_ULPS_F32: f64 = 4.0 / 16.0;
const STEP_ULPS_F64: f64 = 4.0;

/// Bodies: not a multiple of the workgroup size.
const BODIES: usize = 203;
const DT: f64 = 1.0 / 64.0;

/// The bound after `steps` steps, in ulps of a vector's largest component.
///
/// Differences of single steps add up, and one in the spin turns into an angle that grows with ω t; as their signs are
/// random both together stay below the straight sum as long as ω t is below the root of the number of steps. Where the
/// state is not compensated, in f64 and in what other programs do, each step rounds the state itself.
///
/// An adapter that rounds products and sums apart, as the twin does, differs in what it re-associates alone: there the bound is
/// [`MEASURED_TIMES`] what was measured.
pub fn bound(gpu: &Engine, precision: Precision, method: Method, steps: u64) -> f64 {
    let plain = matches!(method, Method::ExplicitEuler | Method::GyroNewton | Method::ClampedEuler | Method::Spiral);
    let step = if precision == Precision::F64 || plain { STEP_ULPS_F64 } else { STEP_ULPS_F32 };
    let place = STEPS.iter().position(|&other| other == steps).expect("one of the numbers of steps that were measured");
    let as_measured = MEASURED_TIMES * measured(method, precision)[place].max(LEAST_MEASURED);
    if common::rounds_like_scalar_twin(gpu, precision) { as_measured } else { as_measured.max(step * steps as f64) }
}

/// What stands as 0.0 in [`measured`] is below this: roundings of second words.
const LEAST_MEASURED: f64 = 5e-4;

/// Numbers of steps that are compared.
const STEPS: [u64; 3] = [1, 100, 1000];

/// The largest differences over [`SEEDS`] draws of all bodies on lavapipe after [`STEPS`], in ulps. In `f64` one rounding of the state grows
/// with the angle; `clamped_euler` and `spiral` are not compensated, and in `dlm` an angle of each of five rotations is rounded.
fn measured(method: Method, precision: Precision) -> [f64; 3] {
    match (method, precision) {
        (Method::Rk4, Precision::F32) => [0.0, 0.38, 1.2],
        (Method::Rk4, Precision::F64) => [1.0, 25.0, 550.0],
        (Method::Rk8, Precision::F32) => [0.0, 0.0, 0.0],
        (Method::Rk8, Precision::F64) => [1.0, 11.0, 31.0],
        (Method::Cf4, Precision::F32) => [0.094, 1.9, 15.0],
        (Method::Cf4, Precision::F64) => [1.0, 11.0, 550.0],
        (Method::Splitting2, Precision::F32) => [0.0, 0.0, 0.0],
        (Method::Splitting2, Precision::F64) => [1.0, 11.0, 1500.0],
        (Method::Splitting4, Precision::F32) => [0.0, 0.0, 0.0],
        (Method::Splitting4, Precision::F64) => [1.0, 11.0, 1500.0],
        (Method::Splitting6, Precision::F32) => [0.0, 0.0, 0.0],
        (Method::Splitting6, Precision::F64) => [1.0, 11.0, 1500.0],
        (Method::ImplicitMidpoint, Precision::F32) => [0.0, 0.0, 0.0],
        (Method::ImplicitMidpoint, Precision::F64) => [1.0, 8.5, 29.0],
        (Method::Dlm, Precision::F32) => [1.4, 4.1, 1900.0],
        (Method::Dlm, Precision::F64) => [4.0, 56.0, 4300.0],
        (Method::ExplicitEuler, Precision::F32) => [0.0, 0.0, 0.0],
        (Method::ExplicitEuler, Precision::F64) => [0.0, 0.0, 0.0],
        (Method::GyroNewton, Precision::F32) => [0.0, 0.0, 0.0],
        (Method::GyroNewton, Precision::F64) => [0.0, 0.0, 0.0],
        (Method::ClampedEuler, Precision::F32) => [2.0, 38.0, 1700.0],
        (Method::ClampedEuler, Precision::F64) => [2.0, 34.0, 2400.0],
        (Method::Spiral, Precision::F32) => [1.0, 5.0, 600.0],
        (Method::Spiral, Precision::F64) => [1.0, 6.5, 590.0],
        (method, _) => {
            panic!(
                "{method}: not measured; `cargo test --test mirror step_parity::largest -- --ignored --nocapture` prints the rows"
            )
        }
    }
}

/// The largest difference between GPU and twin after `steps` steps, or the first that is too large.
fn compare_engines(gpu: &Engine, batch: &AnyBatch, method: Method, steps: u64) -> Result<f64, Mismatch> {
    compare_within(gpu, batch, method, steps, bound(gpu, batch.precision(), method, steps))
}

fn compare_within(gpu: &Engine, batch: &AnyBatch, method: Method, steps: u64, bound: f64) -> Result<f64, Mismatch> {
    let twin = common::twin(gpu, batch.precision());
    let expected = common::advanced(&twin, batch, method, DT, steps);
    let found = common::advanced(gpu, batch, method, DT, steps);
    match batch.precision() {
        Precision::F32 => compare_states::<f32>(&expected, &found, bound),
        Precision::F64 => compare_states::<f64>(&expected, &found, bound),
    }
}

/// Every precision and method, with `steps` steps.
fn check_steps(steps: u64) {
    let gpu = common::gpu();
    for precision in Precision::ALL {
        for method in Method::ALL {
            let batch = common::asymmetric_batch(BODIES, 12, precision);
            match compare_engines(&gpu, &batch, method, steps) {
                Ok(largest) => println!("{precision} {method}, {steps} steps: {largest:.3} ulps"),
                Err(mismatch) => panic!("{precision} {method}, {steps} steps: {mismatch}"),
            }
        }
    }
}

#[test]
fn one_step_agrees_with_the_twin() {
    check_steps(STEPS[0]);
}

#[test]
fn many_steps_agree_with_the_twin() {
    check_steps(STEPS[1]);
    check_steps(STEPS[2]);
}

#[test]
#[ignore = "prints what `measured` says: cargo test --test mirror step_parity::largest -- --ignored --nocapture"]
fn the_largest_differences_over_many_seeds() {
    let gpu = common::gpu();
    for method in Method::ALL {
        for precision in Precision::ALL {
            let largest = STEPS.map(|steps| {
                let of_seed = |seed| {
                    let batch = common::asymmetric_batch(BODIES, seed, precision);
                    compare_within(&gpu, &batch, method, steps, f64::MAX)
                        .unwrap_or_else(|mismatch| panic!("{mismatch}"))
                };
                (0..SEEDS).map(of_seed).fold(0.0, f64::max)
            });
            println!("(Method::{method:?}, Precision::{precision:?}) => {largest:.3?},");
        }
    }
}

/// A GPU whose shader is wrong in one place.
fn faulty_gpu(file: &str, from: &str, to: &str) -> Engine {
    let mut options = common::any_adapter();
    options.patches = vec![Patch { file: file.into(), from: from.into(), to: to.into() }];
    common::gpu_with(options)
}

#[test]
fn a_planted_fault_in_the_shader_is_found_after_one_step() {
    let term = "fma(body.gyroscopic.value, pair_products(m), correction.gyroscopic_term)";
    for (fault, wrong) in [
        ("sign of the gyroscopic term", format!("-{term}")),
        ("gyroscopic term dropped", format!("0.0 * {term}")),
        ("one component off by 4e-6", format!("{term} * vector(1.0, 1.000004, 1.0)")),
    ] {
        let gpu = faulty_gpu("rigid_body.wgsl", term, &wrong);
        for precision in Precision::ALL {
            let batch = common::asymmetric_batch(BODIES, 11, precision);
            let compared = compare_engines(&gpu, &batch, Method::Rk4, 1);
            assert!(compared.is_err(), "{precision}: {fault} passed: {compared:?}");
        }
    }
}

#[test]
fn the_comparator_rejects_a_component_that_is_off_by_a_few_ulps() {
    let batch = common::asymmetric_batch(BODIES, 13, Precision::F32);
    let right = common::advanced(&Engine::cpu_scalar(), &batch, Method::Rk4, DT, 3);
    let perturbed = |change: fn(&mut StateWords)| {
        let mut wrong = right.clone();
        change(&mut wrong);
        compare_states::<f32>(&right, &wrong, 2.0).expect_err("a wrong state")
    };
    assert_eq!(compare_states::<f32>(&right, &right, 0.0), Ok(0.0));

    // Three ulps of numbers in [1/2, 1), of which a unit quaternion's largest component is one.
    let mismatch = perturbed(|wrong| wrong.value[101][2] += 3.0 * 2f64.powi(-24));
    assert_eq!((mismatch.body, mismatch.field, mismatch.component), (101, "orientation", 2));
    assert!((mismatch.ulps - 3.0).abs() < 0.1, "{mismatch}");

    let mismatch = perturbed(|wrong| wrong.value[5][4] = -wrong.value[5][4]);
    assert_eq!((mismatch.body, mismatch.field, mismatch.component), (5, "angular_momentum_principal", 0));

    let mismatch = perturbed(|wrong| wrong.residue[202][6] = f64::NAN);
    assert_eq!((mismatch.body, mismatch.component, mismatch.ulps), (202, 2, f64::INFINITY));

    let mismatch = perturbed(|wrong| wrong.value[0][3] = f64::INFINITY);
    assert_eq!((mismatch.body, mismatch.component), (0, 3));
}

#[test]
fn a_bit_in_a_second_word_is_a_difference() {
    let batch = common::asymmetric_batch(BODIES, 13, Precision::F32);
    let right = common::advanced(&Engine::cpu_scalar(), &batch, Method::Dlm, DT, 3);
    assert_eq!(first_bit_difference(&right, &right), None);
    let mut wrong = right.clone();
    wrong.residue[77][1] = f64::from_bits(wrong.residue[77][1].to_bits() ^ 1);
    let difference = first_bit_difference(&right, &wrong).expect("a difference");
    assert!(difference.starts_with("body 77, residue of component 1"), "{difference}");
}
