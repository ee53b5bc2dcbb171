//! Work on a thread of its own, while the calling thread shows how far it is and listens for Ctrl-C.

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex};
use std::thread::Builder;
use std::time::{Duration, Instant};

use polhode::engine::Progress;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// How far the work is, and whether it is to go on.
#[derive(Debug, Default)]
pub(crate) struct Watch {
    done: AtomicU64,
    /// 0 as long as nothing is known of it: bodies are drawn, or methods and steps are chosen.
    total: AtomicU64,
    stop: AtomicBool,
}

impl Watch {
    /// Takes note of progress, and says whether to go on.
    pub(crate) fn observe(&self, progress: Progress) -> ControlFlow<()> {
        self.done.store(progress.done, Ordering::Relaxed);
        self.total.store(progress.total, Ordering::Relaxed);
        if self.stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Refuses to begin what is no longer wanted.
    pub(crate) fn goes_on(&self) -> polhode::Result<()> {
        if self.stop.load(Ordering::Relaxed) { Err(polhode::Error::Interrupted { steps: 0 }) } else { Ok(()) }
    }
}

/// How often the calling thread looks.
const PAUSE: Duration = Duration::from_millis(50);

/// How long an interrupted run may take to end; a plan does not ask whether to stop, and its thread then ends by itself.
const GRACE: Duration = Duration::from_secs(2);

/// The main thread's own, which formulas with many parentheses may need.
const STACK: usize = 8 << 20;

/// Runs `work` without Python's global lock. `progress` is called with what is done and the whole, both `None` before that is known; where it
/// raises, or a signal is to raise (Ctrl-C), the work is stopped and that is raised.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Watch) -> T + Send + 'static,
) -> PyResult<T> {
    let watch = Arc::new(Watch::default());
    let (sender, receiver) = channel();
    let of_worker = Arc::clone(&watch);
    let spawned = Builder::new().name("polhode".to_owned()).stack_size(STACK).spawn(move || {
        // Nobody may be listening any more.
        let _ = sender.send(catch_unwind(AssertUnwindSafe(|| work(&of_worker))));
    });
    spawned.map_err(|error| PyRuntimeError::new_err(format!("no thread to compute with: {error}")))?;
    // Held by one thread at a time, which Python's lock does not see.
    let receiver = Mutex::new(receiver);
    let wait = || {
        py.detach(|| match receiver.lock() {
            Ok(receiver) => receiver.recv_timeout(PAUSE),
            Err(_) => Err(RecvTimeoutError::Disconnected),
        })
    };
    loop {
        match wait() {
            Ok(Ok(done)) => return Ok(done),
            Ok(Err(panic)) => resume_unwind(panic),
            Err(RecvTimeoutError::Disconnected) => return Err(PyRuntimeError::new_err("the computing thread is gone")),
            Err(RecvTimeoutError::Timeout) => {}
        }
        let shown = progress.map_or(Ok(()), |progress| {
            let total = watch.total.load(Ordering::Relaxed);
            let of = |number: u64| (total > 0).then_some(number);
            progress.call1((of(watch.done.load(Ordering::Relaxed)), of(total))).map(drop)
        });
        if let Err(raised) = py.check_signals().and(shown) {
            watch.stop.store(true, Ordering::Relaxed);
            let since = Instant::now();
            while since.elapsed() < GRACE && matches!(wait(), Err(RecvTimeoutError::Timeout)) {}
            return Err(raised);
        }
    }
}
