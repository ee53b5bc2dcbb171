//! The inertia tensor of a rigid body.

use std::ops::{Add, Mul, Sub};

use glam::{DMat3, DQuat, DVec3};

use crate::math::operators;

/// The inertia tensor about the centre of mass, in body axes, kg m².
///
/// The off-diagonal entries are the tensor's *elements*: `xy` = −∫ρxy, not the product of inertia +∫ρxy.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::inertia::InertiaTensor;
///
/// // A dumb-bell on the x axis resists turning about y and z, not about x.
/// let dumbbell = InertiaTensor::of_point_mass(1.0, DVec3::X) + InertiaTensor::of_point_mass(1.0, -DVec3::X);
/// assert_eq!(dumbbell.to_array(), [0.0, 2.0, 2.0, 0.0, 0.0, 0.0]);
/// assert_eq!(dumbbell * DVec3::Y, DVec3::new(0.0, 2.0, 0.0));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InertiaTensor {
    /// ∫ρ(y² + z²).
    pub xx: f64,
    /// ∫ρ(z² + x²).
    pub yy: f64,
    /// ∫ρ(x² + y²).
    pub zz: f64,
    /// −∫ρxy.
    pub xy: f64,
    /// −∫ρxz.
    pub xz: f64,
    /// −∫ρyz.
    pub yz: f64,
}

impl InertiaTensor {
    /// The tensor of a body whose axes are its principal axes.
    pub fn from_principal_moments(moments: DVec3) -> Self {
        Self { xx: moments.x, yy: moments.y, zz: moments.z, ..Self::default() }
    }

    /// The tensor of six elements in the order xx, yy, zz, xy, xz, yz.
    pub fn from_array([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> Self {
        Self { xx, yy, zz, xy, xz, yz }
    }

    /// m \[r\]×ᵀ\[r\]×: what a point of `mass` kg at `position` m adds to the tensor about the origin.
    pub fn of_point_mass(mass: f64, position: DVec3) -> Self {
        let r = position;
        Self {
            xx: mass * (r.y * r.y + r.z * r.z),
            yy: mass * (r.z * r.z + r.x * r.x),
            zz: mass * (r.x * r.x + r.y * r.y),
            xy: -(mass * r.x * r.y),
            xz: -(mass * r.x * r.z),
            yz: -(mass * r.y * r.z),
        }
    }

    /// The tensor tr(S) 1 − S of the second moments S = ∫ρ r rᵀ, given in the order xx, yy, zz, xy, xz, yz, kg m².
    pub fn from_second_moments([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> Self {
        Self { xx: yy + zz, yy: zz + xx, zz: xx + yy, xy: -xy, xz: -xz, yz: -yz }
    }

    /// The tensor as a symmetric matrix.
    pub fn to_matrix(self) -> DMat3 {
        DMat3::from_cols(
            DVec3::new(self.xx, self.xy, self.xz),
            DVec3::new(self.xy, self.yy, self.yz),
            DVec3::new(self.xz, self.yz, self.zz),
        )
    }

    /// The six elements in the order xx, yy, zz, xy, xz, yz.
    pub fn to_array(self) -> [f64; 6] {
        [self.xx, self.yy, self.zz, self.xy, self.xz, self.yz]
    }

    /// The same tensor in other axes, R I Rᵀ, where R = `to_new_axes` (a unit quaternion) transforms coordinates in the present axes into
    /// coordinates in the new ones.
    ///
    /// With a body's orientation this is the tensor in world axes.
    pub fn rotated(self, to_new_axes: DQuat) -> Self {
        let r = DMat3::from_quat(to_new_axes);
        let (x, y, z) = (r.row(0), r.row(1), r.row(2));
        let (ix, iy, iz) = (self * x, self * y, self * z);
        Self { xx: x.dot(ix), yy: y.dot(iy), zz: z.dot(iz), xy: x.dot(iy), xz: x.dot(iz), yz: y.dot(iz) }
    }

    /// I⁻¹ v by the L D Lᵀ factorisation of the tensor, which needs no pivoting as the tensor is positive definite (G. H. Golub, C. F. Van
    /// Loan, *Matrix Computations*, 4th ed., section 4.2).
    ///
    /// Components are not finite if the tensor is singular: a linear rotor has no inverse.
    pub fn solve(self, v: DVec3) -> DVec3 {
        let (l_yx, l_zx) = (self.xy / self.xx, self.xz / self.xx);
        let d_y = self.yy - l_yx * self.xy;
        let e_zy = self.yz - l_yx * self.xz;
        let l_zy = e_zy / d_y;
        let d_z = self.zz - l_zx * self.xz - l_zy * e_zy;
        let y = v.y - l_yx * v.x;
        let z = (v.z - l_zx * v.x - l_zy * y) / d_z;
        let y = y / d_y - l_zy * z;
        DVec3::new(v.x / self.xx - l_yx * y - l_zx * z, y, z)
    }

    /// The sum of the diagonal, which is the sum of the principal moments in any axes.
    pub fn trace(self) -> f64 {
        self.xx + self.yy + self.zz
    }

    /// The Frobenius norm, the root of the sum of the squares of the nine elements.
    pub fn norm(self) -> f64 {
        let largest = self.to_array().iter().fold(0.0_f64, |m, e| m.max(e.abs()));
        if largest == 0.0 || !largest.is_finite() {
            return largest;
        }
        // Scaled, as squares of molecular moments underflow.
        let s = self * (1.0 / largest);
        let off = s.xy * s.xy + s.xz * s.xz + s.yz * s.yz;
        largest * (s.xx * s.xx + s.yy * s.yy + s.zz * s.zz + 2.0 * off).sqrt()
    }

    /// Whether the body axes are principal: all off-diagonal elements are zero.
    pub fn is_diagonal(self) -> bool {
        self.xy == 0.0 && self.xz == 0.0 && self.yz == 0.0
    }

    /// Whether all six elements are finite.
    pub fn is_finite(self) -> bool {
        self.to_array().iter().all(|e| e.is_finite())
    }
}

impl From<DVec3> for InertiaTensor {
    /// Principal moments along the body axes.
    fn from(moments: DVec3) -> Self {
        Self::from_principal_moments(moments)
    }
}

impl From<DMat3> for InertiaTensor {
    /// The symmetric part of the matrix.
    fn from(matrix: DMat3) -> Self {
        let mean = |a: f64, b: f64| if a == b { a } else { 0.5 * a + 0.5 * b };
        Self {
            xx: matrix.x_axis.x,
            yy: matrix.y_axis.y,
            zz: matrix.z_axis.z,
            xy: mean(matrix.x_axis.y, matrix.y_axis.x),
            xz: mean(matrix.x_axis.z, matrix.z_axis.x),
            yz: mean(matrix.y_axis.z, matrix.z_axis.y),
        }
    }
}

impl From<InertiaTensor> for DMat3 {
    /// The tensor as a symmetric matrix.
    fn from(tensor: InertiaTensor) -> Self {
        tensor.to_matrix()
    }
}

impl Mul<DVec3> for InertiaTensor {
    type Output = DVec3;
    /// I v.
    fn mul(self, v: DVec3) -> DVec3 {
        DVec3::new(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )
    }
}

operators! { [] InertiaTensor:
    Mul::mul(self, factor: f64) = Self::from_array(self.to_array().map(|e| e * factor));
    Add::add(self, other: Self) = {
        let (a, b) = (self.to_array(), other.to_array());
        Self::from_array(std::array::from_fn(|i| a[i] + b[i]))
    };
    Sub::sub(self, other: Self) = {
        let (a, b) = (self.to_array(), other.to_array());
        Self::from_array(std::array::from_fn(|i| a[i] - b[i]))
    };
}
