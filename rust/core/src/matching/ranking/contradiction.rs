//! How far a map contradicts what is known: landmarks, a common frame, the symmetry of both shapes.

use super::metrics::judging;
use crate::algebra::dense::Rows;
use crate::algebra::vector;
use crate::matching::problem::pair::Pair;
use crate::matching::ranking::settings::CONTRADICTION;
use crate::shape::nearest::nearest;

/// Source vertices of the landmarks by the embeddings of a map.
pub(super) fn landmark_images(pair: &Pair<'_>, source: &Rows, target: &Rows) -> Vec<u32> {
    let landmarks = pair.constraints.landmarks.iter();
    let known: Vec<u32> = landmarks.map(|l| l.target.0).collect();
    nearest(&target.gather(&known), source)
}

/// Σ (d/0.1)² over landmarks, d the distance between given and found image.
pub(super) fn missed_landmarks(pair: &Pair<'_>, found: &[u32]) -> f64 {
    let landmarks = pair.constraints.landmarks.iter();
    let given: Vec<u32> = landmarks.map(|l| l.source.0).collect();
    let distances = pair.source.spectral_distances(&given, found);
    (0..given.len())
        .map(|i| (distances[(i, i)] / CONTRADICTION.landmark_tolerance).powi(2))
        .sum()
}

/// 4 (1 − r), r the correlation between the coordinates of the judging samples and those of their
/// images, when both shapes stand in one frame; the shapes are centred.
pub(super) fn off_axes(pair: &Pair<'_>, images: &[u32]) -> f64 {
    if !pair.constraints.same_axes {
        return 0.0;
    }
    let (mut both, mut own, mut other) = (0.0, 0.0, 0.0);
    for (&v, &image) in judging(pair.target).iter().zip(images) {
        let p = pair.target.mesh.vertices[v as usize];
        let q = pair.source.mesh.vertices[image as usize];
        both += vector::dot(p, q);
        own += vector::dot(p, p);
        other += vector::dot(q, q);
    }
    CONTRADICTION.axes_weight * (1.0 - both / (own * other).sqrt())
}

/// (d/0.06)², d the mean difference between what the distances of points and of their images from their own
/// mirror images count, where both shapes are symmetric.
pub(super) fn off_symmetry(pair: &Pair<'_>, images: &[u32]) -> f64 {
    let Some([source, target]) = pair.mirror_offsets else {
        return 0.0;
    };
    let asked = judging(pair.target);
    let sum: f64 = asked
        .iter()
        .zip(images)
        .map(|(&v, &image)| f64::from((target[v as usize] - source[image as usize]).abs()))
        .sum();
    (sum / asked.len() as f64 / CONTRADICTION.symmetry_tolerance).powi(2)
}
