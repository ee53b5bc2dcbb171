//! Bodies given by a density function, integrated over a box with an error estimate.

use std::collections::BinaryHeap;

use glam::DVec3;

use super::MassProperties;
use super::mass_properties::{finite, positive};
use super::moments::{MOMENTS, Moments, mass_properties, monomials};
use crate::error::{Error, Result};

/// A body whose density is given as a function of position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DensityQuadrature {
    /// The corner of the box with the smallest coordinates, m.
    pub lower: DVec3,
    /// The corner of the box with the largest coordinates, m.
    pub upper: DVec3,
    /// The relative error to be reached: of the mass, of first moments relative to mass times half the box's diagonal,
    /// and of second moments relative to mass times that length squared.
    pub relative_tolerance: f64,
    /// The most evaluations of the density; each box takes 33.
    pub evaluation_limit: usize,
}

/// Mass properties with estimates of their errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DensityIntegral {
    /// The result; its volume is that of the whole box, as the extent of the matter is not known.
    pub properties: MassProperties,
    /// Estimated error of the mass, kg.
    pub mass_error: f64,
    /// Estimated error of each coordinate of the centre of mass, m.
    pub centre_of_mass_error: f64,
    /// Estimated error of each element of the tensor, kg m².
    pub inertia_error: f64,
    /// Number of evaluations of the density.
    pub evaluations: usize,
}

/// Nodes in a box.
const NODES: usize = 33;

impl DensityQuadrature {
    /// The integral over the box from `lower` to `upper`, to 1e-9 with at most ten million evaluations.
    pub fn new(lower: DVec3, upper: DVec3) -> Self {
        Self { lower, upper, relative_tolerance: 1e-9, evaluation_limit: 10_000_000 }
    }

    /// The same with another relative tolerance.
    pub fn with_tolerance(self, relative_tolerance: f64) -> Self {
        Self { relative_tolerance, ..self }
    }

    /// Mass properties of `density` (kg/m³ at a position in m).
    ///
    /// The rule of degree 7 with an embedded one of degree 5 (A. C. Genz, A. A. Malik, J. Comput. Appl. Math. 6
    /// (1980) 295), on boxes that are halved where the estimate is worst, along the axis with the largest fourth
    /// difference. The ten moments up to the second are integrated at the same nodes. Smooth densities converge fast;
    /// at a jump inside the box the error falls like the inverse of the number of evaluations to the power 1/3 to
    /// 2/3, so known boundaries belong on the faces of the box, or in the parts of a composition.
    ///
    /// # Errors
    /// [`Error::Setting`] where the box is not of positive, finite size, the tolerance is not positive, or the
    /// density is negative or not finite somewhere; [`Error::Quadrature`] where the limit of evaluations is reached
    /// first.
    ///
    /// ```
    /// use glam::DVec3;
    /// use polhode::bodies::inertia::DensityQuadrature;
    ///
    /// // Twice as dense at the bottom as at the top of a unit cube.
    /// let body = DensityQuadrature::new(DVec3::ZERO, DVec3::ONE).integrate(|place| 2.0 - place.z)?;
    /// assert!((body.properties.mass - 1.5).abs() < 1e-15);
    /// assert!((body.properties.centre_of_mass.z - 4.0 / 9.0).abs() < 1e-15);
    /// assert!(body.inertia_error < 1e-12);
    /// # Ok::<(), polhode::Error>(())
    /// ```
    pub fn integrate(&self, density: impl Fn(DVec3) -> f64) -> Result<DensityIntegral> {
        finite("lower", self.lower)?;
        finite("upper", self.upper)?;
        for edge in (self.upper - self.lower).to_array() {
            positive("upper - lower", edge)?;
        }
        positive("relative_tolerance", self.relative_tolerance)?;
        let reference = 0.5 * self.lower + 0.5 * self.upper;
        let half_edges = 0.5 * (self.upper - self.lower);
        let length = half_edges.length();
        // Errors of the ten moments are compared after division by mass times these.
        let scale: [f64; MOMENTS] = std::array::from_fn(|i| {
            if i == 0 {
                1.0
            } else if i < 4 {
                length
            } else {
                length * length
            }
        });
        let mut heap = BinaryHeap::new();
        // Starting from eight boxes: a single one can take a symmetric density for a constant.
        for octant in 0..8_u32 {
            let sign = |bit: u32| if octant >> bit & 1 == 0 { -0.5 } else { 0.5 };
            let centre = half_edges * DVec3::new(sign(0), sign(1), sign(2));
            heap.push(Region::new(&density, reference, centre, 0.5 * half_edges, &scale)?);
        }
        let mut evaluations = 8 * NODES;
        loop {
            // Summed anew each time the work has doubled, so that subtractions leave no residue in the sums.
            let (mut total, mut error) = sums(&heap);
            let resum_at = 2 * heap.len();
            loop {
                let mass = total[0];
                let worst = (0..MOMENTS).map(|i| error[i] / scale[i]).fold(0.0, f64::max);
                if mass > 0.0 && worst <= self.relative_tolerance * mass {
                    let (total, error) = sums(&heap);
                    return Ok(self.result(total, &error, reference, evaluations));
                }
                if evaluations + 2 * NODES > self.evaluation_limit {
                    if mass <= 0.0 {
                        positive("mass", mass)?;
                    }
                    return Err(Error::Quadrature {
                        evaluations,
                        relative_error: worst / mass,
                        relative_tolerance: self.relative_tolerance,
                    });
                }
                let Some(region) = heap.pop() else { unreachable!("the box is covered by at least one region") };
                for half in region.halves() {
                    let half = Region::new(&density, reference, half.0, half.1, &scale)?;
                    for i in 0..MOMENTS {
                        total[i] += half.integral[i];
                        error[i] += half.error[i];
                    }
                    heap.push(half);
                }
                for i in 0..MOMENTS {
                    total[i] -= region.integral[i];
                    error[i] -= region.error[i];
                }
                evaluations += 2 * NODES;
                if heap.len() >= resum_at {
                    break;
                }
            }
        }
    }

    fn result(
        &self,
        total: [f64; MOMENTS],
        error: &[f64; MOMENTS],
        reference: DVec3,
        evaluations: usize,
    ) -> DensityIntegral {
        let properties = mass_properties(total, (self.upper - self.lower).element_product(), reference);
        let mass = properties.mass;
        let largest = |errors: &[f64]| errors.iter().copied().fold(0.0, f64::max);
        let (first, second) = (largest(&error[1..4]), largest(&error[4..]));
        let offset = (properties.centre_of_mass - reference).length();
        let centre_of_mass_error = (first + error[0] * offset) / mass;
        // An element is a sum of at most two second moments less m d² terms, d the offset of the centre of mass.
        let inertia_error = 2.0 * (second + 2.0 * offset * first + offset * offset * error[0]);
        DensityIntegral { properties, mass_error: error[0], centre_of_mass_error, inertia_error, evaluations }
    }
}

/// Sums of integrals and error estimates over all regions.
fn sums(heap: &BinaryHeap<Region>) -> ([f64; MOMENTS], [f64; MOMENTS]) {
    let (mut total, mut error) = (Moments::default(), Moments::default());
    for region in heap {
        total.add(region.integral);
        error.add(region.error);
    }
    (total.total(), error.total())
}

/// A box with the integrals over it.
#[derive(Clone, Copy, Debug)]
struct Region {
    /// Centre of the box, relative to the reference point.
    centre: DVec3,
    half_edges: DVec3,
    integral: [f64; MOMENTS],
    error: [f64; MOMENTS],
    /// The largest error in units of the scale, by which the queue is ordered.
    priority: f64,
    split_axis: usize,
}

impl Region {
    fn new(
        density: &impl Fn(DVec3) -> f64,
        reference: DVec3,
        centre: DVec3,
        half_edges: DVec3,
        scale: &[f64; MOMENTS],
    ) -> Result<Self> {
        let mut sums = [[0.0; MOMENTS]; 5];
        let mut sample = |set: usize, offset: DVec3| -> Result<f64> {
            let place = centre + offset * half_edges;
            let value = density(reference + place);
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::Setting { field: "density", value, expected: "at least 0 and finite everywhere" });
            }
            for (sum, monomial) in sums[set].iter_mut().zip(monomials(place)) {
                *sum += value * monomial;
            }
            Ok(value)
        };
        // Nodes of Genz and Malik: λ₂² = 9/70, λ₃² = λ₄² = 9/10, λ₅² = 9/19.
        let (inner, outer, corner) = ((9.0_f64 / 70.0).sqrt(), (9.0_f64 / 10.0).sqrt(), (9.0_f64 / 19.0).sqrt());
        let middle = sample(0, DVec3::ZERO)?;
        let mut differences = [0.0; 3];
        for (axis, difference) in DVec3::AXES.into_iter().zip(&mut differences) {
            let near = sample(1, axis * inner)? + sample(1, axis * -inner)?;
            let far = sample(2, axis * outer)? + sample(2, axis * -outer)?;
            // The fourth difference vanishes for a cubic: (λ₂/λ₃)² = 1/7.
            *difference = ((near - 2.0 * middle) - (far - 2.0 * middle) / 7.0).abs();
        }
        for (a, b) in [(DVec3::X, DVec3::Y), (DVec3::Y, DVec3::Z), (DVec3::Z, DVec3::X)] {
            for (sign_a, sign_b) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                sample(3, (a * sign_a + b * sign_b) * outer)?;
            }
        }
        for index in 0..8_u32 {
            let sign = |bit: u32| if index >> bit & 1 == 0 { corner } else { -corner };
            sample(4, DVec3::new(sign(0), sign(1), sign(2)))?;
        }
        let volume = 8.0 * half_edges.element_product();
        // Weights for three dimensions and a box of volume 1, of degree 7 and of degree 5.
        const SEVENTH: [f64; 5] =
            [-10936.0 / 19683.0, 980.0 / 6561.0, 620.0 / 19683.0, 200.0 / 19683.0, 6859.0 / 157464.0];
        const FIFTH: [f64; 4] = [-557.0 / 243.0, 245.0 / 486.0, -35.0 / 1458.0, 25.0 / 729.0];
        let integral: [f64; MOMENTS] =
            std::array::from_fn(|i| volume * (0..5).map(|s| SEVENTH[s] * sums[s][i]).sum::<f64>());
        let error: [f64; MOMENTS] =
            std::array::from_fn(|i| (integral[i] - volume * (0..4).map(|s| FIFTH[s] * sums[s][i]).sum::<f64>()).abs());
        let priority = (0..MOMENTS).map(|i| error[i] / scale[i]).fold(0.0, f64::max);
        let widths = half_edges.to_array();
        let largest = differences.iter().copied().fold(0.0, f64::max);
        // Among axes with nearly the same difference the longest is cut, so that boxes do not become slivers.
        let split_axis = (0..3)
            .filter(|&i| differences[i] >= 0.5 * largest)
            .max_by(|&i, &j| widths[i].total_cmp(&widths[j]))
            .unwrap_or(0);
        Ok(Self { centre, half_edges, integral, error, priority, split_axis })
    }

    /// Centres and half edges of the two halves.
    fn halves(&self) -> [(DVec3, DVec3); 2] {
        let axis = DVec3::AXES[self.split_axis];
        let half_edges = self.half_edges * (DVec3::ONE - 0.5 * axis);
        let shift = self.half_edges * axis * 0.5;
        [(self.centre - shift, half_edges), (self.centre + shift, half_edges)]
    }
}

impl Ord for Region {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.priority.total_cmp(&other.priority)
    }
}

impl PartialOrd for Region {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Region {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Region {}
