//! How far the invariants have drifted.

use crate::batch::BodyState;

/// Median, 99th percentile and maximum over the bodies that did not fail.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quantiles {
    /// Half of the bodies are at or below.
    pub median: f64,
    /// 99 in 100 are at or below.
    pub p99: f64,
    /// All are at or below.
    pub max: f64,
}

impl Quantiles {
    /// The quantiles of `values`, which are reordered; 0 where there are none. No value may be NaN.
    pub fn of(values: &mut [f64]) -> Self {
        Self { median: Self::rank(values, 0.5), p99: Self::rank(values, 0.99), max: Self::rank(values, 1.0) }
    }

    /// The smallest of `values`, which are reordered, with at least `part` of all at or below it; 0 where there are none.
    pub(crate) fn rank(values: &mut [f64], part: f64) -> f64 {
        let count = values.len();
        if count == 0 {
            return 0.0;
        }
        let index = ((part * count as f64).ceil() as usize).clamp(1, count) - 1;
        *values.select_nth_unstable_by(index, f64::total_cmp).1
    }
}

impl std::fmt::Display for Quantiles {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{:.1e} (p99 {:.1e}, max {:.1e})", self.median, self.p99, self.max)
    }
}

/// Drift of what a free body conserves, from the start to the end of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drift {
    /// Bodies behind the figures: all that did not fail, or a sample where states were not read
    /// ([`crate::plan::SkipName::States`]).
    pub bodies: usize,
    /// |T − T₀| / T₀ of the rotational kinetic energy.
    pub kinetic_energy: Quantiles,
    /// |L − L₀| / |L₀| of the angular momentum in world axes.
    pub angular_momentum_world: Quantiles,
    /// | |q| − 1 | of the orientation as integrated.
    pub norm: Quantiles,
}

/// Gathers one row a body.
#[derive(Debug, Default)]
pub(crate) struct DriftGatherer {
    kinetic_energy: Vec<f64>,
    angular_momentum_world: Vec<f64>,
    norm: Vec<f64>,
}

impl DriftGatherer {
    /// Takes the drift of one body between two states.
    pub(crate) fn push(&mut self, initial: &BodyState, state: &BodyState) {
        let relative = |change: f64, scale: f64| if scale > 0.0 { change / scale } else { 0.0 };
        self.kinetic_energy
            .push(relative((state.kinetic_energy - initial.kinetic_energy).abs(), initial.kinetic_energy));
        self.angular_momentum_world.push(relative(
            (state.angular_momentum_world - initial.angular_momentum_world).length(),
            initial.angular_momentum_world.length(),
        ));
        self.norm.push(state.norm_error.abs());
    }

    pub(crate) fn finish(mut self) -> Drift {
        Drift {
            bodies: self.norm.len(),
            kinetic_energy: Quantiles::of(&mut self.kinetic_energy),
            angular_momentum_world: Quantiles::of(&mut self.angular_momentum_world),
            norm: Quantiles::of(&mut self.norm),
        }
    }
}
