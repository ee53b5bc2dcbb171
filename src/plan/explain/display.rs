//! The tables that an explanation prints.

use std::fmt;

use super::{ClassRow, Explanation, LinkRow, SampleRow, TenthRow};

/// Bytes in MiB, with decimals if there are few.
fn mebibytes(bytes: u64) -> String {
    let mebibytes = bytes as f64 / f64::from(1 << 20);
    if mebibytes < 10.0 { format!("{mebibytes:.2}") } else { format!("{mebibytes:.0}") }
}

impl fmt::Display for Explanation {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of = |count: usize, one: &'static str, more: &'static str| if count == 1 { one } else { more };
        let bodies = self.part.map_or(self.bodies, |part| part.bodies);
        writeln!(
            formatter,
            "{bodies} {}, {} s, {} output {}{}{}{}, on {}\nasked for: {}",
            of(bodies, "body", "bodies"),
            self.span,
            self.outputs,
            of(self.outputs, "time", "times"),
            self.checks
                .map_or(String::new(), |checks| format!(" and {checks} {} for events", of(checks, "check", "checks"))),
            match self.breaks {
                0 => String::new(),
                breaks => format!(", {breaks} {} near which formulas change fast", of(breaks, "time", "times")),
            },
            if self.dense_output { " (evaluated from the series of longer steps)" } else { "" },
            self.engine,
            self.asked
        )?;
        if let Some(part) = &self.part {
            let first = match part.first_body {
                0 => format!("the first {}", self.bodies),
                first => format!("bodies {first} to {}", (first + self.bodies).saturating_sub(1)),
            };
            let seconds =
                part.seconds.map_or(String::new(), |seconds| format!("; all are expected to take {seconds:.1e} s"));
            writeln!(formatter, "explained: {first} of the {bodies} bodies, which the tables count{seconds}")?;
        }
        if let Some(on_host) = &self.on_host {
            writeln!(formatter, "{on_host}")?;
        }
        if let Some(observed) = &self.observed {
            writeln!(formatter, "formed at each: {observed}")?;
        }
        self.sampled.iter().try_for_each(|sampled| writeln!(formatter, "sampled: {sampled}"))?;
        self.coupled.iter().try_for_each(|coupled| writeln!(formatter, "integrated: {coupled}"))?;
        writeln!(
            formatter,
            "
{:<12} {:>10}  {:<11} {:<24} {:<4} {:>8} {:>8} {:>8}  torques",
            "class", "bodies", "method", "steps min/median/max", "", "error", "seconds", "MiB"
        )?;
        for row in &self.classes {
            writeln!(formatter, "{row}")?;
        }
        if self.classes.iter().any(|row| row.steps.max > 0 && row.error.is_some() && row.pilot_bodies == 0) {
            writeln!(
                formatter,
                "no pilot: steps and errors of stepped bodies are estimates from a table, not tried on any body"
            )?;
        }
        for row in self.classes.iter().filter(|row| row.pilot_bodies > 0 && row.pilot_span < self.span) {
            writeln!(
                formatter,
                "{}: the pilot followed {} bodies for {:.3e} s of {:.3e} s; how errors grow later is estimated",
                row.class, row.pilot_bodies, row.pilot_span, self.span
            )?;
        }
        writeln!(
            formatter,
            "
{:<18} {:>10}  {:>9}  why",
            "skipped", "bodies", "bound rad"
        )?;
        for skip in &self.skips {
            let (name, reason) = (skip.name.name(), skip.name.reason());
            write!(formatter, "{name:<18} {:>10}  {:>9.1e}  {reason}", skip.bodies, skip.bound.attitude)?;
            if skip.bytes > 0 {
                let (bytes, bound) = (mebibytes(skip.bytes), skip.bound.energy);
                write!(formatter, "; {bytes} MiB stay, means are within {bound:.0e}")?;
            }
            writeln!(formatter)?;
        }
        if let Some(link) = &self.link {
            writeln!(formatter, "\n{link}")?;
        }
        writeln!(formatter, "\n{}", self.sample)?;
        if !self.statistics.is_empty() {
            let is_partial = self.classes.iter().any(|row| row.pilot_bodies > 0 && row.pilot_span < self.span);
            let part = if is_partial { " in the part of the span that was followed" } else { "" };
            writeln!(formatter, "\nerrors of statistics{part}, each at its worst time:")?;
            self.statistics.iter().try_for_each(|error| writeln!(formatter, "{error}"))?;
        }
        if let Some(tenth) = &self.tenth {
            writeln!(formatter, "\n{tenth}")?;
        }
        Ok(())
    }
}

impl fmt::Display for ClassRow {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let torques = if self.torques.is_empty() { "free".to_owned() } else { self.torques.join(" + ") };
        let moving = if self.translates { ", moving" } else { "" };
        let steps = if self.steps.max == 0 {
            "-".to_owned()
        } else {
            format!("{} / {} / {}", self.steps.min, self.steps.median, self.steps.max)
        };
        let error = self.error.map_or("-".to_owned(), |error| format!("{error:.1e}"));
        let seconds = self.seconds.map_or("-".to_owned(), |seconds| format!("{seconds:.1e}"));
        write!(
            formatter,
            "{:<12} {:>10}  {:<11} {:<24} {:<4} {:>8} {:>8} {:>8}  {torques}{moving}",
            self.class,
            self.bodies,
            self.method,
            steps,
            self.precision,
            error,
            seconds,
            mebibytes(self.bytes)
        )
    }
}

impl fmt::Display for LinkRow {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { bytes, seconds, read, read_seconds, wait } = *self;
        write!(formatter, "to the GPU: {} MiB, {seconds:.1e} s; ", mebibytes(bytes))?;
        if read > 0 {
            write!(formatter, "back: {} MiB at most, {read_seconds:.1e} s; ", mebibytes(read))?;
        }
        write!(formatter, "a wait for it takes {wait:.1e} s")
    }
}

impl fmt::Display for SampleRow {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.bodies == 0 {
            return formatter.write_str("recomputed after the run: no bodies, so that its errors will not be known");
        }
        let bodies = if self.bodies == 1 { "body" } else { "bodies" };
        let seconds = self.seconds.map_or(String::new(), |seconds| format!(", {seconds:.1e} s"));
        write!(formatter, "recomputed after the run, so that its errors are known: {} {bodies}{seconds}", self.bodies)
    }
}

impl fmt::Display for TenthRow {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = |seconds: Option<f64>| seconds.map_or(String::new(), |seconds| format!(", {seconds:.1e} s"));
        write!(
            formatter,
            "a tenth of the error: of the number of bodies by {} bodies{}; of the integration ",
            self.bodies,
            seconds(self.bodies_seconds)
        )?;
        match self.steps {
            Some(steps) => write!(formatter, "by {steps:.2} times the steps{}", seconds(self.steps_seconds)),
            None => write!(formatter, "by nothing: no steps are taken"),
        }
    }
}
