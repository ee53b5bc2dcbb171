//! The atlas of stability as maps, one panel for each method.

use super::figure::{Axis, Figure, Item, Line, Mark, Outline, Panel, Style};
use crate::bench::row::Row;
use crate::bench::stability::{Outcome, column, exponents};
use crate::kernel::method::Method;

/// Colour and mark of an outcome: dark and marked if states are not usable.
fn style(outcome: Outcome) -> Style {
    let (colour, mark) = match outcome {
        Outcome::OrderKept => ([255, 255, 255], None),
        Outcome::RandomWalk => ([222, 235, 247], Some((Outline::Circle, false))),
        Outcome::Linear => ([198, 219, 239], Some((Outline::Circle, true))),
        Outcome::Drifts => ([230, 159, 0], Some((Outline::Triangle, false))),
        Outcome::PhaseLost => ([240, 200, 120], Some((Outline::Diamond, false))),
        Outcome::FlipsWrongly => ([204, 121, 167], Some((Outline::Tip, true))),
        Outcome::Diverges => ([213, 94, 0], Some((Outline::Plus, true))),
        Outcome::Flagged => ([0, 158, 115], Some((Outline::Square, false))),
        Outcome::NotANumber => ([90, 90, 90], Some((Outline::Cross, true))),
    };
    let mark = mark.map(|(outline, filled)| Mark { outline, filled });
    Style { colour, line: Line::Solid, mark, width: 1 }
}

/// The most rows of a map that can be distinguished.
const MOST_ROWS: usize = 20;

/// The outcomes of the rows of [`crate::bench::stability`] of one engine in one precision.
pub fn stability(rows: &[Row], precision: &str) -> Figure {
    let note = "Free bodies that spin at 1 rad/s. Each row of a map is a ratio of the greatest to the least moment, for \
                directions of the spin drawn at random (generic) and next to the middle axis (by the distance from the \
                separatrix). Outcomes are defined in src/bench/stability.rs.";
    let title = format!("What becomes of free bodies, {precision}");
    let thinned = format!("Of more than {MOST_ROWS} such rows every so many-th is drawn; the table has all of them.");
    let mut figure = super::figure(&title, 3, &[note, &thinned], rows);
    let rows: Vec<&Row> = rows.iter().filter(|row| row.text("precision") == precision).collect();
    for method in Method::ALL {
        let mut rows: Vec<&Row> = rows.iter().copied().filter(|row| row.text("method") == method.name()).collect();
        let Some(first) = rows.first() else { continue };
        let exponents = exponents(first);
        rows.sort_by(|a, b| {
            a.text("place").cmp(&b.text("place")).then(a.number("ratio").total_cmp(&b.number("ratio")))
        });
        let every = rows.len().div_ceil(MOST_ROWS).max(1);
        let rows: Vec<&Row> = rows.into_iter().step_by(every).collect();
        let mut items = Vec::new();
        for (y, row) in rows.iter().enumerate() {
            let outcomes: Vec<Option<Outcome>> =
                exponents.iter().map(|exponent| Outcome::from_name(&row.text(&column("outcome", *exponent)))).collect();
            let (mut start, y) = (0, y as f64);
            for alike in outcomes.chunk_by(|a, b| a == b) {
                let (low, high) = (start as f64 - 0.5, (start + alike.len()) as f64 - 0.5);
                start += alike.len();
                let Some(outcome) = alike[0] else { continue };
                let style = style(outcome);
                items.push(Item::Bar { low: (low, y - 0.5), high: (high, y + 0.5), style });
                let black = Style { colour: [0, 0, 0], ..style };
                let marks = (0..alike.len())
                    .map(|cell| Item::Curve { points: vec![(low + 0.5 + cell as f64, y)], style: black });
                items.extend(marks);
            }
        }
        let names =
            |row: &&Row| format!("{} {:e}", row.text("place").replace("separatrix", "sep."), row.number("ratio"));
        figure.panels.push(Panel {
            title: method.name().to_owned(),
            x: Axis::names("omega dt, power of ten", exponents.iter().map(f64::to_string).collect()),
            y: Axis::names("place, ratio", rows.iter().map(names).collect()),
            items,
            equal: false,
        });
    }
    figure.legend = Outcome::ALL
        .into_iter()
        .map(|outcome| {
            let style = style(outcome);
            // White needs a border, which a line does not have.
            let colour = if outcome == Outcome::OrderKept { [200, 200, 200] } else { style.colour };
            (outcome.name().to_owned(), Style { colour, width: 6, ..style })
        })
        .collect();
    figure
}
