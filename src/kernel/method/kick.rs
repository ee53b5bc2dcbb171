//! The flow of the torque alone, at a frozen attitude and time, which a splitting takes between its free flows.
//!
//! dm/dt = τ(q, ω(m)) with q and t fixed. A torque that does not depend on ω adds h τ. Linear drag, alone or with such torques, has the
//! exact flow
//!
//! ```text
//! Δmᵢ = h E(−h c/Iᵢ) τᵢ(ω),   E(y) = (eʸ − 1)/y
//! ```
//!
//! from one evaluation (S. M. Cox, P. C. Matthews, J. Comput. Phys. 176 (2002) 430, equation 4, on one linear
//! equation). Any other dependence on ω is integrated by a Runge-Kutta method of an order not below the splitting's:
//! the classical one of order 4 (see [`super::rk4`]), or of order 6 (J. C. Butcher, J. Austral. Math. Soc. 4 (1964)
//! 179). A kick of lower order would reduce the order of the whole splitting.

use crate::kernel::method::slope::sixth_of;
use crate::kernel::rigid_body::{Body, Correction, State};
use crate::kernel::torque_kernel::{TorqueKernel, VelocityDependence};
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::{TwoWords, Vector, accumulate};

/// `state` after the torque alone has acted for h, with an error of order `ORDER` + 1 in h at most.
#[inline(always)]
pub fn kick<R: Real, E: TorqueKernel<R>, const ORDER: u32>(
    body: &Body<R>,
    torques: &E,
    epoch: &E::Epoch,
    h: TwoWords<R>,
    state: State<R>,
) -> State<R> {
    if E::FREE {
        return state;
    }
    let correction = body.correction(&state);
    let q = state.orientation.value;
    let m = state.angular_momentum_principal.value;
    let acting = Acting { body, torques, epoch, correction: &correction, q };
    let increment = match torques.velocity_dependence() {
        VelocityDependence::None => timed(acting.at(m), h),
        VelocityDependence::LinearDrag => {
            timed(acting.at(m), h).scaled_by(damping(body, torques.drag_coefficient(), h))
        }
        VelocityDependence::General if ORDER <= 4 => increment_of_order_4(h, m, &acting),
        VelocityDependence::General => increment_of_order_6(h, m, &acting),
    };
    State { angular_momentum_principal: accumulate::<R, _>(state.angular_momentum_principal, increment), ..state }
}

/// The torque at a frozen attitude and time.
struct Acting<'a, R: Real, E: TorqueKernel<R>> {
    body: &'a Body<R>,
    torques: &'a E,
    epoch: &'a E::Epoch,
    correction: &'a Correction<R>,
    q: Quaternion<R>,
}

impl<R: Real, E: TorqueKernel<R>> Acting<'_, R, E> {
    /// The torque at an angular momentum m.
    #[inline(always)]
    fn at(&self, m: Vector<R>) -> Vector<R> {
        self.torques.torque(self.epoch, self.body, self.q, self.body.angular_velocity(m, self.correction))
    }
}

/// v h, both words of h.
#[inline(always)]
fn timed<R: Real>(v: Vector<R>, h: TwoWords<R>) -> Vector<R> {
    v.axpy(h.value, v * h.residue)
}

/// E(−h c/I), axis by axis.
#[inline(always)]
fn damping<R: Real>(body: &Body<R>, coefficient: R, h: TwoWords<R>) -> Vector<R> {
    let rate = body.inverse_moments.value * (-(coefficient * h.value));
    Vector::new(relative_growth(rate.x), relative_growth(rate.y), relative_growth(rate.z))
}

/// E(y) = (eʸ − 1)/y for y ≤ 32, to ten roundings.
///
/// Taylor's polynomial at y/64, then six times E(2y) = E(y) (1 + y E(y)/2), which loses nothing by cancellation near 0.
/// Below −32, E(y) = −1/y to 1e-14.
#[inline(always)]
pub(crate) fn relative_growth<R: Real>(y: R) -> R {
    let one = R::splat(1.0);
    let half = R::splat(0.5);
    let steep = y.less_than(R::splat(-32.0));
    let x = R::select(steep, R::splat(-32.0), y) * R::splat(1.0 / 64.0);
    let mut e = one;
    for n in (2..=12).rev() {
        e = e.mul_add(x * R::splat(1.0 / f64::from(n)), one);
    }
    // E(2y) from E(y).
    let doubled = |y: R, e: R| e * (y * half).mul_add(e, one);
    for times in [1.0, 2.0, 4.0, 8.0, 16.0, 32.0] {
        e = doubled(x * R::splat(times), e);
    }
    R::select(steep, -one / y, e)
}

/// The classical Runge-Kutta method on dm/dt = τ(m).
#[inline(always)]
fn increment_of_order_4<R: Real, E: TorqueKernel<R>>(
    h: TwoWords<R>,
    m: Vector<R>,
    acting: &Acting<'_, R, E>,
) -> Vector<R> {
    let half = h.value * R::splat(0.5);
    let sixth = sixth_of(h);
    let k1 = acting.at(m);
    let k2 = acting.at(k1.axpy(half, m));
    let k3 = acting.at(k2.axpy(half, m));
    let k4 = acting.at(k3.axpy(h.value, m));
    (k2 + k3).axpy(R::splat(2.0), k1 + k4).axpy(sixth.value, k2 * sixth.residue)
}

/// Butcher's method of order 6 in seven stages on dm/dt = τ(m).
///
/// The weights multiply differences from the fifth slope, so that rounding does not change the sum of all weights, 1.
#[inline(always)]
fn increment_of_order_6<R: Real, E: TorqueKernel<R>>(
    h: TwoWords<R>,
    m: Vector<R>,
    acting: &Acting<'_, R, E>,
) -> Vector<R> {
    let by = |numerator: f64, denominator: f64| R::splat(numerator / denominator);
    let dt = h.value;
    let k1 = acting.at(m);
    let k2 = acting.at((k1 * by(1.0, 3.0)).axpy(dt, m));
    let k3 = acting.at((k2 * by(2.0, 3.0)).axpy(dt, m));
    let k4 = acting.at(k1.axpy(by(1.0, 12.0), k2.axpy(by(1.0, 3.0), k3 * by(-1.0, 12.0))).axpy(dt, m));
    let k5 = acting
        .at(k1.axpy(by(-1.0, 16.0), k2.axpy(by(9.0, 8.0), k3.axpy(by(-3.0, 16.0), k4 * by(-3.0, 8.0)))).axpy(dt, m));
    let k6 =
        acting.at(k2.axpy(by(9.0, 8.0), k3.axpy(by(-3.0, 8.0), k4.axpy(by(-3.0, 4.0), k5 * by(1.0, 2.0)))).axpy(dt, m));
    let k7 = acting.at(k1
        .axpy(
            by(9.0, 44.0),
            k2.axpy(by(-9.0, 11.0), k3.axpy(by(63.0, 44.0), k4.axpy(by(18.0, 11.0), k6 * by(-16.0, 11.0)))),
        )
        .axpy(dt, m));
    let ends = (k1 - k5) + (k7 - k5);
    let thirds = (k3 - k5) + (k4 - k5);
    let slope = k5 + ends.axpy(by(11.0, 120.0), thirds.axpy(by(27.0, 40.0), (k6 - k5) * by(-4.0, 15.0)));
    timed(slope, h)
}
