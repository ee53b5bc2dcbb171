//! Sums of mass, first and second moments about a reference point.

use glam::DVec3;

use super::{InertiaTensor, MassProperties};

/// The number of moments up to the second: 1, x, y, z, xx, yy, zz, xy, xz, yz.
pub(super) const MOMENTS: usize = 10;

/// ∫ρ, ∫ρ r and ∫ρ r rᵀ about a reference point, summed with the rounding errors kept.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moments {
    sum: [f64; MOMENTS],
    lost: [f64; MOMENTS],
}

/// 1, r and the six products of the components of r, in the order of [`Moments`].
pub(super) fn monomials(r: DVec3) -> [f64; MOMENTS] {
    [1.0, r.x, r.y, r.z, r.x * r.x, r.y * r.y, r.z * r.z, r.x * r.y, r.x * r.z, r.y * r.z]
}

impl Moments {
    /// Adds a term (A. Neumaier, Z. angew. Math. Mech. 54 (1974) 39): the error of the sum does not grow with the
    /// number of terms, which for a mesh is a million.
    pub fn add(&mut self, term: [f64; MOMENTS]) {
        for ((sum, lost), term) in self.sum.iter_mut().zip(&mut self.lost).zip(term) {
            let total = *sum + term;
            *lost += if sum.abs() >= term.abs() { (*sum - total) + term } else { (term - total) + *sum };
            *sum = total;
        }
    }

    /// The ten sums.
    pub fn total(&self) -> [f64; MOMENTS] {
        std::array::from_fn(|i| self.sum[i] + self.lost[i])
    }
}

/// The body whose moments about `reference` are `total`; the volume is given separately, as the moments may be those of mass.
///
/// Second moments about the centre of mass are a difference, so the reference should lie within the body.
pub(super) fn mass_properties(total: [f64; MOMENTS], volume: f64, reference: DVec3) -> MassProperties {
    let [mass, x, y, z, xx, yy, zz, xy, xz, yz] = total;
    let offset = DVec3::new(x, y, z) / mass;
    let inertia =
        InertiaTensor::from_second_moments([xx, yy, zz, xy, xz, yz]) - InertiaTensor::of_point_mass(mass, offset);
    MassProperties { mass, volume, centre_of_mass: reference + offset, inertia }
}
