//! Principal moments and axes of a tensor.

use glam::{DQuat, DVec3};

use super::InertiaTensor;

/// The frame in which an inertia tensor is diagonal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrincipalAxes {
    /// I₁ ≤ I₂ ≤ I₃, kg m².
    pub moments: DVec3,
    /// Rotates principal coordinates to body coordinates (right-handed).
    pub principal_to_body: DQuat,
}

impl PrincipalAxes {
    /// The tensor in body axes that has these moments and axes.
    pub fn tensor(&self) -> InertiaTensor {
        InertiaTensor::from_principal_moments(self.moments).rotated(self.principal_to_body)
    }

    /// The axis of moment I₁, I₂ or I₃ (`index` 0, 1 or 2) as a unit vector in body axes.
    pub fn axis_body(&self, index: usize) -> DVec3 {
        self.principal_to_body * DVec3::AXES[index]
    }
}

/// The most sweeps of the iteration; convergence is quadratic, and six have always been enough.
const SWEEP_LIMIT: usize = 16;

/// Tangent of a rotation angle below which the rotation no longer changes an axis: a quarter of an ulp of 1.
const NEGLIGIBLE_TANGENT: f64 = 5.551115123125783e-17;

/// The three positions of a symmetric matrix's off-diagonal elements: `(k, p, q)` cyclic, the element in row p and
/// column q being stored as number k.
const PLANES: [(usize, usize, usize); 3] = [(0, 1, 2), (1, 2, 0), (2, 0, 1)];

/// Principal moments, ascending, and axes of `tensor`.
///
/// Jacobi's method (C. G. J. Jacobi, J. reine angew. Math. 30 (1846) 51; G. H. Golub, C. F. Van Loan, *Matrix
/// Computations*, 4th ed., section 8.5), which finds small eigenvalues of a positive definite matrix to high relative
/// accuracy. The axes are accumulated as a quaternion, so that they are a right-handed frame by construction.
///
/// Of the four right-handed frames that have the same axes, the result is the one turned least from the body axes, and equal moments keep
/// the order of the body axes; the result depends only on the six elements. For a diagonal tensor the moments are a permutation of its
/// entries, exactly. If all diagonal elements lie within a factor of two of one another, one of them is subtracted first (without
/// rounding), so that the axes of a nearly spherical body are as accurate as its tensor's deviation from a multiple of 1 allows. The
/// elements are not validated here.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::inertia::{InertiaTensor, principal_axes};
///
/// let tensor = InertiaTensor { xx: 2.0, yy: 2.0, zz: 3.5, xy: -1.0, xz: 0.0, yz: 0.0 };
/// let axes = principal_axes(&tensor);
/// assert!((axes.moments - DVec3::new(1.0, 3.0, 3.5)).abs().max_element() < 1e-15);
/// assert!((axes.axis_body(0).dot(DVec3::new(1.0, 1.0, 0.0).normalize()).abs() - 1.0).abs() < 1e-15);
/// ```
pub fn principal_axes(tensor: &InertiaTensor) -> PrincipalAxes {
    let mut diagonal = [tensor.xx, tensor.yy, tensor.zz];
    let mut off = [tensor.yz, tensor.xz, tensor.xy];
    if off == [0.0; 3] {
        let axes = AxisPermutation::ascending(diagonal);
        return PrincipalAxes {
            moments: DVec3::from_array(axes.order.map(|axis| diagonal[axis])),
            principal_to_body: axes.principal_to_body,
        };
    }
    let smallest = diagonal[0].min(diagonal[1]).min(diagonal[2]);
    let largest = diagonal[0].max(diagonal[1]).max(diagonal[2]);
    // Differences of numbers within a factor of two are exact (P. H. Sterbenz, Floating-Point Computation, 1974).
    let shift = if smallest > 0.0 && largest <= 2.0 * smallest { diagonal[0] } else { 0.0 };
    diagonal = diagonal.map(|d| d - shift);

    let mut turned = [0.0, 0.0, 0.0, 1.0];
    let mut is_turned = false;
    for _ in 0..SWEEP_LIMIT {
        if off == [0.0; 3] {
            break;
        }
        for (k, p, q) in PLANES {
            let element = off[k];
            if element == 0.0 {
                continue;
            }
            let theta = (diagonal[q] - diagonal[p]) / (2.0 * element);
            let tangent = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let moved = tangent * element;
            diagonal[p] -= moved;
            diagonal[q] += moved;
            off[k] = 0.0;
            if tangent.abs() < NEGLIGIBLE_TANGENT {
                continue;
            }
            is_turned = true;
            let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
            let sine = tangent * cosine;
            (off[q], off[p]) = (cosine * off[q] - sine * off[p], sine * off[q] + cosine * off[p]);
            let half_cosine = (0.5 + 0.5 * cosine).sqrt();
            turn(&mut turned, (k, p, q), -0.5 * sine / half_cosine, half_cosine);
        }
    }
    let order = ascending(|i, j| diagonal[i].total_cmp(&diagonal[j]));
    let mut quaternion = permuted(turned, order);
    if is_turned {
        let norm_squared = quaternion.iter().map(|c| c * c).sum::<f64>();
        let factor = 1.5 - 0.5 * norm_squared;
        quaternion = quaternion.map(|c| c * factor);
    }
    let nearest = nearest_to_identity(quaternion.map(f64::abs));
    let quaternion = half_turned(quaternion, nearest);
    let sign = if quaternion[3] < 0.0 { -1.0 } else { 1.0 };
    PrincipalAxes {
        moments: DVec3::from_array(order.map(|i| diagonal[i] + shift)),
        principal_to_body: DQuat::from_array(quaternion.map(|c| sign * c)),
    }
}

/// Principal axes that lie along body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AxisPermutation {
    /// The body axis along which each principal axis lies.
    pub order: [usize; 3],
    /// +1 if it points the same way, −1 if it points the other.
    pub signs: [f64; 3],
    /// Rotates principal coordinates to body coordinates, by the least angle among all rotations to these axes.
    pub principal_to_body: DQuat,
}

impl AxisPermutation {
    /// The axes of a diagonal tensor, by ascending moment; equals keep their order.
    ///
    /// The permutation follows from three comparisons without a branch, as a branch could not be predicted over many bodies.
    pub fn ascending([first, second, third]: [f64; 3]) -> Self {
        let bit = |is_less: bool, place: u32| usize::from(is_less) << place;
        PERMUTATIONS[bit(second < first, 0) | bit(third < second, 1) | bit(third < first, 2)]
    }

    /// Body coordinates to principal, exactly.
    pub fn to_principal(self, vector_body: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.signs[axis] * vector_body[self.order[axis]])
    }
}

/// The permutations, indexed by the comparisons of three numbers: bit 0 is set if the second is less than the first, bit 1 if the third is
/// less than the second, bit 2 if the third is less than the first. Entries 3 and 4 cannot occur.
static PERMUTATIONS: [AxisPermutation; 8] = {
    use std::f64::consts::FRAC_1_SQRT_2 as R;
    const fn axes(order: [usize; 3], signs: [f64; 3], [x, y, z, w]: [f64; 4]) -> AxisPermutation {
        AxisPermutation { order, signs, principal_to_body: DQuat::from_xyzw(x, y, z, w) }
    }
    let identity = axes([0, 1, 2], [1.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]);
    let reversed = axes([2, 1, 0], [1.0, 1.0, -1.0], [0.0, -R, 0.0, R]);
    [
        identity,
        axes([1, 0, 2], [1.0, -1.0, 1.0], [0.0, 0.0, R, R]),
        axes([0, 2, 1], [1.0, 1.0, -1.0], [R, 0.0, 0.0, R]),
        reversed,
        identity,
        axes([1, 2, 0], [1.0, 1.0, 1.0], [0.5, 0.5, 0.5, 0.5]),
        axes([2, 0, 1], [1.0, 1.0, 1.0], [-0.5, -0.5, -0.5, 0.5]),
        reversed,
    ]
};

/// q ← q (sine e_k, cosine): a turn about axis k, with `sine` and `cosine` of half its angle.
fn turn(quaternion: &mut [f64; 4], (k, p, q): (usize, usize, usize), sine: f64, cosine: f64) {
    let c = *quaternion;
    quaternion[k] = c[k] * cosine + c[3] * sine;
    quaternion[p] = c[p] * cosine + c[q] * sine;
    quaternion[q] = c[q] * cosine - c[p] * sine;
    quaternion[3] = c[3] * cosine - c[k] * sine;
}

/// The indices 0, 1, 2 in ascending order of the elements they denote; equals keep their order.
fn ascending(mut compare: impl FnMut(usize, usize) -> std::cmp::Ordering) -> [usize; 3] {
    let mut order = [0, 1, 2];
    let mut sort = |order: &mut [usize; 3], place: usize| {
        let swaps = compare(order[place + 1], order[place]).is_lt();
        if swaps {
            order.swap(place, place + 1);
        }
        swaps
    };
    sort(&mut order, 0);
    if sort(&mut order, 1) {
        sort(&mut order, 0);
    }
    order
}

/// The quaternion (x, y, z, w) of the rotation that takes the axes 0, 1, 2 to `order` (up to the sign of an axis).
fn permutation(order: [usize; 3]) -> [f64; 4] {
    use std::f64::consts::FRAC_1_SQRT_2 as R;
    match order {
        [0, 1, 2] => [0.0, 0.0, 0.0, 1.0],
        [1, 2, 0] => [0.5, 0.5, 0.5, 0.5],
        [2, 0, 1] => [-0.5, -0.5, -0.5, 0.5],
        [1, 0, 2] => [R, R, 0.0, 0.0],
        [0, 2, 1] => [0.0, R, R, 0.0],
        _ => [R, 0.0, R, 0.0],
    }
}

fn permuted(turned: [f64; 4], order: [usize; 3]) -> [f64; 4] {
    if order == [0, 1, 2] {
        return turned;
    }
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (turned, permutation(order));
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by + ay * bw + az * bx - ax * bz,
        aw * bz + az * bw + ax * by - ay * bx,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
}

/// The half turn about a principal axis (0, 1, 2; 3 for none) that brings a frame nearest to the body axes: it makes the largest component
/// the scalar part. Among equals the scalar part itself comes first.
fn nearest_to_identity(magnitudes: [f64; 4]) -> usize {
    let mut best = 3;
    for k in 0..3 {
        if magnitudes[k] > magnitudes[best] {
            best = k;
        }
    }
    best
}

/// The quaternion after a half turn about principal axis `k` (3 for none), which only permutes its components.
fn half_turned(c: [f64; 4], k: usize) -> [f64; 4] {
    if k == 3 {
        return c;
    }
    let (k, p, q) = PLANES[k];
    let mut turned = c;
    turned[3] = c[k];
    turned[k] = -c[3];
    turned[p] = -c[q];
    turned[q] = c[p];
    turned
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn diagonal_tensors_give_what_the_general_way_gives() {
        for diagonal in
            [[1.0, 2.0, 3.0], [2.0, 3.0, 1.0], [3.0, 1.0, 2.0], [2.0, 1.0, 3.0], [1.0, 3.0, 2.0], [3.0, 2.0, 1.0]]
        {
            let axes = AxisPermutation::ascending(diagonal);
            let quaternion = permuted([0.0, 0.0, 0.0, 1.0], axes.order);
            let quaternion = half_turned(quaternion, nearest_to_identity(quaternion.map(f64::abs)));
            assert_eq!(axes.principal_to_body, DQuat::from_array(quaternion), "{diagonal:?}");
            let vector = DVec3::new(0.3, -1.1, 0.7);
            let turned = axes.principal_to_body.conjugate() * vector;
            let exact = DVec3::from_array(axes.to_principal(vector.to_array()));
            assert!((turned - exact).abs().max_element() < 1e-15, "{diagonal:?}: {turned} {exact}");
        }
        // Equal moments keep the order of the body axes.
        for number in 0..27 {
            let diagonal = [number / 9, number / 3 % 3, number % 3].map(f64::from);
            let sorted = ascending(|i, j| diagonal[i].total_cmp(&diagonal[j]));
            assert_eq!(AxisPermutation::ascending(diagonal).order, sorted, "{diagonal:?}");
        }
    }
}
