//! The principal frame of a body in double-double arithmetic.
//!
//! A tensor diagonalised in `f64` has moments wrong by half an ulp, hence a phase wrong by 1e-16 of itself: 1e-7 rad after 10⁹ rad. Here
//! the tensor's entries count as exact, and moments and angular velocity along the principal axes have some 30 digits if these are asked
//! for.

use glam::{DMat3, DQuat, DVec3};

use crate::bodies::BodyFrame;
use crate::bodies::Ensemble;
use crate::bodies::frame::unit_product;
use crate::bodies::inertia::{AxisPermutation, InertiaTensor, principal_axes};
use crate::kernel::free_motion::setup::{Initial, SetUp};
use crate::math::double_double::DoubleDouble;
use crate::math::power_of_two::{binary_exponent, scaled_by_power_of_two, vector_scaled_by_power_of_two};
use crate::math::quaternion::Quaternion;

type Dd = DoubleDouble<f64>;
type Matrix = [[Dd; 3]; 3];

const ZERO: Dd = Dd { high: 0.0, low: 0.0 };
const ONE: Dd = Dd { high: 1.0, low: 0.0 };

/// Sweeps of Jacobi's method from a frame that is right in `f64`: each sweep squares the remainder, and nearly equal moments
/// take one more.
const SWEEPS: usize = 4;
/// An element below this part of its two diagonal elements is zero to the precision of the arithmetic.
const NEGLIGIBLE: f64 = 1e-33;

/// A body whose principal axes lie along its body axes, scaled; nothing is rounded except by underflow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aligned {
    axes: AxisPermutation,
    /// I₁ ≤ I₂ ≤ I₃ in units of 2^`moment_exponent` kg m², the middle one in [1, 2).
    pub moments: [f64; 3],
    /// ω along the principal axes in units of 2^`rate_exponent` rad/s, the largest component in [1, 2), or 0 at rest.
    pub angular_velocity: [f64; 3],
    pub moment_exponent: i32,
    pub rate_exponent: i32,
}

impl Aligned {
    /// A body of an ensemble, if its inertia tensor is diagonal.
    pub fn of_body(ensemble: &Ensemble, body: usize) -> Option<Self> {
        let inertia = &ensemble.inertia()[body];
        if !inertia.is_diagonal() {
            return None;
        }
        let diagonal = [inertia.xx, inertia.yy, inertia.zz];
        let axes = AxisPermutation::ascending(diagonal);
        let moments = DVec3::from_array(axes.order.map(|axis| diagonal[axis]));
        let moment_exponent = binary_exponent(moments.y);
        let omega = ensemble.angular_velocity_body()[body];
        let rate_exponent = binary_exponent(omega.abs().max_element());
        Some(Self {
            axes,
            moments: vector_scaled_by_power_of_two(moments, -moment_exponent).to_array(),
            angular_velocity: axes.to_principal(vector_scaled_by_power_of_two(omega, -rate_exponent).to_array()),
            moment_exponent,
            rate_exponent,
        })
    }
}

/// A body in its principal axes, in units of 2^`moment_exponent` kg m² and 2^`rate_exponent` rad/s.
struct Principal {
    moments: [Dd; 3],
    angular_velocity: [Dd; 3],
    principal_to_body: DQuat,
    moment_exponent: i32,
    rate_exponent: i32,
}

impl From<Aligned> for Principal {
    fn from(body: Aligned) -> Self {
        Self {
            moments: body.moments.map(Dd::from),
            angular_velocity: body.angular_velocity.map(Dd::from),
            principal_to_body: body.axes.principal_to_body,
            moment_exponent: body.moment_exponent,
            rate_exponent: body.rate_exponent,
        }
    }
}

impl Principal {
    /// A body whose tensor is not diagonal.
    fn of_tilted(ensemble: &Ensemble, body: usize, set_up: SetUp) -> Self {
        let (inertia, omega) = (&ensemble.inertia()[body], ensemble.angular_velocity_body()[body]);
        let moment_exponent = binary_exponent(inertia.xx.max(inertia.yy).max(inertia.zz));
        let entry = |x: f64| scaled_by_power_of_two(x, -moment_exponent);
        let scaled = InertiaTensor {
            xx: entry(inertia.xx),
            yy: entry(inertia.yy),
            zz: entry(inertia.zz),
            xy: entry(inertia.xy),
            xz: entry(inertia.xz),
            yz: entry(inertia.yz),
        };
        let rate_exponent = binary_exponent(omega.abs().max_element());
        let omega = vector_scaled_by_power_of_two(omega, -rate_exponent);
        let axes = principal_axes(&scaled);
        let (moments, angular_velocity, principal_to_body) = match set_up {
            SetUp::OneWord => {
                let omega = axes.principal_to_body.conjugate() * omega;
                (axes.moments.to_array().map(Dd::from), omega.to_array().map(Dd::from), axes.principal_to_body)
            }
            SetUp::TwoWords => {
                let (moments, frame, principal_to_body) = refined(&scaled, axes.principal_to_body);
                let along =
                    |axis: usize| (0..3).fold(ZERO, |sum, body| sum + frame[body][axis].times_word(omega[body]));
                (moments, [0, 1, 2].map(along), principal_to_body)
            }
        };
        Self { moments, angular_velocity, principal_to_body, moment_exponent, rate_exponent }
    }
}

/// A body of an ensemble in its principal axes, scaled, and the frame that leads back. A linear rotor is given the moments that it
/// is integrated with, I, I, I ([`crate::torque::linear_rotor`]).
pub(crate) fn scaled_body(ensemble: &Ensemble, body: usize, set_up: SetUp) -> (BodyFrame, Initial<f64>) {
    let tilted = || Principal::of_tilted(ensemble, body, set_up);
    let Principal { mut moments, mut angular_velocity, principal_to_body, moment_exponent, rate_exponent } =
        Aligned::of_body(ensemble, body).map_or_else(tilted, Principal::from);
    let is_linear_rotor = ensemble.is_linear_rotor(body);
    if is_linear_rotor {
        moments = [(moments[1] + moments[2]).scaled(0.5); 3];
        angular_velocity[0] = ZERO;
    }
    let second = binary_exponent(moments[1].high);
    if second != 0 {
        let scaled = |x: f64| scaled_by_power_of_two(x, -second);
        moments = moments.map(|i| Dd::new(scaled(i.high), scaled(i.low)));
    }
    let q = unit_product(ensemble.orientation()[body], principal_to_body);
    let body_frame = BodyFrame {
        scaled_moments: DVec3::from_array(moments.map(|i| i.high)),
        is_linear_rotor,
        principal_to_body,
        moment_exponent: moment_exponent + second,
        rate_exponent,
    };
    (body_frame, Initial { moments, angular_velocity, orientation: Quaternion::new(q.x, q.y, q.z, q.w) })
}

fn rows(matrix: DMat3) -> [[f64; 3]; 3] {
    matrix.transpose().to_cols_array_2d()
}

/// The moments, ascending, and axes of `tensor`, from a frame that is right to rounding in `f64`.
fn refined(tensor: &InertiaTensor, principal_to_body: DQuat) -> ([Dd; 3], Matrix, DQuat) {
    let mut axes = rotation_matrix(principal_to_body);
    let body = rows(tensor.to_matrix()).map(|row| row.map(Dd::from));
    let mut a = product(&transposed(&axes), &product(&body, &axes));
    for _ in 0..SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            rotate(&mut a, &mut axes, p, q);
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| a[i][i].high.total_cmp(&a[j][j].high).then(a[i][i].low.total_cmp(&a[j][j].low)));
    let column = |i: usize| [axes[0][i], axes[1][i], axes[2][i]];
    let (x, y) = (column(order[0]), column(order[1]));
    let cross = |i: usize, j: usize| x[i] * y[j] - x[j] * y[i];
    let z = [cross(1, 2), cross(2, 0), cross(0, 1)];
    let frame: Matrix = std::array::from_fn(|i| [x[i], y[i], z[i]]);
    let rounded = DMat3::from_cols_array_2d(&frame.map(|row| row.map(Dd::to_f64))).transpose();
    (order.map(|i| a[i][i]), frame, DQuat::from_mat3(&rounded).normalize())
}

/// The rotation matrix of a quaternion that is a unit one to rounding in `f64`, orthogonal to double-double rounding.
fn rotation_matrix(q: DQuat) -> Matrix {
    let [x, y, z, w] = q.to_array();
    let square = |a: f64, b: f64| Dd::product_of(a, b);
    let norm = square(x, x) + square(y, y) + square(z, z) + square(w, w);
    let two_over = (ONE + ONE) / norm;
    let off = |a: Dd, b: Dd| (a + b) * two_over;
    let on = |a: f64, b: f64| ONE - (square(a, a) + square(b, b)) * two_over;
    [
        [on(y, z), off(square(x, y), -square(w, z)), off(square(x, z), square(w, y))],
        [off(square(x, y), square(w, z)), on(x, z), off(square(y, z), -square(w, x))],
        [off(square(x, z), -square(w, y)), off(square(y, z), square(w, x)), on(x, y)],
    ]
}

fn transposed(a: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).fold(ZERO, |sum, k| sum + a[i][k] * b[k][j])))
}

/// One Jacobi rotation, which makes a[p][q] vanish (as in `inertia::principal_axes`).
fn rotate(a: &mut Matrix, axes: &mut Matrix, p: usize, q: usize) {
    let off = a[p][q];
    if off.high.abs() <= NEGLIGIBLE * a[p][p].high.abs().min(a[q][q].high.abs()) {
        return;
    }
    let theta = (a[q][q] - a[p][p]) / (off + off);
    // Beyond 1e150 the square would overflow, and t = 1/(2 theta) to all digits.
    let root = if theta.high.abs() < 1e150 { (theta.squared() + ONE).sqrt() } else { theta.abs() };
    let size = ONE / (theta.abs() + root);
    let t = if theta.high < 0.0 { -size } else { size };
    let c = ONE / (t.squared() + ONE).sqrt();
    let s = t * c;
    a[p][p] = a[p][p] - t * off;
    a[q][q] = a[q][q] + t * off;
    a[p][q] = ZERO;
    a[q][p] = ZERO;
    let r = 3 - p - q;
    let (rp, rq) = (a[r][p], a[r][q]);
    a[r][p] = c * rp - s * rq;
    a[p][r] = a[r][p];
    a[r][q] = s * rp + c * rq;
    a[q][r] = a[r][q];
    for row in axes.iter_mut() {
        let (x, y) = (row[p], row[q]);
        row[p] = c * x - s * y;
        row[q] = s * x + c * y;
    }
}
