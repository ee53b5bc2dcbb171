//! Triangle meshes from OBJ and STL files.

use std::ffi::OsStr;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;

use glam::DVec3;

use super::TriangleMesh;
use crate::error::MeshFileProblem;
use crate::error::{Error, Result};

/// Reads a mesh from an OBJ file (polygons are cut into triangles; all objects and groups belong to one surface) or an STL file (binary or
/// text), told apart by the extension.
///
/// Corners with equal coordinates become one vertex, so that an STL file, or an OBJ file cut into groups, can be closed. Coordinates are
/// taken as metres; [`TriangleMesh::scaled`] converts other units to metres. STL coordinates have the precision of `f32`.
///
/// # Errors
/// [`Error::MeshFile`] with the path and what is wrong. Whether the surface is closed is checked by
/// [`TriangleMesh::mass_properties`], and whether it encloses anything twice by [`TriangleMesh::overlap`], not here.
///
/// ```
/// use polhode::bodies::inertia::read_mesh;
///
/// let path = std::env::temp_dir().join(format!("polhode-doc-{}.obj", std::process::id()));
/// std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")?;
/// let body = read_mesh(&path)?.mass_properties_of_density(6000.0)?;
/// std::fs::remove_file(&path)?;
/// assert!((body.mass - 1000.0).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_mesh(path: impl AsRef<Path>) -> Result<TriangleMesh> {
    let path = path.as_ref();
    is_stl(path)?;
    let failed = |error: std::io::Error| MeshFileProblem::Io(error.kind());
    let bytes = read_file(path).map_err(|error| Error::MeshFile { path: path.to_owned(), problem: failed(error) })?;
    parse_mesh(path, bytes)
}

/// As [`read_mesh`], from a file's bytes; `path` is the name in messages, and its extension gives the format.
pub fn parse_mesh(path: &Path, bytes: Vec<u8>) -> Result<TriangleMesh> {
    let failed = |problem| Error::MeshFile { path: path.to_owned(), problem };
    let corners = if is_stl(path)? { super::stl::corners(bytes) } else { obj_corners(&bytes) }.map_err(failed)?;
    if corners.is_empty() {
        return Err(failed(MeshFileProblem::Empty));
    }
    TriangleMesh::from_corners(corners).map_err(|error| match error {
        Error::Mesh(defect) => failed(MeshFileProblem::Surface(defect)),
        error => error,
    })
}

/// Whether the name is that of an STL file rather than an OBJ file.
fn is_stl(path: &Path) -> Result<bool> {
    let ending = path.extension().and_then(OsStr::to_str).map(str::to_ascii_lowercase);
    match ending.as_deref() {
        Some("stl") => Ok(true),
        Some("obj") => Ok(false),
        _ => Err(Error::MeshFile { path: path.to_owned(), problem: MeshFileProblem::UnknownFormat }),
    }
}

/// All bytes of a regular file; other files may be endless.
fn read_file(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut file = File::open(path)?;
    match file.metadata()?.is_file() {
        true => {
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes)?;
            Ok(bytes)
        }
        false => Err(ErrorKind::InvalidInput.into()),
    }
}

fn obj_corners(bytes: &[u8]) -> Result<Vec<[DVec3; 3]>, MeshFileProblem> {
    if bytes.last().is_some_and(|byte| !matches!(byte, b'\n' | b'\r')) {
        return Err(MeshFileProblem::Cut);
    }
    let options =
        tobj::LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..Default::default() };
    // Materials do not affect the surface, so their files are not opened.
    let (models, _) =
        tobj::load_obj_buf(&mut &bytes[..], &options, |_| Ok(Default::default())).map_err(MeshFileProblem::Obj)?;
    let mut corners = Vec::new();
    for model in models {
        let at = |index: u32| {
            let first = 3 * index as usize;
            DVec3::from_slice(&model.mesh.positions[first..first + 3])
        };
        corners.extend(model.mesh.indices.chunks_exact(3).map(|t| [at(t[0]), at(t[1]), at(t[2])]));
    }
    Ok(corners)
}
