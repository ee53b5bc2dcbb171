//! Principal moments and axes in two words.

use glam::{DQuat, DVec3};

use super::InertiaTensor;
use super::principal::{
    PLANES, PermutationEntry, ascending, half_turned, nearest_to_identity, permutation, principal_axes,
};
use crate::math::double_double::DoubleDouble;
use crate::math::vector::TwoWords;

/// The frame in which an inertia tensor is diagonal, to about 30 decimal digits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefinedPrincipalAxes {
    /// I₁ ≤ I₂ ≤ I₃, kg m², each the sum of a value and a residue of at most half an ulp.
    pub moments: TwoWords<DVec3>,
    /// Rotates principal coordinates to body coordinates (right-handed): the unit quaternion `value + residue`.
    pub principal_to_body: TwoWords<DQuat>,
}

type Dd = DoubleDouble;

const ZERO: Dd = Dd { high: 0.0, low: 0.0 };
const ONE: Dd = Dd { high: 1.0, low: 0.0 };

/// √½, first and second word.
const ROOT_HALF: Dd = Dd { high: std::f64::consts::FRAC_1_SQRT_2, low: -4.833646656726457e-17 };

/// The most sweeps of the iteration: the start is diagonal to 1e-15, and convergence is quadratic.
const SWEEP_LIMIT: usize = 12;

/// Tangent of a rotation angle that no longer changes an axis of 106 bits.
const NEGLIGIBLE_TANGENT: f64 = 1e-33;

/// Principal moments, ascending, and axes of `tensor` in two words; the six elements count as exact.
///
/// The phase of a torque-free motion over thousands of radians needs moments better than one word holds: their rounding alone costs 1e-16
/// of the angle turned. [`principal_axes`] gives the start; Jacobi's method continues from there in two words, on the tensor rotated by the
/// start, so that equal and nearly equal moments need no special treatment. The moments' error is a few units of 2⁻¹⁰² of the largest
/// moment. Order and choice among the equivalent frames are those of [`principal_axes`].
///
/// ```
/// use polhode::bodies::inertia::{InertiaTensor, principal_axes_refined};
///
/// // Moments (3 ∓ √5)/2 and 3: the second word is what the first lacks.
/// let tensor = InertiaTensor { xx: 1.0, yy: 2.0, zz: 3.0, xy: 1.0, xz: 0.0, yz: 0.0 };
/// let moments = principal_axes_refined(&tensor).moments;
/// assert_eq!(moments.value.x, 0.38196601125010515);
/// assert!((moments.residue.x - -1.1899991944327682e-18).abs() < 1e-29, "{:e}", moments.residue.x);
/// ```
pub fn principal_axes_refined(tensor: &InertiaTensor) -> RefinedPrincipalAxes {
    let start = principal_axes(tensor);
    let mut turned = normalised(start.principal_to_body.to_array().map(Dd::from));
    let (mut diagonal, mut off) = in_frame(tensor, &turned);
    for _ in 0..SWEEP_LIMIT {
        if off == [ZERO; 3] {
            break;
        }
        for (k, p, q) in PLANES {
            let element = off[k];
            if element == ZERO {
                continue;
            }
            let (tangent, moved) = tangent_of(diagonal[q] - diagonal[p], element);
            diagonal[p] = diagonal[p] - moved;
            diagonal[q] = diagonal[q] + moved;
            off[k] = ZERO;
            if tangent.high.abs() < NEGLIGIBLE_TANGENT {
                continue;
            }
            let cosine = ONE / (tangent.squared() + ONE).sqrt();
            let sine = tangent * cosine;
            (off[q], off[p]) = (cosine * off[q] - sine * off[p], sine * off[q] + cosine * off[p]);
            let half_cosine = (ONE + cosine).scaled(0.5).sqrt();
            let half_sine = -(sine.scaled(0.5) / half_cosine);
            turn(&mut turned, (k, p, q), half_sine, half_cosine);
        }
    }
    let order = ascending(|i, j| {
        diagonal[i].high.total_cmp(&diagonal[j].high).then(diagonal[i].low.total_cmp(&diagonal[j].low))
    });
    if order != [0, 1, 2] {
        turned = product(turned, permutation(order).map(number));
    }
    let turned = normalised(turned);
    let nearest = nearest_to_identity(turned.map(|c| c.abs().high));
    let turned = half_turned(turned, nearest, |c| -c);
    let turned = if turned[3].high < 0.0 { turned.map(|c| -c) } else { turned };
    let moments = order.map(|i| diagonal[i]);
    RefinedPrincipalAxes {
        moments: TwoWords {
            value: DVec3::from_array(moments.map(|m| m.high)),
            residue: DVec3::from_array(moments.map(|m| m.low)),
        },
        principal_to_body: TwoWords {
            value: DQuat::from_array(turned.map(|c| c.high)),
            residue: DQuat::from_array(turned.map(|c| c.low)),
        },
    }
}

/// The tangent t of the angle of Jacobi's rotation, and t times the element: t² + 2 t θ = 1, θ = difference / (2
/// element).
fn tangent_of(difference: Dd, element: Dd) -> (Dd, Dd) {
    let theta = difference / element.scaled(2.0);
    // Beyond this, θ² overflows or its quotient has no second word; 1/(2θ) is then accurate to more than two words.
    if theta.high.abs() > 1e100 || !theta.high.is_finite() {
        let tangent = if theta.high.is_finite() { ONE / theta.scaled(2.0) } else { ZERO };
        return (tangent, tangent * element);
    }
    let magnitude = ONE / (theta.abs() + (theta.squared() + ONE).sqrt());
    let tangent = if theta.high.is_sign_negative() { -magnitude } else { magnitude };
    (tangent, tangent * element)
}

fn number(entry: PermutationEntry) -> Dd {
    match entry {
        PermutationEntry::Zero => ZERO,
        PermutationEntry::One => ONE,
        PermutationEntry::Half => Dd::from(0.5),
        PermutationEntry::MinusHalf => Dd::from(-0.5),
        PermutationEntry::RootHalf => ROOT_HALF,
    }
}

/// Diagonal and off-diagonal elements (as in [`PLANES`]) of Rᵀ I R, R the matrix of a unit quaternion.
fn in_frame(tensor: &InertiaTensor, quaternion: &[Dd; 4]) -> ([Dd; 3], [Dd; 3]) {
    let [x, y, z, w] = *quaternion;
    let twice = |a: Dd| a.scaled(2.0);
    let (xx, yy, zz) = (twice(x * x), twice(y * y), twice(z * z));
    let (xy, yz, zx) = (twice(x * y), twice(y * z), twice(z * x));
    let (wx, wy, wz) = (twice(w * x), twice(w * y), twice(w * z));
    let one = ONE;
    let columns =
        [[one - (yy + zz), xy + wz, zx - wy], [xy - wz, one - (zz + xx), yz + wx], [zx + wy, yz - wx, one - (xx + yy)]];
    let rows = [
        [tensor.xx, tensor.xy, tensor.xz].map(Dd::from),
        [tensor.xy, tensor.yy, tensor.yz].map(Dd::from),
        [tensor.xz, tensor.yz, tensor.zz].map(Dd::from),
    ];
    let dot = |a: &[Dd; 3], b: &[Dd; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let images = columns.map(|column| rows.map(|row| dot(&row, &column)));
    (std::array::from_fn(|i| dot(&columns[i], &images[i])), PLANES.map(|(_, p, q)| dot(&columns[p], &images[q])))
}

/// q ← q (sine e_k, cosine).
fn turn(quaternion: &mut [Dd; 4], (k, p, q): (usize, usize, usize), sine: Dd, cosine: Dd) {
    let c = *quaternion;
    quaternion[k] = c[k] * cosine + c[3] * sine;
    quaternion[p] = c[p] * cosine + c[q] * sine;
    quaternion[q] = c[q] * cosine - c[p] * sine;
    quaternion[3] = c[3] * cosine - c[k] * sine;
}

fn product([ax, ay, az, aw]: [Dd; 4], [bx, by, bz, bw]: [Dd; 4]) -> [Dd; 4] {
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by + ay * bw + az * bx - ax * bz,
        aw * bz + az * bw + ax * by - ay * bx,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
}

fn normalised(c: [Dd; 4]) -> [Dd; 4] {
    let norm = (c[0] * c[0] + c[1] * c[1] + c[2] * c[2] + c[3] * c[3]).sqrt();
    c.map(|component| component / norm)
}
