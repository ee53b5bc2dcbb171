//! Adaptive steps through the engines: every torque, exact phases, bodies that do not feel their neighbours, flags, counts.

use crate::common;

use common::asymmetric_ensemble;
use common::torques::{every_torque, middle_moments};
use glam::{DQuat, DVec3};
use polhode::bodies::Members;
use polhode::bodies::Status;
use polhode::bodies::columns::StateWords;
use polhode::bodies::{BodyFrame, BodyState};
use polhode::engine::Session;
use polhode::engine::batch::{prepare_members, prepare_with};
use polhode::engine::cpu::Cpu;
use polhode::engine::load_balance::{imbalance, order};
use polhode::engine::{Backend, End, Engine, unobserved};
use polhode::kernel::method::Method;
use polhode::math::Precision;
use polhode::math::Width;
use polhode::scene::AdaptiveSteps;
use polhode::torque::Orbit;
use polhode::{Ensemble, Torque};

const SEED: u64 = 5;
const SPAN: f64 = 6.0;
const COUNT: usize = 67;

fn steps(tolerance: f64) -> AdaptiveSteps {
    AdaptiveSteps { tolerance, least_step: None }
}

/// Every kind of torque that has a meaning between equal steps.
fn torques() -> Vec<Torque> {
    let all = every_torque(&middle_moments(COUNT, SEED));
    all.into_iter().filter(|torque| !torque.is_random()).collect()
}

fn engines() -> [Engine; 3] {
    [Engine::cpu(), Engine::cpu_scalar(), common::gpu()]
}

fn start(
    engine: &Engine,
    members: &Members,
    torques: &[Torque],
    precision: Precision,
    steps: AdaptiveSteps,
) -> (Vec<BodyFrame>, Box<dyn Session>) {
    let ensemble = asymmetric_ensemble(COUNT, SEED);
    let (frames, batch) = prepare_members(&ensemble, torques, SPAN, members, precision).expect("enough memory");
    (frames, engine.start_adaptive(batch, steps).expect("started"))
}

fn all_at(session: &mut dyn Session, times: &[f64]) -> StateWords {
    for &time in times {
        session.advance_to(End::at(time), &mut unobserved).expect("advanced");
    }
    let count = session.body_count();
    session.read(0..count).expect("read")
}

fn in_users_units(words: &StateWords, frames: &[BodyFrame]) -> Vec<BodyState> {
    (0..words.len()).map(|row| frames[row].body_state(words.combined(row))).collect()
}

fn angle(a: DQuat, b: DQuat) -> f64 {
    let between = a.conjugate() * b;
    2.0 * between.xyz().length().atan2(between.w.abs())
}

/// The truth for the bodies under every torque: `rk8` in equal steps of 1/512 s.
fn truth(torques: &[Torque]) -> Vec<BodyState> {
    let (frames, batch) =
        prepare_with(&asymmetric_ensemble(COUNT, SEED), torques, SPAN, Precision::F64).expect("prepared");
    let mut session = Cpu::new(Width::Lanes).start(batch, Method::Rk8).expect("started");
    session.advance_to(End::of_steps(1.0 / 512.0, 6 * 512), &mut unobserved).expect("advanced");
    in_users_units(&session.read(0..COUNT).expect("read"), &frames)
}

#[test]
fn every_torque_is_followed_to_the_tolerance() {
    // Some tens of steps, each off by up to √7 of the tolerance, the angle by twice that; torques pull neighbouring states
    // apart by up to e over some seconds. In f32 rounding of torques' parameters, 6e-8 each, comes on top.
    const GROWTH: f64 = 300.0;
    // The logarithmic spring's torque jumps at half a turn, where no order holds; `golden_forced.rs` has it.
    let torques: Vec<Torque> = torques().into_iter().filter(|torque| torque.name() != "log-spring").collect();
    let truth = truth(&torques);
    for engine in engines() {
        for (precision, tolerance) in [(Precision::F64, 1e-6), (Precision::F64, 1e-10), (Precision::F32, 1e-6)] {
            let (frames, mut session) = start(&engine, &Members::All(COUNT), &torques, precision, steps(tolerance));
            let words = all_at(session.as_mut(), &[0.7, SPAN]);
            assert!(words.status.iter().all(|&status| status == Status::Valid));
            let worst = in_users_units(&words, &frames)
                .iter()
                .zip(&truth)
                .map(|(state, truth)| angle(state.orientation, truth.orientation))
                .fold(0.0, f64::max);
            println!("{precision} at {tolerance:e}: {worst:.1e} rad");
            assert!(worst <= GROWTH * tolerance, "{precision} at {tolerance:e}: {worst:e} rad");
        }
    }
}

#[test]
fn a_body_feels_neither_its_neighbours_nor_cuts() {
    for engine in engines() {
        for precision in Precision::ALL {
            let (_, mut session) = start(&engine, &Members::All(COUNT), &torques(), precision, steps(1e-6));
            let together = all_at(session.as_mut(), &[1.1, SPAN]);
            let counts = session.counts().expect("counted");
            // Backwards, so that each stands in another lane of another block, and some alone.
            let backwards: Vec<u32> = (0..COUNT as u32).rev().collect();
            for list in [backwards, vec![3], vec![66, 1, 20]] {
                let members = Members::Some(list);
                let (_, mut session) = start(&engine, &members, &torques(), precision, steps(1e-6));
                let words = all_at(session.as_mut(), &[1.1, SPAN]);
                let own = session.counts().expect("counted");
                for (row, own) in own.iter().enumerate() {
                    let body = members.body(row);
                    assert_eq!(words.value[row], together.value[body], "{precision}, body {body}");
                    assert_eq!(words.residue_of(row), together.residue_of(body), "{precision}, body {body}");
                    assert_eq!(*own, counts[body], "{precision}, body {body}");
                }
            }
        }
    }
}

/// A body about its middle axis, under I ω' = s sin Ωt − c ω: after some I/c the initial state is forgotten, and
/// ω = s (c sin Ωt − I Ω cos Ωt)/(c² + I² Ω²).
#[test]
fn phases_stay_exact_over_twenty_thousand_turns_in_one_interval() {
    const TURNS: f64 = 2e4;
    let (inertia, strength, drag) = (2.0, 0.8, 0.5);
    // 2π/Ω is no machine number, so the rates' digits matter.
    let rate = 17.3;
    let time = TURNS * std::f64::consts::TAU / rate;
    let ensemble = Ensemble::from_columns(&[DVec3::new(1.0, inertia, 2.5)], &[DQuat::IDENTITY], &[DVec3::ZERO])
        .expect("a valid body");
    let torques = [Torque::sinusoidal(DVec3::new(0.0, strength, 0.0), DVec3::ZERO, rate), Torque::linear_drag(drag)];
    // Ω t in two words: the product's rounding alone would be 1e-10 rad.
    let phase = {
        let (high, low) = (rate * time, rate.mul_add(time, -(rate * time)));
        (high % std::f64::consts::TAU) + low
            // What the turns lack by the rounding of 2π itself.
            - (high / std::f64::consts::TAU).floor() * 2.449_293_598_294_706_4e-16
    };
    let expected = strength * (drag * phase.sin() - inertia * rate * phase.cos())
        / (drag * drag + inertia * inertia * rate * rate);
    let amplitude = strength / (inertia * rate);
    for engine in engines() {
        // A step is off by up to √7 of the tolerance, and the I/c = 4 s that are not forgotten have some 40 of them. A phase formed from a
        // rounded time would be wrong by 6e-8 of the turns in f32, 8e-3 rad.
        for (precision, tolerance, bound) in [(Precision::F64, 1e-10, 1e-8), (Precision::F32, 1e-6, 1e-4)] {
            let (frames, batch) = prepare_with(&ensemble, &torques, time, precision).expect("prepared");
            let mut session = engine.start_adaptive(batch, steps(tolerance)).expect("started");
            let words = all_at(session.as_mut(), &[time]);
            assert_eq!(words.status[0], Status::Valid);
            let state = frames[0].body_state(words.combined(0));
            let error = (state.angular_velocity_body.y - expected).abs() / amplitude;
            println!("{precision}: {error:.1e} of the amplitude, {:?}", session.counts().expect("counted")[0]);
            assert!(error <= bound, "{precision}: {error:e} of the amplitude");
        }
    }
}

#[test]
fn a_flagged_body_does_not_stop_the_others() {
    let moments = DVec3::new(1.0, 2.0, 2.5);
    let run = |engine: &Engine, precision, [spin, drag]: [f64; 2], keep: &dyn Fn(usize) -> bool| {
        let kept: Vec<usize> = (0..COUNT).filter(|&body| keep(body)).collect();
        let of = |row: usize, of_one: f64, of_others: f64| if kept[row] == 20 { of_one } else { of_others };
        let omega = |row| DVec3::new(1.0, 0.4, 0.1) * of(row, spin, 1.0 + 0.01 * kept[row] as f64);
        let ensemble =
            Ensemble::from_fn(kept.len(), |row| (moments, DQuat::IDENTITY, omega(row))).expect("valid bodies");
        let drag: Vec<f64> = (0..kept.len()).map(|row| of(row, drag, 0.01)).collect();
        let (_, batch) = prepare_with(&ensemble, &[Torque::quadratic_drag(drag)], SPAN, precision).expect("prepared");
        let steps = AdaptiveSteps { tolerance: 1e-6, least_step: Some(1e-3) };
        let mut session = engine.start_adaptive(batch, steps).expect("started");
        let words = all_at(session.as_mut(), &[SPAN]);
        (words, session.counts().expect("counted"))
    };
    for engine in engines() {
        // Spins of 1 rad/s take steps of about 0.3 s, one of 1e4 rad/s would need 3e-5 s; a drag of 1e30 makes each attempt overflow.
        let cases = [[1e4, 0.01], [1.0, 1e30]];
        for (precision, case) in Precision::ALL.into_iter().flat_map(|precision| cases.map(|case| (precision, case))) {
            let (with, counts) = run(&engine, precision, case, &|_| true);
            let (without, _) = run(&engine, precision, case, &|body| body != 20);
            for (body, counts) in counts.iter().enumerate() {
                if body == 20 {
                    assert_eq!(with.status[body], Status::StepBelowLimit);
                    assert!(counts.attempts() < 100, "{counts:?}");
                } else {
                    let row = body - usize::from(body > 20);
                    assert_eq!(with.status[body], Status::Valid);
                    assert_eq!(with.value[body], without.value[row], "body {body}");
                }
            }
        }
    }
}

#[test]
fn counts_add_up_and_order_balances_lanes() {
    let engine = Cpu::new(Width::Lanes);
    let ensemble = asymmetric_ensemble(COUNT, SEED);
    let (_, batch) = prepare_with(&ensemble, &[], SPAN, Precision::F64).expect("prepared");
    let mut session = engine.start_adaptive(batch, steps(1e-9)).expect("started");
    session.advance_to(End::at(0.5 * SPAN), &mut unobserved).expect("advanced");
    let half = session.counts().expect("counted");
    session.advance_to(End::at(SPAN), &mut unobserved).expect("advanced");
    let whole = session.counts().expect("counted");
    for (half, whole) in half.iter().zip(&whole) {
        assert!(half.accepted > 0 && whole.accepted > half.accepted && whole.rejected >= half.rejected);
        assert_eq!(whole.attempts(), whole.accepted + whole.rejected);
    }
    let spins: Vec<f64> = ensemble.angular_velocity_body().iter().map(|omega| omega.length()).collect();
    let work: Vec<u64> = whole.iter().map(|counts| counts.attempts()).collect();
    let ordered: Vec<u64> = order(&spins).into_iter().map(|body| work[body]).collect();
    let lanes = session.side_by_side();
    let (before, after) = (imbalance(&work, lanes), imbalance(&ordered, lanes));
    println!("imbalance in {lanes} lanes: {before:.3} as they come, {after:.3} in order");
    assert!(after <= before);
}

#[test]
fn what_cannot_be_asked_of_adaptive_steps_is_refused() {
    let engine = Cpu::new(Width::Lanes);
    let ensemble = asymmetric_ensemble(3, SEED);
    let refusal = |torques: &[Torque], precision, steps| {
        let (_, batch) = prepare_with(&ensemble, torques, SPAN, precision).expect("prepared");
        engine.start_adaptive(batch, steps).err().expect("refused").to_string()
    };
    let message = refusal(&[], Precision::F32, steps(1e-9));
    assert_eq!(
        message,
        "tolerance = 1e-9: rounding in f32 hides smaller errors than 1e-6: use 1e-6 or more, or precision f64"
    );
    assert!(refusal(&[], Precision::F64, steps(1e-16)).contains("2e-15 or more"));
    assert!(refusal(&[], Precision::F64, steps(1.0)).contains("below 1"));
    let least = AdaptiveSteps { tolerance: 1e-6, least_step: Some(0.0) };
    assert!(refusal(&[], Precision::F64, least).contains("above zero (s)"));
    let noise = refusal(&[Torque::white_noise(0.1, 7)], Precision::F64, steps(1e-6));
    assert!(noise.contains("white-noise") && noise.contains("equal length"), "{noise}");
}

/// Steps a second beside those of `rk8` in equal steps of about the same size, with the error of each.
#[test]
#[ignore = "a measurement: run with --nocapture, on a quiet machine"]
fn steps_a_second() {
    const BODIES: usize = 4096;
    const SPAN: f64 = 100.0;
    let ensemble = asymmetric_ensemble(BODIES, SEED);
    let moments = middle_moments(BODIES, SEED);
    let scaled = |size: f64| moments.iter().map(|i| i * size).collect::<Vec<f64>>();
    let vectors = |size: f64| moments.iter().map(|i| DVec3::new(0.5, -0.3, 0.4) * (i * size)).collect::<Vec<_>>();
    let rates: Vec<f64> = (0..BODIES).map(|body| 1.0 + body as f64 / BODIES as f64).collect();
    let scenes = [
        ("free", vec![]),
        ("constant, drag", vec![Torque::constant_body(vectors(0.2)), Torque::linear_drag(scaled(0.1))]),
        ("sinusoid", vec![Torque::sinusoidal(vectors(0.5), DVec3::ZERO, 1.75)]),
        ("sinusoid of each", vec![Torque::sinusoidal(vectors(0.5), DVec3::ZERO, rates)]),
        ("gravity gradient", vec![Torque::gravity_gradient(Orbit::circular(1.0, 1.3))]),
    ];
    let engine = Cpu::new(Width::Lanes);
    for (name, torques) in &scenes {
        let prepare = |precision| prepare_with(&ensemble, torques, SPAN, precision).expect("prepared");
        let (frames, batch) = prepare(Precision::F64);
        let mut session = engine.start(batch, Method::Rk8).expect("started");
        session.advance_to(End::of_steps(1.0 / 32.0, 3200), &mut unobserved).expect("advanced");
        let truth = in_users_units(&session.read(0..BODIES).expect("read"), &frames);
        let report = |kind: &str, precision, attempts: u64, seconds: f64, words: StateWords| {
            let mut errors: Vec<f64> = in_users_units(&words, &frames)
                .iter()
                .zip(&truth)
                .map(|(state, truth)| angle(state.orientation, truth.orientation))
                .collect();
            errors.sort_by(f64::total_cmp);
            let (median, p99) = (errors[BODIES / 2], errors[BODIES * 99 / 100]);
            println!(
                "{name:<17} {precision} {kind:<16} {attempts:>9} steps {seconds:>8.4} s {:>9.2e}/s, error {median:.1e}, p99 {p99:.1e}",
                attempts as f64 / seconds
            );
        };
        for precision in Precision::ALL {
            let mut session = engine.start(prepare(precision).1, Method::Rk8).expect("started");
            let clock = std::time::Instant::now();
            session.advance_to(End::of_steps(0.25, 400), &mut unobserved).expect("advanced");
            let seconds = clock.elapsed().as_secs_f64();
            report("dt 0.25", precision, 400 * BODIES as u64, seconds, session.read(0..BODIES).expect("read"));
            for tolerance in [1e-6, 1e-9] {
                if precision == Precision::F32 && tolerance < 1e-6 {
                    continue;
                }
                let mut session = engine.start_adaptive(prepare(precision).1, steps(tolerance)).expect("started");
                let clock = std::time::Instant::now();
                session.advance_to(End::at(SPAN), &mut unobserved).expect("advanced");
                let seconds = clock.elapsed().as_secs_f64();
                let attempts = session.counts().expect("counted").iter().map(|counts| counts.attempts()).sum();
                let words = session.read(0..BODIES).expect("read");
                report(&format!("tolerance {tolerance:e}"), precision, attempts, seconds, words);
            }
        }
    }
}

#[test]
fn a_pool_of_one_thread_and_of_three_give_the_same_bits() {
    for precision in Precision::ALL {
        let run = || {
            let (_, mut session) =
                start(&Engine::cpu(), &Members::All(COUNT), &torques(), precision, steps(TOLERANCE_OF_POOLS));
            let words = all_at(&mut *session, &[0.5 * SPAN, SPAN]);
            (words, session.counts().expect("counts"))
        };
        let expected = run();
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            assert_eq!(pool.install(run), expected, "{precision}, {threads} threads");
        }
    }
}

/// Within the reach of `f32`.
const TOLERANCE_OF_POOLS: f64 = 1e-5;

/// The CPU's slices are of 8,192 attempts: what is left of a block is taken up again behind more bodies that have arrived than a
/// tile has lanes. Of one thread, so that a block has as many bodies on any machine.
#[test]
fn bodies_that_need_many_slices_arrive_behind_bodies_that_have() {
    const BODIES: usize = 400;
    const LONG: [usize; 2] = [370, 399];
    const END: f64 = 240.0;
    let row = |body: usize| {
        let rate = if LONG.contains(&body) { 60.0 } else { 0.01 };
        (DVec3::new(1.0, 1.5, 2.0), DQuat::IDENTITY, DVec3::new(0.6, 0.5, 0.4) * rate)
    };
    // Lanes under internal dissipation change bodies all together, those under drag one by one.
    for torque in [Torque::internal_dissipation(1e-9), Torque::quadratic_drag(1e-9)] {
        let run = |count: usize, row: &dyn Fn(usize) -> (DVec3, DQuat, DVec3)| {
            let ensemble = Ensemble::from_columns(
                &(0..count).map(|body| row(body).0).collect::<Vec<_>>(),
                &(0..count).map(|body| row(body).1).collect::<Vec<_>>(),
                &(0..count).map(|body| row(body).2).collect::<Vec<_>>(),
            );
            let torques = [torque.clone()];
            let (_, batch) = prepare_with(&ensemble.expect("valid"), &torques, END, Precision::F64).expect("prepared");
            let mut session = Engine::cpu().start_adaptive(batch, steps(1e-12)).expect("started");
            session.advance_to(End::at(END), &mut unobserved).expect("advanced");
            (session.read(0..count).expect("read"), session.counts().expect("counted"))
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
        let (words, counts) = pool.install(|| run(BODIES, &row));
        let (alone, _) = run(1, &|_| row(LONG[0]));
        for body in LONG {
            assert!(counts[body].attempts() > 3 * 8192, "{}: {:?}", torque.name(), counts[body]);
            assert_eq!(words.combined(body), alone.combined(0), "{}, body {body}", torque.name());
        }
    }
}

/// A round on a device is three dispatches. Of bodies that need no more attempts than one round has, an interval is one round, from the
/// second on, which is expected to be as the first; and what was not expected is done all the same.
#[test]
fn a_device_is_asked_for_no_more_rounds_than_the_last_interval_took() {
    let gpu = common::own_gpu();
    let row = (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::new(0.3, 1.0, -0.2));
    let ensemble = Ensemble::from_fn(COUNT, |_| row).expect("valid");
    for precision in Precision::ALL {
        let (_, batch) = prepare_with(&ensemble, &[], 1e4, precision).expect("prepared");
        let mut session = gpu.start_adaptive(batch, steps(1e-5)).expect("started");
        let (mut time, mut attempts) = (0.0, 0);
        let mut advance = |span: f64| {
            let before = gpu.traffic();
            time += span;
            session.advance_to(End::at(time), &mut unobserved).expect("advanced");
            let all = session.counts().expect("counted")[0].attempts();
            let made = all - std::mem::replace(&mut attempts, all);
            (made, gpu.traffic().since(before).dispatches)
        };
        advance(1.0);
        for _ in 0..5 {
            let (made, dispatches) = advance(1.0);
            assert!(made <= 8 && dispatches == 3, "{precision}: {made} attempts in {dispatches} dispatches");
        }
        // Rounds of 8, 8, 16, 32 attempts, as many as its length lets expect, and perhaps one more submission.
        let (made, dispatches) = advance(100.0);
        assert!(made > 16 && (9..=36).contains(&dispatches), "{precision}: {made} attempts in {dispatches} dispatches");
        assert_eq!(advance(1.0).1, 3, "{precision}");
    }
}
