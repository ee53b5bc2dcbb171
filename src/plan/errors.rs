//! The errors of some bodies against a reference, and how they compare with those asked for.

use crate::bodies::frame::attitude_error;
use crate::bodies::{BodyState, Status};
use crate::math::Quantiles;
use crate::plan::sampling::upper_rank;
use crate::plan::sampling::{effective_count, left_out, verdict};
use crate::scene::{Accuracy, Target};
use glam::DVec3;

/// The errors of some bodies relative to those asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ErrorRatio {
    /// The greatest ratio of an error to the one asked for.
    pub part: f64,
    /// The target that has this ratio.
    pub worst: Target,
    /// The attitude error, rad, whether it was asked for or not.
    pub attitude: f64,
}

/// Errors of some bodies.
#[derive(Debug, Default)]
pub(crate) struct Errors {
    pub(crate) attitude: Vec<f64>,
    pub(crate) angular_velocity: Vec<f64>,
    pub(crate) energy: Vec<f64>,
    /// Errors of the centres of mass, m and m/s, of bodies that translate.
    pub(crate) position: Vec<f64>,
    pub(crate) velocity: Vec<f64>,
    /// The number of bodies that each entry stands for: of the errors above, and of those that translate. Empty if each stands for one.
    pub(crate) weights: Vec<f64>,
    pub(crate) weights_of_centres: Vec<f64>,
    /// How many bodies failed whose references did not.
    pub(crate) lost: usize,
}

impl Errors {
    /// Adds the difference between one body and its reference. A body whose reference is not a number is left out, as nothing is known of
    /// it.
    /// A body whose reference was given up counts as lost.
    pub(crate) fn push(&mut self, state: &BodyState, reference: &BodyState) {
        // A state that is not a number counts as the greatest error and must not pass for the least.
        let sound = |error: f64, worst: f64| if error.is_nan() { worst } else { error };
        let relative = |change: f64, scale: f64| if scale > 0.0 { change / scale } else { change };
        if !reference.is_sound() && reference.status != Status::StepBelowLimit {
            return;
        }
        if !state.is_sound() || !reference.is_sound() {
            self.lost += usize::from(reference.is_sound());
            self.attitude.push(std::f64::consts::PI);
            self.angular_velocity.push(f64::INFINITY);
            self.energy.push(f64::INFINITY);
            return;
        }
        self.attitude.push(sound(attitude_error(state, reference), std::f64::consts::PI));
        let change = (state.angular_velocity_body - reference.angular_velocity_body).length();
        self.angular_velocity.push(sound(relative(change, reference.angular_velocity_body.length()), f64::INFINITY));
        let change = (state.kinetic_energy - reference.kinetic_energy).abs();
        self.energy.push(sound(relative(change, reference.kinetic_energy), f64::INFINITY));
    }

    /// As [`Errors::push`], for a body that stands for `weight` bodies.
    pub(crate) fn push_weighted(&mut self, state: &BodyState, reference: &BodyState, weight: f64) {
        self.push(state, reference);
        self.weights.resize(self.attitude.len(), weight);
    }

    /// Adds the distance of a body's centre of mass (m, m/s) from its reference, if the reference has one.
    pub(crate) fn push_centre(&mut self, centre: (DVec3, DVec3), reference: (DVec3, DVec3), weight: f64) {
        if reference.0.is_finite() && reference.1.is_finite() {
            let distance = |a: DVec3, b: DVec3| if a.is_finite() { a.distance(b) } else { f64::INFINITY };
            self.position.push(distance(centre.0, reference.0));
            self.velocity.push(distance(centre.1, reference.1));
            self.weights_of_centres.push(weight);
        }
    }

    /// The errors at the percentile asked for. If the bodies are a sample of `all`, more of them, it is a bound that holds with a
    /// probability of 95 %. Infinite if a body is lost whose reference is sound: no body that can be followed may be given up.
    pub(crate) fn error_ratio(&mut self, asked: &Accuracy, all: usize) -> ErrorRatio {
        let (part, count) = (0.01 * asked.percentile, self.attitude.len());
        let rank = if count < all { upper_rank(count, part) as f64 / count as f64 } else { part };
        let mut standing = ErrorRatio { attitude: Quantiles::rank(&mut self.attitude, rank), ..ErrorRatio::default() };
        for (values, target, wanted) in self.targets(asked) {
            let part = wanted.map_or(0.0, |wanted| Quantiles::rank(values, rank) / wanted);
            if part > standing.part {
                (standing.part, standing.worst) = (part, target);
            }
        }
        if self.lost > 0 {
            standing.part = f64::INFINITY;
        }
        standing
    }

    /// The greatest attitude error as a multiple of the median, or of `least` if the median is less.
    pub(crate) fn spread(&mut self, least: f64) -> f64 {
        let [median, greatest] = [0.5, 1.0].map(|rank| Quantiles::rank(&mut self.attitude, rank));
        (greatest / median.max(least)).max(1.0)
    }

    /// Whether the sample of `all` bodies shows that the errors asked for are met: no greater share of it exceeds one than the percentile
    /// leaves out. `None` if it shows a greater one that may be chance, as in one of 20 samples, or is too small to tell ([`verdict`]); a
    /// weighted sample counts as one of [`Errors::effective`] bodies.
    pub(crate) fn meets(&mut self, target: &Accuracy, all: usize) -> Option<bool> {
        let (part, count) = (0.01 * target.percentile, self.attitude.len());
        let (weights, effective) = (self.weights.clone(), self.effective());
        let verdicts = self.targets(target).map(|(values, _, wanted)| {
            let is_beyond = |error: f64| wanted.is_some_and(|wanted| error > wanted);
            if count >= all {
                return Some(left_out(part, all) >= values.iter().filter(|&&error| is_beyond(error)).count());
            }
            verdict(share_of(values, &weights, is_beyond), effective, part)
        });
        match verdicts {
            _ if verdicts.contains(&Some(false)) => Some(false),
            _ if verdicts.contains(&None) => None,
            _ => Some(true),
        }
    }

    /// The number of evenly drawn bodies that would say as much.
    pub(crate) fn effective(&self) -> f64 {
        if self.weights.is_empty() { self.attitude.len() as f64 } else { effective_count(&self.weights) }
    }

    /// The share of all bodies that exceed one of the errors asked for, estimated from the sample.
    pub(crate) fn share_beyond(&mut self, asked: &Accuracy) -> f64 {
        let weights = self.weights.clone();
        let count = self.attitude.len();
        let targets = self.targets(asked);
        let is_beyond =
            |body: usize| targets.iter().any(|(values, _, wanted)| wanted.is_some_and(|wanted| values[body] > wanted));
        let beyond: Vec<f64> = (0..count).map(|body| f64::from(u8::from(is_beyond(body)))).collect();
        share_of(&beyond, &weights, |beyond| beyond > 0.0)
    }

    fn targets(&mut self, asked: &Accuracy) -> [(&mut Vec<f64>, Target, Option<f64>); 3] {
        [
            (&mut self.attitude, Target::Attitude, asked.attitude),
            (&mut self.angular_velocity, Target::AngularVelocity, asked.angular_velocity),
            (&mut self.energy, Target::Energy, asked.energy),
        ]
    }

    /// How many bodies of the sample exceed one of the errors asked for.
    pub(crate) fn beyond(&mut self, asked: &Accuracy) -> usize {
        let count = self.attitude.len();
        let targets = self.targets(asked);
        let is_beyond = |body: &usize| {
            targets.iter().any(|(values, _, wanted)| wanted.is_some_and(|wanted| values[*body] > wanted))
        };
        (0..count).filter(is_beyond).count()
    }
}

/// The weighted share of bodies for which a predicate holds; without weights all count alike.
fn share_of(values: &[f64], weights: &[f64], is_so: impl Fn(f64) -> bool) -> f64 {
    let weight = |body: usize| weights.get(body).copied().unwrap_or(1.0);
    let (mut so, mut all) = (0.0, 0.0);
    for (body, &value) in values.iter().enumerate() {
        all += weight(body);
        so += if is_so(value) { weight(body) } else { 0.0 };
    }
    if all > 0.0 { so / all } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn a_body_that_is_lost_alone_outweighs_any_percentile() {
        let sound = BodyState {
            orientation: glam::DQuat::IDENTITY,
            angular_velocity_body: DVec3::X,
            angular_momentum_world: DVec3::X,
            kinetic_energy: 0.5,
            norm_error: 0.0,
            status: crate::bodies::Status::Valid,
        };
        let lost = BodyState { angular_velocity_body: DVec3::NAN, ..sound };
        let asked = Accuracy { percentile: 50.0, ..Accuracy::attitude(1e-6) };
        let error_ratio = |states: [(&BodyState, &BodyState); 4]| {
            let mut errors = Errors::default();
            states.into_iter().for_each(|(state, reference)| errors.push(state, reference));
            errors.error_ratio(&asked, 4)
        };
        let good = (&sound, &sound);
        assert_eq!(error_ratio([good; 4]), ErrorRatio::default());
        assert_eq!(error_ratio([good, good, good, (&lost, &sound)]).part, f64::INFINITY);
        assert_eq!(error_ratio([good, good, good, (&lost, &lost)]).part, 0.0, "what nothing follows may be left out");
    }
}
