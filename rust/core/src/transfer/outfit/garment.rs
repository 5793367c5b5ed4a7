//! A garment as a graph: vertices at one place are one, pieces are what edges connect.

use super::outside::welded;
use crate::algebra::vector::Point;
use crate::error::{Error, Result};
use crate::transfer::unions::Unions;

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
        Ok(Self {
            places,
            place_of,
            triangles: joined,
            edges,
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
}
