//! Exhaustive nearest neighbours in a feature space, by matrix products.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use rayon::prelude::*;

use crate::dense::{Rows, vectorised};
use crate::error::Result;
use crate::progress::Check;

/// Queries treated in one matrix product: the scores then stay in the second-level cache.
const QUERIES_A_BLOCK: usize = 64;

/// Sums that run independently, so that the compiler can use vector registers.
const LANES: usize = 16;

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

    #[test]
    fn the_first_of_the_lowest_sums_is_found() {
        // Few different numbers, so that most lengths have several lowest sums, in any block and beyond the last.
        let mut state = 1u64;
        let mut draw = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) as f32 % 40.0
        };
        for count in 0..400 {
            let scores: Vec<f32> = (0..count).map(|_| draw()).collect();
            let offsets: Vec<f32> = (0..count).map(|_| draw()).collect();
            let sum = |i: usize| scores[i] + offsets[i];
            let first = (0..count).min_by(|&i, &j| sum(i).total_cmp(&sum(j)));
            assert_eq!(lowest(&scores, &offsets), first.unwrap_or(0) as u32);
        }
    }
}
