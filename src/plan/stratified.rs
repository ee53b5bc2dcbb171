//! Which bodies are recomputed: more of the fastest and of the slowest, so that a few that err more than the rest are not missed.
//!
//! Errors of steps grow with a high power of the rate, so that the percentiles of a run's error are those of its fastest bodies: if these
//! are 2 % of all, a plain sample of 64 has one of them or none. A body's rate at the start, or the rate to which torques bring it, is
//! known without stepping ([`rate_of_body`]), and so is the rate to which a constant torque brings it late. Bodies are drawn by rate with
//! unequal probabilities, systematically along their order (W. G. Cochran, *Sampling Techniques*, 3rd ed. (1977), sections 5.12, 8.1 and
//! 9A.10), and each stands for as many as its stretch of the order has; all figures are formed with these weights. Bodies that err for
//! other reasons than their rate are seen no more often than in a plain sample.
//!
//! The sample for errors of statistics is another one, with weights too ([`for_statistics`]): even but for the bodies on which torques are
//! strongest for their spin, and weakest; where nothing else is asked for, this one is drawn evenly
//! too. Drifts and errors of event times are unweighted figures of the bodies drawn here, and so rather too great.

use std::ops::Range;

use rayon::prelude::*;

use super::choice::rate_of_body;
use super::driven::ActingTorques;
use super::group::Group;
use super::recomputation::Recomputation;
use super::sampling::{mixed, sample};
use crate::math::parallel;
use crate::math::power_of_two::scaled_by_power_of_two;
use crate::scene::Scene;
use crate::torque::{self, Kind, Torque};

/// By rank of the rate: the upper end of each part of the bodies, and the share of the sample that the part has.
const PARTS: [(f64, f64); 5] = [(0.03, 0.05), (0.5, 0.22), (0.9, 0.23), (0.97, 0.15), (1.0, 0.35)];

/// The same for the errors of statistics, by rank of the rate to which torques bring a body relative to that of its spin.
const PARTS_BY_STRENGTH: [(f64, f64); 3] = [(0.02, 0.06), (0.98, 0.74), (1.0, 0.20)];

/// Number of levels of the rate in an octave; rates of one level count as alike.
const PER_OCTAVE: f64 = 16.0;

/// Number of bodies whose rates are computed, or one in [`ONE_IN`] of all if that is more: evenly spaced ones.
const LOOKED_AT: usize = 1 << 14;
const ONE_IN: usize = 64;

/// The bodies of a study that are recomputed.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Stratified {
    /// Their indices, ascending.
    pub bodies: Vec<u32>,
    /// The number of bodies that each stands for.
    pub weights: Vec<f64>,
}

/// What a plan says of the sample.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PlannedSample {
    /// How it is recomputed.
    pub recomputation: Recomputation,
    /// How much dearer its bodies are than the average.
    pub dearness: f64,
    /// The bodies; `None` if they are drawn evenly because nothing is known of their rates.
    pub drawn: Option<Stratified>,
}

impl Default for PlannedSample {
    fn default() -> Self {
        Self { recomputation: Recomputation::default(), dearness: 1.0, drawn: None }
    }
}

/// Bodies of a study in the order of their rates.
pub(super) struct Rates {
    /// Bodies with their rates, rad/s, ascending by level of the rate.
    ordered: Vec<(f64, u32)>,
    /// The number of bodies that each of these stands for.
    each: f64,
    /// The relative probability of being drawn, for each place in the order.
    density: Vec<f64>,
}

impl Rates {
    /// The rates of a scene's bodies; `None` if none is stepped.
    pub fn of(scene: &Scene, groups: &[Group]) -> Option<Self> {
        let is_stepped = |group: &Group| group.treatment.precision_of_steps().is_some();
        let count = scene.ensemble().len();
        if count == 0 || !groups.iter().any(is_stepped) {
            return None;
        }
        // Torque-free bodies in closed form have only rounding errors.
        let frees_are_stepped = groups.iter().any(|group| is_stepped(group) && !group.class.is_driven());
        let acting = ActingTorques::of(scene.torques());
        let rate = |&body: &u32| {
            let is_free = acting.on(body as usize).is_empty();
            if is_free && !frees_are_stepped {
                return 0.0;
            }
            let torques = if is_free { &[][..] } else { scene.torques() };
            let (rate, frame) = rate_of_body(scene, torques, body as usize);
            let middle_moment = scaled_by_power_of_two(frame.scaled_moments.y, frame.moment_exponent);
            let rate = rate.max(late_rate(scene.torques(), body as usize, (middle_moment, scene.end())));
            if rate.is_finite() { rate } else { f64::MAX }
        };
        let looked_at = sample(count, count.min((count / ONE_IN).max(LOOKED_AT)), SEED);
        let ordered = in_order(&looked_at, SEED, rate);
        let density = densities(&ordered, &PARTS);
        Some(Self { each: count as f64 / ordered.len() as f64, ordered, density })
    }

    /// Whether some bodies are to be drawn more often than others.
    pub fn differ(&self) -> bool {
        self.density.windows(2).any(|pair| pair[0] != pair[1])
    }

    /// The mean rate, rad/s.
    pub fn mean(&self) -> f64 {
        self.ordered.iter().map(|(rate, _)| rate).sum::<f64>() / self.ordered.len() as f64
    }

    /// How much faster a body of the sample turns than the average body: the factor in the cost of following it.
    pub fn dearness(&self) -> f64 {
        let mean = |weight: &dyn Fn(usize) -> f64| {
            let weights: f64 = (0..self.ordered.len()).map(weight).sum();
            self.ordered.iter().enumerate().map(|(place, (rate, _))| weight(place) / weights * rate).sum::<f64>()
        };
        (mean(&|place| self.density[place]) / mean(&|_| 1.0)).max(1.0)
    }

    /// Draws `count` bodies, or all if there are no more; another seed draws others.
    pub fn sampled(&self, count: usize, seed: u64) -> Stratified {
        let (all, count) = (self.ordered.len(), count.min(self.ordered.len()));
        let total: f64 = self.density.iter().sum();
        // The end of each stretch; each has at least one body.
        let mut ends = Vec::with_capacity(count);
        let (mut reached, mut place) = (0.0, 0);
        for drawn in 1..=count {
            let (least, most) = (ends.last().map_or(1, |end| end + 1), all - (count - drawn));
            while place < most
                && (place < least || reached + 0.5 * self.density[place] < total * drawn as f64 / count as f64)
            {
                reached += self.density[place];
                place += 1;
            }
            ends.push(if drawn == count { all } else { place });
        }
        let mut start = 0;
        let mut drawn: Vec<(u32, f64)> = Vec::with_capacity(count);
        for (number, end) in ends.into_iter().enumerate() {
            let stretch = &self.ordered[start..end];
            let chosen = (mixed(seed ^ number as u64) % stretch.len() as u64) as usize;
            drawn.push((stretch[chosen].1, self.each * stretch.len() as f64));
            start = end;
        }
        drawn.sort_unstable_by_key(|(body, _)| *body);
        let (bodies, weights) = drawn.into_iter().unzip();
        Stratified { bodies, weights }
    }
}

/// Bodies with their rates, ascending by level of the rate, those of one level in any order.
fn in_order(bodies: &[u32], seed: u64, rate: impl Fn(&u32) -> f64 + Sync) -> Vec<(f64, u32)> {
    // The key is stored, as it takes a logarithm.
    let keyed = |body: &u32| {
        let rate = rate(body);
        (level(rate), mixed(seed ^ u64::from(*body)), rate, *body)
    };
    let mut keyed: Vec<(f64, u64, f64, u32)> = parallel::rows(bodies.len(), 1, &|row| keyed(&bodies[row]));
    keyed.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    keyed.into_iter().map(|(_, _, rate, body)| (rate, body)).collect()
}

/// Draws `count` of `all` bodies, given by their number, for the errors of statistics: evenly, but more of those on which torques are strongest
/// for their spin, and of those on which they are weakest. If a few bodies move chaotically and the others do not, or the other way round,
/// it is these.
pub(crate) fn for_statistics(
    scene: &Scene,
    (all, body): (usize, &(dyn Fn(u32) -> u32 + Sync)),
    count: usize,
    seed: u64,
) -> Stratified {
    let even = || {
        let Stratified { bodies, weights } = Stratified::evenly(all, count, seed);
        Stratified { bodies: bodies.into_iter().map(body).collect(), weights }
    };
    if count >= all {
        return even();
    }
    let (ensemble, acting) = (scene.ensemble(), ActingTorques::of(scene.torques()));
    let strength = |body: &u32| {
        let body = *body as usize;
        if acting.on(body).is_empty() {
            return 0.0;
        }
        let moments = ensemble.inertia()[body].to_matrix();
        // A sum of moments serves as any of them: their ratio to the middle one is from 1 to 3.
        let scale = (moments.x_axis.x + moments.y_axis.y + moments.z_axis.z) / 3.0;
        let spin = ensemble.angular_velocity_body()[body].length();
        let ratio = torque::rate_of(scene.torques(), body, scale) / spin;
        if ratio.is_nan() { 0.0 } else { ratio.min(f64::MAX) }
    };
    let looked_at: Vec<u32> = sample(all, all.min((all / ONE_IN).max(LOOKED_AT)), seed).into_iter().map(body).collect();
    let ordered = in_order(&looked_at, seed, strength);
    let density = densities(&ordered, &PARTS_BY_STRENGTH);
    let rates = Rates { each: all as f64 / ordered.len() as f64, ordered, density };
    if rates.differ() { rates.sampled(count, seed) } else { even() }
}

impl Stratified {
    /// The number of bodies that body `body` of the sample stands for; 0 if it is not in the sample.
    pub fn weight_of(&self, body: usize) -> f64 {
        self.bodies.binary_search(&(body as u32)).map_or(0.0, |place| self.weights[place])
    }

    /// Up to `count` bodies that are neither the fastest nor the slowest: evenly spaced ones of the half that stand for the most.
    pub fn typical(&self, count: usize) -> Vec<u32> {
        let mut weights = self.weights.clone();
        weights.sort_unstable_by(f64::total_cmp);
        let middle = weights.get(weights.len() / 2).copied().unwrap_or_default();
        let stands_for_many = |(&body, &weight): (&u32, &f64)| (weight >= middle).then_some(body);
        let typical: Vec<u32> = self.bodies.iter().zip(&self.weights).filter_map(stands_for_many).collect();
        let count = count.min(typical.len());
        (0..count).map(|k| typical[k * typical.len() / count]).collect()
    }

    /// Those of the bodies for which a predicate holds.
    pub fn filtered(mut self, holds: impl Fn(u32) -> bool) -> Self {
        let held = self.bodies.iter().zip(&self.weights).filter(|(body, _)| holds(**body));
        (self.bodies, self.weights) = held.map(|(body, weight)| (*body, *weight)).unzip();
        self
    }

    /// The bodies that lie in a part, counted from its first body.
    pub fn within(self, part: &Range<usize>) -> Self {
        let own = |(body, _): &(u32, f64)| part.contains(&(*body as usize));
        let own = self.bodies.into_iter().zip(self.weights).filter(own);
        let (bodies, weights) = own.map(|(body, weight)| (body - part.start as u32, weight)).unzip();
        Self { bodies, weights }
    }

    /// An even sample of `all` bodies, each of which stands for as many.
    pub fn evenly(all: usize, count: usize, seed: u64) -> Self {
        let bodies = sample(all, count.min(all), seed);
        Self { weights: vec![all as f64 / bodies.len().max(1) as f64; bodies.len()], bodies }
    }
}

/// The seed of checks; fixed, so that two runs of a plan are checked on the same bodies.
pub(crate) const SEED: u64 = 0;

/// The rate, rad/s, to which constant torques bring a body at rest by `end`, s, or as long as other torques let them: a torque that brings
/// it to a rate r within about a radian brings it to r² t after t seconds.
fn late_rate(torques: &[Torque], body: usize, (middle_moment, end): (f64, f64)) -> f64 {
    let is_constant = |torque: &&Torque| matches!(torque.kind(), Kind::ConstantBody | Kind::ConstantWorld);
    let rate = |torque: &Torque| torque::rate_of(std::slice::from_ref(torque), body, middle_moment);
    let pushed: f64 = torques.iter().filter(is_constant).map(|torque| rate(torque).powi(2)).sum();
    pushed * end.min(torque::damping_of(torques, body, middle_moment).recip())
}

/// The level of a rate; alike rates have the same one.
fn level(rate: f64) -> f64 {
    if rate > 0.0 { (rate.log2() * PER_OCTAVE).floor() } else { f64::NEG_INFINITY }
}

/// The relative probability of being drawn, for each place in the order; bodies of alike rates are drawn alike.
fn densities(ordered: &[(f64, u32)], parts: &[(f64, f64)]) -> Vec<f64> {
    let count = ordered.len() as f64;
    // The share of the sample drawn from the bodies up to a rank.
    let below = |rank: f64| {
        let (mut start, mut sum) = (0.0, 0.0);
        for &(end, share) in parts {
            if rank <= end {
                return sum + share * (rank - start) / (end - start);
            }
            (start, sum) = (end, sum + share);
        }
        1.0
    };
    let mut density = Vec::with_capacity(ordered.len());
    for alike in ordered.chunk_by(|a, b| level(a.0) == level(b.0)) {
        let (start, end) = (density.len() as f64 / count, (density.len() + alike.len()) as f64 / count);
        let each = (below(end) - below(start)) / alike.len() as f64;
        density.resize(density.len() + alike.len(), each);
    }
    density
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rates(of: impl Fn(usize) -> f64, count: usize) -> Rates {
        let mut ordered: Vec<(f64, u32)> = (0..count).map(|body| (of(body), body as u32)).collect();
        ordered.sort_by(|a, b| level(a.0).total_cmp(&level(b.0)));
        let density = densities(&ordered, &PARTS);
        Rates { each: 1.0, ordered, density }
    }

    #[test]
    fn a_minority_has_its_share_and_weights_add_up_to_all() {
        let rates = rates(|body| if body % 50 == 7 { 30.0 } else { 1.0 + 0.3 * (body as f64 * 0.61).fract() }, 2000);
        for count in [8, 64, 500, 2000, 3000] {
            let Stratified { bodies, weights } = rates.sampled(count, SEED);
            assert_eq!(bodies.len(), count.min(2000));
            assert!(bodies.windows(2).all(|pair| pair[0] < pair[1]));
            assert!((weights.iter().sum::<f64>() - 2000.0).abs() < 1e-9);
            let of_minority = || bodies.iter().zip(&weights).filter(|(body, _)| *body % 50 == 7);
            let stands_for: f64 = of_minority().map(|(_, weight)| weight).sum();
            assert!((stands_for - 40.0).abs() < 100.0 / count.min(2000) as f64 * 8.0, "{count}: {stands_for}");
            if count >= 64 {
                assert!(of_minority().count() * 5 >= count.min(200), "{count}: {}", of_minority().count());
            }
        }
        assert!(rates.dearness() > 3.0 && rates.dearness() < 12.0, "{}", rates.dearness());
        let typical = rates.sampled(192, SEED).typical(8);
        assert!(typical.len() == 8 && typical.iter().all(|body| body % 50 != 7), "{typical:?}");
        assert!(typical[0] < 500 && typical[7] >= 1500, "from all of the study: {typical:?}");
        assert_eq!(
            [Stratified::evenly(9, 9, SEED).typical(3), Stratified::evenly(2, 2, SEED).typical(8)],
            [vec![0, 3, 6], vec![0, 1]]
        );
    }

    #[test]
    fn bodies_that_turn_alike_are_drawn_alike() {
        let rates = rates(|body| 1.001 + 1e-9 * body as f64, 1000);
        let Stratified { weights, .. } = rates.sampled(100, SEED);
        assert!(weights.iter().all(|weight| (weight - 10.0).abs() <= 1.0), "{weights:?}");
        assert!((rates.dearness() - 1.0).abs() < 1e-6);
        let Stratified { bodies, weights } = Stratified::evenly(1000, 64, SEED);
        assert!(bodies.len() == 64 && weights.iter().all(|weight| *weight == 1000.0 / 64.0));
    }

    /// Of 2,000 bodies 14 spin slowly on their orbit: an even sample of 100 has none of them in some of these cases.
    #[test]
    fn the_few_on_which_torques_are_strongest_are_compared() {
        let orbit = || torque::Orbit::kepler(3.986_004_418e14, 8e6, 0.15);
        for case in 0..20 {
            let is_slow = |body: usize| (body + 23 * case) % 143 == 5;
            let body = |body: usize| {
                let spin = if is_slow(body) { 1.2e-3 } else { 0.05 + 1e-6 * body as f64 };
                (glam::DVec3::new(100.0, 220.0, 250.0), glam::DQuat::IDENTITY, glam::DVec3::Z * spin)
            };
            let scene = Scene::new(crate::Ensemble::from_fn(2000, body).expect("bodies"));
            let scene = scene.torque(Torque::gravity_gradient(orbit()));
            let Stratified { bodies, weights } = for_statistics(&scene, (2000, &|body| body), 100, 0);
            assert!(bodies.len() == 100 && (weights.iter().sum::<f64>() - 2000.0).abs() < 1e-9);
            let slow = bodies.iter().zip(&weights).filter(|(body, _)| is_slow(**body as usize));
            let (count, stands_for) = slow.fold((0, 0.0), |(count, sum), (_, weight)| (count + 1, sum + weight));
            // A stretch of the order may begin among the slow ones and end among some twenty others.
            assert!(count >= 3 && (9.0..=32.0).contains(&stands_for), "case {case}: {count}, {stands_for}");
            // A plan is made with other bodies than those that then check it.
            let of_plan = for_statistics(&scene, (2000, &|body| body), 100, 3).bodies;
            let both = of_plan.iter().filter(|body| bodies.contains(body)).count();
            assert!(both < 40, "case {case}: {both} bodies are in both");
        }
    }
}
