//! Probes: a few bodies stepped over a short time, which show how many steps the pilot's bodies will take and how much they err.

use super::{HEAVIER, PROBED_STEPS, Pilot};
use crate::error::Result;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::plan::choice::{Classification, Scheme};
use crate::plan::cost::Cost;

/// Replaces [`HEAVIER`] where torques change much faster than bodies turn: the steps of a few bodies can lock to a torque's phase, so that
/// errors add up instead of cancelling. Of 260 studies of 20 bodies under sinusoidal torques, 9 of the 110 with 20 rad/s or more, and no
/// other, missed their target with [`HEAVIER`]; none did with this.
const HEAVIER_IN_STEP: f64 = 10.0;
/// If a body takes more than this many times the steps that its angle and the outputs imply, the torques determine its steps.
const STEPS_OF_TORQUES: f64 = 5.0;
/// A greater difficulty means chaos, or an error that does not go as the order says.
pub(super) const MOST_DIFFICULTY: f64 = 1e6;
/// The factor by which a probe is shortened if bodies do not reach its end, and how often this is done: torques may change at rates far
/// above those of the bodies.
const SHORTER_PROBE: f64 = 1e-3;
pub(super) const SHORTER_PROBES: usize = 4;

/// Damped bodies slow down if they take less than this part of the steps that a short time predicts.
const SLOWED: f64 = 0.1;

/// What a few bodies show over a short time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Probe {
    /// Predicted steps of a body over the whole span.
    pub steps: f64,
    /// As [`Pilot::difficulty`].
    pub difficulty: f64,
    /// As [`Pilot::tail`].
    pub tail: f64,
    /// Number of bodies that did not reach the end of that time.
    pub unfinished: usize,
    /// Whether it was shortened.
    pub is_cut: bool,
}

impl Pilot<'_> {
    /// A probe over `span` s, shortened until all bodies reach the end.
    pub(super) fn short_probe(&self, span: f64) -> Result<Probe> {
        let mut best = self.probe(span)?;
        for shorter in 1..=SHORTER_PROBES {
            if best.unfinished == 0 {
                break;
            }
            let probe = self.probe(span * SHORTER_PROBE.powi(shorter as i32))?;
            if probe.unfinished < best.unfinished {
                best = Probe { is_cut: true, ..probe };
            }
        }
        Ok(best)
    }

    /// Whether damping slows bodies down so much that they take no more than [`SLOWED`] of the steps that a short time predicts.
    pub(super) fn slows_down(&self, short: &Probe) -> Result<bool> {
        let most = SLOWED * short.steps;
        let is_worth_trying = most >= 1.0 && !short.is_cut && self.may_be_damped();
        let Some(scheme) = self.probing_scheme().filter(|_| is_worth_trying) else { return Ok(false) };
        let rule = self.rule(Cost::shipped(scheme), Some(Precision::F64)).with_room();
        Ok(!self.exceeds(&rule, most.min(PROBED_STEPS) as u64)?)
    }

    /// How many times as many steps a short time predicts as the whole span shows, if damping slows bodies down; else 1.
    pub(super) fn slowing(&self, short: &Probe, whole: &Probe) -> f64 {
        let is_slowed = whole.steps <= SLOWED * short.steps && self.may_be_damped();
        if is_slowed { short.steps / whole.steps } else { 1.0 }
    }

    /// The time that series take as a part of that of the probe's steps, if they are cheaper; else 1.
    pub(super) fn part_of_series(&self) -> f64 {
        let seconds = |scheme: Scheme| {
            let cost = Cost::shipped(scheme);
            self.seconds(&self.rule(cost, Some(Precision::F64)), cost, None)
        };
        let Some(scheme) = self.probing_scheme().filter(|_| self.allows(Scheme::TAYLOR)) else { return 1.0 };
        // `min` takes the number if the other is NaN.
        (seconds(Scheme::TAYLOR) / seconds(scheme)).min(1.0)
    }

    fn may_be_damped(&self) -> bool {
        self.torques.iter().any(|torque| torque.needs().angular_velocity)
    }

    /// Measures how much a few bodies err over `span` s, and how many steps a body will need over the whole span.
    pub(super) fn probe(&self, span: f64) -> Result<Probe> {
        let count = self.bodies.len() as f64;
        let Some(scheme) = self.probing_scheme() else {
            let cost = Cost::shipped(Scheme::Equal(Method::Rk8));
            let rule = self.rule(cost, Some(Precision::F64));
            let step = self.step_seconds(&rule, cost, Precision::F64);
            let steps = (self.seconds(&rule, cost, None) / step / count).max(1.0);
            return Ok(Probe { steps, difficulty: self.difficulty, tail: self.tail, unfinished: 0, is_cut: false });
        };
        let probe = Self { bodies: self.bodies.clone(), span, ..*self };
        let rule = probe.rule(Cost::shipped(scheme), Some(Precision::F64)).with_room();
        let (coarse, fine) = (probe.stepped(&rule)?, probe.stepped(&rule.finer())?);
        let part = probe.errors(&coarse.states, &fine.states).error_ratio(self.accuracy, self.all).part;
        // The rule expects an error that grows with the angle.
        let harder = (part * self.span / span).clamp(1.0, MOST_DIFFICULTY);
        let difficulty = (self.difficulty * harder).min(MOST_DIFFICULTY);
        let needed = harder.powf(f64::from(rule.scheme.method().order()).recip());
        let taken = coarse.steps.map_or(0.0, |steps| steps.total as f64);
        let steps = (taken / count * needed).max(1.0);
        // A step ends at each output, however little bodies turn until then.
        let ends = probe.times_of(scheme).len() as f64;
        let implied = |(_, classification): &(u32, Classification)| {
            rule.expected_attempts(Precision::F64, classification.rate * span).max(ends)
        };
        let implied: f64 = self.bodies.iter().map(implied).sum();
        let tail = if taken > STEPS_OF_TORQUES * implied { HEAVIER_IN_STEP } else { HEAVIER };
        Ok(Probe { steps, difficulty, tail, unfinished: coarse.unfinished(), is_cut: false })
    }

    /// The adaptive scheme that shows how many steps there will be, if bodies may use one: one whose steps do not end at outputs, where there
    /// is one.
    pub(super) fn probing_scheme(&self) -> Option<Scheme> {
        let mut schemes = [Scheme::ADAPTIVE_RK8, Scheme::TAYLOR];
        schemes.sort_by_key(|scheme| !self.goes_beyond_outputs(*scheme));
        schemes.into_iter().find(|scheme| self.allows(*scheme))
    }
}
