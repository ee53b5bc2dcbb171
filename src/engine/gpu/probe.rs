//! The properties of an adapter's arithmetic, found by computing a table of sums, products, quotients and roots on it.
//!
//! The graphics interfaces promise none of them: drivers may contract and re-associate, flush subnormal numbers, and
//! round `f64` quotients and roots as they like. The result decides which precisions an engine offers.

use super::buffers::{STAGING, bind, buffer};
use super::device::Device;
use super::shader::Source;
use crate::error::ArithmeticFault;
use crate::error::Result;
use crate::math::Precision;
use crate::math::real::Scalar;

/// Whether a product and a sum are rounded once or twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "study", derive(serde::Serialize), serde(rename_all = "lowercase"))]
pub enum Fusing {
    /// Once, everywhere in the table.
    Fused,
    /// Twice, everywhere in the table.
    #[cfg_attr(feature = "study", serde(rename = "not fused"))]
    Separate,
    /// Sometimes once, sometimes twice, or neither.
    Mixed,
}

impl std::fmt::Display for Fusing {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Fusing::Fused => "fused",
            Fusing::Separate => "not fused",
            Fusing::Mixed => "mixed",
        })
    }
}

/// The arithmetic of one precision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct Probe {
    /// Rows of the table from which it was found.
    pub rows: usize,
    /// Whether sums and products of normal numbers are correctly rounded.
    pub correctly_rounded: bool,
    /// Whether a textbook two-sum gives the rounding error of a sum.
    pub two_sum_plain: bool,
    /// Whether it does so with the barrier that the kernels use.
    pub two_sum_barrier: bool,
    /// Largest distance of a quotient from the correctly rounded one, in ulps; `u64::MAX` if one is NaN.
    #[cfg_attr(feature = "study", serde(serialize_with = "number_or_null"))]
    pub division_ulps: u64,
    /// Largest distance of a square root from the correctly rounded one, in ulps; `u64::MAX` as above.
    #[cfg_attr(feature = "study", serde(serialize_with = "number_or_null"))]
    pub square_root_ulps: u64,
    /// Whether subnormal numbers are kept; otherwise they are treated as zero.
    pub subnormals: bool,
    /// How `fma` is rounded.
    pub fma: Fusing,
    /// How a product followed by a sum is rounded.
    pub product_and_sum: Fusing,
}

#[cfg(feature = "study")]
fn number_or_null<S: serde::Serializer>(ulps: &u64, serializer: S) -> std::result::Result<S::Ok, S::Error> {
    serde::Serialize::serialize(&(*ulps != u64::MAX).then_some(*ulps), serializer)
}

impl Probe {
    /// The fault that rules out the kernels of a precision: they need exact two-sums in `f32`, correct rounding in
    /// both, but no correctly rounded quotients or roots.
    pub fn fault(&self, precision: Precision) -> Option<ArithmeticFault> {
        if !self.correctly_rounded {
            return Some(ArithmeticFault::Rounding);
        }
        match precision {
            Precision::F32 if !self.two_sum_barrier => Some(ArithmeticFault::TwoSum),
            _ => None,
        }
    }
}

/// The arithmetic of an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct Arithmetic {
    /// In 32 bits.
    pub f32: Probe,
    /// In 64 bits, if the adapter has them.
    pub f64: Option<Probe>,
}

impl Arithmetic {
    /// The probe of a precision.
    pub fn probe(&self, precision: Precision) -> Option<&Probe> {
        match precision {
            Precision::F32 => Some(&self.f32),
            Precision::F64 => self.f64.as_ref(),
        }
    }

    /// The precisions in which the kernels can be used.
    pub fn precisions(&self) -> Vec<Precision> {
        let usable =
            |precision: &Precision| self.probe(*precision).is_some_and(|probe| probe.fault(*precision).is_none());
        Precision::ALL.into_iter().filter(usable).collect()
    }
}

/// Probes a device in every precision that it has.
pub(super) fn probe(device: &Device) -> Result<Arithmetic> {
    let f64 = device.has(wgpu::Features::SHADER_F64).then(|| probe_precision::<f64>(device));
    Ok(Arithmetic { f32: probe_precision::<f32>(device)?, f64: f64.transpose()? })
}

/// An element type with the host's arithmetic, that of IEEE 754, for comparison.
trait ProbedScalar: Scalar {
    /// A subnormal number, and a normal one whose half is subnormal.
    const SUBNORMAL: Self;
    const LEAST_NORMAL: Self;
    fn fused(self, factor: Self, addend: Self) -> Self;
    /// Distance in ulps, counted along all finite numbers.
    fn ulps(self, other: Self) -> u64;
    fn same(self, other: Self) -> bool {
        self.ulps(other) == 0
    }
}

macro_rules! probed_scalar {
    ($scalar:ident, $signed:ident) => {
        impl ProbedScalar for $scalar {
            const SUBNORMAL: Self = $scalar::MIN_POSITIVE * 0.25;
            const LEAST_NORMAL: Self = $scalar::MIN_POSITIVE;
            fn fused(self, factor: Self, addend: Self) -> Self {
                <$scalar>::mul_add(self, factor, addend)
            }
            fn ulps(self, other: Self) -> u64 {
                if self.is_nan() || other.is_nan() {
                    return u64::MAX;
                }
                // Ordered integers: both zeros become 0, and negative numbers count down from there.
                let ordered = |x: $scalar| {
                    let bits = x.to_bits() as $signed;
                    i128::from(if bits < 0 { $signed::MIN - bits } else { bits })
                };
                (ordered(self) - ordered(other)).unsigned_abs() as u64
            }
        }
    };
}

probed_scalar!(f32, i32);
probed_scalar!(f64, i64);

/// Rows of normal numbers.
const NORMAL_ROWS: usize = 1021;
/// Columns of `results` in `probe.wgsl`.
const RESULTS: usize = 8;

/// Operands a, b, c of each row: a few by hand, then a fixed sequence over sixty binary orders of magnitude; the last
/// two rows have subnormal operands and results.
fn operands<T: ProbedScalar>() -> Vec<[T; 3]> {
    let mut rows: Vec<[T; 3]> = [
        // Sums that lose the whole of b, half of it, and nothing; a tie; a cancellation.
        [1.0, T::UNIT_ROUNDOFF * 0.5, -1.0],
        [1.0, T::UNIT_ROUNDOFF, 1.0],
        [1.0, T::UNIT_ROUNDOFF * 3.0, 1.0],
        [3.0, -1.0 / 3.0, 1.0],
        [1.0, 3.0, -1.0 / 3.0],
        [-7.0, 7.0, 49.0],
        [1e10, 1.0, -1e10],
        [2.0, 3.0, -6.0],
    ]
    .map(|row: [f64; 3]| row.map(T::from_f64))
    .to_vec();
    // SplitMix64 (Steele, Lea, Flood, OOPSLA 2014) with a fixed seed.
    let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
    let mut draw = || {
        seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = seed;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    while rows.len() < NORMAL_ROWS {
        let mut number = |orders: u64| {
            let mantissa = 1.0 + (draw() >> 12) as f64 / 2f64.powi(52);
            let exponent = (draw() % (2 * orders + 1)) as i32 - orders as i32;
            let sign = if draw() & 1 == 0 { 1.0 } else { -1.0 };
            sign * mantissa * 2f64.powi(exponent)
        };
        let (a, b) = (T::from_f64(number(15)), T::from_f64(number(15)));
        // The addend is as large as the product, as fused and separate rounding then differ most often.
        let c = T::from_f64((a * b).to_f64() * number(2));
        rows.push([a, b, c]);
    }
    let (zero, half) = (T::from_f64(0.0), T::from_f64(0.5));
    rows.push([T::SUBNORMAL, zero, zero]);
    rows.push([T::LEAST_NORMAL, half, zero]);
    rows
}

/// a + b and its rounding error (Knuth, TAOCP vol. 2, 4.2.2, theorem B).
fn two_sum<T: Scalar>(a: T, b: T) -> (T, T) {
    let sum = a + b;
    let b_taken = sum - a;
    let a_taken = sum - b_taken;
    (sum, (a - a_taken) + (b - b_taken))
}

fn probe_precision<T: ProbedScalar>(device: &Device) -> Result<Probe> {
    let table = operands::<T>();
    let results = compute(device, &Source::probe(T::PRECISION), &table)?;
    Ok(judge(&table, &results))
}

/// Compares the device's results, `RESULTS` columns, with the host's.
fn judge<T: ProbedScalar>(table: &[[T; 3]], results: &[T]) -> Probe {
    let rows = table.len();
    let normal = 0..NORMAL_ROWS;
    let result = |column: usize, row: usize| results[column * rows + row];
    let all = |matches: &dyn Fn(usize, [T; 3]) -> bool| normal.clone().all(|row| matches(row, table[row]));
    let largest = |column: usize, expected: &dyn Fn([T; 3]) -> T| {
        normal.clone().map(|row| result(column, row).ulps(expected(table[row]))).max().unwrap_or(u64::MAX)
    };
    let fusing = |column: usize| {
        if all(&|row, [a, b, c]| result(column, row).same(a.fused(b, c))) {
            Fusing::Fused
        } else if all(&|row, [a, b, c]| result(column, row).same(a * b + c)) {
            Fusing::Separate
        } else {
            Fusing::Mixed
        }
    };
    let exact_two_sum = |column: usize| all(&|row, [a, b, _]| result(column, row).same(two_sum(a, b).1));
    Probe {
        rows,
        correctly_rounded: all(&|row, [a, b, _]| result(0, row).same(a + b) && result(1, row).same(a * b)),
        two_sum_plain: exact_two_sum(2),
        two_sum_barrier: exact_two_sum(3),
        division_ulps: largest(4, &|[a, b, _]| a / b),
        square_root_ulps: largest(5, &|[a, _, _]| a.abs().sqrt()),
        subnormals: (NORMAL_ROWS..rows).all(|row| {
            let [a, b, _] = table[row];
            result(0, row).same(a + b) && result(1, row).same(a * b)
        }),
        fma: fusing(6),
        product_and_sum: fusing(7),
    }
}

/// Runs the probe's shader over the table.
fn compute<T: ProbedScalar>(device: &Device, source: &Source, table: &[[T; 3]]) -> Result<Vec<T>> {
    let rows = table.len();
    let columns: Vec<T> = (0..3).flat_map(|column| table.iter().map(move |row| row[column])).collect();
    // Numbers that the shader does not write must not pass for results.
    let unwritten = vec![T::from_f64(f64::NAN); RESULTS * rows];
    let layout = super::bind_group_layout(&device.device);
    let pipeline = source.compile(device, &super::pipeline_layout(&device.device, &layout), None)?;
    let bytes = size_of_val(unwritten.as_slice()) as u64;
    let usages = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
    let refused = |refusal| device.refused(refusal);
    let make = |label, size, usage| buffer(device, label, size, usage).map_err(refused);
    let settings = make("probe settings", 8, wgpu::BufferUsages::UNIFORM | usages)?;
    let input = make("operands", size_of_val(columns.as_slice()) as u64, wgpu::BufferUsages::STORAGE | usages)?;
    let output = make("results", bytes, wgpu::BufferUsages::STORAGE | usages)?;
    let staging = make("probe staging", bytes, STAGING)?;
    let group = bind(device, "probe", &layout, [&settings, &input, &output]).map_err(refused)?;
    let commands = device.encoded("probe", |encoder| {
        device.queue.write_buffer(&settings, 0, bytemuck::bytes_of(&[rows as u32, 0]));
        device.queue.write_buffer(&input, 0, bytemuck::cast_slice(&columns));
        device.queue.write_buffer(&output, 0, bytemuck::cast_slice(&unwritten));
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups((rows as u32).div_ceil(64), 1, 1);
        drop(pass);
        encoder.copy_buffer_to_buffer(&output, 0, &staging, 0, bytes);
    })?;
    let results = device.read(commands, &staging, 0..bytes, |view| bytemuck::cast_slice(view).to_vec())?;
    for buffer in [&settings, &input, &output, &staging] {
        buffer.destroy();
    }
    device.release();
    Ok(results)
}
