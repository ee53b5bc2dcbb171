//! Units behind numbers of studies.

#![cfg(feature = "cli")]

use std::path::Path;

use polhode::Plan;
use polhode::engine::Engine;
use polhode::study::Study;
use polhode::torque::orbit::drift::{EARTH_EQUATORIAL_RADIUS, EARTH_J2};
use polhode::torque::{Orbit, Torque};

use crate::workspace::Workspace;

/// A study in which every kind of number is written in SI units, and the same in others.
const SI: &str = r#"
    [orbit]
    mu = 398600441800000.0
    radius = 6878000.0
    inclination = 0.5235987755982989
    [bodies]
    count = 3
    inertia = { shape = "cylinder", mass = 2.5, radius = 0.25, height = 0.5 }
    orientation = { axis = [0, 0, 1], angle = 0.7853981633974483 }
    angular_velocity = { distribution = "normal", mean = [0.0, 0.0, 0.20943951023931956], sigma = 0.017453292519943295 }
    position = [7000000.0, 0.0, 0.0]
    velocity = { distribution = "direction", magnitude = 7500.0 }
    [[torque]]
    model = "gravity-gradient"
    [[torque]]
    model = "linear-drag"
    coefficient = 0.001
    [[torque]]
    model = "magnetic-dipole"
    moment = [0.01, 0.0, 0.0]
    field = [2.5e-5, 0.0, 0.0]
    [[torque]]
    model = "custom"
    parameters = { k = 0.003 }
    torque = "-k * angular_velocity"
    [time]
    end = 5400.0
    outputs = { every = 1800.0 }
    [accuracy]
    attitude = 4.84813681109536e-6
"#;

const OTHERS: [(&str, &str); 18] = [
    ("398600441800000.0", "\"398600.4418 km³/s²\""),
    ("6878000.0", "\"6878 km\""),
    ("0.5235987755982989", "\"30 deg\""),
    ("mass = 2.5", "mass = \"2500 g\""),
    ("radius = 0.25", "radius = \"25 cm\""),
    ("height = 0.5", "height = \"500 mm\""),
    ("0.7853981633974483", "\"45°\""),
    ("0.20943951023931956", "\"2 rpm\""),
    ("0.017453292519943295", "\"1 deg/s\""),
    ("[7000000.0, 0.0, 0.0]", "[\"7000 km\", 0, \"0 km\"]"),
    ("7500.0", "\"7.5 km/s\""),
    ("coefficient = 0.001", "coefficient = \"1 mN m/(rad/s)\""),
    ("[0.01, 0.0, 0.0]", "[\"10 mA m^2\", 0, 0]"),
    ("[2.5e-5, 0.0, 0.0]", "[\"25 µT\", \"0 nT\", 0]"),
    ("k = 0.003", "k = \"3 mN m s\""),
    ("5400.0", "\"1.5 h\""),
    ("1800.0", "\"30 min\""),
    ("4.84813681109536e-6", "\"1 arcsec\""),
];

#[test]
fn numbers_with_units_are_those_without_to_the_bit() {
    let mut text = SI.to_owned();
    for (number, with_unit) in OTHERS {
        assert_eq!(text.matches(number).count(), 1, "{number}");
        text = text.replace(number, with_unit);
    }
    let scene =
        |text: &str| Study::parse(Path::new("study.toml"), text).and_then(|study| study.scene()).expect("a study");
    let (plain, with_units) = (scene(SI), scene(&text));
    assert_eq!(plain.ensemble(), with_units.ensemble());
    assert_eq!(plain.torques(), with_units.torques());
    assert_eq!(plain.stepping(), with_units.stepping());
    assert_eq!((plain.end(), plain.output_times()), (with_units.end(), with_units.output_times()));
}

/// The message for a study with one text replaced.
fn refusal(from: &str, to: &str) -> String {
    assert_eq!(SI.matches(from).count(), 1, "{from}");
    let text = SI.replace(from, to);
    let done = Study::parse(Path::new("study.toml"), &text).and_then(|study| {
        let scene = study.scene()?;
        Plan::new(&scene, &Engine::cpu()).map(drop).map_err(|error| study.located(error))
    });
    let error = done.expect_err("the study should be refused");
    assert!(error.is_input(), "{error}");
    error.to_string()
}

#[test]
fn units_of_other_dimensions_are_refused_and_unknown_ones_get_the_nearest() {
    for (from, to, message) in [
        (
            "5400.0",
            "\"90 mins\"",
            "study.toml:27: time.end = \"90 mins\": unknown unit mins: did you mean min? known units, those of the SI also with prefixes: g, t, u, lb, m,",
        ),
        (
            "5400.0",
            "\"90 sec\"",
            "study.toml:27: time.end = \"90 sec\": unknown unit sec: did you mean s? known units, those of the SI also with prefixes: g, t, u, lb, m,",
        ),
        (
            "5400.0",
            "\"90 km\"",
            "study.toml:27: time.end = \"90 km\": km is a unit of length: expected a unit of time, such as s, ms, min, h, d",
        ),
        (
            "0.20943951023931956",
            "\"2 Hz\"",
            "study.toml:10: bodies.angular_velocity.mean = \"2 Hz\": Hz is a unit of frequency: expected a unit of angular velocity, such as rad/s, deg/s, rpm, rev/d",
        ),
        (
            "0.7853981633974483",
            "\"45 %\"",
            "study.toml:9: bodies.orientation.angle = \"45 %\": % is a unit of a plain number: expected a unit of angle, such as rad, deg, arcmin, arcsec, rev",
        ),
        (
            "coefficient = 0.001",
            "coefficient = \"1 N s/m\"",
            "study.toml:17: torque[2].coefficient = \"1 N s/m\": the unit N s/m does not fit: expected a unit of angular momentum or damping, such as kg m²/s, N m s",
        ),
        (
            "mass = 2.5",
            "mass = \"2.5\"",
            "study.toml:8: bodies.inertia.mass = \"2.5\": expected a unit after the number, such as deg, rpm, km, kg m² or N m/(rad/s)",
        ),
        (
            "    radius = 6878000.0",
            "    semi_major_axis = 6878000.0\n    eccentricity = \"3 deg\"",
            "study.toml:5: orbit.eccentricity = \"3 deg\": deg is a unit of angle: expected a number without a unit, or in %",
        ),
        (
            "attitude = 4.84813681109536e-6",
            "method = \"rk8\"\ntolerance = \"1e-9 rad\"",
            "study.toml:31: accuracy.tolerance = \"1e-9 rad\": expected a number above 0 and below 1",
        ),
        ("5400.0", "\"1e308 yr\"", "study.toml:27: time.end = \"1e308 yr\": expected a finite number (s)"),
    ] {
        let found = refusal(from, to);
        assert!(found.starts_with(message) && !found.contains('\n'), "{found}\nnot {message}");
    }
}

#[test]
fn an_orbit_that_is_stated_once_is_that_of_all_torques() {
    let own = "\n    mu = 398600441800000.0\n    orbit = { radius = 6878000.0, inclination = 0.5235987755982989 }";
    let orbit = "[orbit]\n    mu = 398600441800000.0\n    radius = 6878000.0\n    inclination = 0.5235987755982989\n";
    let text = SI.replace(orbit, "").replace("\"gravity-gradient\"", &format!("\"gravity-gradient\"{own}"));
    let scene =
        |text: &str| Study::parse(Path::new("study.toml"), text).and_then(|study| study.scene()).expect("a study");
    assert_eq!(scene(SI).torques(), scene(&text).torques());

    // Drawn elements are the same for all torques.
    let drawn = SI.replace(
        "radius = 6878000.0",
        "radius = { distribution = \"uniform\", low = \"6700 km\", high = \"7000 km\" }",
    );
    let second =
        "    [[torque]]\n    model = \"orbiting-dipole\"\n    moment = [0.01, 0, 0]\n    strength = 7.8e15\n    [time]";
    let scene = scene(&drawn.replace("    [time]", second));
    let radii = |torque: usize| scene.torques()[torque].parameter("orbit.semi_major_axis").cloned().expect("an orbit");
    assert_eq!(radii(0), radii(4));
    assert!(!radii(0).is_shared());

    // So is how it drifts; where the radius is left out it is the Earth's.
    let drifting = SI.replace("radius = 6878000.0", "radius = \"6878 km\"\n    j2 = 1.0826267e-3");
    let scene = Study::parse(Path::new("study.toml"), &drifting).and_then(|study| study.scene()).expect("a study");
    let expected = Orbit::circular(398_600_441_800_000.0, 6_878_000.0)
        .inclined(std::f64::consts::FRAC_PI_6)
        .with_j2(EARTH_J2, EARTH_EQUATORIAL_RADIUS);
    assert_eq!(scene.torques()[0], Torque::gravity_gradient(expected));

    // Angles with a unit may be any, others up to a turn, with weights that are no angles; without J2 no radius is known.
    for (from, to) in [
        ("0.5235987755982989", "\"460 deg\""),
        ("0.5235987755982989", "-6.283185307179586"),
        ("0.5235987755982989", "{ distribution = \"mixture\", weights = [10, 90], of = [0.1, \"97 deg\"] }"),
        ("radius = 6878000.0", "radius = 1.8e6"),
        ("radius = 6878000.0", "radius = 1.8e6\n    j2 = 0"),
        ("radius = 6878000.0", "radius = 1.8e6\n    j2 = 2e-4\n    equatorial_radius = 1.738e6"),
    ] {
        let text = SI.replace(from, to);
        let scene = Study::parse(Path::new("study.toml"), &text).and_then(|study| study.scene());
        assert!(scene.is_ok(), "{to}: {:?}", scene.err());
    }
    // In Rust an orbit that drifts has its ellipse outside the centre on the whole: a (1 − e²) counts.
    let within = Torque::gravity_gradient(Orbit::circular(398_600_441_800_000.0, 6.878e6).with_j2(EARTH_J2, 7e6));
    let scene = polhode::Scene::new(scene.ensemble().clone()).torque(within).until(1.0);
    let error = Plan::new(&scene, &Engine::cpu()).map(drop).expect_err("within its centre").to_string();
    assert!(error.contains("orbit.equatorial_radius = 7000000: expected at most a (1 − e²)"), "{error}");

    for (from, to, message) in [
        (
            "radius = 6878000.0",
            "radius = 6878000.0\n    j2 = 1e-3\n    equatorial_radius = \"7000 km\"",
            "study.toml:4: orbit.radius = 6878000.0: expected at least the equatorial radius of the central body, 7000000 m",
        ),
        (
            "radius = 6878000.0",
            "radius = 6878.0\n    j2 = 1e-3",
            "study.toml:4: orbit.radius = 6878.0: expected at least the equatorial radius of the central body, 6378136.3 m",
        ),
        (
            "    radius = 6878000.0",
            "    semi_major_axis = 8e6\n    eccentricity = 0.25\n    equatorial_radius = 6.5e6",
            "study.toml:4: orbit.semi_major_axis = 8000000.0: expected a pericentre, here 6000000 m, of at least the equatorial radius of the central body, 6500000 m",
        ),
        (
            "inclination = 0.5235987755982989",
            "inclination = 97.4",
            "study.toml:5: orbit.inclination = 97.4: expected an angle in rad, from -2π to 2π, or one with its unit, such as \"97.4 deg\"",
        ),
        (
            "inclination = 0.5235987755982989",
            "mean_anomaly = { distribution = \"uniform\", low = 0, high = 360 }",
            "study.toml:5: orbit.mean_anomaly.high = 360: expected an angle in rad, from -2π to 2π, or one with its unit, such as \"360 deg\"",
        ),
        (
            "inclination = 0.5235987755982989",
            "pericentre = { sweep = \"x\" }\n    [[sweep]]\n    name = \"x\"\n    values = [0, 90]",
            "study.toml:5: orbit.pericentre = { sweep = \"x\" }: expected an angle in rad, from -2π to 2π, or one with its unit, such as \"90 deg\"",
        ),
        (
            "model = \"gravity-gradient\"",
            "model = \"gravity-gradient\"\n    mu = 4e14\n    orbit = { radius = 7e6, ascending_node = -45 }",
            "study.toml:16: torque[1].orbit.ascending_node = -45: expected an angle in rad, from -2π to 2π, or one with its unit, such as \"-45 deg\"",
        ),
        (
            "radius = 6878000.0",
            "radius = 6878000.0\n    j2 = 1.0",
            "study.toml:5: orbit.j2 = 1.0: expected a finite number from -0.5 to 0.5",
        ),
        ("\"gravity-gradient\"", "\"constant-body\"\n    torque = [0, 0, 1]", "study.toml:2: orbit = "),
        (
            "radius = 6878000.0",
            "radius = -1.0",
            "study.toml:4: orbit.radius = -1.0: expected a finite number above zero (m)",
        ),
        ("radius = 6878000.0", "radios = 1.0", "study.toml:4: orbit.radios is not known: did you mean radius?"),
        ("    radius = 6878000.0\n", "", "study.toml:2: orbit.semi_major_axis is missing"),
        ("radius = 6878000.0", "radius = 7e6\neccentricity = 0.1", "study.toml:4: orbit.radius excludes eccentricity"),
    ] {
        let found = refusal(from, to);
        assert!(found.starts_with(message) && !found.contains('\n'), "{found}\nnot {message}");
    }
}

#[test]
fn percent_of_a_key_in_percent_is_the_number_itself() {
    let scene = |quantiles: &str, percentile: &str| {
        let text = format!(
            "{SI}    percentile = {percentile}\n[output]\nstatistics = [\"spin_rate\"]\nquantiles = {quantiles}\n"
        );
        Study::parse(Path::new("study.toml"), &text).and_then(|study| study.scene())
    };
    let expected = scene("[0.7, 7, 50, 100]", "95").expect("a study");
    for (quantiles, percentile) in
        [("[\"0.7 %\", \"7 %\", \"50 %\", \"100%\"]", "\"95 %\""), ("[0.7, \"7%\", 50, \"1e2 %\"]", "\"95%\"")]
    {
        assert_eq!(scene(quantiles, percentile).expect(quantiles), expected, "{quantiles}, {percentile}");
    }
    for (quantiles, percentile, message) in [
        ("[\"101 %\"]", "95", "output.quantiles = \"101 %\": expected a list of percentages from 0 to 100"),
        ("[\"1 m\"]", "95", "output.quantiles = \"1 m\": expected a list of percentages from 0 to 100"),
        ("[5]", "\"0 %\"", "accuracy.percentile = \"0 %\": expected a percentile above 0 and up to 100"),
        ("[5]", "\"95 m %\"", "accuracy.percentile = \"95 m %\": expected a percentile above 0 and up to 100"),
    ] {
        let error = scene(quantiles, percentile).map(drop).expect_err(message).to_string();
        assert!(error.contains(message), "{error}\nnot {message}");
    }
}

#[test]
fn the_help_names_every_distribution_and_every_unit() {
    let workspace = Workspace::new("");
    let help = workspace.done(&["run", "--help"]);
    let study = |angular_velocity: &str| {
        let text = format!(
            "[bodies]\ncount = 1\ninertia = [1, 1, 1]\nangular_velocity = {angular_velocity}\n[time]\nend = 1.0\n"
        );
        Study::parse(Path::new("s.toml"), &text).expect_err("refused").to_string()
    };
    let names = study("{ distribution = 'none of these' }") + &study("[{ distribution = 'none of these' }, 0, 0]");
    let lists =
        names.split("possible: ").skip(1).flat_map(|list| list.split("s.toml").next().unwrap_or_default().split(", "));
    let units = study("[0, 0, '1 parsec']");
    let units = units.split("prefixes: ").nth(1).expect("a list").split(", ");
    let mut known = 0;
    for name in lists.chain(units) {
        assert!(help.split(|c: char| c.is_whitespace() || ",:(".contains(c)).any(|word| word == name), "{name}");
        known += 1;
    }
    assert!(known > 50, "{known}");
}
