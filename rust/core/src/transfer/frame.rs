//! How a map turns and scales the surroundings of one point.

use crate::algebra::vector::{self, Point};

/// Rows of a matrix.
pub(crate) type Matrix = [Point; 3];

/// A similarity's linear part: `vector on the target = scale · turn · vector on the source`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Rows of an orthogonal matrix; a mirroring one where the map turns left into right.
    pub turn: [Point; 3],
    /// Length on the target for a unit of length on the source, positive.
    pub scale: f64,
}

impl Frame {
    /// A displacement of the source as one of the target. Zero stays exactly zero.
    #[must_use]
    pub fn apply(&self, displacement: Point) -> Point {
        self.turn
            .map(|row| self.scale * vector::dot(row, displacement))
    }

    /// Whether it turns left into right.
    #[must_use]
    pub fn mirrors(&self) -> bool {
        determinant(&self.turn) < 0.0
    }
}

pub(crate) fn determinant(m: &Matrix) -> f64 {
    vector::dot(m[0], vector::cross(m[1], m[2]))
}
