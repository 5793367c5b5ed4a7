//! First maps of a part into a whole: samples placed one after the other so that their distances stay.
//!
//! A cut changes all eigenfunctions of a surface, and with them the search over their signs. Distances between
//! points of what is left stay, or grow where a shortest path went through what was cut away. The part's first
//! samples, its extremities, are placed on samples of the whole, and the placements that change distances least
//! are kept. How long the part's unit is on the whole has to be known for this, to a tenth or so.
//!
//! # Source
//! Partial placements that grow under a bound on their distortion: Raviv, Dubrovina, Kimmel, "Hierarchical framework
//! for shape correspondence", 2013; distances of a part that may only be too long: Bronstein, Bronstein, Bruckstein,
//! Kimmel, "Partial similarity of objects, or how to compare a centaur to a horse", 2009.

use std::cmp::Ordering;
use std::collections::HashMap;

use faer::{Mat, MatRef, Scale};
use rayon::prelude::*;

use crate::algebra::dense;
use crate::error::{Result, System};
use crate::matching::partial::settings::SEARCH;
use crate::matching::problem::pair::Pair;
use crate::matching::problem::which::Which;
use crate::shape::Shape;
use crate::watch::progress::Check;

/// A part, the whole, and how long the part's unit is on the whole.
pub struct PartInWhole<'a> {
    /// The shape that is a part.
    pub part: &'a Shape,
    /// The other one.
    pub whole: &'a Shape,
    /// Units of length of the whole that one of the part is.
    pub unit: f32,
    part_is: Which,
}

impl<'a> PartInWhole<'a> {
    /// By the shape that is the part, and the pair's lengths.
    #[must_use]
    pub fn of(pair: &Pair<'a>, part_is: Which) -> Self {
        Self {
            part: pair.shape(part_is),
            whole: pair.shape(part_is.other()),
            unit: part_is.seen(pair.lengths) as f32,
            part_is,
        }
    }

    /// A `(kₛ, kₜ)` map, target coefficients → source coefficients, by the images of the part's first `SEARCH.asking`
    /// samples.
    ///
    /// # Errors
    /// [`crate::Error::NotFactorised`].
    pub fn fitted(&self, images: &[u32]) -> Result<Mat<f64>> {
        let Self { part, whole, .. } = self;
        let asking = part.farthest_points(SEARCH.asking);
        let most = whole.basis.values.len();
        let size = SEARCH.map_size.min(part.basis.values.len());
        let whole_size = ((size as f32 / (self.unit * self.unit)).round() as usize).min(most);
        let here = dense::gather_rows(part.basis.functions.as_ref(), asking, size);
        let there = dense::gather_rows(whole.basis.functions.as_ref(), images, whole_size);
        let (from, to) = match self.part_is {
            Which::Target => (there.as_ref(), here.as_ref()),
            Which::Source => (here.as_ref(), there.as_ref()),
        };
        let gram = dense::product(from.transpose(), from);
        let right = dense::product(from.transpose(), to);
        dense::solve_with_ridge(
            System::Map,
            gram,
            |_| SEARCH.fit_ridge * asking.len() as f64,
            right.as_ref(),
        )
    }

    /// Samples of the whole whose distances to the places are those of the part's first `SEARCH.asking` samples to the
    /// placed ones.
    fn images(&self, places: &[u16]) -> Vec<u32> {
        let Self { part, whole, .. } = self;
        let image = |&v: &u32| {
            let misfit = |x: u32| -> f32 {
                let changes = places.iter().enumerate().map(|(j, &place)| {
                    let here = self.unit * part.fields[(v as usize, j)];
                    change(here, whole.fields[(x as usize, usize::from(place))])
                });
                changes.sum()
            };
            let misfits = whole.farthest.iter().map(|&x| (misfit(x), x));
            misfits.fold((f32::INFINITY, 0), |best, found| {
                if found.0 < best.0 { found } else { best }
            })
        };
        let asking = part.farthest_points(SEARCH.asking).iter();
        asking.map(|v| image(v).1).collect()
    }
}

/// `(kₛ, kₜ)` maps, target coefficients → source coefficients, that change distances between samples least.
///
/// # Errors
/// [`crate::Error::Cancelled`], [`crate::Error::NotFactorised`].
pub fn first_maps(pair: &PartInWhole<'_>, check: Check<'_>) -> Result<Vec<Mat<f64>>> {
    let on_part = Scale(pair.unit) * pair.part.between_marched();
    let on_whole = pair.whole.between_marched();
    let placements = placements(on_part.as_ref(), on_whole.as_ref(), check)?;
    placements
        .par_iter()
        .map(|places| {
            check()?;
            pair.fitted(&pair.images(places))
        })
        .collect()
}

/// What it costs that a distance on the part is another one on the whole.
#[inline(always)]
pub fn change(on_part: f32, on_whole: f32) -> f32 {
    let longer = on_part - on_whole;
    let weighted = longer * if longer > 0.0 { SEARCH.longer } else { 1.0 };
    weighted * weighted
}

/// The part's first samples on samples of the whole.
struct Placement {
    cost: f32,
    /// Numbers of the whole's samples.
    places: Vec<u16>,
    /// The cell of each of them.
    cells: Vec<u16>,
}

/// One more sample placed: cost, number of the placement that it continues, place.
type Child = (f32, u32, u16);

/// Places of the part's first samples on the whole's, cheapest first, from distances between the samples of each.
fn placements(
    on_part: MatRef<'_, f32>,
    on_whole: MatRef<'_, f32>,
    check: Check<'_>,
) -> Result<Vec<Vec<u16>>> {
    let sites = on_whole.nrows();
    let cells: Vec<u16> = (0..sites)
        .map(|x| nearest_of_first(on_whole, x, SEARCH.cells))
        .collect();
    let mut kept: Vec<Placement> = (0..sites)
        .map(|x| Placement {
            cost: 0.0,
            places: vec![x as u16],
            cells: vec![cells[x]],
        })
        .collect();
    for i in 1..SEARCH.placed.min(on_part.nrows()) {
        check()?;
        let mut children: Vec<Child> = kept
            .par_iter()
            .enumerate()
            .flat_map_iter(|(parent, placement)| {
                let costs = costs_of_next(placement, on_part, on_whole, i);
                let child = move |(x, cost)| (cost, parent as u32, x as u16);
                costs.into_iter().enumerate().map(child)
            })
            .collect();
        let order = |a: &Child, b: &Child| -> Ordering {
            a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2)))
        };
        let looked_at = (SEARCH.children * SEARCH.kept).min(children.len());
        children.select_nth_unstable_by(looked_at - 1, order);
        children.truncate(looked_at);
        children.sort_unstable_by(order);
        kept = varied(&kept, &children, &cells);
    }
    Ok(finished(kept, on_whole))
}

/// Which of the first `count` samples is nearest to sample `x`.
fn nearest_of_first(distances: MatRef<'_, f32>, x: usize, count: usize) -> u16 {
    let nearest = (0..count.min(distances.nrows()))
        .min_by(|&a, &b| distances[(a, x)].total_cmp(&distances[(b, x)]));
    nearest.map_or(0, |cell| cell as u16)
}

/// What a placement would cost with sample `i` on each of the sites.
fn costs_of_next(
    placement: &Placement,
    on_part: MatRef<'_, f32>,
    on_whole: MatRef<'_, f32>,
    i: usize,
) -> Vec<f32> {
    let mut costs = vec![placement.cost; on_whole.nrows()];
    for (j, &place) in placement.places.iter().enumerate() {
        let here = on_part[(i, j)];
        let there = on_whole.col(usize::from(place));
        for (cost, &there) in costs.iter_mut().zip(there.iter()) {
            *cost += change(here, there);
        }
    }
    costs
}

/// The first children, only so many of those that are alike.
fn varied(parents: &[Placement], children: &[Child], cells: &[u16]) -> Vec<Placement> {
    let mut alike: HashMap<Vec<u16>, usize> = HashMap::new();
    let mut kept = Vec::with_capacity(SEARCH.kept);
    for &(cost, parent, place) in children {
        let parent = &parents[parent as usize];
        let with = |list: &[u16], last: u16| [list, &[last]].concat();
        let child_cells = with(&parent.cells, cells[usize::from(place)]);
        let count = alike.entry(child_cells.clone()).or_default();
        if *count < SEARCH.alike {
            *count += 1;
            kept.push(Placement {
                cost,
                places: with(&parent.places, place),
                cells: child_cells,
            });
        }
        if kept.len() == SEARCH.kept {
            break;
        }
    }
    kept
}

/// The cheapest placements that differ from one another.
fn finished(placements: Vec<Placement>, on_whole: MatRef<'_, f32>) -> Vec<Vec<u16>> {
    let mut chosen: Vec<Vec<u16>> = Vec::new();
    for Placement { places, .. } in placements {
        let differs = |other: &Vec<u16>| {
            let apart = places.iter().zip(other);
            let sum: f32 = apart
                .map(|(&a, &b)| on_whole[(usize::from(a), usize::from(b))])
                .sum();
            sum > SEARCH.apart * places.len() as f32
        };
        if chosen.iter().all(differs) {
            chosen.push(places);
        }
        if chosen.len() == SEARCH.finished {
            break;
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::vector::{self, Point};

    /// Points scattered in a cube, no two distances alike.
    fn scattered(count: usize) -> Vec<Point> {
        let fraction = |i: usize, step: f64| (i as f64 * step).fract();
        (1..=count)
            .map(|i| {
                [
                    fraction(i, 0.7549),
                    fraction(i, 0.5698),
                    fraction(i, 0.8192),
                ]
            })
            .collect()
    }

    fn between(points: &[Point]) -> Mat<f32> {
        Mat::from_fn(points.len(), points.len(), |i, j| {
            vector::distance(points[i], points[j]) as f32
        })
    }

    #[test]
    fn samples_are_placed_where_their_distances_are_known() {
        let whole = scattered(60);
        let places: Vec<u16> = (0..SEARCH.placed as u16).map(|i| 23 * i % 60).collect();
        let part: Vec<Point> = places.iter().map(|&x| whole[usize::from(x)]).collect();
        let mut on_part = between(&part);
        let on_whole = between(&whole);
        let found = placements(on_part.as_ref(), on_whole.as_ref(), &|| Ok(())).expect("goes on");
        assert_eq!(found[0], places);
        // Detours around what was cut away: of 66 distances a tenth is longer by a fifth.
        for (i, j) in (0..SEARCH.placed).flat_map(|i| (0..i).map(move |j| (i, j))) {
            if (i + j) % 10 == 3 {
                on_part[(i, j)] *= 1.2;
                on_part[(j, i)] *= 1.2;
            }
        }
        let found = placements(on_part.as_ref(), on_whole.as_ref(), &|| Ok(())).expect("goes on");
        assert_eq!(found[0], places);
    }

    #[test]
    fn a_distance_that_is_longer_on_the_part_costs_less() {
        assert!(change(0.5, 0.4) < change(0.4, 0.5));
        assert!(change(0.4, 0.4).abs() < f32::EPSILON);
    }
}
