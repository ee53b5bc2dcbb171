//! The own state of sampled torques as a quantity: when wheels saturate, against the balance of angular momentum; jumps at samples, to the
//! sample; statistics, histograms and stops.

use glam::{DQuat, DVec3};
use polhode::record::EventTime;
use polhode::run::Run;
use polhode::scene::{Condition, Event, Histogram};
use polhode::torque::reaction_wheels::Wheels;
use polhode::torque::{Parameter, Parameters, SampledLaw, Sampling, Torque};
use polhode::{Engine, Ensemble, Error, Outputs, Plan, Quantity, Scene};

use crate::control::{ADAPTIVE, engines, strategies};

/// A body count that fills neither lanes nor workgroups.
const BODIES: usize = 37;
const INERTIA: f64 = 2.0;
/// What a wheel can take, kg m²/s, and the sampling period, s.
const MOST: f64 = 0.05;
const EVERY: f64 = 0.2;

/// What pushes a body about z, N m; nothing every fifth, which are a group of their own.
fn disturbance(body: usize) -> f64 {
    if body.is_multiple_of(5) { 0.0 } else { 2.5e-3 * (1.0 + body as f64 / BODIES as f64) }
}

/// Wheels that hold bodies against a constant torque about z.
fn disturbed() -> Scene {
    let body = |_| (DVec3::new(1.0, 1.5, INERTIA), DQuat::IDENTITY, DVec3::ZERO);
    let push: Vec<DVec3> = (0..BODIES).map(|body| DVec3::Z * disturbance(body)).collect();
    let wheels = Wheels { torque_limit: 0.1.into(), momentum_limit: MOST.into(), momentum: DVec3::ZERO.into() };
    let wheels = Torque::reaction_wheels(8.0, 8.0, DQuat::IDENTITY, wheels, Sampling::every(EVERY).delayed(0.03));
    let scene = Scene::new(Ensemble::from_fn(BODIES, body).unwrap());
    scene.torque(Torque::constant_body(Parameter::PerBody(push.into()))).torque(wheels).until(28.0)
}

fn momentum(scene: &Scene) -> Quantity {
    Quantity::own_state(scene.torques(), 1, "h_z").expect("the second torque has wheels")
}

/// Body and wheels together take up all that the disturbance brings: I ω + h = T t. Once the law has settled and until the wheel is full ω is
/// zero, and h reaches a level h₁ at h₁/T: the wheel is full at h_max/T (F. L. Markley, J. L. Crassidis, *Fundamentals of Spacecraft Attitude Determination
/// and Control*, 2014, section 3.3.5), or with the period in which it would be, by whose end the law drives it to the limit.
#[test]
fn wheels_saturate_when_the_balance_of_momentum_says() {
    for (engine_name, engine) in engines() {
        for (name, steps, bound) in strategies(engine_name) {
            // Where outputs lie matters to the search alone, which all engines share.
            let all = [Outputs::Every(2.6), Outputs::End, Outputs::Every(0.4)];
            for outputs in &all[..if engine_name == "lanes" { 3 } else { 1 }] {
                let scene = disturbed().outputs(outputs.clone());
                let quantity = momentum(&scene);
                assert_eq!((quantity.name(), quantity.unit()), ("torque2_h_z", "kg m²/s"));
                let levels = [0.4 * MOST, 0.95 * MOST, MOST * (1.0 - 1e-9)];
                let event = |level: f64| Event::new("full", quantity.clone(), Condition::Above(level)).unwrap();
                let scene = steps(levels.iter().fold(scene, |scene, level| scene.event(event(*level))));
                let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
                let place = format!("{engine_name}, {name}, {outputs:?}");
                for (record, level) in record.events().iter().zip(levels) {
                    let pushed = (0..BODIES).filter(|&body| disturbance(body) > 0.0);
                    let mut had: Vec<usize> = record.occurrences.iter().map(|found| found.body).collect();
                    had.sort_unstable();
                    assert_eq!(had, pushed.collect::<Vec<_>>(), "{place}");
                    for found in &record.occurrences {
                        assert_eq!(found.known_to, EventTime::Located);
                        let push = disturbance(found.body);
                        let off = push * found.time - level - INERTIA * found.angular_velocity_body.z;
                        assert!(off.abs() <= bound, "{place}: body {}, {off:e} kg m²/s", found.body);
                        let late = found.time - level / push;
                        let most = if level > 0.99 * MOST { EVERY } else { 0.0 } + bound / push + 1e-5;
                        // Of the first level the law may not have settled.
                        assert!(
                            level < 0.5 * MOST || (-1e-5 - bound / push..=most).contains(&late),
                            "{place}: body {}, {late:e} s",
                            found.body
                        );
                    }
                }
            }
        }
    }
}

/// A state with a next value jumps at samples, and its events are there: counted from the sample at 0, number k makes it k + 1.
#[test]
fn jumps_are_passed_at_their_samples() {
    let body = |body: usize| (DVec3::new(1.0, 1.5, 2.0), DQuat::IDENTITY, DVec3::new(0.1, 0.02 * body as f64, 0.0));
    let law = SampledLaw::new(Parameters::new(), 0.3, 0.0).unwrap();
    let law = law.number("count", 0.0).and_then(|law| law.number("flag", 0.0)).unwrap();
    let law = law.next("count", "count + 1").and_then(|law| law.next("flag", "1 - flag")).unwrap();
    let torque = law.torque("-1e-3 * count * angular_velocity").unwrap();
    let [count, flag] =
        ["count", "flag"].map(|name| Quantity::own_state(std::slice::from_ref(&torque), 0, name).unwrap());
    let event = |quantity: &Quantity, condition, nth| {
        Event::new("jump", quantity.clone(), condition).unwrap().occurrence(nth).unwrap()
    };
    let cases = [
        (event(&count, Condition::Above(4.5), 1), 4.0 * 0.3),
        (event(&count, Condition::Rises(9.0), 1), 9.0 * 0.3),
        (event(&count, Condition::Above(0.5), 1), 0.0),
        // 1 after sample 0, and the other one after each.
        (event(&flag, Condition::Crosses(0.5), 3), 3.0 * 0.3),
        (event(&flag, Condition::Rises(0.5), 2), 4.0 * 0.3),
        (event(&flag, Condition::Falls(0.5), 3), 5.0 * 0.3),
    ];
    for (engine_name, engine) in engines() {
        for (name, steps, _) in strategies(engine_name) {
            // Each part between two outputs holds an odd number of samples, also those that end at one.
            for outputs in [Outputs::Every(0.3), Outputs::Every(0.9), Outputs::Times(vec![0.5, 0.75, 1.65])] {
                let scene = Scene::new(Ensemble::from_fn(BODIES, body).unwrap()).torque(torque.clone());
                let scene = scene.until(3.6).outputs(outputs.clone());
                let scene = steps(cases.iter().fold(scene, |scene, (event, _)| scene.event(event.clone())));
                let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
                // What begins and ends on the same side of a level, or passes it the other way, is not followed.
                let followed = |event: &Event| {
                    let one_way = matches!(event.condition(), Condition::Rises(0.5) | Condition::Falls(0.5));
                    !one_way || outputs == Outputs::Every(0.3)
                };
                let found = record.events().iter().zip(&cases);
                for (record, (event, time)) in found.filter(|(_, (event, _))| followed(event)) {
                    let place = format!("{engine_name}, {name}, {outputs:?}, {:?}", event.condition());
                    assert_eq!(record.occurrences.len(), BODIES, "{place}");
                    for found in &record.occurrences {
                        assert!((found.time - time).abs() <= 4e-12, "{place}: {} s for {time}", found.time);
                    }
                }
            }
        }
    }
}

/// Statistics, quantiles, histograms and formulas are those of the numbers that a run hands on as own state.
#[test]
fn statistics_are_those_of_the_own_state() {
    for (engine_name, engine) in engines() {
        let scene = disturbed().outputs(Outputs::Every(3.5)).adaptive(ADAPTIVE, None);
        let (own, sum) = (momentum(&scene), "torque2_h.x + 2 * torque2_h.z + angular_velocity.z");
        let sum = Quantity::formula_of(scene.torques(), "sum", "kg m²/s", sum).unwrap();
        let histogram = Histogram::linear(own.clone(), 0.0, 0.04, 8).unwrap();
        let scene = scene.statistics([own.clone(), sum.clone()]).quantiles(&[50.0]).unwrap().histogram(histogram);
        let plan = Plan::new(&scene, &engine).expect("a plan");
        let mut last = 0.0;
        for output in Run::start(&engine, &plan).expect("started") {
            let output = output.expect("an output");
            let values = &output.own_state[2].values;
            let statistics = output.statistics.as_ref().expect("asked for");
            let found = statistics.of(&own).expect("asked for");
            let mean = values.iter().sum::<f64>() / BODIES as f64;
            assert!((found.mean - mean).abs() <= 1e-15, "{engine_name}: {} and {mean}", found.mean);
            let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            assert_eq!(found.max, most, "{engine_name}");
            let of_sum: f64 = (0..BODIES)
                .map(|body| {
                    let rate = output.states.angular_velocity_body(body).z;
                    output.own_state[0].values[body] + 2.0 * values[body] + rate
                })
                .sum();
            let sum = statistics.of(&sum).expect("asked for").mean;
            assert!((sum - of_sum / BODIES as f64).abs() <= 1e-15, "{engine_name}");
            let inside = values.iter().filter(|value| (0.0..0.04).contains(*value)).count() as u64;
            // Those below and above the bins have places of their own.
            assert_eq!(output.histograms[0].counts[1..9].iter().sum::<u64>(), inside, "{engine_name}");
            assert!(mean >= last, "the disturbance fills them");
            last = mean;
        }
        assert!(last > 0.7 * MOST, "{engine_name}: {last}");
    }
}

/// A body that an event of its wheels stops stands with what they had then, in statistics and in the own state that is handed on.
#[test]
fn a_body_that_is_stopped_keeps_its_own_state() {
    let level = 0.6 * MOST;
    for (engine_name, engine) in engines() {
        for (name, steps, bound) in strategies(engine_name) {
            let scene = disturbed().outputs(Outputs::Every(4.7));
            let own = momentum(&scene);
            let event = Event::new("full", own.clone(), Condition::Above(level)).unwrap().stopping();
            let scene = steps(scene.event(event).statistics([own.clone()]));
            let plan = Plan::new(&scene, &engine).expect("a plan");
            let outputs: Vec<_> = Run::start(&engine, &plan).expect("started").map(Result::unwrap).collect();
            for output in &outputs {
                let values = &output.own_state[2].values;
                for (body, &value) in values.iter().enumerate() {
                    let stopped = output.states.stopped_at().get(body).copied().unwrap_or(f64::NAN);
                    let expected = if stopped.is_nan() { f64::NEG_INFINITY } else { level };
                    let place = format!("{engine_name}, {name}: body {body} at {} s", output.time);
                    assert!(value <= level + bound && (value - expected).abs() <= bound || stopped.is_nan(), "{place}");
                }
                let mean = values.iter().sum::<f64>() / BODIES as f64;
                let found = output.statistics.as_ref().and_then(|all| all.of(&own)).expect("asked for").mean;
                assert!((found - mean).abs() <= 1e-15, "{engine_name}, {name}: {found} and {mean}");
            }
            let stopped = outputs.last().expect("outputs").states.stopped_at();
            assert_eq!(stopped.iter().filter(|time| time.is_finite()).count(), BODIES - BODIES.div_ceil(5));
        }
    }
}

/// Where nobody asks for attitudes, steps follow what is asked of the wheels, and the report measures its error.
#[test]
fn plans_and_reports_know_of_the_own_state() {
    let engine = Engine::cpu();
    let scene = disturbed().outputs(Outputs::Every(3.5));
    let own = momentum(&scene);
    let event = Event::new("full", own.clone(), Condition::Above(0.9 * MOST)).unwrap();
    let scene = scene.statistics([own]).event(event).without_states();
    let plan = Plan::new(&scene, &engine).expect("a plan");
    let record = engine.run(&plan).expect("a run");
    let sample = record.trust().statistics.as_ref().expect("statistics are compared");
    assert_eq!(sample.errors.len(), 2, "a mean and a time");
    for error in &sample.errors {
        assert!(error.integration.abs() <= 1e-3 && error.scale > 0.0 && error.scale.is_finite(), "{error:?}");
    }
    assert!(record.trust().failed_bodies.is_empty());
}

#[test]
fn own_state_that_no_torque_has_is_refused() {
    let scene = disturbed();
    let (own, engine) = (momentum(&scene), Engine::cpu());
    for (torque, name) in [(0, "h_z"), (1, "h"), (2, "h_z"), (1, "u_x")] {
        let error = Quantity::own_state(scene.torques(), torque, name).expect_err("refused");
        let expected = format!(
            "torque{}_{name}: expected a number of the own state of a sampled torque: torque2_h_x, torque2_h_y, torque2_h_z",
            torque + 1
        );
        assert_eq!(error.to_string(), expected);
    }
    let body = |_| (DVec3::new(1.0, 1.5, INERTIA), DQuat::IDENTITY, DVec3::X);
    let other = Scene::new(Ensemble::from_fn(2, body).unwrap()).until(1.0).statistics([own]);
    let error = Plan::new(&other, &engine).map(|_| ()).expect_err("refused");
    assert!(matches!(&error, Error::OwnState { expected, .. } if expected == "these torques have none"), "{error}");
}
