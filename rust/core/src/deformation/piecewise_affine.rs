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

use crate::algebra::sparse_factor::Pattern;
use crate::algebra::vector::{self, Point};
use crate::deformation::block_equations::{Block, BlockEquations, PARTS, Section, parts};
use crate::deformation::settings::PIECEWISE_AFFINE;
use crate::error::Result;
use crate::mesh::Adjacency;
use crate::watch::progress::Check;

/// Nodes that carry a vertex: with four the matrix has a third more entries, and errors are the same.
const NEAREST: usize = 3;
/// Pairs of nodes that carry a vertex, and each with itself.
const PAIRS: usize = NEAREST * (NEAREST + 1) / 2;

/// What draws a vertex: M, symmetric, and b, of which M⁻¹b is the place it is drawn to.
pub type Pull = ([Point; 3], Point);

/// A vertex.
#[derive(Debug)]
struct Carried {
    vertex: u32,
    /// Nodes that carry it, the last first, with ω(p − g) and ω.
    by: [(u32, [f64; 4]); NEAREST],
    /// Number of the block of each pair of these, in the order of two loops.
    blocks: [u32; PAIRS],
}

impl Carried {
    /// The node that is eliminated first.
    fn first_node(&self) -> u32 {
        self.by[NEAREST - 1].0
    }
}

/// The nodes nearest to a vertex, the nearest first, with their distances.
#[derive(Debug, Clone, Copy, Default)]
struct Near {
    nodes: [(u32, f64); NEAREST],
    count: usize,
}

impl Near {
    fn nodes(&self) -> &[(u32, f64)] {
        &self.nodes[..self.count]
    }

    /// Adds a node at a distance; whether it is one of the nearest, and nearer than was known.
    fn add(&mut self, node: u32, away: f64) -> bool {
        let known = self.nodes().iter().position(|&(other, _)| other == node);
        let mut place = match known {
            Some(place) => place,
            None if self.count < NEAREST => self.count,
            None => NEAREST - 1,
        };
        if place < self.count && self.nodes[place].1 <= away {
            return false;
        }
        self.count = self.count.max(place + 1);
        while place > 0 && self.nodes[place - 1].1 > away {
            self.nodes[place] = self.nodes[place - 1];
            place -= 1;
        }
        self.nodes[place] = (node, away);
        true
    }
}

/// Which nodes carry a surface, and how its equations are solved: what depends on its shape alone.
#[derive(Debug)]
pub struct DeformationGraph {
    /// The vertices, those whose first node is in one part of the equations and of these those that the same nodes carry
    /// one after the other, so that their equations stay in the cache.
    carried: Vec<Carried>,
    nodes: Vec<Point>,
    /// Neighbouring nodes, the last first, and the numbers of their three blocks.
    links: Vec<([u32; 2], [u32; 3])>,
    /// Distance between nodes.
    spacing: f64,
    equations: BlockEquations,
}

/// A surface on its way to given places.
pub struct PiecewiseAffine<'a> {
    graph: &'a DeformationGraph,
    /// Weight of each link by what it came to in the last round.
    held: Vec<f64>,
}

impl DeformationGraph {
    /// Of a surface at rest with nodes at these vertices.
    ///
    /// # Errors
    /// [`Error::NotFactorised`].
    pub fn new(rest: &[Point], neighbours: &Adjacency, nodes: &[u32]) -> Result<Self> {
        let mut near = nearest_nodes(rest, neighbours, nodes);
        let links = links(&near, neighbours);
        let pairs = pairs_of(nodes.len(), &near, &links);
        let (order, ends) = elimination_order(nodes.len(), &pairs)?;
        let number = numbers(&order);
        for (node, _) in near
            .iter_mut()
            .flat_map(|near| &mut near.nodes[..near.count])
        {
            *node = number[*node as usize];
        }
        let [mut links, pairs] = [links, pairs].map(|pairs| renumbered(&pairs, &number));
        links.sort_unstable();
        let nodes: Vec<Point> = order
            .iter()
            .map(|&old| rest[nodes[old as usize] as usize])
            .collect();
        let spacing = near
            .iter()
            .map(|near| near.nodes()[0].1)
            .fold(f64::MIN_POSITIVE, f64::max);
        let equations = BlockEquations::new(ends, &pairs);
        let mut carried: Vec<Carried> = (0..)
            .zip(rest.iter().zip(&near))
            .map(|(vertex, (&p, near))| {
                let by = carried_by(p, near.nodes(), &nodes, spacing);
                let mut pairs = (0..NEAREST).flat_map(|i| (i..NEAREST).map(move |j| (i, j)));
                Carried {
                    vertex,
                    by,
                    blocks: std::array::from_fn(|_| {
                        let (i, j) = pairs.next().unwrap_or_default();
                        equations.block(by[i].0, by[j].0)
                    }),
                }
            })
            .collect();
        carried.sort_by_key(|carried| (equations.part(carried.first_node()), carried.blocks));
        let links: Vec<([u32; 2], [u32; 3])> = links
            .into_iter()
            .map(|(a, b)| {
                let blocks = [(a, a), (a, b), (b, b)];
                (
                    [a, b],
                    blocks.map(|(last, first)| equations.block(last, first)),
                )
            })
            .collect();
        Ok(Self {
            carried,
            nodes,
            links,
            spacing,
            equations,
        })
    }

    /// Normal equations of a round of a part, and its right side, links weighted by `held`: the unknowns of a node are the rows of A, each with its
    /// entry of t.
    #[inline(always)]
    fn add_equations(&self, held: &[f64], pulls: &[Pull], part: usize, section: &mut Section) {
        let of_part = |node: u32| self.equations.part(node);
        let from = (self.carried).partition_point(|carried| of_part(carried.first_node()) < part);
        let to = (self.carried).partition_point(|carried| of_part(carried.first_node()) <= part);
        for carried in &self.carried[from..to] {
            let (m, moment) = &pulls[carried.vertex as usize];
            let mut numbers = carried.blocks.iter();
            for (i, (node, own)) in carried.by.iter().enumerate() {
                for ((_, other), &number) in carried.by[i..].iter().zip(&mut numbers) {
                    add(section.block(number), other, m, own);
                }
                let right = section.right(*node);
                for (c, y) in moment.iter().enumerate() {
                    for (a, x) in own.iter().enumerate() {
                        right[4 * c + a] += x * y;
                    }
                }
            }
        }
        for (&(link, [first, between, second]), held) in self.links.iter().zip(held) {
            if of_part(link[1]) != part {
                continue;
            }
            let weight = PIECEWISE_AFFINE.smoothness * held;
            let m = [[weight, 0.0, 0.0], [0.0, weight, 0.0], [0.0, 0.0, weight]];
            for [a, b] in link_rows(&self.nodes, link, self.spacing) {
                add(section.block(first), &a, &m, &a);
                add(section.block(between), &b, &m, &a);
                add(section.block(second), &b, &m, &b);
            }
        }
        for node in (0..self.nodes.len() as u32).filter(|&node| of_part(node) == part) {
            let own = section.block(self.equations.block(node, node));
            for (m, row) in own.iter_mut().enumerate() {
                row[m] += PIECEWISE_AFFINE.least_pull;
            }
        }
    }
}

impl<'a> PiecewiseAffine<'a> {
    /// A surface at rest.
    #[must_use]
    pub fn new(graph: &'a DeformationGraph) -> Self {
        Self {
            held: vec![1.0; graph.links.len()],
            graph,
        }
    }

    /// Where the vertices come to lie, drawn by these pulls.
    ///
    /// # Errors
    /// [`Error::NotFactorised`], [`Error::Cancelled`].
    pub fn drawn_to(&mut self, pulls: &[Pull], check: Check<'_>) -> Result<Vec<Point>> {
        check()?;
        let graph = self.graph;
        let found = graph.equations.solve(
            #[inline(always)]
            |part, section| graph.add_equations(&self.held, pulls, part, section),
        )?;
        let maps: Vec<[[f64; 4]; 3]> = found
            .iter()
            .map(|found| [0, 1, 2].map(|c| [0, 1, 2, 3].map(|a| found[4 * c + a])))
            .collect();
        for (held, &(link, _)) in self.held.iter_mut().zip(&graph.links) {
            let rows = link_rows(&graph.nodes, link, graph.spacing);
            let change: f64 = rows
                .iter()
                .flat_map(|row| {
                    let [a, b] = link.map(|node| maps[node as usize]);
                    [0, 1, 2].map(|c| dot4(row[0], a[c]) + dot4(row[1], b[c]))
                })
                .map(|change| change * change)
                .sum();
            let small = PIECEWISE_AFFINE.small_change * graph.spacing;
            *held = small / (change + small * small).sqrt();
        }
        let mut places = vec![[0.0; 3]; graph.carried.len()];
        for Carried { vertex, by, .. } in &graph.carried {
            places[*vertex as usize] = [0, 1, 2].map(|c| {
                let parts = by
                    .iter()
                    .map(|(node, share)| dot4(*share, maps[*node as usize][c]));
                parts.sum()
            });
        }
        Ok(places)
    }
}

/// Adds M ⊗ x yᵀ to a block.
#[inline(always)]
fn add(block: &mut Block, x: &[f64; 4], m: &[Point; 3], y: &[f64; 4]) {
    for c in 0..3 {
        for d in 0..3 {
            for a in 0..4 {
                let share = m[c][d] * x[a];
                let row = &mut block[4 * c + a];
                for b in 0..4 {
                    row[4 * d + b] += share * y[b];
                }
            }
        }
    }
}

/// The nodes in an order in which eliminating one after the other fills in little, from sorted pairs of them that depend on
/// one another, each with itself, and where its [parts] end.
fn elimination_order(nodes: usize, pairs: &[(u32, u32)]) -> Result<(Vec<u32>, [usize; PARTS])> {
    let columns = pairs.chunk_by(|a, b| a.0 == b.0);
    let columns = columns.map(|column| column.iter().map(|&(_, first)| first));
    let pattern = Pattern::new(columns, None)?;
    let found = pattern.ordering();
    let part = parts(nodes, &renumbered(pairs, &numbers(found)));
    let mut by_part: Vec<usize> = (0..nodes).collect();
    by_part.sort_by_key(|&number| part[number]);
    let order = by_part.iter().map(|&number| found[number]).collect();
    let ends = std::array::from_fn(|this| part.iter().filter(|&&part| part <= this).count());
    Ok((order, ends))
}

/// The number of each node in an order.
fn numbers(order: &[u32]) -> Vec<u32> {
    let mut number = vec![0; order.len()];
    for (new, &old) in (0..).zip(order) {
        number[old as usize] = new;
    }
    number
}

/// Pairs by the numbers of their nodes, the last of both first.
fn renumbered(pairs: &[(u32, u32)], number: &[u32]) -> Vec<(u32, u32)> {
    let pairs = pairs
        .iter()
        .map(|&(a, b)| [a, b].map(|node| number[node as usize]));
    pairs.map(|[a, b]| (a.max(b), a.min(b))).collect()
}

/// Nodes that carry a vertex together or are linked, the last first, and each with itself, sorted.
fn pairs_of(nodes: usize, near: &[Near], links: &[(u32, u32)]) -> Vec<(u32, u32)> {
    let own = (0..nodes as u32).map(|node| (node, node));
    let mut pairs: Vec<(u32, u32)> = own.chain(links.iter().copied()).collect();
    for near in near {
        for (i, &(a, _)) in near.nodes().iter().enumerate() {
            pairs.extend(near.nodes()[..i].iter().map(|&(b, _)| (a.max(b), a.min(b))));
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// Nodes, the last of both first, between whose vertices an edge leads.
fn links(near: &[Near], neighbours: &Adjacency) -> Vec<(u32, u32)> {
    let mut links: Vec<(u32, u32)> = (0..near.len())
        .flat_map(|v| neighbours.row(v).iter().map(move |&u| [v, u as usize]))
        .map(|ends| ends.map(|v| near[v].nodes()[0].0))
        .filter(|[a, b]| a > b)
        .map(|[a, b]| (a, b))
        .collect();
    links.sort_unstable();
    links.dedup();
    links
}

/// How the nodes near to a vertex carry it, the last first: ω(p − g) and ω of each.
fn carried_by(
    p: Point,
    near: &[(u32, f64)],
    nodes: &[Point],
    spacing: f64,
) -> [(u32, [f64; 4]); NEAREST] {
    let share = |away: f64| (-2.0 * (away / spacing).powi(2)).exp();
    let total: f64 = near.iter().map(|&(_, away)| share(away)).sum();
    let mut carried = [(near[0].0, [0.0; 4]); NEAREST];
    for (entry, &(node, away)) in carried.iter_mut().zip(near) {
        let [x, y, z] = vector::sub(p, nodes[node as usize]);
        *entry = (
            node,
            [x, y, z, 1.0].map(|value| value * share(away) / total),
        );
    }
    carried.sort_unstable_by_key(|&(node, _)| Reverse(node));
    carried
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

/// The nodes nearest to each vertex along edges, with their distances; fewer on a small piece.
fn nearest_nodes(rest: &[Point], neighbours: &Adjacency, nodes: &[u32]) -> Vec<Near> {
    let mut near = vec![Near::default(); rest.len()];
    // Distances are positive, so that their bits are in their order.
    let mut waiting = BinaryHeap::new();
    for (node, &v) in (0..).zip(nodes) {
        near[v as usize].add(node, 0.0);
        waiting.push(Reverse((0.0f64.to_bits(), node, v)));
    }
    while let Some(Reverse((bits, node, v))) = waiting.pop() {
        let (here, away) = (rest[v as usize], f64::from_bits(bits));
        // Others have turned out nearer, or a shorter way has.
        if !near[v as usize].nodes().contains(&(node, away)) {
            continue;
        }
        for &u in neighbours.row(v as usize) {
            let there = away + vector::distance(here, rest[u as usize]);
            if near[u as usize].add(node, there) {
                waiting.push(Reverse((there.to_bits(), node, u)));
            }
        }
    }
    near
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

    fn graph(shape: &Shape) -> DeformationGraph {
        let nodes = shape.farthest_points(60);
        DeformationGraph::new(&shape.mesh.vertices, &shape.neighbours, nodes).expect("a pattern")
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
        let found = PiecewiseAffine::new(&graph(&shape))
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
        let graph = graph(&shape);
        let mut surface = PiecewiseAffine::new(&graph);
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
            assert_eq!(found[v as usize].nodes()[0], (node as u32, 0.0));
        }
        // Lengths of the shortest ways from each node, which every edge leaves as they are.
        let rest = &shape.mesh.vertices;
        let mut ways = vec![vec![f64::INFINITY; rest.len()]; nodes.len()];
        for (away, &v) in ways.iter_mut().zip(nodes) {
            away[v as usize] = 0.0;
            let mut changed = true;
            while changed {
                changed = false;
                for v in 0..rest.len() {
                    for &u in shape.neighbours.row(v) {
                        let there = away[u as usize] + vector::distance(rest[u as usize], rest[v]);
                        changed |= there < away[v];
                        away[v] = away[v].min(there);
                    }
                }
            }
        }
        for (v, near) in found.iter().enumerate() {
            let mut truth: Vec<f64> = ways.iter().map(|away| away[v]).collect();
            truth.sort_by(f64::total_cmp);
            assert_eq!(near.nodes().len(), NEAREST);
            for (&(node, away), truth) in near.nodes().iter().zip(truth) {
                assert_eq!((away, away), (truth, ways[node as usize][v]));
            }
        }
    }
}
