//! Bytes as meshes and cached shapes, and what must hold of the core for each of them: it ends, with a
//! sound result or an error, and never panics. Used by the fuzzer and by the replay of its corpus.
#![allow(dead_code, reason = "each target uses its own part")]

use std::sync::Arc;

use faer::Mat;
use sgmds_core::geodesics::metric::Metric;
use sgmds_core::geodesics::{FastMarching, Workspace};
use sgmds_core::matching::{self, Options};
use sgmds_core::mesh::Mesh;
use sgmds_core::shape::{CostlyParts, Shape};
use sgmds_core::spectrum::eigenbasis::Eigenbasis;
use sgmds_core::spectrum::laplacian::Laplacian;
use sgmds_core::watch::progress::Progress;

type Soup = (Vec<[f64; 3]>, Vec<[i64; 3]>);

/// Bytes one after the other, zero at the end.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn next(&mut self) -> u8 {
        let Some((&first, rest)) = self.0.split_first() else {
            return 0;
        };
        self.0 = rest;
        first
    }

    fn below(&mut self, count: usize) -> usize {
        let wide = usize::from(self.next()) << 8 | usize::from(self.next());
        wide % count.max(1)
    }

    /// Mostly small multiples of 1/16, now and then what no coordinate should be.
    fn coordinate(&mut self) -> f64 {
        match self.next() {
            255 => f64::NAN,
            254 => f64::INFINITY,
            253 => 1e300,
            252 => -1e300,
            251 => 1e-300,
            250 => 5e-324,
            249 => 1e17,
            byte => f64::from(byte as i8) / 16.0,
        }
    }
}

/// A closed torus grid with an uneven tube, 8 × 6 vertices: enough for a spectrum.
fn base() -> Soup {
    let (around, across) = (8i64, 6i64);
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    for i in 0..around {
        for j in 0..across {
            let (u, v) = (i as f64 / around as f64, j as f64 / across as f64);
            let (u, v) = (u * std::f64::consts::TAU, v * std::f64::consts::TAU);
            let tube = 0.5 + 0.2 * (u + 0.3).cos();
            let ring = 2.0 + tube * v.cos();
            vertices.push([ring * u.cos(), 1.3 * ring * u.sin(), tube * v.sin()]);
            let id = |i: i64, j: i64| (i % around) * across + j % across;
            faces.push([id(i, j), id(i + 1, j), id(i + 1, j + 1)]);
            faces.push([id(i, j), id(i + 1, j + 1), id(i, j + 1)]);
        }
    }
    (vertices, faces)
}

/// A soup of triangles, or a sound mesh with damage done to it.
fn soup(bytes: &mut Bytes<'_>) -> Soup {
    if bytes.next().is_multiple_of(4) {
        let count = usize::from(bytes.next());
        let vertices: Vec<[f64; 3]> = (0..count)
            .map(|_| [(); 3].map(|()| bytes.coordinate()))
            .collect();
        let mut faces = Vec::new();
        while !bytes.0.is_empty() && faces.len() < 500 {
            faces.push([(); 3].map(|()| i64::from(bytes.next()) - 1));
        }
        return (vertices, faces);
    }
    let (mut vertices, mut faces) = base();
    while !bytes.0.is_empty() && faces.len() < 500 && vertices.len() < 500 {
        let v = bytes.below(vertices.len());
        let f = bytes.below(faces.len().max(1));
        let near = bytes.below(vertices.len()) as i64;
        match bytes.next() % 11 {
            0 => vertices[v] = [(); 3].map(|()| bytes.coordinate()),
            1 => vertices[v] = vertices[near as usize],
            2 => faces.push([v as i64, near, bytes.below(vertices.len()) as i64]),
            3 if !faces.is_empty() => drop(faces.swap_remove(f)),
            4 if !faces.is_empty() => faces[f].swap(0, 1),
            5 if !faces.is_empty() => faces.push(faces[f]),
            6 if !faces.is_empty() => {
                // A vertex in the middle of an edge, on one side only.
                let [a, b, c] = faces[f];
                let (Some(p), Some(q)) = (vertices.get(a as usize), vertices.get(b as usize))
                else {
                    continue;
                };
                let middle = [0, 1, 2].map(|i| f64::midpoint(p[i], q[i]));
                let m = vertices.len() as i64;
                vertices.push(middle);
                faces[f] = [a, m, c];
                faces.extend([[m, b, c], [a, b, m]]);
            }
            7 => vertices.push([(); 3].map(|()| bytes.coordinate())),
            8 => {
                let factor = 10f64.powi(i32::from(bytes.next() as i8) / 8);
                for x in vertices.iter_mut().flatten() {
                    *x *= factor;
                }
            }
            9 => {
                // Unwelded: a face with corners of its own.
                if let Some(face) = faces.get_mut(f) {
                    for corner in face {
                        if let Some(&p) = vertices.get(*corner as usize) {
                            *corner = vertices.len() as i64;
                            vertices.push(p);
                        }
                    }
                }
            }
            _ => {
                if let Some(face) = faces.get_mut(f) {
                    face[usize::from(bytes.next() % 3)] = near;
                }
            }
        }
    }
    (vertices, faces)
}

/// Mesh, operator, marching and spectrum.
pub fn intake(data: &[u8]) {
    let (vertices, faces) = soup(&mut Bytes(data));
    let Ok(mesh) = Mesh::new(&vertices, &faces) else {
        return;
    };
    sound_mesh(&mesh, &vertices, &faces);
    let laplacian = Laplacian::new(&mesh).expect("every checked mesh has an operator");
    sound_operator(&laplacian, mesh.is_regular());
    let marching = FastMarching::new(&mesh);
    let mut distances = vec![0.0; mesh.vertices.len()];
    marching.march(0, &mut Workspace::new(&marching), &mut distances);
    assert!(distances.iter().all(|d| *d >= 0.0 && d.is_finite()));
    if let Ok(basis) = Eigenbasis::new(&laplacian, 10, &|| false) {
        assert!(basis.values.is_sorted() && basis.values[9].is_finite());
    }
}

/// What [`Mesh`] promises.
pub fn sound_mesh(mesh: &Mesh, vertices: &[[f64; 3]], faces: &[[i64; 3]]) {
    let n = mesh.vertices.len();
    assert!(mesh.faces.iter().flatten().all(|&v| (v as usize) < n));
    assert!(mesh.vertices.iter().flatten().all(|x| x.is_finite()));
    assert_eq!(mesh.input_vertex.len(), mesh.vertices.len());
    assert!(mesh.input_vertex.iter().all(|v| v.index() < vertices.len()));
    assert!(mesh.input_face.iter().all(|&f| (f as usize) < faces.len()));
    assert_eq!(mesh.input_positions.len(), vertices.len());
    let area: f64 = (0..mesh.faces.len()).map(|f| mesh.face_area(f)).sum();
    // Positions far from the origin have lost digits before they are moved there.
    assert!((area - 1.0).abs() < 1e-5, "area {area}");
}

/// What [`Laplacian`] promises: symmetric, semi-definite, a positive mass; on the cover of a mesh
/// that is not regular also diagonally dominant, since no weight is negative.
pub fn sound_operator(laplacian: &Laplacian, regular: bool) {
    let w = &laplacian.stiffness;
    assert!(laplacian.mass.iter().all(|&a| a > 0.0 && a.is_finite()));
    let area: f64 = laplacian.mass.iter().sum();
    // As above.
    assert!((area - 1.0).abs() < 1e-5, "mass {area}");
    for (i, row) in w.outer_iterator().enumerate() {
        let (mut sum, mut size) = (0.0, 0.0);
        for (j, &x) in row.iter() {
            assert!(x.is_finite());
            assert!(w.get(j, i) == Some(&x), "not symmetric at {i} {j}");
            assert!(
                regular || i == j || x <= 0.0,
                "a positive entry {x} at {i} {j}"
            );
            sum += x;
            size += x.abs();
        }
        assert!(sum.abs() <= 1e-12 * size, "row {i} sums to {sum}");
    }
    // Energies of functions that vary fast, slowly, and at one vertex only.
    let n = laplacian.len();
    for step in [1, 3, 7, n] {
        let f: Vec<f64> = (0..n).map(|i| ((i / step) as f64 * 2.4).cos()).collect();
        let (mut energy, mut size) = (0.0, 0.0);
        for (&x, (i, j)) in w {
            energy += f[i] * x * f[j];
            size += (f[i] * x * f[j]).abs();
        }
        assert!(energy >= -1e-12 * size, "energy {energy}");
    }
    assert!((0..n).all(|i| w.get(i, i).is_some_and(|&x| x >= 0.0)));
}

/// A mesh matched with itself in another numbering of its faces.
pub fn whole_chain(data: &[u8]) {
    let (vertices, mut faces) = soup(&mut Bytes(data));
    let progress = Progress::default();
    let prepared =
        |faces: &[[i64; 3]]| Shape::new(&vertices, faces, &progress, &|_, _| Ok(())).map(Arc::new);
    let Ok(source) = prepared(&faces) else {
        return;
    };
    faces.reverse();
    let target = prepared(&faces).expect("the order of faces does not matter");
    let report = |_: &'static str, _: f64| Ok(());
    let Ok(map) = matching::match_shapes(&source, &target, &Options::default(), &progress, &report)
    else {
        return;
    };
    assert_eq!(map.faces.len(), vertices.len());
    assert!(map.faces.iter().all(|&f| (f as usize) < faces.len()));
    for weights in &map.barycentric {
        assert!(weights.iter().all(|w| (0.0..=1.0).contains(w)));
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    }
    assert!(map.confidence.iter().all(|c| (0.0..=1.0).contains(c)));
    let alpha = &map.functional_map;
    assert!((0..alpha.ncols()).all(|j| alpha.col(j).iter().all(|x| x.is_finite())));
}

/// A stored shape: right parts for its mesh, with a few bytes of damage, or parts of any size.
pub fn restore(data: &[u8]) {
    let mut bytes = Bytes(data);
    let (vertices, faces) = base();
    let sizes = [
        bytes.below(60),
        bytes.below(12),
        bytes.below(60),
        bytes.below(8),
    ];
    let right = bytes.next() % 2 == 0;
    let metric = if bytes.next() % 4 == 0 {
        Metric::ScaleInvariant
    } else {
        Metric::Euclidean
    };
    // 48 vertices are cut to four times as many.
    let [n, k, m, s] = if right { [192, 10, 20, 8] } else { sizes };
    let mut values: Vec<f64> = (0..k).map(|i| i as f64).collect();
    let mut functions = Mat::from_fn(n, k, |i, j| ((i * j) as f64).cos());
    let mut farthest: Vec<u32> = (0..m as u32).collect();
    let mut fields = Mat::from_fn(n, s, |i, j| i.abs_diff(j) as f32);
    while !bytes.0.is_empty() {
        let (i, x) = (bytes.below(60), bytes.coordinate());
        match bytes.next() % 4 {
            0 if i < k => values[i] = x,
            1 if i < n && k > 0 => functions[(i, bytes.below(k))] = x,
            2 if i < m => farthest[i] = u32::from(bytes.next()) << (i % 24),
            3 if i < n && s > 0 => fields[(i, bytes.below(s))] = x as f32,
            _ => {}
        }
    }
    let parts = CostlyParts {
        values,
        functions,
        farthest,
        fields,
    };
    if let Ok(shape) = Shape::restored(&vertices, &faces, metric, parts, &Progress::default()) {
        assert!(shape.mass.iter().all(|a| a.is_finite()));
    }
}
