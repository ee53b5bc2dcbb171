//! Whether a closed surface encloses each point once or not at all.
//!
//! The winding number of a surface around a point is the sum of the solid angles of its triangles, divided by 4π: 1 inside a sound
//! surface, 0 outside. Where parts overlap or lie within one another it is 2 or more, where a part is inside out or passes
//! through itself it is negative, and the volume, which counts every point as often as the surface winds around it, is wrong.

use std::f64::consts::TAU;

use glam::DVec3;
use rayon::prelude::*;

use super::mesh::TriangleMesh;
use crate::error::MeshDefect;

/// Solid angles that are computed for one mesh: about a second.
const SOLID_ANGLES: usize = 20_000_000;
/// The least and the most places of a surface that are looked at.
const PLACES: (usize, usize) = (16, 2048);
/// How far from the surface its two sides are looked at, relative to the root of a triangle's area: far beyond rounding, and
/// far below the thickness of walls.
const OFF_SURFACE: f64 = 1e-7;
/// Winding numbers are whole; this much is left to rounding.
const WHOLE: f64 = 0.1;

impl TriangleMesh {
    /// What makes the volume of a closed mesh wrong: triangles that stand twice, parts that overlap, lie within one another
    /// without being cavities, or pass through themselves.
    ///
    /// Triangles that stand twice are all found. For the rest the surface is looked at from both sides in 16 to 2,048 places, the
    /// fewer the more triangles it has; an overlap whose surface is a smaller part than that may be missed.
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
        let found: Vec<f64> = places
            .par_iter()
            .filter_map(|sides| sides.iter().map(|&side| winding(&corners, side)).find(|&winding| unsound(winding)))
            .collect();
        let worst = found.iter().copied().max_by(|a, b| (a - 0.5).abs().total_cmp(&(b - 0.5).abs()))?;
        Some(MeshDefect::Overlapping { winding: worst.round() as i64, found: found.len(), places: places.len() })
    }
}

/// The same triangle, its smallest number first.
fn smallest_first([a, b, c]: [usize; 3]) -> [usize; 3] {
    match a.min(b).min(c) {
        least if least == a => [a, b, c],
        least if least == b => [b, c, a],
        _ => [c, a, b],
    }
}

/// Both sides of some `count` places, spread evenly over the area.
fn places(corners: &[[DVec3; 3]], count: usize) -> Vec<[DVec3; 2]> {
    let vector = |[a, b, c]: &[DVec3; 3]| 0.5 * (*b - *a).cross(*c - *a);
    let total: f64 = corners.iter().map(|corners| vector(corners).length()).sum();
    let (mut places, mut passed) = (Vec::with_capacity(count), 0.0);
    for triangle in corners {
        let (vector, area) = (vector(triangle), vector(triangle).length());
        passed += area;
        while area > 0.0 && (places.len() as f64 + 0.5) * total < passed * count as f64 {
            // The fractions of multiples of these two numbers fill a square evenly (M. Roberts, 2018), half of which is folded
            // onto the other: what is left is the triangle.
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

/// How often the surface winds around a point.
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
