//! Taylor series of expressions, coefficient by coefficient (jets).
//!
//! With x(t₀ + h) = Σ x_k hᵏ, each operation gives its coefficient k from coefficients up to k of its operands, so that a system of
//! differential equations x' = f(x, t) gives its own series: x_{k+1} = f_k / (k + 1) (R. E. Moore, *Interval Analysis*, 1966,
//! chapter 11; À. Jorba, M. Zou, Experimental Mathematics 14 (2005) 99, section 2).
//!
//! ```text
//! c = p a + q b + …   c_k = p a_k + q b_k + …          p, q constant for each body
//! c = a b             c_k = Σ_{j=0}^{k} a_j b_{k−j}
//! c = a / b           c_k = (a_k − Σ_{j=1}^{k} b_j c_{k−j}) / b_0
//! c = √a              c_k = (a_k − Σ_{j=1}^{k−1} c_j c_{k−j}) / (2 c_0)
//! s, c = sin a, cos a k s_k = Σ_{j=1}^{k} j a_j c_{k−j},  k c_k = −Σ_{j=1}^{k} j a_j s_{k−j}
//! e = exp a           k e_k = Σ_{j=1}^{k} j a_j e_{k−j}
//! ```
//!
//! and others from the differential equations that they satisfy (`series.rs`). Decisions (the lesser of two numbers, a truth value, a
//! rounding) are made at t₀ and hold for the whole series; the differences whose signs decide are kept ([`Jets::switches`]), so
//! that a step can end where one changes sign.
//!
//! A graph is lowered (`lowering.rs`) to rows, one for each series, and operations on them, sorted so that those of one kind follow each
//! other. A sum of products is expanded only as far as that saves convolutions: factors that are constant for each body are pulled out;
//! quadratic forms of the attitude become linear in the entries of the rotation matrix, which one operation forms, or follow from
//! directions that are states (`lowering/directions.rs`); and terms with the same function of time as a factor are added up first. Rows
//! that no convolution reads keep only one coefficient. A tile of a few lane groups is carried through all operations of an order, then
//! through those of the next.

mod lowering;
mod polynomial;
mod series;
#[cfg(test)]
mod tests;

use super::graph::Input;
use super::program::Program;
use crate::math::real::Function;

pub(crate) use lowering::{Equations, Lowered, lowered, lowered_by_directions};
pub(crate) use series::Series;

/// The highest order of a series.
pub(crate) const MOST_ORDER: usize = 30;

/// From coefficients beyond this nothing is concluded.
pub(crate) const OVERFLOWING: f64 = 1e290;

/// A row by its number.
type RowNumber = u32;

/// The location of a row's coefficients: coefficient k is at `base + k * stride`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    base: u32,
    stride: u32,
}

impl Place {
    /// The location of coefficient k.
    #[inline(always)]
    fn at(self, order: usize) -> usize {
        (self.base + order as u32 * self.stride) as usize
    }
}

/// What an operation does with its rows; those that it writes come first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    /// to, terms: Σ factor · term, and a constant.
    Linear,
    /// The same for rows that have at most two coefficients.
    ShortLinear,
    /// to, a, b.
    Product,
    /// to, a, b, a, b, …: a sum of products.
    Products,
    /// Three sums; f, a, b, c, …: f times a, b and c is added to the first, second and third.
    VectorProducts,
    /// to, a.
    Square,
    /// b c, c a, a b; a, b, c.
    Triple,
    /// The entries of the matrix of a rotation, row by row; x, y, z, w.
    Rotation,
    /// As [`Kind::Linear`], at the start only.
    Start,
    /// to, 1/b; a, b.
    Quotient,
    /// to, 1/(2 to); a.
    Sqrt,
    /// sin, cos; a, where a has two coefficients.
    SinCosAffine,
    /// sin, cos, j a_j; a.
    SinCos,
    /// to, j a_j; a.
    Exp,
    /// to, to², j a_j; a, for the tangent.
    Tan,
    /// to, j to_j, 1/r; a, r: the function with the derivative a'/r.
    Primitive(Function),
    /// to, j to_j, j y_j, j x_j, 1/r; y, x, r = x² + y².
    Atan2,
    /// to, j a_j, j to_j, 1/a; a; the exponent is a factor.
    Power,
    /// sin E, cos E, j E_j, 1/(1 − e cos E); M; e is a factor.
    Kepler,
    /// to; a: 1 where a < 0 at the start, else 0.
    Below,
    /// to; a, b.
    And,
    /// to; a, b.
    Or,
    /// to; a.
    Not,
    /// to; a: the nearest integer at the start.
    Round,
    /// to; condition, a, b.
    Pick,
    /// x, x' = f: the coefficient after the present one.
    Integral,
    /// m, ω = i m, and further terms, the same number of rows for each axis: m' = g (m₂ m₃, m₃ m₁, m₁ m₂) + a m + c + Σ p · row. Factors g,
    /// i, a, c, p.
    Euler,
    /// x, y, z, w; components of ω: q' = ½ q ω.
    Attitude,
    /// d; ω: d' = d × ω.
    Direction,
    /// u, v; ω: u' = u × ω, v' = v × ω.
    TwoDirections,
    /// u, w; ω, t: u' = u × ω + n w, w' = w × ω − n u, where n is a factor times t'.
    Turning,
}

/// A vector of the world in body axes that is a state, in place of the orientation; `P` locates its rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DirectionState<P> {
    pub rows: [P; 3],
    /// The indices of the factors that hold the vector in the world; for one that turns, at the angle 0.
    pub world: [usize; 3],
    pub turning: Option<TurningState<P>>,
}

/// The vector a quarter of a turn ahead of one that turns uniformly.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TurningState<P> {
    pub rows: [P; 3],
    /// The indices of the factors that hold it in the world at the angle 0.
    pub world: [usize; 3],
    /// The angle, rad: the input that it follows, and the indices of its factor and its offset.
    pub angle: (Input, usize, usize),
}

/// A power of e or of another number, whose series tells nothing of what it is where it is large from where it is negligible: a pulse of
/// exp(−(t/s)²) is 10⁻⁴³ ten s before.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fading<P> {
    /// The power.
    pub power: P,
    /// Numbers that pass 0 where the power passes [`FADED`] and its reciprocal.
    pub levels: [P; 2],
}

/// The natural logarithm of a magnitude that is negligible beside those of which a torque is composed, with its sign turned.
pub(crate) const FADED: f64 = 60.0;

/// An operation: its rows are `rows` from `first` on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Operation {
    pub kind: Kind,
    pub first: usize,
    pub count: usize,
    /// Its first factor.
    pub factor: usize,
    /// The factor that is its constant term, if it has one.
    pub constant: Option<usize>,
}

/// Series of some expressions, ready to be computed up to an order.
#[derive(Clone, Debug)]
pub(crate) struct Jets {
    /// The highest coefficient of the states.
    pub order: usize,
    pub(super) operations: Vec<Operation>,
    /// How many operations of one kind follow each other.
    pub(super) runs: Vec<(Kind, usize)>,
    pub(super) rows: Vec<Place>,
    /// The numbers of the operations' factors, in the order of their use.
    pub(super) factor_numbers: Vec<usize>,
    /// The memory for coefficients of all rows.
    pub(super) room: usize,
    /// The program that computes the factors from parameters.
    pub factors: Program,
    /// Rows that the caller initialises: a state with its value, a time with its value and its rate.
    pub given: Vec<(Input, Place)>,
    /// Results.
    pub outputs: Vec<Place>,
    /// The differences whose signs decide.
    pub switches: Vec<Place>,
    /// What square roots are taken of: where it is 0, they have no series.
    pub roots: Vec<Place>,
    /// What may fade until its series no longer show it.
    pub fading: Vec<Fading<Place>>,
    /// Directions that are states, which the caller initialises.
    pub directions: Vec<DirectionState<Place>>,
}

impl Jets {
    /// The operation of Euler's equations, if the angular velocity is all that follows from the states.
    fn euler_alone(&self) -> Option<&Operation> {
        let (last, others) = self.operations.split_last()?;
        let is_alone = others.len() == 3 && others.iter().all(|operation| operation.kind == Kind::Start);
        (last.kind == Kind::Euler && last.count == 6 && is_alone).then_some(last)
    }

    /// The location of an input's row.
    pub fn input(&self, input: Input) -> Option<Place> {
        self.given.iter().find(|(given, _)| *given == input).map(|(_, place)| *place)
    }
}
