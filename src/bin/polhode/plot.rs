//! `polhode plot`.

use std::path::PathBuf;

use clap::Args;
use polhode::plot::plot_folder;

use crate::output::{self, Failure};

const HELP: &str = "\
Examples:
    polhode bench accuracy --quick && polhode plot bench.out
    polhode run study.toml --out results && polhode plot results --body 0,3

From a run, it reads report.json and the tables of snapshots (else of final states), statistics,
histograms, events and cells, in any format. --body needs snapshots = true in the study.";

/// Arguments of `polhode plot`.
#[derive(Debug, Args)]
#[command(after_long_help = HELP, after_help = "`polhode plot --help` gives examples.")]
pub struct PlotArguments {
    /// Folder with the rows of benchmarks or the results of a run; pictures are written into it.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Bodies of a run whose polhode, herpolhode and axes are drawn, by index from 0, separated by commas.
    #[arg(long, value_name = "BODY", value_delimiter = ',')]
    pub body: Vec<usize>,
}

/// Draws the results in a folder.
pub fn plot(arguments: &PlotArguments) -> Result<(), Failure> {
    let files = plot_folder(&arguments.folder, &arguments.body)?;
    if files.is_empty() {
        let reason = "the folder holds neither tables of `polhode run` nor rows of `polhode bench` accuracy, throughput, skipping or stability, of which there are pictures";
        return Err(Failure::Input(reason.to_owned()));
    }
    files.iter().try_for_each(|file| output::print(&format!("{}\n", output::printable(&file.to_string_lossy()))))
}
