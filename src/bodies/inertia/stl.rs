//! STL files, binary and text, checked against their own size and structure.
//!
//! `stl_io` reads one solid and returns whatever it finds of it. Here a file is accepted as a whole or refused: a binary file must have the
//! size that its count of triangles implies, and a text file must be a sequence of solids, each with its end.

use std::io::Cursor;

use glam::DVec3;

use crate::error::MeshFileProblem;

/// Header and count of a binary file, bytes.
const HEADER: usize = 84;
/// A triangle of a binary file, bytes.
const TRIANGLE: usize = 50;

/// The corners of all triangles.
pub(super) fn corners(mut bytes: Vec<u8>) -> Result<Vec<[DVec3; 3]>, MeshFileProblem> {
    let problem = |message: String| MeshFileProblem::Stl { message };
    let count = bytes.get(HEADER - 4..HEADER).and_then(|count| Some(u32::from_le_bytes(count.try_into().ok()?)));
    let size = count.map(|count| HEADER as u64 + TRIANGLE as u64 * u64::from(count));
    // A binary file may begin with the word "solid", but a text file cannot have the size that its 81st to 84th bytes imply.
    if size == Some(bytes.len() as u64) {
        // The reader would take a file with such a header for text.
        bytes[..HEADER - 4].fill(0);
        return one_solid(&bytes).map_err(problem);
    }
    let begins_as_text = bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    match (begins_as_text, size) {
        (true, _) => text_corners(&bytes).map_err(problem),
        (false, Some(size)) => {
            let (count, length) = (count.unwrap_or_default(), bytes.len());
            Err(problem(format!(
                "it has {length} bytes, {size} are needed for the {count} triangles that it says it has"
            )))
        }
        (false, None) => Err(problem(format!("it has {} bytes, the least is {HEADER}", bytes.len()))),
    }
}

/// Reads solid by solid; keywords may be in upper case, and names are ignored.
fn text_corners(bytes: &[u8]) -> Result<Vec<[DVec3; 3]>, String> {
    let mut corners = Vec::new();
    let mut solid: Vec<u8> = Vec::new();
    for (number, line) in bytes.split_inclusive(|&byte| byte == b'\n').enumerate() {
        let line = line.to_ascii_lowercase();
        let words = line.trim_ascii();
        let first = words.split(u8::is_ascii_whitespace).next().unwrap_or_default();
        if words.is_empty() {
            continue;
        }
        if solid.is_empty() {
            if first != b"solid" {
                return Err(format!("line {}: expected a solid here", number + 1));
            }
            // The name may be missing or hold any bytes.
            solid.extend(b"solid name\n");
            continue;
        }
        if first == b"endsolid" {
            solid.extend(b"endsolid\n");
            corners.extend(
                one_solid(&solid)
                    .map_err(|problem| format!("the solid that ends in line {}: {problem}", number + 1))?,
            );
            solid.clear();
        } else {
            solid.extend(words);
            solid.push(b'\n');
        }
    }
    if solid.is_empty() { Ok(corners) } else { Err("the last solid has no end".to_owned()) }
}

fn one_solid(bytes: &[u8]) -> Result<Vec<[DVec3; 3]>, String> {
    let words = |error: std::io::Error| error.to_string();
    stl_io::create_stl_reader(&mut Cursor::new(bytes))
        .map_err(words)?
        .map(|triangle| {
            let triangle = triangle.map_err(words)?;
            Ok(triangle.vertices.map(|v| DVec3::new(v[0].into(), v[1].into(), v[2].into())))
        })
        .collect()
}
