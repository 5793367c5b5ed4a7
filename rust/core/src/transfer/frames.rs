//! How a map turns and scales the surroundings of each vertex.

use rayon::prelude::*;

use crate::algebra::conjugate_gradients::{self, Row, Until};
use crate::algebra::similarity::nearest_turn;
use crate::algebra::vector::{self, Point};
use crate::mesh::edge_weights::EdgeWeights;
use crate::transfer::frame::{Frame, determinant};
use crate::transfer::settings::FRAMES;
use crate::transfer::surface::{Surface, blend};
use crate::transfer::surface_map::{Joined, SurfaceMap};

/// How well the average is solved.
const UNTIL: Until = Until {
    residual: 1e-3,
    steps: 200,
};

/// What a frame is fitted to, as a row: Σ target edge · source edgeᵀ, and the squares of either, over the edges at a vertex.
type Moments = Row<11>;

/// Adds the moments of an edge of the target, given after its image on the source.
fn add_edge(moments: &mut Moments, source: Point, target: Point) {
    for (row, x) in moments.chunks_exact_mut(3).zip(target) {
        for (m, y) in row.iter_mut().zip(source) {
            *m += x * y;
        }
    }
    moments[9] += vector::dot(target, target);
    moments[10] += vector::dot(source, source);
}

impl SurfaceMap {
    /// The turn and scale from source to target around each target vertex, `(n_target)`.
    ///
    /// Vertices at one place, as exporters leave them at texture seams, have the same.
    #[must_use]
    pub fn frames(&self) -> &[Frame] {
        self.frames.get_or_init(|| {
            let frames = frames(&Mapped::of(self));
            let of = |&class: &u32| frames[class as usize];
            self.joined().1.class.iter().map(of).collect()
        })
    }

    /// Whether the map turns left into right, as its frames were decided to.
    #[must_use]
    pub fn mirrors(&self) -> bool {
        self.frames().first().is_some_and(Frame::mirrors)
    }
}

/// The joined target of a map, and where it goes on the source.
struct Mapped<'a> {
    surface: &'a Surface,
    /// Place on the source and normal there for each vertex of the surface.
    images: Vec<Point>,
    normals: Vec<Point>,
}

impl<'a> Mapped<'a> {
    fn of(map: &'a SurfaceMap) -> Self {
        let (surface, Joined { first, .. }) = map.joined();
        let normals = map.source.vertex_normals();
        let normal = |&v: &u32| {
            let point = &map.points[v as usize];
            let corners = map.source.triangles[point.face as usize];
            blend(corners.map(|w| normals[w as usize]), point.weights)
        };
        Self {
            surface,
            images: first.iter().map(|&v| map.images()[v as usize]).collect(),
            normals: first.iter().map(normal).collect(),
        }
    }
}

/// Fits a frame at each target vertex to its edges, their images and the two normals.
///
/// A frame takes edges of the images to edges of the target in the least-squares sense (Horn,
/// "Closed-form solution of absolute orientation using unit quaternions", 1987), with the normals
/// as a third direction. Whether frames turn or mirror is decided once, for the whole map.
#[must_use]
fn frames(map: &Mapped) -> Vec<Frame> {
    let moments = averaged_moments(map);
    let covariance = |m: &Moments| [[m[0], m[1], m[2]], [m[3], m[4], m[5]], [m[6], m[7], m[8]]];
    let sides: f64 = moments
        .iter()
        .map(|m| determinant(&covariance(m)).signum())
        .sum();
    let mirrored = sides < 0.0;
    let usual = usual_scale(&moments);
    moments
        .par_iter()
        .map(|m| {
            let scale = (m[9] / m[10]).sqrt();
            Frame {
                turn: nearest_turn(&covariance(m), mirrored),
                scale: if scale.is_finite() && scale > 0.0 {
                    scale.clamp(usual / FRAMES.largest_scale, usual * FRAMES.largest_scale)
                } else {
                    usual
                },
            }
        })
        .collect()
}

/// The moments of each target vertex with its normals, averaged by area: x of (A + ℓ²W) x = y with the areas A, the cotangent
/// weights W and the moments y.
fn averaged_moments(map: &Mapped) -> Vec<Moments> {
    let Surface {
        vertices,
        triangles,
        ..
    } = map.surface;
    let mut moments = vec![[0.0; 11]; vertices.len()];
    for corners in triangles {
        for k in 0..3 {
            let (a, b) = (corners[k] as usize, corners[(k + 1) % 3] as usize);
            let d = vector::sub(vertices[b], vertices[a]);
            let e = vector::sub(map.images[b], map.images[a]);
            add_edge(&mut moments[a], e, d);
            add_edge(&mut moments[b], e, d);
        }
    }
    for ((m, normal), image_normal) in moments
        .iter_mut()
        .zip(map.surface.vertex_normals())
        .zip(&map.normals)
    {
        let size = (m[9] * m[10]).sqrt() * FRAMES.normal_share;
        let [target, source] = [m[9], m[10]];
        add_edge(m, *image_normal, vector::scaled(normal, size));
        (m[9], m[10]) = (target, source);
    }
    let areas = map.surface.vertex_areas();
    let total: f64 = areas.iter().sum();
    let edges = EdgeWeights::new(vertices, triangles);
    let square = FRAMES.averaged_over * FRAMES.averaged_over * total;
    let diagonal: Vec<f64> = areas
        .iter()
        .enumerate()
        .map(|(v, area)| {
            let held: f64 = edges.row(v).map(|(_, w)| w).sum();
            (area + square * held).max(f64::MIN_POSITIVE)
        })
        .collect();
    let apply = |x: &[Moments]| -> Vec<Moments> {
        (0..x.len())
            .into_par_iter()
            .map(|v| {
                let mut sum = x[v].map(|x| diagonal[v] * x);
                for (u, w) in edges.row(v) {
                    for (sum, x) in sum.iter_mut().zip(&x[u as usize]) {
                        *sum -= square * w * x;
                    }
                }
                sum
            })
            .collect()
    };
    let precondition = |x: &[Moments]| -> Vec<Moments> {
        let rows = x.iter().zip(&diagonal);
        rows.map(|(row, d)| row.map(|x| x / d)).collect()
    };
    let start = precondition(&moments);
    conjugate_gradients::solved(apply, precondition, &moments, start, UNTIL, &|| Ok(()))
        .expect("it is never told to stop")
}

fn usual_scale(moments: &[Moments]) -> f64 {
    let (target, source) = moments
        .iter()
        .fold((0.0, 0.0), |(t, s), m| (t + m[9], s + m[10]));
    if target > 0.0 && source > 0.0 {
        (target / source).sqrt()
    } else {
        1.0
    }
}
