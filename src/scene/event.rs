//! Events: a quantity of a body passes a level.

use crate::error::{Error, Result};
use crate::scene::Quantity;

/// The condition on a quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Condition {
    /// It is below the level: at the start, or when it gets there from the level or above.
    Below(f64),
    /// It is above the level: at the start, or when it gets there from the level or below.
    Above(f64),
    /// It gets below the level, having been above it: a body that starts below has to rise first, and so has one that starts on it.
    Falls(f64),
    /// It gets above the level, having been below it: a body that starts above has to fall first, and so has one that starts on it.
    Rises(f64),
    /// It gets from below the level to it or above, or back. To leave the level at the start does not count.
    Crosses(f64),
}

impl Condition {
    /// The level, in the quantity's unit.
    pub fn level(self) -> f64 {
        match self {
            Self::Below(level)
            | Self::Above(level)
            | Self::Falls(level)
            | Self::Rises(level)
            | Self::Crosses(level) => level,
        }
    }

    /// The key in study files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Below(_) => "below",
            Self::Above(_) => "above",
            Self::Falls(_) => "falls_below",
            Self::Rises(_) => "rises_above",
            Self::Crosses(_) => "crosses",
        }
    }

    /// The same with another level.
    #[must_use]
    pub fn with_level(self, level: f64) -> Self {
        match self {
            Self::Below(_) => Self::Below(level),
            Self::Above(_) => Self::Above(level),
            Self::Falls(_) => Self::Falls(level),
            Self::Rises(_) => Self::Rises(level),
            Self::Crosses(_) => Self::Crosses(level),
        }
    }

    /// All of them, at the level 0.
    pub const ALL: &'static [Self] =
        &[Self::Below(0.0), Self::Above(0.0), Self::Falls(0.0), Self::Rises(0.0), Self::Crosses(0.0)];

    /// The side of the level on which a quantity is that exceeds it by `excess`: true on the side that the condition names.
    pub(crate) fn is_beyond(self, excess: f64) -> bool {
        match self {
            Self::Below(_) | Self::Falls(_) => excess < 0.0,
            Self::Above(_) | Self::Rises(_) => excess > 0.0,
            Self::Crosses(_) => excess >= 0.0,
        }
    }

    /// [`Condition::is_beyond`]; `None` if the quantity has no value.
    pub(crate) fn side(self, excess: f64) -> Option<bool> {
        (!excess.is_nan()).then(|| self.is_beyond(excess))
    }

    /// The side of a body at the start; `None` also if it is on the level itself, which to leave is no passage.
    pub(crate) fn side_at_start(self, excess: f64) -> Option<bool> {
        let is_passage = matches!(self, Self::Falls(_) | Self::Rises(_) | Self::Crosses(_));
        self.side(excess).filter(|_| !(is_passage && excess == 0.0))
    }

    /// Whether the step from one side to another meets the condition. A body whose quantity had no value before starts where it gets one.
    pub(crate) fn is_met_between(self, before: Option<bool>, after: Option<bool>) -> bool {
        match (self, before, after) {
            (.., None) => false,
            (_, None, Some(after)) => self.is_met_at_start(after),
            (Self::Crosses(_), Some(before), Some(after)) => before != after,
            (_, Some(before), Some(after)) => !before && after,
        }
    }

    /// Whether the condition is met at the start by a body that is `beyond` the level there.
    pub(crate) fn is_met_at_start(self, beyond: bool) -> bool {
        beyond && matches!(self, Self::Below(_) | Self::Above(_))
    }
}

/// An event that each body may have, and that may stop it.
///
/// Each interval between output times and checks is searched: if the quantity is on the other side of its level than at the output before, the body is
/// followed between the two and the time is found to 1e-12 of the scene's span ([`EventTime::Located`]). A quantity that passes the level
/// and comes back between two outputs is not seen: choose output times that are closer than that, or check more often
/// ([`Scene::event_checks`](crate::Scene::event_checks)).
///
/// A body that has a *stopping* event ([`Event::stopping`]) stays in the state of the event from then on: at all later outputs and at the
/// end ([`Status::Stopped`](crate::bodies::Status::Stopped), [`OutputState::stopped_at`](crate::record::OutputState::stopped_at)), in
/// statistics and histograms too. It takes no steps after the next output. Of several stopping events the earliest counts; other events
/// that the body has not had by then it never has ([`Censored`](crate::record::Censored)). The body has not failed.
///
/// [`EventTime::Located`]: crate::record::EventTime::Located
///
/// ```
/// use polhode::scene::{Condition, Event};
/// use polhode::Quantity;
///
/// let despun = Event::new("despun", Quantity::SpinRate, Condition::Below(0.01))?;
/// let third_flip = Event::new("third flip", Quantity::AngularVelocityBody(1), Condition::Crosses(0.0))?.occurrence(3)?;
/// assert_eq!((despun.nth(), third_flip.nth()), (1, 3));
/// assert!(!despun.stops() && third_flip.stopping().stops());
/// # Ok::<(), polhode::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    name: String,
    quantity: Quantity,
    condition: Condition,
    nth: u32,
    stops: bool,
}

impl Event {
    /// An event at the first time that the condition is met.
    ///
    /// # Errors
    ///
    /// [`Error::Setting`] where the level is not finite.
    pub fn new(name: &str, quantity: Quantity, condition: Condition) -> Result<Self> {
        if !condition.level().is_finite() {
            let (field, value) = (condition.name(), condition.level());
            return Err(Error::Setting { field, value, expected: "expected a finite level" });
        }
        Ok(Self { name: name.to_owned(), quantity, condition, nth: 1, stops: false })
    }

    /// Counts the n-th time instead of the first.
    ///
    /// # Errors
    ///
    /// [`Error::Setting`] where `nth` is 0.
    pub fn occurrence(mut self, nth: u32) -> Result<Self> {
        if nth == 0 {
            return Err(Error::Setting { field: "occurrence", value: 0.0, expected: "expected 1 or more" });
        }
        self.nth = nth;
        Ok(self)
    }

    /// The same event, which stops the body that has it.
    #[must_use]
    pub fn stopping(mut self) -> Self {
        self.stops = true;
        self
    }

    /// Its name in tables.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The quantity.
    pub fn quantity(&self) -> &Quantity {
        &self.quantity
    }

    /// The condition on it.
    pub fn condition(&self) -> Condition {
        self.condition
    }

    /// Which occurrence counts, from 1.
    pub fn nth(&self) -> u32 {
        self.nth
    }

    /// Whether it stops the body that has it.
    pub fn stops(&self) -> bool {
        self.stops
    }

    /// What the event does, by its name in studies.
    pub fn action(&self) -> &'static str {
        Self::ACTIONS[usize::from(self.stops)]
    }

    /// All names of actions.
    pub const ACTIONS: [&str; 2] = ["record", "stop"];
}
