//! What the map of a part leaves over of the whole. It was cut off the part, so it begins at a rim of the part.

use crate::matching::partial::settings::UNCOVERED;
use crate::matching::problem::pair::{Pair, Part};
use crate::matching::problem::which::Which;
use crate::matching::ranking::Hypothesis;
use crate::shape::Shape;

/// Whether what a map of a part leaves over of the whole begins at rims of the part.
pub(in crate::matching) fn begins_at_boundary(
    pair: &Pair<'_>,
    part_is: Which,
    map: &Hypothesis,
) -> bool {
    if !pair.uses(Part::Uncovered) {
        return true;
    }
    let (all, elsewhere) = uncovered(
        pair.shape(part_is),
        pair.shape(part_is.other()),
        map.images.of(part_is),
    );
    elsewhere <= UNCOVERED.elsewhere_at_most.0 + UNCOVERED.elsewhere_at_most.1 * all
}

/// Coverage of the whole's samples that are left over, and that are and begin elsewhere than at the images of the part's rims,
/// given the images of the part's samples.
fn uncovered(part: &Shape, whole: &Shape, images: &[u32]) -> (f64, f64) {
    let samples = whole.farthest_points(UNCOVERED.looked_at);
    let at_rim: Vec<bool> = part
        .farthest
        .iter()
        .map(|&v| part.rim_nearness[v as usize] > UNCOVERED.at_rim)
        .collect();
    let to_images = whole.spectral_distances(images, samples);
    let nearest = |sample: usize, counts: &dyn Fn(usize) -> bool| {
        let distances = (0..images.len())
            .filter(|&i| counts(i))
            .map(|i| to_images[(i, sample)]);
        distances.fold(f64::INFINITY, f64::min)
    };
    let mut left: Vec<usize> = (0..samples.len())
        .filter(|&sample| nearest(sample, &|_| true) > UNCOVERED.farther_than)
        .collect();
    let all = left.len();
    let between = whole.spectral_distances(samples, samples);
    // Pieces grow from the rims; what they do not reach begins elsewhere.
    let mut front: Vec<usize> = left
        .extract_if(.., |&mut sample| {
            nearest(sample, &|i| at_rim[i]) < UNCOVERED.begins_within
        })
        .collect();
    while let Some(reached) = front.pop() {
        front.extend(left.extract_if(.., |&mut sample| {
            between[(reached, sample)] < UNCOVERED.of_one_piece
        }));
    }
    let share = |count: usize| count as f64 / samples.len() as f64;
    (share(all), share(left.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{AROUND, RINGS, torus};

    /// Images of a part's samples when its ring `r` of `rings` goes to the ring `to(r / (rings − 1))` of the whole.
    fn images(part: &Shape, rings: usize, to: impl Fn(f64) -> f64) -> Vec<u32> {
        let image = |&v: &u32| {
            let (ring, around) = (v as usize / AROUND, v as usize % AROUND);
            let ring = to(ring as f64 / (rings - 1) as f64).round() as usize;
            (ring * AROUND + around) as u32
        };
        part.farthest.iter().map(image).collect()
    }

    #[test]
    fn what_was_cut_off_begins_at_the_rims() {
        let rings = RINGS * 3 / 4;
        let (whole, part) = (torus(RINGS), torus(rings));
        let own = images(&part, rings, |t| t * (rings - 1) as f64);
        let (all, elsewhere) = uncovered(&part, &whole, &own);
        assert!(all > 0.0);
        assert_eq!(elsewhere, 0.0);
        // Nothing is left over of the part itself.
        assert_eq!(uncovered(&part, &part, &own), (0.0, 0.0));
    }

    #[test]
    fn what_a_folded_part_leaves_over_begins_elsewhere() {
        let rings = RINGS * 3 / 4;
        let (whole, part) = (torus(RINGS), torus(rings));
        // Both rims go to the middle of what is covered, which begins and ends at folds.
        let (from, middle, to) = (0.0, rings as f64 / 2.0, (rings - 1) as f64);
        let folded = images(&part, rings, |t| match t {
            t if t < 0.25 => middle + (from - middle) * 4.0 * t,
            t if t < 0.75 => from + (to - from) * 2.0 * (t - 0.25),
            t => to + (middle - to) * 4.0 * (t - 0.75),
        });
        let (all, elsewhere) = uncovered(&part, &whole, &folded);
        assert!(all > 0.0);
        assert_eq!(elsewhere, all);
    }
}
