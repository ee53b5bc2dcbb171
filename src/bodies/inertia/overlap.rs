//! Whether a closed surface encloses each point once or not at all.
//!
//! The winding number of a surface around a point is the sum of the solid angles of its triangles, divided by 4π: 1 inside a sound
//! surface, 0 outside. Where parts overlap or lie within one another it is 2 or more; where a part is inside out or intersects
//! itself it is negative. The volume, which counts every point as often as the surface winds around it, is then wrong.

use std::f64::consts::TAU;

use glam::DVec3;

use super::mesh::TriangleMesh;
use crate::error::MeshDefect;
use crate::math::parallel;

/// The number of solid angles computed for one mesh: about a second of work.
const SOLID_ANGLES: usize = 20_000_000;
/// The least and the most sample points on a surface.
const PLACES: (usize, usize) = (16, 2048);
/// The distance of the tested points from the surface, relative to the root of a triangle's area: far above rounding, and far below the
/// thickness of walls.
const OFF_SURFACE: f64 = 1e-7;
/// Winding numbers are whole; this is the tolerance for rounding.
const WHOLE: f64 = 0.1;

impl TriangleMesh {
    /// The defect that makes the volume of a closed mesh wrong: duplicate triangles, or parts that overlap, lie within one another
    /// without being cavities, or intersect themselves.
    ///
    /// All duplicate triangles are found. Otherwise the winding numbers on both sides of the surface are tested at 16 to 2,048 points,
    /// fewer for more triangles; an overlap whose share of the surface is smaller than the sampling may be missed.
    pub fn overlap(&self) -> Option<MeshDefect> {
        let mut turned: Vec<[usize; 3]> = self.triangles().iter().map(|&triangle| smallest_first(triangle)).collect();
        turned.sort_unstable();
        let doubled = turned.windows(2).filter(|pair| pair[0] == pair[1]).count();
        if doubled > 0 {
            return Some(MeshDefect::Doubled { triangles: doubled });
        }
        let corners: Vec<[DVec3; 3]> =
            self.triangles().iter().map(|triangle| triangle.map(|vertex| self.vertices()[vertex])).collect();
        let places = places(&corners, (SOLID_ANGLES / 2 / corners.len().max(1)).clamp(PLACES.0, PLACES.1));
        let unsound = |winding: f64| (winding - winding.clamp(0.0, 1.0).round()).abs() > WHOLE;
        let of_place = |place: usize| {
            let windings = places[place].iter().map(|&side| winding(&corners, side));
            windings.into_iter().find(|&winding| unsound(winding))
        };
        let found: Vec<f64> = parallel::map(places.len(), of_place).into_iter().flatten().collect();
        let worst = found.iter().copied().max_by(|a, b| (a - 0.5).abs().total_cmp(&(b - 0.5).abs()))?;
        Some(MeshDefect::Overlapping { winding: worst.round() as i64, found: found.len(), places: places.len() })
    }
}

/// The same triangle, its smallest vertex number first.
fn smallest_first([a, b, c]: [usize; 3]) -> [usize; 3] {
    match a.min(b).min(c) {
        least if least == a => [a, b, c],
        least if least == b => [b, c, a],
        _ => [c, a, b],
    }
}

/// The points on both sides of the surface at `count` places, spread evenly over the area.
fn places(corners: &[[DVec3; 3]], count: usize) -> Vec<[DVec3; 2]> {
    let vector = |[a, b, c]: &[DVec3; 3]| 0.5 * (*b - *a).cross(*c - *a);
    let total: f64 = corners.iter().map(|corners| vector(corners).length()).sum();
    let (mut places, mut passed) = (Vec::with_capacity(count), 0.0);
    for triangle in corners {
        let (vector, area) = (vector(triangle), vector(triangle).length());
        passed += area;
        while area > 0.0 && (places.len() as f64 + 0.5) * total < passed * count as f64 {
            // The fractional parts of multiples of these two numbers fill a square evenly (M. Roberts, 2018); folding one half of it
            // onto the other gives the triangle.
            let number = places.len() as f64;
            let (u, v) =
                ((0.5 + number * 0.754_877_666_246_692_7).fract(), (0.5 + number * 0.569_840_290_998_053_2).fract());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let [a, b, c] = *triangle;
            let place = a + u * (b - a) + v * (c - a);
            let off = OFF_SURFACE * area.sqrt() * (vector / area);
            places.push([place + off, place - off]);
        }
    }
    places
}

/// The winding number of the surface around a point.
///
/// The solid angle of a triangle follows A. van Oosterom and J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125, equation 8.
fn winding(corners: &[[DVec3; 3]], point: DVec3) -> f64 {
    let half_angle = |triangle: &[DVec3; 3]| {
        let [a, b, c] = triangle.map(|corner| corner - point);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        a.dot(b.cross(c)).atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
    };
    corners.iter().map(half_angle).sum::<f64>() / TAU
}
