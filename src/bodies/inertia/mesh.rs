//! Triangle meshes: exact integrals over the volume that they enclose, and checks that they enclose one.

use std::collections::HashMap;

use glam::DVec3;

use super::MassProperties;
use super::mass_properties::positive;
use super::moments::{MOMENTS, Moments, mass_properties, monomials};
use crate::error::MeshDefect;
use crate::error::{Error, Result};

/// A surface of triangles, counter-clockwise seen from outside.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::inertia::TriangleMesh;
///
/// let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
/// let mesh = TriangleMesh::new(corners.clone(), vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])?;
/// let body = mesh.mass_properties(6.0)?;
/// assert_eq!(body.centre_of_mass, DVec3::splat(0.25));
///
/// let open = TriangleMesh::new(corners, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2]])?;
/// assert_eq!(open.report().boundary_edges, 3);
/// assert!(open.mass_properties(6.0).is_err());
/// # Ok::<(), polhode::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleMesh {
    vertices: Vec<DVec3>,
    triangles: Vec<[usize; 3]>,
}

/// Whether a mesh is closed, and how far it is from closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshReport {
    /// Number of triangles.
    pub triangles: usize,
    /// Triangles without area.
    pub flat_triangles: usize,
    /// Edges that belong to one triangle only: the rims of holes.
    pub boundary_edges: usize,
    /// Their total length, m.
    pub boundary_length: f64,
    /// Edges between neighbouring triangles of opposite orientation.
    pub inconsistent_edges: usize,
    /// Edges of four or more triangles with consistent orientation: no defect, as where two cubes touch along an edge.
    pub shared_edges: usize,
    /// |Σ area vectors| / Σ areas: 0 for a closed surface, 1 for a flat piece.
    pub closure_defect: f64,
    /// Area of the surface, m².
    pub area: f64,
    /// Enclosed volume, m³; negative where the triangles are clockwise seen from outside.
    pub signed_volume: f64,
}

/// Volume below which a closed mesh counts as flat, relative to its area to the power 3/2: the rounding of a sum of
/// signed volumes.
const FLAT_VOLUME: f64 = 1e-14;

impl TriangleMesh {
    /// The mesh of `vertices` (m) and `triangles` (three numbers of vertices each, counter-clockwise seen from
    /// outside).
    ///
    /// Triangles that name a vertex twice have neither area nor volume and are left out.
    ///
    /// # Errors
    /// [`Error::Mesh`] where a coordinate is not finite, a triangle names a vertex that does not exist, or no triangle
    /// is left.
    pub fn new(vertices: Vec<DVec3>, mut triangles: Vec<[usize; 3]>) -> Result<Self> {
        if let Some(vertex) = vertices.iter().position(|v| !v.is_finite()) {
            return Err(Error::Mesh(MeshDefect::NotFinite { vertex }));
        }
        for (number, triangle) in triangles.iter().enumerate() {
            if let Some(&vertex) = triangle.iter().find(|&&v| v >= vertices.len()) {
                let vertices = vertices.len();
                return Err(Error::Mesh(MeshDefect::NoSuchVertex { triangle: number, vertex, vertices }));
            }
        }
        triangles.retain(|&[a, b, c]| a != b && b != c && c != a);
        if triangles.is_empty() {
            return Err(Error::Mesh(MeshDefect::Empty));
        }
        Ok(Self { vertices, triangles })
    }

    /// The mesh of triangles given by their corners (m), as in an STL file; corners with equal coordinates become one
    /// vertex.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn from_corners(corners: impl IntoIterator<Item = [DVec3; 3]>) -> Result<Self> {
        let mut vertices = Vec::new();
        let mut numbers: HashMap<[u64; 3], usize> = HashMap::new();
        let mut triangles = Vec::new();
        for triangle in corners {
            triangles.push(triangle.map(|corner| {
                // Adding 0 turns −0 into 0, so that both are the same place.
                let key = corner.to_array().map(|c| (c + 0.0).to_bits());
                *numbers.entry(key).or_insert_with(|| {
                    vertices.push(corner);
                    vertices.len() - 1
                })
            }));
        }
        Self::new(vertices, triangles)
    }

    /// Vertices, m.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// Triangles, three numbers of vertices each.
    pub fn triangles(&self) -> &[[usize; 3]] {
        &self.triangles
    }

    /// The mesh with all coordinates multiplied by `factor`: 0.001 for a file in millimetres.
    ///
    /// # Errors
    /// [`Error::Setting`] where `factor` is not positive and finite.
    pub fn scaled(&self, factor: f64) -> Result<Self> {
        positive("factor", factor)?;
        Ok(Self { vertices: self.vertices.iter().map(|v| v * factor).collect(), triangles: self.triangles.clone() })
    }

    /// The mesh with the orientation of all triangles reversed: the repair of one that is [inside out](MeshDefect::InsideOut).
    pub fn turned_inside_out(&self) -> Self {
        let triangles = self.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
        Self { vertices: self.vertices.clone(), triangles }
    }

    /// Whether and how well the mesh is closed.
    ///
    /// Surfaces that overlap or intersect themselves are closed too; [`TriangleMesh::overlap`] detects them.
    pub fn report(&self) -> MeshReport {
        // For each edge: how many triangles traverse it upwards and how many downwards in the numbering of vertices.
        let mut edges: HashMap<(usize, usize), [usize; 2]> = HashMap::with_capacity(self.triangles.len() * 3 / 2);
        let (mut flat_triangles, mut area, mut area_vector) = (0, 0.0, DVec3::ZERO);
        for &[a, b, c] in &self.triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                edges.entry((from.min(to), from.max(to))).or_default()[usize::from(from > to)] += 1;
            }
            let [a, b, c] = [a, b, c].map(|v| self.vertices[v]);
            let vector = 0.5 * (b - a).cross(c - a);
            flat_triangles += usize::from(vector == DVec3::ZERO);
            area += vector.length();
            area_vector += vector;
        }
        let (mut boundary, mut inconsistent_edges, mut shared_edges) = (Vec::new(), 0, 0);
        for (&edge, &[up, down]) in &edges {
            match (up, down) {
                (1, 1) => {}
                (1, 0) | (0, 1) => boundary.push(edge),
                _ if up == down => shared_edges += 1,
                _ => inconsistent_edges += 1,
            }
        }
        // Sorted, so that the sum does not depend on the map's order.
        boundary.sort_unstable();
        let boundary_length = boundary.iter().map(|&(a, b)| self.vertices[a].distance(self.vertices[b])).sum();
        MeshReport {
            triangles: self.triangles.len(),
            flat_triangles,
            boundary_edges: boundary.len(),
            boundary_length,
            inconsistent_edges,
            shared_edges,
            closure_defect: if area > 0.0 { area_vector.length() / area } else { 0.0 },
            area,
            signed_volume: self.solid_moments().0[0],
        }
    }

    /// Why the mesh does not enclose a volume, if it does not.
    pub fn defect(&self) -> Option<MeshDefect> {
        let report = self.report();
        let MeshReport { boundary_edges, boundary_length, closure_defect, signed_volume, .. } = report;
        if boundary_edges > 0 {
            Some(MeshDefect::Open { boundary_edges, boundary_length, closure_defect })
        } else if report.inconsistent_edges > 0 {
            Some(MeshDefect::Inconsistent { edges: report.inconsistent_edges })
        } else if !(signed_volume.is_finite() && report.area.is_finite()) {
            Some(MeshDefect::OutOfRange)
        } else if signed_volume.abs() <= FLAT_VOLUME * report.area * report.area.sqrt() {
            Some(MeshDefect::NoVolume)
        } else if signed_volume < 0.0 {
            Some(MeshDefect::InsideOut { signed_volume })
        } else {
            None
        }
    }

    /// The mass properties of a homogeneous body of `mass` kg with this surface.
    ///
    /// The integrals over the enclosed volume are exact for the mesh: by the divergence theorem they are sums over
    /// the triangles, each standing for the tetrahedron between it and a fixed point (B. Mirtich, J. Graphics Tools 1
    /// (1996) 2; the form used here is that of D. Eberly, "Polyhedral Mass Properties (Revisited)", 2002).
    ///
    /// # Errors
    /// [`Error::Mesh`] if the mesh is open (with how open), inconsistently oriented, inside out or without volume;
    /// [`Error::Setting`] if `mass` is not positive and finite.
    pub fn mass_properties(&self, mass: f64) -> Result<MassProperties> {
        positive("mass", mass)?;
        self.properties_of_density_one()?.with_mass(mass)
    }

    /// The mass properties of a homogeneous body of `density` kg/m³ with this surface.
    ///
    /// # Errors
    /// As [`mass_properties`](Self::mass_properties).
    pub fn mass_properties_of_density(&self, density: f64) -> Result<MassProperties> {
        positive("density", density)?;
        self.properties_of_density_one()?.with_density(density)
    }

    /// The mass properties of a thin skin of `mass` kg spread evenly over the surface, which may be open.
    ///
    /// The volume is given as 0, whatever the surface encloses.
    ///
    /// # Errors
    /// [`Error::Mesh`] where the surface has no area, [`Error::Setting`] where `mass` is not positive and finite.
    pub fn shell_mass_properties(&self, mass: f64) -> Result<MassProperties> {
        positive("mass", mass)?;
        let reference = self.middle();
        let mut moments = Moments::default();
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|v| self.vertices[v] - reference);
            let area = 0.5 * (b - a).cross(c - a).length();
            // ∫ r rᵀ = area/12 (Σ r rᵀ + s sᵀ) over the corners, s their sum.
            moments.add(corner_moments([a, b, c], area, 3.0, 12.0));
        }
        let total = finite(moments.total())?;
        if total[0] <= 0.0 {
            return Err(Error::Mesh(MeshDefect::NoArea));
        }
        mass_properties(total, 0.0, reference).with_mass(mass)
    }

    fn properties_of_density_one(&self) -> Result<MassProperties> {
        if let Some(defect) = self.defect() {
            return Err(Error::Mesh(defect));
        }
        let (total, reference) = self.solid_moments();
        let total = finite(total)?;
        Ok(mass_properties(total, total[0], reference))
    }

    /// Volume and its first and second moments about the middle of the vertices, and that point.
    fn solid_moments(&self) -> ([f64; MOMENTS], DVec3) {
        let reference = self.middle();
        let mut moments = Moments::default();
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|v| self.vertices[v] - reference);
            // The fourth corner is the reference point: it counts as a corner but adds nothing to the sums.
            moments.add(corner_moments([a, b, c], a.dot(b.cross(c)) / 6.0, 4.0, 20.0));
        }
        (moments.total(), reference)
    }

    /// The middle of the bounding box of the vertices that are used.
    fn middle(&self) -> DVec3 {
        let used = || self.triangles.iter().flatten().map(|&v| self.vertices[v]);
        let lower = used().fold(DVec3::INFINITY, DVec3::min);
        let upper = used().fold(DVec3::NEG_INFINITY, DVec3::max);
        0.5 * lower + 0.5 * upper
    }
}

/// Refuses moments that are not finite.
fn finite(moments: [f64; MOMENTS]) -> Result<[f64; MOMENTS]> {
    let all = moments.iter().all(|moment| moment.is_finite());
    if all { Ok(moments) } else { Err(Error::Mesh(MeshDefect::OutOfRange)) }
}

/// Moments of a simplex of the given `measure` (area or signed volume): measure s/`first` and measure (Σ r rᵀ +
/// s sᵀ)/`second`, s the sum of the corners.
fn corner_moments(corners: [DVec3; 3], measure: f64, first: f64, second: f64) -> [f64; MOMENTS] {
    let sum = monomials(corners[0] + corners[1] + corners[2]);
    let squares = corners.map(monomials);
    std::array::from_fn(|i| match i {
        0 => measure,
        1..4 => measure / first * sum[i],
        _ => measure / second * (squares[0][i] + squares[1][i] + squares[2][i] + sum[i]),
    })
}
