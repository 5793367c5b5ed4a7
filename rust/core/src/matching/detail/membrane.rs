//! Displacements that follow what draws single vertices and change little from neighbour to neighbour.
//!
//! u minimises Σ uᵢᵀMᵢuᵢ − 2uᵢᵀbᵢ + Σ ½kᵢⱼ‖uᵢ − uⱼ‖² over all neighbours i, j: a membrane. The equations are solved by
//! conjugate gradients, preconditioned by the inverse of their blocks of three.

use rayon::prelude::*;

use crate::algebra::conjugate_gradients::{self, Until};
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::mesh::edge_weights::EdgeWeights;
use crate::watch::progress::Check;

/// Displacements are sought again in every round; lids come to lie a tenth worse with 1e-2.
const UNTIL: Until = Until {
    residual: 3e-3,
    steps: 300,
};
/// Rows worked out at once.
const ROWS: usize = 512;

/// A symmetric matrix of three rows: its upper triangle, row by row.
pub(super) type Symmetric = [f64; 6];

/// Mᵢ and kᵢⱼ.
pub(super) struct Membrane<'a> {
    edges: &'a EdgeWeights,
    /// kᵢⱼ of each entry of the edges.
    stiffness: Vec<f64>,
    /// M + Σ k of each vertex, and its inverse.
    blocks: Vec<(Symmetric, Symmetric)>,
}

impl<'a> Membrane<'a> {
    /// Of a surface with kᵢⱼ = wᵢⱼ·½(ℓᵢ² + ℓⱼ²), w its cotangent weights: where Mᵢ is the area around a vertex, ℓ is the
    /// length over which displacements are averaged.
    pub(super) fn new(edges: &'a EdgeWeights, lengths: &[f64], drawn: &[Symmetric]) -> Self {
        let rows: Vec<(Vec<f64>, (Symmetric, Symmetric))> = (0..drawn.len())
            .into_par_iter()
            .map(|i| {
                let square = |j: usize| lengths[j] * lengths[j];
                let row: Vec<f64> = edges
                    .row(i)
                    .map(|(j, w)| w * f64::midpoint(square(i), square(j as usize)))
                    .collect();
                let held: f64 = row.iter().sum();
                let mut block = drawn[i];
                for diagonal in [0, 3, 5] {
                    block[diagonal] += held;
                }
                (row, (block, inverse(&block)))
            })
            .collect();
        let (stiffness, blocks): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
        Self {
            edges,
            stiffness: stiffness.concat(),
            blocks,
        }
    }

    /// The displacements, sought from `start`.
    pub(super) fn solved(
        &self,
        right: &[Point],
        start: Vec<Point>,
        check: Check<'_>,
    ) -> Result<Vec<Point>> {
        let apply = |u: &[Point]| self.applied(u);
        let precondition = |u: &[Point]| self.preconditioned(u);
        conjugate_gradients::solved(apply, precondition, right, start, UNTIL, check)
    }

    fn applied(&self, u: &[Point]) -> Vec<Point> {
        let starts = &self.edges.neighbours.starts;
        let entries = &self.edges.neighbours.entries;
        (0..u.len())
            .into_par_iter()
            .with_min_len(ROWS)
            .map(|i| {
                let row = starts[i] as usize..starts[i + 1] as usize;
                let mut sum = times(&self.blocks[i].0, u[i]);
                for (&j, k) in entries[row.clone()].iter().zip(&self.stiffness[row]) {
                    sum = vector::sub(sum, vector::scaled(u[j as usize], *k));
                }
                sum
            })
            .collect()
    }

    fn preconditioned(&self, u: &[Point]) -> Vec<Point> {
        let blocks = self.blocks.iter();
        u.iter()
            .zip(blocks)
            .map(|(&u, (_, inverse))| times(inverse, u))
            .collect()
    }
}

/// Mu.
pub(super) fn times(&[xx, xy, xz, yy, yz, zz]: &Symmetric, [x, y, z]: Point) -> Point {
    [
        xx * x + xy * y + xz * z,
        xy * x + yy * y + yz * z,
        xz * x + yz * y + zz * z,
    ]
}

/// w(τI + (1 − τ)nnᵀ): drawn along n, and τ times as strongly across.
pub(super) fn along([x, y, z]: Point, across: f64, weight: f64) -> Symmetric {
    let (w, a) = (weight * (1.0 - across), weight * across);
    [
        a + w * x * x,
        w * x * y,
        w * x * z,
        a + w * y * y,
        w * y * z,
        a + w * z * z,
    ]
}

/// M⁻¹ of a positive definite matrix.
fn inverse(&[xx, xy, xz, yy, yz, zz]: &Symmetric) -> Symmetric {
    let cofactors = [
        yy * zz - yz * yz,
        xz * yz - xy * zz,
        xy * yz - xz * yy,
        xx * zz - xz * xz,
        xy * xz - xx * yz,
        xx * yy - xy * xy,
    ];
    let determinant = xx * cofactors[0] + xy * cofactors[1] + xz * cofactors[2];
    cofactors.map(|c| c / determinant)
}
