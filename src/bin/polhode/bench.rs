//! `polhode bench`.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use polhode::bench::compare::compare;
use polhode::bench::provenance::Provenance;
use polhode::bench::row::Row;
use polhode::bench::{Bench, Swept, Watcher, accuracy, drift, kernels, skipping, stability, throughput};
use polhode::engine::Engine;
use polhode::engine::gpu::GpuOptions;

use crate::output::{self, Failure};
use crate::progress::{Watch, catch_interrupts};

const HELP: &str = "\
Each benchmark appends one row per case to DIR/NAME.csv and to DIR/NAME.json (one line per row). It
never overwrites a row, and each row says where it comes from. `polhode plot DIR` draws those of
accuracy, throughput, skipping and stability.

Examples:
    polhode bench accuracy --quick                    a first look, about a minute
    polhode bench accuracy --filter forced/cpu/rk4    some cases only
    polhode bench accuracy --out results --resume     continues where a run was stopped
    polhode bench compare monday tuesday              two runs on one machine";

/// Arguments of `polhode bench`.
#[derive(Debug, Args)]
#[command(after_long_help = HELP, after_help = "`polhode bench --help` gives examples.")]
pub struct BenchArguments {
    /// What to measure.
    #[command(subcommand)]
    benchmark: Benchmark,
}

/// The benchmarks.
#[derive(Debug, Subcommand)]
enum Benchmark {
    /// Wall time against attitude error: problems, methods, precisions and steps.
    Accuracy(Options),
    /// Body-steps per second: bodies, steps per dispatch, outputs, cores, beside the machine's ceilings.
    Throughput(Options),
    /// Every kernel with its error, beside the machine's ceilings; waits, dispatches and bytes of a run.
    Kernels(Options),
    /// Time and bytes saved by each kind of skipped work, and what it changes in the result.
    Skipping(Options),
    /// The atlas: the motion of free bodies under every method, for steps from 1e-4 to 1e3 rad.
    Stability(Options),
    /// How far constants of the motion drift over ten million steps.
    Drift(Options),
    /// Two runs of `bench accuracy` side by side: errors to the last digit, ratios of times, rankings.
    Compare(Folders),
}

/// The results of two runs.
#[derive(Debug, Args)]
struct Folders {
    /// Folder of the first run.
    #[arg(value_name = "OLD")]
    old: PathBuf,
    /// Folder of the second run.
    #[arg(value_name = "NEW")]
    new: PathBuf,
}

/// The engines that are measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Engines {
    /// The CPU, and a GPU if there is one.
    All,
    /// The CPU.
    Cpu,
    /// A GPU, or a software adapter if there is no real one.
    Gpu,
}

/// The options of all benchmarks.
#[derive(Debug, Args)]
struct Options {
    /// Fewer and smaller cases: a minute or so on two cores.
    #[arg(long)]
    quick: bool,
    /// Only cases whose name (problem/engine/method/precision/...) contains this.
    #[arg(long, value_name = "SUBSTRING")]
    filter: Option<String>,
    /// Engines that are measured.
    #[arg(long, value_enum, default_value = "all", value_name = "ENGINE")]
    engine: Engines,
    /// GPU adapter, by its index in `polhode devices`.
    #[arg(long, value_name = "INDEX")]
    adapter: Option<usize>,
    /// Folder to whose tables the rows are appended.
    #[arg(long, default_value = "bench.out", value_name = "DIR")]
    out: PathBuf,
    /// Leave out cases for which the folder has a row from the same commit and machine.
    #[arg(long)]
    resume: bool,
    /// No progress (a bar; a line now and then if standard error is no terminal) and no summary.
    #[arg(long, short)]
    quiet: bool,
}

/// Runs a benchmark.
pub fn bench(arguments: &BenchArguments) -> Result<(), Failure> {
    catch_interrupts();
    match &arguments.benchmark {
        Benchmark::Accuracy(options) => measure(options, accuracy::run, accuracy::summary),
        Benchmark::Throughput(options) => measure(options, throughput::run, throughput::summary),
        Benchmark::Kernels(options) => measure(options, kernels::run, kernels::summary),
        Benchmark::Skipping(options) => measure(options, skipping::run, skipping::summary),
        Benchmark::Stability(options) => measure(options, stability::run, stability::summary),
        Benchmark::Drift(options) => measure(options, drift::run, drift::summary),
        Benchmark::Compare(folders) => {
            let comparison = compare(&folders.old, &folders.new)?;
            if comparison.cases == 0 {
                return Err(Failure::Input(
                    "the folders have no case of `polhode bench accuracy` in common".to_owned(),
                ));
            }
            output::show(&comparison.to_string())?;
            Ok(())
        }
    }
}

/// Measures, then reports what was measured and where it is.
fn measure(
    options: &Options,
    run: impl Fn(&Bench, &Path, &mut Watcher<'_>) -> polhode::Result<Swept>,
    summary: impl Fn(&[Row]) -> String,
) -> Result<(), Failure> {
    let (bench, mut watch) = prepared(options)?;
    let swept = run(&bench, &options.out, &mut |step| watch.observe_case(step));
    watch.finish();
    let swept = swept?;
    if swept.rows.is_empty() && swept.left_out == 0 {
        return Err(Failure::Input("no case matches: --filter takes a part of a name, such as cpu or f64".to_owned()));
    }
    if !options.quiet {
        output::show(&summary(&swept.rows))?;
        let tables: Vec<String> = swept.tables.iter().map(|table| table.display().to_string()).collect();
        output::note(&format!(
            "{} rows appended to {} and .json beside it, {} cases left out",
            swept.rows.len(),
            tables.join(", "),
            swept.left_out
        ));
    }
    Ok(())
}

fn prepared(options: &Options) -> Result<(Bench, Watch), Failure> {
    let command: Vec<String> = std::env::args().skip(1).collect();
    let bench = Bench {
        quick: options.quick,
        filter: options.filter.clone(),
        resume: options.resume,
        engines: engines(options)?,
        provenance: Provenance::collect(&format!("polhode {}", command.join(" "))),
    };
    if env!("POLHODE_PROFILE") != "release" && !options.quiet {
        output::note("this is not a release build: its times are not meaningful (rows say so in the column profile)");
    }
    Ok((bench, Watch::new(options.quiet)))
}

fn engines(options: &Options) -> Result<Vec<Engine>, Failure> {
    let gpu = || Engine::gpu(GpuOptions { adapter: options.adapter, software: true, ..GpuOptions::default() });
    match options.engine {
        Engines::Cpu if options.adapter.is_some() => {
            Err(Failure::Input("--adapter excludes --engine cpu: give one of them".to_owned()))
        }
        Engines::Cpu => Ok(vec![Engine::cpu()]),
        Engines::Gpu => Ok(vec![gpu()?]),
        Engines::All => match gpu() {
            Ok(gpu) => Ok(vec![Engine::cpu(), gpu]),
            Err(polhode::Error::NoAdapter { .. }) if options.adapter.is_none() => {
                if !options.quiet {
                    output::note("no GPU adapter, not even in software: only the CPU is measured");
                }
                Ok(vec![Engine::cpu()])
            }
            Err(error) => Err(error.into()),
        },
    }
}
