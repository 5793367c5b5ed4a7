//! Small dense algebra in a fixed order of operations, so that results do not depend on threads.

use std::hint::black_box;

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::solvers::Solve;
use faer::traits::ComplexField;
use faer::{Accum, Mat, MatMut, MatRef, Par, Side};

use crate::algebra::numbering::Number;
use crate::error::{Error, Result, System};

/// Products, factors, solves and decompositions of the library, after which the processor is told that the upper parts
/// of wide registers hold nothing.
///
/// The library ends without doing so. Everything that is not [`vectorised`] uses the narrow registers below,
/// and would from then on keep what is above them at every operation, which made laying out a mesh take twice as long
/// (Intel 64 and IA-32 Architectures Optimization Reference Manual, "Mixing AVX code with SSE code"). What itself
/// is vectorised ends with it.
pub fn clearing_registers<R>(work: impl FnOnce() -> R) -> R {
    let done = work();
    #[cfg(target_arch = "x86_64")]
    if let Some(processor) = pulp::x86::V3::try_new() {
        processor.avx._mm256_zeroupper();
    }
    done
}

/// Writes or adds `factor`·A·B.
pub fn multiply<T: ComplexField>(
    out: MatMut<'_, T>,
    accum: Accum,
    a: MatRef<'_, T>,
    b: MatRef<'_, T>,
    factor: T,
) {
    clearing_registers(|| matmul(out, accum, a, b, factor, Par::Seq));
}

/// A·B.
#[must_use]
pub fn product(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let mut out = Mat::zeros(a.nrows(), b.ncols());
    multiply(out.as_mut(), Accum::Replace, a, b, 1.0);
    out
}

/// Adds A·B.
pub fn add_product(out: MatMut<'_, f64>, a: MatRef<'_, f64>, b: MatRef<'_, f64>) {
    multiply(out, Accum::Add, a, b, 1.0);
}

/// Right-hand sides from which on as many others are solved for beside them.
const COLUMNS_ASIDE: usize = 32;

/// Solves (G + diag(ridge)) X = B for symmetric positive definite G, of which the lower half is read; `of` is what an
/// error names.
///
/// # Errors
/// [`Error::NotFactorised`] when the sum is not positive definite.
pub fn solve_with_ridge(
    of: System,
    mut gram: Mat<f64>,
    ridge: impl Fn(usize) -> f64,
    right: MatRef<'_, f64>,
) -> Result<Mat<f64>> {
    for i in 0..gram.nrows() {
        gram[(i, i)] += ridge(i);
    }
    let factor =
        clearing_registers(|| gram.llt(Side::Lower)).map_err(|e| Error::NotFactorised {
            of,
            reason: format!("least squares of size {}: {e:?}", gram.nrows()),
        })?;
    let solve = |right: MatRef<'_, f64>| clearing_registers(|| factor.solve(right));
    let half = right.ncols() / 2;
    if half < COLUMNS_ASIDE {
        return Ok(solve(right));
    }
    let (first, second) = right.split_at_col(half);
    let (first, second) = rayon::join(|| solve(first), || solve(second));
    Ok(faer::concat![[first, second]])
}

/// Rows of a matrix in the order of `ids`, first `columns` columns.
#[must_use]
pub fn gather_rows(matrix: MatRef<'_, f64>, ids: &[impl Number], columns: usize) -> Mat<f64> {
    let mut rows = Mat::zeros(ids.len(), columns);
    for j in 0..columns {
        let column = matrix.col(j);
        for (x, &id) in rows.col_as_slice_mut(j).iter_mut().zip(ids) {
            *x = column[id.index()];
        }
    }
    rows
}

/// The same matrix of other numbers, column by column.
fn converted<A: ComplexField, B: ComplexField>(
    matrix: MatRef<'_, A>,
    convert: impl Fn(&A) -> B,
) -> Mat<B> {
    let mut out = Mat::zeros(matrix.nrows(), matrix.ncols());
    for (j, column) in matrix.col_iter().enumerate() {
        for (y, x) in out.col_as_slice_mut(j).iter_mut().zip(column.iter()) {
            *y = convert(x);
        }
    }
    out
}

/// The same matrix in single precision.
#[must_use]
pub fn in_single(matrix: MatRef<'_, f64>) -> Mat<f32> {
    converted(matrix, |&x| x as f32)
}

/// The same matrix in double precision.
#[must_use]
pub fn in_double(matrix: MatRef<'_, f32>) -> Mat<f64> {
    converted(matrix, |&x| f64::from(x))
}

/// Sum of squares of all entries.
#[must_use]
pub fn squared_norm(matrix: MatRef<'_, f64>) -> f64 {
    let mut sum = 0.0;
    for j in 0..matrix.ncols() {
        for i in 0..matrix.nrows() {
            sum += matrix[(i, j)] * matrix[(i, j)];
        }
    }
    sum
}

/// Runs a computation compiled for the widest vector registers of this processor; the closure and what it calls
/// have to be `#[inline(always)]`, or are compiled for the narrowest. The order of operations, and so the result,
/// is the same on all.
#[inline(always)]
pub fn vectorised<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}

/// a·b + c: in one operation where registers have it, elsewhere that would be slow.
#[inline(always)]
#[must_use]
pub fn multiplied_and_added<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// `y ← y − ax`.
#[inline(always)]
pub fn subtract<const C: usize, const FUSED: bool>(y: &mut [f64; C], a: f64, x: &[f64; C]) {
    for c in 0..C {
        y[c] = multiplied_and_added::<FUSED>(-a, x[c], y[c]);
    }
}

/// Sums that run independently, so that the compiler can use vector registers.
pub const LANES: usize = 8;

/// Sum of all lanes by halves, so that few additions wait for one another.
#[inline(always)]
#[must_use]
pub fn sum_of_lanes(lanes: [f32; LANES]) -> f32 {
    let (low, high) = lanes.split_at(LANES / 2);
    let mut halves = [0.0; LANES / 2];
    for (half, (x, y)) in halves.iter_mut().zip(low.iter().zip(high)) {
        *half = x + y;
    }
    // Seeing what is added at the end, the compiler takes apart all that comes before and works on two lanes at a time.
    let halves = black_box(halves);
    (halves[0] + halves[2]) + (halves[1] + halves[3])
}

/// Natural logarithm of a positive normal number, 1e-15 off relative to it or to one: without branches, so that several go
/// beside each other in lanes, where the library's goes alone.
#[inline(always)]
#[must_use]
pub fn ln(x: f64) -> f64 {
    /// √½, from which the exponent counts: x = m·2ᵉ with m from there to √2.
    const ROOT_HALF: u64 = std::f64::consts::FRAC_1_SQRT_2.to_bits();
    const EXPONENT: u64 = 0xfff << 52;
    let above = x.to_bits().wrapping_sub(ROOT_HALF);
    let exponent = f64::from((above >> 32) as i32 >> 20);
    let m = f64::from_bits(x.to_bits().wrapping_sub(above & EXPONENT));
    // ln m = 2 artanh f = 2(f + f³/3 + f⁵/5 + …), f² at most 0.03.
    let f = (m - 1.0) / (m + 1.0);
    let square = f * f;
    let mut sum = 1.0 / 17.0;
    for odd in [15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0] {
        sum = sum * square + 1.0 / odd;
    }
    2.0 * f * sum + exponent * std::f64::consts::LN_2
}

/// Coordinates of a point that are compared at once; rows of so many, or a multiple, are compared fastest.
pub const COMPARED: usize = 2 * LANES;

/// ‖a − b‖², or anything above `limit` once it exceeds that.
#[must_use]
#[inline(always)]
pub fn squared_distance_within(a: &[f32], b: &[f32], limit: f32) -> f32 {
    let ((x, rest_x), (y, rest_y)) = (a.as_chunks::<COMPARED>(), b.as_chunks::<COMPARED>());
    let mut sum = squared_rest(rest_x, rest_y);
    for (x, y) in x.iter().zip(y) {
        sum += squares_in_lanes(x, y);
        if sum > limit {
            return sum;
        }
    }
    sum
}

/// ‖a − b‖².
#[must_use]
#[inline(always)]
pub fn squared_distance(a: &[f32], b: &[f32]) -> f32 {
    let ((x, rest_x), (y, rest_y)) = (a.as_chunks::<COMPARED>(), b.as_chunks::<COMPARED>());
    let mut lanes = [0.0; COMPARED];
    for (x, y) in x.iter().zip(y) {
        for l in 0..COMPARED {
            let d = x[l] - y[l];
            lanes[l] += d * d;
        }
    }
    let mut halves = [0.0; LANES];
    for l in 0..LANES {
        halves[l] = lanes[l] + lanes[LANES + l];
    }
    sum_of_lanes(halves) + squared_rest(rest_x, rest_y)
}

/// ‖x − y‖² over fewer coordinates than are compared at once.
#[inline(always)]
fn squared_rest(x: &[f32], y: &[f32]) -> f32 {
    if x.is_empty() {
        return 0.0;
    }
    let last = |rest| <[f32]>::chunks_exact(rest, LANES).remainder();
    let last = last(x).iter().zip(last(y));
    last.map(|(p, q)| (p - q) * (p - q)).sum::<f32>() + squares_in_lanes(x, y)
}

/// ‖x − y‖² over as many coordinates as fill whole lanes.
#[inline(always)]
fn squares_in_lanes(x: &[f32], y: &[f32]) -> f32 {
    let mut lanes = [0.0; LANES];
    for (p, q) in x.chunks_exact(LANES).zip(y.chunks_exact(LANES)) {
        for l in 0..LANES {
            let d = p[l] - q[l];
            lanes[l] += d * d;
        }
    }
    sum_of_lanes(lanes)
}

/// Σ aᵢbᵢᵀ over the columns of both, summed in single precision.
#[must_use]
pub fn sum_of_products(a: MatRef<'_, f32>, b: MatRef<'_, f32>) -> Mat<f64> {
    let mut sum = Mat::<f32>::zeros(a.nrows(), b.nrows());
    multiply(sum.as_mut(), Accum::Replace, a, b.transpose(), 1.0);
    in_double(sum.as_ref())
}

/// Σ aᵢaᵢᵀ over the columns, summed in single precision; only the lower half.
#[must_use]
pub fn gram(a: MatRef<'_, f32>) -> Mat<f64> {
    let k = a.nrows();
    let mut sum = Mat::<f32>::zeros(k, k);
    clearing_registers(|| {
        triangular::matmul(
            sum.as_mut(),
            BlockStructure::TriangularLower,
            Accum::Replace,
            a,
            BlockStructure::Rectangular,
            a.transpose(),
            BlockStructure::Rectangular,
            1.0,
            Par::Seq,
        );
    });
    in_double(sum.as_ref())
}

/// Points in a feature space, one contiguous single-precision row a point.
#[derive(Debug, Clone)]
pub struct Rows {
    /// Coordinates of a point.
    pub dims: usize,
    /// All rows, one after the other.
    pub data: Vec<f32>,
}

impl Rows {
    /// Rows of zeros.
    #[must_use]
    pub fn zeros(count: usize, dims: usize) -> Self {
        Self {
            dims,
            data: vec![0.0; count * dims],
        }
    }

    /// Makes room for other points, whose coordinates are then to be written.
    pub fn resize(&mut self, count: usize, dims: usize) {
        self.dims = dims;
        self.data.resize(count * dims, 0.0);
    }

    /// How many points there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.data.len() / self.dims
    }

    /// One point.
    #[must_use]
    pub fn row(&self, i: usize) -> &[f32] {
        &self.data[i * self.dims..(i + 1) * self.dims]
    }

    /// One point, to write to.
    pub fn row_mut(&mut self, i: usize) -> &mut [f32] {
        &mut self.data[i * self.dims..(i + 1) * self.dims]
    }

    /// The rows as columns of a matrix, `(dims, count)`.
    #[must_use]
    pub fn as_columns(&self) -> MatRef<'_, f32> {
        MatRef::from_column_major_slice(&self.data, self.dims, self.count())
    }

    /// The same, to write to.
    pub fn as_columns_mut(&mut self) -> MatMut<'_, f32> {
        let count = self.count();
        MatMut::from_column_major_slice_mut(&mut self.data, self.dims, count)
    }

    /// The points named by `ids`.
    #[must_use]
    pub fn gather(&self, ids: &[u32]) -> Self {
        self.gather_widened(ids, self.dims)
    }

    /// The same with coordinates of zero added, `dims` in all.
    #[must_use]
    pub fn gather_widened(&self, ids: &[u32], dims: usize) -> Self {
        let mut out = Self::zeros(ids.len(), dims);
        for (wide, &id) in out.data.chunks_exact_mut(dims).zip(ids) {
            wide[..self.dims].copy_from_slice(self.row(id as usize));
        }
        out
    }

    /// The same points with coordinates of zero added, `dims` in all.
    #[must_use]
    pub fn widened(&self, dims: usize) -> Self {
        let mut out = Self::zeros(self.count(), dims);
        for (wide, row) in out
            .data
            .chunks_exact_mut(dims)
            .zip(self.data.chunks_exact(self.dims))
        {
            wide[..self.dims].copy_from_slice(row);
        }
        out
    }

    /// The first coordinates of each point.
    #[must_use]
    pub fn first(&self, dims: usize) -> Self {
        let mut data = Vec::with_capacity(self.count() * dims);
        for row in self.data.chunks_exact(self.dims) {
            data.extend_from_slice(&row[..dims]);
        }
        Self { dims, data }
    }

    /// Each row times a matrix, of as many coordinates as that has rows.
    ///
    /// The matrix is copied without padding: products read what lies below the columns of a [`Mat`], and where that is
    /// left over from other numbers and denormal in single precision, they take ten to twenty times as long.
    #[must_use]
    pub fn times(&self, matrix: MatRef<'_, f64>) -> Self {
        let mut out = Self::zeros(self.count(), matrix.ncols());
        let transposed = Self::from_matrix(matrix, matrix.ncols());
        multiply(
            out.as_columns_mut(),
            Accum::Replace,
            transposed.as_columns(),
            self.as_columns().subrows(0, matrix.nrows()),
            1.0,
        );
        out
    }

    /// √w times the first `columns` coordinates of the points named by `ids`, for sums weighted by
    /// w.
    #[must_use]
    pub fn gather_weighted(&self, ids: &[u32], weights: &[f64], columns: usize) -> Self {
        let mut data = Vec::with_capacity(ids.len() * columns);
        for (&id, w) in ids.iter().zip(weights) {
            let root = w.sqrt() as f32;
            data.extend(self.row(id as usize)[..columns].iter().map(|x| root * x));
        }
        Self {
            dims: columns,
            data,
        }
    }

    /// Sum of the squares of each coordinate, `(dims)`.
    #[must_use]
    pub fn squares(&self) -> Vec<f32> {
        let mut sums = vec![0.0; self.dims];
        for row in self.data.chunks_exact(self.dims) {
            for (sum, x) in sums.iter_mut().zip(row) {
                *sum += x * x;
            }
        }
        sums
    }

    /// First `columns` columns of a matrix as rows.
    #[must_use]
    pub fn from_matrix(matrix: MatRef<'_, f64>, columns: usize) -> Self {
        let mut out = Self::zeros(matrix.nrows(), columns);
        for j in 0..columns {
            for (i, value) in matrix.col(j).iter().enumerate() {
                out.data[i * columns + j] = *value as f32;
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squared_distances_of_any_length_are_sums_of_squares() {
        for dims in [0, 1, 7, 8, 9, 15, 16, 17, 24, 31, 32, 150] {
            let [a, b] = [0.7f32, 1.3]
                .map(|step| -> Vec<f32> { (0..dims).map(|i| (step * i as f32).sin()).collect() });
            let terms = a.iter().zip(&b).map(|(x, y)| f64::from(x - y).powi(2));
            let sum: f64 = terms.sum();
            // Single precision's rounding of at most 150 terms.
            let close = |found: f32| (f64::from(found) - sum).abs() <= 1e-5 * sum;
            assert!(close(squared_distance(&a, &b)), "{dims}");
            assert!(
                close(squared_distance_within(&a, &b, f32::INFINITY)),
                "{dims}"
            );
            let limit = 0.4 * sum as f32;
            assert!(
                sum == 0.0 || squared_distance_within(&a, &b, limit) > limit,
                "{dims}"
            );
        }
    }

    #[test]
    fn logarithms_are_those_of_the_library() {
        for i in -3000..3000 {
            let x = (0.1 * f64::from(i)).exp();
            let (found, truth) = (ln(x), x.ln());
            assert!(
                (found - truth).abs() <= 2e-15 * truth.abs().max(1.0),
                "{x}: {found} {truth}"
            );
        }
    }

    #[test]
    fn rows_times_a_matrix_are_those_of_the_product() {
        let points = Mat::from_fn(7, 5, |i, j| ((3 * i + 5 * j) as f64).sin());
        let matrix = Mat::from_fn(3, 4, |i, j| ((2 * i + 7 * j) as f64).cos());
        let rows = Rows::from_matrix(points.as_ref(), 5);
        // Of five coordinates the matrix takes three.
        let product = product(points.get(.., ..3), matrix.as_ref());
        let found = rows.times(matrix.as_ref());
        for i in 0..7 {
            assert_eq!(rows.first(3).row(i), &rows.row(i)[..3]);
            for j in 0..4 {
                // Single precision of sums of three.
                assert!((f64::from(found.row(i)[j]) - product[(i, j)]).abs() < 1e-6);
            }
        }
    }
}
