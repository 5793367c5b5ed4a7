//! Where a refinement stands, and what is read from it.

use faer::Mat;

use crate::algebra::vector::{self, Point};
use crate::matching::problem::point_map::PointMaps;
use crate::matching::problem::which::Which;
use crate::matching::refinement::side::Side;

/// Where a refinement stands.
#[derive(Debug, Clone)]
pub struct Refined<'a> {
    /// The shape that is deformed: the part, else the target.
    pub(super) moving: Side<'a>,
    /// The shape that stays.
    pub(super) still: Side<'a>,
    /// Which of the pair is deformed.
    pub(super) moving_is: Which,
    /// The moving shape as it lies on the other in the last step, `(n, 3)`.
    pub(super) deformed: Mat<f64>,
    /// Map of the last step, coefficients of the moving shape → those of the other.
    pub(super) matrix: Mat<f64>,
    /// R² of each of the moving shape's eigenfunctions, `(k)`: how much of it the map finds on the other.
    pub(super) shared: Vec<f64>,
    /// Units of length of the other shape that one of the moving shape is.
    pub(super) lengths: f64,
}

impl<'a> Refined<'a> {
    /// The target's side.
    #[must_use]
    pub fn target(&self) -> &Side<'a> {
        self.side(Which::Target)
    }

    /// The source's side.
    #[must_use]
    pub fn source(&self) -> &Side<'a> {
        self.side(Which::Source)
    }

    /// The point maps: all vertices of both shapes.
    #[must_use]
    pub fn maps(&self) -> PointMaps<&[u32]> {
        PointMaps {
            target_to_source: &self.target().images.vertex,
            source_to_target: &self.source().images.vertex,
        }
    }

    /// The side of either.
    pub(crate) fn side(&self, which: Which) -> &Side<'a> {
        if which == self.moving_is {
            &self.moving
        } else {
            &self.still
        }
    }

    /// Source and target.
    pub(super) fn sides_mut(&mut self) -> [&mut Side<'a>; 2] {
        match self.moving_is {
            Which::Target => [&mut self.still, &mut self.moving],
            Which::Source => [&mut self.moving, &mut self.still],
        }
    }

    /// Units of length of the source that one of the target is.
    #[must_use]
    pub fn lengths(&self) -> f64 {
        self.moving_is.seen(self.lengths)
    }

    /// How far apart each target vertex and its image are where one surface lies on the other.
    #[must_use]
    pub fn gaps(&self) -> Vec<f64> {
        let target = &self.target().shape.mesh.vertices;
        let source = &self.source().shape.mesh.vertices;
        let images = self.target().images.vertex.iter().enumerate();
        images
            .map(|(v, &image)| match self.moving_is {
                Which::Target => vector::distance(self.deformed_at(v), source[image as usize]),
                Which::Source => vector::distance(self.deformed_at(image as usize), target[v]),
            })
            .collect()
    }

    /// Where a vertex of the moving shape lies on the other in the last step.
    pub(super) fn deformed_at(&self, v: usize) -> Point {
        [0, 1, 2].map(|c| self.deformed[(v, c)])
    }

    /// Point of the moving shape, point of the other and weight of all matches, both ways.
    pub(super) fn matched(&self) -> Vec<(Point, Point, f64)> {
        let (m, s) = (&self.moving, &self.still);
        let at = |side: &Side, v: u32| side.shape.mesh.vertices[v as usize];
        let asked = (0..m.asking.len())
            .map(|i| (at(m, m.asking[i]), at(s, m.images.vertex[i]), m.weights[i]));
        let answered = (0..s.asking.len())
            .map(|i| (at(m, s.images.vertex[i]), at(s, s.asking[i]), s.weights[i]));
        asked.chain(answered).collect()
    }
}

pub(super) fn as_matrix(points: &[Point]) -> Mat<f64> {
    Mat::from_fn(points.len(), 3, |i, c| points[i][c])
}
