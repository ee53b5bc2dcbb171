//! Files with random faults: studies, tables of bodies, meshes, plan documents and formulas are read or refused, never with a panic,
//! within seconds, and each refusal names the file.
//!
//! The functions are those of the fuzz targets (`fuzz/`), and the sound files are their corpus. `POLHODE_MUTATIONS=1000000 cargo test
//! --test files mutations -- --nocapture` tries a million of each kind.

#![cfg(feature = "cli")]

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};

use polhode::Error;
use polhode::study::Study;

use crate::entries;
use crate::in_parts::{OBSERVED, STATISTICS};
use crate::workspace;

use workspace::Workspace;

/// Files of each kind, where the environment does not say how many.
const MUTATIONS: u64 = 10_000;

/// Files of each kind that go by way of the disk, with whatever reads them there.
const ON_DISK: u64 = 1000;

fn mutations() -> u64 {
    let count = std::env::var("POLHODE_MUTATIONS").ok();
    count.map_or(MUTATIONS, |count| count.parse().expect("POLHODE_MUTATIONS is a number"))
}

/// The longest that one file may take.
const MOST_SECONDS: Duration = Duration::from_secs(5);

const STUDY: &str = "[bodies]\ncount = 3\ninertia = [1, 2, 2.5]\nangular_velocity = [1, 0.4, 0.1]\n\
                     [time]\nend = 1.0\n[accuracy]\nmethod = \"rk4\"\ndt = 0.01\n";

/// What is put in place of a piece of a file.
const PIECES: [&[u8]; 22] = [
    b"-1",
    b"0",
    b"1e308",
    b"1e-320",
    b"1e400",
    b"nan",
    b"inf",
    b"-0.0",
    b"99999999999999999999",
    b"[",
    b"]",
    b"{",
    b"}",
    b"\"",
    b"\n",
    b",",
    b"\xff",
    b"\0",
    b"sin(",
    b"((((((((((((((((((((((((",
    b"=",
    b"true",
];

/// Random numbers (G. L. Steele and others, OOPSLA 2014: SplitMix64).
struct Draws(u64);

impl Draws {
    fn below(&mut self, count: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) % count.max(1) as u64) as usize
    }

    /// A file with one to three faults: a bit turned over, a piece put in, taken out, doubled, or put in place of a number, or the
    /// end cut off.
    fn mutated(&mut self, file: &[u8]) -> Vec<u8> {
        let mut bytes = file.to_vec();
        for _ in 0..1 + self.below(3) {
            let place = self.below(bytes.len());
            match self.below(6) {
                0 if !bytes.is_empty() => bytes[place] ^= 1 << self.below(8),
                1 => drop(bytes.splice(place..place, PIECES[self.below(PIECES.len())].iter().copied())),
                2 => drop(bytes.drain(place..(place + self.below(12)).min(bytes.len()))),
                3 => {
                    let piece = bytes[place..(place + self.below(40)).min(bytes.len())].to_vec();
                    let target = self.below(bytes.len());
                    bytes.splice(target..target, piece);
                }
                4 => bytes.truncate(place.max(bytes.len().saturating_sub(1 + self.below(20)))),
                _ => {
                    let is_digit = |byte: &u8| byte.is_ascii_digit() || b".e".contains(byte);
                    let start = place + bytes[place..].iter().position(u8::is_ascii_digit).unwrap_or(0);
                    let end = start + bytes[start..].iter().take_while(|byte| is_digit(byte)).count();
                    bytes.splice(start..end, PIECES[self.below(PIECES.len())].iter().copied());
                }
            }
        }
        bytes
    }
}

/// Reads mutations of the files by `read`; each is taken or refused with the `name` that messages call the file.
fn hold(name: &str, files: &[Vec<u8>], count: u64, read: impl Fn(&[u8]) -> Result<(), Error>) {
    assert!(!files.is_empty(), "no sound files of {name}");
    let mut draws = Draws(0);
    let (mut taken, mut longest) = (0, Duration::ZERO);
    for index in 0..count {
        let file = &files[index as usize % files.len()];
        let bytes = if (index as usize) < files.len() { file.clone() } else { draws.mutated(file) };
        let clock = Instant::now();
        let found = catch_unwind(AssertUnwindSafe(|| read(&bytes)));
        let duration = clock.elapsed();
        longest = longest.max(duration);
        let shown = || String::from_utf8_lossy(&bytes).into_owned();
        assert!(duration < MOST_SECONDS, "{index}: {duration:?} for\n{}", shown());
        match found {
            Err(_) => panic!("mutation {index} of {name} panicked:\n{}", shown()),
            Ok(Ok(())) => taken += 1,
            Ok(Err(error)) => {
                let text = error.to_string();
                assert!((index as usize) >= files.len(), "file {index} is sound: {text}");
                assert!(text.contains(name), "mutation {index}: {text}\n{}", shown());
            }
        }
    }
    println!("{name}: {taken} of {count} taken, the longest after {longest:?}");
}

/// The corpus of a fuzz target.
fn corpus(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target);
    let entries = fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    paths.iter().map(|path| fs::read(path).expect("a file")).collect()
}

#[test]
fn studies_with_random_faults_are_read_or_refused() {
    hold(entries::STUDY, &corpus("study"), mutations(), entries::study);
}

#[test]
fn formulas_with_random_faults_are_read_or_refused() {
    hold(entries::FORMULA, &corpus("formula"), mutations(), entries::formula);
}

#[test]
fn tables_with_random_faults_are_read_or_refused() {
    hold(entries::TABLE, &corpus("table"), mutations(), entries::table);
}

#[test]
fn plans_with_random_faults_are_read_or_refused() {
    let workspace = Workspace::new(STUDY);
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
    let written = fs::read(workspace.path("study.out/plan.json")).expect("a plan");
    hold(entries::PLAN, &[written], mutations(), entries::plan);
}

/// Folders of two parts of a study, and of two finished pieces of a run, each as one text ([`entries::pieces`]).
fn pieces(study: &str) -> [Vec<u8>; 2] {
    let workspace = Workspace::new(study);
    workspace.done(&["plan", "study.toml", "--engine", "cpu", "--quiet", "--out", "plan.json"]);
    let parts = ["shard-1-of-2", "shard-2-of-2"];
    for part in ["1/2", "2/2"] {
        let run =
            ["run", "study.toml", "--engine", "cpu", "--quiet", "--out", "parts", "--plan", "plan.json", "--shard"];
        workspace.polhode(&[&run[..], &[part]].concat());
    }
    let text = |name: &str| fs::read_to_string(workspace.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    // The plan stands beside it too.
    let without_plan = |part: &str| {
        let mut part: serde_json::Value = serde_json::from_str(part).expect("JSON");
        let metadata = part["metadata"].as_array_mut().expect("entries");
        metadata.retain(|entry| entry[0] != "polhode.plan");
        part.to_string()
    };
    let folder = |are_parts: bool| {
        let mut all = format!("=== study.toml\n{study}");
        if !are_parts {
            all += &format!("=== plan.json\n{}", text("plan.json"));
        }
        for part in parts {
            let of_part: serde_json::Value =
                serde_json::from_str(&text(&format!("parts/{part}/part.json"))).expect("JSON");
            let [first, bodies] = ["first_body", "bodies"].map(|key| of_part[key].as_u64().expect("a number"));
            let name = if are_parts { part.to_owned() } else { format!("bodies-{first}-{}", first + bodies - 1) };
            for file in workspace.names(&format!("parts/{part}")) {
                let text = text(&format!("parts/{part}/{file}"));
                all += &format!("=== {name}/{file}\n{}", if file == "part.json" { without_plan(&text) } else { text });
            }
        }
        all.into_bytes()
    };
    [folder(true), folder(false)]
}

/// With statistics of blocks, and with all that is gathered of states, events and cells among it.
fn all_pieces() -> Vec<Vec<u8>> {
    let blocks = STATISTICS.replace("count = 900", "count = 6").replace("final = false", "snapshots = true");
    let observed = OBSERVED.replace("count = 250", "count = 2");
    [blocks, observed].iter().flat_map(|study| pieces(study)).collect()
}

#[test]
fn parts_and_pieces_with_random_faults_are_merged_or_refused() {
    // Each is written to the disk.
    hold(entries::PIECES, &all_pieces(), mutations() / 3, entries::pieces);
}

/// Numbers that no run writes, in files whose sums are right: what is merged of them would be wrong, or never end.
#[test]
fn parts_of_numbers_that_no_run_writes_are_refused_although_their_sums_are_right() {
    let [blocks, _, observed, _] = &all_pieces()[..] else { panic!("four folders") };
    let faults: [(&[u8], &str, &str, &str); 22] = [
        (blocks, "\"first_body\":3", "\"first_body\":18446744073709551615", "some of all bodies"),
        (blocks, "\"bodies\":3", "\"bodies\":18446744073709551615", "some of all bodies"),
        (blocks, "\"bodies\":3", "\"bodies\":0", "some of all bodies"),
        (blocks, "\"body_count\":6", "\"body_count\":18446744073709551615", "some of all bodies"),
        (blocks, "\"times\":[0.5,", "\"times\":[1.5,", "ascending times"),
        (blocks, "\"cells\":null", "\"cells\":0", "no more cells than bodies"),
        (blocks, "\"failures\":[]", FAILED_TWICE, "failed bodies of its own"),
        (blocks, "\"name\":\"plan.json\"", "\"name\":\"/dev/zero\"", "names of files beside it"),
        (blocks, "\"name\":\"plan.json\"", "\"name\":\"../plan.json\"", "names of files beside it"),
        (blocks, "\"bodies\": 3", "\"bodies\": 18446744073709551615", "counts bodies that it has not"),
        (blocks, "\"lost\": 0", "\"lost\": 18446744073709551615", "counts bodies that it has not"),
        (blocks, "\"count\":1,", "\"count\":4294967295,", "expected statistics at"),
        (blocks, "\"body\":1}", "\"body\":4294967295}", "expected statistics at"),
        (blocks, "\"exponent\":-1,", "\"exponent\":2147483647,", "expected statistics at"),
        (blocks, "{\"time\":0.5,", "{\"time\":0.25,", "expected statistics at"),
        (
            observed,
            "\"gathered\":{\"bodies\":3",
            "\"gathered\":{\"bodies\":18446744073709551615",
            "expected statistics at",
        ),
        (observed, "\"least\":[", "\"least\":[1e300,0],\"greatest\":[", "of a part's blocks"),
        (observed, "\"histograms\":[[0,", "\"histograms\":[[18446744073709551615,", "expected statistics at"),
        (observed, "\"nodes\":[[0,", "\"nodes\":[[64,", "expected statistics at"),
        (observed, "\"nodes\":[[0,", "\"nodes\":[[1,", "expected statistics at"),
        (observed, "\"censored\":[]", "\"censored\":[[0,1.0],[0,1.0]]", "the events of a part's bodies"),
        (observed, "\"compared\":", "\"compared\":1844674407370955161", "the events of a part's bodies"),
    ];
    for (folder, from, to, expected) in faults {
        let text = std::str::from_utf8(folder).expect("text");
        assert!(text.contains(from), "nothing to spoil: {from} in\n{text}");
        let clock = Instant::now();
        let error = entries::pieces(text.replacen(from, to, 1).as_bytes()).expect_err(to).to_string();
        assert!(error.contains(entries::PIECES) && error.contains(expected), "{to}: {error}");
        assert!(clock.elapsed() < MOST_SECONDS, "{to}: {:?}", clock.elapsed());
    }
}

/// A body that has failed twice.
const FAILED_TWICE: &str = "\"failures\":[{\"body\":1,\"reason\":4,\"time\":1.0,\"known_to_step\":true,\"last_good_time\":0.5,\
    \"orientation\":[0,0,0,1],\"angular_velocity_body\":[0,0,0]},{\"body\":1,\"reason\":4,\"time\":1.0,\"known_to_step\":true,\
    \"last_good_time\":0.5,\"orientation\":[0,0,0,1],\"angular_velocity_body\":[0,0,0]}]";

/// Begins the corpus of the targets whose sound files belong to a release: `cargo test --test files mutations -- --ignored`.
#[test]
#[ignore = "writes into the tree: fuzz/corpus/plan and fuzz/corpus/pieces"]
fn sound_plans_and_pieces_begin_a_corpus() {
    let folder = |target: &str| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target);
        fs::create_dir_all(&folder).expect("made");
        folder
    };
    for (index, text) in all_pieces().iter().enumerate() {
        fs::write(folder("pieces").join(format!("{index}")), text).expect("written");
    }
    for (index, study) in [STUDY, OBSERVED, STATISTICS].iter().enumerate() {
        let workspace = Workspace::new(study);
        workspace.done(&["plan", "study.toml", "--engine", "cpu", "--quiet", "--out", "plan.json"]);
        fs::copy(workspace.path("plan.json"), folder("plan").join(format!("{index}"))).expect("copied");
    }
}

#[test]
fn stl_meshes_with_random_faults_are_read_or_refused() {
    hold(entries::STL, &corpus("stl"), mutations(), entries::stl);
}

#[test]
fn obj_meshes_with_random_faults_are_read_or_refused() {
    hold(entries::OBJ, &corpus("obj"), mutations(), entries::obj);
}

#[test]
fn studies_with_random_faults_on_the_disk_are_read_or_refused() {
    let workspace = Workspace::new(STUDY);
    let path = workspace.path("mutated.toml");
    hold("mutated.toml", &corpus("study"), ON_DISK, |bytes| {
        fs::write(&path, bytes).expect("written");
        let study = Study::read(&path)?;
        if study.bodies().count > 1000 { Ok(()) } else { study.scene().map(|_| ()) }
    });
}

#[test]
fn tables_with_random_faults_on_the_disk_make_bodies_or_are_refused() {
    let workspace =
        Workspace::new(&STUDY.replace("count = 3", "file = \"table.csv\"").replace("inertia = [1, 2, 2.5]\n", ""));
    let study = workspace.path("study.toml");
    let text = fs::read_to_string(&study).expect("a study").replace("angular_velocity = [1, 0.4, 0.1]\n", "");
    fs::write(&study, text).expect("written");
    hold(entries::TABLE, &corpus("table"), ON_DISK, |bytes| {
        fs::write(workspace.path("table.csv"), bytes).expect("written");
        Study::read(&study)?.scene().map(|_| ())
    });
}
