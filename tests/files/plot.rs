//! Pictures: axes with units, a caption that says where the figures come from, files that can be read.
#![cfg(feature = "plot")]

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use polhode::bench::provenance::Provenance;
use polhode::bench::{Bench, accuracy};
use polhode::engine::Engine;
use polhode::plot::figure::{Axis, Figure, Item, Panel, Style};
use polhode::plot::{draw, plot_folder};

const COMMAND: &str = "polhode bench accuracy --quick --filter drag/cpu/rk";

/// The pictures of a few rows.
fn pictures(folder: &Path) -> Vec<PathBuf> {
    let bench = Bench {
        quick: true,
        filter: Some("drag/cpu/rk".to_owned()),
        resume: false,
        engines: vec![Engine::cpu()],
        provenance: Provenance::collect(COMMAND),
    };
    accuracy::run(&bench, folder, &mut |_| ControlFlow::Continue(())).expect("measured");
    plot_folder(folder, &[]).expect("drawn")
}

#[test]
fn a_folder_that_is_not_there_is_named() {
    let error = plot_folder(Path::new("nowhere/at-all"), &[]).expect_err("refused").to_string();
    assert!(error.starts_with("nowhere/at-all: cannot be read"), "{error}");
}

/// Width and height of a PNG file, and its pixels as RGB.
fn decoded(path: &Path) -> (u32, u32, Vec<u8>) {
    let file = std::io::BufReader::new(std::fs::File::open(path).expect("a file"));
    let mut reader = png::Decoder::new(file).read_info().expect("a PNG file");
    let mut pixels = vec![0; reader.output_buffer_size().expect("a size")];
    let frame = reader.next_frame(&mut pixels).expect("pixels");
    (frame.width, frame.height, pixels)
}

#[test]
fn a_work_precision_diagram_names_axes_units_command_and_commit() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = pictures(folder.path());
    let names: Vec<_> = files.iter().map(|file| file.file_name().expect("a name").to_string_lossy()).collect();
    assert_eq!(names, ["accuracy-cpu.svg", "accuracy-cpu.png"]);
    let svg = std::fs::read_to_string(&files[0]).expect("a file");
    let words = svg.split_whitespace().collect::<Vec<_>>().join(" ");
    for text in [
        "attitude error, 99th percentile (rad)",
        "compute time (s)",
        "drag, 10 s",
        "implicit_midpoint",
        "Pareto front",
        "10⁻",
        "commit",
        "--filter drag/cpu/rk",
    ] {
        assert!(words.contains(text), "{text}");
    }
    let (width, height, pixels) = decoded(&files[1]);
    assert!(width >= 1600 && height > 500, "{width} x {height}");
    // Text is set in black on white whatever fonts the system has: the caption's strip at the foot is not empty.
    let foot = &pixels[pixels.len() - (3 * width * height / 12) as usize..];
    assert!(foot.iter().filter(|&&byte| byte < 64).count() > 1000, "there is no caption");
}

#[test]
fn an_empty_folder_gives_no_pictures() {
    let folder = tempfile::tempdir().expect("a folder");
    assert_eq!(plot_folder(folder.path(), &[]).expect("read"), Vec::<PathBuf>::new());
}

#[test]
fn what_is_not_finite_or_has_no_logarithm_is_left_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let points = vec![(1e-3, 1.0), (f64::NAN, 2.0), (0.0, 1.0), (1e-2, f64::INFINITY), (1e-1, 10.0)];
    let items =
        vec![Item::Curve { points, style: Style::nth(0) }, Item::Curve { points: vec![], style: Style::nth(1) }];
    let (x, y) = (Axis::log("x (s)"), Axis::linear("y (m)"));
    let panel = Panel { title: "a".to_owned(), x, y, items, equal: false };
    let constant = Panel {
        items: vec![Item::Curve { points: vec![(1.0, 0.0), (2.0, 0.0)], style: Style::nth(2) }],
        ..panel.clone()
    };
    let nothing = Panel { items: Vec::new(), ..panel.clone() };
    let figure = Figure { columns: 2, panels: vec![panel, constant, nothing], ..Figure::default() };
    let path = folder.path().join("a.svg");
    draw(&figure, &path).expect("drawn");
    let svg = std::fs::read_to_string(path).expect("a file");
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
    assert!(svg.contains("y (m)"));
}

#[test]
fn a_run_is_drawn_with_its_bodies() {
    use glam::{DQuat, DVec3};
    use polhode::record::OutputFolder;
    use polhode::run::run_to_folder;
    use polhode::study::Output;
    use polhode::{Ensemble, Method, Outputs, Plan, Scene, Statistic, Torque};

    let workspace = tempfile::tempdir().expect("a folder");
    let moments = DVec3::new(1.0, 2.0, 3.0);
    let spins = [DVec3::new(0.1, 2.0, 0.1), DVec3::new(0.0, 0.0, 1.0), DVec3::new(1.0, 1.0, 1.0)];
    let ensemble = Ensemble::from_fn(3, |body| (moments, DQuat::IDENTITY, spins[body])).expect("valid bodies");
    let scene = Scene::new(ensemble).until(20.0).outputs(Outputs::Every(0.05)).pinned(Method::Rk4, 0.05, None);
    let scene = scene.statistics([Statistic::SpinRate, Statistic::KineticEnergy]);
    let engine = Engine::cpu();
    let run = |scene: &Scene, name: &str| {
        let folder = workspace.path().join(name);
        let plan = Plan::new(scene, &engine).expect("a plan");
        let output = Output { final_state: false, snapshots: true, ..Output::default() };
        let place = OutputFolder::create(&folder, false).expect("a folder");
        let since = std::time::Instant::now();
        run_to_folder(&engine, &plan, None, &output, place, since, &mut |_| ControlFlow::Continue(())).expect("run");
        folder
    };

    let files = plot_folder(&run(&scene, "out"), &[0, 1]).expect("drawn");
    let names: Vec<_> = files.iter().map(|file| file.file_name().expect("a name").to_string_lossy()).collect();
    let expected = [
        "run.svg",
        "run.png",
        "run-body-0.svg",
        "run-body-0.png",
        "run-body-1.svg",
        "run-body-1.png",
        "statistics.svg",
        "statistics.png",
        "means.svg",
        "means.png",
    ];
    assert_eq!(names, expected);
    let words =
        |file: &Path| std::fs::read_to_string(file).expect("a file").split_whitespace().collect::<Vec<_>>().join(" ");
    let ensemble = words(&files[0]);
    let drifts = ["drift of the kinetic energy", "drift of the angular momentum"];
    for text in ["time (s)", "|ω| (rad/s)", "rk4 in f64", "bodies", drifts[0], drifts[1], "drift: median"] {
        assert!(ensemble.contains(text), "{text}");
    }
    // What torques change is no drift.
    let damped = scene.clone().torque(Torque::internal_dissipation(0.01));
    let driven = scene.clone().torque(Torque::linear_drag(vec![0.0, 0.1, 0.1]));
    for (scene, name, drawn) in [(damped, "damped", [false, true]), (driven, "driven", [false, false])] {
        let picture = words(&plot_folder(&run(&scene, name), &[]).expect("drawn")[0]);
        assert_eq!(drifts.map(|text| picture.contains(text)), drawn, "{name}");
        assert_eq!(picture.contains("drift: median"), drawn[1], "{name}");
    }
    let statistics = words(&files[6]);
    for text in ["spin rate (rad/s)", "kinetic energy (J)", "one standard deviation", "rk4 in f64"] {
        assert!(statistics.contains(text), "{text}");
    }
    let body = words(&files[2]);
    for text in ["polhode on the inertia ellipsoid (body axes)", "herpolhode", "ω across L (rad/s)"] {
        assert!(body.contains(text), "{text}");
    }
    // The states of a steady rotation do not tell the tensor, so there is no ellipsoid to draw.
    assert!(!words(&files[4]).contains("inertia ellipsoid"));
}

/// Runs a study into `folder`.
fn run_study(study: &polhode::study::Study, folder: &Path) {
    let scene = study.scene().expect("a scene");
    let engine = Engine::cpu();
    let plan = polhode::Plan::new(&scene, &engine).expect("a plan");
    let place = polhode::record::OutputFolder::create(folder, true).expect("a folder");
    let since = std::time::Instant::now();
    let go_on = &mut |_| ControlFlow::Continue(());
    polhode::run::run_to_folder(&engine, &plan, Some(study), study.output(), place, since, go_on).expect("a run");
}

/// One body a cell of those that sweep, a few of the others; every picture has the study's title, and none is too large to be read.
#[test]
fn there_is_a_picture_of_every_shipped_study() {
    const LARGEST: u64 = 1_000_000;
    let studies = format!("{}/examples/studies", env!("CARGO_MANIFEST_DIR"));
    let workspace = tempfile::tempdir().expect("a folder");
    let mut maps = Vec::new();
    for entry in std::fs::read_dir(studies).expect("the studies") {
        let file = entry.expect("an entry").path();
        if file.extension().is_none_or(|ending| ending != "toml") {
            continue;
        }
        let study = polhode::study::Study::read(&file).expect("a study");
        let bodies = study.design().map_or(4, |design| design.cells());
        let study = study.truncated(bodies);
        let name = file.file_stem().expect("a name").to_string_lossy().into_owned();
        let folder = workspace.path().join(&name);
        run_study(&study, &folder);
        let files = plot_folder(&folder, &[]).expect("drawn");
        assert!(!files.is_empty(), "{name}");
        for file in &files {
            let size = std::fs::metadata(file).expect("a file").len();
            assert!(size > 2000 && size < LARGEST, "{}: {size} bytes", file.display());
            if file.extension().is_some_and(|ending| ending == "svg") {
                let svg = std::fs::read_to_string(file).expect("a file");
                let title = study.title().expect("a title").replace('\'', "&apos;");
                assert!(svg.contains(&title), "{}", file.display());
            }
        }
        if files.iter().any(|file| file.ends_with("map.svg")) {
            maps.push(name);
        }
    }
    maps.sort();
    assert_eq!(maps, ["captures", "hyperion"]);
}

const SWEPT: &str = r#"
title = "A sweep"
[[sweep]]
name = "drag"
values = ["1 N m s", "2 N m s", "4 N m s"]
[[sweep]]
name = "spin"
from = "0 deg/s"
to = "60 deg/s"
count = 3
[bodies]
count = 3
inertia = [1, 2, 2.5]
angular_velocity = [0, { sweep = "spin" }, 0.01]
[[torque]]
model = "linear-drag"
coefficient = { sweep = "drag" }
[time]
end = 2.0
outputs = { every = 0.25, start = true }
[output]
snapshots = true
statistics = ["spin_rate"]
quantiles = [50]
[[histogram]]
quantity = "spin_rate"
low = 0
high = 2
[[event]]
name = "slow, or \"stopped\""
quantity = "spin_rate"
below = 0.2
"#;

fn study(text: &str) -> polhode::study::Study {
    polhode::study::Study::parse(Path::new("study.toml"), text).expect("a study")
}

/// Tables of either format make the same pictures, and a map has the units of its axes.
#[test]
fn pictures_do_not_depend_on_the_format() {
    let workspace = tempfile::tempdir().expect("a folder");
    let pictures = |name: &str, text: &str| {
        let folder = workspace.path().join(name);
        run_study(&study(text), &folder);
        let bodies = if text.contains("snapshots = true") { &[0][..] } else { &[] };
        let files = plot_folder(&folder, bodies).expect("drawn");
        let svg = files.iter().filter(|file| file.extension().is_some_and(|ending| ending == "svg"));
        let named = svg
            .map(|file| (file.file_name().expect("a name").to_owned(), std::fs::read_to_string(file).expect("a file")));
        named.collect::<Vec<_>>()
    };
    for text in [SWEPT.to_owned(), SWEPT.replace("snapshots = true", "snapshots = false")] {
        let csv = pictures("csv", &text);
        let npz = pictures("npz", &text.replace("quantiles", "format = \"npz\"\nquantiles"));
        let names: Vec<_> = csv.iter().map(|(name, _)| name.to_string_lossy().into_owned()).collect();
        let first = if text.contains("snapshots = true") { &["run.svg", "run-body-0.svg"][..] } else { &["final.svg"] };
        assert_eq!(
            names,
            [first, &["statistics.svg", "means.svg", "means_by_cell.svg", "histograms.svg", "survival.svg", "map.svg"]]
                .concat()
        );
        assert!(csv == npz, "{names:?}");
        let map = &csv.last().expect("a map").1;
        for label in
            ["drag (kg m² s⁻¹)", "spin (rad s⁻¹)", "share by the end", "mean time", "spin rate: mean at the end"]
        {
            assert!(map.contains(label), "{label}");
        }
        // A cell has the values of the axes, not its number.
        let survival = &csv[csv.len() - 2].1;
        for label in ["drag = 1 kg m² s⁻¹, spin = 0 rad s⁻¹", "drag = 4 kg m² s⁻¹, spin = 1.047"] {
            assert!(survival.contains(label), "{label}");
        }
        assert!(!survival.contains("cell "));
        // All of them give way to the next run.
        run_study(&study(&text), &workspace.path().join("csv"));
        let left = std::fs::read_dir(workspace.path().join("csv")).expect("a folder");
        let left = left.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
        let pictures: Vec<String> = left.filter(|name| name.ends_with("svg") || name.ends_with("png")).collect();
        assert!(pictures.is_empty(), "{pictures:?}");
    }
}

/// Many cells along one axis are drawn over it, and so are few at a single time; cells without a mean leave a gap, and a single cell has no
/// picture.
#[test]
fn means_of_cells_are_drawn_over_the_only_axis() {
    let workspace = tempfile::tempdir().expect("a folder");
    let text = |count: usize, outputs: &str| {
        format!(
            "[[sweep]]\nname = \"drag\"\nfrom = 0.1\nto = 10.0\ncount = {count}\nscale = \"logarithmic\"\n[bodies]\ncount = 4\n\
             inertia = [1, 2, 2.5]\nangular_velocity = {{ distribution = \"normal\", mean = 0.0, sigma = 1.0 }}\n\
             [[torque]]\nmodel = \"linear-drag\"\ncoefficient = {{ sweep = \"drag\" }}\n[time]\nend = 1.0\n{outputs}\n\
             [output]\nfinal = false\nstatistics = [\"spin_rate\"]\nquantiles = [5, 95]\n"
        )
    };
    let picture = |name: &str| {
        let folder = workspace.path().join(name);
        plot_folder(&folder, &[]).expect("drawn");
        std::fs::read_to_string(folder.join("means_by_cell.svg"))
    };
    let drawn = |name: &str, text: &str| {
        run_study(&study(text), &workspace.path().join(name));
        picture(name)
    };
    let bands = |svg: &str| svg.matches("<polygon").count();
    for (name, text) in [("many", text(13, "outputs = { every = 0.25 }")), ("once", text(3, ""))] {
        let svg = drawn(name, &text).expect("a picture");
        for label in ["drag", "mean at the end; band: one standard deviation", "quantiles"] {
            assert!(svg.contains(label), "{name}: {label}");
        }
        assert!(!svg.contains("time (s)"), "{name}");
    }
    // Half of the bodies are slow after a time that falls with the drag; the least does not slow them down by the end.
    let event = "[[event]]\nname = \"slow\"\nquantity = \"spin_rate\"\nbelow = 0.5\n";
    drawn("slow", &(text(13, "outputs = { every = 0.25 }") + event)).expect("a picture");
    let times = std::fs::read_to_string(workspace.path().join("slow/times_by_cell.svg")).expect("a picture");
    for label in ["slow", "drag", "time (", "when half of the bodies had it; band: 95 % confidence interval"] {
        assert!(times.contains(label), "{label}");
    }
    assert!(bands(&times) > 0);
    let over_time = drawn("few", &text(3, "outputs = { every = 0.25 }")).expect("a picture");
    assert!(!workspace.path().join("few/times_by_cell.svg").exists(), "no event");
    assert!(over_time.contains("time (s)") && over_time.contains("drag = 0.1") && over_time.contains("drag = 10"));
    let grid = text(13, "").replace("[bodies]", "[[sweep]]\nname = \"spin\"\nvalues = [1, 2]\n[bodies]");
    let grid = grid.replace("sigma = 1.0", "sigma = { sweep = \"spin\" }");
    assert!(drawn("grid", &grid).expect("a picture").contains("mean of 26 cells"));
    let one = text(2, "").replace("from = 0.1\nto = 10.0\ncount = 2\nscale = \"logarithmic\"", "values = [0.5]");
    assert!(drawn("one", &one).is_err(), "one cell");

    let whole = bands(&picture("many").expect("a picture"));
    let path = workspace.path().join("many/statistics_by_cell.csv");
    let table = std::fs::read_to_string(&path).expect("a table");
    let without = |(row, line): (usize, &str)| match line.split(',').nth(1) {
        // The last output time.
        Some(cell @ "5") if row > 3 * 13 => format!("1.0,{cell},0{}", ",NaN".repeat(line.matches(',').count() - 2)),
        _ => line.to_owned(),
    };
    let gap: Vec<String> = table.lines().enumerate().map(without).collect();
    std::fs::write(&path, gap.join("\n") + "\n").expect("written");
    assert_eq!(bands(&picture("many").expect("a picture")), whole + 1);
    // A row that is missing, or of a cell that is not in turn, is no reason to draw another's.
    for spoilt in [&gap[..gap.len() - 1].join("\n"), &gap.join("\n").replace("1.0,5,", "1.0,50,")] {
        std::fs::write(&path, format!("{spoilt}\n")).expect("written");
        let error = plot_folder(&workspace.path().join("many"), &[]).expect_err("spoilt").to_string();
        assert!(error.contains("expected a row for each cell at each output time"), "{error}");
    }
}

/// A map is of a full grid of two axes.
#[test]
fn other_designs_have_no_map() {
    let workspace = tempfile::tempdir().expect("a folder");
    let sobol = SWEPT.replace("count = 3\n[bodies]", "[design]\nkind = \"sobol\"\npoints = 9\n[bodies]");
    run_study(&study(&sobol), &workspace.path().join("out"));
    let files = plot_folder(&workspace.path().join("out"), &[]).expect("drawn");
    assert!(files.iter().any(|file| file.ends_with("survival.svg")));
    assert!(!files.iter().any(|file| file.ends_with("map.svg")));
}

/// Tables of states of a study that sweeps have the cell in the midst of them or at their end.
#[test]
fn states_of_a_sweep_are_read_again() {
    let workspace = tempfile::tempdir().expect("a folder");
    let mut tables = ["csv", "npz"].map(|format| {
        let text = SWEPT.replace("quantiles", &format!("format = \"{format}\"\nquantiles"));
        let folder = workspace.path().join(format);
        run_study(&study(&text), &folder);
        polhode::record::StateTable::open(&folder.join(format!("snapshots.{format}"))).expect("a table")
    });
    let [csv, npz] = tables.each_mut().map(|table| table.read(0, 1000).expect("rows"));
    assert_eq!(csv.len(), 9 * 27);
    for (a, b) in csv.iter().zip(&npz) {
        let of = |row: &polhode::record::StateRow| (row.body, row.time, row.state.rotation.angular_velocity_body);
        assert_eq!(of(a), of(b));
    }
}
