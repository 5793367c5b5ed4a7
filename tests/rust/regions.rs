//! The better of two maps, region by region.

use crate::common::lumpy;
use sgmds_core::algebra::vector::distance;
use sgmds_core::matching::problem::point_map::PointMap;
use sgmds_core::matching::refinement::regions::better_elsewhere;
use sgmds_core::shape::Shape;
use sgmds_core::watch::progress::Progress;

/// The identity but for a cap about one pole, which is turned about the axis through it.
fn with_turned_cap(shape: &Shape, pole: f64, angle: f64) -> Vec<u32> {
    let points = &shape.mesh.vertices;
    let (sin, cos) = angle.sin_cos();
    let height = points.iter().map(|p| pole * p[2]).fold(0.0, f64::max);
    let count = points.len() as u32;
    (0..count)
        .map(|v| {
            let [x, y, z] = points[v as usize];
            if pole * z < 0.6 * height {
                return v;
            }
            let turned = [cos * x - sin * y, sin * x + cos * y, z];
            let away = |&w: &u32| distance(points[w as usize], turned);
            (0..count)
                .min_by(|a, b| away(a).total_cmp(&away(b)))
                .expect("a vertex")
        })
        .collect()
}

#[test]
fn each_region_is_taken_from_the_map_that_is_right_there() {
    let (vertices, faces) = lumpy(3);
    let shape =
        Shape::new(&vertices, &faces, &Progress::default(), &|_, _| Ok(())).expect("a sound mesh");
    let right: Vec<u32> = (0..shape.mesh.vertices.len() as u32).collect();
    let top = with_turned_cap(&shape, 1.0, 0.7);
    let bottom = with_turned_cap(&shape, -1.0, 0.7);

    let map = |images| PointMap {
        from: &shape,
        to: &shape,
        images,
    };

    // Each is wrong at its own pole only, so that the other is better there and nowhere else. Near the axis a
    // turn moves vertices by less than what counts as elsewhere.
    for (own, other) in [(&top, &bottom), (&bottom, &top)] {
        let better = better_elsewhere(map(own), 1.0, other);
        let wrong = right
            .iter()
            .zip(own)
            .filter(|(v, image)| v != image)
            .count();
        let taken = better.iter().filter(|&&b| b).count();
        assert!(taken > wrong / 2, "{taken} of {wrong}");
        for (v, &b) in better.iter().enumerate() {
            assert!(!b || own[v] != right[v], "vertex {v} was right");
        }
    }
    assert!(!better_elsewhere(map(&right), 1.0, &top).contains(&true));
}
