//! `plan.json` and `explain`: a plan in full, repeated to the bit, refused where it does not fit.

#![cfg(feature = "cli")]

use std::fs;
use std::path::Path;

use glam::{DQuat, DVec3};
use polhode::plan::PlanDocument;
use polhode::scene::StatisticalAccuracy;
use polhode::study::{Study, problem};
use polhode::torque::Torque;
use polhode::{Accuracy, Engine, Error, Method, Plan, Precision, Record, Scene};

use crate::workspace;

use workspace::{Workspace, report};

const BODIES: usize = 300;

/// Free and driven bodies.
fn scene(seed: u64) -> Scene {
    let drag: Vec<f64> = (0..BODIES).map(|body| if body % 3 == 0 { 0.05 } else { 0.0 }).collect();
    Scene::new(problem::free(BODIES, seed).expect("valid"))
        .until(2.0)
        .accuracy(Accuracy::attitude(1e-6))
        .torque(Torque::linear_drag(drag))
        .torque(Torque::constant_world(DVec3::new(0.0, 0.0, 0.01)))
}

/// Of which errors of statistics are asked for alone.
fn statistical() -> Scene {
    let drag: Vec<f64> = (0..BODIES).map(|body| if body % 3 == 0 { 0.05 } else { 0.0 }).collect();
    let wanted = StatisticalAccuracy { mean: Some(1e-3), ..StatisticalAccuracy::default() };
    Scene::new(problem::free(BODIES, 1).expect("valid"))
        .until(2.0)
        .torque(Torque::linear_drag(drag))
        .statistics([polhode::Quantity::SpinRate])
        .statistical_accuracy(wanted)
}

#[test]
fn what_a_plan_found_of_statistics_is_read_back() {
    let (engine, scene) = (Engine::cpu(), statistical());
    let plan = Plan::new(&scene, &engine).expect("a plan");
    let found = plan.explain().statistics;
    assert!(!found.is_empty() && found.iter().all(polhode::plan::StatisticError::is_shown), "{found:?}");
    assert_eq!(Plan::repeated(&scene, &engine, &document(&plan)).expect("fits").explain().statistics, found);
    let other = statistical().statistical_accuracy(StatisticalAccuracy { mean: Some(1e-4), ..Default::default() });
    let error = Plan::repeated(&other, &engine, &document(&plan)).expect_err("another target").to_string();
    assert!(
        error.contains("the accuracy is mean 0.001 of the spread in the plan, mean 1e-4 of the spread in"),
        "{error}"
    );
}

fn bits(record: &Record) -> Vec<u64> {
    let state = record.final_state();
    let orientation = state.orientations().iter().flat_map(|q: &DQuat| q.to_array());
    let rate = state.angular_velocities_body().iter().flat_map(|omega| omega.to_array());
    orientation.chain(rate).map(f64::to_bits).collect()
}

fn document(plan: &Plan<'_>) -> PlanDocument {
    PlanDocument::parse(Path::new("plan.json"), &plan.to_json()).expect("reads back")
}

#[test]
fn a_plan_that_is_read_back_is_the_same_and_gives_the_same_bits() {
    let engine = Engine::cpu();
    let scenes = [
        scene(1),
        scene(1).skipping(false),
        scene(1).accuracy(Accuracy { energy: Some(1e-7), percentile: 95.0, ..Accuracy::attitude(1e-4) }),
        scene(1).pinned(Method::Cf4, 0.013, Some(Precision::F32)),
        statistical(),
    ];
    for scene in scenes {
        let plan = Plan::new(&scene, &engine).expect("a plan");
        let again = Plan::repeated(&scene, &engine, &document(&plan)).expect("fits");
        assert_eq!(plan.resolution(), again.resolution());
        assert_eq!(plan.to_json(), again.to_json());
        assert_eq!(bits(&engine.run(&plan).expect("runs")), bits(&engine.run(&again).expect("runs")));
    }
}

#[test]
fn the_times_at_which_steps_end_are_those_of_the_plan() {
    let engine = Engine::cpu();
    let text = "vec(exp(-((time - 1.3) / 0.02)^2), 0, 0)";
    let pulse = || Torque::custom(text, polhode::torque::Parameters::new()).expect("a formula");
    let scene = scene(1).torque(pulse());
    let plan = Plan::new(&scene, &engine).expect("a plan");
    assert!((6..12).contains(&plan.advance_times().len()) && plan.times().len() == 1, "{:?}", plan.advance_times());
    let repeated = Plan::repeated(&scene, &engine, &document(&plan)).expect("fits");
    assert_eq!(plan.advance_times(), repeated.advance_times());
    let text = plan.to_json();
    for wrong in ["-1.0,", "3.0,", "1.9,"] {
        let edited = text.replacen("\"breaks\": [", &format!("\"breaks\": [{wrong}"), 1);
        let error = PlanDocument::parse(Path::new("p.json"), &edited).expect_err(wrong).to_string();
        assert!(error.contains("breaks: expected times before the end in ascending order"), "{error}");
    }
}

#[test]
fn a_plan_for_another_scene_is_refused_and_says_what_differs() {
    let engine = Engine::cpu();
    let scene_of_plan = scene(1);
    let document = document(&Plan::new(&scene_of_plan, &engine).expect("a plan"));
    let fewer = Scene::new(problem::free(7, 1).expect("valid")).until(2.0);
    let others = [
        (fewer, "the number of bodies is 300 in the plan, 7 in the study"),
        (scene(1).until(2.5), "the span is 2.0 s in the plan, 2.5 s in the study"),
        (scene(1).outputs(polhode::Outputs::Every(1.0)), "the number of output times is 1 in the plan, 2"),
        (
            scene(1).accuracy(Accuracy::attitude(1e-7)),
            "the accuracy is attitude 1e-6 rad, in 99 % of the bodies in the plan",
        ),
        (scene(1).precision(Some(Precision::F64)), "the precision is auto in the plan, f64"),
        (scene(1).torque(Torque::linear_drag(0.0)), "the list of torques is linear-drag, constant-world in the plan"),
        (scene(1).skipping(false), "skipping is allowed in the plan, forbidden (--no-skip)"),
        (scene(2), "the fingerprint of bodies and their parameters"),
    ];
    for (other, expected) in others {
        let error = Plan::repeated(&other, &engine, &document).expect_err(expected);
        assert!(matches!(error, Error::PlanMismatch { .. }) && error.is_input(), "{error}");
        assert!(error.to_string().contains(expected), "{error}");
    }
}

#[test]
fn a_file_that_is_no_plan_is_refused_with_its_line() {
    let engine = Engine::cpu();
    let scene = scene(1);
    let text = Plan::new(&scene, &engine).expect("a plan").to_json();
    for (from, to, expected) in [
        ("\"format\": 11", "\"format\": 10", "its format is 10, this release reads 11"),
        ("\"polhode\": \"", "\"polhode\": \"9.", "it is of polhode 9."),
        ("\"coefficient\": ", "\"coefficient\": -", "expected a finite number from 0 on"),
        ("\"closed_form\": \"", "\"closed_form\": \"x", "is not known"),
        ("\"method\": \"", "\"method\": \"x", "is not known"),
        ("\"skipping\": true,", "\"skipping\": true, \"more\": 1,", "unknown field `more`"),
        ("\"closed_form\"", "\"note\": \"mine\", \"closed_form\"", "unknown field `note`"),
        ("\"coefficient\"", "\"why\": 1, \"coefficient\"", "unknown field `why`"),
        ("\"engine\"", "\"who\": 1, \"engine\"", "unknown field `who`"),
        ("{\n  \"format\"", "{\n  format", "key must be a string"),
    ] {
        assert!(text.contains(from), "{from} in {text}");
        let line = 1 + text[..text.find(from).expect("there")].matches('\n').count();
        let line = if from.starts_with('{') { line + 1 } else { line };
        let error = PlanDocument::parse(Path::new("p.json"), &text.replacen(from, to, 1)).expect_err(expected);
        assert!(error.is_input() && error.to_string().contains(expected), "{error}");
        assert!(error.to_string().starts_with(&format!("p.json:{line}: ")), "{error}, not line {line}");
    }
    let sum = 1 + text[..text.find("\"sum\"").expect("there")].matches('\n').count();
    for (from, to, expected) in [
        ("\"attitude\": ", "\"attitude\": 2", format!("p.json:{sum}: it is not as the run wrote it: its sum differs")),
        ("\"class\": \"asymmetric\"", "\"class\": \"magic\"", format!("p.json:{sum}: ")),
        ("\"resolution\"", "\"solution\"", "unknown field `solution`".to_owned()),
    ] {
        assert!(text.contains(from), "{from} in {text}");
        let error = PlanDocument::parse(Path::new("p.json"), &text.replace(from, to)).expect_err(&expected);
        assert!(error.is_input() && error.to_string().contains(&expected), "{error}");
    }
}

#[test]
fn a_plan_with_any_number_edited_or_any_end_cut_is_refused() {
    let engine = Engine::cpu();
    let scene = scene(1);
    let text = Plan::new(&scene, &engine).expect("a plan").to_json();
    let mut edits = 0;
    for (place, letter) in text.char_indices().filter(|(_, letter)| letter.is_ascii_digit()) {
        let other = if letter == '1' { "2" } else { "1" };
        let edited = [&text[..place], other, &text[place + 1..]].concat();
        let read = PlanDocument::parse(Path::new("p.json"), &edited);
        let same = read.as_ref().is_ok_and(|read| read_back(&scene, read) == text);
        assert!(read.is_err_and(|error| error.is_input()) || same, "{edited}");
        edits += 1;
    }
    assert!(edits > 100, "{edits}");
    for end in (0..text.len() - 1).filter(|&end| text.is_char_boundary(end) && !text[end..].trim().is_empty()) {
        PlanDocument::parse(Path::new("p.json"), &text[..end]).expect_err("cut");
    }
}

/// The text of the plan that a document leads to: an edit of a digit beyond a number's precision changes nothing.
fn read_back(scene: &Scene, document: &PlanDocument) -> String {
    Plan::repeated(scene, &Engine::cpu(), document).map(|plan| plan.to_json()).unwrap_or_default()
}

#[test]
fn an_index_that_drops_a_torque_is_refused() {
    let engine = Engine::cpu();
    let scene = scene(1);
    let text = Plan::new(&scene, &engine).expect("a plan").to_json();
    let (before, rest) = text
        .split_once("\"torques\": [\n")
        .map(|(_, rest)| rest)
        .and_then(|rest| rest.split_once("\"torques\": [\n"))
        .expect("a list of indices");
    for (list, expected) in [
        ("0, 7", "torques holds 7: the scene has 2 torques, counted from 0"),
        ("1, 0", "ascending"),
        ("0", "sum differs"),
    ] {
        let (_, after) = rest.split_once(']').expect("its end");
        let head = &text[..text.len() - before.len() - rest.len() - "\"torques\": [\n".len()];
        let edited = format!("{head}{before}\"torques\": [{list}]{after}");
        let error = PlanDocument::parse(Path::new("p.json"), &edited).expect_err(expected);
        assert!(error.to_string().contains(expected), "{error}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_plan_or_study_without_end_is_refused() {
    let workspace = Workspace::new(STUDY);
    let line = workspace.refused(&["run", "study.toml", "--engine", "cpu", "--plan", "/dev/zero"], 2);
    assert_eq!(line, "error: /dev/zero: cannot be read: it is longer than 64 MiB\n");
    let line = workspace.refused(&["explain", "/dev/zero"], 2);
    assert_eq!(line, "error: /dev/zero: cannot be read: it is longer than 64 MiB\n");
    fs::write(workspace.path("study.toml"), "[bodies]\nfile = \"/dev/zero\"\n[time]\nend = 1.0\n").unwrap();
    let line = workspace.refused(&["explain", "study.toml", "--engine", "cpu"], 2);
    assert_eq!(line, "error: /dev/zero: cannot be read: a line is longer than a mebibyte: this is no table\n");
}

// --- the command ---

const STUDY: &str = r#"
seed = 5
[bodies]
count = 200
inertia = { shape = "box", mass = 3.0, edges = [1.0, 2.0, 3.0] }
orientation = { distribution = "uniform" }
angular_velocity = { distribution = "normal", mean = 0, sigma = 1 }
[[torque]]
model = "viscous"
coefficient = { distribution = "uniform", low = 0.01, high = 0.1 }
[time]
end = 4.0
[accuracy]
attitude = 1e-5
"#;

#[test]
fn a_run_leaves_its_plan_and_the_plan_repeats_the_run() {
    let workspace = Workspace::new(STUDY);
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
    assert_eq!(workspace.names("study.out"), ["final.csv", "plan.json", "report.json"]);
    workspace.done(&[
        "run",
        "study.toml",
        "--engine",
        "cpu",
        "--quiet",
        "--plan",
        "study.out/plan.json",
        "--out",
        "again",
    ]);
    for name in ["final.csv", "plan.json"] {
        let bytes = |folder: &str| fs::read(workspace.path(folder).join(name)).expect("written");
        assert!(bytes("study.out") == bytes("again"), "{name}");
    }
    let report = report(&workspace, "study.out");
    assert_eq!(report["plan"]["classes"][0]["bodies"], 200);
    assert_eq!(report["plan"]["classes"][0]["torques"][0], "linear-drag");
    let skips = report["plan"]["skips"].as_array().expect("a list");
    assert!(skips.iter().any(|skip| skip["name"] == "translation" && skip["bodies"] == 200), "{skips:?}");
    assert_eq!(report["accuracy"]["met"], true);
    let sampled = report["accuracy"]["bodies"].as_u64().expect("a number");
    assert!((96..=192).contains(&sampled), "{sampled}");
    assert_eq!(report["accuracy"]["target"]["attitude"], 1e-5);

    fs::write(workspace.path("study.toml"), STUDY.replace("seed = 5", "seed = 6")).unwrap();
    let line = workspace
        .refused(&["run", "study.toml", "--engine", "cpu", "--plan", "study.out/plan.json", "--out", "third"], 2);
    assert!(
        line.starts_with("error: study.out/plan.json: the fingerprint of bodies and their parameters is "),
        "{line}"
    );
    workspace.refused(&["run", "study.toml", "--engine", "cpu", "--plan", "absent.json", "--out", "third"], 2);
    assert_eq!(workspace.names("."), ["again", "study.out", "study.toml"], "nothing was made");
}

/// As of more than 2^20 bodies, of which a plan is made from the first.
#[test]
fn a_plan_of_the_first_bodies_says_of_how_many_they_are_the_first() {
    const ALL: usize = 1_000_000_000;
    let text = STUDY.replace("count = 200", &format!("count = {ALL}"));
    let study = Study::parse(Path::new("study.toml"), &text).expect("a study");
    let explained = |bodies: std::ops::Range<usize>| {
        let scene = study.clone().part(bodies).scene().expect("a scene");
        Plan::new(&scene, &Engine::cpu()).expect("a plan").explain()
    };
    let first = explained(0..200);
    let part = first.part.expect("a part");
    assert_eq!((first.bodies, part.bodies, part.first_body), (200, ALL, 0));
    let seconds = part.seconds.expect("known on the CPU");
    assert_eq!(seconds, first.seconds().expect("known") * (ALL as f64 / 200.0));
    let text = first.to_string();
    assert!(text.starts_with("1000000000 bodies, 4 s, 1 output time, on CPU"), "{text}");
    let line = format!(
        "\nexplained: the first 200 of the 1000000000 bodies, which the tables count; all are expected to take {seconds:.1e} s\n"
    );
    assert!(text.contains(&line), "{line} is missing in\n{text}");
    let json: serde_json::Value = serde_json::from_str(&first.to_json()).expect("JSON");
    assert_eq!((json["bodies"].as_u64(), json["part"]["bodies"].as_u64()), (Some(200), Some(ALL as u64)));
    let later = explained(4096..4296).to_string();
    assert!(later.contains("\nexplained: bodies 4096 to 4295 of the 1000000000 bodies"), "{later}");
}

#[test]
fn explain_prints_what_runs_and_what_does_not_and_runs_nothing() {
    let workspace = Workspace::new(STUDY);
    let text = workspace.done(&["explain", "study.toml", "--engine", "cpu"]);
    for part in ["200 bodies, 4 s, 1 output time, on CPU", "asymmetric", "linear-drag", "translation", "outputs"] {
        assert!(text.contains(part), "{part} is missing in\n{text}");
    }
    assert_eq!(workspace.names("."), ["study.toml"], "nothing was made");
    let json = workspace.done(&["explain", "study.toml", "--engine", "cpu", "--json"]);
    let value: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let class = &value["classes"][0];
    assert!(class["error"].as_f64().expect("a number") <= 1e-5, "{class}");
    assert_eq!(class["pilot_bodies"], 200);
    let steps = &class["steps"];
    assert!(steps["min"].as_u64() <= steps["median"].as_u64() && steps["median"].as_u64() <= steps["max"].as_u64());
    assert!(class["seconds"].as_f64().expect("known on the CPU") > 0.0);
    assert!(class["bytes"].as_u64().expect("a number") > 200 * 100);
    // Other targets beside the attitude, and another percentile.
    fs::write(
        workspace.path("more.toml"),
        STUDY.replace("attitude = 1e-5", "attitude = 1e-2\nenergy = 1e-9\npercentile = 90"),
    )
    .unwrap();
    workspace.done(&["run", "more.toml", "--engine", "cpu", "--quiet"]);
    let more = report(&workspace, "more.out");
    assert_eq!(more["accuracy"]["target"]["percentile"], 90.0);
    assert_eq!(more["accuracy"]["target"]["energy"], 1e-9);
    assert!(more["accuracy"]["kinetic_energy"]["median"].as_f64().expect("a number") <= 1e-9, "{more}");
    let unpiloted = workspace.done(&["explain", "study.toml", "--engine", "cpu", "--json", "--no-pilot"]);
    let value: serde_json::Value = serde_json::from_str(&unpiloted).expect("JSON");
    assert_eq!(value["classes"][0]["pilot_bodies"], 0);
    // The plan that is explained is the plan that runs.
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
    let run = report(&workspace, "study.out");
    assert_eq!(run["plan"]["classes"][0]["method"], class["method"]);
    assert_eq!(run["plan"]["classes"][0]["steps"], class["steps"]);
}
