//! Pictures of a run: the ensemble over time, and chosen bodies.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DMat3, DVec3};

use super::figure::{Axis, BLACK, BLUE, Figure, GREEN, GREY, Item, Line, Panel, Style, VERMILION};
use super::scale::extent;
use super::snapshots::{Moment, Snapshots, State, each};
use super::time::{TimeUnit, over_time};
use crate::error::{Error, FileAction, Result};
use crate::record::{REPORT, StateTable};
use crate::scene::Quantity;

/// Number of bars of a histogram.
const BARS: usize = 30;

/// The pictures of the run in `folder` with snapshots at `path`, with names for files: the ensemble, and each of the `bodies`.
pub(super) fn run(folder: &Path, path: &Path, bodies: &[usize]) -> Result<Vec<(String, Figure)>> {
    let snapshots = Snapshots::read(path, bodies)?;
    let (caption, conserved) = (caption(folder)?, Conserved::read(folder)?);
    let title = titled(folder, &format!("A run of {}", counted(snapshots.bodies as u64)))?;
    let mut figures = vec![("run".to_owned(), ensemble(&snapshots, title, &caption, conserved))];
    for (body, track) in &snapshots.tracks {
        let title = titled(folder, &format!("Body {body}"))?;
        figures.push((format!("run-body-{body}"), of_body((*body, title), track, &caption)));
    }
    Ok(figures)
}

pub(super) fn report(folder: &Path) -> Result<serde_json::Value> {
    let path = folder.join(REPORT);
    let text = std::fs::read_to_string(&path).map_err(|error| Error::file(&path, FileAction::Read, &error))?;
    serde_json::from_str(&text).map_err(|error| Error::Rows {
        path: path.clone(),
        fault: crate::error::RowFault::Csv(format!("is no report: {error}")),
    })
}

/// What all bodies of a run conserve. The table of snapshots does not say which bodies are driven, so no drift is drawn for an ensemble of
/// both kinds.
#[derive(Clone, Copy, Debug)]
struct Conserved {
    kinetic_energy: bool,
    angular_momentum: bool,
}

impl Conserved {
    fn read(folder: &Path) -> Result<Self> {
        let drift = &report(folder)?["drift"];
        let by_all = |key: &str| drift[key].as_u64().is_some_and(|bodies| bodies > 0 && drift["bodies"] == bodies);
        Ok(Self {
            kinetic_energy: by_all("kinetic_energy_bodies"),
            angular_momentum: by_all("angular_momentum_bodies"),
        })
    }
}

fn counted(bodies: u64) -> String {
    if bodies == 1 { "1 body".to_owned() } else { format!("{bodies} bodies") }
}

/// The engine, from the report.
fn caption(folder: &Path) -> Result<Vec<String>> {
    let report = report(folder)?;
    let word = |value: &serde_json::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let span = report["span"].as_f64().unwrap_or(0.0);
    let software = if report["engine"]["software"] == true { ", a SOFTWARE adapter" } else { "" };
    let study = report["study"]["file"].as_str().map_or("polhode run".to_owned(), |file| format!("polhode run {file}"));
    let commit =
        crate::bench::provenance::commit().map_or("unknown".to_owned(), |commit| commit.chars().take(12).collect());
    Ok(vec![
        format!(
            "{study}; {}, {}; {} in {}, {}{software}; polhode {}, {}; drawn at commit {commit}",
            counted(report["bodies"].as_u64().unwrap_or(0)),
            TimeUnit::of(span).text(span),
            word(&report["plan"]["method"]),
            word(&report["plan"]["precision"]),
            word(&report["engine"]["adapter"]),
            word(&report["versions"]["polhode"]),
            word(&report["versions"]["platform"]),
        ),
        "Drift and energies are relative to each body's first recorded state; bodies that failed are left out, and so is the drift \
         of what torques change."
            .to_owned(),
    ])
}

/// A picture's title: the study's own, if it has one, and what is shown.
fn titled(folder: &Path, shown: &str) -> Result<String> {
    let report = report(folder)?;
    let title = report["study"]["title"].as_str().map(|title| title.replace(char::is_control, " "));
    Ok(title.map_or_else(|| shown.to_owned(), |title| format!("{title}: {}", lower_case(shown))))
}

/// A picture with the title of [`titled`] and the engine below.
pub(super) fn figure(
    folder: &Path,
    shown: &str,
    panels: Vec<Panel>,
    columns: usize,
    legend: Vec<(String, Style)>,
) -> Result<Figure> {
    let caption = caption(folder)?.into_iter().take(1).collect();
    Ok(Figure { title: titled(folder, shown)?, caption, panels, columns, legend })
}

fn lower_case(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_lowercase().chain(letters).collect())
}

/// What an axis shows, with its unit if that is known.
pub(super) fn named(label: &str, unit: Option<impl std::fmt::Display>) -> String {
    unit.map_or_else(|| label.to_owned(), |unit| format!("{label} ({unit})"))
}

/// The units of a study's quantities, from the report.
pub(super) fn units(folder: &Path) -> Result<BTreeMap<String, String>> {
    let report = report(folder)?;
    let text = |value: &serde_json::Value| value.as_str().map(str::to_owned);
    let known = Quantity::NAMED.iter().map(|quantity| (quantity.name().to_owned(), quantity.unit().to_owned()));
    let mut units: BTreeMap<String, String> = known.collect();
    for quantity in report["quantities"].as_array().into_iter().flatten() {
        units.extend(text(&quantity["name"]).zip(text(&quantity["unit"])));
    }
    Ok(units)
}

/// Spin rate, energy and nutation of all bodies at the end, from the states at `path` of the run in `folder`.
pub(super) fn last(folder: &Path, path: &Path) -> Result<Figure> {
    let mut values: [Vec<f64>; 3] = Default::default();
    each(&mut StateTable::open(path)?, |row| {
        let state = State::of(row);
        let momentum = state.orientation.conjugate() * state.angular_momentum_world;
        let angle = state.angular_velocity_body.angle_between(momentum);
        let own = [state.angular_velocity_body.length(), state.kinetic_energy, angle.to_degrees()];
        values.iter_mut().zip(own).filter(|(_, value)| value.is_finite()).for_each(|(all, value)| all.push(value));
    })?;
    let labels = [
        ("spin rate", "|\u{3c9}| (rad/s)"),
        ("kinetic energy", "T (J)"),
        ("angle between \u{3c9} and L", "nutation (°)"),
    ];
    let panel = |((title, label), values): (&(&str, &str), &Vec<f64>)| Panel {
        title: (*title).to_owned(),
        x: Axis::linear(label),
        y: Axis { include: vec![0.0], ..Axis::linear("bodies") },
        items: bars(values, extent(values.iter().copied()), LAST),
        equal: false,
    };
    figure(folder, "All bodies at the end", labels.iter().zip(&values).map(panel).collect(), 3, Vec::new())
}

fn ensemble(snapshots: &Snapshots, title: String, caption: &[String], conserved: Conserved) -> Figure {
    let moments = &snapshots.moments;
    let curve = |value: &dyn Fn(&Moment) -> f64, style| Item::Curve {
        points: moments.iter().map(|moment| (moment.time, value(moment))).collect(),
        style,
    };
    let drift = |title: &str, label: &str, of: &dyn Fn(&Moment) -> [f64; 3]| {
        let curves = DRIFT.iter().enumerate();
        let curves = curves.map(|(index, (_, style))| curve(&|moment| of(moment)[index], *style)).collect();
        over_time(title.to_owned(), Axis::log(label), curves)
    };
    let bands = |title: &str, label: &str, of: &dyn Fn(&Moment) -> [f64; 5]| {
        let band = |low: usize, high: usize, style| Item::Band {
            points: moments.iter().map(|moment| (moment.time, of(moment)[low], of(moment)[high])).collect(),
            style,
        };
        let items = vec![
            band(0, 4, OUTER),
            band(1, 3, INNER),
            curve(&|moment| of(moment)[0], EDGE),
            curve(&|moment| of(moment)[4], EDGE),
            curve(&|moment| of(moment)[2], MEDIAN),
        ];
        over_time(title.to_owned(), Axis::linear(label), items)
    };
    let mut panels = Vec::new();
    if conserved.kinetic_energy {
        let label = "|T \u{2212} T\u{2080}| / T\u{2080}";
        panels.push(drift("drift of the kinetic energy", label, &|moment| moment.energy_drift));
    }
    if conserved.angular_momentum {
        let label = "|L \u{2212} L\u{2080}| / |L\u{2080}|";
        panels.push(drift("drift of the angular momentum", label, &|moment| moment.momentum_drift));
    }
    let is_drawn: &[_] = if panels.is_empty() { &[] } else { &DRIFT };
    panels.push(bands("spin rate", "|\u{3c9}| (rad/s)", &|moment| moment.spin));
    panels.push(bands("kinetic energy", "T / T\u{2080} \u{2212} 1", &|moment| moment.energy));
    panels.push(histogram(snapshots));
    Figure {
        title,
        caption: caption.to_vec(),
        panels,
        columns: 3,
        legend: is_drawn
            .iter()
            .map(|(name, style)| ((*name).to_owned(), *style))
            .chain([
                ("median".to_owned(), MEDIAN),
                ("5 % and 95 %; inner band 25 % to 75 %".to_owned(), EDGE),
                ("histogram: first output".to_owned(), FIRST),
                ("histogram: last output".to_owned(), LAST),
            ])
            .collect(),
    }
}

const fn line(colour: [u8; 3], line: Line, width: u32) -> Style {
    Style { colour, line, mark: None, width }
}

const DRIFT: [(&str, Style); 3] = [
    ("drift: median", line(BLACK, Line::Solid, 2)),
    ("drift: 99th percentile", line(BLUE, Line::Dashed, 2)),
    ("drift: maximum", line(VERMILION, Line::Dotted, 2)),
];
const OUTER: Style = line(BLUE, Line::None, 1);
const INNER: Style = line(BLUE, Line::None, 1);
const EDGE: Style = line(BLUE, Line::Dotted, 1);
const MEDIAN: Style = line(BLUE, Line::Solid, 2);
const FIRST: Style = line(GREY, Line::Solid, 1);
const LAST: Style = line(VERMILION, Line::Dashed, 2);

/// A histogram of numbers within a range.
fn bars(values: &[f64], (low, high): (f64, f64), style: Style) -> Vec<Item> {
    // Equal numbers still need a bar with a width.
    let width = ((high - low) / BARS as f64).max(1e-9 * high.abs()).max(f64::MIN_POSITIVE);
    let mut counts = [0_usize; BARS];
    values.iter().for_each(|value| counts[(((value - low) / width) as usize).min(BARS - 1)] += 1);
    let filled = counts.into_iter().enumerate().filter(|(_, count)| *count > 0);
    let bar = |(index, count): (usize, usize)| Item::Bar {
        low: (low + index as f64 * width, 0.0),
        high: (low + (index + 1) as f64 * width, count as f64),
        style,
    };
    filled.map(bar).collect()
}

fn histogram(snapshots: &Snapshots) -> Panel {
    let [first, last] = &snapshots.spins;
    let range = extent(first.iter().chain(last).copied());
    Panel {
        title: "spin rate at the first and the last output".to_owned(),
        x: Axis::linear("|\u{3c9}| (rad/s)"),
        y: Axis { include: vec![0.0], ..Axis::linear("bodies") },
        items: [bars(first, range, FIRST), bars(last, range, LAST)].concat(),
        equal: false,
    }
}

/// The view of three-dimensional things: from above and the side, so that no axis hides another.
fn seen(v: DVec3) -> ((f64, f64), f64) {
    // 65° around and 25° above the plane of x and y.
    let right = DVec3::new(-0.906_307_787, 0.422_618_262, 0.0);
    let up = DVec3::new(-0.178_606_195, -0.383_022_222, 0.906_307_787);
    ((v.dot(right), v.dot(up)), v.dot(right.cross(up)))
}

/// A curve in space, with its far side (where `front` is not above 0) thin and dotted.
fn space_curve(points: &[DVec3], front: impl Fn(DVec3) -> f64, colour: [u8; 3], width: u32) -> [Item; 2] {
    let nowhere = (f64::NAN, f64::NAN);
    let side = |near: bool| -> Vec<(f64, f64)> {
        points.iter().map(|&point| if (front(point) > 0.0) == near { seen(point).0 } else { nowhere }).collect()
    };
    [
        Item::Curve { points: side(false), style: line(colour, Line::Dotted, 1) },
        Item::Curve { points: side(true), style: line(colour, Line::Solid, width) },
    ]
}

/// Circles of latitude and longitude of the unit sphere, mapped by `map`; `front` as above.
fn globe(map: DMat3, front: impl Fn(DVec3) -> f64 + Copy) -> Vec<Item> {
    use std::f64::consts::{PI, TAU};
    const POINTS: usize = 97;
    let around = |point: &dyn Fn(f64) -> DVec3| -> Vec<DVec3> {
        (0..POINTS).map(|index| map * point(TAU * index as f64 / (POINTS - 1) as f64)).collect()
    };
    let latitudes = [-60.0_f64, -30.0, 0.0, 30.0, 60.0].map(|degrees| {
        let (z, r) = degrees.to_radians().sin_cos();
        around(&|angle| DVec3::new(r * angle.cos(), r * angle.sin(), z))
    });
    let longitudes = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(|sixth| {
        let (s, c) = (PI * sixth / 6.0).sin_cos();
        around(&|angle| DVec3::new(c * angle.cos(), s * angle.cos(), angle.sin()))
    });
    let light = [205, 205, 205];
    latitudes.iter().chain(&longitudes).flat_map(|points| space_curve(points, front, light, 1)).collect()
}

fn of_body((body, title): (usize, String), track: &[State], caption: &[String]) -> Figure {
    let mut panels = Vec::new();
    if let Some(panel) = ellipsoid(track) {
        panels.push(panel);
    }
    panels.push(herpolhode(track));
    let front = |v: DVec3| seen(v).1;
    let mut items = globe(DMat3::IDENTITY, front);
    let mut legend = Vec::new();
    for (axis, colour, name) in [(DVec3::X, VERMILION, "x"), (DVec3::Y, GREEN, "y"), (DVec3::Z, BLUE, "z")] {
        let tips: Vec<DVec3> = track.iter().map(|state| state.orientation * axis).collect();
        items.extend(space_curve(&tips, front, colour, 2));
        let mut start = Style::nth(0);
        start.colour = colour;
        items.push(Item::Curve { points: tips.first().map(|&tip| seen(tip).0).into_iter().collect(), style: start });
        legend.push((
            format!("body axis {name} in the world; dot: start"),
            Style { line: Line::Solid, width: 2, ..start },
        ));
    }
    panels.push(Panel {
        title: "tips of the body axes on the unit sphere".to_owned(),
        x: Axis::linear("seen from the side (1)"),
        y: Axis::linear("world z upwards (1)"),
        items,
        equal: true,
    });
    legend.push(("\u{3c9}".to_owned(), line(BLACK, Line::Solid, 2)));
    legend.push(("behind the surface".to_owned(), line(BLACK, Line::Dotted, 1)));
    let mut caption = caption.to_vec();
    caption.push(format!("Body {body} at its {} recorded times, joined by straight lines.", track.len()));
    Figure { title, caption, columns: 2, panels, legend }
}

/// The angular velocity in body axes on the ellipsoid ω · I ω = 2 T of the first recorded time. The tensor follows from the
/// states; `None` if they do not determine it, as in a steady rotation.
fn ellipsoid(track: &[State]) -> Option<Panel> {
    let inertia = fitted_inertia(track)?;
    let first = track.first()?;
    let axes = crate::bodies::inertia::principal_axes(&inertia.into());
    let radii = DVec3::from_array(axes.moments.to_array().map(|moment| (2.0 * first.kinetic_energy / moment).sqrt()));
    if !radii.is_finite() {
        return None;
    }
    let turn = DMat3::from_quat(axes.principal_to_body);
    // A point is in front if the surface's normal I ω points to the viewer.
    let front = move |omega: DVec3| seen(inertia * omega).1;
    let mut items = globe(turn * DMat3::from_diagonal(radii), front);
    let polhode: Vec<DVec3> = track.iter().map(|state| state.angular_velocity_body).collect();
    items.extend(space_curve(&polhode, front, BLACK, 2));
    Some(Panel {
        title: "polhode on the inertia ellipsoid (body axes)".to_owned(),
        x: Axis::linear("seen from the side (rad/s)"),
        y: Axis::linear("body z upwards (rad/s)"),
        items,
        equal: true,
    })
}

/// The angular velocity in the world, seen along the angular momentum of the first recorded time.
fn herpolhode(track: &[State]) -> Panel {
    let normal = track.first().and_then(|state| state.angular_momentum_world.try_normalize()).unwrap_or(DVec3::Z);
    let (right, up) = normal.any_orthonormal_pair();
    let points = track.iter().map(|state| {
        let omega = state.orientation * state.angular_velocity_body;
        (omega.dot(right), omega.dot(up))
    });
    Panel {
        title: "herpolhode (plane across L)".to_owned(),
        x: Axis::linear("\u{3c9} across L (rad/s)"),
        y: Axis::linear("\u{3c9} across L (rad/s)"),
        items: vec![Item::Curve { points: points.collect(), style: line(BLACK, Line::Solid, 2) }],
        equal: true,
    }
}

/// States with relative errors of 1e-6, as in `f32`, fit better than this; those of a body whose moments change do not.
const WORST_FIT: f64 = 1e-4;

/// Below this ratio of pivots the states do not determine the tensor.
const LEAST_PIVOT: f64 = 1e-10;

/// The symmetric tensor I, kg m², with I ω nearest to the angular momentum in body axes over all states (least squares, by
/// the normal equations); `None` if it does not fit all of them.
fn fitted_inertia(track: &[State]) -> Option<DMat3> {
    let mut matrix = [[0.0_f64; 7]; 6];
    for state in track {
        let w = state.angular_velocity_body;
        let m = state.orientation.conjugate() * state.angular_momentum_world;
        // Unknowns xx, yy, zz, xy, xz, yz; one row for each component of I ω = m.
        let rows = [
            ([w.x, 0.0, 0.0, w.y, w.z, 0.0], m.x),
            ([0.0, w.y, 0.0, w.x, 0.0, w.z], m.y),
            ([0.0, 0.0, w.z, 0.0, w.x, w.y], m.z),
        ];
        for (row, value) in rows.into_iter().filter(|(_, value)| value.is_finite()) {
            for i in 0..6 {
                (0..6).for_each(|j| matrix[i][j] += row[i] * row[j]);
                matrix[i][6] += row[i] * value;
            }
        }
    }
    // Gauss's elimination; the matrix is positive semi-definite, so its largest remaining diagonal element is the pivot.
    let greatest = (0..6).map(|i| matrix[i][i]).fold(0.0, f64::max);
    let mut left = vec![0, 1, 2, 3, 4, 5];
    while !left.is_empty() {
        let at = (0..left.len()).max_by(|&a, &b| matrix[left[a]][left[a]].total_cmp(&matrix[left[b]][left[b]]))?;
        let pivot = left.swap_remove(at);
        if matrix[pivot][pivot].is_nan() || matrix[pivot][pivot] <= LEAST_PIVOT * greatest {
            return None;
        }
        let pivot_row = matrix[pivot];
        for (_, row) in matrix.iter_mut().enumerate().filter(|(index, _)| *index != pivot) {
            let factor = row[pivot] / pivot_row[pivot];
            row.iter_mut().zip(&pivot_row).for_each(|(cell, other)| *cell -= factor * other);
        }
    }
    let [xx, yy, zz, xy, xz, yz] = std::array::from_fn(|i| matrix[i][6] / matrix[i][i]);
    let tensor = DMat3::from_cols(DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz));
    let fits = |state: &State| {
        let momentum = state.orientation.conjugate() * state.angular_momentum_world;
        let misfit = (tensor * state.angular_velocity_body - momentum).length();
        !momentum.is_finite() || misfit <= WORST_FIT * momentum.length()
    };
    track.iter().all(fits).then_some(tensor)
}
