//! Rims, where a surface was cut off.

use rayon::prelude::*;

use crate::algebra::space_tree::SpaceTree;
use crate::algebra::vector::{self, Point};
use crate::mesh::Mesh;
use crate::mesh::settings::BOUNDARY;

/// How near each vertex lies to a rim, 1 on it; zeros where there is none.
#[must_use]
pub fn nearness(mesh: &Mesh) -> Vec<f64> {
    let rim: Vec<Point> = mesh
        .boundary_vertices()
        .into_iter()
        .map(|v| mesh.vertices[v as usize])
        .collect();
    let tree = SpaceTree::new(&rim);
    let near = |&p: &Point| {
        tree.nearest(p).map_or(0.0, |r| {
            (-(vector::distance(p, rim[r as usize]) / BOUNDARY.reach).powi(2)).exp()
        })
    };
    mesh.vertices.par_iter().map(near).collect()
}

/// A [nearness] as if it fell to 1/e at the given distance.
#[must_use]
pub fn nearness_at(distance: f64, nearness: f64) -> f64 {
    if nearness == 0.0 {
        // As everywhere on closed surfaces: no power is worked out.
        0.0
    } else {
        nearness.powf((BOUNDARY.reach / distance).powi(2))
    }
}

/// How surely each target vertex lies beyond a rim of the source, in [0, 1], from the [nearness] of both: what the source
/// lacks is mapped onto the rim where it was cut off. Rims that the target has there too do not count.
#[must_use]
pub fn beyond(source: &[f64], target: &[f64], images: &[u32]) -> Vec<f64> {
    images
        .iter()
        .zip(target)
        .map(|(&image, here)| (source[image as usize] - here).max(0.0))
        .collect()
}
