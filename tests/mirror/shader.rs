//! Every assembled shader is valid, and an error in a chunk is reported at its place in the chunk's own file.

use crate::common;

use glam::{DQuat, DVec3};
use polhode::engine::batch::{AnyBatch, prepare_with};
use polhode::engine::gpu::Patch;
use polhode::engine::gpu::shader::{Chunk, Source};
use polhode::expression::{Fault, Graph, Input, InputKind};
use polhode::kernel::method::Method;
use polhode::math::Precision;
use polhode::torque::twin::twins;
use polhode::torque::variable_inertia::{InertiaChange, Law};
use polhode::torque::{Torque, TorqueTable};
use polhode::{Ensemble, Error};

/// A body under every kind of torque.
fn under_every_torque(precision: Precision) -> AnyBatch {
    common::torques::batch_under(1, 1, &common::torques::every_torque(&[1.0]), precision)
}

/// The table of a scene with every kind of torque.
fn every_torque(precision: Precision) -> TorqueTable {
    under_every_torque(precision).torques().clone()
}

/// Tables of each torque alone, and of all on bodies whose moments change, which are linear rotors, or both.
fn other_tables(precision: Precision) -> Vec<TorqueTable> {
    let all = common::torques::every_torque(&[1.0]);
    let change = |law| Torque::variable_inertia(InertiaChange::factor(0.6), law);
    let changes = [change(Law::ramp(0.1, 0.5)), change(Law::oscillation(2.0))];
    let mut scenes: Vec<Vec<Torque>> = all.iter().chain(&changes).map(|torque| vec![torque.clone()]).collect();
    scenes.extend(changes.iter().map(|change| [all.clone(), vec![change.clone()]].concat()));
    scenes.push([all.clone(), all.clone()].concat());
    let rigid = common::asymmetric_ensemble(1, 1);
    let rotor = Ensemble::from_columns(&[DVec3::new(0.0, 1.0, 1.0)], &[DQuat::IDENTITY], &[DVec3::Y]).expect("a rotor");
    let scenes = scenes.iter().flat_map(|torques| [(&rigid, torques), (&rotor, torques)]);
    scenes
        .map(|(ensemble, torques)| {
            prepare_with(ensemble, torques, 100.0, precision).expect("enough memory").1.torques().clone()
        })
        .collect()
}

/// The kernels of some quantities: of one, and of as many as are returned as an array.
fn gathering(precision: Precision) -> Vec<Source> {
    let of = |count: usize| {
        let (graph, outputs) = Graph::record(|recorder| {
            let omega = |index| recorder.input(Input::new(InputKind::AngularVelocity, index));
            let time = recorder.input(Input::new(InputKind::Time, 0));
            let energy = recorder.input(Input::new(InputKind::Parameter, 3));
            let all = [energy * time, omega(0) + omega(1), omega(1), omega(2) * time, energy - time];
            Ok::<_, Fault>(all[..count].to_vec())
        })
        .expect("a formula");
        let source = Source::gather(precision, (&graph, &outputs), &[]).expect("a text");
        ["evaluate", "reduce", "count"].map(|entry_point| source.clone().entered_at(entry_point))
    };
    [1, 3, 4, 5].into_iter().flat_map(of).collect()
}

fn variants() -> Vec<Source> {
    let mut variants = Vec::new();
    for precision in Precision::ALL {
        variants.extend(Method::ALL.map(|method| Source::advance(precision, method)));
        variants.push(Source::free_motion(precision));
        variants.push(Source::advance_projected(precision, Method::Rk8));
        variants.push(Source::observe(precision));
        variants.extend(gathering(precision));
        variants.extend(Method::ALL.map(|method| Source::advance_under(precision, method, &every_torque(precision))));
        variants.extend(
            [TorqueTable::none(1.0), every_torque(precision)].map(|torques| Source::adaptive(precision, &torques)),
        );
        for torques in [TorqueTable::none(1.0), every_torque(precision)] {
            let flying = |method| Source::advance_with_forces(precision, method, &torques, Some(7));
            variants.extend(Method::ALL.map(flying));
        }
        let torques = every_torque(precision);
        variants.extend(Method::ALL.map(|method| Source::advance_under(precision, method, &torques).tapped()));
        variants.push(Source::adaptive(precision, &torques).tapped());
        variants.push(Source::probe(precision));
        variants.extend([Source::probe(precision), Source::adaptive(precision, &torques)].map(Source::without_int64));
    }
    variants
}

/// Those under [`other_tables`].
fn other_variants() -> Vec<Source> {
    let tables = Precision::ALL
        .into_iter()
        .flat_map(|precision| other_tables(precision).into_iter().map(move |table| (precision, table)));
    tables
        .flat_map(|(precision, torques)| {
            let advance = |method| Source::advance_under(precision, method, &torques);
            [advance(Method::Rk4), advance(Method::Splitting4), Source::adaptive(precision, &torques)]
        })
        .collect()
}

#[test]
fn every_variant_validates() {
    for source in variants().into_iter().chain(other_variants()) {
        let files: Vec<_> = source.chunks().iter().map(|chunk| chunk.file).collect();
        source.validate().unwrap_or_else(|error| panic!("{files:?}: {error}"));
    }
}

/// Whether every kind's text is among those that are validated, and what bodies that are not rigid or have no extent across
/// their axis add to the sum.
#[test]
fn every_recorded_text_is_in_a_variant() {
    let variants = other_variants();
    let terms = |line: &str| {
        let is_there = |chunk: &Chunk| chunk.file == "torque/terms.wgsl" && chunk.text.contains(line);
        variants.iter().any(|source| source.chunks().iter().any(is_there))
    };
    for twin in twins() {
        let has =
            |source: &Source| source.chunks().iter().any(|chunk| chunk.file == twin.file && chunk.text == twin.text);
        assert!(variants.iter().any(has), "{:?}", twin.kind);
        assert!(terms(&format!("sum = sum + {}(", twin.kind.stem())), "{:?}", twin.kind);
    }
    assert!(terms("gradient_coefficients(") && terms("sum.x = torque_column("));
}

/// Puts `broken` in a line of its own after line `line` of a chunk; the error must name that line.
fn planted(file: &'static str, line: usize, broken: &str) -> (Patch, usize) {
    let source = Source::advance(Precision::F32, Method::Rk4);
    let chunk = source.chunks().iter().find(|chunk| chunk.file == file).expect("the chunk is there");
    let lines: Vec<&str> = chunk.text.lines().collect();
    let text = [&lines[..line], &[broken], &lines[line..]].concat().join("\n");
    (Patch { file: file.to_owned(), from: chunk.text.clone().into_owned(), to: text }, line + 1)
}

/// Lines, after which a declaration can stand, in chunks at the start, in the middle and at the end of the text.
const PLACES: [(&str, usize); 5] =
    [("real_f32.wgsl", 5), ("real_f32.wgsl", 86), ("rigid_body.wgsl", 2), ("method/rk4.wgsl", 0), ("advance.wgsl", 4)];

/// What the parser, name resolution, type checking and validation each find.
const FAULTS: [&str; 4] = [
    "fn broken( -> f32 { return 1.0; }",
    "fn broken() -> real { return no_such_name; }",
    "fn broken() -> u32 { return 1.5; }",
    "fn broken(x: real) -> u32 { return x; }",
];

#[test]
fn an_error_names_the_original_file_and_line() {
    for (file, line) in PLACES {
        for fault in FAULTS {
            let (patch, expected) = planted(file, line, fault);
            let source = Source::advance(Precision::F32, Method::Rk4).patched(&[patch]).expect("the text is there");
            match source.validate() {
                Err(Error::Shader { file: found_file, line: found_line, message }) => {
                    assert_eq!((found_file, found_line), (file, expected), "{fault}: {message}");
                    assert!(!message.is_empty());
                }
                other => panic!("{file}:{expected}: {fault}: {other:?}"),
            }
        }
    }
}

#[test]
fn an_error_reaches_the_caller_of_the_engine_with_its_place() {
    let (patch, line) = planted("rigid_body.wgsl", 2, FAULTS[3]);
    let mut options = common::any_adapter();
    options.patches = vec![patch];
    let engine = common::gpu_with(options);
    let error = engine.start(common::asymmetric_batch(5, 1, Precision::F32), Method::Rk4).err();
    match error {
        Some(Error::Shader { file: "rigid_body.wgsl", line: found, .. }) => assert_eq!(found, line),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_patch_that_finds_nothing_to_replace_is_refused() {
    let patch = Patch { file: "rigid_body.wgsl".into(), from: "no such text".into(), to: String::new() };
    let error = Source::advance(Precision::F64, Method::Dlm).patched(&[patch]).expect_err("refused");
    assert_eq!(error, Error::Patch { file: "rigid_body.wgsl", text: "no such text".into() });
}

#[test]
fn every_line_of_the_text_is_found_in_its_chunk() {
    for source in variants() {
        let text = source.text();
        let mut lines = (1..).zip(text.lines());
        for chunk in source.chunks() {
            let last = chunk.text.lines().count() - 1;
            for (index, content) in chunk.text.lines().enumerate() {
                let (number, line) = lines.next().expect("a line");
                assert_eq!(line, content);
                // Each search goes through the text.
                if index % 10 == 0 || index == last {
                    assert_eq!(source.locate(number), (chunk.file, index + 1));
                }
            }
        }
        assert_eq!(lines.next(), None);
    }
}
