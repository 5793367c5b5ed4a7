//! How a map turns and scales the surroundings of one point, and matrices of three rows.

use crate::algebra::similarity::{Similarity, nearest_turn};
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

pub(crate) fn transposed(m: &Matrix) -> Matrix {
    [0, 1, 2].map(|i| m.map(|row| row[i]))
}

pub(crate) fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let columns = transposed(b);
    a.map(|row| columns.map(|column| vector::dot(row, column)))
}

/// By cofactors; none of a matrix without an inverse.
pub(crate) fn inverse(m: &Matrix) -> Option<Matrix> {
    let det = determinant(m);
    if !det.is_normal() {
        return None;
    }
    let cofactors = [
        vector::cross(m[1], m[2]),
        vector::cross(m[2], m[0]),
        vector::cross(m[0], m[1]),
    ];
    Some(transposed(&cofactors).map(|row| vector::scaled(row, 1.0 / det)))
}

/// The turn and the symmetric stretch of which a matrix is `turn · stretch`; the turn mirrors if the matrix does.
///
/// The turn is the orthogonal matrix nearest to it. Of a matrix that flattens space along more than one axis it is any
/// of them.
///
/// # Source
/// The polar decomposition: Higham, "Computing the polar decomposition, with applications", 1986.
#[must_use]
pub fn polar(m: &[Point; 3]) -> ([Point; 3], [Point; 3]) {
    let turn = nearest_turn(m, determinant(m) < 0.0);
    let stretch = product(&transposed(&turn), m);
    // Both halves of it are right to rounding.
    let even = |i: usize, j: usize| f64::midpoint(stretch[i][j], stretch[j][i]);
    let stretch = [0, 1, 2].map(|i| [0, 1, 2].map(|j| even(i, j)));
    (turn, stretch)
}

/// An affine map of space, `p → linear · p + shift`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Affine {
    /// Rows of a matrix.
    pub linear: [Point; 3],
    /// Where the origin goes.
    pub shift: Point,
}

impl Affine {
    /// That of a matrix (4, 4) by rows, the last of which is not read.
    #[must_use]
    pub fn of_rows(rows: &[[f64; 4]; 4]) -> Self {
        let [x, y, z, _] = *rows;
        Self {
            linear: [x, y, z].map(|[a, b, c, _]| [a, b, c]),
            shift: [x[3], y[3], z[3]],
        }
    }

    /// As a matrix (4, 4) by rows.
    #[must_use]
    pub fn rows(&self) -> [[f64; 4]; 4] {
        let row = |i: usize| {
            let [a, b, c] = self.linear[i];
            [a, b, c, self.shift[i]]
        };
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }

    /// Where a point goes.
    #[must_use]
    pub fn apply(&self, p: Point) -> Point {
        vector::add(vector::by_rows(&self.linear, p), self.shift)
    }

    /// `self` after `first`.
    #[must_use]
    pub fn after(&self, first: &Self) -> Self {
        Self {
            linear: product(&self.linear, &first.linear),
            shift: self.apply(first.shift),
        }
    }

    /// What takes points back; none where space is flattened.
    #[must_use]
    pub fn inverse(&self) -> Option<Self> {
        let linear = inverse(&self.linear)?;
        let shift = vector::scaled(vector::by_rows(&linear, self.shift), -1.0);
        Some(Self { linear, shift })
    }

    /// By how much it scales lengths: the cube root of how much it scales volumes.
    #[must_use]
    pub fn scale(&self) -> f64 {
        determinant(&self.linear).abs().cbrt()
    }
}

impl From<Similarity> for Affine {
    fn from(found: Similarity) -> Self {
        Self {
            linear: found.turn.map(|row| vector::scaled(row, found.scale)),
            shift: found.apply([0.0; 3]),
        }
    }
}

pub(crate) fn unity() -> Matrix {
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn an_affine_map_and_its_inverse_lead_back() {
        let map = Affine {
            linear: [[2.0, 1.0, 0.0], [0.0, -1.0, 0.5], [0.25, 0.0, 1.0]],
            shift: [3.0, -1.0, 0.5],
        };
        let back = map.inverse().unwrap();
        let p = [0.3, 0.7, -0.2];
        for found in [back.apply(map.apply(p)), map.after(&back).apply(p)] {
            assert!(vector::distance(found, p) < 1e-14);
        }
        assert_eq!(Affine::of_rows(&map.rows()), map);
        // The determinant, by the first row, is 2 · (−1) − 1 · (−0.125).
        assert!((map.scale() - 1.875f64.cbrt()).abs() < 1e-15);
        let flat = Affine {
            linear: [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
            ..map
        };
        assert!(flat.inverse().is_none());
    }

    /// A turn by a third about (1, 1, 1).
    const TURN: Matrix = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn a_matrix_is_its_turn_after_its_stretch() {
        let made = [[2.0, 0.3, -0.2], [0.3, 0.6, 0.1], [-0.2, 0.1, 1.1]];
        for turned in [TURN, TURN.map(|row| vector::scaled(row, -1.0))] {
            let (turn, stretch) = polar(&product(&turned, &made));
            for (found, wanted) in [(turn, turned), (stretch, made)] {
                for (x, e) in found.as_flattened().iter().zip(wanted.as_flattened()) {
                    // Some roundings of a matrix of size 2.
                    assert!((x - e).abs() < 1e-14, "{found:?}");
                }
            }
        }
    }
}
