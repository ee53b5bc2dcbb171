//! The table `[time]` of a study.

use super::reader::Node;
use crate::error::Result;
use crate::scene::Outputs;

/// The end, the output times, and whether the start is one of them.
pub(super) fn time(node: &Node<'_>) -> Result<(f64, Outputs, bool)> {
    let table = node.table("expected a table [time]", &["end", "outputs"])?;
    let end = table.need("end", "expected the end of the simulated span (s)")?;
    let end = end.quantity("s", "expected a finite number (s)")?;
    let Some(outputs) = table.find("outputs") else {
        return Ok((end, Outputs::End, false));
    };
    const EXPECTED: &str =
        "expected { every = seconds } or { times = [seconds, ...] }, with start = true for the start too";
    let table = outputs.table(EXPECTED, &["every", "times", "start"])?;
    table.exclusive("every", "times")?;
    let starts = table.find("start").map(|node| node.boolean("expected true or false")).transpose()? == Some(true);
    if let Some(every) = table.find("every") {
        return Ok((end, Outputs::Every(every.positive_quantity("s", "expected an interval above zero (s)")?), starts));
    }
    let Some(times) = table.find("times") else {
        return if starts { Ok((end, Outputs::End, true)) } else { Err(outputs.refuse(EXPECTED)) };
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
    Ok((end, Outputs::Times(list), starts))
}
