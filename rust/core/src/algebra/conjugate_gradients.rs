//! Large sparse symmetric positive definite equations, solved step by step.
//!
//! # Source
//! Hestenes, Stiefel, "Methods of conjugate gradients for solving linear systems", 1952, preconditioned.

use crate::error::Result;
use crate::watch::progress::Check;

/// One row of N right sides or solutions.
pub type Row<const N: usize> = [f64; N];

/// When the steps end.
#[derive(Debug, Clone, Copy)]
pub struct Until {
    /// The residual is at most this share of what it is at the start.
    pub residual: f64,
    /// Steps at most.
    pub steps: usize,
}

/// x with A x = b, N columns at once with a common step, sought from `start`. `apply` is A, `precondition` something close to
/// its inverse, symmetric and positive definite as well.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn solved<const N: usize>(
    apply: impl Fn(&[Row<N>]) -> Vec<Row<N>>,
    precondition: impl Fn(&[Row<N>]) -> Vec<Row<N>>,
    right: &[Row<N>],
    start: Vec<Row<N>>,
    until: Until,
    check: Check<'_>,
) -> Result<Vec<Row<N>>> {
    let mut found = start;
    let mut residual = apply(&found);
    for (r, b) in residual.iter_mut().zip(right) {
        for (r, b) in r.iter_mut().zip(b) {
            *r = b - *r;
        }
    }
    let enough = until.residual * until.residual * product(&residual, &residual);
    let mut direction = precondition(&residual);
    let mut slope = product(&residual, &direction);
    for _ in 0..until.steps {
        if product(&residual, &residual) <= enough || slope <= 0.0 {
            break;
        }
        check()?;
        let image = apply(&direction);
        let step = slope / product(&direction, &image);
        add(&mut found, &direction, step);
        add(&mut residual, &image, -step);
        let next = precondition(&residual);
        let there = product(&residual, &next);
        let kept = there / slope;
        slope = there;
        for (direction, next) in direction.iter_mut().zip(&next) {
            for (d, n) in direction.iter_mut().zip(next) {
                *d = n + kept * *d;
            }
        }
    }
    Ok(found)
}

/// Σ ⟨x, y⟩, in the order of the rows.
fn product<const N: usize>(x: &[Row<N>], y: &[Row<N>]) -> f64 {
    let mut sums = [0.0; N];
    for (x, y) in x.iter().zip(y) {
        for (sum, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *sum += x * y;
        }
    }
    sums.iter().sum()
}

/// Adds s·y to x.
fn add<const N: usize>(x: &mut [Row<N>], y: &[Row<N>], s: f64) {
    for (x, y) in x.iter_mut().zip(y) {
        for (x, y) in x.iter_mut().zip(y) {
            *x += s * y;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tridiagonal_matrix_is_solved_in_as_many_steps_as_it_has_rows() {
        const SIZE: usize = 20;
        let apply = |x: &[Row<2>]| -> Vec<Row<2>> {
            let at = |i: usize, c: usize| x.get(i).map_or(0.0, |row| row[c]);
            let row = |i: usize, c: usize| 2.5 * at(i, c) - at(i.wrapping_sub(1), c) - at(i + 1, c);
            (0..SIZE).map(|i| [row(i, 0), row(i, 1)]).collect()
        };
        let halved = |x: &[Row<2>]| x.iter().map(|row| row.map(|x| 0.4 * x)).collect();
        let wanted: Vec<Row<2>> = (0..SIZE)
            .map(|i| [(i as f64).sin(), (2.0 * i as f64).cos()])
            .collect();
        let until = Until {
            residual: 1e-12,
            steps: 2 * SIZE,
        };
        let right = apply(&wanted);
        let start = vec![[0.0; 2]; SIZE];
        let found = solved(apply, halved, &right, start, until, &|| Ok(())).expect("not cancelled");
        for (found, wanted) in found.iter().zip(&wanted) {
            for (x, y) in found.iter().zip(wanted) {
                // The smallest eigenvalue is above ½, the right side below 5·√40.
                assert!((x - y).abs() < 1e-9, "{x} {y}");
            }
        }
    }
}
