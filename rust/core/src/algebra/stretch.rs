//! The symmetric stretch that takes one matrix of second moments to another.
//!
//! Of points x with the moments A = Σ x xᵀ, the moments of M x are M A M. The one symmetric positive M with M A M = B is the geometric
//! mean of A⁻¹ and B (Pusz, Woronowicz, 1975), to which the arithmetic and harmonic means of the two come together (Ando, Li,
//! Mathias, 2004).

use crate::algebra::vector::{self, Point};

/// Rows of a matrix.
type Matrix = [Point; 3];

/// Steps of a mean: each halves the ratio of the two until they are near, ten times for one of 10⁶, and then squares what is left.
const STEPS: usize = 14;

/// The symmetric positive M with M A M = B, for matrices of second moments that are not zero. A positive `ridge`, as a share of either
/// trace, is added along every axis: nothing tells how what is flat or thin is stretched across, and it is stretched there as elsewhere.
#[must_use]
pub fn between(a: &Matrix, b: &Matrix, ridge: f64) -> Matrix {
    let upright = |m: &Matrix| {
        let ridge = ridge * trace(m);
        let mut m = *m;
        for (i, row) in m.iter_mut().enumerate() {
            row[i] += ridge;
        }
        m
    };
    let (mut upper, mut lower) = (inverse(&upright(a)), upright(b));
    let (of_upper, of_lower) = (trace(&upper), trace(&lower));
    let scaled = |m: &Matrix, by: f64| m.map(|row| vector::scaled(row, by));
    upper = scaled(&upper, 1.0 / of_upper);
    lower = scaled(&lower, 1.0 / of_lower);
    for _ in 0..STEPS {
        let harmonic = inverse(&mean(&inverse(&upper), &inverse(&lower)));
        upper = mean(&upper, &lower);
        lower = harmonic;
    }
    scaled(&upper, (of_upper * of_lower).sqrt())
}

/// Second moments of some points.
#[must_use]
pub fn moments(points: &[Point]) -> Matrix {
    points.iter().fold([[0.0; 3]; 3], |mut sum, &p| {
        for (row, x) in sum.iter_mut().zip(p) {
            *row = vector::add(*row, vector::scaled(p, x / points.len() as f64));
        }
        sum
    })
}

fn mean(a: &Matrix, b: &Matrix) -> Matrix {
    [0, 1, 2].map(|i| vector::scaled(vector::add(a[i], b[i]), 0.5))
}

fn trace(m: &Matrix) -> f64 {
    m[0][0] + m[1][1] + m[2][2]
}

/// Of a symmetric matrix.
fn inverse(m: &Matrix) -> Matrix {
    let rows = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| vector::cross(m[i], m[j]));
    let determinant = vector::dot(m[0], rows[0]);
    rows.map(|row| vector::scaled(row, 1.0 / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RIDGE: f64 = 1e-3;

    /// Points of some moments, and those moved by a symmetric matrix.
    #[test]
    fn a_symmetric_stretch_comes_back() {
        let made = [[2.0, 0.3, -0.2], [0.3, 0.6, 0.1], [-0.2, 0.1, 1.1]];
        let points: Vec<Point> = (0..60)
            .map(|k| {
                let t = f64::from(k);
                [
                    t.sin(),
                    0.8 * (1.7 * t).cos(),
                    (0.6 * t).sin() + 0.3 * t.cos(),
                ]
            })
            .collect();
        let moved: Vec<Point> = (points.iter())
            .map(|&p| made.map(|row| vector::dot(row, p)))
            .collect();
        let [before, after] = [&points, &moved].map(|points| moments(points));
        let found = between(&before, &after, RIDGE);
        for (row, made) in found.iter().zip(made) {
            for (x, e) in row.iter().zip(made) {
                // The ridge draws it to an even one, by about its share of a trace over an eigenvalue.
                assert!((x - e).abs() < 20.0 * RIDGE, "{found:?}");
            }
        }
        let back = between(&after, &before, RIDGE);
        for (i, row) in back.iter().enumerate() {
            // The inverse, as they are symmetric.
            for (j, other) in found.iter().enumerate() {
                let e = if i == j { 1.0 } else { 0.0 };
                assert!((vector::dot(*row, *other) - e).abs() < 1e-9, "{back:?}");
            }
        }
    }

    #[test]
    fn what_is_thin_is_scaled_across_as_along() {
        let line = moments(&[[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]);
        let longer = moments(&[[3.0, 0.0, 0.0], [-3.0, 0.0, 0.0]]);
        for (i, row) in between(&line, &longer, RIDGE).iter().enumerate() {
            assert!((row[i] - 3.0).abs() < 1e-9);
        }
    }
}
