//! Every key of the JSON that the command writes stands in `docs/outputs.md`, and what stands there is written: by studies of all kinds.

#![cfg(feature = "cli")]

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::control;
use crate::in_parts::{OBSERVED, PINNED};
use crate::workspace::{Workspace, report};

/// Keys that only a fault of a device brings.
const OF_A_FAULT: &str = "the-report-of-a-run: fallback";

/// Free bodies, one of them with a tensor that is repaired.
const FREE: &str = "[bodies]\nfile = \"bodies.csv\"\nrepair_triangle_inequality = 0.1\n[time]\nend = 10.0\n";
const BODIES: &str = "ixx,iyy,izz,wx,wy,wz\n1,2,2.5,0.1,1,0.1\n1,2,3.03,0.1,1,0.1\n1,1,1,0,0,1\n";

/// A torque with a potential, under an error so small that bodies choose their steps.
const CHOSEN: &str = r#"
[bodies]
count = 700
inertia = { moments = [1.0, 1.7, 2.2], scatter = 0.2 }
angular_velocity = { distribution = "normal", mean = 0.0, sigma = 1.5 }
[[torque]]
model = "heavy-top"
mass = 0.05
centre = [0.0, 0.1, 0.3]
gravity = [0.0, 0.0, -9.81]
[time]
end = 4.0
[accuracy]
attitude = 1e-9
"#;

/// Adaptive steps that the study asks for.
const DRIVEN: &str = r#"
[bodies]
count = 900
inertia = [1.0, 1.7, 2.2]
angular_velocity = { distribution = "normal", mean = 0.0, sigma = 1.5 }
[[torque]]
model = "linear-drag"
coefficient = 0.05
[time]
end = 2.0
[accuracy]
method = "rk8"
tolerance = 1e-8
"#;

/// A random torque, which only equal steps follow.
const EQUAL: &str = r#"
[bodies]
count = 20
inertia = [1.0, 1.7, 2.2]
angular_velocity = [0.2, 1.0, 0.1]
[[torque]]
model = "white-noise"
intensity = 1e-4
[time]
end = 2.0
[accuracy]
attitude = 1e-2
"#;

/// Series of which outputs are closer together than steps.
const DENSE: &str = r#"
[bodies]
count = 20
inertia = [1.0, 1.7, 2.2]
angular_velocity = [0.2, 1.0, 0.1]
[[torque]]
model = "linear-drag"
coefficient = 0.05
[time]
end = 2.0
outputs = { every = 0.02 }
[accuracy]
method = "taylor"
tolerance = 1e-8
"#;

/// A torque that depends on the place, and has a pulse.
const COUPLED: &str = r#"
[bodies]
count = 30
inertia = [1.0, 1.7, 2.2]
mass = 2.0
position = [1.0, 0.0, 0.0]
velocity = [0.0, 0.1, 0.0]
angular_velocity = { distribution = "normal", mean = 0.0, sigma = 1.0 }
[[torque]]
model = "custom"
torque = "0.02 * to_body(position) + 0.01 * exp(-((time - 2.3) / 1e-2)^2) * vec(0, 0, 1)"
[[force]]
model = "quadratic-drag"
coefficient = 0.3
[time]
end = 4.0
[accuracy]
attitude = 1e-5
"#;

/// A formula that becomes NaN.
const FAILING: &str = r#"
[bodies]
count = 20
inertia = [1.0, 1.7, 2.2]
angular_velocity = { distribution = "uniform", low = 0.1, high = 2.0 }
[[torque]]
model = "custom"
torque = "0.01 * ln(1.5 - 0.2 * time - angular_velocity.z) * vec(1, 0, 0)"
[time]
end = 5.0
[accuracy]
method = "rk4"
dt = 0.01
[failures]
allow = 20
"#;

/// So many bodies that their quantiles are formed from counts.
const COUNTED: &str = r#"
[bodies]
count = 2_100
inertia = [1.0, 1.7, 2.2]
angular_velocity = { distribution = "uniform", low = 1.0, high = 2.0 }
[time]
end = 1.0
[output]
final = false
statistics = ["spin_rate"]
quantiles = [50]
"#;

/// So many bodies that the plan is made from some of them.
const MANY: &str =
    "[bodies]\ncount = 1_100_000\ninertia = [1, 1, 1]\nangular_velocity = [0, 0, 1]\n[time]\nend = 1.0\n";

/// [`OBSERVED`] with errors of statistics, a quantity that not all bodies have, checks, and an event that stops bodies.
fn observed() -> String {
    let mut text = OBSERVED.to_owned();
    for (old, new) in [
        ("method = \"rk8\"\ntolerance = 1e-8\nleast_step = 0.1\n", "mean = 1e-3\nquantile = 1e-2\nevent_time = 1e-3\n"),
        ("end = 4.0\n", "end = 4.0\nchecks = { every = 0.5 }\n"),
        ("falls_below = 1.0\n", "falls_below = 1.0\naction = \"stop\"\n"),
        (
            "[[event]]\nname = \"up",
            "[[quantity]]\nname = \"root\"\nformula = \"sqrt(angular_velocity.x)\"\n[[event]]\nname = \"up",
        ),
        ("\"nutation\"]", "\"nutation\", \"root\"]"),
    ] {
        assert_eq!(text.matches(old).count(), 1, "{old}");
        text = text.replace(old, new);
    }
    text
}

/// A key on the page.
struct Row {
    section: String,
    /// The keys that lead to it.
    path: Vec<String>,
    /// The section that has the keys of its value.
    link: Option<String>,
    may_be_absent: bool,
    may_be_null: bool,
}

impl Row {
    fn is_at(&self, section: &str, path: &[String]) -> bool {
        let is_key = |(own, key): (&String, &String)| own == key || own.starts_with('<');
        self.section == section && self.path.len() == path.len() && self.path.iter().zip(path).all(is_key)
    }

    fn name(&self) -> String {
        format!("{}: {}", self.section, self.path.join("."))
    }
}

/// The rows of the page's tables.
fn rows() -> Vec<Row> {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/outputs.md");
    let (mut rows, mut section) = (Vec::new(), String::new());
    for line in fs::read_to_string(page).expect("the page").lines() {
        if let Some(title) = line.strip_prefix("##") {
            section = title.trim_matches(['#', ' ']).to_lowercase().replace(' ', "-");
        }
        if !line.starts_with("| `") {
            continue;
        }
        let line = line.replace("\\|", "");
        let [_, keys, meaning, _, lacks, _] = line.split('|').map(str::trim).collect::<Vec<_>>()[..] else {
            panic!("four columns: {line}")
        };
        let link = meaning.strip_prefix('[').and_then(|rest| rest.split_once("](#")?.1.split_once(')'));
        let mut before = String::new();
        for key in keys.split('`').skip(1).step_by(2) {
            if key.starts_with('.') {
                before.truncate(before.rfind('.').expect("a key above it"));
                before += key;
            } else {
                before = key.to_owned();
            }
            rows.push(Row {
                section: section.clone(),
                path: before.split('.').map(|key| key.trim_end_matches("[]").to_owned()).collect(),
                link: link.map(|(link, _)| link.to_owned()),
                may_be_absent: lacks.contains("absent"),
                may_be_null: lacks.contains("`null`"),
            });
        }
    }
    rows
}

/// What was found in JSON, compared with the page.
struct Found {
    rows: Vec<Row>,
    seen: BTreeSet<String>,
    faults: BTreeSet<String>,
}

impl Found {
    /// Compares a value at a path of a section, and all in it.
    fn compare(&mut self, value: &Value, section: &str, path: &[String]) {
        if let Some(entries) = value.as_array() {
            entries.iter().for_each(|entry| self.compare(entry, section, path));
        }
        let Some(object) = value.as_object() else { return };
        let is_missing = |row: &&Row| match row.path.split_last() {
            Some((key, above)) => {
                row.section == section && above == path && !key.starts_with('<') && !object.contains_key(key)
            }
            None => false,
        };
        let missing = self.rows.iter().filter(is_missing).filter(|row| !row.may_be_absent);
        self.faults.extend(missing.map(|row| format!("{} is absent", row.name())));
        for (key, value) in object {
            let path = [path, std::slice::from_ref(key)].concat();
            let Some(row) = self.rows.iter().find(|row| row.is_at(section, &path)) else {
                // Of some objects only the keys stand on the page.
                let is_above =
                    |row: &Row| row.section == section && row.path.len() > path.len() && row.path.starts_with(&path);
                match self.rows.iter().any(is_above) {
                    true => self.compare(value, section, &path),
                    false => _ = self.faults.insert(format!("{section}: {} is not on the page", path.join("."))),
                }
                continue;
            };
            self.seen.insert(row.name());
            if value.is_null() && !row.may_be_null {
                self.faults.insert(format!("{} is null", row.name()));
            }
            match row.link.clone() {
                Some(link) => self.compare(value, &link, &[]),
                None => self.compare(value, section, &path),
            }
        }
    }
}

fn parsed(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON")
}

#[test]
fn every_key_of_the_json_is_on_its_page_and_every_key_of_the_page_is_written() {
    let mut found = Found { rows: rows(), seen: BTreeSet::new(), faults: BTreeSet::new() };
    let (observed, workspace) = (observed(), Workspace::new(""));
    fs::write(workspace.path("bodies.csv"), BODIES).expect("written");
    for study in [FREE, CHOSEN, DRIVEN, EQUAL, DENSE, COUPLED, FAILING, PINNED, COUNTED, control::STUDY, &observed] {
        fs::write(workspace.path("study.toml"), study).expect("written");
        let run = workspace.polhode(&["run", "study.toml", "--engine", "cpu", "--quiet", "--force"]);
        assert!(run.status.success(), "{study}");
        found.compare(&report(&workspace, "study.out"), "the-report-of-a-run", &[]);
        let plan = fs::read_to_string(workspace.path("study.out/plan.json")).expect("a plan");
        found.compare(&parsed(&plan), "the-plan", &[]);
        let explained = workspace.done(&["explain", "study.toml", "--engine", "cpu", "--json"]);
        found.compare(&parsed(&explained), "what-explain-prints", &[]);
    }
    for (study, engine) in [(MANY, "cpu"), (DRIVEN, "gpu")] {
        fs::write(workspace.path("study.toml"), study).expect("written");
        let explained = workspace.polhode(&["explain", "study.toml", "--engine", engine, "--json"]);
        found.compare(&parsed(&String::from_utf8_lossy(&explained.stdout)), "what-explain-prints", &[]);
    }
    fs::write(workspace.path("study.toml"), &observed).expect("written");
    workspace.done(&["plan", "study.toml", "--out", "plan.json", "--engine", "cpu", "--quiet"]);
    for shard in ["1/2", "2/2"] {
        let run = ["run", "study.toml", "--plan", "plan.json", "--shard", shard, "--out", "parts", "--quiet"];
        workspace.done(&[&run[..], &["--engine", "cpu"]].concat());
    }
    found.compare(&parsed(&workspace.done(&["status", "parts", "--json"])), "what-status-prints", &[]);
    let merged = workspace.done(&["merge", "parts", "--out", "merged", "--quiet", "--json"]);
    found.compare(&parsed(&merged), "the-report-of-merged-parts", &[]);
    assert!(found.faults.is_empty(), "{:#?}", found.faults);
    let names = found.rows.iter().map(Row::name).filter(|name| !name.starts_with(OF_A_FAULT));
    let unseen: Vec<String> = names.filter(|name| !found.seen.contains(name)).collect();
    assert!(unseen.is_empty(), "no study has these: {unseen:#?}");
}
