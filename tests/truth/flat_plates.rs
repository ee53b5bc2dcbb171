//! The formula of `flat-plates` against the balance of momentum, written out, and against free molecular flow.

use crate::common;

use std::f64::consts::PI;

use common::random::Random;
use glam::{DQuat, DVec3};
use polhode::engine::cpu::Cpu;
use polhode::expression::{Dependence, Expression, Fault, Graph, InputKind};
use polhode::math::Precision;
use polhode::math::Width;
use polhode::torque::flat_plates::{Facet, MOST_FACETS, Surface, formula};
use polhode::torque::{Torque, Validity, Value, declarations};
use polhode::{Ensemble, Error, Method, Plan, Scene};

/// A few dozen operations, each rounded to half an ulp, relative to the sum of the plates' p A |r|.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// What is around a body.
#[derive(Clone, Copy)]
struct LaneTorques {
    pressure: f64,
    direction_world: DVec3,
    orientation: DQuat,
}

impl LaneTorques {
    fn random(random: &mut Random) -> Self {
        Self {
            pressure: random.between(0.5, 2.0),
            direction_world: vector(random) * random.between(0.1, 10.0),
            orientation: DQuat::from_array([(); 4].map(|()| random.normal())).normalize(),
        }
    }

    /// Unit vector towards the source, body axes.
    fn u(&self) -> DVec3 {
        self.orientation.inverse() * self.direction_world.normalize()
    }
}

fn vector(random: &mut Random) -> DVec3 {
    DVec3::from_array([(); 3].map(|()| random.normal()))
}

fn evaluated(formula: &Expression, around: LaneTorques) -> DVec3 {
    let program = formula.program();
    let parameters = [around.pressure, around.direction_world.x, around.direction_world.y, around.direction_world.z];
    let input = |kind, index: usize| match kind {
        InputKind::Orientation => around.orientation.to_array()[index],
        InputKind::Parameter => parameters[index],
        other => panic!("{other:?} is not asked for"),
    };
    let inputs: Vec<f64> = program.inputs().iter().map(|asked| input(asked.kind, asked.index.into())).collect();
    DVec3::from_slice(&program.evaluate_one(&inputs))
}

fn torque(facets: &[Facet], around: LaneTorques) -> DVec3 {
    evaluated(&formula(facets).expect("valid facets"), around)
}

fn facet(random: &mut Random, surface: Surface) -> Facet {
    let (normal_body, centre_body) = (vector(random), vector(random));
    Facet { area: random.between(0.1, 2.0), normal_body, centre_body, surface }
}

fn size(facets: &[Facet], around: LaneTorques) -> f64 {
    facets.iter().map(|facet| around.pressure * facet.area * facet.centre_body.length()).sum()
}

/// The force of light: what arrives gives its momentum, what is reflected as by a mirror leaves along the mirrored ray, what is
/// scattered by Lambert's law leaves with two thirds of its momentum along the normal.
fn solar_torque(facet: &Facet, around: LaneTorques, specular: f64, diffuse: f64) -> DVec3 {
    let (u, n) = (around.u(), facet.normal_body.normalize());
    if u.dot(n) <= 0.0 {
        return DVec3::ZERO;
    }
    let arriving = around.pressure * facet.area * u.dot(n);
    let mirrored = n * (2.0 * u.dot(n)) - u;
    facet.centre_body.cross(-arriving * (u + specular * mirrored + diffuse * (2.0 / 3.0) * n))
}

#[test]
fn a_plate_in_the_sun_feels_the_balance_of_momentum() {
    let mut random = Random::new(3);
    let (mut lit, mut dark) = (0, 0);
    for _ in 0..200 {
        let specular = random.between(0.0, 1.0);
        let diffuse = random.between(0.0, 1.0 - specular);
        let facet = facet(&mut random, Surface::Solar { specular, diffuse });
        let around = LaneTorques::random(&mut random);
        let (found, expected) = (torque(&[facet], around), solar_torque(&facet, around, specular, diffuse));
        let bound = ROUNDING * size(&[facet], around);
        assert!((found - expected).length() <= bound, "{facet:?}: {found}, {expected}");
        // The comparison finds half of the scattered momentum missing.
        let planted = solar_torque(&facet, around, specular, diffuse * 0.5);
        if expected == DVec3::ZERO {
            assert_eq!(found, DVec3::ZERO);
            dark += 1;
        } else {
            assert!((found - planted).length() > bound);
            lit += 1;
        }
    }
    assert!(lit > 50 && dark > 50, "{lit}, {dark}");
}

#[test]
fn drag_is_the_fast_limit_of_free_molecular_flow() {
    // S. A. Schaaf, P. L. Chambré: at the speed ratio S, for a plate with S c far above 1, where erf S c is 1 and exp −S²c² is 0,
    // pressure/ρv² = (2 − σn) (c² + 1/2S²) + σn √(π Tw/T) c/2S and shear/ρv² = σt c s. With v_w = √(π R Tw/2) and
    // S = v/√(2 R T) the ratio v_w/v is √(π Tw/T)/2S.
    let mut random = Random::new(4);
    let speed_ratio = 1e6_f64;
    let mut lit = 0;
    for _ in 0..200 {
        let [normal, tangential, wall] = [(); 3].map(|()| random.between(0.0, 1.0));
        let surface = Surface::Drag {
            normal_accommodation: normal,
            tangential_accommodation: tangential,
            wall_speed_ratio: wall,
        };
        let facet = facet(&mut random, surface);
        let around = LaneTorques::random(&mut random);
        let (u, n) = (around.u(), facet.normal_body.normalize());
        let c = u.dot(n);
        if c <= 1e-3 {
            continue;
        }
        let root_of_temperatures = wall * 2.0 * speed_ratio / PI.sqrt();
        let pressure = (2.0 - normal) * (c * c + 0.5 / (speed_ratio * speed_ratio))
            + normal / 2.0 * PI.sqrt() * root_of_temperatures * c / speed_ratio;
        let in_plane = u - n * c;
        let shear = tangential * c * in_plane;
        let force = -around.pressure * facet.area * (pressure * n + shear);
        let (found, expected) = (torque(&[facet], around), facet.centre_body.cross(force));
        // 1/2S² is 5e-13.
        assert!((found - expected).length() <= 2e-12 * size(&[facet], around), "{facet:?}: {found}, {expected}");
        lit += 1;
    }
    assert!(lit > 50, "{lit}");
}

#[test]
fn an_offset_plate_has_the_torque_of_its_lever() {
    // A black plate of 2 m² half a metre along y, its normal along z, the source at an angle from z in the plane of x and z:
    // F = −p A cos α u, τ = ½ y × F.
    let surface = Surface::Coefficients { along: 1.0, constant: 0.0, across: 0.0 };
    let plate = Facet { area: 2.0, normal_body: DVec3::Z * 7.0, centre_body: DVec3::Y * 0.5, surface };
    for angle in [0.0, 0.3, 1.0, 1.5] {
        let direction_world = DVec3::new(f64::sin(angle), 0.0, f64::cos(angle)) * 3.0;
        let around = LaneTorques { pressure: 5.0, direction_world, orientation: DQuat::IDENTITY };
        let expected = 5.0 * 2.0 * 0.5 * f64::cos(angle) * DVec3::new(-f64::cos(angle), 0.0, f64::sin(angle));
        let found = torque(&[plate], around);
        assert!((found - expected).length() < ROUNDING * 5.0, "{angle}: {found}, {expected}");
        // Body and source turned together, it is the same in body axes.
        let turn = DQuat::from_xyzw(0.5, -0.1, 0.7, 0.2).normalize();
        let turned = LaneTorques { direction_world: turn * direction_world, orientation: turn, ..around };
        let found = torque(&[plate], turned);
        assert!((found - expected).length() < ROUNDING * 5.0, "{angle}, turned: {found}, {expected}");
    }
}

#[test]
fn a_cube_about_its_centre_feels_no_torque_and_one_with_another_centre_does() {
    let mut random = Random::new(5);
    let normals = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
    for surface in [
        Surface::Coefficients { along: 0.7, constant: 0.1, across: 0.4 },
        Surface::Solar { specular: 0.2, diffuse: 0.5 },
        Surface::Drag { normal_accommodation: 0.9, tangential_accommodation: 0.8, wall_speed_ratio: 0.05 },
    ] {
        let cube = |centre: DVec3| -> Vec<Facet> {
            let face = |n: DVec3| Facet { area: 1.0, normal_body: n, centre_body: 0.5 * n - centre, surface };
            normals.clone().map(face).collect()
        };
        let (centred, offset) = (cube(DVec3::ZERO), cube(DVec3::new(0.1, 0.0, 0.0)));
        for _ in 0..20 {
            let around = LaneTorques::random(&mut random);
            let bound = ROUNDING * size(&centred, around);
            assert!(torque(&centred, around).length() < bound, "{surface:?}");
            assert!(torque(&offset, around).length() > 1e3 * bound, "{surface:?}");
        }
    }
}

#[test]
fn a_plate_turns_into_the_light_without_a_jump_and_feels_nothing_from_behind() {
    let surface = Surface::Drag { normal_accommodation: 1.0, tangential_accommodation: 1.0, wall_speed_ratio: 0.1 };
    let plate = Facet { area: 1.0, normal_body: DVec3::X, centre_body: DVec3::new(0.3, 1.0, -0.5), surface };
    let formula = formula(&[plate]).expect("valid");
    let at = |angle: f64| {
        let orientation = DQuat::from_rotation_z(angle);
        evaluated(&formula, LaneTorques { pressure: 1.0, direction_world: DVec3::Y, orientation })
    };
    // The normal is at right angles to the source at the angle 0, and lit above.
    for angle in [-1.5, -0.5, -1e-3, -1e-9] {
        assert_eq!(at(angle), DVec3::ZERO, "{angle}");
    }
    for angle in [1e-12, 1e-9, 1e-6, 1e-3] {
        let found = at(angle).length();
        assert!(found > 0.1 * angle && found < 3.0 * angle, "{angle}: {found:e}");
    }
}

#[test]
fn plates_add_up_and_depend_on_the_attitude_alone() {
    let mut random = Random::new(6);
    let facets: Vec<Facet> = (0..MOST_FACETS)
        .map(|index| {
            let surface = match index % 3 {
                0 => Surface::Coefficients { along: 0.7, constant: -0.1, across: 1.4 },
                1 => Surface::Solar { specular: 0.4, diffuse: 0.6 },
                _ => Surface::Drag { normal_accommodation: 0.9, tangential_accommodation: 0.8, wall_speed_ratio: 0.05 },
            };
            facet(&mut random, surface)
        })
        .collect();
    let all = formula(&facets).expect("valid");
    assert!(all.graph().len() < 1000, "{} operations", all.graph().len());
    assert!(!all.dependence().intersects(Dependence::TIME) && all.dependence().intersects(Dependence::ATTITUDE));
    for _ in 0..20 {
        let around = LaneTorques::random(&mut random);
        let sum: DVec3 = facets.iter().map(|facet| torque(std::slice::from_ref(facet), around)).sum();
        let found = evaluated(&all, around);
        assert!((found - sum).length() < 4.0 * ROUNDING * size(&facets, around), "{found}, {sum}");
        assert!(found.length() > 0.0);
    }
}

/// The field that a refusal names.
fn refused(facets: &[Facet]) -> String {
    match formula(facets) {
        Err(Error::Item { item: "facet", index, field, .. }) => format!("{index} {field}"),
        Err(Error::Setting { field, value, .. }) => format!("{value} {field}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn facets_that_are_not_valid_are_refused_with_their_place() {
    let surface = Surface::Coefficients { along: 1.0, constant: 0.0, across: 0.0 };
    let good = Facet { area: 1.0, normal_body: DVec3::X, centre_body: DVec3::Y, surface };
    assert_eq!(refused(&[]), "0 facets");
    assert_eq!(refused(&[good; 17]), "17 facets");
    for (bad, field) in [
        (Facet { area: -1.0, ..good }, "area"),
        (Facet { area: f64::NAN, ..good }, "area"),
        (Facet { area: 1e20, centre_body: DVec3::Y * 1e20, ..good }, "area"),
        (Facet { normal_body: DVec3::ZERO, ..good }, "normal"),
        (Facet { normal_body: DVec3::new(f64::INFINITY, 0.0, 0.0), ..good }, "normal"),
        (Facet { centre_body: DVec3::NAN, ..good }, "centre"),
        (Facet { surface: Surface::Solar { specular: 0.6, diffuse: 0.5 }, ..good }, "solar.diffuse"),
    ] {
        assert_eq!(refused(&[good, bad]), format!("1 {field}"));
    }
    let within: Result<_, Fault> = Graph::record(|_| {
        assert_eq!(refused(&[good]), "1 facets", "within a recording");
        Ok(Vec::new())
    });
    assert!(within.is_ok());
    // Any length of a normal will do, and a plate without area too.
    let around = LaneTorques { pressure: 1.0, direction_world: DVec3::X, orientation: DQuat::IDENTITY };
    for length in [1e-320, 1e-200, 1.0, 1e200] {
        let found = torque(&[Facet { normal_body: DVec3::X * length, ..good }], around);
        assert!((found - DVec3::Z).length() < ROUNDING, "{length:e}: {found}");
    }
    assert_eq!(torque(&[Facet { area: 0.0, ..good }], around), DVec3::ZERO);
}

#[test]
fn ranges_of_coefficients_are_those_that_are_declared() {
    let model = declarations().find(|model| model.name == "flat-plates").expect("listed");
    let elements = &model.parameters[model.position("facets").expect("declared")].elements;
    let coefficients = |name: &str, x: f64| {
        let or = |own: &str, other: f64| if name == own { x } else { other };
        match name.split('.').next() {
            Some("solar") => Surface::Solar { specular: or("solar.specular", 0.0), diffuse: or("solar.diffuse", 0.0) },
            Some("drag") => Surface::Drag {
                normal_accommodation: or("drag.normal_accommodation", 0.5),
                tangential_accommodation: or("drag.tangential_accommodation", 0.5),
                wall_speed_ratio: or("drag.wall_speed_ratio", 0.5),
            },
            _ => Surface::Coefficients {
                along: or("along", 0.5),
                constant: or("constant", 0.5),
                across: or("across", 0.5),
            },
        }
    };
    let facet = |surface| Facet { area: 1.0, normal_body: DVec3::X, centre_body: DVec3::new(0.0, 1.0, 0.0), surface };
    let mut count = 0;
    for element in elements {
        let Validity::Range(low, high) = element.valid else { continue };
        for valid in [low, high] {
            assert!(formula(&[facet(coefficients(&element.name, valid))]).is_ok(), "{} = {valid}", element.name);
        }
        for bad in [low - 0.001, high + 0.001, f64::NAN] {
            let expected = format!("0 {}", element.name);
            assert_eq!(refused(&[facet(coefficients(&element.name, bad))]), expected, "{bad}");
        }
        count += 1;
    }
    assert_eq!(count, 8);
}

#[test]
fn a_torque_keeps_its_parameters() {
    let surface = Surface::Solar { specular: 0.25, diffuse: 0.5 };
    let plate = Facet { area: 1.0, normal_body: DVec3::X, centre_body: DVec3::Y, surface };
    let light = Torque::flat_plates(vec![1.0, 2.0], DVec3::X, &[plate, plate]).expect("valid");
    assert_eq!(light.parameter("pressure"), Some(&Value::Number(vec![1.0, 2.0].into())));
    assert_eq!(light.parameter("direction"), Some(&Value::Vector(DVec3::X.into())));
    let list = light.parameter("facets").and_then(Value::as_list).expect("a list");
    assert_eq!((list.len(), &list[1][1]), (2, &Value::Vector(DVec3::X.into())));
    assert!(light.needs().attitude && !light.needs().time && !light.dissipative());
}

#[test]
fn an_engine_turns_a_body_as_the_balance_of_momentum_says() {
    let (specular, diffuse, pressure) = (0.3, 0.4, 1.5);
    let surface = Surface::Solar { specular, diffuse };
    let lit =
        Facet { area: 0.7, normal_body: DVec3::new(1.0, 0.2, 0.3), centre_body: DVec3::new(0.1, 0.4, -0.3), surface };
    // The second stays dark.
    let dark = Facet { normal_body: -lit.normal_body, ..lit };
    let direction_world = DVec3::new(3.0, 0.5, -0.4);
    // The axes of the moments are not in their order, so that principal axes are not the body's.
    let moments = DVec3::new(2.5, 1.0, 2.0);
    let (mut q, mut omega) = (DQuat::from_xyzw(0.1, -0.1, 0.2, 0.9).normalize(), DVec3::new(0.1, -0.05, 0.08));
    let row = (moments, q, omega);
    let rate = |q: DQuat, omega: DVec3| {
        let around = LaneTorques { pressure, direction_world, orientation: q.normalize() };
        let torque = solar_torque(&lit, around, specular, diffuse);
        assert!(torque != DVec3::ZERO);
        (q * DQuat::from_vec4((0.5 * omega).extend(0.0)), (torque - omega.cross(moments * omega)) / moments)
    };
    let (steps, end) = (256, 1.5);
    let dt = end / f64::from(steps);
    for _ in 0..steps {
        let k1 = rate(q, omega);
        let k2 = rate(q + k1.0 * (dt / 2.0), omega + k1.1 * (dt / 2.0));
        let k3 = rate(q + k2.0 * (dt / 2.0), omega + k2.1 * (dt / 2.0));
        let k4 = rate(q + k3.0 * dt, omega + k3.1 * dt);
        q += (k1.0 + k2.0 * 2.0 + k3.0 * 2.0 + k4.0) * (dt / 6.0);
        omega += (k1.1 + k2.1 * 2.0 + k3.1 * 2.0 + k4.1) * (dt / 6.0);
    }
    let torque = Torque::flat_plates(vec![0.0, pressure], direction_world, &[lit, dark]).expect("valid");
    let ensemble = Ensemble::from_fn(2, |_| row).expect("valid bodies");
    let scene = Scene::new(ensemble).until(end).pinned(Method::Rk4, dt, Some(Precision::F64)).torque(torque);
    let engine = Cpu::new(Width::Lanes);
    let record = polhode::run::run(&engine, &Plan::new(&scene, &engine).expect("a plan")).expect("a run");
    let state = record.final_state();
    // rk4 at steps of 6 ms and rates below 1 rad/s: (h ω)⁴ is 1e-9, its constant below 1e-2.
    assert!((state.angular_velocity_body(1) - omega).length() < 1e-10, "{}, {omega}", state.angular_velocity_body(1));
    let error = 2.0 * (state.orientation(1).conjugate() * q.normalize()).xyz().length();
    assert!(error < 1e-10, "{error:e}");
    // Without pressure it turns otherwise.
    assert!((state.angular_velocity_body(0) - omega).length() > 0.01);
}
