//! `model = "variable-inertia"` of `[[torque]]` in study files.

use std::collections::BTreeSet;

use rayon::prelude::*;

use super::inertia::Inertia;
use super::parameter::{Number, Source, Triple};
use super::reader::Table;
use crate::error::Result;
use crate::inertia::InertiaTensor;
use crate::torque::variable_inertia::{InertiaChange, Law};
use crate::torque::{Parameter, Torque};

/// A change of moments of inertia: parameters not yet drawn.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct StudyInertia {
    change: Change,
    law: StudyLaw,
}

#[derive(Clone, Debug, PartialEq)]
enum Change {
    Factor(Number),
    /// Moments along the body axes.
    Moments(Triple),
    Inertia(Inertia),
}

#[derive(Clone, Debug, PartialEq)]
enum StudyLaw {
    Ramp { start: Number, duration: Number },
    Oscillation { rate: Number },
}

impl StudyInertia {
    pub(super) fn read(table: &Table<'_>) -> Result<Self> {
        table.only(&["model", "factor", "inertia", "ramp", "oscillation"])?;
        table.exclusive("factor", "inertia")?;
        table.exclusive("ramp", "oscillation")?;
        let change = match table.find("factor") {
            Some(factor) => Change::Factor(Number::read(&factor)?),
            None => {
                let node =
                    table.need("inertia", "`inertia` after the change, or a `factor` of the body's own, is needed")?;
                let of_columns = node.any_table().is_some_and(|table| table.find("columns").is_some());
                if of_columns {
                    Change::Moments(Triple::read(&node)?)
                } else {
                    match Inertia::read(&node)? {
                        Inertia::Moments(moments) => Change::Moments(Triple::Drawn(moments)),
                        inertia => Change::Inertia(inertia),
                    }
                }
            }
        };
        let law = match table.find("oscillation") {
            Some(node) => {
                const RATE: &str = "{ rate = rad/s } is needed";
                let oscillation = node.table(RATE, &["rate"])?;
                StudyLaw::Oscillation { rate: Number::read(&oscillation.need("rate", RATE)?)? }
            }
            None => {
                const RAMP: &str = "{ start = seconds, duration = seconds } is needed";
                let node = table.need("ramp", "`ramp` or `oscillation` is needed")?;
                let ramp = node.table(RAMP, &["start", "duration"])?;
                let number = |key: &str| ramp.need(key, RAMP).and_then(|node| Number::read(&node));
                StudyLaw::Ramp { start: number("start")?, duration: number("duration")? }
            }
        };
        Ok(Self { change, law })
    }

    /// Adds the names of the columns of the table of bodies that are read.
    pub(super) fn columns(&self, names: &mut BTreeSet<String>) {
        match &self.change {
            Change::Factor(factor) => factor.columns(names),
            Change::Moments(moments) => moments.columns(names),
            Change::Inertia(_) => {}
        }
        match &self.law {
            StudyLaw::Ramp { start, duration } => {
                [start, duration].into_iter().for_each(|number| number.columns(names))
            }
            StudyLaw::Oscillation { rate } => rate.columns(names),
        }
    }

    /// The change, its parameters drawn. What is described as a body's own inertia is, with the same draws, comes from the
    /// same numbers, so that a body that is large before is large after.
    pub(super) fn torque(&self, source: &Source<'_>) -> Torque {
        let change = match &self.change {
            Change::Factor(factor) => InertiaChange::Factor(source.number(factor, 0)),
            Change::Moments(moments) => InertiaChange::Tensor(match source.vector(moments, 0) {
                Parameter::Shared(moments) => Parameter::Shared(moments.into()),
                Parameter::PerBody(column) => {
                    Parameter::PerBody(column.iter().map(|&moments| InertiaTensor::from(moments)).collect())
                }
            }),
            Change::Inertia(Inertia::Tensor(tensor)) => InertiaChange::Tensor(Parameter::Shared(*tensor)),
            Change::Inertia(inertia) => {
                let bodies = (0..source.count).into_par_iter();
                let tensors = bodies.map(|body| inertia.sample(source.draw, body)).collect();
                InertiaChange::Tensor(Parameter::PerBody(tensors))
            }
        };
        let law = match &self.law {
            StudyLaw::Ramp { start, duration } => Law::ramp(source.number(start, 1), source.number(duration, 2)),
            StudyLaw::Oscillation { rate } => Law::oscillation(source.number(rate, 3)),
        };
        Torque::variable_inertia(change, law)
    }

    /// The key in the file of a parameter that turned out not to be valid.
    pub(super) fn key(&self, field: &str) -> String {
        match field {
            "start" | "duration" => format!("ramp.{field}"),
            "rate" => "oscillation.rate".to_owned(),
            other => other.to_owned(),
        }
    }
}
