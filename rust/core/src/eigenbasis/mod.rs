//! Smallest eigenpairs of the Laplace–Beltrami operator: `W φ = λ A φ`.

mod lanczos;
mod orthogonal;
mod shifted_factor;
mod substitution;

use std::collections::VecDeque;
use std::f64::consts::PI;

use faer::{Col, Mat};

use self::lanczos::{BlockLanczos, RitzPairs, expected_size};
use self::orthogonal::eigen;
use self::shifted_factor::{Pattern, ShiftedFactor};
use crate::dense::vectorised;
use crate::error::{Error, Result};
use crate::laplacian::Laplacian;

/// Bound on `‖Wφ − λAφ‖` in the `A⁻¹` norm, as a fraction of the largest eigenvalue asked for.
pub const RESIDUAL_BOUND: f64 = 1e-8;

/// The iteration stops at this fraction of the bound; the rest is for rounding in the check.
const SAFETY: f64 = 0.25;

/// The shift lies where this fraction of the wanted eigenvalues is below it. Krylov spaces then
/// find both ends equally late, at 5k vertices and k = 200 with 400 vectors instead of 600 for a
/// shift below the spectrum.
const FRACTION_BELOW: f64 = 0.62;

/// How far from that fraction, in fractions of the wanted, the shift may end.
const FRACTION_TOLERANCE: f64 = 0.08;

/// Factorisations tried to place the shift.
const SHIFT_TRIALS: usize = 6;

/// A shift whose factor is inaccurate is replaced by this multiple.
const SHIFT_STEP_ASIDE: f64 = 0.97;

/// Rows of the basis multiplied at once, so that they stay in the cache: a multiple of the 48 of faer's kernel.
const ROWS_A_PIECE: usize = 96;

/// Eigenfunctions measured in one pass over `W`.
const MEASURED_AT_ONCE: usize = 8;

/// Single vertices relaxed at most for a pair whose residual is rounding at tiny vertices, for each vertex.
const RELAXATIONS: usize = 100;

/// A vertex is tiny where its stiffness is more than this many times its mass times the eigenvalue: the pair's equation
/// there says what its value is, given those around it.
const STIFF: f64 = 1e3;

/// Meshes with fewer vertices than this many per vector of the first space are solved densely.
const DENSE_RATIO: usize = 2;

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
}

impl Eigenbasis {
    /// The `k` smallest eigenpairs.
    ///
    /// Shift-invert block Lanczos with full orthogonalisation; the count below the shift is
    /// checked against the factor's inertia, and the count of all against that of a factor whose
    /// shift lies just above them. The result does not depend on the number of threads. Working
    /// memory per vertex: about `8·(1.5 k + 60) + 8 k` bytes and two factors.
    ///
    /// # Errors
    /// [`Error::BadArgument`] when `k` is 0 or more than the vertices, [`Error::NotFactorised`],
    /// [`Error::NotConverged`] when a pair misses [`RESIDUAL_BOUND`], [`Error::Cancelled`] when
    /// `cancelled` (asked between blocks) says so.
    ///
    /// # Source
    /// Grimes, Lewis, Simon, "A shifted block Lanczos algorithm for solving sparse symmetric
    /// generalized eigenproblems", 1994. Where we part: one shift, placed inside the wanted
    /// spectrum; the known constant is deflated; blocks are made orthogonal to all before them, two at a time.
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
        let root_mass: Vec<f64> = laplacian.mass.iter().map(|a| a.sqrt()).collect();
        let mut basis = Self {
            values: vec![0.0; k],
            functions: Mat::full(n, 1, 1.0 / area.sqrt()),
            residual: 0.0,
            solves: 0,
        };
        if k > 1 {
            if n <= DENSE_RATIO * expected_size(k - 1) {
                basis.fill_dense(laplacian, &root_mass, area, cancelled)?;
            } else {
                basis.fill_sparse(laplacian, &root_mass, area, cancelled)?;
            }
        }
        basis.check(laplacian, cancelled)?;
        Ok(basis)
    }

    /// All eigenpairs of `A^{-1/2}WA^{-1/2}`, with the constant moved out of the way.
    fn fill_dense(
        &mut self,
        laplacian: &Laplacian,
        root_mass: &[f64],
        area: f64,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<()> {
        if cancelled() {
            return Err(Error::Cancelled);
        }
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
        root_mass: &[f64],
        area: f64,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<()> {
        let wanted = self.values.len() - 1;
        let pattern = Pattern::new(laplacian)?;
        let factor = factor_within_spectrum(&pattern, wanted, area, cancelled)?;
        let ordering = factor.ordering();
        let ordered: Vec<f64> = ordering.iter().map(|&v| root_mass[v as usize]).collect();
        let constant = Col::from_fn(ordered.len(), |i| ordered[i] / area.sqrt());
        let lanczos =
            BlockLanczos::new(&factor, &ordered, constant.as_ref(), expected_size(wanted));
        let RitzPairs {
            values,
            vectors,
            solves,
        } = lanczos.run(wanted, SAFETY * RESIDUAL_BOUND, cancelled)?;
        if cancelled() {
            return Err(Error::Cancelled);
        }
        self.solves = solves;
        self.values[1..].copy_from_slice(&values);
        let mut place = vec![0; ordering.len()];
        for (i, &v) in ordering.iter().enumerate() {
            place[v as usize] = i;
        }
        self.functions = Mat::from_fn(place.len(), 1 + wanted, |v, j| match j {
            0 => 1.0 / area.sqrt(),
            _ => vectors[(place[v], j - 1)] / root_mass[v],
        });
        Ok(())
    }

    /// Measures every pair against `W` and `A` themselves.
    ///
    /// A pair that misses the bound is relaxed at vertices of tiny mass, where rounding in `A^{1/2}φ` is a large
    /// oscillation of `φ` that nothing else notices.
    fn check(
        &mut self,
        laplacian: &Laplacian,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<()> {
        let k = self.values.len();
        let bound = RESIDUAL_BOUND * self.values.last().copied().unwrap_or(0.0);
        let mut defects = vec![[0.0; MEASURED_AT_ONCE]; laplacian.len()];
        let mut good = 0;
        for first in (0..k).step_by(MEASURED_AT_ONCE) {
            if cancelled() {
                return Err(Error::Cancelled);
            }
            // The last pass measures the last pair more than once.
            let pairs: [usize; MEASURED_AT_ONCE] =
                std::array::from_fn(|lane| (first + lane).min(k - 1));
            let values = pairs.map(|j| self.values[j]);
            let functions = interleaved(&self.functions, pairs);
            let measured = vectorised(
                #[inline(always)]
                || residuals(laplacian, values, &functions, &mut defects),
            );
            for (j, mut residual) in (first..k).zip(measured) {
                // The constant has rounding only.
                if j > 0 && residual > bound {
                    residual = self.relax(laplacian, j, bound);
                }
                // NaN counts as a failure.
                if residual <= bound || j == 0 {
                    good += 1;
                }
                self.residual = self.residual.max(residual);
            }
        }
        if good < k {
            return Err(Error::NotConverged {
                found: good,
                wanted: k,
                residual: self.residual,
            });
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
        residuals(
            laplacian,
            [lambda],
            &interleaved(&self.functions, [j]),
            &mut defects,
        );
        let exceeds = |i: usize, defect: f64| {
            defect * defect > bound * bound * laplacian.mass[i] / (2 * n) as f64
        };
        let mut waiting: VecDeque<usize> = (0..n).filter(|&i| exceeds(i, defects[i][0])).collect();
        let mut left = RELAXATIONS * n;
        while let (Some(i), 1..) = (waiting.pop_front(), left) {
            left -= 1;
            let (Some(row), [defect]) = (laplacian.stiffness.outer_view(i), defects[i]) else {
                continue;
            };
            let inertia = lambda * laplacian.mass[i];
            let stiffness = row.get(i).copied().unwrap_or(0.0);
            if stiffness <= STIFF * inertia || !exceeds(i, defect) {
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
        let [residual] = residuals(
            laplacian,
            [lambda],
            &interleaved(&self.functions, [j]),
            &mut defects,
        );
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
    let area = laplacian.mass.iter().sum();
    lanczos::bare_solves(
        &factor_within_spectrum(&pattern, count, area, &|| false)?,
        count,
    );
    Ok(())
}

/// Factor of `W − sA` with `s` at about `FRACTION_BELOW` of the wanted spectrum.
///
/// Starts from Weyl's `λ_j ≈ 4πj/area` and corrects by the count of eigenvalues below.
fn factor_within_spectrum<'a>(
    pattern: &'a Pattern<'a>,
    wanted: usize,
    area: f64,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<ShiftedFactor<'a>> {
    let target = FRACTION_BELOW * wanted as f64;
    let mut shift = 4.0 * PI * target.max(0.5) / area;
    for trial in 1..=SHIFT_TRIALS {
        if cancelled() {
            return Err(Error::Cancelled);
        }
        let Some(factor) = pattern.factor(shift) else {
            shift *= SHIFT_STEP_ASIDE;
            continue;
        };
        let below = factor.eigenvalues_below() as f64;
        let tolerance = (FRACTION_TOLERANCE * wanted as f64).max(2.0);
        // A shift off its best place only costs solves.
        if (below - target).abs() <= tolerance || trial + 2 > SHIFT_TRIALS {
            return Ok(factor);
        }
        shift *= (target / below.max(1.0)).clamp(0.25, 4.0);
    }
    Err(Error::NotFactorised {
        reason: format!("no accurate factor for {SHIFT_TRIALS} shifts up to {shift:.3}"),
    })
}

/// `Wφ − λAφ` of some pairs into the columns of `defects`, `(n, C)`, and their norms: `√(rᵀA⁻¹r)`.
#[inline(always)]
fn residuals<const C: usize>(
    laplacian: &Laplacian,
    values: [f64; C],
    functions: &[[f64; C]],
    defects: &mut [[f64; C]],
) -> [f64; C] {
    let mut squares = [0.0; C];
    for (i, row) in laplacian.stiffness.outer_iterator().enumerate() {
        let mut products = [0.0; C];
        for (c, w) in row.iter() {
            for (product, value) in products.iter_mut().zip(functions[c]) {
                *product += w * value;
            }
        }
        let mass = laplacian.mass[i];
        for lane in 0..C {
            let defect = products[lane] - values[lane] * mass * functions[i][lane];
            squares[lane] += defect * defect / mass;
            defects[i][lane] = defect;
        }
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
