//! Bodies sorted into groups, each of bodies that are treated alike.

use std::collections::BTreeMap;

use super::choice::{Classification, Rule, classify};
use super::class::{Bound, Class, Shape};
use super::driven::{ActingTorques, TorqueSet};
use super::group::{Group, Treatment, level_of, step_of};
use super::lane_classification::{CLASSIFIED_TOGETHER, LaneClassification};
use super::resolution::{Resolution, at_rate};
use super::times::longest_over;
use crate::bodies::Members;
use crate::kernel::free_motion::SetUp;
use crate::math::Precision;
use crate::math::parallel;
use crate::scene::Scene;
use crate::torque::force::Force;

/// Number of bodies that one task classifies and sorts.
const BLOCK: usize = 1 << 12;

/// The greatest angle, rad, by which a body turns in one step if a thrust turns with it: the error of the cubic between the attitudes of
/// two steps ([`crate::torque::force::stepped`]) is then at most (1/16)⁴/384 = 4e-8 rad.
const LONGEST_TURN: f64 = 1.0 / 16.0;

/// [`Group::most_attempts`] as a multiple of what a pilot counted, and the least.
const UNEXPECTED_ATTEMPTS: u64 = 1000;
const ALWAYS_ATTEMPTED: u64 = 100_000;
/// The least for each radian that the fastest body turns: it may be far faster than those of the pilot.
const ATTEMPTS_PER_RADIAN: f64 = 100.0;

impl Resolution {
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
            .map(|((class, strategy), Sorted { bodies, bound, rate })| {
                let treatment = match strategy {
                    Strategy::Precession => Treatment::RegularPrecession,
                    Strategy::ClosedForm { wide, set_up } => {
                        Treatment::ClosedForm { precision: precision(wide), set_up }
                    }
                    Strategy::Level { wide, level } => self.stepped(&class, wide, step_of(level)),
                    Strategy::Longest { wide } => self.stepped(&class, wide, longest_over(span)),
                };
                let is_all = bodies.len() == scene.ensemble().len();
                let members = if is_all { Members::All(bodies.len()) } else { Members::Some(bodies) };
                let most_attempts = self.most_attempts(&class, rate * span);
                Group { class, treatment, members, bound, rate, is_dense: false, most_attempts }
            })
            .collect()
    }

    /// [`Group::most_attempts`] of bodies that turn by at most `angle` rad: no limit where no pilot has counted.
    fn most_attempts(&self, class: &Class, angle: f64) -> u64 {
        let Self::Accuracy { stepped, .. } = self else { return u64::MAX };
        let of_class = stepped.iter().find(|entry| entry.torques == class.torques);
        let counted = of_class.and_then(|entry| entry.found.steps);
        let always = ALWAYS_ATTEMPTED.max((ATTEMPTS_PER_RADIAN * angle) as u64);
        counted.map_or(u64::MAX, |steps| steps.max.saturating_mul(UNEXPECTED_ATTEMPTS).max(always))
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
            // There is a rule for every set of torques that act.
            Self::Accuracy { .. } => self.rule(class.torques).map_or(Treatment::RegularPrecession, of_rule),
        }
    }

    /// The class and strategy of a body.
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
                let turns = scene.forces().iter().any(Force::needs_attitude) && !rule.scheme.is_adaptive();
                let turning = turns && rate > 0.0;
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

/// How a body's motion is found. The order of the variants orders groups.
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
    /// In the longest steps that are allowed.
    Longest {
        wide: bool,
    },
}

fn precision(wide: bool) -> Precision {
    if wide { Precision::F64 } else { Precision::F32 }
}

/// The torques in a body's torque kernel.
fn torques_for(scene: &Scene, classification: &Classification) -> TorqueSet {
    if !scene.may_skip() { TorqueSet::all(scene.torques().len()) } else { classification.torques }
}

/// The bodies that are stepped where an error is asked for, by the torques that act.
pub(super) fn stepped_bodies(scene: &Scene) -> BTreeMap<TorqueSet, Vec<u32>> {
    let mut found: BTreeMap<TorqueSet, Vec<u32>> = BTreeMap::new();
    let bodies = 0..scene.ensemble().len() as u32;
    if !scene.may_skip() {
        if !bodies.is_empty() {
            found.insert(TorqueSet::all(scene.torques().len()), bodies.collect());
        }
    } else if !scene.torques().is_empty() {
        let acting = ActingTorques::of(scene.torques());
        let of_block = |block: usize| {
            let mut lists: BTreeMap<TorqueSet, Vec<u32>> = BTreeMap::new();
            for body in block * BLOCK..scene.ensemble().len().min((block + 1) * BLOCK) {
                let torques = acting.on(body);
                if !torques.is_empty() {
                    lists.entry(torques).or_default().push(body as u32);
                }
            }
            lists
        };
        let blocks: Vec<_> = parallel::map(bodies.len().div_ceil(BLOCK), of_block);
        for (torques, bodies) in blocks.into_iter().flatten() {
            found.entry(torques).or_default().extend(bodies);
        }
    }
    found
}

/// Sorts the bodies by the class and strategy that `place` gives them. Bodies keep their order within a group.
fn sorted(
    scene: &Scene,
    tolerance: &Bound,
    place: impl Fn(&Classification) -> (Shape, Strategy) + Sync,
) -> BTreeMap<Key, Sorted> {
    let body_count = scene.ensemble().len();
    let translates = scene.ensemble().translation().is_some();
    let acting = ActingTorques::of(scene.torques());
    let of_block = |block: usize| {
        const { assert!(BLOCK.is_multiple_of(CLASSIFIED_TOGETHER)) };
        let mut lists = Lists::default();
        let mut lanes = None;
        for body in block * BLOCK..body_count.min((block + 1) * BLOCK) {
            let offset = body % CLASSIFIED_TOGETHER;
            if offset == 0 {
                lanes = Some(LaneClassification::at((scene, &acting), body, tolerance));
            }
            let classified = lanes.as_ref().and_then(|lanes: &LaneClassification| lanes.classification(offset));
            let classification = classified.unwrap_or_else(|| classify((scene, &acting), body, tolerance));
            let (shape, strategy) = place(&classification);
            let bound = match strategy {
                Strategy::ClosedForm { set_up: SetUp::OneWord, .. } => classification.set_up,
                _ if shape == classification.verdict.shape => classification.verdict.bound,
                _ => Bound::default(),
            };
            let torques = torques_for(scene, &classification);
            let is_linear_rotor = scene.ensemble().is_linear_rotor(body);
            let list = lists.of((Class { shape, torques, is_linear_rotor, translates }, strategy));
            list.bodies.push(body as u32);
            list.take(bound, classification.rate);
        }
        lists
    };
    let blocks: Vec<Lists> = parallel::map(body_count.div_ceil(BLOCK), of_block);
    let mut lists: BTreeMap<Key, Sorted> = BTreeMap::new();
    for (key, Sorted { bodies, bound, rate }) in blocks.into_iter().flat_map(|block| block.lists) {
        let entry = lists.entry(key).or_default();
        entry.bodies.extend(bodies);
        entry.take(bound, rate);
    }
    lists
}

/// What the bodies of a group have in common.
type Key = (Class, Strategy);

/// Bodies with one key, and the greatest bound and rate among them.
#[derive(Default)]
struct Sorted {
    bodies: Vec<u32>,
    bound: Bound,
    rate: f64,
}

impl Sorted {
    fn take(&mut self, bound: Bound, rate: f64) {
        self.bound = self.bound.or(bound);
        self.rate = self.rate.max(rate);
    }
}

/// Lists of bodies by their keys.
#[derive(Default)]
struct Lists {
    lists: Vec<(Key, Sorted)>,
    places: BTreeMap<Key, usize>,
    /// The index of the previous body's list.
    last: usize,
}

impl Lists {
    /// The list for a key, most often that of the previous body.
    fn of(&mut self, key: Key) -> &mut Sorted {
        let Self { lists, places, last } = self;
        if lists.get(*last).is_none_or(|(before, _)| *before != key) {
            *last = *places.entry(key).or_insert(lists.len());
            if *last == lists.len() {
                lists.push((key, Sorted::default()));
            }
        }
        &mut lists[*last].1
    }
}
