//! Whether energy and angular momentum change by what the torques contribute.

use crate::math::Quantiles;

/// The differences between the changes of energy and angular momentum over a run and what the torques account for.
///
/// A free body keeps both, which [`super::Drift`] shows. For a driven one the figures here are the equivalent: what remains after
/// the torques' contribution is subtracted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Balance {
    /// Driven bodies of the recomputed sample, behind the next two figures, at most 8 unless torques are random or sampled; those that
    /// failed are left out.
    pub bodies: usize,
    /// |T − T₀ − W| of the run's kinetic energy T and the work W = ∫ τ·ω dt of all torques, which is integrated along the
    /// recomputed motion in `f64`; relative to the body's greatest kinetic energy during the motion.
    pub energy: Quantiles,
    /// |L − L₀ − ∫ R τ dt| of the run's angular momentum L in world axes, relative to the body's greatest |L| during the motion.
    pub angular_momentum_world: Quantiles,
    /// Bodies whose final state was read and whose torques all have a potential.
    pub conservative_bodies: usize,
    /// |T + U − T₀ − U₀| of those bodies, U being the sum of the potentials; relative to the greater of T + |U| at the start and at the
    /// end.
    pub total_energy: Quantiles,
}

/// Gathers one row for each body.
#[derive(Debug, Default)]
pub(crate) struct BalanceGatherer {
    energy: Vec<f64>,
    angular_momentum_world: Vec<f64>,
    /// The number of bodies that each of these stands for.
    weights: Vec<f64>,
    total_energy: Vec<f64>,
}

impl BalanceGatherer {
    /// Adds the remainders of the changes of energy and of angular momentum, each with its scale, for a body with this weight.
    pub(crate) fn push_rest(&mut self, energy: (f64, f64), angular_momentum_world: (f64, f64), weight: f64) {
        self.weights.push(weight);
        self.energy.push(relative(energy));
        self.angular_momentum_world.push(relative(angular_momentum_world));
    }

    /// Adds the result of [`change_of_total`] for one body.
    pub(crate) fn push_total(&mut self, change: f64) {
        self.total_energy.push(change);
    }

    /// Appends further bodies.
    pub(crate) fn append(&mut self, other: Self) {
        self.energy.extend(other.energy);
        self.angular_momentum_world.extend(other.angular_momentum_world);
        self.weights.extend(other.weights);
        self.total_energy.extend(other.total_energy);
    }

    pub(crate) fn finish(mut self) -> Balance {
        Balance {
            bodies: self.energy.len(),
            energy: Quantiles::weighted(&self.energy, &self.weights),
            angular_momentum_world: Quantiles::weighted(&self.angular_momentum_world, &self.weights),
            conservative_bodies: self.total_energy.len(),
            total_energy: Quantiles::of(&mut self.total_energy),
        }
    }
}

/// The relative difference between the sums of kinetic and potential energy at the start and at the end, for a body that keeps their sum.
pub(crate) fn change_of_total(start: (f64, f64), end: (f64, f64)) -> f64 {
    let size = |(kinetic, potential): (f64, f64)| kinetic + potential.abs();
    // Differences before sums: the potential may be much greater.
    let change = (end.0 - start.0) + (end.1 - start.1);
    relative((change.abs(), size(start).max(size(end))))
}

/// A remainder relative to its scale; for a body that never moves, the remainder itself. NaN counts as the greatest remainder and must not
/// pass for the least.
fn relative((rest, scale): (f64, f64)) -> f64 {
    let relative = if scale > 0.0 { rest / scale } else { rest };
    if relative.is_nan() { f64::INFINITY } else { relative }
}

impl std::fmt::Display for Balance {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            formatter,
            "energy less work {}, angular momentum less impulse {} in {} bodies",
            self.energy, self.angular_momentum_world, self.bodies
        )?;
        if self.conservative_bodies > 0 {
            write!(formatter, ", kinetic and potential energy {} in {}", self.total_energy, self.conservative_bodies)?;
        }
        Ok(())
    }
}
