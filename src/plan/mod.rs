//! What will run: a scene resolved for an engine.

use crate::batch::Precision;
use crate::engine::Backend;
use crate::error::{Error, Result};
use crate::method::Method;
use crate::scene::{Outputs, Scene, Stepping};

/// More output times than this are refused: nobody reads them, and the list alone would take 80 MB.
pub const MOST_OUTPUTS: usize = 10_000_000;

/// A scene resolved for an engine: the integrator, its arithmetic, its step and the output times.
#[derive(Clone, Debug)]
pub struct Plan<'a> {
    scene: &'a Scene,
    method: Method,
    precision: Precision,
    longest_step: f64,
    closed_form: bool,
    times: Vec<f64>,
}

/// Steps of equal size from one output time to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Number of steps.
    pub steps: u64,
    /// Size of each, s.
    pub dt: f64,
}

impl<'a> Plan<'a> {
    /// Resolves `scene` for `engine`.
    ///
    /// Free bodies are brought to their output times in closed form ([`crate::free_motion`]), unless the step is pinned
    /// or the scene says not to skip; in `f32` where the error asked for is above [`CLOSED_FORM_F32`].
    ///
    /// Stepping meets an attitude error that is asked for by `rk4`: its error over a span t of a body that spins at ω grows
    /// as 1e-3 (ω dt)⁴ ω t (measured on the free ensemble of `benches/`, 99th percentile, with a margin of two), from which
    /// dt follows for the fastest body. `f32` is taken where its own floor, 1e-6 rad and 3e-8 of the angle turned, is
    /// below the error asked for, and `f64` elsewhere.
    ///
    /// # Errors
    ///
    /// [`Error::Setting`] for a span, step, output time or accuracy out of range; [`Error::PrecisionUnavailable`]
    /// where the engine lacks the precision pinned or needed; [`Error::MissingMass`] where a force acts on bodies
    /// without mass; [`Error::Torque`] and [`Error::ColumnLength`] for a torque's parameters.
    pub fn new(scene: &'a Scene, engine: &dyn Backend) -> Result<Self> {
        let times = output_times(scene)?;
        for (index, torque) in scene.torques().iter().enumerate() {
            torque.validate(index, scene.ensemble().len())?;
        }
        let force = scene.constant_force_world();
        if !force.is_finite() {
            let value = force.to_array().into_iter().find(|x| !x.is_finite()).unwrap_or(f64::NAN);
            return Err(Error::Setting { field: "force", value, expected: "finite components are needed (N)" });
        }
        if force != glam::DVec3::ZERO && scene.ensemble().translation().is_none() {
            return Err(Error::MissingMass);
        }
        let closed_form =
            scene.may_skip() && scene.torques().is_empty() && matches!(scene.stepping(), Stepping::Accuracy(_));
        let (method, precision, longest_step) = match scene.stepping() {
            Stepping::Pinned { method, dt, .. } => {
                let precision = scene.wanted_precision().unwrap_or(widest(engine));
                crate::engine::check_step(dt, precision)?;
                (method, precision, dt)
            }
            Stepping::Accuracy(accuracy) => {
                let target = accuracy.attitude;
                if !(target > 0.0 && target <= std::f64::consts::PI) {
                    return Err(Error::Setting {
                        field: "accuracy.attitude",
                        value: target,
                        expected: "an angle above 0 and up to pi is needed (rad)",
                    });
                }
                let rate = fastest_rate(scene);
                let angle = rate * scene.end();
                let floor_f32 = if closed_form { CLOSED_FORM_F32 } else { 1e-6 + 3e-8 * angle };
                let narrowest = if target >= floor_f32 { Precision::F32 } else { Precision::F64 };
                let precision = scene.wanted_precision().unwrap_or(narrowest);
                if precision == Precision::F32 && narrowest == Precision::F64 {
                    return Err(Error::Setting {
                        field: "accuracy.attitude",
                        value: target,
                        expected: "f32 does not reach this: precision f64, or more than 1e-6 rad and 3e-8 of the angle turned, is needed (rad)",
                    });
                }
                let dt =
                    if angle > 0.0 { (target / (1e-3 * angle)).sqrt().sqrt().min(0.5) / rate } else { scene.end() };
                (Method::Rk4, precision, dt.min(scene.end()).max(f64::MIN_POSITIVE))
            }
        };
        if !engine.precisions().contains(&precision) {
            return Err(Error::PrecisionUnavailable { adapter: engine.description().name, precision });
        }
        let plan = Self { scene, method, precision, longest_step, closed_form, times };
        plan.check_steps()?;
        Ok(plan)
    }

    /// The scene.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// Whether bodies are brought to their output times in closed form, so that no step is taken.
    pub fn is_closed_form(&self) -> bool {
        self.closed_form
    }

    /// The integrator; that of the long way where the plan is in closed form.
    pub fn method(&self) -> Method {
        self.method
    }

    /// The arithmetic.
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// The longest step, s; steps are shortened so that output times are hit exactly.
    pub fn longest_step(&self) -> f64 {
        self.longest_step
    }

    /// Output times, s, increasing; the last one is the end.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The steps that lead to output `index` from the one before (from 0 for the first).
    pub fn interval(&self, index: usize) -> Interval {
        let start = if index == 0 { 0.0 } else { self.times[index - 1] };
        steps_over(self.times[index] - start, self.longest_step)
    }

    /// Steps of each body over the whole span; none in closed form.
    pub fn steps(&self) -> u64 {
        if self.closed_form {
            return 0;
        }
        (0..self.times.len()).map(|index| self.interval(index).steps).fold(0, u64::saturating_add)
    }

    /// A number of steps that no machine finishes is a mistake in the input.
    fn check_steps(&self) -> Result<()> {
        if self.steps() > MOST_STEPS {
            return Err(Error::Setting {
                field: "dt",
                value: self.longest_step,
                expected: "more than 1e15 steps would be needed: a longer step or a shorter span is needed (s)",
            });
        }
        Ok(())
    }
}

/// The attitude error of the closed form in `f32`, rad, at any time (`tests/golden_free_motion.rs`).
pub const CLOSED_FORM_F32: f64 = 1e-6;

/// The most steps a body may need.
const MOST_STEPS: u64 = 1_000_000_000_000_000;

/// `f64` where the engine has it.
fn widest(engine: &dyn Backend) -> Precision {
    if engine.precisions().contains(&Precision::F64) { Precision::F64 } else { Precision::F32 }
}

/// The largest |ω| of the scene, rad/s.
fn fastest_rate(scene: &Scene) -> f64 {
    scene.ensemble().angular_velocity_body().iter().map(|w| w.length()).fold(0.0, f64::max)
}

/// The fewest equal steps of at most `longest` that make up `span`; a step count within 1e-9 of a whole number is
/// taken as that number, so that 10 s in steps of 0.1 s are 100 steps although 0.1 is not a machine number.
fn steps_over(span: f64, longest: f64) -> Interval {
    if span <= 0.0 {
        return Interval { steps: 0, dt: longest };
    }
    let ratio = span / longest;
    let nearest = ratio.round();
    let steps = if (ratio - nearest).abs() <= 1e-9 * nearest { nearest } else { ratio.ceil() }.max(1.0);
    Interval { steps: steps as u64, dt: span / steps }
}

/// The output times of a scene, checked.
fn output_times(scene: &Scene) -> Result<Vec<f64>> {
    let end = scene.end();
    if !(end.is_finite() && end >= 0.0) {
        return Err(Error::Setting {
            field: "time.end",
            value: end,
            expected: "a finite time that is not negative is needed (s)",
        });
    }
    match scene.output_times() {
        Outputs::End => Ok(vec![end]),
        Outputs::Every(interval) => {
            if !(interval.is_finite() && *interval > 0.0) {
                return Err(Error::Setting {
                    field: "time.outputs.every",
                    value: *interval,
                    expected: "a finite interval above zero is needed (s)",
                });
            }
            let count = end / interval;
            if count > MOST_OUTPUTS as f64 {
                return Err(Error::Setting {
                    field: "time.outputs.every",
                    value: *interval,
                    expected: "more than 1e7 outputs would follow: a longer interval is needed (s)",
                });
            }
            let whole = steps_over(end, *interval).steps as usize;
            let mut times: Vec<f64> =
                (1..=whole).map(|n| n as f64 * interval).take_while(|&t| t < end * (1.0 - 1e-12)).collect();
            times.push(end);
            Ok(times)
        }
        Outputs::Times(list) => {
            let mut times = Vec::with_capacity(list.len() + 1);
            let mut last = -1.0;
            for &time in list {
                if !(time.is_finite() && time >= 0.0 && time <= end) {
                    return Err(Error::Setting {
                        field: "time.outputs.times",
                        value: time,
                        expected: "times from 0 to the end are needed (s)",
                    });
                }
                if time <= last {
                    return Err(Error::Setting {
                        field: "time.outputs.times",
                        value: time,
                        expected: "increasing times are needed (s)",
                    });
                }
                last = time;
                times.push(time);
            }
            if last != end {
                times.push(end);
            }
            Ok(times)
        }
    }
}
