//! What of a soup can be seen from outside: depth buffers from directions all around.
//!
//! Along each axis the nearest and the farthest triangle of every pixel are kept, which are two opposite views. A sample of
//! a face is seen in one of them when the triangle in front of it there is its own, one that shares a corner, or one
//! whose plane passes less than `VISIBLE.slack` before it: the plane and not the pixel's depth, so that skin close under cloth is
//! told from cloth.

use std::f64::consts::PI;

use rayon::prelude::*;

use crate::algebra::vector::{self, Point};
use crate::envelope::settings::VISIBLE;
use crate::error::Result;

const NONE: u32 = u32::MAX;

/// A sample of a face by weights of its corners.
type Weights = [f32; 3];

/// Share of each face that is seen from outside, `(m)`, 0 to 1, of a soup with faces of any winding.
///
/// # Errors
/// [`crate::Error::EmptyMesh`], [`crate::Error::NotFinite`], [`crate::Error::FaceIndexOutOfRange`].
pub fn visible(vertices: &[Point], faces: &[[u32; 3]]) -> Result<Vec<f32>> {
    let scaled = super::scaled::Scaled::of(vertices, faces)?;
    Ok(seen(&scaled.places, faces))
}

/// [`visible`] of a soup of largest extent 1 about the origin.
pub(super) fn seen(places: &[[f32; 3]], faces: &[[u32; 3]]) -> Vec<f32> {
    let samples = Samples::of(places, faces);
    let none = || vec![0u8; samples.face.len()];
    let views = (0..VISIBLE.axes)
        .into_par_iter()
        .fold(none, |mut counts, axis| {
            let view = View::along(direction(axis), places);
            view.count_seen(faces, &samples, &mut counts);
            counts
        })
        .reduce(none, |mut a, b| {
            for (a, b) in a.iter_mut().zip(&b) {
                *a += b;
            }
            a
        });
    let mut totals = vec![(0u16, 0u16); faces.len()];
    for (&face, &count) in samples.face.iter().zip(&views) {
        let (seen, all) = &mut totals[face as usize];
        *seen += u16::from(count >= VISIBLE.seen_from);
        *all += 1;
    }
    let share = |(seen, all): (u16, u16)| f32::from(seen) / f32::from(all.max(1));
    totals.into_iter().map(share).collect()
}

/// Axes spread over a half sphere along a spiral of the golden angle.
fn direction(axis: usize) -> Point {
    let z = (axis as f64 + 0.5) / VISIBLE.axes as f64;
    let angle = PI * (3.0 - 5f64.sqrt()) * axis as f64;
    let radius = (1.0 - z * z).sqrt();
    [radius * angle.cos(), radius * angle.sin(), z]
}

struct Samples {
    face: Vec<u32>,
    weights: Vec<Weights>,
}

impl Samples {
    fn of(places: &[[f32; 3]], faces: &[[u32; 3]]) -> Self {
        let (mut face, mut weights) = (
            Vec::with_capacity(faces.len()),
            Vec::with_capacity(faces.len()),
        );
        for (number, corners) in (0..).zip(faces) {
            let [a, b, c] = corners.map(|v| places[v as usize]);
            let longest = [(a, b), (b, c), (c, a)]
                .map(|(p, q)| (0..3).map(|i| (p[i] - q[i]).powi(2)).sum::<f32>())
                .into_iter()
                .fold(0.0, f32::max)
                .sqrt();
            let parts = if longest <= VISIBLE.one_sample {
                1
            } else if longest <= 2.0 * VISIBLE.one_sample {
                2
            } else {
                4
            };
            // Centroids of the triangle cut into parts along each edge.
            for (i, j) in (0..parts).flat_map(|i| (0..parts - i).map(move |j| (i, j))) {
                for third in [1.0f32, 2.0] {
                    let at = |x: i32| (x as f32 + third / 3.0) / parts as f32;
                    if i + j + i32::from(third > 1.0) < parts {
                        let (u, v) = (at(i), at(j));
                        face.push(number);
                        weights.push([1.0 - u - v, u, v]);
                    }
                }
            }
        }
        Self { face, weights }
    }
}

/// The soup from one direction: two pixel coordinates and depth.
struct View {
    /// Of each vertex.
    seen: Vec<[f32; 3]>,
    width: usize,
    height: usize,
}

impl View {
    fn along(axis: Point, places: &[[f32; 3]]) -> Self {
        let other = if axis[2] < 0.9 {
            [0.0, 0.0, 1.0]
        } else {
            [1.0, 0.0, 0.0]
        };
        let u = vector::normalised(vector::cross(other, axis));
        let frame = [u, vector::cross(axis, u), axis].map(|a| a.map(|x| x as f32 * VISIBLE.pixels));
        let along = |p: &[f32; 3], a: &[f32; 3]| p[0] * a[0] + p[1] * a[1] + p[2] * a[2];
        let mut seen: Vec<[f32; 3]> = places
            .iter()
            .map(|p| frame.each_ref().map(|a| along(p, a)))
            .collect();
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        for p in &seen {
            low = [0, 1].map(|i| low[i].min(p[i]));
            high = [0, 1].map(|i| high[i].max(p[i]));
        }
        for p in &mut seen {
            p[0] -= low[0];
            p[1] -= low[1];
        }
        Self {
            seen,
            width: (high[0] - low[0]) as usize + 1,
            height: (high[1] - low[1]) as usize + 1,
        }
    }

    #[inline(always)]
    fn corners(&self, [a, b, c]: [u32; 3]) -> [[f32; 3]; 3] {
        let at = |v: u32| self.seen[v as usize];
        [at(a), at(b), at(c)]
    }

    /// Adds to each sample the views of both directions from which it is seen.
    fn count_seen(&self, faces: &[[u32; 3]], samples: &Samples, counts: &mut [u8]) {
        let [near, far] = self.nearest_and_farthest(faces);
        for ((&face, weights), count) in samples.face.iter().zip(&samples.weights).zip(counts) {
            let own = faces[face as usize];
            let corners = self.corners(own);
            let plane = Plane::through(corners);
            if plane.cosine < VISIBLE.least_cosine {
                continue;
            }
            let ([a, b, c], [p, q, r]) = (corners, *weights);
            let sum = |i: usize| p * a[i] + q * b[i] + r * c[i];
            let (x, y, depth) = (sum(0), sum(1), sum(2));
            let column = (x as usize).min(self.width - 1);
            let pixel = (y as usize).min(self.height - 1) * self.width + column;
            for (front, sign) in [(near[pixel].1, 1.0), (far[pixel].1, -1.0)] {
                let is_seen = front == NONE || front == face || {
                    let other = faces[front as usize];
                    let touches = other.iter().any(|v| own.contains(v));
                    touches || {
                        let before = Plane::through(self.corners(other)).at(x, y);
                        sign * (depth - before) <= VISIBLE.slack
                    }
                };
                *count += u8::from(is_seen);
            }
        }
    }

    /// Depth and triangle of each pixel, the nearest and the farthest.
    fn nearest_and_farthest(&self, faces: &[[u32; 3]]) -> [Vec<(f32, u32)>; 2] {
        let pixels = self.width * self.height;
        let mut near = vec![(f32::INFINITY, NONE); pixels];
        let mut far = vec![(f32::NEG_INFINITY, NONE); pixels];
        for (number, &face) in (0..).zip(faces) {
            let [a, b, c] = self.corners(face);
            let columns = centres(a[0], b[0], c[0], self.width);
            let rows = centres(a[1], b[1], c[1], self.height);
            if columns.is_empty() || rows.is_empty() {
                continue;
            }
            let plane = Plane::through([a, b, c]);
            if plane.cosine <= 0.0 {
                continue;
            }
            let turn = if plane.twice_area < 0.0 { -1.0 } else { 1.0 };
            let edges = [edge(a, b, turn), edge(b, c, turn), edge(c, a, turn)];
            for row in rows {
                let y = row as f32 + 0.5;
                for column in columns.clone() {
                    let x = column as f32 + 0.5;
                    let at = |e: &[f32; 3]| e[0] * x + e[1] * y + e[2];
                    let [e, f, g] = &edges;
                    if at(e).min(at(f)).min(at(g)) >= -VISIBLE.cover {
                        let pixel = row * self.width + column;
                        let depth = plane.at(x, y);
                        if depth < near[pixel].0 {
                            near[pixel] = (depth, number);
                        }
                        if depth > far[pixel].0 {
                            far[pixel] = (depth, number);
                        }
                    }
                }
            }
        }
        [near, far]
    }
}

/// Pixels along an axis whose centre lies between three coordinates.
#[inline(always)]
fn centres(a: f32, b: f32, c: f32, size: usize) -> std::ops::Range<usize> {
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    ((low + 0.5 - VISIBLE.cover) as usize)..((high + 0.5) as usize).min(size)
}

/// a, b and c of a·x + b·y + c, which is 0 on the line through p and q and positive to the left of it, or to its right
/// when turned.
#[inline(always)]
fn edge(p: [f32; 3], q: [f32; 3], turn: f32) -> [f32; 3] {
    let (dx, dy) = (turn * (q[0] - p[0]), turn * (q[1] - p[1]));
    [-dy, dx, dy * p[0] - dx * p[1]]
}

/// Depth over the pixels of a triangle's plane.
struct Plane {
    origin: [f32; 3],
    slope: [f32; 2],
    /// Twice its area in pixels, with sign.
    twice_area: f32,
    /// Between normal and view, not negative.
    cosine: f32,
}

impl Plane {
    #[inline(always)]
    fn through([a, b, c]: [[f32; 3]; 3]) -> Self {
        let (p, q) = (super::place::sub(b, a), super::place::sub(c, a));
        let n = super::place::cross(p, q);
        let length = super::place::dot(n, n).sqrt();
        let cosine = if length > 0.0 {
            n[2].abs() / length
        } else {
            0.0
        };
        let slope = if cosine > 0.0 {
            [-n[0] / n[2], -n[1] / n[2]]
        } else {
            [0.0; 2]
        };
        Self {
            origin: a,
            slope,
            twice_area: n[2],
            cosine,
        }
    }

    #[inline(always)]
    fn at(&self, x: f32, y: f32) -> f32 {
        self.origin[2] + self.slope[0] * (x - self.origin[0]) + self.slope[1] * (y - self.origin[1])
    }
}
