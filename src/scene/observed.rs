//! What a scene asks for beside states: statistics, quantiles, histograms, events.

use super::{Event, Histogram, Quantity, Scene};
use crate::error::{Error, Result};
use crate::kernel::observe::Statistic;
use crate::torque::control::Accumulation;
use crate::torque::{Parameters, Torque};

/// The most cells by which statistics are formed ([`Scene::by_cell`]).
pub const MOST_CELLS: usize = 4096;

/// What a scene asks for beside states.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Observed {
    pub statistics: Vec<Quantity>,
    /// In percent, ascending.
    pub quantiles: Vec<f64>,
    pub histograms: Vec<Histogram>,
    pub events: Vec<Event>,
    /// The number of cells by which statistics, quantiles and histograms are formed too; body b lies in cell b modulo this.
    pub cells: Option<usize>,
}

impl Observed {
    /// All quantities that are asked for, each once; first those of the statistics, in their order.
    pub fn quantities(&self) -> Vec<Quantity> {
        let Self { statistics, histograms, events, .. } = self;
        let all = statistics.iter().chain(histograms.iter().map(Histogram::quantity));
        let mut found: Vec<Quantity> = Vec::new();
        for quantity in all.chain(events.iter().map(Event::quantity)) {
            if !found.contains(quantity) {
                found.push(quantity.clone());
            }
        }
        found
    }

    /// The statistics, if engines can form everything that is asked for; otherwise none.
    pub fn plain_statistics(&self) -> Vec<Statistic> {
        let Self { statistics, quantiles, histograms, events, cells } = self;
        let found: Option<Vec<Statistic>> = statistics.iter().map(Quantity::statistic).collect();
        let are_all = quantiles.is_empty() && histograms.is_empty() && events.is_empty() && cells.is_none();
        found.filter(|_| are_all).unwrap_or_default()
    }
}

impl Scene {
    /// Asks for statistics of these quantities over all bodies, at every output time; each quantity once, in this order.
    ///
    /// Kinetic energy, spin rate and angular momentum are reduced on the engine. Other quantities and histograms are formed on GPUs that
    /// compute in `f64` ([`crate::engine::gpu::GpuOptions::forms_quantities`]); otherwise, and for quantiles and events, the states are
    /// read at every output time.
    ///
    /// ```
    /// # use glam::{DQuat, DVec3};
    /// use polhode::{Engine, Ensemble, Plan, Quantity, Scene};
    ///
    /// # let ensemble = Ensemble::from_columns(&[DVec3::new(1.0, 2.0, 2.5)], &[DQuat::IDENTITY], &[DVec3::X])?;
    /// let scene = Scene::new(ensemble).until(60.0).statistics([Quantity::KineticEnergy]).without_states();
    /// let engine = Engine::cpu();
    /// let record = engine.run(&Plan::new(&scene, &engine)?)?;
    /// let energy = record.statistics()[0].of(Quantity::KineticEnergy).expect("asked for");
    /// assert!((energy.mean - 0.5).abs() < 1e-12);
    /// # Ok::<(), polhode::Error>(())
    /// ```
    #[must_use]
    pub fn statistics(mut self, quantities: impl IntoIterator<Item = impl Into<Quantity>>) -> Self {
        let statistics = &mut self.observed.statistics;
        statistics.clear();
        for quantity in quantities.into_iter().map(Into::into) {
            if !statistics.contains(&quantity) {
                statistics.push(quantity);
            }
        }
        self
    }

    /// Adds a quantity that adds up in the course of the motion, and returns it: the integral of a formula, or how often it changes its sign.
    /// The formula (as in [`Quantity::formula`], without the start) is evaluated at t = 0, `every`, 2 `every`, ... s, and again when the
    /// quantity is formed. A law without a torque does that ([`crate::torque::control`]), which ends all steps at these times and takes the
    /// closed form from torque-free bodies: ask only for what is needed.
    ///
    /// ```
    /// # use glam::{DQuat, DVec3};
    /// use polhode::torque::control::Accumulation;
    /// use polhode::{Engine, Ensemble, Plan, Scene};
    ///
    /// # let ensemble = Ensemble::from_columns(&[DVec3::new(1.0, 2.0, 2.5)], &[DQuat::IDENTITY], &[DVec3::X])?;
    /// let formula = "norm(angular_velocity) / (2 * pi)";
    /// let scene = Scene::new(ensemble).until(60.0);
    /// let (scene, revolutions) = scene.accumulating(Accumulation::Integral, ("revolutions", "1"), formula, 0.5)?;
    /// let scene = scene.statistics([revolutions.clone()]).without_states();
    /// let engine = Engine::cpu();
    /// let record = engine.run(&Plan::new(&scene, &engine)?)?;
    /// let found = record.statistics()[0].of(revolutions).expect("asked for");
    /// assert!((found.mean - 60.0 / std::f64::consts::TAU).abs() < 1e-9);
    /// # Ok::<(), polhode::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::Formula`] if the text is not such a formula of a number. The period is checked when a plan is made.
    pub fn accumulating(
        self,
        accumulation: Accumulation,
        (name, unit): (&str, &str),
        formula: &str,
        every: f64,
    ) -> Result<(Self, Quantity)> {
        let law = self.torques().len();
        let (model, values) = accumulation.model(Parameters::new(), formula, every)?;
        let scene = self.torque(Torque::of_model(model, values));
        let completed = accumulation.completed(formula, every, law);
        let quantity = Quantity::formula_of(scene.torques(), name, unit, &completed)?;
        Ok((scene, quantity))
    }

    /// Asks for these quantiles, in percent, of every quantity that has statistics. Of more than 2,048 bodies, the relative error of
    /// each is at most 2.5e-4 ([`crate::record::QUANTILE_ERROR`]); its value does not depend on the order of the bodies. A second call
    /// replaces the first.
    ///
    /// # Errors
    ///
    /// [`Error::Setting`] for one that is not between 0 and 100.
    pub fn quantiles(mut self, percent: &[f64]) -> Result<Self> {
        if let Some(&value) = percent.iter().find(|percent| !(0.0..=100.0).contains(*percent)) {
            let expected = "expected percentages from 0 to 100";
            return Err(Error::Setting { field: "output.quantiles", value, expected });
        }
        self.observed.quantiles = percent.to_vec();
        self.observed.quantiles.sort_by(f64::total_cmp);
        self.observed.quantiles.dedup();
        Ok(self)
    }

    /// Asks for statistics, quantiles and histograms of each of `cells` groups of bodies too: body b, by its index in the whole study, lies in
    /// cell b modulo `cells`, as in a sweep. The states are then read at every output time.
    ///
    /// # Errors
    ///
    /// [`Error::Setting`] for a number that is not from 1 to [`MOST_CELLS`].
    pub fn by_cell(mut self, cells: usize) -> Result<Self> {
        if !(1..=MOST_CELLS).contains(&cells) {
            let expected = "expected from 1 to 4096 cells";
            return Err(Error::Setting { field: "output.by_cell", value: cells as f64, expected });
        }
        self.observed.cells = Some(cells);
        Ok(self)
    }

    /// Adds a histogram at every output time.
    #[must_use]
    pub fn histogram(mut self, histogram: Histogram) -> Self {
        self.observed.histograms.push(histogram);
        self
    }

    /// Adds an event, whose time is found for each body.
    ///
    /// ```
    /// # use glam::{DQuat, DVec3};
    /// use polhode::scene::{Condition, Event};
    /// use polhode::{Engine, Ensemble, Outputs, Plan, Quantity, Scene, Torque};
    ///
    /// # let sphere = DVec3::splat(2.0);
    /// # let ensemble = Ensemble::from_columns(&[sphere], &[DQuat::IDENTITY], &[DVec3::X])?;
    /// let slow = Event::new("slow", Quantity::SpinRate, Condition::Below(0.5))?;
    /// let scene = Scene::new(ensemble).torque(Torque::linear_drag(0.2)).until(20.0).outputs(Outputs::Every(1.0)).event(slow);
    /// let engine = Engine::cpu();
    /// let record = engine.run(&Plan::new(&scene, &engine)?)?;
    /// // The spin decays with the rate c/I = 0.1 1/s.
    /// assert!((record.events()[0].occurrences[0].time - 10.0 * 2.0_f64.ln()).abs() < 1e-6);
    /// # Ok::<(), polhode::Error>(())
    /// ```
    #[must_use]
    pub fn event(mut self, event: Event) -> Self {
        self.observed.events.push(event);
        self
    }

    /// The same scene with nothing asked for beside states.
    #[must_use]
    pub fn unobserved(mut self) -> Self {
        self.observed = Observed::default();
        self.statistical = None;
        self
    }

    /// The same scene with only the events that stop bodies.
    pub(crate) fn only_stopping(mut self) -> Self {
        let events = self.observed.events.drain(..).filter(Event::stops).collect();
        self.observed = Observed { events, ..Observed::default() };
        self.statistical = None;
        self
    }

    /// The quantities whose statistics are recorded.
    pub(crate) fn wanted_statistics(&self) -> &[Quantity] {
        &self.observed.statistics
    }

    /// The quantiles that are recorded with the statistics, in percent, ascending.
    pub fn wanted_quantiles(&self) -> &[f64] {
        &self.observed.quantiles
    }

    /// The histograms that are recorded.
    pub fn wanted_histograms(&self) -> &[Histogram] {
        &self.observed.histograms
    }

    /// The events that are looked for.
    pub fn wanted_events(&self) -> &[Event] {
        &self.observed.events
    }

    pub(crate) fn observed(&self) -> &Observed {
        &self.observed
    }

    /// Whether an event stops bodies ([`Event::stopping`]).
    pub fn stops(&self) -> bool {
        self.observed.events.iter().any(Event::stops)
    }

    /// Whether anything beside the states is asked for at every output time.
    pub fn observes(&self) -> bool {
        let Observed { statistics, histograms, events, .. } = &self.observed;
        !(statistics.is_empty() && histograms.is_empty() && events.is_empty())
    }

    /// The statistics, if engines can form everything that is asked for; otherwise none.
    pub(crate) fn plain_statistics(&self) -> Vec<Statistic> {
        self.observed.plain_statistics()
    }

    /// The statistics that are reduced on the engine.
    pub(crate) fn reduced_statistics(&self) -> Vec<Statistic> {
        if self.may_skip() { self.plain_statistics() } else { Vec::new() }
    }

    /// Whether a GPU that computes in `f64` can form all that is asked for where the states are: statistics and histograms of quantities
    /// that follow from the states of bodies and from what does not change.
    pub(crate) fn forms_on_devices(&self) -> bool {
        let quantities = self.observed.quantities();
        let is_of_torques = |quantity: &Quantity| {
            matches!(quantity, Quantity::PotentialEnergy | Quantity::TotalEnergy | Quantity::TorqueEnergy(_))
        };
        self.wanted_events().is_empty()
            && self.observed.quantiles.is_empty()
            && self.observed.cells.is_none()
            && Quantity::own_numbers(&quantities).is_empty()
            && !quantities.iter().any(is_of_torques)
            && !self.torques().iter().any(Torque::changes_inertia)
    }

    /// Whether what is asked for requires reading the states of all bodies at every output time.
    pub(crate) fn needs_states(&self) -> bool {
        self.observes() && self.plain_statistics().is_empty()
    }
}
