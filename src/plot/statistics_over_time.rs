//! Statistics of a run's ensemble over time.

use std::fs::File;
use std::path::Path;

use super::figure::{Axis, Figure, Item, Line, Panel, Style};
use super::run::caption;
use crate::error::RowFault;
use crate::error::{Error, FileAction, Result};
use crate::kernel::observe::Statistic;
use crate::study::text::{CUT, Lines};

const BLUE: [u8; 3] = [0, 114, 178];

const SPREAD: Style = Style { colour: BLUE, line: Line::None, mark: None, width: 1 };
const EXTREME: Style = Style { colour: BLUE, line: Line::Dotted, mark: None, width: 1 };
const MEAN: Style = Style { colour: BLUE, line: Line::Solid, mark: None, width: 2 };

/// The file that is drawn.
pub(super) const TABLE: &str = "statistics.csv";

/// A panel for each quantity of the table in `folder`.
///
/// # Errors
///
/// [`Error::File`] and [`Error::Rows`] where the table or `report.json` cannot be read.
pub(super) fn statistics(folder: &Path) -> Result<Figure> {
    let path = folder.join(TABLE);
    let no_table = |reason: String| Error::Rows { path: path.clone(), fault: RowFault::Csv(reason) };
    let file = File::open(&path).map_err(|error| Error::file(&path, FileAction::Read, &error))?;
    let mut reader = csv::Reader::from_reader(Lines::new(file));
    let header = reader.headers().map_err(|error| no_table(error.to_string()))?.clone();
    let records = reader.records().collect::<std::result::Result<Vec<_>, _>>();
    let records = records.map_err(|error| no_table(error.to_string()))?;
    if reader.get_ref().are_cut() {
        return Err(no_table(format!("line {}: {CUT}", reader.position().line())));
    }
    let column = |name: &str| -> Option<Vec<f64>> {
        let index = header.iter().position(|column| column == name)?;
        let number = |record: &csv::StringRecord| record.get(index)?.parse().ok();
        Some(records.iter().map(|record| number(record).unwrap_or(f64::NAN)).collect())
    };
    let time = column("t").ok_or_else(|| no_table("it has no column t".to_owned()))?;
    let panel = |statistic: Statistic| -> Option<Panel> {
        let of = |figure: &str| column(&format!("{statistic}_{figure}"));
        let (mean, deviation, min, max) = (of("mean")?, of("standard_deviation")?, of("min")?, of("max")?);
        let curve = |values: &[f64], style| Item::Curve {
            points: time.iter().copied().zip(values.iter().copied()).collect(),
            style,
        };
        let spread = time.iter().zip(mean.iter().zip(&deviation));
        let spread = spread.map(|(&time, (mean, deviation))| (time, mean - deviation, mean + deviation)).collect();
        let items = vec![
            Item::Band { points: spread, style: SPREAD },
            curve(&min, EXTREME),
            curve(&max, EXTREME),
            curve(&mean, MEAN),
        ];
        let label = statistic.name().replace('_', " ");
        let y = Axis::linear(&format!("{label} ({})", statistic.unit()));
        Some(Panel { title: label, x: Axis::linear("time (s)"), y, items, equal: false })
    };
    let panels: Vec<Panel> = Statistic::ALL.into_iter().filter_map(panel).collect();
    Ok(Figure {
        title: "Statistics over all bodies".to_owned(),
        caption: caption(folder)?.into_iter().take(1).collect(),
        columns: 2,
        panels,
        legend: vec![
            ("mean; band: one standard deviation".to_owned(), MEAN),
            ("least and greatest".to_owned(), EXTREME),
        ],
    })
}
