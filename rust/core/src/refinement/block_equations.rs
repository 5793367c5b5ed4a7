//! Sparse symmetric positive definite equations of nodes that have twelve unknowns each: A = `UᵀU` by blocks.
//!
//! A row of U is held from the node itself on. Eliminating a node makes the later ones of its row depend on one another,
//! and it is enough to hand that on to the first of them. Nodes in succession whose rows end alike are eliminated
//! together, so that a later block, which lies far off in memory, is fetched once for all of them.
//!
//! # Source
//! George, Liu, "Computer solution of large sparse positive definite systems", 1981, chapter 5.

use crate::dense::vectorised;
use crate::error::{Error, Result};

/// Unknowns of a node.
pub const UNKNOWNS: usize = 12;

/// What two nodes have in common: rows of the first, columns of the last.
pub type Block = [[f64; UNKNOWNS]; UNKNOWNS];

/// Unknowns of one node.
pub type Part = [f64; UNKNOWNS];

/// Nodes eliminated together at most, so that their rows stay in the cache.
const TOGETHER: usize = 8;
/// Rows of a block worked out at once, whose sums fit into registers.
const ROWS_AT_ONCE: usize = 4;

/// Which blocks there are, row by row.
#[derive(Debug)]
pub struct BlockEquations {
    /// Where each node's row begins, and the last one ends.
    starts: Vec<usize>,
    /// Node of each block's columns: of a row the node itself, then later ones in their order.
    columns: Vec<u32>,
    /// First of the nodes that are eliminated together, and the end of the last.
    groups: Vec<usize>,
}

impl BlockEquations {
    /// Of so many nodes, in the order in which they are eliminated, and pairs that depend on one another, the last of
    /// both first.
    #[must_use]
    pub fn new(nodes: usize, pairs: &[(u32, u32)]) -> Self {
        let mut rows: Vec<Vec<u32>> = (0..nodes as u32).map(|node| vec![node]).collect();
        for &(last, first) in pairs {
            rows[first as usize].push(last);
        }
        let (mut starts, mut columns) = (vec![0], Vec::new());
        for node in 0..nodes {
            let mut row = std::mem::take(&mut rows[node]);
            row.sort_unstable();
            row.dedup();
            if let [_, next, rest @ ..] = row.as_slice() {
                rows[*next as usize].extend(rest);
            }
            columns.extend(row);
            starts.push(columns.len());
        }
        let row = |node: usize| &columns[starts[node]..starts[node + 1]];
        let mut groups = vec![0];
        for node in 1..nodes {
            let first = groups[groups.len() - 1];
            if node - first == TOGETHER || row(node) != &row(node - 1)[1..] {
                groups.push(node);
            }
        }
        groups.push(nodes);
        Self {
            starts,
            columns,
            groups,
        }
    }

    /// How many blocks there are.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.columns.len()
    }

    /// Number of the block of two nodes that depend on one another, `last` not before `first`.
    #[must_use]
    pub fn block(&self, last: u32, first: u32) -> u32 {
        let [from, to] = [0, 1].map(|i| self.starts[first as usize + i]);
        (from + self.columns[from..to].partition_point(|&node| node < last)) as u32
    }

    /// The solution takes the place of the right side, and U of the blocks.
    ///
    /// # Errors
    /// [`Error::NotFactorised`] where the equations are not positive definite.
    pub fn solve(&self, blocks: &mut [Block], right: &mut [Part]) -> Result<()> {
        vectorised(
            #[inline(always)]
            || {
                self.factorise(blocks)?;
                self.substitute(blocks, right);
                Ok(())
            },
        )
    }

    #[inline(always)]
    fn factorise(&self, blocks: &mut [Block]) -> Result<()> {
        for group in self.groups.windows(2) {
            let nodes = group[0]..group[1];
            for node in nodes.clone() {
                let (from, to) = (self.starts[node], self.starts[node + 1]);
                let (before, later) = blocks.split_at_mut(to);
                let Some((diagonal, row)) = before[from..].split_first_mut() else {
                    continue;
                };
                if !cholesky(diagonal) {
                    return Err(Error::NotFactorised {
                        reason: format!("a pivot of node {node} is not positive"),
                    });
                }
                for block in row.iter_mut() {
                    substitute_forward(diagonal, block);
                }
                // The rest of the group has the same columns from its own on.
                let mut at = 0;
                for i in 0..nodes.end - node - 1 {
                    for other in &row[i..] {
                        subtract_products(&mut later[at], &[(&row[i], other)].into_iter());
                        at += 1;
                    }
                }
            }
            let (done, later) = blocks.split_at_mut(self.starts[nodes.end]);
            let below = |node: usize| &done[self.starts[node]..][nodes.end - node..];
            let last = self.starts[nodes.end - 1] + 1;
            let columns = &self.columns[last..self.starts[nodes.end]];
            for (i, &node) in columns.iter().enumerate() {
                let mut at = self.starts[node as usize];
                for (j, &column) in columns.iter().enumerate().skip(i) {
                    while self.columns[at] < column {
                        at += 1;
                    }
                    let rows = nodes.clone().map(|node| (&below(node)[i], &below(node)[j]));
                    subtract_products(&mut later[at - self.starts[nodes.end]], &rows);
                }
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn substitute(&self, blocks: &[Block], right: &mut [Part]) {
        let nodes = self.starts.len() - 1;
        let row = |node: usize| (self.starts[node]..self.starts[node + 1]).skip(1);
        for node in 0..nodes {
            let diagonal = &blocks[self.starts[node]];
            let mut own = right[node].map(|x| [x]);
            substitute_forward(diagonal, &mut own);
            right[node] = own.map(|[x]| x);
            for at in row(node) {
                let later = &mut right[self.columns[at] as usize];
                for ([x], line) in own.iter().zip(&blocks[at]) {
                    for (rest, u) in later.iter_mut().zip(line) {
                        *rest -= u * x;
                    }
                }
            }
        }
        for node in (0..nodes).rev() {
            let diagonal = &blocks[self.starts[node]];
            let mut own = right[node];
            for at in row(node) {
                let later = &right[self.columns[at] as usize];
                for (rest, line) in own.iter_mut().zip(&blocks[at]) {
                    *rest -= dot(line, later);
                }
            }
            for m in (0..UNKNOWNS).rev() {
                let known = dot(&diagonal[m][m + 1..], &own[m + 1..]);
                own[m] = (own[m] - known) / diagonal[m][m];
            }
            right[node] = own;
        }
    }
}

#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// U of `UᵀU`, above and on the diagonal; whether there is one.
#[inline(always)]
fn cholesky(block: &mut Block) -> bool {
    for m in 0..UNKNOWNS {
        let pivot = block[m][m];
        if pivot <= 0.0 || pivot.is_nan() {
            return false;
        }
        let scale = 1.0 / pivot.sqrt();
        for entry in &mut block[m][m..] {
            *entry *= scale;
        }
        let line = block[m];
        for (r, row) in block.iter_mut().enumerate().skip(m + 1) {
            for (entry, u) in row.iter_mut().zip(&line).skip(r) {
                *entry -= line[r] * u;
            }
        }
    }
    true
}

/// X of `UᵀX` = B in place of B, of any number of columns.
#[inline(always)]
fn substitute_forward<const COLUMNS: usize>(u: &Block, right: &mut [[f64; COLUMNS]; UNKNOWNS]) {
    for m in 0..UNKNOWNS {
        let scale = 1.0 / u[m][m];
        for entry in &mut right[m] {
            *entry *= scale;
        }
        let line = right[m];
        for (row, factor) in right.iter_mut().zip(&u[m]).skip(m + 1) {
            for (entry, x) in row.iter_mut().zip(&line) {
                *entry -= factor * x;
            }
        }
    }
}

/// Subtracts the sum of `AᵀB`.
#[inline(always)]
fn subtract_products<'a>(
    block: &mut Block,
    factors: &(impl Iterator<Item = (&'a Block, &'a Block)> + Clone),
) {
    for (first, rows) in block.chunks_exact_mut(ROWS_AT_ONCE).enumerate() {
        let mut sums = [[0.0; UNKNOWNS]; ROWS_AT_ONCE];
        for (a, b) in factors.clone() {
            for (a, line) in a.iter().zip(b) {
                for (r, sums) in sums.iter_mut().enumerate() {
                    let factor = a[ROWS_AT_ONCE * first + r];
                    for (sum, x) in sums.iter_mut().zip(line) {
                        *sum += factor * x;
                    }
                }
            }
        }
        for (row, sums) in rows.iter_mut().zip(&sums) {
            for (entry, sum) in row.iter_mut().zip(sums) {
                *entry -= sum;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use faer::Mat;

    use super::*;

    #[test]
    fn equations_in_blocks_are_those_of_a_dense_matrix() {
        // A ring of nodes and one link across, which fill in others, and more nodes that all depend on one another than
        // are eliminated together; blocks of any numbers with a strong diagonal.
        let nodes = 16;
        let ring = (0..nodes).map(|a: u32| (a, (a + 1) % nodes));
        let dense = (6..nodes).flat_map(|a| (a..nodes).map(move |b| (a, b)));
        let mut pairs: Vec<(u32, u32)> = ring
            .chain((0..nodes).map(|a| (a, a)))
            .chain([(1, 4)])
            .chain(dense)
            .map(|(a, b)| (a.max(b), a.min(b)))
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        let equations = BlockEquations::new(nodes as usize, &pairs);
        assert!(equations.blocks() > pairs.len());
        let sizes: Vec<usize> = equations.groups.windows(2).map(|g| g[1] - g[0]).collect();
        assert!(sizes.contains(&1) && sizes.contains(&TOGETHER) && sizes.len() > 2);
        let n = UNKNOWNS * nodes as usize;
        let mut dense = Mat::zeros(n, n);
        let mut blocks = vec![[[0.0; UNKNOWNS]; UNKNOWNS]; equations.blocks()];
        for &(last, first) in &pairs {
            let block = &mut blocks[equations.block(last, first) as usize];
            for (i, line) in block.iter_mut().enumerate() {
                for (j, entry) in line.iter_mut().enumerate() {
                    let [row, column] =
                        [(first, i), (last, j)].map(|(node, i)| UNKNOWNS * node as usize + i);
                    let (low, high) = (row.min(column), row.max(column));
                    let value = ((low * 31 + high * 17) as f64).sin();
                    *entry = value + if row == column { 200.0 } else { 0.0 };
                    dense[(row, column)] = *entry;
                    dense[(column, row)] = *entry;
                }
            }
        }
        let truth: Vec<f64> = (0..n).map(|i| (0.3 * i as f64).cos()).collect();
        let product = |i: usize| (0..n).map(|j| dense[(i, j)] * truth[j]).sum();
        let mut found: Vec<Part> = (0..nodes as usize)
            .map(|node| std::array::from_fn(|m| product(UNKNOWNS * node + m)))
            .collect();
        equations.solve(&mut blocks, &mut found).expect("regular");
        for (found, truth) in found.iter().flatten().zip(&truth) {
            // Rounding of sums of 192 numbers up to 200, relative to eigenvalues of 8 and more.
            assert!((found - truth).abs() < 1e-12, "{found} {truth}");
        }
    }

    #[test]
    fn equations_that_are_not_positive_definite_are_refused() {
        let equations = BlockEquations::new(2, &[(1, 0)]);
        let mut blocks = vec![[[0.0; UNKNOWNS]; UNKNOWNS]; equations.blocks()];
        for node in [0, 1] {
            let block = &mut blocks[equations.block(node, node) as usize];
            for (m, row) in block.iter_mut().enumerate() {
                row[m] = 1.0;
            }
        }
        // 1 − 2² is negative, and so is the determinant.
        blocks[equations.block(1, 0) as usize][0][3] = 2.0;
        let solved = equations.solve(&mut blocks, &mut [[1.0; UNKNOWNS]; 2]);
        assert!(matches!(solved, Err(Error::NotFactorised { .. })));
    }
}
