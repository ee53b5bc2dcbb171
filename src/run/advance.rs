//! Advances all groups of a run from one output time to the next.

use std::ops::ControlFlow;
use std::time::Duration;

use super::group_run::GroupRun;
use crate::engine::watch::{Pace, Watch, watched};
use crate::engine::{Observer, Progress};
use crate::error::{Error, Result};
use crate::math::parallel;

/// Brings all groups from `time − span` to `time`, s: those that the host's threads step together, and meanwhile the
/// others one by one. Groups that are not stepped are formed only if they are `wanted`. `done`, out of `total`, grows
/// by the work done.
pub(super) fn advance(
    group_runs: &mut [GroupRun<'_>],
    (time, span): (f64, f64),
    wanted: bool,
    (done, total): (&mut u64, u64),
    pace: &mut Pace,
    observer: &mut Observer<'_>,
) -> Result<()> {
    let bodies = group_runs.iter().map(|group_run| group_run.body_count() as u64).sum::<u64>().max(1);
    let (on_host, mut others): (Vec<_>, Vec<_>) = group_runs.iter_mut().partition(|group_run| group_run.has_job());
    let (is_on_host, is_alone) = (!on_host.is_empty(), others.is_empty());
    let mut jobs = Vec::new();
    for group_run in on_host {
        jobs.extend(group_run.job(time, span)?);
    }
    let before = *done;
    let work = |watch: &Watch| parallel::for_each_task(jobs, |_, job| job(watch));
    let mut advance_others = |observer: &mut Observer<'_>| -> Result<u64> {
        others.iter_mut().try_fold(0, |sum: u64, group_run| {
            let mut report = |progress: Progress| observer(Progress { done: sum.saturating_add(progress.done), total });
            Ok(sum.saturating_add(group_run.advance(time, span, wanted, &mut report)?))
        })
    };
    if !is_on_host {
        let mut report = |progress: Progress| observer(Progress { done: before.saturating_add(progress.done), total });
        *done = before.saturating_add(advance_others(&mut report)?);
        return Ok(());
    }
    if is_alone {
        let mut own = 0;
        let mut report = |progress: Progress| {
            own = progress.done;
            observer(Progress { done: before.saturating_add(own), total })
        };
        let finished = pace.watched(span, work, total, &mut report);
        *done = before.saturating_add(own);
        return finished.map_err(|_| Error::Interrupted { steps: *done / bodies });
    }
    // This thread follows the progress of the host's threads; another waits for the device and follows its progress.
    let of_others = Watch::default();
    std::thread::scope(|scope| {
        let others = scope.spawn(|| {
            advance_others(&mut |progress| {
                of_others.set(progress.done);
                if of_others.goes_on() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            })
        });
        let mut report = |progress: Progress| {
            *done = before.saturating_add(progress.done).saturating_add(of_others.done());
            if !of_others.goes_on() {
                return ControlFlow::Break(());
            }
            let answer = observer(Progress { done: *done, total });
            if answer.is_break() {
                of_others.stop();
            }
            answer
        };
        let mut own = 0;
        let finished = watched(work, total, &mut |progress| {
            own = progress.done;
            report(progress)
        });
        while !others.is_finished() {
            std::thread::sleep(POLL);
            let _ = report(Progress { done: own, total });
        }
        let of_others = others.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        finished.map_err(|_| Error::Interrupted { steps: *done / bodies })?;
        *done = before.saturating_add(own).saturating_add(of_others?);
        Ok(())
    })
}

/// The interval at which this thread checks whether the device has finished.
const POLL: Duration = Duration::from_millis(2);
