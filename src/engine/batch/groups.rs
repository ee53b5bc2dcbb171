//! Loads lane groups of bodies from columns and stores them.

use crate::bodies::columns::{INVARIANT_COLUMNS, RATE_COLUMN, STATE_COMPONENTS, parameter_columns, status_column};
use crate::kernel::method::projection::Combinations;
use crate::kernel::rigid_body::{Body, Invariants, State};
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, Scalar};
use crate::math::vector::{TwoWords, Vector};

/// The constants of a lane group and its reference rates; `column` loads a parameter column.
#[inline(always)]
pub(crate) fn load_body<R: Real>(column: impl Fn(usize) -> R) -> (Body<R>, R) {
    let value = Vector::new(column(0), column(1), column(2));
    let residue = if R::Scalar::WORDS == 2 { Vector::new(column(4), column(5), column(6)) } else { Vector::zero() };
    (Body::new(TwoWords { value, residue }), column(RATE_COLUMN))
}

/// The invariants of a lane group, or zeros if the method does not read them.
#[inline(always)]
pub(crate) fn load_invariants<R: Real>(wanted: bool, column: impl Fn(usize) -> R) -> Invariants<R> {
    if !wanted {
        return Invariants { angular_momentum_squared: R::splat(0.0), kinetic_energy: R::splat(0.0) };
    }
    let first = parameter_columns::<R::Scalar>();
    Invariants { angular_momentum_squared: column(first), kinetic_energy: column(first + 1) }
}

/// The combinations of a lane group, whose columns follow its invariants.
#[inline(always)]
pub(crate) fn load_combinations<R: Real>(column: impl Fn(usize) -> R) -> Combinations<R> {
    let first = parameter_columns::<R::Scalar>() + INVARIANT_COLUMNS;
    Combinations { first_second: column(first), second_third: column(first + 1), first_third: column(first + 2) }
}

/// The state of a lane group; `column` loads a state column.
#[inline(always)]
pub(crate) fn load_state<R: Real>(column: impl Fn(usize) -> R) -> State<R> {
    let words = |first: usize| {
        (
            Quaternion::new(column(first), column(first + 1), column(first + 2), column(first + 3)),
            Vector::new(column(first + 4), column(first + 5), column(first + 6)),
        )
    };
    let (q, m) = words(0);
    let (q_residue, m_residue) = if R::Scalar::WORDS == 2 {
        words(STATE_COMPONENTS)
    } else {
        let zero = R::splat(0.0);
        (Quaternion::new(zero, zero, zero, zero), Vector::zero())
    };
    State {
        orientation: TwoWords { value: q, residue: q_residue },
        angular_momentum_principal: TwoWords { value: m, residue: m_residue },
        status: column(status_column::<R::Scalar>()),
    }
}

/// Passes every state column of a lane group to `store`.
#[inline(always)]
pub(crate) fn store_state<R: Real>(state: &State<R>, mut store: impl FnMut(usize, R)) {
    let mut words = |first: usize, q: Quaternion<R>, m: Vector<R>| {
        for (column, number) in [q.x, q.y, q.z, q.w, m.x, m.y, m.z].into_iter().enumerate() {
            store(first + column, number);
        }
    };
    words(0, state.orientation.value, state.angular_momentum_principal.value);
    if R::Scalar::WORDS == 2 {
        words(STATE_COMPONENTS, state.orientation.residue, state.angular_momentum_principal.residue);
    }
    store(status_column::<R::Scalar>(), state.status);
}
