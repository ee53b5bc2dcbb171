//! Events that stop bodies: where they stand, against closed forms, on every engine and by every kind of steps, and what they cost no more.

use std::ops::ControlFlow;

use glam::{DQuat, DVec3};
use polhode::bodies::Status;
use polhode::bodies::ensemble::Translation;
use polhode::engine::Progress;
use polhode::kernel::free_motion::FreeMotion;
use polhode::record::{EventTime, Record};
use polhode::scene::{AdaptiveSteps, Condition, Event};
use polhode::torque::Torque;
use polhode::torque::force::Force;
use polhode::{Accuracy, Engine, Ensemble, Error, Method, Outputs, Plan, Precision, Quantity, Scene};

use crate::common;
use crate::common::Nowhere;
use crate::support::attitude_error;

/// A body count that fills neither lanes nor workgroups.
const BODIES: usize = 203;

/// Spheres of 2 kg m² under linear drag of 0.2 N m s: the spin decays as e^(−t/10 s).
const DECAY: f64 = 10.0;
const LEVEL: f64 = 0.5;
const SPAN: f64 = 20.0;

fn engines() -> [(&'static str, Engine); 4] {
    let cut = Engine::gpu(common::cut_options(64, 7)).expect("tests need a Vulkan driver");
    [("lanes", Engine::cpu()), ("scalar", Engine::cpu_scalar()), ("gpu", common::gpu()), ("gpu in chunks", cut)]
}

fn run(scene: &Scene, engine: &Engine) -> Record {
    let plan = Plan::new(scene, engine).expect("a plan");
    engine.run(&plan).expect("a run")
}

const ADAPTIVE: AdaptiveSteps = AdaptiveSteps { tolerance: 1e-13, least_step: None };

fn adaptive(scene: Scene) -> Scene {
    scene.adaptive(ADAPTIVE, Some(Precision::F64))
}

fn axis() -> DVec3 {
    DVec3::new(0.6, -0.8, 0.0)
}

fn spin(body: usize) -> f64 {
    // The last third is too fast to be stopped within the span.
    if body.is_multiple_of(3) { 8.0 } else { 1.0 + body as f64 / BODIES as f64 }
}

fn slowing() -> Scene {
    let sphere = |body: usize| (DVec3::splat(2.0), DQuat::from_rotation_x(0.1 * body as f64), axis() * spin(body));
    let spheres = Ensemble::from_fn(BODIES, sphere).expect("spheres");
    Scene::new(spheres).torque(Torque::linear_drag(0.2)).until(SPAN).outputs(Outputs::Every(1.0))
}

fn slow() -> Event {
    Event::new("slow", Quantity::SpinRate, Condition::Below(LEVEL)).expect("a finite level")
}

/// Each kind of steps, with how far times may be off, s, and attitudes, rad.
type Strategy = (&'static str, Box<dyn Fn(Scene) -> Scene>, f64);

fn strategies(name: &str) -> Vec<Strategy> {
    let mut all: Vec<Strategy> = vec![
        ("planned", Box::new(|scene: Scene| scene.accuracy(Accuracy::attitude(1e-9))), 2e-8),
        ("adaptive rk8", Box::new(adaptive), 1e-10),
        ("equal steps of rk8", Box::new(|scene: Scene| scene.pinned(Method::Rk8, 0.05, Some(Precision::F64))), 1e-10),
        ("equal steps in f32", Box::new(|scene: Scene| scene.pinned(Method::Rk4, 0.01, Some(Precision::F32))), 4e-5),
    ];
    if !name.starts_with("gpu") {
        all.push(("Taylor series", Box::new(|scene: Scene| scene.taylor(ADAPTIVE)), 1e-10));
    }
    all
}

/// The spin falls below the level after 10 s ln(ω₀/ω), and the sphere has turned by 10 s (ω₀ − ω) then. It stands so in all later outputs;
/// the others move as if nothing were stopped, to the bit; and the time is the one that is recorded where nothing is stopped.
#[test]
fn a_stopped_sphere_stands_where_its_spin_fell_below_the_level() {
    for (engine_name, engine) in engines() {
        for (name, steps, bound) in strategies(engine_name) {
            let place = format!("{engine_name}, {name}");
            let stopped = run(&steps(slowing()).event(slow().stopping()), &engine);
            let recorded = run(&steps(slowing()).event(slow()), &engine);
            let end = stopped.final_state();
            for body in 0..BODIES {
                let expected = DECAY * (spin(body) / LEVEL).ln();
                if expected > SPAN {
                    assert_eq!(end.statuses()[body], Status::Valid, "{place}: body {body}");
                    assert!(end.stopped_at()[body].is_nan());
                    for (own, other) in stopped.snapshots().iter().zip(recorded.snapshots()) {
                        assert_eq!(own.orientation(body), other.orientation(body), "{place}: body {body}");
                        assert_eq!(own.angular_velocity_body(body), other.angular_velocity_body(body), "{place}");
                    }
                    continue;
                }
                assert_eq!(end.statuses()[body], Status::Stopped, "{place}: body {body}");
                let error = (end.stopped_at()[body] - expected).abs();
                assert!(error <= bound, "{place}: body {body} was stopped {error:e} s off");
                let spin_error = (end.angular_velocity_body(body).length() - LEVEL).abs();
                assert!(spin_error <= 1e-11, "{place}: body {body}, {spin_error:e} rad/s");
                let turned = DQuat::from_axis_angle(axis(), DECAY * (spin(body) - LEVEL));
                let error = attitude_error(end.orientation(body), DQuat::from_rotation_x(0.1 * body as f64) * turned);
                assert!(error <= bound, "{place}: body {body} stands {error:e} rad off");
                for snapshot in stopped.snapshots().iter().filter(|snapshot| snapshot.time() >= expected) {
                    assert_eq!(snapshot.orientation(body), end.orientation(body), "{place}: body {body} has moved");
                    assert_eq!(snapshot.statuses()[body], Status::Stopped);
                }
                for (own, other) in stopped.snapshots().iter().zip(recorded.snapshots()) {
                    if own.time() < expected {
                        assert_eq!(own.orientation(body), other.orientation(body), "{place}: body {body}");
                    }
                }
            }
            let (own, other) = (&stopped.events()[0], &recorded.events()[0]);
            assert_eq!(own.occurrences, other.occurrences, "{place}: stopped and recorded");
            assert!(own.censored.is_empty());
            let times = |body: usize| own.occurrences.iter().find(|occurrence| occurrence.body == body);
            for body in (0..BODIES).filter(|&body| end.statuses()[body] == Status::Stopped) {
                assert_eq!(times(body).map(|occurrence| occurrence.time), Some(end.stopped_at()[body]));
            }
            let trust = stopped.trust();
            assert!(trust.failed_bodies.is_empty(), "{place}: a stopped body has not failed");
            assert_eq!((trust.recomputed_sample.lost, trust.recomputed_sample.diverged), (0, 0), "{place}");
            let attitude = trust.recomputed_sample.attitude.max;
            assert!(trust.recomputed_sample.bodies >= 64 && attitude <= bound, "{place}: {attitude:e} rad");
            assert_ne!(trust.recomputed_sample.met, Some(false), "{place}");
            let balance = trust.balance.energy.max;
            assert!(trust.balance.bodies > 0 && balance <= 1e-4 * bound.max(1e-9) / 1e-10, "{place}: {balance:e}");
        }
    }
}

/// Wing nuts are stopped as they flip, where the closed form says; steadily turning bodies where an axis has turned by an angle.
#[test]
fn torque_free_bodies_stand_where_their_closed_form_is_then() {
    let q = |body: usize| DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), body as f64);
    let nuts = Ensemble::from_fn(BODIES, |body| {
        let tilt = 1e-3 * (1.0 + body as f64);
        (DVec3::new(1.0, 2.0, 2.5), q(body), DVec3::new(tilt, 2.0, -0.5 * tilt))
    })
    .expect("bodies");
    let tops = Ensemble::from_fn(BODIES, |body| {
        (DVec3::new(1.0, 1.0, 1.5), DQuat::IDENTITY, DVec3::new(0.1, 0.0, 0.2 + 0.01 * body as f64))
    })
    .expect("bodies");
    let flip = Event::new("flip", Quantity::AngularVelocityBody(1), Condition::Crosses(0.0)).expect("a level");
    let side = Quantity::axis_angle("side", DVec3::X, DVec3::X).expect("axes");
    let turned = Event::new("turned", side, Condition::Above(1.0)).expect("a level");
    for (name, engine) in engines() {
        for (ensemble, event, wanted) in
            [(&nuts, &flip, 1e-9), (&nuts, &flip, 1e-5), (&tops, &turned, 1e-9), (&tops, &turned, 1e-5)]
        {
            let scene = Scene::new(ensemble.clone()).until(20.0).outputs(Outputs::Every(0.5));
            let scene = scene.accuracy(Accuracy::attitude(wanted));
            let stopped = run(&scene.clone().event(event.clone().stopping()), &engine);
            let recorded = run(&scene.event(event.clone()), &engine);
            let end = stopped.final_state();
            assert_eq!(stopped.events()[0].occurrences, recorded.events()[0].occurrences);
            assert!(stopped.events()[0].occurrences.len() > BODIES / 2);
            for body in 0..BODIES {
                let time = end.stopped_at()[body];
                let time = if time.is_nan() { 20.0 } else { time };
                let expected = FreeMotion::of_body(ensemble, body).at(time).orientation;
                let error = attitude_error(end.orientation(body), expected);
                assert!(error <= wanted, "{name}, {}: body {body}, {error:e} rad", event.name());
            }
            let sample = &stopped.trust().recomputed_sample;
            assert!(sample.attitude.max <= wanted && sample.met == Some(true), "{name}: {sample}");
        }
    }
}

/// A body count whose half is one, and a drag that hardly changes the steps' sizes.
fn mirrored() -> Scene {
    let spheres = Ensemble::from_fn(2 * BODIES, |body| {
        let side = if body.is_multiple_of(2) { 1.0 } else { -1.0 };
        (DVec3::new(2.0, 2.1, 2.2), DQuat::IDENTITY, DVec3::new(side, 0.0, 0.2))
    });
    let (decay, end) = (0.002, 20.0);
    Scene::new(spheres.expect("bodies")).torque(Torque::linear_drag(decay)).until(end).outputs(Outputs::Every(0.5))
}

/// Every other body turns about −x, so that its ω·x never falls below a level above zero: the halves differ in nothing else. A run in which one half
/// stops half-way takes three quarters of the steps.
#[test]
fn a_run_in_which_half_of_the_bodies_stop_half_way_takes_three_quarters_of_the_steps() {
    for (name, engine) in engines() {
        let equal = |scene: Scene| scene.pinned(Method::Rk4, 0.01, Some(Precision::F64));
        let strategies: [(&str, &dyn Fn(Scene) -> Scene); 2] = [("equal", &equal), ("adaptive", &adaptive)];
        for (steps_name, steps) in strategies {
            let scene = || steps(mirrored());
            let whole = run(&scene(), &engine);
            // Just before the output half-way.
            let at = whole.snapshots().iter().position(|snapshot| snapshot.time() == 10.0).expect("an output");
            let [before, after] = [at - 1, at].map(|at| whole.snapshots()[at].angular_velocity_body(0).x);
            let level = 0.01 * before + 0.99 * after;
            let event = Event::new("turned", Quantity::AngularVelocityBody(0), Condition::Falls(level));
            let event = event.expect("a level");
            let stopped = run(&scene().event(event.clone().stopping()), &engine);
            assert_eq!(stopped.events()[0].occurrences.len(), BODIES, "{name}, {steps_name}");
            let part = stopped.trust().body_steps as f64 / whole.trust().body_steps as f64;
            let bound = if steps_name == "equal" { 1e-12 } else { 0.01 };
            assert!((part - 0.75).abs() <= bound, "{name}, {steps_name}: {part} of the steps");
            let all = run(&scene().event(event.clone().stopping()).skipping(false), &engine);
            assert!(all.trust().body_steps > stopped.trust().body_steps, "{name}: nothing may be skipped");
            if let Some(work) = stopped.trust().adaptive {
                let whole = whole.trust().adaptive.expect("adaptive steps");
                assert_eq!(work.accepted.max, whole.accepted.max, "{name}: those that go on take the same steps");
            }
        }
    }
}

/// Lanes wait for bodies beside them, as a multiple of the attempts of all bodies, those included that were stopped.
#[test]
fn what_lanes_wait_for_is_measured_by_the_attempts_of_stopped_bodies_too() {
    let scene = || adaptive(slowing().torque(Torque::quadratic_drag(1e-3)));
    let imbalance = |scene: Scene| run(&scene, &Engine::cpu()).trust().adaptive.expect("adaptive steps").imbalance;
    let [whole, stopped] = [scene(), scene().event(slow().stopping())].map(imbalance);
    println!("imbalance {whole}, {stopped} with stops");
    assert!(stopped >= 1.0 && stopped < 1.2 * whole, "{stopped}, {whole} without stops");
}

#[test]
fn of_several_stopping_events_the_earliest_counts_and_later_ones_are_censored() {
    let event =
        |name: &str, level: f64| Event::new(name, Quantity::SpinRate, Condition::Below(level)).expect("a level");
    for (name, engine) in engines() {
        // All between the same two outputs, in both orders of the list.
        let scene = slowing().outputs(Outputs::End).pinned(Method::Rk8, 0.05, Some(Precision::F64));
        let scene = scene.event(event("late", 0.5).stopping()).event(event("never", 0.4)).event(event("early", 0.6));
        let scene = scene.event(event("stop", 0.5).stopping()).event(event("later stop", 0.45).stopping());
        let record = run(&scene, &engine);
        let [late, never, early, stop, later] = record.events() else { panic!("five events") };
        let slow = (0..BODIES).filter(|body| !body.is_multiple_of(3)).count();
        assert_eq!([late, stop, early].map(|record| record.occurrences.len()), [slow; 3], "{name}");
        assert_eq!(late.occurrences, stop.occurrences, "{name}: two stops at one time are both had");
        assert!(never.occurrences.is_empty() && later.occurrences.is_empty(), "{name}");
        for censored in [never, later] {
            assert_eq!(censored.censored.len(), slow);
            assert!(censored.censored.is_sorted_by(|a, b| a.time <= b.time));
            for (censored, occurrence) in censored.censored.iter().zip(&late.occurrences) {
                assert!(censored.stopped);
                assert_eq!((censored.body, censored.time), (occurrence.body, occurrence.time));
            }
            // Kaplan and Meier: nobody has had it, and few are left who could.
            let end = censored.survival(&[SPAN])[0];
            assert_eq!((end.share, end.remaining), (1.0, BODIES - slow));
        }
        let end = early.survival(&[SPAN])[0];
        assert!((end.share - (BODIES - slow) as f64 / BODIES as f64).abs() < 1e-12);
    }
}

/// A textbook's estimate with a stop in the middle: of four bodies one is stopped before the second event, so that this one is one of two.
#[test]
fn a_body_counts_for_other_events_until_it_is_stopped() {
    let spins = [1.0, 1.2, 1.4, 1.6];
    let body = |body: usize| {
        let omega = if body == 1 { DVec3::new(0.0, 0.0, spins[body]) } else { DVec3::X * spins[body] };
        (DVec3::splat(2.0), DQuat::IDENTITY, omega)
    };
    let ensemble = Ensemble::from_fn(4, body).expect("bodies");
    let scene = Scene::new(ensemble).torque(Torque::linear_drag(0.2)).until(8.0).outputs(Outputs::Every(0.5));
    // Body 1 alone turns about z, and stops at 10 ln(1.2/1.0) = 1.8 s; body 0 is below 0.9 after 1.05 s, body 2 after 4.4 s, body 3 after 5.8 s.
    let scene = scene.event(Event::new("slow", Quantity::SpinRate, Condition::Below(0.9)).expect("a level"));
    let z = Event::new("z", Quantity::AngularVelocityBody(2), Condition::Falls(1.0)).expect("a level");
    let record = run(&scene.event(z.stopping()), &Engine::cpu());
    let slow = &record.events()[0];
    assert_eq!(slow.occurrences.iter().map(|occurrence| occurrence.body).collect::<Vec<_>>(), [0, 2, 3]);
    assert_eq!(slow.censored.iter().map(|censored| (censored.body, censored.stopped)).collect::<Vec<_>>(), [(1, true)]);
    let shares: Vec<f64> = slow.survival(&[0.0, 1.5, 3.0, 5.0, 8.0]).iter().map(|point| point.share).collect();
    for (share, expected) in shares.iter().zip([1.0, 0.75, 0.75, 0.375, 0.0]) {
        assert!((share - expected).abs() < 1e-12, "{shares:?}");
    }
}

#[test]
fn bodies_stop_at_the_start_and_at_the_very_end_and_not_where_the_level_is_touched() {
    let still = |spin: f64| (DVec3::splat(2.0), DQuat::IDENTITY, DVec3::Z * spin);
    let end = DECAY * (1.0_f64 / 0.5).ln();
    for (name, engine) in engines() {
        for steps in [true, false] {
            let scene = Scene::new(Ensemble::from_fn(3, |body| still([0.3, 1.0, 4.0][body])).expect("bodies"));
            let scene = scene.torque(Torque::linear_drag(0.2)).until(end + 1e-6).outputs(Outputs::Every(2.0));
            let scene = match steps {
                true => scene.pinned(Method::Rk8, 0.05, Some(Precision::F64)),
                false => adaptive(scene),
            };
            let record = run(&scene.event(slow().stopping()), &engine);
            let found = record.final_state();
            assert_eq!(found.statuses(), [Status::Stopped, Status::Stopped, Status::Valid], "{name}");
            assert_eq!(found.stopped_at()[0], 0.0, "{name}");
            assert_eq!(found.angular_velocity_body(0), DVec3::Z * 0.3, "{name}: it has not moved");
            assert!((found.stopped_at()[1] - end).abs() < 1e-9, "{name}");
            assert_eq!(record.events()[0].occurrences[0].known_to, EventTime::Start);
            assert_eq!(record.trust().recomputed_sample.lost, 0, "{name}");
            assert!(record.trust().recomputed_sample.attitude.max < 1e-9, "{name}");
        }
        // cos t touches −1 from above: the pointing angle reaches π and no more.
        let angle = Quantity::formula("x", "1", "dot(to_world(vec(1, 0, 0)), vec(1, 0, 0))").expect("a formula");
        let touched = Event::new("touched", angle, Condition::Falls(-1.0)).expect("a level").stopping();
        let ensemble = Ensemble::from_columns(&[DVec3::splat(1.0)], &[DQuat::IDENTITY], &[DVec3::Z]).expect("a body");
        let scene = Scene::new(ensemble).until(6.0).outputs(Outputs::Every(0.25));
        let record = run(&scene.accuracy(Accuracy::attitude(1e-9)).event(touched), &engine);
        assert_eq!(record.final_state().statuses(), [Status::Valid], "{name}");
    }
}

/// The stopped process of probability: a body that stands counts with its quantity at the stop, also where that depends on the time.
#[test]
fn statistics_count_a_stopped_body_with_its_last_value() {
    let clock = Quantity::formula("clock", "s", "time").expect("a formula");
    for (name, engine) in engines() {
        let scene = slowing().pinned(Method::Rk8, 0.05, Some(Precision::F64)).event(slow().stopping());
        let scene = scene.statistics([Quantity::SpinRate, clock.clone()]).quantiles(&[50.0]).expect("percent");
        let record = run(&scene, &engine);
        let end = record.statistics().last().expect("the end");
        assert_eq!(end.count, BODIES, "{name}");
        let found = record.final_state();
        let mean = |of: &dyn Fn(usize) -> f64| (0..BODIES).map(of).sum::<f64>() / BODIES as f64;
        let expected = mean(&|body| found.angular_velocity_body(body).length());
        assert!((end.summaries[0].mean - expected).abs() < 1e-12, "{name}: {}", end.summaries[0].mean);
        assert!((end.summaries[0].quantiles[0] - LEVEL).abs() < 3e-4 * LEVEL, "{name}");
        // At the output that comes after its stop as well.
        for at_output in record.statistics() {
            let time = at_output.time;
            let expected = mean(&|body| found.stopped_at()[body].min(time));
            let clock = at_output.summaries[1].mean;
            assert!((clock - expected).abs() < 1e-11, "{name}: {clock} at {time} s, {expected} expected");
        }
    }
}

/// With white noise a stop is known to an output, and the body stands in the run's own state there.
#[test]
fn under_a_random_torque_a_body_stops_at_an_output() {
    for (name, engine) in engines() {
        let scene = slowing().torque(Torque::white_noise(0.05, 5)).pinned(Method::Rk4, 0.015625, Some(Precision::F64));
        let stopped = run(&scene.clone().event(slow().stopping()), &engine);
        let recorded = run(&scene.event(slow()), &engine);
        assert_eq!(stopped.events()[0].occurrences, recorded.events()[0].occurrences, "{name}");
        assert!(stopped.events()[0].occurrences.len() > BODIES / 2);
        for occurrence in &stopped.events()[0].occurrences {
            let (body, time) = (occurrence.body, occurrence.time);
            let own = recorded.snapshots().iter().find(|snapshot| snapshot.time() == time).expect("an output");
            assert_eq!(stopped.final_state().orientation(body), own.orientation(body), "{name}: body {body}");
        }
        // The sample has the run's draws, up to the stop.
        let attitude = stopped.trust().recomputed_sample.attitude.max;
        assert!(attitude < 1e-4, "{name}: {attitude:e} rad");
    }
}

/// Centres of mass that have a closed form stand where it is at the stop.
#[test]
fn a_falling_body_stands_where_it_was_stopped() {
    let g = DVec3::new(0.0, 0.0, -9.81);
    let moving = |scene: Scene| scene.force(Force::gravity(g)).event(slow().stopping());
    let spheres = Ensemble::from_fn(BODIES, |body| (DVec3::splat(2.0), DQuat::IDENTITY, DVec3::X * spin(body)));
    let (position, velocity) = (vec![DVec3::X; BODIES], vec![DVec3::Y; BODIES]);
    let translation = Translation { mass: vec![3.0; BODIES], position, velocity };
    let ensemble = spheres.expect("spheres").with_translation(translation).expect("masses");
    let scene = Scene::new(ensemble).torque(Torque::linear_drag(0.2)).until(SPAN).outputs(Outputs::Every(3.0));
    for (name, engine) in engines() {
        for skips in [true, false] {
            let scene = moving(scene.clone()).skipping(skips).pinned(Method::Rk8, 0.05, Some(Precision::F64));
            let record = run(&scene, &engine);
            let end = record.final_state();
            for body in (0..BODIES).filter(|body| !body.is_multiple_of(3)) {
                let t = end.stopped_at()[body];
                let expected = DVec3::X + DVec3::Y * t + g * (0.5 * t * t);
                assert!(end.positions()[body].distance(expected) < 1e-9, "{name}: body {body}");
                assert!(end.velocities()[body].distance(DVec3::Y + g * t) < 1e-10, "{name}: body {body}");
            }
            assert!(record.trust().recomputed_sample.position.max < 1e-6, "{name}");
        }
    }
    let stepped = moving(scene).force(Force::quadratic_drag(0.1));
    let error = Plan::new(&stepped, &Engine::cpu()).map(|_| ()).expect_err("refused");
    assert!(matches!(&error, Error::StoppedCentre { event: 0, .. }), "{error}");
    assert_eq!(
        error.to_string(),
        "event 1 (slow): the force quadratic-drag moves the centres of mass in steps, and a body cannot be stopped between \
         them: use action record"
    );
}

/// Bodies that turn about z and whose torque is not defined beyond a turn of 60 degrees: at 50 degrees an event stops them, or is only noted
/// before they fail.
#[test]
fn an_event_before_a_failure_in_the_same_interval_counts() {
    let turning = |body: usize| (DVec3::ONE, DQuat::IDENTITY, DVec3::Z * (0.09 + 0.004 * body as f64));
    let torque =
        || Torque::custom("-1e-6 * sqrt(0.5 - attitude.z) * angular_velocity", Default::default()).expect("a formula");
    let event = || Event::new("far", Quantity::Yaw, Condition::Above(50_f64.to_radians())).expect("a level");
    let scene = |every: f64, event: Event| {
        let scene = Scene::new(Ensemble::from_fn(5, turning).expect("bodies")).torque(torque()).until(40.0);
        scene.outputs(Outputs::Every(every)).event(event)
    };
    for (name, strategy, bound) in strategies("lanes") {
        for every in [1.0, 20.0] {
            let place = format!("{name}, every {every} s");
            let stopped = run(&strategy(scene(every, event().stopping())), &Engine::cpu());
            assert_eq!(stopped.final_state().statuses(), [Status::Stopped; 5], "{place}");
            assert!(stopped.trust().failed_bodies.is_empty(), "{place}: {:?}", stopped.trust().failed_bodies);
            let noted = run(&strategy(scene(every, event())), &Engine::cpu());
            assert_eq!(noted.trust().failed_bodies, [0, 1, 2, 3, 4], "{place}");
            for events in [stopped.events(), noted.events()] {
                assert_eq!((events[0].occurrences.len(), events[0].censored.len()), (5, 0), "{place}");
                for occurrence in &events[0].occurrences {
                    // The torque slows them by some 1e-5.
                    let expected = 50_f64.to_radians() / (0.09 + 0.004 * occurrence.body as f64);
                    let error = (occurrence.time / expected - 1.0).abs();
                    assert!(error < 1e-5 + bound, "{place}, body {}: {error:e}", occurrence.body);
                }
            }
        }
    }
}

/// Steps towards a failure become shorter and shorter: the search for events before it ends where they no longer matter.
#[test]
fn a_search_for_events_before_a_failure_ends() {
    let turning = |_: usize| (DVec3::ONE, DQuat::IDENTITY, DVec3::Z);
    let torque = Torque::custom("1e-3 * sqrt(4 - time) * vec(0, 0, 1)", Default::default()).expect("a formula");
    let never = Event::new("never", Quantity::SpinRate, Condition::Above(2.0)).expect("a level");
    let scene = Scene::new(Ensemble::from_fn(5, turning).expect("bodies")).torque(torque).until(10.0).event(never);
    // The search begins where they fail.
    let scene = adaptive(scene.outputs(Outputs::Every(2.0)));
    let engine = Engine::cpu();
    let plan = Plan::new(&scene, &engine).expect("a plan");
    // It is asked after each attempt.
    let mut asked = 0;
    let mut observer = |_: Progress| {
        asked += 1;
        ControlFlow::Continue(())
    };
    polhode::run::run_into(&engine, &plan, &mut Nowhere, &mut observer).expect("a run");
    assert!(asked < 5_000, "{asked}");
}

/// A body that steps much too long have lost at a known time has no event after that, although an accurate motion has it.
#[test]
fn an_event_after_a_failure_in_the_same_interval_does_not_count() {
    let ensemble = Ensemble::from_columns(&[DVec3::ONE], &[DQuat::IDENTITY], &[DVec3::Z]).expect("a body");
    let clock = Quantity::formula("clock", "s", "time").expect("a formula");
    let event = |name: &str, level: f64| Event::new(name, clock.clone(), Condition::Above(level)).expect("a level");
    let scene = Scene::new(ensemble).torque(Torque::linear_drag(100.0)).until(4000.0).outputs(Outputs::Every(4000.0));
    let scene = scene.event(event("early", 0.5)).event(event("late", 3999.0));
    let record = run(&scene.pinned(Method::Rk4, 1.0, Some(Precision::F64)), &Engine::cpu());
    let failed = &record.trust().failures[0];
    assert!(failed.time > 0.5 && failed.time < 3999.0, "{failed:?}");
    let [early, late] = record.events() else { panic!("two events") };
    assert_eq!((early.occurrences.len(), late.occurrences.len(), late.censored.len()), (1, 0, 1));
    assert_eq!((late.censored[0].time, late.censored[0].stopped), (failed.time, false));
}

/// Two events at one passage, found by two searches whose times differ in the last digits: the one that stops a body does not undo the other.
#[test]
fn events_at_the_passage_that_stops_a_body_are_not_lost_by_rounding() {
    let ensemble = common::asymmetric_ensemble(1000, 4);
    let pointing = Quantity::axis_angle("pointing", DVec3::Z, DVec3::new(0.3, 1.0, 0.2)).expect("directions");
    let cosine = "dot(to_world(vec(0, 0, 1)), normalize(vec(0.3, 1, 0.2)))";
    let cosine = Quantity::formula("cosine", "1", cosine).expect("a formula");
    let level = 1.3_f64;
    let event =
        |name: &str, quantity: &Quantity, condition| Event::new(name, quantity.clone(), condition).expect("a level");
    let stop = event("stop", &pointing, Condition::Rises(level)).stopping();
    let same = event("same", &pointing, Condition::Rises(level));
    let other = event("other", &cosine, Condition::Falls(level.cos()));
    let scene = Scene::new(ensemble).until(20.0).outputs(Outputs::Every(0.5)).event(stop).event(same).event(other);
    let record = run(&scene.accuracy(Accuracy::attitude(1e-8)), &Engine::cpu());
    let times = |event: usize| -> Vec<(usize, f64)> {
        let occurrences = record.events()[event].occurrences.iter();
        let mut times: Vec<(usize, f64)> = occurrences.map(|occurrence| (occurrence.body, occurrence.time)).collect();
        times.sort_by_key(|(body, _)| *body);
        times
    };
    let stops = times(0);
    assert!(stops.len() > 500, "{}", stops.len());
    for found in [times(1), times(2)] {
        assert_eq!(found.len(), stops.len());
        let is_same = |(a, b): (&(usize, f64), &(usize, f64))| a.0 == b.0 && b.1 <= a.1 && (a.1 - b.1) < 1e-9;
        assert!(stops.iter().zip(&found).all(is_same));
    }
}
