//! Nearest neighbours in a feature space: all compared by matrix products, or cell by cell.

use faer::{Accum, Mat, MatRef};
use rayon::prelude::*;

use crate::algebra::dense::{
    COMPARED, Rows, multiply, squared_distance, squared_distance_within, vectorised,
};
use crate::error::Result;
use crate::mesh::{self, Adjacency};
use crate::watch::progress::Check;

/// Queries treated in one matrix product: the scores then stay in the second-level cache.
const QUERIES_A_BLOCK: usize = 64;

/// Sums that run independently, so that the compiler can use vector registers.
const LANES: usize = 16;

/// Share of the vertices above which comparing them one by one takes longer than by products with all.
const FEW: f32 = 0.15;

/// What rounding leaves of a squared distance made of products, relative to the squared norms: of some hundred
/// products in single precision.
const ROUNDING: f32 = 1e-5;

/// For each query the id of the nearest of `points`, Euclidean; the lowest id wins a tie.
#[must_use]
pub fn nearest(queries: &Rows, points: &Rows) -> Vec<u32> {
    debug_assert_eq!(queries.dims, points.dims);
    if queries.data.is_empty() {
        return Vec::new();
    }
    let half_norms = half_norms(points);
    let blocks: Vec<Vec<u32>> = queries
        .data
        .par_chunks(QUERIES_A_BLOCK * queries.dims)
        .map(|block| {
            let scores = scores(points, block);
            (0..scores.ncols())
                .map(|q| lowest(scores.col_as_slice(q), &half_norms))
                .collect()
        })
        .collect();
    blocks.concat()
}

/// −p·q of all points and a block of queries, `(points, queries)`.
fn scores(points: &Rows, block: &[f32]) -> Mat<f32> {
    let queries = MatRef::from_column_major_slice(block, points.dims, block.len() / points.dims);
    let mut scores = Mat::zeros(points.count(), queries.ncols());
    multiply(
        scores.as_mut(),
        Accum::Replace,
        points.as_columns().transpose(),
        queries,
        -1.0,
    );
    scores
}

fn half_norms(points: &Rows) -> Vec<f32> {
    vectorised(
        #[inline(always)]
        || {
            let rows = points.data.chunks_exact(points.dims);
            rows.map(|row| squares(row) / 2.0).collect()
        },
    )
}

/// Sum of squares.
#[inline(always)]
fn squares(row: &[f32]) -> f32 {
    let mut lanes = [0.0; LANES];
    let (whole, rest) = row.as_chunks::<LANES>();
    for xs in whole {
        for (lane, x) in lanes.iter_mut().zip(xs) {
            *lane += x * x;
        }
    }
    for (lane, x) in lanes.iter_mut().zip(rest) {
        *lane += x * x;
    }
    lanes.iter().sum()
}

/// The vertices of a surface in cells, each of those nearest to one centre along the surface. In an embedding they
/// lie together, so that for most queries most cells are too far away to be looked into.
#[derive(Debug)]
pub struct Cells {
    centres: Vec<u32>,
    /// Vertices of each cell.
    members: Adjacency,
}

/// Cells in an embedding of the surface.
struct EmbeddedCells<'a> {
    members: &'a Adjacency,
    /// Row of each member, cell by cell.
    rows: Rows,
    centres: Rows,
    half_norms: Vec<f32>,
    /// Distance of each centre from the farthest of its cell.
    radii: Vec<f32>,
    /// Members of each.
    sizes: Vec<u32>,
    /// How many members are compared one by one at most.
    few: u32,
}

impl Cells {
    /// Around these vertices.
    #[must_use]
    pub fn new(neighbours: &Adjacency, centres: &[u32]) -> Self {
        let cell = mesh::cells(neighbours, centres).into_iter();
        let vertices = cell.zip(0u32..);
        Self {
            members: Adjacency::from_lists(centres.len(), vertices),
            centres: centres.to_vec(),
        }
    }

    /// For each query the nearest of all vertices in their embedding, Euclidean; the lowest id wins a tie.
    /// `check` is asked before every block of queries.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn nearest(&self, queries: &Rows, vertices: &Rows, check: Check<'_>) -> Result<Vec<u32>> {
        debug_assert_eq!(queries.dims, vertices.dims);
        check()?;
        let embedded = EmbeddedCells::new(self, vertices);
        let wide = queries.widened(embedded.rows.dims);
        let blocks: Vec<Vec<Option<u32>>> = wide
            .data
            .par_chunks(QUERIES_A_BLOCK * wide.dims)
            .map(|block| {
                check()?;
                let scores = scores(&embedded.centres, block);
                let mut nearer = vec![0.0; self.centres.len()];
                let rows = block.chunks_exact(wide.dims).enumerate();
                let nearest = |(q, row)| {
                    let scores = scores.col_as_slice(q);
                    vectorised(
                        #[inline(always)]
                        || embedded.nearest(row, scores, &mut nearer),
                    )
                };
                Ok(rows.map(nearest).collect())
            })
            .collect::<Result<_>>()?;
        let found = blocks.concat();
        let left = (0u32..).zip(&found).filter(|(_, found)| found.is_none());
        let left: Vec<u32> = left.map(|(q, _)| q).collect();
        let mut others = nearest(&queries.gather(&left), vertices).into_iter();
        let all = found
            .into_iter()
            .map(|found| found.or_else(|| others.next()));
        Ok(all.flatten().collect())
    }
}

impl<'a> EmbeddedCells<'a> {
    fn new(cells: &'a Cells, vertices: &Rows) -> Self {
        let dims = vertices.dims.next_multiple_of(COMPARED);
        let members = &cells.members;
        let rows = vertices.gather_widened(&members.entries, dims);
        let centres = vertices.gather_widened(&cells.centres, dims);
        let radius = |cell: usize| {
            let [from, to] = [0, 1].map(|i| members.starts[cell + i] as usize);
            let away = |i| squared_distance(rows.row(i), centres.row(cell));
            (from..to).map(away).fold(0.0, f32::max).sqrt()
        };
        Self {
            radii: (0..centres.count())
                .map(|cell| {
                    vectorised(
                        #[inline(always)]
                        || radius(cell),
                    )
                })
                .collect(),
            half_norms: half_norms(&centres),
            sizes: members.starts.windows(2).map(|w| w[1] - w[0]).collect(),
            few: (FEW * rows.count() as f32) as u32,
            members,
            rows,
            centres,
        }
    }

    /// The vertex nearest to a query, given its products with all centres, where few cells may hold it. `nearer` is
    /// room for a figure of each cell.
    #[inline(always)]
    fn nearest(&self, query: &[f32], scores: &[f32], nearer: &mut [f32]) -> Option<u32> {
        let norm = squares(query);
        // None of a cell is nearer than its centre less its radius.
        let cells = scores.iter().zip(&self.half_norms).zip(&self.radii);
        for (nearer, ((score, half_norm), radius)) in nearer.iter_mut().zip(cells) {
            let square = (norm + 2.0 * half_norm) * (1.0 - ROUNDING) + 2.0 * score;
            *nearer = square.max(0.0).sqrt() - radius;
        }
        let first = lowest_in_lanes(scores, &self.half_norms) as usize;
        let mut best = (f32::INFINITY, 0);
        self.look_into(first, query, &mut best);
        let mut reach = best.0.sqrt();
        let sizes = nearer.iter().zip(&self.sizes);
        let within = sizes.map(|(&d, size)| if d <= reach { *size } else { 0 });
        if within.sum::<u32>() > self.few {
            return None;
        }
        for (block, nearer) in nearer.chunks(LANES).enumerate() {
            if nearer.iter().filter(|&&d| d <= reach).count() == 0 {
                continue;
            }
            for (cell, &nearer) in (block * LANES..).zip(nearer) {
                if nearer <= reach && cell != first {
                    self.look_into(cell, query, &mut best);
                    reach = best.0.sqrt();
                }
            }
        }
        Some(best.1)
    }

    /// The nearest so far, as squared distance and vertex, and those of a cell.
    #[inline(always)]
    fn look_into(&self, cell: usize, query: &[f32], best: &mut (f32, u32)) {
        let from = self.members.starts[cell] as usize;
        for (i, &vertex) in (from..).zip(self.members.row(cell)) {
            let square = squared_distance_within(self.rows.row(i), query, best.0);
            if square < best.0 || (square == best.0 && vertex < best.1) {
                *best = (square, vertex);
            }
        }
    }
}

/// Index of the smallest `scores[j] + offsets[j]`, the first of equal ones; both equally long.
fn lowest(scores: &[f32], offsets: &[f32]) -> u32 {
    vectorised(
        #[inline(always)]
        || lowest_in_lanes(scores, offsets),
    )
}

#[inline(always)]
fn lowest_in_lanes(scores: &[f32], offsets: &[f32]) -> u32 {
    /// Sums compared before the lowest of them is compared with that of others.
    const BLOCK: usize = 8 * LANES;
    let (mut lowest, mut start) = (f32::INFINITY, 0);
    let blocks = scores.chunks(BLOCK).zip(offsets.chunks(BLOCK));
    for (number, (scores, offsets)) in blocks.enumerate() {
        let here = lowest_sum(scores, offsets);
        if here < lowest {
            (lowest, start) = (here, number * BLOCK);
        }
    }
    let (scores, offsets) = (&scores[start..], &offsets[start..]);
    let is_lowest = |(score, offset): (&f32, &f32)| score + offset == lowest;
    let among = |(scores, offsets): (&[f32], &[f32])| {
        let sums = scores.iter().zip(offsets);
        sums.fold(false, |found, sum| found | is_lowest(sum))
    };
    let mut lanes = scores.chunks_exact(LANES).zip(offsets.chunks_exact(LANES));
    let before = LANES * lanes.position(among).unwrap_or(scores.len() / LANES);
    let mut sums = scores[before..].iter().zip(&offsets[before..]);
    (start + before + sums.position(is_lowest).unwrap_or(0)) as u32
}

#[inline(always)]
fn lowest_sum(scores: &[f32], offsets: &[f32]) -> f32 {
    let lower = |a: f32, b: f32| if a < b { a } else { b };
    let (score_lanes, offset_lanes) = (scores.chunks_exact(LANES), offsets.chunks_exact(LANES));
    let rest = score_lanes.remainder().iter().zip(offset_lanes.remainder());
    let rest = rest.fold(f32::INFINITY, |found, (score, offset)| {
        lower(score + offset, found)
    });
    let mut lanes = [f32::INFINITY; LANES];
    for (score, offset) in score_lanes.zip(offset_lanes) {
        for lane in 0..LANES {
            lanes[lane] = lower(score[lane] + offset[lane], lanes[lane]);
        }
    }
    let mut width = LANES;
    while width > 1 {
        width /= 2;
        for lane in 0..width {
            lanes[lane] = lower(lanes[lane], lanes[lane + width]);
        }
    }
    lower(rest, lanes[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::draws;

    /// Whole numbers from 0 to 7 that look random, so that sums are exact and many are equal.
    fn scattered(count: usize, dims: usize, seed: u64) -> Rows {
        let numbers = (0..(count * dims) as u64)
            .map(|i| ((i + seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 61) as f32);
        Rows {
            dims,
            data: numbers.collect(),
        }
    }

    #[test]
    fn the_nearest_vertex_is_the_same_cell_by_cell() {
        // A grid of vertices.
        let side = 20;
        let count = side * side;
        let links = (0..count).flat_map(|v: u32| {
            let [row, column] = [v / side, v % side];
            let around = [(row, column + 1), (row + 1, column)].into_iter();
            let on_grid = around.filter(|&(row, column)| row < side && column < side);
            on_grid.flat_map(move |(row, column)| {
                let u = row * side + column;
                [(u, v), (v, u)]
            })
        });
        let links: Vec<(u32, u32)> = links.collect();
        let neighbours = Adjacency::from_lists(count as usize, links.into_iter());
        let cells = Cells::new(&neighbours, &[0, 37, 38, 210, 399]);
        for dims in [1, 2, 16, 19] {
            let queries = scattered(150, dims, 5);
            // As they lie on the grid, where most cells are too far, and anywhere, where none is.
            let mut placed = scattered(count as usize, dims, 1);
            for v in 0..count {
                placed.row_mut(v as usize)[0] = (v / side) as f32;
                placed.row_mut(v as usize)[dims - 1] = (v % side) as f32;
            }
            for vertices in [placed, scattered(count as usize, dims, 2)] {
                let found = cells.nearest(&queries, &vertices, &|| Ok(()));
                let away = |q: usize, v: usize| squared_distance(queries.row(q), vertices.row(v));
                let all = 0..count as usize;
                let nearest = |q| {
                    all.clone()
                        .min_by(|&u, &v| away(q, u).total_cmp(&away(q, v)))
                };
                let exhaustive: Vec<u32> = (0..150)
                    .map(|q| nearest(q).expect("there are vertices") as u32)
                    .collect();
                assert_eq!(found.expect("not cancelled"), exhaustive);
                assert_eq!(super::nearest(&queries, &vertices), exhaustive);
            }
        }
    }

    #[test]
    fn the_first_of_the_lowest_sums_is_found() {
        // Few different numbers, so that most lengths have several lowest sums, in any block and beyond the last.
        let mut drawn = draws(1);
        let mut draw = || drawn() as f32 % 40.0;
        for count in 0..400 {
            let scores: Vec<f32> = (0..count).map(|_| draw()).collect();
            let offsets: Vec<f32> = (0..count).map(|_| draw()).collect();
            let sum = |i: usize| scores[i] + offsets[i];
            let first = (0..count).min_by(|&i, &j| sum(i).total_cmp(&sum(j)));
            assert_eq!(lowest(&scores, &offsets), first.unwrap_or(0) as u32);
        }
    }
}
