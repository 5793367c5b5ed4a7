//! Pieces that keep their shape: buttons, buckles, glasses and hats are turned, scaled and moved as a whole.

use super::bodies::Bodies;
use super::collision::Distances;
use crate::algebra::similarity::Similarity;
use crate::algebra::vector::{self, Point};
use crate::transfer::settings::STIFF;

/// Replaces the positions of pieces by the similarity that fits best.
///
/// `pieces` are the places of each stiff piece, `from` a position of every place in the piece's own shape.
pub fn kept_stiff(pieces: &[Vec<u32>], from: &[Point], positions: &mut [Point], mirrored: bool) {
    for piece in pieces {
        let pairs: Vec<(Point, Point, f64)> = piece
            .iter()
            .map(|&v| (from[v as usize], positions[v as usize], 1.0))
            .collect();
        let fitted = Similarity::fitted(&pairs, mirrored);
        for &v in piece {
            positions[v as usize] = fitted.apply(from[v as usize]);
        }
    }
}

/// Moves stiff pieces until none of their places is nearer to the body than it has to be, or was on the source.
pub fn moved_out(
    bodies: &Bodies,
    pieces: &[Vec<u32>],
    distances: &Distances,
    positions: &mut [Point],
) {
    for piece in pieces {
        for _ in 0..STIFF.moves {
            let needs = piece.iter().map(|&v| {
                let keep = &distances.places[v as usize];
                let place = positions[v as usize];
                let near = bodies
                    .target
                    .nearest(&bodies.map.target, place, Some(keep.face));
                let need = keep.gap - near.distance;
                let counts = need > 0.0 && distances.counts(keep, &near);
                (if counts { need } else { 0.0 }, near.normal)
            });
            let (need, normal) =
                needs.fold(
                    (0.0, [0.0; 3]),
                    |most, found| {
                        if found.0 > most.0 { found } else { most }
                    },
                );
            if need <= 0.0 {
                break;
            }
            for &v in piece {
                let place = &mut positions[v as usize];
                *place = vector::add(*place, vector::scaled(normal, need));
            }
        }
    }
}
