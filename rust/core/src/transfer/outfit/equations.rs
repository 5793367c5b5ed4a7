//! Sparse least squares over a garment's places, of rows that couple a few of them.

use crate::algebra::sparse_factor::Pattern;
use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result, System};

/// Which places are coupled, and in which order they are eliminated: found once, used for many sums.
#[derive(Debug)]
pub struct Equations {
    pattern: Pattern,
    /// Pairs of places, the lower first, ascending.
    couplings: Vec<[u32; 2]>,
    /// Entry of each coupling, then of each place.
    entries: Vec<u32>,
}

impl Equations {
    /// Of a number of places and the pairs of them that rows may have in common, in any order.
    ///
    /// # Errors
    /// [`Error::NotFactorised`].
    pub fn new(places: usize, pairs: impl Iterator<Item = [u32; 2]>) -> Result<Self> {
        let mut couplings: Vec<[u32; 2]> = pairs
            .filter(|[a, b]| a != b)
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        couplings.sort_unstable();
        couplings.dedup();
        let mut rows = vec![Vec::new(); places];
        for (number, &[a, b]) in (0..).zip(&couplings) {
            rows[b as usize].push((a, number));
        }
        let mut entries = vec![0; couplings.len() + places];
        let mut next = 0;
        for (v, row) in rows.iter().enumerate() {
            // Couplings are ascending, and so is each row.
            for &(_, number) in row {
                entries[number as usize] = next;
                next += 1;
            }
            entries[couplings.len() + v] = next;
            next += 1;
        }
        let columns = (0..)
            .zip(&rows)
            .map(|(v, row)| row.iter().map(|&(a, _)| a).chain([v]));
        Ok(Self {
            pattern: Pattern::new(columns, None)?,
            couplings,
            entries,
        })
    }

    /// Sums without a row.
    #[must_use]
    pub fn sums(&self) -> Sums<'_> {
        let places = self.entries.len() - self.couplings.len();
        Sums {
            equations: self,
            couplings: vec![0.0; self.couplings.len()],
            places: vec![0.0; places],
            right: vec![[0.0; 3]; places],
        }
    }
}

/// The normal equations of `Σ weight |Σᵢ factorᵢ pᵢ − value|²`.
#[derive(Debug, Clone)]
pub struct Sums<'a> {
    equations: &'a Equations,
    couplings: Vec<f64>,
    places: Vec<f64>,
    right: Vec<Point>,
}

impl Sums<'_> {
    /// Adds weight |Σ factor · p − value|² over places with factors, of which any two are coupled.
    ///
    /// # Panics
    /// When two places are not coupled.
    pub fn add(&mut self, row: &[(u32, f64)], weight: f64, value: Point) {
        for (k, &(a, factor)) in row.iter().enumerate() {
            let right = &mut self.right[a as usize];
            *right = vector::add(*right, vector::scaled(value, weight * factor));
            self.places[a as usize] += weight * factor * factor;
            for &(b, other) in &row[k + 1..] {
                let found = self
                    .equations
                    .couplings
                    .binary_search(&[a.min(b), a.max(b)]);
                let at = found.expect("the places of a row are coupled");
                self.couplings[at] += weight * factor * other;
            }
        }
    }

    /// The places for which the sum is least.
    ///
    /// # Errors
    /// [`Error::NotFactorised`] when the rows do not determine them.
    pub fn solved(&self) -> Result<Vec<Point>> {
        let Self {
            equations,
            couplings,
            places,
            right,
        } = self;
        let mut numbers = vec![0.0; equations.entries.len()];
        for (&entry, &x) in equations.entries.iter().zip(couplings.iter().chain(places)) {
            numbers[entry as usize] = x;
        }
        let factor = equations
            .pattern
            .factor(&numbers)
            .ok_or_else(|| Error::NotFactorised {
                of: System::Garment,
                reason: "a pivot of the garment's equations vanished".into(),
            })?;
        let ordering = equations.pattern.ordering();
        let mut x: Vec<Point> = ordering.iter().map(|&v| right[v as usize]).collect();
        factor.solve(&mut x);
        let mut found = vec![[0.0; 3]; right.len()];
        for (&v, x) in ordering.iter().zip(x) {
            found[v as usize] = x;
        }
        Ok(found)
    }
}
