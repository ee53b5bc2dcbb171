//! How long planning may take: said while it is under way, and kept to.
//!
//! What a pilot may try is limited in steps, so that a plan that is made again is the same. How long that takes depends on the machine
//! and on what else it does, and shows in the first seconds. Whoever waits is then told by when planning ends at the latest
//! ([`super::Plan::announced`]); planning that comes to that time is refused, so that a plan never depends on the clock.

use std::sync::mpsc::RecvTimeoutError;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::engine::watch::Watch;
use crate::error::{Error, Result};

/// Planning that takes less is not announced.
const QUIET: Duration = Duration::from_secs(2);

/// By how much longer than the steps that may be tried, at the speed of those that were, planning may take: the machine may become busier, and
/// a pass may take more steps than were expected of it.
const MARGIN: f64 = 2.0;

/// What is always allowed, s: passes are counted when they are through.
const LEAST: f64 = 10.0;

/// How much longer than in the table steps are expected to take before any were timed.
const UNTIMED: f64 = 4.0;

/// How much of its budget planning has used, and when it has to end.
pub(super) struct TimeLimit {
    begin: Instant,
    spent: Mutex<Spent>,
    /// What passes over pilots' bodies ask whether to go on.
    pub watch: Watch,
}

/// Times in the shipped table's seconds of one core.
#[derive(Clone, Copy, Debug, Default)]
struct Spent {
    /// What was stepped so far, and when that was.
    used: f64,
    until: f64,
    /// What may be stepped in all.
    allowed: f64,
    /// The wall time, s, at whose end planning is refused, once it has been said.
    said: Option<f64>,
}

impl Spent {
    /// The wall time, s, that planning takes at most, of which `elapsed` have passed.
    fn most(&self, elapsed: f64) -> f64 {
        let slowness = if self.used > 0.0 { self.until / self.used } else { UNTIMED };
        let rest = (self.allowed - self.used).max(0.0);
        rounded_up(elapsed + LEAST + MARGIN * slowness * rest)
    }
}

/// Seconds as they are said: in tens, and in minutes from ten on.
fn rounded_up(seconds: f64) -> f64 {
    let unit = if seconds < 600.0 { 10.0 } else { 60.0 };
    (seconds / unit).ceil() * unit
}

impl TimeLimit {
    /// Of planning that begins now.
    pub fn new() -> Self {
        Self { begin: Instant::now(), spent: Mutex::default(), watch: Watch::default() }
    }

    fn spent(&self) -> std::sync::MutexGuard<'_, Spent> {
        self.spent.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Says that what is left to be tried takes up to `seconds` of the table.
    pub fn expect(&self, seconds: f64) {
        let mut spent = self.spent();
        spent.allowed = spent.used + seconds;
    }

    /// Takes note of a pass that took `seconds` of the table.
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

    /// What `work` comes to; where that takes longer than a while, `announce` is told how long it takes at most, and passes are broken off then.
    pub fn held<T>(&self, work: impl FnOnce() -> T, announce: impl FnOnce(Duration) + Send) -> T {
        std::thread::scope(|scope| {
            let (finished, wait) = std::sync::mpsc::channel::<()>();
            // Without this thread nothing is said, and nothing broken off.
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

    /// The time that planning takes at most, which is kept to from now on.
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
        // Steps that the table says to take 3 s took 6.
        let spent = Spent { used: 3.0, until: 6.0, allowed: 18.0, said: None };
        assert_eq!(spent.most(7.0), 80.0, "7 + 10 + 2 x 2 x 15, in tens");
        // More than was allowed: there is no less than nothing.
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
