//! Cholesky factor of `W + σA` and solves with it, in the factor's own ordering.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::prelude::*;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky, simplicial, supernodal,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, Side};

use crate::error::{Error, Result};
use crate::laplacian::Laplacian;

/// Factor `LLᵀ = P(W + σA)Pᵀ`.
pub(super) struct ShiftedFactor {
    symbolic: SymbolicCholesky<u32>,
    values: Vec<f64>,
}

impl ShiftedFactor {
    /// Factorises `W + σA` for `shift = σ > 0`.
    pub(super) fn new(laplacian: &Laplacian, shift: f64) -> Result<Self> {
        let n = laplacian.len();
        let failed = |reason: String| Error::NotFactorised { reason };
        let mut pointers = Vec::with_capacity(n + 1);
        let mut indices: Vec<u32> = Vec::with_capacity(laplacian.stiffness.nnz());
        let mut entries: Vec<f64> = Vec::with_capacity(laplacian.stiffness.nnz());
        pointers.push(0);
        for (i, row) in laplacian.stiffness.outer_iterator().enumerate() {
            for (j, &w) in row.iter() {
                if j <= i {
                    let shifted = if i == j {
                        w + shift * laplacian.mass[i]
                    } else {
                        w
                    };
                    indices.push(j as u32);
                    entries.push(shifted);
                }
            }
            pointers.push(indices.len() as u32);
        }
        // Rows of the lower half are columns of the upper half.
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &pointers, None, &indices);
        let symbolic = factorize_symbolic_cholesky(
            pattern,
            Side::Upper,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams::default(),
        )
        .map_err(|e| failed(format!("{e:?}")))?;
        let mut values = vec![0.0; symbolic.len_val()];
        let scratch =
            symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, faer::Spec::default());
        symbolic
            .factorize_numeric_llt(
                &mut values,
                SparseColMatRef::new(pattern, &entries),
                Side::Upper,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut MemBuffer::new(scratch)),
                faer::Spec::default(),
            )
            .map_err(|e| failed(format!("{e:?}")))?;
        Ok(Self { symbolic, values })
    }

    /// Row `i` of the factor belongs to vertex `ordering()[i]`.
    pub(super) fn ordering(&self) -> Vec<u32> {
        self.symbolic.perm().map_or_else(
            || (0..self.symbolic.nrows() as u32).collect(),
            |p| p.arrays().0.to_vec(),
        )
    }

    /// Working memory for `solve_in_place` with so many columns.
    pub(super) fn workspace(&self, columns: usize) -> MemBuffer {
        MemBuffer::new(match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(s) => s.solve_in_place_scratch::<f64>(columns),
            SymbolicCholeskyRaw::Supernodal(s) => {
                s.solve_in_place_scratch::<f64>(columns, Par::Seq)
            }
        })
    }

    /// `X ← (W + σA)⁻¹X`, rows in the factor's ordering.
    pub(super) fn solve_in_place(&self, x: MatMut<'_, f64>, workspace: &mut MemBuffer) {
        let stack = MemStack::new(workspace);
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(s) => simplicial::SimplicialLltRef::new(
                s,
                &self.values,
            )
            .solve_in_place_with_conj(Conj::No, x, Par::Seq, stack),
            SymbolicCholeskyRaw::Supernodal(s) => supernodal::SupernodalLltRef::new(
                s,
                &self.values,
            )
            .solve_in_place_with_conj(Conj::No, x, Par::Seq, stack),
        }
    }
}
