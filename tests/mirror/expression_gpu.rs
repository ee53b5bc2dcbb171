//! Random formulas and the torques' own on the GPU, against the scalar twins on the CPU.

use crate::common;
use crate::common::tree;

use common::kernel::{Harness, chunks};
use common::measured::{SEEDS, over_seeds, stays_within_measured};
use common::random;
use polhode::engine::gpu::shader::Chunk;
use polhode::expression::wgsl::{self, Argument, Signature, WgslError};
use polhode::expression::{Input, InputKind, Shape};
use polhode::kernel::method::Method;
use polhode::math::Precision;
use polhode::math::real::Scalar;
use random::Random;
use tree::{INPUTS, Tree, inputs};

/// Formulas in one shader: each is a function, and an output of the kernel.
const TOGETHER: usize = 20;
/// Rows of inputs; not a multiple of the workgroup's size.
const ROWS: usize = 67;
/// A shader may take a division and a square root to 2.5 units in the last place instead of half a unit, a fused product
/// or not; ours of sine and cosine are made of such operations.
const LOOSER: f64 = 6.0;

/// Shaders of a precision: `POLHODE_EXPRESSIONS=100000 cargo test --release --test mirror expression_gpu` for so many formulas in both.
fn shaders() -> u64 {
    let formulas = std::env::var("POLHODE_EXPRESSIONS").ok().and_then(|count| count.parse().ok());
    formulas.map_or(5, |formulas: u64| formulas.div_ceil(2 * TOGETHER as u64))
}

/// Formulas whose texts exist, and the texts, f0 and following.
fn formulas(seed: u64) -> (Vec<Tree>, String) {
    let mut random = Random::new(seed);
    let (mut trees, mut texts) = (vec![], String::new());
    while trees.len() < TOGETHER {
        let size = 1 + (random.bits() % 40) as usize;
        let tree = Tree::random(&mut random, size);
        let Ok(formula) = tree.recorded() else { continue };
        let parameters = (0..INPUTS as u16)
            .map(|index| Argument::new(format!("p{index}"), Shape::Number, [Input::new(InputKind::Parameter, index)]))
            .collect();
        let signature = Signature { name: format!("f{}", trees.len()), comment: vec![], parameters };
        match wgsl::function(formula.graph(), formula.outputs(), &signature) {
            Ok(text) => texts += &text,
            Err(WgslError::ConstantOutOfRange(_)) => continue,
            Err(error) => panic!("{error}: {tree:?}"),
        }
        trees.push(tree);
    }
    (trees, texts)
}

/// Numbers of a shader that have a bound, at the least.
const LEAST_COMPARED: usize = TOGETHER * ROWS / 4;
/// The largest parts of these bounds over 100 shaders on lavapipe, which rounds products and sums apart as the twin does, in `f32` and in `f64`.
const MEASURED: [f64; 2] = [0.139, 0.120];

/// The largest part of its bound that a formula of a shader came to.
fn compared<T: Scalar>(harness: &Harness, precision: Precision, seed: u64) -> f64 {
    let (mut largest, mut compared) = (0.0_f64, 0);
    let (trees, texts) = formulas(seed);
    let mut chunks = chunks(precision, Method::Rk4);
    chunks.push(Chunk { file: "recorded", text: texts.clone().into() });
    let parameters: Vec<String> = (0..INPUTS).map(|column| format!("r({column}u)")).collect();
    let line: String = (0..TOGETHER).map(|f| format!("put_r({f}u, f{f}({}));\n", parameters.join(", "))).collect();
    let mut random = Random::new(seed ^ 0x5555);
    let rows: Vec<[f64; INPUTS]> = (0..ROWS).map(|_| inputs(&mut random)).collect();
    let columns: Vec<Vec<T>> = rows.iter().map(|row| row.iter().map(|x| T::from_f64(*x)).collect()).collect();
    let found = harness.run(&chunks, &line, &columns, TOGETHER);
    for (row, found) in rows.iter().zip(found) {
        for (tree, found) in trees.iter().zip(found) {
            // The bound is asked for with looser operations, so that decisions near their edge are left out as well.
            let Some((value, error)) = tree.bounded(row, LOOSER * T::UNIT_ROUNDOFF) else { continue };
            let (difference, bound) = ((found - value).abs(), LOOSER * error * T::UNIT_ROUNDOFF);
            assert!(difference <= bound, "{found:e} {value:e} {bound:e} {tree:?} at {row:?}\n{texts}");
            compared += 1;
            largest = largest.max(if bound > 0.0 { difference / bound } else { 0.0 });
        }
    }
    assert!(compared >= LEAST_COMPARED, "seed {seed}: {compared} numbers");
    largest
}

fn agree<T: Scalar>(precision: Precision, first: u64, measured: f64) {
    let (gpu, harness) = (common::gpu(), Harness::new());
    for seed in first..first + shaders() {
        let largest = compared::<T>(&harness, precision, seed);
        // More formulas than were measured may come to more.
        let measured = if shaders() > SEEDS { f64::INFINITY } else { measured };
        stays_within_measured(&gpu, precision, &format!("formulas of seed {seed}"), largest, measured);
    }
}

/// Where the seeds of formulas in `f64` begin.
const FIRST_F64: u64 = 1 << 32;

#[test]
fn random_formulas_agree_in_f32() {
    agree::<f32>(Precision::F32, 0, MEASURED[0]);
}

#[test]
fn random_formulas_agree_in_f64() {
    agree::<f64>(Precision::F64, FIRST_F64, MEASURED[1]);
}

#[test]
#[ignore = "prints what `MEASURED` holds: cargo test --test mirror expression_gpu::largest -- --ignored --nocapture"]
fn largest_parts_over_many_seeds() {
    let harness = Harness::new();
    println!("f32: {:.3}", over_seeds(|seed| compared::<f32>(&harness, Precision::F32, seed)));
    println!("f64: {:.3}", over_seeds(|seed| compared::<f64>(&harness, Precision::F64, FIRST_F64 + seed)));
}
