//! Work on the processor's threads, and the thread that watches it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use super::{Observer, Progress};

/// The progress of some work and whether it continues, shared by all threads that do a part of it.
#[derive(Debug, Default)]
pub struct Watch {
    done: AtomicU64,
    stop: Arc<AtomicBool>,
}

impl Watch {
    /// Adds to the work done: body-steps, or bodies that have arrived.
    pub fn add(&self, done: u64) {
        self.done.fetch_add(done, Ordering::Relaxed);
    }

    /// Sets the work done, if one thread does it all.
    pub fn set(&self, done: u64) {
        self.done.store(done, Ordering::Relaxed);
    }

    /// The work done so far.
    pub fn done(&self) -> u64 {
        self.done.load(Ordering::Relaxed)
    }

    /// Whether to continue; if not, the rest is left undone.
    pub fn goes_on(&self) -> bool {
        !self.stop.load(Ordering::Relaxed)
    }

    /// A watch with a count of its own that stops with this one.
    pub(crate) fn beside(&self) -> Self {
        Self { done: AtomicU64::new(0), stop: Arc::clone(&self.stop) }
    }

    /// Ends the work of all.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// Work for the threads of the host, run once, alone or beside other jobs.
pub type Job<'a> = Box<dyn FnOnce(&Watch) + Send + 'a>;

/// How often progress is reported.
const PAUSE: Duration = Duration::from_millis(100);

/// Work that takes less time stays on the calling thread: another would have to be woken, and nobody waits long for news of it.
const SHORT: f64 = 2e-4;

/// How long the work of intervals takes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pace {
    /// The last interval and the time that it took, s; none yet if both are 0.
    span: f64,
    taken: f64,
}

impl Pace {
    /// As [`watched`], for the work of an interval of `span` seconds, on the calling thread if it is expected to be short.
    pub fn watched(
        &mut self,
        span: f64,
        work: impl FnOnce(&Watch) + Send,
        total: u64,
        observer: &mut Observer<'_>,
    ) -> std::result::Result<(), u64> {
        let clock = Instant::now();
        let is_short = self.span > 0.0 && self.taken * span < SHORT * self.span;
        let finished = if is_short {
            let watch = Watch::default();
            work(&watch);
            let done = watch.done();
            // An interrupt is noticed here, as no thread looks for one meanwhile.
            if observer(Progress { done, total }).is_break() { Err(done) } else { Ok(()) }
        } else {
            watched(work, total, observer)
        };
        (self.span, self.taken) = (span, clock.elapsed().as_secs_f64());
        finished
    }
}

/// Runs `work`, `total` units of it, on the current thread pool while this thread reports progress, about ten times a
/// second. If the observer breaks, the error is the work done until then.
///
/// Called on a thread of a pool, as inside [`rayon::ThreadPool::install`], it uses that pool, and this thread works too.
pub(crate) fn watched(
    work: impl FnOnce(&Watch) + Send,
    total: u64,
    observer: &mut Observer<'_>,
) -> std::result::Result<(), u64> {
    let watch = Watch::default();
    let mut report = || {
        // Once it has broken it is not asked again; if it panics, the work ends too.
        let _stop = StopOnPanic(&watch);
        if watch.goes_on() && observer(Progress { done: watch.done(), total }).is_break() {
            watch.stop();
        }
    };
    if rayon::current_thread_index().is_some() {
        let finished = AtomicBool::new(false);
        rayon::in_place_scope(|scope| {
            scope.spawn(|_| {
                work(&watch);
                finished.store(true, Ordering::Release);
            });
            let mut last = Instant::now();
            while !finished.load(Ordering::Acquire) {
                if rayon::yield_now() != Some(rayon::Yield::Executed) {
                    std::thread::sleep(PAUSE / 100);
                }
                if last.elapsed() >= PAUSE {
                    report();
                    last = Instant::now();
                }
            }
        });
    } else {
        let (finished, wait) = std::sync::mpsc::channel::<()>();
        // On a thread of the pool, which is there already, and from which the others are soon woken.
        rayon::in_place_scope(|scope| {
            scope.spawn(|_| {
                work(&watch);
                drop(finished);
            });
            while wait.recv_timeout(PAUSE) == Err(std::sync::mpsc::RecvTimeoutError::Timeout) {
                report();
            }
        });
    }
    if !watch.goes_on() {
        return Err(watch.done());
    }
    // All is done, whatever the observer says.
    let _ = observer(Progress { done: watch.done(), total });
    Ok(())
}

/// Stops the work if this thread panics.
struct StopOnPanic<'w>(&'w Watch);

impl Drop for StopOnPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.stop();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;

    #[test]
    fn only_short_work_stays_on_the_calling_thread() {
        let here = std::thread::current().id();
        let mut go_on = |_: Progress| ControlFlow::Continue(());
        let mut pace = Pace::default();
        // Intervals and where their work is expected: nothing is known of the first, and a thousand times as long is not short.
        for (span, stays) in [(1.0, false), (1.0, true), (1000.0, false)] {
            let mut place = None;
            pace.taken = 1e-6;
            let work = |watch: &Watch| {
                place = Some(std::thread::current().id());
                watch.add(1);
            };
            assert_eq!(pace.watched(span, work, 1, &mut go_on), Ok(()));
            assert_eq!(place == Some(here), stays, "{span} s");
        }
    }

    /// Work of many short parts, which goes on until it is stopped.
    fn endless(watch: &Watch) {
        while watch.goes_on() {
            watch.add(1);
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn an_observer_that_breaks_is_not_asked_again() {
        let mut asked = 0;
        // Goes on for longer than it takes to be asked again.
        let lingering = |watch: &Watch| {
            endless(watch);
            std::thread::sleep(3 * PAUSE);
        };
        let stopped = watched(lingering, 9, &mut |_| {
            asked += 1;
            ControlFlow::Break(())
        });
        assert!(stopped.is_err() && asked == 1, "{stopped:?}, {asked}");
    }

    #[test]
    fn work_ends_where_the_observer_panics() {
        let found = std::panic::catch_unwind(|| watched(endless, 9, &mut |_| panic!("no observer")));
        assert!(found.is_err());
    }

    #[test]
    fn an_interrupt_is_noticed_after_short_work() {
        let mut pace = Pace { span: 1.0, taken: 1e-6 };
        let stopped = pace.watched(1.0, |watch| watch.add(3), 7, &mut |_| ControlFlow::Break(()));
        assert_eq!(stopped, Err(3));
    }
}
