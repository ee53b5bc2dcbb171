//! Principal moments and axes of a tensor.

use glam::{DMat3, DQuat, DVec3};

use super::InertiaTensor;

/// The frame in which an inertia tensor is diagonal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrincipalAxes {
    /// I₁ ≤ I₂ ≤ I₃, kg m².
    pub moments: DVec3,
    /// Rotates principal coordinates to body coordinates (right-handed).
    pub principal_to_body: DQuat,
}

/// Sweeps of Jacobi's method after which a 3×3 matrix is diagonal to rounding; convergence is quadratic, five suffice.
const SWEEPS: usize = 8;

/// Principal moments, ascending, and axes of `tensor`.
///
/// Jacobi's method (C. G. J. Jacobi 1846; G. H. Golub, C. F. Van Loan, *Matrix Computations*, 4th ed., section 8.5), which
/// finds small eigenvalues of a positive definite matrix to high relative accuracy. A diagonal tensor gives a
/// permutation of its own entries, exactly. The entries are not validated here.
pub fn principal_axes(tensor: &InertiaTensor) -> PrincipalAxes {
    let mut a =
        [[tensor.xx, tensor.xy, tensor.xz], [tensor.xy, tensor.yy, tensor.yz], [tensor.xz, tensor.yz, tensor.zz]];
    let mut axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..SWEEPS {
        if a[0][1] == 0.0 && a[0][2] == 0.0 && a[1][2] == 0.0 {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            rotate(&mut a, &mut axes, p, q);
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| a[i][i].total_cmp(&a[j][j]));
    let column = |i: usize| DVec3::new(axes[0][i], axes[1][i], axes[2][i]);
    let (x, y) = (column(order[0]), column(order[1]));
    // The third axis is completed rather than copied, so that the frame is right-handed.
    let frame = DMat3::from_cols(x, y, x.cross(y));
    PrincipalAxes {
        moments: DVec3::new(a[order[0]][order[0]], a[order[1]][order[1]], a[order[2]][order[2]]),
        principal_to_body: DQuat::from_mat3(&frame).normalize(),
    }
}

/// One Jacobi rotation, which makes a[p][q] vanish.
fn rotate(a: &mut [[f64; 3]; 3], axes: &mut [[f64; 3]; 3], p: usize, q: usize) {
    let off = a[p][q];
    if off == 0.0 {
        return;
    }
    // An off-diagonal element that no longer changes either diagonal element is zero to rounding.
    if a[p][p].abs() + off.abs() == a[p][p].abs() && a[q][q].abs() + off.abs() == a[q][q].abs() {
        a[p][q] = 0.0;
        a[q][p] = 0.0;
        return;
    }
    let theta = (a[q][q] - a[p][p]) / (2.0 * off);
    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    a[p][p] -= t * off;
    a[q][q] += t * off;
    a[p][q] = 0.0;
    a[q][p] = 0.0;
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
