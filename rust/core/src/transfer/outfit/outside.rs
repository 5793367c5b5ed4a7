//! On which side of a body a point lies, and how far from it.

use std::collections::HashMap;

use crate::algebra::vector::{self, Point};
use crate::mesh::surface_point::SurfacePoint;
use crate::transfer::surface::{Surface, blend};

/// A weight below this is zero: the nearest point lies on an edge or at a corner.
const ON_THE_RIM: f64 = 1e-9;

/// Angle-weighted normals of faces, edges and vertices, all pointing out of the body.
///
/// Vertices at one place are one, so that a surface that is split along the seams of its texture is whole. A body whose
/// faces are wound inwards, of negative volume, is turned.
///
/// # Source
/// Bærentzen, Aanæs, "Signed distance computation using the angle weighted pseudonormal", 2005.
#[derive(Debug)]
pub struct Outside {
    /// −1 where the faces are wound inwards, else 1.
    side: f64,
    faces: Vec<Point>,
    /// Of the edge from corner `k` to the next.
    edges: Vec<[Point; 3]>,
    vertices: Vec<Point>,
}

/// The point of a body nearest to a place.
#[derive(Debug, Clone, Copy)]
pub struct Nearest {
    /// Where on the body it is.
    pub point: SurfacePoint,
    /// Distance to it, negative within the body.
    pub distance: f64,
    /// The way out there, of unit length; zero where normals cancel.
    pub normal: Point,
}

impl Outside {
    /// Normals of a surface.
    #[must_use]
    pub fn of(surface: &Surface) -> Self {
        let side = volume(surface).signum();
        let faces: Vec<Point> = (0..surface.triangles.len() as u32)
            .map(|t| vector::scaled(vector::normalised(surface.cross(t)), side))
            .collect();
        let place = welded(&surface.vertices);
        let mut at_places = vec![[0.0; 3]; surface.vertices.len()];
        let mut at_edges: HashMap<(u32, u32), Point> =
            HashMap::with_capacity(surface.triangles.len() * 3 / 2);
        for (triangle, &normal) in surface.triangles.iter().zip(&faces) {
            let corners = triangle.map(|v| surface.vertices[v as usize]);
            let places = triangle.map(|v| place[v as usize]);
            for k in 0..3 {
                let [next, last] = [(k + 1) % 3, (k + 2) % 3];
                let weighted = vector::scaled(
                    normal,
                    angle(
                        vector::sub(corners[next], corners[k]),
                        vector::sub(corners[last], corners[k]),
                    ),
                );
                let sum = &mut at_places[places[k] as usize];
                *sum = vector::add(*sum, weighted);
                let sum = at_edges.entry(edge(places[k], places[next])).or_default();
                *sum = vector::add(*sum, normal);
            }
        }
        let edges = surface
            .triangles
            .iter()
            .map(|triangle| {
                let places = triangle.map(|v| place[v as usize]);
                [0, 1, 2]
                    .map(|k| vector::normalised(at_edges[&edge(places[k], places[(k + 1) % 3])]))
            })
            .collect();
        let vertices = place
            .iter()
            .map(|&p| vector::normalised(at_places[p as usize]))
            .collect();
        Self {
            side,
            faces,
            edges,
            vertices,
        }
    }

    /// −1 where the faces are wound inwards, else 1.
    #[must_use]
    pub fn side(&self) -> f64 {
        self.side
    }

    /// Angle-weighted normals of the vertices.
    #[must_use]
    pub fn vertices(&self) -> &[Point] {
        &self.vertices
    }

    /// The normal by which the side of places nearest to a point is told.
    #[must_use]
    pub fn normal(&self, surface: &Surface, point: &SurfacePoint) -> Point {
        let weights = point.weights;
        if let Some(k) = (0..3).find(|&k| weights[k] > 1.0 - ON_THE_RIM) {
            return self.vertices[surface.triangles[point.face as usize][k] as usize];
        }
        if let Some(k) = (0..3).find(|&k| weights[k] < ON_THE_RIM) {
            return self.edges[point.face as usize][(k + 1) % 3];
        }
        self.faces[point.face as usize]
    }

    /// Normals of the vertices mixed at a point, which turn evenly along the surface.
    #[must_use]
    pub fn smooth_normal(&self, surface: &Surface, point: &SurfacePoint) -> Point {
        let corners = surface.triangles[point.face as usize];
        vector::normalised(blend(
            corners.map(|v| self.vertices[v as usize]),
            point.weights,
        ))
    }

    /// The point nearest to a place; `guess` is a triangle that is probably near.
    ///
    /// # Panics
    /// Never: a surface has a triangle.
    #[must_use]
    pub fn nearest(&self, surface: &Surface, place: Point, guess: Option<u32>) -> Nearest {
        let point = surface
            .nearest_where(place, guess, |_| true)
            .expect("a surface has a triangle, and every triangle is allowed");
        let normal = self.normal(surface, &point);
        let offset = vector::sub(place, surface.position(&point));
        let distance = vector::norm(offset);
        let inside = vector::dot(offset, normal) < 0.0;
        Nearest {
            point,
            distance: if inside { -distance } else { distance },
            normal,
        }
    }
}

/// For each point the first that is at the same place.
#[must_use]
pub fn welded(points: &[Point]) -> Vec<u32> {
    let mut first: HashMap<[u64; 3], u32> = HashMap::with_capacity(points.len());
    (0..)
        .zip(points)
        // Zero has two signs.
        .map(|(i, p)| *first.entry(p.map(|x| (x + 0.0).to_bits())).or_insert(i))
        .collect()
}

/// Six times the enclosed volume, about the middle of the vertices, so that an opening counts little.
fn volume(surface: &Surface) -> f64 {
    let count = surface.vertices.len() as f64;
    let middle = surface.vertices.iter().fold([0.0; 3], |sum, &p| {
        vector::add(sum, vector::scaled(p, 1.0 / count))
    });
    (0..surface.triangles.len() as u32)
        .map(|t| {
            let [a, b, c] = surface.corners(t).map(|p| vector::sub(p, middle));
            vector::dot(a, vector::cross(b, c))
        })
        .sum()
}

fn edge(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

/// Angle between two directions, 0 when one has no length.
fn angle(a: Point, b: Point) -> f64 {
    vector::norm(vector::cross(a, b)).atan2(vector::dot(a, b))
}
