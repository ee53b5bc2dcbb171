//! Numbers that are drawn for bodies.

use std::sync::Arc;

use super::normal_quantile::{lower_normal_quantile, normal_probability};
use super::{Correlated, Empirical, Mixture, SELECT_NUMBER, kind, rows};
use crate::error::Result;
use crate::study::draw::{Column, Draw};
use crate::study::reader::{Node, Table, unknown_name};

/// The distribution of one number of a body; the table above has formulas and sources.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Scalar {
    /// The same number for every body.
    Constant(f64),
    /// Uniform between two numbers.
    Uniform {
        /// The lower end.
        low: f64,
        /// The upper end.
        high: f64,
    },
    /// Normal.
    Normal {
        /// Mean.
        mean: f64,
        /// Standard deviation.
        sigma: f64,
    },
    /// Log-normal: exp of a normal number with mean ln `median`.
    LogNormal {
        /// Median, above zero.
        median: f64,
        /// Standard deviation of the logarithm.
        sigma: f64,
    },
    /// Normal, between two numbers.
    TruncatedNormal(Arc<TruncatedNormal>),
    /// Exponential.
    Exponential {
        /// Mean, above zero.
        mean: f64,
    },
    /// The length of a vector with two normal components.
    Rayleigh {
        /// Standard deviation of the components.
        sigma: f64,
    },
    /// A density that rises linearly from one end to the mode and falls linearly to the other.
    Triangular {
        /// The lower end.
        low: f64,
        /// The mode, where the density is greatest.
        mode: f64,
        /// The upper end, above the lower.
        high: f64,
    },
    /// One of several distributions.
    Mixture(Arc<Mixture<Scalar>>),
    /// A row of a table.
    Rows(Arc<Empirical<1>>),
    /// A variable of a group that is drawn together.
    Correlated {
        /// The group.
        group: Arc<Correlated>,
        /// Its index there.
        variable: usize,
    },
    /// One for each cell of the study's design; body b has that of cell b modulo their number.
    PerCell(Arc<[Scalar]>),
}

/// A normal distribution restricted to an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruncatedNormal {
    mean: f64,
    sigma: f64,
    low: f64,
    high: f64,
    /// The probabilities below the lower end, above the upper end and between them, of the mirrored distribution if it is
    /// mirrored.
    below: f64,
    above: f64,
    between: f64,
    is_mirrored: bool,
}

/// With an end this many sigmas beyond the mean, the remaining probability underflows `f64`.
const FARTHEST: f64 = 37.0;

impl TruncatedNormal {
    /// Normal with this mean and standard deviation before truncation; `None` unless `sigma` > 0, `low` < `high`, and the
    /// interval reaches within 37 sigmas of the mean.
    pub fn new(mean: f64, sigma: f64, low: f64, high: f64) -> Option<Self> {
        let (a, b) = ((low - mean) / sigma, (high - mean) / sigma);
        let valid = mean.is_finite() && sigma > 0.0 && sigma.is_finite() && a < b && a <= FARTHEST && b >= -FARTHEST;
        valid.then(|| {
            // An interval above the mean is mirrored: below the mean probabilities keep their digits.
            let is_mirrored = a > 0.0;
            let (a, b) = if is_mirrored { (-b, -a) } else { (a, b) };
            let (below, above) = (normal_probability(a), normal_probability(-b));
            let between = if b <= 0.0 { normal_probability(b) - below } else { 1.0 - above - below };
            Self { mean, sigma, low, high, below, above, between, is_mirrored }
        })
    }

    fn at(&self, u: f64) -> f64 {
        // Each tail is counted from its own end, so that neither loses digits.
        let (p, q) = (self.below + u * self.between, self.above + (1.0 - u) * self.between);
        let x = if p <= 0.5 { lower_normal_quantile(p) } else { -lower_normal_quantile(q) };
        let x = if self.is_mirrored { -x } else { x };
        (self.mean + self.sigma * x).clamp(self.low, self.high)
    }
}

impl Scalar {
    /// The number of `body`; `component` distinguishes the numbers of one column.
    pub fn sample(&self, draw: Draw, body: usize, column: Column, component: u32) -> f64 {
        let uniform = || draw.uniform(body, column, component);
        let normal = || draw.normal(body, column, component);
        match self {
            Scalar::Constant(value) => *value,
            Scalar::Uniform { low, high } => low + (high - low) * uniform(),
            Scalar::Normal { mean, sigma } => mean + sigma * normal(),
            Scalar::LogNormal { median, sigma } => median * libm::exp(sigma * normal()),
            Scalar::TruncatedNormal(truncated) => truncated.at(uniform()),
            Scalar::Exponential { mean } => -mean * libm::log(uniform()),
            Scalar::Rayleigh { sigma } => sigma * (-2.0 * libm::log(uniform())).sqrt(),
            Scalar::Triangular { low, mode, high } => {
                let (u, width) = (uniform(), high - low);
                let rising = (mode - low) / width;
                if u < rising {
                    low + (u * width * (mode - low)).sqrt()
                } else {
                    high - ((1.0 - u) * width * (high - mode)).sqrt()
                }
            }
            Scalar::Mixture(mixture) => {
                mixture.part(draw, body, column, SELECT_NUMBER | component).sample(draw, body, column, component)
            }
            Scalar::Rows(rows) => rows.row(draw, body)[0],
            Scalar::Correlated { group, variable } => group.sample(draw, body, *variable),
            Scalar::PerCell(cells) => cells[draw.cell(body, cells.len())].sample(draw, body, column, component),
        }
    }

    /// Whether all bodies have the same number.
    pub(in crate::study) fn is_constant(&self) -> bool {
        matches!(self, Scalar::Constant(_))
    }

    /// Reads a number in `unit`, or its distribution.
    pub(in crate::study) fn read(node: &Node<'_>, unit: &str) -> Result<Self> {
        if let Some(cells) = node.per_cell(|node| Self::read(node, unit))? {
            return Ok(Scalar::PerCell(cells));
        }
        const EXPECTED: &str =
            "expected a number, or a distribution such as { distribution = \"normal\", mean = 1.0, sigma = 0.1 }";
        if node.is_number() {
            return node.quantity(unit, "expected a finite number").map(Scalar::Constant);
        }
        let table = node.any_table().ok_or_else(|| node.refuse(EXPECTED))?;
        match kind(&table, NAMES, EXPECTED)? {
            "constant" => {
                table.only(&["distribution", "value"])?;
                let value = table.need("value", "expected the value")?;
                value.quantity(unit, "expected a finite number").map(Scalar::Constant)
            }
            "mixture" => {
                Mixture::read(&table, |node| Self::read(node, unit), |part| matches!(part, Scalar::Mixture(_)))
                    .map(Scalar::Mixture)
            }
            "rows" => rows(&table).map(Scalar::Rows),
            "correlated" => Self::read_correlated(&table, unit),
            name => {
                Ok(by_component(&table, name, &Values { unit, of_vector: false })?.map(|[x, ..]| x).expect(COMPLETE))
            }
        }
    }

    fn read_correlated(table: &Table<'_>, unit: &str) -> Result<Self> {
        table.only(&["distribution", "variable"])?;
        const EXPECTED: &str = "expected the name of a variable, after that of its group: \"group.variable\"";
        let node = table.need("variable", EXPECTED)?;
        let name = node.string(EXPECTED)?;
        let found = name.split_once('.').and_then(|(group, variable)| {
            let group = node.context().correlated(group)?;
            Some((group, group.variables().position(|known| known == variable)?))
        });
        let Some((group, variable)) = found else {
            let names = node.context().correlated_names();
            if names.is_empty() {
                return Err(node.refuse("the study has no group [correlated.NAME] of variables"));
            }
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            return Err(node.refuse(unknown_name(name, &names, "a correlated variable")));
        };
        group.check_unit(variable, unit).map_err(|expected| node.refuse(expected))?;
        node.context().note_use(name);
        Ok(Scalar::Correlated { group: group.clone(), variable })
    }
}

/// The distributions of a number.
const NAMES: &[&str] = &[
    "constant",
    "uniform",
    "normal",
    "log-normal",
    "truncated-normal",
    "exponential",
    "rayleigh",
    "triangular",
    "mixture",
    "rows",
    "correlated",
];

/// Panic message: names that [`by_component`] does not know are read elsewhere.
pub(super) const COMPLETE: &str = "all other names have been read";

/// How the parameters of a distribution are read.
pub(super) struct Values<'a> {
    /// The unit of what is drawn.
    pub unit: &'a str,
    /// Whether three numbers, one for each component, may be given in place of one.
    pub of_vector: bool,
}

impl Values<'_> {
    /// One number for all three components, or three.
    fn three(&self, node: &Node<'_>, unit: &str, one: &'static str, three: &'static str) -> Result<[f64; 3]> {
        if !self.of_vector {
            return Ok([node.quantity(unit, one)?; 3]);
        }
        if node.is_number() { Ok([node.quantity(unit, three)?; 3]) } else { node.quantities(unit, three) }
    }

    /// The parameter `key`; each component must satisfy `holds`.
    fn valid(
        &self,
        table: &Table<'_>,
        key: &str,
        unit: &str,
        missing: &'static str,
        [one, three]: [&'static str; 2],
        holds: impl Fn(f64) -> bool,
    ) -> Result<[f64; 3]> {
        let node = table.need(key, missing)?;
        let values = self.three(&node, unit, one, three)?;
        match values.iter().all(|x| holds(*x)) {
            true => Ok(values),
            false => Err(node.refuse(if self.of_vector { three } else { one })),
        }
    }

    fn finite(&self, table: &Table<'_>, key: &str, missing: &'static str) -> Result<[f64; 3]> {
        const EXPECTED: [&str; 2] = ["expected a finite number", "expected a finite number, or three"];
        self.valid(table, key, self.unit, missing, EXPECTED, |_| true)
    }

    fn above_zero(&self, table: &Table<'_>, key: &str, missing: &'static str) -> Result<[f64; 3]> {
        const EXPECTED: [&str; 2] = ["expected a number above zero", "expected a number above zero, or three"];
        self.valid(table, key, self.unit, missing, EXPECTED, |x| x > 0.0)
    }

    fn deviations(&self, table: &Table<'_>, unit: &str, missing: &'static str) -> Result<[f64; 3]> {
        const EXPECTED: [&str; 2] = [
            "expected a standard deviation that is not negative",
            "expected a standard deviation that is not negative, or three",
        ];
        self.valid(table, "sigma", unit, missing, EXPECTED, |x| x >= 0.0)
    }

    /// The refusal of a value that does not fit those before it.
    fn refuse(&self, table: &Table<'_>, key: &str, [one, three]: [&'static str; 2]) -> crate::Error {
        let expected = if self.of_vector { three } else { one };
        table.need(key, expected).map_or_else(|error| error, |node| node.refuse(expected))
    }
}

/// A distribution that numbers have, and vectors component by component; `None` for any other name.
pub(super) fn by_component(table: &Table<'_>, name: &str, values: &Values<'_>) -> Result<Option<[Scalar; 3]>> {
    const SIGMA: &str = "expected the standard deviation";
    const MEAN: &str = "expected the mean";
    const LOW: &str = "expected the lower end";
    const HIGH: &str = "expected the upper end";
    let each = |make: &dyn Fn(usize) -> Scalar| Ok(Some([0, 1, 2].map(make)));
    match name {
        "uniform" => {
            table.only(&["distribution", "low", "high"])?;
            let (low, high) = (values.finite(table, "low", LOW)?, values.finite(table, "high", HIGH)?);
            if (0..3).any(|c| high[c] < low[c]) {
                let expected = ["expected a number not below `low`", "expected numbers not below those of `low`"];
                return Err(values.refuse(table, "high", expected));
            }
            each(&|c| Scalar::Uniform { low: low[c], high: high[c] })
        }
        "normal" => {
            let covariance: &[&str] = if values.of_vector { &["covariance"] } else { &[] };
            table.only(&[&["distribution", "mean", "sigma"], covariance].concat())?;
            let mean = values.finite(table, "mean", MEAN)?;
            let sigma = values.deviations(table, values.unit, SIGMA)?;
            each(&|c| Scalar::Normal { mean: mean[c], sigma: sigma[c] })
        }
        "log-normal" => {
            table.only(&["distribution", "median", "sigma"])?;
            let median = values.above_zero(table, "median", "expected the median")?;
            let sigma = values.deviations(table, "1", "expected the standard deviation of the logarithm")?;
            each(&|c| Scalar::LogNormal { median: median[c], sigma: sigma[c] })
        }
        "truncated-normal" => {
            table.only(&["distribution", "mean", "sigma", "low", "high"])?;
            let mean = values.finite(table, "mean", MEAN)?;
            let sigma = values.above_zero(table, "sigma", "expected the standard deviation before the truncation")?;
            let end = |key, otherwise: f64| match table.find(key) {
                Some(_) => values.finite(table, key, LOW),
                None => Ok([otherwise; 3]),
            };
            let (low, high) = (end("low", f64::NEG_INFINITY)?, end("high", f64::INFINITY)?);
            if low[0] == f64::NEG_INFINITY && high[0] == f64::INFINITY {
                table.need("low", "expected `low` or `high`, or both")?;
            }
            let key = if table.find("high").is_some() { "high" } else { "low" };
            let made = [0, 1, 2].map(|c| TruncatedNormal::new(mean[c], sigma[c], low[c], high[c]));
            let [Some(x), Some(y), Some(z)] = made else {
                const ENDS: &str =
                    "expected `low` below `high`, and an interval that reaches within 37 sigma of the mean";
                return Err(values.refuse(table, key, [ENDS; 2]));
            };
            Ok(Some([x, y, z].map(|truncated| Scalar::TruncatedNormal(Arc::new(truncated)))))
        }
        "exponential" => {
            table.only(&["distribution", "mean"])?;
            let mean = values.above_zero(table, "mean", MEAN)?;
            each(&|c| Scalar::Exponential { mean: mean[c] })
        }
        "rayleigh" => {
            table.only(&["distribution", "sigma"])?;
            let sigma = values.deviations(
                table,
                values.unit,
                "expected the standard deviation of each of the two components",
            )?;
            each(&|c| Scalar::Rayleigh { sigma: sigma[c] })
        }
        "triangular" => {
            table.only(&["distribution", "low", "mode", "high"])?;
            let low = values.finite(table, "low", LOW)?;
            let mode = values.finite(table, "mode", "expected where the density is greatest")?;
            let high = values.finite(table, "high", HIGH)?;
            if (0..3).any(|c| high[c] <= low[c]) {
                return Err(values.refuse(
                    table,
                    "high",
                    ["expected a number above `low`", "expected numbers above those of `low`"],
                ));
            }
            if (0..3).any(|c| !(low[c]..=high[c]).contains(&mode[c])) {
                return Err(values.refuse(
                    table,
                    "mode",
                    ["expected a number from `low` to `high`", "expected numbers from `low` to `high`"],
                ));
            }
            each(&|c| Scalar::Triangular { low: low[c], mode: mode[c], high: high[c] })
        }
        _ => Ok(None),
    }
}
