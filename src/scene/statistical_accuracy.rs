//! Errors asked for statistics and event times, rather than for each body.

use std::fmt;

use super::{Observed, Scene, Stepping, plain};
use crate::error::{Error, Result};

/// The greatest errors that the integration may cause in what is asked of an ensemble as a whole.
///
/// A mean or a quantile may be known where the attitude of no body is. The error due to the *number* of bodies is not part of the target: a
/// report states both ([`crate::record::StatisticalSample`]).
///
/// ```
/// use glam::{DQuat, DVec3};
/// use polhode::scene::StatisticalAccuracy;
/// use polhode::{Engine, Ensemble, Plan, Quantity, Scene, Torque};
///
/// let spin = |body: usize| (DVec3::splat(2.0), DQuat::IDENTITY, DVec3::X * (1.0 + body as f64));
/// let scene = Scene::new(Ensemble::from_fn(20, spin)?)
///     .torque(Torque::linear_drag(0.2))
///     .until(10.0)
///     .statistics([Quantity::SpinRate])
///     .statistical_accuracy(StatisticalAccuracy { mean: Some(1e-6), ..Default::default() });
/// let engine = Engine::cpu();
/// let record = engine.run(&Plan::new(&scene, &engine)?)?;
/// let sample = record.trust().statistics.as_ref().expect("a target was set");
/// assert_eq!(sample.met, Some(true));
/// # Ok::<(), polhode::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct StatisticalAccuracy {
    /// Error of the mean of each quantity that has statistics or a histogram, as a part of its standard deviation over the bodies at that
    /// time, above 0.
    pub mean: Option<f64>,
    /// Error of each quantile that is asked for, in the same unit.
    pub quantile: Option<f64>,
    /// Error of the mean time of each event, as a part of the span, above 0. A body that has not had the event counts with the whole span
    /// (restricted mean survival time).
    pub event_time: Option<f64>,
}

/// A kind of statistic for which an error may be asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "study", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum StatisticalTarget {
    /// The mean of a quantity.
    Mean,
    /// A quantile of a quantity.
    Quantile,
    /// The mean time of an event, restricted to the span.
    EventTime,
}

impl StatisticalTarget {
    /// The name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::Quantile => "quantile",
            Self::EventTime => "event time",
        }
    }

    /// What its errors are stated as parts of.
    pub fn scale(self) -> &'static str {
        match self {
            Self::Mean | Self::Quantile => "of the spread",
            Self::EventTime => "of the span",
        }
    }

    /// The key of a study.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Self::Mean => "accuracy.mean",
            Self::Quantile => "accuracy.quantile",
            Self::EventTime => "accuracy.event_time",
        }
    }
}

impl StatisticalAccuracy {
    /// The error asked for if a scene keeps no states and nothing else is set.
    pub const DEFAULT: f64 = 1e-3;

    /// The same error for everything that a scene asks for; none for what it does not ask for.
    pub(crate) fn of_all(observed: &Observed, error: f64) -> Self {
        let if_any = |any: bool| any.then_some(error);
        Self {
            mean: if_any(!(observed.statistics.is_empty() && observed.histograms.is_empty())),
            quantile: if_any(!(observed.statistics.is_empty() || observed.quantiles.is_empty())),
            event_time: if_any(!observed.events.is_empty()),
        }
    }

    /// The errors asked for, one by one.
    pub fn targets(&self) -> [(StatisticalTarget, Option<f64>); 3] {
        [
            (StatisticalTarget::Mean, self.mean),
            (StatisticalTarget::Quantile, self.quantile),
            (StatisticalTarget::EventTime, self.event_time),
        ]
    }

    /// The error asked for of one target.
    pub fn of(&self, target: StatisticalTarget) -> Option<f64> {
        self.targets().into_iter().find(|(other, _)| *other == target).and_then(|(_, wanted)| wanted)
    }

    /// The least of the errors asked for; infinite if there is none.
    pub(crate) fn strictest(&self) -> f64 {
        self.targets().into_iter().filter_map(|(_, wanted)| wanted).fold(f64::INFINITY, f64::min)
    }

    fn is_empty(&self) -> bool {
        self.targets().iter().all(|(_, wanted)| wanted.is_none())
    }

    /// Refuses errors that are out of range, and errors of what a scene does not ask for.
    pub(crate) fn check(&self, observed: &Observed) -> Result<()> {
        let (all, fitting) = (self.targets(), Self::of_all(observed, Self::DEFAULT));
        for (target, value) in all.into_iter().filter_map(|(target, wanted)| Some((target, wanted?))) {
            let refused = |expected| Err(Error::Setting { field: target.key(), value, expected });
            if !(value > 0.0 && value.is_finite()) {
                return refused("expected an error above 0: a part of the quantity's spread, or of the span");
            }
            if fitting.of(target).is_none() {
                return refused(match target {
                    StatisticalTarget::Mean => "there are no means: expected output.statistics or a [[histogram]] too",
                    StatisticalTarget::Quantile => {
                        "there are no quantiles: expected output.statistics and output.quantiles too"
                    }
                    StatisticalTarget::EventTime => "there is no event: expected an [[event]] too",
                });
            }
        }
        Ok(())
    }
}

impl fmt::Display for StatisticalAccuracy {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let wanted = self.targets().into_iter().filter_map(|(target, wanted)| Some((target, wanted?)));
        for (index, (target, wanted)) in wanted.enumerate() {
            let comma = if index > 0 { ", " } else { "" };
            write!(formatter, "{comma}{} {} {}", target.name(), plain(wanted), target.scale())?;
        }
        Ok(())
    }
}

impl Scene {
    /// Asks for errors of statistics and event times. If neither [`Scene::accuracy`] nor a method determines the steps, they follow
    /// from these errors; otherwise the report still says whether these targets are met.
    ///
    /// A scene that keeps no states, and for which nothing determines the steps, asks for an error of [`StatisticalAccuracy::DEFAULT`] for
    /// every kind of statistic that it records.
    #[must_use]
    pub fn statistical_accuracy(mut self, accuracy: StatisticalAccuracy) -> Self {
        self.statistical = Some(accuracy);
        self
    }

    /// The errors of statistics and event times that are asked for, if any.
    pub fn wanted_statistical_accuracy(&self) -> Option<StatisticalAccuracy> {
        let is_default = self.stepping.is_none() && !self.states;
        let default = || is_default.then(|| StatisticalAccuracy::of_all(&self.observed, StatisticalAccuracy::DEFAULT));
        self.statistical.or_else(default).filter(|accuracy| !accuracy.is_empty())
    }

    /// How steps are chosen.
    pub fn stepping(&self) -> Stepping {
        let statistical = || self.wanted_statistical_accuracy().map(Stepping::Statistics);
        self.stepping.or_else(statistical).unwrap_or(Stepping::DEFAULT)
    }
}
