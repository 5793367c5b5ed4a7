//! Factorisation of `W − sA` and solves with it, in the factor's own ordering.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::LdltRegularization;
use faer::prelude::*;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky, supernodal,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, Side, Spec};

use crate::error::{Error, Result};
use crate::laplacian::Laplacian;

/// Largest relative error of a solve that is still taken for a sound factor.
const SOLVE_ACCURACY: f64 = 1e-7;

/// Factor `LDLᵀ = P(W − sA)Pᵀ` for a shift `s` that may lie inside the spectrum.
///
/// `D` is diagonal and there is no pivoting for size: the matrices eliminated before the last few
/// separators are those of small patches with fixed borders, whose spectra lie far above `s`. A
/// shift that falls on the spectrum of a patch shows as an inaccurate solve, see
/// [`Self::is_accurate`].
pub(super) struct ShiftedFactor<'a> {
    laplacian: &'a Laplacian,
    pointers: Vec<u32>,
    indices: Vec<u32>,
    symbolic: SymbolicCholesky<u32>,
    values: Vec<f64>,
    shift: f64,
}

impl<'a> ShiftedFactor<'a> {
    /// Chooses the ordering; no numbers yet.
    pub(super) fn new(laplacian: &'a Laplacian) -> Result<Self> {
        let n = laplacian.len();
        let mut pointers = Vec::with_capacity(n + 1);
        let mut indices: Vec<u32> = Vec::with_capacity(laplacian.stiffness.nnz());
        pointers.push(0);
        for (i, row) in laplacian.stiffness.outer_iterator().enumerate() {
            // Rows of the lower half are columns of the upper half.
            indices.extend(row.indices().iter().filter(|&&j| j <= i).map(|&j| j as u32));
            pointers.push(indices.len() as u32);
        }
        let symbolic = factorize_symbolic_cholesky(
            SymbolicSparseColMatRef::new_checked(n, n, &pointers, None, &indices),
            Side::Upper,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams {
                supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
                ..Default::default()
            },
        )
        .map_err(|e| Error::NotFactorised {
            reason: format!("{e:?}"),
        })?;
        Ok(Self {
            laplacian,
            pointers,
            indices,
            values: vec![0.0; symbolic.len_val()],
            symbolic,
            shift: 0.0,
        })
    }

    /// Factorises `W − sA`; false when a pivot vanished.
    pub(super) fn factorise(&mut self, shift: f64) -> bool {
        let n = self.laplacian.len();
        self.shift = shift;
        let mut entries: Vec<f64> = Vec::with_capacity(self.indices.len());
        for (i, row) in self.laplacian.stiffness.outer_iterator().enumerate() {
            for (j, &w) in row.iter().filter(|&(j, _)| j <= i) {
                entries.push(if i == j {
                    w - shift * self.laplacian.mass[i]
                } else {
                    w
                });
            }
        }
        let pattern =
            SymbolicSparseColMatRef::new_checked(n, n, &self.pointers, None, &self.indices);
        let scratch = self
            .symbolic
            .factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Spec::default());
        self.symbolic
            .factorize_numeric_ldlt(
                &mut self.values,
                SparseColMatRef::new(pattern, &entries),
                Side::Upper,
                LdltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut MemBuffer::new(scratch)),
                Spec::default(),
            )
            .is_ok()
    }

    /// The shift `s` of the last factorisation.
    pub(super) fn shift(&self) -> f64 {
        self.shift
    }

    /// Whether a solve with a known answer is right: `(W − sA)⁻¹A·1 = −1/s`.
    pub(super) fn is_accurate(&self) -> bool {
        let ordering = self.ordering();
        let mut x = Mat::from_fn(ordering.len(), 1, |i, _| {
            self.laplacian.mass[ordering[i] as usize]
        });
        self.solve_in_place(x.as_mut(), &mut self.workspace(1));
        let worst = (0..x.nrows())
            .map(|i| (x[(i, 0)] * self.shift + 1.0).abs())
            .try_fold(0.0, |m: f64, e| e.is_finite().then_some(m.max(e)));
        worst.is_some_and(|e| e < SOLVE_ACCURACY)
    }

    /// Row `i` of the factor belongs to vertex `ordering()[i]`.
    pub(super) fn ordering(&self) -> Vec<u32> {
        self.symbolic.perm().map_or_else(
            || (0..self.laplacian.len() as u32).collect(),
            |p| p.arrays().0.to_vec(),
        )
    }

    /// Eigenvalues below the shift: negative entries of `D`, by Sylvester's law of inertia.
    pub(super) fn eigenvalues_below(&self) -> usize {
        let numeric = self.numeric();
        (0..numeric.symbolic().n_supernodes())
            .map(|s| {
                let block = numeric.supernode(s).val();
                (0..block.ncols()).filter(|&i| block[(i, i)] < 0.0).count()
            })
            .sum()
    }

    /// Working memory for `solve_in_place` with so many columns.
    pub(super) fn workspace(&self, columns: usize) -> MemBuffer {
        MemBuffer::new(
            self.numeric()
                .symbolic()
                .solve_in_place_scratch::<f64>(columns, Par::Seq),
        )
    }

    /// `X ← (W − sA)⁻¹X`, rows in the factor's ordering.
    pub(super) fn solve_in_place(&self, x: MatMut<'_, f64>, workspace: &mut MemBuffer) {
        self.numeric()
            .solve_in_place_with_conj(Conj::No, x, Par::Seq, MemStack::new(workspace));
    }

    fn numeric(&self) -> supernodal::SupernodalLdltRef<'_, u32, f64> {
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Supernodal(s) => {
                supernodal::SupernodalLdltRef::new(s, &self.values)
            }
            SymbolicCholeskyRaw::Simplicial(_) => unreachable!("a supernodal factor was asked for"),
        }
    }
}
