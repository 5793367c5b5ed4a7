//! The lowest eigenpairs in slices of the spectrum, each from a Krylov space of its own.
//!
//! Orthogonalisation grows with the square of a space's size: two spaces for half of the spectrum each cost less than
//! one for all, and are built side by side.
//!
//! # Source
//! Grimes, Lewis, Simon, "A shifted block Lanczos algorithm for solving sparse symmetric generalized eigenproblems",
//! 1994. Where we part: the border between two slices is a shift whose factor counts what lies below, and what
//! residuals leave between eigenvectors of two slices is removed.

use std::f64::consts::PI;

use faer::Col;

use super::lanczos::{BlockLanczos, RitzPairs};
use super::orthogonal::{orthonormalise, remove};
use super::shifted_factor::{Pattern, ShiftedFactor};
use crate::error::{Error, Result};

/// Fewer eigenpairs are found in one slice: two would take more solves than they save elsewhere. A shape has 150, and two
/// shapes are mostly prepared side by side, so that no core is left for a second slice.
const LEAST_SLICED: usize = 180;

/// Size of the space needed for a hundred pairs more, and for none: measured at 4 to 300 pairs. A block too many costs
/// less than to look again.
const LOWEST: [usize; 2] = [150, 50];
/// The same for pairs from the midst of the spectrum.
const INNER: [usize; 2] = [160, 96];

/// The shift lies where this fraction of the wanted eigenvalues is below it. Krylov spaces then find both ends equally
/// late, at 5k vertices and k = 200 with 400 vectors instead of 600 for a shift below the spectrum.
const LOWEST_BELOW: f64 = 0.62;
/// The same in the midst of the spectrum.
const INNER_BELOW: f64 = 0.5;

/// How far from its place, in fractions of the wanted eigenvalues, a shift may end.
const TOLERANCE: f64 = 0.08;

/// Factorisations tried to place the shift.
const TRIALS: usize = 6;

/// A shift whose factor is inaccurate is replaced by this multiple.
const STEP_ASIDE: f64 = 0.97;

/// A shift that is nearer to an eigenvalue than this fraction of their spacing is moved by the other: rounding grows with
/// the largest eigenvalue of the inverse, and one of 160 poses of people missed the bound on residuals.
const TOO_NEAR: f64 = 0.01;
const ASIDE: f64 = 0.3;

/// Eigenvectors of two slices meet at the residual over the distance of their eigenvalues. Where that is more than
/// this, removing it leaves those of one slice no longer orthogonal to each other, and they are made so again.
const SMALL_OVERLAP: f64 = 1e-7;
/// Where it is more than this, eigenvalues on both sides of the border were not told apart.
const MOST_OVERLAP: f64 = 1e-2;

/// Consecutive eigenvalues; zero is not counted.
pub(super) struct Slice {
    /// Eigenvalues below the slice.
    pub(super) first: usize,
    /// Eigenvalues below its end.
    pub(super) end: usize,
    /// Between the last eigenvalue below the slice and its first.
    pub(super) from: f64,
    /// Between its last eigenvalue and the next, where that is known.
    pub(super) to: Option<f64>,
}

impl Slice {
    /// So many eigenvalues above zero.
    pub(super) fn lowest(count: usize) -> Self {
        Self {
            first: 0,
            end: count,
            from: 0.0,
            to: None,
        }
    }

    /// How many eigenvalues it has.
    pub(super) fn count(&self) -> usize {
        self.end - self.first
    }

    /// Size of the space at which convergence is first looked at.
    pub(super) fn expected_size(&self) -> usize {
        let [per_hundred, least] = if self.first == 0 { LOWEST } else { INNER };
        self.count() * per_hundred / 100 + least
    }

    /// A factor whose shift lies in the slice, if eigenvalues are about `spacing` apart.
    pub(super) fn factor<'a>(
        &self,
        pattern: &'a Pattern<'a>,
        spacing: f64,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<ShiftedFactor<'a>> {
        let below = if self.first == 0 {
            LOWEST_BELOW
        } else {
            INNER_BELOW
        };
        let target = self.first as f64 + below * self.count() as f64;
        factor_near(target, self.count(), pattern, spacing, cancelled)
    }
}

/// What all slices have in common. Vertices are in the factors' ordering.
pub(super) struct Spectrum<'a> {
    pattern: &'a Pattern<'a>,
    /// Diagonal of `A^{1/2}`.
    pub(super) root_mass: Vec<f64>,
    /// Unit eigenvector of zero.
    constant: Col<f64>,
    /// About how far apart eigenvalues are.
    spacing: f64,
    /// Bound on residuals, as a fraction of the largest eigenvalue of a slice.
    bound: f64,
    cancelled: &'a (dyn Fn() -> bool + Sync),
}

impl<'a> Spectrum<'a> {
    pub(super) fn new(
        pattern: &'a Pattern<'a>,
        mass: &[f64],
        bound: f64,
        cancelled: &'a (dyn Fn() -> bool + Sync),
    ) -> Self {
        let area: f64 = mass.iter().sum();
        let root_mass: Vec<f64> = pattern.mass().map(f64::sqrt).collect();
        Self {
            pattern,
            constant: Col::from_fn(root_mass.len(), |i| root_mass[i] / area.sqrt()),
            root_mass,
            spacing: weyl_spacing(area),
            bound,
            cancelled,
        }
    }

    /// The lowest `wanted` eigenpairs above zero, in one or more parts, ascending.
    pub(super) fn lowest(&self, wanted: usize) -> Result<Vec<RitzPairs>> {
        if wanted >= LEAST_SLICED {
            match self.lowest_in_slices(wanted) {
                Ok(Some(parts)) => return Ok(parts),
                // Where a border falls among copies of an eigenvalue, all are found at once.
                Ok(None) | Err(Error::NotConverged { .. } | Error::NotFactorised { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(vec![self.pairs(&Slice::lowest(wanted), self.spacing)?])
    }

    /// The same in two slices that need spaces of equal sizes; none where they cannot be told apart.
    fn lowest_in_slices(&self, wanted: usize) -> Result<Option<Vec<RitzPairs>>> {
        let [[low, least_low], [inner, least_inner]] = [LOWEST, INNER];
        let target = (100 * (least_inner - least_low) + inner * wanted) / (low + inner);
        let factor = factor_near(
            target as f64,
            target,
            self.pattern,
            self.spacing,
            self.cancelled,
        )?;
        let (border, below) = (factor.shift(), factor.eigenvalues_below().saturating_sub(1));
        if !(1..wanted).contains(&below) {
            return Ok(None);
        }
        let lower = Slice {
            to: Some(border),
            ..Slice::lowest(below)
        };
        let upper = Slice {
            first: below,
            from: border,
            ..Slice::lowest(wanted)
        };
        let spacing = border / below as f64;
        let (lower, upper) = rayon::join(
            || self.pairs(&lower, spacing),
            || self.pairs(&upper, spacing),
        );
        let (lower, mut upper) = (lower?, upper?);
        let known = lower.vectors.as_ref();
        let half = upper.vectors.ncols() / 2;
        let (some, others) = upper.vectors.as_mut().split_at_col_mut(half);
        let (some, others) = rayon::join(|| remove(some, known), || remove(others, known));
        let overlap = some.norm_max().max(others.norm_max());
        if overlap > MOST_OVERLAP {
            return Ok(None);
        }
        if overlap > SMALL_OVERLAP {
            orthonormalise(upper.vectors.as_mut(), lower.vectors.as_ref());
        }
        Ok(Some(vec![lower, upper]))
    }

    /// Those of a slice.
    fn pairs(&self, slice: &Slice, spacing: f64) -> Result<RitzPairs> {
        let factor = slice.factor(self.pattern, spacing, self.cancelled)?;
        let size = slice.expected_size();
        BlockLanczos::new(&factor, &self.root_mass, self.constant.as_ref(), size).run(
            slice,
            self.bound,
            self.cancelled,
        )
    }
}

/// Distance of eigenvalues far from zero: Weyl's `λ_j ≈ 4πj/area`.
pub(super) fn weyl_spacing(area: f64) -> f64 {
    4.0 * PI / area
}

/// Factor of `W − sA` where about `target` eigenvalues above zero are below `s`, [to a fraction](TOLERANCE) of the `wanted`.
///
/// Starts from where they would be at equal distances, and corrects by the count.
fn factor_near<'a>(
    target: f64,
    wanted: usize,
    pattern: &'a Pattern<'a>,
    spacing: f64,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<ShiftedFactor<'a>> {
    let tolerance = (TOLERANCE * wanted as f64).max(2.0);
    let mut shift = spacing * target.max(0.5);
    for trial in 1..=TRIALS {
        if cancelled() {
            return Err(Error::Cancelled);
        }
        let Some(factor) = pattern.factor(shift) else {
            shift *= STEP_ASIDE;
            continue;
        };
        let below = factor.eigenvalues_below() as f64;
        // A shift off its best place only costs solves.
        if (below - target).abs() > tolerance && trial + 2 <= TRIALS {
            shift *= (target / below.max(1.0)).clamp(0.25, 4.0);
        } else if trial < TRIALS && factor.nearest_eigenvalue() < TOO_NEAR * spacing {
            shift += ASIDE * spacing;
        } else {
            return Ok(factor);
        }
    }
    Err(Error::NotFactorised {
        reason: format!("no accurate factor for {TRIALS} shifts up to {shift:.3}"),
    })
}

#[cfg(test)]
mod tests {
    use super::super::shifted_factor::tests::laplacian;
    use super::super::{Eigenbasis, RESIDUAL_BOUND, SAFETY};
    use super::*;

    #[test]
    fn a_shift_on_an_eigenvalue_is_moved() {
        let laplacian = laplacian();
        let pattern = Pattern::new(&laplacian).unwrap();
        let values = Eigenbasis::new(&laplacian, 12, &|| false).unwrap().values;
        // The first shift tried is their product.
        let (target, spacing) = (10.0, values[10] * (1.0 + 1e-9) / 10.0);
        let factor = factor_near(target, 30, &pattern, spacing, &|| false).unwrap();
        assert!(factor.nearest_eigenvalue() > TOO_NEAR * spacing);
        // The constant is below it too.
        let below = factor.eigenvalues_below() as f64 - 1.0;
        assert!((below - target).abs() <= TOLERANCE * 30.0, "{below}");
    }

    #[test]
    fn two_slices_are_the_spectrum_found_at_once() {
        const WANTED: usize = 140;
        let laplacian = laplacian();
        let pattern = Pattern::new(&laplacian).unwrap();
        let bound = SAFETY * RESIDUAL_BOUND;
        let spectrum = Spectrum::new(&pattern, &laplacian.mass, bound, &|| false);
        let slices = spectrum.lowest_in_slices(WANTED).unwrap();
        let slices = slices.expect("told apart");
        assert_eq!(slices.len(), 2);
        let whole = spectrum
            .pairs(&Slice::lowest(WANTED), spectrum.spacing)
            .unwrap();
        let values: Vec<f64> = slices.iter().flat_map(|part| part.values.clone()).collect();
        assert_eq!(values.len(), WANTED);
        let largest = values[WANTED - 1];
        for (a, b) in values.iter().zip(&whole.values) {
            // Errors are of the order of residuals squared; the rest is rounding.
            assert!((a - b).abs() <= 1e-12 * largest, "{a} {b}");
        }
        let overlap = slices[0].vectors.transpose() * &slices[1].vectors;
        // Rounding of sums of 576 products.
        assert!(overlap.norm_max() < 1e-13, "{}", overlap.norm_max());
        // Two from some number on, below it one.
        let parts = |wanted: usize| spectrum.lowest(wanted).unwrap().len();
        assert_eq!([parts(LEAST_SLICED - 1), parts(LEAST_SLICED)], [1, 2]);
    }
}
