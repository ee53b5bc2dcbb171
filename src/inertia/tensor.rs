//! The inertia tensor of a rigid body.

use glam::{DMat3, DVec3};

/// The inertia tensor about the centre of mass, in body axes, kg m².
///
/// The off-diagonal entries are the tensor's *elements*: `xy` = −∫ρxy, not the product of inertia +∫ρxy.
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
