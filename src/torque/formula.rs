//! The formula of a model, evaluated at every step: one text for all evaluators.
//!
//! A [`Formula`] is generic over [`Real`]: scalars are the reference and the shader's twin, SIMD lanes are the fast engine. Work that is
//! the same for every formula is a [`FormulaTask`], to which [`super::Kind::with`] passes the formula of a kind.

use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// The most phases of one instance.
pub(crate) const MOST_PHASES: usize = 4;

/// Rates of the phases of one instance in two words, rad/s: its own, then zeros.
pub(crate) type Rates = [(f64, f64); MOST_PHASES];

/// The rates of an instance with this many phases.
pub(crate) fn rates<const PHASES: usize>(own: [(f64, f64); PHASES]) -> Rates {
    std::array::from_fn(|phase| own.get(phase).copied().unwrap_or_default())
}

/// A parameter as kernels read it: one column or several side by side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Column {
    /// Its name in shaders.
    pub name: &'static str,
    /// Number of columns: 1, 3 or 4.
    pub numbers: usize,
}

impl Column {
    /// A number.
    pub const fn number(name: &'static str) -> Self {
        Self { name, numbers: 1 }
    }

    /// A vector.
    pub const fn vector(name: &'static str) -> Self {
        Self { name, numbers: 3 }
    }

    /// A quaternion, or two 32-bit words in columns of 16 bits each.
    pub const fn quaternion(name: &'static str) -> Self {
        Self { name, numbers: 4 }
    }
}

/// The parameter columns of one instance for one lane group, counted from its first.
pub(crate) trait Row<R: Real> {
    /// One column.
    fn number(&self, column: usize) -> R;

    /// Three columns.
    #[inline(always)]
    fn vector(&self, column: usize) -> Vector<R> {
        Vector::new(self.number(column), self.number(column + 1), self.number(column + 2))
    }

    /// Four columns.
    #[inline(always)]
    fn quaternion(&self, column: usize) -> Quaternion<R> {
        let vector = self.vector(column);
        Quaternion::new(vector.x, vector.y, vector.z, self.number(column + 3))
    }
}

/// What depends only on the time and the parameters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Epoch<R> {
    pub vector: Vector<R>,
    pub number: R,
}

impl<R: Real> Epoch<R> {
    /// For a model that does not depend on time.
    #[inline(always)]
    pub fn none() -> Self {
        Self { vector: Vector::zero(), number: R::splat(0.0) }
    }

    /// A vector alone.
    #[inline(always)]
    pub fn vector(vector: Vector<R>) -> Self {
        Self { vector, number: R::splat(0.0) }
    }

    /// A number alone.
    #[inline(always)]
    pub fn number(number: R) -> Self {
        Self { vector: Vector::zero(), number }
    }
}

/// What a model affects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// It is a torque: a term of the sum.
    Torque,
    /// It is a random torque, drawn once for each step.
    Noise,
    /// It adds to the rate at which the body's axes turn.
    Slip,
    /// It changes the moments of inertia.
    Moments,
    /// It changes the sum of all torques.
    Projection,
    /// It is a torque whose formula is data ([`super::expressed`]); the number of columns differs by instance.
    Expression,
}

/// The kernel of one kind of torque. All numbers are in principal axes and in the body's own units.
pub(crate) trait Formula {
    /// Stem of names in shaders.
    const STEM: &'static str;
    /// Its parameters as kernels read them, in the order of their columns.
    const COLUMNS: &'static [Column];
    /// Number of parameter columns.
    const PARAMETERS: usize = {
        let (mut count, mut index) = (0, 0);
        while index < Self::COLUMNS.len() {
            count += Self::COLUMNS[index].numbers;
            index += 1;
        }
        count
    };
    /// Names of its phases, each with its rate; for [`Role::Moments`] the phase may be a progress ([`Formula::IS_PROGRESS`]).
    const PHASES: &'static [&'static str] = &[];
    /// Whether the phase is the progress of a ramp, clamped to [0, 1], instead of a part of a turn.
    const IS_PROGRESS: bool = false;
    /// Whether several instances merge into one with the sum of their parameters.
    const MERGES: bool = false;
    /// What it affects.
    const ROLE: Role = Role::Torque;
    /// Whether the first three columns are the differences of the moments times the tenth column, so that they follow moments that change.
    const FOLLOWS_MOMENTS: bool = false;

    /// Whether [`Formula::epoch`] reads a column.
    #[inline(always)]
    fn epoch_reads(_column: usize) -> bool {
        false
    }

    /// What depends only on the time, at phases in turns.
    #[inline(always)]
    fn epoch<R: Real>(_row: &impl Row<R>, _phases: [R; MOST_PHASES]) -> Epoch<R> {
        Epoch::none()
    }

    /// The torque: that of any [`Role::Torque`], which does not compile without one; zero for the other roles.
    #[inline(always)]
    fn torque<R: Real>(
        _row: &impl Row<R>,
        _epoch: &Epoch<R>,
        _orientation: Quaternion<R>,
        _angular_velocity_principal: Vector<R>,
    ) -> Vector<R> {
        const { assert!(!matches!(Self::ROLE, Role::Torque), "a torque has a formula") };
        Vector::zero()
    }
}

/// Work that is written once for every formula.
pub(crate) trait FormulaTask {
    /// What the work returns.
    type Output;
    /// Does the work. Must be `#[inline(always)]` where it computes in lanes.
    fn run<F: Formula>(self) -> Self::Output;
}

/// A row whose first three columns follow the moments: `gained` is the increase of the differences of the moments.
pub(crate) struct Following<'s, R, W> {
    pub row: &'s W,
    pub gained: Vector<R>,
}

impl<R: Real, W: Row<R>> Row<R> for Following<'_, R, W> {
    #[inline(always)]
    fn number(&self, column: usize) -> R {
        let number = self.row.number(column);
        let factor = || self.row.number(9);
        match column {
            0 => self.gained.x.mul_add(factor(), number),
            1 => self.gained.y.mul_add(factor(), number),
            2 => self.gained.z.mul_add(factor(), number),
            _ => number,
        }
    }
}
