//! Units after numbers: `"30 deg"`, `"2 rpm"`, `"7000 km"`.
//!
//! Numbers of a study are in SI units; a number with a unit is a text, and is converted. A unit is a product of named units with powers: `N
//! m s`, `kg m^2`, `m³/s²`, `N m/(rad/s)`, `rad s^-1`, `N m √s`. A `/` divides by the one factor, or bracket, that follows. Angles have a
//! dimension of their own where a number is an angle or an angular velocity, so that neither `"2 Hz"` nor `"30 %"` is accepted there; in
//! other numbers `rad` counts as 1, as in `"0.3 N m/rad"`.
//!
//! Conversions are correctly rounded, once: powers of ten and whole factors in decimal digits, others in two words.

mod parse;
mod table;

use crate::error::{Text, nearest};
use crate::math::double_double::DoubleDouble;

pub use table::describe_units;

/// The unit of a number that may have any unit, such as those of formulas.
pub(super) const ANY: &str = "*";

/// Exponents of kg, m, s, A, K and rad, each doubled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Dimension([i8; 6]);

const RAD: usize = 5;

impl Dimension {
    /// Whether a number of this dimension accepts one of the other: they must be equal except for angles, which count as 1 where none is
    /// expected.
    fn takes(self, other: Self) -> bool {
        let others_agree = self.0[..RAD] == other.0[..RAD];
        let (own, found) = (self.0[RAD], other.0[RAD]);
        let counts_as_one = own == 0 && found <= 0 && self.0[..RAD].iter().any(|exponent| *exponent != 0);
        others_agree && (own == found || counts_as_one)
    }
}

/// numerator / denominator · 10^ten · π^pi.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Factor {
    numerator: u64,
    denominator: u64,
    ten: i32,
    pi: i32,
}

/// π in two words.
const PI: DoubleDouble = DoubleDouble { high: std::f64::consts::PI, low: 1.224_646_799_147_353_2e-16 };

impl Factor {
    fn to_double_double(self) -> DoubleDouble {
        let quotient = whole(self.numerator.into()) / whole(self.denominator.into());
        quotient * power(whole(10), self.ten) * power(PI, self.pi)
    }
}

/// A whole number below 2^106.
fn whole(number: u128) -> DoubleDouble {
    let high = number as f64;
    let low = number as i128 - high as i128;
    DoubleDouble::sum_of(high, low as f64)
}

fn power(base: DoubleDouble, exponent: i32) -> DoubleDouble {
    let mut result = DoubleDouble::from_word(1.0);
    for _ in 0..exponent.unsigned_abs() {
        result = result * base;
    }
    if exponent < 0 { DoubleDouble::from_word(1.0) / result } else { result }
}

/// A parsed unit.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unit {
    /// The unit as written.
    text: String,
    dimension: Dimension,
    /// The factors, each with its exponent, doubled.
    factors: Vec<(Factor, i8)>,
}

/// Why a text is not a unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum UnitFault {
    /// Not a product of units with powers.
    Syntax,
    /// An unknown name.
    Unknown(String),
}

impl UnitFault {
    /// The text of a refusal.
    pub fn expected(&self) -> Text {
        match self {
            UnitFault::Syntax => "expected a unit after the number, such as deg, rpm, km, kg m² or N m/(rad/s)".into(),
            UnitFault::Unknown(name) => {
                let names: Vec<&str> = table::names().collect();
                let guess = table::usual(name).or_else(|| nearest(name, &names));
                let guess = guess.map(|name| format!("did you mean {name}? ")).unwrap_or_default();
                format!(
                    "unknown unit {name}: {guess}known units, those of the SI also with prefixes: {}",
                    table::first_names().join(", ")
                )
                .into()
            }
        }
    }
}

/// A number in SI units, with the unit in which it was written.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Quantity {
    pub value: f64,
    pub unit: Unit,
}

impl Unit {
    /// The SI unit of the same dimension, such as `kg m² s⁻¹`; `1` for numbers without one.
    pub fn in_si(&self) -> String {
        const NAMES: [(usize, &str); 6] = [(RAD, "rad"), (0, "kg"), (1, "m"), (2, "s"), (3, "A"), (4, "K")];
        const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
        let power = |doubled: i8| match doubled {
            2 => String::new(),
            odd if odd % 2 != 0 => format!("^{}", f64::from(odd) / 2.0),
            whole => {
                let digits = (whole / 2).unsigned_abs().to_string();
                let raised = digits.bytes().map(|digit| DIGITS[usize::from(digit - b'0')]);
                raised.fold(if whole < 0 { "⁻".to_owned() } else { String::new() }, |text, digit| {
                    format!("{text}{digit}")
                })
            }
        };
        let named =
            NAMES.iter().map(|&(place, name)| (name, self.dimension.0[place])).filter(|(_, doubled)| *doubled != 0);
        let factors: Vec<String> = named.map(|(name, doubled)| format!("{name}{}", power(doubled))).collect();
        if factors.is_empty() { "1".to_owned() } else { factors.join(" ") }
    }

    /// Checks that a number in `expected`, an SI unit, may be written in this unit; otherwise returns the text of a refusal.
    pub fn check(&self, expected: &str) -> Result<(), Text> {
        if expected == ANY {
            return Ok(());
        }
        let wanted = Unit::parse(expected).map_err(|_| Text::from(format!("expected a number ({expected})")))?;
        if wanted.dimension.takes(self.dimension) {
            return Ok(());
        }
        let found = match table::kind(self.dimension) {
            Some((kind, _)) => format!("{} is a unit of {kind}", self.text),
            None => format!("the unit {} does not fit", self.text),
        };
        Err(match table::kind(wanted.dimension) {
            Some((_, units)) if expected == "1" => format!("{found}: expected a number without a unit, or in {units}"),
            Some((kind, units)) => format!("{found}: expected a unit of {kind}, such as {units}"),
            None => format!("{found}: expected {expected}, or units that make it up"),
        }
        .into())
    }

    /// Checks that two numbers have the same dimension; otherwise returns the text of a refusal of the second.
    pub fn check_same(&self, first: &Unit) -> Result<(), Text> {
        if self.dimension == first.dimension {
            return Ok(());
        }
        Err(format!("expected a unit that measures the same as {}", first.text).into())
    }

    /// Checks that a number has the dimension of the product of two, of which one without a unit is a plain number; otherwise returns the
    /// text of a refusal.
    pub fn check_product(&self, first: Option<&Unit>, second: Option<&Unit>) -> Result<(), Text> {
        let [first, second] = [first, second].map(|unit| unit.map_or("1", |unit| &unit.text));
        let product = Unit::parse(&format!("({first}) ({second})")).map_err(|fault| fault.expected())?;
        self.check_same(&product)
    }

    /// The unit whose square this is, if there is one.
    pub fn root(&self) -> Option<Unit> {
        Unit::parse(&format!("√({})", self.text)).ok()
    }

    /// digits · 10^ten in SI units, rounded to nearest.
    fn convert(&self, negative: bool, digits: u128, ten: i32) -> f64 {
        let sign = if negative { -1.0 } else { 1.0 };
        sign * self.exactly(digits, ten).unwrap_or_else(|| self.in_two_words(digits, ten))
    }

    /// Converts in decimal digits, if all factors are whole or powers of ten.
    fn exactly(&self, mut digits: u128, mut ten: i32) -> Option<f64> {
        for (factor, exponent) in &self.factors {
            if factor.pi != 0
                || factor.denominator != 1
                || exponent % 2 != 0
                || (*exponent < 0 && factor.numerator != 1)
            {
                return None;
            }
            let exponent = i32::from(exponent / 2);
            ten += factor.ten * exponent;
            for _ in 0..exponent {
                digits = digits.checked_mul(factor.numerator.into())?;
            }
        }
        format!("{digits}e{ten}").parse().ok()
    }

    fn in_two_words(&self, digits: u128, ten: i32) -> f64 {
        // Powers of ten are combined, so that "1e-3 km" and "1 m" are one number.
        let mut ten = ten;
        let mut product = whole(digits);
        for (factor, exponent) in &self.factors {
            let rest = Factor { ten: 0, ..*factor };
            ten += factor.ten * i32::from(exponent / 2);
            product = product * power(rest.to_double_double(), i32::from(exponent / 2));
            match exponent % 2 {
                0 => {}
                1 => product = product * factor.to_double_double().sqrt(),
                _ => product = product / factor.to_double_double().sqrt(),
            }
        }
        (product * power(whole(10), ten)).to_f64()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn si(text: &str) -> f64 {
        Quantity::parse(text).expect("a number").unwrap_or_else(|fault| panic!("{text}: {fault:?}")).value
    }

    #[test]
    fn conversions_are_correctly_rounded() {
        // The right-hand sides are the nearest doubles, computed with 60 digits: π/6 in `f64` is one unit further off.
        for (text, value) in [
            ("7000 km", 7e6),
            ("7000km", 7e6),
            ("0.1 km", 100.0),
            ("1.1 mm", 0.0011),
            ("1e-3 km", 1.0),
            ("1/60 s", 1.0 / 60.0),
            ("-2/3 m", -2.0 / 3.0),
            ("30 deg", std::f64::consts::FRAC_PI_6),
            ("0.1 deg", 0.001_745_329_251_994_329_5),
            ("1 arcsec", 4.848_136_811_095_36e-6),
            ("2 rpm", 0.209_439_510_239_319_56),
            ("1 rev", std::f64::consts::TAU),
            ("-1.5 deg", -0.026_179_938_779_914_945),
            ("+1_000 g", 1.0),
            ("90 min", 5400.0),
            ("1.5 h", 5400.0),
            ("36 km/h", 10.0),
            ("7.2 km/h", 2.0),
            ("1 eV", 1.602_176_634e-19),
            ("398600.4418 km^3/s^2", 3.986_004_418e14),
            ("398600.4418 km³/s²", 3.986_004_418e14),
            ("3 N m s/T²", 3.0),
            ("2 kg m^2", 2.0),
            ("2 kg m2", 2.0),
            ("2 kg·m²", 2.0),
            ("2 kg*m**2", 2.0),
            ("4 N m √s", 4.0),
            ("4 N m s^0.5", 4.0),
            ("1 deg/√h", 2.908_882_086_657_216e-4),
            ("5 %", 0.05),
            ("0.3 N m/(rad/s)", 0.3),
            ("1 1/s", 1.0),
            ("2 s^-1", 2.0),
            ("2 s⁻¹", 2.0),
            ("1 u Å²", 1.660_539_068_92e-47),
            ("0 deg", 0.0),
            ("25 µT", 25e-6),
            ("25 μT", 25e-6),
            ("25 uT", 25e-6),
            ("3 mrad", 0.003),
            ("12345678901234567890 mm", 12_345_678_901_234_568.0),
            ("1 lb ft^2", 0.042_140_110_093_804_8),
        ] {
            assert_eq!(si(text), value, "{text}");
        }
    }

    #[test]
    fn what_is_no_number_with_a_unit_is_told_apart() {
        for text in ["", "fast", "deg 30", "e5 m", "- 5 m"] {
            assert_eq!(Quantity::parse(text), None, "{text:?}");
        }
        for text in ["30", "30 deg deg/", "1 (m", "1 m)", "1 m^", "1 /", "1 m^1.3", "1 m^99", "1/0 s", "2/3"] {
            assert_eq!(Quantity::parse(text), Some(Err(UnitFault::Syntax)), "{text:?}");
        }
        for (text, name) in [("1 degg", "degg"), ("2 kmin", "kmin"), ("1 kg km/parsec", "parsec")] {
            assert_eq!(Quantity::parse(text), Some(Err(UnitFault::Unknown(name.into()))), "{text:?}");
        }
    }

    #[test]
    fn words_for_units_are_answered_by_the_unit() {
        let expected = |name: &str| UnitFault::Unknown(name.into()).expected();
        for (word, unit) in [("sec", "s"), ("Seconds", "s"), ("hours", "h"), ("degrees", "deg"), ("kilograms", "kg")] {
            let text = expected(word);
            assert!(text.starts_with(&format!("unknown unit {word}: did you mean {unit}? known units")), "{text}");
        }
        let none = expected("furlong");
        assert!(none.starts_with("unknown unit furlong: known units"), "{none}");
        for (unit, words) in table::WORDS {
            assert!(Unit::parse(unit).is_ok(), "{unit}");
            for word in *words {
                assert!(Unit::parse(word).is_err(), "{word} is a unit, not a word for {unit}");
            }
        }
    }

    #[test]
    fn units_of_the_si() {
        for (text, unit) in [
            ("deg", "rad"),
            ("rpm", "rad s⁻¹"),
            ("mN m s", "kg m² s⁻¹"),
            ("km³/s²", "m³ s⁻²"),
            ("%", "1"),
            ("N m √s", "kg m² s^-1.5"),
        ] {
            assert_eq!(Unit::parse(text).expect("a unit").in_si(), unit, "{text}");
        }
    }

    #[test]
    fn dimensions_are_held() {
        let fits = |text: &str, unit: &str| Unit::parse(text).expect("a unit").check(unit).is_ok();
        for (text, unit) in [
            ("deg", "rad"),
            ("rpm", "rad/s"),
            ("rev/d", "rad/s"),
            ("g cm^2", "kg m²"),
            ("N m/rad", "N m"),
            ("N m/(rad/s)", "N m s"),
            ("N m s/deg", "N m s"),
            ("J", "N m"),
            ("%", "1"),
            ("Hz", "1/s"),
            ("N m/√Hz", "N m √s"),
            ("G cm^3", "T m³"),
            ("G", "*"),
        ] {
            assert!(fits(text, unit), "{text} as {unit}");
        }
        for (text, unit) in [
            ("Hz", "rad/s"),
            ("1/s", "rad/s"),
            ("deg", "1"),
            ("%", "rad"),
            ("m", "s"),
            ("rad/s", "1/s"),
            ("N m rad", "N m"),
            ("kg m", "kg m²"),
        ] {
            assert!(!fits(text, unit), "{text} as {unit}");
        }
    }

    #[test]
    fn every_declared_unit_is_read_and_is_one_of_the_si() {
        fn check(parameter: &crate::torque::ParameterDeclaration) {
            let unit =
                Unit::parse(&parameter.unit).unwrap_or_else(|_| panic!("{}: {}", parameter.name, parameter.unit));
            assert_eq!(unit.convert(false, 3, 0), 3.0, "{}: {}", parameter.name, parameter.unit);
            parameter.elements.iter().for_each(check);
        }
        crate::torque::declarations().flat_map(|model| &model.parameters).for_each(check);
    }
}
