//! Level set with some offsets, and how much of the figure it connects.

use rayon::prelude::*;

use super::field::Offsets;
use super::place::{self, Place, Triangle};
use super::surface::{Level, Nets, halved};

/// Where a face is seen, and how much of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    centre: Place,
    normal: Place,
    area: f64,
    piece: u32,
}

impl Seen {
    pub fn of(triangle: &Triangle, share: f32) -> Self {
        let cross = triangle.cross();
        let length = place::dot(cross, cross).sqrt();
        let inverse = if length > 0.0 { 1.0 / length } else { 0.0 };
        Self {
            centre: triangle.centroid(),
            normal: place::scaled(cross, inverse),
            area: f64::from(length) / 2.0 * f64::from(share),
            piece: triangle.piece,
        }
    }
}

/// Level set of some offsets.
#[derive(Debug)]
pub(super) struct Candidate {
    pub offsets: Offsets,
    /// Of the main component.
    pub vertices: Vec<Place>,
    pub faces: Vec<[u32; 3]>,
    pub handles: usize,
    pub components: usize,
    /// Share of the visible area at the main component.
    pub kept_share: f64,
    /// For each piece the component at which most of its visible area lies: pieces of one are joined.
    pub groups: Vec<u32>,
}

impl Candidate {
    /// Nothing when there is no outer surface.
    pub fn of(mut level: Level, offsets: Offsets, seen: &[Seen], pieces: usize) -> Option<Self> {
        level.compose();
        let nets = Nets::of(&level);
        let components = nets.components();
        let main = components.main?;
        let at: Vec<Option<u32>> = seen
            .par_iter()
            .map(|s| components.at(&nets, &level, s.centre, s.normal))
            .collect();
        let (mut kept, mut all) = (0.0, 0.0);
        for (s, &at) in seen.iter().zip(&at) {
            all += s.area;
            if at == Some(main) || at.is_none() && level.is_inside(s.centre) {
                kept += s.area;
            }
        }
        let mut number = vec![u32::MAX; nets.vertices.len()];
        let mut vertices = Vec::new();
        for (v, own) in number.iter_mut().enumerate() {
            if components.of_vertex[v] == main {
                *own = vertices.len() as u32;
                vertices.push(nets.vertices[v]);
            }
        }
        let quads = nets.quads.iter().map(|q| q.map(|v| number[v as usize]));
        let quads: Vec<[u32; 4]> = quads.filter(|q| q[0] != u32::MAX).collect();
        Some(Self {
            offsets,
            faces: quads.iter().flat_map(|&q| halved(&vertices, q)).collect(),
            // Each quadrilateral has four edges, each edge two quadrilaterals: χ = V − 2Q + Q.
            handles: (2 + quads.len() - vertices.len()) / 2,
            vertices,
            components: components.outer,
            kept_share: if all > 0.0 { kept / all } else { 1.0 },
            groups: groups(seen, &at, main, pieces),
        })
    }
}

/// Component of each piece; the main one of a piece of which nothing is seen at any.
fn groups(seen: &[Seen], at: &[Option<u32>], main: u32, pieces: usize) -> Vec<u32> {
    let mut areas: Vec<(u32, u32, f64)> = seen
        .iter()
        .zip(at)
        .filter_map(|(s, at)| at.map(|at| (s.piece, at, s.area)))
        .collect();
    areas.sort_by_key(|&(piece, at, _)| (piece, at));
    let mut largest = vec![(main, 0.0); pieces];
    for run in areas.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let area: f64 = run.iter().map(|entry| entry.2).sum();
        let own = &mut largest[run[0].0 as usize];
        if area > own.1 {
            *own = (run[0].1, area);
        }
    }
    largest.into_iter().map(|(at, _)| at).collect()
}
