//! A GPU that is kept awake while it is measured.
//!
//! A GPU lowers its clocks within some tenths of a second without work, by a factor of six on an H100, and takes as long to raise them
//! again. A case is made ready on the host for about that time, so that the work to be timed would often start on a slow device.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use super::ceiling::open;
use crate::engine::gpu::rates;
use crate::engine::{Description, EngineKind};

/// A thread that gives a GPU a little work every few milliseconds, until it is dropped.
#[derive(Debug)]
pub(super) struct Awake {
    adapter: String,
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Awake {
    /// Of the GPU with this description; of the CPU and of a software adapter nothing.
    fn new(description: &Description) -> Self {
        let ends = Arc::new(AtomicBool::new(false));
        let is_real = description.kind == EngineKind::Gpu && !description.software;
        let thread = is_real.then(|| {
            let (ends, description) = (Arc::clone(&ends), description.clone());
            std::thread::spawn(move || {
                // Where the device fails, its benchmark says so.
                if let Ok(device) = pollster::block_on(open(&description)) {
                    let _ = rates::keep_awake(&device, || !ends.load(Ordering::Relaxed));
                }
            })
        });
        Self { adapter: description.name.clone(), ends, thread }
    }

    /// Keeps the device of a case awake, and that of the last case no longer, unless it is the same.
    pub fn instead_of(last: Option<Self>, description: &Description) -> Self {
        last.filter(|last| last.adapter == description.name).unwrap_or_else(|| Self::new(description))
    }
}

impl Drop for Awake {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
