//! Names of the own state of sampled torques, as tables, quantities and formulas use them.

use crate::expression;
use crate::torque::{Declaration, Shape, Torque};

/// The unit printed for the own state of a user's law: some SI unit.
pub(crate) const ANY_SI: &str = "SI";

/// A part of the own state of a torque of a scene: a number or a vector.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct OwnPart {
    /// The torque's index in the scene.
    torque: usize,
    name: String,
    unit: String,
    is_vector: bool,
}

/// A number of the own state of a torque of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct OwnNumber {
    /// The torque's index in the scene.
    pub torque: usize,
    /// The part's name; for a component of a vector with the suffix `_x`, `_y` or `_z`.
    pub name: String,
    /// Its unit, or [`ANY_SI`].
    pub unit: String,
}

impl OwnPart {
    /// Its name in formulas.
    pub fn label(&self) -> String {
        label(self.torque, &self.name)
    }

    /// Its shape in formulas.
    pub fn shape(&self) -> expression::Shape {
        if self.is_vector { expression::Shape::Vector } else { expression::Shape::Number }
    }

    /// Its numbers, in their order.
    pub fn numbers(&self) -> impl Iterator<Item = OwnNumber> {
        let names: Vec<String> = match self.is_vector {
            true => ["x", "y", "z"].iter().map(|axis| format!("{}_{axis}", self.name)).collect(),
            false => vec![self.name.clone()],
        };
        names.into_iter().map(|name| OwnNumber { torque: self.torque, name, unit: self.unit.clone() })
    }
}

impl OwnNumber {
    /// Its name in tables and studies: `torque1_h_x` of the first torque's `h`.
    pub fn label(&self) -> String {
        label(self.torque, &self.name)
    }
}

pub(super) fn label(torque: usize, name: &str) -> String {
    format!("torque{}_{name}", torque + 1)
}

/// The parts of the own state of torques with these declarations, in the scene's order.
pub(crate) fn parts<'d>(declarations: impl IntoIterator<Item = &'d Declaration>) -> Vec<OwnPart> {
    let of = |(torque, declaration): (usize, &'d Declaration)| {
        declaration.own_state.iter().map(move |part| OwnPart {
            torque,
            name: part.name.to_string(),
            unit: part.unit.to_string(),
            is_vector: part.shape == Shape::Vector,
        })
    };
    declarations.into_iter().enumerate().flat_map(of).collect()
}

/// The numbers of the own state of all torques, in the scene's order.
pub(crate) fn numbers(torques: &[Torque]) -> Vec<OwnNumber> {
    let parts = parts(torques.iter().map(Torque::declaration));
    parts.iter().flat_map(OwnPart::numbers).collect()
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::torque::reaction_wheels::Wheels;
    use crate::torque::{Orbit, Parameters, SampledLaw, Sampling};

    /// The declarations of own state match the laws, number by number.
    #[test]
    fn declarations_name_what_laws_keep() {
        let wheels = Wheels { torque_limit: 1.0.into(), momentum_limit: 1.0.into(), momentum: DVec3::ZERO.into() };
        let orbit = Orbit::circular(3.986e14, 7e6);
        let own = SampledLaw::new(Parameters::new(), 1.0, 0.0).expect("a law");
        let own = own.number("seen", 0.0).and_then(|law| law.vector("h", DVec3::ZERO)).expect("states");
        let own = own.next("seen", "1").and_then(|law| law.rate("h", "angular_velocity")).expect("laws");
        let torques = [
            Torque::linear_drag(1.0),
            Torque::reaction_wheels(1.0, 1.0, DQuat::IDENTITY, wheels, Sampling::every(1.0)),
            Torque::magnetorquers(1.0, 1.0, orbit, [1.0, 0.0, 0.0, 0.0].map(Into::into), Sampling::every(1.0)),
            Torque::pd_attitude(1.0, 1.0, DQuat::IDENTITY, 1.0, Sampling::every(1.0)),
            own.torque("-h").expect("a torque"),
        ];
        for torque in &torques {
            let declared: Vec<(String, bool)> =
                parts([torque.declaration()]).into_iter().map(|part| (part.name, part.is_vector)).collect();
            let states = torque.control().map(|control| &control.states[..]).unwrap_or_default();
            let kept: Vec<(String, bool)> =
                states.iter().map(|(name, numbers)| (name.clone(), numbers.len() == 3)).collect();
            assert_eq!(declared, kept, "{}", torque.name());
        }
        let labels: Vec<String> = numbers(&torques).iter().map(OwnNumber::label).collect();
        assert_eq!(labels[..4], ["torque2_h_x", "torque2_h_y", "torque2_h_z", "torque3_b_x"]);
        assert_eq!(labels[6..8], ["torque3_seen", "torque5_seen"]);
        let units: Vec<String> = numbers(&torques).into_iter().map(|number| number.unit).collect();
        assert_eq!([&units[0], &units[3], &units[6], &units[8]], ["kg m²/s", "T", "1", ANY_SI]);
    }
}
