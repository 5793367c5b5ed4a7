//! How a map turns and scales the surroundings of each vertex.

use rayon::prelude::*;

use crate::algebra::similarity::nearest_turn;
use crate::algebra::vector::{self, Point};
use crate::transfer::frame::{Frame, Matrix, determinant};
use crate::transfer::surface::blend;
use crate::transfer::surface_map::SurfaceMap;

/// Rounds of averaging over neighbours before frames are fitted: images of neighbouring vertices
/// are a fraction of an edge wrong, and directions between them much more so.
const SMOOTHING_ROUNDS: usize = 4;

/// Weight of the normals beside the edges in a frame's fit.
const NORMAL_SHARE: f64 = 0.5;

/// Sums over the edges at a vertex from which its frame is fitted.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    /// Σ target edge · source edgeᵀ.
    covariance: Matrix,
    target: f64,
    source: f64,
}

impl Moments {
    fn add(&mut self, other: &Self, factor: f64) {
        for (row, other) in self.covariance.iter_mut().zip(other.covariance) {
            *row = vector::add(*row, vector::scaled(other, factor));
        }
        self.target += factor * other.target;
        self.source += factor * other.source;
    }
}

impl SurfaceMap {
    /// The turn and scale from source to target around each target vertex, `(n_target)`.
    #[must_use]
    pub fn frames(&self) -> &[Frame] {
        self.frames.get_or_init(|| frames(self))
    }

    /// Whether the map turns left into right, as its frames were decided to.
    #[must_use]
    pub fn mirrors(&self) -> bool {
        self.frames().first().is_some_and(Frame::mirrors)
    }
}

/// Fits a frame at each target vertex to its edges, their images and the two normals.
///
/// A frame takes edges of the images to edges of the target in the least-squares sense (Horn,
/// "Closed-form solution of absolute orientation using unit quaternions", 1987), with the normals
/// as a third direction. Whether frames turn or mirror is decided once, for the whole map.
#[must_use]
fn frames(map: &SurfaceMap) -> Vec<Frame> {
    let n = map.target.vertices.len();
    let moments = smoothed_moments(map);
    let source_normals = map.source.vertex_normals();
    let target_normals = map.target.vertex_normals();
    let image_normals: Vec<Point> = map
        .points
        .iter()
        .map(|p| {
            let corners = map.source.triangles[p.face as usize];
            blend(corners.map(|v| source_normals[v as usize]), p.weights)
        })
        .collect();
    let with_normals: Vec<Matrix> = (0..n)
        .map(|v| {
            let size = (moments[v].target * moments[v].source).sqrt() * NORMAL_SHARE;
            let pair = outer(target_normals[v], image_normals[v]);
            let mut covariance = moments[v].covariance;
            for (row, other) in covariance.iter_mut().zip(pair) {
                *row = vector::add(*row, vector::scaled(other, size));
            }
            covariance
        })
        .collect();
    let sides: f64 = with_normals.iter().map(|m| determinant(m).signum()).sum();
    let mirrored = sides < 0.0;
    let usual = usual_scale(&moments);
    (0..n)
        .into_par_iter()
        .map(|v| {
            let Moments { target, source, .. } = moments[v];
            let scale = (target / source).sqrt();
            Frame {
                turn: nearest_turn(&with_normals[v], mirrored),
                scale: if scale.is_finite() && scale > 0.0 {
                    scale.clamp(usual / LARGEST_SCALE, usual * LARGEST_SCALE)
                } else {
                    usual
                },
            }
        })
        .collect()
}

/// The moments of each target vertex, averaged over its surroundings.
fn smoothed_moments(map: &SurfaceMap) -> Vec<Moments> {
    let n = map.target.vertices.len();
    let mut moments = vec![Moments::default(); n];
    let mut neighbours: Vec<Vec<u32>> = vec![Vec::new(); n];
    for corners in &map.target.triangles {
        for k in 0..3 {
            let (a, b) = (corners[k] as usize, corners[(k + 1) % 3] as usize);
            let d = vector::sub(map.target.vertices[b], map.target.vertices[a]);
            let e = vector::sub(map.images()[b], map.images()[a]);
            let edge = Moments {
                covariance: outer(d, e),
                target: vector::dot(d, d),
                source: vector::dot(e, e),
            };
            moments[a].add(&edge, 1.0);
            moments[b].add(&edge, 1.0);
            neighbours[a].push(corners[(k + 1) % 3]);
            neighbours[b].push(corners[k]);
        }
    }
    for _ in 0..SMOOTHING_ROUNDS {
        moments = (0..n)
            .into_par_iter()
            .map(|v| {
                let mut sum = moments[v];
                for &w in &neighbours[v] {
                    sum.add(&moments[w as usize], 1.0 / neighbours[v].len() as f64);
                }
                sum
            })
            .collect();
    }
    moments
}

/// A scale further than this from that of the whole map is a fault of the map, not of the bodies.
const LARGEST_SCALE: f64 = 4.0;

fn usual_scale(moments: &[Moments]) -> f64 {
    let (target, source) = moments
        .iter()
        .fold((0.0, 0.0), |(t, s), m| (t + m.target, s + m.source));
    if target > 0.0 && source > 0.0 {
        (target / source).sqrt()
    } else {
        1.0
    }
}

fn outer(a: Point, b: Point) -> Matrix {
    a.map(|x| vector::scaled(b, x))
}
