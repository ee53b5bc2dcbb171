//! Classes in which a few bodies err many times as much as the others: a pilot of few bodies hardly has one of them, and a survey shows them.

use std::path::Path;

use polhode::study::Study;
use polhode::{Engine, Plan, Record};

const BODIES: usize = 300;

/// CubeSats under two torques, with the standard deviation of their angular velocities: the slow ones among them tumble chaotically.
fn cubesats(seed: u64, hours: f64, spread: &str, target: f64) -> Study {
    let text = format!(
        "seed = {seed}
[bodies]
count = {BODIES}
inertia = {{ shape = 'box', mass = 4.0, edges = [0.1, 0.1, 0.34] }}
orientation = {{ distribution = 'uniform' }}
angular_velocity = {{ distribution = 'normal', mean = [0, 0, 0], sigma = '{spread}' }}
[orbit]
mu = 3.986004418e14
radius = '6778 km'
inclination = '51.6 deg'
[[torque]]
model = 'gravity-gradient'
[[torque]]
model = 'orbiting-dipole'
moment = {{ distribution = 'normal', mean = [0, 0, 0], sigma = 0.005 }}
strength = 7.8e15
tilt = '169 deg'
rotation = '360.986 deg/d'
[time]
end = '{hours} h'
[accuracy]
attitude = {target:e}
recompute = {BODIES}
"
    );
    Study::parse(Path::new("study.toml"), &text).unwrap_or_else(|error| panic!("{error}"))
}

fn run(study: &Study) -> polhode::Result<Record> {
    let (scene, engine) = (study.scene().expect("a scene"), Engine::cpu());
    engine.run(&Plan::new(&scene, &engine)?)
}

#[test]
fn a_few_bodies_that_err_a_thousand_times_as_much_are_not_missed() {
    // Without a survey, the 99th percentile of seeds 1, 6 and 7 was 1.9, 1.5 and 3 times the error asked for.
    for seed in [1, 6, 7] {
        let record = run(&cubesats(seed, 1.5, "0.5 deg/s", 1e-9)).expect("within reach");
        let sample = &record.trust().recomputed_sample;
        let attitude = sample.attitude;
        println!("seed {seed}: median {:e}, 99th percentile {:e}", attitude.median, attitude.p99);
        assert_eq!((sample.bodies, sample.met), (BODIES, Some(true)), "seed {seed}: {sample:?}");
        assert!(attitude.p99 > 100.0 * attitude.median, "seed {seed}: {attitude:?} tells nothing");
    }
}

#[test]
fn a_chaotic_minority_is_followed_as_asked_for_or_refused() {
    // Four orbits: the hundredth body errs 1e6 times as much as the median, 1e-7 to 1e-6 rad in the finest steps that there are. Without a
    // survey these seeds missed 1e-4 rad by factors of 5200, 340, 8000 and 52.
    let mut met = 0;
    for seed in [0, 1, 4, 5] {
        match run(&cubesats(seed, 6.0, "2 deg/s", 1e-4)) {
            Ok(record) => {
                let sample = &record.trust().recomputed_sample;
                let p99 = sample.attitude.p99;
                println!("seed {seed}: 99th percentile {p99:e}");
                assert!(p99 < 1e-3, "seed {seed}: {sample:?}");
                met += usize::from(sample.met == Some(true));
            }
            Err(error) => println!("seed {seed}: {error}"),
        }
    }
    assert!(met >= 2, "{met} of four met: the others are refused or missed");
    let error = run(&cubesats(0, 6.0, "2 deg/s", 1e-9)).expect_err("amplified rounding").to_string();
    assert!(error.contains("out of reach"), "{error}");
}
