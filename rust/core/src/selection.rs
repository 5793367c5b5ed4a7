//! Which of the candidates is the map: score, vote, grade.

use faer::{Mat, MatRef};
use rayon::prelude::*;

use crate::dense::{self, Rows};
use crate::error::{Error, Result};
use crate::map_search::Candidate;
use crate::nearest::nearest;
use crate::orientation::{TangentGradients, orientation};
use crate::refinement::embedded_surface::{self, Refined};
use crate::refinement::upsampling;
use crate::shape::Shape;

/// Candidates that are upsampled and scored.
const SCORED: usize = 6;
/// Candidates that take part in the vote.
const VOTERS: usize = 4;
/// Samples on which maps are judged.
const JUDGED: usize = 300;
/// Samples against which two candidates are told apart.
const WITNESSES: usize = 100;
/// Candidates are different when the distances of their images differ by this on average.
const DIFFERENT: f64 = 0.2;
/// A candidate at 24 eigenfunctions counts as mirrored below this orientation.
const MIRRORED: f64 = -0.1;
/// A candidate at 60 eigenfunctions takes part in the vote from this orientation on.
const ORIENTED: f64 = 0.15;
/// Eigenfunctions of the orientation test at 60.
const ORIENTATION_FUNCTIONS: usize = 24;
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
    /// Mean change of distances between samples.
    pub distortion: f64,
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
    /// Mean |ln| of the change of area from the low-passed to the deformed target.
    pub stretch: f64,
    /// Relative mismatch of mean curvature.
    pub curvature_mismatch: f64,
    /// Whether both criteria chose this map.
    pub agreed: bool,
}

/// A candidate that stood in the vote.
#[derive(Debug)]
pub struct Voted {
    /// `(60, 60)` map.
    pub matrix: Mat<f64>,
    /// Its figures.
    pub figures: Figures,
}

/// Scores the candidates and lets two independent criteria vote; the chosen one comes first.
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
    landmarks: &[(u32, u32)],
    report: &(dyn Fn(f64) -> Result<()> + Sync),
) -> Result<Vec<Voted>> {
    let mut scored = scored(target, source, candidates, mirror, landmarks, report)?;
    scored.sort_by(|a, b| a.score.total_cmp(&b.score));
    let voters = different(source, scored, mirror);
    let judged: Vec<Voted> = voters
        .par_iter()
        .map(|s| {
            report(0.6)?;
            judged(target, source, s)
        })
        .collect::<Result<_>>()?;
    Ok(decided(judged))
}

fn scored(
    target: &Shape,
    source: &Shape,
    candidates: &[Candidate],
    mirror: Mirror,
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
            let matrix = upsampling::upsampled(target, source, c)?;
            Ok(score(target, source, matrix, c.energy, mirror, landmarks))
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
    landmarks: &[(u32, u32)],
) -> Scored {
    let k = matrix.ncols();
    let asking = |s: &Shape| s.farthest[..JUDGED.min(s.farthest.len())].to_vec();
    let (ask_t, ask_s) = (asking(target), asking(source));
    let rows_t = Rows::from_matrix(target.basis.functions.as_ref(), k);
    let turned = dense::product(source.functions(k), matrix.as_ref());
    let rows_s = Rows::from_matrix(turned.as_ref(), k);
    let images = nearest(&rows_t.gather(&ask_t), &rows_s);
    let back = nearest(&rows_s.gather(&ask_s), &rows_t);
    let change = |a: &Shape, p: &[u32], b: &Shape, q: &[u32]| {
        mean_change(
            &a.spectral_distances(p, p),
            &b.spectral_distances(q, q),
            f64::INFINITY,
        )
    };
    let distortion = f64::midpoint(
        change(target, &ask_t, source, &images),
        change(source, &ask_s, target, &back),
    );
    let o = orientation_of((target, &ask_t), (source, &images), matrix.as_ref());
    let o = if mirror == Mirror::Allow { o.abs() } else { o };
    let (values_t, values_s) = (&target.basis.values, &source.basis.values);
    let mut commutator = 0.0;
    for j in 0..k {
        for i in 0..k {
            commutator += ((values_s[i] - values_t[j]) * matrix[(i, j)]).powi(2);
        }
    }
    let norm: f64 = values_t[..k].iter().map(|l| l * l).sum();
    let ell = (commutator / norm).sqrt();
    let missed = missed_landmarks(source, &rows_t, &rows_s, landmarks);
    Scored {
        matrix,
        score: energy * distortion * (1.2 - o) * ell * (1.0 + missed),
        orientation: o,
        distortion,
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

/// Short refinement, then the figures of the vote.
fn judged(target: &Shape, source: &Shape, scored: &Scored) -> Result<Voted> {
    let state = embedded_surface::refined(
        target,
        source,
        scored.matrix.as_ref(),
        embedded_surface::SHORT,
        &|_| Ok(()),
    )?;
    let asking = |s: &Shape| JUDGED.min(s.farthest.len());
    let on_source = &state.target.images.vertex[..asking(target)];
    let on_target = &state.source.images.vertex[..asking(source)];
    let ask_t = &target.farthest[..asking(target)];
    let ask_s = &source.farthest[..asking(source)];
    let local_distortion = f64::midpoint(
        mean_change(
            &target.spectral_distances(ask_t, ask_t),
            &source.spectral_distances(on_source, on_source),
            LOCAL,
        ),
        mean_change(
            &source.spectral_distances(ask_s, ask_s),
            &target.spectral_distances(on_target, on_target),
            LOCAL,
        ),
    );
    let o = orientation_of((target, ask_t), (source, on_source), scored.matrix.as_ref());
    Ok(Voted {
        matrix: scored.matrix.clone(),
        figures: Figures {
            score: scored.score,
            orientation: o,
            local_distortion,
            stretch: stretch(&state),
            curvature_mismatch: curvature_mismatch(
                (target, ask_t, on_source),
                (source, ask_s, on_target),
            ),
            agreed: true,
        },
    })
}

/// The chosen candidate first. Isometry (score) and local shape (stretch · curvature) vote; where
/// they disagree the clearer orientation wins and the result says so.
fn decided(mut voters: Vec<Voted>) -> Vec<Voted> {
    let best = |key: &dyn Fn(&Figures) -> f64| {
        (0..voters.len())
            .min_by(|&i, &j| key(&voters[i].figures).total_cmp(&key(&voters[j].figures)))
            .unwrap_or(0)
    };
    let by_score = best(&|f| f.score);
    let by_shape = best(&|f| f.stretch * f.curvature_mismatch);
    let agreed = by_score == by_shape;
    let winner =
        if agreed || voters[by_score].figures.orientation >= voters[by_shape].figures.orientation {
            by_score
        } else {
            by_shape
        };
    for v in &mut voters {
        v.figures.agreed = agreed;
    }
    let first = voters.remove(winner);
    voters.insert(0, first);
    voters
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

/// Σ w |ln(deformed area / low-passed area)| over faces, w the face's share of the area.
fn stretch(state: &Refined<'_>) -> f64 {
    let (before, after) = (state.target.smoothed.as_ref(), state.deformed.as_ref());
    let faces = &state.target.shape().mesh.faces;
    let area = |m: MatRef<'_, f64>, f: &[u32; 3]| {
        let [a, b, c] = f.map(|v| [0, 1, 2].map(|i| m[(v as usize, i)]));
        crate::vector::norm(crate::vector::cross(
            crate::vector::sub(b, a),
            crate::vector::sub(c, a),
        ))
    };
    let (mut sum, mut total) = (0.0, 0.0);
    for f in faces {
        let (x, y) = (area(before, f), area(after, f));
        if x > 0.0 && y > 0.0 {
            sum += x * (y / x).ln().abs();
            total += x;
        }
    }
    sum / total
}

/// Relative difference of smoothed mean curvature between points and their images.
fn curvature_mismatch(
    (target, ask_t, on_source): (&Shape, &[u32], &[u32]),
    (source, ask_s, on_target): (&Shape, &[u32], &[u32]),
) -> f64 {
    let (mut difference, mut power) = (0.0, 0.0);
    let mut add = |a: &Shape, p: &[u32], b: &Shape, q: &[u32]| {
        for (&x, &y) in p.iter().zip(q) {
            let g = f64::from(a.descriptors.curvature[x as usize]);
            let h = f64::from(b.descriptors.curvature[y as usize]);
            difference += (g - h).powi(2);
            power += g * g + h * h;
        }
    };
    add(target, ask_t, source, on_source);
    add(source, ask_s, target, on_target);
    (difference / power.max(f64::MIN_POSITIVE)).sqrt()
}
