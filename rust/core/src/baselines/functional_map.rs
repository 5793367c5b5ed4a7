//! Functional map from descriptors alone.
//!
//! # Source
//! Ovsjanikov, Ben-Chen, Solomon, Butscher, Guibas, "Functional maps: a flexible representation of
//! maps between shapes", 2012: descriptors as constraints, commutativity with the Laplacian,
//! refinement by iterated closest points. Descriptors are wave kernel signatures; no landmarks, no
//! segments.

use faer::linalg::solvers::Svd;
use faer::{Mat, MatRef};

use super::{Convergence, Embedding};
use crate::algebra::dense::{self, Rows};
use crate::baselines::settings::FUNCTIONAL_MAP;
use crate::error::{Error, Result, System};
use crate::shape::Shape;
use crate::shape::descriptors::WAVE_ENERGIES;
use crate::watch::progress::Progress;

/// Embeddings by a functional map that carries descriptors to descriptors.
///
/// # Errors
/// [`Error::Cancelled`], [`Error::NotFactorised`].
pub fn embedded(source: &Shape, target: &Shape, progress: &Progress) -> Result<Embedding> {
    let k = FUNCTIONAL_MAP
        .size
        .min(target.basis.values.len())
        .min(source.basis.values.len());
    let mut matrix = fitted(source, target, k)?;
    let asking = target.drawn_vertices(FUNCTIONAL_MAP.asking);
    let asked = dense::gather_rows(target.functions(k), &asking, k);
    let asked_rows = Rows::from_matrix(asked.as_ref(), k);
    let mut images = Vec::new();
    let (mut steps, mut converged) = (0, false);
    while steps < FUNCTIONAL_MAP.steps && !converged {
        let answers = source.rows.times(matrix.as_ref());
        let check = || progress.check();
        let found = source.cells.nearest(&asked_rows, &answers, &check)?;
        let changed = found.iter().zip(&images).filter(|(a, b)| a != b).count();
        converged =
            found.len() == images.len() && changed <= found.len() / FUNCTIONAL_MAP.unchanged_share;
        images = found;
        let answers = dense::gather_rows(source.functions(k), &images, k);
        matrix = orthogonal(dense::product(answers.transpose(), asked.as_ref()).as_ref())?;
        steps += 1;
    }
    let (a, b) = (spectra(target, k), spectra(source, k));
    let residual = &dense::product(matrix.as_ref(), a.as_ref()) - &b;
    Ok(Embedding {
        target: target.rows.first(k),
        source: source.rows.times(matrix.as_ref()),
        convergence: Convergence {
            energy: dense::squared_norm(residual.as_ref()) / dense::squared_norm(b.as_ref()),
            gradient_norm: None,
            steps,
            converged,
        },
    })
}

/// C, target coefficients → source coefficients, that minimises ‖CA − B‖² + μ‖Λ₂C − CΛ₁‖², with the
/// descriptors' coefficients A on the target and B on the source: each row on its own.
fn fitted(source: &Shape, target: &Shape, k: usize) -> Result<Mat<f64>> {
    let (a, b) = (spectra(target, k), spectra(source, k));
    let gram = dense::product(a.as_ref(), a.transpose());
    let right = dense::product(a.as_ref(), b.transpose());
    let (own, other) = (&target.basis.values, &source.basis.values);
    let largest = own[k - 1].max(other[k - 1]);
    let weight = FUNCTIONAL_MAP.commutativity * a.ncols() as f64;
    let mut matrix = Mat::zeros(k, k);
    for i in 0..k {
        let ridge =
            |j: usize| weight * (((other[i] - own[j]) / largest).powi(2) + FUNCTIONAL_MAP.ridge);
        let row = dense::solve_with_ridge(
            System::Map,
            gram.clone(),
            ridge,
            right.as_ref().subcols(i, 1),
        )?;
        for j in 0..k {
            matrix[(i, j)] = row[(j, 0)];
        }
    }
    Ok(matrix)
}

/// Coefficients `(k, 60)` of the wave kernel signatures, each of unit norm.
fn spectra(shape: &Shape, k: usize) -> Mat<f64> {
    let rows = &shape.descriptors.rows;
    let weighted = Mat::from_fn(rows.count(), WAVE_ENERGIES, |i, j| {
        shape.mass[i] * f64::from(rows.row(i)[j])
    });
    let mut spectra = dense::product(shape.functions(k).transpose(), weighted.as_ref());
    for j in 0..spectra.ncols() {
        let norm = spectra.col(j).norm_l2();
        for x in spectra.col_mut(j).iter_mut() {
            *x /= norm.max(f64::MIN_POSITIVE);
        }
    }
    spectra
}

/// Nearest orthogonal matrix.
fn orthogonal(matrix: MatRef<'_, f64>) -> Result<Mat<f64>> {
    let svd = Svd::new(matrix).map_err(|_| Error::NotFactorised {
        of: System::Map,
        reason: "nearest orthogonal functional map".into(),
    })?;
    Ok(dense::product(svd.U(), svd.V().transpose()))
}
