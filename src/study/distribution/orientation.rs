//! Orientations of bodies.

use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::vector::unit_vector;
use super::{Empirical, Mixture, SELECT, Scalar, kind, rows};
use crate::bodies::toolkit::EulerSequence;
use crate::error::Result;
use crate::study::draw::{Column, Draw};
use crate::study::euler::{ABOUT, EULER, sequence};
use crate::study::orbit::check_angle;
use crate::study::reader::{Node, Table};

/// The distribution of an orientation; the table above has formulas and sources.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Orientation {
    /// The same for every body; any quaternion that is not zero.
    Constant(DQuat),
    /// Uniform on SO(3).
    Uniform,
    /// A rotation about an axis, by an angle that is drawn.
    AxisAngle {
        /// Unit vector.
        axis: DVec3,
        /// The angle, rad.
        angle: Scalar,
    },
    /// Three turns about axes of the body or the world, by angles that are drawn.
    Euler {
        /// The axes.
        sequence: EulerSequence,
        /// The angles, rad, in the order of the turns.
        angles: [Scalar; 3],
    },
    /// Scatter about an attitude, by a rotation vector in body axes with normal components.
    Scatter {
        /// The attitude, a unit quaternion.
        about: DQuat,
        /// Standard deviations of the components, rad.
        sigma: DVec3,
    },
    /// One of several distributions.
    Mixture(Arc<Mixture<Orientation>>),
    /// A row of a table: x, y, z, w.
    Rows(Arc<Empirical<4>>),
    /// One for each cell of the study's design; body b has that of cell b modulo their number.
    PerCell(Arc<[Orientation]>),
}

impl Orientation {
    /// The orientation of `body`.
    pub fn sample(&self, draw: Draw, body: usize) -> DQuat {
        self.sample_as(draw, body, Column::Orientation)
    }

    /// A further orientation of `body`, drawn under `column`.
    pub(in crate::study) fn sample_as(&self, draw: Draw, body: usize, column: Column) -> DQuat {
        match self {
            Orientation::Constant(orientation) => *orientation,
            Orientation::Uniform => draw.rotation(body, column),
            Orientation::AxisAngle { axis, angle } => turned_about(*axis, angle.sample(draw, body, column, 0)),
            Orientation::Euler { sequence, angles } => {
                let angle = |turn: usize| angles[turn].sample(draw, body, column, turn as u32);
                sequence.composed([0, 1, 2].map(angle), turned_about)
            }
            Orientation::Scatter { about, sigma } => {
                *about * of_rotation_vector(*sigma * draw.normal_vector(body, column))
            }
            Orientation::Mixture(mixture) => mixture.part(draw, body, column, SELECT).sample_as(draw, body, column),
            Orientation::Rows(rows) => DQuat::from_array(rows.row(draw, body)),
            Orientation::PerCell(cells) => cells[draw.cell(body, cells.len())].sample_as(draw, body, column),
        }
    }

    /// Whether all bodies have the same orientation.
    pub(in crate::study) fn is_constant(&self) -> bool {
        matches!(self, Orientation::Constant(_))
    }

    pub(in crate::study) fn read(node: &Node<'_>) -> Result<Self> {
        if let Some(cells) = node.per_cell(Self::read)? {
            return Ok(Orientation::PerCell(cells));
        }
        const EXPECTED: &str = "expected a quaternion [x, y, z, w], { axis = [x, y, z], angle = radians }, { euler = \"zyx\", angles = [yaw, pitch, roll] } or { distribution = \"uniform\" }";
        if node.elements().is_some() {
            return quaternion(node).map(Orientation::Constant);
        }
        let table = node.any_table().ok_or_else(|| node.refuse(EXPECTED))?;
        if let Some(axis) = table.find("axis") {
            table.only(&["axis", "angle"])?;
            let axis = unit_vector(&axis)?;
            let angle = table.need("angle", "expected the angle turned about the axis (rad)")?;
            check_angle(&angle)?;
            return Ok(match Scalar::read(&angle, "rad")? {
                Scalar::Constant(angle) => Orientation::Constant(turned_about(axis, angle)),
                angle => Orientation::AxisAngle { axis, angle },
            });
        }
        if let Some(euler) = table.find(EULER) {
            return Self::read_euler(&table, &euler);
        }
        match kind(&table, &["uniform", "constant", "scatter", "mixture", "rows"], EXPECTED)? {
            "constant" => {
                table.only(&["distribution", "value"])?;
                quaternion(&table.need("value", "expected a quaternion [x, y, z, w]")?).map(Orientation::Constant)
            }
            "scatter" => {
                table.only(&["distribution", "about", "sigma"])?;
                let about = match table.find("about") {
                    None => DQuat::IDENTITY,
                    Some(node) => match Self::read(&node)? {
                        Orientation::Constant(about) => about.normalize(),
                        _ => return Err(node.refuse("expected an attitude that is not drawn")),
                    },
                };
                const SIGMA: &str =
                    "expected a standard deviation that is not negative, or three along the body axes (rad)";
                let node = table.need("sigma", SIGMA)?;
                let sigma: [f64; 3] = match node.is_number() {
                    true => [node.quantity("rad", SIGMA)?; 3],
                    false => node.quantities("rad", SIGMA)?,
                };
                if sigma.iter().any(|sigma| *sigma < 0.0) {
                    return Err(node.refuse(SIGMA));
                }
                Ok(Orientation::Scatter { about, sigma: sigma.into() })
            }
            "mixture" => Mixture::read(&table, Self::read, |part| matches!(part, Orientation::Mixture(_)))
                .map(Orientation::Mixture),
            "rows" => rows(&table).map(Orientation::Rows),
            _ => {
                table.only(&["distribution"])?;
                Ok(Orientation::Uniform)
            }
        }
    }

    /// `{ euler = "zyx", angles = [yaw, pitch, roll] }`; `about = "world"` for turns about the world's axes.
    fn read_euler(table: &Table<'_>, euler: &Node<'_>) -> Result<Self> {
        const EXPECTED: &str = "expected three angles (rad), numbers or distributions, in the order of the turns";
        table.only(&[EULER, "angles", ABOUT])?;
        let sequence = sequence(table, euler)?;
        let node = table.need("angles", EXPECTED)?;
        check_angle(&node)?;
        let elements = node.elements().unwrap_or_default();
        let angles: Vec<Scalar> = elements.iter().map(|angle| Scalar::read(angle, "rad")).collect::<Result<_>>()?;
        let angles: [Scalar; 3] = angles.try_into().map_err(|_| node.refuse(EXPECTED))?;
        Ok(match angles {
            [Scalar::Constant(a), Scalar::Constant(b), Scalar::Constant(c)] => {
                Orientation::Constant(sequence.composed([a, b, c], turned_about))
            }
            angles => Orientation::Euler { sequence, angles },
        })
    }
}

/// A rotation about a unit vector, by an angle in rad.
fn turned_about(axis: DVec3, angle: f64) -> DQuat {
    let (sin, cos) = libm::sincos(0.5 * angle);
    let vector = axis * sin;
    DQuat::from_xyzw(vector.x, vector.y, vector.z, cos)
}

/// exp of a rotation vector, rad.
fn of_rotation_vector(vector: DVec3) -> DQuat {
    let angle = vector.length();
    if angle == 0.0 { DQuat::IDENTITY } else { turned_about(vector / angle, angle) }
}

/// A quaternion [x, y, z, w] that is not zero.
fn quaternion(node: &Node<'_>) -> Result<DQuat> {
    let elements: [f64; 4] = node.quantities("1", "expected four finite numbers x, y, z, w")?;
    if elements == [0.0; 4] {
        return Err(node.refuse("expected a quaternion that is not zero"));
    }
    Ok(DQuat::from_array(elements))
}
