//! Connected parts, and points beside a surface that follow it.

use crate::algebra::similarity::Similarity;
use crate::algebra::space_tree::SpaceTree;
use crate::algebra::unions::Unions;
use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};
use crate::mesh::Adjacency;
use crate::transfer::surface::Surface;
use crate::transfer::surface_map::SurfaceMap;

/// Connected part of each vertex, numbered from 0; vertices without a triangle have one each.
#[must_use]
pub fn components(surface: &Surface) -> (Vec<u32>, usize) {
    let count = surface.vertices.len();
    let mut unions = Unions::new(count);
    for &[a, b, c] in &surface.triangles {
        unions.unite(a, b);
        unions.unite(a, c);
    }
    let mut label = vec![u32::MAX; count];
    let mut found = 0;
    for v in 0..count as u32 {
        let r = unions.root(v) as usize;
        if label[r] == u32::MAX {
            label[r] = found;
            found += 1;
        }
        label[v as usize] = label[r];
    }
    (label, found as usize)
}

impl SurfaceMap {
    /// Points near the source, such as those of clothes, where the target's surface takes them.
    ///
    /// A point keeps its place beside the surface, turned and scaled as the map does there. Points
    /// with the same number in `pieces` move together, as one rigid piece of the local size;
    /// negative numbers leave a point to itself.
    ///
    /// # Errors
    /// [`Error::BadArgument`] when there is not one number for each point.
    pub fn followed(&self, points: &[Point], pieces: &[i64]) -> Result<Vec<Point>> {
        if points.len() != pieces.len() {
            return Err(Error::BadArgument {
                what: format!(
                    "`pieces` should have {} entries, got {}",
                    points.len(),
                    pieces.len()
                ),
            });
        }
        let (frames, mirrored) = (self.frames(), self.mirrors());
        let tree = SpaceTree::new(self.images());
        let around = self.target_neighbours();
        let mut moved: Vec<Point> = points
            .iter()
            .map(|&p| {
                let Some(nearest) = tree.nearest(p) else {
                    return p;
                };
                let ring = around.row(nearest as usize).iter().copied();
                let reach = vector::distance(p, self.images()[nearest as usize]);
                let mut sum = [0.0; 3];
                let mut total = 0.0;
                for v in std::iter::once(nearest).chain(ring) {
                    let v = v as usize;
                    let offset = vector::sub(p, self.images()[v]);
                    // Falls to a half where a vertex is twice as far as the nearest.
                    let weight = 1.0 / (vector::dot(offset, offset) + reach * reach + SAME_PLACE);
                    let place = vector::add(self.target.vertices[v], frames[v].apply(offset));
                    sum = vector::add(sum, vector::scaled(place, weight));
                    total += weight;
                }
                vector::scaled(sum, 1.0 / total)
            })
            .collect();
        let mut order: Vec<usize> = (0..points.len()).filter(|&i| pieces[i] >= 0).collect();
        order.sort_by_key(|&i| pieces[i]);
        for piece in order.chunk_by(|&a, &b| pieces[a] == pieces[b]) {
            let pairs: Vec<(Point, Point, f64)> =
                piece.iter().map(|&i| (points[i], moved[i], 1.0)).collect();
            let similarity = Similarity::fitted(&pairs, mirrored);
            for &i in piece {
                moved[i] = similarity.apply(points[i]);
            }
        }
        Ok(moved)
    }

    /// Neighbours of each vertex of the target.
    pub(crate) fn target_neighbours(&self) -> Adjacency {
        let mut pairs: Vec<(u32, u32)> = self
            .target
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, a), (b, c), (c, b), (c, a), (a, c)])
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        Adjacency::from_lists(self.target.vertices.len(), pairs.iter().copied())
    }
}

/// Keeps a weight finite where a point lies on a vertex.
const SAME_PLACE: f64 = 1e-12;
