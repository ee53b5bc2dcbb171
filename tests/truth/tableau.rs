//! The order conditions of `rk8`'s tableau, all of them, and of its embedded formulas; the coefficients of shaders.

use polhode::engine::gpu::shader::Source;
use polhode::kernel::method::Method;
use polhode::kernel::method::rk8::{ERROR_WEIGHTS_5, STAGE_WEIGHTS, STAGES, TIMES, WEIGHTS, WEIGHTS_3};
use polhode::kernel::method::splitting::{Composition, composition};
use polhode::kernel::torque_kernel::VelocityDependence;
use polhode::math::Precision;

/// A rooted tree as the multiset of its branches.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Tree(Vec<Tree>);

impl Tree {
    /// Number of nodes.
    fn order(&self) -> usize {
        1 + self.0.iter().map(Tree::order).sum::<usize>()
    }

    /// γ: the product of the orders of all subtrees.
    fn density(&self) -> f64 {
        self.order() as f64 * self.0.iter().map(Tree::density).product::<f64>()
    }

    /// The derivative weights of the stages, Φ before the last sum, and the same of absolute values.
    fn stage_values(&self) -> ([f64; STAGES], [f64; STAGES]) {
        let (mut values, mut sizes) = ([1.0; STAGES], [1.0; STAGES]);
        for branch in &self.0 {
            let (inner, inner_size) = branch.stage_values();
            for stage in 0..STAGES {
                let row = |j: usize| if stage == 0 || j >= STAGES - 1 { 0.0 } else { STAGE_WEIGHTS[stage - 1][j] };
                values[stage] *= (0..STAGES).map(|j| row(j) * inner[j]).sum::<f64>();
                sizes[stage] *= (0..STAGES).map(|j| row(j).abs() * inner_size[j]).sum::<f64>();
            }
        }
        (values, sizes)
    }
}

/// All rooted trees of an order.
fn trees(order: usize) -> Vec<Tree> {
    /// All multisets of trees with `nodes` nodes in all, none above `largest` in (order, index).
    fn forests(nodes: usize, by_order: &[Vec<Tree>], largest: (usize, usize)) -> Vec<Vec<Tree>> {
        if nodes == 0 {
            return vec![Vec::new()];
        }
        let mut all = Vec::new();
        for order in 1..=nodes.min(largest.0) {
            for (index, tree) in by_order[order].iter().enumerate() {
                if (order, index) > largest {
                    continue;
                }
                for mut rest in forests(nodes - order, by_order, (order, index)) {
                    rest.push(tree.clone());
                    all.push(rest);
                }
            }
        }
        all
    }
    let mut by_order: Vec<Vec<Tree>> = vec![Vec::new()];
    for nodes in 1..=order {
        let found = forests(nodes - 1, &by_order, (nodes, usize::MAX)).into_iter().map(Tree).collect();
        by_order.push(found);
    }
    by_order.swap_remove(order)
}

/// The largest defect of the conditions of an order, in roundings of the sums' terms.
fn defect(weights: &[f64; STAGES], order: usize) -> f64 {
    let mut largest = 0.0_f64;
    for tree in trees(order) {
        let (values, sizes) = tree.stage_values();
        let sum: f64 = weights.iter().zip(values).map(|(b, value)| b * value).sum();
        let size: f64 = weights.iter().zip(sizes).map(|(b, size)| (b * size).abs()).sum();
        largest = largest.max((sum - 1.0 / tree.density()).abs() / (size * f64::EPSILON));
    }
    largest
}

/// Roundings of a coefficient and of the sums that it passes through, up to seven of them.
const ROUNDINGS: f64 = 16.0;

#[test]
fn there_are_as_many_trees_as_cayley_counted() {
    let counts: Vec<usize> = (1..=8).map(|order| trees(order).len()).collect();
    assert_eq!(counts, [1, 1, 2, 4, 9, 20, 48, 115]);
}

#[test]
fn the_weights_meet_all_200_conditions_up_to_order_8_and_not_those_of_order_9() {
    for order in 1..=8 {
        let defect = defect(&WEIGHTS, order);
        assert!(defect <= ROUNDINGS, "order {order}: {defect:.1} roundings");
    }
    assert!(defect(&WEIGHTS, 9) > 1e6, "order 9: {:.1} roundings", defect(&WEIGHTS, 9));
}

#[test]
fn the_embedded_weights_are_of_order_5_and_3() {
    let fifth: [f64; STAGES] = std::array::from_fn(|i| WEIGHTS[i] - ERROR_WEIGHTS_5[i]);
    let mut third = [0.0; STAGES];
    (third[0], third[8], third[11]) = (WEIGHTS_3[0], WEIGHTS_3[1], WEIGHTS_3[2]);
    for (weights, claim) in [(fifth, 5), (third, 3)] {
        for order in 1..=claim {
            let defect = defect(&weights, order);
            assert!(defect <= ROUNDINGS, "order {order} of the embedded {claim}: {defect:.1} roundings");
        }
        assert!(defect(&weights, claim + 1) > 1e6, "the embedded {claim} is of a higher order");
    }
}

#[test]
fn stages_stand_at_the_sums_of_their_weights() {
    for (stage, time) in TIMES.iter().enumerate().skip(1) {
        let row = &STAGE_WEIGHTS[stage - 1];
        let (sum, size): (f64, f64) = (row.iter().sum(), row.iter().map(|a| a.abs()).sum());
        assert!((sum - time).abs() <= 4.0 * f64::EPSILON * size, "stage {stage}: {sum} for {time}");
    }
}

/// The numbers of a text that are written with ten digits or more.
fn long_numbers(text: &str) -> Vec<f64> {
    let is_part = |c: char| c.is_ascii_digit() || c == '.' || c == 'e' || c == '-';
    let words = text.split(|c: char| !is_part(c)).map(|word| word.trim_start_matches('-'));
    let long =
        words.filter(|word| word.split('e').next().unwrap_or("").bytes().filter(u8::is_ascii_digit).count() >= 10);
    long.filter_map(|word| word.parse().ok()).collect()
}

/// A digit far behind the point moves a step by less than roundings do, so texts are compared: each coefficient of a shader is one of its
/// twin's, to the last bit where both are printed.
#[test]
fn the_coefficients_of_the_shaders_are_those_of_their_twins() {
    let ends = |kinds: [Composition; 2]| -> Vec<f64> {
        kinds.iter().flat_map(|of| of.kick_ends.iter().chain(of.drift_ends).copied()).collect()
    };
    let both = [VelocityDependence::None, VelocityDependence::General];
    let twin = |file: &str| -> Vec<f64> {
        match file {
            "method/rk8.wgsl" | "method/rk8_adaptive.wgsl" => {
                long_numbers(include_str!("../../src/kernel/method/rk8.rs"))
            }
            "method/splitting4.wgsl" => ends(both.map(composition::<4>)),
            "method/splitting6.wgsl" => ends(both.map(composition::<6>)),
            _ => Vec::new(),
        }
    };
    let mut compared = Vec::new();
    let sources = [Method::Rk8, Method::Splitting4, Method::Splitting6];
    let chunks = sources.iter().flat_map(|method| Source::advance(Precision::F64, *method).chunks().to_vec());
    for chunk in chunks.chain(Source::adaptive_method()) {
        let own = twin(chunk.file);
        if own.is_empty() {
            continue;
        }
        let numbers = long_numbers(&chunk.text);
        for number in &numbers {
            // The ends of kicks and drifts are sums, printed to 16 digits.
            let slack = if chunk.file.contains("splitting") { 1e-15 } else { 0.0 };
            let is_there = own.iter().any(|own| (own.abs() - number).abs() <= slack);
            assert!(is_there, "{}: {number:?} is no coefficient of its twin's", chunk.file);
        }
        compared.push((chunk.file, numbers.len()));
    }
    println!("{compared:?}");
    let of = |file: &str| compared.iter().filter(|(name, _)| *name == file).map(|(_, count)| *count).max().unwrap_or(0);
    assert!(of("method/rk8.wgsl") >= 40 && of("method/rk8_adaptive.wgsl") >= 8, "{compared:?}");
    assert!(of("method/splitting4.wgsl") >= 20 && of("method/splitting6.wgsl") >= 30, "{compared:?}");
}
