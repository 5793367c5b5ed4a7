//! Where a map is unsure, the rigs of both bodies tell: a head many times as large is still where the head's bone is.

use rayon::prelude::*;

use super::bone_map::{NONE, Rig, bone_map};
use super::outside::Outside;
use crate::algebra::conjugate_gradients::{self, Row, Until};
use crate::algebra::similarity::Similarity;
use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};
use crate::mesh::edge_weights::EdgeWeights;
use crate::mesh::surface_point::SurfacePoint;
use crate::transfer::settings::GUIDANCE;
use crate::transfer::surface::Surface;
use crate::transfer::surface_map::{SurfaceMap, check_rows};

/// How well the average is solved.
const UNTIL: Until = Until {
    residual: 1e-6,
    steps: 500,
};

/// Weights of a body, parents of its bones, and where they begin.
#[derive(Debug, Clone, Copy)]
pub struct Skeleton<'a> {
    /// Weights and parents.
    pub rig: Rig<'a>,
    /// Places of the heads, with the body as it is.
    pub heads: &'a [Point],
}

/// The map in which doubtful vertices lie where the rigs put them.
///
/// A bone of the target that has a [partner](bone_map) and holds enough stands for what hangs on it as far as the next one.
/// With their heads h₂ and h₁, the size s² of what they hold on the source by that on the target and the turn R of the
/// whole map, a vertex y is at Σ w (h₁ + s R (y − h₂)) for the rigs. The way there from its image, times
/// min(1, 2 (1 − confidence)) and averaged by (A + ℓ²W), leads to the nearest place of the source that looks the same way.
///
/// # Errors
/// Those of [`bone_map`], and [`Error::BadArgument`] when there is not a head for each bone.
pub fn guided(map: &SurfaceMap, source: Skeleton<'_>, target: Skeleton<'_>) -> Result<SurfaceMap> {
    for (name, skeleton) in [("source", source), ("target", target)] {
        let count = skeleton.rig.parents.len();
        check_rows(&format!("{name} heads"), skeleton.heads.len(), count)?;
        if skeleton.heads.iter().flatten().any(|x| !x.is_finite()) {
            return Err(Error::BadArgument {
                what: format!("the heads of the {name}'s bones should be finite numbers"),
            });
        }
    }
    let joints = joints(map, source, target)?;
    let areas = map.target.vertex_areas();
    let turn = turn(map, &areas);
    let ways: Vec<Point> = (0..map.target.vertices.len())
        .into_par_iter()
        .map(|v| {
            let (mut sum, mut total) = ([0.0; 3], 0.0);
            for (bone, weight) in target.rig.skin.row(v) {
                if let Some(joint) = &joints[bone as usize] {
                    let off = vector::sub(map.target.vertices[v], joint.on_target);
                    let off = vector::scaled(turn.map(|row| vector::dot(row, off)), joint.scale);
                    let place = vector::add(joint.on_source, off);
                    sum = vector::add(sum, vector::scaled(place, weight));
                    total += weight;
                }
            }
            if total <= 0.0 {
                return [0.0; 3];
            }
            let doubt = (GUIDANCE.by_doubt * (1.0 - map.confidence[v])).clamp(0.0, 1.0);
            let place = vector::scaled(sum, 1.0 / total);
            vector::scaled(vector::sub(place, map.images()[v]), doubt)
        })
        .collect();
    let ways = averaged(&map.target, &areas, ways);
    let outside = Outside::of(&map.source);
    let shortest = GUIDANCE.still * map.source.diagonal();
    let points: Vec<SurfacePoint> = (0..ways.len())
        .into_par_iter()
        .map(|v| {
            let before = map.points[v];
            if vector::norm(ways[v]) < shortest {
                return before;
            }
            let place = vector::add(map.images()[v], ways[v]);
            let looks = outside.smooth_normal(&map.source, &before);
            let alike = |t: u32| vector::dot(map.source.cross(t), looks) * outside.side() > 0.0;
            map.source
                .nearest_where(place, None, alike)
                .unwrap_or(before)
        })
        .collect();
    let again = |surface: &Surface| {
        let triangles: Vec<[i64; 3]> = surface.triangles.iter().map(|t| t.map(i64::from)).collect();
        Surface::new(surface.vertices.clone(), &triangles)
    };
    SurfaceMap::new(
        again(&map.source)?,
        again(&map.target)?,
        &points.iter().map(|p| i64::from(p.face)).collect::<Vec<_>>(),
        &points.iter().map(|p| p.weights).collect::<Vec<_>>(),
        map.confidence.clone(),
    )
}

/// Two joints that stand for one another, and the size of what they hold on the source by that on the target.
struct Joint {
    on_source: Point,
    on_target: Point,
    scale: f64,
}

/// What tells where the vertices of each of the target's bones are.
fn joints(
    map: &SurfaceMap,
    source: Skeleton<'_>,
    target: Skeleton<'_>,
) -> Result<Vec<Option<Joint>>> {
    let found = bone_map(map, source.rig, target.rig)?;
    let count = target.rig.parents.len();
    let mut partner = vec![None; count];
    for (bone, found) in found.iter().enumerate() {
        if let Some(other) = found.bone {
            partner[other as usize] = Some(bone);
        }
    }
    let held_1 = held(&map.source, source.rig);
    let held_2 = held(&map.target, target.rig);
    let least = GUIDANCE.least_held * held_2.iter().sum::<f64>();
    // Leaves first: what holds too little, or has no partner, counts for what it hangs on.
    let mut with_children = held_2.clone();
    let mut tells = vec![false; count];
    for &bone in by_depth(target.rig.parents).iter().rev() {
        let enough = partner[bone].is_some() && with_children[bone] >= least;
        tells[bone] = enough;
        if !enough && target.rig.parents[bone] != NONE {
            with_children[target.rig.parents[bone] as usize] += with_children[bone];
        }
    }
    let mut known = vec![false; source.rig.parents.len()];
    for bone in (0..count).filter(|&bone| tells[bone]) {
        if let Some(other) = partner[bone] {
            known[other] = true;
        }
    }
    let sum = |held: &[f64], parents: &[i64], tells: &[bool]| {
        let mut sums = vec![0.0; held.len()];
        for (bone, held) in held.iter().enumerate() {
            if let Some(above) = nearest_above(bone, parents, tells) {
                sums[above] += held;
            }
        }
        sums
    };
    let sizes_1 = sum(&held_1, source.rig.parents, &known);
    let sizes_2 = sum(&held_2, target.rig.parents, &tells);
    Ok((0..count)
        .map(|bone| {
            let above = nearest_above(bone, target.rig.parents, &tells)?;
            let other = partner[above]?;
            let scale = (sizes_1[other] / sizes_2[above]).sqrt();
            scale.is_normal().then(|| Joint {
                on_source: source.heads[other],
                on_target: target.heads[above],
                scale,
            })
        })
        .collect())
}

/// The bone itself or the first above it that is marked.
fn nearest_above(bone: usize, parents: &[i64], marked: &[bool]) -> Option<usize> {
    let mut bone = bone;
    while !marked[bone] {
        bone = usize::try_from(parents[bone]).ok()?;
    }
    Some(bone)
}

/// Bones with parents before their children; [`bone_map`] has refused circles.
fn by_depth(parents: &[i64]) -> Vec<usize> {
    let depth = |mut bone: usize| {
        let mut depth = 0;
        while let Ok(above) = usize::try_from(parents[bone]) {
            bone = above;
            depth += 1;
        }
        depth
    };
    let mut order: Vec<usize> = (0..parents.len()).collect();
    order.sort_by_key(|&bone| depth(bone));
    order
}

/// Area times weight of each bone.
fn held(surface: &Surface, rig: Rig<'_>) -> Vec<f64> {
    let mut sums = vec![0.0; rig.parents.len()];
    for (v, area) in surface.vertex_areas().into_iter().enumerate() {
        for (bone, weight) in rig.skin.row(v) {
            sums[bone as usize] += area * weight;
        }
    }
    sums
}

/// How the source lies by the target, from what the map is sure of; mirrored where that fits better.
fn turn(map: &SurfaceMap, areas: &[f64]) -> [Point; 3] {
    let pairs: Vec<(Point, Point, f64)> = map
        .target
        .vertices
        .iter()
        .zip(map.images())
        .zip(areas.iter().zip(&map.confidence))
        .map(|((&y, &x), (area, confidence))| (y, x, area * confidence.powi(GUIDANCE.sure)))
        .collect();
    let missed = |fitted: &Similarity| -> f64 {
        pairs
            .iter()
            .map(|&(y, x, w)| w * vector::distance(fitted.apply(y), x).powi(2))
            .sum()
    };
    let [plain, mirrored] = [false, true].map(|mirrored| Similarity::fitted(&pairs, mirrored));
    if missed(&mirrored) < missed(&plain) {
        mirrored.turn
    } else {
        plain.turn
    }
}

/// The least of `Σ A |x − way|² + ℓ² tr xᵀWx`.
fn averaged(surface: &Surface, areas: &[f64], ways: Vec<Point>) -> Vec<Point> {
    let edges = EdgeWeights::new(&surface.vertices, &surface.triangles);
    let square = GUIDANCE.averaged_over * GUIDANCE.averaged_over * areas.iter().sum::<f64>();
    let diagonal: Vec<f64> = areas
        .iter()
        .enumerate()
        .map(|(v, area)| {
            let around: f64 = edges.row(v).map(|(_, w)| w).sum();
            (area + square * around).max(f64::MIN_POSITIVE)
        })
        .collect();
    let apply = |x: &[Row<3>]| -> Vec<Row<3>> {
        (0..x.len())
            .into_par_iter()
            .map(|v| {
                let mut sum = vector::scaled(x[v], diagonal[v]);
                for (u, w) in edges.row(v) {
                    sum = vector::sub(sum, vector::scaled(x[u as usize], square * w));
                }
                sum
            })
            .collect()
    };
    let precondition = |x: &[Row<3>]| -> Vec<Row<3>> {
        let rows = x.iter().zip(&diagonal);
        rows.map(|(row, d)| vector::scaled(*row, 1.0 / d)).collect()
    };
    let right: Vec<Row<3>> = ways
        .iter()
        .zip(areas)
        .map(|(way, area)| vector::scaled(*way, *area))
        .collect();
    conjugate_gradients::solved(apply, precondition, &right, ways, UNTIL, &|| Ok(()))
        .expect("it is never told to stop")
}
