//! Throughput curves, with the machine's ceilings.

use super::figure::{Axis, Figure, GREY, Item, Line, Panel, Style};
use crate::bench::row::Row;

/// The phases of a run, with the columns of their wall times.
const PHASES: [(&str, &str); 5] = [
    ("set-up", "prepare_seconds"),
    ("start (upload)", "start_seconds"),
    ("compute", "compute_seconds_median"),
    ("read back", "read_seconds"),
    ("write", "write_seconds"),
];

/// Rate against bodies, steps per dispatch, outputs and cores, and wall time by phase against outputs, from the rows of
/// [`crate::bench::throughput`] of one engine.
pub fn throughput(rows: &[Row]) -> Figure {
    let notes =
        ["rk4 on free bodies. The grey lines are the ceiling: multiply-adds measured on the same engine, divided by \
                  the operations of a step (unbroken f64, dotted f32)."];
    let mut figure = super::figure("Throughput", 4, &notes, rows);
    let mut legend: Vec<(String, Style)> = Vec::new();
    for (index, precision) in ["f64", "f32"].into_iter().enumerate() {
        legend.push((format!("{precision}, measured"), style(index)));
        legend.push((format!("{precision}, ceiling"), ceiling_style(index)));
    }
    let axes = [
        ("bodies", "bodies"),
        ("steps-per-dispatch", "steps per dispatch"),
        ("cores", "threads"),
        ("outputs", "outputs of a run of 1024 steps"),
    ];
    for (axis, label) in axes {
        let mut items = Vec::new();
        for (index, precision) in ["f64", "f32"].into_iter().enumerate() {
            let of_axis: Vec<&Row> = sorted(rows, axis, precision);
            let rate = |row: &&Row| (row.number("amount"), row.number("body_steps_per_second"));
            let most = |row: &&Row| {
                let ceiling = row.number("body_steps_per_second") / row.number("part_of_flops");
                (row.number("amount"), ceiling)
            };
            if !of_axis.is_empty() {
                items.push(Item::Curve { points: of_axis.iter().map(most).collect(), style: ceiling_style(index) });
                items.push(Item::Curve { points: of_axis.iter().map(rate).collect(), style: style(index) });
            }
        }
        if !items.is_empty() {
            let y = Axis::log("body-steps per second (1/s)");
            let x = if axis == "cores" { Axis::linear(label) } else { Axis::log(label) };
            figure.panels.push(Panel { title: format!("against {label}"), x, y, items, equal: false });
        }
    }
    for precision in ["f64", "f32"] {
        let of_axis = sorted(rows, "outputs", precision);
        if of_axis.is_empty() {
            continue;
        }
        let items = PHASES.iter().enumerate().map(|(index, (_, column))| {
            let points = of_axis.iter().map(|row| (row.number("amount"), row.number(column))).collect();
            Item::Curve { points, style: Style::nth(index + 2) }
        });
        figure.panels.push(Panel {
            title: format!("wall time by phase, {precision}"),
            x: Axis::log("outputs of a run of 1024 steps"),
            y: Axis::log("wall time (s)"),
            items: items.collect(),
            equal: false,
        });
    }
    legend.extend(PHASES.iter().enumerate().map(|(index, (name, _))| ((*name).to_owned(), Style::nth(index + 2))));
    figure.legend = legend;
    figure
}

fn style(index: usize) -> Style {
    if index == 0 { Style::nth(4) } else { Style::nth(5).hollow() }
}

fn ceiling_style(index: usize) -> Style {
    Style::line(GREY, if index == 0 { Line::Solid } else { Line::Dotted })
}

fn sorted<'a>(rows: &'a [Row], axis: &str, precision: &str) -> Vec<&'a Row> {
    let mut found: Vec<&Row> = rows
        .iter()
        .filter(|row| row.text("axis") == axis && row.text("precision") == precision && row.flag("valid"))
        .collect();
    found.sort_by(|a, b| a.number("amount").total_cmp(&b.number("amount")));
    found
}
