//! Surfaces that lie on one another as they were given: two meshes of one thing, or a piece and its whole.

use rayon::prelude::*;

use crate::error::Result;
use crate::pair::Shares;
use crate::progress::Check;
use crate::shape::Shape;
use crate::space_tree::SpaceTree;
use crate::vector::{self, Point};

/// Surfaces coincide when all but [`STRAY`] of their vertices lie this near to the tangent plane at their
/// image: the nearest point is then as good an image as a map that is right to so much.
pub const COINCIDENT: f64 = 0.015;
/// Share of the vertices that may lie farther away.
pub const STRAY: f64 = 0.03;
/// Nor may an image lie farther away along that plane than this: some edges of a coarse mesh.
const BESIDE: f64 = 0.1;

/// Two surfaces of which at least one lies on the other.
#[derive(Debug)]
pub struct Coinciding {
    /// The target in the coordinates of the source.
    pub placed: Vec<Point>,
    /// Nearest source vertex of each target vertex, and nearest target vertex of each source vertex.
    pub images: [Vec<u32>; 2],
    /// Which of them lies on the other.
    pub shares: Shares,
}

/// Whether two shapes lie on one another as they were given, measured by the smaller of the two.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn coinciding(target: &Shape, source: &Shape, check: Check<'_>) -> Result<Option<Coinciding>> {
    let (own, other) = (&target.mesh, &source.mesh);
    let placed: Vec<Point> = own
        .vertices
        .iter()
        .map(|&p| other.as_own(own.as_given(p)))
        .collect();
    let unit = (own.scale / other.scale).min(1.0);
    let (on_target, on_source) = (SpaceTree::new(&placed), SpaceTree::new(&other.vertices));
    check()?;
    let lies =
        |from: &[Point], asked: &[u32], tree: &SpaceTree<'_>, to: &[Point], normals: &[Point]| {
            let strayed = asked.par_iter().filter(|&&v| {
                tree.nearest(from[v as usize]).is_none_or(|image| {
                    let off = vector::sub(from[v as usize], to[image as usize]);
                    let above = vector::dot(normals[image as usize], off).abs();
                    above > COINCIDENT * unit || vector::norm(off) > BESIDE * unit
                })
            });
            strayed.count() as f64 <= STRAY * asked.len() as f64
        };
    let (all, here) = (&other.vertices, &target.farthest);
    let by_target = lies(&placed, here, &on_source, all, &source.normals);
    let by_source = lies(all, &source.farthest, &on_target, &placed, &target.normals);
    let shares = match (by_target, by_source) {
        (true, true) => Shares::BOTH,
        (true, false) => Shares::TARGET_IS_PART,
        (false, true) => Shares::SOURCE_IS_PART,
        (false, false) => return Ok(None),
    };
    check()?;
    let images = [
        on_source.nearest_to_each(&placed),
        on_target.nearest_to_each(all),
    ];
    drop((on_target, on_source));
    Ok(Some(Coinciding {
        placed,
        images,
        shares,
    }))
}
