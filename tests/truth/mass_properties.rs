//! Shapes against quadrature, meshes against shapes, and everything else that makes mass properties.

use crate::strategies;

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use polhode::Error;
use polhode::bodies::inertia::*;
use polhode::error::InertiaDefect;
use polhode::error::MeshDefect;
use proptest::prelude::*;
use strategies::{body, cloud, moments, orientation, vector};

/// Closed formulas and Gauss quadrature of polynomials of low degree: a hundred operations or so.
const ROUNDING: f64 = 1e-12;

/// Nodes and weights of Gauss and Legendre on [0, 1], by Newton's method on the Legendre polynomial.
fn gauss(count: usize) -> Vec<(f64, f64)> {
    (0..count)
        .map(|i| {
            let mut x = (PI * (i as f64 + 0.75) / (count as f64 + 0.5)).cos();
            let mut slope = 0.0;
            for _ in 0..100 {
                let (mut previous, mut value) = (1.0, x);
                for n in 2..=count {
                    let n = n as f64;
                    (previous, value) = (value, ((2.0 * n - 1.0) * x * value - (n - 1.0) * previous) / n);
                }
                slope = count as f64 * (x * value - previous) / (x * x - 1.0);
                x -= value / slope;
            }
            (0.5 + 0.5 * x, 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// A map from the unit cube to places of a body, with what a unit of the cube's volume holds of the body's matter.
type Chart = Box<dyn Fn(f64, f64, f64) -> (DVec3, f64)>;

/// Measure, centre of mass and tensor for a density of one, by Gauss quadrature over charts.
fn quadrature(charts: &[Chart]) -> (f64, DVec3, InertiaTensor) {
    let nodes = gauss(24);
    let mut points = Vec::new();
    for chart in charts {
        for (u, a) in &nodes {
            for (v, b) in &nodes {
                for (w, c) in &nodes {
                    let (place, density) = chart(*u, *v, *w);
                    points.push((density * a * b * c, place));
                }
            }
        }
    }
    let body = point_masses(&points).expect("densities are positive");
    (body.mass, body.centre_of_mass, body.inertia)
}

fn chart(map: impl Fn(f64, f64, f64) -> (DVec3, f64) + 'static) -> Chart {
    Box::new(map)
}

fn polar(radius: f64, angle: f64, z: f64) -> DVec3 {
    DVec3::new(radius * angle.cos(), radius * angle.sin(), z)
}

/// A point of the unit sphere at height `z`.
fn on_sphere(z: f64, angle: f64) -> DVec3 {
    polar((1.0 - z * z).sqrt(), angle, z)
}

fn cylinder_chart(inner: f64, outer: f64, height: f64) -> Chart {
    chart(move |u, v, w| {
        let radius = inner + (outer - inner) * u;
        (polar(radius, TAU * v, height * (w - 0.5)), radius * (outer - inner) * TAU * height)
    })
}

/// Every shape, its lengths in units of `unit` m, with the charts that cover it.
fn shapes(unit: f64) -> Vec<(Shape, Vec<Chart>)> {
    let ball = |axes: DVec3| {
        chart(move |u, v, w| (on_sphere(2.0 * v - 1.0, TAU * w) * u * axes, u * u * 2.0 * TAU * axes.element_product()))
    };
    let half_ball = |radius: f64, end: f64, sign: f64| {
        chart(move |u, v, w| (on_sphere(sign * v, TAU * w) * u * radius + DVec3::Z * end, u * u * TAU * radius.powi(3)))
    };
    let (radius, height) = (0.7 * unit, 1.9 * unit);
    let (inner_radius, outer_radius) = (0.4 * unit, 1.1 * unit);
    let (major_radius, minor_radius) = (1.3 * unit, 0.6 * unit);
    let (width, depth) = (0.8 * unit, 2.1 * unit);
    let semi_axes = DVec3::new(0.5, 1.2, 2.0) * unit;
    let edges = DVec3::new(0.3, 1.7, 2.2) * unit;
    let corners =
        [DVec3::new(0.1, -0.2, 0.3), DVec3::new(1.5, 0.2, -0.4), DVec3::new(0.2, 1.1, 0.0), DVec3::new(-0.5, 0.3, 2.0)]
            .map(|corner| corner * unit);
    vec![
        (Shape::Rod { length: height }, vec![chart(move |u, _, _| (DVec3::Z * height * (u - 0.5), height))]),
        (
            Shape::RectangularPlate { width, depth },
            vec![chart(move |u, v, _| (DVec3::new(width * (u - 0.5), depth * (v - 0.5), 0.0), width * depth))],
        ),
        (
            Shape::CircularPlate { radius },
            vec![chart(move |u, v, _| (polar(radius * u, TAU * v, 0.0), TAU * u * radius * radius))],
        ),
        (Shape::Sphere { radius }, vec![ball(DVec3::splat(radius))]),
        (
            Shape::SphericalShell { radius },
            vec![chart(move |u, v, _| (on_sphere(2.0 * u - 1.0, TAU * v) * radius, 2.0 * TAU * radius * radius))],
        ),
        (Shape::Ellipsoid { semi_axes }, vec![ball(semi_axes)]),
        (
            Shape::Box { edges },
            vec![chart(move |u, v, w| ((DVec3::new(u, v, w) - 0.5) * edges, edges.element_product()))],
        ),
        (Shape::Cylinder { radius, height }, vec![cylinder_chart(0.0, radius, height)]),
        (Shape::Tube { inner_radius, outer_radius, height }, vec![cylinder_chart(inner_radius, outer_radius, height)]),
        (
            Shape::Capsule { radius, length: height },
            vec![
                cylinder_chart(0.0, radius, height),
                half_ball(radius, 0.5 * height, 1.0),
                half_ball(radius, -0.5 * height, -1.0),
            ],
        ),
        (
            Shape::Cone { radius, height },
            vec![chart(move |u, v, w| {
                let here = radius * (1.0 - w);
                (polar(u * here, TAU * v, height * w), TAU * u * here * here * height)
            })],
        ),
        (
            Shape::Torus { major_radius, minor_radius },
            vec![chart(move |u, v, w| {
                let section = polar(minor_radius * u, TAU * v, 0.0);
                let radius = major_radius + section.x;
                (polar(radius, TAU * w, section.y), TAU * TAU * u * minor_radius * minor_radius * radius)
            })],
        ),
        (
            Shape::Tetrahedron { corners },
            vec![chart(move |u, v, w| {
                let [a, b, c, d] = corners;
                // Duffy's map of the cube onto the simplex.
                let (x, y, z) = (u * v * w, u * v * (1.0 - w), u * (1.0 - v));
                let volume = (b - a).cross(c - a).dot(d - a).abs();
                (a + (b - a) * x + (c - a) * y + (d - a) * z, volume * u * u * v)
            })],
        ),
    ]
}

/// |difference| of mass properties, each in its own size.
fn deviation(found: &MassProperties, expected: &MassProperties) -> f64 {
    let length = (expected.inertia.trace() / expected.mass).sqrt();
    let mass = (found.mass / expected.mass - 1.0).abs();
    let centre = found.centre_of_mass.distance(expected.centre_of_mass) / length;
    mass.max(centre).max((found.inertia - expected.inertia).norm() / expected.inertia.norm())
}

#[test]
fn formulas_of_all_shapes_agree_with_quadrature() {
    for (shape, charts) in shapes(1.0) {
        let (measure, centre_of_mass, inertia) = quadrature(&charts);
        if shape.volume() > 0.0 {
            let error = (shape.volume() / measure - 1.0).abs();
            assert!(error < ROUNDING, "{shape:?}: volume {} instead of {measure}", shape.volume());
        }
        let found = shape.mass_properties(2.5).unwrap();
        let expected =
            MassProperties { mass: measure, volume: measure, centre_of_mass, inertia }.with_mass(2.5).unwrap();
        let error = deviation(&found, &expected);
        assert!(error < ROUNDING, "{shape:?}: {found:?} instead of {expected:?}");
        // Planted fault: one element wrong by a part in a million is found.
        let mut wrong = found;
        wrong.inertia.xx *= 1.0 + 1e-6;
        assert!(deviation(&wrong, &expected) > ROUNDING, "{shape:?}");
    }
}

/// Masses and lengths from those of molecules to those of planets.
const MASS_SCALES: [f64; 4] = [1e-30, 1e-27, 1e24, 1e30];
const LENGTH_SCALES: [f64; 4] = [1e-10, 1e-6, 1e6, 1e9];

/// Mass properties under scale: mass and inertia in proportion to the mass, lengths to the length.
fn check_scale(what: &str, base: &MassProperties, make: impl Fn(f64, f64) -> MassProperties) {
    for mass in MASS_SCALES {
        for length in LENGTH_SCALES {
            let found = make(mass, length);
            let expected = MassProperties {
                mass: base.mass * mass,
                volume: base.volume * length.powi(3),
                centre_of_mass: base.centre_of_mass * length,
                inertia: base.inertia * (mass * length * length),
            };
            let error = deviation(&found, &expected);
            assert!(error < ROUNDING, "{what}, {mass:e} and {length:e}: {found:?} instead of {expected:?}");
            let volume = if base.volume == 0.0 { found.volume } else { found.volume / expected.volume - 1.0 };
            assert!(volume.abs() < ROUNDING, "{what}, {mass:e} and {length:e}: volume {:e}", found.volume);
            let class = |body: &MassProperties| classify(body.principal_axes().moments, 1e-9);
            assert_eq!(class(&found), class(base), "{what}, {mass:e} and {length:e}");
            let is_valid = |body: &MassProperties| Validity::of(&body.inertia).defect().is_none();
            assert_eq!(is_valid(&found), is_valid(base), "{what}, {mass:e} and {length:e}");
        }
    }
}

#[test]
fn every_source_of_mass_properties_follows_the_scale() {
    for (index, (shape, _)) in shapes(1.0).into_iter().enumerate() {
        let base = shape.mass_properties(2.5).unwrap();
        check_scale(&format!("{shape:?}"), &base, |mass, length| {
            shapes(length)[index].0.mass_properties(2.5 * mass).unwrap()
        });
    }
    let mesh = Shape::Tetrahedron { corners: [DVec3::ZERO, DVec3::X * 1.3, DVec3::new(0.2, 1.1, 0.0), DVec3::ONE] }
        .mesh(8)
        .unwrap();
    check_scale("mesh", &mesh.mass_properties(2.5).unwrap(), |mass, length| {
        mesh.scaled(length).unwrap().mass_properties(2.5 * mass).unwrap()
    });
    check_scale("shell", &mesh.shell_mass_properties(2.5).unwrap(), |mass, length| {
        mesh.scaled(length).unwrap().shell_mass_properties(2.5 * mass).unwrap()
    });
    let hull = |length: f64| {
        let points: Vec<DVec3> = mesh.vertices().iter().map(|&vertex| vertex * length).collect();
        convex_hull(&points).unwrap()
    };
    check_scale("hull", &hull(1.0).mass_properties(2.5).unwrap(), |mass, length| {
        hull(length).mass_properties(2.5 * mass).unwrap()
    });
    let points = |mass: f64, length: f64| {
        let of = |(m, place): (f64, DVec3)| (m * mass, place * length);
        point_masses(&[(1.0, DVec3::X), (2.0, DVec3::Y), (0.5, DVec3::Z), (3.0, -DVec3::ONE)].map(of)).unwrap()
    };
    check_scale("points", &points(1.0, 1.0), points);
    let parts = |mass: f64, length: f64| {
        let ball = Shape::Sphere { radius: 2.0 * length }.mass_properties(30.0 * mass).unwrap();
        let hole = Shape::Sphere { radius: 0.5 * length }.mass_properties(3.0 * mass).unwrap();
        compose(&[Part::new(ball), Part::new(hole).as_hole().at(0.7 * length * DVec3::X)]).unwrap()
    };
    check_scale("a ball with a hole", &parts(1.0, 1.0), parts);
    let nominal = DVec3::new(1.0, 2.0, 2.5);
    let normals = DVec3::new(-1.0, 0.5, 2.0);
    let scattered = scattered_moments(nominal, 0.3, normals).unwrap();
    for scale in MASS_SCALES {
        let found = scattered_moments(nominal * scale, 0.3, normals).unwrap();
        assert!((found / scale - scattered).length() < ROUNDING * scattered.length(), "{scale:e}");
    }
}

#[test]
fn meshes_of_all_shapes_converge_at_second_order() {
    for (shape, _) in shapes(1.0) {
        if matches!(shape, Shape::Rod { .. } | Shape::RectangularPlate { .. } | Shape::CircularPlate { .. }) {
            assert!(matches!(shape.mesh(8), Err(Error::Setting { field: "volume", .. })));
            continue;
        }
        let exact = shape.mass_properties(1.0).unwrap();
        let errors: Vec<[f64; 2]> = [16, 32, 64, 128, 256]
            .into_iter()
            .map(|segments| {
                let mesh = shape.mesh(segments).unwrap();
                let shell = matches!(shape, Shape::SphericalShell { .. });
                let found = if shell { mesh.shell_mass_properties(1.0) } else { mesh.mass_properties(1.0) }.unwrap();
                let volume = if shell { 0.0 } else { (found.volume / exact.volume - 1.0).abs() };
                [deviation(&found, &exact), volume]
            })
            .collect();
        if matches!(shape, Shape::Box { .. } | Shape::Tetrahedron { .. }) {
            assert!(errors.as_flattened().iter().all(|&e| e < ROUNDING), "{shape:?}: {errors:?}");
            continue;
        }
        for kind in 0..2 {
            if errors[0][kind] == 0.0 {
                continue;
            }
            let order = (errors[1][kind] / errors[4][kind]).log2() / 3.0;
            assert!((order - 2.0).abs() < 0.1, "{shape:?}: order {order}, errors {errors:?}");
        }
    }
}

#[test]
fn an_open_or_turned_mesh_is_reported_with_how_far() {
    let mesh = Shape::Sphere { radius: 2.0 }.mesh(32).unwrap();
    let report = mesh.report();
    assert_eq!((report.boundary_edges, report.inconsistent_edges, report.shared_edges), (0, 0, 0));
    assert!(report.closure_defect < 1e-15 && report.signed_volume > 0.0);

    let turned = mesh.turned_inside_out();
    let Err(Error::Mesh(MeshDefect::InsideOut { signed_volume })) = turned.mass_properties(1.0) else {
        panic!("an inside-out mesh passed");
    };
    assert!((signed_volume + report.signed_volume).abs() < 1e-12);
    assert_eq!(turned.turned_inside_out().mass_properties(1.0).unwrap(), mesh.mass_properties(1.0).unwrap());

    let mut triangles = mesh.triangles().to_vec();
    let lost = triangles.pop().unwrap();
    let open = TriangleMesh::new(mesh.vertices().to_vec(), triangles.clone()).unwrap();
    let Err(Error::Mesh(MeshDefect::Open { boundary_edges, boundary_length, closure_defect })) =
        open.mass_properties(1.0)
    else {
        panic!("an open mesh passed");
    };
    let [a, b, c] = lost.map(|v| mesh.vertices()[v]);
    assert_eq!(boundary_edges, 3);
    assert!((boundary_length - (a.distance(b) + b.distance(c) + c.distance(a))).abs() < 1e-14);
    let missing = 0.5 * (b - a).cross(c - a).length();
    assert!((closure_defect / (missing / open.report().area) - 1.0).abs() < 1e-9);

    triangles.push([lost[0], lost[2], lost[1]]);
    let mixed = TriangleMesh::new(mesh.vertices().to_vec(), triangles).unwrap();
    assert_eq!(mixed.defect(), Some(MeshDefect::Inconsistent { edges: 3 }));

    let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    let leaf = TriangleMesh::new(corners.clone(), vec![[0, 1, 2], [0, 2, 1]]).unwrap();
    assert_eq!(leaf.defect(), Some(MeshDefect::NoVolume));
    assert!(matches!(
        TriangleMesh::new(corners.clone(), vec![[0, 1, 3]]),
        Err(Error::Mesh(MeshDefect::NoSuchVertex { triangle: 0, vertex: 3, vertices: 3 }))
    ));
    assert!(matches!(TriangleMesh::new(corners.clone(), vec![[0, 1, 1]]), Err(Error::Mesh(MeshDefect::Empty))));
    let mut broken = corners;
    broken[1].z = f64::NAN;
    assert!(matches!(
        TriangleMesh::new(broken, vec![[0, 1, 2]]),
        Err(Error::Mesh(MeshDefect::NotFinite { vertex: 1 }))
    ));
}

#[test]
fn a_far_away_mesh_keeps_its_digits() {
    let shape = Shape::Torus { major_radius: 1.0, minor_radius: 0.25 };
    let near = shape.mesh(40).unwrap();
    let shift = DVec3::new(4096.0, -8192.0, 1024.0);
    // Multiples of 2⁻³⁰, so that the shift itself is exact.
    let rounded = |v: &DVec3| (*v * 2.0_f64.powi(30)).round() * 2.0_f64.powi(-30);
    let vertices: Vec<DVec3> = near.vertices().iter().map(rounded).collect();
    let moved = vertices.iter().map(|v| *v + shift).collect();
    let near = TriangleMesh::new(vertices, near.triangles().to_vec()).unwrap().mass_properties(3.0).unwrap();
    let far = TriangleMesh::new(moved, shape.mesh(40).unwrap().triangles().to_vec()).unwrap();
    let far = far.mass_properties(3.0).unwrap();
    assert!((far.inertia - near.inertia).norm() < 1e-14 * near.inertia.norm());
    assert!(far.centre_of_mass.distance(near.centre_of_mass + shift) < 1e-11);
}

#[test]
fn lengths_that_no_body_has_are_refused_by_name() {
    let field = |shape: Shape| match shape.mass_properties(1.0) {
        Err(Error::Setting { field, .. }) => field,
        other => panic!("{other:?}"),
    };
    assert_eq!(field(Shape::Sphere { radius: -1.0 }), "radius");
    assert_eq!(field(Shape::Cone { radius: 1.0, height: f64::NAN }), "height");
    assert_eq!(field(Shape::Tube { inner_radius: 2.0, outer_radius: 1.0, height: 1.0 }), "inner_radius");
    assert_eq!(field(Shape::Torus { major_radius: 1.0, minor_radius: 1.5 }), "minor_radius");
    assert_eq!(field(Shape::Box { edges: DVec3::new(1.0, 0.0, 1.0) }), "edges");
    let flat = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.0)];
    assert_eq!(field(Shape::Tetrahedron { corners: flat }), "volume of the tetrahedron");
    assert!(Shape::Sphere { radius: 1.0 }.mass_properties(0.0).is_err());
    assert!(Shape::Rod { length: 1.0 }.mass_properties_of_density(1.0).is_err());
}

#[test]
fn tensors_that_no_body_has_are_refused_with_how_far() {
    let defect = |moments: [f64; 3]| Validity::of(&InertiaTensor::from_principal_moments(moments.into())).defect();
    assert_eq!(defect([1.0, 2.0, 3.0]), None);
    assert_eq!(defect([1.0, 2.0, 3.0 * (1.0 + 0.9e-12)]), None);
    assert!(matches!(defect([1.0, 2.0, 3.0 * (1.0 + 2e-12)]), Some(InertiaDefect::TriangleInequality { .. })));
    assert!(matches!(defect([-1.0, 2.0, 3.0]), Some(InertiaDefect::NegativeMoment { moment: -1.0, .. })));
    assert!(matches!(defect([0.0, 2.0, 2.0]), Some(InertiaDefect::VanishingMoment { .. })));
    assert!(matches!(defect([0.0, 0.0, 0.0]), Some(InertiaDefect::NoInertia { largest: 0.0 })));
    assert!(matches!(defect([1.0, f64::NAN, 1.0]), Some(InertiaDefect::NotFinite { element: "iyy", .. })));
    // A product of inertia given instead of the element: wrong by sign, and found only if it goes too far.
    let tensor = InertiaTensor { xx: 1.0, yy: 1.0, zz: 1.0, xy: 0.9, xz: 0.9, yz: 0.9 };
    assert!(matches!(Validity::of(&tensor).defect(), Some(InertiaDefect::TriangleInequality { .. })));
    let huge_hole = Part::new(Shape::Sphere { radius: 2.0 }.mass_properties(1.0).unwrap()).as_hole();
    let ball = Part::new(Shape::Sphere { radius: 1.0 }.mass_properties(2.0).unwrap());
    let Err(Error::Inertia(InertiaDefect::NoInertia { largest })) = compose(&[ball, huge_hole]) else {
        panic!("a hole larger than the body passed");
    };
    assert!((largest - (0.8 - 1.6)).abs() < 1e-15);
}

#[test]
fn a_linear_rotor_is_a_class_of_its_own() {
    let rod = Shape::Rod { length: 2.0 }.mass_properties(1.0).unwrap();
    let turned = rod.placed(DQuat::from_axis_angle(DVec3::new(0.6, 0.8, 0.0), 0.7), DVec3::X);
    let axes = turned.principal_axes();
    assert_eq!(classify(axes.moments, 1e-12), InertiaClass::LinearRotor);
    let defect = Validity::of(&turned.inertia).defect();
    assert!(matches!(defect, Some(InertiaDefect::VanishingMoment { .. })), "{defect:?}");
    let classes = [
        ([1.0, 1.0, 1.0], InertiaClass::Spherical),
        ([1.0, 2.0, 2.0], InertiaClass::Prolate),
        ([1.0, 1.0, 2.0], InertiaClass::Oblate),
        ([1.0, 1.5, 2.0], InertiaClass::Asymmetric),
        ([0.0, 0.0, 0.0], InertiaClass::Point),
    ];
    for (moments, class) in classes {
        assert_eq!(classify(DVec3::from_array(moments), 1e-12), class);
    }
}

proptest! {
    #[test]
    fn a_body_cut_in_parts_is_the_body(points in cloud(), q in orientation(), offset in vector(2.0)) {
        let whole = point_masses(&points).expect("a cloud is a body").placed(q, offset);
        let parts: Vec<_> = points.iter()
            .map(|&point| Part::new(point_masses(&[point]).unwrap()).oriented(q).at(offset))
            .collect();
        let composed = compose(&parts).unwrap();
        prop_assert!(deviation(&composed, &whole) < ROUNDING);
        // A hole takes away what was added.
        let extra = Part::new(Shape::Sphere { radius: 0.5 }.mass_properties(3.0).unwrap()).at(offset);
        let back = compose(&[Part::new(compose(&[Part::new(whole), extra]).unwrap()), extra.as_hole()]).unwrap();
        prop_assert!(deviation(&back, &whole) < ROUNDING);
        prop_assert_eq!(back.volume, 0.0, "of points, after what was added is taken away");
        let ball = Shape::Sphere { radius: 2.0 }.mass_properties(30.0).unwrap();
        let hollow = compose(&[Part::new(ball), extra.at(DVec3::ZERO).as_hole()]).unwrap();
        let expected = 4.0 / 3.0 * PI * (8.0 - 0.125);
        prop_assert!((hollow.volume / expected - 1.0).abs() < ROUNDING, "{}", hollow.volume);
    }

    #[test]
    fn a_heavier_body_keeps_its_shape(body in body(), factor in 0.1..10.0_f64) {
        let heavier = body.with_mass(factor * body.mass).unwrap();
        prop_assert!((heavier.inertia - body.inertia * factor).norm() < ROUNDING * heavier.inertia.norm());
        prop_assert_eq!(body.centred().inertia, body.inertia);
    }

    #[test]
    fn scattered_moments_are_always_those_of_a_body(nominal in moments(), sigma in 0.0..2.0_f64, z in vector(5.0)) {
        let drawn = scattered_moments(nominal, sigma, z).unwrap();
        prop_assert!(Validity::of(&InertiaTensor::from_principal_moments(drawn)).defect().is_none(), "{drawn}");
        let without = scattered_moments(nominal, 0.0, z).unwrap();
        prop_assert!((without - nominal).abs().max_element() < ROUNDING * nominal.max_element());
    }

    #[test]
    fn a_repair_is_the_nearest_valid_tensor_and_says_what_it_did(
        plate in (0.1..1.0_f64, 0.1..1.0_f64), excess in 1e-9..0.02_f64, q in orientation(),
    ) {
        let moments = DVec3::new(plate.0, plate.1, (plate.0 + plate.1) * (1.0 + excess));
        let measured = InertiaTensor::from_principal_moments(moments).rotated(q);
        prop_assert!(Validity::of(&measured).defect().is_some());
        let repair = repair_triangle_inequality(&measured, 0.02).unwrap();
        prop_assert!(Validity::of(&repair.tensor).defect().is_none());
        let change = (repair.tensor - measured).norm();
        prop_assert!((change / measured.norm() / repair.relative_change - 1.0).abs() < 1e-5);
        // Distance of a point from the plane I₁ + I₂ = I₃: no valid tensor is nearer.
        let distance = (moments.z - moments.x - moments.y) / 3.0_f64.sqrt();
        prop_assert!((change / distance - 1.0).abs() < 1e-5, "{change:e} instead of {distance:e}");
        let again = repair_triangle_inequality(&repair.tensor, 0.0).unwrap();
        prop_assert_eq!((again.tensor, again.relative_change), (repair.tensor, 0.0));
        prop_assert!(repair_triangle_inequality(&measured, 0.1 * repair.relative_change).is_err());
    }

    #[test]
    fn solving_inverts_the_tensor(body in body(), v in vector(3.0)) {
        let back = body.inertia * body.inertia.solve(v);
        prop_assert!((back - v).length() < 1e2 * ROUNDING);
    }
}

#[test]
fn points_and_parts_that_are_not_valid_are_named_by_number() {
    let good = (1.0, DVec3::X);
    let bad_mass = point_masses(&[good, (-1.0, DVec3::Y)]);
    assert!(matches!(bad_mass, Err(Error::Item { item: "point", index: 1, field: "mass", value: -1.0, .. })));
    let bad_place = point_masses(&[good, good, (1.0, DVec3::NAN)]);
    assert!(matches!(bad_place, Err(Error::Item { item: "point", index: 2, field: "position", .. })));
    assert!(matches!(point_masses(&[]), Err(Error::Setting { field: "total mass", .. })));
    let ball = Part::new(Shape::Sphere { radius: 1.0 }.mass_properties(1.0).unwrap());
    let askew = ball.oriented(DQuat::from_xyzw(1.0, 1.0, 0.0, 0.0));
    let Err(error) = compose(&[ball, askew]) else { panic!("a quaternion of length √2 passed") };
    assert_eq!(error.to_string(), "part 1: length of the orientation = 1.4142135623730951: a unit quaternion");
    assert!(matches!(compose(&[ball, ball.at(DVec3::INFINITY)]), Err(Error::Item { field: "position", .. })));
    assert!(matches!(compose(&[]), Err(Error::Setting { field: "mass of all parts", .. })));
    assert!(matches!(compose(&[ball, ball.as_hole()]), Err(Error::Setting { field: "mass of all parts", .. })));
}
