//! Times of the kernels on a bumpy sphere of some 5,000 vertices: `cargo bench -p sgmds-core`.

use divan::{Bencher, black_box};
use sgmds_core::geodesics::{FastMarching, distances_from, farthest_points};
use sgmds_core::matching::{Options, match_shapes};
use sgmds_core::mesh::Mesh;
use sgmds_core::mesh::simplification::simplified;
use sgmds_core::shape::Shape;
use sgmds_core::spectrum::eigenbasis::{Eigenbasis, bare_solves};
use sgmds_core::spectrum::laplacian::Laplacian;
use sgmds_core::watch::progress::Progress;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

fn main() {
    divan::main();
}

/// Rings of a sphere with bumps at incommensurable places, so that it has no symmetry.
fn bumpy_sphere(rings: usize) -> (Vec<[f64; 3]>, Vec<[i64; 3]>) {
    let around = 2 * rings;
    let mut vertices = vec![[0.0, 0.0, 1.0]];
    for i in 1..rings {
        for j in 0..around {
            let (theta, phi) = (PI * i as f64 / rings as f64, TAU * j as f64 / around as f64);
            let bump = 0.2 * (3.0 * theta + 0.5).sin() * (2.0 * phi + 0.3).cos()
                + 0.15 * (phi + 1.1).sin() * theta.sin();
            let radius = 1.0 + bump * theta.sin();
            vertices.push([
                radius * theta.sin() * phi.cos(),
                radius * theta.sin() * phi.sin(),
                radius * theta.cos(),
            ]);
        }
    }
    vertices.push([0.0, 0.0, -1.0]);
    let last = vertices.len() as i64 - 1;
    let at = |i: usize, j: usize| (1 + (i - 1) * around + j % around) as i64;
    let mut faces = Vec::new();
    for j in 0..around {
        faces.push([0, at(1, j), at(1, j + 1)]);
        faces.push([last, at(rings - 1, j + 1), at(rings - 1, j)]);
        for i in 1..rings - 1 {
            faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    (vertices, faces)
}

fn mesh(rings: usize) -> Mesh {
    let (vertices, faces) = bumpy_sphere(rings);
    Mesh::new(&vertices, &faces).expect("a closed surface")
}

const RINGS: usize = 50;

#[divan::bench]
fn operator(bencher: Bencher) {
    let mesh = mesh(RINGS);
    bencher.bench(|| Laplacian::new(black_box(&mesh)));
}

#[divan::bench(args = [60, 150, 200])]
fn eigenpairs(bencher: Bencher, count: usize) {
    let laplacian = Laplacian::new(&mesh(RINGS)).expect("areas are positive");
    bencher.bench(|| Eigenbasis::new(black_box(&laplacian), count, &|| false));
}

/// The solves that 200 eigenpairs take, and nothing else.
#[divan::bench]
fn solves_of_200_eigenpairs(bencher: Bencher) {
    let laplacian = Laplacian::new(&mesh(RINGS)).expect("areas are positive");
    let solves = Eigenbasis::new(&laplacian, 200, &|| false).map_or(0, |basis| basis.solves);
    bencher.bench(|| bare_solves(black_box(&laplacian), solves));
}

#[divan::bench]
fn samples(bencher: Bencher) {
    let mesh = mesh(RINGS);
    let marching = FastMarching::new(&mesh);
    bencher.bench(|| {
        farthest_points(
            black_box(&marching),
            &mesh,
            mesh.vertices.len(),
            500,
            &|| false,
        )
    });
}

#[divan::bench]
fn marching_from_20_sources(bencher: Bencher) {
    let mesh = mesh(RINGS);
    let marching = FastMarching::new(&mesh);
    let sources: Vec<u32> = (0..20).map(|i| i * 200).collect();
    bencher.bench(|| distances_from(black_box(&marching), &sources, &|| false));
}

#[divan::bench(sample_count = 10)]
fn simplification_of_80_000(bencher: Bencher) {
    let mesh = mesh(4 * RINGS);
    bencher.bench(|| simplified(black_box(&mesh), 12_000, &|| false));
}

#[divan::bench(sample_count = 10)]
fn preparation(bencher: Bencher) {
    let (vertices, faces) = bumpy_sphere(RINGS);
    let quiet = |_: &'static str, _: f64| Ok(());
    bencher.bench(|| Shape::new(black_box(&vertices), &faces, &Progress::default(), &quiet));
}

#[divan::bench(sample_count = 10)]
fn matching_prepared(bencher: Bencher) {
    let quiet = |_: &'static str, _: f64| Ok(());
    let shape = |rings: usize| {
        let (vertices, faces) = bumpy_sphere(rings);
        let shape = Shape::new(&vertices, &faces, &Progress::default(), &quiet);
        Arc::new(shape.expect("a closed surface"))
    };
    let (source, target) = (shape(RINGS), shape(RINGS - 4));
    let options = Options::default();
    bencher.bench(|| match_shapes(&source, &target, &options, &Progress::default(), &quiet));
}
