//! Data of whole faces: labels by the majority, numbers by the mean, of places within the face.

use rayon::prelude::*;

use crate::algebra::vector;
use crate::error::Result;
use crate::transfer::corners::{Polygons, facing_nearest};
use crate::transfer::settings::LABELS;
use crate::transfer::surface_map::{SurfaceMap, check_rows, check_table};

/// Source triangles under places within each target face, in compressed rows `(starts, triangles)`.
///
/// The centre comes first.
#[must_use]
pub fn triangles_under(map: &SurfaceMap, faces: &Polygons) -> (Vec<u32>, Vec<u32>) {
    let images = map.images();
    let rows: Vec<Vec<u32>> = (0..faces.len())
        .into_par_iter()
        .map(|f| {
            let corners = faces.row(f);
            let share = 1.0 / corners.len() as f64;
            let mut centre = [0.0; 3];
            let mut normal = [0.0; 3];
            for &v in corners {
                centre = vector::add(centre, vector::scaled(images[v as usize], share));
                let own = map.source.cross(map.points[v as usize].face);
                normal = vector::add(normal, vector::normalised(own));
            }
            let towards = corners.iter().flat_map(|&v| {
                LABELS.shares.map(|s| {
                    let way = vector::sub(images[v as usize], centre);
                    vector::add(centre, vector::scaled(way, s))
                })
            });
            std::iter::once(centre)
                .chain(towards)
                .map(|place| facing_nearest(&map.source, place, normal).face)
                .collect()
        })
        .collect();
    let mut starts = vec![0];
    let mut triangles = Vec::new();
    for row in rows {
        triangles.extend(row);
        starts.push(triangles.len() as u32);
    }
    (starts, triangles)
}

/// The commonest label under each target face; the one under its centre wins a tie.
///
/// # Errors
/// [`crate::Error::BadArgument`] when there is not one label for each source triangle.
pub fn face_labels(map: &SurfaceMap, faces: &Polygons, labels: &[i64]) -> Result<Vec<i64>> {
    check_rows("labels", labels.len(), map.source.triangles.len())?;
    let (starts, triangles) = triangles_under(map, faces);
    Ok(starts
        .windows(2)
        .map(|w| {
            let row = &triangles[w[0] as usize..w[1] as usize];
            let count = |label: i64| row.iter().filter(|&&t| labels[t as usize] == label).count();
            let mut best = labels[row[0] as usize];
            for &t in row {
                if count(labels[t as usize]) > count(best) {
                    best = labels[t as usize];
                }
            }
            best
        })
        .collect())
}

/// The mean of `channels` numbers of the triangles under each target face.
///
/// # Errors
/// [`crate::Error::BadArgument`] when there is not one row for each source triangle.
pub fn face_means(
    map: &SurfaceMap,
    faces: &Polygons,
    values: &[f64],
    channels: usize,
) -> Result<Vec<f64>> {
    check_table("values", values.len(), map.source.triangles.len(), channels)?;
    let (starts, triangles) = triangles_under(map, faces);
    Ok(starts
        .windows(2)
        .flat_map(|w| {
            let row = &triangles[w[0] as usize..w[1] as usize];
            (0..channels)
                .map(|c| {
                    let first = values[row[0] as usize * channels + c];
                    // Written so that equal values come through unchanged to the last bit.
                    let rest: f64 = row
                        .iter()
                        .map(|&t| values[t as usize * channels + c] - first)
                        .sum();
                    first + rest / row.len() as f64
                })
                .collect::<Vec<_>>()
        })
        .collect())
}
