//! The units that a study may write, and what they measure.

use std::fmt::Write;

use super::{Dimension, Factor};

/// A unit by its name.
#[derive(Debug)]
pub(super) struct NamedUnit {
    /// The spellings: messages suggest the first.
    pub names: &'static [&'static str],
    /// Whether it takes SI prefixes.
    pub prefixed: bool,
    /// Its value in SI units.
    pub factor: Factor,
    pub dimension: Dimension,
}

const fn dimension(kg: i8, m: i8, s: i8, ampere: i8, kelvin: i8, rad: i8) -> Dimension {
    // Exponents are stored doubled, so that square roots can be represented.
    Dimension([2 * kg, 2 * m, 2 * s, 2 * ampere, 2 * kelvin, 2 * rad])
}

const NONE: Dimension = dimension(0, 0, 0, 0, 0, 0);
const MASS: Dimension = dimension(1, 0, 0, 0, 0, 0);
const LENGTH: Dimension = dimension(0, 1, 0, 0, 0, 0);
const TIME: Dimension = dimension(0, 0, 1, 0, 0, 0);
const CURRENT: Dimension = dimension(0, 0, 0, 1, 0, 0);
const TEMPERATURE: Dimension = dimension(0, 0, 0, 0, 1, 0);
const ANGLE: Dimension = dimension(0, 0, 0, 0, 0, 1);
const RATE: Dimension = dimension(0, 0, -1, 0, 0, 1);
const FREQUENCY: Dimension = dimension(0, 0, -1, 0, 0, 0);
const FORCE: Dimension = dimension(1, 1, -2, 0, 0, 0);
const ENERGY: Dimension = dimension(1, 2, -2, 0, 0, 0);
const FIELD: Dimension = dimension(1, 0, -2, -1, 0, 0);

const fn exactly(numerator: u64, denominator: u64, ten: i32, pi: i32) -> Factor {
    Factor { numerator, denominator, ten, pi }
}

/// The factor for a power of ten.
const fn power_of_ten(ten: i32) -> Factor {
    exactly(1, 1, ten, 0)
}

const ONE: Factor = power_of_ten(0);

const fn unit(names: &'static [&'static str], factor: Factor, dimension: Dimension) -> NamedUnit {
    NamedUnit { names, prefixed: false, factor, dimension }
}

const fn prefixed(names: &'static [&'static str], factor: Factor, dimension: Dimension) -> NamedUnit {
    NamedUnit { names, prefixed: true, factor, dimension }
}

/// All units. Those of the SI are defined by it (*The International System of Units*, 9th ed., 2019); `eV`, `au`, `in`, `ft` and
/// `lb` are exact by definition too; `u` is the value of CODATA 2022, `d` is 86,400 s and `yr` 365.25 d.
pub(super) const UNITS: &[NamedUnit] = &[
    prefixed(&["g"], power_of_ten(-3), MASS),
    unit(&["t"], power_of_ten(3), MASS),
    unit(&["u", "Da"], exactly(166_053_906_892, 1, -38, 0), MASS),
    unit(&["lb"], exactly(45_359_237, 1, -8, 0), MASS),
    prefixed(&["m"], ONE, LENGTH),
    unit(&["Å", "Å", "angstrom"], power_of_ten(-10), LENGTH),
    unit(&["au"], exactly(149_597_870_700, 1, 0, 0), LENGTH),
    unit(&["in"], exactly(254, 1, -4, 0), LENGTH),
    unit(&["ft"], exactly(3048, 1, -4, 0), LENGTH),
    prefixed(&["s"], ONE, TIME),
    unit(&["min"], exactly(60, 1, 0, 0), TIME),
    unit(&["h"], exactly(3600, 1, 0, 0), TIME),
    unit(&["d", "day", "days"], exactly(86_400, 1, 0, 0), TIME),
    unit(&["yr"], exactly(31_557_600, 1, 0, 0), TIME),
    prefixed(&["rad"], ONE, ANGLE),
    unit(&["deg", "°"], exactly(1, 180, 0, 1), ANGLE),
    unit(&["arcmin"], exactly(1, 10_800, 0, 1), ANGLE),
    prefixed(&["arcsec"], exactly(1, 648_000, 0, 1), ANGLE),
    unit(&["rev", "turn"], exactly(2, 1, 0, 1), ANGLE),
    unit(&["rpm"], exactly(1, 30, 0, 1), RATE),
    prefixed(&["Hz"], ONE, FREQUENCY),
    prefixed(&["N"], ONE, FORCE),
    prefixed(&["Pa"], ONE, dimension(1, -1, -2, 0, 0, 0)),
    prefixed(&["J"], ONE, ENERGY),
    prefixed(&["eV"], exactly(1_602_176_634, 1, -28, 0), ENERGY),
    prefixed(&["W"], ONE, dimension(1, 2, -3, 0, 0, 0)),
    prefixed(&["A"], ONE, CURRENT),
    prefixed(&["T"], ONE, FIELD),
    prefixed(&["G"], power_of_ten(-4), FIELD),
    prefixed(&["K"], ONE, TEMPERATURE),
    unit(&["%"], power_of_ten(-2), NONE),
    unit(&["1"], ONE, NONE),
];

/// The SI prefixes, with their powers of ten.
pub(super) const PREFIXES: &[(&str, i32)] = &[
    ("q", -30),
    ("r", -27),
    ("y", -24),
    ("z", -21),
    ("a", -18),
    ("f", -15),
    ("p", -12),
    ("n", -9),
    ("µ", -6),
    ("μ", -6),
    ("u", -6),
    ("m", -3),
    ("c", -2),
    ("d", -1),
    ("h", 2),
    ("k", 3),
    ("M", 6),
    ("G", 9),
    ("T", 12),
    ("P", 15),
    ("E", 18),
    ("Z", 21),
    ("Y", 24),
    ("R", 27),
    ("Q", 30),
];

/// The dimensions, with their names and units that a message suggests.
const KINDS: &[(Dimension, &str, &str)] = &[
    (NONE, "a plain number", "%"),
    (MASS, "mass", "kg, g, t, u"),
    (LENGTH, "length", "m, mm, km"),
    (TIME, "time", "s, ms, min, h, d"),
    (ANGLE, "angle", "rad, deg, arcmin, arcsec, rev"),
    (RATE, "angular velocity", "rad/s, deg/s, rpm, rev/d"),
    (FREQUENCY, "frequency", "1/s, Hz"),
    (TEMPERATURE, "temperature", "K, mK"),
    (CURRENT, "current", "A"),
    (FIELD, "magnetic field", "T, nT, G"),
    (FORCE, "force", "N, mN"),
    (ENERGY, "torque or energy", "N m, J, eV"),
    (dimension(0, 1, -1, 0, 0, 0), "velocity", "m/s, km/s, km/h"),
    (dimension(0, 1, -2, 0, 0, 0), "acceleration", "m/s²"),
    (dimension(0, 2, 0, 0, 0, 0), "area", "m², cm²"),
    (dimension(0, 3, 0, 0, 0, 0), "volume", "m³, cm³"),
    (dimension(1, -3, 0, 0, 0, 0), "density", "kg/m³, g/cm³"),
    (dimension(1, 2, 0, 0, 0, 0), "moment of inertia", "kg m², g cm², u Å²"),
    (dimension(1, 2, -1, 0, 0, 0), "angular momentum or damping", "kg m²/s, N m s"),
    (dimension(1, -1, -2, 0, 0, 0), "pressure", "Pa, N/m²"),
    (dimension(0, 3, -2, 0, 0, 0), "gravitational parameter", "m³/s², km³/s²"),
    (dimension(0, 2, 0, 1, 0, 0), "magnetic moment", "A m², mA m²"),
];

/// The name of a dimension, and units of it.
pub(super) fn kind(dimension: Dimension) -> Option<(&'static str, &'static str)> {
    KINDS.iter().find(|(known, ..)| *known == dimension).map(|&(_, name, units)| (name, units))
}

/// Words and abbreviations whose letters differ too much from those of the unit that they mean.
pub(super) const WORDS: &[(&str, &[&str])] = &[
    ("s", &["sec", "secs", "second", "seconds"]),
    ("min", &["minute", "minutes"]),
    ("h", &["hr", "hrs", "hour", "hours"]),
    ("yr", &["year", "years"]),
    ("m", &["meter", "meters", "metre", "metres"]),
    ("km", &["kilometer", "kilometers", "kilometre", "kilometres"]),
    ("kg", &["kilo", "kilos", "kilogram", "kilograms"]),
    ("g", &["gram", "grams", "gm"]),
    ("t", &["ton", "tons", "tonne", "tonnes"]),
    ("lb", &["lbm", "pound", "pounds"]),
    ("in", &["inch", "inches"]),
    ("ft", &["foot", "feet"]),
    ("rad", &["radian", "radians"]),
    ("deg", &["degree", "degrees"]),
    ("rev", &["revolution", "revolutions"]),
    ("N", &["newton", "newtons"]),
    ("Pa", &["pascal", "pascals"]),
    ("J", &["joule", "joules"]),
    ("W", &["watt", "watts"]),
    ("A", &["amp", "amps", "ampere", "amperes"]),
    ("T", &["tesla", "teslas"]),
    ("G", &["gauss"]),
    ("K", &["kelvin", "kelvins"]),
    ("%", &["percent"]),
];

/// The unit that a word means.
pub(super) fn usual(word: &str) -> Option<&'static str> {
    let word = word.to_lowercase();
    WORDS.iter().find(|(_, words)| words.contains(&word.as_str())).map(|(unit, _)| *unit)
}

/// The names of all units, without prefixes.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    UNITS.iter().flat_map(|unit| unit.names).copied()
}

/// The first name of each unit.
pub(super) fn first_names() -> Vec<&'static str> {
    UNITS.iter().map(|unit| unit.names[0]).filter(|name| *name != "1").collect()
}

/// The units that numbers of a study may carry, as `polhode run --help` prints them.
pub fn describe_units() -> String {
    let mut text = String::new();
    for wrapped in [true, false] {
        let names: Vec<&str> = UNITS
            .iter()
            .filter(|unit| unit.prefixed == wrapped)
            .map(|unit| unit.names[0])
            .filter(|n| *n != "1")
            .collect();
        let about = if wrapped { "with prefixes (k, m, µ or u, ...):" } else { "without:" };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "    {about} {}", names.join(" "));
    }
    text
}
