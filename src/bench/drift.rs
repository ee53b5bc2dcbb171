//! Long runs: how a constant of the motion wanders over ten million steps, and whether it grows steadily or at random.
//!
//! The constants are: for a free body the kinetic energy; for a heavy top kinetic plus potential energy; for a body on a circular orbit
//! under its gravity gradient Jacobi's integral T + V − n L_z in the axes that turn with the orbit (P. C. Hughes, *Spacecraft
//! Attitude Dynamics*, 1986, section 9.1).

use std::path::Path;
use std::time::Instant;

use glam::{DQuat, DVec3};

use super::row::Row;
use super::{Bench, Case, Swept, Watcher, sweep};
use crate::bodies::BodyState;
use crate::bodies::Ensemble;
use crate::bodies::Status;
use crate::engine::batch::prepare_with;
use crate::engine::{End, Engine, EngineKind, unobserved};
use crate::error::Result;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::study::draw::{Column, Draw};
use crate::torque::{Orbit, Torque};

/// The table's name.
pub const TABLE: &str = "drift";

const BODIES: usize = 16;
const SEED: u64 = 31;
/// Step size, s.
const DT: f64 = 0.01;
/// Number of times at which the bodies are observed; the numbers of steps are multiples of it.
const OUTPUTS: u64 = 50;
const STEPS: u64 = 10_000_000;
const QUICK_STEPS: u64 = 100_000;

/// The motions whose constant is observed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Problem {
    /// No torque.
    Free,
    /// A symmetric top about a pivot.
    HeavyTop,
    /// A tumbling body on a circular orbit of 1 rad/s.
    GravityGradient,
}

impl Problem {
    const ALL: [Problem; 3] = [Problem::Free, Problem::HeavyTop, Problem::GravityGradient];

    fn name(self) -> &'static str {
        match self {
            Problem::Free => "free",
            Problem::HeavyTop => "heavy-top",
            Problem::GravityGradient => "gravity-gradient",
        }
    }

    fn moments(self) -> DVec3 {
        match self {
            Problem::HeavyTop => DVec3::new(1.0, 1.0, 0.6),
            _ => DVec3::new(1.0, 1.6, 2.2),
        }
    }

    fn torque(self) -> Option<Torque> {
        match self {
            Problem::Free => None,
            Problem::HeavyTop => Some(Torque::heavy_top(1.0, DVec3::new(0.0, 0.0, 0.5), DVec3::new(0.0, 0.0, -1.0))),
            Problem::GravityGradient => Some(Torque::gravity_gradient(Orbit::circular(1.0, 1.0))),
        }
    }

    fn ensemble(self) -> Result<Ensemble> {
        let draw = Draw::new(SEED);
        Ensemble::from_fn(BODIES, |body| {
            let spin = draw.normal_vector(body, Column::AngularVelocity);
            let orientation: DQuat = draw.rotation(body, Column::Orientation);
            (self.moments(), orientation, 0.7 * spin + DVec3::new(0.0, 0.0, 1.0))
        })
    }

    /// The constant at a time (s), and the initial scale (J) of its changes.
    fn constant(self, state: &BodyState, time: f64) -> (f64, f64) {
        let kinetic = state.kinetic_energy;
        match self {
            Problem::Free => (kinetic, kinetic),
            Problem::HeavyTop => {
                let height = (state.orientation * DVec3::new(0.0, 0.0, 0.5)).z;
                (kinetic + height, kinetic + 0.5)
            }
            Problem::GravityGradient => {
                let outward = state.orientation.conjugate() * DVec3::new(time.cos(), time.sin(), 0.0);
                let potential = 1.5 * outward.dot(self.moments() * outward);
                (kinetic + potential - state.angular_momentum_world.z, kinetic + potential)
            }
        }
    }
}

/// One long run.
#[derive(Clone, Debug)]
pub struct DriftCase {
    engine: Engine,
    problem: Problem,
    method: Method,
    precision: Precision,
    steps: u64,
}

impl Case for DriftCase {
    fn label(&self) -> String {
        let engine = self.engine.description().kind.name();
        format!("{}/{engine}/{}/{}", self.problem.name(), self.method, self.precision)
    }

    fn engine(&self) -> &Engine {
        &self.engine
    }
}

/// All cases; on a GPU with the quick run's steps, to compare the two.
pub fn cases(bench: &Bench) -> Vec<DriftCase> {
    let mut cases = Vec::new();
    for engine in &bench.engines {
        let long = !bench.quick && engine.description().kind == EngineKind::Cpu;
        for problem in Problem::ALL {
            for method in Method::ALL {
                for &precision in engine.precisions() {
                    let steps = if long { STEPS } else { QUICK_STEPS };
                    cases.push(DriftCase { engine: engine.clone(), problem, method, precision, steps });
                }
            }
        }
    }
    cases
}

/// Measures the cases and appends their rows to the table [`TABLE`] in `folder`.
///
/// # Errors
///
/// Those of the table and of the engines; rows measured before are kept.
pub fn run(bench: &Bench, folder: &Path, watcher: &mut Watcher<'_>) -> Result<Swept> {
    sweep(bench, folder, TABLE, &cases(bench), watcher, |case, _| case.measure())
}

impl DriftCase {
    fn measure(&self) -> Result<Row> {
        let ensemble = self.problem.ensemble()?;
        let torques: Vec<Torque> = self.problem.torque().into_iter().collect();
        let span = DT * self.steps as f64;
        let (frames, batch) = prepare_with(&ensemble, &torques, span, self.precision)?;
        let mut session = self.engine.start(batch, self.method)?;
        let (mut seen, mut sizes): (Vec<Vec<f64>>, Vec<f64>) = Default::default();
        let mut flagged = 0;
        let clock = Instant::now();
        for output in 0..=OUTPUTS {
            if output > 0 {
                session.advance_to(End::of_steps(DT, self.steps / OUTPUTS), &mut unobserved)?;
            }
            let words = session.read(0..BODIES)?;
            let time = DT * (self.steps / OUTPUTS * output) as f64;
            flagged = words.status.iter().filter(|status| **status != Status::Valid).count();
            let of_body = |body: usize| self.problem.constant(&frames[body].body_state(words.combined(body)), time);
            let constants: Vec<(f64, f64)> = (0..BODIES).map(of_body).collect();
            if output == 0 {
                sizes = constants.iter().map(|constant| constant.1.abs()).collect();
            }
            seen.push(constants.into_iter().map(|constant| constant.0).collect());
        }
        let seconds = clock.elapsed().as_secs_f64();
        let change = |body: usize, constants: &Vec<f64>| (constants[body] - seen[0][body]).abs() / sizes[body];
        let errors: Vec<Vec<f64>> =
            (0..BODIES).map(|body| seen.iter().map(|constants| change(body, constants)).collect()).collect();
        let growths: Vec<f64> =
            errors.iter().map(|errors| growth(errors)).filter(|growth| growth.is_finite()).collect();
        let end: Vec<f64> = errors.iter().map(|errors| errors.iter().copied().fold(0.0, f64::max)).collect();
        let finite = end.iter().all(|error| error.is_finite()) && seen.iter().flatten().all(|x| x.is_finite());
        let exponent = median(growths);
        Ok(Row::new()
            .with("problem", self.problem.name())
            .with("method", self.method.name())
            .with("precision", self.precision.name())
            .with("steps", self.steps)
            .with("dt_s", DT)
            .with("bodies", BODIES)
            .with("seconds", seconds)
            .with("drift_median", if finite { median(end.clone()) } else { f64::NAN })
            .with("drift_max", if finite { end.iter().copied().fold(0.0, f64::max) } else { f64::NAN })
            .with("growth_exponent", exponent)
            .with("growth", if finite { kind(exponent) } else { "not a number" })
            .with("flagged_bodies", flagged))
    }
}

/// The exponent n in |error| ∝ tⁿ by a least-squares fit to the logarithms of its running maximum, from a tenth of the run on.
fn growth(errors: &[f64]) -> f64 {
    let mut greatest = 0.0_f64;
    let points: Vec<(f64, f64)> = errors
        .iter()
        .enumerate()
        .filter_map(|(output, error)| {
            greatest = greatest.max(*error);
            (output * 10 >= errors.len() && greatest > 0.0).then(|| ((output as f64).ln(), greatest.ln()))
        })
        .collect();
    let count = points.len() as f64;
    let (x, y) = (points.iter().map(|p| p.0).sum::<f64>() / count, points.iter().map(|p| p.1).sum::<f64>() / count);
    points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>()
}

fn kind(exponent: f64) -> &'static str {
    if exponent > 0.75 {
        "linear"
    } else if exponent > 0.25 {
        "random walk"
    } else {
        "bounded"
    }
}

pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// The drifts as a table in Markdown.
pub fn summary(rows: &[Row]) -> String {
    let mut text = String::from(
        "| problem | method | precision | engine | steps | drift, median | max | growth |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for row in rows {
        let engine = row.text("case").split('/').nth(1).unwrap_or_default().to_owned();
        text += &format!(
            "| {} | {} | {} | {engine} | {:.0e} | {:.1e} | {:.1e} | {} (exponent {:.2}) |\n",
            row.text("problem"),
            row.text("method"),
            row.text("precision"),
            row.number("steps"),
            row.number("drift_median"),
            row.number("drift_max"),
            row.text("growth"),
            row.number("growth_exponent"),
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_growth_and_random_walks_are_told_apart() {
        let linear: Vec<f64> = (0..=50).map(|output| 1e-9 * f64::from(output)).collect();
        let walk: Vec<f64> = (0..=50).map(|output| 1e-9 * f64::from(output).sqrt()).collect();
        let bounded: Vec<f64> = (0..=50).map(|output| 1e-9 * (1.0 + (f64::from(output) * 0.7).sin())).collect();
        assert_eq!([&linear, &walk, &bounded].map(|errors| kind(growth(errors))), ["linear", "random walk", "bounded"]);
    }
}
