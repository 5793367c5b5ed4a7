//! A garment as a graph: vertices at one place are one, pieces are what edges connect.

use super::outside::welded;
use crate::algebra::unions::Unions;
use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};
use crate::transfer::settings::GARMENT;

/// Garments, one or several, joined at places that they share.
#[derive(Debug)]
pub struct Garment {
    /// Places, each once, `(n)`.
    pub places: Vec<Point>,
    /// Place of each given vertex.
    pub place_of: Vec<u32>,
    /// Triangles between places, without those that have two corners at one.
    pub triangles: Vec<[u32; 3]>,
    /// Edges between places, the lower number first, ascending.
    pub edges: Vec<[u32; 2]>,
    /// Pairs of triangles with an edge in common that are not folded onto one another.
    pub hinges: Vec<[u32; 2]>,
    /// Piece of each place, numbered from 0.
    pub piece_of: Vec<u32>,
    /// Number of pieces.
    pub pieces: usize,
}

impl Garment {
    /// Checks and joins.
    ///
    /// # Errors
    /// [`Error::NotFinite`], [`Error::FaceIndexOutOfRange`], [`Error::BadArgument`] without a vertex.
    pub fn new(vertices: &[Point], triangles: &[[i64; 3]]) -> Result<Self> {
        if vertices.is_empty() {
            return Err(Error::BadArgument {
                what: "the garment has no vertices: give one that has".into(),
            });
        }
        if let Some(vertex) = vertices
            .iter()
            .position(|p| p.iter().any(|x| !x.is_finite()))
        {
            return Err(Error::NotFinite { vertex });
        }
        let first = welded(vertices);
        let mut number = vec![0; vertices.len()];
        let mut places = Vec::new();
        let place_of: Vec<u32> = (0..vertices.len())
            .map(|v| {
                let at = first[v] as usize;
                if at == v {
                    number[v] = places.len() as u32;
                    places.push(vertices[v]);
                }
                number[at]
            })
            .collect();
        let mut joined = Vec::with_capacity(triangles.len());
        for (face, corners) in triangles.iter().enumerate() {
            for &index in corners {
                if index < 0 || index as usize >= vertices.len() {
                    return Err(Error::FaceIndexOutOfRange {
                        face,
                        index,
                        vertices: vertices.len(),
                    });
                }
            }
            let [a, b, c] = corners.map(|v| place_of[v as usize]);
            if a != b && b != c && c != a {
                joined.push([a, b, c]);
            }
        }
        let mut edges: Vec<[u32; 2]> = joined
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let mut unions = Unions::new(places.len());
        for &[a, b] in &edges {
            unions.unite(a, b);
        }
        let (mut piece_of, mut pieces) = (vec![0; places.len()], 0);
        for v in 0..places.len() as u32 {
            // The lowest number of a group stands for it, and has its piece already.
            let root = unions.root(v);
            if root == v {
                piece_of[v as usize] = pieces;
                pieces += 1;
            } else {
                piece_of[v as usize] = piece_of[root as usize];
            }
        }
        let hinges = hinges(&places, &joined);
        Ok(Self {
            places,
            place_of,
            triangles: joined,
            edges,
            hinges,
            piece_of,
            pieces: pieces as usize,
        })
    }

    /// The places of each piece, ascending.
    #[must_use]
    pub fn places_of_pieces(&self) -> Vec<Vec<u32>> {
        let mut places = vec![Vec::new(); self.pieces];
        for (v, &piece) in (0..).zip(&self.piece_of) {
            places[piece as usize].push(v);
        }
        places
    }

    /// The places of triangles that are folded onto a neighbour and were not when the garment was given, and of so many
    /// rings of edges around them.
    #[must_use]
    pub fn folds(&self, positions: &[Point], rings: usize) -> Vec<bool> {
        let mut marked = vec![false; positions.len()];
        for pair in &self.hinges {
            let triangles = pair.map(|t| self.triangles[t as usize]);
            let [a, b] = triangles.map(|t| normal(positions, t));
            if vector::dot(a, b) < GARMENT.folded {
                for v in triangles.as_flattened() {
                    marked[*v as usize] = true;
                }
            }
        }
        for _ in 0..rings {
            let before = marked.clone();
            for &[a, b] in &self.edges {
                marked[a as usize] |= before[b as usize];
                marked[b as usize] |= before[a as usize];
            }
        }
        marked
    }
}

fn normal(positions: &[Point], triangle: [u32; 3]) -> Point {
    let [a, b, c] = triangle.map(|v| positions[v as usize]);
    vector::normalised(vector::cross(vector::sub(b, a), vector::sub(c, a)))
}

/// Neighbours across an edge whose normals are less than a right angle apart; of three at an edge each and the next.
fn hinges(places: &[Point], triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut sides: Vec<([u32; 2], u32)> = (0..)
        .zip(triangles)
        .flat_map(|(t, &[a, b, c])| {
            [[a, b], [b, c], [c, a]].map(|[a, b]| ([a.min(b), a.max(b)], t))
        })
        .collect();
    sides.sort_unstable();
    sides
        .windows(2)
        .filter(|pair| pair[0].0 == pair[1].0)
        .map(|pair| [pair[0].1, pair[1].1])
        .filter(|pair| {
            let [a, b] = pair.map(|t| normal(places, triangles[t as usize]));
            vector::dot(a, b) > 0.0
        })
        .collect()
}
