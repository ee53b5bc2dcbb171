//! Defects of a mesh, its file, or the points of a hull.

/// Why a mesh does not enclose a volume.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshDefect {
    /// There are no triangles.
    #[error("no triangles")]
    Empty,
    /// A coordinate is infinite or not a number.
    #[error("vertex {vertex} has a coordinate that is not finite")]
    NotFinite {
        /// Number of the vertex, from 0.
        vertex: usize,
    },
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} names vertex {vertex}: there are {vertices}, counted from 0")]
    NoSuchVertex {
        /// Number of the triangle, from 0.
        triangle: usize,
        /// Number of the vertex asked for.
        vertex: usize,
        /// How many vertices there are.
        vertices: usize,
    },
    /// The surface has boundary edges.
    #[error(
        "open along {boundary_edges} edges of {boundary_length} m in all (area vectors add up to {closure_defect:e} of \
         the area instead of 0): expected a closed surface"
    )]
    Open {
        /// Edges that belong to one triangle only.
        boundary_edges: usize,
        /// Their total length, m.
        boundary_length: f64,
        /// |Σ area vectors| / Σ areas.
        closure_defect: f64,
    },
    /// Neighbouring triangles have opposite orientations.
    #[error(
        "triangles turned against their neighbours at {edges} edges: all must be counter-clockwise seen from outside"
    )]
    Inconsistent {
        /// Edges between such triangles.
        edges: usize,
    },
    /// The surface is closed but its triangles are clockwise seen from outside; [`crate::bodies::inertia::TriangleMesh::turned_inside_out`]
    /// repairs that.
    #[error("inside out (volume {signed_volume} m³): triangles must be counter-clockwise seen from outside")]
    InsideOut {
        /// The signed volume, m³.
        signed_volume: f64,
    },
    /// The surface is closed but encloses nothing.
    #[error("closed, but without volume")]
    NoVolume,
    /// The surface has no area.
    #[error("without area")]
    NoArea,
    /// Volume, area or moments are not finite.
    #[error("volume, area or moments leave the range of numbers: use smaller coordinates (m)")]
    OutOfRange,
    /// Triangles occur twice with the same orientation.
    #[error("{triangles} triangles occur twice: their volume would count twice")]
    Doubled {
        /// How many are repetitions.
        triangles: usize,
    },
    /// Parts of the surface overlap, lie within one another, or intersect themselves.
    #[error(
        "parts overlap, lie within one another or pass through themselves (the surface winds {winding} times around a \
         side of {found} of {places} places on it, 0 or 1 is needed): their volume would not count once"
    )]
    Overlapping {
        /// The winding number of the surface around a point beside it, where that is furthest from 0 and 1.
        winding: i64,
        /// Sample points of the surface with such a side.
        found: usize,
        /// Sample points that were examined.
        places: usize,
    },
}

/// What is wrong with a mesh file.
#[cfg(feature = "mesh")]
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshFileProblem {
    /// The name ends in neither .obj nor .stl.
    #[error("the name must end in .obj or .stl")]
    UnknownFormat,
    /// The operating system could not open or read it.
    #[error("{0}")]
    Io(std::io::ErrorKind),
    /// It is not an STL file, or is cut short.
    #[error("not a whole STL file ({message})")]
    Stl {
        /// The reader's message.
        message: String,
    },
    /// It is not a valid OBJ file.
    #[error("not a valid OBJ file ({0})")]
    Obj(tobj::LoadError),
    /// It has no triangles.
    #[error("no triangles in the file")]
    Empty,
    /// Its last line does not end in a newline, as if the file was cut off.
    #[error("the last line does not end in a newline, so the file may be cut: add a newline if it is whole")]
    Cut,
    /// Its triangles do not enclose a volume once.
    #[error("{0}")]
    Surface(MeshDefect),
}

/// The arrangement of points that have no convex hull with a volume.
#[cfg(feature = "mesh")]
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FlatArrangement {
    /// All at one place, or no points at all.
    #[error("coincide")]
    Coincide,
    /// On a line.
    #[error("lie on a line")]
    OnALine,
    /// In a plane.
    #[error("lie in a plane")]
    InAPlane,
}
