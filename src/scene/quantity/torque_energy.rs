//! The potential energies of single torques as quantities.

use std::sync::Arc;

use super::Quantity;
use crate::error::{Error, Result};
use crate::torque::Torque;

/// The potential energy of one of a scene's torques.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueEnergyQuantity {
    /// The torque's index, from 0.
    pub(crate) torque: usize,
    /// Its name in tables.
    label: String,
}

impl TorqueEnergyQuantity {
    /// Its name in tables: `torque1_potential_energy`.
    pub(super) fn label(&self) -> &str {
        &self.label
    }
}

impl Quantity {
    /// The potential energy, J, of one of a scene's torques, given by its index from 0, where [`Torque::has_potential`]. Its name is
    /// `torque1_potential_energy` for the first torque.
    ///
    /// ```
    /// use glam::{DQuat, DVec3};
    /// use polhode::{Quantity, Torque};
    ///
    /// let torques = [Torque::linear_drag(0.1), Torque::sine_spring(2.0, DQuat::IDENTITY)];
    /// let energy = Quantity::potential_energy_of(&torques, 1)?;
    /// assert_eq!((energy.name(), energy.unit()), ("torque2_potential_energy", "J"));
    /// assert!(Quantity::potential_energy_of(&torques, 0).is_err(), "drag has no potential");
    /// # Ok::<(), polhode::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::Setting`] with the torque's number, from 1, where there is no such torque or it has no potential.
    pub fn potential_energy_of(torques: &[Torque], torque: usize) -> Result<Self> {
        if torques.get(torque).is_some_and(Torque::has_potential) {
            return Ok(Self::of_potential(torque));
        }
        let expected = "expected the number, from 1, of a torque with a potential energy";
        Err(Error::Setting { field: "quantity.torque", value: torque as f64 + 1.0, expected })
    }

    /// The potential energy of the torque with an index, from 0.
    pub(crate) fn of_potential(torque: usize) -> Self {
        let label = format!("torque{}_potential_energy", torque + 1);
        Self::TorqueEnergy(Arc::new(TorqueEnergyQuantity { torque, label }))
    }

    /// The single torques whose energies some quantities are, each once.
    pub(crate) fn torque_energies(quantities: &[Self]) -> Vec<&TorqueEnergyQuantity> {
        let mut all: Vec<&TorqueEnergyQuantity> = Vec::new();
        for quantity in quantities {
            if let Self::TorqueEnergy(energy) = quantity
                && !all.contains(&&**energy)
            {
                all.push(energy);
            }
        }
        all
    }

    /// Refuses the energies of torques that have none.
    pub(crate) fn check_energies(quantities: &[Self], torques: &[Torque]) -> Result<()> {
        let energies = Self::torque_energies(quantities).into_iter();
        energies.map(|energy| Self::potential_energy_of(torques, energy.torque)).try_for_each(|found| found.map(|_| ()))
    }
}
