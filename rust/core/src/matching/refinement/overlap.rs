//! What a part covers of the whole, as a surface of its own.
//!
//! A cut changes every eigenfunction, so those of a part and of the whole are not the same functions, and
//! only the part can ask. Once a map shows what the part covers, the rest of the whole is cut away too: two
//! surfaces with much the same rims are left, which are refined as two whole ones.

use crate::algebra::space_tree::SpaceTree;
use crate::algebra::vector::Point;
use crate::error::{Error, Result};
use crate::geodesics::{Seed, Workspace};
use crate::matching::problem::constraints::Constraints;
use crate::matching::problem::landmark::Landmark;
use crate::matching::problem::pair::{Coverage, Pair};
use crate::matching::problem::point_map::PointMaps;
use crate::matching::problem::which::Which;
use crate::matching::refinement::embedded_surface::{self, FULL, Refined};
use crate::matching::refinement::piece::Piece;
use crate::matching::refinement::settings::OVERLAP;
use crate::mesh::Mesh;
use crate::mesh::numbering::WorkingVertex;
use crate::shape::Shape;
use crate::watch::progress::Progress;

/// Refines a map between a part and a whole once more, in full, on what the part covers; `None` where that is all
/// of the whole, or hangs together nowhere, and where neither is a part.
///
/// # Errors
/// [`Error::Cancelled`], and those of the preparation of what is covered.
pub fn refined_on_covered<'a>(
    pair: &Pair<'a>,
    found: &Refined<'a>,
    progress: &Progress,
    report: &(dyn Fn(f64) -> Result<()> + Sync),
) -> Result<Option<Refined<'a>>> {
    report(0.0)?;
    let Some(part_is) = pair.coverage.part() else {
        return Ok(None);
    };
    let (part, whole) = (found.side(part_is), found.side(part_is.other()));
    let lengths = part_is.seen(pair.lengths);
    let Some(piece) = Piece::around(whole.shape, &part.images.vertex, lengths, progress)? else {
        return Ok(None);
    };
    let taken =
        |from: &[u32], ids: &[u32]| -> Vec<u32> { ids.iter().map(|&v| from[v as usize]).collect() };
    let on_part = taken(&whole.images.vertex, &piece.vertices);
    let on_piece = taken(&piece.nearest, &part.images.vertex);
    let by_part = PointMaps {
        target_to_source: on_piece,
        source_to_target: on_part,
    };
    let (source, target, images) = match part_is {
        Which::Target => (&piece.shape, pair.target, by_part),
        Which::Source => (pair.source, &piece.shape, by_part.inverse()),
    };
    let constraints = piece.constraints(pair.constraints, part_is, (source, target), progress)?;
    let of_piece = Pair {
        target,
        source,
        coverage: Coverage::BOTH,
        constraints: &constraints,
        lengths: 1.0,
        mirror_offsets: None,
        ..*pair
    };
    let refined = embedded_surface::refined_images(&of_piece, part_is, images, FULL, report)?;
    Refined::spread_from_piece(pair, &piece, &refined, &|| progress.check()).map(Some)
}

impl Piece {
    /// What a part covers of the whole whose vertices have these images there; `lengths` units of the whole make
    /// one of the part's.
    fn around(
        whole: &Shape,
        images: &[u32],
        lengths: f64,
        progress: &Progress,
    ) -> Result<Option<Self>> {
        let count = whole.mesh.vertices.len();
        let spacing = (lengths / (images.len() as f64).sqrt()).max(1.0 / (count as f64).sqrt());
        let spacing = spacing as f32;
        let seeds: Vec<Seed> = images.iter().map(|&v| Seed::at(v)).collect();
        let mut away = vec![0.0; count];
        whole.marching.march_seeds(
            &seeds,
            OVERLAP.reach.end() * OVERLAP.wider.powi(OVERLAP.widenings) * spacing,
            &mut Workspace::new(&whole.marching),
            &mut away,
        );
        let reach = reach_of_area(whole, &away, lengths * lengths).clamp(
            OVERLAP.reach.start() * spacing,
            OVERLAP.reach.end() * spacing,
        );
        for widening in 0..=OVERLAP.widenings {
            progress.check()?;
            let reach = reach * OVERLAP.wider.powi(widening);
            let covered = |v: &u32| away[*v as usize] <= reach;
            let faces: Vec<[i64; 3]> = whole
                .mesh
                .faces
                .iter()
                .filter(|corners| corners.iter().filter(|v| covered(v)).count() > 1)
                .map(|corners| corners.map(i64::from))
                .collect();
            let share = |some: usize, all: usize| some as f64 / all as f64;
            if share(faces.len(), whole.mesh.faces.len()) > OVERLAP.nearly_all {
                return Ok(None);
            }
            let mesh = match Mesh::new(&whole.mesh.vertices, &faces) {
                Ok(mesh) => mesh,
                Err(Error::EmptyMesh { .. } | Error::TooFewVertices { .. }) => return Ok(None),
                Err(other) => return Err(other),
            };
            if share(mesh.faces.len(), faces.len()) > OVERLAP.in_one_piece {
                return Self::of_mesh(mesh, whole, progress).map(Some);
            }
        }
        Ok(None)
    }

    fn of_mesh(mesh: Mesh, whole: &Shape, progress: &Progress) -> Result<Self> {
        let vertices: Vec<u32> = mesh.input_vertex.iter().map(|v| v.0).collect();
        let check = |_: &'static str, _: f64| progress.check();
        let shape = Shape::of_working_mesh((mesh, None), whole.metric, progress, &check)?;
        let places: Vec<Point> = vertices
            .iter()
            .map(|&v| whole.mesh.vertices[v as usize])
            .collect();
        let nearest = SpaceTree::new(&places).nearest_to_each(&whole.mesh.vertices);
        Ok(Self {
            shape,
            vertices,
            nearest,
        })
    }

    /// What is known of the map, as far as it concerns the piece in place of the whole.
    fn constraints(
        &self,
        known: &Constraints,
        part_is: Which,
        (source, target): (&Shape, &Shape),
        progress: &Progress,
    ) -> Result<Constraints> {
        let numbered = |v: WorkingVertex| {
            let found = self.vertices.binary_search(&v.0).ok();
            found.map(|i| WorkingVertex(i as u32))
        };
        let landmarks = known
            .landmarks
            .iter()
            .filter_map(|&Landmark { source, target }| {
                let (source, target) = match part_is {
                    Which::Target => (numbered(source)?, target),
                    Which::Source => (source, numbered(target)?),
                };
                Some(Landmark { source, target })
            });
        Constraints::new(
            source,
            target,
            landmarks.collect(),
            known.same_axes,
            progress,
        )
    }
}

/// The distance within which the vertices of a shape have so much area, infinite where they never do.
fn reach_of_area(shape: &Shape, away: &[f32], area: f64) -> f32 {
    let mut order: Vec<u32> = (0..away.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| away[a as usize].total_cmp(&away[b as usize]));
    let mut within = 0.0;
    let last = order.iter().find(|&&v| {
        within += shape.mass[v as usize];
        within >= area
    });
    last.map_or(f32::INFINITY, |&v| away[v as usize])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::vector;
    use crate::testing::{self, RINGS, torus};

    /// Rings of the part.
    const KEPT: usize = 31;
    /// Width of a ring at the outermost radius, at unit area of the whole: 2π·1.45/48 over √(4π²·0.35).
    const RING: f64 = 0.052;

    /// The part, the whole, and where vertices of each truly lie on the other.
    fn part_and_whole() -> (Shape, Shape, [Vec<u32>; 2]) {
        let (part, whole) = (torus(KEPT), torus(RINGS));
        let given = |Shape { mesh, .. }: &Shape| -> Vec<Point> {
            mesh.vertices.iter().map(|&p| mesh.as_given(p)).collect()
        };
        let nearest = |from: &[Point], to: &[Point]| SpaceTree::new(to).nearest_to_each(from);
        let (on_part, on_whole) = (given(&part), given(&whole));
        let images = [nearest(&on_part, &on_whole), nearest(&on_whole, &on_part)];
        (part, whole, images)
    }

    fn around(whole: &Shape, images: &[u32], lengths: f64) -> Option<Piece> {
        Piece::around(whole, images, lengths, &Progress::default()).expect("goes on")
    }

    #[test]
    fn a_part_covers_what_it_was_cut_from() {
        let (part, whole, [images, _]) = part_and_whole();
        let lengths = part.unit / whole.unit;
        let piece = around(&whole, &images, lengths).expect("a third is left");
        // Half a ring more or less at both rims.
        let area = piece.shape.unit.powi(2) / lengths.powi(2);
        assert!((area - 1.0).abs() < 1.0 / KEPT as f64, "{area}");
        let at = |v: &u32| whole.mesh.vertices[*v as usize];
        let truth: Vec<Point> = images.iter().map(at).collect();
        let tree = SpaceTree::new(&truth);
        for p in piece.vertices.iter().map(at) {
            let there = truth[tree.nearest(p).expect("there are images") as usize];
            assert!(vector::distance(p, there) < RING, "{p:?}");
        }
    }

    #[test]
    fn where_a_map_leaves_a_gap_the_part_still_hangs_together() {
        let (part, whole, [mut images, _]) = part_and_whole();
        // All of a belt is mapped onto one of its sides.
        let angle = |v: u32| {
            let p = whole.mesh.as_given(whole.mesh.vertices[v as usize]);
            p[1].atan2(p[0])
        };
        let belt = 1.5..1.8;
        let beside = (0..whole.mesh.vertices.len() as u32)
            .find(|&v| (1.4..1.5).contains(&angle(v)))
            .expect("the torus is closed");
        for image in &mut images {
            if belt.contains(&angle(*image)) {
                *image = beside;
            }
        }
        let piece = around(&whole, &images, part.unit / whole.unit).expect("it hangs together");
        let inside = |v: &&u32| belt.contains(&angle(**v));
        assert!(piece.vertices.iter().filter(inside).count() > 0);
        let angles: Vec<f64> = piece.vertices.iter().map(|&v| angle(v)).collect();
        assert!(angles.iter().any(|a| (1.0..1.5).contains(a)));
        assert!(angles.iter().any(|a| (1.8..2.5).contains(a)));
    }

    #[test]
    fn of_a_whole_nothing_is_cut_away() {
        let whole = torus(RINGS);
        let images: Vec<u32> = (0..whole.mesh.vertices.len() as u32).collect();
        assert!(around(&whole, &images, 1.0).is_none());
    }

    #[test]
    fn what_the_part_lacks_goes_to_its_rim() {
        let (part, whole, [on_whole, on_part]) = part_and_whole();
        let constraints = Constraints::default();
        for part_asks in [true, false] {
            let (source, target, coverage) = if part_asks {
                (&whole, &part, Coverage::TARGET_IS_PART)
            } else {
                (&part, &whole, Coverage::SOURCE_IS_PART)
            };
            let pair = Pair {
                lengths: target.unit / source.unit,
                ..testing::pair(source, target, coverage, &constraints)
            };
            let by_part = PointMaps {
                target_to_source: on_whole.clone(),
                source_to_target: on_part.clone(),
            };
            let truth = if part_asks {
                by_part
            } else {
                by_part.inverse()
            };
            let start = Refined::by_images(&pair, Which::Target, truth);
            let found = refined_on_covered(&pair, &start, &Progress::default(), &|_| Ok(()))
                .expect("goes on")
                .expect("a third is cut away");
            let (of_part, of_whole) = if part_asks {
                (found.target(), found.source())
            } else {
                (found.source(), found.target())
            };
            let off = |shape: &Shape, a: u32, b: u32| {
                let [p, q] = [a, b].map(|v| shape.mesh.vertices[v as usize]);
                vector::distance(p, q)
            };
            let errors: f64 = (0..part.mass.len())
                .map(|v| part.mass[v] * off(&whole, of_part.images.vertex[v], on_whole[v]))
                .sum();
            // Half the distance between vertices.
            assert!(errors < 0.01, "{errors}");
            for v in 0..whole.mass.len() {
                let there = on_whole[on_part[v] as usize];
                if off(&whole, v as u32, there) > 2.0 * RING {
                    let image = of_whole.images.vertex[v];
                    let rim = part.mesh.boundary_vertices();
                    let away = rim.iter().map(|&r| off(&part, r, image));
                    assert!(away.fold(f64::INFINITY, f64::min) < RING / pair.lengths.min(1.0));
                }
            }
        }
    }
}
