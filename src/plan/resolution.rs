//! The few numbers that were chosen, from which a plan's groups follow, however many bodies there are.

use std::ops::Range;

use super::choice::{
    CLOSED_FORM_F32, CLOSED_FORM_F64, Classification, Rule, SKIP_SHARE, classify, floor_f32, least_target,
    skip_tolerance,
};
use super::class::{Bound, Shape};
use super::cost::work::Work;
use super::cost::{COSTS, Costs};
use super::coupled;
use super::driven::{ActingTorques, TorqueSet};
use super::grouping::stepped_bodies;
use super::pilot::{Found, HEAVIER, PROBED_STEPS, Pilot};
use super::reference::SATURATED;
use super::sampling::left_out;
use super::statistical::{StatisticError, worst_times};
use super::statistical_pilot;
use super::time_limit::TimeLimit;
use super::times::Times;
use crate::engine::Backend;
use crate::engine::checks::{NOISE_REFUSED, TAYLOR_IN_F64, TAYLOR_ON_CPU, check_equal_steps, taylor_unavailable};
use crate::error::{Error, Result};
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::math::parallel;
use crate::plan::{CLOSED_FORM, Scheme};
use crate::scene::AdaptiveSteps;
use crate::scene::{Accuracy, Scene, StatisticalAccuracy, Stepping, Target};
use crate::torque::force::Force;
use crate::torque::{Torque, Value};

/// Everything from which, with the scene, a plan's groups follow, to the bit.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "study", serde(rename_all = "snake_case", deny_unknown_fields))]
pub enum Resolution {
    /// Method and step were given.
    Pinned {
        /// The integrator.
        method: Method,
        /// The arithmetic.
        precision: Precision,
        /// The longest step, s.
        longest_step: f64,
        /// Whether states are projected after each step onto what torque-free bodies conserve.
        projected: bool,
    },
    /// Each body chooses its steps.
    Adaptive {
        /// The integrator, one of [`Method::ADAPTIVE`].
        method: Method,
        /// The arithmetic.
        precision: Precision,
        /// What is asked of the steps.
        #[cfg_attr(feature = "study", serde(flatten))]
        steps: AdaptiveSteps,
    },
    /// An error was asked for, of states or of statistics.
    Accuracy {
        /// What a simpler class may cost a body.
        tolerance: Bound,
        /// The arithmetic of the closed form.
        closed_form: Precision,
        /// The rate, rad/s, by which all bodies are stepped alike, if nothing is to be left out.
        uniform_rate: Option<f64>,
        /// How bodies are stepped, by the torques that act on them.
        stepped: Vec<Stepped>,
        /// The measured error of the integration in each statistic, if the plan depends on errors of statistics.
        #[cfg_attr(feature = "study", serde(default, skip_serializing_if = "Vec::is_empty"))]
        statistics: Vec<StatisticError>,
    },
}

/// How the bodies are stepped on which some torques act.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "study",
    serde(into = "super::document::SteppedEntry", try_from = "super::document::SteppedEntry")
)]
pub struct Stepped {
    /// The torques.
    pub torques: TorqueSet,
    /// The rule, and what is known of its error.
    pub found: Found,
}

/// The least spread of a quantity, as a part of it, where errors are stated as parts of the spread.
const LEAST_RELATIVE: f64 = 1e-6;

/// The remedy where `f32` is not precise enough.
const F32_MISSES: &str = "use precision f64, or an error above 1e-6 plus 3e-8 of the angle turned (rad)";

/// No steps in `f64` are better than some units in the last place of the quaternion, rad.
const ROUNDING_F64: f64 = 1e-15;

/// The remedy for an engine without `f64`.
const F64_ELSEWHERE: &str = "use an adapter with f64 or the CPU engine, or a larger error";

impl Resolution {
    /// Resolves `scene` for `engine`; `times` are those at which its steps end.
    pub(super) fn new(
        scene: &Scene,
        engine: &dyn Backend,
        times: &Times,
        (costs, limit): (&Costs, &TimeLimit),
    ) -> Result<Self> {
        coupled::check(scene, engine)?;
        let has_f64 = engine.precisions().contains(&Precision::F64);
        match scene.stepping() {
            Stepping::Pinned { method, dt, projected, .. } => {
                check_equal_steps(method)?;
                let widest = if has_f64 { Precision::F64 } else { Precision::F32 };
                let precision = scene.wanted_precision().unwrap_or(widest);
                crate::engine::checks::check_step(dt, precision)?;
                if method.properties().rigid_only
                    && let Some(torque) = scene.torques().iter().position(|torque| !torque.leaves_rigid())
                {
                    return Err(Error::RigidOnly { torque, model: scene.torques()[torque].owned_name(), method });
                }
                if projected {
                    crate::engine::projected::check(precision, scene.torques().is_empty(), method)?;
                }
                if !engine.precisions().contains(&precision) {
                    return Err(Error::PrecisionUnavailable { adapter: engine.description().name, precision });
                }
                Ok(Self::Pinned { method, precision, longest_step: dt, projected })
            }
            Stepping::Adaptive { method, steps, .. } => Self::adaptive(scene, engine, method, steps, has_f64),
            Stepping::Accuracy(accuracy) => {
                check_accuracy(&accuracy)?;
                let wanted = scene.wanted_precision();
                let attitude = accuracy.strictest();
                let narrow =
                    wanted == Some(Precision::F32) || (wanted.is_none() && attitude >= least_target(CLOSED_FORM_F32));
                let mut resolution = Self::without_rules(scene, skip_tolerance(&accuracy), narrow);
                check_f64(scene, &accuracy)?;
                // Before the pilot, which would look for a step that does not exist.
                if wanted == Some(Precision::F32) || !has_f64 {
                    resolution.check_f32(scene, &accuracy, wanted)?;
                }
                let precision = if has_f64 { wanted } else { Some(Precision::F32) };
                let has_series = engine.speed_of_series().is_some();
                resolution.choose_steps(
                    scene,
                    (&accuracy, None),
                    precision,
                    has_f64,
                    (has_series, times, costs),
                    limit,
                )?;
                Ok(resolution)
            }
            Stepping::Statistics(wanted) => {
                Self::statistical(scene, &wanted, has_f64, (engine.speed_of_series().is_some(), times, costs), limit)
            }
        }
    }

    /// Resolves a scene for which only errors of statistics are asked.
    fn statistical(
        scene: &Scene,
        wanted: &StatisticalAccuracy,
        has_f64: bool,
        known: (bool, &Times, &Costs),
        limit: &TimeLimit,
    ) -> Result<Self> {
        let precision = scene.wanted_precision();
        let narrow = match precision {
            Some(precision) => precision == Precision::F32,
            None => statistical_pilot::allows_narrow(scene, wanted)?,
        };
        // A spread as small as 1e-6 of a quantity still counts; where `f32` is enough it is far greater.
        let state = if narrow { LEAST_RELATIVE } else { LEAST_RELATIVE * wanted.strictest().min(1.0) };
        let share = SKIP_SHARE * state;
        let tolerance = Bound { attitude: share, angular_velocity: share, energy: share };
        let mut resolution = Self::without_rules(scene, tolerance, narrow);
        let precision = if has_f64 { precision } else { Some(Precision::F32) };
        let accuracy = Accuracy::attitude(wanted.strictest().min(1.0));
        resolution.choose_steps(scene, (&accuracy, Some(wanted)), precision, has_f64, known, limit)?;
        Ok(resolution)
    }

    /// Resolves a scene for which an error is asked, without the rules by which bodies are stepped; `tolerance` is the error that a simpler
    /// class may cause where anything may be left out.
    fn without_rules(scene: &Scene, tolerance: Bound, narrow: bool) -> Self {
        // No bound is within a negative tolerance.
        let tolerance = if scene.may_skip() { tolerance } else { Bound { attitude: -1.0, ..Bound::NONE } };
        Self::Accuracy {
            tolerance,
            closed_form: if narrow { Precision::F32 } else { Precision::F64 },
            uniform_rate: (!scene.may_skip()).then(|| fastest_rate(scene, &tolerance)),
            stepped: Vec::new(),
            statistics: Vec::new(),
        }
    }

    /// Finds a rule for each set of torques.
    fn choose_steps(
        &mut self,
        scene: &Scene,
        (accuracy, statistical): (&Accuracy, Option<&StatisticalAccuracy>),
        precision: Option<Precision>,
        has_f64: bool,
        (has_series, times, costs): (bool, &Times, &Costs),
        limit: &TimeLimit,
    ) -> Result<()> {
        let Self::Accuracy { tolerance, uniform_rate, stepped, statistics, .. } = self else { return Ok(()) };
        let classes = stepped_bodies(scene);
        let all_acting = ActingTorques::of(scene.torques());
        let mut left = classes.len();
        for (torques, bodies) in classes {
            let acting = torques.of(scene.torques());
            let flies = scene.has_pilot() && scene.end() > 0.0;
            let classification =
                |body: u32| at_rate(classify((scene, &all_acting), body as usize, tolerance), *uniform_rate);
            let (all, span) = (bodies.len(), scene.end());
            let work = Work::of(&acting, scene.ensemble());
            let pilot = Pilot {
                scene,
                accuracy,
                costs,
                times,
                torques: &acting,
                set: torques,
                work: &work,
                precision,
                forms_series: has_series,
                all,
                bodies: Vec::new(),
                typical: 1.0,
                fastest: f64::INFINITY,
                span,
                growth: None,
                most_steps: f64::INFINITY,
                most_of_body: PROBED_STEPS,
                slowing: 1.0,
                is_cut: false,
                is_brief: statistical.is_some(),
                has_more: false,
                difficulty: 1.0,
                tail: HEAVIER,
                survey: None,
                limit,
                later: 0.0,
            };
            // The other classes are assumed to cost as much.
            left -= 1;
            let most = pilot.most_ahead() * if statistical.is_some() { statistical_pilot::PILOTS } else { 1.0 };
            let pilot = Pilot { later: left as f64 * most, ..pilot };
            limit.expect(most + pilot.later);
            if let Some(wanted) = statistical.filter(|_| flies) {
                let (found, errors) = statistical_pilot::choose(&pilot, &bodies, classification, wanted)?;
                stepped.push(Stepped { torques, found });
                statistics.extend(errors);
                *statistics = worst_times(std::mem::take(statistics));
                continue;
            }
            let lacks_series = pilot.may_leap(Scheme::ADAPTIVE_RK8) && !pilot.allows(Scheme::TAYLOR);
            let (worst, strictest) = accuracy.strictest_target();
            let found = if strictest < ROUNDING_F64 && scene.end() > 0.0 {
                let found = pilot.tabulated();
                Found { part: ROUNDING_F64 / strictest, worst, attitude: ROUNDING_F64, ..found }
            } else if flies {
                pilot.calibrate(&bodies, classification)?
            } else {
                pilot.tabulated()
            };
            if found.part > 1.0 {
                let draws = acting.iter().any(Torque::is_random);
                return Err(out_of_reach(&found, accuracy, precision, (has_f64, draws, lacks_series)));
            }
            stepped.push(Stepped { torques, found });
        }
        Ok(())
    }

    /// Refuses `f32` where its rounding alone would make the closed form, or more stepped bodies than the percentile leaves out, miss
    /// the target.
    fn check_f32(&self, scene: &Scene, accuracy: &Accuracy, wanted: Option<Precision>) -> Result<()> {
        let Self::Accuracy { tolerance, uniform_rate, .. } = self else { return Ok(()) };
        let ((missed, strictest), count) = (accuracy.strictest_target(), scene.ensemble().len());
        let may_miss = left_out(0.01 * accuracy.percentile, count);
        let acting = ActingTorques::of(scene.torques());
        let floor = |body: usize| {
            let classification = at_rate(classify((scene, &acting), body, tolerance), *uniform_rate);
            match (classification.torques.is_empty() && scene.may_skip(), classification.verdict.shape) {
                // An engine without `f64` leaves these to the CPU.
                (true, Shape::Asymmetric) if wanted == Some(Precision::F32) => least_target(CLOSED_FORM_F32),
                (true, _) => 0.0,
                (false, _) => floor_f32(classification.rate * scene.end()),
            }
        };
        let mut floors = parallel::rows(count, 1, &floor);
        floors.retain(|&floor| floor > strictest);
        if floors.len() <= may_miss {
            return Ok(());
        }
        floors.sort_by(|a, b| b.total_cmp(a));
        Err(Error::AccuracyOutOfReach {
            target: Box::new(*accuracy),
            missed,
            factor: floors[may_miss] / strictest,
            method: if scene.may_skip() && scene.torques().is_empty() { CLOSED_FORM } else { COSTS[0].scheme.name() },
            precision: Precision::F32,
            remedy: if wanted == Some(Precision::F32) { F32_MISSES } else { F64_ELSEWHERE },
        })
    }

    fn adaptive(
        scene: &Scene,
        engine: &dyn Backend,
        method: Method,
        steps: AdaptiveSteps,
        has_f64: bool,
    ) -> Result<Self> {
        let widest = if has_f64 { Precision::F64 } else { Precision::F32 };
        let precision = scene.wanted_precision().unwrap_or(widest);
        if method == Method::Taylor {
            if engine.speed_of_series().is_none() {
                return Err(taylor_unavailable(TAYLOR_ON_CPU));
            }
            if precision != Precision::F64 {
                return Err(taylor_unavailable(TAYLOR_IN_F64));
            }
        }
        steps.check(precision)?;
        if scene.coupling().is_none() && scene.forces().iter().any(Force::needs_attitude) {
            let expected = "a force that turns with the body follows equal steps of the attitude: use a method with a step dt, or taylor \
                            where torques act";
            return Err(Error::Setting { field: "tolerance", value: steps.tolerance, expected });
        }
        for (index, torque) in scene.torques().iter().enumerate() {
            if torque.is_random() {
                let draws = torque.parameter("draws_per_step").and_then(Value::as_whole).unwrap_or(1);
                return Err(Error::Torque {
                    torque: index,
                    model: torque.owned_name(),
                    body: None,
                    field: "draws_per_step".into(),
                    value: draws as f64,
                    expected: NOISE_REFUSED.into(),
                });
            }
        }
        Ok(Self::Adaptive { method, precision, steps })
    }

    /// The rule for bodies on which `torques` act.
    pub fn rule(&self, torques: TorqueSet) -> Option<&Rule> {
        match self {
            Self::Pinned { .. } | Self::Adaptive { .. } => None,
            Self::Accuracy { stepped, .. } => {
                stepped.iter().find(|entry| entry.torques == torques).map(|entry| &entry.found.rule)
            }
        }
    }
}

/// The classification, with the rate at which all bodies are stepped alike, if there is one.
pub(super) fn at_rate(classification: Classification, uniform: Option<f64>) -> Classification {
    Classification { rate: uniform.unwrap_or(classification.rate), ..classification }
}

fn fastest_rate(scene: &Scene, tolerance: &Bound) -> f64 {
    let acting = ActingTorques::of(scene.torques());
    let rate = |body| classify((scene, &acting), body, tolerance).rate;
    let of_piece = |_, bodies: Range<usize>| bodies.map(rate).fold(0.0, f64::max);
    parallel::map_tasks(parallel::pieces(scene.ensemble().len()), of_piece).into_iter().fold(0.0, f64::max)
}

/// Refuses a target that the closed form would miss in `f64` too.
fn check_f64(scene: &Scene, accuracy: &Accuracy) -> Result<()> {
    let (missed, strictest) = accuracy.strictest_target();
    let least = least_target(CLOSED_FORM_F64);
    let has_free = || {
        let acting = ActingTorques::of(scene.torques());
        (0..scene.ensemble().len()).any(|body| acting.on(body).is_empty())
    };
    if strictest >= least || scene.end() == 0.0 || !scene.may_skip() || !has_free() {
        return Ok(());
    }
    Err(Error::AccuracyOutOfReach {
        target: Box::new(*accuracy),
        missed,
        factor: least / strictest,
        method: CLOSED_FORM,
        precision: Precision::F64,
        remedy: "rounding in f64 is in the way: use a larger error",
    })
}

fn out_of_reach(
    found: &Found,
    target: &Accuracy,
    wanted: Option<Precision>,
    (has_f64, draws, lacks_series): (bool, bool, bool),
) -> Error {
    let narrow = found.rule.precision == Some(Precision::F32);
    let remedy = match (narrow, has_f64) {
        (true, true) => F32_MISSES,
        (true, false) => F64_ELSEWHERE,
        (false, _) if draws => "a random torque is in the way: use a larger error, or a method and a step of your own",
        (false, _) if lacks_series && wanted == Some(Precision::F32) => {
            "torques jump or have kinks, which Taylor series follow to the last digit, in f64 and on the CPU engine, and other steps leap \
             over: leave out precision = \"f32\", or name a method and its steps or tolerance (accuracy.method, dt, tolerance)"
        }
        (false, _) if lacks_series => {
            "torques jump or have kinks, which Taylor series follow to the last digit and other steps leap over: use the CPU engine in \
             f64, which has them, or name a method and its steps or tolerance (accuracy.method, dt, tolerance)"
        }
        (false, _) if found.attitude >= SATURATED => {
            // The error at the end is the same for all three.
            "nothing is left of the attitude in the finest steps that were tried, which does not tell why: the motion amplifies \
             every error, rounding adds up over many turns, or torques change faster than these steps follow (pulses, switches): \
             use a shorter span, or a larger error, ask for statistics and event times instead of attitudes (accuracy.mean, \
             quantile, event_time), for fewer of the bodies (accuracy.percentile), or name a method and its steps or tolerance \
             (accuracy.method, dt, tolerance)"
        }
        (false, _) if found.worst != Target::Attitude && found.part * target.of(found.worst) >= SATURATED => {
            "it is next to nothing at the end, or no steps follow it: use another span, or a larger error"
        }
        (false, _) => {
            "rounding in f64 is in the way, or finer steps would take more than planning may: use a shorter span, or a larger \
             error, or name a method and its steps or tolerance (accuracy.method, dt, tolerance)"
        }
    };
    Error::AccuracyOutOfReach {
        target: Box::new(*target),
        missed: found.worst,
        factor: found.part,
        method: found.rule.scheme.name(),
        precision: wanted.or(found.rule.precision).unwrap_or(Precision::F64),
        remedy,
    }
}

/// Refuses targets that are not valid errors.
fn check_accuracy(accuracy: &Accuracy) -> Result<()> {
    let wrong = |field, value, expected| Err(Error::Setting { field, value, expected });
    if let Some(value) = accuracy.attitude.filter(|target| !(*target > 0.0 && *target <= std::f64::consts::PI)) {
        return wrong("accuracy.attitude", value, "expected an angle above 0 and up to pi (rad)");
    }
    let relative = [("accuracy.angular_velocity", accuracy.angular_velocity), ("accuracy.energy", accuracy.energy)];
    for (field, target) in relative {
        if let Some(value) = target.filter(|target| !(*target > 0.0 && target.is_finite())) {
            return wrong(field, value, "expected a relative error above 0");
        }
    }
    if accuracy.targets().iter().all(|(_, wanted)| wanted.is_none()) {
        let expected = "expected an error of the attitude, the angular velocity or the kinetic energy";
        return wrong("accuracy", f64::NAN, expected);
    }
    if !(accuracy.percentile > 0.0 && accuracy.percentile <= 100.0) {
        let expected = "expected a percentile above 0 and up to 100";
        return wrong("accuracy.percentile", accuracy.percentile, expected);
    }
    Ok(())
}
