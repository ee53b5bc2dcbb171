//! What is asked for: steps and bodies that are picked out, refusals, the report and the command.

use std::process::Command;

use glam::DVec3;
use polhode::engine::Engine;
use polhode::math::Precision;
use polhode::verify::{Culprit, Options, verify};
use polhode::{Error, Method, Torque};

use super::{BODIES, DT, scene, steps, workspace};

#[test]
fn a_body_and_a_first_step_are_picked_out() {
    let own = [Torque::linear_drag(0.3), Torque::sinusoidal(DVec3::X, DVec3::Y, 3.0)];
    let twins = vec![own[0].clone(), Torque::sinusoidal(1.001 * DVec3::X, DVec3::Y, 3.0)];
    let scene = scene(&own).pinned(Method::Rk4, DT, Some(Precision::F64));
    let options = Options { from_step: 30, body: Some(5), twin_torques: Some(twins), ..steps(8) };
    let report = verify(&Engine::cpu(), &scene, &options).expect("both sides run");
    assert_eq!((report.bodies, report.groups.len(), report.groups[0].steps.clone()), (1, 1, 30..38));
    let parting = report.parting().expect("the torques differ");
    // From before the output at 0.5 s to behind it.
    assert_eq!((parting.body, parting.step, parting.time), (5, 31, 30.0 * DT));
    assert_eq!(parting.culprit, Culprit::Torques(vec![1]));
}

#[test]
fn what_compares_nothing_is_refused() {
    let scene = scene(&[]).pinned(Method::Rk4, DT, None);
    let refusal = |options: Options| match verify(&Engine::cpu(), &scene, &options) {
        Err(Error::Setting { field, .. }) => field,
        other => panic!("{options:?}: {other:?}"),
    };
    assert_eq!(refusal(steps(0)), "steps");
    assert_eq!(refusal(Options { body: Some(BODIES), ..steps(1) }), "body");
    assert_eq!(refusal(Options { from_step: 64, ..steps(1) }), "from_step");
}

/// A text whose numbers and lanes are those of no machine.
fn without_numbers(text: &str) -> String {
    let mut lines: Vec<String> = Vec::new();
    for line in text.lines() {
        let line = if line.contains(", as planned") {
            "N bodies on the CPU, as planned".to_owned()
        } else if let (true, Some((_, rest))) = (line.contains("lanes ("), line.split_once(" against ")) {
            format!("  CPU lanes against {rest}")
        } else if line.contains(" at most") && line.contains("(body") || line.ends_with(" equal") {
            format!("{} ...", line[..28].trim_end())
        } else if line.contains(" apart, ") {
            "      # expected: # apart, # allowed".to_owned()
        } else {
            line.to_owned()
        };
        // Lanes of every width say the same.
        if line.is_empty() || !lines.contains(&line) {
            lines.push(line);
        }
    }
    lines.join("\n")
}

#[test]
fn the_report_reads_well() {
    let own = [Torque::linear_drag(0.3), Torque::sinusoidal(DVec3::X, DVec3::Y, 3.0)];
    let twins = vec![own[0].clone(), Torque::sinusoidal(1.001 * DVec3::X, DVec3::Y, 3.0)];
    let scene = scene(&own).pinned(Method::Rk4, DT, Some(Precision::F64));
    let report = verify(&Engine::cpu(), &scene, &steps(8)).expect("both sides run");
    insta::assert_snapshot!(without_numbers(&report.to_string()), @r"
    N bodies on the CPU, as planned

    25 driven, rk4 in f64, steps of 1.562e-2 s at most; torque 1 (linear-drag), torque 2 (sinusoidal)
      steps 1 to 8 of 64
      CPU lanes against the scalar twin: 801 numbers
        orientation ...
        norm of the quaternion ...
        angular momentum ...
        status ...
        steps in one call ...

    not compared: what a run's report says of it: drift, balance, error estimate
    verdict: they agree
    ");
    let options = Options { twin_torques: Some(twins), body: Some(3), ..steps(8) };
    let report = verify(&Engine::cpu(), &scene, &options).expect("both sides run");
    insta::assert_snapshot!(without_numbers(&report.to_string()), @r"
    N bodies on the CPU, as planned

    1 driven, rk4 in f64, steps of 1.562e-2 s at most; torque 1 (linear-drag), torque 2 (sinusoidal)
      steps 1 to 8 of 64
      CPU lanes against the scalar twin: 33 numbers
        orientation ...
        norm of the quaternion ...
        angular momentum ...
        status ...
        steps in one call ...
        THEY PART at step 1 (t = 0e0 s), body 3: angular momentum z
          # expected: # apart, # allowed
          it comes from torque 2 (sinusoidal), which parts alone
          it falls as the step to the power 2: the slopes of the angular momentum agree at the start of the step, and part later in it
          stage 2 of 4 is the first whose slope differs, in short steps from the states and times of the twin's: that of the angular momentum, by the torque

    not compared: what a run's report says of it: drift, balance, error estimate
    verdict: THEY DO NOT AGREE
    ");
    let json: serde_json::Value = serde_json::from_str(&report.to_json()).expect("JSON");
    assert_eq!(json["groups"][0]["comparisons"][0]["parting"]["torques"][0], 1);
}

const STUDY: &str = "
[bodies]
count = 5
inertia = [1.0, 2.0, 2.5]
angular_velocity = { distribution = 'normal', mean = [1, 0, 0], sigma = 0.3 }
[[torque]]
model = 'sinusoidal'
sine = [0.1, 0.2, 0.3]
rate = 2.0
[time]
end = 2.0
[accuracy]
method = 'rk8'
dt = 0.05
";

#[test]
fn the_command_compares_a_study() {
    let workspace = workspace::Workspace::new(STUDY);
    for engine in ["cpu", "gpu"] {
        let text = workspace.done(&["verify", "study.toml", "--engine", engine, "--steps", "5"]);
        assert!(text.contains("torque 1 (sinusoidal)") && text.contains("verdict: they agree"), "{text}");
        let text =
            workspace.done(&["verify", "study.toml", "--engine", engine, "--from-step", "20", "--body", "3", "--json"]);
        let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(
            (&value["agrees"], &value["bodies"], &value["groups"][0]["first"]),
            (&true.into(), &1.into(), &21.into())
        );
    }
    let line = workspace.refused(&["verify", "study.toml", "--engine", "cpu", "--steps", "0"], 2);
    assert_eq!(line, "error: steps = 0.0: expected one step or more, as nothing would be compared\n");
    workspace.refused(&["verify", "study.toml", "--engine", "cpu", "--body", "5"], 2);
    workspace.refused(&["verify", "study.toml", "--engine", "cpu", "--from-step", "40"], 2);
}

#[test]
fn without_an_adapter_nothing_is_called_checked() {
    let workspace = workspace::Workspace::new(STUDY);
    let run = |arguments: &[&str]| {
        // The loader of Vulkan finds no driver.
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("polhode"));
        command.env("VK_DRIVER_FILES", "/nonexistent").env("VK_ICD_FILENAMES", "/nonexistent");
        command.current_dir(workspace.folder()).args(arguments).output().expect("the command starts")
    };
    for arguments in [&["verify", "study.toml"] as &[&str], &["verify", "study.toml", "--engine", "gpu"]] {
        let output = run(arguments);
        let errors = workspace::words(&output.stderr);
        assert_eq!((output.status.code(), errors.lines().count()), (Some(1), 1), "{errors}");
        assert!(errors.starts_with("error: no GPU adapter") && errors.contains("--engine cpu"), "{errors}");
    }
    assert!(run(&["verify", "study.toml", "--engine", "cpu"]).status.success());
}
