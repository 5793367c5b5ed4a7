//! Smoothing along a surface, and filling a region from its rim.

use faer::prelude::*;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side};

use crate::error::{Error, Result};
use crate::mesh::Adjacency;
use crate::transfer::surface::Surface;
use crate::vector;

/// Least weight of an edge. Cotangents below zero would let a filled value leave the range of its
/// rim; with positive weights alone it cannot (the discrete maximum principle).
const LEAST_EDGE_WEIGHT: f64 = 1e-2;

/// Columns solved at a time: keeps memory small when there are hundreds of groups.
pub const COLUMNS_A_SOLVE: usize = 32;

/// Edge weights of a surface for averaging over neighbours.
#[derive(Debug)]
pub struct Diffusion {
    /// Neighbours of each vertex.
    pub neighbours: Adjacency,
    /// Weight of each entry of `neighbours`, positive.
    pub weights: Vec<f64>,
}

impl Diffusion {
    /// Cotangent weights ½(cot α + cot β), not below a small positive number.
    #[must_use]
    pub fn new(surface: &Surface) -> Self {
        let mut halves: Vec<(u32, u32, f64)> = Vec::with_capacity(surface.triangles.len() * 6);
        for (t, corners) in surface.triangles.iter().enumerate() {
            let positions = surface.corners(t as u32);
            let area = vector::norm(surface.cross(t as u32));
            for k in 0..3 {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                let u = vector::sub(positions[i], positions[k]);
                let v = vector::sub(positions[j], positions[k]);
                let half = if area > 0.0 {
                    vector::dot(u, v) / (2.0 * area)
                } else {
                    0.0
                };
                halves.push((corners[i], corners[j], half));
                halves.push((corners[j], corners[i], half));
            }
        }
        halves.sort_unstable_by_key(|&(a, b, _)| (a, b));
        let mut pairs = Vec::new();
        let mut weights = Vec::new();
        for run in halves.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            if run[0].0 != run[0].1 {
                pairs.push((run[0].0, run[0].1));
                let sum: f64 = run.iter().map(|h| h.2).sum();
                weights.push(sum.max(LEAST_EDGE_WEIGHT));
            }
        }
        Self {
            neighbours: Adjacency::from_lists(surface.vertices.len(), pairs.iter().copied()),
            weights,
        }
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

    /// Values `(n, channels)` in which those of `unknown` vertices are filled from the others.
    ///
    /// # Errors
    /// [`Error::BadArgument`] when the lengths do not fit, [`Error::NotFactorised`].
    pub fn filled(
        &self,
        mut values: Vec<f64>,
        channels: usize,
        unknown: &[bool],
    ) -> Result<Vec<f64>> {
        let n = self.neighbours.starts.len() - 1;
        if unknown.len() != n || values.len() != n * channels {
            return Err(Error::BadArgument {
                what: format!(
                    "`values` and `unknown` should have {n} rows, got {} and {}",
                    values.len() / channels.max(1),
                    unknown.len()
                ),
            });
        }
        let filling = self.filling(unknown)?;
        for begin in (0..channels).step_by(COLUMNS_A_SOLVE) {
            let count = COLUMNS_A_SOLVE.min(channels - begin);
            let solved = filling.solve(count, |v, c| values[v * channels + begin + c]);
            for (i, &v) in filling.vertices.iter().enumerate() {
                for c in 0..count {
                    values[v as usize * channels + begin + c] = solved[(i, c)];
                }
            }
        }
        Ok(values)
    }

    /// A factor for filling the `unknown` vertices from all others.
    ///
    /// # Errors
    /// [`Error::NotFactorised`], which positive weights rule out but for overflow.
    pub fn filling(&self, unknown: &[bool]) -> Result<Filling<'_>> {
        let n = self.neighbours.starts.len() - 1;
        // A piece of unknown vertices without a rim has nothing to be filled from.
        let mut reached = vec![false; n];
        let mut stack: Vec<u32> = (0..n)
            .filter(|&v| unknown[v] && self.row(v).any(|(u, _)| !unknown[u as usize]))
            .map(|v| v as u32)
            .collect();
        while let Some(v) = stack.pop() {
            if std::mem::replace(&mut reached[v as usize], true) {
                continue;
            }
            stack.extend(
                self.neighbours
                    .row(v as usize)
                    .iter()
                    .filter(|&&u| unknown[u as usize] && !reached[u as usize]),
            );
        }
        let vertices: Vec<u32> = (0..n as u32).filter(|&v| reached[v as usize]).collect();
        let mut place = vec![u32::MAX; n];
        for (i, &v) in vertices.iter().enumerate() {
            place[v as usize] = i as u32;
        }
        let mut entries = Vec::new();
        for (i, &v) in vertices.iter().enumerate() {
            let mut diagonal = 0.0;
            for (u, w) in self.row(v as usize) {
                diagonal += w;
                let j = place[u as usize];
                if j != u32::MAX && (j as usize) < i {
                    entries.push(Triplet::new(i, j as usize, -w));
                }
            }
            entries.push(Triplet::new(i, i, diagonal));
        }
        let not_factorised = |reason: String| Error::NotFactorised { reason };
        let factor = if vertices.is_empty() {
            None
        } else {
            let size = vertices.len();
            let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(size, size, &entries)
                .map_err(|e| not_factorised(format!("{e:?}")))?;
            Some(
                matrix
                    .sp_cholesky(Side::Lower)
                    .map_err(|e| not_factorised(format!("{e:?}")))?,
            )
        };
        Ok(Filling {
            diffusion: self,
            place,
            vertices,
            factor,
        })
    }
}

/// Fills vertices so that each value is the weighted mean of its neighbours'.
pub struct Filling<'a> {
    diffusion: &'a Diffusion,
    place: Vec<u32>,
    /// The vertices that are filled, ascending.
    pub vertices: Vec<u32>,
    factor: Option<faer::sparse::linalg::solvers::Llt<usize, f64>>,
}

impl Filling<'_> {
    /// Values at [`Self::vertices`], `(vertices, channels)`, from `known(vertex, channel)` at all others.
    #[must_use]
    pub fn solve(&self, channels: usize, known: impl Fn(usize, usize) -> f64) -> Mat<f64> {
        let mut right = Mat::<f64>::zeros(self.vertices.len(), channels);
        for (i, &v) in self.vertices.iter().enumerate() {
            for (u, w) in self.diffusion.row(v as usize) {
                if self.place[u as usize] == u32::MAX {
                    for c in 0..channels {
                        right[(i, c)] += w * known(u as usize, c);
                    }
                }
            }
        }
        if let Some(factor) = &self.factor {
            factor.solve_in_place(&mut right);
        }
        right
    }
}
