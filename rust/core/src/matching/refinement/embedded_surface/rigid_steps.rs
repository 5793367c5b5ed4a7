//! Steps on the whole surface: drawn onto the other as rigidly as possible, or moved onto it where both coincide.

use super::embedding::{COINCIDING, WHOLE};
use super::state::{Refined, as_matrix};
use crate::algebra::similarity::Similarity;
use crate::algebra::vector::{self, Point};
use crate::deformation::rigid_surface::RigidSurface;
use crate::error::Result;
use crate::matching::refinement::settings::{COINCIDENCE, EMBEDDING, RIGID_STEPS};
use crate::matching::refinement::side::Surface;
use crate::watch::progress::Check;

impl Refined<'_> {
    /// Steps in which the moving surface itself, not low-passed, is drawn onto the other as rigidly as
    /// possible, and takes the place of the low-passed surface in the embedding.
    pub(super) fn settle_whole_surface(
        &mut self,
        mut surface: RigidSurface<'_>,
        sizes: &[usize],
        report: &(dyn Fn(usize) -> Result<()> + Sync),
    ) -> Result<()> {
        let most = self.matrix.nrows();
        surface.positions = (0..self.deformed.nrows())
            .map(|v| self.deformed_at(v))
            .collect();
        for (step, &size) in sizes.iter().enumerate() {
            let check = || report(step);
            let (places, at_images) = (self.places(), self.at_images(size.min(most)));
            // The other's embedding needs the map, but not the surface that is drawn.
            let (drawn, embedded) = rayon::join(
                || surface.drawn_to(&places, &check),
                || {
                    (self.matrix, self.shared) = self.mapped(&at_images, &check)?;
                    self.write_still_rows(Surface::Whole, WHOLE);
                    Ok(())
                },
            );
            drawn.and(embedded)?;
            self.deformed = as_matrix(&surface.positions);
            self.write_moving_rows(WHOLE);
            let before = self.images();
            self.find_images(EMBEDDING.sweeps, &check)?;
            if size.min(most) == most && self.changed_since(&before) < RIGID_STEPS.at_rest {
                break;
            }
        }
        Ok(())
    }

    /// Where on the still shape both maps see each vertex of the moving one, on average.
    fn places(&self) -> Vec<Point> {
        let still = &self.still.shape.mesh.vertices;
        let mut seen = vec![(0.0, [0.0; 3]); self.deformed.nrows()];
        let mut see = |vertex: u32, weight: f64, at: u32| {
            let (sum, moment) = &mut seen[vertex as usize];
            *sum += weight;
            *moment = vector::add(*moment, vector::scaled(still[at as usize], weight));
        };
        for (side, moves) in [(&self.moving, true), (&self.still, false)] {
            for (i, (&own, &image)) in side.asking.iter().zip(&side.images.vertex).enumerate() {
                if moves {
                    see(own, side.weights[i], image);
                } else {
                    see(image, side.weights[i], own);
                }
            }
        }
        let mean =
            |(sum, moment): (f64, Point)| vector::scaled(moment, 1.0 / sum.max(f64::MIN_POSITIVE));
        seen.into_iter().map(mean).collect()
    }

    /// Two meshes of one shape in one pose, however placed, are moved onto each other, and the nearest
    /// point there is the image. Changes nothing where the surfaces do not coincide, and tells whether they do.
    ///
    /// # Source
    /// Besl, `McKay`, "A method for registration of 3-D shapes", 1992, from the map found.
    pub(super) fn settle_coinciding(&mut self, check: Check<'_>) -> Result<bool> {
        let matched = self.matched();
        let motion = Similarity::fitted(&matched, false);
        let (mut total, mut square) = (0.0, 0.0);
        for (p, q, w) in matched {
            total += w;
            square += w * vector::distance(motion.apply(p), q).powi(2);
        }
        if square > RIGID_STEPS.same_pose.powi(2) * total {
            return Ok(false);
        }
        let kept = self.kept();
        for _ in 0..RIGID_STEPS.moves {
            let motion = Similarity::fitted(&self.matched(), false);
            let places = &self.moving.shape.mesh.vertices;
            let moved: Vec<Point> = places.iter().map(|&p| motion.apply(p)).collect();
            self.deformed = as_matrix(&moved);
            self.embed(Surface::Whole, COINCIDING, check)?;
        }
        let coincides = self.coincides();
        if !coincides {
            self.put_back(kept);
        }
        Ok(coincides)
    }

    /// Whether the deformed surface lies on the other but for a few vertices.
    fn coincides(&self) -> bool {
        let still = self.still.shape;
        let strays = |&(v, &image): &(usize, &u32)| {
            let off = vector::sub(self.deformed_at(v), still.mesh.vertices[image as usize]);
            vector::dot(still.normals[image as usize], off).abs() > COINCIDENCE.coincident
        };
        let images = &self.moving.images.vertex;
        let strayed = images.iter().enumerate().filter(strays).count();
        strayed as f64 <= COINCIDENCE.stray * images.len() as f64
    }
}
