//! The faults that this suite must catch, each planted in a shader and run through the suite's own checks: it must be
//! caught by the check that is named beside it, and no check may fail on the shaders as they are.

use crate::common;
use crate::{free_motion_parity, step_parity, torque_parity};

use common::compare::{compare_states, first_bit_difference};
use common::torques::{batch_under, every_torque, middle_moments};
use polhode::bodies::columns::StateWords;
use polhode::engine::batch::AnyBatch;
use polhode::engine::gpu::{GpuOptions, Patch};
use polhode::engine::{End, Engine, unobserved};
use polhode::kernel::free_motion::AnyRows;
use polhode::math::Precision;
use polhode::study::problem;
use polhode::torque::Torque;
use polhode::verify::{Options, verify};
use polhode::{Ensemble, Method, Scene};

/// A fault: what is wrong, where, what stands there and what is put in its place, and which check must catch it.
struct Fault {
    name: &'static str,
    file: &'static str,
    from: &'static str,
    to: &'static str,
    check: Check,
}

/// A check of the suite, by the test file whose comparison it is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Check {
    /// tests/mirror/step_parity.rs: one step of a method against the scalar twin.
    Step(Method, Precision),
    /// tests/mirror/torque_parity.rs: one step under every torque against the scalar twin.
    Torques,
    /// tests/mirror/determinism.rs: bodies up to the last, of ensembles that fill no workgroup, against the CPU engine.
    Sizes,
    /// tests/mirror/determinism.rs: a run under a torque that depends on time, cut into chunks and slices, against the whole.
    Cuts,
    /// tests/mirror/verify: short steps, each from the twin's state.
    ShortSteps,
    /// tests/mirror/free_motion_parity.rs: the closed form at a distant time against the scalar twin.
    ClosedForm(Precision),
}

const FAULTS: [Fault; 16] = [
    Fault {
        name: "gyroscopic sign",
        file: "rigid_body.wgsl",
        from: "a.zxy, a.yzx",
        to: "a.yzx, a.zxy",
        check: Check::Step(Method::Rk4, Precision::F32),
    },
    Fault {
        name: "dropped term",
        file: "method/slope.wgsl",
        from: "var m_rate = motion.gyroscopic_term",
        to: "var m_rate = vector(0.0, 0.0, 0.0)",
        check: Check::Step(Method::Rk4, Precision::F32),
    },
    Fault {
        name: "transposed tensor",
        file: "torque/eddy_current.wgsl",
        from: "fn eddy_current(",
        to: "fn eddy_current(k: real, d: vector, q: quaternion, omega: vector) -> vector {
    return transposed(k, d, conjugate(q), omega);
}
fn transposed(",
        check: Check::Torques,
    },
    Fault {
        name: "quaternion order",
        file: "quaternion.wgsl",
        from: "mul_add(q.w, v.x, mul_add(q.y, v.z, -(q.z * v.y)))",
        to: "mul_add(q.w, v.x, mul_add(q.z, v.y, -(q.y * v.z)))",
        check: Check::Step(Method::Rk4, Precision::F32),
    },
    Fault {
        name: "wrong half-angle",
        file: "method/dlm.wgsl",
        from: "sin_cos(angle * 0.25)",
        to: "sin_cos(angle * 0.5)",
        check: Check::Step(Method::Dlm, Precision::F32),
    },
    Fault {
        name: "compensation of the angular momentum removed",
        file: "real_f32.wgsl",
        from: "TwoWordsVector(value, corrected - taken)",
        to: "TwoWordsVector(value, vector(0.0, 0.0, 0.0))",
        check: Check::ShortSteps,
    },
    Fault {
        name: "compensation of the orientation removed",
        file: "real_f32.wgsl",
        from: "TwoWordsQuaternion(value, corrected - taken)",
        to: "TwoWordsQuaternion(value, quaternion(0.0, 0.0, 0.0, 0.0))",
        check: Check::ShortSteps,
    },
    Fault {
        name: "off-by-one step count",
        file: "advance.wgsl",
        from: "n < settings.steps",
        to: "n + 1u < settings.steps",
        check: Check::Step(Method::Rk4, Precision::F64),
    },
    Fault {
        name: "stale uniform: the time of the first dispatch in every later one",
        file: "torque/equal_steps.wgsl",
        from: "sum_128(settings.clock, ",
        to: "sum_128(vec4<u32>(0u, 0u, 0u, 0u), ",
        check: Check::Cuts,
    },
    Fault {
        name: "swapped columns",
        file: "columns.wgsl",
        from: "state_at(first + 4u, i), state_at(first + 5u, i)",
        to: "state_at(first + 5u, i), state_at(first + 4u, i)",
        check: Check::Step(Method::Rk4, Precision::F32),
    },
    Fault {
        name: "last partial workgroup skipped",
        file: "advance.wgsl",
        from: "i >= settings.body_count",
        to: "i >= settings.body_count / workgroup_size * workgroup_size",
        check: Check::Sizes,
    },
    Fault {
        name: "chunk border off by one",
        file: "advance.wgsl",
        from: "i >= settings.body_count",
        to: "i + 1u >= settings.body_count",
        check: Check::Sizes,
    },
    Fault {
        name: "unwritten output",
        file: "columns.wgsl",
        from: "state_columns[7u * WORDS * settings.stride + i] = state.status;",
        to: "if (i == 7u) { state_columns[i] = real(2.0); }",
        check: Check::Sizes,
    },
    Fault {
        name: "truncated series in f32",
        file: "real_f32.wgsl",
        from: "var p: real = -1.9515295891e-4;",
        to: "var p: real = 0.0;",
        check: Check::ClosedForm(Precision::F32),
    },
    Fault {
        name: "truncated series in f64",
        file: "real_f64.wgsl",
        from: "var p: real = 1.58962301576546568060e-10;",
        to: "var p: real = 0.0;",
        check: Check::ClosedForm(Precision::F64),
    },
    Fault {
        name: "a phase rounded to f32",
        file: "phase.wgsl",
        from: "return wide_sum(start, select(advanced, wide_negative(advanced), backward));",
        to: "return wide_sum(start, select(advanced, wide_negative(advanced), backward)) & vec2<u32>(0u, 0xffffff00u);",
        check: Check::ClosedForm(Precision::F64),
    },
];

const DT: f64 = 1.0 / 64.0;
const BODIES: usize = 203;
const SEED: u64 = 12;

fn compared(expected: &StateWords, found: &StateWords, precision: Precision, bound: f64) -> Result<(), String> {
    match precision {
        Precision::F32 => compare_states::<f32>(expected, found, bound),
        Precision::F64 => compare_states::<f64>(expected, found, bound),
    }
    .map(|_| ())
    .map_err(|mismatch| mismatch.to_string())
}

fn against_twin(gpu: &Engine, batch: &AnyBatch, method: Method, steps: u64, bound: f64) -> Result<(), String> {
    let expected = common::advanced(&common::twin(gpu, batch.precision()), batch, method, DT, steps);
    compared(&expected, &common::advanced(gpu, batch, method, DT, steps), batch.precision(), bound)
}

fn evaluated(engine: &Engine, ensemble: &Ensemble, precision: Precision, time: f64) -> StateWords {
    let (_, rows) = AnyRows::prepare(ensemble, precision).expect("enough memory");
    let mut session = engine.start_free(rows).expect("started");
    session.advance_to(End::at(time), &mut unobserved).expect("evaluated");
    session.read(0..ensemble.len()).expect("read")
}

impl Check {
    const ALL: [Check; 9] = [
        Check::Step(Method::Rk4, Precision::F32),
        Check::Step(Method::Rk4, Precision::F64),
        Check::Step(Method::Dlm, Precision::F32),
        Check::Torques,
        Check::Sizes,
        Check::Cuts,
        Check::ShortSteps,
        Check::ClosedForm(Precision::F32),
        Check::ClosedForm(Precision::F64),
    ];

    /// Runs the check on the GPU with the shaders changed; the error says what it found.
    fn run(self, patches: &[Patch]) -> Result<(), String> {
        let options = || GpuOptions { patches: patches.to_vec(), ..common::any_adapter() };
        let gpu = common::gpu_with(options());
        match self {
            Check::Step(method, precision) => {
                let bound = step_parity::bound(&gpu, precision, method, 1);
                against_twin(&gpu, &common::asymmetric_batch(BODIES, SEED, precision), method, 1, bound)
            }
            Check::Torques => {
                let torques = every_torque(&middle_moments(BODIES, SEED));
                let batch = batch_under(BODIES, SEED, &torques, Precision::F64);
                against_twin(&gpu, &batch, Method::Rk4, 1, torque_parity::bound(&gpu, Precision::F64, 1))
            }
            Check::Sizes => [1, 63, 64, 65, 130].into_iter().try_for_each(|count| {
                let batch = common::asymmetric_batch(count, SEED, Precision::F32);
                let bound = 3.0 * step_parity::bound(&gpu, Precision::F32, Method::Rk4, 1);
                against_twin(&gpu, &batch, Method::Rk4, 3, bound)
            }),
            Check::Cuts => {
                let moments = middle_moments(BODIES, SEED);
                let torque = moments.iter().map(|moment| glam::DVec3::X * *moment).collect::<Vec<_>>();
                let torques = [Torque::sinusoidal(torque.clone(), torque, 1.75)];
                let batch = batch_under(BODIES, SEED, &torques, Precision::F32);
                let whole = common::advanced(&gpu, &batch, Method::Rk4, DT, 40);
                let cut = common::cut_options(64, 7);
                let cut = common::gpu_with(GpuOptions { patches: patches.to_vec(), ..cut });
                let found = common::advanced(&cut, &batch, Method::Rk4, DT, 40);
                first_bit_difference(&whole, &found).map_or(Ok(()), Err)
            }
            Check::ShortSteps => {
                let scene = Scene::new(problem::free(67, 7).expect("valid")).until(DT).skipping(false);
                let scene = scene.pinned(Method::Rk4, DT / 256.0, Some(Precision::F32));
                let report = verify(&gpu, &scene, &Options::default()).expect("both sides run");
                report.parting().map_or(Ok(()), |parting| Err(format!("{parting:?}")))
            }
            Check::ClosedForm(precision) => {
                let ensemble = common::asymmetric_ensemble(BODIES, SEED);
                let expected = evaluated(&Engine::cpu_scalar(), &ensemble, precision, 1e5);
                let found = evaluated(&gpu, &ensemble, precision, 1e5);
                compared(&expected, &found, precision, free_motion_parity::state_bound(&gpu, precision))
            }
        }
    }
}

#[test]
fn no_check_fails_on_the_shaders_as_they_are() {
    for check in Check::ALL {
        if let Err(found) = check.run(&[]) {
            panic!("{check:?}: {found}");
        }
    }
}

#[test]
fn every_planted_fault_is_caught_by_the_check_beside_it() {
    let mut uncaught = Vec::new();
    for Fault { name, file, from, to, check } in FAULTS {
        assert!(Check::ALL.contains(&check), "{check:?} is not held on the shaders as they are");
        let patch = Patch { file: file.to_owned(), from: from.to_owned(), to: to.to_owned() };
        match check.run(&[patch]) {
            Err(found) => println!("| {name} | {check:?} | {found} |"),
            Ok(()) => uncaught.push(format!("{name} passes {check:?}")),
        }
    }
    assert!(uncaught.is_empty(), "{}", uncaught.join("\n"));
}

/// An entry of tests/mutations.txt.
struct Mutation<'a> {
    name: &'a str,
    file: &'a str,
    /// What stands in the file, without the marks around the expression.
    from: String,
    to: &'a str,
    test: &'a str,
    filter: &'a str,
}

fn mutation<'a>(lines: &[&'a str]) -> Mutation<'a> {
    let field = |mark: &str| {
        let found = lines.iter().find_map(|line| line.strip_prefix(mark));
        found.unwrap_or_else(|| panic!("{}: no line begins with {mark:?}", lines[0]))
    };
    let (test, filter) = field("= ").split_once(' ').unwrap_or((field("= "), ""));
    let name = lines[0].trim_end_matches(" [issue]");
    Mutation { name, file: lines[1], from: field("- ").replace(['«', '»'], ""), to: field("+ "), test, filter }
}

/// Says why an entry cannot be planted, or its test not be run.
fn what_is_stale(mutation: &Mutation<'_>) -> Option<String> {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let Ok(text) = std::fs::read_to_string(root.join(mutation.file)) else {
        return Some(format!("{} is not there", mutation.file));
    };
    let count = text.matches(&mutation.from).count();
    // Every occurrence in a shader is changed, in Rust the only one.
    if count == 0 || (count > 1 && !mutation.file.starts_with("shaders/")) {
        return Some(format!("{:?} occurs {count} times in {}", mutation.from, mutation.file));
    }
    if mutation.from == mutation.to {
        return Some("nothing is changed".to_owned());
    }
    // A binary of one file, or a folder, in which the filter's first name may be a file or a folder of its own.
    let file = root.join(format!("tests/{}.rs", mutation.test));
    let folder = root.join("tests").join(mutation.test);
    let (module, names) = mutation.filter.split_once("::").unwrap_or((mutation.filter, ""));
    let within = folder.join(module);
    let (mut files, names) = match within.with_extension("rs") {
        _ if file.exists() => (vec![file], mutation.filter),
        one if one.exists() => (vec![one], names),
        _ if within.exists() => (vec![within], names),
        _ => (vec![folder], mutation.filter),
    };
    let mut texts = String::new();
    while let Some(file) = files.pop() {
        // Here stand the names that no test has.
        if file.ends_with("planted_faults.rs") {
            continue;
        }
        match std::fs::read_dir(&file) {
            Ok(entries) => files.extend(entries.map(|entry| entry.expect("an entry").path())),
            Err(_) if file.exists() => texts += &std::fs::read_to_string(&file).expect("a test"),
            Err(_) => return Some(format!("there is no test {}", mutation.test)),
        }
    }
    let missing = names.split("::").find(|part| !texts.contains(part));
    missing.map(|part| format!("{part} stands nowhere in the test {}", mutation.test))
}

#[test]
fn every_mutation_of_the_list_applies_and_has_its_test() {
    let table = include_str!("../mutations.txt");
    let lines: Vec<&str> = table.lines().filter(|line| !line.starts_with('#')).collect();
    let entries: Vec<Mutation<'_>> =
        lines.split(|line| line.trim().is_empty()).filter(|entry| !entry.is_empty()).map(mutation).collect();
    assert!(entries.len() >= 87, "{} entries", entries.len());
    let stale: Vec<String> = entries
        .iter()
        .filter_map(|entry| what_is_stale(entry).map(|reason| format!("{}: {reason}", entry.name)))
        .collect();
    assert!(stale.is_empty(), "{}", stale.join("\n"));
    // The check itself finds what is stale.
    let first = || mutation(&lines[lines.iter().position(|line| !line.is_empty()).expect("an entry")..]);
    let stale = |changed: Mutation<'_>| assert!(what_is_stale(&changed).is_some(), "{}", changed.name);
    stale(Mutation { file: "shaders/none.wgsl", ..first() });
    stale(Mutation { from: "no such text".into(), ..first() });
    stale(Mutation { test: "no_such_test", ..first() });
    stale(Mutation { filter: "no_such_module::dlm", ..first() });
    stale(Mutation { filter: "verify::no_such_name", ..first() });
}

/// Lines of the sources in a folder that hold the word `unsafe` as code, by file.
fn unsafe_lines(folder: &std::path::Path, found: &mut Vec<String>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            unsafe_lines(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            let text = std::fs::read_to_string(&path).expect("a source");
            let is_code = |line: &&str| {
                let code = line.split("//").next().unwrap_or_default();
                code.split(|letter: char| !(letter.is_alphanumeric() || letter == '_')).any(|word| word == "unsafe")
            };
            let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
            let name = path.strip_prefix(root).expect("in the tree").to_string_lossy().replace('\\', "/");
            found.extend(text.lines().filter(is_code).map(|line| format!("{name}: {}", line.trim())));
        }
    }
}

#[test]
fn unsafe_code_stands_where_it_was_reviewed_alone() {
    let mut found = Vec::new();
    for folder in ["src", "examples", "benches", "fuzz/fuzz_targets"] {
        unsafe_lines(&std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(folder), &mut found);
    }
    found.sort();
    // Cargo.toml denies it elsewhere, which another `allow` would lift.
    let reviewed = [
        "src/bin/polhode/main.rs: unsafe { std::env::set_var(FOLDER, \"/nonexistent\") };",
        "src/engine/gpu/disk_cache.rs: unsafe { device.create_pipeline_cache(&descriptor) }",
        "src/math/lanes.rs: unsafe { std::mem::zeroed() }",
    ];
    assert_eq!(found, reviewed);
}
