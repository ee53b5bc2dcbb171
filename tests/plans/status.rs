//! What a step has to say of a body: flagged, counted among the failed, and nobody else's affair.

use glam::{DQuat, DVec3};
use polhode::engine::Engine;
use polhode::{Ensemble, Method, Outputs, Plan, Precision, Record, Scene};

/// An asymmetric body whose spin is `rate` rad/s about a tilted axis.
fn body(rate: f64) -> (DVec3, DQuat, DVec3) {
    (DVec3::new(1.0, 1.7, 2.2), DQuat::IDENTITY, DVec3::new(0.48, 0.6, 0.64) * rate)
}

fn run(rates: &[f64], method: Method, precision: Precision, dt: f64, steps: u64) -> Record {
    let ensemble = Ensemble::from_fn(rates.len(), |index| body(rates[index])).expect("valid bodies");
    let scene = Scene::new(ensemble).until(dt * steps as f64).outputs(Outputs::End).pinned(method, dt, Some(precision));
    let engine = Engine::cpu();
    engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("runs")
}

#[test]
fn a_step_too_long_for_the_free_flow_is_flagged_and_its_neighbours_are_untouched() {
    for precision in Precision::ALL {
        let rates = [0.5, 3.0, 1.0, 8.0, 0.25];
        let record = run(&rates, Method::Splitting4, precision, 0.5, 20);
        assert_eq!(record.trust().failed_bodies, [1, 3], "{precision}");
        let slow = run(&[0.5, 1.0, 0.25], Method::Splitting4, precision, 0.5, 20);
        assert_eq!(slow.trust().failed_bodies, Vec::<usize>::new());
        for (with, without) in [(0, 0), (2, 1), (4, 2)] {
            assert_eq!(record.final_state().orientation(with), slow.final_state().orientation(without));
        }
    }
}

#[test]
fn the_implicit_midpoint_rule_is_solved_up_to_three_radians_a_step_and_never_silently_wrong_beyond() {
    // Rounding of 100 steps, u per operation of about fifty in each, as a random walk: 71 u, 4.2e-6 in f32. In f64 the
    // solution itself is left at 1e-13.
    for (precision, bound) in [(Precision::F64, 1e-13), (Precision::F32, 4.2e-6)] {
        for angle in [1e-3, 0.1, 1.0, 3.0, 10.0, 30.0] {
            let record = run(&[angle, 0.9 * angle, 0.7 * angle], Method::ImplicitMidpoint, precision, 1.0, 100);
            let failed = &record.trust().failed_bodies;
            assert!(failed.is_empty() || angle > 3.0, "{precision}, omega dt = {angle}: {failed:?}");
            if !failed.is_empty() {
                // Of bodies that have failed there is no drift.
                continue;
            }
            let drift = record.trust().drift;
            assert!(drift.kinetic_energy.max <= bound, "{precision}, {angle}: {:e}", drift.kinetic_energy.max);
            assert!(drift.angular_momentum_world.max <= bound, "{angle}: {:e}", drift.angular_momentum_world.max);
        }
    }
}
