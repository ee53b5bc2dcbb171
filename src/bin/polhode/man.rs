//! `polhode man`.

use clap::CommandFactory;

use crate::arguments::Arguments;
use crate::output::{self, Failure};

/// Prints the manual page, followed by those of the commands.
pub fn man() -> Result<(), Failure> {
    let mut command = Arguments::command();
    command.build();
    let mut text = Vec::new();
    let commands = command.get_subcommands().filter(|page| page.get_name() != "help");
    for page in std::iter::once(&command).chain(commands) {
        // Writing to memory does not fail.
        let _ = clap_mangen::Man::new(page.clone()).render(&mut text);
    }
    output::print(&String::from_utf8_lossy(&text))
}
