//! What memory there is, asked before it is taken.

use crate::error::{Error, Result};

/// Bytes that the system can still give to this process, where it says so (Linux).
pub fn available() -> Option<u64> {
    let table = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = table.lines().find(|line| line.starts_with("MemAvailable:"))?;
    let kibibytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kibibytes * 1024)
}

/// Refuses work on `bodies` bodies that needs more than the memory there is.
///
/// # Errors
///
/// [`Error::TooManyBodies`].
pub fn require(bodies: usize, bytes: usize, purpose: &'static str) -> Result<()> {
    match available() {
        Some(available) if (bytes as u64) > available => Err(refusal(bodies, bytes, purpose)),
        _ => Ok(()),
    }
}

/// The error for memory that was refused.
pub(crate) fn refusal(bodies: usize, bytes: usize, purpose: &'static str) -> Error {
    Error::TooManyBodies { bodies, purpose, needed: bytes as u64, available: available().unwrap_or(0) }
}
