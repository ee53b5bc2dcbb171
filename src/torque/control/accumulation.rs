//! Numbers that add up in the course of a motion, as sampled laws that exert no torque.

use super::own::label;
use super::{ANY_SI, SampledLaw};
use crate::expression::{Expression, Shape, TextError};
use crate::torque::{Declaration, ModelRef, ParameterDeclaration, Parameters, Value};

/// How a number adds up from the values of a formula, which is evaluated at t = 0, `every`, 2 `every`, ...
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Accumulation {
    /// The integral of the formula over time, s, from the start on, by the trapezoidal rule. If the formula is smooth, its error is
    /// `every`²/12 times the change of the formula's rate from the start to the present time (L. Euler, C. Maclaurin), so that what oscillates
    /// adds no error with some eight evaluations or more an oscillation.
    Integral,
    /// How often the formula has changed its sign; zero counts as positive.
    SignChanges,
}

/// The name of the model in reports.
const NAME: &str = "accumulated";

/// The own state of such a law, with the last value and its time, s, where it is an integral.
const KEPT: &str = "kept";
const LAST: &str = "last";
const FROM: &str = "from";

impl Accumulation {
    /// The law as a torque, which is zero: a formula of the body's state and of some parameters, evaluated every so many seconds. What it
    /// keeps is completed by [`Accumulation::completed`]. Refuses a text that is not such a formula of a number.
    pub(crate) fn model(
        self,
        parameters: Parameters,
        text: &str,
        every: f64,
    ) -> Result<(ModelRef, Vec<Value>), TextError> {
        let law = SampledLaw::new(parameters, every, 0.0)?.number(KEPT, 0.0)?;
        let law = match self {
            Self::Integral => law.number(LAST, 0.0)?.number(FROM, 0.0)?,
            Self::SignChanges => law,
        };
        let law = law.sample_number("value", text)?;
        let law = match self {
            // After the first interval, half a value is always missing.
            Self::Integral => {
                law.rate(KEPT, "select(time < 0.5 * every, 0.5, 1) * value")?.next(LAST, "value")?.next(FROM, "time")?
            }
            // The last sign, times one more than the number of changes.
            Self::SignChanges => law.next(
                KEPT,
                "let sign = select(value < 0, -1, 1);
                 select(kept * sign < 0, sign * (abs(kept) + 1), select(abs(kept) < 0.5, sign, kept))",
            )?,
        };
        let law = law.with_rates()?;
        let zero = Expression::parse("vec(0, 0, 0)", law.symbols(), Shape::Vector)?;
        let declared = |name, about| ParameterDeclaration::number(name, ANY_SI, about);
        let kept = declared(KEPT, "what is kept of the sum");
        let others = [declared(LAST, "the last value"), declared(FROM, "the time of the last value, s")];
        let others = others.into_iter().filter(|_| self == Self::Integral);
        let declaration = Declaration::new(NAME, "0", "the trapezoidal rule, or counted")
            .own_state(std::iter::once(kept).chain(others).collect::<Vec<_>>());
        Ok(law.model(zero, Some(declaration))?)
    }

    /// The formula of the sum at any time, where `torque` is the index of the law among the torques of the scene.
    pub(crate) fn completed(self, text: &str, every: f64, torque: usize) -> String {
        // Without comments, the last semicolon ends the definitions.
        let text: String =
            text.lines().map(|line| line.split('#').next().unwrap_or_default().to_owned() + "\n").collect();
        let (definitions, value) = match text.rsplit_once(';') {
            Some((definitions, value)) => (format!("{definitions};"), value),
            None => (String::new(), &*text),
        };
        let kept = label(torque, KEPT);
        let sum = match self {
            // The sum has grown by the last value since, where it should by the mean of that and the present one.
            Self::Integral => {
                let [last, from] = [LAST, FROM].map(|name| label(torque, name));
                let missing = format!("select({from} < 0.5 * {every:?}, 0, {every:?} - (time - {from})) * {last}");
                format!("{kept} + 0.5 * ({missing} + (time - {from}) * ({value}))")
            }
            Self::SignChanges => {
                let changed = format!("select({kept} * select(({value}) < 0, -1, 1) < 0, 1, 0)");
                format!("max(abs({kept}) - 1, 0) + {changed}")
            }
        };
        definitions + &sum
    }
}

/// Whether a torque is none, but a law that adds up a quantity: its own state is not a result.
pub(crate) fn is_accumulation(torque: &Declaration) -> bool {
    torque.name == NAME
}
