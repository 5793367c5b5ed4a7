//! Metrics by which a whole map is judged, from the images of some samples.

use std::sync::Arc;

use faer::{Mat, MatRef, Scale};

use crate::matching::problem::pair::{Coverage, Pair, Part};
use crate::matching::problem::point_map::{PointMaps, SampledMap};
use crate::matching::ranking::settings::METRICS;
use crate::matching::refinement::embedded_surface::Refined;
use crate::matching::refinement::side::Side;
use crate::mesh::boundary;
use crate::shape::Shape;
use crate::shape::descriptors::{DETAIL_CURVATURES, Descriptors, HEAT_TIMES};
use crate::shape::gradients::{TangentGradients, orientation};
use crate::shape::settings::{GRADIENTS, SHAPE};

/// Metrics by which a whole map is judged.
#[derive(Debug, Clone, Copy, Default)]
pub struct Metrics {
    /// Orientation after the short refinement, in [−1, 1].
    pub orientation: f64,
    /// Mean change of distances below 0.35 √area.
    pub local_distortion: f64,
    /// How far the unguided map contradicts what is known: Σ (d/0.1)² over landmarks missed by d,
    /// 4 (1 − the correlation of both shapes' coordinates) when these are in one frame, and (d/0.06)²
    /// when points and their images lie d closer to the plane of symmetry on one shape.
    pub contradiction: f64,
    /// Rank of the best other map over that of the chosen one, by [cost](Self::cost) or by
    /// [curvatures](Self::cost_by_curvatures) where that is less, at most 2.
    pub margin: f64,
    /// Mean distance from the images of the chosen map, √area; 0 for the chosen map itself.
    pub apart: f64,
    /// Mean correlation of the curvatures of both shapes at matched points.
    pub agreement: f64,
    /// Mean correlation of what [distances cannot tell](crate::shape::descriptors::Descriptors::extrinsic) of them: turned
    /// front to back, a body keeps its distances and how thin its limbs are, but not where it is hollow.
    pub extrinsic_agreement: f64,
    /// How much worse the best direct map would be than the best mirrored one, 1 and below when
    /// it is not.
    pub mirrored_gain: f64,
    /// Share of the target's area at which a completed map tears the surface: images of neighbours lie farther apart.
    pub torn: f64,
}

impl Metrics {
    /// By this candidates are ordered, the smaller the better: what the map does to the surface, raised
    /// where it contradicts what is known.
    #[must_use]
    pub fn cost(&self) -> f64 {
        self.surface_cost() * (1.0 + self.contradiction)
    }

    /// How far short distances change, raised where the surface turns over and where extrinsic looks do
    /// not agree.
    #[must_use]
    pub fn surface_cost(&self) -> f64 {
        self.cost_by(self.extrinsic_agreement)
    }

    /// The [cost](Self::cost) with the curvatures as they are in place of what distances cannot tell of them.
    #[must_use]
    pub fn cost_by_curvatures(&self) -> f64 {
        self.cost_by(self.agreement) * (1.0 + self.contradiction)
    }

    fn cost_by(&self, agreement: f64) -> f64 {
        (self.local_distortion + METRICS.distortion_noise)
            * (METRICS.orientation_offset.1 - self.orientation)
            * (METRICS.disagreement_offset - agreement).powi(2)
    }
}

/// Orientation of a map over the judging samples of the target, or of a source that is a part, and their images.
pub(super) fn orientation_of(
    pair: &Pair<'_>,
    matrix: MatRef<'_, f64>,
    maps: PointMaps<&[u32]>,
) -> f64 {
    if !pair.uses(Part::Orientation) {
        return 1.0;
    }
    let (here, there) = if pair.coverage == Coverage::SOURCE_IS_PART {
        (maps.source_to_target, judging(pair.source))
    } else {
        (judging(pair.target), maps.target_to_source)
    };
    // Low functions of a part are made of many of the whole.
    let functions = if pair.knows_lengths() {
        GRADIENTS.functions.max(matrix.nrows())
    } else {
        GRADIENTS.functions
    };
    let gradients = |shape: &Shape, vertices: &[u32]| {
        if vertices == judging(shape) && functions == GRADIENTS.functions {
            Arc::clone(shape.judged_gradients())
        } else {
            Arc::new(TangentGradients::new(shape, vertices, functions))
        }
    };
    let (on_source, on_target) = rayon::join(
        || gradients(pair.source, there),
        || gradients(pair.target, here),
    );
    orientation(
        &on_source,
        &on_target,
        matrix,
        (0..here.len()).map(|i| (i, i)),
        METRICS.orientation_functions,
    )
}

/// Vertices that are the images of both shapes' farthest-point samples: drawn vertices that ask begin with the samples.
#[must_use]
pub fn sampled_images(map: &Refined<'_>) -> PointMaps<Vec<u32>> {
    let of_samples = |side: &Side<'_>| {
        let (samples, images) = (&side.shape.farthest, &side.images.vertex);
        if side.asking.starts_with(samples) {
            images[..samples.len()].to_vec()
        } else {
            samples.iter().map(|&v| images[v as usize]).collect()
        }
    };
    PointMaps {
        target_to_source: of_samples(map.target()),
        source_to_target: of_samples(map.source()),
    }
}

/// Of the images of all samples those of the samples on which maps are judged.
pub(super) fn of_judged(images: &[u32]) -> &[u32] {
    &images[..SHAPE.judged.min(images.len())]
}

/// The samples on which maps are judged.
#[must_use]
pub fn judging(shape: &Shape) -> &[u32] {
    shape.farthest_points(SHAPE.judged)
}

/// Orientation and local distortion of a map, given the images of both shapes' farthest-point samples.
#[must_use]
pub fn metrics(pair: &Pair<'_>, matrix: MatRef<'_, f64>, images: &PointMaps<Vec<u32>>) -> Metrics {
    let (target, source) = (pair.target, pair.source);
    let maps = PointMaps {
        target_to_source: of_judged(&images.target_to_source),
        source_to_target: of_judged(&images.source_to_target),
    };
    // In the unit of the shape that asks, so that a part gains nothing by being taken for a smaller one.
    let change = |a: &Shape, unit: f64, b: &Shape, images: &[u32]| {
        let there = Scale(1.0 / unit) * b.spectral_distances(images, images);
        mean_change(&a.between_judged, &there, METRICS.local)
    };
    let (orientation, (here, there)) = rayon::join(
        || orientation_of(pair, matrix, maps),
        || {
            rayon::join(
                || change(target, pair.lengths, source, maps.target_to_source),
                || change(source, 1.0 / pair.lengths, target, maps.source_to_target),
            )
        },
    );
    Metrics {
        orientation,
        local_distortion: if pair.uses(Part::Geodesic) {
            pair.coverage.mean(there, here)
        } else {
            0.0
        },
        agreement: agreement(pair, images),
        extrinsic_agreement: correlation(pair, images, |looks| looks.extrinsic.as_ref()),
        ..Metrics::default()
    }
}

/// How well the curvatures of both shapes [agree](Metrics::agreement), given the images of their farthest-point samples.
#[must_use]
pub fn agreement(pair: &Pair<'_>, images: &PointMaps<Vec<u32>>) -> f64 {
    correlation(pair, images, |looks| {
        looks.detail.subcols(0, DETAIL_CURVATURES)
    })
}

/// Mean correlation over the smoothing scales between what both shapes look like at the samples on which maps are judged
/// and at their images; 0 for shapes without features. A sample counts the less the more of a rim is smoothed into what it
/// or its image looks like.
fn correlation(
    pair: &Pair<'_>,
    images: &PointMaps<Vec<u32>>,
    looks: impl Fn(&Descriptors) -> MatRef<'_, f32>,
) -> f64 {
    let one_way = |map: SampledMap<'_>| {
        let (asking, answering, images) = (map.from, map.to, map.images);
        let (own, there) = (looks(&asking.descriptors), looks(&answering.descriptors));
        let at = |looks: MatRef<'_, f32>, scale: usize, vertices: &[u32]| -> Vec<f64> {
            let look = |&v: &u32| f64::from(looks[(v as usize, scale)]);
            vertices.iter().map(look).collect()
        };
        let (here, images) = (judging(asking), of_judged(images));
        let correlated = |scale: usize| {
            // 1 − exp(−d²/2t), d the distance to a rim.
            let smoothed = (2.0 * HEAT_TIMES[scale]).sqrt();
            let clear = |shape: &Shape, v: u32| {
                1.0 - boundary::nearness_at(smoothed, shape.rim_nearness[v as usize])
            };
            let weights: Vec<f64> = here
                .iter()
                .zip(images)
                .map(|(&v, &image)| clear(asking, v) * clear(answering, image))
                .collect();
            correlation_of(&weights, at(own, scale, here), at(there, scale, images))
        };
        let scales = 0..own.ncols();
        scales.map(correlated).sum::<f64>() / own.ncols() as f64
    };
    pair.coverage.mean(
        one_way(pair.samples_to_target(&images.source_to_target)),
        one_way(pair.samples_to_source(&images.target_to_source)),
    )
}

/// Correlation of two weighted lists.
fn correlation_of(weights: &[f64], mut a: Vec<f64>, mut b: Vec<f64>) -> f64 {
    // Zero where all lies on rims.
    let total = weights.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    for list in [&mut a, &mut b] {
        let mean = weights.iter().zip(&*list).map(|(w, x)| w * x).sum::<f64>() / total;
        for x in list.iter_mut() {
            *x -= mean;
        }
    }
    let product = |a: &[f64], b: &[f64]| {
        let terms = weights.iter().zip(a).zip(b).map(|((w, x), y)| w * x * y);
        terms.sum::<f64>() / total
    };
    product(&a, &b) / ((product(&a, &a) * product(&b, &b)).sqrt() + METRICS.curvature_floor)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matching::problem::constraints::Constraints;
    use crate::testing::{AROUND, RINGS, pair, torus};

    /// A tube turned by half a turn around its own centre line stays as thick, with its hollow side outside.
    #[test]
    fn curvatures_tell_a_turned_tube_from_itself() {
        let (shape, constraints) = (torus(RINGS), Constraints::default());
        let pair = pair(&shape, &shape, Coverage::BOTH, &constraints);
        let half = AROUND as u32 / 2;
        let around = AROUND as u32;
        let turned = |&v: &u32| v / around * around + (v % around + half) % around;
        let agreements = |images: Vec<u32>| {
            let images = PointMaps {
                target_to_source: images.clone(),
                source_to_target: images,
            };
            let extrinsic = correlation(&pair, &images, |looks| looks.extrinsic.as_ref());
            [agreement(&pair, &images), extrinsic]
        };
        let itself = agreements(shape.farthest.clone());
        let turned = agreements(shape.farthest.iter().map(turned).collect());
        // Even the map to itself stays below 1, by what keeps flat shapes from dividing by zero. Where a turned tube bulges it is
        // hollow on itself.
        for (turned, itself) in turned.into_iter().zip(itself) {
            assert!(turned < 0.5 * itself, "{turned} of {itself}");
        }
    }

    /// A surface that was cut off is smoothed otherwise along its rims.
    #[test]
    fn looks_at_rims_do_not_count() {
        let (whole, mut part, constraints) =
            (torus(RINGS), torus(RINGS / 2), Constraints::default());
        let agreement_with_itself = |shape: &Shape| {
            let pair = pair(&whole, shape, Coverage::TARGET_IS_PART, &constraints);
            let images = PointMaps {
                target_to_source: shape.farthest.clone(),
                source_to_target: whole.farthest.clone(),
            };
            agreement(&pair, &images)
        };
        let counted = agreement_with_itself(&part);
        part.rim_nearness.fill(0.0);
        let all = agreement_with_itself(&part);
        // Counted like all others, samples at the rims of this short tube lower it by 0.05. More than half of that shows that rims are left out.
        assert!(counted > all + 0.03, "{counted} and {all}");
        assert!(agreement_with_itself(&whole) > counted);
    }
}
