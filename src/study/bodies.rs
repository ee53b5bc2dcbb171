//! The bodies of a study: drawn from distributions, read from a table, or both.

use std::ops::Range;

use glam::{DQuat, DVec3};
use rayon::prelude::*;

use super::distribution::{Orientation, Scalar, Vector};
use super::draw::{Column, Draw};
use super::inertia::Inertia;
use super::reader::Node;
use super::solid::SolidFault;
use super::table::BodyTable;
use crate::bodies::Ensemble;
use crate::bodies::ensemble::Translation;
use crate::bodies::inertia::InertiaTensor;
use crate::error::{Error, Result};

/// A tensor that is wrong by more than a tenth is wrong rather than measured imprecisely.
const MOST_REPAIR: f64 = 0.1;

/// The bodies of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Bodies {
    /// How many.
    pub count: usize,
    /// Rows read from a file; a column that it has is taken from it.
    pub table: Option<BodyTable>,
    /// Inertia tensors, where the table has none.
    pub inertia: Option<Inertia>,
    /// The greatest relative change by which a tensor that breaks the triangle inequality is repaired; none is without it.
    pub repair_triangle_inequality: Option<f64>,
    /// Orientations, where the table has none.
    pub orientation: Orientation,
    /// Angular velocities in body axes, rad/s, where the table has none.
    pub angular_velocity: Option<Vector>,
    /// Masses, kg, where neither table nor shape has them.
    pub mass: Option<Scalar>,
    /// Positions at t = 0 in world axes, m, where the table has none.
    pub position: Option<Vector>,
    /// Velocities at t = 0 in world axes, m/s, where the table has none.
    pub velocity: Option<Vector>,
}

impl Bodies {
    /// Reads the table `[bodies]`; `open` reads the table of bodies of that name.
    pub(super) fn read(node: &Node<'_>, open: impl FnOnce(&Node<'_>, &str) -> Result<BodyTable>) -> Result<Self> {
        let known = &[
            "count",
            "file",
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
            Some(file) => Some(open(&file, file.string("expected the name of a CSV file")?)?),
            None => None,
        };
        let count = match &body_table {
            Some(rows) => rows.len(),
            None => {
                let count = table.need("count", "expected the number of bodies (or `file`, a table of bodies)")?;
                const EXPECTED: &str = "expected a whole number of bodies";
                usize::try_from(count.whole(EXPECTED)?).map_err(|_| count.refuse(EXPECTED))?
            }
        };
        // A column comes from one place only.
        let given = |key: &str, in_table: fn(&BodyTable) -> bool| match (table.find(key), &body_table) {
            (Some(node), Some(rows)) if in_table(rows) => {
                Err(node.refuse("the table of bodies has these columns already: leave them out of one of the two"))
            }
            (node, _) => Ok(node),
        };
        let inertia = given("inertia", BodyTable::has_inertia)?.map(|node| Inertia::read(&node)).transpose()?;
        const LARGEST_CHANGE: &str = "expected the greatest relative change of a tensor, above 0 and up to 0.1";
        let repair_triangle_inequality = match table.find("repair_triangle_inequality") {
            Some(node) => {
                let limit = node.positive(LARGEST_CHANGE)?;
                if limit > MOST_REPAIR {
                    return Err(node.refuse(LARGEST_CHANGE));
                }
                Some(limit)
            }
            None => None,
        };
        let orientation = match given("orientation", BodyTable::has_orientation)? {
            Some(node) => Orientation::read(&node)?,
            None => Orientation::Constant(DQuat::IDENTITY),
        };
        let vector = |key: &str, in_table: fn(&BodyTable) -> bool| {
            given(key, in_table)?.map(|node| Vector::read(&node)).transpose()
        };
        let angular_velocity = vector("angular_velocity", BodyTable::has_angular_velocity)?;
        let position = vector("position", BodyTable::has_position)?;
        let velocity = vector("velocity", BodyTable::has_velocity)?;
        let mass = given("mass", BodyTable::has_mass)?;
        if let (Some(Inertia::Solid(_)), Some(mass)) = (&inertia, &mass) {
            return Err(mass.refuse("the shape has the mass: leave it out here"));
        }
        let mass = mass.map(|node| Scalar::read(&node)).transpose()?;

        let has = |in_table: fn(&BodyTable) -> bool| body_table.as_ref().is_some_and(in_table);
        if inertia.is_none() && !has(BodyTable::has_inertia) {
            table.need("inertia", "expected a shape, moments or a tensor (kg m²)")?;
        }
        if angular_velocity.is_none() && !has(BodyTable::has_angular_velocity) {
            table.need("angular_velocity", "expected a vector in body axes, or a distribution (rad/s)")?;
        }
        Ok(Self {
            count,
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

    /// Some of the bodies, which lie in their range: the same bodies, fewer of them.
    pub(super) fn part(mut self, bodies: &Range<usize>) -> Self {
        self.count = bodies.len();
        self.table = self.table.map(|table| table.part(bodies));
        self
    }

    /// Whether the bodies move through space, with or without a force.
    fn translates(&self) -> bool {
        let in_table = self.table.as_ref().is_some_and(|table| table.has_position() || table.has_velocity());
        in_table || self.position.is_some() || self.velocity.is_some()
    }

    /// The ensemble; `forced` says whether a force acts, so that masses are needed.
    pub(super) fn ensemble(&self, draw: Draw, forced: bool) -> Result<Ensemble> {
        let rows = |has: fn(&BodyTable) -> bool| self.table.as_ref().filter(|table| has(table));
        let inertia_rows = rows(BodyTable::has_inertia);
        let orientation_rows = rows(BodyTable::has_orientation);
        let angular_velocity_rows = rows(BodyTable::has_angular_velocity);
        let row = |body| {
            let inertia = match (inertia_rows, &self.inertia) {
                (Some(table), _) => table.inertia(body),
                (None, Some(inertia)) => inertia.sample(draw, body),
                (None, None) => InertiaTensor::default(),
            };
            let orientation = match orientation_rows {
                Some(table) => table.orientation(body),
                None => self.orientation.sample(draw, body),
            };
            (
                inertia,
                orientation,
                sampled(
                    angular_velocity_rows,
                    BodyTable::angular_velocity,
                    &self.angular_velocity,
                    draw,
                    body,
                    Column::AngularVelocity,
                ),
            )
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

    /// The error of a body with what made it invalid, where that lies in the description of its matter.
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

    /// Why the matter that is described for a body makes none.
    fn fault_of(&self, draw: Draw, body: usize) -> Option<SolidFault> {
        match &self.inertia {
            Some(Inertia::Solid(solid)) => solid.sample_or_fault(draw, body).err(),
            _ => None,
        }
    }

    /// Index of the part that makes a body invalid.
    pub(super) fn faulty_part(&self, draw: Draw, body: usize) -> Option<usize> {
        self.fault_of(draw, body)?.part
    }

    fn translation(&self, draw: Draw, forced: bool) -> Result<Translation> {
        let rows = |has: fn(&BodyTable) -> bool| self.table.as_ref().filter(|table| has(table));
        let mass: Vec<f64> = match (rows(BodyTable::has_mass), &self.mass, &self.inertia) {
            (Some(table), _, _) => (0..self.count).map(|body| table.mass(body)).collect(),
            (None, Some(mass), _) => {
                (0..self.count).into_par_iter().map(|body| mass.sample(draw, body, Column::Mass, 0)).collect()
            }
            (None, None, Some(Inertia::Solid(solid))) => {
                let mass = |body| solid.sample(draw, body).map_or(f64::NAN, |properties| properties.mass);
                (0..self.count).into_par_iter().map(mass).collect()
            }
            (None, None, _) if forced => return Err(Error::MissingMass),
            // Without a force the mass does not enter the motion.
            (None, None, _) => vec![1.0; self.count],
        };
        let column = |has: fn(&BodyTable) -> bool,
                      of_row: fn(&BodyTable, usize) -> DVec3,
                      vector: &Option<Vector>,
                      column: Column| {
            let table = rows(has);
            (0..self.count).into_par_iter().map(|body| sampled(table, of_row, vector, draw, body, column)).collect()
        };
        Ok(Translation {
            mass,
            position: column(BodyTable::has_position, BodyTable::position, &self.position, Column::Position),
            velocity: column(BodyTable::has_velocity, BodyTable::velocity, &self.velocity, Column::Velocity),
        })
    }
}

/// A vector of a body from the table, else from its distribution, else zero.
fn sampled(
    table: Option<&BodyTable>,
    of_row: fn(&BodyTable, usize) -> DVec3,
    vector: &Option<Vector>,
    draw: Draw,
    body: usize,
    column: Column,
) -> DVec3 {
    match (table, vector) {
        (Some(table), _) => of_row(table, body),
        (None, Some(vector)) => vector.sample(draw, body, column),
        (None, None) => DVec3::ZERO,
    }
}
