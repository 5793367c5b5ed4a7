//! How far to trust each vertex of a map.

use rayon::prelude::*;

use crate::error::Result;
use crate::geodesics;
use crate::progress::Progress;
use crate::shape::Shape;

/// Samples whose distances are compared.
const WITNESSES: usize = 80;
/// Distance at unit area from which on a sample says nothing; its weight (1 − d²/h²)⁴ has fallen to 1/e at
/// half of that.
const HORIZON: f32 = 0.4;
/// Distances are compared up to this one, since the weight has fallen to 1/100 there: marches end sooner.
const COMPARED: f32 = 0.33;
/// Keeps the weights' sum above zero.
const WEIGHT_FLOOR: f32 = 1e-6;
/// Vertices that are treated at once.
const VERTICES_A_PIECE: usize = 512;
/// Doubt at which confidence falls to 1/e: half of it is left at 0.067, which separates best
/// the vertices of a whole that a part lacks from the others.
const TOLERATED: f64 = 0.08;

/// Weight of the gap between a vertex of the drawn target and its image.
const GAP_WEIGHT: f64 = 2.0;

/// Confidence in [0, 1] of a target vertex: exp(−(δ² + 4γ² + ρ²)/0.08² − β²).
///
/// δ is its local distortion, γ the gap between it and its image when the target is drawn onto the
/// source, which stands off where the source has nothing, ρ how far from it
/// the way to the source and back ends, all at unit area, β how much it lies beyond a rim of the
/// source ([`crate::rims::beyond`]). It cannot see a wholly wrong map.
#[must_use]
pub fn confidence(distortion: f64, gap: f64, returns: f64, beyond: f64) -> f64 {
    let doubt = distortion.hypot(GAP_WEIGHT * gap).hypot(returns);
    (-(doubt / TOLERATED).powi(2) - beyond.powi(2)).exp()
}

/// Mean change δ of the distances to 80 samples, near ones weighing most, for each target vertex.
///
/// `images` is the source vertex of each target vertex. Lengths are those of the source at unit area, of
/// which `lengths` make one of the target's.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn local_distortion(
    target: &Shape,
    source: &Shape,
    images: &[u32],
    lengths: f64,
    progress: &Progress,
) -> Result<Vec<f64>> {
    let count = WITNESSES.min(target.marched().len());
    let witnesses: Vec<u32> = target.marched()[..count]
        .iter()
        .map(|&v| images[v as usize])
        .collect();
    let on_source = geodesics::distances_within(COMPARED, &source.marching, &witnesses, &|| {
        progress.is_cancelled()
    })?;
    Ok(images
        .par_chunks(VERTICES_A_PIECE)
        .enumerate()
        .flat_map_iter(|(piece, images)| {
            let from = piece * VERTICES_A_PIECE;
            let mut sums = vec![(0.0, WEIGHT_FLOOR); images.len()];
            for j in 0..count {
                let here = &target.fields.col_as_slice(j)[from..];
                let there = on_source.col_as_slice(j);
                add_changes(&mut sums, here, lengths as f32, there, images);
            }
            sums.into_iter().map(|(sum, total)| f64::from(sum / total))
        })
        .collect())
}

/// Adds one sample's weighted change of distance, and its weight, to the sums of each vertex.
fn add_changes(sums: &mut [(f32, f32)], here: &[f32], lengths: f32, there: &[f32], images: &[u32]) {
    for (((sum, total), &here), &image) in sums.iter_mut().zip(here).zip(images) {
        let here = (lengths * here).min(HORIZON);
        let change = (here.min(COMPARED) - there[image as usize].min(COMPARED)).abs();
        let nearness = 1.0 - (here / HORIZON).powi(2);
        let weight = nearness.powi(4);
        *sum += weight * change;
        *total += weight;
    }
}
