//! The date, machine and software behind a row.

use std::process::Command;

use super::row::Row;
use crate::engine::Description;

/// `release`, or `debug` for profiles that do not inherit from it (`build.rs`).
const PROFILE: &str = env!("POLHODE_PROFILE");

/// The word for what could not be determined.
const UNKNOWN: &str = "unknown";

/// Source, compiler and machine, determined once for each run.
#[derive(Clone, Debug, PartialEq)]
pub struct Provenance {
    row: Row,
}

impl Provenance {
    /// Determines what is known at run time; `command` is the command line that makes the rows.
    ///
    /// Commit and compiler are those of the folder in which this library was built, as they are now; if that folder, `git` or `rustc` does
    /// not exist, the word is `unknown`. The column `dirty` says whether files under version control differ from the commit.
    pub fn collect(command: &str) -> Self {
        let commit = commit();
        let changes = in_source(&["git", "status", "--porcelain", "--untracked-files=no"]);
        let dirty = match (&commit, changes) {
            (Some(_), Some(changes)) => if changes.is_empty() { "no" } else { "yes" }.to_owned(),
            _ => UNKNOWN.to_owned(),
        };
        let unknown = || UNKNOWN.to_owned();
        let row = Row::new()
            .with("version", env!("CARGO_PKG_VERSION"))
            .with("commit", commit.unwrap_or_else(unknown))
            .with("dirty", dirty)
            .with("compiler", in_source(&["rustc", "--version"]).unwrap_or_else(unknown))
            .with("profile", PROFILE)
            .with("platform", format!("{} {}", std::env::consts::OS, std::env::consts::ARCH))
            .with("cpu", processor().unwrap_or_else(unknown))
            .with("cores", std::thread::available_parallelism().map_or(1, usize::from))
            .with("command", command);
        Self { row }
    }

    /// The cells for a row made now by an engine with `threads` threads: the date, those of [`Provenance::collect`], the machine's load
    /// (mean number of running processes over the last minute; NaN if the system does not say), and the engine.
    pub fn of(&self, engine: &Description, threads: usize) -> Row {
        let kind = engine.kind.name();
        Row::new()
            .with("date", crate::record::date::now())
            .join(&self.row)
            .with("load", load())
            .with("engine", kind)
            .with("adapter", engine.name.as_str())
            .with("driver", engine.driver.as_str())
            .with("software", engine.software)
            .with("threads", threads)
    }
}

/// The current commit of the folder in which this library was built, if it still exists.
pub(crate) fn commit() -> Option<String> {
    in_source(&["git", "rev-parse", "HEAD"])
}

/// The output of a program, run in the folder in which this library was built; `None` if it does not succeed.
fn in_source(words: &[&str]) -> Option<String> {
    let output = Command::new(words[0]).args(&words[1..]).current_dir(env!("CARGO_MANIFEST_DIR")).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// The processor's name.
fn processor() -> Option<String> {
    if cfg!(target_os = "macos") {
        return in_source(&["sysctl", "-n", "machdep.cpu.brand_string"]);
    }
    if cfg!(windows) {
        return std::env::var("PROCESSOR_IDENTIFIER").ok();
    }
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

fn load() -> f64 {
    let text = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split_whitespace().next().and_then(|word| word.parse().ok()).unwrap_or(f64::NAN)
}
