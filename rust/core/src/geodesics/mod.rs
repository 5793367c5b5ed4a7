//! Geodesic distances from vertices or points, and samples spread evenly by them.
//!
//! All distances are in the unit of the mesh's coordinates (unit-area lengths for a [`Mesh`]), and
//! in single precision: their discretisation error is far above its rounding.

mod farthest_points;
mod fast_marching;
mod front_queue;

pub use farthest_points::farthest_points;
pub use fast_marching::{FastMarching, Seed, Workspace};

use faer::Mat;
use rayon::prelude::*;

use crate::error::{Error, Result};

/// Distances from each source to every vertex.
///
/// Shape `(n, s)`: column `j` holds the distances from `sources[j]`, contiguous in memory.
/// Vertices that cannot be reached are infinite. Columns are marched in parallel, each on its own,
/// so the result does not depend on the number of threads. `cancelled` is asked before each source.
///
/// # Errors
/// [`Error::BadArgument`] when a source is not a vertex, [`Error::Cancelled`].
pub fn distances_from(
    marching: &FastMarching,
    sources: &[u32],
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Mat<f32>> {
    distances_within(f32::INFINITY, marching, sources, cancelled)
}

/// [`distances_from`] up to a bound, infinite beyond.
///
/// # Errors
/// Those of [`distances_from`].
#[expect(
    clippy::missing_panics_doc,
    reason = "an owned matrix has contiguous columns"
)]
pub fn distances_within(
    bound: f32,
    marching: &FastMarching,
    sources: &[u32],
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Mat<f32>> {
    let n = marching.vertex_count();
    if let Some(source) = sources.iter().find(|&&s| s as usize >= n) {
        return Err(Error::BadArgument {
            what: format!("source {source} is not one of the {n} vertices: give ids below {n}"),
        });
    }
    let mut distances = Mat::<f32>::zeros(n, sources.len());
    distances
        .par_col_chunks_mut(2)
        .zip(sources.par_chunks(2))
        .try_for_each_init(
            || [Workspace::new(marching), Workspace::new(marching)],
            |workspaces, (columns, sources)| {
                if cancelled() {
                    return Err(Error::Cancelled);
                }
                let mut columns = columns.col_iter_mut().map(|column| {
                    let column = column.try_as_col_major_mut();
                    column
                        .expect("an owned matrix has contiguous columns")
                        .as_slice_mut()
                });
                match (sources, columns.next(), columns.next()) {
                    (&[one, two], Some(first), Some(second)) => {
                        marching.march_two([one, two], bound, workspaces, [first, second]);
                    }
                    (&[one], Some(first), _) => {
                        marching.march_bounded(one, bound, &mut workspaces[0], first);
                    }
                    _ => unreachable!("as many columns as sources"),
                }
                Ok(())
            },
        )?;
    Ok(distances)
}
