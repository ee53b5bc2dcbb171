//! Sampled torques: closed loops against exact recursions in discrete time, what wheels and body keep together, and that neither engines nor
//! methods nor output times change anything.

use glam::{DQuat, DVec3};
use polhode::run::Run;
use polhode::scene::{AdaptiveSteps, Condition, Event};
use polhode::torque::{Parameters, SampledLaw, Torque};
use polhode::{Accuracy, Engine, Ensemble, Method, Outputs, Plan, Precision, Quantity, Scene};

use crate::common;

/// A body count that fills neither lanes nor workgroups.
const BODIES: usize = 37;

fn engines() -> [(&'static str, Engine); 4] {
    let cut = Engine::gpu(common::cut_options(64, 7)).expect("tests need a Vulkan driver");
    [("lanes", Engine::cpu()), ("scalar", Engine::cpu_scalar()), ("gpu", common::gpu()), ("gpu in chunks", cut)]
}

const ADAPTIVE: AdaptiveSteps = AdaptiveSteps { tolerance: 1e-13, least_step: None };

/// Each kind of steps, with how far angles (rad) may be off.
type Strategy = (&'static str, fn(Scene) -> Scene, f64);

fn strategies(engine: &str) -> Vec<Strategy> {
    let mut all: Vec<Strategy> = vec![
        ("planned", |scene| scene.accuracy(Accuracy::attitude(1e-9)), 1e-9),
        ("adaptive rk8", |scene| scene.adaptive(ADAPTIVE, Some(Precision::F64)), 1e-11),
        // Neither the sampling period nor the outputs are whole numbers of these.
        ("equal steps of rk8", |scene| scene.pinned(Method::Rk8, 0.0707, Some(Precision::F64)), 1e-11),
        ("equal steps of splitting2", |scene| scene.pinned(Method::Splitting2, 0.001, Some(Precision::F64)), 1e-5),
        ("equal steps in f32", |scene| scene.pinned(Method::Rk4, 0.01, Some(Precision::F32)), 2e-5),
    ];
    if !engine.starts_with("gpu") {
        all.push(("Taylor series", |scene| scene.taylor(ADAPTIVE), 1e-11));
    }
    all
}

/// A rotor about z: its moment of inertia, and what its controller asks and may do.
const INERTIA: f64 = 2.0;
const STIFFNESS: f64 = 0.8;
const DAMPING: f64 = 1.6;
const EVERY: f64 = 0.3;

fn angle(body: usize) -> f64 {
    0.3 + 0.5 * body as f64 / BODIES as f64
}

fn rate(body: usize) -> f64 {
    0.2 - 0.4 * body as f64 / BODIES as f64
}

/// Rotors whose torque about z is −k θ − d ω of a sample, within a limit, as of `delay` after it.
fn rotors(delay: f64, limit: f64) -> Scene {
    let parameters = Parameters::new().number("k", STIFFNESS).unwrap().number("d", DAMPING).unwrap();
    let parameters = parameters.number("most", limit).unwrap();
    let law = SampledLaw::new(parameters, EVERY, delay).unwrap();
    let text = "let angle = 2 * atan2(attitude.z, attitude.w); clamp(-k * angle - d * angular_velocity.z, -most, most)";
    let torque = law.sample_number("u", text).unwrap().torque("vec(0, 0, u)").unwrap();
    let rotor = |body: usize| {
        (DVec3::new(1.0, 1.5, INERTIA), DQuat::from_rotation_z(angle(body)), DVec3::new(0.0, 0.0, rate(body)))
    };
    Scene::new(Ensemble::from_fn(BODIES, rotor).unwrap()).torque(torque)
}

/// The double integrator under a held torque: from (θ, ω) after `t` seconds under u.
fn held((theta, omega): (f64, f64), u: f64, t: f64) -> (f64, f64) {
    (theta + omega * t + 0.5 * u / INERTIA * t * t, omega + u / INERTIA * t)
}

/// Angle and rate of a rotor at `time`, by the exact recursion from change to change.
fn exact(body: usize, time: f64, delay: f64, limit: f64) -> (f64, f64) {
    let mut changes: Vec<(f64, bool)> = Vec::new();
    let samples = (time / EVERY).floor() as usize + 1;
    for k in 0..=samples {
        changes.push((k as f64 * EVERY, true));
        changes.push((k as f64 * EVERY + delay, false));
    }
    // What takes effect at the time of a sample was sampled before, unless there is no delay.
    changes.sort_by(|a, b| a.0.total_cmp(&b.0).then(if delay > 0.0 { a.1.cmp(&b.1) } else { b.1.cmp(&a.1) }));
    let (mut state, mut u, mut now) = ((angle(body), rate(body)), 0.0, 0.0);
    let mut pending = std::collections::VecDeque::new();
    for (at, is_sample) in changes.into_iter().filter(|(at, _)| *at <= time + 1e-12) {
        state = held(state, u, at - now);
        now = at;
        match is_sample {
            true => pending.push_back((-STIFFNESS * state.0 - DAMPING * state.1).clamp(-limit, limit)),
            false => u = pending.pop_front().expect("sampled before"),
        }
    }
    held(state, u, time - now)
}

/// A sampled proportional-derivative law on a single-axis rotor is a double integrator behind a zero-order hold, whose recursion is exact
/// (Åström, Wittenmark, *Computer-Controlled Systems*, example A.1). Without a delay, with delays within and beyond a period and of a whole one, and
/// where the limit is in effect at first.
#[test]
fn a_sampled_rotor_follows_the_exact_recursion() {
    for (engine_name, engine) in engines() {
        for (name, steps, bound) in strategies(engine_name) {
            for (delay, limit) in [(0.0, 10.0), (0.0, 0.2), (0.11, 10.0), (EVERY, 10.0), (0.47, 0.2)] {
                let place = format!("{engine_name}, {name}, delay {delay} s, limit {limit} N m");
                // Between samples, at a sample, and at the end.
                let outputs = Outputs::Times(vec![0.05, 0.61, 1.5, 4.0]);
                let scene = steps(rotors(delay, limit).until(9.1).outputs(outputs));
                let plan = Plan::new(&scene, &engine).expect("a plan");
                let record = engine.run(&plan).expect("a run");
                assert!(record.trust().failed_bodies.is_empty());
                for snapshot in record.snapshots() {
                    for body in 0..BODIES {
                        let (theta, omega) = exact(body, snapshot.time(), delay, limit);
                        let q = snapshot.orientation(body);
                        let off = (2.0 * q.z.atan2(q.w) - theta).abs();
                        let off = off.max((snapshot.angular_velocity_body(body).z - omega).abs());
                        assert!(off <= bound, "{place}: body {body} is {off:e} off at {} s", snapshot.time());
                    }
                }
                // The recomputed sample and the balance know of the samples too.
                let sample = record.trust().recomputed_sample;
                let error = sample.attitude.max;
                assert!(error <= bound.max(1e-12), "{place}: the sample is {error:e} rad off");
            }
        }
    }
}

/// Three wheels along the body's axes with limits of their torque and momentum.
fn wheels(every: f64, delay: f64) -> Torque {
    let parameters = Parameters::new().number("k", 0.5).unwrap().number("d", 1.2).unwrap();
    let parameters = parameters.number("h_max", 0.25).unwrap().number("u_max", 0.4).unwrap();
    let limited = "let low = -h_max; let high = h_max;
        vec(clamp(u.x, (low - h.x) / every, (high - h.x) / every),
            clamp(u.y, (low - h.y) / every, (high - h.y) / every),
            clamp(u.z, (low - h.z) / every, (high - h.z) / every))";
    let asked = "let sign = select(attitude.w < 0, -1, 1);
        let error = 2 * sign * vec(attitude.x, attitude.y, attitude.z);
        let u = k * error + d * angular_velocity;
        vec(clamp(u.x, -u_max, u_max), clamp(u.y, -u_max, u_max), clamp(u.z, -u_max, u_max))";
    SampledLaw::new(parameters, every, delay)
        .unwrap()
        .vector("h", DVec3::new(0.02, 0.0, -0.01))
        .unwrap()
        .sample_vector("u", asked)
        .unwrap()
        .rate("h", limited)
        .unwrap()
        .torque("-d_h - cross(angular_velocity, h)")
        .unwrap()
}

fn satellites() -> Ensemble {
    let satellite = |body: usize| {
        let x = body as f64 / BODIES as f64;
        let q = DQuat::from_rotation_x(1.0 + x) * DQuat::from_rotation_z(2.0 * x);
        (DVec3::new(1.0, 1.7, 2.2), q, DVec3::new(0.2 - 0.3 * x, 0.1, 0.15 * x))
    };
    Ensemble::from_fn(BODIES, satellite).unwrap()
}

/// Wheels and body together are a closed system: L + R h stays, to rounding, whatever the law does, and no wheel goes beyond its limit (Markley,
/// Crassidis, *Fundamentals of Spacecraft Attitude Determination and Control*, 2014, section 3.3.5).
#[test]
fn wheels_and_body_keep_their_angular_momentum_together() {
    for (engine_name, engine) in engines() {
        for (name, steps, bound) in strategies(engine_name) {
            let scene = Scene::new(satellites()).torque(wheels(0.2, 0.05)).until(20.0).outputs(Outputs::Every(0.77));
            let scene = steps(scene);
            let plan = Plan::new(&scene, &engine).expect("a plan");
            let mut run = Run::start(&engine, &plan).expect("started");
            let start = |body: usize| {
                let (q, omega) = (scene.ensemble().orientation()[body], scene.ensemble().angular_velocity_body()[body]);
                q * (DVec3::new(1.0, 1.7, 2.2) * omega + DVec3::new(0.02, 0.0, -0.01))
            };
            let (mut most, mut slowest): (f64, f64) = (0.0, f64::INFINITY);
            for output in &mut run {
                let output = output.expect("an output");
                assert_eq!(output.own_state.iter().map(|own| &*own.name).collect::<Vec<_>>(), ["h_x", "h_y", "h_z"]);
                for body in 0..BODIES {
                    let h = DVec3::from_array([0, 1, 2].map(|axis| output.own_state[axis].values[body]));
                    most = most.max(h.abs().max_element());
                    let own = DVec3::new(1.0, 1.7, 2.2) * output.states.angular_velocity_body(body);
                    let momentum = output.states.orientation(body) * (own + h);
                    let off = (momentum - start(body)).length();
                    assert!(off <= bound, "{engine_name}, {name}: body {body} has gained {off:e} N m s at {}", output.time);
                    slowest = slowest.min(output.states.angular_velocity_body(body).length());
                }
            }
            assert!(most <= 0.25 * (1.0 + 1e-12) && most > 0.249, "{engine_name}, {name}: {most} N m s");
            assert!(slowest < 1e-2, "the wheels take up what they can: {slowest}");
        }
    }
}

/// Engines and widths agree, and outputs change nothing: they end no period.
#[test]
fn engines_agree_and_outputs_change_nothing() {
    let scene = |outputs| {
        let scene = Scene::new(satellites()).torque(wheels(0.2, 0.05)).torque(Torque::linear_drag(0.01));
        scene.until(7.0).outputs(outputs).adaptive(ADAPTIVE, Some(Precision::F64))
    };
    let mut first: Option<Vec<DQuat>> = None;
    for (engine_name, engine) in engines() {
        for outputs in [Outputs::End, Outputs::Every(0.31), Outputs::Every(0.2)] {
            let scene = scene(outputs);
            let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
            let end: Vec<DQuat> = (0..BODIES).map(|body| record.final_state().orientation(body)).collect();
            let first = first.get_or_insert_with(|| end.clone());
            for (body, (own, other)) in end.iter().zip(&*first).enumerate() {
                let off = crate::support::attitude_error(*own, *other);
                assert!(off <= 1e-11, "{engine_name}: body {body} is {off:e} rad off");
            }
        }
    }
}

/// The more often it is sampled, the nearer it is to the continuous law, in proportion to the period: of a zero-order hold that is half of it late.
#[test]
fn sampling_converges_to_the_continuous_law() {
    let (engine, text) = (Engine::cpu(), "-0.8 * 2 * vec(attitude.x, attitude.y, attitude.z) - 1.1 * angular_velocity");
    let end = |torque: Torque| {
        let scene = Scene::new(satellites()).torque(torque).until(3.0).adaptive(ADAPTIVE, Some(Precision::F64));
        let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
        (0..BODIES).map(|body| record.final_state().orientation(body)).collect::<Vec<_>>()
    };
    let continuous = end(Torque::custom(text, Parameters::new()).unwrap());
    let errors: Vec<f64> = (0..6)
        .map(|halving| {
            let law = SampledLaw::new(Parameters::new(), 0.1 * 0.5_f64.powi(halving), 0.0).unwrap();
            let sampled = end(law.sample_vector("u", text).unwrap().torque("u").unwrap());
            let error = |(own, other): (&DQuat, &DQuat)| crate::support::attitude_error(*own, *other);
            sampled.iter().zip(&continuous).map(error).fold(0.0, f64::max)
        })
        .collect();
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 1.0).abs() < 0.1, "order {order} of {errors:?}");
    }
}

/// Events between two outputs are found where the exact recursion has them, although samples lie in between.
#[test]
fn events_are_located_across_samples() {
    let (delay, limit) = (0.11, 0.3);
    let bodies = |event: Event| rotors(delay, limit).until(6.0).outputs(Outputs::Every(3.0)).event(event);
    let reversed = Quantity::AngularVelocityBody(2);
    for (engine_name, engine) in engines() {
        for (name, steps, bound) in strategies(engine_name) {
            let event = Event::new("reversed", reversed.clone(), Condition::Falls(-0.12)).unwrap();
            let scene = steps(bodies(event));
            let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
            let found = &record.events()[0].occurrences;
            assert!(found.len() > BODIES / 2, "{engine_name}, {name}: {}", found.len());
            for occurrence in found {
                // Between two changes the rate is linear, and so is what is left of it to the level.
                let omega = |time: f64| exact(occurrence.body, time, delay, limit).1;
                let off = (omega(occurrence.time) + 0.12).abs();
                assert!(off <= bound, "{engine_name}, {name}: body {} at {} s is {off:e} rad/s off", occurrence.body, occurrence.time);
            }
        }
    }
}
