//! Transforms scaled states to the user's axes and units, for one body or in SIMD lanes.
//!
//! Products are not fused with sums, so that lanes and scalars give the same bits.

use super::columns::{STATE_COMPONENTS, STRIDE_UNIT};
use super::{BodyFrame, BodyState, Status};
use crate::math::lanes::{LaneScalar, LaneTask};
use crate::math::power_of_two::power_of_two_factors;
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;
use glam::{DQuat, DVec3};

/// Number of components of a [`BodyState`]: orientation, angular velocity, angular momentum, kinetic energy and error of the norm.
pub(crate) const USER_COMPONENTS: usize = 12;

/// Transforms the scaled states of a lane group to the user's axes and units.
pub(crate) struct UserAxes<R: Real> {
    moments: Vector<R>,
    principal_to_body: Quaternion<R>,
    is_linear_rotor: R::Mask,
    /// The units, each as two factors, and the reciprocal of the first.
    angular_velocity: [R; 2],
    per_angular_velocity: [R; 2],
    angular_momentum: [R; 2],
    energy: [R; 2],
}

impl<R: Real<Scalar = f64>> UserAxes<R> {
    /// For the bodies whose frames `frame` gives, one for each lane.
    #[inline(always)]
    pub fn new<'f>(frame: impl Fn(usize) -> &'f BodyFrame) -> Self {
        let half = R::splat(0.5);
        let linear = R::from_lanes(|lane| if frame(lane).is_linear_rotor { 1.0 } else { 0.0 });
        Self {
            moments: Vector::new(
                R::from_lanes(|lane| frame(lane).scaled_moments.x),
                R::from_lanes(|lane| frame(lane).scaled_moments.y),
                R::from_lanes(|lane| frame(lane).scaled_moments.z),
            ),
            principal_to_body: Quaternion::new(
                R::from_lanes(|lane| frame(lane).principal_to_body.x),
                R::from_lanes(|lane| frame(lane).principal_to_body.y),
                R::from_lanes(|lane| frame(lane).principal_to_body.z),
                R::from_lanes(|lane| frame(lane).principal_to_body.w),
            ),
            is_linear_rotor: half.less_than(linear),
            angular_velocity: powers(|lane| frame(lane).rate_exponent),
            per_angular_velocity: powers(|lane| -frame(lane).rate_exponent),
            angular_momentum: powers(|lane| frame(lane).moment_exponent + frame(lane).rate_exponent),
            energy: powers(|lane| frame(lane).moment_exponent + 2 * frame(lane).rate_exponent),
        }
    }

    /// The scaled states of bodies with this orientation and angular velocity in body axes, rad/s ([`BodyFrame::initial`]).
    #[inline(always)]
    pub fn scaled(&self, orientation: Quaternion<R>, omega_body: Vector<R>) -> (Quaternion<R>, Vector<R>) {
        let [first, second] = self.per_angular_velocity;
        let omega = rotated(self.principal_to_body.conjugate(), omega_body * first * second);
        let omega = Vector::new(R::select(self.is_linear_rotor, R::splat(0.0), omega.x), omega.y, omega.z);
        (unit_product(orientation, self.principal_to_body), self.moments.scaled_by(omega))
    }

    /// The components of the states in the user's axes and units ([`UserColumns`]) from scaled ones
    /// ([`super::columns::StateWords`]).
    #[inline(always)]
    pub fn components(&self, q: Quaternion<R>, m: Vector<R>) -> [R; USER_COMPONENTS] {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        // A linear rotor has no spin; a method that rotates about one axis after another creates some through its own error.
        let m = Vector::new(R::select(self.is_linear_rotor, zero, m.x), m.y, m.z);
        let norm = length_squared(q).sqrt();
        // Of a quaternion whose norm overflows nothing is known.
        let is_number = norm.less_than(R::splat(f64::INFINITY));
        let unit = q * R::select(is_number, one / norm, R::splat(f64::NAN));
        let omega = Vector::new(m.x / self.moments.x, m.y / self.moments.y, m.z / self.moments.z);
        let orientation = unit_product(unit, self.principal_to_body.conjugate());
        let [first, second] = self.angular_velocity;
        let omega_body = rotated(self.principal_to_body, omega) * first * second;
        let [first, second] = self.angular_momentum;
        let momentum = rotated(unit, m) * first * second;
        let [first, second] = self.energy;
        let energy = R::splat(0.5) * m.plain_dot(omega) * first * second;
        let (q, w, l) = (orientation, omega_body, momentum);
        [q.x, q.y, q.z, q.w, w.x, w.y, w.z, l.x, l.y, l.z, energy, norm - one]
    }
}

/// Bodies that [`UserColumns`] hold; a multiple of every lane count.
pub(crate) const USER_BODIES: usize = STRIDE_UNIT;

/// The states of some bodies in the user's axes and units, a column for each component.
pub(crate) struct UserColumns([[f64; USER_BODIES]; USER_COMPONENTS]);

impl UserColumns {
    /// NaN everywhere.
    pub const UNKNOWN: Self = Self([[f64::NAN; USER_BODIES]; USER_COMPONENTS]);

    /// Stores the components from [`UserAxes::components`] for the lanes from `offset` on.
    #[inline(always)]
    pub fn store<R: Real<Scalar = f64>>(&mut self, offset: usize, components: [R; USER_COMPONENTS]) {
        for (number, column) in components.into_iter().zip(&mut self.0) {
            number.store(&mut column[offset..]);
        }
    }

    /// The state of one body, with the status valid.
    #[inline]
    pub fn state(&self, place: usize) -> BodyState {
        of_components(|component| self.0[component][place])
    }
}

/// The state with the components from [`UserAxes::components`].
#[inline(always)]
pub(super) fn of_components(component: impl Fn(usize) -> f64) -> BodyState {
    BodyState {
        orientation: DQuat::from_xyzw(component(0), component(1), component(2), component(3)),
        angular_velocity_body: DVec3::new(component(4), component(5), component(6)),
        angular_momentum_world: DVec3::new(component(7), component(8), component(9)),
        kinetic_energy: component(10),
        norm_error: component(11),
        status: Status::Valid,
    }
}

/// The frames of some bodies, one column for each number.
struct FrameColumns {
    moments: [[f64; USER_BODIES]; 3],
    principal_to_body: [[f64; USER_BODIES]; 4],
    /// 1 of a linear rotor, else 0.
    is_linear_rotor: [f64; USER_BODIES],
    moment_exponent: [i32; USER_BODIES],
    rate_exponent: [i32; USER_BODIES],
}

impl FrameColumns {
    /// The frames of bodies that are scaled and in their principal axes.
    fn new() -> Self {
        let (zeros, ones) = ([0.0; USER_BODIES], [1.0; USER_BODIES]);
        Self {
            moments: [ones; 3],
            principal_to_body: [zeros, zeros, zeros, ones],
            is_linear_rotor: zeros,
            moment_exponent: [0; USER_BODIES],
            rate_exponent: [0; USER_BODIES],
        }
    }

    fn set(&mut self, place: usize, frame: &BodyFrame) {
        let moments = frame.scaled_moments.to_array();
        self.moments.iter_mut().zip(moments).for_each(|(column, number)| column[place] = number);
        let turn = frame.principal_to_body.to_array();
        self.principal_to_body.iter_mut().zip(turn).for_each(|(column, number)| column[place] = number);
        self.is_linear_rotor[place] = f64::from(u8::from(frame.is_linear_rotor));
        self.moment_exponent[place] = frame.moment_exponent;
        self.rate_exponent[place] = frame.rate_exponent;
    }
}

/// A power of two for each body, as two factors.
struct PowerColumns([[f64; USER_BODIES]; 2]);

impl PowerColumns {
    #[inline(always)]
    fn of(exponent: impl Fn(usize) -> i32) -> Self {
        let [mut first, mut second] = [[0.0; USER_BODIES]; 2];
        for (place, (first, second)) in first.iter_mut().zip(&mut second).enumerate() {
            [*first, *second] = power_of_two_factors(exponent(place));
        }
        Self([first, second])
    }

    #[inline(always)]
    fn load<R: Real<Scalar = f64>>(&self, offset: usize) -> [R; 2] {
        self.0.each_ref().map(|column| R::load(&column[offset..]))
    }
}

/// Some bodies whose states are being transformed to the user's axes and units, in SIMD lanes.
pub(crate) struct UserBlock {
    frames: FrameColumns,
    status: [Status; USER_BODIES],
    /// Orientation and angular momentum, scaled; at the start, orientation and angular velocity.
    given: [[f64; USER_BODIES]; STATE_COMPONENTS],
    found: UserColumns,
}

impl UserBlock {
    /// Bodies at rest.
    pub fn new() -> Self {
        Self {
            frames: FrameColumns::new(),
            status: [Status::Valid; USER_BODIES],
            given: [[1.0; USER_BODIES]; STATE_COMPONENTS],
            found: UserColumns::UNKNOWN,
        }
    }

    /// Sets the state of one body: scaled or, at its start, orientation and angular velocity in the user's axes.
    #[inline]
    pub fn set(&mut self, place: usize, frame: &BodyFrame, numbers: [f64; STATE_COMPONENTS], status: Status) {
        self.frames.set(place, frame);
        self.status[place] = status;
        for (column, number) in self.given.iter_mut().zip(numbers) {
            column[place] = number;
        }
    }

    /// Transforms all of them to the user's axes; with `start`, they were given in these.
    pub fn form(&mut self, start: bool) {
        f64::dispatch(FormUserBlock { block: self, start });
    }

    /// The state of one body.
    #[inline]
    pub fn state(&self, place: usize) -> BodyState {
        BodyState { status: self.status[place], ..self.found.state(place) }
    }
}

struct FormUserBlock<'a> {
    block: &'a mut UserBlock,
    start: bool,
}

impl LaneTask<f64> for FormUserBlock<'_> {
    type Output = ();
    #[inline(always)]
    fn run<R: Real<Scalar = f64>>(self) {
        let UserBlock { frames, given, found, .. } = self.block;
        let (moment, rate) = (&frames.moment_exponent, &frames.rate_exponent);
        let angular_velocity = PowerColumns::of(|place| rate[place]);
        let per_angular_velocity = PowerColumns::of(|place| -rate[place]);
        let angular_momentum = PowerColumns::of(|place| moment[place] + rate[place]);
        let energy = PowerColumns::of(|place| moment[place] + 2 * rate[place]);
        for offset in (0..USER_BODIES).step_by(R::LANES) {
            let [moments_x, moments_y, moments_z] = frames.moments.each_ref().map(|column| R::load(&column[offset..]));
            let [x, y, z, w] = frames.principal_to_body.each_ref().map(|column| R::load(&column[offset..]));
            let axes = UserAxes::<R> {
                moments: Vector::new(moments_x, moments_y, moments_z),
                principal_to_body: Quaternion::new(x, y, z, w),
                is_linear_rotor: R::splat(0.5).less_than(R::load(&frames.is_linear_rotor[offset..])),
                angular_velocity: angular_velocity.load(offset),
                per_angular_velocity: per_angular_velocity.load(offset),
                angular_momentum: angular_momentum.load(offset),
                energy: energy.load(offset),
            };
            let [x, y, z, w, a, b, c] = given.each_ref().map(|column| R::load(&column[offset..]));
            let (mut q, mut m) = (Quaternion::new(x, y, z, w), Vector::new(a, b, c));
            if self.start {
                (q, m) = axes.scaled(q, m);
            }
            found.store(offset, axes.components(q, m));
        }
    }
}

/// 2^n as two factors.
#[inline(always)]
fn powers<R: Real<Scalar = f64>>(exponent: impl Fn(usize) -> i32) -> [R; 2] {
    [
        R::from_lanes(|lane| power_of_two_factors(exponent(lane))[0]),
        R::from_lanes(|lane| power_of_two_factors(exponent(lane))[1]),
    ]
}

#[inline(always)]
fn length_squared<R: Real>(q: Quaternion<R>) -> R {
    q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w
}

/// q v q*, as `glam` forms it.
#[inline(always)]
fn rotated<R: Real>(q: Quaternion<R>, v: Vector<R>) -> Vector<R> {
    let (two, u) = (R::splat(2.0), q.vector());
    let cross = Vector::new(u.y * v.z - v.y * u.z, u.z * v.x - v.z * u.x, u.x * v.y - v.x * u.y);
    v * (q.w * q.w - u.plain_dot(u)) + u * (v.plain_dot(u) * two) + cross * (q.w * two)
}

/// The product of two unit quaternions, normalised to first order in the rounding of their norms; higher orders vanish.
#[inline(always)]
pub(super) fn unit_product<R: Real>(a: Quaternion<R>, b: Quaternion<R>) -> Quaternion<R> {
    let product = Quaternion::new(
        a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
    );
    product * (R::splat(1.5) - R::splat(0.5) * length_squared(product))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::Ensemble;
    use crate::bodies::frame::initial_state;
    use crate::bodies::inertia::InertiaTensor;

    /// Some roundings of numbers as large as the largest component.
    const ROUNDINGS: f64 = 8.0 * f64::EPSILON;

    #[test]
    fn lanes_and_one_body_have_the_same_bits_and_glam_agrees() {
        let frame = |body: usize| BodyFrame {
            scaled_moments: DVec3::new(0.9, 1.1 + 0.01 * body as f64, 1.7),
            is_linear_rotor: body == 5,
            principal_to_body: DQuat::from_rotation_z(0.3 + body as f64) * DQuat::from_rotation_x(0.7),
            moment_exponent: 3 - 40 * body as i32,
            rate_exponent: 5 * body as i32 - 7,
        };
        let frames: Vec<BodyFrame> = (0..8).map(frame).collect();
        let state: [[f64; 8]; 7] = std::array::from_fn(|c| std::array::from_fn(|b| (1.0 + (7 * b + c) as f64).sin()));
        let mut lanes = UserBlock::new();
        for (body, frame) in frames.iter().enumerate() {
            lanes.set(body, frame, state.map(|column| column[body]), Status::Valid);
        }
        lanes.form(false);
        for (body, frame) in frames.iter().enumerate() {
            let scaled = state.map(|column| column[body]);
            let alone = frame.body_state(scaled);
            assert_eq!(lanes.state(body), alone, "{body}");
            let q = DQuat::from_xyzw(scaled[0], scaled[1], scaled[2], scaled[3]);
            let m = DVec3::new(if body == 5 { 0.0 } else { scaled[4] }, scaled[5], scaled[6]);
            let (unit, omega) = (q.normalize(), m / frame.scaled_moments);
            let close = |a: DVec3, b: DVec3| (a - b).length() <= ROUNDINGS * b.length();
            let rate = 2.0_f64.powi(frame.rate_exponent);
            let moment = 2.0_f64.powi(frame.moment_exponent);
            assert!(close(alone.angular_velocity_body, frame.principal_to_body * omega * rate), "{body}");
            assert!(close(alone.angular_momentum_world, unit * m * rate * moment), "{body}");
            let expected = unit * frame.principal_to_body.conjugate();
            assert!((alone.orientation - expected).length() <= ROUNDINGS, "{body}");
            let energy = 0.5 * m.dot(omega) * rate * rate * moment;
            assert!((alone.kinetic_energy - energy).abs() <= ROUNDINGS * energy, "{body}");
        }
    }

    #[test]
    fn starts_in_lanes_and_of_one_body_have_the_same_bits() {
        let turn = |body: usize| DQuat::from_rotation_z(0.4 * body as f64) * DQuat::from_rotation_x(1.1);
        let tensors: Vec<InertiaTensor> = (0..USER_BODIES)
            .map(|body| {
                let moments = DVec3::new(if body == 9 { 0.0 } else { 1.1 }, 1.3, 1.3 + 0.01 * f64::from(body != 9));
                InertiaTensor::from_principal_moments(moments * 2.0_f64.powi(body as i32 % 40 - 20))
                    .rotated(turn(body / 2))
            })
            .collect();
        let orientation: Vec<DQuat> = (0..USER_BODIES).map(|body| turn(3 * body).normalize()).collect();
        let spin = |body: usize| DVec3::new(0.3, -0.2, 0.1) * 3.0_f64.powi(body as i32 % 30 - 15);
        // A linear rotor has no spin about its axis.
        let spin = |body: usize| if body == 9 { turn(4) * DVec3::new(0.0, -0.2, 0.1) } else { spin(body) };
        let omega: Vec<DVec3> = (0..USER_BODIES).map(spin).collect();
        let ensemble = Ensemble::from_columns(&tensors, &orientation, &omega).expect("valid");
        assert!(ensemble.is_linear_rotor(9));
        let mut lanes = UserBlock::new();
        for body in 0..USER_BODIES {
            let (q, omega) = (ensemble.orientation()[body], ensemble.angular_velocity_body()[body]);
            let numbers = [q.x, q.y, q.z, q.w, omega.x, omega.y, omega.z];
            lanes.set(body, &BodyFrame::of_body(&ensemble, body, |_| 0.0), numbers, Status::Valid);
        }
        lanes.form(true);
        for body in 0..USER_BODIES {
            assert_eq!(lanes.state(body), initial_state(&ensemble, body), "{body}");
        }
    }
}
