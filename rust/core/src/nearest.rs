//! Exhaustive nearest neighbours in a feature space, by matrix products.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use rayon::prelude::*;

use crate::dense::{Rows, vectorised};
use crate::error::Result;
use crate::progress::Check;

/// Queries treated in one matrix product: the scores then stay in the second-level cache.
const QUERIES_A_BLOCK: usize = 64;

/// For each query the id of the nearest of `points`, Euclidean; the lowest id wins a tie.
#[must_use]
pub fn nearest(queries: &Rows, points: &Rows) -> Vec<u32> {
    match nearest_unless(queries, points, &|| Ok(())) {
        Ok(found) => found,
        Err(_) => unreachable!("nothing cancels it"),
    }
}

/// [`nearest`] that asks `check` before every block of queries.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn nearest_unless(queries: &Rows, points: &Rows, check: Check<'_>) -> Result<Vec<u32>> {
    debug_assert_eq!(queries.dims, points.dims);
    let half_norms: Vec<f32> = (0..points.count())
        .map(|j| points.row(j).iter().map(|x| x * x).sum::<f32>() / 2.0)
        .collect();
    let blocks: Vec<Vec<u32>> = queries
        .data
        .par_chunks(QUERIES_A_BLOCK * queries.dims)
        .map(|block| {
            check()?;
            let columns = faer::MatRef::from_column_major_slice(
                block,
                queries.dims,
                block.len() / queries.dims,
            );
            let mut scores = Mat::<f32>::zeros(points.count(), columns.ncols());
            matmul(
                scores.as_mut(),
                Accum::Replace,
                points.as_columns().transpose(),
                columns,
                -1.0,
                Par::Seq,
            );
            Ok((0..columns.ncols())
                .map(|q| lowest(scores.col_as_slice(q), &half_norms))
                .collect())
        })
        .collect::<Result<_>>()?;
    Ok(blocks.concat())
}

/// Index of the smallest `scores[j] + offsets[j]`, the first of equal ones; both equally long.
#[must_use]
pub fn lowest(scores: &[f32], offsets: &[f32]) -> u32 {
    vectorised(|| lowest_in_lanes(scores, offsets))
}

#[inline(always)]
fn lowest_in_lanes(scores: &[f32], offsets: &[f32]) -> u32 {
    // Lanes run independently so that the compiler can use vector registers.
    const LANES: usize = 16;
    let mut best = [f32::INFINITY; LANES];
    let mut at = [0u32; LANES];
    let (score_lanes, offset_lanes) = (scores.chunks_exact(LANES), offsets.chunks_exact(LANES));
    let rest = score_lanes
        .remainder()
        .iter()
        .zip(offset_lanes.remainder())
        .map(|(score, offset)| score + offset);
    for (block, (score, offset)) in score_lanes.zip(offset_lanes).enumerate() {
        for lane in 0..LANES {
            let cost = score[lane] + offset[lane];
            let better = cost < best[lane];
            best[lane] = if better { cost } else { best[lane] };
            at[lane] = if better { block as u32 } else { at[lane] };
        }
    }
    let mut winner = (f32::INFINITY, 0u32);
    for lane in 0..LANES {
        let id = at[lane] * LANES as u32 + lane as u32;
        if best[lane] < winner.0 || (best[lane] == winner.0 && id < winner.1) {
            winner = (best[lane], id);
        }
    }
    let whole = scores.len() / LANES * LANES;
    for (j, cost) in rest.enumerate() {
        if cost < winner.0 {
            winner = (cost, (whole + j) as u32);
        }
    }
    winner.1
}
