//! By which a scene is told from another.

use std::fmt::{self, Write};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::run::shadow::mixed;
use crate::scene::Scene;

/// What a plan remembers of its scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SceneMarks {
    bodies: usize,
    span: f64,
    outputs: usize,
    accuracy: String,
    precision: String,
    torques: Vec<String>,
    forces: Vec<String>,
    skipping: bool,
    /// Of all columns and parameters, in hexadecimal digits.
    fingerprint: String,
}

impl SceneMarks {
    pub fn of(scene: &Scene, outputs: usize) -> Self {
        Self {
            bodies: scene.ensemble().len(),
            span: scene.end(),
            outputs,
            accuracy: scene.stepping().to_string(),
            precision: scene.wanted_precision().map_or("auto", |precision| precision.name()).to_owned(),
            torques: scene.torques().iter().map(|torque| torque.name().to_owned()).collect(),
            forces: scene.forces().iter().map(|force| force.name().to_owned()).collect(),
            skipping: scene.may_skip(),
            fingerprint: format!("{:016x}", fingerprint(scene)),
        }
    }

    /// Torques of the scene.
    pub fn torque_count(&self) -> usize {
        self.torques.len()
    }

    /// The first thing in which two scenes differ.
    pub fn first_difference(&self, other: &Self) -> Option<Difference> {
        let list = |names: &[String]| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        let skipping = |may: bool| if may { "allowed" } else { "forbidden (--no-skip)" }.to_owned();
        let fields = [
            ("the number of bodies", self.bodies.to_string(), other.bodies.to_string()),
            ("the span", format!("{:?} s", self.span), format!("{:?} s", other.span)),
            ("the number of output times", self.outputs.to_string(), other.outputs.to_string()),
            ("the accuracy", self.accuracy.clone(), other.accuracy.clone()),
            ("the precision", self.precision.clone(), other.precision.clone()),
            ("the list of torques", list(&self.torques), list(&other.torques)),
            ("the list of forces", list(&self.forces), list(&other.forces)),
            (SKIPPING, skipping(self.skipping), skipping(other.skipping)),
            ("the fingerprint of bodies and parameters", self.fingerprint.clone(), other.fingerprint.clone()),
        ];
        let (field, planned, found) = fields.into_iter().find(|(_, here, there)| here != there)?;
        let remedy = match (field == SKIPPING, self.skipping) {
            (false, _) => "run the study that it was made for, or run without --plan",
            (true, false) => "repeat it with --no-skip, or run without --plan",
            (true, true) => "repeat it without --no-skip, or run without --plan",
        };
        Some(Difference { field, planned, found, remedy })
    }
}

/// In what a scene is not the one that a plan was made for.
pub(super) struct Difference {
    pub field: &'static str,
    pub planned: String,
    pub found: String,
    pub remedy: &'static str,
}

const SKIPPING: &str = "skipping";

/// Folds words into a number whose bits depend on all of them and their order.
struct Folded(u64);

impl Folded {
    fn word(&mut self, word: u64) {
        self.0 = mixed(self.0 ^ word);
    }

    fn number(&mut self, number: f64) {
        self.word(number.to_bits());
    }

    fn vector(&mut self, vector: DVec3) {
        vector.to_array().into_iter().for_each(|x| self.number(x));
    }
}

/// Takes what is printed, so that a description with columns of any length is folded without being held in memory.
impl Write for Folded {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for part in text.as_bytes().chunks(size_of::<u64>()) {
            let mut bytes = [0; size_of::<u64>()];
            bytes[..part.len()].copy_from_slice(part);
            self.word(u64::from_le_bytes(bytes));
        }
        Ok(())
    }
}

/// A number of every column and parameter of a scene.
fn fingerprint(scene: &Scene) -> u64 {
    let ensemble = scene.ensemble();
    let mut folded = Folded(ensemble.len() as u64);
    for tensor in ensemble.inertia() {
        tensor.to_array().into_iter().for_each(|x| folded.number(x));
    }
    for orientation in ensemble.orientation() {
        orientation.to_array().into_iter().for_each(|x| folded.number(x));
    }
    ensemble.angular_velocity_body().iter().for_each(|&omega| folded.vector(omega));
    if let Some(translation) = ensemble.translation() {
        translation.mass.iter().for_each(|&mass| folded.number(mass));
        translation.position.iter().chain(&translation.velocity).for_each(|&vector| folded.vector(vector));
    }
    // Numbers print with the digits that tell them from every other. Writing to memory does not fail.
    let _ = write!(folded, "{:?} {:?} {:?}", scene.torques(), scene.forces(), scene.output_times());
    folded.0
}
