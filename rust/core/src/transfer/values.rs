//! Values carried through a map.

use crate::error::{Error, Result};

/// Values of the source at the image of each target vertex, linear within a triangle.
///
/// `faces` and `weights` are the image of each target vertex as a source triangle and barycentric
/// weights, `triangles` the source's triangles, `values` `channels` numbers for each source
/// vertex. Returns `channels` numbers for each target vertex.
///
/// # Errors
/// [`Error::BadArgument`] when lengths do not fit, or a triangle or vertex does not exist.
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
    if faces.len() != weights.len() {
        return Err(Error::BadArgument {
            what: format!(
                "`barycentric` should have one row for each of the {} faces, got {}",
                faces.len(),
                weights.len()
            ),
        });
    }
    let known = |v: i64| usize::try_from(v).is_ok_and(|v| v < source_vertices);
    let mut out = Vec::with_capacity(faces.len() * channels);
    for (vertex, (&face, w)) in faces.iter().zip(weights).enumerate() {
        let corners = usize::try_from(face)
            .ok()
            .and_then(|f| triangles.get(f))
            .filter(|corners| corners.iter().all(|&v| known(v)))
            .ok_or_else(|| Error::BadArgument {
                what: format!(
                    "target vertex {vertex} lies on source triangle {face}, which is none of the \
                     {} or names a vertex beyond the {source_vertices}: match again",
                    triangles.len()
                ),
            })?;
        for c in 0..channels {
            let at = |i: usize| values[corners[i] as usize * channels + c];
            // Written so that equal corner values come through unchanged to the last bit.
            out.push(at(0) + w[1] * (at(1) - at(0)) + w[2] * (at(2) - at(0)));
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused() {
        let weights = [[0.5, 0.25, 0.25]];
        let values = [4.0, 8.0, 16.0];
        let carried = |faces: &[i64], triangles: &[[i64; 3]]| {
            transfer(faces, &weights, triangles, 3, &values, 1)
        };
        assert_eq!(carried(&[0], &[[0, 1, 2]]), Ok(vec![8.0]));
        for (faces, triangle) in [
            (&[1][..], [0, 1, 2]),
            (&[-1], [0, 1, 2]),
            (&[0], [0, 1, 3]),
            (&[0], [0, -1, 2]),
            (&[0, 0], [0, 1, 2]),
        ] {
            assert!(matches!(
                carried(faces, &[triangle]),
                Err(Error::BadArgument { .. })
            ));
        }
    }
}
