//! Simplified meshes, and maps that are sought on them.

use std::collections::HashMap;
use std::sync::Arc;

use sgmds_core::matching::{Correspondence, Options, match_shapes};
use sgmds_core::mesh::Mesh;
use sgmds_core::mesh::simplification::simplified;
use sgmds_core::mesh::surface_point::SurfacePoint;
use sgmds_core::shape::Shape;
use sgmds_core::shape::full_resolution::FullResolution;
use sgmds_core::shape::settings::SHAPE;
use sgmds_core::watch::progress::Progress;

use crate::common::{Point, icosphere, length, lumpy, sub};

/// Vertices less edges plus faces, and how many edges have one face.
fn euler_and_border(vertices: usize, faces: &[[u32; 3]]) -> (i64, usize) {
    let mut edges: HashMap<(u32, u32), usize> = HashMap::new();
    for &[a, b, c] in faces {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            *edges.entry((p.min(q), p.max(q))).or_default() += 1;
        }
    }
    assert!(edges.values().all(|&count| count <= 2));
    let border = edges.values().filter(|&&count| count == 1).count();
    (
        vertices as i64 - edges.len() as i64 + faces.len() as i64,
        border,
    )
}

fn position(mesh: &Mesh, point: &SurfacePoint) -> Point {
    let corners = mesh.faces[point.face as usize].map(|v| mesh.vertices[v as usize]);
    [0, 1, 2].map(|i| (0..3).map(|c| point.weights[c] * corners[c][i]).sum())
}

#[test]
fn a_sphere_stays_a_sphere_with_even_triangles() {
    let (vertices, faces) = icosphere(5);
    let mesh = Mesh::new(&vertices, &faces).unwrap();
    let coarse = simplified(&mesh, 1000, &|| false).unwrap();
    assert_eq!(coarse.kept.len(), 1000);
    assert_eq!(euler_and_border(1000, &coarse.faces), (2, 0));
    let at = |v: u32| mesh.vertices[coarse.kept[v as usize] as usize];
    let lengths: Vec<f64> = coarse
        .faces
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)].map(|(p, q)| length(sub(at(p), at(q)))))
        .collect();
    let mean = lengths.iter().sum::<f64>() / lengths.len() as f64;
    // Equilateral triangles of area 1/2000·(4/√3)^½; collapsed edges make some of them long.
    let ideal = (4.0 / 3.0f64.sqrt() / 1996.0).sqrt();
    assert!((mean / ideal - 1.0).abs() < 0.1, "{mean} for {ideal}");
    assert!(lengths.iter().all(|&l| l < 2.5 * mean && l > mean / 4.0));
    // Chords of the mean edge: the area falls short by (mean/2R)²/2·… of the order of a percent.
    let area: f64 = (0..coarse.faces.len())
        .map(|f| {
            let [a, b, c] = coarse.faces[f].map(at);
            length(crate::common::cross(sub(b, a), sub(c, a))) / 2.0
        })
        .sum();
    assert!(area < 1.0 && area > 0.98, "{area}");
    for (v, &anchor) in coarse.anchor.iter().enumerate() {
        assert!(length(sub(mesh.vertices[v], at(anchor))) < 4.0 * mean);
    }
}

#[test]
fn a_finger_keeps_more_vertices_than_its_area() {
    // A tube of radius 0.5 and length 1 goes over into one of radius 0.05.
    const AROUND: i64 = 60;
    let rings: Vec<[f64; 2]> = (0..=60)
        .map(|i| [0.5, f64::from(i) / 60.0])
        .chain((0..=60).map(|i| [0.05, 1.02 + f64::from(i) / 60.0]))
        .collect();
    let vertices: Vec<Point> = rings
        .iter()
        .flat_map(|&[radius, z]| {
            (0..AROUND).map(move |i| {
                let angle = std::f64::consts::TAU * i as f64 / AROUND as f64;
                [radius * angle.cos(), radius * angle.sin(), z]
            })
        })
        .collect();
    let faces: Vec<[i64; 3]> = (0..(rings.len() as i64 - 1) * AROUND)
        .flat_map(|a| {
            let b = a / AROUND * AROUND + (a + 1) % AROUND;
            [[a, b, b + AROUND], [a, b + AROUND, a + AROUND]]
        })
        .collect();
    let mesh = Mesh::new(&vertices, &faces).unwrap();
    let coarse = simplified(&mesh, 300, &|| false).unwrap();
    let kept = |from: f64, to: f64| {
        let height = |&v: &u32| vertices[mesh.input_vertex[v as usize].index()][2];
        let within = coarse
            .kept
            .iter()
            .map(height)
            .filter(|z| (from..to).contains(z));
        within.count() as f64
    };
    // A tenth of the area, of which three or four vertices around are left: evenly spread there are fewer.
    let ratio = kept(1.1, 1.9) / kept(0.1, 0.9);
    assert!(ratio > 1.5 * 0.1, "{ratio}");
}

#[test]
fn a_border_shrinks_along_itself() {
    let n = 50i64;
    let vertices: Vec<Point> = (0..=n)
        .flat_map(|j| (0..=n).map(move |i| [i as f64, j as f64, 0.0]))
        .collect();
    let faces: Vec<[i64; 3]> = (0..n * n)
        .flat_map(|cell| {
            let a = cell / n * (n + 1) + cell % n;
            [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
        })
        .collect();
    let mesh = Mesh::new(&vertices, &faces).unwrap();
    let coarse = simplified(&mesh, 300, &|| false).unwrap();
    assert_eq!(coarse.kept.len(), 300);
    let (euler, border) = euler_and_border(300, &coarse.faces);
    assert!(euler == 1 && border < 4 * n as usize);
    let area: f64 = coarse
        .faces
        .iter()
        .map(|f| {
            let [a, b, c] = f.map(|v| mesh.vertices[coarse.kept[v as usize] as usize]);
            crate::common::cross(sub(b, a), sub(c, a))[2] / 2.0
        })
        .sum();
    // Only corners may be cut off, each by a triangle of the coarse mesh at most.
    assert!(area <= 1.0 + 1e-12 && area > 0.97, "{area}");
}

#[test]
fn points_return_from_the_simplified_mesh() {
    let (vertices, faces) = icosphere(5);
    let mesh = Mesh::new(&vertices, &faces).unwrap();
    let (working, full) = FullResolution::simplified(mesh, 1000, &Progress::default()).unwrap();
    let back = full.located(&full.points, &working, &|| Ok(())).unwrap();
    let edge = (4.0 / 3.0f64.sqrt() / 2000.0).sqrt();
    for (v, point) in back.iter().enumerate() {
        let gap = length(sub(position(&full.mesh, point), full.mesh.vertices[v]));
        // Both ways are nearly radial: they part by the angle between chord and sphere.
        assert!(gap < 0.1 * edge, "{v}: {gap}");
    }
    for (v, point) in full.points.iter().enumerate() {
        assert!(full.on_face(point.face).any(|other| other.index() == v));
    }
}

#[test]
fn a_large_mesh_maps_to_and_from_a_small_one() {
    // The finer mesh begins with the coarser one's vertices.
    let (small, large) = (lumpy(4), lumpy(6));
    assert!(small.0.len() < SHAPE.simplified_above && large.0.len() > SHAPE.simplified_above);
    let progress = Progress::default();
    let prepare = |s: &(Vec<Point>, Vec<[i64; 3]>)| {
        Arc::new(Shape::new(&s.0, &s.1, &progress, &|_, _| Ok(())).unwrap())
    };
    let shapes = [prepare(&small), prepare(&large)];
    let error = |map: &Correspondence, source: &(Vec<Point>, Vec<[i64; 3]>)| {
        let sum: f64 = (0..small.0.len())
            .map(|v| {
                let corners = source.1[map.faces[v] as usize].map(|c| source.0[c as usize]);
                let w = map.barycentric[v];
                let image = [0, 1, 2].map(|i| (0..3).map(|c| w[c] * corners[c][i]).sum());
                length(sub(image, small.0[v]))
            })
            .sum();
        sum / small.0.len() as f64 / shapes[0].mesh.scale
    };
    let options = Options::default();
    let run = |source: usize, target: usize| {
        match_shapes(
            &shapes[source],
            &shapes[target],
            &options,
            &progress,
            &|_, _| Ok(()),
        )
        .unwrap()
    };
    let (down, up) = (run(0, 1), run(1, 0));
    assert_eq!(down.faces.len(), large.0.len());
    assert_eq!(up.faces.len(), small.0.len());
    // Half an edge of the simplified mesh.
    let (first, second) = (error(&down, &small), error(&up, &large));
    assert!(first < 0.005 && second < 0.005, "{first} {second}");

    let alpha = down
        .full_functional_map(&shapes[0], &shapes[1], &progress)
        .unwrap();
    // A constant is √area times the first eigenfunction on either shape.
    let ratio = shapes[1].given_mesh().scale / shapes[0].given_mesh().scale;
    assert!((alpha[(0, 0)] - ratio).abs() < 1e-9 * ratio);
    assert!((1..alpha.nrows()).all(|i| alpha[(i, 0)].abs() < 1e-6));
}
