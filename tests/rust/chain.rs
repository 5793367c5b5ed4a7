//! The whole chain on surfaces whose map is known.

use std::sync::Arc;

use sgmds_core::Error;
use sgmds_core::geodesics::metric::Metric;
use sgmds_core::matching::problem::landmark::Landmark;
use sgmds_core::matching::problem::pair::{Coverage, Mirror};
use sgmds_core::matching::ranking::quality::{Grade, graded};
use sgmds_core::matching::{self, Correspondence, Method, Options, match_shapes};
use sgmds_core::mesh::Mesh;
use sgmds_core::mesh::boundary;
use sgmds_core::mesh::numbering::InputVertex;
use sgmds_core::shape::Shape;
use sgmds_core::watch::progress::Progress;

use crate::common::{Point, disguised, icosphere, length, lumpy, sub};

fn prepared(vertices: &[Point], faces: &[[i64; 3]]) -> Arc<Shape> {
    let progress = Progress::default();
    Arc::new(Shape::new(vertices, faces, &progress, &|s, f| progress.enter(s, f)).unwrap())
}

fn found(
    source: &Arc<Shape>,
    target: &Arc<Shape>,
    options: &Options<InputVertex>,
) -> Correspondence {
    let progress = Progress::default();
    match_shapes(source, target, options, &progress, &|s, f| {
        progress.enter(s, f)
    })
    .unwrap()
}

/// Mean distance between each target vertex's image and its own place on the source, over √area.
fn mean_error(map: &Correspondence, source: &(Vec<Point>, Vec<[i64; 3]>), order: &[usize]) -> f64 {
    let mesh = Mesh::new(&source.0, &source.1).unwrap();
    let sum: f64 = order
        .iter()
        .enumerate()
        .map(|(i, &old)| {
            let corners = source.1[map.faces[i] as usize].map(|v| source.0[v as usize]);
            let w = map.barycentric[i];
            let image = [0, 1, 2].map(|c| (0..3).map(|k| w[k] * corners[k][c]).sum());
            length(sub(image, source.0[old]))
        })
        .sum();
    sum / order.len() as f64 / mesh.scale
}

#[test]
fn a_turned_scaled_renumbered_copy_returns_the_renumbering() {
    let source = lumpy(4);
    let (vertices, faces, order) = disguised(&source, 0.02);
    let (a, b) = (prepared(&source.0, &source.1), prepared(&vertices, &faces));
    let map = found(&a, &b, &Options::default());
    let same = order
        .iter()
        .zip(&map.vertices)
        .filter(|&(&old, &v)| old == v as usize)
        .count();
    // Round-off moves eigenfunctions in their last digits only, so nearly every vertex returns to
    // itself; one in a hundred may tie with a neighbour.
    assert!(same * 100 >= 99 * order.len(), "{same} of {}", order.len());
    assert!(map.confidence.iter().all(|c| (0.0..=1.0).contains(c)));
    assert_eq!(map.unmatched, 0);
    for w in &map.barycentric {
        assert!(w.iter().all(|x| *x >= 0.0) && (w.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn a_constant_is_carried_exactly_by_the_functional_map() {
    let source = lumpy(3);
    let (vertices, faces, _) = disguised(&source, 3.0);
    let (a, b) = (prepared(&source.0, &source.1), prepared(&vertices, &faces));
    let alpha = found(&a, &b, &Options::default()).functional_map;
    // √(area_target/area_source) = 3; the rest of the column vanishes.
    assert!((alpha[(0, 0)] - 3.0).abs() < 1e-6, "{}", alpha[(0, 0)]);
    for i in 1..alpha.nrows() {
        assert!(alpha[(i, 0)].abs() < 1e-6, "row {i}: {}", alpha[(i, 0)]);
    }
}

#[test]
fn energy_of_a_map_vanishes_for_an_isometry_whatever_the_units() {
    let source = lumpy(3);
    let (vertices, faces, _) = disguised(&source, 3.0);
    let (a, b) = (prepared(&source.0, &source.1), prepared(&vertices, &faces));
    let alpha = found(&a, &b, &Options::default()).functional_map;
    let energy = matching::energy(&a, &b, alpha.as_ref()).unwrap();
    // The fit's ridge of 1e-3 shortens α by about as much, which enters squared.
    assert!(energy < 1e-4, "{energy}");
    // Half of the functions turned: no isometry.
    let turned = faer::Mat::from_fn(alpha.nrows(), alpha.ncols(), |i, j| {
        if j % 2 == 0 {
            alpha[(i, j)]
        } else {
            -alpha[(i, j)]
        }
    });
    let other = matching::energy(&a, &b, turned.as_ref()).unwrap();
    assert!(other > 0.01, "{other}");
}

#[test]
fn the_published_method_matches_a_copy_and_lowers_its_energy() {
    let source = lumpy(4);
    let (vertices, faces, order) = disguised(&source, 1.0);
    let (a, b) = (prepared(&source.0, &source.1), prepared(&vertices, &faces));
    let options = Options {
        method: Method::Paper,
        ..Options::default()
    };
    let map = found(&a, &b, &options);
    let end = map.convergence.unwrap();
    // Two copies have an isometry between them, where every term vanishes.
    assert!(end.energy < 1e-3, "{}", end.energy);
    let error = mean_error(&map, &source, &order);
    // A thirtieth of the spectrum resolves about 2π/√λ₃₀, a fifth of √area, and a tenth of that
    // is what aligned eigenfunctions of one surface reach.
    assert!(error < 0.02, "{error}");
}

#[test]
fn the_baselines_match_a_copy() {
    let source = lumpy(4);
    let (vertices, faces, order) = disguised(&source, 1.0);
    let (a, b) = (prepared(&source.0, &source.1), prepared(&vertices, &faces));
    for method in [Method::Gmds, Method::FunctionalMap] {
        let options = Options {
            method,
            ..Options::default()
        };
        let map = found(&a, &b, &options);
        let end = map.convergence.unwrap();
        assert!(end.converged, "{method:?}: {end:?}");
        let error = mean_error(&map, &source, &order);
        // An edge is 0.03 long; a wrong limb would cost 0.3.
        assert!(error < 0.01, "{method:?}: {error}");
    }
}

#[test]
fn shapes_in_different_metrics_are_refused() {
    let (vertices, faces) = lumpy(3);
    let progress = Progress::default();
    let report = |s, f| progress.enter(s, f);
    let a = prepared(&vertices, &faces);
    let b = Shape::with_metric(
        &vertices,
        &faces,
        Metric::ScaleInvariant,
        &progress,
        &report,
    );
    let end = match_shapes(
        &a,
        &Arc::new(b.unwrap()),
        &Options::default(),
        &progress,
        &report,
    );
    assert!(matches!(end, Err(Error::BadArgument { .. })));
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let source = lumpy(3);
    let (vertices, faces, _) = disguised(&source, 1.0);
    let run = |threads: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
            .install(|| {
                let (a, b) = (prepared(&source.0, &source.1), prepared(&vertices, &faces));
                found(&a, &b, &Options::default())
            })
    };
    let (one, three) = (run(1), run(3));
    assert_eq!(one.faces, three.faces);
    assert_eq!(one.barycentric, three.barycentric);
    assert_eq!(one.confidence, three.confidence);
}

#[test]
fn a_mirror_image_is_matched_when_that_is_allowed() {
    let source = lumpy(4);
    let mirrored: Vec<Point> = source.0.iter().map(|p| [-p[0], p[1], p[2]]).collect();
    let wound: Vec<[i64; 3]> = source.1.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let (a, b) = (prepared(&source.0, &source.1), prepared(&mirrored, &wound));
    let options = Options {
        mirror: Mirror::Allow,
        ..Options::default()
    };
    let map = found(&a, &b, &options);
    let order: Vec<usize> = (0..source.0.len()).collect();
    let error = mean_error(&map, &source, &order);
    // Positions and normals of a mirrored body contradict the map a little.
    assert!(error < 0.02, "{error}");
}

#[test]
fn a_part_finds_its_place_on_the_whole() {
    let source = lumpy(4);
    // Without the tips of two limbs: the vertices stay, so that vertex i is still vertex i.
    let faces: Vec<[i64; 3]> = source
        .1
        .iter()
        .filter(|f| f.iter().all(|&v| source.0[v as usize][2] > -1.7))
        .copied()
        .collect();
    assert!(faces.len() + 100 < source.1.len());
    let (whole, part) = (prepared(&source.0, &source.1), prepared(&source.0, &faces));
    let options = Options {
        coverage: Some(Coverage::TARGET_IS_PART),
        ..Options::default()
    };
    let map = found(&whole, &part, &options);
    let kept: Vec<u32> = part.mesh.input_vertex.iter().map(|v| v.0).collect();
    let sum: f64 = kept
        .iter()
        .map(|&v| {
            let image = source.0[map.vertices[v as usize] as usize];
            length(sub(image, source.0[v as usize]))
        })
        .sum();
    let error = sum / kept.len() as f64 / whole.mesh.scale;
    // The spectra of part and whole differ, and an edge is 0.03 long; a wrong limb would cost 0.3.
    assert!(error < 0.06, "{error}");
}

/// An ellipsoid with three different axes: half turns about them are its only direct symmetries.
fn ellipsoid() -> (Vec<Point>, Vec<[i64; 3]>) {
    let (vertices, faces) = icosphere(4);
    let stretched = vertices.iter().map(|p| [p[0], 1.5 * p[1], 0.6 * p[2]]);
    (stretched.collect(), faces)
}

/// Signs of the coordinates after no turn and after half a turn about each axis.
const HALF_TURNS: [Point; 4] = [
    [1.0, 1.0, 1.0],
    [1.0, -1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
];

fn turned(point: Point, signs: Point) -> Point {
    [0, 1, 2].map(|c| signs[c] * point[c])
}

/// Number of the vertex at each vertex's place after a turn that is a symmetry.
fn permutation(vertices: &[Point], signs: Point) -> Vec<usize> {
    let find = |p: &Point| {
        let place = turned(*p, signs);
        vertices
            .iter()
            .position(|q| length(sub(*q, place)) < 1e-9)
            .unwrap()
    };
    vertices.iter().map(find).collect()
}

#[test]
fn three_landmarks_choose_among_equal_maps_and_are_met_exactly() {
    let source = ellipsoid();
    let shape = prepared(&source.0, &source.1);
    for signs in HALF_TURNS {
        let wanted = permutation(&source.0, signs);
        let landmarks = [3, 700, 1500].map(|v: u32| Landmark {
            source: InputVertex(wanted[v as usize] as u32),
            target: InputVertex(v),
        });
        let options = Options {
            landmarks: landmarks.to_vec(),
            ..Options::default()
        };
        let map = found(&shape, &shape, &options);
        for Landmark { source, target } in landmarks {
            assert_eq!(map.vertices[target.index()], source.0);
        }
        let error = mean_error(&map, &source, &wanted);
        // Half an edge; the other maps are off by half the body.
        assert!(error < 0.02, "{signs:?}: {error}");
    }
}

#[test]
fn common_axes_choose_among_equal_maps() {
    let source = ellipsoid();
    let shape = prepared(&source.0, &source.1);
    for signs in HALF_TURNS {
        let vertices: Vec<Point> = source.0.iter().map(|&p| turned(p, signs)).collect();
        let target = prepared(&vertices, &source.1);
        let options = Options {
            same_axes: true,
            ..Options::default()
        };
        let map = found(&shape, &target, &options);
        let error = mean_error(&map, &source, &permutation(&source.0, signs));
        assert!(error < 0.02, "{signs:?}: {error}");
    }
}

#[test]
fn where_many_maps_are_equal_none_is_graded_green() {
    let round = icosphere(4);
    for (vertices, faces) in [ellipsoid(), round] {
        let shape = prepared(&vertices, &faces);
        let map = found(&shape, &shape, &Options::default());
        let (grade, reasons) = graded(&map.metrics.unwrap(), map.coverage);
        assert_ne!(grade, Grade::Green, "{reasons:?}");
        assert!(
            reasons.iter().any(|r| r.contains("other maps")),
            "{reasons:?}"
        );
    }
}

#[test]
fn a_mirror_image_is_said_to_look_like_one() {
    let source = lumpy(4);
    let mirrored: Vec<Point> = source.0.iter().map(|p| [-p[0], p[1], p[2]]).collect();
    let wound: Vec<[i64; 3]> = source.1.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let (a, b) = (prepared(&source.0, &source.1), prepared(&mirrored, &wound));
    let map = found(&a, &b, &Options::default());
    let (grade, reasons) = graded(&map.metrics.unwrap(), map.coverage);
    assert_ne!(grade, Grade::Green, "{reasons:?}");
    assert!(
        reasons.iter().any(|r| r.contains("mirror image")),
        "{reasons:?}"
    );
}

#[test]
fn loose_and_dropped_vertices_get_the_nearest_image_and_no_confidence() {
    let source = lumpy(3);
    let n = source.0.len();
    let mut target = source.clone();
    target.0.push([9.0, 9.0, 9.0]);
    target
        .0
        .extend([[5.0, 0.0, 0.0], [5.1, 0.0, 0.0], [5.0, 0.1, 0.0]]);
    target.1.push([n as i64 + 1, n as i64 + 2, n as i64 + 3]);
    let (a, b) = (
        prepared(&source.0, &source.1),
        prepared(&target.0, &target.1),
    );
    let map = found(&a, &b, &Options::default());
    assert_eq!(map.unmatched, 4);
    assert!(map.confidence[n..].iter().all(|c| *c == 0.0));
    assert!(map.faces.iter().all(|f| (*f as usize) < source.1.len()));
}

#[test]
fn cancelling_ends_every_stage_with_the_same_error() {
    let source = lumpy(3);
    let (a, b) = (
        prepared(&source.0, &source.1),
        prepared(&source.0, &source.1),
    );
    for stop in ["search", "selection", "refinement", "dense map"] {
        let progress = Progress::default();
        let report = |stage: &'static str, f: f64| {
            if stage == stop {
                progress.cancel();
            }
            progress.enter(stage, f)
        };
        let end = match_shapes(&a, &b, &Options::default(), &progress, &report);
        assert_eq!(end.err(), Some(Error::Cancelled), "{stop}");
    }
}

#[test]
fn what_a_half_lacks_lies_beyond_its_rim() {
    let (points, faces) = icosphere(4);
    let sphere = Mesh::new(&points, &faces).unwrap();
    let upper: Vec<[i64; 3]> = faces
        .iter()
        .copied()
        .filter(|f| f.iter().all(|&v| points[v as usize][2] >= 0.0))
        .collect();
    let half = Mesh::new(&points, &upper).unwrap();
    // Each vertex of the sphere to the nearest of the half, which is on the rim for the lower ones.
    let images: Vec<u32> = points
        .iter()
        .map(|&p| {
            let far = |&a: &u32| length(sub(points[half.input_vertex[a as usize].index()], p));
            let ids = 0..half.vertices.len() as u32;
            ids.min_by(|a, b| far(a).total_cmp(&far(b))).unwrap()
        })
        .collect();
    let near = boundary::nearness(&half);
    let beyond = boundary::beyond(&near, &boundary::nearness(&sphere), &images);
    for (p, beyond) in points.iter().zip(beyond) {
        if p[2] < -0.2 {
            assert!(beyond > 0.99, "{p:?}: {beyond}");
        } else if p[2] > 0.8 {
            // Eight reaches from the rim and more.
            assert!(beyond < 1e-3, "{p:?}: {beyond}");
        }
    }
    let itself: Vec<u32> = (0..half.vertices.len() as u32).collect();
    assert!(
        boundary::beyond(&near, &near, &itself)
            .iter()
            .all(|&b| b == 0.0)
    );
}
