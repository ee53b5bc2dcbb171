//! What it takes to move centres of mass beside the rotation, where no closed form says where they are.

use super::group::{Group, Treatment};
use super::sampling::sample;
use crate::engine::EngineKind;
use crate::scene::Scene;
use crate::torque::force::custom::CustomForces;
use crate::torque::force::moving::{Moving, OF_ATTEMPT, OF_STEP};
use crate::torque::force::stepped::Centre;
use crate::torque::force::{Force, accelerations};

/// The bodies whose centres are followed over some steps, and the most attempts of each.
const FOLLOWED: usize = 4;
const MOST_ATTEMPTS: u32 = 64;
const SEED: u64 = 4;

/// The time of an evaluation of the forces, s of one core: the built-in ones; formulas, and each of their operations; an attitude in closed form;
/// an attitude between two states, and an angular velocity there. Measured under quadratic drag, thrust and two formulas.
const BUILT_IN: f64 = 3e-9;
const OF_FORMULAS: f64 = 1e-7;
const OF_OPERATION: f64 = 3e-9;
const OF_CLOSED_FORM: f64 = 1e-7;
const BETWEEN: f64 = 3e-8;
const OF_ANGULAR_VELOCITY: f64 = 1e-7;

/// The time to read the state after a step of a rotation that the centre follows.
const READING: f64 = 4e-7;

/// How much more the recomputed sample takes, in steps of order 4 and of order 8 that are as much finer.
const FINER: f64 = 3.0;
const FINER_OF_FORMULAS: f64 = 2.0;

/// The time to move the centre of mass of an average body through the span.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct CentreWork {
    /// Beside a rotation that has a closed form, or no part in it, s of one core.
    alone: f64,
    /// For each step of a rotation that it follows.
    of_step: f64,
    /// Whether all forces are built in.
    has_built_in: bool,
    /// The factor of a recomputation.
    finer: f64,
}

impl CentreWork {
    /// That of a scene's bodies; none where their centres have a closed form, or are part of the motion that steps integrate.
    pub fn of(scene: &Scene) -> Self {
        let ensemble = scene.ensemble();
        let Some(translation) = ensemble.translation() else { return Self::default() };
        if scene.coupling().is_some() || scene.forces().iter().all(Force::has_closed_form) || ensemble.is_empty() {
            return Self::default();
        }
        let custom = CustomForces::new(scene.forces());
        let of_formulas = OF_OPERATION.mul_add(custom.operations() as f64, OF_FORMULAS);
        let (of_evaluation, in_step, finer) = match custom.is_empty() {
            true => (BUILT_IN, OF_STEP, FINER),
            false => (BUILT_IN + of_formulas, OF_ATTEMPT, FINER_OF_FORMULAS),
        };
        let of_angular_velocity = if custom.need_attitude() { OF_ANGULAR_VELOCITY } else { 0.0 };
        let turns = scene.forces().iter().any(Force::needs_attitude);
        let of_attitude = if turns { OF_CLOSED_FORM + of_angular_velocity } else { 0.0 };
        let moving = Moving { custom: &custom, ensemble, shorter: 1.0, start: 0.0, span: scene.end() };
        let followed = sample(ensemble.len(), FOLLOWED.min(ensemble.len()), SEED);
        let evaluations = |&body: &u32| {
            let body = body as usize;
            let centre = Centre::new(translation.position[body], translation.velocity[body]);
            let forces = accelerations(scene.forces(), body, translation.mass[body]);
            moving.expected_evaluations(&centre, (body, &forces), MOST_ATTEMPTS)
        };
        let mean = followed.iter().map(evaluations).sum::<f64>() / followed.len() as f64;
        Self {
            alone: mean * (of_evaluation + of_attitude),
            of_step: READING + in_step * (of_evaluation + BETWEEN + of_angular_velocity),
            has_built_in: custom.is_empty(),
            finer,
        }
    }

    /// The time of a body of a group, which takes `steps` of the rotation if they are equal, s of one core.
    pub fn of_body(&self, scene: &Scene, group: &Group, steps: impl FnOnce() -> u64) -> f64 {
        match group.treatment {
            Treatment::Stepped { .. } if scene.forces().iter().any(Force::needs_attitude) => {
                steps() as f64 * self.of_step
            }
            _ => self.alone,
        }
    }

    /// The time of a group in a run on an engine, s of one core: a GPU moves centres under built-in forces along the rotation itself.
    pub fn of_group(&self, scene: &Scene, group: &Group, kind: EngineKind, steps: impl FnOnce() -> u64) -> f64 {
        let is_on_device =
            kind != EngineKind::Cpu && self.has_built_in && matches!(group.treatment, Treatment::Stepped { .. });
        if is_on_device { 0.0 } else { group.members.len() as f64 * self.of_body(scene, group, steps) }
    }

    /// The time of a body's recomputation.
    pub fn recomputed(&self, of_body: f64) -> f64 {
        self.finer * of_body
    }
}
