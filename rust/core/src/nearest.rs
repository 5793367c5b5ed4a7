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

/// Index of the smallest `scores[j] + offsets[j]`.
#[must_use]
pub fn lowest(scores: &[f32], offsets: &[f32]) -> u32 {
    vectorised(|| lowest_sum([scores, offsets]))
}

/// Index of the smallest sum of the terms' j-th entries, the first of equal ones; to be called
/// within [`vectorised`]. All terms are as long as the first.
#[inline(always)]
#[must_use]
pub fn lowest_sum<const TERMS: usize>(terms: [&[f32]; TERMS]) -> u32 {
    // Lanes run independently so that the compiler can use vector registers.
    const LANES: usize = 16;
    let count = terms[0].len();
    let mut best = [f32::INFINITY; LANES];
    let mut at = [0u32; LANES];
    let whole = count / LANES * LANES;
    for start in (0..whole).step_by(LANES) {
        let mut cost = [0f32; LANES];
        for term in terms {
            let chunk = &term[start..start + LANES];
            for lane in 0..LANES {
                cost[lane] += chunk[lane];
            }
        }
        for lane in 0..LANES {
            let better = cost[lane] < best[lane];
            best[lane] = if better { cost[lane] } else { best[lane] };
            at[lane] = if better { start as u32 } else { at[lane] };
        }
    }
    let mut winner = (f32::INFINITY, 0u32);
    for lane in 0..LANES {
        let id = at[lane] + lane as u32;
        if best[lane] < winner.0 || (best[lane] == winner.0 && id < winner.1) {
            winner = (best[lane], id);
        }
    }
    for j in whole..count {
        let mut cost = 0.0;
        for term in terms {
            cost += term[j];
        }
        if cost < winner.0 {
            winner = (cost, j as u32);
        }
    }
    winner.1
}
