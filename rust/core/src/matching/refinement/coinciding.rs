//! Surfaces that lie on one another as they were given: two meshes of one thing, or a piece and its whole.

use rayon::prelude::*;

use crate::algebra::space_tree::SpaceTree;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::matching::problem::pair::Coverage;
use crate::matching::problem::point_map::PointMaps;
use crate::matching::problem::which::Which;
use crate::matching::refinement::settings::COINCIDENCE;
use crate::shape::Shape;
use crate::watch::progress::Check;

/// Two surfaces of which at least one lies on the other.
#[derive(Debug, Clone)]
pub struct Placed {
    /// The surface that is in the coordinates of the other one.
    pub moving: Which,
    /// Its vertices there.
    pub places: Vec<Point>,
    /// Nearest vertex of the other surface for each vertex of either.
    pub images: PointMaps<Vec<u32>>,
    /// Which of them lies on the other.
    pub coverage: Coverage,
}

/// Whether two shapes lie on one another as they were given, measured by the smaller of the two.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn coinciding(source: &Shape, target: &Shape, check: Check<'_>) -> Result<Option<Placed>> {
    let (own, other) = (&target.mesh, &source.mesh);
    let placed: Vec<Point> = own
        .vertices
        .iter()
        .map(|&p| other.as_own(own.as_given(p)))
        .collect();
    let unit = (own.scale / other.scale).min(1.0);
    let there = &other.vertices;
    let of_target = Questions {
        from: &placed,
        asked: &target.farthest,
        to: there,
        normals: &source.normals,
        unit,
    };
    let of_source = Questions {
        from: there,
        asked: &source.farthest,
        to: &placed,
        normals: &target.normals,
        unit,
    };
    if of_target.stray_from_the_first() && of_source.stray_from_the_first() {
        return Ok(None);
    }
    check()?;
    let (on_target, on_source) = (SpaceTree::new(&placed), SpaceTree::new(there));
    check()?;
    let coverage = match (
        of_target.lie_near(&on_source),
        of_source.lie_near(&on_target),
    ) {
        (true, true) => Coverage::BOTH,
        (true, false) => Coverage::TARGET_IS_PART,
        (false, true) => Coverage::SOURCE_IS_PART,
        (false, false) => return Ok(None),
    };
    check()?;
    let images = PointMaps {
        target_to_source: on_source.nearest_to_each(&placed),
        source_to_target: on_target.nearest_to_each(there),
    };
    drop((on_target, on_source));
    Ok(Some(Placed {
        moving: Which::Target,
        places: placed,
        images,
        coverage,
    }))
}

/// Vertices of one surface that are asked whether they lie on another.
struct Questions<'a> {
    from: &'a [Point],
    asked: &'a [u32],
    to: &'a [Point],
    normals: &'a [Point],
    /// What lengths are measured by.
    unit: f64,
}

impl Questions<'_> {
    /// How many may lie farther away.
    fn may_stray(&self) -> usize {
        (COINCIDENCE.stray * self.asked.len() as f64) as usize
    }

    /// Whether a vertex lies too far from its image.
    fn strays(&self, vertex: u32, image: u32) -> bool {
        let off = vector::sub(self.from[vertex as usize], self.to[image as usize]);
        let above = vector::dot(self.normals[image as usize], off).abs();
        above > COINCIDENCE.coincident * self.unit
            || vector::norm(off) > COINCIDENCE.beside * self.unit
    }

    /// Whether all but a few lie near, by a tree of the other surface's vertices.
    fn lie_near(&self, tree: &SpaceTree<'_>) -> bool {
        let strayed = self.asked.par_iter().filter(|&&v| {
            let nearest = tree.nearest(self.from[v as usize]);
            nearest.is_none_or(|image| self.strays(v, image))
        });
        strayed.count() <= self.may_stray()
    }

    /// Whether they do not, which of most surfaces a few say, asked without a tree.
    fn stray_from_the_first(&self) -> bool {
        let most = self.may_stray();
        let mut strayed = self
            .asked
            .iter()
            .take(COINCIDENCE.first_asked)
            .filter(|&&v| {
                let from = self.from[v as usize];
                let mut nearest = (f64::INFINITY, 0);
                for (image, &to) in (0..).zip(self.to) {
                    let off = vector::sub(from, to);
                    let distance = vector::dot(off, off);
                    if distance < nearest.0 {
                        nearest = (distance, image);
                    }
                }
                self.strays(v, nearest.1)
            });
        strayed.nth(most).is_some()
    }
}
