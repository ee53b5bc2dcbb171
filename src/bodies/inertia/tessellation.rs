//! Triangle meshes of the shapes.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::{Shape, TriangleMesh};
use crate::error::{Error, Result};

impl Shape {
    /// A closed mesh of the shape's surface with `segments` edges around its axis, other edges of matching length, and vertices on the
    /// surface; boxes and tetrahedra are exact. Its mass properties converge to the shape's like 1/segments².
    ///
    /// # Errors
    /// [`Error::Setting`] where `segments` is less than 3, a length is not valid, or the shape has no surface to
    /// enclose a volume (points, rods and plates).
    ///
    /// ```
    /// use polhode::bodies::inertia::Shape;
    ///
    /// let sphere = Shape::Sphere { radius: 1.0 };
    /// let mesh = sphere.mesh(64)?;
    /// let (body, exact) = (mesh.mass_properties(1.0)?, sphere.mass_properties(1.0)?);
    /// assert!((body.inertia.zz / exact.inertia.zz - 1.0).abs() < 0.005);
    /// # Ok::<(), polhode::Error>(())
    /// ```
    pub fn mesh(&self, segments: usize) -> Result<TriangleMesh> {
        self.validate()?;
        if segments < 3 {
            return Err(Error::Setting { field: "segments", value: segments as f64, expected: "at least 3" });
        }
        // Steps of a half circle, from its lower end to its upper one.
        let arc = |from: f64, to: f64, steps: usize, radius: f64, height: f64| -> Vec<(f64, f64)> {
            (0..=steps)
                .map(|i| from + (to - from) * i as f64 / steps as f64)
                .map(|angle| (radius * angle.cos(), height + radius * angle.sin()))
                .collect()
        };
        let half = segments.div_ceil(2);
        match *self {
            Self::Sphere { radius } | Self::SphericalShell { radius } => {
                revolved(&arc(-0.5 * PI, 0.5 * PI, half, radius, 0.0), segments, false)
            }
            Self::Ellipsoid { semi_axes } => {
                let unit = revolved(&arc(-0.5 * PI, 0.5 * PI, half, 1.0, 0.0), segments, false)?;
                let vertices = unit.vertices().iter().map(|v| v * semi_axes).collect();
                TriangleMesh::new(vertices, unit.triangles().to_vec())
            }
            Self::Cylinder { radius, height } => {
                let end = 0.5 * height;
                revolved(&[(0.0, -end), (radius, -end), (radius, end), (0.0, end)], segments, false)
            }
            Self::Tube { inner_radius, outer_radius, height } => {
                let end = 0.5 * height;
                if inner_radius == 0.0 {
                    return Self::Cylinder { radius: outer_radius, height }.mesh(segments);
                }
                let section = [(inner_radius, -end), (outer_radius, -end), (outer_radius, end), (inner_radius, end)];
                revolved(&section, segments, true)
            }
            Self::Capsule { radius, length } => {
                let quarter = segments.div_ceil(4);
                let mut profile = arc(-0.5 * PI, 0.0, quarter, radius, -0.5 * length);
                profile.extend(arc(0.0, 0.5 * PI, quarter, radius, 0.5 * length));
                revolved(&profile, segments, false)
            }
            Self::Cone { radius, height } => revolved(&[(0.0, 0.0), (radius, 0.0), (0.0, height)], segments, false),
            Self::Torus { major_radius, minor_radius } => {
                let section: Vec<_> = (0..segments)
                    .map(|i| TAU * (i as f64 + 0.5) / segments as f64)
                    .map(|angle| (major_radius + minor_radius * angle.cos(), minor_radius * angle.sin()))
                    .collect();
                revolved(&section, segments, true)
            }
            Self::Box { edges } => {
                let corner = |i: usize| {
                    let sign = |bit: usize| if i >> bit & 1 == 0 { -0.5 } else { 0.5 };
                    DVec3::new(sign(0), sign(1), sign(2)) * edges
                };
                let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
                let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
                TriangleMesh::new((0..8).map(corner).collect(), triangles)
            }
            Self::Tetrahedron { corners } => {
                let [a, b, c, d] = corners;
                let mesh = TriangleMesh::new(corners.to_vec(), vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])?;
                let is_right_handed = (b - a).cross(c - a).dot(d - a) > 0.0;
                Ok(if is_right_handed { mesh } else { mesh.turned_inside_out() })
            }
            Self::Point | Self::Rod { .. } | Self::RectangularPlate { .. } | Self::CircularPlate { .. } => {
                Err(Error::Setting { field: "volume", value: 0.0, expected: "a shape with a volume, to have a mesh" })
            }
        }
    }
}

/// Radius, relative to the profile's size, below which a point of a profile lies on the axis: rounding of cos(π/2).
const ON_AXIS: f64 = 1e-15;

/// The surface of revolution of a profile of points (distance from the z axis, z), with the solid to the left of the profile; an open
/// profile begins and ends on the axis, one that is `looped` returns to its first point.
fn revolved(profile: &[(f64, f64)], segments: usize, looped: bool) -> Result<TriangleMesh> {
    let size = profile.iter().fold(0.0_f64, |size, (radius, _)| size.max(*radius));
    let mut vertices = Vec::new();
    // Number of each ring's first vertex, and how many vertices it has: one on the axis.
    let rings: Vec<(usize, usize)> = profile
        .iter()
        .map(|&(radius, z)| {
            let first = vertices.len();
            if radius <= ON_AXIS * size {
                vertices.push(DVec3::new(0.0, 0.0, z));
                return (first, 1);
            }
            vertices.extend((0..segments).map(|i| {
                let (sine, cosine) = (TAU * i as f64 / segments as f64).sin_cos();
                DVec3::new(radius * cosine, radius * sine, z)
            }));
            (first, segments)
        })
        .collect();
    let mut triangles = Vec::new();
    let pairs = if looped { rings.len() } else { rings.len() - 1 };
    for j in 0..pairs {
        let (lower, upper) = (rings[j], rings[(j + 1) % rings.len()]);
        let at = |(first, count): (usize, usize), i: usize| first + i % count;
        for i in 0..segments {
            let [a, b, c, d] = [at(lower, i), at(lower, i + 1), at(upper, i + 1), at(upper, i)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    TriangleMesh::new(vertices, triangles)
}
