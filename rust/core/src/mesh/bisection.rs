//! A mesh of few vertices cut finer: more points on the same surface.
//!
//! Eigenfunctions are linear on triangles and images are sought among vertices; on a mesh of a thousand
//! vertices both are coarser than the surface itself.
//!
//! # Source
//! Rivara, "Algorithms for refining triangular grids suitable for adaptive and multigrid techniques", 1984.
//! Since the longest edge of all is always cut first, it is the longest of its triangles too.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use crate::algebra::vector::{self, Point};
use crate::mesh::Mesh;
use crate::mesh::surface_point::SurfacePoint;

/// Ends of an edge, the smaller id first.
type Edge = [u32; 2];

/// A triangle within one of the given mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    /// Face of the given mesh.
    pub face: u32,
    /// Its corners, each as weights of that face's corners.
    pub corners: [[f64; 3]; 3],
}

impl Piece {
    /// A point of the piece as a point of the given face.
    #[must_use]
    pub fn located(&self, weights: [f64; 3]) -> SurfacePoint {
        let along = |c: usize| -> f64 { (0..3).map(|i| weights[i] * self.corners[i][c]).sum() };
        SurfacePoint {
            face: self.face,
            // Rounding may go beyond.
            weights: [0, 1, 2].map(|c| along(c).min(1.0)),
        }
    }
}

/// A mesh cut finer.
#[derive(Debug)]
pub struct Bisected {
    /// Positions: those given, then midpoints of edges.
    pub vertices: Vec<Point>,
    /// Corners of the triangles, wound as those that they were cut from.
    pub faces: Vec<[u32; 3]>,
    /// Where each triangle lies.
    pub pieces: Vec<Piece>,
    /// Given vertex of each vertex; of a midpoint one that is close.
    pub close: Vec<u32>,
    /// Faces at each edge.
    around: HashMap<Edge, Vec<u32>>,
    /// Edges by their length.
    longest: BinaryHeap<(u64, Reverse<Edge>)>,
}

/// Cuts the longest edge at its middle until there are `wanted` vertices.
#[must_use]
pub fn bisected(mesh: &Mesh, wanted: usize) -> Bisected {
    const WHOLE: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let count = mesh.faces.len() as u32;
    let mut fine = Bisected {
        vertices: mesh.vertices.clone(),
        faces: mesh.faces.clone(),
        pieces: (0..count)
            .map(|face| Piece {
                face,
                corners: WHOLE,
            })
            .collect(),
        close: (0..mesh.vertices.len() as u32).collect(),
        around: HashMap::new(),
        longest: BinaryHeap::new(),
    };
    for (face, [a, b, c]) in (0..).zip(&mesh.faces) {
        for ends in [[a, b], [b, c], [c, a]] {
            fine.join(ends.map(|v| *v), face);
        }
    }
    while fine.vertices.len() < wanted
        && let Some((_, Reverse(edge))) = fine.longest.pop()
    {
        fine.cut(edge);
    }
    fine
}

impl Bisected {
    /// Notes that a face lies at an edge.
    fn join(&mut self, ends: [u32; 2], face: u32) {
        let edge = sorted(ends);
        let faces = self.around.entry(edge).or_default();
        if faces.is_empty() {
            let [a, b] = edge.map(|v| self.vertices[v as usize]);
            // Lengths are not negative, so their bits are in their order.
            let length = vector::distance(a, b).to_bits();
            self.longest.push((length, Reverse(edge)));
        }
        faces.push(face);
    }

    /// Cuts an edge at its middle, and the faces beside it in two.
    fn cut(&mut self, edge: Edge) {
        let [a, b] = edge.map(|v| self.vertices[v as usize]);
        let middle = self.vertices.len() as u32;
        self.vertices.push(vector::scaled(vector::add(a, b), 0.5));
        self.close.push(self.close[edge[0] as usize]);
        for face in self.around.remove(&edge).unwrap_or_default() {
            let corners = self.faces[face as usize];
            let Some(side) = (0..3).find(|&i| sorted([corners[i], corners[(i + 1) % 3]]) == edge)
            else {
                unreachable!("a face lies at its own edges")
            };
            let [from, to, apex] = [0, 1, 2].map(|i| corners[(side + i) % 3]);
            let piece = self.pieces[face as usize];
            let [p, q, r] = [0, 1, 2].map(|i| piece.corners[(side + i) % 3]);
            let m = [0, 1, 2].map(|c| f64::midpoint(p[c], q[c]));

            let new = self.faces.len() as u32;
            self.faces[face as usize] = [from, middle, apex];
            self.faces.push([middle, to, apex]);
            self.pieces[face as usize].corners = [p, m, r];
            self.pieces.push(Piece {
                corners: [m, q, r],
                ..piece
            });
            if let Some(beside) = self.around.get_mut(&sorted([to, apex])) {
                for known in beside.iter_mut().filter(|known| **known == face) {
                    *known = new;
                }
            }
            self.join([from, middle], face);
            self.join([middle, to], new);
            self.join([middle, apex], face);
            self.join([middle, apex], new);
        }
    }
}

fn sorted([a, b]: [u32; 2]) -> Edge {
    [a.min(b), a.max(b)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of a helicoid, which is open, with triangles of many sizes.
    fn strip() -> Mesh {
        let vertices: Vec<Point> = (0..40)
            .map(|i| {
                let (turn, out) = (f64::from(i / 4).powf(1.3) / 5.0, f64::from(i % 4));
                [out * turn.cos(), out * turn.sin(), turn]
            })
            .collect();
        let faces: Vec<[i64; 3]> = (0..9i64)
            .flat_map(|i| (0..3).map(move |j| 4 * i + j))
            .flat_map(|v| [[v, v + 1, v + 4], [v + 1, v + 5, v + 4]])
            .collect();
        Mesh::new(&vertices, &faces).expect("a sound mesh")
    }

    #[test]
    fn the_surface_stays_and_each_piece_knows_its_place() {
        let mesh = strip();
        let fine = bisected(&mesh, 500);
        assert_eq!(fine.vertices.len(), 500);
        assert_eq!(fine.vertices[..40], mesh.vertices[..]);
        let mut covered = vec![0.0; mesh.faces.len()];
        for (corners, piece) in fine.faces.iter().zip(&fine.pieces) {
            let places = corners.map(|v| fine.vertices[v as usize]);
            for (i, place) in places.into_iter().enumerate() {
                let mut weights = [0.0; 3];
                weights[i] = 1.0;
                let on_given = piece.located(weights);
                let given = mesh.faces[on_given.face as usize].map(|v| mesh.vertices[v as usize]);
                let there = (0..3).fold([0.0; 3], |sum, c| {
                    vector::add(sum, vector::scaled(given[c], on_given.weights[c]))
                });
                // Rounding.
                assert!(vector::distance(place, there) < 1e-14);
            }
            let [a, b, c] = places;
            let across = vector::cross(vector::sub(b, a), vector::sub(c, a));
            // Same side up as the face.
            let normal = {
                let [a, b, c] = mesh.faces[piece.face as usize].map(|v| mesh.vertices[v as usize]);
                vector::cross(vector::sub(b, a), vector::sub(c, a))
            };
            assert!(vector::dot(across, normal) > 0.0);
            covered[piece.face as usize] += vector::norm(across) / 2.0;
        }
        for (face, area) in covered.into_iter().enumerate() {
            assert!((area - mesh.face_area(face)).abs() < 1e-14);
        }
    }

    #[test]
    fn neighbours_meet_at_whole_edges_and_none_is_longer_than_those_that_were_cut() {
        let mesh = strip();
        let fine = bisected(&mesh, 500);
        let checked = Mesh::new(
            &fine.vertices,
            &fine
                .faces
                .iter()
                .map(|f| f.map(i64::from))
                .collect::<Vec<_>>(),
        )
        .expect("a sound mesh");
        // A vertex amid a neighbour's edge would open a hole.
        let euler = |m: &Mesh| {
            let edges = m.vertex_neighbours().entries.len() / 2;
            m.vertices.len() + m.faces.len() - edges
        };
        assert_eq!(euler(&checked), euler(&mesh));
        let lengths = |vertices: &[Point], faces: &[[u32; 3]]| -> Vec<f64> {
            let sides = faces.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
            sides
                .map(|[a, b]| vector::distance(vertices[a as usize], vertices[b as usize]))
                .collect()
        };
        let longest = |lengths: Vec<f64>| lengths.into_iter().fold(0.0, f64::max);
        let mean = |lengths: &[f64]| lengths.iter().sum::<f64>() / lengths.len() as f64;
        let after = lengths(&fine.vertices, &fine.faces);
        assert!(mean(&after) < 0.5 * mean(&lengths(&mesh.vertices, &mesh.faces)));
        // Uniform: no edge is left that is far longer than the others.
        assert!(longest(after.clone()) < 2.5 * mean(&after));
    }
}
