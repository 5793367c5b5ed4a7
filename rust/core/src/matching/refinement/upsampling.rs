//! Spectral upsampling: more eigenfunctions at each step, fitted in both directions.
//!
//! # Source
//! Melzi et al., "`ZoomOut`", 2019, made bijective by least squares over both point maps.

use faer::Mat;

use crate::algebra::closest::closest;
use crate::algebra::dense;
use crate::error::Result;
use crate::matching::problem::pair::Pair;
use crate::matching::problem::point_map::PointMaps;
use crate::matching::refinement::settings::UPSAMPLING;
use crate::matching::search::{Candidate, SampledBases, fit, gram};
use crate::mesh::numbering::Sample;
use crate::shape::Shape;

/// `(kₛ, kₜ)` map of up to `UPSAMPLING.upsampled_size` eigenfunctions grown from a candidate, by nearest
/// neighbours between the two shapes' samples.
///
/// # Errors
/// [`crate::Error::NotFactorised`] when the point maps collapse.
pub fn upsampled(pair: &Pair<'_>, candidate: &Candidate) -> Result<Mat<f64>> {
    let (target, source) = (pair.target, pair.source);
    let largest = UPSAMPLING
        .upsampled_size
        .min(target.basis.values.len())
        .min(source.basis.values.len());
    let at_samples =
        |s: &Shape| dense::gather_rows(s.basis.functions.as_ref(), &s.farthest, largest);
    let (on_target, (on_source, source_gram)) = rayon::join(
        || at_samples(target),
        || {
            let on_source = at_samples(source);
            let gram = gram(on_source.as_ref());
            (on_source, gram)
        },
    );
    let bases = SampledBases {
        target: on_target.as_ref(),
        source: on_source.as_ref(),
        source_gram: source_gram.as_ref(),
    };
    let asked = dense::in_single(on_target.as_ref());
    let mut matrix = candidate.matrix.clone();
    loop {
        let k = matrix.ncols();
        let asked = asked.get(.., ..k);
        let turned = dense::product(on_source.get(.., ..k), matrix.as_ref());
        let answers = dense::in_single(turned.as_ref());
        let answers = answers.as_ref();
        let (on_answers, on_asked) = rayon::join(
            || Sample::each(closest(asked, answers, None, 1.0)),
            || Sample::each(closest(answers, asked, None, 1.0)),
        );
        matrix = fit(
            bases,
            PointMaps {
                target_to_source: &on_answers,
                source_to_target: &on_asked,
            },
            pair.coverage,
            (k + UPSAMPLING.step).min(largest),
        )?;
        if k == largest {
            return Ok(matrix);
        }
    }
}
