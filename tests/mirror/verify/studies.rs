//! The example studies.

use std::path::Path;

use polhode::Scene;
use polhode::engine::Engine;
use polhode::study::Study;
use polhode::verify::{Verdict, verify};

use super::{agreed, common, steps, workspace};

const EXAMPLES: [&str; 21] = [
    "aero_table",
    "asteroids",
    "bdot",
    "booms",
    "captures",
    "cubesats",
    "curveball",
    "debris",
    "despin",
    "detumble_and_point",
    "flip_times",
    "hyperion",
    "intermediate_axis",
    "pointing",
    "relaxing",
    "rotors",
    "spacecraft",
    "thruster",
    "tumbling",
    "wire_booms",
    "wobbling_disc",
];

/// What has no second kernel to be compared with.
const NOT_COMPARED: [&str; 1] = ["burn"];

fn example(name: &str, bodies: usize) -> Scene {
    let file = workspace::example(name);
    Study::read(Path::new(&file)).expect("a study").truncated(bodies).scene().expect("a scene")
}

#[test]
fn every_example_study_agrees_on_the_cpu() {
    for name in EXAMPLES {
        agreed(&Engine::cpu(), &example(name, 8), &steps(6), name);
    }
}

#[test]
fn every_example_study_agrees_on_a_gpu() {
    let gpu = common::gpu();
    for name in EXAMPLES {
        agreed(&gpu, &example(name, 4), &steps(4), name);
    }
}

#[test]
fn what_is_not_compared_is_listed() {
    let text = agreed(&Engine::cpu(), &example("thruster", 3), &steps(2), "thruster").to_string();
    assert!(text.contains("centres of mass: not compared"), "{text}");
    let text = agreed(&Engine::cpu(), &example("relaxing", 3), &steps(2), "relaxing").to_string();
    assert!(text.contains("not compared: statistics"), "{text}");
    let text = agreed(&Engine::cpu(), &example("detumble_and_point", 3), &steps(2), "sampled").to_string();
    assert!(text.contains("not compared: samples of torques"), "{text}");
}

/// A study of which nothing is compared is not said to agree.
#[test]
fn studies_without_a_second_kernel_are_not_said_to_agree() {
    for name in NOT_COMPARED {
        let report = verify(&Engine::cpu(), &example(name, 3), &steps(2)).expect("a report");
        assert_eq!(report.verdict(), Verdict::NothingCompared, "{name}: {report}");
        assert!(report.to_string().contains("which series on the CPU alone integrate"), "{name}: {report}");
    }
}

#[test]
fn the_examples_are_all_there() {
    let folder = format!("{}/examples/studies", env!("CARGO_MANIFEST_DIR"));
    let names = std::fs::read_dir(folder).expect("the examples").map(|entry| entry.expect("an entry").file_name());
    let studies = names.filter(|name| name.to_string_lossy().ends_with(".toml")).count();
    assert_eq!(studies, EXAMPLES.len() + NOT_COMPARED.len());
}
