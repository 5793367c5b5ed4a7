//! Block Lanczos for the eigenpairs of `M = A^{1/2}(W − sA)⁻¹A^{1/2}` far from zero.

use std::mem::swap;
use std::ops::Range;

use faer::Accum;
use faer::prelude::*;

use super::ROWS_A_PIECE;
use super::block::{BLOCK, Block};
use super::noise::noise;
use super::orthogonal::{eigen, least_pivot, orthonormalise, remove};
use super::shifted_factor::{Pattern, ShiftedFactor};
use super::slice::{Slice, gaps};
use crate::algebra::dense::multiply;
use crate::error::{Error, Result};
use crate::spectrum::settings::LANCZOS;

/// Blocks made orthogonal to all before them together, so that the basis, which is far larger than the nearest cache,
/// is read less often. With three, what rounding leaves along converged Ritz vectors grows too large while they wait.
const BLOCKS_TOGETHER: usize = 2;

/// Eigenpairs of `M` in the order of `λ`.
pub(super) struct RitzPairs {
    /// Eigenvalues `λ = s + 1/ν`, ascending.
    pub(super) values: Vec<f64>,
    /// Unit eigenvectors, `(n, wanted)`, in the factor's ordering.
    pub(super) vectors: Mat<f64>,
    /// Whether a factor beyond the last one counts as many, if the slice is the last.
    pub(super) none_missed: bool,
    /// Linear systems solved.
    pub(super) solves: usize,
}

/// At least `count` solves with a factor of `n` rows, in the blocks of the iteration.
pub(super) fn bare_solves(factor: &ShiftedFactor<'_>, n: usize, count: usize) {
    let mut block = vec![[1.0; BLOCK]; n];
    for _ in 0..count.div_ceil(BLOCK) {
        // Numbers near the least take longer.
        block.fill([1.0; BLOCK]);
        factor.solve(&mut block);
    }
}

/// Krylov space of `M` on the complement of one known unit eigenvector.
pub(super) struct BlockLanczos<'a> {
    factor: &'a ShiftedFactor<'a>,
    /// Diagonal of `A^{1/2}`.
    root_mass: &'a [f64],
    /// The known eigenvector, then an orthonormal basis `Q` of `size` columns and one more block; the next is added
    /// where it is used, so that memory is touched once.
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
    /// The last block of the basis, that before it, and the one to come.
    last: Block,
    previous: Block,
    next: Block,
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
        let mut basis = Mat::with_capacity(n, 1 + capacity);
        basis.resize_with(n, 1 + BLOCK, |_, _| 0.0);
        basis.col_mut(0).copy_from(deflated);
        let nothing = Block::filled(n, 0.0);
        let mut space = Self {
            factor,
            root_mass,
            basis,
            projected: Mat::zeros(capacity, capacity),
            size: 0,
            settled: 1 + BLOCK,
            norm: 0.0,
            growth: 0.0,
            last: nothing.clone(),
            previous: nothing.clone(),
            next: nothing,
        };
        space.next.copy_from(starting_block(n).as_ref());
        space.start();
        for _ in 0..LANCZOS.multiplied_first {
            space.multiply();
            space.start();
        }
        space
    }

    /// Makes the block to come the first of the space.
    fn start(&mut self) {
        let (deflated, mut start) = self.basis.split_at_col_mut(1);
        self.next.copy_to(start.rb_mut());
        remove(start.rb_mut(), deflated.rb());
        orthonormalise(start.rb_mut(), deflated.rb());
        self.last.copy_from(start.rb());
    }

    /// The block to come is `M` times the last.
    fn multiply(&mut self) {
        self.next.set_scaled(self.root_mass, &self.last);
        self.next.solve(self.factor.factor());
        self.next.scale(self.root_mass);
    }

    /// Extends the space until the `λ = s + 1/ν` of a slice that `s` lies in have `‖Mx − νx‖ ≤ bound·λ_last·ν²`, and
    /// as many lie below `s` as the inertia of its factor says; a space for the whole until as many are in it, too.
    pub(super) fn run(
        mut self,
        slice: &Slice,
        bound: f64,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<RitzPairs> {
        let below = self.factor.pairs_below().min(slice.end);
        let shift = self.factor.shift();
        let size = slice.expected_size(below).next_multiple_of(BLOCK);
        let most = (LANCZOS.patience * size).min(self.basis.nrows() - 2 * BLOCK);
        let mut check_at = size;
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
            let found = spectrum_order(&values, shift);
            let lambda = |&i: &usize| shift + 1.0 / values[i];
            let spectrum: Vec<f64> = found.iter().map(lambda).collect();
            let found_below = found.iter().filter(|&&i| values[i] < 0.0).count();
            // Those below the shift are counted from it downwards.
            let number = |place: usize| (found_below + place).checked_sub(below);
            let ends = number(slice.first).zip(number(slice.end));
            let places = ends.and_then(|(first, end)| slice.within(&spectrum, [first, end]));
            let Range { start: first, end } = places.unwrap_or_default();
            let order = &found[first..end];
            let last = self.projected.submatrix(m, m - BLOCK, BLOCK, BLOCK);
            let tails = last
                * Mat::from_fn(BLOCK, order.len(), |i, j| {
                    vectors[(m - BLOCK + i, order[j])]
                });
            let largest = order.last().map_or(0.0, lambda);
            let errors: Vec<f64> = order
                .iter()
                .zip(tails.col_iter())
                .map(|(&i, tail)| tail.norm_l2() / (bound * largest * values[i] * values[i]))
                .collect();
            let worst = errors.iter().copied().fold(0.0, f64::max);
            let pattern = self.factor.pattern();
            let all_counted =
                || slice.is_followed || counts_as_many(&spectrum, end, slice.end, pattern);
            let starts_right = slice.first > 0 || first == 0;
            if end > first && worst <= 1.0 && starts_right && (slice.first > 0 || all_counted()) {
                let (vectors, tails) = (vectors.as_ref(), tails.as_ref());
                // What an upper slice misses is not looked for in its space, which need not outlast the answer.
                let (pairs, none_missed) = rayon::join(
                    || self.pairs(order, &values, vectors, tails, cancelled),
                    || slice.first == 0 || all_counted(),
                );
                let (values, vectors) = pairs?;
                return Ok(RitzPairs {
                    values,
                    vectors,
                    none_missed,
                    solves: BLOCK * LANCZOS.multiplied_first + m,
                });
            }
            if m >= most {
                return Err(Error::NotConverged {
                    found: errors.iter().filter(|&&e| e <= 1.0).count(),
                    wanted: slice.count(),
                    residual: worst * bound * largest,
                });
            }
            // Past its threshold the error falls about tenfold with two blocks. A copy that was missed grows from rounding.
            let blocks = match worst {
                ..=5.0 => 2,
                ..=1e2 => 4,
                ..=1e4 => 6,
                _ => 8,
            };
            check_at = m + BLOCK * blocks;
        }
    }

    /// One more block: multiply by `M`, orthogonalise, store.
    fn extend(&mut self) {
        let m = self.size;
        self.multiply();
        // Three-term recurrence first; `settle` then only removes what rounding left.
        if m > 0 {
            let above = self.projected.submatrix(m, m - BLOCK, BLOCK, BLOCK);
            let above = [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| above[(j, i)]));
            self.next.subtract(&self.previous, &above);
        }
        let diagonal = self.last.products(&self.next);
        self.next.subtract(&self.last, &diagonal);
        for (i, row) in diagonal.iter().enumerate() {
            for (j, product) in row.iter().enumerate() {
                self.projected[(m + i, m + j)] = f64::midpoint(*product, diagonal[j][i]);
                self.norm = self.norm.max(product.abs());
            }
        }
        self.size += BLOCK;
        let (n, first) = (self.basis.nrows(), self.basis.ncols());
        self.basis.resize_with(n, first + BLOCK, |_, _| 0.0);
        let waiting = self.basis.ncols() - self.settled;
        if waiting >= BLOCKS_TOGETHER * BLOCK || self.growth > LANCZOS.most_growth {
            self.next.copy_to(self.basis.subcols_mut(first, BLOCK));
            self.settle();
            self.last
                .copy_from(self.basis.subcols(first - BLOCK, BLOCK));
            self.next.copy_from(self.basis.subcols(first, BLOCK));
        }
        let triangle = self.orthonormalise_next();
        self.growth = self.norm / least_pivot(&triangle);
        self.projected
            .submatrix_mut(m + BLOCK, m, BLOCK, BLOCK)
            .copy_from(&triangle);
        swap(&mut self.previous, &mut self.last);
        swap(&mut self.last, &mut self.next);
    }

    /// Orthonormalises the block to come, stores it after the basis, and returns the triangle.
    fn orthonormalise_next(&mut self) -> Mat<f64> {
        let m = self.size;
        let removed = self.projected.subrows(m - BLOCK, BLOCK).norm_l2();
        let is_sound = |triangle: &Mat<f64>| {
            least_pivot(triangle) >= LANCZOS.cancellation * removed.max(triangle.norm_l2())
        };
        let triangle = self.next.orthonormalise();
        let triangle = triangle.map(|rows| Mat::from_fn(BLOCK, BLOCK, |i, j| rows[i][j]));
        let (known, mut block) = self.basis.split_at_col_mut(1 + m);
        let known = known.rb();
        self.next.copy_to(block.rb_mut());
        let mut triangle = match triangle {
            Some(triangle) if is_sound(&triangle) => return triangle,
            Some(triangle) => triangle,
            None => orthonormalise(block.rb_mut(), known),
        };
        if !is_sound(&triangle) {
            remove(block.rb_mut(), known);
            triangle = orthonormalise(block.rb_mut(), known) * triangle;
        }
        self.next.copy_from(block.rb());
        triangle
    }

    /// Makes the columns that have waited orthogonal to all before them. As long as they were so to `√ε`, the
    /// projection is right to `ε`.
    ///
    /// Simon, "The Lanczos algorithm with partial reorthogonalization", 1984.
    fn settle(&mut self) {
        let (known, waiting) = self.basis.split_at_col_mut(self.settled);
        remove(waiting, known.rb());
        self.settled = self.basis.ncols();
    }

    /// Eigenvalues, and Ritz vectors with one more step of `M` applied, `QS + Q₊BS₊/μ = MQS/μ`: the step costs
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
    ) -> Result<(Vec<f64>, Mat<f64>)> {
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
            multiply(
                piece.rb_mut(),
                Accum::Replace,
                self.basis.submatrix(first, 1, rows, m + BLOCK),
                coefficients.as_ref(),
                1.0,
            );
            self.basis
                .submatrix_mut(first, 0, rows, order.len())
                .copy_from(piece);
        }
        self.basis.truncate(n, order.len());
        let lambda = |&i: &usize| self.factor.shift() + 1.0 / values[i];
        Ok((order.iter().map(lambda).collect(), self.basis))
    }

    fn grow(&mut self) {
        let (n, old) = (self.basis.nrows(), self.projected.ncols());
        let new = (old + old / 4).next_multiple_of(BLOCK);
        self.basis.reserve(n, 1 + new);
        self.projected.resize_with(new, new, |_, _| 0.0);
    }
}

/// Whether a factor beyond place `end` of a spectrum, in a gap, counts so many pairs up to that place.
fn counts_as_many(spectrum: &[f64], end: usize, pairs: usize, pattern: &Pattern<'_>) -> bool {
    gaps(spectrum, end)
        .take(LANCZOS.gaps_tried)
        .find_map(|place| {
            let between = f64::midpoint(spectrum[place - 1], spectrum[place]);
            Some(pattern.factor(between)?.pairs_below() == pairs + place - end)
        })
        .unwrap_or(false)
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

fn starting_block(n: usize) -> Mat<f64> {
    Mat::from_fn(n, BLOCK, |i, j| noise((i * BLOCK + j) as u64))
}

#[cfg(test)]
mod tests {
    use super::super::Eigenbasis;
    use super::super::shifted_factor::tests::laplacian;
    use super::*;

    #[test]
    fn a_factor_counts_what_is_missed_or_found_twice() {
        let laplacian = laplacian();
        let pattern = Pattern::new(&laplacian).unwrap();
        let values = Eigenbasis::new(&laplacian, 16, &|| false).unwrap().values;
        let (all, end) = (&values[1..], 10);
        assert!(counts_as_many(all, end, end, &pattern));
        let missed = [&all[..4], &all[5..]].concat();
        assert!(!counts_as_many(&missed, end, end, &pattern));
        let twice = [&all[..5], &all[4..]].concat();
        assert!(!counts_as_many(&twice, end, end, &pattern));
        // Without what lies beyond, nothing tells.
        assert!(!counts_as_many(&all[..end], end, end, &pattern));
    }
}
