//! Smallest eigenpairs of the Laplace–Beltrami operator: `W φ = λ A φ`.

mod lanczos;
mod shifted_factor;

use faer::Mat;

use self::lanczos::{BlockLanczos, RitzPairs, eigen, first_check};
use self::shifted_factor::ShiftedFactor;
use crate::error::{Error, Result};
use crate::laplacian::Laplacian;

/// Bound on `‖Wφ − λAφ‖` in the `A⁻¹` norm, as a fraction of the largest eigenvalue asked for.
pub const RESIDUAL_BOUND: f64 = 1e-8;

/// The iteration stops at this fraction of the bound; the rest is for rounding in the check.
const SAFETY: f64 = 0.25;

/// Shift `σ` times the total area. Eigenvalues of a surface of area 1 are about 4π apart (Weyl), so
/// this is far below the second one, and far above what rounding does to the first.
const SHIFT: f64 = 1.0;

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
    /// Shift-invert block Lanczos with full orthogonalisation. The result does not depend on the
    /// number of threads.
    ///
    /// # Errors
    /// [`Error::BadArgument`] when `k` is 0 or more than the vertices, [`Error::NotFactorised`],
    /// [`Error::NotConverged`] when a pair misses [`RESIDUAL_BOUND`], [`Error::Cancelled`] when
    /// `cancelled` (asked between blocks) says so.
    ///
    /// # Source
    /// Grimes, Lewis, Simon, "A shifted block Lanczos algorithm for solving sparse symmetric
    /// generalized eigenproblems", 1994. Parts: we deflate the known constant instead of moving
    /// the shift, and orthogonalise fully.
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
            functions: Mat::zeros(n, k),
            residual: 0.0,
            solves: 0,
        };
        basis.functions.col_mut(0).fill(1.0 / area.sqrt());
        if k > 1 {
            if n <= DENSE_RATIO * first_check(k - 1) {
                basis.fill_dense(laplacian, &root_mass, area, cancelled)?;
            } else {
                basis.fill_sparse(laplacian, &root_mass, area, cancelled)?;
            }
        }
        basis.check(laplacian)?;
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
        for j in 1..self.values.len() {
            // With all n pairs asked for, the moved constant is the last one and is left out.
            self.values[j] = values[j - 1].max(0.0);
            for i in 0..n {
                self.functions[(i, j)] = vectors[(i, j - 1)] / root_mass[i];
            }
        }
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
        let shift = SHIFT / area;
        let factor = ShiftedFactor::new(laplacian, shift)?;
        if cancelled() {
            return Err(Error::Cancelled);
        }
        let ordering = factor.ordering();
        let ordered: Vec<f64> = ordering.iter().map(|&v| root_mass[v as usize]).collect();
        let constant = Mat::from_fn(ordered.len(), 1, |i, _| ordered[i] / area.sqrt());
        let lanczos = BlockLanczos::new(&factor, &ordered, constant, 5 * wanted / 2 + 64);
        // After the last step of M the residual of Wφ = λAφ in the A⁻¹ norm is ‖Mx − μx‖/μ².
        let tolerance =
            |mu: f64, smallest: f64| SAFETY * RESIDUAL_BOUND * (1.0 / smallest - shift) * mu * mu;
        let RitzPairs {
            values,
            vectors,
            solves,
        } = lanczos.run(wanted, tolerance, cancelled)?;
        self.solves = solves;
        for (j, mu) in values.into_iter().enumerate() {
            self.values[j + 1] = (1.0 / mu - shift).max(0.0);
            for (i, &v) in ordering.iter().enumerate() {
                self.functions[(v as usize, j + 1)] = vectors[(i, j)] / ordered[i];
            }
        }
        Ok(())
    }

    /// Measures every pair against `W` and `A` themselves.
    fn check(&mut self, laplacian: &Laplacian) -> Result<()> {
        let bound = RESIDUAL_BOUND * self.values.last().copied().unwrap_or(0.0);
        let mut good = 0;
        for (j, &value) in self.values.iter().enumerate() {
            let phi = self.functions.col(j);
            let mut square = 0.0;
            for (i, row) in laplacian.stiffness.outer_iterator().enumerate() {
                let product: f64 = row.iter().map(|(c, w)| w * phi[c]).sum();
                let mass = laplacian.mass[i];
                let difference = product - value * mass * phi[i];
                square += difference * difference / mass;
            }
            let residual = square.sqrt();
            // Written so that NaN counts as a failure. The constant has rounding only.
            if residual <= bound || j == 0 {
                good += 1;
            }
            self.residual = self.residual.max(residual);
        }
        if good < self.values.len() {
            return Err(Error::NotConverged {
                found: good,
                wanted: self.values.len(),
                residual: self.residual,
            });
        }
        Ok(())
    }
}
