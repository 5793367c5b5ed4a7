//! Nearest points of a surface that face the same way.
//!
//! Points p with unit directions n lie in six dimensions, the square of a distance being
//! ‖p − q‖² + ρ²‖n − m‖²: two sheets that lie back to back or face to face are 2ρ apart, however close they are.

use std::ops::Range;

use crate::algebra::vector::Point;

/// Points of a leaf.
const LEAF: usize = 8;

/// A point and a direction.
pub type Oriented = [f64; 6];

/// Joins a point and a direction.
#[must_use]
pub fn oriented(point: Point, direction: Point) -> Oriented {
    let ([a, b, c], [d, e, f]) = (point, direction);
    [a, b, c, d, e, f]
}

/// ‖p − q‖² + ρ²‖n − m‖², ρ² given.
#[must_use]
#[inline]
pub fn squared_distance(a: &Oriented, b: &Oriented, turning: f64) -> f64 {
    let square = |i: usize| (a[i] - b[i]) * (a[i] - b[i]);
    square(0) + square(1) + square(2) + turning * (square(3) + square(4) + square(5))
}

/// A balanced tree over points with directions, split at the median of the widest axis.
#[derive(Debug)]
pub struct OrientedTree {
    /// The points in the order of the tree.
    points: Vec<Oriented>,
    /// The number of each.
    numbers: Vec<u32>,
    /// The axis along which each divides its part.
    axes: Vec<u8>,
}

impl OrientedTree {
    /// Sorts points into a tree, O(n log n), axes compared at the given ρ; it answers for any other.
    #[must_use]
    pub fn new(points: &[Oriented], rho: f64) -> Self {
        let mut numbers: Vec<u32> = (0..points.len() as u32).collect();
        let mut axes = vec![0; points.len()];
        split(points, rho, &mut numbers, &mut axes);
        Self {
            points: numbers.iter().map(|&v| points[v as usize]).collect(),
            numbers,
            axes,
        }
    }

    /// Number of the nearest point, the lowest of equals, that is no farther than `known`, a squared distance with the
    /// number of its point, at ρ² = `turning`.
    #[must_use]
    pub fn nearest(&self, query: &Oriented, turning: f64, known: (f64, u32)) -> u32 {
        let mut best = known;
        self.visit(0..self.points.len(), query, turning, &mut best);
        best.1
    }

    fn visit(&self, part: Range<usize>, query: &Oriented, turning: f64, best: &mut (f64, u32)) {
        let mut offer = |place: usize| {
            let found = squared_distance(&self.points[place], query, turning);
            let found = (found, self.numbers[place]);
            if found < *best {
                *best = found;
            }
        };
        if part.len() <= LEAF {
            part.for_each(offer);
            return;
        }
        let middle = part.start + part.len() / 2;
        let axis = usize::from(self.axes[middle]);
        offer(middle);
        let offset = query[axis] - self.points[middle][axis];
        let weight = if axis < 3 { 1.0 } else { turning };
        let (low, high) = (part.start..middle, middle + 1..part.end);
        let (near, far) = if offset < 0.0 {
            (low, high)
        } else {
            (high, low)
        };
        self.visit(near, query, turning, best);
        if weight * offset * offset <= best.0 {
            self.visit(far, query, turning, best);
        }
    }
}

/// Parts of fewer points are sorted on one thread.
const ALONE: usize = 4096;

fn split(points: &[Oriented], rho: f64, part: &mut [u32], axes: &mut [u8]) {
    if part.len() <= LEAF {
        return;
    }
    let axis = widest_axis(points, rho, part);
    let middle = part.len() / 2;
    part.select_nth_unstable_by(middle, |&a, &b| {
        let key = |v: u32| points[v as usize][axis];
        key(a).total_cmp(&key(b)).then(a.cmp(&b))
    });
    axes[middle] = axis as u8;
    let (low, high) = part.split_at_mut(middle);
    let (low_axes, high_axes) = axes.split_at_mut(middle);
    if low.len() < ALONE {
        split(points, rho, low, low_axes);
        split(points, rho, &mut high[1..], &mut high_axes[1..]);
    } else {
        rayon::join(
            || split(points, rho, low, low_axes),
            || split(points, rho, &mut high[1..], &mut high_axes[1..]),
        );
    }
}

fn widest_axis(points: &[Oriented], rho: f64, part: &[u32]) -> usize {
    let mut low = [f64::INFINITY; 6];
    let mut high = [f64::NEG_INFINITY; 6];
    for &id in part {
        for c in 0..6 {
            low[c] = low[c].min(points[id as usize][c]);
            high[c] = high[c].max(points[id as usize][c]);
        }
    }
    let width = |c: usize| (high[c] - low[c]) * if c < 3 { 1.0 } else { rho };
    (0..6)
        .max_by(|&a, &b| width(a).total_cmp(&width(b)))
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::vector;

    #[test]
    fn the_nearest_agrees_with_trying_every_point_at_any_weight_of_directions() {
        let place = |i: f64| {
            let p = [(1.3 * i).sin(), (2.1 * i).cos(), (0.7 * i).sin() * 0.3];
            let n = vector::normalised([(5.1 * i).sin(), (3.3 * i).cos(), (4.7 * i).sin()]);
            oriented(p, n)
        };
        let points: Vec<Oriented> = (0..500).map(|i| place(f64::from(i))).collect();
        let tree = OrientedTree::new(&points, 0.2);
        for turning in [0.0, 0.01, 0.3, 4.0] {
            for i in 0..200 {
                let query = place(f64::from(i) + 0.37);
                let square = |p: &Oriented| squared_distance(p, &query, turning);
                let least = points.iter().map(square).fold(f64::INFINITY, f64::min);
                let found = tree.nearest(&query, turning, (f64::INFINITY, 0));
                assert_eq!(square(&points[found as usize]), least);
                // What is known already is only bettered.
                let known = (square(&points[7]), 7);
                assert_eq!(tree.nearest(&query, turning, known), found);
            }
        }
    }
}
