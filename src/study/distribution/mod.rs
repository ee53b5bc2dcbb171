//! Distributions from which bodies are drawn.
//!
//! # Numbers
//!
//! u and v are the two uniform numbers on (0, 1) of a block ([`crate::study::draw`]); z = √(−2 ln u) cos 2πv is the standard normal
//! number formed from them.
//!
//! | distribution | keys | drawn as |
//! | --- | --- | --- |
//! | `constant` | `value` | itself |
//! | `uniform` | `low`, `high` | low + (high − low) u |
//! | `normal` | `mean`, `sigma` | mean + sigma z (G. E. P. Box, M. E. Muller 1958) |
//! | `log-normal` | `median`, `sigma` | median exp(sigma z) |
//! | `truncated-normal` | `mean`, `sigma`, `low`, `high` (one of both may be left out) | mean + sigma Φ⁻¹(Φ(a) + u (Φ(b) − Φ(a))), a and b being the ends in sigmas from the mean; Φ⁻¹ by M. J. Wichura, algorithm AS 241, Appl. Statist. 37 (1988) 477 |
//! | `exponential` | `mean` | −mean ln u |
//! | `rayleigh` | `sigma` | sigma √(−2 ln u); the mean is sigma √(π/2) |
//! | `triangular` | `low`, `mode`, `high` | the inverse of its distribution function at u |
//! | `mixture` | `weights`, `of` | one of the numbers or distributions `of`, each with a probability in proportion to its weight |
//! | `rows` | `file`, `column` (of vectors and orientations `columns`) | a row of a CSV file, all rows being as likely; the keys of a study that name the same file take the same row |
//! | `correlated` | `variable` | a variable of a group `[correlated.NAME]`: mean + L z, L Lᵀ being the covariance (A.-L. Cholesky 1910) |
//!
//! # Vectors
//!
//! Vectors may be drawn from the distributions of numbers, each component independently, with one number in place of three; from a list
//! `[x, y, z]` of numbers and distributions; from `normal` with a `covariance` of three rows instead of `sigma`; and, with a `magnitude`
//! that may be a distribution, from
//!
//! | distribution | keys | drawn as |
//! | --- | --- | --- |
//! | `direction` | | uniform on the sphere (Archimedes) |
//! | `von-mises-fisher` | `axis`, `concentration` κ | density ∝ exp(κ cos θ) at the angle θ from the axis: cos θ = 1 + ln(1 − (1 − u)(1 − e^(−2κ)))/κ (G. Ulrich, Appl. Statist. 33 (1984) 158) |
//! | `cone` | `axis`, `half_angle` | uniform on the part of the sphere that lies within the half angle of the axis |
//!
//! # Orientations
//!
//! A quaternion; `{ axis, angle }`, and `{ euler, angles }` with the axes of three turns (about = "body" or "world"), where angles may be
//! distributions; and
//!
//! | distribution | keys | drawn as |
//! | --- | --- | --- |
//! | `uniform` | | uniform on SO(3) (K. Shoemake 1992) |
//! | `scatter` | `about`, `sigma` | R exp(φ×): the attitude R turned by a rotation vector φ in body axes with normal components |
//! | `rows`, `mixture` | | as of numbers |
//!
//! # Angular velocities of a body's own moments
//!
//! I₁ ≤ I₂ ≤ I₃ are the body's principal moments, and components are along its principal axes. A linear rotor has no spin about
//! its axis.
//!
//! | distribution | keys | drawn as |
//! | --- | --- | --- |
//! | `thermal` | `temperature` | ωᵢ = √(k T/Iᵢ) zᵢ, Boltzmann's distribution of free rotors (L. D. Landau, E. M. Lifshitz, *Statistical Physics*, § 51), k = 1.380649e-23 J/K |
//! | `fixed-energy` | `energy` | ωᵢ = √(2E/Iᵢ) nᵢ with n uniform on the sphere: the thermal distribution on the surface of one energy |
//! | `fixed-angular-momentum` | `angular_momentum` | ωᵢ = L nᵢ/Iᵢ: the momentum has one magnitude, and no direction of the body is preferred |

mod correlated;
mod empirical;
mod normal_quantile;
mod orientation;
mod rotor;
mod scalar;
mod vector;

use std::sync::Arc;

pub use correlated::Correlated;
pub use empirical::Empirical;
pub use orientation::Orientation;
pub use rotor::AngularVelocity;
pub use scalar::Scalar;
pub use vector::Vector;

use super::draw::{Column, Draw};
use super::reader::{Node, Table};
use crate::error::Result;

/// Blocks from here on select the part of a mixture: of numbers, where the component is added, and of everything else.
const SELECT_NUMBER: u32 = 0x1_0000;
const SELECT: u32 = 0x2_0000;

/// One of several distributions, each with its probability.
#[derive(Clone, Debug, PartialEq)]
pub struct Mixture<T> {
    /// Sums of the weights, the last 1.
    cumulative: Vec<f64>,
    of: Vec<T>,
}

impl<T> Mixture<T> {
    /// A mixture of parts with their weights, which need not add up to 1; `None` if their numbers differ, or weights are negative or all
    /// zero.
    pub fn new(weights: &[f64], of: Vec<T>) -> Option<Self> {
        let total: f64 = weights.iter().sum();
        let valid = weights.len() == of.len() && weights.iter().all(|w| *w >= 0.0) && total > 0.0 && total.is_finite();
        valid.then(|| {
            let mut sum = 0.0;
            let mut cumulative: Vec<f64> = weights
                .iter()
                .map(|weight| {
                    sum += weight;
                    sum / total
                })
                .collect();
            // The remainder from rounding goes to the last part with a nonzero weight.
            let last = weights.iter().rposition(|weight| *weight > 0.0).unwrap_or(0);
            cumulative[last..].fill(1.0);
            Self { cumulative, of }
        })
    }

    /// The part of `body`.
    fn part(&self, draw: Draw, body: usize, column: Column, block: u32) -> &T {
        let u = draw.uniform(body, column, block);
        &self.of[self.cumulative.partition_point(|sum| *sum <= u).min(self.of.len() - 1)]
    }

    fn read(
        table: &Table<'_>,
        read: impl Fn(&Node<'_>) -> Result<T>,
        is_mixture: impl Fn(&T) -> bool,
    ) -> Result<Arc<Self>> {
        table.only(&["distribution", "weights", "of"])?;
        const WEIGHTS: &str = "expected a list of weights, none negative and not all zero, one for each part in `of`";
        let node = table.need("of", "expected a list of values or distributions")?;
        let elements = node.elements().filter(|elements| !elements.is_empty());
        let elements =
            elements.ok_or_else(|| node.refuse("expected a list of values or distributions, one at least"))?;
        let mut of = Vec::with_capacity(elements.len());
        for element in &elements {
            let part = read(element)?;
            if is_mixture(&part) {
                return Err(element.refuse("expected no mixture within a mixture: write its parts here"));
            }
            of.push(part);
        }
        let node = table.need("weights", WEIGHTS)?;
        let weights = node.elements().ok_or_else(|| node.refuse(WEIGHTS))?;
        let weights: Vec<f64> = weights.iter().map(|weight| weight.quantity("1", WEIGHTS)).collect::<Result<_>>()?;
        Mixture::new(&weights, of).map(Arc::new).ok_or_else(|| node.refuse(WEIGHTS))
    }
}

/// The distribution that a table names; refused with `expected` if it names none.
fn kind(table: &Table<'_>, choices: &'static [&'static str], expected: &'static str) -> Result<&'static str> {
    table.need("distribution", expected)?.choice(choices)
}

/// The rows of `{ distribution = "rows", file, column or columns }`.
fn rows<const N: usize>(table: &Table<'_>) -> Result<Arc<Empirical<N>>> {
    let key = if N == 1 { "column" } else { "columns" };
    table.only(&["distribution", "file", key])?;
    let file = table.need("file", "expected the name of a CSV file with a header")?;
    let node = table.need(key, "expected the names of its columns, in SI units")?;
    let names: Vec<&str> = match N {
        1 => vec![node.string("expected the name of a column")?],
        _ => {
            let expected =
                if N == 3 { "expected the names of three columns" } else { "expected four columns (x, y, z, w)" };
            let elements = node.elements().filter(|elements| elements.len() == N);
            let elements = elements.ok_or_else(|| node.refuse(expected))?;
            elements.iter().map(|name| name.string("expected the name of a column")).collect::<Result<_>>()?
        }
    };
    let name = file.string("expected the name of a CSV file")?;
    let names: [&str; N] = std::array::from_fn(|place| names[place]);
    Empirical::of_study(&file, name, &names).map(Arc::new).map_err(|error| file.caused_by(error))
}
