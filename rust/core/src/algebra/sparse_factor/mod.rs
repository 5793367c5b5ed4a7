//! `LDLᵀ` of sparse symmetric matrices, and solves with several right-hand sides beside each other.

mod panels;

use faer::Spec;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::LdltRegularization;
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky, supernodal,
};
use faer::sparse::linalg::{SupernodalThreshold, SymbolicSupernodalParams};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Par, Side};

use self::panels::Panels;
use crate::algebra::dense::clearing_registers;
use crate::error::{Error, Result, System};

/// Columns that are treated as one at most, and the fraction of zeros that this may store: fewer steps of
/// factorisation and substitution against more products.
const RELAXED: &[(usize, f64)] = &[(4, 1.0)];

/// Where the numbers of some matrices stand, in which order they are eliminated, and where factors have theirs.
#[derive(Debug)]
pub struct Pattern {
    /// Columns of the upper half.
    pointers: Vec<u32>,
    indices: Vec<u32>,
    symbolic: SymbolicCholesky<u32>,
    ordering: Vec<u32>,
}

impl Pattern {
    /// Of the columns of the upper half: the rows with a number, ascending, the diagonal last. They are eliminated in
    /// a given order, one that suits a matrix much like these, or in one that is found here.
    ///
    /// # Errors
    /// [`Error::NotFactorised`].
    pub fn new(
        columns: impl Iterator<Item: Iterator<Item = u32>>,
        ordering: Option<&[u32]>,
    ) -> Result<Self> {
        let (mut pointers, mut indices) = (vec![0], Vec::new());
        for column in columns {
            indices.extend(column);
            pointers.push(indices.len() as u32);
        }
        let n = pointers.len() - 1;
        let places = ordering.map(|ordering| {
            let mut places = vec![0; n];
            for (place, &row) in (0..).zip(ordering) {
                places[row as usize] = place;
            }
            (ordering, places)
        });
        let order = match &places {
            Some((ordering, places)) => {
                SymmetricOrdering::Custom(PermRef::new_checked(ordering, places, n))
            }
            None => SymmetricOrdering::Amd,
        };
        let symbolic = factorize_symbolic_cholesky(
            SymbolicSparseColMatRef::new_checked(n, n, &pointers, None, &indices),
            Side::Upper,
            order,
            CholeskySymbolicParams {
                supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
                supernodal_params: SymbolicSupernodalParams {
                    relax: Some(RELAXED),
                },
                ..Default::default()
            },
        )
        .map_err(|e| Error::not_factorised(System::Elimination, e))?;
        let ordering = symbolic
            .perm()
            .map_or_else(|| (0..n as u32).collect(), |p| p.arrays().0.to_vec());
        Ok(Self {
            pointers,
            indices,
            symbolic,
            ordering,
        })
    }

    /// Row `i` of a factor belongs to row `ordering()[i]` of the matrix.
    #[must_use]
    pub fn ordering(&self) -> &[u32] {
        &self.ordering
    }

    /// Factor of the matrix with these numbers, in the order in which the pattern was told where they stand; none when a
    /// pivot vanished.
    #[must_use]
    pub fn factor(&self, entries: &[f64]) -> Option<Factor> {
        let n = self.ordering.len();
        let pattern =
            SymbolicSparseColMatRef::new_checked(n, n, &self.pointers, None, &self.indices);
        let matrix = SparseColMatRef::new(pattern, entries);
        let scratch = self
            .symbolic
            .factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Spec::default());
        let mut values = vec![0.0; self.symbolic.len_val()];
        clearing_registers(|| {
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
        .then(|| Factor::new(&self.symbolic, &values))
    }
}

/// Factor `LDLᵀ = PMPᵀ` of a matrix `M` in the ordering of its pattern; `D` is diagonal, and there is no pivoting for
/// size.
#[derive(Debug)]
pub struct Factor {
    panels: Panels,
    negative_pivots: usize,
}

impl Factor {
    fn new(symbolic: &SymbolicCholesky<u32>, values: &[f64]) -> Self {
        let SymbolicCholeskyRaw::Supernodal(symbolic) = symbolic.raw() else {
            unreachable!("a supernodal factor was asked for")
        };
        let numeric = supernodal::SupernodalLdltRef::new(symbolic, values);
        let mut factor = Self {
            panels: Panels::with_capacity(values.len()),
            negative_pivots: 0,
        };
        let pointers = symbolic.col_ptr_for_val();
        for s in 0..symbolic.n_supernodes() {
            let (first, end) = (
                symbolic.supernode_begin()[s] as usize,
                symbolic.supernode_end()[s] as usize,
            );
            let block = numeric.supernode(s).val();
            let negative = (0..end - first).filter(|&i| block[(i, i)] < 0.0).count();
            factor.negative_pivots += negative;
            factor.panels.push(
                first,
                end - first,
                symbolic.supernode(s).pattern(),
                &values[pointers[s] as usize..pointers[s + 1] as usize],
            );
        }
        factor
    }

    /// Negative entries of `D`: as many as `M` has negative eigenvalues, by Sylvester's law of inertia.
    #[must_use]
    pub fn negative_pivots(&self) -> usize {
        self.negative_pivots
    }

    /// `X ← M⁻¹X`: a row for each of the matrix, in the factor's ordering.
    pub fn solve<const C: usize>(&self, x: &mut [[f64; C]]) {
        self.panels.solve(x);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid's graph Laplacian with some of each vertex added, in the order in which it is told.
    fn grid(side: u32) -> (Vec<Vec<u32>>, Vec<f64>) {
        let columns: Vec<Vec<u32>> = (0..side * side)
            .map(|i| {
                let above = (i >= side).then(|| i - side);
                let left = (i % side > 0).then(|| i - 1);
                above.into_iter().chain(left).chain([i]).collect()
            })
            .collect();
        let entries = columns
            .iter()
            .flat_map(|column| {
                column.iter().map(|&i| {
                    if i == column[column.len() - 1] {
                        4.1
                    } else {
                        -1.0
                    }
                })
            })
            .collect();
        (columns, entries)
    }

    #[test]
    fn any_order_of_elimination_solves_the_same_equations() {
        const SIDE: u32 = 13;
        let (columns, entries) = grid(SIDE);
        let n = SIDE * SIDE;
        // 169 and 47 have no divisor in common.
        let scattered: Vec<u32> = (0..n).map(|i| 47 * i % n).collect();
        let solved = |ordering: Option<&[u32]>| -> Vec<f64> {
            let of = columns.iter().map(|column| column.iter().copied());
            let pattern = Pattern::new(of, ordering).unwrap();
            let factor = pattern.factor(&entries).unwrap();
            assert_eq!(factor.negative_pivots(), 0);
            let ordering = pattern.ordering();
            let mut x: Vec<[f64; 2]> = ordering
                .iter()
                .map(|&v| [f64::from(v).sin(), 1.0])
                .collect();
            factor.solve(&mut x);
            let mut found = vec![0.0; n as usize];
            for (&v, [x, _]) in ordering.iter().zip(x) {
                found[v as usize] = x;
            }
            found
        };
        let found = solved(None);
        for (v, &own) in (0..).zip(&found) {
            let at = |u: u32| found[u as usize];
            let mut sum = 4.1 * own;
            sum -= if v >= SIDE { at(v - SIDE) } else { 0.0 };
            sum -= if v + SIDE < n { at(v + SIDE) } else { 0.0 };
            sum -= if v % SIDE > 0 { at(v - 1) } else { 0.0 };
            sum -= if v % SIDE + 1 < SIDE { at(v + 1) } else { 0.0 };
            // Rounding of well conditioned equations.
            assert!((sum - f64::from(v).sin()).abs() < 1e-13);
        }
        for (x, y) in found.iter().zip(solved(Some(&scattered))) {
            assert!((x - y).abs() < 1e-13);
        }
    }
}
