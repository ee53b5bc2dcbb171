//! The columns in which bodies are stored: which numbers a body has, in which order, and rows of them.
//!
//! Component c of body i is at `c * stride + i`. If a number is carried in two words, its residue is `residue` columns further on; in `f64`
//! there are no residue columns.

use std::ops::Range;

use super::Status;
use crate::math::parallel;
use crate::math::real::Scalar;

/// Columns of the state: orientation x, y, z, w, then angular momentum x, y, z.
pub const STATE_COMPONENTS: usize = 7;
/// Columns of the parameters: 1/I₁, 1/I₂, 1/I₃, then the reference rate; residues of 1/I follow in `f32`.
pub(crate) const PARAMETER_COMPONENTS: usize = 4;

/// The parameter column of the reference rate, rad/s: a power of two.
pub(crate) const RATE_COLUMN: usize = 3;

/// Number of state columns of an element type: the components' words, then the status.
pub const fn state_columns<T: Scalar>() -> usize {
    STATE_COMPONENTS * T::WORDS + 1
}

/// The state column that holds the number of a [`Status`].
pub(crate) const fn status_column<T: Scalar>() -> usize {
    STATE_COMPONENTS * T::WORDS
}

/// Columns that [`crate::engine::batch::Batch::append_invariants`] adds to the parameters: |m|² and the kinetic energy at the start.
pub const INVARIANT_COLUMNS: usize = 2;

/// Number of additional state columns of bodies whose centre of mass is integrated with the rotation, m and m/s, world axes: position x, y,
/// z, velocity x, y, z, then the rounding error of each sum.
pub(crate) const CENTRE_COLUMNS: usize = 12;

/// Number of parameter columns of an element type.
pub const fn parameter_columns<T: Scalar>() -> usize {
    PARAMETER_COMPONENTS + 3 * (T::WORDS - 1)
}

/// The number of bodies of which a stride is a multiple, itself a multiple of every lane count and of the workgroup size.
pub const STRIDE_UNIT: usize = 64;

/// The stride of the columns of so many bodies in the host's memory. Columns that are a power of two apart would all compete for the same few
/// lines of a cache, so of large strides each is an odd number of units.
pub fn stride_of(bodies: usize) -> usize {
    /// Strides of fewer units are small.
    const FEW: usize = 16;
    let units = bodies.div_ceil(STRIDE_UNIT);
    STRIDE_UNIT * if units < FEW { units } else { units | 1 }
}

/// The raw state of some bodies, exactly as an engine holds it, in `f64`.
///
/// Columns as in [`crate::engine::batch::Batch::state`], one row a body: x, y, z, w of the orientation (principal axes to world), then the
/// angular momentum in principal axes, scaled.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StateWords {
    /// First words.
    pub value: Vec<[f64; STATE_COMPONENTS]>,
    /// Second words; none in `f64`.
    pub residue: Vec<[f64; STATE_COMPONENTS]>,
    /// The status of each body so far.
    pub status: Vec<Status>,
}

impl StateWords {
    /// Number of bodies.
    pub fn len(&self) -> usize {
        self.value.len()
    }

    /// Whether there are no bodies.
    pub fn is_empty(&self) -> bool {
        self.value.is_empty()
    }

    /// The state of some bodies.
    ///
    /// # Panics
    ///
    /// If there are not so many.
    pub fn part(&self, bodies: Range<usize>) -> Self {
        let of = |words: &[[f64; STATE_COMPONENTS]]| words.get(bodies.clone()).unwrap_or_default().to_vec();
        Self {
            value: self.value[bodies.clone()].to_vec(),
            residue: of(&self.residue),
            status: self.status[bodies.clone()].to_vec(),
        }
    }

    /// The second words of one body: zeros where there are none.
    pub fn residue_of(&self, body: usize) -> [f64; STATE_COMPONENTS] {
        self.residue.get(body).copied().unwrap_or_default()
    }

    /// The state of one body, both words added.
    pub fn combined(&self, body: usize) -> [f64; STATE_COMPONENTS] {
        let residue = self.residue_of(body);
        std::array::from_fn(|component| self.value[body][component] + residue[component])
    }
}

/// Passes each number of one body's scaled parameters and state, with its column, to `parameter` and `component`.
pub(crate) fn store_row<T: Scalar>(
    parameters: &[f64; PARAMETER_COMPONENTS],
    state: &[f64; STATE_COMPONENTS],
    mut parameter: impl FnMut(usize, T),
    mut component: impl FnMut(usize, T),
) {
    for (column, &number) in parameters.iter().enumerate() {
        let (value, residue) = T::two_words(number);
        parameter(column, value);
        if T::WORDS == 2 && column < 3 {
            parameter(PARAMETER_COMPONENTS + column, residue);
        }
    }
    for (column, &number) in state.iter().enumerate() {
        let (value, residue) = T::two_words(number);
        component(column, value);
        if T::WORDS == 2 {
            component(STATE_COMPONENTS + column, residue);
        }
    }
}

/// Moves some rows, ascending, of columns that are `stride` apart to the front, in their order; the rows after them no longer belong to any
/// body.
pub(crate) fn keep_rows<T: Copy + Send>(columns: &mut [T], stride: usize, rows: &[usize]) {
    if stride > 0 {
        parallel::for_each_task(columns.chunks_exact_mut(stride), |_, column| {
            rows.iter().enumerate().for_each(|(to, &from)| column[to] = column[from]);
        });
    }
}

/// Some rows of every column.
pub(crate) type ColumnPart<'a, T> = Vec<&'a mut [T]>;

/// Cuts the given rows of columns that are `stride` apart into parts of `count` rows.
pub(crate) fn column_parts<T>(
    columns: &mut [T],
    stride: usize,
    rows: Range<usize>,
    count: usize,
) -> Vec<ColumnPart<'_, T>> {
    let number = columns.len().checked_div(stride).unwrap_or(0);
    let mut parts: Vec<_> = (0..rows.len().div_ceil(count)).map(|_| Vec::with_capacity(number)).collect();
    if stride > 0 {
        for column in columns.chunks_exact_mut(stride) {
            for (part, rows) in parts.iter_mut().zip(column[rows.clone()].chunks_mut(count)) {
                part.push(rows);
            }
        }
    }
    parts
}
