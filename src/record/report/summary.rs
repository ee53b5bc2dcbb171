//! The report as some lines for people.

use std::fmt;

use super::{AccuracyReport, FailureReport, Report, StudyReport};
use crate::math::Quantiles;
use crate::plan::{SkipName, listed};
use crate::record::{AdaptiveWork, Drift};
use crate::scene::MOST_CELLS;

/// The nearest-rank 99th percentile of fewer values is their maximum.
const LEAST_FOR_P99: usize = 100;
/// A sample that says less than this part of an even one is said to.
const SHOWN_AS_EFFECTIVE: f64 = 0.75;

impl fmt::Display for Report {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(title) = self.study.as_ref().and_then(|study| study.title.as_ref()) {
            // A title with several lines could imitate the report's own lines.
            writeln!(formatter, "{}", title.replace(char::is_control, " "))?;
        }
        let engine = &self.engine;
        let software = if engine.software { ", a software adapter" } else { "" };
        let on_host = engine.on_host.as_ref().map_or(String::new(), |on_host| format!("; {on_host}"));
        writeln!(formatter, "  engine   {} ({}{software}{on_host})", engine.adapter, engine.kind)?;
        if let Some(fallback) = &self.fallback {
            writeln!(formatter, "  FALLBACK {fallback}")?;
        }
        if !self.failed_bodies.is_empty() {
            writeln!(formatter, "  FAILED   {} of {} bodies: see below", self.failed_bodies.len(), self.bodies)?;
        }
        self.write_work(formatter)?;
        if let Some(work) = &self.adaptive {
            write_adaptive(work, formatter)?;
        }
        let time = &self.wall_time;
        writeln!(
            formatter,
            "  time     {:.2} s: {:.2} planning, {:.2} computing, {:.2} reading back, {:.2} writing, {:.2} recomputing a sample; {:.2e} body-steps/s",
            time.total,
            time.plan,
            time.run.compute,
            time.run.read,
            time.format + time.disk,
            time.run.recomputed_sample,
            self.body_steps_per_second
        )?;
        if let Some(statistics) = &self.statistics {
            write!(formatter, "{statistics}")?;
        }
        self.events.iter().try_for_each(|event| write!(formatter, "{event}"))?;
        if let Some(stopped) = &self.stopped {
            writeln!(formatter, "  stopped  {} of {} bodies by an event", stopped.bodies, self.bodies)?;
        }
        // There is nothing to report without bodies.
        if self.drift.bodies > 0 {
            self.write_drift(formatter)?;
        }
        if self.bodies > 0 {
            write!(formatter, "{}", self.accuracy)?;
        }
        if let Some(statistical) = &self.statistical_accuracy {
            write!(formatter, "{statistical}")?;
        }
        match self.failed_bodies.first() {
            None => write!(formatter, "  failed   none"),
            Some(first) => {
                let (count, bodies) =
                    (self.failed_bodies.len(), if self.failed_bodies.len() == 1 { "body" } else { "bodies" });
                write!(formatter, "  failed   {count} {bodies}, the first is body {first}")?;
                self.failures.iter().try_for_each(|FailureReport { reason, meaning, bodies, cause, .. }| {
                    write!(formatter, "\n           {bodies} {reason}: {meaning}")?;
                    cause.iter().try_for_each(|cause| write!(formatter, "\n           {cause}"))
                })
            }
        }
    }
}

impl Report {
    fn write_work(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plan = &self.plan;
        let bodies = if self.bodies == 1 { "body" } else { "bodies" };
        let span = self.span;
        let span = if span == 0.0 || (1e-3..1e7).contains(&span) { format!("{span}") } else { format!("{span:e}") };
        write!(formatter, "  work     {} {bodies}, {span} s: {}", self.bodies, listed(&plan.parts))?;
        match plan.parts[..] {
            _ if plan.steps == 0 => writeln!(formatter)?,
            [_] if plan.steps == 1 => writeln!(formatter, ", 1 step of {:.3e} s or less", plan.longest_step)?,
            [_] => writeln!(formatter, ", {} steps of {:.3e} s or less", plan.steps, plan.longest_step)?,
            _ => writeln!(formatter, ", up to {} equal steps", plan.steps)?,
        }
        if let Some(StudyReport { cells: Some(cells), by_cell, .. }) = &self.study {
            let of_each = match by_cell {
                Some(true) => ", with statistics of each",
                Some(false) if *cells > MOST_CELLS => ", too many for statistics of each",
                Some(false) | None => "",
            };
            writeln!(formatter, "  cells    {cells}{of_each}")?;
        }
        if let Some(repairs) = &self.repairs {
            writeln!(
                formatter,
                "  repaired {} inertia tensors that broke the triangle inequality, by up to {:.1e} of themselves",
                repairs.bodies, repairs.largest_relative_change
            )?;
        }
        Ok(())
    }

    fn write_drift(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Drift { bodies, norm, .. } = &self.drift;
        let conserved = [
            ("kinetic energy  ", self.drift.kinetic_energy, self.drift.kinetic_energy_bodies),
            ("angular momentum", self.drift.angular_momentum_world, self.drift.angular_momentum_bodies),
            ("|q| - 1         ", *norm, *bodies),
        ];
        let mut word = "drift";
        for (name, drift, count) in conserved.into_iter().filter(|(_, _, count)| *count > 0) {
            write!(formatter, "  {word:<8} {name} {}", figures(&drift))?;
            if count < *bodies {
                write!(formatter, ", in the {count} of {bodies} bodies that keep it")?;
            }
            writeln!(formatter)?;
            word = "";
        }
        if *bodies > 0 && self.plan.skips.iter().any(|skip| skip.name == SkipName::States) {
            writeln!(formatter, "           of a sample of {bodies} bodies: states were not read")?;
        }
        if let Some(balance) = &self.balance {
            if balance.bodies > 0 && balance.parted {
                writeln!(
                    formatter,
                    "  balance  not known: the torques' work is taken along the recomputed paths, from which the run has parted"
                )?;
            } else if balance.bodies > 0 {
                writeln!(formatter, "  balance  kinetic energy   {}", figures(&balance.energy))?;
                writeln!(formatter, "           angular momentum {}", figures(&balance.angular_momentum_world))?;
            }
            if let Some(total) = &balance.total_energy {
                writeln!(formatter, "           total energy     {}", figures(total))?;
            }
        }
        Ok(())
    }
}

fn write_adaptive(work: &AdaptiveWork, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
    writeln!(formatter, "  steps    {} accepted", work.accepted)?;
    writeln!(formatter, "           {} rejected", work.rejected)?;
    writeln!(
        formatter,
        "           {} flagged; groups of {2} bodies side by side take {1:.3} times the steps of their bodies",
        work.flagged, work.imbalance, work.side_by_side
    )
}

impl fmt::Display for AccuracyReport {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sample = &self.sample;
        let bodies = if sample.bodies == 1 { "body" } else { "bodies" };
        if sample.bodies > 0 {
            writeln!(formatter, "  error    attitude (rad)   {}", figures(&sample.attitude))?;
            writeln!(formatter, "           angular velocity {}", figures(&sample.angular_velocity))?;
            writeln!(formatter, "           kinetic energy   {}", figures(&sample.kinetic_energy))?;
            if sample.translating > 0 {
                writeln!(formatter, "           position (m)     {}", figures(&sample.position))?;
                writeln!(formatter, "           velocity (m/s)   {}", figures(&sample.velocity))?;
            }
            write!(formatter, "           estimated from {} {bodies} recomputed in f64", sample.bodies)?;
        }
        match sample.bodies {
            0 if sample.lost == 0 && sample.diverged == 0 => {
                writeln!(formatter, "  error    not estimated: no body was recomputed")?;
            }
            0 => writeln!(formatter, "  error    not known: no body of the sample is left to compare")?,
            1..LEAST_FOR_P99 if sample.attitude.p99 == sample.attitude.max => {
                writeln!(formatter, " (of fewer than {LEAST_FOR_P99}, p99 is the greatest)")?;
            }
            _ => writeln!(formatter)?,
        }
        if sample.bodies > 0 && sample.same_draws {
            writeln!(
                formatter,
                "           in the same steps with the same draws: how far they are from the random path is not measured"
            )?;
        }
        if sample.diverged > 0 {
            writeln!(
                formatter,
                "           {} more could not be recomputed: their errors are not known",
                sample.diverged
            )?;
        }
        let Some(target) = &sample.target else { return Ok(()) };
        writeln!(formatter, "  asked    {target}")?;
        let verdict = match sample.met {
            Some(true) => "met",
            Some(false) => "NOT MET",
            None if sample.same_draws => {
                return writeln!(formatter, "           not measured: the sample has the draws of the run's own steps");
            }
            None if sample.bodies > 0 && sample.diverged == 0 => "NOT SHOWN to be met",
            None => return writeln!(formatter, "           not known whether it is met"),
        };
        write!(formatter, "           {verdict}, {} of {} {bodies} beyond", sample.beyond, sample.bodies)?;
        if sample.effective < SHOWN_AS_EFFECTIVE * sample.bodies as f64 {
            write!(formatter, " (they say as much as {:.0} drawn evenly)", sample.effective)?;
        }
        if sample.beyond > 0 {
            write!(formatter, ", which stand for {:.2} % of all", 100.0 * sample.share_beyond)?;
        }
        if sample.met.is_none() {
            write!(formatter, "; recompute more to know (accuracy.recompute)")?;
        }
        match (sample.lost, self.failed) {
            (0, 0) => writeln!(formatter),
            (0, failed) => writeln!(formatter, ", {failed} of all bodies failed"),
            (lost, _) => writeln!(formatter, ", {lost} more failed"),
        }
    }
}

/// Figures in words.
pub(super) fn figures(of: &Quantiles) -> String {
    format!("median {:.1e}, p99 {:.1e}, max {:.1e}", of.median, of.p99, of.max)
}
