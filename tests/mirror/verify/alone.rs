//! Kernels in which one torque stands alone: every method with each torque, in lanes and on a GPU, where each is a shader of its own.
//!
//! In the grid one kernel with the sum of all torques serves bodies that feel one each, as a shader costs far more to compile than to run.
//! Here there is no sum. In lanes the suite takes every combination; on a GPU one in [`SUITE_PART`] of them, which is every method with some
//! torques and every torque with some methods, in both precisions, and the whole by hand.

use polhode::engine::Engine;
use polhode::math::Precision;
use polhode::scene::AdaptiveSteps;
use polhode::{Method, Torque};

use super::common::torques::{every_torque, middle_moments};
use super::grid::{GRID_DT, GRID_STEPS, follows_slip, grid_scene, measured, within_measured};
use super::{SEED, agreed, common, ramp, steps};

/// Bodies of a combination: draws of the parameters.
const BODIES: usize = 3;
/// One combination in so many.
const SUITE_PART: usize = 6;

/// Every torque that has a strength, and moments that change.
fn torques() -> Vec<Torque> {
    let all = every_torque(&middle_moments(BODIES, SEED));
    let strong =
        all.into_iter().enumerate().filter(|(number, _)| *number != WITHOUT_STRENGTH).map(|(_, torque)| torque);
    strong.chain([ramp()]).collect()
}

/// The constant torque of zero among them.
const WITHOUT_STRENGTH: usize = 1;

/// The torques that a method is compared with in a precision: of those that it follows one in `part`, each method beginning with another.
fn combinations(method: Method, precision: Precision, part: usize) -> Vec<(usize, Torque)> {
    let own = Method::ALL.iter().position(|&other| other == method).expect("it takes equal steps");
    let first = own + if precision == Precision::F32 { 0 } else { part / 2 };
    let followed =
        torques().into_iter().enumerate().filter(|(_, torque)| follows_slip(method) || torque.leaves_rigid());
    followed.filter(|(number, _)| (number + first).is_multiple_of(part)).collect()
}

fn agree_alone(engine: &Engine, method: Method, part: usize) {
    for precision in Precision::ALL {
        for (number, torque) in combinations(method, precision, part) {
            let what = format!("{method} in {precision}, {} alone ({number})", torque.name());
            let scene = grid_scene(std::slice::from_ref(&torque), BODIES, (method, GRID_DT), precision);
            within_measured(engine, &scene, &steps(GRID_STEPS), measured(method, precision), precision, &what);
        }
    }
}

/// One in `part` of the torques that adaptive steps follow, from the `first` on.
fn smooth(first: usize, part: usize) -> impl Iterator<Item = (usize, Torque)> {
    let all = torques().into_iter().enumerate().filter(|(_, torque)| !torque.is_random());
    all.filter(move |(number, _)| (number + first).is_multiple_of(part))
}

fn attempts_agree_alone(engine: &Engine, part: usize) {
    for (first, (precision, tolerance)) in [(Precision::F32, 1e-4), (Precision::F64, 1e-10)].into_iter().enumerate() {
        for (number, torque) in smooth(first * part / 2, part) {
            let what = format!("attempts in {precision}, {} alone ({number})", torque.name());
            let asked = AdaptiveSteps { tolerance, least_step: None };
            let scene = grid_scene(std::slice::from_ref(&torque), BODIES, (Method::Rk8, GRID_DT), precision);
            agreed(engine, &scene.adaptive(asked, Some(precision)), &steps(GRID_STEPS), &what);
        }
    }
}

#[test]
fn attempts_agree_in_lanes() {
    attempts_agree_alone(&Engine::cpu(), 1);
    let asked = AdaptiveSteps { tolerance: 1e-12, least_step: None };
    // Series have no spring whose pull grows as the logarithm.
    for (number, torque) in smooth(0, 1).filter(|(_, torque)| torque.name() != "log-spring") {
        let scene = grid_scene(std::slice::from_ref(&torque), BODIES, (Method::Rk8, GRID_DT), Precision::F64);
        agreed(
            &Engine::cpu(),
            &scene.taylor(asked),
            &steps(GRID_STEPS),
            &format!("series, {} ({number})", torque.name()),
        );
    }
}

#[test]
fn attempts_agree_on_a_gpu() {
    attempts_agree_alone(&common::gpu(), SUITE_PART);
}

/// A test of each method, so that they run side by side. On the CPU engine the twin itself steps the last ones.
macro_rules! alone {
    ($($name:ident: $method:ident,)*; $($scalar:ident: $own:ident,)*) => {
        mod in_lanes {
            use super::*;
            $(#[test]
            fn $name() {
                agree_alone(&Engine::cpu(), Method::$method, 1);
            })*
        }

        mod on_a_gpu {
            use super::*;
            $(#[test]
            fn $name() {
                agree_alone(&common::gpu(), Method::$method, SUITE_PART);
            })*
            $(#[test]
            fn $scalar() {
                agree_alone(&common::gpu(), Method::$own, SUITE_PART);
            })*
        }

        #[test]
        fn every_method_and_every_torque_is_compared_alone() {
            assert_eq!([$(Method::$method,)* $(Method::$own,)*], Method::ALL);
            let names = torques();
            for precision in Precision::ALL {
                let mut methods_of = vec![0; names.len()];
                for method in Method::ALL {
                    let own = combinations(method, precision, SUITE_PART);
                    assert!(own.len() >= 2, "{method} in {precision}: {} torques", own.len());
                    own.iter().for_each(|(number, _)| methods_of[*number] += 1);
                }
                for (torque, count) in names.iter().zip(methods_of) {
                    // What leaves no body rigid is followed by three methods of the twelve.
                    let least = if torque.leaves_rigid() { 2 } else { 0 };
                    assert!(count >= least, "{} in {precision}: {count} methods", torque.name());
                }
            }
            let slipping = |torque: &Torque| !torque.leaves_rigid();
            let of = |method| Precision::ALL.map(|precision| combinations(method, precision, SUITE_PART)).concat();
            let found = Method::ALL.into_iter().flat_map(of).filter(|(_, torque)| slipping(torque)).count();
            assert!(found >= names.iter().filter(|torque| slipping(torque)).count(), "{found}");
        }
    };
}

every_method!(alone);

#[test]
#[ignore = "every combination, some minutes: cargo test --test mirror verify::alone::every_combination -- --ignored --nocapture"]
fn every_combination_agrees() {
    let gpu = common::gpu();
    for method in Method::ALL {
        let clock = std::time::Instant::now();
        agree_alone(&gpu, method, 1);
        println!("TIME {method}: {:.1} s", clock.elapsed().as_secs_f64());
    }
    attempts_agree_alone(&gpu, 1);
}
