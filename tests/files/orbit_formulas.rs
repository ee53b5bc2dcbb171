//! Formulas that read the study's orbit, against the built-in torques on it and against two-body motion.

#![cfg(feature = "cli")]

use std::fs;

use glam::DVec3;
use polhode::Engine;
use polhode::Plan;
use polhode::study::Study;

use crate::support;
use crate::workspace::{States, Workspace, words};

/// Orbits: circular, eccentric, drifting, and of each body's own.
const ORBITS: [&str; 4] = [
    "radius = \"6878 km\"\ninclination = \"51.6 deg\"\nmean_anomaly = \"200 deg\"",
    "semi_major_axis = \"9000 km\"\neccentricity = 0.25\ninclination = 0.9\nascending_node = 1.0\npericentre = 0.5\nmean_anomaly = 3.0",
    "semi_major_axis = \"7500 km\"\neccentricity = 0.05\ninclination = 0.9\nascending_node = -1.0\npericentre = 4.0\nj2 = 1.0826e-3",
    "semi_major_axis = { distribution = \"uniform\", low = \"6800 km\", high = \"7500 km\" }\n\
     eccentricity = { distribution = \"uniform\", low = 0.0, high = 0.02 }\n\
     inclination = { distribution = \"uniform\", low = 0.2, high = 1.5 }\n\
     mean_anomaly = { distribution = \"uniform\", low = 0.0, high = 6.2 }",
];

fn study(orbit: &str, torque: &str, steps: &str) -> String {
    format!(
        "seed = 3\n[bodies]\ncount = 40\ninertia = {{ moments = [0.002, 0.003, 0.0035], scatter = 0.02 }}\n\
         orientation = {{ distribution = \"uniform\" }}\n\
         angular_velocity = {{ distribution = \"normal\", mean = [0, 0, 0], sigma = 0.02 }}\n\
         [orbit]\nmu = 3.986004418e14\n{orbit}\n{torque}\n[time]\nend = 2e4\n[accuracy]\n{steps}\n"
    )
}

/// The gravity gradient as a formula.
const GRADIENT: &str = "[[torque]]\nmodel = \"custom\"\nparameters = { mu = 3.986004418e14 }\ntorque = \"\"\"\n\
                        let r = to_body(orbit_position);\nlet u = normalize(r);\n\
                        3 * mu / norm(r)^3 * cross(u, inertia * u)\n\"\"\"\n";
const BUILT_IN: &str = "[[torque]]\nmodel = \"gravity-gradient\"\n";

fn orientations(text: &str) -> Vec<glam::DQuat> {
    let workspace = Workspace::new(text);
    let scene = Study::read(&workspace.path("study.toml")).expect("a study").scene().expect("a scene");
    let engine = Engine::cpu();
    let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
    (0..40).map(|body| record.final_state().orientation(body)).collect()
}

#[test]
fn a_gravity_gradient_of_ones_own_is_that_of_the_library() {
    // Under rk8 in f64, by series, and by equal steps in f32, whose phases are as exact.
    let methods = [
        ("method = \"rk8\"\ntolerance = 1e-12", 1e-9),
        ("method = \"taylor\"\ntolerance = 1e-12", 1e-9),
        ("method = \"rk8\"\ndt = 1.0\nprecision = \"f32\"", 4e-3),
    ];
    for orbit in ORBITS {
        for (steps, bound) in methods {
            let [own, built] = [GRADIENT, BUILT_IN].map(|torque| orientations(&study(orbit, torque, steps)));
            let errors = own.iter().zip(&built).map(|(own, built)| support::attitude_error(*own, *built));
            let greatest = errors.fold(0.0, f64::max);
            assert!(greatest <= bound, "{orbit}\n{steps}: {greatest:e}");
        }
        let steps = methods[0].0;
        let free = orientations(&study("radius = 7e6", BUILT_IN, steps).replace("3.986004418e14", "1.0"));
        let driven = orientations(&study(orbit, BUILT_IN, steps));
        let errors = free.iter().zip(&driven).map(|(free, driven)| support::attitude_error(*free, *driven));
        assert!(errors.fold(0.0, f64::max) > 0.1, "{orbit}: the torque should matter");
    }
}

#[test]
fn places_and_velocities_are_those_of_two_body_motion() {
    const MU: f64 = 3.986004418e14;
    let quantity = |name: &str, formula: &str| format!("[[quantity]]\nname = \"{name}\"\nformula = \"{formula}\"\n");
    let components = ["x", "y", "z"];
    let mut names = Vec::new();
    let mut quantities = String::new();
    for of in ["position", "velocity"] {
        for component in components {
            let name = format!("{of}_{component}");
            quantities += &quantity(&name, &format!("orbit_{of}.{component}"));
            names.push(name);
        }
    }
    for (orbit, energy) in [(ORBITS[0], -MU / 2.0 / 6.878e6), (ORBITS[1], -MU / 2.0 / 9e6)] {
        let columns = format!("[output]\nsnapshots = true\ncolumns = {names:?}\n{quantities}");
        let text = study(orbit, "", "attitude = 1e-6") + &columns;
        let text = text
            .replace("end = 2e4", "end = 8000\noutputs = { every = 1.0, start = true }")
            .replace("count = 40", "count = 1");
        let workspace = Workspace::new(&text);
        workspace.done(&["run", "study.toml", "--engine", "cpu"]);
        let states = States::read(&workspace.path("study.out/snapshots.csv"));
        let at = |row: usize, of: &str| {
            states.vector([0, 1, 2].map(|axis| &*names[3 * usize::from(of == "velocity") + axis]), row)
        };
        let start = DVec3::cross(at(0, "position"), at(0, "velocity"));
        let mut turned = 0.0;
        for row in 1..8000 {
            let (position, velocity) = (at(row, "position"), at(row, "velocity"));
            let found = 0.5 * velocity.length_squared() - MU / position.length();
            assert!((found / energy - 1.0).abs() < 1e-12, "{orbit}: energy {found} at {row} s");
            assert!(position.cross(velocity).distance(start) < 1e-11 * start.length(), "{orbit}: momentum at {row} s");
            // The central difference is off by h²/6 of the third derivative.
            let difference = 0.5 * (at(row + 1, "position") - at(row - 1, "position"));
            assert!(difference.distance(velocity) < 1e-6 * velocity.length(), "{orbit}: velocity at {row} s");
            turned += position.angle_between(at(row - 1, "position"));
        }
        assert!(turned > 5.0, "{orbit}: {turned} rad");
    }
}

#[test]
fn axes_are_at_their_angles_to_the_directions_of_the_orbit() {
    const AXIS: DVec3 = DVec3::new(1.0, -2.0, 0.5);
    let directions = ["nadir", "zenith", "velocity", "orbit-normal"];
    let names = ["off_nadir", "off_zenith", "off_velocity", "off_normal"];
    let angle = |(name, direction): (&str, &str)| {
        format!("[[quantity]]\nname = \"{name}\"\naxis = [1, -2, 0.5]\ndirection = \"{direction}\"\n")
    };
    let angles: String = names.into_iter().zip(directions).map(angle).collect();
    let mut parts = Vec::new();
    let mut formulas = String::new();
    for of in ["position", "velocity"] {
        for component in ["x", "y", "z"] {
            let name = format!("{of}_{component}");
            formulas += &format!("[[quantity]]\nname = \"{name}\"\nformula = \"orbit_{of}.{component}\"\n");
            parts.push(name);
        }
    }
    let orientation = ["qx", "qy", "qz", "qw"].map(String::from);
    let columns: Vec<String> = names.map(String::from).into_iter().chain(orientation).chain(parts.clone()).collect();
    // On an ellipse, where the velocity is not across the position.
    let text = study(ORBITS[1], BUILT_IN, "attitude = 1e-6")
        + &format!("[output]\nsnapshots = true\ncolumns = {columns:?}\n{angles}{formulas}");
    let text = text.replace("end = 2e4", "end = 2e4\noutputs = { every = 1e3, start = true }");
    let workspace = Workspace::new(&text);
    workspace.done(&["run", "study.toml", "--engine", "cpu"]);
    let states = States::read(&workspace.path("study.out/snapshots.csv"));
    assert_eq!(states.rows(), 21 * 40);
    for row in 0..states.rows() {
        let vector = |first: usize| states.vector([0, 1, 2].map(|axis| &*parts[first + axis]), row);
        let (position, velocity) = (vector(0), vector(3));
        let axis = states.orientation(row) * AXIS;
        for (name, direction) in names.into_iter().zip([-position, position, velocity, position.cross(velocity)]) {
            let (found, expected) = (states.column(name)[row], axis.angle_between(direction));
            // What an arc cosine loses near its ends.
            assert!((found - expected).abs() < 3e-8, "{name} in row {row}: {found}, not {expected}");
        }
    }
}

#[test]
fn what_has_no_orbit_cannot_read_it() {
    let workspace = Workspace::new("");
    let refused = |text: &str| {
        fs::write(workspace.path("study.toml"), text).expect("written");
        let output = workspace.polhode(&["run", "study.toml", "--engine", "cpu"]);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        words(&output.stderr)
    };
    let steps = "attitude = 1e-6";
    let without = study("radius = 7e6", GRADIENT, steps).replace("[orbit]\nmu = 3.986004418e14\nradius = 7e6\n", "");
    let message = refused(&without);
    assert!(message.contains("torque[1].torque: ") || message.contains("torque[1].torque = "), "{message}");
    assert!(message.contains("expected a table [orbit] with mu and radius"), "{message}");

    let quantity =
        "[[quantity]]\nname = \"height\"\nformula = \"norm(orbit_position)\"\n[output]\nstatistics = [\"height\"]\n";
    let drawn = study(ORBITS[3], BUILT_IN, steps) + quantity;
    assert!(refused(&drawn).contains("a quantity knows only an orbit that all bodies share"));
    let angle = |direction: &str| {
        let angle = format!("[[quantity]]\nname = \"off\"\naxis = [0, 0, 1]\ndirection = {direction}\n");
        angle + "[output]\nstatistics = [\"off\"]\n"
    };
    let drawn = study(ORBITS[3], BUILT_IN, steps) + &angle("\"nadir\"");
    assert!(refused(&drawn).contains("a quantity knows only an orbit that all bodies share"));
    let message = refused(&(study(ORBITS[0], BUILT_IN, steps) + &angle("\"nadirs\"")));
    assert!(message.contains("quantity[1].direction") && message.contains("nadir, zenith"), "{message}");
    let free = study("radius = 7e6", "", steps).replace("[orbit]\nmu = 3.986004418e14\nradius = 7e6\n", "");
    let message = refused(&(free + &angle("\"zenith\"")));
    assert!(message.contains("quantity[1].direction") && message.contains("asks for a table [orbit]"), "{message}");

    // An orbit that nothing reads, and names that are taken.
    let constant = "[[torque]]\nmodel = \"constant-body\"\ntorque = [0, 0, 1e-6]\n";
    assert!(refused(&study("radius = 7e6", constant, steps)).contains("no formula reads orbit_position"));
    let taken = GRADIENT.replace("{ mu = ", "{ orbit_position = [0, 0, 1], mu = ");
    assert!(refused(&study("radius = 7e6", &taken, steps)).contains("`orbit_position` has a meaning already"));
    let energy = GRADIENT.replace("torque = ", "energy = \"norm(orbit_position)\"\ntorque = ");
    assert!(
        refused(&study("radius = 7e6", &energy, steps))
            .contains("`orbit_position` is not known where this formula is used")
    );
}

#[test]
fn an_orbit_that_only_a_quantity_reads_is_used() {
    let quantity = "[[quantity]]\nname = \"nadir\"\nunit = \"rad\"\n\
                    formula = \"acos(clamp(dot(to_world(vec(0, 0, 1)), -normalize(orbit_position)), -1, 1))\"\n\
                    [output]\nstatistics = [\"nadir\"]\n";
    let workspace = Workspace::new(&(study("radius = 7e6", "", "attitude = 1e-6") + quantity));
    workspace.done(&["run", "study.toml", "--engine", "cpu"]);
}
