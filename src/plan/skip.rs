//! What a plan leaves out, and why that is safe.

use std::collections::BTreeMap;

use super::class::{Bound, Shape};
use super::cost::work::{Work, Works};
use super::group::{Group, Treatment};
use crate::kernel::free_motion::SetUp;
use crate::kernel::method::Method;
use crate::scene::{Outputs, Scene};
use crate::torque::force::Force;

/// One kind of work that a plan leaves out.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct Skip {
    /// Its name; as JSON also why it is safe ([`SkipName::reason`]).
    #[cfg_attr(feature = "study", serde(flatten, serialize_with = "name_and_reason"))]
    pub name: SkipName,
    /// Bodies that it concerns.
    pub bodies: usize,
    /// The most that it can change any of them, not counting rounding.
    #[cfg_attr(feature = "study", serde(flatten))]
    pub bound: Bound,
    /// Bytes of states that the skip saves reading; 0 where it saves none.
    pub bytes: u64,
}

#[cfg(feature = "study")]
fn name_and_reason<S: serde::Serializer>(of: &SkipName, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map([("name", of.name()), ("reason", of.reason())])
}

/// The names of all skips.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum SkipName {
    /// Bodies that hardly turn are not integrated.
    AtRest,
    /// Bodies with three equal moments, and linear rotors, are rotated.
    Spherical,
    /// Bodies that spin about a principal axis are rotated.
    Steady,
    /// Bodies with two equal moments are rotated twice.
    Axisymmetric,
    /// Torque-free bodies are not stepped.
    Free,
    /// Constants of the closed form have no more digits than the span needs.
    SetUp,
    /// Without a torque there is no torque code.
    Torque,
    /// Where no torque asks for the attitude, Taylor series leave it out.
    Attitude,
    /// Where torques depend only on directions fixed in the world, Taylor series are formed of these in place of the orientation.
    Directions,
    /// Positions are not advanced where there are none.
    Translation,
    /// Positions that have a closed form are not stepped.
    TranslationSteps,
    /// Slow bodies do not take the fastest body's steps.
    Steps,
    /// Times that are not recorded are not read back.
    Outputs,
    /// Where only statistics are asked for, states are not read back; the bound is that of a mean or a root mean square.
    States,
    /// Bodies that an event has stopped are left out from the next output on.
    Stopped,
}

impl SkipName {
    /// The name in tables and reports.
    pub fn name(self) -> &'static str {
        self.words().0
    }

    /// Why it is safe.
    pub fn reason(self) -> &'static str {
        self.words().1
    }

    fn words(self) -> (&'static str, &'static str) {
        match self {
            SkipName::AtRest => ("at-rest", "no torque and hardly any spin: the state stays as it is"),
            SkipName::Spherical => {
                ("spherical", "three equal moments, or a linear rotor: a uniform rotation about the angular momentum")
            }
            SkipName::Steady => ("steady", "spin about a principal axis: a uniform rotation about it"),
            SkipName::Axisymmetric => ("axisymmetric", "two equal moments: a uniform precession and a uniform spin"),
            SkipName::Free => ("free", "no torque acts: the state at any time follows in closed form"),
            SkipName::SetUp => {
                ("set-up", "one word holds what the closed form needs over this span: constants are not formed in two")
            }
            SkipName::Torque => ("torque", "no torque acts: its code is not in the kernel"),
            SkipName::Attitude => (
                "attitude",
                "no torque depends on it: the angular velocity is stepped alone, and the attitude follows within the same tolerance",
            ),
            SkipName::Directions => (
                "directions",
                "torques depend only on directions of the world: these are stepped, and the attitude follows within the same tolerance",
            ),
            SkipName::Translation => {
                ("translation", "no masses, positions and velocities are given: there is nothing to move")
            }
            SkipName::TranslationSteps => (
                "translation-steps",
                "forces are constant, uniform gravity or linear drag: positions follow in closed form at output times",
            ),
            SkipName::Steps => ("steps", "each body takes the steps that its own rate needs"),
            SkipName::Outputs => ("outputs", "states between output times leave neither registers nor device"),
            SkipName::States => ("states", "statistics alone are asked for: they are formed where the states are"),
            SkipName::Stopped => {
                ("stopped", "an event stops bodies: those that it has stopped are not computed any further")
            }
        }
    }

    /// The skip for a shape; none for the general one.
    pub(crate) fn of_shape(shape: Shape) -> Option<Self> {
        match shape {
            Shape::AtRest => Some(SkipName::AtRest),
            Shape::Spherical => Some(SkipName::Spherical),
            Shape::Steady => Some(SkipName::Steady),
            Shape::Axisymmetric => Some(SkipName::Axisymmetric),
            Shape::Asymmetric => None,
        }
    }
}

impl std::fmt::Display for SkipName {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(self.name())
    }
}

/// Whether only statistics are asked for, so that states stay where they are.
pub(super) fn leaves_states(scene: &Scene) -> bool {
    !scene.keeps_states() && !scene.reduced_statistics().is_empty()
}

/// The skips of the groups.
pub(super) fn skips(scene: &Scene, groups: &[Group], works: &Works, advances: usize) -> Vec<Skip> {
    let mut found: BTreeMap<SkipName, Skip> = BTreeMap::new();
    let mut add = |name: SkipName, bodies: usize, bound: Bound| {
        let skip = found.entry(name).or_insert(Skip { name, bodies: 0, bound: Bound::default(), bytes: 0 });
        skip.bodies += bodies;
        skip.bound = skip.bound.or(bound);
    };
    let longest = groups.iter().filter_map(step_if_stepped).fold(f64::INFINITY, f64::min);
    for group in groups {
        let count = group.members.len();
        if let Some(name) = SkipName::of_shape(group.class.shape) {
            add(name, count, group.bound);
        }
        if let Treatment::ClosedForm { set_up, .. } = group.treatment {
            add(SkipName::Free, count, Bound::default());
            if set_up == SetUp::OneWord {
                add(SkipName::SetUp, count, group.bound);
            }
        }
        if !scene.torques().is_empty() && !group.class.is_driven() {
            add(SkipName::Torque, count, Bound::default());
        }
        if group.treatment.method() == Some(Method::Taylor)
            && let Some(name) = works.get(&group.class.torques).and_then(Work::skip_of_series)
        {
            add(name, count, Bound::default());
        }
        let adapts = matches!(group.treatment, Treatment::Adaptive { .. }) && scene.may_skip() && count > 1;
        if adapts || step_if_stepped(group).is_some_and(|step| step > longest) {
            add(SkipName::Steps, count, Bound::default());
        }
    }
    let body_count = scene.ensemble().len();
    match scene.ensemble().translation() {
        None => add(SkipName::Translation, body_count, Bound::default()),
        Some(_) if scene.may_skip() && scene.forces().iter().all(Force::has_closed_form) => {
            add(SkipName::TranslationSteps, body_count, Bound::default());
        }
        Some(_) => {}
    }
    if matches!(scene.output_times(), Outputs::End) && !scene.records_start() && advances == 1 {
        add(SkipName::Outputs, body_count, Bound::default());
    }
    if scene.stops() && scene.may_skip() {
        add(SkipName::Stopped, body_count, Bound::default());
    }
    if leaves_states(scene) {
        let bytes =
            |group: &Group| group.treatment.state_bytes().saturating_mul((group.members.len() * advances) as u64);
        let bound = groups.iter().map(|group| group.treatment.statistics_bound()).fold(0.0, f64::max);
        let bound = Bound { attitude: 0.0, angular_velocity: bound, energy: bound };
        let bytes = groups.iter().map(bytes).fold(0, u64::saturating_add);
        found.insert(SkipName::States, Skip { name: SkipName::States, bodies: body_count, bound, bytes });
    }
    found.into_values().filter(|skip| skip.bodies > 0).collect()
}

fn step_if_stepped(group: &Group) -> Option<f64> {
    match group.treatment {
        Treatment::Stepped { longest_step, .. } => Some(longest_step),
        Treatment::RegularPrecession | Treatment::ClosedForm { .. } | Treatment::Adaptive { .. } => None,
    }
}
