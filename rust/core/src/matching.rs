//! The whole chain: two prepared shapes in, a dense map out.

use std::sync::Arc;

use faer::{Mat, MatRef};
use rayon::prelude::*;

use crate::confidence::confidence;
use crate::dense::{self, Rows};
use crate::distance_operator;
use crate::error::{Error, Result};
use crate::map_search::{self, SampledPair, Width};
use crate::pointwise_map::{self, SurfacePoint};
use crate::progress::Progress;
use crate::refinement::embedded_surface::{self, Refined, Side};
use crate::refinement::propagation::Images;
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

/// Close hypotheses completed at most.
const MOST_COMPLETED: usize = 3;

/// Which algorithm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Search, vote and refinement.
    Auto,
    /// The published algorithm from an automatic start.
    Paper,
}

/// What the caller may ask for.
#[derive(Debug, Clone)]
pub struct Options {
    /// Algorithm.
    pub method: Method,
    /// Whether mirrored maps are allowed.
    pub mirror: Mirror,
    /// Pairs (source vertex, target vertex) in given numbering.
    pub landmarks: Vec<(u32, u32)>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            method: Method::Auto,
            mirror: Mirror::Forbid,
            landmarks: Vec::new(),
        }
    }
}

/// How the paper's minimisation ended.
#[derive(Debug, Clone, Copy)]
pub struct Convergence {
    /// Final S-GMDS energy.
    pub energy: f64,
    /// Norm of its gradient over the unknowns.
    pub gradient_norm: f64,
    /// Steps taken.
    pub steps: usize,
    /// Whether it came to rest.
    pub converged: bool,
}

/// A map that may be the right one, before its final refinement.
#[derive(Debug, Clone)]
pub struct Hypothesis {
    /// `(60, 60)` map, target coefficients → source coefficients.
    pub matrix: Mat<f64>,
    /// Its figures in the vote.
    pub figures: Figures,
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
    match options.method {
        Method::Paper => by_paper(source, target, progress, report),
        Method::Auto => {
            let landmarks = checked_landmarks(source, target, &options.landmarks)?;
            report("search", 0.0)?;
            let pair = SampledPair::new(target, source);
            let candidates = pair.search(Width::default(), progress)?;
            report("selection", 0.35)?;
            let hypotheses: Vec<Hypothesis> = selection::vote(
                target,
                source,
                &candidates,
                options.mirror,
                &landmarks,
                &|f| report("selection", 0.35 + 0.25 * f),
            )?
            .into_iter()
            .map(|v| Hypothesis {
                matrix: v.matrix,
                figures: v.figures,
            })
            .collect();
            clearest(source, target, hypotheses, progress, &|s, f| {
                report(s, 0.6 + 0.4 * f)
            })
        }
    }
}

/// The best hypothesis completed. Close ones are all completed and ranked anew by their refined
/// maps; the others are kept as alternatives.
fn clearest(
    source: &Shape,
    target: &Shape,
    mut hypotheses: Vec<Hypothesis>,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Correspondence> {
    let close = selection::rivals(&hypotheses, |h| &h.figures).min(MOST_COMPLETED);
    let completed: Vec<(f64, Correspondence)> = hypotheses[..close]
        .par_iter()
        .map(|h| completed_and_ranked(source, target, h, progress, report))
        .collect::<Result<_>>()?;
    let (best, (_, mut found)) = completed
        .into_iter()
        .enumerate()
        .min_by(|(_, (a, _)), (_, (b, _))| a.total_cmp(b))
        .ok_or(Error::NoMap {
            reason: "no candidate stood in the vote".into(),
        })?;
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
    completed_and_ranked(source, target, hypothesis, progress, report).map(|(_, found)| found)
}

/// The same with the rank of the refined map.
fn completed_and_ranked(
    source: &Shape,
    target: &Shape,
    hypothesis: &Hypothesis,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<(f64, Correspondence)> {
    let state = embedded_surface::refined(
        target,
        source,
        hypothesis.matrix.as_ref(),
        embedded_surface::FULL,
        &|f| report("refinement", 0.9 * f),
    )?;
    report("dense map", 0.9)?;
    let Refined {
        target: asking,
        source: answering,
        ..
    } = &state;
    let mut found = dense_map(
        source,
        target,
        (&asking.rows, &asking.images),
        (&answering.rows, &answering.images),
        progress,
    )?;
    found.figures = Some(hypothesis.figures);
    let images = |side: &Side<'_>| -> Vec<u32> {
        selection::judging(side.shape())
            .iter()
            .map(|&v| side.images.vertex[v as usize])
            .collect()
    };
    let refined = selection::figures(
        target,
        source,
        hypothesis.matrix.as_ref(),
        &images(asking),
        &images(answering),
    );
    Ok((refined.rank(), found))
}

fn by_paper(
    source: &Shape,
    target: &Shape,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Correspondence> {
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
    report("dense map", 0.5)?;
    let target_rows = Rows::from_matrix(target.basis.functions.as_ref(), k);
    let turned = dense::product(source.functions(k), minimum.matrix.as_ref());
    let source_rows = Rows::from_matrix(turned.as_ref(), k);
    let images = |from: &Shape, a: &Rows, to: &Shape, b: &Rows| {
        let real = |s: &Shape| (0..s.mesh.surface_vertices as u32).collect::<Vec<_>>();
        Images {
            vertex: crate::nearest::nearest(&a.gather(&real(from)), &b.gather(&real(to))),
            cost: Vec::new(),
        }
    };
    let on_source = images(target, &target_rows, source, &source_rows);
    let on_target = images(source, &source_rows, target, &target_rows);
    let mut found = dense_map(
        source,
        target,
        (&target_rows, &on_source),
        (&source_rows, &on_target),
        progress,
    )?;
    found.convergence = Some(Convergence {
        energy: minimum.energy,
        gradient_norm: minimum.gradient_norm,
        steps: minimum.steps,
        converged: minimum.converged,
    });
    Ok(found)
}

/// Points, confidence and functional map from two embeddings and the vertex maps between them.
fn dense_map(
    source: &Shape,
    target: &Shape,
    (target_rows, on_source): (&Rows, &Images),
    (source_rows, on_target): (&Rows, &Images),
    progress: &Progress,
) -> Result<Correspondence> {
    let images = &on_source.vertex[..target.mesh.surface_vertices];
    let back = &on_target.vertex[..source.mesh.surface_vertices];
    let points = pointwise_map::projected(target_rows, source_rows, images, source);
    let trust = confidence(target, source, images, progress)?;
    let functional_map = functional_map(source, target, images, back)?;
    Ok(in_given_numbering(
        source,
        target,
        &points,
        &trust,
        functional_map,
    ))
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
    Ok(faer::Scale(target.mesh.scale / source.mesh.scale) * alpha)
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
