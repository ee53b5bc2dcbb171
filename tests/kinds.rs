//! The kernels of a single kind of torque against the one of every kind: the same steps, to the bit.

mod common;

use common::torques::{batch_under, every_torque, middle_moments};
use glam::DVec3;
use polhode::Method;
use polhode::batch::{Precision, StateWords};
use polhode::engine::adaptive::AdaptiveSteps;
use polhode::engine::{Backend, Engine, unobserved};
use polhode::torque::Torque;
use polhode::torque::variable_inertia::{InertiaChange, Law};

const BODIES: usize = 67;
const SEED: u64 = 31;
const STEPS: u64 = 50;
const DT: f64 = 0.02;

/// The torques as they are, and with a second kind that does nothing, which leads to the kernel of every kind.
fn both(torque: &Torque) -> [Vec<Torque>; 2] {
    let nothing = match torque.name() {
        "constant-world" => Torque::heavy_top(0.0, DVec3::ZERO, DVec3::ZERO),
        _ => Torque::constant_world(DVec3::ZERO),
    };
    [vec![torque.clone()], vec![torque.clone(), nothing]]
}

fn stepped(torques: &[Torque], method: Method, precision: Precision) -> StateWords {
    let batch = batch_under(BODIES, SEED, torques, precision);
    let mut session = Engine::cpu().start(batch, method).expect("started");
    session.advance(DT, STEPS, &mut unobserved).expect("advanced");
    session.read(0..BODIES).expect("read")
}

fn adapted(torques: &[Torque], precision: Precision) -> StateWords {
    let batch = batch_under(BODIES, SEED, torques, precision);
    let steps = AdaptiveSteps { tolerance: 1e-6, least_step: None };
    let mut session = Engine::cpu().start_adaptive(batch, steps).expect("started");
    session.advance_to(DT * STEPS as f64, &mut unobserved).expect("advanced");
    session.read(0..BODIES).expect("read")
}

#[test]
fn one_kind_alone_is_stepped_as_among_others() {
    let mut torques = every_torque(&middle_moments(BODIES, SEED));
    let column = |first: f64, last: f64| -> Vec<f64> {
        (0..BODIES).map(|body| first + (last - first) * body as f64 / BODIES as f64).collect()
    };
    let changes = [
        (InertiaChange::factor(0.6), Law::ramp(0.1, 0.5)),
        (InertiaChange::factor(column(0.5, 2.0)), Law::ramp(column(0.0, 0.6), column(0.2, 1.0))),
        (InertiaChange::factor(column(0.5, 2.0)), Law::oscillation(column(-3.0, 3.0))),
    ];
    torques.extend(changes.map(|(change, law)| Torque::variable_inertia(change, law)));
    // A constant torque and drag have a kernel that takes both, whose kicks are others.
    let is_common = |torque: &&Torque| ["constant-body", "linear-drag"].contains(&torque.name());
    for torque in torques.iter().filter(|torque| !is_common(torque)) {
        for precision in Precision::ALL {
            let [alone, among] = both(torque);
            for method in [Method::Rk4, Method::Rk8, Method::Cf4] {
                let is_same = stepped(&alone, method, precision) == stepped(&among, method, precision);
                assert!(is_same, "{} by {method} in {precision}", torque.name());
            }
            if !torque.is_random() {
                let is_same = adapted(&alone, precision) == adapted(&among, precision);
                assert!(is_same, "{} in adaptive steps in {precision}", torque.name());
            }
        }
    }
}
