//! Skin that nobody sees: vertices of the target under a garment, away from its rims.

use std::collections::VecDeque;

use rayon::prelude::*;

use super::bodies::Bodies;
use super::garment::Garment;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::transfer::settings::HIDDEN;
use crate::transfer::surface::Surface;

/// Which of the target's vertices lie under cloth, at most `reach` from it, and at least `margin` from skin that does not.
///
/// # Errors
/// None beyond those of [`Surface::new`], which a checked garment satisfies.
pub fn hidden(
    bodies: &Bodies,
    garment: &Garment,
    positions: Vec<Point>,
    (reach, margin): (f64, f64),
) -> Result<Vec<bool>> {
    let skin = &bodies.map.target;
    if garment.triangles.is_empty() {
        return Ok(vec![false; skin.vertices.len()]);
    }
    let triangles: Vec<[i64; 3]> = garment.triangles.iter().map(|t| t.map(i64::from)).collect();
    let cloth = Surface::new(positions, &triangles)?;
    let covered: Vec<bool> = skin
        .vertices
        .par_iter()
        .zip(bodies.target.vertices())
        .map(|(&p, &out)| {
            let near = cloth.nearest_within(p, reach, |_| true);
            near.is_some_and(|near| {
                let way = vector::sub(cloth.position(&near), p);
                vector::dot(way, out) > HIDDEN.over * vector::norm(way)
            })
        })
        .collect();
    // Skin that shows, and all that is nearer to it along the edges than the margin.
    let mut far: Vec<f64> = covered
        .iter()
        .map(|&covered| if covered { f64::INFINITY } else { 0.0 })
        .collect();
    let mut front: VecDeque<u32> = (0..far.len() as u32)
        .filter(|&v| !covered[v as usize])
        .collect();
    let neighbours = bodies.map.target_neighbours();
    while let Some(v) = front.pop_front() {
        for &u in neighbours.row(v as usize) {
            let [i, j] = [v, u].map(|v| v as usize);
            let along = far[i] + vector::distance(skin.vertices[i], skin.vertices[j]);
            if along < far[j] && along < margin {
                far[j] = along;
                front.push_back(u);
            }
        }
    }
    Ok(far.into_iter().map(|far| far == f64::INFINITY).collect())
}
