//! Sweeps over parameters, and what results say of them.

#![cfg(feature = "cli")]

use std::path::Path;

use polhode::Plan;
use polhode::engine::Engine;
use polhode::study::Study;

use crate::workspace::{States, Workspace};

/// Two parameters of a torque and one of a distribution.
const SWEPT: &str = r#"
seed = 5
[[sweep]]
name = "drag"
values = [0.0, 0.01, 0.1]
[[sweep]]
name = "inclination"
from = "0 deg"
to = "90 deg"
count = 4
[[sweep]]
name = "spread"
from = 0.01
to = 1.0
count = 3
scale = "logarithmic"
[bodies]
count = 5
inertia = [1.0, 1.5, 2.0]
orientation = { distribution = "uniform" }
angular_velocity = { distribution = "normal", mean = [0, 0, 1], sigma = { sweep = "spread" } }
[[torque]]
model = "linear-drag"
coefficient = { sweep = "drag" }
[[torque]]
model = "gravity-gradient"
mu = 3.986004418e14
orbit = { radius = 7.0e6, inclination = { sweep = "inclination" } }
[time]
end = 10.0
[accuracy]
method = "rk4"
dt = 0.1
"#;

fn study(text: &str) -> polhode::Result<Study> {
    Study::parse(Path::new("study.toml"), text)
}

#[test]
fn a_grid_is_the_product_of_its_axes_and_every_parameter_follows_its_cell() {
    let study = study(SWEPT).expect("a study");
    let design = study.design().expect("a sweep");
    assert_eq!((design.cells(), study.bodies().count), (36, 180));
    let short = self::study(&SWEPT.replace("\"logarithmic\"", "\"log\"")).expect("a study");
    assert_eq!(short.design(), study.design());
    let scene = study.scene().expect("a scene");
    let drag = scene.torques()[0].parameter("coefficient").and_then(|value| value.as_number()).expect("a number");
    let inclination =
        scene.torques()[1].parameter("orbit.inclination").and_then(|value| value.as_number()).expect("a number");
    for body in 0..180 {
        let cell = body % 36;
        assert_eq!(design.cell_of(body), cell);
        let expected =
            [[0.0, 0.01, 0.1][cell / 12], f64::to_radians(30.0) * ((cell / 3 % 4) as f64), [0.01, 0.1, 1.0][cell % 3]];
        let found: Vec<f64> = design.axes().iter().map(|axis| axis.value(cell)).collect();
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found - expected).abs() <= 4.0 * f64::EPSILON * expected, "cell {cell}: {found}, not {expected}");
        }
        assert_eq!([drag.at(body), inclination.at(body)], found[..2]);
    }
    // Both ends are exact.
    assert_eq!(design.axes()[1].value(11), std::f64::consts::FRAC_PI_2);
    assert_eq!([0, 2].map(|cell| design.axes()[2].value(cell)), [0.01, 1.0]);
}

#[test]
fn a_logarithmic_axis_may_have_ends_without_a_quotient() {
    for (from, to) in [("1e-200", "1e200"), ("1e200", "1e-200"), ("1e-300", "1e300")] {
        let text = SWEPT.replace("from = 0.01\nto = 1.0\ncount = 3", &format!("from = {from}\nto = {to}\ncount = 5"));
        let study = study(&text).expect("a study");
        let axis = &study.design().expect("a sweep").axes()[2];
        let [from, to]: [f64; 2] = [from, to].map(|end| end.parse().expect("a number"));
        assert_eq!([0, 4].map(|cell| axis.value(cell)), [from, to]);
        // The exponent is the sum of two terms up to 518, each rounded twice to half an ulp of its own.
        const ERROR: f64 = 3e-13;
        for (cell, expected) in [(1, from.sqrt()), (2, 1.0), (3, to.sqrt())] {
            let found = axis.value(cell);
            assert!((found / expected - 1.0).abs() < ERROR, "{from}, {to}: {found}, not {expected}");
        }
    }
}

#[test]
fn more_bodies_a_cell_leave_the_former_as_they_are() {
    let ensemble = |count: usize| {
        let text = SWEPT.replace("count = 5\n", &format!("count = {count}\n"));
        study(&text).and_then(|study| study.ensemble()).expect("bodies")
    };
    let (few, many) = (ensemble(5), ensemble(9));
    assert_eq!(few.angular_velocity_body(), &many.angular_velocity_body()[..180]);
    assert_eq!(few.orientation(), &many.orientation()[..180]);
}

#[test]
fn bodies_of_common_draws_differ_by_what_is_swept_alone() {
    let text = format!("{SWEPT}\n[design]\ncommon_draws = true\n");
    let ensemble = study(&text).and_then(|study| study.ensemble()).expect("bodies");
    for body in 0..180 {
        let first = body / 36 * 36;
        assert_eq!(ensemble.orientation()[body], ensemble.orientation()[first]);
        // The same normal numbers, times the spread of the cell.
        let spread = [0.01, 0.1, 1.0];
        let normals = |body: usize| (ensemble.angular_velocity_body()[body] - glam::DVec3::Z) / spread[body % 3];
        assert!((normals(body) - normals(first)).length() < 1e-13, "body {body}");
    }
    assert_ne!(ensemble.orientation()[0], ensemble.orientation()[36]);
}

#[test]
fn each_row_of_a_table_of_bodies_lies_in_every_cell() {
    let workspace = Workspace::new("");
    let table = "name,ixx,iyy,izz,wx,wy,wz,k,owner\nA,1,1.5,2,0,0,1,0.1,\"X, Y\"\nB,1,2,2.5,0,1,0,0.2,Z\n";
    std::fs::write(workspace.path("bodies.csv"), table).expect("a file");
    let text = r#"
        [[sweep]]
        name = "field"
        values = [1e-5, 2e-5, 3e-5]
        [bodies]
        file = "bodies.csv"
        carry = ["owner"]
        [[torque]]
        model = "linear-drag"
        coefficient = { column = "k" }
        [[torque]]
        model = "magnetic-dipole"
        moment = [1, 0, 0]
        field = [0, 0, { sweep = "field" }]
        [time]
        end = 1.0
        [output]
        snapshots = true
        initial = true
    "#;
    std::fs::write(workspace.path("study.toml"), text).expect("a file");
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--out", "out"]);
    let names = workspace.names("out");
    assert_eq!(names, ["cells.csv", "final.csv", "initial.csv", "plan.json", "report.json", "snapshots.csv"]);
    let cells = std::fs::read_to_string(workspace.path("out/cells.csv")).expect("a file");
    assert_eq!(cells, "cell,bodies,field\n0,2,0.00001\n1,2,0.00002\n2,2,0.00003\n");

    let states = States::read(&workspace.path("out/final.csv"));
    assert_eq!(states.column("cell"), [0.0, 1.0, 2.0, 0.0, 1.0, 2.0]);
    let mut initial = csv::Reader::from_path(workspace.path("out/initial.csv")).expect("a table");
    let header: Vec<String> = initial.headers().expect("a header").iter().map(str::to_owned).collect();
    let column =
        |name: &str| header.iter().position(|found| found == name).unwrap_or_else(|| panic!("{name}: {header:?}"));
    let rows: Vec<csv::StringRecord> = initial.records().map(|row| row.expect("a row")).collect();
    assert_eq!(rows.len(), 6);
    for (body, row) in rows.iter().enumerate() {
        let (cell, second) = (body % 3, body / 3 == 1);
        assert_eq!(&row[column("body")], body.to_string());
        assert_eq!(&row[column("cell")], cell.to_string());
        assert_eq!(&row[column("name")], if second { "B" } else { "A" });
        assert_eq!(&row[column("owner")], if second { "Z" } else { "X, Y" });
        let number = |name: &str| row[column(name)].parse::<f64>().expect("a number");
        assert_eq!(["i1", "i2", "i3"].map(number), if second { [1.0, 2.0, 2.5] } else { [1.0, 1.5, 2.0] });
        assert_eq!(["wx", "wy", "wz"].map(number), if second { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] });
        assert_eq!(number("torque[1].coefficient"), if second { 0.2 } else { 0.1 });
        assert_eq!(number("torque[2].field.z"), [1e-5, 2e-5, 3e-5][cell]);
    }

    // The same as arrays.
    let text = text.replace("initial = true", "initial = true\nformat = \"npz\"");
    std::fs::write(workspace.path("study.toml"), text).expect("a file");
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--out", "arrays"]);
    let out = workspace.path("arrays");
    assert_eq!(array::<u64>(&out, "snapshots", "cell"), [0, 1, 2, 0, 1, 2]);
    assert_eq!(array::<String>(&out, "initial", "owner"), ["X, Y", "X, Y", "X, Y", "Z", "Z", "Z"]);
    assert_eq!(array::<f64>(&out, "cells", "field"), [1e-5, 2e-5, 3e-5]);
}

/// An array of an archive, by another reader.
fn array<T: npyz::Deserialize>(folder: &Path, archive: &str, name: &str) -> Vec<T> {
    let file = std::fs::File::open(folder.join(format!("{archive}.npz"))).expect("an archive");
    let mut archive = zip::ZipArchive::new(file).expect("an archive");
    let entry = archive.by_name(&format!("{name}.npy")).expect("an array");
    npyz::NpyFile::new(entry).and_then(npyz::NpyFile::into_vec).expect("values")
}

#[test]
fn wrong_sweeps_are_refused_where_they_stand() {
    let refused = |from: &str, to: &str| {
        assert_eq!(SWEPT.matches(from).count(), 1, "{from}");
        let done = study(&SWEPT.replace(from, to)).and_then(|study| {
            let scene = study.scene()?;
            Plan::new(&scene, &Engine::cpu()).map(drop).map_err(|error| study.located(error))
        });
        let error = done.expect_err("the study should be refused");
        assert!(error.is_input(), "{error}");
        error.to_string()
    };
    for (from, to, message) in [
        (
            "{ sweep = \"drag\" }",
            "{ sweep = \"darg\" }",
            "study.toml:24: torque[1].coefficient.sweep = \"darg\": expected the name of a [[sweep]]: did you mean drag? known: drag, inclination, spread",
        ),
        (
            "{ sweep = \"drag\" }",
            "0.1",
            "study.toml:4: sweep[1].name = \"drag\": nothing is swept by it: expected { sweep = \"drag\" } in the place of a number",
        ),
        (
            "{ sweep = \"drag\" }",
            "{ sweep = \"inclination\" }",
            "study.toml:24: torque[1].coefficient = { sweep = \"inclination\" }: deg is a unit of angle: expected a unit of angular momentum or damping",
        ),
        (
            "end = 10.0",
            "end = { sweep = \"drag\" }",
            "study.toml:30: time.end = { sweep = \"drag\" }: expected a number: all bodies share this one, so it cannot be swept within a run",
        ),
        (
            "values = [0.0, 0.01, 0.1]",
            "values = [0.0, \"1 N m s\"]",
            "study.toml:5: sweep[1].values = \"1 N m s\": expected numbers that all have a unit, or none",
        ),
        (
            "to = \"90 deg\"",
            "to = \"90 km\"",
            "study.toml:9: sweep[2].to = \"90 km\": expected a unit that measures the same as deg",
        ),
        (
            "count = 4",
            "count = 1",
            "study.toml:10: sweep[2].count = 1: expected the number of values, both ends among them: 2 to 1,048,576",
        ),
        ("count = 4", "count = 1000000", "study.toml:3: sweep: expected at most 1,048,576 cells in all"),
        (
            "from = 0.01",
            "from = 0.0",
            "study.toml:13: sweep[3].from = 0.0: expected a number above zero, as the scale is logarithmic",
        ),
        ("name = \"spread\"", "name = \"drag\"", "study.toml:12: sweep[3].name = \"drag\": expected each name once"),
        (
            "sigma = { sweep = \"spread\" }",
            "sigma = { sweep = \"inclination\" }",
            "study.toml:21: bodies.angular_velocity.sigma = { sweep = \"inclination\" }: deg is a unit of angle: expected a unit of angular velocity",
        ),
        (
            "[time]",
            "[design]\npoints = 3\n[time]",
            "study.toml:30: design.points = 3: the cells of a grid follow from its axes",
        ),
        (
            "[time]",
            "[design]\nkind = \"sobol\"\npoints = 16\n[time]",
            "study.toml:10: sweep[2].count = 4: the design takes points between the ends: leave it out",
        ),
        (
            "[time]",
            "[design]\nkind = \"sobol\"\n[time]",
            "study.toml:29: design.points is missing: expected the number of cells",
        ),
    ] {
        let found = refused(from, to);
        assert!(found.starts_with(message) && !found.contains('\n'), "{found}\nnot {message}");
    }
    // A value that a parameter may not have is refused in its own words.
    let message = refused("values = [0.0, 0.01, 0.1]", "values = [0.0, -0.01]");
    assert!(
        message.starts_with("study.toml:24: torque[1].coefficient: body 12: coefficient = -0.01: expected"),
        "{message}"
    );
    let unswept =
        "[bodies]\ncount = 1\ninertia = [1, 1, { sweep = \"x\" }]\nangular_velocity = [0, 0, 1]\n[time]\nend = 1.0\n";
    let message = study(unswept).expect_err("no sweep").to_string();
    assert_eq!(
        message,
        "study.toml:3: bodies.inertia.sweep = \"x\": the study has no [[sweep]] of this name, and no other"
    );
}

#[test]
fn designs_of_points_sweep_what_grids_do() {
    for kind in ["latin-hypercube", "sobol"] {
        let text = SWEPT.replace("count = 4\n", "").replace("count = 3\n", "").replace("count = 5\n", "count = 1\n")
            + &format!("[design]\nkind = \"{kind}\"\npoints = 24\n");
        let study = study(&text).expect("a study");
        let design = study.design().expect("a sweep");
        assert_eq!((design.cells(), study.scene().expect("a scene").ensemble().len()), (24, 24));
        let [drag, inclination, spread] = design.axes() else { panic!("{:?}", design.axes()) };
        for value in [0.0, 0.01, 0.1] {
            let times = drag.values().iter().filter(|x| **x == value).count();
            assert!((7..=9).contains(&times), "{kind}: {value} {times} times");
        }
        assert!(inclination.values().iter().all(|x| (0.0..std::f64::consts::FRAC_PI_2).contains(x)));
        // As many points in each decade.
        let low = spread.values().iter().filter(|x| **x < 0.1).count();
        assert!((11..=13).contains(&low), "{kind}: {low}");
    }
}

/// A study whose table of bodies has a further column; `carry` and what is written are to be filled in.
fn carrying(carry: &str, output: &str) -> String {
    format!("[bodies]\nfile = \"bodies.csv\"\ncarry = {carry}\n[time]\nend = 1.0\n[output]\ninitial = true\n{output}")
}

/// NumPy takes names as code page 437 unless bit 11 says that they are UTF-8.
#[test]
fn names_of_arrays_that_are_not_ascii_are_marked_as_utf_8() {
    let workspace = Workspace::new(&carrying("[\"größe\"]", "format = \"npz\"\n"));
    std::fs::write(workspace.path("bodies.csv"), "ixx,iyy,izz,wx,wy,wz,größe\n1,1.5,2,0,0,1,klein\n").expect("a file");
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet", "--out", "out"]);
    let bytes = std::fs::read(workspace.path("out/initial.npz")).expect("an archive");
    let flags = |signature: &[u8], flags_at: usize, name_at: usize, name: &str| {
        let found: Vec<u16> = (0..bytes.len() - name_at - name.len())
            .filter(|&at| bytes[at..].starts_with(signature) && bytes[at + name_at..].starts_with(name.as_bytes()))
            .map(|at| u16::from_le_bytes([bytes[at + flags_at], bytes[at + flags_at + 1]]))
            .collect();
        found
    };
    for (name, expected) in [("größe.npy", 1 << 11), ("wx.npy", 0)] {
        assert_eq!(flags(b"PK\x03\x04", 6, 30, name), [expected], "{name}, local");
        assert_eq!(flags(b"PK\x01\x02", 8, 46, name), [expected], "{name}, central");
    }
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(&bytes)).expect("an archive");
    assert!(archive.by_name("größe.npy").is_ok());
}

/// A column that is carried has a name of its own in the table of initial states, in a sweep and of bodies that translate too.
#[test]
fn carried_columns_with_the_name_of_another_are_refused() {
    let sweep = "[[sweep]]\nname = \"drag\"\nvalues = [0.1, 0.2]\n[[torque]]\nmodel = \"linear-drag\"\n\
                 coefficient = { sweep = \"drag\" }\n";
    let rows = "ixx,iyy,izz,qx,qy,qz,qw,wx,wy,wz,x,y,z,vx,vy,vz,mass,owner\n1,1.5,2,0,0,0,1,0,0,1,0,0,0,0,0,0,1,A\n";
    let workspace = Workspace::new(&format!("{sweep}{}", carrying("[\"owner\"]", "")));
    std::fs::write(workspace.path("bodies.csv"), rows).expect("a file");
    let run = ["run", "study.toml", "--engine", "cpu", "--quiet", "--out", "out"];
    workspace.done(&run);
    let mut initial = csv::Reader::from_path(workspace.path("out/initial.csv")).expect("a table");
    let header: Vec<String> = initial.headers().expect("a header").iter().map(str::to_owned).collect();
    assert!(header.len() > 25 && header.iter().any(|name| name == "torque[1].coefficient"), "{header:?}");
    for format in ["", "format = \"parquet\"\n"] {
        for name in header.iter().filter(|name| *name != "owner") {
            std::fs::write(
                workspace.path("study.toml"),
                format!("{sweep}{}", carrying(&format!("[\"owner\", \"{name}\"]"), format)),
            )
            .expect("a file");
            // A table of bodies need not have it.
            let table = if rows.split(',').any(|own| own == name) { rows.to_owned() } else { with_column(rows, name) };
            std::fs::write(workspace.path("bodies.csv"), table).expect("a file");
            let error = workspace.refused(&[&run[..], &["--force"]].concat(), 2);
            let expected = format!("study.toml:9: bodies.carry = \"{name}\": expected another column: the table of");
            assert!(error.contains(&expected), "{error}");
        }
    }
    for (carry, table, word) in [
        (
            "[\"owner\", \"owner\"]",
            rows.to_owned(),
            "study.toml:3: bodies.carry = \"owner\": expected each column once",
        ),
        ("[\"owner\"]", with_column(rows, "owner"), "bodies.csv:1: owner: this column occurs twice in the header"),
    ] {
        std::fs::write(workspace.path("study.toml"), carrying(carry, "")).expect("a file");
        std::fs::write(workspace.path("bodies.csv"), table).expect("a file");
        let error = workspace.refused(&[&run[..], &["--force"]].concat(), 2);
        assert!(error.contains(word), "{error}");
    }
}

/// A table of one row with another column.
fn with_column(rows: &str, name: &str) -> String {
    let (header, row) = rows.trim_end().split_once('\n').expect("a header and a row");
    format!("{header},{name}\n{row},7\n")
}
