//! Where each place of a garment belongs: its anchor on the body, the frame there, and the place that follows.

use rayon::prelude::*;

use super::Settings;
use super::bodies::Bodies;
use super::frame::{Frame, determinant, times};
use super::garment::Garment;
use crate::algebra::similarity::Similarity;
use crate::algebra::vector::{self, Point};
use crate::mesh::surface_point::SurfacePoint;

/// What binds one place of a garment to the bodies.
#[derive(Debug, Clone, Copy)]
pub struct Binding {
    /// The nearest place of the wrapped body, on the target's triangles.
    pub anchor: SurfacePoint,
    /// Distance to it, in heights of the source.
    pub distance: f64,
    /// Signed distance to the source's surface, as one on the target.
    pub clearance: f64,
    /// The map of the body around it.
    pub frame: Frame,
    /// Where it goes for itself.
    pub goal: Point,
}

impl Binding {
    /// Cube root of the volume that J makes of 1.
    #[must_use]
    pub fn scale(&self) -> f64 {
        determinant(&self.frame.linear).abs().cbrt()
    }

    /// 1 for what lies on the skin, less the further off it is.
    #[must_use]
    pub fn tightness(&self, settings: &Settings) -> f64 {
        1.0 / (1.0 + (self.distance / settings.hold_reach).powi(2))
    }
}

/// Binds every place of a garment.
#[must_use]
pub fn bound(bodies: &Bodies, garment: &Garment, settings: &Settings) -> Vec<Binding> {
    let whole = whole(bodies);
    garment
        .places
        .par_iter()
        .map(|&g| {
            let anchor = bodies.anchor(g);
            let (q, normal) = bodies.on_source(&anchor);
            let distance = vector::distance(g, q) / bodies.heights[0];
            let mut width = settings.width(distance);
            let mut found = frame(bodies, (q, normal), width, settings);
            while let Some(f) = found
                && f.residual > settings.residual
                && width < settings.widest
            {
                width *= settings.widen;
                found = frame(bodies, (q, normal), width, settings).or(Some(f));
            }
            let frame = found.unwrap_or(whole);
            let [on_target, moved] = [bodies.map.target.position(&anchor), frame.apply(q)];
            let relief = vector::sub(on_target, moved);
            let tight = (-(distance / settings.relief_reach).powi(2)).exp();
            let nearest = bodies.source.nearest(&bodies.map.source, g, None);
            Binding {
                anchor,
                distance,
                clearance: determinant(&frame.linear).abs().cbrt() * nearest.distance,
                frame,
                goal: vector::add(frame.apply(g), vector::scaled(relief, tight)),
            }
        })
        .collect()
}

/// The frame of the bodies around a place of the source, of a width in heights.
#[must_use]
pub fn frame(
    bodies: &Bodies,
    at: (Point, Point),
    width: f64,
    settings: &Settings,
) -> Option<Frame> {
    let samples = &bodies.samples[usize::from(width > settings.wide)];
    samples.frame(
        at,
        width * bodies.heights[0],
        settings.neighbours,
        bodies.mirrored,
        settings,
    )
}

/// The similarity of the whole map, for a place that nothing is near to which looks the same way.
fn whole(bodies: &Bodies) -> Frame {
    let map = &bodies.map;
    let pairs: Vec<(Point, Point, f64)> = map
        .images()
        .iter()
        .zip(&map.target.vertices)
        .map(|(&x, &y)| (x, y, 1.0))
        .collect();
    let fitted = Similarity::fitted(&pairs, bodies.mirrored);
    Frame {
        from: fitted.from,
        to: fitted.to,
        linear: fitted.turn.map(|row| vector::scaled(row, fitted.scale)),
        turn: fitted.turn,
        scale: fitted.scale,
        out: [0.0; 3],
        residual: 0.0,
    }
}

/// Offsets along edges as the frames of their ends take them, `½(Jᵢ + Jⱼ)(gⱼ − gᵢ)`.
#[must_use]
pub fn edge_offsets(garment: &Garment, bindings: &[Binding], settings: &Settings) -> Vec<Point> {
    let mut linear: Vec<[Point; 3]> = bindings.iter().map(|b| b.frame.linear).collect();
    for _ in 0..settings.smooth {
        let mut sum = linear.clone();
        let mut count = vec![1.0; sum.len()];
        for &[a, b] in &garment.edges {
            let [i, j] = [a, b].map(|v| v as usize);
            for k in 0..3 {
                sum[i][k] = vector::add(sum[i][k], linear[j][k]);
                sum[j][k] = vector::add(sum[j][k], linear[i][k]);
            }
            count[i] += 1.0;
            count[j] += 1.0;
        }
        for (l, (s, c)) in linear.iter_mut().zip(sum.iter().zip(count)) {
            *l = s.map(|row| vector::scaled(row, 1.0 / c));
        }
    }
    garment
        .edges
        .par_iter()
        .map(|&[a, b]| {
            let [i, j] = [a, b].map(|v| v as usize);
            let along = vector::sub(garment.places[j], garment.places[i]);
            let both = [i, j].map(|v| times(&linear[v], along));
            vector::scaled(vector::add(both[0], both[1]), 0.5)
        })
        .collect()
}
