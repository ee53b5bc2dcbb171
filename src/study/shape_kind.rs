//! Shapes that a study can name.

use glam::DVec3;

use crate::bodies::inertia::Shape;

/// A shape whose lengths can be drawn, by its place in [`KINDS`]. A tetrahedron, given by its corners, is not among these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ShapeKind(usize);

/// What is known of a kind.
struct Kind {
    name: &'static str,
    /// The keys of its lengths. A length's index here is the component of its draw.
    lengths: &'static [&'static str],
    /// Whether the shape's one length is a vector.
    takes_vector: bool,
    /// Whether a density makes sense.
    has_volume: bool,
    /// The shape with these lengths, m, in the order of its keys.
    shape: fn([f64; 3]) -> Shape,
}

const fn solid(name: &'static str, lengths: &'static [&'static str], shape: fn([f64; 3]) -> Shape) -> Kind {
    Kind { name, lengths, takes_vector: false, has_volume: true, shape }
}

const fn thin(name: &'static str, lengths: &'static [&'static str], shape: fn([f64; 3]) -> Shape) -> Kind {
    Kind { has_volume: false, ..solid(name, lengths, shape) }
}

const fn along_axes(name: &'static str, lengths: &'static [&'static str], shape: fn([f64; 3]) -> Shape) -> Kind {
    Kind { takes_vector: true, ..solid(name, lengths, shape) }
}

static KINDS: [Kind; 13] =
    [
        thin("point", &[], |_| Shape::Point),
        thin("rod", &["length"], |[length, ..]| Shape::Rod { length }),
        solid("sphere", &["radius"], |[radius, ..]| Shape::Sphere { radius }),
        thin("spherical-shell", &["radius"], |[radius, ..]| Shape::SphericalShell { radius }),
        along_axes("ellipsoid", &["semi_axes"], |axes| Shape::Ellipsoid { semi_axes: DVec3::from_array(axes) }),
        along_axes("box", &["edges"], |edges| Shape::Box { edges: DVec3::from_array(edges) }),
        solid("cylinder", &["radius", "height"], |[radius, height, _]| Shape::Cylinder { radius, height }),
        solid("tube", &["inner_radius", "outer_radius", "height"], |[inner_radius, outer_radius, height]| {
            Shape::Tube { inner_radius, outer_radius, height }
        }),
        solid("capsule", &["radius", "length"], |[radius, length, _]| Shape::Capsule { radius, length }),
        solid("cone", &["radius", "height"], |[radius, height, _]| Shape::Cone { radius, height }),
        solid("torus", &["major_radius", "minor_radius"], |[major_radius, minor_radius, _]| Shape::Torus {
            major_radius,
            minor_radius,
        }),
        thin("rectangular-plate", &["width", "depth"], |[width, depth, _]| Shape::RectangularPlate { width, depth }),
        thin("circular-plate", &["radius"], |[radius, ..]| Shape::CircularPlate { radius }),
    ];

/// The name of the shape that has corners instead of lengths.
pub(super) const TETRAHEDRON: &str = "tetrahedron";

/// Names in study files: those of [`KINDS`], then [`TETRAHEDRON`].
pub(super) static NAMES: [&str; KINDS.len() + 1] = {
    let mut names = [TETRAHEDRON; KINDS.len() + 1];
    let mut place = 0;
    while place < KINDS.len() {
        names[place] = KINDS[place].name;
        place += 1;
    }
    names
};

impl ShapeKind {
    /// The kind of that name, if it has lengths.
    pub(super) fn named(name: &str) -> Option<Self> {
        KINDS.iter().position(|kind| kind.name == name).map(Self)
    }

    pub(super) fn lengths(self) -> &'static [&'static str] {
        KINDS[self.0].lengths
    }

    pub(super) fn takes_vector(self) -> bool {
        KINDS[self.0].takes_vector
    }

    pub(super) fn has_volume(self) -> bool {
        KINDS[self.0].has_volume
    }

    pub(super) fn shape(self, lengths: [f64; 3]) -> Shape {
        (KINDS[self.0].shape)(lengths)
    }
}
