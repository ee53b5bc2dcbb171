//! Extremes, each with defined behaviour: right to a stated bound, or flagged, or of an error that the run itself reports;
//! never silently wrong. On the CPU engine and on the GPU.

use crate::common;
use crate::support;

use std::sync::LazyLock;

use glam::{DQuat, DVec3};
use polhode::kernel::free_motion::FreeMotion;
use polhode::kernel::method::splitting::Splitting;
use polhode::kernel::torque_kernel::Free;
use polhode::math::quaternion::Quaternion;
use polhode::torque::Torque;
use polhode::{Accuracy, Engine, Ensemble, Method, Outputs, Plan, Precision, Record, Scene};
use support::double_double::DoubleDouble;
use support::torque_kernel::{at_start, between, stepped};

const START: [f64; 4] = [0.1, -0.7, 0.3, 0.4];

fn start() -> DQuat {
    DQuat::from_array(START).normalize()
}

fn run(engine: &Engine, scene: &Scene) -> Record {
    engine.run(&Plan::new(scene, engine).expect("a plan")).expect("a run")
}

/// Opened once for all tests.
static GPU: LazyLock<Engine> = LazyLock::new(common::gpu);

fn engines() -> [(&'static str, Engine); 2] {
    [("CPU", Engine::cpu()), ("GPU", GPU.clone())]
}

fn one(moments: DVec3, omega: DVec3, end: f64) -> Scene {
    Scene::new(Ensemble::from_columns(&[moments], &[start()], &[omega]).expect("valid")).until(end)
}

fn angle(a: DQuat, b: DQuat) -> f64 {
    let between = a.conjugate() * b;
    2.0 * between.xyz().length().atan2(between.w.abs())
}

/// The attitude after `span`, from the discrete flow in 32 digits with its error of order 6 taken out.
fn truth(moments: DVec3, omega: DVec3, span: f64, steps: u64) -> Quaternion<DoubleDouble> {
    let moving = at_start::<DoubleDouble>(moments, START, omega);
    let flow = |steps: u64| stepped::<_, Splitting<6>, _>(&moving, &Free, span / steps as f64, steps).orientation.value;
    let (fine, coarse) = (flow(2 * steps), flow(steps));
    fine + (fine - coarse) * (DoubleDouble::from(1.0) / DoubleDouble::from(63.0))
}

/// Holds the error of a free body in closed form to a bound for each precision, rad.
fn hold_closed_form(what: &str, moments: DVec3, omega: DVec3, bounds: [(Precision, f64); 2]) {
    const SPAN: f64 = 10.0;
    let truth = truth(moments, omega, SPAN, 4096);
    for (name, engine) in engines() {
        for (precision, bound) in bounds {
            let accuracy = Accuracy::attitude(if precision == Precision::F64 { 1e-10 } else { 1e-3 });
            let record = run(&engine, &one(moments, omega, SPAN).accuracy(accuracy).precision(Some(precision)));
            assert!(record.trust().failed_bodies.is_empty());
            let [x, y, z, w] = record.final_state().orientation(0).to_array().map(DoubleDouble::from);
            let error = between(truth, Quaternion::new(x, y, z, w));
            println!("{what}, {precision}, {name}: {error:.1e} rad");
            assert!(error <= bound, "{what}, {precision}, {name}: {error:e}");
        }
    }
}

#[test]
fn slender_bodies_of_a_ratio_up_to_1e9() {
    // The direction of the angular momentum is known to a rounding, which the spin about a slender axis magnifies by the
    // ratio, over the time that it takes to turn: METHODS 1.5. Here the spin about the slender axis is that of the others.
    for ratio in [1e3, 1e5, 1e7, 1e9] {
        let moments = DVec3::new(1.0 / ratio, 1.0, 1.0 + 0.5 / ratio);
        let omega = DVec3::new(0.8, 0.5, -0.3);
        let bounds = [(Precision::F64, 1e-14), (Precision::F32, 2e-6)];
        hold_closed_form(&format!("ratio {ratio:e}"), moments, omega, bounds);
    }
}

#[test]
fn moments_that_differ_by_an_ulp_and_spins_an_ulp_beside_a_steady_rotation() {
    let up = f64::next_up;
    let spin = DVec3::new(0.8, 0.5, -0.3);
    let spun = DVec3::new(1.0, 2.0, 2.5);
    let cases = [
        ("I2 an ulp above I1", DVec3::new(1.0, up(1.0), 1.7), spin),
        ("I3 an ulp above I2", DVec3::new(1.0, 1.7, up(1.7)), spin),
        ("all an ulp apart", DVec3::new(1.0, up(1.0), up(up(1.0))), spin),
        ("a plate", DVec3::new(1.0, 2.0, 3.0), spin),
        ("an ulp beside the first axis", spun, DVec3::new(1.0, f64::EPSILON, 0.0)),
        ("an ulp beside the middle axis", spun, DVec3::new(0.0, 1.0, f64::EPSILON)),
        ("an ulp beside the last axis", spun, DVec3::new(f64::EPSILON, 0.0, 1.0)),
        ("a subnormal beside the middle axis", spun, DVec3::new(5e-324, 1.0, 0.0)),
    ];
    for (name, moments, omega) in cases {
        hold_closed_form(name, moments, omega, [(Precision::F64, 5e-15), (Precision::F32, 1e-6)]);
    }
}

/// The spin of the separatrix of moments 1, 2, 3: 2T = L²/I₂ where ω₁ = ω₃.
#[test]
fn on_the_separatrix_and_an_ulp_to_either_side() {
    let moments = DVec3::new(1.0, 2.0, 3.0);
    for (name, third) in [("inside", 1.0_f64.next_down()), ("on it", 1.0), ("outside", 1.0_f64.next_up())] {
        let omega = DVec3::new(1.0, 1.0, third);
        // An orbit beside it leaves it as e^(λ t), λ = √((I₂−I₁)(I₃−I₂)/(I₁I₃)) ω ≈ 1.15/s here: an ulp of the data is
        // 1e-11 rad after 10 s, which exact arithmetic on the data follows.
        hold_closed_form(name, moments, omega, [(Precision::F64, 1e-13), (Precision::F32, 1e-5)]);
    }
}

#[test]
fn a_billion_revolutions_end_where_the_period_says() {
    // A round body: after n periods of both its rotations it is back. Both rates are dyadic, so that the turns are exact.
    let moments = DVec3::new(2.0, 2.0, 1.0);
    let motion = FreeMotion::new(moments, DQuat::IDENTITY, DVec3::new(0.0, 0.0, 1.0)).expect("valid");
    for turns in [1.0, 1e3, 1e9] {
        let state = motion.at(turns * std::f64::consts::TAU);
        // The f64 time itself is off by half an ulp.
        let bound = 1e-15 + turns * std::f64::consts::TAU * 1.2e-16;
        assert!(angle(state.orientation, DQuat::IDENTITY) <= bound, "{turns:e}: {}", state.orientation);
    }
}

/// The largest error that a run of one body reports of itself.
fn reported(record: &Record) -> f64 {
    record.trust().recomputed_sample.attitude.max
}

/// The least and the greatest step, rad, as powers of ten.
const EXPONENTS: std::ops::RangeInclusive<i32> = -9..=3;

/// Steps of every length by one method: right, flagged, or of an error that the run reports.
fn hold_steps_of_any_length(name: &str, engine: &Engine, method: Method, precision: Precision) {
    let mut flagged = Vec::new();
    let (moments, omega) = (DVec3::new(1.0, 1.6, 2.2), DVec3::new(0.3, 0.8, -0.5));
    let motion = FreeMotion::new(moments, start(), omega).expect("valid");
    for exponent in EXPONENTS {
        let dt = 10_f64.powi(exponent);
        let end = 100.0 * dt;
        let record = run(engine, &one(moments, omega, end).pinned(method, dt, Some(precision)));
        if !record.trust().failed_bodies.is_empty() {
            flagged.push(exponent);
            continue;
        }
        let q = record.final_state().orientation(0);
        let error = angle(q, motion.at(end).orientation);
        let what = format!("{method} {precision} {name}, omega dt = {dt:e}");
        // The run's own estimate comes from the closed form, as the truth here does.
        let rounding = if precision == Precision::F64 { 1e-13 } else { 1e-5 };
        let reported = reported(&record);
        assert!(reported >= 0.9 * error - rounding, "{what}: {error:e} rad, {reported:e} reported");
        // A step beyond the method's usable region is said to be one, whatever came of it.
        let beyond = omega.length() * dt > 2.0 * method.properties().usable_angle;
        assert!(!beyond || record.trust().outside_usable_region == 1, "{what}");
        if exponent <= -4 {
            // A hundred steps of an angle below 1e-4: no method is off by more than its first order.
            let bound = 100.0 * dt * dt + rounding;
            assert!(error <= bound, "{what}: {error:e} rad");
        }
    }
    // Of steps of a tenth of a radian and less none is lost.
    assert!(flagged.iter().all(|&exponent| exponent >= 0), "{method} {precision} {name}: flagged at 10^{flagged:?}");
}

#[test]
fn a_step_of_any_length_is_right_flagged_or_reported_wrong() {
    for (name, engine) in engines() {
        for method in Method::ALL {
            for precision in Precision::ALL {
                hold_steps_of_any_length(name, &engine, method, precision);
            }
        }
    }
}

#[test]
fn stiff_drag_stops_a_body_or_is_flagged_or_reported() {
    // c dt / I up to 1e6.
    let methods = Method::ALL.into_iter().filter(|method| !method.properties().baseline);
    for (method, (name, engine)) in methods.flat_map(|method| engines().map(|engine| (method, engine))) {
        for stiffness in [1.0, 1e2, 1e4, 1e6] {
            let (dt, steps) = (0.01, 50.0);
            let scene = one(DVec3::splat(1.0), DVec3::new(0.3, 0.8, -0.5), dt * steps)
                .torque(Torque::linear_drag(stiffness / dt))
                .pinned(method, dt, Some(Precision::F64));
            let record = run(&engine, &scene);
            let omega = record.final_state().angular_velocity_body(0);
            let stopped = omega.length() < 1e-6;
            let trust = record.trust();
            let recomputed = &trust.recomputed_sample;
            let said =
                !trust.failed_bodies.is_empty() || recomputed.angular_velocity.max > 0.1 || recomputed.diverged > 0;
            assert!(stopped || said, "{method}, {name}, c dt / I = {stiffness:e}: {omega} and nothing said");
        }
    }
    // The exact kick of the splitting without negative substeps is right however stiff the drag is.
    let scene = one(DVec3::splat(1.0), DVec3::new(0.3, 0.8, -0.5), 0.5).torque(Torque::linear_drag(1e8)).pinned(
        Method::Splitting2,
        0.01,
        Some(Precision::F64),
    );
    for (name, engine) in engines() {
        let omega = run(&engine, &scene).final_state().angular_velocity_body(0);
        assert!(omega.length() < 1e-12, "{name}: {omega}");
    }
}

#[test]
fn a_torque_that_spins_a_body_up_a_millionfold() {
    let (moments, torque) = (DVec3::new(1.0, 2.0, 2.5), DVec3::new(0.0, 0.0, 2.5));
    let cases = Precision::ALL.into_iter().flat_map(|precision| engines().map(|engine| (precision, engine)));
    for (precision, (name, engine)) in cases {
        let scene = one(moments, DVec3::new(0.0, 0.0, 1e-3), 1000.0).torque(Torque::constant_body(torque)).pinned(
            Method::Rk4,
            1e-3,
            Some(precision),
        );
        let record = run(&engine, &scene);
        let omega = record.final_state().angular_velocity_body(0);
        // ω = ω₀ + t τ/I. All increments are equal, so that roundings may all be of one sign: in f32 that of the increment,
        // 6e-8; in f64 that of the sum, 1.1e-16 a step.
        let bound = if precision == Precision::F32 { 1e-7 } else { 1.1e-10 };
        assert!((omega.z / 1000.001 - 1.0).abs() < bound, "{precision}, {name}: {omega}");
        assert!(omega.x.abs() + omega.y.abs() < 1e-9, "{precision}, {name}: {omega}");
    }
}

#[test]
fn one_mad_body_among_a_million_changes_nobody_else() {
    const BODIES: usize = 1_000_000;
    const MAD: usize = 777_777;
    let row = |body: usize, mad: bool| {
        let spin = 0.1 + (body % 1009) as f64 / 1009.0;
        let omega = if mad && body == MAD { DVec3::new(1e15, -3e14, 2e15) } else { DVec3::new(spin, 0.3, -0.5 * spin) };
        (DVec3::new(1.0, 1.6, 2.2), start(), omega)
    };
    for (name, engine) in engines() {
        let states = |mad: bool| {
            let ensemble = Ensemble::from_fn(BODIES, |body| row(body, mad)).expect("valid");
            run(&engine, &Scene::new(ensemble).until(0.05).pinned(Method::Rk4, 0.01, Some(Precision::F32)))
        };
        let (quiet, loud) = (states(false), states(true));
        assert!(quiet.trust().failed_bodies.is_empty());
        for body in (0..BODIES).filter(|body| *body != MAD) {
            assert_eq!(quiet.final_state().orientation(body), loud.final_state().orientation(body), "{name}, {body}");
        }
    }
}

#[test]
fn output_times_at_zero_and_at_the_end_are_given_out_and_one_twice_is_refused() {
    let scene = |times: &[f64]| {
        one(DVec3::new(1.0, 1.6, 2.2), DVec3::new(0.3, 0.8, -0.5), 1.0).outputs(Outputs::Times(times.to_vec()))
    };
    let ways: [fn(Scene) -> Scene; 2] = [
        |scene| scene.pinned(Method::Rk4, 0.01, Some(Precision::F64)),
        |scene| scene.accuracy(Accuracy::attitude(1e-6)),
    ];
    for (name, engine) in engines() {
        for way in ways {
            for times in [&[0.0, 0.5, 1.0][..], &[0.0], &[1.0], &[]] {
                let record = run(&engine, &way(scene(times)));
                let found: Vec<f64> = record.snapshots().iter().map(|snapshot| snapshot.time()).collect();
                // The end is always given out.
                let expected = if times.last() == Some(&1.0) { times.to_vec() } else { [times, &[1.0]].concat() };
                assert_eq!(found, expected, "{name}");
                if times.first() == Some(&0.0) {
                    assert!(angle(record.snapshots()[0].orientation(0), start()) < 1e-15, "{name}");
                }
            }
            for times in [[0.0, 0.0], [0.5, 0.5], [1.0, 1.0], [0.5, 0.25]] {
                let refusal = Plan::new(&way(scene(&times)), &engine).map(|_| ()).expect_err("refused").to_string();
                assert!(refusal.contains("time.outputs.times") && refusal.contains("increasing times"), "{refusal}");
            }
        }
    }
    // No time at all: the start, once.
    for way in ways {
        let scene = way(one(DVec3::new(1.0, 1.6, 2.2), DVec3::new(0.3, 0.8, -0.5), 0.0));
        let record = run(&Engine::cpu(), &scene);
        assert_eq!(record.snapshots().len(), 1);
        assert!(angle(record.final_state().orientation(0), start()) < 1e-15);
    }
}

/// `cargo test --release --test truth extremes -- --ignored --nocapture`
#[test]
#[ignore = "a minute in release"]
fn a_hundred_million_steps() {
    const STEPS: u64 = 100_000_000;
    const DT: f64 = 0.01;
    let moments = DVec3::new(1.0, 1.6, 2.2);
    let omegas = [DVec3::new(0.3, 0.8, -0.5), DVec3::new(1.0, -0.2, 0.1), DVec3::new(0.1, 0.3, 0.9)];
    let ensemble = Ensemble::from_fn(omegas.len(), |body| (moments, start(), omegas[body])).expect("valid");
    // A sum of n roundings of u = 1.1e-16 walks √n u = 1.1e-12, energy twice that, and the angle by the walk times the
    // million radians turned over √3: 6e-7. Three standard deviations of each of three bodies. The second words of f32
    // carry 48 bits, but its coefficients are rounded: rk8's energy drifts by 1.2e-6 in a million steps (`conservation.rs`).
    let cases = [
        (Method::Rk8, Precision::F64, 7e-12, 2e-6),
        (Method::Splitting6, Precision::F64, 7e-12, 2e-6),
        (Method::Rk8, Precision::F32, 3e-4, std::f64::consts::PI),
    ];
    for (method, precision, energy_bound, attitude_bound) in cases {
        let scene = Scene::new(ensemble.clone()).until(DT * STEPS as f64).pinned(method, DT, Some(precision));
        let record = run(&Engine::cpu(), &scene);
        let trust = record.trust();
        assert_eq!(trust.body_steps, STEPS * omegas.len() as u64);
        let (energy, attitude) = (trust.drift.kinetic_energy.max, trust.recomputed_sample.attitude.max);
        println!("{method} {precision}: energy {energy:.1e}, attitude {attitude:.1e} rad");
        assert!(energy <= energy_bound, "{method} {precision}: energy drifts by {energy:e}");
        assert!(attitude <= attitude_bound, "{method} {precision}: {attitude:e} rad");
    }
}

#[test]
fn ends_of_the_ranges_and_a_step_beyond() {
    let (parts, direction) = (DVec3::new(1.0, 1.6, 2.2), DVec3::new(0.3, 0.8, -0.5));
    let usual = FreeMotion::new(parts, start(), direction).expect("valid").at(7.0).orientation;
    // Scaled by powers of two nothing changes but the exponents; 2^-153 is 1e-46, 2^127 1e38, 2^-30 1e-9, 2^50 1e15.
    let engines = engines();
    for moment in [-154, -153, 0, 127, 128] {
        for rate in [-31, -30, 0, 50, 51] {
            let (m, r) = (2.0_f64.powi(moment), 2.0_f64.powi(rate));
            // The first asks for so much that constants are formed in two words, as those of the usual body.
            for (precision, asked, bound) in [(Precision::F64, 1e-13, 1e-15), (Precision::F32, 1e-5, 1e-6)] {
                let scene = one(parts * m, direction * r, 7.0 / r).accuracy(Accuracy::attitude(asked));
                for (name, engine) in &engines {
                    let record = run(engine, &scene.clone().precision(Some(precision)));
                    let error = angle(record.final_state().orientation(0), usual);
                    assert!(error <= bound, "2^{moment} kg m², 2^{rate} rad/s, {precision}, {name}: {error:e}");
                }
            }
        }
    }
    // Far beyond, where the tensor's products leave f64, it is refused or right.
    for m in [1e-320, 1e-300, 1e300] {
        if let Ok(ensemble) = Ensemble::from_columns(&[parts * m], &[start()], &[direction]) {
            let record = run(&Engine::cpu(), &Scene::new(ensemble).until(7.0).accuracy(Accuracy::attitude(1e-5)));
            // A subnormal moment has few digits.
            let bound = if m < 1e-310 { 1e-2 } else { 1e-5 };
            assert!(angle(record.final_state().orientation(0), usual) <= bound, "{m:e}");
        }
    }
}
