//! How bodies turn under what changes them: internal dissipation and moments of inertia that change in time.

use super::{Epoch, Instance, Time, Torques};
use crate::bodies::columns::RATE_COLUMN;
use crate::kernel::rigid_body::{Body, Correction};
use crate::kernel::torque_kernel::Motion;
use crate::math::real::{Outlined, Real};
use crate::math::vector::{TwoWords, Vector};
use crate::torque::Kind;
use crate::torque::internal_dissipation::internal_dissipation;
use crate::torque::variable_inertia::{
    Change, changed_motion, inertia_oscillation, inertia_ramp, oscillation_slope, ramp_progress, ramp_slope,
};

impl<'a, R: Real> Torques<'a, R> {
    /// The progress of the ramp, cut to [0, 1], and its rate, 1/s.
    #[inline(always)]
    fn progress(&self, ramp: &Instance, time: &Time<'a, R>) -> (R, R) {
        let start = time.start_phases[ramp.first_phase].get();
        let rate = self.columns.column(ramp.rate_column(0));
        (ramp_progress(start, rate, time.elapsed), rate)
    }

    /// The part of the change of the moments of inertia that is done.
    #[inline(always)]
    fn change_done(&self, time: &Time<'a, R>) -> R {
        let table = self.columns.source.table;
        match (table.instance(Kind::InertiaRamp), table.instance(Kind::InertiaOscillation)) {
            (Some(ramp), _) => inertia_ramp(self.progress(ramp, time).0),
            (None, Some(oscillation)) => inertia_oscillation(self.phase(oscillation, 0, time)),
            (None, None) => R::splat(0.0),
        }
    }

    /// Its derivative by time, 1/s.
    #[inline(always)]
    fn change_rate(&self, time: &Time<'a, R>) -> R {
        let table = self.columns.source.table;
        match (table.instance(Kind::InertiaRamp), table.instance(Kind::InertiaOscillation)) {
            (Some(ramp), _) => {
                let (progress, rate) = self.progress(ramp, time);
                ramp_slope(progress) * rate
            }
            (None, Some(oscillation)) => {
                let rate = self.columns.column(oscillation.rate_column(0));
                oscillation_slope(self.phase(oscillation, 0, time)) * rate
            }
            (None, None) => R::splat(0.0),
        }
    }

    /// Its first column.
    #[inline(always)]
    pub(super) fn change_first(&self) -> usize {
        let ramp = self.columns.source.table.instances(Kind::InertiaRamp);
        if ramp.count > 0 { ramp.first } else { self.columns.source.table.instances(Kind::InertiaOscillation).first }
    }

    /// What the columns say of the change.
    #[inline(always)]
    fn change(&self) -> Change<R> {
        let first = self.change_first();
        Change {
            kappa: self.columns.vector(first),
            difference: TwoWords { value: self.columns.vector(first + 3), residue: self.columns.vector(first + 6) },
        }
    }

    /// The motion of a body that is not rigid, and ω = I⁻¹ m.
    #[inline(always)]
    pub(crate) fn turning(
        &self,
        change_done: R,
        body: &Body<R>,
        correction: &Correction<R>,
        m: Vector<R>,
    ) -> Turning<R> {
        let mut motion = if self.columns.source.table.varies_inertia() {
            changed_motion(body, &self.change(), change_done, correction, m)
        } else {
            let angular_velocity = body.angular_velocity(m, correction);
            Motion { angular_velocity, gyroscopic_term: body.gyroscopic_term(m, correction) }
        };
        let omega = motion.angular_velocity;
        if let Some(c) = self.merged(Kind::InternalDissipation) {
            let slip = internal_dissipation(self.columns.column(c), m, omega);
            motion = Motion {
                angular_velocity: motion.angular_velocity + slip,
                gyroscopic_term: motion.gyroscopic_term + m.cross(slip),
            };
        }
        Turning { motion, angular_velocity: omega }
    }

    /// As [`TorqueKernel::motion`], with ω = I⁻¹ m beside it.
    #[inline(always)]
    pub(crate) fn turning_at(
        &self,
        epoch: &Epoch<'a, R>,
        body: &Body<R>,
        correction: &Correction<R>,
        m: Vector<R>,
    ) -> Turning<R> {
        if self.columns.source.table.is_rigid() {
            let angular_velocity = body.angular_velocity(m, correction);
            let gyroscopic_term = body.gyroscopic_term(m, correction);
            return Turning { motion: Motion { angular_velocity, gyroscopic_term }, angular_velocity };
        }
        R::outlined(Turn { torques: self, change_done: epoch.change_done, body, correction, m: &m })
    }

    /// The power of what changes the moments, −½ ω·(dI/dt) ω, at ω = I⁻¹ m, in units of the body's own scale.
    #[inline(always)]
    pub(crate) fn change_power(&self, epoch: &Epoch<'a, R>, body: &Body<R>, angular_velocity: Vector<R>) -> R {
        if !self.columns.source.table.varies_inertia() {
            return R::splat(0.0);
        }
        R::outlined(ChangePower { torques: self, epoch, body, angular_velocity: &angular_velocity })
    }
}

/// A [`Motion`], and ω = I⁻¹ m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turning<R> {
    pub motion: Motion<R>,
    pub angular_velocity: Vector<R>,
}

/// [`Torques::turning`] as a function of its own.
struct Turn<'s, 'a, R: Real> {
    torques: &'s Torques<'a, R>,
    change_done: R,
    body: &'s Body<R>,
    correction: &'s Correction<R>,
    m: &'s Vector<R>,
}

impl<R: Real> Outlined for Turn<'_, '_, R> {
    type Output = Turning<R>;
    #[inline(always)]
    fn run(self) -> Turning<R> {
        self.torques.turning(self.change_done, self.body, self.correction, *self.m)
    }
}

/// [`Torques::change_done`] as a function of its own.
pub(super) struct ChangeDone<'s, 'a, R: Real> {
    pub torques: &'s Torques<'a, R>,
    pub time: &'s Time<'a, R>,
}

impl<R: Real> Outlined for ChangeDone<'_, '_, R> {
    type Output = R;
    #[inline(always)]
    fn run(self) -> R {
        self.torques.change_done(self.time)
    }
}

/// [`Torques::change_power`] as a function of its own.
struct ChangePower<'s, 'a, R: Real> {
    torques: &'s Torques<'a, R>,
    epoch: &'s Epoch<'a, R>,
    body: &'s Body<R>,
    angular_velocity: &'s Vector<R>,
}

impl<R: Real> Outlined for ChangePower<'_, '_, R> {
    type Output = R;
    #[inline(always)]
    fn run(self) -> R {
        let kappa = self.torques.change().kappa;
        let (one, inverse) = (R::splat(1.0), self.body.inverse_moments.value);
        // (I₁ − I₀) = I₀ (1/κ − 1).
        let difference = |kappa: R, inverse: R| (one / kappa - one) / inverse;
        let differences =
            Vector::new(difference(kappa.x, inverse.x), difference(kappa.y, inverse.y), difference(kappa.z, inverse.z));
        let omega = *self.angular_velocity;
        let rate = self.torques.change_rate(&self.epoch.time) / self.torques.columns.column(RATE_COLUMN);
        R::splat(-0.5) * rate * omega.dot(differences.scaled_by(omega))
    }
}
