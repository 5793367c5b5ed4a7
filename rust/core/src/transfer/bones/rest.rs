//! The bones of a rig as the source's surface sees them: their axes, and the joints where they meet.

use std::collections::{BTreeSet, HashMap};

use super::{Bone, Bones};
use crate::algebra::vector::{self, Point};
use crate::transfer::frame::determinant;
use crate::transfer::outfit::bone_map::Rig;
use crate::transfer::settings::BONES;

/// Of an `up` along a bone so little is left across it that it is rounding.
const ALONG: f64 = 1e-9;

/// Bones at rest, by number.
#[derive(Debug)]
pub struct Rest {
    /// Head and tail of each bone.
    pub ends: Vec<[Point; 2]>,
    /// The x, y and z axis of each bone.
    pub axes: Vec<[Point; 3]>,
    /// Lengths of the bones, above 0.
    pub lengths: Vec<f64>,
    /// The largest side of the box around all ends.
    pub size: f64,
    /// The joints at the head and the tail of each bone: ends in one place are one.
    pub joints: Vec<[usize; 2]>,
    /// Where each joint is.
    pub places: Vec<Point>,
}

impl Rest {
    /// Finds the joints and axes.
    #[must_use]
    pub fn new(bones: &Bones<'_>) -> Self {
        let ends: Vec<[Point; 2]> = (bones.heads.iter().zip(bones.tails))
            .map(|(&head, &tail)| [head, tail])
            .collect();
        let size = vector::extent(ends.as_flattened());
        let cell = (size * BONES.same_joint).max(f64::MIN_POSITIVE);
        let (mut known, mut places) = (HashMap::new(), Vec::new());
        let mut joint = |place: Point| {
            let key = place.map(|x| (x / cell).round() as i64);
            *known.entry(key).or_insert_with(|| {
                places.push(place);
                places.len() - 1
            })
        };
        let joints = ends.iter().map(|ends| ends.map(&mut joint)).collect();
        let ways = ends.iter().map(|[head, tail]| vector::sub(*tail, *head));
        Self {
            axes: (ways.clone().zip(bones.ups))
                .map(|(way, &up)| axes(way, up))
                .collect(),
            lengths: ways
                .map(|way| vector::norm(way).max(f64::MIN_POSITIVE))
                .collect(),
            ends,
            size,
            joints,
            places,
        }
    }

    /// For each joint the vertices that move with the bones there, with their weights; none for other joints.
    ///
    /// At the head of a bone that holds the surface its parent counts too.
    #[must_use]
    pub fn influence(&self, rig: Rig<'_>) -> Vec<Vec<(u32, f64)>> {
        let mut moved: Vec<Vec<(u32, f64)>> = vec![Vec::new(); self.ends.len()];
        for v in 0..rig.skin.starts.len() - 1 {
            for (bone, weight) in rig.skin.row(v) {
                moved[bone as usize].push((v as u32, weight));
            }
        }
        for row in &mut moved {
            let held = row.iter().filter(|(_, w)| *w > BONES.least_weight).count();
            if held < BONES.fewest_vertices {
                row.clear();
            }
        }
        let mut around: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); self.places.len()];
        for (bone, &[head, tail]) in self.joints.iter().enumerate() {
            if !moved[bone].is_empty() {
                around[head].insert(bone);
                around[tail].insert(bone);
                around[head].extend(usize::try_from(rig.parents[bone]));
            }
        }
        let row = |bones: &BTreeSet<usize>| bones.iter().flat_map(|&b| moved[b].clone()).collect();
        around.iter().map(row).collect()
    }

    /// For each of the `known` joints which of them is that of the other side, by the partners of the bones.
    #[must_use]
    pub fn partners(&self, bones: &[i64], known: &[usize]) -> Vec<Option<usize>> {
        let mut partner = vec![None; self.places.len()];
        for (bone, &other) in bones.iter().enumerate() {
            if let Ok(other) = usize::try_from(other)
                && other != bone
            {
                for (joint, other) in self.joints[bone].into_iter().zip(self.joints[other]) {
                    partner[joint] = Some(other);
                }
            }
        }
        let mut number = vec![None; self.places.len()];
        for (i, &joint) in known.iter().enumerate() {
            number[joint] = Some(i);
        }
        let of = |&joint: &usize| partner[joint].and_then(|other: usize| number[other]);
        known.iter().map(of).collect()
    }

    /// A bone between ends, turned about itself as directions are.
    #[must_use]
    pub fn laid(
        &self,
        bone: usize,
        [head, tail]: [Point; 2],
        turn: &[Point; 3],
        scale: f64,
        firm: bool,
    ) -> Bone {
        let [_, along, up] = self.axes[bone].map(|axis| vector::by_rows(turn, axis));
        let way = vector::sub(tail, head);
        let axes = axes(if way == [0.0; 3] { along } else { way }, up);
        // What takes the axes at rest to these; the first is turned over by a map that mirrors.
        let side = determinant(turn).signum();
        let turned = [vector::scaled(axes[0], side), axes[1], axes[2]];
        let row = |i: usize| vector::by_columns(&self.axes[bone], turned.map(|axis| axis[i]));
        Bone {
            head,
            tail,
            axes,
            turn: [row(0), row(1), row(2)],
            scale,
            firm,
        }
    }
}

/// The axes of a bone: y along it, z as near to `up` as can be, and x across both.
#[must_use]
pub fn axes(along: Point, up: Point) -> [Point; 3] {
    let mut y = vector::normalised(along);
    if y == [0.0; 3] {
        y = match vector::normalised(up) {
            [0.0, 0.0, 0.0] => [0.0, 1.0, 0.0],
            up => vector::tangent_frame(up)[0],
        };
    }
    let mut z = vector::sub(up, vector::scaled(y, vector::dot(up, y)));
    if vector::norm(z) <= ALONG * vector::norm(up) {
        // The part across the bone of the axis that is the least along it.
        z = vector::scaled(vector::tangent_frame(y)[1], -1.0);
    }
    let z = vector::normalised(z);
    [vector::cross(y, z), y, z]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_right_handed_and_lean_towards_up() {
        let along = [0.3, -0.4, 1.2];
        let ups = [[0.0, 1.0, 0.0], [1.0, 0.1, -2.0], along, [0.0; 3]];
        for (way, up) in [along, [0.0; 3]]
            .into_iter()
            .flat_map(|w| ups.map(|up| (w, up)))
        {
            let [x, y, z] = axes(way, up);
            for (a, b) in [(x, y), (y, z), (z, x)] {
                assert!(vector::dot(a, b).abs() < 1e-15);
                assert!((vector::norm(a) - 1.0).abs() < 1e-15);
            }
            assert!((determinant(&[x, y, z]) - 1.0).abs() < 1e-15);
            assert!((vector::dot(y, way) - vector::norm(way)).abs() < 1e-15);
            assert!(vector::dot(x, up).abs() < 1e-15 && vector::dot(z, up) > -1e-15);
        }
    }
}
