//! Nearest neighbours that spread over the surface: neighbours on one shape have neighbouring
//! images on the other.
//!
//! Linear in the number of vertices where an exhaustive search is quadratic. The sweeps run in a
//! fixed order on one thread, so that the result does not depend on the number of threads.

use crate::dense::{Rows, squared_distance, squared_distance_within, vectorised};
use crate::error::Result;
use crate::mesh::Adjacency;
use crate::progress::Check;

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
        // its last visit, and then that image alone: all others around were tried then. No image is tried
        // twice in a visit.
        let (mut visit, mut changed_at, mut seen_at) =
            (0u32, vec![0u32; ids.len()], vec![0u32; ids.len()]);
        let mut tried_at = vec![0u32; answering.0.count()];
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
                let here = asking.0.row(ids[i] as usize);
                if last == 0 {
                    self.cost[i] = self.present_cost(i, here, answering.0);
                }
                visit += 1;
                seen_at[i] = visit;
                let is_new = |image: u32| {
                    let at = &mut tried_at[image as usize];
                    std::mem::replace(at, visit) < visit
                };
                let neighbours = neighbours.iter().copied().filter(has_news);
                if self.improve(i, last == 0, here, neighbours, answering, is_new) {
                    changed_at[i] = visit;
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

    /// Squared distance of a vertex's image in the present embeddings.
    #[inline(always)]
    fn present_cost(&self, i: usize, here: &[f32], answering: &Rows) -> f32 {
        match self.vertex[i] {
            u32::MAX => f32::INFINITY,
            image => squared_distance(here, answering.row(image as usize)),
        }
    }

    /// Tries the images of `neighbours`, then walks downhill on the answering shape, from the present image only
    /// `at_first`: later what lies around it has been tried. Only images that are new.
    #[inline(always)]
    fn improve(
        &mut self,
        i: usize,
        at_first: bool,
        here: &[f32],
        neighbours: impl Iterator<Item = u32>,
        answering: (&Rows, &Adjacency),
        mut is_new: impl FnMut(u32) -> bool,
    ) -> bool {
        let (start, mut best) = (self.vertex[i], (self.vertex[i], self.cost[i]));
        if start != u32::MAX {
            is_new(start);
        }
        for j in neighbours {
            let image = self.vertex[j as usize];
            if image != u32::MAX && is_new(image) {
                let cost = squared_distance_within(here, answering.0.row(image as usize), best.1);
                if cost < best.1 {
                    best = (image, cost);
                }
            }
        }
        if best.0 == u32::MAX {
            return false;
        }
        let mut rests = best.0 == start && !at_first;
        while !rests {
            let from = best.0;
            for &q in answering.1.row(from as usize) {
                if !is_new(q) {
                    continue;
                }
                let cost = squared_distance_within(here, answering.0.row(q as usize), best.1);
                if cost < best.1 {
                    best = (q, cost);
                }
            }
            rests = best.0 == from;
        }
        (self.vertex[i], self.cost[i]) = best;
        best.0 != start
    }
}
