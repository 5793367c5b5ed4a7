//! A map between the low ends of two spectra: fitted to point maps, and judged by those it gives.

use faer::{Mat, MatRef, Scale};

use super::sampled::{Sampled, Width};
use crate::algebra::closest::closest;
use crate::algebra::dense;
use crate::error::{Result, System};
use crate::matching::problem::pair::{Coverage, Mirror, Pair, Part};
use crate::matching::problem::point_map::PointMaps;
use crate::matching::problem::which::Which;
use crate::matching::search::settings::CANDIDATE;
use crate::mesh::numbering::Sample;
use crate::shape::gradients::orientation;

/// Eigenfunctions of the finished candidates.
pub const CANDIDATE_SIZE: usize = 24;

/// A map between the low ends of two spectra, with its images on the samples.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// `(kₛ, kₜ)`: target coefficients → source coefficients, so that Φₛ C ≈ Φₜ at matched points.
    pub matrix: Mat<f64>,
    /// Images of either shape's asking samples among the samples of the other.
    pub images: PointMaps<Vec<Sample>>,
    /// Geodesic distortion times the root of the descriptor mismatch.
    pub energy: f64,
    /// Orientation score, negative for a mirrored map; 1 where there are too few eigenfunctions to tell.
    pub orientation: f64,
    /// Energy raised where the orientation is doubtful: by this the beam is ordered.
    pub rank: f64,
}

impl Candidate {
    /// The inverse map.
    #[must_use]
    pub fn inverse(self) -> Self {
        Self {
            matrix: self.matrix.transpose().to_owned(),
            images: self.images.inverse(),
            ..self
        }
    }
}

/// Everything of a pair that the search reads, on the samples only.
#[derive(Debug)]
pub struct SampledPair<'a> {
    pub(super) pair: Pair<'a>,
    pub(super) width: Width,
    pub(super) side_target: Sampled,
    pub(super) side_source: Sampled,
    /// Of the source's basis at its asking samples.
    source_gram: Mat<f64>,
}

impl<'a> SampledPair<'a> {
    /// Gathers the samples of both shapes.
    #[must_use]
    pub fn new(pair: Pair<'a>, width: Width) -> Self {
        let (side_target, side_source) = rayon::join(
            || Sampled::new(&pair, Which::Target, width),
            || Sampled::new(&pair, Which::Source, width),
        );
        let asking = side_source.basis.get(..side_source.asking, ..);
        let source_gram = gram(asking.get(.., ..CANDIDATE_SIZE.min(asking.ncols())));
        Self {
            pair,
            width,
            side_target,
            side_source,
            source_gram,
        }
    }

    /// Eigenfunctions of the finished candidates.
    pub(super) fn largest(&self) -> usize {
        CANDIDATE_SIZE
            .min(self.side_source.basis.ncols())
            .min(self.side_target.basis.ncols())
    }

    /// Point maps of a matrix.
    pub(super) fn images(&self, matrix: MatRef<'_, f64>) -> PointMaps<Vec<Sample>> {
        let (ks, kt) = (matrix.nrows(), matrix.ncols());
        let target = self.side_target.single.get(.., ..kt);
        let turned = dense::product(self.side_source.basis.get(.., ..ks), matrix);
        let source = dense::in_single(turned.as_ref());
        let (on_source, on_target) = rayon::join(
            || {
                closest(
                    target.get(..self.side_target.asking, ..),
                    source.as_ref(),
                    Some(&self.side_source.fixed),
                    1.0 / kt as f32,
                )
            },
            || {
                closest(
                    source.get(..self.side_source.asking, ..),
                    target,
                    Some(&self.side_target.fixed),
                    1.0 / kt as f32,
                )
            },
        );
        PointMaps {
            target_to_source: Sample::each(on_source),
            source_to_target: Sample::each(on_target),
        }
    }

    /// Point maps and energy of a matrix.
    pub(super) fn judged(&self, matrix: Mat<f64>) -> Candidate {
        let ks = matrix.nrows();
        let images = self.images(matrix.as_ref());
        let on_source = &images.target_to_source;
        let energy = self.energy(images.as_slices());
        let is_oriented = ks >= CANDIDATE.oriented_from.min(self.largest());
        let orientation = if self.pair.uses(Part::Orientation) && is_oriented {
            let pairs = on_source.iter().enumerate();
            let measured = orientation(
                &self.side_source.gradients,
                &self.side_target.gradients,
                matrix.as_ref(),
                pairs.map(|(asking, image)| (image.index(), asking)),
                CANDIDATE.orientation_functions,
            );
            self.wanted_sign() * measured
        } else {
            1.0
        };
        Candidate {
            matrix,
            orientation,
            rank: energy
                * (CANDIDATE.orientation_offset
                    - if !on_source.is_empty() && ks >= CANDIDATE.oriented_from {
                        orientation
                    } else {
                        0.0
                    }),
            images,
            energy,
        }
    }

    /// Which orientation is looked for.
    pub(super) fn wanted_sign(&self) -> f64 {
        if self.pair.mirror == Mirror::Only {
            -1.0
        } else {
            1.0
        }
    }

    /// Fit at k from a candidate's point maps, with new point maps.
    pub(super) fn refitted(&self, candidate: &Candidate, k: usize) -> Result<Candidate> {
        self.fitted(candidate.images.as_slices(), k)
    }

    /// Fit at k from point maps, with new point maps.
    pub(super) fn fitted(&self, maps: PointMaps<&[Sample]>, k: usize) -> Result<Candidate> {
        Ok(self.judged(self.fit(maps, k)?))
    }

    /// Fit at k from point maps.
    pub(super) fn fit(&self, maps: PointMaps<&[Sample]>, k: usize) -> Result<Mat<f64>> {
        let bases = SampledBases {
            target: self.side_target.basis.as_ref(),
            source: self.side_source.basis.as_ref(),
            source_gram: self.source_gram.as_ref(),
        };
        fit(bases, maps, self.pair.coverage, k)
    }

    /// Root mean square change of distances between samples, times the root of the mean
    /// descriptor mismatch.
    fn energy(&self, maps: PointMaps<&[Sample]>) -> f64 {
        let distortion = self.pair.coverage.mean(
            self.side_target
                .distortion(maps.source_to_target, &self.side_source),
            self.side_source
                .distortion(maps.target_to_source, &self.side_target),
        );
        let mismatch = self.pair.coverage.mean(
            self.side_target.mean_mismatch(maps.source_to_target),
            self.side_source.mean_mismatch(maps.target_to_source),
        );
        let distortion = if self.pair.uses(Part::Geodesic) {
            distortion
        } else {
            1.0
        };
        (distortion * mismatch).sqrt()
    }

    /// Mean distance between points and their images, of a map of a shape to itself.
    pub(super) fn moves(&self, map: &Candidate) -> f64 {
        let on_source = &map.images.target_to_source;
        let distances = &self.side_source.distances;
        let sum: f64 = (on_source.iter().enumerate())
            .map(|(i, &j)| f64::from(distances[(i, j.index())]))
            .sum();
        sum / on_source.len() as f64
    }

    /// Mean distance on the source between the images of two candidates.
    pub(super) fn apart(&self, a: &Candidate, b: &Candidate) -> f64 {
        let [a, b] = [a, b].map(|candidate| &candidate.images.target_to_source);
        let distances = &self.side_source.distances;
        let sum: f64 = (a.iter().zip(b))
            .map(|(&p, &q)| f64::from(distances[(p.index(), q.index())]))
            .sum();
        sum / a.len() as f64
    }
}

/// Bases of both shapes at their samples.
#[derive(Debug, Clone, Copy)]
pub struct SampledBases<'a> {
    /// The target's, `(s, k)`.
    pub target: MatRef<'a, f64>,
    /// The source's, `(s, k)`.
    pub source: MatRef<'a, f64>,
    /// [`gram`] of the latter's rows that ask.
    pub source_gram: MatRef<'a, f64>,
}

/// `BᵀB`.
#[must_use]
pub fn gram(basis: MatRef<'_, f64>) -> Mat<f64> {
    dense::product(basis.transpose(), basis)
}

/// Bijective least squares: C with Φₛ C ≈ Φₜ at the pairs of both point maps.
///
/// The maps are those of the first samples of either shape to samples of the other. Returns `(k, k)`.
///
/// # Errors
/// [`crate::Error::NotFactorised`] when the pairs do not determine the map.
pub fn fit(
    bases: SampledBases<'_>,
    maps: PointMaps<&[Sample]>,
    coverage: Coverage,
    k: usize,
) -> Result<Mat<f64>> {
    let SampledBases {
        target,
        source,
        source_gram,
    } = bases;
    let (first, second) = (maps.target_to_source.len(), maps.source_to_target.len());
    let ((mut gram, mut right), by_source) = rayon::join(
        || {
            let answers = dense::gather_rows(source, maps.target_to_source, k);
            let asked = target.get(..first, ..k);
            let right = dense::product(answers.transpose(), asked);
            (gram(answers.as_ref()), right)
        },
        || {
            let answers = dense::gather_rows(target, maps.source_to_target, k);
            dense::product(source.get(..second, ..k).transpose(), answers.as_ref())
        },
    );
    gram *= Scale(coverage.target);
    gram += Scale(coverage.source) * source_gram.get(..k, ..k);
    right *= Scale(coverage.target);
    right += Scale(coverage.source) * by_source;
    dense::solve_with_ridge(
        System::Map,
        gram,
        |_| CANDIDATE.fit_ridge * first as f64,
        right.as_ref(),
    )
}
