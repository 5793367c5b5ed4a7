//! Orthonormal columns and dense eigenproblems, each product on one thread.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::prelude::*;
use faer::{Accum, Spec};

use super::ROWS_A_PIECE;
use crate::algebra::dense::{clearing_registers, multiply, product};
use crate::error::{Error, Result};

/// `X ← (I − QQᵀ)X`; returns `XᵀQ`.
pub(super) fn remove(mut x: MatMut<'_, f64>, q: MatRef<'_, f64>) -> Mat<f64> {
    let mut products = Mat::zeros(x.ncols(), q.ncols());
    multiply(
        products.as_mut(),
        Accum::Replace,
        x.rb().transpose(),
        q,
        1.0,
    );
    for first in (0..q.nrows()).step_by(ROWS_A_PIECE) {
        let rows = ROWS_A_PIECE.min(q.nrows() - first);
        multiply(
            x.rb_mut().subrows_mut(first, rows),
            Accum::Add,
            q.subrows(first, rows),
            products.transpose(),
            -1.0,
        );
    }
    products
}

/// `X = QR`, `Q` orthogonal to what is `known`: overwrites `X` with `Q`, returns `R`.
pub(super) fn orthonormalise(mut x: MatMut<'_, f64>, known: MatRef<'_, f64>) -> Mat<f64> {
    if let Some(first) = cholesky_qr(x.rb_mut())
        && let Some(second) = cholesky_qr(x.rb_mut())
    {
        return product(second.as_ref(), first.as_ref());
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
    let mut gram = product(x.rb().transpose(), x.rb());
    let largest = (0..b).map(|i| gram[(i, i)]).fold(0.0, f64::max);
    let scratch = cholesky_in_place_scratch::<f64>(b, Par::Seq, Spec::default());
    clearing_registers(|| {
        cholesky_in_place(
            gram.as_mut(),
            faer::linalg::cholesky::llt::factor::LltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Spec::default(),
        )
    })
    .ok()?;
    let least = (0..b).map(|i| gram[(i, i)]).fold(f64::MAX, f64::min);
    // The square of the condition number must stay well inside double precision.
    if least * least <= 1e-12 * largest {
        return None;
    }
    clearing_registers(|| {
        solve_lower_triangular_in_place(gram.as_ref(), x.transpose_mut(), Par::Seq);
    });
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
    clearing_registers(|| {
        self_adjoint_evd(
            matrix,
            faer::diag::DiagMut::from_slice_mut(&mut values),
            Some(vectors.as_mut()),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Spec::default(),
        )
    })
    .map_err(|_| Error::NotConverged {
        found: 0,
        wanted: m,
        residual: f64::NAN,
    })?;
    Ok((values, vectors))
}

/// Smallest diagonal entry, in magnitude.
pub(super) fn least_pivot(triangle: &Mat<f64>) -> f64 {
    (0..triangle.ncols())
        .map(|i| triangle[(i, i)].abs())
        .fold(f64::MAX, f64::min)
}
