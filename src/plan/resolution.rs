//! What a plan's groups follow from: the few numbers that were chosen, rather than the many bodies they apply to.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::choice::{
    CLOSED_FORM_F32, CLOSED_FORM_F64, Classification, Rule, SKIP_SHARE, classify, floor_f32, least_target,
    skip_tolerance,
};
use super::class::{Bound, Class, Shape};
use super::cost::work::Work;
use super::cost::{COSTS, Costs};
use super::driven::TorqueSet;
use super::group::{Group, Treatment, level_of, step_of};
use super::pilot::{Found, PROBED_STEPS, Pilot};
use super::reference::SATURATED;
use super::statistical::{StatisticError, worst_times};
use super::statistical_pilot;
use super::times::longest_over;
use crate::bodies::Members;
use crate::engine::Backend;
use crate::engine::adaptive_session::{
    NOISE_REFUSED, TAYLOR_IN_F64, TAYLOR_ON_CPU, check_equal_steps, taylor_unavailable,
};
use crate::error::{Error, Result};
use crate::kernel::free_motion::SetUp;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::plan::CLOSED_FORM;
use crate::plan::lane_classification::{CLASSIFIED_TOGETHER, LaneClassification};
use crate::scene::AdaptiveSteps;
use crate::scene::{Accuracy, Scene, StatisticalAccuracy, Stepping, Target};
use crate::torque::force::Force;
use crate::torque::{Torque, Value};

/// Everything from which, with the scene, a plan's groups follow, to the bit.
#[derive(Clone, Debug, PartialEq)]
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
        steps: AdaptiveSteps,
    },
    /// An error was asked for, of states or of statistics.
    Accuracy {
        /// What a simpler class may cost a body.
        tolerance: Bound,
        /// The arithmetic of the closed form.
        closed_form: Precision,
        /// The rate, rad/s, by which all bodies are stepped alike, where nothing is to be left out.
        uniform_rate: Option<f64>,
        /// How bodies are stepped, by the torques that act on them.
        stepped: Vec<Stepped>,
        /// What the integration was found to bring into each statistic, where errors of statistics decide.
        statistics: Vec<StatisticError>,
    },
}

/// How the bodies on which some torques act are stepped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stepped {
    /// The torques.
    pub torques: TorqueSet,
    /// The rule, and what is known of its error.
    pub found: Found,
}

/// Bodies that one task classifies and sorts.
const LOOK_BLOCK: usize = 1 << 12;

/// The angle (rad) that a body turns by in a step where a thrust turns with it: the cubic between the attitudes of two steps
/// ([`crate::torque::force::stepped`]) is then wrong by (1/16)⁴/384 = 4e-8 rad at most.
const LONGEST_TURN: f64 = 1.0 / 16.0;

/// The part of a quantity that its spread is taken to be at least, where errors are parts of that.
const LEAST_RELATIVE: f64 = 1e-6;

/// What `f32` needs.
const F32_MISSES: &str = "use precision f64, or more than 1e-6 and 3e-8 of the angle turned (rad)";

/// No steps in `f64` are better than some units in the last place of the quaternion, rad.
const ROUNDING_F64: f64 = 1e-15;

/// What an engine without `f64` needs.
const F64_ELSEWHERE: &str = "use an adapter with f64 or the CPU engine, or a larger error";

impl Resolution {
    /// Resolves `scene` for `engine`; `times` are its output times.
    pub(super) fn new(scene: &Scene, engine: &dyn Backend, times: &[f64], costs: &Costs) -> Result<Self> {
        let has_f64 = engine.precisions().contains(&Precision::F64);
        match scene.stepping() {
            Stepping::Pinned { method, dt, projected, .. } => {
                check_equal_steps(method)?;
                let widest = if has_f64 { Precision::F64 } else { Precision::F32 };
                let precision = scene.wanted_precision().unwrap_or(widest);
                crate::engine::check_step(dt, precision)?;
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
                // Nothing is within a negative tolerance.
                let nothing = Bound { attitude: -1.0, ..Bound::NONE };
                let tolerance = if !scene.may_skip() { nothing } else { skip_tolerance(&accuracy) };
                let mut resolution = Self::Accuracy {
                    tolerance,
                    closed_form: if narrow { Precision::F32 } else { Precision::F64 },
                    uniform_rate: (!scene.may_skip()).then(|| fastest_rate(scene, &tolerance)),
                    stepped: Vec::new(),
                    statistics: Vec::new(),
                };
                check_f64(scene, &accuracy)?;
                // Before the pilot, which would look for a step that does not exist.
                if wanted == Some(Precision::F32) || !has_f64 {
                    resolution.check_f32(scene, &accuracy, wanted)?;
                }
                let precision = if has_f64 { wanted } else { Some(Precision::F32) };
                let has_series = engine.speed_of_series().is_some();
                resolution.choose_steps(scene, (&accuracy, None), precision, has_f64, (has_series, times, costs))?;
                Ok(resolution)
            }
            Stepping::Statistics(wanted) => {
                Self::statistical(scene, &wanted, has_f64, (engine.speed_of_series().is_some(), times, costs))
            }
        }
    }

    /// Resolves a scene of which errors of statistics alone are asked for.
    fn statistical(
        scene: &Scene,
        wanted: &StatisticalAccuracy,
        has_f64: bool,
        known: (bool, &[f64], &Costs),
    ) -> Result<Self> {
        let precision = scene.wanted_precision();
        let narrow = match precision {
            Some(precision) => precision == Precision::F32,
            None => statistical_pilot::allows_narrow(scene, wanted)?,
        };
        // A spread may be as small as 1e-6 of a quantity and still be one; where `f32` is enough it is far greater.
        let state = if narrow { LEAST_RELATIVE } else { LEAST_RELATIVE * wanted.strictest().min(1.0) };
        let share = SKIP_SHARE * state;
        let nothing = Bound { attitude: -1.0, ..Bound::NONE };
        let tolerance = match scene.may_skip() {
            true => Bound { attitude: share, angular_velocity: share, energy: share },
            false => nothing,
        };
        let mut resolution = Self::Accuracy {
            tolerance,
            closed_form: if narrow { Precision::F32 } else { Precision::F64 },
            uniform_rate: (!scene.may_skip()).then(|| fastest_rate(scene, &tolerance)),
            stepped: Vec::new(),
            statistics: Vec::new(),
        };
        let precision = if has_f64 { precision } else { Some(Precision::F32) };
        let accuracy = Accuracy::attitude(wanted.strictest().min(1.0));
        resolution.choose_steps(scene, (&accuracy, Some(wanted)), precision, has_f64, known)?;
        Ok(resolution)
    }

    /// Finds a rule for each set of torques.
    fn choose_steps(
        &mut self,
        scene: &Scene,
        (accuracy, statistical): (&Accuracy, Option<&StatisticalAccuracy>),
        precision: Option<Precision>,
        has_f64: bool,
        (has_series, times, costs): (bool, &[f64], &Costs),
    ) -> Result<()> {
        let Self::Accuracy { tolerance, uniform_rate, stepped, statistics, .. } = self else { return Ok(()) };
        for (torques, bodies) in stepped_bodies(scene) {
            let acting = torques.of(scene.torques());
            let flies = scene.has_pilot() && scene.end() > 0.0;
            let classification = |body: u32| at_rate(classify(scene, body as usize, tolerance), *uniform_rate);
            let (all, span) = (bodies.len(), scene.end());
            let work = Work::of(&acting, scene.ensemble());
            let pilot = Pilot {
                scene,
                accuracy,
                costs,
                times,
                torques: &acting,
                work: &work,
                precision,
                forms_series: has_series,
                all,
                bodies: Vec::new(),
                span,
                most_steps: f64::INFINITY,
                most_of_body: PROBED_STEPS,
                is_cut: false,
                is_brief: false,
                difficulty: 1.0,
            };
            if let Some(wanted) = statistical.filter(|_| flies) {
                let (found, errors) = statistical_pilot::choose(&pilot, &bodies, classification, wanted)?;
                stepped.push(Stepped { torques, found });
                statistics.extend(errors);
                *statistics = worst_times(std::mem::take(statistics));
                continue;
            }
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
                return Err(out_of_reach(&found, accuracy, has_f64, draws));
            }
            stepped.push(Stepped { torques, found });
        }
        Ok(())
    }

    /// Refuses `f32` where the closed form, or more stepped bodies than the percentile leaves out, would miss the target for
    /// its rounding alone.
    fn check_f32(&self, scene: &Scene, accuracy: &Accuracy, wanted: Option<Precision>) -> Result<()> {
        let Self::Accuracy { tolerance, uniform_rate, .. } = self else { return Ok(()) };
        let ((missed, strictest), count) = (accuracy.strictest_target(), scene.ensemble().len());
        let left_out = ((1.0 - 0.01 * accuracy.percentile) * count as f64) as usize;
        let floor = |body: usize| {
            let classification = at_rate(classify(scene, body, tolerance), *uniform_rate);
            match (classification.torques.is_empty() && scene.may_skip(), classification.verdict.shape) {
                // An engine without f64 leaves these to the processor.
                (true, Shape::Asymmetric) if wanted == Some(Precision::F32) => least_target(CLOSED_FORM_F32),
                (true, _) => 0.0,
                (false, _) => floor_f32(classification.rate * scene.end()),
            }
        };
        let mut floors: Vec<f64> = (0..count).into_par_iter().map(floor).filter(|&floor| floor > strictest).collect();
        if floors.len() <= left_out {
            return Ok(());
        }
        floors.sort_by(|a, b| b.total_cmp(a));
        Err(Error::AccuracyOutOfReach {
            target: Box::new(*accuracy),
            missed,
            factor: floors[left_out] / strictest,
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
        if scene.forces().iter().any(Force::needs_attitude) {
            let expected =
                "a force that turns with the body follows equal steps of the attitude: use a method with a step dt";
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

    /// The groups of a scene's bodies.
    pub(super) fn groups(&self, scene: &Scene) -> Vec<Group> {
        let span = scene.end();
        let exact = Bound::default();
        let tolerance = match self {
            Self::Pinned { .. } | Self::Adaptive { .. } => &exact,
            Self::Accuracy { tolerance, .. } => tolerance,
        };
        sorted(scene, tolerance, |classification| self.place(scene, classification))
            .into_iter()
            .map(|((class, strategy), (members, bound))| {
                let treatment = match strategy {
                    Strategy::Precession => Treatment::RegularPrecession,
                    Strategy::ClosedForm { wide, set_up } => {
                        Treatment::ClosedForm { precision: precision(wide), set_up }
                    }
                    Strategy::Level { wide, level } => self.stepped(&class, wide, step_of(level)),
                    Strategy::Longest { wide } => self.stepped(&class, wide, longest_over(span)),
                };
                Group { class, treatment, members, bound }
            })
            .collect()
    }

    fn stepped(&self, class: &Class, wide: bool, step: f64) -> Treatment {
        let of_rule = |rule: &Rule| rule.treatment(precision(wide), step);
        match self {
            Self::Pinned { method, precision, longest_step, projected } => Treatment::Stepped {
                method: *method,
                precision: *precision,
                longest_step: *longest_step,
                projected: *projected,
            },
            Self::Adaptive { method, precision, steps } => {
                Treatment::Adaptive { method: *method, precision: *precision, steps: *steps }
            }
            // Every set of torques that act has a rule.
            Self::Accuracy { .. } => self.rule(class.torques).map_or(Treatment::RegularPrecession, of_rule),
        }
    }

    /// The rule by which bodies are stepped on which `torques` act.
    pub fn rule(&self, torques: TorqueSet) -> Option<&Rule> {
        match self {
            Self::Pinned { .. } | Self::Adaptive { .. } => None,
            Self::Accuracy { stepped, .. } => {
                stepped.iter().find(|entry| entry.torques == torques).map(|entry| &entry.found.rule)
            }
        }
    }

    /// Where a body belongs.
    fn place(&self, scene: &Scene, classification: &Classification) -> (Shape, Strategy) {
        let free = classification.torques.is_empty() && scene.may_skip();
        match self {
            Self::Pinned { .. } | Self::Adaptive { .. } if free && classification.verdict.shape == Shape::AtRest => {
                (Shape::AtRest, Strategy::Precession)
            }
            Self::Pinned { .. } | Self::Adaptive { .. } => (Shape::Asymmetric, Strategy::Longest { wide: false }),
            Self::Accuracy { tolerance, closed_form, uniform_rate, .. } => {
                if free && classification.verdict.shape != Shape::Asymmetric {
                    return (classification.verdict.shape, Strategy::Precession);
                }
                if free {
                    let set_up = if classification.set_up.within(tolerance) { SetUp::OneWord } else { SetUp::TwoWords };
                    return (Shape::Asymmetric, Strategy::ClosedForm { wide: *closed_form == Precision::F64, set_up });
                }
                let torques = torques_for(scene, classification);
                let (rate, span) = (at_rate(*classification, *uniform_rate).rate, scene.end());
                let Some(rule) = self.rule(torques) else {
                    return (Shape::Asymmetric, Strategy::Longest { wide: true });
                };
                let (step, wide) = (rule.longest_step(rate, span), rule.is_wide(rate * span));
                let turning = scene.forces().iter().any(Force::needs_attitude) && rate > 0.0;
                let step = if turning { step.min(LONGEST_TURN / rate) } else { step };
                let strategy = if step < span {
                    Strategy::Level { wide, level: level_of(step) }
                } else {
                    Strategy::Longest { wide }
                };
                (Shape::Asymmetric, strategy)
            }
        }
    }
}

/// How a body's motion is found. Orders groups.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Strategy {
    Precession,
    ClosedForm {
        wide: bool,
        set_up: SetUp,
    },
    Level {
        wide: bool,
        level: i32,
    },
    /// In steps as long as anything allows.
    Longest {
        wide: bool,
    },
}

fn precision(wide: bool) -> Precision {
    if wide { Precision::F64 } else { Precision::F32 }
}

/// The torques that a body's kernel has.
fn torques_for(scene: &Scene, classification: &Classification) -> TorqueSet {
    if !scene.may_skip() { TorqueSet::all(scene.torques().len()) } else { classification.torques }
}

fn at_rate(classification: Classification, uniform: Option<f64>) -> Classification {
    Classification { rate: uniform.unwrap_or(classification.rate), ..classification }
}

fn fastest_rate(scene: &Scene, tolerance: &Bound) -> f64 {
    let rate = |body| classify(scene, body, tolerance).rate;
    (0..scene.ensemble().len()).into_par_iter().map(rate).reduce(|| 0.0, f64::max)
}

/// The bodies that are stepped where an error is asked for, by the torques that act.
fn stepped_bodies(scene: &Scene) -> BTreeMap<TorqueSet, Vec<u32>> {
    let mut found: BTreeMap<TorqueSet, Vec<u32>> = BTreeMap::new();
    let bodies = 0..scene.ensemble().len() as u32;
    if !scene.may_skip() {
        if !bodies.is_empty() {
            found.insert(TorqueSet::all(scene.torques().len()), bodies.collect());
        }
    } else if !scene.torques().is_empty() {
        let looked = |block: usize| {
            let mut lists: BTreeMap<TorqueSet, Vec<u32>> = BTreeMap::new();
            for body in block * LOOK_BLOCK..scene.ensemble().len().min((block + 1) * LOOK_BLOCK) {
                let torques = TorqueSet::acting_on(scene.torques(), body);
                if !torques.is_empty() {
                    lists.entry(torques).or_default().push(body as u32);
                }
            }
            lists
        };
        let blocks: Vec<_> = (0..bodies.len().div_ceil(LOOK_BLOCK)).into_par_iter().map(looked).collect();
        for (torques, bodies) in blocks.into_iter().flatten() {
            found.entry(torques).or_default().extend(bodies);
        }
    }
    found
}

/// Sorts the bodies by class and by how `place` says that they are treated. Bodies keep their order within a group.
fn sorted(
    scene: &Scene,
    tolerance: &Bound,
    place: impl Fn(&Classification) -> (Shape, Strategy) + Sync,
) -> BTreeMap<Key, (Members, Bound)> {
    let body_count = scene.ensemble().len();
    let translates = scene.ensemble().translation().is_some();
    let looked = |block: usize| {
        const { assert!(LOOK_BLOCK.is_multiple_of(CLASSIFIED_TOGETHER)) };
        let mut lists = Lists::default();
        let mut lanes = None;
        for body in block * LOOK_BLOCK..body_count.min((block + 1) * LOOK_BLOCK) {
            let offset = body % CLASSIFIED_TOGETHER;
            if offset == 0 {
                lanes = Some(LaneClassification::at(scene, body, tolerance));
            }
            let classified = lanes.as_ref().and_then(|lanes: &LaneClassification| lanes.classification(offset));
            let classification = classified.unwrap_or_else(|| classify(scene, body, tolerance));
            let (shape, strategy) = place(&classification);
            let bound = match strategy {
                Strategy::ClosedForm { set_up: SetUp::OneWord, .. } => classification.set_up,
                _ if shape == classification.verdict.shape => classification.verdict.bound,
                _ => Bound::default(),
            };
            let torques = torques_for(scene, &classification);
            let is_linear_rotor = scene.ensemble().is_linear_rotor(body);
            let (list, greatest) = lists.of((Class { shape, torques, is_linear_rotor, translates }, strategy));
            list.push(body as u32);
            *greatest = greatest.or(bound);
        }
        lists
    };
    let blocks: Vec<Lists> = (0..body_count.div_ceil(LOOK_BLOCK)).into_par_iter().map(looked).collect();
    let mut lists: BTreeMap<Key, (Vec<u32>, Bound)> = BTreeMap::new();
    for (key, (bodies, bound)) in blocks.into_iter().flat_map(|block| block.lists) {
        let entry = lists.entry(key).or_default();
        entry.0.extend(bodies);
        entry.1 = entry.1.or(bound);
    }
    let members =
        |list: Vec<u32>| if list.len() == body_count { Members::All(body_count) } else { Members::Some(list) };
    lists.into_iter().map(|(key, (list, bound))| (key, (members(list), bound))).collect()
}

/// What the bodies of a group have in common.
type Key = (Class, Strategy);

/// Bodies by what they have in common, and the greatest bound of each list.
#[derive(Default)]
struct Lists {
    lists: Vec<(Key, (Vec<u32>, Bound))>,
    places: BTreeMap<Key, usize>,
    /// Where the body before is.
    last: usize,
}

impl Lists {
    /// The list of a key; most often it is that of the body before.
    fn of(&mut self, key: Key) -> &mut (Vec<u32>, Bound) {
        let Self { lists, places, last } = self;
        if lists.get(*last).is_none_or(|(before, _)| *before != key) {
            *last = *places.entry(key).or_insert(lists.len());
            if *last == lists.len() {
                lists.push((key, (Vec::new(), Bound::default())));
            }
        }
        &mut lists[*last].1
    }
}

/// Refuses what the closed form would miss in `f64` too.
fn check_f64(scene: &Scene, accuracy: &Accuracy) -> Result<()> {
    let (missed, strictest) = accuracy.strictest_target();
    let least = least_target(CLOSED_FORM_F64);
    let is_free = |body: usize| TorqueSet::acting_on(scene.torques(), body).is_empty();
    if strictest >= least || scene.end() == 0.0 || !scene.may_skip() || !(0..scene.ensemble().len()).any(is_free) {
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

fn out_of_reach(found: &Found, target: &Accuracy, has_f64: bool, draws: bool) -> Error {
    let narrow = found.rule.precision == Some(Precision::F32);
    let remedy = match (narrow, has_f64) {
        (true, true) => F32_MISSES,
        (true, false) => F64_ELSEWHERE,
        (false, _) if draws => "a random torque is in the way: use a larger error, or a method and a step of your own",
        (false, _) if found.attitude >= SATURATED => {
            "the motion amplifies every error until nothing is left of the attitude, or torques change faster than any steps \
             follow: use a shorter span, ask for statistics and event times instead of attitudes (accuracy.mean, quantile, \
             event_time), for fewer of the bodies (accuracy.percentile), or name a method and its steps (accuracy.method)"
        }
        (false, _) if found.worst != Target::Attitude && found.part * target.of(found.worst) >= SATURATED => {
            "it is next to nothing at the end, or no steps follow it: use another span, or a larger error"
        }
        (false, _) => {
            "rounding in f64 is in the way, or finer steps would take more than planning may: use a shorter span, or a larger \
             error"
        }
    };
    Error::AccuracyOutOfReach {
        target: Box::new(*target),
        missed: found.worst,
        factor: found.part,
        method: found.rule.scheme.name(),
        precision: found.rule.precision.unwrap_or(Precision::F64),
        remedy,
    }
}

/// Refuses targets that are no errors.
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
    if !(accuracy.percentile > 0.0 && accuracy.percentile <= 100.0) {
        let expected = "expected a percentile above 0 and up to 100";
        return wrong("accuracy.percentile", accuracy.percentile, expected);
    }
    Ok(())
}
