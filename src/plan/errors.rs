//! The errors of some bodies against a reference, and how they compare with those asked for.

use crate::bodies::frame::attitude_error;
use crate::bodies::{BodyState, Status};
use crate::math::Quantiles;
use crate::plan::sampling::upper_rank;
use crate::plan::sampling::{is_plausible, left_out};
use crate::scene::{Accuracy, Target};
use glam::DVec3;

/// The errors of some bodies relative to those asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ErrorRatio {
    /// The greatest of the errors as parts of those asked for.
    pub part: f64,
    /// Of what that is.
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
    /// Of the centres of mass, m and m/s, of bodies that translate.
    pub(crate) position: Vec<f64>,
    pub(crate) velocity: Vec<f64>,
    /// How many have failed whose references have not.
    pub(crate) lost: usize,
}

impl Errors {
    /// Adds the difference of one body from its reference. Nothing is known of a body whose reference is not a number, so it is left out.
    /// A body whose reference was given up counts as lost.
    pub(crate) fn push(&mut self, state: &BodyState, reference: &BodyState) {
        // A state that is no number is as wrong as can be, and must not pass for the least error.
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

    /// Takes how far a body's centre of mass (m, m/s) is from where a reference has it, if that is anywhere.
    pub(crate) fn push_centre(&mut self, centre: (DVec3, DVec3), reference: (DVec3, DVec3)) {
        if reference.0.is_finite() && reference.1.is_finite() {
            let distance = |a: DVec3, b: DVec3| if a.is_finite() { a.distance(b) } else { f64::INFINITY };
            self.position.push(distance(centre.0, reference.0));
            self.velocity.push(distance(centre.1, reference.1));
        }
    }

    /// The errors at the percentile asked for. Of a sample of more bodies, `all`, that is a bound which holds with a
    /// probability of 95 %. Infinite where a body is lost whose reference is sound: no body that can be followed may be given up.
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

    /// The greatest attitude error as a multiple of the median, or, where that is less, of `least`.
    pub(crate) fn spread(&mut self, least: f64) -> f64 {
        let [median, greatest] = [0.5, 1.0].map(|rank| Quantiles::rank(&mut self.attitude, rank));
        (greatest / median.max(least)).max(1.0)
    }

    /// Whether the sample of `all` bodies speaks against the errors asked for: whether more of it are beyond than chance brings there in
    /// one of 20 samples, or, where it is all of them, than the percentile leaves out.
    pub(crate) fn meets(&mut self, target: &Accuracy, all: usize) -> bool {
        let (part, count) = (0.01 * target.percentile, self.attitude.len());
        self.targets(target).into_iter().all(|(values, _, wanted)| {
            let beyond = wanted.map_or(0, |wanted| values.iter().filter(|&&error| error > wanted).count());
            if count < all { is_plausible(beyond, count, part) } else { left_out(part, all) >= beyond }
        })
    }

    fn targets(&mut self, asked: &Accuracy) -> [(&mut Vec<f64>, Target, Option<f64>); 3] {
        [
            (&mut self.attitude, Target::Attitude, asked.attitude),
            (&mut self.angular_velocity, Target::AngularVelocity, asked.angular_velocity),
            (&mut self.energy, Target::Energy, asked.energy),
        ]
    }

    /// How many are beyond one of the errors asked for.
    pub(crate) fn beyond(&mut self, asked: &Accuracy) -> usize {
        let count = self.attitude.len();
        let targets = self.targets(asked);
        let is_beyond = |body: &usize| {
            targets.iter().any(|(values, _, wanted)| wanted.is_some_and(|wanted| values[*body] > wanted))
        };
        (0..count).filter(is_beyond).count()
    }
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
