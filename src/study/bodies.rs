//! The bodies of a study: drawn from distributions, read from a table, or both.

use std::collections::BTreeSet;
use std::ops::Range;

use glam::{DQuat, DVec3};

use super::distribution::{AngularVelocity, Orientation, Scalar, Vector};
use super::draw::{Column, Draw};
use super::inertia::Inertia;
use super::reader::{Node, Table};
use super::solid::SolidFault;
use super::sweep::Design;
use super::table::{ANGULAR_VELOCITY, BodyTable, INERTIA, MASS, NAME, ORIENTATION, POSITION, VELOCITY};
use crate::bodies::Ensemble;
use crate::bodies::ensemble::Translation;
use crate::bodies::inertia::InertiaTensor;
use crate::bodies::state_columns;
use crate::error::{Error, Result};
use crate::math::parallel;

/// A tensor that must change by more than a tenth is wrong rather than imprecise.
const MOST_REPAIR: f64 = 0.1;

/// The bodies of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Bodies {
    /// Number of bodies in all cells together.
    pub count: usize,
    /// Number of cells in the study's design: body b of the whole study lies in cell b modulo this, and has row b / cells of its table.
    pub cells: usize,
    /// Number of bodies of the table's first row that lie before the first body: above zero only in a part that begins within a row.
    first_in_row: usize,
    /// Rows read from a file, with priority over distributions for the columns that it has.
    pub table: Option<BodyTable>,
    /// Inertia tensors, if the table has none.
    pub inertia: Option<Inertia>,
    /// The greatest relative change by which a tensor that breaks the triangle inequality is repaired; `None` repairs nothing.
    pub repair_triangle_inequality: Option<f64>,
    /// Orientations, if the table has none.
    pub orientation: Orientation,
    /// Angular velocities in body axes, rad/s, if the table has none.
    pub angular_velocity: Option<AngularVelocity>,
    /// Masses, kg, if neither table nor shape has them.
    pub mass: Option<Scalar>,
    /// Positions at t = 0 in world axes, m, if the table has none.
    pub position: Option<Vector>,
    /// Velocities at t = 0 in world axes, m/s, if the table has none.
    pub velocity: Option<Vector>,
}

impl Bodies {
    /// Reads the table `[bodies]`; `open` reads the table of bodies with the given name and text columns to be carried through.
    pub(super) fn read(
        node: &Node<'_>,
        is_initial_wanted: bool,
        open: impl FnOnce(&str, &BTreeSet<String>) -> Result<BodyTable>,
    ) -> Result<Self> {
        let known = &[
            "count",
            "file",
            "carry",
            "inertia",
            "repair_triangle_inequality",
            "orientation",
            "angular_velocity",
            "mass",
            "position",
            "velocity",
        ];
        let table = node.table("expected a table [bodies]", known)?;
        table.exclusive("file", "count")?;
        let body_table = match table.find("file") {
            Some(file) => {
                Some(open(file.string("expected the name of a CSV file")?, &carried(&table, is_initial_wanted)?)?)
            }
            None => None,
        };
        if let (None, Some(carry)) = (&body_table, table.find("carry")) {
            return Err(
                carry.refuse("a study without a table of bodies has no columns to carry: expected `file` beside it")
            );
        }
        let cells = node.context().design().map_or(1, Design::cells);
        let (count, counted) = match (&body_table, table.find("file")) {
            (Some(rows), Some(file)) => (rows.len(), file),
            _ => {
                let count = table.need("count", "expected the number of bodies (or `file`, a table of bodies)")?;
                const EXPECTED: &str = "expected a whole number of bodies";
                (usize::try_from(count.whole(EXPECTED)?).map_err(|_| count.refuse(EXPECTED))?, count)
            }
        };
        let count = count
            .checked_mul(cells)
            .ok_or_else(|| counted.refuse("expected fewer bodies: each cell of the design has as many"))?;
        if u32::try_from(count).is_err() {
            return Err(counted.refuse("expected up to 4294967295 bodies in all cells: they are counted in 32 bits"));
        }
        // Each column has only one source.
        let given = |key: &str, column: usize| match (table.find(key), &body_table) {
            (Some(node), Some(rows)) if rows.has(column) => {
                Err(node.refuse("the table of bodies has these columns already: leave them out of one of the two"))
            }
            (node, _) => Ok(node),
        };
        let inertia = given("inertia", INERTIA)?.map(|node| Inertia::read(&node)).transpose()?;
        const LARGEST_CHANGE: &str = "expected the greatest relative change of a tensor, above 0 and up to 0.1";
        let repair_triangle_inequality = match table.find("repair_triangle_inequality") {
            Some(node) => {
                let limit = node.positive_quantity("1", LARGEST_CHANGE)?;
                if limit > MOST_REPAIR {
                    return Err(node.refuse(LARGEST_CHANGE));
                }
                Some(limit)
            }
            None => None,
        };
        let orientation = match given("orientation", ORIENTATION)? {
            Some(node) => Orientation::read(&node)?,
            None => Orientation::Constant(DQuat::IDENTITY),
        };
        let vector = |key: &str, unit: &str, column: usize| {
            given(key, column)?.map(|node| Vector::read(&node, unit)).transpose()
        };
        let angular_velocity = given("angular_velocity", ANGULAR_VELOCITY)?;
        let angular_velocity = angular_velocity.map(|node| AngularVelocity::read(&node)).transpose()?;
        let position = vector("position", "m", POSITION)?;
        let velocity = vector("velocity", "m/s", VELOCITY)?;
        let mass = given("mass", MASS)?;
        if let (Some(Inertia::Solid { .. }), Some(mass)) = (&inertia, &mass) {
            return Err(mass.refuse("the shape has the mass: leave it out here"));
        }
        if let (Some(Inertia::Solid { .. }), Some(shape)) = (&inertia, table.find("inertia"))
            && body_table.as_ref().is_some_and(|table| table.has(MASS))
        {
            const TWO_MASSES: &str = "the table of bodies has the mass (column mass), and so has the shape: expected \
                                      moments or a tensor here, or a table without that column";
            return Err(shape.refuse(TWO_MASSES));
        }
        let mass = mass.map(|node| Scalar::read(&node, "kg")).transpose()?;

        let has = |column: usize| body_table.as_ref().is_some_and(|table| table.has(column));
        if inertia.is_none() && !has(INERTIA) {
            table.need("inertia", "expected a shape, moments or a tensor (kg m²)")?;
        }
        if angular_velocity.is_none() && !has(ANGULAR_VELOCITY) {
            table.need("angular_velocity", "expected a vector in body axes, or a distribution (rad/s)")?;
        }
        Ok(Self {
            count,
            cells,
            first_in_row: 0,
            table: body_table,
            inertia,
            repair_triangle_inequality,
            orientation,
            angular_velocity,
            mass,
            position,
            velocity,
        })
    }

    /// The bodies of a range; each is the same as in the whole.
    pub(super) fn part(mut self, bodies: &Range<usize>) -> Self {
        let (start, end) = (self.first_in_row + bodies.start, self.first_in_row + bodies.end);
        let rows = start / self.cells..end.div_ceil(self.cells);
        self.count = bodies.len();
        self.table = self.table.map(|table| table.part(&rows));
        self.first_in_row = start % self.cells;
        self
    }

    /// Whether the bodies move through space, with or without a force.
    pub(super) fn translates(&self) -> bool {
        let in_table = self.table.as_ref().is_some_and(|table| table.has(POSITION) || table.has(VELOCITY));
        in_table || self.position.is_some() || self.velocity.is_some()
    }

    /// The row of the table of bodies for a body; both are counted from the first of this part.
    pub(crate) fn row(&self, body: usize) -> usize {
        (self.first_in_row + body) / self.cells
    }

    /// The ensemble; `forced` says whether a force acts, which requires masses.
    pub(super) fn ensemble(&self, draw: Draw, forced: bool) -> Result<Ensemble> {
        let rows = |column: usize| self.table.as_ref().filter(|table| table.has(column));
        let inertia_rows = rows(INERTIA);
        let orientation_rows = rows(ORIENTATION);
        let angular_velocity_rows = rows(ANGULAR_VELOCITY);
        let row = |body| {
            let inertia = match (inertia_rows, &self.inertia) {
                (Some(table), _) => table.inertia(self.row(body)),
                (None, Some(inertia)) => inertia.sample(draw, body),
                (None, None) => InertiaTensor::default(),
            };
            let orientation = match orientation_rows {
                Some(table) => table.orientation(self.row(body)),
                None => self.orientation.sample(draw, body),
            };
            let angular_velocity = match (angular_velocity_rows, &self.angular_velocity) {
                (Some(table), _) => table.angular_velocity(self.row(body)),
                (None, Some(angular_velocity)) => angular_velocity.sample(draw, body, &inertia),
                (None, None) => DVec3::ZERO,
            };
            (inertia, orientation, angular_velocity)
        };
        let ensemble = match self.repair_triangle_inequality {
            Some(limit) => Ensemble::from_fn_repaired(self.count, limit, row),
            None => Ensemble::from_fn(self.count, row),
        };
        let ensemble = ensemble.map_err(|error| self.reason(error, draw))?;
        if !(forced || self.translates()) {
            return Ok(ensemble);
        }
        ensemble.with_translation(self.translation(draw, forced)?)
    }

    /// The error of a body, with the cause if that lies in the description of its matter.
    fn reason(&self, error: Error, draw: Draw) -> Error {
        let Error::Body { body, .. } = error else { return error };
        match self.fault_of(draw, body).map(|fault| *fault.error) {
            Some(Error::Setting { field, value, expected } | Error::Item { field, value, expected, .. }) => {
                Error::Body { body, field, value, expected }
            }
            Some(Error::Inertia(defect)) => defect.of_body(body),
            _ => error,
        }
    }

    /// Why the matter described for a body is not valid.
    fn fault_of(&self, draw: Draw, body: usize) -> Option<SolidFault> {
        match &self.inertia {
            Some(Inertia::Solid { solid, .. }) => solid.sample_or_fault(draw, body).err(),
            _ => None,
        }
    }

    /// Index of the part that makes a body invalid.
    pub(super) fn faulty_part(&self, draw: Draw, body: usize) -> Option<usize> {
        self.fault_of(draw, body)?.part
    }

    fn translation(&self, draw: Draw, forced: bool) -> Result<Translation> {
        let rows = |column: usize| self.table.as_ref().filter(|table| table.has(column));
        let mass: Vec<f64> = match (rows(MASS), &self.mass, &self.inertia) {
            (Some(table), _, _) => (0..self.count).map(|body| table.mass(self.row(body))).collect(),
            (None, Some(mass), _) => parallel::rows(self.count, 1, &|body| mass.sample(draw, body, Column::Mass, 0)),
            (None, None, Some(Inertia::Solid { solid, .. })) => {
                let mass = |body| solid.sample(draw, body).map_or(f64::NAN, |properties| properties.mass);
                parallel::rows(self.count, 1, &mass)
            }
            (None, None, _) if forced => return Err(Error::MissingMass),
            // Without a force the mass does not affect the motion.
            (None, None, _) => vec![1.0; self.count],
        };
        let column = |first: usize, vector: &Option<Vector>, column: Column| {
            let table = rows(first);
            let of_body = |body| match (table, vector) {
                (Some(table), _) => table.vector(self.row(body), first),
                (None, Some(vector)) => vector.sample(draw, body, column),
                (None, None) => DVec3::ZERO,
            };
            parallel::rows(self.count, 1, &of_body)
        };
        Ok(Translation {
            mass,
            position: column(POSITION, &self.position, Column::Position),
            velocity: column(VELOCITY, &self.velocity, Column::Velocity),
        })
    }
}

/// The columns of the table of bodies that are carried through unchanged: `name`, and those of `carry`.
fn carried(table: &Table<'_>, is_initial_wanted: bool) -> Result<BTreeSet<String>> {
    const EXPECTED: &str = "expected a list of names of columns of the table of bodies";
    let mut names = BTreeSet::new();
    if is_initial_wanted {
        names.insert(NAME.to_owned());
    }
    if let Some(node) = table.find("carry") {
        if !is_initial_wanted {
            return Err(
                node.refuse("columns are carried to the table of initial states: expected output.initial = true")
            );
        }
        let elements = node.elements().ok_or_else(|| node.refuse(EXPECTED))?;
        let mut own = BTreeSet::new();
        for element in elements {
            let name = element.string(EXPECTED)?;
            if !own.insert(name) {
                return Err(element.refuse("expected each column once"));
            }
            names.insert(name.to_owned());
        }
    }
    Ok(names)
}

/// Refuses a carried column with the name of another column of the table of initial states.
pub(super) fn check_carried(node: &Node<'_>, translates: bool) -> Result<()> {
    let is_swept = node.context().design().is_some();
    let is_taken = |name: &str| {
        let is_parameter = ["torque[", "force["].iter().any(|start| name.starts_with(start));
        is_parameter || state_columns::of_initial(translates, is_swept).any(|column| column == name)
    };
    let carry = node.any_table().and_then(|table| table.find("carry"));
    for element in carry.and_then(|carry| carry.elements()).unwrap_or_default() {
        if element.string("expected the name of a column").is_ok_and(is_taken) {
            const TAKEN: &str =
                "expected another column: the table of initial states has one of this name, computed for each body";
            return Err(element.refuse(TAKEN));
        }
    }
    Ok(())
}
