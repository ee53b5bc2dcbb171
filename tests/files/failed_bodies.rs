//! Bodies that a run has lost: flagged in its tables, named in its report, and never said to be met.

#![cfg(feature = "cli")]

use std::fs;

use crate::workspace;

use workspace::{States, Workspace, report, words};

/// Rows of the table of failed bodies, as texts.
fn failed(workspace: &Workspace) -> Vec<Vec<String>> {
    let mut reader = csv::Reader::from_path(workspace.path("study.out/failed.csv")).expect("a table of failed bodies");
    let header: Vec<&str> = reader.headers().expect("a header").iter().collect();
    assert_eq!(header.join(","), "body,t,status,reason,known_to,last_good_t,qx,qy,qz,qw,wx,wy,wz,cause");
    reader.records().map(|row| row.expect("a row").iter().map(str::to_owned).collect()).collect()
}

/// Runs a study that must end with exit status 1, all of whose bodies fail for `reason`; gives its tables.
fn all_fail(study: &str, bodies: usize, reason: &str, status: f64) -> (Workspace, States, Vec<Vec<String>>) {
    let workspace = Workspace::new(study);
    let output = workspace.polhode(&["run", "study.toml", "--engine", "cpu"]);
    let errors = words(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.contains("failed.csv says which, when and why"), "{errors}");
    let report = report(&workspace, "study.out");
    assert_eq!(report["failed_bodies"].as_array().expect("a list").len(), bodies);
    assert_eq!(report["failures"][0]["reason"], reason);
    assert_eq!(report["failures"][0]["bodies"], bodies);
    assert_ne!(report["accuracy"]["met"], true, "{}", report["accuracy"]);
    assert!(report["files"].as_array().expect("a list").contains(&"failed.csv".into()), "{report}");
    let rows = failed(&workspace);
    assert_eq!(rows.len(), bodies);
    assert!(rows.iter().all(|row| row[3] == reason), "{rows:?}");
    let states = States::read(&workspace.path("study.out/final.csv"));
    assert!(states.column("status").iter().all(|found| *found == status), "{:?}", states.column("status"));
    (workspace, states, rows)
}

#[test]
fn bodies_that_become_nan_under_an_accuracy_are_not_met() {
    // Seven bodies, none of which the plan has tried, in equal steps.
    let study = "seed = 1\n[bodies]\ncount = 300\ninertia = [1, 2, 2.5]\nangular_velocity = [1, 0.1, 0.2]\n\
                 [[torque]]\nmodel = \"custom\"\n\
                 parameters = { b = { distribution = \"uniform\", low = -0.02, high = 1.0 } }\n\
                 torque = \"-0.01 * sqrt(b) * angular_velocity\"\n\
                 [[torque]]\nmodel = \"white-noise\"\nintensity = 1e-9\n\
                 [time]\nend = 10.0\n[accuracy]\nattitude = 1e-2\n";
    let workspace = Workspace::new(study);
    let output = workspace.polhode(&["run", "study.toml", "--engine", "cpu"]);
    assert_eq!(output.status.code(), Some(1), "{}", words(&output.stderr));
    let report = report(&workspace, "study.out");
    assert_eq!(report["accuracy"]["met"], false, "{}", report["accuracy"]);
    assert_eq!(failed(&workspace).len(), 7);
    let states = States::read(&workspace.path("study.out/final.csv"));
    let status = states.column("status");
    assert_eq!(status.iter().filter(|status| **status > 0.0).count(), 7);
    for name in ["qx", "wx", "lx", "kinetic_energy"] {
        let column = states.column(name);
        assert!(column.iter().zip(status).all(|(x, status)| x.is_nan() == (*status > 0.0)), "{name}");
    }
}

/// A stiff motion that no steps follow in a time that a plan may take is refused, and not planned and lost.
#[test]
fn a_needle_that_drag_stops_at_once_is_refused() {
    let study = "[bodies]\ncount = 20\ninertia = [1e-12, 1, 1]\nangular_velocity = [1, 0.1, 0.2]\n\
                 [[torque]]\nmodel = \"linear-drag\"\ncoefficient = 0.01\n\
                 [time]\nend = 10.0\n[accuracy]\nattitude = 1e-6\n";
    let workspace = Workspace::new(study);
    let output = workspace.polhode(&["run", "study.toml", "--engine", "cpu"]);
    assert_eq!(output.status.code(), Some(2), "{}", words(&output.stderr));
    assert!(words(&output.stderr).contains("out of reach"), "{}", words(&output.stderr));
}

/// Of two formulas the one that gives no number is named, with the operation, the time and what it reads.
#[test]
fn formulas_that_give_no_number_are_named_with_what_they_read() {
    let head = "[bodies]\ncount = 3\ninertia = [1, 2, 2.5]\nangular_velocity = [1, 0.1, 0.2]\n\
                [[torque]]\nmodel = \"custom\"\ntorque = \"-0.01 * angular_velocity\"\n[[torque]]\nmodel = \"custom\"\n\
                parameters = { k = 0.25, b = [0, 0, 1] }\n";
    let tail = "[time]\nend = 4.0\n[accuracy]\nmethod = \"rk4\"\ndt = 0.01\n";
    for (formula, operation, reads) in [
        // The argument is -k/100, /200 or so in the stages of the step behind 2 s.
        ("torque = \"k * sqrt(2 - time) * b\"", "sqrt(-0.00", vec!["time = 2.00", "k = 0.25", "b = [0.0, 0.0, 1.0]"]),
        (
            "torque = \"b * ln(1 - 2 * k * time + 0.001 * dot(angular_velocity, b))\"",
            "ln(-",
            vec!["time = ", "angular_velocity = ["],
        ),
        ("factor = \"1 - 2 * k * time\"", "a factor of [", vec!["which no body has", "k = 0.25"]),
    ] {
        let (workspace, _, rows) = all_fail(&format!("{head}{formula}\n{tail}"), 3, "not_finite", 4.0);
        let cause = &rows[1][13];
        let name = if formula.starts_with("factor") { "custom-factor" } else { "custom" };
        assert!(cause.starts_with(&format!("torque[2] ({name}): {operation}")), "{cause}");
        assert!(reads.iter().all(|read| cause.contains(read)), "{cause}");
        let said = report(&workspace, "study.out")["failures"][0]["cause"].to_string();
        assert!(said.contains("body 0: torque[2]") && said.contains("k = 0.25"), "{said}");
        // Adaptive steps stop there, and the cause is found behind them.
        let adaptive = "[time]\nend = 4.0\n[accuracy]\nmethod = \"rk8\"\ntolerance = 1e-8\n";
        let (_, _, rows) = all_fail(&format!("{head}{formula}\n{adaptive}"), 3, "step_below_limit", 3.0);
        assert!(rows.iter().all(|row| row[13].starts_with("torque[2]")), "{:?}", rows[1]);
    }
}

#[test]
fn rates_that_overflow_are_rows_with_the_state_at_the_start() {
    let study = "[bodies]\ncount = 20\ninertia = [1e-30, 1e-30, 1e-30]\nangular_velocity = [1, 0.1, 0.2]\n\
                 [[torque]]\nmodel = \"constant-body\"\ntorque = [1e290, 0, 0]\n\
                 [time]\nend = 10.0\n[accuracy]\nmethod = \"rk4\"\ndt = 0.01\n";
    let (_, states, rows) = all_fail(study, 20, "not_finite", 4.0);
    assert!(states.column("wx").iter().all(|rate| rate.is_nan()));
    // The first step is lost, so that the last good state is the start.
    let expected = ["0.01", "4", "not_finite", "step", "0.0", "0.0", "0.0", "0.0", "1.0", "1.0", "0.1", "0.2", ""];
    assert_eq!(rows[7][1..], expected, "{:?}", rows[7]);
}

/// Bodies of which a study may say more in the same table.
pub fn bodies(count: usize) -> String {
    format!("[bodies]\ncount = {count}\ninertia = [1, 2, 2.5]\nangular_velocity = [1, 0.4, 0.1]\n")
}

/// Centres of mass that leave the range of f64 within a second.
const FLUNG: &str = "mass = 1.0\nposition = [1e308, 0, 0]\nvelocity = [1e308, 0, 0]\n";

/// A drag that no adaptive step follows.
const STIFF: &str = "[[torque]]\nmodel = \"linear-drag\"\ncoefficient = 1e300\n";

#[test]
fn a_body_whose_adaptive_steps_are_all_refused_does_not_stand_at_its_start() {
    let study = bodies(5) + STIFF + "[time]\nend = 3.0\n[accuracy]\nmethod = \"rk8\"\ntolerance = 1e-9\n";
    let (workspace, states, _) = all_fail(&study, 5, "step_below_limit", 3.0);
    assert!(states.column("qw").iter().chain(states.column("wx")).all(|x| x.is_nan()), "{states:?}");
    // Nor have they an error of 0.
    let accuracy = &report(&workspace, "study.out")["accuracy"];
    assert_eq!((&accuracy["bodies"], &accuracy["lost"]), (&0.into(), &5.into()));
    assert!(accuracy["attitude"]["max"].is_null(), "{accuracy}");
    let summary = words(&workspace.polhode(&["run", "study.toml", "--engine", "cpu", "--force"]).stdout);
    assert!(summary.contains("\n  error    not known: no body of the sample is left to compare\n"), "{summary}");
    let failed = "\n  failed   5 bodies, the first is body 0\n           5 step_below_limit: the error asked for needs";
    assert!(summary.contains(failed), "{summary}");
}

#[test]
fn one_lost_body_of_many_is_not_met_whatever_the_percentile() {
    const BODIES: usize = 20_001;
    // Not among the recomputed ones, which are one of every 312.
    const LOST: usize = 7777;
    let table: String = (0..BODIES)
        .map(|body| if body == LOST { "1e-12,1,1,1,0.1,0.2,0.01\n" } else { "1,2,2.5,1,0.1,0.2,0.01\n" })
        .collect();
    let workspace = Workspace::new(
        "[bodies]\nfile = \"bodies.csv\"\n[[torque]]\nmodel = \"linear-drag\"\ncoefficient = { column = \"drag\" }\n\
         [time]\nend = 10.0\n[accuracy]\nattitude = 1e-6\npercentile = 100\n",
    );
    fs::write(workspace.path("bodies.csv"), format!("ixx,iyy,izz,wx,wy,wz,drag\n{table}")).expect("a table");
    let output = workspace.polhode(&["run", "study.toml", "--engine", "cpu"]);
    assert_eq!(output.status.code(), Some(1), "{}", words(&output.stderr));
    let summary = words(&output.stdout);
    assert!(summary.contains("NOT MET, 0 of ") && summary.contains(" beyond, 1 of all bodies failed\n"), "{summary}");
    let report = report(&workspace, "study.out");
    assert_eq!(report["failed_bodies"], serde_json::json!([LOST]));
    assert_eq!((&report["accuracy"]["lost"], &report["accuracy"]["met"]), (&0.into(), &false.into()));
    let states = States::read(&workspace.path("study.out/final.csv"));
    for body in 0..BODIES {
        let is_lost = body == LOST;
        assert_eq!(
            (states.column("status")[body] > 0.0, states.column("wx")[body].is_nan()),
            (is_lost, is_lost),
            "{body}"
        );
    }
}

#[test]
fn centres_of_mass_that_become_infinite_fail_their_bodies() {
    let (bodies, end) = (bodies(10), "[time]\nend = 10.0\n[accuracy]\nattitude = 1e-6\n");
    let flung = format!("{bodies}{FLUNG}{end}");
    let pushed = format!(
        "{bodies}mass = 1e-300\nvelocity = [1, 0, 0]\n[[force]]\nmodel = \"constant\"\nforce = [1e300, 0, 0]\n{end}"
    );
    for study in [flung, pushed] {
        let (_, states, _) = all_fail(&study, 10, "centre_not_finite", 5.0);
        assert!(states.column("x").iter().all(|x| x.is_nan()));
        assert!(states.column("qw").iter().all(|q| q.is_finite()), "the rotation is good");
    }
}

#[test]
fn the_last_good_state_is_that_of_the_output_before() {
    let study = bodies(10)
        + &FLUNG.replace("velocity = [1e308", "velocity = [1e307")
        + "[time]\nend = 10.0\noutputs = { every = 2.0 }\n[accuracy]\nattitude = 1e-6\n[output]\nsnapshots = true\n";
    let (workspace, _, rows) = all_fail(&study, 10, "centre_not_finite", 5.0);
    // 1e308 + 1e307 t leaves the range of f64, 1.798e308, after 7.98 s.
    // Nothing is stepped, so that there is no step to know it to.
    assert!(rows.iter().all(|row| [&row[1], &row[4], &row[5]] == ["8.0", "output", "6.0"]), "{rows:?}");
    let states = States::read(&workspace.path("study.out/snapshots.csv"));
    for row in 0..states.rows() {
        let is_lost = states.column("t")[row] > 7.98;
        assert_eq!(states.column("status")[row] > 0.0, is_lost, "t = {}", states.column("t")[row]);
        assert_eq!(states.column("x")[row].is_nan(), is_lost);
    }
}

/// Bodies whose kinetic energy, ½ (1e154 + 1e307 t)² J, leaves the range of f64 when they turn at 1.89616e154 rad/s, after 8.9616e-154 s:
/// the 897th step of 1e-156 s. Each turns faster than the one before by a step's worth.
fn spun_up(count: usize) -> (String, String) {
    let table: String = (0..count).map(|body| format!("1,1,1,{:e},0,0\n", 1e154 + 1e151 * body as f64)).collect();
    let study = "[bodies]\nfile = \"bodies.csv\"\n[[torque]]\nmodel = \"constant-body\"\ntorque = [1e307, 0, 0]\n\
                 [time]\nend = 1.2e-153\noutputs = { every = 4e-154 }\n[output]\nsnapshots = true\n\
                 [accuracy]\nmethod = \"METHOD\"\ndt = 1e-156\n";
    (study.to_owned(), format!("ixx,iyy,izz,wx,wy,wz\n{table}"))
}

#[test]
fn a_body_whose_energy_overflows_has_the_step_that_lost_it() {
    const BODIES: usize = 21;
    let (study, table) = spun_up(BODIES);
    for method in ["rk4", "splitting4", "rk8"] {
        let workspace = Workspace::new(&study.replace("METHOD", method));
        fs::write(workspace.path("bodies.csv"), &table).expect("written");
        let output = workspace.polhode(&["run", "study.toml", "--engine", "cpu"]);
        assert_eq!(output.status.code(), Some(1), "{}", words(&output.stderr));
        let rows = failed(&workspace);
        assert_eq!(rows.len(), BODIES);
        for (body, row) in rows.iter().enumerate() {
            let number = |column: usize| row[column].parse::<f64>().expect("a number");
            let steps = |time: f64| (time / 1e-156).round() as usize;
            let expected = 897 - body;
            assert_eq!((row[3].as_str(), row[4].as_str()), ("not_finite", "step"), "{method}: {row:?}");
            assert_eq!(
                (steps(number(1)), steps(number(5))),
                (expected, expected - 1),
                "{method}: body {body}: {row:?}"
            );
            // The state before that step, of which the energy is still a number.
            let rate = (1e154 + 1e151 * body as f64) + 1e307 * number(5);
            assert!((number(10) - rate).abs() < 1e-12 * rate, "{method}: {row:?}");
            let greatest = f64::MAX.sqrt() * 2.0_f64.sqrt();
            assert!(number(10) < greatest && number(10) + 1e151 > greatest, "{method}: {row:?}");
        }
    }
}

#[test]
fn the_time_of_failure_is_that_of_a_run_whose_every_step_is_read() {
    // Drag under steps too long for it: rates grow by a factor of each body's own in every step, until they explode.
    let table: String = (0..30).map(|body| format!("1,2,2.5,0.1,1,0.5,{}\n", 32 + 2 * body)).collect();
    let study = |outputs: &str| {
        format!(
            "[bodies]\nfile = \"bodies.csv\"\n[[torque]]\nmodel = \"linear-drag\"\n\
             coefficient = {{ column = \"drag\" }}\n[time]\nend = 8.0\n{outputs}[accuracy]\nmethod = \"rk4\"\ndt = 0.125\n"
        )
    };
    let run = |study: &str, engine: &str| {
        let workspace = Workspace::new(study);
        fs::write(workspace.path("bodies.csv"), format!("ixx,iyy,izz,wx,wy,wz,drag\n{table}")).expect("written");
        let mut arguments = vec!["run", "study.toml", "--engine", engine, "--quiet"];
        if engine == "gpu" {
            arguments.extend(["--precision", "f32"]);
        }
        let output = workspace.polhode(&arguments);
        assert_eq!(output.status.code(), Some(1), "{}", words(&output.stderr));
        failed(&workspace)
    };
    let every_step = "outputs = { every = 0.125 }\n[output]\nsnapshots = true\n";
    for (engine, most_apart) in [("cpu", 0.0), ("gpu", 0.125)] {
        let read = run(&study(every_step), engine);
        assert!(!read.is_empty(), "nothing explodes");
        let times: std::collections::BTreeSet<&str> = read.iter().map(|row| row[1].as_str()).collect();
        assert!(times.len() > 1, "all explode at once: {times:?}");
        for outputs in ["", "outputs = { every = 2.0 }\n", "outputs = { every = 2.0 }\n[output]\nsnapshots = true\n"] {
            let found = run(&study(outputs), engine);
            assert_eq!(found.len(), read.len());
            for (found, read) in found.iter().zip(&read) {
                assert_eq!([&found[0], &found[3], &found[4]], [&read[0], &read[3], "step"], "{engine}: {found:?}");
                let time = |row: &[String], column: usize| row[column].parse::<f64>().expect("a number");
                assert!((time(found, 1) - time(read, 1)).abs() <= most_apart, "{engine}: {found:?} is {read:?}");
                if most_apart == 0.0 {
                    assert_eq!(found[5..], read[5..], "the state before the step, to the bit");
                }
            }
        }
    }
}

#[test]
fn a_centre_of_mass_that_moves_with_stepped_bodies_is_lost_at_a_step() {
    // 1e308 + 1e307 t leaves the range of f64, 1.7977e308, after 7.977 s.
    let study = bodies(10)
        + &FLUNG.replace("velocity = [1e308", "velocity = [1e307")
        + "[time]\nend = 10.0\noutputs = { every = 4.0 }\n[accuracy]\nmethod = \"rk4\"\ndt = 0.01\n";
    let (_, _, rows) = all_fail(&study, 10, "centre_not_finite", 5.0);
    let is_found = |row: &[String], time: f64, dt: f64| {
        let near = |column: usize, time: f64| (row[column].parse::<f64>().expect("a number") - time).abs() < 1e-9;
        row[4] == "step" && near(1, time) && near(5, time - dt)
    };
    assert!(rows.iter().all(|row| is_found(row, 7.98, 0.01)), "{rows:?}");
    // Thrust along the attitude, which is followed step by step: the square of 1e153 m/s² t does so after 13.408 s.
    let study = "[bodies]\ncount = 5\ninertia = [1, 2, 2.5]\nangular_velocity = [1, 0, 0]\nmass = 1.0\n\
                 [[force]]\nmodel = \"thrust\"\nforce = [1e153, 0, 0]\n\
                 [[torque]]\nmodel = \"linear-drag\"\ncoefficient = 0.01\n\
                 [time]\nend = 40.0\n[accuracy]\nmethod = \"rk4\"\ndt = 0.1\n";
    let (_, _, rows) = all_fail(study, 5, "centre_not_finite", 5.0);
    assert!(rows.iter().all(|row| is_found(row, 13.5, 0.1)), "{rows:?}");
}

#[test]
fn a_body_that_stops_in_adaptive_steps_has_its_own_time() {
    // A drag that becomes stiff at 2 s, between outputs: the limit on steps is reached on the way from 1 to 3 s.
    let study = bodies(5)
        + "[[torque]]\nmodel = \"custom\"\n\
           torque = \"-1e12 * max(time - 2, 0) * angular_velocity\"\n\
           [time]\nend = 5.0\noutputs = { times = [1.0, 3.0, 5.0] }\n[output]\nsnapshots = true\n\
           [accuracy]\nmethod = \"rk8\"\ntolerance = 1e-9\nleast_step = 1e-4\n";
    let (_, _, rows) = all_fail(&study, 5, "step_below_limit", 3.0);
    for row in &rows {
        let number = |column: usize| row[column].parse::<f64>().expect("a number");
        assert_eq!((row[4].as_str(), &row[1]), ("step", &row[5]), "{row:?}");
        assert!(number(1) > 1.9 && number(1) < 2.1, "{row:?}");
        let norm = (6..10).map(|column| number(column).powi(2)).sum::<f64>();
        assert!((norm - 1.0).abs() < 1e-6 && row[10] != "1.0", "a state on the way: {row:?}");
    }
}

#[test]
fn more_failed_bodies_than_are_stepped_again_keep_their_outputs() {
    const BODIES: usize = 1100;
    let (study, table) = spun_up(BODIES);
    // All alike.
    let (header, rows) = table.split_once('\n').expect("lines");
    let first = rows.lines().next().expect("a row");
    let workspace = Workspace::new(&study.replace("METHOD", "rk4"));
    fs::write(workspace.path("bodies.csv"), format!("{header}\n{}", format!("{first}\n").repeat(BODIES)))
        .expect("written");
    let output = workspace.polhode(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
    assert_eq!(output.status.code(), Some(1), "{}", words(&output.stderr));
    let rows = failed(&workspace);
    let count = |word: &str| rows.iter().filter(|row| row[4] == word).count();
    assert_eq!((rows.len(), count("step"), count("output")), (BODIES, 1000, 100));
    assert!(rows[..1000].iter().all(|row| row[4] == "step"), "the first of them");
}

#[test]
fn failures_are_found_where_statistics_alone_are_asked_for() {
    let bodies = bodies(10);
    let output = "outputs = { every = 1.0 }\n[output]\nfinal = false\nstatistics = [\"spin_rate\"]\n";
    let driven = format!("{bodies}{STIFF}[time]\nend = 3.0\n{output}[accuracy]\nmethod = \"rk8\"\ntolerance = 1e-9\n");
    let flung = format!("{bodies}{FLUNG}[time]\nend = 3.0\n{output}");
    // No states were read on the way: what is known of bodies that are not stepped is the start, and that they had failed at the end.
    let (stopped, lost) = (["0.0", "step", "0.0"], ["3.0", "output", "0.0"]);
    for (study, reason, counted, expected) in
        [(driven, "step_below_limit", 0.0, stopped), (flung, "centre_not_finite", 10.0, lost)]
    {
        let workspace = Workspace::new(&study);
        let output = workspace.polhode(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
        assert_eq!(output.status.code(), Some(1), "{}", words(&output.stderr));
        assert_eq!(workspace.names("study.out"), ["failed.csv", "plan.json", "report.json", "statistics.csv"]);
        let rows = failed(&workspace);
        assert_eq!(rows.len(), 10);
        assert!(rows.iter().all(|row| row[3] == reason && row[9] == "1.0"), "{rows:?}");
        assert!(rows.iter().all(|row| [&row[1], &row[4], &row[5]] == expected), "{rows:?}");
        let statistics = fs::read_to_string(workspace.path("study.out/statistics.csv")).expect("statistics");
        // Statistics are of the rotation.
        let count = statistics.lines().last().and_then(|row| row.split(',').nth(1)).expect("a count").parse::<f64>();
        assert_eq!(count, Ok(counted), "{reason}");
        // The rotation of bodies whose centre is lost is good, and theirs alone is a sample's.
        let summary = words(&workspace.polhode(&["run", "study.toml", "--engine", "cpu", "--force"]).stdout);
        let is_sample = summary.contains("of a sample of 10 bodies: states were not read\n");
        assert_eq!(is_sample, reason == "centre_not_finite", "{summary}");
    }
}

#[test]
fn both_formats_say_the_same_of_failed_bodies() {
    let study = "[bodies]\ncount = 7\ninertia = [1, 2, 2.5]\nangular_velocity = [1, 0.4, 0.1]\nmass = 1.0\n\
                 position = [1e308, 0, 0]\nvelocity = [1e307, 0, 0]\n\
                 [time]\nend = 10.0\noutputs = { every = 2.0 }\n[accuracy]\nattitude = 1e-6\n[output]\nsnapshots = true\n";
    let (workspace, _, rows) = all_fail(study, 7, "centre_not_finite", 5.0);
    fs::write(workspace.path("study.toml"), format!("{study}format = \"npz\"\n")).expect("written");
    let output = workspace.polhode(&["run", "study.toml", "--engine", "cpu", "--quiet", "--out", "binary"]);
    assert_eq!(output.status.code(), Some(1), "{}", words(&output.stderr));
    let file = fs::File::open(workspace.path("binary/failed.npz")).expect("a table of failed bodies");
    let mut archive = zip::ZipArchive::new(file).expect("a ZIP archive");
    assert_eq!(archive.len(), rows[0].len());
    for column in 0..archive.len() {
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut archive.by_index(column).expect("an entry"), &mut bytes)
            .expect("its checksum fits");
        // Magic, version, length of the header, header.
        let data = &bytes[10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]))..];
        for (row, element) in rows.iter().zip(data.chunks(data.len() / rows.len())) {
            let found = match column {
                0 => u64::from_le_bytes(element.try_into().expect("eight bytes")).to_string(),
                2 => element[0].to_string(),
                3 | 4 | 13 => utf_32(element),
                _ => format!("{:?}", f64::from_le_bytes(element.try_into().expect("eight bytes"))),
            };
            assert_eq!(found, row[column], "column {column}");
        }
    }
    let mut states =
        zip::ZipArchive::new(fs::File::open(workspace.path("binary/snapshots.npz")).unwrap()).expect("an archive");
    let mut bytes = Vec::new();
    std::io::Read::read_to_end(&mut states.by_name("status.npy").expect("a column"), &mut bytes)
        .expect("its checksum fits");
    assert_eq!(bytes[bytes.len() - 35..], [[0; 7], [0; 7], [0; 7], [5; 7], [5; 7]].concat(), "2, 4, 6, 8 and 10 s");
}

#[test]
fn a_good_run_has_no_table_of_failed_bodies() {
    let workspace = Workspace::new(
        "[bodies]\ncount = 3\ninertia = [1, 2, 2.5]\nangular_velocity = [1, 0.4, 0.1]\n[time]\nend = 1.0\n",
    );
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
    assert_eq!(workspace.names("study.out"), ["final.csv", "plan.json", "report.json"]);
    assert_eq!(report(&workspace, "study.out")["failures"], serde_json::json!([]));
}

#[test]
fn phases_beyond_all_digits_are_not_said_to_be_met() {
    // 1.1e30 rad: the closed form's constants are known to 2⁻⁹⁶, so that no digit of the phase is.
    let workspace = Workspace::new(
        "[bodies]\ncount = 10\ninertia = [1, 2, 2.5]\nangular_velocity = [1e20, 0.4e20, 0.1e20]\n\
         [time]\nend = 1e10\n[accuracy]\nattitude = 1\n",
    );
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
    let accuracy = &report(&workspace, "study.out")["accuracy"];
    assert_eq!((&accuracy["diverged"], &accuracy["bodies"]), (&10.into(), &0.into()), "{accuracy}");
    assert!(accuracy["met"].is_null(), "{accuracy}");
}

/// A text of NumPy's type `U`.
fn utf_32(element: &[u8]) -> String {
    let letters = element.chunks_exact(4).map(|bytes| u32::from_le_bytes(bytes.try_into().expect("four bytes")));
    letters.take_while(|letter| *letter != 0).map(|letter| char::from_u32(letter).expect("a letter")).collect()
}
