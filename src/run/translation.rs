//! The motion of the centres of mass: in closed form at output times, or in steps if skipping is off.

use glam::{DQuat, DVec3};

use crate::bodies::ensemble::Translation;
use crate::math::parallel;
use crate::plan::{Interval, Plan};
use crate::scene::Scene;
use crate::torque::force::{Accelerations, Force, accelerations, closed_form};

/// Positions and velocities of the centres of mass.
pub(super) enum Centres<'a> {
    /// The bodies do not translate, or are moved along their rotation ([`crate::run::stepped_translation`]).
    Still,
    /// Formed on request.
    ClosedForm { scene: &'a Scene, translation: &'a Translation, time: f64 },
    /// Stepped as finely as the fastest body, for comparison with the closed form.
    Stepped { scene: &'a Scene, translation: &'a Translation, states: Vec<(DVec3, DVec3)> },
}

impl<'a> Centres<'a> {
    pub fn start(plan: &Plan<'a>) -> Self {
        let scene = plan.scene();
        match scene.ensemble().translation() {
            None => Centres::Still,
            Some(_) if !scene.forces().iter().all(Force::has_closed_form) => Centres::Still,
            Some(translation) if scene.may_skip() => Centres::ClosedForm { scene, translation, time: 0.0 },
            Some(translation) => {
                let states = translation.position.iter().copied().zip(translation.velocity.iter().copied()).collect();
                Centres::Stepped { scene, translation, states }
            }
        }
    }

    /// Brings the centres of mass to the time `to`, s, over the steps of `interval`.
    pub fn advance(&mut self, to: f64, interval: Interval) {
        match self {
            Centres::Still => {}
            Centres::ClosedForm { time, .. } => *time = to,
            Centres::Stepped { scene, translation, states } => {
                parallel::for_each_mut(states, 1, |body, state| {
                    let forces = accelerations(scene.forces(), body, translation.mass[body]);
                    for _ in 0..interval.steps {
                        *state = stepped(&forces, *state, interval.dt);
                    }
                });
            }
        }
    }

    /// Whether centres of mass are moved here.
    pub fn are_moving(&self) -> bool {
        !matches!(self, Centres::Still)
    }

    /// Position (m) and velocity (m/s) of a body at `time`, s, always in closed form.
    pub fn of_body_at(&self, body: usize, time: f64) -> Option<(DVec3, DVec3)> {
        match self {
            Centres::Still => None,
            Centres::ClosedForm { scene, translation, .. } | Centres::Stepped { scene, translation, .. } => {
                let forces = accelerations(scene.forces(), body, translation.mass[body]);
                Some(closed_form(&forces, translation.position[body], translation.velocity[body], time))
            }
        }
    }

    /// Position (m) and velocity (m/s) of a body, world axes.
    pub fn of_body(&self, body: usize) -> Option<(DVec3, DVec3)> {
        match self {
            Centres::Still => None,
            Centres::ClosedForm { scene, translation, time } => {
                let forces = accelerations(scene.forces(), body, translation.mass[body]);
                Some(closed_form(&forces, translation.position[body], translation.velocity[body], *time))
            }
            Centres::Stepped { states, .. } => Some(states[body]),
        }
    }
}

/// One step of the classical Runge-Kutta method of order 4.
fn stepped(forces: &Accelerations, (position, velocity): (DVec3, DVec3), dt: f64) -> (DVec3, DVec3) {
    // No force here turns with the body.
    let acceleration = |velocity: DVec3| forces.at(DQuat::IDENTITY, velocity);
    let k1 = acceleration(velocity);
    let k2 = acceleration(velocity + k1 * (0.5 * dt));
    let k3 = acceleration(velocity + k2 * (0.5 * dt));
    let k4 = acceleration(velocity + k3 * dt);
    (position + (velocity + (k1 + k2 + k3) * (dt / 6.0)) * dt, velocity + (k1 + (k2 + k3) * 2.0 + k4) * (dt / 6.0))
}
