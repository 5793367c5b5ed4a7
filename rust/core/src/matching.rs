//! The whole chain: two prepared shapes in, a dense map out.

use std::sync::Arc;

use faer::{Mat, MatRef};
use rayon::prelude::*;

use crate::baselines::{Convergence, Embedding, functional_map, gmds};
use crate::confidence::confidence;
use crate::dense::{self, Rows};
use crate::distance_operator;
use crate::error::{Error, Result};
use crate::map_search::{self, SampledPair, Shares, Width};
use crate::nearest::nearest;
use crate::pointwise_map::{self, SurfacePoint};
use crate::progress::Progress;
use crate::quality::{self, Grade};
use crate::refinement::embedded_surface::{self, Refined, Side};
use crate::selection::{self, Figures, Mirror};
use crate::shape::Shape;
use crate::space_tree::SpaceTree;
use crate::spectral_gmds::{self, Objective, Weights};

/// Eigenfunctions of the paper's map.
const PAPER_SIZE: usize = 30;
/// Columns of the functional map that is handed out.
const FUNCTIONAL_MAP_SIZE: usize = 60;
/// Ridge of that map's fit.
const FUNCTIONAL_MAP_RIDGE: f64 = 1e-3;

/// A map between a part and a whole is taken when its rank is below this times that of the map
/// between wholes: right ones reach 0.5 to 0.78, on whole shapes they stay above 0.95.
const PART_FITS_BETTER: f64 = 0.8;
/// Close maps whose images lie nearer than this on average differ in some part only; then the
/// tear around that part shows which is wrong.
const MOSTLY_SAME: f64 = 0.15;
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
}

impl Default for Options {
    fn default() -> Self {
        Self {
            method: Method::Auto,
            mirror: Mirror::Forbid,
            shares: None,
            landmarks: Vec::new(),
        }
    }
}

/// A map that may be the right one, before its final refinement.
#[derive(Debug, Clone)]
pub struct Hypothesis {
    /// `(60, 60)` map, target coefficients → source coefficients.
    pub matrix: Mat<f64>,
    /// Its figures in the vote.
    pub figures: Figures,
    /// Which shape is a part of the other.
    pub shares: Shares,
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
    /// `(kₜ, kₛ)`: source coefficients → target coefficients, in given units.
    pub functional_map: Mat<f64>,
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
            let hypotheses = match options.shares {
                Some(shares) => {
                    let stage = |s: &'static str, f: f64| report(s, 0.6 * f);
                    hypotheses(
                        source, target, shares, options, &landmarks, progress, &stage,
                    )?
                }
                None => whole_or_part(source, target, options, &landmarks, progress, report)?,
            };
            clearest(source, target, hypotheses, progress, &|s, f| {
                report(s, 0.6 + 0.4 * f)
            })
        }
    }
}

/// Hypotheses for two whole shapes; when they are poor also for either being a part of the other,
/// which must then fit clearly better, since half as many questions are easier to answer well.
fn whole_or_part(
    source: &Shape,
    target: &Shape,
    options: &Options,
    landmarks: &[(u32, u32)],
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Vec<Hypothesis>> {
    let search = |shares: Shares, from: f64, to: f64| {
        let stage = |s: &'static str, f: f64| report(s, from + (to - from) * f);
        hypotheses(source, target, shares, options, landmarks, progress, &stage)
    };
    let mut best = search(Shares::BOTH, 0.0, 0.4)?;
    let whole = best[0].figures;
    if quality::graded(&whole, Shares::BOTH).0 != Grade::Red {
        return Ok(best);
    }
    let mut bound = PART_FITS_BETTER * whole.rank();
    for (shares, from, to) in [
        (Shares::TARGET_IS_PART, 0.4, 0.5),
        (Shares::SOURCE_IS_PART, 0.5, 0.6),
    ] {
        let mut part = match search(shares, from, to) {
            Err(Error::NoMap { .. }) => continue,
            found => found?,
        };
        if part[0].figures.rank() < bound {
            bound = part[0].figures.rank();
            part.push(best.swap_remove(0));
            best = part;
        }
    }
    Ok(best)
}

/// Plausible maps, best first.
fn hypotheses(
    source: &Shape,
    target: &Shape,
    shares: Shares,
    options: &Options,
    landmarks: &[(u32, u32)],
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Vec<Hypothesis>> {
    report("search", 0.0)?;
    let candidates = SampledPair::new(target, source, shares).search(Width::default(), progress)?;
    report("selection", 0.5)?;
    let voted = selection::vote(
        target,
        source,
        &candidates,
        options.mirror,
        shares,
        landmarks,
        &|f| report("selection", 0.5 + 0.5 * f),
    )?;
    Ok(voted
        .into_iter()
        .map(|v| Hypothesis {
            matrix: v.matrix,
            figures: v.figures,
            shares,
        })
        .collect())
}

/// The best hypothesis completed. Close ones are all completed and ranked anew by their refined
/// maps, those that differ from the best in a part only also by how much they tear; the others are
/// kept as alternatives.
fn clearest(
    source: &Shape,
    target: &Shape,
    mut hypotheses: Vec<Hypothesis>,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Correspondence> {
    let close = selection::rivals(&hypotheses, |h| &h.figures).min(MOST_COMPLETED);
    let mut completed: Vec<Completed> = hypotheses[..close]
        .par_iter()
        .map(|h| completed_and_ranked(source, target, h, progress, report))
        .collect::<Result<_>>()?;
    let lowest = |key: &dyn Fn(&Completed) -> f64| {
        (0..completed.len()).min_by(|&i, &j| key(&completed[i]).total_cmp(&key(&completed[j])))
    };
    let first = lowest(&|c| c.rank).ok_or(Error::NoMap {
        reason: "no candidate stood in the vote".into(),
    })?;
    let best = lowest(&|c| {
        let apart = source.mean_spectral_distance(&c.images, &completed[first].images);
        if apart < MOSTLY_SAME {
            c.rank * c.dirichlet
        } else {
            f64::INFINITY
        }
    })
    .unwrap_or(first);
    let mut found = completed.swap_remove(best).found;
    hypotheses.remove(best);
    found.others = hypotheses;
    Ok(found)
}

/// Final refinement and dense map of a hypothesis.
///
/// # Errors
/// [`Error::Cancelled`] and those of the stages.
pub fn completed(
    source: &Shape,
    target: &Shape,
    hypothesis: &Hypothesis,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Correspondence> {
    completed_and_ranked(source, target, hypothesis, progress, report).map(|c| c.found)
}

/// A completed map with what decides between close ones.
struct Completed {
    found: Correspondence,
    /// Rank of the refined map.
    rank: f64,
    /// Dirichlet energy of the carried positions.
    dirichlet: f64,
    /// Source vertices of the target's judging samples.
    images: Vec<u32>,
}

fn completed_and_ranked(
    source: &Shape,
    target: &Shape,
    hypothesis: &Hypothesis,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Completed> {
    let state = embedded_surface::refined(
        target,
        source,
        hypothesis.matrix.as_ref(),
        hypothesis.shares,
        embedded_surface::FULL,
        &|f| report("refinement", 0.9 * f),
    )?;
    report("dense map", 0.9)?;
    let Refined {
        target: asking,
        source: answering,
        ..
    } = &state;
    let (points, mut found) = dense_map(
        source,
        target,
        (&asking.rows, &asking.images.vertex),
        (&answering.rows, &answering.images.vertex),
        progress,
    )?;
    found.figures = Some(hypothesis.figures);
    found.shares = hypothesis.shares;
    let images = |side: &Side<'_>| -> Vec<u32> {
        selection::judging(side.shape())
            .iter()
            .map(|&v| side.images.vertex[v as usize])
            .collect()
    };
    let on_source = images(asking);
    let refined = selection::figures(
        target,
        source,
        hypothesis.matrix.as_ref(),
        hypothesis.shares,
        &on_source,
        &images(answering),
    );
    Ok(Completed {
        rank: refined.rank(),
        dirichlet: pointwise_map::dirichlet_energy(target, source, &points),
        images: on_source,
        found,
    })
}

fn by_paper(
    source: &Shape,
    target: &Shape,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Embedding> {
    report("distance operator", 0.0)?;
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
    let (target_operator, source_operator) = (operator(target)?, operator(source)?);
    report("S-GMDS", 0.2)?;
    let objective = Objective {
        target_operator: target_operator.as_ref(),
        source_operator: source_operator.as_ref(),
        target_values: &target.basis.values[..k],
        source_values: &source.basis.values[..k],
        weights: Weights::default(),
    };
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
    let images = |from: &Shape, a: &Rows, to: &Shape, b: &Rows| {
        let real = |s: &Shape| (0..s.mesh.surface_vertices as u32).collect::<Vec<_>>();
        nearest(&a.gather(&real(from)), &b.gather(&real(to)))
    };
    let (_, mut found) = dense_map(
        source,
        target,
        (
            &embedding.target,
            &images(target, &embedding.target, source, &embedding.source),
        ),
        (
            &embedding.source,
            &images(source, &embedding.source, target, &embedding.target),
        ),
        progress,
    )?;
    found.convergence = Some(embedding.convergence);
    Ok(found)
}

/// Points, confidence and functional map from two embeddings and the vertex maps between them.
fn dense_map(
    source: &Shape,
    target: &Shape,
    (target_rows, on_source): (&Rows, &[u32]),
    (source_rows, on_target): (&Rows, &[u32]),
    progress: &Progress,
) -> Result<(Vec<SurfacePoint>, Correspondence)> {
    let images = &on_source[..target.mesh.surface_vertices];
    let back = &on_target[..source.mesh.surface_vertices];
    let points = pointwise_map::projected(target_rows, source_rows, images, source);
    let trust = confidence(target, source, images, progress)?;
    let functional_map = functional_map(source, target, images, back)?;
    let found = in_given_numbering(source, target, &points, &trust, functional_map);
    Ok((points, found))
}

/// α with Φₜ α ≈ Φₛ at matched points of both vertex maps, weighted by area; in given units a
/// constant goes to √(areaₜ/areaₛ) times the constant.
fn functional_map(
    source: &Shape,
    target: &Shape,
    on_source: &[u32],
    on_target: &[u32],
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
    let mut gram = dense::product(own.transpose(), own.as_ref());
    dense::add_product(gram.as_mut(), other.transpose(), other.as_ref());
    let mut right = dense::product(own.transpose(), own_values.as_ref());
    dense::add_product(right.as_mut(), other.transpose(), other_values.as_ref());
    // The constant is carried exactly, so it takes no part in the ridge.
    let ridge = |i: usize| if i == 0 { 0.0 } else { FUNCTIONAL_MAP_RIDGE };
    let alpha = dense::solve_with_ridge(gram, ridge, right.as_ref())?;
    Ok(faer::Scale(target.unit / source.unit) * alpha)
}

/// Landmarks in the numbering of the checked meshes.
fn checked_landmarks(
    source: &Shape,
    target: &Shape,
    given: &[(u32, u32)],
) -> Result<Vec<(u32, u32)>> {
    let find = |shape: &Shape, which: &str, vertex: u32| {
        shape
            .mesh
            .input_vertex
            .binary_search(&vertex)
            .map(|i| i as u32)
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

/// Back to the numbering of the given meshes; dropped target vertices take over the image of the
/// nearest matched one, with confidence 0.
fn in_given_numbering(
    source: &Shape,
    target: &Shape,
    points: &[SurfacePoint],
    trust: &[f64],
    functional_map: Mat<f64>,
) -> Correspondence {
    let mesh = &target.mesh;
    let count = mesh.input_positions.len();
    let mut checked: Vec<Option<u32>> = vec![None; count];
    for (i, &v) in mesh.input_vertex.iter().enumerate() {
        checked[v as usize] = Some(i as u32);
    }
    let surface = &mesh.vertices[..mesh.surface_vertices];
    let tree = SpaceTree::new(surface);
    let mut found = Correspondence {
        faces: Vec::with_capacity(count),
        barycentric: Vec::with_capacity(count),
        vertices: Vec::with_capacity(count),
        confidence: Vec::with_capacity(count),
        functional_map,
        figures: None,
        shares: Shares::BOTH,
        convergence: None,
        unmatched: 0,
        others: Vec::new(),
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
        let corner = source.mesh.faces[face as usize][largest];
        found.faces.push(source.mesh.input_face[face as usize]);
        found
            .vertices
            .push(source.mesh.input_vertex[corner as usize]);
        let turned = source.mesh.turned[face as usize];
        let [a, b, c] = weights;
        found
            .barycentric
            .push(if turned { [a, c, b] } else { [a, b, c] });
        found.confidence.push(certainty);
    }
    found
}
