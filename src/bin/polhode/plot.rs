//! `polhode plot`.

use std::path::PathBuf;

use clap::Args;
use polhode::plot::plot_folder;

use crate::output::{self, Failure};

const HELP: &str = "\
Examples:
    polhode bench accuracy --quick && polhode plot bench.out";

/// Arguments of `polhode plot`.
#[derive(Debug, Args)]
#[command(after_long_help = HELP, after_help = "`polhode plot --help` gives examples.")]
pub struct PlotArguments {
    /// Folder with the rows of benchmarks; pictures are written into it.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
}

/// Draws what a folder holds.
pub fn plot(arguments: &PlotArguments) -> Result<(), Failure> {
    let files = plot_folder(&arguments.folder)?;
    if files.is_empty() {
        return Err(Failure::Arguments("the folder holds no table of a benchmark: `polhode bench` makes them"));
    }
    files.iter().for_each(|file| output::print(&format!("{}\n", file.display())));
    Ok(())
}
