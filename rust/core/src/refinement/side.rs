//! One shape's part in a refinement: which vertices ask and where their images lie, the embedding of the
//! surface, and weighted rows for the fits.

use std::f64::consts::PI;

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;

use crate::dense::{self, Rows};
use crate::hints::Which;
use crate::mesh::{self, Adjacency};
use crate::pair::{Pair, Part};
use crate::refinement::propagation::{COMPARED, Images};
use crate::shape::Shape;
use crate::similarity::Similarity;
use crate::vector::Point;

/// Weights in the embedding beside the spectrum; insensitive within a factor of three.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weights {
    pub positions: f64,
    pub normals: f64,
    pub looks: f32,
}

/// Vertices whose rows are written at once, by one thread.
const EMBEDDED_AT_ONCE: usize = 512;

/// One shape's part in a refinement.
#[derive(Debug, Clone)]
pub struct Side<'a> {
    /// The shape whose side this is.
    pub shape: &'a Shape,
    /// Vertices that ask.
    pub asking: Vec<u32>,
    /// Weight of each in the fits; they sum to this side's share.
    pub(super) weights: Vec<f64>,
    /// Which asking vertices are neighbours (none when only some ask).
    pub(super) neighbours: Adjacency,
    /// Images of the asking vertices on the other shape.
    pub images: Images,
    /// `ΦᵀA` V, `(K, 3)`.
    coordinates: Mat<f64>,
    /// Low-passed surface, before any deformation.
    pub smoothed: Mat<f64>,
    /// Number of eigenfunctions of which it is made.
    low_passed_to: usize,
    /// What a vertex looks like and how near it is to each landmark, `(n, c)`: the same at each step.
    fixed: Mat<f32>,
    /// Whether positions and normals take part in the embedding.
    extrinsic: bool,
    /// Where landmarks ask, as (number of the asking vertex, image).
    known: Vec<(u32, u32)>,
    /// √w times this shape's first eigenfunctions at the asking vertices, as many as in the last step.
    pub(super) own: Rows,
    /// Embedding of every vertex in the last step.
    pub rows: Rows,
}

impl<'a> Side<'a> {
    pub(super) fn new(pair: &Pair<'a>, which: Which, drawn: Option<usize>) -> Self {
        let (shape, share) = (pair.shape(which), pair.shares.of(which));
        let mesh = &shape.mesh;
        let (asking, neighbours, weights) = if let Some(count) = drawn {
            let asking = shape.drawn_vertices(count);
            let none = Adjacency::empty(asking.len());
            let weights = vec![share / asking.len() as f64; asking.len()];
            (asking, none, weights)
        } else {
            let all = (0..mesh.vertices.len() as u32).collect();
            let weights = shape.mass.iter().map(|a| share * a).collect();
            (all, shape.neighbours.clone(), weights)
        };
        let weighted = Mat::from_fn(mesh.vertices.len(), 3, |i, c| {
            shape.mass[i] * mesh.vertices[i][c]
        });
        let known: Vec<(u32, u32)> = pair
            .hints
            .landmarks
            .iter()
            .map(|&(s, t)| {
                if which == Which::Target {
                    (t, s)
                } else {
                    (s, t)
                }
            })
            .filter_map(|(own, image)| {
                let number = asking.iter().position(|&v| v == own)?;
                Some((number as u32, image))
            })
            .collect();
        let detail = shape.descriptors.detail.as_ref();
        let looks = if pair.uses(Part::Descriptors) {
            1.0
        } else {
            0.0
        };
        let held = pair.hints.in_refinement(which);
        let fixed = Mat::from_fn(
            mesh.vertices.len(),
            detail.ncols() + held.ncols(),
            |i, c| {
                if c < detail.ncols() {
                    looks * detail[(i, c)]
                } else {
                    held[(i, c - detail.ncols())]
                }
            },
        );
        Self {
            coordinates: dense::product(shape.basis.functions.transpose(), weighted.as_ref()),
            images: Images::unknown(asking.len()),
            asking,
            weights,
            neighbours,
            fixed,
            extrinsic: pair.uses(Part::Extrinsic),
            known,
            smoothed: Mat::zeros(0, 3),
            low_passed_to: 0,
            own: Rows::zeros(0, 1),
            rows: Rows::zeros(0, 1),
            shape,
        }
    }

    pub(super) fn basis(&self, k: usize) -> MatRef<'a, f64> {
        self.shape.functions(k)
    }

    /// How many eigenfunctions there are.
    pub(super) fn most(&self) -> usize {
        self.shape.basis.values.len()
    }

    pub(super) fn low_pass(&mut self, k: usize) {
        let k = k.min(self.most());
        if self.low_passed_to != k {
            self.smoothed = dense::product(self.basis(k), self.coordinates.get(..k, ..));
            self.low_passed_to = k;
        }
    }

    /// Turns, scales and moves the surface that is low-passed.
    pub(super) fn place(&mut self, placing: &Similarity) {
        let turn = Mat::from_fn(3, 3, |i, j| placing.scale * placing.turn[i][j]);
        let centre = placing.apply([0.0; 3]);
        let mut coordinates = dense::product(self.coordinates.as_ref(), turn.transpose());
        // A constant is √area = 1 times the first eigenfunction.
        for i in 0..3 {
            coordinates[(0, i)] += centre[i];
        }
        self.coordinates = coordinates;
        self.low_passed_to = 0;
    }

    /// Puts the images of landmarks where they are given.
    pub(super) fn answer_landmarks(&mut self) {
        for &(number, image) in &self.known {
            self.images.vertex[number as usize] = image;
        }
    }

    /// √w times rows of `matrix` at the given vertices, for sums weighted by w.
    pub(super) fn weighted_rows(&self, matrix: MatRef<'_, f64>, vertices: &[u32]) -> Mat<f64> {
        Mat::from_fn(vertices.len(), matrix.ncols(), |i, j| {
            self.weights[i].sqrt() * matrix[(vertices[i] as usize, j)]
        })
    }

    /// Prepares the fits with k eigenfunctions.
    pub(super) fn weigh(&mut self, k: usize) {
        if self.own.dims != k {
            self.own = self.own_rows(k);
        }
    }

    /// √w times k eigenfunctions at the asking vertices.
    pub(super) fn own_rows(&self, k: usize) -> Rows {
        let functions = &self.shape.rows;
        functions.gather_weighted(&self.asking, &self.weights, k)
    }

    /// √w times k eigenfunctions of the other shape at the images.
    pub(super) fn at_images(&self, other: &Side<'_>, k: usize) -> Rows {
        let functions = &other.shape.rows;
        functions.gather_weighted(&self.images.vertex, &self.weights, k)
    }

    /// Gram matrix of some [own rows](Self::own_rows).
    pub(super) fn gram_of(&self, own: &Rows) -> Mat<f64> {
        if self.asking.len() < self.shape.mesh.vertices.len() {
            return dense::gram(own);
        }
        // All ask, weighted by their areas: orthonormal.
        let (k, share) = (own.dims, self.weights.iter().sum::<f64>());
        Mat::from_fn(k, k, |i, j| if i == j { share } else { 0.0 })
    }

    /// \[surface, weighted normals, looks, landmarks, Φ or Φ·`matrix` / (√π k), zeros\]: in the surface and the
    /// spectrum a unit is about a unit of length on the surface, in the latter because Σλ ≈ 2πk² at unit area.
    /// Each eigenfunction is scaled by the square of what is shared of it: the others say nothing. Places come
    /// first since they tell most points apart, before the rest of a row is read.
    pub(super) fn embed(
        &mut self,
        matrix: Option<MatRef<'_, f64>>,
        shared: &[f64],
        surface: MatRef<'_, f64>,
        weights: Weights,
    ) {
        let (n, k) = (surface.nrows(), shared.len());
        let scale = 1.0 / (PI.sqrt() * k as f64);
        let scales: Vec<f32> = shared.iter().map(|r| (scale * r * r) as f32).collect();
        let positions: Vec<Point> = (0..n).map(|i| [0, 1, 2].map(|c| surface[(i, c)])).collect();
        let normals = mesh::normals_of(&positions, &self.shape.mesh.faces);
        let sign = weights.normals * self.shape.volume_sign;
        let looks = self.shape.descriptors.detail.ncols();
        let before = 6 + self.fixed.ncols();
        let spectrum = before..before + k;
        let functions = &self.shape.rows;
        let transposed = matrix.map(|matrix| {
            Mat::from_fn(k, matrix.nrows(), |i, j| scales[i] * matrix[(j, i)] as f32)
        });
        let dims = spectrum.end.next_multiple_of(COMPARED);
        self.rows.resize(n, dims);
        let shown = if self.extrinsic { 1.0 } else { 0.0 };
        let fixed = &self.fixed;
        let write = |block: usize, rows: &mut [f32]| {
            let first = block * EMBEDDED_AT_ONCE;
            if let Some(transposed) = &transposed {
                let count = rows.len() / dims;
                let of_block =
                    functions
                        .as_columns()
                        .submatrix(0, first, transposed.ncols(), count);
                matmul(
                    MatMut::from_column_major_slice_mut(rows, dims, count).subrows_mut(before, k),
                    Accum::Replace,
                    transposed.as_ref(),
                    of_block,
                    1.0,
                    Par::Seq,
                );
            }
            for (i, row) in (first..).zip(rows.chunks_exact_mut(dims)) {
                for c in 0..3 {
                    row[c] = (shown * weights.positions * positions[i][c]) as f32;
                    row[3 + c] = (shown * sign * normals[i][c]) as f32;
                }
                for (c, out) in row[6..before].iter_mut().enumerate() {
                    let weight = if c < looks { weights.looks } else { 1.0 };
                    *out = weight * fixed[(i, c)];
                }
                if transposed.is_none() {
                    let row = row[spectrum.clone()].iter_mut();
                    for ((out, value), scale) in row.zip(functions.row(i)).zip(&scales) {
                        *out = scale * value;
                    }
                }
                row[spectrum.end..].fill(0.0);
            }
        };
        self.rows
            .data
            .par_chunks_mut(EMBEDDED_AT_ONCE * dims)
            .enumerate()
            .for_each(|(block, rows)| write(block, rows));
    }
}
