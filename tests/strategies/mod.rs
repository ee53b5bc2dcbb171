//! Random inputs that the property tests share.

#![allow(dead_code, reason = "each test file uses some of them")]

use glam::{DQuat, DVec3};
use polhode::bodies::inertia::{InertiaTensor, MassProperties, point_masses};
use polhode::bodies::toolkit::exponential;
use proptest::prelude::*;

/// A vector with components in ±`size`.
pub fn vector(size: f64) -> impl Strategy<Value = DVec3> {
    [-size..size, -size..size, -size..size].prop_map(DVec3::from_array)
}

/// A vector whose length is drawn from twelve orders of magnitude below `largest`.
pub fn vector_of_any_size(largest: f64) -> impl Strategy<Value = DVec3> {
    (vector(1.0), -12.0..0.0_f64).prop_map(move |(v, exponent)| v * largest * 10.0_f64.powf(exponent))
}

/// A unit quaternion, by four components in a ball's shell.
pub fn orientation() -> impl Strategy<Value = DQuat> {
    [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0, -1.0..1.0]
        .prop_map(DQuat::from_array)
        .prop_filter("a direction", |q| (0.01..1.0).contains(&q.length_squared()))
        .prop_map(|q| q.normalize())
}

/// Five point masses: a body with all moments positive.
pub fn cloud() -> impl Strategy<Value = Vec<(f64, DVec3)>> {
    prop::collection::vec((0.1..2.0_f64, vector(1.0)), 5).prop_filter("extended in all directions", |points| {
        point_masses(points).is_ok_and(|body| body.principal_axes().moments.x > 0.05)
    })
}

/// The body of a [`cloud`].
pub fn body() -> impl Strategy<Value = MassProperties> {
    cloud().prop_map(|points| point_masses(&points).expect("a cloud is a body"))
}

/// Principal moments of a body, in no order, over six orders of magnitude of the second moments.
pub fn moments() -> impl Strategy<Value = DVec3> {
    [-6.0..0.0_f64, -6.0..0.0, -6.0..0.0].prop_map(|exponents| {
        let [a, b, c] = exponents.map(|exponent| 10.0_f64.powf(exponent));
        DVec3::new(b + c, c + a, a + b)
    })
}

/// A tensor in general axes.
pub fn tensor() -> impl Strategy<Value = InertiaTensor> {
    (moments(), vector(3.0))
        .prop_map(|(moments, turn)| InertiaTensor::from_principal_moments(moments).rotated(exponential(turn)))
}
