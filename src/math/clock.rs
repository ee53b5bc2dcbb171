//! Exact time inside kernels, and phases that advance with it.
//!
//! A running sum of step sizes in `f32` is wrong by 4e-5 s after a thousand steps, and a phase formed from a rounded time is
//! wrong by half an ulp of itself. Here a time is an integer number of ticks, so that n steps are n times one step
//! without rounding, and a rate is a fixed-point fraction of a turn per tick, so that their product modulo one turn is an
//! integer product modulo a power of two. The error does not grow with the time beyond the resolution of the rate's last bit:
//! 2⁻⁶⁴ turn over the whole span.
//!
//! Twin: `shaders/clock.wgsl`, where the same integers are words of 32 bits; both give the same bits.

use crate::math::real::{Real, Scalar};
use crate::math::vector::TwoWords;

/// Number of 16-bit digits in which columns store a rate, lowest first; each digit is exact in either precision.
pub const RATE_DIGITS: usize = 8;

/// The time of the next step of a session, counted without rounding.
///
/// The unit is 2⁻⁶⁴ tick; a tick is a power of two of a second such that the whole span has less than 2⁶¹ ticks. A step size is
/// an `f64`, so it is a multiple of the unit if it is longer than 2⁻⁷³ of the span; a shorter one is rounded to the unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clock {
    /// A tick is 2^`tick_exponent` s.
    tick_exponent: i32,
    /// Time since the initial state, in units of 2⁻⁶⁴ tick.
    now: u128,
    /// Steps since the initial state.
    step: u64,
}

impl Clock {
    /// The clock of a run over `span` seconds, at its start. `span` is finite and not negative.
    pub fn new(span: f64) -> Self {
        let exponent = if span > 0.0 { crate::math::power_of_two::binary_exponent(span) } else { 0 };
        Self { tick_exponent: exponent - 60, now: 0, step: 0 }
    }

    /// The clock after `steps` steps of `dt` seconds.
    #[must_use]
    pub fn after(self, dt: f64, steps: u64) -> Self {
        let now = self.now.wrapping_add(self.units(dt).wrapping_mul(u128::from(steps)));
        Self { now, step: self.step.wrapping_add(steps), ..self }
    }

    /// Steps since the initial state.
    pub fn step(&self) -> u64 {
        self.step
    }

    /// The time since the initial state, in units of 2⁻⁶⁴ tick.
    pub fn now(&self) -> u128 {
        self.now
    }

    /// The time since the initial state in seconds, rounded.
    pub fn seconds(&self) -> f64 {
        crate::math::power_of_two::scaled_by_power_of_two(self.now as f64, self.tick_exponent - 64)
    }

    /// The clock at `time` seconds after the initial state, rounded to the unit.
    #[must_use]
    pub fn at(self, time: f64) -> Self {
        Self { now: self.units(time), ..self }
    }

    /// The seconds from here to `later`, in two words; 0 if it is not later.
    pub(crate) fn seconds_until(&self, later: &Clock) -> (f64, f64) {
        // Below 2^125, as is a whole run.
        let units = later.now.saturating_sub(self.now);
        let value = units as f64;
        let residue = (units as i128).wrapping_sub(value as i128) as f64;
        let seconds = |units: f64| crate::math::power_of_two::scaled_by_power_of_two(units, self.tick_exponent - 64);
        (seconds(value), seconds(residue))
    }

    /// Whole ticks since the initial state.
    pub fn ticks(&self) -> u64 {
        (self.now >> 64) as u64
    }

    /// The whole ticks in `time` seconds, which must not be negative; at most 2⁶², twice as many as a run has.
    pub(crate) fn ticks_at(&self, time: f64) -> u64 {
        const MOST: u64 = 1 << 62;
        if time * self.ticks_per_second() < MOST as f64 { (self.units(time) >> 64) as u64 } else { MOST }
    }

    /// Ticks in a second, a power of two.
    pub fn ticks_per_second(&self) -> f64 {
        crate::math::power_of_two::scaled_by_power_of_two(1.0, -self.tick_exponent)
    }

    /// A step of `dt` seconds in units of 2⁻⁶⁴ tick.
    pub fn units(&self, dt: f64) -> u128 {
        let (mantissa, exponent) = parts(dt);
        shifted(u128::from(mantissa), exponent + 64 - self.tick_exponent)
    }

    /// The rate of a phase that turns by `high + low` rad/s, in units of 2⁻¹²⁸ turn per tick, modulo one turn per tick.
    ///
    /// A negative rate is its complement, as phases are taken modulo one turn. The product with 1/2π uses 130 bits of it, so the relative
    /// error is below 2⁻¹²⁷ of `high`; what is cut off is below 2⁻¹²⁸ turn per tick.
    pub fn rate(&self, high: f64, low: f64) -> u128 {
        self.rate_of(high).wrapping_add(self.rate_of(low))
    }

    fn rate_of(&self, radians_per_second: f64) -> u128 {
        let (mantissa, exponent) = parts(radians_per_second.abs());
        let size = turns_of(mantissa, exponent + self.tick_exponent + 128);
        if radians_per_second < 0.0 { size.wrapping_neg() } else { size }
    }
}

/// A finite number above or equal to zero as mantissa · 2^exponent.
fn parts(x: f64) -> (u64, i32) {
    let bits = x.to_bits();
    let (field, fraction) = (((bits >> 52) & 0x7ff) as i32, bits & ((1 << 52) - 1));
    if field == 0 { (fraction, -1074) } else { (fraction | (1 << 52), field - 1075) }
}

/// x · 2^n modulo 2¹²⁸, rounded down.
fn shifted(x: u128, n: i32) -> u128 {
    match n {
        0..128 => x << n,
        -127..0 => x >> -n,
        _ => 0,
    }
}

/// ⌊2¹³⁰/2π⌋.
const INVERSE_TAU: u128 = 0xa2f9_836e_4e44_1529_fc27_57d1_f534_ddc0;

/// mantissa · 2^exponent / 2π modulo 2¹²⁸, rounded down.
fn turns_of(mantissa: u64, exponent: i32) -> u128 {
    // The product of 53 by 128 bits, as 128 bits above 64.
    let low = u128::from(mantissa) * (INVERSE_TAU & u128::from(u64::MAX));
    let high = u128::from(mantissa) * (INVERSE_TAU >> 64) + (low >> 64);
    let shift = exponent - 130;
    // high · 2^64 + the lower word of low, shifted; the two parts share no bit.
    let upper = shifted(high, shift + 64);
    let lower = shifted(low & u128::from(u64::MAX), shift);
    upper.wrapping_add(lower)
}

/// Whole ticks from the initial state to the start of a step.
#[derive(Clone, Copy, Debug)]
pub enum Ticks {
    /// All lanes start together.
    Equal(u64),
    /// Each lane has its own start.
    Own([u64; MOST_LANES]),
}

/// Lanes of the widest vector.
pub(crate) const MOST_LANES: usize = 16;

impl Ticks {
    /// The ticks of one lane.
    #[inline(always)]
    pub fn of_lane(&self, lane: usize) -> u64 {
        match self {
            Ticks::Equal(ticks) => *ticks,
            Ticks::Own(ticks) => ticks[lane],
        }
    }
}

/// The exact phases at the start of a step, in turns in [−½, ½], rounded to the precision's relative accuracy of at most half a
/// turn.
#[inline(always)]
pub fn phases_at<R: Real>(fraction: Fraction<'_>, ticks: &Ticks) -> R {
    match (fraction, ticks) {
        (Fraction::Shared(fraction), &Ticks::Equal(ticks)) => {
            let turns = turns::<R::Scalar>(fraction, ticks);
            R::from_lanes(|_| turns)
        }
        (Fraction::Shared(fraction), Ticks::Own(_)) => {
            R::from_lanes(|lane| turns::<R::Scalar>(fraction, ticks.of_lane(lane)))
        }
        (Fraction::PerBody(fractions), _) => {
            let fractions = &fractions[..R::LANES];
            R::from_lanes(|lane| turns::<R::Scalar>(fractions[lane], ticks.of_lane(lane)))
        }
    }
}

/// The time since the initial state, s, rounded.
#[inline(always)]
pub(crate) fn seconds_at<R: Real>(ticks: &Ticks, ticks_per_second: f64) -> R {
    match *ticks {
        Ticks::Equal(ticks) => {
            let seconds = seconds::<R::Scalar>(ticks, ticks_per_second);
            R::from_lanes(|_| seconds)
        }
        Ticks::Own(_) => R::from_lanes(|lane| seconds::<R::Scalar>(ticks.of_lane(lane), ticks_per_second)),
    }
}

#[inline(always)]
fn seconds<T: Scalar>(ticks: u64, ticks_per_second: f64) -> T {
    let [upper, lower] = seconds_per_word(ticks_per_second).map(T::splat);
    let (high, low) = ((ticks >> 32) as u32, ticks as u32);
    T::from_f64(f64::from(high)).mul_add(upper, T::from_f64(f64::from(low)) * lower)
}

/// Seconds in a unit of the upper and of the lower 32 bits of a number of ticks.
pub(crate) fn seconds_per_word(ticks_per_second: f64) -> [f64; 2] {
    [4_294_967_296.0 / ticks_per_second, 1.0 / ticks_per_second]
}

/// A phase in turns, within (−1, 1), `elapsed` seconds after it was `start`: the increment covers a fraction of one step, so that its
/// error does not accumulate.
#[inline(always)]
pub fn phase_after<R: Real>(start: R, turns_per_second: R, elapsed: R) -> R {
    let advanced = turns_per_second.mul_add(elapsed, start);
    advanced - advanced.round()
}

/// Whole ticks in a time (s) in two words, each rounded towards 0: wrong by at most two ticks, 2⁻⁵⁹ of the span.
#[inline(always)]
pub(crate) fn ticks_in<T: Scalar>(time: TwoWords<T>, ticks_per_second: f64) -> u64 {
    let whole = |seconds: T| (seconds.to_f64() * ticks_per_second) as i64;
    whole(time.value).wrapping_add(whole(time.residue)) as u64
}

/// Exact rates in units of 2⁻¹²⁸ turn per tick.
#[derive(Clone, Copy, Debug)]
pub enum Fraction<'a> {
    /// All bodies have the same rate.
    Shared(u128),
    /// One rate for each lane.
    PerBody(&'a [u128]),
}

/// The phase after `ticks`, in turns in [−½, ½]: rounded from the upper 32 bits in `f32`, from 64 in `f64`.
#[inline(always)]
fn turns<T: Scalar>(fraction: u128, ticks: u64) -> T {
    let phase = (fraction.wrapping_mul(u128::from(ticks)) >> 64) as u64;
    let (high, low) = ((phase >> 32) as i32, phase as u32);
    let upper = T::from_f64(f64::from(high)) * T::splat(1.0 / 4_294_967_296.0);
    if T::WORDS == 2 {
        upper
    } else {
        T::from_f64(f64::from(low)).mul_add(T::splat(1.0 / 18_446_744_073_709_551_616.0), upper)
    }
}

/// The digits of a rate, lowest first.
pub fn digits(rate: u128) -> [f64; RATE_DIGITS] {
    std::array::from_fn(|digit| f64::from((rate >> (16 * digit)) as u16))
}
