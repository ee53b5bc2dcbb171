//! The atlas: the behaviour of free bodies under every method, for short and long steps, round and slender bodies, far from the separatrix
//! and next to it.
//!
//! A case is one method in one precision on one engine for one shape of body at one distance from the separatrix; its row
//! has an [`Outcome`] and figures for each step size ω dt.

use std::path::Path;

use glam::{DQuat, DVec3};

use super::row::Row;
use super::{Bench, Case, Swept, Watcher, sweep};
use crate::bodies::BodyState;
use crate::bodies::Ensemble;
use crate::bodies::Status;
use crate::bodies::frame::attitude_error;
use crate::engine::batch::prepare;
use crate::engine::{End, Engine, EngineKind, unobserved};
use crate::error::Result;
use crate::kernel::free_motion::FreeMotion;
use crate::kernel::method::{Method, TorqueKind};
use crate::math::Precision;
use crate::study::draw::{Column, Draw};

/// The name of the table for a precision: the whole atlas in one file would be too large for a repository.
pub fn table(precision: Precision) -> String {
    format!("stability-{precision}")
}

/// Number of bodies in a case.
const BODIES: usize = 16;
/// Number of times at which the bodies are observed; the number of steps is a multiple of it.
const OUTPUTS: usize = 16;
const SEED: u64 = 9;

/// ω dt as powers of ten, for the full atlas and the quick one.
const EXPONENTS: [f64; 15] = [-4.0, -3.5, -3.0, -2.5, -2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0];
const QUICK_EXPONENTS: [f64; 8] = [-3.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 3.0];

/// I₃/I₁.
const RATIOS: [f64; 8] = [1.01, 2.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6];
const QUICK_RATIOS: [f64; 4] = [1.01, 2.0, 1e2, 1e6];
const GPU_RATIOS: [f64; 2] = [2.0, 1e2];

/// ε of ω ∝ (ε, 1, ε); `None`: directions drawn at random.
const DISTANCES: [Option<f64>; 7] = [None, Some(1e-1), Some(1e-2), Some(1e-3), Some(1e-4), Some(1e-5), Some(1e-6)];
const QUICK_DISTANCES: [Option<f64>; 3] = [None, Some(1e-3), Some(1e-6)];
const GPU_DISTANCES: [Option<f64>; 2] = [None, Some(1e-3)];

/// The behaviour of the bodies of a case at one step size; of the outcomes that apply, the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Outcome {
    /// The attitude error falls with the step at the claimed order.
    OrderKept,
    /// The order is not seen, and the attitude error grows less than in proportion to time: roundings.
    RandomWalk,
    /// The order is not seen, and the attitude error grows in proportion to time.
    Linear,
    /// As [`Outcome::Linear`] or [`Outcome::RandomWalk`], but energy or angular momentum is off by more than 1e-3.
    Drifts,
    /// The median attitude error is above a radian; energy and angular momentum are kept within a factor of two.
    PhaseLost,
    /// A body spins about its middle axis the other way round than it should.
    FlipsWrongly,
    /// Energy or angular momentum is off by its own size.
    Diverges,
    /// A state is NaN, and no step has reported it.
    NotANumber,
    /// A body is flagged: the method itself reports that the step is too long.
    Flagged,
}

impl Outcome {
    /// All outcomes, the best first.
    pub const ALL: [Outcome; 9] = [
        Outcome::OrderKept,
        Outcome::RandomWalk,
        Outcome::Linear,
        Outcome::Drifts,
        Outcome::PhaseLost,
        Outcome::FlipsWrongly,
        Outcome::Diverges,
        Outcome::NotANumber,
        Outcome::Flagged,
    ];

    /// The name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Outcome::OrderKept => "order kept",
            Outcome::RandomWalk => "random walk",
            Outcome::Linear => "linear growth",
            Outcome::Drifts => "drifts",
            Outcome::PhaseLost => "phase lost",
            Outcome::FlipsWrongly => "flips wrongly",
            Outcome::Diverges => "diverges",
            Outcome::Flagged => "flagged",
            Outcome::NotANumber => "not a number",
        }
    }

    /// The outcome with this name.
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|outcome| outcome.name() == name)
    }

    /// Whether the states are usable.
    pub(crate) fn is_usable(self) -> bool {
        matches!(self, Outcome::OrderKept | Outcome::RandomWalk | Outcome::Linear)
    }
}

/// One row of the atlas.
#[derive(Clone, Debug)]
pub struct StabilityCase {
    /// The engine that integrates.
    pub engine: Engine,
    /// The method.
    pub method: Method,
    /// The arithmetic.
    pub precision: Precision,
    /// I₃/I₁.
    pub ratio: f64,
    /// ε, or `None` far from the separatrix.
    pub distance: Option<f64>,
    exponents: &'static [f64],
    /// The most steps of a run, and the angle in rad after which it ends if that takes fewer.
    steps: u64,
    angle: f64,
}

impl Case for StabilityCase {
    fn label(&self) -> String {
        let engine = self.engine.description().kind.name();
        format!("{engine}/{}/{}/ratio {:e}/{}", self.method, self.precision, self.ratio, self.place())
    }

    fn engine(&self) -> &Engine {
        &self.engine
    }
}

/// All cases: the whole map on the CPU; on a GPU a part of it, in shorter runs, to compare the two.
pub fn cases(bench: &Bench) -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for engine in &bench.engines {
        let gpu = engine.description().kind == EngineKind::Gpu;
        let (ratios, distances): (&[f64], &[Option<f64>]) = match (gpu, bench.quick) {
            (true, _) => (&GPU_RATIOS, &GPU_DISTANCES),
            (false, true) => (&QUICK_RATIOS, &QUICK_DISTANCES),
            (false, false) => (&RATIOS, &DISTANCES),
        };
        let exponents: &'static [f64] = if bench.quick || gpu { &QUICK_EXPONENTS } else { &EXPONENTS };
        let (steps, angle) = match (gpu, bench.quick) {
            (true, _) => (1 << 10, 30.0),
            (false, true) => (1 << 13, 30.0),
            (false, false) => (100_000, 100.0),
        };
        for precision in engine.precisions() {
            for method in Method::ALL {
                for &ratio in ratios {
                    for &distance in distances {
                        cases.push(StabilityCase {
                            engine: engine.clone(),
                            method,
                            precision: *precision,
                            ratio,
                            distance,
                            exponents,
                            steps,
                            angle,
                        });
                    }
                }
            }
        }
    }
    cases
}

/// Measures the cases and appends their rows to the tables ([`table`]) in `folder`.
///
/// # Errors
///
/// Those of the table and of the engines; rows measured before are kept.
pub fn run(bench: &Bench, folder: &Path, watcher: &mut Watcher<'_>) -> Result<Swept> {
    let mut swept = Swept::default();
    for precision in Precision::ALL {
        let cases: Vec<_> = cases(bench).into_iter().filter(|case| case.precision == precision).collect();
        let part = sweep(bench, folder, &table(precision), &cases, watcher, |case, _| case.measure())?;
        swept.rows.extend(part.rows);
        swept.left_out += part.left_out;
        swept.tables.extend(part.tables);
    }
    Ok(swept)
}

/// Figures of a row for each step size, in addition to its outcome.
const FIGURES: [&str; 5] = ["steps", "attitude_error_rad_median", "invariant_error", "order", "growth"];

/// The nearest number to `x` with six decimal digits: a map does not show more.
fn to_six_digits(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}

/// The name of a column for one step size.
pub fn column(quantity: &str, exponent: f64) -> String {
    format!("{quantity}_at_1e{exponent}")
}

/// The step sizes ω dt, as powers of ten, that a row has outcomes for.
pub fn exponents(row: &Row) -> Vec<f64> {
    EXPONENTS.into_iter().filter(|exponent| !row.text(&column("outcome", *exponent)).is_empty()).collect()
}

/// The observations of a run.
struct Observations {
    /// Attitude errors, rad, by observation and body.
    attitude: Vec<Vec<f64>>,
    /// The greatest relative error of energy or angular momentum at the end.
    invariants: f64,
    finite: bool,
    flagged: bool,
    flips_wrongly: bool,
}

impl Observations {
    fn median(&self, output: usize) -> f64 {
        super::drift::median(self.attitude[output].clone())
    }

    /// The exponent n in error ∝ tⁿ, from a quarter of the run to its end.
    fn growth(&self) -> f64 {
        let (early, late) = (self.median(OUTPUTS / 4 - 1), self.median(OUTPUTS - 1));
        (late / early.max(f64::MIN_POSITIVE)).log2() / 2.0
    }
}

impl StabilityCase {
    fn place(&self) -> String {
        self.distance.map_or_else(|| "generic".to_owned(), |epsilon| format!("separatrix {epsilon:e}"))
    }

    /// I₁ = 1, I₃ the ratio and I₂ between them as far as a valid body allows.
    fn moments(&self) -> DVec3 {
        let middle = if self.ratio <= 2.0 { 0.5 * (1.0 + self.ratio) } else { self.ratio - 0.5 };
        DVec3::new(1.0, middle, self.ratio)
    }

    /// Bodies that spin at 1 rad/s.
    fn ensemble(&self) -> Result<Ensemble> {
        let draw = Draw::new(SEED);
        Ensemble::from_fn(BODIES, |body| {
            let orientation: DQuat = draw.rotation(body, Column::Orientation);
            let drawn = draw.normal_vector(body, Column::AngularVelocity);
            let direction = match self.distance {
                None => drawn,
                // A few per cent of variation, so that the bodies do not flip together.
                Some(epsilon) => DVec3::new(epsilon * (1.0 + 0.03 * drawn.x), 1.0, epsilon * (1.0 + 0.03 * drawn.z)),
            };
            (self.moments(), orientation, direction.normalize())
        })
    }

    fn steps(&self, angle: f64) -> u64 {
        let wanted = (self.angle / angle).clamp(512.0, self.steps as f64) as u64;
        wanted.next_multiple_of(OUTPUTS as u64)
    }

    fn measure(&self) -> Result<Row> {
        let ensemble = self.ensemble()?;
        let mut row = Row::new()
            .with("method", self.method.name())
            .with("precision", self.precision.name())
            .with("ratio", self.ratio)
            .with("place", self.place())
            .with("epsilon", self.distance.unwrap_or(f64::NAN))
            .with("bodies", BODIES);
        for exponent in EXPONENTS {
            if !self.exponents.contains(&exponent) {
                row = row.with(&column("outcome", exponent), "");
                for quantity in FIGURES {
                    row = row.with(&column(quantity, exponent), f64::NAN);
                }
                continue;
            }
            let angle = 10_f64.powf(exponent);
            let steps = self.steps(angle);
            let seen = self.observations(&ensemble, angle, steps)?;
            let finer = self.observations(&ensemble, 0.5 * angle, 2 * steps)?;
            let order = (seen.median(OUTPUTS - 1) / finer.median(OUTPUTS - 1)).log2();
            let outcome = self.outcome(&seen, order);
            row = row.with(&column("outcome", exponent), outcome.name());
            let figures = [steps as f64, seen.median(OUTPUTS - 1), seen.invariants, order, seen.growth()];
            for (quantity, figure) in FIGURES.into_iter().zip(figures) {
                row = row.with(&column(quantity, exponent), to_six_digits(figure));
            }
        }
        Ok(row)
    }

    fn outcome(&self, seen: &Observations, order: f64) -> Outcome {
        /// How far an observed order may lie from the claim.
        const ORDER_TOLERANCE: f64 = 0.35;
        let claim = f64::from(self.method.properties().order_under(TorqueKind::Free));
        let error = seen.median(OUTPUTS - 1);
        if seen.flagged {
            Outcome::Flagged
        } else if !seen.finite {
            Outcome::NotANumber
        } else if seen.invariants > 1.0 {
            Outcome::Diverges
        } else if seen.flips_wrongly {
            Outcome::FlipsWrongly
        } else if error > 1.0 {
            Outcome::PhaseLost
        } else if (order - claim).abs() <= ORDER_TOLERANCE && error < 0.3 {
            Outcome::OrderKept
        } else if seen.invariants > 1e-3 {
            Outcome::Drifts
        } else if seen.growth() > 0.75 {
            Outcome::Linear
        } else {
            Outcome::RandomWalk
        }
    }

    /// Steps the bodies and compares them with the closed form.
    fn observations(&self, ensemble: &Ensemble, dt: f64, steps: u64) -> Result<Observations> {
        let (frames, batch) = prepare(ensemble, self.precision)?;
        let mut session = self.engine.start(batch, self.method)?;
        let motions: Vec<FreeMotion> = (0..BODIES).map(|body| FreeMotion::of_body(ensemble, body)).collect();
        let starts: Vec<BodyState> = motions.iter().map(|motion| motion.at(0.0)).collect();
        let mut seen =
            Observations { attitude: Vec::new(), invariants: 0.0, finite: true, flagged: false, flips_wrongly: false };
        let part = steps / OUTPUTS as u64;
        for output in 1..=OUTPUTS {
            session.advance_to(End::of_steps(dt, part), &mut unobserved)?;
            let words = session.read(0..BODIES)?;
            let time = dt * (part * output as u64) as f64;
            let mut errors = Vec::with_capacity(BODIES);
            for body in 0..BODIES {
                let state = frames[body].body_state(words.combined(body));
                let truth = motions[body].at(time);
                seen.flagged |= words.status[body] != Status::Valid;
                let finite = state.orientation.is_finite() && state.angular_velocity_body.is_finite();
                seen.finite &= finite;
                let error = attitude_error(&state, &truth);
                errors.push(if error.is_nan() { std::f64::consts::PI } else { error });
                // The middle axis of the triples is y.
                let (found, expected) = (state.angular_velocity_body.y, truth.angular_velocity_body.y);
                seen.flips_wrongly |= self.distance.is_some() && expected.abs() > 0.8 && found * expected < 0.0;
                if output == OUTPUTS && finite {
                    let start = &starts[body];
                    let energy = (state.kinetic_energy / start.kinetic_energy - 1.0).abs();
                    let momentum = (state.angular_momentum_world - start.angular_momentum_world).length()
                        / start.angular_momentum_world.length();
                    seen.invariants = seen.invariants.max(energy).max(momentum);
                }
            }
            seen.attitude.push(errors);
        }
        Ok(seen)
    }
}

/// The longest step of each method, as ω dt, up to which all outcomes are usable: for generic bodies of a ratio up to 100,
/// and next to the separatrix.
pub fn summary(rows: &[Row]) -> String {
    let mut text = String::from(
        "| method | precision | engine | usable up to omega dt, generic | near the separatrix |\n\
         | --- | --- | --- | --- | --- |\n",
    );
    for method in Method::ALL {
        for precision in Precision::ALL {
            for engine in ["cpu", "gpu"] {
                let of_case = |row: &&Row| {
                    row.text("method") == method.name()
                        && row.text("precision") == precision.name()
                        && row.text("case").starts_with(engine)
                        && row.number("ratio") <= 100.0
                };
                let rows: Vec<&Row> = rows.iter().filter(of_case).collect();
                if rows.is_empty() {
                    continue;
                }
                let usable = |generic: bool| {
                    let among = rows.iter().filter(|row| (row.text("place") == "generic") == generic);
                    among.map(|row| usable_angle(row)).fold(f64::INFINITY, f64::min)
                };
                let shown = |angle: f64| if angle > 0.0 { format!("{angle:.1e}") } else { "none".to_owned() };
                text += &format!(
                    "| {method} | {precision} | {engine} | {} | {} |\n",
                    shown(usable(true)),
                    shown(usable(false))
                );
            }
        }
    }
    text
}

/// The longest step of a row up to which every outcome is usable; 0 if none is.
pub fn usable_angle(row: &Row) -> f64 {
    exponents(row)
        .into_iter()
        .take_while(|exponent| {
            Outcome::from_name(&row.text(&column("outcome", *exponent))).is_some_and(Outcome::is_usable)
        })
        .last()
        .map_or(0.0, |exponent| 10_f64.powf(exponent))
}
