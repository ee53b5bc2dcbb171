//! Moves along a rotation on the host the centres of mass that a device would move.

use std::ops::Range;

use glam::{DQuat, DVec3};

use crate::bodies::BodyFrame;
use crate::bodies::columns::{PARAMETER_COMPONENTS, RATE_COLUMN, StateWords};
use crate::engine::batch::AnyBatch;
use crate::engine::controlled::Written;
use crate::engine::reduction::{BlockRows, Marked};
use crate::engine::session::answered_by;
use crate::engine::standby::{Reached, Standby};
use crate::engine::{End, Observer, Progress, Session};
use crate::error::Result;
use crate::kernel::observe::{Partial, Statistic};
use crate::math::Precision;
use crate::math::equal_steps::Interval;
use crate::math::parallel;
use crate::torque::force::Accelerations;
use crate::torque::force::carried::Carried;
use crate::torque::force::stepped::{Between, Centre};

/// A session of rigid bodies with their centres of mass.
pub(super) struct WithCentres {
    rotation: Box<dyn Standby>,
    rows: Vec<Row>,
}

/// One body.
struct Row {
    /// [`Accelerations::thrust_body`] in principal axes.
    forces: Accelerations,
    centre: Centre,
    /// The factors from the scaled angular momentum to the angular velocity, rad/s, in principal axes.
    angular_velocity: DVec3,
}

impl Row {
    /// Orientation and angular velocity (rad/s), both of the principal axes.
    fn turning(&self, scaled: [f64; 7]) -> (DQuat, DVec3) {
        let [x, y, z, w, mx, my, mz] = scaled;
        (DQuat::from_xyzw(x, y, z, w), self.angular_velocity * DVec3::new(mx, my, mz))
    }
}

impl WithCentres {
    /// For the bodies of a batch, whose rotation `rotation` steps.
    pub fn new(rotation: Box<dyn Standby>, batch: &AnyBatch, centres: &[Carried]) -> Self {
        let row = |(row, carried): (usize, &Carried)| {
            let inverse_moment = |axis: usize| {
                let value = batch.parameter(axis, row);
                match batch.precision() {
                    Precision::F32 => value + batch.parameter(PARAMETER_COMPONENTS + axis, row),
                    Precision::F64 => value,
                }
            };
            Row {
                forces: carried.forces,
                centre: Centre::new(carried.position, carried.velocity),
                angular_velocity: DVec3::from([0, 1, 2].map(inverse_moment)) * batch.parameter(RATE_COLUMN, row),
            }
        };
        Self { rotation, rows: centres.iter().enumerate().map(row).collect() }
    }
}

impl Standby for WithCentres {
    fn follow(&mut self, reached: &Reached, end: End) {
        self.rotation.follow(reached, end);
        let rows = self.rows.iter_mut().zip(&reached.centres);
        rows.for_each(|(row, &(position, velocity))| row.centre = Centre::new(position, velocity));
    }
}

impl Session for WithCentres {
    fn body_count(&self) -> usize {
        self.rotation.body_count()
    }

    fn advance_to(&mut self, end: End, observer: &mut Observer<'_>) -> Result<()> {
        let Interval { steps, dt } = end.steps;
        let bodies = self.body_count();
        let total = steps.saturating_mul(bodies as u64);
        let mut before = self.rotation.read(0..bodies)?;
        for step in 0..steps {
            let done = step.saturating_mul(bodies as u64);
            self.rotation.advance_to(End::of_steps(dt, 1), &mut |progress| {
                observer(Progress { done: done.saturating_add(progress.done), total })
            })?;
            let after = self.rotation.read(0..bodies)?;
            parallel::for_each_mut(&mut self.rows, parallel::OF_A_STEP, |index, row| {
                let [start, end] = [&before, &after].map(|states| row.turning(states.combined(index)));
                row.centre.advance(&row.forces, &Between::new(start, end, dt), dt);
            });
            before = after;
        }
        Ok(())
    }

    fn read_centres(&mut self, bodies: Range<usize>) -> Result<Vec<(DVec3, DVec3)>> {
        Ok(self.rows[bodies].iter().map(|row| (row.centre.position(), row.centre.velocity())).collect())
    }

    fn keep(&mut self, bodies: &[usize]) -> Result<()> {
        let mut kept = bodies.iter().copied().peekable();
        let mut place = 0;
        self.rows.retain(|_| {
            place += 1;
            kept.next_if_eq(&(place - 1)).is_some()
        });
        self.rotation.keep(bodies)
    }

    answered_by! {
        rotation:
        fn read(bodies: Range<usize>) -> Result<StateWords>;
        fn read_rows(rows: &[usize]) -> Result<StateWords>;
        fn watch(statistics: &[Statistic], frames: &[BodyFrame], blocks: &BlockRows, fastest: f64) -> Result<()>;
        fn reduce() -> Result<Vec<Vec<Partial<f64>>>>;
        fn marked() -> Result<Marked>;
        fn write_parameters(written: &Written) -> Result<()>;
    }
}
