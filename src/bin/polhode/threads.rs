//! The threads that compute.

use rayon::ThreadPoolBuilder;

use crate::output::Failure;

/// The variable that sets the number of threads.
const VARIABLE: &str = "RAYON_NUM_THREADS";

/// More threads than this are a typing error: hardly any machine has as many cores.
const MOST: usize = 4096;

/// Bytes that a thread takes when it starts: its stack, as large as the standard library makes it, and what it allocates before it works.
const OF_A_THREAD: usize = (2 << 20) + (256 << 10);

/// Starts the threads, so that an invalid number, and a system that refuses them, are found at once.
pub fn start() -> Result<(), Failure> {
    let mut asked = None;
    if let Some(value) = std::env::var_os(VARIABLE).filter(|value| !value.is_empty()) {
        let count = value.to_str().and_then(|text| text.parse::<usize>().ok());
        if count.is_none_or(|count| count > MOST) {
            let value = value.to_string_lossy();
            let message =
                format!("{VARIABLE} = {value}: expected a number of threads up to {MOST}, 0 for one per core");
            return Err(Failure::Input(message));
        }
        asked = count.filter(|&count| count > 0);
    }
    let count = asked.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    if !has_room_for(count) {
        return Err(Failure::Threads(format!("{count} threads do not fit into the memory that the process may use")));
    }
    ThreadPoolBuilder::new().build_global().map_err(|error| Failure::Threads(error.to_string()))
}

/// Whether this many threads fit. The standard library aborts if a thread that has its stack finds no memory for the rest,
/// so this is checked before any starts. It tries separate pieces, as systems that overcommit memory refuse a single
/// allocation of that size, and touches none.
fn has_room_for(count: usize) -> bool {
    let mut pieces: Vec<Vec<u8>> = Vec::new();
    pieces.try_reserve_exact(count).is_ok()
        && (0..count).all(|_| {
            let mut piece = Vec::new();
            let is_there = piece.try_reserve_exact(OF_A_THREAD).is_ok();
            pieces.push(std::hint::black_box(piece));
            is_there
        })
}
