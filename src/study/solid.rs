//! Homogeneous bodies whose sizes are drawn.

use glam::DVec3;

use super::distribution::{Scalar, Vector};
use super::draw::{Column, Draw};
use super::reader::{Node, Table};
use crate::error::Result;
use crate::inertia::{MassProperties, Shape};

/// A shape that a study can name. Points, rods and tetrahedra are left out: the first two cannot spin about every axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShapeKind {
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

/// Names in study files, in the order of [`ShapeKind`].
const NAMES: &[&str] = &[
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
];

/// All kinds, in the order of [`NAMES`].
const KINDS: [ShapeKind; NAMES.len()] = [
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
    /// The keys of a shape: three that all have, then its lengths. A draw's component is a length's place here.
    fn keys(self) -> &'static [&'static str] {
        match self {
            ShapeKind::Sphere | ShapeKind::SphericalShell | ShapeKind::CircularPlate => {
                &["shape", "mass", "density", "radius"]
            }
            ShapeKind::Ellipsoid => &["shape", "mass", "density", "semi_axes"],
            ShapeKind::Box => &["shape", "mass", "density", "edges"],
            ShapeKind::Cylinder | ShapeKind::Cone => &["shape", "mass", "density", "radius", "height"],
            ShapeKind::Tube => &["shape", "mass", "density", "inner_radius", "outer_radius", "height"],
            ShapeKind::Capsule => &["shape", "mass", "density", "radius", "length"],
            ShapeKind::Torus => &["shape", "mass", "density", "major_radius", "minor_radius"],
            ShapeKind::RectangularPlate => &["shape", "mass", "density", "width", "depth"],
        }
    }

    /// Whether the shape's one length is a vector.
    fn takes_vector(self) -> bool {
        matches!(self, ShapeKind::Ellipsoid | ShapeKind::Box)
    }

    /// Whether a density makes sense.
    fn has_volume(self) -> bool {
        !matches!(self, ShapeKind::SphericalShell | ShapeKind::RectangularPlate | ShapeKind::CircularPlate)
    }

    fn shape(self, [a, b, c]: [f64; 3]) -> Shape {
        match self {
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

/// How much matter a solid holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Matter {
    /// Mass, kg.
    Mass(Scalar),
    /// Density, kg/m³.
    Density(Scalar),
}

/// A homogeneous body whose sizes are drawn; its centre of mass is the body's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solid {
    /// The shape.
    pub kind: ShapeKind,
    /// Its lengths, m, in the order in which [`crate::inertia::Shape`] has them.
    pub lengths: Vector,
    /// What it holds.
    pub matter: Matter,
}

impl Solid {
    /// Mass and inertia of `body`.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Setting`] where a length, mass or density that was drawn is not valid.
    pub fn sample(&self, draw: Draw, body: usize) -> Result<MassProperties> {
        let shape = self.kind.shape(self.lengths.sample(draw, body, Column::Inertia).to_array());
        match &self.matter {
            Matter::Mass(mass) => shape.mass_properties(mass.sample(draw, body, Column::Mass, 0)),
            Matter::Density(density) => shape.mass_properties_of_density(density.sample(draw, body, Column::Mass, 0)),
        }
    }

    /// Reads `table`, whose key `shape` is `name`.
    pub(super) fn read(table: &Table<'_>, name: &Node<'_>) -> Result<Self> {
        let chosen = name.choice(NAMES)?;
        let place = NAMES.iter().position(|known| *known == chosen).unwrap_or_default();
        let kind = KINDS[place];
        let keys = kind.keys();
        table.only(keys)?;
        let lengths = &keys[3..];
        let lengths = if kind.takes_vector() {
            Vector::read(&table.need(lengths[0], "three lengths are needed (m)")?)?
        } else {
            let mut components = [Scalar::Constant(0.0); 3];
            for (component, key) in components.iter_mut().zip(lengths) {
                *component = Scalar::read(&table.need(key, "a length is needed (m)")?)?;
            }
            Vector::Components(components)
        };
        table.exclusive("density", "mass")?;
        let matter = match table.find("density") {
            Some(density) if !kind.has_volume() => {
                return Err(density.refuse("this shape has no volume: a mass is needed instead (kg)"));
            }
            Some(density) => Matter::Density(Scalar::read(&density)?),
            None => Matter::Mass(Scalar::read(&table.need("mass", "the mass (kg), or a density (kg/m³), is needed")?)?),
        };
        Ok(Self { kind, lengths, matter })
    }
}
