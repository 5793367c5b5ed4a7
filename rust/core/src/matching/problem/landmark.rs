//! Pairs of points that the user knows to belong together.

use crate::matching::problem::which::Which;

/// A vertex of the source and the vertex of the target that is its counterpart, in one of the
/// [numberings](crate::mesh::numbering).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Landmark<Vertex> {
    /// On the source.
    pub source: Vertex,
    /// On the target.
    pub target: Vertex,
}

impl<Vertex: Copy> Landmark<Vertex> {
    /// Its vertex on either shape.
    #[must_use]
    pub fn on(self, which: Which) -> Vertex {
        match which {
            Which::Target => self.target,
            Which::Source => self.source,
        }
    }

    /// The same with source and target exchanged.
    #[must_use]
    pub fn inverse(self) -> Self {
        Self {
            source: self.target,
            target: self.source,
        }
    }
}
