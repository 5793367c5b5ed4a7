//! The point of least cost among some hundred, a squared distance and something that is given.

use faer::{Mat, MatRef};
use pulp::{Simd, WithSimd};

/// Queries, and registers of points, whose sums are made at once: they fill most of the registers.
const QUERIES: usize = 6;
const REGISTERS: usize = 2;

/// Numbers in the widest register.
const MOST_LANES: usize = 16;

/// For each query, a row of `queries`, the number of the row of `points` for which weight·‖a − b‖² + fixed(b, a) is
/// least, the first of equal ones. For some hundred points, which are read again for every few queries.
#[must_use]
pub fn closest(
    queries: MatRef<'_, f32>,
    points: MatRef<'_, f32>,
    fixed: Option<&Mat<f32>>,
    weight: f32,
) -> Vec<u32> {
    pulp::Arch::new().dispatch(Closest {
        queries,
        points,
        fixed,
        weight,
    })
}

/// [`closest`] with sums that are compared as soon as they are made, in vector registers.
struct Closest<'a> {
    queries: MatRef<'a, f32>,
    points: MatRef<'a, f32>,
    fixed: Option<&'a Mat<f32>>,
    weight: f32,
}

impl Closest<'_> {
    /// −2·weight times the coordinates of so many queries, the last ones repeated: by coordinate.
    #[inline(always)]
    fn queries_from(&self, from: usize) -> Vec<[f32; QUERIES]> {
        let (last, scale) = (self.queries.nrows() - 1, -2.0 * self.weight);
        let ids: [usize; QUERIES] = std::array::from_fn(|q| (from + q).min(last));
        let coordinates = self.queries.col_iter();
        coordinates.map(|x| ids.map(|q| scale * x[q])).collect()
    }

    /// weight·‖b‖² of each point, in whole blocks; of none that there is not.
    #[inline(always)]
    fn offsets(&self, block: usize) -> Vec<f32> {
        let count = self.points.nrows();
        let mut offsets = vec![0.0; count];
        for column in self.points.col_iter() {
            for (offset, x) in offsets.iter_mut().zip(column.iter()) {
                *offset += self.weight * x * x;
            }
        }
        offsets.resize(count.next_multiple_of(block), f32::INFINITY);
        offsets
    }

    /// The points in blocks, each by coordinate.
    #[inline(always)]
    fn blocks(&self, block: usize) -> Vec<f32> {
        let (count, dims) = self.points.shape();
        let mut blocks = vec![0.0; count.next_multiple_of(block) * dims];
        for (from, out) in (0..count)
            .step_by(block)
            .zip(blocks.chunks_exact_mut(block * dims))
        {
            let points = self.points.subrows(from, block.min(count - from));
            for (out, column) in out.chunks_exact_mut(block).zip(points.col_iter()) {
                for (out, x) in out.iter_mut().zip(column.iter()) {
                    *out = *x;
                }
            }
        }
        blocks
    }
}

impl WithSimd for Closest<'_> {
    type Output = Vec<u32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<u32> {
        let (count, dims) = self.queries.shape();
        let block = REGISTERS * S::F32_LANES;
        let (offsets, blocks) = (self.offsets(block), self.blocks(block));
        let (offsets, blocks) = (S::as_simd_f32s(&offsets).0, S::as_simd_f32s(&blocks).0);
        let offsets = offsets.as_chunks::<REGISTERS>().0;
        let blocks = blocks.as_chunks::<REGISTERS>().0;
        let none = vec![0.0; self.points.nrows()];
        let lanes: [f32; MOST_LANES] = std::array::from_fn(|lane| lane as f32);
        let lane = S::as_simd_f32s(&lanes).0[0];
        let mut found = Vec::with_capacity(count);
        for from in (0..count).step_by(QUERIES) {
            let queries = self.queries_from(from);
            let fixed: [(&[S::f32s], &[f32]); QUERIES] = std::array::from_fn(
                #[inline(always)]
                |q| {
                    let fixed = self.fixed.map_or(none.as_slice(), |fixed| {
                        fixed.col_as_slice((from + q).min(count - 1))
                    });
                    S::as_simd_f32s(fixed)
                },
            );
            let mut least = [simd.splat_f32s(f32::INFINITY); QUERIES];
            let mut at = [simd.splat_f32s(0.0); QUERIES];
            for (number, (offsets, points)) in
                offsets.iter().zip(blocks.chunks_exact(dims)).enumerate()
            {
                let mut sums = [*offsets; QUERIES];
                for (sums, (whole, rest)) in sums.iter_mut().zip(&fixed) {
                    for (r, sum) in sums.iter_mut().enumerate() {
                        let fixed = match whole.get(number * REGISTERS + r) {
                            Some(whole) => *whole,
                            // Beyond the last point offsets are infinite.
                            None => simd.partial_load_f32s(rest),
                        };
                        *sum = simd.add_f32s(*sum, fixed);
                    }
                }
                for (points, queries) in points.iter().zip(&queries) {
                    for (sums, query) in sums.iter_mut().zip(queries) {
                        let query = simd.splat_f32s(*query);
                        for (sum, point) in sums.iter_mut().zip(points) {
                            *sum = simd.mul_add_e_f32s(query, *point, *sum);
                        }
                    }
                }
                for (q, sums) in sums.iter().enumerate() {
                    for (r, sum) in sums.iter().enumerate() {
                        let here = simd.splat_f32s((number * REGISTERS + r) as f32);
                        let is_less = simd.less_than_f32s(*sum, least[q]);
                        least[q] = simd.select_f32s(is_less, *sum, least[q]);
                        at[q] = simd.select_f32s(is_less, here, at[q]);
                    }
                }
            }
            for q in 0..QUERIES.min(count - from) {
                let lowest = simd.splat_f32s(simd.reduce_min_f32s(least[q]));
                let point = simd.mul_add_e_f32s(at[q], simd.splat_f32s(S::F32_LANES as f32), lane);
                let is_lowest = simd.equal_f32s(least[q], lowest);
                let first = simd.select_f32s(is_lowest, point, simd.splat_f32s(f32::INFINITY));
                found.push(simd.reduce_min_f32s(first) as u32);
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closest_point_costs_least_and_is_the_first_that_does() {
        // Whole numbers from 0 to 7 that look random, so that sums are exact and many are equal.
        let scattered = |rows: usize, columns: usize, seed: usize| {
            Mat::from_fn(rows, columns, |i, j| {
                let number = (i * columns + j + seed) as u64;
                (number.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 61) as f32
            })
        };
        // Fewer than a register holds, whole registers, and some more.
        for (points, queries, dims) in
            [(1, 1, 1), (15, 7, 2), (32, 6, 3), (33, 13, 1), (101, 50, 8)]
        {
            let (b, a) = (scattered(points, dims, 3), scattered(queries, dims, 4));
            let given = scattered(points, queries, 5);
            for fixed in [None, Some(&given)] {
                let cost = |q: usize, i: usize| {
                    let square: f32 = (0..dims).map(|d| (a[(q, d)] - b[(i, d)]).powi(2)).sum();
                    0.5 * square + fixed.map_or(0.0, |fixed| fixed[(i, q)])
                };
                let first = |q: usize| {
                    let cheaper = |&i: &usize, &j: &usize| cost(q, i).total_cmp(&cost(q, j));
                    (0..points).min_by(cheaper).map(|i| i as u32)
                };
                let expected: Vec<u32> = (0..queries).filter_map(first).collect();
                let (queries, points) = (a.as_ref(), b.as_ref());
                assert_eq!(closest(queries, points, fixed, 0.5), expected);
                // Without vector registers too.
                let narrow = Closest {
                    queries,
                    points,
                    fixed,
                    weight: 0.5,
                };
                assert_eq!(narrow.with_simd(pulp::Scalar::new()), expected);
            }
        }
    }
}
