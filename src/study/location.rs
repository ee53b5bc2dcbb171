//! Finds the place in a study's files that caused an error.

use super::Study;
use super::table::{ANGULAR_VELOCITY, INERTIA, MASS, ORIENTATION, POSITION, VELOCITY};
use crate::error::{Error, InputError, InputFault, Text};
use crate::scene::{StatisticalAccuracy, Target};

impl Study {
    /// `error` with the file and line that caused it, if there is one.
    #[must_use]
    pub fn located(&self, error: Error) -> Error {
        match error {
            Error::Setting { field, expected, .. } => {
                let key = match field {
                    "dt" => "accuracy.dt",
                    "tolerance" => "accuracy.tolerance",
                    "least_step" => "accuracy.least_step",
                    other => other,
                };
                self.refused(key, expected, error)
            }
            Error::AccuracyOutOfReach { ref target, missed, .. } => {
                self.located_target(target.of(missed), missed, error)
            }
            Error::StatisticsOutOfReach { field, .. } => {
                let places = [field, "accuracy"].into_iter().find_map(|key| self.places.get(key));
                let line = places.map_or(1, |place| place.line);
                let value = self.places.get(field).map(|place| place.value.clone());
                let value =
                    value.unwrap_or_else(|| format!("{:e} (where nothing is said)", StatisticalAccuracy::DEFAULT));
                self.input(line, field, InputFault::Cause { value, cause: Box::new(error) })
            }
            Error::PlanningTime { .. } | Error::RunTime { .. } => self.caused("time.end", error),
            Error::MethodUnavailable { ref expected, .. } => self.refused("accuracy.method", expected.clone(), error),
            Error::Projection { expected, .. } => self.refused("accuracy.projection", expected, error),
            Error::StoppedCentre { event, .. } => self.caused(&format!("event[{}].action", event + 1), error),
            Error::MissingMass => match self.places.get("force") {
                Some(place) => {
                    let expected = "the force needs masses, here or as a column of the table of bodies (kg)";
                    self.input(place.line, "bodies.mass", InputFault::Missing { expected: expected.into() })
                }
                None => Error::MissingMass,
            },
            Error::TooManyBodies { .. } => self.caused("bodies.count", error),
            Error::Body { body, field, value, expected } => self.located_body(body, field, value, expected),
            Error::Torque { torque, body, ref field, value, ref expected, .. } => {
                let body = body.map(|body| self.part.first_body + body);
                let Some(own) = self.torques.get(torque) else { return error };
                let key = own.key(field);
                // A key may be omitted: then the torque's own line is named.
                match self.places.get(&key).or_else(|| self.places.get(own.path())) {
                    Some(place) => self.input(place.line, &key, parameter_fault(body, field, value, expected)),
                    None => error,
                }
            }
            Error::Force { force, body, ref field, value, ref expected, .. } => {
                let body = body.map(|body| self.part.first_body + body);
                let keys = self.forces.get(force).map(|force| force.keys(field)).unwrap_or_default();
                match keys.iter().find_map(|key| self.places.get_key_value(key)) {
                    Some((key, place)) => self.input(place.line, key, parameter_fault(body, field, value, expected)),
                    None => error,
                }
            }
            other => other,
        }
    }

    /// `error` at a key, if the study has that.
    fn caused(&self, key: &str, error: Error) -> Error {
        let Some(place) = self.places.get(key) else { return error };
        self.input(place.line, key, InputFault::Cause { value: place.value.clone(), cause: Box::new(error) })
    }

    /// The value at a key refused; `error` if the study does not have it.
    fn refused(&self, key: &str, expected: impl Into<Text>, error: Error) -> Error {
        let Some(place) = self.places.get(key) else { return error };
        self.input(place.line, key, InputFault::Value { value: place.value.clone(), expected: expected.into() })
    }

    /// Adds the line of the target that is missed; if the study omits it, that of the table to which it belongs.
    fn located_target(&self, wanted: f64, missed: Target, error: Error) -> Error {
        let key = match missed {
            Target::Attitude => "accuracy.attitude",
            Target::AngularVelocity => "accuracy.angular_velocity",
            Target::Energy => "accuracy.energy",
        };
        let (line, value) = match (self.places.get(key), self.places.get("accuracy")) {
            (Some(place), _) => (place.line, place.value.clone()),
            (None, table) => {
                let asks =
                    |key: &str| ["event", "histogram", "output.statistics"].iter().any(|asked| key.starts_with(asked));
                let instead = match self.places.keys().any(|key| asks(key)) {
                    true => {
                        ", as final states are written; final = false in [output] asks for statistics and event times"
                    }
                    false => "",
                };
                let value = format!("{wanted:e} (where nothing is said{instead})");
                (table.map_or(1, |place| place.line), value)
            }
        };
        self.input(line, key, InputFault::Cause { value, cause: Box::new(error) })
    }

    fn located_body(&self, body: usize, field: &'static str, value: f64, expected: &'static str) -> Error {
        let (key, column) = match field {
            "mass" => ("mass", MASS),
            "x" => ("position", POSITION),
            "vx" => ("velocity", VELOCITY),
            "wx" | "wy" | "wz" | "rate" | "angular velocity along the axis" => ("angular_velocity", ANGULAR_VELOCITY),
            _ if field.starts_with('q') || field.starts_with("orientation") => ("orientation", ORIENTATION),
            _ => ("inertia", INERTIA),
        };
        let error = Error::Body { body, field, value, expected };
        if let Some(table) = self.bodies.table.as_ref().filter(|table| table.has(column)) {
            return table.located(error, self.bodies.row(body));
        }
        // A shape's sizes, and its mass, are given within `inertia`.
        let part = self.bodies.faulty_part(self.draw(), body);
        let part = part.map_or(String::new(), |index| format!(".parts[{}]", index + 1));
        let own = (key != "inertia").then(|| format!("bodies.{key}"));
        let keys: Vec<String> = [format!("bodies.inertia{part}.{field}")]
            .into_iter()
            .chain(own)
            .chain([format!("bodies.inertia{part}"), "bodies.inertia".to_owned()])
            .collect();
        let key = keys.iter().find(|key| self.places.contains_key(*key)).map_or("bodies", String::as_str);
        match self.places.get(key) {
            Some(place) => self.input(
                place.line,
                key,
                InputFault::Body {
                    body: self.part.first_body + body,
                    field: field.into(),
                    value,
                    expected: expected.into(),
                },
            ),
            None => error,
        }
    }

    /// A fault at a key in the study's own file.
    fn input(&self, line: usize, key: &str, fault: InputFault) -> Error {
        InputError { file: self.file.clone(), line, key: key.to_owned(), fault }.into()
    }
}

/// The fault of a parameter's value, shared by all bodies or belonging to one.
fn parameter_fault(body: Option<usize>, field: &Text, value: f64, expected: &Text) -> InputFault {
    let expected = expected.clone();
    match body {
        Some(body) => InputFault::Body { body, field: field.clone(), value, expected },
        None => InputFault::Value { value: format!("{value:?}"), expected },
    }
}
