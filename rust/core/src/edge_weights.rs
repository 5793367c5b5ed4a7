//! Positive cotangent weights of a surface's edges.

use crate::mesh::{Adjacency, LEAST_RELATIVE_AREA};
use crate::vector::{self, Point};

/// Least weight of an edge. Cotangents below zero would let an average of neighbours leave their
/// range and a stretched edge pay off.
const LEAST: f64 = 1e-2;

/// Neighbours with weights: how strongly they pull at a vertex.
#[derive(Debug)]
pub struct EdgeWeights {
    /// Neighbours of each vertex, ascending.
    pub neighbours: Adjacency,
    /// Weight of each entry of `neighbours`, positive and the same both ways.
    pub weights: Vec<f64>,
}

impl EdgeWeights {
    /// ½(cot α + cot β) of the angles opposite an edge, not below a small positive number.
    #[must_use]
    pub fn new(positions: &[Point], triangles: &[[u32; 3]]) -> Self {
        let mut halves: Vec<(u32, u32, f64)> = Vec::with_capacity(triangles.len() * 6);
        for corners in triangles {
            let at = corners.map(|v| positions[v as usize]);
            let (ab, ac) = (vector::sub(at[1], at[0]), vector::sub(at[2], at[0]));
            let double_area = vector::norm(vector::cross(ab, ac));
            let bc = vector::sub(ac, ab);
            let longest = [ab, ac, bc]
                .map(|e| vector::dot(e, e))
                .into_iter()
                .fold(0.0, f64::max);
            for k in 0..3 {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                let u = vector::sub(at[i], at[k]);
                let v = vector::sub(at[j], at[k]);
                // A face without an area worth the name has no angles.
                let half = if double_area > LEAST_RELATIVE_AREA * longest {
                    vector::dot(u, v) / (2.0 * double_area)
                } else {
                    0.0
                };
                halves.push((corners[i], corners[j], half));
                halves.push((corners[j], corners[i], half));
            }
        }
        // Stable, so that each sum is taken in the order of the triangles.
        halves.sort_by_key(|&(a, b, _)| (a, b));
        let mut pairs = Vec::new();
        let mut weights = Vec::new();
        for run in halves.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            if run[0].0 != run[0].1 {
                pairs.push((run[0].0, run[0].1));
                let sum: f64 = run.iter().map(|h| h.2).sum();
                weights.push(sum.max(LEAST));
            }
        }
        Self {
            neighbours: Adjacency::from_lists(positions.len(), pairs.iter().copied()),
            weights,
        }
    }

    /// Number of vertices.
    #[must_use]
    pub fn len(&self) -> usize {
        self.neighbours.starts.len() - 1
    }

    /// Whether there is no vertex.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Neighbours of a vertex with their weights.
    pub fn row(&self, v: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let begin = self.neighbours.starts[v] as usize;
        self.neighbours
            .row(v)
            .iter()
            .enumerate()
            .map(move |(i, &w)| (w, self.weights[begin + i]))
    }
}
