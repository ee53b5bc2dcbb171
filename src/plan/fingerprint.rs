//! Fingerprints of scenes, by which a plan is matched with the scene that it was made for.

use std::fmt::{self, Write};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::plan::sampling::mixed;
use crate::scene::Scene;
use crate::torque::force::Force;
use crate::torque::{Parameter, Value};

/// What a plan records of its scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneFingerprint {
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

impl SceneFingerprint {
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

/// Rows of a column that one task folds.
const ROWS: usize = 1 << 12;

impl Folded {
    fn word(&mut self, word: u64) {
        self.0 = mixed(self.0 ^ word);
    }

    /// The rows of a column, whose numbers `numbers` gives.
    fn column<V: Copy + Sync, const N: usize>(&mut self, rows: &[V], numbers: fn(V) -> [f64; N]) {
        self.word(rows.len() as u64);
        let of_part = |rows: &[V]| {
            // A chain for each component: they do not wait for each other.
            let mut chains = [0; N];
            for &row in rows {
                for (chain, number) in chains.iter_mut().zip(numbers(row)) {
                    *chain = mixed(*chain ^ number.to_bits());
                }
            }
            chains
        };
        let parts: Vec<[u64; N]> = rows.par_chunks(ROWS).map(of_part).collect();
        parts.into_iter().flatten().for_each(|chain| self.word(chain));
    }

    fn parameter<V: Copy + Sync, const N: usize>(&mut self, parameter: &Parameter<V>, numbers: fn(V) -> [f64; N]) {
        match parameter {
            Parameter::Shared(value) => {
                self.word(0);
                self.column(&[*value], numbers);
            }
            Parameter::PerBody(rows) => {
                self.word(1);
                self.column(rows, numbers);
            }
        }
    }

    fn value(&mut self, value: &Value) {
        match value {
            Value::Number(number) => self.parameter(number, |x| [x]),
            Value::Vector(vector) => self.parameter(vector, |v| v.to_array()),
            Value::Rotation(rotation) => self.parameter(rotation, |q| q.to_array()),
            Value::Matrix(matrix) => self.parameter(matrix, |m| m.to_cols_array()),
            Value::Tensor(tensor) => self.parameter(tensor, |t| t.to_array()),
            Value::Whole(number) => {
                self.word(2);
                self.word(*number);
            }
            Value::List(tables) => {
                self.word(3);
                self.word(tables.len() as u64);
                for table in tables.iter() {
                    self.word(table.len() as u64);
                    table.iter().for_each(|value| self.value(value));
                }
            }
            Value::Absent => self.word(4),
        }
    }
}

/// Takes what is printed.
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
    folded.column(ensemble.inertia(), |tensor| tensor.to_array());
    folded.column(ensemble.orientation(), |orientation| orientation.to_array());
    folded.column(ensemble.angular_velocity_body(), |omega| omega.to_array());
    if let Some(translation) = ensemble.translation() {
        folded.column(&translation.mass, |mass| [mass]);
        folded.column(&translation.position, |position| position.to_array());
        folded.column(&translation.velocity, |velocity| velocity.to_array());
    }
    // Numbers print with the digits that tell them from every other. Writing to memory does not fail.
    let _ = write!(folded, "{:?}", scene.output_times());
    if scene.records_start() {
        folded.word(1);
    }
    folded.word(scene.torques().len() as u64);
    for torque in scene.torques() {
        // With its formula, where it has one of its own.
        let _ = write!(folded, "{:?}", torque.model_ref());
        torque.values().iter().for_each(|value| folded.value(value));
    }
    for force in scene.forces() {
        let _ = write!(folded, "{}", force.name());
        match force {
            Force::Constant(vector) | Force::Gravity(vector) | Force::Thrust(vector) => {
                folded.parameter(vector, |v| v.to_array());
            }
            Force::LinearDrag(number) | Force::QuadraticDrag(number) => folded.parameter(number, |x| [x]),
            Force::Custom(custom) => {
                let _ = write!(folded, "{:?}", custom.formula());
                custom.values().iter().for_each(|value| folded.value(value));
            }
        }
    }
    folded.0
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::bodies::Ensemble;
    use crate::bodies::ensemble::Translation;
    use crate::scene::Outputs;
    use crate::torque::Torque;

    const BODIES: usize = 9000;

    fn ensemble(spin: fn(usize) -> f64) -> Ensemble {
        let row = |body| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::X * spin(body));
        let (mass, position) = (vec![1.0; BODIES], vec![DVec3::ZERO; BODIES]);
        let translation = Translation { mass, velocity: position.clone(), position };
        let ensemble = Ensemble::from_fn(BODIES, row).expect("valid");
        ensemble.with_translation(translation).expect("valid")
    }

    #[test]
    fn every_number_of_a_scene_and_its_place_are_in_the_fingerprint() {
        let drag = |body: usize, number: f64| {
            let mut column = vec![0.1; BODIES];
            column[body] = number;
            Torque::linear_drag(column)
        };
        let custom = |text: &str| Torque::custom(text, Default::default()).expect("a formula");
        let scene = || Scene::new(ensemble(|_| 1.0)).until(1.0);
        let scenes = [
            scene(),
            Scene::new(ensemble(|body| if body == BODIES - 1 { 1.0_f64.next_up() } else { 1.0 })).until(1.0),
            Scene::new(ensemble(|body| if body == 4096 { 1.0_f64.next_up() } else { 1.0 })).until(1.0),
            scene().outputs(Outputs::Times(vec![0.25, 1.0])),
            scene().outputs(Outputs::Times(vec![0.5, 1.0])),
            scene().torque(Torque::linear_drag(0.1)),
            scene().torque(drag(0, 0.1)),
            scene().torque(drag(3, 0.2)),
            scene().torque(drag(4, 0.2)),
            scene().torque(drag(BODIES - 1, 0.2)),
            scene().torque(Torque::constant_body(DVec3::X)),
            scene().torque(Torque::constant_body(DVec3::Y)),
            scene().torque(Torque::constant_world(DVec3::X)),
            scene().torque(custom("-0.1 * angular_velocity")),
            scene().torque(custom("-0.2 * angular_velocity")),
            scene().force(Force::gravity(DVec3::X)),
            scene().force(Force::constant(DVec3::X)),
            scene().force(Force::linear_drag(0.1)),
            scene().force(Force::linear_drag(vec![0.1; BODIES])),
        ];
        let found: Vec<u64> = scenes.iter().map(fingerprint).collect();
        assert_eq!(fingerprint(&scene()), found[0], "the same scene again");
        for (index, fingerprint) in found.iter().enumerate() {
            assert_eq!(found.iter().position(|other| other == fingerprint), Some(index), "scenes that differ");
        }
    }
}
