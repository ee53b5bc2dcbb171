//! Statistics of an ensemble: a quantity of each body, reduced to count, mean, spread and extremes.
//!
//! Twin: `shaders/observe.wgsl`; [`Kernel`] holds what depends on the precision (`shaders/observe_f32.wgsl` and
//! `shaders/observe_f64.wgsl`).
//!
//! # How a mean over bodies of any scale is formed
//!
//! Each body is measured in units of its own ([`crate::engine::batch`]), so that energies in one ensemble may differ by a factor of 2²⁷⁹
//! and more. A quantity is therefore a mantissa and an exponent of two, and so are sums of it: [`Partial`] holds mean and sum of squared
//! deviations as multiples of the power of two of its greatest member; members too small for the precision next to that one do not matter.
//! Extremes are compared by exponent first, so that the least is as accurate as the greatest.
//!
//! Partial results are merged in pairs by the update of Chan, Golub and LeVeque (*Algorithms for computing the sample variance*, The
//! American Statistician 37, 1983, equation 2.1), which forms no difference of large sums; the mean is carried in two words in `f32`.
//! Bodies are cut into [blocks](crate::bodies::Blocks), and each block into pieces of at most 1,024 bodies that are treated alike. Each of
//! the 64 lanes of a workgroup merges 16 bodies of a piece, one after the other; then the lanes are merged as a tree. The pieces of a
//! block, the block's other groups, and then the blocks are merged as a tree in their order, in `f64`, on the host (`merge_all`). So the
//! result does not depend on threads, chunks, or the number of parts in which an ensemble is run.
//!
//! # Error
//!
//! With u half an ulp of 1, the relative error of one body's quantity is at most [`VALUE_ROUNDINGS`] u. A merge adds at most
//! [`MERGE_ROUNDINGS`] u of the mean (all quantities are positive or zero, so that a share of the difference of two means is no more than
//! the mean of both), and no body passes through more than [`MERGES`] of them. So the relative error of the mean is at most
//! [`error_bound`]. The standard deviation is a seminorm of the values: its error is at most [`error_bound`] of the root mean square.

use std::ops::Range;

use crate::bodies::BodyFrame;
use crate::bodies::columns::STRIDE_UNIT;
use crate::math::Precision;
use crate::math::power_of_two::{binary_exponent, scaled_by_power_of_two};
use crate::math::real::{Real, Scalar};
use crate::math::vector::Vector;

mod statistic;

pub use statistic::Statistic;

/// Roundings in the quantity of a body: seven of words and products of a squared component (whether or not the root halves
/// them), and nine of the root itself, for which Vulkan allows 4.5 ulp in 32 bits.
pub const VALUE_ROUNDINGS: u32 = 16;

/// Roundings in a merge of two means: three of the difference, three of its share (Vulkan's division is within 2.5 ulp) and the product.
pub const MERGE_ROUNDINGS: u32 = 7;

/// Merges between a body and the total: sixteen in its lane, six in its workgroup; six for the pieces of its block, seven for bodies that
/// are treated otherwise and eleven for the blocks, in `f64`.
pub const MERGES: u32 = 16 + 6 + 6 + 7 + 11;

/// The greatest error of statistics that are formed where the states are, compared with exact arithmetic on the same states: the
/// mean, relative to itself; the standard deviation, relative to the root mean square; extremes, relative to themselves.
pub fn error_bound(precision: Precision) -> f64 {
    let roundings = f64::from(VALUE_ROUNDINGS + MERGE_ROUNDINGS * MERGES);
    roundings
        * match precision {
            Precision::F32 => f32::UNIT_ROUNDOFF,
            Precision::F64 => f64::UNIT_ROUNDOFF,
        }
}

/// Number of lanes in a workgroup, whose results are merged as a tree.
pub(crate) const WORKGROUP: usize = STRIDE_UNIT;

/// Number of bodies that a lane merges before that.
const BODIES_PER_LANE: usize = 16;

/// The most bodies of a piece, which one workgroup reduces.
pub(crate) const GROUP_BODIES: usize = WORKGROUP * BODIES_PER_LANE;

/// Columns before those of the scales: 1/I₁, 1/I₂, 1/I₃, and the spin rate beyond which a body is marked.
pub(crate) const SCALE_COLUMN: usize = 4;

/// mantissa · 2^exponent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaled<T> {
    /// The mantissa.
    pub mantissa: T,
    /// The exponent of two.
    pub exponent: i32,
}

/// The exponent of zero, below all others.
pub(crate) const ZERO_EXPONENT: i32 = -16384;

/// Operations and constants of a precision that the kernels need.
pub trait Kernel: Scalar {
    /// A unit of 2^`exponent` as a column holds it; `common` is the greatest of its column.
    fn scale(exponent: i32, common: i32) -> Self;
    /// The exponent to which those of a column are relative.
    fn offset(common: i32) -> i32;
    /// `x` in units of `scale` and of 2^`exponent`.
    fn normalised(x: Self, scale: Self, exponent: i32) -> Scaled<Self>;
    /// The exponent of the power of two that brings `x` near 1.
    fn exponent_of(x: Self) -> i32;
    /// 2^n; 0 where that is below the precision's range.
    fn power_of_two(n: i32) -> Self;
}

/// Mantissas in [1, 2), exponents of any size.
impl Kernel for f32 {
    fn scale(exponent: i32, _: i32) -> Self {
        exponent as Self
    }
    fn offset(_: i32) -> i32 {
        0
    }
    fn normalised(x: Self, scale: Self, exponent: i32) -> Scaled<Self> {
        let field = (x.to_bits() >> 23) & 0xff;
        if field == 0 {
            return Scaled { mantissa: 0.0, exponent: ZERO_EXPONENT };
        }
        Scaled {
            mantissa: Self::from_bits((x.to_bits() & 0x007f_ffff) | 0x3f80_0000),
            exponent: field as i32 - 127 + exponent + scale as i32,
        }
    }
    fn exponent_of(x: Self) -> i32 {
        let field = (x.to_bits() >> 23) & 0xff;
        (field as i32 - 127).clamp(-126, 126)
    }
    fn power_of_two(n: i32) -> Self {
        if n < -126 { 0.0 } else { Self::from_bits(((n + 127) as u32) << 23) }
    }
}

/// The range of `f64` covers all scales, so that all exponents of a column are equal.
impl Kernel for f64 {
    fn scale(exponent: i32, common: i32) -> Self {
        scaled_by_power_of_two(1.0, exponent - common)
    }
    fn offset(common: i32) -> i32 {
        common
    }
    fn normalised(x: Self, scale: Self, _: i32) -> Scaled<Self> {
        Scaled { mantissa: x * scale, exponent: 0 }
    }
    fn exponent_of(_: Self) -> i32 {
        0
    }
    fn power_of_two(n: i32) -> Self {
        if n < -1022 { 0.0 } else { Self::from_bits(((n + 1023) as u64) << 52) }
    }
}

/// What the kernels read beside the state, by column.
pub(crate) struct Columns<T> {
    pub stride: usize,
    pub columns: Vec<T>,
    /// The reference exponents of each statistic, for each part of the rows.
    pub offsets: Vec<Vec<i32>>,
}

/// The most bytes that [`Columns`] take for one body.
pub(crate) fn bytes_per_body(statistics: usize) -> usize {
    (SCALE_COLUMN + statistics) * size_of::<f64>()
}

impl<T: Kernel> Columns<T> {
    /// The columns of rows, each with its body's frame; `parts` are ranges of rows whose columns depend only on themselves. A body
    /// that spins faster than `fastest` rad/s is marked. A workgroup of rows may begin at any row.
    pub fn new<'a>(
        statistics: &[Statistic],
        rows: usize,
        frame: impl Fn(usize) -> &'a BodyFrame,
        parts: &[Range<usize>],
        fastest: f64,
    ) -> Self {
        let stride = rows.next_multiple_of(STRIDE_UNIT) + WORKGROUP;
        let mut columns = vec![T::default(); (SCALE_COLUMN + statistics.len()) * stride];
        for row in 0..rows {
            let frame = frame(row);
            let inverse = frame.scaled_moments.recip();
            // A linear rotor has no spin about its axis; the spin that a method gives it does not count.
            let inverse = if frame.is_linear_rotor { inverse.with_x(0.0) } else { inverse };
            for (axis, inverse) in inverse.to_array().into_iter().enumerate() {
                columns[axis * stride + row] = T::from_f64(inverse);
            }
            // Greater than in any state of finite numbers.
            let limit = scaled_by_power_of_two(fastest, -frame.rate_exponent).min(1e30);
            columns[3 * stride + row] = T::from_f64(limit);
        }
        let mut offset = |part: &Range<usize>, (index, statistic): (usize, &Statistic)| {
            let common = part.clone().map(|row| statistic.exponent(frame(row))).max().unwrap_or(0);
            for row in part.clone() {
                columns[(SCALE_COLUMN + index) * stride + row] = T::scale(statistic.exponent(frame(row)), common);
            }
            T::offset(common)
        };
        let mut of_part = |part| statistics.iter().enumerate().map(|statistic| offset(part, statistic)).collect();
        let offsets = parts.iter().map(&mut of_part).collect();
        Self { stride, columns, offsets }
    }
}

/// A body's quantity at one end of the range.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize, serde::Deserialize))]
pub struct Extreme<T> {
    /// In [1, 2) if extremes of different exponents are compared.
    pub mantissa: T,
    /// The quantity is mantissa · 2^exponent.
    pub exponent: i32,
    /// The body that has it.
    pub body: u32,
}

/// Statistics of some bodies: multiples of 2^`exponent`, or of its square.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize, serde::Deserialize))]
pub struct Partial<T> {
    /// Bodies that did not fail.
    pub count: u32,
    /// The number of those bodies that are marked as spinning too fast.
    pub faster: u32,
    /// The exponent of the unit of what follows.
    pub exponent: i32,
    /// The mean, in two words.
    pub mean: T,
    /// Its second word.
    pub residue: T,
    /// The sum of squared deviations from the mean.
    pub squares: T,
    /// The least; without bodies it is meaningless.
    pub least: Extreme<T>,
    /// The greatest.
    pub greatest: Extreme<T>,
}

impl<T: Kernel> Partial<T> {
    /// The statistics of no body.
    pub(crate) fn none() -> Self {
        let zero = T::default();
        let extreme = Extreme { mantissa: zero, exponent: 0, body: 0 };
        Self {
            count: 0,
            faster: 0,
            exponent: 0,
            mean: zero,
            residue: zero,
            squares: zero,
            least: extreme,
            greatest: extreme,
        }
    }

    /// The statistics of one body.
    pub(crate) fn of_body(x: Scaled<T>, body: u32, faster: bool) -> Self {
        let extreme = Extreme { mantissa: x.mantissa, exponent: x.exponent, body };
        Self {
            count: 1,
            faster: u32::from(faster),
            exponent: x.exponent,
            mean: x.mantissa,
            residue: T::default(),
            squares: T::default(),
            least: extreme,
            greatest: extreme,
        }
    }
}

fn is_less<T: Kernel>(a: Extreme<T>, b: Extreme<T>) -> bool {
    a.exponent < b.exponent || (a.exponent == b.exponent && a.mantissa < b.mantissa)
}

/// The statistics of both; of equal extremes the first is kept.
pub(crate) fn merge<T: Kernel>(a: Partial<T>, b: Partial<T>) -> Partial<T> {
    if b.count == 0 {
        return a;
    }
    if a.count == 0 {
        return b;
    }
    let exponent = a.exponent.max(b.exponent);
    let a_scale = T::power_of_two(a.exponent - exponent);
    let b_scale = T::power_of_two(b.exponent - exponent);
    let number = |count: u32| T::from_f64(f64::from(count));
    let share = number(b.count) / number(a.count + b.count);
    let mean = a.mean * a_scale;
    let residue = a.residue * a_scale;
    let difference = (b.mean * b_scale - mean) + (b.residue * b_scale - residue);
    let corrected = difference * share + residue;
    let sum = mean + corrected;
    let squares = (a.squares * a_scale) * a_scale + (b.squares * b_scale) * b_scale;
    Partial {
        count: a.count + b.count,
        faster: a.faster + b.faster,
        exponent,
        mean: sum,
        residue: corrected - (sum - mean),
        squares: squares + difference * difference * (number(a.count) * share),
        least: if is_less(b.least, a.least) { b.least } else { a.least },
        greatest: if is_less(a.greatest, b.greatest) { b.greatest } else { a.greatest },
    }
}

/// The statistics of all, merged as a tree in their order.
pub(crate) fn merge_all<T: Kernel>(partials: &[Partial<T>]) -> Partial<T> {
    match partials {
        [] => Partial::none(),
        [one] => *one,
        several => {
            let (first, second) = several.split_at(several.len().next_power_of_two() / 2);
            merge(merge_all(first), merge_all(second))
        }
    }
}

/// The statistics of all, merged in the order of a workgroup's tree.
pub(crate) fn merge_tree<T: Kernel>(mut partials: [Partial<T>; WORKGROUP]) -> Partial<T> {
    let mut half = WORKGROUP / 2;
    while half > 0 {
        for lane in 0..half {
            partials[lane] = merge(partials[lane], partials[lane + half]);
        }
        half /= 2;
    }
    partials[0]
}

/// The angular momentum without the spin that a method may give a linear rotor about its axis, whose inverse moment is zero
/// here.
#[inline(always)]
pub(crate) fn without_axis<R: Real>(inverse_moments: Vector<R>, m: Vector<R>) -> Vector<R> {
    let zero = R::splat(0.0);
    Vector { x: R::select(zero.less_than(inverse_moments.x), m.x, zero), ..m }
}

/// The quantity of angular momentum `m` in a body's own scale.
#[inline(always)]
pub(crate) fn quantity<R: Real>(statistic: Statistic, inverse_moments: Vector<R>, m: Vector<R>) -> R {
    let omega = inverse_moments.scaled_by(m);
    match statistic {
        Statistic::KineticEnergy => R::splat(0.5) * m.dot(omega),
        Statistic::SpinRate => omega.dot(omega).sqrt(),
        Statistic::AngularMomentum => m.dot(m).sqrt(),
    }
}

/// The statistics of a piece of `count` bodies, formed as in a workgroup of the shader: `row` gives what is read of each body, or `None`
/// where there is no sound body.
pub(crate) fn observe<T: Kernel>(
    statistics: &[Statistic],
    row: impl Fn(usize) -> Option<ObservedRow<T>>,
    (first, count): (u32, usize),
) -> Vec<Partial<T>> {
    let of_statistic = |(index, &statistic): (usize, &Statistic)| {
        let of_body = |offset: usize| {
            let Some(row) = row(offset) else { return Partial::none() };
            let (m, exponent) = row.near_one();
            let x = quantity(statistic, row.inverse_moments, m);
            let x = T::normalised(x, row.scales[index], statistic.degree() * exponent);
            Partial::of_body(x, first + offset as u32, row.is_faster())
        };
        let of_lane = |lane: usize| (lane..count).step_by(WORKGROUP).map(of_body).fold(Partial::none(), merge);
        merge_tree(std::array::from_fn(of_lane))
    };
    statistics.iter().enumerate().map(of_statistic).collect()
}

/// What [`observe`] reads of a body.
pub(crate) struct ObservedRow<T> {
    pub inverse_moments: Vector<T>,
    pub limit: T,
    pub m: Vector<T>,
    /// The scales, in the order of the statistics.
    pub scales: [T; Statistic::ALL.len()],
}

impl<T: Kernel> ObservedRow<T> {
    /// The angular momentum scaled by a power of two to near 1, and the exponent that restores it.
    fn near_one(&self) -> (Vector<T>, i32) {
        let own = without_axis(self.inverse_moments, self.m);
        let exponent = T::exponent_of(own.largest());
        let factor = T::power_of_two(-exponent);
        (own.scaled_by(Vector::new(factor, factor, factor)), exponent)
    }

    /// Whether the body is marked.
    pub fn is_faster(&self) -> bool {
        let (m, exponent) = self.near_one();
        quantity(Statistic::SpinRate, self.inverse_moments, m) * T::power_of_two(exponent) > self.limit
    }
}

impl<T: Kernel> Partial<T> {
    /// The same in `f64`, with exponents counted from `offset`.
    pub(crate) fn widened(&self, offset: i32) -> Partial<f64> {
        let extreme = |x: &Extreme<T>| Extreme::normal(x.mantissa.to_f64(), x.exponent + offset, x.body);
        Partial {
            count: self.count,
            faster: self.faster,
            exponent: self.exponent + offset,
            mean: self.mean.to_f64() + self.residue.to_f64(),
            residue: 0.0,
            squares: self.squares.to_f64(),
            least: extreme(&self.least),
            greatest: extreme(&self.greatest),
        }
    }
}

impl Partial<f64> {
    /// The statistics of some bodies' values, given with their indices; in two passes, as all values are at hand.
    pub(crate) fn of_values(values: &[(u32, f64)], exponent: i32) -> Self {
        let mut partial = Self::none();
        for block in values.chunks(WORKGROUP) {
            let count = block.len() as f64;
            let mean = block.iter().map(|(_, x)| x).sum::<f64>() / count;
            let squares = block.iter().map(|(_, x)| (x - mean) * (x - mean)).sum();
            let extreme = |&(body, x): &(u32, f64)| Extreme::normal(x, exponent, body);
            let least = block.iter().map(extreme).reduce(|a, b| if is_less(b, a) { b } else { a });
            let greatest = block.iter().map(extreme).reduce(|a, b| if is_less(a, b) { b } else { a });
            let (Some(least), Some(greatest)) = (least, greatest) else { continue };
            let count = block.len() as u32;
            let of_block = Self { count, faster: 0, exponent, mean, residue: 0.0, squares, least, greatest };
            partial = merge(partial, of_block);
        }
        partial
    }

    /// The mean, in SI units; NaN for no body.
    pub fn mean(&self) -> f64 {
        if self.count == 0 { f64::NAN } else { scaled_by_power_of_two(self.mean + self.residue, self.exponent) }
    }

    /// The standard deviation of the bodies themselves (divided by their number), in SI units; NaN for no body.
    pub fn standard_deviation(&self) -> f64 {
        scaled_by_power_of_two((self.squares / f64::from(self.count)).sqrt(), self.exponent)
    }
}

impl Extreme<f64> {
    /// x · 2^exponent with its mantissa in [1, 2), so that it can be compared with others.
    fn normal(x: f64, exponent: i32, body: u32) -> Self {
        if x == 0.0 {
            return Self { mantissa: 0.0, exponent: ZERO_EXPONENT, body };
        }
        let own = binary_exponent(x);
        Self { mantissa: scaled_by_power_of_two(x, -own), exponent: exponent + own, body }
    }

    /// In SI units.
    pub fn value(&self) -> f64 {
        if self.mantissa == 0.0 { 0.0 } else { scaled_by_power_of_two(self.mantissa, self.exponent) }
    }
}
