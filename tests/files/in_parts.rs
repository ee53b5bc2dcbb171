//! Studies whose results do not depend on the parts in which they are run, and how they are run so.

#![cfg(feature = "cli")]

use std::collections::BTreeMap;
use std::fs;
use std::process::{Command, Output};

use assert_cmd::cargo::cargo_bin;

use crate::workspace::{Workspace, words};

/// Equal steps under noise, centres of mass that are stepped, bodies that fail, and a table of arrays.
pub const PINNED: &str = r#"
seed = 11
[bodies]
count = 333
inertia = [1.0, 1.7, 2.2]
mass = 2.0
velocity = { distribution = "normal", mean = 0.0, sigma = 1.0 }
angular_velocity = { distribution = "log-normal", median = 0.4, sigma = 1.2 }
[[torque]]
model = "white-noise"
intensity = 0.02
[[force]]
model = "quadratic-drag"
coefficient = 0.3
[time]
end = 2.0
outputs = { every = 0.5 }
[accuracy]
method = "splitting4"
dt = 0.125
[output]
snapshots = true
statistics = ["spin_rate"]
format = "npz"
[failures]
allow = 333
"#;

/// Nothing but statistics, of free bodies and of driven ones in steps of their own.
pub const STATISTICS: &str = r#"
[bodies]
count = 900
inertia = { moments = [1.0, 1.7, 2.2], scatter = 0.2 }
angular_velocity = { distribution = "normal", mean = 0.0, sigma = 1.5 }
[[torque]]
model = "linear-drag"
coefficient = { distribution = "uniform", low = 0.01, high = 0.1 }
[[torque]]
model = "constant-body"
torque = [0.1, 0.0, 0.0]
[time]
end = 2.0
outputs = { every = 0.5 }
[accuracy]
method = "rk8"
tolerance = 1e-8
[output]
final = false
statistics = ["kinetic_energy", "angular_momentum"]
"#;

/// All that is formed of the states: derived quantities, quantiles, histograms, events, by cell of a sweep; a column of text that is carried through,
/// bodies that fail.
pub const OBSERVED: &str = r#"
title = "All that is asked of states"
seed = 3
[bodies]
count = 250
inertia = { moments = [1.0, 1.7, 2.2], scatter = 0.2 }
orientation = { distribution = "uniform" }
angular_velocity = { distribution = "log-normal", median = 1.5, sigma = 0.7 }
[[sweep]]
name = "drag"
values = [0.05, 0.2, 0.6]
[[torque]]
model = "linear-drag"
coefficient = { sweep = "drag" }
[[torque]]
model = "constant-body"
torque = { distribution = "normal", mean = 0.0, sigma = 0.05 }
[time]
end = 4.0
outputs = { every = 1.0 }
[accuracy]
method = "rk8"
tolerance = 1e-8
least_step = 0.1
[[quantity]]
name = "tilt"
axis = [0, 0, 1]
direction = [1, 0, 0]
[[histogram]]
quantity = "spin_rate"
low = 0.1
high = 10.0
bins = 20
scale = "log"
[[histogram]]
quantity = "tilt"
low = "0 deg"
high = "180 deg"
[[event]]
name = "slow"
quantity = "spin_rate"
falls_below = 1.0
[[event]]
name = "upright"
quantity = "tilt"
below = "20 deg"
[output]
initial = true
columns = ["qx", "qy", "qz", "qw", "tilt"]
statistics = ["kinetic_energy", "tilt", "nutation"]
quantiles = [5, 50, 95]
[failures]
allow = 700
"#;

/// The tables of such a run.
pub const OBSERVED_TABLES: [&str; 11] = [
    "cells",
    "events",
    "failed",
    "final",
    "histograms",
    "histograms_by_cell",
    "initial",
    "statistics",
    "statistics_by_cell",
    "survival",
    "times",
];

/// The files of such a run with tables in a format, without its report.
pub fn observed_names(format: &str) -> Vec<String> {
    let mut names: Vec<String> = OBSERVED_TABLES.iter().map(|stem| format!("{stem}.{format}")).collect();
    names.push("plan.json".to_owned());
    names.sort();
    names
}

fn command(workspace: &Workspace, threads: usize, arguments: &[&str]) -> Output {
    Command::new(cargo_bin!("polhode"))
        .current_dir(workspace.folder())
        .env("RAYON_NUM_THREADS", threads.to_string())
        .args(arguments)
        .output()
        .expect("the command starts")
}

pub fn done(workspace: &Workspace, threads: usize, arguments: &[&str]) {
    let output = command(workspace, threads, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", words(&output.stderr));
}

/// All files but the report, by name.
pub fn tables(workspace: &Workspace, folder: &str) -> BTreeMap<String, Vec<u8>> {
    let names = workspace.names(folder).into_iter().filter(|name| name != "report.json");
    names.map(|name| (name.clone(), fs::read(workspace.path(folder).join(name)).expect("a file"))).collect()
}

/// Runs a study again in pieces, one after each share of the run, and in three parts by a plan, which are merged: both leave the tables of
/// `whole` to the byte. Gives both folders.
pub fn leave_the_bytes_of(whole: &BTreeMap<String, Vec<u8>>, workspace: &Workspace, share: &str) -> [&'static str; 2] {
    let pieces = ["run", "study.toml", "--out", "pieces", "--checkpoint", share, "--quiet", "--engine", "cpu"];
    done(workspace, 1, &pieces);
    workspace.done(&["plan", "study.toml", "--out", "plan.json", "--quiet", "--engine", "cpu"]);
    for shard in ["1/3", "2/3", "3/3"] {
        let run = ["run", "study.toml", "--plan", "plan.json", "--shard", shard, "--out", "parts", "--quiet"];
        done(workspace, 2, &[&run[..], &["--engine", "cpu"]].concat());
    }
    done(workspace, 2, &["merge", "parts", "--out", "merged", "--quiet"]);
    let folders = ["pieces", "merged"];
    for folder in folders {
        let found = tables(workspace, folder);
        assert_eq!(found.keys().collect::<Vec<_>>(), whole.keys().collect::<Vec<_>>(), "{folder}");
        for (name, bytes) in whole {
            assert!(found[name] == *bytes, "{folder}: {name} differs");
        }
    }
    folders
}
