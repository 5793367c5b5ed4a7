//! What is known of two bodies and the map between them before any garment is seen.

use std::sync::Arc;

use super::frame::{Pair, Samples};
use super::outside::Outside;
use super::settings::Settings;
use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};
use crate::mesh::surface_point::SurfacePoint;
use crate::transfer::settings::BODIES;
use crate::transfer::surface::{Surface, blend};
use crate::transfer::surface_map::SurfaceMap;

/// Source, target and the target wrapped around the source: each of its vertices at its image.
///
/// Binding to the wrapped body is binding to the target in the source's pose: limbs of the target that touch one another
/// do not matter.
#[derive(Debug)]
pub struct Bodies {
    /// The map.
    pub map: Arc<SurfaceMap>,
    /// Sides of the source.
    pub source: Outside,
    /// Sides of the target.
    pub target: Outside,
    /// The target's triangles with the images of their corners.
    pub wrapped: Surface,
    /// Normals of the source at the images.
    normals: Vec<Point>,
    /// Which of the target's triangles something is known of.
    known: Vec<bool>,
    /// Heights of the two, as a person's (`BODIES.height`).
    pub heights: [f64; 2],
    /// Whether the map turns left into right.
    pub mirrored: bool,
    /// Places of the bodies, many and few.
    pub samples: [Samples; 2],
}

impl Bodies {
    /// Prepares a map.
    ///
    /// # Errors
    /// [`Error::BadArgument`] when a body has no area, or the map takes all of the target to one place.
    pub fn new(map: Arc<SurfaceMap>, settings: &Settings) -> Result<Self> {
        let (source, target) =
            rayon::join(|| Outside::of(&map.source), || Outside::of(&map.target));
        let triangles: Vec<[i64; 3]> = map
            .target
            .triangles
            .iter()
            .map(|t| t.map(i64::from))
            .collect();
        let wrapped = Surface::new(map.images().to_vec(), &triangles)?;
        let normals: Vec<Point> = map
            .points
            .iter()
            .map(|p| source.smooth_normal(&map.source, p))
            .collect();
        let mut known: Vec<bool> = map
            .target
            .triangles
            .iter()
            .map(|t| t.iter().any(|&v| map.confidence[v as usize] > 0.0))
            .collect();
        if !known.contains(&true) {
            known.fill(true);
        }
        let areas = [&map.source, &map.target, &wrapped].map(area);
        for (name, area) in ["source has", "target has", "target's image has"]
            .iter()
            .zip(areas)
        {
            if !area.is_normal() {
                return Err(Error::BadArgument {
                    what: format!(
                        "the {name} no area: give two bodies and a map between their surfaces"
                    ),
                });
            }
        }
        let heights = [areas[0], areas[1]].map(|area| BODIES.height * area.sqrt());
        let facing: f64 = (0..wrapped.triangles.len() as u32)
            .map(|t| {
                let corners = wrapped.triangles[t as usize].map(|v| normals[v as usize]);
                vector::dot(wrapped.cross(t), blend(corners, [1.0; 3]))
            })
            .sum();
        let pair = |face: u32, weights: [f64; 3]| {
            let corners = wrapped.triangles[face as usize];
            let mixed = |of: &[Point]| blend(corners.map(|v| of[v as usize]), weights);
            let confidence: f64 = (0..3)
                .map(|k| weights[k] * map.confidence[corners[k] as usize])
                .sum();
            Pair {
                trust: confidence.max(settings.least_trust).powi(settings.trust),
                from: (
                    mixed(&wrapped.vertices),
                    vector::normalised(mixed(&normals)),
                ),
                to: (
                    mixed(&map.target.vertices),
                    vector::normalised(mixed(target.vertices())),
                ),
            }
        };
        let samples = settings
            .samples
            .map(|count| Samples::spread(&wrapped, count, pair));
        let mirrored = facing * target.side() < 0.0;
        Ok(Self {
            map,
            source,
            target,
            wrapped,
            normals,
            known,
            heights,
            mirrored,
            samples,
        })
    }

    /// The place of the wrapped body nearest to a point of the source, on the target's triangles.
    ///
    /// # Panics
    /// Never: [`Bodies::new`] refuses a map of which nothing is known.
    #[must_use]
    pub fn anchor(&self, g: Point) -> SurfacePoint {
        self.wrapped
            .nearest_where(g, None, |t| self.known[t as usize])
            .expect("something is known of one triangle at least")
    }

    /// Position and normal, on the source, of a point of the target's triangles.
    #[must_use]
    pub fn on_source(&self, point: &SurfacePoint) -> (Point, Point) {
        let corners = self.wrapped.triangles[point.face as usize];
        let normal = blend(corners.map(|v| self.normals[v as usize]), point.weights);
        (self.wrapped.position(point), vector::normalised(normal))
    }
}

fn area(surface: &Surface) -> f64 {
    let twice: f64 = (0..surface.triangles.len() as u32)
        .map(|t| vector::norm(surface.cross(t)))
        .sum();
    0.5 * twice
}
