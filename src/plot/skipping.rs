//! What skipping saves, as bars.

use super::figure::{Axis, BLUE, Figure, GREY, Item, Line, Panel, Style, VERMILION};
use crate::bench::row::Row;

const WITH: Style = Style { colour: BLUE, line: Line::Solid, mark: None, width: 5 };
const WITHOUT: Style = Style { colour: VERMILION, line: Line::Dashed, mark: None, width: 1 };

/// Time, bytes and change of the result with and without each skip, from the rows of [`crate::bench::skipping`] of one engine.
pub fn skipping(rows: &[Row]) -> Figure {
    let note = "Each scene is made so that one skip matters in it. The other run is without skipping, or of a scene that takes \
                work which the first leaves out. Time: set-up, upload, integration and reading back. Bytes: columns given \
                to the engine and states read back; no bar where there are none.";
    let mut figure = super::figure("What skipping saves", 2, &[note], rows);
    let rows: Vec<&Row> = rows.iter().rev().filter(|row| row.flag("valid")).collect();
    let names = || Axis::names("skip", rows.iter().map(|row| row.text("skip")).collect());
    let pairs =
        [("wall time (s)", "seconds_with", "seconds_without"), ("bytes moved (B)", "bytes_with", "bytes_without")];
    for (label, with, without) in pairs {
        let foot = foot(rows.iter().flat_map(|row| [row.number(with), row.number(without)]));
        let bars = rows.iter().enumerate().flat_map(|(index, row)| {
            let middle = index as f64;
            [bar(foot, row.number(without), middle - 0.4, WITHOUT), bar(foot, row.number(with), middle, WITH)]
        });
        let items = bars.flatten().collect();
        figure.panels.push(Panel { title: label.to_owned(), x: Axis::log(label), y: names(), items, equal: false });
    }
    let foot = foot(rows.iter().map(|row| row.number("difference_rad_p99")));
    let mut items: Vec<Item> = rows
        .iter()
        .enumerate()
        .filter_map(|(index, row)| bar(foot, row.number("difference_rad_p99"), index as f64 - 0.2, WITH))
        .collect();
    let asked = rows.first().map_or(f64::NAN, |row| row.number("tolerance_rad"));
    let ends = vec![(asked, -0.5), (asked, rows.len() as f64 - 0.5)];
    items.push(Item::Curve { points: ends, style: ASKED });
    figure.panels.push(Panel {
        title: "difference of the ends".to_owned(),
        x: Axis::log("attitude, 99th percentile (rad)"),
        y: names(),
        items,
        equal: false,
    });
    figure.legend = vec![
        ("with the skip".to_owned(), WITH),
        ("without".to_owned(), WITHOUT),
        ("error asked for".to_owned(), ASKED),
    ];
    figure
}

const ASKED: Style = Style { colour: GREY, line: Line::Dotted, mark: None, width: 2 };

/// The foot of the bars on a logarithmic axis: below the least of the positive numbers.
fn foot(values: impl Iterator<Item = f64>) -> f64 {
    0.3 * values.filter(|value| *value > 0.0 && value.is_finite()).fold(f64::INFINITY, f64::min)
}

fn bar(foot: f64, value: f64, from: f64, style: Style) -> Option<Item> {
    (value > 0.0).then_some(Item::Bar { low: (foot, from), high: (value, from + 0.4), style })
}
