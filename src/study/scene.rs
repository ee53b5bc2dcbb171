//! The scene that a study describes, with its bodies drawn or read.

use super::Study;
use crate::bodies::Ensemble;
#[cfg(doc)]
use crate::error::Error;
use crate::error::Result;
use crate::scene::Scene;

/// The least memory per body, bytes, that a run takes under at most one torque: the table of bodies, columns, frames (measured: 311 per
/// body for a million bodies in `f32`, 320 in `f64`).
const RUN_BYTES: usize = 300;
/// Bytes per body of each further torque (measured: 44 in `f32`, 92 in `f64`).
const TORQUE_BYTES: usize = 40;

impl Study {
    /// Draws and reads the bodies.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] for the first body that is not valid, with the line that it came from;
    /// [`Error::TooManyBodies`]; [`Error::MissingMass`].
    pub fn ensemble(&self) -> Result<Ensemble> {
        let ensemble = self.bodies.ensemble(self.draw(), !self.forces.is_empty());
        ensemble.map_err(|error| self.located(error))
    }

    /// The scene that the study describes.
    ///
    /// # Errors
    ///
    /// As [`Study::ensemble`]; [`Error::Input`] for a torque whose formula cannot be made from its parameters.
    pub fn scene(&self) -> Result<Scene> {
        let bytes = self.bodies.count.saturating_mul(self.bytes_of_body());
        crate::bodies::memory::require(self.bodies.count, bytes, "their run").map_err(|error| self.located(error))?;
        let mut scene = Scene::new(self.ensemble()?).until(self.end).outputs(self.outputs.clone()).part_of(self.part);
        for force in &self.forces {
            scene = scene.force(force.force(self.draw(), self.seed, &self.bodies));
        }
        // Torques with random paths of one seed would all follow the same path.
        let mut seed = self.seed;
        for torque in &self.torques {
            let made = torque.torque(self.draw(), seed, &self.bodies);
            scene = scene.torque(made.map_err(|error| self.located(error))?);
            seed = seed.wrapping_add(torque.takes_seed().into());
        }
        scene = self.observed.applied_to(scene)?;
        if self.starts {
            scene = scene.with_start();
        }
        if let Some(every) = self.checks {
            scene = scene.event_checks(every);
        }
        if !self.observed.is_empty() && !self.output.final_state && !self.output.snapshots {
            scene = scene.without_states();
        }
        Ok(self.accuracy.applied_to(scene))
    }

    /// The least memory per body, bytes, that a run takes.
    pub(crate) fn bytes_of_body(&self) -> usize {
        RUN_BYTES + TORQUE_BYTES * self.torques.len().saturating_sub(1)
    }
}
