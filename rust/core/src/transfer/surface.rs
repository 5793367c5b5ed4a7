//! A triangle surface as it was given, with its adjacency and the nearest point of it.

use std::collections::HashMap;

use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};
use crate::mesh::surface_point::{SurfacePoint, nearest_in_triangle};

/// Stands for no triangle, across a border or an edge with more than two triangles.
pub const NONE: u32 = u32::MAX;

/// Triangles of a leaf of the tree.
const LEAF: usize = 4;

/// A surface in its own units, all parts of it, nothing dropped or mended.
#[derive(Debug, Clone)]
pub struct Surface {
    /// Vertex positions, `(n)`.
    pub vertices: Vec<Point>,
    /// Triangles, `(m)`.
    pub triangles: Vec<[u32; 3]>,
    /// Triangle across the edge from corner `k` to the next, `(m)`; [`NONE`] where there is none.
    pub across: Vec<[u32; 3]>,
    order: Vec<u32>,
    boxes: Vec<Node>,
}

/// A box over a part of `order`; its first child follows it.
#[derive(Debug, Clone)]
struct Node {
    /// The lowest and the highest corner.
    bounds: [Point; 2],
    second_child: usize,
}

impl Node {
    fn squared_distance(&self, p: Point) -> f64 {
        let [low, high] = self.bounds;
        (0..3)
            .map(|c| (low[c] - p[c]).max(p[c] - high[c]).max(0.0))
            .map(|d| d * d)
            .sum()
    }
}

impl Surface {
    /// Checks the numbers of the triangles and sorts them into a tree of boxes.
    ///
    /// # Errors
    /// [`Error::EmptyMesh`], [`Error::NotFinite`], [`Error::FaceIndexOutOfRange`].
    pub fn new(vertices: Vec<Point>, triangles: &[[i64; 3]]) -> Result<Self> {
        if triangles.is_empty() {
            return Err(Error::EmptyMesh {
                vertices: vertices.len(),
                faces: 0,
            });
        }
        if let Some(vertex) = vertices
            .iter()
            .position(|p| p.iter().any(|x| !x.is_finite()))
        {
            return Err(Error::NotFinite { vertex });
        }
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
        }
        let triangles: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|v| v as u32)).collect();
        let across = adjacency(&triangles);
        let bounds: Vec<[Point; 2]> = (triangles.iter())
            .map(|t| vector::bounds(t.map(|v| vertices[v as usize])))
            .collect();
        let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
        let mut boxes = Vec::new();
        build(&bounds, &mut order, &mut boxes);
        Ok(Self {
            vertices,
            triangles,
            across,
            order,
            boxes,
        })
    }

    /// Positions of some vertices.
    pub(crate) fn places(&self, vertices: &[u32]) -> Vec<Point> {
        let place = |&v: &u32| self.vertices[v as usize];
        vertices.iter().map(place).collect()
    }

    /// Corner positions of a triangle.
    #[must_use]
    pub fn corners(&self, triangle: u32) -> [Point; 3] {
        self.triangles[triangle as usize].map(|v| self.vertices[v as usize])
    }

    /// Length of the longest edge of a triangle.
    #[must_use]
    pub fn longest_edge(&self, triangle: u32) -> f64 {
        let [a, b, c] = self.corners(triangle);
        [(a, b), (b, c), (c, a)]
            .map(|(p, q)| vector::distance(p, q))
            .into_iter()
            .fold(0.0, f64::max)
    }

    /// Twice the area of a triangle times its normal.
    #[must_use]
    pub fn cross(&self, triangle: u32) -> Point {
        let [a, b, c] = self.corners(triangle);
        vector::cross(vector::sub(b, a), vector::sub(c, a))
    }

    /// Area-weighted unit normals of the vertices, zero where they cancel.
    #[must_use]
    pub fn vertex_normals(&self) -> Vec<Point> {
        let mut normals = vec![[0.0; 3]; self.vertices.len()];
        for t in 0..self.triangles.len() as u32 {
            let cross = self.cross(t);
            for v in self.triangles[t as usize] {
                normals[v as usize] = vector::add(normals[v as usize], cross);
            }
        }
        normals.into_iter().map(vector::normalised).collect()
    }

    /// A third of the area of the triangles around each vertex.
    #[must_use]
    pub fn vertex_areas(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.vertices.len()];
        for t in 0..self.triangles.len() as u32 {
            let share = vector::norm(self.cross(t)) / 6.0;
            for v in self.triangles[t as usize] {
                areas[v as usize] += share;
            }
        }
        areas
    }

    /// Length of the diagonal of the bounding box.
    #[must_use]
    pub fn diagonal(&self) -> f64 {
        let [low, high] = vector::bounds(self.vertices.iter().copied());
        vector::distance(low, high)
    }

    /// Where a point of the surface lies in space.
    #[must_use]
    pub fn position(&self, point: &SurfacePoint) -> Point {
        let [a, b, c] = self.corners(point.face);
        blend([a, b, c], point.weights)
    }

    /// Squared distance to one triangle, and the weights of its nearest point.
    #[must_use]
    pub fn to_triangle(&self, query: Point, triangle: u32) -> (f64, [f64; 3]) {
        nearest_in_triangle(query, self.corners(triangle))
    }

    /// Nearest point of the surface.
    ///
    /// # Panics
    /// Never: a surface has a triangle.
    #[must_use]
    pub fn nearest(&self, query: Point) -> SurfacePoint {
        self.nearest_where(query, None, |_| true)
            .expect("a surface has a triangle, and every triangle is allowed")
    }

    /// Nearest point in the triangles for which `allowed` holds; `guess` is an allowed triangle
    /// that is probably near.
    #[must_use]
    pub fn nearest_where(
        &self,
        query: Point,
        guess: Option<u32>,
        allowed: impl Fn(u32) -> bool + Copy,
    ) -> Option<SurfacePoint> {
        let mut best = guess.map(|face| {
            let (distance, weights) = self.to_triangle(query, face);
            (distance, SurfacePoint { face, weights })
        });
        self.visit(0, 0, self.order.len(), query, allowed, &mut best);
        best.map(|(_, point)| point)
    }

    /// Nearest point in the triangles for which `allowed` holds, of those within a distance: where none is near,
    /// the others are not looked through.
    #[must_use]
    pub fn nearest_within(
        &self,
        query: Point,
        distance: f64,
        allowed: impl Fn(u32) -> bool + Copy,
    ) -> Option<SurfacePoint> {
        let nowhere = SurfacePoint {
            face: NONE,
            weights: [0.0; 3],
        };
        let mut best = Some((distance * distance, nowhere));
        self.visit(0, 0, self.order.len(), query, allowed, &mut best);
        best.map(|(_, point)| point).filter(|p| p.face != NONE)
    }

    /// Descends into the box `node` over `order[begin..end]`.
    fn visit(
        &self,
        node: usize,
        begin: usize,
        end: usize,
        query: Point,
        allowed: impl Fn(u32) -> bool + Copy,
        best: &mut Option<(f64, SurfacePoint)>,
    ) {
        if end - begin <= LEAF {
            for &face in &self.order[begin..end] {
                if !allowed(face) {
                    continue;
                }
                let (distance, weights) = self.to_triangle(query, face);
                if best.is_none_or(|(d, p)| distance < d || (distance == d && face < p.face)) {
                    *best = Some((distance, SurfacePoint { face, weights }));
                }
            }
            return;
        }
        let middle = usize::midpoint(begin, end);
        let left = (node + 1, begin, middle);
        let right = (self.boxes[node].second_child, middle, end);
        let reach = |(n, ..): (usize, usize, usize)| self.boxes[n].squared_distance(query);
        let mut order = [(reach(left), left), (reach(right), right)];
        if order[1].0 < order[0].0 {
            order.swap(0, 1);
        }
        for (distance, (n, b, e)) in order {
            if best.is_none_or(|(d, _)| distance <= d) {
                self.visit(n, b, e, query, allowed, best);
            }
        }
    }
}

/// `Σ weights · corners`.
#[must_use]
pub fn blend(corners: [Point; 3], weights: [f64; 3]) -> Point {
    (0..3).fold([0.0; 3], |sum, k| {
        vector::add(sum, vector::scaled(corners[k], weights[k]))
    })
}

fn build(bounds: &[[Point; 2]], part: &mut [u32], boxes: &mut Vec<Node>) {
    let whole = vector::around(part.iter().map(|&t| bounds[t as usize]));
    let node = boxes.len();
    boxes.push(Node {
        bounds: whole,
        second_child: 0,
    });
    if part.len() <= LEAF {
        return;
    }
    let sides = vector::sub(whole[1], whole[0]);
    let axis = (0..3)
        .max_by(|&a, &b| sides[a].total_cmp(&sides[b]))
        .expect("three axes");
    let key = |t: u32| bounds[t as usize].iter().map(|end| end[axis]).sum::<f64>();
    let middle = part.len() / 2;
    part.select_nth_unstable_by(middle, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
    let (low, high) = part.split_at_mut(middle);
    build(bounds, low, boxes);
    boxes[node].second_child = boxes.len();
    build(bounds, high, boxes);
}

fn adjacency(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut sides: HashMap<(u32, u32), Vec<(u32, u8)>> =
        HashMap::with_capacity(triangles.len() * 3 / 2);
    for (t, corners) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            sides
                .entry((a.min(b), a.max(b)))
                .or_default()
                .push((t as u32, k as u8));
        }
    }
    let mut across = vec![[NONE; 3]; triangles.len()];
    for pair in sides.values() {
        if let [(t, k), (s, l)] = pair[..] {
            across[t as usize][k as usize] = s;
            across[s as usize][l as usize] = t;
        }
    }
    across
}

#[cfg(test)]
mod tests {
    use super::*;

    fn octahedron() -> Surface {
        let vertices = vec![
            [1.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
        ];
        let faces = [
            [0, 2, 4],
            [2, 1, 4],
            [1, 3, 4],
            [3, 0, 4],
            [2, 0, 5],
            [1, 2, 5],
            [3, 1, 5],
            [0, 3, 5],
        ];
        Surface::new(vertices, &faces).unwrap()
    }

    #[test]
    fn nearest_point_agrees_with_trying_every_triangle() {
        let surface = octahedron();
        for i in 0..200 {
            let x = f64::from(i);
            let query = [1.3 * x.sin(), 1.1 * (1.7 * x).cos(), (2.3 * x).sin()];
            let found = surface.nearest(query);
            let distance = vector::distance(query, surface.position(&found));
            let least = (0..8)
                .map(|t| surface.to_triangle(query, t).0.max(0.0).sqrt())
                .fold(f64::INFINITY, f64::min);
            assert!((distance - least).abs() < 1e-7, "{distance} {least}");
        }
    }

    #[test]
    fn every_edge_of_a_closed_surface_has_a_triangle_across() {
        let surface = octahedron();
        for (t, row) in surface.across.iter().enumerate() {
            for &s in row {
                assert!(surface.across[s as usize].contains(&(t as u32)));
            }
        }
    }

    #[test]
    fn bad_triangles_are_named() {
        let error = Surface::new(vec![[0.0; 3]; 3], &[[0, 1, 3]]).unwrap_err();
        assert!(matches!(error, Error::FaceIndexOutOfRange { index: 3, .. }));
    }
}
