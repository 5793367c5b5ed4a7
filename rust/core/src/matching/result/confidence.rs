//! How far to trust each vertex of a map.

use rayon::prelude::*;

use crate::algebra::dense::{self, LANES, Rows, vectorised};
use crate::error::Result;
use crate::matching::problem::point_map::PointMap;
use crate::matching::result::settings::CONFIDENCE;
use crate::shape::Shape;
use crate::watch::progress::Progress;

/// Confidence in [0, 1] of a target vertex: exp(−(δ² + 4γ² + ρ²)/0.08² − β²).
///
/// δ is its local distortion, γ the gap between it and its image when the target is drawn onto the
/// source, which stands off where the source has nothing, ρ how far from it
/// the way to the source and back ends, all at unit area, β how much it lies beyond a rim of the
/// source ([`crate::mesh::boundary::beyond`]). It cannot see a wholly wrong map.
#[must_use]
pub fn confidence(distortion: f64, gap: f64, returns: f64, beyond: f64) -> f64 {
    let doubt = distortion.hypot(CONFIDENCE.gap_weight * gap).hypot(returns);
    (-(doubt / CONFIDENCE.tolerated).powi(2) - beyond.powi(2)).exp()
}

/// Mean change δ of the distances to 80 samples, near ones weighing most, for each vertex of the shape that is mapped.
///
/// Lengths are those of the shape the map leads to at unit area, of which `lengths` make one of the other's. Distances are those of the distance operators of both shapes, whose errors
/// are much the same at matched points; marched ones tell wrong places of poses 1 to 5 % better, for eight per cent of a match.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn local_distortion(map: PointMap<'_>, lengths: f64, progress: &Progress) -> Result<Vec<f64>> {
    let witnesses = map.from.farthest_points(CONFIDENCE.witnesses);
    let their_images: Vec<u32> = witnesses.iter().map(|&v| map.image(v)).collect();
    let (here, there) = rayon::join(
        || distances_to(map.from, witnesses),
        || distances_to(map.to, &their_images),
    );
    progress.check()?;
    Ok(map
        .images
        .par_iter()
        .enumerate()
        .map(|(v, &image)| {
            let (here, there) = (here.row(v), there.row(image as usize));
            vectorised(
                #[inline(always)]
                || mean_change(here, there, lengths as f32),
            )
        })
        .collect())
}

/// Distances from all vertices of a shape, a row each, to some, by its distance operator.
fn distances_to(shape: &Shape, vertices: &[u32]) -> Rows {
    let operator = shape.distance_operator.as_ref();
    let at_vertices =
        dense::gather_rows(shape.basis.functions.as_ref(), vertices, operator.nrows());
    let fields = dense::product(operator, at_vertices.transpose());
    shape.rows.times(fields.as_ref())
}

/// Mean change of a vertex's distances to the samples, `here` and of its image's, `there`.
#[inline(always)]
fn mean_change(here: &[f32], there: &[f32], lengths: f32) -> f64 {
    let (mut sums, mut totals) = ([0.0; LANES], [0.0; LANES]);
    for (here, there) in here.chunks(LANES).zip(there.chunks(LANES)) {
        for (l, (here, there)) in here.iter().zip(there).enumerate() {
            // Distances of about nothing come out negative too.
            let here = (lengths * here).clamp(0.0, CONFIDENCE.horizon);
            let change =
                (here.min(CONFIDENCE.compared) - there.clamp(0.0, CONFIDENCE.compared)).abs();
            let farness = here * here / (CONFIDENCE.horizon * CONFIDENCE.horizon);
            let nearness = (1.0 - farness) * (1.0 - farness);
            let weight = nearness * nearness;
            sums[l] += weight * change;
            totals[l] += weight;
        }
    }
    let [sum, total] = [sums, totals].map(dense::sum_of_lanes);
    f64::from(sum / (total + CONFIDENCE.weight_floor))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{AROUND, RINGS, torus};

    #[test]
    fn a_vertex_that_is_sent_elsewhere_is_distorted_by_about_the_way_there() {
        let shape = torus(RINGS);
        let of = |images: &[u32]| {
            let map = PointMap {
                from: &shape,
                to: &shape,
                images,
            };
            local_distortion(map, 1.0, &Progress::default()).expect("not stopped")
        };
        let mut images: Vec<u32> = (0..(RINGS * AROUND) as u32).collect();
        assert!(of(&images).iter().all(|&distortion| distortion == 0.0));

        let sent = (0..images.len())
            .find(|&v| {
                !shape
                    .farthest_points(CONFIDENCE.witnesses)
                    .contains(&(v as u32))
            })
            .expect("there are more vertices than witnesses");
        // Three rings on, and only this vertex.
        let to = (sent + 3 * AROUND) as u32 % images.len() as u32;
        images[sent] = to;
        let way = shape.spectral_distances(&[sent as u32], &[to])[(0, 0)];
        for (v, distortion) in of(&images).into_iter().enumerate() {
            if v == sent {
                // No distance changes by more than the way, up to what spectral distances are off; those along it change most.
                assert!(
                    distortion > 0.2 * way && distortion < 1.1 * way,
                    "{distortion} {way}"
                );
            } else {
                assert_eq!(distortion, 0.0);
            }
        }
    }
}
