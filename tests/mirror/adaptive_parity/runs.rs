//! Whole runs in adaptive steps: against the twin, cut into chunks and slices, and what is refused.

use std::time::Duration;

use glam::{DQuat, DVec3};
use polhode::bodies::columns::StateWords;
use polhode::engine::StepCounts;
use polhode::engine::batch::prepare_with;
use polhode::engine::gpu::{GpuOptions, wgpu};
use polhode::engine::{Backend, End, Engine, unobserved};
use polhode::math::Precision;
use polhode::scene::AdaptiveSteps;
use polhode::{Ensemble, Error, Outputs, Plan, Scene, Torque};

use super::common::compare::first_bit_difference;
use super::common::kernel::open_device;
use super::common::measured::{over_seeds, stays_within_measured};
use super::common::torques::{every_torque, middle_moments};
use super::common::{self, asymmetric_ensemble};
use super::{INCREMENT_ULPS, STATE_ULPS};

pub const SEED: u64 = 5;
const SPAN: f64 = 6.0;
/// Bodies: five workgroups and a part of one.
const COUNT: usize = 64 * 5 + 7;

/// No torque; every kind that has a meaning between equal steps, but the logarithmic spring's, which jumps at half a turn: a
/// body next to it goes to one side or the other by rounding.
fn torque_sets(seed: u64) -> [Vec<Torque>; 2] {
    let mut all = every_torque(&middle_moments(COUNT, seed));
    all.retain(|torque| !torque.is_random() && torque.name() != "log-spring");
    [Vec::new(), all]
}

/// States and counts of the bodies of [`SEED`] after [`SPAN`], by way of another time.
fn advanced(
    engine: &Engine,
    torques: &[Torque],
    precision: Precision,
    tolerance: f64,
) -> (StateWords, Vec<StepCounts>) {
    advanced_from(&asymmetric_ensemble(COUNT, SEED), engine, torques, precision, tolerance)
}

/// The same of other bodies.
fn advanced_from(
    ensemble: &Ensemble,
    engine: &Engine,
    torques: &[Torque],
    precision: Precision,
    tolerance: f64,
) -> (StateWords, Vec<StepCounts>) {
    let (_, batch) = prepare_with(ensemble, torques, SPAN, precision).expect("enough memory");
    let steps = AdaptiveSteps { tolerance, least_step: None };
    let mut session = engine.start_adaptive(batch, steps).expect("started");
    for time in [1.1, SPAN] {
        session.advance_to(End::at(time), &mut unobserved).expect("advanced");
    }
    (session.read(0..COUNT).expect("read"), session.counts().expect("counted"))
}

/// Roundings of an attempt in f64, in ulps: of free bodies that turn by up to 5/2 rad in it.
const FREE_ULPS: f64 = STATE_ULPS[0] + 2.5 * INCREMENT_ULPS;
/// A torque adds its own, 16 ulps in `torque_parity.rs`, and that of its sum with the others to the increments, weighted as the slopes are;
/// all torques together are about as large as the slope.
const TORQUE_ULPS: f64 = 17.0 * 13.0;

/// By how much a difference grows until the end, for each body: what becomes of another start, a part of 1e-9 away.
fn growth(ensemble: &Ensemble, torques: &[Torque], tolerance: f64) -> Vec<f64> {
    const PART: f64 = 1e-9;
    let (twin, precision) = (Engine::cpu_scalar(), Precision::F64);
    let faster: Vec<DVec3> = ensemble.angular_velocity_body().iter().map(|omega| *omega * (1.0 + PART)).collect();
    let other = Ensemble::from_columns(ensemble.inertia(), ensemble.orientation(), &faster).expect("valid bodies");
    let (before, _) = advanced_from(ensemble, &twin, torques, precision, tolerance);
    let (after, _) = advanced_from(&other, &twin, torques, precision, tolerance);
    let of_body = |body: usize| {
        let differences = before.combined(body).into_iter().zip(after.combined(body)).map(|(a, b)| (a - b).abs());
        (differences.fold(0.0, f64::max) / PART).max(1.0)
    };
    (0..COUNT).map(of_body).collect()
}

/// In `f32`, rounding of torques is a part of the estimate, so that decisions fall either way, a body may take half as many
/// steps again, and both are right to the tolerance only: steps are off by up to
/// √7 of it in seven components ([`polhode::kernel::method::rk8_adaptive`]).
fn bound(precision: Precision, torques: usize, tolerance: f64) -> f64 {
    match precision {
        Precision::F32 => 2.0 * 7.0_f64.sqrt() * tolerance,
        Precision::F64 => f64::EPSILON * (FREE_ULPS + if torques > 0 { TORQUE_ULPS } else { 0.0 }),
    }
}

/// Precisions and tolerances of whole runs, and the largest parts of their bounds over 100 draws of all bodies on lavapipe: without torques and
/// under all of them.
const RUNS: [(Precision, f64, [f64; 2]); 3] = [
    (Precision::F64, 1e-6, [0.114, 0.633]),
    (Precision::F64, 1e-11, [4.22e-3, 1.19e-2]),
    (Precision::F32, 1e-5, [0.0, 0.268]),
];

/// The largest part of its bound that a whole run of the bodies of a seed comes to.
fn compared_run(gpu: &Engine, torques: &[Torque], (precision, tolerance): (Precision, f64), seed: u64) -> f64 {
    let ensemble = asymmetric_ensemble(COUNT, seed);
    let twin = common::twin(gpu, precision);
    let (expected, expected_counts) = advanced_from(&ensemble, &twin, torques, precision, tolerance);
    let (found, counts) = advanced_from(&ensemble, gpu, torques, precision, tolerance);
    let what = format!("{} torques, {precision} at {tolerance:e}, seed {seed}", torques.len());
    let growth = growth(&ensemble, torques, tolerance);
    let (mut of_bound, mut other) = (0.0_f64, 0);
    for body in 0..COUNT {
        let attempts = expected_counts[body].attempts() as f64;
        let bound = bound(precision, torques.len(), tolerance) * attempts * growth[body];
        let (expected, found) = (expected.combined(body), found.combined(body));
        for (component, (expected, found)) in expected.iter().zip(found).enumerate() {
            let difference = (expected - found).abs();
            assert!(difference <= bound, "{what}: body {body}, component {component}: {difference:e} of {bound:e}");
            of_bound = of_bound.max(difference / bound);
        }
        other += usize::from(counts[body] != expected_counts[body]);
        // In f32 one body in some thousands takes twice as many steps as the twin's, of other seeds than the suite's.
        let (attempts, expected) = (counts[body].attempts(), expected_counts[body].attempts());
        assert!(
            seed != SEED || 2 * attempts.abs_diff(expected) <= expected,
            "{what}: body {body}: {attempts}, {expected}"
        );
    }
    let total = |counts: &[StepCounts]| counts.iter().map(StepCounts::attempts).sum::<u64>();
    let (found, expected) = (total(&counts), total(&expected_counts));
    assert!(found.abs_diff(expected) <= expected / 50, "{what}: {found} attempts, {expected} expected");
    // In f64 no decision of these bodies is within rounding, nor in f32 without torques, where no sine is formed and roots are rounded
    // as the twin's are.
    let same_roots = common::rounds_like_scalar_twin(gpu, precision) && torques.is_empty();
    if seed == SEED && (precision == Precision::F64 || same_roots) {
        assert_eq!(other, 0, "{what}");
    }
    of_bound
}

#[test]
fn whole_runs_agree_with_the_twin() {
    let gpu = common::gpu();
    for (set, torques) in torque_sets(SEED).iter().enumerate() {
        for (precision, tolerance, measured) in RUNS {
            let largest = compared_run(&gpu, torques, (precision, tolerance), SEED);
            let what = format!("{} torques at {tolerance:e}", torques.len());
            stays_within_measured(&gpu, precision, &what, largest, measured[set]);
        }
    }
}

#[test]
#[ignore = "prints what `RUNS` holds, some minutes: cargo test --test mirror adaptive_parity::runs::largest -- --ignored --nocapture"]
fn largest_parts_over_many_seeds() {
    let gpu = common::gpu();
    for (precision, tolerance, _) in RUNS {
        let of_set =
            |set: usize| over_seeds(|seed| compared_run(&gpu, &torque_sets(seed)[set], (precision, tolerance), seed));
        println!("(Precision::{precision:?}, {tolerance:e}, [{:.2e}, {:.2e}])", of_set(0), of_set(1));
    }
}

#[test]
fn results_and_counts_do_not_depend_on_cuts() {
    let whole = common::gpu();
    // Few kinds, as each engine compiles its own kernel; among them one whose phase is formed at each step's own start.
    let moments = middle_moments(COUNT, SEED);
    let sine: Vec<DVec3> = moments.iter().map(|i| DVec3::new(0.3, -0.2, 0.1) * *i).collect();
    let drag: Vec<f64> = moments.iter().map(|i| 0.05 * i).collect();
    let driven = vec![Torque::sinusoidal(sine, DVec3::ZERO, 1.75), Torque::linear_drag(drag)];
    for torques in [Vec::new(), driven] {
        for (precision, tolerance) in [(Precision::F64, 1e-9), (Precision::F32, 1e-5)] {
            let (expected, counts) = advanced(&whole, &torques, precision, tolerance);
            // The last is so short that few bodies are side by side, and others join them as they arrive.
            for (bodies, steps, slice) in [(64, 1, 50_000_000), (192, 7, 50_000_000), (1 << 16, u32::MAX, 10_000)] {
                let mut options = common::cut_options(bodies, steps);
                options.slice.duration = Duration::from_nanos(slice);
                let engine = common::gpu_with(options);
                let (found, own) = advanced(&engine, &torques, precision, tolerance);
                let what =
                    format!("{} torques, {precision}: {bodies} bodies, {steps} attempts, {slice} ns", torques.len());
                if let Some(difference) = first_bit_difference(&expected, &found) {
                    panic!("{what}: {difference}");
                }
                assert_eq!(own, counts, "{what}");
            }
        }
    }
}

#[test]
fn finished_bodies_do_not_hold_their_workgroups() {
    // One body in each workgroup turns a hundred times as fast as the others.
    let fast = |body: usize| if body.is_multiple_of(64) { 100.0 } else { 1.0 };
    let ensemble = Ensemble::from_fn(COUNT, |body| {
        (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::new(1.0, 0.4, 0.1) * fast(body))
    })
    .expect("valid bodies");
    let imbalance = |steps| {
        let engine = common::gpu_with(common::cut_options(1 << 16, steps));
        let (_, batch) = prepare_with(&ensemble, &[], SPAN, Precision::F64).expect("enough memory");
        let steps = AdaptiveSteps { tolerance: 1e-9, least_step: None };
        let mut session = engine.start_adaptive(batch, steps).expect("started");
        session.advance_to(End::at(SPAN), &mut unobserved).expect("advanced");
        let counts = session.counts().expect("counted");
        let attempts: Vec<u64> = counts.iter().map(StepCounts::attempts).collect();
        let held = polhode::engine::load_balance::imbalance(&attempts, session.side_by_side());
        (session.imbalance().expect("measured"), held)
    };
    let (measured, held) = imbalance(8);
    println!("imbalance {measured:.2}, {held:.2} if every workgroup waited for its last body");
    assert!(held > 10.0 && (1.0..3.0).contains(&measured), "{measured}, {held}");
}

#[test]
fn an_adapter_without_f64_takes_adaptive_steps_in_f32() {
    let (device, queue) = open_device(wgpu::Features::empty());
    let narrow = Engine::gpu_on(device, queue, GpuOptions::default()).expect("an engine");
    assert_eq!(narrow.precisions(), [Precision::F32]);
    let steps = |tolerance| AdaptiveSteps { tolerance, least_step: None };
    let ensemble = asymmetric_ensemble(3, SEED);
    let (_, batch) = prepare_with(&ensemble, &[], SPAN, Precision::F64).expect("enough memory");
    assert!(matches!(narrow.start_adaptive(batch, steps(1e-9)), Err(Error::PrecisionUnavailable { .. })));
    let scene = |tolerance| Scene::new(ensemble.clone()).until(SPAN).adaptive(steps(tolerance), None);
    let message = Plan::new(&scene(1e-9), &narrow).expect_err("out of reach").to_string();
    assert!(message.contains("1e-6 or more, or precision f64"), "{message}");
    let scene = scene(1e-5);
    let record = narrow.run(&Plan::new(&scene, &narrow).expect("planned")).expect("run");
    assert_eq!(record.trust().precision, Precision::F32);
    assert!(record.trust().adaptive.expect("adaptive").accepted.total > 0);
}

#[test]
fn what_a_gpu_cannot_hold_is_refused() {
    let engine = common::gpu_with(GpuOptions { memory: Some(1 << 20), ..common::any_adapter() });
    let (_, batch) = prepare_with(&asymmetric_ensemble(3, SEED), &[], SPAN, Precision::F64).expect("enough memory");
    let refusal = engine.start_adaptive(batch, AdaptiveSteps { tolerance: 1e-9, least_step: None }).err();
    assert!(matches!(refusal, Some(Error::TooManyBodies { .. })), "{refusal:?}");
}

#[test]
fn a_run_counts_what_it_reads_back() {
    let engine = common::own_gpu();
    let steps = AdaptiveSteps { tolerance: 1e-9, least_step: None };
    let scene = Scene::new(asymmetric_ensemble(COUNT, SEED))
        .until(SPAN)
        .outputs(Outputs::Times(vec![2.0, SPAN]))
        .adaptive(steps, Some(Precision::F64));
    let record = engine.run(&Plan::new(&scene, &engine).expect("planned")).expect("run");
    let trust = record.trust();
    let work = trust.adaptive.expect("bodies took adaptive steps");
    println!("{work}, {:?}", trust.traffic);
    assert_eq!(work.side_by_side, 64);
    assert!((1.0..2.0).contains(&work.imbalance), "{work}");
    // Two outputs of eight numbers, and counts of four words; lists of bodies stay on the device.
    let asked = (2 * 8 * size_of::<f64>() + 4 * size_of::<u32>()) as u64 * COUNT as u64;
    assert!((asked..=asked + (64 << 10)).contains(&trust.traffic.bytes_read), "{:?}, asked for {asked}", trust.traffic);
    assert!(trust.traffic.dispatches >= 6 && trust.traffic.waits > 0, "{:?}", trust.traffic);
    assert!(trust.recomputed_sample.attitude.max < 1e-6, "{}", trust.recomputed_sample);
}
