//! The drift of invariants.

use crate::bodies::BodyState;
use crate::math::Quantiles;

/// Drift of what bodies conserve, from the start to the end of a run. Changes made by a torque are not drift; [`super::Balance`]
/// covers them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct Drift {
    /// Bodies behind the figures: all that did not fail, or a sample if states were not read
    /// ([`crate::plan::SkipName::States`]).
    pub bodies: usize,
    /// The number of these on which no torque acts, which keep their kinetic energy.
    pub kinetic_energy_bodies: usize,
    /// |T − T₀| / T₀ of the rotational kinetic energy; zeros if there are no bodies.
    pub kinetic_energy: Quantiles,
    /// The number of these on which no external torque acts, which keep their angular momentum
    /// ([`crate::Torque::keeps_angular_momentum`]).
    pub angular_momentum_bodies: usize,
    /// |L − L₀| / |L₀| of the angular momentum in world axes; zeros if there are no bodies.
    pub angular_momentum_world: Quantiles,
    /// | |q| − 1 | of the orientation as integrated.
    pub norm: Quantiles,
}

impl std::fmt::Display for Drift {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.kinetic_energy_bodies > 0 {
            write!(formatter, "energy drift {}, ", self.kinetic_energy)?;
        }
        if self.angular_momentum_bodies > 0 {
            write!(formatter, "angular momentum drift {}, ", self.angular_momentum_world)?;
        }
        write!(formatter, "| |q| - 1 | {}", self.norm)
    }
}

/// Gathers one row for each body, in parts that are joined at the end.
#[derive(Debug, Default)]
pub(crate) struct DriftGatherer {
    kinetic_energy: Column,
    angular_momentum_world: Column,
    norm: Column,
}

/// Numbers in parts.
#[derive(Debug, Default)]
struct Column(Vec<Vec<f64>>);

impl Column {
    fn push(&mut self, number: f64) {
        match self.0.last_mut() {
            Some(part) => part.push(number),
            None => self.0.push(vec![number]),
        }
    }

    fn len(&self) -> usize {
        self.0.iter().map(Vec::len).sum()
    }

    /// Frees parts as they are taken over.
    fn quantiles(self) -> Quantiles {
        let mut numbers = Vec::with_capacity(self.len());
        self.0.into_iter().for_each(|part| numbers.extend(part));
        Quantiles::of(&mut numbers)
    }
}

/// Which quantities a body conserves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Conserved {
    pub kinetic_energy: bool,
    pub angular_momentum: bool,
}

/// The drift of one body, for the quantities that it conserves.
pub(crate) struct BodyDrift {
    kinetic_energy: Option<f64>,
    angular_momentum_world: Option<f64>,
    norm: f64,
}

impl BodyDrift {
    /// The drift between two states.
    pub(crate) fn between(initial: &BodyState, state: &BodyState, conserved: Conserved) -> Self {
        let relative = |change: f64, scale: f64| if scale > 0.0 { change / scale } else { 0.0 };
        let energy = || relative((state.kinetic_energy - initial.kinetic_energy).abs(), initial.kinetic_energy);
        let momentum = || {
            let change = (state.angular_momentum_world - initial.angular_momentum_world).length();
            relative(change, initial.angular_momentum_world.length())
        };
        Self {
            kinetic_energy: conserved.kinetic_energy.then(energy),
            angular_momentum_world: conserved.angular_momentum.then(momentum),
            norm: state.norm_error.abs(),
        }
    }
}

impl DriftGatherer {
    /// Makes room for further bodies.
    pub(crate) fn begin_part(&mut self, bodies: usize) {
        for column in [&mut self.kinetic_energy, &mut self.angular_momentum_world, &mut self.norm] {
            column.0.push(Vec::with_capacity(bodies));
        }
    }

    /// Adds the drift of one body.
    pub(crate) fn push(&mut self, body: BodyDrift) {
        body.kinetic_energy.into_iter().for_each(|drift| self.kinetic_energy.push(drift));
        body.angular_momentum_world.into_iter().for_each(|drift| self.angular_momentum_world.push(drift));
        self.norm.push(body.norm);
    }

    /// Appends the drift of further bodies.
    pub(crate) fn append(&mut self, mut other: Self) {
        self.kinetic_energy.0.append(&mut other.kinetic_energy.0);
        self.angular_momentum_world.0.append(&mut other.angular_momentum_world.0);
        self.norm.0.append(&mut other.norm.0);
    }

    pub(crate) fn finish(self) -> Drift {
        let Self { kinetic_energy, angular_momentum_world, norm } = self;
        let bodies = norm.len();
        let (kinetic_energy_bodies, angular_momentum_bodies) = (kinetic_energy.len(), angular_momentum_world.len());
        let (kinetic_energy, (angular_momentum_world, norm)) = rayon::join(
            || kinetic_energy.quantiles(),
            || rayon::join(|| angular_momentum_world.quantiles(), || norm.quantiles()),
        );
        Drift { bodies, kinetic_energy_bodies, kinetic_energy, angular_momentum_bodies, angular_momentum_world, norm }
    }
}
