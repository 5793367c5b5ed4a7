//! Which bone of one rig moves what a bone of another moves.

use crate::error::{Error, Result};
use crate::transfer::settings::BONE_MAP;
use crate::transfer::skin_weights::SkinWeights;
use crate::transfer::surface_map::{SurfaceMap, check_rows};

/// Stands for no parent.
pub const NONE: i64 = -1;

/// Weights of a body's vertices for the bones of its rig, and the parent of each bone, [`NONE`] of a root.
#[derive(Debug, Clone, Copy)]
pub struct Rig<'a> {
    /// Rows of the vertices.
    pub skin: &'a SkinWeights,
    /// Parent of each bone.
    pub parents: &'a [i64],
}

/// What stands for a bone of the source on the target.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Partner {
    /// The bone that does what it does, of which it is the only partner.
    pub bone: Option<u32>,
    /// Their intersection over union, 0 without a partner.
    pub share: f64,
    /// The bone that moves most of what it moves, whoever else's partner that is: where the weights of a bone without a
    /// partner belong. None of a bone that moves no skin.
    pub nearest: Option<u32>,
}

/// The partner on the target of each bone of the source.
///
/// Bones a and b share `C/(|a| + |b| − C)`, with `C = Σ area · min(w₁(x), w₂(y))` over the target's vertices y and their
/// images x and `|·|` their areas `Σ area · w`: 1 for what moves the same with the same weights, however soft. Of all assignments that take descendants of a bone to descendants of its partner the
/// one with the largest sum is taken, so that along a chain the order is kept and no bone is taken twice.
///
/// # Errors
/// [`Error::BadArgument`] when there is not a row of weights for each vertex, a bone does not exist, or a bone is its own
/// ancestor.
pub fn bone_map(map: &SurfaceMap, source: Rig<'_>, target: Rig<'_>) -> Result<Vec<Partner>> {
    let rows = |skin: &SkinWeights| skin.starts.len().saturating_sub(1);
    check_rows(
        "source weights",
        rows(source.skin),
        map.source.vertices.len(),
    )?;
    check_rows(
        "target weights",
        rows(target.skin),
        map.target.vertices.len(),
    )?;
    for (name, rig) in [("source", source), ("target", target)] {
        if rig
            .skin
            .groups
            .iter()
            .any(|&bone| bone as usize >= rig.parents.len())
        {
            return Err(Error::BadArgument {
                what: format!("the {name}'s weights name bones that have no parent given"),
            });
        }
    }
    let (_, order) = descendants("source", source.parents)?;
    let (below_2, _) = descendants("target", target.parents)?;
    let shares = shares(map, source, target);
    let (count_1, count_2) = (source.parents.len(), target.parents.len());
    let mut children = vec![Vec::new(); count_1];
    for (bone, &parent) in source.parents.iter().enumerate() {
        if parent >= 0 {
            children[parent as usize].push(bone);
        }
    }
    // What the bones from one down are worth within the bones below another, the last for all of them.
    let worth = |best: &[Vec<f64>], bones: &[usize], within: usize| -> f64 {
        bones.iter().map(|&bone| best[bone][within]).sum()
    };
    let mut best = vec![vec![0.0; count_2 + 1]; count_1];
    let mut chosen = vec![vec![None; count_2 + 1]; count_1];
    let everything: Vec<u32> = (0..count_2 as u32).collect();
    for &bone in order.iter().rev() {
        let value: Vec<f64> = (0..count_2)
            .map(|other| shares[bone][other] + worth(&best, &children[bone], other))
            .collect();
        for within in 0..=count_2 {
            let allowed = below_2.get(within).unwrap_or(&everything);
            let mut most = (worth(&best, &children[bone], within), None);
            for &other in allowed {
                if shares[bone][other as usize] >= BONE_MAP.least_share
                    && value[other as usize] > most.0
                {
                    most = (value[other as usize], Some(other));
                }
            }
            (best[bone][within], chosen[bone][within]) = most;
        }
    }
    let mut within = vec![count_2; count_1];
    let mut found = vec![None; count_1];
    for &bone in &order {
        let partner = chosen[bone][within[bone]];
        found[bone] = partner.map(|p| (p, shares[bone][p as usize]));
        for &child in &children[bone] {
            within[child] = partner.map_or(within[bone], |p| p as usize);
        }
    }
    keep_best(&mut found, count_2);
    let nearest = |row: &[f64]| {
        let most = (0..).zip(row).max_by(|a, b| a.1.total_cmp(b.1));
        most.filter(|&(_, &share)| share > 0.0)
            .map(|(bone, _)| bone)
    };
    Ok(found
        .into_iter()
        .zip(&shares)
        .map(|(found, row)| Partner {
            bone: found.map(|(bone, _)| bone),
            share: found.map_or(0.0, |(_, share)| share),
            nearest: nearest(row),
        })
        .collect())
}

/// Of bones in different branches with one partner the one that shares most of it keeps it.
fn keep_best(found: &mut [Option<(u32, f64)>], count: usize) {
    let mut holder: Vec<Option<usize>> = vec![None; count];
    for bone in 0..found.len() {
        let Some((partner, share)) = found[bone] else {
            continue;
        };
        match holder[partner as usize] {
            Some(other) if found[other].is_some_and(|(_, kept)| kept >= share) => {
                found[bone] = None;
            }
            other => {
                if let Some(other) = other {
                    found[other] = None;
                }
                holder[partner as usize] = Some(bone);
            }
        }
    }
}

/// Intersection over union of every two bones, `(source, target)`.
fn shares(map: &SurfaceMap, source: Rig<'_>, target: Rig<'_>) -> Vec<Vec<f64>> {
    let (count_1, count_2) = (source.parents.len(), target.parents.len());
    let mut common = vec![vec![0.0; count_2]; count_1];
    let (mut size_1, mut size_2) = (vec![0.0; count_1], vec![0.0; count_2]);
    // Weights of the image of a vertex.
    let mut image: Vec<(u32, f64)> = Vec::new();
    for (v, (point, area)) in map.points.iter().zip(map.target.vertex_areas()).enumerate() {
        // A place of which nothing is known says nothing of its bones.
        let area = area * map.confidence[v];
        for (b, w) in target.skin.row(v) {
            size_2[b as usize] += area * w;
        }
        let corners = map.source.triangles[point.face as usize];
        image.clear();
        for (corner, weight) in corners.into_iter().zip(point.weights) {
            for (a, own) in source.skin.row(corner as usize) {
                match image.iter_mut().find(|(bone, _)| *bone == a) {
                    Some((_, sum)) => *sum += weight * own,
                    None => image.push((a, weight * own)),
                }
            }
        }
        for &(a, own) in &image {
            size_1[a as usize] += area * own;
            for (b, other) in target.skin.row(v) {
                common[a as usize][b as usize] += area * own.min(other);
            }
        }
    }
    for (row, size_1) in common.iter_mut().zip(size_1) {
        for (share, &size_2) in row.iter_mut().zip(&size_2) {
            let union = size_1 + size_2 - *share;
            *share = if union > 0.0 { *share / union } else { 0.0 };
        }
    }
    common
}

/// The bones below each, and all of them with parents before their children.
fn descendants(name: &str, parents: &[i64]) -> Result<(Vec<Vec<u32>>, Vec<usize>)> {
    let count = parents.len();
    let mut below = vec![Vec::new(); count];
    let mut depth = vec![0; count];
    for bone in 0..count {
        let mut above = parents[bone];
        while above != NONE {
            if above < 0 || above as usize >= count || depth[bone] > count {
                return Err(Error::BadArgument {
                    what: format!(
                        "the parents of the {name}'s {count} bones should be bones above them, or {NONE} for none, \
                         but bone {bone} has {}",
                        parents[bone]
                    ),
                });
            }
            below[above as usize].push(bone as u32);
            depth[bone] += 1;
            above = parents[above as usize];
        }
    }
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by_key(|&bone| depth[bone]);
    Ok((below, order))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::surface::Surface;

    /// A strip along x of squares, each vertex with the weights of a chain of bones of equal length.
    fn strip(squares: i64, bones: usize) -> (SurfaceMap, SkinWeights) {
        let count = squares + 1;
        let vertices: Vec<[f64; 3]> = (0..2 * count)
            .map(|v| [(v / 2) as f64, (v % 2) as f64, 0.0])
            .collect();
        let triangles: Vec<[i64; 3]> = (0..squares)
            .flat_map(|i| {
                [
                    [2 * i, 2 * i + 2, 2 * i + 1],
                    [2 * i + 1, 2 * i + 2, 2 * i + 3],
                ]
            })
            .collect();
        let faces: Vec<i64> = (0..2 * count)
            .map(|v| {
                (0..)
                    .zip(&triangles)
                    .find(|(_, t)| t.contains(&v))
                    .unwrap()
                    .0
            })
            .collect();
        let weights: Vec<[f64; 3]> = (0..)
            .zip(&faces)
            .map(|(v, &f)| triangles[f as usize].map(|u| if u == v { 1.0 } else { 0.0 }))
            .collect();
        let surface = || Surface::new(vertices.clone(), &triangles).unwrap();
        let trust = vec![1.0; vertices.len()];
        let map = SurfaceMap::new(surface(), surface(), &faces, &weights, trust).unwrap();
        let starts = (0..=2 * count as u32).collect();
        let bone = |v: i64| ((v / 2) as usize * bones / count as usize) as u32;
        let groups = (0..2 * count).map(bone).collect();
        let skin = SkinWeights::new(starts, groups, vec![1.0; 2 * count as usize], bones).unwrap();
        (map, skin)
    }

    fn chain(bones: i64) -> Vec<i64> {
        (0..bones).map(|b| b - 1).collect()
    }

    #[test]
    fn a_rig_is_its_own_partner_and_bones_without_skin_have_none() {
        let (map, skin) = strip(23, 4);
        let mut parents = chain(4);
        parents.push(3);
        let rig = Rig {
            skin: &skin,
            parents: &parents,
        };
        let found = bone_map(&map, rig, rig).unwrap();
        for (b, partner) in (0..4).zip(&found) {
            assert_eq!((partner.bone, partner.share), (Some(b), 1.0));
        }
        assert_eq!(found[4], Partner::default());
    }

    #[test]
    fn chains_of_other_lengths_keep_their_order_and_take_no_bone_twice() {
        for (many, few) in [(5, 4), (6, 4), (4, 6), (7, 3)] {
            let (map, one) = strip(83, many);
            let (_, other) = strip(83, few);
            let parents = [chain(many as i64), chain(few as i64)];
            let found = bone_map(
                &map,
                Rig {
                    skin: &one,
                    parents: &parents[0],
                },
                Rig {
                    skin: &other,
                    parents: &parents[1],
                },
            )
            .unwrap();
            let taken: Vec<u32> = found.iter().filter_map(|p| p.bone).collect();
            assert!(taken.windows(2).all(|w| w[0] < w[1]), "{taken:?}");
            assert_eq!(taken.len(), many.min(few));
            // The ends of two chains over one strip lie over one another.
            assert_eq!(found[0].nearest, Some(0));
            assert_eq!(found[many - 1].nearest, Some(few as u32 - 1));
        }
    }

    #[test]
    fn circles_and_bones_that_do_not_exist_are_refused() {
        let (map, skin) = strip(7, 2);
        for parents in [vec![1, 0], vec![-1, 5], vec![-2, 0], vec![-1]] {
            let rig = Rig {
                skin: &skin,
                parents: &parents,
            };
            let error = bone_map(&map, rig, rig).unwrap_err();
            assert!(matches!(error, Error::BadArgument { .. }));
        }
    }
}
