//! Tiles, in which driven bodies are stepped in lanes, against the scalar twin and against themselves: a torque alone and among
//! others, a body alone and among others.

use crate::common;

use common::compare::{compare_states, first_bit_difference};
use common::measured::{SEEDS, stays_within_measured};
use common::torques::{batch_under, every_torque, middle_moments};
use glam::DVec3;
use polhode::Method;
use polhode::bodies::columns::StateWords;
use polhode::engine::StepCounts;
use polhode::engine::{Backend, End, Engine, unobserved};
use polhode::kernel::torque_kernel::VelocityDependence;
use polhode::math::Precision;
use polhode::scene::AdaptiveSteps;
use polhode::torque::Parameters;
use polhode::torque::Torque;
use polhode::torque::variable_inertia::{InertiaChange, Law};

/// Fills no lane group of any width, and more than one tile.
const BODIES: usize = 67;
/// Parts of a lane group, a tile and several with rest.
const COUNTS: [usize; 6] = [1, 2, 7, 16, 33, BODIES];
const SEED: u64 = 31;
const STEPS: u64 = 50;
const DT: f64 = 0.02;
/// s.
const END: f64 = DT * STEPS as f64;
const METHODS: [Method; 3] = [Method::Rk4, Method::Rk8, Method::Cf4];
const TOLERANCE: f64 = 1e-6;

/// The torques as they are, and with a second kind that does nothing: one kind alone has slopes of its own.
fn both(torque: &Torque) -> [Vec<Torque>; 2] {
    let nothing = match torque.name() {
        "constant-world" => Torque::heavy_top(0.0, DVec3::ZERO, DVec3::ZERO),
        _ => Torque::constant_world(DVec3::ZERO),
    };
    [vec![torque.clone()], vec![torque.clone(), nothing]]
}

fn column(bodies: usize, first: f64, last: f64) -> Vec<f64> {
    (0..bodies).map(|body| first + (last - first) * body as f64 / bodies as f64).collect()
}

/// Moments that change, for all bodies alike and for each in its own way.
fn changes(bodies: usize) -> [Torque; 4] {
    let column = |first, last| column(bodies, first, last);
    let [ramp, own_ramp, oscillation] = [
        (InertiaChange::factor(0.6), Law::ramp(0.1, 0.5)),
        (InertiaChange::factor(column(0.5, 2.0)), Law::ramp(column(0.0, 0.6), column(0.2, 1.0))),
        (InertiaChange::factor(column(0.5, 2.0)), Law::oscillation(column(-3.0, 3.0))),
    ]
    .map(|(change, law)| Torque::variable_inertia(change, law));
    let parameters = Parameters::new().number("w", column(-3.0, 3.0)).and_then(|of| of.number("a", column(0.1, 0.6)));
    let text = "1 + a * sin(w * time) * time / (1 + time)";
    let formula = Torque::custom_inertia_factor(text, parameters.expect("names")).expect("a formula");
    [ramp, own_ramp, oscillation, formula]
}

/// Every torque alone, and all of them with and without moments that change.
fn scenes(bodies: usize) -> Vec<(String, Vec<Torque>)> {
    let all = every_torque(&middle_moments(bodies, SEED));
    let mut scenes: Vec<(String, Vec<Torque>)> =
        all.iter().chain(&changes(bodies)).map(|torque| (torque.name().to_owned(), vec![torque.clone()])).collect();
    scenes.push(("all".to_owned(), all.clone()));
    scenes.extend(changes(bodies).map(|change| ("all and moments".to_owned(), [all.clone(), vec![change]].concat())));
    scenes
}

fn stepped(engine: &Engine, count: usize, torques: &[Torque], method: Method, precision: Precision) -> StateWords {
    let batch = batch_under(count, SEED, torques, precision);
    common::advanced(engine, &batch, method, DT, STEPS)
}

fn adapted(engine: &Engine, count: usize, torques: &[Torque], precision: Precision, end: f64) -> StateWords {
    adapted_and_counted(engine, count, torques, precision, end).0
}

/// With the most attempts that a body has made.
fn adapted_and_counted(
    engine: &Engine,
    count: usize,
    torques: &[Torque],
    precision: Precision,
    end: f64,
) -> (StateWords, u64) {
    let batch = batch_under(count, SEED, torques, precision);
    let steps = AdaptiveSteps { tolerance: TOLERANCE, least_step: None };
    let mut session = engine.start_adaptive(batch, steps).expect("started");
    session.advance_to(End::at(end), &mut unobserved).expect("advanced");
    let attempts = session.counts().expect("counted").iter().map(StepCounts::attempts).max().unwrap_or(0);
    (session.read(0..count).expect("read"), attempts)
}

/// By a method, or in adaptive steps.
fn moved(method: Option<Method>, count: usize, torques: &[Torque], precision: Precision) -> StateWords {
    match method {
        Some(method) => stepped(&Engine::cpu(), count, torques, method, precision),
        None => adapted(&Engine::cpu(), count, torques, precision, END),
    }
}

/// How the torque of a model depends on the angular velocity, by its equation.
fn dependence(name: &str) -> VelocityDependence {
    match name {
        "linear-drag" => VelocityDependence::LinearDrag,
        "matrix-drag" | "quadratic-drag" | "eddy-current" | "orbiting-eddy-current" | "custom" => {
            VelocityDependence::General
        }
        // What noise, slip and moments that change do is no torque at a frozen attitude.
        _ => VelocityDependence::None,
    }
}

#[test]
fn the_dependence_on_the_angular_velocity_is_that_of_the_formulas() {
    let of = |torques: &[Torque]| batch_under(3, SEED, torques, Precision::F64).torques().velocity_dependence();
    let every = [every_torque(&middle_moments(3, SEED)), changes(3).to_vec()].concat();
    let still = Torque::constant_world(DVec3::X);
    for torque in &every {
        let expected = dependence(torque.name());
        assert_eq!(of(std::slice::from_ref(torque)), expected, "{}", torque.name());
        assert_eq!(of(&[still.clone(), torque.clone()]), expected, "{} and another", torque.name());
        let beside_drag = [Torque::linear_drag(0.1), torque.clone()];
        let expected = if expected == VelocityDependence::None { VelocityDependence::LinearDrag } else { expected };
        assert_eq!(of(&beside_drag), expected, "{} and drag", torque.name());
    }
    assert_eq!(of(&[]), VelocityDependence::None);
}

#[test]
fn one_kind_alone_is_stepped_as_among_others() {
    let torques = [every_torque(&middle_moments(BODIES, SEED)), changes(BODIES).to_vec()].concat();
    // A constant torque and drag have a kernel that takes both, whose kicks are others.
    let is_common = |torque: &&Torque| ["constant-body", "linear-drag"].contains(&torque.name());
    for torque in torques.iter().filter(|torque| !is_common(torque)) {
        for precision in Precision::ALL {
            let [alone, among] = both(torque);
            for method in METHODS.map(Some).into_iter().chain([None]) {
                if method.is_none() && torque.is_random() {
                    continue;
                }
                let difference = first_bit_difference(
                    &moved(method, BODIES, &alone, precision),
                    &moved(method, BODIES, &among, precision),
                );
                assert_eq!(difference, None, "{} by {method:?} in {precision}", torque.name());
            }
        }
    }
}

/// Lanes fuse products and sums where the processor can, the twin does not: roundings of each step's increment, of which a
/// torque adds as many as the motion itself has (tests/mirror/torque_parity.rs).
fn bound(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 2.0 * STEPS as f64,
        Precision::F64 => 12.0 * STEPS as f64,
    }
}

fn compared(expected: &StateWords, found: &StateWords, precision: Precision, bound: f64) -> Result<f64, String> {
    match precision {
        Precision::F32 => compare_states::<f32>(expected, found, bound),
        Precision::F64 => compare_states::<f64>(expected, found, bound),
    }
    .map_err(|mismatch| mismatch.to_string())
}

/// The largest parts of these bounds over 100 draws of a body under each scene's torques, in `f32` and in `f64`: of equal steps and of adaptive
/// ones (the command of [`largest_parts_over_many_draws`]).
const MEASURED: [f64; 2] = [0.0775, 0.0725];
const MEASURED_ADAPTIVE: [f64; 2] = [0.446, 0.859];

/// The largest part of its bound that a tile's state of so many bodies came to, in equal steps of any method.
fn largest_part(bodies: usize, precision: Precision) -> f64 {
    let engines = [Engine::cpu_scalar(), Engine::cpu()];
    let mut largest = 0.0_f64;
    for (name, torques) in scenes(bodies) {
        for method in METHODS {
            let [scalar, lanes] = engines.each_ref().map(|engine| stepped(engine, bodies, &torques, method, precision));
            match compared(&scalar, &lanes, precision, bound(precision)) {
                Ok(ulps) => largest = largest.max(ulps / bound(precision)),
                Err(mismatch) => panic!("{name} by {method} in {precision}: {mismatch}"),
            }
        }
    }
    largest
}

/// The same in adaptive steps.
fn largest_part_in_adaptive_steps(bodies: usize, precision: Precision) -> f64 {
    let engines = [Engine::cpu_scalar(), Engine::cpu()];
    // The torque of the logarithmic spring jumps at half a turn, where steps of any engine are as good as their luck: it pulls
    // each body to where it starts, and none turns so far in half a second.
    let own_target: Vec<_> = common::asymmetric_ensemble(bodies, SEED).orientation().to_vec();
    let stiffness: Vec<f64> = middle_moments(bodies, SEED).iter().map(|moment| 0.2 * moment).collect();
    let smooth = |torque: &Torque| match torque.name() {
        "log-spring" => Torque::log_spring(stiffness.clone(), own_target.clone()),
        _ => torque.clone(),
    };
    // In f32 roundings are a good part of the error that is estimated, so that steps are others, and each side is off by up to √7 of the
    // tolerance a step. In f64 they change steps by a part in 1e9.
    let bound = |attempts: u64| match precision {
        Precision::F32 => {
            bound(precision) + 2.0 * 7.0_f64.sqrt() * TOLERANCE * attempts as f64 / f64::from(f32::EPSILON)
        }
        Precision::F64 => bound(precision),
    };
    let mut largest = 0.0_f64;
    for (name, torques) in scenes(bodies) {
        let torques: Vec<Torque> = torques.iter().filter(|torque| !torque.is_random()).map(smooth).collect();
        let end = if torques.iter().any(|torque| torque.name() == "log-spring") { 0.5 * END } else { END };
        let [(scalar, attempts), (lanes, _)] =
            engines.each_ref().map(|engine| adapted_and_counted(engine, bodies, &torques, precision, end));
        let bound = bound(attempts);
        match compared(&scalar, &lanes, precision, bound) {
            Ok(ulps) => largest = largest.max(ulps / bound),
            Err(mismatch) => panic!("{name} in {precision}: {mismatch}"),
        }
    }
    largest
}

#[test]
fn tiles_agree_with_the_scalar_twin() {
    for (precision, measured) in Precision::ALL.into_iter().zip(MEASURED) {
        stays_within_measured(&Engine::cpu(), precision, "tiles", largest_part(BODIES, precision), measured);
    }
}

#[test]
fn tiles_in_adaptive_steps_agree_with_the_scalar_twin() {
    for (precision, measured) in Precision::ALL.into_iter().zip(MEASURED_ADAPTIVE) {
        let largest = largest_part_in_adaptive_steps(BODIES, precision);
        stays_within_measured(&Engine::cpu(), precision, "tiles in adaptive steps", largest, measured);
    }
}

#[test]
#[ignore = "prints what was measured: cargo test --test formulas kinds::largest -- --ignored --nocapture"]
fn largest_parts_over_many_draws() {
    for precision in Precision::ALL {
        let [equal, adaptive] = [largest_part, largest_part_in_adaptive_steps].map(|of| of(SEEDS as usize, precision));
        println!("{precision}: {equal:.4}, adaptive {adaptive:.4}");
    }
}

#[test]
fn a_body_is_stepped_alone_as_among_others() {
    // Bodies have the same parameters in ensembles of every size: a column may be longer.
    for (name, torques) in scenes(BODIES) {
        let is_random = torques.iter().any(Torque::is_random);
        for precision in Precision::ALL {
            for method in METHODS.map(Some).into_iter().chain([None]) {
                if method.is_none() && is_random {
                    continue;
                }
                let run = |count| moved(method, count, &torques, precision);
                let whole = run(BODIES);
                for count in COUNTS {
                    let part = run(count);
                    let expected = whole.part(0..count);
                    let difference = first_bit_difference(&expected, &part);
                    assert_eq!(difference, None, "{name} by {method:?} in {precision}, {count} bodies of {BODIES}");
                }
            }
        }
    }
}
