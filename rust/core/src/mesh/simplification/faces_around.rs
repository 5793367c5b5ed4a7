//! The faces around each vertex of a mesh that loses vertices.

use super::NONE;
use crate::mesh::Adjacency;

/// The faces around each vertex that are left. In rows, since what is linked can only be fetched one after the other.
pub(super) struct FacesAround {
    /// Start and length of each row.
    places: Vec<(u32, u32)>,
    faces: Vec<u32>,
    /// A row that is put together.
    joined: Vec<u32>,
}

impl FacesAround {
    /// The last faces first.
    pub(super) fn new(vertices: usize, faces: &[[u32; 3]]) -> Self {
        let faces = faces.iter().enumerate().rev();
        let corners = faces.flat_map(|(face, corners)| corners.map(|v| (v, face as u32)));
        let Adjacency { starts, entries } = Adjacency::from_lists(vertices, corners);
        Self {
            places: starts.windows(2).map(|w| (w[0], w[1] - w[0])).collect(),
            faces: entries,
            joined: Vec::new(),
        }
    }

    /// The row of `v`.
    pub(super) fn of(&self, v: u32) -> &[u32] {
        let (start, count) = self.places[v as usize];
        &self.faces[start as usize..][..count as usize]
    }

    /// Takes a face out of the row of `v`.
    pub(super) fn remove(&mut self, face: u32, v: u32) {
        let (start, count) = &mut self.places[v as usize];
        let row = &mut self.faces[*start as usize..][..*count as usize];
        if let Some(at) = row.iter().position(|&f| f == face) {
            row.copy_within(at + 1.., at);
            *count -= 1;
        }
    }

    /// Moves the row of `u` in front of that of `v`, without the faces that are not `left`.
    pub(super) fn join(&mut self, u: u32, v: u32, left: impl Fn(u32) -> bool) {
        let mut joined = std::mem::take(&mut self.joined);
        joined.clear();
        for w in [u, v] {
            joined.extend(self.of(w).iter().filter(|&&face| left(face)));
        }
        let old = self.places[v as usize];
        let start = if joined.len() <= old.1 as usize {
            old.0 as usize
        } else {
            self.faces.resize(self.faces.len() + joined.len(), NONE);
            self.faces.len() - joined.len()
        };
        self.faces[start..][..joined.len()].copy_from_slice(&joined);
        self.places[u as usize].1 = 0;
        self.places[v as usize] = (start as u32, joined.len() as u32);
        self.joined = joined;
    }
}
