//! Vectors that are drawn for bodies.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::correlated::cholesky;
use super::scalar::{COMPLETE, Values, by_component};
use super::{Empirical, Mixture, SELECT, Scalar, kind, rows};
use crate::error::Result;
use crate::study::draw::{Column, Draw};
use crate::study::reader::{Node, Table};

/// The distribution of a vector of a body; the table above has formulas and sources.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Vector {
    /// Each component independently.
    Components([Scalar; 3]),
    /// A direction uniform on the sphere, with an independent magnitude.
    Direction {
        /// The magnitude; a negative one reverses the direction.
        magnitude: Scalar,
    },
    /// A direction about an axis, by R. von Mises and R. A. Fisher, with an independent magnitude.
    VonMisesFisher {
        /// Unit vector.
        axis: DVec3,
        /// Concentration κ, not negative; 0 is uniform on the sphere.
        concentration: f64,
        /// The magnitude.
        magnitude: Scalar,
    },
    /// A direction uniform within an angle of an axis, with an independent magnitude.
    Cone {
        /// Unit vector.
        axis: DVec3,
        /// The angle, rad, in [0, π].
        half_angle: f64,
        /// The magnitude.
        magnitude: Scalar,
    },
    /// Normal, with a covariance of the components.
    Normal {
        /// Mean.
        mean: DVec3,
        /// Lower triangular; its product with its transpose is the covariance.
        factor: DMat3,
    },
    /// One of several distributions.
    Mixture(Arc<Mixture<Vector>>),
    /// A row of a table.
    Rows(Arc<Empirical<3>>),
    /// One for each cell of the study's design; body b has that of cell b modulo their number.
    PerCell(Arc<[Vector]>),
}

/// The component under which a magnitude is drawn; block 0 holds the direction.
const MAGNITUDE: u32 = 1;

impl Vector {
    /// The same vector for every body.
    pub fn constant(value: DVec3) -> Self {
        Vector::Components(value.to_array().map(Scalar::Constant))
    }

    /// The vector of `body`.
    pub fn sample(&self, draw: Draw, body: usize, column: Column) -> DVec3 {
        let length = |magnitude: &Scalar| magnitude.sample(draw, body, column, MAGNITUDE);
        match self {
            Vector::Components(components) => {
                let [x, y, z] = [0, 1, 2].map(|c| components[c].sample(draw, body, column, c as u32));
                DVec3::new(x, y, z)
            }
            Vector::Direction { magnitude } => draw.direction(body, column) * length(magnitude),
            Vector::VonMisesFisher { axis, concentration, magnitude } => {
                let (u, v) = draw.pair(body, column, 0);
                near_axis(*axis, von_mises_fisher(*concentration, u), v) * length(magnitude)
            }
            Vector::Cone { axis, half_angle, magnitude } => {
                let (u, v) = draw.pair(body, column, 0);
                // 1 − cos of the half angle, without cancellation for small angles.
                let sin = libm::sin(0.5 * half_angle);
                near_axis(*axis, u * 2.0 * sin * sin, v) * length(magnitude)
            }
            Vector::Normal { mean, factor } => *mean + *factor * draw.normal_vector(body, column),
            Vector::Mixture(mixture) => mixture.part(draw, body, column, SELECT).sample(draw, body, column),
            Vector::Rows(rows) => rows.row(draw, body).into(),
            Vector::PerCell(cells) => cells[draw.cell(body, cells.len())].sample(draw, body, column),
        }
    }

    /// Whether all bodies have the same vector.
    pub(in crate::study) fn is_constant(&self) -> bool {
        matches!(self, Vector::Components(components) if components.iter().all(Scalar::is_constant))
    }

    /// Reads a vector in `unit`, or its distribution.
    pub(in crate::study) fn read(node: &Node<'_>, unit: &str) -> Result<Self> {
        Self::read_among(node, unit, NAMES)
    }

    /// The same; messages also list the distributions in `names`.
    pub(super) fn read_among(node: &Node<'_>, unit: &str, names: &'static [&'static str]) -> Result<Self> {
        const EXPECTED: &str = "expected a vector [x, y, z], or a distribution such as { distribution = \"normal\", mean = [0, 0, 0.1], sigma = 0.02 }";
        if let Some(elements) = node.elements() {
            if elements.iter().all(|element| element.any_table().is_none()) {
                return node.vector(unit, "expected three finite numbers").map(Vector::constant);
            }
            let components: Vec<Scalar> =
                elements.iter().map(|element| Scalar::read(element, unit)).collect::<Result<_>>()?;
            let components =
                components.try_into().map_err(|_| node.refuse("expected three numbers or distributions"))?;
            return Ok(Vector::Components(components));
        }
        if let Some(cells) = node.per_cell(|node| Self::read_among(node, unit, names))? {
            return Ok(Vector::PerCell(cells));
        }
        let table = node.any_table().ok_or_else(|| node.refuse(EXPECTED))?;
        let magnitude = |keys: &[&str]| {
            table.only(&[&["distribution", "magnitude"], keys].concat())?;
            let node = table.need("magnitude", "expected the vector's length, a number or a distribution")?;
            Scalar::read(&node, unit)
        };
        match kind(&table, names, EXPECTED)? {
            "constant" => {
                table.only(&["distribution", "value"])?;
                let value = table.need("value", "expected the value")?;
                value.vector(unit, "expected three finite numbers").map(Vector::constant)
            }
            "direction" => Ok(Vector::Direction { magnitude: magnitude(&[])? }),
            "von-mises-fisher" => {
                let magnitude = magnitude(&["axis", "concentration"])?;
                const CONCENTRATION: &str = "expected a concentration that is not negative: 0 is uniform on the sphere, 1/κ the mean square of small angles on each of two axes";
                let node = table.need("concentration", CONCENTRATION)?;
                let concentration = node.quantity("1", CONCENTRATION)?;
                if concentration < 0.0 {
                    return Err(node.refuse(CONCENTRATION));
                }
                Ok(Vector::VonMisesFisher { axis: axis(&table)?, concentration, magnitude })
            }
            "cone" => {
                let magnitude = magnitude(&["axis", "half_angle"])?;
                const ANGLE: &str = "expected an angle from 0 to pi (rad)";
                let node = table.need("half_angle", ANGLE)?;
                let half_angle = node.quantity("rad", ANGLE)?;
                if !(0.0..=std::f64::consts::PI).contains(&half_angle) {
                    return Err(node.refuse(ANGLE));
                }
                Ok(Vector::Cone { axis: axis(&table)?, half_angle, magnitude })
            }
            "normal" if table.find("covariance").is_some() => Self::read_normal(&table, unit),
            "mixture" => {
                Mixture::read(&table, |node| Self::read(node, unit), |part| matches!(part, Vector::Mixture(_)))
                    .map(Vector::Mixture)
            }
            "rows" => rows(&table).map(Vector::Rows),
            name => {
                let components = by_component(&table, name, &Values { unit, of_vector: true })?;
                Ok(Vector::Components(components.expect(COMPLETE)))
            }
        }
    }

    fn read_normal(table: &Table<'_>, unit: &str) -> Result<Self> {
        table.only(&["distribution", "mean", "covariance"])?;
        const EXPECTED: &str = "expected three rows of three finite numbers";
        let mean = table.need("mean", "expected the mean")?.vector(unit, "expected three finite numbers")?;
        let node = table.need("covariance", EXPECTED)?;
        let rows = node.elements().filter(|rows| rows.len() == 3).ok_or_else(|| node.refuse(EXPECTED))?;
        let squared = format!("({unit})^2");
        let rows: Vec<[f64; 3]> = rows.iter().map(|row| row.quantities(&squared, EXPECTED)).collect::<Result<_>>()?;
        let rows: Vec<Vec<f64>> = rows.into_iter().map(|row| row.to_vec()).collect();
        let l = cholesky(&rows)
            .ok_or_else(|| node.refuse("expected a covariance: symmetric, and without negative eigenvalues"))?;
        let column = |c: usize| DVec3::new(l[0][c], l[1][c], l[2][c]);
        Ok(Vector::Normal { mean, factor: DMat3::from_cols(column(0), column(1), column(2)) })
    }
}

/// The distributions of a vector.
pub(super) const NAMES: &[&str] = &[
    "constant",
    "uniform",
    "normal",
    "log-normal",
    "truncated-normal",
    "exponential",
    "rayleigh",
    "triangular",
    "direction",
    "von-mises-fisher",
    "cone",
    "mixture",
    "rows",
];

/// The key `axis`, as a unit vector.
pub(super) fn axis(table: &Table<'_>) -> Result<DVec3> {
    let node = table.need("axis", "expected a direction [x, y, z]")?;
    unit_vector(&node)
}

/// A direction of any nonzero length.
pub(super) fn unit_vector(node: &Node<'_>) -> Result<DVec3> {
    let direction = node.vector("1", "expected three finite numbers")?;
    // Divided by the largest component first, so that no square overflows or underflows.
    let scaled = direction / direction.abs().max_element();
    scaled.try_normalize().ok_or_else(|| node.refuse("expected an axis that is not zero"))
}

/// 1 − cos θ for a direction at the angle θ from its axis.
fn von_mises_fisher(concentration: f64, u: f64) -> f64 {
    if concentration == 0.0 {
        return 2.0 * (1.0 - u);
    }
    let versine = -libm::log1p((1.0 - u) * libm::expm1(-2.0 * concentration)) / concentration;
    versine.clamp(0.0, 2.0)
}

/// A unit vector whose angle from an axis has a versine 1 − cos θ, at an azimuth in turns.
fn near_axis(axis: DVec3, versine: f64, azimuth: f64) -> DVec3 {
    let (x, y) = perpendicular(axis);
    let radius = (versine * (2.0 - versine)).sqrt();
    let (sin, cos) = libm::sincos(std::f64::consts::TAU * azimuth);
    (x * cos + y * sin) * radius + axis * (1.0 - versine)
}

/// Two unit vectors perpendicular to an axis and to each other (T. Duff et al., *Building an orthonormal basis, revisited*, JCGT 6 (2017)
/// 1).
fn perpendicular(axis: DVec3) -> (DVec3, DVec3) {
    let sign = 1.0_f64.copysign(axis.z);
    let a = -1.0 / (sign + axis.z);
    let b = axis.x * axis.y * a;
    (
        DVec3::new(1.0 + sign * axis.x * axis.x * a, sign * b, -sign * axis.x),
        DVec3::new(b, sign + axis.y * axis.y * a, -axis.y),
    )
}
