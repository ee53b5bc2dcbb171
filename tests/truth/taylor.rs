//! `taylor`: every torque against adaptive `rk8`, golden bodies, drift, reversal, cuts of the span, a body alone and among others.

use crate::common;
use crate::support;

use common::compare::{compare_states, first_bit_difference};
use common::torques::{batch_under, every_torque, middle_moments};
use glam::{DQuat, DVec3};
use polhode::bodies::Status;
use polhode::bodies::columns::StateWords;
use polhode::engine::StepCounts;
use polhode::engine::batch::{AnyBatch, prepare_with};
use polhode::engine::{Backend, End, Engine, unobserved};
use polhode::math::Precision;
use polhode::scene::AdaptiveSteps;
use polhode::torque::variable_inertia::{InertiaChange, Law};
use polhode::torque::{Orbit, Parameters, Torque};
use polhode::{Ensemble, Error, Method, Plan, Scene};
use proptest::prelude::*;
use support::attitude_error;
use support::golden;

/// Fills no lane group of any width, and more than one tile.
pub const BODIES: usize = 37;
pub const SEED: u64 = 31;
/// s; bodies turn by about a radian a second.
pub const END: f64 = 3.0;

pub fn steps(tolerance: f64) -> AdaptiveSteps {
    AdaptiveSteps { tolerance, least_step: None }
}

fn column(first: f64, last: f64) -> Vec<f64> {
    (0..BODIES).map(|body| first + (last - first) * body as f64 / BODIES as f64).collect()
}

/// Moments that change, for all bodies alike and for each in its own way.
fn changes() -> [Torque; 4] {
    let [ramp, own_ramp, oscillation] = [
        (InertiaChange::factor(0.6), Law::ramp(0.4, 1.5)),
        (InertiaChange::factor(column(0.5, 2.0)), Law::ramp(column(0.0, 1.2), column(0.5, 3.0))),
        (InertiaChange::factor(column(0.5, 2.0)), Law::oscillation(column(-3.0, 3.0))),
    ]
    .map(|(change, law)| Torque::variable_inertia(change, law));
    let parameters = Parameters::new().number("w", column(-3.0, 3.0)).and_then(|of| of.number("a", column(0.1, 0.6)));
    let text = "1 + a * sin(w * time) * time / (1 + time)";
    let formula = Torque::custom_inertia_factor(text, parameters.expect("names")).expect("a formula");
    [ramp, own_ramp, oscillation, formula]
}

/// Torques along orbits of which some elements and angles are 0 for all bodies, so that series leave out their terms; one along an orbit that
/// is a circle for the first body alone; and one that is along one of the body's own axes, but not of its principal ones.
fn with_zeros() -> [Torque; 5] {
    let moments = middle_moments(BODIES, SEED);
    let own = |factor: f64| moments.iter().map(|moment| factor * moment).collect::<Vec<f64>>();
    let magnets: Vec<DVec3> = moments.iter().map(|moment| DVec3::new(0.5, -0.2, 0.3) * *moment).collect();
    let circle = Orbit::circular(1.0, 1.4);
    let oblate = circle.clone().inclined(0.6).with_j2(0.3, 1.2);
    let ellipses = Orbit::kepler(1.0, 1.5, column(0.0, 0.5)).inclined(0.4);
    [
        Torque::orbiting_dipole(magnets.clone(), circle.clone().inclined(0.6), 1.0, 0.0, 0.0, 0.0),
        Torque::orbiting_eddy_current(own(0.2), circle, 1.5, std::f64::consts::PI, 0.0, 0.3),
        Torque::orbiting_eddy_current(own(0.2), oblate, 1.5, 0.0, 0.0, 0.0),
        Torque::orbiting_dipole(magnets, ellipses, 1.0, column(0.0, 1.0), 0.0, column(0.0, -0.7)),
        Torque::sinusoidal(DVec3::Z * 3e-3, DVec3::ZERO, 1.3),
    ]
}

/// Every torque alone, what users write, and all together with moments that change. The logarithmic spring jumps at half a turn, where
/// steps of any method are as good as their luck: it pulls each body to where it starts, softly.
pub fn scenes() -> Vec<(String, Vec<Torque>)> {
    let moments = middle_moments(BODIES, SEED);
    let own: Vec<DQuat> = common::asymmetric_ensemble(BODIES, SEED).orientation().to_vec();
    let stiffness: Vec<f64> = moments.iter().map(|moment| 3.0 * moment).collect();
    let smooth = |torque: Torque| match torque.name() {
        "log-spring" => Torque::log_spring(stiffness.clone(), own.clone()),
        _ => torque,
    };
    let all: Vec<Torque> =
        every_torque(&moments).into_iter().filter(|torque| !torque.is_random()).map(smooth).collect();
    let parameters = || Parameters::new().number("k", moments.clone()).expect("a name");
    let texts = [
        "-0.1 * k * angular_velocity * exp(-0.2 * time) + 0.1 * k * vec(sin(time * time), atan2(time, 2), pow(1 + time, 0.3))",
        "let up = to_body(vec(0, 0, 1));\n0.2 * k * cross(up, vec(0, 0, 1)) * sqrt(2 + dot(up, vec(1, 0, 0)))",
        "0.1 * k * max(dot(to_body(vec(0, 0, 1)), vec(1, 0, 0)), 0) * vec(0, 1, 0)",
    ];
    let customs = texts.map(|text| Torque::custom(text, parameters()).expect("a formula"));
    let (changes, with_zeros) = (changes(), with_zeros());
    let mut scenes = vec![("no torque".to_owned(), vec![])];
    let alone = all
        .iter()
        .chain(&changes)
        .chain(&customs)
        .chain(&with_zeros)
        .map(|torque| (torque.name().to_owned(), vec![torque.clone()]));
    scenes.extend(alone);
    scenes.push(("all".to_owned(), all.clone()));
    scenes.extend(changes.map(|change| ("all and moments".to_owned(), [all.clone(), vec![change]].concat())));
    scenes
}

/// The states at the last of `times`, by `taylor` or adaptive `rk8`.
fn ended(
    engine: &Engine,
    batch: AnyBatch,
    method: Method,
    tolerance: f64,
    times: &[f64],
) -> (StateWords, Vec<StepCounts>) {
    let count = batch.body_count();
    let session = match method {
        Method::Taylor => engine.start_taylor(batch, steps(tolerance)),
        _ => engine.start_adaptive(batch, steps(tolerance)),
    };
    let mut session = session.expect("started");
    for &time in times {
        session.advance_to(End::at(time), &mut unobserved).expect("advanced");
    }
    (session.read(0..count).expect("read"), session.counts().expect("counted"))
}

fn by_taylor(count: usize, torques: &[Torque], tolerance: f64) -> StateWords {
    ended(&Engine::cpu(), batch_under(count, SEED, torques, Precision::F64), Method::Taylor, tolerance, &[END]).0
}

fn by_rk8(torques: &[Torque], tolerance: f64) -> StateWords {
    ended(&Engine::cpu(), batch_under(BODIES, SEED, torques, Precision::F64), Method::Rk8, tolerance, &[END]).0
}

/// The greatest difference of any body: of the quaternion, or of m relative to |m|; NaN where there is one.
pub fn difference(a: &StateWords, b: &StateWords) -> f64 {
    let of_body = |body: usize| {
        let (a, b) = (a.combined(body), b.combined(body));
        let m = DVec3::from_slice(&b[4..]).length().max(1e-3);
        (0..7).map(|part| (a[part] - b[part]).abs() / if part < 4 { 1.0 } else { m }).fold(0.0, most)
    };
    (0..a.len()).map(of_body).fold(0.0, most)
}

fn most(most: f64, x: f64) -> f64 {
    if x > most || x.is_nan() { x } else { most }
}

#[test]
fn every_torque_agrees_with_adaptive_rk8() {
    // Tolerances of a step: errors grow over some tens of steps, and rounding in `rk8` leaves 1e-13.
    for (name, torques) in scenes() {
        let expected = by_rk8(&torques, 1e-13);
        // A step of `rk8` that holds the end of a ramp, or the point where one of two numbers becomes the greater, makes an error of its
        // own; those of `taylor` end there.
        let is_smooth = torques.iter().all(|torque| !["variable-inertia", "custom"].contains(&torque.name()));
        for (tolerance, bound) in [(1e-12, if is_smooth { 3e-11 } else { 1e-9 }), (1e-7, 1e-5)] {
            let found = by_taylor(BODIES, &torques, tolerance);
            assert!(found.status.iter().all(|status| *status == Status::Valid), "{name}: {:?}", found.status);
            let difference = difference(&found, &expected);
            println!("{name} at {tolerance:e}: {difference:.1e}");
            assert!(difference < bound, "{name} at {tolerance:e}: {difference:e}");
        }
    }
}

#[test]
fn the_error_is_proportional_to_the_tolerance() {
    for (name, torques) in scenes().into_iter().filter(|(name, _)| !name.starts_with("custom")) {
        let expected = by_taylor(BODIES, &torques, 3e-15);
        let tolerances = [1e-4, 1e-6, 1e-8, 1e-10];
        let errors = tolerances.map(|tolerance| difference(&by_taylor(BODIES, &torques, tolerance), &expected));
        println!("{name}: {errors:?}");
        for (error, tolerance) in errors.into_iter().zip(tolerances) {
            assert!(error < 300.0 * tolerance, "{name} at {tolerance:e}: {error:e}");
        }
        assert!(errors[3] < 1e-4 * errors[0], "{name}: {errors:?}");
    }
}

#[test]
fn bodies_that_are_spun_up_are_followed() {
    // Almost spherical bodies turn at a rate that grows evenly: what is known where a step starts says little of its end.
    let row = |body: usize| {
        let x = body as f64 / BODIES as f64;
        (DVec3::new(1.0, 1.0 + 0.1 * x, 1.05 + 0.1 * x), DQuat::IDENTITY, DVec3::new(0.2 * x, -0.3, 0.1))
    };
    let ensemble = Ensemble::from_fn(BODIES, row).expect("valid");
    let torques = [Torque::constant_body(DVec3::new(0.9, 0.4, -0.6)), Torque::linear_drag(0.02)];
    let run = |method, tolerance| {
        let (_, batch) = prepare_with(&ensemble, &torques, 10.0, Precision::F64).expect("prepared");
        ended(&Engine::cpu(), batch, method, tolerance, &[10.0]).0
    };
    let expected = run(Method::Rk8, 1e-14);
    for tolerance in [1e-6, 1e-9, 1e-12] {
        let difference = difference(&run(Method::Taylor, tolerance), &expected);
        println!("{tolerance:e}: {difference:.1e}");
        assert!(difference < 300.0 * tolerance, "{tolerance:e}: {difference:e}");
    }
}

#[test]
fn a_torque_of_the_wrong_sign_is_seen() {
    // What the comparisons above would make of a fault: a hundredth of one torque is left out.
    let all = |factor: f64| vec![Torque::constant_body(DVec3::new(0.1, 0.2, 0.3) * factor), Torque::linear_drag(0.01)];
    assert!(difference(&by_taylor(BODIES, &all(0.99), 1e-12), &by_rk8(&all(1.0), 1e-13)) > 1e-4);
}

#[test]
fn golden_bodies_without_torques_are_met() {
    // The golden states are good to 1e-15; conditioning and some tens of roundings come in.
    let mut checked = 0;
    for case in golden::load("free_asymmetric") {
        let times: Vec<f64> = case
            .states
            .iter()
            .map(|state| state.time)
            .filter(|time| time * case.angular_velocity_body.length() < 60.0)
            .collect();
        let rows = (case.inertia, case.orientation, case.angular_velocity_body);
        let ensemble = Ensemble::from_fn(1, |_| rows).expect("golden bodies are valid");
        let end = times.last().copied().expect("a time");
        let (frames, batch) = prepare_with(&ensemble, &[], end, Precision::F64).expect("prepared");
        let mut session = Engine::cpu().start_taylor(batch, steps(1e-14)).expect("started");
        for (time, state) in times.iter().zip(&case.states) {
            session.advance_to(End::at(*time), &mut unobserved).expect("advanced");
            let reached = frames[0].body_state(session.read(0..1).expect("read").combined(0));
            let error = attitude_error(reached.orientation, state.orientation);
            assert!(error < 2e-12, "{} at {time}: {error:e}", case.name);
            checked += 1;
        }
    }
    assert!(checked > 20, "{checked}");
}

#[test]
fn lanes_agree_with_one_body_at_a_time() {
    for (name, torques) in scenes() {
        let run = |engine: Engine| {
            let batch = batch_under(BODIES, SEED, &torques, Precision::F64);
            ended(&engine, batch, Method::Taylor, 1e-9, &[0.4 * END, END]).0
        };
        // Fused and unfused sums; what decides steps is rounded too.
        let compared = compare_states::<f64>(&run(Engine::cpu_scalar()), &run(Engine::cpu()), 4e4);
        assert!(compared.is_ok(), "{name}: {:?}", compared.map_err(|mismatch| mismatch.to_string()));
    }
}

#[test]
fn a_body_is_advanced_alone_as_among_others() {
    for (name, torques) in scenes() {
        let whole = by_taylor(BODIES, &torques, 1e-9);
        for count in [1, 2, 7, 16, 33] {
            let expected = whole.part(0..count);
            let difference = first_bit_difference(&expected, &by_taylor(count, &torques, 1e-9));
            assert_eq!(difference, None, "{name}, {count} bodies of {BODIES}");
        }
    }
}

/// A fast body takes many more steps than a slice has, between which the directions that it is stepped by have to be kept.
#[test]
fn directions_are_kept_between_slices() {
    let end = 150.0;
    let body = |body: usize| {
        let spin =
            if body == 3 { DVec3::new(90.0, 140.0, 30.0) } else { DVec3::new(0.1, 0.2, 0.3 + 0.1 * body as f64) };
        (DVec3::new(1.0, 1.6, 2.1), DQuat::IDENTITY, spin)
    };
    let torques = [Torque::gravity_gradient(Orbit::circular(16.0, 1.0).inclined(0.4))];
    let states = |first: usize, count: usize, method: Method, tolerance: f64, times: &[f64]| {
        let ensemble = Ensemble::from_fn(count, |row| body(first + row)).expect("valid bodies");
        let (_, batch) = prepare_with(&ensemble, &torques, end, Precision::F64).expect("prepared");
        ended(&Engine::cpu(), batch, method, tolerance, times)
    };
    let (among, counts) = states(0, 5, Method::Taylor, 1e-10, &[end]);
    assert!(counts[3].accepted > 8192, "{counts:?}");
    let row = |words: &StateWords, row: usize| words.part(row..row + 1);
    let (alone, _) = states(3, 1, Method::Taylor, 1e-10, &[end]);
    assert_eq!(first_bit_difference(&row(&among, 3), &alone), None);
    // 1.6e4 steps, each wrong by the tolerance at most; without the torque the attitude is another.
    let (expected, _) = states(3, 1, Method::Rk8, 1e-12, &[end]);
    let error = difference(&alone, &expected);
    assert!(error < 2e-6, "{error:e}");
    let ensemble = Ensemble::from_fn(1, |_| body(3)).expect("a valid body");
    let (_, batch) = prepare_with(&ensemble, &[], end, Precision::F64).expect("prepared");
    let (free, _) = ended(&Engine::cpu(), batch, Method::Rk8, 1e-12, &[end]);
    assert!(difference(&free, &expected) > 1e-2);
}

/// One asymmetric body after some revolutions in steps of the tolerance: the relative changes of energy and angular momentum in the world.
fn drift(torques: &[Torque], revolutions: f64) -> [f64; 3] {
    let (moments, omega) = (DVec3::new(1.0, 1.6, 2.1), DVec3::new(0.7, 0.9, -0.4));
    let ensemble = Ensemble::from_columns(&[moments], &[DQuat::IDENTITY], &[omega]).expect("valid");
    let end = revolutions * std::f64::consts::TAU / omega.length();
    let (frames, batch) = prepare_with(&ensemble, torques, end, Precision::F64).expect("prepared");
    let (words, _) = ended(&Engine::cpu(), batch, Method::Taylor, 1e-15_f64.max(2e-15), &[end]);
    assert_eq!(words.status[0], Status::Valid);
    let state = frames[0].body_state(words.combined(0));
    let energy = |omega: DVec3| 0.5 * omega.dot(moments * omega);
    let momentum = |q: DQuat, omega: DVec3| q * (moments * omega);
    let (first, last) = (momentum(DQuat::IDENTITY, omega), momentum(state.orientation, state.angular_velocity_body));
    [
        (energy(state.angular_velocity_body) / energy(omega) - 1.0).abs(),
        (last - first).length() / first.length(),
        (state.orientation.length() - 1.0).abs(),
    ]
}

#[test]
fn drift_is_that_of_rounding() {
    // 2e4 revolutions are about 1e5 steps: independent roundings would leave 1e-16 times their root, 3e-14.
    let [energy, momentum, norm] = drift(&[], 2e4);
    println!("free: energy {energy:.1e}, angular momentum {momentum:.1e}, norm {norm:.1e}");
    assert!(energy < 1e-12 && momentum < 3e-12 && norm < 1e-14, "{energy:e}, {momentum:e}, {norm:e}");
    // A torque of no size that asks for the attitude leads through the series of the attitude.
    let none = Torque::sine_spring(1e-30, DQuat::IDENTITY);
    let [energy, momentum, norm] = drift(&[none], 2e4);
    println!("with the attitude: energy {energy:.1e}, angular momentum {momentum:.1e}, norm {norm:.1e}");
    assert!(energy < 1e-12 && momentum < 3e-12 && norm < 1e-14, "{energy:e}, {momentum:e}, {norm:e}");
}

#[test]
#[ignore = "a minute: cargo test --release --test truth taylor -- --ignored --nocapture"]
fn drift_over_a_million_revolutions() {
    let [energy, momentum, norm] = drift(&[], 1e6);
    println!("energy {energy:.1e}, angular momentum {momentum:.1e}, norm {norm:.1e}");
    assert!(energy < 1e-11 && momentum < 1e-10 && norm < 1e-14);
}

#[test]
fn bodies_at_rest_stay_or_start() {
    let ensemble =
        |count| Ensemble::from_fn(count, |_| (DVec3::new(1.0, 1.6, 2.1), DQuat::IDENTITY, DVec3::ZERO)).expect("valid");
    let run = |torques: &[Torque], method| {
        let (_, batch) = prepare_with(&ensemble(3), torques, END, Precision::F64).expect("prepared");
        ended(&Engine::cpu(), batch, method, 1e-10, &[END])
    };
    let (still, counts) = run(&[Torque::quadratic_drag(0.1)], Method::Taylor);
    assert_eq!(still.combined(0), [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    assert!(counts[0].accepted < 10, "{counts:?}");
    // The drag's |ω| has no series at rest.
    let torques = [Torque::quadratic_drag(0.1), Torque::constant_body(DVec3::new(0.2, -0.1, 0.3))];
    let (found, counts) = run(&torques, Method::Taylor);
    let difference = difference(&found, &run(&torques, Method::Rk8).0);
    println!("from rest: {difference:.1e} in {:?}", counts[0]);
    assert!(difference < 1e-8 && counts[0].accepted < 200, "{difference:e}, {counts:?}");
}

/// A pulse 1/cosh of which the exponentials overflow far from it. It turns a sphere by the rate 2 k s arctan(tanh(t/(2 s))) from −∞ to ∞: π k s.
#[test]
fn series_pass_exponentials_that_overflow() {
    let text = "vec(0, 0.02 / (exp((time - 5) / 0.005) + exp(-(time - 5) / 0.005)), 0)";
    let torque = Torque::custom(text, Parameters::new()).expect("a formula");
    let ensemble = Ensemble::from_fn(3, |_| (DVec3::ONE, DQuat::IDENTITY, DVec3::ZERO)).expect("bodies");
    let scene = Scene::new(ensemble).torque(torque).until(10.0).taylor(steps(1e-9));
    let engine = Engine::cpu();
    let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
    assert!(record.trust().failures.is_empty(), "{:?}", record.trust().failures);
    let rate = record.final_state().angular_velocity_body(0).y;
    let expected = 0.01 * 0.005 * std::f64::consts::PI;
    assert!((rate / expected - 1.0).abs() < 1e-7, "{rate:e}, {expected:e}");
}

#[test]
fn a_spring_that_jumps_at_half_a_turn_is_followed() {
    // About one axis: θ'' = −k θ/I on (−π, π), a jump of the torque at half a turn. By energies, ω² + k θ²/I is one number between jumps, and at
    // a jump the spring's energy is the same on either side, so that it is one number for good.
    let (inertia, stiffness, rate) = (2.0, 0.5, 3.0);
    let ensemble =
        Ensemble::from_columns(&[DVec3::splat(inertia)], &[DQuat::IDENTITY], &[DVec3::Z * rate]).expect("valid");
    let torques = [Torque::log_spring(stiffness, DQuat::IDENTITY)];
    let (frames, batch) = prepare_with(&ensemble, &torques, 20.0, Precision::F64).expect("prepared");
    let (words, counts) = ended(&Engine::cpu(), batch, Method::Taylor, 1e-12, &[20.0]);
    let state = frames[0].body_state(words.combined(0));
    let angle = 2.0 * state.orientation.z.abs().atan2(state.orientation.w.abs());
    let energy = inertia * state.angular_velocity_body.z.powi(2) + stiffness * angle * angle;
    let error = energy / (inertia * rate * rate) - 1.0;
    println!("energy {error:.1e} in {:?}", counts[0]);
    assert!(error.abs() < 1e-9 && counts[0].accepted < 400, "{error:e}, {counts:?}");
}

#[test]
fn a_body_that_would_need_a_step_below_the_limit_is_flagged() {
    let batch = batch_under(BODIES, SEED, &every_torque(&middle_moments(BODIES, SEED))[..4], Precision::F64);
    let least = AdaptiveSteps { tolerance: 1e-12, least_step: Some(10.0) };
    let mut session = Engine::cpu().start_taylor(batch, least).expect("started");
    session.advance_to(End::at(END), &mut unobserved).expect("advanced");
    let words = session.read(0..BODIES).expect("read");
    assert!(words.status.iter().all(|status| *status == Status::StepBelowLimit));
    let norm = |body: usize| DQuat::from_slice(&words.combined(body)[..4]).length();
    assert!((0..BODIES).all(|body| (norm(body) - 1.0).abs() < 1e-14));
}

#[test]
fn what_it_cannot_do_is_refused() {
    let refused = |batch: AnyBatch| Engine::cpu().start_taylor(batch, steps(1e-4)).err().expect("refused").to_string();
    insta::assert_snapshot!(refused(batch_under(3, SEED, &[], Precision::F32)), @r#"taylor: its series are formed in f64: use precision "f64", or method "rk8""#);
    let moving = Parameters::new();
    let torque = Torque::custom("vec(kepler_sin(time, 0.1 + 0.01 * sin(time)), 0, 0)", moving).expect("a formula");
    insta::assert_snapshot!(refused(batch_under(3, SEED, &[torque], Precision::F64)), @"taylor: a torque has no Taylor series: Kepler's equation has a series here for an eccentricity that is constant in time only");
    let ensemble = common::asymmetric_ensemble(3, SEED);
    let pinned = Scene::new(ensemble.clone()).until(1.0).pinned(Method::Taylor, 0.1, None);
    let refusal = Plan::new(&pinned, &Engine::cpu()).expect_err("refused");
    insta::assert_snapshot!(refusal.to_string(), @"taylor: its steps are adaptive: use a tolerance instead of dt");
    let narrow = Scene::new(ensemble).until(1.0).taylor(steps(1e-4)).precision(Some(Precision::F32));
    assert!(matches!(Plan::new(&narrow, &Engine::cpu()), Err(Error::MethodUnavailable { .. })));
    let noise = Torque::white_noise(0.1, 1);
    let batch = batch_under(3, SEED, &[noise], Precision::F64);
    assert!(matches!(Engine::cpu().start_taylor(batch, steps(1e-9)).err(), Some(Error::Torque { .. })));
}

#[test]
fn a_plan_says_who_steps() {
    let scene = Scene::new(common::asymmetric_ensemble(5, SEED)).until(END).torque(Torque::linear_drag(0.01));
    let scene = scene.taylor(steps(1e-11));
    let engine = Engine::cpu();
    let plan = Plan::new(&scene, &engine).expect("planned");
    assert_eq!((plan.method(), plan.parts()[0].method), (Method::Taylor, "taylor"));
    let record = engine.run(&plan).expect("ran");
    let work = record.trust().adaptive.expect("bodies took adaptive steps");
    assert!(work.accepted.total >= 5 && work.rejected.total == 0 && work.flagged == 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// A free or driven body comes back where it started when it is turned round: ω → −ω under torques of the attitude alone.
    #[test]
    fn a_motion_is_reversible(seed in 0_u64..1000, end in 0.5_f64..4.0, is_driven: bool) {
        let torques = if is_driven { vec![Torque::heavy_top(0.3, DVec3::new(0.1, 0.2, 0.3), DVec3::NEG_Z)] } else { vec![] };
        let start = Ensemble::from_fn(5, |body| {
            let x = (seed as f64 * 0.37 + body as f64).sin();
            (DVec3::new(1.0, 1.4, 1.9), DQuat::from_rotation_x(x), DVec3::new(1.0 + x, 0.3, -0.8 * x))
        }).expect("valid");
        let run = |ensemble: &Ensemble| {
            let (frames, batch) = prepare_with(ensemble, &torques, end, Precision::F64).expect("prepared");
            let (words, _) = ended(&Engine::cpu(), batch, Method::Taylor, 1e-13, &[end]);
            let states = (0..5).map(|body| frames[body].body_state(words.combined(body)));
            states.map(|state| (state.orientation, state.angular_velocity_body)).collect::<Vec<_>>()
        };
        let there = run(&start);
        let turned = Ensemble::from_fn(5, |body| (DVec3::new(1.0, 1.4, 1.9), there[body].0, -there[body].1)).expect("valid");
        for (body, (q, omega)) in run(&turned).into_iter().enumerate() {
            prop_assert!(attitude_error(q, start.orientation()[body]) < 1e-11);
            prop_assert!((omega + start.angular_velocity_body()[body]).length() < 1e-11);
        }
    }

    /// Output times on the way change the steps, not the motion.
    #[test]
    fn cuts_of_the_span_change_nothing(first in 0.01_f64..0.99, second in 0.01_f64..0.99, scene in 0_usize..24) {
        let scenes = scenes();
        let (name, torques) = &scenes[scene % scenes.len()];
        let mut times = [first * END, second * END, END];
        times.sort_by(f64::total_cmp);
        let batch = || batch_under(BODIES, SEED, torques, Precision::F64);
        let cut = ended(&Engine::cpu(), batch(), Method::Taylor, 1e-12, &times).0;
        let whole = ended(&Engine::cpu(), batch(), Method::Taylor, 1e-12, &[END]).0;
        let difference = difference(&cut, &whole);
        // Either is within some hundred tolerances of the truth, as above.
        prop_assert!(difference < 3e-10, "{name}: {difference:e}");
    }
}
