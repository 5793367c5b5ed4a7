//! Forward and back substitution with `LDLᵀ`, several right-hand sides beside each other in a row.

use pulp::{Arch, Simd, WithSimd};

use crate::algebra::dense::subtract;

/// Columns of a panel at most, so that rows are loaded and stored less often.
const WIDEST: usize = 4;

/// Columns of `L` beside each other, all with the same rows below their triangle.
#[derive(Debug)]
struct Panel {
    /// The first column.
    first: u32,
    /// Number of columns, from 1 to [`WIDEST`].
    width: u32,
    /// Where the rows below the triangle start among all rows, and how many there are.
    rows: u32,
    count: u32,
    /// Where its values start.
    values: usize,
}

/// A factor laid out as substitution reads it.
#[derive(Debug)]
pub(super) struct Panels {
    in_order: Vec<Panel>,
    rows: Vec<u32>,
    /// Of a panel the inverse pivots, the triangle below them row by row, and the rows below that.
    values: Vec<f64>,
}

impl Panels {
    /// With room for so many values.
    pub(super) fn with_capacity(values: usize) -> Self {
        Self {
            in_order: Vec::new(),
            rows: Vec::new(),
            values: Vec::with_capacity(values),
        }
    }

    /// Adds `columns` columns from `first`, which have the rows `below` their triangle in common. `values` are the columns
    /// one after the other: the triangle with `D` on its diagonal, then the rows below.
    pub(super) fn push(&mut self, first: usize, columns: usize, below: &[u32], values: &[f64]) {
        let height = columns + below.len();
        let rows = self.rows.len();
        self.rows.extend(first as u32..(first + columns) as u32);
        self.rows.extend(below);
        for from in (0..columns).step_by(WIDEST) {
            let width = WIDEST.min(columns - from);
            self.in_order.push(Panel {
                first: (first + from) as u32,
                width: width as u32,
                rows: (rows + from + width) as u32,
                count: (height - from - width) as u32,
                values: self.values.len(),
            });
            let columns = &values[from * height..(from + width) * height];
            let row = |i: usize, width: usize| {
                let columns = columns.chunks_exact(height).take(width);
                columns.map(move |column| column[i])
            };
            for w in 0..width {
                self.values.push(1.0 / columns[w * height + from + w]);
            }
            for w in 1..width {
                self.values.extend(row(from + w, w));
            }
            for i in from + width..height {
                self.values.extend(row(i, width));
            }
        }
    }

    /// `X ← (LDLᵀ)⁻¹X`.
    pub(super) fn solve<const C: usize>(&self, x: &mut [[f64; C]]) {
        Arch::new().dispatch(Substitution { panels: self, x });
    }

    #[inline(always)]
    fn substitute<const C: usize, const FUSED: bool>(&self, x: &mut [[f64; C]]) {
        for panel in &self.in_order {
            match panel.width {
                1 => self.forward::<C, 1, 0, FUSED>(panel, x),
                2 => self.forward::<C, 2, 1, FUSED>(panel, x),
                3 => self.forward::<C, 3, 3, FUSED>(panel, x),
                _ => self.forward::<C, 4, 6, FUSED>(panel, x),
            }
        }
        for panel in self.in_order.iter().rev() {
            match panel.width {
                1 => self.backward::<C, 1, 0, FUSED>(panel, x),
                2 => self.backward::<C, 2, 1, FUSED>(panel, x),
                3 => self.backward::<C, 3, 3, FUSED>(panel, x),
                _ => self.backward::<C, 4, 6, FUSED>(panel, x),
            }
        }
    }

    /// `L⁻¹` of the `W` columns of a panel, with `T` entries in their triangle: their rows of `x` are finished, and
    /// subtracted from all later ones.
    #[inline(always)]
    fn forward<const C: usize, const W: usize, const T: usize, const FUSED: bool>(
        &self,
        panel: &Panel,
        x: &mut [[f64; C]],
    ) {
        let (_, triangle, values, rows) = self.parts::<W, T>(panel);
        let own = own_rows::<C, W>(panel, x);
        let mut finished = *own;
        for i in 1..W {
            for w in 0..i {
                let row = finished[w];
                subtract::<C, FUSED>(&mut finished[i], triangle[i * (i - 1) / 2 + w], &row);
            }
        }
        *own = finished;
        for (values, &r) in values.iter().zip(rows) {
            let row = &mut x[r as usize];
            for w in 0..W {
                subtract::<C, FUSED>(row, values[w], &finished[w]);
            }
        }
    }

    /// `L⁻ᵀD⁻¹` of them, when all later rows of `x` are finished.
    #[inline(always)]
    fn backward<const C: usize, const W: usize, const T: usize, const FUSED: bool>(
        &self,
        panel: &Panel,
        x: &mut [[f64; C]],
    ) {
        let (pivots, triangle, values, rows) = self.parts::<W, T>(panel);
        // Every other row, so that fewer subtractions wait for one another.
        let mut sums = [[[0.0; C]; W]; 2];
        let (value_pairs, last_values) = values.as_chunks::<2>();
        let (row_pairs, last_row) = rows.as_chunks::<2>();
        for (values, rows) in value_pairs.iter().zip(row_pairs) {
            for half in 0..2 {
                let row = x[rows[half] as usize];
                for w in 0..W {
                    subtract::<C, FUSED>(&mut sums[half][w], values[half][w], &row);
                }
            }
        }
        for (values, &r) in last_values.iter().zip(last_row) {
            for w in 0..W {
                subtract::<C, FUSED>(&mut sums[0][w], values[w], &x[r as usize]);
            }
        }
        let own = own_rows::<C, W>(panel, x);
        let mut finished = *own;
        for w in 0..W {
            for c in 0..C {
                finished[w][c] = finished[w][c] * pivots[w] + (sums[0][w][c] + sums[1][w][c]);
            }
        }
        for w in (0..W).rev() {
            for i in w + 1..W {
                let row = finished[i];
                subtract::<C, FUSED>(&mut finished[w], triangle[i * (i - 1) / 2 + w], &row);
            }
        }
        *own = finished;
    }

    /// Inverse pivots, triangle, and the rows below with their indices.
    #[inline(always)]
    #[expect(clippy::type_complexity, reason = "four slices of one layout")]
    fn parts<const W: usize, const T: usize>(
        &self,
        panel: &Panel,
    ) -> (&[f64; W], &[f64; T], &[[f64; W]], &[u32]) {
        let count = panel.count as usize;
        let values = &self.values[panel.values..][..W + T + W * count];
        let (pivots, values) = values.split_at(W);
        let (triangle, values) = values.split_at(T);
        let (Ok(pivots), Ok(triangle)) = (pivots.try_into(), triangle.try_into()) else {
            unreachable!("split at their lengths")
        };
        let rows = &self.rows[panel.rows as usize..][..count];
        (pivots, triangle, values.as_chunks().0, rows)
    }
}

/// To be compiled for several instruction sets.
struct Substitution<'a, const C: usize> {
    panels: &'a Panels,
    x: &'a mut [[f64; C]],
}

impl<const C: usize> WithSimd for Substitution<'_, C> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        // Where registers are wide, one operation multiplies and adds: a fifth less time.
        if S::IS_SCALAR {
            self.panels.substitute::<C, false>(self.x);
        } else {
            self.panels.substitute::<C, true>(self.x);
        }
    }
}

/// The rows of `x` that belong to the columns of a panel.
#[inline(always)]
fn own_rows<'a, const C: usize, const W: usize>(
    panel: &Panel,
    x: &'a mut [[f64; C]],
) -> &'a mut [[f64; C]; W] {
    match x[panel.first as usize..].first_chunk_mut() {
        Some(rows) => rows,
        None => unreachable!("x has a row for each column"),
    }
}
