//! Convex hulls, and meshes read from files.
#![cfg(feature = "mesh")]

use std::path::PathBuf;

use glam::DVec3;
use polhode::Error;
use polhode::bodies::inertia::*;
use polhode::error::FlatArrangement;
use polhode::error::MeshDefect;
use polhode::error::MeshFileProblem;
use proptest::prelude::*;

use crate::support::meshes::{obj_text, stl_text};

/// Six times the volume of the tetrahedron a, b, c, p: exact for coordinates that are integers below 2¹⁵.
fn height(mesh: &TriangleMesh, [a, b, c]: [usize; 3], p: DVec3) -> f64 {
    let [a, b, c] = [a, b, c].map(|v| mesh.vertices()[v]);
    (b - a).cross(c - a).dot(p - a)
}

/// A hull is closed, of one piece, convex, and holds all points.
fn assert_hull(points: &[DVec3], hull: &TriangleMesh) {
    let report = hull.report();
    assert_eq!(hull.defect(), None, "{report:?}");
    assert_eq!((report.flat_triangles, report.shared_edges), (0, 0), "{report:?}");
    // Euler: F = 2V − 4 for triangles around one piece without holes.
    assert_eq!(report.triangles, 2 * hull.vertices().len() - 4);
    for &triangle in hull.triangles() {
        for &point in points {
            let above = height(hull, triangle, point);
            assert!(above <= 0.0, "{point} lies above the face {triangle:?} by {above}");
        }
    }
    assert!(hull.vertices().iter().all(|v| points.contains(v)));
}

/// A point with integer coordinates of at most `size`.
fn lattice(size: i32) -> impl Strategy<Value = DVec3> {
    [-size..=size, -size..=size, -size..=size].prop_map(|c| DVec3::from_array(c.map(f64::from)))
}

proptest! {
    #[test]
    fn hulls_of_points_hold_all_points(points in prop::collection::vec(lattice(1000), 4..80)) {
        match convex_hull(&points) {
            Ok(hull) => assert_hull(&points, &hull),
            Err(error) => prop_assert!(points.len() < 6, "{error}"),
        }
    }

    #[test]
    fn hulls_of_points_that_share_planes_hold_all_points(points in prop::collection::vec(lattice(2), 4..60)) {
        // In a lattice of 125 points most faces hold many, and points repeat.
        match convex_hull(&points) {
            Ok(hull) => assert_hull(&points, &hull),
            Err(Error::FlatHull { points: count, .. }) => {
                prop_assert_eq!(count, points.len());
                let first = points[0];
                let volume = |a: DVec3, b: DVec3, c: DVec3| (a - first).cross(b - first).dot(c - first);
                for &a in &points { for &b in &points { for &c in &points {
                    prop_assert_eq!(volume(a, b, c), 0.0, "{} {} {} {} span a volume", first, a, b, c);
                } } }
            }
            Err(error) => prop_assert!(false, "{error}"),
        }
    }
}

#[test]
fn a_lattice_has_the_hull_of_its_cube() {
    let points: Vec<DVec3> =
        (0..512).map(|i| DVec3::new((i % 8) as f64, (i / 8 % 8) as f64, (i / 64) as f64)).collect();
    let hull = convex_hull(&points).unwrap();
    assert_hull(&points, &hull);
    let body = hull.mass_properties(2.0).unwrap();
    let cube = Shape::Box { edges: DVec3::splat(7.0) }.mass_properties(2.0).unwrap();
    assert!((body.volume - 343.0).abs() < 1e-10);
    assert!((body.inertia - cube.inertia).norm() < 1e-13 * cube.inertia.norm());
    assert!(body.centre_of_mass.distance(DVec3::splat(3.5)) < 1e-13);
}

#[test]
fn points_on_a_sphere_are_all_corners_of_their_hull() {
    // Fibonacci's lattice.
    let count = 5000;
    let points: Vec<DVec3> = (0..count)
        .map(|i| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
            let (sine, cosine) = (i as f64 * 2.399963229728653).sin_cos();
            DVec3::new((1.0 - z * z).sqrt() * cosine, (1.0 - z * z).sqrt() * sine, z)
        })
        .collect();
    let hull = convex_hull(&points).unwrap();
    assert_eq!(hull.vertices().len(), count);
    assert_eq!(hull.defect(), None);
    let body = hull.mass_properties(1.0).unwrap();
    assert!((body.inertia.zz / 0.4 - 1.0).abs() < 2e-3);
}

#[test]
fn hulls_of_molecules_and_moons_are_the_same_shape() {
    let points = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE, DVec3::new(0.3, 0.2, 0.4)];
    let hull = convex_hull(&points).unwrap();
    for scale in [1e-10, 1e7] {
        let scaled = convex_hull(&points.map(|p| p * scale)).unwrap();
        assert_eq!(scaled.triangles().len(), hull.triangles().len());
        let volume = scaled.mass_properties(1.0).unwrap().volume / scale.powi(3);
        assert!((volume / hull.mass_properties(1.0).unwrap().volume - 1.0).abs() < 1e-13);
    }
}

#[test]
fn points_without_a_hull_are_named_by_how_they_lie() {
    let arrangement = |points: &[DVec3]| match convex_hull(points) {
        Err(Error::FlatHull { arrangement, points: count }) => {
            assert_eq!(count, points.len());
            arrangement
        }
        other => panic!("{other:?}"),
    };
    assert_eq!(arrangement(&[]), FlatArrangement::Coincide);
    assert_eq!(arrangement(&[DVec3::ONE; 5]), FlatArrangement::Coincide);
    let line: Vec<_> = (0..6).map(|i| DVec3::new(1.0, 2.0, -0.5) * i as f64).collect();
    assert_eq!(arrangement(&line), FlatArrangement::OnALine);
    let plane: Vec<_> = (0..9).map(|i| DVec3::new((i % 3) as f64, (i / 3) as f64, (i % 3 + i / 3) as f64)).collect();
    assert_eq!(arrangement(&plane), FlatArrangement::InAPlane);
    // One point off the plane by the least that f64 knows there: a hull, if a thin one.
    let mut nearly = plane;
    nearly[4].z = nearly[4].z.next_up();
    assert!(convex_hull(&nearly).is_ok());
    assert!(matches!(convex_hull(&[DVec3::NAN]), Err(Error::Setting { field: "points", .. })));
}

/// A file that is removed again.
struct File(PathBuf);

impl File {
    fn new(name: &str, contents: impl AsRef<[u8]>) -> Self {
        let path = std::env::temp_dir().join(format!("polhode-{}-{name}", std::process::id()));
        std::fs::write(&path, contents).unwrap();
        Self(path)
    }
}

impl Drop for File {
    fn drop(&mut self) {
        // A file that stays behind in the temporary folder does no harm.
        let _ = std::fs::remove_file(&self.0);
    }
}

fn torus() -> TriangleMesh {
    Shape::Torus { major_radius: 2.0, minor_radius: 0.5 }.mesh(24).unwrap()
}

fn stl_bytes(mesh: &TriangleMesh) -> Vec<u8> {
    let mut bytes = vec![0; 80];
    bytes.extend((mesh.triangles().len() as u32).to_le_bytes());
    for triangle in mesh.triangles() {
        bytes.extend([0; 12]);
        for vertex in triangle.map(|v| mesh.vertices()[v].as_vec3()) {
            bytes.extend(vertex.to_array().iter().flat_map(|c| c.to_le_bytes()));
        }
        bytes.extend([0; 2]);
    }
    bytes
}

#[test]
fn obj_files_keep_all_digits() {
    let mesh = torus();
    let file = File::new("torus.obj", obj_text(&mesh));
    let read = read_mesh(&file.0).unwrap();
    assert_eq!(read.triangles().len(), mesh.triangles().len());
    let (found, expected) = (read.mass_properties(1.0).unwrap(), mesh.mass_properties(1.0).unwrap());
    assert!((found.inertia - expected.inertia).norm() < 1e-15 * expected.inertia.norm());
}

#[test]
fn obj_files_of_quads_and_several_groups_are_one_surface() {
    // A cube of quads in two objects, the second with negative indices.
    let text = "o bottom\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
                f 1 4 3 2\nf 1 2 6 5\nf 2 3 7 6\no top\nusemtl nowhere\nf 3 4 8 7\nf 4 1 5 8\nf -4 -3 -2 -1\n";
    let file = File::new("cube.OBJ", text);
    let body = read_mesh(&file.0).unwrap().mass_properties_of_density(2.0).unwrap();
    assert!((body.mass - 2.0).abs() < 1e-15 && body.centre_of_mass.distance(DVec3::splat(0.5)) < 1e-15);
    // In millimetres.
    let small = read_mesh(&file.0).unwrap().scaled(1e-3).unwrap().mass_properties_of_density(2.0).unwrap();
    assert!((small.mass / 2e-9 - 1.0).abs() < 1e-14);
}

#[test]
fn stl_files_of_both_kinds_are_closed_and_right_to_single_precision() {
    let mesh = torus();
    let expected = mesh.mass_properties(1.0).unwrap();
    let files = [File::new("text.stl", stl_text(&mesh)), File::new("binary.stl", stl_bytes(&mesh))];
    let read: Vec<_> = files.iter().map(|file| read_mesh(&file.0).unwrap()).collect();
    assert_eq!(read[0], read[1]);
    assert_eq!(read[0].vertices().len(), mesh.vertices().len());
    let found = read[0].mass_properties(1.0).unwrap();
    assert!((found.inertia - expected.inertia).norm() < 1e-6 * expected.inertia.norm());
}

#[test]
fn files_that_hold_no_mesh_are_named_with_what_is_wrong() {
    let problem = |name: &str, contents: &[u8]| {
        let file = File::new(name, contents);
        match read_mesh(&file.0) {
            Err(Error::MeshFile { path, problem }) => {
                assert_eq!(path, file.0);
                problem
            }
            other => panic!("{name}: {other:?}"),
        }
    };
    assert_eq!(problem("mesh.ply", b"ply"), MeshFileProblem::UnknownFormat);
    assert!(matches!(problem("bad.obj", b"v 1 2 three\n"), MeshFileProblem::Obj(_)));
    assert!(matches!(problem("beyond.obj", b"v 1 2 3\nf 1 2 3\n"), MeshFileProblem::Obj(_)));
    assert_eq!(problem("empty.obj", b"# nothing\n"), MeshFileProblem::Empty);
    let cut = stl_bytes(&torus());
    assert!(matches!(problem("cut.stl", &cut[..cut.len() - 20]), MeshFileProblem::Stl { .. }));
    assert!(matches!(problem("short.stl", b"no"), MeshFileProblem::Stl { .. }));
    assert_eq!(problem("empty.stl", &[0; 84]), MeshFileProblem::Empty);
    let missing = std::env::temp_dir().join("polhode-there-is-no-such-file.stl");
    assert!(matches!(
        read_mesh(&missing),
        Err(Error::MeshFile { problem: MeshFileProblem::Io(std::io::ErrorKind::NotFound), .. })
    ));
}

// --- files that say more or less than they hold ---

fn cube(from: f64, edge: f64) -> TriangleMesh {
    let mesh = Shape::Box { edges: DVec3::splat(edge) }.mesh(8).expect("a box");
    let moved = mesh.vertices().iter().map(|&v| v + DVec3::splat(0.5 * edge) + DVec3::X * from).collect();
    TriangleMesh::new(moved, mesh.triangles().to_vec()).expect("a mesh")
}

/// Both surfaces as one mesh.
fn united(a: &TriangleMesh, b: &TriangleMesh) -> TriangleMesh {
    let corners = |mesh: &TriangleMesh| {
        mesh.triangles().iter().map(|triangle| triangle.map(|v| mesh.vertices()[v])).collect::<Vec<_>>()
    };
    TriangleMesh::from_corners([corners(a), corners(b)].concat()).expect("a mesh")
}

fn volume(mesh: &TriangleMesh) -> f64 {
    assert_eq!(mesh.defect(), None);
    assert_eq!(mesh.overlap(), None);
    mesh.mass_properties_of_density(1.0).expect("a body").mass
}

#[test]
fn the_second_solid_of_a_text_stl_is_read() {
    let text = stl_text(&cube(0.0, 1.0)) + "\n" + &stl_text(&cube(3.0, 2.0));
    for text in [text.clone(), text.to_uppercase(), text.replace('\n', "\r\n")] {
        let file = File::new("two.stl", text);
        assert!((volume(&read_mesh(&file.0).expect("two solids")) - 9.0).abs() < 1e-12);
    }
}

#[test]
fn a_binary_stl_has_the_size_that_it_says() {
    let whole = stl_bytes(&cube(0.0, 1.0));
    let mut beyond = whole.clone();
    beyond.extend([0; 600]);
    let message = |bytes: &[u8]| read_mesh(&File::new("sized.stl", bytes).0).expect_err("refused").to_string();
    assert!(message(&beyond).contains("it has 1284 bytes, 684 are needed for the 12 triangles that it says it has"));
    for end in 0..whole.len() {
        message(&whole[..end]);
    }
    // A header that begins as a text's.
    let mut named = whole;
    named[..10].copy_from_slice(b"solid cube");
    assert!((volume(&read_mesh(&File::new("named.stl", named).0).expect("binary")) - 1.0).abs() < 1e-12);
}

#[test]
fn a_text_mesh_cut_anywhere_is_refused_or_whole() {
    let mesh = cube(0.0, 1.0);
    for (name, text) in [("anywhere.stl", stl_text(&mesh)), ("anywhere.obj", obj_text(&mesh))] {
        let whole = read_mesh(&File::new(name, text.clone()).0).expect("whole");
        for end in 0..text.len() {
            let read = read_mesh(&File::new(name, &text[..end]).0);
            // What is left of a file that was cut between two lines is open.
            assert!(read.is_err() || read.is_ok_and(|mesh| mesh == whole || mesh.defect().is_some()), "{name}, {end}");
        }
    }
}

#[test]
fn surfaces_that_enclose_something_twice_are_found() {
    let unit = cube(0.0, 1.0);
    let doubled = united(&unit, &unit);
    assert_eq!(doubled.defect(), None);
    assert_eq!(doubled.overlap(), Some(MeshDefect::Doubled { triangles: 12 }));
    let bow_tie = {
        // A quadrilateral that crosses itself, drawn out along z; one lobe is larger.
        let outline = [(0.0, 0.0), (3.0, 2.0), (3.0, 0.0), (0.0, 1.0)];
        let vertices = [0.0, 1.0].iter().flat_map(|&z| outline.map(|(x, y)| DVec3::new(x, y, z))).collect();
        let sides = (0..4).flat_map(|i| {
            let j = (i + 1) % 4;
            [[i, j, j + 4], [i, j + 4, i + 4]]
        });
        let caps = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]];
        let mesh = TriangleMesh::new(vertices, sides.chain(caps).collect()).expect("a mesh");
        if mesh.report().signed_volume > 0.0 { mesh } else { mesh.turned_inside_out() }
    };
    for (name, mesh, expected) in [
        ("overlapping", united(&unit, &cube(0.5, 1.0)), 2),
        ("overlapping askew", united(&unit, &cube(0.9, 0.7)), 2),
        (
            "nested",
            united(&cube(0.0, 3.0), &Shape::Sphere { radius: 0.2 }.mesh(64).map(|ball| moved(&ball, 1.5)).unwrap()),
            2,
        ),
        ("bow-tie", bow_tie, -1),
    ] {
        assert_eq!(mesh.defect(), None, "{name}");
        match mesh.overlap() {
            Some(MeshDefect::Overlapping { winding, .. }) => assert_eq!(winding, expected, "{name}"),
            other => panic!("{name}: {other:?}"),
        }
    }
}

fn moved(mesh: &TriangleMesh, by: f64) -> TriangleMesh {
    let vertices = mesh.vertices().iter().map(|&v| v + DVec3::splat(by)).collect();
    TriangleMesh::new(vertices, mesh.triangles().to_vec()).expect("a mesh")
}

#[test]
fn sound_surfaces_are_left_alone() {
    let unit = cube(0.0, 1.0);
    let cavity = united(&cube(0.0, 3.0), &moved(&unit.turned_inside_out(), 1.0));
    assert!((volume(&cavity) - 26.0).abs() < 1e-12);
    // Two cubes with a wall between them, and two that touch along an edge.
    assert!((volume(&united(&unit, &cube(1.0, 1.0))) - 2.0).abs() < 1e-12);
    assert!((volume(&united(&unit, &cube(5.0, 1.0))) - 2.0).abs() < 1e-12);
    for shape in [
        Shape::Torus { major_radius: 3.0, minor_radius: 1.0 },
        Shape::Tube { inner_radius: 0.99, outer_radius: 1.0, height: 50.0 },
        Shape::Capsule { radius: 1e-3, length: 1.0 },
        Shape::Box { edges: DVec3::new(1e-4, 1.0, 10.0) },
    ] {
        for scale in [1e-9, 1e9] {
            let mesh = shape.mesh(16).expect("a mesh").scaled(scale).expect("a scale");
            assert_eq!(mesh.overlap(), None, "{shape:?}");
            assert_eq!(moved(&mesh, 100.0 * scale).overlap(), None, "{shape:?} far away");
        }
    }
}

#[test]
fn a_mesh_whose_volume_or_moments_leave_the_range_of_numbers_is_refused_as_such() {
    let tetrahedron = |edge: f64| {
        let vertices = vec![DVec3::ZERO, DVec3::X * edge, DVec3::Y * edge, DVec3::Z * edge];
        TriangleMesh::new(vertices, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).expect("a mesh")
    };
    for edge in [1e70, 1e110, 1e308] {
        let mesh = tetrahedron(edge);
        for found in [mesh.mass_properties_of_density(1.0), mesh.mass_properties(1.0), mesh.shell_mass_properties(1.0)]
        {
            match found {
                Err(error) => assert_eq!(error, Error::Mesh(MeshDefect::OutOfRange), "{edge:e} m"),
                Ok(body) => assert!(edge < 1e100 && body.inertia.to_array().iter().all(|x| x.is_finite()), "{body:?}"),
            }
        }
    }
    assert!(tetrahedron(1e50).mass_properties_of_density(1.0).is_ok());
}
