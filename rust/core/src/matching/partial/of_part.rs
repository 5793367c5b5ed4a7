//! The automatic method for a part of a whole: its hypotheses, and how the best of them becomes the map.

use std::ops::Range;

use faer::Mat;

use crate::error::{Error, Result};
use crate::matching::completed::{Completed, judged, ranked};
use crate::matching::partial::relocation;
use crate::matching::partial::search::{self, PartInWhole};
use crate::matching::partial::settings::OF_PART;
use crate::matching::problem::pair::{Coverage, Pair, Part};
use crate::matching::problem::which::Which;
use crate::matching::ranking::quality;
use crate::matching::ranking::{self, Hypothesis};
use crate::matching::refinement::embedded_surface::Refined;
use crate::matching::refinement::overlap;
use crate::matching::refinement::relative_length::growth_at_samples;
use crate::watch::progress::Progress;

/// Which open shape is a part, and lengths, if both are of one size as given: it is then clearly smaller.
pub(in crate::matching) fn part_by_given_lengths(pair: &Pair<'_>) -> Option<(Which, f64)> {
    open_shape_within(pair, &OF_PART.part_lengths)
}

/// Which open shape is so much smaller, with both of one size as given, that its shape may be found on the other.
pub(in crate::matching) fn small_part(pair: &Pair<'_>) -> Option<Which> {
    open_shape_within(pair, &OF_PART.located_lengths).map(|(part_is, _)| part_is)
}

/// The open shape whose length in units of the other is within a range, the target first, and how many units of the source one of the
/// target is.
fn open_shape_within(pair: &Pair<'_>, range: &Range<f64>) -> Option<(Which, f64)> {
    let lengths = pair.target.unit / pair.source.unit;
    let found = [Which::Target, Which::Source].into_iter().find(|&part_is| {
        pair.shape(part_is).mesh.is_open() && range.contains(&part_is.seen(lengths))
    });
    found.map(|part_is| (part_is, lengths))
}

/// Whether a map between wholes may be that of a part of such lengths: it is doubtful, stretches the surface, or
/// says so of distances.
pub(in crate::matching) fn may_be_part(
    pair: &Pair<'_>,
    map: &Hypothesis,
    (_, lengths): (Which, f64),
) -> bool {
    pair.uses(Part::Retry)
        && map.coverage == Coverage::BOTH
        && (quality::doubtful(&map.metrics)
            || quality::stretches(&map.metrics)
            || grows_to(pair, map, lengths))
}

/// Whether a map makes distances rather so many times as long than leaving them.
fn grows_to(pair: &Pair<'_>, map: &Hypothesis, lengths: f64) -> bool {
    let growth = growth_at_samples(pair.samples_to_source(map.judged_images()));
    (growth / lengths).ln().abs() < growth.ln().abs()
}

/// Hypotheses for a part of known lengths: from distances between samples, and from maps found otherwise.
pub(in crate::matching) fn placed(
    pair: &Pair<'_>,
    (part_is, lengths): (Which, f64),
    others: &[Hypothesis],
    progress: &Progress,
) -> Result<Vec<Hypothesis>> {
    let pair = &Pair {
        coverage: Coverage::of_part(part_is),
        lengths,
        ..*pair
    };
    let check = || progress.check();
    let mut starts = search::first_maps(&PartInWhole::of(pair, part_is), &check)?;
    starts.extend(
        others
            .iter()
            .take(OF_PART.other_starts)
            .map(|h| h.matrix.clone()),
    );
    ranking::of_part(pair, &starts, &check)
}

/// Those for a part whose lengths nothing tells.
pub(in crate::matching) fn placed_at_assumed_lengths(
    pair: &Pair<'_>,
    part_is: Which,
    others: &[Hypothesis],
    progress: &Progress,
) -> Result<Vec<Hypothesis>> {
    let mut found = Vec::new();
    for length in OF_PART.assumed_part_lengths {
        let more = placed(pair, (part_is, part_is.seen(length)), others, progress)?;
        found = ranking::merged(pair.source, found, more);
    }
    Ok(found)
}

/// The best of the first maps of a part by their completed metrics, which take the place of those before: many are
/// half turned after a short refinement, so that the right one may rank behind several. Once one of a few is clear the
/// others are left.
pub(in crate::matching) fn best_of_part<'a>(
    hypotheses: &mut [Hypothesis],
    complete: &dyn Fn(&[Hypothesis]) -> Result<Vec<Completed<'a>>>,
) -> Result<Option<(usize, Completed<'a>)>> {
    let of_part = hypotheses.iter().take_while(|h| h.is_of_part()).count();
    let mut best: Option<(usize, Completed<'a>)> = None;
    let first = &mut hypotheses[..of_part.min(OF_PART.most_completed)];
    for (batch, some) in first.chunks_mut(OF_PART.at_once).enumerate() {
        for (i, map) in complete(some)?.into_iter().enumerate() {
            some[i].judge_anew(map.metrics, &map.state);
            if best
                .as_ref()
                .is_none_or(|(_, other)| map.metrics.cost() < other.metrics.cost())
            {
                best = Some((batch * OF_PART.at_once + i, map));
            }
        }
        if best
            .as_ref()
            .is_some_and(|(_, map)| quality::clear(&map.metrics))
        {
            break;
        }
    }
    Ok(best)
}

/// The completed map of a part, or a better one found by moving samples to where the rest of it would have them; another
/// map is one more hypothesis.
pub(in crate::matching) fn with_relocations<'a>(
    pair: &Pair<'a>,
    hypotheses: &mut Vec<Hypothesis>,
    (mut best, mut map): (usize, Completed<'a>),
    complete: &dyn Fn(&[Hypothesis]) -> Result<Vec<Completed<'a>>>,
    progress: &Progress,
) -> Result<(usize, Completed<'a>)> {
    let check = || progress.check();
    let most = if pair.uses(Part::Relocation) {
        OF_PART.relocations
    } else {
        0
    };
    for _ in 0..most {
        let pair = &Pair {
            coverage: hypotheses[best].coverage,
            lengths: map.state.lengths(),
            ..*pair
        };
        let starts = relocated(pair, &map.state, progress)?;
        let bound = map.metrics.cost();
        let mut found = ranking::of_part(pair, &starts, &check)?;
        found.retain(|h| h.metrics.cost() < OF_PART.worth_completing * bound);
        let completed = complete(&found)?;
        for (mut hypothesis, other) in found.into_iter().zip(completed) {
            if other.metrics.cost() < map.metrics.cost() {
                hypothesis.judge_anew(other.metrics, &other.state);
                if ranking::say_the_same(pair.source, &hypothesis, &hypotheses[best]) {
                    hypotheses[best] = hypothesis;
                } else {
                    best = hypotheses.len();
                    hypotheses.push(hypothesis);
                }
                map = other;
            }
        }
        if map.metrics.cost() >= bound {
            break;
        }
    }
    Ok((best, map))
}

/// First maps by the samples of a part, some moved to where the rest of its map would have them.
fn relocated(pair: &Pair<'_>, map: &Refined<'_>, progress: &Progress) -> Result<Vec<Mat<f64>>> {
    let Some(part_is) = pair.coverage.part() else {
        return Ok(Vec::new());
    };
    let (pair, images) = (
        PartInWhole::of(pair, part_is),
        &map.side(part_is).images.vertex,
    );
    let found = relocation::relocated(&pair, images, progress)?;
    found.iter().map(|images| pair.fitted(images)).collect()
}

/// Refines the map of a part once more on what it covers of the whole, where that is no worse; also a map between
/// wholes where given lengths say that one may be a part, if it is then better.
pub(in crate::matching) fn refine_on_covered<'a>(
    pair: &Pair<'a>,
    hypothesis: &mut Hypothesis,
    map: &mut Completed<'a>,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<()> {
    if !pair.uses(Part::Overlap) {
        return Ok(());
    }
    let of_part = hypothesis.is_of_part();
    let part = if of_part {
        let part_is = hypothesis.coverage.part();
        part_is.map(|part_is| (part_is, map.state.lengths()))
    } else {
        part_by_given_lengths(pair).filter(|part| may_be_part(pair, hypothesis, *part))
    };
    let Some((part_is, lengths)) = part else {
        return Ok(());
    };
    let pair = &Pair {
        coverage: Coverage::of_part(part_is),
        lengths,
        ..*pair
    };
    let mut as_part = Hypothesis {
        coverage: pair.coverage,
        lengths,
        ..hypothesis.clone()
    };
    let bound = if of_part {
        OF_PART.covered_well * map.metrics.cost()
    } else {
        judged(pair, &as_part, &map.state)?.cost()
    };
    for round in 0..OF_PART.covered_rounds {
        let within = |f: f64| {
            report(
                "refinement",
                (round as f64 + f) / OF_PART.covered_rounds as f64,
            )
        };
        let found = overlap::refined_on_covered(pair, &map.state, progress, &within);
        let Some(state) = unless_impossible(found, &mut map.remarks)? else {
            return Ok(());
        };
        let found = ranked(pair, &as_part, state, progress)?;
        if found.metrics.cost() > bound {
            return Ok(());
        }
        as_part.judge_anew(found.metrics, &found.state);
        *hypothesis = as_part.clone();
        *map = found;
    }
    Ok(())
}

/// Nothing, and a remark, where a piece of a shape has no spectrum: the map goes without, since what was given has one.
fn unless_impossible<T>(found: Result<Option<T>>, remarks: &mut Vec<String>) -> Result<Option<T>> {
    match found {
        Err(reason @ (Error::NotFactorised { .. } | Error::NotConverged { .. })) => {
            remarks.push(format!(
                "the map was not refined on what the part covers alone: there {reason}"
            ));
            Ok(None)
        }
        found => found,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_piece_without_a_spectrum_is_remarked_and_everything_else_is_an_error() {
        let mut remarks = Vec::new();
        let impossible = Error::NotConverged {
            found: 143,
            wanted: 150,
            residual: 1e-3,
        };
        assert_eq!(
            unless_impossible::<()>(Err(impossible), &mut remarks),
            Ok(None)
        );
        assert!(remarks[0].contains("143 of 150"), "{remarks:?}");
        assert_eq!(unless_impossible(Ok(Some(1)), &mut remarks), Ok(Some(1)));
        let cancelled = unless_impossible::<()>(Err(Error::Cancelled), &mut remarks);
        assert_eq!(cancelled, Err(Error::Cancelled));
        assert_eq!(remarks.len(), 1);
    }
}
