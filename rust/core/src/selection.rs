//! Which of the candidates is the map.

use faer::{Mat, MatRef};
use rayon::prelude::*;

use crate::dense::{self, Rows};
use crate::error::{Error, Result};
use crate::map_search::{Candidate, Shares};
use crate::nearest::nearest;
use crate::orientation::{TangentGradients, orientation};
use crate::refinement::embedded_surface::{self, Side};
use crate::refinement::upsampling;
use crate::shape::Shape;

/// Candidates that are upsampled and scored.
const SCORED: usize = 12;
/// Candidates that take part in the vote.
const VOTERS: usize = 8;
/// Samples on which maps are judged.
const JUDGED: usize = 300;
/// Samples against which two candidates are told apart.
const WITNESSES: usize = 100;
/// Candidates are different when the distances of their images differ by this on average.
const DIFFERENT: f64 = 0.04;
/// A candidate at 24 eigenfunctions counts as mirrored below this orientation.
const MIRRORED: f64 = -0.1;
/// A candidate at 60 eigenfunctions takes part in the vote from this orientation on.
const ORIENTED: f64 = 0.15;
/// Eigenfunctions of the orientation test at 60.
const ORIENTATION_FUNCTIONS: usize = 24;
/// Weight of the orientation in the score and in the rank: a perfect one is 1.
const ORIENTATION_OFFSET: (f64, f64) = (1.2, 1.5);
/// Candidates whose ranks differ by less than this fraction are told apart by their dense maps.
const CLOSE: f64 = 0.1;
/// Distances below this are compared for the grade; long ones differ between right maps too.
const LOCAL: f64 = 0.35;

/// Whether mirrored maps may be chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mirror {
    /// Only orientation-preserving maps.
    Forbid,
    /// Either; for a left against a right hand.
    Allow,
}

/// A candidate after upsampling.
#[derive(Debug)]
pub struct Scored {
    /// `(60, 60)` map.
    pub matrix: Mat<f64>,
    /// Score Q, the smaller the better.
    pub score: f64,
    /// Orientation of the upsampled map.
    pub orientation: f64,
    images: Vec<u32>,
}

/// Figures by which a whole map is judged.
#[derive(Debug, Clone, Copy, Default)]
pub struct Figures {
    /// Score Q of the upsampled map.
    pub score: f64,
    /// Orientation after the short refinement, in [−1, 1].
    pub orientation: f64,
    /// Mean change of distances below 0.35 √area.
    pub local_distortion: f64,
    /// Whether no other candidate comes close by [`Figures::rank`].
    pub clear: bool,
}

impl Figures {
    /// By this candidates are ordered, the smaller the better: how far short distances change,
    /// raised where the surface turns over.
    #[must_use]
    pub fn rank(&self) -> f64 {
        self.local_distortion * (ORIENTATION_OFFSET.1 - self.orientation)
    }
}

/// A candidate that stood in the vote.
#[derive(Debug)]
pub struct Voted {
    /// `(60, 60)` map.
    pub matrix: Mat<f64>,
    /// Its figures.
    pub figures: Figures,
}

/// Upsamples and scores the candidates, refines the best that differ for a short while, and orders
/// them by what the refined maps do to distances and orientation.
///
/// `landmarks` are pairs (source vertex, target vertex) of the checked meshes.
///
/// # Errors
/// [`Error::NoMap`] when no candidate keeps the orientation; [`Error::Cancelled`].
pub fn vote(
    target: &Shape,
    source: &Shape,
    candidates: &[Candidate],
    mirror: Mirror,
    shares: Shares,
    landmarks: &[(u32, u32)],
    report: &(dyn Fn(f64) -> Result<()> + Sync),
) -> Result<Vec<Voted>> {
    let mut scored = scored(
        target, source, candidates, mirror, shares, landmarks, report,
    )?;
    scored.sort_by(|a, b| a.score.total_cmp(&b.score));
    let voters = different(source, scored, mirror);
    let judged: Vec<Voted> = voters
        .par_iter()
        .map(|s| judged(target, source, shares, s, &|| report(0.6)))
        .collect::<Result<_>>()?;
    Ok(ordered(judged))
}

fn scored(
    target: &Shape,
    source: &Shape,
    candidates: &[Candidate],
    mirror: Mirror,
    shares: Shares,
    landmarks: &[(u32, u32)],
    report: &(dyn Fn(f64) -> Result<()> + Sync),
) -> Result<Vec<Scored>> {
    let oriented: Vec<&Candidate> = candidates
        .iter()
        .filter(|c| mirror == Mirror::Allow || c.orientation >= MIRRORED)
        .take(SCORED)
        .collect();
    if oriented.is_empty() {
        return Err(Error::NoMap {
            reason: "every candidate is mirrored; if one shape is a mirror image, allow that"
                .into(),
        });
    }
    oriented
        .par_iter()
        .map(|c| {
            report(0.2)?;
            let matrix = upsampling::upsampled(target, source, c, shares)?;
            Ok(score(
                target, source, matrix, c.energy, mirror, shares, landmarks,
            ))
        })
        .collect()
}

/// Q = e₂₄ · ē · (1.2 − o) · ‖Λ₂C − CΛ₁‖/‖Λ₁‖, raised by missed landmarks.
fn score(
    target: &Shape,
    source: &Shape,
    matrix: Mat<f64>,
    energy: f64,
    mirror: Mirror,
    shares: Shares,
    landmarks: &[(u32, u32)],
) -> Scored {
    let k = matrix.ncols();
    let (ask_t, ask_s) = (judging(target), judging(source));
    let rows_t = Rows::from_matrix(target.basis.functions.as_ref(), k);
    let turned = dense::product(source.functions(k), matrix.as_ref());
    let rows_s = Rows::from_matrix(turned.as_ref(), k);
    let images = nearest(&rows_t.gather(ask_t), &rows_s);
    let back = nearest(&rows_s.gather(ask_s), &rows_t);
    let change = |a: &Shape, p: &[u32], b: &Shape, q: &[u32]| {
        mean_change(
            &a.spectral_distances(p, p),
            &b.spectral_distances(q, q),
            f64::INFINITY,
        )
    };
    let distortion = shares.mean(
        change(target, ask_t, source, &images),
        change(source, ask_s, target, &back),
    );
    let o = orientation_of((target, ask_t), (source, &images), matrix.as_ref());
    let o = if mirror == Mirror::Allow { o.abs() } else { o };
    let (values_t, values_s) = (&target.basis.values, &source.basis.values);
    let mut commutator = 0.0;
    for j in 0..k {
        for i in 0..k {
            commutator += ((values_s[i] - values_t[j]) * matrix[(i, j)]).powi(2);
        }
    }
    let norm: f64 = values_t[..k].iter().map(|l| l * l).sum();
    // The spectra of a part and of the whole do not commute with a right map.
    let ell = if shares == Shares::BOTH {
        (commutator / norm).sqrt()
    } else {
        1.0
    };
    let missed = missed_landmarks(source, &rows_t, &rows_s, landmarks);
    Scored {
        matrix,
        score: energy * distortion * (ORIENTATION_OFFSET.0 - o) * ell * (1.0 + missed),
        orientation: o,
        images,
    }
}

/// Orientation of a map over pairs of vertices.
fn orientation_of(
    (target, asking): (&Shape, &[u32]),
    (source, images): (&Shape, &[u32]),
    matrix: MatRef<'_, f64>,
) -> f64 {
    orientation(
        &TangentGradients::new(target, asking),
        &TangentGradients::new(source, images),
        matrix,
        (0..asking.len()).map(|i| (i, i)),
        ORIENTATION_FUNCTIONS,
    )
}

/// Σ (d/0.1)² over landmarks, d the distance between given and found image.
fn missed_landmarks(source: &Shape, rows_t: &Rows, rows_s: &Rows, landmarks: &[(u32, u32)]) -> f64 {
    /// A landmark missed by a tenth of √area doubles the score.
    const TOLERANCE: f64 = 0.1;
    if landmarks.is_empty() {
        return 0.0;
    }
    let given: Vec<u32> = landmarks.iter().map(|&(s, _)| s).collect();
    let asked: Vec<u32> = landmarks.iter().map(|&(_, t)| t).collect();
    let found = nearest(&rows_t.gather(&asked), rows_s);
    let distances = source.spectral_distances(&given, &found);
    (0..given.len())
        .map(|i| (distances[(i, i)] / TOLERANCE).powi(2))
        .sum()
}

/// The best candidates that differ from one another.
fn different(source: &Shape, scored: Vec<Scored>, mirror: Mirror) -> Vec<Scored> {
    let witnesses = &source.farthest[..WITNESSES.min(source.farthest.len())];
    let mut chosen: Vec<(Scored, Mat<f64>)> = Vec::new();
    let mut rest = Vec::new();
    for s in scored {
        if chosen.len() == VOTERS {
            break;
        }
        if mirror == Mirror::Forbid && s.orientation < ORIENTED {
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
    voters
}

/// Short refinement, then the figures by which candidates are ordered.
fn judged(
    target: &Shape,
    source: &Shape,
    shares: Shares,
    scored: &Scored,
    check: &(dyn Fn() -> Result<()> + Sync),
) -> Result<Voted> {
    let state = embedded_surface::refined(
        target,
        source,
        scored.matrix.as_ref(),
        shares,
        embedded_surface::SHORT,
        &|_| check(),
    )?;
    // The drawn vertices begin with the farthest-point samples.
    let images = |side: &Side<'_>| side.images.vertex[..judging(side.shape()).len()].to_vec();
    let (on_source, on_target) = (images(&state.target), images(&state.source));
    let mut figures = figures(
        target,
        source,
        scored.matrix.as_ref(),
        shares,
        &on_source,
        &on_target,
    );
    figures.score = scored.score;
    Ok(Voted {
        matrix: scored.matrix.clone(),
        figures,
    })
}

/// The samples on which maps are judged.
#[must_use]
pub fn judging(shape: &Shape) -> &[u32] {
    &shape.farthest[..JUDGED.min(shape.farthest.len())]
}

/// Orientation and local distortion of a map, given the images of both shapes' judging samples.
#[must_use]
pub fn figures(
    target: &Shape,
    source: &Shape,
    matrix: MatRef<'_, f64>,
    shares: Shares,
    on_source: &[u32],
    on_target: &[u32],
) -> Figures {
    let change = |a: &Shape, b: &Shape, images: &[u32]| {
        let asking = judging(a);
        mean_change(
            &a.spectral_distances(asking, asking),
            &b.spectral_distances(images, images),
            LOCAL,
        )
    };
    Figures {
        score: 0.0,
        orientation: orientation_of((target, judging(target)), (source, on_source), matrix),
        local_distortion: shares.mean(
            change(target, source, on_source),
            change(source, target, on_target),
        ),
        clear: false,
    }
}

/// Best first; whether the first stands clear of the rest is written into its figures.
fn ordered(mut voters: Vec<Voted>) -> Vec<Voted> {
    voters.sort_by(|a, b| a.figures.rank().total_cmp(&b.figures.rank()));
    let rivals = rivals(&voters, |v| &v.figures);
    voters[0].figures.clear = rivals == 1;
    voters
}

/// How many candidates of a list, best first, come so close to the first that their order by rank
/// says little.
#[must_use]
pub fn rivals<T>(candidates: &[T], figures: impl Fn(&T) -> &Figures) -> usize {
    let bound = candidates
        .first()
        .map_or(0.0, |best| (1.0 + CLOSE) * figures(best).rank());
    candidates
        .iter()
        .take_while(|c| figures(c).rank() <= bound)
        .count()
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
