//! The `polhode` command: a thin client of the library.

use std::process::ExitCode;

use clap::Parser;

mod arguments;
mod bench;
mod checkpoint;
mod completions;
mod devices;
mod engine;
mod engine_arguments;
mod explain;
mod inertia;
mod inputs_help;
mod launcher;
mod man;
mod output;
mod plan;
mod plot;
mod progress;
mod replay;
mod run;
mod shards;
mod threads;
mod verify;

use arguments::{Arguments, Command};
use output::Failure;

/// Exit status: the run failed.
const FAILED: u8 = 1;
/// The message if there is no shader to check.
const NO_SHADER: &str = "no GPU adapter, not even in software (`polhode devices` says why): no shader was checked; \
                         --engine cpu checks the lanes of the CPU engine";
/// Exit status: the input is wrong.
const WRONG_INPUT: u8 = 2;

fn main() -> ExitCode {
    quieten_graphics();
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return refuse_arguments(&error),
    };
    let done = perform(&arguments.command);
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => say(&failure),
    }
}

fn perform(command: &Command) -> Result<(), Failure> {
    if !matches!(command, Command::Completions(_) | Command::Man) {
        threads::start()?;
    }
    match command {
        Command::Run(arguments) => run::run(arguments),
        Command::Explain(arguments) => explain::explain(arguments),
        Command::Plan(arguments) => plan::plan(arguments),
        Command::Status(arguments) => shards::status(arguments),
        Command::Merge(arguments) => shards::merge(arguments),
        Command::Verify(arguments) => verify::verify(arguments),
        Command::Replay(arguments) => replay::replay(arguments),
        Command::Devices(arguments) => devices::devices(arguments),
        Command::Inertia(arguments) => inertia::inertia(arguments),
        Command::Bench(arguments) => bench::bench(arguments),
        Command::Plot(arguments) => plot::plot(arguments),
        Command::Completions(arguments) => completions::completions(arguments),
        Command::Man => man::man(),
    }
}

/// Reports a failure, unless that was done already, and returns the exit status.
fn say(failure: &Failure) -> ExitCode {
    match failure {
        Failure::Reported => ExitCode::from(FAILED),
        Failure::NoShader => {
            output::error(NO_SHADER);
            ExitCode::from(FAILED)
        }
        Failure::Input(message) => {
            output::error(message);
            ExitCode::from(WRONG_INPUT)
        }
        Failure::Threads(error) => {
            output::error(&format!("no threads to compute with: {error}; set RAYON_NUM_THREADS to fewer"));
            ExitCode::from(FAILED)
        }
        Failure::Output(error) => {
            output::error(&format!("standard output cannot be written: {error}"));
            ExitCode::from(FAILED)
        }
        Failure::Library(polhode::Error::Interrupted { .. }) => {
            output::error(&progress::stopped());
            ExitCode::from(FAILED)
        }
        Failure::Library(error) => {
            output::error(&error.to_string());
            if let polhode::Error::Input(input) = error
                && let polhode::error::InputFault::Formula { picture, .. } = &input.fault
            {
                picture.lines().for_each(|line| output::note(&format!("    {line}")));
            }
            ExitCode::from(if error.is_input() { WRONG_INPUT } else { FAILED })
        }
    }
}

/// Some drivers look for a Wayland display and write to standard error if its folder is not set; a folder that does not exist keeps them
/// quiet.
#[allow(unsafe_code, reason = "an environment variable, before any other thread runs")]
fn quieten_graphics() {
    const FOLDER: &str = "XDG_RUNTIME_DIR";
    if cfg!(target_os = "linux") && std::env::var_os(FOLDER).is_none() {
        // SAFETY: no other thread runs yet.
        unsafe { std::env::set_var(FOLDER, "/nonexistent") };
    }
}

/// Help and version go to standard output in full; a wrong argument is reported in one line.
fn refuse_arguments(error: &clap::Error) -> ExitCode {
    use clap::error::ErrorKind;
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            return match output::print(&error.render().to_string()) {
                Ok(()) => ExitCode::SUCCESS,
                Err(failure) => say(&failure),
            };
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            output::error(
                "expected a command: polhode run, plan, status, merge, explain, verify, replay, inertia, devices, bench, plot, completions or man; `polhode --help` describes them",
            );
            return ExitCode::from(WRONG_INPUT);
        }
        _ => {}
    }
    let text = error.render().to_string();
    let lines: Vec<&str> = text
        .lines()
        .map(str::trim)
        .take_while(|line| !line.starts_with("Usage:"))
        .filter(|line| !line.is_empty())
        .collect();
    let message = lines.join(" ");
    output::error(message.strip_prefix("error: ").unwrap_or(&message));
    ExitCode::from(WRONG_INPUT)
}
