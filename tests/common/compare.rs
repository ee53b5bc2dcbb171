//! The comparator: differences in ulps of a vector's largest component, named by body and field.

use polhode::bodies::columns::{STATE_COMPONENTS, StateWords};
use polhode::math::real::Scalar;

/// A vector quantity among the numbers of a row.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    pub name: &'static str,
    pub components: usize,
}

/// The vectors of a state.
pub const STATE_FIELDS: [Field; 2] =
    [Field { name: "orientation", components: 4 }, Field { name: "angular_momentum_principal", components: 3 }];

/// A row that two computations do not agree on.
#[derive(Clone, Debug, PartialEq)]
pub struct Mismatch {
    pub body: usize,
    pub field: &'static str,
    pub component: usize,
    pub expected: f64,
    pub found: f64,
    /// In ulps of the field's largest component (or of the magnitude stated); infinite where not a number.
    pub ulps: f64,
    pub bound: f64,
}

impl std::fmt::Display for Mismatch {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            formatter,
            "body {}: {}[{}] is {:e}, {:e} expected: {} ulps of the largest component, {} allowed",
            self.body, self.field, self.component, self.found, self.expected, self.ulps, self.bound
        )
    }
}

/// Distance between neighbouring numbers of `T` at `x` (of the least normal number below it).
fn ulp<T: Scalar>(x: f64) -> f64 {
    let least = if T::WORDS == 2 { f64::from(f32::MIN_POSITIVE) } else { f64::MIN_POSITIVE };
    let x = x.max(least);
    let power_of_two = f64::from_bits(x.to_bits() & (0x7ff << 52));
    2.0 * T::UNIT_ROUNDOFF * power_of_two
}

/// Compares rows and gives the largest difference, or the first that exceeds `bound` or is not a number.
///
/// `magnitude` of a row: the size of what cancels in it, where that is larger than the result.
pub fn compare_rows<T: Scalar>(
    fields: &[Field],
    expected: &[Vec<f64>],
    found: &[Vec<f64>],
    magnitude: impl Fn(usize) -> f64,
    bound: f64,
) -> Result<f64, Mismatch> {
    compare_sized_rows::<T>(fields, expected, found, |body| vec![magnitude(body); expected[body].len()], bound)
}

/// The same by the sizes of what cancels in each number of a row.
pub fn compare_sized_rows<T: Scalar>(
    fields: &[Field],
    expected: &[Vec<f64>],
    found: &[Vec<f64>],
    sizes: impl Fn(usize) -> Vec<f64>,
    bound: f64,
) -> Result<f64, Mismatch> {
    assert_eq!(expected.len(), found.len(), "rows");
    let mut largest = 0.0_f64;
    for (body, (expected, found)) in expected.iter().zip(found).enumerate() {
        let sizes = sizes(body);
        let mut first = 0;
        for field in fields {
            let range = first..first + field.components;
            first = range.end;
            let sizes = expected[range.clone()].iter().chain(&sizes[range.clone()]);
            let scale = sizes.fold(0.0_f64, |scale, x| scale.max(x.abs()));
            for index in range.clone() {
                let (expected, found) = (expected[index], found[index]);
                let is_number = |x: f64| (x.to_bits() >> 52) & 0x7ff != 0x7ff;
                let ulps = if is_number(expected) && is_number(found) {
                    (expected - found).abs() / ulp::<T>(scale)
                } else {
                    f64::INFINITY
                };
                if ulps > bound || ulps.is_infinite() {
                    let component = index - range.start;
                    return Err(Mismatch { body, field: field.name, component, expected, found, ulps, bound });
                }
                largest = largest.max(ulps);
            }
        }
        assert_eq!(first, expected.len(), "the fields of a row");
        assert_eq!(first, found.len(), "the fields of a row");
    }
    Ok(largest)
}

/// Compares states, both words together, in ulps of `T`.
pub fn compare_states<T: Scalar>(expected: &StateWords, found: &StateWords, bound: f64) -> Result<f64, Mismatch> {
    let rows = |words: &StateWords| (0..words.len()).map(|body| words.combined(body).to_vec()).collect::<Vec<_>>();
    compare_rows::<T>(&STATE_FIELDS, &rows(expected), &rows(found), |_| 0.0, bound)
}

/// The first body and column where two states differ in a bit of either word.
pub fn first_bit_difference(expected: &StateWords, found: &StateWords) -> Option<String> {
    assert_eq!(expected.len(), found.len(), "bodies");
    for body in 0..expected.len() {
        let values = [expected.value[body], found.value[body]];
        let residues = [expected.residue_of(body), found.residue_of(body)];
        for (word, [expected, found]) in [("value", values), ("residue", residues)] {
            for component in 0..STATE_COMPONENTS {
                let (expected, found) = (expected[component], found[component]);
                if expected.to_bits() != found.to_bits() {
                    return Some(format!(
                        "body {body}, {word} of component {component}: {found:e} and {expected:e} ({} in f64 bits)",
                        found.to_bits().abs_diff(expected.to_bits())
                    ));
                }
            }
        }
    }
    None
}
