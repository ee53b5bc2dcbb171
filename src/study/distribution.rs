//! What bodies are drawn from.

use glam::{DQuat, DVec3};

use super::draw::{Column, Draw};
use super::reader::{Node, Table};
use crate::error::Result;

/// What one number of a body is drawn from.
#[derive(Clone, Copy, Debug, PartialEq)]
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
}

impl Scalar {
    /// The number of `body`; `component` tells the numbers of one column apart.
    pub fn sample(&self, draw: Draw, body: usize, column: Column, component: u32) -> f64 {
        match *self {
            Scalar::Constant(value) => value,
            Scalar::Uniform { low, high } => low + (high - low) * draw.uniform(body, column, component),
            Scalar::Normal { mean, sigma } => mean + sigma * draw.normal(body, column, component),
            Scalar::LogNormal { median, sigma } => median * libm::exp(sigma * draw.normal(body, column, component)),
        }
    }

    /// Whether all bodies have the same number.
    pub(super) fn is_constant(&self) -> bool {
        matches!(self, Scalar::Constant(_))
    }

    pub(super) fn read(node: &Node<'_>) -> Result<Self> {
        const EXPECTED: &str =
            "expected a number, or a distribution such as { distribution = \"normal\", mean = 1.0, sigma = 0.1 }";
        const CHOICES: &[&str] = &["constant", "uniform", "normal", "log-normal"];
        if node.is_number() {
            return node.number("expected a finite number").map(Scalar::Constant);
        }
        let table = node.any_table().ok_or_else(|| node.refuse(EXPECTED))?;
        match parameters(&table, CHOICES, EXPECTED)? {
            Parameters::Constant(value) => value.number("expected a finite number").map(Scalar::Constant),
            Parameters::Uniform { low, high } => {
                let low = low.number("expected a finite number")?;
                let upper = high.number("expected a finite number")?;
                if upper < low {
                    return Err(high.refuse("expected a number not below `low`"));
                }
                Ok(Scalar::Uniform { low, high: upper })
            }
            Parameters::Normal { mean, sigma } => Ok(Scalar::Normal {
                mean: mean.number("expected a finite number")?,
                sigma: standard_deviation(&sigma)?,
            }),
            Parameters::LogNormal { median, sigma } => Ok(Scalar::LogNormal {
                median: median.positive("expected a number above zero")?,
                sigma: standard_deviation(&sigma)?,
            }),
        }
    }
}

/// What a vector of a body is drawn from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Vector {
    /// Each component by itself.
    Components([Scalar; 3]),
    /// A direction uniform on the sphere, with a magnitude drawn by itself.
    Direction {
        /// The magnitude; a negative one turns the direction round.
        magnitude: Scalar,
    },
}

impl Vector {
    /// The same vector for every body.
    pub fn constant(value: DVec3) -> Self {
        Vector::Components(value.to_array().map(Scalar::Constant))
    }

    /// The vector of `body`; `magnitude` is the column that a magnitude is drawn under.
    pub fn sample(&self, draw: Draw, body: usize, column: Column) -> DVec3 {
        match self {
            Vector::Components(components) => {
                let [x, y, z] = [0, 1, 2].map(|c| components[c].sample(draw, body, column, c as u32));
                DVec3::new(x, y, z)
            }
            // Block 0 holds the direction, so the magnitude takes block 1.
            Vector::Direction { magnitude } => draw.direction(body, column) * magnitude.sample(draw, body, column, 1),
        }
    }

    /// Whether all bodies have the same vector.
    pub(super) fn is_constant(&self) -> bool {
        matches!(self, Vector::Components(components) if components.iter().all(Scalar::is_constant))
    }

    pub(super) fn read(node: &Node<'_>) -> Result<Self> {
        const EXPECTED: &str = "expected a vector [x, y, z], or a distribution such as { distribution = \"normal\", mean = [0, 0, 0.1], sigma = 0.02 }";
        const CHOICES: &[&str] = &["constant", "uniform", "normal", "log-normal", "direction"];
        if node.elements().is_some() {
            return node.vector("expected three finite numbers").map(Vector::constant);
        }
        let table = node.any_table().ok_or_else(|| node.refuse(EXPECTED))?;
        if let Some(kind) = table.find("distribution")
            && kind.choice(CHOICES)? == "direction"
        {
            table.only(&["distribution", "magnitude"])?;
            let magnitude = table.need("magnitude", "expected the vector's length, a number or a distribution")?;
            return Ok(Vector::Direction { magnitude: Scalar::read(&magnitude)? });
        }
        let components = match parameters(&table, CHOICES, EXPECTED)? {
            Parameters::Constant(value) => {
                return value.vector("expected three finite numbers").map(Vector::constant);
            }
            Parameters::Uniform { low, high } => {
                let (lower, upper) = (one_or_three(&low)?, one_or_three(&high)?);
                if (0..3).any(|c| upper[c] < lower[c]) {
                    return Err(high.refuse("expected numbers not below those of `low`"));
                }
                [0, 1, 2].map(|c| Scalar::Uniform { low: lower[c], high: upper[c] })
            }
            Parameters::Normal { mean, sigma } => {
                let (mean, sigma) = (one_or_three(&mean)?, standard_deviations(&sigma)?);
                [0, 1, 2].map(|c| Scalar::Normal { mean: mean[c], sigma: sigma[c] })
            }
            Parameters::LogNormal { median, sigma } => {
                let (medians, sigma) = (one_or_three(&median)?, standard_deviations(&sigma)?);
                if medians.iter().any(|x| *x <= 0.0) {
                    return Err(median.refuse("expected numbers above zero"));
                }
                [0, 1, 2].map(|c| Scalar::LogNormal { median: medians[c], sigma: sigma[c] })
            }
        };
        Ok(Vector::Components(components))
    }
}

/// What an orientation is drawn from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Orientation {
    /// The same for every body; any quaternion that is not zero.
    Constant(DQuat),
    /// Uniform on SO(3).
    Uniform,
}

impl Orientation {
    /// The orientation of `body`.
    pub fn sample(&self, draw: Draw, body: usize) -> DQuat {
        self.sample_as(draw, body, Column::Orientation)
    }

    /// An orientation that `body` has beside its own, drawn under `column`.
    pub(super) fn sample_as(&self, draw: Draw, body: usize, column: Column) -> DQuat {
        match *self {
            Orientation::Constant(orientation) => orientation,
            Orientation::Uniform => draw.rotation(body, column),
        }
    }

    /// Whether all bodies have the same orientation.
    pub(super) fn is_constant(&self) -> bool {
        matches!(self, Orientation::Constant(_))
    }

    pub(super) fn read(node: &Node<'_>) -> Result<Self> {
        const EXPECTED: &str = "expected a quaternion [x, y, z, w], { axis = [x, y, z], angle = radians } or { distribution = \"uniform\" }";
        if node.elements().is_some() {
            return quaternion(node);
        }
        let table = node.any_table().ok_or_else(|| node.refuse(EXPECTED))?;
        if let Some(axis) = table.find("axis") {
            table.only(&["axis", "angle"])?;
            let direction = axis.vector("expected three finite numbers")?;
            let angle = table.need("angle", "expected the angle turned about the axis (rad)")?;
            let angle = angle.number("expected a finite angle (rad)")?;
            // By the largest component first, so that no square leaves the range of numbers.
            let scaled = direction / direction.abs().max_element();
            let unit = scaled.try_normalize().ok_or_else(|| axis.refuse("expected an axis that is not zero"))?;
            let (sin, cos) = libm::sincos(0.5 * angle);
            let vector = unit * sin;
            return Ok(Orientation::Constant(DQuat::from_xyzw(vector.x, vector.y, vector.z, cos)));
        }
        let kind = table.find("distribution").ok_or_else(|| node.refuse(EXPECTED))?;
        match kind.choice(&["uniform", "constant"])? {
            "constant" => {
                table.only(&["distribution", "value"])?;
                quaternion(&table.need("value", "expected a quaternion [x, y, z, w]")?)
            }
            _ => {
                table.only(&["distribution"])?;
                Ok(Orientation::Uniform)
            }
        }
    }
}

/// A quaternion [x, y, z, w].
fn quaternion(node: &Node<'_>) -> Result<Orientation> {
    let elements: [f64; 4] = node.numbers("expected four finite numbers x, y, z, w")?;
    if elements == [0.0; 4] {
        return Err(node.refuse("expected a quaternion that is not zero"));
    }
    Ok(Orientation::Constant(DQuat::from_array(elements)))
}

/// The parameters of a distribution, not yet read.
enum Parameters<'a> {
    Constant(Node<'a>),
    Uniform { low: Node<'a>, high: Node<'a> },
    Normal { mean: Node<'a>, sigma: Node<'a> },
    LogNormal { median: Node<'a>, sigma: Node<'a> },
}

fn parameters<'a>(
    table: &Table<'a>,
    choices: &'static [&'static str],
    expected: &'static str,
) -> Result<Parameters<'a>> {
    const SIGMA: &str = "expected the standard deviation";
    match table.need("distribution", expected)?.choice(choices)? {
        "uniform" => {
            table.only(&["distribution", "low", "high"])?;
            Ok(Parameters::Uniform {
                low: table.need("low", "expected the lower end")?,
                high: table.need("high", "expected the upper end")?,
            })
        }
        "normal" => {
            table.only(&["distribution", "mean", "sigma"])?;
            Ok(Parameters::Normal {
                mean: table.need("mean", "expected the mean")?,
                sigma: table.need("sigma", SIGMA)?,
            })
        }
        "log-normal" => {
            table.only(&["distribution", "median", "sigma"])?;
            Ok(Parameters::LogNormal {
                median: table.need("median", "expected the median")?,
                sigma: table.need("sigma", "expected the standard deviation of the logarithm")?,
            })
        }
        _ => {
            table.only(&["distribution", "value"])?;
            Ok(Parameters::Constant(table.need("value", "expected the value")?))
        }
    }
}

/// A number, taken for all three components, or three.
fn one_or_three(node: &Node<'_>) -> Result<[f64; 3]> {
    if node.is_number() {
        return Ok([node.number("expected a finite number")?; 3]);
    }
    node.numbers("expected a finite number, or three")
}

fn standard_deviation(node: &Node<'_>) -> Result<f64> {
    const EXPECTED: &str = "expected a standard deviation that is not negative";
    let sigma = node.number(EXPECTED)?;
    if sigma < 0.0 { Err(node.refuse(EXPECTED)) } else { Ok(sigma) }
}

fn standard_deviations(node: &Node<'_>) -> Result<[f64; 3]> {
    let sigma = one_or_three(node)?;
    if sigma.iter().any(|s| *s < 0.0) {
        return Err(node.refuse("expected standard deviations that are not negative"));
    }
    Ok(sigma)
}
