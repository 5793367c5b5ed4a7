//! Forward and back substitution with `LDLᵀ`, several right-hand sides beside each other in a row.

/// Columns of the factor worked on together, so that rows are loaded and stored less often.
const TOGETHER: usize = 4;

/// Columns of `L` with one pattern below their triangle.
#[derive(Clone, Copy)]
pub(super) struct Supernode<'a> {
    /// The first column's index.
    pub(super) first: usize,
    /// Number of columns.
    pub(super) columns: usize,
    /// Rows below the triangle.
    pub(super) below: &'a [u32],
    /// The columns, one after the other: the triangle with `D` on its diagonal, then the rows below.
    pub(super) values: &'a [f64],
}

impl<'a> Supernode<'a> {
    /// `L⁻¹` of these columns: their rows of `x` are finished, and subtracted from all later ones.
    #[inline(always)]
    pub(super) fn forward<const C: usize>(self, x: &mut [[f64; C]]) {
        let mut j = 0;
        while j + TOGETHER <= self.columns {
            self.forward_some::<C, TOGETHER>(j, x);
            j += TOGETHER;
        }
        while j < self.columns {
            self.forward_some::<C, 1>(j, x);
            j += 1;
        }
    }

    /// `L⁻ᵀD⁻¹` of these columns, when all later rows of `x` are finished.
    #[inline(always)]
    pub(super) fn backward<const C: usize>(self, x: &mut [[f64; C]]) {
        let mut j = self.columns;
        while !j.is_multiple_of(TOGETHER) {
            j -= 1;
            self.backward_some::<C, 1>(j, x);
        }
        while j > 0 {
            j -= TOGETHER;
            self.backward_some::<C, TOGETHER>(j, x);
        }
    }

    #[inline(always)]
    fn forward_some<const C: usize, const W: usize>(self, j: usize, x: &mut [[f64; C]]) {
        let mut rows = [[0.0; C]; W];
        for w in 0..W {
            rows[w] = x[self.first + j + w];
            for v in 0..w {
                let row = rows[v];
                subtract(&mut rows[w], self.column(j + v)[j + w], row);
            }
            x[self.first + j + w] = rows[w];
        }
        let (beside, below) = self.after::<W>(j);
        for (i, row) in x[self.first + j + W..]
            .iter_mut()
            .take(beside[0].len())
            .enumerate()
        {
            for w in 0..W {
                subtract(row, beside[w][i], rows[w]);
            }
        }
        for (i, &r) in self.below.iter().enumerate() {
            let row = &mut x[r as usize];
            for w in 0..W {
                subtract(row, below[w][i], rows[w]);
            }
        }
    }

    #[inline(always)]
    fn backward_some<const C: usize, const W: usize>(self, j: usize, x: &mut [[f64; C]]) {
        let mut rows = [[0.0; C]; W];
        for w in 0..W {
            let inverse = 1.0 / self.column(j + w)[j + w];
            for (y, x) in rows[w].iter_mut().zip(x[self.first + j + w]) {
                *y = x * inverse;
            }
        }
        let (beside, below) = self.after::<W>(j);
        for (i, &r) in self.below.iter().enumerate() {
            let row = x[r as usize];
            for w in 0..W {
                subtract(&mut rows[w], below[w][i], row);
            }
        }
        for (i, &row) in x[self.first + j + W..]
            .iter()
            .take(beside[0].len())
            .enumerate()
        {
            for w in 0..W {
                subtract(&mut rows[w], beside[w][i], row);
            }
        }
        for w in (0..W).rev() {
            for v in w + 1..W {
                let row = rows[v];
                subtract(&mut rows[w], self.column(j + w)[j + v], row);
            }
            x[self.first + j + w] = rows[w];
        }
    }

    #[inline(always)]
    fn column(self, j: usize) -> &'a [f64] {
        let height = self.columns + self.below.len();
        &self.values[j * height..(j + 1) * height]
    }

    /// Of `W` columns from `j`: the rest of the triangle's rows, and the rows below it.
    #[inline(always)]
    fn after<const W: usize>(self, j: usize) -> ([&'a [f64]; W], [&'a [f64]; W]) {
        let (mut beside, mut below): ([&[f64]; W], [&[f64]; W]) = ([&[]; W], [&[]; W]);
        for w in 0..W {
            let column = self.column(j + w);
            beside[w] = &column[j + W..self.columns];
            below[w] = &column[self.columns..];
        }
        (beside, below)
    }
}

/// `y ← y − ax`.
#[inline(always)]
fn subtract<const C: usize>(y: &mut [f64; C], a: f64, x: [f64; C]) {
    for c in 0..C {
        y[c] -= a * x[c];
    }
}
