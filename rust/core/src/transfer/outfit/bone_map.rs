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
    /// partner belong. It has the largest C · C/(|a| + |b| − C), of the partner of what the bone hangs on and what hangs
    /// on that, if one of these moves any of it. None of a bone that moves no skin.
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
    let (_, order) = descendants("source_parents", source.parents)?;
    let (below_2, order_2) = descendants("target_parents", target.parents)?;
    let Shared {
        common,
        shares,
        moves,
    } = shared(map, source, target);
    let allowed = allowed(target.parents, &order_2, &below_2, &moves);
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
            let mut most = (worth(&best, &children[bone], within), None);
            for &other in allowed.get(within).unwrap_or(&everything) {
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
    // The partner of the next bone above each that has one.
    let mut above = vec![None; count_1];
    for &bone in &order {
        if let Ok(parent) = usize::try_from(source.parents[bone]) {
            above[bone] = found[parent].map(|(p, _)| p).or(above[parent]);
        }
    }
    let nearest = |bone: usize| {
        let value = |other: u32| common[bone][other as usize] * shares[bone][other as usize];
        let most = |among: &mut dyn Iterator<Item = u32>| {
            let moved = among.filter(|&other| value(other) > 0.0);
            moved.max_by(|&a, &b| value(a).total_cmp(&value(b)))
        };
        let below = |p: u32| most(&mut allowed[p as usize].iter().copied().chain([p]));
        above[bone]
            .and_then(below)
            .or_else(|| most(&mut everything.iter().copied()))
    };
    let partners = found.iter().enumerate().map(|(bone, found)| Partner {
        bone: found.map(|(partner, _)| partner),
        share: found.map_or(0.0, |(_, share)| share),
        nearest: nearest(bone),
    });
    Ok(partners.collect())
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

/// The bones that may be taken below each: those that hang on it, and those of other trees.
///
/// A tree is what hangs together when bones that move no skin are left out: where limbs hang on controls, and these on no
/// bone of the spine, the hierarchy does not tell that an arm is below the chest.
fn allowed(parents: &[i64], order: &[usize], below: &[Vec<u32>], moves: &[bool]) -> Vec<Vec<u32>> {
    // The topmost bone above each that moves skin, or the bone itself.
    let mut top: Vec<usize> = (0..parents.len()).collect();
    for &bone in order {
        if parents[bone] != NONE {
            let above = top[parents[bone] as usize];
            if moves[above] {
                top[bone] = above;
            }
        }
    }
    let others = |bone: usize, b: u32| moves[b as usize] && top[b as usize] != top[bone];
    (0..)
        .zip(below)
        .map(|(bone, below)| {
            let every = 0..parents.len() as u32;
            let others = every.filter(|&b| others(bone, b));
            below.iter().copied().chain(others).collect()
        })
        .collect()
}

/// What bones of two rigs have in common.
struct Shared {
    /// Intersection of every two bones, `(source, target)`.
    common: Vec<Vec<f64>>,
    /// Their intersection over union.
    shares: Vec<Vec<f64>>,
    /// Whether each bone of the target moves skin.
    moves: Vec<bool>,
}

fn shared(map: &SurfaceMap, source: Rig<'_>, target: Rig<'_>) -> Shared {
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
    let shares = common.iter().zip(size_1).map(|(row, size_1)| {
        let share = |(&common, &size_2): (&f64, &f64)| {
            let union = size_1 + size_2 - common;
            if union > 0.0 { common / union } else { 0.0 }
        };
        row.iter().zip(&size_2).map(share).collect()
    });
    Shared {
        shares: shares.collect(),
        moves: size_2.iter().map(|&size| size > 0.0).collect(),
        common,
    }
}

/// The bones below each, and all of them with parents before their children; `name` is that of the argument.
pub(in crate::transfer) fn descendants(
    name: &str,
    parents: &[i64],
) -> Result<(Vec<Vec<u32>>, Vec<usize>)> {
    let count = parents.len();
    let mut below = vec![Vec::new(); count];
    let mut depth = vec![0; count];
    for bone in 0..count {
        let mut above = parents[bone];
        while above != NONE {
            if above < 0 || above as usize >= count || depth[bone] > count {
                return Err(Error::BadArgument {
                    what: format!(
                        "`{name}` of {count} bones should be bones above them, or {NONE} for none, but bone {bone} has {}",
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

    /// Partners of the bones of one rig, weights and parents, in another.
    fn partners(
        map: &SurfaceMap,
        (skin_1, parents_1): (&SkinWeights, &[i64]),
        (skin_2, parents_2): (&SkinWeights, &[i64]),
    ) -> Vec<Partner> {
        let rig = |skin, parents| Rig { skin, parents };
        bone_map(map, rig(skin_1, parents_1), rig(skin_2, parents_2)).unwrap()
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
            let found = partners(&map, (&one, &parents[0]), (&other, &parents[1]));
            let taken: Vec<u32> = found.iter().filter_map(|p| p.bone).collect();
            assert!(taken.windows(2).all(|w| w[0] < w[1]), "{taken:?}");
            assert_eq!(taken.len(), many.min(few));
            // The ends of two chains over one strip lie over one another.
            assert_eq!(found[0].nearest, Some(0));
            assert_eq!(found[many - 1].nearest, Some(few as u32 - 1));
        }
    }

    #[test]
    fn limbs_that_hang_on_controls_are_found() {
        // Three bones that move skin, in one chain and as rigs with controls have them: each below a control, and these
        // below a root.
        let (map, skin) = strip(83, 3);
        let parents = [chain(3), vec![3, 4, 5, 6, 6, 6, -1]];
        for [one, other] in [[0, 1], [1, 0], [1, 1]] {
            let found = partners(&map, (&skin, &parents[one]), (&skin, &parents[other]));
            for (bone, partner) in (0..3).zip(&found) {
                assert_eq!((partner.bone, partner.share), (Some(bone), 1.0));
            }
        }
    }

    /// Weights of a strip of 84 columns: all of the bone that a column has.
    fn columns(bone: impl Fn(usize) -> u32, bones: usize) -> SkinWeights {
        let rows = 2 * 84;
        let groups = (0..rows).map(|v| bone(v / 2)).collect();
        SkinWeights::new((0..=rows as u32).collect(), groups, vec![1.0; rows], bones).unwrap()
    }

    #[test]
    fn what_is_left_over_goes_where_most_of_it_moves() {
        // The third of three bones lies on the first of two, but for its last 8 columns of 28, which are all of the other.
        let (map, three) = strip(83, 3);
        let two = columns(|column| u32::from(column >= 76), 2);
        let parents = [chain(3), chain(2)];
        let found = partners(&map, (&three, &parents[0]), (&two, &parents[1]));
        assert_eq!(found[2].nearest, Some(0));
    }

    #[test]
    fn what_is_left_over_stays_at_the_partner_of_its_parent() {
        // The second bone lies on one that the partner of the first hangs on, but for a few columns.
        let (map, _) = strip(83, 2);
        let one = columns(|column| u32::from(column >= 56), 2);
        let other = columns(|column| u32::from((56..78).contains(&column)), 2);
        let found = partners(&map, (&one, &[-1, 0]), (&other, &[1, -1]));
        assert_eq!((found[0].bone, found[1].bone), (Some(0), None));
        assert_eq!(found[1].nearest, Some(0));
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
