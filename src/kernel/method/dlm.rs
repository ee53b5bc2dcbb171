//! `dlm`: splitting into rotations about the three principal axes.
//!
//! Order 2, five rotations a step, explicit and symmetric. Conserves |m| and the angular momentum in the world to
//! rounding; the energy error is bounded and of order dt². Stable for any step; accurate only where ω dt is small.
//!
//! Source: A. Dullweber, B. Leimkuhler, R. McLachlan, J. Chem. Phys. 107 (1997) 5840, equations (15) to (20): the free
//! flow R₁(h/2) R₂(h/2) R₃(h) R₂(h/2) R₁(h/2), where Rᵢ(h) is the exact flow of the Hamiltonian mᵢ²/2Iᵢ; a torque kicks
//! for half a step before and after it.
//!
//! Difference from the source: each rotation is formed as a small increment (from sine and 1 − cosine, never cosine)
//! that is added to a state carried in two words. cos² + sin² of rounded values is biased, and repeated it makes |m|
//! and |q| drift by 1e-2 in 1e6 steps of plain `f32`.

use crate::kernel::method::PlainStep;
use crate::kernel::method::kick::kick;
use crate::kernel::rigid_body::{Body, State};
use crate::kernel::torque_kernel::TorqueKernel;
use crate::math::quaternion::{Quaternion, norm_correction};
use crate::math::real::{Real, sin_cos};
use crate::math::vector::{TwoWords, Vector, accumulate};

/// The method as a type.
#[doc(hidden)]
pub struct Dlm;

impl PlainStep for Dlm {
    /// Half a kick by the torque, the free rotations, half a kick.
    #[inline(always)]
    fn step<R: Real, E: TorqueKernel<R>>(
        body: &Body<R>,
        torques: &E,
        step_index: u64,
        dt: TwoWords<R>,
        state: State<R>,
    ) -> State<R> {
        let half = TwoWords { value: dt.value * R::splat(0.5), residue: dt.residue * R::splat(0.5) };
        let step = torques.start(step_index);
        let state = kick::<R, E, 2>(body, torques, &torques.epoch(&step, 0.0), half, state);
        let state = rotate_x(body, half, state);
        let state = rotate_y(body, half, state);
        let state = rotate_z(body, dt, state);
        let state = rotate_y(body, half, state);
        let mut state = rotate_x(body, half, state);
        state.orientation = accumulate::<R, _>(state.orientation, norm_correction(state.orientation.value));
        kick::<R, E, 2>(body, torques, &torques.epoch(&step, 1.0), half, state)
    }
}

/// sin θ, 1 − cos θ, sin θ/2 and 1 − cos θ/2, all from one sine and cosine of θ/4.
struct Angles<R> {
    sin: R,
    versine: R,
    half_sin: R,
    half_versine: R,
}

/// θ = h m/I for one axis, first-order terms of the second words included.
#[inline(always)]
fn angles<R: Real>(h: TwoWords<R>, inverse_moment: TwoWords<R>, m: TwoWords<R>) -> Angles<R> {
    let rate = inverse_moment
        .value
        .mul_add(m.value, inverse_moment.value.mul_add(m.residue, inverse_moment.residue * m.value));
    let angle = h.value.mul_add(rate, h.residue * rate);
    let two = R::splat(2.0);
    let (s, c) = sin_cos(angle * R::splat(0.25));
    let half_sin = two * s * c;
    let half_versine = two * s * s;
    let sin = two * half_sin * (R::splat(1.0) - half_versine);
    let versine = two * half_sin * half_sin;
    Angles { sin, versine, half_sin, half_versine }
}

/// The change of (m_j, m_k) in a rotation by −θ.
#[inline(always)]
fn turned<R: Real>(angles: &Angles<R>, j: R, k: R) -> (R, R) {
    (angles.sin.mul_add(k, -(angles.versine * j)), -(angles.sin.mul_add(j, angles.versine * k)))
}

#[inline(always)]
fn rotate_x<R: Real>(body: &Body<R>, h: TwoWords<R>, state: State<R>) -> State<R> {
    let m = state.angular_momentum_principal;
    let i = body.inverse_moments;
    let a = angles(
        h,
        TwoWords { value: i.value.x, residue: i.residue.x },
        TwoWords { value: m.value.x, residue: m.residue.x },
    );
    let (y, z) = turned(&a, m.value.y, m.value.z);
    let q = state.orientation.value;
    let turn = Quaternion::new(q.w, q.z, -q.y, -q.x);
    apply(state, turn, &a, Vector::new(R::splat(0.0), y, z))
}

#[inline(always)]
fn rotate_y<R: Real>(body: &Body<R>, h: TwoWords<R>, state: State<R>) -> State<R> {
    let m = state.angular_momentum_principal;
    let i = body.inverse_moments;
    let a = angles(
        h,
        TwoWords { value: i.value.y, residue: i.residue.y },
        TwoWords { value: m.value.y, residue: m.residue.y },
    );
    let (z, x) = turned(&a, m.value.z, m.value.x);
    let q = state.orientation.value;
    let turn = Quaternion::new(-q.z, q.w, q.x, -q.y);
    apply(state, turn, &a, Vector::new(x, R::splat(0.0), z))
}

#[inline(always)]
fn rotate_z<R: Real>(body: &Body<R>, h: TwoWords<R>, state: State<R>) -> State<R> {
    let m = state.angular_momentum_principal;
    let i = body.inverse_moments;
    let a = angles(
        h,
        TwoWords { value: i.value.z, residue: i.residue.z },
        TwoWords { value: m.value.z, residue: m.residue.z },
    );
    let (x, y) = turned(&a, m.value.x, m.value.y);
    let q = state.orientation.value;
    let turn = Quaternion::new(q.y, -q.x, q.w, -q.z);
    apply(state, turn, &a, Vector::new(x, y, R::splat(0.0)))
}

/// Adds to q the change by the factor (cos θ/2, sin θ/2 e), with `turn` = q e, and to m its own increment.
#[inline(always)]
fn apply<R: Real>(state: State<R>, turn: Quaternion<R>, angles: &Angles<R>, m_increment: Vector<R>) -> State<R> {
    let q = state.orientation.value;
    let q_increment = turn.axpy(angles.half_sin, q * (-angles.half_versine));
    state.advanced(q_increment, m_increment)
}
