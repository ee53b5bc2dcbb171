//! A plan leaves out what a body does not need, and no more than its bounds allow.

use glam::{DQuat, DVec3};
use polhode::bodies::Members;
use polhode::plan::class::FreeBody;
use polhode::plan::{Bound, Class, Plan, Shape, SkipName, TorqueSet, Treatment};
use polhode::record::Record;
use polhode::torque::Torque;
use polhode::{Accuracy, Engine, Ensemble, Method, Precision, Scene};

/// Asked for in every scene here: far above what rounding does, so that bounds can be seen.
const TARGET: f64 = 1e-6;
/// What a simpler class may take up of it (`plan::choice::SKIP_SHARE`).
const TOLERANCE: f64 = TARGET / 16.0;
/// Simulated time, s.
const SPAN: f64 = 3.0;

fn ensemble(bodies: &[(DVec3, DVec3)]) -> Ensemble {
    let moments: Vec<DVec3> = bodies.iter().map(|body| body.0).collect();
    let rates: Vec<DVec3> = bodies.iter().map(|body| body.1).collect();
    let orientation: Vec<DQuat> =
        (0..bodies.len()).map(|body| DQuat::from_xyzw(0.1, 0.2 + 0.01 * body as f64, -0.4, 0.7).normalize()).collect();
    Ensemble::from_columns(&moments, &orientation, &rates).expect("valid bodies")
}

fn scene(bodies: &[(DVec3, DVec3)]) -> Scene {
    Scene::new(ensemble(bodies)).until(SPAN).accuracy(Accuracy::attitude(TARGET))
}

fn run(scene: &Scene) -> Record {
    let engine = Engine::cpu();
    engine.run(&Plan::new(scene, &engine).expect("a valid plan")).expect("runs")
}

fn shape_of(scene: &Scene) -> Shape {
    let plan = Plan::new(scene, &Engine::cpu()).expect("a valid plan");
    assert_eq!(plan.groups().len(), 1);
    plan.groups()[0].class.shape
}

fn angle_between(a: DQuat, b: DQuat) -> f64 {
    let relative = a.conjugate() * b;
    2.0 * DVec3::new(relative.x, relative.y, relative.z).length().atan2(relative.w.abs())
}

/// The bodies that come close to each class as ε falls to 0.
fn family(shape: Shape, epsilon: f64) -> (DVec3, DVec3) {
    match shape {
        Shape::AtRest => (DVec3::new(1.0, 2.0, 2.5), epsilon * DVec3::new(0.3, 0.9, -0.2)),
        Shape::Spherical => (DVec3::new(1.0, 1.0 + epsilon, 1.0 + 2.0 * epsilon), DVec3::new(0.7, -1.1, 0.4)),
        Shape::Steady => (DVec3::new(1.0, 2.0, 2.5), DVec3::new(0.5 * epsilon, epsilon, 1.3)),
        Shape::Axisymmetric => (DVec3::new(1.0, 1.0 + epsilon, 1.7), DVec3::new(0.7, -1.1, 0.9)),
        Shape::Asymmetric => (DVec3::new(1.0, 2.0, 2.5), DVec3::new(0.7, -1.1, 0.9)),
    }
}

fn bound(shape: Shape, epsilon: f64) -> Bound {
    let (moments, rates) = family(shape, epsilon);
    let body = FreeBody { moments, angular_momentum_principal: moments * rates, span: SPAN };
    body.bound(shape).bound
}

/// The ε at which the class's bound is `part` of the tolerance.
fn epsilon_at(shape: Shape, part: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1e-2);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if bound(shape, middle).attitude < part * TOLERANCE { low = middle } else { high = middle }
    }
    low
}

/// The error of a body that was stepped for [`TARGET`], whatever it is compared with.
const STEPPED: f64 = TARGET;

#[test]
fn each_skip_is_taken_just_inside_its_bound_and_not_just_outside() {
    for (shape, name) in [
        (Shape::AtRest, SkipName::AtRest),
        (Shape::Spherical, SkipName::Spherical),
        (Shape::Steady, SkipName::Steady),
        (Shape::Axisymmetric, SkipName::Axisymmetric),
    ] {
        let inside = epsilon_at(shape, 0.99);
        let outside = epsilon_at(shape, 1.01);
        assert!(inside > 1e-12, "{name}: a family that never leaves its class tests nothing");
        let skipped = scene(&[family(shape, inside)]);
        assert_eq!(shape_of(&skipped), shape, "{name}, just inside");
        assert_ne!(shape_of(&scene(&[family(shape, outside)])), shape, "{name}, just outside");

        let plan = Plan::new(&skipped, &Engine::cpu()).expect("valid");
        let skip = plan.skips().iter().find(|skip| skip.name == name).unwrap_or_else(|| panic!("{name} is not listed"));
        assert_eq!(skip.bodies, 1);
        assert!(skip.bound.attitude > 0.9 * TOLERANCE && skip.bound.attitude <= TOLERANCE, "{name}: {skip:?}");
        assert_eq!(plan.body_steps(), 0, "{name}: nothing is stepped");

        let all = run(&skipped.clone().skipping(false));
        assert!(all.trust().body_steps > 0, "{name}: without skipping there are steps");
        let found = run(&skipped);
        let error = angle_between(found.final_state().orientation(0), all.final_state().orientation(0));
        assert!(error <= TOLERANCE + STEPPED, "{name}: attitudes differ by {error:e}");
        println!("{name}: bound {:e}, difference {error:e}", skip.bound.attitude);
    }
}

/// Both sides in double precision with fine steps; rounding of some thousand steps remains.
const ROUNDING: f64 = 1e-12;

#[test]
fn bounds_hold_and_are_not_idle_over_many_bodies() {
    // The skip's own error alone: the run without skipping takes fine steps in f64.
    for shape in [Shape::AtRest, Shape::Spherical, Shape::Steady, Shape::Axisymmetric] {
        let mut largest_part: f64 = 0.0;
        for exponent in 2..9 {
            let epsilon = 10.0_f64.powi(-exponent);
            let bound = bound(shape, epsilon).attitude;
            let loose = 16.0 * bound * (1.0 + 1e-9);
            if loose > 3.0 {
                continue;
            }
            let skipped = scene(&[family(shape, epsilon)]).accuracy(Accuracy::attitude(loose));
            // A looser class may come first; its own bound is then within the same tolerance.
            assert_ne!(shape_of(&skipped), Shape::Asymmetric, "{shape:?} {epsilon:e}");
            let found = run(&skipped);
            let exact = run(&scene(&[family(shape, epsilon)]).pinned(Method::Rk4, 1e-3, Some(Precision::F64)));
            let error = angle_between(found.final_state().orientation(0), exact.final_state().orientation(0));
            assert!(error <= bound * (1.0 + 1e-9) + ROUNDING, "{shape:?} {epsilon:e}: {error:e} against {bound:e}");
            largest_part = largest_part.max(error / bound);
        }
        // A bound a thousand times too wide would hold too, and would skip nothing.
        assert!(largest_part > 1e-2, "{shape:?}: the error is at most {largest_part:e} of the bound");
    }
}

#[test]
fn a_verdict_is_the_simplest_class_whose_bound_is_within_the_tolerance() {
    let mut found = [0; Shape::ALL.len()];
    for shape in Shape::ALL {
        for exponent in 0..12 {
            // From the class itself to what is of no class, just inside and just outside each of the bounds.
            let epsilon = 10.0_f64.powi(-exponent);
            let (moments, omega) = family(shape, epsilon);
            for turn in 0..3 {
                let turned = DVec3::from_array(std::array::from_fn(|axis| omega[(axis + turn) % 3]));
                let body = FreeBody { moments, angular_momentum_principal: moments * turned, span: 3.0 };
                for near in Shape::ALL.map(|shape| body.bound(shape).bound.attitude) {
                    for attitude in [near * (1.0 - 1e-12), near, near * (1.0 + 1e-12), 1e-6] {
                        let tolerance = Bound { attitude, ..Bound::NONE };
                        let simpler = Shape::ALL.map(|shape| body.bound(shape));
                        let first = simpler.into_iter().find(|verdict| verdict.bound.within(&tolerance));
                        assert_eq!(Some(body.verdict(&tolerance)), first, "{body:?} {tolerance:?}");
                        found[body.verdict(&tolerance).shape as usize] += 1;
                    }
                }
            }
        }
    }
    assert!(found.iter().all(|&count| count > 0), "{found:?}");
}

#[test]
fn exact_members_of_a_class_agree_with_fine_steps() {
    let bodies = [
        (DVec3::new(2.0, 2.0, 2.0), DVec3::new(0.7, -1.1, 0.4)),
        (DVec3::new(1.0, 2.0, 2.5), DVec3::new(0.0, 0.0, -1.3)),
        (DVec3::new(1.0, 2.0, 2.5), DVec3::new(0.0, 1.3, 0.0)),
        (DVec3::new(1.0, 2.0, 2.5), DVec3::new(1.1, 0.0, 0.0)),
        (DVec3::new(2.0, 2.0, 1.0), DVec3::new(0.7, -1.1, 2.4)),
        (DVec3::new(1.0, 2.0, 2.0), DVec3::new(0.7, -1.1, 2.4)),
        (DVec3::new(1.0, 2.0, 2.5), DVec3::ZERO),
    ];
    let scene = scene(&bodies).accuracy(Accuracy::attitude(1e-12));
    let plan = Plan::new(&scene, &Engine::cpu()).expect("valid");
    assert_eq!(plan.body_steps(), 0, "{:?}", plan.groups());
    let found = run(&scene);
    let exact = run(&scene.clone().pinned(Method::Rk4, 2e-4, Some(Precision::F64)));
    for body in 0..bodies.len() {
        let (state, reference) = (found.final_state(), exact.final_state());
        let attitude = angle_between(state.orientation(body), reference.orientation(body));
        let rate = (state.angular_velocity_body(body) - reference.angular_velocity_body(body)).length();
        assert!(attitude < ROUNDING && rate < ROUNDING, "body {body}: {attitude:e} rad, {rate:e} rad/s");
    }
}

/// Free and driven bodies of all classes and of rates from 1e-4 to 30 rad/s.
fn mixture(count: usize) -> (Vec<(DVec3, DVec3)>, Vec<f64>) {
    let shapes = Shape::ALL;
    let bodies = (0..count)
        .map(|body| {
            let (moments, rates) = family(shapes[body % 5], 0.0);
            (moments, rates * 1.3_f64.powi((body % 17) as i32 - 8))
        })
        .collect();
    let drag = (0..count).map(|body| if body % 3 == 0 { 1e-2 } else { 0.0 }).collect();
    (bodies, drag)
}

fn mixed_scene(bodies: &[(DVec3, DVec3)], drag: &[f64]) -> Scene {
    scene(bodies).torque(Torque::linear_drag(drag.to_vec()))
}

#[test]
fn every_body_is_in_one_group_and_torques_act_where_they_are_not_zero() {
    let (bodies, drag) = mixture(211);
    let scene = mixed_scene(&bodies, &drag);
    let plan = Plan::new(&scene, &Engine::cpu()).expect("valid");
    let mut seen = vec![0; bodies.len()];
    for group in plan.groups() {
        let mut last = None;
        for row in 0..group.members.len() {
            let body = group.members.body(row);
            seen[body] += 1;
            assert!(last < Some(body), "a group keeps the ensemble's order");
            last = Some(body);
            assert_eq!(group.class.is_driven(), drag[body] != 0.0, "body {body}");
            assert_eq!(group.class.torques.contains(0), drag[body] != 0.0, "body {body}");
            assert_eq!(group.members.rows(body..body + 1), row..row + 1);
        }
        if group.class.is_driven() {
            assert!(matches!(group.treatment, Treatment::Stepped { .. } | Treatment::Adaptive { .. }));
        }
    }
    assert!(seen.iter().all(|&count| count == 1));
    // Five shapes of free bodies, and the driven ones in one arithmetic or two.
    assert!(plan.groups().len() > 5, "{}", plan.groups().len());
}

#[test]
fn a_body_gives_the_same_bits_alone_and_in_a_mixture_and_in_the_users_order() {
    // A pilot's bodies are drawn from all that there are; without it nothing depends on the others.
    let (bodies, drag) = mixture(211);
    let crowd = run(&mixed_scene(&bodies, &drag).without_pilot());
    assert_eq!(crowd.final_state().len(), bodies.len());
    for body in (0..bodies.len()).step_by(13) {
        // The orientation follows the index within the ensemble, so the body keeps its place.
        let alone = run(&mixed_scene(&bodies[..=body], &drag[..=body]).without_pilot());
        assert_eq!(alone.final_state().orientation(body), crowd.final_state().orientation(body), "body {body}");
        assert_eq!(
            alone.final_state().angular_velocity_body(body),
            crowd.final_state().angular_velocity_body(body),
            "body {body}"
        );
    }
}

#[test]
fn the_mixture_agrees_with_the_long_way_and_says_how_accurate_it_is() {
    let (bodies, drag) = mixture(211);
    let scene = mixed_scene(&bodies, &drag);
    let (found, all) = (run(&scene), run(&scene.clone().skipping(false)));
    let mut errors: Vec<f64> = (0..bodies.len())
        .map(|body| angle_between(found.final_state().orientation(body), all.final_state().orientation(body)))
        .collect();
    errors.sort_by(f64::total_cmp);
    // 99 in 100 bodies are within the target on either way.
    let error = errors[errors.len() * 99 / 100 - 1];
    assert!(error <= 2.0 * TARGET, "{error:e}");
    let recomputed = found.trust().recomputed_sample;
    assert!((96..=192).contains(&recomputed.bodies), "{recomputed}");
    assert_eq!(recomputed.met, Some(true), "{recomputed}");
    assert!(recomputed.attitude.max > 0.0 && recomputed.attitude.max <= 4.0 * TARGET, "{recomputed}");
    // Each body's own error is that of its steps, known here from a run without skipping.
    assert!(found.trust().body_steps < all.trust().body_steps / 4, "{} steps", found.trust().body_steps);
}

#[test]
fn the_sample_finds_a_step_that_is_too_long() {
    let (bodies, _) = mixture(211);
    let coarse = run(&scene(&bodies).pinned(Method::Rk4, 0.2, Some(Precision::F64)));
    let fine = run(&scene(&bodies).pinned(Method::Rk4, 1e-3, Some(Precision::F64)));
    assert_eq!(coarse.trust().recomputed_sample.met, None);
    let error =
        |body: usize| angle_between(coarse.final_state().orientation(body), fine.final_state().orientation(body));
    let largest = (0..bodies.len()).map(error).fold(0.0, f64::max);
    let found = coarse.trust().recomputed_sample.attitude;
    // 192 bodies of 211 hold some of the worst.
    assert!(found.max > 0.2 * largest && found.max < 1.05 * largest, "{found} against {largest:e}");
    assert!(fine.trust().recomputed_sample.attitude.max < 1e-9, "{}", fine.trust().recomputed_sample);
}

/// Under torques there is no closed form: a method of high order is judged by finer steps than its own.
#[test]
fn the_sample_finds_a_step_of_rk8_that_is_too_long() {
    // Steps of half a radian are judged by steps of half of them; longer ones by finer ones still.
    let rate = 1.4;
    let bodies: Vec<_> =
        mixture(64).0.into_iter().map(|(moments, spin)| (moments, rate * spin.normalize_or(DVec3::X))).collect();
    let driven = scene(&bodies).torque(Torque::constant_world(DVec3::new(0.1, -0.3, 0.2)));
    let coarse = run(&driven.clone().pinned(Method::Rk8, 0.3, Some(Precision::F64)));
    let fine = run(&driven.pinned(Method::Rk8, 0.01, Some(Precision::F64)));
    let error =
        |body: usize| angle_between(coarse.final_state().orientation(body), fine.final_state().orientation(body));
    let largest = (0..bodies.len()).map(error).fold(0.0, f64::max);
    let found = coarse.trust().recomputed_sample;
    // All bodies are in the sample. Steps of half the size err by 2⁻⁸ as much at order 8, which is what the estimate leaves out.
    assert_eq!(found.bodies, bodies.len());
    assert!(largest > 1e-12, "{largest:e}: the step shows nothing but rounding");
    assert!((found.attitude.max / largest - 1.0).abs() < 0.05, "{found} against {largest:e}");
}

#[test]
fn no_step_is_longer_than_asked_for_and_none_is_taken_in_vain() {
    for (dt, steps) in [(0.7, 5), (0.75, 4), (0.1, 30), (3.0, 1), (50.0, 1)] {
        let bodies = [family(Shape::Asymmetric, 0.0)];
        let scene = scene(&bodies).torque(Torque::linear_drag(1e-3)).pinned(Method::Rk4, dt, Some(Precision::F64));
        assert_eq!(run(&scene).trust().body_steps, steps, "{dt} s in {SPAN} s");
    }
}

#[test]
fn free_bodies_among_driven_ones_take_none_of_their_steps() {
    // 90 in 100 are free and of simple shapes, 10 are driven.
    let bodies: Vec<_> = (0..1000).map(|body| family(Shape::ALL[1 + body % 3], 0.0)).collect();
    let drag: Vec<f64> = (0..1000).map(|body| if body % 10 == 0 { 0.05 } else { 0.0 }).collect();
    let mixed = run(&mixed_scene(&bodies, &drag)).trust().body_steps;
    let driven = run(&mixed_scene(&bodies, &[0.05; 1000])).trust().body_steps;
    assert!(mixed * 9 < driven, "{mixed} of {driven} steps");
}

#[test]
fn one_fast_body_does_not_make_the_others_take_its_steps() {
    let mut bodies = vec![family(Shape::Asymmetric, 0.0); 20_000];
    let drag = [1e-3; 20_000];
    let slow = run(&mixed_scene(&bodies, &drag)).trust().body_steps;
    bodies[777].1 *= 300.0;
    let one_fast = run(&mixed_scene(&bodies, &drag)).trust().body_steps;
    assert!(one_fast > slow && one_fast < slow + slow / 5, "{one_fast} against {slow} steps");
}

#[test]
fn members_find_their_rows() {
    let members = Members::Some(vec![2, 3, 7, 11]);
    assert_eq!(members.rows(0..2), 0..0);
    assert_eq!(members.rows(2..4), 0..2);
    assert_eq!(members.rows(4..11), 2..3);
    assert_eq!(members.rows(8..100), 3..4);
    assert_eq!(Members::All(5).rows(3..100), 3..5);
    assert_eq!(Members::All(5).rows(7..100), 5..5);
    let free = Class { shape: Shape::Steady, torques: TorqueSet::default(), is_linear_rotor: false, translates: false };
    assert!(!free.is_driven());
}
