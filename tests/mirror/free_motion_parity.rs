//! The closed form's shader against its Rust twin: phases to the bit, functions in ulps, states through the engines.

use crate::common;

use common::compare::{Field, compare_rows, compare_states};
use common::kernel::Harness;
use common::measured::{MEASURED_TIMES, is_measured, over_seeds, stays_within_measured};
use common::random::Random;
use polhode::Ensemble;
use polhode::bodies::columns::StateWords;
use polhode::engine::gpu::shader::{Chunk, Source};
use polhode::engine::gpu::{GpuOptions, Patch};
use polhode::engine::{Backend, End, Engine, unobserved};
use polhode::kernel::free_motion::AnyRows;
use polhode::math::Precision;
use polhode::math::elementary::{Turns, exp_negative, sin_cos_turns, turned_by};
use polhode::math::phase::{Rate, Time, phase_at, phase_turns};
use polhode::math::real::Scalar;

use glam::{DQuat, DVec3};

/// Rows of a table: not a multiple of the workgroup size.
const ROWS: usize = 331;

/// Functions of one sum and a polynomial: each side is within one ulp of 1 of the truth.
const SIN_COS_ULPS: f64 = 2.0;
/// Each side is within 2 units of roundoff, one ulp, of the truth.
const EXP_ULPS: f64 = 2.0;
/// On the way from the phases to a component there are, one after the other, sine and cosine (2 ulps of 1 at most),
/// the two series, the norm, and two quaternion products: some eight roundings of half an ulp on either side, where
/// drivers and lanes may fuse.
const STATE_ULPS: f64 = 8.0;

/// The largest differences over 100 tables, in `f32` and in `f64`, ulps: of the functions on lavapipe, which rounds products and sums apart as the
/// twin does; of states there and in lanes.
const MEASURED_SIN_COS: [f64; 2] = [0.0, 0.0];
const MEASURED_EXP: [f64; 2] = [2.0, 2.0];
const MEASURED_ON_GPU: [f64; 2] = [6.0, 5.0];
const MEASURED_IN_LANES: [f64; 2] = [5.0, 5.0];

/// The bound of states on an adapter, in ulps.
pub fn state_bound(gpu: &Engine, precision: Precision) -> f64 {
    let measured = MEASURED_TIMES * of(MEASURED_ON_GPU, precision);
    if is_measured(gpu, precision) { measured.min(STATE_ULPS) } else { STATE_ULPS }
}

/// Of a pair of figures the one of a precision.
fn of(measured: [f64; 2], precision: Precision) -> f64 {
    measured[usize::from(precision == Precision::F64)]
}

fn chunks(precision: Precision) -> Vec<Chunk> {
    [Source::functions(precision), Source::free_motion_functions(precision)].concat()
}

/// The 16-bit parts of an integer, lowest first: numbers that either precision holds exactly.
fn parts<const N: usize>(x: u128) -> [f64; N] {
    std::array::from_fn(|i| f64::from((x >> (16 * i)) as u16))
}

const PHASE_LINE: &str = "
    var limb: array<u32, 20>;
    for (var i = 0u; i < 16u; i += 1u) { limb[i] = u32(r(i)); }
    let rate = Rate(
        vec4<u32>(limb[0] | (limb[1] << 16u), limb[2] | (limb[3] << 16u), limb[4] | (limb[5] << 16u), limb[6] | (limb[7] << 16u)),
        i32(r(16u)), r(17u) > 0.5);
    let time = Time(vec2<u32>(limb[8] | (limb[9] << 16u), limb[10] | (limb[11] << 16u)), i32(r(18u)), u32(r(19u)));
    let start = vec2<u32>(limb[12] | (limb[13] << 16u), limb[14] | (limb[15] << 16u));
    let phase = phase_at(start, rate, time);
    put_r(0u, real(phase.x & 0xffffu)); put_r(1u, real(phase.x >> 16u));
    put_r(2u, real(phase.y & 0xffffu)); put_r(3u, real(phase.y >> 16u));
    let angle = phase_turns(phase);
    put_r(4u, angle.quadrant); put_r(5u, angle.residual);";

fn phases_agree<T: Scalar>(precision: Precision) {
    let mut random = Random::new(31);
    let mut rows = Vec::new();
    let mut expected = Vec::new();
    for row in 0..4 * ROWS {
        let edge = |x: u64| if row % 7 == 0 { if x.is_multiple_of(2) { u64::MAX } else { 1 << (x % 64) } } else { x };
        let fraction = (u128::from(edge(random.bits())) << 64) | u128::from(edge(random.bits()));
        let mantissa = edge(random.bits()) >> (row % 12);
        let start = random.bits();
        // From products far below one turn to such that end above the rate's last bit.
        let exponent = (row as i32 % 331) - 200;
        let rate = Rate { fraction, exponent: 5, negative: row % 3 == 0 };
        let time = Time { mantissa, exponent: exponent - 5, negative: row % 2 == 0 };
        let mut numbers = Vec::new();
        numbers.extend(parts::<8>(fraction));
        numbers.extend(parts::<4>(u128::from(mantissa)));
        numbers.extend(parts::<4>(u128::from(start)));
        numbers.extend([
            5.0,
            f64::from(u8::from(rate.negative)),
            f64::from(time.exponent),
            f64::from(u8::from(time.negative)),
        ]);
        rows.push(numbers.into_iter().map(T::from_f64).collect::<Vec<_>>());
        let phase = phase_at(start, rate, time);
        let angle = phase_turns::<T>(phase);
        let mut numbers = parts::<4>(u128::from(phase)).to_vec();
        numbers.extend([angle.quadrant.to_f64(), angle.residual.to_f64()]);
        expected.push(numbers);
    }
    let found = Harness::new().run(&chunks(precision), PHASE_LINE, &rows, 6);
    for (row, (expected, found)) in expected.iter().zip(&found).enumerate() {
        assert_eq!(expected, found, "row {row}: 16-bit parts of the phase, lowest first, quadrant, residual");
    }
}

#[test]
fn phases_have_the_same_bits_on_the_gpu() {
    phases_agree::<f32>(Precision::F32);
    phases_agree::<f64>(Precision::F64);
}

/// The largest differences of sines and cosines of turns, and of exponentials, in ulps; turns themselves agree to the bit.
fn compared_functions<T: Scalar>(harness: &Harness, precision: Precision, seed: u64) -> [f64; 2] {
    let mut random = Random::new(32 + 1000 * seed);
    let pair = [Field { name: "pair", components: 2 }];
    let number = [Field { name: "number", components: 1 }];
    let turns: Vec<Vec<T>> = (0..ROWS)
        .map(|row| {
            let residual = match row {
                0 => 0.0,
                1 => 0.125,
                2 => -0.125,
                _ => random.between(-0.125, 0.125),
            };
            [f64::from(row as u32 % 4), residual, random.between(-0.125, 0.125)].map(T::from_f64).to_vec()
        })
        .collect();
    let angle = |row: &[T]| Turns { quadrant: row[0], residual: row[1] };
    let twin: Vec<Vec<f64>> = turns
        .iter()
        .map(|row| {
            let (sin, cos) = sin_cos_turns(angle(row));
            vec![sin.to_f64(), cos.to_f64()]
        })
        .collect();
    let line = "let x = sin_cos_turns(Turns(r(0u), r(1u))); put_r(0u, x.sin); put_r(1u, x.cos);";
    let found = harness.run(&chunks(precision), line, &turns, 2);
    let sin_cos = compare_rows::<T>(&pair, &twin, &found, |_| 1.0, SIN_COS_ULPS)
        .unwrap_or_else(|e| panic!("sin_cos_turns {precision}: {e}"));

    let twin: Vec<Vec<f64>> = turns
        .iter()
        .map(|row| {
            let turned = turned_by(angle(row), row[2]);
            vec![turned.quadrant.to_f64(), turned.residual.to_f64()]
        })
        .collect();
    let line = "let x = turned_by(Turns(r(0u), r(1u)), r(2u)); put_r(0u, x.quadrant); put_r(1u, x.residual);";
    let found = harness.run(&chunks(precision), line, &turns, 2);
    compare_rows::<T>(&pair, &twin, &found, |_| 0.0, 0.0).unwrap_or_else(|e| panic!("turned_by {precision}: {e}"));

    let arguments: Vec<Vec<T>> = (0..ROWS)
        .map(|row| {
            let x = match row {
                0 => 0.0,
                1 => -0.0,
                2 => -86.0,
                3 => -1e4,
                4..=128 => -f64::from(row as u32) * std::f64::consts::LN_2 / 2.0,
                _ => random.between(-86.0, 0.0),
            };
            vec![T::from_f64(x)]
        })
        .collect();
    let twin: Vec<Vec<f64>> = arguments.iter().map(|row| vec![exp_negative(row[0]).to_f64()]).collect();
    let found = harness.run(&chunks(precision), "put_r(0u, exp_negative(r(0u)));", &arguments, 1);
    let exp =
        compare_rows::<T>(&number, &twin, &found, |_| 0.0, EXP_ULPS).unwrap_or_else(|e| panic!("exp {precision}: {e}"));
    [sin_cos, exp]
}

fn functions_of_a_seed(harness: &Harness, precision: Precision, seed: u64) -> [f64; 2] {
    match precision {
        Precision::F32 => compared_functions::<f32>(harness, precision, seed),
        Precision::F64 => compared_functions::<f64>(harness, precision, seed),
    }
}

#[test]
fn elementary_functions_agree_with_their_twins() {
    let (gpu, harness) = (common::gpu(), Harness::new());
    for precision in Precision::ALL {
        let [sin_cos, exp] = functions_of_a_seed(&harness, precision, 0);
        stays_within_measured(&gpu, precision, "sin_cos_turns", sin_cos, of(MEASURED_SIN_COS, precision));
        stays_within_measured(&gpu, precision, "exp_negative", exp, of(MEASURED_EXP, precision));
    }
}

#[test]
#[ignore = "prints what was measured: cargo test --test mirror free_motion_parity::largest -- --ignored --nocapture"]
fn largest_differences_over_many_seeds() {
    let (gpu, lanes, harness) = (common::gpu(), Engine::cpu(), Harness::new());
    for precision in Precision::ALL {
        for (number, name) in ["sin_cos_turns", "exp_negative"].into_iter().enumerate() {
            println!(
                "{name} {precision}: {}",
                over_seeds(|seed| functions_of_a_seed(&harness, precision, seed)[number])
            );
        }
        for (name, engine) in [("GPU", &gpu), ("lanes", &lanes)] {
            let of_seed =
                |seed| TIMES.map(|time| compared_states(engine, precision, time, seed)).into_iter().fold(0.0, f64::max);
            println!("states, {name} {precision}: {}", over_seeds(of_seed));
        }
    }
}

/// Bodies of every branch: generic ones of both regimes, next to and on the separatrix, symmetric, spherical, steady about
/// each axis, at rest, rods and plates, fast and slow ones.
fn bodies(seed: u64) -> Ensemble {
    let mut random = Random::new(33 + 1000 * seed);
    let mut rows = Vec::new();
    for (moments, omega) in [
        (DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO),
        (DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.0, 1.5, 0.0)),
        (DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.0, 0.0, -1.5)),
        (DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1.5, 0.0, 0.0)),
        (DVec3::new(1.0, 1.0, 1.0), DVec3::new(0.3, -0.2, 1.0)),
        (DVec3::new(1.0, 1.0, 1.5), DVec3::new(0.3, -0.2, 1.0)),
        (DVec3::new(1.0, 1.5, 1.5), DVec3::new(0.3, -0.2, 1.0)),
        (DVec3::new(1.0, 2.0, 2.25), DVec3::new(0.75, 1.0, -1.0)),
        (DVec3::new(1e-3, 1.0, 1.0005), DVec3::new(1.0, 0.5, 0.2)),
        (DVec3::new(1.0, 1.5, 2.5), DVec3::new(0.1, 1.0, 0.2)),
    ] {
        rows.push((moments, DQuat::from_array([0.1, 0.7, -0.3, 0.6]).normalize(), omega));
    }
    for exponent in 1..12 {
        let small = 10f64.powi(-exponent);
        rows.push((DVec3::new(1.0, 2.0, 3.0), DQuat::IDENTITY, DVec3::new(small, 5.0, small)));
        rows.push((DVec3::new(1.0, 2.0, 3.0), DQuat::IDENTITY, DVec3::new(0.0, -5.0, small)));
    }
    while rows.len() < ROWS {
        let [a, b, c] = [(); 3].map(|()| random.between(0.2, 1.0));
        let q = DQuat::from_array([(); 4].map(|()| random.normal())).normalize();
        let omega = DVec3::from_array([(); 3].map(|()| random.normal()));
        rows.push((DVec3::new(b + c, c + a, a + b), q, omega));
    }
    Ensemble::from_fn(ROWS, |body| rows[body]).expect("valid bodies")
}

fn states(engine: &dyn Backend, precision: Precision, time: f64, seed: u64) -> StateWords {
    let (_, rows) = AnyRows::prepare(&bodies(seed), precision).expect("enough memory");
    let mut session = engine.start_free(rows).expect("started");
    session.advance_to(End::at(time), &mut unobserved).expect("evaluated");
    session.read(0..ROWS).expect("read")
}

const TIMES: [f64; 6] = [0.0, 1e-3, 10.0, -123.456, 1e6, 1e9];

/// The largest difference of an engine's states from the scalar twin's, in ulps.
fn compared_states(engine: &Engine, precision: Precision, time: f64, seed: u64) -> f64 {
    let twin = Engine::cpu_scalar();
    let (expected, found) = (states(&twin, precision, time, seed), states(engine, precision, time, seed));
    let compared = match precision {
        Precision::F32 => compare_states::<f32>(&expected, &found, STATE_ULPS),
        Precision::F64 => compare_states::<f64>(&expected, &found, STATE_ULPS),
    };
    compared.unwrap_or_else(|mismatch| panic!("{precision} at {time} s, seed {seed}: {mismatch}"))
}

fn states_agree(engine: &Engine, measured: [f64; 2]) {
    for precision in Precision::ALL {
        for time in TIMES {
            let largest = compared_states(engine, precision, time, 0);
            stays_within_measured(engine, precision, &format!("states at {time} s"), largest, of(measured, precision));
        }
    }
}

#[test]
fn states_on_the_gpu_agree_with_the_scalar_twin() {
    states_agree(&common::gpu(), MEASURED_ON_GPU);
}

/// Whatever reads the states waits, and then finds those of the last time.
#[test]
fn an_evaluation_is_not_waited_for() {
    let gpu = common::own_gpu();
    for precision in Precision::ALL {
        let (_, rows) = AnyRows::prepare(&bodies(1), precision).expect("enough memory");
        let mut session = gpu.start_free(rows).expect("started");
        session.advance_to(End::at(0.5), &mut unobserved).expect("evaluated");
        session.read(0..ROWS).expect("read");
        let before = gpu.traffic();
        for time in [1.0, 2.0, 10.0] {
            session.advance_to(End::at(time), &mut unobserved).expect("evaluated");
        }
        let traffic = gpu.traffic().since(before);
        assert_eq!((traffic.waits, traffic.dispatches), (0, 3), "{precision}");
        assert_eq!(session.read(0..ROWS).expect("read"), states(&gpu, precision, 10.0, 1), "{precision}");
    }
}

#[test]
fn lanes_agree_with_the_scalar_twin() {
    states_agree(&Engine::cpu(), MEASURED_IN_LANES);
}

/// Planted faults: a wrong sign, a dropped term, a rate that is used for the other phase, a last bit of the time.
const FAULTS: [(&str, &str, &str); 6] = [
    ("free_motion/evaluation.wgsl", "cos_d - cos_d_odd)", "cos_d + cos_d_odd)"),
    ("free_motion/evaluation.wgsl", "mul_add(four_c2 - 1.0, q6, 1.0 - q2)", "mul_add(four_c2 - 1.0, q6, 1.0)"),
    ("free_motion/evaluation.wgsl", "* half_turn_sign;", ";"),
    ("free_motion.wgsl", "load_rate(2u, exponent", "load_rate(0u, exponent"),
    ("phase.wgsl", "wide_product(rate.z, mantissa.x)", "wide_product(rate.z, mantissa.x & 0xfffffff0u)"),
    ("elementary.wgsl", "3.5 < quadrant", "3.5 > quadrant"),
];

#[test]
fn the_comparison_rejects_planted_faults() {
    let twin = Engine::cpu_scalar();
    // A third, so that the bits of the mantissa are mixed, and so long a time that each of them matters.
    let time = 2e18 / 3.0;
    let expected = states(&twin, Precision::F64, time, 0);
    for (file, from, to) in FAULTS {
        let patch = Patch { file: file.to_owned(), from: from.to_owned(), to: to.to_owned() };
        let options = GpuOptions { patches: vec![patch], ..common::any_adapter() };
        let found = states(&common::gpu_with(options), Precision::F64, time, 0);
        let compared = compare_states::<f64>(&expected, &found, STATE_ULPS);
        assert!(compared.is_err(), "{file}: {from} -> {to} passes: {compared:?}");
    }
}
