//! Values carried through a map.

use crate::error::{Error, Result};

/// Values of the source at the image of each target vertex, linear within a triangle.
///
/// `faces` and `weights` are the image of each target vertex as a source triangle and barycentric
/// weights, `triangles` the source's triangles, `values` `channels` numbers for each source
/// vertex. Returns `channels` numbers for each target vertex.
///
/// # Errors
/// [`Error::BadArgument`] when the number of values is not that of the source's vertices.
pub fn transfer(
    faces: &[i64],
    weights: &[[f64; 3]],
    triangles: &[[i64; 3]],
    source_vertices: usize,
    values: &[f64],
    channels: usize,
) -> Result<Vec<f64>> {
    if values.len() != source_vertices * channels {
        return Err(Error::BadArgument {
            what: format!(
                "`values` should have one row for each of the {source_vertices} source vertices, \
                 got {}",
                values.len() / channels.max(1)
            ),
        });
    }
    let mut out = Vec::with_capacity(faces.len() * channels);
    for (&face, w) in faces.iter().zip(weights) {
        let corners = triangles[face as usize];
        for c in 0..channels {
            let at = |i: usize| values[corners[i] as usize * channels + c];
            // Written so that equal corner values come through unchanged to the last bit.
            out.push(at(0) + w[1] * (at(1) - at(0)) + w[2] * (at(2) - at(0)));
        }
    }
    Ok(out)
}
