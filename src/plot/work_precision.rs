//! Work-precision diagrams: time against error, a panel for each problem.

use super::figure::{Axis, Figure, GREY, Item, Line, Mark, Outline, Panel, Style};
use crate::bench::accuracy::point;
use crate::bench::front::{Point, pareto};
use crate::bench::problem::NAMES;
use crate::bench::row::Row;
use crate::kernel::method::Method;
use crate::plan::ADAPTIVE;

/// The methods in the order of the legend: first those drawn in colour, then the baselines in grey.
fn methods() -> Vec<(String, Style)> {
    let (baselines, proper): (Vec<Method>, Vec<Method>) =
        Method::ALL.into_iter().partition(|method| method.properties().baseline);
    let coloured = proper.iter().map(|method| method.name()).chain([ADAPTIVE, "closed form", "chosen"]);
    let coloured = coloured.enumerate().map(|(index, name)| (name.to_owned(), Style::nth(index)));
    let grey = baselines.iter().enumerate().map(|(index, method)| {
        let style = Style { colour: GREY, ..Style::nth(index + 1) };
        (method.name().to_owned(), style)
    });
    coloured.chain(grey).collect()
}

/// The style of points that failed their check.
const FAILED: Style = Style {
    colour: [200, 200, 200],
    line: Line::None,
    mark: Some(Mark { outline: Outline::Cross, filled: false }),
    width: 1,
};

/// The Pareto front.
const FRONT: Style = Style { colour: [240, 228, 66], line: Line::Solid, mark: None, width: 7 };

/// The work-precision diagram of rows of [`crate::bench::accuracy`] for one engine.
pub(crate) fn work_precision(rows: &[Row]) -> Figure {
    let bodies = rows.first().map_or(0.0, |row| row.number("bodies"));
    let title = format!("Work and precision, {bodies} bodies: time of the compute phase against attitude error");
    let notes = [
        "Filled marks and unbroken lines: f64, or precision chosen by the library; hollow and dashed: f32. Grey crosses \
         failed their check (an error above 0.1 rad or above the one asked for); rows with failed bodies are not drawn. Band: Pareto front.",
    ];
    let mut figure = super::figure(&title, 4, &notes, rows);
    let methods = methods();
    figure.panels = NAMES
        .into_iter()
        .map(|problem| (problem, rows.iter().filter(|row| row.text("problem") == problem).collect::<Vec<_>>()))
        .filter(|(_, rows)| !rows.is_empty())
        .map(|(problem, rows)| panel(problem, &rows, &methods))
        .collect();
    figure.legend = methods;
    figure.legend.push(("failed its check".to_owned(), FAILED));
    figure.legend.push(("Pareto front".to_owned(), FRONT));
    figure
}

fn panel(problem: &str, rows: &[&Row], methods: &[(String, Style)]) -> Panel {
    let points: Vec<Point> = rows.iter().map(|row| point(row)).collect();
    let place = |index: usize| (points[index].error, points[index].seconds);
    let mut items = vec![Item::Curve { points: pareto(&points).into_iter().map(place).collect(), style: FRONT }];
    // If bodies failed, the error is that of the others and says nothing.
    let whole = |index: usize| rows[index].number("failed_bodies") == 0.0 && points[index].error.is_finite();
    let failed = (0..rows.len()).filter(|&index| !points[index].valid && whole(index));
    items.push(Item::Curve { points: failed.map(place).collect(), style: FAILED });
    for (method, style) in methods.iter().rev() {
        for precision in ["f64", "f32", "chosen"] {
            let of_method = (0..rows.len()).filter(|&index| {
                points[index].valid
                    && rows[index].text("method") == *method
                    && rows[index].text("precision") == precision
            });
            let style = if precision == "f32" { style.hollow() } else { *style };
            let points: Vec<(f64, f64)> = of_method.map(place).collect();
            if !points.is_empty() {
                items.push(Item::Curve { points, style });
            }
        }
    }
    let span = rows.first().map_or(0.0, |row| row.number("span_s"));
    Panel {
        title: format!("{problem}, {span} s"),
        x: Axis::log("attitude error, 99th percentile (rad)"),
        y: Axis::log("compute time (s)"),
        items,
        equal: false,
    }
}
