//! Initial maps: a beam search over sign patterns, scored by geodesic distortion.
//!
//! The paper starts its optimisation from a given map. Here the eigenfunctions of both shapes are
//! aligned one by one: each new column of the map may keep or turn its sign, both children are
//! fitted through point maps, and the ones that distort geodesic distances least survive.

mod candidate;
mod sampled;
mod seeds;
pub mod settings;

use faer::Mat;
use rayon::prelude::*;

use self::candidate::SampledPair;
use crate::error::{Error, Result};
use crate::matching::problem::pair::{Mirror, Pair, Part};
use crate::matching::search::settings::{CANDIDATE, SEARCH, SEEDS};
use crate::shape::gradients::{better_signs, coverage};
use crate::watch::progress::Progress;

pub use candidate::{CANDIDATE_SIZE, Candidate, SampledBases, fit, gram};
pub use sampled::Width;
pub use seeds::best_signs;

/// How far behind the best a candidate may be, by rank, once orientation counts: right ones stay below 1.15 at the end.
pub const RANKED_WITHIN: Reach = Reach {
    times: 1.6,
    floor: 0.01,
};

/// A multiple of the best figure. Equal maps of one shape differ by their samples only, the best
/// of them by nothing: all metrics up to the floor are as good as it.
#[derive(Debug, Clone, Copy)]
pub struct Reach {
    /// Of the best, or of the floor.
    pub times: f64,
    /// Least figure that counts.
    pub floor: f64,
}

impl Reach {
    /// Up to where metrics are in reach of the best.
    #[must_use]
    pub fn from(&self, best: f64) -> f64 {
        self.times * best.max(self.floor)
    }
}

/// Candidate maps of a pair, best first.
///
/// Candidates grow by an eigenfunction of the target each, or of the source the other way, and where bodies
/// differ either way misses maps that the other finds.
///
/// # Errors
/// [`Error::Cancelled`]; [`Error::NoMap`] when no seed gives a finite energy.
pub fn candidates(pair: &Pair<'_>, width: Width, progress: &Progress) -> Result<Vec<Candidate>> {
    let mut found = SampledPair::new(*pair, width).search(progress)?;
    if width.both_ways {
        let constraints = pair.constraints.inverse();
        let inverse = SampledPair::new(pair.inverse(&constraints), width).search(progress)?;
        found.extend(inverse.into_iter().map(Candidate::inverse));
        found.sort_by(|a, b| a.rank.total_cmp(&b.rank));
    }
    if found.is_empty() {
        return Err(Error::NoMap {
            reason: "no candidate has a finite distortion; check the shapes' scale and holes"
                .into(),
        });
    }
    Ok(found)
}

impl SampledPair<'_> {
    /// Candidate maps of [`CANDIDATE_SIZE`] eigenfunctions, best first; none when no seed gives a finite energy.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    fn search(&self, progress: &Progress) -> Result<Vec<Candidate>> {
        let width = self.width;
        let largest = self.largest();
        let first = SEEDS.seed_size.min(largest);
        let mut seeds = self.sign_seeds(first);
        seeds.extend(self.scaling_seeds(first));
        let seeds = each(&seeds, |seed| self.refitted(seed, first))?;
        let mut beam = self.pruned(seeds, width.first, SEARCH.basin);
        for k in first + 1..=largest {
            progress.check()?;
            if k % SEARCH.turned_every == 0
                && k >= SEARCH.turned_from
                && self.pair.uses(Part::Orientation)
            {
                let turned = each(&beam, |parent| self.reoriented(parent))?;
                beam.extend(turned.into_iter().flatten());
            }
            let exchanges = k > first + 1 && self.nearly_double(k);
            let children = each(&beam, |parent| self.children(parent, k, exchanges))?;
            beam = self.pruned(
                children.into_iter().flatten().collect(),
                width.beam,
                SEARCH.basin,
            );
            if let Some(best) = beam.first().filter(|_| k >= CANDIDATE.oriented_from) {
                // A mirrored map that distorts less says that one shape is a mirror image.
                let (rank, energy) = (RANKED_WITHIN.from(best.rank), best.energy);
                beam.retain(|candidate| candidate.rank <= rank || candidate.energy < energy);
            }
        }
        for _ in 0..2 {
            beam = each(&beam, |parent| self.refitted(parent, largest))?;
        }
        Ok(self.pruned(beam, width.beam, SEARCH.same))
    }

    /// A candidate fitted at k with the last column turned, with the last two exchanged either way, and as it is: side by
    /// side, since at last there are few candidates.
    fn children(&self, parent: &Candidate, k: usize, exchanges: bool) -> Result<Vec<Candidate>> {
        let matrix = self.fit(parent.images.as_slices(), k)?;
        let mut changes = vec![vec![(k - 1, k - 1, -1.0)]];
        if exchanges {
            for sign in [1.0, -1.0] {
                changes.push(vec![(k - 2, k - 1, sign), (k - 1, k - 2, sign)]);
            }
        }
        let (changed, plain) = rayon::join(
            || each(&changes, |columns| self.turned(&matrix, columns)),
            || self.judged(matrix.clone()),
        );
        let mut children = changed?;
        children.push(plain);
        Ok(children)
    }

    /// A map with some columns replaced, `(column, by which, times)`, and fitted anew.
    fn turned(&self, given: &Mat<f64>, columns: &[(usize, usize, f64)]) -> Result<Candidate> {
        let mut matrix = given.clone();
        for &(to, from, sign) in columns {
            for i in 0..matrix.nrows() {
                matrix[(i, to)] = sign * given[(i, from)];
            }
        }
        let size = matrix.ncols();
        let images = self.images(matrix.as_ref());
        self.fitted(images.as_slices(), size)
    }

    /// Whether the last two of k eigenvalues are so close on either shape that their functions may
    /// come mixed: then a reflection of the surface is no longer a change of one sign.
    fn nearly_double(&self, k: usize) -> bool {
        [self.pair.target, self.pair.source]
            .iter()
            .any(|s| s.basis.values[k - 1] < SEARCH.nearly_double * s.basis.values[k - 2])
    }

    /// The same map with the columns turned that speak against its orientation: thin parts are
    /// nearly symmetric from front to back, and their functions turn together.
    fn reoriented(&self, candidate: &Candidate) -> Result<Option<Candidate>> {
        let coverage = coverage(
            &self.side_source.gradients,
            &self.side_target.gradients,
            candidate.matrix.as_ref(),
            (candidate.images.target_to_source.iter().enumerate())
                .map(|(asking, image)| (image.index(), asking)),
            candidate.matrix.ncols() - 1,
        );
        let signs = better_signs((self.wanted_sign() * coverage).as_ref());
        if signs.iter().all(|&s| s > 0.0) {
            return Ok(None);
        }
        let (rows, columns) = (candidate.matrix.nrows(), candidate.matrix.ncols());
        let turned = Mat::from_fn(rows, columns, |i, j| signs[j] * candidate.matrix[(i, j)]);
        let images = self.images(turned.as_ref());
        self.fitted(images.as_slices(), columns).map(Some)
    }

    /// The best candidates: up to half of them from different basins, the rest merely different.
    fn pruned(&self, mut all: Vec<Candidate>, size: usize, basin: f64) -> Vec<Candidate> {
        // Among the maps of a shape to itself there is always the identity.
        all.retain(|c| {
            let is_sought = match self.pair.mirror {
                Mirror::Only => c.orientation >= 0.0,
                Mirror::Away => c.orientation >= 0.0 && self.moves(c) > SEARCH.away,
                Mirror::Forbid | Mirror::Allow => true,
            };
            c.rank.is_finite() && is_sought
        });
        all.sort_by(|a, b| a.rank.total_cmp(&b.rank));
        let mut chosen: Vec<usize> = Vec::new();
        for (distance, most) in [(basin, size / 2), (SEARCH.same, size)] {
            for i in 0..all.len() {
                if chosen.len() >= most {
                    break;
                }
                if chosen
                    .iter()
                    .all(|&j| i != j && self.apart(&all[i], &all[j]) > distance)
                {
                    chosen.push(i);
                }
            }
        }
        chosen.sort_unstable();
        let mut keep = vec![false; all.len()];
        for i in chosen {
            keep[i] = true;
        }
        let mut flags = keep.into_iter();
        all.retain(|_| flags.next() == Some(true));
        all
    }
}

/// Applies a fallible step to all candidates in parallel, in order.
fn each<T: Sync, R: Send>(
    items: &[T],
    step: impl Fn(&T) -> Result<R> + Sync + Send,
) -> Result<Vec<R>> {
    items.par_iter().map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matching::problem::constraints::Constraints;
    use crate::matching::problem::pair::Coverage;
    use crate::testing::{pair, torus};

    #[test]
    fn the_inverse_pair_has_the_inverse_candidates() {
        let (coarse, fine) = (torus(24), torus(32));
        let constraints = Constraints::default();
        let there = pair(&fine, &coarse, Coverage::BOTH, &constraints);
        let width = Width::NARROW.both_ways(true);
        let progress = Progress::default();
        let found = candidates(&there, width, &progress).expect("tori look alike");
        let back =
            candidates(&there.inverse(&constraints), width, &progress).expect("tori look alike");
        assert_eq!(found.len(), back.len());
        assert!(found.is_sorted_by(|a, b| a.rank <= b.rank));
        for candidate in back.into_iter().map(Candidate::inverse) {
            let same = |c: &&Candidate| c.matrix == candidate.matrix;
            let other = found.iter().find(same).expect("it is found both times");
            assert_eq!(other.images, candidate.images);
        }
    }
}
