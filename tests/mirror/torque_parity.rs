//! Every torque of the shaders against its Rust twin: the function alone, then in steps.

use crate::common;

use common::compare::{Field, compare_rows, compare_states};
use common::kernel::{Harness, chunks};
use common::measured::{MEASURED_TIMES, SEEDS, is_measured, over_seeds, stays_within_measured};
use common::random::Random;
use common::torques::{batch_under, every_torque, middle_moments};
use polhode::engine::Engine;
use polhode::engine::gpu::Patch;
use polhode::engine::gpu::shader::{Chunk, Source};
use polhode::kernel::method::Method;
use polhode::kernel::rigid_body::Body;
use polhode::math::Precision;
use polhode::math::clock::{Clock, Fraction, Ticks, digits, phase_after, phases_at};
use polhode::math::real::Scalar;
use polhode::math::vector::{TwoWords, Vector};
use polhode::torque::Parameters;
use polhode::torque::twin::twins;
use polhode::torque::variable_inertia::{Change, InertiaChange, Law, changed_body};
use polhode::torque::white_noise::{minus_log, normal_vector, philox, uniform_parts, uniform_turns};
use polhode::torque::{Declaration, Torque, declarations};
use polhode::torque::{internal_dissipation, variable_inertia};

/// Rows of a table: not a multiple of the workgroup size.
const ROWS: usize = 331;

/// A product and a sum or two, each of which may be rounded at another place.
const FEW_ROUNDINGS: f64 = 4.0;
/// A quotient, of 2.5 ulps on a GPU, and a few roundings.
const MORE_ROUNDINGS: f64 = 12.0;
/// With a sine and a cosine before, each within one ulp of 1 of the truth.
const TRIGONOMETRIC: f64 = 16.0;

const REAL: Field = Field { name: "real", components: 1 };
const VECTOR: Field = Field { name: "vector", components: 3 };

/// What the torques' chunks read besides the columns of a one-line kernel.
const COLUMNS: &str = "fn parameter_at(column: u32, i: u32) -> real { return inputs[column * settings.count + i]; }\n";

fn vector<T: Scalar>(row: &[T], first: usize) -> Vector<T> {
    Vector::new(row[first], row[first + 1], row[first + 2])
}

fn v_out<T: Scalar>(v: Vector<T>) -> Vec<T> {
    vec![v.x, v.y, v.z]
}

/// A function of the shaders and its twin. Columns 0 to 3 are a unit quaternion, 4 to 6 an angular velocity, 7 a number
/// in [−½, ½], 8 one in [0, 0.9], 9 to 14 numbers in [−1, 1], 15 to 17 and 18 to 20 orthogonal unit vectors.
struct Case<T> {
    name: &'static str,
    line: &'static str,
    fields: &'static [Field],
    twin: fn(&[T]) -> Vec<T>,
    ulps: f64,
}

const COLUMN_COUNT: usize = 21;

fn rows<T: Scalar>(seed: u64) -> Vec<Vec<T>> {
    let mut random = Random::new(5 + 1000 * seed);
    (0..ROWS)
        .map(|row| {
            let mut numbers = vec![0.0; COLUMN_COUNT];
            let q = glam::DQuat::from_array([(); 4].map(|()| random.normal())).normalize();
            // The identity, half turns and their neighbours, where springs have their limits.
            let q = match row {
                0 => glam::DQuat::IDENTITY,
                1 => glam::DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0),
                2 => glam::DQuat::from_xyzw(1e-12, 0.0, 0.0, 1.0),
                3 => glam::DQuat::from_xyzw(0.0, 1.0, 0.0, -1e-9).normalize(),
                _ => q,
            };
            numbers[..4].copy_from_slice(&q.to_array());
            (4..7).for_each(|column| numbers[column] = random.between(-2.0, 2.0));
            // Phases at the borders of quarter turns among them.
            numbers[7] = if row < 17 { row as f64 / 16.0 - 0.5 } else { random.between(-0.5, 0.5) };
            numbers[8] = if row.is_multiple_of(5) { 0.0 } else { random.between(0.0, 0.9) };
            (9..15).for_each(|column| numbers[column] = random.between(-1.0, 1.0));
            let axes = glam::DMat3::from_quat(glam::DQuat::from_array([(); 4].map(|()| random.normal())).normalize());
            numbers[15..18].copy_from_slice(&axes.x_axis.to_array());
            numbers[18..21].copy_from_slice(&axes.y_axis.to_array());
            numbers.into_iter().map(T::from_f64).collect()
        })
        .collect()
}

fn cases<T: Scalar>() -> Vec<Case<T>> {
    let case = |name, line, ulps, twin| Case { name, line, fields: &[VECTOR], twin, ulps };
    vec![
        case("internal_dissipation", "put_v(0u, internal_dissipation(r(9u), v(10u), v(4u)));", FEW_ROUNDINGS, |row| {
            v_out(internal_dissipation::internal_dissipation(row[9], vector(row, 10), vector(row, 4)))
        }),
        Case {
            name: "laws of variable_inertia",
            line: "put_r(0u, ticks_since(vec2<u32>(u32(r(8u) * 65536.0), 7u), vec2<u32>(99u, u32(r(8u) * 15.0))));
                put_r(1u, ramp_progress(r(7u), r(9u), r(10u)));
                put_r(2u, inertia_ramp(0.5 + r(7u)));
                put_r(3u, inertia_oscillation(r(7u)));",
            fields: &[
                Field { name: "ticks since the start", components: 1 },
                Field { name: "progress and laws", components: 3 },
            ],
            twin: |row| {
                let ticks = (7 << 32) | (row[8].to_f64() * 65536.0) as u64;
                let start = 99 | (((row[8].to_f64() * 15.0) as u64) << 32);
                vec![
                    variable_inertia::ticks_since(ticks, start),
                    variable_inertia::ramp_progress(row[7], row[9], row[10]),
                    variable_inertia::inertia_ramp(T::from_f64(0.5) + row[7]),
                    variable_inertia::inertia_oscillation(row[7]),
                ]
            },
            // Seven factors and a polynomial of positive terms.
            ulps: TRIGONOMETRIC,
        },
        Case {
            name: "changed_body",
            line: "let inverse = TwoWordsVector(vector(1.0, 1.0, 1.0) + 0.25 * v(9u), v(12u) * (1.0 / 67108864.0));
                let change = Change(
                    vector(1.0, 1.0, 1.0) + 0.5 * v(15u), TwoWordsVector(v(18u), v(12u) * (1.0 / 67108864.0)));
                let changed = changed_body(body_new(inverse), change, clamp(1.2 * r(8u), 0.0, 1.0));
                put_v(0u, changed.body.inverse_moments.value + changed.body.inverse_moments.residue);
                put_v(3u, changed.body.gyroscopic.value);
                put_v(6u, changed.ratio);",
            fields: &[VECTOR, VECTOR, VECTOR],
            twin: |row| {
                let scaled = |first: usize, factor: f64| vector(row, first) * T::from_f64(factor);
                let one = T::from_f64(1.0);
                let ones = Vector::new(one, one, one);
                let residue = scaled(12, 1.0 / 67_108_864.0);
                let body = Body::new(TwoWords { value: ones + scaled(9, 0.25), residue });
                let difference = TwoWords { value: vector(row, 18), residue };
                let change = Change { kappa: ones + scaled(15, 0.5), difference };
                let done = (T::from_f64(1.2) * row[8]).max(T::from_f64(0.0)).min(one);
                let changed = changed_body(&body, &change, done);
                let inverse = changed.body.inverse_moments;
                let vectors = [inverse.value + inverse.residue, changed.body.gyroscopic.value, changed.ratio];
                vectors.into_iter().flat_map(v_out).collect()
            },
            ulps: MORE_ROUNDINGS,
        },
        // A sum, as differences cancel.
        case(
            "gained_differences",
            "put_v(0u, gained_differences(vector(1.0, 1.0, 1.0) + 0.5 * v(9u), 0.5 * v(12u)) + vector(4.0, 4.0, 4.0));",
            FEW_ROUNDINGS,
            |row| {
                let number = |x: f64| T::from_f64(x);
                let all = |x: f64| Vector::new(number(x), number(x), number(x));
                let (moments, share) = (all(1.0) + vector(row, 9) * number(0.5), vector(row, 12) * number(0.5));
                v_out(variable_inertia::gained_differences(moments, share) + all(4.0))
            },
        ),
        Case {
            name: "eccentric_anomaly",
            line: "let e = eccentric_anomaly(r(7u) * TAU, r(8u)); put_r(0u, e.sin); put_r(1u, e.cos);",
            fields: &[Field { name: "sine and cosine", components: 2 }],
            twin: |row| {
                let (_, sin, cos) =
                    polhode::math::kepler::eccentric_anomaly(row[7] * T::splat(std::f64::consts::TAU), row[8]);
                vec![sin, cos]
            },
            // Roundings of the anomaly are magnified by 1/(1 - e).
            ulps: TRIGONOMETRIC,
        },
    ]
}

fn precision_of<T: Scalar>() -> Precision {
    if T::WORDS == 2 { Precision::F32 } else { Precision::F64 }
}

fn to_f64<T: Scalar>(row: &[T]) -> Vec<f64> {
    row.iter().map(|x| x.to_f64()).collect()
}

/// The chunks of the torques without their sum, which reads what only the stepping kernel has.
fn torque_chunks(precision: Precision) -> Vec<Chunk> {
    let mut all: Vec<Chunk> =
        chunks(precision, Method::Rk4).into_iter().filter(|chunk| !chunk.file.starts_with("torque/")).collect();
    all.retain(|chunk| !chunk.file.starts_with("method/"));
    all.extend(Source::torques(precision));
    all.push(Chunk { file: "columns", text: COLUMNS.into() });
    all
}

/// The largest difference of a case over the rows of a seed, in ulps of what it is made of.
fn compared_function<T: Scalar>(harness: &Harness, chunks: &[Chunk], case: &Case<T>, seed: u64) -> f64 {
    let rows = rows::<T>(seed);
    let expected: Vec<_> = rows.iter().map(|row| to_f64(&(case.twin)(row))).collect();
    let found = harness.run(chunks, case.line, &rows, expected[0].len());
    // Parameters are at most 1, rates 2.
    let size = |row: usize| if case.name == "eccentric_anomaly" { 1.0 / (1.0 - rows[row][8].to_f64()) } else { 1.0 };
    compare_rows::<T>(case.fields, &expected, &found, size, case.ulps)
        .unwrap_or_else(|mismatch| panic!("{}: {mismatch}; inputs {:?}", case.name, to_f64(&rows[mismatch.body])))
}

/// The largest differences over [`SEEDS`] tables on lavapipe, in `f32` and in `f64`, ulps; of all
/// other functions, of phases and of draws, they are none.
const MEASURED_FUNCTIONS: [(&str, [f64; 2]); 4] = [
    ("laws of variable_inertia", [4.0, 0.0]),
    ("changed_body", [1.0, 1.0]),
    ("gained_differences", [1.0, 1.0]),
    ("eccentric_anomaly", [0.125, 0.5]),
];

fn check_functions<T: Scalar>() {
    let (harness, gpu, precision) = (Harness::new(), common::gpu(), precision_of::<T>());
    let chunks = torque_chunks(precision);
    for case in cases::<T>() {
        let largest = compared_function(&harness, &chunks, &case, 0);
        let measured = MEASURED_FUNCTIONS.iter().find(|(name, _)| *name == case.name).map_or([0.0; 2], |one| one.1);
        stays_within_measured(&gpu, precision, case.name, largest, measured[2 - T::WORDS]);
    }
}

#[test]
#[ignore = "prints what `MEASURED_FUNCTIONS` holds: cargo test --test mirror torque_parity::functions_over -- --ignored --nocapture"]
fn functions_over_many_seeds() {
    fn print<T: Scalar>() {
        let (harness, chunks) = (Harness::new(), torque_chunks(precision_of::<T>()));
        for case in cases::<T>() {
            let largest = over_seeds(|seed| compared_function(&harness, &chunks, &case, seed));
            println!("{} {}: {largest:.3} of {} ulps", precision_of::<T>(), case.name, case.ulps);
        }
        println!("{} draws: {:.3} of {TRIGONOMETRIC} ulps", precision_of::<T>(), over_seeds(compared_draws::<T>));
        println!("{} phases: {:.3} ulps", precision_of::<T>(), over_seeds(compared_phases::<T>));
    }
    print::<f32>();
    print::<f64>();
}

#[test]
fn every_f32_torque_agrees_with_its_twin() {
    check_functions::<f32>();
}

#[test]
fn every_f64_torque_agrees_with_its_twin() {
    check_functions::<f64>();
}

#[test]
fn every_torque_of_the_shaders_is_compared() {
    let lines: String = cases::<f32>().iter().map(|case| case.line).collect();
    // Compared by whole phases and draws below, or within another.
    let elsewhere = [
        "wide_product",
        "add_with_carry",
        "rate_word",
        "philox_round",
        "anomaly_change",
        "product_128",
        "sum_128",
        "rate_at",
        "turns",
        "phase",
        "philox",
        "normal_vector",
        "minus_log",
        "uniform_parts",
        "uniform_turns",
        "arctangent_series",
        "artanh_series",
        "fraction_of_word",
        "change_share",
        "changed_by",
    ];
    // Recorded texts are compared kind by kind in torque_texts.rs, functions of formulas in parity.rs.
    let twins = twins();
    let functions = Source::elementary_functions(Precision::F32);
    let is_here = |chunk: &Chunk| {
        twins.iter().all(|twin| twin.file != chunk.file) && functions.iter().all(|other| other.file != chunk.file)
    };
    for chunk in Source::torques(Precision::F32).into_iter().filter(is_here) {
        for line in chunk.text.lines().filter_map(|line| line.strip_prefix("fn ")) {
            let name = line.split('(').next().expect("a name");
            assert!(
                elsewhere.contains(&name) || lines.contains(&format!("{name}(")),
                "{}: {name} has no case",
                chunk.file
            );
        }
    }
}

/// Words in columns of 16 bits, as the torques' columns hold them.
fn halves<T: Scalar>(words: &[u32]) -> Vec<T> {
    words.iter().flat_map(|word| [T::from_f64(f64::from(word & 0xffff)), T::from_f64(f64::from(word >> 16))]).collect()
}

/// Phases are integers until they are a fraction of a turn: both sides must agree to the bit at any time.
fn compared_phases<T: Scalar>(seed: u64) -> f64 {
    let mut random = Random::new(3 + 1000 * seed);
    let clock = Clock::new(1e5);
    let mut rows = Vec::new();
    let mut expected = Vec::new();
    for row in 0..ROWS {
        let rate = clock.rate(random.between(-100.0, 100.0), random.between(-1e-15, 1e-15));
        let ticks = match row {
            0 => 0,
            1 => u64::MAX,
            2 => 1 << 32,
            _ => random.bits() >> (row % 64),
        };
        let start = phases_at::<T>(Fraction::Shared(rate), &Ticks::Equal(ticks));
        expected.push(vec![phase_after(start, T::from_f64(1.0), T::from_f64(0.0)).to_f64()]);
        let mut columns: Vec<T> = digits(rate).into_iter().map(T::from_f64).collect();
        columns.push(T::from_f64(1.0));
        columns.extend(halves::<T>(&[ticks as u32, (ticks >> 32) as u32]));
        rows.push(columns);
    }
    let line = "let low = u32(r(9u)) | (u32(r(10u)) << 16u);
        let high = u32(r(11u)) | (u32(r(12u)) << 16u);
        put_r(0u, phase(0u, row, Instant(vec2<u32>(low, high), 0.0)));";
    let found = Harness::new().run(&torque_chunks(precision_of::<T>()), line, &rows, 1);
    // In f64 the two words of the phase meet in one rounded sum, which may be fused; in f32 all is exact.
    let bound = if T::WORDS == 1 { 1.0 } else { 0.0 };
    compare_rows::<T>(&[REAL], &expected, &found, |_| 0.5, bound).unwrap_or_else(|mismatch| panic!("{mismatch}"))
}

#[test]
fn phases_agree_to_the_bit() {
    let gpu = common::gpu();
    stays_within_measured(&gpu, Precision::F32, "phases", compared_phases::<f32>(0), 0.0);
    stays_within_measured(&gpu, Precision::F64, "phases", compared_phases::<f64>(0), 0.0);
}

/// Draws' words are integers and must agree to the bit; the normal numbers made of them within roundings.
fn compared_draws<T: Scalar>(seed: u64) -> f64 {
    let mut random = Random::new(4 + 1000 * seed);
    let mut rows = Vec::new();
    let mut expected = Vec::new();
    for row in 0..ROWS {
        let mut words = [(); 6].map(|()| random.bits() as u32);
        if row < 3 {
            words = [[0; 6], [u32::MAX; 6], [1, 0, 0, 0, 0, 0]][row];
        }
        let [a, b, c, d, e, f] = words;
        let drawn = philox([a, b, c, d], [e, f]);
        let logarithm = |word| {
            let (mantissa, exponent) = uniform_parts::<T>(word);
            minus_log(mantissa, exponent)
        };
        // The third word of the row itself too, so that the least and greatest uniform numbers are among them.
        let numbers =
            normal_vector([logarithm(drawn[0]), logarithm(c)], [uniform_turns(drawn[1]), uniform_turns(drawn[3])]);
        let mut numbers = to_f64(&v_out(numbers));
        numbers.extend(halves::<T>(&drawn).iter().map(|x| x.to_f64()));
        expected.push(numbers);
        rows.push(halves::<T>(&words));
    }
    let line = "var w = array<u32, 6>(0u, 0u, 0u, 0u, 0u, 0u);
        for (var k = 0u; k < 6u; k += 1u) { w[k] = u32(r(2u * k)) | (u32(r(2u * k + 1u)) << 16u); }
        let drawn = philox(vec4<u32>(w[0], w[1], w[2], w[3]), vec2<u32>(w[4], w[5]));
        put_v(0u, normal_vector(vec4<u32>(drawn.x, drawn.y, w[2], drawn.w)));
        for (var k = 0u; k < 4u; k += 1u) {
            put_r(3u + 2u * k, real(drawn[k] & 0xffffu));
            put_r(4u + 2u * k, real(drawn[k] >> 16u));
        }";
    let found = Harness::new().run(&torque_chunks(precision_of::<T>()), line, &rows, 11);
    let integers = |rows: &[Vec<f64>]| rows.iter().map(|row| row[3..].to_vec()).collect::<Vec<_>>();
    assert_eq!(integers(&expected), integers(&found), "random words");
    let normals = |rows: &[Vec<f64>]| rows.iter().map(|row| row[..3].to_vec()).collect::<Vec<_>>();
    compare_rows::<T>(&[VECTOR], &normals(&expected), &normals(&found), |_| 1.0, TRIGONOMETRIC)
        .unwrap_or_else(|mismatch| panic!("{mismatch}"))
}

#[test]
fn draws_agree() {
    let gpu = common::gpu();
    stays_within_measured(&gpu, Precision::F32, "draws", compared_draws::<f32>(0), 0.0);
    stays_within_measured(&gpu, Precision::F64, "draws", compared_draws::<f64>(0), 0.0);
}

#[test]
fn the_block_function_gives_the_published_words() {
    // Random123, kat_vectors: philox4x32 10.
    assert_eq!(philox([0; 4], [0; 2]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
    assert_eq!(philox([u32::MAX; 4], [u32::MAX; 2]), [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]);
}

const BODIES: usize = 203;
const DT: f64 = 1.0 / 64.0;

/// The bound after `steps` steps, in ulps of a vector's largest component: as in `parity`, a few roundings of each
/// step's increment, of which a torque adds as many as the motion itself has. Where both sides round alike, or fuse as lanes do, it is
/// four times what was measured.
pub fn bound(engine: &Engine, precision: Precision, steps: u64) -> f64 {
    let derived = match precision {
        Precision::F32 => 2.0 * steps as f64,
        Precision::F64 => 12.0 * steps as f64,
    };
    match STEPS.iter().position(|&other| other == steps) {
        Some(place) if is_measured(engine, precision) => derived.min(MEASURED_TIMES * measured(precision)[place]),
        _ => derived,
    }
}

/// Numbers of steps that are compared.
const STEPS: [u64; 2] = [1, 50];

/// The largest differences over [`SEEDS`] draws of all bodies after [`STEPS`], in ulps, in lanes, which fuse products and sums, and on lavapipe,
/// which rounds them apart as the twin does.
fn measured(precision: Precision) -> [f64; 2] {
    match precision {
        Precision::F32 => [1.4, 11.0],
        Precision::F64 => [2.0, 52.0],
    }
}

/// The largest difference of GPU and twin under some torques.
fn compared(gpu: &Engine, torques: &[Torque], precision: Precision, steps: u64) -> Result<f64, String> {
    compared_within(gpu, torques, precision, steps, 12, bound(gpu, precision, steps))
}

fn compared_within(
    engine: &Engine,
    torques: &[Torque],
    precision: Precision,
    steps: u64,
    seed: u64,
    bound: f64,
) -> Result<f64, String> {
    let batch = batch_under(BODIES, seed, torques, precision);
    let expected = common::advanced(&Engine::cpu_scalar(), &batch, Method::Rk4, DT, steps);
    let found = common::advanced(engine, &batch, Method::Rk4, DT, steps);
    match precision {
        Precision::F32 => compare_states::<f32>(&expected, &found, bound),
        Precision::F64 => compare_states::<f64>(&expected, &found, bound),
    }
    .map_err(|mismatch| mismatch.to_string())
}

/// Moments that change in the midst of the steps.
fn ramp() -> Torque {
    Torque::variable_inertia(InertiaChange::factor(0.6), Law::ramp(0.1, 0.5))
}

/// With parameters of each body's own.
fn oscillation() -> Torque {
    let column = |first: f64, last: f64| -> Vec<f64> {
        (0..BODIES).map(|body| first + (last - first) * body as f64 / BODIES as f64).collect()
    };
    Torque::variable_inertia(InertiaChange::factor(column(0.5, 2.0)), Law::oscillation(column(-3.0, 3.0)))
}

/// By a formula, which reads the time itself and a phase.
fn formula() -> Torque {
    let column = |first: f64, last: f64| -> Vec<f64> {
        (0..BODIES).map(|body| first + (last - first) * body as f64 / BODIES as f64).collect()
    };
    let parameters = Parameters::new().number("w", column(-3.0, 3.0)).and_then(|of| of.number("a", column(0.1, 0.6)));
    let text = "1 + a * sin(w * time) * time / (1 + time)";
    Torque::custom_inertia_factor(text, parameters.expect("names")).expect("a formula")
}

#[test]
fn steps_under_each_torque_and_under_all_of_them_agree_with_the_twin() {
    let gpu = common::gpu();
    let scenes = scenes(12);
    for precision in Precision::ALL {
        for (name, torques) in &scenes {
            for steps in STEPS {
                match compared(&gpu, torques, precision, steps) {
                    Ok(largest) => println!("{precision} {name}, {steps} steps: {largest:.3} ulps"),
                    Err(mismatch) => panic!("{precision} {name}, {steps} steps: {mismatch}"),
                }
            }
        }
    }
}

#[test]
#[ignore = "prints what `measured` says: cargo test --test mirror torque_parity::largest -- --ignored --nocapture"]
fn the_largest_differences_over_many_seeds() {
    for engine in [Engine::cpu(), common::gpu()] {
        for precision in Precision::ALL {
            let largest = STEPS.map(|steps| {
                let mut largest = (0.0, String::new());
                for seed in 0..SEEDS {
                    for (name, torques) in scenes(seed) {
                        let found = compared_within(&engine, &torques, precision, steps, seed, f64::MAX)
                            .unwrap_or_else(|mismatch| panic!("{precision} {name}, seed {seed}: {mismatch}"));
                        if found > largest.0 {
                            largest = (found, name);
                        }
                    }
                }
                largest
            });
            println!("{} {precision}: {largest:?}", engine.description().name);
        }
    }
}

/// Of the models that are registered those whose torques are everywhere in the tests, and a formula of a user's; moments that change have
/// instances of their own beside them.
#[test]
fn every_model_is_among_the_torques_of_the_tests() {
    // Sampled ones are formulas, which engines are compared with in `truth/control.rs` as they are sampled.
    let is_sampled = |model: &&Declaration| model.parameters.iter().any(|parameter| parameter.name == "every");
    let models = declarations().filter(|model| !is_sampled(model) && model.name != "variable-inertia");
    let mut expected: Vec<&str> = models.map(|model| &*model.name).collect();
    assert_eq!(declarations().filter(is_sampled).count(), 4, "a new sampled model: compare it in truth/control.rs");
    expected.push("custom");
    expected.sort_unstable();
    let all = every_torque(&[1.0]);
    let mut names: Vec<&str> = all.iter().map(Torque::name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names, expected, "put a new model at the end of `every_torque` in tests/common/torques.rs");
}

/// Each torque alone, all of them, while moments change, and each twice.
fn scenes(seed: u64) -> Vec<(String, Vec<Torque>)> {
    let all = every_torque(&middle_moments(BODIES, seed));
    let mut scenes: Vec<(String, Vec<Torque>)> =
        all.iter().map(|torque| (torque.name().to_owned(), vec![torque.clone()])).collect();
    scenes.push(("all".into(), all.clone()));
    for (name, change) in [("ramp", ramp()), ("oscillation", oscillation()), ("formula", formula())] {
        scenes.push((name.into(), vec![change.clone()]));
        scenes.push(("all while moments change".into(), [all.clone(), vec![change]].concat()));
    }
    scenes.push(("all twice".into(), [all.clone(), all.clone()].concat()));
    scenes
}

#[test]
fn lanes_agree_with_the_scalar_twin_under_every_torque() {
    let all = every_torque(&middle_moments(BODIES, 12));
    for precision in Precision::ALL {
        for change in [ramp(), oscillation(), formula()] {
            let torques = [all.clone(), vec![change]].concat();
            compared(&Engine::cpu(), &torques, precision, 50)
                .unwrap_or_else(|mismatch| panic!("{precision}: {mismatch}"));
        }
        compared(&Engine::cpu(), &all, precision, 50).unwrap_or_else(|mismatch| panic!("{precision}: {mismatch}"));
    }
}

#[test]
fn a_planted_fault_in_a_torque_is_found_after_one_step() {
    // Few, as each device compiles its own kernel.
    let mut few = every_torque(&middle_moments(BODIES, 12));
    few.retain(|torque| ["heavy-top", "sinusoidal", "white-noise", "gravity-gradient"].contains(&torque.name()));
    few.push(oscillation());
    // A part in a hundred of a torque, and its place in the sum; of every kind a tenth of it is found and named in verify/faults.rs.
    for (file, from, to) in [
        ("torque/heavy_top.wgsl", "    return ", "    return 1.01 * "),
        ("torque/terms.wgsl", "sum = sum + heavy_top", "sum = sum - heavy_top"),
        ("clock.wgsl", "phase.w", "(phase.w ^ 65536u)"),
        ("torque/white_noise.wgsl", "0x9e3779b9u", "0x9e3779b8u"),
        ("torque/variable_inertia.wgsl", "angle.sin * angle.sin", "angle.sin * angle.cos"),
        ("torque/variable_inertia.wgsl", "fma(difference, share, value)", "fma(difference, ones, value)"),
        ("kepler.wgsl", "let start = 0.85 * eccentricity;", "let start = 40.0 * eccentricity;"),
    ] {
        let mut options = common::any_adapter();
        options.patches = vec![Patch { file: file.into(), from: from.into(), to: to.into() }];
        let gpu = common::gpu_with(options);
        let result = compared(&gpu, &few, Precision::F64, 1);
        assert!(result.is_err(), "{file}: {to} passed: {result:?}");
    }
}
