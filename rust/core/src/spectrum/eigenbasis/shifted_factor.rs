//! Factors of `W − sA` and solves with them, in the factor's own ordering.

use super::noise::noise;
use crate::algebra::sparse_factor::{self, Factor};
use crate::error::Result;
use crate::spectrum::laplacian::Laplacian;
use crate::spectrum::settings::SHIFTED_FACTOR;

/// What the factors of `W − sA` have in common for all shifts `s`.
pub(super) struct Pattern<'a> {
    laplacian: &'a Laplacian,
    pattern: sparse_factor::Pattern,
}

impl<'a> Pattern<'a> {
    pub(super) fn new(laplacian: &'a Laplacian) -> Result<Self> {
        // Rows of the lower half are columns of the upper half.
        let rows = laplacian.stiffness.outer_iterator().enumerate();
        let columns = rows.map(|(i, row)| {
            let indices = row.into_raw_storage().0.iter();
            indices.take_while(move |&&j| j <= i).map(|&j| j as u32)
        });
        Ok(Self {
            laplacian,
            pattern: sparse_factor::Pattern::new(columns, None)?,
        })
    }

    /// Row `i` of a factor belongs to vertex `ordering()[i]`.
    pub(super) fn ordering(&self) -> &[u32] {
        self.pattern.ordering()
    }

    /// Vertex areas in the factor's ordering.
    pub(super) fn mass(&self) -> impl Iterator<Item = f64> {
        let mass = &self.laplacian.mass;
        self.ordering().iter().map(|&v| mass[v as usize])
    }

    /// Factor of `W − sA`; none when a pivot vanished or solves are inaccurate.
    pub(super) fn factor(&self, shift: f64) -> Option<ShiftedFactor<'_>> {
        let mass = &self.laplacian.mass;
        let mut entries = Vec::with_capacity(self.laplacian.stiffness.nnz());
        for (i, row) in self.laplacian.stiffness.outer_iterator().enumerate() {
            entries.extend(
                row.iter()
                    .take_while(|&(j, _)| j <= i)
                    .map(|(j, &w)| if i == j { w - shift * mass[i] } else { w }),
            );
        }
        let factor = ShiftedFactor {
            pattern: self,
            factor: self.pattern.factor(&entries)?,
            shift,
        };
        factor.is_accurate().then_some(factor)
    }
}

/// Factor `LDLᵀ = P(W − sA)Pᵀ` for a shift `s` that may lie inside the spectrum.
///
/// There is no pivoting for size: the matrices eliminated before the last few
/// separators are those of small patches with fixed borders, whose spectra lie far above `s`. A
/// shift that falls on the spectrum of a patch shows as an inaccurate solve.
pub(super) struct ShiftedFactor<'a> {
    pattern: &'a Pattern<'a>,
    factor: Factor,
    shift: f64,
}

impl ShiftedFactor<'_> {
    /// What it has in common with factors for other shifts.
    pub(super) fn pattern(&self) -> &Pattern<'_> {
        self.pattern
    }

    /// The shift `s`.
    pub(super) fn shift(&self) -> f64 {
        self.shift
    }

    /// Whether a solve with a known answer is right: `(W − sA)⁻¹A·1 = −1/s`.
    fn is_accurate(&self) -> bool {
        let mut x: Vec<[f64; 1]> = self.pattern.mass().map(|a| [a]).collect();
        self.solve(&mut x);
        let worst = x
            .iter()
            .map(|[x]| (x * self.shift + 1.0).abs())
            .try_fold(0.0, |m: f64, e| e.is_finite().then_some(m.max(e)));
        worst.is_some_and(|e| e < SHIFTED_FACTOR.solve_accuracy)
    }

    /// Distance of the shift from the nearest eigenvalue where that is far nearer than the others, never less than it: the
    /// inverse of a vector's growth in the second of two inverse iterations.
    pub(super) fn nearest_eigenvalue(&self) -> f64 {
        let mass: Vec<f64> = self.pattern.mass().collect();
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

    /// Eigenvalues below the shift.
    pub(super) fn eigenvalues_below(&self) -> usize {
        self.factor.negative_pivots()
    }

    /// The same without the constant.
    pub(super) fn pairs_below(&self) -> usize {
        self.eigenvalues_below().saturating_sub(1)
    }

    /// The factor itself.
    pub(super) fn factor(&self) -> &Factor {
        &self.factor
    }

    /// `X ← (W − sA)⁻¹X`: a row for each vertex, in the factor's ordering.
    pub(super) fn solve<const C: usize>(&self, x: &mut [[f64; C]]) {
        self.factor.solve(x);
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::mesh::Mesh;
    use crate::spectrum::eigenbasis::Eigenbasis;

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
            assert_solves::<3>(&laplacian, shift);
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
