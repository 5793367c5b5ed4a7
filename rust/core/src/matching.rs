//! The whole chain: two prepared shapes in, a dense map out.

use std::sync::Arc;

use faer::{Mat, MatRef};
use rayon::prelude::*;

use crate::baselines::{Convergence, Embedding, functional_map, gmds};
use crate::confidence::{beyond_rims, confidence, local_distortion};
use crate::dense::{self, Rows};
use crate::descriptors::DETAIL_CURVATURES;
use crate::distance_operator;
use crate::eigenbasis::Eigenbasis;
use crate::error::{Error, Result};
use crate::full_resolution::FullSpectrum;
use crate::hints::Hints;
use crate::map_search::{self, SampledPair, Width};
use crate::nearest::nearest_unless;
use crate::pair::{LeftOut, Mirror, Pair, Part, Shares};
use crate::pointwise_map::{self, SurfacePoint};
use crate::progress::{Check, Progress};
use crate::quality;
use crate::refinement::embedded_surface::{self, Refined, Side};
use crate::selection::{self, Figures, Hypothesis};
use crate::shape::Shape;
use crate::space_tree::SpaceTree;
use crate::spectral_gmds::{self, Objective, Weights};
use crate::vector;

/// Eigenfunctions of the paper's map.
const PAPER_SIZE: usize = 30;
/// Columns of the functional map that is handed out.
const FUNCTIONAL_MAP_SIZE: usize = 60;
/// Ridge of that map's fit.
const FUNCTIONAL_MAP_RIDGE: f64 = 1e-3;

/// A map between a part and a whole is taken when its rank is below this times that of the map
/// between wholes: right ones reach 0.5 to 0.78, on whole shapes they stay above 0.95.
const PART_FITS_BETTER: f64 = 0.8;
/// Two images of a vertex that are farther apart than this are different.
const ELSEWHERE: f64 = 0.05;
/// Close maps that differ on at most this share of the target are compared on that part.
const PART_AT_MOST: f64 = 0.5;
/// Added to the power of weighted curvatures: that of a sphere's sampling noise.
const CURVATURE_FLOOR: f64 = 1e-5;
/// Close hypotheses completed at most.
const MOST_COMPLETED: usize = 3;

/// Which algorithm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Search, vote and refinement.
    Auto,
    /// The published algorithm from an automatic start.
    Paper,
    /// Multidimensional scaling of sampled points, for comparison.
    Gmds,
    /// A functional map from descriptors, for comparison.
    FunctionalMap,
}

/// What the caller may ask for.
#[derive(Debug, Clone)]
pub struct Options {
    /// Algorithm.
    pub method: Method,
    /// Whether mirrored maps are allowed.
    pub mirror: Mirror,
    /// Which shape is a part of the other; found out when `None`.
    pub shares: Option<Shares>,
    /// Pairs (source vertex, target vertex) in given numbering.
    pub landmarks: Vec<(u32, u32)>,
    /// Whether left, front and up are the same directions on both shapes.
    pub same_axes: bool,
    /// Parts of the automatic method that are not used, to see what they contribute.
    pub left_out: LeftOut,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            method: Method::Auto,
            mirror: Mirror::Forbid,
            shares: None,
            landmarks: Vec::new(),
            same_axes: false,
            left_out: LeftOut::default(),
        }
    }
}

/// A dense map in given numbering: for every target vertex a point of the source.
#[derive(Debug, Clone)]
pub struct Correspondence {
    /// Source face of each target vertex's image.
    pub faces: Vec<u32>,
    /// Weights of that face's corners, in the given order of its corners.
    pub barycentric: Vec<[f64; 3]>,
    /// Corner with the largest weight.
    pub vertices: Vec<u32>,
    /// Confidence in [0, 1].
    pub confidence: Vec<f64>,
    /// `(kₜ, kₛ)`: source coefficients → target coefficients, in given units. When a shape was
    /// simplified this is between the spectra of the simplified meshes, see
    /// [`Correspondence::full_functional_map`].
    pub functional_map: Mat<f64>,
    /// Image of each vertex of the checked target, when a shape was simplified.
    points: Vec<SurfacePoint>,
    /// How the map was judged; nothing for the paper's method.
    pub figures: Option<Figures>,
    /// Which shape was taken as a part of the other.
    pub shares: Shares,
    /// How the paper's minimisation ended; nothing for the automatic method.
    pub convergence: Option<Convergence>,
    /// Target vertices without an image of their own.
    pub unmatched: usize,
    /// Other maps that stood in the vote, best first.
    pub others: Vec<Hypothesis>,
    /// What was known of the map.
    pub hints: Arc<Hints>,
}

impl Correspondence {
    /// Whether one of the shapes was simplified.
    #[must_use]
    pub fn was_simplified(&self) -> bool {
        !self.points.is_empty()
    }

    /// The functional map between the spectra of the given meshes when one was simplified: these
    /// are computed when first asked for, which takes longer than the match.
    ///
    /// # Errors
    /// Those of [`Shape::full_spectrum`].
    pub fn full_functional_map(
        &self,
        source: &Shape,
        target: &Shape,
        progress: &Progress,
    ) -> Result<Mat<f64>> {
        let target_full = target.full_spectrum(progress)?;
        let source_full = source.full_spectrum(progress)?;
        let (target_basis, mass, target_unit) = target_full.as_deref().map_or(
            (&target.basis, &target.mass, target.unit),
            |s: &FullSpectrum| (&s.basis, &s.mass, s.unit),
        );
        let (source_basis, source_unit) = source_full
            .as_deref()
            .map_or((&source.basis, source.unit), |s| (&s.basis, s.unit));
        let size = |b: &Eigenbasis| FUNCTIONAL_MAP_SIZE.min(b.values.len());
        let faces = &source.given_mesh().faces;
        let own = Mat::from_fn(self.points.len(), size(target_basis), |i, j| {
            mass[i].sqrt() * target_basis.functions[(i, j)]
        });
        let carried = Mat::from_fn(self.points.len(), size(source_basis), |i, j| {
            let SurfacePoint { face, weights } = self.points[i];
            let corners = faces[face as usize];
            let value: f64 = (0..3)
                .map(|c| weights[c] * source_basis.functions[(corners[c] as usize, j)])
                .sum();
            mass[i].sqrt() * value
        });
        let gram = dense::product(own.transpose(), own.as_ref());
        let right = dense::product(own.transpose(), carried.as_ref());
        solved_functional_map(target_unit / source_unit, gram, right.as_ref())
    }
}

/// Finds the map.
///
/// # Errors
/// [`Error::NoMap`], [`Error::Cancelled`], and those of the stages.
pub fn match_shapes(
    source: &Arc<Shape>,
    target: &Arc<Shape>,
    options: &Options,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Correspondence> {
    if source.metric != target.metric {
        return Err(Error::BadArgument {
            what: format!(
                "the source has the {} metric and the target the {} one: prepare both with the same",
                source.metric.name(),
                target.metric.name()
            ),
        });
    }
    match options.method {
        Method::Paper => {
            let embedding = by_paper(source, target, progress, report)?;
            embedded(source, target, &embedding, progress, report)
        }
        Method::Gmds => {
            report("GMDS", 0.0)?;
            let embedding = gmds::embedded(target, source, progress)?;
            embedded(source, target, &embedding, progress, report)
        }
        Method::FunctionalMap => {
            report("functional map", 0.0)?;
            let embedding = functional_map::embedded(target, source, progress)?;
            embedded(source, target, &embedding, progress, report)
        }
        Method::Auto => {
            let landmarks = checked_landmarks(source, target, &options.landmarks)?;
            report("landmarks", 0.0)?;
            let hints = Arc::new(Hints::new(
                target,
                source,
                landmarks,
                options.same_axes,
                progress,
            )?);
            let pair = Pair {
                target,
                source,
                shares: options.shares.unwrap_or(Shares::BOTH),
                mirror: options.mirror,
                hints: &hints,
                left_out: options.left_out,
            };
            let hypotheses = if options.shares.is_some() {
                let stage = |s: &'static str, f: f64| report(s, 0.6 * f);
                hypotheses(&pair, Width::default(), progress, &stage)?
            } else {
                whole_or_part(&pair, progress, report)?
            };
            let mut found = clearest(&pair, hypotheses, progress, &|s, f| {
                report(s, 0.6 + 0.4 * f)
            })?;
            found.hints = Arc::clone(&hints);
            Ok(found)
        }
    }
}

/// Hypotheses for two whole shapes. When they are poor, also for either being a part of the other,
/// which must then fit clearly better, since half as many questions are easier to answer well; and
/// when these are no better, once more for whole shapes by a wider search.
fn whole_or_part(
    pair: &Pair<'_>,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Vec<Hypothesis>> {
    let search = |shares: Shares, width: Width, (from, to): (f64, f64)| {
        let stage = |s: &'static str, f: f64| report(s, from + (to - from) * f);
        hypotheses(&Pair { shares, ..*pair }, width, progress, &stage)
    };
    let mut best = search(Shares::BOTH, Width::default(), (0.0, 0.3))?;
    let whole = best[0].figures;
    if !quality::doubtful(&whole) || !pair.uses(Part::Retry) {
        return Ok(best);
    }
    let mut bound = PART_FITS_BETTER * whole.rank();
    for (shares, within) in [
        (Shares::TARGET_IS_PART, (0.3, 0.4)),
        (Shares::SOURCE_IS_PART, (0.4, 0.5)),
    ] {
        let mut part = match search(shares, Width::default(), within) {
            Err(Error::NoMap { .. }) => continue,
            found => found?,
        };
        if part[0].figures.rank() < bound {
            bound = part[0].figures.rank();
            part.push(best.swap_remove(0));
            best = part;
        }
    }
    if best[0].shares == Shares::BOTH {
        let wide = search(Shares::BOTH, Width::wide(), (0.5, 0.6))?;
        if wide[0].figures.rank() < best[0].figures.rank() {
            best = wide;
        }
    }
    Ok(best)
}

/// Plausible maps, best first.
fn hypotheses(
    pair: &Pair<'_>,
    width: Width,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Vec<Hypothesis>> {
    report("search", 0.0)?;
    let width = if pair.uses(Part::Search) {
        width
    } else {
        Width { first: 1, beam: 1 }
    };
    let candidates = SampledPair::new(*pair).search(width, progress)?;
    report("selection", 0.5)?;
    selection::vote(pair, &candidates, &|f| report("selection", 0.5 + 0.5 * f))
}

/// The best hypothesis completed. Close ones are all completed and ranked anew by their refined
/// maps; those that differ from the best in a part only are compared on that part. The others are
/// kept as alternatives.
fn clearest(
    pair: &Pair<'_>,
    mut hypotheses: Vec<Hypothesis>,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Correspondence> {
    let close = selection::rivals(&hypotheses).min(MOST_COMPLETED);
    let mut completed: Vec<Completed<'_>> = hypotheses[..close]
        .par_iter()
        .map(|h| completed_and_ranked(pair, h, progress, report))
        .collect::<Result<_>>()?;
    let first = (0..close)
        .min_by(|&i, &j| completed[i].rank.total_cmp(&completed[j].rank))
        .ok_or(Error::NoMap {
            reason: "no candidate stood in the vote".into(),
        })?;
    let best = (0..close).fold(first, |best, other| {
        if other != best && fits_better_where_it_differs(pair, &completed[other], &completed[best])
        {
            other
        } else {
            best
        }
    });
    selection::compare_with_chosen(pair.source, best, &mut hypotheses);
    let chosen = hypotheses.remove(best);
    let mut found = completed
        .swap_remove(best)
        .finished(pair, &chosen, progress)?;
    found.others = hypotheses;
    Ok(found)
}

/// Whether a map that differs from another in some part of the target keeps distances and
/// curvatures better on that part. Over the whole surface a turned leg changes both by little.
fn fits_better_where_it_differs(
    pair: &Pair<'_>,
    map: &Completed<'_>,
    other: &Completed<'_>,
) -> bool {
    let (target, source) = (pair.target, pair.source);
    let at = |images: &[u32], v: usize| source.mesh.vertices[images[v] as usize];
    let differs = |v: usize| {
        let apart = vector::sub(at(&map.images, v), at(&other.images, v));
        vector::norm(apart) > ELSEWHERE
    };
    let part: Vec<usize> = (0..target.mesh.vertices.len())
        .filter(|&v| differs(v))
        .collect();
    let share: f64 = part.iter().map(|&v| target.mass[v]).sum();
    if part.is_empty() || share > PART_AT_MOST {
        return false;
    }
    let mean = |value: &dyn Fn(usize) -> f64| -> f64 {
        let sum: f64 = part.iter().map(|&v| target.mass[v] * value(v)).sum();
        sum / share
    };
    let misfit = |c: &Completed<'_>| -> f64 {
        let distances = if pair.uses(Part::Geodesic) {
            mean(&|v| c.distortion[v].powi(2)).sqrt()
        } else {
            1.0
        };
        let (own, there) = (&target.descriptors.detail, &source.descriptors.detail);
        (0..DETAIL_CURVATURES).fold(distances, |product, scale| {
            let bend = |v: usize| (own[(v, scale)] - there[(c.images[v] as usize, scale)]).abs();
            product * mean(&|v| f64::from(bend(v)))
        })
    };
    misfit(map) < misfit(other)
}

/// Mean correlation over the smoothing scales between the target's curvature and the source's at
/// the images of its vertices; 0 for shapes without features.
fn curvature_agreement(target: &Shape, source: &Shape, images: &[u32]) -> f64 {
    let mean = |value: &dyn Fn(usize) -> f64| -> f64 {
        let weighted = |v: usize| target.mass[v] * value(v);
        (0..target.mesh.vertices.len()).map(weighted).sum()
    };
    let (own, there) = (&target.descriptors.detail, &source.descriptors.detail);
    let correlation = |scale: usize| {
        let here = |v: usize| f64::from(own[(v, scale)]);
        let image = |v: usize| f64::from(there[(images[v] as usize, scale)]);
        let (mean_here, mean_image) = (mean(&here), mean(&image));
        let covariance = mean(&|v| (here(v) - mean_here) * (image(v) - mean_image));
        let power_here = mean(&|v| (here(v) - mean_here).powi(2));
        let power_image = mean(&|v| (image(v) - mean_image).powi(2));
        covariance / ((power_here * power_image).sqrt() + CURVATURE_FLOOR)
    };
    (0..DETAIL_CURVATURES).map(correlation).sum::<f64>() / DETAIL_CURVATURES as f64
}

/// Final refinement and dense map of a hypothesis.
///
/// # Errors
/// [`Error::Cancelled`] and those of the stages.
pub fn completed(
    source: &Shape,
    target: &Shape,
    hints: &Arc<Hints>,
    hypothesis: &Hypothesis,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Correspondence> {
    let pair = Pair {
        target,
        source,
        shares: hypothesis.shares,
        mirror: Mirror::Allow,
        hints,
        left_out: LeftOut::default(),
    };
    let mut found = completed_and_ranked(&pair, hypothesis, progress, report)?
        .finished(&pair, hypothesis, progress)?;
    found.hints = Arc::clone(hints);
    Ok(found)
}

/// A refined map with what decides between close ones.
struct Completed<'a> {
    state: Refined<'a>,
    /// Rank of the refined map.
    rank: f64,
    /// Local distortion at each target vertex.
    distortion: Vec<f64>,
    /// Source vertex of each target vertex.
    images: Vec<u32>,
}

impl Completed<'_> {
    /// The dense map, with what is known of it.
    fn finished(
        self,
        pair: &Pair<'_>,
        hypothesis: &Hypothesis,
        progress: &Progress,
    ) -> Result<Correspondence> {
        let (asking, answering) = (&self.state.target, &self.state.source);
        let gap = |v: usize| {
            let image = pair.source.mesh.vertices[asking.images.vertex[v] as usize];
            vector::distance([0, 1, 2].map(|c| self.state.deformed[(v, c)]), image)
        };
        let misfit: Vec<(f64, f64)> = (0..self.distortion.len())
            .map(|v| (self.distortion[v], gap(v)))
            .collect();
        let mut found = dense_map(
            pair.source,
            pair.target,
            (&asking.rows, &asking.images.vertex),
            (&answering.rows, &answering.images.vertex),
            &misfit,
            &pair.hints.landmarks,
            progress,
        )?;
        found.figures = Some(Figures {
            agreement: curvature_agreement(pair.target, pair.source, &self.images),
            ..hypothesis.figures
        });
        found.shares = hypothesis.shares;
        Ok(found)
    }
}

fn completed_and_ranked<'a>(
    pair: &Pair<'a>,
    hypothesis: &Hypothesis,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Completed<'a>> {
    let pair = &Pair {
        shares: hypothesis.shares,
        ..*pair
    };
    let (target, source) = (pair.target, pair.source);
    let state = embedded_surface::refined(
        pair,
        hypothesis.matrix.as_ref(),
        embedded_surface::FULL,
        &|f| report("refinement", 0.9 * f),
    )?;
    report("dense map", 0.9)?;
    let (asking, answering) = (&state.target, &state.source);
    let images = &asking.images.vertex;
    let distortion = local_distortion(target, source, images, progress)?;
    let judging = |side: &Side<'_>| -> Vec<u32> {
        selection::judging(side.shape())
            .iter()
            .map(|&v| side.images.vertex[v as usize])
            .collect()
    };
    let mut refined = selection::figures(
        pair,
        hypothesis.matrix.as_ref(),
        &judging(asking),
        &judging(answering),
    );
    refined.contradiction = hypothesis.figures.contradiction;
    Ok(Completed {
        rank: refined.rank(),
        distortion,
        images: asking.images.vertex.clone(),
        state,
    })
}

fn by_paper(
    source: &Shape,
    target: &Shape,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Embedding> {
    report("distance operator", 0.0)?;
    let (target_operator, source_operator) = paper_operators(source, target)?;
    report("S-GMDS", 0.2)?;
    let k = target_operator.nrows();
    let objective = paper_objective(
        source,
        target,
        target_operator.as_ref(),
        source_operator.as_ref(),
    );
    let seed = map_search::best_signs(target_operator.as_ref(), source_operator.as_ref());
    let start = spectral_gmds::continued_signs(
        seed.as_ref(),
        target_operator.as_ref(),
        source_operator.as_ref(),
    );
    let minimum = objective.minimised(start.as_ref(), progress)?;
    let turned = dense::product(source.functions(k), minimum.matrix.as_ref());
    Ok(Embedding {
        target: Rows::from_matrix(target.basis.functions.as_ref(), k),
        source: Rows::from_matrix(turned.as_ref(), k),
        convergence: Convergence {
            energy: minimum.energy,
            gradient_norm: Some(minimum.gradient_norm),
            steps: minimum.steps,
            converged: minimum.converged,
        },
    })
}

/// The dense map of an embedding in which matched points lie together.
fn embedded(
    source: &Shape,
    target: &Shape,
    embedding: &Embedding,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Correspondence> {
    report("dense map", 0.5)?;
    let images =
        |asking: &Rows, answering: &Rows| nearest_unless(asking, answering, &|| progress.check());
    let on_source = images(&embedding.target, &embedding.source)?;
    let on_target = images(&embedding.source, &embedding.target)?;
    // No surface is deformed, so that there is no gap.
    let misfit: Vec<(f64, f64)> = local_distortion(target, source, &on_source, progress)?
        .into_iter()
        .map(|distortion| (distortion, 0.0))
        .collect();
    let mut found = dense_map(
        source,
        target,
        (&embedding.target, &on_source),
        (&embedding.source, &on_target),
        &misfit,
        &[],
        progress,
    )?;
    found.convergence = Some(embedding.convergence);
    Ok(found)
}

/// α₁, α₂ of the paper's method, both `(k, k)`.
fn paper_operators(source: &Shape, target: &Shape) -> Result<(Mat<f64>, Mat<f64>)> {
    let size = |s: &Shape| PAPER_SIZE.min(s.distance_operator.nrows());
    let k = size(source).min(size(target));
    let operator = |s: &Shape| {
        let m = s.marched();
        let distances = Mat::from_fn(m.len(), m.len(), |i, j| {
            let d = |a: usize, b: usize| f64::from(s.fields[(m[a] as usize, b)]);
            f64::midpoint(d(i, j), d(j, i))
        });
        distance_operator::from_samples(
            dense::gather_rows(s.basis.functions.as_ref(), m, k).as_ref(),
            &s.basis.values[..k],
            distances.as_ref(),
            distance_operator::DATA_PENALTY,
        )
    };
    Ok((operator(target)?, operator(source)?))
}

fn paper_objective<'a>(
    source: &'a Shape,
    target: &'a Shape,
    target_operator: MatRef<'a, f64>,
    source_operator: MatRef<'a, f64>,
) -> Objective<'a> {
    let k = target_operator.nrows();
    Objective {
        target_operator,
        source_operator,
        target_values: &target.basis.values[..k],
        source_values: &source.basis.values[..k],
        weights: Weights::default(),
    }
}

/// S-GMDS energy of any map, so that maps of both methods and of many pairs can be compared: how
/// much it changes distances, spectrum and areas, 0 for an isometry. The paper's C is the transpose
/// of the functional map α, at unit area.
///
/// # Errors
/// [`Error::NotFactorised`] as in the paper's method.
pub fn energy(source: &Shape, target: &Shape, functional_map: MatRef<'_, f64>) -> Result<f64> {
    let (target_operator, source_operator) = paper_operators(source, target)?;
    let objective = paper_objective(
        source,
        target,
        target_operator.as_ref(),
        source_operator.as_ref(),
    );
    let to_unit_area = source.unit / target.unit;
    let k = target_operator.nrows();
    let c = Mat::from_fn(k, k, |i, j| to_unit_area * functional_map[(j, i)]);
    Ok(objective.value(c.as_ref()).0)
}

/// Points on the given meshes, confidence and functional map, from two embeddings, the vertex maps
/// between them, and local distortion and gap at each target vertex.
fn dense_map(
    source: &Shape,
    target: &Shape,
    (target_rows, images): (&Rows, &[u32]),
    (source_rows, back): (&Rows, &[u32]),
    misfit: &[(f64, f64)],
    landmarks: &[(u32, u32)],
    progress: &Progress,
) -> Result<Correspondence> {
    let check: Check<'_> = &|| progress.check();
    let vertices = &target.mesh.vertices;
    let returns = |v: usize| {
        let end = back[images[v] as usize] as usize;
        vector::norm(vector::sub(vertices[v], vertices[end]))
    };
    let rims = beyond_rims(&source.mesh, &target.mesh, images);
    let mut trust: Vec<f64> = misfit
        .iter()
        .enumerate()
        .map(|(v, &(distortion, gap))| confidence(distortion, gap, returns(v), rims[v]))
        .collect();
    let mut points = if let Some(full) = &target.full {
        trust = full.carried(&trust, &target.mesh);
        pointwise_map::projected_at_full_resolution(
            (target, target_rows, full),
            (source, source_rows),
            images,
            check,
        )?
    } else {
        pointwise_map::projected(target_rows, source_rows, images, source, check)?
    };
    for &(known, asking) in landmarks {
        let vertex = target
            .full
            .as_ref()
            .map_or(asking, |f| f.kept[asking as usize]);
        points[vertex as usize] = SurfacePoint::at_vertex(source, known);
    }
    if let Some(full) = &source.full {
        points = full.located(&points, &source.mesh, check)?;
    }
    let functional_map = functional_map(source, target, images, back, check)?;
    let mut found = in_given_numbering(source, target, &points, &trust, functional_map);
    if source.full.is_some() || target.full.is_some() {
        found.points = points;
    }
    Ok(found)
}

/// α with Φₜ α ≈ Φₛ at matched points of both vertex maps, weighted by area; in given units a
/// constant goes to √(areaₜ/areaₛ) times the constant.
fn functional_map(
    source: &Shape,
    target: &Shape,
    on_source: &[u32],
    on_target: &[u32],
    check: Check<'_>,
) -> Result<Mat<f64>> {
    let k = |s: &Shape| FUNCTIONAL_MAP_SIZE.min(s.basis.values.len());
    let (kt, ks) = (k(target), k(source));
    let rows = |basis: MatRef<'_, f64>, weights: &[f64], ids: Option<&[u32]>, count: usize| {
        Mat::from_fn(count, basis.ncols(), |i, j| {
            let id = ids.map_or(i, |ids| ids[i] as usize);
            weights[i].sqrt() * basis[(id, j)]
        })
    };
    let (nt, ns) = (on_source.len(), on_target.len());
    let own = rows(target.functions(kt), &target.mass, None, nt);
    let own_values = rows(source.functions(ks), &target.mass, Some(on_source), nt);
    let other = rows(target.functions(kt), &source.mass, Some(on_target), ns);
    let other_values = rows(source.functions(ks), &source.mass, None, ns);
    check()?;
    let mut gram = dense::product(own.transpose(), own.as_ref());
    check()?;
    dense::add_product(gram.as_mut(), other.transpose(), other.as_ref());
    check()?;
    let mut right = dense::product(own.transpose(), own_values.as_ref());
    check()?;
    dense::add_product(right.as_mut(), other.transpose(), other_values.as_ref());
    solved_functional_map(target.unit / source.unit, gram, right.as_ref())
}

/// `unit_ratio` is the target's unit of length over the source's.
fn solved_functional_map(
    unit_ratio: f64,
    gram: Mat<f64>,
    right: MatRef<'_, f64>,
) -> Result<Mat<f64>> {
    // The constant is carried exactly, so it takes no part in the ridge.
    let ridge = |i: usize| if i == 0 { 0.0 } else { FUNCTIONAL_MAP_RIDGE };
    let alpha = dense::solve_with_ridge(gram, ridge, right)?;
    Ok(faer::Scale(unit_ratio) * alpha)
}

/// Landmarks as vertices of the meshes on which the map is sought.
fn checked_landmarks(
    source: &Shape,
    target: &Shape,
    given: &[(u32, u32)],
) -> Result<Vec<(u32, u32)>> {
    let find = |shape: &Shape, which: &str, vertex: u32| {
        let full = shape.full.as_ref();
        shape
            .given_mesh()
            .input_vertex
            .binary_search(&vertex)
            .map(|i| full.map_or(i as u32, |f| f.working_vertex(i as u32, &shape.mesh)))
            .map_err(|_| Error::BadArgument {
                what: format!(
                    "landmark vertex {vertex} of the {which} is not on its largest part: \
                     choose a vertex of the main surface"
                ),
            })
    };
    given
        .iter()
        .map(|&(s, t)| Ok((find(source, "source", s)?, find(target, "target", t)?)))
        .collect()
}

/// From the checked meshes in given resolution to their given numbering; dropped target vertices take over the image of the
/// nearest matched one, with confidence 0.
fn in_given_numbering(
    source: &Shape,
    target: &Shape,
    points: &[SurfacePoint],
    trust: &[f64],
    functional_map: Mat<f64>,
) -> Correspondence {
    let (mesh, source) = (target.given_mesh(), source.given_mesh());
    let count = mesh.input_positions.len();
    let mut checked: Vec<Option<u32>> = vec![None; count];
    for (i, &v) in mesh.input_vertex.iter().enumerate() {
        checked[v as usize] = Some(i as u32);
    }
    let tree = SpaceTree::new(&mesh.vertices);
    let mut found = Correspondence {
        faces: Vec::with_capacity(count),
        barycentric: Vec::with_capacity(count),
        vertices: Vec::with_capacity(count),
        confidence: Vec::with_capacity(count),
        functional_map,
        points: Vec::new(),
        figures: None,
        shares: Shares::BOTH,
        convergence: None,
        unmatched: 0,
        others: Vec::new(),
        hints: Arc::default(),
    };
    for (v, own) in checked.into_iter().enumerate() {
        let (i, certainty) = if let Some(i) = own {
            (i, trust[i as usize])
        } else {
            found.unmatched += 1;
            let near = tree.nearest(mesh.input_positions[v]);
            (near.expect("a checked mesh has vertices"), 0.0)
        };
        let SurfacePoint { face, weights } = points[i as usize];
        let largest = (1..3).fold(
            0,
            |best, c| if weights[c] > weights[best] { c } else { best },
        );
        let corner = source.faces[face as usize][largest];
        found.faces.push(source.input_face[face as usize]);
        found.vertices.push(source.input_vertex[corner as usize]);
        let turned = source.turned[face as usize];
        let [a, b, c] = weights;
        found
            .barycentric
            .push(if turned { [a, c, b] } else { [a, b, c] });
        found.confidence.push(certainty);
    }
    found
}
