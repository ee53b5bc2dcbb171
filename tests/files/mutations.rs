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
