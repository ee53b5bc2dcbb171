//! `bodies.inertia` in study files.

use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::distribution::Vector;
use super::draw::{Column, Draw};
use super::reader::{Node, Table};
use super::solid::{FORMS, Solid};
use crate::bodies::inertia::{InertiaTensor, check_scatter, principal_axes, scaled_second_moments};
use crate::error::Result;

/// The source of a body's inertia tensor.
#[derive(Clone, Debug, PartialEq)]
pub enum Inertia {
    /// Moments along the body axes, kg m², each drawn independently.
    Moments(Vector),
    /// One tensor in body axes for all bodies, kg m².
    Tensor(InertiaTensor),
    /// Moments about axes that all bodies share, scattered so that every draw is a valid tensor
    /// ([`crate::bodies::inertia::scattered_moments`]).
    Scattered {
        /// Mean of the moments, kg m².
        nominal: DVec3,
        /// Rotates the axes of the moments to body axes.
        axes: DQuat,
        /// Relative standard deviation of each second moment.
        relative_sigma: f64,
    },
    /// Described matter, about its centre of mass or about another point.
    Solid {
        /// The matter.
        solid: Solid,
        /// The point about which the tensor is, m in body axes from the centre of mass; `None` for the centre of mass itself.
        about: Option<DVec3>,
    },
    /// One for each cell of the study's design; body b has that of cell b modulo their number.
    PerCell(Arc<[Inertia]>),
}

/// An invalid tensor, which no body can pass validation with.
const NO_TENSOR: InertiaTensor = InertiaTensor { xx: f64::NAN, yy: f64::NAN, zz: f64::NAN, xy: 0.0, xz: 0.0, yz: 0.0 };

const EXPECTED: &str = "expected { shape = \"box\", mass = 10.0, edges = [1, 2, 3] }, { mesh = \"hull.stl\", mass = 10.0 }, { points = \"atoms.csv\" }, { parts = [...] }, moments [ixx, iyy, izz], { moments = ... } or { ixx = ..., iyy = ..., izz = ..., ixy = ..., ixz = ..., iyz = ... }";

/// The key of the point about which the tensor of described matter is.
const ABOUT: &str = "about";

impl Inertia {
    /// The tensor of `body`, body axes, kg m². A solid that is not valid gives an invalid tensor;
    /// the reason is determined when the body is refused.
    pub fn sample(&self, draw: Draw, body: usize) -> InertiaTensor {
        match self {
            Inertia::Moments(moments) => moments.sample(draw, body, Column::Inertia).into(),
            Inertia::Tensor(tensor) => *tensor,
            Inertia::Scattered { nominal, axes, relative_sigma: sigma } => {
                // The exponential is that of `libm`, so that draws have the same bits on every platform.
                let factor = |z: f64| libm::exp(sigma * z - 0.5 * sigma * sigma);
                let normals = draw.normal_vector(body, Column::Inertia);
                let factors = DVec3::from_array(normals.to_array().map(factor));
                let tensor = InertiaTensor::from_principal_moments(scaled_second_moments(*nominal, factors));
                if *axes == DQuat::IDENTITY { tensor } else { tensor.rotated(*axes) }
            }
            Inertia::PerCell(cells) => cells[draw.cell(body, cells.len())].sample(draw, body),
            Inertia::Solid { solid, about } => solid.sample(draw, body).map_or(NO_TENSOR, |properties| {
                let about = about.unwrap_or(DVec3::ZERO);
                properties.inertia_about(properties.centre_of_mass + about)
            }),
        }
    }

    /// Whether it is the tensor about the centre of mass of described matter.
    pub(super) fn is_about_the_centre(&self) -> bool {
        matches!(self, Inertia::Solid { about: None, .. })
    }

    pub(super) fn read(node: &Node<'_>) -> Result<Self> {
        // Solids have distributions for each cell of their own: meshes are read once.
        let is_solid = node.any_table().is_some_and(|table| FORMS.into_iter().any(|form| table.find(form).is_some()));
        if !is_solid && let Some(cells) = node.per_cell(Self::read)? {
            return Ok(Inertia::PerCell(cells));
        }
        if node.elements().is_some() {
            return node
                .vector("kg m²", "expected three finite moments along the body axes (kg m²)")
                .map(|moments| Inertia::Tensor(InertiaTensor::from_principal_moments(moments)));
        }
        let table = node.any_table().ok_or_else(|| node.refuse(EXPECTED))?;
        if let Some(form) = FORMS.into_iter().find(|form| table.find(form).is_some()) {
            let solid = Solid::read(node, &table, form, &[ABOUT])?;
            let about = table.find(ABOUT).map(|point| {
                point.vector(
                    "m",
                    "expected a point in body axes, from the centre of mass (m): the tensor is that about it",
                )
            });
            return Ok(Inertia::Solid { solid, about: about.transpose()? });
        }
        let scatter = table.find("scatter");
        if let Some(moments) = table.find("moments") {
            table.only(&["moments", "scatter"])?;
            return match scatter {
                None => Vector::read(&moments, "kg m²").map(Inertia::Moments),
                Some(scatter) => {
                    let expected = "expected three moments beside `scatter`, which draws from them (kg m²)";
                    scattered(&scatter, &moments, moments.vector("kg m²", expected)?, DQuat::IDENTITY)
                }
            };
        }
        let tensor = tensor(node, &table)?;
        match scatter {
            None => Ok(Inertia::Tensor(tensor)),
            Some(scatter) => {
                let axes = principal_axes(&tensor);
                scattered(&scatter, node, axes.moments, axes.principal_to_body)
            }
        }
    }
}

/// Moments about `axes`, given at `node`, scattered by the number at `scatter`.
fn scattered(scatter: &Node<'_>, node: &Node<'_>, nominal: DVec3, axes: DQuat) -> Result<Inertia> {
    const EXPECTED: &str = "expected a relative standard deviation that is not negative";
    let relative_sigma = scatter.quantity("1", EXPECTED)?;
    if relative_sigma < 0.0 {
        return Err(scatter.refuse(EXPECTED));
    }
    check_scatter(nominal, relative_sigma).map_err(|error| node.caused_by(error))?;
    Ok(Inertia::Scattered { nominal, axes, relative_sigma })
}

/// The six elements of a tensor; the off-diagonal ones may be omitted.
fn tensor(node: &Node<'_>, table: &Table<'_>) -> Result<InertiaTensor> {
    let elements = ["ixx", "iyy", "izz", "ixy", "ixz", "iyz"];
    table.only(&[&FORMS[..], &["moments"], &elements, &["scatter"]].concat())?;
    if table.find("ixx").is_none() {
        return Err(node.refuse(EXPECTED));
    }
    let diagonal = |key: &str| {
        let node = table.need(key, "expected the tensor's diagonal element (kg m²)")?;
        node.quantity("kg m²", "expected a finite number (kg m²)")
    };
    let product = |key: &str| match table.find(key) {
        Some(node) => node.quantity("kg m²", "expected a finite number (kg m²)"),
        None => Ok(0.0),
    };
    Ok(InertiaTensor {
        xx: diagonal("ixx")?,
        yy: diagonal("iyy")?,
        zz: diagonal("izz")?,
        xy: product("ixy")?,
        xz: product("ixz")?,
        yz: product("iyz")?,
    })
}
