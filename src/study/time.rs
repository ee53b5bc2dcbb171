//! The table `[time]` of a study.

use super::reader::Node;
use crate::error::{Error, Result};
use crate::scene::Outputs;

/// `[time]`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct StudyTime {
    /// The end, s.
    pub end: f64,
    pub outputs: Outputs,
    /// Whether the start is an output too.
    pub starts: bool,
    /// The time between two checks for events, s, beside those at outputs.
    pub checks: Option<f64>,
}

/// Reads the table.
pub(super) fn time(node: &Node<'_>) -> Result<StudyTime> {
    let table = node.table("expected a table [time]", &["end", "outputs", "checks"])?;
    let end = table.need("end", "expected the end of the simulated span (s)")?;
    let end = end.quantity("s", "expected a finite number (s)")?;
    let checks = table.find("checks").map(|node| checks(&node)).transpose()?;
    let (outputs, starts) = table.find("outputs").map_or(Ok((Outputs::End, false)), |node| outputs(&node, end))?;
    Ok(StudyTime { end, outputs, starts, checks })
}

/// Refuses checks where no event is sought.
pub(super) fn refuse_checks(node: &Node<'_>) -> Error {
    let checks = node.any_table().and_then(|table| table.find("checks"));
    checks.as_ref().unwrap_or(node).refuse("expected an [[event]] too: checks seek events between outputs")
}

/// `checks = { every = 1.0 }`.
fn checks(node: &Node<'_>) -> Result<f64> {
    const EXPECTED: &str = "expected { every = seconds }, the time between two checks for events";
    let table = node.table(EXPECTED, &["every"])?;
    table.need("every", EXPECTED)?.positive_quantity("s", "expected an interval above zero (s)")
}

/// The output times, and whether the start is one of them.
fn outputs(outputs: &Node<'_>, end: f64) -> Result<(Outputs, bool)> {
    const EXPECTED: &str =
        "expected { every = seconds } or { times = [seconds, ...] }, with start = true for the start too";
    let table = outputs.table(EXPECTED, &["every", "times", "start"])?;
    table.exclusive("every", "times")?;
    let starts = table.find("start").map(|node| node.boolean("expected true or false")).transpose()? == Some(true);
    if let Some(every) = table.find("every") {
        let interval = every.positive_quantity("s", "expected an interval above zero (s)")?;
        // An end that is not valid is refused as that.
        if end > 0.0 && interval > end {
            return Err(every.refuse("expected an interval up to time.end (s)"));
        }
        return Ok((Outputs::Every(interval), starts));
    }
    let Some(times) = table.find("times") else {
        return if starts { Ok((Outputs::End, true)) } else { Err(outputs.refuse(EXPECTED)) };
    };
    const TIMES: &str = "expected a list of finite numbers (s)";
    let elements = times.elements().ok_or_else(|| times.refuse(TIMES))?;
    let mut list: Vec<f64> = Vec::with_capacity(elements.len());
    for element in elements {
        let time = element.quantity("s", TIMES)?;
        if list.last().is_some_and(|last| time <= *last) {
            return Err(element.refuse("expected increasing times: this one is not after the one before it (s)"));
        }
        if !(0.0..=end).contains(&time) {
            return Err(element.refuse("expected times from 0 to time.end (s)"));
        }
        list.push(time);
    }
    Ok((Outputs::Times(list), starts))
}
