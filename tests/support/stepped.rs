//! Golden cases in equal steps, and errors of golden states against their bounds.

use glam::{DMat3, DQuat, DVec3};
use polhode::engine::Backend;
use polhode::math::Precision;
use polhode::{Ensemble, Method, Outputs, Plan, Scene, Torque};

use super::golden::Case;

/// The states at `times` by a method in equal steps, for several bodies beside each other.
pub fn stepped(
    engine: &dyn Backend,
    (method, precision): (Method, Precision),
    torques: &[Torque],
    rows: &[(DMat3, DQuat, DVec3)],
    times: &[f64],
    dt: f64,
) -> Vec<Vec<(DQuat, DVec3)>> {
    let ensemble = Ensemble::from_fn(rows.len(), |body| rows[body]).expect("golden bodies are valid");
    let end = times[times.len() - 1];
    let scene =
        Scene::new(ensemble).until(end).outputs(Outputs::Times(times.to_vec())).pinned(method, dt, Some(precision));
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

/// The unit of roundoff.
pub fn unit(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 2.0_f64.powi(-24),
        Precision::F64 => 2.0_f64.powi(-53),
    }
}

/// The larger of two errors; one that is no number is the larger.
pub fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// Errors of golden states against their bounds.
#[derive(Default)]
pub struct Tally {
    checked: usize,
    largest: f64,
    failures: Vec<String>,
}

impl Tally {
    /// Takes the error of a case's state at `time`; `detail` says what the bound is made of.
    pub fn push(&mut self, case: &Case, time: f64, error: f64, bound: f64, detail: impl FnOnce() -> String) {
        self.checked += 1;
        self.largest = larger(self.largest, error / bound);
        if error.is_nan() || error > bound {
            let detail = detail();
            self.failures.push(format!("{} at t = {time}: error {error:.2e}, bound {bound:.2e} ({detail})", case.name));
        }
    }

    /// Fails where an error was beyond its bound or fewer than `least` states were compared.
    pub fn finish(self, what: &str, least: usize) {
        let Self { checked, largest, failures } = self;
        println!("{what}: {checked} golden states, at most {largest:.3} of the bound");
        assert!(checked >= least, "only {checked} golden states were compared");
        assert!(failures.is_empty(), "{} of {checked} states:\n{}", failures.len(), failures.join("\n"));
    }
}
