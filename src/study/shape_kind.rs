//! Shapes that a study can name.

use glam::DVec3;

use crate::bodies::inertia::Shape;

/// A shape whose lengths can be drawn. A tetrahedron, given by its corners, is not among these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShapeKind {
    /// [`Shape::Point`].
    Point,
    /// [`Shape::Rod`].
    Rod,
    /// [`Shape::Sphere`].
    Sphere,
    /// [`Shape::SphericalShell`].
    SphericalShell,
    /// [`Shape::Ellipsoid`].
    Ellipsoid,
    /// [`Shape::Box`].
    Box,
    /// [`Shape::Cylinder`].
    Cylinder,
    /// [`Shape::Tube`].
    Tube,
    /// [`Shape::Capsule`].
    Capsule,
    /// [`Shape::Cone`].
    Cone,
    /// [`Shape::Torus`].
    Torus,
    /// [`Shape::RectangularPlate`].
    RectangularPlate,
    /// [`Shape::CircularPlate`].
    CircularPlate,
}

/// Names in study files: those of [`KINDS`], then [`TETRAHEDRON`].
pub(super) const NAMES: &[&str] = &[
    "point",
    "rod",
    "sphere",
    "spherical-shell",
    "ellipsoid",
    "box",
    "cylinder",
    "tube",
    "capsule",
    "cone",
    "torus",
    "rectangular-plate",
    "circular-plate",
    TETRAHEDRON,
];

/// The name of the shape that has corners instead of lengths.
pub(super) const TETRAHEDRON: &str = "tetrahedron";

/// All kinds, in the order of [`NAMES`].
const KINDS: [ShapeKind; NAMES.len() - 1] = [
    ShapeKind::Point,
    ShapeKind::Rod,
    ShapeKind::Sphere,
    ShapeKind::SphericalShell,
    ShapeKind::Ellipsoid,
    ShapeKind::Box,
    ShapeKind::Cylinder,
    ShapeKind::Tube,
    ShapeKind::Capsule,
    ShapeKind::Cone,
    ShapeKind::Torus,
    ShapeKind::RectangularPlate,
    ShapeKind::CircularPlate,
];

impl ShapeKind {
    /// The kind of that name, if it has lengths.
    pub(super) fn named(name: &str) -> Option<Self> {
        let place = NAMES.iter().position(|known| *known == name)?;
        KINDS.get(place).copied()
    }

    /// The keys of its lengths. A length's index here is the component of its draw.
    pub(super) fn lengths(self) -> &'static [&'static str] {
        match self {
            ShapeKind::Point => &[],
            ShapeKind::Rod => &["length"],
            ShapeKind::Sphere | ShapeKind::SphericalShell | ShapeKind::CircularPlate => &["radius"],
            ShapeKind::Ellipsoid => &["semi_axes"],
            ShapeKind::Box => &["edges"],
            ShapeKind::Cylinder | ShapeKind::Cone => &["radius", "height"],
            ShapeKind::Tube => &["inner_radius", "outer_radius", "height"],
            ShapeKind::Capsule => &["radius", "length"],
            ShapeKind::Torus => &["major_radius", "minor_radius"],
            ShapeKind::RectangularPlate => &["width", "depth"],
        }
    }

    /// Whether the shape's one length is a vector.
    pub(super) fn takes_vector(self) -> bool {
        matches!(self, ShapeKind::Ellipsoid | ShapeKind::Box)
    }

    /// Whether a density makes sense.
    pub(super) fn has_volume(self) -> bool {
        !matches!(
            self,
            ShapeKind::Point
                | ShapeKind::Rod
                | ShapeKind::SphericalShell
                | ShapeKind::RectangularPlate
                | ShapeKind::CircularPlate
        )
    }

    /// The shape with these lengths, m, in the order of its keys.
    pub(super) fn shape(self, [a, b, c]: [f64; 3]) -> Shape {
        match self {
            ShapeKind::Point => Shape::Point,
            ShapeKind::Rod => Shape::Rod { length: a },
            ShapeKind::Sphere => Shape::Sphere { radius: a },
            ShapeKind::SphericalShell => Shape::SphericalShell { radius: a },
            ShapeKind::Ellipsoid => Shape::Ellipsoid { semi_axes: DVec3::new(a, b, c) },
            ShapeKind::Box => Shape::Box { edges: DVec3::new(a, b, c) },
            ShapeKind::Cylinder => Shape::Cylinder { radius: a, height: b },
            ShapeKind::Tube => Shape::Tube { inner_radius: a, outer_radius: b, height: c },
            ShapeKind::Capsule => Shape::Capsule { radius: a, length: b },
            ShapeKind::Cone => Shape::Cone { radius: a, height: b },
            ShapeKind::Torus => Shape::Torus { major_radius: a, minor_radius: b },
            ShapeKind::RectangularPlate => Shape::RectangularPlate { width: a, depth: b },
            ShapeKind::CircularPlate => Shape::CircularPlate { radius: a },
        }
    }
}
