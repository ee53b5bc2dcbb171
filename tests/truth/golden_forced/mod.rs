//! Stepped integrators against the golden cases of bodies under torques.
//!
//! A bound is the sum of what the method leaves (truncation, or the tolerance of adaptive steps), of rounding of the state, magnified by
//! the case's conditioning, and of rounding of the torques' parameters and of the torques themselves, four units of roundoff, magnified by
//! the answer to a change of the torques.

mod adaptive;
mod balance;
use crate::common;
mod equal;
mod inclined;
use crate::support;

use std::sync::OnceLock;

use glam::{DMat3, DQuat, DVec3};
use polhode::engine::Backend;
use polhode::engine::cpu::Cpu;
use polhode::math::Precision;
use polhode::math::Width;
use polhode::{Method, Torque};
use support::attitude_error;
use support::golden::{self, Case, torques};
use support::stepped::{larger, stepped, unit};

/// Files of golden cases whose torques act on the rotation.
const FILES: [&str; 6] =
    ["forced_drag", "forced_gg", "forced_gg_inclined", "forced_spring", "forced_top", "forced_torque"];

/// Rate times step size: rk4 in f64 then comes to about 1e-10 over 60 rad.
const ANGLE_OF_A_STEP: f64 = 1.0 / 128.0;

/// Relative size of the perturbations that measure a case's conditioning: large against rounding and small against the
/// distance over which the answer is linear.
const PERTURBATION: f64 = 1e-10;

/// A bound above this is none: the case's own growth has eaten all digits, as the golden data's notes say of the chaotic
/// ones.
const MEANINGLESS: f64 = 1e-2;

/// The difference of two states: the greater of the attitude error and the velocity's error relative to `rate`.
fn difference(a: (DQuat, DVec3), b: (DQuat, DVec3), rate: f64) -> f64 {
    larger(attitude_error(a.0, b.0), (a.1 - b.1).length() / rate)
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
    let run = |torques: &[Torque], rows: &[_]| stepped(engine, (Method::Rk4, Precision::F64), torques, rows, times, dt);
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
    let run = |dt: f64| stepped(&reference, (Method::Rk4, Precision::F64), &torques, &rows, &times, dt);
    let truncation = run(dt)
        .iter()
        .zip(run(2.0 * dt))
        .map(|(fine, coarse)| 2.0 / 15.0 * difference(coarse[0], fine[0], rate))
        .collect();
    let conditioning = conditioning(&reference, &case, &times, 2.0 * dt, rate);
    Prepared { case, torques, rate, dt, truncation, conditioning }
}

impl Prepared {
    fn row(&self) -> (DMat3, DQuat, DVec3) {
        (self.case.inertia, self.case.orientation, self.case.angular_velocity_body)
    }

    /// What roundings leave at the golden state `index`, where one of the state is `rounding`.
    fn noise(&self, index: usize, rounding: f64, precision: Precision) -> f64 {
        let (to_state, to_torque) = self.conditioning[index];
        to_state * rounding + to_torque * 4.0 * unit(precision)
    }
}
