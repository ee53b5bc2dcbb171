//! `polhode completions`.

use clap::CommandFactory;

use crate::arguments::{Arguments, CompletionsArguments};
use crate::output::{self, Failure};

/// Prints a shell's completion script.
pub fn completions(arguments: &CompletionsArguments) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut Arguments::command(), "polhode", &mut script);
    output::print(&String::from_utf8_lossy(&script))
}
