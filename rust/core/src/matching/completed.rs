//! A hypothesis with its final refinement.

use super::Correspondence;
use super::correspondence::dense_map;
use crate::confidence::local_distortion;
use crate::error::Result;
use crate::pair::Pair;
use crate::progress::Progress;
use crate::refinement::embedded_surface::{self, Refined};
use crate::refinement::upsampling::UPSAMPLED_SIZE;
use crate::selection::{self, Figures, Hypothesis};

/// A refined map with what decides between close ones.
pub(super) struct Completed<'a> {
    /// The refined map.
    pub(super) state: Refined<'a>,
    /// Figures of the refined map.
    pub(super) figures: Figures,
    /// Local distortion at each target vertex.
    pub(super) distortion: Vec<f64>,
    /// Source vertex of each target vertex.
    pub(super) images: Vec<u32>,
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
            agreement: self.figures.agreement,
            ..hypothesis.figures
        });
        found.shares = hypothesis.shares;
        Ok(found)
    }
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

/// A refined map with what decides between close ones.
pub(super) fn ranked<'a>(
    pair: &Pair<'a>,
    hypothesis: &Hypothesis,
    state: Refined<'a>,
    progress: &Progress,
) -> Result<Completed<'a>> {
    let images = state.target().images.vertex.clone();
    Ok(Completed {
        figures: judged(pair, hypothesis, &state)?,
        distortion: local_distortion(pair.target, pair.source, &images, pair.lengths, progress)?,
        images,
        state,
    })
}

/// Figures of the refined map of a hypothesis.
pub(super) fn judged(
    pair: &Pair<'_>,
    hypothesis: &Hypothesis,
    map: &Refined<'_>,
) -> Result<Figures> {
    if hypothesis.in_place {
        return Ok(hypothesis.figures);
    }
    let of_part = hypothesis
        .is_of_part()
        .then(|| map.low_map(UPSAMPLED_SIZE))
        .transpose()?;
    Ok(Figures {
        contradiction: hypothesis.figures.contradiction,
        mirrored_gain: hypothesis.figures.mirrored_gain,
        ..selection::figures(
            pair,
            of_part.as_ref().unwrap_or(&hypothesis.matrix).as_ref(),
            &selection::judged_images(map.target()),
            &selection::judged_images(map.source()),
        )
    })
}

/// The refined map of a hypothesis, and what it says of the pair.
fn refined<'a>(
    pair: &Pair<'a>,
    hypothesis: &Hypothesis,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<(Pair<'a>, Refined<'a>)> {
    if hypothesis.in_place
        && let Some(found) = embedded_surface::in_place(pair, &|| report("refinement", 0.0))?
    {
        return Ok(found);
    }
    let pair = Pair {
        shares: hypothesis.shares,
        lengths: hypothesis.lengths,
        ..*pair
    };
    let state = embedded_surface::refined(
        &pair,
        hypothesis.matrix.as_ref(),
        embedded_surface::FULL,
        &|f| report("refinement", 0.9 * f),
    )?;
    let pair = Pair {
        lengths: state.lengths(),
        ..pair
    };
    Ok((pair, state))
}
