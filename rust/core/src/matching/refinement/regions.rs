//! Two refined maps of one pair, region by region.
//!
//! Refinements that take different ways come to maps that agree on most of a surface and differ in
//! a hand, a twisted leg, a limb that slid along itself. Over the whole surface such a region changes every
//! figure by little; on its own it is easily told which of both maps is better there.

use crate::algebra::vector;
use crate::matching::problem::point_map::PointMap;
use crate::matching::refinement::settings::REGIONS;
use crate::shape::Shape;
use crate::shape::descriptors::DETAIL_CURVATURES;

/// How much a map changes the lengths of edges at some of its vertices and how little curvatures at four
/// scales of smoothing agree there with those at the images, the smaller the better: both to the fourth
/// power. `lengths` units of the shape it leads to make one of that it comes from.
#[must_use]
pub fn misfit(map: PointMap<'_>, lengths: f64, vertices: &[u32]) -> f64 {
    edge_misfit(map, lengths, vertices.iter().copied()).powi(2) * curvature_misfit(map, vertices)
}

/// Vertices of the connected regions in which `other` images lie elsewhere than those of the map and fit better:
/// whose edges change their lengths less and whose curvatures agree better there. One entry a vertex.
#[must_use]
pub fn better_elsewhere(map: PointMap<'_>, lengths: f64, other: &[u32]) -> Vec<bool> {
    let at = |v: u32| map.to.mesh.vertices[v as usize];
    let mut waiting: Vec<bool> = map
        .images
        .iter()
        .zip(other)
        .map(|(&a, &b)| vector::distance(at(a), at(b)) > REGIONS.apart)
        .collect();
    let mut better = vec![false; map.images.len()];
    for seed in 0..waiting.len() {
        if !waiting[seed] {
            continue;
        }
        let region = connected(map.from, seed as u32, &mut waiting);
        let area: f64 = region.iter().map(|&v| map.from.mass[v as usize]).sum();
        let fit = |map| misfit(map, lengths, &region);
        if area >= REGIONS.least_region && fit(map.with(other)) < fit(map) {
            for v in region {
                better[v as usize] = true;
            }
        }
    }
    better
}

/// The waiting vertices that hang together with one of them, which wait no longer.
fn connected(shape: &Shape, seed: u32, waiting: &mut [bool]) -> Vec<u32> {
    let mut region = vec![seed];
    waiting[seed as usize] = false;
    let mut next = 0;
    while next < region.len() {
        for &w in shape.neighbours.row(region[next] as usize) {
            if std::mem::take(&mut waiting[w as usize]) {
                region.push(w);
            }
        }
        next += 1;
    }
    region
}

/// Product over the scales of the mean difference between curvatures at vertices and at their images.
fn curvature_misfit(map: PointMap<'_>, vertices: &[u32]) -> f64 {
    let (own, there) = (&map.from.descriptors.detail, &map.to.descriptors.detail);
    let mass = &map.from.mass;
    let area: f64 = vertices.iter().map(|&v| mass[v as usize]).sum();
    (0..DETAIL_CURVATURES)
        .map(|scale| {
            let differences = vertices.iter().map(|&v| {
                let image = map.image(v) as usize;
                let difference = own[(v as usize, scale)] - there[(image, scale)];
                mass[v as usize] * f64::from(difference.abs())
            });
            differences.sum::<f64>() / area
        })
        .product()
}

/// Σ (ℓ′ − ℓ)² / Σ ℓ² over the edges at the given vertices, ℓ their length in the unit of the shape the map leads
/// to, of which `lengths` make one of the other's, ℓ′ that between the images.
pub fn edge_misfit(
    map: PointMap<'_>,
    lengths: f64,
    vertices: impl IntoIterator<Item = u32>,
) -> f64 {
    let here = |v: u32| vector::scaled(map.from.mesh.vertices[v as usize], lengths);
    let there = |v: u32| map.to.mesh.vertices[map.image(v) as usize];
    let (mut change, mut total) = (0.0, f64::MIN_POSITIVE);
    for v in vertices {
        for &w in map.from.neighbours.row(v as usize) {
            let length = vector::distance(here(v), here(w));
            change += (vector::distance(there(v), there(w)) - length).powi(2);
            total += length * length;
        }
    }
    change / total
}
