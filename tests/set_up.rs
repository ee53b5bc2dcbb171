//! Constants of the closed form in one word: how far they lead astray, against the bound by which a plan takes them.

mod common;

use common::random::Random;
use glam::{DQuat, DVec3};
use polhode::bodies::BodyFrame;
use polhode::bodies::Members;
use polhode::bodies::inertia::InertiaTensor;
use polhode::engine::{End, unobserved};
use polhode::kernel::free_motion::{AnyRows, SetUp};
use polhode::plan::class::FreeBody;
use polhode::plan::{Plan, SkipName};
use polhode::{Accuracy, Engine, Ensemble, Precision, Scene};

const BODIES: usize = 4096;
/// s; spins are about 1 rad/s.
const SPANS: [f64; 4] = [0.1, 10.0, 1e3, 1e5];

/// Bodies of every sort: moments and spins apart by any power of ten, near every axis and near the separatrix, thin and flat.
fn bodies(seed: u64, turned: bool) -> Ensemble {
    let mut random = Random::new(seed);
    let mut any = |least: f64| 10_f64.powf(least * random.uniform());
    let (mut tensors, mut orientations, mut spins) = (Vec::new(), Vec::new(), Vec::new());
    for body in 0..BODIES {
        let (wide, narrow) = (any(-6.0), any(-6.0));
        // Two moments and a third between their difference and their sum.
        let moments = match body % 4 {
            0 => DVec3::new(1.0, 1.0 + wide, 1.0 + wide + narrow.min(0.9 - 0.5 * wide)),
            1 => DVec3::new(wide, 1.0, 1.0 + wide * narrow),
            2 => DVec3::new(1.0, 1.0 + wide, 2.0 + wide - narrow * 0.9),
            _ => DVec3::new(0.3 + 0.7 * any(-1.0), 1.0, 1.0 + 0.3 * any(-1.0)),
        };
        let near = any(-5.0);
        let (i, r) = (moments, (moments.x * (moments.y - moments.x) / (moments.z * (moments.z - moments.y))).sqrt());
        let spin = match (body / 4) % 5 {
            // Off the separatrix by that part, and off each axis.
            0 => DVec3::new(1.0, any(-2.0), r * (1.0 + near)),
            1 => DVec3::new(near, 1.0, near * any(-3.0)),
            2 => DVec3::new(1.0, near, near * any(-3.0)),
            3 => DVec3::new(near, near * any(-3.0), 1.0),
            _ => DVec3::new(any(-1.0), any(-1.0), any(-1.0)),
        };
        let spin = spin / spin.length() * (0.5 + any(-1.0));
        let signs = DVec3::new(1.0, if body % 3 == 0 { -1.0 } else { 1.0 }, if body % 7 < 3 { -1.0 } else { 1.0 });
        let axes = DQuat::from_xyzw(any(-1.0), -any(-1.0), any(-1.0), any(-1.0)).normalize();
        let tensor = InertiaTensor::from_principal_moments(i);
        tensors.push(if turned { tensor.rotated(axes) } else { tensor });
        let spin = spin * signs;
        spins.push(if turned { axes * spin } else { spin });
        orientations.push(DQuat::from_xyzw(any(-1.0), any(-1.0), -any(-1.0), any(-1.0)).normalize());
    }
    Ensemble::from_columns(&tensors, &orientations, &spins).expect("sound bodies")
}

/// Orientations, principal axes to world, and frames at a time.
fn ends(ensemble: &Ensemble, set_up: SetUp, time: f64) -> (Vec<BodyFrame>, Vec<DQuat>) {
    let members = Members::All(ensemble.len());
    let (frames, rows) = AnyRows::prepare_members(ensemble, &members, Precision::F64, set_up).expect("enough memory");
    let mut session = Engine::cpu().start_free(rows).expect("started");
    session.advance_to(End::at(time), &mut unobserved).expect("evaluated");
    let words = session.read(0..ensemble.len()).expect("read");
    let state = |(body, frame): (usize, &BodyFrame)| frame.body_state(words.combined(body)).orientation;
    let orientations = frames.iter().enumerate().map(state).collect();
    (frames, orientations)
}

fn angle(a: DQuat, b: DQuat) -> f64 {
    let relative = a.conjugate() * b;
    2.0 * relative.xyz().length().atan2(relative.w.abs())
}

fn bound(ensemble: &Ensemble, frame: &BodyFrame, body: usize, time: f64) -> f64 {
    let unit = 2_f64.powi(frame.rate_exponent);
    let omega = frame.principal_to_body.conjugate() * ensemble.angular_velocity_body()[body] / unit;
    let free = FreeBody {
        moments: frame.scaled_moments,
        angular_momentum_principal: frame.scaled_moments * omega,
        span: time * unit,
    };
    free.set_up_bound(ensemble.inertia()[body].is_diagonal()).attitude
}

/// What the evaluation itself loses in either of the two, rad.
const EVALUATION: f64 = 6e-15;

#[test]
fn one_word_leads_no_further_astray_than_the_bound_and_not_much_less() {
    for turned in [false, true] {
        let mut greatest: f64 = 0.0;
        let mut counted = 0;
        for (seed, span) in SPANS.into_iter().enumerate() {
            let ensemble = bodies(seed as u64 + 1, turned);
            let (frames, one) = ends(&ensemble, SetUp::OneWord, span);
            let (_, two) = ends(&ensemble, SetUp::TwoWords, span);
            for body in 0..BODIES {
                let (error, bound) = (angle(one[body], two[body]), bound(&ensemble, &frames[body], body, span));
                assert!(
                    error - EVALUATION <= bound,
                    "body {body}, {span} s, turned {turned}: {error:e} beyond {bound:e}"
                );
                if bound < 0.1 {
                    greatest = greatest.max((error - EVALUATION) / bound);
                    counted += 1;
                }
            }
        }
        println!("turned {turned}: at most {greatest:.3} of the bound, {counted} bodies with one");
        assert!(counted > BODIES && greatest > 0.01, "the bound says nothing: {greatest:e}, {counted} bodies");
    }
}

/// The bodies of a scene for which a plan takes one word, and the bound that it gives.
fn skipped(scene: &Scene) -> (usize, f64) {
    let plan = Plan::new(scene, &Engine::cpu()).expect("planned");
    let of_set_up = plan.skips().iter().find(|skip| skip.name == SkipName::SetUp);
    of_set_up.map_or((0, 0.0), |skip| (skip.bodies, skip.bound.attitude))
}

#[test]
fn a_plan_takes_one_word_just_inside_the_bound_and_two_just_outside() {
    let tensors = [
        InertiaTensor::from_principal_moments(DVec3::new(1.0, 2.0, 2.5)),
        InertiaTensor { xx: 2.0, yy: 2.5, zz: 3.5, xy: -0.5, xz: 0.25, yz: 0.125 },
    ];
    for tensor in tensors {
        let ensemble =
            Ensemble::from_columns(&[tensor], &[DQuat::IDENTITY], &[DVec3::new(0.5, 1.0, 0.75)]).expect("a body");
        let span = 300.0;
        let scene = |attitude: f64| {
            let scene = Scene::new(ensemble.clone()).until(span).accuracy(Accuracy::attitude(attitude));
            scene.precision(Some(Precision::F64))
        };
        let (frames, one) = ends(&ensemble, SetUp::OneWord, span);
        let (_, two) = ends(&ensemble, SetUp::TwoWords, span);
        assert_ne!(one, two, "the set-ups must differ for this test to tell one from the other");
        // The part of an error asked for that a skip may take up.
        let least = bound(&ensemble, &frames[0], 0, span) / polhode::plan::SKIP_SHARE;
        let (inside, outside) = (scene(least * (1.0 + 1e-9)), scene(least * (1.0 - 1e-9)));
        let (bodies, attitude) = skipped(&inside);
        assert_eq!(bodies, 1);
        assert!(attitude <= polhode::plan::SKIP_SHARE * least * (1.0 + 2e-9), "{attitude:e}");
        assert_eq!(skipped(&outside), (0, 0.0));
        assert_eq!(skipped(&inside.clone().skipping(false)), (0, 0.0));
        let end = |scene: &Scene| {
            let engine = Engine::cpu();
            engine.run(&Plan::new(scene, &engine).expect("planned")).expect("run").final_state().orientation(0)
        };
        assert_eq!(end(&inside), one[0]);
        assert_eq!(end(&outside), two[0]);
        assert!(angle(one[0], two[0]) <= attitude, "{:e} beyond {attitude:e}", angle(one[0], two[0]));
        // Without skipping the body is stepped, which agrees with both.
        let long = end(&inside.clone().skipping(false));
        assert!(angle(one[0], long) < 2.0 * least && angle(two[0], long) < 2.0 * least);
    }
}

#[test]
fn bodies_whose_regime_is_hard_to_tell_keep_two_words() {
    // Off the separatrix by one part in 1e13: their period depends on it, and one word hardly has it.
    let moments = DVec3::new(1.0, 2.0, 3.0);
    let on = (1.0_f64 / 3.0).sqrt();
    let spin = |off: f64| DVec3::new(1.0, 1.0, on * (1.0 + off));
    let spins = [spin(1e-13), spin(0.1)];
    let ensemble =
        Ensemble::from_columns(&[InertiaTensor::from_principal_moments(moments); 2], &[DQuat::IDENTITY; 2], &spins)
            .expect("two bodies");
    let scene = Scene::new(ensemble).until(100.0).accuracy(Accuracy::attitude(1e-8));
    assert_eq!(skipped(&scene).0, 1);
}
