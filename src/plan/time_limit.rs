//! A limit on the time of planning: announced while it is under way, and kept.
//!
//! What a pilot may try is limited in steps, so that a plan that is made again is the same. How long the steps take depends on the machine
//! and its load, and shows in the first seconds. The caller is then told when planning ends at the latest
//! ([`super::Plan::announced`]). Planning that reaches that time is refused, so that a plan never depends on the clock.

use std::sync::mpsc::RecvTimeoutError;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::engine::watch::Watch;
use crate::error::{Error, Result};

/// Planning that takes less is not announced.
const QUIET: Duration = Duration::from_secs(2);

/// The ratio of the limit to the time of the steps that may be tried, at the speed so far: the machine may become busier, and a pass may
/// take more steps than expected.
const MARGIN: f64 = 2.0;

/// The least limit, s: a pass is counted when it ends.
const LEAST: f64 = 10.0;

/// The assumed ratio of actual to tabulated time, before any steps were timed.
const UNTIMED: f64 = 4.0;

/// How much of its budget planning has used, and when it has to end.
pub(super) struct TimeLimit {
    begin: Instant,
    spent: Mutex<Spent>,
    /// The watch that passes over pilots' bodies ask whether to go on.
    pub watch: Watch,
}

/// Times spent, in the shipped table's seconds of one core.
#[derive(Clone, Copy, Debug, Default)]
struct Spent {
    /// The time stepped so far, and when that was.
    used: f64,
    until: f64,
    /// The time that may be stepped in all.
    allowed: f64,
    /// The announced wall time, s, at which planning is refused; `None` if not announced.
    said: Option<f64>,
}

impl Spent {
    /// The longest wall time of planning, s, of which `elapsed` have passed.
    fn most(&self, elapsed: f64) -> f64 {
        let slowness = if self.used > 0.0 { self.until / self.used } else { UNTIMED };
        let rest = (self.allowed - self.used).max(0.0);
        rounded_up(elapsed + LEAST + MARGIN * slowness * rest)
    }
}

/// Seconds rounded up for display: to tens, and to minutes from ten minutes on.
fn rounded_up(seconds: f64) -> f64 {
    let unit = if seconds < 600.0 { 10.0 } else { 60.0 };
    (seconds / unit).ceil() * unit
}

impl TimeLimit {
    /// A limit for planning that begins now.
    pub fn new() -> Self {
        Self { begin: Instant::now(), spent: Mutex::default(), watch: Watch::default() }
    }

    fn spent(&self) -> std::sync::MutexGuard<'_, Spent> {
        self.spent.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Records that the remaining trials take up to `seconds` of the table.
    pub fn expect(&self, seconds: f64) {
        let mut spent = self.spent();
        spent.allowed = spent.used + seconds;
    }

    /// Records a pass that took `seconds` of the table.
    ///
    /// # Errors
    ///
    /// [`Error::PlanningTime`] where the time is up, and the pass was broken off.
    pub fn passed(&self, seconds: f64) -> Result<()> {
        let mut spent = self.spent();
        spent.used += seconds;
        spent.until = self.begin.elapsed().as_secs_f64();
        match spent.said {
            Some(seconds) if !self.watch.goes_on() => Err(Error::PlanningTime { seconds }),
            _ => Ok(()),
        }
    }

    /// Runs `work` and returns its result. If it takes long, `announce` is told how long it takes at most, and passes are broken off then.
    pub fn held<T>(&self, work: impl FnOnce() -> T, announce: impl FnOnce(Duration) + Send) -> T {
        std::thread::scope(|scope| {
            let (finished, wait) = std::sync::mpsc::channel::<()>();
            // Without this thread nothing is announced, and nothing is broken off.
            let _ = std::thread::Builder::new().spawn_scoped(scope, move || {
                if wait.recv_timeout(QUIET) != Err(RecvTimeoutError::Timeout) {
                    return;
                }
                let most = self.most_from_now();
                announce(most);
                if wait.recv_timeout(most.saturating_sub(self.begin.elapsed())) == Err(RecvTimeoutError::Timeout) {
                    self.watch.stop();
                }
            });
            let done = work();
            drop(finished);
            done
        })
    }

    /// The longest time of planning, which becomes the limit.
    fn most_from_now(&self) -> Duration {
        let mut spent = self.spent();
        let seconds = spent.most(self.begin.elapsed().as_secs_f64());
        spent.said = Some(seconds);
        Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_said_follows_from_the_speed_so_far() {
        // Steps that take 3 s by the table took 6.
        let spent = Spent { used: 3.0, until: 6.0, allowed: 18.0, said: None };
        assert_eq!(spent.most(7.0), 80.0, "7 + 10 + 2 x 2 x 15, in tens");
        // More than was allowed: what is left is not negative.
        assert_eq!(Spent { used: 20.0, ..spent }.most(7.0), 20.0);
        // Nothing timed yet.
        assert_eq!(Spent { allowed: 100.0, ..Spent::default() }.most(2.0), 840.0);
    }

    #[test]
    fn passes_go_on_until_the_time_that_was_said_and_are_then_refused() {
        let limit = TimeLimit::new();
        limit.expect(100.0);
        limit.passed(1.0).expect("nothing was said");
        limit.watch.stop();
        limit.passed(1.0).expect("nothing was said");
        let said = limit.most_from_now().as_secs_f64();
        assert_eq!(limit.passed(1.0), Err(Error::PlanningTime { seconds: said }));
    }

    #[test]
    fn short_work_is_not_announced_and_long_work_is_once() {
        let limit = TimeLimit::new();
        let mut said = Vec::new();
        assert_eq!(limit.held(|| 7, |most| said.push(most)), 7);
        assert!(said.is_empty());
        limit.held(|| std::thread::sleep(QUIET + QUIET / 4), |most| said.push(most));
        assert!(said.len() == 1 && said[0] > QUIET, "{said:?}");
        assert!(limit.watch.goes_on());
    }
}
