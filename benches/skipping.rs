//! What skipping saves: wall time of whole runs, plan and pilot included, with and without the work that a scene does not need.
//!
//! ```text
//! cargo bench --bench skipping
//! ```
//!
//! Figures are medians of runs that the scenes that are compared take in turns (of one with `--no-skip`) on the CPU engine, with the
//! estimated attitude error of a run beside them.

use std::time::Instant;

use glam::DVec3;
use polhode::record::Trust;
use polhode::study::problem;
use polhode::torque::Torque;
use polhode::{Accuracy, Engine, Ensemble, Plan, Result, Scene};

const REPEATS: usize = 15;
/// Asked for everywhere, rad.
const TARGET: f64 = 1e-6;

fn main() -> Result<()> {
    mixture()?;
    fast_spinner()?;
    long_way()
}

/// A torque and its mixtures: on how many bodies, and how strong it is for which of them.
type Driven = fn(usize, &dyn Fn(usize) -> f64) -> Vec<Torque>;

/// 90 % free and 10 % driven bodies against driving all of them.
fn mixture() -> Result<()> {
    let drag: Driven =
        |count, part| vec![Torque::linear_drag((0..count).map(|body| 0.05 * part(body)).collect::<Vec<_>>())];
    let sinusoid: Driven = |count, part| {
        let column = |axis: DVec3| (0..count).map(|body| axis * part(body)).collect::<Vec<_>>();
        vec![Torque::sinusoidal(column(DVec3::new(0.5, 0.3, -0.7)), column(DVec3::new(-0.2, 0.6, 0.4)), 1.5)]
    };
    // As in `problem::forced`.
    let forced: Driven = |count, part| {
        let (torque, drag) = (DVec3::new(0.5, 0.3, -0.7), |body: usize| 0.01 + 0.09 * (body % 100) as f64 / 100.0);
        vec![
            Torque::constant_body((0..count).map(|body| torque * part(body)).collect::<Vec<_>>()),
            Torque::linear_drag((0..count).map(|body| drag(body) * part(body)).collect::<Vec<_>>()),
        ]
    };
    for (count, span, name, torques) in [
        (100_000, 60.0, "sinusoid", sinusoid),
        (100_000, 60.0, "constant torque and drag", forced),
        (100_000, 60.0, "drag alone", drag),
        (100_000, 600.0, "drag alone", drag),
        (1_000_000, 60.0, "drag alone", drag),
    ] {
        let scene = |every: usize| -> Result<Scene> {
            let scene = Scene::new(problem::free(count, 5)?).until(span).accuracy(Accuracy::attitude(TARGET));
            let part = |body: usize| if body.is_multiple_of(every) { 1.0 } else { 0.0 };
            Ok(torques(count, &part).into_iter().fold(scene, Scene::torque))
        };
        println!("{count} bodies, {span} s, {TARGET:e} rad, {name}");
        let [all, tenth] = report([("all driven", &scene(1)?), ("90 % free, 10 % driven", &scene(10)?)], REPEATS)?;
        let [stepped] = report([("the same, all stepped (--no-skip)", &scene(10)?.skipping(false))], 1)?;
        println!(
            "{:<34} {:.1} % of driving all (at most 20 %), {:.1} % of stepping all\n",
            "",
            100.0 * tenth / all,
            100.0 * tenth / stepped
        );
    }
    Ok(())
}

/// One fast spinner among slow bodies against the slow ones alone.
fn fast_spinner() -> Result<()> {
    const BODIES: usize = 100_000;
    const SPAN: f64 = 60.0;
    let scene = |fast: f64| -> Result<Scene> {
        let slow = problem::free(BODIES, 6)?;
        let mut omega = slow.angular_velocity_body().to_vec();
        omega[777] = DVec3::new(0.3, 0.2, 1.0) * fast;
        let ensemble = Ensemble::from_columns(slow.inertia(), slow.orientation(), &omega)?;
        Ok(Scene::new(ensemble).until(SPAN).accuracy(Accuracy::attitude(TARGET)).torque(Torque::linear_drag(1e-4)))
    };
    println!("{BODIES} driven bodies, {SPAN} s, {TARGET:e} rad");
    let (slow, one) = (scene(1.0)?, scene(500.0)?);
    let [slow, one] = report([("slow bodies", &slow), ("one of them 500 times as fast", &one)], REPEATS)?;
    println!("{:<34} {:.2} times the time without it (less than 2)\n", "", one / slow);
    Ok(())
}

/// A scene of simple free bodies against stepping them.
fn long_way() -> Result<()> {
    const BODIES: usize = 10_000;
    const SPAN: f64 = 60.0;
    let scene = Scene::new(problem::free(BODIES, 7)?).until(SPAN).accuracy(Accuracy::attitude(TARGET));
    println!("{BODIES} free bodies, {SPAN} s, {TARGET:e} rad");
    let stepped = scene.clone().skipping(false);
    let [short, long] = report([("closed form", &scene), ("--no-skip", &stepped)], REPEATS)?;
    println!("{:<34} {:.0} times as fast", "", long / short);
    Ok(())
}

/// The median wall times of some runs of each scene, s.
fn report<const SCENES: usize>(scenes: [(&str, &Scene); SCENES], repeats: usize) -> Result<[f64; SCENES]> {
    let engine = Engine::cpu();
    let run = |scene: &Scene| -> Result<(f64, f64, Trust)> {
        let clock = Instant::now();
        let plan = Plan::new(scene, &engine)?;
        let planned = clock.elapsed().as_secs_f64();
        let record = engine.run(&plan)?;
        Ok((clock.elapsed().as_secs_f64(), planned, record.trust().clone()))
    };
    let mut runs: [Vec<_>; SCENES] = std::array::from_fn(|_| Vec::new());
    for _ in 0..repeats {
        for (runs, (_, scene)) in runs.iter_mut().zip(scenes) {
            runs.push(run(scene)?);
        }
    }
    let mut medians = [f64::NAN; SCENES];
    for ((median, runs), (name, _)) in medians.iter_mut().zip(&mut runs).zip(scenes) {
        runs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (seconds, planned, trust) = &runs[repeats / 2];
        println!(
            "{name:<34} {seconds:.3} s ({planned:.3} planning, {:.3} preparing, {:.3} starting, {:.3} computing, {:.3} reading, \
             {:.3} checking), {:.2e} body-steps, {}",
            trust.wall_time.prepare,
            trust.wall_time.start,
            trust.wall_time.compute,
            trust.wall_time.read + trust.wall_time.write,
            trust.wall_time.recomputed_sample,
            trust.body_steps as f64,
            trust.recomputed_sample
        );
        *median = *seconds;
    }
    Ok(medians)
}
