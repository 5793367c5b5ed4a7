//! The straight way between two points of a surface, and the borders that it crosses.

use crate::algebra::vector;
use crate::mesh::surface_point::SurfacePoint;
use crate::transfer::settings::TRACE;
use crate::transfer::surface::{NONE, Surface};

/// A border on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Share of the way, 0 to 1.
    pub share: f64,
    /// Triangle before the border.
    pub before: u32,
    /// Triangle beyond it.
    pub beyond: u32,
    /// Where the way crosses, on an edge of `before`.
    pub place: SurfacePoint,
}

/// Borders between two points, where `open` edges are none: the surface is cut with the plane
/// through both points and the mean of their normals, and followed from one to the other.
///
/// `None` when the cut does not lead there, as between two sheets.
#[must_use]
pub fn crossings(
    surface: &Surface,
    open: &[[bool; 3]],
    from: &SurfacePoint,
    to: &SurfacePoint,
) -> Option<Vec<Crossing>> {
    let start = surface.position(&SurfacePoint {
        face: from.face,
        weights: from
            .weights
            .map(|w| (1.0 - TRACE.inset) * w + TRACE.inset / 3.0),
    });
    let end = surface.position(to);
    let way = vector::sub(end, start);
    let length = vector::dot(way, way);
    let arrived = |t: u32| {
        t == to.face || surface.to_triangle(end, t).0 <= TRACE.inset * TRACE.inset * length
    };
    let mut found = Vec::new();
    let (mut triangle, mut entry) = (from.face, None);
    if arrived(triangle) {
        return Some(found);
    }
    let up = [from.face, to.face]
        .map(|t| vector::normalised(surface.cross(t)))
        .into_iter()
        .fold([0.0; 3], vector::add);
    let across = vector::cross(way, up);
    for _ in 0..TRACE.most_steps {
        let corners = surface.corners(triangle);
        let side = corners.map(|c| vector::dot(vector::sub(c, start), across));
        let (share, k, along) = (0..3)
            .filter(|&k| Some(k) != entry)
            .filter(|&k| (side[k] >= 0.0) != (side[(k + 1) % 3] >= 0.0))
            .map(|k| {
                let next = (k + 1) % 3;
                let along = side[k] / (side[k] - side[next]);
                let place = vector::add(
                    vector::scaled(corners[k], 1.0 - along),
                    vector::scaled(corners[next], along),
                );
                let share = vector::dot(vector::sub(place, start), way) / length;
                (share, k, along)
            })
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        let beyond = surface.across[triangle as usize][k];
        if beyond == NONE || share.abs() > TRACE.lost {
            return None;
        }
        if !open[triangle as usize][k] {
            let mut weights = [0.0; 3];
            weights[k] = 1.0 - along;
            weights[(k + 1) % 3] = along;
            found.push(Crossing {
                share: share.clamp(0.0, 1.0),
                before: triangle,
                beyond,
                place: SurfacePoint {
                    face: triangle,
                    weights,
                },
            });
        }
        if arrived(beyond) {
            return Some(found);
        }
        entry = (0..3).find(|&j| surface.across[beyond as usize][j] == triangle);
        triangle = beyond;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_over_a_folded_strip_crosses_its_borders_where_the_plane_does() {
        // Two units along x, two up along z: a strip with a right angle, its fold a border.
        let vertices = vec![
            [0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [2.0, 0.0, 0.0],
            [2.0, 1.0, 0.0],
            [2.0, 0.0, 2.0],
            [2.0, 1.0, 2.0],
        ];
        let triangles = [[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]];
        let surface = Surface::new(vertices, &triangles).expect("four triangles");
        let fold = |t: usize, k: usize| {
            let edge = [k, (k + 1) % 3].map(|i| surface.triangles[t][i]);
            edge.contains(&2) && edge.contains(&3)
        };
        let open: Vec<[bool; 3]> = (0..4)
            .map(|t| [0, 1, 2].map(|k| surface.across[t][k] != NONE && !fold(t, k)))
            .collect();
        let from = surface.nearest([0.5, 0.2, 0.0]);
        let to = surface.nearest([2.0, 0.6, 1.5]);
        for (from, to, y) in [(from, to, 0.4), (to, from, 0.4)] {
            let found = crossings(&surface, &open, &from, &to).expect("one sheet");
            let [crossing] = found[..] else {
                panic!("one border: {found:?}")
            };
            // The cutting plane holds both normals, so by symmetry the fold is met in the middle.
            let place = surface.position(&crossing.place);
            assert!(vector::distance(place, [2.0, y, 0.0]) < 1e-6, "{place:?}");
            assert!((crossing.share - 0.5).abs() < 1e-6);
        }
        let all = vec![[true; 3]; 4];
        assert_eq!(crossings(&surface, &all, &from, &to), Some(Vec::new()));
        assert_eq!(crossings(&surface, &open, &from, &from), Some(Vec::new()));
    }
}
