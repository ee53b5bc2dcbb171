//! The toolkit's conversions and formulas where they are delicate: near no rotation, half a turn, and gimbal lock.

use crate::strategies;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DMat3, DQuat, DVec3};
use polhode::bodies::inertia::InertiaTensor;
use polhode::bodies::toolkit::*;
use proptest::prelude::*;
use strategies::{orientation, vector, vector_of_any_size};

/// A handful of operations on numbers up to π.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Matrices have nine elements, each a sum of four rounded products.
const MATRIX_ROUNDING: f64 = 32.0 * f64::EPSILON;

fn largest_element(matrix: DMat3) -> f64 {
    matrix.to_cols_array().into_iter().fold(0.0, |m: f64, e| m.max(e.abs()))
}

/// The same attitude: equal or opposite quaternions.
fn apart(a: DQuat, b: DQuat) -> f64 {
    (a - b).length().min((a + b).length())
}

/// The exponential of a matrix by its power series after thirty halvings of the argument: true to 1e-13 or so by
/// construction, whatever the formulas of the toolkit.
fn series_exponential(matrix: DMat3) -> DMat3 {
    let small = matrix * 2.0_f64.powi(-10);
    let mut sum = DMat3::IDENTITY;
    for n in (1..12).rev() {
        sum = DMat3::IDENTITY + small * sum * (1.0 / n as f64);
    }
    (0..10).fold(sum, |power, _| power * power)
}

/// ∫₀¹ exp(s [v]×) ds, which the left Jacobian is, by the power series Σ [v]×ⁿ/(n + 1)!.
fn series_jacobian(v: DVec3) -> DMat3 {
    let cross = cross_product_matrix(v);
    (1..60).rev().fold(DMat3::ZERO, |sum, n| DMat3::IDENTITY + cross * sum * (1.0 / (n as f64 + 1.0)))
}

proptest! {
    #[test]
    fn the_exponential_is_that_of_the_cross_product_matrix(v in vector(PI)) {
        let expected = series_exponential(cross_product_matrix(v));
        let error = largest_element(DMat3::from_quat(exponential(v)) - expected);
        prop_assert!(error < 1e-12, "{error:e}");
        let error = largest_element(exponential_matrix(v) - DMat3::from_quat(exponential(v)));
        prop_assert!(error < MATRIX_ROUNDING, "{error:e}");
    }

    #[test]
    fn logarithm_and_exponential_are_inverses_at_all_sizes(v in vector_of_any_size(1.7)) {
        let back = logarithm(exponential(v));
        prop_assert!((back - v).length() <= ROUNDING * v.length(), "{v} came back as {back}");
        prop_assert_eq!(logarithm(-exponential(v)), back);
        let from_matrix = logarithm_matrix(exponential_matrix(v));
        prop_assert!((from_matrix - v).length() <= 4.0 * MATRIX_ROUNDING, "{v} came back as {from_matrix}");
    }

    #[test]
    fn the_logarithm_is_accurate_next_to_half_a_turn(axis in vector(1.0), exponent in -14.0..-1.0_f64) {
        prop_assume!(axis.length() > 0.1);
        let short = 10.0_f64.powf(exponent);
        let v = axis.normalize() * (PI - short);
        let back = logarithm(exponential(v));
        prop_assert!((back - v).length() <= ROUNDING * PI, "{v} came back as {back}");
        // Beyond half a turn the shorter way round is given.
        let beyond = logarithm(exponential(axis.normalize() * (PI + short)));
        prop_assert!((beyond + axis.normalize() * (PI - short)).length() <= 2.0 * ROUNDING * PI);
    }

    #[test]
    fn jacobians_are_the_integral_of_the_exponential(v in vector_of_any_size(3.0)) {
        let error = largest_element(left_jacobian(v) - series_jacobian(v));
        prop_assert!(error < 1e-14, "{error:e}");
        prop_assert!(largest_element(right_jacobian(v) - left_jacobian(v).transpose()) < ROUNDING);
        prop_assert!(largest_element(left_jacobian(v) - exponential_matrix(v) * right_jacobian(v)) < MATRIX_ROUNDING);
    }

    #[test]
    fn inverse_jacobians_invert(v in vector(3.0)) {
        for (jacobian, inverse) in [
            (left_jacobian(v), left_jacobian_inverse(v)),
            (right_jacobian(v), right_jacobian_inverse(v)),
        ] {
            // Near a full turn the inverse grows like 1/(2π − θ), and its rounding with it.
            let error = largest_element(jacobian * inverse - DMat3::IDENTITY) * (TAU - v.length());
            prop_assert!(error < 1e-13, "{error:e}");
        }
    }

    #[test]
    fn jacobians_are_derivatives_of_the_exponential(v in vector(1.5), step in vector(1.0)) {
        let h = 1e-5;
        let derivative = |left: bool| {
            let (ahead, behind) = (exponential(v + step * h), exponential(v - step * h));
            let turned = if left { ahead * behind.conjugate() } else { behind.conjugate() * ahead };
            logarithm(turned) / (2.0 * h)
        };
        // Truncation of order h² = 1e-10, rounding of order 1e-11.
        prop_assert!((derivative(true) - left_jacobian(v) * step).length() < 2e-9);
        prop_assert!((derivative(false) - right_jacobian(v) * step).length() < 2e-9);
        prop_assert!((left_jacobian_inverse(v) * derivative(true) - step).length() < 1e-8);
    }

    #[test]
    fn axis_and_angle_restore_the_attitude(q in orientation()) {
        let turn = AxisAngle::from(q);
        prop_assert!((0.0..=PI).contains(&turn.angle) && (turn.axis.length() - 1.0).abs() < ROUNDING);
        prop_assert!(apart(turn.into(), q) < ROUNDING);
    }

    #[test]
    fn matrices_restore_the_attitude(q in orientation()) {
        let back = orientation_of_matrix(matrix_of_orientation(q));
        prop_assert!(back.w >= 0.0);
        prop_assert!(apart(back, q) < MATRIX_ROUNDING, "{:e}", apart(back, q));
    }

    #[test]
    fn modified_rodrigues_parameters_and_their_shadow_are_one_attitude(q in orientation()) {
        let sigma = ModifiedRodrigues::from(q);
        prop_assert!(sigma.vector.length() <= 1.0);
        prop_assert!(apart(sigma.into(), q) < ROUNDING);
        // tan(θ/4).
        prop_assert!((sigma.vector.length() - (0.25 * logarithm(q).length()).tan()).abs() < ROUNDING);
        prop_assume!(sigma.vector.length() > 1e-3);
        let shadow = sigma.shadow();
        prop_assert!(shadow.vector.length() >= 1.0);
        prop_assert!(apart(shadow.into(), q) < ROUNDING);
        prop_assert!((shadow.shorter().vector - sigma.vector).length() < ROUNDING);
    }

    #[test]
    fn modified_rodrigues_parameters_change_at_their_rate(v in vector(1.7), omega in vector(2.0)) {
        // Turned by less than π, so that a small step does not lead to the shadow set.
        let q = exponential(v);
        let sigma = ModifiedRodrigues::from(q);
        let h = 1e-5;
        let at = |t: f64| ModifiedRodrigues::from(rotated_body(q, omega, t)).vector;
        let difference = (at(h) - at(-h)) / (2.0 * h);
        prop_assert!((difference - sigma.rate(omega)).length() < 1e-8);
    }

    #[test]
    fn all_euler_sequences_restore_the_attitude(q in orientation()) {
        let sequences: Vec<_> = EulerSequence::all().collect();
        prop_assert_eq!(sequences.len(), 24);
        for sequence in sequences {
            let found = sequence.angles(q);
            let [a, b, c] = found.angles;
            let returns = sequence.axes()[0] == sequence.axes()[2];
            let range = if returns { 0.0..=PI } else { -FRAC_PI_2..=FRAC_PI_2 };
            prop_assert!(range.contains(&b), "{sequence:?}: {b}");
            prop_assert!([a, c].iter().all(|x| *x > -PI && *x <= PI), "{sequence:?}: {a}, {c}");
            let error = apart(sequence.orientation(found.angles), q);
            prop_assert!(error < ROUNDING, "{sequence:?}: {error:e}");
        }
    }

    #[test]
    fn gimbal_lock_is_reported_and_still_the_same_attitude(
        first in -3.1..3.1_f64, last in -3.1..3.1_f64, high in any::<bool>(),
    ) {
        for sequence in EulerSequence::all() {
            let returns = sequence.axes()[0] == sequence.axes()[2];
            let middle = match (returns, high) {
                (true, true) => PI,
                (true, false) => 0.0,
                (false, true) => FRAC_PI_2,
                (false, false) => -FRAC_PI_2,
            };
            let q = sequence.orientation([first, middle, last]);
            let found = sequence.angles(q);
            prop_assert!(found.is_gimbal_locked, "{sequence:?}");
            prop_assert_eq!(found.angles[2], 0.0, "{:?}", sequence);
            let error = apart(sequence.orientation(found.angles), q);
            // The middle angle is only known to the square root of nothing worse than rounding there.
            prop_assert!(error < 4.0 * ROUNDING, "{sequence:?}: {error:e}");
        }
    }

    #[test]
    fn world_sequences_are_body_sequences_reversed(angles in [-3.0..3.0_f64, -1.5..1.5, -3.0..3.0]) {
        for sequence in EulerSequence::all().filter(|s| s.about() == TurnedAxes::World) {
            let [a, b, c] = sequence.axes();
            let reversed = EulerSequence::new([c, b, a], TurnedAxes::Body).expect("neighbours still differ");
            let [x, y, z] = angles;
            prop_assert!(apart(sequence.orientation([x, y, z]), reversed.orientation([z, y, x])) < ROUNDING);
        }
    }

    #[test]
    fn a_polhode_circles_the_axis_that_keeps_its_sign(
        gaps in [0.02..0.5_f64, 0.02..0.5], direction in vector(1.0).prop_filter("a direction", |v| v.length() > 0.1),
    ) {
        let moments = DVec3::new(1.0, 1.0 + gaps[0], 1.0 + gaps[0] + gaps[1]);
        let omega = direction.normalize();
        let found = polhode(moments, omega, 1e-9);
        // Nearer to the separatrix the plain integration below cannot tell the sides apart.
        prop_assume!(found.discriminant.abs() > 1e-4);
        let inertia = InertiaTensor::from_principal_moments(moments);
        let around = match found.class {
            PolhodeClass::AroundSmallest => 0,
            PolhodeClass::AroundLargest => 2,
            other => return Err(TestCaseError::fail(format!("{other:?}"))),
        };
        let sign = omega[around].signum();
        prop_assert!(sign * omega[around] > 0.0);
        let (mut rates, dt) = (omega, 0.02);
        for _ in 0..2000 {
            let slope = |w: DVec3| angular_acceleration_body(&inertia, w, DVec3::ZERO);
            let a = slope(rates);
            let b = slope(rates + a * (0.5 * dt));
            let c = slope(rates + b * (0.5 * dt));
            let d = slope(rates + c * dt);
            rates += (a + b * 2.0 + c * 2.0 + d) * (dt / 6.0);
            prop_assert!(sign * rates[around] > 0.0, "{found:?}: {rates}");
        }
    }
}

#[test]
fn exponential_and_logarithm_take_the_smallest_and_largest_vectors() {
    for size in [0.0, f64::MIN_POSITIVE, 1e-200, 1e-160, 1e-9, 1e-8] {
        let v = DVec3::new(1.0, -2.0, 0.5) * size;
        assert!((logarithm(exponential(v)) - v).length() <= ROUNDING * v.length(), "{size:e}");
        assert!((exponential(v).length() - 1.0).abs() <= f64::EPSILON);
        assert!(left_jacobian(v).is_finite() && left_jacobian_inverse(v).is_finite(), "{size:e}");
    }
    let half_turn = DQuat::from_xyzw(0.6, 0.0, -0.8, 0.0);
    assert!((logarithm(half_turn) - DVec3::new(0.6, 0.0, -0.8) * PI).length() < ROUNDING);
    assert_eq!(logarithm(DQuat::IDENTITY), DVec3::ZERO);
    assert_eq!(AxisAngle::from(DQuat::IDENTITY), AxisAngle { axis: DVec3::X, angle: 0.0 });
}

#[test]
fn neighbouring_axes_of_a_sequence_must_differ() {
    assert!(EulerSequence::new([Axis::X, Axis::X, Axis::Z], TurnedAxes::Body).is_err());
    assert!(EulerSequence::new([Axis::X, Axis::Z, Axis::Z], TurnedAxes::World).is_err());
}

#[test]
fn polhodes_of_special_bodies_and_motions_are_named() {
    let class =
        |moments: [f64; 3], omega: [f64; 3]| polhode(DVec3::from_array(moments), DVec3::from_array(omega), 1e-12).class;
    assert_eq!(class([1.0, 2.0, 3.0], [0.0; 3]), PolhodeClass::Rest);
    assert_eq!(class([2.0, 2.0, 2.0], [1.0, 2.0, 3.0]), PolhodeClass::Steady);
    assert_eq!(class([1.0, 2.0, 2.0], [1.0, 2.0, 3.0]), PolhodeClass::Circle);
    assert_eq!(class([1.0, 1.0, 1.5], [1.0, 2.0, 3.0]), PolhodeClass::Circle);
    assert_eq!(class([1.0, 2.0, 2.0], [0.0, 2.0, 3.0]), PolhodeClass::Steady);
    // I₃(I₃ − I₂) ω₃² = I₁(I₂ − I₁) ω₁²: 3 ω₃² = ω₁².
    assert_eq!(class([1.0, 2.0, 3.0], [3.0_f64.sqrt(), 1.0, 1.0]), PolhodeClass::Separatrix);
    assert_eq!(class([1e-46, 2e-46, 3e-46], [1e9, 0.0, 1e12]), PolhodeClass::AroundLargest);
}
