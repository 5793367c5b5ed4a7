//! A block of vectors whose entries of a row lie beside each other, as a factor takes them.

use faer::prelude::*;

use crate::algebra::dense::vectorised;
use crate::algebra::sparse_factor::Factor;

/// Vectors multiplied at once: a row of four fills a vector register. At 5k vertices and k = 200 the space has 344, 400,
/// 480 dimensions with 4, 8, 16 vectors, and orthogonalisation grows with the square.
pub(super) const BLOCK: usize = 4;

/// The square of a triangle's condition number must stay well inside double precision.
const REGULAR: f64 = 1e-12;

/// Rows summed beside each other, so that fewer additions wait for one another.
const BESIDE: usize = 2;

/// Numbers between the vectors of two blocks, row by row.
pub(super) type Square = [[f64; BLOCK]; BLOCK];

/// Columns of a matrix `X`, `(n, BLOCK)`.
#[derive(Clone)]
pub(super) struct Block {
    rows: Vec<[f64; BLOCK]>,
}

impl Block {
    /// Of `n` rows, all the same.
    pub(super) fn filled(n: usize, value: f64) -> Self {
        Self {
            rows: vec![[value; BLOCK]; n],
        }
    }

    /// `X ← Y`.
    pub(super) fn copy_from(&mut self, columns: MatRef<'_, f64>) {
        for (c, column) in columns.col_iter().enumerate() {
            for (row, x) in self.rows.iter_mut().zip(column.iter()) {
                row[c] = *x;
            }
        }
    }

    /// `Y ← X`.
    pub(super) fn copy_to(&self, columns: MatMut<'_, f64>) {
        for (c, column) in columns.col_iter_mut().enumerate() {
            for (row, x) in self.rows.iter().zip(column.iter_mut()) {
                *x = row[c];
            }
        }
    }

    /// `X ← diag(d)Y`.
    pub(super) fn set_scaled(&mut self, diagonal: &[f64], other: &Self) {
        for ((x, y), d) in self.rows.iter_mut().zip(&other.rows).zip(diagonal) {
            *x = y.map(|y| y * d);
        }
    }

    /// `X ← diag(d)X`.
    pub(super) fn scale(&mut self, diagonal: &[f64]) {
        for (x, d) in self.rows.iter_mut().zip(diagonal) {
            *x = x.map(|x| x * d);
        }
    }

    /// `X ← M⁻¹X`.
    pub(super) fn solve(&mut self, factor: &Factor) {
        factor.solve(&mut self.rows);
    }

    /// `XᵀY`.
    pub(super) fn products(&self, other: &Self) -> Square {
        vectorised(
            #[inline(always)]
            || {
                let mut sums = [[[0.0; BLOCK]; BLOCK]; BESIDE];
                let (xs, last_x) = self.rows.as_chunks::<BESIDE>();
                let (ys, last_y) = other.rows.as_chunks::<BESIDE>();
                for (x, y) in xs.iter().zip(ys) {
                    for (sums, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
                        add_products(sums, x, y);
                    }
                }
                for (sums, (x, y)) in sums.iter_mut().zip(last_x.iter().zip(last_y)) {
                    add_products(sums, x, y);
                }
                let mut all = [[0.0; BLOCK]; BLOCK];
                for sums in sums {
                    for i in 0..BLOCK {
                        for j in 0..BLOCK {
                            all[i][j] += sums[i][j];
                        }
                    }
                }
                all
            },
        )
    }

    /// `X ← X − YC`.
    pub(super) fn subtract(&mut self, other: &Self, coefficients: &Square) {
        vectorised(
            #[inline(always)]
            || {
                for (x, y) in self.rows.iter_mut().zip(&other.rows) {
                    for i in 0..BLOCK {
                        for j in 0..BLOCK {
                            x[j] -= y[i] * coefficients[i][j];
                        }
                    }
                }
            },
        );
    }

    /// `X = QR`: overwrites `X` with `Q`, returns the upper triangle `R`, or leaves `X` alone when its columns are too
    /// nearly dependent.
    pub(super) fn orthonormalise(&mut self) -> Option<Square> {
        let first = self.cholesky_qr()?;
        // Rounding in the first grew with the square of the condition number; with unit columns there is none left.
        let second = self.cholesky_qr()?;
        let mut triangle = [[0.0; BLOCK]; BLOCK];
        for i in 0..BLOCK {
            for j in 0..BLOCK {
                triangle[i][j] = (i..=j).map(|k| second[i][k] * first[k][j]).sum();
            }
        }
        Some(triangle)
    }

    /// The same, to as many digits as `XᵀX = RᵀR` leaves.
    fn cholesky_qr(&mut self) -> Option<Square> {
        let triangle = cholesky(&self.products(self))?;
        let mut inverse = [[0.0; BLOCK]; BLOCK];
        for j in 0..BLOCK {
            inverse[j][j] = 1.0 / triangle[j][j];
            for i in (0..j).rev() {
                let sum: f64 = (i + 1..=j).map(|k| triangle[i][k] * inverse[k][j]).sum();
                inverse[i][j] = -sum / triangle[i][i];
            }
        }
        vectorised(
            #[inline(always)]
            || {
                for x in &mut self.rows {
                    let mut product = [0.0; BLOCK];
                    for i in 0..BLOCK {
                        for j in 0..BLOCK {
                            product[j] += x[i] * inverse[i][j];
                        }
                    }
                    *x = product;
                }
            },
        );
        Some(triangle)
    }
}

#[inline(always)]
fn add_products(sums: &mut Square, x: &[f64; BLOCK], y: &[f64; BLOCK]) {
    for i in 0..BLOCK {
        for j in 0..BLOCK {
            sums[i][j] += x[i] * y[j];
        }
    }
}

/// Upper triangle `R` with `RᵀR = G`, none when it is nearly singular.
fn cholesky(gram: &Square) -> Option<Square> {
    let largest = (0..BLOCK).map(|i| gram[i][i]).fold(0.0, f64::max);
    let mut triangle = [[0.0; BLOCK]; BLOCK];
    for i in 0..BLOCK {
        for j in i..BLOCK {
            let known: f64 = (0..i).map(|k| triangle[k][i] * triangle[k][j]).sum();
            let rest = gram[i][j] - known;
            triangle[i][j] = if j > i {
                rest / triangle[i][i]
            } else if rest > REGULAR * largest {
                rest.sqrt()
            } else {
                return None;
            };
        }
    }
    Some(triangle)
}

#[cfg(test)]
mod tests {
    use super::super::noise::noise;
    use super::*;

    /// An odd number of rows.
    const ROWS: usize = 101;

    fn block(columns: impl Fn(usize, usize) -> f64) -> (Mat<f64>, Block) {
        let matrix = Mat::from_fn(ROWS, BLOCK, columns);
        let mut block = Block::filled(ROWS, 0.0);
        block.copy_from(matrix.as_ref());
        (matrix, block)
    }

    fn matrix(square: &Square) -> Mat<f64> {
        Mat::from_fn(BLOCK, BLOCK, |i, j| square[i][j])
    }

    fn columns(block: &Block) -> Mat<f64> {
        let mut out = Mat::zeros(ROWS, BLOCK);
        block.copy_to(out.as_mut());
        out
    }

    #[test]
    fn products_are_those_of_matrices() {
        let (x, mut first) = block(|i, j| noise((BLOCK * i + j) as u64));
        let (y, second) = block(|i, j| noise((BLOCK * i + j + 1000) as u64));
        let products = first.products(&second);
        let all = x.transpose() * &y;
        // Rounding of sums of 101 products below a quarter.
        assert!((matrix(&products) - &all).norm_max() < 1e-14);
        first.subtract(&second, &products);
        assert!((columns(&first) - (&x - &y * &all)).norm_max() < 1e-13);
    }

    #[test]
    fn columns_become_orthonormal_with_the_same_span() {
        // The last column is nearly the sum of the others.
        let vector = |i: usize, j: usize| noise((BLOCK * i + j) as u64);
        let skew = |i: usize, j: usize| match j {
            3 => 1e-4 * vector(i, 3) + (0..3).map(|j| vector(i, j)).sum::<f64>(),
            _ => vector(i, j),
        };
        let (x, mut q) = block(skew);
        let triangle = q.orthonormalise().expect("regular");
        let gram = matrix(&q.products(&q));
        assert!((gram - Mat::<f64>::identity(BLOCK, BLOCK)).norm_max() < 1e-14);
        for (i, row) in triangle.iter().enumerate() {
            assert!(row[..i].iter().all(|r| *r == 0.0));
        }
        assert!((columns(&q) * matrix(&triangle) - x).norm_max() < 1e-13);
    }

    #[test]
    fn dependent_columns_are_left_alone() {
        let (x, mut block) = block(|i, j| noise((i + j / 2) as u64));
        assert!(block.orthonormalise().is_none());
        assert_eq!(columns(&block), x);
    }
}
