//! Where a refinement starts: first images, and the moving shape placed on the other.

use faer::{Mat, MatRef};

use super::state::Refined;
use crate::algebra::dense::Rows;
use crate::algebra::similarity::Similarity;
use crate::error::Result;
use crate::matching::problem::pair::Pair;
use crate::matching::problem::point_map::PointMaps;
use crate::matching::problem::which::Which;
use crate::matching::refinement::propagation::Images;
use crate::matching::refinement::settings::EMBEDDING;
use crate::matching::refinement::side::Side;
use crate::mesh::Adjacency;
use crate::shape::Shape;
use crate::watch::progress::Check;

impl<'a> Refined<'a> {
    /// Where no image is known yet.
    pub(super) fn unknown(pair: &Pair<'a>, moving_is: Which, drawn: Option<usize>) -> Self {
        let (moving, still) = rayon::join(
            || Side::new(pair, moving_is, drawn),
            || Side::new(pair, moving_is.other(), drawn),
        );
        Self {
            moving,
            still,
            moving_is,
            deformed: Mat::zeros(0, 3),
            matrix: Mat::zeros(0, 0),
            shared: Vec::new(),
            lengths: moving_is.seen(pair.lengths),
        }
    }

    /// Where all vertices ask and have these images; nothing else is known yet.
    pub(in crate::matching::refinement) fn by_images(
        pair: &Pair<'a>,
        moving_is: Which,
        images: PointMaps<Vec<u32>>,
    ) -> Self {
        let mut state = Self::unknown(pair, moving_is, None);
        let [source, target] = state.sides_mut();
        target.images.vertex = images.target_to_source;
        source.images.vertex = images.source_to_target;
        state
    }

    pub(super) fn start(
        pair: &Pair<'a>,
        matrix: MatRef<'_, f64>,
        samples: Option<PointMaps<&[u32]>>,
        drawn: Option<usize>,
        check: Check<'_>,
    ) -> Result<Self> {
        check()?;
        let (of_target, of_source) = samples
            .map(|samples| (samples.target_to_source, samples.source_to_target))
            .unzip();
        let moving_is = pair.coverage.part().unwrap_or(Which::Target);
        let mut state = Self::unknown(pair, moving_is, drawn);
        let [source, target] = state.sides_mut();
        (source.rows, target.rows) = rayon::join(
            || pair.source.rows.times(matrix),
            || pair.target.rows.first(matrix.ncols()),
        );
        let (on_source, on_target) = rayon::join(
            || {
                first_images(
                    &mut target.images,
                    &target.asking,
                    (pair.target, of_target),
                    (&target.rows, &target.neighbours),
                    (pair.source, &source.rows),
                    check,
                )
            },
            || {
                first_images(
                    &mut source.images,
                    &source.asking,
                    (pair.source, of_source),
                    (&source.rows, &source.neighbours),
                    (pair.target, &target.rows),
                    check,
                )
            },
        );
        on_source.and(on_target)?;
        Ok(state)
    }

    /// Rotates, scales and moves the moving shape's low-passed surface so that matched points come together.
    pub(super) fn place_moving_on_still(&mut self) {
        let placing = Similarity {
            scale: self.lengths,
            ..Similarity::fitted(&self.matched(), false)
        };
        self.moving.place(&placing);
    }
}

/// Nearest of all where few ask; where all do, for the farthest-point samples whose images are not known, and spread from
/// there.
fn first_images(
    images: &mut Images,
    asking: &[u32],
    (own, samples): (&Shape, Option<&[u32]>),
    (own_rows, neighbours): (&Rows, &Adjacency),
    (other, other_rows): (&Shape, &Rows),
    check: Check<'_>,
) -> Result<()> {
    let nearest = |vertices: &[u32]| {
        let queries = own_rows.gather(vertices);
        other.cells.nearest(&queries, other_rows, check)
    };
    if asking.len() == own.mesh.vertices.len() {
        let searched = if samples.is_none() {
            nearest(&own.farthest)?
        } else {
            Vec::new()
        };
        let found = samples.unwrap_or(&searched);
        for (&v, &image) in own.farthest.iter().zip(found) {
            images.vertex[v as usize] = image;
        }
        images.settle(
            asking,
            (own_rows, neighbours),
            (other_rows, &other.neighbours),
            EMBEDDING.sweeps,
            check,
        )?;
    } else {
        images.vertex = nearest(asking)?;
    }
    Ok(())
}
