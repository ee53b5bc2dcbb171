//! Fingerprints of scenes, by which a plan is matched with the scene that it was made for.

use std::fmt::{self, Write};
use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::bodies::Blocks;
use crate::math::Precision;
use crate::math::parallel;
use crate::plan::sampling::mixed;
use crate::scene::Scene;
use crate::torque::force::Force;
use crate::torque::{Parameter, Value};

/// What a plan records of its scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneFingerprint {
    pub bodies: usize,
    pub span: f64,
    outputs: usize,
    accuracy: String,
    precision: String,
    pub torques: Vec<String>,
    forces: Vec<String>,
    /// Whether work may be skipped.
    pub skipping: bool,
    /// The fingerprint of what all bodies share, in hexadecimal digits.
    fingerprint: String,
    /// The fingerprints of the columns and parameters, one for each of [`Blocks`], eight hexadecimal digits a block.
    blocks: String,
}

/// Digits of a block's fingerprint.
const BLOCK_DIGITS: usize = 8;

impl SceneFingerprint {
    /// The fingerprint of a scene; of a part of one, only the blocks that it has in full.
    pub fn of(scene: &Scene, outputs: usize) -> Self {
        Self {
            bodies: scene.part().of,
            span: scene.end(),
            outputs,
            accuracy: scene.stepping().to_string(),
            precision: scene.wanted_precision().map_or("auto", |precision| precision.name()).to_owned(),
            torques: scene.torques().iter().map(|torque| torque.name().to_owned()).collect(),
            forces: scene.forces().iter().map(|force| force.name().to_owned()).collect(),
            skipping: scene.may_skip(),
            fingerprint: format!("{:016x}", of_shared(scene)),
            blocks: of_blocks(scene).into_iter().map(|block| format!("{block:08x}")).collect(),
        }
    }

    /// Restricts the block fingerprints to those that a part of the scene has in full, as far as they are known; the whole scene keeps all.
    pub fn of_part(&self, scene: &Scene) -> Self {
        let part = scene.part();
        let whole = Blocks::of(part.of);
        let size = whole.size();
        let end = part.first_body + scene.ensemble().len();
        let blocks = part.first_body.div_ceil(size)..if end == part.of { whole.count() } else { end / size };
        let known = |block: usize| (block * BLOCK_DIGITS).min(self.blocks.len());
        let digits = known(blocks.start)..known(blocks.end.max(blocks.start));
        Self { blocks: self.blocks.get(digits).unwrap_or_default().to_owned(), ..self.clone() }
    }

    /// Removes the blocks that `planned` does not know, where the plan was made from a scene's first bodies.
    pub fn restricted_to(mut self, planned: &Self, plan: &Self) -> Self {
        if plan.blocks.len() < Blocks::of(plan.bodies).count() * BLOCK_DIGITS {
            self.blocks.truncate(planned.blocks.len());
        }
        self
    }

    /// The arithmetic that was asked for, where one was.
    pub fn wanted_precision(&self) -> Option<Precision> {
        Precision::ALL.into_iter().find(|precision| precision.name() == self.precision)
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
            ("the fingerprint of shared parameters", self.fingerprint.clone(), other.fingerprint.clone()),
            (BODIES, digest(&self.blocks), digest(&other.blocks)),
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

/// The first respect in which a scene differs from the one that a plan was made for.
pub(super) struct Difference {
    pub field: &'static str,
    pub planned: String,
    pub found: String,
    pub remedy: &'static str,
}

const SKIPPING: &str = "skipping";

const BODIES: &str = "the fingerprint of bodies and their parameters";

/// A few digits computed from many.
fn digest(blocks: &str) -> String {
    let mut folded = Folded { state: 0, rows: None };
    let _ = folded.write_str(blocks);
    format!("{:016x}", folded.state)
}

/// Folds words into a number whose bits depend on all of them and their order.
struct Folded {
    state: u64,
    /// The bodies whose rows are folded; `None` for what all bodies share.
    rows: Option<Range<usize>>,
}

impl Folded {
    fn word(&mut self, word: u64) {
        self.state = mixed(self.state ^ word);
    }

    /// Folds a word of what all bodies share.
    fn shared(&mut self, word: u64) {
        if self.rows.is_none() {
            self.word(word);
        }
    }

    /// Folds the rows of a column; `numbers` gives the numbers of a row.
    fn column<V: Copy, const N: usize>(&mut self, rows: &[V], numbers: fn(V) -> [f64; N]) {
        let Some(own) = self.rows.clone() else { return };
        // One chain for each component, so that they do not wait for each other.
        let mut chains = [0; N];
        for &row in &rows[own] {
            for (chain, number) in chains.iter_mut().zip(numbers(row)) {
                *chain = mixed(*chain ^ number.to_bits());
            }
        }
        chains.into_iter().for_each(|chain| self.word(chain));
    }

    fn parameter<V: Copy, const N: usize>(&mut self, parameter: &Parameter<V>, numbers: fn(V) -> [f64; N]) {
        match parameter {
            Parameter::Shared(value) => {
                self.shared(0);
                numbers(*value).into_iter().for_each(|number| self.shared(number.to_bits()));
            }
            Parameter::PerBody(rows) => {
                self.shared(1);
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
                self.shared(2);
                self.shared(*number);
            }
            Value::List(tables) => {
                self.shared(3);
                self.shared(tables.len() as u64);
                for table in tables.iter() {
                    self.shared(table.len() as u64);
                    table.iter().for_each(|value| self.value(value));
                }
            }
            Value::Absent => self.shared(4),
        }
    }
}

/// Folds what is printed.
impl Write for Folded {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for part in text.as_bytes().chunks(size_of::<u64>()) {
            let mut bytes = [0; size_of::<u64>()];
            bytes[..part.len()].copy_from_slice(part);
            self.shared(u64::from_le_bytes(bytes));
        }
        Ok(())
    }
}

/// A number formed from everything that the bodies of a scene share.
fn of_shared(scene: &Scene) -> u64 {
    folded(scene, Folded { state: scene.part().of as u64, rows: None })
}

/// A number for each block of bodies that the scene has in full, formed from every column and parameter.
fn of_blocks(scene: &Scene) -> Vec<u32> {
    let (part, count) = (scene.part(), scene.ensemble().len());
    let (bodies, size) = (part.first_body..part.first_body + count, Blocks::of(part.of).size());
    let blocks: Vec<Range<usize>> = Blocks::of(part.of)
        .within(&bodies)
        .filter(|block| block.start.is_multiple_of(size) && (block.len() == size || block.end == part.of))
        .map(|block| block.start - part.first_body..block.end - part.first_body)
        .collect();
    let of_block = |block: Range<usize>| folded(scene, Folded { state: 0, rows: Some(block) }) as u32;
    parallel::map_tasks(blocks, |_, block| of_block(block))
}

fn folded(scene: &Scene, mut folded: Folded) -> u64 {
    let ensemble = scene.ensemble();
    folded.column(ensemble.inertia(), |tensor| tensor.to_array());
    folded.column(ensemble.orientation(), |orientation| orientation.to_array());
    folded.column(ensemble.angular_velocity_body(), |omega| omega.to_array());
    if let Some(translation) = ensemble.translation() {
        folded.shared(1);
        folded.column(&translation.mass, |mass| [mass]);
        folded.column(&translation.position, |position| position.to_array());
        folded.column(&translation.velocity, |velocity| velocity.to_array());
    }
    // Numbers print with the digits that tell them from every other. Writing to memory does not fail.
    let _ = write!(folded, "{:?}", scene.output_times());
    if scene.records_start() {
        folded.shared(1);
    }
    // Steps end at checks.
    if let Some(every) = scene.event_check_interval().filter(|_| !scene.wanted_events().is_empty()) {
        let _ = write!(folded, "checks {every:?}");
    }
    // An event that only records changes nothing that a plan decides.
    for event in scene.wanted_events().iter().filter(|event| event.stops()) {
        let _ = write!(folded, "{event:?}");
    }
    folded.shared(scene.torques().len() as u64);
    for torque in scene.torques() {
        // Includes the formula of a custom torque.
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
    folded.state
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::bodies::Ensemble;
    use crate::bodies::ensemble::Translation;
    use crate::scene::{Condition, Event, Outputs, Quantity};
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
        let slow = |level| Event::new("slow", Quantity::SpinRate, Condition::Below(level)).expect("a level");
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
            scene().event(slow(0.5).stopping()),
            scene().event(slow(0.25).stopping()),
        ];
        assert_eq!(
            SceneFingerprint::of(&scene().event(slow(0.5)), 1),
            SceneFingerprint::of(&scene(), 1),
            "an event that is recorded changes no motion"
        );
        let fingerprint = |scene: &Scene| SceneFingerprint::of(scene, 1);
        let found: Vec<SceneFingerprint> = scenes.iter().map(fingerprint).collect();
        assert_eq!(fingerprint(&scene()), found[0], "the same scene again");
        for (index, fingerprint) in found.iter().enumerate() {
            assert_eq!(found.iter().position(|other| other == fingerprint), Some(index), "scenes that differ");
        }
    }
}
