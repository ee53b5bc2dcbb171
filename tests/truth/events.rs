//! When events are: against closed forms, on every engine and by every kind of steps.

use std::f64::consts::LN_2;

use glam::{DQuat, DVec3};
use polhode::kernel::free_motion::FreeMotion;
use polhode::record::{EventRecord, EventTime};
use polhode::scene::{AdaptiveSteps, Condition, Event, Stepping};
use polhode::torque::Torque;
use polhode::{Accuracy, Engine, Ensemble, Method, Outputs, Plan, Precision, Quantity, Scene};

use crate::common;

/// The CPU engine with lanes, the scalar one, and the GPU engine.
fn engines() -> [(&'static str, Engine); 3] {
    [("lanes", Engine::cpu()), ("scalar", Engine::cpu_scalar()), ("gpu", common::gpu())]
}

fn run(scene: &Scene, engine: &Engine) -> Vec<EventRecord> {
    let plan = Plan::new(scene, engine).expect("a plan");
    engine.run(&plan).expect("a run").events().to_vec()
}

fn event(quantity: Quantity, condition: Condition) -> Event {
    Event::new("event", quantity, condition).expect("a finite level")
}

/// Spheres that linear drag slows down, from 1 rad/s and more.
fn slowing(bodies: usize) -> Scene {
    let spheres = Ensemble::from_fn(bodies, |body| {
        let spin = DVec3::new(0.6, -0.8, 0.0) * (1.0 + body as f64 / bodies as f64);
        (DVec3::splat(2.0), DQuat::from_rotation_x(0.1 * body as f64), spin)
    });
    Scene::new(spheres.expect("spheres")).torque(Torque::linear_drag(0.2)).until(20.0)
}

/// The spin decays as e^(−ct/I): below s₀/2 after ln 2 I/c. The time is found to 1e-12 of the span, whatever the steps and outputs are;
/// what is left is the error of the run at the output before.
#[test]
fn the_half_life_under_linear_drag() {
    let bodies = 67;
    let outputs = [Outputs::End, Outputs::Every(1.0), Outputs::Times(vec![6.9, 7.0])];
    for (name, engine) in engines() {
        for outputs in outputs.clone() {
            let steps = AdaptiveSteps { tolerance: 1e-13, least_step: None };
            let ways = [
                (slowing(bodies).accuracy(Accuracy::attitude(1e-9)), 1e-9),
                (slowing(bodies).adaptive(steps, Some(Precision::F64)), 1e-12),
                (slowing(bodies).pinned(Method::Rk8, 0.05, Some(Precision::F64)), 1e-12),
                (slowing(bodies).pinned(Method::Rk4, 0.01, Some(Precision::F32)), 2e-6),
            ];
            for (scene, part) in ways {
                let scene = scene.outputs(outputs.clone()).event(event(Quantity::SpinRate, Condition::Below(0.5)));
                let [record] = &run(&scene, &engine)[..] else { panic!("one event was asked for") };
                assert_eq!(record.occurrences.len(), bodies);
                for occurrence in &record.occurrences {
                    let start = 1.0 + occurrence.body as f64 / bodies as f64;
                    let expected = 10.0 * (start / 0.5).ln();
                    let error = (occurrence.time - expected).abs();
                    assert!(error <= part * 20.0, "{name}, {outputs:?}: body {}, {error:e} s", occurrence.body);
                    assert_eq!(occurrence.known_to, EventTime::Located);
                    // The state is that of the time.
                    assert!((occurrence.angular_velocity_body.length() - 0.5).abs() <= 1e-11);
                }
                assert!(record.occurrences.is_sorted_by(|a, b| a.time <= b.time));
            }
        }
    }
    assert!((10.0 * LN_2 - 6.931_471_805_599_453).abs() < 1e-15);
}

/// As a formula reads the spin at the start, each body's own half-life is the same.
#[test]
fn the_half_life_of_each_bodys_own_spin() {
    let left = "norm(angular_velocity) / norm(initial_angular_velocity)";
    let left = Quantity::formula("left", "1", left).expect("a formula");
    for (name, engine) in engines() {
        let scene = slowing(67).accuracy(Accuracy::attitude(1e-9)).event(event(left.clone(), Condition::Below(0.5)));
        let [record] = &run(&scene, &engine)[..] else { panic!("one event was asked for") };
        assert_eq!(record.occurrences.len(), 67, "{name}");
        for occurrence in &record.occurrences {
            let error = (occurrence.time - 10.0 * LN_2).abs();
            assert!(error <= 1e-9 * 20.0, "{name}: body {}, {error:e} s", occurrence.body);
        }
    }
}

/// The closed form says when a wing nut flips; the third time is three half periods after the first but one.
#[test]
fn flips_about_the_middle_axis() {
    let ensemble = Ensemble::from_fn(23, |body| {
        let tilt = 1e-3 * (1.0 + body as f64);
        let q = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), body as f64);
        (DVec3::new(1.0, 2.0, 2.5), q, DVec3::new(tilt, 2.0, -0.5 * tilt))
    })
    .expect("bodies");
    let end = 200.0;
    for (name, engine) in engines() {
        for nth in [1, 3] {
            for outputs in [Outputs::Every(0.5), Outputs::Every(1.7)] {
                let crossing = event(Quantity::AngularVelocityBody(1), Condition::Crosses(0.0));
                let scene =
                    Scene::new(ensemble.clone()).until(end).outputs(outputs).accuracy(Accuracy::attitude(1e-11));
                let scene = scene.event(crossing.occurrence(nth).expect("a number"));
                let [record] = &run(&scene, &engine)[..] else { panic!("one event was asked for") };
                assert_eq!(record.occurrences.len(), ensemble.len());
                for occurrence in &record.occurrences {
                    let motion = FreeMotion::of_body(&ensemble, occurrence.body);
                    let expected = motion.flips(0.0, end).nth(nth as usize - 1).expect("it flips");
                    let error = (occurrence.time - expected).abs();
                    assert!(error <= 1e-11 * end, "{name}: body {}, flip {nth}: {error:e} s", occurrence.body);
                }
            }
        }
    }
}

/// Between two outputs a condition may be met several times: an odd number is seen, and the first of them is the event; of an even number
/// nothing is seen, as documented.
#[test]
fn several_events_between_two_outputs() {
    let spin = 1.0;
    let ensemble =
        Ensemble::from_columns(&[DVec3::splat(1.0)], &[DQuat::IDENTITY], &[DVec3::Z * spin]).expect("a body");
    let engine = Engine::cpu();
    // The x axis points to cos t, so that it gets below 0 at π/2 and comes back at 3π/2.
    let x = Quantity::formula("x", "1", "to_world(vec(1, 0, 0)).x").expect("a formula");
    let found = |every: f64, nth: u32, driven: bool| {
        let event = event(x.clone(), Condition::Falls(0.0)).occurrence(nth).expect("a number");
        let scene = Scene::new(ensemble.clone()).until(30.0).outputs(Outputs::Every(every)).event(event);
        // A torque that does nothing to this motion.
        let steps = AdaptiveSteps { tolerance: 1e-13, least_step: None };
        let driven_scene = || scene.clone().torque(Torque::constant_body(DVec3::Z * 1e-300)).adaptive(steps, None);
        let scene = if driven { driven_scene() } else { scene.clone() };
        let records = run(&scene, &engine);
        records[0].occurrences.first().map(|occurrence| occurrence.time)
    };
    let pi = std::f64::consts::PI;
    for driven in [false, true] {
        let is_at = |found: Option<f64>, expected: f64| found.is_some_and(|found| (found - expected).abs() < 1e-10);
        assert!(is_at(found(1.0, 1, driven), 0.5 * pi), "{driven}");
        assert!(is_at(found(1.0, 4, driven), 6.5 * pi), "{driven}");
        // From 0 to 10 s it falls at π/2 and 5π/2: where it stands below 0 at 10 s, the first one counts.
        assert!(is_at(found(10.0, 1, driven), 0.5 * pi), "{driven}");
        assert!(is_at(found(10.0, 2, driven), 2.5 * pi), "{driven}");
        // At all multiples of 6 s up to 30 s it stands above: each fall between two of them is followed by a rise.
        assert_eq!(found(6.0, 1, driven), None, "{driven}");
    }
}

/// A body that turns about z at 1 rad/s, whose x axis points along cos t: it falls below 0 at π/2 and is back at 3π/2, both between outputs.
fn turning() -> Scene {
    let body = Ensemble::from_columns(&[DVec3::splat(1.0)], &[DQuat::IDENTITY], &[DVec3::Z]).expect("a body");
    let x = Quantity::formula("x", "1", "to_world(vec(1, 0, 0)).x").expect("a formula");
    Scene::new(body)
        .until(30.0)
        .outputs(Outputs::Every(6.0))
        .event(event(x, Condition::Falls(0.0)))
        .accuracy(Accuracy::attitude(1e-11))
}

/// Torque-free in closed form and in equal steps, and under a torque that does nothing to this motion, in adaptive and in equal steps.
fn turning_by_all_steps() -> Vec<(&'static str, Scene)> {
    let steps = AdaptiveSteps { tolerance: 1e-13, least_step: None };
    let driven = || turning().torque(Torque::constant_body(DVec3::Z * 1e-300));
    vec![
        ("closed form", turning()),
        ("adaptive", driven().adaptive(steps, Some(Precision::F64))),
        ("equal", driven().pinned(Method::Rk8, 0.05, Some(Precision::F64))),
        ("equal, free", turning().pinned(Method::Rk8, 0.05, Some(Precision::F64))),
    ]
}

/// An even number of passages between two outputs is missed, and the report says so: the sample is followed all the time.
#[test]
fn what_goes_unnoticed_between_two_outputs_is_counted_as_an_error() {
    let expected = std::f64::consts::FRAC_PI_2;
    for (name, engine) in engines() {
        for (steps, scene) in turning_by_all_steps() {
            let [record] = &run(&scene, &engine)[..] else { panic!("one event was asked for") };
            let errors = &record.errors;
            assert!(record.occurrences.is_empty(), "{name}, {steps}: {record:?}");
            let counts = (errors.bodies, errors.compared, errors.differing, errors.unnoticed, errors.searched);
            assert_eq!(counts, (1, 0, 1, 1, 1.0), "{name}, {steps}");
            // The run never has it.
            let [error] = errors.times[..] else { panic!("{errors:?}") };
            assert!((error - (30.0 - expected)).abs() < 1e-9, "{name}, {steps}: {error}");
        }
    }
    // Up to 6 s it falls and comes back, and from there to 10 s it falls again: the run takes that one for the first. From 0 to 10 s it is
    // followed, as it ends below, and both falls count.
    let found = |times: &[f64], nth: u32| {
        let event = turning().wanted_events()[0].clone().occurrence(nth).expect("a number");
        let body = turning();
        let scene =
            Scene::new(body.ensemble().clone()).until(30.0).outputs(Outputs::Times(times.to_vec())).event(event);
        run(&scene, &Engine::cpu())[0].clone()
    };
    let late = found(&[6.0, 10.0], 1);
    assert!((late.occurrences[0].time - 2.5 * std::f64::consts::PI).abs() < 1e-9, "{late:?}");
    assert_eq!((late.errors.compared, late.errors.differing, late.errors.unnoticed), (1, 0, 1));
    assert!((late.errors.times[0] - 2.0 * std::f64::consts::PI).abs() < 1e-9, "{late:?}");
    let seen = found(&[10.0], 2);
    assert_eq!((seen.errors.compared, seen.errors.differing, seen.errors.unnoticed), (1, 0, 0), "{seen:?}");
}

#[test]
fn checks_find_what_passes_and_comes_back_between_two_outputs() {
    let expected = std::f64::consts::FRAC_PI_2;
    for (name, engine) in engines() {
        for (steps, scene) in turning_by_all_steps() {
            for scene in [scene.clone().event_checks(1.0), stopping(&scene).event_checks(1.0)] {
                let plan = Plan::new(&scene, &engine).expect("a plan");
                assert_eq!((plan.times().len(), plan.advance_times().len()), (5, 30));
                let record = engine.run(&plan).expect("a run");
                let [event] = record.events() else { panic!("one event was asked for") };
                let [occurrence] = event.occurrences[..] else { panic!("{name}, {steps}: {event:?}") };
                assert!((occurrence.time - expected).abs() < 1e-9, "{name}, {steps}: {occurrence:?}");
                assert_eq!((occurrence.known_to, event.errors.unnoticed), (EventTime::Located, 0), "{name}, {steps}");
                assert!(event.errors.compared == 1 && event.errors.time().max < 1e-9, "{name}, {steps}: {event:?}");
                let outputs: Vec<f64> = record.snapshots().iter().map(|snapshot| snapshot.time()).collect();
                assert_eq!(outputs, plan.times(), "{name}, {steps}");
                let last = record.final_state().orientation(0) * DVec3::X;
                let angle = if scene.stops() { expected } else { 30.0 };
                assert!((last - DVec3::new(angle.cos(), angle.sin(), 0.0)).length() < 1e-8, "{name}, {steps}: {last}");
            }
        }
    }
}

/// The same scene, whose event stops the body.
fn stopping(scene: &Scene) -> Scene {
    let event = scene.wanted_events()[0].clone().stopping();
    let only = Scene::new(scene.ensemble().clone()).until(scene.end()).outputs(scene.output_times().clone());
    let only = scene.torques().iter().cloned().fold(only, Scene::torque).event(event);
    match scene.stepping() {
        Stepping::Pinned { method, dt, .. } => only.pinned(method, dt, scene.wanted_precision()),
        Stepping::Adaptive { .. } => {
            only.adaptive(AdaptiveSteps { tolerance: 1e-13, least_step: None }, Some(Precision::F64))
        }
        _ => only,
    }
}

/// A body that only touches a level, or passes it at an output, has nothing that goes unnoticed.
#[test]
fn rounding_is_not_taken_for_an_event_that_goes_unnoticed() {
    let body = Ensemble::from_columns(&[DVec3::splat(1.0)], &[DQuat::IDENTITY], &[DVec3::Z]).expect("a body");
    let x = Quantity::formula("x", "1", "to_world(vec(1, 0, 0)).x").expect("a formula");
    let levels = [
        (x.clone(), Condition::Below(-1.0)),
        (x.clone(), Condition::Above(1.0)),
        (Quantity::SpinRate, Condition::Below(1.0)),
        (Quantity::SpinRate, Condition::Crosses(1.0)),
        (x.clone(), Condition::Falls(0.0)),
        (x, Condition::Crosses(0.0)),
    ];
    let quarter = std::f64::consts::FRAC_PI_2;
    for driven in [false, true] {
        for (quantity, condition) in levels.clone() {
            let scene = Scene::new(body.clone()).until(20.0 * quarter).outputs(Outputs::Every(quarter));
            let scene = scene.event(event(quantity.clone(), condition).occurrence(5).expect("a number"));
            let steps = AdaptiveSteps { tolerance: 1e-12, least_step: None };
            let torque = Torque::constant_body(DVec3::Z * 1e-300);
            let scene = if driven { scene.torque(torque).adaptive(steps, None) } else { scene };
            let record = &run(&scene, &Engine::cpu())[0];
            assert_eq!(record.errors.unnoticed, 0, "{driven}, {quantity:?}, {condition:?}: {record:?}");
        }
    }
}

/// At the start, at the very end, at a level that is touched, and of what has no value.
#[test]
fn starts_ends_and_grazes() {
    let engine = Engine::cpu();
    let bodies = 3;
    let times = |condition: Condition| {
        let scene = slowing(bodies).outputs(Outputs::Every(2.0)).accuracy(Accuracy::attitude(1e-9));
        let records = run(&scene.event(event(Quantity::SpinRate, condition)), &engine);
        records[0].occurrences.clone()
    };
    // They start at 1 rad/s and above.
    let at_start = times(Condition::Above(0.9));
    assert_eq!(at_start.len(), bodies);
    assert!(at_start.iter().all(|occurrence| occurrence.time == 0.0 && occurrence.known_to == EventTime::Start));
    assert!(times(Condition::Rises(0.9)).is_empty());
    assert_eq!(times(Condition::Falls(0.9)).len(), bodies);
    assert_eq!(times(Condition::Crosses(0.9)).len(), bodies);
    // The slowest ends at e⁻² rad/s: a level just above is passed just before the end, one just below is not.
    let end = (-2.0_f64).exp();
    let last = times(Condition::Below(end * (1.0 + 1e-10)));
    assert!(last.len() == 1 && last[0].body == 0 && (last[0].time - 20.0).abs() < 1e-8, "{last:?}");
    assert!(times(Condition::Below(end * (1.0 - 1e-10))).is_empty());

    // The z component of the x axis swings from −sin 0.3 to sin 0.3 and touches these without passing them.
    let tilted = DQuat::from_rotation_y(0.3);
    let body = Ensemble::from_columns(&[DVec3::splat(1.0)], &[tilted], &[DVec3::Y]).expect("a body");
    let spin = Quantity::SpinRate;
    let scene = Scene::new(body).until(50.0).outputs(Outputs::Every(0.7));
    let touched =
        scene.clone().event(event(spin.clone(), Condition::Below(1.0))).event(event(spin, Condition::Above(1.0)));
    assert!(run(&touched, &engine).iter().all(|record| record.occurrences.is_empty()));

    // A body at rest has no separatrix distance, and so no event of it.
    let rest =
        Ensemble::from_columns(&[DVec3::new(1.0, 2.0, 2.5)], &[DQuat::IDENTITY], &[DVec3::ZERO]).expect("a body");
    let scene = Scene::new(rest).until(1.0).event(event(Quantity::SeparatrixDistance, Condition::Below(0.5)));
    assert!(run(&scene, &engine)[0].occurrences.is_empty());
}

/// Two bodies start with their angular momentum on the equator of the middle axis, and leave it to either side: one is the mirror image of the
/// other. They cross it half a period later, and again a period later.
#[test]
fn to_leave_the_level_at_the_start_is_no_passage() {
    let bodies = |body: usize| {
        let spin = DVec3::new(if body == 0 { 0.2 } else { -0.2 }, 0.0, 1.0);
        (DVec3::new(1.0, 2.0, 3.0), DQuat::IDENTITY, spin)
    };
    let scene = Scene::new(Ensemble::from_fn(2, bodies).expect("bodies")).until(20.0);
    let ways = [scene.clone(), scene.adaptive(AdaptiveSteps { tolerance: 1e-13, least_step: None }, None)];
    for (scene, outputs) in
        ways.iter().flat_map(|scene| [Outputs::End, Outputs::Every(1.0)].map(|outputs| (scene, outputs)))
    {
        let scene = scene.clone().outputs(outputs);
        let times = |condition: Condition, nth: u32| {
            let event = event(Quantity::Latitude(1), condition).occurrence(nth).expect("a number");
            let records = run(&scene.clone().event(event), &Engine::cpu());
            let mut times = [f64::NAN; 2];
            records[0].occurrences.iter().for_each(|occurrence| times[occurrence.body] = occurrence.time);
            assert_eq!(records[0].errors.unnoticed, 0, "{condition:?}: the run and the sample follow the start alike");
            times
        };
        let [half, other] = times(Condition::Crosses(0.0), 1);
        assert!(half > 1.0 && (half - other).abs() < 1e-9, "{half}, {other}");
        let whole = times(Condition::Crosses(0.0), 2);
        assert!(whole.iter().all(|whole| (whole - 2.0 * half).abs() < 1e-9), "{whole:?}, half {half}");
        let (falls, rises) = (times(Condition::Falls(0.0), 1), times(Condition::Rises(0.0), 1));
        // One falls at the half and rises at the whole, its image the other way round.
        let (first, second) = if falls[0] < rises[0] { (0, 1) } else { (1, 0) };
        let expected =
            [(falls[first], half), (rises[first], 2.0 * half), (rises[second], half), (falls[second], 2.0 * half)];
        assert!(expected.iter().all(|(found, expected)| (found - expected).abs() < 1e-9), "{expected:?}");
    }
}

/// A body that stays on the level until it is pushed has left it without a passage, however many outputs there were before.
#[test]
fn to_leave_the_level_late_is_no_passage() {
    let body = |_: usize| (DVec3::new(1.0, 2.0, 3.0), DQuat::IDENTITY, DVec3::ZERO);
    let push = Torque::custom("select(time > 5, 0.1, 0) * vec(0, 0, -1)", Default::default()).expect("a formula");
    let scene = Scene::new(Ensemble::from_fn(1, body).expect("a body")).torque(push).until(10.0);
    for outputs in [Outputs::End, Outputs::Every(1.0)] {
        for condition in [Condition::Crosses(0.0), Condition::Falls(0.0), Condition::Rises(0.0)] {
            let scene = scene.clone().outputs(outputs.clone()).accuracy(Accuracy::attitude(1e-9));
            let records = run(&scene.event(event(Quantity::AngularVelocityBody(2), condition)), &Engine::cpu());
            assert!(records[0].occurrences.is_empty(), "{outputs:?}, {condition:?}: {:?}", records[0].occurrences);
        }
    }
}

/// Under a random torque the run's own steps say all there is: the event is between two outputs.
#[test]
fn events_under_noise_are_known_to_the_output() {
    let body = Ensemble::from_columns(&[DVec3::splat(1.0)], &[DQuat::IDENTITY], &[DVec3::Z]).expect("a body");
    let noise = Torque::white_noise(0.5, 7);
    let scene = Scene::new(body).until(20.0).outputs(Outputs::Every(0.5)).torque(noise);
    let scene = scene.pinned(Method::Rk4, 0.01, Some(Precision::F64));
    let scene = scene.event(event(Quantity::SpinRate, Condition::Crosses(1.2)));
    let [record] = &run(&scene, &Engine::cpu())[..] else { panic!("one event was asked for") };
    let [occurrence] = &record.occurrences[..] else { panic!("it was expected: {record:?}") };
    assert_eq!(occurrence.known_to, EventTime::Output);
    assert_eq!(occurrence.time % 0.5, 0.0);
}

/// The error that a run reports is that of its times: against the closed form, of a run whose steps are far too long.
#[test]
fn the_reported_error_of_event_times_is_theirs() {
    let bodies = 64;
    for dt in [0.5, 2.0, 4.0] {
        let scene =
            slowing(bodies).outputs(Outputs::Every(4.0)).pinned(Method::ExplicitEuler, dt, Some(Precision::F64));
        let scene = scene.event(event(Quantity::SpinRate, Condition::Below(0.5)));
        let [record] = &run(&scene, &Engine::cpu())[..] else { panic!("one event was asked for") };
        let error = |body: usize, time: f64| (time - 10.0 * (2.0 * (1.0 + body as f64 / bodies as f64)).ln()).abs();
        let errors = record.occurrences.iter().map(|occurrence| error(occurrence.body, occurrence.time));
        let greatest = errors.fold(0.0, f64::max);
        assert!(greatest > 1e-2, "dt = {dt} s is too good a run: {greatest:e}");
        assert_eq!((record.errors.compared, record.errors.differing), (bodies, 0), "dt = {dt} s");
        let reported = record.errors.time().max;
        assert!((reported - greatest).abs() <= 1e-9 * greatest, "dt = {dt} s: {reported:e}, in truth {greatest:e}");
    }
}

/// Two bodies, the first of which fails.
fn failing() -> Scene {
    let spins = [DVec3::new(1.0, 0.1, 0.2), DVec3::Z * 1e-3];
    let ensemble =
        Ensemble::from_columns(&[DVec3::new(1e-12, 1.0, 1.0), DVec3::splat(1.0)], &[DQuat::IDENTITY; 2], &spins);
    let scene = Scene::new(ensemble.expect("bodies")).torque(Torque::linear_drag(0.01)).until(10.0);
    scene.pinned(Method::Rk4, 0.1, Some(Precision::F64))
}

/// Bodies that fail before they have had an event are no longer counted on.
#[test]
fn failed_bodies_are_censored() {
    let scene = failing().outputs(Outputs::Every(1.0));
    let scene = scene.event(event(Quantity::SpinRate, Condition::Above(5.0)));
    let [record] = &run(&scene, &Engine::cpu())[..] else { panic!("one event was asked for") };
    assert_eq!((record.occurrences.len(), record.censored.len()), (0, 1), "{record:?}");
    let survival = record.survival(&[10.0])[0];
    assert_eq!((survival.remaining, survival.share), (1, 1.0));
    // The errors are those of the bodies that are left; what the other has failed of would be followed for long.
    assert_eq!(record.errors.bodies, 1);
}

/// However many turns lie between two outputs, passages are counted from the first one on; a search that would take too long says so.
#[test]
fn passages_are_counted_over_thousands_of_turns_between_two_outputs() {
    let body = Ensemble::from_columns(&[DVec3::splat(1.0)], &[DQuat::IDENTITY], &[DVec3::Z]).expect("a body");
    let x = Quantity::formula("x", "1", "to_world(vec(1, 0, 0)).x").expect("a formula");
    let found = |end: f64, nth: u32| {
        let fall = event(x.clone(), Condition::Falls(0.0)).occurrence(nth).expect("a number");
        run(&Scene::new(body.clone()).until(end).event(fall), &Engine::cpu())[0].occurrences[0]
    };
    let quarter = std::f64::consts::FRAC_PI_2;
    for nth in [1, 3, 1000] {
        // At the end the axis is on the other side.
        let (end, expected) = (40_002.0, quarter + 4.0 * quarter * f64::from(nth - 1));
        let occurrence = found(end, nth);
        assert!((occurrence.time - expected).abs() < 1e-12 * end, "{nth}: {occurrence:?}");
        assert_eq!(occurrence.known_to, EventTime::Located);
    }
    // The one after those that 2¹⁸ steps of half a radian pass.
    let late = found(400_003.0, 20_862);
    assert_eq!((late.known_to, late.time), (EventTime::Output, 400_003.0));
}

/// A body at rest has no dynamic moment of inertia: it passes no level as it begins to turn, and is above one from then on.
#[test]
fn a_quantity_that_gets_its_first_value_passes_no_level() {
    let rest = Ensemble::from_columns(&[DVec3::splat(2.0)], &[DQuat::IDENTITY], &[DVec3::ZERO]).expect("a body");
    let steps = AdaptiveSteps { tolerance: 1e-12, least_step: None };
    for outputs in [Outputs::End, Outputs::Every(0.25)] {
        let occurrences = |condition: Condition| {
            let scene = Scene::new(rest.clone()).torque(Torque::constant_body(DVec3::X)).until(1.0);
            let scene = scene.outputs(outputs.clone()).adaptive(steps, None);
            let records = run(&scene.event(event(Quantity::DynamicInertia, condition)), &Engine::cpu());
            records[0].occurrences.clone()
        };
        for condition in [Condition::Rises(1.5), Condition::Crosses(1.5), Condition::Falls(2.5), Condition::Below(1.5)]
        {
            assert!(occurrences(condition).is_empty(), "{condition:?}, {outputs:?}");
        }
        let [above] = occurrences(Condition::Above(1.5))[..] else { panic!("it is above as soon as it turns") };
        assert!(above.time < 1e-9, "{above:?}");
    }
}

/// Of a body that has failed between two outputs nothing is expected from then on: the other one is all that is left.
#[test]
fn failed_bodies_count_until_they_fail() {
    let scene = failing().event(event(Quantity::SpinRate, Condition::Below(0.95e-3)));
    let engine = Engine::cpu();
    let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
    let [failed] = &record.trust().failures[..] else { panic!("one body fails: {:?}", record.trust().failures) };
    let [slow] = record.events() else { panic!("one event was asked for") };
    assert_eq!(slow.censored[0].time, failed.time);
    assert!(failed.time < slow.occurrences[0].time, "{slow:?}");
    assert_eq!(slow.survival(&[10.0])[0].share, 0.0);
}

/// Of a sample, fast bodies are followed for a part of the time only, and slow ones beside them for all of it.
#[test]
fn a_fast_body_does_not_end_the_search_for_a_slow_one() {
    let turn = std::f64::consts::TAU;
    let spins = [DVec3::Z * turn * 1e5, DVec3::Z * turn];
    let bodies = Ensemble::from_columns(&[DVec3::splat(1.0); 2], &[DQuat::IDENTITY; 2], &spins).expect("bodies");
    let x = Quantity::formula("x", "1", "to_world(vec(1, 0, 0)).x").expect("a formula");
    let scene = Scene::new(bodies).until(1.0).torque(Torque::constant_body(DVec3::Z * 1e-300));
    // Each is back where it was at the end.
    let scene = scene.event(event(x, Condition::Falls(0.0)));
    let scene = scene.adaptive(AdaptiveSteps { tolerance: 1e-9, least_step: None }, Some(Precision::F64));
    let record = &run(&scene, &Engine::cpu())[0];
    assert_eq!((record.occurrences.len(), record.errors.unnoticed), (0, 2), "{record:?}");
    assert!(record.errors.searched < 0.1, "{record:?}");
}

/// A sample that has many outputs, or takes many steps, is searched in part, so that it takes no longer than a run.
#[test]
fn searches_end_where_intervals_are_many_or_motion_is_stiff() {
    let sphere =
        || Ensemble::from_columns(&[DVec3::splat(1.0)], &[DQuat::IDENTITY], &[DVec3::Z * 0.9]).expect("a body");
    let never = || event(Quantity::SpinRate, Condition::Above(2.0));
    let tight = AdaptiveSteps { tolerance: 1e-9, least_step: None };
    let searched = |scene: Scene| {
        let scene = scene.event(never()).adaptive(tight, Some(Precision::F64));
        let record = &run(&scene, &Engine::cpu())[0];
        assert_eq!((record.occurrences.len(), record.errors.unnoticed), (0, 0), "{record:?}");
        record.errors.searched
    };
    // Of so short a run, 10,000 rad for 64 bodies, of which each of 4,096 intervals counts as two.
    let many = Scene::new(sphere()).until(1.0).torque(Torque::linear_drag(0.1)).outputs(Outputs::Every(1.0 / 4096.0));
    let part = searched(many);
    assert!((part - 10_000.0 / 64.0 / 8192.0).abs() < 1e-3, "{part}");
    // At a hundred steps a radian eight are taken.
    let stiff = Scene::new(sphere())
        .until(10.0)
        .torque(Torque::linear_drag(300.0))
        .torque(Torque::constant_body(DVec3::Z * 300.0));
    let part = searched(stiff);
    assert!((0.02..0.5).contains(&part), "{part}");
}

/// A torque that a formula switches on brings the event: no step of the search stops at the jump, or passes it as if it were not there.
#[test]
fn a_jump_of_a_torque_before_an_event_is_passed() {
    let row = |_| (DVec3::splat(2.0), DQuat::IDENTITY, 0.01 * DVec3::Z);
    let push = Torque::custom("select(sin(0.1 * time) < 0.3, 0, 1e-3) * vec(0, 0, 1)", Default::default());
    let scene = Scene::new(Ensemble::from_fn(3, row).expect("valid")).torque(push.expect("a formula")).until(100.0);
    let expected = 0.3_f64.asin() / 0.1 + (0.02 - 0.01) * 2.0 / 1e-3;
    for (name, engine) in engines() {
        let steps = AdaptiveSteps { tolerance: 1e-9, least_step: None };
        let mut ways = vec![
            scene.clone().adaptive(steps, Some(Precision::F64)),
            scene.clone().pinned(Method::Rk8, 0.01, Some(Precision::F64)),
        ];
        // Of a GPU's methods none keeps the error that is asked for across a jump at a time that is not known beforehand.
        if name != "gpu" {
            ways.extend([scene.clone().taylor(steps), scene.clone().accuracy(Accuracy::attitude(1e-6))]);
        }
        for (index, scene) in ways.into_iter().enumerate() {
            let scene = scene.outputs(Outputs::Every(50.0));
            let scene = scene.event(event(Quantity::SpinRate, Condition::Above(0.02)));
            let [record] = &run(&scene, &engine)[..] else { panic!("one event was asked for") };
            assert_eq!(record.occurrences.len(), 3, "{name}, {index}");
            for occurrence in &record.occurrences {
                let error = (occurrence.time - expected).abs();
                assert!(error <= 1e-9, "{name}, {index}: {error:e} s");
                assert_eq!(occurrence.known_to, EventTime::Located, "{name}, {index}");
            }
        }
    }
}
