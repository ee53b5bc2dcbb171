//! What reads other people's bytes, as functions of bytes: each takes them or refuses them with a message that names the file.

#![allow(dead_code, reason = "each target uses one")]

use std::fs;
use std::io;
use std::ops::ControlFlow;
use std::path::Path;

use polhode::Error;
use polhode::bodies::inertia::{TriangleMesh, parse_mesh};
use polhode::error::MeshFileProblem;
use polhode::plan::PlanDocument;
use polhode::record::OutputFolder;
use polhode::run::Checkpoint;
use polhode::study::{BodyTable, Study};

/// Bodies beyond which a study's are not drawn: by the million they are no fault, and take their time.
const MOST_BODIES: usize = 1000;

/// Rows of a table that are read.
const MOST_ROWS: usize = 100_000;

/// What messages call each kind of file.
pub const STUDY: &str = "study.toml";
pub const FORMULA: &str = "formula.toml";
pub const TABLE: &str = "table.csv";
pub const STL: &str = "mesh.stl";
pub const OBJ: &str = "mesh.obj";
pub const PLAN: &str = "plan.json";
pub const PIECES: &str = "pieces";

/// Reads a study and draws its bodies. Files that it names are not there.
pub fn study(bytes: &[u8]) -> Result<(), Error> {
    scene(STUDY, bytes)
}

fn scene(name: &str, bytes: &[u8]) -> Result<(), Error> {
    // What is no text is refused where files are read.
    let Ok(text) = std::str::from_utf8(bytes) else { return Ok(()) };
    let study = Study::parse(Path::new(name), text)?;
    if study.bodies().count <= MOST_BODIES {
        study.scene()?;
    }
    Ok(())
}

/// Reads a formula, as a study's torque with a number `c`, a vector `v` and a rotation `r`.
pub fn formula(bytes: &[u8]) -> Result<(), Error> {
    let Ok(formula) = std::str::from_utf8(bytes) else { return Ok(()) };
    let mut quoted = String::new();
    for letter in formula.chars() {
        match letter {
            '\\' | '"' => quoted.extend(['\\', letter]),
            '\n' => quoted.push_str("\\n"),
            _ if letter.is_control() => quoted += &format!("\\u{:04X}", u32::from(letter)),
            _ => quoted.push(letter),
        }
    }
    let text = format!(
        "[bodies]\ncount = 2\ninertia = [1, 2, 2.5]\nangular_velocity = [1, 0.4, 0.1]\n[time]\nend = 1.0\n\
         [[torque]]\nmodel = \"custom\"\ntorque = \"{quoted}\"\n\
         parameters = {{ c = 0.5, v = [1, 2, 3], r = [0, 0, 0.6, 0.8] }}\n"
    );
    scene(FORMULA, text.as_bytes())
}

/// Reads a table of bodies.
pub fn table(bytes: &[u8]) -> Result<(), Error> {
    BodyTable::from_reader(Path::new(TABLE), bytes, MOST_ROWS).map(|_| ())
}

/// Reads a mesh from an STL file, and its mass properties.
pub fn stl(bytes: &[u8]) -> Result<(), Error> {
    mesh(STL, bytes)
}

/// Reads a mesh from an OBJ file, and its mass properties.
pub fn obj(bytes: &[u8]) -> Result<(), Error> {
    mesh(OBJ, bytes)
}

fn mesh(name: &str, bytes: &[u8]) -> Result<(), Error> {
    let sound = |mesh: &TriangleMesh| {
        mesh.mass_properties_of_density(1.0)?;
        mesh.overlap().map_or(Ok(()), |defect| Err(Error::Mesh(defect)))
    };
    sound(&parse_mesh(Path::new(name), bytes.to_vec())?).map_err(|error| match error {
        Error::Mesh(defect) => Error::MeshFile { path: name.into(), problem: MeshFileProblem::Surface(defect) },
        error => error,
    })
}

/// Reads a plan.
pub fn plan(bytes: &[u8]) -> Result<(), Error> {
    let Ok(text) = std::str::from_utf8(bytes) else { return Ok(()) };
    PlanDocument::parse(Path::new(PLAN), text).map(|_| ())
}

/// What stands before each file of a folder that is one text: its name behind this, on a line.
const FILE: &str = "=== ";

/// Resumes a run whose pieces are all there, or merges the parts of a study; `bytes` are the study's text and the files of all pieces or parts,
/// one after the other ([`FILE`]).
///
/// Sums are put right first, as somebody would who changes files on purpose, so that what stands behind them is read.
pub fn pieces(bytes: &[u8]) -> Result<(), Error> {
    let Ok(text) = std::str::from_utf8(bytes) else { return Ok(()) };
    let desk = desk().unwrap_or_else(|error| panic!("no folder to work in: {error}"));
    let folder = desk.path().join(PIECES);
    let files: Vec<(&str, &str)> = text.split(FILE).filter_map(|file| file.split_once('\n')).collect();
    let Some((_, study)) = files.iter().find(|(name, _)| *name == STUDY) else { return Ok(()) };
    let study = Study::parse(&folder.join(STUDY), study)?;
    let mut are_parts = false;
    for (name, text) in &files {
        let Some((piece, file)) = name.split_once('/') else {
            write(&folder, name, text);
            continue;
        };
        are_parts |= piece.starts_with("shard-");
        match file {
            "part.json" => write(&folder.join(piece), file, &put_right(text, piece, &files)),
            _ => write(&folder.join(piece), file, text),
        }
    }
    let out = || OutputFolder::create(&folder.join("merged"), false);
    let observer = &mut |_| ControlFlow::Continue(());
    if are_parts {
        return polhode::run::merge(&folder, out()?, observer).map(|_| ());
    }
    let Some(checkpoint) = Checkpoint::find(&folder, &study)? else { return Ok(()) };
    // What is left would be computed.
    if checkpoint.bodies_done() == checkpoint.body_count() {
        checkpoint.finish(out()?, observer)?;
    }
    Ok(())
}

/// A folder that vanishes, in memory where the system has one for that.
fn desk() -> io::Result<tempfile::TempDir> {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() }
}

/// Writes a file whose name is plain, and none of another name.
fn write(folder: &Path, name: &str, text: &str) {
    let is_plain = |name: &str| {
        let is_letter = |letter: char| letter.is_ascii_alphanumeric() || "-_.".contains(letter);
        name.starts_with(|letter: char| letter.is_ascii_alphabetic()) && name.len() < 60 && name.chars().all(is_letter)
    };
    let folder_name = folder.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    if is_plain(name) && is_plain(folder_name) && fs::create_dir_all(folder).is_ok() {
        let _ = fs::write(folder.join(name), text);
    }
}

/// What says whose a piece is, with sizes and sums as they are.
fn put_right(text: &str, piece: &str, files: &[(&str, &str)]) -> String {
    let Ok(serde_json::Value::Object(mut part)) = serde_json::from_str(text) else { return text.to_owned() };
    part.remove("sum");
    for entry in part.get_mut("files").and_then(serde_json::Value::as_array_mut).into_iter().flatten() {
        let name = format!("{piece}/{}", entry["name"].as_str().unwrap_or_default());
        if let (Some((_, text)), true) = (files.iter().rfind(|(found, _)| *found == name), entry.is_object()) {
            entry["bytes"] = text.len().into();
            entry["checksum"] = crc32fast::hash(text.as_bytes()).into();
        }
    }
    let text = serde_json::Value::Object(part).to_string();
    let text = &text[..text.len() - 1];
    format!("{text},\"sum\":\"{:08x}\"}}\n", crc32fast::hash(text.as_bytes()))
}
