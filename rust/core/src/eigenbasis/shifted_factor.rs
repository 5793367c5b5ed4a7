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
use faer::{Side, Spec};

use super::noise::noise;
use super::substitution::Supernode;
use crate::dense::{by_library, vectorised};
use crate::error::{Error, Result};
use crate::laplacian::Laplacian;

/// Largest relative error of a solve that is still taken for a sound factor.
const SOLVE_ACCURACY: f64 = 1e-7;

/// What the factors of `W − sA` have in common for all shifts `s`: the ordering, and where numbers may stand.
pub(super) struct Pattern<'a> {
    laplacian: &'a Laplacian,
    pointers: Vec<u32>,
    indices: Vec<u32>,
    symbolic: SymbolicCholesky<u32>,
}

impl<'a> Pattern<'a> {
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
        .map_err(Error::not_factorised)?;
        Ok(Self {
            laplacian,
            pointers,
            indices,
            symbolic,
        })
    }

    /// Row `i` of a factor belongs to vertex `ordering()[i]`.
    pub(super) fn ordering(&self) -> Vec<u32> {
        self.symbolic.perm().map_or_else(
            || (0..self.laplacian.len() as u32).collect(),
            |p| p.arrays().0.to_vec(),
        )
    }

    /// Vertex areas in the factor's ordering.
    pub(super) fn mass(&self) -> Vec<f64> {
        let mass = &self.laplacian.mass;
        self.ordering().iter().map(|&v| mass[v as usize]).collect()
    }

    /// Factor of `W − sA`; none when a pivot vanished or solves are inaccurate.
    pub(super) fn factor(&self, shift: f64) -> Option<ShiftedFactor<'_>> {
        let n = self.laplacian.len();
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
        let mut values = vec![0.0; self.symbolic.len_val()];
        let matrix = SparseColMatRef::new(pattern, &entries);
        by_library(|| {
            self.symbolic
                .factorize_numeric_ldlt(
                    &mut values,
                    matrix,
                    Side::Upper,
                    LdltRegularization::default(),
                    Par::Seq,
                    MemStack::new(&mut MemBuffer::new(scratch)),
                    Spec::default(),
                )
                .is_ok()
        })
        .then_some(())?;
        let factor = ShiftedFactor {
            pattern: self,
            values,
            shift,
        };
        factor.is_accurate().then_some(factor)
    }
}

/// Factor `LDLᵀ = P(W − sA)Pᵀ` for a shift `s` that may lie inside the spectrum.
///
/// `D` is diagonal and there is no pivoting for size: the matrices eliminated before the last few
/// separators are those of small patches with fixed borders, whose spectra lie far above `s`. A
/// shift that falls on the spectrum of a patch shows as an inaccurate solve.
pub(super) struct ShiftedFactor<'a> {
    pattern: &'a Pattern<'a>,
    values: Vec<f64>,
    shift: f64,
}

impl ShiftedFactor<'_> {
    /// The factor of the same matrices with another shift; none where [`Pattern::factor`] has none.
    pub(super) fn with_shift(&self, shift: f64) -> Option<Self> {
        self.pattern.factor(shift)
    }

    /// The shift `s`.
    pub(super) fn shift(&self) -> f64 {
        self.shift
    }

    /// Whether a solve with a known answer is right: `(W − sA)⁻¹A·1 = −1/s`.
    fn is_accurate(&self) -> bool {
        let mut x: Vec<[f64; 1]> = self.pattern.mass().into_iter().map(|a| [a]).collect();
        self.solve(&mut x);
        let worst = x
            .iter()
            .map(|[x]| (x * self.shift + 1.0).abs())
            .try_fold(0.0, |m: f64, e| e.is_finite().then_some(m.max(e)));
        worst.is_some_and(|e| e < SOLVE_ACCURACY)
    }

    /// Distance of the shift from the nearest eigenvalue where that is far nearer than the others, never less than it: the
    /// inverse of a vector's growth in the second of two inverse iterations.
    pub(super) fn nearest_eigenvalue(&self) -> f64 {
        let mass = self.pattern.mass();
        let mut x: Vec<[f64; 1]> = (0..mass.len() as u64).map(|i| [noise(i)]).collect();
        let length = |x: &[[f64; 1]]| {
            let squares = x.iter().zip(&mass).map(|([x], a)| a * x * x);
            squares.sum::<f64>().sqrt()
        };
        let mut lengths = [0.0; 2];
        for after in &mut lengths {
            for ([x], a) in x.iter_mut().zip(&mass) {
                *x *= a;
            }
            self.solve(&mut x);
            *after = length(&x);
        }
        lengths[0] / lengths[1]
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

    /// `X ← (W − sA)⁻¹X`: a row for each vertex, in the factor's ordering.
    pub(super) fn solve<const C: usize>(&self, x: &mut [[f64; C]]) {
        let numeric = self.numeric();
        let symbolic = numeric.symbolic();
        vectorised(
            #[inline(always)]
            || {
                for s in 0..symbolic.n_supernodes() {
                    supernode(numeric, s).forward(x);
                }
                for s in (0..symbolic.n_supernodes()).rev() {
                    supernode(numeric, s).backward(x);
                }
            },
        );
    }

    fn numeric(&self) -> supernodal::SupernodalLdltRef<'_, u32, f64> {
        match self.pattern.symbolic.raw() {
            SymbolicCholeskyRaw::Supernodal(s) => {
                supernodal::SupernodalLdltRef::new(s, &self.values)
            }
            SymbolicCholeskyRaw::Simplicial(_) => unreachable!("a supernodal factor was asked for"),
        }
    }
}

#[inline(always)]
fn supernode(numeric: supernodal::SupernodalLdltRef<'_, u32, f64>, s: usize) -> Supernode<'_> {
    let symbolic = numeric.symbolic();
    let first = symbolic.supernode_begin()[s] as usize;
    let pointers = symbolic.col_ptr_for_val();
    Supernode {
        first,
        columns: symbolic.supernode_end()[s] as usize - first,
        below: symbolic.supernode(s).pattern(),
        values: &numeric.values()[pointers[s] as usize..pointers[s + 1] as usize],
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::eigenbasis::Eigenbasis;
    use crate::mesh::Mesh;

    /// An uneven sheet; its factor has supernodes of one column and of many.
    pub(in super::super) fn laplacian() -> Laplacian {
        let side = 24;
        let at = |i: usize| (i / side, i % side);
        let vertices: Vec<[f64; 3]> = (0..side * side)
            .map(|i| [at(i).0 as f64, at(i).1 as f64, (0.3 * i as f64).sin()])
            .collect();
        let faces: Vec<[i64; 3]> = (0..side * side)
            .filter(|&i| at(i).0 + 1 < side && at(i).1 + 1 < side)
            .flat_map(|i| {
                let [a, b, c, d] = [i, i + 1, i + side, i + side + 1].map(|v| v as i64);
                [[a, c, b], [b, c, d]]
            })
            .collect();
        Laplacian::new(&Mesh::new(&vertices, &faces).unwrap()).unwrap()
    }

    /// Right-hand sides come back, whatever their number and the sign of the shifted matrix.
    fn assert_solves<const C: usize>(laplacian: &Laplacian, shift: f64) {
        let pattern = Pattern::new(laplacian).unwrap();
        let factor = pattern.factor(shift).unwrap();
        let ordering = pattern.ordering();
        let n = ordering.len();
        let right: Vec<[f64; C]> = (0..n)
            .map(|i| std::array::from_fn(|c| ((i * (c + 2)) as f64).cos()))
            .collect();
        let mut solved = right.clone();
        factor.solve(&mut solved);
        let mut place = vec![0; n];
        for (i, &v) in ordering.iter().enumerate() {
            place[v as usize] = i;
        }
        for (v, row) in laplacian.stiffness.outer_iterator().enumerate() {
            for c in 0..C {
                let own = shift * laplacian.mass[v] * solved[place[v]][c];
                let product: f64 = row.iter().map(|(j, w)| w * solved[place[j]][c]).sum();
                let size: f64 = row
                    .iter()
                    .map(|(j, w)| (w * solved[place[j]][c]).abs())
                    .sum();
                // Rounding, times the growth of a factor without pivoting.
                let expected = right[place[v]][c];
                assert!((product - own - expected).abs() < 1e-9 * (size + own.abs() + 1.0));
            }
        }
    }

    #[test]
    fn solves_with_positive_and_indefinite_matrices() {
        let laplacian = laplacian();
        for shift in [-1.0, 0.37, 61.3, 500.0] {
            assert_solves::<1>(&laplacian, shift);
            assert_solves::<4>(&laplacian, shift);
        }
    }

    #[test]
    fn tells_how_near_an_eigenvalue_is() {
        const NEAR: f64 = 1e-4;
        let laplacian = laplacian();
        let pattern = Pattern::new(&laplacian).unwrap();
        let values = Eigenbasis::new(&laplacian, 12, &|| false).unwrap().values;
        let nearest = |shift: f64| pattern.factor(shift).unwrap().nearest_eigenvalue();
        for side in [-NEAR, NEAR] {
            let found = nearest(values[10] + side);
            assert!((found - NEAR).abs() < 0.01 * NEAR, "{found}");
        }
        // Never nearer than the nearest.
        let half = 0.5 * (values[11] - values[10]);
        assert!(half > 100.0 * NEAR && nearest(values[10] + half) > 0.999 * half);
    }

    /// All eigenvalues are below a shift beyond the largest, none below a negative one.
    #[test]
    fn counts_eigenvalues_below_the_shift() {
        let laplacian = laplacian();
        let pattern = Pattern::new(&laplacian).unwrap();
        assert_eq!(pattern.factor(-1.0).unwrap().eigenvalues_below(), 0);
        assert_eq!(pattern.factor(1e-6).unwrap().eigenvalues_below(), 1);
        let beyond = pattern.factor(1e7).unwrap();
        assert_eq!(beyond.eigenvalues_below(), laplacian.len());
    }
}
