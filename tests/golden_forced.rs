//! Stepped integrators against the golden cases of bodies under torques.

mod common;
mod support;

use std::sync::OnceLock;

use glam::{DMat3, DQuat, DVec3};
use polhode::batch::{Precision, prepare_with};
use polhode::engine::adaptive::AdaptiveSteps;
use polhode::engine::cpu::{Cpu, Width};
use polhode::engine::{Backend, unobserved};
use polhode::method::Status;
use polhode::torque::Orbit;
use polhode::{Ensemble, Force, Method, Outputs, Plan, Scene, Torque};
use serde_json::Value;
use support::attitude_error;
use support::golden::{self, Case, number, quaternion, vector};

/// Files of golden cases whose torques act on the rotation.
const FILES: [&str; 5] = ["forced_drag", "forced_gg", "forced_spring", "forced_top", "forced_torque"];

/// Rate times step size: rk4 in f64 then comes to about 1e-10 over 60 rad.
const ANGLE_OF_A_STEP: f64 = 1.0 / 128.0;

/// Relative size of the perturbations that measure a case's conditioning: large against rounding and small against the
/// distance over which the answer is linear.
const PERTURBATION: f64 = 1e-10;

/// A bound above this is none: the case's own growth has eaten all digits, as the golden data's notes say of the chaotic
/// ones.
const MEANINGLESS: f64 = 1e-2;

/// The torques of a case, their amplitudes multiplied by `factor`.
fn torques(model: &Value, factor: f64) -> Vec<Torque> {
    let scaled = |field: &str| number(&model[field]) * factor;
    let scaled_vector = |field: &str| vector(&model[field]) * factor;
    match model["type"].as_str().expect("a type") {
        "const_body_torque" => vec![Torque::constant_body(scaled_vector("tau"))],
        "const_world_torque" => vec![Torque::constant_world(scaled_vector("tau"))],
        "linear_drag" => vec![Torque::linear_drag(scaled("c"))],
        "quadratic_drag" => vec![Torque::quadratic_drag(scaled("c"))],
        "matrix_drag" => {
            let rows = &model["C"];
            let matrix = DMat3::from_cols(vector(&rows[0]), vector(&rows[1]), vector(&rows[2])).transpose();
            vec![Torque::matrix_drag(matrix * factor)]
        }
        "heavy_top" => {
            let gravity = DVec3::new(0.0, 0.0, -number(&model["g"]));
            vec![Torque::heavy_top(scaled("mass"), vector(&model["com_body"]), gravity)]
        }
        "gravity_gradient_circular" => {
            vec![Torque::gravity_gradient(Orbit::circular(scaled("mu"), number(&model["r"])))]
        }
        "gravity_gradient_kepler" => {
            let orbit = Orbit::kepler(scaled("mu"), number(&model["a"]), number(&model["e"]));
            vec![Torque::gravity_gradient(orbit)]
        }
        "magnetic_dipole" => vec![Torque::magnetic_dipole(scaled_vector("m_body"), vector(&model["B_world"]))],
        "sin_body_torque" => {
            vec![Torque::sinusoidal(scaled_vector("tau_sin"), scaled_vector("tau_cos"), number(&model["omega"]))]
        }
        "spring_sin" => {
            vec![Torque::sine_spring(scaled("k"), quaternion(&model["q_target_raw"])), Torque::linear_drag(scaled("c"))]
        }
        "spring_log" => {
            vec![Torque::log_spring(scaled("k"), quaternion(&model["q_target_raw"])), Torque::linear_drag(scaled("c"))]
        }
        other => panic!("no torque for the golden model {other}"),
    }
}

/// A case's states at `times`, for several bodies beside each other.
fn stepped(
    engine: &dyn Backend,
    torques: &[Torque],
    rows: &[(DMat3, DQuat, DVec3)],
    times: &[f64],
    dt: f64,
    precision: Precision,
) -> Vec<Vec<(DQuat, DVec3)>> {
    let ensemble = Ensemble::from_fn(rows.len(), |body| rows[body]).expect("golden bodies are valid");
    let end = times[times.len() - 1];
    let scene = Scene::new(ensemble).until(end).outputs(Outputs::Times(times.to_vec())).pinned(
        Method::Rk4,
        dt,
        Some(precision),
    );
    let scene = torques.iter().fold(scene, |scene, torque| scene.torque(torque.clone()));
    let plan = Plan::new(&scene, engine).expect("the plan is valid");
    let record = polhode::run::run(engine, &plan).expect("the run succeeds");
    assert_eq!(record.trust().failed_bodies, Vec::<usize>::new());
    record
        .snapshots()
        .iter()
        .map(|snapshot| {
            (0..rows.len()).map(|body| (snapshot.orientation(body), snapshot.angular_velocity_body(body))).collect()
        })
        .collect()
}

/// The difference of two states: the greater of the attitude error and the velocity's error relative to `rate`.
fn difference(a: (DQuat, DVec3), b: (DQuat, DVec3), rate: f64) -> f64 {
    attitude_error(a.0, b.0).max((a.1 - b.1).length() / rate)
}

/// How strongly the states at `times` answer to relative changes of the initial state, and of the torques.
fn conditioning(engine: &dyn Backend, case: &Case, times: &[f64], dt: f64, rate: f64) -> Vec<(f64, f64)> {
    let (q, omega) = (case.orientation, case.angular_velocity_body);
    let mut rows = vec![(case.inertia, q, omega)];
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        rows.push((case.inertia, q, omega + axis * (rate * PERTURBATION)));
        rows.push((case.inertia, q * DQuat::from_scaled_axis(axis * PERTURBATION), omega));
    }
    let model = &case.record["model"];
    let run = |torques: &[Torque], rows: &[_]| stepped(engine, torques, rows, times, dt, Precision::F64);
    let states = run(&torques(model, 1.0), &rows);
    let stronger = run(&torques(model, 1.0 + PERTURBATION), &rows[..1]);
    let mut largest = (1.0_f64, 0.0_f64);
    states
        .iter()
        .zip(&stronger)
        .map(|(bodies, stronger)| {
            for &neighbour in &bodies[1..] {
                largest.0 = largest.0.max(difference(neighbour, bodies[0], rate) / PERTURBATION);
            }
            largest.1 = largest.1.max(difference(stronger[0], bodies[0], rate) / PERTURBATION);
            largest
        })
        .collect()
}

/// A case with what its bounds are made of, for all times.
struct Prepared {
    case: Case,
    torques: Vec<Torque>,
    /// The greatest |ω| of the golden states.
    rate: f64,
    dt: f64,
    truncation: Vec<f64>,
    conditioning: Vec<(f64, f64)>,
}

/// The cases, prepared once for all engines.
fn prepared() -> &'static [Prepared] {
    static PREPARED: OnceLock<Vec<Prepared>> = OnceLock::new();
    PREPARED.get_or_init(|| FILES.into_iter().flat_map(golden::load).map(prepare).collect())
}

fn prepare(case: Case) -> Prepared {
    let reference = Cpu::new(Width::Lanes);
    let rate = case.states.iter().map(|state| state.angular_velocity_body.length()).fold(0.0, f64::max);
    let times = case.times();
    let rows = [(case.inertia, case.orientation, case.angular_velocity_body)];
    let torques = torques(&case.record["model"], 1.0);
    let dt = ANGLE_OF_A_STEP / rate.max(1.0);
    let run = |dt: f64| stepped(&reference, &torques, &rows, &times, dt, Precision::F64);
    let truncation = run(dt)
        .iter()
        .zip(run(2.0 * dt))
        .map(|(fine, coarse)| 2.0 / 15.0 * difference(coarse[0], fine[0], rate))
        .collect();
    let conditioning = conditioning(&reference, &case, &times, 2.0 * dt, rate);
    Prepared { case, torques, rate, dt, truncation, conditioning }
}

/// Steps every case and holds the error against a bound made of four parts: truncation, estimated from the same run at
/// twice the step (Richardson: the error is the difference over 2⁴ − 1; doubled for its own error); rounding of the
/// state, magnified by the case's conditioning (as in `golden.rs`); rounding of the torques' parameters and of the
/// torques themselves, four units of roundoff, magnified by the answer to a change of the torques; and the golden digits.
fn check(engine: &dyn Backend, precision: Precision) {
    let unit = match precision {
        Precision::F32 => 2.0_f64.powi(-24),
        Precision::F64 => 2.0_f64.powi(-53),
    };
    let mut failures = Vec::new();
    let mut checked = 0;
    for Prepared { case, torques, rate, dt, truncation, conditioning } in prepared() {
        let rows = [(case.inertia, case.orientation, case.angular_velocity_body)];
        let tested = stepped(engine, torques, &rows, &case.times(), *dt, precision);
        for (index, state) in case.states.iter().enumerate() {
            let angle = rate * state.time;
            let steps = state.time / dt;
            let rounding = match precision {
                Precision::F32 => unit * (4.0 + angle),
                Precision::F64 => unit * (8.0 + 4.0 * steps.sqrt()),
            };
            let ((to_state, to_torque), truncation) = (conditioning[index], truncation[index]);
            let noise = to_state * rounding + to_torque * 4.0 * unit;
            if noise > MEANINGLESS {
                continue;
            }
            checked += 1;
            let bound = truncation + noise;
            let error = difference(tested[index][0], (state.orientation, state.angular_velocity_body), *rate);
            if error.is_nan() || error > bound {
                failures.push(format!(
                    "{} at t = {}: error {error:.2e}, bound {bound:.2e} (truncation {truncation:.1e}, conditioning {to_state:.1e} to the state, {to_torque:.1e} to the torque)",
                    case.name, state.time
                ));
            }
        }
    }
    assert!(checked >= LEAST_CHECKED, "only {checked} golden states were compared");
    assert!(failures.is_empty(), "{} of {checked} states:\n{}", failures.len(), failures.join("\n"));
}

/// As [`check`], in adaptive steps. An accepted step is off by at most √7 of the tolerance in the quaternion and in the
/// angular momentum's direction and magnitude ([`polhode::method::rk8_adaptive`]; 7 components in its mean square), the
/// angle by twice that, and the case's conditioning magnifies what each step leaves.
fn check_adaptive(engine: &dyn Backend, precision: Precision, tolerance: f64) {
    let unit = match precision {
        Precision::F32 => 2.0_f64.powi(-24),
        Precision::F64 => 2.0_f64.powi(-53),
    };
    let steps = AdaptiveSteps { tolerance, least_step: None };
    let mut failures = Vec::new();
    let mut checked = 0;
    for Prepared { case, torques, rate, conditioning, .. } in prepared() {
        let rows = [(case.inertia, case.orientation, case.angular_velocity_body)];
        let ensemble = Ensemble::from_fn(1, |body| rows[body]).expect("golden bodies are valid");
        let times = case.times();
        let (frames, batch) = prepare_with(&ensemble, torques, times[times.len() - 1], precision).expect("prepared");
        let mut session = engine.start_adaptive(batch, steps).expect("started");
        for (index, state) in case.states.iter().enumerate() {
            session.advance_to(state.time, &mut unobserved).expect("advanced");
            let words = session.read(0..1).expect("read");
            assert_eq!(words.status[0], Status::Valid, "{} at t = {}", case.name, state.time);
            let counts = session.counts().expect("counted")[0];
            let (to_state, to_torque) = conditioning[index];
            let rounding = match precision {
                Precision::F32 => unit * (4.0 + rate * state.time),
                // The torques are evaluated and the state is rounded once a step; 12 stages weigh their roundings by up to 43.
                Precision::F64 => unit * (8.0 + 4.0 * 12.0 * (counts.accepted as f64).sqrt()),
            };
            let noise = to_state * rounding + to_torque * 4.0 * unit;
            let bound = to_state * 2.0 * 7.0_f64.sqrt() * tolerance * counts.accepted as f64 + noise;
            if bound > MEANINGLESS {
                continue;
            }
            checked += 1;
            let reached = frames[0].body_state(words.combined(0));
            let reached = (reached.orientation, reached.angular_velocity_body);
            let error = difference(reached, (state.orientation, state.angular_velocity_body), *rate);
            if error.is_nan() || error > bound {
                failures.push(format!(
                    "{} at t = {}: error {error:.2e}, bound {bound:.2e} ({counts:?}, conditioning {to_state:.1e}, {to_torque:.1e})",
                    case.name, state.time
                ));
            }
        }
    }
    assert!(checked >= LEAST_CHECKED_ADAPTIVE, "only {checked} golden states were compared");
    assert!(failures.is_empty(), "{} of {checked} states:\n{}", failures.len(), failures.join("\n"));
}

/// Golden states that can be followed in `f32` with a tolerance of 1e-6, and so in either precision.
const LEAST_CHECKED_ADAPTIVE: usize = 140;

#[test]
fn adaptive_cpu_f64_follows_the_golden_forced_bodies() {
    check_adaptive(&Cpu::new(Width::Lanes), Precision::F64, 1e-12);
}

#[test]
fn adaptive_scalar_f64_follows_the_golden_forced_bodies() {
    check_adaptive(&Cpu::new(Width::Scalar), Precision::F64, 1e-9);
}

#[test]
fn adaptive_cpu_f32_follows_the_golden_forced_bodies() {
    check_adaptive(&Cpu::new(Width::Lanes), Precision::F32, 1e-6);
}

#[test]
fn adaptive_gpu_f64_follows_the_golden_forced_bodies() {
    check_adaptive(&common::gpu(), Precision::F64, 1e-12);
}

#[test]
fn adaptive_gpu_f32_follows_the_golden_forced_bodies() {
    check_adaptive(&common::gpu(), Precision::F32, 1e-6);
}

/// Golden states that can be followed in `f32`, and so in either precision.
const LEAST_CHECKED: usize = 155;

#[test]
fn cpu_f64_follows_the_golden_forced_bodies() {
    check(&Cpu::new(Width::Lanes), Precision::F64);
}

#[test]
fn scalar_f64_follows_the_golden_forced_bodies() {
    check(&Cpu::new(Width::Scalar), Precision::F64);
}

#[test]
fn cpu_f32_follows_the_golden_forced_bodies() {
    check(&Cpu::new(Width::Lanes), Precision::F32);
}

#[test]
fn gpu_f64_follows_the_golden_forced_bodies() {
    check(&common::gpu(), Precision::F64);
}

#[test]
fn gpu_f32_follows_the_golden_forced_bodies() {
    check(&common::gpu(), Precision::F32);
}

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
            let moments = polhode::inertia::principal_axes(&ensemble.inertia()[0]).moments;
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
            ensemble.with_translation(polhode::ensemble::Translation {
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
