//! Block Lanczos for the eigenpairs of `M = A^{1/2}(W − sA)⁻¹A^{1/2}` far from zero.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::prelude::*;
use faer::{Accum, Spec};

use super::shifted_factor::ShiftedFactor;
use crate::error::{Error, Result};

/// Vectors multiplied at once. Measured at 5k vertices and k = 200: 344, 400, 480 solves with 4, 8,
/// 16 vectors, and 8 the fastest in all.
const BLOCK: usize = 8;

/// Size of the space needed per hundred wanted pairs, and for a few: measured at k = 30 to 200 and 1.3k to 53k
/// vertices, where it falls short by two blocks at most. A block too many costs less than to look again.
const SIZE_PER_HUNDRED_PAIRS: usize = 160;
const LEAST_SIZE: usize = 86;

/// Blocks made orthogonal to all before them together, so that the basis, which is far larger than the nearest cache,
/// is read less often. With three, what rounding leaves along converged Ritz vectors grows too large while they wait.
const BLOCKS_TOGETHER: usize = 2;

/// Where it grows by more than this from block to block, none waits. On 26 meshes it grows by 3e2 to 4e4; with the
/// shift moved towards an eigenvalue, pairs of blocks leave `ΦᵀAΦ = I` to 3e-14 at 5e4, to 1e-11 at 5e5, and fail at 5e7.
const MOST_GROWTH: f64 = 1e5;

/// Rows of the basis multiplied at once, so that they stay in the cache: a multiple of the 48 of faer's kernel.
const ROWS_A_PIECE: usize = 96;

/// The iteration gives up at this multiple of the size expected.
const PATIENCE: usize = 3;

/// Below this fraction of a block's length before orthogonalisation, what is left of it needs a
/// second pass against the basis.
const CANCELLATION: f64 = 1e-4;

/// Eigenpairs of `M` in the order of `λ`.
pub(super) struct RitzPairs {
    /// Eigenvalues `λ = s + 1/ν`, ascending.
    pub(super) values: Vec<f64>,
    /// Unit eigenvectors, `(n, wanted)`, in the factor's ordering.
    pub(super) vectors: Mat<f64>,
    /// Linear systems solved.
    pub(super) solves: usize,
}

/// At least `count` solves with a factor, in the blocks of the iteration.
pub(super) fn bare_solves(factor: &ShiftedFactor<'_>, count: usize) {
    let n = factor.ordering().len();
    let mut workspace = factor.workspace(BLOCK);
    let mut block = starting_block(n);
    for _ in 0..count.div_ceil(BLOCK) {
        factor.solve_in_place(block.as_mut(), &mut workspace);
    }
}

/// Krylov space of `M` on the complement of one known unit eigenvector.
pub(super) struct BlockLanczos<'a> {
    factor: &'a ShiftedFactor<'a>,
    /// Diagonal of `A^{1/2}`.
    root_mass: &'a [f64],
    /// The known eigenvector, then an orthonormal basis `Q` of which `size` columns and one more
    /// block are set: `(n, 1 + capacity)`.
    basis: Mat<f64>,
    /// Lower half of the block-tridiagonal `QᵀMQ`.
    projected: Mat<f64>,
    size: usize,
    /// Columns of `basis` that are orthogonal to all before them; the others wait for [`Self::settle`].
    settled: usize,
    /// Largest entry of the diagonal blocks of `projected`, about `‖M‖`.
    norm: f64,
    /// `‖M‖` over the least pivot of the last triangle: by how much a block's overlap with converged Ritz vectors
    /// exceeds that of the block before it, at most.
    growth: f64,
    workspace: MemBuffer,
}

impl<'a> BlockLanczos<'a> {
    /// Starts from a fixed pseudo-random block, so that results do not depend on the run;
    /// `deflated` is the known eigenvector, `(n)`.
    pub(super) fn new(
        factor: &'a ShiftedFactor<'a>,
        root_mass: &'a [f64],
        deflated: ColRef<'_, f64>,
        capacity: usize,
    ) -> Self {
        let n = root_mass.len();
        let capacity = capacity.next_multiple_of(BLOCK) + 2 * BLOCK;
        let mut basis = Mat::zeros(n, 1 + capacity);
        basis.col_mut(0).copy_from(deflated);
        let (deflated, rest) = basis.split_at_col_mut(1);
        let mut start = rest.subcols_mut(0, BLOCK);
        start.copy_from(starting_block(n));
        remove(start.rb_mut(), deflated.rb());
        orthonormalise(start, deflated.rb());
        Self {
            factor,
            root_mass,
            basis,
            projected: Mat::zeros(capacity, capacity),
            size: 0,
            settled: 1 + BLOCK,
            norm: 0.0,
            growth: 0.0,
            workspace: factor.workspace(BLOCK),
        }
    }

    /// Extends the space until the `wanted` smallest `λ = s + 1/ν > 0` have
    /// `‖Mx − νx‖ ≤ bound·λ_wanted·ν²` and as many of them lie below `s` as the factor's inertia
    /// says.
    pub(super) fn run(
        mut self,
        wanted: usize,
        bound: f64,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<RitzPairs> {
        // The deflated constant is below the shift as well.
        let below = (self.factor.eigenvalues_below().saturating_sub(1)).min(wanted);
        let shift = self.factor.shift();
        let most = (PATIENCE * expected_size(wanted)).min(self.basis.nrows() - 2 * BLOCK);
        let mut check_at = expected_size(wanted);
        loop {
            if cancelled() {
                return Err(Error::Cancelled);
            }
            if self.size + 2 * BLOCK > self.projected.ncols() {
                self.grow();
            }
            self.extend();
            let m = self.size;
            if m < check_at {
                continue;
            }
            let (values, vectors) = eigen(self.projected.submatrix(0, 0, m, m))?;
            let mut order = spectrum_order(&values, shift);
            order.truncate(wanted);
            let last = self.projected.submatrix(m, m - BLOCK, BLOCK, BLOCK);
            let tails = last
                * Mat::from_fn(BLOCK, order.len(), |i, j| {
                    vectors[(m - BLOCK + i, order[j])]
                });
            let largest = order.last().map_or(0.0, |&i| shift + 1.0 / values[i]);
            let errors: Vec<f64> = order
                .iter()
                .zip(tails.col_iter())
                .map(|(&i, tail)| tail.norm_l2() / (bound * largest * values[i] * values[i]))
                .collect();
            let worst = errors.iter().copied().fold(0.0, f64::max);
            let found = order.iter().filter(|&&i| values[i] < 0.0).count();
            if worst <= 1.0 && order.len() == wanted && found == below {
                return self.pairs(&order, &values, vectors.as_ref(), tails.as_ref(), cancelled);
            }
            if m >= most {
                return Err(Error::NotConverged {
                    found: errors.iter().filter(|&&e| e <= 1.0).count(),
                    wanted,
                    residual: worst * bound * largest,
                });
            }
            // Once past its threshold the error falls about tenfold per block.
            let blocks = (1..6).find(|&d| worst <= 10f64.powi(d)).unwrap_or(6);
            check_at = m + BLOCK * blocks.unsigned_abs() as usize;
        }
    }

    /// One more block: multiply by `M`, orthogonalise, store.
    fn extend(&mut self) {
        let m = self.size;
        self.multiply_last();
        let (known, rest) = self.basis.split_at_col_mut(1 + m + BLOCK);
        let (known, mut block) = (known.rb(), rest.subcols_mut(0, BLOCK));
        // Three-term recurrence first; `settle` then only removes what rounding left.
        if m > 0 {
            matmul(
                block.rb_mut(),
                Accum::Add,
                known.subcols(1 + m - BLOCK, BLOCK),
                self.projected
                    .submatrix(m, m - BLOCK, BLOCK, BLOCK)
                    .transpose(),
                -1.0,
                Par::Seq,
            );
        }
        let diagonal = remove(block.rb_mut(), known.subcols(1 + m, BLOCK));
        for j in 0..BLOCK {
            for i in 0..BLOCK {
                self.projected[(m + i, m + j)] = f64::midpoint(diagonal[(i, j)], diagonal[(j, i)]);
            }
        }
        self.size += BLOCK;
        let waiting = 1 + self.size + BLOCK - self.settled;
        if waiting >= BLOCKS_TOGETHER * BLOCK || self.growth > MOST_GROWTH {
            self.settle();
        }
        let triangle = self.orthonormalise_next();
        self.norm = self.norm.max(diagonal.norm_max());
        self.growth = self.norm / least_pivot(&triangle);
        self.projected
            .submatrix_mut(m + BLOCK, m, BLOCK, BLOCK)
            .copy_from(&triangle);
    }

    /// Orthonormalises the block after the basis, and returns the triangle.
    fn orthonormalise_next(&mut self) -> Mat<f64> {
        let m = self.size;
        let removed = self.projected.subrows(m - BLOCK, BLOCK).norm_l2();
        let (known, rest) = self.basis.split_at_col_mut(1 + m);
        let (known, mut block) = (known.rb(), rest.subcols_mut(0, BLOCK));
        let triangle = orthonormalise(block.rb_mut(), known);
        if least_pivot(&triangle) >= CANCELLATION * removed.max(triangle.norm_l2()) {
            return triangle;
        }
        remove(block.rb_mut(), known);
        orthonormalise(block, known) * triangle
    }

    /// `M` times the basis's last block, into the columns after it.
    fn multiply_last(&mut self) {
        let (known, rest) = self.basis.split_at_col_mut(1 + self.size + BLOCK);
        let mut x = rest.subcols_mut(0, BLOCK);
        x.copy_from(known.subcols(1 + self.size, BLOCK));
        scale_rows(x.rb_mut(), self.root_mass);
        self.factor.solve_in_place(x.rb_mut(), &mut self.workspace);
        scale_rows(x, self.root_mass);
    }

    /// Makes the columns that have waited orthogonal to all before them. As long as they were so to `√ε`, the
    /// projection is right to `ε`.
    ///
    /// Simon, "The Lanczos algorithm with partial reorthogonalization", 1984.
    fn settle(&mut self) {
        let end = 1 + self.size + BLOCK;
        let (known, rest) = self.basis.split_at_col_mut(self.settled);
        remove(rest.subcols_mut(0, end - self.settled), known.rb());
        self.settled = end;
    }

    /// Ritz vectors with one more step of `M` applied, `QS + Q₊BS₊/μ = MQS/μ`: the step costs
    /// nothing and damps what lies beyond the wanted spectrum.
    ///
    /// Ericsson, Ruhe, "The spectral transformation Lanczos method", 1980, section 3.
    fn pairs(
        mut self,
        order: &[usize],
        values: &[f64],
        vectors: MatRef<'_, f64>,
        tails: MatRef<'_, f64>,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<RitzPairs> {
        let (n, m) = (self.basis.nrows(), self.size);
        let coefficients = Mat::from_fn(m + BLOCK, order.len(), |i, j| {
            if i < m {
                vectors[(i, order[j])]
            } else {
                tails[(i - m, j)] / values[order[j]]
            }
        });
        self.settle();
        // Row by row, they take the place of the basis.
        let mut piece = Mat::zeros(ROWS_A_PIECE, order.len());
        for first in (0..n).step_by(ROWS_A_PIECE) {
            if cancelled() {
                return Err(Error::Cancelled);
            }
            let rows = ROWS_A_PIECE.min(n - first);
            let mut piece = piece.subrows_mut(0, rows);
            matmul(
                piece.rb_mut(),
                Accum::Replace,
                self.basis.submatrix(first, 1, rows, m + BLOCK),
                &coefficients,
                1.0,
                Par::Seq,
            );
            self.basis
                .submatrix_mut(first, 0, rows, order.len())
                .copy_from(piece);
        }
        self.basis.truncate(n, order.len());
        Ok(RitzPairs {
            values: order
                .iter()
                .map(|&i| self.factor.shift() + 1.0 / values[i])
                .collect(),
            vectors: self.basis,
            solves: m,
        })
    }

    fn grow(&mut self) {
        let (n, old) = (self.basis.nrows(), self.projected.ncols());
        let new = (old + old / 4).next_multiple_of(BLOCK);
        self.basis.resize_with(n, 1 + new, |_, _| 0.0);
        self.projected.resize_with(new, new, |_, _| 0.0);
    }
}

/// Ritz values in the order of their `λ = shift + 1/ν`, those with `λ > 0` only.
fn spectrum_order(values: &[f64], shift: f64) -> Vec<usize> {
    let negative = values.partition_point(|&nu| nu < 0.0);
    // λ falls as ν rises within each sign: negative ν first, from just below zero outward. What
    // lies between −1/shift and zero belongs to no eigenvalue.
    (0..negative)
        .rev()
        .filter(|&i| shift + 1.0 / values[i] > 0.0)
        .chain((negative..values.len()).rev())
        .collect()
}

/// Size of the space at which convergence is first looked at.
pub(super) fn expected_size(wanted: usize) -> usize {
    (wanted * SIZE_PER_HUNDRED_PAIRS / 100 + LEAST_SIZE).next_multiple_of(BLOCK)
}

/// `X ← (I − QQᵀ)X`; returns `XᵀQ`.
fn remove(mut x: MatMut<'_, f64>, q: MatRef<'_, f64>) -> Mat<f64> {
    let mut products = Mat::zeros(x.ncols(), q.ncols());
    matmul(
        &mut products,
        Accum::Replace,
        x.rb().transpose(),
        q,
        1.0,
        Par::Seq,
    );
    for first in (0..q.nrows()).step_by(ROWS_A_PIECE) {
        let rows = ROWS_A_PIECE.min(q.nrows() - first);
        matmul(
            x.rb_mut().subrows_mut(first, rows),
            Accum::Add,
            q.subrows(first, rows),
            products.transpose(),
            -1.0,
            Par::Seq,
        );
    }
    products
}

/// `X = QR`, `Q` orthogonal to what is `known`: overwrites `X` with `Q`, returns `R`.
fn orthonormalise(mut x: MatMut<'_, f64>, known: MatRef<'_, f64>) -> Mat<f64> {
    if let Some(first) = cholesky_qr(x.rb_mut())
        && let Some(second) = cholesky_qr(x.rb_mut())
    {
        return second * first;
    }
    // Columns nearly dependent: Householder reflections complete them to an orthonormal set,
    // which has to be made orthogonal to the basis again.
    let qr = x.qr();
    let triangle = qr.thin_R().to_owned();
    x.copy_from(qr.compute_thin_Q());
    remove(x.rb_mut(), known);
    let again = x.qr();
    x.copy_from(again.compute_thin_Q());
    again.thin_R().to_owned() * triangle
}

/// Cholesky of `XᵀX`: overwrites `X` with an orthonormal basis and returns the upper triangle, or
/// leaves `X` alone when its columns are too nearly dependent.
fn cholesky_qr(x: MatMut<'_, f64>) -> Option<Mat<f64>> {
    let b = x.ncols();
    let mut gram = x.rb().transpose() * x.rb();
    let largest = (0..b).map(|i| gram[(i, i)]).fold(0.0, f64::max);
    cholesky_in_place(
        gram.as_mut(),
        faer::linalg::cholesky::llt::factor::LltRegularization::default(),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(cholesky_in_place_scratch::<f64>(
            b,
            Par::Seq,
            Spec::default(),
        ))),
        Spec::default(),
    )
    .ok()?;
    let least = (0..b).map(|i| gram[(i, i)]).fold(f64::MAX, f64::min);
    // The square of the condition number must stay well inside double precision.
    if least * least <= 1e-12 * largest {
        return None;
    }
    solve_lower_triangular_in_place(gram.as_ref(), x.transpose_mut(), Par::Seq);
    Some(Mat::from_fn(
        b,
        b,
        |i, j| {
            if i <= j { gram[(j, i)] } else { 0.0 }
        },
    ))
}

/// Eigenvalues, ascending, and eigenvectors of the lower half.
pub(super) fn eigen(matrix: MatRef<'_, f64>) -> Result<(Vec<f64>, Mat<f64>)> {
    let m = matrix.nrows();
    let mut values = vec![0.0; m];
    let mut vectors = Mat::zeros(m, m);
    let scratch =
        self_adjoint_evd_scratch::<f64>(m, ComputeEigenvectors::Yes, Par::Seq, Spec::default());
    self_adjoint_evd(
        matrix,
        faer::diag::DiagMut::from_slice_mut(&mut values),
        Some(vectors.as_mut()),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Spec::default(),
    )
    .map_err(|_| Error::NotConverged {
        found: 0,
        wanted: m,
        residual: f64::NAN,
    })?;
    Ok((values, vectors))
}

fn scale_rows(mut x: MatMut<'_, f64>, factors: &[f64]) {
    for column in x.rb_mut().col_iter_mut() {
        if let Some(column) = column.try_as_col_major_mut() {
            for (entry, factor) in column.as_slice_mut().iter_mut().zip(factors) {
                *entry *= factor;
            }
        }
    }
}

fn least_pivot(triangle: &Mat<f64>) -> f64 {
    (0..triangle.ncols())
        .map(|i| triangle[(i, i)].abs())
        .fold(f64::MAX, f64::min)
}

fn starting_block(n: usize) -> Mat<f64> {
    Mat::from_fn(n, BLOCK, |i, j| noise((i * BLOCK + j) as u64))
}

/// Uniform in [−½, ½): the finaliser of splitmix64 (Steele, Lea, Flood 2014).
fn noise(index: u64) -> f64 {
    let mut z = index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    (z >> 11) as f64 / (1u64 << 53) as f64 - 0.5
}
