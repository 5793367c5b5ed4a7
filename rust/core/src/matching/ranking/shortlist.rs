//! Candidates that take part in the vote: upsampled, scored, and different from one another.

use faer::Mat;
use rayon::prelude::*;

use super::contradiction::{landmark_images, missed_landmarks, off_axes};
use super::metrics::{judging, mean_change, orientation_of};
use crate::error::{Error, Result};
use crate::matching::problem::pair::{Coverage, Mirror, Pair, Part};
use crate::matching::problem::point_map::PointMaps;
use crate::matching::ranking::settings::{METRICS, SHORTLIST};
use crate::matching::refinement::upsampling;
use crate::matching::search::{Candidate, RANKED_WITHIN, Reach};
use crate::shape::Shape;
use crate::watch::progress::Check;

/// How far behind the best a candidate may be to vote, by score.
const VOTING_WITHIN: Reach = Reach {
    // Right ones stay below 1.25.
    times: 2.0,
    floor: 1e-5,
};

/// A candidate after upsampling.
pub(super) struct Shortlisted {
    /// `(60, 60)` map.
    pub(super) matrix: Mat<f64>,
    /// How far the map contradicts what is known.
    pub(super) contradiction: f64,
}

/// A candidate beside others.
struct Scored {
    voter: Shortlisted,
    /// Score Q, the smaller the better.
    score: f64,
    /// Orientation of the upsampled map.
    orientation: f64,
    /// Source vertices of the samples on which maps are judged.
    images: Vec<u32>,
}

/// Energy of the best direct candidate over that of the best mirrored one.
pub(super) fn mirrored_gain(candidates: &[Candidate]) -> f64 {
    let least = |mirrored: bool| {
        candidates
            .iter()
            .filter(|c| (c.orientation < SHORTLIST.mirrored) == mirrored)
            .map(|c| c.energy)
            .fold(f64::INFINITY, f64::min)
    };
    let (direct, mirrored) = (least(false), least(true));
    if mirrored.is_finite() {
        direct / mirrored
    } else {
        0.0
    }
}

/// The best candidates that differ from one another, upsampled.
pub(super) fn shortlist(
    pair: &Pair<'_>,
    candidates: &[Candidate],
    report: &(dyn Fn(f64) -> Result<()> + Sync),
) -> Result<Vec<Shortlisted>> {
    let mut oriented: Vec<&Candidate> = candidates
        .iter()
        .filter(|c| pair.mirror == Mirror::Allow || c.orientation >= SHORTLIST.mirrored)
        .take(if pair.uses(Part::Vote) {
            SHORTLIST.scored
        } else {
            1
        })
        .collect();
    let Some(bound) = oriented.first().map(|best| RANKED_WITHIN.from(best.rank)) else {
        return Err(Error::NoMap {
            reason: "every candidate is mirrored; if one shape is a mirror image, allow that"
                .into(),
        });
    };
    oriented.retain(|c| c.rank <= bound);
    let upsampled = |candidate: &Candidate| {
        report(0.2)?;
        if pair.uses(Part::Upsampling) {
            upsampling::upsampled(pair, candidate)
        } else {
            Ok(candidate.matrix.clone())
        }
    };
    if let [alone] = oriented[..]
        && pair.constraints.are_none()
    {
        return Ok(vec![Shortlisted {
            matrix: upsampled(alone)?,
            contradiction: 0.0,
        }]);
    }
    let mut scored: Vec<Scored> = oriented
        .par_iter()
        .map(|c| score(pair, upsampled(c)?, c.energy, &|| report(0.2)))
        .collect::<Result<_>>()?;
    scored.sort_by(|a, b| a.score.total_cmp(&b.score));
    Ok(different(pair, scored))
}

/// Q = e₂₄ · ē · (1.2 − o) · ‖Λ₁C − CΛ₂‖/‖Λ₂‖, raised by missed landmarks.
fn score(pair: &Pair<'_>, matrix: Mat<f64>, energy: f64, check: Check<'_>) -> Result<Scored> {
    let (target, source) = (pair.target, pair.source);
    let k = matrix.ncols();
    let (ask_t, ask_s) = (judging(target), judging(source));
    let (rows_t, rows_s) = (target.rows.first(k), source.rows.times(matrix.as_ref()));
    let (images, back) = rayon::join(
        || source.cells.nearest(&rows_t.gather(ask_t), &rows_s, check),
        || target.cells.nearest(&rows_s.gather(ask_s), &rows_t, check),
    );
    let (images, back) = (images?, back?);
    let change = |a: &Shape, b: &Shape, images: &[u32]| {
        let there = b.spectral_distances(images, images);
        mean_change(&a.between_judged, &there, f64::INFINITY)
    };
    let distortion = if pair.uses(Part::Geodesic) {
        let (here, there) = rayon::join(
            || change(target, source, &images),
            || change(source, target, &back),
        );
        pair.coverage.mean(there, here)
    } else {
        1.0
    };
    let maps = PointMaps {
        target_to_source: images.as_slice(),
        source_to_target: &back,
    };
    let o = orientation_of(pair, matrix.as_ref(), maps);
    let o = if pair.mirror == Mirror::Allow {
        o.abs()
    } else {
        o
    };
    let (values_t, values_s) = (&target.basis.values, &source.basis.values);
    let mut commutator = 0.0;
    for j in 0..k {
        for i in 0..k {
            commutator += ((values_s[i] - values_t[j]) * matrix[(i, j)]).powi(2);
        }
    }
    let norm: f64 = values_t[..k].iter().map(|l| l * l).sum();
    // The spectra of a part and of the whole do not commute with a right map.
    let ell = if pair.coverage == Coverage::BOTH {
        (commutator / norm).sqrt()
    } else {
        1.0
    };
    let found = landmark_images(pair, &rows_s, &rows_t);
    let contradiction = missed_landmarks(pair, &found) + off_axes(pair, &images);
    Ok(Scored {
        voter: Shortlisted {
            matrix,
            contradiction,
        },
        score: energy
            * distortion
            * (METRICS.orientation_offset.0 - o)
            * ell
            * (1.0 + contradiction),
        orientation: o,
        images,
    })
}

/// The best candidates that differ from one another.
fn different(pair: &Pair<'_>, scored: Vec<Scored>) -> Vec<Shortlisted> {
    let source = pair.source;
    let witnesses = source.farthest_points(SHORTLIST.witnesses);
    let mut chosen: Vec<(Scored, Mat<f64>)> = Vec::new();
    let mut rest = Vec::new();
    let bound = VOTING_WITHIN.from(scored.first().map_or(0.0, |best| best.score));
    for s in scored {
        if chosen.len() == SHORTLIST.shortlisted || (s.score > bound && !chosen.is_empty()) {
            break;
        }
        if pair.mirror == Mirror::Forbid && s.orientation < SHORTLIST.oriented {
            rest.push(s);
            continue;
        }
        let seen = source.spectral_distances(witnesses, &s.images);
        if chosen
            .iter()
            .all(|(_, other)| mean_largest_change(&seen, other) > SHORTLIST.different)
        {
            chosen.push((s, seen));
        }
    }
    let mut shortlist: Vec<Scored> = chosen.into_iter().map(|(s, _)| s).collect();
    if shortlist.is_empty() {
        // None is clearly oriented: the best by score stands alone and will be graded red.
        rest.truncate(1);
        shortlist = rest;
    }
    shortlist.into_iter().map(|scored| scored.voter).collect()
}

/// Mean over columns of the largest |a − b|.
fn mean_largest_change(a: &Mat<f64>, b: &Mat<f64>) -> f64 {
    let sum: f64 = (0..a.ncols())
        .map(|j| {
            (0..a.nrows())
                .map(|i| (a[(i, j)] - b[(i, j)]).abs())
                .fold(0.0, f64::max)
        })
        .sum();
    sum / a.ncols() as f64
}
