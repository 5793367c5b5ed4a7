//! Fingers that a map laid onto their neighbours.
//!
//! Hands are found by few eigenfunctions and fingers by many, so that a hand may come to lie turned by the width of a
//! finger, each finger on the next one and the last on nothing. No small step leads back. Where
//! [protrusions](crate::shape::protrusions) close to one another are so, all ways of laying them onto those of the other surface
//! are compared by the distances between their tips.

use faer::Mat;

use crate::error::Result;
use crate::geodesics;
use crate::matching::refinement::settings::FINGERS;
use crate::shape::Shape;
use crate::shape::protrusions::Protrusions;
use crate::watch::progress::Check;

/// One side of a map: the shape, and the image of each of its vertices.
#[derive(Clone, Copy)]
pub struct Imaged<'a> {
    /// The shape.
    pub shape: &'a Shape,
    /// On the other one, `(n)`.
    pub images: &'a [u32],
}

impl Imaged<'_> {
    /// On which protrusion of the other shape most of each of its own lies, if on any.
    fn most_on(&self, other: &Protrusions) -> Vec<Option<usize>> {
        let own = self.shape.protrusions().vertices.iter();
        own.map(|vertices| {
            let mut coverage = vec![0.0; other.count()];
            let mut area = 0.0;
            for &v in vertices {
                let mass = self.shape.mass[v as usize];
                area += mass;
                if let Some(there) = other.of_vertex[self.images[v as usize] as usize] {
                    coverage[there] += mass;
                }
            }
            coverage
                .iter()
                .position(|share| *share > FINGERS.most * area)
        })
        .collect()
    }
}

/// Protrusions of a shape and of another, by number, that belong together and are not laid so by a map and its inverse.
/// `lengths` units of the other shape are one of its own.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn misplaced(
    own: Imaged<'_>,
    other: Imaged<'_>,
    lengths: f64,
    check: Check<'_>,
) -> Result<Vec<(usize, usize)>> {
    let (here, there) = rayon::join(|| own.shape.protrusions(), || other.shape.protrusions());
    let (to, back) = (own.most_on(there), other.most_on(here));
    let settled = |to: &[Option<usize>], back: &[Option<usize>]| -> Vec<bool> {
        let returns = |(p, q): (usize, &Option<usize>)| q.is_some_and(|q| back[q] == Some(p));
        to.iter().enumerate().map(returns).collect()
    };
    let (settled_here, settled_there) = (settled(&to, &back), settled(&back, &to));
    let all = |settled: &[bool]| settled.iter().all(|&is| is);
    if all(&settled_here) || all(&settled_there) {
        return Ok(Vec::new());
    }
    let from_tips = |shape: &Shape, tips: &[u32]| {
        let cancelled = || check().is_err();
        geodesics::distances_within(FINGERS.group, &shape.marching, tips, &cancelled)
    };
    let on_own = from_tips(own.shape, &here.tips)?;
    let on_other = from_tips(other.shape, &there.tips)?;
    let mut is_done = vec![false; here.count()];
    let mut found = Vec::new();
    for p in (0..here.count()).filter(|&p| !settled_here[p]) {
        if is_done[p] {
            continue;
        }
        let near = |&o: &usize| on_own[(here.tips[o] as usize, p)] < FINGERS.group;
        let group: Vec<usize> = (0..here.count())
            .filter(|&o| !is_done[o])
            .filter(near)
            .collect();
        let lies_at = |o: usize| own.images[here.tips[o] as usize];
        let is_there = |&q: &usize| {
            let on_it = |&o: &usize| {
                to[o] == Some(q)
                    || back[q] == Some(o)
                    || on_other[(lies_at(o) as usize, q)] < FINGERS.there
            };
            group.iter().any(on_it)
        };
        let places: Vec<usize> = (0..there.count()).filter(is_there).collect();
        let all_taken = places.iter().all(|&q| settled_there[q]);
        if all_taken
            || !FINGERS.sizes.contains(&group.len())
            || !FINGERS.sizes.contains(&places.len())
        {
            continue;
        }
        for &o in &group {
            is_done[o] = true;
        }
        let between = |distances: &Mat<f32>, at: u32, tip: usize| {
            f64::from(distances[(at as usize, tip)].min(FINGERS.group))
        };
        let tips = Tips {
            here: Mat::from_fn(group.len(), group.len(), |i, j| {
                lengths * between(&on_own, here.tips[group[i]], group[j])
            }),
            there: Mat::from_fn(places.len(), places.len(), |i, j| {
                between(&on_other, there.tips[places[i]], places[j])
            }),
            away: Mat::from_fn(group.len(), places.len(), |i, j| {
                between(&on_other, lies_at(group[i]), places[j])
            }),
        };
        let now = Tips::first_come(
            &group
                .iter()
                .map(|&o| {
                    let on = to[o]?;
                    places.iter().position(|&q| q == on)
                })
                .collect::<Vec<_>>(),
        );
        let best = tips.best(&now);
        for (i, place) in best
            .into_iter()
            .enumerate()
            .filter(|(i, place)| *place != now[*i])
        {
            found.extend(place.map(|place| (group[i], places[place])));
        }
    }
    Ok(found)
}

/// Distances between the tips of a group and of the places for them.
struct Tips {
    /// Between those of the group, in the other shape's units.
    here: Mat<f64>,
    /// Between the places.
    there: Mat<f64>,
    /// From where each lies now to each place.
    away: Mat<f64>,
}

impl Tips {
    /// One only on each place.
    fn first_come(wanted: &[Option<usize>]) -> Vec<Option<usize>> {
        let mut given = Vec::with_capacity(wanted.len());
        for place in wanted {
            let is_free = !given.contains(place);
            given.push(place.filter(|_| is_free));
        }
        given
    }

    /// The cheapest way to lay them, the present one if no other is cheaper.
    fn best(&self, now: &[Option<usize>]) -> Vec<Option<usize>> {
        let mut best = (self.cost(now), now.to_vec());
        self.try_all(&mut Vec::with_capacity(now.len()), &mut best);
        best.1
    }

    fn try_all(&self, laid: &mut Vec<Option<usize>>, best: &mut (f64, Vec<Option<usize>>)) {
        if laid.len() == self.here.nrows() {
            let cost = self.cost(laid);
            if cost < best.0 {
                *best = (cost, laid.clone());
            }
            return;
        }
        for place in (0..self.there.nrows()).map(Some).chain([None]) {
            if place.is_none() || !laid.contains(&place) {
                laid.push(place);
                self.try_all(laid, best);
                laid.pop();
            }
        }
    }

    /// Mean change of the distances between tips once the group is scaled to what it lies on, and what `FINGERS.moved` and
    /// `FINGERS.nowhere` add.
    fn cost(&self, laid: &[Option<usize>]) -> f64 {
        let placed: Vec<(usize, usize)> = laid
            .iter()
            .enumerate()
            .filter_map(|(i, place)| Some((i, (*place)?)))
            .collect();
        let pairs = || {
            placed.iter().enumerate().flat_map(|(n, &(i, p))| {
                let others = placed[n + 1..].iter();
                others.map(move |&(j, q)| (self.here[(i, j)], self.there[(p, q)]))
            })
        };
        let count = pairs().count().max(1) as f64;
        let (here, there) = pairs().fold((0.0, 0.0), |sums, d| (sums.0 + d.0, sums.1 + d.1));
        let scale = if there > 0.0 {
            (here / there).clamp(FINGERS.scales.0, FINGERS.scales.1)
        } else {
            1.0
        };
        let change: f64 = pairs()
            .map(|(here, there)| (here - scale * there).abs())
            .sum();
        let away: f64 = placed.iter().map(|&(i, p)| self.away[(i, p)]).sum();
        let places = self.here.nrows().min(self.there.nrows());
        let left = places.saturating_sub(placed.len());
        change / count
            + FINGERS.moved * away / placed.len().max(1) as f64
            + FINGERS.nowhere * left as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    fn found(shape: &Shape, images: &[u32], inverse: &[u32]) -> Vec<(usize, usize)> {
        let own = Imaged { shape, images };
        let other = Imaged {
            shape,
            images: inverse,
        };
        misplaced(own, other, 1.0, &|| Ok(())).expect("goes on")
    }

    #[test]
    fn a_spike_that_lies_beside_its_free_place_is_laid_there() {
        let shape = testing::spiked_torus();
        let spikes = shape.protrusions();
        let same: Vec<u32> = (0..shape.mesh.vertices.len() as u32).collect();
        assert!(found(&shape, &same, &same).is_empty());
        for spike in 0..spikes.count() {
            let lowest = spikes.vertices[spike]
                .iter()
                .flat_map(|&v| shape.neighbours.row(v as usize));
            let beside = lowest
                .copied()
                .find(|&v| spikes.of_vertex[v as usize].is_none());
            let (mut images, mut inverse) = (same.clone(), same.clone());
            for &v in &spikes.vertices[spike] {
                images[v as usize] = beside.expect("its foot");
                inverse[v as usize] = beside.expect("its foot");
            }
            assert_eq!(found(&shape, &images, &inverse), [(spike, spike)]);
        }
    }

    /// Fingers in a row, two, a gap and two, laid onto a row `larger` times as large, each on the next one or its own.
    fn in_a_row(larger: f64, on_next: bool) -> (Tips, Vec<Option<usize>>) {
        const AT: [f64; 5] = [0.0, 0.05, 0.2, 0.25, 0.3];
        let between = |a: usize, b: usize| (AT[a] - AT[b]).abs();
        let tips = Tips {
            here: Mat::from_fn(4, 4, between),
            there: Mat::from_fn(4, 4, |i, j| larger * between(i, j)),
            away: Mat::from_fn(4, 4, |i, j| larger * between(i + usize::from(on_next), j)),
        };
        let place = |i: usize| Some(i + usize::from(on_next)).filter(|&place| place < 4);
        (tips, (0..4).map(place).collect())
    }

    #[test]
    fn fingers_on_the_next_ones_are_laid_onto_their_own() {
        let own: Vec<Option<usize>> = (0..4).map(Some).collect();
        for larger in [0.8, 1.0, 1.3] {
            for on_next in [true, false] {
                let (tips, now) = in_a_row(larger, on_next);
                assert_eq!(tips.best(&now), own, "{larger} {on_next}");
            }
        }
        // Two on one place: the first has it.
        let given = Tips::first_come(&[Some(1), None, Some(1), Some(0)]);
        assert_eq!(given, [Some(1), None, None, Some(0)]);
    }
}
