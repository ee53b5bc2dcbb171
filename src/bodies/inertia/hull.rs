//! The convex hull of points, as a mesh.

use std::collections::HashMap;

use glam::DVec3;
use robust::{Coord, Coord3D, orient2d, orient3d};

use super::TriangleMesh;
use super::mass_properties::finite;
use crate::error::FlatArrangement;
use crate::error::{Error, Result};

/// The surface of the convex hull of `points` (m), as a closed mesh whose vertices are the corners of the hull (and, if a face contains
/// more than three points, perhaps some of these).
///
/// Quickhull (C. B. Barber, D. P. Dobkin, H. Huhdanpaa, ACM Trans. Math. Softw. 22 (1996) 469), with the side of a
/// plane on which a point lies decided exactly by J. R. Shewchuk's adaptive predicates (Discrete Comput. Geom. 18
/// (1997) 305). As a face is replaced only where a point lies strictly above it, coplanar and repeated points need no
/// tolerance: after every step the surface is that of the exact hull of the points taken in so far.
///
/// # Errors
/// [`Error::Setting`] if a coordinate is not finite; [`Error::FlatHull`] if all points lie in one plane or on a line, or coincide; the
/// error says which.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::inertia::convex_hull;
///
/// let mut points: Vec<_> = (0..8).map(|i| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64)).collect();
/// points.push(DVec3::splat(0.3));
/// let cube = convex_hull(&points)?;
/// assert_eq!(cube.triangles().len(), 12);
/// assert!((cube.mass_properties(1.0)?.inertia.zz - 1.0 / 6.0).abs() < 1e-15);
/// # Ok::<(), polhode::Error>(())
/// ```
pub fn convex_hull(points: &[DVec3]) -> Result<TriangleMesh> {
    points.iter().try_for_each(|&point| finite("points", point).map(drop))?;
    let mut hull = Hull::start(points)?;
    while let Some(face) = hull.pending.pop() {
        if hull.faces[face].is_alive {
            hull.take_in_farthest(points, face);
        }
    }
    let mut numbers: HashMap<usize, usize> = HashMap::new();
    let mut vertices = Vec::new();
    let triangles = hull
        .faces
        .iter()
        .filter(|face| face.is_alive)
        .map(|face| {
            face.corners.map(|point| {
                *numbers.entry(point).or_insert_with(|| {
                    vertices.push(points[point]);
                    vertices.len() - 1
                })
            })
        })
        .collect();
    TriangleMesh::new(vertices, triangles)
}

struct Face {
    /// Counter-clockwise seen from outside.
    corners: [usize; 3],
    /// The face beyond the edge from corner i to corner i + 1.
    neighbours: [usize; 3],
    /// Points strictly above this face that no other face has taken.
    outside: Vec<usize>,
    is_alive: bool,
}

struct Hull {
    faces: Vec<Face>,
    /// Faces that have points above them.
    pending: Vec<usize>,
}

impl Hull {
    /// The tetrahedron from which the hull grows.
    fn start(points: &[DVec3]) -> Result<Self> {
        let flat = |arrangement| Error::FlatHull { points: points.len(), arrangement };
        let first = points.first().copied().ok_or_else(|| flat(FlatArrangement::Coincide))?;
        // Far points are found in rounded arithmetic, which is enough for a good start; whether they are degenerate is decided exactly.
        let farthest = |measure: &dyn Fn(DVec3) -> f64| {
            (0..points.len()).max_by(|&i, &j| measure(points[i]).total_cmp(&measure(points[j]))).unwrap_or(0)
        };
        let mut a = 0;
        let mut b = farthest(&|p| p.distance_squared(first));
        if points[b] == points[a] {
            b = (0..points.len()).find(|&i| points[i] != first).ok_or_else(|| flat(FlatArrangement::Coincide))?;
        }
        let along = points[b] - points[a];
        let mut c = farthest(&|p| along.cross(p - first).length_squared());
        let is_on_line = |c: usize| are_collinear(points[a], points[b], points[c]);
        if is_on_line(c) {
            c = (0..points.len()).find(|&i| !is_on_line(i)).ok_or_else(|| flat(FlatArrangement::OnALine))?;
        }
        let normal = along.cross(points[c] - first);
        let mut d = farthest(&|p| normal.dot(p - first).abs());
        let side_of = |d: usize| height_sign(points[a], points[b], points[c], points[d]);
        if side_of(d) == 0.0 {
            d = (0..points.len()).find(|&i| side_of(i) != 0.0).ok_or_else(|| flat(FlatArrangement::InAPlane))?;
        }
        if side_of(d) > 0.0 {
            std::mem::swap(&mut a, &mut b);
        }
        // Now d lies below the face a, b, c.
        let corners = [[a, b, c], [b, a, d], [c, b, d], [a, c, d]];
        let neighbours = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];
        let mut hull = Self { faces: Vec::new(), pending: Vec::new() };
        for (corners, neighbours) in corners.into_iter().zip(neighbours) {
            hull.faces.push(Face { corners, neighbours, outside: Vec::new(), is_alive: true });
        }
        hull.distribute(points, (0..points.len()).filter(|i| ![a, b, c, d].contains(i)), 0);
        Ok(hull)
    }

    fn is_above(&self, points: &[DVec3], point: usize, face: usize) -> bool {
        let [a, b, c] = self.faces[face].corners.map(|corner| points[corner]);
        height_sign(a, b, c, points[point]) > 0.0
    }

    /// Assigns each of `candidates` to the first face, from number `first_face` on, that it lies above; the others are inside.
    fn distribute(&mut self, points: &[DVec3], candidates: impl Iterator<Item = usize>, first_face: usize) {
        for point in candidates {
            if let Some(face) = (first_face..self.faces.len()).find(|&face| self.is_above(points, point, face)) {
                self.faces[face].outside.push(point);
            }
        }
        let waiting = (first_face..self.faces.len()).filter(|&face| !self.faces[face].outside.is_empty());
        self.pending.extend(waiting);
    }

    /// Replaces all faces visible from the farthest point above `face` by the cone from that point to their rim.
    fn take_in_farthest(&mut self, points: &[DVec3], face: usize) {
        let [a, b, c] = self.faces[face].corners.map(|corner| points[corner]);
        let normal = (b - a).cross(c - a);
        let height = |point: usize| normal.dot(points[point] - a);
        let Some(apex) = self.faces[face].outside.iter().copied().max_by(|&i, &j| height(i).total_cmp(&height(j)))
        else {
            return;
        };
        // The visible faces are connected: the faces of a convex surface that a point lies above form a disc.
        let mut seen = vec![face];
        self.faces[face].is_alive = false;
        let mut rim = Vec::new();
        let mut next = 0;
        while next < seen.len() {
            let current = seen[next];
            next += 1;
            for edge in 0..3 {
                let neighbour = self.faces[current].neighbours[edge];
                if !self.faces[neighbour].is_alive {
                    continue;
                }
                if self.is_above(points, apex, neighbour) {
                    self.faces[neighbour].is_alive = false;
                    seen.push(neighbour);
                } else {
                    let corners = self.faces[current].corners;
                    rim.push((corners[edge], corners[(edge + 1) % 3], neighbour));
                }
            }
        }
        let first_new = self.faces.len();
        let mut starting_at: HashMap<usize, usize> = HashMap::with_capacity(rim.len());
        for (number, &(from, to, beyond)) in rim.iter().enumerate() {
            let new = first_new + number;
            starting_at.insert(from, new);
            let edge_of_neighbour = self.faces[beyond].corners.iter().position(|&corner| corner == to);
            if let Some(edge) = edge_of_neighbour {
                self.faces[beyond].neighbours[edge] = new;
            }
            let neighbours = [beyond, 0, 0];
            self.faces.push(Face { corners: [from, to, apex], neighbours, outside: Vec::new(), is_alive: true });
        }
        for (number, &(_, to, _)) in rim.iter().enumerate() {
            let (this, next) = (first_new + number, starting_at[&to]);
            self.faces[this].neighbours[1] = next;
            self.faces[next].neighbours[2] = this;
        }
        let orphans: Vec<usize> = seen
            .iter()
            .flat_map(|&face| std::mem::take(&mut self.faces[face].outside))
            .filter(|&p| p != apex)
            .collect();
        self.distribute(points, orphans.into_iter(), first_new);
    }
}

/// Positive where `point` lies above the plane of a, b, c (which are counter-clockwise seen from above), exact in sign.
fn height_sign(a: DVec3, b: DVec3, c: DVec3, point: DVec3) -> f64 {
    let coordinates = |p: DVec3| Coord3D { x: p.x, y: p.y, z: p.z };
    // The predicate is positive for a point below.
    -orient3d(coordinates(a), coordinates(b), coordinates(c), coordinates(point))
}

/// Whether three points lie on a line, exactly: they do if their projections on the three coordinate planes do.
fn are_collinear(a: DVec3, b: DVec3, c: DVec3) -> bool {
    let is_flat = |shadow: fn(DVec3) -> Coord<f64>| orient2d(shadow(a), shadow(b), shadow(c)) == 0.0;
    is_flat(|p| Coord { x: p.x, y: p.y })
        && is_flat(|p| Coord { x: p.y, y: p.z })
        && is_flat(|p| Coord { x: p.z, y: p.x })
}
