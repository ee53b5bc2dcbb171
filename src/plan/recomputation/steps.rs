//! The steps in which bodies of a run are followed again: as much finer than its own that their errors are far below its errors.

use crate::bodies::Ensemble;
use crate::bodies::inertia::principal_axes;
use crate::kernel::method::Method;
use crate::kernel::method::rk8_adaptive::least_tolerance;
use crate::kernel::method::taylor::LEAST_OF_SERIES;
use crate::math::Precision;
use crate::plan::choice::Scheme;
use crate::plan::cost::work::Work;
use crate::plan::group::Treatment;
use crate::scene::{AdaptiveSteps, Scene, Stepping};
use crate::torque::{self, Torque};

/// The tolerance of the strictest steps of `rk8` by which bodies are recomputed; below it rounding adds more than it takes away.
const STRICTEST: f64 = 1e-13;

/// Where an error is asked for, and a run is not by series, the tolerances of series and of `rk8` that recompute it, as parts of the error;
/// and the greatest: with a greater one, steps may leap over what changes fast.
const OF_TARGET: (f64, f64) = (1e-7, 1e-10);
const OF_TARGET_RK8: (f64, f64) = (1e-6, 1e-9);

/// A method of this order or more is compared with `rk8` in finer steps; one of a lower order in its own steps, in which the error of `rk8`
/// is far smaller.
const HIGH_ORDER: u32 = 6;

/// The greatest tolerance of a recomputation: with a greater one, steps may leap over what changes fast.
const GREATEST_TOLERANCE: f64 = 1e-7;

/// A tolerance must be less than the run's by this factor to say anything of the run's error.
const LEAST_REFINEMENT: f64 = 8.0;

/// Adaptive steps of a method in `f64` at a part of the run's tolerance, or at the least there is, so that their error is far below the run's.
/// Taylor series err less at the same tolerance (for heavy tops over ten turns, by a factor of 200), and keep to it even where torques
/// change much faster than bodies turn, where `rk8` leaps over whole periods.
pub(crate) fn finer(method: Method, steps: &AdaptiveSteps) -> AdaptiveSteps {
    let (part, least, greatest) = match method {
        Method::Taylor => (1e-3, LEAST_OF_SERIES, 1e-10),
        _ => (1e-2, least_tolerance(Precision::F64), GREATEST_TOLERANCE),
    };
    let tolerance = (part * steps.tolerance).clamp(least, greatest);
    AdaptiveSteps { tolerance, least_step: None }
}

/// The steps of `method` in which bodies are followed again that a run in adaptive `steps` has followed under sampled torques or with their centres
/// of mass: as fine as series would be, as far as the method's go.
pub(super) fn finer_by(method: Method, steps: &AdaptiveSteps) -> AdaptiveSteps {
    let AdaptiveSteps { tolerance, least_step } = finer(Method::Taylor, steps);
    let least = if method == Method::Taylor { LEAST_OF_SERIES } else { least_tolerance(Precision::F64) };
    AdaptiveSteps { tolerance: tolerance.max(least), least_step }
}

/// Whether bodies that a run in adaptive `steps` of a method has followed are followed again in finer ones.
pub(crate) fn has_finer(torques: &[Torque], ensemble: &Ensemble, (method, steps): (Method, &AdaptiveSteps)) -> bool {
    is_finer(&finer_by(recomputing_method(torques, ensemble, Some(method)), steps), steps)
}

/// The method that follows bodies again in adaptive steps: Taylor series. Under sampled torques every step ends at a sample, at any tolerance, so
/// that finer series would reproduce a run by series; such a run is recomputed by `rk8`, unless formulas decide between cases
/// ([`is_piecewise`]) or centres of mass are part of the motion.
pub(super) fn recomputing_method(torques: &[Torque], ensemble: &Ensemble, of_run: Option<Method>) -> Method {
    let is_smooth = || !torques.iter().any(Torque::is_coupled) && !is_piecewise(torques, ensemble);
    let ends_at_samples = of_run == Some(Method::Taylor) && torques.iter().any(Torque::is_sampled);
    if ends_at_samples && is_smooth() { Method::Rk8 } else { Method::Taylor }
}

/// Whether formulas decide between cases, so that torques have kinks or jumps. Series end their steps there; `rk8` takes tiny steps or, without
/// an error estimate, loses its order.
pub(crate) fn is_piecewise(torques: &[Torque], ensemble: &Ensemble) -> bool {
    let is_another = |torque: &Torque| torque.is_random() || torque.is_coupled();
    !torques.iter().any(is_another) && Work::of(torques, ensemble).is_piecewise()
}

/// Whether bodies are recomputed by Taylor series, whatever steps the run takes, and the work of torques on some of them is integrated apart:
/// under torques that are neither random nor sampled, and do not act on centres of mass.
pub(crate) fn follows_by_series(torques: &[Torque]) -> bool {
    !torques.iter().any(|torque| torque.is_random() || torque.is_sampled() || torque.is_coupled())
}

/// How many times e a motion may be damped while series follow it in place of the run's own kind of steps: what is left beyond that is below
/// their tolerance, and stiff motion takes short steps by any method.
const MOST_DAMPED: f64 = 30.0;

/// Whether torques brake a body of a run by other steps so much that these steps follow it again, and not series.
pub(crate) fn is_damped(scene: &Scene, torques: &[Torque], body: usize, treatment: &Treatment) -> bool {
    let damping = || {
        let middle_moment = principal_axes(&scene.ensemble().inertia()[body]).moments.y;
        torque::damping_of(torques, body, middle_moment)
    };
    treatment.method() != Some(Method::Taylor) && damping() * scene.end() > MOST_DAMPED
}

/// The steps of series that recompute bodies of a run, and those of `rk8` beside them.
pub(crate) fn steps_of_series(scene: &Scene, treatment: &Treatment) -> (AdaptiveSteps, AdaptiveSteps) {
    if let Treatment::Adaptive { method: Method::Taylor, steps, .. } = treatment {
        let fine = finer(Method::Taylor, steps);
        return (fine, fine);
    }
    let target = match scene.stepping() {
        // Events and statistics have errors of their own.
        Stepping::Accuracy(accuracy) if !scene.observes() => accuracy.strictest(),
        _ => 0.0,
    };
    // A run that amplifies errors may take far finer steps than the target says.
    let of_run = |method: Method| match treatment {
        Treatment::Adaptive { steps, .. } => finer(method, steps).tolerance,
        _ => f64::INFINITY,
    };
    let steps = |method: Method, least: f64, (part, greatest): (f64, f64)| {
        let tolerance = (part * target).min(of_run(method)).clamp(least, greatest);
        AdaptiveSteps { tolerance, least_step: None }
    };
    let least = least_tolerance(Precision::F64);
    (steps(Method::Taylor, least, OF_TARGET), steps(Method::Rk8, STRICTEST, OF_TARGET_RK8))
}

/// Whether the finer steps are fine enough to compare with: near the least tolerance there are none.
pub(super) fn is_finer(fine: &AdaptiveSteps, steps: &AdaptiveSteps) -> bool {
    LEAST_REFINEMENT * fine.tolerance <= steps.tolerance
}

/// The factor by which the steps of `rk8` are first made shorter than the run's equal ones, before each body's own rate is considered.
pub(crate) fn shorter_by(method: Method) -> f64 {
    if method.order() >= HIGH_ORDER { 2.0 } else { 1.0 }
}

/// Attempts of adaptive `rk8` at tolerance `fine` for each attempt of `method` at `tolerance`.
pub(super) fn attempts_for_one(method: Method, tolerance: f64, fine: f64) -> f64 {
    let angle = |scheme, tolerance| Scheme::angle_of_attempt(scheme, tolerance);
    angle(Scheme::Adaptive(method), tolerance) / angle(Scheme::ADAPTIVE_RK8, fine)
}
