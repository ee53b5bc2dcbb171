//! The own state of sampled torques as a quantity of studies: names, units and refusals, tables, parts, pictures.

#![cfg(feature = "cli")]

use std::fs;
use std::path::Path;

use glam::DVec3;
use polhode::study::Study;

use crate::control;
use crate::in_parts::{done, leave_the_bytes_of, tables};
use crate::workspace::{States, Workspace, report};

/// What is asked of the wheels of [`control::STUDY`], and of the samples that it counts.
const ASKED: &str = r#"
[[quantity]]
name = "wheels"
formula = "norm(torque1_h)"
unit = "kg m²/s"
[[histogram]]
quantity = "torque1_h_x"
low = "-1 g m^2/s"
high = 1e-3
bins = 6
[[event]]
name = "seventh sample"
quantity = "torque1_count"
above = 6.5
[[event]]
name = "wheels turn"
quantity = "wheels"
above = "0.4 g m^2/s"
action = "ACTION"
[output]
"#;

fn study(action: &str) -> String {
    let text = control::STUDY.replace("[output]\n", &ASKED.replace("ACTION", action));
    text.replace("statistics = [\"spin_rate\"]", "statistics = [\"spin_rate\", \"torque1_h_x\", \"wheels\"]")
}

fn refusal(old: &str, new: &str) -> String {
    let text = study("record");
    assert_eq!(text.matches(old).count(), 1, "{old}");
    let study = Study::parse(Path::new("study.toml"), &text.replace(old, new));
    study.map(|_| ()).expect_err(new).to_string()
}

#[test]
fn names_and_units_that_do_not_fit_are_refused_with_what_does() {
    for (old, new, expected) in [
        (
            "\"torque1_h_x\", \"wheels\"]",
            "\"torque1_hx\"]",
            "did you mean torque1_h_x? expected a quantity: torque1_h_x",
        ),
        ("\"torque1_h_x\", \"wheels\"]", "\"torque1_h\"]", "did you mean torque1_h_"),
        ("norm(torque1_h)", "norm(torque1_g)", "column 17: unknown name `torque1_g`; nearest: `torque1_h`"),
        ("norm(torque1_h)", "torque1_h", "the result: found a vector, needed a number"),
        ("name = \"wheels\"", "name = \"torque1_count\"", "expected a name that no other quantity has"),
        (
            "[output]\n",
            "[output]\ncolumns = [\"torque1_h_x\"]\n",
            "tables of states always include the own state of torques: leave it out",
        ),
        ("above = \"0.4 g m^2/s\"", "above = \"0.4 m\"", "event[3].above = \"0.4 m\""),
    ] {
        let message = refusal(old, new);
        assert!(message.starts_with("study.toml:") && message.contains(expected), "{new}: {message}");
    }
}

/// Of models the units are known: a level in another dimension is refused.
#[test]
fn levels_of_models_have_their_units() {
    let of = |level: &str| {
        let wheels = "[[torque]]\nmodel = \"reaction-wheels\"\nstiffness = 1\ndamping = 1\ntarget = [0, 0, 0, 1]\ntorque_limit = 1\nmomentum_limit = 1\nevery = 1\n";
        let text = format!(
            "[bodies]\ncount = 2\ninertia = [1, 2, 2.5]\nangular_velocity = [0, 0, 1]\n{wheels}[time]\nend = 3\n[[event]]\nname = \"full\"\nquantity = \"torque1_h_z\"\nabove = {level}\n"
        );
        Study::parse(Path::new("study.toml"), &text).and_then(|study| study.scene())
    };
    let scene = of("\"3 g m^2/s\"").expect("a momentum");
    let quantity = scene.wanted_events()[0].quantity();
    assert_eq!((quantity.name(), quantity.unit()), ("torque1_h_z", "kg m²/s"));
    assert!((scene.wanted_events()[0].condition().level() - 3e-3).abs() < 1e-18);
    let message = of("\"3 T\"").map(|_| ()).expect_err("a field").to_string();
    assert!(message.contains("event[1].above = \"3 T\"") && message.contains("kg m²/s"), "{message}");
}

#[test]
fn tables_of_statistics_and_events_follow_the_own_state() {
    let workspace = Workspace::new(&study("record").replace("[output]\n", "[output]\ncolumns = [\"wheels\"]\n"));
    workspace.done(&["run", "study.toml", "--quiet", "--engine", "cpu"]);
    let states = States::read(&workspace.path("study.out/snapshots.csv"));
    let statistics = States::read(&workspace.path("study.out/statistics.csv"));
    for row in 0..statistics.column("t").len() {
        let time = statistics.column("t")[row];
        let at: Vec<usize> = (0..states.rows()).filter(|&state| states.column("t")[state] == time).collect();
        let mean = |value: &dyn Fn(usize) -> f64| at.iter().map(|&row| value(row)).sum::<f64>() / at.len() as f64;
        let momentum = |row: usize| states.vector(["torque1_h_x", "torque1_h_y", "torque1_h_z"], row);
        for (name, expected) in [
            ("torque1_h_x_mean", mean(&|row| states.column("torque1_h_x")[row])),
            ("wheels_mean", mean(&|row| momentum(row).length())),
        ] {
            let found = statistics.column(name)[row];
            assert!((found - expected).abs() < 1e-15, "{name} at {time} s: {found} and {expected}");
        }
        for &row in &at {
            assert!((states.column("wheels")[row] - momentum(row).length()).abs() < 1e-15);
        }
    }
    let text = fs::read_to_string(workspace.path("study.out/events.csv")).expect("a table");
    let seventh: Vec<&str> = text.lines().filter(|line| line.starts_with("seventh sample,")).collect();
    assert_eq!(seventh.len(), 500);
    // The sample at 0 is the first.
    let at_three = |line: &&&str| {
        let time: f64 = line.split(',').nth(2).expect("a time").parse().expect("a number");
        (time - 3.0).abs() < 1e-10 && line.contains("located")
    };
    assert_eq!(seventh.iter().filter(at_three).count(), 500, "{}", seventh[0]);
    let quantities = report(&workspace, "study.out")["quantities"].clone();
    let unit = |name: &str| {
        let all = quantities.as_array().expect("a list");
        all.iter().find(|quantity| quantity["name"] == name).map(|quantity| quantity["unit"].clone())
    };
    assert_eq!((unit("torque1_h_x"), unit("wheels")), (Some("SI".into()), Some("kg m²/s".into())));
    workspace.done(&["plot", "study.out"]);
    let picture = fs::read_to_string(workspace.path("study.out/histograms.svg")).expect("a picture");
    assert!(picture.contains("torque1 h x (SI)"), "{}", &picture[..picture.len().min(400)]);
}

/// Also where an event of the wheels stops bodies, which stand with what their wheels have then.
#[test]
fn parts_and_pieces_leave_the_bytes_of_one_run_with_what_wheels_were_asked() {
    for (action, steps) in [
        ("record", "method = \"rk8\"\ntolerance = 1e-10"),
        ("stop", "method = \"rk8\"\ntolerance = 1e-10"),
        ("stop", "method = \"rk4\"\ndt = 0.07\nprecision = \"f32\""),
    ] {
        let text = study(action).replace("method = \"rk8\"\ntolerance = 1e-10", steps);
        let workspace = Workspace::new(&text);
        done(&workspace, 2, &["run", "study.toml", "--out", "whole", "--quiet", "--engine", "cpu"]);
        let whole = tables(&workspace, "whole");
        for name in ["statistics.csv", "histograms.csv", "events.csv", "survival.csv"] {
            assert!(whole.contains_key(name), "{name} among {:?}", whole.keys());
        }
        let _ = leave_the_bytes_of(&whole, &workspace, "0.2");
        if action == "record" {
            continue;
        }
        let states = States::read(&workspace.path("whole/final.csv"));
        let stopped = (0..states.rows()).filter(|&row| states.column("stopped_at")[row].is_finite());
        let momentum = |row| states.vector(["torque1_h_x", "torque1_h_y", "torque1_h_z"], row);
        let off = stopped.map(|row| (momentum(row) as DVec3).length() - 4e-4).collect::<Vec<f64>>();
        assert!(off.len() > 100, "{}", off.len());
        let bound = if steps.contains("f32") { 1e-9 } else { 1e-13 };
        assert!(off.iter().all(|off| off.abs() < bound || *off > 0.0), "{off:?}");
        assert!(off.iter().filter(|off| off.abs() < bound).count() > 50, "most pass it on their way: {off:?}");
    }
}

#[test]
fn a_gpu_asks_the_wheels_what_the_cpu_asks() {
    let workspace = Workspace::new(&study("stop"));
    for engine in ["cpu", "gpu"] {
        workspace.done(&["run", "study.toml", "--out", engine, "--quiet", "--engine", engine]);
    }
    for (file, names) in [
        ("final.csv", &["torque1_h_y", "torque1_count", "stopped_at"][..]),
        ("statistics.csv", &["torque1_h_x_mean", "wheels_q50"]),
    ] {
        let [cpu, gpu] = ["cpu", "gpu"].map(|folder| States::read(&workspace.path(&format!("{folder}/{file}"))));
        for name in names {
            for (own, other) in gpu.column(name).iter().zip(cpu.column(name)) {
                assert!((own - other).abs() < 1e-9 || own.is_nan() && other.is_nan(), "{name}: {own} and {other}");
            }
        }
    }
}
