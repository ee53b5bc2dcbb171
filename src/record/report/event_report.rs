//! Quantities and events in `report.json`.

use std::collections::BTreeSet;
use std::fmt;

use serde::Serialize;

use super::summary::figures;
use crate::bodies::Status;
use crate::math::Quantiles;
use crate::record::EventRecord;
use crate::scene::Observed;

/// A quantity that a study asks for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct QuantityReport {
    /// Its name in tables.
    pub name: String,
    /// Its unit.
    pub unit: String,
}

impl QuantityReport {
    /// The quantities that are asked for, each once.
    pub(crate) fn of(observed: &Observed) -> Vec<Self> {
        let report = |quantity: &crate::Quantity| {
            let (name, unit) = (quantity.name().to_owned(), quantity.unit().to_owned());
            Self { name, unit }
        };
        observed.quantities().iter().map(report).collect()
    }
}

/// An event of all bodies.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EventReport {
    /// Its name.
    pub event: String,
    /// The quantity.
    pub quantity: String,
    /// The condition on it: `below`, `above`, `falls_below`, `rises_above` or `crosses`.
    pub condition: &'static str,
    /// The level, in the quantity's unit.
    pub level: f64,
    /// Which occurrence counts.
    pub occurrence: u32,
    /// What the event does: `record` or `stop`.
    pub action: &'static str,
    /// Bodies that had it.
    pub bodies: usize,
    /// Bodies that failed without having had it.
    pub failed: usize,
    /// Bodies that another event stopped before they had it.
    pub stopped: usize,
    /// The share of bodies that have not had it by the end (Kaplan and Meier).
    pub share: f64,
    /// The lower end of its 95 % confidence interval (Rothman).
    pub low: f64,
    /// Its upper end.
    pub high: f64,
    /// The time by which the share is one half, s; `null` if it stays above.
    pub median: Option<f64>,
    /// Bodies of the recomputed sample.
    pub sampled: usize,
    /// Bodies of the recomputed sample that had it both in the run and recomputed.
    pub compared: usize,
    /// Bodies of the recomputed sample that had it in only one of the two.
    pub differing: usize,
    /// Bodies of the recomputed sample that had it earlier than the run says, or that never had it in the run, because the quantity passed
    /// its level and came back between two times at which the run seeks events ([`crate::record::EventErrors::unnoticed`]).
    pub unnoticed: usize,
    /// The least part of the time between outputs for which a body of the sample was followed, in [0, 1].
    pub searched: f64,
    /// Errors of the times of the compared bodies and of the unnoticed ones, s.
    pub time_error: Quantiles,
}

impl EventReport {
    /// The report for a run that ends at `end`, s.
    pub fn new(record: &EventRecord, end: f64) -> Self {
        let condition = record.event.condition();
        let survival = record.survival(&[end])[0];
        Self {
            event: record.event.name().to_owned(),
            quantity: record.event.quantity().name().to_owned(),
            condition: condition.name(),
            level: condition.level(),
            occurrence: record.event.nth(),
            bodies: record.occurrences.len(),
            action: record.event.action(),
            failed: record.censored.iter().filter(|censored| !censored.stopped).count(),
            stopped: record.censored.iter().filter(|censored| censored.stopped).count(),
            share: survival.share,
            low: survival.low,
            high: survival.high,
            median: record.median(),
            sampled: record.errors.bodies,
            compared: record.errors.compared,
            differing: record.errors.differing,
            unnoticed: record.errors.unnoticed,
            searched: record.errors.searched,
            time_error: record.errors.time(),
        }
    }
}

/// Bodies that events have stopped.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StoppedReport {
    /// The number in the column `status` of tables ([`Status`]).
    pub status: u8,
    /// Its word.
    pub reason: &'static str,
    /// The word explained.
    pub meaning: String,
    /// How many bodies.
    pub bodies: usize,
}

impl StoppedReport {
    /// From the events of a run, or of a study; `None` if none of them stops bodies.
    pub(crate) fn of(records: &[EventRecord]) -> Option<Self> {
        let stopping = || records.iter().filter(|record| record.event.stops());
        stopping().next()?;
        let bodies: BTreeSet<usize> =
            stopping().flat_map(|record| &record.occurrences).map(|occurrence| occurrence.body).collect();
        let status = Status::Stopped;
        let (reason, meaning) = (status.name(), status.to_string());
        Some(Self { status: status.number(), reason, meaning, bodies: bodies.len() })
    }
}

impl fmt::Display for EventReport {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |share: f64| 100.0 * (1.0 - share);
        write!(
            formatter,
            "  event    {}{}: {} bodies, {:.1} % ({:.1} to {:.1} % at 95 %)",
            self.event.replace(char::is_control, " "),
            if self.action == "stop" { ", which stops bodies" } else { "" },
            self.bodies,
            percent(self.share),
            percent(self.high),
            percent(self.low)
        )?;
        match self.median {
            Some(median) => writeln!(formatter, ", half of them by {median:.4e} s")?,
            None => writeln!(formatter)?,
        }
        if self.compared + self.unnoticed > 0 {
            writeln!(formatter, "           error of its time (s) {}", figures(&self.time_error))?;
        }
        if self.differing > 0 {
            let all = self.compared + self.differing;
            writeln!(formatter, "           {} of {all} in the sample differ in whether they had it", self.differing)?;
        }
        if self.unnoticed > 0 {
            writeln!(
                formatter,
                "           UNNOTICED in {} of {} bodies of the sample: they had it between two outputs and were back by the second, or \
                 passed the level by less than the run's errors; a shorter time in [time] checks = {{ every = ... }} seeks events more often",
                self.unnoticed, self.sampled
            )?;
        }
        if self.sampled > 0 && self.searched < 1.0 {
            let percent = 100.0 * self.searched;
            writeln!(
                formatter,
                "           the sample was followed for {percent:.2} % of the time: more may be unnoticed"
            )?;
        }
        Ok(())
    }
}
