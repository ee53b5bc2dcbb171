//! How far apart attempts of adaptive steps are, as a part of their derived bounds: bounds hold in the worst case, and beyond four times
//! what was measured something has changed.

use glam::DVec3;
use polhode::Method;
use polhode::engine::Engine;
use polhode::engine::EngineKind;
use polhode::math::Precision;
use polhode::scene::{AdaptiveSteps, Scene};
use polhode::torque::Torque;
use polhode::verify::{Comparison, Field, Report, verify};

use super::common::measured::stays_within_measured;
use super::{SEED, common, smooth, steps};
use common::torques::{each_torque_alone, every_torque, middle_moments};

/// Draws of a body in the suite, and those behind what was measured: ensembles of other numbers have other draws.
const SUITE_DRAWS: usize = 37;
const DRAWS: [usize; 5] = [SUITE_DRAWS, 50, 67, 83, 100];
const ATTEMPTS: u64 = 20;

const FIELDS: [Field; 4] = [Field::NextStep, Field::Orientation, Field::Norm, Field::AngularMomentum];

/// What is measured: a method, its arithmetic, and the tolerance of its steps.
type Case = (Method, Precision, f64);

/// The largest part of its bound that a difference came to in each of [`FIELDS`], over [`DRAWS`] bodies with a torque each, on lanes and, of
/// `rk8`, on lavapipe (the command of [`largest_parts_of_attempts`]). Where an attempt errs by less than `f32` rounds, the next step hangs on
/// rounding alone, up to the longest that a controller asks for; that of a series is not said ahead.
const MEASURED: [(Case, [f64; 4]); 5] = [
    ((Method::Rk8, Precision::F32, 1e-4), [1.0, 1.67e-2, 3.89e-2, 4.06e-3]),
    ((Method::Rk8, Precision::F64, 1e-6), [1.67e-1, 1.01e-1, 4.99e-2, 4.58e-2]),
    ((Method::Rk8, Precision::F64, 1e-10), [1.67e-1, 1.15e-1, 6.57e-2, 5.28e-2]),
    ((Method::Taylor, Precision::F64, 1e-8), [0.0, 2.61e-1, 5.90e-2, 7.25e-2]),
    ((Method::Taylor, Precision::F64, 1e-13), [0.0, 2.91e-1, 2.28e-2, 5.20e-2]),
];

fn scene((method, precision, tolerance): Case, bodies: usize) -> Scene {
    let scale = middle_moments(bodies, SEED);
    let kinds = smooth(every_torque(&scale)).len();
    // Series have no spring whose pull grows as the logarithm.
    let has_series = |name: &str| method != Method::Taylor || name != "log-spring";
    let torques = smooth(each_torque_alone(&scale, kinds)).into_iter().filter(|torque| has_series(torque.name()));
    let scene = Scene::new(common::asymmetric_ensemble(bodies, SEED)).until(1.0).skipping(false);
    let scene = torques.fold(scene, Scene::torque);
    let asked = AdaptiveSteps { tolerance, least_step: None };
    if method == Method::Taylor { scene.taylor(asked) } else { scene.adaptive(asked, Some(precision)) }
}

/// The largest part of its bound in each field.
fn parts(report: &Report) -> [f64; 4] {
    let seen = report.groups.iter().flat_map(|group| &group.comparisons).filter(|side| side.judged);
    let largest: Vec<_> = seen.flat_map(|side| &side.largest).collect();
    FIELDS.map(|field| {
        let of_field = largest.iter().filter(|largest| largest.field == field).filter_map(|largest| largest.of_bound);
        of_field.fold(0.0, f64::max)
    })
}

fn attempted(engine: &Engine, case: Case, bodies: usize) -> Report {
    let report =
        verify(engine, &scene(case, bodies), &steps(ATTEMPTS)).unwrap_or_else(|error| panic!("{case:?}: {error}"));
    assert!(report.agrees(), "{case:?}: {report}");
    assert!(report.compared() as usize > bodies, "{case:?}: {report}");
    report
}

/// Series are formed on the CPU alone. Adapters that round otherwise than those that were measured have the derived bounds alone.
fn is_measured(engine: &Engine, (method, precision, _): Case) -> bool {
    engine.description().kind == EngineKind::Cpu
        || method != Method::Taylor && common::rounds_like_scalar_twin(engine, precision)
}

fn stays_within_what_was_measured(engine: &Engine) {
    for (case, measured) in MEASURED.into_iter().filter(|(case, _)| is_measured(engine, *case)) {
        let report = attempted(engine, case, SUITE_DRAWS);
        for ((part, measured), field) in parts(&report).into_iter().zip(measured).zip(FIELDS) {
            stays_within_measured(engine, case.1, &format!("{case:?}, {}", field.name()), part, measured);
        }
    }
}

#[test]
fn attempts_in_lanes_stay_within_what_was_measured() {
    stays_within_what_was_measured(&Engine::cpu());
}

#[test]
fn attempts_on_a_gpu_stay_within_what_was_measured() {
    stays_within_what_was_measured(&common::gpu());
}

/// One of these bodies has a short first step, which may be off by some roundings of its own, and a rest that was rounded to one word.
#[test]
fn a_rest_that_was_rounded_on_both_sides_is_no_parting() {
    let scene = scene((Method::Rk8, Precision::F64, 1e-10), 400);
    let report = verify(&Engine::cpu(), &scene, &steps(2)).expect("verified");
    assert!(report.agrees() && report.compared() > 400, "{report}");
}

/// Some steps start where a facet turns into the wind or out of it: the number that decides vanishes there to rounding, whose sign makes one
/// side end its step at once, where the other goes on. Which steps these are hangs on rounding, so there are many bodies.
#[test]
fn a_step_that_one_side_ends_at_once_is_not_decided() {
    const BODIES: usize = 1600;
    for tolerance in [3e-3, 1e-4] {
        let scene = scene((Method::Taylor, Precision::F64, tolerance), BODIES);
        let report = verify(&Engine::cpu(), &scene, &steps(ATTEMPTS)).expect("both sides run");
        assert!(report.agrees(), "{report}");
        let judged = || report.groups.iter().flat_map(|group| &group.comparisons).filter(|side| side.judged);
        for Comparison { undecided, decided, .. } in judged() {
            // Some of thousands of steps.
            assert!((1..=20).contains(undecided), "{undecided} of {decided}: {report}");
            assert!(*decided > 3 * BODIES as u64, "{decided}");
        }
    }
}

/// Under stiff damping the last coefficients of series are small differences of large numbers, and steps as far apart as rounding makes them.
#[test]
fn series_under_stiff_damping_agree() {
    const BODIES: usize = 200;
    // Logarithmically from weak to stiff, N m s/T².
    let coefficients: Vec<f64> = (0..BODIES).map(|body| 0.01 * 1e3_f64.powf(body as f64 / BODIES as f64)).collect();
    let scene = Scene::new(common::asymmetric_ensemble(BODIES, SEED))
        .until(30.0)
        .torque(Torque::eddy_current(coefficients, DVec3::new(1.0, 0.2, 0.0)))
        .taylor(AdaptiveSteps { tolerance: 1e-9, least_step: None });
    let report = verify(&Engine::cpu(), &scene, &steps(40)).expect("both sides run");
    assert!(report.agrees(), "{report}");
    let judged = report.groups.iter().flat_map(|group| &group.comparisons).filter(|side| side.judged);
    let lefts = judged.flat_map(|side| &side.largest).filter(|largest| largest.field == Field::Left);
    let [apart, of_bound] = lefts
        .fold([0.0_f64; 2], |[apart, part], left| [apart.max(left.difference), part.max(left.of_bound.unwrap_or(0.0))]);
    println!("steps are {apart:e} apart at most, {of_bound} of their bound");
    // Steps here are about a unit long: a millionth of one is what others are allowed.
    assert!(apart > 2e-6, "{apart:e}: no case of it");
}

#[test]
#[ignore = "prints what `MEASURED` holds: cargo test --test mirror verify::attempts::largest_parts -- --ignored --nocapture"]
fn largest_parts_of_attempts() {
    let engines = [Engine::cpu(), common::gpu()];
    for (case, _) in MEASURED {
        let of = |engine| DRAWS.map(|bodies| parts(&attempted(engine, case, bodies)));
        let engines = engines.iter().filter(|engine| is_measured(engine, case));
        let largest =
            engines.flat_map(of).fold([0.0; 4], |a, b| std::array::from_fn(|field| f64::max(a[field], b[field])));
        let largest = largest.map(|part| format!("{part:.2e}")).join(", ");
        println!("({case:?}, [{largest}]),");
    }
}
