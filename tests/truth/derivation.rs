//! The identities of "A Complete Derivation of the Newton-Euler Equations", in its order and with its numbers, over
//! random bodies, motions and points.

use crate::strategies;

use glam::{DMat3, DQuat, DVec3};
use polhode::bodies::inertia::{InertiaTensor, MassProperties, point_masses};
use polhode::bodies::toolkit::{
    angular_acceleration_body, angular_momentum, attitude_error, exponential, momentum_angle,
    rotational_kinetic_energy, torque_of_motion,
};
use proptest::prelude::*;
use strategies::{body, cloud, orientation, vector};

/// Inputs are of order 1 to 10 and formulas have up to about fifty operations.
const ROUNDING: f64 = 1e-12;

/// Step of central differences: their truncation error is of order 1e-8 times a third derivative, and rounding 1e-12.
const STEP: f64 = 1e-4;

/// What central differences with [`STEP`] allow, for motions with rates up to 3 rad/s.
const DIFFERENCE: f64 = 3e-6;

/// Fails with both values where they are further apart than `bound`.
fn close(found: DVec3, expected: DVec3, bound: f64) -> Result<(), TestCaseError> {
    let error = (found - expected).length();
    prop_assert!(error <= bound, "{found} instead of {expected}: error {error:e}, bound {bound:e}");
    Ok(())
}

fn close_matrix(found: DMat3, expected: DMat3, bound: f64) -> Result<(), TestCaseError> {
    (0..3).try_for_each(|i| close(found.col(i), expected.col(i), bound))
}

fn close_scalar(found: f64, expected: f64, bound: f64) -> Result<(), TestCaseError> {
    close(DVec3::X * found, DVec3::X * expected, bound)
}

/// Σ over the points of the cloud of a function of mass and place relative to the centre of mass.
fn over_points(cloud: &[(f64, DVec3)], body: &MassProperties, of: impl Fn(f64, DVec3) -> DVec3) -> DVec3 {
    cloud.iter().map(|&(mass, place)| of(mass, place - body.centre_of_mass)).sum()
}

/// [v]×, the matrix with [v]× p = v × p.
fn cross_product_matrix(v: DVec3) -> DMat3 {
    DMat3::from_cols_array(&[0.0, v.z, -v.y, -v.z, 0.0, v.x, v.y, -v.x, 0.0])
}

/// The exponential of a matrix M: the power series of M/1024, squared ten times.
fn matrix_exponential(matrix: DMat3) -> DMat3 {
    let small = matrix * (1.0 / 1024.0);
    let sum = (1..12).rev().fold(DMat3::IDENTITY, |sum, n| DMat3::IDENTITY + small * sum * (1.0 / f64::from(n)));
    (0..10).fold(sum, |power, _| power * power)
}

/// v(r) = ω × r + ẋ, equation (3).
fn velocity_of_point(centre_velocity: DVec3, omega: DVec3, offset: DVec3) -> DVec3 {
    omega.cross(offset) + centre_velocity
}

/// a(r) = ẍ + ω̇ × r + ω × (ω × r), its derivative.
fn acceleration_of_point(centre_acceleration: DVec3, omega: DVec3, alpha: DVec3, offset: DVec3) -> DVec3 {
    centre_acceleration + alpha.cross(offset) + omega.cross(omega.cross(offset))
}

proptest! {
    #[test]
    fn equations_1_and_2_and_section_2_1_the_cross_product_is_a_skew_matrix_of_lie_type(
        w in vector(3.0), p in vector(3.0), v in vector(3.0),
    ) {
        let (w_cross, p_cross) = (cross_product_matrix(w), cross_product_matrix(p));
        close(w_cross * p, w.cross(p), 0.0)?;
        close_matrix(w_cross.transpose(), -w_cross, 0.0)?;
        close(w_cross * p, -(p_cross * w), 0.0)?;
        close_matrix(cross_product_matrix(w_cross * p), w_cross * p_cross - p_cross * w_cross, ROUNDING)?;
        let difference = (w.cross(p + v * STEP) - w.cross(p - v * STEP)) / (2.0 * STEP);
        close(difference, w_cross * v, DIFFERENCE)?;
        // Section 4.1: the matrix fixes the order of products.
        close(w.cross(p.cross(v)), w_cross * p_cross * v, ROUNDING)?;
        close(w.cross(p).cross(v), (w_cross * p_cross - p_cross * w_cross) * v, ROUNDING)?;
    }

    #[test]
    fn section_2_2_the_exponential_is_that_of_the_cross_product_matrix(v in vector(std::f64::consts::PI)) {
        close_matrix(DMat3::from_quat(exponential(v)), matrix_exponential(cross_product_matrix(v)), ROUNDING)?;
    }

    #[test]
    fn section_2_2_body_and_world_rates_compose_from_either_side(
        q in orientation(), omega in vector(3.0), t in 0.0..3.0_f64,
    ) {
        let body = |t: f64| q * exponential(omega * t);
        prop_assert!(attitude_error(body(t), exponential(q * omega * t) * q) < ROUNDING);
        // Its rate is ½ q ω_B = ½ ω_W q.
        let rate = (body(STEP) - body(-STEP)) / (2.0 * STEP);
        let pure = |v: DVec3| DQuat::from_xyzw(v.x, v.y, v.z, 0.0);
        prop_assert!((rate - q * pure(0.5 * omega)).length() < DIFFERENCE);
        prop_assert!((rate - pure(q * omega * 0.5) * q).length() < DIFFERENCE);
    }

    #[test]
    fn equation_3_a_point_moves_by_translation_and_rotation(
        q in orientation(),
        omega in vector(2.0),
        alpha in vector(1.0),
        v in vector(2.0),
        a in vector(1.0),
        r in vector(1.0),
    ) {
        // A motion with these rates at t = 0, told in world axes.
        let place = |t: f64| {
            let turned = exponential(omega * t + alpha * (0.5 * t * t)) * q;
            v * t + a * (0.5 * t * t) + turned * r
        };
        let offset = q * r;
        let difference = (place(STEP) - place(-STEP)) / (2.0 * STEP);
        close(difference, velocity_of_point(v, omega, offset), DIFFERENCE)?;
        // exp(ωt + ½αt²) has the angular acceleration α at t = 0: its second-order part ½ ω × α t² begins later.
        let second = (place(STEP) - 2.0 * place(0.0) + place(-STEP)) / (STEP * STEP);
        close(second, acceleration_of_point(a, omega, alpha, offset), DIFFERENCE)?;
    }

    #[test]
    fn equation_4_the_energy_of_the_points_is_that_of_the_three_terms(
        points in cloud(), omega in vector(3.0), v in vector(3.0), reference in vector(2.0),
    ) {
        let body = point_masses(&points).expect("a cloud is a body");
        let direct: f64 = points.iter()
            .map(|&(mass, place)| (mass, velocity_of_point(v, omega, place - body.centre_of_mass)))
            .map(|(mass, velocity)| 0.5 * mass * velocity.length_squared())
            .sum();
        let reference_velocity = velocity_of_point(v, omega, reference - body.centre_of_mass);
        let rotational = rotational_kinetic_energy(&body.inertia_about(reference), omega);
        let linear = 0.5 * body.mass * reference_velocity.length_squared();
        let first_moment = body.mass * (body.centre_of_mass - reference);
        let cross = reference_velocity.dot(omega.cross(first_moment));
        close_scalar(rotational + linear + cross, direct, 1e2 * ROUNDING)?;
        // From the centre of mass there is no cross term.
        let from_centre = rotational_kinetic_energy(&body.inertia, omega) + 0.5 * body.mass * v.length_squared();
        close_scalar(from_centre, direct, 1e2 * ROUNDING)?;
    }

    #[test]
    fn equation_5_inertia_is_the_sum_of_the_points_squared_cross_products(points in cloud(), omega in vector(3.0)) {
        let body = point_masses(&points).expect("a cloud is a body");
        let sum = points.iter().fold(DMat3::ZERO, |sum, &(mass, place)| {
            let r = cross_product_matrix(place - body.centre_of_mass);
            sum + r.transpose() * r * mass
        });
        close_matrix(body.inertia.to_matrix(), sum, ROUNDING)?;
        let direct: f64 = points.iter()
            .map(|&(mass, place)| 0.5 * mass * omega.cross(place - body.centre_of_mass).length_squared())
            .sum();
        close_scalar(rotational_kinetic_energy(&body.inertia, omega), direct, 1e2 * ROUNDING)?;
    }

    #[test]
    fn section_2_3_momentum_is_the_gradient_and_inertia_the_hessian_of_energy(
        body in body(), omega in vector(3.0), v in vector(3.0),
    ) {
        // Central differences of a quadratic are exact but for rounding, whatever the step: a large one is best.
        let h = 0.5;
        let gradient = |energy: &dyn Fn(DVec3) -> f64, at: DVec3| {
            DVec3::from_array(DVec3::AXES.map(|axis| (energy(at + axis * h) - energy(at - axis * h)) / (2.0 * h)))
        };
        let rotational = |w: DVec3| rotational_kinetic_energy(&body.inertia, w);
        let linear = |v: DVec3| 0.5 * body.mass * v.length_squared();
        close(gradient(&rotational, omega), angular_momentum(&body.inertia, omega), 1e2 * ROUNDING)?;
        close(gradient(&linear, v), v * body.mass, 1e2 * ROUNDING)?;
        for (axis, i) in DVec3::AXES.into_iter().zip(0..3) {
            let column = |energy: &dyn Fn(DVec3) -> f64, at: DVec3| {
                (gradient(energy, at + axis * h) - gradient(energy, at - axis * h)) / (2.0 * h)
            };
            close(column(&rotational, omega), body.inertia.to_matrix().col(i), 1e3 * ROUNDING)?;
            close(column(&linear, v), axis * body.mass, 1e3 * ROUNDING)?;
        }
    }

    #[test]
    fn equation_6_the_torque_is_the_rate_of_the_angular_momentum(
        body in body(), q in orientation(), omega in vector(2.0), alpha in vector(1.0),
    ) {
        let momentum = |t: f64| {
            let turned = exponential(omega * t + alpha * (0.5 * t * t)) * q;
            // The rate of turning of this motion, to second order: ω + α t (+ terms of t² that a central difference
            // drops).
            angular_momentum(&body.inertia.rotated(turned), omega + alpha * t)
        };
        let rate = (momentum(STEP) - momentum(-STEP)) / (2.0 * STEP);
        close(rate, torque_of_motion(&body.inertia.rotated(q), omega, alpha), 1e2 * DIFFERENCE)?;
    }

    #[test]
    fn equations_7_and_8_force_and_torque_are_those_of_the_points_accelerations(
        points in cloud(), omega in vector(3.0), alpha in vector(3.0), a in vector(3.0),
    ) {
        let body = point_masses(&points).expect("a cloud is a body");
        let torque = over_points(&points, &body, |mass, r| mass * r.cross(acceleration_of_point(a, omega, alpha, r)));
        close(torque, torque_of_motion(&body.inertia, omega, alpha), 1e2 * ROUNDING)?;
        let force = over_points(&points, &body, |mass, r| mass * acceleration_of_point(a, omega, alpha, r));
        close(force, a * body.mass, 1e2 * ROUNDING)?;
        // And backwards: the torque gives the acceleration again.
        let back = angular_acceleration_body(&body.inertia, omega, torque);
        close(back, alpha, 1e4 * ROUNDING)?;
    }

    #[test]
    fn equation_9_with_the_corrected_sign_keeps_the_momentum_in_the_world(
        body in body(), q in orientation(), omega in vector(2.0),
    ) {
        // dL/dt in the world of a motion with these rates at t = 0: R (ω × I ω + I ω̇).
        let turning = omega.cross(body.inertia * omega);
        let rate_of_momentum = |acceleration: DVec3| q * (turning + body.inertia * acceleration);
        let corrected = angular_acceleration_body(&body.inertia, omega, DVec3::ZERO);
        close(rate_of_momentum(corrected), DVec3::ZERO, 1e2 * ROUNDING)?;
        // Planted fault: the sign as printed doubles the gyroscopic term instead of cancelling it.
        let gyroscopic = torque_of_motion(&body.inertia, omega, DVec3::ZERO);
        prop_assume!(gyroscopic.length() > 1e-3);
        let as_printed = body.inertia.solve(gyroscopic);
        close(rate_of_momentum(as_printed), q * gyroscopic * 2.0, 1e2 * ROUNDING)?;
        prop_assert!(close(rate_of_momentum(as_printed), DVec3::ZERO, 1e2 * ROUNDING).is_err());
    }

    #[test]
    fn equation_9_body_and_world_axes_give_the_same_vector(
        body in body(), q in orientation(), omega in vector(2.0), torque in vector(2.0),
    ) {
        let in_body = angular_acceleration_body(&body.inertia, omega, torque);
        // The equation with the world's tensor, as it is written.
        let tensor = body.inertia.rotated(q);
        let in_world = tensor.to_matrix().inverse() * (q * torque - (q * omega).cross(tensor * (q * omega)));
        close(in_world, q * in_body, 1e4 * ROUNDING)?;
        close(angular_acceleration_body(&tensor, q * omega, q * torque), in_world, 1e4 * ROUNDING)?;
    }

    #[test]
    fn section_3_eigenvectors_and_only_they_do_not_precess(
        body in body(), rate in 0.1..5.0_f64, away in 0.01..0.5_f64,
    ) {
        let axes = body.principal_axes();
        for i in 0..3 {
            let omega = axes.axis_body(i) * rate;
            prop_assert!(momentum_angle(&body.inertia, omega) <= ROUNDING);
            close(angular_acceleration_body(&body.inertia, omega, DVec3::ZERO), DVec3::ZERO, 1e4 * ROUNDING)?;
        }
        let [smallest, _, largest] = axes.moments.to_array();
        prop_assume!(largest - smallest > 0.01 * largest);
        let omega = (axes.axis_body(0) * away.cos() + axes.axis_body(2) * away.sin()) * rate;
        prop_assert!(momentum_angle(&body.inertia, omega) > 1e-6);
        // tan of the angle between ω and I ω of a plane motion, from the two moments.
        let (x, y) = (smallest * away.cos(), largest * away.sin());
        close_scalar(momentum_angle(&body.inertia, omega), y.atan2(x) - away, 1e2 * ROUNDING)?;
    }

    #[test]
    fn parallel_axes_lead_to_any_point_and_back(points in cloud(), point in vector(3.0), q in orientation()) {
        let body = point_masses(&points).expect("a cloud is a body");
        let about = body.inertia_about(point);
        let direct = points.iter().fold(InertiaTensor::default(), |sum, &(mass, place)| {
            sum + InertiaTensor::of_point_mass(mass, place - point)
        });
        prop_assert!((about - direct).norm() < 1e2 * ROUNDING, "{about:?} instead of {direct:?}");
        // The same in another frame: turning the points turns the tensor.
        let turned: Vec<_> = points.iter().map(|&(mass, place)| (mass, q * place)).collect();
        let turned = point_masses(&turned).expect("a cloud is a body");
        prop_assert!((turned.inertia - body.inertia.rotated(q)).norm() < 1e2 * ROUNDING);
    }

    #[test]
    fn momentum_about_a_point_is_that_of_the_points(
        points in cloud(), point in vector(2.0), omega in vector(2.0), v in vector(2.0),
    ) {
        let body = point_masses(&points).expect("a cloud is a body");
        let direct: DVec3 = points.iter()
            .map(|&(mass, place)| (mass, place - point, velocity_of_point(v, omega, place - body.centre_of_mass)))
            .map(|(mass, arm, velocity)| mass * arm.cross(velocity))
            .sum();
        let own = angular_momentum(&body.inertia, omega);
        close(own + body.mass * (body.centre_of_mass - point).cross(v), direct, 1e2 * ROUNDING)?;
    }
}

/// Figures of the Three Gorges dam and of the Earth, SI.
mod earth {
    pub const DAY: f64 = 86_164.1;
    pub const RADIUS: f64 = 6.371e6;
    pub const POLAR_MOMENT: f64 = 8.034e37;
    /// 39.3 km³.
    pub const WATER: f64 = 3.93e13;
    /// Height of the full lake above the sea.
    pub const HEIGHT: f64 = 175.0;
    /// cos² of the latitude of the lake, 30.5°.
    pub const LAKE: f64 = 0.7424;
    /// Mean of cos² of the latitude over the oceans: 2/3 − 2/3 (a₂/5a₀) with a₂ = −0.134, a₀ = 0.714 (Munk and
    /// MacDonald 1960).
    pub const OCEANS: f64 = 0.6917;
    /// Load Love number of degree two: what the elastic Earth undoes.
    pub const YIELDING: f64 = 0.3075;
}

/// By how much the day lengthens, µs, and the kinetic energy falls (relative), when the polar moment grows by `change`
/// and no torque acts.
fn longer_day(change: f64) -> (f64, f64) {
    let spin = std::f64::consts::TAU / earth::DAY;
    let before = InertiaTensor { zz: earth::POLAR_MOMENT, xx: 8.01e37, yy: 8.01e37, ..Default::default() };
    let after = before + InertiaTensor { zz: change, ..Default::default() };
    let momentum = angular_momentum(&before, DVec3::Z * spin);
    let slower = after.solve(momentum);
    let energy = |tensor: &InertiaTensor, omega: DVec3| rotational_kinetic_energy(tensor, omega);
    let lost = 1.0 - energy(&after, slower) / energy(&before, DVec3::Z * spin);
    (1e6 * (std::f64::consts::TAU / slower.z - earth::DAY), lost)
}

#[test]
fn section_2_3_a_filled_reservoir_lengthens_the_day_by_six_hundredths_of_a_microsecond() {
    let square = earth::WATER * earth::RADIUS * earth::RADIUS;
    let rigid = square * (earth::LAKE - earth::OCEANS);
    let (microseconds, lost) = longer_day(rigid * (1.0 - earth::YIELDING));
    assert!((0.055..0.065).contains(&microseconds), "{microseconds} µs");
    // Angular momentum is what stays; the energy falls as the spin does, L²/2I.
    let relative = microseconds * 1e-6 / earth::DAY;
    assert!((lost / relative - 1.0).abs() < 1e-3, "energy falls by {lost:e}, the spin by {relative:e}");
    // With the energy kept instead, ω ∝ I^(−1/2) and the day would lengthen by half as much: not the figure observed.
    assert!(0.5 * microseconds < 0.035);
    // Lifting the water without moving it in latitude has a thousandth of the effect.
    let lifted = 2.0 * earth::WATER * earth::RADIUS * earth::HEIGHT * earth::LAKE;
    let (lifted, _) = longer_day(lifted);
    assert!((0.5e-4..2e-4).contains(&lifted), "{lifted} µs");
}

#[test]
fn the_gyroscopic_term_vanishes_for_a_sphere_and_not_for_a_box() {
    let omega = DVec3::new(1.0, 2.0, 3.0);
    let sphere = InertiaTensor::from_principal_moments(DVec3::splat(0.3));
    assert_eq!(torque_of_motion(&sphere, omega, DVec3::ZERO), DVec3::ZERO);
    let slab = InertiaTensor::from_principal_moments(DVec3::new(1.0, 2.0, 2.5));
    assert_eq!(torque_of_motion(&slab, omega, DVec3::ZERO), DVec3::new(3.0, -4.5, 2.0));
}
