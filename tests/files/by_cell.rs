//! Statistics and histograms of the bodies of each cell of a sweep.

#![cfg(feature = "cli")]

use std::path::Path;

use glam::{DQuat, DVec3};
use polhode::record::{QUANTILE_ERROR, Table};
use polhode::run::Run;
use polhode::study::Study;
use polhode::{Engine, Ensemble, Error, Outputs, Plan, Quantity, Scene};

use crate::in_parts::OBSERVED;
use crate::workspace::{States, Workspace};

/// Three cells of 250 bodies each, some of which fail.
fn observed(format: &str) -> String {
    let study = OBSERVED.replace("columns = [\"qx\", \"qy\", \"qz\", \"qw\", \"tilt\"]\n", "snapshots = true\n");
    let study = study.replace("\"kinetic_energy\", \"tilt\"", "\"spin_rate\", \"tilt\"");
    study.replace("[output]", &format!("[output]\nformat = \"{format}\""))
}

fn read(workspace: &Workspace, name: &str) -> Table {
    polhode::record::read(&workspace.path("study.out").join(name)).expect("a table")
}

fn column(table: &Table, name: &str) -> Vec<f64> {
    table.numbers(name).unwrap_or_else(|| panic!("no column {name}")).into_owned()
}

#[test]
fn they_are_those_of_its_bodies() {
    let workspace = Workspace::new(&observed("csv"));
    let explained = workspace.done(&["explain", "study.toml", "--engine", "cpu"]);
    let formed =
        "formed at each: 3 quantities' statistics, 2 histograms, 2 events, of each of 3 cells too, from all states";
    assert!(explained.contains(formed), "{explained}");
    let summary = workspace.polhode(&["run", "study.toml", "--engine", "cpu"]);
    let summary = String::from_utf8(summary.stdout).expect("text");
    assert!(summary.contains("\n  cells    3, with statistics of each\n"), "{summary}");
    let states = States::read(&workspace.path("study.out/snapshots.csv"));
    let (statistics, counts) = (read(&workspace, "statistics_by_cell.csv"), read(&workspace, "histograms_by_cell.csv"));
    let [times, cells] = ["t", "cell"].map(|name| column(&statistics, name));
    assert_eq!(times.len(), 4 * 3);
    let (mut failed, mut counted) = (0, 0.0);
    for row in 0..times.len() {
        let is_own = |&of: &usize| {
            states.column("t")[of] == times[row]
                && states.column("cell")[of] == cells[row]
                && states.column("status")[of] == 0.0
        };
        let own: Vec<usize> = (0..states.rows()).filter(is_own).collect();
        let mut spins: Vec<(f64, f64)> =
            own.iter().map(|&of| (states.vector(["wx", "wy", "wz"], of).length(), states.column("body")[of])).collect();
        spins.sort_by(|a, b| a.0.total_cmp(&b.0));
        failed += 250 - own.len();
        let of = |name: &str| column(&statistics, name)[row];
        let mean = spins.iter().map(|spin| spin.0).sum::<f64>() / spins.len() as f64;
        let squares = spins.iter().map(|spin| (spin.0 - mean).powi(2)).sum::<f64>();
        let near = |found: f64, expected: f64, error: f64| {
            assert!((found - expected).abs() <= error * expected, "row {row}: {found}, {expected}");
        };
        assert_eq!(of("count"), own.len() as f64);
        near(of("spin_rate_mean"), mean, 1e-13);
        near(of("spin_rate_standard_deviation"), (squares / spins.len() as f64).sqrt(), 1e-13);
        let (least, greatest) = (spins[0], spins[spins.len() - 1]);
        near(of("spin_rate_min"), least.0, 1e-15);
        near(of("spin_rate_max"), greatest.0, 1e-15);
        assert_eq!((of("spin_rate_min_body"), of("spin_rate_max_body")), (least.1, greatest.1));
        for percent in [5, 50, 95] {
            let rank = (percent * spins.len()).div_ceil(100);
            near(of(&format!("spin_rate_q{percent}")), spins[rank - 1].0, QUANTILE_ERROR + 1e-15);
        }
        // The bins of the first histogram.
        let bins = ["t", "cell", "histogram", "low", "high", "count"].map(|name| column(&counts, name));
        let [t, cell, histogram, low, high, count] = &bins;
        let of_cell = |&bin: &usize| t[bin] == times[row] && cell[bin] == cells[row] && histogram[bin] == 0.0;
        let own_bins: Vec<usize> = (0..t.len()).filter(of_cell).collect();
        assert_eq!(own_bins.len(), 22);
        for bin in own_bins {
            let within = |spin: &&(f64, f64)| (low[bin]..high[bin]).contains(&spin.0);
            assert_eq!(count[bin], spins.iter().filter(within).count() as f64, "row {row}, bin {bin}");
            counted += count[bin];
        }
    }
    assert!(failed > 0 && counted + failed as f64 == 4.0 * 750.0, "{failed} failed, {counted} counted");

    for format in ["npz", "parquet"] {
        let other = Workspace::new(&observed(format));
        other.polhode(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
        for (stem, table) in [("statistics_by_cell", &statistics), ("histograms_by_cell", &counts)] {
            let found = read(&other, &format!("{stem}.{format}"));
            assert_eq!(found.names().collect::<Vec<_>>(), table.names().collect::<Vec<_>>());
            for name in table.names().filter(|name| *name != "quantity") {
                let bits = |table: &Table| column(table, name).iter().map(|x| x.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(&found), bits(table), "{stem}.{format}: {name}");
            }
        }
    }
}

#[test]
fn they_are_left_out_on_request_and_of_many_cells() {
    let names = |text: &str| {
        let workspace = Workspace::new(text);
        workspace.polhode(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
        let names = workspace.names("study.out");
        assert!(names.iter().any(|name| name == "statistics.csv"), "{names:?}");
        names.into_iter().filter(|name| name.contains("by_cell")).collect::<Vec<_>>()
    };
    assert_eq!(names(&observed("csv")), ["histograms_by_cell.csv", "statistics_by_cell.csv"]);
    assert_eq!(names(&observed("csv").replace("[output]", "[output]\nby_cell = false")), [""; 0]);
    let swept = |count: usize, by_cell: &str| {
        format!(
            "[bodies]\ncount = 1\ninertia = [1, 2, 3]\nangular_velocity = [{{ sweep = \"spin\" }}, 0.1, 0]\n\
             [[sweep]]\nname = \"spin\"\nfrom = 0.0\nto = 1.0\ncount = {count}\n[time]\nend = 1.0\n\
             [output]\nfinal = false\nstatistics = [\"spin_rate\"]\n{by_cell}"
        )
    };
    assert_eq!(names(&swept(4096, "")), ["statistics_by_cell.csv"]);
    assert_eq!(names(&swept(4097, "")), [""; 0]);
    let summary = Workspace::new(&swept(4097, "")).done(&["run", "study.toml", "--engine", "cpu"]);
    assert!(summary.contains("\n  cells    4097, too many for statistics of each\n"), "{summary}");
    let refused = |text: &str| Study::parse(Path::new("study.toml"), text).expect_err("refused").to_string();
    assert_eq!(
        refused(&swept(4097, "by_cell = true")),
        "study.toml:15: output.by_cell = true: expected at most 4096 cells, not 4097"
    );
    let plain = swept(2, "by_cell = true");
    assert_eq!(
        refused(&plain.replace("statistics = [\"spin_rate\"]\n", "")),
        "study.toml:14: output.by_cell = true: expected output.statistics or a [[histogram]] too: they are formed by cell"
    );
    let sweep = plain.find("[[sweep]]").expect("there")..plain.find("[time]").expect("there");
    let single = plain.replace(&plain[sweep], "").replace("{ sweep = \"spin\" }", "0.5");
    assert_eq!(
        refused(&single),
        "study.toml:10: output.by_cell = true: expected axes too: tables [[sweep]], which make cells"
    );
}

/// In a library's scene any number of cells can be asked for; a body's cell follows from its index in the whole.
#[test]
fn cells_of_a_scene_and_of_its_parts() {
    let body = |body: usize| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::new(body as f64, 0.0, 0.0));
    let scene = || Scene::new(Ensemble::from_fn(10, body).expect("bodies")).until(2.0).outputs(Outputs::Every(1.0));
    for cells in [0, 4097] {
        let error = scene().by_cell(cells).expect_err("refused");
        assert!(matches!(error, Error::Setting { field: "output.by_cell", .. }), "{error}");
    }
    let asked = scene().statistics([Quantity::SpinRate]).by_cell(3).expect("three");
    let engine = Engine::cpu();
    let run = |scene: &Scene| engine.run(&Plan::new(scene, &engine).expect("a plan")).expect("a run");
    // Spins about a principal axis, which last.
    let of = |scene: &Scene, number: &dyn Fn(usize) -> usize| {
        let record = run(scene);
        assert_eq!(record.by_cell().len(), 2);
        let cells = |cells: &Vec<polhode::record::OfCell>| {
            let of_cell = |cell: &polhode::record::OfCell| {
                let spin = cell.statistics.of(Quantity::SpinRate).expect("asked for");
                (cell.statistics.count, spin.mean, spin.min_body.map(number), spin.max_body.map(number))
            };
            cells.iter().map(of_cell).collect::<Vec<_>>()
        };
        assert_eq!(cells(&record.by_cell()[0]), cells(&record.by_cell()[1]));
        cells(&record.by_cell()[1])
    };
    let expected = vec![(4, 4.5, Some(0), Some(9)), (3, 4.0, Some(1), Some(7)), (3, 5.0, Some(2), Some(8))];
    assert_eq!(of(&asked, &|body| body), expected);
    let part = asked.only(4..8);
    let expected = vec![(1, 6.0, Some(6), Some(6)), (2, 5.5, Some(4), Some(7)), (1, 5.0, Some(5), Some(5))];
    assert_eq!(of(&part, &|body| 4 + body), expected);
    let plan = Plan::new(&asked, &engine).expect("a plan");
    let outputs: Vec<_> = Run::start(&engine, &plan).expect("begun").collect();
    assert!(outputs.into_iter().all(|output| output.expect("an output").by_cell.len() == 3));
}
