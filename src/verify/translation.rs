//! Centres of mass that an engine advances with its steps of the rotation, compared with the host's, step by step.
//!
//! Each step of the host is taken in `f64` from the engine's state of the centre, along the engine's own rotation, so that both
//! part only by roundings of this step.

use glam::DVec3;

use super::Found;
use super::compare::{Comparison, Field, Gap, Place, is_lost};
use super::subject::Subject;
use crate::bodies::BodyState;
use crate::bodies::columns::StateWords;
use crate::engine::{Backend, End, unobserved};
use crate::error::Result;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::math::clock::Clock;
use crate::math::real::Scalar;
use crate::plan::Treatment;
use crate::run::stepped_translation::{SteppedTranslation, turning};
use crate::scene::Scene;
use crate::torque::force::Force;
use crate::torque::force::accelerations;
use crate::torque::force::stepped::{Between, Centre};

/// Roundings of an acceleration and of the combination of four of them in a step; the attitude between two states has some ten.
const ROUNDINGS: f64 = 48.0;

/// Whether centres of mass are stepped along a stepped rotation, so that an engine may advance them.
pub(super) fn follows(scene: &Scene, treatment: &Treatment) -> bool {
    let is_stepped = matches!(treatment, Treatment::Stepped { projected: false, .. });
    is_stepped && scene.ensemble().translation().is_some() && scene.forces().iter().any(Force::needs_attitude)
}

/// The centres of mass of a group's bodies that are stepped along the rotation.
pub(super) struct Flown<'a> {
    scene: &'a Scene,
    subject: &'a Subject<'a>,
    longest_step: f64,
}

impl<'a> Flown<'a> {
    /// `None` if positions follow in closed form or without the rotation, on the host and in `f64` whatever the engine.
    pub fn of(scene: &'a Scene, subject: &'a Subject<'a>, treatment: &Treatment) -> Option<Self> {
        let Treatment::Stepped { longest_step, .. } = *treatment else { return None };
        follows(scene, treatment).then_some(Self { scene, subject, longest_step })
    }

    /// Compares `parts` of equal steps: the number of the first, its time and size, and how many there are.
    pub fn compare(
        &self,
        engine: &dyn Backend,
        method: Method,
        start: &StateWords,
        parts: &[(u64, Clock, f64, u64)],
        found: &mut Found,
    ) -> Result<()> {
        let Self { scene, subject, longest_step } = *self;
        let Some(&(_, clock, ..)) = parts.first() else { return Ok(()) };
        if !engine.carries_centres() || scene.forces().iter().any(Force::is_custom) {
            found
                .notes
                .push("centres of mass: not compared, as the host moves them along either side's rotation".into());
            return Ok(());
        }
        let carried = SteppedTranslation::start(scene, &subject.members, true)?
            .and_then(|flight| flight.carried(&subject.frames, longest_step));
        let Some((centres, most)) = carried else {
            found.notes.push(
                "centres of mass: not compared, as they take more steps than the engine does; the host moves them"
                    .into(),
            );
            return Ok(());
        };
        let sides = [engine.description().name, "the host's centres of mass in f64".to_owned()];
        let mut comparison = Comparison::new(sides, true);
        let rows = 0..subject.len();
        let mut session = engine.start_carrying(subject.batch.at(start, clock), method, &centres, most)?;
        let mut before = self.states(start, clock.seconds());
        let mut places = session.read_centres(rows.clone())?;
        for &(first, clock, dt, count) in parts {
            for index in 0..count {
                session.advance_to(End::of_steps(dt, 1), &mut unobserved)?;
                let now = clock.after(dt, index + 1);
                let after = self.states(&session.read(rows.clone())?, now.seconds());
                let moved = session.read_centres(rows.clone())?;
                for row in rows.clone() {
                    let body = subject.members.body(row);
                    let place = Place { body, step: first + index, time: clock.after(dt, index).seconds() };
                    self.enter(&mut comparison, place, (&before[row], &after[row]), (places[row], moved[row]), dt);
                }
                (before, places) = (after, moved);
            }
        }
        found.comparisons.push(comparison);
        Ok(())
    }

    fn states(&self, words: &StateWords, time: f64) -> Vec<BodyState> {
        let Self { subject, scene, .. } = self;
        let of = |(row, frame): (usize, &crate::bodies::BodyFrame)| {
            frame.at(scene.torques(), subject.members.body(row), time).state_of(words, row)
        };
        subject.frames.iter().enumerate().map(of).collect()
    }

    fn enter(
        &self,
        comparison: &mut Comparison,
        place: Place,
        (before, after): (&BodyState, &BodyState),
        (from, to): ((DVec3, DVec3), (DVec3, DVec3)),
        dt: f64,
    ) {
        let Some(translation) = self.scene.ensemble().translation() else { return };
        let forces = accelerations(self.scene.forces(), place.body, translation.mass[place.body]);
        let mut centre = Centre::new(from.0, from.1);
        let turning = |state| turning(self.scene, place.body, state);
        centre.advance(&forces, &Between::new(turning(before), turning(after), dt), dt);
        let numbers = |(x, v): (DVec3, DVec3)| [x.to_array(), v.to_array()].concat();
        if is_lost(&numbers((centre.position(), centre.velocity())), &numbers(to), Precision::F64) {
            comparison.lost += 1;
            return;
        }
        let (u, second) = match self.subject.precision {
            Precision::F32 => (f32::UNIT_ROUNDOFF, f32::UNIT_ROUNDOFF * f32::UNIT_ROUNDOFF),
            Precision::F64 => (f64::UNIT_ROUNDOFF, f64::UNIT_ROUNDOFF),
        };
        let speed = from.1.length().max(to.1.length());
        let size = forces.constant_world.length()
            + forces.thrust_body.length()
            + (forces.linear_drag + forces.quadratic_drag * speed) * speed;
        let velocity = ROUNDINGS * (u * size * dt + second * speed);
        let position = ROUNDINGS * (u * (speed + size * dt) * dt + second * from.0.length().max(to.0.length()));
        let is_bounded = position.is_finite() && velocity.is_finite();
        *(if is_bounded { &mut comparison.decided } else { &mut comparison.undecided }) += 1;
        let precision = self.subject.precision;
        for (field, expected, found, bound) in
            [(Field::Position, centre.position(), to.0, position), (Field::Velocity, centre.velocity(), to.1, velocity)]
        {
            let off = (found - expected).to_array();
            let gap = Gap::vector(field, &expected.to_array(), &found.to_array(), &off);
            comparison.enter(&gap, Some(bound), precision, place);
        }
    }
}
