//! Benchmarks: rows that parse and only grow, errors that are the same every time, failed rows that never win.
#![cfg(feature = "bench")]

use std::ops::ControlFlow;
use std::path::Path;

use polhode::bench::compare::compare;
use polhode::bench::provenance::Provenance;
use polhode::bench::row::{self, Row, Table};
use polhode::bench::{Bench, Swept, accuracy, front, kernels, skipping, throughput};
use polhode::engine::Engine;
use polhode::engine::gpu::GpuOptions;
use polhode::plan::{Costs, Scheme, Treatment};
use polhode::{Accuracy, Method, Plan, Precision, Scene};

/// A quick benchmark of the CPU engine.
fn bench(filter: &str) -> Bench {
    Bench {
        quick: true,
        filter: Some(filter.to_owned()),
        resume: false,
        engines: vec![Engine::cpu()],
        provenance: Provenance::collect("polhode bench"),
    }
}

fn swept(bench: &Bench, folder: &Path) -> Swept {
    accuracy::run(bench, folder, &mut |_| ControlFlow::Continue(())).expect("measured")
}

/// The columns that no clock and no other process enters.
fn errors(row: &Row) -> Vec<String> {
    let names = row.names().filter(|name| {
        ["attitude", "energy", "momentum"].iter().any(|start| name.starts_with(start))
            || ["case", "failed_bodies", "valid", "fault", "steps_mean"].contains(name)
    });
    names.map(|name| row.text(name)).collect()
}

#[test]
fn errors_are_the_same_to_the_last_digit_and_rows_are_appended() {
    let folder = tempfile::tempdir().expect("a folder");
    let bench = bench("forced/cpu/rk4/f32");
    let first = swept(&bench, folder.path());
    let again = swept(&bench, folder.path());
    assert_eq!(first.rows.len(), 4);
    let of = |swept: &Swept| swept.rows.iter().map(errors).collect::<Vec<_>>();
    assert_eq!(of(&first), of(&again));
    assert!(first.rows.iter().any(|row| row.number("attitude_rad_p99") > 1e-3), "an error of zero would prove nothing");

    // Both runs stand in the files, in order, and read back as they were.
    let rows = row::rows(folder.path(), accuracy::TABLE).expect("a table");
    let expected: Vec<&Row> = first.rows.iter().chain(&again.rows).collect();
    assert_eq!(rows.len(), expected.len());
    for (row, expected) in rows.iter().zip(expected) {
        assert!(row.names().eq(expected.names()));
        for name in row.names() {
            assert_eq!(row.text(name), expected.text(name), "{name}");
        }
        assert_eq!(row.number("attitude_rad_max").to_bits(), expected.number("attitude_rad_max").to_bits());
    }
    let json = std::fs::read_to_string(folder.path().join("accuracy.json")).expect("a file");
    let lines: Vec<serde_json::Value> =
        json.lines().map(|line| serde_json::from_str(line).expect("one value a line")).collect();
    assert_eq!(lines.len(), rows.len());
    for (line, row) in lines.iter().zip(&rows) {
        assert_eq!(line["case"], row.text("case"));
        assert_eq!(line["attitude_rad_p99"].as_f64().expect("a number"), row.number("attitude_rad_p99"));
        assert_eq!(line["valid"], row.flag("valid"));
    }
    for column in ["date", "commit", "dirty", "compiler", "cpu", "engine", "adapter", "command", "profile"] {
        assert!(!rows[0].text(column).is_empty(), "{column}");
    }
}

#[test]
fn rk4_errs_as_its_order_says() {
    let folder = tempfile::tempdir().expect("a folder");
    let rows = swept(&bench("free/cpu/rk4/f64"), folder.path()).rows;
    let error = |steps: f64| {
        let row = rows.iter().find(|row| row.number("steps_mean") == steps).expect("a row");
        row.number("attitude_rad_median")
    };
    // 334 to 1000 steps: (1000/334)^4 = 80.4, and the slower bodies are in the asymptotic range by then.
    let ratio = error(334.0) / error(1000.0);
    assert!((70.0..90.0).contains(&ratio), "{ratio}");
}

#[test]
fn a_failed_row_is_marked_and_never_wins() {
    let folder = tempfile::tempdir().expect("a folder");
    let rows = swept(&bench("free/cpu/explicit_euler"), folder.path()).rows;
    let failed: Vec<&Row> = rows.iter().filter(|row| !row.flag("valid")).collect();
    assert!(!failed.is_empty(), "an explicit Euler step of half a second cannot pass");
    for row in &failed {
        assert!(!row.text("fault").is_empty());
        let mut point = accuracy::point(row);
        // Even where it would be the fastest and the most accurate of all.
        point.seconds = 1e-12;
        point.error = 1e-30;
        let other = front::Point { seconds: 1.0, error: 1e-3, valid: true };
        assert_eq!(front::pareto(&[point, other]), [1]);
    }
    assert!(!accuracy::summary(&rows).contains("| 20 |"), "{}", accuracy::summary(&rows));
}

#[test]
fn what_is_there_already_is_left_out_on_request() {
    let folder = tempfile::tempdir().expect("a folder");
    let once = bench("drag/cpu/rk8/f64/1");
    assert_eq!(swept(&once, folder.path()).rows.len(), 2);
    let again = Bench { resume: true, filter: Some("drag/cpu/rk8/f64".to_owned()), ..once };
    let swept = swept(&again, folder.path());
    assert_eq!((swept.rows.len(), swept.left_out), (2, 2));
}

#[test]
fn a_stop_leaves_the_rows_so_far() {
    let folder = tempfile::tempdir().expect("a folder");
    let swept = accuracy::run(&bench("drag/cpu/rk4/f64"), folder.path(), &mut |step| {
        if step.done < 1 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    let swept = swept.expect("measured");
    assert_eq!((swept.rows.len(), swept.left_out), (1, 3));
    assert_eq!(row::rows(folder.path(), accuracy::TABLE).expect("a table").len(), 1);
}

#[test]
fn rows_of_other_columns_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut table = Table::open(folder.path(), "some").expect("a table");
    table.append(&Row::new().with("a", 1.5).with("b", "x,\"y")).expect("appended");
    let mut table = Table::open(folder.path(), "some").expect("a table");
    let refusal = table.append(&Row::new().with("a", 1.5)).expect_err("refused").to_string();
    assert!(refusal.contains("some.csv: its columns are not those of this version"), "{refusal}");
    assert_eq!(table.rows().expect("rows")[0].text("b"), "x,\"y");
}

#[test]
fn throughput_rows_carry_phases_and_the_ceilings_of_the_machine() {
    let folder = tempfile::tempdir().expect("a folder");
    for filter in ["bodies/cpu/f64/1000", "cores/cpu/f32", "outputs/cpu/f64/4"] {
        let swept = throughput::run(&bench(filter), folder.path(), &mut |_| ControlFlow::Continue(()));
        assert!(!swept.expect("measured").rows.is_empty(), "{filter}");
    }
    let rows = row::rows(folder.path(), throughput::TABLE).expect("a table");
    for row in &rows {
        assert!(row.flag("valid"), "{}", row.text("fault"));
        let part = row.number("part_of_flops");
        assert!(part > 0.0 && part.is_finite(), "{}: {part} of the ceiling", row.text("case"));
        assert!(row.number("ceiling_bytes_per_second") > 1e8);
    }
    let written = rows.iter().find(|row| row.text("axis") == "outputs").expect("a row");
    assert!(written.number("write_seconds") > 0.0 && written.number("read_seconds") > 0.0);
    let names: Vec<_> =
        std::fs::read_dir(folder.path()).expect("a folder").map(|entry| entry.expect("a file")).collect();
    assert_eq!(names.len(), 2, "what was written to be timed is gone: {names:?}");
}

#[test]
fn rows_of_kernels_carry_the_error_beside_the_speed_and_what_a_device_moves() {
    let folder = tempfile::tempdir().expect("a folder");
    let gpu = Engine::gpu(GpuOptions { software: true, ..GpuOptions::default() }).expect("tests need a Vulkan driver");
    let all = Bench { engines: vec![Engine::cpu(), gpu], ..bench("") };
    let mut rows = Vec::new();
    for filter in ["free/cpu/rk4/f64", "forced/cpu/taylor/f64", "free/gpu/rk8 adaptive/f64", "free/gpu/closed form/f32"]
    {
        let bench = Bench { filter: Some(filter.to_owned()), ..all.clone() };
        let swept = kernels::run(&bench, folder.path(), &mut |_| ControlFlow::Continue(())).expect("measured");
        assert_eq!(swept.rows.len(), 1, "{filter}");
        rows.extend(swept.rows);
    }
    let [stepped, series, adaptive, closed_form] = rows.as_slice() else { panic!("{} rows", rows.len()) };
    for (row, greatest) in [(stepped, 1e-6), (series, 1e-7), (adaptive, 1e-6), (closed_form, 1e-5)] {
        let error = row.number("attitude_rad_p99");
        assert!(error > 0.0 && error < greatest, "{}: {error:e} rad", row.text("case"));
        assert_eq!(row.number("failed_bodies"), 0.0);
    }
    // The parts of the ceilings are those of what was done in the time measured, however long that was: operations of four evaluations and of
    // twelve to thirteen a step, and of a closed form the words of a body and its state.
    for (row, part, ceiling, amount) in [
        (stepped, "part_of_flops", "ceiling_flops", 313.0..314.0),
        (adaptive, "part_of_flops", "ceiling_flops", 12.0 * 78.0..13.0 * 79.0),
    ] {
        let of_step = row.number(part) * row.number(ceiling) * row.number("seconds_median") / row.number("body_steps");
        assert!(amount.contains(&(1.000_001 * of_step)), "{}: {of_step} operations a step", row.text("case"));
    }
    let copied = ["part_of_copies", "ceiling_bytes_per_second", "seconds_median"].map(|name| closed_form.number(name));
    let of_body = copied.into_iter().product::<f64>() / closed_form.number("bodies");
    assert!((64.0..1024.0).contains(&of_body), "{of_body} bytes a body");
    let moved = |row: &Row| ["device_waits", "dispatches", "bytes_written", "bytes_read"].map(|name| row.number(name));
    assert_eq!(moved(stepped), [0.0; 4]);
    // States of eight numbers, and counts of four words before and after what is timed.
    let asked = adaptive.number("bodies") * (8.0 * 8.0 + 2.0 * 4.0 * 4.0);
    let [waits, dispatches, written, read] = moved(adaptive);
    assert!(waits > 0.0 && dispatches >= 3.0 && written > 0.0, "{waits} waits, {dispatches} dispatches");
    assert!((asked..=asked + f64::from(64 << 10)).contains(&read), "{read} bytes, {asked} asked for");
    assert!(kernels::summary(&rows).contains("| free/gpu/closed form/f32 |"));
}

#[test]
fn skipping_changes_the_result_by_no_more_than_was_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    for filter in ["steady/cpu", "torque/cpu", "translation-steps/cpu", "states/cpu"] {
        let swept = skipping::run(&bench(filter), folder.path(), &mut |_| ControlFlow::Continue(())).expect("measured");
        let [row] = swept.rows.as_slice() else { panic!("{} rows", swept.rows.len()) };
        assert!(row.flag("valid"), "{}", row.text("fault"));
        assert!(row.number("difference_rad_p99") <= 2.0 * row.number("tolerance_rad"));
        let saves = |with: &str, without: &str| row.number(with) < row.number(without);
        let steps = saves("body_steps_with", "body_steps_without");
        assert!(steps || saves("bytes_with", "bytes_without"), "{filter}: nothing is saved");
        assert_eq!(steps, filter != "states/cpu", "{filter}");
    }
}

#[test]
fn a_plan_ranks_methods_by_what_was_measured() {
    let folder = tempfile::tempdir().expect("a folder");
    let engine = Engine::cpu();
    let refusal = Costs::measured(folder.path(), &engine.description()).expect_err("refused").to_string();
    assert!(refusal.contains("accuracy.csv: no valid row of CPU"), "{refusal}");
    for filter in ["forced/cpu/rk4/f64/1000", "forced/cpu/rk8 adaptive/f64"] {
        assert!(!swept(&bench(filter), folder.path()).rows.is_empty());
    }
    let costs = Costs::measured(folder.path(), &engine.description()).expect("costs");
    let rows = row::rows(folder.path(), accuracy::TABLE).expect("a table");
    let rk4 = rows.iter().find(|row| row.text("method") == "rk4").expect("a row");
    // A step of one core, in f64; what was not measured is as it was shipped.
    let expected = rk4.number("threads") / rk4.number("body_steps_per_second");
    let of =
        |costs: &Costs, precision| costs.of(Scheme::Equal(Method::Rk4)).expect("a row").step_seconds(precision, false);
    assert_eq!(of(&costs, Precision::F64), expected);
    assert_eq!(of(&costs, Precision::F32), of(&Costs::shipped(), Precision::F32));

    // Where rows make adaptive steps of `rk8` a thousand times as fast they are taken, and no plan takes them where they are as slow.
    let (ensemble, torques) = polhode::study::problem::forced(500, 3).expect("enough memory");
    let scene = Scene::new(ensemble).until(5.0).accuracy(Accuracy::attitude(1e-6)).precision(Some(Precision::F64));
    let scene = torques.into_iter().fold(scene, Scene::torque);
    // A torque that asks for the attitude, which makes Taylor series dear.
    let scene = scene.torque(polhode::torque::Torque::heavy_top(0.1, glam::DVec3::Z, glam::DVec3::NEG_Z));
    let adapts = |plan: &Plan| {
        let by_rk8 = |treatment| matches!(treatment, Treatment::Adaptive { method: Method::Rk8, .. });
        plan.groups().iter().any(|group| by_rk8(group.treatment))
    };
    let csv = folder.path().join("accuracy.csv");
    let text = std::fs::read_to_string(&csv).expect("a file");
    for (factor, expected) in [(1e3, true), (1e-3, false)] {
        let lines: Vec<String> = text.lines().map(|line| sped_up(line, &rows, factor)).collect();
        std::fs::write(&csv, lines.join("\n") + "\n").expect("written");
        let costs = Costs::measured(folder.path(), &engine.description()).expect("costs");
        let plan = Plan::with_costs(&scene, &engine, &costs).expect("a plan");
        assert_eq!(adapts(&plan), expected, "steps {factor} times as fast");
    }
}

/// A line of a table with the speed of adaptive steps multiplied.
fn sped_up(line: &str, rows: &[Row], factor: f64) -> String {
    let speed = |row: &&Row| row.text("method") == "rk8 adaptive" && line.contains(&row.text("body_steps_per_second"));
    match rows.iter().find(speed) {
        Some(row) => {
            let speed = row.number("body_steps_per_second");
            line.replace(&row.text("body_steps_per_second"), &format!("{:e}", factor * speed))
        }
        None => line.to_owned(),
    }
}

#[test]
fn two_runs_are_compared_case_by_case() {
    let folders = [(); 2].map(|()| tempfile::tempdir().expect("a folder"));
    let bench = bench("forced/cpu/rk4/f32");
    for folder in &folders {
        assert_eq!(swept(&bench, folder.path()).rows.len(), 4);
    }
    let [old, new] = [&folders[0], &folders[1]].map(|folder| folder.path());
    let same = compare(old, new).expect("compared");
    assert_eq!((same.cases, same.alone), (4, 0));
    assert!(same.differing.is_empty(), "{same}");
    assert_eq!(same.pairs[0] + same.pairs[1], 6);
    assert!(same.ratio[0] > 0.0 && same.ratio[0] <= same.ratio[1] && same.ratio[1] <= same.ratio[2]);

    // One more case in the new run, and one whose error and time are others.
    swept(&Bench { filter: Some("forced/cpu/rk4/f64/1000".to_owned()), ..bench }, new);
    let csv = new.join("accuracy.csv");
    let rows = row::rows(new, accuracy::TABLE).expect("a table");
    let changed = rows.iter().find(|row| row.text("case").ends_with("f32/20 steps")).expect("a row");
    let text = std::fs::read_to_string(&csv).expect("a file");
    let text = text.replace(&changed.text("attitude_rad_max"), "3.5").replace(&changed.text("seconds_median"), "1e9");
    std::fs::write(&csv, text).expect("written");
    // In the old run it was the fastest, whatever the machine did meanwhile.
    let of_old = row::rows(old, accuracy::TABLE).expect("a table");
    let before = of_old.iter().find(|row| row.text("case").ends_with("f32/20 steps")).expect("a row");
    let text = std::fs::read_to_string(old.join("accuracy.csv")).expect("a file");
    std::fs::write(old.join("accuracy.csv"), text.replace(&before.text("seconds_median"), "1e-9")).expect("written");
    let other = compare(old, new).expect("compared");
    assert_eq!((other.cases, other.alone), (4, 1));
    assert_eq!(other.differing, [("forced/cpu/rk4/f32/20 steps".to_owned(), vec!["attitude_rad_max".to_owned()])]);
    // Now it is the slowest.
    assert!(other.pairs[1] >= 1, "{other}");
    assert!(other.to_string().contains("3 agree to the last digit"), "{other}");
}
