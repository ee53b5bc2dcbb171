//! The amount of work for the series of an order.

use super::super::Kind;
use super::Lowered;

/// The cost of a quotient or a root, in multiplications.
const DIVISION: f64 = 10.0;

/// Time of an operation at an order, s, apart from its multiplications, and time of a multiplication: a least-squares fit over series of
/// heavy tops, gravity gradients and *orbit* (DESIGN 8.4) of orders 9 to 18, accurate to 15 %.
const OPERATION: f64 = 0.63e-9;
const MULTIPLICATION: f64 = 0.033e-9;
/// Time of a step apart from its series, s (its length, its end, lanes reassigned to other bodies), and the time in it of each direction
/// that is a state. With these, whole steps under constant torque with drag, of heavy tops, of gravity gradients and of *orbit* at targets
/// of 1e-3 to 1e-11 are predicted to within 15 %.
const STEP: f64 = 3.8e-8;
const DIRECTION: f64 = 1.0e-8;

impl Lowered {
    /// Time of a step of a body by these series, s, of one core with AVX-512.
    pub fn step_seconds(&self, order: usize) -> f64 {
        let (orders, half) = (order as f64, ((order - 1) / 2) as f64);
        // For the relative attitude, from both ends, 12 multiplications each, and the sums of its series.
        let (at_orders, multiplications) = match self.has_orientation {
            true => (0.0, 0.0),
            false => (2.0 * half, 6.0 * half * (half - 1.0) + 12.0 * half),
        };
        let operations = self.operations() as f64 * orders + at_orders;
        let vectors = self.directions.iter().map(|state| if state.turning.is_some() { 2.0 } else { 1.0 }).sum::<f64>();
        STEP + vectors * DIRECTION
            + operations * OPERATION
            + (self.multiplications(order) + multiplications) * MULTIPLICATION
    }

    /// Multiplications, with or without an addition, that form the series up to an order; work for the first coefficients alone
    /// does not count.
    fn multiplications(&self, order: usize) -> f64 {
        let orders = order as f64;
        // Σ (k + 1) over all orders k.
        let convolution = 0.5 * orders * (orders + 1.0);
        let of_draft = |draft: &super::Draft| {
            let read = draft.rows.len() - draft.writes;
            let (pairs, terms) = ((read / 2) as f64, read as f64);
            let (convolutions, linear) = match draft.kind {
                Kind::Linear => (0.0, terms),
                Kind::ShortLinear | Kind::Start | Kind::Below | Kind::And | Kind::Or | Kind::Not | Kind::Round => {
                    (0.0, 0.0)
                }
                Kind::Product => (1.0, 0.0),
                Kind::Products => (pairs, 0.0),
                Kind::VectorProducts => (0.75 * terms, 0.0),
                Kind::Square => (0.5, 1.0),
                Kind::Triple => (3.0, 0.0),
                Kind::Rotation => (7.5, 18.0),
                Kind::Euler => (3.0, 6.0 + terms),
                Kind::Attitude => (12.0, 4.0),
                Kind::Direction => (6.0, 3.0),
                Kind::TwoDirections => (12.0, 6.0),
                Kind::Turning => (12.0, 12.0),
                Kind::Quotient => (1.0, DIVISION),
                Kind::Sqrt => (0.5, DIVISION),
                Kind::SinCosAffine => (0.0, 4.0),
                Kind::SinCos => (2.0, 4.0),
                Kind::Exp => (1.0, 2.0),
                Kind::Tan => (2.5, 2.0),
                Kind::Primitive(_) | Kind::Power => (2.0, 4.0),
                Kind::Atan2 | Kind::Kepler => (4.0, 6.0),
                Kind::Pick | Kind::Integral => (0.0, 1.0),
            };
            convolutions * convolution + linear * orders
        };
        self.drafts.iter().map(of_draft).sum()
    }

    /// Operations that are executed at every order.
    fn operations(&self) -> usize {
        self.drafts.iter().filter(|draft| !matches!(draft.kind, Kind::ShortLinear | Kind::Start)).count()
    }
}
