//! The dense map: for every target vertex a triangle of the source and barycentric weights.

use rayon::prelude::*;

use crate::dense::Rows;
use crate::refinement::propagation::squared_distance;
use crate::shape::Shape;

/// Triangles around the nearest vertex and this many of its nearest neighbours are tried.
const NEIGHBOURS_TRIED: usize = 3;

/// A point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Triangle of the checked mesh.
    pub face: u32,
    /// Weights of its corners, non-negative, summing to one.
    pub weights: [f64; 3],
}

impl SurfacePoint {
    /// A vertex of the surface as a point of one of its triangles.
    #[must_use]
    pub fn at_vertex(shape: &Shape, vertex: u32) -> Self {
        let face = shape.vertex_faces.row(vertex as usize)[0];
        let corners = shape.mesh.faces[face as usize];
        Self {
            face,
            weights: corners.map(|v| if v == vertex { 1.0 } else { 0.0 }),
        }
    }
}

/// Nearest point of the source's triangles in the common embedding, for each target row.
///
/// `images` is the nearest source vertex of each target vertex.
#[must_use]
pub fn projected(target: &Rows, source: &Rows, images: &[u32], shape: &Shape) -> Vec<SurfacePoint> {
    images
        .par_iter()
        .enumerate()
        .map(|(i, &image)| project(target.row(i), source, image, shape))
        .collect()
}

fn project(query: &[f32], source: &Rows, image: u32, shape: &Shape) -> SurfacePoint {
    let mut near: Vec<(f32, u32)> = shape
        .neighbours
        .row(image as usize)
        .iter()
        .filter(|&&v| (v as usize) < shape.mesh.surface_vertices)
        .map(|&v| {
            (
                squared_distance(query, source.row(v as usize), f32::INFINITY),
                v,
            )
        })
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    near.truncate(NEIGHBOURS_TRIED);
    near.insert(0, (0.0, image));
    let mut faces: Vec<u32> = near
        .iter()
        .flat_map(|&(_, v)| shape.vertex_faces.row(v as usize))
        .copied()
        .filter(|&f| (f as usize) < shape.mesh.surface_faces)
        .collect();
    faces.sort_unstable();
    faces.dedup();
    let mut best = (
        f64::INFINITY,
        SurfacePoint {
            face: 0,
            weights: [1.0, 0.0, 0.0],
        },
    );
    for face in faces {
        let corners = shape.mesh.faces[face as usize].map(|v| source.row(v as usize));
        let (cost, weights) = closest_in_triangle(query, corners);
        if cost < best.0 {
            best = (cost, SurfacePoint { face, weights });
        }
    }
    best.1
}

/// Squared distance from a query to a triangle in any dimension, and the barycentric weights of
/// the closest point.
fn closest_in_triangle(query: &[f32], [a, b, c]: [&[f32]; 3]) -> (f64, [f64; 3]) {
    let (mut uu, mut uv, mut vv, mut uq, mut vq, mut qq) = (0f32, 0f32, 0f32, 0f32, 0f32, 0f32);
    for (((&q, &a), &b), &c) in query.iter().zip(a).zip(b).zip(c) {
        let (u, v, d) = (b - a, c - a, q - a);
        uu += u * u;
        uv += u * v;
        vv += v * v;
        uq += u * d;
        vq += v * d;
        qq += d * d;
    }
    let [uu, uv, vv, uq, vq, qq] = [uu, uv, vv, uq, vq, qq].map(f64::from);
    closest_weights(uu, uv, vv, uq, vq, qq)
}

/// Squared distance from a query to a triangle and the barycentric weights of the closest point,
/// from the products of its edges u, v at the first corner and the query's offset q from there.
pub(crate) fn closest_weights(
    uu: f64,
    uv: f64,
    vv: f64,
    uq: f64,
    vq: f64,
    qq: f64,
) -> (f64, [f64; 3]) {
    let cost =
        |s: f64, t: f64| qq - 2.0 * (s * uq + t * vq) + s * s * uu + 2.0 * s * t * uv + t * t * vv;
    let determinant = uu * vv - uv * uv;
    if determinant > 0.0 {
        let s = (vv * uq - uv * vq) / determinant;
        let t = (uu * vq - uv * uq) / determinant;
        if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
            return (cost(s, t), [1.0 - s - t, s, t]);
        }
    }
    // Outside: the best point of the three edges.
    let along = |numerator: f64, length: f64| {
        if length > 0.0 {
            (numerator / length).clamp(0.0, 1.0)
        } else {
            0.0
        }
    };
    let on_ab = along(uq, uu);
    let on_ac = along(vq, vv);
    let on_bc = along(vq - uq + uu - uv, uu + vv - 2.0 * uv);
    [(on_ab, 0.0), (0.0, on_ac), (1.0 - on_bc, on_bc)]
        .map(|(s, t)| (cost(s, t), [1.0 - s - t, s, t].map(|w: f64| w.max(0.0))))
        .into_iter()
        .min_by(|x, y| x.0.total_cmp(&y.0))
        .expect("three edges")
}
