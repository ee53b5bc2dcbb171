//! Bodies given as a grid of boxes of constant density, as from tomography and voxel models.

use glam::DVec3;

use super::moments::{Moments, mass_properties, monomials};
use super::{InertiaTensor, MassProperties};
use crate::error::{Error, Result};

/// A regular grid of voxels, each a box of constant density.
#[derive(Clone, Copy, Debug)]
pub struct VoxelGrid<'a> {
    /// Densities, kg/m³, shape `[nz][ny][nx]` flattened: x runs fastest. 0 where there is no matter.
    pub densities: &'a [f64],
    /// nx, ny, nz.
    pub counts: [usize; 3],
    /// Edges of one voxel, m.
    pub spacing: DVec3,
    /// The corner of the grid with the smallest coordinates, m.
    pub corner: DVec3,
}

impl VoxelGrid<'_> {
    /// The mass properties of the grid, exact for the boxes (their own inertia ρV h²/12 included). The volume is that
    /// of the voxels whose density is not zero.
    ///
    /// # Errors
    /// [`Error::ColumnLength`] where the number of densities is not nx ny nz, [`Error::Item`] with the number of the
    /// first voxel whose density is negative or not finite, [`Error::Setting`] where spacing is not positive, the
    /// corner is not finite or all densities are zero.
    ///
    /// ```
    /// use glam::DVec3;
    /// use polhode::bodies::inertia::VoxelGrid;
    ///
    /// let grid = VoxelGrid { densities: &[1.0, 3.0], counts: [2, 1, 1], spacing: DVec3::ONE, corner: DVec3::ZERO };
    /// let body = grid.mass_properties()?;
    /// assert_eq!(body.mass, 4.0);
    /// assert_eq!(body.centre_of_mass, DVec3::new(1.25, 0.5, 0.5));
    /// # Ok::<(), polhode::Error>(())
    /// ```
    pub fn mass_properties(&self) -> Result<MassProperties> {
        let [nx, ny, nz] = self.counts;
        let expected = nx.saturating_mul(ny).saturating_mul(nz);
        if self.densities.len() != expected {
            return Err(Error::ColumnLength { column: "densities".into(), found: self.densities.len(), expected });
        }
        for edge in self.spacing.to_array() {
            super::mass_properties::positive("spacing", edge)?;
        }
        super::mass_properties::finite("corner", self.corner)?;
        let cell = self.spacing.element_product();
        let reference = 0.5 * DVec3::new(nx as f64, ny as f64, nz as f64) * self.spacing;
        let mut moments = Moments::default();
        let mut filled = 0_usize;
        for (voxel, &density) in self.densities.iter().enumerate() {
            if !(density >= 0.0 && density.is_finite()) {
                let expected = "at least 0 and finite";
                return Err(Error::Item { item: "voxel", index: voxel, field: "density", value: density, expected });
            }
            if density == 0.0 {
                continue;
            }
            filled += 1;
            let (i, j, k) = (voxel % nx, voxel / nx % ny, voxel / (nx * ny));
            let centre = (DVec3::new(i as f64, j as f64, k as f64) + 0.5) * self.spacing - reference;
            let mass = density * cell;
            moments.add(monomials(centre).map(|monomial| mass * monomial));
        }
        let total = moments.total();
        super::mass_properties::positive("mass of all voxels", total[0])?;
        let body = mass_properties(total, filled as f64 * cell, self.corner + reference);
        // Every voxel adds the same multiple of its mass about its own centre.
        let square = self.spacing * self.spacing * (total[0] / 12.0);
        let own = InertiaTensor::from_second_moments([square.x, square.y, square.z, 0.0, 0.0, 0.0]);
        Ok(MassProperties { inertia: body.inertia + own, ..body })
    }
}
