//! The surface slides along the other, deformed by maps that are affine on each part.

use faer::Mat;
use rayon::prelude::*;

use super::embedding::{AFTER_SLIDING, SLIDING};
use super::state::Refined;
use crate::algebra::vector::Point;
use crate::deformation::piecewise_affine::{PiecewiseAffine, Pull};
use crate::error::Result;
use crate::matching::problem::point_map::PointMap;
use crate::matching::refinement::parts::{self, Foot};
use crate::matching::refinement::propagation::Images;
use crate::matching::refinement::regions;
use crate::matching::refinement::settings::{EMBEDDING, POINT_TO_PLANE, RIGID_STEPS};
use crate::matching::refinement::side::Surface;
use crate::mesh::numbering::WorkingVertex;
use crate::mesh::surface_point::SurfacePoint;
use crate::shape::pointwise_map::{EmbeddedTriangles, projected};
use crate::watch::progress::Check;

impl Refined<'_> {
    /// The moving surface [slides](Self::slide) along the other. Between bodies of different build in one pose this is the
    /// last word. In other poses spectrum and looks have it, and nothing changes where edges would be stretched much more
    /// than before.
    pub(super) fn settle_parts(
        &mut self,
        surface: PiecewiseAffine<'_>,
        creases_give_way: bool,
        check: Check<'_>,
    ) -> Result<()> {
        let (moving, still) = (self.moving.shape, self.still.shape);
        let matched: Vec<(Point, Point, f64)> = (self.moving.images.vertex.iter().enumerate())
            .map(|(v, &image)| {
                let place = still.mesh.vertices[image as usize];
                (moving.mesh.vertices[v], place, moving.mass[v])
            })
            .collect();
        let same_pose = parts::off_affine(&matched).is_some_and(|off| off <= RIGID_STEPS.same_pose);
        if same_pose {
            return self.slide(surface, creases_give_way, check);
        }
        let lengths = self.lengths;
        let stretch = |images: &Images| {
            let all = 0..images.vertex.len() as u32;
            let map = PointMap {
                from: moving,
                to: still,
                images: &images.vertex,
            };
            regions::edge_misfit(map, lengths, all)
        };
        let kept = self.kept();
        let before = stretch(&self.moving.images);
        self.slide(surface, creases_give_way, check)?;
        if stretch(&self.moving.images) > POINT_TO_PLANE.most_stretched * before {
            self.put_back(kept);
            return Ok(());
        }
        for _ in 0..POINT_TO_PLANE.steps_after_sliding {
            let at_images = self.at_images(self.matrix.nrows());
            (self.matrix, self.shared) = self.mapped(&at_images, check)?;
            self.embed(Surface::Whole, AFTER_SLIDING, check)?;
        }
        Ok(())
    }

    /// Rounds in which the moving surface is deformed by maps that are affine on each part, and drawn onto the tangent
    /// planes at its images, along which it slides; creases of either draw little, or as much as all else.
    fn slide(
        &mut self,
        mut surface: PiecewiseAffine<'_>,
        creases_give_way: bool,
        check: Check<'_>,
    ) -> Result<()> {
        let (moving, still) = (self.moving.shape, self.still.shape);
        let foot = |image: &SurfacePoint| {
            let foot = Foot::new(still, image);
            if creases_give_way {
                foot
            } else {
                foot.drawing_fully()
            }
        };
        let weight = |v: usize| {
            let bulging = if creases_give_way {
                moving.bulging[v]
            } else {
                1.0
            };
            moving.mass[v] * bulging
        };
        let (mut anchors, mut drawn): (Option<Vec<Point>>, Option<Vec<Point>>) = (None, None);
        for round in 0..POINT_TO_PLANE.slides {
            let images = self.image_points(
                round + POINT_TO_PLANE.slides_within_triangles >= POINT_TO_PLANE.slides,
                check,
            )?;
            let feet: Vec<Foot> = images.par_iter().map(foot).collect();
            let anchors = anchors.get_or_insert_with(|| feet.iter().map(|f| f.place).collect());
            // What the rigid surface left within the other body is not swallowed.
            let placed = |v: usize| (round > 0).then(|| self.deformed_at(v));
            let pulls: Vec<Pull> = (feet.par_iter().zip(&*anchors).enumerate())
                .map(|(v, (foot, anchor))| foot.pull(weight(v), placed(v), *anchor))
                .collect();
            let places = surface.drawn_to(&pulls, check)?;
            let last = round + 1 == POINT_TO_PLANE.slides;
            let from = drawn.as_ref().filter(|_| !last).unwrap_or(&places);
            self.deformed = Mat::from_fn(places.len(), 3, |v, c| {
                places[v][c] + POINT_TO_PLANE.beyond * (places[v][c] - from[v][c])
            });
            drawn = Some(places);
            let before = self.images();
            if round == 0 {
                self.write_rows(Surface::Whole, SLIDING);
            } else {
                self.write_moving_rows(SLIDING);
            }
            self.find_images(EMBEDDING.sweeps, check)?;
            if self.changed_since(&before) < POINT_TO_PLANE.slid {
                break;
            }
        }
        Ok(())
    }

    /// Images of the moving shape's vertices: points of triangles, or the vertices nearest to them.
    fn image_points(&self, within_triangles: bool, check: Check<'_>) -> Result<Vec<SurfacePoint>> {
        let (still, images) = (self.still.shape, &self.moving.images.vertex);
        if within_triangles {
            let triangles = EmbeddedTriangles::new(still, &self.still.rows);
            projected(&triangles, &self.moving.rows, images, check)
        } else {
            let at_vertex = |&image: &u32| still.point_at(WorkingVertex(image));
            Ok(images.par_iter().map(at_vertex).collect())
        }
    }
}
