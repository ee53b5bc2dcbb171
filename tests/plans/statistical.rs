//! Errors asked for of statistics and event times: steps follow from them, also where no attitude is known, and a run says whether they were met.

use std::f64::consts::LN_2;

use glam::{DQuat, DVec3};
use polhode::plan::StatisticError;
use polhode::record::StatisticalSample;
use polhode::scene::{AdaptiveSteps, Condition, Event, StatisticalAccuracy, StatisticalTarget, Stepping};
use polhode::study::draw::{Column, Draw};
use polhode::torque::{Orbit, Torque};
use polhode::{Accuracy, Engine, Ensemble, Error, Method, Outputs, Plan, Precision, Quantity, Record, Scene};

fn run(scene: &Scene) -> Record {
    let engine = Engine::cpu();
    engine.run(&Plan::new(scene, &engine).unwrap_or_else(|error| panic!("{error}"))).expect("a run")
}

fn sample(record: &Record) -> &StatisticalSample {
    record.trust().statistics.as_ref().expect("errors of statistics were asked for")
}

fn of(errors: &[StatisticError], target: StatisticalTarget) -> &StatisticError {
    errors.iter().find(|error| error.target == target).unwrap_or_else(|| panic!("no {target:?} in {errors:?}"))
}

const BODIES: usize = 500;

/// Two statistics, one of which a thousand terms make costly to follow again.
#[test]
fn statistics_of_costly_runs_are_compared_on_fewer_bodies() {
    let compared = |terms: usize| {
        let sines: Vec<String> =
            (1..=terms).map(|k| format!("sin({k}.5 * angular_velocity.x + {k}.25 * angular_velocity.y)")).collect();
        let text = format!("vec(1e-6 * ({}), 0, 0)", sines.join(" + "));
        let torque = Torque::custom(&text, Default::default()).expect("a formula");
        let body = |body: usize| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::new(1.0, 1e-2 * body as f64, 0.1));
        let scene = Scene::new(Ensemble::from_fn(100, body).expect("bodies")).until(600.0).torque(torque);
        let wanted = StatisticalAccuracy { mean: Some(1e-3), ..StatisticalAccuracy::default() };
        let steps = AdaptiveSteps { tolerance: 1e-6, least_step: None };
        let scene = scene.statistics([Quantity::SpinRate]).statistical_accuracy(wanted).adaptive(steps, None);
        sample(&run(&scene)).bodies
    };
    let [cheap, costly] = [1, 300].map(compared);
    assert!(cheap == 64 && (16..64).contains(&costly), "{cheap}, {costly}");
}

/// Bodies that turn about z at some 1 rad/s, each once or twice below the level between two outputs, unless they are checked more often.
#[test]
fn times_of_events_that_go_unnoticed_are_not_met() {
    let body =
        |body: usize| (DVec3::splat(1.0), DQuat::IDENTITY, DVec3::Z * (1.0 + 1e-3 * body as f64 / BODIES as f64));
    let x = Quantity::formula("x", "1", "to_world(vec(1, 0, 0)).x").expect("a formula");
    let below = Event::new("below", x, Condition::Falls(0.0)).expect("a level");
    let wanted = StatisticalAccuracy { event_time: Some(0.5), ..StatisticalAccuracy::default() };
    let scene = Scene::new(Ensemble::from_fn(BODIES, body).expect("bodies")).until(12.0).outputs(Outputs::Every(6.0));
    let scene = scene.event(below).without_states().statistical_accuracy(wanted);
    let missed = run(&scene);
    let error = of(&sample(&missed).errors, StatisticalTarget::EventTime);
    // Even half of the span as error does not excuse it.
    assert_eq!((sample(&missed).met, error.unnoticed, sample(&missed).bodies), (Some(false), 64, 64), "{error}");
    assert!(error.to_string().contains("MISSED; unnoticed between outputs in 64 bodies of the sample"), "{error}");
    assert_eq!(missed.events()[0].occurrences.len(), 0);
    let found = run(&scene.event_checks(1.0));
    let error = of(&sample(&found).errors, StatisticalTarget::EventTime);
    assert_eq!((sample(&found).met, error.unnoticed), (Some(true), 0), "{error}");
    assert_eq!(found.events()[0].occurrences.len(), BODIES);
}

/// A body that turns by more than 131,072 rad between two outputs is followed no further, so that the time of an event late in between is known
/// to the output only: that is no error of zero.
#[test]
fn times_that_are_known_to_an_output_are_not_met() {
    let body = |body: usize| (DVec3::new(1.0, 1.3, 1.5), DQuat::IDENTITY, DVec3::new(1e3, 0.1 * body as f64, 1e5));
    let late = Event::new("late", Quantity::formula("t", "s", "time").expect("a formula"), Condition::Rises(1.9));
    let wanted = StatisticalAccuracy { event_time: Some(1e-3), ..StatisticalAccuracy::default() };
    let scene = Scene::new(Ensemble::from_fn(4, body).expect("bodies")).until(2.5).outputs(Outputs::Every(2.4));
    let scene = scene.event(late.expect("a level")).without_states().statistical_accuracy(wanted);
    let rough = run(&scene);
    let error = of(&sample(&rough).errors, StatisticalTarget::EventTime);
    assert_eq!((sample(&rough).met, error.integration, error.is_missed()), (None, 0.0, false), "{error}");
    assert!((error.resolution - 2.4 / 2.5).abs() < 1e-9, "{error}");
    assert!(error.to_string().ends_with("not resolved; known to 9.6e-1"), "{error}");
    let found = run(&scene.event_checks(0.2));
    assert_eq!(sample(&found).met, Some(true), "{:?}", sample(&found).errors);
    assert!(found.events()[0].occurrences.iter().all(|occurrence| (occurrence.time - 1.9).abs() < 1e-9));
}

/// An axis that points anywhere at outputs may have pointed at the target in between: where hardly any of that time is searched, nothing is said
/// to be met. A quantity that changes little from output to output hides nothing.
#[test]
fn events_in_times_that_nobody_searched_are_not_met() {
    let body = |body: usize| {
        let spin = Draw::new(5).normal_vector(body, Column::AngularVelocity);
        (DVec3::new(1.0, 1.3, 1.5), DQuat::IDENTITY, spin)
    };
    let pointing = Quantity::axis_angle("pointing", DVec3::Z, DVec3::X).expect("directions");
    let wanted = StatisticalAccuracy { event_time: Some(1e-3), ..StatisticalAccuracy::default() };
    let scene = Scene::new(Ensemble::from_fn(64, body).expect("bodies")).until(20_000.0).outputs(Outputs::Every(500.0));
    let scene = scene.without_states().statistical_accuracy(wanted);
    let met = |quantity: Quantity, condition: Condition| {
        let record = run(&scene.clone().event(Event::new("event", quantity, condition).expect("a level")));
        (sample(&record).met, record.events()[0].errors.searched < 0.1, record.events()[0].errors.unnoticed)
    };
    assert_eq!(met(pointing, Condition::Below(1e-6)), (None, true, 0));
    assert_eq!(met(Quantity::AngularMomentum, Condition::Below(1e-4)), (Some(true), true, 0));
}

/// An axis that passes by its target within a tenth of the time between two checks: where bodies come near it is where the sample is searched first,
/// and where it cannot be searched so finely, nothing is said to be met.
#[test]
fn short_passages_that_a_run_overlooks_are_not_met() {
    let body = |body: usize| {
        let spin = Draw::new(5).normal_vector(body, Column::AngularVelocity);
        (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, spin)
    };
    let pointing = Quantity::axis_angle("pointing", DVec3::Z, DVec3::X).expect("directions");
    let near =
        |degrees: f64| Event::new("near", pointing.clone(), Condition::Below(degrees.to_radians())).expect("a level");
    let wanted = StatisticalAccuracy { event_time: Some(1e-3), ..StatisticalAccuracy::default() };
    let scene = Scene::new(Ensemble::from_fn(400, body).expect("bodies")).until(60.0).outputs(Outputs::Every(1.0));
    let scene = scene.without_states().statistical_accuracy(wanted);
    for degrees in [2.0, 5.0] {
        let scene = scene.clone().event(near(degrees)).event_checks(0.1);
        let record = run(&scene);
        let error = of(&sample(&record).errors, StatisticalTarget::EventTime);
        assert!(error.unnoticed >= 3 && sample(&record).met == Some(false), "{degrees}: {error}");
        let driven = run(&scene.torque(Torque::linear_drag(1e-3)));
        assert_ne!(sample(&driven).met, Some(true), "{degrees}: {:?}", sample(&driven).errors);
    }
}

/// Bodies that an event should have stopped while nobody looked turn on in the run and in the recomputed sample alike: nothing of both says how far
/// off a mean is.
#[test]
fn means_of_bodies_that_may_have_been_stopped_are_not_met() {
    let body = |body: usize| {
        let spin = 0.03 * Draw::new(6).normal_vector(body, Column::AngularVelocity);
        (DVec3::new(300.0, 350.0, 120.0), DQuat::IDENTITY, spin)
    };
    let pointing = Quantity::axis_angle("pointing", DVec3::Z, DVec3::X).expect("directions");
    let level = Condition::Below(30.0_f64.to_radians());
    let caught = Event::new("caught", pointing.clone(), level).expect("a level");
    let wanted = StatisticalAccuracy { mean: Some(1e-3), quantile: Some(1e-3), event_time: None };
    let scene = Scene::new(Ensemble::from_fn(1000, body).expect("bodies")).torque(Torque::linear_drag(0.05));
    let scene = scene.until(1800.0).outputs(Outputs::Every(300.0)).statistics([pointing]).event_checks(8.0);
    let scene = scene.quantiles(&[50.0]).expect("percent").without_states().statistical_accuracy(wanted);
    let rough = sample(&run(&scene.clone().event(caught.clone().stopping()))).clone();
    let noted = sample(&run(&scene.event(caught))).clone();
    for target in [StatisticalTarget::Mean, StatisticalTarget::Quantile] {
        let error = of(&rough.errors, target);
        assert!(!error.is_shown() && error.resolution > 10.0 * error.wanted, "{error}");
        // An event that stops nothing does not change them.
        let error = of(&noted.errors, target);
        assert_eq!(error.resolution, 0.0, "{error}");
    }
    assert_ne!(rough.met, Some(true));
}

/// Of heavy tops a few in a thousand pass so near the unstable equilibrium that they err a thousand times as much as the others: most samples have
/// none of them. The intervals hold what a comparison of all bodies shows.
#[test]
fn rare_great_errors_are_allowed_for_where_the_sample_lacks_them() {
    const TOPS: usize = 2000;
    let mut within = 0;
    for seed in 0..8 {
        let body = |body: usize| {
            let draw = Draw::new(100 + seed);
            let spin = DVec3::Z + 0.5 * draw.normal_vector(body, Column::AngularVelocity);
            (DVec3::new(2.0, 3.0, 4.0), draw.rotation(body, Column::Orientation), spin)
        };
        let pointing = Quantity::axis_angle("pointing", DVec3::Z, DVec3::Z).expect("directions");
        let top = Torque::heavy_top(1.0, 0.2 * DVec3::Z, -9.8 * DVec3::Z);
        let wanted = StatisticalAccuracy { mean: Some(4e-4), ..StatisticalAccuracy::default() };
        let scene = Scene::new(Ensemble::from_fn(TOPS, body).expect("tops")).until(60.0);
        let scene = scene.torque(top).torque(Torque::linear_drag(0.03)).statistics([Quantity::SpinRate, pointing]);
        let steps = AdaptiveSteps { tolerance: 1e-6, least_step: None };
        let scene = scene.without_states().statistical_accuracy(wanted).adaptive(steps, Some(Precision::F64));
        let [of_sample, of_all] = [100, TOPS].map(|count| sample(&run(&scene.clone().recompute(count))).clone());
        let holds = |error: &StatisticError| {
            let same = of_all.errors.iter().find(|other| other.name == error.name).expect("compared too");
            (same.integration - error.integration).abs() <= error.confidence
        };
        within += usize::from(of_sample.errors.iter().all(holds));
    }
    assert!(within >= 7, "{within} of 8");
}

/// The greatest of 16 bodies says little of the 99th percentile of 500: a difference is not shown to be more than chance.
#[test]
fn extreme_quantiles_of_small_samples_show_no_miss() {
    let body = |body: usize| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::new(1.0, 0.01 * body as f64, 0.1));
    let top = Torque::heavy_top(1.0, DVec3::Z, DVec3::NEG_Z);
    let scene = Scene::new(Ensemble::from_fn(BODIES, body).expect("bodies")).until(60.0).torque(top);
    let wanted = StatisticalAccuracy { quantile: Some(1e-9), ..StatisticalAccuracy::default() };
    let scene = scene.statistics([Quantity::SpinRate]).quantiles(&[99.0]).expect("percent");
    let scene = scene.statistical_accuracy(wanted).pinned(Method::Rk4, 0.1, Some(Precision::F64)).recompute(16);
    let record = run(&scene);
    let error = of(&sample(&record).errors, StatisticalTarget::Quantile);
    assert!(sample(&record).met.is_none() && error.integration.abs() > error.wanted, "{error}");
    assert!(error.standard_error >= error.integration.abs(), "{error}");
}

/// Moment over drag coefficient, s: the time in which a sphere's spin falls by e.
const DECAY: f64 = 10.0;
const SPAN: f64 = 30.0;

/// The spins of the spheres at the start, rad/s.
fn spin(body: usize) -> f64 {
    1.0 + body as f64 / BODIES as f64
}

/// Spheres that linear drag slows down. Of their states nothing is kept.
fn slowing() -> Scene {
    let sphere = |body: usize| (DVec3::splat(2.0), DQuat::IDENTITY, DVec3::new(0.6, -0.8, 0.0) * spin(body));
    let half = Event::new("below 0.5 rad/s", Quantity::SpinRate, Condition::Below(0.5)).expect("a level");
    Scene::new(Ensemble::from_fn(BODIES, sphere).expect("spheres"))
        .torque(Torque::linear_drag(2.0 / DECAY))
        .until(SPAN)
        .outputs(Outputs::Every(3.0))
        .statistics([Quantity::SpinRate])
        .quantiles(&[25.0, 50.0])
        .expect("percentages")
        .event(half)
        .without_states()
}

/// The spin decays as e^(-t/DECAY), and passes a level s₀/2 at ln 2 DECAY: every statistic follows in closed form.
#[test]
fn statistics_of_spheres_under_drag_are_as_near_as_asked_for() {
    let spins: Vec<f64> = (0..BODIES).map(spin).collect();
    let mean = spins.iter().sum::<f64>() / BODIES as f64;
    let deviation = (spins.iter().map(|spin| (spin - mean).powi(2)).sum::<f64>() / (BODIES - 1) as f64).sqrt();
    let event_time = spins.iter().map(|spin| DECAY * (spin / 0.5).ln()).sum::<f64>() / BODIES as f64;
    let mut seconds = Vec::new();
    for error in [1e-1, 1e-3, 1e-9] {
        let wanted = StatisticalAccuracy { mean: Some(error), quantile: Some(error), event_time: Some(error) };
        let scene = slowing().statistical_accuracy(wanted);
        let plan = Plan::new(&scene, &Engine::cpu()).expect("a plan");
        println!("{}", plan.explain());
        seconds.push(plan.explain().classes.iter().filter_map(|row| row.seconds).sum::<f64>());
        let record = run(&scene);
        let sample = sample(&record);
        assert!(sample.met == Some(true) && sample.lost + sample.diverged == 0, "{sample:?}");
        for statistics in record.statistics() {
            let decay = (-statistics.time / DECAY).exp();
            let found = (statistics.of(Quantity::SpinRate).expect("asked for").mean - mean * decay).abs();
            assert!(found <= error * deviation * decay, "{error:e}: mean off by {found:e} at {} s", statistics.time);
        }
        let times: f64 = record.events()[0].occurrences.iter().map(|occurrence| occurrence.time).sum();
        let found = (times / BODIES as f64 - event_time).abs();
        assert!(found <= error * SPAN, "{error:e}: mean event time off by {found:e} s");
        // The slowest start at 1 rad/s.
        let first = record.events()[0].occurrences[0];
        assert!(first.body == 0 && (first.time - LN_2 * DECAY).abs() <= error * SPAN, "{first:?}");

        // The number of bodies brings in the spread by the root of that number, of which the sample is a part.
        let of_mean = of(&sample.errors, StatisticalTarget::Mean);
        assert!((of_mean.sampling * (BODIES as f64).sqrt() - 1.0).abs() < 1e-9, "{of_mean:?}");
        assert!((of_mean.scale / (deviation * (-of_mean.time.expect("of a time") / DECAY).exp()) - 1.0).abs() < 0.2);
        let of_time = of(&sample.errors, StatisticalTarget::EventTime);
        assert!(of_time.scale == SPAN && of_time.bound() <= error, "{of_time:?}");
        assert_eq!(sample.errors.iter().filter(|error| error.target == StatisticalTarget::Quantile).count(), 2);
    }
    assert!(seconds.is_sorted() && seconds[0] < seconds[2], "more is paid for smaller errors: {seconds:?}");
}

#[test]
fn what_is_asked_for_where_nothing_is_said() {
    let everything = StatisticalAccuracy { mean: Some(1e-3), quantile: Some(1e-3), event_time: Some(1e-3) };
    assert_eq!(slowing().wanted_statistical_accuracy(), Some(everything));
    assert_eq!(slowing().stepping(), Stepping::Statistics(everything));
    // Of what there is.
    let plain = slowing().unobserved().statistics([Quantity::SpinRate]);
    let means = StatisticalAccuracy { mean: Some(1e-3), ..Default::default() };
    assert_eq!(plain.stepping(), Stepping::Statistics(means));
    // Where states are kept, or something is said, as before.
    let sphere = Ensemble::from_columns(&[DVec3::ONE], &[DQuat::IDENTITY], &[DVec3::X]).expect("a sphere");
    let keeps = Scene::new(sphere).statistics([Quantity::SpinRate]);
    assert_eq!(
        (keeps.stepping(), keeps.wanted_statistical_accuracy()),
        (Stepping::Accuracy(Accuracy::attitude(1e-6)), None)
    );
    let said = slowing().accuracy(Accuracy::attitude(1e-4));
    assert_eq!(
        (said.stepping(), said.wanted_statistical_accuracy()),
        (Stepping::Accuracy(Accuracy::attitude(1e-4)), None)
    );
    let record = run(&slowing().pinned(Method::Rk8, 0.5, None));
    assert_eq!(record.trust().statistics, None);
}

/// Bodies on an elliptic orbit, whose gravity gradient makes them tumble in no order (J. Wisdom, S. J. Peale, F. Mignard, *Icarus* 58 (1984) 137:
/// Hyperion). The bodies differ in their attitudes.
fn tumbling(bodies: usize, orbits: f64) -> Scene {
    let draw = Draw::new(4);
    let body = |body: usize| {
        let spin = 1.1e-3 * (1.0 + 0.2 * draw.normal_vector(body, Column::AngularVelocity));
        (DVec3::new(100.0, 150.0, 200.0), draw.rotation(body, Column::Orientation), spin)
    };
    let orbit = Orbit::kepler(3.986004418e14, 7.0e6, 0.1);
    let period = std::f64::consts::TAU * (7.0e6_f64.powi(3) / 3.986004418e14).sqrt();
    let upright = Quantity::axis_angle("pointing", DVec3::Z, DVec3::Z).expect("axes");
    let turned = Event::new("turned over", upright.clone(), Condition::Above(2.0)).expect("a level");
    Scene::new(Ensemble::from_fn(bodies, body).expect("bodies"))
        .torque(Torque::gravity_gradient(orbit))
        .until(orbits * period)
        .outputs(Outputs::Every(0.1 * period))
        .statistics([Quantity::SpinRate, upright])
        .event(turned)
        .without_states()
}

#[test]
fn a_chaotic_ensemble_is_planned_and_its_scatter_leaves_the_target_open() {
    let scene = tumbling(400, 100.0);
    let engine = Engine::cpu();
    let refused =
        Plan::new(&scene.clone().accuracy(Accuracy::attitude(1e-6)), &engine).expect_err("attitudes are lost");
    assert!(matches!(refused, Error::AccuracyOutOfReach { .. }), "{refused}");
    for way_out in ["accuracy.mean, quantile, event_time", "accuracy.percentile", "accuracy.method"] {
        assert!(refused.to_string().contains(way_out), "{way_out} in {refused}");
    }

    // Some bodies turn over by a little between two outputs: times of the event are not asked for.
    let scene = scene.statistical_accuracy(StatisticalAccuracy { mean: Some(1e-3), ..StatisticalAccuracy::default() });
    let plan = Plan::new(&scene, &engine).expect("a plan");
    println!("planned in {:?}\n{}", plan.planning_time(), plan.explain());
    let record = engine.run(&plan).expect("a run");
    let sample = sample(&record);
    println!("{sample}\n{:#?}", sample.errors);
    // Of some twenty spreads of 64 bodies nothing as small as a thousandth shows, and nobody says so.
    assert!(sample.met.is_none() && sample.is_undecided() && sample.bodies == 64, "{sample:?}");
    assert!(sample.to_string().contains("NOT SHOWN"), "{sample}");
    let of_mean = of(&sample.errors, StatisticalTarget::Mean);
    assert!(of_mean.confidence > of_mean.wanted && of_mean.bound() < 1.5, "{of_mean:?}");
    assert!((of_mean.sampling - 0.05).abs() < 1e-9, "1/sqrt(400): {of_mean:?}");
    // Attitudes are lost, and that is reported too.
    assert!(record.trust().recomputed_sample.attitude.max > 0.1, "{}", record.trust().recomputed_sample);

    let explained = plan.explain();
    assert!(!explained.statistics.is_empty());
    let tenth = explained.tenth.expect("errors of statistics were asked for");
    assert_eq!(tenth.bodies, 40_000);
    assert!(tenth.steps.is_some_and(|steps| (1.0..=1.4).contains(&steps)), "{tenth:?}");
    let seconds: f64 = explained.classes.iter().filter_map(|row| row.seconds).sum();
    assert!((tenth.bodies_seconds.expect("known") / seconds - 100.0).abs() < 1e-9, "{tenth:?}");
    assert!(tenth.steps_seconds.expect("known") > seconds, "{tenth:?}");
}

/// In half an orbit no two motions part: the sample shows what it cannot show of a hundred.
#[test]
fn before_chaos_has_grown_the_target_is_shown() {
    let scene = tumbling(400, 0.5);
    let record = run(&scene.clone().event_checks(0.01 * scene.end()));
    let sample = sample(&record);
    assert_eq!(sample.met, Some(true), "{sample:?}");
    // A body that turns over by a little between two outputs has its event half a span late, or not at all.
    // Few do, so that all are compared.
    let unchecked = run(&scene.recompute(400));
    let error = of(&self::sample(&unchecked).errors, StatisticalTarget::EventTime);
    assert!((1..20).contains(&error.unnoticed) && error.is_missed(), "{error:?}");
}

#[test]
fn steps_that_are_given_and_too_long_are_said_to_miss_the_target() {
    let wanted = StatisticalAccuracy { mean: Some(1e-3), quantile: Some(1e-3), event_time: Some(1e-3) };
    let given = |method, dt| {
        let record = run(&slowing().pinned(method, dt, Some(Precision::F64)).statistical_accuracy(wanted));
        sample(&record).clone()
    };
    // A step of explicit Euler takes 1 - dt/DECAY instead of e^(-dt/DECAY) of a sphere's momentum.
    let coarse = given(Method::ExplicitEuler, 1.0);
    assert!(coarse.met == Some(false), "{coarse:?}");
    assert!(coarse.errors.iter().all(StatisticError::is_missed), "{coarse:?}");
    let of_mean = of(&coarse.errors, StatisticalTarget::Mean);
    let time = of_mean.time.expect("of a time");
    let (euler, exact) = (0.9_f64.powf(time), (-time / DECAY).exp());
    let mean = (0..BODIES).map(spin).sum::<f64>() / BODIES as f64;
    let expected = mean * (euler - exact) / of_mean.scale;
    assert!((of_mean.integration / expected - 1.0).abs() < 0.05, "{of_mean:?}, expected {expected:e}");
    assert!(coarse.to_string().contains("NOT MET"), "{coarse}");
    let fine = given(Method::Rk8, 0.5);
    assert!(fine.met == Some(true), "{fine:?}");

    // Too coarse for a chaotic ensemble as well: a method that adds energy spins all bodies up.
    let means = StatisticalAccuracy { mean: Some(1e-3), ..Default::default() };
    let chaotic = tumbling(400, 20.0).pinned(Method::ExplicitEuler, 60.0, Some(Precision::F64));
    let record = run(&chaotic.statistical_accuracy(means));
    assert_eq!(sample(&record).met, Some(false), "{:?}", sample(&record));
}

#[test]
fn a_run_that_lost_bodies_has_not_met_its_target() {
    let wanted = StatisticalAccuracy { mean: Some(0.5), ..Default::default() };
    // A turn takes an hour and a half, and some bodies keep such a tolerance in no step of five minutes.
    let steps = AdaptiveSteps { tolerance: 1e-12, least_step: Some(300.0) };
    let scene = tumbling(100, 1.0).adaptive(steps, None);
    let record = run(&scene.statistical_accuracy(wanted));
    let sample = sample(&record);
    assert!(sample.lost > 0 && sample.met == Some(false) && !sample.is_undecided(), "{sample:?}");
}

#[test]
fn of_a_random_torque_nothing_is_said() {
    let wanted = StatisticalAccuracy { mean: Some(1e-3), ..Default::default() };
    let scene = slowing().torque(Torque::white_noise(1e-3, 7)).pinned(Method::Rk8, 0.5, None);
    let record = run(&scene.statistical_accuracy(wanted));
    let sample = sample(&record);
    assert!(sample.met.is_none() && sample.random && sample.errors.is_empty(), "{sample:?}");
}

#[test]
fn bodies_without_torques_take_closed_forms() {
    let free = |spread: f64| {
        let draw = Draw::new(9);
        let body = |body: usize| {
            let omega =
                DVec3::new(0.1, 1.0, 0.3) * (1.0 + spread * draw.normal_vector(body, Column::AngularVelocity).x);
            (DVec3::new(1.0, 2.0, 2.5), draw.rotation(body, Column::Orientation), omega)
        };
        let scene = Scene::new(Ensemble::from_fn(BODIES, body).expect("bodies")).until(100.0);
        scene.statistics([Quantity::KineticEnergy]).without_states()
    };
    // What rounding in f32 does is far below a thousandth of this spread, and above one of that.
    for (spread, precision) in [(0.1, Precision::F32), (1e-5, Precision::F64)] {
        let scene = free(spread);
        let plan = Plan::new(&scene, &Engine::cpu()).expect("a plan");
        assert!(plan.is_closed_form() && plan.precision() == precision, "{spread:e}: {}", plan.explain());
        let explained = plan.explain();
        assert_eq!(explained.tenth.expect("asked for").steps, None);
        let record = run(&scene);
        assert_eq!(sample(&record).met, Some(true), "{:?}", sample(&record));
    }
}

#[test]
fn targets_that_do_not_fit_are_refused() {
    let refused = |wanted: StatisticalAccuracy, scene: Scene| {
        Plan::new(&scene.statistical_accuracy(wanted), &Engine::cpu()).expect_err("refused").to_string()
    };
    let none = StatisticalAccuracy::default();
    let energies = || slowing().unobserved().statistics([Quantity::KineticEnergy]);
    let event_time = StatisticalAccuracy { event_time: Some(1e-3), ..none };
    let quantile = StatisticalAccuracy { quantile: Some(1e-3), ..none };
    assert!(refused(event_time, energies()).starts_with("accuracy.event_time = 0.001: there is no event"));
    assert!(refused(quantile, energies()).starts_with("accuracy.quantile = 0.001: there are no quantiles"));
    let mean = StatisticalAccuracy { mean: Some(1e-3), ..none };
    assert!(refused(mean, slowing().unobserved()).starts_with("accuracy.mean = 0.001: there are no means"));
    for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let refused = refused(StatisticalAccuracy { mean: Some(value), ..none }, slowing());
        assert!(refused.contains("expected an error above 0"), "{refused}");
    }
    // Rounding is in the way, and what can be done is said.
    let scene = slowing().statistical_accuracy(StatisticalAccuracy { mean: Some(1e-17), ..none });
    let error = Plan::new(&scene, &Engine::cpu()).expect_err("out of reach");
    assert!(matches!(error, Error::StatisticsOutOfReach { .. }) && error.is_input(), "{error}");
    assert!(error.to_string().contains("rounding is in the way"), "{error}");
}
