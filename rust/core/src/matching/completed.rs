//! A hypothesis with its final refinement.

use super::Correspondence;
use super::result::correspondence::dense_map;
use crate::algebra::vector;
use crate::error::Result;
use crate::matching::problem::pair::{Coverage, Pair, Part};
use crate::matching::ranking::quality;
use crate::matching::ranking::{self, Hypothesis, Metrics};
use crate::matching::refinement::embedded_surface::{self, FULL, ISOMETRIC, Refined};
use crate::matching::refinement::settings::UPSAMPLING;
use crate::matching::result::confidence::local_distortion;
use crate::matching::settings::COMPLETED;
use crate::shape::Shape;
use crate::watch::progress::Progress;

/// A refined map with what decides between close ones.
pub(super) struct Completed<'a> {
    /// The refined map.
    pub(super) state: Refined<'a>,
    /// Metrics of the refined map.
    pub(super) metrics: Metrics,
    /// Local distortion at each target vertex.
    pub(super) distortion: Vec<f64>,
    /// Source vertex of each target vertex.
    pub(super) images: Vec<u32>,
    /// What could not be done for it.
    pub(super) remarks: Vec<String>,
}

impl Completed<'_> {
    /// The dense map, with what is known of it.
    pub(super) fn finished(
        self,
        pair: &Pair<'_>,
        hypothesis: &Hypothesis,
        progress: &Progress,
    ) -> Result<Correspondence> {
        let (asking, answering) = (self.state.target(), self.state.source());
        let gaps = self.state.gaps();
        let misfit: Vec<(f64, f64)> = self.distortion.iter().copied().zip(gaps).collect();
        let (torn, found) = rayon::join(
            || torn(pair, &self.images),
            || {
                dense_map(
                    pair.source,
                    pair.target,
                    [&answering.rows, &asking.rows],
                    self.state.maps(),
                    &misfit,
                    (
                        &pair.constraints.landmarks,
                        !hypothesis.is_placed() && pair.uses(Part::Detail),
                    ),
                    progress,
                )
            },
        );
        let mut found = found?;
        found.metrics = Some(Metrics {
            agreement: self.metrics.agreement,
            torn,
            ..hypothesis.metrics
        });
        found.coverage = hypothesis.coverage;
        found.remarks = self.remarks;
        Ok(found)
    }
}

/// Share of the target's area around vertices whose image is far from that of a neighbour near by.
fn torn(pair: &Pair<'_>, images: &[u32]) -> f64 {
    let target = pair.target;
    let apart = |shape: &Shape, [a, b]: [u32; 2]| {
        vector::distance(
            shape.mesh.vertices[a as usize],
            shape.mesh.vertices[b as usize],
        )
    };
    let at_tear = |v: usize| {
        target.neighbours.row(v).iter().any(|&u| {
            let images = [images[v], images[u as usize]];
            apart(pair.source, images) > apart(target, [v as u32, u]) + COMPLETED.torn_apart
        })
    };
    let vertices = (0..images.len()).filter(|&v| at_tear(v));
    vertices.fold(0.0, |area, v| area + target.mass[v])
}

/// A hypothesis with its final refinement, ranked by what that gives.
pub(super) fn completed_and_ranked<'a>(
    pair: &Pair<'a>,
    hypothesis: &Hypothesis,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Completed<'a>> {
    let (pair, state) = refined(pair, hypothesis, report)?;
    report("dense map", 0.9)?;
    ranked(&pair, hypothesis, state, progress)
}

/// A hypothesis with its final refinement, where no other comes close: what it does to curvatures is looked at anew.
pub(super) fn completed_alone<'a>(
    pair: &Pair<'a>,
    hypothesis: &Hypothesis,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Completed<'a>> {
    let (pair, state) = refined(pair, hypothesis, report)?;
    report("dense map", 0.9)?;
    with_figures(&pair, state, progress, |state| {
        let mut metrics = hypothesis.metrics;
        if !hypothesis.is_placed() {
            metrics.agreement = ranking::agreement(&pair, &ranking::sampled_images(state));
        }
        Ok(metrics)
    })
}

/// A refined map with what decides between close ones.
pub(super) fn ranked<'a>(
    pair: &Pair<'a>,
    hypothesis: &Hypothesis,
    state: Refined<'a>,
    progress: &Progress,
) -> Result<Completed<'a>> {
    with_figures(pair, state, progress, |state| {
        judged(pair, hypothesis, state)
    })
}

/// A refined map with its metrics and what it does to distances around each vertex.
fn with_figures<'a>(
    pair: &Pair<'a>,
    state: Refined<'a>,
    progress: &Progress,
    metrics: impl FnOnce(&Refined<'a>) -> Result<Metrics> + Send,
) -> Result<Completed<'a>> {
    let images = state.target().images.vertex.clone();
    let (metrics, distortion) = rayon::join(
        || metrics(&state),
        || local_distortion(pair.to_source(&images), pair.lengths, progress),
    );
    Ok(Completed {
        metrics: metrics?,
        distortion: distortion?,
        images,
        state,
        remarks: Vec::new(),
    })
}

/// Metrics of the refined map of a hypothesis; what is known of it beside others is kept.
pub(super) fn judged(
    pair: &Pair<'_>,
    hypothesis: &Hypothesis,
    map: &Refined<'_>,
) -> Result<Metrics> {
    if hypothesis.is_placed() {
        return Ok(hypothesis.metrics);
    }
    let of_part = hypothesis
        .is_of_part()
        .then(|| map.low_map(UPSAMPLING.upsampled_size))
        .transpose()?;
    let Metrics {
        contradiction,
        margin,
        apart,
        mirrored_gain,
        ..
    } = hypothesis.metrics;
    Ok(Metrics {
        contradiction,
        margin,
        apart,
        mirrored_gain,
        ..ranking::metrics(
            pair,
            of_part.as_ref().unwrap_or(&hypothesis.matrix).as_ref(),
            &ranking::sampled_images(map),
        )
    })
}

/// The refined map of a hypothesis, and what it says of the pair.
fn refined<'a>(
    pair: &Pair<'a>,
    hypothesis: &Hypothesis,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<(Pair<'a>, Refined<'a>)> {
    if let Some(placed) = &hypothesis.placed {
        return embedded_surface::of_places(pair, placed, &|| report("refinement", 0.0));
    }
    let pair = Pair {
        coverage: hypothesis.coverage,
        lengths: hypothesis.lengths,
        ..*pair
    };
    let schedule = if pair.coverage == Coverage::BOTH && quality::isometric(&hypothesis.metrics) {
        ISOMETRIC
    } else {
        FULL
    };
    let state = embedded_surface::refined(
        &pair,
        hypothesis.matrix.as_ref(),
        Some(hypothesis.images.as_slices()),
        schedule,
        &|f| report("refinement", 0.9 * f),
    )?;
    let pair = Pair {
        lengths: state.lengths(),
        ..pair
    };
    Ok((pair, state))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matching::problem::constraints::Constraints;
    use crate::testing::{self, RINGS, torus};

    #[test]
    fn a_map_tears_the_surface_where_a_piece_of_it_goes_elsewhere() {
        let shape = torus(RINGS);
        let constraints = Constraints::default();
        let pair = testing::pair(&shape, &shape, Coverage::BOTH, &constraints);
        let vertices = &shape.mesh.vertices;
        let own: Vec<u32> = (0..vertices.len() as u32).collect();
        assert_eq!(torn(&pair, &own), 0.0);

        // A sixth of the torus goes to the opposite side, which is more than TORN_APART away.
        let elsewhere = |v: usize| vertices[v][1] > vertices[v][0].abs() * 3f64.sqrt();
        let images: Vec<u32> = own
            .iter()
            .map(|&v| {
                let [x, y, z] = vertices[v as usize];
                let opposite = [-x, -y, z];
                let apart = |&u: &u32| vector::distance(vertices[u as usize], opposite);
                let nearest = own
                    .iter()
                    .copied()
                    .min_by(|a, b| apart(a).total_cmp(&apart(b)));
                if elsewhere(v as usize) {
                    nearest.expect("there are vertices")
                } else {
                    v
                }
            })
            .collect();
        let along_rims: f64 = own
            .iter()
            .filter(|&&v| {
                let mut around = shape.neighbours.row(v as usize).iter();
                around.any(|&u| elsewhere(u as usize) != elsewhere(v as usize))
            })
            .map(|&v| shape.mass[v as usize])
            .sum();
        assert!(along_rims > 0.0);
        // The same numbers, added in the same order.
        assert_eq!(torn(&pair, &images), along_rims);
    }
}
