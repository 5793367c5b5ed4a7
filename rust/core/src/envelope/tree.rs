//! Tree over the triangles of a soup, by boxes: what [`super::distance`] and [`super::winding`] search.
//!
//! Complete binary tree in the order of a heap: node k has the children 2k + 1 and 2k + 2, the triangles of a node are
//! those of its first child and then those of its second, halved at each level. Numbers are in single precision: of a soup
//! scaled to 1 they are exact to 6e-8, a hundred-thousandth of a cell of the grid.

use std::ops::Range;

use rayon::prelude::*;

use super::moments::Moments;
use super::place::{Place, Triangle};

/// Triangles of a leaf, to twice as many: fewer make the tree deeper, more are tried in vain.
const LEAF: usize = 4;

/// Triangles of a part below which it is not worth another thread.
const ALONE: usize = 4096;

/// Piece of a node with triangles of several.
pub(super) const SEVERAL: u32 = u32::MAX;

/// Box of the triangles of a node, and their piece when it is one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    pub low: Place,
    pub high: Place,
    pub piece: u32,
    pub moments: Moments,
}

/// Triangles in the order of the tree, with its nodes.
#[derive(Debug)]
pub(super) struct Tree {
    pub triangles: Vec<Triangle>,
    pub nodes: Vec<Node>,
    /// Number of leaves, a power of two.
    leaves: usize,
}

impl Node {
    fn of_triangles(triangles: &[Triangle]) -> Self {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for corner in triangles.iter().flat_map(|t| &t.corners) {
            low = [0, 1, 2].map(|i| low[i].min(corner[i]));
            high = [0, 1, 2].map(|i| high[i].max(corner[i]));
        }
        let first = triangles.first().map_or(SEVERAL, |t| t.piece);
        let is_one = triangles.iter().all(|t| t.piece == first);
        Self {
            low,
            high,
            piece: if is_one { first } else { SEVERAL },
            moments: Moments::of_triangles(triangles, low, high),
        }
    }

    fn joined(&self, other: &Self) -> Self {
        let low = [0, 1, 2].map(|i| self.low[i].min(other.low[i]));
        let high = [0, 1, 2].map(|i| self.high[i].max(other.high[i]));
        let is_one = self.piece == other.piece;
        Self {
            low,
            high,
            piece: if is_one { self.piece } else { SEVERAL },
            moments: self.moments.joined(&other.moments, low, high),
        }
    }
}

impl Tree {
    /// Sorts triangles, of which there is at least one.
    pub fn new(given: &[Triangle]) -> Self {
        let centres: Vec<Place> = given.par_iter().map(Triangle::centroid).collect();
        let mut order: Vec<u32> = (0..given.len() as u32).collect();
        let leaves = (given.len() / LEAF).next_power_of_two();
        let parts = Parts {
            centres: &centres,
            count: given.len(),
            leaves,
        };
        parts.split(&mut order, 0, leaves);
        let triangles: Vec<Triangle> = order.par_iter().map(|&t| given[t as usize]).collect();
        let mut levels: Vec<Vec<Node>> = vec![
            (0..leaves)
                .into_par_iter()
                .map(|k| Node::of_triangles(&triangles[parts.start(k)..parts.start(k + 1)]))
                .collect(),
        ];
        while let Some(below) = levels.last().filter(|below| below.len() > 1) {
            let pairs = below.par_chunks_exact(2);
            let level = pairs.map(|pair| pair[0].joined(&pair[1])).collect();
            levels.push(level);
        }
        levels.reverse();
        Self {
            triangles,
            nodes: levels.concat(),
            leaves,
        }
    }

    /// Whether a place is in the box of all triangles. What is not lies outside of any solid, whatever the winding number of
    /// many sheets above one another comes to there.
    pub fn holds(&self, q: Place) -> bool {
        let Node { low, high, .. } = &self.nodes[0];
        (0..3).all(|i| (low[i]..=high[i]).contains(&q[i]))
    }

    /// Triangles of a node when it is a leaf.
    pub fn leaf(&self, node: usize) -> Option<&[Triangle]> {
        self.leaf_range(node).map(|range| &self.triangles[range])
    }

    /// Their numbers.
    pub fn leaf_range(&self, node: usize) -> Option<Range<usize>> {
        let k = (node + 1).checked_sub(self.leaves)?;
        let start = |k: usize| k * self.triangles.len() / self.leaves;
        Some(start(k)..start(k + 1))
    }
}

/// Triangles shared out evenly among leaves.
struct Parts<'a> {
    centres: &'a [Place],
    count: usize,
    leaves: usize,
}

impl Parts<'_> {
    fn start(&self, leaf: usize) -> usize {
        leaf * self.count / self.leaves
    }

    /// Halves the triangles of some leaves at the median of their widest axis, and so on.
    fn split(&self, part: &mut [u32], from: usize, to: usize) {
        if to - from < 2 {
            return;
        }
        let middle = from.midpoint(to);
        let at = self.start(middle) - self.start(from);
        let axis = widest_axis(self.centres, part);
        if at < part.len() {
            part.select_nth_unstable_by(at, |&a, &b| {
                let key = |t: u32| self.centres[t as usize][axis];
                key(a).total_cmp(&key(b)).then(a.cmp(&b))
            });
        }
        let is_large = part.len() > ALONE;
        let (low, high) = part.split_at_mut(at);
        if is_large {
            rayon::join(
                || self.split(low, from, middle),
                || self.split(high, middle, to),
            );
        } else {
            self.split(low, from, middle);
            self.split(high, middle, to);
        }
    }
}

fn widest_axis(centres: &[Place], part: &[u32]) -> usize {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for &t in part {
        let centre = centres[t as usize];
        low = [0, 1, 2].map(|i| low[i].min(centre[i]));
        high = [0, 1, 2].map(|i| high[i].max(centre[i]));
    }
    (0..3)
        .max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b])))
        .unwrap_or(0)
}
