//! What torques do along the recomputed motion, and translation in closed form.

use polhode::engine::cpu::Cpu;
use polhode::math::Precision;
use polhode::math::Width;
use polhode::{Ensemble, Force, Method, Outputs, Plan, Scene};

use super::support::golden::{self, number, vector};
use super::{MEANINGLESS, Prepared, prepared};

/// The golden end states balance against the work and the angular momentum that the torques give along the recomputed
/// motion: truth from outside on one side, quadrature on the other. Energy goes with the square of the velocity and
/// the moments differ, hence the factor.
#[test]
fn golden_states_balance_against_the_work_of_their_torques() {
    let engine = Cpu::new(Width::Lanes);
    let unit = 2.0_f64.powi(-53);
    let mut checked = 0;
    for Prepared { case, torques, rate, dt, conditioning, .. } in prepared() {
        for (state, (to_state, to_torque)) in case.states.iter().zip(conditioning) {
            if state.time == 0.0 || state.time > LATEST_BALANCED {
                continue;
            }
            let ensemble = Ensemble::from_columns(&[case.inertia], &[case.orientation], &[case.angular_velocity_body])
                .expect("golden bodies are valid");
            let moments = polhode::bodies::inertia::principal_axes(&ensemble.inertia()[0]).moments;
            let dt = 4.0 * dt;
            let scene = Scene::new(ensemble).until(state.time).pinned(Method::Rk8, dt, Some(Precision::F64));
            let scene = torques.iter().fold(scene, |scene, torque| scene.torque(torque.clone()));
            let plan = Plan::new(&scene, &engine).expect("the plan is valid");
            let balance =
                polhode::run::balance(&plan, &[state.orientation], &[state.angular_velocity_body]).expect("a balance");
            let rounding = unit * (8.0 + 4.0 * (2.0 * state.time / dt).sqrt());
            let noise = to_state * rounding + to_torque * 4.0 * unit;
            if noise > MEANINGLESS {
                continue;
            }
            checked += 1;
            let bound = 2.0 * (moments.z / moments.x) * noise;
            let (energy, momentum) = (balance.energy.max, balance.angular_momentum_world.max);
            assert!(
                energy <= bound && momentum <= bound,
                "{} at t = {} (rate {rate:.1e}): energy {energy:.1e}, momentum {momentum:.1e}, bound {bound:.1e}",
                case.name,
                state.time
            );
        }
    }
    assert!(checked >= LEAST_BALANCED, "only {checked} golden states were balanced");
}

/// Beyond this time (s) the golden data's notes advise against tight tolerances on the unstable cases: rounding, the same at
/// each step of a steady spin, is no random walk.
const LATEST_BALANCED: f64 = 10.0;

/// Golden states after the start of which the balance says something.
const LEAST_BALANCED: usize = 100;

/// Positions and velocities under gravity and linear drag are a closed form: nothing but rounding parts it from the
/// golden case, whose terms are up to g t²/2 = 1.2e4 m of which drag leaves 4.5e3 m.
#[test]
fn gravity_and_linear_drag_move_bodies_as_the_golden_case_says() {
    let cases = golden::load("forced_trans");
    let case = cases.iter().find(|case| case.name == "gravity_drag_p").expect("the case is there");
    let (model, initial) = (&case.record["model"], &case.record["initial"]);
    let ensemble = Ensemble::from_columns(&[case.inertia], &[case.orientation], &[case.angular_velocity_body])
        .and_then(|ensemble| {
            ensemble.with_translation(polhode::bodies::ensemble::Translation {
                mass: vec![number(&model["mass"])],
                position: vec![vector(&initial["x"])],
                velocity: vec![vector(&initial["v"])],
            })
        })
        .expect("valid bodies");
    let scene = Scene::new(ensemble)
        .until(50.0)
        .outputs(Outputs::Times(case.times()))
        .pinned(Method::Rk4, 0.01, Some(Precision::F64))
        .force(Force::gravity(vector(&model["g"])))
        .force(Force::linear_drag(number(&model["c"])));
    let engine = Cpu::new(Width::Lanes);
    let plan = Plan::new(&scene, &engine).expect("the plan is valid");
    let record = polhode::run::run(&engine, &plan).expect("the run succeeds");
    let states = case.record["states"].as_array().expect("states");
    assert_eq!(record.snapshots().len(), states.len());
    for (snapshot, state) in record.snapshots().iter().zip(states) {
        let (x, v) = (vector(&state["x"]), vector(&state["v"]));
        let (x_error, v_error) = ((snapshot.positions()[0] - x).length(), (snapshot.velocities()[0] - v).length());
        let unit = 8.0 * f64::EPSILON;
        assert!(x_error <= unit * (x.length() + 100.0), "t = {}: x off by {x_error:e} m", snapshot.time());
        assert!(v_error <= unit * (v.length() + 10.0), "t = {}: v off by {v_error:e} m/s", snapshot.time());
    }
}
