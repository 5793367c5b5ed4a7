//! The surface laid through its images, as similar to itself around each vertex as they allow.
//!
//! Images of neighbours that were read off one by one jump between sheets that lie close. Here xᵢ minimise
//! Σ aᵢρ(‖xᵢ − yᵢ‖) + μ Σ wᵢⱼ‖(xᵢ − xⱼ) − ½s(Rᵢ + Rⱼ)(pᵢ − pⱼ)‖², y the images, s the scale of the whole map and
//! ρ growing linearly from `SIMILAR.far` on, so that the few that jumped are outvoted by their neighbours.
//!
//! # Source
//! Sorkine, Alexa, "As-rigid-as-possible surface modeling", 2007.

use rayon::prelude::*;

use super::membrane::{Membrane, Symmetric};
use crate::algebra::similarity::nearest_turn;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::matching::detail::settings::SIMILAR;
use crate::mesh::edge_weights::EdgeWeights;
use crate::watch::progress::Check;

/// The surface with its rest positions, areas and edges, through images of its vertices.
pub(super) fn laid(
    rest: &[Point],
    (areas, edges): (&[f64], &EdgeWeights),
    images: &[Point],
    mirrored: bool,
    check: Check<'_>,
) -> Result<Vec<Point>> {
    let lengths = vec![SIMILAR.averaged_over; rest.len()];
    let square = SIMILAR.averaged_over * SIMILAR.averaged_over;
    let mut weights = vec![1.0; rest.len()];
    let mut places = images.to_vec();
    for _ in 0..SIMILAR.rounds {
        check()?;
        let turns: Vec<([Point; 3], f64, f64)> = (0..rest.len())
            .into_par_iter()
            .map(|i| {
                let (mut covariance, mut before, mut after) = ([[0.0; 3]; 3], 0.0, 0.0);
                for (j, w) in edges.row(i) {
                    let e = vector::sub(rest[j as usize], rest[i]);
                    let d = vector::sub(places[j as usize], places[i]);
                    for (row, x) in covariance.iter_mut().zip(d) {
                        *row = vector::add(*row, vector::scaled(e, w * x));
                    }
                    before += w * vector::dot(e, e);
                    after += w * vector::dot(d, d);
                }
                (nearest_turn(&covariance, mirrored), before, after)
            })
            .collect();
        let (before, after) = (turns.iter()).fold((0.0, 0.0), |(b, a), t| (b + t.1, a + t.2));
        let scale = (after / before).sqrt();
        let right: Vec<Point> = (0..rest.len())
            .into_par_iter()
            .map(|i| {
                let mut sum = vector::scaled(images[i], areas[i] * weights[i]);
                for (j, w) in edges.row(i) {
                    let j = j as usize;
                    let e = vector::scaled(vector::sub(rest[i], rest[j]), 0.5 * scale * square * w);
                    for turn in [&turns[i].0, &turns[j].0] {
                        sum = vector::add(sum, vector::by_rows(turn, e));
                    }
                }
                sum
            })
            .collect();
        let drawn: Vec<Symmetric> = areas
            .iter()
            .zip(&weights)
            .map(|(a, w)| [a * w, 0.0, 0.0, a * w, 0.0, a * w])
            .collect();
        places = Membrane::new(edges, &lengths, &drawn).solved(&right, places, check)?;
        for ((weight, place), image) in weights.iter_mut().zip(&places).zip(images) {
            let off = vector::distance(*place, *image);
            *weight = (SIMILAR.far / off.max(SIMILAR.far)).max(SIMILAR.least_weight);
        }
    }
    Ok(places)
}
