//! The recorded WGSL text of every kind of torque against its formula on scalars, and against faults planted in it.
//!
//! Nothing here knows a model: kinds, columns and phases are those that are registered. Bounds are counted operation by
//! operation and row by row. Equality to the bit is more than a driver promises: lavapipe, which fuses nothing, draws factors
//! out of sums, so that a third of the components that are turned into body axes differ in their last bits.

use crate::common;

use std::collections::HashMap;

use common::kernel::{Harness, chunks};
use common::measured::stays_within_measured;
use common::random::Random;
use glam::DQuat;
use polhode::engine::gpu::shader::{Chunk, Source};
use polhode::expression::{Input, InputKind};
use polhode::kernel::method::Method;
use polhode::math::Precision;
use polhode::math::quaternion::Quaternion;
use polhode::math::real::Scalar;
use polhode::math::vector::Vector;
use polhode::torque::twin::{Twin, twins};
use polhode::verify::running::{Running, bounds};

/// Rows of a table: not a multiple of the workgroup size, and so many that some of them have a bound below a thousandth of the torque in `f32`,
/// where a formula is of the field's square.
const ROWS: usize = 8009;
/// Each side of a comparison is within the bound.
const SIDES: f64 = 2.0;
/// The least share of components that must be compared: no bound is known where a decision hangs on rounding.
const LEAST_SHARE: f64 = 0.95;
/// The largest parts of the bounds over the rows of every kind, each of which is a draw, on lavapipe, in `f32` and in `f64`; the tests print them.
const MEASURED: [f64; 2] = [0.453, 0.413];

/// Where columns take their numbers from; others are uniform in [−1, 1], which directions are as well: no formula assumes
/// that they are of unit length.
const ECCENTRICITY: (&str, f64, f64) = ("eccentricity", 0.0, 0.9);

fn precision_of<T: Scalar>() -> Precision {
    if T::WORDS == 2 { Precision::F32 } else { Precision::F64 }
}

/// The numbers of one evaluation: columns, phases, orientation, angular velocity.
struct Row<T> {
    columns: Vec<T>,
    phases: Vec<T>,
    orientation: [T; 4],
    angular_velocity: [T; 3],
}

impl<T: Scalar> Row<T> {
    fn of(&self, input: Input) -> T {
        let index = usize::from(input.index);
        match input.kind {
            InputKind::Parameter => self.columns[index],
            InputKind::Phase => self.phases[index],
            InputKind::Orientation => self.orientation[index],
            InputKind::AngularVelocity => self.angular_velocity[index],
            other => panic!("{other:?} is no input of a torque"),
        }
    }

    fn torque(&self, twin: &Twin) -> [f64; 3] {
        let [x, y, z, w] = self.orientation;
        let [p, q, r] = self.angular_velocity;
        let torque = twin.torque(&self.columns, &self.phases, Quaternion::new(x, y, z, w), Vector::new(p, q, r));
        [torque.x, torque.y, torque.z].map(Scalar::to_f64)
    }
}

/// The identity, half turns and their neighbours, where springs have their limits, then any.
fn orientation(row: usize, random: &mut Random) -> [f64; 4] {
    let any = DQuat::from_array([(); 4].map(|()| random.normal())).normalize();
    let q = match row {
        0 | 4 => DQuat::IDENTITY,
        1 => DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0),
        2 => DQuat::from_xyzw(1e-12, 0.0, 0.0, 1.0),
        3 => DQuat::from_xyzw(0.0, 1.0, 0.0, -1e-9).normalize(),
        5 => -DQuat::IDENTITY,
        6 => DQuat::from_xyzw(0.0, 0.0, -1.0, 0.0),
        7 => DQuat::from_xyzw(0.5, -0.5, 0.5, -0.5),
        _ => any,
    };
    q.to_array()
}

fn rows<T: Scalar>(twin: &Twin) -> Vec<Row<T>> {
    /// Rows with numbers at the edges.
    const EDGE_ROWS: usize = 24;
    const EDGES: [f64; 5] = [0.0, 1.0, -1.0, 0.5, -0.0];
    let mut random = Random::new(5 + twin.kind as u64);
    (0..ROWS)
        .map(|row| {
            let mut columns = Vec::new();
            for (place, &(name, numbers)) in twin.columns.iter().enumerate() {
                match numbers {
                    // A target; the identity first, so that the edges of the orientation are edges of what is turned.
                    4 if row < 8 => columns.extend([0.0, 0.0, 0.0, 1.0]),
                    4 => columns.extend(orientation(row, &mut random)),
                    1 if name == ECCENTRICITY.0 => columns.push(match row % 5 {
                        0 => 0.0,
                        _ => random.between(ECCENTRICITY.1, ECCENTRICITY.2),
                    }),
                    // Each column runs through the edges at a pace of its own.
                    _ => columns.extend((0..numbers).map(|component| {
                        let random = random.between(-1.0, 1.0);
                        let is_edge = (8..EDGE_ROWS).contains(&row);
                        let edge = EDGES[(row / (component + 1) + 3 * place + 2 * component) % EDGES.len()];
                        if is_edge { edge } else { random }
                    })),
                }
            }
            // Borders of quarter turns among them.
            let mut phase = || if row < 17 { row as f64 / 16.0 - 0.5 } else { random.between(-0.5, 0.5) };
            let phases = twin.phases.iter().map(|_| T::from_f64(phase())).collect();
            let angular_velocity = match row {
                0 => [0.0; 3],
                9 => [0.0, 0.0, -2.0],
                _ => [(); 3].map(|()| random.between(-2.0, 2.0)),
            };
            Row {
                columns: columns.into_iter().map(T::from_f64).collect(),
                phases,
                orientation: orientation(row, &mut random).map(T::from_f64),
                angular_velocity: angular_velocity.map(T::from_f64),
            }
        })
        .collect()
}

/// What recorded texts stand on.
fn shared(precision: Precision, twins: &[Twin]) -> Vec<Chunk> {
    let mut all = chunks(precision, Method::Rk4);
    all.retain(|chunk| !["torque/", "method/"].iter().any(|folder| chunk.file.starts_with(folder)));
    // As in a stepping kernel, without the texts themselves.
    let recorded = |file: &str| twins.iter().any(|twin| twin.file == file);
    all.extend(Source::torques(precision).into_iter().filter(|chunk| !recorded(chunk.file)));
    all.push(Chunk {
        file: "columns",
        text: "fn parameter_at(column: u32, i: u32) -> real { return inputs[column * settings.count + i]; }\n".into(),
    });
    all
}

/// A table of one kind: rows of inputs as a kernel reads them, and the call of the kind's function.
struct Table<T> {
    rows: Vec<Row<T>>,
    inputs: Vec<Vec<T>>,
    arguments: String,
}

impl<T: Scalar> Table<T> {
    fn new(twin: &Twin) -> Self {
        let rows = rows::<T>(twin);
        let inputs = twin.arguments.iter().flat_map(|argument| argument.inputs.iter().copied());
        let inputs: Vec<Input> = inputs.collect();
        let (mut arguments, mut first) = (Vec::new(), 0);
        for argument in &twin.arguments {
            let read = ["r", "?", "v", "q"][argument.inputs.len() - 1];
            arguments.push(format!("{read}({first}u)"));
            first += argument.inputs.len();
        }
        let table = rows.iter().map(|row| inputs.iter().map(|&input| row.of(input)).collect()).collect();
        Self { rows, inputs: table, arguments: arguments.join(", ") }
    }

    /// The bounds of the components of every row.
    fn bounds(&self, twin: &Twin) -> Vec<Vec<Option<Running>>> {
        let of = |row: &Row<T>| bounds(&twin.graph, &twin.outputs, |input| row.of(input).to_f64(), T::UNIT_ROUNDOFF);
        self.rows.iter().map(of).collect()
    }
}

/// What a kind's table showed.
struct Seen {
    /// The largest difference over its bound.
    largest: f64,
    /// Components that were compared, of all.
    share: f64,
    /// Components that differ in a bit.
    unequal: usize,
}

/// Compares found components with the twin's; the error names the first that is beyond its bound.
fn compared<T: Scalar>(
    twin: &Twin,
    table: &Table<T>,
    bounds: &[Vec<Option<Running>>],
    found: &[Vec<f64>],
) -> Result<Seen, String> {
    let least = if T::WORDS == 2 { f64::from(f32::MIN_POSITIVE) } else { f64::MIN_POSITIVE };
    let (mut largest, mut compared, mut unequal) = (0.0_f64, 0, 0);
    for (index, row) in table.rows.iter().enumerate() {
        let expected = row.torque(twin);
        for component in 0..3 {
            let (expected, found) = (expected[component], found[index][component]);
            unequal += usize::from(expected.to_bits() != found.to_bits());
            let Some(running) = bounds[index][component] else {
                if !found.is_finite() {
                    return Err(format!("row {index}, component {component}: {found}"));
                }
                continue;
            };
            compared += 1;
            // What is below the least normal number may be taken for zero.
            let bound = SIDES * (running.error + least);
            let difference = (found - expected).abs().max((expected - running.value).abs());
            if difference.is_nan() || difference > bound || !found.is_finite() {
                return Err(format!(
                    "row {index}, component {component}: {found:e}, {expected:e} of the twin, {:e} expected: more than {bound:e}",
                    running.value
                ));
            }
            largest = largest.max(difference / bound);
        }
    }
    Ok(Seen { largest, share: compared as f64 / (3 * table.rows.len()) as f64, unequal })
}

fn check<T: Scalar>() {
    let (harness, twins) = (Harness::new(), twins());
    assert!(!twins.is_empty());
    let precision = precision_of::<T>();
    let chunks = shared(precision, &twins);
    let mut worst = 0.0_f64;
    for twin in &twins {
        let table = Table::<T>::new(twin);
        let text = Chunk { file: twin.file, text: twin.text.clone().into() };
        let line = format!("put_v(0u, {}({}));", twin.kind.stem(), table.arguments);
        let found = harness.run(&[chunks.clone(), vec![text]].concat(), &line, &table.inputs, 3);
        match compared(twin, &table, &table.bounds(twin), &found) {
            Ok(seen) => {
                let Seen { largest, share, unequal } = seen;
                println!("{precision} {:?}: at most {largest:.3} of the bound, {unequal} components differ", twin.kind);
                assert!(share >= LEAST_SHARE, "{:?}: {share} of the components compared", twin.kind);
                worst = worst.max(largest);
            }
            Err(mismatch) => panic!("{precision} {:?}: {mismatch}\n{}", twin.kind, twin.text),
        }
    }
    stays_within_measured(&common::gpu(), precision, "recorded texts", worst, MEASURED[2 - T::WORDS]);
}

#[test]
fn every_recorded_text_agrees_with_its_formula_in_f32() {
    check::<f32>();
}

#[test]
fn every_recorded_text_agrees_with_its_formula_in_f64() {
    check::<f64>();
}

/// Copies of a text with one fault each: a sign, a factor, a component or a function changed, wherever there is one.
fn faults(text: &str) -> Vec<String> {
    const CHANGES: [(&str, &str); 14] = [
        (" + ", " - "),
        (" - ", " + "),
        (" * ", " + "),
        (" / ", " * "),
        ("(-", "("),
        (", -", ", "),
        ("mul_add(", "-mul_add("),
        (".x", ".y"),
        (".y", ".z"),
        (".z", ".x"),
        (".w", ".x"),
        (".sin", ".cos"),
        (".cos", ".sin"),
        ("return ", "return 1.001 * "),
    ];
    let body = text.find("{\n").expect("a body");
    // Whole turns more are no fault.
    let is_fault = |place: usize| place > body && !text[place..].starts_with(" - round(");
    let mut faults = Vec::new();
    for (from, to) in CHANGES {
        for (place, _) in text.match_indices(from).filter(|(place, _)| is_fault(*place)) {
            faults.push(format!("{}{to}{}", &text[..place], &text[place + from.len()..]));
        }
    }
    faults
}

#[test]
fn every_fault_in_a_recorded_text_is_found() {
    /// Faults in one shader.
    const TOGETHER: usize = 40;
    let (harness, twins) = (Harness::new(), twins());
    let chunks = shared(Precision::F32, &twins);
    let mut passed = Vec::new();
    for twin in &twins {
        let table = Table::<f32>::new(twin);
        let bounds = table.bounds(twin);
        let stem = twin.kind.stem();
        let faults = faults(&twin.text);
        assert!(!faults.is_empty(), "{:?}: nothing to change in\n{}", twin.kind, twin.text);
        for some in faults.chunks(TOGETHER) {
            let (mut texts, mut line) = (String::new(), String::new());
            for (index, fault) in some.iter().enumerate() {
                let heading = format!("fn {stem}(");
                assert!(fault.contains(&heading), "{fault}");
                texts += &fault.replacen(&heading, &format!("fn fault{index}("), 1);
                line += &format!("put_v({}u, fault{index}({}));\n", 3 * index, table.arguments);
            }
            let text = Chunk { file: twin.file, text: texts.into() };
            let found = harness.run(&[chunks.clone(), vec![text]].concat(), &line, &table.inputs, 3 * some.len());
            for (index, fault) in some.iter().enumerate() {
                let found: Vec<_> = found.iter().map(|row| row[3 * index..][..3].to_vec()).collect();
                if compared(twin, &table, &bounds, &found).is_ok() {
                    passed.push(fault.clone());
                }
            }
        }
        println!("{:?}: {} faults", twin.kind, faults.len());
    }
    assert!(passed.is_empty(), "{} faults pass:\n{}", passed.len(), passed.join("\n"));
}

#[test]
fn every_kind_has_a_text_of_its_own() {
    let mut files = HashMap::new();
    for twin in twins() {
        assert!(twin.text.contains(&format!("\nfn {}(", twin.kind.stem())), "{:?}: {}", twin.kind, twin.text);
        println!("{}", twin.text);
        if let Some(other) = files.insert(twin.file, twin.kind) {
            panic!("{other:?} and {:?} are both {}", twin.kind, twin.file);
        }
    }
}
