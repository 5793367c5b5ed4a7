//! Smallest eigenpairs of the Laplace–Beltrami operator: `W φ = λ A φ`.

mod block;
mod lanczos;
mod noise;
mod orthogonal;
mod shifted_factor;
mod slice;
mod slices;

use std::collections::VecDeque;

use faer::Mat;
use rayon::prelude::*;

use self::orthogonal::eigen;
use self::shifted_factor::Pattern;
use self::slice::Slice;
use self::slices::{Spectrum, lowest_factor};
use crate::algebra::dense::{self, vectorised};
use crate::error::{Error, Result};
use crate::spectrum::laplacian::Laplacian;
use crate::spectrum::settings::EIGENBASIS;

/// Rows of the basis multiplied at once, so that they stay in the cache: a multiple of the 48 of faer's kernel.
const ROWS_A_PIECE: usize = 96;

/// Eigenfunctions measured in one pass over `W`.
const MEASURED_AT_ONCE: usize = 8;

/// Truncated spectrum of a shape, ascending.
#[derive(Debug, Clone)]
pub struct Eigenbasis {
    /// Eigenvalues `λ`, `(k)`, ascending; the first is exactly 0. Unit: 1/area.
    pub values: Vec<f64>,
    /// Eigenfunctions `Φ`, `(n, k)`, `ΦᵀAΦ = I`; the first is the positive constant, the signs of
    /// the others are arbitrary but fixed.
    pub functions: Mat<f64>,
    /// Largest `‖Wφ − λAφ‖` in the `A⁻¹` norm over the pairs. Unit: 1/area.
    pub residual: f64,
    /// Sparse linear systems solved; 0 when a small mesh was solved densely.
    pub solves: usize,
    /// Vertices in the order in which they were eliminated, which fills in little; none when a small mesh was solved densely.
    pub ordering: Option<Vec<u32>>,
}

impl Eigenbasis {
    /// Share of the low eigenvalues that come in equal pairs. A surface that is the same after a turn about an axis by less
    /// than a half has them for all functions that the turn changes; others have none.
    #[must_use]
    pub fn repeated(&self) -> f64 {
        let values = &self.values[1..self.values.len().min(EIGENBASIS.looked_at + 2)];
        let is_repeated = |i: usize| {
            let spacing = values[i] / (i + 1) as f64;
            values[i + 1] - values[i] < EIGENBASIS.repeated * spacing
        };
        let (mut pairs, mut i) = (0, 0);
        while i + 1 < values.len() {
            let found = is_repeated(i);
            pairs += usize::from(found);
            i += 1 + usize::from(found);
        }
        2.0 * pairs as f64 / values.len() as f64
    }

    /// The `k` smallest eigenpairs.
    ///
    /// Shift-invert block Lanczos with full orthogonalisation, in two slices of the spectrum side by side from 180 pairs
    /// on; what lies below the shifts and below a value just above all pairs is counted by the inertia of factors. The
    /// result does not depend on the number of threads. Working memory per vertex: about `8·(1.6 k + 160) + 8 k` bytes
    /// and two factors.
    ///
    /// # Errors
    /// [`Error::BadArgument`] when `k` is 0 or more than the vertices, [`Error::NotFactorised`],
    /// [`Error::NotConverged`] when a pair misses `EIGENBASIS.residual_bound`, [`Error::Cancelled`] when
    /// `cancelled` (asked between blocks) says so.
    ///
    /// # Source
    /// Grimes, Lewis, Simon, "A shifted block Lanczos algorithm for solving sparse symmetric
    /// generalized eigenproblems", 1994. Where we part: the known constant is deflated; blocks are made orthogonal to
    /// all before them, two at a time; a slice has one shift, and no factor counts at its border.
    pub fn new(
        laplacian: &Laplacian,
        k: usize,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Self> {
        let n = laplacian.len();
        if k == 0 || k > n {
            return Err(Error::BadArgument {
                what: format!(
                    "k is {k}, but a mesh with {n} vertices has from 1 to {n} eigenpairs: \
                     ask for fewer"
                ),
            });
        }
        let area: f64 = laplacian.mass.iter().sum();
        let mut basis = Self {
            values: vec![0.0; k],
            functions: Mat::full(n, 1, 1.0 / area.sqrt()),
            residual: 0.0,
            solves: 0,
            ordering: None,
        };
        if k > 1 {
            if n <= EIGENBASIS.dense_ratio * Slice::lowest(k - 1).expected_size(0) {
                basis.fill_dense(laplacian, area, cancelled)?;
            } else {
                basis.fill_sparse(laplacian, cancelled)?;
            }
        }
        basis.check(laplacian, cancelled)?;
        Ok(basis)
    }

    /// All eigenpairs of `A^{-1/2}WA^{-1/2}`, with the constant moved out of the way.
    fn fill_dense(
        &mut self,
        laplacian: &Laplacian,
        area: f64,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<()> {
        if cancelled() {
            return Err(Error::Cancelled);
        }
        let root_mass: Vec<f64> = laplacian.mass.iter().map(|a| a.sqrt()).collect();
        let n = root_mass.len();
        let mut h = Mat::<f64>::zeros(n, n);
        for (&w, (i, j)) in &laplacian.stiffness {
            h[(i, j)] = w / (root_mass[i] * root_mass[j]);
        }
        let beyond: f64 = (0..n).map(|i| h[(i, i)]).sum();
        let h = Mat::from_fn(n, n, |i, j| {
            h[(i, j)] + beyond * root_mass[i] * root_mass[j] / area
        });
        let (values, vectors) = eigen(h.as_ref())?;
        let k = self.values.len();
        // With all n pairs asked for, the moved constant is the last one and is left out.
        for j in 1..k {
            self.values[j] = values[j - 1].max(0.0);
        }
        self.functions
            .resize_with(n, k, |i, j| vectors[(i, j - 1)] / root_mass[i]);
        Ok(())
    }

    fn fill_sparse(
        &mut self,
        laplacian: &Laplacian,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<()> {
        let k = self.values.len();
        // Memory is touched meanwhile.
        let (pattern, functions) = rayon::join(
            || Pattern::new(laplacian),
            || Mat::zeros(laplacian.len(), k),
        );
        let pattern = pattern?;
        let constant = std::mem::replace(&mut self.functions, functions);
        self.functions.col_mut(0).copy_from(constant.col(0));
        let bound = EIGENBASIS.safety * EIGENBASIS.residual_bound;
        let spectrum = Spectrum::new(&pattern, &laplacian.mass, bound, cancelled);
        let parts = spectrum.lowest(k - 1)?;
        if cancelled() {
            return Err(Error::Cancelled);
        }
        self.solves = parts.iter().map(|part| part.solves).sum();
        let values = parts.iter().flat_map(|part| &part.values);
        for (own, value) in self.values[1..].iter_mut().zip(values) {
            *own = *value;
        }
        let mut places = vec![(0, 0.0); laplacian.len()];
        for (i, (&v, root)) in pattern
            .ordering()
            .iter()
            .zip(&spectrum.root_mass)
            .enumerate()
        {
            places[v as usize] = (i, 1.0 / root);
        }
        self.ordering = Some(pattern.ordering().to_vec());
        let functions = self.functions.col_iter_mut().skip(1);
        let vectors = parts.iter().flat_map(|part| part.vectors.col_iter());
        functions
            .zip(vectors)
            .collect::<Vec<_>>()
            .into_par_iter()
            .for_each(|(function, vector)| {
                for (value, &(place, scale)) in function.iter_mut().zip(&places) {
                    *value = vector[place] * scale;
                }
            });
        Ok(())
    }

    /// Measures every pair against `W` and `A` themselves.
    ///
    /// A pair that misses the bound is relaxed at vertices of tiny mass, where rounding in `A^{1/2}φ` is a large
    /// oscillation of `φ` that nothing else notices, and if it still does, [corrected](Self::correct).
    fn check(
        &mut self,
        laplacian: &Laplacian,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<()> {
        let k = self.values.len();
        let bound = EIGENBASIS.residual_bound * self.values.last().copied().unwrap_or(0.0);
        let passes: Vec<usize> = (0..k).step_by(MEASURED_AT_ONCE).collect();
        let measured: Vec<[f64; MEASURED_AT_ONCE]> = passes
            .into_par_iter()
            .map(|first| {
                if cancelled() {
                    return Err(Error::Cancelled);
                }
                // The last pass measures the last pair more than once.
                let pairs: [usize; MEASURED_AT_ONCE] =
                    std::array::from_fn(|lane| (first + lane).min(k - 1));
                let values = pairs.map(|j| self.values[j]);
                let functions = interleaved(&self.functions, pairs);
                Ok(vectorised(
                    #[inline(always)]
                    || residuals(laplacian, values, &functions, |_, _| {}),
                ))
            })
            .collect::<Result<_>>()?;
        // NaN counts as a failure; the constant has rounding only.
        let fails = |j: usize, residual: f64| j > 0 && (residual > bound || residual.is_nan());
        let mut residuals: Vec<f64> = measured.into_iter().flatten().take(k).collect();
        for (j, residual) in residuals.iter_mut().enumerate() {
            if fails(j, *residual) {
                *residual = self.relax(laplacian, j, bound);
            }
        }
        let failed = |residuals: &[f64]| -> Vec<usize> {
            let all = residuals.iter().enumerate();
            all.filter(|&(j, &r)| fails(j, r)).map(|(j, _)| j).collect()
        };
        for _ in 0..EIGENBASIS.corrections {
            let inaccurate = failed(&residuals);
            if inaccurate.is_empty() {
                break;
            }
            self.correct(laplacian, &inaccurate, cancelled)?;
            for j in inaccurate {
                residuals[j] = self.relax(laplacian, j, bound);
            }
        }
        self.residual = residuals.iter().copied().fold(0.0, f64::max);
        let failed = failed(&residuals).len();
        if failed > 0 {
            return Err(Error::NotConverged {
                found: k - failed,
                wanted: k,
                residual: self.residual,
            });
        }
        Ok(())
    }

    /// Takes what `(W − sA)⁻¹r` has beyond all eigenfunctions off those with residuals `r`: what rounding in the iteration
    /// added of eigenfunctions far above the shift, which residuals are mostly made of where needles make `W` large.
    fn correct(
        &mut self,
        laplacian: &Laplacian,
        inaccurate: &[usize],
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<()> {
        let pattern = Pattern::new(laplacian)?;
        let factor = lowest_factor(&pattern, self.values.len() - 1, cancelled)?;
        let ordering = pattern.ordering();
        let mut defects = vec![[0.0]; laplacian.len()];
        let mut excess = Mat::zeros(laplacian.len(), inaccurate.len());
        for (&j, mut column) in inaccurate.iter().zip(excess.col_iter_mut()) {
            if cancelled() {
                return Err(Error::Cancelled);
            }
            self.measure(laplacian, j, &mut defects);
            let mut solved: Vec<[f64; 1]> = ordering.iter().map(|&v| defects[v as usize]).collect();
            factor.solve(&mut solved);
            for (&v, [x]) in ordering.iter().zip(solved) {
                column[v as usize] = x;
            }
        }
        let weighted = Mat::from_fn(excess.nrows(), excess.ncols(), |i, j| {
            laplacian.mass[i] * excess[(i, j)]
        });
        let known = dense::product(self.functions.transpose(), weighted.as_ref());
        dense::add_product(excess.as_mut(), self.functions.as_ref(), (-known).as_ref());
        for (&j, excess) in inaccurate.iter().zip(excess.col_iter()) {
            for (value, x) in self.functions.col_mut(j).iter_mut().zip(excess.iter()) {
                *value -= x;
            }
        }
        Ok(())
    }

    /// Solves the equation of pair `j` at one tiny vertex after the other, while one exceeds its share of the bound;
    /// returns the residual.
    ///
    /// # Source
    /// Southwell, "Relaxation methods in engineering science", 1940.
    fn relax(&mut self, laplacian: &Laplacian, j: usize, bound: f64) -> f64 {
        let (n, lambda) = (laplacian.len(), self.values[j]);
        let mut defects = vec![[0.0]; n];
        self.measure(laplacian, j, &mut defects);
        let exceeds = |i: usize, defect: f64| {
            defect * defect > bound * bound * laplacian.mass[i] / (2 * n) as f64
        };
        let mut waiting: VecDeque<usize> = (0..n).filter(|&i| exceeds(i, defects[i][0])).collect();
        let mut left = EIGENBASIS.relaxations * n;
        while let (Some(i), 1..) = (waiting.pop_front(), left) {
            left -= 1;
            let (Some(row), [defect]) = (laplacian.stiffness.outer_view(i), defects[i]) else {
                continue;
            };
            let inertia = lambda * laplacian.mass[i];
            let stiffness = row.get(i).copied().unwrap_or(0.0);
            if stiffness <= EIGENBASIS.stiff * inertia || !exceeds(i, defect) {
                continue;
            }
            let step = defect / (stiffness - inertia);
            self.functions[(i, j)] -= step;
            for (c, &w) in row.iter() {
                defects[c][0] -= step * if c == i { w - inertia } else { w };
                if c != i && exceeds(c, defects[c][0]) {
                    waiting.push_back(c);
                }
            }
        }
        self.measure(laplacian, j, &mut defects)
    }

    /// `Wφ − λAφ` of pair `j` into `defects`, `(n)`; returns its norm.
    fn measure(&self, laplacian: &Laplacian, j: usize, defects: &mut [[f64; 1]]) -> f64 {
        let function = interleaved(&self.functions, [j]);
        let note = |i: usize, defect: [f64; 1]| defects[i] = defect;
        let [residual] = residuals(laplacian, [self.values[j]], &function, note);
        residual
    }
}

/// One factorisation and so many solves in blocks: what a shift-invert method cannot do without,
/// for comparison with the whole.
///
/// # Errors
/// [`Error::NotFactorised`].
pub fn bare_solves(laplacian: &Laplacian, count: usize) -> Result<()> {
    let pattern = Pattern::new(laplacian)?;
    let factor = lowest_factor(&pattern, 1, &|| false)?;
    lanczos::bare_solves(&factor, laplacian.len(), count);
    Ok(())
}

/// One factorisation, with its ordering, as the lowest pairs need it.
///
/// # Errors
/// [`Error::NotFactorised`].
pub fn factorise(laplacian: &Laplacian) -> Result<()> {
    lowest_factor(&Pattern::new(laplacian)?, 1, &|| false).map(|_| ())
}

/// Norms of `Wφ − λAφ` of some pairs, `√(rᵀA⁻¹r)`; `note` is told them vertex by vertex.
#[inline(always)]
fn residuals<const C: usize>(
    laplacian: &Laplacian,
    values: [f64; C],
    functions: &[[f64; C]],
    mut note: impl FnMut(usize, [f64; C]),
) -> [f64; C] {
    let mut squares = [0.0; C];
    for (i, row) in laplacian.stiffness.outer_iterator().enumerate() {
        let mut defect = [0.0; C];
        for (c, w) in row.iter() {
            for (defect, value) in defect.iter_mut().zip(functions[c]) {
                *defect += w * value;
            }
        }
        let mass = laplacian.mass[i];
        for lane in 0..C {
            defect[lane] -= values[lane] * mass * functions[i][lane];
            squares[lane] += defect[lane] * defect[lane] / mass;
        }
        note(i, defect);
    }
    squares.map(f64::sqrt)
}

/// Some columns of a matrix, their entries of a row beside each other.
fn interleaved<const C: usize>(matrix: &Mat<f64>, columns: [usize; C]) -> Vec<[f64; C]> {
    let columns = columns.map(|j| matrix.col(j));
    (0..matrix.nrows())
        .map(|i| columns.map(|column| column[i]))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::noise::noise;
    use super::shifted_factor::tests::laplacian;
    use super::*;

    #[test]
    fn inaccurate_pairs_are_corrected() {
        let laplacian = laplacian();
        let exact = Eigenbasis::new(&laplacian, 12, &|| false).unwrap();
        let bound = EIGENBASIS.residual_bound * exact.values[11];
        let mut inaccurate = exact.clone();
        for j in [3, 11] {
            for i in 0..laplacian.len() {
                inaccurate.functions[(i, j)] += 1e-8 * noise(i as u64);
            }
            let mut defects = vec![[0.0]; laplacian.len()];
            let residual = inaccurate.measure(&laplacian, j, &mut defects);
            assert!(residual > 2.0 * bound, "{residual} {bound}");
        }
        inaccurate.check(&laplacian, &|| false).unwrap();
        assert!(inaccurate.residual <= bound);
        // What cannot be mended is still an error.
        inaccurate.values[11] *= 1.001;
        let checked = inaccurate.check(&laplacian, &|| false);
        assert!(matches!(
            checked,
            Err(Error::NotConverged { found: 11, .. })
        ));
    }
}
