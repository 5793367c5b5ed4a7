//! The shape of the cloth: places that keep the offsets along edges, near to where each would go for itself.

use rayon::prelude::*;

use super::binding::Binding;
use super::equations::Equations;
use super::frame::times;
use super::garment::Garment;
use super::settings::Settings;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::transfer::frame::Matrix;
use crate::transfer::settings::SHAPE;

/// The least of `Σᵢⱼ |pⱼ − pᵢ − ½(Jᵢ + Jⱼ)(gⱼ − gᵢ)|² + Σ aᵢ |pᵢ − goalᵢ|²`, with J smoothed along the garment.
///
/// Where the cloth is folded that was not, it is solved again with goals that hardly count.
///
/// # Errors
/// [`NotFactorised`](crate::Error::NotFactorised), which positive weights rule out but for overflow.
pub fn shaped(
    garment: &Garment,
    equations: &Equations,
    bindings: &[Binding],
    settings: &Settings,
) -> Result<Vec<Point>> {
    let offsets = edge_offsets(garment, bindings, settings);
    let mut hold: Vec<f64> = bindings
        .iter()
        .map(|b| settings.hold * b.tightness(settings))
        .collect();
    let solve = |hold: &[f64]| {
        let mut sums = equations.sums();
        for ((v, b), &hold) in (0..).zip(bindings).zip(hold) {
            sums.add(&[(v, 1.0)], hold, b.goal);
        }
        for (&[a, b], &offset) in garment.edges.iter().zip(&offsets) {
            sums.add(&[(a, -1.0), (b, 1.0)], 1.0, offset);
        }
        sums.solved()
    };
    let mut found = solve(&hold)?;
    for _ in 0..settings.unfolding {
        let folds = garment.folds(&found, SHAPE.rings);
        if !folds.contains(&true) {
            break;
        }
        for (hold, _) in hold.iter_mut().zip(&folds).filter(|(_, fold)| **fold) {
            *hold *= settings.fold_hold;
        }
        found = solve(&hold)?;
    }
    Ok(found)
}

/// Offsets along edges as the smoothed frames of their ends take them.
fn edge_offsets(garment: &Garment, bindings: &[Binding], settings: &Settings) -> Vec<Point> {
    let mut linear: Vec<Matrix> = bindings.iter().map(|b| b.frame.linear).collect();
    for _ in 0..settings.smoothing {
        let mut sums = linear.clone();
        let mut counts = vec![1.0; sums.len()];
        for &[a, b] in &garment.edges {
            for (v, other) in [(a, b), (b, a)] {
                let sum = &mut sums[v as usize];
                for (row, more) in sum.iter_mut().zip(linear[other as usize]) {
                    *row = vector::add(*row, more);
                }
                counts[v as usize] += 1.0;
            }
        }
        for ((linear, sum), count) in linear.iter_mut().zip(sums).zip(counts) {
            *linear = sum.map(|row| vector::scaled(row, 1.0 / count));
        }
    }
    garment
        .edges
        .par_iter()
        .map(|edge| {
            let [i, j] = edge.map(|v| v as usize);
            let along = vector::sub(garment.places[j], garment.places[i]);
            let [one, other] = [i, j].map(|v| times(&linear[v], along));
            vector::scaled(vector::add(one, other), 0.5)
        })
        .collect()
}
