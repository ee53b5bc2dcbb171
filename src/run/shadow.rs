//! The shadow of a run: a sample of its bodies, recomputed more accurately.

use glam::DVec3;
use rayon::prelude::*;

use crate::batch::{BodyState, Precision};
use crate::engine::Observer;
use crate::error::Result;
use crate::free_motion::FreeMotion;
use crate::method::Method;
use crate::plan::{Group, Members, Plan, TorqueSet, Treatment};
use crate::record::{Quantiles, Shadow};
use crate::run::alone::states_at_end;
use crate::run::confidence::{is_plausible, upper_rank};
use crate::scene::{Accuracy, Scene};

/// Every so many-th body is in the shadow's sample.
const ONE_IN: usize = 1000;
/// The least number of bodies in the shadow's sample, as far as there are so many.
const LEAST_BODIES: usize = 64;

/// How many of a number of bodies are recomputed.
pub(super) fn shadow_size(body_count: usize) -> usize {
    (body_count / ONE_IN).max(LEAST_BODIES).min(body_count)
}

/// `count` bodies of `body_count`, ascending: the range of bodies is cut into equal parts and one is drawn from each.
pub(crate) fn sample(body_count: usize, count: usize, seed: u64) -> Vec<u32> {
    let start = |part: usize| (part as u128 * body_count as u128 / count as u128) as usize;
    (0..count)
        .map(|part| {
            let width = start(part + 1) - start(part);
            (start(part) + (mixed(seed ^ part as u64) % width as u64) as usize) as u32
        })
        .collect()
}

/// A number whose bits depend on all of `x` (G. L. Steele, D. Lea, C. H. Flood, *Fast splittable pseudorandom number
/// generators*, OOPSLA 2014, figure 16: the finaliser of SplitMix64).
pub(crate) fn mixed(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The states at the end of the bodies of a sample, recomputed on the CPU in `f64`: torque-free bodies by the closed form,
/// the others with half their step. Their method is that of the plan where it is of order 4 or more, else `rk4`.
pub(super) fn recomputed(
    plan: &Plan<'_>,
    sample: &[u32],
    observer: &mut Observer<'_>,
) -> Result<Vec<(usize, BodyState)>> {
    let scene = plan.scene();
    let mut states = Vec::with_capacity(sample.len());
    for group in plan.groups() {
        let members: Vec<u32> = sample.iter().copied().filter(|&body| contains(group, body as usize)).collect();
        let Treatment::Stepped { longest_step, method, .. } = group.treatment else {
            states.extend(closed_form(scene, &members));
            continue;
        };
        let acting = |&body: &u32| !TorqueSet::acting_on(scene.torques(), body as usize).is_empty();
        let (driven, free): (Vec<u32>, Vec<u32>) = members.into_iter().partition(acting);
        states.extend(closed_form(scene, &free));
        if !driven.is_empty() {
            let method = if method.order() >= Method::Rk4.order() { method } else { Method::Rk4 };
            let treatment = Treatment::Stepped { method, precision: Precision::F64, longest_step: 0.5 * longest_step };
            let torques = group.class.torques.of(scene.torques());
            let members = Members::Some(driven);
            states.extend(states_at_end(scene, plan.times(), &torques, &members, &treatment, observer)?);
        }
    }
    states.sort_by_key(|(body, _)| *body);
    Ok(states)
}

/// The states at the end of torque-free bodies.
fn closed_form(scene: &Scene, members: &[u32]) -> Vec<(usize, BodyState)> {
    members
        .par_iter()
        .map(|&body| (body as usize, FreeMotion::of_body(scene.ensemble(), body as usize).at(scene.end())))
        .collect()
}

fn contains(group: &Group, body: usize) -> bool {
    !group.members.rows(body..body + 1).is_empty()
}

/// Errors of some bodies.
#[derive(Debug, Default)]
pub(crate) struct Errors {
    attitude: Vec<f64>,
    angular_velocity: Vec<f64>,
    energy: Vec<f64>,
}

impl Errors {
    /// Takes the difference of one body from its reference.
    pub(crate) fn push(&mut self, state: &BodyState, reference: &BodyState) {
        // A state that is no number is as wrong as can be, and must not pass for the least error.
        let sound = |error: f64, worst: f64| if error.is_nan() { worst } else { error };
        let relative = |change: f64, scale: f64| if scale > 0.0 { change / scale } else { change };
        self.attitude.push(sound(attitude_error(state, reference), std::f64::consts::PI));
        let change = (state.angular_velocity_body - reference.angular_velocity_body).length();
        self.angular_velocity.push(sound(relative(change, reference.angular_velocity_body.length()), f64::INFINITY));
        let change = (state.kinetic_energy - reference.kinetic_energy).abs();
        self.energy.push(sound(relative(change, reference.kinetic_energy), f64::INFINITY));
    }

    /// The errors at the percentile asked for as parts of their targets, the greatest of them. Of a sample of more
    /// bodies, `all`, that is a bound which holds with a probability of 95 %.
    pub(crate) fn part_of(&mut self, target: &Accuracy, all: usize) -> f64 {
        let (part, count) = (0.01 * target.percentile, self.attitude.len());
        let rank = if count < all { upper_rank(count, part) as f64 / count as f64 } else { part };
        self.targets(target)
            .into_iter()
            .filter_map(|(values, wanted)| wanted.map(|wanted| Quantiles::rank(values, rank) / wanted))
            .fold(0.0, f64::max)
    }

    /// Whether the sample speaks against the errors asked for: whether more of it are beyond than chance brings there in
    /// one of 20 samples.
    fn meets(&mut self, target: &Accuracy) -> bool {
        let (part, count) = (0.01 * target.percentile, self.attitude.len());
        self.targets(target).into_iter().all(|(values, wanted)| {
            let beyond = wanted.map_or(0, |wanted| values.iter().filter(|&&error| error > wanted).count());
            is_plausible(beyond, count, part)
        })
    }

    fn targets(&mut self, target: &Accuracy) -> [(&mut Vec<f64>, Option<f64>); 3] {
        [
            (&mut self.attitude, target.attitude),
            (&mut self.angular_velocity, target.angular_velocity),
            (&mut self.energy, target.energy),
        ]
    }

    /// What a run says of itself.
    pub(crate) fn shadow(mut self, target: Option<&Accuracy>) -> Shadow {
        Shadow {
            bodies: self.attitude.len(),
            target: target.copied(),
            met: target.map(|target| self.meets(target)),
            attitude: Quantiles::of(&mut self.attitude),
            angular_velocity: Quantiles::of(&mut self.angular_velocity),
            kinetic_energy: Quantiles::of(&mut self.energy),
        }
    }
}

/// The angle of the rotation between two orientations, rad, in [0, π]: twice the arc tangent of the vector part of
/// conj(p) q over its scalar part, which keeps small angles.
pub(crate) fn attitude_error(a: &BodyState, b: &BodyState) -> f64 {
    let relative = a.orientation.conjugate() * b.orientation;
    2.0 * DVec3::new(relative.x, relative.y, relative.z).length().atan2(relative.w.abs())
}
