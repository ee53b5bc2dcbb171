//! Statistics of an ensemble, formed where its states are, against those of the states read back, in exact arithmetic as far
//! as `f64` goes.

use crate::common;

use glam::{DQuat, DVec3};
use polhode::bodies::BodyState;
use polhode::bodies::Status;
use polhode::bodies::columns::StateWords;
use polhode::engine::batch::prepare;
use polhode::engine::gpu::{GpuOptions, Patch};
use polhode::engine::reduction::BlockRows;
use polhode::engine::{End, Engine, Session, unobserved};
use polhode::kernel::free_motion::AnyRows;
use polhode::kernel::observe::{Partial, error_bound};
use polhode::math::Precision;
use polhode::{Ensemble, Method, Result, Statistic};

use common::measured::{MEASURED_TIMES, is_measured, over_seeds, stays_within_measured};
use common::random::Random;

/// Statistics that are formed from states read back are compensated sums: right to a few ulp.
const HOST: f64 = 1e-15;

/// What the states of some bodies say, by compensated summation (Neumaier 1974) of every one.
#[derive(Debug)]
struct Expected {
    mean: f64,
    deviation: f64,
    root_mean_square: f64,
    values: Vec<Option<f64>>,
}

fn sum(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut lost) = (0.0_f64, 0.0);
    for x in values {
        let next = sum + x;
        lost += if sum.abs() >= x.abs() { (sum - next) + x } else { (x - next) + sum };
        sum = next;
    }
    sum + lost
}

fn is_sound(state: &BodyState) -> bool {
    state.orientation.is_finite() && state.angular_velocity_body.is_finite() && state.status == Status::Valid
}

fn expected(states: &[BodyState], statistic: Statistic) -> Expected {
    let values: Vec<_> = states.iter().map(|state| is_sound(state).then(|| statistic.of(state))).collect();
    let sound = || values.iter().flatten().copied();
    let count = sound().count() as f64;
    // Scaled so that squares of energies of planets are numbers.
    let unit = sound().fold(f64::MIN_POSITIVE, f64::max);
    let mean = sum(sound().map(|x| x / unit)) / count;
    let deviation = (sum(sound().map(|x| (x / unit - mean).powi(2))) / count).sqrt();
    let root_mean_square = (sum(sound().map(|x| (x / unit).powi(2))) / count).sqrt();
    Expected { mean: mean * unit, deviation: deviation * unit, root_mean_square: root_mean_square * unit, values }
}

/// What was found of a quantity, in SI units, whatever form it has.
struct Found {
    count: usize,
    mean: f64,
    deviation: f64,
    min: (f64, usize),
    max: (f64, usize),
}

impl From<&Partial<f64>> for Found {
    fn from(found: &Partial<f64>) -> Self {
        Self {
            count: found.count as usize,
            mean: found.mean(),
            deviation: found.standard_deviation(),
            min: (found.least.value(), found.least.body as usize),
            max: (found.greatest.value(), found.greatest.body as usize),
        }
    }
}

/// Refuses what is further from what the states say than `bound`; gives the largest part of it that a figure came to.
fn compare(found: &Found, expected: &Expected, bound: f64) -> Result<f64, String> {
    let mut largest = 0.0_f64;
    let sound = || expected.values.iter().flatten().copied();
    if found.count != sound().count() {
        return Err(format!("{} bodies, not {}", found.count, sound().count()));
    }
    let mut near = |name: &str, found: f64, expected: f64, scale: f64| {
        let error = (found - expected).abs();
        // Not so where either is no number.
        if error > bound * scale || error.is_nan() || scale.is_nan() {
            return Err(format!("{name} {found:e}, not {expected:e}, +- {bound:.1e}"));
        }
        largest = largest.max(if error > 0.0 { error / (bound * scale) } else { 0.0 });
        Ok(())
    };
    near("mean", found.mean, expected.mean, expected.mean)?;
    near("deviation", found.deviation, expected.deviation, expected.root_mean_square)?;
    let (min, max) = (sound().fold(f64::INFINITY, f64::min), sound().fold(0.0, f64::max));
    near("min", found.min.0, min, min)?;
    near("max", found.max.0, max, max)?;
    for (name, (_, body), extreme) in [("min", found.min, min), ("max", found.max, max)] {
        let own = expected.values.get(body).copied().flatten().ok_or(format!("{name} of body {body}"))?;
        near(&format!("{name} of body {body}"), own, extreme, extreme)?;
    }
    Ok(largest)
}

fn states_of(words: &StateWords, frames: &[polhode::bodies::BodyFrame]) -> Vec<BodyState> {
    let state = |(row, frame): (usize, &polhode::bodies::BodyFrame)| BodyState {
        status: words.status[row],
        ..frame.body_state(words.combined(row))
    };
    frames.iter().enumerate().map(state).collect()
}

/// Reduces a session's state and compares it with the state itself.
macro_rules! check_session {
    ($session:expr, $frames:expr, $bound:expr) => {{
        let mut session = $session;
        session.watch(&Statistic::ALL, $frames, &BlockRows::one($frames.len()), f64::INFINITY).expect("watched");
        let found = session.reduce().expect("reduced").remove(0);
        let words = session.read(0..$frames.len()).expect("read");
        let states = states_of(&words, $frames);
        let failed: Vec<usize> = (0..states.len()).filter(|&body| !is_sound(&states[body])).collect();
        let marked = session.marked().expect("read").failed;
        let rows: Vec<usize> = (0..$frames.len()).step_by(7).collect();
        let some = session.read_rows(&rows).expect("read");
        for (index, &row) in rows.iter().enumerate() {
            assert_eq!(some.value[index].map(f64::to_bits), words.value[row].map(f64::to_bits), "row {row}");
        }
        let pairs = Statistic::ALL.into_iter().zip(&found);
        pairs
            .map(|(statistic, found)| {
                compare(&found.into(), &expected(&states, statistic), $bound)
                    .map_err(|fault| format!("{statistic}: {fault}"))
            })
            .collect::<Result<Vec<f64>, String>>()
            .and_then(|parts| {
                let fault = || format!("marked as failed: {marked:?}, not {failed:?}");
                let largest = parts.into_iter().fold(0.0, f64::max);
                (marked == failed).then_some((found, largest)).ok_or_else(fault)
            })
    }};
}

/// What was found of each quantity, and the largest part of its bound that any of it came to.
type Reduced = (Vec<Partial<f64>>, f64);

/// The state of an ensemble after some steps, reduced.
fn check_stepped(engine: &Engine, ensemble: &Ensemble, precision: Precision) -> Result<Reduced, String> {
    let (frames, batch) = prepare(ensemble, precision).expect("prepared");
    let mut session: Box<dyn Session> = engine.start(batch, Method::Rk4).expect("started");
    session.advance_to(End::of_steps(1.0 / 64.0, 5), &mut unobserved).expect("advanced");
    check_session!(session, &frames, bound(precision))
}

/// The closed form of an ensemble at a time, reduced.
fn check_free(engine: &Engine, ensemble: &Ensemble, precision: Precision) -> Result<Reduced, String> {
    let (frames, rows) = AnyRows::prepare(ensemble, precision).expect("prepared");
    let mut session: Box<dyn Session> = engine.start_free(rows).expect("started");
    session.advance_to(End::at(3.7), &mut unobserved).expect("evaluated");
    check_session!(session, &frames, bound(precision))
}

pub fn bound(precision: Precision) -> f64 {
    error_bound(precision) + HOST
}

/// Numbers of bodies around a workgroup's lanes (64), its bodies (1,024) and the CPU's tasks (4,096).
const SIZES: [usize; 9] = [1, 2, 63, 64, 65, 200, 1024, 1025, 4161];

#[test]
fn statistics_are_those_of_the_states() {
    assert!(error_bound(Precision::F64) < 1e-13, "{:e}", error_bound(Precision::F64));
    let engines = [("gpu", common::gpu()), ("cpu", Engine::cpu()), ("twin", Engine::cpu_scalar())];
    for (name, engine) in &engines {
        for precision in Precision::ALL {
            for count in SIZES {
                let largest = largest_part(engine, precision, count, SEED);
                let measured = MEASURED[usize::from(precision == Precision::F64)];
                stays_within_measured(engine, precision, &format!("{name}, {count} bodies"), largest, measured);
            }
        }
    }
}

const SEED: u64 = 11;
/// The largest parts of their bounds that figures came to over 100 draws of all bodies, on every engine, in `f32` and in `f64`.
const MEASURED: [f64; 2] = [0.012, 0.025];

/// The largest part of its bound that a figure of so many bodies comes to.
fn largest_part(engine: &Engine, precision: Precision, count: usize, seed: u64) -> f64 {
    let ensemble = common::asymmetric_ensemble(count, seed);
    let kinds = [("stepped", check_stepped as fn(&_, &_, _) -> Result<Reduced, String>), ("free", check_free)];
    kinds
        .map(|(kind, check)| {
            let found = check(engine, &ensemble, precision);
            found.unwrap_or_else(|fault| panic!("{precision} {kind}, {count} bodies, seed {seed}: {fault}")).1
        })
        .into_iter()
        .fold(0.0, f64::max)
}

#[test]
#[ignore = "prints what was measured: cargo test --test mirror statistics::largest -- --ignored --nocapture"]
fn largest_parts_over_many_seeds() {
    let engines = [common::gpu(), Engine::cpu(), Engine::cpu_scalar()];
    for precision in Precision::ALL {
        let of_seed = |seed| {
            let of = |engine| {
                SIZES.map(|count| largest_part(engine, precision, count, seed)).into_iter().fold(0.0, f64::max)
            };
            engines.iter().map(of).fold(0.0, f64::max)
        };
        println!("{precision}: {:.3}", over_seeds(of_seed));
        println!(
            "{precision}, shader and twin: {:.3} epsilon",
            over_seeds(|seed| reassociated(&engines[0], precision, seed))
        );
    }
}

/// The state of an ensemble after some steps, reduced by blocks whose bodies lie scattered over the session's rows: each block against its
/// own states.
fn check_blocks(engine: &Engine, precision: Precision) -> Result<(), String> {
    const COUNT: usize = 3000;
    let (frames, batch) = prepare(&common::asymmetric_ensemble(COUNT, 13), precision).expect("prepared");
    let mut session = engine.start(batch, Method::Rk4).expect("started");
    session.advance_to(End::of_steps(1.0 / 64.0, 5), &mut unobserved).expect("advanced");
    let rows: Vec<u32> = (0..COUNT).map(|place| ((place * 7 + 3) % COUNT) as u32).collect();
    // Some without bodies, some of more than a workgroup's.
    let blocks = BlockRows::new(vec![0, 1, 70, 70, 1300, COUNT], Some(rows.clone()));
    let of_places: Vec<_> = rows.iter().map(|&row| frames[row as usize]).collect();
    session.watch(&Statistic::ALL, &of_places, &blocks, f64::INFINITY).expect("watched");
    let found = session.reduce().expect("reduced");
    let by_row = states_of(&session.read(0..COUNT).expect("read"), &frames);
    for (block, found) in found.iter().enumerate() {
        let states: Vec<BodyState> = (0..COUNT)
            .map(|place| {
                let state = by_row[rows[place] as usize];
                let status = if blocks.places(block).contains(&place) { state.status } else { Status::StepTooLong };
                BodyState { status, ..state }
            })
            .collect();
        for (statistic, found) in Statistic::ALL.into_iter().zip(found) {
            if found.count == 0 && blocks.places(block).is_empty() {
                continue;
            }
            let part = compare(&found.into(), &expected(&states, statistic), bound(precision))
                .map_err(|fault| format!("block {block}, {statistic}: {fault}"))?;
            let measured = MEASURED[usize::from(precision == Precision::F64)];
            if part > MEASURED_TIMES * measured && is_measured(engine, precision) {
                return Err(format!("block {block}, {statistic}: {part} of the bound, {measured} measured"));
            }
        }
    }
    Ok(())
}

#[test]
fn blocks_are_reduced_each_for_itself_wherever_their_bodies_lie() {
    // The last holds its bodies in many chunks.
    let engines = [common::gpu(), Engine::cpu(), Engine::cpu_scalar(), common::gpu_with(common::cut_options(128, 7))];
    for engine in &engines {
        for precision in Precision::ALL {
            let name = engine.description().name;
            check_blocks(engine, precision).unwrap_or_else(|fault| panic!("{name} {precision}: {fault}"));
        }
    }
}

/// Faults in where a block's bodies are.
const BLOCK_FAULTS: [(&str, &str, &str); 3] = [
    ("every piece begins with the first place", "let first = places[2u * group.x];", "let first = 0u;"),
    ("places are taken for rows", "let i = places[2u * settings.piece_count + place];", "let i = place;"),
    ("a piece is as long as the next", "places[2u * group.x + 1u]", "places[2u * group.x + 3u]"),
];

#[test]
fn planted_faults_of_blocks_are_caught() {
    for (name, from, to) in BLOCK_FAULTS {
        let patch = Patch { file: "observe.wgsl".to_owned(), from: from.to_owned(), to: to.to_owned() };
        let engine = common::gpu_with(GpuOptions { patches: vec![patch], ..common::any_adapter() });
        assert!(check_blocks(&engine, Precision::F32).is_err(), "{name}: not caught");
    }
}

/// In 64 bits nothing keeps a driver from contracting and re-associating: a few roundings of some hundred are others, in units of epsilon.
const REASSOCIATED: f64 = 16.0;
/// The largest over 100 draws of all bodies on lavapipe.
const MEASURED_REASSOCIATED: f64 = 1.43;

/// The largest difference of the shader's figures from its twin's, in units of epsilon; what is counted, and all in `f32`, agrees to the bit.
fn reassociated(engine: &Engine, precision: Precision, seed: u64) -> f64 {
    let ensemble = common::asymmetric_ensemble(4161, seed);
    let [gpu, twin] = [engine, &Engine::cpu_scalar()].map(|engine| {
        let (frames, batch) = prepare(&ensemble, precision).expect("prepared");
        let mut session = engine.start(batch, Method::Rk4).expect("started");
        session.watch(&Statistic::ALL, &frames, &BlockRows::one(frames.len()), 1.0).expect("watched");
        (session.reduce().expect("reduced").remove(0), session.marked().expect("read"))
    });
    if precision == Precision::F32 {
        assert_eq!(gpu.0, twin.0);
    }
    let mut largest = 0.0;
    for (gpu, twin) in gpu.0.iter().zip(&twin.0) {
        assert_eq!((gpu.count, gpu.faster, gpu.exponent), (twin.count, twin.faster, twin.exponent));
        let extreme = |found: &Partial<f64>| [found.least, found.greatest].map(|one| (one.exponent, one.body));
        assert_eq!(extreme(gpu), extreme(twin));
        let pairs = [
            (gpu.mean, twin.mean),
            (gpu.squares, twin.squares),
            (gpu.least.mantissa, twin.least.mantissa),
            (gpu.greatest.mantissa, twin.greatest.mantissa),
        ];
        for (x, y) in pairs {
            let part = (x - y).abs() / y / f64::EPSILON;
            assert!(part <= REASSOCIATED, "{gpu:?} and {twin:?}");
            largest = f64::max(largest, part);
        }
    }
    assert!(gpu.1 == twin.1 && !gpu.1.faster.is_empty() && gpu.1.failed.is_empty(), "{precision}: marks");
    largest
}

#[test]
fn the_shader_and_its_twin_agree_to_the_bit_in_f32_and_nearly_in_f64() {
    let engine = common::gpu();
    for precision in Precision::ALL {
        if !common::rounds_like_scalar_twin(&engine, precision) {
            common::skipped(
                "the_shader_and_its_twin_agree",
                &format!("the adapter rounds {precision} otherwise than the twin"),
            );
            continue;
        }
        let largest = reassociated(&engine, precision, 5);
        stays_within_measured(&engine, precision, "shader and twin", largest, MEASURED_REASSOCIATED);
    }
}

/// Moments from those of a molecule to those of a planet, spins from 1e-9 to 1e15 rad/s.
fn all_scales(count: usize) -> Ensemble {
    Ensemble::from_fn(count, |body| {
        let mut random = Random::new(body as u64);
        let moment = 10f64.powf(random.between(-46.0, 38.0));
        let rate = 10f64.powf(random.between(-9.0, 15.0));
        let omega = DVec3::new(random.between(0.2, 1.0), 0.7, random.between(-1.0, 1.0)) * rate;
        (DVec3::new(0.8, 1.1, 1.7) * moment, DQuat::IDENTITY, omega)
    })
    .expect("valid bodies")
}

#[test]
fn scales_of_molecules_and_planets_stand_beside_each_other() {
    for engine in [common::gpu(), Engine::cpu(), Engine::cpu_scalar()] {
        for precision in Precision::ALL {
            let (frames, batch) = prepare(&all_scales(1000), precision).expect("prepared");
            let session = engine.start(batch, Method::Rk4).expect("started");
            let name = engine.description().name;
            let (found, _) = check_session!(session, &frames, bound(precision))
                .unwrap_or_else(|fault| panic!("{name} {precision}: {fault}"));
            let energy = &found[0];
            assert!(energy.least.value() < 1e-50 && energy.greatest.value() > 1e50, "{energy:?}");
        }
    }
}

#[test]
fn bodies_at_rest_have_statistics() {
    let rest = |count| Ensemble::from_fn(count, |_| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::ZERO));
    for engine in [common::gpu(), Engine::cpu(), Engine::cpu_scalar()] {
        for precision in Precision::ALL {
            let (frames, batch) = prepare(&rest(70).expect("valid"), precision).expect("prepared");
            let mut session = engine.start(batch, Method::Rk4).expect("started");
            session.watch(&Statistic::ALL, &frames, &BlockRows::one(frames.len()), f64::INFINITY).expect("watched");
            for found in session.reduce().expect("reduced").remove(0) {
                let figures = [found.mean(), found.standard_deviation(), found.least.value(), found.greatest.value()];
                assert_eq!((found.count, figures), (70, [0.0; 4]));
            }
        }
    }
}

#[test]
fn chunks_change_nothing_beyond_rounding() {
    let ensemble = common::asymmetric_ensemble(1000, 7);
    for precision in Precision::ALL {
        let whole = check_stepped(&common::gpu(), &ensemble, precision).expect("in bounds");
        let cut =
            check_stepped(&common::gpu_with(common::cut_options(128, 2)), &ensemble, precision).expect("in bounds");
        for (whole, cut) in whole.0.iter().zip(&cut.0) {
            // Extremes are picked, not summed.
            assert_eq!((whole.count, whole.least, whole.greatest), (cut.count, cut.least, cut.greatest));
        }
    }
}

/// Faults of the kernels, by chunk, text and what takes its place; each must be caught by the comparison above.
const FAULTS: [(&str, &str, &str, &str); 6] = [
    ("the last body is left out", "observe.wgsl", "(offset >= count", "(offset + 1u >= count"),
    ("a scale is lost", "observe_f32.wgsl", "+ exponent + i32(scale)", "+ exponent"),
    ("exponents are not compared", "observe.wgsl", "a.exponent < b.exponent || ", ""),
    ("the share is that of the wrong side", "observe.wgsl", "real(b.count) / real", "real(a.count) / real"),
    ("squares of means are left out", "observe.wgsl", "squares + difference", "squares + 0.0 * difference"),
    ("half of a tree", "observe.wgsl", "var half = WORKGROUP / 2u;", "var half = WORKGROUP / 4u;"),
];

#[test]
fn planted_faults_are_caught() {
    let ensemble = common::asymmetric_ensemble(200, 11);
    check_stepped(&common::gpu(), &ensemble, Precision::F32).expect("without a fault");
    for (name, file, from, to) in FAULTS {
        let patch = Patch { file: file.to_owned(), from: from.to_owned(), to: to.to_owned() };
        let engine = common::gpu_with(GpuOptions { patches: vec![patch], ..common::any_adapter() });
        // A panic, as of a fault that is not planted or does not compile, is none of the comparison's findings.
        match check_stepped(&engine, &ensemble, Precision::F32) {
            Err(found) => println!("{name}: {found}"),
            Ok(_) => panic!("{name}: not caught"),
        }
    }
}
