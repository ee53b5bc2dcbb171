//! What the recomputed sample says of all bodies, where a few of them err far more than the rest.

use glam::{DQuat, DVec3};
use polhode::scene::AdaptiveSteps;
use polhode::study::draw::{Column, Draw};
use polhode::torque::Torque;
use polhode::{Engine, Ensemble, Method, Plan, Precision, Scene};

/// A study with a minority that errs more: its kind, how many bodies it has, and which part of them are the minority.
#[derive(Clone, Copy, Debug)]
struct Study {
    kind: usize,
    bodies: usize,
    part: f64,
    seed: u64,
}

const KINDS: [&str; 6] = [
    "fast spins in equal steps of rk4",
    "fast spins in equal steps of splitting2",
    "fast heavy tops in adaptive steps",
    "strong springs in adaptive steps",
    "tumblers near the separatrix in equal steps of rk4",
    "slow bodies that a torque spins up late",
];

impl Study {
    fn number(&self, body: usize, component: u32) -> f64 {
        Draw::new(self.seed).uniform(body, Column::Mass, component)
    }

    fn is_of_minority(&self, body: usize) -> bool {
        self.number(body, 0) < self.part
    }

    /// The scene by this kind; without a reference its own steps.
    fn scene(&self, is_reference: bool) -> Scene {
        let draw = Draw::new(self.seed);
        let hard = |body: usize| self.is_of_minority(body);
        let kind = KINDS[self.kind];
        let spin_of = |body: usize| {
            let scatter = draw.normal_vector(body, Column::AngularVelocity);
            let usual = DVec3::new(0.2, 0.1, 0.3) + 0.1 * scatter;
            match kind {
                _ if kind.starts_with("fast") && hard(body) => usual * (4.0 + 2.0 * self.number(body, 1)),
                _ if kind.starts_with("tumblers") && hard(body) => DVec3::new(1e-3 * scatter.x, 0.6, 1e-3 * scatter.z),
                _ if kind.starts_with("tumblers") => DVec3::new(0.05, 0.05, 0.5) + 0.02 * scatter,
                _ if kind.starts_with("slow") && hard(body) => 0.05 * scatter,
                _ => usual,
            }
        };
        let body = |body: usize| {
            let moments = match kind {
                _ if kind.contains("tops") => DVec3::new(0.5, 0.5, 0.3),
                _ => DVec3::new(1.0, 1.6 + 0.1 * self.number(body, 2), 2.3),
            };
            (moments, draw.rotation(body, Column::Orientation), spin_of(body))
        };
        let scene = Scene::new(Ensemble::from_fn(self.bodies, body).expect("bodies"));
        let per_body = |of: &dyn Fn(usize) -> f64| (0..self.bodies).map(of).collect::<Vec<f64>>();
        let scene = match kind {
            _ if kind.contains("tops") => {
                scene.torque(Torque::heavy_top(1.0, DVec3::new(0.0, 0.0, 0.1), DVec3::new(0.0, 0.0, -9.81)))
            }
            _ if kind.starts_with("strong") => {
                let stiffness = per_body(&|body| if hard(body) { 30.0 } else { 0.5 } * (1.0 + self.number(body, 3)));
                scene.torque(Torque::sine_spring(stiffness, DQuat::IDENTITY))
            }
            _ if kind.starts_with("slow") => {
                let push: Vec<DVec3> = (0..self.bodies)
                    .map(|body| DVec3::new(0.2, 0.1, 0.3) * if hard(body) { 1.0 } else { 0.05 })
                    .collect();
                scene.torque(Torque::constant_body(push))
            }
            _ => scene.torque(Torque::linear_drag(per_body(&|body| 0.01 + 0.05 * self.number(body, 3)))),
        };
        let scene = scene.until(20.0);
        match kind {
            _ if is_reference => {
                scene.adaptive(AdaptiveSteps { tolerance: 1e-14, least_step: None }, Some(Precision::F64))
            }
            _ if kind.contains("adaptive") => {
                scene.adaptive(AdaptiveSteps { tolerance: 1e-6, least_step: None }, Some(Precision::F64))
            }
            _ if kind.contains("splitting2") => scene.pinned(Method::Splitting2, 0.02, Some(Precision::F64)),
            _ => scene.pinned(Method::Rk4, 0.05, Some(Precision::F64)),
        }
    }

    /// What the run and its report say of the errors.
    fn percentiles(&self, engine: &Engine) -> Percentiles {
        let run = |scene: &Scene| engine.run(&Plan::new(scene, engine).expect("a plan")).expect("a run");
        let (record, exact) = (run(&self.scene(false)), run(&self.scene(true)));
        let angle = |body| {
            let relative: DQuat =
                record.final_state().orientation(body).conjugate() * exact.final_state().orientation(body);
            2.0 * DVec3::new(relative.x, relative.y, relative.z).length().atan2(relative.w.abs())
        };
        let errors: Vec<f64> = (0..self.bodies).map(angle).collect();
        let sample = record.trust().recomputed_sample;
        // One body of each of as many equal ranges.
        let of_range = |number: usize| {
            let start = |number: usize| number * self.bodies / sample.bodies;
            let within = self.number(start(number), 7) * (start(number + 1) - start(number)) as f64;
            errors[start(number) + within as usize]
        };
        Percentiles {
            truth: percentile(errors.clone()),
            said: sample.attitude.p99,
            of_even_sample: percentile((0..sample.bodies).map(of_range).collect()),
            seconds: record.trust().wall_time.recomputed_sample,
        }
    }
}

/// The 99th percentile of the attitude error, rad: of all bodies, as the report has it, and of a sample of as many bodies drawn evenly; and
/// what the report's took, s.
struct Percentiles {
    truth: f64,
    said: f64,
    of_even_sample: f64,
    seconds: f64,
}

fn percentile(mut errors: Vec<f64>) -> f64 {
    errors.sort_by(f64::total_cmp);
    errors[(0.99 * errors.len() as f64).ceil() as usize - 1]
}

/// Misses of more than a factor of 2, the largest first.
#[derive(Default)]
struct Misses(Vec<(f64, &'static str)>);

impl Misses {
    fn take(&mut self, truth: f64, said: f64, kind: &'static str) -> f64 {
        let factor = (said / truth).max(truth / said);
        if !is_near(truth, said) {
            self.0.push((factor, kind));
            self.0.sort_by(|a, b| b.0.total_cmp(&a.0));
        }
        factor
    }
}

fn is_near(truth: f64, said: f64) -> bool {
    (0.5 * truth..=2.0 * truth).contains(&said)
}

/// Two of a hundred turn five times as fast, and err three orders of magnitude more.
#[test]
fn a_minority_of_two_percent_is_in_the_sample() {
    let engine = Engine::cpu();
    let mut evenly = Misses::default();
    for (kind, seed) in [(0, 1), (0, 2), (1, 3), (1, 4), (2, 5), (2, 6)] {
        let study = Study { kind, bodies: 3000, part: 0.02, seed };
        let Percentiles { truth, said, of_even_sample, .. } = study.percentiles(&engine);
        // Of tops in their own steps, the errors of the minority itself scatter by more than that.
        let within = if KINDS[kind].contains("tops") { 4.0 } else { 2.0 };
        assert!((truth / within..=within * truth).contains(&said), "{study:?}: {said:e} rad for {truth:e}");
        evenly.take(truth, of_even_sample, KINDS[kind]);
    }
    // As many bodies drawn evenly, which is what the sample was, do not see it.
    assert!(!evenly.0.is_empty());
}

/// Of 120 studies with a minority of 1 to 3 % of harder bodies: the share of which the reported 99th percentile is within a factor of 2 of that of
/// all bodies, and the largest miss; beside the same of a sample drawn evenly.
#[test]
#[ignore = "120 studies, each integrated twice: a minute; cargo test --test plans sample -- --ignored --nocapture"]
fn the_percentile_of_a_minority_is_measured() {
    const STUDIES: usize = 120;
    let (engine, mut misses, mut evenly, mut seconds) = (Engine::cpu(), Misses::default(), Misses::default(), 0.0);
    for index in 0..STUDIES {
        let kind = index % KINDS.len();
        let bodies = [1500, 4000, 10_000][index / KINDS.len() % 3];
        let part = 0.012 + 0.018 * (index as f64 * 0.618).fract();
        let study = Study { kind, bodies, part, seed: 7_000_000 + index as u64 };
        let found = study.percentiles(&engine);
        seconds += found.seconds;
        let factor = misses.take(found.truth, found.said, KINDS[kind]);
        let of_even = evenly.take(found.truth, found.of_even_sample, KINDS[kind]);
        println!("{kind} {bodies:>6} {part:.4} {:.3e}: off by {factor:.2}, evenly {of_even:.2}", found.truth);
    }
    println!("missed {} of {STUDIES} in {seconds:.2} s of recomputing: {:.1?}", misses.0.len(), misses.0);
    println!("drawn evenly {}: {:.1?}", evenly.0.len(), evenly.0);
    // Found: 14, and 48 of samples drawn evenly, by up to a factor of 22 and 660. What is left are minorities whose own errors scatter by more
    // than that, of which some 20 bodies do not say more.
    assert!(misses.0.len() <= 18 && misses.0[0].0 < 30.0 && evenly.0.len() > 40);
}
