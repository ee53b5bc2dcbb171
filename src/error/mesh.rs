//! Defects of a mesh, its file, or the points of a hull.

use std::fmt;

/// Why a mesh does not enclose a volume.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum MeshDefect {
    /// There are no triangles.
    Empty,
    /// A coordinate is infinite or not a number.
    NotFinite {
        /// Number of the vertex, from 0.
        vertex: usize,
    },
    /// A triangle names a vertex that does not exist.
    NoSuchVertex {
        /// Number of the triangle, from 0.
        triangle: usize,
        /// Number of the vertex asked for.
        vertex: usize,
        /// How many vertices there are.
        vertices: usize,
    },
    /// The surface has boundary edges.
    Open {
        /// Edges that belong to one triangle only.
        boundary_edges: usize,
        /// Their total length, m.
        boundary_length: f64,
        /// |Σ area vectors| / Σ areas.
        closure_defect: f64,
    },
    /// Neighbouring triangles have opposite orientations.
    Inconsistent {
        /// Edges between such triangles.
        edges: usize,
    },
    /// The surface is closed but its triangles are clockwise seen from outside; [`crate::bodies::inertia::TriangleMesh::turned_inside_out`]
    /// repairs that.
    InsideOut {
        /// The signed volume, m³.
        signed_volume: f64,
    },
    /// The surface is closed but encloses nothing.
    NoVolume,
    /// The surface has no area.
    NoArea,
    /// Volume, area or moments are not finite.
    OutOfRange,
    /// Triangles occur twice with the same orientation.
    Doubled {
        /// How many are repetitions.
        triangles: usize,
    },
    /// Parts of the surface overlap, lie within one another, or intersect themselves.
    Overlapping {
        /// The winding number of the surface around a point beside it, where that is furthest from 0 and 1.
        winding: i64,
        /// Sample points of the surface with such a side.
        found: usize,
        /// Sample points that were examined.
        places: usize,
    },
}

impl fmt::Display for MeshDefect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Empty => write!(f, "no triangles"),
            Self::NotFinite { vertex } => write!(f, "vertex {vertex} has a coordinate that is not finite"),
            Self::NoSuchVertex { triangle, vertex, vertices } => {
                write!(f, "triangle {triangle} names vertex {vertex}: there are {vertices}, counted from 0")
            }
            Self::Open { boundary_edges, boundary_length, closure_defect } => write!(
                f,
                "open along {boundary_edges} edges of {boundary_length} m in all (area vectors add up to \
                 {closure_defect:e} of the area instead of 0): expected a closed surface"
            ),
            Self::Inconsistent { edges } => {
                write!(
                    f,
                    "triangles turned against their neighbours at {edges} edges: all must be counter-clockwise seen from \
                     outside"
                )
            }
            Self::InsideOut { signed_volume } => write!(
                f,
                "inside out (volume {signed_volume} m³): triangles must be counter-clockwise seen from outside"
            ),
            Self::NoVolume => write!(f, "closed, but without volume"),
            Self::NoArea => write!(f, "without area"),
            Self::OutOfRange => {
                write!(f, "volume, area or moments leave the range of numbers: use smaller coordinates (m)")
            }
            Self::Doubled { triangles } => {
                write!(f, "{triangles} triangles occur twice: their volume would count twice")
            }
            Self::Overlapping { winding, found, places } => write!(
                f,
                "parts overlap, lie within one another or pass through themselves (the surface winds {winding} times around a \
                 side of {found} of {places} places on it, 0 or 1 is needed): their volume would not count once"
            ),
        }
    }
}

/// What is wrong with a mesh file.
#[cfg(feature = "mesh")]
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum MeshFileProblem {
    /// The name ends in neither .obj nor .stl.
    UnknownFormat,
    /// The operating system could not open or read it.
    Io(std::io::ErrorKind),
    /// It is not an STL file, or is cut short.
    Stl {
        /// The reader's message.
        message: String,
    },
    /// It is not a valid OBJ file.
    Obj(tobj::LoadError),
    /// It has no triangles.
    Empty,
    /// Its last line does not end in a newline, as if the file was cut off.
    Cut,
    /// Its triangles do not enclose a volume once.
    Surface(MeshDefect),
}

#[cfg(feature = "mesh")]
impl fmt::Display for MeshFileProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownFormat => write!(f, "the name must end in .obj or .stl"),
            Self::Io(kind) => write!(f, "{kind}"),
            Self::Stl { message } => write!(f, "not a whole STL file ({message})"),
            Self::Obj(error) => write!(f, "not a valid OBJ file ({error})"),
            Self::Empty => write!(f, "no triangles in the file"),
            Self::Cut => {
                write!(
                    f,
                    "the last line does not end in a newline, so the file may be cut: add a newline if it is whole"
                )
            }
            Self::Surface(defect) => write!(f, "{defect}"),
        }
    }
}

/// The arrangement of points that have no convex hull with a volume.
#[cfg(feature = "mesh")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlatArrangement {
    /// All at one place, or no points at all.
    Coincide,
    /// On a line.
    OnALine,
    /// In a plane.
    InAPlane,
}

#[cfg(feature = "mesh")]
impl fmt::Display for FlatArrangement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Coincide => "coincide",
            Self::OnALine => "lie on a line",
            Self::InAPlane => "lie in a plane",
        })
    }
}
