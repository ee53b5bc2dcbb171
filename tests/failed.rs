//! Bodies that fail are data: a status in tables of states, a row in the table `failed`, and exit status 1.

#![cfg(feature = "cli")]

use std::fs;

#[path = "support/desk.rs"]
mod desk;

use desk::{Desk, States, report, words};

/// Rows of the table of failed bodies, as texts.
fn failed(desk: &Desk) -> Vec<Vec<String>> {
    let mut reader = csv::Reader::from_path(desk.path("study.out/failed.csv")).expect("a table of failed bodies");
    let header: Vec<&str> = reader.headers().expect("a header").iter().collect();
    assert_eq!(header.join(","), "body,t,status,reason,last_good_t,qx,qy,qz,qw,wx,wy,wz");
    reader.records().map(|row| row.expect("a row").iter().map(str::to_owned).collect()).collect()
}

/// Runs a study that must end with exit status 1, all of whose bodies fail for `reason`; gives its tables.
fn all_fail(study: &str, bodies: usize, reason: &str, status: f64) -> (Desk, States, Vec<Vec<String>>) {
    let desk = Desk::new(study);
    let output = desk.polhode(&["run", "study.toml", "--engine", "cpu"]);
    let errors = words(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.contains("failed.csv says which, when and why"), "{errors}");
    let report = report(&desk, "study.out");
    assert_eq!(report["failed_bodies"].as_array().expect("a list").len(), bodies);
    assert_eq!(report["failures"][0]["reason"], reason);
    assert_eq!(report["failures"][0]["bodies"], bodies);
    assert_ne!(report["accuracy"]["met"], true, "{}", report["accuracy"]);
    assert!(report["files"].as_array().expect("a list").contains(&"failed.csv".into()), "{report}");
    let rows = failed(&desk);
    assert_eq!(rows.len(), bodies);
    assert!(rows.iter().all(|row| row[3] == reason), "{rows:?}");
    let states = States::read(&desk.path("study.out/final.csv"));
    assert!(states.column("status").iter().all(|found| *found == status), "{:?}", states.column("status"));
    (desk, states, rows)
}

#[test]
fn bodies_that_become_nan_under_an_accuracy_are_not_met() {
    let study = "[bodies]\ncount = 20\ninertia = [1e-12, 1, 1]\nangular_velocity = [1, 0.1, 0.2]\n\
                 [[torque]]\nmodel = \"linear-drag\"\ncoefficient = 0.01\n\
                 [time]\nend = 10.0\n[accuracy]\nattitude = 1e-6\n";
    let desk = Desk::new(study);
    let output = desk.polhode(&["run", "study.toml", "--engine", "cpu"]);
    assert_eq!(output.status.code(), Some(1), "{}", words(&output.stderr));
    let report = report(&desk, "study.out");
    assert_eq!(report["accuracy"]["met"], false, "{}", report["accuracy"]);
    assert_eq!(failed(&desk).len(), 20);
    let states = States::read(&desk.path("study.out/final.csv"));
    assert!(states.column("status").iter().all(|status| *status > 0.0));
    assert!(["qx", "wx", "lx", "kinetic_energy"].iter().all(|name| states.column(name).iter().all(|x| x.is_nan())));
}

#[test]
fn rates_that_overflow_are_rows_with_the_state_at_the_start() {
    let study = "[bodies]\ncount = 20\ninertia = [1e-30, 1e-30, 1e-30]\nangular_velocity = [1, 0.1, 0.2]\n\
                 [[torque]]\nmodel = \"constant-body\"\ntorque = [1e290, 0, 0]\n\
                 [time]\nend = 10.0\n[accuracy]\nmethod = \"rk4\"\ndt = 0.01\n";
    let (_, states, rows) = all_fail(study, 20, "not_finite", 4.0);
    assert!(states.column("wx").iter().all(|rate| rate.is_nan()));
    // Only the end is read, so that the last good state that is known is the start.
    let expected = ["10.0", "4", "not_finite", "0.0", "0.0", "0.0", "0.0", "1.0", "1.0", "0.1", "0.2"];
    assert_eq!(rows[7][1..], expected, "{:?}", rows[7]);
}

#[test]
fn a_body_whose_adaptive_steps_are_all_refused_does_not_stand_at_its_start() {
    let study = "[bodies]\ncount = 5\ninertia = [1, 2, 2.5]\nangular_velocity = [1, 0.4, 0.1]\n\
                 [[torque]]\nmodel = \"linear-drag\"\ncoefficient = 1e300\n\
                 [time]\nend = 3.0\n[accuracy]\nmethod = \"rk8\"\ntolerance = 1e-9\n";
    let (desk, states, _) = all_fail(study, 5, "step_below_limit", 3.0);
    assert!(states.column("qw").iter().chain(states.column("wx")).all(|x| x.is_nan()), "{states:?}");
    assert_eq!(report(&desk, "study.out")["accuracy"]["bodies"], 0, "an error of 0 of bodies that have not arrived");
}

#[test]
fn one_lost_body_of_many_is_not_met_whatever_the_percentile() {
    let table: String = (0..2001)
        .map(|body| if body == 1234 { "1e-12,1,1,1,0.1,0.2\n" } else { "1,2,2.5,0.1,0.1,0.2\n" })
        .collect();
    let desk = Desk::new(
        "[bodies]\nfile = \"bodies.csv\"\n[[torque]]\nmodel = \"linear-drag\"\ncoefficient = 0.01\n\
         [time]\nend = 10.0\n[accuracy]\nmethod = \"rk4\"\ndt = 0.1\n",
    );
    fs::write(desk.path("bodies.csv"), format!("ixx,iyy,izz,wx,wy,wz\n{table}")).expect("a table");
    let output = desk.polhode(&["run", "study.toml", "--engine", "cpu"]);
    assert_eq!(output.status.code(), Some(1), "{}", words(&output.stderr));
    assert_eq!(report(&desk, "study.out")["failed_bodies"], serde_json::json!([1234]));
    let states = States::read(&desk.path("study.out/final.csv"));
    for body in 0..2001 {
        let is_lost = body == 1234;
        assert_eq!((states.column("status")[body] > 0.0, states.column("wx")[body].is_nan()), (is_lost, is_lost), "{body}");
    }
}

#[test]
fn centres_of_mass_that_become_infinite_fail_their_bodies() {
    let bodies = "[bodies]\ncount = 10\ninertia = [1, 2, 2.5]\nangular_velocity = [1, 0.4, 0.1]\n";
    let end = "[time]\nend = 10.0\n[accuracy]\nattitude = 1e-6\n";
    let flung = format!("{bodies}mass = 1.0\nposition = [1e308, 0, 0]\nvelocity = [1e308, 0, 0]\n{end}");
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
    let study = "[bodies]\ncount = 10\ninertia = [1, 2, 2.5]\nangular_velocity = [1, 0.4, 0.1]\nmass = 1.0\n\
                 position = [1e308, 0, 0]\nvelocity = [1e307, 0, 0]\n\
                 [time]\nend = 10.0\noutputs = { every = 2.0 }\n[accuracy]\nattitude = 1e-6\n[output]\nsnapshots = true\n";
    let (desk, _, rows) = all_fail(study, 10, "centre_not_finite", 5.0);
    // 1e308 + 1e307 t leaves the range of f64, 1.798e308, after 7.98 s.
    assert!(rows.iter().all(|row| (row[1].as_str(), row[4].as_str()) == ("8.0", "6.0")), "{rows:?}");
    let states = States::read(&desk.path("study.out/snapshots.csv"));
    for row in 0..states.rows() {
        let is_lost = states.column("t")[row] > 7.98;
        assert_eq!(states.column("status")[row] > 0.0, is_lost, "t = {}", states.column("t")[row]);
        assert_eq!(states.column("x")[row].is_nan(), is_lost);
    }
}

#[test]
fn a_good_run_has_no_table_of_failed_bodies() {
    let desk = Desk::new(
        "[bodies]\ncount = 3\ninertia = [1, 2, 2.5]\nangular_velocity = [1, 0.4, 0.1]\n[time]\nend = 1.0\n",
    );
    desk.done(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
    assert_eq!(desk.names("study.out"), ["final.csv", "plan.json", "report.json"]);
    assert_eq!(report(&desk, "study.out")["failures"], serde_json::json!([]));
}

#[test]
fn phases_beyond_all_digits_are_not_met() {
    // 1.1e30 rad: the closed form's constants are known to 2⁻⁹⁶, so that no digit of the phase is.
    let desk = Desk::new(
        "[bodies]\ncount = 10\ninertia = [1, 2, 2.5]\nangular_velocity = [1e20, 0.4e20, 0.1e20]\n\
         [time]\nend = 1e10\n[accuracy]\nattitude = 1\n",
    );
    desk.done(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
    let accuracy = &report(&desk, "study.out")["accuracy"];
    assert_eq!((&accuracy["diverged"], &accuracy["bodies"]), (&10.into(), &0.into()), "{accuracy}");
    assert!(accuracy["met"].is_null(), "{accuracy}");
}
