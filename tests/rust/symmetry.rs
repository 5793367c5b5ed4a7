//! The own mirror symmetry of a surface.

use crate::common::{icosphere, limbed, lumpy};
use sgmds_core::matching::symmetry::{counted, mirror_offsets};
use sgmds_core::shape::Shape;
use sgmds_core::watch::progress::Progress;

fn prepared((vertices, faces): &(Vec<[f64; 3]>, Vec<[i64; 3]>)) -> Shape {
    Shape::new(vertices, faces, &Progress::default(), &|_, _| Ok(())).expect("a sound mesh")
}

#[test]
fn offsets_are_distances_to_the_mirrored_vertices() {
    // Two pairs of limbs beside the plane x = 0, a head and a tail on it.
    let figure = limbed(
        icosphere(4),
        &[
            ([0.0, 0.2, 1.0], 0.8, 0.35),
            ([0.9, 0.3, 0.1], 1.6, 0.22),
            ([-0.9, 0.3, 0.1], 1.6, 0.22),
            ([0.5, -0.3, -0.8], 1.9, 0.25),
            ([-0.5, -0.3, -0.8], 1.9, 0.25),
            ([0.0, -1.0, 0.1], 1.2, 0.3),
        ],
    );
    let shape = prepared(&figure);
    let offsets = mirror_offsets(&shape, &Progress::default())
        .expect("nothing cancels")
        .expect("the figure is symmetric");
    let mirrored = |v: usize| {
        let [x, y, z] = shape.mesh.vertices[v];
        let gap = |u: &usize| {
            crate::common::length(crate::common::sub(shape.mesh.vertices[*u], [-x, y, z]))
        };
        (0..offsets.len())
            .min_by(|a, b| gap(a).total_cmp(&gap(b)))
            .expect("there are vertices")
    };
    let (mut error, mut offset) = (0.0, 0.0);
    for &v in shape.farthest_points(100) {
        let other = mirrored(v as usize) as u32;
        let true_offset = if other == v {
            0.0
        } else {
            shape.spectral_distances(&[v], &[other])[(0, 0)]
        };
        error += (f64::from(offsets[v as usize]) - true_offset).abs();
        offset += true_offset;
    }
    // A tenth of the mean: the kink at the plane is smoothed by sixty eigenfunctions.
    assert!(error < 0.1 * offset, "{error} of {offset}");
}

#[test]
fn near_points_count_by_their_distance_and_far_ones_alike() {
    assert!(counted(0.0) == 0.0);
    // The slope is 1 at the plane; the next term of the series is s²/(2·0.5).
    assert!((counted(0.01) - 0.01).abs() < 1.1e-4);
    // A gorilla's feet and a man's; the knees between still tell themselves from the plane.
    assert!(counted(1.35) - counted(0.75) < 0.2 * (1.35 - 0.75));
    assert!(counted(0.4) > 0.5 * counted(1.35));
}

#[test]
fn a_body_without_symmetry_has_none() {
    let offsets = mirror_offsets(&prepared(&lumpy(4)), &Progress::default());
    assert!(offsets.expect("nothing cancels").is_none());
}
