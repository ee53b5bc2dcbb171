//! Output to the terminal.

use std::io::Write;
use std::path::Path;

use polhode::study::Study;

/// Why a command did not succeed.
#[derive(Debug)]
pub enum Failure {
    /// The library refused or failed.
    Library(polhode::Error),
    /// Arguments that exclude each other, or an argument or an environment variable that is not valid: its name, its value, and what would
    /// be valid.
    Input(String),
    /// It has been reported already: `verify` found a difference or could decide nothing, more bodies have failed than the study allows, the
    /// accuracy asked for is not met or not known to be, or parts of a study are missing.
    Reported,
    /// `verify` has no adapter whose shaders it could check.
    NoShader,
    /// The system refuses the threads that compute.
    Threads(String),
    /// Standard output cannot be written.
    Output(std::io::Error),
}

impl Failure {
    /// The reason that the failed run of a part leaves in its folder.
    pub fn reason(&self) -> Option<String> {
        match self {
            Failure::Library(polhode::Error::FolderInUse { .. } | polhode::Error::FolderNotEmpty { .. }) => None,
            Failure::Library(polhode::Error::Interrupted { .. }) => Some("stopped".to_owned()),
            Failure::Library(error) => Some(error.to_string()),
            // If arguments are wrong, it is not known which part was meant.
            _ => None,
        }
    }

    /// [`Failure::Reported`] unless all is well.
    pub fn reported_unless(is_well: bool) -> Result<(), Self> {
        if is_well { Ok(()) } else { Err(Failure::Reported) }
    }
}

impl From<polhode::Error> for Failure {
    fn from(error: polhode::Error) -> Self {
        Failure::Library(error)
    }
}

/// Writes to standard output; a reader that has gone away is not an error.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut output = std::io::stdout().lock();
    match output.write_all(text.as_bytes()).and_then(|()| output.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(Failure::Output(error)),
        _ => Ok(()),
    }
}

/// As [`print`], for lines that people read: text from files cannot control the terminal.
pub fn show(text: &str) -> Result<(), Failure> {
    print(&text.split('\n').map(printable).collect::<Vec<_>>().join("\n"))
}

/// Refuses a file for a result that the study is read from, and without `--force` any other that is there unless `is_own` says that the
/// command has written it.
pub fn check_place(file: &Path, study: &Study, force: bool, is_own: impl FnOnce(&Path) -> bool) -> Result<(), Failure> {
    let refuse = |reason: &str| Err(Failure::Input(format!("--out {}: {reason}", file.display())));
    match file.is_file() {
        true if study.names_file(file) => refuse("the study is read from this file: expected another name"),
        true if !(force || is_own(file)) => {
            refuse("this file exists: expected another name, or --force, which replaces it")
        }
        _ => Ok(()),
    }
}

/// Writes one line to standard error.
pub fn note(message: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{}", printable(message));
}

/// Writes an error of one line to standard error.
pub fn error(message: &str) {
    note(&format!("error: {message}"));
}

/// A line without control characters.
pub fn printable(line: &str) -> String {
    line.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect()
}
