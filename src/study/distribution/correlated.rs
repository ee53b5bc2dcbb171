//! Groups of numbers that are drawn together.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::empirical::fnv_1a;
use crate::error::{Result, Text};
use crate::study::draw::{Column, Draw};
use crate::study::reader::{Node, Table};
use crate::study::unit::Unit;

/// Normal variables with a covariance, for numbers anywhere in a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Correlated {
    variables: Vec<Variable>,
    /// The rows of the lower triangular factor of the covariance.
    factor: Vec<Vec<f64>>,
}

#[derive(Clone, Debug, PartialEq)]
struct Variable {
    name: String,
    mean: f64,
    /// The unit of its mean or, failing that, of its deviation or the root of its variance, if any of them has one.
    unit: Option<Unit>,
    /// The block under which its own part is drawn.
    block: u32,
}

/// The most variables of a group.
const MOST_VARIABLES: usize = 64;

impl Correlated {
    /// The names of the variables.
    pub(in crate::study) fn variables(&self) -> impl Iterator<Item = &str> {
        self.variables.iter().map(|variable| variable.name.as_str())
    }

    /// The value of a variable for `body`.
    pub(super) fn sample(&self, draw: Draw, body: usize, variable: usize) -> f64 {
        let terms = self.variables.iter().zip(&self.factor[variable]);
        let terms = terms.map(|(own, l)| l * draw.normal(body, Column::Correlated, own.block));
        self.variables[variable].mean + terms.sum::<f64>()
    }

    /// Whether a variable may be used for a number in `unit`.
    pub(super) fn check_unit(&self, variable: usize, unit: &str) -> Result<(), Text> {
        self.variables[variable].unit.as_ref().map_or(Ok(()), |own| own.check(unit))
    }

    /// Reads the tables `[correlated.NAME]`.
    pub(in crate::study) fn read_all(root: &Table<'_>) -> Result<BTreeMap<String, Arc<Self>>> {
        let Some(node) = root.find("correlated") else { return Ok(BTreeMap::new()) };
        const EXPECTED: &str = "expected tables [correlated.NAME]";
        let groups = node.any_table().ok_or_else(|| node.refuse(EXPECTED))?;
        let read = |(name, node): (String, Node<'_>)| {
            let table = node.any_table().ok_or_else(|| node.refuse(EXPECTED))?;
            Ok((name.clone(), Arc::new(Self::read(&name, &table)?)))
        };
        groups.nodes().into_iter().map(read).collect()
    }

    fn read(group: &str, table: &Table<'_>) -> Result<Self> {
        table.only(&["variables", "mean", "covariance", "sigma", "correlation"])?;
        let names = names(&table.need("variables", NAMES)?)?;
        let means = list(&table.need("mean", "expected the means, one of each variable")?, names.len())?;
        let (means, mut units): (Vec<f64>, Vec<Option<Unit>>) = means.into_iter().unzip();
        table.exclusive("sigma", "covariance")?;
        let (node, covariance) = match table.find("sigma") {
            Some(sigma) => {
                let sigma = deviations(&sigma, &mut units)?;
                let node = table.need("correlation", "expected the matrix of correlations beside `sigma`")?;
                let covariance = scaled(&correlation(&node, names.len())?, &sigma);
                (node, covariance)
            }
            None => {
                table.exclusive("correlation", "covariance")?;
                let node = table.need("covariance", "expected the covariance, or `sigma` and `correlation`")?;
                let covariance = covariance(&node, &mut units)?;
                (node, covariance)
            }
        };
        const MATRIX: &str = "expected a symmetric matrix without negative eigenvalues";
        let factor = cholesky(&covariance).ok_or_else(|| node.refuse(MATRIX))?;
        let variable = |((name, mean), unit): ((&str, f64), Option<Unit>)| Variable {
            name: name.to_owned(),
            mean,
            unit,
            block: fnv_1a(&format!("{group}.{name}")),
        };
        Ok(Self { variables: names.into_iter().zip(means).zip(units).map(variable).collect(), factor })
    }
}

const NAMES: &str = "expected a list of up to 64 different names";

/// The names of the variables.
fn names<'a>(node: &Node<'a>) -> Result<Vec<&'a str>> {
    let names = node.elements().filter(|names| (1..=MOST_VARIABLES).contains(&names.len()));
    let names = names.ok_or_else(|| node.refuse(NAMES))?;
    let names: Vec<&str> = names.iter().map(|name| name.string(NAMES)).collect::<Result<_>>()?;
    if names.iter().enumerate().any(|(place, name)| name.is_empty() || names[..place].contains(name)) {
        return Err(node.refuse(NAMES));
    }
    Ok(names)
}

/// `sigma`, which gives a unit to the variables whose means have none.
fn deviations(node: &Node<'_>, units: &mut [Option<Unit>]) -> Result<Vec<f64>> {
    let mut deviations = Vec::with_capacity(units.len());
    for ((deviation, own), unit) in list(node, units.len())?.into_iter().zip(units) {
        match (&own, &unit) {
            (Some(own), Some(of_mean)) => own.check_same(of_mean).map_err(|expected| node.refuse(expected))?,
            (Some(_), None) => *unit = own,
            (None, _) => {}
        }
        if deviation < 0.0 {
            return Err(node.refuse("expected standard deviations that are not negative"));
        }
        deviations.push(deviation);
    }
    Ok(deviations)
}

/// The matrix `correlation`.
fn correlation(node: &Node<'_>, count: usize) -> Result<Vec<Vec<f64>>> {
    const EXPECTED: &str = "expected 1 on the diagonal and numbers from -1 to 1 beside it";
    let rows = square(node, count)?;
    let number = |element: &Node<'_>| element.quantity("1", SQUARE);
    let rows: Vec<Vec<f64>> = rows.iter().map(|row| row.iter().map(number).collect()).collect::<Result<_>>()?;
    if rows.iter().enumerate().any(|(i, row)| row[i] != 1.0 || row.iter().any(|c| c.abs() > 1.0)) {
        return Err(node.refuse(EXPECTED));
    }
    Ok(rows)
}

/// The covariance of variables with a correlation and these standard deviations.
fn scaled(correlation: &[Vec<f64>], sigma: &[f64]) -> Vec<Vec<f64>> {
    let row = |(row, own): (&Vec<f64>, &f64)| row.iter().zip(sigma).map(|(c, other)| c * (own * other)).collect();
    correlation.iter().zip(sigma).map(row).collect()
}

/// The matrix `covariance`, SI units. An element with a unit has that of both its variables; one on the diagonal gives it to a variable whose
/// mean has none, and a variable without any is a plain number.
fn covariance(node: &Node<'_>, units: &mut [Option<Unit>]) -> Result<Vec<Vec<f64>>> {
    let nodes = square(node, units.len())?;
    let as_written = |row: &Vec<Node<'_>>| row.iter().map(|element| element.quantity_as_written(SQUARE)).collect();
    let rows: Vec<Vec<(f64, Option<Unit>)>> = nodes.iter().map(as_written).collect::<Result<_>>()?;
    for (i, unit) in units.iter_mut().enumerate() {
        if let (None, (_, Some(variance))) = (&unit, &rows[i][i]) {
            let root = variance.root();
            *unit = Some(root.ok_or_else(|| nodes[i][i].refuse("expected a variance in the square of a unit"))?);
        }
    }
    for (i, j) in (0..units.len()).flat_map(|i| (0..units.len()).map(move |j| (i, j))) {
        if let (_, Some(own)) = &rows[i][j] {
            let fits = own.check_product(units[i].as_ref(), units[j].as_ref());
            fits.map_err(|expected| nodes[i][j].refuse(expected))?;
        }
    }
    let values = |row: Vec<(f64, Option<Unit>)>| row.into_iter().map(|(value, _)| value).collect();
    Ok(rows.into_iter().map(values).collect())
}

/// `count` numbers, with units or without.
fn list(node: &Node<'_>, count: usize) -> Result<Vec<(f64, Option<Unit>)>> {
    const EXPECTED: &str = "expected a list of finite numbers, one of each variable";
    let elements = node.elements().filter(|elements| elements.len() == count).ok_or_else(|| node.refuse(EXPECTED))?;
    elements.iter().map(|element| element.quantity_as_written(EXPECTED)).collect()
}

const SQUARE: &str = "expected a row and a column of finite numbers for each variable";

/// The elements of `count` rows of `count`.
fn square<'a>(node: &Node<'a>, count: usize) -> Result<Vec<Vec<Node<'a>>>> {
    let elements = |list: &Node<'a>| list.elements().filter(|elements| elements.len() == count);
    let rows: Option<Vec<_>> = elements(node).and_then(|rows| rows.iter().map(elements).collect());
    rows.ok_or_else(|| node.refuse(SQUARE))
}

/// How far a covariance may be from symmetric, and how far below zero a pivot may be, as a part of the diagonal: enough for ten written
/// digits.
const TOLERANCE: f64 = 1e-10;

/// The lower triangular factor of a symmetric matrix without negative eigenvalues (A.-L. Cholesky 1910; G. H. Golub, C. F. Van Loan,
/// *Matrix Computations*, 4th ed., section 4.2); `None` for any other matrix.
pub(super) fn cholesky(matrix: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let count = matrix.len();
    let mut l = vec![vec![0.0; count]; count];
    for i in 0..count {
        for j in 0..=i {
            let scale = (matrix[i][i].abs() * matrix[j][j].abs()).sqrt();
            if (matrix[i][j] - matrix[j][i]).abs() > TOLERANCE * scale {
                return None;
            }
            let rest = matrix[i][j] - (0..j).map(|k| l[i][k] * l[j][k]).sum::<f64>();
            if i == j {
                if rest < -TOLERANCE * scale {
                    return None;
                }
                // A pivot that is only rounding belongs to a variable that others determine.
                l[i][i] = if rest <= TOLERANCE * scale { 0.0 } else { rest.sqrt() };
            } else if l[j][j] > 0.0 {
                l[i][j] = rest / l[j][j];
            } else if rest.abs() > TOLERANCE.sqrt() * scale {
                return None;
            }
        }
    }
    Some(l)
}
