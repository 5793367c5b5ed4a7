//! Data of edges: marks (seams, sharp edges, creases) as curves, all else from the nearest edge.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use rayon::prelude::*;

use crate::algebra::space_tree::SpaceTree;
use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};
use crate::mesh::Adjacency;
use crate::transfer::settings::CURVES;
use crate::transfer::surface::Surface;
use crate::transfer::surface_map::{SurfaceMap, check_rows};

/// A part of a marked curve of the source: positions and the values of its edges.
struct Piece {
    points: Vec<Point>,
    values: Vec<f64>,
}

/// Values of the target's edges; zero where no marked curve runs.
///
/// Marked edges of the source (value above zero) hang together in curves. Each is followed on the
/// target by the way along edges that stays nearest to it, between the vertices whose images are
/// nearest to its ends. An edge takes the value of the nearest edge of its curve.
///
/// # Errors
/// [`Error::BadArgument`] when an edge names a missing vertex or values do not fit.
pub fn carried_marks(
    map: &SurfaceMap,
    source_edges: &[[i64; 2]],
    values: &[f64],
    target_edges: &[[i64; 2]],
) -> Result<Vec<f64>> {
    check_rows("values", values.len(), source_edges.len())?;
    check_edges(map, source_edges, target_edges)?;
    let marked: Vec<([u32; 2], f64)> = source_edges
        .iter()
        .zip(values)
        .filter(|(e, v)| **v > 0.0 && e[0] != e[1])
        .map(|(e, &v)| (e.map(|v| v as u32), v))
        .collect();
    let mut carried = vec![0.0; target_edges.len()];
    if marked.is_empty() {
        return Ok(carried);
    }
    let pieces = pieces(&marked, &map.source.vertices);
    let graph = Graph::new(map, target_edges);
    let tree = SpaceTree::new(map.images());
    let ways: Vec<Vec<(u32, f64)>> = pieces
        .par_iter()
        .map(|piece| graph.follow(piece, &tree))
        .collect();
    for (edge, value) in ways.into_iter().flatten() {
        let at: &mut f64 = &mut carried[edge as usize];
        *at = at.max(value);
    }
    Ok(carried)
}

/// The edge of the source from which each edge of the target takes its value: the nearest to the
/// middle of its image, of those that run like it and are no farther off than it is long.
///
/// # Errors
/// [`Error::BadArgument`] when an edge names a missing vertex or the source has none.
pub fn nearest_edges(
    map: &SurfaceMap,
    source_edges: &[[i64; 2]],
    target_edges: &[[i64; 2]],
) -> Result<Vec<u32>> {
    check_edges(map, source_edges, target_edges)?;
    if source_edges.is_empty() {
        return Err(Error::BadArgument {
            what: "the source has no edges".to_owned(),
        });
    }
    // Triangles without width: the tree of a surface finds the nearest edge.
    let flat: Vec<[i64; 3]> = source_edges.iter().map(|&[a, b]| [a, b, b]).collect();
    let edges = Surface::new(map.source.vertices.clone(), &flat)?;
    let way = |[a, b, _]: [Point; 3]| vector::normalised(vector::sub(b, a));
    let images = map.images();
    Ok(target_edges
        .par_iter()
        .map(|edge| {
            let [a, b] = edge.map(|v| images[v as usize]);
            let middle = vector::scaled(vector::add(a, b), 0.5);
            let own = way([a, b, b]);
            // An edge whose ends have one image runs nowhere.
            let alike = |e: u32| {
                own == [0.0; 3] || vector::dot(own, way(edges.corners(e))).abs() >= CURVES.alike
            };
            let nearest = edges.nearest(middle);
            // Farther off than its own length it is another place.
            let off = vector::distance(edges.position(&nearest), middle);
            let near = off + vector::distance(a, b);
            edges
                .nearest_within(middle, near, alike)
                .unwrap_or(nearest)
                .face
        })
        .collect())
}

fn check_edges(
    map: &SurfaceMap,
    source_edges: &[[i64; 2]],
    target_edges: &[[i64; 2]],
) -> Result<()> {
    for (name, edges, n) in [
        ("source", source_edges, map.source.vertices.len()),
        ("target", target_edges, map.target.vertices.len()),
    ] {
        if let Some(edge) = edges
            .iter()
            .position(|e| e.iter().any(|&v| v < 0 || v as usize >= n))
        {
            return Err(Error::BadArgument {
                what: format!("edge {edge} of the {name} names a vertex beyond its {n}"),
            });
        }
    }
    Ok(())
}

/// Cuts marked edges into curves between branches and ends, and long or closed ones further.
fn pieces(marked: &[([u32; 2], f64)], positions: &[Point]) -> Vec<Piece> {
    let mut around: HashMap<u32, Vec<usize>> = HashMap::new();
    for (i, (edge, _)) in marked.iter().enumerate() {
        for &v in edge {
            around.entry(v).or_default().push(i);
        }
    }
    let mut used = vec![false; marked.len()];
    let mut found = Vec::new();
    let mut nodes: Vec<u32> = around
        .iter()
        .filter(|(_, edges)| edges.len() != 2)
        .map(|(&v, _)| v)
        .collect();
    nodes.sort_unstable();
    // Curves from branches and ends first; what is left then is closed.
    let closed = marked.iter().map(|(e, _)| e[0]);
    for start in nodes.into_iter().chain(closed) {
        for &first in &around[&start] {
            let (mut vertex, mut edge) = (start, first);
            let mut way = vec![start];
            let mut values = Vec::new();
            while !used[edge] {
                used[edge] = true;
                let [a, b] = marked[edge].0;
                vertex = if vertex == a { b } else { a };
                way.push(vertex);
                values.push(marked[edge].1);
                let here = &around[&vertex];
                if here.len() != 2 {
                    break;
                }
                edge = if here[0] == edge { here[1] } else { here[0] };
            }
            if values.is_empty() {
                continue;
            }
            let is_loop = way.first() == way.last();
            let count = values
                .len()
                .div_ceil(CURVES.longest_piece)
                .max(if is_loop { CURVES.loop_pieces } else { 1 })
                .min(values.len());
            for i in 0..count {
                let (b, e) = (i * values.len() / count, (i + 1) * values.len() / count);
                found.push(Piece {
                    points: way[b..=e].iter().map(|&v| positions[v as usize]).collect(),
                    values: values[b..e].to_vec(),
                });
            }
        }
    }
    found
}

/// The target's edges, with lengths measured between images.
struct Graph<'a> {
    images: &'a [Point],
    edges: &'a [[i64; 2]],
    around: Adjacency,
    mean_length: f64,
}

impl<'a> Graph<'a> {
    fn new(map: &'a SurfaceMap, edges: &'a [[i64; 2]]) -> Self {
        let images = map.images();
        let around = Adjacency::from_lists(
            images.len(),
            edges
                .iter()
                .enumerate()
                .flat_map(|(e, ends)| ends.map(|v| (v as u32, e as u32))),
        );
        let total: f64 = edges
            .iter()
            .map(|e| vector::distance(images[e[0] as usize], images[e[1] as usize]))
            .sum();
        Self {
            images,
            edges,
            around,
            mean_length: (total / edges.len().max(1) as f64).max(f64::MIN_POSITIVE),
        }
    }

    /// Edges of the best way along a piece, with their values.
    fn follow(&self, piece: &Piece, tree: &SpaceTree<'_>) -> Vec<(u32, f64)> {
        let ends = [piece.points[0], piece.points[piece.points.len() - 1]];
        let [Some(start), Some(goal)] = ends.map(|p| tree.nearest(p)) else {
            return Vec::new();
        };
        let mut cost: HashMap<u32, (f64, u32)> = HashMap::from([(start, (0.0, u32::MAX))]);
        let mut heap = BinaryHeap::from([Reverse((Key(0.0), start))]);
        while let Some(Reverse((Key(so_far), vertex))) = heap.pop() {
            if vertex == goal {
                break;
            }
            if so_far > cost[&vertex].0 {
                continue;
            }
            for &edge in self.around.row(vertex as usize) {
                let [a, b] = self.edges[edge as usize].map(|v| v as u32);
                let other = if a == vertex { b } else { a };
                let total = so_far + self.cost(piece, edge);
                if cost.get(&other).is_none_or(|&(c, _)| total < c) {
                    cost.insert(other, (total, edge));
                    heap.push(Reverse((Key(total), other)));
                }
            }
        }
        let mut way = Vec::new();
        let mut vertex = goal;
        while vertex != start {
            let Some(&(_, edge)) = cost.get(&vertex) else {
                return Vec::new();
            };
            let [a, b] = self.edges[edge as usize];
            let middle = vector::scaled(
                vector::add(self.images[a as usize], self.images[b as usize]),
                0.5,
            );
            way.push((edge, piece.values[piece.nearest(middle).1]));
            vertex = if a as u32 == vertex {
                b as u32
            } else {
                a as u32
            };
        }
        way
    }

    fn cost(&self, piece: &Piece, edge: u32) -> f64 {
        let [a, b] = self.edges[edge as usize].map(|v| self.images[v as usize]);
        let middle = vector::scaled(vector::add(a, b), 0.5);
        // Vertices with one common image are still an edge apart.
        let length = vector::distance(a, b).max(1e-6 * self.mean_length);
        let [least, most] = [CURVES.counted_lengths.start(), CURVES.counted_lengths.end()]
            .map(|l| l * self.mean_length);
        let unit = length.clamp(least, most);
        let far: f64 = [a, middle, b]
            .iter()
            .map(|&p| (piece.nearest(p).0 / unit).powi(2))
            .sum();
        length * (far / 3.0 + CURVES.length_cost)
    }
}

impl Piece {
    /// Distance to the curve, and its nearest edge.
    fn nearest(&self, p: Point) -> (f64, usize) {
        self.points
            .windows(2)
            .map(|w| {
                let (way, offset) = (vector::sub(w[1], w[0]), vector::sub(p, w[0]));
                let square = vector::dot(way, way);
                let along = if square > 0.0 {
                    (vector::dot(way, offset) / square).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                vector::distance(offset, vector::scaled(way, along))
            })
            .enumerate()
            .map(|(i, d)| (d, i))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .expect("a piece has an edge")
    }
}

/// A cost with a total order.
#[derive(PartialEq)]
struct Key(f64);

impl Eq for Key {}

impl PartialOrd for Key {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Key {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}
