//! Where the search starts: sign patterns of the first eigenfunctions, and of the coordinates of a scaling.

use faer::{Mat, MatRef, Side};
use rayon::prelude::*;

use super::candidate::{Candidate, SampledPair};
use super::sampled::Sampled;
use crate::algebra::closest::closest;
use crate::algebra::dense;
use crate::matching::problem::point_map::PointMaps;
use crate::matching::search::settings::SEEDS;
use crate::mesh::numbering::Sample;
use crate::shape::Shape;

impl SampledPair<'_> {
    /// The best sign patterns as candidates.
    pub(super) fn sign_seeds(&self, size: usize) -> Vec<Candidate> {
        let mut seeds = sign_patterns(
            self.pair.source.distance_operator.as_ref(),
            self.pair.target.distance_operator.as_ref(),
            size,
            true,
        );
        seeds.truncate(SEEDS.sign_seeds);
        seeds.into_par_iter().map(|m| self.judged(m)).collect()
    }

    /// All sign patterns of the main coordinates of a classical multidimensional scaling in the
    /// spectral domain: dropping the constant from α centres it twice.
    pub(super) fn scaling_seeds(&self, size: usize) -> Vec<Candidate> {
        let coordinates = |shape: &Shape, side: &Sampled| {
            let k = SEEDS.scaling_functions.min(shape.distance_operator.nrows());
            let block = shape.distance_operator.get(1..k, 1..k);
            let decomposition =
                dense::clearing_registers(|| block.self_adjoint_eigen(Side::Lower)).ok()?;
            let dims = SEEDS.scaling_dims.min(k - 1);
            let scaled = Mat::from_fn(k - 1, dims, |i, j| {
                // Eigenvalues ascend, so the most negative ones come first.
                decomposition.U()[(i, j)] * (-decomposition.S()[j]).max(0.0).sqrt()
            });
            let at_samples = dense::product(side.basis.get(.., 1..k), scaled.as_ref());
            Some(dense::in_single(at_samples.as_ref()))
        };
        let (Some(target), Some(source)) = (
            coordinates(self.pair.target, &self.side_target),
            coordinates(self.pair.source, &self.side_source),
        ) else {
            return Vec::new();
        };
        let dims = target.ncols().min(source.ncols());
        (0..1usize << dims)
            .into_par_iter()
            .map(|bits| {
                let turned = Mat::from_fn(source.nrows(), dims, |i, j| {
                    if bits >> j & 1 == 1 {
                        -source[(i, j)]
                    } else {
                        source[(i, j)]
                    }
                });
                let target = target.get(.., ..dims);
                let images = PointMaps {
                    target_to_source: Sample::each(closest(
                        target.get(..self.side_target.asking, ..),
                        turned.as_ref(),
                        None,
                        1.0,
                    )),
                    source_to_target: Sample::each(closest(
                        turned.get(..self.side_source.asking, ..),
                        target,
                        None,
                        1.0,
                    )),
                };
                Candidate {
                    images,
                    matrix: Mat::zeros(size, size),
                    energy: f64::INFINITY,
                    orientation: 0.0,
                    rank: f64::INFINITY,
                }
            })
            .collect()
    }
}

/// Signed orders of the first eigenfunctions by how well they take one distance operator to the
/// other, best first: all signs, and with `exchanges` also two neighbours exchanged.
fn sign_patterns(
    source: MatRef<'_, f64>,
    target: MatRef<'_, f64>,
    size: usize,
    exchanges: bool,
) -> Vec<Mat<f64>> {
    let mut patterns = Vec::new();
    for exchange in 0..if exchanges { size - 1 } else { 1 } {
        let mut order: Vec<usize> = (0..size).collect();
        if exchange > 0 {
            order.swap(exchange, exchange + 1);
        }
        for bits in 0..1usize << (size - 1) {
            let sign = |i: usize| {
                if i > 0 && bits >> (i - 1) & 1 == 1 {
                    -1.0
                } else {
                    1.0
                }
            };
            let mut cost = 0.0;
            for i in 0..size {
                for j in 0..size {
                    let carried = sign(i) * sign(j) * target[(order[i], order[j])];
                    cost += (carried - source[(i, j)]).powi(2);
                }
            }
            let matrix = Mat::from_fn(size, size, |i, j| if order[i] == j { sign(i) } else { 0.0 });
            patterns.push((cost, matrix));
        }
    }
    patterns.sort_by(|a, b| a.0.total_cmp(&b.0));
    patterns.into_iter().map(|(_, matrix)| matrix).collect()
}

/// The sign pattern of the first eigenfunctions that fits two distance operators best.
#[must_use]
pub fn best_signs(source: MatRef<'_, f64>, target: MatRef<'_, f64>) -> Mat<f64> {
    let size = SEEDS.seed_size.min(target.nrows());
    sign_patterns(source, target, size, false).swap_remove(0)
}
