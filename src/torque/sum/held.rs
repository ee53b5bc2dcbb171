//! One torque of a kind that time does not enter, with its parameters in registers.
//!
//! A class of bodies on which nothing else acts has a kernel of its own. In the kernel of every kind ([`super::Torques`]) the torque is a
//! function that each stage of a step calls, with all registers put by and taken up again; that takes ten times as long as most torques
//! themselves.

use super::{Instance, Kind, TorqueTable};
use crate::method::rk8_adaptive::Timed;
use crate::quaternion::Quaternion;
use crate::real::Real;
use crate::rigid_body::{Body, Correction};
use crate::torque::constant_world::constant_world;
use crate::torque::eddy_current::eddy_current;
use crate::torque::heavy_top::heavy_top;
use crate::torque::internal_dissipation::internal_dissipation;
use crate::torque::magnetic_dipole::magnetic_dipole;
use crate::torque::matrix_drag::matrix_drag;
use crate::torque::quadratic_drag::quadratic_drag;
use crate::torque::sine_spring::sine_spring;
use crate::torque::{Environment, Motion};
use crate::vector::{TwoWords, Vector};

/// Evaluates an expression with `KIND`, a constant, the number of the only torque's kind where it has a kernel of its own, and
/// `otherwise` where there are several torques, or one of another kind.
macro_rules! of_kinds {
    ($table:expr, $number:ident => $then:expr, $otherwise:expr) => {
        $crate::torque::sum::of_kinds!(@match $table, $number, $then, $otherwise,
            ConstantWorld MatrixDrag QuadraticDrag HeavyTop MagneticDipole EddyCurrent SineSpring InternalDissipation)
    };
    (@match $table:expr, $number:ident, $then:expr, $otherwise:expr, $($kind:ident)*) => {
        match $table.only_kind() {
            $(Some($crate::torque::Kind::$kind) => {
                const $number: usize = $crate::torque::Kind::$kind as usize;
                $then
            })*
            _ => $otherwise,
        }
    };
}
pub(crate) use of_kinds;

/// The most columns of a kind that is held.
const MOST_COLUMNS: usize = 6;

/// The torque of the kind with number `KIND`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Held<R, const KIND: usize> {
    columns: [R; MOST_COLUMNS],
}

impl<R: Real, const KIND: usize> Held<R, KIND> {
    /// The parameters of a lane group; `column` loads a parameter column.
    #[inline(always)]
    pub(crate) fn load(table: &TorqueTable, column: impl Fn(usize) -> R) -> Self {
        let mut columns = [R::splat(0.0); MOST_COLUMNS];
        if let Some(&Instance { first, .. }) = table.list().first() {
            for (index, held) in columns.iter_mut().enumerate().take(Kind::ALL[KIND].columns()) {
                *held = column(first + index);
            }
        }
        Self { columns }
    }

    #[inline(always)]
    fn is(kind: Kind) -> bool {
        KIND == kind as usize
    }

    #[inline(always)]
    fn vector(&self, first: usize) -> Vector<R> {
        Vector::new(self.columns[first], self.columns[first + 1], self.columns[first + 2])
    }
}

impl<R: Real, const KIND: usize> Environment<R> for Held<R, KIND> {
    type Epoch = ();
    const FREE: bool = false;

    #[inline(always)]
    fn epoch(&self, _: u64, _: f64) {}

    #[inline(always)]
    fn torque(&self, (): &(), _: &Body<R>, q: Quaternion<R>, omega: Vector<R>) -> Vector<R> {
        let c = &self.columns;
        if Self::is(Kind::ConstantWorld) {
            constant_world(self.vector(0), q)
        } else if Self::is(Kind::MatrixDrag) {
            matrix_drag(self.vector(0), self.vector(3), omega)
        } else if Self::is(Kind::QuadraticDrag) {
            quadratic_drag(c[0], omega)
        } else if Self::is(Kind::HeavyTop) {
            heavy_top(self.vector(0), self.vector(3), q)
        } else if Self::is(Kind::MagneticDipole) {
            magnetic_dipole(self.vector(0), self.vector(3), q)
        } else if Self::is(Kind::EddyCurrent) {
            eddy_current(c[0], self.vector(1), q, omega)
        } else if Self::is(Kind::SineSpring) {
            sine_spring(c[0], Quaternion::new(c[1], c[2], c[3], c[4]), q)
        } else {
            Vector::zero()
        }
    }

    #[inline(always)]
    fn motion(&self, (): &(), body: &Body<R>, correction: &Correction<R>, m: Vector<R>) -> Motion<R> {
        let omega = body.angular_velocity(m, correction);
        let rigid = Motion { angular_velocity: omega, gyroscopic_term: body.gyroscopic_term(m, correction) };
        if !Self::is(Kind::InternalDissipation) {
            return rigid;
        }
        let slip = internal_dissipation(self.columns[0], m, omega);
        Motion {
            angular_velocity: rigid.angular_velocity + slip,
            gyroscopic_term: rigid.gyroscopic_term + m.cross(slip),
        }
    }
}

impl<R: Real, const KIND: usize> Timed<R> for Held<R, KIND> {
    type Start = ();

    #[inline(always)]
    fn start_at(&self, _: TwoWords<R>) {}

    #[inline(always)]
    fn epoch_after(&self, (): &(), _: R) {}
}
