//! Targets under formulas that decide between cases, in time or by a phase: met, and said to be met where that is true.

use glam::{DQuat, DVec3};
use polhode::bodies::Status;
use polhode::plan::Resolution;
use polhode::scene::{AdaptiveSteps, Condition, Event, Quantity, StatisticalAccuracy};
use polhode::study::draw::{Column, Draw};
use polhode::torque::{Parameters, SampledLaw, Torque};
use polhode::{Accuracy, Engine, Ensemble, Error, Method, Outputs, Plan, Precision, Scene};

use polhode::study::Study;

use crate::support::attitude_error;

/// A spring whose torque jumps at half a turn, to which some bodies come.
const JUMPS: &str = r#"
seed = 51
[bodies]
count = 100
inertia = { ixx = 2.0, iyy = 1.0, izz = 2.5, ixy = 0.1 }
orientation = { distribution = "uniform" }
angular_velocity = [0.1, 0.1, { distribution = "normal", mean = 0, sigma = 2 }]
[[torque]]
model = "matrix-drag"
matrix = [[0.02, 0.01, 0], [0.01, 0.02, 0], [0, 0, 0.005]]
[[torque]]
model = "log-spring"
stiffness = 5.0
target = [0, 0, 0, 1]
[time]
end = 300
outputs = { every = 3 }
[accuracy]
attitude = 1e-5
percentile = 90
"#;

/// Steps of `rk8` lost 13 of these bodies at the jump, which none of the pilot's eight had met.
#[test]
fn steps_that_leap_are_not_chosen_where_few_bodies_are_tried() {
    let study = Study::parse(std::path::Path::new("study.toml"), JUMPS).expect("a study");
    let (scene, engine) = (study.scene().expect("a scene"), Engine::cpu());
    let plan = Plan::new(&scene, &engine).expect("a plan");
    assert_eq!(plan.method(), Method::Taylor);
    assert_eq!(engine.run(&plan).expect("a run").trust().failed_bodies, [0; 0]);
}

/// Who asks for `f32` is told what stands against series, and not that these steps were in `f64`.
#[test]
fn the_refusal_of_leaps_names_the_arithmetic_that_was_asked_for() {
    const SPRINGS: &str = "seed = 3\n[bodies]\ncount = 48\ninertia = { moments = [1.0, 2.0, 2.5], scatter = 0.05 }\n\
        orientation = { distribution = \"uniform\" }\n\
        angular_velocity = { distribution = \"normal\", mean = [0, 0, 0.5], sigma = 0.3 }\n\
        [[torque]]\nmodel = \"log-spring\"\nstiffness = 0.3\ntarget = { axis = [1, 2, 3], angle = 0.5 }\n\
        [time]\nend = 15.0\noutputs = { every = 3.0, start = true }\n\
        [accuracy]\nattitude = 1e-5\nprecision = \"f32\"\n";
    let study = Study::parse(std::path::Path::new("study.toml"), SPRINGS).expect("a study");
    let (scene, engine) = (study.scene().expect("a scene"), Engine::cpu());
    let error = Plan::new(&scene, &engine).expect_err("steps leap").to_string();
    assert!(error.contains("in f32) misses") && error.contains("use precision f64"), "{error}");
}

/// Plans for an arithmetic in which there are no series compare with series all the same: with other steps, which leap over the ends of the pulses as
/// those that are tried do, the error expected was a thousand times the true one, or a billionth of it.
#[test]
fn pulses_whose_width_a_sample_decides_are_planned_in_f32() {
    const PULSES: &str = "seed = 1\n[bodies]\ncount = 50\ninertia = [8.0, 10.0, 5.0]\n\
        orientation = { distribution = \"uniform\" }\n\
        angular_velocity = { distribution = \"normal\", mean = 0, sigma = \"3 deg/s\" }\n\
        [[torque]]\nmodel = \"custom\"\nevery = 1.0\nparameters = { F = 0.5 }\n\
        sample.w = \"0.2 + 3 * abs(angular_velocity.x)\"\n\
        torque = \"select(time - since < w, F, 0) * vec(1, 0, 0)\"\n\
        [time]\nend = 60.0\n[accuracy]\nattitude = 1e-2\nprecision = \"f32\"\n";
    let study = Study::parse(std::path::Path::new("study.toml"), PULSES).expect("a study");
    let (scene, engine) = (study.scene().expect("a scene"), Engine::cpu());
    let record = engine.run(&Plan::new(&scene, &engine).expect("within reach")).expect("a run");
    assert_eq!(record.trust().recomputed_sample.met, Some(true), "{}", record.trust().recomputed_sample);
}

/// Bodies that turn about an axis of their own, pushed for a while: the angle is known in closed form.
fn pushed(text: &str, parameters: Parameters) -> Scene {
    let spin = |body: usize| 0.05 + 0.01 * body as f64;
    let ensemble =
        Ensemble::from_fn(PUSHED, |body| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, spin(body) * DVec3::X));
    let torque = Torque::custom(text, parameters).expect("a formula");
    Scene::new(ensemble.expect("valid")).until(1000.0).torque(torque)
}

const PUSHED: usize = 20;

/// The errors of the attitudes after a push of 0.01 N m for 40 s from each body's time on.
fn errors_of_pushed(record: &polhode::Record, from: impl Fn(usize) -> f64) -> f64 {
    let error = |body: usize| {
        let spin = 0.05 + 0.01 * body as f64;
        let angle = spin * 1000.0 + 0.01 * 40.0 * (1000.0 - from(body) - 20.0);
        attitude_error(record.final_state().orientation(body), DQuat::from_rotation_x(angle))
    };
    (0..PUSHED).map(error).fold(0.0, f64::max)
}

/// A torque that jumps at times that the formula gives, the same for all bodies or each body's own: the target is met, the sample says so, and
/// what it says is true.
#[test]
fn torques_that_jump_in_time_meet_their_targets() {
    let engine = Engine::cpu();
    let own: Vec<f64> = (0..PUSHED).map(|body| 17.0 + 45.9 * body as f64).collect();
    let none = Parameters::new;
    let each = none().number("t0", own.clone()).expect("a name");
    let shared = pushed("select(time >= 123.4 && time < 163.4, 0.01, 0) * vec(1, 0, 0)", none());
    let of_each = pushed("select(time >= t0 && time < t0 + 40, 0.01, 0) * vec(1, 0, 0)", each);
    for (name, scene, is_shared) in [("shared", shared, true), ("of each", of_each, false)] {
        let steps = AdaptiveSteps { tolerance: 1e-11, least_step: None };
        let mut scenes = vec![
            scene.clone().accuracy(Accuracy::attitude(1e-6)),
            scene.clone().accuracy(Accuracy::attitude(1e-9)),
            scene.clone().taylor(steps),
        ];
        if is_shared {
            // Outputs at the jumps; and in equal steps, whose last stage must not see what comes after.
            let scene = scene.outputs(Outputs::Times(vec![123.4, 163.4, 1000.0])).accuracy(Accuracy::attitude(1e-6));
            scenes.extend([scene.clone(), scene.skipping(false)]);
        }
        for (index, scene) in scenes.iter().enumerate() {
            let plan = Plan::new(scene, &engine).unwrap_or_else(|error| panic!("{name}, {index}: {error}"));
            let record = engine.run(&plan).expect("a run");
            let recomputed = &record.trust().recomputed_sample;
            let error = errors_of_pushed(&record, |body| if is_shared { 123.4 } else { own[body] });
            assert_eq!(recomputed.bodies, PUSHED, "{name}, {index}: {recomputed}");
            assert!(recomputed.met != Some(false), "{name}, {index}: {recomputed}");
            let reported = recomputed.attitude.max;
            // Of angles of hundreds of radians some digits are lost to rounding on both sides.
            assert!(reported >= 0.5 * error - 1e-11, "{name}, {index}: {error:e}, {recomputed}");
            assert!(reported <= 10.0 * error + 1e-10, "{name}, {index}: {error:e}, {recomputed}");
        }
    }
}

/// Two bodies of a hundred turn thirty times as fast as the others, under a torque that jumps in time: the pilot has one of them, however few
/// bodies it follows, and the recomputed sample has many, also where statistics are asked for.
#[test]
fn a_fast_minority_under_a_torque_that_jumps_meets_its_target() {
    let engine = Engine::cpu();
    for seed in [18, 19] {
        let draw = Draw::new(seed);
        let is_fast = |body: usize| draw.uniform(body, Column::Mass, 0) < 0.02;
        let body = |body: usize| {
            let spin = draw.normal_vector(body, Column::AngularVelocity) * if is_fast(body) { 3.0 } else { 0.1 };
            (DVec3::new(1.0, 2.0, 2.999), DQuat::IDENTITY, spin)
        };
        let from = (0..1000).map(|body| 6.0 + 48.0 * draw.uniform(body, Column::Position, 0)).collect::<Vec<f64>>();
        let parameters = Parameters::new().number("t0", from).expect("a name");
        let text = "0.0045 * smoothstep(t0, t0 + 3, time) * vec(1, 0, 0.2) * step(0, sin(0.2 * time))";
        let scene = Scene::new(Ensemble::from_fn(1000, body).expect("valid")).until(60.0);
        let scene = scene.torque(Torque::custom(text, parameters).expect("a formula"));
        let scene = scene.statistics([Quantity::SpinRate]).accuracy(Accuracy::attitude(1e-6));
        let of = |scene: &Scene| {
            let record = engine.run(&Plan::new(scene, &engine).expect("a plan")).expect("a run");
            let sample = record.trust().recomputed_sample;
            (sample.bodies, sample.attitude.p99, sample.met)
        };
        let (bodies, shown, met) = of(&scene);
        let (all, truth, holds) = of(&scene.recompute(1000));
        assert!(bodies < 200 && all == 1000);
        assert_eq!((met, holds), (Some(true), Some(true)), "seed {seed}: {shown:e}, in truth {truth:e}");
        assert!(shown > 0.1 * truth, "seed {seed}: {shown:e}, in truth {truth:e}");
    }
}

/// Bodies that an event stops, under a torque that jumps with their attitude, are recomputed to their stops.
#[test]
fn stopped_bodies_under_jumps_are_recomputed() {
    let body = |body: usize| {
        let spin = Draw::new(3).normal_vector(body, Column::AngularVelocity);
        (DVec3::new(1.0, 1.02, 1.9), DQuat::IDENTITY, spin)
    };
    let text = "-0.45 * select(dot(to_world(vec(0, 0, 1)), vec(1, 0, 0)) > 0.3, 1, 0) * angular_velocity";
    let torque = Torque::custom(text, Parameters::new()).expect("a formula");
    let slow = Event::new("slow", Quantity::SpinRate, Condition::Below(0.5)).expect("a level").stopping();
    let scene = Scene::new(Ensemble::from_fn(20, body).expect("valid")).until(100.0).outputs(Outputs::Every(10.0));
    let scene = scene.torque(torque).event(slow).taylor(AdaptiveSteps { tolerance: 1e-11, least_step: None });
    let engine = Engine::cpu();
    let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
    let (stopped, sample) = (record.events()[0].occurrences.len(), &record.trust().recomputed_sample);
    assert!(stopped > 5, "{stopped} of 20");
    assert_eq!((sample.bodies, sample.diverged), (20, 0), "{sample}");
    assert!(sample.attitude.median < 1e-9, "{sample}");
}

/// A controller of no gain that samples each `every` s.
fn idle(every: f64) -> Torque {
    let law = SampledLaw::new(Parameters::new(), every, 0.0).expect("a period");
    let law = law.number("seen", 0.0).expect("a name").next("seen", "time").expect("a formula");
    law.torque("0 * seen * angular_velocity").expect("a formula")
}

/// Bodies near rest that a torque pushes while the sun is up, as it does a satellite's panel: whole revolutions of it lie within one step of
/// bodies that hardly turn. With a controller of no gain beside it, whose samples nothing changes.
#[test]
fn torques_that_act_in_windows_of_a_phase_meet_their_targets() {
    let (engine, end, pace) = (Engine::cpu(), 2e4, 1e-3);
    let idle = idle(1234.5);
    for formula in ["step(0.9, sin(1e-3 * time - 1.5))", "select(sin(1e-3 * time - 1.5) > 0.9, 1, 0)"] {
        let formula = format!("1e-8 * {formula} * vec(1, 0, 0)");
        let push = Torque::custom(&formula, Parameters::new()).expect("a formula");
        let row = |_| (DVec3::new(20.0, 26.0, 31.0), DQuat::IDENTITY, 1e-6 * DVec3::X);
        let scene = Scene::new(Ensemble::from_fn(4, row).expect("valid")).until(end).torque(push);
        // Three windows, where the sine's angle is π/2, 5π/2 and 9π/2; from the middle of each on the body turns by its gain.
        let gain = 1e-8 / 20.0 * 2.0 * 0.9_f64.acos() / pace;
        let middles = [1.0, 5.0, 9.0].map(|quarters| (quarters * std::f64::consts::FRAC_PI_2 + 1.5) / pace);
        let angle: f64 = 1e-6 * end + middles.iter().map(|middle| gain * (end - middle)).sum::<f64>();
        for scene in [scene.clone(), scene.torque(idle.clone())] {
            for asked in [1e-3, 1e-6, 1e-9] {
                let scene = scene.clone().accuracy(Accuracy::attitude(asked));
                let plan = Plan::new(&scene, &engine).unwrap_or_else(|error| panic!("{formula}, {asked:e}: {error}"));
                let record = engine.run(&plan).expect("a run");
                let truth = DQuat::from_rotation_x(angle);
                let error = attitude_error(record.final_state().orientation(0), truth);
                let recomputed = &record.trust().recomputed_sample;
                assert!(error <= asked, "{formula}, {asked:e}: {error:e}, {}", plan.method());
                assert_eq!(recomputed.met, Some(true), "{formula}, {asked:e}: {error:e}, {recomputed}");
                let reported = recomputed.attitude.max;
                assert!(
                    (reported - error).abs() <= 0.5 * error + 1e-12,
                    "{formula}, {asked:e}: {error:e}, {recomputed}"
                );
            }
        }
    }
}

/// A wheel without gain beside a jump: its samples do not hide the jump from the sample of bodies, whatever steps the run takes.
#[test]
fn errors_beside_sampled_torques_and_jumps_are_those_of_the_run() {
    let engine = Engine::cpu();
    let push = Torque::custom("select(time > 33.8, 1e-3, 0) * vec(1, 0, 0)", Parameters::new());
    let row = |_| (DVec3::new(2.0, 2.6, 3.1), DQuat::IDENTITY, 0.01 * DVec3::X);
    let scene = Scene::new(Ensemble::from_fn(2, row).expect("valid")).until(120.0);
    let scene = scene.torque(push.expect("a formula")).torque(idle(1.3));
    let truth = DQuat::from_rotation_x(0.01 * 120.0 + 0.5 * 1e-3 / 2.0 * (120.0_f64 - 33.8).powi(2));
    let steps = AdaptiveSteps { tolerance: 1e-8, least_step: None };
    for scene in [
        scene.clone().accuracy(Accuracy::attitude(1e-6)),
        scene.clone().accuracy(Accuracy::attitude(1e-9)),
        scene.clone().taylor(steps),
        scene.clone().adaptive(steps, Some(Precision::F64)),
    ] {
        let plan = Plan::new(&scene, &engine).expect("a plan");
        let record = engine.run(&plan).expect("a run");
        let error = attitude_error(record.final_state().orientation(0), truth);
        let recomputed = &record.trust().recomputed_sample;
        assert!(recomputed.met != Some(false), "{}: {error:e}, {recomputed}", plan.method());
        let reported = recomputed.attitude.max;
        assert!((reported - error).abs() <= 0.5 * error + 1e-12, "{}: {error:e}, {recomputed}", plan.method());
    }
}

/// Few bodies under a controller, with a push while the sun is up: steps of `rk8` may pass where the push begins and ends, and a few bodies
/// do not show what becomes of all. Plans of statistics take series, which end there.
#[test]
fn statistics_under_formulas_that_decide_are_planned_by_series() {
    let engine = Engine::cpu();
    let push = "5e-9 * select(sin(1e-3 * time + to_world(vec(1, 0, 0)).x) > 0.5, 1, 0) * vec(1, 0.2, 0)";
    let push = Torque::custom(push, Parameters::new()).expect("a formula");
    let row = |body: usize| {
        let spin = 1e-3 * DVec3::new(1.0, 0.1 * body as f64, 0.5);
        (DVec3::new(0.03, 0.036, 0.05), DQuat::IDENTITY, spin)
    };
    let scene = Scene::new(Ensemble::from_fn(40, row).expect("valid")).until(3000.0).torque(push).torque(idle(2.0));
    let wanted = StatisticalAccuracy { mean: Some(1e-3), ..Default::default() };
    let scene = scene.statistics([Quantity::SpinRate]).outputs(Outputs::Every(600.0)).statistical_accuracy(wanted);
    let plan = Plan::new(&scene, &engine).expect("a plan");
    assert_eq!(plan.method(), Method::Taylor);
    let record = engine.run(&plan).expect("a run");
    let sample = record.trust().statistics.as_ref().expect("a sample");
    assert_eq!(sample.met, Some(true), "{sample:?}");
}

/// A law that drives the spin back to 0.01 rad/s from either side has no solution once it is there. Whatever follows the body finds that out
/// after a thousand steps, not after billions: the run, the plan, and the sample of a run that leaps over the switches.
#[test]
fn a_law_without_a_solution_fails_its_bodies_at_once() {
    let engine = Engine::cpu();
    let scene = |level: f64, after: f64| {
        let ensemble = Ensemble::from_columns(&[DVec3::ONE], &[DQuat::IDENTITY], &[DVec3::new(0.05, 0.0, 0.0)]);
        let parameters = Parameters::new().number("level", level).and_then(|of| of.number("after", after));
        let text = "select(angular_velocity.x > level, -0.1, after) * vec(1, 0, 0)";
        let torque = Torque::custom(text, parameters.expect("names")).expect("a formula");
        Scene::new(ensemble.expect("valid")).until(10.0).torque(torque)
    };
    let sliding = scene(0.01, 0.001);
    let steps = AdaptiveSteps { tolerance: 1e-9, least_step: None };
    let by_series = sliding.clone().taylor(steps);
    let record = engine.run(&Plan::new(&by_series, &engine).expect("a plan")).expect("a run");
    assert_eq!(record.final_state().statuses(), [Status::StepBelowLimit]);

    let asked = sliding.clone().accuracy(Accuracy::attitude(1e-3));
    let refused = Plan::new(&asked, &engine).map(|plan| plan.method());
    assert!(matches!(refused, Err(Error::AccuracyOutOfReach { .. })), "{refused:?}");

    let pinned = sliding.pinned(Method::Rk4, 0.01, Some(Precision::F64));
    let record = engine.run(&Plan::new(&pinned, &engine).expect("a plan")).expect("a run");
    assert_eq!(record.final_state().statuses(), [Status::Valid]);
    // Steps that leap over the switches slide along the level: what `rk8` finds differs by some steps' worth.
    let recomputed = &record.trust().recomputed_sample;
    assert!(recomputed.bodies == 1 && recomputed.attitude.max < 1e-2, "{recomputed}");

    // The same with a torque of 0.001 N m that goes on in the same direction beyond the level has one. Where it switches, the spin is
    // known to the torque over some least steps, 2⁻³⁰ of the time of a radian each.
    let through = scene(0.01, -0.001).taylor(steps);
    let record = engine.run(&Plan::new(&through, &engine).expect("a plan")).expect("a run");
    let spin = record.final_state().angular_velocity_body(0).x;
    let least = 1.0 / (0.05 * f64::from(1 << 30));
    assert!((spin - (0.01 - 0.001 * 9.6)).abs() < 8.0 * 0.1 * least, "{spin}");
}

/// All bodies come to rest by dry friction, whose torque jumps there: their steps have no end, and the refusal says what would help.
#[test]
fn statistics_of_bodies_at_rest_by_dry_friction_are_refused() {
    let ensemble = Ensemble::from_fn(20, |body| {
        let spin = DVec3::new(0.15, -0.25, 0.2) * (1.0 + 0.1 * body as f64);
        (DVec3::new(1.0, 2.0, 2.5), DQuat::from_rotation_x(body as f64), spin)
    });
    let torque = Torque::custom("-0.3 * normalize(angular_velocity)", Parameters::new()).expect("a formula");
    let scene = Scene::new(ensemble.expect("valid")).torque(torque).until(12.0).outputs(Outputs::Every(1.0));
    let mean = StatisticalAccuracy { mean: Some(1e-3), ..StatisticalAccuracy::default() };
    let asked = scene.statistics([Quantity::SpinRate]).statistical_accuracy(mean);
    let refused = Plan::new(&asked, &Engine::cpu()).map(|plan| plan.method());
    let message = refused.expect_err("refused").to_string();
    assert!(message.contains("without end") && message.contains("dry friction"), "{message}");
}

/// Friction that brings some of 3,000 bodies to rest.
const RUBS: &str = r#"
seed = 3
[bodies]
count = 3000
inertia = { moments = [1, 1.1, 1.4], scatter = 0.05 }
orientation = { distribution = "uniform" }
angular_velocity = { distribution = "normal", mean = [0, 0, 2], sigma = 0.3 }
[[torque]]
model = "custom"
torque = "-0.05 * normalize(angular_velocity + vec(1e-9, 0, 0))"
[time]
end = 30
[accuracy]
attitude = 1e-6
"#;

/// A few come to rest that the pilot does not have: the run gives them up after so many attempts, and the others arrive.
#[test]
fn bodies_that_dry_friction_brings_to_rest_are_given_up() {
    let (study, engine) = (Study::parse(std::path::Path::new("study.toml"), RUBS).expect("a study"), Engine::cpu());
    let scene = study.scene().expect("a scene");
    let plan = Plan::new(&scene, &engine).expect("a plan");
    let most = plan.groups().iter().map(|group| group.most_attempts).max().expect("groups");
    assert!((100_000..10_000_000).contains(&most), "{most}");
    let record = engine.run(&plan).expect("a run");
    let statuses = record.final_state().statuses();
    let of = |wanted: Status| statuses.iter().filter(|status| **status == wanted).count();
    let lost = of(Status::StepBelowLimit);
    assert!((1..=30).contains(&lost) && lost + of(Status::Valid) == 3000, "{lost} are given up");
}

/// Two bodies of a hundred turn a hundred times as fast as the others. A pilot of few bodies has one of them, and the steps that it expects of the
/// class are still those that the class takes.
#[test]
fn a_fast_body_of_the_pilot_is_not_taken_for_an_eighth_of_its_class() {
    let spin = |body: usize| DVec3::new(0.3, 1.0, 0.2) * if body % 50 == 7 { 10.0 } else { 0.1 };
    let body = |body: usize| (DVec3::new(1.0, 2.0, 2.5), DQuat::from_rotation_x(body as f64), spin(body));
    let scene = Scene::new(Ensemble::from_fn(1000, body).expect("valid")).until(2_000.0);
    let scene = scene.torque(Torque::sine_spring(1e-6, DQuat::IDENTITY)).accuracy(Accuracy::attitude(1e-5));
    let engine = Engine::cpu();
    let plan = Plan::new(&scene, &engine).expect("a plan");
    let Resolution::Accuracy { stepped, .. } = plan.resolution() else { panic!("an error was asked for") };
    let found = &stepped[0].found;
    let expected = found.steps.expect("bodies choose their steps").total as f64 / found.bodies as f64;
    let work = engine.run(&plan).expect("a run").trust().adaptive.expect("adaptive steps");
    let taken = (work.accepted.total + work.rejected.total) as f64 / 1000.0;
    assert!(found.bodies < 50, "{} bodies", found.bodies);
    assert!((0.5..2.0).contains(&(expected / taken)), "{expected} steps a body expected, {taken} taken");
}
