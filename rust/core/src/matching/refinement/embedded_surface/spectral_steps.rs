//! Steps on low-passed surfaces, of more eigenfunctions each, by one way or by two.

use super::embedding::LOW_PASSED;
use super::schedule::DETAIL;
use super::state::Refined;
use crate::error::Result;
use crate::matching::problem::point_map::PointMap;
use crate::matching::refinement::regions;
use crate::matching::refinement::settings::EMBEDDING;
use crate::matching::refinement::side::Surface;
use crate::watch::progress::Check;

/// Numbers of eigenfunctions, one a step, from the map that is given to fingers and ears.
pub(super) const CLIMB: &[usize] = &[60, 80, 100, 120];
/// Those of the second way before it climbs.
const DETOUR: &[usize] = &[15, 20, 30, 40, 15, 20, 30, 40];

impl Refined<'_> {
    /// Climbs as it stands and by way of few eigenfunctions, and joins what is better of both.
    pub(super) fn take_two_ways(
        &mut self,
        detour: bool,
        report: &(dyn Fn(usize) -> Result<()> + Sync),
    ) -> Result<()> {
        // What is given climbs on from where it stands.
        let given = self.target().rows.dims;
        let climbed = CLIMB.partition_point(|&k| k <= given);
        let straight = &CLIMB[climbed.min(CLIMB.len() - 1)..];
        // On the first way and the second climb fewer askers save nothing, since their images are spread again.
        let mut other = detour.then(|| self.thinned());
        let (climbed, came_around) = rayon::join(
            || self.climb(straight, 0, report),
            || {
                other.as_mut().map_or(Ok(()), |other| {
                    other.climb(DETOUR, DETAIL, &|_| report(0))?;
                    other.climb(CLIMB, DETAIL, &|_| report(0))
                })
            },
        );
        climbed.and(came_around)?;
        if let Some(other) = other {
            let others = other.images_of_all(self, &|| report(CLIMB.len()))?;
            self.adopt_better_regions(&others);
        }
        Ok(())
    }

    /// The same where only some vertices of each shape ask for all.
    fn thinned(&self) -> Self {
        Self {
            moving: self.moving.thinned(),
            still: self.still.thinned(),
            moving_is: self.moving_is,
            deformed: self.deformed.clone(),
            matrix: self.matrix.clone(),
            shared: self.shared.clone(),
            lengths: self.lengths,
        }
    }

    /// Images of all the moving shape's vertices and of all the other's, of which these were asked for.
    fn images_of_all(&self, all: &Self, check: Check<'_>) -> Result<[Vec<u32>; 2]> {
        let (moving, still) = rayon::join(
            || {
                let all = &all.moving;
                self.moving
                    .images_of_all(all, &self.still, EMBEDDING.sweeps, check)
            },
            || {
                let all = &all.still;
                self.still
                    .images_of_all(all, &self.moving, EMBEDDING.sweeps, check)
            },
        );
        Ok([moving?, still?])
    }

    pub(super) fn climb(
        &mut self,
        sizes: &[usize],
        detail: usize,
        report: &(dyn Fn(usize) -> Result<()> + Sync),
    ) -> Result<()> {
        let most = self.moving.most().min(self.still.most());
        for (step, &size) in sizes.iter().enumerate() {
            self.advance(size.min(most), detail, &|| report(step))?;
        }
        Ok(())
    }

    /// Takes over the images that another refinement of this pair gave the moving shape where they are better, and
    /// those that it gave the other's vertices that lie there on either map.
    fn adopt_better_regions(&mut self, [on_still, on_moving]: &[Vec<u32>; 2]) {
        let own = &mut self.moving.images.vertex;
        let map = PointMap {
            from: self.moving.shape,
            to: self.still.shape,
            images: own,
        };
        let better = regions::better_elsewhere(map, self.lengths, on_still);
        for ((image, &there), &better) in own.iter_mut().zip(on_still).zip(&better) {
            if better {
                *image = there;
            }
        }
        let own = &mut self.still.images.vertex;
        for (image, &there) in own.iter_mut().zip(on_moving) {
            if better[*image as usize] || better[there as usize] {
                *image = there;
            }
        }
    }

    /// One step at k eigenfunctions: displacement of surfaces low-passed to k, or to more where the
    /// `detail` is, map, embeddings, images.
    fn advance(&mut self, k: usize, detail: usize, check: Check<'_>) -> Result<()> {
        check()?;
        let [k_moving, k_still] = self.sizes(k.max(detail));
        let (moving, still) = (&mut self.moving, &mut self.still);
        rayon::join(|| moving.low_pass(k_moving), || still.low_pass(k_still));
        let at_images = self.at_images(k);
        let (deformed, matrix) = rayon::join(
            || self.displaced(&at_images, check),
            || self.mapped(&at_images, check),
        );
        self.deformed = deformed?;
        (self.matrix, self.shared) = matrix?;
        self.embed(Surface::Smoothed, LOW_PASSED, check)
    }
}
