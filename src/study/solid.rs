//! Bodies described by their matter: shapes whose sizes are drawn, meshes, point masses and parts.

use glam::DVec3;

use super::distribution::{Scalar, Vector};
use super::draw::{Column, Draw};
use super::parts::{self, StudyPart};
use super::points::read_points;
use super::reader::{Node, Table};
use super::shape_kind::{NAMES, ShapeKind, TETRAHEDRON};
use crate::bodies::inertia::{MassProperties, Part, Shape, compose, point_masses};
use crate::error::InputFault;
use crate::error::{Error, Result};

/// A body given by a description of its matter.
///
/// Its centre of mass may lie anywhere in the frame in which it is described; the body's own frame has the same axes and
/// its origin at the centre of mass.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    form: Form,
    matter: Matter,
}

/// How the matter is distributed.
#[derive(Clone, Debug, PartialEq)]
enum Form {
    /// Homogeneous, in a shape with lengths (m) in the order in which [`Shape`] has them.
    Shape { kind: ShapeKind, lengths: Vector },
    /// As in this body, the same for all bodies: read from a file, or composed of parts that are not drawn.
    Fixed(MassProperties),
    /// In parts.
    Parts(Vec<StudyPart>),
}

/// How much matter there is.
#[derive(Clone, Debug, PartialEq)]
enum Matter {
    /// Mass, kg.
    Mass(Scalar),
    /// Density, kg/m³.
    Density(Scalar),
    /// As points and parts define it themselves.
    Own,
}

/// The columns under which a body, or a part of one, is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct DrawnUnder {
    pub(super) size: Column,
    pub(super) matter: Column,
}

/// The columns of a whole body.
const WHOLE: DrawnUnder = DrawnUnder { size: Column::Inertia, matter: Column::Mass };

/// Why a draw is not a body, and for which part if it is composed of parts.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SolidFault {
    pub(super) part: Option<usize>,
    pub(super) error: Box<Error>,
}

impl From<Error> for SolidFault {
    fn from(error: Error) -> Self {
        Self { part: None, error: Box::new(error) }
    }
}

/// The keys for the ways to describe matter.
pub(super) const FORMS: [&str; 5] = ["shape", "mesh", "hull", "points", "parts"];

impl Solid {
    /// Mass and inertia of `body`. The centre of mass is in the frame in which the body is described.
    ///
    /// # Errors
    ///
    /// [`Error::Setting`] if a drawn length, mass or density is not valid; [`Error::Item`] for one of a part;
    /// [`Error::Inertia`] if holes leave nothing that could be a body.
    pub fn sample(&self, draw: Draw, body: usize) -> Result<MassProperties> {
        self.sample_or_fault(draw, body).map_err(|fault| *fault.error)
    }

    pub(super) fn sample_or_fault(&self, draw: Draw, body: usize) -> Result<MassProperties, SolidFault> {
        self.sample_under(WHOLE, draw, body)
    }

    pub(super) fn sample_under(
        &self,
        columns: DrawnUnder,
        draw: Draw,
        body: usize,
    ) -> Result<MassProperties, SolidFault> {
        let amount = |scalar: &Scalar| scalar.sample(draw, body, columns.matter, 0);
        let properties = match &self.form {
            Form::Shape { kind, lengths } => {
                let shape = kind.shape(lengths.sample(draw, body, columns.size).to_array());
                return Ok(match &self.matter {
                    Matter::Mass(mass) => shape.mass_properties(amount(mass))?,
                    Matter::Density(density) => shape.mass_properties_of_density(amount(density))?,
                    Matter::Own => shape.mass_properties(1.0)?,
                });
            }
            Form::Fixed(properties) => *properties,
            Form::Parts(parts) => {
                let mut placed: Vec<Part> = Vec::with_capacity(parts.len());
                for (index, part) in parts.iter().enumerate() {
                    let of_part = |fault: SolidFault| SolidFault { part: Some(index), error: fault.error };
                    placed.push(part.sample(draw, body).map_err(of_part)?);
                }
                compose(&placed).map_err(|error| match error {
                    Error::Item { index, .. } => SolidFault { part: Some(index), error: Box::new(error) },
                    error => error.into(),
                })?
            }
        };
        Ok(match &self.matter {
            Matter::Mass(mass) => properties.with_mass(amount(mass))?,
            Matter::Density(density) => properties.with_density(amount(density))?,
            Matter::Own => properties,
        })
    }

    /// Whether nothing about it is drawn.
    pub(super) fn is_constant(&self) -> bool {
        let form = match &self.form {
            Form::Shape { lengths, .. } => lengths.is_constant(),
            Form::Fixed(_) => true,
            Form::Parts(parts) => parts.iter().all(StudyPart::is_constant),
        };
        form && match &self.matter {
            Matter::Mass(amount) | Matter::Density(amount) => amount.is_constant(),
            Matter::Own => true,
        }
    }

    /// Reads the table `node` with the key `key` of [`FORMS`]; `others` are keys that it may have in addition to those of a
    /// body.
    pub(super) fn read(node: &Node<'_>, table: &Table<'_>, key: &str, others: &[&'static str]) -> Result<Self> {
        let only = |known: &[&'static str]| table.only(&[known, others].concat());
        let form = table.need(key, "expected a description of the body's matter")?;
        table.exclusive("density", "mass")?;
        let solid = match key {
            "shape" => return Self::read_shape(table, &form, only),
            "mesh" => {
                only(&["mesh", "mass", "density", "scale", "shell"])?;
                let is_shell = match table.find("shell") {
                    Some(shell) => shell.boolean("expected true or false")?,
                    None => false,
                };
                let unit = mesh(&form, scale(table)?, is_shell)?;
                Self { form: Form::Fixed(unit), matter: matter(table, unit.volume > 0.0)? }
            }
            "hull" => {
                only(&["hull", "mass", "density", "scale"])?;
                let unit = hull(&form, scale(table)?)?;
                Self { form: Form::Fixed(unit), matter: matter(table, true)? }
            }
            "points" => {
                only(&["points", "mass", "scale"])?;
                let mut points = read_points(&file(&form)?).map_err(|error| form.caused_by(error))?;
                let factor = scale(table)?;
                points.iter_mut().for_each(|(_, position)| *position *= factor);
                let body = point_masses(&points).map_err(|error| form.caused_by(error))?;
                Self { form: Form::Fixed(body), matter: own_matter(table, false)? }
            }
            _ => {
                only(&["parts", "mass", "density"])?;
                Self { form: Form::Parts(parts::read(&form)?), matter: own_matter(table, true)? }
            }
        };
        solid.settled(node, table)
    }

    fn read_shape(table: &Table<'_>, name: &Node<'_>, only: impl Fn(&[&'static str]) -> Result<()>) -> Result<Self> {
        let chosen = name.choice(&NAMES)?;
        let Some(kind) = ShapeKind::named(chosen) else {
            only(&["shape", "mass", "density", "corners"])?;
            assert_eq!(chosen, TETRAHEDRON);
            let unit = tetrahedron(table)?;
            return Self { form: Form::Fixed(unit), matter: matter(table, true)? }.settled(name, table);
        };
        let keys = kind.lengths();
        only(&[&["shape", "mass", "density"], keys].concat())?;
        let lengths = if kind.takes_vector() {
            Vector::read(&table.need(keys[0], "expected three lengths (m)")?, "m")?
        } else {
            let mut components = [0.0; 3].map(Scalar::Constant);
            for (component, key) in components.iter_mut().zip(keys) {
                *component = Scalar::read(&table.need(key, "expected a length (m)")?, "m")?;
            }
            Vector::Components(components)
        };
        Ok(Self { form: Form::Shape { kind, lengths }, matter: matter(table, kind.has_volume())? })
    }

    /// The same body, with constant parts computed once and refused at their place if they are not valid.
    fn settled(self, node: &Node<'_>, table: &Table<'_>) -> Result<Self> {
        if !self.is_constant() {
            return Ok(self);
        }
        match self.sample_or_fault(Draw::new(0), 0) {
            Ok(properties) => Ok(Self { form: Form::Fixed(properties), matter: Matter::Own }),
            Err(SolidFault { part: Some(part), error }) => Err(parts::refusal(table, part, *error)),
            Err(SolidFault { part: None, error }) => Err(refusal(node, table, *error)),
        }
    }
}

/// `error` at the key of `table` that it concerns, or at `node`.
pub(super) fn refusal(node: &Node<'_>, table: &Table<'_>, error: Error) -> Error {
    match error {
        Error::Setting { field, expected, .. } | Error::Item { field, expected, .. } => match table.find(field) {
            Some(key) => key.refuse(expected),
            None => node.caused_by(error),
        },
        error => node.caused_by(error),
    }
}

/// `mass` or `density`, exactly one of which is required.
fn matter(table: &Table<'_>, has_volume: bool) -> Result<Matter> {
    match own_matter(table, has_volume)? {
        Matter::Own => {
            let expected = "expected the mass (kg), or a density (kg/m³)";
            Ok(Matter::Mass(Scalar::read(&table.need("mass", expected)?, "kg")?))
        }
        matter => Ok(matter),
    }
}

/// `mass` or `density`, if one is given.
fn own_matter(table: &Table<'_>, has_volume: bool) -> Result<Matter> {
    match (table.find("density"), table.find("mass")) {
        (Some(density), _) if !has_volume => Err(density.refuse("this shape has no volume: use a mass instead (kg)")),
        (Some(density), _) => Ok(Matter::Density(Scalar::read(&density, "kg/m³")?)),
        (None, Some(mass)) => Ok(Matter::Mass(Scalar::read(&mass, "kg")?)),
        (None, None) => Ok(Matter::Own),
    }
}

/// The factor that converts a file's lengths to metres.
fn scale(table: &Table<'_>) -> Result<f64> {
    match table.find("scale") {
        Some(node) => {
            let expected = "expected the length of the file's unit, above zero (m): 0.001 for millimetres";
            node.positive_quantity("m", expected)
        }
        None => Ok(1.0),
    }
}

fn file(node: &Node<'_>) -> Result<std::path::PathBuf> {
    node.string("expected the name of a file").map(|name| node.beside(name))
}

/// A body of density 1 kg/m³ (or, as a shell, of 1 kg) with a mesh as its surface.
#[cfg(feature = "mesh")]
fn mesh(node: &Node<'_>, scale: f64, is_shell: bool) -> Result<MassProperties> {
    let path = file(node)?;
    let read = || {
        let mesh = crate::bodies::inertia::read_mesh(&path)?.scaled(scale)?;
        if is_shell {
            return mesh.shell_mass_properties(1.0);
        }
        let properties = mesh.mass_properties_of_density(1.0)?;
        mesh.overlap().map_or(Ok(properties), |defect| Err(Error::Mesh(defect)))
    };
    read().map_err(|error| node.caused_by(error))
}

/// A body of density 1 kg/m³ that is the convex hull of points.
#[cfg(feature = "mesh")]
fn hull(node: &Node<'_>, scale: f64) -> Result<MassProperties> {
    let points = read_points(&file(node)?).map_err(|error| node.caused_by(error))?;
    let points: Vec<DVec3> = points.into_iter().map(|(_, position)| position * scale).collect();
    crate::bodies::inertia::convex_hull(&points)
        .and_then(|mesh| mesh.mass_properties_of_density(1.0))
        .map_err(|error| node.caused_by(error))
}

/// The message of a build without meshes.
#[cfg(not(feature = "mesh"))]
pub(super) const NO_MESHES: &str = "this build of polhode reads no meshes: use one with the feature `mesh`";

#[cfg(not(feature = "mesh"))]
fn mesh(node: &Node<'_>, _: f64, _: bool) -> Result<MassProperties> {
    Err(node.refuse(NO_MESHES))
}

#[cfg(not(feature = "mesh"))]
fn hull(node: &Node<'_>, _: f64) -> Result<MassProperties> {
    Err(node.refuse(NO_MESHES))
}

/// A tetrahedron of density 1 kg/m³.
fn tetrahedron(table: &Table<'_>) -> Result<MassProperties> {
    const EXPECTED: &str = "expected four corners [x, y, z] (m)";
    let node = table.need("corners", EXPECTED)?;
    let elements = node.elements().ok_or_else(|| node.refuse(EXPECTED))?;
    let corners = elements.iter().map(|corner| corner.vector("m", EXPECTED)).collect::<Result<Vec<DVec3>>>()?;
    let corners = <[DVec3; 4]>::try_from(corners).map_err(|_| node.refuse(EXPECTED))?;
    let properties = Shape::Tetrahedron { corners }.mass_properties_of_density(1.0);
    properties.map_err(|_| node.refuse("expected four corners that do not lie in a plane (m)"))
}

impl Node<'_> {
    /// The error for a value that is well formed but leads to `cause`; errors that name a file's line are left unchanged.
    pub(super) fn caused_by(&self, cause: Error) -> Error {
        match cause {
            Error::Input(_) => cause,
            cause => self.fault(InputFault::Cause { value: self.text(), cause: Box::new(cause) }),
        }
    }
}
