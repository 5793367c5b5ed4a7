//! Bones of the source's rig placed in the target: by the surface around their joints, or by other bones.
//!
//! In: the rig at rest in the source's coordinates, and what it moves. Out: every bone in the target's.
//!
//! 1. [`rest`]: ends of bones in one place are one joint, and the vertices that move with the bones there tell where it is.
//! 2. Joints that hold the surface go where the surface around them takes them ([`fitted_joints`]), on both sides of a
//!    mirror alike if there is one ([`halves`]). A bone between two of them is placed.
//! 3. [`others`]: the rest keep how they stand to a bone that is placed; where none is near they go with the
//!    [whole body](whole_body).

pub mod halves;
pub mod others;
pub mod rest;
pub mod whole_body;

use std::cell::LazyCell;

use self::halves::on_both_halves;
use self::others::Placing;
use self::rest::Rest;
use self::whole_body::WholeBody;
use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};
use crate::transfer::frame::Affine;
use crate::transfer::joints::{Joint, fitted_joints};
use crate::transfer::outfit::bone_map::{NONE, Rig, descendants};
use crate::transfer::settings::BONES;
use crate::transfer::skin_weights::SkinWeights;
use crate::transfer::surface_map::{SurfaceMap, check_rows};

/// The bones of a rig at rest, in the source's coordinates.
#[derive(Debug, Clone, Copy)]
pub struct Bones<'a> {
    /// Where each begins, `(bones)`.
    pub heads: &'a [Point],
    /// Where each ends, `(bones)`.
    pub tails: &'a [Point],
    /// The direction of the z axis of each, of any length, `(bones)`; where it is zero, or along the bone, one across.
    pub ups: &'a [Point],
    /// What they move, and their parents.
    pub rig: Rig<'a>,
    /// A bone, and one that it leads by a constraint, `(n)`.
    pub leads: &'a [[i64; 2]],
    /// The bone of the other side for each, [`NONE`] without one, `(bones)`.
    pub partners: &'a [i64],
    /// Which bones are of one side, `(bones)`: those with a partner, and those whose partner is missing.
    pub sided: &'a [bool],
    /// Mirrors of the rig and of the target, where the target is to be symmetric as its mirror has it.
    pub mirrors: Option<Mirrors>,
}

/// How source and target are turned over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mirrors {
    /// The reflection of directions of the source, rows of a matrix.
    pub source: [Point; 3],
    /// The reflection of the target's points.
    pub target: Affine,
}

/// A bone in the target's coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bone {
    /// Where it begins.
    pub head: Point,
    /// Where it ends.
    pub tail: Point,
    /// Its x, y and z axis, right-handed, y along it.
    pub axes: [Point; 3],
    /// Rows of what takes directions of the source to those of the target; mirroring if the map does.
    pub turn: [Point; 3],
    /// Length on the target for a unit of length on the source.
    pub scale: f64,
    /// Whether it was placed by the surface, or beside a bone that was.
    pub firm: bool,
}

/// Every bone of a rig in the target, `(bones)`.
///
/// Joints of bones that hold the surface go where the similarity of the surface around them takes them. Other bones keep
/// how they stand to a bone that is placed: one with the same head, one that ends there, the nearest one above them, or the
/// nearest that they lead; what is left goes with the whole body. What was one joint stays one, unless a bone runs along
/// another. Where nothing holds the surface, every vertex counts for every joint.
///
/// # Errors
/// [`Error::BadArgument`] when an argument has not one row for each bone, weights have not one for each vertex, a bone
/// does not exist, or one is its own ancestor.
///
/// # Source
/// Joints as in [`fitted_joints`].
pub fn fitted_bones(map: &SurfaceMap, bones: &Bones<'_>) -> Result<Vec<Bone>> {
    let order = checked(map, bones)?;
    let rest = Rest::new(bones);
    let mut rows = rest.influence(bones.rig);
    let mut known: Vec<usize> = (0..rows.len())
        .filter(|&joint| !rows[joint].is_empty())
        .collect();
    if known.is_empty() {
        known = (0..rows.len()).collect();
    }
    let places: Vec<Point> = known.iter().map(|&joint| rest.places[joint]).collect();
    let rows = known.iter().map(|&joint| std::mem::take(&mut rows[joint]));
    let influence = SkinWeights::from_rows(rows.collect());
    let mut joints = fitted_joints(map, &places, &influence)?;
    if let Some(mirrors) = &bones.mirrors {
        let partner = rest.partners(bones.partners, &known);
        on_both_halves(map, mirrors, &places, partner, &mut joints);
    }
    let mut fitted: Vec<Option<Joint>> = vec![None; rest.places.len()];
    for (&joint, &found) in known.iter().zip(&joints) {
        fitted[joint] = Some(found);
    }
    let mut placing = Placing::new(bones, &rest, &fitted);
    for (bone, &[head, tail]) in rest.joints.iter().enumerate() {
        if let (Some(begin), Some(end)) = (fitted[head], fitted[tail])
            && head != tail
        {
            placing.place(bone, between(&rest, bone, &begin, end.position));
        }
    }
    let body = LazyCell::new(|| WholeBody::new(map, &rest, &places, &joints));
    placing.place_others(order, &body);
    Ok(placing.all())
}

/// A bone between two joints, turned about itself as the surface around its head.
fn between(rest: &Rest, bone: usize, begin: &Joint, tail: Point) -> Bone {
    let (head, turn) = (begin.position, &begin.turn);
    let grown = vector::distance(head, tail) / rest.lengths[bone];
    let scale = grown.clamp(
        begin.scale / BONES.most_growth,
        begin.scale * BONES.most_growth,
    );
    rest.laid(bone, [head, tail], turn, scale, true)
}

/// The bones with parents before their children.
fn checked(map: &SurfaceMap, bones: &Bones<'_>) -> Result<Vec<usize>> {
    let count = bones.rig.parents.len();
    for (name, rows) in [
        ("heads", bones.heads.len()),
        ("tails", bones.tails.len()),
        ("ups", bones.ups.len()),
        ("partners", bones.partners.len()),
        ("sided", bones.sided.len()),
    ] {
        check_rows(name, rows, count)?;
    }
    let skin = bones.rig.skin;
    let rows = skin.starts.len().saturating_sub(1);
    check_rows("weights", rows, map.source.vertices.len())?;
    let exists = |bone: i64| (0..count as i64).contains(&bone);
    let partners = bones.partners.iter();
    for (name, holds) in [
        (
            "weights",
            skin.groups.iter().all(|&bone| exists(i64::from(bone))),
        ),
        (
            "leads",
            bones.leads.as_flattened().iter().all(|&bone| exists(bone)),
        ),
        (
            "partners",
            partners.copied().all(|bone| bone == NONE || exists(bone)),
        ),
    ] {
        if !holds {
            return Err(Error::BadArgument {
                what: format!(
                    "`{name}` names a bone that there is not: bones are from 0 and below {count}"
                ),
            });
        }
    }
    let (_, order) = descendants("parents", bones.rig.parents)?;
    Ok(order)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::frame::determinant;
    use crate::transfer::surface::Surface;

    /// A tube along z of square rings, a chain of bones in it, and the map to what a function makes of it.
    struct Tube {
        map: SurfaceMap,
        skin: SkinWeights,
        heads: Vec<Point>,
        tails: Vec<Point>,
        parents: Vec<i64>,
    }

    impl Tube {
        /// Three bones hold it; one beside the second and a root below hold nothing.
        fn new(mirrored: bool, moved: impl Fn(Point) -> Point) -> Self {
            let rings = 13;
            let vertices: Vec<Point> = (0..4 * rings)
                .map(|v: i32| {
                    let (x, y) = [(0.5, 0.0), (0.0, 0.5), (-0.5, 0.0), (0.0, -0.5)][v as usize % 4];
                    [x, y, f64::from(v / 4) * 0.5]
                })
                .collect();
            let faces: Vec<[i64; 3]> = (0..4 * (i64::from(rings) - 1))
                .flat_map(|v| {
                    let next = v - v % 4 + (v + 1) % 4;
                    [[v, next, v + 4], [next, next + 4, v + 4]]
                })
                .collect();
            let at: Vec<(i64, [f64; 3])> = (0..vertices.len() as i64)
                .map(|v| {
                    let face = faces.iter().position(|f| f.contains(&v)).unwrap();
                    (
                        face as i64,
                        faces[face].map(|c| f64::from(u8::from(c == v))),
                    )
                })
                .collect();
            let bone = |v: usize| ((v / 4) as u32 / 4).min(2);
            let target = vertices.iter().map(|&p| moved(p)).collect();
            let sides = |&[a, b, c]: &[i64; 3]| if mirrored { [c, b, a] } else { [a, b, c] };
            let faces_2: Vec<[i64; 3]> = faces.iter().map(sides).collect();
            let count = vertices.len();
            Self {
                map: SurfaceMap::new(
                    Surface::new(vertices, &faces).unwrap(),
                    Surface::new(target, &faces_2).unwrap(),
                    &at.iter().map(|a| a.0).collect::<Vec<_>>(),
                    &at.iter().map(|a| a.1).collect::<Vec<_>>(),
                    vec![1.0; count],
                )
                .unwrap(),
                skin: SkinWeights::from_rows((0..count).map(|v| vec![(bone(v), 1.0)]).collect()),
                heads: [0.0, 2.0, 4.0, 2.0, -1.0].map(|z| [0.0, 0.0, z]).to_vec(),
                tails: vec![
                    [0.0, 0.0, 2.0],
                    [0.0, 0.0, 4.0],
                    [0.0, 0.0, 6.0],
                    [0.0, -1.0, 3.0],
                    [0.0, -1.0, -1.0],
                ],
                parents: vec![4, 0, 1, 4, NONE],
            }
        }

        fn fitted(&self) -> Result<Vec<Bone>> {
            let count = self.parents.len();
            let bones = Bones {
                heads: &self.heads,
                tails: &self.tails,
                ups: &vec![[0.0; 3]; count],
                rig: Rig {
                    skin: &self.skin,
                    parents: &self.parents,
                },
                leads: &[],
                partners: &vec![NONE; count],
                sided: &vec![false; count],
                mirrors: None,
            };
            fitted_bones(&self.map, &bones)
        }
    }

    #[test]
    fn a_similarity_takes_all_bones_with_it() {
        // Turned by a third about (1, 1, 1), mirrored or not.
        for side in [1.0, -1.0] {
            let moved = |[x, y, z]: Point| [2.0 * z + 1.0, 2.0 * side * x, 2.0 * y - 3.0];
            let tube = Tube::new(side < 0.0, moved);
            for (bone, found) in tube.fitted().unwrap().iter().enumerate() {
                // Roundings of a tube 12 long.
                assert!(vector::distance(found.head, moved(tube.heads[bone])) < 1e-12);
                assert!(vector::distance(found.tail, moved(tube.tails[bone])) < 1e-12);
                assert!((found.scale - 2.0).abs() < 1e-12);
                assert!((determinant(&found.turn) - side).abs() < 1e-12);
                assert!((determinant(&found.axes) - 1.0).abs() < 1e-12);
                assert_eq!(found.firm, bone != 4);
            }
        }
    }

    /// Of a tube twice as long above the second bone's head: what stands there is as large as before, or grows with it.
    #[test]
    fn a_bone_that_holds_nothing_keeps_how_it_stands_to_its_neighbour() {
        let tube = Tube::new(false, |[x, y, z]| [x, y, z + (z - 2.0).max(0.0)]);
        let found = tube.fitted().unwrap();
        // Of the two bones with its head, the second and none else, it goes by that one.
        let (by, bone) = (&found[1], &found[3]);
        assert_eq!((bone.head, bone.scale), (by.head, by.scale));
        let way = vector::sub(tube.tails[3], tube.heads[3]);
        let wanted = vector::scaled(vector::by_rows(&by.turn, way), by.scale);
        assert!(vector::distance(vector::sub(bone.tail, bone.head), wanted) < 1e-12);
        assert_eq!(found[0].tail, found[1].head);
        assert_eq!(found[1].tail, found[2].head);
    }

    #[test]
    fn bones_that_there_are_not_are_named() {
        let mut tube = Tube::new(false, |p| p);
        tube.parents[4] = 0;
        let error = tube.fitted().unwrap_err().to_string();
        assert!(
            error.starts_with("`parents` of 5 bones should be bones above them"),
            "{error}"
        );
        tube.parents.pop();
        assert!(tube.fitted().unwrap_err().to_string().contains("`heads`"));
    }
}
