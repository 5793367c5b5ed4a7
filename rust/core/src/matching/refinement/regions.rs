//! Two refined maps of one pair, region by region.
//!
//! Refinements that take different ways come to maps that agree on most of a surface and differ in
//! a hand, a twisted leg, a limb that slid along itself. Over the whole surface such a region changes every
//! figure by little; on its own it is easily told which of both maps is better there.

use crate::algebra::vector;
use crate::shape::Shape;
use crate::shape::descriptors::DETAIL_CURVATURES;

/// Images of a vertex that are farther apart than this are different, √area: maps are right to 0.015.
const APART: f64 = 0.013;
/// Regions of less area say nothing: some ten vertices of a mesh of 5,000.
const LEAST_REGION: f64 = 0.002;

/// How much a map changes the lengths of edges at some target vertices and how little curvatures at four
/// scales of smoothing agree there with those at the images, the smaller the better: both to the fourth
/// power. `lengths` units of the source make one of the target's.
#[must_use]
pub fn misfit(
    target: &Shape,
    source: &Shape,
    lengths: f64,
    images: &[u32],
    vertices: &[u32],
) -> f64 {
    edge_misfit(target, source, lengths, images, vertices.iter().copied()).powi(2)
        * curvature_misfit(target, source, images, vertices)
}

/// Target vertices of the connected regions in which `other` lies elsewhere than `images` and fits better:
/// whose edges change their lengths less and whose curvatures agree better there. One entry a vertex.
#[must_use]
pub fn better_elsewhere(
    target: &Shape,
    source: &Shape,
    lengths: f64,
    images: &[u32],
    other: &[u32],
) -> Vec<bool> {
    let at = |v: u32| source.mesh.vertices[v as usize];
    let mut waiting: Vec<bool> = images
        .iter()
        .zip(other)
        .map(|(&a, &b)| vector::distance(at(a), at(b)) > APART)
        .collect();
    let mut better = vec![false; images.len()];
    for seed in 0..waiting.len() {
        if !waiting[seed] {
            continue;
        }
        let region = connected(target, seed as u32, &mut waiting);
        let area: f64 = region.iter().map(|&v| target.mass[v as usize]).sum();
        let fit = |images: &[u32]| misfit(target, source, lengths, images, &region);
        if area >= LEAST_REGION && fit(other) < fit(images) {
            for v in region {
                better[v as usize] = true;
            }
        }
    }
    better
}

/// The waiting vertices that hang together with one of them, which wait no longer.
fn connected(target: &Shape, seed: u32, waiting: &mut [bool]) -> Vec<u32> {
    let mut region = vec![seed];
    waiting[seed as usize] = false;
    let mut next = 0;
    while next < region.len() {
        for &w in target.neighbours.row(region[next] as usize) {
            if std::mem::take(&mut waiting[w as usize]) {
                region.push(w);
            }
        }
        next += 1;
    }
    region
}

/// Product over the scales of the mean difference between curvatures at vertices and at their images.
fn curvature_misfit(target: &Shape, source: &Shape, images: &[u32], vertices: &[u32]) -> f64 {
    let (own, there) = (&target.descriptors.detail, &source.descriptors.detail);
    let area: f64 = vertices.iter().map(|&v| target.mass[v as usize]).sum();
    (0..DETAIL_CURVATURES)
        .map(|scale| {
            let differences = vertices.iter().map(|&v| {
                let image = images[v as usize] as usize;
                let difference = own[(v as usize, scale)] - there[(image, scale)];
                target.mass[v as usize] * f64::from(difference.abs())
            });
            differences.sum::<f64>() / area
        })
        .product()
}

/// Σ (ℓ′ − ℓ)² / Σ ℓ² over the edges at the given vertices, ℓ their length in the source's unit, ℓ′ that between
/// the images.
pub fn edge_misfit(
    target: &Shape,
    source: &Shape,
    lengths: f64,
    images: &[u32],
    vertices: impl IntoIterator<Item = u32>,
) -> f64 {
    let here = |v: u32| vector::scaled(target.mesh.vertices[v as usize], lengths);
    let there = |v: u32| source.mesh.vertices[images[v as usize] as usize];
    let (mut change, mut total) = (0.0, f64::MIN_POSITIVE);
    for v in vertices {
        for &w in target.neighbours.row(v as usize) {
            let length = vector::distance(here(v), here(w));
            change += (vector::distance(there(v), there(w)) - length).powi(2);
            total += length * length;
        }
    }
    change / total
}
