//! What cannot be decided: bodies that both sides lose, steps without a bound, motions that no shader computes.

use std::process::Command;

use glam::DVec3;
use polhode::engine::Engine;
use polhode::math::Precision;
use polhode::scene::AdaptiveSteps;
use polhode::torque::Parameters;
use polhode::verify::{Comparison, Options, Report, Verdict, verify};
use polhode::{Method, Scene, Torque};

use super::{DT, common, scene, steps, workspace};

fn judged(report: &Report) -> impl Iterator<Item = &Comparison> {
    report.groups.iter().flat_map(|group| &group.comparisons).filter(|comparison| comparison.judged)
}

fn verified(engine: &Engine, scene: &Scene) -> Report {
    verify(engine, scene, &steps(8)).expect("both sides run")
}

/// Some components overflow in a step and others in the next, on both sides alike: nothing parts there.
#[test]
fn bodies_that_overflow_alike_do_not_part() {
    for engine in [Engine::cpu(), common::gpu()] {
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let torque = Torque::constant_body(1e10 * axis);
            let report = verified(&engine, &scene(&[torque]).pinned(Method::Rk4, 0.05, Some(Precision::F64)));
            assert_eq!(report.parting(), None, "{axis}: {report}");
            assert!(judged(&report).all(|one| one.undecided > 0 && one.lost > 0), "{report}");
        }
    }
}

/// Steps of some turns take Runge-Kutta methods off the unit sphere, and implicit equations have several solutions then: both sides
/// err by more than their roundings can be bounded by. `rk4` parted by 1e17 times its bound.
#[test]
fn steps_too_long_for_their_method_are_without_a_bound() {
    let top = Torque::heavy_top(1.0, DVec3::new(0.05, 0.0, 0.2), -9.8 * DVec3::Z);
    for engine in [Engine::cpu(), common::gpu()] {
        for method in
            [Method::Rk4, Method::Cf4, Method::Splitting2, Method::ImplicitMidpoint, Method::Dlm, Method::Spiral]
        {
            let mut without = 0;
            for (precision, dt) in
                Precision::ALL.iter().flat_map(|&precision| [1.0, 1.5, 2.0, 3.0, 5.0].map(|dt| (precision, dt)))
            {
                let scene = scene(std::slice::from_ref(&top)).until(8.0 * dt).pinned(method, dt, Some(precision));
                let report = verified(&engine, &scene);
                assert_eq!(report.parting(), None, "{method} in {precision}, {dt} s: {report}");
                without += judged(&report).map(|side| side.undecided + side.lost).sum::<u64>();
            }
            assert!(without > 0, "{method}");
        }
    }
}

/// A formula that is none for one side alone is a fault of moderate numbers, whichever side that is.
#[test]
fn what_is_no_number_on_one_side_alone_parts() {
    let formula = |text: &str| vec![Torque::custom(text, Parameters::new()).expect("a formula")];
    let [root, none] = ["vec(1e-3 * sqrt(0.05 - time), 0, 0)", "vec(1e-3 * sqrt(abs(0.05 - time)), 0, 0)"].map(formula);
    for (own, twin) in [(&root, &none), (&none, &root)] {
        let scene = scene(own).pinned(Method::Rk4, DT, Some(Precision::F64));
        let options = Options { twin_torques: Some(twin.clone()), ..steps(8) };
        let report = verify(&Engine::cpu(), &scene, &options).expect("both sides run");
        let parting = report.parting().unwrap_or_else(|| panic!("{report}"));
        assert!(parting.step > 1 && parting.difference.is_infinite(), "{report}");
    }
}

/// A torque that takes every body beyond all numbers in its first step.
fn overflowing() -> Torque {
    Torque::constant_body(1e200 * DVec3::X)
}

#[test]
fn sides_that_lose_every_body_are_not_said_to_agree() {
    for engine in [Engine::cpu(), common::gpu()] {
        for method in [Method::Rk4, Method::Rk8] {
            let report = verified(&engine, &scene(&[overflowing()]).pinned(method, DT, Some(Precision::F64)));
            assert_eq!((report.verdict(), report.agrees()), (Verdict::NothingCompared, false), "{method}: {report}");
            for side in judged(&report) {
                assert_eq!((side.decided, side.undecided, side.lost), (0, 0, 8 * super::BODIES as u64), "{report}");
            }
            let (text, lost) = (report.to_string(), 8 * super::BODIES);
            assert!(text.contains(&format!("{lost} steps after which the body is lost to infinity")), "{text}");
            let json: serde_json::Value = serde_json::from_str(&report.to_json()).expect("JSON");
            let side = &json["groups"][0]["comparisons"][0];
            assert_eq!((&json["agrees"], &side["lost"], &side["decided"]), (&false.into(), &lost.into(), &0.into()));
        }
    }
}

#[test]
fn the_command_fails_where_nothing_is_compared() {
    let study = "
[bodies]
count = 3
inertia = [1.0, 2.0, 2.5]
angular_velocity = [1, 0, 0]
[[torque]]
model = 'constant-body'
torque = [1e200, 0.0, 0.0]
[time]
end = 1.0
[accuracy]
method = 'rk4'
dt = 0.05
";
    let workspace = workspace::Workspace::new(study);
    for engine in ["cpu", "gpu"] {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("polhode"));
        command.current_dir(workspace.folder()).args([
            "verify",
            "study.toml",
            "--engine",
            engine,
            "--precision",
            "f64",
        ]);
        let output = command.output().expect("the command starts");
        let text = workspace::words(&output.stdout);
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(text.ends_with("verdict: nothing was compared\n"), "{text}");
    }
}

/// Torques each of which can be recorded, and which are too long together.
fn long_torques() -> Vec<Torque> {
    let long = |number: usize| {
        let terms: Vec<String> =
            (0..400).map(|term| format!("angular_velocity * sin({}.{term:03} * time)", number + 1)).collect();
        let text = format!("({}) * 1e-4", terms.join(" + "));
        Torque::custom(&text, Parameters::new()).expect("a formula")
    };
    (0..6).map(long).collect()
}

/// No bound is known, so that any finite number would pass.
#[test]
fn torques_too_long_to_be_recorded_together_are_not_decided() {
    let own = long_torques();
    let steps_by_series = AdaptiveSteps { tolerance: 1e-6, least_step: None };
    for scene in [
        scene(&own).pinned(Method::Rk4, DT, Some(Precision::F64)),
        scene(&own).adaptive(steps_by_series, Some(Precision::F64)),
    ] {
        let report = verify(&Engine::cpu(), &scene, &steps(2)).expect("both sides run");
        assert_eq!(report.verdict(), Verdict::NotDecided, "{report}");
        assert!(judged(&report).all(|one| one.decided == 0 && one.undecided > 0), "{report}");
        let text = report.to_string();
        assert!(text.contains("bounds: none are known") && text.contains("verdict: not decided"), "{text}");
    }
}

/// Free bodies of which two moments are equal turn as regular precessions, which the host forms.
#[test]
fn what_no_shader_computes_is_said_to_be_computed_by_none() {
    let said = "not compared: shaders: no shader computes any of these bodies";
    let symmetric = |engine: &Engine| {
        let one = (DVec3::new(1.0, 1.0, 2.0), glam::DQuat::IDENTITY, DVec3::new(0.3, 0.2, 1.0));
        let ensemble = polhode::Ensemble::from_fn(5, |_| one).expect("valid bodies");
        verified(engine, &Scene::new(ensemble).until(1.0)).to_string()
    };
    let text = symmetric(&common::gpu());
    assert!(text.contains("two uniform rotations, f64 on the host") && text.contains(said), "{text}");
    // The CPU engine has no shaders, and elsewhere the GPU's compute the bodies.
    assert!(!symmetric(&Engine::cpu()).contains(said));
    let stepped = scene(&[]).pinned(Method::Rk4, DT, None).skipping(false);
    assert!(!verified(&common::gpu(), &stepped).to_string().contains(said));
}
