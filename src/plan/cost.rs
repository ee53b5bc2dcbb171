//! What a step costs and how accurate it is: the table that choices start from.
//!
//! A pilot (`pilot.rs`) replaces the coefficients by those of the scene at hand; the times serve only to rank the candidates. They were
//! measured on one processor; `polhode bench accuracy` measures those of the engine at hand, and a table can be made from its rows
//! (`Costs::measured`, feature `bench`).

use super::choice::Scheme;
use crate::engine::{Backend, Description, EngineKind, Link};
use crate::kernel::method::Method;
use crate::math::Precision;

pub(super) mod work;

/// One method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// The integrator, and whether its steps are equal.
    pub scheme: Scheme,
    /// No equal step turns a body further than this, rad: beyond it the error does not behave as the order says.
    pub longest_angle: f64,
    /// Of bodies without torques.
    pub free: Figures,
    /// Under a constant torque and linear drag.
    pub driven: Figures,
}

/// What was measured of one method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// c in the attitude error c θ^order α of a body that turns by α rad in equal steps of θ rad: twice the 99th percentile over
    /// the bodies. For adaptive steps, the error as a multiple of the tolerance.
    pub coefficient: f64,
    /// Time of a step, s, on one core with AVX-512, in `f32` and `f64`. For adaptive steps it includes rejected steps and waiting for
    /// bodies alongside; for Taylor series it is the time at [`SERIES_TOLERANCE`], from which the time at other tolerances follows.
    pub seconds: [f64; 2],
}

/// The tolerance for which [`COSTS`] states the times of Taylor series, whose order changes with it.
pub const SERIES_TOLERANCE: f64 = 1e-9;

/// The methods that a plan chooses among. Pilots try them in the order of the predicted times; where these are equal, the earlier row comes
/// first.
///
/// Measured with `RAYON_NUM_THREADS=1 cargo bench --bench costs`. Adaptive steps take 1.5 to 2.1 times as long as equal ones of the same
/// method here, and less where torques cost more, since step control then weighs less.
pub const COSTS: &[Cost] = &[
    Cost {
        scheme: Scheme::ADAPTIVE_RK8,
        longest_angle: f64::INFINITY,
        free: Figures { coefficient: 13.0, seconds: [4.0e-8, 6.7e-8] },
        driven: Figures { coefficient: 28.0, seconds: [4.7e-8, 8.1e-8] },
    },
    Cost {
        scheme: Scheme::TAYLOR,
        longest_angle: f64::INFINITY,
        free: Figures { coefficient: 14.0, seconds: [f64::INFINITY, 9.9e-8] },
        driven: Figures { coefficient: 20.0, seconds: [f64::INFINITY, 9.2e-8] },
    },
    Cost {
        scheme: Scheme::Equal(Method::Rk8),
        longest_angle: 3.5,
        free: Figures { coefficient: 6e-9, seconds: [2.2e-8, 4.4e-8] },
        driven: Figures { coefficient: 0.13, seconds: [2.2e-8, 4.3e-8] },
    },
    Cost {
        scheme: Scheme::Equal(Method::Rk4),
        longest_angle: 1.0,
        free: Figures { coefficient: 1.5e-3, seconds: [3.5e-9, 5.9e-9] },
        driven: Figures { coefficient: 16.0, seconds: [3.5e-9, 9.0e-9] },
    },
    Cost {
        scheme: Scheme::Equal(Method::Cf4),
        longest_angle: 1.0,
        free: Figures { coefficient: 7e-4, seconds: [5.4e-9, 1.1e-8] },
        driven: Figures { coefficient: 0.8, seconds: [5.5e-9, 1.2e-8] },
    },
    Cost {
        scheme: Scheme::Equal(Method::Splitting4),
        longest_angle: 0.5,
        free: Figures { coefficient: 4e-4, seconds: [6.2e-9, 1.7e-8] },
        driven: Figures { coefficient: 0.5, seconds: [8.3e-8, 1.8e-7] },
    },
    Cost {
        scheme: Scheme::Equal(Method::Splitting6),
        longest_angle: 0.5,
        free: Figures { coefficient: 6e-4, seconds: [6.2e-9, 1.7e-8] },
        driven: Figures { coefficient: 3.0, seconds: [1.4e-7, 2.9e-7] },
    },
];

/// Time, s on one core, to evaluate a torque-free motion at an output time, read it and bring it to the user's axes: by elliptic functions
/// in the given arithmetic or, without one, as a regular precession (`cargo bench --bench costs`).
pub fn evaluation_seconds(closed_form: Option<Precision>) -> f64 {
    match closed_form {
        None => 1.4e-7,
        Some(Precision::F32) => 8.1e-8,
        Some(Precision::F64) => 8.4e-8,
    }
}

/// The time in which a series that is kept is evaluated at an output, as a part of that of a step by series.
const EVALUATED: f64 = 0.2;

impl Cost {
    /// Time, s, to evaluate at an output the series of a step that goes beyond it.
    pub(super) fn output_seconds(&self) -> f64 {
        EVALUATED * self.step_seconds(Precision::F64, false)
    }

    /// The shipped row of a method with which pilots step references; the table has one for each of these.
    pub(super) fn shipped(scheme: Scheme) -> &'static Self {
        COSTS.iter().find(|cost| cost.scheme == scheme).unwrap_or(&COSTS[0])
    }

    /// Time of a step, s.
    pub fn step_seconds(&self, precision: Precision, free: bool) -> f64 {
        self.figures(free).seconds[usize::from(precision == Precision::F64)]
    }

    /// c of bodies that are free or driven.
    pub fn coefficient(&self, free: bool) -> f64 {
        self.figures(free).coefficient
    }

    fn figures(&self, free: bool) -> &Figures {
        if free { &self.free } else { &self.driven }
    }
}

/// The table by which a plan ranks candidates and predicts times.
///
/// ```
/// use polhode::Method;
/// use polhode::plan::Scheme;
/// use polhode::plan::cost::Costs;
///
/// assert!(Costs::shipped().of(Scheme::Equal(Method::Rk8)).is_some());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Costs {
    pub(crate) rows: Vec<Cost>,
    /// How many steps, each as long as a row says, the engine takes at the same time; `None` where the rows are those of another engine.
    pub(crate) at_a_time: Option<f64>,
    /// The way to the device on which work in `f32` and `f64` runs; `None` for work on the host, or where the way is not known.
    pub(crate) links: [Option<Link>; 2],
}

/// How often a run waits for a device until the next output, at least: for the steps of all bodies; in adaptive steps also to learn how many
/// bodies are still under way.
fn waits(scheme: Scheme) -> f64 {
    if scheme.is_adaptive() { 2.0 } else { 1.0 }
}

impl Costs {
    /// [`COSTS`], whose times are of a core of the CPU engine.
    pub fn shipped() -> Self {
        Self { rows: COSTS.to_vec(), at_a_time: None, links: [None; 2] }
    }

    /// The methods that may be chosen.
    pub fn rows(&self) -> &[Cost] {
        &self.rows
    }

    /// The row of a method, where the table has one.
    pub fn of(&self, scheme: Scheme) -> Option<&Cost> {
        self.rows.iter().find(|cost| cost.scheme == scheme)
    }

    /// The time, s, for which a run through so many output times waits for the device, at least.
    pub(super) fn waiting(&self, scheme: Scheme, precision: Precision, outputs: f64) -> f64 {
        self.link(scheme, precision).map_or(0.0, |link| outputs * waits(scheme) * link.wait)
    }

    /// The way to the device that takes such steps.
    pub(super) fn link(&self, scheme: Scheme, precision: Precision) -> Option<Link> {
        // Series are formed on the host.
        self.links[usize::from(precision == Precision::F64)].filter(|_| scheme != Scheme::TAYLOR)
    }

    /// The table with the engine's own times: if it is the shipped table, and the engine is not the CPU's and knows how fast it is.
    pub(super) fn on(&self, engine: &dyn Backend) -> Self {
        if engine.description().kind == EngineKind::Cpu {
            return self.clone();
        }
        let link = engine.link();
        let links = Precision::ALL.map(|precision| link.filter(|_| engine.runs_shaders(precision)));
        let speeds = Precision::ALL.map(|precision| engine.speed(precision));
        if self.at_a_time.is_some() || speeds == [None, None] {
            return Self { links, ..self.clone() };
        }
        let [narrow, wide] = speeds.map(|speed| speed.unwrap_or(0.0));
        let rows = self.rows.iter().map(|&cost| {
            let wide = if cost.scheme == Scheme::TAYLOR { engine.speed_of_series().unwrap_or(0.0) } else { wide };
            let of = |figures: Figures| {
                let [in_f32, in_f64] = figures.seconds;
                Figures { seconds: [in_f32 / narrow, in_f64 / wide], ..figures }
            };
            Cost { free: of(cost.free), driven: of(cost.driven), ..cost }
        });
        Self { rows: rows.collect(), at_a_time: Some(1.0), links }
    }

    /// Steps that an engine takes at the same time.
    pub(super) fn at_a_time(&self, engine: &Description) -> Option<f64> {
        let cores = || (engine.kind == EngineKind::Cpu).then(|| rayon::current_num_threads() as f64);
        self.at_a_time.or_else(cores)
    }
}
