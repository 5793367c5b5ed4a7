//! Shape keys: displacements of the source's vertices carried in local frames.

use rayon::prelude::*;

use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::transfer::settings::DISPLACEMENT;
use crate::transfer::surface_map::{SurfaceMap, check_rows};

/// Displacements `(n_source)` of the source's vertices as displacements `(n_target)` of the target's.
///
/// The displacement at a vertex's image, linear within the triangle, is turned and scaled by the
/// frame of the map there. Where the three corners stand still the result is exactly zero.
/// `turn_only` keeps lengths as they are on the source.
///
/// # Errors
/// [`crate::Error::BadArgument`] when there is not one displacement for each source vertex.
pub fn displacements(map: &SurfaceMap, offsets: &[Point], turn_only: bool) -> Result<Vec<Point>> {
    check_rows("offsets", offsets.len(), map.source.vertices.len())?;
    let least = DISPLACEMENT.stillness * map.source.diagonal();
    let moving: Vec<Point> = offsets
        .iter()
        .map(|&d| if vector::norm(d) > least { d } else { [0.0; 3] })
        .collect();
    let frames = map.frames();
    Ok(map
        .points
        .par_iter()
        .zip(frames)
        .map(|(point, frame)| {
            let corners = map.source.triangles[point.face as usize].map(|v| moving[v as usize]);
            if corners.iter().all(|d| *d == [0.0; 3]) {
                return [0.0; 3];
            }
            let mut frame = *frame;
            if turn_only {
                frame.scale = 1.0;
            }
            frame.apply(super::surface::blend(corners, point.weights))
        })
        .collect())
}
