//! Torques and forces in study files.
#![cfg(feature = "study")]

use std::path::Path;

use glam::DVec3;
use polhode::bodies::inertia::InertiaTensor;
use polhode::study::Study;
use polhode::torque::flat_plates::{Facet, Surface};
use polhode::torque::variable_inertia::{InertiaChange, Law};
use polhode::torque::{Orbit, Parameter, Torque, Value};
use polhode::{Error, Force, Scene};

const BODIES: &str = "
seed = 5
[bodies]
count = 3
inertia = [1.0, 2.0, 2.5]
angular_velocity = [0.1, 0.2, 0.3]
[time]
end = 1.0
";

fn study(torques: &str) -> polhode::Result<Study> {
    Study::parse(Path::new("study.toml"), &format!("{BODIES}{torques}"))
}

fn refusal(torques: &str) -> String {
    match study(torques) {
        Err(error @ Error::Input(_)) => error.to_string(),
        other => panic!("{torques}: {other:?}"),
    }
}

#[test]
fn every_model_is_read_as_the_library_makes_it() {
    let text = r#"
[[torque]]
model = "constant-body"
torque = [1, 2, 3]
[[torque]]
model = "constant-world"
torque = [0.5, 0, 0]
[[torque]]
model = "viscous"
coefficient = 1.0e-3
[[torque]]
model = "linear-drag"
coefficient = 2.0e-3
[[torque]]
model = "matrix-drag"
matrix = [[1, 0, 0], [0, 2, 0], [0, 0, 3]]
[[torque]]
model = "quadratic-drag"
coefficient = 0.5
[[torque]]
model = "sinusoidal"
sine = [1, 0, 0]
rate = 1.5
[[torque]]
model = "gravity-gradient"
mu = 3.986004418e14
orbit = { radius = 7.0e6, inclination = 0.9 }
[[torque]]
model = "gravity-gradient"
mu = 3.986004418e14
orbit = { semi_major_axis = 8.0e6, eccentricity = 0.1, mean_anomaly = 0.3 }
[[torque]]
model = "heavy-top"
mass = 2.0
centre = [0, 0, 0.5]
gravity = [0, 0, -9.81]
[[torque]]
model = "magnetic-dipole"
moment = [0, 0, 1]
field = [3e-5, 0, 0]
[[torque]]
model = "orbiting-dipole"
moment = [0, 0, 1]
mu = 3.986004418e14
orbit = { radius = 7.0e6 }
strength = 7.8e15
tilt = 2.97
rotation = 7.29e-5
[[torque]]
model = "eddy-current"
coefficient = 1e3
field = [3e-5, 0, 0]
[[torque]]
model = "orbiting-eddy-current"
coefficient = 1e3
mu = 3.986004418e14
orbit = { radius = 7.0e6, inclination = 1.7 }
strength = 7.8e15
tilt = 2.97
rotation = 7.29e-5
[[torque]]
model = "sine-spring"
stiffness = 1.0
target = [0, 0, 0, 1]
[[torque]]
model = "internal-dissipation"
coefficient = 0.1
[[torque]]
model = "white-noise"
intensity = 0.1
[[torque]]
model = "variable-inertia"
inertia = [1.5, 1.6, 2.0]
ramp = { start = 0.1, duration = 0.5 }
"#;
    let scene = study(text).and_then(|study| study.scene()).expect("a study");
    let gravity = 3.986004418e14;
    let expected = [
        Torque::constant_body(DVec3::new(1.0, 2.0, 3.0)),
        Torque::constant_world(DVec3::new(0.5, 0.0, 0.0)),
        Torque::linear_drag(1e-3),
        Torque::linear_drag(2e-3),
        Torque::matrix_drag(glam::DMat3::from_diagonal(DVec3::new(1.0, 2.0, 3.0))),
        Torque::quadratic_drag(0.5),
        Torque::sinusoidal(DVec3::X, DVec3::ZERO, 1.5),
        Torque::gravity_gradient(Orbit::circular(gravity, 7e6).inclined(0.9)),
        Torque::gravity_gradient(Orbit::kepler(gravity, 8e6, 0.1).with_mean_anomaly(0.3)),
        Torque::heavy_top(2.0, DVec3::new(0.0, 0.0, 0.5), DVec3::new(0.0, 0.0, -9.81)),
        Torque::magnetic_dipole(DVec3::Z, DVec3::new(3e-5, 0.0, 0.0)),
        Torque::orbiting_dipole(DVec3::Z, Orbit::circular(gravity, 7e6), 7.8e15, 2.97, 0.0, 7.29e-5),
        Torque::eddy_current(1e3, DVec3::new(3e-5, 0.0, 0.0)),
        Torque::orbiting_eddy_current(1e3, Orbit::circular(gravity, 7e6).inclined(1.7), 7.8e15, 2.97, 0.0, 7.29e-5),
        Torque::sine_spring(1.0, glam::DQuat::IDENTITY),
        Torque::internal_dissipation(0.1),
        Torque::white_noise(0.1, 5),
        Torque::variable_inertia(InertiaChange::tensor(DVec3::new(1.5, 1.6, 2.0)), Law::ramp(0.1, 0.5)),
    ];
    assert_eq!(scene.torques(), expected);
}

#[test]
fn random_torques_without_a_seed_follow_paths_of_their_own() {
    let noise = |rest: &str| format!("[[torque]]\nmodel = \"white-noise\"\nintensity = 0.1\n{rest}");
    let text = [noise(""), noise("seed = 9\n"), noise(""), noise("")].concat();
    let scene = study(&text).and_then(|study| study.scene()).expect("a study");
    assert_eq!(scene.torques(), [5, 9, 6, 7].map(|seed| Torque::white_noise(0.1, seed)));
}

#[test]
fn parameters_are_drawn_for_each_body_whatever_stands_beside_it() {
    let text = r#"
[[torque]]
model = "constant-body"
torque = { distribution = "uniform", low = -1, high = 1 }
[[torque]]
model = "viscous"
coefficient = { distribution = "uniform", low = 0.01, high = 0.1 }
"#;
    let scene = |most: usize| study(text).expect("a study").truncated(most).scene().expect("a scene");
    let (all, fewer) = (scene(3), scene(2));
    let vector = |scene: &Scene| scene.torques()[0].parameter("torque").and_then(Value::as_vector).cloned();
    let number = |scene: &Scene| scene.torques()[1].parameter("coefficient").and_then(Value::as_number).cloned();
    let (torque, drag) = (vector(&all).expect("a vector"), number(&all).expect("a number"));
    assert_eq!(vector(&fewer), Some(Parameter::PerBody((0..2).map(|body| torque.at(body)).collect())));
    assert_eq!(number(&fewer), Some(Parameter::PerBody((0..2).map(|body| drag.at(body)).collect())));
    assert!((0..3).all(|body| (0.01..0.1).contains(&drag.at(body))));
    assert_ne!(torque.at(0), torque.at(1));
}

#[test]
fn parameters_are_read_from_columns_of_the_table_of_bodies() {
    let folder = tempfile::tempdir().expect("a folder");
    let table = "wx,wy,wz,drag,tx,ty,tz\n1,0,0,0.5,1,2,3\n0,1,0,0.25,4,5,6\n";
    std::fs::write(folder.path().join("bodies.csv"), table).expect("written");
    let text = |coefficient: &str| {
        format!(
            "[bodies]\nfile = \"bodies.csv\"\ninertia = [1.0, 2.0, 2.5]\n[time]\nend = 1.0\n\
             [[torque]]\nmodel = \"viscous\"\ncoefficient = {{ column = \"{coefficient}\" }}\n\
             [[torque]]\nmodel = \"constant-body\"\ntorque = {{ columns = [\"tx\", \"ty\", \"tz\"] }}\n"
        )
    };
    let file = folder.path().join("study.toml");
    let scene = Study::parse(&file, &text("drag")).and_then(|study| study.scene()).expect("a study");
    let expected = [
        Torque::linear_drag(vec![0.5, 0.25]),
        Torque::constant_body(vec![DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)]),
    ];
    assert_eq!(scene.torques(), expected);

    // A column that no torque names is refused, and one that is named must be there.
    let message = Study::parse(&file, &text("friction")).expect_err("no such column").to_string();
    assert!(
        message.contains("bodies.csv:1: drag is no standard column, and nothing in the study names it"),
        "{message}"
    );
    let without = table.replace("drag,", "").replace("0.5,", "").replace("0.25,", "");
    std::fs::write(folder.path().join("bodies.csv"), without).expect("written");
    let message = Study::parse(&file, &text("drag")).expect_err("no such column").to_string();
    assert!(message.contains("bodies.csv:1: drag is missing"), "{message}");
}

#[test]
fn changes_of_inertia_are_numbers_draws_columns_and_shapes() {
    let changed = |parameters: &str| {
        let text = format!("[[torque]]\nmodel = \"variable-inertia\"\n{parameters}");
        let scene = study(&text).and_then(|study| study.scene()).expect("a study");
        let [torque] = scene.torques() else { panic!("{scene:?}") };
        torque.clone()
    };
    let drawn = "{ distribution = \"uniform\", low = 0.5, high = 0.75 }";
    let model = changed(&format!("factor = {drawn}\noscillation = {{ rate = {drawn} }}\n"));
    let number = |name| model.parameter(name).and_then(Value::as_number).expect("a number");
    let (factor, rate) = (number("factor"), number("oscillation.rate"));
    assert_eq!((model.parameter("inertia"), model.parameter("ramp.start")), (None, None));
    assert!((0..3).all(|body| (0.5..0.75).contains(&factor.at(body)) && (0.5..0.75).contains(&rate.at(body))));
    assert_ne!(factor.at(0), factor.at(1));
    assert_ne!(factor.at(0), rate.at(0));

    let shape = "inertia = { shape = \"box\", mass = 6.0, edges = [1, 2, 3] }\nramp = { start = 1, duration = 2 }\n";
    let model = changed(shape);
    assert_eq!(model.parameter("ramp.duration"), Some(&Value::Number(2.0.into())));
    assert_eq!(model.tensor_at(2, InertiaTensor::default(), 9.0).to_array(), [6.5, 5.0, 2.5, 0.0, 0.0, 0.0]);
    let tensor = changed("inertia = { ixx = 1, iyy = 2, izz = 2.5, ixy = 0.5 }\nramp = { start = 1, duration = 2 }\n");
    let Some(Value::Tensor(Parameter::Shared(tensor))) = tensor.parameter("inertia") else { panic!() };
    assert_eq!(tensor.xy, 0.5);
    let spread = changed(&format!("inertia = {{ moments = {drawn} }}\nramp = {{ start = 1, duration = {drawn} }}\n"));
    let Some(Value::Tensor(tensors)) = spread.parameter("inertia") else { panic!() };
    assert_ne!(tensors.at(0), tensors.at(1));

    let folder = tempfile::tempdir().expect("a folder");
    let table = "wx,wy,wz,jx,jy,jz,when\n1,0,0,2,2,3,5\n0,1,0,3,3,4,6\n";
    std::fs::write(folder.path().join("bodies.csv"), table).expect("written");
    let text = "[bodies]\nfile = \"bodies.csv\"\ninertia = [1.0, 2.0, 2.5]\n[time]\nend = 1.0\n[[torque]]\n\
        model = \"variable-inertia\"\ninertia = { columns = [\"jx\", \"jy\", \"jz\"] }\n\
        ramp = { start = { column = \"when\" }, duration = 2 }\n";
    let scene = Study::parse(&folder.path().join("study.toml"), text).and_then(|study| study.scene()).expect("a study");
    let expected = InertiaChange::tensors(&[DVec3::new(2.0, 2.0, 3.0), DVec3::new(3.0, 3.0, 4.0)]);
    assert_eq!(scene.torques(), [Torque::variable_inertia(expected, Law::ramp(vec![5.0, 6.0], 2.0))]);
}

#[test]
fn wrong_changes_of_inertia_are_located() {
    let text = |rest: &str| format!("[[torque]]\nmodel = \"variable-inertia\"\n{rest}");
    for (rest, expected) in [
        ("factor = 2\n", "torque[1].ramp is missing: expected `ramp` or `oscillation`"),
        ("ramp = { start = 1, duration = 2 }\n", "torque[1].inertia is missing"),
        ("factor = 2\ninertia = [1, 1, 1]\nramp = { start = 1, duration = 2 }\n", "torque[1].factor excludes inertia"),
        ("factor = 2\nramp = { start = 1 }\n", "study.toml:12: torque[1].ramp.duration is missing"),
    ] {
        let message = refusal(&text(rest));
        assert!(message.contains(expected), "{message}: {expected}");
    }
    for (rest, expected) in [
        ("factor = 2\nramp = { start = -1, duration = 2 }\n", "study.toml:12: torque[1].ramp.start = -1.0: "),
        ("factor = 0\noscillation = { rate = 1 }\n", "study.toml:11: torque[1].factor = 0.0: "),
        ("inertia = [1, 1, 3]\nramp = { start = 1, duration = 2 }\n", "study.toml:11: torque[1].inertia"),
    ] {
        let study = study(&text(rest)).expect("readable");
        let scene = study.scene().expect("drawn");
        let error = polhode::Plan::new(&scene, &polhode::engine::Engine::cpu()).expect_err("not valid");
        let message = study.located(error).to_string();
        assert!(message.starts_with(expected), "{message}: {expected}");
    }
}

#[test]
fn flat_plates_are_read_with_the_coefficients_of_their_surfaces() {
    let text = r#"
[[torque]]
model = "flat-plates"
pressure = { distribution = "uniform", low = 1e-6, high = 5e-6 }
direction = { distribution = "direction", magnitude = 2.0 }
facets = [
  { area = 0.02, normal = [0, 0, 1], centre = [0, 0, 0.15], along = 0.7, constant = 0.1, across = 0.4 },
  { area = 0.02, normal = [0, 0, -1], centre = [0, 0, -0.15], along = 1 },
  { area = 0.5, normal = [1, 1, 0], centre = [0, 0.3, 0], solar = { specular = 0.25, diffuse = 0.5 } },
  { area = 0.1, normal = [1, 0, 0], centre = [0, 0, 0], drag = { normal_accommodation = 1, tangential_accommodation = 0.5 } },
]
"#;
    let scene = study(text).and_then(|study| study.scene()).expect("a study");
    let facet =
        |area: f64, normal_body: DVec3, centre_body: DVec3, surface| Facet { area, normal_body, centre_body, surface };
    let facets = [
        facet(0.02, DVec3::Z, DVec3::Z * 0.15, Surface::Coefficients { along: 0.7, constant: 0.1, across: 0.4 }),
        facet(0.02, -DVec3::Z, DVec3::Z * -0.15, Surface::Coefficients { along: 1.0, constant: 0.0, across: 0.0 }),
        facet(0.5, DVec3::X + DVec3::Y, DVec3::Y * 0.3, Surface::Solar { specular: 0.25, diffuse: 0.5 }),
        facet(
            0.1,
            DVec3::X,
            DVec3::ZERO,
            Surface::Drag { normal_accommodation: 1.0, tangential_accommodation: 0.5, wall_speed_ratio: 0.0 },
        ),
    ];
    let [torque] = scene.torques() else { panic!("{scene:?}") };
    let parameter = |name| torque.parameter(name).expect("given");
    assert!(!parameter("pressure").is_shared() && !parameter("direction").is_shared());
    let read = parameter("facets").as_list().expect("a list");
    // What a study leaves out is a default there and absent here; the formulas are the same.
    let made = Torque::flat_plates(1.0, DVec3::X, &facets).expect("valid");
    let made = made.parameter("facets").and_then(Value::as_list).expect("a list");
    for (read, made) in read.iter().zip(made) {
        for (place, (read, made)) in read.iter().zip(made).enumerate() {
            assert!(*made == Value::Absent || read == made, "{place}: {read:?}, {made:?}");
        }
    }
    assert_eq!(read.len(), made.len());
}

#[test]
fn wrong_facets_are_refused_by_their_key() {
    let text = |facets: &str| {
        format!("[[torque]]\nmodel = \"flat-plates\"\npressure = 1\ndirection = [1, 0, 0]\nfacets = [\n{facets}]\n")
    };
    let good = "{ area = 1, normal = [0, 0, 1], centre = [0, 1, 0], along = 1 },\n";
    let second = |facet: &str| text(&format!("{good}{facet},\n"));
    for (facet, expected) in [
        ("{ normal = [0, 0, 1], centre = [0, 0, 0], along = 1 }", "study.toml:15: torque[1].facets[2].area is missing"),
        (
            "{ area = 1, normal = [0, 1], centre = [0, 0, 0], along = 1 }",
            "study.toml:15: torque[1].facets[2].normal = ",
        ),
        (
            "{ area = { column = \"a\" }, normal = [0, 0, 1], centre = [0, 0, 0], along = 1 }",
            "torque[1].facets[2].area = ",
        ),
        (
            "{ area = 1, normal = [0, 0, 1], centre = [0, 0, 0] }",
            "torque[1].facets[2].along is missing: expected `along` or `solar` or `drag`",
        ),
        (
            "{ area = 1, normal = [0, 0, 1], centre = [0, 0, 0], across = 1, solar = { specular = 1, diffuse = 0 } }",
            "torque[1].facets[2].solar excludes across",
        ),
        (
            "{ area = 1, normal = [0, 0, 1], centre = [0, 0, 0], solar = { specular = 1 } }",
            "torque[1].facets[2].solar.diffuse is missing",
        ),
        (
            "{ area = 1, normals = [0, 0, 1], centre = [0, 0, 0], along = 1 }",
            "torque[1].facets[2].normals is not known: did you mean normal?",
        ),
        ("7", "torque[1].facets[2] = 7: expected a table"),
    ] {
        let message = refusal(&second(facet));
        assert!(message.contains(expected), "{message}: {expected}");
    }
    for (facets, expected) in [
        (String::new(), "study.toml:13: torque[1].facets = [ ]: expected a list of 1 to 16 tables"),
        (good.repeat(17), "expected a list of 1 to 16 tables"),
    ] {
        let message = refusal(&text(&facets));
        assert!(message.contains(expected), "{message}: {expected}");
    }
    // Values out of range are found when the formula is made.
    for (facet, expected) in [
        (
            "{ area = -1, normal = [0, 0, 1], centre = [0, 0, 0], along = 1 }",
            "study.toml:15: torque[1].facets[2].area = -1.0: expected a finite number that is not negative (m²)",
        ),
        (
            "{ area = 1, normal = [0, 0, 0], centre = [0, 0, 0], along = 1 }",
            "study.toml:15: torque[1].facets[2].normal = 0.0: expected finite components that are not all zero",
        ),
        (
            "{ area = 1, normal = [0, 0, 1], centre = [0, 0, 0], solar = { specular = 0.5, diffuse = 0.75 } }",
            "study.toml:15: torque[1].facets[2].solar.diffuse = 0.75: specular and diffuse together must be at most 1",
        ),
    ] {
        let error = study(&second(facet)).and_then(|study| study.scene()).expect_err("not valid");
        assert!(error.to_string().starts_with(expected), "{error}: {expected}");
    }
}

#[test]
fn wrong_torques_are_refused_at_their_line() {
    for (text, expected) in [
        ("[[torque]]\nmodel = \"viscos\"\n", "study.toml:10: torque[1].model = \"viscos\": did you mean viscous?"),
        ("[[torque]]\nmodel = \"gravity\"\n", "torque[1].model = \"gravity\": did you mean gravity-gradient?"),
        ("[[torque]]\ncoefficient = 1\n", "torque[1].model is missing"),
        ("[[torque]]\nmodel = \"viscous\"\n", "torque[1].coefficient is missing"),
        (
            "[[torque]]\nmodel = \"viscous\"\ncoefficient = 1\nfactor = 2\n",
            "study.toml:12: torque[1].factor is not known",
        ),
        (
            "[[torque]]\nmodel = \"gravity-gradient\"\nmu = 1\norbit = { }\n",
            "study.toml:12: torque[1].orbit = { }: expected `radius` or `semi_major_axis` (m)",
        ),
        (
            "[[torque]]\nmodel = \"gravity-gradient\"\nmu = 1\n",
            "torque[1].orbit is missing: expected { semi_major_axis = m or radius = m }",
        ),
        (
            "[[torque]]\nmodel = \"gravity-gradient\"\nmu = 1\norbit = { radius = 1, eccentricity = 0.1 }\n",
            "study.toml:12: torque[1].orbit.radius excludes eccentricity",
        ),
        (
            "[[torque]]\nmodel = \"viscous\"\ncoefficient = true\n",
            "study.toml:11: torque[1].coefficient = true: expected the coefficient c (N m s)",
        ),
        (
            "[[torque]]\nmodel = \"white-noise\"\nintensity = 1\ndraws_per_step = 0\n",
            "study.toml:12: torque[1].draws_per_step",
        ),
        ("[[torque]]\nmodel = \"viscous\"\ncoefficient = { column = \"drag\" }\n", "name its file here"),
    ] {
        let message = refusal(text);
        assert!(message.contains(expected), "{message}: {expected}");
    }
}

#[test]
fn values_out_of_range_are_located_when_the_plan_is_made() {
    let text = "[[torque]]\nmodel = \"constant-body\"\ntorque = [1, 0, 0]\n[[torque]]\nmodel = \"viscous\"\ncoefficient = -1.0\n";
    let study = study(text).expect("readable");
    let scene = study.scene().expect("drawn");
    let engine = polhode::engine::Engine::cpu();
    let error = polhode::Plan::new(&scene, &engine).expect_err("negative");
    let message = study.located(error).to_string();
    assert!(message.starts_with("study.toml:14: torque[2].coefficient = -1.0: "), "{message}");
}

#[test]
fn every_force_is_read_as_the_library_makes_it_from_the_table_and_from_the_list() {
    let bodies = BODIES.replace("count = 3\n", "count = 3\nmass = 2.0\n");
    let scene = |forces: &str| {
        let study = Study::parse(Path::new("study.toml"), &format!("{bodies}{forces}")).expect("a study");
        study.scene().expect("a scene")
    };
    let list = r#"
[[force]]
model = "constant"
force = [1, 2, 3]
[[force]]
model = "gravity"
acceleration = [0, 0, -9.81]
[[force]]
model = "linear-drag"
coefficient = 0.25
[[force]]
model = "quadratic-drag"
coefficient = { distribution = "uniform", low = 0.5, high = 0.75 }
[[force]]
model = "thrust"
force = { distribution = "uniform", low = -1, high = 1 }
"#;
    let common = [
        Force::constant(DVec3::new(1.0, 2.0, 3.0)),
        Force::gravity(DVec3::new(0.0, 0.0, -9.81)),
        Force::linear_drag(0.25),
    ];
    let listed = scene(list);
    assert_eq!(listed.forces()[..3], common);
    let [.., Force::QuadraticDrag(drag), Force::Thrust(thrust)] = listed.forces() else { panic!("{listed:?}") };
    assert!((0..3).all(|body| (0.5..0.75).contains(&drag.at(body))));
    assert_ne!(thrust.at(0), thrust.at(1));
    let table = scene("[force]\nconstant = [1, 2, 3]\ngravity = [0, 0, -9.81]\nlinear_drag = 0.25\n");
    assert_eq!(table.forces(), common);
}

#[test]
fn wrong_forces_are_refused_at_their_line() {
    for (text, expected) in [
        (
            "[[force]]\nmodel = \"trust\"\nforce = [1, 0, 0]\n",
            "study.toml:10: force[1].model = \"trust\": did you mean thrust?",
        ),
        ("[[force]]\nmodel = \"thrust\"\n", "force[1].force is missing: expected a vector in body axes (N)"),
        ("[[force]]\nmodel = \"gravity\"\nforce = [0, 0, 1]\n", "study.toml:11: force[1].force is not known"),
        ("[[force]]\nmodel = \"quadratic-drag\"\ncoefficient = { column = \"area\" }\n", "name its file here"),
    ] {
        let message = refusal(text);
        assert!(message.contains(expected), "{message}: {expected}");
    }
    let bodies = BODIES.replace("count = 3\n", "count = 3\nmass = 2.0\n");
    for (text, expected) in [
        ("[[force]]\nmodel = \"quadratic-drag\"\ncoefficient = -1\n", "study.toml:12: force[1].coefficient = -1.0: "),
        ("[force]\nlinear_drag = -0.5\n", "study.toml:11: force.linear_drag = -0.5: "),
    ] {
        let study = Study::parse(Path::new("study.toml"), &format!("{bodies}{text}")).expect("readable");
        let scene = study.scene().expect("drawn");
        let error = polhode::Plan::new(&scene, &polhode::engine::Engine::cpu()).expect_err("negative");
        let message = study.located(error).to_string();
        assert!(message.starts_with(expected), "{message}: {expected}");
    }
}
