//! Bodies computed alone: as in the run, to the bit, and more accurately.

use glam::{DQuat, DVec3};
use polhode::run::{StateError, alone, replay};
use polhode::{Engine, Ensemble, Error, Method, Outputs, Plan, Precision, Scene, Torque};

const BODIES: usize = 40;

fn bodies(count: usize) -> Ensemble {
    let row = |body: usize| {
        let spin = 0.3 + 0.01 * body as f64;
        (DVec3::new(1.0, 1.7, 2.2), DQuat::IDENTITY, DVec3::new(0.48, 0.6, 0.64) * spin)
    };
    Ensemble::from_fn(count, row).expect("valid")
}

/// Free, driven and random bodies.
fn scenes() -> [Scene; 4] {
    let column: Vec<f64> = (0..BODIES).map(|body| 0.01 * (1.0 + (body % 3) as f64)).collect();
    let scene = || Scene::new(bodies(BODIES)).until(7.0).outputs(Outputs::Every(2.0));
    [
        scene(),
        scene().torque(Torque::linear_drag(column)),
        scene().torque(Torque::constant_world(DVec3::X)).skipping(false),
        scene().torque(Torque::white_noise(0.01, 5)).pinned(Method::Rk4, 0.125, Some(Precision::F64)),
    ]
}

#[test]
fn a_body_alone_has_the_bits_that_it_has_among_others() {
    let engine = Engine::cpu();
    for scene in scenes() {
        let plan = Plan::new(&scene, &engine).expect("a plan");
        let record = engine.run(&plan).expect("runs");
        for body in [0, 17, BODIES - 1] {
            let alone = alone(&engine, &plan, body).expect("runs");
            assert_eq!(alone.len(), record.snapshots().len());
            for ((time, state), snapshot) in alone.iter().zip(record.snapshots()) {
                let bits =
                    |q: DQuat, omega: DVec3| (q.to_array().map(f64::to_bits), omega.to_array().map(f64::to_bits));
                let among = bits(snapshot.orientation(body), snapshot.angular_velocity_body(body));
                let own = bits(state.rotation.orientation, state.rotation.angular_velocity_body);
                assert_eq!((*time, own), (snapshot.time(), among), "body {body}");
            }
        }
    }
}

#[test]
fn a_replay_is_as_near_to_the_run_as_was_asked_for_and_tells_another_body() {
    let engine = Engine::cpu();
    for (index, scene) in scenes().into_iter().enumerate() {
        let plan = Plan::new(&scene, &engine).expect("a plan");
        let own = replay(&plan, 17, 101).expect("replays");
        let is_random = index == 3;
        assert_eq!(own.track.len(), if is_random { 4 } else { 101 + 3 });
        assert!(own.track.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert_eq!(own.own_error.is_none(), is_random);
        assert!(own.own_error.is_none_or(|error| error.attitude < 1e-11), "{:?}", own.own_error);
        let errors = |body: usize| -> Vec<f64> {
            let alone = alone(&engine, &plan, body).expect("runs");
            let at = |time: f64| own.track.iter().find(|(other, _)| *other == time).expect("an output time").1;
            alone.iter().map(|(time, state)| StateError::between(state, &at(*time)).attitude).collect()
        };
        let asked = if is_random { 1e-5 } else { 3e-6 };
        assert!(errors(17).iter().all(|&error| error < asked), "scene {index}: {:?}", errors(17));
        assert!(errors(18).iter().any(|&error| error > 100.0 * asked), "scene {index}: {:?}", errors(18));
    }
    let scene = &scenes()[0];
    let plan = Plan::new(scene, &engine).expect("a plan");
    assert!(matches!(replay(&plan, BODIES, 3), Err(Error::Setting { field: "body", .. })));
}
