//! The rotation of bodies that are not rigid: internal dissipation and moments of inertia that change in time.

use super::{Epoch, Instance, InstanceRow, Instructions, Time, Torques};
use crate::bodies::columns::RATE_COLUMN;
use crate::kernel::rigid_body::{Body, Correction};
use crate::kernel::torque_kernel::Motion;
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, outlined};
use crate::math::vector::Vector;
use crate::torque::Kind;
use crate::torque::internal_dissipation::internal_dissipation;
use crate::torque::variable_inertia::{
    Change, ChangeAt, changed_motion, inertia_oscillation, inertia_ramp, oscillation_slope, ramp_progress, ramp_slope,
};

impl<'a, R: Real> Torques<'a, R> {
    /// The progress of the ramp, clamped to [0, 1], and its rate, 1/s.
    #[inline(always)]
    fn progress(&self, ramp: &Instance, time: &Time<'a, R>) -> (R, R) {
        let start = time.start_phases[ramp.first_phase].get();
        let rate = self.columns.column(ramp.rate_column(0));
        (ramp_progress(start, rate, time.elapsed), rate)
    }

    /// How far the moments of inertia have changed.
    #[inline(always)]
    pub(super) fn change_at(&self, time: &Time<'a, R>) -> ChangeAt<R> {
        let table = self.columns.source.table;
        let Some(change) = table.change() else { return ChangeAt::none() };
        let row = self.row(change);
        match change.kind {
            Kind::InertiaRamp => ChangeAt::by_law(&row, inertia_ramp(self.progress(change, time).0)),
            Kind::InertiaOscillation => ChangeAt::by_law(&row, inertia_oscillation(self.phase(change, 0, time))),
            _ => {
                let Some(formula) = table.formula_of_moments() else { return ChangeAt::none() };
                // Its scratch memory follows those of the torques.
                let scratch = table.expressions().len() - 1;
                ChangeAt::by_formula(&row, self.of_time(&formula.whole.instructions, scratch, change, time))
            }
        }
    }

    /// The time derivatives of the principal moments, in units of the body's own scale and per second.
    #[inline(always)]
    fn moment_rates(&self, time: &Time<'a, R>, body: &Body<R>, share: Vector<R>) -> Vector<R> {
        let table = self.columns.source.table;
        let Some(change) = table.change() else { return Vector::zero() };
        let (one, inverse) = (R::splat(1.0), body.inverse_moments.value);
        let rate_of_law = match change.kind {
            Kind::InertiaRamp => {
                let (progress, rate) = self.progress(change, time);
                ramp_slope(progress) * rate
            }
            Kind::InertiaOscillation => {
                let rate = self.columns.column(change.rate_column(0));
                oscillation_slope(self.phase(change, 0, time)) * rate
            }
            _ => {
                let Some(formula) = table.formula_of_moments() else { return Vector::zero() };
                let slopes = self.of_time(&formula.slopes, table.expressions().len(), change, time);
                // I = I₀/(1 + σ).
                let rate = |slope: R, share: R, inverse: R| slope / ((one + share) * inverse);
                return Vector::new(
                    rate(slopes.x, share.x, inverse.x),
                    rate(slopes.y, share.y, inverse.y),
                    rate(slopes.z, share.z, inverse.z),
                );
            }
        };
        // I₁ − I₀ = I₀ (1/κ − 1).
        let kappa = self.change().kappa;
        let difference = |kappa: R, inverse: R| (one / kappa - one) / inverse;
        Vector::new(difference(kappa.x, inverse.x), difference(kappa.y, inverse.y), difference(kappa.z, inverse.z))
            * rate_of_law
    }

    /// The results of a formula that depends only on time.
    #[inline(always)]
    fn of_time(&self, formula: &Instructions, scratch: usize, change: &Instance, time: &Time<'a, R>) -> Vector<R> {
        let zero = R::splat(0.0);
        let state = (Quaternion::new(zero, zero, zero, zero), Vector::zero(), Vector::zero());
        self.evaluated(formula, scratch, change, time, state)
    }

    #[inline(always)]
    fn row(&self, instance: &Instance) -> InstanceRow<'_, 'a, R> {
        InstanceRow { columns: &self.columns, first: instance.first }
    }

    /// The change given by the columns; not called if there is none.
    #[inline(always)]
    pub(super) fn change(&self) -> Change<R> {
        let first = self.columns.source.table.change().map_or(0, |change| change.first);
        Change::of_row(&InstanceRow { columns: &self.columns, first })
    }

    /// The motion of a body that is not rigid.
    #[inline(always)]
    pub(crate) fn motion_of(
        &self,
        share: Vector<R>,
        body: &Body<R>,
        correction: &Correction<R>,
        m: Vector<R>,
    ) -> Motion<R> {
        let motion = if self.columns.source.table.varies_inertia() {
            changed_motion(body, &self.change(), share, correction, m)
        } else {
            Motion::rigid(body.angular_velocity(m, correction), body.gyroscopic_term(m, correction))
        };
        match self.merged(Kind::InternalDissipation) {
            Some(c) => {
                let slip = internal_dissipation(self.columns.column(c), m, motion.angular_velocity);
                motion.with_slip(m, slip)
            }
            None => motion,
        }
    }

    /// As [`TorqueKernel::motion`].
    #[inline(always)]
    pub(crate) fn motion_at(
        &self,
        epoch: &Epoch<'a, R>,
        body: &Body<R>,
        correction: &Correction<R>,
        m: Vector<R>,
    ) -> Motion<R> {
        if self.columns.source.table.is_rigid() {
            return Motion::rigid(body.angular_velocity(m, correction), body.gyroscopic_term(m, correction));
        }
        outlined!(R, self.motion_of(epoch.change.share, body, correction, m))
    }

    /// The power of the mechanism that changes the moments, −½ ω·(dI/dt) ω, at ω = I⁻¹ m, in units of the body's own scale.
    #[inline(always)]
    pub(crate) fn change_power(&self, epoch: &Epoch<'a, R>, body: &Body<R>, angular_velocity: Vector<R>) -> R {
        if !self.columns.source.table.varies_inertia() {
            return R::splat(0.0);
        }
        outlined!(R, {
            let rates = self.moment_rates(&epoch.time, body, epoch.change.share);
            let twice = angular_velocity.dot(rates.scaled_by(angular_velocity));
            R::splat(-0.5) * twice / self.columns.column(RATE_COLUMN)
        })
    }
}
