//! The same work gives the same bits, however it is cut and whatever stands beside a body.

use crate::common;

use common::compare::first_bit_difference;
use polhode::bodies::Ensemble;
use polhode::bodies::columns::StateWords;
use polhode::engine::batch::{AnyBatch, Batch, prepare};
use polhode::engine::{End, Engine, unobserved};
use polhode::kernel::method::Method;
use polhode::math::Precision;
use polhode::math::real::Scalar;

const DT: f64 = 1.0 / 64.0;
const STEPS: u64 = 40;

fn engines() -> [(&'static str, Engine); 3] {
    [("gpu", common::gpu()), ("cpu", Engine::cpu()), ("cpu, scalar", Engine::cpu_scalar())]
}

fn assert_same_bits(what: &str, expected: &StateWords, found: &StateWords) {
    if let Some(difference) = first_bit_difference(expected, found) {
        panic!("{what}: {difference}");
    }
}

fn variants() -> impl Iterator<Item = (Precision, Method)> {
    Precision::ALL.into_iter().flat_map(|precision| Method::ALL.map(|method| (precision, method)))
}

#[test]
fn the_same_run_gives_the_same_bits_twice() {
    for (name, engine) in engines() {
        for (precision, method) in variants() {
            let batch = common::asymmetric_batch(203, 21, precision);
            let runs = [(); 2].map(|()| common::advanced(&engine, &batch, method, DT, STEPS));
            assert_same_bits(&format!("{name} {precision} {method}"), &runs[0], &runs[1]);
        }
    }
}

#[test]
fn opening_the_adapter_anew_gives_the_same_bits() {
    let batch = common::asymmetric_batch(203, 21, Precision::F32);
    let runs = [(); 2].map(|()| common::advanced(&common::own_gpu(), &batch, Method::Rk4, DT, STEPS));
    assert_same_bits("two devices", &runs[0], &runs[1]);
}

/// Some bodies of a batch as a batch of their own.
fn picked<T: Scalar>(batch: &Batch<T>, bodies: std::ops::Range<usize>) -> Batch<T> {
    let mut picked = Batch::<T>::at_rest(bodies.len());
    let columns = [(&batch.parameters, &mut picked.parameters), (&batch.state, &mut picked.state)];
    for (from, to) in columns {
        for (from, to) in from.chunks_exact(batch.stride).zip(to.chunks_exact_mut(picked.stride)) {
            to[..bodies.len()].copy_from_slice(&from[bodies.clone()]);
        }
    }
    picked
}

fn picked_any(batch: &AnyBatch, bodies: std::ops::Range<usize>) -> AnyBatch {
    match batch {
        AnyBatch::F32(batch) => AnyBatch::F32(picked(batch, bodies)),
        AnyBatch::F64(batch) => AnyBatch::F64(picked(batch, bodies)),
    }
}

#[test]
fn a_body_alone_gives_the_same_bits_as_in_a_crowd() {
    // Chunks of 64 and of 128 bodies: both sides of every border, the first and the last body.
    let count = 64 * 5 + 7;
    let alone = [0, 1, 31, 62, 63, 64, 65, 127, 128, 129, 255, 256, count - 8, count - 7, count - 1];
    let cut = [("chunks of 64", 64), ("chunks of 128", 128)]
        .map(|(name, bodies)| (name, common::gpu_with(common::cut_options(bodies, u32::MAX))));
    for (precision, method) in variants() {
        let batch = common::asymmetric_batch(count, 22, precision);
        for (name, engine) in engines().iter().chain(&cut) {
            let crowd = common::advanced(engine, &batch, method, DT, STEPS);
            for body in alone {
                let single = common::advanced(engine, &picked_any(&batch, body..body + 1), method, DT, STEPS);
                let what = format!("{name} {precision} {method}, body {body} alone");
                assert_same_bits(&what, &crowd.part(body..body + 1), &single);
            }
            let crowd_of_middle = common::advanced(engine, &picked_any(&batch, 37..171), method, DT, STEPS);
            assert_same_bits(&format!("{name} {precision} {method}, part"), &crowd.part(37..171), &crowd_of_middle);
        }
    }
}

/// What follows from the time is formed once for the bodies of a tile that have it in common, and for the tiles behind it. Where one body
/// of each tile differs it is formed for each; the others must not notice.
#[test]
fn what_is_shared_is_what_each_body_would_have_formed() {
    use glam::DVec3;
    use polhode::torque::{Orbit, Parameters, Torque};
    // Blocks of several tiles, and orbits that change after every few of these.
    const COUNT: usize = 64 * 64 + 5;
    const ALIKE: usize = 128;
    // As many bodies as a tile has at the least.
    const TILE: usize = 16;
    let is_odd = |body: usize| body % TILE == TILE - 1;
    let torques = |odd: f64| {
        let own = |body: usize, number: f64| if is_odd(body) { number + odd } else { number };
        let column = |first: f64, second: f64| -> Vec<f64> {
            (0..COUNT).map(|body| own(body, if body / ALIKE % 2 == 1 { second } else { first })).collect()
        };
        let text = "cross(vec(0.3, 0.2 * cos(a * time), 0.1 * exp(-a * time)), to_body(vec(1, 0, sin(2 * time))))";
        let parameters = Parameters::new().number("a", column(0.7, 0.9)).expect("a name");
        let amplitude: Vec<DVec3> = column(0.2, 0.4).into_iter().map(|x| DVec3::new(x, 0.1, -0.3)).collect();
        [
            vec![Torque::gravity_gradient(Orbit::kepler(1.3, 2.0, column(0.3, 0.6)).inclined(0.4))],
            vec![Torque::custom(text, parameters).expect("a formula")],
            vec![
                Torque::sinusoidal(amplitude, DVec3::new(0.1, 0.0, 0.2), 1.75),
                Torque::gravity_gradient(Orbit::kepler(1.1, 1.8, column(0.2, 0.5))),
                Torque::orbiting_dipole(
                    DVec3::new(0.1, 0.2, 0.3),
                    Orbit::kepler(1.0, column(1.5, 1.7), 0.3),
                    1.0,
                    2.97,
                    0.2,
                    0.5,
                ),
            ],
        ]
    };
    let engine = Engine::cpu();
    for (shared, unlike) in torques(0.0).iter().zip(&torques(0.01)) {
        for precision in Precision::ALL {
            for method in [Method::Rk4, Method::Rk8, Method::Cf4] {
                let [shared, unlike] = [shared, unlike].map(|torques| {
                    let batch = common::torques::batch_under(COUNT, 28, torques, precision);
                    common::advanced(&engine, &batch, method, DT, STEPS)
                });
                let mut are_unlike = 0;
                for body in 0..COUNT {
                    let (shared, unlike) = (shared.part(body..body + 1), unlike.part(body..body + 1));
                    if is_odd(body) {
                        are_unlike += usize::from(first_bit_difference(&shared, &unlike).is_some());
                    } else {
                        assert_same_bits(&format!("{precision} {method}, body {body}"), &shared, &unlike);
                    }
                }
                assert_eq!(are_unlike, COUNT / TILE, "{precision} {method}: the others are moved otherwise");
            }
        }
    }
}

#[test]
fn results_do_not_depend_on_where_chunks_and_slices_are_cut() {
    let whole = common::gpu();
    let count = 64 * 5 + 7;
    let cut = [(64, u32::MAX), (128, 7), (64, 1), (192, 39)]
        .map(|(bodies, steps)| (bodies, steps, common::gpu_with(common::cut_options(bodies, steps))));
    for (precision, method) in variants() {
        let batch = common::asymmetric_batch(count, 23, precision);
        let expected = common::advanced(&whole, &batch, method, DT, STEPS);
        for (bodies, steps, engine) in &cut {
            let found = common::advanced(engine, &batch, method, DT, STEPS);
            assert_same_bits(&format!("{precision} {method}: {bodies} bodies, {steps} steps"), &expected, &found);
        }
    }
}

#[test]
fn results_do_not_depend_on_how_steps_are_cut_into_calls() {
    for (name, engine) in engines() {
        for (precision, method) in variants() {
            let batch = common::asymmetric_batch(70, 24, precision);
            let expected = common::advanced(&engine, &batch, method, DT, STEPS);
            let mut session = engine.start(batch, method).expect("started");
            for steps in [1, 0, 12, 3, STEPS - 16] {
                session.advance_to(End::of_steps(DT, steps), &mut unobserved).expect("advanced");
                session.read(0..1).expect("read");
            }
            let found = session.read(0..70).expect("read");
            assert_same_bits(&format!("{name} {precision} {method}"), &expected, &found);
        }
    }
}

#[test]
fn every_size_of_ensemble_is_integrated_whole() {
    let cut = ("gpu, chunks of 64", common::gpu_with(common::cut_options(64, 16)));
    for (name, engine) in engines().iter().chain([&cut]) {
        for precision in Precision::ALL {
            // None, one, around a workgroup and a stride, several chunks.
            for count in [0, 1, 63, 64, 65, 127, 128, 129, 1000] {
                let batch = common::asymmetric_batch(count, 25, precision);
                let found = common::advanced(engine, &batch, Method::Rk4, DT, STEPS);
                assert_eq!(found.len(), count, "{name} {precision}");
                let twin = common::advanced(&Engine::cpu_scalar(), &batch, Method::Rk4, DT, STEPS);
                let largest = match precision {
                    // A body that was not advanced, or another's state, is off by far more than this; the last bits
                    // are the business of parity.rs.
                    Precision::F32 => common::compare::compare_states::<f32>(&twin, &found, 1e3),
                    Precision::F64 => common::compare::compare_states::<f64>(&twin, &found, 1e3),
                };
                largest.unwrap_or_else(|mismatch| panic!("{name} {precision}, {count} bodies: {mismatch}"));
            }
        }
    }
}

#[test]
fn more_bodies_than_one_chunk_by_default_hold_give_the_same_bits() {
    let count = (1 << 16) + 1;
    let batch = common::asymmetric_batch(count, 26, Precision::F32);
    let gpu = common::gpu();
    let crowd = common::advanced(&gpu, &batch, Method::Rk4, DT, 3);
    for body in [0, (1 << 16) - 1, 1 << 16] {
        let single = common::advanced(&gpu, &picked_any(&batch, body..body + 1), Method::Rk4, DT, 3);
        assert_same_bits(&format!("body {body}"), &crowd.part(body..body + 1), &single);
    }
}

#[test]
fn any_range_can_be_read() {
    let engine = common::gpu_with(common::cut_options(64, u32::MAX));
    for precision in Precision::ALL {
        let mut session = engine.start(common::asymmetric_batch(200, 27, precision), Method::Dlm).expect("started");
        session.advance_to(End::of_steps(DT, 5), &mut unobserved).expect("advanced");
        let all = session.read(0..200).expect("read");
        for range in [0..0, 0..1, 63..65, 64..128, 1..199, 130..200, 200..200] {
            let found = session.read(range.clone()).expect("read");
            assert_same_bits(&format!("{precision} {range:?}"), &all.part(range), &found);
        }
    }
}

#[test]
fn an_upload_comes_back_to_the_bit() {
    let ensemble: Ensemble = common::asymmetric_ensemble(203, 28);
    for precision in Precision::ALL {
        let (_, batch) = prepare(&ensemble, precision).expect("prepared");
        let expected = match &batch {
            AnyBatch::F32(batch) => batch.read(0..203),
            AnyBatch::F64(batch) => batch.read(0..203),
        };
        let mut session = common::gpu().start(batch, Method::Rk4).expect("started");
        assert_same_bits(precision.name(), &expected, &session.read(0..203).expect("read"));
    }
}

#[test]
fn a_pool_of_one_thread_and_of_three_give_the_same_bits() {
    let batch = common::asymmetric_batch(203, 21, Precision::F32);
    let expected = common::advanced(&Engine::cpu(), &batch, Method::Rk4, DT, STEPS);
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let found = pool.install(|| common::advanced(&Engine::cpu(), &batch, Method::Rk4, DT, STEPS));
        assert_same_bits(&format!("{threads} threads"), &expected, &found);
    }
}
