//! `polhode inertia`.

use polhode::study::{MassFileOptions, MassReport};

use crate::arguments::InertiaArguments;
use crate::output::{self, Failure};

/// Prints the mass properties of what a file describes.
pub fn inertia(arguments: &InertiaArguments) -> Result<(), Failure> {
    let options = MassFileOptions {
        mass: arguments.mass,
        density: arguments.density,
        scale: arguments.scale,
        shell: arguments.shell,
        body: arguments.body,
    };
    let report = MassReport::of_file(&arguments.file, &options, arguments.about)?;
    if arguments.json { output::print(&report.to_json()) } else { output::show(&report.to_string()) }
}
