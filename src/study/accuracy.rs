//! The table `[accuracy]` of a study.

use std::sync::LazyLock;

use super::DEFAULT_ATTITUDE;
use super::reader::{Node, Table};
use crate::error::Result;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::scene::AdaptiveSteps;
use crate::scene::{Accuracy, Scene, StatisticalAccuracy, Stepping};

/// The accuracy and steps that a study asks for; empty if it has no such table.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct StudyAccuracy {
    /// How steps are chosen; `None` if that follows from what is asked for.
    stepping: Option<Stepping>,
    pub precision: Option<Precision>,
    statistical: Option<StatisticalAccuracy>,
    /// The number of bodies that are recomputed.
    recompute: Option<usize>,
}

impl StudyAccuracy {
    /// The scene with its steps chosen.
    pub fn applied_to(self, scene: Scene) -> Scene {
        let mut scene = scene.precision(self.precision);
        if let Some(bodies) = self.recompute {
            scene = scene.recompute(bodies);
        }
        if let Some(stepping) = self.stepping {
            scene = scene.with_stepping(stepping);
        }
        match self.statistical {
            Some(statistical) => scene.statistical_accuracy(statistical),
            None => scene,
        }
    }
}

/// Names of all methods.
static METHODS: LazyLock<Vec<&'static str>> = LazyLock::new(|| {
    let all = Method::ALL.into_iter().chain([Method::Taylor]);
    all.map(Method::name).collect()
});

/// Reads the table.
pub(super) fn accuracy(node: &Node<'_>) -> Result<StudyAccuracy> {
    let table = node.table("expected a table [accuracy]", &KEYS)?;
    const PART: &str = "expected an error above 0: a part of the quantity's spread";
    const PART_OF_SPAN: &str = "expected an error above 0: a part of the span";
    let part = |key: &str, expected| table.find(key).map(|node| node.positive_quantity("1", expected)).transpose();
    let statistical = StatisticalAccuracy {
        mean: part("mean", PART)?,
        quantile: part("quantile", PART)?,
        event_time: part("event_time", PART_OF_SPAN)?,
    };
    let is_asked = statistical != StatisticalAccuracy::default();
    let (stepping, precision) = (stepping(&table)?, precision(&table)?);
    const RECOMPUTE: &str = "expected a number of bodies to be recomputed, or 0 for none";
    let recompute = table.find("recompute").map(|node| node.whole(RECOMPUTE)).transpose()?;
    let recompute = recompute.map(|bodies| usize::try_from(bodies).unwrap_or(usize::MAX));
    Ok(StudyAccuracy { stepping, precision, statistical: is_asked.then_some(statistical), recompute })
}

const KEYS: [&str; 14] = [
    "attitude",
    "angular_velocity",
    "energy",
    "percentile",
    "method",
    "dt",
    "projection",
    "tolerance",
    "least_step",
    "precision",
    "mean",
    "quantile",
    "event_time",
    "recompute",
];

/// The arithmetic, unless it is left to the plan.
fn precision(table: &Table<'_>) -> Result<Option<Precision>> {
    let named = table.find("precision").map(|node| node.choice(&["auto", "f32", "f64"])).transpose()?;
    Ok(Precision::ALL.into_iter().find(|precision| named == Some(precision.name())))
}

/// The share of the bodies, in percent, that keep to the errors asked for.
fn percentile(table: &Table<'_>) -> Result<Option<f64>> {
    const PERCENTILE: &str = "expected a percentile above 0 and up to 100";
    let Some(node) = table.find("percentile") else { return Ok(None) };
    let percent = node.percent(PERCENTILE)?;
    if percent > 0.0 { Ok(Some(percent)) } else { Err(node.refuse(PERCENTILE)) }
}

/// How steps are chosen, if the study says so.
fn stepping(table: &Table<'_>) -> Result<Option<Stepping>> {
    for target in &KEYS[..4] {
        table.exclusive(target, "method")?;
        table.exclusive(target, "dt")?;
        table.exclusive(target, "projection")?;
        table.exclusive(target, "tolerance")?;
    }
    table.exclusive("dt", "tolerance")?;
    table.exclusive("dt", "least_step")?;
    table.exclusive("projection", "tolerance")?;
    if table.find("tolerance").is_some() || table.find("least_step").is_some() {
        let tolerance = table.need("tolerance", "a least step needs the error of a step beside it")?;
        let tolerance = tolerance.positive("expected a number above 0 and below 1")?;
        let least_step =
            table.find("least_step").map(|node| node.positive_quantity("s", "expected a step above zero (s)"));
        let method = table.need("method", "adaptive steps need their method beside them: \"rk8\" or \"taylor\"")?;
        let chosen = method.choice(&METHODS)?;
        let Some(adaptive) = Method::ADAPTIVE.into_iter().find(|method| method.name() == chosen) else {
            const ADAPTIVE: &str = "methods with adaptive steps are \"rk8\" and \"taylor\": expected one of them, or dt instead of tolerance";
            return Err(method.refuse(ADAPTIVE));
        };
        let steps = AdaptiveSteps { tolerance, least_step: least_step.transpose()? };
        return Ok(Some(Stepping::adaptive(adaptive, steps)));
    }
    let projection = table.find("projection");
    if table.find("method").is_none() && table.find("dt").is_none() && projection.is_none() {
        if KEYS[..4].iter().all(|key| table.find(key).is_none()) {
            return Ok(None);
        }
        let positive =
            |key: &str, expected| table.find(key).map(|node| node.positive_quantity("1", expected)).transpose();
        const RELATIVE: &str = "expected a relative error above 0";
        const ATTITUDE: &str = "expected an angle above 0 and up to pi (rad)";
        let attitude = table.find("attitude").map(|node| node.positive_quantity("rad", ATTITUDE)).transpose()?;
        let default = Accuracy::attitude(attitude.unwrap_or(DEFAULT_ATTITUDE));
        let accuracy = Accuracy {
            angular_velocity: positive("angular_velocity", RELATIVE)?,
            energy: positive("energy", RELATIVE)?,
            percentile: percentile(table)?.unwrap_or(default.percentile),
            ..default
        };
        return Ok(Some(Stepping::Accuracy(accuracy)));
    }
    let method = table.need("method", "a step that is given needs a method beside it: \"rk4\" or \"dlm\"")?;
    let chosen = method.choice(&METHODS)?;
    if chosen == Method::Taylor.name() {
        return Err(method.refuse("the steps of \"taylor\" are adaptive: use a tolerance instead of dt"));
    }
    let dt =
        table.need("dt", "a method that is given needs a step beside it (s), or \"rk8\" or \"taylor\" a tolerance")?;
    let dt = dt.positive_quantity("s", "expected a step above zero (s)")?;
    let method = Method::ALL.into_iter().find(|method| method.name() == chosen).unwrap_or(Method::Rk4);
    let projected = projection.map(|node| node.boolean("expected true or false")).transpose()?.unwrap_or(false);
    Ok(Some(Stepping::pinned(method, dt, projected)))
}
