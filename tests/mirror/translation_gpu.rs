//! Centres of mass that a GPU moves along with its steps: its functions and steps against the host's, far from the origin,
//! cuts, and nothing read back on the way. Golden cases stand in `translation.rs`.

use crate::common;

use common::asymmetric_ensemble;
use common::compare::{Field, compare_rows};
use common::kernel::{Harness, chunks};
use common::measured::{MEASURED_TIMES, is_measured, over_seeds, stays_within_measured};
use common::random::Random;
use glam::{DQuat, DVec3};
use polhode::bodies::columns::state_columns;
use polhode::bodies::ensemble::Translation;
use polhode::engine::gpu::shader::{Chunk, Source};
use polhode::engine::gpu::{GpuOptions, Patch};
use polhode::engine::{Backend, Engine};
use polhode::math::Precision;
use polhode::math::real::Scalar;
use polhode::torque::TorqueTable;
use polhode::torque::force::Accelerations;
use polhode::torque::force::carried::CENTRE_COMPONENTS;
use polhode::torque::force::quadratic_drag::rate;
use polhode::torque::force::stepped::{Attitude, Between, Centre};
use polhode::{Force, Method, Outputs, Plan, Record, Scene, Torque};

/// Rows of a table: not a multiple of the workgroup size.
const ROWS: usize = 331;

const REAL: Field = Field { name: "real", components: 1 };
const VECTOR: Field = Field { name: "vector", components: 3 };
const QUATERNION: Field = Field { name: "quaternion", components: 4 };

fn precision_of<T: Scalar>() -> Precision {
    if T::WORDS == 2 { Precision::F32 } else { Precision::F64 }
}

/// What every kernel shares, and the functions of forces, which read no column.
fn force_chunks(precision: Precision) -> Vec<Chunk> {
    let mut all = chunks(precision, Method::Rk4);
    all.retain(|chunk| !chunk.file.starts_with("force/"));
    all.extend(Source::forces(true).into_iter().filter(|chunk| chunk.file != "force/carried.wgsl"));
    all
}

/// Columns 0 to 3 and 4 to 7 unit quaternions less than a radian apart, 8 to 10 and 11 to 13 rates, 14 a fraction, 15 to 17 a
/// constant acceleration, 18 and 19 drag, 20 to 22 thrust, 23 to 25 a velocity, 26 a span.
fn rows<T: Scalar>(seed: u64) -> Vec<Vec<T>> {
    let mut random = Random::new(61 + 1000 * seed);
    (0..ROWS)
        .map(|row| {
            let mut vector = |size: f64| DVec3::from_array([(); 3].map(|()| random.between(-size, size)));
            let (first, second) = (vector(0.4), vector(0.4));
            let start = DQuat::from_scaled_axis(vector(2.0));
            let end = start * DQuat::from_scaled_axis(first);
            let end = if row % 3 == 0 { -end } else { end };
            let (constant, thrust, velocity) = (vector(2.0), vector(1.0), vector(3.0));
            let mut numbers = [start.to_array(), end.to_array()].concat();
            numbers.extend((first + 0.02 * second).to_array());
            numbers.extend((first - 0.02 * second).to_array());
            numbers.push(if row % 5 == 0 { (row % 2) as f64 } else { random.between(0.0, 1.0) });
            numbers.extend(constant.to_array());
            // Up to some tens of steps of the centre of mass in one of the rotation.
            numbers.extend([random.between(0.0, 0.3), if row % 4 == 0 { 0.0 } else { random.between(0.0, 0.2) }]);
            numbers.extend(thrust.to_array());
            numbers.extend(velocity.to_array());
            numbers.push(random.between(0.01, 0.4));
            numbers.into_iter().map(T::from_f64).collect()
        })
        .collect()
}

fn number<T: Scalar>(row: &[T], column: usize) -> f64 {
    row[column].to_f64()
}

fn vector<T: Scalar>(row: &[T], first: usize) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|axis| number(row, first + axis)))
}

fn between<T: Scalar>(row: &[T]) -> Between {
    let quaternion = |first: usize| DQuat::from_array([0, 1, 2, 3].map(|part| number(row, first + part)));
    Between::new((quaternion(0), vector(row, 8)), (quaternion(4), vector(row, 11)), 1.0)
}

fn forces<T: Scalar>(row: &[T]) -> Accelerations {
    Accelerations {
        constant_world: vector(row, 15),
        linear_drag: number(row, 18),
        quadratic_drag: number(row, 19),
        thrust_body: vector(row, 20),
    }
}

/// A function of the shaders and what the host, in `f64`, gives; the bound in ulps of the largest component, or of 1.
type Case<T> = (&'static str, &'static [Field], f64, fn(&[T]) -> Vec<f64>);

/// The largest differences over 100 tables on lavapipe, in `f32` and in `f64`, by the order of [`cases`].
const MEASURED_FUNCTIONS: [[f64; 2]; 4] = [[1.43, 1.0], [3.20, 4.0], [1.68, 0.0], [1.49, 9.0]];

macro_rules! with_forces {
    ($line:literal) => {
        concat!(
            "let a = between_new(q(0u), orientation_rate(q(0u), v(8u)), q(4u), orientation_rate(q(4u), v(11u)));",
            "let f = Accelerations(v(15u), r(18u), r(19u), v(20u));",
            $line
        )
    };
}

fn cases<T: Scalar>() -> Vec<Case<T>> {
    vec![
        // Products of two quaternions and a vector, polynomials of degree 3 and a root.
        (with_forces!("put_q(0u, between_at(a, r(14u)));"), &[QUATERNION], 16.0, |row| {
            between(row).at(number(row, 14)).to_array().to_vec()
        }),
        // The magnitudes of all that is added come to 15.
        (with_forces!("put_v(0u, acceleration_at(f, q(0u), v(23u)));"), &[VECTOR], 48.0, |row| {
            let orientation = DQuat::from_array([0, 1, 2, 3].map(|part| number(row, part)));
            forces(row).at(orientation, vector(row, 23)).to_array().to_vec()
        }),
        ("put_r(0u, quadratic_drag_rate(r(19u), v(23u), r(14u)));", &[REAL], 8.0, |row| {
            vec![rate(number(row, 19), vector(row, 23), number(row, 14))]
        }),
        // Up to thirty steps, each of whose increments is rounded a few times and added to numbers of up to 5.
        (
            with_forces!(
                "let zero = vector(0.0, 0.0, 0.0); let c = Centre(TwoWordsVector(zero, zero), TwoWordsVector(v(23u), zero)); \
                 let moved = centre_advance(c, f, a, TwoWordsReal(r(26u), 0.0)); \
                 put_v(0u, moved.position.value + moved.position.residue); \
                 put_v(3u, moved.velocity.value + moved.velocity.residue);"
            ),
            &[VECTOR, VECTOR],
            64.0,
            |row| {
                let mut centre = Centre::new(DVec3::ZERO, vector(row, 23));
                centre.advance(&forces(row), &between(row), number(row, 26));
                [centre.position().to_array(), centre.velocity().to_array()].concat()
            },
        ),
    ]
}

/// The largest difference of a case over the rows of a seed, in ulps.
fn compared_function<T: Scalar>(harness: &Harness, case: &Case<T>, seed: u64) -> f64 {
    let (line, fields, ulps, twin) = case;
    let (chunks, rows) = (force_chunks(precision_of::<T>()), rows::<T>(seed));
    let expected: Vec<Vec<f64>> = rows.iter().map(|row| twin(row)).collect();
    let found = harness.run(&chunks, line, &rows, expected[0].len());
    compare_rows::<T>(fields, &expected, &found, |_| 1.0, *ulps).unwrap_or_else(|mismatch| panic!("{line}: {mismatch}"))
}

fn check_functions<T: Scalar>() {
    let (harness, gpu) = (Harness::new(), common::gpu());
    for (case, measured) in cases::<T>().iter().zip(MEASURED_FUNCTIONS) {
        let largest = compared_function(&harness, case, 0);
        stays_within_measured(&gpu, precision_of::<T>(), case.0, largest, measured[2 - T::WORDS]);
    }
}

#[test]
#[ignore = "prints what was measured: cargo test --test mirror translation_gpu::largest -- --ignored --nocapture"]
fn largest_differences_over_many_seeds() {
    fn functions<T: Scalar>() {
        let harness = Harness::new();
        for case in cases::<T>() {
            let largest = over_seeds(|seed| compared_function(&harness, &case, seed));
            println!("{} {}: {largest:.3} of {} ulps", precision_of::<T>(), case.0, case.2);
        }
    }
    functions::<f32>();
    functions::<f64>();
    let (gpu, host) = (common::gpu(), Engine::cpu_scalar());
    for precision in Precision::ALL {
        let of_seed =
            |seed| flights(&gpu, &host, precision, seed).into_iter().map(|flight| flight.2).fold(0.0, f64::max);
        println!("steps in {precision}: {:.3}", over_seeds(of_seed));
    }
}

#[test]
fn every_function_of_forces_agrees_with_the_host() {
    check_functions::<f32>();
    check_functions::<f64>();
}

const SEED: u64 = 9;
/// Bodies: not a multiple of the workgroup size.
const COUNT: usize = 131;
const DT: f64 = 1.0 / 64.0;

/// Bodies of a few kilogrammes at `distance` (m) from the origin under every force, so that each adds to their motion.
fn scene(distance: f64, torques: &[Torque], outputs: Outputs, end: f64) -> Scene {
    scene_of(0, distance, torques, outputs, end)
}

/// The same with other draws.
fn scene_of(seed: u64, distance: f64, torques: &[Torque], outputs: Outputs, end: f64) -> Scene {
    let mut random = Random::new(62 + 1000 * seed);
    let mut vectors = |size: f64| -> Vec<DVec3> {
        (0..COUNT).map(|_| DVec3::from_array([(); 3].map(|()| random.between(-size, size)))).collect()
    };
    let (position, velocity, thrust) = (vectors(distance), vectors(3.0), vectors(2.0));
    let mass: Vec<f64> = (0..COUNT).map(|body| 1.0 + 0.03 * body as f64).collect();
    let ensemble = asymmetric_ensemble(COUNT, SEED + seed)
        .with_translation(Translation { mass, position, velocity })
        .expect("valid bodies");
    let scene = Scene::new(ensemble)
        .until(end)
        .outputs(outputs)
        .force(Force::gravity(DVec3::new(0.0, 0.3, -1.0)))
        .force(Force::constant(DVec3::new(0.2, 0.0, 0.1)))
        .force(Force::linear_drag(0.2))
        // One to two steps of the centre of mass in one of the rotation.
        .force(Force::quadratic_drag(0.3))
        .force(Force::thrust(thrust));
    torques.iter().fold(scene, |scene, torque| scene.torque(torque.clone()))
}

/// A torque under which the axes turn at another rate than ω, and one that depends on time.
fn torques() -> [Torque; 2] {
    let moments = common::torques::middle_moments(COUNT, SEED);
    let slip: Vec<f64> = moments.iter().map(|i| 0.05 / i).collect();
    let sine: Vec<DVec3> = moments.iter().map(|i| DVec3::new(0.3, -0.2, 0.1) * *i).collect();
    [Torque::internal_dissipation(slip), Torque::sinusoidal(sine, DVec3::ZERO, 1.75)]
}

fn run(engine: &Engine, scene: &Scene) -> Record {
    engine.run(&Plan::new(scene, engine).expect("planned")).expect("run")
}

/// The greater of two numbers, and what is no number where one is none.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b <= a { a } else { b }
}

/// The greatest differences of positions (m) and velocities (m/s) of two records.
fn differences(a: &Record, b: &Record) -> (f64, f64) {
    let mut largest = (0.0, 0.0);
    assert_eq!(a.snapshots().len(), b.snapshots().len());
    for (a, b) in a.snapshots().iter().zip(b.snapshots()) {
        for body in 0..COUNT {
            largest.0 = larger(largest.0, (a.positions()[body] - b.positions()[body]).length());
            largest.1 = larger(largest.1, (a.velocities()[body] - b.velocities()[body]).length());
        }
    }
    largest
}

/// Steps that are compared one by one.
const STEPS: u64 = 64;

/// The largest parts of their derived bounds that positions and velocities came to over 100 draws of all bodies on lavapipe, in `f32` and in `f64`.
const MEASURED_STEPS: [f64; 2] = [0.080, 0.145];

/// How far a GPU may move a body from where the host does in [`STEPS`] steps, m and m/s.
fn step_bound(gpu: &Engine, precision: Precision) -> f64 {
    let measured = MEASURED_STEPS[usize::from(precision == Precision::F64)];
    derived_step_bound(precision) * if is_measured(gpu, precision) { MEASURED_TIMES * measured } else { 1.0 }
}

fn derived_step_bound(precision: Precision) -> f64 {
    match precision {
        // Both words are kept; parameters, attitudes and increments are rounded, a few times each, relative to paths of up to
        // 8 m.
        Precision::F32 => 8.0 * 2.0_f64.powi(-24) * 8.0,
        // Positions of up to 16√3 m are rounded at each step on the GPU.
        Precision::F64 => 2.0_f64.powi(-53) * 16.0 * 3.0_f64.sqrt() * STEPS as f64,
    }
}

#[test]
fn planted_faults_in_the_translation_are_found() {
    let scene =
        scene(10.0, &[], Outputs::End, STEPS as f64 * DT).pinned(Method::Rk4, DT, Some(Precision::F32)).skipping(false);
    let expected = run(&Engine::cpu_scalar(), &scene);
    for (file, from, to) in [
        ("force/thrust.wgsl", "rotate(orientation, thrust)", "rotate_inverse(orientation, thrust)"),
        ("force/quadratic_drag.wgsl", "-coefficient * sqrt", "-1.001 * coefficient * sqrt"),
        ("force/stepped.wgsl", "(1.0 / 6.0), rounded_vector", "(1.0 / 5.0), rounded_vector"),
        ("force/stepped.wgsl", "select(end_rate, -end_rate, opposite)", "-end_rate"),
        (
            "force/carried.wgsl",
            "return SteppedTranslation(centre, translation.forces, orientation, rate)",
            "return SteppedTranslation(centre, translation.forces, translation.orientation, rate)",
        ),
    ] {
        let patch = Patch { file: file.into(), from: from.into(), to: to.into() };
        let faulty = common::gpu_with(GpuOptions { patches: vec![patch], ..common::any_adapter() });
        let (position, velocity) = differences(&run(&faulty, &scene), &expected);
        let bound = step_bound(&common::gpu(), Precision::F32);
        assert!(!(position <= bound && velocity <= bound), "{file}: {to} passed: {position:e} m, {velocity:e} m/s");
    }
}

/// What is flown, and the largest part of the derived bound that a position or a velocity comes to.
fn flights(gpu: &Engine, host: &Engine, precision: Precision, seed: u64) -> Vec<(String, Outputs, f64)> {
    let mut found = Vec::new();
    for torques in [&[][..], &torques()] {
        for method in [Method::Rk4, Method::Rk8, Method::Splitting4] {
            // Splittings refuse internal dissipation, which stands first.
            let torques = if method == Method::Splitting4 { &torques[torques.len().min(1)..] } else { torques };
            // Every step alone, and as many in one dispatch as there are.
            for outputs in [Outputs::Every(DT), Outputs::End] {
                let scene = scene_of(seed, 10.0, torques, outputs.clone(), STEPS as f64 * DT)
                    .pinned(method, DT, Some(precision))
                    .skipping(false);
                let (position, velocity) = differences(&run(gpu, &scene), &run(host, &scene));
                let what = format!("{} torques, {method}", torques.len());
                found.push((what, outputs, larger(position, velocity) / derived_step_bound(precision)));
            }
        }
    }
    found
}

#[test]
fn step_by_step_a_gpu_moves_bodies_as_the_host_does() {
    let (gpu, host) = (common::gpu(), Engine::cpu_scalar());
    for precision in Precision::ALL {
        for (what, outputs, part) in flights(&gpu, &host, precision, 0) {
            let what = format!("{what}, {outputs:?}");
            assert!(part <= 1.0, "{what} in {precision}: {part} of the bound");
            stays_within_measured(
                &gpu,
                precision,
                &what,
                part,
                MEASURED_STEPS[usize::from(precision == Precision::F64)],
            );
        }
    }
}

/// 1e7 m from the origin the numbers of f32 lie 1 m apart; a step moves a body by some centimetres.
#[test]
fn positions_far_from_the_origin_keep_what_steps_add() {
    const STEPS: u64 = 2048;
    let (gpu, host) = (common::gpu(), Engine::cpu());
    let end = STEPS as f64 * DT;
    let run = |engine, distance, precision| {
        let scene = scene(distance, &[], Outputs::End, end).pinned(Method::Rk4, DT, Some(precision)).skipping(false);
        let record = run(engine, &scene);
        let start = scene.ensemble().translation().expect("they move").position.clone();
        let moved: Vec<DVec3> = (0..COUNT).map(|body| record.final_state().positions()[body] - start[body]).collect();
        moved
    };
    let near = run(&gpu, 1.0, Precision::F32);
    let far = run(&gpu, 1e7, Precision::F32);
    let expected = run(&host, 1e7, Precision::F64);
    for body in 0..COUNT {
        let (shift, error) = ((far[body] - near[body]).length(), (far[body] - expected[body]).length());
        let path = expected[body].length();
        // Both words of a position hold 48 bits: 4e-8 m of 1e7 m, at the start and at each rounding of the second word.
        assert!(shift <= 1e-7 * path.max(1.0) + 1e-6, "body {body}: {shift:e} m of {path} m");
        // Forces and attitudes in f32 turn and stretch the path by 1e-6 at most.
        assert!(error <= 2e-6 * path.max(10.0), "body {body}: {error:e} m of {path} m");
    }
}

#[test]
fn nothing_is_read_back_between_outputs() {
    let gpu = common::own_gpu();
    for (precision, size) in [(Precision::F32, 4), (Precision::F64, 8)] {
        let outputs = 3;
        let scene = scene(10.0, &[], Outputs::Every(1.0), f64::from(outputs))
            .pinned(Method::Rk4, DT, Some(precision))
            .skipping(false);
        let columns = match precision {
            Precision::F32 => state_columns::<f32>() + 2 * CENTRE_COMPONENTS,
            Precision::F64 => state_columns::<f64>() + CENTRE_COMPONENTS,
        };
        let read = run(&gpu, &scene).trust().traffic.bytes_read;
        assert_eq!(read, (columns * size * COUNT) as u64 * u64::from(outputs as u32), "{precision}");
    }
}

#[test]
fn a_scene_without_thrust_has_no_code_of_translation() {
    for precision in Precision::ALL {
        let source = Source::advance_under(precision, Method::Rk4, &TorqueTable::none(1.0));
        let files: Vec<_> =
            source.chunks().iter().map(|chunk| chunk.file).filter(|file| file.starts_with("force/")).collect();
        assert_eq!(files, ["force/none.wgsl"]);
    }
    // Nor does it read more than the rotation.
    let gpu = common::own_gpu();
    let scene = Scene::new(asymmetric_ensemble(COUNT, SEED)).until(1.0).pinned(Method::Rk4, DT, Some(Precision::F64));
    let read = run(&gpu, &scene.skipping(false)).trust().traffic.bytes_read;
    assert_eq!(read, (state_columns::<f64>() * size_of::<f64>() * COUNT) as u64);
}

#[test]
fn positions_do_not_depend_on_cuts() {
    let whole = common::gpu();
    for precision in Precision::ALL {
        let scene = scene(10.0, &torques(), Outputs::Every(0.5), 1.0).pinned(Method::Rk4, DT, Some(precision));
        let expected = run(&whole, &scene);
        for (bodies, steps) in [(64, 1), (128, 7)] {
            let found = run(&common::gpu_with(common::cut_options(bodies, steps)), &scene);
            assert_eq!(differences(&found, &expected), (0.0, 0.0), "{precision}: {bodies} bodies, {steps} steps");
        }
    }
}

/// Drag that changes the velocity by its own size in a hundredth of a step would need more steps of the centre of mass than a
/// dispatch should take: the host follows.
#[test]
fn drag_beyond_what_an_engine_takes_is_left_to_the_host() {
    let strong = |engine: &Engine| {
        let scene = scene(10.0, &[], Outputs::End, 4.0 * DT)
            .force(Force::linear_drag(2e4))
            .pinned(Method::Rk4, DT, Some(Precision::F64))
            .skipping(false);
        run(engine, &scene)
    };
    let (found, expected) = (strong(&common::own_gpu()), strong(&Engine::cpu_scalar()));
    let (position, velocity) = differences(&found, &expected);
    assert!(position <= 1e-13 && velocity <= 1e-13, "{position:e}, {velocity:e}");
    assert!(found.trust().traffic.bytes_read > (4 * state_columns::<f64>() * size_of::<f64>() * COUNT) as u64);
    assert!(common::gpu().carries_centres() && !Engine::cpu().carries_centres());
}
