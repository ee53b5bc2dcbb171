//! The crate's own sine and cosine against the host's in more digits, over the stated ranges.

use polhode::math::real::{Scalar, sin_cos, sin_cos_eighth};

/// The stated bound, in units of the spacing of numbers next to 1 from above.
const ULPS_OF_ONE: f64 = 1.0;

/// The largest error of the f32 pair over every f32 from `start` to `end`, both positive, every `stride`-th bit pattern.
fn largest_error_f32(start: f32, end: f32, stride: usize) -> (f64, f32) {
    let mut worst = (0.0, start);
    for bits in (start.to_bits()..=end.to_bits()).step_by(stride) {
        let x = f32::from_bits(bits);
        for x in [x, -x] {
            let (sin, cos) = sin_cos(x);
            let (true_sin, true_cos) = f64::from(x).sin_cos();
            let error = (f64::from(sin) - true_sin).abs().max((f64::from(cos) - true_cos).abs());
            if error > worst.0 {
                worst = (error, x);
            }
        }
    }
    worst
}

#[test]
fn f32_error_is_below_one_ulp_of_one_up_to_1024() {
    // Every number from 2^-8 to 1024 whose bit pattern is a multiple of 5: 30 million, both signs.
    let (error, x) = largest_error_f32(2.0_f32.powi(-8), 1024.0, 5);
    assert!(error <= ULPS_OF_ONE * f64::from(f32::EPSILON), "error {error:e} at {x:e}");
}

#[test]
#[ignore = "every f32 in the range, two minutes: cargo test --release --test truth sin_cos -- --ignored"]
fn f32_error_is_below_one_ulp_of_one_for_every_number() {
    let (error, x) = largest_error_f32(f32::MIN_POSITIVE, 1024.0, 1);
    assert!(error <= ULPS_OF_ONE * f64::from(f32::EPSILON), "error {error:e} at {x:e}");
}

#[test]
fn f32_sine_keeps_its_relative_accuracy_towards_zero() {
    for exponent in 8..120 {
        let x = 1.1_f32 * 2.0_f32.powi(-exponent);
        let (sin, _) = sin_cos_eighth(x);
        let relative = (f64::from(sin) / f64::from(x).sin() - 1.0).abs();
        assert!(relative <= 2.0 * f32::UNIT_ROUNDOFF, "relative error {relative:e} at {x:e}");
    }
}

#[test]
fn f64_error_is_below_one_ulp_of_one_up_to_2_to_the_20() {
    // The host's own sine is good to less than an ulp, which is added to the bound.
    const HOST: f64 = 0.5;
    let mut worst = (0.0, 0.0);
    for i in 0..4_000_000_u64 {
        // A golden-ratio walk covers [0, 1) evenly; squared, it favours the small numbers.
        let u = (i as f64 * 0.618_033_988_749_894_9).fract();
        let x = (u * u - 0.25) * 2.0_f64.powi(21) / 1.5;
        for x in [x, x * 2.0_f64.powi(-16)] {
            let (sin, cos) = sin_cos(x);
            let error = (sin - x.sin()).abs().max((cos - x.cos()).abs());
            if error > worst.0 {
                worst = (error, x);
            }
        }
    }
    assert!(worst.0 <= (ULPS_OF_ONE + HOST) * f64::EPSILON, "error {:e} at {:e}", worst.0, worst.1);
}

#[test]
fn sine_and_cosine_are_exact_at_zero() {
    assert_eq!(sin_cos(0.0_f64), (0.0, 1.0));
    assert_eq!(sin_cos(0.0_f32), (0.0, 1.0));
}
