//! Where the rest of a part's map would have each of its samples.
//!
//! A wrong map of a part is mostly right but for one limb, which lies on another one, or on the trunk where its own
//! was cut away. Distances to all that lies right tell where it belongs; when the map was sought, only those between
//! the few samples that were placed had a say.
//!
//! # Source
//! A loss that no single outlier dominates: Geman, `McClure`, "Statistical methods for tomographic image
//! reconstruction", 1987.

use faer::MatRef;
use rayon::prelude::*;

use crate::algebra::vector;
use crate::error::Result;
use crate::geodesics;
use crate::matching::partial::search::{PartInWhole, change};
use crate::matching::partial::settings::{RELOCATION, SEARCH};
use crate::watch::progress::Progress;

/// Images of the part's first `SEARCH.asking` samples, moved where they belong elsewhere: once by all others and once by
/// those that are not near. Nothing where none belongs elsewhere.
///
/// `images` are vertices of the whole, one for each of the part's.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn relocated(
    pair: &PartInWhole<'_>,
    images: &[u32],
    progress: &Progress,
) -> Result<Vec<Vec<u32>>> {
    let others = pair.part.marched().iter();
    let their_images: Vec<u32> = others.map(|&v| images[v as usize]).collect();
    let marching = &pair.whole.marching;
    let from_images =
        geodesics::distances_from(marching, &their_images, &|| progress.is_cancelled())?;
    // One column for each vertex of the whole.
    let on_whole = from_images.transpose().to_owned();
    let mut found = Vec::new();
    for heard_from in RELOCATION.heard_from {
        progress.check()?;
        found.extend(moved(pair, images, on_whole.as_ref(), heard_from));
    }
    Ok(found)
}

/// Images of the samples by the others that are not nearer than `heard_from`; `None` where none is moved.
fn moved(
    pair: &PartInWhole<'_>,
    images: &[u32],
    on_whole: MatRef<'_, f32>,
    heard_from: f32,
) -> Option<Vec<u32>> {
    let (part, whole) = (pair.part, pair.whole);
    let others = part.marched();
    let belongs = |v: u32, weights: &[f32]| -> Option<u32> {
        let on_part: Vec<(f32, f32)> = weights
            .iter()
            .enumerate()
            .map(|(i, &weight)| {
                let distance = pair.unit * part.fields[(v as usize, i)];
                let heard = distance >= heard_from;
                (distance, if heard { weight } else { 0.0 })
            })
            .collect();
        let total: f32 = on_part.iter().map(|(_, weight)| weight).sum();
        let cost = |x: u32| -> f32 {
            let there = on_whole.col(x as usize);
            let costs = on_part
                .iter()
                .zip(there.iter())
                .map(|(&(here, weight), &there)| {
                    let change = change(here, there);
                    weight * change / (change + RELOCATION.tolerance * RELOCATION.tolerance)
                });
            costs.sum::<f32>() / total
        };
        let now = images[v as usize];
        let places = whole.farthest.iter().map(|&x| (cost(x), x));
        let (least, place) = places.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let [here, there] = [now, place].map(|x| whole.mesh.vertices[x as usize]);
        let elsewhere = vector::distance(here, there) > RELOCATION.elsewhere;
        (elsewhere && least + RELOCATION.cheaper < cost(now)).then_some(place)
    };
    let mut weights = vec![1.0; others.len()];
    for _ in 0..RELOCATION.rounds {
        let lies = |&v: &u32| belongs(v, &weights).map_or(1.0, |_| RELOCATION.mislaid);
        weights = others.par_iter().map(lies).collect();
    }
    let asking = part.farthest_points(SEARCH.asking);
    let places: Vec<Option<u32>> = asking.par_iter().map(|&v| belongs(v, &weights)).collect();
    let found = asking.iter().zip(&places);
    places.iter().any(Option::is_some).then(|| {
        found
            .map(|(&v, place)| place.unwrap_or(images[v as usize]))
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matching::problem::constraints::Constraints;
    use crate::matching::problem::pair::Coverage;
    use crate::matching::problem::which::Which;
    use crate::shape::Shape;
    use crate::testing::{self, RINGS, torus};

    /// Farthest that any point of the whole is from a sample on which another can be placed, √area.
    const SPACING: f64 = 0.06;

    fn relocated_on(part: &Shape, whole: &Shape, images: &[u32]) -> Vec<Vec<u32>> {
        let constraints = Constraints::default();
        let pair = testing::pair(whole, part, Coverage::TARGET_IS_PART, &constraints);
        let pair = PartInWhole::of(&pair, Which::Target);
        relocated(&pair, images, &Progress::default()).expect("goes on")
    }

    #[test]
    fn what_lies_right_stays() {
        let torus = torus(RINGS);
        let images: Vec<u32> = (0..torus.mesh.vertices.len() as u32).collect();
        assert!(relocated_on(&torus, &torus, &images).is_empty());
    }

    #[test]
    fn what_was_mislaid_is_moved_to_where_its_distances_to_the_others_are() {
        let torus = torus(RINGS);
        let at = |v: u32| torus.mesh.vertices[v as usize];
        // A fifth of the rings lies across the hole.
        let images: Vec<u32> = (0..torus.mesh.vertices.len() as u32)
            .map(|v| if v < 200 { v + 480 } else { v })
            .collect();
        let found = relocated_on(&torus, &torus, &images);
        assert_eq!(found.len(), RELOCATION.heard_from.len());
        for found in found {
            for (&v, &image) in torus.farthest_points(SEARCH.asking).iter().zip(&found) {
                assert!(vector::distance(at(v), at(image)) < SPACING, "{v} {image}");
            }
        }
    }
}
