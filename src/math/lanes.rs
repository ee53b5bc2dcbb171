//! SIMD lanes as [`Real`] numbers, and their choice at run time.
//!
//! The width is that of the machine on which the program runs (AVX-512, AVX2 with FMA, NEON, or one lane), found by [`pulp`]. A lane's
//! result does not depend on the width: every width fuses `mul_add`.

use std::ops::{Add, BitAnd, BitOr, Deref, DerefMut, Div, Mul, Neg, Not, Sub};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use pulp::{Simd, WithSimd};

use crate::math::clock::MOST_LANES;
use crate::math::operators;
use crate::math::real::{Real, Scalar};

/// The capability token of an instruction set.
///
/// Lane types cannot pass it to a static function such as `splat`, so it is created from nothing.
#[inline(always)]
#[allow(unsafe_code, reason = "a value without size, whose meaning `dispatch` has checked")]
fn token<S: Simd>() -> S {
    const { assert!(size_of::<S>() == 0) };
    // SAFETY: `S` has no size, so no bytes are invented. What it guarantees, that the processor has the instructions, holds
    // because lane types are private to the crate and named only inside `LaneTask::run`, which `dispatch` reaches
    // after it has checked the processor.
    unsafe { std::mem::zeroed() }
}

/// The greatest allowed width of lanes, in bytes of a vector.
static MOST_BYTES: AtomicUsize = AtomicUsize::new(usize::MAX);

/// Only one caller narrows lanes at a time.
static NARROWING: Mutex<()> = Mutex::new(());

/// The instruction set in use.
#[cfg(not(all(test, target_arch = "x86_64")))]
#[inline]
fn instructions() -> pulp::Arch {
    let widest = pulp::Arch::new();
    #[cfg(target_arch = "x86_64")]
    if matches!(widest, pulp::Arch::V4(_)) && MOST_BYTES.load(Ordering::Relaxed) < 64 {
        return pulp::x86::V3::try_new().map_or(widest, pulp::Arch::V3);
    }
    widest
}

/// Does work that [`pulp`] compiles, with the instruction set in use.
#[cfg(not(all(test, target_arch = "x86_64")))]
#[inline]
fn in_use<W: WithSimd>(work: W) -> W::Output {
    instructions().dispatch(work)
}

/// The same in unit tests, which use AVX2 only: compiling every kernel for AVX-512 too would take as long again. Tests outside
/// the crate cover every width.
#[cfg(all(test, target_arch = "x86_64"))]
fn in_use<W: WithSimd>(work: W) -> W::Output {
    match pulp::x86::V3::try_new() {
        Some(avx2) => Simd::vectorize(avx2, work),
        None => Simd::vectorize(pulp::Scalar::new(), work),
    }
}

/// Bytes of the vectors of each instruction set with lanes that this processor has, the widest first.
pub(crate) fn widths() -> Vec<usize> {
    let widest = f64::lane_count() * size_of::<f64>();
    // AVX2 comes with AVX-512.
    let narrower = if cfg!(target_arch = "x86_64") && widest == 64 { Some(32) } else { None };
    std::iter::once(widest).filter(|&bytes| bytes > size_of::<f64>()).chain(narrower).collect()
}

/// Does some work with lanes of at most this many bytes. The limit is global and applies to every session. No result depends on it.
pub(crate) fn with_lanes_of<V>(bytes: usize, work: impl FnOnce() -> V) -> V {
    struct Widest;
    impl Drop for Widest {
        fn drop(&mut self) {
            MOST_BYTES.store(usize::MAX, Ordering::Relaxed);
        }
    }
    let _alone = NARROWING.lock().unwrap_or_else(PoisonError::into_inner);
    let _then = Widest;
    MOST_BYTES.store(bytes, Ordering::Relaxed);
    work()
}

/// Bytes of the widest vector that any instruction set has here.
const WIDEST_BYTES: usize = MOST_LANES * size_of::<f32>();

/// Number of lane groups in a tile: with AVX-512 in `f64` the slopes of all stages of `rk8` take 21 KB.
pub(crate) const GROUPS: usize = 4;

/// One value for each of `N` lane groups, aligned to a cache line: reading or writing a vector of 64 bytes that lies across two lines takes
/// twice the time.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Each<V, const N: usize = GROUPS>(pub [V; N]);

impl<R: Real, const N: usize> Each<R, N> {
    /// Zeros.
    #[inline(always)]
    pub fn zero() -> Self {
        Self([R::splat(0.0); N])
    }
}

impl<V, const N: usize> Deref for Each<V, N> {
    type Target = [V; N];
    #[inline(always)]
    fn deref(&self) -> &[V; N] {
        &self.0
    }
}

impl<V, const N: usize> DerefMut for Each<V, N> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [V; N] {
        &mut self.0
    }
}

/// Work that [`pulp`] compiles as a function for the instruction set in use.
struct ForSimd<W>(W);

impl<O, W: FnOnce() -> O> WithSimd for ForSimd<W> {
    type Output = O;
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> O {
        (self.0)()
    }
}

macro_rules! lane_type {
    ($lanes:ident, $scalar:ident, $vector:ident, $mask_name:ident, $mask:ident,
     $splat:ident, $add:ident, $sub:ident, $mul:ident, $div:ident, $neg:ident, $mul_add:ident,
     $sqrt:ident, $abs:ident, $min:ident, $max:ident, $less_than:ident, $select:ident,
     $and:ident, $or:ident, $not:ident, $first_true:ident) => {
        #[derive(Clone, Copy, Debug)]
        pub(crate) struct $lanes<S: Simd>(S::$vector);

        #[derive(Clone, Copy, Debug)]
        pub(crate) struct $mask_name<S: Simd>(S::$mask);

        operators! { [S: Simd] $mask_name<S>:
            BitAnd::bitand(self, other: Self) = Self(token::<S>().$and(self.0, other.0));
            BitOr::bitor(self, other: Self) = Self(token::<S>().$or(self.0, other.0));
            Not::not(self) = Self(token::<S>().$not(self.0));
        }
        operators! { [S: Simd] $lanes<S>:
            Add::add(self, other: Self) = Self(token::<S>().$add(self.0, other.0));
            Sub::sub(self, other: Self) = Self(token::<S>().$sub(self.0, other.0));
            Mul::mul(self, other: Self) = Self(token::<S>().$mul(self.0, other.0));
            Div::div(self, other: Self) = Self(token::<S>().$div(self.0, other.0));
            Neg::neg(self) = Self(token::<S>().$neg(self.0));
        }

        impl<S: Simd> Real for $lanes<S> {
            type Scalar = $scalar;
            type Mask = $mask_name<S>;
            const LANES: usize = size_of::<S::$vector>() / size_of::<$scalar>();

            #[inline(always)]
            fn splat(x: f64) -> Self {
                Self(token::<S>().$splat(x as $scalar))
            }
            #[inline(always)]
            fn from_lanes(mut lane: impl FnMut(usize) -> $scalar) -> Self {
                let mut numbers = [$scalar::default(); WIDEST_BYTES / size_of::<$scalar>()];
                for (index, number) in numbers[..Self::LANES].iter_mut().enumerate() {
                    *number = lane(index);
                }
                Self::load(&numbers)
            }
            #[inline(always)]
            fn load(column: &[$scalar]) -> Self {
                Self(bytemuck::pod_read_unaligned(bytemuck::cast_slice(&column[..Self::LANES])))
            }
            #[inline(always)]
            fn store(self, column: &mut [$scalar]) {
                column[..Self::LANES].copy_from_slice(bytemuck::cast_slice(bytemuck::bytes_of(&self.0)));
            }
            #[inline(always)]
            fn mul_add(self, factor: Self, addend: Self) -> Self {
                Self(token::<S>().$mul_add(self.0, factor.0, addend.0))
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(token::<S>().$sqrt(self.0))
            }
            #[inline(always)]
            fn abs(self) -> Self {
                Self(token::<S>().$abs(self.0))
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                Self(token::<S>().$min(self.0, other.0))
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                Self(token::<S>().$max(self.0, other.0))
            }
            #[inline(always)]
            fn less_than(self, other: Self) -> Self::Mask {
                $mask_name(token::<S>().$less_than(self.0, other.0))
            }
            #[inline(always)]
            fn select(mask: Self::Mask, if_true: Self, if_false: Self) -> Self {
                Self(token::<S>().$select(mask.0, if_true.0, if_false.0))
            }
            #[inline(always)]
            fn any(mask: Self::Mask) -> bool {
                // If masks are single bits, the position of a missing bit is the one after their last.
                let none = match size_of::<S::$mask>() {
                    1 if Self::LANES > 1 => 8,
                    2 => 16,
                    _ => Self::LANES,
                };
                token::<S>().$first_true(mask.0) < none
            }
            #[inline(always)]
            fn two_product(self, other: Self) -> (Self, Self) {
                let product = self * other;
                (product, self.mul_add(other, -product))
            }
            #[inline(always)]
            fn outlined<O>(work: impl FnOnce() -> O) -> O {
                token::<S>().vectorize(ForSimd(work))
            }
        }
    };
}

lane_type! {
    F32Lanes, f32, f32s, F32Mask, m32s,
    splat_f32s, add_f32s, sub_f32s, mul_f32s, div_f32s, neg_f32s, mul_add_f32s,
    sqrt_f32s, abs_f32s, min_f32s, max_f32s, less_than_f32s, select_f32s,
    and_m32s, or_m32s, not_m32s, first_true_m32s
}
lane_type! {
    F64Lanes, f64, f64s, F64Mask, m64s,
    splat_f64s, add_f64s, sub_f64s, mul_f64s, div_f64s, neg_f64s, mul_add_f64s,
    sqrt_f64s, abs_f64s, min_f64s, max_f64s, less_than_f64s, select_f64s,
    and_m64s, or_m64s, not_m64s, first_true_m64s
}

/// Work that is written once for any lane type of an element type.
pub trait LaneTask<T: Scalar> {
    /// What the work returns.
    type Output;
    /// Whether the work never runs on a processor with one lane, so that it is not compiled for one: the caller checks
    /// [`LaneScalar::lane_count`] first.
    const IN_LANES_ONLY: bool = false;
    /// Does the work. It must be `#[inline(always)]` and call only functions that are, or the lanes degrade to calls.
    fn run<R: Real<Scalar = T>>(self) -> Self::Output;
}

/// An element type that has lanes.
pub trait LaneScalar: Scalar {
    /// Runs `task` with the widest lanes that this processor has.
    fn dispatch<K: LaneTask<Self>>(task: K) -> K::Output;
    /// The width that [`LaneScalar::dispatch`] uses here.
    fn lane_count() -> usize {
        struct Count;
        impl<T: Scalar> LaneTask<T> for Count {
            type Output = usize;
            #[inline(always)]
            fn run<R: Real<Scalar = T>>(self) -> usize {
                R::LANES
            }
        }
        Self::dispatch(Count)
    }
}

struct InF32Lanes<K>(K);
impl<K: LaneTask<f32>> WithSimd for InF32Lanes<K> {
    type Output = K::Output;
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> K::Output {
        if const { K::IN_LANES_ONLY && F32Lanes::<S>::LANES == 1 } {
            unreachable!("work for several lanes was handed to one");
        }
        self.0.run::<F32Lanes<S>>()
    }
}
impl LaneScalar for f32 {
    fn dispatch<K: LaneTask<f32>>(task: K) -> K::Output {
        in_use(InF32Lanes(task))
    }
}

struct InF64Lanes<K>(K);
impl<K: LaneTask<f64>> WithSimd for InF64Lanes<K> {
    type Output = K::Output;
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> K::Output {
        if const { K::IN_LANES_ONLY && F64Lanes::<S>::LANES == 1 } {
            unreachable!("work for several lanes was handed to one");
        }
        self.0.run::<F64Lanes<S>>()
    }
}
impl LaneScalar for f64 {
    fn dispatch<K: LaneTask<f64>>(task: K) -> K::Output {
        in_use(InF64Lanes(task))
    }
}

/// Whether the CPU engine runs in SIMD lanes or one body at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// The widest lanes of this processor, with fused multiply-add.
    Lanes,
    /// One body at a time without fused multiply-add: the reference in `f64`, the shader's twin in `f32`.
    Scalar,
}

impl Width {
    /// Whether bodies are stepped several at a time.
    pub(crate) fn has_lanes<T: LaneScalar>(self) -> bool {
        self == Width::Lanes && T::lane_count() > 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::real::outlined;

    /// Whether `any` finds each single lane, and finds nothing if no lane is set.
    struct AnyFindsEveryLane;
    impl<T: Scalar> LaneTask<T> for AnyFindsEveryLane {
        type Output = ();
        #[inline(always)]
        fn run<R: Real<Scalar = T>>(self) {
            let zero = R::splat(0.0);
            assert!(!R::any(zero.less_than(zero)));
            for lane in 0..R::LANES {
                let mut numbers = vec![T::from_f64(0.0); R::LANES];
                numbers[lane] = T::from_f64(1.0);
                assert!(R::any(zero.less_than(R::load(&numbers))), "lane {lane} of {}", R::LANES);
            }
        }
    }

    /// Whether every operation, compiled as a separate function for the instruction set, gives each lane the result of a scalar. Sums of
    /// products are left out: lanes round them once, scalars twice.
    struct LanesAgreeWithScalars;
    impl<T: Scalar> LaneTask<T> for LanesAgreeWithScalars {
        type Output = ();
        #[inline(always)]
        fn run<R: Real<Scalar = T>>(self) {
            let column = |first: f64| (0..R::LANES).map(|lane| T::from_f64(first + lane as f64 / 3.0)).collect();
            let (a, b): (Vec<T>, Vec<T>) = (column(0.7), column(-1.1));
            let found = outlined!(R, operations(R::load(&a), R::load(&b)));
            for (number, result) in found.into_iter().enumerate() {
                let mut lanes = vec![T::default(); R::LANES];
                result.store(&mut lanes);
                for lane in 0..R::LANES {
                    let expected = outlined!(T, operations(a[lane], b[lane]))[number];
                    assert_eq!(lanes[lane].to_f64().to_bits(), expected.to_f64().to_bits(), "{number}, lane {lane}");
                }
            }
        }
    }

    #[inline(always)]
    fn operations<R: Real>(a: R, b: R) -> [R; 11] {
        let (less, both) = (a.less_than(b.abs()), a.less_than(b.abs()) & !b.less_than(a));
        [
            a + b,
            a - b,
            a * b,
            a / b,
            -a,
            a.sqrt(),
            b.abs(),
            a.min(b),
            a.max(b),
            R::select(less, a, b),
            R::select(both, a, b),
        ]
    }

    /// With every instruction set that this processor has.
    macro_rules! with_every_instruction_set {
        ($task:expr) => {
            f32::dispatch($task);
            f64::dispatch($task);
            #[cfg(target_arch = "x86_64")]
            if let Some(avx512) = pulp::x86::V4::try_new() {
                Simd::vectorize(avx512, InF32Lanes($task));
                Simd::vectorize(avx512, InF64Lanes($task));
            }
            InF32Lanes($task).with_simd(pulp::Scalar::new());
            InF64Lanes($task).with_simd(pulp::Scalar::new());
        };
    }

    #[test]
    fn any_finds_every_lane() {
        with_every_instruction_set!(AnyFindsEveryLane);
    }

    #[test]
    fn every_operation_on_lanes_gives_what_it_gives_one_number() {
        with_every_instruction_set!(LanesAgreeWithScalars);
    }
}
