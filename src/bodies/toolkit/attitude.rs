//! Attitudes as axis and angle, as matrices and as modified Rodrigues parameters.

use glam::{DMat3, DQuat, DVec3};

use super::rotation::{exponential, logarithm};

/// A rotation by `angle` about `axis`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisAngle {
    /// Unit vector, the same in body and world axes.
    pub axis: DVec3,
    /// rad, right-handed about the axis.
    pub angle: f64,
}

impl From<DQuat> for AxisAngle {
    /// With the angle in [0, π]; the axis of the identity is x.
    fn from(orientation: DQuat) -> Self {
        let vector = logarithm(orientation);
        let angle = 2.0 * orientation.xyz().length().atan2(orientation.w.abs());
        // In units of its largest component, as the squares of a tiny angle underflow.
        let axis = (vector / vector.abs().max_element()).try_normalize().unwrap_or(DVec3::X);
        Self { axis, angle }
    }
}

impl From<AxisAngle> for DQuat {
    fn from(rotation: AxisAngle) -> Self {
        exponential(rotation.axis * rotation.angle)
    }
}

/// The rotation matrix of a unit quaternion: body coordinates to world.
pub fn matrix_of_orientation(orientation: DQuat) -> DMat3 {
    DMat3::from_quat(orientation)
}

/// The unit quaternion with w ≥ 0 of a rotation matrix.
///
/// The largest of the four components is taken from the diagonal, the others from sums and differences of off-diagonal
/// elements (S. W. Shepperd, J. Guid. Control 1 (1978) 223), so that no rotation is special.
pub fn orientation_of_matrix(rotation: DMat3) -> DQuat {
    let [x, y, z] = rotation.to_cols_array_2d();
    let trace = x[0] + y[1] + z[2];
    let squares = [1.0 + 2.0 * x[0] - trace, 1.0 + 2.0 * y[1] - trace, 1.0 + 2.0 * z[2] - trace, 1.0 + trace];
    // Four times the products of two components.
    let (xy, yz, zx) = (x[1] + y[0], y[2] + z[1], z[0] + x[2]);
    let (wx, wy, wz) = (y[2] - z[1], z[0] - x[2], x[1] - y[0]);
    let rows = [[squares[0], xy, zx, wx], [xy, squares[1], yz, wy], [zx, yz, squares[2], wz], [wx, wy, wz, squares[3]]];
    let largest = (0..4).fold(3, |best, i| if squares[i] > squares[best] { i } else { best });
    let q = DQuat::from_array(rows[largest]).normalize();
    if q.w < 0.0 { -q } else { q }
}

/// Modified Rodrigues parameters σ = n tan(θ/4), n the axis and θ the angle (T. F. Wiener 1962; H. Schaub, J. L.
/// Junkins, *Analytical Mechanics of Space Systems*, 4th ed., section 3.6).
///
/// Each attitude has two sets, σ and its shadow −σ/|σ|², one within the unit sphere and one outside; the parameters
/// are singular at a full turn only, and changing to the shadow set at |σ| = 1 avoids that.
///
/// ```
/// use glam::DQuat;
/// use polhode::bodies::toolkit::ModifiedRodrigues;
///
/// let q = DQuat::from_rotation_z(3.0);
/// let sigma = ModifiedRodrigues::from(q);
/// assert!((sigma.vector.z - 0.75_f64.tan()).abs() < 1e-15);
/// assert!((DQuat::from(sigma.shadow()) + q).length() < 1e-15); // the same attitude, −q
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ModifiedRodrigues {
    /// n tan(θ/4).
    pub vector: DVec3,
}

impl ModifiedRodrigues {
    /// The other set of the same attitude, −σ/|σ|²; not finite for the attitude without rotation.
    pub fn shadow(self) -> Self {
        Self { vector: -self.vector / self.vector.length_squared() }
    }

    /// The one of the two sets that lies within the unit sphere.
    pub fn shorter(self) -> Self {
        if self.vector.length_squared() > 1.0 { self.shadow() } else { self }
    }

    /// dσ/dt = ¼ [(1 − σ²) 1 + 2 \[σ\]× + 2 σ σᵀ] ω_body (Schaub and Junkins, section 3.6).
    pub fn rate(self, angular_velocity_body: DVec3) -> DVec3 {
        let (s, w) = (self.vector, angular_velocity_body);
        0.25 * ((1.0 - s.length_squared()) * w + 2.0 * s.cross(w) + 2.0 * s * s.dot(w))
    }
}

impl From<DQuat> for ModifiedRodrigues {
    /// The set within the unit sphere (rotation by at most π).
    fn from(orientation: DQuat) -> Self {
        let q = if orientation.w < 0.0 { -orientation } else { orientation };
        Self { vector: q.xyz() / (1.0 + q.w) }
    }
}

impl From<ModifiedRodrigues> for DQuat {
    /// With w ≥ 0 for the set within the unit sphere, w < 0 for its shadow.
    fn from(parameters: ModifiedRodrigues) -> Self {
        let square = parameters.vector.length_squared();
        let u = 2.0 * parameters.vector / (1.0 + square);
        DQuat::from_xyzw(u.x, u.y, u.z, (1.0 - square) / (1.0 + square))
    }
}
