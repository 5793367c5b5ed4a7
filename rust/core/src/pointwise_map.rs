//! The dense map: for every target vertex a triangle of the source and barycentric weights.

use rayon::prelude::*;

use crate::dense::{LANES, Rows, sum_of_lanes, vectorised};
use crate::error::Result;
use crate::full_resolution::FullResolution;
use crate::progress::Check;
use crate::refinement::propagation::squared_distance;
use crate::shape::Shape;
use crate::vector::{self, Point};

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
        Self::at_corner(&shape.mesh.faces, face, vertex)
    }

    /// A corner of a triangle.
    #[must_use]
    pub fn at_corner(faces: &[[u32; 3]], face: u32, vertex: u32) -> Self {
        Self {
            face,
            weights: faces[face as usize].map(|v| if v == vertex { 1.0 } else { 0.0 }),
        }
    }
}

/// Nearest point of the source's triangles in the common embedding, for each target row.
///
/// `images` is the nearest source vertex of each target vertex.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn projected(
    target: &Rows,
    source: &Rows,
    images: &[u32],
    shape: &Shape,
    check: Check<'_>,
) -> Result<Vec<SurfacePoint>> {
    images
        .par_iter()
        .enumerate()
        .map(|(i, &image)| {
            check()?;
            Ok(vectorised(
                #[inline(always)]
                || project(target.row(i), source, image, shape),
            ))
        })
        .collect()
}

/// As [`projected`], for every vertex of the given mesh behind a target's working mesh.
///
/// Rows of given vertices are those of the working mesh, linear on its faces, and are never
/// formed: the vertices of a face share the inner products of its corners with the source's rows,
/// so that the cost hardly grows with the given mesh. `images` is the nearest source vertex of
/// each vertex of that mesh.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn projected_at_full_resolution(
    (target, target_rows, full): (&Shape, &Rows, &FullResolution),
    (source, source_rows): (&Shape, &Rows),
    images: &[u32],
    check: Check<'_>,
) -> Result<Vec<SurfacePoint>> {
    let sides: Vec<[f64; 3]> = source
        .mesh
        .faces
        .par_iter()
        .map(|corners| {
            let [a, b, c] = corners.map(|v| source_rows.row(v as usize));
            [(b, b), (b, c), (c, c)].map(|(x, y)| product_from(a, x, y))
        })
        .collect();
    let found: Vec<Vec<(u32, SurfacePoint)>> = (0..target.mesh.faces.len() as u32)
        .into_par_iter()
        .map(|face| {
            check()?;
            let asking = full.on_face(face);
            if asking.is_empty() {
                return Ok(Vec::new());
            }
            let corners = target.mesh.faces[face as usize];
            let near = vectorised(
                #[inline(always)]
                || {
                    NearFaces::new(
                        corners.map(|v| target_rows.row(v as usize)),
                        corners.map(|v| images[v as usize]),
                        (source, source_rows),
                    )
                },
            );
            Ok(asking
                .iter()
                .map(|&v| {
                    (
                        v,
                        near.closest(full.points[v as usize].weights, &sides, source),
                    )
                })
                .collect())
        })
        .collect::<Result<_>>()?;
    let nowhere = SurfacePoint {
        face: 0,
        weights: [1.0, 0.0, 0.0],
    };
    let mut points = vec![nowhere; full.points.len()];
    for (v, point) in found.into_iter().flatten() {
        points[v as usize] = point;
    }
    Ok(points)
}

/// Faces of the source near the image of a target face, seen from the face's first corner t₀.
struct NearFaces {
    /// Gram matrix of t₁ − t₀, t₂ − t₀.
    own: [f64; 3],
    /// Source vertices v, ascending.
    vertices: Vec<u32>,
    /// ⟨t₁ − t₀, v − t₀⟩, ⟨t₂ − t₀, v − t₀⟩, ‖v − t₀‖² of each.
    products: Vec<[f64; 3]>,
    faces: Vec<u32>,
}

impl NearFaces {
    #[inline(always)]
    fn new(corners: [&[f32]; 3], images: [u32; 3], (source, rows): (&Shape, &Rows)) -> Self {
        let mut faces: Vec<u32> = Vec::with_capacity(96);
        for (i, &image) in images.iter().enumerate() {
            if images[..i].contains(&image) {
                continue;
            }
            faces.extend(source.vertex_faces.row(image as usize));
            for &v in source.neighbours.row(image as usize) {
                faces.extend(source.vertex_faces.row(v as usize));
            }
        }
        faces.sort_unstable();
        faces.dedup();
        let mut vertices: Vec<u32> = faces
            .iter()
            .flat_map(|&f| source.mesh.faces[f as usize])
            .collect();
        vertices.sort_unstable();
        vertices.dedup();
        let [t0, t1, t2] = corners;
        let products = vertices
            .iter()
            .map(|&v| {
                let row = rows.row(v as usize);
                [(t1, row), (t2, row), (row, row)].map(|(x, y)| product_from(t0, x, y))
            })
            .collect();
        Self {
            own: [(t1, t1), (t1, t2), (t2, t2)].map(|(x, y)| product_from(t0, x, y)),
            vertices,
            products,
            faces,
        }
    }

    /// Closest point of the faces to the point of the target face with these weights.
    fn closest(&self, [_, w1, w2]: [f64; 3], sides: &[[f64; 3]], source: &Shape) -> SurfacePoint {
        let [e11, e12, e22] = self.own;
        let square = w1 * w1 * e11 + 2.0 * w1 * w2 * e12 + w2 * w2 * e22;
        let mut best = (
            f64::INFINITY,
            SurfacePoint {
                face: 0,
                weights: [1.0, 0.0, 0.0],
            },
        );
        for &face in &self.faces {
            let [a, b, c] = source.mesh.faces[face as usize].map(|v| {
                let at = self.vertices.partition_point(|&u| u < v);
                let [along1, along2, square] = self.products[at];
                (w1 * along1 + w2 * along2, square)
            });
            let [uu, uv, vv] = sides[face as usize];
            // ⟨b − a, q − a⟩ with ⟨a, b⟩ from the law of cosines; likewise for c.
            let uq = b.0 - a.0 + f64::midpoint(a.1 - b.1, uu);
            let vq = c.0 - a.0 + f64::midpoint(a.1 - c.1, vv);
            let qq = square - 2.0 * a.0 + a.1;
            let (cost, weights) = closest_weights(uu, uv, vv, uq, vq, qq);
            if cost < best.0 {
                best = (cost, SurfacePoint { face, weights });
            }
        }
        best.1
    }
}

/// ⟨x − o, y − o⟩.
#[inline(always)]
fn product_from(o: &[f32], x: &[f32], y: &[f32]) -> f64 {
    let mut lanes = [0f32; LANES];
    let whole = o.len() / LANES * LANES;
    for ((o, x), y) in o[..whole]
        .chunks_exact(LANES)
        .zip(x[..whole].chunks_exact(LANES))
        .zip(y[..whole].chunks_exact(LANES))
    {
        for l in 0..LANES {
            lanes[l] += (x[l] - o[l]) * (y[l] - o[l]);
        }
    }
    let rest: f32 = (whole..o.len())
        .map(|i| (x[i] - o[i]) * (y[i] - o[i]))
        .sum();
    f64::from(sum_of_lanes(lanes) + rest)
}

/// Nearest point of the triangles around a source vertex and its nearest neighbours.
#[inline(always)]
#[must_use]
pub fn project(query: &[f32], source: &Rows, image: u32, shape: &Shape) -> SurfacePoint {
    let mut near: Vec<(f32, u32)> = shape
        .neighbours
        .row(image as usize)
        .iter()
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
#[inline(always)]
fn closest_in_triangle(query: &[f32], [a, b, c]: [&[f32]; 3]) -> (f64, [f64; 3]) {
    let [uu, uv, vv, uq, vq, qq] = [
        (b, b),
        (b, c),
        (c, c),
        (b, query),
        (c, query),
        (query, query),
    ]
    .map(|(x, y)| product_from(a, x, y));
    closest_weights(uu, uv, vv, uq, vq, qq)
}

/// Squared distance to a triangle, and the weights of its nearest point.
#[must_use]
pub(crate) fn nearest_in_triangle(query: Point, [a, b, c]: [Point; 3]) -> (f64, [f64; 3]) {
    let (u, v, d) = (vector::sub(b, a), vector::sub(c, a), vector::sub(query, a));
    closest_weights(
        vector::dot(u, u),
        vector::dot(u, v),
        vector::dot(v, v),
        vector::dot(u, d),
        vector::dot(v, d),
        vector::dot(d, d),
    )
}

/// Squared distance from a query to a triangle and the barycentric weights of the closest point,
/// from the products of its edges u, v at the first corner and the query's offset q from there.
fn closest_weights(uu: f64, uv: f64, vv: f64, uq: f64, vq: f64, qq: f64) -> (f64, [f64; 3]) {
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
