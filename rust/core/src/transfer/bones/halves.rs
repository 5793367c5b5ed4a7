//! Joints of a target that a mirror makes whole: symmetric as it is.

use rayon::prelude::*;

use super::Mirrors;
use crate::algebra::similarity::nearest_turn;
use crate::algebra::vector::{self, Point};
use crate::transfer::frame::product;
use crate::transfer::joints::Joint;
use crate::transfer::settings::BONES;
use crate::transfer::surface_map::SurfaceMap;

/// Makes fitted joints symmetric, from `places` on the source and with `partner`s on the other side.
///
/// A joint on the half that the map knows counts for its partner too, and one in the middle comes to lie in the mirror.
pub fn on_both_halves(
    map: &SurfaceMap,
    mirrors: &Mirrors,
    places: &[Point],
    mut partner: Vec<Option<usize>>,
    joints: &mut [Joint],
) {
    let away: Vec<f64> = (places.par_iter())
        .map(|&place| {
            let distances = map.images().iter().map(|&p| vector::distance(p, place));
            distances.fold(f64::INFINITY, f64::min)
        })
        .collect();
    let mirrored: Vec<(Point, [Point; 3])> = (joints.iter())
        .map(|joint| {
            let turn = product(&mirrors.target.linear, &joint.turn);
            let turn = product(&turn, &mirrors.source);
            (mirrors.target.apply(joint.position), turn)
        })
        .collect();
    let positions: Vec<Point> = joints.iter().map(|joint| joint.position).collect();
    let middle = BONES.in_the_middle * vector::extent(&positions);
    for (j, partner) in partner.iter_mut().enumerate() {
        let off = vector::distance(mirrored[j].0, positions[j]) / 2.0;
        if partner.is_none() && off < middle {
            *partner = Some(j);
        }
    }
    for (j, partner) in partner.into_iter().enumerate() {
        let Some(other) = partner.filter(|&other| other == j || away[j] > away[other]) else {
            continue;
        };
        let share = if other == j { 0.5 } else { 1.0 };
        let (image, turned) = mirrored[other];
        let Joint { position, turn, .. } = joints[j];
        let mixed = |from: Point, to: Point| {
            vector::add(from, vector::scaled(vector::sub(to, from), share))
        };
        joints[j] = Joint {
            position: mixed(position, image),
            turn: nearest_turn(&[0, 1, 2].map(|i| mixed(turn[i], turned[i])), map.mirrors()),
            scale: joints[other].scale,
        };
    }
}
