//! What can go wrong, one variant per thing a user can act on.

use std::fmt;

/// Failure of a stage. Every message ends with what to do.
#[derive(Debug, Clone, PartialEq)]
pub enum Error {
    /// No triangle with an area is left.
    EmptyMesh { vertices: usize, faces: usize },
    /// A coordinate is NaN or infinite.
    NotFinite { vertex: usize },
    /// A face names a vertex that does not exist.
    FaceIndexOutOfRange {
        face: usize,
        index: i64,
        vertices: usize,
    },
    /// The largest connected part is too small for a spectrum.
    TooFewVertices { found: usize, wanted: usize },
    /// The matrix of the operator could not be factorised.
    NotFactorised { reason: String },
    /// The eigensolver stopped before every pair had converged.
    NotConverged {
        found: usize,
        wanted: usize,
        residual: f64,
    },
    /// No candidate map survived.
    NoMap { reason: String },
    /// An argument has no meaning here.
    BadArgument { what: String },
    /// The progress callback asked to stop.
    Cancelled,
}

/// Shorthand used throughout the core.
pub type Result<T> = std::result::Result<T, Error>;

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::EmptyMesh { vertices, faces } => write!(
                f,
                "the mesh has no surface ({vertices} vertices, {faces} faces, none with an area): \
                 give a mesh with triangles"
            ),
            Self::NotFinite { vertex } => write!(
                f,
                "vertex {vertex} has a coordinate that is not finite: \
                 remove or repair that vertex"
            ),
            Self::FaceIndexOutOfRange {
                face,
                index,
                vertices,
            } => write!(
                f,
                "face {face} refers to vertex {index}, but there are {vertices} vertices \
                 (0 to {}): repair the face list",
                vertices.saturating_sub(1)
            ),
            Self::TooFewVertices { found, wanted } => write!(
                f,
                "the largest connected part has {found} vertices, at least {wanted} are needed: \
                 join loose parts by merging vertices at the same place, or subdivide"
            ),
            Self::NotFactorised { reason } => write!(
                f,
                "the Laplace operator could not be factorised ({reason}): \
                 merge vertices that lie on top of each other and dissolve needle triangles"
            ),
            Self::NotConverged {
                found,
                wanted,
                residual,
            } => write!(
                f,
                "{found} of {wanted} eigenpairs converged (largest residual {residual:.1e}): \
                 ask for fewer, or clean up needle triangles"
            ),
            Self::NoMap { reason } => write!(f, "no plausible map was found: {reason}"),
            Self::BadArgument { what } => write!(f, "{what}"),
            Self::Cancelled => write!(f, "cancelled"),
        }
    }
}

impl Error {
    /// [`Error::NotFactorised`] for what the linear algebra library says.
    pub(crate) fn not_factorised(reason: impl fmt::Debug) -> Self {
        Self::NotFactorised {
            reason: format!("{reason:?}"),
        }
    }
}

impl std::error::Error for Error {}
