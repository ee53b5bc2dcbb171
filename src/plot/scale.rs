//! Maps numbers to positions along an axis, with ticks.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

use super::figure::{Axis, Scale};

/// An axis with its range and ticks; positions are numbers, or their logarithms to base 10.
#[derive(Clone, Debug)]
pub(super) struct Laid {
    scale: Scale,
    low: f64,
    high: f64,
    ticks: Vec<f64>,
}

/// The approximate number of ticks of an axis.
const TICKS: f64 = 6.0;

/// The least and the greatest of some numbers.
pub(super) fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

impl Laid {
    /// The axis over the finite numbers in `values` and those that it always includes.
    pub fn new(axis: &Axis, values: impl Iterator<Item = f64>) -> Self {
        let mut laid = Self { scale: axis.scale.clone(), low: 0.0, high: 1.0, ticks: Vec::new() };
        let positions = values.chain(axis.include.iter().copied()).filter_map(|value| laid.position(value));
        let (low, high) = extent(positions);
        (laid.low, laid.high) = match &laid.scale {
            _ if low > high => (0.0, 1.0),
            Scale::Names(_) => (low, high),
            Scale::Log => {
                // A decade at least: over less, differences say more than ratios.
                let margin = (0.05 * (high - low)).max(0.5 * (1.0 - (high - low)));
                (low - margin, high + margin)
            }
            Scale::Linear => {
                // A constant gets room on both sides.
                let margin = if high > low { 0.05 * (high - low) } else { 0.5 * low.abs().max(1e-300) };
                (low - margin, high + margin)
            }
        };
        laid.ticks = laid.ticks();
        laid
    }

    /// Widens the range to `span` about its middle.
    pub fn widen(&mut self, span: f64) {
        let middle = 0.5 * (self.low + self.high);
        (self.low, self.high) = (middle - 0.5 * span, middle + 0.5 * span);
        self.ticks = self.ticks();
    }

    pub fn span(&self) -> f64 {
        self.high - self.low
    }

    /// The position of a number; `None` if it has none.
    pub fn position(&self, value: f64) -> Option<f64> {
        let position = if self.scale == Scale::Log { value.log10() } else { value };
        position.is_finite().then_some(position)
    }

    fn ticks(&self) -> Vec<f64> {
        let stride = match &self.scale {
            Scale::Names(names) => return (0..names.len()).map(|index| index as f64).collect(),
            // Where there are fewer than two powers of ten, twice and five times such powers too.
            Scale::Log if self.high.floor() - self.low.ceil() < 1.0 => {
                let powers = self.low.floor() as i32..=self.high.floor() as i32;
                let ticks = powers.flat_map(|power| [1.0_f64, 2.0, 5.0].map(|times| f64::from(power) + times.log10()));
                return ticks.filter(|tick| (self.low..=self.high).contains(tick)).collect();
            }
            Scale::Log => (self.span() / TICKS).ceil().max(1.0),
            Scale::Linear => even_stride(self.span()),
        };
        multiples(self.low, self.high, stride)
    }
}

/// One, two or five times a power of ten, which about [`TICKS`] times make `span`.
fn even_stride(span: f64) -> f64 {
    let rough = span / TICKS;
    let unit = 10_f64.powf(rough.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|step| step * unit).into_iter().find(|step| *step >= rough).unwrap_or(rough)
}

/// Whether the logarithm is that of a power of ten.
fn is_power(position: f64) -> bool {
    position == position.round()
}

/// The multiples of `stride` in a range.
fn multiples(low: f64, high: f64, stride: f64) -> Vec<f64> {
    let (first, last) = ((low / stride).ceil() as i64, (high / stride).floor() as i64);
    (first..=last).map(|index| index as f64 * stride).collect()
}

impl Ranged for Laid {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let part = (value - self.low) / self.span();
        limit.0 + (part * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        // Fine grid lines are not drawn.
        if hint.weight().allow_light_points() { Vec::new() } else { self.ticks.clone() }
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Laid {
    fn format_ext(&self, value: &f64) -> String {
        match &self.scale {
            Scale::Names(names) => names.get(value.round() as usize).cloned().unwrap_or_default(),
            Scale::Log if self.ticks.iter().all(|tick| is_power(*tick)) => {
                format!("10{}", superscript(value.round() as i32))
            }
            // Rounded, as a tick is a power.
            Scale::Log => {
                let number = 10_f64.powf(*value);
                let rounded: f64 = format!("{number:.3e}").parse().unwrap_or(number);
                if (1e-3..1e5).contains(&rounded) { format!("{rounded}") } else { format!("{rounded:e}") }
            }
            Scale::Linear => {
                let size = self.low.abs().max(self.high.abs());
                if value.abs() < 1e-9 * size {
                    "0".to_owned()
                } else if (1e-2..1e5).contains(&size) {
                    let decimals = (2.0 - (self.span() / TICKS).log10()).floor().clamp(0.0, 15.0) as usize;
                    let text = format!("{value:.decimals$}");
                    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
                } else {
                    // Rounded, as a tick is a product, to as many digits as neighbours need to differ.
                    let digits = (1.0 + (size * TICKS / self.span()).log10()).ceil().clamp(1.0, 16.0) as usize;
                    format!("{:e}", format!("{value:.digits$e}").parse::<f64>().unwrap_or(*value))
                }
            }
        }
    }
}

/// A whole number in superscript digits.
pub(super) fn superscript(number: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    number
        .to_string()
        .chars()
        .map(|character| character.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, values: [f64; 2]) -> Vec<String> {
        let laid = Laid::new(axis, values.into_iter());
        laid.ticks.iter().map(|tick| laid.format_ext(tick)).collect()
    }

    #[test]
    fn over_a_decade_ticks_are_not_powers_alone() {
        assert_eq!(labels(&Axis::log(""), [2.0, 9.0]), ["2", "5", "10"]);
        assert_eq!(labels(&Axis::log(""), [3e-5, 3e-5]), ["1e-5", "2e-5", "5e-5"]);
        assert_eq!(labels(&Axis::log(""), [0.5, 2e4]), ["10⁰", "10¹", "10²", "10³", "10⁴"]);
    }

    #[test]
    fn ticks_that_are_near_have_labels_that_differ() {
        for values in [[1.2398e-6, 1.23981e-6], [27.761_256, 27.761_256_3], [6900.0, 7600.0], [0.0, 1.0]] {
            let mut found = labels(&Axis::linear(""), values);
            let count = found.len();
            found.dedup();
            assert!(count >= 3 && found.len() == count, "{values:?}: {found:?}");
        }
    }
}
