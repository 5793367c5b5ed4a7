//! Rotation, scale and translation fitted to pairs of points.

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

    /// The same, with the scale that leaves the least squares among the points to which the others go. It is smaller than
    /// that of [`fitted`](Self::fitted), which is the same in both directions, the less the points fit.
    ///
    /// # Source
    /// Umeyama, "Least-squares estimation of transformation parameters between two point patterns", 1991.
    #[must_use]
    pub fn onto(pairs: &[(Point, Point, f64)], mirrored: bool) -> Self {
        let fitted = Self::fitted(pairs, mirrored);
        let (mut along, mut before) = (0.0, 0.0);
        for &(p, q, w) in pairs {
            let (d, e) = (vector::sub(p, fitted.from), vector::sub(q, fitted.to));
            along += w * vector::dot(vector::by_rows(&fitted.turn, d), e);
            before += w * vector::dot(d, d);
        }
        let scale = along / before;
        let scale = if scale.is_finite() && scale > 0.0 {
            scale
        } else {
            fitted.scale
        };
        Self { scale, ..fitted }
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
    if !size.is_finite() || size <= 0.0 {
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
    let [w, x, y, z] = largest_eigenvector(rows);
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

/// Sweeps over all pairs of axes: each squares what is left off the diagonal, and five leave nothing of it.
const SWEEPS: usize = 8;

/// The eigenvector of the largest eigenvalue of a symmetric matrix, of length 1, by Jacobi's rotations (Golub, Van Loan, "Matrix
/// computations", 8.5): a small one takes less by these than a decomposition made for large ones takes to begin.
fn largest_eigenvector(mut a: [[f64; 4]; 4]) -> [f64; 4] {
    // Columns are what the axes have become.
    let mut axes = [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| f64::from(u8::from(i == j))));
    for _ in 0..SWEEPS {
        let mut is_diagonal = true;
        for p in 0..3 {
            for q in p + 1..4 {
                if a[p][q].abs() <= f64::EPSILON * (a[p][p].abs() + a[q][q].abs()) {
                    continue;
                }
                is_diagonal = false;
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let tan = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let cos = 1.0 / (tan * tan + 1.0).sqrt();
                let sin = tan * cos;
                let turned = |x: f64, y: f64| (cos * x - sin * y, sin * x + cos * y);
                for row in a.iter_mut().chain(&mut axes) {
                    (row[p], row[q]) = turned(row[p], row[q]);
                }
                let (upper, lower) = a.split_at_mut(q);
                for (x, y) in upper[p].iter_mut().zip(&mut lower[0]) {
                    (*x, *y) = turned(*x, *y);
                }
            }
        }
        if is_diagonal {
            break;
        }
    }
    let largest = (1..4).fold(0, |most, i| if a[i][i] > a[most][most] { i } else { most });
    axes.map(|row| row[largest])
}

#[cfg(test)]
mod tests {
    use faer::{Mat, Side};

    use super::*;
    use crate::testing::fractions;

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

    /// Pairs that do not fit: no scale a little smaller or larger leaves less, and of those that fit it is the same.
    #[test]
    fn the_scale_onto_others_leaves_the_least_squares() {
        let mut fraction = fractions(2);
        let mut point = || [0; 3].map(|_| f64::from(fraction()));
        let pairs: Vec<(Point, Point, f64)> = (0..20).map(|_| (point(), point(), 1.0)).collect();
        let found = Similarity::onto(&pairs, false);
        let left = |scale: f64| -> f64 {
            let moved = Similarity { scale, ..found };
            let off = pairs
                .iter()
                .map(|&(p, q, w)| (vector::distance(moved.apply(p), q), w));
            off.map(|(off, w)| w * off * off).sum()
        };
        for by in [0.999, 1.001] {
            assert!(left(found.scale) < left(by * found.scale));
        }
        let exact: Vec<(Point, Point, f64)> = (pairs.iter())
            .map(|&(p, _, w)| (p, found.apply(p), w))
            .collect();
        // Both are quotients of the same sums up to rounding.
        assert!((Similarity::onto(&exact, false).scale / found.scale - 1.0).abs() < 1e-12);
    }

    /// Against the decomposition of a library: turns of covariances of all kinds, flat ones among them, are as good, though of equal
    /// ones another may be taken.
    #[test]
    fn turns_are_as_good_as_those_of_a_dense_decomposition() {
        let mut fraction = fractions(1);
        let mut random = || 2.0 * f64::from(fraction()) - 1.0;
        for round in 0..1000 {
            let mut rows = [[0.0; 4]; 4];
            for i in 0..4 {
                for j in 0..=i {
                    // Large and small entries, and empty ones.
                    let size = [1.0, 1e-9, 0.0][(round + i * j) % 3];
                    rows[i][j] = size * random();
                    rows[j][i] = rows[i][j];
                }
            }
            let found = largest_eigenvector(rows);
            let quotient: f64 = (0..4)
                .flat_map(|i| (0..4).map(move |j| (i, j)))
                .map(|(i, j)| found[i] * rows[i][j] * found[j])
                .sum();
            let dense = Mat::from_fn(4, 4, |i, j| rows[i][j]);
            let values = dense.self_adjoint_eigenvalues(Side::Lower).expect("finite");
            let length: f64 = found.iter().map(|x| x * x).sum();
            assert!((length - 1.0).abs() < 1e-12);
            // Both are exact to some roundings of the largest entry, which is below 1.
            assert!(
                (quotient - values[3]).abs() < 1e-13,
                "{quotient} {}",
                values[3]
            );
        }
    }
}
