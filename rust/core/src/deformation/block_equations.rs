//! Sparse symmetric positive definite equations of nodes that have twelve unknowns each: A = `UᵀU` by blocks.
//!
//! A row of U is held from the node itself on. Eliminating a node makes the later ones of its row depend on one another,
//! and it is enough to hand that on to the first of them. Nodes in succession whose rows end alike are eliminated
//! together, so that a later block, which lies far off in memory, is fetched once for all of them. The first nodes are in
//! two parts that do not depend on each other, eliminated side by side; the last nodes separate them.
//!
//! # Source
//! George, Liu, "Computer solution of large sparse positive definite systems", 1981, chapter 5.

use std::cmp::Reverse;
use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use crate::algebra::dense::{multiplied_and_added, subtract};
use crate::error::{Error, Result, System};

/// Unknowns of a node.
pub const UNKNOWNS: usize = 12;

/// What two nodes have in common: rows of the first, columns of the last.
pub type Block = [[f64; UNKNOWNS]; UNKNOWNS];

/// Unknowns of one node.
pub type Unknowns = [f64; UNKNOWNS];

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
    /// The two parts and the nodes that separate them.
    parts: [Range<usize>; PARTS],
}

/// The two that do not depend on each other, and the last.
pub const PARTS: usize = 3;

/// Equations of successive nodes, and later U and the right side of what is left.
struct Window {
    first_node: usize,
    first_block: usize,
    blocks: Vec<Block>,
    right: Vec<Unknowns>,
}

/// Equations of a part, and what it adds to those of the nodes that separate it from the other.
pub struct Section {
    own: Window,
    last: Window,
}

impl Section {
    /// One of its blocks, or of those of the last part.
    #[inline(always)]
    pub fn block(&mut self, number: u32) -> &mut Block {
        let number = number as usize;
        match number.checked_sub(self.last.first_block) {
            Some(i) => &mut self.last.blocks[i],
            None => &mut self.own.blocks[number - self.own.first_block],
        }
    }

    /// The right side at one of its nodes, or of those of the last part.
    #[inline(always)]
    pub fn right(&mut self, node: u32) -> &mut Unknowns {
        let node = node as usize;
        match node.checked_sub(self.last.first_node) {
            Some(i) => &mut self.last.right[i],
            None => &mut self.own.right[node - self.own.first_node],
        }
    }
}

impl BlockEquations {
    /// Of nodes in the order in which they are eliminated, `ends` those of the three parts, and pairs that depend on one
    /// another, the last of both first.
    #[must_use]
    pub fn new(ends: [usize; PARTS], pairs: &[(u32, u32)]) -> Self {
        let nodes = ends[PARTS - 1];
        let (mut starts, mut columns) = (vec![0], Vec::new());
        for row in rows(nodes, pairs) {
            columns.extend(row);
            starts.push(columns.len());
        }
        let row = |node: usize| &columns[starts[node]..starts[node + 1]];
        let mut groups = vec![0];
        for node in 1..nodes {
            let first = groups[groups.len() - 1];
            let alike = row(node) == &row(node - 1)[1..];
            if !alike || node - first == TOGETHER || ends.contains(&node) {
                groups.push(node);
            }
        }
        groups.push(nodes);
        Self {
            starts,
            columns,
            groups,
            parts: [0..ends[0], ends[0]..ends[1], ends[1]..nodes],
        }
    }

    /// Number of the block of two nodes that depend on one another, `last` not before `first`.
    #[must_use]
    pub fn block(&self, last: u32, first: u32) -> u32 {
        let [from, to] = [0, 1].map(|i| self.starts[first as usize + i]);
        (from + self.columns[from..to].partition_point(|&node| node < last)) as u32
    }

    /// The part of a node.
    #[must_use]
    pub fn part(&self, node: u32) -> usize {
        self.parts.partition_point(|part| part.end <= node as usize)
    }

    /// The solution, where `add` adds the equations of each part: blocks and right sides at nodes of which the first is in
    /// the part.
    ///
    /// # Errors
    /// [`Error::NotFactorised`] where the equations are not positive definite.
    pub fn solve(&self, add: impl Fn(usize, &mut Section) + Sync) -> Result<Vec<Unknowns>> {
        let [_, second, last] = &self.parts;
        let eliminated = |part: usize, own: Window, last: Window| -> Result<Section> {
            Arch::new().dispatch(Elimination {
                equations: self,
                part,
                section: Section { own, last },
                add: &add,
            })
        };
        let half =
            |part: usize| eliminated(part, self.window(&self.parts[part]), self.window(last));
        let (one, other) = rayon::join(|| half(0), || half(1));
        let (one, other) = (one?, other?);
        let mut both = one.last;
        both.add(&other.last);
        let both = eliminated(2, both, self.window(&(last.end..last.end)))?.own;

        let mut found = vec![[0.0; UNKNOWNS]; last.end];
        let (halves, found_last) = found.split_at_mut(last.start);
        let (found_first, found_second) = halves.split_at_mut(second.start);
        let back = |window: &Window, found: &mut [Unknowns], after: &[Unknowns]| {
            Arch::new().dispatch(BackSubstitution {
                equations: self,
                window,
                found,
                after,
            });
        };
        back(&both, found_last, &[]);
        rayon::join(
            || back(&one.own, found_first, found_last),
            || back(&other.own, found_second, found_last),
        );
        Ok(found)
    }

    /// Zeros.
    fn window(&self, nodes: &Range<usize>) -> Window {
        let blocks = self.starts[nodes.start]..self.starts[nodes.end];
        Window {
            first_node: nodes.start,
            first_block: blocks.start,
            blocks: vec![[[0.0; UNKNOWNS]; UNKNOWNS]; blocks.len()],
            right: vec![[0.0; UNKNOWNS]; nodes.len()],
        }
    }

    /// U and `U⁻ᵀ` times the right side of a part, and what is left for the last one.
    #[inline(always)]
    fn eliminate<const FUSED: bool>(
        &self,
        part: &Range<usize>,
        section: &mut Section,
    ) -> Result<()> {
        let Section { own, last } = section;
        let base = own.first_block;
        let group_of = |node: usize| self.groups.partition_point(|&first| first < node);
        for group in self.groups[group_of(part.start)..=group_of(part.end)].windows(2) {
            let nodes = group[0]..group[1];
            for node in nodes.clone() {
                let (from, to) = (self.starts[node] - base, self.starts[node + 1] - base);
                let (before, later) = own.blocks.split_at_mut(to);
                let Some((diagonal, row)) = before[from..].split_first_mut() else {
                    continue;
                };
                if !cholesky::<FUSED>(diagonal) {
                    return Err(Error::NotFactorised {
                        of: System::Deformation,
                        reason: format!("a pivot of node {node} is not positive"),
                    });
                }
                let mut right = own.right[node - part.start].map(|x| [x]);
                substitute_forward::<_, FUSED>(diagonal, &mut right);
                own.right[node - part.start] = right.map(|[x]| x);
                for (block, &column) in row.iter_mut().zip(&self.columns[base + from + 1..]) {
                    substitute_forward::<_, FUSED>(diagonal, block);
                    let column = column as usize;
                    let later = if column < part.end {
                        &mut own.right[column - part.start]
                    } else {
                        &mut last.right[column - last.first_node]
                    };
                    for ([x], line) in right.iter().zip(block.iter()) {
                        subtract::<_, FUSED>(later, *x, line);
                    }
                }
                // The rest of the group has the same columns from its own on.
                let mut at = 0;
                for i in 0..nodes.end - node - 1 {
                    for other in &row[i..] {
                        subtract_products::<FUSED>(&mut later[at], &[(&row[i], other)].into_iter());
                        at += 1;
                    }
                }
            }
            let end = self.starts[nodes.end];
            let (done, later) = own.blocks.split_at_mut(end - base);
            let below = |node: usize| &done[self.starts[node] - base..][nodes.end - node..];
            let columns = &self.columns[self.starts[nodes.end - 1] + 1..end];
            for (i, &node) in columns.iter().enumerate() {
                let mut at = self.starts[node as usize];
                for (j, &column) in columns.iter().enumerate().skip(i) {
                    while self.columns[at] < column {
                        at += 1;
                    }
                    let block = if (node as usize) < part.end {
                        &mut later[at - end]
                    } else {
                        &mut last.blocks[at - last.first_block]
                    };
                    let rows = nodes.clone().map(|node| (&below(node)[i], &below(node)[j]));
                    subtract_products::<FUSED>(block, &rows);
                }
            }
        }
        Ok(())
    }

    /// The solution at the nodes of a window, given that at the last ones after them.
    #[inline(always)]
    fn substitute_back<const FUSED: bool>(
        &self,
        window: &Window,
        found: &mut [Unknowns],
        after: &[Unknowns],
    ) {
        let (first, base) = (window.first_node, window.first_block);
        let last = self.parts[PARTS - 1].start;
        for i in (0..found.len()).rev() {
            let row = self.starts[first + i]..self.starts[first + i + 1];
            // Column by column, so that the products of a row do not wait for one another.
            let mut known = [[0.0; UNKNOWNS]; UNKNOWNS];
            for at in row.clone().skip(1) {
                let column = self.columns[at] as usize;
                let later = if column < first + found.len() {
                    &found[column - first]
                } else {
                    &after[column - last]
                };
                for (known, line) in known.iter_mut().zip(&window.blocks[at - base]) {
                    for ((sum, u), x) in known.iter_mut().zip(line).zip(later) {
                        *sum = multiplied_and_added::<FUSED>(*u, *x, *sum);
                    }
                }
            }
            let mut own = window.right[i];
            for (rest, known) in own.iter_mut().zip(&known) {
                *rest -= known.iter().sum::<f64>();
            }
            let diagonal = &window.blocks[row.start - base];
            for m in (0..UNKNOWNS).rev() {
                let later = diagonal[m][m + 1..].iter().zip(&own[m + 1..]);
                let known: f64 = later.map(|(u, x)| u * x).sum();
                own[m] = (own[m] - known) / diagonal[m][m];
            }
            found[i] = own;
        }
    }
}

/// Equations of a part, added and eliminated.
struct Elimination<'a, F> {
    equations: &'a BlockEquations,
    part: usize,
    section: Section,
    add: &'a F,
}

impl<F: Fn(usize, &mut Section)> WithSimd for Elimination<'_, F> {
    type Output = Result<Section>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let Self {
            equations,
            part,
            mut section,
            add,
        } = self;
        add(part, &mut section);
        let nodes = &equations.parts[part];
        if S::IS_SCALAR {
            equations.eliminate::<false>(nodes, &mut section)?;
        } else {
            equations.eliminate::<true>(nodes, &mut section)?;
        }
        Ok(section)
    }
}

/// [`BlockEquations::substitute_back`] in vector registers.
struct BackSubstitution<'a> {
    equations: &'a BlockEquations,
    window: &'a Window,
    found: &'a mut [Unknowns],
    after: &'a [Unknowns],
}

impl WithSimd for BackSubstitution<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            equations,
            window,
            found,
            after,
        } = self;
        if S::IS_SCALAR {
            equations.substitute_back::<false>(window, found, after);
        } else {
            equations.substitute_back::<true>(window, found, after);
        }
    }
}

/// Nodes of each row of U, from pairs that depend on one another, the last of both first.
fn rows(nodes: usize, pairs: &[(u32, u32)]) -> Vec<Vec<u32>> {
    let mut rows: Vec<Vec<u32>> = (0..nodes as u32).map(|node| vec![node]).collect();
    for &(last, first) in pairs {
        rows[first as usize].push(last);
    }
    for node in 0..nodes {
        let mut row = std::mem::take(&mut rows[node]);
        row.sort_unstable();
        row.dedup();
        if let [_, next, rest @ ..] = row.as_slice() {
            rows[*next as usize].extend(rest);
        }
        rows[node] = row;
    }
    rows
}

/// The three parts of nodes that are numbered in an order of little fill, such that eliminating them part by part fills in
/// the same and takes least time where the first two are eliminated side by side.
///
/// A node's elimination concerns only those along its way to the root of the elimination tree, so that subtrees do
/// not depend on each other: the tree is opened from its roots, and subtrees go to the lighter part.
///
/// # Source
/// Liu, "The role of elimination trees in sparse factorization", 1990.
pub fn parts(nodes: usize, pairs: &[(u32, u32)]) -> Vec<usize> {
    let rows = rows(nodes, pairs);
    let own: Vec<usize> = rows.iter().map(|row| row.len() * row.len()).collect();
    let (mut within, mut children, mut roots) = (own.clone(), vec![Vec::new(); nodes], Vec::new());
    for (node, row) in rows.iter().enumerate() {
        if let [_, parent, ..] = row.as_slice() {
            within[*parent as usize] += within[node];
            children[*parent as usize].push(node);
        } else {
            roots.push(node);
        }
    }
    let (mut opened, mut best) = (0, (usize::MAX, Vec::new()));
    loop {
        roots.sort_by_key(|&node| Reverse(within[node]));
        let mut loads = [0; 2];
        let placed: Vec<(usize, usize)> = roots
            .iter()
            .map(|&root| {
                let lighter = usize::from(loads[1] < loads[0]);
                loads[lighter] += within[root];
                (root, lighter)
            })
            .collect();
        let time = opened + loads[0].max(loads[1]);
        if time < best.0 {
            best = (time, placed);
        }
        if roots.is_empty() {
            break;
        }
        let heaviest = roots.remove(0);
        opened += own[heaviest];
        roots.append(&mut children[heaviest].clone());
    }
    let mut part = vec![PARTS - 1; nodes];
    for (root, lighter) in best.1 {
        part[root] = lighter;
    }
    for node in (0..nodes).rev() {
        let this = part[node];
        for &child in children[node].iter().filter(|_| this + 1 < PARTS) {
            part[child] = this;
        }
    }
    part
}

impl Window {
    fn add(&mut self, other: &Self) {
        let blocks = self.blocks.iter_mut().zip(&other.blocks);
        for (sum, x) in blocks.flat_map(|(a, b)| a.iter_mut().flatten().zip(b.iter().flatten())) {
            *sum += x;
        }
        let right = self.right.iter_mut().zip(&other.right);
        for (sum, x) in right.flat_map(|(a, b)| a.iter_mut().zip(b)) {
            *sum += x;
        }
    }
}

/// U of `UᵀU`, above and on the diagonal; whether there is one.
#[inline(always)]
fn cholesky<const FUSED: bool>(block: &mut Block) -> bool {
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
        // What this leaves below the diagonal is not read.
        for r in m + 1..UNKNOWNS {
            subtract::<_, FUSED>(&mut block[r], line[r], &line);
        }
    }
    true
}

/// X of `UᵀX` = B in place of B, of any number of columns: row by row, each in registers until it is done.
#[inline(always)]
fn substitute_forward<const COLUMNS: usize, const FUSED: bool>(
    u: &Block,
    right: &mut [[f64; COLUMNS]; UNKNOWNS],
) {
    for m in 0..UNKNOWNS {
        let mut row = right[m];
        for before in 0..m {
            subtract::<_, FUSED>(&mut row, u[before][m], &right[before]);
        }
        let scale = 1.0 / u[m][m];
        for x in &mut row {
            *x *= scale;
        }
        right[m] = row;
    }
}

/// Subtracts the sum of `AᵀB`.
#[inline(always)]
fn subtract_products<'a, const FUSED: bool>(
    block: &mut Block,
    factors: &(impl Iterator<Item = (&'a Block, &'a Block)> + Clone),
) {
    for (first, rows) in block.chunks_exact_mut(ROWS_AT_ONCE).enumerate() {
        let mut left = [[0.0; UNKNOWNS]; ROWS_AT_ONCE];
        left.copy_from_slice(rows);
        for (a, b) in factors.clone() {
            for (a, line) in a.iter().zip(b) {
                for (r, left) in left.iter_mut().enumerate() {
                    subtract::<_, FUSED>(left, a[ROWS_AT_ONCE * first + r], line);
                }
            }
        }
        rows.copy_from_slice(&left);
    }
}

#[cfg(test)]
mod tests {
    use faer::Mat;

    use super::*;

    #[test]
    fn equations_in_blocks_are_those_of_a_dense_matrix() {
        // Two rings of nodes, one with a link across, each with neighbours among the last nodes, which all depend on one
        // another and are more than are eliminated together; blocks of any numbers with a strong diagonal.
        let ends = [7, 12, 22];
        let nodes = ends[2];
        let ring = |from: u32, to: u32| {
            (from..to).map(move |a| (a, if a + 1 < to { a + 1 } else { from }))
        };
        let dense = (12..nodes as u32).flat_map(|a| (a..nodes as u32).map(move |b| (a, b)));
        let mut pairs: Vec<(u32, u32)> = ring(0, 7)
            .chain(ring(7, 12))
            .chain((0..nodes as u32).map(|a| (a, a)))
            .chain([
                (1, 4),
                (2, 13),
                (5, 17),
                (6, 12),
                (8, 12),
                (9, 20),
                (11, 21),
            ])
            .chain(dense)
            .map(|(a, b)| (a.max(b), a.min(b)))
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        let equations = BlockEquations::new(ends, &pairs);
        assert!(equations.columns.len() > pairs.len());
        let sizes: Vec<usize> = equations.groups.windows(2).map(|g| g[1] - g[0]).collect();
        assert!(sizes.contains(&1) && sizes.contains(&TOGETHER) && sizes.len() > 3);
        assert_eq!(
            [0, 6, 7, 11, 12, 21].map(|node| equations.part(node)),
            [0, 0, 1, 1, 2, 2]
        );
        let n = UNKNOWNS * nodes;
        let value = |row: usize, column: usize| {
            let (low, high) = (row.min(column), row.max(column));
            ((low * 31 + high * 17) as f64).sin() + if row == column { 200.0 } else { 0.0 }
        };
        let at = |node: u32, i: usize| UNKNOWNS * node as usize + i;
        let mut matrix = Mat::zeros(n, n);
        for &(last, first) in &pairs {
            for i in 0..UNKNOWNS {
                for j in 0..UNKNOWNS {
                    let (row, column) = (at(first, i), at(last, j));
                    matrix[(row, column)] = value(row, column);
                    matrix[(column, row)] = value(row, column);
                }
            }
        }
        let truth: Vec<f64> = (0..n).map(|i| (0.7 * i as f64).cos()).collect();
        let right = &matrix * Mat::from_fn(n, 1, |i, _| truth[i]);
        let found = equations
            .solve(|part, section| {
                for &(last, first) in pairs.iter().filter(|pair| equations.part(pair.1) == part) {
                    let block = section.block(equations.block(last, first));
                    for (i, line) in block.iter_mut().enumerate() {
                        for (j, entry) in line.iter_mut().enumerate() {
                            *entry += value(at(first, i), at(last, j));
                        }
                    }
                }
                for node in (0..nodes as u32).filter(|&node| equations.part(node) == part) {
                    for (i, y) in section.right(node).iter_mut().enumerate() {
                        *y += right[(at(node, i), 0)];
                    }
                }
            })
            .expect("regular");
        for (found, truth) in found.iter().flatten().zip(&truth) {
            // Rounding of sums of 264 numbers up to 200, relative to eigenvalues of 8 and more.
            assert!((found - truth).abs() < 1e-12, "{found} {truth}");
        }
    }
}
