//! Joints of a rig placed in the target, each by the surface around it.

use rayon::prelude::*;

use crate::algebra::similarity::Similarity;
use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};
use crate::transfer::settings::JOINTS;
use crate::transfer::skin_weights::SkinWeights;
use crate::transfer::surface_map::{SurfaceMap, check_rows};

/// A joint in the target and how the body around it is turned and scaled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joint {
    /// Position in the target's coordinates.
    pub position: Point,
    /// Rows of the rotation from source to target, a mirroring one where the map mirrors.
    pub turn: [Point; 3],
    /// Length on the target for a unit of length on the source.
    pub scale: f64,
}

/// Places the source's joints in the target.
///
/// Around each joint the similarity that takes the images of the target's vertices to the vertices
/// themselves is fitted with weights that fall off from the joint (moving least squares), and
/// applied to the joint. `influence` has a row for each joint over "groups" that are the source's
/// vertices; with it only vertices that the joint's bones move count, so that a hand near the hip
/// does not pull at it. An empty row lets every vertex count.
///
/// # Errors
/// [`Error::BadArgument`] when there is not one row for each joint or a vertex does not exist.
///
/// # Source
/// Schaefer, `McPhail`, Warren, "Image deformation using moving least squares", 2006, in space.
pub fn fitted_joints(
    map: &SurfaceMap,
    joints: &[Point],
    influence: &SkinWeights,
) -> Result<Vec<Joint>> {
    let n = map.source.vertices.len();
    check_rows("influence", influence.starts.len() - 1, joints.len())?;
    if influence.groups.iter().any(|&v| v as usize >= n) {
        return Err(Error::BadArgument {
            what: format!("`influence` names a vertex beyond the source's {n}"),
        });
    }
    let areas = map.target.vertex_areas();
    let mirrored = map.mirrors();
    Ok(joints
        .par_iter()
        .enumerate()
        .map(|(j, &joint)| {
            let mut weight = Vec::new();
            let row: Vec<(u32, f64)> = influence.row(j).collect();
            if !row.is_empty() {
                weight = vec![0.0; n];
                for (v, w) in row {
                    weight[v as usize] += w;
                }
            }
            fitted(map, &areas, joint, &weight, mirrored)
        })
        .collect())
}

fn fitted(
    map: &SurfaceMap,
    areas: &[f64],
    joint: Point,
    influence: &[f64],
    mirrored: bool,
) -> Joint {
    let share = |v: usize| {
        let point = &map.points[v];
        let own = if influence.is_empty() {
            1.0
        } else {
            let corners = map.source.triangles[point.face as usize];
            (0..3)
                .map(|k| point.weights[k] * influence[corners[k] as usize])
                .sum()
        };
        own * map.confidence[v].max(JOINTS.least_confidence)
    };
    let counted: Vec<(usize, f64)> = (0..map.points.len())
        .map(|v| (v, share(v)))
        .filter(|&(_, s)| s > 0.0)
        .collect();
    let squared = |v: usize| {
        let d = vector::sub(map.images()[v], joint);
        vector::dot(d, d)
    };
    let nearest = counted
        .iter()
        .map(|&(v, _)| squared(v))
        .fold(f64::INFINITY, f64::min);
    let mut width = JOINTS.ring_width * nearest.sqrt().max(1e-6 * map.source.diagonal());
    let mut weights: Vec<(usize, f64)> = Vec::new();
    for _ in 0..JOINTS.widenings {
        // Relative to the nearest vertex, so that nothing vanishes where the joint lies far off.
        let falloff = |v: usize| (-(squared(v) - nearest) / (2.0 * width * width)).exp();
        let heard: f64 = counted.iter().map(|&(v, s)| s * falloff(v)).sum();
        weights = counted
            .iter()
            .map(|&(v, s)| (v, s * falloff(v) * areas[v]))
            .collect();
        if heard >= JOINTS.fewest_vertices {
            break;
        }
        width *= 1.5;
    }
    let pairs: Vec<(Point, Point, f64)> = weights
        .into_iter()
        .map(|(v, w)| (map.images()[v], map.target.vertices[v], w))
        .collect();
    let similarity = Similarity::fitted(&pairs, mirrored);
    Joint {
        position: similarity.apply(joint),
        turn: similarity.turn,
        scale: similarity.scale,
    }
}
