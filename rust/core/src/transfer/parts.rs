//! Small parts (eyes, teeth, buttons): they follow the large part they sit on.

use crate::algebra::similarity::Similarity;
use crate::algebra::space_tree::SpaceTree;
use crate::algebra::unions::Unions;
use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};
use crate::mesh::Adjacency;
use crate::mesh::surface_point::SurfacePoint;
use crate::transfer::settings::PARTS;
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

/// Centre and root mean square radius of points.
fn extent(points: impl Iterator<Item = Point> + Clone) -> (Point, f64) {
    let count = points.clone().count().max(1) as f64;
    let centre = points.clone().fold([0.0; 3], |sum, p| {
        vector::add(sum, vector::scaled(p, 1.0 / count))
    });
    let square: f64 = points
        .map(|p| vector::sub(p, centre))
        .map(|d| vector::dot(d, d))
        .sum();
    (centre, (square / count).sqrt())
}

impl SurfaceMap {
    /// The map with the target's unmatched parts put onto their counterparts on the source.
    ///
    /// A part is unmatched when no vertex of it has any confidence. The similarity of the matched
    /// surface around it takes it to the source; the unmatched part of the source that is there
    /// and of about its size is its counterpart. Without one it keeps the image it had, on the
    /// part it sits on.
    ///
    /// # Errors
    /// None beyond those of [`SurfaceMap::new`], which its own parts satisfy.
    pub fn with_parts(self) -> Result<Self> {
        let (part, count) = components(&self.target);
        let mut matched = vec![false; count];
        for (v, &c) in self.confidence.iter().enumerate() {
            matched[part[v] as usize] |= c > 0.0;
        }
        if !matched.contains(&false) || !matched.contains(&true) {
            return Ok(self);
        }
        let (source_part, source_count) = components(&self.source);
        let mut taken = vec![false; source_count];
        for (v, point) in self.points.iter().enumerate() {
            if matched[part[v] as usize] {
                let corner = self.source.triangles[point.face as usize][0];
                taken[source_part[corner as usize] as usize] = true;
            }
        }
        let extents: Vec<(Point, f64)> = (0..source_count)
            .map(|c| {
                let own = |v: &usize| source_part[*v] as usize == c;
                extent(
                    (0..source_part.len())
                        .filter(own)
                        .map(|v| self.source.vertices[v]),
                )
            })
            .collect();
        let mut points = self.points.clone();
        let mut confidence = self.confidence.clone();
        for c in (0..count).filter(|&c| !matched[c]) {
            let own: Vec<usize> = (0..part.len()).filter(|&v| part[v] as usize == c).collect();
            let (centre, radius) = extent(own.iter().map(|&v| self.target.vertices[v]));
            if radius <= 0.0 {
                continue;
            }
            let there = self.surroundings(centre, radius, |v| matched[part[v] as usize]);
            let moved: Vec<Point> = own
                .iter()
                .map(|&v| there.apply(self.target.vertices[v]))
                .collect();
            let (centre, radius) = extent(moved.iter().copied());
            let best = (0..source_count)
                .filter(|&d| !taken[d] && extents[d].1 > 0.0)
                .map(|d| (vector::distance(centre, extents[d].0), d))
                .filter(|&(offset, d)| {
                    let ratio = extents[d].1 / radius;
                    offset <= PARTS.largest_offset * radius.max(extents[d].1)
                        && ratio.max(1.0 / ratio) <= PARTS.largest_ratio
                })
                .min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, d)) = best else { continue };
            let allowed = |t: u32| {
                let corner = self.source.triangles[t as usize][0];
                source_part[corner as usize] as usize == d
            };
            for (&v, &p) in own.iter().zip(&moved) {
                let offset = vector::scaled(vector::sub(p, centre), extents[d].1 / radius);
                let goal = vector::add(extents[d].0, offset);
                if let Some(point) = self.source.nearest_where(goal, None, allowed) {
                    points[v] = point;
                    confidence[v] = PARTS.part_confidence;
                }
            }
        }
        let faces: Vec<i64> = points.iter().map(|p| i64::from(p.face)).collect();
        let weights: Vec<[f64; 3]> = points.iter().map(|p: &SurfacePoint| p.weights).collect();
        Self::new(self.source, self.target, &faces, &weights, confidence)
    }

    /// The similarity from target to source of the vertices around a place.
    fn surroundings(
        &self,
        centre: Point,
        radius: f64,
        counts: impl Fn(usize) -> bool,
    ) -> Similarity {
        let near = (0..self.points.len())
            .filter(|&v| counts(v))
            .map(|v| vector::distance(self.target.vertices[v], centre))
            .fold(f64::INFINITY, f64::min);
        let width = radius + near;
        let pairs: Vec<(Point, Point, f64)> = (0..self.points.len())
            .filter(|&v| counts(v))
            .map(|v| {
                let far = vector::distance(self.target.vertices[v], centre) / width;
                let weight = (-far * far).exp();
                (self.target.vertices[v], self.images()[v], weight)
            })
            .collect();
        Similarity::fitted(&pairs, self.mirrors())
    }

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
