//! Geodesics from mesh intake to distance matrix and samples, against closed forms.

use std::collections::HashMap;

use sgmds_core::algebra::vector::{self, Point};
use sgmds_core::error::Error;
use sgmds_core::geodesics::{FastMarching, Seed, Workspace, distances_from, farthest_points};
use sgmds_core::mesh::Mesh;

type Triangles = (Vec<Point>, Vec<[i64; 3]>);

/// Icosahedron, each face split in four `levels` times, pushed to the unit sphere.
fn sphere(levels: usize) -> Triangles {
    let t = f64::midpoint(1.0, 5f64.sqrt());
    let mut points: Vec<Point> = Vec::new();
    for (x, y) in [(-1.0, t), (1.0, t), (-1.0, -t), (1.0, -t)] {
        points.extend([[x, y, 0.0], [0.0, x, y], [y, 0.0, x]]);
    }
    // Faces are the triples of mutual neighbours; an icosahedron's edges have length 2 here.
    let near = |a: usize, b: usize| (vector::distance(points[a], points[b]) - 2.0).abs() < 1e-9;
    let mut faces: Vec<[i64; 3]> = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    faces.push([a as i64, b as i64, c as i64]);
                }
            }
        }
    }
    for _ in 0..levels {
        let mut middles: HashMap<(i64, i64), i64> = HashMap::new();
        let mut finer = Vec::with_capacity(4 * faces.len());
        for &[a, b, c] in &faces {
            let [x, y, z] = [(a, b), (b, c), (c, a)].map(|(u, v)| {
                *middles.entry((u.min(v), u.max(v))).or_insert_with(|| {
                    points.push(vector::add(points[u as usize], points[v as usize]));
                    points.len() as i64 - 1
                })
            });
            finer.extend([[a, x, z], [b, y, x], [c, z, y], [x, y, z]]);
        }
        faces = finer;
        for p in &mut points {
            *p = vector::normalised(*p);
        }
    }
    (points.into_iter().map(vector::normalised).collect(), faces)
}

/// Flat `n` × `n` grid of unit-width cells sheared by `shear`: obtuse when it is above zero.
fn grid(n: usize, shear: f64) -> Triangles {
    let mut points = Vec::new();
    let mut faces = Vec::new();
    for j in 0..n {
        for i in 0..n {
            points.push([i as f64 + shear * j as f64, j as f64, 0.0]);
            if i + 1 < n && j + 1 < n {
                let a = (j * n + i) as i64;
                let m = n as i64;
                faces.extend([[a, a + 1, a + m + 1], [a, a + m + 1, a + m]]);
            }
        }
    }
    (points, faces)
}

fn never() -> bool {
    false
}

#[test]
fn sphere_against_great_circles() {
    // Mean relative errors; the chord of an edge is itself shorter than its arc by a share that
    // falls fourfold per level, the march's own error falls at least twofold. Few sources are marched, many swept.
    for count in [6, 70] {
        great_circles(count);
    }
}

fn great_circles(sources: usize) {
    let mut errors = Vec::new();
    for levels in [3, 4, 5] {
        let (vertices, faces) = sphere(levels);
        let mesh = Mesh::new(&vertices, &faces).unwrap();
        let marching = FastMarching::new(&mesh);
        let sources =
            farthest_points(&marching, &mesh, mesh.vertices.len(), sources, &never).unwrap();
        let distances = distances_from(&marching, &sources, &never).unwrap();
        let (mut sum, mut count) = (0.0, 0);
        for (j, &s) in sources.iter().enumerate() {
            for v in 0..mesh.vertices.len() {
                let (p, q) = (vertices[s as usize], vertices[v]);
                let truth = vector::norm(vector::cross(p, q)).atan2(vector::dot(p, q));
                if truth > 0.0 {
                    let found = f64::from(distances[(v, j)]) * mesh.scale;
                    sum += (found - truth).abs() / truth;
                    count += 1;
                }
            }
        }
        errors.push(sum / f64::from(count));
    }
    assert!(errors[0] < 0.02, "{errors:?}");
    assert!(errors[1] < 0.6 * errors[0], "{errors:?}");
    assert!(errors[2] < 0.6 * errors[1], "{errors:?}");
}

#[test]
fn flat_grids_have_straight_lines() {
    // Flat and convex: 2e-4 holds for all but the shear of 0.7 (crossing slack, single precision,
    // least gain for opening a passed vertex again). There a border vertex taken for a bend mixes
    // two circles, which costs some parts in a thousand.
    for (shear, tolerance) in [(0.0, 2e-4), (-0.5, 2e-4), (0.7, 1e-2), (1.5, 2e-4)] {
        let (vertices, faces) = grid(21, shear);
        let mesh = Mesh::new(&vertices, &faces).unwrap();
        let marching = FastMarching::new(&mesh);
        for source in [0usize, 220, 87, 440] {
            let distances = distances_from(&marching, &[source as u32], &never).unwrap();
            for (v, &p) in vertices.iter().enumerate() {
                let truth = vector::distance(vertices[source], p);
                let found = f64::from(distances[(v, 0)]) * mesh.scale;
                assert!(
                    (found - truth).abs() <= tolerance * truth,
                    "shear {shear}, {source} to {v}: {found} for {truth}"
                );
            }
        }
    }
}

#[test]
fn many_sources_have_straight_lines_too() {
    // In a mean, a five hundredth of a cell: what a sweep gains below 0.5 % of an edge no neighbour hears of, and border
    // vertices taken for bends mix circles, which costs up to a quarter of a cell there.
    for shear in [0.0, -0.5, 0.7, 1.5] {
        let (vertices, faces) = grid(21, shear);
        let mesh = Mesh::new(&vertices, &faces).unwrap();
        let marching = FastMarching::new(&mesh);
        // 17 is prime to the 441 vertices.
        let sources: Vec<u32> = (0..100).map(|i| i * 17 % 441).collect();
        let distances = distances_from(&marching, &sources, &never).unwrap();
        let mut errors = Vec::new();
        for (j, &source) in sources.iter().enumerate() {
            for (v, &p) in vertices.iter().enumerate() {
                let truth = vector::distance(vertices[source as usize], p);
                errors.push((f64::from(distances[(v, j)]) * mesh.scale - truth).abs());
            }
        }
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let worst = errors.iter().copied().fold(0.0, f64::max);
        assert!(
            mean < 0.002 && worst < 0.25,
            "shear {shear}: {mean} {worst}"
        );
    }
}

#[test]
fn many_sources_reach_what_few_reach() {
    // Two grids beside each other, of which the second is hit by few sources, and by none of the first ones.
    let (mut vertices, mut faces) = grid(15, 0.0);
    let n = vertices.len();
    let (others, more) = grid(9, 0.0);
    vertices.extend(others.iter().map(|&[x, y, _]| [x, y, 50.0]));
    faces.extend(more.iter().map(|f| f.map(|v| v + n as i64)));
    let triangles: Vec<[u32; 3]> = faces.iter().map(|f| f.map(|v| v as u32)).collect();
    let marching = FastMarching::from_triangles(&vertices, &triangles);
    let sources: Vec<u32> = (0..80).chain([n as u32 + 40, n as u32]).collect();
    let distances = distances_from(&marching, &sources, &never).unwrap();
    for (j, &source) in sources.iter().enumerate() {
        for (v, &p) in vertices.iter().enumerate() {
            let q = vertices[source as usize];
            let (found, truth) = (f64::from(distances[(v, j)]), vector::distance(p, q));
            if p[2] == q[2] {
                // As on one grid.
                assert!((found - truth).abs() < 0.25, "{source} to {v}: {found}");
            } else {
                assert!(found == f64::INFINITY);
            }
        }
    }
}

#[test]
fn a_plane_measured_by_its_distance_from_a_point_is_flat_in_polar_coordinates() {
    // The metric |dz|/|z| has the coordinates ln r and θ, in which it is |dw|: here a unit square.
    let mut errors = Vec::new();
    for n in [21, 41] {
        let (grid, faces) = grid(n, 0.0);
        let flat: Vec<[f64; 3]> = grid
            .iter()
            .map(|p| p.map(|x| x / (n as f64 - 1.0)))
            .collect();
        let vertices: Vec<[f64; 3]> = flat
            .iter()
            .map(|&[log_radius, angle, _]| {
                let (sin, cos) = angle.sin_cos();
                [cos, sin, 0.0].map(|x| log_radius.exp() * x)
            })
            .collect();
        let mesh = Mesh::new(&vertices, &faces).unwrap();
        let factors: Vec<f64> = faces
            .iter()
            .map(|f| {
                let sum: f64 = f.iter().map(|&v| vector::norm(vertices[v as usize])).sum();
                3.0 / sum
            })
            .collect();
        let marching = FastMarching::stretched(&mesh, &factors);
        let (mut sum, mut count) = (0.0, 0);
        for source in [0, n / 2, n * n / 2] {
            let distances = distances_from(&marching, &[source as u32], &never).unwrap();
            for (v, &p) in flat.iter().enumerate().filter(|&(v, _)| v != source) {
                let truth = vector::distance(flat[source], p);
                sum += (f64::from(distances[(v, 0)]) * mesh.scale - truth).abs() / truth;
                count += 1;
            }
        }
        errors.push(sum / f64::from(count));
    }
    // A factor for each face is first order in the edge, 0.05 and 0.025 here.
    assert!(errors[0] < 0.02, "{errors:?}");
    assert!(errors[1] < 0.6 * errors[0], "{errors:?}");
}

#[test]
fn points_in_faces_are_sources_too() {
    let (vertices, faces) = grid(21, 0.3);
    let mesh = Mesh::new(&vertices, &faces).unwrap();
    let marching = FastMarching::new(&mesh);
    let mut workspace = Workspace::new(&marching);
    let mut out = vec![0.0; mesh.vertices.len()];
    let weights = [0.2, 0.5, 0.3];
    for face in [0u32, 333, 411] {
        let seeds = Seed::in_face(&mesh, face, weights, 0.25);
        marching.march_seeds(&seeds, f32::INFINITY, &mut workspace, &mut out);
        let corners = mesh.faces[face as usize].map(|v| mesh.vertices[v as usize]);
        let point = [0, 1, 2].map(|i| (0..3).map(|k| weights[k] * corners[k][i]).sum());
        for (v, &p) in mesh.vertices.iter().enumerate() {
            let truth = 0.25 + vector::distance(point, p);
            assert!((f64::from(out[v]) - truth).abs() < 1e-4 * truth);
        }
    }
}

#[test]
fn bounded_marches_agree_with_whole_ones() {
    let (vertices, faces) = sphere(4);
    let mesh = Mesh::new(&vertices, &faces).unwrap();
    let marching = FastMarching::new(&mesh);
    let mut workspace = Workspace::new(&marching);
    let n = mesh.vertices.len();
    let (mut whole, mut part) = (vec![0.0; n], vec![0.0; n]);
    marching.march(7, &mut workspace, &mut whole);
    marching.march_bounded(7, 0.2, &mut workspace, &mut part);
    assert!(part.iter().filter(|d| d.is_finite()).count() > 10);
    for (w, p) in whole.iter().zip(&part) {
        assert!(if *w <= 0.2 {
            p == w
        } else {
            *p == f32::INFINITY
        });
    }
}

#[test]
fn nearly_a_metric() {
    // The march is directed, so d(i, j) and d(j, i) differ by its discretisation error, below 2 %.
    let (mut vertices, faces) = sphere(4);
    for p in &mut vertices {
        *p = [p[0] * (1.0 + 0.6 * p[1]), 1.7 * p[1], 0.5 * p[2]];
    }
    let mesh = Mesh::new(&vertices, &faces).unwrap();
    let marching = FastMarching::new(&mesh);
    let samples = farthest_points(&marching, &mesh, mesh.vertices.len(), 70, &never).unwrap();
    let distances = distances_from(&marching, &samples, &never).unwrap();
    let d = |i: usize, j: usize| distances[(samples[i] as usize, j)];
    for i in 0..70 {
        assert!(d(i, i) == 0.0);
        for j in 0..70 {
            assert!((d(i, j) - d(j, i)).abs() <= 0.02 * d(i, j));
            for k in 0..70 {
                assert!(d(i, k) <= 1.02 * (d(i, j) + d(j, k)));
            }
        }
    }
}

#[test]
fn samples_follow_the_shape() {
    // No symmetry, so no ties: turning, moving, scaling and renumbering permutes the samples.
    let (mut vertices, faces) = sphere(4);
    for p in &mut vertices {
        let bump =
            1.0 + 0.2 * (3.0 * p[0] + 1.0).sin() + 0.1 * (5.0 * p[1] + 2.0 * p[2] + 0.7).cos();
        *p = [1.3 * p[0] * bump, p[1] * bump, 0.8 * p[2] * bump];
    }
    let n = vertices.len();
    // 1543 is prime to the 2562 vertices.
    let place = |v: usize| (v * 1543 + 11) % n;
    let mut moved = vec![[0.0; 3]; n];
    for (v, p) in vertices.iter().enumerate() {
        let (c, s) = (0.6, 0.8);
        moved[place(v)] = [
            3.0 * (c * p[0] - s * p[1]) + 5.0,
            3.0 * p[2],
            3.0 * (-s * p[0] - c * p[1]) - 2.0,
        ];
    }
    let renumbered: Vec<[i64; 3]> = faces
        .iter()
        .rev()
        .map(|f| {
            let [a, b, c] = f.map(|v| place(v as usize) as i64);
            [b, c, a]
        })
        .collect();
    let first = Mesh::new(&vertices, &faces).unwrap();
    let second = Mesh::new(&moved, &renumbered).unwrap();
    let [a, b] = [&first, &second].map(|mesh| {
        farthest_points(
            &FastMarching::new(mesh),
            mesh,
            mesh.vertices.len(),
            100,
            &never,
        )
        .unwrap()
    });
    let image: Vec<u32> = a.iter().map(|&v| place(v as usize) as u32).collect();
    assert_eq!(image, b);
    let mut unique = a.clone();
    unique.sort_unstable();
    unique.dedup();
    assert_eq!(unique.len(), 100);
}

#[test]
fn samples_stop_at_the_last_vertex() {
    let (vertices, faces) = grid(6, 0.0);
    let mesh = Mesh::new(&vertices, &faces).unwrap();
    let samples = farthest_points(
        &FastMarching::new(&mesh),
        &mesh,
        mesh.vertices.len(),
        1000,
        &never,
    )
    .unwrap();
    assert_eq!(samples.len(), mesh.vertices.len());
}

#[test]
fn threads_do_not_change_distances() {
    let (vertices, faces) = sphere(4);
    let mesh = Mesh::new(&vertices, &faces).unwrap();
    let marching = FastMarching::new(&mesh);
    let sources: Vec<u32> = (0..90).map(|i| i * 17).collect();
    let run = |threads| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
            .install(|| distances_from(&marching, &sources, &never).unwrap())
    };
    assert!(run(1) == run(3));
}

#[test]
fn cancelling_and_bad_sources_are_errors() {
    let (vertices, faces) = sphere(2);
    let mesh = Mesh::new(&vertices, &faces).unwrap();
    let marching = FastMarching::new(&mesh);
    let cancelled = || true;
    assert_eq!(
        farthest_points(&marching, &mesh, mesh.vertices.len(), 5, &cancelled),
        Err(Error::Cancelled)
    );
    assert_eq!(
        distances_from(&marching, &[0], &cancelled).unwrap_err(),
        Error::Cancelled
    );
    assert!(matches!(
        distances_from(&marching, &[0, 9999], &never),
        Err(Error::BadArgument { .. })
    ));
}
