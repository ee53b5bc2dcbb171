//! Torques by the names of their models and parameters, for programs that handle both as data.

use super::declaration::in_brackets;
use super::registry::MODELS;
use super::{Declaration, ModelRef, ParameterDeclaration, Preset, Shape, Text, Torque, ValidationContext, Value};
use crate::error::{Error, Result};
use crate::torque::declarations;

/// A parameter given by name.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Argument {
    /// A value of any shape except a list.
    Value(Value),
    /// A list: the parameters of each of its tables.
    Tables(Vec<Vec<(String, Argument)>>),
}

impl Torque {
    /// A torque of the model `model` (a name of [`declarations`]) with parameters by their declared names or other keys. Omitted
    /// parameters have their defaults; the seed of a random torque is then 0.
    ///
    /// Values are checked when a plan is made, like those of all torques.
    ///
    /// ```
    /// use polhode::Torque;
    /// use polhode::torque::{Argument, Value};
    ///
    /// let argument = |number: f64| Argument::Value(Value::Number(number.into()));
    /// let given = vec![("mu".to_owned(), argument(3.986e14)), ("orbit.radius".to_owned(), argument(7.0e6))];
    /// let gradient = Torque::named("gravity-gradient", given)?;
    /// assert_eq!(gradient.parameter("orbit.inclination").and_then(|value| value.as_number()), Some(&0.0.into()));
    ///
    /// let refused = Torque::named("linear-drag", vec![("coeficient".to_owned(), argument(0.1))]);
    /// assert_eq!(refused.unwrap_err().to_string(), "linear-drag: coeficient: expected coefficient");
    /// # Ok::<(), polhode::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::UnknownModel`]; [`Error::TorqueParameter`] for a name that the model does not have, one that is missing, one of
    /// another shape, and several that exclude each other.
    pub fn named(model: &str, given: Vec<(String, Argument)>) -> Result<Self> {
        let named = MODELS.iter().find(|known| known.declaration().names().any(|name| name == model));
        let Some(&found) = named else {
            let known: Vec<&str> = declarations().map(|declaration| &*declaration.name).collect();
            return Err(Error::UnknownModel { name: model.to_owned(), expected: known.join(", ") });
        };
        let declaration = found.declaration();
        let values = Arranging { declaration, place: String::new() }.values(&declaration.parameters, given)?;
        let context = ValidationContext { torque: 0, model: declaration.name.clone(), body_count: 0 };
        match found.made_for(&values, &context) {
            // The torque's index in a scene is not known here.
            Some(made) => made.map_err(|error| match error {
                Error::Torque { model, field, value, expected, .. } => {
                    Error::TorqueParameter { model, field: format!("{field} = {value}").into(), expected }
                }
                other => other,
            }),
            None => Ok(Torque::of_model(ModelRef::Built(found), values)),
        }
    }
}

/// Arranges parameters in the order of their declarations.
struct Arranging<'a> {
    declaration: &'a Declaration,
    /// The prefix of names in messages: the table of a list.
    place: String,
}

impl Arranging<'_> {
    fn values(&self, declared: &[ParameterDeclaration], mut given: Vec<(String, Argument)>) -> Result<Vec<Value>> {
        self.check_names(declared, &given)?;
        let chosen = self.check_choices(declared, &given)?;
        let mut take = |name: &str| {
            let place = given.iter().position(|(given, _)| given == name);
            place.map(|place| given.swap_remove(place).1)
        };
        let value = |parameter: &ParameterDeclaration| {
            let other = parameter.other_key.as_ref().and_then(|other| take(&other.name));
            match other.or_else(|| take(&parameter.name)) {
                Some(argument) => self.value(parameter, argument),
                None if parameter.choice.is_some() && !chosen.contains(&parameter.alternative()) => Ok(Value::Absent),
                None => parameter.default.map(|preset| of_preset(parameter.shape, preset)).ok_or_else(|| {
                    let other = parameter.other_key.as_ref().map(|other| format!(" (or {})", other.name));
                    self.refusal(&parameter.name, needed(parameter) + &other.unwrap_or_default())
                }),
            }
        };
        declared.iter().map(value).collect()
    }

    /// Refuses names that are not declared or given twice, and those that exclude each other.
    fn check_names(&self, declared: &[ParameterDeclaration], given: &[(String, Argument)]) -> Result<()> {
        let others = || declared.iter().filter_map(|parameter| Some((parameter, parameter.other_key.as_ref()?)));
        for (index, (name, _)) in given.iter().enumerate() {
            let is_known = declared.iter().any(|parameter| parameter.name == *name)
                || others().any(|(_, other)| other.name == *name);
            if !is_known {
                let names = declared.iter().map(|parameter| &parameter.name);
                let names: Vec<&str> = names.chain(others().map(|(_, other)| &other.name)).map(Text::as_ref).collect();
                return Err(self.refusal(name, format!("expected {}", names.join(", "))));
            }
            if given[..index].iter().any(|(earlier, _)| earlier == name) {
                return Err(self.refusal(name, "expected once"));
            }
        }
        let is_given = |name: &Text| given.iter().any(|(given, _)| given == name);
        for (parameter, other) in others().filter(|(_, other)| is_given(&other.name)) {
            let excluded = std::iter::once(&parameter.name).chain(&other.excludes).find(|name| is_given(name));
            if let Some(excluded) = excluded {
                return Err(self.refusal(excluded, format!("{} excludes it: give one of them", other.name)));
            }
        }
        Ok(())
    }

    /// For each choice, the alternative that is given.
    fn check_choices<'d>(
        &self,
        declared: &'d [ParameterDeclaration],
        given: &[(String, Argument)],
    ) -> Result<Vec<&'d str>> {
        let mut chosen = Vec::new();
        let mut choices: Vec<&Text> = declared.iter().filter_map(|parameter| parameter.choice.as_ref()).collect();
        choices.dedup();
        for choice in choices {
            let members = declared.iter().filter(|parameter| parameter.choice.as_ref() == Some(choice));
            let is_given = |member: &&ParameterDeclaration| given.iter().any(|(name, _)| *name == member.name);
            let mut alternatives: Vec<&str> = members.clone().filter(is_given).map(|one| one.alternative()).collect();
            alternatives.dedup();
            match alternatives[..] {
                [one] => chosen.push(one),
                [one, other, ..] => {
                    return Err(self.refusal(other, format!("{one} excludes it: give one of them")));
                }
                [] => {
                    let mut all: Vec<&str> = members.map(ParameterDeclaration::alternative).collect();
                    all.dedup();
                    return Err(self.refusal(all[0], format!("expected {}", all.join(" or "))));
                }
            }
        }
        Ok(chosen)
    }

    fn value(&self, parameter: &ParameterDeclaration, argument: Argument) -> Result<Value> {
        match (parameter.shape, argument) {
            (Shape::List, Argument::Tables(tables)) => {
                if !parameter.valid.holds(tables.len() as f64) {
                    return Err(self.refusal(&parameter.name, parameter.expected()));
                }
                let row = |(index, table)| {
                    let place = format!("{}{}[{}].", self.place, parameter.name, index + 1);
                    Arranging { declaration: self.declaration, place }.values(&parameter.elements, table)
                };
                let rows: Vec<Vec<Value>> = tables.into_iter().enumerate().map(row).collect::<Result<_>>()?;
                Ok(Value::List(rows.into()))
            }
            (shape, Argument::Value(value))
                if has_shape(&value, shape) && (parameter.may_vary() || value.is_shared()) =>
            {
                Ok(value)
            }
            (Shape::List, _) => Err(self.refusal(&parameter.name, parameter.expected())),
            _ => Err(self.refusal(&parameter.name, needed(parameter))),
        }
    }

    fn refusal(&self, name: &str, expected: impl Into<Text>) -> Error {
        let field = format!("{}{name}", self.place).into();
        Error::TorqueParameter { model: self.declaration.name.clone(), field, expected: expected.into() }
    }
}

impl ParameterDeclaration {
    /// Whether bodies may differ in it if values are given in a program. A study may draw fewer parameters
    /// ([`ParameterDeclaration::per_body`]).
    pub(crate) fn may_vary(&self) -> bool {
        self.per_body || self.shape == Shape::Matrix
    }
}

/// The text of a refusal for a parameter that is missing or of another shape.
fn needed(parameter: &ParameterDeclaration) -> String {
    let shape = match parameter.shape {
        Shape::Number => "a number",
        Shape::Vector => "three numbers",
        Shape::Rotation => "a quaternion x, y, z, w",
        Shape::Matrix => "a 3 by 3 matrix",
        Shape::Tensor => "an inertia tensor",
        Shape::Whole => "a whole number",
        Shape::List => "a list of tables",
    };
    let one = if parameter.may_vary() { "" } else { ", the same for all bodies" };
    format!("expected {}: {shape}{}{one}", parameter.with_axes(), in_brackets(&parameter.unit))
}

fn has_shape(value: &Value, shape: Shape) -> bool {
    matches!(
        (value, shape),
        (Value::Number(_), Shape::Number)
            | (Value::Vector(_), Shape::Vector)
            | (Value::Rotation(_), Shape::Rotation)
            | (Value::Matrix(_), Shape::Matrix)
            | (Value::Tensor(_), Shape::Tensor)
            | (Value::Whole(_), Shape::Whole)
    )
}

fn of_preset(shape: Shape, preset: Preset) -> Value {
    match (shape, preset) {
        (_, Preset::Seed) => Value::Whole(0),
        (_, Preset::Whole(number)) => Value::Whole(number),
        (Shape::Vector, Preset::Number(x)) => Value::Vector(glam::DVec3::splat(x).into()),
        (_, Preset::Number(x)) => Value::Number(x.into()),
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::torque::Orbit;
    use crate::torque::flat_plates::{Facet, Surface};
    use crate::torque::variable_inertia::{InertiaChange, Law};

    fn number(x: f64) -> Argument {
        Argument::Value(Value::Number(x.into()))
    }

    fn given<const N: usize>(pairs: [(&str, Argument); N]) -> Vec<(String, Argument)> {
        pairs.into_iter().map(|(name, argument)| (name.to_owned(), argument)).collect()
    }

    fn refused<const N: usize>(model: &str, pairs: [(&str, Argument); N]) -> String {
        Torque::named(model, given(pairs)).expect_err("refused").to_string()
    }

    #[test]
    fn names_make_the_torque_of_the_constructor() {
        let column: Value = Value::Number(vec![0.1, 0.2].into());
        let drag = Torque::named("viscous", given([("coefficient", Argument::Value(column))]));
        assert_eq!(drag, Ok(Torque::linear_drag(vec![0.1, 0.2])));

        let orbit = [("mu", number(4e14)), ("orbit.radius", number(7e6)), ("orbit.inclination", number(0.9))];
        let expected = Torque::gravity_gradient(Orbit::circular(4e14, 7e6).inclined(0.9));
        assert_eq!(Torque::named("gravity-gradient", given(orbit)), Ok(expected));

        let ramp = [("factor", number(2.0)), ("ramp.start", number(1.0)), ("ramp.duration", number(3.0))];
        let expected = Torque::variable_inertia(InertiaChange::Factor(2.0.into()), Law::ramp(1.0, 3.0));
        assert_eq!(Torque::named("variable-inertia", given(ramp)), Ok(expected));

        let vector = |v: DVec3| Argument::Value(Value::Vector(v.into()));
        let facet = given([
            ("area", number(0.5)),
            ("normal", vector(DVec3::X)),
            ("centre", vector(DVec3::Y)),
            ("solar.specular", number(0.3)),
            ("solar.diffuse", number(0.2)),
        ]);
        let light =
            [("pressure", number(4.56e-6)), ("direction", vector(DVec3::X)), ("facets", Argument::Tables(vec![facet]))];
        let surface = Surface::Solar { specular: 0.3, diffuse: 0.2 };
        let facet = Facet { area: 0.5, normal_body: DVec3::X, centre_body: DVec3::Y, surface };
        assert_eq!(Torque::named("flat-plates", given(light)), Torque::flat_plates(4.56e-6, DVec3::X, &[facet]));

        let noise = Torque::named("white-noise", given([("intensity", number(1e-3))]));
        assert_eq!(noise, Ok(Torque::white_noise(1e-3, 0)));
    }

    #[test]
    fn refusals_name_model_parameter_and_what_is_expected() {
        assert!(
            refused("linear", []).starts_with("linear: expected the name of a torque: constant-body, constant-world")
        );
        assert_eq!(
            refused("linear-drag", []),
            "linear-drag: coefficient: expected the coefficient c: a number (N m s)"
        );
        assert_eq!(
            refused("linear-drag", [("coefficient", Argument::Value(Value::Whole(1)))]),
            "linear-drag: coefficient: expected the coefficient c: a number (N m s)"
        );
        assert_eq!(refused("linear-drag", [("c", number(1.0))]), "linear-drag: c: expected coefficient");
        let twice = [("coefficient", number(1.0)), ("coefficient", number(1.0))];
        assert_eq!(refused("linear-drag", twice), "linear-drag: coefficient: expected once");
        let both = [("mu", number(1.0)), ("orbit.radius", number(1.0)), ("orbit.eccentricity", number(0.1))];
        assert_eq!(
            refused("gravity-gradient", both),
            "gravity-gradient: orbit.eccentricity: orbit.radius excludes it: give one of them"
        );
        let orbit = refused("gravity-gradient", [("mu", number(1.0))]);
        assert!(
            orbit.starts_with("gravity-gradient: orbit.semi_major_axis: expected")
                && orbit.ends_with("(or orbit.radius)"),
            "{orbit}"
        );
        let law = [("factor", number(2.0))];
        assert_eq!(refused("variable-inertia", law), "variable-inertia: ramp: expected ramp or oscillation");
        let laws = [("factor", number(2.0)), ("ramp.start", number(2.0)), ("oscillation.rate", number(2.0))];
        assert_eq!(
            refused("variable-inertia", laws),
            "variable-inertia: oscillation: ramp excludes it: give one of them"
        );
        let half = [("factor", number(2.0)), ("ramp.start", number(2.0))];
        assert!(
            refused("variable-inertia", half)
                .starts_with("variable-inertia: ramp.duration: expected the ramp's duration")
        );
        let seeds = [("intensity", number(1.0)), ("seed", number(1.5))];
        assert!(refused("white-noise", seeds).ends_with("a whole number, the same for all bodies"));
        let vector = || Argument::Value(Value::Vector(DVec3::X.into()));
        let light = |tables| [("pressure", number(1.0)), ("direction", vector()), ("facets", Argument::Tables(tables))];
        assert_eq!(refused("flat-plates", light(Vec::new())), "flat-plates: facets: expected a list of 1 to 16 tables");
        let facet = |area| given([("area", number(area)), ("normal", vector()), ("centre", vector())]);
        assert_eq!(
            refused("flat-plates", light(vec![facet(1.0)])),
            "flat-plates: facets[1].along: expected along or solar or drag"
        );
        let mut bad = facet(-1.0);
        bad.push(("along".to_owned(), number(1.0)));
        assert_eq!(
            refused("flat-plates", light(vec![bad])),
            "flat-plates: facets[1].area = -1: expected a finite number that is not negative (m²)"
        );
    }
}
