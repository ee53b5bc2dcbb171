//! The own state of sampled torques as quantities.

use std::sync::Arc;

use super::Quantity;
use crate::error::{Error, Result};
use crate::torque::Torque;
use crate::torque::control::{self, OwnNumber};

/// A number of the own state of a sampled torque, such as the momentum of a wheel.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnStateQuantity {
    number: OwnNumber,
    /// Its name in tables.
    label: String,
}

impl OwnStateQuantity {
    /// Its name in tables: `torque1_h_x`.
    pub(super) fn label(&self) -> &str {
        &self.label
    }

    /// Its unit.
    pub(super) fn unit(&self) -> &str {
        &self.number.unit
    }
}

impl Quantity {
    /// A number of the own state of one of a scene's torques, given by the torque's index, from 0, and the number's name; components of a
    /// vector end in `_x`, `_y` or `_z`. Its own name is that of the column in tables of states: `torque1_h_x` of the first torque's `h`.
    /// NaN for bodies on which the torque does not act. At a sample time it is the value after the sample.
    ///
    /// ```
    /// use glam::{DQuat, DVec3};
    /// use polhode::Quantity;
    /// use polhode::torque::reaction_wheels::Wheels;
    /// use polhode::torque::{Sampling, Torque};
    ///
    /// let wheels = Wheels { torque_limit: 1e-3.into(), momentum_limit: 0.02.into(), momentum: DVec3::ZERO.into() };
    /// let torques = [Torque::reaction_wheels(2e-3, 8e-3, DQuat::IDENTITY, wheels, Sampling::every(0.5))];
    /// let momentum = Quantity::own_state(&torques, 0, "h_x")?;
    /// assert_eq!((momentum.name(), momentum.unit()), ("torque1_h_x", "kg m²/s"));
    /// assert!(Quantity::own_state(&torques, 0, "h").is_err(), "a vector is not a number");
    /// # Ok::<(), polhode::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::OwnState`] where the torque has no such number.
    pub fn own_state(torques: &[Torque], torque: usize, name: &str) -> Result<Self> {
        let wanted = OwnNumber { torque, name: name.to_owned(), unit: String::new() };
        let mut known = control::own_numbers(torques);
        let place = place(&wanted, &known)?;
        Ok(Self::of_own(known.swap_remove(place)))
    }

    /// The quantity of a number of own state.
    pub(crate) fn of_own(number: OwnNumber) -> Self {
        let label = number.label();
        Self::OwnState(Arc::new(OwnStateQuantity { number, label }))
    }

    /// The numbers of own state that some quantities depend on, each once.
    pub(crate) fn own_numbers(quantities: &[Self]) -> Vec<&OwnNumber> {
        let mut all: Vec<&OwnNumber> = Vec::new();
        let mut add = |number| {
            if !all.contains(&number) {
                all.push(number);
            }
        };
        for quantity in quantities {
            match quantity {
                Self::OwnState(own) => add(&own.number),
                Self::Formula(formula) => formula.own_numbers().for_each(&mut add),
                _ => {}
            }
        }
        all
    }

    /// The indices of these numbers among all that the torques of a scene have ([`control::own_numbers`]). Refuses what the torques do not
    /// have.
    pub(crate) fn own_places(quantities: &[Self], torques: &[Torque]) -> Result<Vec<usize>> {
        let known = control::own_numbers(torques);
        Self::own_numbers(quantities).into_iter().map(|number| place(number, &known)).collect()
    }
}

/// The index of the number with that torque and name among the known ones.
fn place(wanted: &OwnNumber, known: &[OwnNumber]) -> Result<usize> {
    let is_wanted = |number: &OwnNumber| (number.torque, &number.name) == (wanted.torque, &wanted.name);
    known.iter().position(is_wanted).ok_or_else(|| {
        let labels: Vec<String> = known.iter().map(OwnNumber::label).collect();
        let expected = if labels.is_empty() { "these torques have none".to_owned() } else { labels.join(", ") };
        Error::OwnState { name: wanted.label(), expected }
    })
}
