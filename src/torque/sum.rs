//! The sum of a scene's torques. Twin: `shaders/torque/sum.wgsl`.

mod columns;
mod noise;
mod turning;

pub(crate) use columns::{Columns, Source, StepTime, ticks_from};

use std::cell::Cell;

use super::Kind;
use super::expressed::{Given, Instructions};
use super::formula::{Following, Formula, FormulaTask, MOST_PHASES, Role, Row};
use super::linear_rotor::across_axis;
use super::table::Instance;
use super::variable_inertia::ChangeAt;
use crate::bodies::columns::RATE_COLUMN;
use crate::kernel::method::rk8_adaptive::Timed;
use crate::kernel::rigid_body::{Body, Correction};
use crate::kernel::torque_kernel::{Motion, TorqueKernel, VelocityDependence};
use crate::math::clock::phase_after;
use crate::math::lanes::Each;
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, outlined};
use crate::math::vector::{TwoWords, Vector};

/// A torque that is constant in body axes, and linear drag: the torques that most scenes have, held in registers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Common<R> {
    constant: Vector<R>,
    drag: R,
    /// Whether there is drag at all.
    dragged: bool,
}

impl<R: Real> Common<R> {
    /// The parameters of a lane group.
    #[inline(always)]
    pub(crate) fn load(columns: &Columns<'_, R>) -> Self {
        let constant = columns.source.table.instances(Kind::ConstantBody);
        let drag = columns.source.table.instances(Kind::LinearDrag);
        Self {
            constant: if constant.count == 0 { Vector::zero() } else { columns.vector(constant.first) },
            drag: if drag.count == 0 { R::splat(0.0) } else { columns.column(drag.first) },
            dragged: drag.count > 0,
        }
    }
}

impl<R: Real> TorqueKernel<R> for Common<R> {
    type Start = ();
    type Epoch = ();
    const FREE: bool = false;

    #[inline(always)]
    fn start(&self, _: u64) {}

    #[inline(always)]
    fn epoch(&self, (): &(), _: f64) {}

    #[inline(always)]
    fn torque(&self, _: &(), _: &Body<R>, _: Quaternion<R>, angular_velocity_principal: Vector<R>) -> Vector<R> {
        angular_velocity_principal.axpy(-self.drag, self.constant)
    }

    #[inline(always)]
    fn velocity_dependence(&self) -> VelocityDependence {
        if self.dragged { VelocityDependence::LinearDrag } else { VelocityDependence::None }
    }

    #[inline(always)]
    fn drag_coefficient(&self) -> R {
        self.drag
    }
}

/// Any number of torques of any kind, read from columns. The counts are the same for all bodies, so that each branch goes
/// the same way for a whole run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Torques<'a, R: Real> {
    columns: Columns<'a, R>,
}

/// The start of a step, and the random torque that is constant over it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StepStart<'a, R: Copy> {
    /// The phases at that time, in turns, by their number in the table.
    phases: &'a [Cell<R>],
    noise: Vector<R>,
    /// Seconds in the unit of later times; for adaptive steps a power of two.
    seconds: R,
}

/// A time, the random torque that is constant over the step containing it, and how far the moments of inertia have changed by then.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Epoch<'a, R: Copy> {
    time: Time<'a, R>,
    noise: Vector<R>,
    change: ChangeAt<R>,
}

/// A time after the start of a step, with its phases in turns.
#[derive(Clone, Copy, Debug)]
struct Time<'a, R: Copy> {
    start_phases: &'a [Cell<R>],
    /// Seconds since the start of the step.
    elapsed: R,
}

impl<'a, R: Real> Torques<'a, R> {
    /// The torques on a lane group.
    #[inline(always)]
    pub(crate) fn new(columns: Columns<'a, R>) -> Self {
        Self { columns }
    }

    /// The first column of the only instance of a kind whose instances merge.
    #[inline(always)]
    fn merged(&self, kind: Kind) -> Option<usize> {
        self.columns.source.table.instance(kind).map(|instance| instance.first)
    }

    #[inline(always)]
    fn phase(&self, instance: &Instance, phase: usize, time: &Time<'a, R>) -> R {
        let start = time.start_phases[instance.first_phase + phase].get();
        phase_after(start, self.columns.column(instance.rate_column(phase)), time.elapsed)
    }

    /// The torque of an instance that is an expression.
    #[inline(always)]
    fn expressed(&self, instance: &Instance, epoch: &Epoch<'a, R>, q: Quaternion<R>, omega: Vector<R>) -> Vector<R> {
        let table = self.columns.source.table;
        let ratio =
            if table.varies_inertia() { self.change().moment_ratio(epoch.change.share) } else { Vector::zero() };
        let state = (q, omega, ratio);
        self.evaluated(
            &table.expressed(instance.index).whole.instructions,
            instance.index,
            instance,
            &epoch.time,
            state,
        )
    }

    /// The three results of a formula that is data, from an instance's columns; `scratch` is the index of its working memory in the
    /// workspace.
    #[inline(always)]
    fn evaluated(
        &self,
        Instructions { program, inputs }: &Instructions,
        scratch: usize,
        instance: &Instance,
        time: &Time<'a, R>,
        (q, omega, ratio): (Quaternion<R>, Vector<R>, Vector<R>),
    ) -> Vector<R> {
        let table = self.columns.source.table;
        let Some(scratches) = self.columns.scratches else { return Vector::zero() };
        let mut scratches = scratches.borrow_mut();
        let Some(scratch) = scratches.get_mut(scratch) else { return Vector::zero() };
        let first = instance.first + instance.kind.parameters();
        for (index, given) in inputs.iter().enumerate() {
            scratch.input(index)[0] = match *given {
                Given::Column(column) => self.columns.column(first + column),
                Given::Phase(phase) => self.phase(instance, phase, time),
                Given::Time => time.start_phases[table.phase_count()].get() + time.elapsed,
                Given::Orientation(part) => [q.x, q.y, q.z, q.w][part],
                Given::AngularVelocity(part) => [omega.x, omega.y, omega.z][part],
                Given::MomentRatio(part) => [ratio.x, ratio.y, ratio.z][part],
                // The whole formula computes these itself.
                Given::Epoch(_) => R::splat(0.0),
                // Only series have them; other kernels do not get such a formula.
                Given::Position(_) | Given::Velocity(_) => R::splat(f64::NAN),
            };
        }
        let mut torque = [Each([R::splat(0.0)]); 3];
        program.run(scratch, &mut torque);
        let [Each([x]), Each([y]), Each([z])] = torque;
        Vector::new(x, y, z)
    }

    #[inline(always)]
    fn sum(
        &self,
        epoch: &Epoch<'a, R>,
        orientation: Quaternion<R>,
        angular_velocity_principal: Vector<R>,
    ) -> Vector<R> {
        let mut sum = epoch.noise;
        for &instance in self.columns.source.table.list() {
            let torques = self;
            sum = instance.kind.with(Added { torques, instance, epoch, orientation, angular_velocity_principal, sum });
        }
        sum
    }
}

/// Adds one more torque to a sum.
struct Added<'s, 'a, R: Real> {
    torques: &'s Torques<'a, R>,
    instance: Instance,
    epoch: &'s Epoch<'a, R>,
    orientation: Quaternion<R>,
    angular_velocity_principal: Vector<R>,
    sum: Vector<R>,
}

impl<R: Real> FormulaTask for Added<'_, '_, R> {
    type Output = Vector<R>;
    #[inline(always)]
    fn run<F: Formula>(self) -> Vector<R> {
        let Self { torques, instance, epoch, orientation: q, sum, .. } = self;
        let (omega, columns) = (self.angular_velocity_principal, &torques.columns);
        let row = InstanceRow { columns, first: instance.first };
        match F::ROLE {
            // Last of all: it applies to the whole sum.
            Role::Projection => across_axis(row.number(0), sum),
            Role::Torque => {
                let mut phases = [R::splat(0.0); MOST_PHASES];
                for (number, phase) in phases.iter_mut().enumerate().take(F::PHASES.len()) {
                    *phase = torques.phase(&instance, number, &epoch.time);
                }
                let at = F::epoch(&row, phases);
                if F::FOLLOWS_MOMENTS && columns.source.table.varies_inertia() {
                    let following = Following { row: &row, gained: epoch.change.gained };
                    return sum + F::torque(&following, &at, q, omega);
                }
                sum + F::torque(&row, &at, q, omega)
            }
            Role::Expression => sum + torques.expressed(&instance, epoch, q, omega),
            // White noise belongs to the epoch; dissipation and the moments belong to the motion.
            Role::Noise | Role::Slip | Role::Moments => sum,
        }
    }
}

/// The columns of one instance.
struct InstanceRow<'s, 'a, R: Real> {
    columns: &'s Columns<'a, R>,
    first: usize,
}

impl<R: Real> Row<R> for InstanceRow<'_, '_, R> {
    #[inline(always)]
    fn number(&self, column: usize) -> R {
        self.columns.column(self.first + column)
    }
}

impl<'a, R: Real> TorqueKernel<R> for Torques<'a, R> {
    type Start = StepStart<'a, R>;
    type Epoch = Epoch<'a, R>;
    const FREE: bool = false;

    #[inline(always)]
    fn start(&self, step: u64) -> StepStart<'a, R> {
        self.columns.form_start_phases(StepTime::Equal(step));
        StepStart { phases: self.columns.start_phases, noise: self.columns.noise(step), seconds: R::splat(1.0) }
    }

    #[inline(always)]
    fn epoch(&self, start: &StepStart<'a, R>, fraction: f64) -> Epoch<'a, R> {
        self.epoch_after(start, R::splat(fraction * self.columns.source.dt))
    }

    #[inline(always)]
    fn torque(
        &self,
        epoch: &Epoch<'a, R>,
        _: &Body<R>,
        orientation: Quaternion<R>,
        angular_velocity_principal: Vector<R>,
    ) -> Vector<R> {
        outlined!(R, self.sum(epoch, orientation, angular_velocity_principal))
    }

    #[inline(always)]
    fn velocity_dependence(&self) -> VelocityDependence {
        self.columns.source.table.velocity_dependence()
    }

    #[inline(always)]
    fn drag_coefficient(&self) -> R {
        match self.merged(Kind::LinearDrag) {
            Some(column) => self.columns.column(column),
            None => R::splat(0.0),
        }
    }

    #[inline(always)]
    fn motion(&self, epoch: &Epoch<'a, R>, body: &Body<R>, correction: &Correction<R>, m: Vector<R>) -> Motion<R> {
        self.motion_at(epoch, body, correction, m)
    }
}

impl<R: Real> Timed<R> for Common<R> {
    #[inline(always)]
    fn start_at(&self, _: TwoWords<R>) {}

    #[inline(always)]
    fn epoch_after(&self, (): &(), _: R) {}
}

impl<'a, R: Real> Timed<R> for Torques<'a, R> {
    #[inline(always)]
    fn start_at(&self, time: TwoWords<R>) -> StepStart<'a, R> {
        let seconds = R::splat(1.0) / self.columns.column(RATE_COLUMN);
        let time = TwoWords { value: time.value * seconds, residue: time.residue * seconds };
        self.columns.form_start_phases(StepTime::Own(&time));
        StepStart { phases: self.columns.start_phases, noise: Vector::zero(), seconds }
    }

    #[inline(always)]
    fn epoch_after(&self, start: &StepStart<'a, R>, elapsed: R) -> Epoch<'a, R> {
        let time = Time { start_phases: start.phases, elapsed: elapsed * start.seconds };
        let change = if self.columns.source.table.varies_inertia() {
            outlined!(R, self.change_at(&time))
        } else {
            ChangeAt::none()
        };
        Epoch { time, noise: start.noise, change }
    }
}
