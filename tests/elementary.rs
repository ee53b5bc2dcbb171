//! The kernels' elementary functions over every f32 argument that matters, and on dense grids in f64; phases against
//! long multiplication; double-double arithmetic against exact integers.

use std::thread;

use polhode::double_double::DoubleDouble;
use polhode::elementary::{EXP_LEAST, Turns, exp_negative, sin_cos_turns, turned_by};
use polhode::phase::{Rate, Time, fraction_of_turn, phase_at, phase_turns};
use polhode::real::{Scalar, sin_cos_eighth};

/// The stated bound of sines and cosines.
const SIN_COS_F32: f64 = 1.25e-7;
const SIN_COS_F64: f64 = f64::EPSILON;
/// The stated relative bound of the exponential: 2 units of roundoff.
const EXP_F32: f64 = 2.0 * f32::UNIT_ROUNDOFF;
const EXP_F64: f64 = 2.0 * f64::UNIT_ROUNDOFF;
/// What the reference in f64 may itself be off by, against which f64 is tested: one ulp of 1, or of the result.
const REFERENCE_F64: f64 = f64::EPSILON;

/// The largest value of `error` over `0..count`, by all cores.
fn largest(count: u32, error: impl Fn(u32) -> f64 + Sync) -> f64 {
    let threads = thread::available_parallelism().map_or(1, |threads| threads.get() as u32);
    let error = &error;
    thread::scope(|scope| {
        let parts: Vec<_> = (0..threads)
            .map(|part| {
                scope.spawn(move || {
                    let (start, end) = (u64::from(count) * u64::from(part), u64::from(count) * u64::from(part + 1));
                    let range = (start / u64::from(threads)) as u32..(end / u64::from(threads)) as u32;
                    range
                        .map(error)
                        .fold(0.0, |largest: f64, x| if x.is_nan() { f64::INFINITY } else { largest.max(x) })
                })
            })
            .collect();
        parts.into_iter().map(|part| part.join().expect("no panic")).fold(0.0, f64::max)
    })
}

#[test]
fn sines_of_every_f32_residual_are_within_their_bound() {
    // A residual comes from the upper 32 bits of a phase: 2^30 values, of which the negative ones mirror the others.
    let worst = largest((1 << 29) + 1, |bits| {
        let residual = f32::from_fixed_point(i64::from(bits) << 32);
        let (sin, cos) = sin_cos_turns(Turns { quadrant: 0.0, residual });
        // The reference is the f64 polynomial, tested below, at the residual that was meant.
        let (exact_sin, exact_cos) = sin_cos_eighth(f64::from(bits) * (-32_f64).exp2() * std::f64::consts::TAU);
        (f64::from(sin) - exact_sin).abs().max((f64::from(cos) - exact_cos).abs())
    });
    assert!(worst <= SIN_COS_F32, "{worst:e}");
}

#[test]
fn sines_are_odd_and_cosines_even_in_the_residual() {
    for bits in (0..1 << 29).step_by(65_537) {
        let residual = f32::from_fixed_point(i64::from(bits) << 32);
        let at = |residual| sin_cos_turns(Turns { quadrant: 0.0, residual });
        let ((sin, cos), (mirrored_sin, mirrored_cos)) = (at(residual), at(-residual));
        assert_eq!((-sin, cos), (mirrored_sin, mirrored_cos), "{residual}");
    }
}

#[test]
fn quadrants_turn_sines_into_cosines_exactly() {
    fn check<T: Scalar>() {
        for step in -1000..=1000 {
            let residual = T::from_f64(f64::from(step) / 8000.0);
            let (sin, cos) = sin_cos_turns(Turns { quadrant: T::from_f64(0.0), residual });
            for (quadrant, expected) in [(1.0, (cos, -sin)), (2.0, (-sin, -cos)), (3.0, (-cos, sin))] {
                let found = sin_cos_turns(Turns { quadrant: T::from_f64(quadrant), residual });
                assert!(found == expected, "quadrant {quadrant}, step {step}: {found:?}, {expected:?} expected");
            }
        }
    }
    check::<f32>();
    check::<f64>();
}

#[test]
fn sines_of_f64_residuals_are_within_an_ulp_of_one() {
    let count = 20_000_001;
    let worst = largest(count, |index| {
        let residual = (f64::from(index) / f64::from(count - 1) - 0.5) * 0.25;
        let (sin, cos) = sin_cos_turns(Turns { quadrant: 0.0, residual });
        let (exact_sin, exact_cos) = (residual * std::f64::consts::TAU).sin_cos();
        (sin - exact_sin).abs().max((cos - exact_cos).abs())
    });
    assert!(worst <= SIN_COS_F64 + REFERENCE_F64, "{worst:e}");
}

#[test]
fn a_turned_angle_is_reduced_again_without_loss() {
    fn check<T: Scalar>() {
        for quadrant in 0..4 {
            for a in -64..=64 {
                for b in -64..=64 {
                    let [residual, turns] = [a, b].map(|n| T::from_f64(f64::from(n) / 512.0));
                    let turned = turned_by(Turns { quadrant: T::from_f64(f64::from(quadrant)), residual }, turns);
                    let (quadrant_found, residual_found) = (turned.quadrant.to_f64(), turned.residual.to_f64());
                    assert!([0.0, 1.0, 2.0, 3.0].contains(&quadrant_found) && residual_found.abs() <= 0.125);
                    let whole = f64::from(quadrant) / 4.0 + f64::from(a + b) / 512.0;
                    let found = quadrant_found / 4.0 + residual_found;
                    assert_eq!((whole - found).rem_euclid(1.0), 0.0, "{quadrant}, {a}, {b}: {turned:?}");
                }
            }
        }
    }
    check::<f32>();
    check::<f64>();
}

#[test]
fn exponentials_of_every_f32_are_within_two_roundings() {
    // From -2^-27, above which the result is 1, to the least argument, by the bits of the absolute value.
    let (first, last) = ((-27_f32).exp2().to_bits(), (-EXP_LEAST as f32).to_bits());
    let worst = largest(last - first + 1, |bits| {
        let x = -f32::from_bits(first + bits);
        let exact = f64::from(x).exp();
        (f64::from(exp_negative(x)) - exact).abs() / exact
    });
    assert!(worst <= EXP_F32, "{worst:e}");
    for x in [0.0, -0.0, -1e-30, -f32::MIN_POSITIVE, -1e-9] {
        assert_eq!(exp_negative::<f32>(x), 1.0, "{x:e}");
    }
}

#[test]
fn exponentials_of_f64_are_within_two_roundings() {
    let count = 20_000_001;
    let worst = largest(count, |index| {
        let x = EXP_LEAST * f64::from(index) / f64::from(count - 1);
        let exact = x.exp();
        (exp_negative(x) - exact).abs() / exact
    });
    assert!(worst <= EXP_F64 + REFERENCE_F64, "{worst:e}");
    assert_eq!(exp_negative::<f64>(0.0), 1.0);
}

#[test]
fn exponentials_below_the_least_argument_stay_at_its_value() {
    for x in [-86.5, -1e4, -1e30, f64::MIN] {
        assert_eq!(exp_negative(x), exp_negative(EXP_LEAST), "{x}");
        assert_eq!(exp_negative(x.max(f64::from(f32::MIN)) as f32), exp_negative(EXP_LEAST as f32), "{x}");
    }
    assert!(exp_negative(EXP_LEAST as f32) >= f32::MIN_POSITIVE);
}

/// splitmix64.
fn draws(mut state: u64) -> impl FnMut() -> u64 {
    move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
}

/// `fraction · mantissa · 2^(exponent − 64)` modulo 2^64 by shifts and additions in 512 bits.
fn fraction_by_shifts(fraction: u128, mantissa: u64, exponent: i64) -> u64 {
    let mut product = [false; 512];
    for place in 0..64 {
        if mantissa >> place & 1 == 1 {
            let mut carry = false;
            for bit in 0..256 - place {
                let added = bit < 128 && fraction >> bit & 1 == 1;
                let old = product[bit + place];
                product[bit + place] = old ^ added ^ carry;
                carry = (old & added) | (old & carry) | (added & carry);
            }
        }
    }
    (0..64).fold(0, |window, bit: i64| {
        let from = bit + 64 - exponent;
        let set = (0..512).contains(&from) && product[from as usize];
        window | u64::from(set) << bit
    })
}

#[test]
fn phases_are_the_bits_of_the_long_product() {
    let mut draw = draws(1);
    for row in 0_i64..2000 {
        let extreme = |x: u64| if row % 5 == 0 { u64::MAX << (x % 64) } else { x };
        let fraction = u128::from(extreme(draw())) << 64 | u128::from(extreme(draw()));
        let mantissa = extreme(draw()) >> (row % 13);
        for exponent in [
            -1100,
            -200,
            -129,
            -128,
            -127,
            -65,
            -64,
            -63,
            -1,
            0,
            1,
            31,
            32,
            63,
            64,
            65,
            96,
            127,
            128,
            129,
            row % 300 - 150,
        ] {
            let (found, expected) =
                (fraction_of_turn(fraction, mantissa, exponent), fraction_by_shifts(fraction, mantissa, exponent));
            assert_eq!(found, expected, "{fraction:#x} * {mantissa:#x} * 2^({exponent} - 64)");
        }
    }
}

#[test]
fn phases_run_backwards_with_time_and_with_negative_rates() {
    let mut draw = draws(2);
    for _ in 0..1000 {
        let fraction = u128::from(draw()) << 64 | u128::from(draw());
        let start = draw();
        let seconds = (draw() >> 11) as f64 * (-30_f64).exp2();
        let rate = |negative| Rate { fraction, exponent: 3, negative };
        let at = |negative, seconds: f64| phase_at(start, rate(negative), Time::from_seconds(seconds));
        assert_eq!(at(true, seconds), at(false, -seconds));
        assert_eq!(at(true, -seconds), at(false, seconds));
        assert_eq!(at(false, seconds).wrapping_sub(start), start.wrapping_sub(at(false, -seconds)));
    }
}

#[test]
fn a_time_is_what_the_f64_says() {
    for seconds in [0.0, -0.0, 1.0, -1.5, 1e300, -1e-300, f64::MIN_POSITIVE, 5e-324, f64::MAX] {
        let time = Time::from_seconds(seconds);
        let half = time.exponent / 2;
        let value = time.mantissa as f64 * f64::from(half).exp2() * f64::from(time.exponent - half).exp2();
        assert_eq!(if time.negative { -value } else { value }, seconds);
    }
}

#[test]
fn a_phase_is_reduced_to_the_nearest_quarter_turn() {
    let mut draw = draws(3);
    let edges = (0_u64..8).flat_map(|eighth| [-1_i64, 0, 1].map(|by| (eighth << 61).wrapping_add(by as u64)));
    for phase in edges.chain((0..1000).map(|_| draw())) {
        let angle = phase_turns::<f64>(phase);
        assert!(
            [0.0, 1.0, 2.0, 3.0].contains(&angle.quadrant) && angle.residual.abs() <= 0.125,
            "{phase:#x}: {angle:?}"
        );
        let quarter = (angle.quadrant as u64) << 62;
        let left = phase.wrapping_sub(quarter) as i64;
        assert_eq!(angle.residual, left as f64 * (-64_f64).exp2(), "{phase:#x}");
        let narrow = phase_turns::<f32>(phase);
        assert_eq!(f64::from(narrow.quadrant), angle.quadrant, "{phase:#x}");
        // The lower 32 bits are cut off, and 1/8 turn is rounded to 24 bits.
        let slack = (-32_f64).exp2() + (-28_f64).exp2();
        assert!((f64::from(narrow.residual) - angle.residual).abs() <= slack, "{phase:#x}");
    }
}

/// The exact value of a · b or a + b of doubles that are integers, in two words.
fn exact(x: i128) -> (f64, f64) {
    let high = x as f64;
    (high, (x - high as i128) as f64)
}

#[test]
fn sums_and_products_of_two_words_are_exact() {
    let mut draw = draws(4);
    for _ in 0..100_000 {
        let (a, b) = ((draw() >> 11) as i64 - (1 << 52), (draw() >> (11 + draw() % 40)) as i64);
        let product = DoubleDouble::product_of(a as f64, b as f64);
        assert_eq!((product.high, product.low), exact(i128::from(a) * i128::from(b)), "{a} * {b}");
        let (x, y) = (i128::from(a) << 40, i128::from(b));
        let sum = DoubleDouble::sum_of(x as f64, y as f64);
        assert_eq!((sum.high, sum.low), exact(x + y), "{x} + {y}");
    }
}

/// u² for double-double arithmetic.
const U2: f64 = f64::UNIT_ROUNDOFF * f64::UNIT_ROUNDOFF;

/// |x| / |scale| of a double-double remainder.
fn relative(x: DoubleDouble, scale: f64) -> f64 {
    x.to_f64().abs() / scale.abs()
}

#[test]
fn double_double_operations_undo_each_other() {
    let mut draw = draws(5);
    let mut number = || {
        let high = (draw() >> 11) as f64 * (-40_f64).exp2() + 1.0;
        DoubleDouble::sum_of(high, high * (draw() as f64 * (-64_f64).exp2() - 0.5) * f64::EPSILON)
    };
    for _ in 0..100_000 {
        let (a, b) = (number(), number());
        // Each operation's own bound, and that of the one that undoes it.
        let quotient = relative(a / b * b - a, a.high);
        assert!(quotient <= (15.0 + 5.0 + 3.0) * U2, "{a:?} / {b:?}: {quotient:e}");
        let root = a.sqrt();
        let square = relative(root * root - a, a.high);
        assert!(square <= (2.0 * 4.0 + 5.0 + 3.0) * U2, "sqrt {a:?}: {square:e}");
        assert!(relative(root.squared() - root * root, a.high) <= (5.0 + 5.0 + 3.0) * U2, "{root:?} squared");
        let sum = relative((a + b - a) - b, a.high.max(b.high));
        assert!(sum <= (3.0 * 2.0 + 3.0) * 2.0 * U2, "{a:?} + {b:?}: {sum:e}");
        let distributed = relative((a + b) * b - (a * b + b * b), (a.high + b.high) * b.high);
        assert!(distributed <= (3.0 + 5.0 + 5.0 + 5.0 + 3.0 + 3.0) * U2, "{a:?}, {b:?}: {distributed:e}");
    }
    assert_eq!(DoubleDouble::<f64>::from(0.0).sqrt().to_f64(), 0.0);
}
