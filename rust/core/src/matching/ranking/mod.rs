//! Which of the candidates is the map.

mod contradiction;
mod metrics;
pub mod quality;
pub mod settings;
mod shortlist;

use std::sync::Arc;

use faer::Mat;
use rayon::prelude::*;

use self::contradiction::{landmark_images, missed_landmarks, off_axes, off_symmetry};
use self::metrics::of_judged;
use self::shortlist::{Shortlisted, mirrored_gain, shortlist};
use crate::algebra::vector;
use crate::error::Result;
use crate::matching::problem::constraints::Constraints;
use crate::matching::problem::landmark::Landmark;
use crate::matching::problem::pair::{Coverage, Mirror, Pair};
use crate::matching::problem::point_map::{PointMaps, SampledMap};
use crate::matching::ranking::settings::{RANKING, SHORTLIST};
use crate::matching::refinement::coinciding::Placed;
use crate::matching::refinement::embedded_surface::{self, Refined};
use crate::matching::refinement::settings::UPSAMPLING;
use crate::matching::search::{Candidate, Reach};
use crate::mesh::numbering::WorkingVertex;
use crate::shape::Shape;

pub use metrics::{Metrics, agreement, judging, metrics, sampled_images};

/// No map comes near where the second rank is beyond this.
const ALONE: Reach = Reach {
    times: 1.6,
    floor: 5e-3,
};

/// A map that may be the right one, before its final refinement.
#[derive(Debug, Clone)]
pub struct Hypothesis {
    /// Map of up to 120 eigenfunctions, target coefficients → source coefficients.
    pub matrix: Mat<f64>,
    /// Its metrics in the vote.
    pub metrics: Metrics,
    /// Which shape it takes as a part of the other.
    pub coverage: Coverage,
    /// Where one shape lies on the other, if that is what it says.
    pub placed: Option<Arc<Placed>>,
    /// How many units of length of the source one of the target is, where that is known, else 1.
    pub lengths: f64,
    /// Vertices that are the images of the farthest-point samples of either shape.
    pub images: PointMaps<Vec<u32>>,
}

impl Hypothesis {
    /// Whether it says where one shape lies on the other, and no more.
    #[must_use]
    pub fn is_placed(&self) -> bool {
        self.placed.is_some()
    }

    /// Whether a part is sought on a whole, by more than where it lies.
    #[must_use]
    pub fn is_of_part(&self) -> bool {
        self.coverage != Coverage::BOTH && !self.is_placed()
    }

    /// Replaces its metrics and images by those of its completed map.
    pub fn judge_anew(&mut self, metrics: Metrics, completed: &Refined<'_>) {
        self.metrics = metrics;
        self.images = sampled_images(completed);
    }

    /// Source vertices of the samples on which maps are judged.
    #[must_use]
    pub fn judged_images(&self) -> &[u32] {
        of_judged(&self.images.target_to_source)
    }
}

/// Plausible maps: upsamples and scores the candidates, refines the best that differ for a short while, and orders
/// them by what the refined maps do to distances and orientation.
///
/// # Errors
/// [`crate::Error::NoMap`] when no candidate keeps the orientation; [`crate::Error::Cancelled`].
pub fn vote(
    pair: &Pair<'_>,
    candidates: &[Candidate],
    report: &(dyn Fn(f64) -> Result<()> + Sync),
) -> Result<Vec<Hypothesis>> {
    let mut judged: Vec<Hypothesis> = shortlist(pair, candidates, report)?
        .par_iter()
        .map(|voter| judged(pair, voter, &|| report(0.6)))
        .collect::<Result<_>>()?;
    judged.sort_by(|a, b| a.metrics.cost().total_cmp(&b.metrics.cost()));
    let gain = mirrored_gain(candidates);
    for hypothesis in &mut judged {
        hypothesis.metrics.mirrored_gain = gain;
    }
    Ok(judged)
}

/// Short refinement, then the metrics by which candidates are ordered.
///
/// Landmarks do not guide it: what a candidate makes of them by itself tells which one is right.
fn judged(
    pair: &Pair<'_>,
    voter: &Shortlisted,
    check: &(dyn Fn() -> Result<()> + Sync),
) -> Result<Hypothesis> {
    let unguided = Pair {
        constraints: &Constraints::default(),
        ..*pair
    };
    let state = embedded_surface::refined(
        &unguided,
        voter.matrix.as_ref(),
        None,
        embedded_surface::SHORT,
        &|_| check(),
    )?;
    let images = sampled_images(&state);
    let mut metrics = metrics(pair, voter.matrix.as_ref(), &images);
    metrics.contradiction =
        voter.contradiction + off_symmetry(pair, of_judged(&images.target_to_source));
    Ok(Hypothesis {
        matrix: state.low_map(RANKING.refined_size)?,
        metrics,
        coverage: pair.coverage,
        placed: None,
        lengths: pair.lengths,
        images,
    })
}

/// A map of up to 60 eigenfunctions, `(kₛ, kₜ)`, refined for a short while and judged as one that was found by a search.
///
/// # Errors
/// [`crate::Error::Cancelled`], [`crate::Error::NotFactorised`].
pub fn of_first_map(
    pair: &Pair<'_>,
    matrix: Mat<f64>,
    check: &(dyn Fn() -> Result<()> + Sync),
) -> Result<Hypothesis> {
    let size = matrix.ncols();
    let (asking, answering) = rayon::join(
        || pair.target.rows.first(size),
        || pair.source.rows.times(matrix.as_ref()),
    );
    let of_landmarks = landmark_images(pair, &answering, &asking);
    let first = Shortlisted {
        matrix,
        contradiction: missed_landmarks(pair, &of_landmarks),
    };
    let mut found = judged(pair, &first, check)?;
    found.metrics.contradiction += off_axes(pair, found.judged_images());
    Ok(found)
}

/// Plausible maps of a part into a whole, best first: first maps, `(kₛ, kₜ)`, refined for a short while. How long the
/// unit of one is on the other has to be known.
///
/// # Errors
/// [`crate::Error::Cancelled`], [`crate::Error::NotFactorised`].
pub fn of_part(
    pair: &Pair<'_>,
    first_maps: &[Mat<f64>],
    check: &(dyn Fn() -> Result<()> + Sync),
) -> Result<Vec<Hypothesis>> {
    let unguided = Pair {
        constraints: &Constraints::default(),
        ..*pair
    };
    let judged: Vec<Hypothesis> = first_maps
        .par_iter()
        .map(|first| {
            let schedule = embedded_surface::OF_PART;
            let state =
                embedded_surface::refined(&unguided, first.as_ref(), None, schedule, &|_| check())?;
            let images = sampled_images(&state);
            let on_source = of_judged(&images.target_to_source);
            let matrix = state.low_map(UPSAMPLING.upsampled_size)?;
            let mut metrics = metrics(pair, matrix.as_ref(), &images);
            let of_landmarks = landmark_images(pair, &state.source().rows, &state.target().rows);
            metrics.contradiction = missed_landmarks(pair, &of_landmarks)
                + off_axes(pair, on_source)
                + off_symmetry(pair, on_source);
            Ok(Hypothesis {
                matrix,
                metrics,
                coverage: pair.coverage,
                placed: None,
                lengths: pair.lengths,
                images,
            })
        })
        .collect::<Result<_>>()?;
    let direct = judged
        .into_iter()
        .filter(|h| pair.mirror == Mirror::Allow || h.metrics.orientation > 0.0);
    let mut best = merged(pair.source, direct.collect(), Vec::new());
    best.truncate(SHORTLIST.shortlisted);
    Ok(best)
}

/// The map between surfaces that lie on one another, found without what is known of it.
///
/// # Errors
/// [`crate::Error::NotFactorised`].
pub fn of_placed(pair: &Pair<'_>, found: &Refined<'_>, placed: Arc<Placed>) -> Result<Hypothesis> {
    let asking = found.target();
    let matrix = found.low_map(UPSAMPLING.upsampled_size)?;
    let images = sampled_images(found);
    let on_source = of_judged(&images.target_to_source);
    let on_target = of_judged(&images.source_to_target);
    let mut metrics = metrics(pair, matrix.as_ref(), &images);
    // Spectra of a part and of the whole say little of which side is up; here normals do.
    metrics.orientation = pair
        .coverage
        .mean(
            facing(pair.samples_to_target(on_target)),
            facing(pair.samples_to_source(on_source)),
        )
        .abs();
    let image = |l: &Landmark<WorkingVertex>| asking.images.vertex[l.target.index()];
    let of_landmarks: Vec<u32> = pair.constraints.landmarks.iter().map(image).collect();
    metrics.contradiction = missed_landmarks(pair, &of_landmarks) + off_axes(pair, on_source);
    Ok(Hypothesis {
        matrix,
        metrics,
        coverage: pair.coverage,
        placed: Some(placed),
        lengths: pair.lengths,
        images,
    })
}

/// Mean cosine between the normals at one shape's judging samples and at their images.
fn facing(map: SampledMap<'_>) -> f64 {
    let cosine = |(&v, &image): (&u32, &u32)| {
        vector::dot(map.from.normals[v as usize], map.to.normals[image as usize])
    };
    let judged = judging(map.from).iter().zip(map.images);
    judged.map(cosine).sum::<f64>() / map.images.len() as f64
}

/// How many hypotheses, best first, come so close to the first that their order by rank says
/// little.
#[must_use]
pub fn rivals(hypotheses: &[Hypothesis]) -> usize {
    let bound = hypotheses
        .first()
        .map_or(0.0, |best| (1.0 + RANKING.close) * best.metrics.cost());
    hypotheses
        .iter()
        .take_while(|h| h.metrics.cost() <= bound)
        .count()
}

/// The hypotheses of two searches, best first, of those that say the same the better one.
#[must_use]
pub fn merged(source: &Shape, some: Vec<Hypothesis>, more: Vec<Hypothesis>) -> Vec<Hypothesis> {
    let mut all: Vec<Hypothesis> = some.into_iter().chain(more).collect();
    all.sort_by(|a, b| a.metrics.cost().total_cmp(&b.metrics.cost()));
    let mut kept: Vec<Hypothesis> = Vec::new();
    for hypothesis in all {
        if !kept
            .iter()
            .any(|other| say_the_same(source, &hypothesis, other))
        {
            kept.push(hypothesis);
        }
    }
    kept
}

/// Whether two hypotheses are one map but for details.
#[must_use]
pub fn say_the_same(source: &Shape, a: &Hypothesis, b: &Hypothesis) -> bool {
    source.mean_spectral_distance(a.judged_images(), b.judged_images()) <= SHORTLIST.different
}

/// Holds the symmetry of both shapes, found since, against hypotheses that were made without it.
pub fn hold_symmetry_against(pair: &Pair<'_>, hypotheses: &mut [Hypothesis]) {
    for hypothesis in hypotheses {
        hypothesis.metrics.contradiction += off_symmetry(pair, hypothesis.judged_images());
    }
}

/// Whether there is a first hypothesis and the rank of every other is far above its.
#[must_use]
pub fn stands_alone(hypotheses: &[Hypothesis]) -> bool {
    hypotheses.split_first().is_some_and(|(first, others)| {
        let bound = ALONE.from(first.metrics.cost());
        others.iter().all(|h| h.metrics.cost() > bound)
    })
}

/// Writes into all metrics how far each map lies from the chosen one, and how clearly that one stands before the best that
/// differs: by the order of the vote, and before the best that lies far from it also by that of
/// [curvatures](Metrics::cost_by_curvatures), whichever says less. Turned front to back, some bodies look more alike by one and some
/// by the other.
pub fn compare_with_chosen(source: &Shape, chosen: usize, hypotheses: &mut [Hypothesis]) {
    let images = hypotheses[chosen].judged_images().to_vec();
    let mut margin = RANKING.margin_at_most;
    let best = hypotheses[chosen].metrics;
    for hypothesis in hypotheses.iter_mut() {
        let apart = source.mean_spectral_distance(hypothesis.judged_images(), &images);
        let metrics = &mut hypothesis.metrics;
        metrics.apart = apart;
        if metrics.apart > RANKING.another_map {
            margin = margin.min(metrics.cost() / best.cost());
        }
        if metrics.apart > RANKING.turned {
            margin = margin.min(metrics.cost_by_curvatures() / best.cost_by_curvatures());
        }
    }
    for hypothesis in hypotheses {
        hypothesis.metrics.margin = margin;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{AROUND, RINGS, torus};

    /// Metrics as a man turned front to back has them, and as the right map between the same two.
    #[test]
    fn a_map_with_better_curvatures_is_a_rival() {
        let shape = torus(RINGS);
        let found = |agreement: f64, extrinsic_agreement: f64, turned: u32| {
            let around = AROUND as u32;
            let image = |&v: &u32| v / around * around + (v % around + turned) % around;
            let images: Vec<u32> = shape.farthest.iter().map(image).collect();
            Hypothesis {
                matrix: Mat::new(),
                metrics: Metrics {
                    orientation: 0.7,
                    local_distortion: 0.03,
                    agreement,
                    extrinsic_agreement,
                    ..Metrics::default()
                },
                coverage: Coverage::BOTH,
                placed: None,
                lengths: 1.0,
                images: PointMaps {
                    target_to_source: images.clone(),
                    source_to_target: images,
                },
            }
        };
        let mut both = [found(0.65, 0.4, AROUND as u32 / 2), found(0.7, 0.2, 0)];
        assert!(both[1].metrics.cost() > both[0].metrics.cost());
        compare_with_chosen(&shape, 0, &mut both);
        assert!(both[1].metrics.apart > RANKING.turned);
        assert!(both.iter().all(|h| h.metrics.margin < 1.0));
    }
}
