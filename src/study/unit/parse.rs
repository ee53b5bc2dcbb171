//! Parses numbers and their units from text.

use super::table::{NamedUnit, PREFIXES, UNITS};
use super::{Dimension, Factor, Quantity, Unit, UnitFault};

/// The greatest exponent of a unit.
const MOST_POWER: i8 = 9;
/// The most nested brackets, and the most factors.
const MOST_DEPTH: usize = 8;
const MOST_FACTORS: usize = 32;

/// A decimal number: sign, digits, and the power of ten that multiplies them.
struct Decimal {
    negative: bool,
    digits: u128,
    ten: i32,
    /// The number as Rust reads it, if there are more digits than 128 bits hold.
    rounded: Option<f64>,
}

impl Quantity {
    /// The number, or the quotient of two, and the unit after it; `None` if the text does not begin with a number.
    pub(in super::super) fn parse(text: &str) -> Option<Result<Self, UnitFault>> {
        let (number, rest) = decimal(text.trim())?;
        let (divisor, rest) = divisor(rest);
        Some(Unit::parse(rest.trim()).and_then(|unit| match divisor {
            0.0 => Err(UnitFault::Syntax),
            _ => Ok(Self { value: number.times(&unit) / divisor, unit }),
        }))
    }
}

/// The number by which the one before it is divided, if a text begins with a stroke and a number, and what follows.
fn divisor(text: &str) -> (f64, &str) {
    let none = (1.0, text);
    let Some(number) = text.strip_prefix('/') else { return none };
    let Some((_, rest)) = decimal(number) else { return none };
    number[..number.len() - rest.len()].replace('_', "").parse().map_or(none, |divisor| (divisor, rest))
}

impl Decimal {
    /// So many of a unit, in SI units.
    fn times(&self, unit: &Unit) -> f64 {
        match self.rounded {
            Some(number) => number * unit.convert(false, 1, 0),
            None => unit.convert(self.negative, self.digits, self.ten),
        }
    }
}

/// The number at the beginning of a text, in TOML's notation, and what follows.
fn decimal(text: &str) -> Option<(Decimal, &str)> {
    let bytes = text.as_bytes();
    let negative = bytes.first() == Some(&b'-');
    let mut at = usize::from(matches!(bytes.first(), Some(b'-' | b'+')));
    let (mut digits, mut ten, mut seen, mut point) = (Some(0_u128), 0_i32, 0, false);
    while let Some(&byte) = bytes.get(at) {
        match byte {
            b'0'..=b'9' => {
                let digit = u128::from(byte - b'0');
                // Below 2^106, so that two words hold it.
                digits = digits.and_then(|n| n.checked_mul(10)?.checked_add(digit)).filter(|n| *n < 1 << 106);
                ten -= i32::from(point);
                seen += 1;
            }
            b'.' if !point && seen > 0 => point = true,
            b'_' if seen > 0 && bytes.get(at + 1).is_some_and(u8::is_ascii_digit) => {}
            _ => break,
        }
        at += 1;
    }
    if seen == 0 {
        return None;
    }
    if let Some(b'e' | b'E') = bytes.get(at) {
        let signed = at + 1 + usize::from(matches!(bytes.get(at + 1), Some(b'-' | b'+')));
        let length = bytes[signed.min(bytes.len())..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        if length > 0 {
            // An exponent beyond i32 is beyond f64 in any unit.
            let exponent: i32 = text[at + 1..signed + length].parse().unwrap_or(100_000).clamp(-100_000, 100_000);
            (ten, at) = (ten + exponent, signed + length);
        }
    }
    let rounded = match digits {
        Some(_) => None,
        None => text[..at].replace('_', "").parse().ok(),
    };
    Some((Decimal { negative, digits: digits.unwrap_or(0), ten, rounded }, &text[at..]))
}

impl Unit {
    /// Parses a unit.
    pub(in super::super) fn parse(text: &str) -> Result<Self, UnitFault> {
        let mut reader = Reader { rest: text, factors: Vec::new() };
        reader.product(1, 0)?;
        if !reader.rest.is_empty() {
            return Err(UnitFault::Syntax);
        }
        let mut dimension = [0_i8; 6];
        for (unit, exponent) in &reader.factors {
            for (sum, own) in dimension.iter_mut().zip(unit.dimension.0) {
                let term = (own / 2).checked_mul(*exponent).ok_or(UnitFault::Syntax)?;
                *sum = sum.checked_add(term).ok_or(UnitFault::Syntax)?;
            }
        }
        let factors = reader.factors.into_iter().map(|(unit, exponent)| (unit.factor, exponent)).collect();
        Ok(Self { text: text.to_owned(), dimension: Dimension(dimension), factors })
    }
}

/// A unit with its prefix.
struct Found {
    factor: Factor,
    dimension: Dimension,
}

/// A unit being parsed.
struct Reader<'a> {
    rest: &'a str,
    /// The factors, each with its exponent, doubled.
    factors: Vec<(Found, i8)>,
}

impl Reader<'_> {
    /// Factors separated by `*`, `·`, blanks or `/`, up to the end or a closing bracket; `sign` is −1 in a divisor.
    fn product(&mut self, sign: i8, depth: usize) -> Result<(), UnitFault> {
        self.rest = self.rest.trim_start();
        let mut own = sign;
        loop {
            self.factor(own, depth)?;
            self.rest = self.rest.trim_start();
            if self.rest.is_empty() || self.rest.starts_with(')') {
                return Ok(());
            }
            own = if self.take('/') { -sign } else { sign };
            if own == sign && !self.take('*') {
                self.take('·');
            }
            self.rest = self.rest.trim_start();
        }
    }

    fn take(&mut self, c: char) -> bool {
        let rest = self.rest.strip_prefix(c);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn factor(&mut self, sign: i8, depth: usize) -> Result<(), UnitFault> {
        if depth > MOST_DEPTH || self.factors.len() >= MOST_FACTORS {
            return Err(UnitFault::Syntax);
        }
        let is_root = self.take('√');
        let first = self.factors.len();
        if self.take('(') {
            self.product(sign, depth + 1)?;
            if !self.take(')') {
                return Err(UnitFault::Syntax);
            }
        } else {
            let is_letter = |c: char| c.is_alphabetic() || matches!(c, '%' | '°');
            let own = |c: char| !is_letter(c);
            let length = self.rest.find(own).unwrap_or(self.rest.len());
            // A lone 1, as in 1/s.
            let length = if length == 0 && self.rest.starts_with('1') { 1 } else { length };
            let name = &self.rest[..length];
            if name.is_empty() {
                return Err(UnitFault::Syntax);
            }
            self.factors.push((named(name).ok_or_else(|| UnitFault::Unknown(name.to_owned()))?, 2 * sign));
            self.rest = &self.rest[length..];
        }
        let exponent = if is_root { 1 } else { self.exponent()? };
        for (_, own) in &mut self.factors[first..] {
            let doubled = i32::from(*own) * i32::from(exponent);
            if doubled % 2 != 0 || doubled.abs() > 4 * i32::from(MOST_POWER) {
                return Err(UnitFault::Syntax);
            }
            *own = (doubled / 2) as i8;
        }
        Ok(())
    }

    /// The exponent after a unit, doubled; 2 if there is none.
    fn exponent(&mut self) -> Result<i8, UnitFault> {
        const SUPERSCRIPTS: &str = "⁰¹²³⁴⁵⁶⁷⁸⁹";
        let raised = self.rest.starts_with('⁻') || self.rest.starts_with(|c| SUPERSCRIPTS.contains(c));
        if raised {
            let sign = if self.take('⁻') { -1 } else { 1 };
            let c = self.rest.chars().next().ok_or(UnitFault::Syntax)?;
            let digit = SUPERSCRIPTS.chars().position(|known| known == c).ok_or(UnitFault::Syntax)?;
            self.take(c);
            return Ok(2 * sign * digit as i8);
        }
        let caret = self.take('^') || {
            let rest = self.rest.strip_prefix("**");
            self.rest = rest.unwrap_or(self.rest);
            rest.is_some()
        };
        let length = self.rest.find(|c: char| !(c.is_ascii_digit() || (caret && matches!(c, '-' | '+' | '.'))));
        let length = length.unwrap_or(self.rest.len());
        let digits = &self.rest[..length];
        if digits.is_empty() {
            return if caret { Err(UnitFault::Syntax) } else { Ok(2) };
        }
        let exponent: f64 = digits.parse().map_err(|_| UnitFault::Syntax)?;
        if (2.0 * exponent).fract() != 0.0 || exponent.abs() > f64::from(MOST_POWER) {
            return Err(UnitFault::Syntax);
        }
        self.rest = &self.rest[length..];
        Ok((2.0 * exponent) as i8)
    }
}

/// The unit with this name, with or without a prefix: the whole name is tried first, so that `min` is the minute.
fn named(name: &str) -> Option<Found> {
    let find = |name: &str| UNITS.iter().find(|unit| unit.names.contains(&name));
    let found = |unit: &NamedUnit, ten: i32| Found {
        factor: Factor { ten: unit.factor.ten + ten, ..unit.factor },
        dimension: unit.dimension,
    };
    if let Some(unit) = find(name) {
        return Some(found(unit, 0));
    }
    PREFIXES.iter().find_map(|(prefix, ten)| {
        let unit = find(name.strip_prefix(prefix)?).filter(|unit| unit.prefixed)?;
        Some(found(unit, *ten))
    })
}
