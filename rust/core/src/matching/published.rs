//! The published method and those it is compared with: dense maps read off one embedding.

use faer::{Mat, MatRef};

use super::Correspondence;
use super::result::correspondence::dense_map;
use crate::baselines::spectral_gmds::{self, Objective, Weights};
use crate::baselines::{Convergence, Embedding};
use crate::error::Result;
use crate::matching::problem::point_map::{PointMap, PointMaps};
use crate::matching::result::confidence::local_distortion;
use crate::matching::search;
use crate::shape::Shape;
use crate::watch::progress::Progress;

/// S-GMDS from an automatic start.
pub(super) fn by_paper(
    source: &Shape,
    target: &Shape,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Embedding> {
    report("distance operator", 0.0)?;
    let [source_operator, target_operator] = paper_operators(source, target)?;
    report("S-GMDS", 0.2)?;
    let k = target_operator.nrows();
    let objective = paper_objective(
        source,
        target,
        source_operator.as_ref(),
        target_operator.as_ref(),
    );
    let seed = search::best_signs(source_operator.as_ref(), target_operator.as_ref());
    let start = spectral_gmds::continued_signs(
        seed.as_ref(),
        source_operator.as_ref(),
        target_operator.as_ref(),
    );
    let minimum = objective.minimised(start.as_ref(), progress)?;
    Ok(Embedding {
        target: target.rows.first(k),
        source: source.rows.times(minimum.matrix.as_ref()),
        convergence: Convergence {
            energy: minimum.energy,
            gradient_norm: Some(minimum.gradient_norm),
            steps: minimum.steps,
            converged: minimum.converged,
        },
    })
}

/// The dense map of an embedding in which matched points lie together.
pub(super) fn embedded(
    source: &Shape,
    target: &Shape,
    embedding: &Embedding,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Correspondence> {
    report("dense map", 0.5)?;
    let check = || progress.check();
    let (of_target, of_source) = (&embedding.target, &embedding.source);
    let images = PointMaps {
        target_to_source: source.cells.nearest(of_target, of_source, &check)?,
        source_to_target: target.cells.nearest(of_source, of_target, &check)?,
    };
    let map = PointMap {
        from: target,
        to: source,
        images: &images.target_to_source,
    };
    // No surface is deformed, so that there is no gap.
    let misfit: Vec<(f64, f64)> = local_distortion(map, 1.0, progress)?
        .into_iter()
        .map(|distortion| (distortion, 0.0))
        .collect();
    let mut found = dense_map(
        source,
        target,
        [&embedding.source, &embedding.target],
        images.as_slices(),
        &misfit,
        (&[], false),
        progress,
    )?;
    found.convergence = Some(embedding.convergence);
    Ok(found)
}

/// The operators α of source and target, both `(k, k)`.
fn paper_operators(source: &Shape, target: &Shape) -> Result<[Mat<f64>; 2]> {
    let k = source.paper_size().min(target.paper_size());
    Ok([source.paper_operator(k)?, target.paper_operator(k)?])
}

fn paper_objective<'a>(
    source: &'a Shape,
    target: &'a Shape,
    source_operator: MatRef<'a, f64>,
    target_operator: MatRef<'a, f64>,
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
    let [source_operator, target_operator] = paper_operators(source, target)?;
    let objective = paper_objective(
        source,
        target,
        source_operator.as_ref(),
        target_operator.as_ref(),
    );
    let to_unit_area = source.unit / target.unit;
    let k = target_operator.nrows();
    let c = Mat::from_fn(k, k, |i, j| to_unit_area * functional_map[(j, i)]);
    Ok(objective.value(c.as_ref()).0)
}
