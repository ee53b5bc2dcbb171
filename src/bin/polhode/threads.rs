//! The threads that compute.

use rayon::ThreadPoolBuilder;

use crate::output::Failure;

/// The variable that says how many threads compute.
const VARIABLE: &str = "RAYON_NUM_THREADS";

/// Threads beyond this are a slip of the finger: machines with as many cores are a few.
const MOST: usize = 4096;

/// Starts the threads, so that a number that makes no sense, and a system that refuses them, are found out at once.
pub fn start() -> Result<(), Failure> {
    if let Some(value) = std::env::var_os(VARIABLE).filter(|value| !value.is_empty()) {
        let count = value.to_str().and_then(|text| text.parse::<usize>().ok());
        if count.is_none_or(|count| count > MOST) {
            let value = value.to_string_lossy();
            let message = format!("{VARIABLE} = {value}: expected a number of threads up to {MOST}, 0 for one a core");
            return Err(Failure::TorqueKernel(message));
        }
    }
    ThreadPoolBuilder::new().build_global().map_err(Failure::Threads)
}
