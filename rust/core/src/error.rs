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
    /// A system of equations has no factor.
    NotFactorised { of: System, reason: String },
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

/// A system of equations by what it is solved for; each fails for causes of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum System {
    /// Eigenfunctions of a surface.
    Laplacian,
    /// The distances of a shape, and what its descriptors say beside one another, in terms of few functions.
    Shape,
    /// A map between two spectra from matched points.
    Map,
    /// A surface that is drawn onto another.
    Deformation,
    /// Values where none were carried.
    Filling,
    /// Where the vertices of a garment go.
    Garment,
    /// The order in which the unknowns of a sparse system are eliminated.
    Elimination,
}

impl System {
    /// What failed, why, and what the user can do.
    fn failed(self, reason: &str) -> String {
        match self {
            Self::Laplacian => format!(
                "the Laplace operator could not be factorised ({reason}): \
                 merge vertices that lie on top of each other and dissolve needle triangles"
            ),
            Self::Shape => format!(
                "the distances on a surface could not be expressed in its eigenfunctions ({reason}): \
                 merge vertices that lie on top of each other and dissolve needle triangles"
            ),
            Self::Map => format!(
                "no map could be fitted to the points that were matched ({reason}): \
                 set landmarks, or say which shape is a part of the other"
            ),
            Self::Deformation => format!(
                "one surface could not be drawn onto the other ({reason}): \
                 merge vertices that lie on top of each other and dissolve needle triangles"
            ),
            Self::Filling => format!(
                "values could not be filled in where none were carried ({reason}): \
                 merge vertices that lie on top of each other and dissolve needle triangles"
            ),
            Self::Garment => format!(
                "the garment could not be fitted ({reason}): \
                 merge vertices that lie on top of each other and dissolve needle triangles"
            ),
            Self::Elimination => format!(
                "the equations could not be set up ({reason}): close other programs, or simplify the mesh"
            ),
        }
    }
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
            Self::NotFactorised { of, reason } => write!(f, "{}", of.failed(reason)),
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
    pub(crate) fn not_factorised(of: System, reason: impl fmt::Debug) -> Self {
        Self::NotFactorised {
            of,
            reason: format!("{reason:?}"),
        }
    }
}

impl std::error::Error for Error {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_system_of_equations_is_named_with_a_remedy_and_no_other_is() {
        let all = [
            System::Laplacian,
            System::Shape,
            System::Map,
            System::Deformation,
            System::Filling,
            System::Garment,
            System::Elimination,
        ];
        let mut named: Vec<String> = Vec::new();
        for of in all {
            let said = Error::not_factorised(of, "pivot 3").to_string();
            let (failed, remedy) = said
                .split_once(" (\"pivot 3\"): ")
                .expect("the reason stands between both");
            assert_eq!(failed.contains("Laplace"), of == System::Laplacian);
            assert!(!remedy.is_empty());
            named.push(failed.to_owned());
        }
        named.sort_unstable();
        named.dedup();
        assert_eq!(named.len(), all.len());
    }
}
