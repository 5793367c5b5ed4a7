//! How the whole body is turned and scaled, for bones that nothing near them tells of.

use super::rest::Rest;
use crate::algebra::similarity::Similarity;
use crate::algebra::vector::{self, Point};
use crate::transfer::joints::Joint;
use crate::transfer::settings::BONES;
use crate::transfer::surface_map::SurfaceMap;

/// The turn and scale between two bodies, and the map between them.
#[derive(Debug)]
pub struct WholeBody<'a> {
    map: &'a SurfaceMap,
    size: f64,
    /// Rows of the rotation from source to target, a mirroring one where the map mirrors.
    pub turn: [Point; 3],
    /// Length on the target for a unit of length on the source.
    pub scale: f64,
}

impl<'a> WholeBody<'a> {
    /// From joints as they were at `places` of the source and as they were fitted.
    ///
    /// By the least sum of distances, not of squares: what one of the two carries or wears, and arms that hang on one and
    /// are stretched out on the other, turn no body.
    ///
    /// # Source
    /// Weiszfeld, "Sur le point pour lequel la somme des distances de n points donnés est minimum", 1937, for similarities.
    #[must_use]
    pub fn new(map: &'a SurfaceMap, rest: &Rest, places: &[Point], joints: &[Joint]) -> Self {
        let size = BONES.axes_count * rest.size;
        let mut pairs: Vec<(Point, Point, f64)> = Vec::with_capacity(4 * joints.len());
        for (&place, joint) in places.iter().zip(joints) {
            pairs.push((place, joint.position, 1.0));
            for k in 0..3 {
                let mut axis = [0.0; 3];
                axis[k] = size;
                let turned = vector::scaled(vector::by_rows(&joint.turn, axis), joint.scale);
                let after = vector::add(joint.position, turned);
                pairs.push((vector::add(place, axis), after, 1.0));
            }
        }
        let mut found = Similarity::onto(&pairs, map.mirrors());
        // Of a rig in one place all fit.
        let least = match BONES.same_joint * rest.size {
            0.0 => 1.0,
            least => least,
        };
        for _ in 0..BONES.reweighted {
            for (before, after, weight) in &mut pairs {
                *weight = 1.0 / (vector::distance(found.apply(*before), *after) + least);
            }
            found = Similarity::onto(&pairs, map.mirrors());
        }
        Self {
            map,
            size: rest.size,
            turn: found.turn,
            scale: found.scale,
        }
    }

    /// Where the ends of a bone go with the part of the body that is nearest to its head: a root stays on the ground.
    #[must_use]
    pub fn moved(&self, ends: [Point; 2]) -> [Point; 2] {
        let away: Vec<f64> = (self.map.images().iter())
            .map(|&image| vector::distance(image, ends[0]))
            .collect();
        let least = away.iter().copied().fold(f64::INFINITY, f64::min);
        let width = (BONES.surroundings * self.size).max(f64::MIN_POSITIVE);
        let (mut from, mut to, mut total) = ([0.0; 3], [0.0; 3], 0.0);
        for (v, away) in away.into_iter().enumerate() {
            let near = (-((away - least) / width).powi(2) / 2.0).exp();
            from = vector::add(from, vector::scaled(self.map.images()[v], near));
            to = vector::add(to, vector::scaled(self.map.target.vertices[v], near));
            total += near;
        }
        let [from, to] = [from, to].map(|sum| vector::scaled(sum, 1.0 / total));
        ends.map(|end| {
            let turned = vector::by_rows(&self.turn, vector::sub(end, from));
            vector::add(to, vector::scaled(turned, self.scale))
        })
    }
}
