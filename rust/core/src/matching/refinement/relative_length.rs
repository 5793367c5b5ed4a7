//! How long the unit of one shape is on the other, of which it may be a part.
//!
//! Every shape has unit area here. Where one is cut off the other its lengths are then too large, and its
//! k-th eigenfunction is not the k-th of the whole; a first map tells by how much.

use crate::matching::problem::pair::{Coverage, Pair};
use crate::matching::problem::point_map::{PointMap, PointMaps, SampledMap};
use crate::matching::refinement::settings::RELATIVE_LENGTH;

/// Units of length of the source that one of the target is by a map between them: the median over
/// distances at samples; 1 unless it shows that the smaller shape is an open surface.
///
/// The images are those of every vertex.
#[must_use]
pub fn relative_length(pair: &Pair<'_>, maps: PointMaps<&[u32]>) -> f64 {
    let by_target = || median_growth(pair.to_source(maps.target_to_source));
    let by_source = || 1.0 / median_growth(pair.to_target(maps.source_to_target));
    let (target_is_open, source_is_open) = (pair.target.mesh.is_open(), pair.source.mesh.is_open());
    if !target_is_open && !source_is_open {
        return 1.0;
    }
    let length = match pair.coverage {
        Coverage::TARGET_IS_PART => by_target(),
        Coverage::SOURCE_IS_PART => by_source(),
        _ => {
            let (by_target, by_source) = rayon::join(by_target, by_source);
            (by_target * by_source).sqrt()
        }
    };
    if (length < RELATIVE_LENGTH.equal_from && target_is_open)
        || (length > 1.0 / RELATIVE_LENGTH.equal_from && source_is_open)
    {
        length
    } else {
        1.0
    }
}

/// [`growth_at_samples`] by the images of all vertices.
fn median_growth(map: PointMap<'_>) -> f64 {
    let samples = map.from.farthest_points(RELATIVE_LENGTH.samples).iter();
    let images: Vec<u32> = samples.map(|&v| map.image(v)).collect();
    growth_at_samples(SampledMap {
        from: map.from,
        to: map.to,
        images: &images,
    })
}

/// Median of the distance between images over that between samples; 1 where there is none to compare.
#[must_use]
pub fn growth_at_samples(map: SampledMap<'_>) -> f64 {
    let samples = map
        .from
        .farthest_points(RELATIVE_LENGTH.samples.min(map.images.len()));
    let images = &map.images[..samples.len()];
    let here = map.from.spectral_distances(samples, samples);
    let there = map.to.spectral_distances(images, images);
    let mut growths: Vec<f64> = (0..samples.len())
        .flat_map(|j| (0..j).map(move |i| (i, j)))
        .filter(|&at| RELATIVE_LENGTH.compared.contains(&here[at]))
        .map(|at| there[at] / here[at])
        .filter(|growth| *growth > 0.0)
        .collect();
    let middle = growths.len() / 2;
    if growths.is_empty() {
        1.0
    } else {
        *growths.select_nth_unstable_by(middle, f64::total_cmp).1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matching::problem::constraints::Constraints;
    use crate::shape::Shape;
    use crate::testing::{RINGS, pair, torus};

    fn found(
        source: &Shape,
        target: &Shape,
        coverage: Coverage,
        image: impl Fn(u32) -> u32,
    ) -> f64 {
        let constraints = Constraints::default();
        let pair = pair(source, target, coverage, &constraints);
        let images = |own: &Shape, other: &Shape| -> Vec<u32> {
            let last = other.mesh.vertices.len() as u32 - 1;
            (0..own.mesh.vertices.len() as u32)
                .map(|v| image(v).min(last))
                .collect()
        };
        let maps = PointMaps {
            target_to_source: images(target, source),
            source_to_target: images(source, target),
        };
        relative_length(&pair, maps.as_slices())
    }

    #[test]
    fn a_part_is_known_by_its_lengths() {
        // Vertices of the part are the first of the whole.
        let (whole, part) = (torus(RINGS), torus(32));
        let truth = part.unit / whole.unit;
        assert!(truth < 0.85);
        // Spectral distances are about 2 % off.
        let as_target = found(&whole, &part, Coverage::TARGET_IS_PART, |v| v);
        assert!(
            (as_target / truth - 1.0).abs() < 0.02,
            "{as_target} {truth}"
        );
        let as_source = found(&part, &whole, Coverage::SOURCE_IS_PART, |v| v);
        assert!(
            (as_source * truth - 1.0).abs() < 0.02,
            "{as_source} {truth}"
        );
    }

    #[test]
    fn a_closed_surface_is_no_part_even_if_a_map_crowds_it() {
        let whole = torus(RINGS);
        let crowded: Vec<u32> = (0..whole.mesh.vertices.len() as u32)
            .map(|v| v / 3)
            .collect();
        let map = PointMap {
            from: &whole,
            to: &whole,
            images: &crowded,
        };
        assert!(median_growth(map) < RELATIVE_LENGTH.equal_from);
        let length = found(&whole, &whole, Coverage::TARGET_IS_PART, |v| v / 3);
        assert!((length - 1.0).abs() < f64::EPSILON);
    }
}
