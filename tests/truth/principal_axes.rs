//! Principal moments and axes against tensors whose moments and axes are known exactly.

use crate::strategies;

use glam::{DMat3, DQuat, DVec3};
use polhode::bodies::inertia::{InertiaTensor, principal_axes};
use proptest::prelude::*;
use strategies::{orientation, tensor};

/// Error of moments relative to the largest: about ten rotations, each rounding by half an ulp.
const MOMENT_ERROR: f64 = 8.0 * f64::EPSILON;

/// Error of an axis, rad, that rounding of the rotations alone makes.
const AXIS_ERROR: f64 = 8.0 * f64::EPSILON;

/// Four small integers whose squares add up to a square: their quaternion's rotation matrix is rational.
const RATIONAL: [[i64; 4]; 6] = [[1, 2, 2, 4], [1, 1, 1, 1], [2, 4, 5, 6], [1, 3, 5, 1], [-4, 2, 1, 2], [0, 3, 0, 4]];

/// n² times the rotation matrix of a quaternion (x, y, z, w) of norm n, in integers.
fn rational_rotation([x, y, z, w]: [i64; 4]) -> [[i64; 3]; 3] {
    [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w + y * y - z * z - x * x, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w + z * z - x * x - y * y],
    ]
}

/// n⁴ R diag(moments) Rᵀ, exact, and the exact moments n⁴ times those given.
fn exact_tensor(quaternion: [i64; 4], moments: [i64; 3]) -> (InertiaTensor, DVec3) {
    let r = rational_rotation(quaternion);
    let norm = quaternion.iter().map(|c| c * c).sum::<i64>();
    let element = |i: usize, j: usize| {
        let sum: i64 = (0..3).map(|k| r[i][k] * moments[k] * r[j][k]).sum();
        assert!(sum.abs() < 1 << 53, "{sum} is not exact in f64");
        sum as f64
    };
    let tensor = InertiaTensor::from_array([
        element(0, 0),
        element(1, 1),
        element(2, 2),
        element(0, 1),
        element(0, 2),
        element(1, 2),
    ]);
    let mut sorted = moments.map(|moment| (moment * norm * norm) as f64);
    sorted.sort_by(f64::total_cmp);
    (tensor, DVec3::from_array(sorted))
}

/// Moments from well apart to equal, and of a thin rod.
const MOMENTS: [[i64; 3]; 9] = [
    [1, 2, 3],
    [3, 1, 2],
    [1 << 30, (1 << 30) + 1, 1 << 31],
    [1 << 30, (1 << 30) + 1, (1 << 30) + 2],
    [1 << 30, (1 << 30) + 1, (1 << 30) + 1],
    [7, 7, 9],
    [9, 5, 9],
    [5, 5, 5],
    [1, 1 << 30, (1 << 30) + 1],
];

#[test]
fn moments_of_exact_tensors_are_right_to_rounding() {
    for quaternion in RATIONAL {
        for moments in MOMENTS {
            let (tensor, exact) = exact_tensor(quaternion, moments);
            let found = principal_axes(&tensor).moments;
            let error = (found - exact).abs().max_element() / exact.z;
            assert!(error <= MOMENT_ERROR, "{quaternion:?} {moments:?}: {found} instead of {exact}, {error:e}");
        }
    }
}

#[test]
fn axes_of_nearly_spherical_tensors_are_right_to_rounding() {
    // A deviation of 1e-9 from a multiple of 1: the axes have all digits, as the deviation is exact in the tensor.
    for quaternion in RATIONAL {
        let (tensor, _) = exact_tensor(quaternion, [1 << 30, (1 << 30) + 1, (1 << 30) + 2]);
        let norm = quaternion.iter().map(|c| c * c).sum::<i64>() as f64;
        let [x, y, z] = rational_rotation(quaternion).map(|row| row.map(|element| element as f64 / norm));
        let columns = DMat3::from_rows(x.into(), y.into(), z.into());
        let axes = principal_axes(&tensor);
        for k in 0..3 {
            let exact = columns.col(k);
            let found = axes.axis_body(k);
            let error = found.cross(exact).length();
            assert!(error <= AXIS_ERROR, "{quaternion:?}, axis {k}: {found} instead of {exact}, {error:e}");
        }
    }
}

#[test]
fn diagonal_tensors_are_only_permuted() {
    let orders = [[1.0, 2.0, 2.5], [1.0, 2.5, 2.0], [2.0, 1.0, 2.5], [2.0, 2.5, 1.0], [2.5, 1.0, 2.0], [2.5, 2.0, 1.0]];
    for scale in [1.0, 1e-46, 1e38, 0.1] {
        for order in orders {
            let diagonal = DVec3::from_array(order) * scale;
            let tensor = InertiaTensor::from_principal_moments(diagonal);
            let axes = principal_axes(&tensor);
            let mut sorted = diagonal.to_array();
            sorted.sort_by(f64::total_cmp);
            assert_eq!(axes.moments.to_array(), sorted);
            for component in axes.principal_to_body.to_array().map(f64::abs) {
                let allowed = [0.0, 0.5, std::f64::consts::FRAC_1_SQRT_2, 1.0];
                assert!(allowed.contains(&component), "{order:?}: {:?}", axes.principal_to_body);
            }
            for k in 0..3 {
                let axis = axes.axis_body(k);
                assert!((diagonal * axis).distance(axis * sorted[k]) <= f64::EPSILON * sorted[2], "{order:?}");
            }
        }
    }
    let identity = principal_axes(&InertiaTensor::from_principal_moments(DVec3::new(1.0, 1.0, 1.0)));
    assert_eq!(identity.principal_to_body, DQuat::IDENTITY);
}

#[test]
fn moments_of_molecules_and_planets_keep_their_digits() {
    let (tensor, _) = exact_tensor([1, 2, 2, 4], [5, 6, 9]);
    for scale in [2.0_f64.powi(-300), 2.0_f64.powi(-170), 2.0_f64.powi(126), 2.0_f64.powi(300)] {
        let found = principal_axes(&(tensor * scale)).moments / scale;
        assert_eq!(found, principal_axes(&tensor).moments, "scaling by a power of two changes nothing else");
    }
}

#[test]
fn a_tiny_moment_keeps_relative_accuracy_where_the_tensor_determines_it() {
    // Graded: a rod along x whose axes are slightly askew. By hand: 1 − 1e-12 × 1e-12/(1e6 − 1) at most.
    let tensor = InertiaTensor { xx: 1e-6, yy: 1.0, zz: 1.0, xy: 1e-12, xz: -2e-12, yz: 0.0 };
    let found = principal_axes(&tensor).moments.x;
    let exact = 1e-6 - 5e-24 / (1.0 - 1e-6);
    assert!((found / exact - 1.0).abs() < 4.0 * f64::EPSILON, "{found:e}");
}

#[test]
fn values_that_are_not_numbers_end_the_iteration() {
    for bad in [f64::NAN, f64::INFINITY] {
        let tensor = InertiaTensor { xx: 1.0, yy: 2.0, zz: 3.0, xy: bad, xz: 0.1, yz: 0.1 };
        assert!(!principal_axes(&tensor).moments.is_finite());
    }
}

/// Powers of two near 1e-30 and 1e30, and what an element may still have below and above.
const POWERS_OF_TWO: [i32; 6] = [-300, -100, -33, 33, 100, 300];
/// Powers of ten, which round every element.
const POWERS_OF_TEN: [i32; 8] = [-30, -27, -10, -3, 3, 10, 27, 30];

proptest! {
    #[test]
    fn a_power_of_two_scales_the_moments_exactly_and_leaves_the_axes(tensor in tensor()) {
        let axes = principal_axes(&tensor);
        for power in POWERS_OF_TWO {
            let scale = 2.0_f64.powi(power);
            let found = principal_axes(&(tensor * scale));
            prop_assert_eq!(found.moments, axes.moments * scale, "2^{}", power);
            prop_assert_eq!(found.principal_to_body, axes.principal_to_body, "2^{}", power);
        }
    }

    #[test]
    fn any_scale_leaves_the_axes_to_the_rounding_of_the_elements(tensor in tensor()) {
        let axes = principal_axes(&tensor);
        let (low, high) = (axes.moments.y - axes.moments.x, axes.moments.z - axes.moments.y);
        for power in POWERS_OF_TEN {
            let scale = 10.0_f64.powi(power);
            let found = principal_axes(&(tensor * scale));
            // The nine elements are off by half an ulp each, in the Frobenius norm by as much of that of the tensor, √3 I₃ at most.
            let elements = 0.5 * f64::EPSILON * 3.0_f64.sqrt();
            let error = (found.moments / scale - axes.moments).abs().max_element() / axes.moments.z;
            prop_assert!(error <= 2.0 * MOMENT_ERROR + elements, "1e{}: moments off by {:e}", power, error);
            for (k, gap) in [low, low.min(high), high].into_iter().enumerate() {
                // C. Davis and W. M. Kahan, SIAM J. Numer. Anal. 7 (1970) 1: sin θ ≤ ‖E‖/gap, here to the gap before the change.
                let bound = 2.0 * AXIS_ERROR + 2.0 * elements * axes.moments.z / gap;
                let error = found.axis_body(k).cross(axes.axis_body(k)).length();
                prop_assert!(error <= bound || bound > 0.5, "1e{}: axis {} off by {:e} of {:e}", power, k, error, bound);
            }
        }
    }

    #[test]
    fn a_round_trip_restores_the_tensor(tensor in tensor()) {
        let axes = principal_axes(&tensor);
        prop_assert!(axes.moments.x <= axes.moments.y && axes.moments.y <= axes.moments.z);
        prop_assert!((axes.principal_to_body.length() - 1.0).abs() <= 2.0 * f64::EPSILON);
        let error = (axes.tensor() - tensor).norm() / tensor.norm();
        prop_assert!(error <= 8.0 * f64::EPSILON, "{error:e}");
    }

    #[test]
    fn the_frame_is_right_handed_and_the_nearest_of_its_four(tensor in tensor()) {
        let axes = principal_axes(&tensor);
        let frame = DMat3::from_quat(axes.principal_to_body);
        prop_assert!((frame.determinant() - 1.0).abs() < 1e-14);
        let q = axes.principal_to_body.to_array();
        prop_assert!(q[..3].iter().all(|c| c.abs() <= q[3]), "{q:?}");
    }

    #[test]
    fn the_same_elements_give_the_same_bits(tensor in tensor()) {
        prop_assert_eq!(principal_axes(&tensor), principal_axes(&tensor));
    }

    #[test]
    fn nearly_equal_moments_are_told_apart_to_the_deviations_accuracy(
        q in orientation(), exponent in -13.0..-1.0_f64, ratio in 0.05..0.95_f64,
    ) {
        // 1 + a deviation of any size: I = 1 + ε R diag(−1, 2r − 1, 1) Rᵀ, with ε above the rounding of its elements.
        let size = 10.0_f64.powf(exponent);
        let moments = DVec3::new(-1.0, 2.0 * ratio - 1.0, 1.0) * size;
        let deviation = InertiaTensor::from_principal_moments(moments).rotated(q);
        let rounded = InertiaTensor::from_principal_moments(DVec3::ONE) + deviation;
        // What is left of the deviation after rounding is known exactly, and has the same axes.
        let left = rounded - InertiaTensor::from_principal_moments(DVec3::ONE);
        let (axes, of_deviation) = (principal_axes(&rounded), principal_axes(&left));
        let apart = axes.principal_to_body.conjugate() * of_deviation.principal_to_body;
        // The gap is at least a twentieth of the deviation, which may magnify rounding by twenty.
        prop_assert!(apart.xyz().length() < 20.0 * AXIS_ERROR, "{:e}", apart.xyz().length());
    }
}
