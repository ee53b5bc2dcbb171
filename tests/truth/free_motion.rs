//! The closed form of torque-free motion: every branch, every switch between branches, what it conserves, and the
//! characteristic values of a motion.

use crate::common;
use crate::support;

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec3};
use polhode::bodies::BodyState;
use polhode::engine::{End, Engine, unobserved};
use polhode::kernel::free_motion::{FreeMotion, Polhode};
use polhode::math::phase::Time;
use polhode::plan::CLOSED_FORM_F32;
use polhode::{Accuracy, Ensemble, Method, Outputs, Plan, Precision, Scene};
use support::{attitude_error, relative_error};

/// The bound of the golden tests.
const BOUND: f64 = 2e-14;
/// A kinetic energy is a sum of three products of two components, each within some four roundings of 1.1e-16.
const ENERGY: f64 = 2e-15;
/// An angular momentum in world axes is rotated by a quaternion that is within some five roundings; the angle is twice
/// that.
const MOMENTUM: f64 = 4e-15;

fn start() -> DQuat {
    DQuat::from_array([0.1, 0.7, -0.3, 0.6]).normalize()
}

fn motion(moments: [f64; 3], omega: [f64; 3]) -> FreeMotion {
    FreeMotion::new(DVec3::from_array(moments), start(), DVec3::from_array(omega)).expect("a valid body")
}

fn difference(a: &BodyState, b: &BodyState) -> f64 {
    attitude_error(a.orientation, b.orientation).max(relative_error(a.angular_velocity_body, b.angular_velocity_body))
}

/// A body for every branch, and the curve it follows.
const BRANCHES: [(&str, [f64; 3], [f64; 3], Polhode); 23] = [
    ("around the third axis", [1.0, 1.5, 2.0], [0.2, -0.3, 1.0], Polhode::AboutThird),
    ("around the third axis, reversed", [1.0, 1.5, 2.0], [0.2, 0.3, -1.0], Polhode::AboutThird),
    ("around the first axis", [1.0, 1.5, 2.0], [1.0, -0.3, 0.2], Polhode::AboutFirst),
    ("around the first axis, reversed", [1.0, 1.5, 2.0], [-1.0, -0.3, 0.2], Polhode::AboutFirst),
    ("transformed series, third axis", [1.0, 2.0, 3.0], [1e-4, 5.0, 1e-3], Polhode::AboutThird),
    ("transformed series, first axis", [1.0, 2.0, 3.0], [1e-3, -5.0, 1e-4], Polhode::AboutFirst),
    ("separatrix", [1.0, 2.0, 2.25], [0.75, 1.0, -1.0], Polhode::Separatrix),
    ("separatrix, behind its middle", [1.0, 2.0, 2.25], [-0.75, 7.0, 1.0], Polhode::Separatrix),
    ("oblate", [1.0, 1.0, 1.5], [0.3, -0.2, 1.0], Polhode::AboutThird),
    ("oblate, transverse", [1.0, 1.0, 1.5], [0.3, -0.2, 0.0], Polhode::Point),
    ("prolate", [1.0, 2.5, 2.5], [0.3, -0.2, 1.0], Polhode::AboutFirst),
    ("prolate, transverse", [1.0, 1.5, 1.5], [0.0, -0.2, 1.0], Polhode::Point),
    ("nearly oblate", [1.0, 1.0 + 1e-9, 1.5], [0.3, -0.2, 1.0], Polhode::AboutThird),
    ("nearly prolate, transverse", [1.0, 1.5, 1.5 + 1e-9], [1e-12, -0.2, 1.0], Polhode::AboutThird),
    ("sphere", [1.0, 1.0, 1.0], [0.3, -0.2, 1.0], Polhode::Point),
    ("steady about the first axis", [1.0, 2.0, 3.0], [-2.0, 0.0, 0.0], Polhode::Point),
    ("steady about the middle axis", [1.0, 2.0, 3.0], [0.0, -2.0, 0.0], Polhode::Point),
    ("steady about the third axis", [1.0, 2.0, 3.0], [0.0, 0.0, 2.0], Polhode::Point),
    ("at rest", [1.0, 2.0, 3.0], [0.0, 0.0, 0.0], Polhode::Point),
    ("thin rod", [1e-6, 1.0, 1.0 + 5e-7], [0.05, 0.5, 2.0], Polhode::AboutThird),
    ("thin rod, tumbling", [1e-6, 1.0, 1.0 + 5e-7], [10.0, 0.5, 0.2], Polhode::AboutFirst),
    ("thin rod, spinning", [1e-6, 1.0, 1.0 + 5e-7], [100.0, 1e-5, 1e-5], Polhode::AboutFirst),
    ("plate", [1.0, 1.5, 2.5], [0.1, 1.0, 0.9], Polhode::AboutThird),
];

#[test]
fn every_branch_is_recognised() {
    for (name, moments, omega, expected) in BRANCHES {
        assert_eq!(motion(moments, omega).polhode(), expected, "{name}");
    }
}

#[test]
fn energy_and_angular_momentum_are_kept_at_any_time() {
    for (name, moments, omega, _) in BRANCHES {
        let body = motion(moments, omega);
        let initial = body.at(0.0);
        for time in [1e-9, 0.3, -7.0, 1e3, -1e6, 1e9, 1e15] {
            let state = body.at(time);
            let energy = (state.kinetic_energy - initial.kinetic_energy).abs();
            let momentum = relative_error(state.angular_momentum_world, initial.angular_momentum_world);
            assert!(energy <= ENERGY * initial.kinetic_energy, "{name} at {time} s: energy off by {energy:.2e}");
            assert!(momentum <= MOMENTUM, "{name} at {time} s: angular momentum off by {momentum:.2e}");
            assert!((state.orientation.length() - 1.0).abs() <= ENERGY, "{name} at {time} s: {:?}", state.orientation);
        }
    }
}

#[test]
fn the_start_is_the_initial_state() {
    for (name, moments, omega, _) in BRANCHES {
        let body = motion(moments, omega);
        let state = body.at(0.0);
        assert!(attitude_error(state.orientation, start()) <= 4.0 * f64::EPSILON, "{name}: {:?}", state.orientation);
        let expected = DVec3::from_array(omega);
        let largest = expected.abs().max_element();
        let off = (state.angular_velocity_body - expected).abs().max_element();
        // 2 ulps of the largest component, which are at least this.
        assert!(off <= f64::EPSILON * largest, "{name}: {:?}", state.angular_velocity_body);
        // The formula itself, an instant later.
        let next = body.at(f64::MIN_POSITIVE);
        assert!(difference(&next, &state) <= MOMENTUM, "{name}: {:.2e}", difference(&next, &state));
    }
}

#[test]
fn a_fresh_start_continues_the_motion() {
    // The state between is rounded, which shears the orbit by 2u of the rates over the second part; next to the
    // separatrix it grows by e^(lambda t) besides, so those are left to a shorter time.
    for (name, moments, omega, polhode) in BRANCHES {
        let body = motion(moments, omega);
        let (first, second) = if name.contains("transformed") { (0.4, 0.7) } else { (3.0, 8.0) };
        if polhode == Polhode::Separatrix {
            continue;
        }
        let middle = body.at(first);
        let again = FreeMotion::new(DVec3::from_array(moments), middle.orientation, middle.angular_velocity_body)
            .expect("a valid body");
        let off = difference(&again.at(second), &body.at(first + second));
        let angle = DVec3::from_array(omega).length() * second;
        let bound = BOUND + 8.0 * f64::EPSILON * angle;
        assert!(off <= bound, "{name}: {off:.2e}, {bound:.2e} allowed");
    }
}

#[test]
fn a_motion_runs_backwards() {
    // Reversing the spin reverses the time: the body then comes from where it went.
    for (name, moments, omega, _) in BRANCHES {
        let forth = motion(moments, omega);
        let back = motion(moments, omega.map(|w| -w));
        for time in [0.7, 30.0, 1e5] {
            let (a, b) = (forth.at(-time), back.at(time));
            let reversed = BodyState { angular_velocity_body: -b.angular_velocity_body, ..b };
            let off = difference(&reversed, &a);
            assert!(off <= BOUND, "{name} at {time} s: {off:.2e}");
        }
    }
}

/// The largest difference of two bodies' states over some times.
fn apart(a: &FreeMotion, b: &FreeMotion, times: &[f64]) -> f64 {
    times.iter().map(|&time| difference(&a.at(time), &b.at(time))).fold(0.0, f64::max)
}

#[test]
fn the_two_series_agree_at_the_switch() {
    // K'/K = AGM(1, k')/AGM(1, k) = 0.6 is crossed as the spin about the third axis falls; bodies one ulp apart then
    // differ by nothing but the series, and by an ulp of the rates.
    let mean = |mut a: f64, mut b: f64| {
        for _ in 0..8 {
            (a, b) = (0.5 * (a + b), (a * b).sqrt());
        }
        a
    };
    for (moments, direction) in [([1.0_f64, 2.0, 3.0], 1.0), ([1.0, 2.0, 3.0], -1.0), ([1.0, 1.2, 2.1], 1.0)] {
        let body = |third: f64| motion(moments, [0.3, direction, third]);
        let ratio = |third: f64| mean(1.0, body(third).complementary_modulus()) / mean(1.0, body(third).modulus());
        // From next to the separatrix, where L^2 = 2 T I_2, to a nearly steady spin.
        let [i1, i2, i3] = moments;
        let (mut low, mut high) = (0.315 * (i1 * (i2 - i1) / (i3 * (i3 - i2))).sqrt(), 5.0_f64);
        assert!(ratio(low) < 0.6 && ratio(high) > 0.6, "the switch lies between");
        while low.next_up() < high {
            let middle = 0.5 * (low + high);
            if ratio(middle) < 0.6 { low = middle } else { high = middle }
        }
        // Rounding of the ratio here and there may differ by a few ulps of the spin.
        for step in 1..16 {
            let by = 1.0 + f64::from(step) * f64::EPSILON;
            let off = apart(&body(low / by), &body(high * by), &[0.0, 0.4, 3.0, -9.0, 20.0]);
            // The rates change by no more than twice the spin's part of 2 step ulps, and |omega| t is below 22.
            let bound = BOUND + 4.0 * f64::from(step) * f64::EPSILON * 22.0;
            assert!(off <= bound, "{moments:?}: {off:.2e} across the switch, {bound:.2e} allowed");
        }
    }
}

#[test]
fn the_regimes_meet_at_the_separatrix() {
    // omega_1 = 3/4 (1 +- delta) beside the exact separatrix: neighbouring orbits part as e^(lambda t) with
    // lambda = |L|/I_2 sqrt((I_2 - I_1)(I_3 - I_2)/(I_1 I_3)).
    let moments = [1.0, 2.0, 2.25];
    let omega = |delta: f64| [0.75 * (1.0 + delta), 1.0, -1.0];
    let exact = motion(moments, omega(0.0));
    assert_eq!(exact.polhode(), Polhode::Separatrix);
    let length = (DVec3::from_array(moments) * DVec3::from_array(omega(0.0))).length();
    let lambda = length / 2.0 * (1.0_f64 * 0.25 / 2.25).sqrt();
    for exponent in [20, 30, 40, 50] {
        let delta = (-f64::from(exponent)).exp2();
        for (signed, polhode) in [(delta, Polhode::AboutFirst), (-delta, Polhode::AboutThird)] {
            let beside = motion(moments, omega(signed));
            assert_eq!(beside.polhode(), polhode, "delta 2^-{exponent}");
            for time in [0.1, 2.0, -2.0, 8.0] {
                let off = difference(&beside.at(time), &exact.at(time));
                // The phase about the angular momentum is sheared as well, by delta |omega| t.
                let bound = BOUND + 4.0 * delta * ((lambda * time.abs()).exp() + length * time.abs());
                assert!(off <= bound, "delta {signed:e} at {time} s: {off:.2e}, {bound:.2e} allowed");
            }
        }
    }
}

#[test]
fn a_spin_ever_closer_to_the_middle_axis_ends_on_the_separatrix() {
    for exponent in [20, 60, 100, 115, 116, 117, 118, 119, 120, 140, 400] {
        let small = (-f64::from(exponent)).exp2();
        let body = motion([1.0, 2.0, 3.0], [small, 1.0, small]);
        let (energy, momentum) = (body.at(0.0).kinetic_energy, body.at(0.0).angular_momentum_world);
        let mut times = vec![-500.0, -1.0, 1.0, 30.0, 500.0];
        if exponent <= 118 {
            assert_eq!(body.polhode(), Polhode::AboutThird, "2^-{exponent}");
            let flip = body.flips(0.0, 1e6).next().expect("it flips");
            // u runs from about -ln(4/epsilon) to 0 at the rate lambda = 1/sqrt(3).
            let expected = (4.0 / small).ln() * 3.0_f64.sqrt();
            assert!((flip - expected).abs() < 3.0, "2^-{exponent}: flip at {flip} s, about {expected} s expected");
            assert!(body.at(flip - 20.0).angular_velocity_body.y > 0.99, "2^-{exponent} before");
            assert!(body.at(flip + 20.0).angular_velocity_body.y < -0.99, "2^-{exponent} after");
            times.extend([0.5 * flip, flip, flip + 1.0]);
        } else {
            // Below 2^-118 of the spin only one flip is left, in the past or in the future.
            assert_eq!(body.flips(-1e6, 1e6).count(), 1, "2^-{exponent}");
        }
        for time in times {
            let state = body.at(time);
            assert!((state.kinetic_energy / energy - 1.0).abs() <= ENERGY, "2^-{exponent} at {time} s");
            let off = relative_error(state.angular_momentum_world, momentum);
            assert!(off <= MOMENTUM, "2^-{exponent} at {time} s: {off:.2e}");
        }
    }
    // Steady about the middle axis: no flip at all.
    assert_eq!(motion([1.0, 2.0, 3.0], [0.0, 1.0, 0.0]).flips(0.0, 1e9).count(), 0);
}

#[test]
fn equal_moments_are_the_limit_of_nearly_equal_ones() {
    for (base, omega) in [
        ([1.0, 1.0, 1.5], [0.3, -0.2, 1.0]),
        ([1.0, 1.0, 1.5], [0.3, -0.2, 0.0]),
        ([1.0, 1.5, 1.5], [0.3, -0.2, 1.0]),
        ([1.0, 1.5, 1.5], [0.0, -0.2, 1.0]),
        ([1.0, 1.0, 1.0], [0.3, -0.2, 1.0]),
    ] {
        let exact = motion(base, omega);
        for exponent in [10, 20, 30, 40, 52] {
            let delta = (-f64::from(exponent)).exp2();
            for axis in 0..3 {
                let mut moments = base;
                moments[axis] *= 1.0 + delta;
                let near = motion(moments, omega);
                for time in [0.1, 3.0, -30.0] {
                    let off = difference(&near.at(time), &exact.at(time));
                    let bound = BOUND + 4.0 * delta * (1.0 + DVec3::from_array(omega).length() * time.abs());
                    assert!(off <= bound, "{moments:?} at {time} s: {off:.2e}, {bound:.2e} allowed");
                }
            }
        }
    }
}

#[test]
fn steady_rotation_is_the_limit_of_nearly_steady_ones() {
    for axis in [0, 2] {
        let mut omega = [0.0; 3];
        omega[axis] = 1.7;
        let exact = motion([1.0, 2.0, 3.0], omega);
        for exponent in [10, 40, 60, 98, 99, 100, 101, 102, 300, 500] {
            let small = (-f64::from(exponent)).exp2();
            let mut tilted = omega.map(|w| if w == 0.0 { small } else { w });
            tilted[1] = -small;
            let near = motion([1.0, 2.0, 3.0], tilted);
            for time in [0.1, 30.0] {
                let off = difference(&near.at(time), &exact.at(time));
                let bound = BOUND + 4.0 * small * (1.0 + 1.7 * time);
                assert!(off <= bound, "2^-{exponent} at {time} s: {off:.2e}, {bound:.2e} allowed");
            }
        }
    }
}

/// 2^n as an f64.
fn power(n: i32) -> f64 {
    f64::from(n).exp2()
}

#[test]
fn units_make_no_difference() {
    // Moments from 1e-46 to 1e38 kg m^2 and spins from 1e-9 to 1e15 rad/s: the same bits in scaled units.
    for (name, moments, omega, _) in BRANCHES {
        let base = motion(moments, omega);
        for (moment, rate) in [(-153, -30), (126, 50), (0, 50), (-153, 0), (126, -30)] {
            let scaled = motion(moments.map(|i| i * power(moment)), omega.map(|w| w * power(rate)));
            for time in [0.37, 1234.5] {
                let (a, b) = (base.at(time), scaled.at(time * power(-rate)));
                assert_eq!(a.orientation, b.orientation, "{name}, 2^{moment} kg m^2, 2^{rate} rad/s");
                assert_eq!(
                    a.angular_velocity_body,
                    b.angular_velocity_body * power(-rate),
                    "{name}, 2^{moment} kg m^2, 2^{rate} rad/s"
                );
            }
        }
    }
}

#[test]
fn a_tensor_in_turned_axes_moves_as_the_diagonal_one() {
    let turn = DQuat::from_array([0.2, -0.5, 0.4, 0.7]).normalize();
    let matrix = DMat3::from_quat(turn);
    for (name, moments, omega, polhode) in BRANCHES {
        // The turned tensor is rounded, so its moments differ by an ulp of the largest; what that does to rods, to orbits
        // next to or on the separatrix and to the unstable rotation is not at issue here.
        let unstable = name.contains("transformed") || name.contains("middle") || polhode == Polhode::Separatrix;
        if name.contains("rod") || unstable {
            continue;
        }
        let straight = motion(moments, omega);
        let tensor = matrix * DMat3::from_diagonal(DVec3::from_array(moments)) * matrix.transpose();
        let turned =
            FreeMotion::new(tensor, start() * turn.conjugate(), turn * DVec3::from_array(omega)).expect("a valid body");
        for time in [0.2, 5.0] {
            let (a, b) = (straight.at(time), turned.at(time));
            let off = attitude_error(a.orientation, b.orientation * turn)
                .max(relative_error(turn.conjugate() * b.angular_velocity_body, a.angular_velocity_body));
            assert!(off <= BOUND, "{name} at {time} s: {off:.2e}");
        }
    }
}

#[test]
fn the_motion_closes_after_its_periods() {
    for (name, moments, omega, polhode) in BRANCHES {
        let body = motion(moments, omega);
        let initial = body.at(0.0);
        let Some(period) = body.polhode_period() else {
            assert!(matches!(polhode, Polhode::Point | Polhode::Separatrix), "{name}");
            continue;
        };
        // A rounded period is off by an ulp of itself, in which the body turns by |omega| times that.
        let slack = BOUND + 4.0 * f64::EPSILON * period * initial.angular_velocity_body.length();
        let after = body.at(period);
        let off = relative_error(after.angular_velocity_body, initial.angular_velocity_body);
        assert!(off <= slack, "{name}: angular velocity off by {off:.2e} after {period} s");
        // The orientation is turned about the angular momentum by the mean rate times the period.
        let axis = initial.angular_momentum_world.normalize();
        let angle = (body.mean_precession_rate() * period) % TAU;
        let turned = DQuat::from_axis_angle(axis, angle) * initial.orientation;
        let off = attitude_error(after.orientation, turned);
        assert!(off <= slack + 4.0 * f64::EPSILON * body.mean_precession_rate() * period, "{name}: {off:.2e}");
        if let Some(nutation) = body.nutation_period() {
            assert_eq!(nutation, 0.5 * period, "{name}");
            assert!(body.modulus() > 0.0, "{name}");
        }
    }
}

#[test]
fn the_spin_about_the_middle_axis_flips_when_it_says() {
    for (name, moments, omega, polhode) in BRANCHES {
        let body = motion(moments, omega);
        let span = body.polhode_period().map_or(10.0, |period| 2.25 * period);
        let flips: Vec<f64> = body.flips(-span, span).collect();
        let expected = match polhode {
            Polhode::Point => 0..=0,
            Polhode::Separatrix => 1..=1,
            _ => 9..=9,
        };
        assert!(expected.contains(&flips.len()), "{name}: {} flips within {span} s", flips.len());
        let largest = body.at(0.0).angular_velocity_body.length();
        for pair in flips.windows(2) {
            assert!(pair[0] < pair[1], "{name}: in order");
        }
        for flip in flips {
            let spin = body.at(flip).angular_velocity_body.y.abs();
            let slack = BOUND + 8.0 * f64::EPSILON * (span + 1.0) * largest;
            assert!(spin <= slack * largest, "{name}: spin {spin:.2e} about the middle axis at its flip");
        }
    }
}

#[test]
fn the_mean_precession_lies_between_the_extremes_of_its_rate() {
    // d psi/dt = L (I_a w_a^2 + I_2 w_2^2)/(L_a^2 + L_2^2) lies between L/I_2 and L/I_a.
    for (name, moments, omega, polhode) in BRANCHES {
        let body = motion(moments, omega);
        let length = body.at(0.0).angular_momentum_world.length();
        let (low, high) = match polhode {
            Polhode::AboutThird => (length / moments[1], length / moments[0]),
            Polhode::AboutFirst => (length / moments[2], length / moments[1]),
            Polhode::Separatrix => (length / moments[1], length / moments[1]),
            Polhode::Point => {
                let spin = DVec3::from_array(omega).length();
                (spin, spin)
            }
        };
        let rate = body.mean_precession_rate();
        let slack = 1e-14 * high;
        assert!(rate >= low - slack && rate <= high + slack, "{name}: {low} <= {rate} <= {high}");
    }
}

#[test]
fn a_step_of_a_grid_is_an_exact_product() {
    let body = motion([1.0, 1.5, 2.0], [0.2, -0.3, 1.0]);
    for (index, dt) in [(8, 0.125), (8_000_000_000, 0.125), (3, 1e300), (u64::MAX, 0.5), (0, 0.1)] {
        let exact = body.at_exactly(Time::of_step(index, dt));
        let product = index as f64 * dt;
        if index == u64::MAX {
            // 2^64 - 1 is no f64; twice the half step is the whole one less.
            assert_ne!(exact.orientation, body.at(product).orientation);
        } else if index > 0 && dt < 1e9 {
            assert_eq!(exact.orientation, body.at(product).orientation, "{index} steps of {dt} s");
        }
    }
    // 0.1 is 3602879701896397/2^55: the billionth step is not at 1e8 s, and an f64 cannot tell by how much.
    let off = 1e9 * (3_602_879_701_896_397.0 - 0.1 * 55_f64.exp2()) * (-55_f64).exp2();
    let exact = body.at_exactly(Time::of_step(1_000_000_000, 0.1));
    assert!(off.abs() < 1e-8 && difference(&exact, &body.at(1e8)) < 1e-7, "{off:e}");
}

#[test]
fn a_time_that_is_no_number_gives_no_state() {
    for time in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let state = motion([1.0, 1.5, 2.0], [0.2, -0.3, 1.0]).at(time);
        assert!(state.orientation.is_nan() && state.angular_velocity_body.is_nan(), "{time}: {state:?}");
    }
}

#[test]
fn an_invalid_body_is_refused() {
    for (moments, omega) in [([1.0, 2.0, 4.0], [0.0, 0.0, 1.0]), ([1.0, 2.0, 2.5], [f64::NAN, 0.0, 1.0])] {
        let refused = FreeMotion::new(DVec3::from_array(moments), DQuat::IDENTITY, DVec3::from_array(omega));
        assert!(matches!(refused, Err(polhode::Error::Body { body: 0, .. })), "{moments:?}, {omega:?}: {refused:?}");
    }
}

/// rk4 approaches the closed form at its own order: two roads, one answer.
#[test]
fn rk4_converges_to_the_closed_form_at_order_four() {
    const BODIES: [([f64; 3], [f64; 3]); 5] = [
        ([1.0, 1.5, 2.0], [0.2, -0.3, 1.0]),
        ([1.0, 1.5, 2.0], [1.0, -0.3, 0.2]),
        ([1.0, 2.0, 3.0], [0.1, 1.0, 0.1]),
        ([1.0, 1.0, 1.5], [0.3, -0.2, 1.0]),
        ([1.0, 2.0, 2.25], [0.75, 1.0, -1.0]),
    ];
    let end = 10.0;
    let engine = Engine::cpu();
    let ensemble = Ensemble::from_fn(BODIES.len(), |body| {
        (DVec3::from_array(BODIES[body].0), start(), DVec3::from_array(BODIES[body].1))
    })
    .expect("valid bodies");
    let steps = [0.04, 0.02, 0.01, 0.005, 0.0025];
    let mut errors = vec![Vec::new(); BODIES.len()];
    for dt in steps {
        let scene = Scene::new(ensemble.clone()).until(end).outputs(Outputs::End).pinned(Method::Rk4, dt, None);
        let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
        for (body, errors) in errors.iter_mut().enumerate() {
            let expected = FreeMotion::of_body(&ensemble, body).at(end);
            errors.push(attitude_error(record.final_state().orientation(body), expected.orientation));
        }
    }
    for (body, errors) in errors.iter().enumerate() {
        let count = steps.len() as f64;
        let points: Vec<(f64, f64)> = steps.iter().zip(errors).map(|(dt, error)| (dt.ln(), error.ln())).collect();
        let (x, y) = points.iter().fold((0.0, 0.0), |sum, point| (sum.0 + point.0 / count, sum.1 + point.1 / count));
        let slope = points.iter().map(|point| (point.0 - x) * (point.1 - y)).sum::<f64>()
            / points.iter().map(|point| (point.0 - x).powi(2)).sum::<f64>();
        assert!((slope - 4.0).abs() <= 0.1, "body {body}: order {slope:.3}, errors {errors:?}");
    }
}

/// The bodies of all branches, one after the other, as an ensemble of `count`.
fn ensemble(count: usize) -> Ensemble {
    Ensemble::from_fn(count, |body| {
        let (_, moments, omega, _) = BRANCHES[body % BRANCHES.len()];
        (DVec3::from_array(moments), start(), DVec3::from_array(omega))
    })
    .expect("valid bodies")
}

#[test]
fn a_run_of_free_bodies_takes_the_closed_form_by_itself() {
    let bodies = ensemble(331);
    let times = vec![0.0, 0.5, 7.0, 1e5];
    let engines = [Engine::cpu(), Engine::cpu_scalar(), common::gpu()];
    for (accuracy, precision, bound) in [(1e-6, Precision::F32, CLOSED_FORM_F32), (1e-9, Precision::F64, BOUND)] {
        for engine in &engines {
            let scene = Scene::new(bodies.clone())
                .until(1e5)
                .outputs(Outputs::Times(times.clone()))
                .accuracy(Accuracy::attitude(accuracy));
            let plan = Plan::new(&scene, engine).expect("a plan");
            assert!(plan.is_closed_form());
            assert_eq!((plan.precision(), plan.steps()), (precision, 0));
            let record = engine.run(&plan).expect("a run");
            assert_eq!(record.trust().body_steps, 0);
            assert_eq!(record.trust().failed_bodies, Vec::<usize>::new());
            for (snapshot, &time) in record.snapshots().iter().zip(&times) {
                for body in 0..bodies.len() {
                    let expected = FreeMotion::of_body(&bodies, body).at(time);
                    let off = attitude_error(snapshot.orientation(body), expected.orientation)
                        .max(relative_error(snapshot.angular_velocity_body(body), expected.angular_velocity_body));
                    let name = BRANCHES[body % BRANCHES.len()].0;
                    assert!(off <= bound, "{engine:?}: {name} in {precision} at {time} s: {off:.2e}");
                }
            }
        }
    }
}

#[test]
fn the_long_way_gives_the_same_answer() {
    let engine = Engine::cpu();
    let rods: Vec<_> = (0..BRANCHES.len()).filter(|&body| !BRANCHES[body].0.contains("rod")).collect();
    let bodies = Ensemble::from_fn(rods.len(), |body| {
        let (_, moments, omega, _) = BRANCHES[rods[body]];
        (DVec3::from_array(moments), start(), DVec3::from_array(omega))
    })
    .expect("valid bodies");
    let target = 1e-7;
    let scene = Scene::new(bodies.clone()).until(5.0).accuracy(Accuracy::attitude(target)).skipping(false);
    let plan = Plan::new(&scene, &engine).expect("a plan");
    assert!(!plan.is_closed_form() && plan.steps() > 0);
    let record = engine.run(&plan).expect("a run");
    for (body, &branch) in rods.iter().enumerate() {
        let expected = FreeMotion::of_body(&bodies, body).at(5.0);
        let off = attitude_error(record.final_state().orientation(body), expected.orientation);
        assert!(off <= target, "{}: {off:.2e} rad", BRANCHES[branch].0);
    }
    // A pinned step is stepped as well.
    let pinned = Scene::new(bodies).until(5.0).pinned(Method::Rk4, 0.01, None);
    assert!(!Plan::new(&pinned, &engine).expect("a plan").is_closed_form());
}

/// The states of all bodies of an ensemble, as an engine holds them.
fn states(engine: &Engine, bodies: &Ensemble, precision: Precision, time: f64) -> Vec<[f64; 7]> {
    let (_, rows) = polhode::kernel::free_motion::AnyRows::prepare(bodies, precision).expect("enough memory");
    let mut session = engine.start_free(rows).expect("started");
    session.advance_to(End::at(-3.0), &mut unobserved).expect("evaluated elsewhere first");
    session.advance_to(End::at(time), &mut unobserved).expect("evaluated");
    session.read(0..bodies.len()).expect("read").value
}

#[test]
fn a_body_does_not_depend_on_its_neighbours() {
    for engine in [Engine::cpu(), Engine::cpu_scalar(), common::gpu()] {
        for precision in Precision::ALL {
            let many = ensemble(331);
            let together = states(&engine, &many, precision, 12.5);
            // Another place, another lane, other neighbours: every seventh body alone, backwards.
            let places: Vec<usize> = (0..331).rev().step_by(7).collect();
            let few = Ensemble::from_fn(places.len(), |body| {
                (
                    many.inertia()[places[body]],
                    many.orientation()[places[body]],
                    many.angular_velocity_body()[places[body]],
                )
            })
            .expect("valid bodies");
            for (found, &place) in states(&engine, &few, precision, 12.5).iter().zip(&places) {
                assert_eq!(found, &together[place], "{engine:?} in {precision}, body {place}");
            }
        }
    }
}

#[test]
fn no_bodies_and_no_number_are_handled() {
    for engine in [Engine::cpu(), common::gpu()] {
        for precision in Precision::ALL {
            assert_eq!(states(&engine, &Ensemble::new(), precision, 1.0), Vec::<[f64; 7]>::new());
            let (_, rows) =
                polhode::kernel::free_motion::AnyRows::prepare(&ensemble(3), precision).expect("enough memory");
            let mut session = engine.start_free(rows).expect("started");
            for time in [f64::NAN, f64::INFINITY] {
                let refused = session.advance_to(End::at(time), &mut unobserved);
                assert!(matches!(refused, Err(polhode::Error::Setting { field: "time", .. })), "{time}: {refused:?}");
            }
        }
    }
}
