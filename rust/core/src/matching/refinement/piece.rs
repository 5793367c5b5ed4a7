//! A piece of a shape as a shape of its own.

use crate::shape::Shape;

/// A piece of a shape, prepared by itself.
#[derive(Debug)]
pub struct Piece {
    /// The piece.
    pub shape: Shape,
    /// Vertex of the whole shape that each of its vertices is, in ascending order.
    pub vertices: Vec<u32>,
    /// Vertex of the piece that lies nearest to each vertex of the whole shape.
    pub nearest: Vec<u32>,
}
