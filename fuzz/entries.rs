//! What reads other people's bytes, as functions of bytes: each takes them or refuses them with a message that names the file.

#![allow(dead_code, reason = "each target uses one")]

use std::path::Path;

use polhode::Error;
use polhode::bodies::inertia::{TriangleMesh, parse_mesh};
use polhode::error::MeshFileProblem;
use polhode::plan::PlanDocument;
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
