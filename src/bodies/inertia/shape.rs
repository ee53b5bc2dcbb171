//! Homogeneous bodies with closed formulas.

use std::f64::consts::PI;

use glam::DVec3;

use super::mass_properties::{finite, positive};
use super::{InertiaTensor, MassProperties};
use crate::error::{Error, Result};

/// A homogeneous body. Lengths in m, all positive. Axes of symmetry lie along z and centres at the origin, unless stated otherwise.
///
/// The formulas are those of any handbook (e.g. E. Madelung, *Die mathematischen Hilfsmittel des Physikers*, part
/// II.3); the tests derive each of them independently by quadrature.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::inertia::Shape;
///
/// let stage = Shape::Cylinder { radius: 1.2, height: 6.5 }.mass_properties(1400.0)?;
/// assert_eq!(stage.inertia.zz, 0.5 * 1400.0 * 1.2 * 1.2);
/// let iron_ball = Shape::Sphere { radius: 0.1 }.mass_properties_of_density(7874.0)?;
/// assert!((iron_ball.mass - 32.982).abs() < 1e-3);
/// # Ok::<(), polhode::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Shape {
    /// A point, without inertia of its own.
    Point,
    /// A straight line along z.
    Rod {
        /// Length.
        length: f64,
    },
    /// A rectangle without thickness in the plane z = 0.
    RectangularPlate {
        /// Edge along x.
        width: f64,
        /// Edge along y.
        depth: f64,
    },
    /// A disc without thickness in the plane z = 0.
    CircularPlate {
        /// Radius.
        radius: f64,
    },
    /// A solid sphere.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// A sphere with all mass on its surface.
    SphericalShell {
        /// Radius.
        radius: f64,
    },
    /// A solid ellipsoid with its axes along x, y, z.
    Ellipsoid {
        /// Semi-axes.
        semi_axes: DVec3,
    },
    /// A solid box with its edges along x, y, z.
    Box {
        /// Full edge lengths.
        edges: DVec3,
    },
    /// A solid cylinder.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Length along z.
        height: f64,
    },
    /// A cylinder with a coaxial cylindrical bore.
    Tube {
        /// Radius of the bore; 0 makes a solid cylinder.
        inner_radius: f64,
        /// Radius of the outside.
        outer_radius: f64,
        /// Length along z.
        height: f64,
    },
    /// A cylinder closed by two half spheres.
    Capsule {
        /// Radius of cylinder and half spheres.
        radius: f64,
        /// Length of the cylinder alone, along z.
        length: f64,
    },
    /// A solid cone with its base in the plane z = 0 and its apex at z = height; the centre of mass is at height/4.
    Cone {
        /// Radius of the base.
        radius: f64,
        /// Distance from base to apex.
        height: f64,
    },
    /// A solid ring.
    Torus {
        /// Distance from the centre to the middle of the ring's section.
        major_radius: f64,
        /// Radius of the ring's section, at most the major radius.
        minor_radius: f64,
    },
    /// A solid tetrahedron anywhere.
    Tetrahedron {
        /// The corners, in either orientation.
        corners: [DVec3; 4],
    },
}

impl Shape {
    /// Whether all lengths are valid.
    ///
    /// # Errors
    /// [`Error::Setting`] with the first length that is not positive and finite (or breaks the condition noted beside
    /// it), or where a tetrahedron's corners are not finite or lie in a plane.
    pub fn validate(&self) -> Result<()> {
        match *self {
            Self::Point => Ok(()),
            Self::Rod { length } => positive("length", length).map(drop),
            Self::RectangularPlate { width, depth } => {
                positive("width", width).and_then(|_| positive("depth", depth)).map(drop)
            }
            Self::CircularPlate { radius } | Self::Sphere { radius } | Self::SphericalShell { radius } => {
                positive("radius", radius).map(drop)
            }
            Self::Ellipsoid { semi_axes } => {
                semi_axes.to_array().into_iter().try_for_each(|a| positive("semi_axes", a).map(drop))
            }
            Self::Box { edges } => edges.to_array().into_iter().try_for_each(|a| positive("edges", a).map(drop)),
            Self::Cylinder { radius, height } | Self::Cone { radius, height } => {
                positive("radius", radius).and_then(|_| positive("height", height)).map(drop)
            }
            Self::Tube { inner_radius, outer_radius, height } => {
                positive("outer_radius", outer_radius).and_then(|_| positive("height", height))?;
                let expected = "at least 0 and less than outer_radius";
                if (0.0..outer_radius).contains(&inner_radius) {
                    Ok(())
                } else {
                    Err(Error::Setting { field: "inner_radius", value: inner_radius, expected })
                }
            }
            Self::Capsule { radius, length } => {
                positive("radius", radius).and_then(|_| positive("length", length)).map(drop)
            }
            Self::Torus { major_radius, minor_radius } => {
                positive("major_radius", major_radius).and_then(|_| positive("minor_radius", minor_radius))?;
                if minor_radius <= major_radius {
                    Ok(())
                } else {
                    let expected = "at most major_radius";
                    Err(Error::Setting { field: "minor_radius", value: minor_radius, expected })
                }
            }
            Self::Tetrahedron { corners } => {
                corners.into_iter().try_for_each(|corner| finite("corners", corner).map(drop))?;
                positive("volume of the tetrahedron", self.volume()).map(drop)
            }
        }
    }

    /// Volume, m³; 0 for points, rods, plates and shells.
    pub fn volume(&self) -> f64 {
        match *self {
            Self::Point
            | Self::Rod { .. }
            | Self::RectangularPlate { .. }
            | Self::CircularPlate { .. }
            | Self::SphericalShell { .. } => 0.0,
            Self::Sphere { radius } => 4.0 / 3.0 * PI * radius * radius * radius,
            Self::Ellipsoid { semi_axes } => 4.0 / 3.0 * PI * semi_axes.element_product(),
            Self::Box { edges } => edges.element_product(),
            Self::Cylinder { radius, height } => PI * radius * radius * height,
            Self::Tube { inner_radius, outer_radius, height } => {
                PI * (outer_radius - inner_radius) * (outer_radius + inner_radius) * height
            }
            Self::Capsule { radius, length } => PI * radius * radius * (length + 4.0 / 3.0 * radius),
            Self::Cone { radius, height } => PI / 3.0 * radius * radius * height,
            Self::Torus { major_radius, minor_radius } => 2.0 * PI * PI * major_radius * minor_radius * minor_radius,
            Self::Tetrahedron { corners: [a, b, c, d] } => (b - a).cross(c - a).dot(d - a).abs() / 6.0,
        }
    }

    /// The mass properties at a total of `mass` kg.
    ///
    /// # Errors
    /// As [`validate`](Self::validate), or [`Error::Setting`] where `mass` is not positive and finite.
    pub fn mass_properties(&self, mass: f64) -> Result<MassProperties> {
        positive("mass", mass)?;
        self.validate()?;
        Ok(MassProperties {
            mass,
            volume: self.volume(),
            centre_of_mass: self.centre_of_mass(),
            inertia: self.inertia_per_mass() * mass,
        })
    }

    /// The mass properties at `density` kg/m³.
    ///
    /// # Errors
    /// As [`validate`](Self::validate), or [`Error::Setting`] where `density` is not positive and finite or the shape
    /// has no volume.
    pub fn mass_properties_of_density(&self, density: f64) -> Result<MassProperties> {
        positive("density", density)?;
        self.validate()?;
        self.mass_properties(positive("volume", self.volume())? * density)
    }

    fn centre_of_mass(&self) -> DVec3 {
        match *self {
            Self::Cone { height, .. } => DVec3::new(0.0, 0.0, 0.25 * height),
            Self::Tetrahedron { corners: [a, b, c, d] } => a + 0.25 * ((b - a) + (c - a) + (d - a)),
            _ => DVec3::ZERO,
        }
    }

    /// The tensor about the centre of mass for 1 kg, m².
    fn inertia_per_mass(&self) -> InertiaTensor {
        // Second moments ∫x², ∫y², ∫z² over the mass; the moments are their pairwise sums.
        let diagonal = |x: f64, y: f64, z: f64| InertiaTensor::from_second_moments([x, y, z, 0.0, 0.0, 0.0]);
        match *self {
            Self::Point => InertiaTensor::default(),
            Self::Rod { length } => diagonal(0.0, 0.0, length * length / 12.0),
            Self::RectangularPlate { width, depth } => diagonal(width * width / 12.0, depth * depth / 12.0, 0.0),
            Self::CircularPlate { radius } => {
                let square = 0.25 * radius * radius;
                diagonal(square, square, 0.0)
            }
            Self::Sphere { radius } => {
                let square = radius * radius / 5.0;
                diagonal(square, square, square)
            }
            Self::SphericalShell { radius } => {
                let square = radius * radius / 3.0;
                diagonal(square, square, square)
            }
            Self::Ellipsoid { semi_axes } => {
                let s = semi_axes * semi_axes / 5.0;
                diagonal(s.x, s.y, s.z)
            }
            Self::Box { edges } => {
                let s = edges * edges / 12.0;
                diagonal(s.x, s.y, s.z)
            }
            Self::Cylinder { radius, height } => {
                let across = 0.25 * radius * radius;
                diagonal(across, across, height * height / 12.0)
            }
            Self::Tube { inner_radius, outer_radius, height } => {
                let across = 0.25 * (inner_radius * inner_radius + outer_radius * outer_radius);
                diagonal(across, across, height * height / 12.0)
            }
            Self::Capsule { radius, length } => {
                let (cylinder, caps) = (length, 4.0 / 3.0 * radius);
                let (cylinder, caps) = (cylinder / (cylinder + caps), caps / (cylinder + caps));
                let across = cylinder * 0.25 * radius * radius + caps * 0.2 * radius * radius;
                // A half sphere's centre of mass is 3/8 of the radius above its base.
                let along = cylinder * length * length / 12.0
                    + caps * (0.2 * radius * radius + 0.25 * length * length + 0.375 * length * radius);
                diagonal(across, across, along)
            }
            Self::Cone { radius, height } => {
                let across = 0.15 * radius * radius;
                diagonal(across, across, 0.0375 * height * height)
            }
            Self::Torus { major_radius, minor_radius } => {
                let section = minor_radius * minor_radius;
                let across = 0.5 * major_radius * major_radius + 0.375 * section;
                diagonal(across, across, 0.25 * section)
            }
            Self::Tetrahedron { corners } => {
                // About the centre of mass: (Σ r rᵀ)/20 over the corners (D. Eberly, "Polyhedral Mass Properties",
                // 2002).
                let centre = self.centre_of_mass();
                corners.into_iter().fold(InertiaTensor::default(), |sum, corner| {
                    sum + InertiaTensor::of_point_mass(0.05, corner - centre)
                })
            }
        }
    }
}
