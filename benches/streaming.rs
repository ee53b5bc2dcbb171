//! What writing tables costs: studies whose states go to files, and the same whose states are formed, handed on and forgotten.
//!
//! ```text
//! cargo bench --bench streaming -- [RUNS, 5]
//! ```
//!
//! The two take turns on the CPU engine. Figures are medians of their wall and processor times; beside them stands what it takes to write as many
//! bytes, which are there already, to a file of the same file system, and to wait for the disk.

use std::fs::{self, File};
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

use polhode::plan::PlanDocument;
use polhode::record::{OutputFolder, OutputState, Sink};
use polhode::run::{Checkpoint, run_into, run_to_folder, write_plan};
use polhode::study::Study;
use polhode::{Engine, Plan, Result};

/// Driven bodies for a time, with what else stands in `[time]`, and the accuracy asked for.
fn driven(end: f64, time: &str, accuracy: &str, output: &str) -> String {
    format!(
        r#"
seed = 7
[bodies]
count = 300_000
inertia = {{ moments = [1.0, 1.7, 2.2], scatter = 0.2 }}
orientation = {{ distribution = "uniform" }}
angular_velocity = {{ distribution = "normal", mean = 0.0, sigma = 0.02 }}
[[torque]]
model = "gravity-gradient"
mu = 3.986004418e14
orbit = {{ radius = 7.0e6 }}
[[torque]]
model = "linear-drag"
coefficient = {{ distribution = "uniform", low = 1e-5, high = 1e-4 }}
[time]
end = {end:?}
{time}
[accuracy]
{accuracy}
[output]
{output}
"#
    )
}

/// Ten million free bodies, which are run some at a time.
const FREE: &str = r#"
seed = 7
[bodies]
count = 10_000_000
inertia = { moments = [1.0, 1.7, 2.2], scatter = 0.2 }
orientation = { distribution = "uniform" }
angular_velocity = { distribution = "normal", mean = 0.0, sigma = 0.02 }
[time]
end = 600.0
[output]
final = true
format = "parquet"
statistics = ["spin_rate"]
"#;

fn main() -> Result<()> {
    let runs = std::env::args().skip(1).find_map(|argument| argument.parse().ok()).unwrap_or(5);
    let engine = Engine::cpu();
    let of_end = |format: &str| format!("final = true\nformat = \"{format}\"");
    let of_all = |format: &str| format!("final = false\nsnapshots = true\nformat = \"{format}\"");
    let (asked, often) = ("attitude = 1e-6", "outputs = { every = 120.0 }");
    let cases = [
        ("final states, Parquet", driven(600.0, "", asked, &of_end("parquet"))),
        ("final states, CSV", driven(600.0, "", asked, &of_end("csv"))),
        ("each 20 minutes, Parquet", driven(7200.0, "outputs = { every = 1200.0 }", asked, &of_all("parquet"))),
        ("each 2 minutes, Parquet", driven(3600.0, often, asked, &of_all("parquet"))),
        ("each 2 minutes, NPZ", driven(3600.0, often, asked, &of_all("npz"))),
        (
            "each 16 steps of rk4, Parquet",
            driven(960.0, "outputs = { every = 32.0 }", "method = \"rk4\"\ndt = 2.0", &of_all("parquet")),
        ),
        ("10^7 free bodies, final states, Parquet", FREE.to_owned()),
    ];
    let desk = std::env::current_dir().unwrap_or_default().join(format!("target/streaming-{}", std::process::id()));
    let done = cases.iter().try_for_each(|(name, text)| case(&engine, name, text, &desk, runs));
    let _ = fs::remove_dir_all(&desk);
    done
}

/// Wall and processor time, s.
type Times = [f64; 2];

fn case(engine: &Engine, name: &str, text: &str, desk: &Path, runs: usize) -> Result<()> {
    let study = Study::parse(Path::new("study.toml"), text)?;
    let results = desk.join("results");
    let (mut without, mut with, mut copied, mut bytes) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for _ in 0..runs {
        without.push(timed(|| forgotten(engine, &study, desk))?);
        let _ = fs::remove_dir_all(&results);
        with.push(timed(|| written(engine, &study, &results))?);
        bytes = ["final", "snapshots"]
            .iter()
            .filter_map(|stem| fs::metadata(results.join(format!("{stem}.{}", study.output().format.name()))).ok())
            .map(|file| file.len())
            .sum();
        copied.push(timed(|| {
            copy(&desk.join("bytes"), bytes).expect("the disk takes as much again");
            Ok(())
        })?);
    }
    let ([wall, processor], [more_wall, more_processor], [disk, _]) =
        (medians(without), medians(with), medians(copied));
    let more = |before: f64, after: f64| 100.0 * (after / before - 1.0);
    println!(
        "{name}: {:.0} MB; wall {wall:.2} -> {more_wall:.2} s ({:+.0} %), processor {processor:.2} -> {more_processor:.2} s ({:+.0} %); \
         the bytes alone {disk:.2} s",
        bytes as f64 / 1e6,
        more(wall, more_wall),
        more(processor, more_processor),
    );
    Ok(())
}

/// Takes what tables would have.
struct Forgetful {
    every_output: bool,
}

impl Sink for Forgetful {
    fn wants(&mut self, index: usize, count: usize, _: f64) -> bool {
        self.every_output || index + 1 == count
    }

    fn bodies(&mut self, _: usize, _: f64, _: usize, states: &[OutputState]) -> Result<()> {
        std::hint::black_box(states);
        Ok(())
    }
}

/// Whether a study is run some bodies at a time.
fn is_cut(study: &Study) -> bool {
    Checkpoint::planned_bodies(study).len() < study.bodies().count
}

/// Runs a study whose states nobody keeps, in the pieces of one that writes them.
fn forgotten(engine: &Engine, study: &Study, desk: &Path) -> Result<()> {
    let mut sink = Forgetful { every_output: study.output().snapshots };
    let mut run = |plan: &Plan<'_>| run_into(engine, plan, &mut sink, &mut |_| ControlFlow::Continue(())).map(drop);
    let scene = study.clone().part(Checkpoint::planned_bodies(study)).scene()?;
    let plan = Plan::new(&scene, engine)?;
    if !is_cut(study) {
        return run(&plan);
    }
    fs::create_dir_all(desk).expect("a folder can be made");
    write_plan(&plan, &desk.join("plan.json"))?;
    let document = PlanDocument::read(&desk.join("plan.json"))?;
    let all = study.bodies().count;
    for start in (0..all).step_by(PIECE) {
        let scene = study.clone().part(start..(start + PIECE).min(all)).scene()?;
        run(&Plan::repeated(&scene, engine, &document)?)?;
    }
    Ok(())
}

/// Bodies of a piece of a run that writes through.
const PIECE: usize = 1 << 18;

/// Runs a study into a folder, as the command does.
fn written(engine: &Engine, study: &Study, results: &Path) -> Result<()> {
    let since = Instant::now();
    let mut folder = OutputFolder::create(results, true)?;
    let scene = study.clone().part(Checkpoint::planned_bodies(study)).scene()?;
    let plan = Plan::new(&scene, engine)?;
    let mut observer = |_| ControlFlow::Continue(());
    if !is_cut(study) {
        return run_to_folder(engine, &plan, Some(study), study.output(), folder, since, &mut observer).map(drop);
    }
    let mut checkpoint = Checkpoint::begin(&Checkpoint::folder_of(results), &plan)?;
    checkpoint.write_through(study, &plan, &mut folder)?;
    checkpoint.advance(
        engine,
        study,
        Duration::from_secs(60),
        &mut |_, _, _| ControlFlow::Continue(()),
        &mut observer,
    )?;
    checkpoint.finish(folder, &mut observer).map(drop)
}

/// Writes bytes to a file, waits until they are on the disk, and removes it.
fn copy(path: &Path, bytes: u64) -> std::io::Result<()> {
    const AT_ONCE: u64 = 1 << 20;
    let block = vec![1; AT_ONCE as usize];
    fs::create_dir_all(path.parent().unwrap_or(path))?;
    let mut file = File::create(path)?;
    for start in (0..bytes).step_by(AT_ONCE as usize) {
        file.write_all(&block[..AT_ONCE.min(bytes - start) as usize])?;
    }
    file.sync_all()?;
    fs::remove_file(path)
}

fn timed(work: impl FnOnce() -> Result<()>) -> Result<Times> {
    let (clock, processor) = (Instant::now(), processor_time());
    work()?;
    Ok([clock.elapsed().as_secs_f64(), processor_time() - processor])
}

/// That of this process, user and system, s; of other systems than Linux NaN.
fn processor_time() -> f64 {
    // Fields 14 and 15, in hundredths of a second, behind a name that may hold anything.
    let text = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<f64> =
        text.rsplit(')').next().unwrap_or_default().split_whitespace().filter_map(|field| field.parse().ok()).collect();
    // The state, which is no number, is the third.
    match fields.get(10..12) {
        Some(used) => used.iter().sum::<f64>() / 100.0,
        None => f64::NAN,
    }
}

fn medians(mut times: Vec<Times>) -> Times {
    std::array::from_fn(|which| {
        times.sort_by(|a, b| a[which].total_cmp(&b[which]));
        times[times.len() / 2][which]
    })
}
