//! Statistics of runs: of bodies that fail, of groups, without states, and what they cost.

use crate::common;

use std::ops::ControlFlow;

use glam::{DQuat, DVec3};
use polhode::bodies::Status;
use polhode::engine::Engine;
use polhode::kernel::observe::error_bound;
use polhode::math::Precision;
use polhode::plan::SkipName;
use polhode::record::{OutputState, Record, Sink, Statistics};
use polhode::run::run_into;
use polhode::{Accuracy, Ensemble, Method, Outputs, Plan, Result, Scene, Statistic, Torque};

use crate::statistics::bound;
use common::random::Random;

/// Bodies of which every 50th spins too fast for the free flow of `splitting4` in steps of 1/2 s, and is flagged.
fn some_fail(count: usize) -> Scene {
    let bodies = Ensemble::from_fn(count, |body| {
        let rate = if body % 50 == 3 { 8.0 } else { 0.5 + 0.001 * body as f64 };
        (DVec3::new(1.0, 1.7, 2.2), DQuat::IDENTITY, DVec3::new(0.48, 0.6, 0.64) * rate)
    });
    Scene::new(bodies.expect("valid")).until(10.0)
}

fn run(engine: &Engine, scene: &Scene) -> Record {
    engine.run(&Plan::new(scene, engine).expect("a valid plan")).expect("runs")
}

#[test]
fn bodies_that_fail_are_counted_and_left_out() {
    const BODIES: usize = 170;
    let failed: Vec<usize> = (3..BODIES).step_by(50).collect();
    // The last holds its bodies in three chunks.
    let cut = common::gpu_with(common::cut_options(64, 7));
    for engine in [common::gpu(), Engine::cpu(), Engine::cpu_scalar(), cut] {
        for precision in Precision::ALL {
            // After one step those that are flagged are numbers still, after twenty they are none.
            for (method, end) in [(Method::Splitting4, 0.5), (Method::Splitting4, 10.0), (Method::ExplicitEuler, 10.0)]
            {
                let scene = some_fail(BODIES).until(end).pinned(method, 0.5, Some(precision));
                let scene = scene.statistics(Statistic::ALL);
                // Spun up beyond all bounds within three steps, the fast ones are no longer numbers.
                let scene = if method == Method::ExplicitEuler {
                    scene.torque(Torque::linear_drag(blow_up(BODIES)))
                } else {
                    scene
                };
                let [alone, read] = [scene.clone().without_states(), scene].map(|scene| run(&engine, &scene));
                assert_eq!(alone.trust().failed_bodies, failed, "{precision} {method}");
                assert_eq!(read.trust().failed_bodies, failed, "{precision} {method}");
                let reasons = |record: &Record| -> Vec<(usize, Status)> {
                    record.trust().failures.iter().map(|failure| (failure.body, failure.reason)).collect()
                };
                assert_eq!(reasons(&alone), reasons(&read), "{precision} {method}");
                assert_eq!(alone.statistics(), read.statistics());
                assert_eq!(alone.trust().outside_usable_region, read.trust().outside_usable_region);
                assert_eq!(alone.trust().recomputed_sample.bodies, read.trust().recomputed_sample.bodies);
                let at_end = &alone.statistics()[0];
                assert_eq!(at_end.count, BODIES - failed.len());
                assert!(at_end.summaries.iter().all(|summary| summary.max.is_finite() && summary.mean > 0.0));
            }
        }
    }
}

/// A drag that drives: explicit Euler multiplies the spin of every 50th body by 1e30 a step.
fn blow_up(count: usize) -> Vec<f64> {
    (0..count).map(|body| if body % 50 == 3 { 1e31 } else { 0.0 }).collect()
}

#[test]
fn no_body_and_one_body_have_statistics() {
    for engine in [common::gpu(), Engine::cpu()] {
        let scene = |count| Scene::new(common::asymmetric_ensemble(count, 3)).until(1.0).statistics(Statistic::ALL);
        for scene in [scene(0), scene(0).without_states(), scene(0).skipping(false)] {
            let record = run(&engine, &scene);
            let [found] = record.statistics() else { panic!("one output") };
            assert_eq!((found.time, found.count, found.summaries.len()), (1.0, 0, 3));
            assert!(found.summaries.iter().all(|of| of.mean.is_nan() && of.min.is_nan() && of.min_body.is_none()));
        }
        let record = run(&engine, &scene(1).without_states());
        let of = record.statistics()[0].of(Statistic::SpinRate).expect("asked for");
        assert_eq!((of.standard_deviation, of.min_body, of.max_body), (0.0, Some(0), Some(0)));
        assert!(of.mean == of.min && of.mean == of.max && of.mean > 0.0);
        assert!(record.snapshots().is_empty());
    }
}

/// Free and driven bodies of several classes, so that a run has several groups.
fn mixed(count: usize) -> Scene {
    let bodies = Ensemble::from_fn(count, |body| {
        let mut random = Random::new(body as u64);
        let omega = DVec3::from_array([(); 3].map(|()| random.normal()));
        let moments = if body % 3 == 0 { DVec3::new(1.0, 1.0, 2.0) } else { DVec3::new(1.0, 2.0, 2.5) };
        (moments, DQuat::IDENTITY, omega)
    });
    let drag: Vec<f64> = (0..count).map(|body| if body % 10 == 1 { 0.05 } else { 0.0 }).collect();
    Scene::new(bodies.expect("valid"))
        .until(2.0)
        .outputs(Outputs::Every(0.5))
        .torque(Torque::linear_drag(drag))
        .statistics([Statistic::SpinRate, Statistic::KineticEnergy])
        .without_pilot()
}

/// How far both ways of forming statistics may be apart where the states, too, are found in two ways: the error asked for, in
/// the mean of many bodies.
fn agree(found: &[Statistics], long: &[Statistics], bound: f64) {
    assert_eq!(found.len(), long.len());
    for (found, long) in found.iter().zip(long) {
        assert_eq!((found.time, found.count), (long.time, long.count));
        for (a, b) in found.summaries.iter().zip(&long.summaries) {
            let near = |name: &str, x: f64, y: f64, scale: f64| {
                assert!((x - y).abs() <= bound * scale, "{} {name} at {}: {x} and {y}", a.quantity, found.time);
            };
            near("mean", a.mean, b.mean, b.mean);
            near("deviation", a.standard_deviation, b.standard_deviation, b.mean.hypot(b.standard_deviation));
            near("min", a.min, b.min, b.min);
            near("max", a.max, b.max, b.max);
            assert_eq!((a.min_body, a.max_body), (b.min_body, b.max_body), "{}", a.quantity);
        }
    }
}

fn skip(scene: &Scene, engine: &Engine) -> Option<polhode::plan::Skip> {
    let plan = Plan::new(scene, engine).expect("a valid plan");
    plan.skips().iter().find(|skip| skip.name == SkipName::States).cloned()
}

#[test]
fn states_are_skipped_where_statistics_alone_are_asked_for_and_nowhere_else() {
    const BODIES: usize = 1000;
    const TARGET: f64 = 1e-6;
    for engine in [common::gpu(), Engine::cpu()] {
        let states = mixed(BODIES).accuracy(Accuracy::attitude(TARGET));
        let alone = states.clone().without_states();
        let nothing = states.clone().statistics(&[] as &[Statistic]).without_states();
        let taken = skip(&alone, &engine).expect("taken");
        assert_eq!(taken.bodies, BODIES);
        assert!(taken.bytes > 0 && taken.bound.energy > 0.0 && taken.bound.energy <= error_bound(Precision::F32));
        for (name, scene) in
            [("states", &states), ("without skipping", &alone.clone().skipping(false)), ("no statistics", &nothing)]
        {
            assert_eq!(skip(scene, &engine), None, "{name}");
        }
        let plan = Plan::new(&alone, &engine).expect("valid");
        assert!(plan.explain().to_string().contains("MiB stay"), "{}", plan.explain());

        let (found, read, long) =
            (run(&engine, &alone), run(&engine, &states), run(&engine, &alone.clone().skipping(false)));
        assert_eq!(found.statistics(), read.statistics(), "whether states are read changes no statistics");
        agree(found.statistics(), long.statistics(), TARGET + error_bound(Precision::F32));
        // What the report promises.
        let (found, read) = (found.trust(), read.trust());
        assert!((96..=192).contains(&found.drift.bodies) && read.drift.bodies == BODIES, "{:?}", found.drift);
        assert!(found.drift.kinetic_energy.max > 0.0);
        assert!(found.drift.norm.max <= read.drift.norm.max);
        assert_eq!(found.recomputed_sample, read.recomputed_sample);
        assert_eq!(found.failed_bodies, read.failed_bodies);
    }
}

#[test]
fn the_same_states_give_the_same_statistics_both_ways() {
    // Steps are pinned, so that a run without skipping finds the same states, and the bound is that of the reduction alone.
    for engine in [common::gpu(), Engine::cpu()] {
        for precision in Precision::ALL {
            let scene = mixed(1000).pinned(Method::Rk4, 1.0 / 64.0, Some(precision)).without_states();
            let (found, long) = (run(&engine, &scene), run(&engine, &scene.clone().skipping(false)));
            agree(found.statistics(), long.statistics(), bound(precision));
        }
    }
}

#[test]
fn bodies_in_steps_of_their_own_are_named_by_the_ensemble() {
    use polhode::scene::AdaptiveSteps;
    // Sorted by expected work within a session, of which the statistics must not show anything.
    let steps = AdaptiveSteps { tolerance: 1e-9, least_step: None };
    for engine in [common::gpu(), Engine::cpu()] {
        let scene = mixed(300).adaptive(steps, Some(Precision::F64));
        let (alone, read) = (run(&engine, &scene.clone().without_states()), run(&engine, &scene));
        assert_eq!(alone.statistics(), read.statistics());
        assert_eq!(alone.trust().recomputed_sample, read.trust().recomputed_sample);
        let last = &alone.statistics()[3];
        let spins = read.final_state().angular_velocities_body().iter().map(|omega| omega.length());
        let spins: Vec<f64> = spins.collect();
        let of = last.of(Statistic::SpinRate).expect("asked for");
        for (body, value) in [(of.min_body, of.min), (of.max_body, of.max)] {
            let own = spins[body.expect("a body")];
            assert!((own - value).abs() <= bound(Precision::F64) * value, "{body:?}: {own} and {value}");
        }
        let extremes = spins.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), &x| (a.min(x), b.max(x)));
        assert!((of.min - extremes.0).abs() <= bound(Precision::F64) * of.min);
        assert!((of.max - extremes.1).abs() <= bound(Precision::F64) * of.max);
    }
}

/// Takes statistics and no states.
#[derive(Default)]
struct Counting {
    outputs: usize,
    states: bool,
}

impl Sink for Counting {
    fn wants(&mut self, _: usize, _: usize, _: f64) -> bool {
        self.states
    }
    fn bodies(&mut self, _: usize, _: f64, _: usize, _: &[OutputState]) -> Result<()> {
        Ok(())
    }
    fn statistics(&mut self, index: usize, statistics: &Statistics) -> Result<()> {
        assert_eq!((index, statistics.count), (self.outputs, BYTES_BODIES));
        self.outputs += 1;
        Ok(())
    }
}

const BYTES_BODIES: usize = 100_000;
/// Of ten output times with three statistics each, for each of 391 blocks of bodies and each of two ways in which its bodies are treated
/// what is known of it (52 bytes), and of the sample at the end.
const FEW_BYTES: u64 = 10 * 3 * 391 * 2 * 52 + (32 << 10);
const MANY_BYTES: u64 = 10_000_000;

#[test]
fn statistics_move_kilobytes_where_states_move_megabytes() {
    let engine = common::own_gpu();
    let bodies = Ensemble::from_fn(BYTES_BODIES, |body| {
        let x = body as f64 / BYTES_BODIES as f64;
        (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::new(0.3 + x, 1.0, 0.2))
    })
    .expect("valid");
    let scene = Scene::new(bodies).until(10.0).outputs(Outputs::Every(1.0)).statistics(Statistic::ALL).without_states();
    let pinned = scene.clone().pinned(Method::Rk4, 0.25, Some(Precision::F32));
    for scene in [scene.accuracy(Accuracy::attitude(1e-5)), pinned] {
        let plan = Plan::new(&scene, &engine).expect("valid");
        let [few, many] = [false, true].map(|states| {
            let mut sink = Counting { outputs: 0, states };
            let trust = run_into(&engine, &plan, &mut sink, &mut |_| ControlFlow::Continue(())).expect("runs");
            assert_eq!(sink.outputs, 10);
            trust.traffic.bytes_read
        });
        assert!(few > 0 && few < FEW_BYTES, "{few} bytes");
        assert!(many > MANY_BYTES, "{many} bytes");
        let saved = skip(&scene, &engine).expect("taken").bytes;
        assert!(saved > MANY_BYTES && saved <= many, "{saved} of {many} bytes");
    }
}
