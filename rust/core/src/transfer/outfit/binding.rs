//! Where each place of a garment belongs: its anchor on the body, the frame there, and the place that follows.

use rayon::prelude::*;

use super::bodies::Bodies;
use super::frame::Frame;
use super::garment::Garment;
use super::settings::Settings;
use crate::algebra::similarity::Similarity;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::mesh::surface_point::SurfacePoint;
use crate::watch::progress::Check;

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
    /// 1 for what lies on the skin, less the further off it is.
    #[must_use]
    pub fn tightness(&self, settings: &Settings) -> f64 {
        1.0 / (1.0 + (self.distance / settings.hold_reach).powi(2))
    }
}

/// Binds every place of a garment.
///
/// With the anchor q, its counterpart Y(q) on the target, the distance d and the frame J there the goal is
/// `ȳ + J (g − x̄) + exp(−(d/r)²) [Y(q) − ȳ − J (q − x̄)]`: tight cloth takes the target's relief, loose cloth does not.
///
/// # Errors
/// [`Cancelled`](crate::Error::Cancelled).
pub fn bound(
    bodies: &Bodies,
    garment: &Garment,
    settings: &Settings,
    check: Check<'_>,
) -> Result<Vec<Binding>> {
    let whole = whole(bodies);
    garment
        .places
        .par_iter()
        .map(|&g| {
            check()?;
            let anchor = bodies.anchor(g);
            let (q, normal) = bodies.on_source(&anchor);
            let distance = vector::distance(g, q) / bodies.heights[0];
            let width = settings.width(distance);
            let samples = &bodies.samples[usize::from(width > settings.wide)];
            let (width, mirrored) = (width * bodies.heights[0], bodies.mirrored);
            let frame = samples
                .frame((q, normal), width, mirrored, settings)
                .unwrap_or(whole);
            let on_target = bodies.map.target.position(&anchor);
            let relief = vector::sub(on_target, frame.apply(q));
            let tight = (-(distance / settings.relief_reach).powi(2)).exp();
            let nearest = bodies.source.nearest(&bodies.map.source, g, None);
            Ok(Binding {
                anchor,
                distance,
                clearance: frame.size() * nearest.distance,
                frame,
                goal: vector::add(frame.apply(g), vector::scaled(relief, tight)),
            })
        })
        .collect()
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
        out: [0.0; 3],
    }
}
