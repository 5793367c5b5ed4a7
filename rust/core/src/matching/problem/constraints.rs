//! What the user knows of the map: pairs of points, and that both shapes stand in one frame.

use faer::Mat;

use crate::error::Result;
use crate::geodesics;
use crate::matching::problem::settings::CONSTRAINTS;
use crate::shape::Shape;
use crate::watch::progress::Progress;

/// Which shape of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Which {
    /// The one whose points are asked for.
    Target,
    /// The one that answers.
    Source,
}

impl Which {
    /// The other one.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Target => Self::Source,
            Self::Source => Self::Target,
        }
    }

    /// Units of length of the other shape that one of this one is, by how many of the source one of the target is;
    /// and back.
    #[must_use]
    pub fn seen(self, lengths: f64) -> f64 {
        match self {
            Self::Target => lengths,
            Self::Source => 1.0 / lengths,
        }
    }
}

/// Known pairs of points, with distances from them over both surfaces.
#[derive(Debug)]
pub struct Constraints {
    /// Pairs (source vertex, target vertex) of the checked meshes.
    pub landmarks: Vec<(u32, u32)>,
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
        landmarks: Vec<(u32, u32)>,
        same_axes: bool,
        progress: &Progress,
    ) -> Result<Self> {
        let march = |shape: &Shape, from: Vec<u32>| {
            geodesics::distances_from(&shape.marching, &from, &|| progress.is_cancelled())
        };
        Ok(Self {
            on_target: march(target, landmarks.iter().map(|&(_, t)| t).collect())?,
            on_source: march(source, landmarks.iter().map(|&(s, _)| s).collect())?,
            landmarks,
            same_axes,
        })
    }

    /// What is known of the inverse map.
    #[must_use]
    pub fn inverse(&self) -> Self {
        Self {
            landmarks: self.landmarks.iter().map(|&(s, t)| (t, s)).collect(),
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
