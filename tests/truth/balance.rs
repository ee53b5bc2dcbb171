//! Energy and angular momentum change by what the torques give, and the report of it would show where they did not.

use glam::{DQuat, DVec3};
use polhode::engine::cpu::Cpu;
use polhode::math::Precision;
use polhode::math::Width;
use polhode::record::Balance;
use polhode::torque::Orbit;
use polhode::{Ensemble, Method, Outputs, Plan, Record, Scene, Torque};

const MOMENTS: DVec3 = DVec3::new(1.0, 2.0, 2.5);
const OMEGA: DVec3 = DVec3::new(0.5, 0.8, -0.3);
const END: f64 = 20.0;

/// rk8 is wrong by less than 1e-15 in a step of 1/32 rad, so that rounding is all that it leaves.
const DT: f64 = 1.0 / 32.0;

/// 640 steps of the run and 1,280 of the recomputation, each a rounding of 2⁻⁵³ of state and work; their random walk comes
/// to 1e-14, and the motion under the torques here magnifies it by less than 20.
const ROUNDING_F64: f64 = 2e-13;

/// 2⁻²⁴ (4 + 20 rad), the bound of `golden.rs` on rounding in f32 where the state is carried in two words, magnified by the
/// same 20.
const ROUNDING_F32: f64 = 3e-5;

fn orientation() -> DQuat {
    DQuat::from_xyzw(0.3, -0.1, 0.2, 0.9).normalize()
}

/// Torques of every kind of work: taken, given and taken back, with and without potential, at rest in the world or not.
fn cases() -> Vec<(&'static str, Vec<Torque>)> {
    let field = DVec3::new(0.5, 1.0, 0.2);
    let elliptic = Orbit::kepler(1.0, 2.0, 0.5).inclined(0.6).with_mean_anomaly(0.3);
    vec![
        ("linear drag", vec![Torque::linear_drag(0.1)]),
        ("quadratic drag", vec![Torque::quadratic_drag(0.1)]),
        ("elliptic gravity gradient", vec![Torque::gravity_gradient(elliptic)]),
        ("sinusoid", vec![Torque::sinusoidal(DVec3::new(0.3, -0.2, 0.1), DVec3::new(0.1, 0.2, 0.3), 1.75)]),
        ("eddy current", vec![Torque::eddy_current(0.2, field)]),
        ("constant in the body", vec![Torque::constant_body(DVec3::new(0.05, -0.1, 0.02))]),
        ("constant in the world", vec![Torque::constant_world(DVec3::new(0.05, -0.1, 0.02))]),
        ("internal dissipation", vec![Torque::internal_dissipation(0.05)]),
        ("magnet", vec![Torque::magnetic_dipole(DVec3::new(0.4, 0.2, -0.7), field)]),
        ("magnet with drag", vec![Torque::magnetic_dipole(DVec3::X, field), Torque::linear_drag(0.1)]),
        ("random torque", vec![Torque::white_noise(0.1, 7)]),
    ]
}

fn scene(torques: &[Torque], method: Method, dt: f64, precision: Precision) -> Scene {
    let ensemble = Ensemble::from_columns(&[MOMENTS], &[orientation()], &[OMEGA]).expect("a valid body");
    let times = vec![0.4 * END, 0.5 * END, END];
    let scene = Scene::new(ensemble).until(END).outputs(Outputs::Times(times)).pinned(method, dt, Some(precision));
    torques.iter().fold(scene, |scene, torque| scene.torque(torque.clone()))
}

fn run(torques: &[Torque], method: Method, dt: f64, precision: Precision) -> Record {
    let engine = Cpu::new(Width::Lanes);
    let scene = scene(torques, method, dt, precision);
    let plan = Plan::new(&scene, &engine).expect("a valid plan");
    polhode::run::run(&engine, &plan).expect("a run")
}

/// The balance of a run's end under a scene with other torques.
fn balance_under(torques: &[Torque], record: &Record) -> Balance {
    let scene = scene(torques, Method::Rk8, DT, Precision::F64);
    let plan = Plan::new(&scene, &Cpu::new(Width::Lanes)).expect("a valid plan");
    let end = record.final_state();
    polhode::run::balance(&plan, end.orientations(), end.angular_velocities_body()).expect("a balance")
}

#[test]
fn the_balance_closes_to_rounding_under_every_kind_of_torque() {
    for (precision, bound) in [(Precision::F64, ROUNDING_F64), (Precision::F32, ROUNDING_F32)] {
        for (name, torques) in cases() {
            let record = run(&torques, Method::Rk8, DT, precision);
            let (trust, balance) = (record.trust(), record.trust().balance);
            assert_eq!(balance.bodies, 1, "{name}");
            assert!(balance.energy.max < bound, "{name} in {precision}: {balance}");
            assert!(balance.angular_momentum_world.max < bound, "{name} in {precision}: {balance}");
            // Else there would have been nothing to balance; internal dissipation keeps L, a random torque may do little.
            let energy = |omega: DVec3| 0.5 * omega.dot(MOMENTS * omega);
            let change = energy(record.final_state().angular_velocity_body(0)) / energy(OMEGA) - 1.0;
            assert!(change.abs() > 1e-3, "{name}: {change:e}, {trust}");
            // What torques change is no drift.
            assert_eq!(trust.drift.kinetic_energy_bodies, 0, "{name}");
            assert_eq!(trust.drift.angular_momentum_bodies, usize::from(name == "internal dissipation"), "{name}");
        }
    }
}

#[test]
fn the_balance_shows_the_error_of_a_coarse_run() {
    let (_, torques) = cases().swap_remove(3);
    let coarse = run(&torques, Method::Rk4, 0.25, Precision::F64).trust().balance;
    let fine = run(&torques, Method::Rk4, 0.125, Precision::F64).trust().balance;
    let order = (coarse.energy.max / fine.energy.max).log2();
    assert!(coarse.energy.max > 1e-6, "{coarse}");
    assert!((3.0..6.0).contains(&order), "{coarse}, then {fine}");
}

#[test]
fn a_torque_of_the_wrong_sign_in_the_balance_is_found() {
    let torques = [Torque::constant_body(DVec3::new(0.05, -0.1, 0.02)), Torque::linear_drag(0.1)];
    let flipped = [Torque::constant_body(DVec3::new(-0.05, 0.1, -0.02)), Torque::linear_drag(0.1)];
    let record = run(&torques, Method::Rk8, DT, Precision::F64);
    let sound = balance_under(&torques, &record);
    assert!(sound.energy.max < ROUNDING_F64 && sound.angular_momentum_world.max < ROUNDING_F64, "{sound}");
    let faulty = balance_under(&flipped, &record);
    assert!(faulty.energy.max > 1e-2 && faulty.angular_momentum_world.max > 1e-2, "{faulty}");
    let lacking = balance_under(&torques[..1], &record);
    assert!(lacking.energy.max > 1e-2 && lacking.angular_momentum_world.max > 1e-2, "{lacking}");
}

#[test]
fn energy_is_total_where_all_torques_have_a_potential_and_only_there() {
    let field = DVec3::new(0.5, 1.0, 0.2);
    let magnet = Torque::magnetic_dipole(DVec3::new(0.4, 0.2, -0.7), field);
    let spring = Torque::sine_spring(0.7, DQuat::from_xyzw(0.1, 0.3, -0.2, 0.8));
    let both = run(&[magnet.clone(), spring.clone()], Method::Rk8, DT, Precision::F64);
    let balance = both.trust().balance;
    assert_eq!(balance.conservative_bodies, 1);
    assert!(balance.total_energy.max < ROUNDING_F64, "{balance}");
    let with_drag = run(&[magnet, spring, Torque::linear_drag(0.1)], Method::Rk8, DT, Precision::F64);
    assert_eq!(with_drag.trust().balance.conservative_bodies, 0);
    let free = run(&[], Method::Rk8, DT, Precision::F64);
    assert_eq!((free.trust().balance.bodies, free.trust().balance.conservative_bodies), (0, 0));
}

#[test]
fn a_random_torque_is_recomputed_on_the_run_s_own_path() {
    let record = run(&[Torque::white_noise(0.1, 7)], Method::Rk8, DT, Precision::F64);
    assert!(record.trust().recomputed_sample.attitude.max < ROUNDING_F64, "{}", record.trust());
}
