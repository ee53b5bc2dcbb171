//! Mass properties: from a distribution of mass to mass, centre of mass, inertia tensor and principal frame.
//!
//! The tensor is I = ∫ρ \[r\]×ᵀ\[r\]× dΩ about the centre of mass ("A Complete Derivation of the Newton-Euler
//! Equations", equation (5)). It can be computed from:
//!
//! | matter given as | by |
//! | --- | --- |
//! | point masses | [`point_masses`] |
//! | a homogeneous body with a formula | [`Shape`] |
//! | a closed surface of triangles, exactly | [`TriangleMesh`], from OBJ and STL files with [`read_mesh`] |
//! | the convex hull of points | [`convex_hull`] |
//! | a thin skin | [`TriangleMesh::shell_mass_properties`] |
//! | parts, and holes in them | [`compose`] |
//!
//! All give [`MassProperties`]: mass, volume, centre of mass, and the tensor about it. Its methods move and turn the body,
//! give it another mass, and refer its tensor to other points. [`principal_axes`] turns the tensor into principal moments
//! and axes; [`classify`] names the kind of rotor. [`Validity`] tells how far a tensor is from that of a rigid body, and
//! [`repair_triangle_inequality`] repairs a measured one; this happens only on request.
//!
//! Reading mesh files and convex hulls need the feature `mesh`, which is on by default.

mod class;
mod composition;
#[cfg(feature = "mesh")]
mod hull;
mod mass_properties;
mod mesh;
#[cfg(feature = "mesh")]
mod mesh_file;
mod moments;
mod overlap;
mod points;
mod principal;
mod scatter;
mod shape;
#[cfg(feature = "mesh")]
mod stl;
mod tensor;
mod tessellation;
mod validation;

pub use class::{InertiaClass, classify};
pub use composition::{Part, compose};
#[cfg(feature = "mesh")]
pub use hull::convex_hull;
pub use mass_properties::MassProperties;
#[cfg(feature = "study")]
pub(crate) use mass_properties::positive;
pub use mesh::{MeshReport, TriangleMesh};
#[cfg(feature = "mesh")]
pub use mesh_file::{parse_mesh, read_mesh};
pub use points::point_masses;
pub(crate) use principal::AxisPermutation;
pub use principal::{PrincipalAxes, principal_axes};
pub use scatter::scattered_moments;
#[cfg(feature = "study")]
pub(crate) use scatter::{check_scatter, scaled_second_moments};
pub use shape::Shape;
pub use tensor::InertiaTensor;
pub use validation::{Repair, VANISHING_MOMENT, Validity, repair_triangle_inequality};
