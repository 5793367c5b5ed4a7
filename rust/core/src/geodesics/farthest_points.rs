//! Farthest point sampling.

use std::array::from_mut;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::fast_marching::{FastMarching, Seed, Workspace};
use crate::algebra::dense::vectorised;
use crate::algebra::vector;
use crate::error::{Error, Result};
use crate::mesh::Mesh;

/// Vertices whose distances from the centroid differ by less than this fraction are tied.
const TIE: f64 = 1e-9;

/// Vertices spread evenly over the surface, each the farthest from all before it, `(count)`.
///
/// The first is the vertex farthest from the area centroid; among tied ones that with the largest
/// area around it, then the smallest id. So the list follows the shape, not its numbering or
/// placing, up to ties. Only vertices of the given surface are chosen, not those that close holes.
/// Fewer than `count` come back when every vertex is chosen or at distance zero from a chosen one.
/// Only the first `among` vertices are chosen.
///
/// Each march stops where it no longer lowers the distance to the set, so that all of them
/// together cost a few full ones: about ln(`count`). `cancelled` is asked before each.
///
/// # Errors
/// [`Error::Cancelled`].
///
/// # Source
/// Y. Eldar et al., "The farthest point strategy for progressive image sampling", IEEE Trans.
/// Image Processing 6 (1997); on surfaces G. Peyré, L. Cohen, "Geodesic remeshing using front
/// propagation", IJCV 69 (2006).
pub fn farthest_points(
    marching: &FastMarching,
    mesh: &Mesh,
    among: usize,
    count: usize,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<u32>> {
    let mut chosen = Vec::with_capacity(count.min(among));
    let mut to_set = vec![f32::INFINITY; marching.vertex_count()];
    let mut workspace = Workspace::new(marching);
    // Distances only fall: an entry above its vertex's distance is out of date and goes back.
    let mut farthest: BinaryHeap<(u32, Reverse<u32>)> = BinaryHeap::new();
    let mut next = (count > 0).then(|| outermost_vertex(mesh, among)).flatten();
    while let Some(vertex) = next {
        if cancelled() {
            return Err(Error::Cancelled);
        }
        let seeds = [Seed::at(vertex)];
        let limit = |v: u32| to_set[v as usize];
        vectorised(
            #[inline(always)]
            || marching.run([&seeds], from_mut(&mut workspace), limit),
        );
        for (v, distance) in workspace.reached() {
            to_set[v as usize] = distance;
        }
        if chosen.is_empty() {
            farthest = (0..among as u32)
                .map(|v| (to_set[v as usize].to_bits(), Reverse(v)))
                .collect();
        }
        chosen.push(vertex);
        if chosen.len() == count {
            break;
        }
        next = None;
        while let Some((bits, Reverse(v))) = farthest.pop() {
            let now = to_set[v as usize].to_bits();
            if now == bits {
                next = (bits > 0).then_some(v);
                break;
            }
            farthest.push((now, Reverse(v)));
        }
    }
    Ok(chosen)
}

/// Of the first `among` vertices the one farthest from the origin, where the area centroid is.
fn outermost_vertex(mesh: &Mesh, among: usize) -> Option<u32> {
    let radius: Vec<f64> = mesh.vertices[..among]
        .iter()
        .map(|&p| vector::norm(p))
        .collect();
    let largest = radius.iter().copied().fold(0.0, f64::max);
    let tied: Vec<u32> = (0..radius.len() as u32)
        .filter(|&v| radius[v as usize] >= largest * (1.0 - TIE))
        .collect();
    if tied.len() < 2 {
        return tied.first().copied();
    }
    let around = mesh.vertex_faces();
    let area = |v: u32| -> f64 {
        let faces = around.row(v as usize);
        faces.iter().map(|&f| mesh.face_area(f as usize)).sum()
    };
    let areas: Vec<f64> = tied.iter().map(|&v| area(v)).collect();
    let largest = areas.iter().copied().fold(0.0, f64::max);
    tied.into_iter()
        .zip(areas)
        .find(|&(_, area)| area >= largest * (1.0 - TIE))
        .map(|(v, _)| v)
}
