//! Embeddings of both shapes in a step, and the images found in them.

use faer::Mat;

use super::state::Refined;
use crate::error::Result;
use crate::matching::refinement::propagation::Images;
use crate::matching::refinement::settings::EMBEDDING;
use crate::matching::refinement::side::{Surface, Weights};
use crate::watch::progress::Check;

/// With low-passed surfaces.
pub(super) const LOW_PASSED: Weights = Weights {
    positions: 0.9,
    normals: 0.045,
    looks: 0.9,
    functions: usize::MAX,
};
/// With whole surfaces, whose normals are rougher and whose positions say more.
pub(super) const WHOLE: Weights = Weights {
    positions: 0.9,
    normals: 0.04,
    looks: 0.55,
    functions: usize::MAX,
};
/// With surfaces that coincide, where the nearest point is the image; normals tell the sides of what is
/// thin.
pub(super) const COINCIDING: Weights = Weights {
    positions: 20.0,
    normals: 0.1,
    looks: 0.0,
    functions: usize::MAX,
};
/// With one surface deformed onto the other, along which it slides: the nearest point as there, with somewhat more of
/// the normals, and so much of the spectrum that parts that touch are not taken for one another.
pub(super) const SLIDING: Weights = Weights {
    positions: 20.0,
    normals: 0.2,
    looks: 0.0,
    functions: 20,
};
/// Where it slid to, in other poses: places say less than before they were drawn to what the spectrum says.
pub(super) const AFTER_SLIDING: Weights = Weights {
    positions: 0.5,
    ..WHOLE
};

impl Refined<'_> {
    /// The deformed surface and the images of both sides, to be [put back](Self::put_back).
    pub(super) fn kept(&self) -> (Mat<f64>, [Images; 2]) {
        let images = [self.moving.images.clone(), self.still.images.clone()];
        (self.deformed.clone(), images)
    }

    /// Goes back to what was kept of a state on the whole surface.
    pub(super) fn put_back(&mut self, (deformed, images): (Mat<f64>, [Images; 2])) {
        self.deformed = deformed;
        [self.moving.images, self.still.images] = images;
        self.write_rows(Surface::Whole, WHOLE);
    }

    /// Images of the moving shape's asking vertices and of the other's.
    pub(super) fn images(&self) -> [Vec<u32>; 2] {
        [&self.moving, &self.still].map(|side| side.images.vertex.clone())
    }

    /// Share of the images that are not those of before.
    pub(super) fn changed_since(&self, before: &[Vec<u32>; 2]) -> f64 {
        let (mut changed, mut all) = (0, 0);
        for (side, before) in [&self.moving, &self.still].into_iter().zip(before) {
            let images = side.images.vertex.iter().zip(before);
            changed += images.filter(|(now, before)| now != before).count();
            all += before.len();
        }
        changed as f64 / all as f64
    }

    /// Embeddings by the present map and the deformed surface beside one of the still shape's, and the images in them.
    pub(super) fn embed(
        &mut self,
        of_still: Surface<'_>,
        weights: Weights,
        check: Check<'_>,
    ) -> Result<()> {
        check()?;
        self.write_rows(of_still, weights);
        self.find_images(EMBEDDING.sweeps, check)
    }

    /// Embeddings by the present map and surfaces.
    pub(super) fn write_rows(&mut self, of_still: Surface<'_>, weights: Weights) {
        let (moving, still) = (&mut self.moving, &mut self.still);
        let deformed = Surface::Deformed(self.deformed.as_ref());
        let (matrix, shared) = (self.matrix.as_ref(), weights.of(&self.shared));
        rayon::join(
            || moving.embed(None, shared, deformed, weights),
            || still.embed(Some(matrix), shared, of_still, weights),
        );
    }

    /// The moving shape's alone.
    pub(super) fn write_moving_rows(&mut self, weights: Weights) {
        let deformed = Surface::Deformed(self.deformed.as_ref());
        let shared = weights.of(&self.shared);
        self.moving.embed(None, shared, deformed, weights);
    }

    /// The still shape's alone.
    pub(super) fn write_still_rows(&mut self, surface: Surface<'_>, weights: Weights) {
        let (matrix, shared) = (self.matrix.as_ref(), weights.of(&self.shared));
        self.still.embed(Some(matrix), shared, surface, weights);
    }

    /// Settles the images of both sides in the present embeddings; those of landmarks are given.
    pub(super) fn find_images(&mut self, sweeps: usize, check: Check<'_>) -> Result<()> {
        let Self { moving, still, .. } = self;
        let (moving_rows, still_rows) = (&moving.rows, &still.rows);
        let (on_moving, on_still) = (&moving.shape.neighbours, &still.shape.neighbours);
        let (asked, answered) = rayon::join(
            || {
                moving.images.settle(
                    &moving.asking,
                    (moving_rows, &moving.neighbours),
                    (still_rows, on_still),
                    sweeps,
                    check,
                )
            },
            || {
                still.images.settle(
                    &still.asking,
                    (still_rows, &still.neighbours),
                    (moving_rows, on_moving),
                    sweeps,
                    check,
                )
            },
        );
        asked.and(answered)?;
        moving.answer_landmarks();
        still.answer_landmarks();
        Ok(())
    }
}
