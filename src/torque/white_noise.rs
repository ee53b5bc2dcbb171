//! `white-noise`: a random torque without memory, the same about every axis.
//!
//! The draws are functions of seed, body and step alone: one block of Philox4x32-10 (J. K. Salmon, M. A. Moraes, R. O. Dror,
//! D. E. Shaw, *Parallel random numbers: as easy as 1, 2, 3*, SC11, 2011) for each draw, computed in the kernel. No state passes from
//! one draw to the next, so a body's torque depends neither on the bodies beside it nor on how a run is cut into parts or pieces. Each scene
//! begins with step 0: a loop of the user's own that goes on from the states of one scene in another gives each its own seed.

use super::formula::{Column, Formula, Role};
use std::sync::LazyLock;

use glam::DQuat;

use super::{Declaration, Model, Parameter, ParameterDeclaration, Preset, Torque, Validity, Value, Values};
use crate::bodies::BodyFrame;
use crate::math::real::{Real, Scalar, sin_cos};
use crate::math::vector::Vector;

/// dm = σ dW with three independent Wiener processes (Langevin's equation of rotation; J. R. McConnell, *Rotational
/// Brownian Motion and Dielectric Theory*, 1980, chapter 2): each component of m has the variance σ² t after a time t.
///
/// Over a step of dt the torque is constant, σ ξ/√dt with ξ standard normal, so that a deterministic integrator of order
/// one or more converges to the Stratonovich solution; as the noise does not depend on the state, its strong order is 1
/// (E. Wong, M. Zakai, Ann. Math. Stat. 36 (1965) 1560; P. E. Kloeden, E. Platen, *Numerical Solution of Stochastic
/// Differential Equations*, 1992, section 10.3). The integrator's own order is not reached.
///
/// The same path at several step sizes: with `draws_per_step` = n, ξ is the sum of n draws over √n, the draws of n steps
/// of dt/n. Halve both dt and n to refine a path.
///
/// Draws count from the start of a scene. Where several scenes follow one another, in a loop of the user's own, each needs a seed of its
/// own; else they all get the same torques. So does each of several such torques of one scene, else they follow one path together: in a study
/// the first without a `seed` takes the study's, the next that plus 1, and so on.
pub struct WhiteNoise;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let source = "J. R. McConnell, Rotational Brownian Motion and Dielectric Theory, 1980, chapter 2";
    let intensity = ParameterDeclaration::number("intensity", "N m √s", "the intensity σ");
    let draws = ParameterDeclaration::whole("draws_per_step", "the draws that a step's torque is made of");
    Declaration::new("white-noise", "dm = σ dW", source).random().parameters([
        intensity.valid(Validity::NotNegative).factor(),
        ParameterDeclaration::whole("seed", "the number that selects the path").or(Preset::Seed),
        draws.valid(Validity::Range(1.0, u16::MAX.into())).or(Preset::Whole(1)),
    ])
});
const INTENSITY: usize = 0;
const SEED: usize = 1;
const DRAWS_PER_STEP: usize = 2;

impl Torque {
    /// A random torque of intensity σ [N m √s] on the path that `seed` selects; see [`WhiteNoise`].
    pub fn white_noise(intensity: impl Into<Parameter<f64>>, seed: u64) -> Self {
        Self::white_noise_of_draws(intensity, seed, 1)
    }

    /// The same, with the torque in a step made of several draws, 1 to 65,535: the path of that many shorter steps.
    pub fn white_noise_of_draws(intensity: impl Into<Parameter<f64>>, seed: u64, draws_per_step: u16) -> Self {
        let (seed, draws) = (Value::Whole(seed), Value::Whole(draws_per_step.into()));
        Self::built(&WhiteNoise, [Value::Number(intensity.into()), seed, draws])
    }
}

impl Model for WhiteNoise {
    declared!(WhiteNoise);

    /// The rate that a Wiener process reaches within a radian: (σ/I)^(2/3).
    fn rate(&self, values: Values<'_>, body: usize, middle_moment: f64) -> f64 {
        (values.number(INTENSITY).at(body) / middle_moment).powf(2.0 / 3.0)
    }

    fn columns(&self, values: Values<'_>, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let (seed, draws_per_step) = (values.whole(SEED), values.whole(DRAWS_PER_STEP) as f64);
        // The square root of the time stays in seconds: the kernel also knows dt in seconds.
        out[0] = frame.scaled(values.number(INTENSITY).at(body), 1, 2) / draws_per_step.sqrt();
        out[1] = draws_per_step;
        let body = (values.first_body + body) as u64;
        let words = [body as u32, (body >> 32) as u32, seed as u32, (seed >> 32) as u32];
        for (word, digits) in words.into_iter().zip(out[2..10].chunks_exact_mut(2)) {
            digits[0] = f64::from(word & 0xffff);
            digits[1] = f64::from(word >> 16);
        }
    }
}

/// Numbers that identify one body's path.
#[derive(Clone, Copy, Debug)]
pub struct NoiseKey {
    /// Index of the body.
    pub body: [u32; 2],
    /// The seed.
    pub seed: [u32; 2],
}

/// One block of Philox4x32-10.
#[inline(always)]
pub fn philox(counter: [u32; 4], key: [u32; 2]) -> [u32; 4] {
    let (mut counter, mut key) = (counter, key);
    for _ in 0..10 {
        let first = u64::from(counter[0]) * 0xd251_1f53;
        let second = u64::from(counter[2]) * 0xcd9e_8d57;
        counter = [
            (second >> 32) as u32 ^ counter[1] ^ key[0],
            second as u32,
            (first >> 32) as u32 ^ counter[3] ^ key[1],
            first as u32,
        ];
        key = [key[0].wrapping_add(0x9e37_79b9), key[1].wrapping_add(0xbb67_ae85)];
    }
    counter
}

/// Words of one draw: the body's index and the draw's number form the counter, the seed is the key.
#[inline(always)]
pub(crate) fn noise_words(key: NoiseKey, draw: u64) -> [u32; 4] {
    philox([key.body[0], key.body[1], draw as u32, (draw >> 32) as u32], key.seed)
}

/// Three standard normal numbers from four random words (G. E. P. Box, M. E. Muller, Ann. Math. Stat. 29 (1958) 610).
///
/// `logarithms` are −ln u of the first and third word as uniform numbers, `angles` the second and fourth as turns.
#[inline(always)]
pub fn normal_vector<R: Real>(logarithms: [R; 2], angles: [R; 2]) -> Vector<R> {
    let radius = |logarithm: R| (R::splat(2.0) * logarithm).sqrt();
    let (sin, cos) = sin_cos(angles[0] * R::splat(std::f64::consts::TAU));
    let (_, other_cos) = sin_cos(angles[1] * R::splat(std::f64::consts::TAU));
    let first = radius(logarithms[0]);
    Vector::new(first * cos, first * sin, radius(logarithms[1]) * other_cos)
}

/// −ln u for u = mantissa · 2^−exponent with a mantissa in [1, 2).
///
/// As many terms of ln m = 2 artanh((m − 1)/(m + 1)) are summed as the precision needs on [1/√2, √2]; the relative error is at most 4 units
/// of roundoff.
#[inline(always)]
pub fn minus_log<R: Real>(mantissa: R, exponent: R) -> R {
    let (one, half) = (R::splat(1.0), R::splat(0.5));
    let large = R::splat(std::f64::consts::SQRT_2).less_than(mantissa);
    let m = R::select(large, mantissa * half, mantissa);
    let halvings = R::select(large, exponent - one, exponent);
    let z = (m - one) / (m + one);
    let z2 = z * z;
    let terms = R::Scalar::ARTANH_TERMS;
    let mut sum = R::splat(1.0 / f64::from(2 * terms + 1));
    for term in (0..terms).rev() {
        sum = sum.mul_add(z2, R::splat(1.0 / f64::from(2 * term + 1)));
    }
    halvings.mul_add(R::splat(std::f64::consts::LN_2), -(R::splat(2.0) * z * sum))
}

/// A random word as the uniform number (n + ½) 2⁻³², given by its mantissa in [1, 2) and the negative of its exponent.
#[inline(always)]
pub fn uniform_parts<T: Scalar>(word: u32) -> (T, T) {
    // 2n + 1 has 33 bits; the leading one is shifted out, and the rest is cut to the precision's bits.
    let wide = (u64::from(word) << 1) | 1;
    let zeros = wide.leading_zeros() - 31;
    let fraction = (wide << (zeros + 31) << 1) >> 32;
    let kept = if T::WORDS == 2 { fraction & 0xffff_fe00 } else { fraction };
    (T::from_f64(1.0 + kept as f64 / 4_294_967_296.0), T::from_f64(f64::from(zeros + 1)))
}

/// A random word as an angle in turns, in [−½, ½).
#[inline(always)]
pub fn uniform_turns<T: Scalar>(word: u32) -> T {
    T::from_f64(f64::from(word as i32)) * T::splat(1.0 / 4_294_967_296.0)
}

impl Formula for WhiteNoise {
    const STEM: &'static str = "white_noise";
    const COLUMNS: &'static [Column] = &[
        Column::number("intensity"),
        Column::number("draws_per_step"),
        Column::quaternion("body_key"),
        Column::quaternion("seed_key"),
    ];
    const ROLE: Role = Role::Noise;
}
