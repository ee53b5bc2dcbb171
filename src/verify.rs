//! Two engines stepped side by side.
//!
//! A kernel is written twice, in WGSL and in Rust, and a mirror shares its original's mistakes, so three sessions are
//! compared after every step: the engine under test, its scalar twin (the same arithmetic, one body at a time), and
//! the scalar `f64` reference.

use crate::batch::{Precision, STATE_COMPONENTS, StateWords, prepare};
use crate::engine::cpu::{Cpu, Width};
use crate::engine::{Backend, Session, unobserved};
use crate::ensemble::Ensemble;
use crate::error::Result;
use crate::method::Method;

/// What is compared: the vectors of the state, each with its name and its components.
pub const COLUMNS: [(&str, std::ops::Range<usize>); 2] =
    [("orientation", 0..4), ("angular_momentum_principal", 4..STATE_COMPONENTS)];

/// The bound on a difference after `steps` steps in which bodies have turned by `angle` rad, in ulps of the vector's
/// largest component.
///
/// Two correct kernels part by roundings alone; compilers re-associate, so not even an adapter that does not fuse agrees
/// with its twin to the bit. In `f32` the state is compensated: what a step loses is a few ulps of its increment, ω dt
/// ulps of the state, at worst 4 ω t over the way. In `f64` each step rounds the state itself, a random walk of which
/// 8 √n are at least four standard deviations. A difference in angular momentum is one in rate, from which the attitude
/// runs away in proportion to the angle turned. Bodies next to the separatrix part faster: verify them over less than
/// a flip.
pub fn bound_ulps(precision: Precision, steps: u64, angle: f64) -> f64 {
    let own = match precision {
        Precision::F32 => 4.0 * angle,
        Precision::F64 => 8.0 * (steps as f64).sqrt() * (1.0 + angle),
    };
    4.0 + own + angle * angle
}

/// The largest difference seen in one column.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Difference {
    /// In ulps of the vector's largest component, in the precision under test; infinite if one side is not finite.
    pub ulps: f64,
    /// The same as a number, in scaled units.
    pub absolute: f64,
    /// The body.
    pub body: usize,
    /// The step, from 1.
    pub step: u64,
}

/// Where two sides part by more than the bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parting {
    /// The first step, from 1.
    pub step: u64,
    /// The first body at that step.
    pub body: usize,
    /// The column.
    pub column: &'static str,
    /// The difference, in ulps of the vector's largest component.
    pub ulps: f64,
    /// The bound that it exceeds.
    pub bound: f64,
}

/// Two sides and how far apart they were.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// What is compared with what.
    pub sides: [String; 2],
    /// The largest difference by column, in the order of [`COLUMNS`].
    pub largest: [Difference; 2],
    /// The first step and body beyond the bound.
    pub parting: Option<Parting>,
}

/// What [`verify`] found.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Number of bodies.
    pub bodies: usize,
    /// Number of steps.
    pub steps: u64,
    /// Step size, s.
    pub dt: f64,
    /// The integrator.
    pub method: Method,
    /// The arithmetic of the engine under test.
    pub precision: Precision,
    /// Engine and twin, engine and reference, twin and reference.
    pub comparisons: Vec<Comparison>,
}

impl Report {
    /// Whether no two sides ever parted by more than the bound.
    pub fn agrees(&self) -> bool {
        self.comparisons.iter().all(|comparison| comparison.parting.is_none())
    }
}

/// Steps `ensemble` on `engine`, on its scalar twin and on the `f64` reference, and compares after every step.
///
/// # Errors
///
/// What the engines return; a difference is no error but stands in the report.
pub fn verify(
    engine: &dyn Backend,
    ensemble: &Ensemble,
    method: Method,
    precision: Precision,
    dt: f64,
    steps: u64,
) -> Result<Report> {
    let scalar = Cpu::new(Width::Scalar);
    let names = [
        format!("{} {precision}", engine.description().name),
        format!("scalar twin {precision}"),
        "scalar reference f64".to_owned(),
    ];
    let mut tested = engine.start(prepare(ensemble, precision)?.1, method)?;
    let mut twin = scalar.start(prepare(ensemble, precision)?.1, method)?;
    let mut reference = scalar.start(prepare(ensemble, Precision::F64)?.1, method)?;

    let fastest = ensemble.angular_velocity_body().iter().map(|w| w.length()).fold(0.0, f64::max);
    let pairs = [(0, 1), (0, 2), (1, 2)];
    let mut comparisons: Vec<Comparison> = pairs
        .iter()
        .map(|&(a, b)| Comparison {
            sides: [names[a].clone(), names[b].clone()],
            largest: [Difference::default(); 2],
            parting: None,
        })
        .collect();
    for step in 1..=steps {
        let states = [advanced(tested.as_mut(), dt)?, advanced(twin.as_mut(), dt)?, advanced(reference.as_mut(), dt)?];
        let bound = bound_ulps(precision, step, fastest * dt * step as f64);
        for (comparison, &(a, b)) in comparisons.iter_mut().zip(&pairs) {
            compare(&states[a], &states[b], precision, step, bound, comparison);
        }
    }
    Ok(Report { bodies: ensemble.len(), steps, dt, method, precision, comparisons })
}

/// One step, and the state after it.
fn advanced(session: &mut dyn Session, dt: f64) -> Result<StateWords> {
    session.advance(dt, 1, &mut unobserved)?;
    session.read(0..session.body_count())
}

/// Enters the differences of one step into `comparison`.
fn compare(a: &StateWords, b: &StateWords, precision: Precision, step: u64, bound: f64, comparison: &mut Comparison) {
    for body in 0..a.len() {
        let (x, y) = (a.combined(body), b.combined(body));
        for (index, (column, components)) in COLUMNS.into_iter().enumerate() {
            let difference = vector_difference(&x[components.clone()], &y[components], precision);
            let largest = &mut comparison.largest[index];
            if difference.ulps > largest.ulps {
                *largest = Difference { body, step, ..difference };
            }
            if difference.ulps > bound && comparison.parting.is_none() {
                comparison.parting = Some(Parting { step, body, column, ulps: difference.ulps, bound });
            }
        }
    }
}

/// The largest difference of two vectors' components, in ulps of the largest component of either.
///
/// A component that is not finite on either side is infinitely far off, also from itself.
fn vector_difference(a: &[f64], b: &[f64], precision: Precision) -> Difference {
    if a.iter().chain(b).any(|x| !x.is_finite()) {
        return Difference { ulps: f64::INFINITY, absolute: f64::INFINITY, body: 0, step: 0 };
    }
    let absolute = a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
    let largest = a.iter().chain(b).fold(0.0_f64, |largest, x| largest.max(x.abs()));
    let ulp = ulp_of(largest, precision);
    Difference { ulps: if absolute == 0.0 { 0.0 } else { absolute / ulp }, absolute, body: 0, step: 0 }
}

/// The distance from x > 0 to the next number of the precision.
fn ulp_of(x: f64, precision: Precision) -> f64 {
    match precision {
        Precision::F32 => {
            let x = x as f32;
            f64::from(x.next_up()) - f64::from(x)
        }
        Precision::F64 => x.next_up() - x,
    }
}
