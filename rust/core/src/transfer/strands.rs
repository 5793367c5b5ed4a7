//! Hair: strands stand on the target where the map takes their roots, and keep their shape.

use rayon::prelude::*;

use crate::algebra::similarity::nearest_turn;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::mesh::surface_point::SurfacePoint;
use crate::transfer::frame::Frame;
use crate::transfer::surface::{Surface, blend};
use crate::transfer::surface_map::SurfaceMap;

/// A place of the source and its counterpart, with the similarity of the surface there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Root {
    /// The counterpart: a point of the target.
    pub point: SurfacePoint,
    /// How the surface is turned and scaled there.
    pub frame: Frame,
    /// Trust in the counterpart, 0 to 1; 0 also where the target has nothing that corresponds.
    pub confidence: f64,
    from: Point,
    to: Point,
}

impl Root {
    /// Where a point of the strand goes.
    #[must_use]
    pub fn apply(&self, p: Point) -> Point {
        vector::add(self.to, self.frame.apply(vector::sub(p, self.from)))
    }
}

impl SurfaceMap {
    /// The counterparts on the target of places on or beside the source.
    ///
    /// The point of the source that is nearest to a place lies in the image of a triangle of the
    /// target, or is nearest to it, and its counterpart has the same weights in that triangle.
    /// Further from it than an edge is long, the target has no counterpart.
    ///
    /// # Errors
    /// None beyond those of [`Surface::new`], which the images of a map satisfy.
    pub fn roots(&self, places: &[Point]) -> Result<Vec<Root>> {
        let triangles: Vec<[i64; 3]> = self
            .target
            .triangles
            .iter()
            .map(|t| t.map(i64::from))
            .collect();
        let image = Surface::new(self.images().to_vec(), &triangles)?;
        let (frames, mirrored) = (self.frames(), self.mirrors());
        Ok(places
            .par_iter()
            .map(|&place| {
                let below = self.source.nearest(place);
                let from = self.source.position(&below);
                let point = image.nearest(from);
                let gap = vector::distance(from, image.position(&point));
                let reach = image
                    .longest_edge(point.face)
                    .max(self.source.longest_edge(below.face));
                let corners = self.target.triangles[point.face as usize].map(|v| v as usize);
                let trust: f64 = (0..3)
                    .map(|k| point.weights[k] * self.confidence[corners[k]])
                    .sum();
                Root {
                    point,
                    frame: mean(corners.map(|v| frames[v]), point.weights, mirrored),
                    confidence: if gap > reach { 0.0 } else { trust },
                    from,
                    to: self.target.position(&point),
                }
            })
            .collect())
    }
}

/// The weighted mean of three frames.
fn mean(frames: [Frame; 3], weights: [f64; 3], mirrored: bool) -> Frame {
    let turn = [0, 1, 2].map(|row| blend(frames.map(|f| f.turn[row]), weights));
    Frame {
        turn: nearest_turn(&turn, mirrored),
        scale: (0..3).map(|k| weights[k] * frames[k].scale).sum(),
    }
}
