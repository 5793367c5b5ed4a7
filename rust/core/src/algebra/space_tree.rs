//! Nearest points in space.

use std::borrow::Cow;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::ops::Range;

use rayon::prelude::*;

use crate::algebra::vector::{self, Point};

/// Points of a leaf.
const LEAF: usize = 8;

/// A balanced tree over points, split at the median of the widest axis.
#[derive(Debug)]
pub struct SpaceTree<'a> {
    points: Cow<'a, [Point]>,
    order: Vec<u32>,
    /// The axis along which the point at the same place in `order` divides its part.
    axes: Vec<u8>,
}

impl<'a> SpaceTree<'a> {
    /// Sorts the points, lent or given, into a tree; O(n log n).
    #[must_use]
    pub fn new(points: impl Into<Cow<'a, [Point]>>) -> Self {
        let points = points.into();
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        let mut axes = vec![0; points.len()];
        split(&points, &mut order, &mut axes);
        Self {
            points,
            order,
            axes,
        }
    }

    /// Nearest point, the lowest number winning a tie; nothing when there are no points.
    #[must_use]
    pub fn nearest(&self, query: Point) -> Option<u32> {
        let mut best = None;
        self.visit(0..self.order.len(), query, &mut best);
        best.map(|(_, id)| id)
    }

    /// Nearest point to each of some others; 0 when there are none to be near to.
    #[must_use]
    pub fn nearest_to_each(&self, queries: &[Point]) -> Vec<u32> {
        queries
            .par_iter()
            .map(|&p| self.nearest(p).unwrap_or_default())
            .collect()
    }

    /// The nearest points, at most `count` of them: squared distance and number, the nearest first, the lowest number
    /// winning a tie.
    #[must_use]
    pub fn nearest_few(&self, query: Point, count: usize) -> Vec<(f64, u32)> {
        let mut few = BinaryHeap::with_capacity(count + 1);
        self.visit_few(0..self.order.len(), query, count, &mut few);
        few.into_sorted_vec()
            .into_iter()
            .map(|Far(squared, id)| (squared, id))
            .collect()
    }

    fn visit_few(&self, part: Range<usize>, query: Point, count: usize, few: &mut BinaryHeap<Far>) {
        let mut offer = |id: u32| {
            let d = vector::sub(self.points[id as usize], query);
            let found = Far(vector::dot(d, d), id);
            if few.len() < count {
                few.push(found);
            } else if few.peek().is_some_and(|farthest| found < *farthest) {
                few.pop();
                few.push(found);
            }
        };
        if part.len() <= LEAF {
            self.order[part].iter().copied().for_each(offer);
            return;
        }
        let middle = part.start + part.len() / 2;
        let (dividing, axis) = (self.order[middle], usize::from(self.axes[middle]));
        offer(dividing);
        let offset = query[axis] - self.points[dividing as usize][axis];
        let (low, high) = (part.start..middle, middle + 1..part.end);
        let (near, far) = if offset < 0.0 {
            (low, high)
        } else {
            (high, low)
        };
        self.visit_few(near, query, count, few);
        if few.len() < count || few.peek().is_some_and(|f| offset * offset <= f.0) {
            self.visit_few(far, query, count, few);
        }
    }

    fn visit(&self, part: Range<usize>, query: Point, best: &mut Option<(f64, u32)>) {
        let mut offer = |id: u32| {
            let d = vector::sub(self.points[id as usize], query);
            let found = (vector::dot(d, d), id);
            if best.is_none_or(|b| found < b) {
                *best = Some(found);
            }
        };
        if part.len() <= LEAF {
            self.order[part].iter().copied().for_each(offer);
            return;
        }
        let middle = part.start + part.len() / 2;
        let (dividing, axis) = (self.order[middle], usize::from(self.axes[middle]));
        offer(dividing);
        let offset = query[axis] - self.points[dividing as usize][axis];
        let (low, high) = (part.start..middle, middle + 1..part.end);
        let (near, far) = if offset < 0.0 {
            (low, high)
        } else {
            (high, low)
        };
        self.visit(near, query, best);
        if best.is_none_or(|(d, _)| offset * offset <= d) {
            self.visit(far, query, best);
        }
    }
}

/// A squared distance and a number, in that order.
#[derive(PartialEq)]
struct Far(f64, u32);

impl Eq for Far {}

impl Ord for Far {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0).then(self.1.cmp(&other.1))
    }
}

impl PartialOrd for Far {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

fn split(points: &[Point], part: &mut [u32], axes: &mut [u8]) {
    if part.len() <= LEAF {
        return;
    }
    let axis = widest_axis(points, part);
    let middle = part.len() / 2;
    part.select_nth_unstable_by(middle, |&a, &b| {
        let key = |v: u32| points[v as usize][axis];
        key(a).total_cmp(&key(b)).then(a.cmp(&b))
    });
    axes[middle] = axis as u8;
    // The middle stays where it is: the search reads the dividing plane from it.
    let (low, high) = part.split_at_mut(middle);
    let (low_axes, high_axes) = axes.split_at_mut(middle);
    split(points, low, low_axes);
    split(points, &mut high[1..], &mut high_axes[1..]);
}

fn widest_axis(points: &[Point], part: &[u32]) -> usize {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for &id in part {
        for c in 0..3 {
            low[c] = low[c].min(points[id as usize][c]);
            high[c] = high[c].max(points[id as usize][c]);
        }
    }
    (0..3)
        .max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b])))
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_agrees_with_trying_every_point() {
        let place = |i: f64| [(1.3 * i).sin(), (2.1 * i).cos(), (0.7 * i).sin() * 0.3];
        let points: Vec<Point> = (0..500).map(|i| place(f64::from(i))).collect();
        let tree = SpaceTree::new(&points);
        for i in 0..300 {
            let query = place(f64::from(i) + 0.37);
            let distance = |p: &Point| vector::distance(*p, query);
            let least = points.iter().map(distance).fold(f64::INFINITY, f64::min);
            let found = tree.nearest(query).unwrap();
            assert_eq!(distance(&points[found as usize]), least);
            let mut all: Vec<(f64, u32)> =
                (0..).zip(&points).map(|(i, p)| (distance(p), i)).collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
            let few: Vec<u32> = tree.nearest_few(query, 20).iter().map(|f| f.1).collect();
            assert_eq!(few, all[..20].iter().map(|a| a.1).collect::<Vec<u32>>());
        }
        assert_eq!(tree.nearest_few(place(0.2), 600).len(), 500);
        assert!((0..500).all(|i| tree.nearest(points[i]) == Some(i as u32)));
    }
}
