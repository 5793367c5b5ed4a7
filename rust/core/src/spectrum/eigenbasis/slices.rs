//! The lowest eigenpairs in slices of the spectrum, each from a Krylov space of its own.
//!
//! Orthogonalisation grows with the square of a space's size: two spaces for half of the spectrum each cost less than
//! one for all, and are built side by side.
//!
//! # Source
//! Grimes, Lewis, Simon, "A shifted block Lanczos algorithm for solving sparse symmetric generalized eigenproblems",
//! 1994. Where we part: no factor counts at the border of two slices. As many eigenvectors that are orthogonal to each
//! other as one above all of them counts are all there are; what residuals leave between those of two slices is removed.

use std::f64::consts::PI;

use faer::Col;

use super::lanczos::{BlockLanczos, RitzPairs};
use super::orthogonal::{orthonormalise, remove};
use super::shifted_factor::{Pattern, ShiftedFactor};
use super::slice::Slice;
use crate::error::{Error, Result, System};
use crate::spectrum::settings::SLICES;

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
        if wanted >= SLICES.least_sliced {
            match self.lowest_in_slices(wanted) {
                Ok(Some(parts)) => return Ok(parts),
                // Where a border falls among copies of an eigenvalue, all are found at once.
                Ok(None) | Err(Error::NotConverged { .. } | Error::NotFactorised { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(vec![self.lowest_at_once(wanted)?])
    }

    fn lowest_at_once(&self, wanted: usize) -> Result<RitzPairs> {
        let factor = lowest_factor(self.pattern, wanted, self.cancelled)?;
        self.pairs(&Slice::lowest(wanted), &factor)
    }

    /// The same in two slices that need spaces of equal sizes; none where they cannot be told apart.
    fn lowest_in_slices(&self, wanted: usize) -> Result<Option<Vec<RitzPairs>>> {
        let factor = |fraction: f64| {
            let [target, tolerance] =
                [fraction, SLICES.tolerance_of_two].map(|part| part * wanted as f64);
            factor_near(
                target,
                tolerance,
                self.pattern,
                self.spacing,
                self.cancelled,
            )
        };
        let [first, second] = SLICES.shifts;
        let (low, high) = rayon::join(|| factor(first), || factor(second));
        let (low, high) = (low?, high?);
        let [below_low, below_high] = [&low, &high].map(ShiftedFactor::pairs_below);
        let border = usize::midpoint(below_low, below_high);
        if below_low >= border || below_high >= wanted {
            return Ok(None);
        }
        let lower = Slice {
            is_followed: true,
            ..Slice::lowest(border)
        };
        let upper = Slice {
            first: border,
            ..Slice::lowest(wanted)
        };
        let (lower, upper) = rayon::join(|| self.pairs(&lower, &low), || self.pairs(&upper, &high));
        let (lower, mut upper) = (lower?, upper?);
        if !upper.none_missed || lower.values.len() + upper.values.len() != wanted {
            return Ok(None);
        }
        let known = lower.vectors.as_ref();
        let half = upper.vectors.ncols() / 2;
        let (some, others) = upper.vectors.as_mut().split_at_col_mut(half);
        let (some, others) = rayon::join(|| remove(some, known), || remove(others, known));
        let overlap = some.norm_max().max(others.norm_max());
        if overlap > SLICES.most_overlap {
            return Ok(None);
        }
        if overlap > SLICES.small_overlap {
            orthonormalise(upper.vectors.as_mut(), known);
        }
        Ok(Some(vec![lower, upper]))
    }

    /// The pairs of a slice.
    fn pairs(&self, slice: &Slice, factor: &ShiftedFactor<'_>) -> Result<RitzPairs> {
        let size = slice.expected_size(factor.pairs_below());
        BlockLanczos::new(factor, &self.root_mass, self.constant.as_ref(), size).run(
            slice,
            self.bound,
            self.cancelled,
        )
    }
}

/// Distance of eigenvalues far from zero: Weyl's `λ_j ≈ 4πj/area`.
fn weyl_spacing(area: f64) -> f64 {
    4.0 * PI / area
}

/// So many eigenvalues of a mesh as far apart as Weyl's law has them mostly take the place of `target`.
fn by_weyl(target: f64, vertices: usize) -> f64 {
    (target - SLICES.more_low - SLICES.more_high * target * target / vertices as f64).max(0.5)
}

/// The factor of the slice of the lowest `wanted` eigenvalues above zero.
pub(super) fn lowest_factor<'a>(
    pattern: &'a Pattern<'a>,
    wanted: usize,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<ShiftedFactor<'a>> {
    let spacing = weyl_spacing(pattern.mass().sum());
    let [target, tolerance] = [SLICES.shift, SLICES.tolerance].map(|part| part * wanted as f64);
    factor_near(target, tolerance, pattern, spacing, cancelled)
}

/// Factor of `W − sA` where about `target` eigenvalues above zero are below `s`; starts from where they mostly are, and
/// corrects by the count.
fn factor_near<'a>(
    target: f64,
    tolerance: f64,
    pattern: &'a Pattern<'a>,
    spacing: f64,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<ShiftedFactor<'a>> {
    let mut shift = spacing * by_weyl(target, pattern.ordering().len());
    for trial in 1..=SLICES.trials {
        if cancelled() {
            return Err(Error::Cancelled);
        }
        let Some(factor) = pattern.factor(shift) else {
            shift *= SLICES.step_aside;
            continue;
        };
        let below = factor.pairs_below() as f64;
        // A shift off its best place only costs solves.
        if (below - target).abs() > tolerance.max(SLICES.least_tolerance)
            && trial + 2 <= SLICES.trials
        {
            shift *= (target / below.max(1.0)).clamp(0.25, 4.0);
        } else if trial < SLICES.trials && factor.nearest_eigenvalue() < SLICES.too_near * spacing {
            shift += SLICES.aside * spacing;
        } else {
            return Ok(factor);
        }
    }
    Err(Error::NotFactorised {
        of: System::Laplacian,
        reason: format!(
            "no accurate factor for {} shifts up to {shift:.3}",
            SLICES.trials
        ),
    })
}

#[cfg(test)]
mod tests {
    use crate::spectrum::settings::EIGENBASIS;

    use super::super::Eigenbasis;
    use super::super::shifted_factor::tests::laplacian;
    use super::*;

    #[test]
    fn a_shift_on_an_eigenvalue_is_moved() {
        let laplacian = laplacian();
        let pattern = Pattern::new(&laplacian).unwrap();
        let values = Eigenbasis::new(&laplacian, 12, &|| false).unwrap().values;
        // The first shift tried is their product.
        let (target, tolerance) = (10.0, 2.0);
        let spacing = values[10] * (1.0 + 1e-9) / by_weyl(target, laplacian.len());
        let factor = factor_near(target, tolerance, &pattern, spacing, &|| false).unwrap();
        assert!(factor.nearest_eigenvalue() > SLICES.too_near * spacing);
        let below = factor.pairs_below() as f64;
        assert!((below - target).abs() <= tolerance, "{below}");
    }

    #[test]
    fn slices_meet_beside_copies_of_an_eigenvalue() {
        let spectrum = [1.0, 2.0, 3.0, 3.0 + 1e-12, 4.0];
        let lower = |end: usize| Slice {
            is_followed: true,
            ..Slice::lowest(end)
        };
        let upper = |first: usize| Slice {
            first,
            ..Slice::lowest(5)
        };
        for (border, meeting) in [(1, 1), (2, 2), (3, 4), (4, 4)] {
            let of = |slice: Slice| slice.within(&spectrum, [slice.first, slice.end]);
            assert_eq!(of(lower(border)), Some(0..meeting));
            assert_eq!(of(upper(border)), Some(meeting..5));
        }
        // Nothing tells where the copies end, or the last is not there yet.
        assert_eq!(lower(3).within(&spectrum[..4], [0, 3]), None);
        assert_eq!(upper(2).within(&spectrum[..4], [2, 5]), None);
    }

    #[test]
    fn two_slices_are_the_spectrum_found_at_once() {
        const WANTED: usize = 140;
        let laplacian = laplacian();
        let pattern = Pattern::new(&laplacian).unwrap();
        let bound = EIGENBASIS.safety * EIGENBASIS.residual_bound;
        let spectrum = Spectrum::new(&pattern, &laplacian.mass, bound, &|| false);
        let slices = spectrum.lowest_in_slices(WANTED).unwrap();
        let slices = slices.expect("told apart");
        assert_eq!(slices.len(), 2);
        let whole = spectrum.lowest_at_once(WANTED).unwrap();
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
        assert_eq!(
            [parts(SLICES.least_sliced - 1), parts(SLICES.least_sliced)],
            [1, 2]
        );
    }
}
