//! Operator and eigenpairs of closed forms.

// Indices of these meshes are far below 2^63; equal to the bit is what is claimed.
#![allow(clippy::cast_possible_wrap, clippy::float_cmp)]

use std::f64::consts::PI;
use std::sync::atomic::{AtomicUsize, Ordering};

use sgmds_core::error::Error;
use sgmds_core::mesh::Mesh;
use sgmds_core::spectrum::eigenbasis::Eigenbasis;
use sgmds_core::spectrum::laplacian::Laplacian;
use sgmds_core::spectrum::settings::EIGENBASIS;

fn icosphere(subdivisions: usize) -> Mesh {
    let (vertices, faces) = crate::common::icosphere(subdivisions);
    Mesh::new(&vertices, &faces).unwrap()
}

/// An open, uneven sheet with obtuse triangles, renumbered by `order`.
fn sheet(side: usize, order: impl Fn(usize) -> usize) -> Mesh {
    let n = side * side;
    let mut vertices = vec![[0.0; 3]; n];
    for i in 0..side {
        for j in 0..side {
            let (x, y) = (i as f64 / side as f64, j as f64 / side as f64);
            vertices[order(i * side + j)] =
                [x * x + 0.3 * y, y, 0.4 * (5.0 * x).sin() * (3.0 * y).cos()];
        }
    }
    let id = |i: usize, j: usize| order(i * side + j) as i64;
    let mut faces = Vec::new();
    for i in 1..side {
        for j in 1..side {
            faces.push([id(i - 1, j - 1), id(i, j - 1), id(i, j)]);
            faces.push([id(i - 1, j - 1), id(i, j), id(i - 1, j)]);
        }
    }
    Mesh::new(&vertices, &faces).unwrap()
}

fn basis(mesh: &Mesh, k: usize) -> (Laplacian, Eigenbasis) {
    let laplacian = Laplacian::new(mesh).unwrap();
    let basis = Eigenbasis::new(&laplacian, k, &|| false).unwrap();
    (laplacian, basis)
}

/// Orthonormality, residual, order, and the constant, all recomputed here.
fn assert_sound(laplacian: &Laplacian, basis: &Eigenbasis) {
    let (n, k) = (basis.functions.nrows(), basis.functions.ncols());
    assert_eq!(basis.values.len(), k);
    assert!(basis.values.is_sorted());
    assert!(basis.values[0] == 0.0);
    let area: f64 = laplacian.mass.iter().sum();
    let phi = &basis.functions;
    assert!((0..n).all(|i| phi[(i, 0)] == 1.0 / area.sqrt()));
    for a in 0..k {
        for b in 0..=a {
            let product: f64 = (0..n)
                .map(|i| phi[(i, a)] * laplacian.mass[i] * phi[(i, b)])
                .sum();
            let expected = f64::from(u8::from(a == b));
            // Rounding of n products.
            assert!((product - expected).abs() < 1e-11, "{a} {b} {product}");
        }
        let mut square = 0.0;
        for (i, row) in laplacian.stiffness.outer_iterator().enumerate() {
            let product: f64 = row.iter().map(|(j, w)| w * phi[(j, a)]).sum();
            let r = product - basis.values[a] * laplacian.mass[i] * phi[(i, a)];
            square += r * r / laplacian.mass[i];
        }
        assert!(square.sqrt() <= EIGENBASIS.residual_bound * basis.values[k - 1]);
    }
}

#[test]
fn stiffness_is_symmetric_semi_definite_and_mass_is_the_area() {
    for mesh in [icosphere(3), sheet(20, |v| v)] {
        let laplacian = Laplacian::new(&mesh).unwrap();
        let w = &laplacian.stiffness;
        for (i, row) in w.outer_iterator().enumerate() {
            let sum: f64 = row.iter().map(|(_, w)| w).sum();
            assert!(sum.abs() < 1e-13 * row.iter().map(|(_, w)| w.abs()).sum::<f64>());
            assert!(row.iter().all(|(j, x)| w[[j, i]] == *x));
        }
        assert!((laplacian.mass.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(laplacian.mass.iter().all(|&a| a > 0.0));
        // Dirichlet energy of the coordinates is the area per dimension: Σ = 2·area.
        let energy: f64 = w
            .iter()
            .map(|(x, (i, j))| {
                let (p, q) = (mesh.vertices[i], mesh.vertices[j]);
                x * (p[0] * q[0] + p[1] * q[1] + p[2] * q[2])
            })
            .sum();
        assert!((energy - 2.0).abs() < 1e-11);
        let (_, all) = basis(&mesh, 30);
        assert!(all.values[1] > 0.0);
    }
}

/// λ = ℓ(ℓ+1), 2ℓ+1 times, on the unit sphere; 4π times that at unit area.
#[test]
fn sphere_spectrum_converges_at_second_order() {
    let mut errors = Vec::new();
    for subdivisions in 3..=5 {
        let (laplacian, basis) = basis(&icosphere(subdivisions), 26);
        assert_sound(&laplacian, &basis);
        let mut index = 0;
        for l in 0..5u32 {
            for _ in 0..=2 * l {
                let exact = 4.0 * PI * f64::from(l * (l + 1));
                assert!(
                    (basis.values[index] - exact).abs() <= 0.05 * exact,
                    "{index}"
                );
                index += 1;
            }
        }
        let exact = 4.0 * PI * 6.0;
        errors.push((4..9).map(|i| (basis.values[i] - exact).abs()).sum::<f64>());
    }
    for pair in errors.windows(2) {
        assert!((3.8..4.2).contains(&(pair[0] / pair[1])), "{errors:?}");
    }
}

/// Multiplicities up to 23 against blocks of fewer vectors: none of the copies may be missed.
#[test]
fn no_copy_of_a_multiple_eigenvalue_is_missed() {
    let (laplacian, basis) = basis(&icosphere(4), 145);
    assert_sound(&laplacian, &basis);
    for l in 0..12u32 {
        let exact = 4.0 * PI * f64::from(l * (l + 1));
        let copies = &basis.values[(l * l) as usize..((l + 1) * (l + 1)) as usize];
        assert!(
            copies.iter().all(|v| (v - exact).abs() <= 0.06 * exact),
            "{l} {copies:?}"
        );
    }
}

/// Icosahedral symmetry makes up to five copies exactly, against blocks of four vectors: wherever the spectrum is cut
/// off, the dense solver has the same eigenvalues.
#[test]
fn no_copy_is_missed_wherever_the_spectrum_ends() {
    let mesh = icosphere(3);
    let (laplacian, all) = basis(&mesh, 500);
    assert_eq!(all.solves, 0);
    // From 140 pairs on they come from two slices, whose border moves with their number.
    for k in (30..110).chain(141..178) {
        let sparse = Eigenbasis::new(&laplacian, k, &|| false).unwrap();
        assert!(sparse.solves > 0);
        for (a, b) in sparse.values.iter().zip(&all.values) {
            // The residual bounds the error.
            assert!(
                (a - b).abs() <= EIGENBASIS.residual_bound * sparse.values[k - 1],
                "{k} {a} {b}"
            );
        }
    }
}

#[test]
fn small_meshes_are_solved_densely_with_every_pair() {
    let mesh = sheet(7, |v| v);
    let (laplacian, all) = basis(&mesh, 49);
    assert_sound(&laplacian, &all);
    assert_eq!(all.solves, 0);
    let trace: f64 = (0..49)
        .map(|i| laplacian.stiffness[[i, i]] / laplacian.mass[i])
        .sum();
    assert!((all.values.iter().sum::<f64>() - trace).abs() < 1e-9 * trace);
    let Err(Error::BadArgument { .. }) = Eigenbasis::new(&laplacian, 50, &|| false) else {
        panic!("more pairs than vertices");
    };
}

#[test]
fn sparse_and_dense_solvers_agree() {
    let mesh = sheet(20, |v| v);
    let (laplacian, sparse) = basis(&mesh, 40);
    assert!(sparse.solves > 0);
    let dense = Eigenbasis::new(&laplacian, 400, &|| false).unwrap();
    assert_eq!(dense.solves, 0);
    for (a, b) in sparse.values.iter().zip(&dense.values) {
        assert!((a - b).abs() < 1e-9 * sparse.values[39]);
    }
}

/// A vertex of almost no area is rounded coarsely where the iteration divides by its root; two beside each other are
/// coupled so strongly that neither settles alone. Neither changes the surface.
#[test]
fn tiny_triangles_leave_the_spectrum() {
    let (vertices, faces) = crate::common::icosphere(4);
    let whole = Mesh::new(&vertices, &faces).unwrap();
    let (mut vertices, mut faces) = (whole.vertices.clone(), faces);
    for face in (0..faces.len()).step_by(200) {
        for share in [1e-4, 1e-5] {
            let [a, b, c] = faces[face];
            let [p, q, r] = [a, b, c].map(|v| vertices[v as usize]);
            vertices.push(std::array::from_fn(|i| {
                p[i] + share * ((q[i] - p[i]) + (r[i] - p[i]))
            }));
            let new = vertices.len() as i64 - 1;
            faces[face] = [a, b, new];
            faces.extend([[b, c, new], [c, a, new]]);
        }
    }
    let cut = Mesh::new(&vertices, &faces).unwrap();
    let (laplacian, found) = basis(&cut, 150);
    assert!(found.solves > 0);
    assert_sound(&laplacian, &found);
    let (_, expected) = basis(&whole, 150);
    for (a, b) in found.values.iter().zip(&expected.values) {
        // Voronoi areas change around the new vertices, by the share of their faces.
        assert!((a - b).abs() <= 0.02 * b, "{a} {b}");
    }
}

#[test]
fn renumbering_leaves_the_spectrum() {
    let side = 31;
    let (laplacian, plain) = basis(&sheet(side, |v| v), 60);
    assert_sound(&laplacian, &plain);
    // 961 = 31² and 100 have no common factor.
    let (_, shuffled) = basis(&sheet(side, |v| (v * 100 + 7) % (side * side)), 60);
    for (a, b) in plain.values.iter().zip(&shuffled.values) {
        assert!((a - b).abs() < 1e-10 * plain.values[59]);
    }
}

/// In one slice and in two.
#[test]
fn repeats_bit_for_bit() {
    let mesh = icosphere(4);
    for k in [30, 200] {
        let (_, first) = basis(&mesh, k);
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let (_, second) = one.unwrap().install(|| basis(&mesh, k));
        assert_eq!(first.values, second.values);
        assert_eq!(first.functions, second.functions);
    }
}

#[test]
fn stops_when_asked_to() {
    let laplacian = Laplacian::new(&icosphere(4)).unwrap();
    let asked = AtomicUsize::new(0);
    let stop = || asked.fetch_add(1, Ordering::Relaxed) == 3;
    let result = Eigenbasis::new(&laplacian, 60, &stop);
    assert_eq!(result.err(), Some(Error::Cancelled));
    assert_eq!(asked.into_inner(), 4);
}
