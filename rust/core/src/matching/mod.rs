//! The whole chain: two prepared shapes in, a dense map out.

mod choice;
mod completed;
pub(crate) mod detail;
pub(crate) mod partial;
pub mod problem;
mod published;
pub mod ranking;
pub mod refinement;
pub mod result;
pub mod search;
pub mod settings;
pub mod standing;
pub mod symmetry;

use std::sync::Arc;

use crate::baselines::{functional_map, gmds};
use crate::error::{Error, Result};
use crate::matching::problem::constraints::Constraints;
use crate::matching::problem::landmark::Landmark;
use crate::matching::problem::pair::{Coverage, LeftOut, Mirror, Pair};
use crate::mesh::numbering::{InputVertex, WorkingVertex};
use crate::shape::Shape;
use crate::watch::progress::Progress;

pub use choice::completed;
pub use published::energy;
pub use result::correspondence::Correspondence;

use choice::{as_requested, clearest, whole_or_part};
use published::{by_paper, embedded};

/// Which algorithm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Search, vote and refinement.
    Auto,
    /// The published algorithm from an automatic start.
    Paper,
    /// Multidimensional scaling of sampled points, for comparison.
    Gmds,
    /// A functional map from descriptors, for comparison.
    FunctionalMap,
}

/// What the caller may ask for; landmarks by the numbers that vertices have in what is matched.
#[derive(Debug, Clone)]
pub struct Options<Vertex> {
    /// Algorithm.
    pub method: Method,
    /// Whether mirrored maps are allowed.
    pub mirror: Mirror,
    /// Which shape is a part of the other; found out when `None`.
    pub coverage: Option<Coverage>,
    /// Pairs of points that belong together.
    pub landmarks: Vec<Landmark<Vertex>>,
    /// Whether left, front and up are the same directions on both shapes.
    pub same_axes: bool,
    /// Parts of the automatic method that are not used, to see what they contribute.
    pub left_out: LeftOut,
}

impl<Vertex> Options<Vertex> {
    /// The same with other landmarks, whose vertices may be numbered otherwise.
    #[must_use]
    pub fn with_landmarks<Other>(&self, landmarks: Vec<Landmark<Other>>) -> Options<Other> {
        Options {
            landmarks,
            method: self.method,
            mirror: self.mirror,
            coverage: self.coverage,
            same_axes: self.same_axes,
            left_out: self.left_out,
        }
    }
}

impl<Vertex> Default for Options<Vertex> {
    fn default() -> Self {
        Self {
            method: Method::Auto,
            mirror: Mirror::Forbid,
            coverage: None,
            landmarks: Vec::new(),
            same_axes: false,
            left_out: LeftOut::default(),
        }
    }
}

/// Finds the map.
///
/// # Errors
/// [`Error::NoMap`], [`Error::Cancelled`], and those of the stages.
pub fn match_shapes(
    source: &Arc<Shape>,
    target: &Arc<Shape>,
    options: &Options<InputVertex>,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<Correspondence> {
    if source.metric != target.metric {
        return Err(Error::BadArgument {
            what: format!(
                "the source has the {} metric and the target the {} one: prepare both with the same",
                source.metric.name(),
                target.metric.name()
            ),
        });
    }
    match options.method {
        Method::Paper => {
            let embedding = by_paper(source, target, progress, report)?;
            embedded(source, target, &embedding, progress, report)
        }
        Method::Gmds => {
            report("GMDS", 0.0)?;
            let embedding = gmds::embedded(source, target, progress)?;
            embedded(source, target, &embedding, progress, report)
        }
        Method::FunctionalMap => {
            report("functional map", 0.0)?;
            let embedding = functional_map::embedded(source, target, progress)?;
            embedded(source, target, &embedding, progress, report)
        }
        Method::Auto => {
            let landmarks = working_landmarks(source, target, &options.landmarks)?;
            if !landmarks.is_empty() {
                report("landmarks", 0.0)?;
            }
            let constraints = Arc::new(Constraints::new(
                source,
                target,
                landmarks,
                options.same_axes,
                progress,
            )?);
            let pair = Pair {
                target,
                source,
                coverage: options.coverage.unwrap_or(Coverage::BOTH),
                mirror: options.mirror,
                constraints: &constraints,
                left_out: options.left_out,
                lengths: 1.0,
                mirror_offsets: None,
            };
            let hypotheses = if options.coverage.is_some() {
                as_requested(&pair, progress, &|s, f| report(s, 0.6 * f))?
            } else {
                whole_or_part(&pair, progress, report)?
            };
            let mut found = clearest(&pair, hypotheses, progress, &|s, f| {
                report(s, 0.6 + 0.4 * f)
            })?;
            found.constraints = Arc::clone(&constraints);
            Ok(found)
        }
    }
}

/// Landmarks as vertices of the meshes on which the map is sought.
fn working_landmarks(
    source: &Shape,
    target: &Shape,
    given: &[Landmark<InputVertex>],
) -> Result<Vec<Landmark<WorkingVertex>>> {
    let find = |shape: &Shape, which: &str, vertex: InputVertex| {
        let found = shape.working_vertex(vertex);
        found.ok_or_else(|| Error::BadArgument {
            what: format!(
                "landmark vertex {} of the {which} is not on its largest part: \
                 choose a vertex of the main surface",
                vertex.0
            ),
        })
    };
    let landmark = |given: &Landmark<InputVertex>| {
        Ok(Landmark {
            source: find(source, "source", given.source)?,
            target: find(target, "target", given.target)?,
        })
    };
    given.iter().map(landmark).collect()
}
