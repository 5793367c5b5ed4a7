//! Figures by which a whole map is judged, from the images of some samples.

use faer::{Mat, MatRef, Scale};

use crate::descriptors::DETAIL_CURVATURES;
use crate::orientation::{FUNCTIONS, TangentGradients, orientation};
use crate::pair::{Pair, Part, Shares};
use crate::refinement::embedded_surface::Refined;
use crate::shape::{JUDGED, Shape};

/// Eigenfunctions of the orientation test at 60.
const ORIENTATION_FUNCTIONS: usize = 24;
/// Weight of the orientation in the score and in the rank: a perfect one is 1.
pub(super) const ORIENTATION_OFFSET: (f64, f64) = (1.2, 1.5);
/// Root of what agreement of curvatures leaves of the rank: a perfect one is 1.
const DISAGREEMENT_OFFSET: f64 = 1.05;
/// Distortions that differ by less are equal: spectral distances are about 2 % off.
const DISTORTION_NOISE: f64 = 2e-3;
/// Added to the power of weighted curvatures: that of a sphere's sampling noise.
const CURVATURE_FLOOR: f64 = 1e-5;
/// Distances below this are compared for the grade; long ones differ between right maps too.
const LOCAL: f64 = 0.35;

/// Figures by which a whole map is judged.
#[derive(Debug, Clone, Copy, Default)]
pub struct Figures {
    /// Orientation after the short refinement, in [−1, 1].
    pub orientation: f64,
    /// Mean change of distances below 0.35 √area.
    pub local_distortion: f64,
    /// How far the unguided map contradicts what is known: Σ (d/0.1)² over landmarks missed by d,
    /// 4 (1 − the correlation of both shapes' coordinates) when these are in one frame, and (d/0.06)²
    /// when points and their images lie d closer to the plane of symmetry on one shape.
    pub contradiction: f64,
    /// Rank of the best other map over that of the chosen one, at most 2.
    pub margin: f64,
    /// Mean distance from the images of the chosen map, √area; 0 for the chosen map itself.
    pub apart: f64,
    /// Mean correlation of the curvatures of both shapes at matched points.
    pub agreement: f64,
    /// How much worse the best direct map would be than the best mirrored one, 1 and below when
    /// it is not.
    pub mirrored_gain: f64,
    /// Share of the target's area at which a completed map tears the surface: images of neighbours lie farther apart.
    pub torn: f64,
}

impl Figures {
    /// By this candidates are ordered, the smaller the better: what the map does to the surface, raised
    /// where it contradicts what is known.
    #[must_use]
    pub fn rank(&self) -> f64 {
        self.surface_rank() * (1.0 + self.contradiction)
    }

    /// How far short distances change, raised where the surface turns over and where curvatures do not
    /// agree.
    #[must_use]
    pub fn surface_rank(&self) -> f64 {
        (self.local_distortion + DISTORTION_NOISE)
            * (ORIENTATION_OFFSET.1 - self.orientation)
            * (DISAGREEMENT_OFFSET - self.agreement).sqrt()
    }
}

/// Orientation of a map over the judging samples of the target, or of a source that is a part, and their images.
pub(super) fn orientation_of(
    pair: &Pair<'_>,
    matrix: MatRef<'_, f64>,
    on_source: &[u32],
    on_target: &[u32],
) -> f64 {
    if !pair.uses(Part::Orientation) {
        return 1.0;
    }
    let (here, there) = if pair.shares == Shares::SOURCE_IS_PART {
        (on_target, judging(pair.source))
    } else {
        (judging(pair.target), on_source)
    };
    // Low functions of a part are made of many of the whole.
    let functions = if pair.knows_lengths() {
        FUNCTIONS.max(matrix.nrows())
    } else {
        FUNCTIONS
    };
    let (on_target, on_source) = rayon::join(
        || TangentGradients::new(pair.target, here, functions),
        || TangentGradients::new(pair.source, there, functions),
    );
    orientation(
        &on_target,
        &on_source,
        matrix,
        (0..here.len()).map(|i| (i, i)),
        ORIENTATION_FUNCTIONS,
    )
}

/// Source vertices of the target's farthest-point samples, and target vertices of the source's: drawn vertices that
/// ask begin with the samples.
#[must_use]
pub fn sampled_images(map: &Refined<'_>) -> [Vec<u32>; 2] {
    [map.target(), map.source()].map(|side| {
        let (samples, images) = (&side.shape.farthest, &side.images.vertex);
        if side.asking.starts_with(samples) {
            images[..samples.len()].to_vec()
        } else {
            samples.iter().map(|&v| images[v as usize]).collect()
        }
    })
}

/// Of the images of all samples those of the samples on which maps are judged.
pub(super) fn of_judged(images: &[u32]) -> &[u32] {
    &images[..JUDGED.min(images.len())]
}

/// The samples on which maps are judged.
#[must_use]
pub fn judging(shape: &Shape) -> &[u32] {
    shape.farthest_points(JUDGED)
}

/// Orientation and local distortion of a map, given the images of both shapes' farthest-point samples.
#[must_use]
pub fn figures(pair: &Pair<'_>, matrix: MatRef<'_, f64>, images: &[Vec<u32>; 2]) -> Figures {
    let (target, source) = (pair.target, pair.source);
    let [on_source, on_target] = images.each_ref().map(|images| of_judged(images));
    // In the unit of the shape that asks, so that a part gains nothing by being taken for a smaller one.
    let change = |a: &Shape, unit: f64, b: &Shape, images: &[u32]| {
        let there = Scale(1.0 / unit) * b.spectral_distances(images, images);
        mean_change(&a.between_judged, &there, LOCAL)
    };
    let (orientation, (here, there)) = rayon::join(
        || orientation_of(pair, matrix, on_source, on_target),
        || {
            rayon::join(
                || change(target, pair.lengths, source, on_source),
                || change(source, 1.0 / pair.lengths, target, on_target),
            )
        },
    );
    Figures {
        orientation,
        local_distortion: if pair.uses(Part::Geodesic) {
            pair.shares.mean(here, there)
        } else {
            0.0
        },
        agreement: agreement(pair, images),
        ..Figures::default()
    }
}

/// How well the curvatures of both shapes [agree](Figures::agreement), given the images of their farthest-point samples.
#[must_use]
pub fn agreement(pair: &Pair<'_>, images: &[Vec<u32>; 2]) -> f64 {
    let (target, source) = (pair.target, pair.source);
    let [on_source, on_target] = images.each_ref().map(|images| of_judged(images));
    pair.shares.mean(
        curvature_agreement(target, judging(target), source, on_source),
        curvature_agreement(source, judging(source), target, on_target),
    )
}

/// Mean correlation over the smoothing scales between one shape's curvature at some vertices and the
/// other's at their images; 0 for shapes without features.
fn curvature_agreement(asking: &Shape, vertices: &[u32], answering: &Shape, images: &[u32]) -> f64 {
    let (own, there) = (&asking.descriptors.detail, &answering.descriptors.detail);
    let count = vertices.len() as f64;
    let correlation = |scale: usize| {
        let here = |i: usize| f64::from(own[(vertices[i] as usize, scale)]);
        let image = |i: usize| f64::from(there[(images[i] as usize, scale)]);
        let mean =
            |value: &dyn Fn(usize) -> f64| (0..vertices.len()).map(value).sum::<f64>() / count;
        let (mean_here, mean_image) = (mean(&here), mean(&image));
        let covariance = mean(&|i| (here(i) - mean_here) * (image(i) - mean_image));
        let power_here = mean(&|i| (here(i) - mean_here).powi(2));
        let power_image = mean(&|i| (image(i) - mean_image).powi(2));
        covariance / ((power_here * power_image).sqrt() + CURVATURE_FLOOR)
    };
    (0..DETAIL_CURVATURES).map(correlation).sum::<f64>() / DETAIL_CURVATURES as f64
}

/// Mean |a − b| over pairs whose first distance is below the limit.
pub(super) fn mean_change(a: &Mat<f64>, b: &Mat<f64>, limit: f64) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for j in 0..a.ncols() {
        for i in 0..a.nrows() {
            if i != j && a[(i, j)] < limit {
                sum += (a[(i, j)] - b[(i, j)]).abs();
                count += 1.0;
            }
        }
    }
    sum / f64::max(count, 1.0)
}
