//! Smoothing along a surface, and filling a region from its rim.

use faer::prelude::*;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side};

use crate::algebra::dense::clearing_registers;
use crate::error::{Error, Result, System};
use crate::mesh::edge_weights::EdgeWeights;
use crate::transfer::surface::Surface;

/// Columns solved at a time: keeps memory small when there are hundreds of groups.
pub const COLUMNS_A_SOLVE: usize = 32;

/// Averages over neighbours on a surface.
#[derive(Debug)]
pub struct Diffusion {
    /// Neighbours with the weights of their edges.
    pub edges: EdgeWeights,
}

impl Diffusion {
    /// Edge weights of a surface. With positive ones a filled value stays in the range of its rim
    /// (the discrete maximum principle).
    #[must_use]
    pub fn new(surface: &Surface) -> Self {
        Self {
            edges: EdgeWeights::new(&surface.vertices, &surface.triangles),
        }
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
        let n = self.edges.len();
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
        let n = self.edges.len();
        // A piece of unknown vertices without a rim has nothing to be filled from.
        let mut reached = vec![false; n];
        let mut stack: Vec<u32> = (0..n)
            .filter(|&v| unknown[v] && self.edges.row(v).any(|(u, _)| !unknown[u as usize]))
            .map(|v| v as u32)
            .collect();
        while let Some(v) = stack.pop() {
            if std::mem::replace(&mut reached[v as usize], true) {
                continue;
            }
            stack.extend(
                self.edges
                    .neighbours
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
            for (u, w) in self.edges.row(v as usize) {
                diagonal += w;
                let j = place[u as usize];
                if j != u32::MAX && (j as usize) < i {
                    entries.push(Triplet::new(i, j as usize, -w));
                }
            }
            entries.push(Triplet::new(i, i, diagonal));
        }
        let not_factorised = |reason: String| Error::NotFactorised {
            of: System::Filling,
            reason,
        };
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
            for (u, w) in self.diffusion.edges.row(v as usize) {
                if self.place[u as usize] == u32::MAX {
                    for c in 0..channels {
                        right[(i, c)] += w * known(u as usize, c);
                    }
                }
            }
        }
        if let Some(factor) = &self.factor {
            clearing_registers(|| factor.solve_in_place(&mut right));
        }
        right
    }
}
