//! Rotation, scale and translation fitted to pairs of points.

use crate::transfer::frames::nearest_turn;
use crate::vector::{self, Point};

/// `p → to + scale · turn · (p − from)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    /// Centre of the given points.
    pub from: Point,
    /// Centre of the points to which they go.
    pub to: Point,
    /// Rows of the rotation.
    pub turn: [Point; 3],
    /// Scale, positive.
    pub scale: f64,
}

impl Similarity {
    /// The best in the least-squares sense between weighted pairs of points.
    #[must_use]
    pub fn fitted(pairs: &[(Point, Point, f64)]) -> Self {
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
            turn: nearest_turn(&covariance, false),
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
