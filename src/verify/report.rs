//! The result of a comparison, as text and as JSON.

use std::fmt;
use std::ops::Range;

use super::compare::{Comparison, Field, Largest, Parting};
use super::culprit::Culprit;
use crate::kernel::free_motion::SetUp;
use crate::plan::Treatment;

/// The result of [`super::verify`].
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// The engine under test.
    pub engine: String,
    /// Bodies that were compared.
    pub bodies: usize,
    /// The groups of the plan that hold them.
    pub groups: Vec<GroupReport>,
    /// What a run does that is not compared.
    pub not_compared: Vec<String>,
}

/// The result for the bodies of one group.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupReport {
    /// The bodies' class.
    pub shape: &'static str,
    /// Bodies that were compared.
    pub bodies: usize,
    /// How their motion is found.
    pub treatment: Treatment,
    /// The torques that act on them.
    pub torques: Vec<String>,
    /// The names of all torques of the scene, by their indices.
    pub torque_names: Vec<String>,
    /// The steps that were compared, numbered from 0: equal steps, rounds of attempts, or output times.
    pub steps: Range<u64>,
    /// Number of steps in all; for attempts as many as were made.
    pub total: u64,
    /// The sides.
    pub comparisons: Vec<Comparison>,
    /// Notes on what was not compared, and how the rest was.
    pub notes: Vec<String>,
}

/// The conclusion of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Every side was compared with bounds, and no difference exceeds its own.
    Agree,
    /// A difference exceeds its bound.
    Part,
    /// No difference exceeds a bound, but on some side no state was compared with one: no bound is known, or the bodies are lost.
    NotDecided,
    /// There was no state to compare, or both sides had lost every one.
    NothingCompared,
}

impl Verdict {
    /// The description in words.
    pub fn in_words(self) -> &'static str {
        match self {
            Verdict::Agree => "they agree",
            Verdict::Part => "THEY DO NOT AGREE",
            Verdict::NotDecided => "not decided: a side has no state that was held against a bound",
            Verdict::NothingCompared => "nothing was compared",
        }
    }
}

impl Report {
    /// The conclusion.
    pub fn verdict(&self) -> Verdict {
        let states: u64 = self.judged().map(|comparison| comparison.decided + comparison.undecided).sum();
        if self.parting().is_some() {
            Verdict::Part
        } else if states == 0 {
            Verdict::NothingCompared
        } else if self.judged().all(Comparison::decides) {
            Verdict::Agree
        } else {
            Verdict::NotDecided
        }
    }

    /// Whether states were compared, on every side some with a bound, and none parted from the twin's by more than that.
    pub fn agrees(&self) -> bool {
        self.verdict() == Verdict::Agree
    }

    /// The first difference beyond its bound.
    pub fn parting(&self) -> Option<&Parting> {
        self.judged().find_map(|comparison| comparison.parting.as_ref())
    }

    /// Numbers that were compared and judged.
    pub fn compared(&self) -> u64 {
        self.judged().map(|comparison| comparison.compared).sum()
    }

    /// The largest ratio of any difference to its bound.
    pub fn largest_part(&self) -> f64 {
        self.judged()
            .flat_map(|comparison| &comparison.largest)
            .filter_map(|largest| largest.of_bound)
            .fold(0.0, f64::max)
    }

    fn judged(&self) -> impl Iterator<Item = &Comparison> {
        self.groups.iter().flat_map(|group| &group.comparisons).filter(|comparison| comparison.judged)
    }
}

impl GroupReport {
    /// How the bodies move, in words.
    fn treatment_in_words(&self) -> String {
        match self.treatment {
            Treatment::RegularPrecession => "two uniform rotations, f64 on the host".to_owned(),
            Treatment::ClosedForm { precision, set_up } => {
                let words = if set_up == SetUp::OneWord { ", constants in one word" } else { "" };
                format!("closed form in {precision}{words}")
            }
            Treatment::Stepped { method, precision, longest_step, projected } => {
                let projected = if projected { ", projected" } else { "" };
                format!("{method} in {precision}, steps of {longest_step:.3e} s at most{projected}")
            }
            Treatment::Adaptive { method, precision, steps } => {
                format!("adaptive {method} in {precision}, tolerance {:e}", steps.tolerance)
            }
        }
    }

    /// The name of its steps.
    fn unit(&self) -> &'static str {
        match self.treatment {
            Treatment::RegularPrecession | Treatment::ClosedForm { .. } => "output times",
            Treatment::Stepped { .. } => "steps",
            Treatment::Adaptive { .. } => "rounds of attempts",
        }
    }

    /// The torque that causes a difference, in words; empty if it was not sought.
    pub(crate) fn blame(&self, culprit: &Culprit) -> String {
        let named = |torques: &[usize]| {
            torques.iter().map(|&torque| self.torque_names[torque].clone()).collect::<Vec<_>>().join(", ")
        };
        match culprit {
            Culprit::NotSought => String::new(),
            Culprit::Method => {
                "the sides part without any torque: it is the method, or the motion of a free body".into()
            }
            Culprit::Projection => "the sides agree without the projection: it comes from that".into(),
            Culprit::Torques(torques) => format!("it comes from {}, which parts alone", named(torques)),
            Culprit::OnlyTogetherWith(torques) => format!("no torque parts alone; none do without {}", named(torques)),
            Culprit::Together => "no torque parts alone, and none can be left out: it is their sum".into(),
        }
    }
}

impl fmt::Display for GroupReport {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let torques = if self.torques.is_empty() { String::new() } else { format!("; {}", self.torques.join(", ")) };
        writeln!(formatter, "{} {}, {}{torques}", self.bodies, self.shape, self.treatment_in_words())?;
        let Range { start, end } = self.steps;
        match (self.steps.is_empty(), self.treatment) {
            (true, _) => writeln!(formatter, "  nothing compared: there are {} {}", self.total, self.unit())?,
            (false, Treatment::Adaptive { .. }) => {
                writeln!(formatter, "  {} {} to {end}", self.unit(), start + 1)?;
            }
            (false, _) => writeln!(formatter, "  {} {} to {end} of {}", self.unit(), start + 1, self.total)?,
        }
        for comparison in &self.comparisons {
            self.write_comparison(comparison, formatter)?;
        }
        self.notes.iter().try_for_each(|note| writeln!(formatter, "  {note}"))
    }
}

impl GroupReport {
    fn write_comparison(&self, comparison: &Comparison, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [side, other] = &comparison.sides;
        let judged = if comparison.judged { "" } else { " (not judged)" };
        writeln!(formatter, "  {side} against {other}{judged}: {} numbers", comparison.compared)?;
        for largest in &comparison.largest {
            let Largest { field, difference, ulps, of_bound, body, step } = *largest;
            let name = field.name();
            if difference == 0.0 {
                writeln!(formatter, "    {name:<24} equal")?;
                continue;
            }
            // The controller's numbers differ by the roundings of an estimate, not by their own.
            let is_vector = matches!(field, Field::Orientation | Field::Norm | Field::AngularMomentum);
            let ulps = if is_vector { format!(", {ulps:.2} ulps") } else { String::new() };
            let of_bound = of_bound
                .filter(|_| comparison.judged)
                .map_or(String::new(), |part| format!(", {part:.3} of the bound"));
            writeln!(formatter, "    {name:<24} {difference:.1e} at most{ulps}{of_bound} (body {body}, step {step})")?;
        }
        if comparison.undecided > 0 && comparison.judged {
            let undecided = comparison.undecided;
            writeln!(formatter, "    {undecided} steps of a body without a bound, in which only NaN would be noticed")?;
        }
        if comparison.lost > 0 {
            let lost = comparison.lost;
            writeln!(
                formatter,
                "    {lost} steps after which the body is lost to infinity: nothing of it is compared"
            )?;
        }
        if let Some(parting) = &comparison.parting {
            let Parting { step, time, body, field, component, found, expected, difference, bound, .. } = parting;
            let Parting { culprit, onset, stage, .. } = parting;
            let component = if component.is_empty() { String::new() } else { format!(" {component}") };
            let name = field.name();
            writeln!(formatter, "    THEY PART at step {step} (t = {time:e} s), body {body}: {name}{component}")?;
            writeln!(formatter, "      {found:e}, {expected:e} expected: {difference:.3e} apart, {bound:.3e} allowed")?;
            let blame = self.blame(culprit);
            if !blame.is_empty() {
                writeln!(formatter, "      {blame}")?;
            }
            let onset = onset.in_words();
            if !onset.is_empty() {
                writeln!(formatter, "      {onset}")?;
            }
            let stage = stage.map_or_else(|none| none.in_words().to_owned(), super::Stage::in_words);
            if !stage.is_empty() {
                writeln!(formatter, "      {stage}")?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for Report {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bodies = if self.bodies == 1 { "1 body".to_owned() } else { format!("{} bodies", self.bodies) };
        writeln!(
            formatter,
            "{bodies} on {}, as planned; states in principal axes, each body in its own units\n",
            self.engine
        )?;
        for group in &self.groups {
            writeln!(formatter, "{group}")?;
        }
        for left in &self.not_compared {
            writeln!(formatter, "not compared: {left}")?;
        }
        writeln!(formatter, "verdict: {}", self.verdict().in_words())
    }
}

#[cfg(feature = "study")]
impl Report {
    /// The report as JSON.
    pub fn to_json(&self) -> String {
        use serde_json::json;
        let comparison = |group: &GroupReport, comparison: &Comparison| {
            let largest: Vec<_> = comparison
                .largest
                .iter()
                .map(|largest| {
                    json!({
                        "field": largest.field.name(), "difference": largest.difference, "ulps": largest.ulps,
                        "of_bound": largest.of_bound, "body": largest.body, "step": largest.step,
                    })
                })
                .collect();
            let parting = comparison.parting.as_ref().map(|parting| {
                let torques = match &parting.culprit {
                    Culprit::Torques(torques) | Culprit::OnlyTogetherWith(torques) => torques.clone(),
                    _ => Vec::new(),
                };
                let no_stage = parting.stage.err().map(super::NoStage::in_words);
                let stage = parting.stage.ok().map(|stage| {
                    json!({
                        "number": stage.number, "of": stage.of, "is_stage": stage.is_stage,
                        "term": stage.term.name(), "words": stage.in_words(),
                    })
                });
                json!({
                    "step": parting.step, "time": parting.time, "body": parting.body, "field": parting.field.name(),
                    "component": parting.component, "found": parting.found, "expected": parting.expected,
                    "difference": parting.difference, "bound": parting.bound, "torques": torques,
                    "blame": group.blame(&parting.culprit), "onset": parting.onset.in_words(),
                    "stage": stage, "no_stage": no_stage,
                })
            });
            json!({
                "sides": comparison.sides, "judged": comparison.judged, "compared": comparison.compared,
                "decided": comparison.decided, "undecided": comparison.undecided, "lost": comparison.lost, "largest": largest, "parting": parting,
            })
        };
        let group = |group: &GroupReport| {
            let comparisons: Vec<_> = group.comparisons.iter().map(|one| comparison(group, one)).collect();
            json!({
                "class": group.shape, "bodies": group.bodies, "treatment": group.treatment_in_words(),
                "torques": group.torques, "unit": group.unit(), "first": group.steps.start + 1, "last": group.steps.end,
                "comparisons": comparisons, "notes": group.notes,
            })
        };
        let groups: Vec<_> = self.groups.iter().map(group).collect();
        let value = json!({
            "engine": self.engine, "bodies": self.bodies, "agrees": self.agrees(), "verdict": self.verdict().in_words(), "compared": self.compared(),
            "groups": groups, "not_compared": self.not_compared,
        });
        format!("{value:#}\n")
    }
}
