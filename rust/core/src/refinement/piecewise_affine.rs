//! A surface that is deformed by affine maps, one around each of some hundred nodes, that change little from
//! node to node, or much between few.
//!
//! A limb of another build is longer and thicker as a whole, and a limb in another pose is turned as a whole: what
//! brings one body onto another is affine on each part and changes where parts meet. Rigidity alone would keep
//! lengths that differ. With node j at gⱼ, a vertex p goes to Σ ωⱼ(p)(Aⱼ(p − gⱼ) + tⱼ), and
//!
//! Σ xᵥᵀMᵥxᵥ − 2xᵥᵀbᵥ + 2μεh² Σ ρ(rᵢⱼ/h),
//! rᵢⱼ² = ‖tⱼ − tᵢ − ½(Aᵢ + Aⱼ)(gⱼ − gᵢ)‖² + h²‖Aⱼ − Aᵢ‖²
//!
//! is least, h the distance between nodes and ρ(r) = √(r² + ε²), which lets few changes be large: minimised by
//! least squares weighted anew in every round.
//!
//! # Source
//! Sumner, Schmid, Pauly, "Embedded deformation for shape manipulation", 2007, for the graph of nodes, here without
//! the rotations; Bredies, Kunisch, Pock, "Total generalized variation", 2010, for gradients whose changes are few.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use faer::prelude::*;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side};

use crate::error::{Error, Result};
use crate::mesh::Adjacency;
use crate::progress::Check;
use crate::vector::{self, Point};

/// Nodes that carry a vertex.
const NEAREST: usize = 4;
/// Unknowns of a node: the rows of A, each with its entry of t.
const UNKNOWNS: usize = 12;
/// Weight μ of the changes between neighbouring nodes beside what draws the vertices, at unit area; half and twice as
/// much change errors by up to a tenth, up on one pair and down on another.
const SMOOTHNESS: f64 = 1e-4;
/// ε: changes of less than this count by their squares. Between bodies of other build half of them are above.
const SMALL_CHANGE: f64 = 0.03;
/// Keeps the matrix regular where nothing draws.
const LEAST_PULL: f64 = 1e-10;

/// What draws a vertex: M, symmetric, and b, of which M⁻¹b is the place it is drawn to.
pub type Pull = ([Point; 3], Point);

/// A surface on its way to given places.
pub struct PiecewiseAffine {
    /// Nodes that carry each vertex, with ω(p − g) and ω.
    carried: Vec<[(u32, [f64; 4]); NEAREST]>,
    nodes: Vec<Point>,
    /// Neighbouring nodes.
    links: Vec<[u32; 2]>,
    /// Weight of each link by what it came to in the last round.
    held: Vec<f64>,
    /// Distance between nodes.
    spacing: f64,
    /// Pairs of nodes that share an entry, (row, column), sorted.
    blocks: Vec<(u32, u32)>,
    symbolic: Option<SymbolicLlt<usize>>,
}

impl PiecewiseAffine {
    /// A surface at rest with nodes at these vertices.
    #[must_use]
    pub fn new(rest: &[Point], neighbours: &Adjacency, nodes: &[u32]) -> Self {
        let near = nearest_nodes(rest, neighbours, nodes);
        let spacing = near
            .iter()
            .map(|found| found[0].1)
            .fold(f64::MIN_POSITIVE, f64::max);
        let at: Vec<Point> = nodes.iter().map(|&v| rest[v as usize]).collect();
        let carried: Vec<[(u32, [f64; 4]); NEAREST]> = rest
            .iter()
            .zip(&near)
            .map(|(&p, found)| {
                let mut shares = [0.0; NEAREST];
                for (share, &(_, away)) in shares.iter_mut().zip(found) {
                    *share = (-2.0 * (away / spacing).powi(2)).exp();
                }
                let total: f64 = shares.iter().sum();
                let mut carried = [(found[0].0, [0.0; 4]); NEAREST];
                for ((entry, &(node, _)), share) in carried.iter_mut().zip(found).zip(shares) {
                    let [x, y, z] = vector::sub(p, at[node as usize]);
                    *entry = (node, [x, y, z, 1.0].map(|value| value * share / total));
                }
                carried
            })
            .collect();
        let mut links: Vec<[u32; 2]> = (0..rest.len())
            .flat_map(|v| neighbours.row(v).iter().map(move |&u| [v, u as usize]))
            .map(|ends| ends.map(|v| near[v][0].0))
            .filter(|[a, b]| a < b)
            .collect();
        links.sort_unstable();
        links.dedup();
        let mut blocks: Vec<(u32, u32)> = carried
            .iter()
            .flat_map(|entries| {
                let nodes = entries.map(|(node, _)| node);
                nodes.into_iter().flat_map(move |a| nodes.map(|b| (a, b)))
            })
            .chain(links.iter().map(|&[a, b]| (b, a)))
            .chain((0..nodes.len() as u32).map(|a| (a, a)))
            .filter(|(row, column)| row >= column)
            .collect();
        blocks.sort_unstable();
        blocks.dedup();
        Self {
            held: vec![1.0; links.len()],
            carried,
            nodes: at,
            links,
            spacing,
            blocks,
            symbolic: None,
        }
    }

    /// Where the vertices come to lie, drawn by these pulls.
    ///
    /// # Errors
    /// [`Error::NotFactorised`], [`Error::Cancelled`].
    pub fn drawn_to(&mut self, pulls: &[Pull], check: Check<'_>) -> Result<Vec<Point>> {
        check()?;
        let (matrix, right) = self.system(pulls)?;
        check()?;
        let symbolic = match self.symbolic.take() {
            Some(known) => known,
            None => SymbolicLlt::try_new(matrix.symbolic(), Side::Lower)
                .map_err(Error::not_factorised)?,
        };
        let factor = Llt::try_new_with_symbolic(symbolic.clone(), matrix.as_ref(), Side::Lower)
            .map_err(Error::not_factorised)?;
        self.symbolic = Some(symbolic);
        let mut found = right;
        factor.solve_in_place(&mut found);
        let maps: Vec<[[f64; 4]; 3]> = (0..self.nodes.len())
            .map(|node| {
                [0, 1, 2].map(|c| [0, 1, 2, 3].map(|a| found[(UNKNOWNS * node + 4 * c + a, 0)]))
            })
            .collect();
        for (held, &link) in self.held.iter_mut().zip(&self.links) {
            let rows = link_rows(&self.nodes, link, self.spacing);
            let change: f64 = rows
                .iter()
                .flat_map(|row| {
                    let [a, b] = link.map(|node| maps[node as usize]);
                    [0, 1, 2].map(|c| dot4(row[0], a[c]) + dot4(row[1], b[c]))
                })
                .map(|change| change * change)
                .sum();
            let small = SMALL_CHANGE * self.spacing;
            *held = small / (change + small * small).sqrt();
        }
        Ok(self
            .carried
            .iter()
            .map(|entries| {
                [0, 1, 2].map(|c| {
                    let parts = entries
                        .iter()
                        .map(|(node, share)| dot4(*share, maps[*node as usize][c]));
                    parts.sum()
                })
            })
            .collect())
    }

    /// Normal equations of a round.
    fn system(&self, pulls: &[Pull]) -> Result<(SparseColMat<usize, f64>, Mat<f64>)> {
        let count = UNKNOWNS * self.nodes.len();
        let mut values = vec![[0.0; UNKNOWNS * UNKNOWNS]; self.blocks.len()];
        let mut right = Mat::<f64>::zeros(count, 1);
        let mut add =
            |(row, own): (u32, [f64; 4]), (column, other): (u32, [f64; 4]), m: &[Point; 3]| {
                if row < column {
                    return;
                }
                let Ok(block) = self.blocks.binary_search(&(row, column)) else {
                    return;
                };
                let block = &mut values[block];
                for (c, m) in m.iter().enumerate() {
                    for (a, x) in own.iter().enumerate() {
                        let line = &mut block[UNKNOWNS * (4 * c + a)..][..UNKNOWNS];
                        for (d, m) in m.iter().enumerate() {
                            for (out, y) in line[4 * d..].iter_mut().zip(other) {
                                *out += x * m * y;
                            }
                        }
                    }
                }
            };
        for (entries, (m, moment)) in self.carried.iter().zip(pulls) {
            for &own in entries {
                for &other in entries {
                    add(own, other, m);
                }
                for (c, y) in moment.iter().enumerate() {
                    for (a, x) in own.1.iter().enumerate() {
                        right[(UNKNOWNS * own.0 as usize + 4 * c + a, 0)] += x * y;
                    }
                }
            }
        }
        for (&link, held) in self.links.iter().zip(&self.held) {
            let weight = SMOOTHNESS * held;
            let m = [[weight, 0.0, 0.0], [0.0, weight, 0.0], [0.0, 0.0, weight]];
            for row in link_rows(&self.nodes, link, self.spacing) {
                let ends = [(link[0], row[0]), (link[1], row[1])];
                for own in ends {
                    for other in ends {
                        add(own, other, &m);
                    }
                }
            }
        }
        let mut entries = Vec::with_capacity(self.blocks.len() * UNKNOWNS * UNKNOWNS);
        for (&(row, column), block) in self.blocks.iter().zip(&values) {
            let (row, column) = (UNKNOWNS * row as usize, UNKNOWNS * column as usize);
            for (at, &value) in block.iter().enumerate() {
                let (i, j) = (row + at / UNKNOWNS, column + at % UNKNOWNS);
                if i >= j {
                    let least = if i == j { LEAST_PULL } else { 0.0 };
                    entries.push(Triplet::new(i, j, value + least));
                }
            }
        }
        let matrix = SparseColMat::try_new_from_triplets(count, count, &entries)
            .map_err(Error::not_factorised)?;
        Ok((matrix, right))
    }
}

/// Coefficients of both ends in what a link costs, four times a component: how far they disagree on the place between
/// them, and the change of A.
fn link_rows(nodes: &[Point], [a, b]: [u32; 2], spacing: f64) -> [[[f64; 4]; 2]; 4] {
    let [x, y, z] = vector::scaled(vector::sub(nodes[b as usize], nodes[a as usize]), -0.5);
    let unit = |i: usize, value: f64| {
        let mut row = [0.0; 4];
        row[i] = value;
        row
    };
    let turn = |i: usize| [unit(i, -spacing), unit(i, spacing)];
    [[[x, y, z, -1.0], [x, y, z, 1.0]], turn(0), turn(1), turn(2)]
}

fn dot4(a: [f64; 4], b: [f64; 4]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// The nodes nearest to each vertex along edges, with their distances.
fn nearest_nodes(rest: &[Point], neighbours: &Adjacency, nodes: &[u32]) -> Vec<Vec<(u32, f64)>> {
    // Distances are positive, so that their bits are in their order.
    let mut waiting: BinaryHeap<Reverse<(u64, u32, u32)>> = nodes
        .iter()
        .enumerate()
        .map(|(node, &v)| Reverse((0, node as u32, v)))
        .collect();
    let mut found: Vec<Vec<(u32, f64)>> = vec![Vec::with_capacity(NEAREST); rest.len()];
    while let Some(Reverse((bits, node, v))) = waiting.pop() {
        let (here, known) = (rest[v as usize], &mut found[v as usize]);
        if known.len() == NEAREST || known.iter().any(|(other, _)| *other == node) {
            continue;
        }
        let away = f64::from_bits(bits);
        known.push((node, away));
        for &u in neighbours.row(v as usize) {
            let there = away + vector::distance(here, rest[u as usize]);
            if found[u as usize].len() < NEAREST {
                waiting.push(Reverse((there.to_bits(), node, u)));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::Shape;
    use crate::testing::{RINGS, torus};

    fn towards(place: Point, weight: f64) -> Pull {
        let mut m = [[0.0; 3]; 3];
        for (c, row) in m.iter_mut().enumerate() {
            row[c] = weight;
        }
        (m, vector::scaled(place, weight))
    }

    fn surface(shape: &Shape) -> PiecewiseAffine {
        let mesh = &shape.mesh;
        PiecewiseAffine::new(&mesh.vertices, &shape.neighbours, shape.farthest_points(60))
    }

    #[test]
    fn an_affine_map_costs_nothing() {
        let shape = torus(RINGS);
        let stretched = |[x, y, z]: Point| [1.4 * x + 0.3 * y, 0.8 * y - 0.2 * z + 1.0, 2.0 * z];
        // Every seventh vertex tells where the others go.
        let pulls: Vec<Pull> = (0..)
            .zip(&shape.mesh.vertices)
            .map(|(v, &p)| towards(stretched(p), if v % 7 == 0 { 1e-3 } else { 0.0 }))
            .collect();
        let found = surface(&shape)
            .drawn_to(&pulls, &|| Ok(()))
            .expect("regular");
        for (&p, q) in shape.mesh.vertices.iter().zip(found) {
            // 1e-10 draws to zero, links of 1e-4·h² hold.
            assert!(vector::distance(stretched(p), q) < 1e-3);
        }
    }

    #[test]
    fn few_large_changes_cost_less_round_by_round() {
        let shape = torus(RINGS);
        // Half of the ring is stretched along its axis; the step between both halves is sharp.
        let bent = |[x, y, z]: Point| [x, y, if x > 0.0 { 1.5 * z } else { z }];
        let area = shape.mass.iter();
        let pulls: Vec<Pull> = area
            .zip(&shape.mesh.vertices)
            .map(|(a, &p)| towards(bent(p), 0.02 * a))
            .collect();
        let mut surface = surface(&shape);
        let mut off = || {
            let found = surface.drawn_to(&pulls, &|| Ok(())).expect("regular");
            let places = shape.mesh.vertices.iter().zip(found);
            places
                .map(|(&p, q)| vector::distance(bent(p), q))
                .sum::<f64>()
        };
        let first = off();
        let later = (0..6).map(|_| off()).last().expect("six rounds");
        assert!(later < 0.8 * first, "{later} {first}");
    }

    #[test]
    fn each_vertex_knows_its_nearest_nodes() {
        let shape = torus(RINGS);
        let nodes = shape.farthest_points(30);
        let found = nearest_nodes(&shape.mesh.vertices, &shape.neighbours, nodes);
        for (node, &v) in nodes.iter().enumerate() {
            assert_eq!(found[v as usize][0], (node as u32, 0.0));
        }
        for near in &found {
            assert_eq!(near.len(), NEAREST);
            assert!(near.windows(2).all(|pair| pair[0].1 <= pair[1].1));
        }
    }
}
