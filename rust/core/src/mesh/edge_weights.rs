//! Positive cotangent weights of a surface's edges.

use crate::algebra::vector::{self, Point};
use crate::mesh::settings::EDGE_WEIGHTS;
use crate::mesh::{Adjacency, LEAST_RELATIVE_AREA};

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
        // Neighbour and half of a weight, two for each corner of a triangle, vertex by vertex.
        let mut ends = vec![0; positions.len() + 1];
        for &v in triangles.iter().flatten() {
            ends[v as usize + 1] += 2;
        }
        for v in 0..positions.len() {
            ends[v + 1] += ends[v];
        }
        let mut halves = vec![(0, 0.0); 6 * triangles.len()];
        let mut put = |v: u32, half: (u32, f64)| {
            let next = &mut ends[v as usize];
            halves[*next] = half;
            *next += 1;
        };
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
                put(corners[i], (corners[j], half));
                put(corners[j], (corners[i], half));
            }
        }
        let (mut starts, mut entries, mut weights) = (vec![0], Vec::new(), Vec::new());
        let mut from = 0;
        for (v, &to) in (0..).zip(&ends[..positions.len()]) {
            let row = &mut halves[from..to];
            from = to;
            // Stable, so that each sum is taken in the order of the triangles.
            row.sort_by_key(|&(u, _)| u);
            for run in row.chunk_by(|a, b| a.0 == b.0) {
                if run[0].0 != v {
                    entries.push(run[0].0);
                    weights.push(
                        run.iter()
                            .map(|half| half.1)
                            .sum::<f64>()
                            .max(EDGE_WEIGHTS.least),
                    );
                }
            }
            starts.push(entries.len() as u32);
        }
        Self {
            neighbours: Adjacency { starts, entries },
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
