//! Progress and Ctrl-C.

use std::io::IsTerminal;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use polhode::bench::Step;
use polhode::engine::Progress;
use polhode::plan::explain::SampleRow;
use polhode::record::Traces;
use polhode::run::Checkpoint;

use crate::run::time;

/// Whether the user has asked to stop.
static STOP: AtomicBool = AtomicBool::new(false);

/// A run shorter than this shows no bar, which would only flash.
const QUIET_START: Duration = Duration::from_millis(300);

/// The time after which a run says how far it is if standard error is no terminal.
const FIRST_LINE: Duration = Duration::from_secs(10);

/// The longest time between two such lines.
const LONGEST_GAP: Duration = Duration::from_secs(60);

/// Whether a plan is being made, which does not check whether to stop.
static PLANNING: AtomicBool = AtomicBool::new(false);

/// The spinner while a plan is made, if there is one.
static PLANNING_BAR: Mutex<Option<ProgressBar>> = Mutex::new(None);

/// What must be removed before a signal ends the process.
static TRACES: Mutex<Vec<Traces>> = Mutex::new(Vec::new());

/// What exists of a stopped run, and how to continue it, if anything does.
static LEFT: Mutex<Option<String>> = Mutex::new(None);

/// The folder of a checkpoint that has no piece yet, which is removed if the run is stopped.
static EMPTY: Mutex<Option<PathBuf>> = Mutex::new(None);

/// What a run finishes before it stops, because another run can continue from it.
static FINISHING: Mutex<Option<String>> = Mutex::new(None);

/// Whether a run has not written anything yet, so that it can be ended at any moment.
static RUNNING: AtomicBool = AtomicBool::new(false);

/// Whether the handler is ending the process.
static ENDING: AtomicBool = AtomicBool::new(false);

/// The time that a run has to end by itself: stages that do not check whether to stop (reading, drawing, preparing, waiting for a disk) are
/// then cut off.
const GRACE: Duration = Duration::from_millis(250);

/// Makes Ctrl-C (and a request to terminate) end the run in good order: within [`GRACE`], or when what it finishes is done. A second one,
/// and one while a plan is made, ends it at once.
pub fn catch_interrupts() {
    // If the handler cannot be set, Ctrl-C ends the process as it does by default.
    let _ = ctrlc::set_handler(|| {
        let second = STOP.swap(true, Ordering::SeqCst);
        if PLANNING.load(Ordering::SeqCst) {
            stop();
        }
        if second {
            stop_at_once();
        }
        if let Some(piece) = FINISHING.lock().ok().and_then(|finishing| finishing.clone()) {
            crate::output::note(&format!(
                "stopping when {piece} are computed; a second Ctrl-C stops at once, without them"
            ));
        } else if RUNNING.load(Ordering::SeqCst) {
            std::thread::sleep(GRACE);
            if RUNNING.load(Ordering::SeqCst) {
                stop();
            }
        }
    });
}

/// Sets what the run computes now and finishes before it stops; breaks if it must stop first.
pub fn finish_before_the_end(piece: Option<String>) -> ControlFlow<()> {
    let Ok(mut finishing) = FINISHING.lock() else { return ControlFlow::Break(()) };
    let stop = STOP.load(Ordering::SeqCst);
    *finishing = piece.filter(|_| !stop);
    if stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

/// Marks the beginning of a run, which may be ended at any moment until [`end_run`].
pub fn begin_run() {
    RUNNING.store(true, Ordering::SeqCst);
}

/// Marks that the run has written its results, or has failed.
pub fn end_run() {
    RUNNING.store(false, Ordering::SeqCst);
    wait_for_end();
    if let Ok(mut known) = TRACES.lock() {
        known.clear();
    }
}

/// Does not return if the handler is ending the process and removing the run's folder.
pub fn wait_for_end() {
    while ENDING.load(Ordering::SeqCst) {
        std::thread::sleep(GRACE / 100);
    }
}

/// Ends the process as a stopped run does, unless its results are complete.
fn stop() {
    ENDING.store(true, Ordering::SeqCst);
    let Ok(traces) = TRACES.lock() else { return };
    if !traces.iter().all(Traces::give_up) {
        ENDING.store(false, Ordering::SeqCst);
        return;
    }
    // Twice, as a file may be begun during the first pass.
    traces.iter().for_each(|traces| [(); 2].iter().for_each(|()| traces.remove()));
    remove_empty();
    crate::output::error(&stopped());
    std::process::exit(crate::FAILED.into());
}

/// Ends the process at once; a folder that is being moved to its place stays whole, and all others are removed.
fn stop_at_once() -> ! {
    if let Ok(traces) = TRACES.lock() {
        let open: Vec<&Traces> = traces.iter().filter(|traces| traces.give_up()).collect();
        open.iter().for_each(|traces| traces.remove());
        if open.len() == traces.len() {
            remove_empty();
        }
    }
    if RUNNING.load(Ordering::SeqCst) {
        crate::output::error(&stopped());
    }
    std::process::exit(crate::FAILED.into());
}

/// Removes a checkpoint that has no piece.
pub fn remove_empty() {
    if let Some(folder) = EMPTY.lock().ok().and_then(|empty| empty.clone()) {
        Checkpoint::remove(&folder);
    }
}

/// Sets what a signal that ends the process at once must remove.
pub fn remove_at_end(traces: Vec<Traces>) {
    if let Ok(mut known) = TRACES.lock() {
        *known = traces;
    }
}

/// Sets what would remain of the run if it were stopped now: a text, or a folder that is not worth keeping.
pub fn leave(left: Result<String, PathBuf>) {
    let (left, empty) = match left {
        Ok(left) => (Some(left), None),
        Err(folder) => (None, Some(folder)),
    };
    if let (Ok(mut known), Ok(mut folder)) = (LEFT.lock(), EMPTY.lock()) {
        (*known, *folder) = (left, empty);
    }
}

/// The message after a request to stop.
pub fn stopped() -> String {
    let left = LEFT.lock().ok().and_then(|left| left.clone());
    let left = left.unwrap_or_else(|| "nothing was written".to_owned());
    format!("stopped by the user: {left}")
}

/// Makes a plan, whose progress cannot be shown: a spinner turns on standard error if it takes long, unless `quiet`, and if it takes more
/// than a moment the longest time that it may take is announced. A request to stop ends the process at once.
pub fn planning<T>(quiet: bool, plan: impl FnOnce(fn(Duration)) -> T) -> T {
    PLANNING.store(true, Ordering::SeqCst);
    // It was requested before, while bodies were drawn, when the handler did not know that a plan would follow.
    if STOP.load(Ordering::SeqCst) {
        stop();
    }
    let shown = !quiet && std::io::stderr().is_terminal();
    let planned = std::thread::scope(|scope| {
        let (finished, wait) = std::sync::mpsc::channel::<()>();
        // Without this thread there is only no spinner.
        let _ = std::thread::Builder::new().spawn_scoped(scope, move || {
            if shown && wait.recv_timeout(QUIET_START) == Err(RecvTimeoutError::Timeout) {
                let bar = planning_bar();
                leave_bar(Some(bar.clone()));
                let _ = wait.recv();
                leave_bar(None);
                bar.finish_and_clear();
            }
        });
        let announce = if quiet { |_| () } else { say_time_of_planning };
        let planned = plan(announce);
        drop(finished);
        planned
    });
    PLANNING.store(false, Ordering::SeqCst);
    planned
}

fn say_time_of_planning(most: Duration) {
    let seconds = most.as_secs();
    let time = if seconds < 600 { format!("{seconds} s") } else { format!("{} minutes", seconds.div_ceil(60)) };
    let note = || {
        crate::output::note(&format!(
            "note: methods and steps are tried on some bodies, which takes {time} at most and usually a small part of that; Ctrl-C ends it"
        ));
    };
    match PLANNING_BAR.lock().ok().and_then(|bar| bar.clone()) {
        Some(bar) => bar.suspend(note),
        None => note(),
    }
}

fn leave_bar(bar: Option<ProgressBar>) {
    if let Ok(mut shown) = PLANNING_BAR.lock() {
        *shown = bar;
    }
}

fn planning_bar() -> ProgressBar {
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    let style = ProgressStyle::with_template(
        "{spinner} planning: methods and steps are tried on some bodies, {elapsed} so far",
    );
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
    bar.enable_steady_tick(QUIET_START);
    bar
}

/// How progress is shown.
enum Display {
    Nothing,
    /// On a terminal, once there is something to show.
    Bar(Option<ProgressBar>),
    /// In a file or a pipe.
    Lines(Lines),
}

/// Lines that come now and then, with gaps as long as the time before, up to [`LONGEST_GAP`].
struct Lines {
    next: Duration,
}

impl Lines {
    /// Whether a line is due `elapsed` after the start.
    fn is_due(&mut self, elapsed: Duration) -> bool {
        let is_due = elapsed >= self.next;
        if is_due {
            self.next = elapsed + elapsed.min(LONGEST_GAP);
        }
        is_due
    }

    /// Writes a line if one is due.
    fn say(&mut self, elapsed: Duration, line: impl FnOnce() -> String) {
        if self.is_due(elapsed) {
            crate::output::note(&format!("note: {}", line()));
        }
    }
}

/// How far work is, and how long the rest takes if it is like what was done.
fn how_far(done: u64, total: u64, elapsed: Duration) -> String {
    let share = done as f64 / total.max(1) as f64;
    let seconds = elapsed.as_secs_f64();
    let left = seconds * (1.0 - share) / share;
    let left = if left.is_finite() { format!(", about {} left", time(left.max(0.0))) } else { String::new() };
    format!("{:.1} % done after {}{left}", 100.0 * share, time(seconds))
}

/// Shows the progress of a run, and tells it to stop when the user asks for it.
pub struct Watch {
    display: Display,
    start: Instant,
    /// What is recomputed after the last step.
    sample: Option<SampleRow>,
    is_recomputing: bool,
}

impl Watch {
    /// With a bar on standard error if that is a terminal, else with a line now and then; with neither if `quiet`.
    pub fn new(quiet: bool) -> Self {
        let display = match quiet {
            true => Display::Nothing,
            false if std::io::stderr().is_terminal() => Display::Bar(None),
            false => Display::Lines(Lines { next: FIRST_LINE }),
        };
        Self { display, start: Instant::now(), sample: None, is_recomputing: false }
    }

    /// For a run whose steps are followed by recomputing a sample.
    pub fn with_sample(self, sample: SampleRow) -> Self {
        Self { sample: Some(sample), ..self }
    }

    /// Shows progress; returns whether to stop.
    pub fn observe(&mut self, progress: Progress) -> ControlFlow<()> {
        let (Progress { done, total }, elapsed) = (progress, self.start.elapsed());
        let follows = self.sample.filter(|_| done >= total);
        match &mut self.display {
            Display::Bar(bar) if elapsed > QUIET_START => {
                let bar = bar.get_or_insert_with(|| run_bar(total, self.start));
                // The total may become known only during the run.
                bar.set_length(total);
                bar.set_position(done);
                if let Some(sample) = follows.filter(|_| !self.is_recomputing) {
                    self.is_recomputing = true;
                    bar.set_style(recomputing_style());
                    bar.set_message(recomputing(&sample));
                }
            }
            Display::Lines(lines) => lines.say(elapsed, || match follows {
                Some(sample) => format!("{}; {} so far", recomputing(&sample), time(elapsed.as_secs_f64())),
                None => how_far(done, total, elapsed),
            }),
            Display::Bar(_) | Display::Nothing => {}
        }
        if STOP.load(Ordering::SeqCst) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Shows a benchmark's progress.
    pub fn observe_case(&mut self, step: Step<'_>) -> ControlFlow<()> {
        let (done, total) = (step.done as u64, step.total as u64);
        match &mut self.display {
            Display::Bar(bar) => {
                let bar = bar.get_or_insert_with(|| case_bar(total));
                bar.set_position(done);
                bar.set_message(step.label.to_owned());
            }
            Display::Lines(lines) if done < total => {
                let elapsed = self.start.elapsed();
                lines.say(elapsed, || format!("{}; next {}", how_far(done, total, elapsed), step.label));
            }
            Display::Lines(_) | Display::Nothing => {}
        }
        if STOP.load(Ordering::SeqCst) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Removes the bar.
    pub fn finish(self) {
        if let Display::Bar(Some(bar)) = self.display {
            bar.finish_and_clear();
        }
    }
}

/// The message about what is done after the last step.
fn recomputing(sample: &SampleRow) -> String {
    let seconds = sample.seconds.filter(|seconds| *seconds >= 1.0);
    let seconds = seconds.map_or(String::new(), |seconds| format!(", which takes about {seconds:.0} s"));
    format!("all steps are taken: states are read, and {} bodies recomputed{seconds}", sample.bodies)
}

fn recomputing_style() -> ProgressStyle {
    let style = ProgressStyle::with_template("{msg}; {elapsed} so far");
    style.unwrap_or_else(|_| ProgressStyle::default_bar())
}

/// A bar that names the case under way.
fn case_bar(total: u64) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
    let style = ProgressStyle::with_template("{bar:32} {pos}/{len}  {msg}  {elapsed} so far");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}

/// A bar whose rate and remaining time are means since the start: the work is uniform.
fn run_bar(total: u64, start: Instant) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
    let rate = move |state: &ProgressState| state.pos() as f64 / start.elapsed().as_secs_f64();
    let style = ProgressStyle::with_template("{bar:32} {percent:>3}%  {rate} body-steps/s  {remaining} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar())
        .with_key("rate", move |state: &ProgressState, text: &mut dyn std::fmt::Write| {
            let _ = write!(text, "{:.2e}", rate(state));
        })
        .with_key("remaining", move |state: &ProgressState, text: &mut dyn std::fmt::Write| {
            let seconds = state.len().unwrap_or(0).saturating_sub(state.pos()) as f64 / rate(state);
            // A rate of zero gives an infinite time, which is not shown.
            if let Ok(left) = Duration::try_from_secs_f64(seconds) {
                let _ = write!(text, "{:#}", HumanDuration(left));
            }
        });
    bar.set_style(style);
    bar
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_after_ten_seconds_and_then_ever_more_rarely() {
        let mut lines = Lines { next: FIRST_LINE };
        let due: Vec<u64> = (0..=300).filter(|&second| lines.is_due(Duration::from_secs(second))).collect();
        assert_eq!(due, [10, 20, 40, 80, 140, 200, 260]);
        // Where nothing was heard for a while, one line follows, not all that were due.
        let mut lines = Lines { next: FIRST_LINE };
        let due = [500, 501, 559, 560].map(|second| lines.is_due(Duration::from_secs(second)));
        assert_eq!(due, [true, false, false, true]);
    }

    #[test]
    fn lines_say_how_far_the_work_is() {
        let said = |done, total, seconds| how_far(done, total, Duration::from_secs(seconds));
        assert_eq!(said(1, 8, 10), "12.5 % done after 10 s, about 70 s left");
        assert_eq!(said(1 << 40, 1 << 50, 7200), "0.1 % done after 2 hours, about 85 days left");
        assert_eq!(said(8, 8, 200), "100.0 % done after 3 minutes, about 0 s left");
        // Nothing is known of the rest.
        assert_eq!(said(0, 8, 10), "0.0 % done after 10 s");
        assert_eq!(said(0, 0, 10), "0.0 % done after 10 s");
    }
}
