//! Sampled torques: closed loops against exact recursions in discrete time, what wheels and body keep together, and that neither engines nor
//! methods nor output times change anything.

use glam::{DQuat, DVec3};
use polhode::bodies::ensemble::Translation;
use polhode::run::Run;
use polhode::scene::{AdaptiveSteps, Condition, Event};
use polhode::torque::reaction_wheels::Wheels;
use polhode::torque::{Orbit, Parameter, Parameters, SampledLaw, Sampling, Torque};
use polhode::{Accuracy, Engine, Ensemble, Force, Method, Outputs, Plan, Precision, Quantity, Scene};

use crate::common;

/// A body count that fills neither lanes nor workgroups.
const BODIES: usize = 37;

pub fn engines() -> [(&'static str, Engine); 4] {
    let cut = Engine::gpu(common::cut_options(64, 7)).expect("tests need a Vulkan driver");
    [("lanes", Engine::cpu()), ("scalar", Engine::cpu_scalar()), ("gpu", common::gpu()), ("gpu in chunks", cut)]
}

pub const ADAPTIVE: AdaptiveSteps = AdaptiveSteps { tolerance: 1e-13, least_step: None };

/// Each kind of steps, with how far angles (rad) may be off.
pub type Strategy = (&'static str, fn(Scene) -> Scene, f64);

pub fn strategies(engine: &str) -> Vec<Strategy> {
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
            let all = [(0.47, 0.2), (0.0, 10.0), (EVERY, 10.0), (0.0, 0.2), (0.11, 10.0)];
            // The schedule is the host's for all engines.
            for &(delay, limit) in &all[..if engine_name == "lanes" { 5 } else { 3 }] {
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
                    assert!(
                        off <= bound,
                        "{engine_name}, {name}: body {body} has gained {off:e} N m s at {}",
                        output.time
                    );
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
                assert!(
                    off <= bound,
                    "{engine_name}, {name}: body {} at {} s is {off:e} rad/s off",
                    occurrence.body,
                    occurrence.time
                );
            }
        }
    }
}

/// A thrust along the rotor's x axis, whose direction has a jump in its second derivative wherever the torque does: the centre of mass is moved
/// from change to change, and not across them.
#[test]
fn a_thrust_follows_a_torque_that_jumps_within_steps() {
    const DELAY: f64 = 0.11;
    const ACCELERATION: f64 = 0.4;
    const END: f64 = 6.0;
    let translation = Translation {
        mass: vec![1.0; BODIES],
        position: vec![DVec3::ZERO; BODIES],
        velocity: vec![DVec3::ZERO; BODIES],
    };
    let rotors = rotors(DELAY, 10.0);
    let moving = rotors.ensemble().clone().with_translation(translation).unwrap();
    let scene = Scene::new(moving).torque(rotors.torques()[0].clone()).force(Force::thrust(DVec3::X * ACCELERATION));
    // Steps of 0.2 s, of which every other one spans a change, and the same from change to change.
    let scene = scene.pinned(Method::Rk8, 0.2, Some(Precision::F64)).until(END);
    for (name, engine) in engines() {
        let plan = Plan::new(&scene, &engine).unwrap();
        let record = engine.run(&plan).unwrap();
        for body in [0, 20, 36] {
            // Simpson's rule for the velocity at the ends and, by its weights, for the position.
            const PARTS: usize = 6000;
            let h = END / PARTS as f64;
            let mut position = DVec3::ZERO;
            for part in 0..=PARTS {
                let time = part as f64 * h;
                let weight = if part == 0 || part == PARTS {
                    1.0
                } else if part % 2 == 1 {
                    4.0
                } else {
                    2.0
                };
                let theta = exact(body, time, DELAY, 10.0).0;
                position +=
                    DVec3::new(theta.cos(), theta.sin(), 0.0) * (weight * h / 3.0 * ACCELERATION * (END - time));
            }
            let found = record.final_state().positions()[body];
            let error = (found - position).length();
            assert!(error < 2e-6, "{name}, body {body}: {found}, {position}: {error:e} m");
        }
    }
}

/// Bodies that an event stops are left out, with what their torques hold, and the others move as if nothing were stopped, to the bit.
#[test]
fn bodies_that_are_stopped_take_their_state_along() {
    for (engine_name, engine) in engines() {
        for (name, steps, _) in strategies(engine_name) {
            let slow = Event::new("slow", Quantity::SpinRate, Condition::Below(0.05)).unwrap();
            let scene = |event: Event| {
                let scene = Scene::new(satellites()).torque(wheels(0.2, 0.05)).until(9.0).outputs(Outputs::Every(1.5));
                steps(scene.event(event))
            };
            let run = |scene: &Scene| {
                let plan = Plan::new(scene, &engine).expect("a plan");
                let outputs: Vec<_> =
                    Run::start(&engine, &plan).expect("started").map(|output| output.unwrap()).collect();
                outputs
            };
            let (recorded, stopped) = (run(&scene(slow.clone())), run(&scene(slow.stopping())));
            let ends = stopped.last().expect("an output").states.stopped_at();
            let moving: Vec<usize> = (0..BODIES).filter(|&body| ends[body].is_nan()).collect();
            assert!(!moving.is_empty() && moving.len() < BODIES, "{engine_name}, {name}: {}", moving.len());
            for (own, other) in stopped.iter().zip(&recorded) {
                for &body in &moving {
                    let [own_q, other_q] = [own, other].map(|output| output.states.orientation(body));
                    assert_eq!(own_q, other_q, "{engine_name}, {name}: body {body} at {} s", own.time);
                    for axis in 0..3 {
                        let [own, other] = [own, other].map(|output| output.own_state[axis].values[body]);
                        assert_eq!(own.to_bits(), other.to_bits(), "{engine_name}, {name}: body {body}");
                    }
                }
            }
        }
    }
}

/// `since` is the time of the last sample or effect, whichever was later, and rates are formed at the start from values that are still zero:
/// the torque of a rotor is the time since then plus a rate, whose integral is a sum over the changes.
#[test]
fn since_counts_from_samples_too_and_rates_begin_with_zero_values() {
    const DELAY: f64 = 0.11;
    const END: f64 = 2.0;
    let law = SampledLaw::new(Parameters::new(), EVERY, DELAY).unwrap().number("z", 0.0).unwrap();
    let law = law.sample_number("u", "2 + angular_velocity.x").unwrap().rate("z", "u + 1").unwrap();
    let torque = law.torque("vec(0, 0, time - since + d_z)").unwrap();
    let mut changes: Vec<f64> = (0..).map(|k| f64::from(k) * EVERY).take_while(|&time| time < END).collect();
    changes.extend(changes.clone().into_iter().map(|time| time + DELAY));
    changes.push(END);
    changes.sort_by(f64::total_cmp);
    let ages: f64 = changes.windows(2).map(|pair| 0.5 * (pair[1] - pair[0]).powi(2)).sum();
    // The rate is that of a value of zero, 1, until the first of 2 takes effect.
    let gained = (ages + DELAY + 3.0 * (END - DELAY)) / INERTIA;
    for (engine_name, engine) in engines() {
        for (name, steps, bound) in strategies(engine_name) {
            let rotor =
                |body: usize| (DVec3::new(1.0, 1.5, INERTIA), DQuat::IDENTITY, DVec3::new(0.0, 0.0, rate(body)));
            let scene = Scene::new(Ensemble::from_fn(BODIES, rotor).unwrap()).torque(torque.clone()).until(END);
            let scene = steps(scene);
            let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
            for body in 0..BODIES {
                let off = (record.final_state().angular_velocity_body(body).z - rate(body) - gained).abs();
                assert!(off <= bound, "{engine_name}, {name}: body {body} is {off:e} rad/s off");
            }
        }
    }
}

/// A sample sees the centre of mass where its closed form has it.
#[test]
fn samples_see_positions() {
    let engine = Engine::cpu();
    let end = |text: &str, translates: bool| {
        let (mass, zero) = (vec![2.0; BODIES], vec![DVec3::new(0.5, 0.0, 0.0); BODIES]);
        let velocity = vec![DVec3::new(0.3, -0.1, 0.0); BODIES];
        let translation = Translation { mass, position: zero, velocity };
        let bodies = satellites();
        let bodies = if translates { bodies.with_translation(translation).unwrap() } else { bodies };
        let law = SampledLaw::new(Parameters::new(), 0.4, 0.1).unwrap().sample_vector("u", text).unwrap();
        let scene = Scene::new(bodies).torque(law.torque("0.1 * to_body(u)").unwrap()).until(5.0);
        let scene = scene.adaptive(ADAPTIVE, Some(Precision::F64));
        let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
        (0..BODIES).map(|body| record.final_state().orientation(body)).collect::<Vec<_>>()
    };
    let (own, other) = (end("position", true), end("vec(0.5 + 0.3 * time, -0.1 * time, 0)", false));
    for (body, (own, other)) in own.into_iter().zip(other).enumerate() {
        let off = crate::support::attitude_error(own, other);
        assert!(off <= 1e-12, "body {body}: {off:e} rad");
    }
}

/// The models of sampled laws are the laws that their documentation writes down: by formulas of one's own they move bodies alike.
#[test]
fn models_are_the_laws_that_they_document() {
    let engine = Engine::cpu();
    let target = DQuat::from_xyzw(0.1, -0.3, 0.2, 0.8).normalize();
    let sampling = Sampling::every(0.25).delayed(0.1);
    let scalars = |values: [(&str, f64); 4]| {
        values.into_iter().fold(Parameters::new(), |all, (name, value)| all.number(name, value).unwrap())
    };
    let limited = "vec(clamp(u.x, -most, most), clamp(u.y, -most, most), clamp(u.z, -most, most))";
    let own = scalars([("k", 0.4), ("d", 0.9), ("most", 0.3), ("h_max", 0.2)]).rotation("target", target).unwrap();
    let attitude = format!(
        "let off = conjugate(target) * attitude;
         let u = select(off.w < 0, 1, -1) * 2 * k * vec(off.x, off.y, off.z) - d * angular_velocity; {limited}"
    );
    let law = |text: &str| SampledLaw::new(own.clone(), 0.25, 0.1).unwrap().sample_vector("asked", text).unwrap();
    let direction =
        format!("let u = k * cross(vec(0, 0.6, 0.8), to_body(vec(1, 0, 0))) - d * angular_velocity; {limited}");
    let start = DVec3::new(0.1, -0.15, 0.05);
    let wheels = SampledLaw::new(own.clone(), 0.25, 0.1).unwrap().vector("h", start).unwrap();
    let rate = "vec(max(min(-asked.x, (h_max - h.x) / 0.25), -(h_max + h.x) / 0.25),
        max(min(-asked.y, (h_max - h.y) / 0.25), -(h_max + h.y) / 0.25),
        max(min(-asked.z, (h_max - h.z) / 0.25), -(h_max + h.z) / 0.25))";
    let wheels = wheels.sample_vector("asked", &attitude).unwrap().rate("h", rate).unwrap();
    let limits = Wheels { torque_limit: 0.3.into(), momentum_limit: 0.2.into(), momentum: start.into() };
    let pairs = [
        (Torque::pd_attitude(0.4, 0.9, target, 0.3, sampling), law(&attitude).torque("asked").unwrap()),
        (
            Torque::pd_direction(0.4, 0.9, DVec3::new(0.0, 3.0, 4.0), DVec3::X * 7.0, 0.3, sampling),
            law(&direction).torque("asked").unwrap(),
        ),
        (
            Torque::reaction_wheels(0.4, 0.9, target, limits, sampling),
            wheels.torque("-d_h + cross(h, angular_velocity)").unwrap(),
        ),
    ];
    for (model, own) in pairs {
        let name = model.name().to_owned();
        let end = |torque: Torque| {
            let scene = Scene::new(satellites()).torque(torque).until(12.0).adaptive(ADAPTIVE, Some(Precision::F64));
            engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run")
        };
        let (model, own) = (end(model), end(own));
        for body in 0..BODIES {
            let [model, own] = [&model, &own].map(|record| record.final_state().orientation(body));
            let off = crate::support::attitude_error(model, own);
            assert!(off <= 1e-12, "{name}: body {body} is {off:e} rad off");
        }
    }
}

/// A torque, and how far an attitude is from where it aims, rad.
type Aim = (Torque, fn(DQuat, DQuat) -> f64);

/// A pointing law brings bodies to rest where it aims, by wheels too, whose momentum takes up what the bodies had.
#[test]
fn laws_end_where_they_aim() {
    let engine = Engine::cpu();
    let target = DQuat::from_xyzw(0.1, -0.3, 0.2, 0.8).normalize();
    let limits = Wheels { torque_limit: 0.3.into(), momentum_limit: 5.0.into(), momentum: DVec3::ZERO.into() };
    let sampling = Sampling::every(0.2).delayed(0.05);
    let aims: [Aim; 3] = [
        (Torque::pd_attitude(0.4, 1.2, target, 0.3, sampling), crate::support::attitude_error),
        (Torque::reaction_wheels(0.4, 1.2, target, limits, sampling), crate::support::attitude_error),
        (Torque::pd_direction(0.4, 1.2, DVec3::Z, target * DVec3::Z, 0.3, sampling), |own, target| {
            (own * DVec3::Z).angle_between(target * DVec3::Z)
        }),
    ];
    for (torque, error) in aims {
        let name = torque.name().to_owned();
        let scene = Scene::new(satellites()).torque(torque).until(120.0).accuracy(Accuracy::attitude(1e-8));
        let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
        for body in 0..BODIES {
            let off = error(record.final_state().orientation(body), target);
            let rate = record.final_state().angular_velocity_body(body).length();
            assert!(off < 1e-6 && rate < 1e-6, "{name}: body {body} ends {off:e} rad off at {rate:e} rad/s");
        }
    }
}

const MU: f64 = 3.986004418e14;
const STRENGTH: f64 = 7.8e15;

/// The field of a tilted dipole that turns, at a place on an orbit that may drift, T, world axes: written here from Wertz, *Spacecraft Attitude
/// Determination and Control*, 1978, equation H-16, and Vallado's secular rates.
fn field(time: f64, j2: f64) -> DVec3 {
    let (a, e, i, radius) = (7.0e6_f64, 0.05_f64, 1.2_f64, 6_378_136.3);
    let n = (MU / a.powi(3)).sqrt();
    let unit = 0.75 * n * j2 * (radius / (a * (1.0 - e * e))).powi(2);
    let node = 0.3 - 2.0 * unit * i.cos() * time;
    let pericentre = 0.5 + unit * (4.0 - 5.0 * i.sin().powi(2)) * time;
    let mean = 1.0 + (n + unit * (1.0 - e * e).sqrt() * (2.0 - 3.0 * i.sin().powi(2))) * time;
    let mut anomaly = mean;
    for _ in 0..50 {
        anomaly = mean + e * anomaly.sin();
    }
    let distance = a * (1.0 - e * anomaly.cos());
    let angle = 2.0 * ((1.0 + e).sqrt() * (0.5 * anomaly).sin()).atan2((1.0 - e).sqrt() * (0.5 * anomaly).cos());
    let plane = DQuat::from_rotation_z(node) * DQuat::from_rotation_x(i);
    let r = plane * DQuat::from_rotation_z(pericentre + angle) * DVec3::X;
    let turn = 0.4 + 7.292115e-5 * time;
    let d = DVec3::new(0.2_f64.sin() * turn.cos(), 0.2_f64.sin() * turn.sin(), 0.2_f64.cos());
    STRENGTH / distance.powi(3) * (3.0 * d.dot(r) * r - d)
}

/// B-dot by the classical Runge-Kutta method of order 4 on q and ω: rates, then attitudes, at the end.
fn detumbled(moments: DVec3, mut q: DQuat, mut omega: DVec3, j2: f64) -> (DQuat, DVec3) {
    const STEP: f64 = 0.01;
    const PER_SAMPLE: usize = 200;
    const DELAY: usize = 30;
    let (mut moment, mut pending, mut seen) = (DVec3::ZERO, DVec3::ZERO, None);
    for step in 0..60_000 {
        let start = step as f64 * STEP;
        if step % PER_SAMPLE == DELAY {
            moment = pending;
        }
        if step % PER_SAMPLE == 0 {
            let b = q.conjugate() * field(start, j2);
            let change = seen.map_or(DVec3::ZERO, |before| (b - before) / (PER_SAMPLE as f64 * STEP));
            pending = (-2e4 * change).clamp(DVec3::splat(-0.2), DVec3::splat(0.2));
            seen = Some(b);
        }
        let rate = |time: f64, q: DQuat, omega: DVec3| {
            let torque = moment.cross(q.conjugate() * field(time, j2));
            let turning = q * DQuat::from_xyzw(omega.x, omega.y, omega.z, 0.0) * 0.5;
            (turning, (torque - omega.cross(moments * omega)) / moments)
        };
        let half = 0.5 * STEP;
        let (q1, w1) = rate(start, q, omega);
        let (q2, w2) = rate(start + half, q + q1 * half, omega + w1 * half);
        let (q3, w3) = rate(start + half, q + q2 * half, omega + w2 * half);
        let (q4, w4) = rate(start + STEP, q + q3 * STEP, omega + w3 * STEP);
        q = (q + (q1 + q2 * 2.0 + q3 * 2.0 + q4) * (STEP / 6.0)).normalize();
        omega += (w1 + w2 * 2.0 + w3 * 2.0 + w4) * (STEP / 6.0);
    }
    (q, omega)
}

/// Sampled B-dot in the field of an orbiting planet against an integration that shares nothing with the library, with and without a drift of the
/// orbit.
#[test]
fn magnetorquers_detumble_as_an_integration_apart_has_it() {
    const BOUND: f64 = 1e-9;
    let rows = [
        (DVec3::new(0.01, 0.017, 0.022), DQuat::from_rotation_x(0.4), DVec3::new(0.2, -0.1, 0.15)),
        (DVec3::new(0.012, 0.012, 0.005), DQuat::from_rotation_y(2.0), DVec3::new(-0.05, 0.3, 0.02)),
    ];
    for (engine_name, engine) in engines() {
        for j2 in [0.0, 1.08e-3] {
            let orbit = Orbit::kepler(MU, 7.0e6, 0.05).inclined(1.2).with_ascending_node(0.3).with_pericentre(0.5);
            let orbit = orbit.with_mean_anomaly(1.0).with_j2(j2, 6_378_136.3);
            let field = [STRENGTH, 0.2, 0.4, 7.292115e-5].map(Parameter::from);
            let coils = Torque::magnetorquers(2e4, 0.2, orbit, field, Sampling::every(2.0).delayed(0.3));
            let scene = Scene::new(Ensemble::from_fn(2, |body| rows[body]).unwrap()).torque(coils).until(600.0);
            let scene = scene.adaptive(ADAPTIVE, Some(Precision::F64));
            let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
            for (body, (moments, q, omega)) in rows.into_iter().enumerate() {
                let (q, expected) = detumbled(moments, q, omega, j2);
                let off = crate::support::attitude_error(record.final_state().orientation(body), q);
                let rate = (record.final_state().angular_velocity_body(body) - expected).length();
                assert!(
                    off <= BOUND && rate <= BOUND,
                    "{engine_name}, J2 {j2}: body {body}, {off:e} rad, {rate:e} rad/s"
                );
                assert!(expected.length() < 0.5 * omega.length(), "it has been braked: {expected}");
            }
        }
    }
}

/// A circular orbit has a formula of its own, which is the other's limit.
#[test]
fn a_circular_orbit_is_an_ellipse_without_eccentricity() {
    let engine = Engine::cpu();
    let end = |eccentricity: Parameter<f64>| {
        let orbit = Orbit::kepler(MU, 7.0e6, eccentricity).inclined(0.9).with_mean_anomaly(2.0).with_pericentre(0.7);
        let field = [STRENGTH, 0.2, 0.4, 7e-5].map(Parameter::from);
        let coils = Torque::magnetorquers(1e6, 5.0, orbit, field, Sampling::every(1.5));
        let scene = Scene::new(satellites()).torque(coils).until(900.0).adaptive(ADAPTIVE, Some(Precision::F64));
        engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run")
    };
    let (circular, elliptic) = (end(0.0.into()), end(vec![0.0; BODIES].into()));
    for body in 0..BODIES {
        let [own, other] = [&circular, &elliptic].map(|record| record.final_state().orientation(body));
        let off = crate::support::attitude_error(own, other);
        assert!(off <= 1e-10, "body {body}: {off:e} rad");
        let moved = crate::support::attitude_error(own, satellites().orientation()[body]);
        assert!(moved > 1e-2, "body {body} has not moved");
    }
}
