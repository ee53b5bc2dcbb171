//! Dense output of `taylor`: steps that go beyond the times to which bodies are advanced, against steps that end there.

use crate::common;
use crate::support::attitude_error;
use crate::taylor::{BODIES, END, SEED, difference, scenes, steps};

use common::compare::{compare_states, first_bit_difference};
use common::torques::batch_under;
use polhode::bodies::Status;
use polhode::bodies::columns::StateWords;
use polhode::engine::Session;
use polhode::engine::{Backend, End, Engine, unobserved};
use polhode::math::Precision;
use polhode::torque::{Parameters, Torque};
use polhode::{Outputs, Plan, Scene};

const TIMES: usize = 60;

fn times(count: usize) -> Vec<f64> {
    (1..=count).map(|index| END * index as f64 / count as f64).collect()
}

fn session(engine: &Engine, count: usize, torques: &[Torque], tolerance: f64, is_dense: bool) -> Box<dyn Session> {
    let batch = batch_under(count, SEED, torques, Precision::F64);
    let started = match is_dense {
        true => engine.start_dense_taylor(batch, steps(tolerance)),
        false => engine.start_taylor(batch, steps(tolerance)),
    };
    started.expect("started")
}

/// The states at each of the times, and the steps that the bodies took in all.
fn followed(session: &mut Box<dyn Session>, times: &[f64]) -> (Vec<StateWords>, u64) {
    let states = times.iter().map(|&time| {
        session.advance_to(End::at(time), &mut unobserved).expect("advanced");
        let count = session.body_count();
        session.read(0..count).expect("read")
    });
    let states = states.collect();
    let counts = session.counts().expect("counted");
    (states, counts.iter().map(|counts| counts.accepted).sum())
}

#[test]
fn outputs_between_the_ends_of_steps_are_as_accurate_as_steps() {
    let mut checked = 0;
    for (name, torques) in scenes() {
        let run = |tolerance, is_dense| {
            followed(&mut session(&Engine::cpu(), BODIES, &torques, tolerance, is_dense), &times(TIMES))
        };
        let (expected, cut) = run(3e-15, false);
        for tolerance in [1e-5, 1e-9, 1e-12] {
            let (found, steps) = run(tolerance, true);
            let errors = found.iter().zip(&expected).map(|(found, expected)| difference(found, expected));
            let most = errors.fold(0.0, |most: f64, error| if error > most || error.is_nan() { error } else { most });
            println!("{name} at {tolerance:e}: {most:.1e}, {steps} steps where outputs would make it {cut}");
            assert!(most < 300.0 * tolerance, "{name} at {tolerance:e}: {most:e}");
            assert!(found.iter().all(|states| states.status.iter().all(|status| *status == Status::Valid)), "{name}");
            assert!(2 * steps < cut, "{name} at {tolerance:e}: {steps} steps of {cut}");
        }
        checked += 1;
    }
    assert!(checked > 20, "{checked}");
}

#[test]
fn neither_outputs_nor_other_bodies_change_a_body() {
    for (name, torques) in scenes() {
        let run = |count: usize, times: &[f64]| {
            let (states, steps) = followed(&mut session(&Engine::cpu(), count, &torques, 1e-9, true), times);
            (states.into_iter().last().expect("a time"), steps)
        };
        let (few, steps_of_few) = run(BODIES, &times(TIMES));
        let (many, steps_of_many) = run(BODIES, &times(7 * TIMES));
        // The remainder of an interval is rounded at each output.
        let apart = difference(&few, &many);
        assert!(apart < 1e-12, "{name}: {apart:e}");
        assert!(steps_of_few.abs_diff(steps_of_many) <= BODIES as u64, "{name}: {steps_of_few} and {steps_of_many}");
        for count in [1, 7, 16] {
            let alone = run(count, &times(TIMES)).0;
            assert_eq!(first_bit_difference(&few.part(0..count), &alone), None, "{name}, {count} bodies of {BODIES}");
        }
    }
}

#[test]
fn lanes_agree_with_one_body_at_a_time_between_steps() {
    for (name, torques) in scenes() {
        let run = |engine: Engine| followed(&mut session(&engine, BODIES, &torques, 1e-9, true), &times(TIMES)).0;
        for (lanes, alone) in run(Engine::cpu()).iter().zip(&run(Engine::cpu_scalar())) {
            let compared = compare_states::<f64>(alone, lanes, 4e4);
            assert!(compared.is_ok(), "{name}: {:?}", compared.map_err(|mismatch| mismatch.to_string()));
        }
    }
}

#[test]
fn bodies_that_are_kept_go_on_to_the_bit() {
    let torques = [Torque::linear_drag(0.05), Torque::constant_body(glam::DVec3::new(0.1, 0.2, 0.3))];
    let times = times(TIMES);
    let kept: Vec<usize> = (0..BODIES).filter(|body| body % 3 != 1).collect();
    let whole = followed(&mut session(&Engine::cpu(), BODIES, &torques, 1e-9, true), &times).0;
    let mut session = session(&Engine::cpu(), BODIES, &torques, 1e-9, true);
    followed(&mut session, &times[..20]);
    session.keep(&kept).expect("kept");
    let rest = followed(&mut session, &times[20..]).0;
    for (whole, rest) in whole[20..].iter().zip(&rest) {
        for (row, &body) in kept.iter().enumerate() {
            assert_eq!(
                first_bit_difference(&whole.part(body..body + 1), &rest.part(row..row + 1)),
                None,
                "body {body}"
            );
        }
    }
}

/// A formula that becomes NaN fails a body at the same time, whether steps end at outputs or not, and leaves it there.
#[test]
fn bodies_fail_where_they_would_between_outputs() {
    let ensemble = common::asymmetric_ensemble(BODIES, SEED);
    let text = "0.01 * ln(1.5 - 0.2 * time - 0.3 * angular_velocity.z) * vec(1, 0, 0)";
    let failures = |count: usize| {
        let torque = Torque::custom(text, Parameters::new()).expect("a formula");
        let scene = Scene::new(ensemble.clone()).until(7.4).outputs(Outputs::Every(7.4 / count as f64)).torque(torque);
        let scene = scene.taylor(steps(1e-10));
        let record = Engine::cpu().run(&Plan::new(&scene, &Engine::cpu()).expect("a plan")).expect("a run");
        let trust = record.trust();
        (trust.failures.iter().map(|failed| (failed.body, failed.time)).collect::<Vec<_>>(), trust.body_steps)
    };
    let ((few, _), (many, taken)) = (failures(2), failures(370));
    assert!(few.len() > BODIES / 3 && taken < 370 * BODIES as u64 / 4, "{} bodies, {taken} steps", few.len());
    assert_eq!(few.len(), many.len());
    for ((body, time), (other, found)) in few.iter().zip(&many) {
        // Steps become ever shorter before the singularity, and which is below the limit depends on where they began: by microseconds,
        // where outputs are 20 ms apart.
        assert!(body == other && (time - found).abs() < 1e-4, "body {body} at {time} s, body {other} at {found} s");
    }
}

/// Keeps the states at every output.
fn snapshots(plan: &Plan<'_>) -> (Vec<polhode::record::Snapshot>, u64) {
    let record = Engine::cpu().run(plan).expect("a run");
    (record.snapshots().to_vec(), record.trust().body_steps)
}

/// Steps of plans go beyond outputs that are close together, those of a part of the bodies alike, and their ends are still those of the scene.
#[test]
fn plans_with_many_outputs_take_few_steps() {
    let ensemble = common::asymmetric_ensemble(200, SEED);
    let scene = |count: usize, tolerance| {
        Scene::new(ensemble.clone())
            .until(40.0)
            .outputs(Outputs::Every(40.0 / count as f64))
            .torque(Torque::quadratic_drag(0.01))
            .taylor(steps(tolerance))
    };
    let many = scene(1000, 1e-10);
    let plan = Plan::new(&many, &Engine::cpu()).expect("a plan");
    let (found, taken) = snapshots(&plan);
    assert!(taken < 200 * 1000 / 5, "{taken}");
    assert_eq!((found.len(), found.last().map(|last| last.time())), (1000, Some(40.0)));
    // Every 25th of them is an output of a scene whose outputs end steps.
    let few = scene(40, 1e-14);
    let (expected, _) = snapshots(&Plan::new(&few, &Engine::cpu()).expect("a plan"));
    for (expected, found) in expected.iter().zip(found.chunks(25).filter_map(|chunk| chunk.last())) {
        for body in 0..200 {
            let error = attitude_error(found.orientation(body), expected.orientation(body));
            assert!(error < 3e-8, "body {body} at {}: {error:e}", found.time());
        }
    }
    // A part has other rates, and its bodies the same steps.
    let part = many.only(150..200);
    let (of_part, _) = snapshots(&plan.of_part(&part, &Engine::cpu()).expect("a plan"));
    for (whole, part) in found.iter().zip(&of_part) {
        for body in 0..50 {
            assert_eq!(whole.orientation(150 + body), part.orientation(body), "body {body} at {}", whole.time());
        }
    }
}
