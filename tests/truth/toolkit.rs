//! Exponential and logarithm of rotations where they are delicate: near no rotation and half a turn.

use crate::strategies;

use std::f64::consts::PI;

use glam::{DQuat, DVec3};
use polhode::bodies::toolkit::{exponential, logarithm};
use proptest::prelude::*;
use strategies::{vector, vector_of_any_size};

/// A handful of operations on numbers up to π.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

proptest! {
    #[test]
    fn logarithm_and_exponential_are_inverses_at_all_sizes(v in vector_of_any_size(1.7)) {
        let back = logarithm(exponential(v));
        prop_assert!((back - v).length() <= ROUNDING * v.length(), "{v} came back as {back}");
        prop_assert_eq!(logarithm(-exponential(v)), back);
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
}

#[test]
fn exponential_and_logarithm_take_the_smallest_and_largest_vectors() {
    for size in [0.0, f64::MIN_POSITIVE, 1e-200, 1e-160, 1e-9, 1e-8] {
        let v = DVec3::new(1.0, -2.0, 0.5) * size;
        assert!((logarithm(exponential(v)) - v).length() <= ROUNDING * v.length(), "{size:e}");
        assert!((exponential(v).length() - 1.0).abs() <= f64::EPSILON);
    }
    let half_turn = DQuat::from_xyzw(0.6, 0.0, -0.8, 0.0);
    assert!((logarithm(half_turn) - DVec3::new(0.6, 0.0, -0.8) * PI).length() < ROUNDING);
    assert_eq!(logarithm(DQuat::IDENTITY), DVec3::ZERO);
}
