//! What the user knows of the map: pairs of points, and that both shapes stand in one frame.

use faer::Mat;

use crate::error::Result;
use crate::geodesics;
use crate::matching::problem::landmark::Landmark;
use crate::matching::problem::settings::CONSTRAINTS;
use crate::matching::problem::which::Which;
use crate::mesh::numbering::WorkingVertex;
use crate::shape::Shape;
use crate::watch::progress::Progress;

/// Known pairs of points, with distances from them over both surfaces.
#[derive(Debug)]
pub struct Constraints {
    /// Pairs of points that belong together.
    pub landmarks: Vec<Landmark<WorkingVertex>>,
    /// Whether left, front and up are the same directions on both shapes.
    pub same_axes: bool,
    on_target: Mat<f32>,
    on_source: Mat<f32>,
}

impl Default for Constraints {
    /// Nothing is known.
    fn default() -> Self {
        Self {
            landmarks: Vec::new(),
            same_axes: false,
            on_target: Mat::new(),
            on_source: Mat::new(),
        }
    }
}

impl Constraints {
    /// Marches distances from the landmarks.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn new(
        source: &Shape,
        target: &Shape,
        landmarks: Vec<Landmark<WorkingVertex>>,
        same_axes: bool,
        progress: &Progress,
    ) -> Result<Self> {
        let march = |shape: &Shape, which: Which| {
            let from: Vec<u32> = landmarks.iter().map(|l| l.on(which).0).collect();
            geodesics::distances_from(&shape.marching, &from, &|| progress.is_cancelled())
        };
        Ok(Self {
            on_target: march(target, Which::Target)?,
            on_source: march(source, Which::Source)?,
            landmarks,
            same_axes,
        })
    }

    /// What is known of the inverse map.
    #[must_use]
    pub fn inverse(&self) -> Self {
        Self {
            landmarks: self.landmarks.iter().map(|l| l.inverse()).collect(),
            same_axes: self.same_axes,
            on_target: self.on_source.clone(),
            on_source: self.on_target.clone(),
        }
    }

    /// Whether nothing is known.
    #[must_use]
    pub fn are_none(&self) -> bool {
        self.landmarks.is_empty() && !self.same_axes
    }

    /// What draws the images of vertices together in the search, a column each, `(c, vertices)`.
    #[must_use]
    pub fn in_search(&self, which: Which, shape: &Shape, vertices: &[u32]) -> Mat<f32> {
        let near = self.nearness(which, CONSTRAINTS.search_reach, CONSTRAINTS.search_weight);
        let known = self.landmarks.len();
        let axes = if self.same_axes { 3 } else { 0 };
        Mat::from_fn(known + axes, vertices.len(), |c, i| {
            if c < known {
                near(vertices[i], c)
            } else {
                (CONSTRAINTS.axes_weight * shape.mesh.vertices[vertices[i] as usize][c - known])
                    as f32
            }
        })
    }

    /// What holds the images of the landmarks in the refinement, `(n, c)`; close to a landmark a
    /// unit is a unit of length.
    #[must_use]
    pub fn in_refinement(&self, which: Which) -> Mat<f32> {
        let near = self.nearness(
            which,
            CONSTRAINTS.refinement_reach,
            CONSTRAINTS.refinement_reach,
        );
        let n = self.distances(which).nrows();
        Mat::from_fn(n, self.landmarks.len(), |v, l| near(v as u32, l))
    }

    fn distances(&self, which: Which) -> &Mat<f32> {
        match which {
            Which::Target => &self.on_target,
            Which::Source => &self.on_source,
        }
    }

    /// Weight at a landmark, falling off with the distance from it.
    fn nearness(&self, which: Which, reach: f64, weight: f64) -> impl Fn(u32, usize) -> f32 + '_ {
        let distances = self.distances(which);
        move |v, l| {
            let d = f64::from(distances[(v as usize, l)]);
            (weight * (-d / reach).exp()) as f32
        }
    }
}
