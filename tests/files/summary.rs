//! What a run says of itself on the terminal and in its report: every method that ran, what was asked for, and whether it was met.

#![cfg(feature = "cli")]

use std::fs;

use crate::failed_bodies::bodies;
use crate::workspace;

use workspace::{Workspace, report, words};

/// Bodies of which every tenth is slowed down by drag.
const MIXED: &str = r#"
[bodies]
file = "bodies.csv"
[[torque]]
model = "linear-drag"
coefficient = { column = "drag" }
[time]
end = 8.0
[accuracy]
attitude = 1e-5
energy = 1e-4
percentile = 95
"#;

fn mixed(count: usize) -> Workspace {
    let workspace = Workspace::new(MIXED);
    let mut table = "ixx,iyy,izz,wx,wy,wz,drag\n".to_owned();
    for body in 0..count {
        let drag = if body % 10 == 0 { 0.1 } else { 0.0 };
        table += &format!("1,2,2.5,{},1,0.5,{drag}\n", 0.1 + 0.001 * body as f64);
    }
    fs::write(workspace.path("bodies.csv"), table).expect("the table is written");
    workspace
}

const RUN: [&str; 4] = ["run", "study.toml", "--engine", "cpu"];

#[test]
fn all_methods_of_a_mixed_run_are_named() {
    let workspace = mixed(200);
    let summary = workspace.done(&RUN);
    let plan = &report(&workspace, "study.out")["plan"];
    let parts = plan["parts"].as_array().expect("a list");
    assert_eq!(parts.len(), 2, "{plan}");
    assert_eq!((&parts[0]["method"], &parts[0]["bodies"]), (&"closed form".into(), &180.into()), "{plan}");
    assert_eq!(parts[1]["bodies"], 20, "{plan}");
    let text = |value: &serde_json::Value| value.as_str().expect("a text").to_owned();
    let [free, driven] = [0, 1].map(|part: usize| (text(&parts[part]["method"]), text(&parts[part]["precision"])));
    assert_eq!(plan["method"], format!("{} + {}", free.0, driven.0));
    let precisions = if free.1 == driven.1 { free.1.clone() } else { format!("{} + {}", free.1, driven.1) };
    assert_eq!(plan["precision"], precisions);
    let line = format!("200 bodies, 8 s: 180 closed form in {}, 20 {} in {}", free.1, driven.0, driven.1);
    assert!(summary.contains(&line), "{line} is missing in\n{summary}");
}

#[test]
fn what_was_asked_for_stands_beside_what_came_out() {
    let workspace = mixed(200);
    let summary = workspace.done(&RUN);
    let asked = "attitude 1e-5 rad, energy 1e-4 of its value, in 95 % of the bodies";
    let bodies = report(&workspace, "study.out")["accuracy"]["bodies"].as_u64().expect("a number");
    assert!((96..=192).contains(&bodies), "{bodies}");
    let effective = report(&workspace, "study.out")["accuracy"]["effective"].as_f64().expect("a number");
    let worth = match effective < 0.75 * bodies as f64 {
        true => format!(" (they say as much as {effective:.0} drawn evenly)"),
        false => String::new(),
    };
    let met = format!("  asked    {asked}\n           met, 0 of {bodies} bodies beyond{worth}\n");
    assert!(summary.contains(&met), "{summary}");
    assert!(summary.contains(&format!("estimated from {bodies} bodies recomputed in f64")), "{summary}");
    let errors = summary.split_once("  error    attitude (rad)   median ").expect("errors").1;
    assert!(errors.contains("\n           kinetic energy   median "), "{summary}");
    let explained = workspace.done(&["explain", "study.toml", "--engine", "cpu"]);
    assert!(explained.contains(&format!("\nasked for: {asked}\n")), "{explained}");
    assert!(!explained.contains("no pilot"), "{explained}");
    let unpiloted = workspace.done(&["explain", "study.toml", "--engine", "cpu", "--no-pilot"]);
    assert!(unpiloted.contains("\nno pilot: "), "{unpiloted}");

    let pinned = MIXED.split_once("attitude").expect("targets").0.to_owned() + "method = \"rk4\"\ndt = 0.01\n";
    fs::write(workspace.path("study.toml"), pinned).expect("written");
    let summary = workspace.done(&["run", "study.toml", "--engine", "cpu", "--force"]);
    assert!(summary.contains("200 bodies, 8 s: rk4 in f64, 800 steps of 1.000e-2 s or less\n"), "{summary}");
    assert!(!summary.contains("  asked "), "{summary}");

    // No step is longer than the time between two outputs.
    let long = MIXED.replace("end = 8.0\n", "end = 8.0\noutputs = { every = 0.25 }\n");
    let long = long.split_once("attitude").expect("targets").0.to_owned() + "method = \"rk8\"\ndt = 100.0\n";
    fs::write(workspace.path("study.toml"), long).expect("written");
    let summary = workspace.done(&["run", "study.toml", "--engine", "cpu", "--force"]);
    assert!(summary.contains("rk8 in f64, 32 steps of 2.500e-1 s or less\n"), "{summary}");
}

#[test]
fn a_study_says_how_many_bodies_are_recomputed() {
    let workspace = mixed(200);
    let run = |more: &str| {
        fs::write(workspace.path("study.toml"), format!("{MIXED}{more}")).expect("written");
        (workspace.done(&["run", "study.toml", "--engine", "cpu", "--force"]), report(&workspace, "study.out"))
    };
    let (_, usual) = run("");
    for (wanted, line) in [(5, "estimated from 5 bodies recomputed"), (500, "estimated from 200 bodies recomputed")] {
        let (summary, report) = run(&format!("recompute = {wanted}\n"));
        assert!(summary.contains(line), "{summary}");
        assert_eq!(report["accuracy"]["bodies"], wanted.min(200));
        // Five bodies of 200 say nothing of 99 %.
        let is_enough = (wanted > 5).then_some(true);
        assert_eq!(report["accuracy"]["met"].as_bool(), is_enough);
        assert_eq!(report["drift"], usual["drift"]);
    }
    let (summary, report) = run("recompute = 0\n");
    assert!(summary.contains("  error    not estimated: no body was recomputed\n"), "{summary}");
    assert!(!summary.contains("balance") && !summary.contains("   met"), "{summary}");
    assert!(summary.contains("           not known whether it is met\n"), "{summary}");
    let accuracy = &report["accuracy"];
    assert_eq!((&accuracy["bodies"], &accuracy["met"]), (&0.into(), &serde_json::Value::Null));
    assert!(accuracy["target"]["attitude"] == 1e-5 && accuracy["attitude"]["max"].is_null(), "{accuracy}");
    assert_eq!(report["drift"], usual["drift"]);
    let explained = workspace.done(&["explain", "study.toml", "--engine", "cpu"]);
    assert!(
        explained.contains("recomputed after the run: no bodies, so that its errors will not be known"),
        "{explained}"
    );

    // Statistics and events without states: nothing is compared either.
    let observed = "recompute = 0\n[output]\nfinal = false\nstatistics = [\"spin_rate\"]\n[[event]]\nname = \"slow\"\n\
                    quantity = \"spin_rate\"\nbelow = 1.0\n";
    let study = MIXED.split_once("attitude").expect("targets").0.to_owned() + "mean = 1e-3\n" + observed;
    fs::write(workspace.path("study.toml"), study).expect("written");
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--force"]);
    let report = self::report(&workspace, "study.out");
    assert!(report["statistical_accuracy"].is_null() && report["accuracy"]["bodies"] == 0, "{report}");
    assert_eq!(report["events"][0]["compared"], 0, "{report}");
    for wrong in ["-1", "2.5", "\"all\""] {
        fs::write(workspace.path("study.toml"), format!("{MIXED}recompute = {wrong}\n")).expect("written");
        let refused = workspace.refused(&["run", "study.toml", "--engine", "cpu", "--force"], 2);
        assert!(refused.contains("accuracy.recompute = "), "{refused}");
        assert!(refused.contains("expected a number of bodies to be recomputed, or 0 for none"), "{refused}");
    }
}

#[test]
fn a_strict_run_fails_unless_its_accuracy_is_known_to_be_met() {
    let workspace = mixed(200);
    let run = |more: &str, flags: &[&str]| {
        fs::write(workspace.path("study.toml"), format!("{MIXED}{more}")).expect("written");
        let arguments = [&["run", "study.toml", "--engine", "cpu", "--force", "--quiet"], flags].concat();
        workspace.polhode(&arguments).status.code()
    };
    for flags in [&["--strict"][..], &["--strict", "--checkpoint", "60"]] {
        assert_eq!(run("", flags), Some(0), "{flags:?}");
        assert_eq!(run("recompute = 0\n", flags), Some(1), "{flags:?}: nothing is known");
        assert_eq!(run("recompute = 0\n", &flags[1..]), Some(0), "{flags:?}");
    }
}

#[test]
fn drift_is_shown_of_what_bodies_conserve_alone() {
    let workspace = mixed(200);
    let drift = |more: &str| {
        let study = MIXED.split_once("[[torque]]").expect("torques").0.to_owned() + more + "[time]\nend = 8.0\n";
        fs::write(workspace.path("study.toml"), study).expect("written");
        let summary = workspace.done(&["run", "study.toml", "--engine", "cpu", "--force"]);
        (report(&workspace, "study.out")["drift"].clone(), summary)
    };
    let counts = |drift: &serde_json::Value| {
        ["bodies", "kinetic_energy_bodies", "angular_momentum_bodies"].map(|key| drift[key].as_u64().expect("a number"))
    };
    let none = serde_json::json!({ "median": null, "p99": null, "max": null });
    let torque = |words: &str| format!("[[torque]]\nmodel = {words}\n");

    // Drag, which takes more than a tenth of every tenth body's energy, is no drift of the others.
    let (found, summary) = drift(&torque("\"linear-drag\"\ncoefficient = { column = \"drag\" }"));
    assert_eq!(counts(&found), [200, 180, 180]);
    for quantity in ["kinetic_energy", "angular_momentum_world"] {
        assert!(found[quantity]["max"].as_f64().expect("a number") < 1e-6, "{found}");
    }
    assert_eq!(summary.matches(", in the 180 of 200 bodies that keep it\n").count(), 2, "{summary}");

    // All bodies alike.
    let table = fs::read_to_string(workspace.path("bodies.csv")).expect("a table");
    let columns = |line: &str| line.rsplit_once(',').expect("columns").0.to_owned() + "\n";
    fs::write(workspace.path("bodies.csv"), table.lines().map(columns).collect::<String>()).expect("written");

    let (found, summary) = drift(&torque("\"internal-dissipation\"\ncoefficient = 0.1"));
    assert_eq!(counts(&found), [200, 0, 200]);
    assert_eq!(found["kinetic_energy"], none);
    assert!(found["angular_momentum_world"]["max"].as_f64().expect("a number") < 1e-6, "{found}");
    assert!(summary.contains("\n  drift    angular momentum median "), "{summary}");

    let (found, summary) = drift(&torque("\"linear-drag\"\ncoefficient = 0.1"));
    assert_eq!(counts(&found), [200, 0, 0]);
    assert_eq!([&found["kinetic_energy"], &found["angular_momentum_world"]], [&none, &none]);
    assert!(summary.contains("\n  drift    |q| - 1          median "), "{summary}");
    assert!(summary.contains("\n  balance  kinetic energy   median "), "{summary}");
}

#[test]
fn errors_of_centres_of_mass_stand_beside_those_of_the_rotation() {
    let (bodies, end) = (bodies(12), "[time]\nend = 8.0\n");
    let flying = "mass = 2.0\nvelocity = [30, 0, 0]\n[[force]]\nmodel = \"quadratic-drag\"\ncoefficient = 0.5\n";
    let workspace = Workspace::new(&format!("{bodies}{flying}{end}"));
    let summary = workspace.done(&RUN);
    let accuracy = &report(&workspace, "study.out")["accuracy"];
    assert_eq!((&accuracy["bodies"], &accuracy["translating"]), (&12.into(), &12.into()));
    // Steps of a sixty-fourth of the velocity's own time err by less than 1e-9 of the 100 m and 30 m/s.
    for (quantity, most, line) in [("position", 1e-7, "position (m)     "), ("velocity", 3e-8, "velocity (m/s)   ")] {
        let error = accuracy[quantity]["max"].as_f64().expect("a number");
        assert!(error > 0.0 && error < most, "{quantity}: {error:e}");
        assert!(summary.contains(&format!("\n           {line}median ")), "{summary}");
    }
    fs::write(workspace.path("study.toml"), format!("{bodies}{end}")).expect("written");
    let summary = workspace.done(&[&RUN[..], &["--force"]].concat());
    let accuracy = &report(&workspace, "study.out")["accuracy"];
    assert_eq!((&accuracy["translating"], &accuracy["position"]["max"]), (&0.into(), &serde_json::Value::Null));
    assert!(!summary.contains("position (m)"), "{summary}");
}

#[test]
fn no_bodies_have_no_figures() {
    let workspace = mixed(0);
    fs::write(workspace.path("study.toml"), format!("{MIXED}[output]\nstatistics = [\"spin_rate\"]\n"))
        .expect("written");
    let output = workspace.polhode(&RUN);
    let (summary, warning) = (words(&output.stdout), words(&output.stderr));
    assert!(output.status.success(), "{warning}");
    let rest = ": there is nothing to compute, and the tables will have no rows\n";
    assert_eq!(warning, format!("warning: the table of bodies has no rows{rest}"));
    assert!(summary.contains("  work     0 bodies, 8 s: nothing to do\n"), "{summary}");
    assert!(!summary.contains("NaN") && !summary.contains("median"), "{summary}");
    assert_eq!(report(&workspace, "study.out")["accuracy"]["met"], serde_json::Value::Null);
    // Those who want no summary are warned all the same.
    let quiet = [&RUN[..], &["--quiet", "--force"]].concat();
    let warned = |warning: &str| {
        let output = workspace.polhode(&quiet);
        assert!(output.status.success() && output.stdout.is_empty());
        assert_eq!(words(&output.stderr), format!("warning: {warning}{rest}"));
    };
    warned("the table of bodies has no rows");
    let none = "[bodies]\ncount = 0\ninertia = [1, 2, 2.5]\nangular_velocity = [0, 0, 1]\n[time]\nend = 1.0\n";
    fs::write(workspace.path("study.toml"), none).expect("written");
    warned("bodies.count is 0");
}

#[test]
fn a_study_that_asks_for_no_results_is_told_so() {
    let workspace = mixed(20);
    fs::write(workspace.path("study.toml"), format!("{MIXED}[output]\nfinal = false\n")).expect("written");
    let output = workspace.polhode(&RUN);
    assert!(output.status.success());
    let note = words(&output.stderr);
    assert_eq!(note, "note: the study asks for no results: only plan.json and report.json are written\n");
    assert_eq!(workspace.names("study.out"), ["plan.json", "report.json"]);
}

#[test]
fn quantiles_that_look_like_fractions_are_pointed_out() {
    let workspace = mixed(20);
    let note = |quantiles: &str| {
        let text = format!("{MIXED}[output]\nstatistics = [\"spin_rate\"]\nquantiles = {quantiles}\n");
        fs::write(workspace.path("study.toml"), text).expect("written");
        let output = workspace.polhode(&[&RUN[..], &["--force"]].concat());
        assert!(output.status.success(), "{}", words(&output.stderr));
        words(&output.stderr)
    };
    let expected = "note: output.quantiles are percentages, all of them 1 or less here: the median is 50, not 0.5\n";
    assert_eq!(note("[0.05, 0.5, 0.95]"), expected);
    assert_eq!(note("[0.5, 50]") + &note("[1]"), "");
}

#[test]
fn a_target_out_of_reach_is_named_with_its_line_and_unit() {
    let workspace = mixed(20);
    let refused = |targets: &str| {
        fs::write(workspace.path("study.toml"), MIXED.replace("attitude = 1e-5\nenergy = 1e-4", targets))
            .expect("written");
        workspace.refused(&RUN, 2)
    };
    let line = refused("attitude = 1e-17");
    let start =
        "error: study.toml:10: accuracy.attitude = 1e-17: out of reach: attitude 1e-17 rad, in 95 % of the bodies: ";
    assert!(line.starts_with(start), "{line}");
    assert!(line.contains(" misses the attitude by a factor of "), "{line}");
    let line = refused("attitude = 1e-3\nenergy = 1e-18");
    assert!(line.starts_with("error: study.toml:11: accuracy.energy = 1e-18: out of reach: "), "{line}");
    assert!(line.contains(" misses the energy by a factor of ") && line.contains("rounding in f64"), "{line}");
    // What nobody wrote is missed all the same, and what is written is innocent.
    let chaos = MIXED.replace("end = 8.0", "end = 800.0").replace("attitude = 1e-5\nenergy = 1e-4", "energy = 0.1")
        + "[[torque]]\nmodel = \"heavy-top\"\nmass = 3.0\ncentre = [0.3, 0.2, 0.5]\ngravity = [0, 0, -9.81]\n";
    fs::write(workspace.path("study.toml"), chaos).expect("written");
    let line = workspace.refused(&RUN, 2);
    assert!(line.starts_with("error: study.toml:9: accuracy.attitude = 1e-6 (where nothing is said): "), "{line}");
    assert!(line.contains("the motion amplifies every error"), "{line}");
}

#[test]
fn a_plan_of_the_long_way_says_how_it_is_repeated() {
    let workspace = mixed(20);
    let run = |more: &[&'static str]| [&RUN[..], &["--quiet"], more].concat();
    workspace.done(&run(&["--no-skip", "--out", "long"]));
    let line = workspace.refused(&run(&["--plan", "long/plan.json", "--out", "again"]), 2);
    assert!(line.contains("skipping is forbidden") && line.contains("repeat it with --no-skip"), "{line}");
    workspace.done(&run(&["--plan", "long/plan.json", "--no-skip", "--out", "again"]));
    workspace.done(&run(&["--out", "short"]));
    let line = workspace.refused(&run(&["--plan", "short/plan.json", "--no-skip", "--out", "third"]), 2);
    assert!(line.contains("skipping is allowed") && line.contains("repeat it without --no-skip"), "{line}");
    let bytes = |folder: &str| fs::read(workspace.path(folder).join("final.csv")).expect("written");
    assert!(bytes("long") == bytes("again"));
}

/// Hyperion tumbles: after some orbits the sample has parted from the run, and the work along its path says nothing of the run's.
#[test]
fn the_balance_is_not_known_where_paths_have_parted() {
    let study = |end: f64| {
        format!(
            "[bodies]\ncount = 20\ninertia = [1.0, 1.9, 2.2]\nangular_velocity = [0, 0, 4e-6]\n\
             orientation = {{ distribution = \"uniform\" }}\n\
             [[torque]]\nmodel = \"gravity-gradient\"\n\
             mu = 3.7931e16\norbit = {{ semi_major_axis = 1.481e9, eccentricity = 0.123 }}\n\
             [time]\nend = {end:e}\n[accuracy]\nmethod = \"rk8\"\ntolerance = 1e-5\n"
        )
    };
    for (end, has_parted) in [(1e6, false), (3e8, true)] {
        let workspace = Workspace::new(&study(end));
        let summary = workspace.done(&RUN);
        assert_eq!(report(&workspace, "study.out")["balance"]["parted"], has_parted, "{summary}");
        assert_eq!(summary.contains("  balance  not known: the torques' work"), has_parted, "{summary}");
        assert_eq!(summary.contains("  balance  kinetic energy   median"), !has_parted, "{summary}");
    }
}
