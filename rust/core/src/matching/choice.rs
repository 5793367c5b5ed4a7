//! The automatic method: which of the maps found is completed, and which are kept beside it.

use std::cell::OnceCell;
use std::sync::Arc;

use faer::Mat;
use rayon::prelude::*;

use super::Correspondence;
use super::completed::{Completed, completed_alone, completed_and_ranked};
use super::partial::location;
use super::partial::of_part::{
    best_of_part, may_be_part, part_by_given_lengths, placed, placed_at_assumed_lengths,
    refine_on_covered, small_part, with_relocations,
};
use super::partial::uncovered::begins_at_boundary;
use crate::algebra::dense;
use crate::algebra::vector;
use crate::error::{Error, Result};
use crate::matching::problem::constraints::Constraints;
use crate::matching::problem::pair::{Coverage, LeftOut, Mirror, Pair, Part};
use crate::matching::problem::which::Which;
use crate::matching::ranking::quality;
use crate::matching::ranking::{self, Hypothesis, Metrics};
use crate::matching::refinement::coinciding::Placed;
use crate::matching::refinement::embedded_surface;
use crate::matching::refinement::regions;
use crate::matching::search::{self, Width};
use crate::matching::settings::CHOICE;
use crate::matching::standing;
use crate::matching::symmetry;
use crate::shape::Shape;
use crate::watch::progress::Progress;

/// Hypotheses for two whole shapes: by a narrow search alone where that finds a clear map without a rival; else also by how
/// they stand, which is enough where they stand alike; else by a usual search as well, from both sides where the bodies differ,
/// and then by one that also knows the plane of symmetry of each. When they are poor, also for either, if it is open, being a part
/// of the other, which must then fit clearly better, since half as many questions are easier to answer well; and when these are no
/// better, once more for whole shapes by a wider search.
pub(super) fn whole_or_part(
    pair: &Pair<'_>,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Vec<Hypothesis>> {
    let search = |pair: &Pair<'_>, coverage: Coverage, width: Width, (from, to): (f64, f64)| {
        let stage = |s: &'static str, f: f64| report(s, from + (to - from) * f);
        hypotheses(&Pair { coverage, ..*pair }, width, progress, &stage)
    };
    let (narrow, as_they_lie) = rayon::join(
        || {
            if !pair.uses(Part::Narrow) {
                return Ok(Vec::new());
            }
            found_or_none(search(pair, Coverage::BOTH, Width::NARROW, (0.0, 0.1)))
        },
        || as_they_lie(pair, progress),
    );
    let narrow = ranking::merged(pair.source, narrow?, as_they_lie?);
    let mut turned = Turned::of(pair);
    let narrow = turned.beside(narrow, progress)?;
    let part = part_by_given_lengths(pair);
    if ranking::stands_alone(&narrow) && quality::clear(&narrow[0].metrics) {
        let within = |f: f64| report("selection", 0.1 + 0.5 * f);
        return with_part_of_given_lengths(pair, part, narrow, progress, &within);
    }
    if !narrow.iter().any(Hypothesis::is_placed) {
        let located = located(pair, progress)?;
        if !located.is_empty() {
            return Ok(located);
        }
    }
    let standing = if pair.uses(Part::Standing) {
        standing::hypothesis(pair, progress)?
    } else {
        None
    };
    let (first, is_enough) = match standing.clone() {
        Some(map) => standing::beside(pair, map, narrow.clone()),
        None => (narrow.clone(), false),
    };
    // What may be graded as good is looked for in other ways as well.
    if is_enough && quality::doubtful(&first[0].metrics) {
        let within = |f: f64| report("selection", 0.1 + 0.5 * f);
        return with_part_of_given_lengths(pair, part, first, progress, &within);
    }
    let differ = first.first().is_none_or(|h| quality::differ(&h.metrics));
    let width = Width::USUAL.both_ways(differ);
    let usual = search(pair, Coverage::BOTH, width, (0.1, 0.25));
    let usual = if first.is_empty() {
        usual?
    } else {
        found_or_none(usual)?
    };
    let mut best = turned.beside(ranking::merged(pair.source, narrow, usual), progress)?;
    let mut is_enough = false;
    if let Some(map) = standing {
        (best, is_enough) = standing::beside(pair, map, best);
    }
    if is_enough {
        let within = |f: f64| report("selection", 0.25 + 0.35 * f);
        return with_part_of_given_lengths(pair, part, best, progress, &within);
    }
    let offsets = mirror_offsets(pair, &best[0].metrics, progress)?;
    let mut guided = pair;
    let symmetric = &Pair {
        mirror_offsets: offsets.as_ref().map(|[t, s]| [&t[..], &s[..]]),
        ..*pair
    };
    if offsets.is_some() {
        let more = found_or_none(search(
            symmetric,
            Coverage::BOTH,
            Width::USUAL,
            (0.25, 0.35),
        ))?;
        let bound = CHOICE.same_symmetry * best[0].metrics.surface_cost();
        if more
            .first()
            .is_some_and(|m| m.metrics.surface_cost() < bound)
        {
            ranking::hold_symmetry_against(symmetric, &mut best);
            best = ranking::merged(pair.source, best, more);
            guided = symmetric;
        }
    }
    best = with_part_of_given_lengths(pair, part, best, progress, &|f| {
        report("selection", 0.35 + 0.05 * f)
    })?;
    let whole = best[0].metrics;
    if best[0].coverage != Coverage::BOTH || !quality::doubtful(&whole) || !pair.uses(Part::Retry) {
        return Ok(best);
    }
    parts_and_wide(pair, guided, best, progress, &search)
}

/// A search of a pair, with its coverage and width, between two fractions of what is done.
type Search<'s, 'a> = &'s dyn Fn(&Pair<'a>, Coverage, Width, (f64, f64)) -> Result<Vec<Hypothesis>>;

/// The hypotheses for two whole shapes where these are poor; before them those for either being a part of the other that fit clearly
/// better, or those of a wider search, `guided` by what is known of the symmetry of both.
fn parts_and_wide<'a>(
    pair: &Pair<'a>,
    guided: &Pair<'a>,
    mut best: Vec<Hypothesis>,
    progress: &Progress,
    search: Search<'_, 'a>,
) -> Result<Vec<Hypothesis>> {
    let whole = best[0].metrics;
    for (part_is, within) in [(Which::Target, (0.4, 0.45)), (Which::Source, (0.45, 0.5))] {
        if !pair.shape(part_is).mesh.is_open() {
            continue;
        }
        let as_part = search(guided, Coverage::of_part(part_is), Width::USUAL, within);
        let found = found_or_none(as_part)?;
        let placed = placed_at_assumed_lengths(pair, part_is, &found, progress)?;
        let mut found = ranking::merged(pair.source, found, placed);
        if fits_better(&found, &whole, CHOICE.part_fits_better)
            && fits_better(&found, &best[0].metrics, 1.0)
            && begins_at_boundary(pair, part_is, &found[0])
        {
            found.push(best.swap_remove(0));
            best = found;
        }
    }
    if best[0].coverage == Coverage::BOTH && pair.uses(Part::Wide) {
        let wide = found_or_none(search(guided, Coverage::BOTH, Width::WIDE, (0.5, 0.6)))?;
        best = ranking::merged(pair.source, best, wide);
    }
    Ok(best)
}

/// The best hypotheses turned as the source is like itself, each once.
struct Turned<'a, 'b> {
    pair: &'b Pair<'a>,
    /// What turns the source onto itself, if anything, once it was looked for.
    by: OnceCell<Option<Mat<f64>>>,
    /// The map that was turned.
    of: Option<Hypothesis>,
}

impl<'a, 'b> Turned<'a, 'b> {
    fn of(pair: &'b Pair<'a>) -> Self {
        Self {
            pair,
            by: OnceCell::new(),
            of: None,
        }
    }

    /// The hypotheses with the best of them turned, best first, unless it is the one that was turned already, or doubtful: what
    /// is wrong stays wrong when turned.
    fn beside(&mut self, found: Vec<Hypothesis>, progress: &Progress) -> Result<Vec<Hypothesis>> {
        let pair = self.pair;
        let Some(best) = found.first().filter(|best| {
            let seen = |of: &Hypothesis| ranking::say_the_same(pair.source, of, best);
            pair.uses(Part::Turned)
                && !best.is_placed()
                && !quality::doubtful(&best.metrics)
                && !self.of.as_ref().is_some_and(seen)
        }) else {
            return Ok(found);
        };
        self.of = Some(best.clone());
        if self.by.get().is_none() {
            self.by = symmetry::turning_map(pair.source, progress)?.into();
        }
        let Some(Some(by)) = self.by.get() else {
            return Ok(found);
        };
        let size = by.ncols().min(best.matrix.nrows()).min(best.matrix.ncols());
        let first = best.matrix.get(..size, ..size);
        let map = dense::product(by.get(..size, ..size), first);
        let mut turned = ranking::of_first_map(pair, map, &|| progress.check())?;
        turned.metrics.mirrored_gain = best.metrics.mirrored_gain;
        if pair.mirror != Mirror::Allow && turned.metrics.orientation <= 0.0 {
            return Ok(found);
        }
        Ok(ranking::merged(pair.source, found, vec![turned]))
    }
}

/// Whether the first of some hypotheses has at most so many times the rank of another map, with and without what
/// either contradicts.
fn fits_better(found: &[Hypothesis], other: &Metrics, times: f64) -> bool {
    found.first().is_some_and(|Hypothesis { metrics, .. }| {
        metrics.surface_cost() < times * other.surface_cost()
            && metrics.cost() < times * other.cost()
    })
}

/// The hypotheses; before them those of a part with known lengths where these fit better.
fn with_part_of_given_lengths(
    pair: &Pair<'_>,
    part: Option<(Which, f64)>,
    mut best: Vec<Hypothesis>,
    progress: &Progress,
    report: &(dyn Fn(f64) -> Result<()> + Sync),
) -> Result<Vec<Hypothesis>> {
    let Some((part_is, lengths)) = part.filter(|part| may_be_part(pair, &best[0], *part)) else {
        return Ok(best);
    };
    let whole = best[0].metrics;
    report(0.0)?;
    let as_part = &Pair {
        coverage: Coverage::of_part(part_is),
        ..*pair
    };
    let searched = hypotheses(as_part, Width::NARROW, progress, &|_, f| report(0.5 * f));
    let mut starts = found_or_none(searched)?;
    starts.extend(best.iter().cloned());
    let mut found = placed(pair, (part_is, lengths), &starts, progress)?;
    report(1.0)?;
    let better = if quality::doubtful(&whole) {
        CHOICE.known_part_fits_better
    } else {
        CHOICE.part_fits_better
    };
    if fits_better(&found, &whole, better) && begins_at_boundary(pair, part_is, &found[0]) {
        found.push(best.swap_remove(0));
        best = found;
    }
    Ok(best)
}

/// Hypotheses where it is known whether one shape is a part of the other, and which.
pub(super) fn as_requested(
    pair: &Pair<'_>,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Vec<Hypothesis>> {
    let as_they_lie = as_they_lie(pair, progress)?;
    if as_they_lie.is_empty() && pair.coverage.part().is_some() {
        let located = located(pair, progress)?;
        if !located.is_empty() {
            return Ok(located);
        }
    }
    let mut found = hypotheses(pair, Width::USUAL, progress, report);
    if let Some(part_is) = pair.coverage.part() {
        let searched = found_or_none(found)?;
        let given = part_by_given_lengths(pair).filter(|&(given, _)| given == part_is);
        let more = match given {
            Some(part) => placed(pair, part, &searched, progress),
            None => placed_at_assumed_lengths(pair, part_is, &searched, progress),
        }?;
        found = Ok(ranking::merged(pair.source, searched, more));
    }
    Ok(ranking::merged(pair.source, found?, as_they_lie))
}

/// The map between surfaces that lie on one another as they were given, if they do.
fn as_they_lie(pair: &Pair<'_>, progress: &Progress) -> Result<Vec<Hypothesis>> {
    let unguided = &Pair {
        constraints: &Constraints::default(),
        ..*pair
    };
    let found = embedded_surface::in_place(unguided, &|| progress.check())?;
    found
        .map(|placed| of_placed(pair, Arc::new(placed), progress))
        .into_iter()
        .collect()
}

/// Where an open part that is clearly smaller than the whole lies by its shape, the best place first and beside it the next one;
/// nothing where that is not clear.
fn located(pair: &Pair<'_>, progress: &Progress) -> Result<Vec<Hypothesis>> {
    let asked = |&part_is: &Which| pair.coverage.part().is_none_or(|asked| asked == part_is);
    let Some(part_is) = small_part(pair).filter(|part| pair.uses(Part::Located) && asked(part))
    else {
        return Ok(Vec::new());
    };
    let check = || progress.check();
    let found = location::locations(pair, part_is, &check)?;
    let is_clear = match &found[..] {
        [] => false,
        [best] => best.misfit < CHOICE.fits,
        [best, next, ..] => best.misfit < CHOICE.fits.min(CHOICE.clearly_fits * next.misfit),
    };
    if !is_clear {
        return Ok(Vec::new());
    }
    let mapped = |location: location::Location| {
        let placed = of_placed(pair, Arc::clone(&location.placed), progress)?;
        Ok(Hypothesis {
            metrics: location.metrics(placed.metrics),
            ..placed
        })
    };
    let found: Vec<Hypothesis> = found.into_iter().map(mapped).collect::<Result<_>>()?;
    Ok(ranking::merged(pair.source, found, Vec::new()))
}

/// The map between surfaces of which one lies on the other.
fn of_placed(pair: &Pair<'_>, placed: Arc<Placed>, progress: &Progress) -> Result<Hypothesis> {
    let unguided = &Pair {
        constraints: &Constraints::default(),
        ..*pair
    };
    let (found, map) = embedded_surface::of_places(unguided, &placed, &|| progress.check())?;
    let hinted = &Pair {
        constraints: pair.constraints,
        ..found
    };
    ranking::of_placed(hinted, &map, placed)
}

/// No hypotheses where the search found no map.
fn found_or_none(found: Result<Vec<Hypothesis>>) -> Result<Vec<Hypothesis>> {
    match found {
        Err(Error::NoMap { .. }) => Ok(Vec::new()),
        found => found,
    }
}

/// What the distances of source's and target's vertices from their own mirror images count, when both shapes are
/// symmetric and the best map so far says that they are not poses of one body.
fn mirror_offsets(
    pair: &Pair<'_>,
    best: &Metrics,
    progress: &Progress,
) -> Result<Option<[Vec<f32>; 2]>> {
    if !pair.uses(Part::Symmetry) || !quality::differ(best) {
        return Ok(None);
    }
    let (source, target) = rayon::join(
        || symmetry::mirror_offsets(pair.source, progress),
        || symmetry::mirror_offsets(pair.target, progress),
    );
    let counted = |offsets: Vec<f32>| offsets.into_iter().map(symmetry::counted).collect();
    Ok(source?.zip(target?).map(|(s, t)| [counted(s), counted(t)]))
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
        Width::SINGLE
    };
    let candidates = search::candidates(pair, width, progress)?;
    report("selection", 0.5)?;
    ranking::vote(pair, &candidates, &|f| report("selection", 0.5 + 0.5 * f))
}

/// The best hypothesis completed; the others are kept as alternatives.
pub(super) fn clearest(
    pair: &Pair<'_>,
    mut hypotheses: Vec<Hypothesis>,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Correspondence> {
    let complete = |some: &[Hypothesis]| -> Result<Vec<Completed<'_>>> {
        some.par_iter()
            .map(|h| completed_and_ranked(pair, h, progress, report))
            .collect()
    };
    let found = if hypotheses.first().is_some_and(Hypothesis::is_of_part) {
        let first = best_of_part(&mut hypotheses, &complete)?;
        let relocate = |found| with_relocations(pair, &mut hypotheses, found, &complete, progress);
        first.map(relocate).transpose()?
    } else {
        match &hypotheses[..ranking::rivals(&hypotheses).min(CHOICE.most_completed)] {
            [alone] => Some((0, completed_alone(pair, alone, progress, report)?)),
            close => best_of_close(pair, complete(close)?),
        }
    };
    let (best, mut map) = found.ok_or(Error::NoMap {
        reason: "no candidate stood in the vote".into(),
    })?;
    // Before it is refined on what it covers, as no other is.
    ranking::compare_with_chosen(pair.source, best, &mut hypotheses);
    refine_on_covered(pair, &mut hypotheses[best], &mut map, progress, report)?;
    let chosen = hypotheses.remove(best);
    let mut found = map.finished(pair, &chosen, progress)?;
    if !found.is_copy {
        found.others = hypotheses;
    }
    report("dense map", 1.0)?;
    Ok(found)
}

/// The best of close maps by their completed metrics; those that differ from it in a part only are compared on that
/// part.
fn best_of_close<'a>(
    pair: &Pair<'_>,
    mut completed: Vec<Completed<'a>>,
) -> Option<(usize, Completed<'a>)> {
    let rank = |i: usize| completed[i].metrics.cost();
    let first = (0..completed.len()).min_by(|&i, &j| rank(i).total_cmp(&rank(j)))?;
    let best = (0..completed.len()).fold(first, |best, other| {
        if other != best && fits_better_where_it_differs(pair, &completed[other], &completed[best])
        {
            other
        } else {
            best
        }
    });
    Some((best, completed.swap_remove(best)))
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
        vector::norm(apart) > CHOICE.elsewhere
    };
    let part: Vec<u32> = (0..target.mesh.vertices.len())
        .filter(|&v| differs(v))
        .map(|v| v as u32)
        .collect();
    let share: f64 = part.iter().map(|&v| target.mass[v as usize]).sum();
    if part.is_empty() || share > CHOICE.part_at_most {
        return false;
    }
    let misfit = |c: &Completed<'_>| -> f64 {
        let squares = part
            .iter()
            .map(|&v| target.mass[v as usize] * c.distortion[v as usize].powi(2));
        let distances = if pair.uses(Part::Geodesic) {
            (squares.sum::<f64>() / share).sqrt()
        } else {
            1.0
        };
        distances * regions::misfit(pair.to_source(&c.images), c.state.lengths(), &part)
    };
    misfit(map) < misfit(other)
}

/// Final refinement and dense map of a hypothesis.
///
/// # Errors
/// [`Error::Cancelled`] and those of the stages.
pub fn completed(
    source: &Shape,
    target: &Shape,
    constraints: &Arc<Constraints>,
    hypothesis: &Hypothesis,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Correspondence> {
    let pair = Pair {
        target,
        source,
        coverage: hypothesis.coverage,
        mirror: Mirror::Allow,
        constraints,
        left_out: LeftOut::default(),
        lengths: 1.0,
        mirror_offsets: None,
    };
    let mut hypothesis = hypothesis.clone();
    let mut map = completed_and_ranked(&pair, &hypothesis, progress, report)?;
    refine_on_covered(&pair, &mut hypothesis, &mut map, progress, report)?;
    let mut found = map.finished(&pair, &hypothesis, progress)?;
    found.constraints = Arc::clone(constraints);
    Ok(found)
}
