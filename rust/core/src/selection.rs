//! Which of the candidates is the map.

use faer::{Mat, MatRef, Scale};
use rayon::prelude::*;

use crate::dense::Rows;
use crate::descriptors::DETAIL_CURVATURES;
use crate::error::{Error, Result};
use crate::hints::Hints;
use crate::map_search::{Candidate, RANKED_WITHIN, Reach};
use crate::nearest::nearest;
use crate::orientation::{FUNCTIONS, TangentGradients, orientation};
use crate::pair::{Mirror, Pair, Part, Shares};
use crate::progress::Check;
use crate::refinement::embedded_surface::{self, Refined};
use crate::refinement::upsampling::{self, UPSAMPLED_SIZE};
use crate::shape::{JUDGED, Shape};
use crate::vector;

/// Candidates that are upsampled and scored.
const SCORED: usize = 12;
/// Eigenfunctions of a candidate's map after its short refinement.
const REFINED_SIZE: usize = 120;
/// Candidates that take part in the vote.
const VOTERS: usize = 8;
/// How far behind the best a candidate may be to vote, by score.
const VOTING_WITHIN: Reach = Reach {
    // Right ones stay below 1.25.
    times: 2.0,
    floor: 1e-5,
};
/// Samples against which two candidates are told apart.
const WITNESSES: usize = 100;
/// Candidates are different when the distances of their images differ by this on average, and finds
/// of two searches when their images lie this far apart.
const DIFFERENT: f64 = 0.04;
/// A candidate at 24 eigenfunctions counts as mirrored below this orientation.
const MIRRORED: f64 = -0.1;
/// A candidate at 60 eigenfunctions takes part in the vote from this orientation on.
const ORIENTED: f64 = 0.15;
/// Eigenfunctions of the orientation test at 60.
const ORIENTATION_FUNCTIONS: usize = 24;
/// Weight of the orientation in the score and in the rank: a perfect one is 1.
const ORIENTATION_OFFSET: (f64, f64) = (1.2, 1.5);
/// Root of what agreement of curvatures leaves of the rank: a perfect one is 1.
const DISAGREEMENT_OFFSET: f64 = 1.05;
/// Candidates whose ranks differ by less than this fraction are told apart by their dense maps.
const CLOSE: f64 = 0.15;
/// No map comes near where the second rank is beyond this.
const ALONE: Reach = Reach {
    times: 1.6,
    floor: 5e-3,
};
/// Maps whose images lie farther apart than this on average are not the same.
const ANOTHER_MAP: f64 = 0.05;
/// Beyond this margin more says nothing.
const MARGIN_AT_MOST: f64 = 2.0;
/// Distortions that differ by less are equal: spectral distances are about 2 % off.
const DISTORTION_NOISE: f64 = 2e-3;
/// Added to the power of weighted curvatures: that of a sphere's sampling noise.
const CURVATURE_FLOOR: f64 = 1e-5;
/// Distances below this are compared for the grade; long ones differ between right maps too.
const LOCAL: f64 = 0.35;

/// A candidate after upsampling.
struct Voter {
    /// `(60, 60)` map.
    matrix: Mat<f64>,
    /// How far the map contradicts what is known.
    contradiction: f64,
}

/// A candidate beside others.
struct Scored {
    voter: Voter,
    /// Score Q, the smaller the better.
    score: f64,
    /// Orientation of the upsampled map.
    orientation: f64,
    /// Source vertices of the samples on which maps are judged.
    images: Vec<u32>,
}

/// Figures by which a whole map is judged.
#[derive(Debug, Clone, Copy, Default)]
pub struct Figures {
    /// Orientation after the short refinement, in [−1, 1].
    pub orientation: f64,
    /// Mean change of distances below 0.35 √area.
    pub local_distortion: f64,
    /// How far the unguided map contradicts what is known: Σ (d/0.1)² over landmarks missed by d,
    /// 4 (1 − the correlation of both shapes' coordinates) when these are in one frame, and (d/0.1)²
    /// when points and their images lie d closer to the plane of symmetry on one shape.
    pub contradiction: f64,
    /// Rank of the best other map over that of the chosen one, at most 2.
    pub margin: f64,
    /// Mean distance from the images of the chosen map, √area; 0 for the chosen map itself.
    pub apart: f64,
    /// Mean correlation of the curvatures of both shapes at matched points.
    pub agreement: f64,
    /// How much worse the best direct map would be than the best mirrored one, 1 and below when
    /// it is not.
    pub mirrored_gain: f64,
    /// Share of the target's area at which a completed map tears the surface: images of neighbours lie farther apart.
    pub torn: f64,
}

impl Figures {
    /// By this candidates are ordered, the smaller the better: what the map does to the surface, raised
    /// where it contradicts what is known.
    #[must_use]
    pub fn rank(&self) -> f64 {
        self.surface_rank() * (1.0 + self.contradiction)
    }

    /// How far short distances change, raised where the surface turns over and where curvatures do not
    /// agree.
    #[must_use]
    pub fn surface_rank(&self) -> f64 {
        (self.local_distortion + DISTORTION_NOISE)
            * (ORIENTATION_OFFSET.1 - self.orientation)
            * (DISAGREEMENT_OFFSET - self.agreement).sqrt()
    }
}

/// A map that may be the right one, before its final refinement.
#[derive(Debug, Clone)]
pub struct Hypothesis {
    /// Map of up to 120 eigenfunctions, target coefficients → source coefficients.
    pub matrix: Mat<f64>,
    /// Its figures in the vote.
    pub figures: Figures,
    /// Which shape it takes as a part of the other.
    pub shares: Shares,
    /// Whether it takes the shapes to lie on one another as they were given.
    pub in_place: bool,
    /// How many units of length of the source one of the target is, where that is known, else 1.
    pub lengths: f64,
    /// Source vertices of the target's farthest-point samples, and target vertices of the source's.
    pub images: [Vec<u32>; 2],
}

impl Hypothesis {
    /// Whether a part is sought on a whole, by more than where they lie as given.
    #[must_use]
    pub fn is_of_part(&self) -> bool {
        self.shares != Shares::BOTH && !self.in_place
    }

    /// Replaces its figures and images by those of its completed map.
    pub fn judge_anew(&mut self, figures: Figures, completed: &Refined<'_>) {
        self.figures = figures;
        self.images = sampled_images(completed);
    }

    /// Source vertices of the samples on which maps are judged.
    #[must_use]
    pub fn judged_images(&self) -> &[u32] {
        of_judged(&self.images[0])
    }
}

/// Plausible maps: upsamples and scores the candidates, refines the best that differ for a short while, and orders
/// them by what the refined maps do to distances and orientation.
///
/// # Errors
/// [`Error::NoMap`] when no candidate keeps the orientation; [`Error::Cancelled`].
pub fn vote(
    pair: &Pair<'_>,
    candidates: &[Candidate],
    report: &(dyn Fn(f64) -> Result<()> + Sync),
) -> Result<Vec<Hypothesis>> {
    let mut judged: Vec<Hypothesis> = voters(pair, candidates, report)?
        .par_iter()
        .map(|voter| judged(pair, voter, &|| report(0.6)))
        .collect::<Result<_>>()?;
    judged.sort_by(|a, b| a.figures.rank().total_cmp(&b.figures.rank()));
    let gain = mirrored_gain(candidates);
    for hypothesis in &mut judged {
        hypothesis.figures.mirrored_gain = gain;
    }
    Ok(judged)
}

/// Energy of the best direct candidate over that of the best mirrored one.
fn mirrored_gain(candidates: &[Candidate]) -> f64 {
    let least = |mirrored: bool| {
        candidates
            .iter()
            .filter(|c| (c.orientation < MIRRORED) == mirrored)
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
fn voters(
    pair: &Pair<'_>,
    candidates: &[Candidate],
    report: &(dyn Fn(f64) -> Result<()> + Sync),
) -> Result<Vec<Voter>> {
    let mut oriented: Vec<&Candidate> = candidates
        .iter()
        .filter(|c| pair.mirror == Mirror::Allow || c.orientation >= MIRRORED)
        .take(if pair.uses(Part::Vote) { SCORED } else { 1 })
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
        && pair.hints.are_none()
    {
        return Ok(vec![Voter {
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

/// Q = e₂₄ · ē · (1.2 − o) · ‖Λ₂C − CΛ₁‖/‖Λ₁‖, raised by missed landmarks.
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
        pair.shares.mean(here, there)
    } else {
        1.0
    };
    let o = orientation_of(pair, matrix.as_ref(), &images, &back);
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
    let ell = if pair.shares == Shares::BOTH {
        (commutator / norm).sqrt()
    } else {
        1.0
    };
    let found = landmark_images(pair, &rows_t, &rows_s);
    let contradiction = missed_landmarks(pair, &found) + off_axes(pair, &images);
    Ok(Scored {
        voter: Voter {
            matrix,
            contradiction,
        },
        score: energy * distortion * (ORIENTATION_OFFSET.0 - o) * ell * (1.0 + contradiction),
        orientation: o,
        images,
    })
}

/// Orientation of a map over the judging samples of the target, or of a source that is a part, and their images.
fn orientation_of(
    pair: &Pair<'_>,
    matrix: MatRef<'_, f64>,
    on_source: &[u32],
    on_target: &[u32],
) -> f64 {
    if !pair.uses(Part::Orientation) {
        return 1.0;
    }
    let (here, there) = if pair.shares == Shares::SOURCE_IS_PART {
        (on_target, judging(pair.source))
    } else {
        (judging(pair.target), on_source)
    };
    // Low functions of a part are made of many of the whole.
    let functions = if pair.knows_lengths() {
        FUNCTIONS.max(matrix.nrows())
    } else {
        FUNCTIONS
    };
    let (on_target, on_source) = rayon::join(
        || TangentGradients::new(pair.target, here, functions),
        || TangentGradients::new(pair.source, there, functions),
    );
    orientation(
        &on_target,
        &on_source,
        matrix,
        (0..here.len()).map(|i| (i, i)),
        ORIENTATION_FUNCTIONS,
    )
}

/// Source vertices of the landmarks by the embeddings of a map.
fn landmark_images(pair: &Pair<'_>, target: &Rows, source: &Rows) -> Vec<u32> {
    let known: Vec<u32> = pair.hints.landmarks.iter().map(|&(_, t)| t).collect();
    nearest(&target.gather(&known), source)
}

/// Σ (d/0.1)² over landmarks, d the distance between given and found image.
fn missed_landmarks(pair: &Pair<'_>, found: &[u32]) -> f64 {
    /// A landmark missed by a tenth of √area doubles the score.
    const TOLERANCE: f64 = 0.1;
    let given: Vec<u32> = pair.hints.landmarks.iter().map(|&(s, _)| s).collect();
    let distances = pair.source.spectral_distances(&given, found);
    (0..given.len())
        .map(|i| (distances[(i, i)] / TOLERANCE).powi(2))
        .sum()
}

/// 4 (1 − r), r the correlation between the coordinates of the judging samples and those of their
/// images, when both shapes stand in one frame; the shapes are centred.
fn off_axes(pair: &Pair<'_>, images: &[u32]) -> f64 {
    /// Half a turn about the height of a standing character then triples its rank.
    const WEIGHT: f64 = 4.0;
    if !pair.hints.same_axes {
        return 0.0;
    }
    let (mut both, mut own, mut other) = (0.0, 0.0, 0.0);
    for (&v, &image) in judging(pair.target).iter().zip(images) {
        let p = pair.target.mesh.vertices[v as usize];
        let q = pair.source.mesh.vertices[image as usize];
        both += vector::dot(p, q);
        own += vector::dot(p, p);
        other += vector::dot(q, q);
    }
    WEIGHT * (1.0 - both / (own * other).sqrt())
}

/// (d/0.1)², d the mean difference between the distances of points and of their images from their own
/// mirror images, where both shapes are symmetric.
fn off_symmetry(pair: &Pair<'_>, images: &[u32]) -> f64 {
    /// A leg taken for the tail doubles the rank.
    const TOLERANCE: f64 = 0.1;
    let Some([target, source]) = pair.mirror_offsets else {
        return 0.0;
    };
    let asked = judging(pair.target);
    let sum: f64 = asked
        .iter()
        .zip(images)
        .map(|(&v, &image)| f64::from((target[v as usize] - source[image as usize]).abs()))
        .sum();
    (sum / asked.len() as f64 / TOLERANCE).powi(2)
}

/// The best candidates that differ from one another.
fn different(pair: &Pair<'_>, scored: Vec<Scored>) -> Vec<Voter> {
    let source = pair.source;
    let witnesses = source.farthest_points(WITNESSES);
    let mut chosen: Vec<(Scored, Mat<f64>)> = Vec::new();
    let mut rest = Vec::new();
    let bound = VOTING_WITHIN.from(scored.first().map_or(0.0, |best| best.score));
    for s in scored {
        if chosen.len() == VOTERS || (s.score > bound && !chosen.is_empty()) {
            break;
        }
        if pair.mirror == Mirror::Forbid && s.orientation < ORIENTED {
            rest.push(s);
            continue;
        }
        let seen = source.spectral_distances(witnesses, &s.images);
        if chosen
            .iter()
            .all(|(_, other)| mean_largest_change(&seen, other) > DIFFERENT)
        {
            chosen.push((s, seen));
        }
    }
    let mut voters: Vec<Scored> = chosen.into_iter().map(|(s, _)| s).collect();
    if voters.is_empty() {
        // None is clearly oriented: the best by score stands alone and will be graded red.
        rest.truncate(1);
        voters = rest;
    }
    voters.into_iter().map(|scored| scored.voter).collect()
}

/// Short refinement, then the figures by which candidates are ordered.
///
/// Landmarks do not guide it: what a candidate makes of them by itself tells which one is right.
fn judged(
    pair: &Pair<'_>,
    voter: &Voter,
    check: &(dyn Fn() -> Result<()> + Sync),
) -> Result<Hypothesis> {
    let unguided = Pair {
        hints: &Hints::default(),
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
    let mut figures = figures(pair, voter.matrix.as_ref(), &images);
    figures.contradiction = voter.contradiction + off_symmetry(pair, of_judged(&images[0]));
    Ok(Hypothesis {
        matrix: state.low_map(REFINED_SIZE)?,
        figures,
        shares: pair.shares,
        in_place: false,
        lengths: pair.lengths,
        images,
    })
}

/// Source vertices of the target's farthest-point samples, and target vertices of the source's: drawn vertices that
/// ask begin with the samples.
#[must_use]
pub fn sampled_images(map: &Refined<'_>) -> [Vec<u32>; 2] {
    [map.target(), map.source()].map(|side| {
        let (samples, images) = (&side.shape.farthest, &side.images.vertex);
        if side.asking.starts_with(samples) {
            images[..samples.len()].to_vec()
        } else {
            samples.iter().map(|&v| images[v as usize]).collect()
        }
    })
}

/// Of the images of all samples those of the samples on which maps are judged.
fn of_judged(images: &[u32]) -> &[u32] {
    &images[..JUDGED.min(images.len())]
}

/// Plausible maps of a part into a whole, best first: first maps, `(kₛ, kₜ)`, refined for a short while. How long the
/// unit of one is on the other has to be known.
///
/// # Errors
/// [`Error::Cancelled`], [`Error::NotFactorised`].
pub fn of_part(
    pair: &Pair<'_>,
    first_maps: &[Mat<f64>],
    check: &(dyn Fn() -> Result<()> + Sync),
) -> Result<Vec<Hypothesis>> {
    let unguided = Pair {
        hints: &Hints::default(),
        ..*pair
    };
    let judged: Vec<Hypothesis> = first_maps
        .par_iter()
        .map(|first| {
            let schedule = embedded_surface::OF_PART;
            let state =
                embedded_surface::refined(&unguided, first.as_ref(), None, schedule, &|_| check())?;
            let images = sampled_images(&state);
            let on_source = of_judged(&images[0]);
            let matrix = state.low_map(UPSAMPLED_SIZE)?;
            let mut figures = figures(pair, matrix.as_ref(), &images);
            let of_landmarks = landmark_images(pair, &state.target().rows, &state.source().rows);
            figures.contradiction = missed_landmarks(pair, &of_landmarks)
                + off_axes(pair, on_source)
                + off_symmetry(pair, on_source);
            Ok(Hypothesis {
                matrix,
                figures,
                shares: pair.shares,
                in_place: false,
                lengths: pair.lengths,
                images,
            })
        })
        .collect::<Result<_>>()?;
    let direct = judged
        .into_iter()
        .filter(|h| pair.mirror == Mirror::Allow || h.figures.orientation > 0.0);
    let mut best = merged(pair.source, direct.collect(), Vec::new());
    best.truncate(VOTERS);
    Ok(best)
}

/// The map between surfaces that lie on one another as they were given, found without what is known of it.
///
/// # Errors
/// [`crate::Error::NotFactorised`].
pub fn of_surfaces_in_place(pair: &Pair<'_>, found: &Refined<'_>) -> Result<Hypothesis> {
    let asking = found.target();
    let matrix = found.low_map(UPSAMPLED_SIZE)?;
    let images = sampled_images(found);
    let [on_source, on_target] = images.each_ref().map(|images| of_judged(images));
    let mut figures = figures(pair, matrix.as_ref(), &images);
    // Spectra of a part and of the whole say little of which side is up; here normals do.
    figures.orientation = pair
        .shares
        .mean(
            facing(pair.target, pair.source, on_source),
            facing(pair.source, pair.target, on_target),
        )
        .abs();
    let image = |&(_, t): &(u32, u32)| asking.images.vertex[t as usize];
    let of_landmarks: Vec<u32> = pair.hints.landmarks.iter().map(image).collect();
    figures.contradiction = missed_landmarks(pair, &of_landmarks) + off_axes(pair, on_source);
    Ok(Hypothesis {
        matrix,
        figures,
        shares: pair.shares,
        in_place: true,
        lengths: pair.lengths,
        images,
    })
}

/// Mean cosine between the normals at one shape's judging samples and at their images.
fn facing(asking: &Shape, answering: &Shape, images: &[u32]) -> f64 {
    let cosine = |(&v, &image): (&u32, &u32)| {
        vector::dot(
            asking.normals[v as usize],
            answering.normals[image as usize],
        )
    };
    let sum: f64 = judging(asking).iter().zip(images).map(cosine).sum();
    sum / images.len() as f64
}

/// The samples on which maps are judged.
#[must_use]
pub fn judging(shape: &Shape) -> &[u32] {
    shape.farthest_points(JUDGED)
}

/// Orientation and local distortion of a map, given the images of both shapes' farthest-point samples.
#[must_use]
pub fn figures(pair: &Pair<'_>, matrix: MatRef<'_, f64>, images: &[Vec<u32>; 2]) -> Figures {
    let (target, source) = (pair.target, pair.source);
    let [on_source, on_target] = images.each_ref().map(|images| of_judged(images));
    // In the unit of the shape that asks, so that a part gains nothing by being taken for a smaller one.
    let change = |a: &Shape, unit: f64, b: &Shape, images: &[u32]| {
        let there = Scale(1.0 / unit) * b.spectral_distances(images, images);
        mean_change(&a.between_judged, &there, LOCAL)
    };
    let (orientation, (here, there)) = rayon::join(
        || orientation_of(pair, matrix, on_source, on_target),
        || {
            rayon::join(
                || change(target, pair.lengths, source, on_source),
                || change(source, 1.0 / pair.lengths, target, on_target),
            )
        },
    );
    Figures {
        orientation,
        local_distortion: if pair.uses(Part::Geodesic) {
            pair.shares.mean(here, there)
        } else {
            0.0
        },
        agreement: agreement(pair, images),
        ..Figures::default()
    }
}

/// How well the curvatures of both shapes [agree](Figures::agreement), given the images of their farthest-point samples.
#[must_use]
pub fn agreement(pair: &Pair<'_>, images: &[Vec<u32>; 2]) -> f64 {
    let (target, source) = (pair.target, pair.source);
    let [on_source, on_target] = images.each_ref().map(|images| of_judged(images));
    pair.shares.mean(
        curvature_agreement(target, judging(target), source, on_source),
        curvature_agreement(source, judging(source), target, on_target),
    )
}

/// Mean correlation over the smoothing scales between one shape's curvature at some vertices and the
/// other's at their images; 0 for shapes without features.
fn curvature_agreement(asking: &Shape, vertices: &[u32], answering: &Shape, images: &[u32]) -> f64 {
    let (own, there) = (&asking.descriptors.detail, &answering.descriptors.detail);
    let count = vertices.len() as f64;
    let correlation = |scale: usize| {
        let here = |i: usize| f64::from(own[(vertices[i] as usize, scale)]);
        let image = |i: usize| f64::from(there[(images[i] as usize, scale)]);
        let mean =
            |value: &dyn Fn(usize) -> f64| (0..vertices.len()).map(value).sum::<f64>() / count;
        let (mean_here, mean_image) = (mean(&here), mean(&image));
        let covariance = mean(&|i| (here(i) - mean_here) * (image(i) - mean_image));
        let power_here = mean(&|i| (here(i) - mean_here).powi(2));
        let power_image = mean(&|i| (image(i) - mean_image).powi(2));
        covariance / ((power_here * power_image).sqrt() + CURVATURE_FLOOR)
    };
    (0..DETAIL_CURVATURES).map(correlation).sum::<f64>() / DETAIL_CURVATURES as f64
}

/// How many hypotheses, best first, come so close to the first that their order by rank says
/// little.
#[must_use]
pub fn rivals(hypotheses: &[Hypothesis]) -> usize {
    let bound = hypotheses
        .first()
        .map_or(0.0, |best| (1.0 + CLOSE) * best.figures.rank());
    hypotheses
        .iter()
        .take_while(|h| h.figures.rank() <= bound)
        .count()
}

/// The hypotheses of two searches, best first, of those that say the same the better one.
#[must_use]
pub fn merged(source: &Shape, some: Vec<Hypothesis>, more: Vec<Hypothesis>) -> Vec<Hypothesis> {
    let mut all: Vec<Hypothesis> = some.into_iter().chain(more).collect();
    all.sort_by(|a, b| a.figures.rank().total_cmp(&b.figures.rank()));
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
    source.mean_spectral_distance(a.judged_images(), b.judged_images()) <= DIFFERENT
}

/// Holds the symmetry of both shapes, found since, against hypotheses that were made without it.
pub fn hold_symmetry_against(pair: &Pair<'_>, hypotheses: &mut [Hypothesis]) {
    for hypothesis in hypotheses {
        hypothesis.figures.contradiction += off_symmetry(pair, hypothesis.judged_images());
    }
}

/// Whether there is a first hypothesis and the rank of every other is far above its.
#[must_use]
pub fn stands_alone(hypotheses: &[Hypothesis]) -> bool {
    hypotheses.split_first().is_some_and(|(first, others)| {
        let bound = ALONE.from(first.figures.rank());
        others.iter().all(|h| h.figures.rank() > bound)
    })
}

/// Writes into all figures how far each map lies from the chosen one, and how clearly that one
/// stands before the best that differs.
pub fn compare_with_chosen(source: &Shape, chosen: usize, hypotheses: &mut [Hypothesis]) {
    let images = hypotheses[chosen].judged_images().to_vec();
    let mut margin = MARGIN_AT_MOST;
    let rank = hypotheses[chosen].figures.rank();
    for hypothesis in hypotheses.iter_mut() {
        let apart = source.mean_spectral_distance(hypothesis.judged_images(), &images);
        let figures = &mut hypothesis.figures;
        figures.apart = apart;
        if figures.apart > ANOTHER_MAP {
            margin = margin.min(figures.rank() / rank);
        }
    }
    for hypothesis in hypotheses {
        hypothesis.figures.margin = margin;
    }
}

/// Mean |a − b| over pairs whose first distance is below the limit.
fn mean_change(a: &Mat<f64>, b: &Mat<f64>, limit: f64) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for j in 0..a.ncols() {
        for i in 0..a.nrows() {
            if i != j && a[(i, j)] < limit {
                sum += (a[(i, j)] - b[(i, j)]).abs();
                count += 1.0;
            }
        }
    }
    sum / f64::max(count, 1.0)
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
