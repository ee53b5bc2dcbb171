//! Costs from the rows of a benchmark.

use std::path::Path;

use crate::bench::accuracy;
use crate::bench::row::{Row, rows};
use crate::engine::{Description, EngineKind};
use crate::error::RowFault;
use crate::error::{Error, Result};
use crate::math::Precision;
use crate::plan::Scheme;
use crate::plan::cost::{COSTS, Cost, Costs, Figures, SERIES_TOLERANCE};

impl Costs {
    /// The shipped table with the times that `polhode bench accuracy` measured on `engine` and wrote in `folder`.
    ///
    /// A method that was not measured keeps its shipped times on the CPU engine, and is no candidate on a GPU. Of several rows
    /// of a method the fastest counts: the others include more of the fixed costs of a run. For Taylor series, rows at the
    /// tolerance [`SERIES_TOLERANCE`] count.
    ///
    /// # Errors
    ///
    /// [`Error::Rows`] if the folder has no row of this engine, or its table does not have the format of this version.
    pub fn measured(folder: &Path, engine: &Description) -> Result<Self> {
        let rows = rows(folder, accuracy::TABLE)?;
        let kind = engine.kind.name();
        // The name of the CPU engine includes the number of threads; times are for one.
        let is_of_engine = |row: &&Row| {
            row.text("engine") == kind && (engine.kind == EngineKind::Cpu || row.text("adapter") == engine.name)
        };
        let rows: Vec<&Row> = rows.iter().filter(is_of_engine).filter(|row| row.flag("valid")).collect();
        let measured: Vec<Cost> = COSTS.iter().filter_map(|cost| of_method(cost, &rows, engine.kind)).collect();
        if rows.is_empty() || measured.is_empty() {
            let path = folder.join(format!("{}.csv", accuracy::TABLE));
            return Err(Error::Rows { path, fault: RowFault::NoEngine { engine: engine.name.clone() } });
        }
        let at_a_time = (engine.kind == EngineKind::Gpu).then_some(1.0);
        Ok(Self { rows: measured, at_a_time, ..Self::shipped() })
    }
}

fn of_method(shipped: &Cost, rows: &[&Row], kind: EngineKind) -> Option<Cost> {
    let seconds = |problem: &str, precision: Precision| {
        let of_case = |row: &&&Row| {
            row.text("method") == shipped.scheme.name()
                && row.text("precision") == precision.name()
                && row.text("problem") == problem
                && (shipped.scheme != Scheme::TAYLOR || row.number("tolerance_rad") == SERIES_TOLERANCE)
        };
        let at_a_time = |row: &Row| if kind == EngineKind::Cpu { row.number("threads") } else { 1.0 };
        let of_row = |row: &&Row| at_a_time(row) / row.number("body_steps_per_second");
        let times = rows.iter().filter(of_case).map(of_row).filter(|seconds| seconds.is_finite() && *seconds > 0.0);
        times.min_by(f64::total_cmp)
    };
    let figures = |problem: &str, shipped: Figures| {
        let found = Precision::ALL.map(|precision| seconds(problem, precision));
        match (found, kind) {
            ([None, None], EngineKind::Gpu) => None,
            (found, EngineKind::Gpu) => Some(found.map(|seconds| seconds.unwrap_or(f64::INFINITY))),
            ([narrow, wide], EngineKind::Cpu) => {
                Some([narrow.unwrap_or(shipped.seconds[0]), wide.unwrap_or(shipped.seconds[1])])
            }
        }
    };
    let (free, driven) = (figures("free", shipped.free), figures("forced", shipped.driven));
    let (free, driven) = (free.or(driven)?, driven.or(free)?);
    Some(Cost {
        free: Figures { seconds: free, ..shipped.free },
        driven: Figures { seconds: driven, ..shipped.driven },
        ..*shipped
    })
}
