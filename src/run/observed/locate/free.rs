//! The search for events of bodies without torques, whose motion has a closed form.

use std::ops::Range;

use super::{Located, Passage, Search, Start};
use crate::bodies::{BodyFrame, BodyState};
use crate::kernel::free_motion::FreeMotion;
use crate::math::power_of_two::vector_scaled_by_power_of_two;
use crate::record::EventTime;
use crate::run::observed::bracket::Bracket;

/// The angle, rad, by which a torque-free body turns between two points at which its quantity is formed, and the most points between two
/// outputs; a body that needs more gets the time of the output.
const ANGLE: f64 = 0.5;
const MOST_POINTS: u32 = 1 << 18;

/// The most points at which the least distance from a level is sought between two others.
const MOST_NEARER: usize = 40;
/// How much further than it changes between points a quantity may come towards its level between them, at most.
const FURTHER: f64 = 2.0;

impl Search<'_> {
    /// Searches for a body without torques.
    pub(super) fn free(&self, passage: &Passage, from_start: bool) -> Located {
        let (ensemble, Range { start, end }) = (self.scene.ensemble(), passage.span.clone());
        let motion = match from_start {
            true => Ok((FreeMotion::of_body(ensemble, passage.body), 0.0)),
            false => {
                let Start { orientation, angular_momentum_world } = passage.start;
                let tensor = ensemble.inertia()[passage.body];
                let frame = BodyFrame::of_body(ensemble, passage.body, |_| 0.0);
                let momentum = frame.to_principal(orientation.conjugate() * angular_momentum_world);
                let moments = vector_scaled_by_power_of_two(frame.scaled_moments, frame.moment_exponent);
                let omega = frame.principal_to_body * (momentum / moments);
                FreeMotion::new(tensor, orientation, omega).map(|motion| (motion, start))
            }
        };
        let Ok((motion, zero)) = motion else { return passage.given_up(0) };
        let condition = self.condition(passage);
        let point = |time: f64| {
            let state = motion.at(time - zero);
            (self.excess(passage, time, &state, None), state)
        };
        let (excess, mut at) = point(start);
        let first = (start, passage.at_start(condition, excess));
        let (mut points, mut met) = ([first; 3], 0);
        let (mut side, mut is_first) = (condition.side(first.1), true);
        for _ in 0..MOST_POINTS {
            let [_, before, last] = points;
            if last.0 >= end {
                // The least distance may lie just before the end.
                let is_nearer =
                    last.1.abs() < before.1.abs() && [before, last].iter().all(|point| condition.side(point.1) == side);
                let is_sought = is_nearer && !passage.is_of_run();
                let found = is_sought.then(|| self.nearest(passage, (&point, side), before..last, &mut met)).flatten();
                return found.unwrap_or_else(|| passage.searched(met));
            }
            // The rate changes no faster than the body turns. A body at rest has one step.
            let time = (last.0 + (ANGLE / at.angular_velocity_body.length()).min(passage.longest())).min(end);
            let (excess, state) = point(time);
            at = state;
            if passage.is_undecided(condition, excess) {
                points[2].0 = time;
                continue;
            }
            let now = condition.side(excess);
            if side == now && !passage.is_of_run() {
                let from = if is_first { last } else { before };
                let is_least = last.1.abs() <= excess.abs() && last.1.abs() <= from.1.abs();
                if is_least && [from, last].iter().all(|point| condition.side(point.1) == side) {
                    let within = from..(time, excess);
                    if let Some(located) = self.nearest(passage, (&point, side), within, &mut met) {
                        return located;
                    }
                }
            } else if condition.is_met_between(side, now) {
                met += 1;
                if met == passage.left {
                    return self.between(passage, &point, last, (time, excess, state));
                }
            }
            (points, side, is_first) = ([before, last, (time, excess)], now, false);
        }
        passage.given_up(met)
    }

    /// The event in closed form between two points on either side of the level.
    fn between(
        &self,
        passage: &Passage,
        point: &impl Fn(f64) -> (f64, BodyState),
        before: (f64, f64),
        (time, excess, mut state): (f64, f64, BodyState),
    ) -> Located {
        let condition = self.condition(passage);
        let now = condition.side(excess);
        let mut bracket = Bracket::new(before, (time, excess));
        while let Some(next) = bracket.next(self.time_tolerance(passage.span.end)) {
            let (excess, at) = point(next);
            let is_past = condition.side(excess) == now;
            bracket.take(next, excess, is_past);
            if is_past {
                state = at;
            }
        }
        Located::At { time: bracket.end.0, known_to: EventTime::Located, state, own: Vec::new() }
    }

    /// Seeks where the quantity is nearest to its level between two points on the same side of it, by golden sections, until it is beyond the level or
    /// too far from it: counts the passages, there and back, and returns the event if it is one of them.
    fn nearest(
        &self,
        passage: &Passage,
        (point, side): (&impl Fn(f64) -> (f64, BodyState), Option<bool>),
        Range { start, end }: Range<(f64, f64)>,
        met: &mut u32,
    ) -> Option<Located> {
        const GOLDEN: f64 = 0.618_033_988_749_895;
        let condition = self.condition(passage);
        let inner = |a: f64, b: f64| (b - GOLDEN * (b - a), a + GOLDEN * (b - a));
        let (mut a, mut b) = (start, end);
        let mut pair = inner(a.0, b.0);
        let mut values = (point(pair.0), point(pair.1));
        for _ in 0..MOST_NEARER {
            let beyond = [(pair.0, values.0), (pair.1, values.1)].into_iter().find(|(_, (excess, _))| {
                !passage.is_undecided(condition, *excess)
                    && condition.side(*excess).is_some_and(|own| Some(own) != side)
            });
            if let Some((time, (excess, state))) = beyond {
                let there = condition.side(excess);
                for (is_met, before, after) in [
                    (condition.is_met_between(side, there), start, (time, excess, state)),
                    (condition.is_met_between(there, side), (time, excess), (end.0, end.1, point(end.0).1)),
                ] {
                    *met += u32::from(is_met);
                    if is_met && *met == passage.left {
                        return Some(self.between(passage, point, before, after));
                    }
                }
                return None;
            }
            let distances = [a.1, values.0.0, values.1.0, b.1].map(f64::abs);
            let least = distances.into_iter().fold(f64::INFINITY, f64::min);
            let change = distances.into_iter().fold(0.0, f64::max) - least;
            let is_far = least > FURTHER * change || !least.is_finite();
            if is_far || b.0 - a.0 <= self.time_tolerance(passage.span.end) {
                return None;
            }
            if distances[1] <= distances[2] {
                b = (pair.1, values.1.0);
                pair = inner(a.0, b.0);
                values = (point(pair.0), values.0);
            } else {
                a = (pair.0, values.0.0);
                pair = inner(a.0, b.0);
                values = (values.1, point(pair.1));
            }
        }
        None
    }
}
