//! Traffic between the host and a device, and how long it takes.

use std::time::Duration;

/// Counts of what has passed between the host and a device; all 0 if the state is in the host's memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// How often the host has waited for the device.
    pub waits: u64,
    /// Dispatches of kernels, including those that had nothing left to do.
    pub dispatches: u64,
    /// Bytes written to the device's memory.
    pub bytes_written: u64,
    /// Bytes read back from it.
    pub bytes_read: u64,
    /// Pipelines made from shaders: compiled, or taken from the device cache.
    pub pipelines: u64,
    /// How long work waited until they were compiled.
    pub waited_for_pipelines: Duration,
}

/// How long it takes to reach a device, as measured.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Link {
    /// Wall time of a submission and of the wait for it, s.
    pub wait: f64,
    /// Bytes a second to the device's memory.
    pub to_device: f64,
    /// Bytes a second back from it.
    pub to_host: f64,
}

impl Link {
    /// A way with this wait, s, and so many bytes a second to the device's memory and back from it.
    pub fn new(wait: f64, to_device: f64, to_host: f64) -> Self {
        Self { wait, to_device, to_host }
    }
}

impl Traffic {
    /// What has passed since `earlier`.
    #[must_use]
    pub fn since(self, earlier: Self) -> Self {
        Self {
            waits: self.waits - earlier.waits,
            dispatches: self.dispatches - earlier.dispatches,
            bytes_written: self.bytes_written - earlier.bytes_written,
            bytes_read: self.bytes_read - earlier.bytes_read,
            pipelines: self.pipelines - earlier.pipelines,
            waited_for_pipelines: self.waited_for_pipelines - earlier.waited_for_pipelines,
        }
    }
}
