//! Files with random faults: studies, tables of bodies, meshes, plan documents and formulas are read or refused, never with a panic,
//! within seconds, and each refusal names the file.

#![cfg(feature = "cli")]

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};

use polhode::plan::PlanDocument;
use polhode::study::{MassFileOptions, MassReport, Study};

#[path = "support/desk.rs"]
mod desk;

use desk::{Desk, example};

/// Files of each kind.
const MUTATIONS: u64 = 10_000;

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

/// Reads mutations of the files as `name`, by `read`; each is taken or refused with the file's name.
fn hold(name: &str, files: &[Vec<u8>], read: impl Fn(&Path) -> Result<(), polhode::Error>) {
    let desk = Desk::new(STUDY);
    let path = desk.path(name);
    let mut draws = Draws(0);
    let (mut taken, mut longest) = (0, Duration::ZERO);
    for index in 0..MUTATIONS {
        let file = &files[index as usize % files.len()];
        let bytes = if (index as usize) < files.len() { file.clone() } else { draws.mutated(file) };
        fs::write(&path, &bytes).expect("written");
        let clock = Instant::now();
        let found = catch_unwind(AssertUnwindSafe(|| read(&path)));
        longest = longest.max(clock.elapsed());
        let shown = || String::from_utf8_lossy(&bytes).into_owned();
        assert!(clock.elapsed() < MOST_SECONDS, "{index}: {:?} for\n{}", clock.elapsed(), shown());
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
    println!("{name}: {taken} of {MUTATIONS} taken, the longest after {longest:?}");
}

/// Reads a study and draws its bodies, where they are few.
fn read_study(path: &Path) -> Result<(), polhode::Error> {
    let study = Study::read(path)?;
    let count = fs::read_to_string(path).unwrap_or_default();
    // Bodies by the million are no fault.
    let is_large = count.lines().any(|line| line.trim_start().starts_with("count") && line.len() > 16);
    if is_large { Ok(()) } else { study.scene().map(|_| ()) }
}

fn studies(wanted: impl Fn(&str) -> bool) -> Vec<Vec<u8>> {
    let names = [
        "tumbling",
        "pointing",
        "relaxing",
        "thruster",
        "bdot",
        "booms",
        "debris",
        "wobbling_disc",
        "intermediate_axis",
    ];
    let few = |text: String| {
        let of_line = |line: &str| if line.starts_with("count") { "count = 3".to_owned() } else { line.to_owned() };
        text.lines().map(of_line).collect::<Vec<_>>().join("\n") + "\n"
    };
    let texts = names.map(|name| few(fs::read_to_string(example(name)).expect("a study")));
    texts.into_iter().filter(|text| wanted(text)).map(String::into_bytes).collect()
}

#[test]
fn studies_with_random_faults_are_read_or_refused() {
    hold("mutated.toml", &studies(|_| true), read_study);
}

#[test]
fn formulas_with_random_faults_are_read_or_refused() {
    hold("formula.toml", &studies(|text| text.contains("\"\"\"")), read_study);
}

#[test]
fn tables_with_random_faults_are_read_or_refused() {
    let desk = Desk::new(&STUDY.replace("count = 3", "file = \"table.csv\"").replace("inertia = [1, 2, 2.5]\n", ""));
    let study = desk.path("study.toml");
    let table = "ixx,iyy,izz,wx,wy,wz,mass,name\n1,2,2.5,0.1,0.1,0.2,3,a\n2.5,2,1,1e-3,0.1,-0.2,3,\"b, c\"\n";
    let text = fs::read_to_string(&study).expect("a study").replace("angular_velocity = [1, 0.4, 0.1]\n", "");
    fs::write(&study, text).expect("written");
    hold("table.csv", &[table.as_bytes().to_vec()], |path| {
        fs::copy(path, desk.path("table.csv")).expect("copied");
        Study::read(&study)?.scene().map(|_| ())
    });
}

#[test]
fn plans_with_random_faults_are_read_or_refused() {
    let desk = Desk::new(STUDY);
    desk.done(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
    let plan = fs::read(desk.path("study.out/plan.json")).expect("a plan");
    hold("plan.json", &[plan], |path| PlanDocument::read(path).map(|_| ()));
}

/// A tetrahedron in three formats.
const CORNERS: [[f32; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

fn hold_meshes(name: &str, file: Vec<u8>) {
    let options = MassFileOptions { density: Some(1.0), ..MassFileOptions::default() };
    hold(name, &[file], |path| MassReport::of_file(path, &options, None).map(|_| ()));
}

#[test]
fn binary_meshes_with_random_faults_are_read_or_refused() {
    let mut file = vec![0; 80];
    file.extend(4_u32.to_le_bytes());
    for face in FACES {
        file.extend([0; 12]);
        face.iter().flat_map(|&corner| CORNERS[corner]).for_each(|x| file.extend(x.to_le_bytes()));
        file.extend([0; 2]);
    }
    hold_meshes("mesh.stl", file);
}

#[test]
fn text_meshes_with_random_faults_are_read_or_refused() {
    let corner =
        |&corner: &usize| format!("vertex {} {} {}\n", CORNERS[corner][0], CORNERS[corner][1], CORNERS[corner][2]);
    let face = |face: &[usize; 3]| {
        let corners: String = face.iter().map(corner).collect();
        format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
    };
    let faces: String = FACES.iter().map(face).collect();
    hold_meshes("mesh.stl", format!("solid a\n{faces}endsolid a\n").into_bytes());
    let corners: String = CORNERS.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    let faces: String = FACES.iter().map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1)).collect();
    hold_meshes("mesh.obj", (corners + &faces).into_bytes());
}
