//! Rotation, scale and translation fitted to pairs of points.

use faer::{Mat, Side};

use crate::algebra::dense::clearing_registers;
use crate::algebra::vector::{self, Point};

/// `p → to + scale · turn · (p − from)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    /// Centre of the given points.
    pub from: Point,
    /// Centre of the points to which they go.
    pub to: Point,
    /// Rows of the rotation, or of a mirroring one.
    pub turn: [Point; 3],
    /// Scale, positive.
    pub scale: f64,
}

impl Similarity {
    /// The best in the least-squares sense between weighted pairs of points, of those that mirror
    /// or of those that do not.
    #[must_use]
    pub fn fitted(pairs: &[(Point, Point, f64)], mirrored: bool) -> Self {
        let total: f64 = pairs.iter().map(|p| p.2).sum();
        let mean = |pick: fn(&(Point, Point, f64)) -> Point| {
            pairs.iter().fold([0.0; 3], |sum, p| {
                vector::add(sum, vector::scaled(pick(p), p.2 / total))
            })
        };
        let (from, to) = (mean(|p| p.0), mean(|p| p.1));
        let mut covariance = [[0.0; 3]; 3];
        let (mut before, mut after) = (0.0, 0.0);
        for &(p, q, w) in pairs {
            let (d, e) = (vector::sub(p, from), vector::sub(q, to));
            for (row, x) in covariance.iter_mut().zip(e) {
                *row = vector::add(*row, vector::scaled(d, w * x));
            }
            before += w * vector::dot(d, d);
            after += w * vector::dot(e, e);
        }
        let scale = (after / before).sqrt();
        Self {
            from,
            to,
            turn: nearest_turn(&covariance, mirrored),
            scale: if scale.is_finite() && scale > 0.0 {
                scale
            } else {
                1.0
            },
        }
    }

    /// Where a point goes.
    #[must_use]
    pub fn apply(&self, p: Point) -> Point {
        let offset = vector::sub(p, self.from);
        let turned = self.turn.map(|row| self.scale * vector::dot(row, offset));
        vector::add(self.to, turned)
    }
}

/// The rotation, or with `mirrored` the rotation times −1, with the largest `Σ turn · matrix`.
#[must_use]
pub fn nearest_turn(matrix: &[Point; 3], mirrored: bool) -> [Point; 3] {
    let sign = if mirrored { -1.0 } else { 1.0 };
    let size = matrix
        .iter()
        .map(|r| vector::dot(*r, *r))
        .sum::<f64>()
        .sqrt();
    let identity = [[sign, 0.0, 0.0], [0.0, sign, 0.0], [0.0, 0.0, sign]];
    if size.is_nan() || size <= 0.0 {
        return identity;
    }
    // Horn's symmetric matrix of the covariance Σ source · targetᵀ.
    let s = |i: usize, j: usize| sign * matrix[j][i] / size;
    let rows = [
        [
            s(0, 0) + s(1, 1) + s(2, 2),
            s(1, 2) - s(2, 1),
            s(2, 0) - s(0, 2),
            s(0, 1) - s(1, 0),
        ],
        [
            s(1, 2) - s(2, 1),
            s(0, 0) - s(1, 1) - s(2, 2),
            s(0, 1) + s(1, 0),
            s(2, 0) + s(0, 2),
        ],
        [
            s(2, 0) - s(0, 2),
            s(0, 1) + s(1, 0),
            s(1, 1) - s(0, 0) - s(2, 2),
            s(1, 2) + s(2, 1),
        ],
        [
            s(0, 1) - s(1, 0),
            s(2, 0) + s(0, 2),
            s(1, 2) + s(2, 1),
            s(2, 2) - s(0, 0) - s(1, 1),
        ],
    ];
    let horn = Mat::from_fn(4, 4, |i, j| rows[i][j]);
    let Ok(eigen) = clearing_registers(|| horn.self_adjoint_eigen(Side::Lower)) else {
        return identity;
    };
    let q = eigen.U().col(3);
    let (w, x, y, z) = (q[0], q[1], q[2], q[3]);
    let length = w * w + x * x + y * y + z * z;
    let turn = [
        [
            w * w + x * x - y * y - z * z,
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            w * w - x * x + y * y - z * z,
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            w * w - x * x - y * y + z * z,
        ],
    ];
    turn.map(|row| vector::scaled(row, sign / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_and_a_mirror_come_back() {
        let (c, s) = (0.3f64.cos(), 0.3f64.sin());
        let turn = [[c, -s, 0.0], [s * c, c * c, -s], [s * s, s * c, c]];
        for (factor, mirrored) in [(2.0, false), (-2.0, true)] {
            let matrix = turn.map(|r| vector::scaled(r, factor));
            let found = nearest_turn(&matrix, mirrored);
            for (row, expected) in found.iter().zip(turn) {
                for (x, e) in row.iter().zip(expected) {
                    assert!((x - e * factor.signum()).abs() < 1e-12);
                }
            }
        }
    }
}
