//! Connected pieces of a soup, wound to face outwards.

use crate::algebra::vector::{self, Point};
use crate::mesh::edge_faces;

const NONE: u32 = u32::MAX;

/// Connected pieces of faces.
#[derive(Debug)]
pub(super) struct Pieces {
    /// Piece of each face.
    pub of_face: Vec<u32>,
    /// Number of pieces.
    pub count: usize,
    /// Whether a face has to be turned to face outwards.
    pub turned: Vec<bool>,
}

/// Lowest number of the group of each vertex that faces connect.
fn roots(vertices: usize, faces: &[[u32; 3]]) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..vertices as u32).collect();
    let find = |parent: &mut Vec<u32>, mut v: u32| {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    };
    for &[a, b, c] in faces {
        for other in [b, c] {
            let (x, y) = (find(&mut parent, a), find(&mut parent, other));
            parent[x.max(y) as usize] = x.min(y);
        }
    }
    (0..vertices as u32).map(|v| find(&mut parent, v)).collect()
}

impl Pieces {
    /// Pieces by shared vertices, numbered by first face. Within a piece, faces that are connected across edges of two
    /// faces wind alike; each such patch faces the way in which its signed volume about its centroid is positive.
    pub fn of(vertices: &[Point], faces: &[[u32; 3]]) -> Self {
        let roots = roots(vertices.len(), faces);
        let mut number = vec![NONE; vertices.len()];
        let mut count = 0;
        let of_face = faces.iter().map(|f| {
            let own = &mut number[roots[f[0] as usize] as usize];
            if *own == NONE {
                *own = count;
                count += 1;
            }
            *own
        });
        let of_face = of_face.collect();
        Self {
            of_face,
            count: count as usize,
            turned: turned(vertices, faces),
        }
    }
}

fn turned(vertices: &[Point], faces: &[[u32; 3]]) -> Vec<bool> {
    // Faces across the edges of each, and whether both wind alike.
    let mut across = vec![[(NONE, false); 3]; faces.len()];
    let edges = edge_faces(faces.iter().copied());
    for run in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        if let [a, b] = run {
            for (own, other) in [(a, b), (b, a)] {
                let free = across[own.2 as usize].iter_mut().find(|(f, _)| *f == NONE);
                if let Some(free) = free {
                    *free = (other.2, a.3 != b.3);
                }
            }
        }
    }
    let mut turned: Vec<Option<bool>> = vec![None; faces.len()];
    for seed in 0..faces.len() {
        if turned[seed].is_some() {
            continue;
        }
        turned[seed] = Some(false);
        let mut patch = vec![seed as u32];
        let mut next = 0;
        while next < patch.len() {
            let face = patch[next] as usize;
            let flag = turned[face] == Some(true);
            for &(other, alike) in across[face].iter().filter(|(f, _)| *f != NONE) {
                if turned[other as usize].is_none() {
                    turned[other as usize] = Some(flag == alike);
                    patch.push(other);
                }
            }
            next += 1;
        }
        if volume(vertices, faces, &patch, &turned) < 0.0 {
            for &face in &patch {
                turned[face as usize] = turned[face as usize].map(|t| !t);
            }
        }
    }
    turned.into_iter().map(|t| t == Some(true)).collect()
}

/// Six times the signed volume between a patch and the mean of its corners.
fn volume(vertices: &[Point], faces: &[[u32; 3]], patch: &[u32], turned: &[Option<bool>]) -> f64 {
    let corners = |&face: &u32| faces[face as usize].map(|v| vertices[v as usize]);
    let sum = patch.iter().flat_map(corners).fold([0.0; 3], vector::add);
    let mean = vector::scaled(sum, 1.0 / (3 * patch.len()) as f64);
    let signed = |face: &u32| {
        let [a, b, c] = corners(face).map(|p| vector::sub(p, mean));
        let volume = vector::dot(a, vector::cross(b, c));
        if turned[*face as usize] == Some(true) {
            -volume
        } else {
            volume
        }
    };
    patch.iter().map(signed).sum()
}
