//! Vertex maps with the shapes between which they lead, so that neither can be taken for the other.

use crate::matching::problem::which::Which;
use crate::shape::Shape;

/// A map from all vertices of one shape to vertices of the other.
///
/// Either may be the target: a pair is asked both ways.
#[derive(Debug, Clone, Copy)]
pub struct PointMap<'a> {
    /// The shape whose vertices have images.
    pub from: &'a Shape,
    /// The shape on which the images lie.
    pub to: &'a Shape,
    /// Vertex of `to` for each vertex of `from`.
    pub images: &'a [u32],
}

impl<'a> PointMap<'a> {
    /// Another map between the same shapes.
    #[must_use]
    pub fn with(self, images: &'a [u32]) -> Self {
        Self { images, ..self }
    }

    /// Image of a vertex.
    #[must_use]
    pub fn image(self, vertex: u32) -> u32 {
        self.images[vertex as usize]
    }
}

/// A map from the first farthest-point samples of one shape to vertices of the other.
#[derive(Debug, Clone, Copy)]
pub struct SampledMap<'a> {
    /// The shape whose samples have images.
    pub from: &'a Shape,
    /// The shape on which the images lie.
    pub to: &'a Shape,
    /// Vertex of `to` for each of those samples.
    pub images: &'a [u32],
}

/// The point maps of a pair, both ways: lists of images, for all vertices or for samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PointMaps<Images> {
    /// Points of the source for those of the target.
    pub target_to_source: Images,
    /// Points of the target for those of the source.
    pub source_to_target: Images,
}

impl<Images> PointMaps<Images> {
    /// Images of the points of either shape.
    pub fn of(&self, which: Which) -> &Images {
        match which {
            Which::Target => &self.target_to_source,
            Which::Source => &self.source_to_target,
        }
    }

    /// Those of the inverse map.
    #[must_use]
    pub fn inverse(self) -> Self {
        Self {
            target_to_source: self.source_to_target,
            source_to_target: self.target_to_source,
        }
    }
}

impl<Point> PointMaps<Vec<Point>> {
    /// The same lists, borrowed.
    #[must_use]
    pub fn as_slices(&self) -> PointMaps<&[Point]> {
        PointMaps {
            target_to_source: &self.target_to_source,
            source_to_target: &self.source_to_target,
        }
    }
}
