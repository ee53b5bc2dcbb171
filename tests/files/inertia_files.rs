//! Inertia from files: meshes, points and parts in studies, and `polhode inertia`.

#![cfg(all(feature = "cli", feature = "mesh"))]

use std::fs;

use glam::{DQuat, DVec3};
use polhode::bodies::inertia::{
    InertiaTensor, MassProperties, Part, Shape, TriangleMesh, Validity, compose, principal_axes,
};
use polhode::study::Study;
use polhode::{Ensemble, Error};

use crate::support::meshes::{obj_text, stl_text};
use crate::workspace;

use workspace::{Workspace, report, words};

/// Closed formulas against sums over triangles and parts.
const ROUNDING: f64 = 1e-13;

fn study_of(inertia: &str) -> String {
    format!("seed = 3\n[bodies]\ncount = 20\ninertia = {inertia}\nangular_velocity = [0, 0, 0]\n[time]\nend = 1.0\n")
}

/// A box of 1 × 2 × 3 m whose centre is at (5, 0, 0).
fn box_mesh() -> TriangleMesh {
    let mesh = Shape::Box { edges: DVec3::new(1.0, 2.0, 3.0) }.mesh(8).unwrap();
    let moved = mesh.vertices().iter().map(|&v| v + DVec3::X * 5.0).collect();
    TriangleMesh::new(moved, mesh.triangles().to_vec()).unwrap()
}

fn box_of(mass: f64) -> MassProperties {
    Shape::Box { edges: DVec3::new(1.0, 2.0, 3.0) }.mass_properties(mass).unwrap()
}

/// A folder with meshes and points in it.
fn workspace(study: &str) -> Workspace {
    let workspace = Workspace::new(study);
    let mesh = box_mesh();
    let turned = mesh.turned_inside_out();
    let open = TriangleMesh::new(mesh.vertices().to_vec(), mesh.triangles()[1..].to_vec()).unwrap();
    let millimetres = mesh.scaled(1000.0).unwrap();
    for (name, text) in [
        ("box.obj", obj_text(&mesh)),
        ("box.stl", stl_text(&mesh)),
        ("turned.obj", obj_text(&turned)),
        ("open.obj", obj_text(&open)),
        ("millimetres.obj", obj_text(&millimetres)),
        ("atoms.csv", "# water\nname,mass,x,y,z\nO,16,0,0,0\nH,1,0.76,0.59,0\nH,1,-0.76,0.59,0\n".to_owned()),
        ("pair.csv", "mass,x,y,z\n1,1,2,3\n3,2,3,5\n".to_owned()),
        (
            "corners.csv",
            box_mesh()
                .vertices()
                .iter()
                .fold("x,y,z\n".to_owned(), |text, v| text + &format!("{},{},{}\n", v.x, v.y, v.z)),
        ),
    ] {
        fs::write(workspace.path(name), text).unwrap();
    }
    workspace
}

fn ensemble(workspace: &Workspace, inertia: &str) -> Result<Ensemble, Error> {
    let text = study_of(inertia);
    Study::parse(&workspace.path("study.toml"), &text).and_then(|study| study.ensemble())
}

/// The message of a study that is refused, without the folder's name.
fn refusal(workspace: &Workspace, inertia: &str) -> String {
    let error = ensemble(workspace, inertia).expect_err(inertia);
    assert!(error.is_input(), "{error}");
    let message = error.to_string().replace(&format!("{}/", workspace.folder().display()), "");
    assert!(!message.contains('\n'), "{message}");
    message
}

fn close(found: InertiaTensor, expected: InertiaTensor, bound: f64, what: &str) {
    assert!((found - expected).norm() <= bound * expected.norm(), "{what}: {found:?} {expected:?}");
}

#[test]
fn meshes_hulls_and_points_make_bodies() {
    let workspace = workspace("");
    let expected = box_of(12.0).inertia;
    for (inertia, bound) in [
        ("{ mesh = \"box.obj\", mass = 12.0 }", ROUNDING),
        ("{ mesh = \"box.obj\", density = 2.0 }", ROUNDING),
        ("{ mesh = \"box.stl\", mass = 12.0 }", ROUNDING),
        ("{ mesh = \"millimetres.obj\", mass = 12.0, scale = 0.001 }", ROUNDING),
        ("{ hull = \"corners.csv\", density = 2.0 }", ROUNDING),
        ("{ parts = [{ mesh = \"box.obj\", mass = 12.0 }] }", ROUNDING),
    ] {
        let ensemble = ensemble(&workspace, inertia).unwrap_or_else(|error| panic!("{inertia}: {error}"));
        close(ensemble.inertia()[7], expected, bound, inertia);
    }
    let shell = ensemble(&workspace, "{ mesh = \"open.obj\", mass = 12.0, shell = true }").unwrap();
    assert!(shell.inertia()[0].trace() > expected.trace());
    let drawn = "{ mesh = \"box.obj\", mass = { distribution = \"uniform\", low = 6, high = 12 } }";
    let drawn = ensemble(&workspace, drawn).unwrap();
    assert!(drawn.inertia()[0] != drawn.inertia()[1] && drawn.inertia()[0].trace() < expected.trace());

    let water = ensemble(&workspace, "{ points = \"atoms.csv\" }").unwrap().inertia()[0];
    let centre = 2.0 * 0.59 / 18.0;
    let ixx = 16.0 * centre * centre + 2.0 * (0.59 - centre) * (0.59 - centre);
    let iyy = 2.0 * 0.76 * 0.76;
    close(water, DVec3::new(ixx, iyy, ixx + iyy).into(), ROUNDING, "water");
    let scaled = ensemble(&workspace, "{ points = \"atoms.csv\", scale = 2.0, mass = 36.0 }").unwrap().inertia()[0];
    close(scaled, water * 8.0, ROUNDING, "water, twice as heavy and as large");
    let pair = ensemble(&workspace, "{ points = \"pair.csv\" }").unwrap();
    assert!(pair.is_linear_rotor(0));
}

/// Tensors of molecules and planets, in a table and in a study: as they are read, their moments are in proportion, and their
/// axes are the same to the rounding of the elements.
#[test]
fn bodies_of_any_scale_have_the_same_axes() {
    let tensor = [2.25, 3.5, 4.75, 0.25, -0.375, 0.5];
    let workspace = Workspace::new("");
    let read = |power: i32| {
        let row = tensor.map(|element| format!("{element}e{power}")).join(",");
        fs::write(workspace.path("bodies.csv"), format!("ixx,iyy,izz,ixy,ixz,iyz,wx,wy,wz\n{row},0,0,1\n")).unwrap();
        let table = "[bodies]\nfile = \"bodies.csv\"\n[time]\nend = 1.0\n";
        let of_table = Study::parse(&workspace.path("study.toml"), table).and_then(|study| study.ensemble()).unwrap();
        let of_study = ensemble(&workspace, &format!("[1e{power}, 2e{power}, 2.5e{power}]")).unwrap();
        (of_table.inertia()[0], of_study.inertia()[0])
    };
    let (base, _) = read(0);
    let axes = principal_axes(&base);
    for power in [-46, -30, -27, -10, 10, 27, 30, 38] {
        let scale = 10.0_f64.powi(power);
        let (found, moments) = read(power);
        // Each number is read to the nearest one.
        close(found, base * scale, f64::EPSILON, &format!("1e{power}"));
        close(
            moments,
            InertiaTensor::from_principal_moments(DVec3::new(1.0, 2.0, 2.5)) * scale,
            f64::EPSILON,
            "diagonal",
        );
        let found = principal_axes(&found);
        assert!((found.moments / scale - axes.moments).length() < ROUNDING * axes.moments.z, "1e{power}");
        let apart = axes.principal_to_body.conjugate() * found.principal_to_body;
        assert!(apart.xyz().length() < ROUNDING, "1e{power}: axes off by {:e}", apart.xyz().length());
    }
    for (power, name) in [(-45, "1e-15"), (0, "1"), (35, "1e12")] {
        let scale: f64 = name.parse().unwrap();
        // Of a mass and a length, 10^power in the inertia altogether.
        let mass = 10.0_f64.powi(power) / (scale * scale);
        let shape = format!(
            "{{ shape = \"box\", mass = {mass:e}, edges = [{scale:e}, {:e}, {:e}] }}",
            2.0 * scale,
            3.0 * scale
        );
        let found = ensemble(&workspace, &shape).unwrap().inertia()[0];
        close(found, box_of(1.0).inertia * 10.0_f64.powi(power), ROUNDING, &shape);
    }
}

#[test]
fn messages_about_meshes_and_points_name_the_file_and_where_it_is_named() {
    let workspace = workspace("");
    fs::write(workspace.path("nan.obj"), "v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n").unwrap();
    fs::write(workspace.path("twice.stl"), stl_text(&box_mesh()).repeat(2)).unwrap();
    let refused = |file: &str| workspace.refused(&["inertia", file, "--mass", "1"], 2);
    assert_eq!(refused("nan.obj"), "error: nan.obj: vertex 1 has a coordinate that is not finite\n");
    assert_eq!(refused("twice.stl"), "error: twice.stl: 12 triangles occur twice: their volume would count twice\n");
    let refused = |inertia: &str| refusal(&workspace, inertia);
    assert!(
        refused("{ mesh = \"twice.stl\", mass = 1 }")
            .starts_with("study.toml:4: bodies.inertia.mesh = \"twice.stl\": ")
    );
    for key in ["points", "hull"] {
        let message = refused(&format!("{{ {key} = \"absent.csv\", mass = 1 }}"));
        let expected =
            format!("study.toml:4: bodies.inertia.{key} = \"absent.csv\": absent.csv: cannot be read: No such file");
        assert!(message.starts_with(&expected), "{message}");
    }
}

#[test]
fn parts_and_holes_make_the_body_that_they_make() {
    let workspace = workspace("");
    let tube =
        Shape::Tube { inner_radius: 1.0, outer_radius: 2.0, height: 1.0 }.mass_properties_of_density(3.0).unwrap();
    let parts = "{ parts = [{ shape = \"cylinder\", density = 3.0, radius = 2.0, height = 1.0 }, \
                 { shape = \"cylinder\", density = 3.0, radius = 1.0, height = 1.0, hole = true }] }";
    close(ensemble(&workspace, parts).unwrap().inertia()[0], tube.inertia, ROUNDING, "tube");

    let turn = DQuat::from_rotation_y(0.7);
    let cone = Part::new(Shape::Cone { radius: 1.0, height: 2.0 }.mass_properties(5.0).unwrap());
    let ball = Part::new(Shape::Sphere { radius: 0.5 }.mass_properties(2.0).unwrap());
    let point = Part::new(Shape::Point.mass_properties(1.0).unwrap());
    let expected =
        compose(&[cone.oriented(turn).at(DVec3::new(1.0, 0.0, 0.5)), ball.at(-DVec3::Y), point.at(DVec3::Z)]).unwrap();
    let parts = "[{ shape = \"cone\", mass = 5.0, radius = 1.0, height = 2.0, position = [1, 0, 0.5], \
                 orientation = { axis = [0, 1, 0], angle = 0.7 } }, \
                 { shape = \"sphere\", mass = 2.0, radius = 0.5, position = [0, -1, 0] }, \
                 { shape = \"point\", mass = 1, position = [0, 0, 1] }]";
    let found = ensemble(&workspace, &format!("{{ parts = {parts} }}")).unwrap();
    close(found.inertia()[0], expected.inertia, ROUNDING, "parts");
    let scaled = ensemble(&workspace, &format!("{{ parts = {parts}, mass = 16.0 }}")).unwrap();
    close(scaled.inertia()[0], expected.inertia * 2.0, ROUNDING, "parts of twice the mass");
}

#[test]
fn sizes_and_places_of_parts_are_drawn_each_by_itself() {
    let workspace = workspace("");
    let ball = "{ shape = \"sphere\", mass = 1.0, radius = { distribution = \"uniform\", low = 1, high = 2 }, \
                position = { distribution = \"uniform\", low = -1, high = 1 } }";
    let one = ensemble(&workspace, &format!("{{ parts = [{ball}] }}")).unwrap();
    // One ball: its place makes no difference, and its radius is drawn for each body.
    let radius = |body: usize| (2.5 * one.inertia()[body].xx).sqrt();
    assert!((0..20).all(|body| (1.0..2.0).contains(&radius(body))));
    assert!((radius(0) - radius(1)).abs() > 1e-6);
    // Two: the second is drawn under other columns, so that both are apart.
    let two = ensemble(&workspace, &format!("{{ parts = [{ball}, {ball}] }}")).unwrap();
    assert!((0..20).all(|body| two.inertia()[body].trace() > 1.01 * 2.0 * one.inertia()[body].trace().min(1.2)));
    assert!((0..20).all(|body| Validity::of(&two.inertia()[body]).defect().is_none()));
}

#[test]
fn scattered_moments_are_valid_and_keep_their_axes() {
    let workspace = workspace("");
    // A flat plate, which a scatter of the moments themselves would make impossible half of the time.
    for inertia in ["{ moments = [1, 2, 3], scatter = 0.5 }", "{ ixx = 2, iyy = 2, izz = 4, ixy = 1, scatter = 0.2 }"] {
        let ensemble = ensemble(&workspace, inertia).unwrap_or_else(|error| panic!("{inertia}: {error}"));
        assert!(ensemble.inertia()[0] != ensemble.inertia()[1], "{inertia}");
    }
    let tilted = ensemble(&workspace, "{ ixx = 2, iyy = 2, izz = 3.5, ixy = 1, scatter = 0.05 }").unwrap();
    for tensor in tilted.inertia() {
        let axis = principal_axes(tensor).axis_body(0);
        assert!((axis.dot(DVec3::new(1.0, -1.0, 0.0).normalize()).abs() - 1.0).abs() < ROUNDING, "{axis}");
    }
}

#[test]
fn every_shape_of_the_library_is_reachable() {
    let workspace = workspace("");
    let rod = ensemble(&workspace, "{ shape = \"rod\", mass = 3.0, length = 2.0 }").unwrap();
    assert_eq!(rod.inertia()[0], DVec3::new(1.0, 1.0, 0.0).into());
    assert!(rod.is_linear_rotor(0));
    let corners = "[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]";
    let found =
        ensemble(&workspace, &format!("{{ shape = \"tetrahedron\", mass = 3.0, corners = {corners} }}")).unwrap();
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let expected = Shape::Tetrahedron { corners }.mass_properties(3.0).unwrap();
    close(found.inertia()[0], expected.inertia, ROUNDING, "tetrahedron");
}

/// A cone on its apex, which is three quarters of its height from the centre of mass: I = 3 m (r²/20 + h²/5) across and 3 m r²/10 along.
#[test]
fn a_top_of_a_shape_has_its_tensor_about_the_pivot() {
    let workspace = workspace("");
    let top = |about: &str| {
        let cone = format!("{{ shape = \"cone\", mass = 2.0, radius = 0.5, height = 1.0{about} }}");
        let torque = "[[torque]]\nmodel = \"heavy-top\"\nmass = 2.0\ncentre = [0, 0, 0.75]\ngravity = [0, 0, -9.81]\n";
        let text = format!("{}\n{torque}", study_of(&cone));
        Study::parse(&workspace.path("study.toml"), &text).and_then(|study| study.ensemble())
    };
    let refused = top("").expect_err("about the centre of mass").to_string();
    assert!(refused.contains("bodies.inertia") && refused.contains("about = [x, y, z]"), "{refused}");
    let across = 3.0 * 2.0 * (0.25 / 20.0 + 1.0 / 5.0);
    let expected = DVec3::new(across, across, 0.3 * 2.0 * 0.25);
    let of_apex = [", about = [0, 0, 0.75]", ", about = [0, 0, \"-75 cm\"]"].map(|about| top(about).expect("a top"));
    for found in of_apex {
        close(found.inertia()[0], expected.into(), ROUNDING, "cone");
    }
    // Without the torque, and for a sphere of parts.
    let parts = "{ parts = [{ shape = \"sphere\", mass = 3.0, radius = 0.1 }], about = [0, 2, 0] }";
    let ball = 0.4 * 3.0 * 0.01;
    close(
        ensemble(&workspace, parts).expect("valid").inertia()[0],
        DVec3::new(ball + 12.0, ball, ball + 12.0).into(),
        ROUNDING,
        "sphere",
    );
    assert!(refusal(&workspace, "{ shape = \"rod\", mass = 3.0, length = 2.0, about = 3 }").contains("about"));
}

#[test]
fn what_makes_no_body_is_refused_where_it_stands() {
    let workspace = workspace("");
    let refused = |inertia: &str| refusal(&workspace, inertia);
    insta::assert_snapshot!(refused("{ mesh = \"open.obj\", mass = 1 }"), @r##"study.toml:4: bodies.inertia.mesh = "open.obj": mesh: open along 3 edges of 5.23606797749979 m in all (area vectors add up to 4.7619047619047616e-2 of the area instead of 0): expected a closed surface"##);
    insta::assert_snapshot!(refused("{ mesh = \"turned.obj\", mass = 1 }"), @r##"study.toml:4: bodies.inertia.mesh = "turned.obj": mesh: inside out (volume -6 m³): triangles must be counter-clockwise seen from outside"##);
    insta::assert_snapshot!(refused("{ mesh = \"absent.stl\", mass = 1 }"), @r##"study.toml:4: bodies.inertia.mesh = "absent.stl": absent.stl: entity not found"##);
    insta::assert_snapshot!(refused("{ mesh = \"box.ply\", mass = 1 }"), @r##"study.toml:4: bodies.inertia.mesh = "box.ply": box.ply: the name must end in .obj or .stl"##);
    insta::assert_snapshot!(refused("{ mesh = \"box.obj\" }"), @r##"study.toml:4: bodies.inertia.mass is missing: expected the mass (kg), or a density (kg/m³)"##);
    insta::assert_snapshot!(refused("{ mesh = \"box.obj\", mass = -1 }"), @r##"study.toml:4: bodies.inertia.mass = -1: a positive, finite number"##);
    insta::assert_snapshot!(refused("{ mesh = \"box.obj\", mass = 1, scale = 0 }"), @r##"study.toml:4: bodies.inertia.scale = 0: expected the length of the file's unit, above zero (m): 0.001 for millimetres"##);
    insta::assert_snapshot!(refused("{ mesh = \"box.obj\", masss = 1 }"), @r##"study.toml:4: bodies.inertia.masss is not known: did you mean mass? known here: mesh, mass, density, scale, shell, about"##);
    insta::assert_snapshot!(refused("{ points = \"box.obj\" }"), @r##"box.obj:1: v 4.5 -1.0 -1.5 is not known: known here: name, mass, x, y, z"##);
    insta::assert_snapshot!(refused("{ parts = [] }"), @r##"study.toml:4: bodies.inertia.parts = []: expected a list of parts: at least one, at most 65,536"##);
    insta::assert_snapshot!(refused("{ parts = [{ shape = \"sphere\", mass = 1 }] }"), @r##"study.toml:4: bodies.inertia.parts[1].radius is missing: expected a length (m)"##);
    insta::assert_snapshot!(refused("{ parts = [{ shape = \"sphere\", mass = 1, radius = 1 }, { shape = \"sphere\", mass = 1, radius = -2 }] }"), @r##"study.toml:4: bodies.inertia.parts[2].radius = -2: a positive, finite number"##);
    insta::assert_snapshot!(refused("{ parts = [{ shape = \"sphere\", mass = 1, radius = 1 }, { shape = \"sphere\", mass = 2, radius = 1, hole = true }] }"), @r##"study.toml:4: bodies.inertia = { parts = [{ shape = "sphere", mass = 1, radius = 1 }, { ...: mass of all parts = -1.0: a positive, finite number"##);
    insta::assert_snapshot!(refused("{ parts = [{ shape = \"sphere\", mass = 1, radius = 1 }, { shape = \"sphere\", mass = 0.9, radius = 2, hole = true }] }"), @r##"study.toml:4: bodies.inertia = { parts = [{ shape = "sphere", mass = 1, radius = 1 }, { ...: inertia tensor: largest principal moment = -1.04 kg m²: expected a positive number"##);
    insta::assert_snapshot!(refused("{ parts = [{ shape = \"sphere\", mass = 1, radius = { distribution = \"normal\", mean = 0, sigma = 1 } }, { shape = \"point\", mass = 1 }] }"), @r##"study.toml:4: bodies.inertia.parts[1].radius: body 0: radius = -1.2133095591435885: a positive, finite number"##);
    insta::assert_snapshot!(refused("{ moments = [1, 2, 3.5], scatter = 0.1 }"), @r##"study.toml:4: bodies.inertia.moments = [1, 2, 3.5]: inertia tensor: principal moments 1, 2, 3.5 kg m²: the largest exceeds the sum of the others by 1.4285714285714285e-1 of itself; at most 1e-12 is rounding"##);
    insta::assert_snapshot!(refused("{ moments = [1, 2, 3], scatter = -0.1 }"), @r##"study.toml:4: bodies.inertia.scatter = -0.1: expected a relative standard deviation that is not negative"##);
    insta::assert_snapshot!(refused("{ shape = \"tetrahedron\", mass = 1, corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]] }"), @r##"study.toml:4: bodies.inertia.corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]: expected four corners that do not lie in a plane (m)"##);
    insta::assert_snapshot!(refused("{ shape = \"point\", mass = 1 }"), @r##"study.toml:4: bodies.inertia: body 0: the greatest principal moment of inertia = 0.0: expected a positive number (kg m²)"##);
}

/// Six moments of which the second breaks the triangle inequality by 1 %, as a measurement may.
const MEASURED: &str = "ixx,iyy,izz,wx,wy,wz\n1,2,2.9,0,0,1\n1,2,3.03,0,0,1\n1,2,3,0,0,1\n";

const REPAIRED: &str = "[bodies]\nfile = \"bodies.csv\"\nrepair_triangle_inequality = 0.01\n[time]\nend = 1.0\n";

#[test]
fn a_repair_is_asked_for_by_name_and_reported() {
    let workspace = Workspace::new(&REPAIRED.replace("repair_triangle_inequality = 0.01\n", ""));
    fs::write(workspace.path("bodies.csv"), MEASURED).unwrap();
    let line = workspace.refused(&["run", "study.toml", "--engine", "cpu"], 2);
    assert!(line.starts_with("error: bodies.csv:3: I1 + I2 - I3 = "), "{line}");

    fs::write(workspace.path("study.toml"), REPAIRED).unwrap();
    let summary = workspace.done(&["run", "study.toml", "--engine", "cpu"]);
    assert!(summary.contains("repaired 1 inertia tensors"), "{summary}");
    let repairs = &report(&workspace, "study.out")["repairs"];
    assert_eq!((repairs["bodies"].as_u64(), repairs["limit"].as_f64()), (Some(1), Some(0.01)));
    let change = repairs["largest_relative_change"].as_f64().unwrap();
    assert!((change - 0.01 * 3.0_f64.sqrt() / DVec3::new(1.0, 2.0, 3.03).length()).abs() < 1e-12, "{change}");
    // Not even a quiet run is silent about it.
    let output = workspace.polhode(&["run", "study.toml", "--engine", "cpu", "--quiet", "--force"]);
    assert!(words(&output.stderr).starts_with("note: 1 of 3 inertia tensors were repaired"), "{output:?}");

    fs::write(workspace.path("study.toml"), REPAIRED.replace("0.01", "0.001")).unwrap();
    let line = workspace.refused(&["run", "study.toml", "--engine", "cpu", "--force"], 2);
    assert!(line.starts_with("error: bodies.csv:3: I1 + I2 - I3 = "), "{line}");
    fs::write(workspace.path("study.toml"), REPAIRED.replace("0.01", "0.5")).unwrap();
    workspace.refused(&["run", "study.toml", "--engine", "cpu", "--force"], 2);
}

#[test]
fn linear_rotors_come_from_studies_and_tables() {
    let study = "[bodies]\nfile = \"bodies.csv\"\n[[torque]]\nmodel = \"constant-world\"\ntorque = [0.1, 0.2, 0.3]\n\
                 [time]\nend = 1.0\n[accuracy]\nattitude = 1e-6\n";
    let workspace = Workspace::new(study);
    fs::write(workspace.path("bodies.csv"), "ixx,iyy,izz,wx,wy,wz\n2,0,2,0.5,0,0.1\n1,2,2.5,0,0,1\n").unwrap();
    workspace.done(&["run", "study.toml", "--engine", "cpu"]);
    let states = workspace::States::read(&workspace.path("study.out/final.csv"));
    let omega = states.vector(["wx", "wy", "wz"], 0);
    assert_eq!(omega.y, 0.0, "{omega}");
    assert!((states.column("kinetic_energy")[0] - omega.length_squared()).abs() < ROUNDING);
    fs::write(workspace.path("bodies.csv"), "ixx,iyy,izz,wx,wy,wz\n2,0,2,0.5,0.25,0.1\n").unwrap();
    let line = workspace.refused(&["run", "study.toml", "--engine", "cpu", "--force"], 2);
    assert!(line.starts_with("error: bodies.csv:2: angular velocity along the axis = 0.25"), "{line}");
    let expected = "a linear rotor (principal moments 0, I, I) has no spin about its axis: expected 0 (rad/s)\n";
    assert!(line.ends_with(expected), "{line}");
}

// --- polhode inertia ---

#[test]
fn inertia_prints_what_a_mesh_is() {
    let workspace = workspace("");
    let text = workspace.done(&["inertia", "box.obj", "--mass", "12", "--json", "--about=5,0,1"]);
    let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let numbers = |value: &serde_json::Value| -> Vec<f64> {
        value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
    };
    let near = |found: &[f64], expected: &[f64]| {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {expected:?}");
    };
    near(&[value["volume"].as_f64().unwrap(), value["mass"].as_f64().unwrap()], &[6.0, 12.0]);
    near(&numbers(&value["centre_of_mass"]), &[5.0, 0.0, 0.0]);
    near(&numbers(&value["inertia"]), &[13.0, 10.0, 5.0, 0.0, 0.0, 0.0]);
    near(&numbers(&value["about"]["inertia"]), &[25.0, 22.0, 5.0, 0.0, 0.0, 0.0]);
    near(&numbers(&value["principal_moments"]), &[5.0, 10.0, 13.0]);
    near(&numbers(&value["principal_axes"][0]).iter().map(|x| x.abs()).collect::<Vec<_>>(), &[0.0, 0.0, 1.0]);
    assert_eq!((value["class"].as_str(), value["defect"].is_null()), (Some("asymmetric"), true));
    near(&[value["relative_excess"].as_f64().unwrap()], &[-2.0 / 13.0]);

    let text = workspace.done(&["inertia", "box.stl", "--density", "2"]);
    for part in
        ["volume [m³]", "mass [kg]           1.2e1", "centre of mass [m]", "principal axes", "asymmetric", "yes"]
    {
        assert!(text.contains(part), "{part} is missing in {text}");
    }
}

#[test]
fn inertia_reads_points_tables_and_studies() {
    let workspace = workspace(&study_of(
        "{ shape = \"sphere\", mass = 5.0, radius = { distribution = \"uniform\", low = 1, high = 2 } }",
    ));
    let class = |arguments: &[&str]| {
        let text = workspace.done(&[&["inertia", "--json"], arguments].concat());
        let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        (value["class"].as_str().expect("a class").to_owned(), value["inertia"][0].as_f64().expect("a number"))
    };
    assert_eq!(class(&["pair.csv"]).0, "linear rotor");
    assert_eq!(class(&["atoms.csv", "--scale", "1e-10"]).0, "asymmetric");
    let (first, fourth) = (class(&["study.toml"]), class(&["study.toml", "--body", "3"]));
    assert_eq!(first.0, "spherical");
    assert!(first.1 != fourth.1);
    for (inertia, expected) in [
        ("{ shape = \"cylinder\", mass = 1.0, radius = 1.0, height = 0.1 }", "oblate"),
        ("{ shape = \"capsule\", mass = 1.0, radius = 1.0, length = 9.0 }", "prolate"),
        ("[1, 2, 2.5]", "asymmetric"),
        ("{ mesh = \"box.obj\", mass = 1.0 }", "asymmetric"),
    ] {
        fs::write(workspace.path("alone.toml"), format!("inertia = {inertia}\n")).unwrap();
        assert_eq!(class(&["alone.toml"]).0, expected, "{inertia}");
    }
    fs::write(workspace.path("alone.toml"), "inertia = [1, 2, 3.3]\n").unwrap();
    let text = workspace.done(&["inertia", "alone.toml"]);
    assert!(text.contains("valid               no: principal moments 1, 2, 3.3 kg m²"), "{text}");
    let line = workspace.refused(&["inertia", "alone.toml", "--about", "-1,0,0"], 2);
    assert!(line.contains("a tensor alone says nothing about other points"), "{line}");
}

#[test]
fn inertia_refuses_in_one_line() {
    let workspace = workspace("");
    let refused = |arguments: &[&str]| workspace.refused(&[&["inertia"], arguments].concat(), 2);
    assert!(refused(&["box.obj"]).contains("expected the mass of the mesh (kg), or its density (kg/m³)"));
    assert!(refused(&["open.obj", "--mass", "1"]).starts_with("error: open.obj: open along 3 edges"));
    assert!(refused(&["turned.obj", "--mass", "1"]).contains("inside out"));
    assert!(refused(&["box.obj", "--mass", "1", "--about", "1,2"]).contains("three finite numbers X,Y,Z"));
    assert!(refused(&["box.ply", "--mass", "1"]).contains(".stl, .obj, .csv or .toml"));
    assert!(refused(&["atoms.csv", "--density", "1"]).contains("leave it out"));
    refused(&["box.obj", "--mass", "1", "--density", "1"]);
    refused(&["absent.csv"]);
    refused(&["absent.toml"]);
    let help = workspace.done(&["inertia", "--help"]);
    for part in ["kg m²", "--about", "polhode inertia atoms.csv --scale 1e-10", "mass,x,y,z"] {
        assert!(help.contains(part), "{part} is missing in {help}");
    }
}

#[test]
fn options_that_mean_nothing_for_a_file_are_refused() {
    let workspace = workspace("");
    fs::write(workspace.path("alone.toml"), "inertia = [1.0, 2.0, 2.5]\n").unwrap();
    fs::write(workspace.path("two.csv"), "mass,x,y,z\n1,0,0,0\n1,1,0,0\n").unwrap();
    for (arguments, expected) in [
        (["two.csv", "--shell"].as_slice(), "error: shell = 1.0: only a mesh can be a skin: leave it out\n"),
        (&["alone.toml", "--shell"], "error: shell = 1.0: only a mesh can be a skin: leave it out\n"),
        (&["two.csv", "--body", "0"], "error: body = 0.0: only a study has several bodies: leave it out\n"),
        (
            &["box.obj", "--mass", "1", "--body", "3"],
            "error: body = 3.0: only a study has several bodies: leave it out\n",
        ),
    ] {
        assert_eq!(workspace.refused(&[&["inertia"], arguments].concat(), 2), expected, "{arguments:?}");
    }
    workspace.done(&["inertia", "alone.toml", "--body", "0"]);
}

#[test]
fn what_makes_no_mass_is_refused_with_its_file_and_line() {
    let workspace = workspace("");
    fs::write(workspace.path("light.csv"), "# two\nmass,x,y,z\n\n0,0,0,0\n0,1,0,0\n").unwrap();
    let line = workspace.refused(&["inertia", "light.csv"], 2);
    assert_eq!(line, "error: light.csv:4: total mass = 0.0: a positive, finite number\n");
    let sum = "# none\ninertia = { parts = [{ shape = \"sphere\", mass = 1, radius = 1 }, { shape = \"sphere\", mass = 2, radius = 1, \
               hole = true }] }\n";
    fs::write(workspace.path("sum.toml"), sum).unwrap();
    let line = workspace.refused(&["inertia", "sum.toml"], 2);
    assert!(line.starts_with("error: sum.toml:2: inertia = { parts = "), "{line}");
    assert!(line.ends_with(": mass of all parts = -1.0: a positive, finite number\n"), "{line}");
    fs::write(workspace.path("far.csv"), "mass,x,y,z\n# near\n1,0,0,0\n\n1,1e999,0,0\n").unwrap();
    let line = workspace.refused(&["inertia", "far.csv"], 2);
    assert_eq!(line, "error: far.csv:5: x = 1e999: expected a finite number (m)\n");
}
