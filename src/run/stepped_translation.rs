//! Centres of mass that are stepped along the rotation.

use std::ops::Range;

use glam::{DQuat, DVec3};

use crate::bodies::Members;
use crate::bodies::frame::initial_state;
use crate::bodies::memory;
use crate::bodies::{BodyFrame, BodyState};
use crate::engine::Observer;
use crate::engine::watch::{Pace, Watch};
use crate::error::{Error, Result};
use crate::math::parallel;
use crate::scene::Scene;
use crate::torque::force::carried::{Carried, MOST_PARTS};
use crate::torque::force::custom::CustomForces;
use crate::torque::force::moving::Moving;
use crate::torque::force::stepped::{Between, Centre};
use crate::torque::force::{Accelerations, Force, accelerations};

/// The centres of mass of a group's bodies, one for each row, if a force of the scene depends on velocity or attitude.
pub(crate) struct SteppedTranslation<'p> {
    scene: &'p Scene,
    members: &'p Members,
    forces: Vec<Accelerations>,
    /// The user's own forces, which `forces` does not include.
    custom: CustomForces<'p>,
    centres: Vec<Centre>,
    /// The rotation at the time of the centres, if a force needs it and the bodies are stepped.
    before: Vec<BodyState>,
    /// The factor by which steps are shorter than necessary.
    shorter: f64,
    pace: Pace,
}

impl<'p> SteppedTranslation<'p> {
    /// The centres of mass at the start, or `None` if all positions have a closed form. `follows`: whether the rotation
    /// is stepped.
    pub fn start(scene: &'p Scene, members: &'p Members, follows: bool) -> Result<Option<Self>> {
        let Some(translation) = scene.ensemble().translation() else { return Ok(None) };
        if scene.forces().iter().all(Force::has_closed_form) {
            return Ok(None);
        }
        let row = size_of::<Accelerations>() + size_of::<Centre>() + size_of::<BodyState>();
        memory::require(members.len(), members.len().saturating_mul(row), "the centres of mass")?;
        let bodies = || (0..members.len()).map(|row| members.body(row));
        let needs_attitude = scene.forces().iter().any(Force::needs_attitude);
        Ok(Some(Self {
            scene,
            members,
            forces: bodies().map(|body| accelerations(scene.forces(), body, translation.mass[body])).collect(),
            custom: CustomForces::new(scene.forces()),
            centres: bodies().map(|body| Centre::new(translation.position[body], translation.velocity[body])).collect(),
            before: if needs_attitude && follows {
                bodies().map(|body| initial_state(scene.ensemble(), body)).collect()
            } else {
                Vec::new()
            },
            shorter: 1.0,
            pace: Pace::default(),
        }))
    }

    /// The same in steps that are shorter by a factor, if no stepped rotation is followed.
    pub fn in_steps_shorter_by(self, shorter: f64) -> Self {
        Self { shorter, ..self }
    }

    /// Whether it needs the rotation after every step.
    pub fn follows(&self) -> bool {
        !self.before.is_empty()
    }

    /// The centres of mass for an engine that moves them with steps of at most `longest_step` seconds, and the most
    /// steps of theirs within one; `None` if that is more than an engine takes, or a force is the user's own.
    pub fn carried(&self, frames: &[BodyFrame], longest_step: f64) -> Option<(Vec<Carried>, u32)> {
        if !self.custom.is_empty() {
            return None;
        }
        let rows = self.forces.iter().zip(&self.centres).zip(frames);
        let carried: Vec<Carried> = rows
            .map(|((forces, centre), frame)| Carried {
                forces: Accelerations { thrust_body: frame.to_principal(forces.thrust_body), ..*forces },
                position: centre.position(),
                velocity: centre.velocity(),
            })
            .collect();
        let parts = carried.iter().map(|centre| centre.most_parts(longest_step)).fold(1.0, f64::max);
        (parts <= f64::from(MOST_PARTS)).then_some((carried, parts as u32))
    }

    /// Advances over a step of the rotation of `dt` seconds that begins at `start`, s, and leads to `after`.
    pub fn follow(&mut self, after: Vec<BodyState>, start: f64, dt: f64) {
        let (scene, members, before) = (self.scene, self.members, &self.before);
        let moving = Moving { custom: &self.custom, ensemble: scene.ensemble(), shorter: 1.0, start, span: dt };
        let forces = &self.forces;
        parallel::for_each_mut(&mut self.centres, parallel::OF_A_STEP, |row, centre| {
            let body = members.body(row);
            let turning = |state: &BodyState| turning(scene, body, state);
            let attitude = Between::new(turning(&before[row]), turning(&after[row]), dt);
            moving.advance(centre, (body, &forces[row]), &attitude);
        });
        self.before = after;
    }

    /// Advances by `span` seconds from `start`. Torque-free bodies turn by their closed form. The progress is in bodies.
    ///
    /// # Errors
    ///
    /// [`Error::Interrupted`] where the observer breaks; some bodies have then advanced, and others have not.
    pub fn advance(&mut self, start: f64, span: f64, observer: &mut Observer<'_>) -> Result<()> {
        let (scene, members) = (self.scene, self.members);
        let forces = &self.forces;
        let moving = Moving { custom: &self.custom, ensemble: scene.ensemble(), shorter: self.shorter, start, span };
        let (total, centres) = (self.centres.len() as u64, &mut self.centres);
        let of_body = |row: usize, centre: &mut Centre| {
            moving.advance_alone(centre, (members.body(row), &forces[row]));
        };
        let work = |watch: &Watch| {
            parallel::for_each_mut(centres, 1, |row, centre| {
                if watch.goes_on() {
                    of_body(row, centre);
                    watch.add(1);
                }
            });
        };
        self.pace.watched(span, work, total, observer).map_err(|_| Error::Interrupted { steps: 0 })
    }

    /// Its bodies with their positions (m) and velocities (m/s).
    pub fn centres(&self) -> impl Iterator<Item = (usize, (DVec3, DVec3))> {
        let rows = self.centres.iter().enumerate();
        rows.map(|(row, centre)| (self.members.body(row), (centre.position(), centre.velocity())))
    }

    /// Writes position (m) and velocity (m/s) of those of its bodies that are in `bodies` to their places.
    pub fn read(&self, bodies: &Range<usize>, out: &mut [Option<(DVec3, DVec3)>]) {
        for row in self.members.rows(bodies.clone()) {
            let centre = &self.centres[row];
            out[self.members.body(row) - bodies.start] = Some((centre.position(), centre.velocity()));
        }
    }
}

/// A body's orientation and the rate (rad/s, body axes) at which its axes turn; with internal dissipation this differs
/// from ω.
pub(crate) fn turning(scene: &Scene, body: usize, state: &BodyState) -> (DQuat, DVec3) {
    let omega = state.angular_velocity_body;
    // I ω, with the present I.
    let momentum_body = state.orientation.conjugate() * state.angular_momentum_world;
    let slip: DVec3 = scene.torques().iter().map(|torque| torque.slip(body, momentum_body, omega)).sum();
    (state.orientation, omega + slip)
}
