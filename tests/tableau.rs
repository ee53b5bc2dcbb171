//! The order conditions of `rk8`'s tableau, all of them, and of its embedded formulas.

use polhode::method::rk8::{ERROR_WEIGHTS_5, STAGE_WEIGHTS, STAGES, TIMES, WEIGHTS, WEIGHTS_3};

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
