//! Nearest neighbours that spread over the surface: neighbours on one shape have neighbouring
//! images on the other.
//!
//! Linear in the number of vertices where an exhaustive search is quadratic. The sweeps run in a
//! fixed order on one thread, so that the result does not depend on the number of threads.

use crate::algebra::dense::{COMPARED, Rows, squared_distance, vectorised};
use crate::error::Result;
use crate::mesh::Adjacency;
use crate::watch::progress::Check;

/// Images compared at once.
const AT_ONCE: usize = 16;

/// Image of every asking vertex with its squared distance.
#[derive(Debug, Clone)]
pub struct Images {
    /// Answering vertex, or `u32::MAX` before one is known.
    pub vertex: Vec<u32>,
    /// Squared distance in the embedding.
    pub cost: Vec<f32>,
}

impl Images {
    /// No image is known yet.
    #[must_use]
    pub fn unknown(count: usize) -> Self {
        Self {
            vertex: vec![u32::MAX; count],
            cost: vec![f32::INFINITY; count],
        }
    }

    /// Those of some asking vertices alone.
    #[must_use]
    pub fn of(&self, asking: &[u32]) -> Self {
        Self {
            vertex: asking.iter().map(|&v| self.vertex[v as usize]).collect(),
            cost: asking.iter().map(|&v| self.cost[v as usize]).collect(),
        }
    }

    /// Sweeps until nothing changes, at most `sweeps` times.
    ///
    /// `ids` are the asking vertices; `asking` holds the rows of all their shape's vertices and
    /// which of the asking ones are neighbours, `answering` the other shape's rows and edges. `check`
    /// is asked before every sweep.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn settle(
        &mut self,
        ids: &[u32],
        asking: (&Rows, &Adjacency),
        answering: (&Rows, &Adjacency),
        sweeps: usize,
        check: Check<'_>,
    ) -> Result<()> {
        vectorised(
            #[inline(always)]
            || self.settle_in_lanes(ids, asking, answering, sweeps, check),
        )
    }

    #[inline(always)]
    fn settle_in_lanes(
        &mut self,
        ids: &[u32],
        asking: (&Rows, &Adjacency),
        answering: (&Rows, &Adjacency),
        sweeps: usize,
        check: Check<'_>,
    ) -> Result<()> {
        // Visits are numbered. A vertex has nothing new to try unless a neighbour's image changed since
        // its last visit, and then that image alone: all others around were tried then.
        let (mut changed_at, mut seen_at) = (vec![0u32; ids.len()], vec![0u32; ids.len()]);
        let mut trials = Trials {
            rows: answering.0,
            visit: 0,
            tried_at: vec![0; answering.0.count()],
        };
        // Where the known images are few, spreading them takes precedence over the limit.
        let mut sweep = 0;
        while sweep < sweeps || self.vertex.contains(&u32::MAX) {
            check()?;
            let mut changed = false;
            for step in 0..ids.len() {
                let i = if sweep % 2 == 0 {
                    step
                } else {
                    ids.len() - 1 - step
                };
                let (neighbours, last) = (asking.1.row(i), seen_at[i]);
                let has_news = |&j: &u32| last == 0 || changed_at[j as usize] > last;
                if last > 0 && !neighbours.iter().any(has_news) {
                    continue;
                }
                trials.visit += 1;
                seen_at[i] = trials.visit;
                let here = asking.0.row(ids[i] as usize);
                let neighbours = neighbours.iter().copied().filter(has_news);
                if self.improve(i, last == 0, here, neighbours, answering.1, &mut trials) {
                    changed_at[i] = trials.visit;
                    changed = true;
                }
            }
            if !changed {
                break;
            }
            sweep += 1;
        }
        Ok(())
    }

    /// Tries the images of `neighbours`, then walks downhill on the answering shape, from the present image only
    /// `at_first`: later what lies around it has been tried. Whether another image is nearer.
    #[inline(always)]
    fn improve(
        &mut self,
        i: usize,
        at_first: bool,
        here: &[f32],
        neighbours: impl Iterator<Item = u32>,
        answering: &Adjacency,
        trials: &mut Trials<'_>,
    ) -> bool {
        let start = self.vertex[i];
        let is_known = |&image: &u32| image != u32::MAX;
        let mut best = (start, self.cost[i]);
        if at_first {
            best.1 = if is_known(&start) {
                trials.cost(here, start)
            } else {
                f32::INFINITY
            };
        }
        if is_known(&start) {
            trials.tried_at[start as usize] = trials.visit;
        }
        let around = neighbours.map(|j| self.vertex[j as usize]);
        trials.try_images(here, around.filter(is_known), &mut best);
        let mut rests = !is_known(&best.0) || (best.0 == start && !at_first);
        while !rests {
            let from = best.0;
            let around = answering.row(from as usize).iter().copied();
            trials.try_images(here, around, &mut best);
            rests = best.0 == from;
        }
        (self.vertex[i], self.cost[i]) = best;
        best.0 != start
    }
}

/// Which images have been tried in a visit: none is twice.
struct Trials<'a> {
    /// Rows of the answering shape.
    rows: &'a Rows,
    visit: u32,
    /// Last visit in which each was tried.
    tried_at: Vec<u32>,
}

impl Trials<'_> {
    /// Squared distance of a row from an image.
    #[inline(always)]
    fn cost(&self, here: &[f32], image: u32) -> f32 {
        let ((head, rest), (its_head, its_rest)) = (split(here), split(self.row(image)));
        squared_distance(head, its_head) + squared_distance(rest, its_rest)
    }

    #[inline(always)]
    fn row(&self, image: u32) -> &[f32] {
        self.rows.row(image as usize)
    }

    /// The nearest to a row of `best` and those of some images that are new, with its squared distance.
    ///
    /// Processors do not foresee which are new and which are nearer: no branch asks the former, and the first coordinates,
    /// with which nine comparisons in ten end, of all are compared before one asks the latter.
    #[inline(always)]
    fn try_images(
        &mut self,
        here: &[f32],
        mut images: impl Iterator<Item = u32>,
        best: &mut (u32, f32),
    ) {
        let (head, rest) = split(here);
        let mut new = [(0, 0.0); AT_ONCE];
        loop {
            let mut count = 0;
            let is_more = loop {
                let Some(image) = images.next() else {
                    break false;
                };
                new[count].0 = image;
                let tried_at = &mut self.tried_at[image as usize];
                count += usize::from(std::mem::replace(tried_at, self.visit) < self.visit);
                if count == AT_ONCE {
                    break true;
                }
            };
            for (image, cost) in &mut new[..count] {
                *cost = squared_distance(head, split(self.row(*image)).0);
            }
            for &(image, cost) in &new[..count] {
                if cost < best.1 {
                    let cost = cost + squared_distance(rest, split(self.row(image)).1);
                    if cost < best.1 {
                        *best = (image, cost);
                    }
                }
            }
            if !is_more {
                break;
            }
        }
    }
}

/// The coordinates of a row that are compared first, zeros where there are fewer, and the rest.
#[inline(always)]
fn split(row: &[f32]) -> (&[f32; COMPARED], &[f32]) {
    row.split_first_chunk().unwrap_or((&[0.0; COMPARED], row))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_of_many_around_an_image_is_found_in_rows_of_any_length() {
        // A hub with more vertices around it than are compared at once.
        let around = 5 * AT_ONCE as u32 / 2;
        let spokes = (1..=around).flat_map(|v| [(0, v), (v, 0)]);
        let edges = Adjacency::from_lists(around as usize + 1, spokes);
        let alone = Adjacency::empty(1);
        for dims in [3, COMPARED, 2 * COMPARED + 5] {
            let rows = |count: u32, phase: f32| {
                let mut rows = Rows::zeros(count as usize, dims);
                for (i, x) in rows.data.iter_mut().enumerate() {
                    *x = (phase * (i * i) as f32).sin();
                }
                rows
            };
            let answering = rows(around + 1, 0.7);
            for question in 0..20u8 {
                let asking = rows(1, 0.3 + f32::from(question));
                let distance = |v: &u32| {
                    let row = answering.row(*v as usize).iter();
                    let squares = row.zip(asking.row(0)).map(|(x, y)| (x - y) * (x - y));
                    squares.sum::<f32>()
                };
                let mut images = Images::unknown(1);
                images.vertex[0] = 0;
                images
                    .settle(&[0], (&asking, &alone), (&answering, &edges), 1, &|| Ok(()))
                    .expect("not cancelled");
                let nearest = (0..=around).min_by(|a, b| distance(a).total_cmp(&distance(b)));
                assert_eq!(Some(images.vertex[0]), nearest, "{dims} {question}");
                // Rounding of a sum in another order.
                assert!((images.cost[0] - distance(&images.vertex[0])).abs() < 1e-5 * dims as f32);
            }
        }
    }

    #[test]
    fn images_spread_from_one_vertex_to_all() {
        // On a ring every vertex is nearest to itself, and its neighbours' images lead there.
        let count = 50u32;
        let edges = (0..count).flat_map(|v| [(v, (v + 1) % count), (v, (v + count - 1) % count)]);
        let ring = Adjacency::from_lists(count as usize, edges);
        let mut rows = Rows::zeros(count as usize, 2);
        for (v, row) in (0u8..).zip(rows.data.chunks_exact_mut(2)) {
            let angle = f32::from(v) / count as f32 * std::f32::consts::TAU;
            row.copy_from_slice(&[angle.cos(), angle.sin()]);
        }
        let ids: Vec<u32> = (0..count).collect();
        let mut images = Images::unknown(count as usize);
        images.vertex[17] = 3;
        images
            .settle(&ids, (&rows, &ring), (&rows, &ring), 1, &|| Ok(()))
            .expect("not cancelled");
        assert_eq!(images.vertex, ids);
        assert!(images.cost.iter().all(|&cost| cost == 0.0));
    }
}
