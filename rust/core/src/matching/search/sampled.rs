//! One shape's samples, and what it costs to answer on them.

use std::borrow::Cow;
use std::sync::Arc;

use faer::Mat;

use crate::algebra::dense::{self, LANES, squared_distance, vectorised};
use crate::matching::problem::pair::{Pair, Part};
use crate::matching::problem::which::Which;
use crate::matching::search::settings::SAMPLED;
use crate::mesh::numbering::Sample;
use crate::shape::gradients::TangentGradients;
use crate::shape::settings::GRADIENTS;

/// How wide to search.
#[derive(Debug, Clone, Copy)]
pub struct Width {
    /// Candidates kept of the seeds.
    pub(super) first: usize,
    /// Candidates kept afterwards.
    pub(super) beam: usize,
    /// Samples whose images are sought.
    asking: usize,
    /// Samples among which they are sought.
    answering: usize,
    /// Whether the source's eigenfunctions are aligned to the target's too.
    pub(super) both_ways: bool,
}

impl Width {
    /// One candidate, to see what the search contributes.
    pub const SINGLE: Self = Self {
        first: 1,
        beam: 1,
        ..Self::USUAL
    };
    /// A first look, enough for poses of one body.
    pub const NARROW: Self = Self {
        first: 20,
        beam: 8,
        asking: 120,
        answering: 300,
        both_ways: false,
    };
    /// Enough for most pairs.
    pub const USUAL: Self = Self {
        first: 32,
        beam: 16,
        asking: 200,
        answering: 500,
        both_ways: false,
    };
    /// For pairs where the usual width finds nothing convincing.
    pub const WIDE: Self = Self {
        first: 96,
        beam: 40,
        ..Self::USUAL
    };

    /// The same from both sides, or from the target's alone.
    #[must_use]
    pub fn both_ways(self, both_ways: bool) -> Self {
        Self { both_ways, ..self }
    }
}

/// One shape's samples, and the fixed part of the cost of answering on it.
#[derive(Debug)]
pub(super) struct Sampled {
    /// Basis at the samples, `(s, k)`.
    pub(super) basis: Mat<f64>,
    /// The same in single precision.
    pub(super) single: Mat<f32>,
    /// Distances between the samples, `(s, s)`.
    pub(super) distances: Mat<f32>,
    /// Descriptor part of the squared distance, `(own samples, other's asking samples)`.
    pub(super) fixed: Mat<f32>,
    /// Mismatch of the descriptors as judged, same shape.
    mismatch: Mat<f32>,
    pub(super) gradients: Arc<TangentGradients>,
    pub(super) asking: usize,
}

impl Sampled {
    pub(super) fn new(pair: &Pair<'_>, which: Which, width: Width) -> Self {
        let opposite = which.other();
        let (own, other) = (pair.shape(which), pair.shape(opposite));
        let samples = own.farthest_points(width.answering);
        let questions = other.farthest_points(width.asking);
        let known = pair.constraints.in_search(which, own, samples);
        let asked = pair.constraints.in_search(opposite, other, questions);
        let offsets = pair.mirror_offsets.map(|[source, target]| match which {
            Which::Target => (target, source),
            Which::Source => (source, target),
        });
        let mine = own.descriptors.rows.gather(samples);
        let theirs = other.descriptors.rows.gather(questions);
        let basis = dense::gather_rows(
            own.basis.functions.as_ref(),
            samples,
            own.distance_operator.nrows(),
        );
        let is_judged = samples.len() == own.between_judged.nrows();
        let distances = if is_judged {
            Cow::Borrowed(&own.between_judged)
        } else {
            Cow::Owned(own.spectral_distances(samples, samples))
        };
        let mut without_diagonal = dense::in_single(distances.as_ref().as_ref());
        without_diagonal.diagonal_mut().fill(0.0);
        let waves = mine.dims - 1;
        let mut to_waves = vec![0.0; mine.count()];
        let mut fixed = Mat::zeros(mine.count(), theirs.count());
        let mut mismatch = Mat::zeros(mine.count(), theirs.count());
        for j in 0..theirs.count() {
            let b = theirs.row(j);
            vectorised(
                #[inline(always)]
                || {
                    for (i, distance) in to_waves.iter_mut().enumerate() {
                        let (a, b) = (&mine.row(i)[..waves], &b[..waves]);
                        *distance = squared_distance(a, b);
                    }
                },
            );
            let fixed = fixed.col_as_slice_mut(j).iter_mut();
            let mismatch = mismatch.col_as_slice_mut(j).iter_mut();
            for (i, (fixed, mismatch)) in fixed.zip(mismatch).enumerate() {
                let bend = mine.row(i)[waves] - b[waves];
                let hinted: f32 = known
                    .col_as_slice(i)
                    .iter()
                    .zip(asked.col_as_slice(j))
                    .map(|(x, y)| (x - y) * (x - y))
                    .sum();
                let hinted = hinted
                    + offsets.map_or(0.0, |(own, other)| {
                        let change = own[samples[i] as usize] - other[questions[j] as usize];
                        (SAMPLED.offset_weight * change).powi(2)
                    });
                let (wave, bend) = if pair.uses(Part::Descriptors) {
                    (to_waves[i], bend)
                } else {
                    (1.0, 0.0)
                };
                *fixed =
                    SAMPLED.descriptor_weight * SAMPLED.descriptor_weight * (wave + bend * bend)
                        + hinted;
                *mismatch = wave.sqrt() + bend.abs() + hinted.sqrt();
            }
        }
        Self {
            distances: without_diagonal,
            single: dense::in_single(basis.as_ref()),
            basis,
            fixed,
            mismatch,
            gradients: if is_judged {
                Arc::clone(own.judged_gradients())
            } else {
                Arc::new(TangentGradients::new(own, samples, GRADIENTS.functions))
            },
            asking: own.farthest_points(width.asking).len(),
        }
    }

    /// Mean squared difference between distances of asking points and of their images here.
    pub(super) fn distortion(&self, images: &[Sample], asking: &Self) -> f64 {
        let mut sum = 0.0;
        for (j, &image) in images.iter().enumerate() {
            let here = self.distances.col_as_slice(image.index());
            let there = asking.distances.col_as_slice(j);
            // Distances are symmetric, and a point has none from itself.
            let (ids, there) = (images[..j].chunks(LANES), there.chunks(LANES));
            let mut lanes = [0f32; LANES];
            for (ids, there) in ids.zip(there) {
                for ((lane, &i), d) in lanes.iter_mut().zip(ids).zip(there) {
                    let change = here[i.index()] - d;
                    *lane += change * change;
                }
            }
            sum += f64::from(dense::sum_of_lanes(lanes));
        }
        2.0 * sum / (images.len() * images.len()) as f64
    }

    pub(super) fn mean_mismatch(&self, images: &[Sample]) -> f64 {
        let sum: f64 = images
            .iter()
            .enumerate()
            .map(|(j, &i)| f64::from(self.mismatch[(i.index(), j)]))
            .sum();
        sum / images.len() as f64
    }
}
