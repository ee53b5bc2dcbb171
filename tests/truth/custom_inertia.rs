//! Moments of inertia by a formula of the user's own: against closed forms, the library's laws, conservation and refusals.

use crate::common;
use crate::support;

use std::fs;

use glam::{DQuat, DVec3};
use polhode::bodies::inertia::InertiaTensor;
use polhode::engine::Engine;
use polhode::math::Precision;
use polhode::math::real::Real;
use polhode::math::vector::Vector;
use polhode::scene::AdaptiveSteps;
use polhode::study::Study;
use polhode::torque::variable_inertia::{InertiaChange, Law};
use polhode::torque::{Orbit, Parameters};
use polhode::{Accuracy, Ensemble, Method, Plan, Record, Scene, Torque};
use support::attitude_error;

/// Methods that ask for the rate at which the axes turn, by steps that leave rounding alone; of order 4 some 1e-11 of truncation.
const METHODS: [(Method, f64, f64); 3] =
    [(Method::Rk4, 1.0 / 1024.0, 1e-10), (Method::Rk8, 1.0 / 64.0, 1e-12), (Method::Cf4, 1.0 / 1024.0, 1e-10)];

/// Rounding of some thousand steps in f64, and in f32 with an angle of some ten radians. Moments by a formula are rounded in one word
/// of f32 in each step, at another place in each (src/torque/variable_inertia.rs: 3e-8 of the angle turned meanwhile, and as much for
/// each of the formula's few operations).
fn rounding(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 3e-6,
        Precision::F64 => 5e-13,
    }
}

fn platforms() -> [(&'static str, Engine, Precision); 4] {
    [
        ("CPU", Engine::cpu(), Precision::F64),
        ("CPU", Engine::cpu(), Precision::F32),
        ("GPU", common::gpu(), Precision::F64),
        ("GPU", common::gpu(), Precision::F32),
    ]
}

fn run(engine: &Engine, scene: &Scene) -> Record {
    let plan = Plan::new(scene, engine).unwrap_or_else(|error| panic!("{error}"));
    engine.run(&plan).unwrap_or_else(|error| panic!("{error}"))
}

fn bodies(inertia: &[impl Copy + Into<InertiaTensor>], omega: &[DVec3]) -> Ensemble {
    let inertia: Vec<InertiaTensor> = inertia.iter().map(|&tensor| tensor.into()).collect();
    Ensemble::from_columns(&inertia, &vec![DQuat::IDENTITY; inertia.len()], omega).expect("valid bodies")
}

/// The scene by every method and in every adaptive way that can follow it: what it is, and its result.
fn every_run(scene: &Scene, mut check: impl FnMut(&str, Precision, f64, &Record)) {
    for (name, engine, precision) in platforms() {
        for (method, dt, truncation) in METHODS {
            let record = run(&engine, &scene.clone().pinned(method, dt, Some(precision)));
            check(&format!("{name} {precision} {method}"), precision, truncation, &record);
        }
        let tolerance = if precision == Precision::F64 { 1e-12 } else { 1e-6 };
        let steps = AdaptiveSteps { tolerance, least_step: None };
        let record = run(&engine, &scene.clone().adaptive(steps, Some(precision)));
        check(&format!("{name} {precision}, adaptive"), precision, 300.0 * tolerance, &record);
    }
    let scene = scene.clone().taylor(AdaptiveSteps { tolerance: 1e-13, least_step: None });
    check("taylor", Precision::F64, 1e-11, &run(&Engine::cpu(), &scene));
}

/// About each axis of the body alone, with I = I₀/(1 + a sin Ωt) of its own a: ω = ω₀ (1 + a sin Ωt), and the angle is
/// ω₀ (t + a (1 − cos Ωt)/Ω). The axes are not in the order of the moments.
#[test]
fn a_spin_about_each_axis_follows_its_own_moment() {
    const TEXT: &str = "let s = sin(w * time);\n\
        vec(inertia.xx / (1 + a.x * s), inertia.yy / (1 + a.y * s), inertia.zz / (1 + a.z * s))";
    let (moments, a, end) = (DVec3::new(2.2, 1.0, 1.6), DVec3::new(0.05, 0.1, -0.12), 6.0);
    let rates = [1.3, -0.7, 2.1];
    let omegas = [DVec3::X * 1.1, DVec3::Y * 0.8, DVec3::Z * -0.9];
    let parameters = Parameters::new().number("w", rates.to_vec()).and_then(|of| of.vector("a", a)).expect("names");
    let torque = Torque::custom_moments(TEXT, parameters).expect("a formula");
    let scene = Scene::new(bodies(&[moments; 3], &omegas)).until(end).torque(torque);
    every_run(&scene, |what, precision, truncation, record| {
        for body in 0..3 {
            let (omega, w) = (omegas[body], rates[body]);
            let factor = a[body];
            let turned = omega.length() * (end + factor * (1.0 - (w * end).cos()) / w);
            let expected = DQuat::from_axis_angle(omega.normalize(), turned);
            let spin = omega * (1.0 + factor * (w * end).sin());
            let state = record.final_state();
            let error = attitude_error(state.orientation(body), expected);
            let slower = (state.angular_velocity_body(body) - spin).length();
            println!("{what}, axis {body}: {error:.1e} rad, {slower:.1e} rad/s");
            let bound = rounding(precision) + truncation;
            assert!(error < bound && slower < bound, "{what}, axis {body}: {error:e} rad, {slower:e} rad/s");
        }
    });
}

/// A factor f(t) of the tensor only changes the pace: dm/dt = m × I₀⁻¹ m/f is the motion of the rigid body at τ = ∫dt/f, which its closed
/// form gives. With f = 1/(1 + a sin Ωt), τ = t + a (1 − cos Ωt)/Ω.
#[test]
fn a_factor_of_the_tensor_is_the_rigid_motion_at_another_pace() {
    let (a, w, end) = (0.4, 1.7_f64, 5.0);
    let tensor = InertiaTensor { xx: 1.0, yy: 1.7, zz: 2.3, xy: 0.12, xz: -0.2, yz: 0.31 };
    let omega = DVec3::new(0.5, 0.9, -0.4);
    let pace = 1.0 + a * (w * end).sin();
    let free = Scene::new(bodies(&[tensor], &[omega])).until(end + a * (1.0 - (w * end).cos()) / w);
    let free = free.accuracy(Accuracy::attitude(1e-12));
    assert!(Plan::new(&free, &Engine::cpu()).expect("a plan").is_closed_form());
    let free = run(&Engine::cpu(), &free);
    let parameters = || Parameters::new().number("a", a).and_then(|of| of.number("w", w)).expect("names");
    let torque = Torque::custom_inertia_factor("1 / (1 + a * sin(w * time))", parameters()).expect("a formula");
    let one = || polhode::expression::Symbol::splat(1.0);
    let recorded = Torque::recorded_inertia_factor(parameters(), |s| {
        let (sin, _) = polhode::math::real::sin_cos(s.number("w") * s.time());
        one() / (one() + s.number("a") * sin)
    });
    assert_eq!(recorded.expect("a formula"), torque, "closures and texts are the same formulas");
    let scene = Scene::new(bodies(&[tensor], &[omega])).until(end).torque(torque);
    every_run(&scene, |what, precision, truncation, record| {
        let state = record.final_state();
        let error = attitude_error(state.orientation(0), free.final_state().orientation(0));
        let slower = (state.angular_velocity_body(0) - free.final_state().angular_velocity_body(0) * pace).length();
        println!("{what}: {error:.1e} rad, {slower:.1e} rad/s");
        let bound = rounding(precision) + truncation;
        assert!(error < bound && slower < bound, "{what}: {error:e} rad, {slower:e} rad/s");
    });
}

/// The library's own law written down, beside the gravity gradient, which follows the moments.
#[test]
fn the_librarys_own_law_agrees_with_itself_as_a_formula() {
    let (moments, changed, w, end) = (DVec3::new(1.0, 1.6, 2.2), DVec3::new(1.3, 1.2, 1.9), 1.1, 6.0);
    let text = "let s = (1 - cos(w * time)) / 2;\n\
        vec(inertia.xx + s * (c.x - inertia.xx), inertia.yy + s * (c.y - inertia.yy), inertia.zz + s * (c.z - inertia.zz))";
    let parameters = Parameters::new().number("w", w).and_then(|of| of.vector("c", changed)).expect("names");
    let formula = Torque::custom_moments(text, parameters).expect("a formula");
    let law = Torque::variable_inertia(InertiaChange::tensor(changed), Law::oscillation(w));
    let gradient = Torque::gravity_gradient(Orbit::circular(1.0, 1.3).inclined(0.4));
    let scene = |change: Torque| {
        let omega = [DVec3::new(0.2, -0.3, 0.5), DVec3::new(0.4, 0.1, -0.2)];
        Scene::new(bodies(&[moments; 2], &omega)).until(end).torque(gradient.clone()).torque(change)
    };
    let truth = run(&Engine::cpu(), &scene(law).pinned(Method::Rk8, 1.0 / 128.0, Some(Precision::F64)));
    every_run(&scene(formula), |what, precision, truncation, record| {
        for body in 0..2 {
            let (found, expected) = (record.final_state(), truth.final_state());
            let error = attitude_error(found.orientation(body), expected.orientation(body));
            let slower = (found.angular_velocity_body(body) - expected.angular_velocity_body(body)).length();
            let bound = rounding(precision) + 3.0 * truncation;
            assert!(error < bound && slower < bound, "{what}: {error:e} rad, {slower:e} rad/s");
        }
    });
}

/// −k m takes the angular momentum away at the rate k, whatever the moments do: L(t) = L₀ e^(−kt) in the world.
#[test]
fn formulas_of_torques_read_the_moments_of_their_time() {
    let (k, end) = (0.3, 4.0);
    let (moments, omega) = (DVec3::new(1.0, 1.6, 2.2), DVec3::new(0.5, 0.9, -0.4));
    let changes = || {
        let oscillation = Law::oscillation(vec![2.1, -1.3]);
        let own = Parameters::new().number("w", vec![2.1, -1.3]).expect("a name");
        let text = "vec(inertia.xx, inertia.yy * (1 + 0.1 * sin(w * time)), inertia.zz)";
        [
            Torque::variable_inertia(InertiaChange::tensor(DVec3::new(0.8, 0.9, 1.1)), oscillation),
            Torque::custom_moments(text, own).expect("a formula"),
        ]
    };
    for change in changes() {
        for text in ["-k * angular_momentum", "-k * (inertia * angular_velocity)"] {
            let parameters = Parameters::new().number("k", k).expect("a name");
            let drag = Torque::custom(text, parameters).expect("a formula");
            let scene = Scene::new(bodies(&[moments; 2], &[omega; 2])).until(end).torque(drag).torque(change.clone());
            every_run(&scene, |what, precision, truncation, record| {
                for body in 0..2 {
                    let state = record.final_state();
                    let tensor = change.tensor_at(body, moments.into(), end);
                    let left = state.orientation(body) * (tensor * state.angular_velocity_body(body));
                    let expected = moments * omega * (-k * end).exp();
                    let error = (left - expected).length();
                    assert!(error < rounding(precision) + truncation, "{what}, {text}: {error:e}");
                }
            });
        }
    }
    // The gravity gradient written down reads the tensor of its time, as the library's own does.
    let gradient = Torque::gravity_gradient(Orbit::circular(1.0, 1.3));
    let text = "let u = to_body(vec(cos(n * time), sin(n * time), 0));\n3 * n^2 * cross(u, inertia * u)";
    let written = || Torque::custom(text, Parameters::new().number("n", 1.3_f64.powf(-1.5)).expect("a name"));
    for change in changes() {
        let scene = |gradient: Torque| {
            Scene::new(bodies(&[moments; 2], &[omega; 2])).until(end).torque(gradient).torque(change.clone())
        };
        let truth = run(&Engine::cpu(), &scene(gradient.clone()).pinned(Method::Rk8, 1.0 / 128.0, None));
        every_run(&scene(written().expect("a formula")), |what, precision, truncation, record| {
            for body in 0..2 {
                let (found, expected) = (record.final_state(), truth.final_state());
                let error = attitude_error(found.orientation(body), expected.orientation(body));
                assert!(error < rounding(precision) + 3.0 * truncation, "{what}: {error:e} rad");
            }
        });
    }
}

#[test]
fn angular_momentum_stays_and_energy_changes_by_the_work_of_the_formula() {
    let text = "let s = smoothstep(1, 5, time); let b = 1 + 0.1 * sin(w * time) * exp(-time / 7);\n\
        vec(inertia.xx * b, inertia.yy + 0.3 * s, inertia.zz + 0.3 * s^2)";
    let parameters = || Parameters::new().number("w", 2.3).expect("a name");
    let change = Torque::custom_moments(text, parameters()).expect("a formula");
    let factor = Torque::custom_inertia_factor("1 / (1 + 0.5 * tan(0.1 * time))", Parameters::new());
    let scenes = [
        ("moments", vec![change.clone()]),
        ("a factor", vec![factor.expect("a formula")]),
        (
            "moments with drag and dissipation",
            vec![Torque::linear_drag(0.05), change, Torque::internal_dissipation(0.02)],
        ),
    ];
    for precision in Precision::ALL {
        for (name, torques) in &scenes {
            let scene = Scene::new(bodies(&[DVec3::new(1.0, 1.6, 2.2)], &[DVec3::new(0.5, 0.9, -0.4)]));
            let scene = torques.iter().fold(scene.until(10.0), |scene, torque| scene.torque(torque.clone()));
            let trust = run(&Engine::cpu(), &scene.pinned(Method::Rk8, 1.0 / 64.0, Some(precision))).trust().clone();
            println!("{precision} {name}: {}, {}", trust.balance, trust.drift.angular_momentum_world.max);
            assert_eq!(trust.balance.bodies, 1, "{name}");
            // A smoothstep has kinks of its second derivative, each of which costs h³/1e3 once.
            let bound = rounding(precision) + 1e-8;
            assert!(trust.balance.energy.max < bound, "{name} in {precision}: {}", trust.balance);
            assert_eq!(trust.drift.kinetic_energy_bodies, 0, "{name}: {trust}");
            if torques.len() == 1 {
                assert!(trust.drift.angular_momentum_world.max < rounding(precision), "{name}: {trust}");
            }
        }
    }
}

#[test]
fn plans_choose_steps_that_meet_the_error_asked_for() {
    // Booms run out within 20 s in the midst of a minute.
    let text =
        "let out = 2 * m * (l * smoothstep(20, 40, time))^2; vec(inertia.xx, inertia.yy + out, inertia.zz + out)";
    let parameters = Parameters::new().number("m", 0.2).and_then(|of| of.number("l", vec![1.0, 1.5, 2.0]));
    let change = Torque::custom_moments(text, parameters.expect("names")).expect("a formula");
    let satellites = bodies(&[DVec3::new(0.5, 0.6, 0.8); 3], &[DVec3::new(0.1, 0.5, 1.2); 3]);
    let scene = Scene::new(satellites).until(60.0).torque(change).accuracy(Accuracy::attitude(1e-7));
    for engine in [Engine::cpu(), common::gpu()] {
        let plan = Plan::new(&scene, &engine).expect("a plan");
        let trust = engine.run(&plan).expect("a run").trust().clone();
        assert_eq!(trust.recomputed_sample.met, Some(true), "{trust}");
    }
}

/// What no body can have fails the body when it comes, and its neighbours go on.
#[test]
fn moments_that_no_body_has_fail_the_body_when_they_come() {
    for (text, is_factor) in [
        ("let s = 1 - r * time; vec(inertia.xx * s, inertia.yy * s, inertia.zz * s)", false),
        ("1 - r * time", true),
        // I₃ comes to exceed I₁ + I₂ at 2.6/2.2, from when r t = 0.18.
        ("vec(inertia.xx, inertia.yy, inertia.zz * (1 + r * time))", false),
        ("sqrt(1 - r * time)", true),
    ] {
        let parameters = Parameters::new().number("r", vec![0.0, 0.5, 0.0]).expect("a name");
        let change = match is_factor {
            true => Torque::custom_inertia_factor(text, parameters),
            false => Torque::custom_moments(text, parameters),
        };
        let satellites = bodies(&[DVec3::new(1.0, 1.6, 2.2); 3], &[DVec3::new(0.5, 0.9, -0.4); 3]);
        let scene = Scene::new(satellites).until(4.0).torque(change.expect("a formula"));
        for (name, engine, precision) in platforms() {
            let steps = AdaptiveSteps { tolerance: 1e-5, least_step: None };
            for scene in [
                scene.clone().pinned(Method::Rk4, 1.0 / 64.0, Some(precision)),
                scene.clone().adaptive(steps, Some(precision)),
            ] {
                let record = run(&engine, &scene);
                let failed: Vec<usize> = record.trust().failed_bodies.clone();
                assert_eq!(failed, [1], "{name} {precision}, {text}");
                let state = record.final_state();
                assert_eq!(state.orientation(0), state.orientation(2), "{name} {precision}, {text}");
                let failure = &record.trust().failures[0];
                let cause = failure.cause.as_deref().unwrap_or_default();
                assert!(cause.starts_with("torque[1] (custom-"), "{name} {precision}, {text}: {cause}");
                let time = failure.time;
                let expected = if text.contains("inertia.zz * (1") { 0.4 / 2.2 / 0.5 } else { 2.0 };
                assert!((time - expected).abs() < 0.05, "{name} {precision}, {text}: {time} s");
            }
        }
    }
}

fn refusal(scene: &Scene) -> String {
    Plan::new(scene, &Engine::cpu()).map(|_| ()).expect_err("refused").to_string()
}

#[test]
fn what_cannot_be_followed_is_refused() {
    let scene = |inertia: InertiaTensor, torque: Torque| {
        let scene = Scene::new(bodies(&[inertia], &[DVec3::new(0.0, 0.5, 0.4)])).until(1.0).torque(torque);
        scene.pinned(Method::Rk4, 0.01, None)
    };
    let diagonal = InertiaTensor::from(DVec3::new(1.0, 1.6, 2.2));
    let tilted = InertiaTensor { xy: 0.1, ..diagonal };
    let moments = |text: &str| Torque::custom_moments(text, Parameters::new()).expect("a formula");
    let factor = |text: &str| Torque::custom_inertia_factor(text, Parameters::new()).expect("a formula");
    let rotor = InertiaTensor::from(DVec3::new(0.0, 1.0, 1.0));
    for (scene, expected) in [
        (scene(tilted, moments("vec(inertia.xx, inertia.yy, inertia.zz)")), "any other body takes a `factor`"),
        (scene(diagonal, moments("vec(1, 1.6, 2.3 + time)")), "expected the body's own moments at t = 0"),
        (scene(diagonal, factor("2 + time")), "expected the factor 1 at t = 0"),
        (scene(rotor, moments("vec(inertia.xx, inertia.yy, inertia.zz)")), "a linear rotor has one moment"),
    ] {
        let message = refusal(&scene);
        assert!(message.contains(expected) && message.lines().count() == 1, "{message}");
    }
    let two = scene(diagonal, factor("1 + time")).torque(factor("1 + time"));
    assert!(refusal(&two).starts_with("torque 2 (custom-factor)"), "{}", refusal(&two));
    for method in [Method::Splitting4, Method::Dlm, Method::ImplicitMidpoint] {
        let scene = scene(diagonal, factor("1 + time")).pinned(method, 0.01, None);
        assert!(refusal(&scene).contains("rigid"), "{}", refusal(&scene));
    }
    let symbols = Torque::custom_inertia_factor("norm(angular_velocity)", Parameters::new()).expect_err("refused");
    assert_eq!((symbols.line, symbols.column), (1, 6), "{symbols}");
    let recorded = Torque::recorded_moments(Parameters::new(), |s| {
        let mass = |element| s.inertia(element);
        Vector::new(mass("xx"), mass("yy"), mass("zz") * s.time())
    });
    assert!(refusal(&scene(diagonal, recorded.expect("a formula"))).contains("less 1"));
}

/// The scene, or the refusal, of a study with this table of a torque.
fn study(torque: &str) -> Result<Scene, String> {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("study.toml");
    let head = "[bodies]\ncount = 2\ninertia = [1, 2, 2.5]\nangular_velocity = [0.1, 1, 0]\n[time]\nend = 1\n[[torque]]\nmodel = \"custom\"\n";
    fs::write(&file, format!("{head}{torque}")).expect("written");
    let study = Study::read(&file).and_then(|study| study.scene());
    study.map_err(|error| {
        error.to_string().rsplit_once("study.toml:").map_or(error.to_string(), |(_, at)| at.to_owned())
    })
}

#[test]
fn studies_hold_moments_and_factors() {
    let text = "parameters = { k = 0.5 }\nmoments = \"vec(inertia.xx + k * time, inertia.yy + k * time, inertia.zz)\"";
    let parameters = || Parameters::new().number("k", vec![0.5, 0.5]).expect("a name");
    let moments = Torque::custom_moments("vec(inertia.xx + k * time, inertia.yy + k * time, inertia.zz)", parameters());
    let scene = study(text).expect("a study");
    assert_eq!(scene.torques()[0].name(), "custom-moments");
    assert_eq!(scene.torques()[0].tensor_at(1, InertiaTensor::from(DVec3::ONE), 2.0).to_array()[..3], [2.0, 2.0, 1.0]);
    let own = moments.expect("a formula");
    assert_eq!(own.tensor_at(1, InertiaTensor::from(DVec3::ONE), 2.0).to_array()[..3], [2.0, 2.0, 1.0]);
    assert_eq!(study("factor = \"1 + time\"").expect("a study").torques()[0].name(), "custom-factor");
    for (text, expected) in [
        ("factor = \"1 + tim\"", "9: torque[1].factor: column 15: unknown name `tim`; nearest: `time`"),
        ("factor = \"vec(1, 1, 1)\"", "9: torque[1].factor: column 11: the result: found a vector, needed a number"),
        ("moments = \"1 + time\"", "9: torque[1].moments: column 12: the result: found a number, needed a vector"),
        (
            "moments = \"angular_velocity\"",
            "9: torque[1].moments: column 12: `angular_velocity` is not known where this formula is used",
        ),
    ] {
        assert_eq!(study(text).expect_err("refused"), expected);
    }
    let both = study("moments = \"vec(1, 2, 2.5)\"\nfactor = \"1\"").expect_err("refused");
    assert!(both.contains("moments") && both.contains("factor"), "{both}");
    let energy = study("moments = \"vec(1, 2, 2.5)\"\nenergy = \"1\"").expect_err("refused");
    assert!(energy.contains("moments") && energy.contains("energy"), "{energy}");
}
