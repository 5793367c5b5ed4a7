//! Any bytes are a mesh or a stored shape: the core ends, with a sound result or an error.

#[path = "../fuzz/inputs.rs"]
mod inputs;

use std::path::Path;

use proptest::prelude::*;
use sgmds_core::error::Error;
use sgmds_core::matching::ranking::quality::left_out;
use sgmds_core::mesh::Mesh;
use sgmds_core::spectrum::laplacian::Laplacian;

/// Inputs that the fuzzer found to reach code of their own.
fn corpus(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/fuzz/corpus")
        .join(target);
    let mut files: Vec<_> = std::fs::read_dir(&folder)
        .unwrap_or_else(|e| panic!("{}: {e}", folder.display()))
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    assert!(!files.is_empty(), "{} is empty", folder.display());
    files.iter().map(|f| std::fs::read(f).unwrap()).collect()
}

#[test]
fn corpus_of_the_intake_holds() {
    for data in corpus("intake") {
        inputs::intake(&data);
    }
}

#[test]
fn corpus_of_stored_shapes_holds() {
    for data in corpus("restore") {
        inputs::restore(&data);
    }
}

#[test]
fn corpus_of_whole_matches_holds() {
    for data in corpus("match") {
        inputs::whole_chain(&data);
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        // PROPTEST_CASES asks for more; failures are printed with their bytes, which belong in the corpus.
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn any_bytes_as_a_mesh(data in prop::collection::vec(any::<u8>(), 0..400)) {
        inputs::intake(&data);
    }

    #[test]
    fn any_bytes_as_a_stored_shape(data in prop::collection::vec(any::<u8>(), 0..200)) {
        inputs::restore(&data);
    }
}

fn mesh_of(vertices: &[[f64; 3]], faces: &[[i64; 3]]) -> Mesh {
    Mesh::new(vertices, faces).unwrap()
}

#[test]
fn operator_of_every_kind_of_damage_is_sound() {
    let (vertices, faces) = crate::common::lumpy(3);
    let n = vertices.len() as i64;
    let fin = |mut v: Vec<[f64; 3]>, mut f: Vec<[i64; 3]>| {
        v.push([3.0, 3.0, 3.0]);
        f.extend([
            [0, f[0][1], n],
            [f[0][0], f[0][1], n],
            [f[0][2], f[0][1], n],
        ]);
        (v, f)
    };
    let needles = |mut v: Vec<[f64; 3]>, f: Vec<[i64; 3]>| {
        for face in f.iter().step_by(9) {
            let to = v[face[1] as usize];
            v[face[0] as usize] = to.map(|x| x * (1.0 + 1e-13));
        }
        (v, f)
    };
    let flipped = |v, mut f: Vec<[i64; 3]>| {
        f.iter_mut().step_by(3).for_each(|face| face.swap(0, 2));
        (v, f)
    };
    let bow_tie = |mut v: Vec<[f64; 3]>, mut f: Vec<[i64; 3]>| {
        v.extend([[3.0, 3.0, 3.0], [3.0, 3.5, 3.0]]);
        f.push([0, n, n + 1]);
        (v, f)
    };
    for ((v, f), regular) in [
        ((vertices.clone(), faces.clone()), true),
        // Cut so raggedly that some vertices keep two fans.
        ((vertices.clone(), faces[faces.len() / 3..].to_vec()), false),
        (flipped(vertices.clone(), faces.clone()), true),
        (fin(vertices.clone(), faces.clone()), false),
        (bow_tie(vertices.clone(), faces.clone()), false),
        (needles(vertices.clone(), faces.clone()), false),
    ] {
        let mesh = mesh_of(&v, &f);
        assert_eq!(mesh.is_regular(), regular);
        inputs::sound_mesh(&mesh, &v, &f);
        inputs::sound_operator(&Laplacian::new(&mesh).unwrap(), regular);
    }
}

/// A Möbius strip has no two sides. Functions that do not vary across it do not see the twist, and
/// the lowest that do vary lie above λ = π² for a width of one.
#[test]
fn moebius_strip_has_the_spectrum_of_its_band() {
    let (around, across) = (240i64, 24i64);
    // Lengths of a flat band, embedded with as little stretch as a radius of 40 widths costs.
    let radius = 40.0 / std::f64::consts::TAU;
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    for i in 0..around {
        let turn = std::f64::consts::TAU * i as f64 / around as f64;
        for j in 0..=across {
            let width = j as f64 / across as f64 - 0.5;
            let tilt = width * (turn / 2.0).cos();
            let ring = radius + tilt;
            vertices.push([
                ring * turn.cos(),
                ring * turn.sin(),
                width * (turn / 2.0).sin(),
            ]);
        }
    }
    let id = |i: i64, j: i64| {
        if i == around {
            across - j
        } else {
            i * (across + 1) + j
        }
    };
    for i in 0..around {
        for j in 0..across {
            faces.push([id(i, j), id(i + 1, j), id(i + 1, j + 1)]);
            faces.push([id(i, j), id(i + 1, j + 1), id(i, j + 1)]);
        }
    }
    let mesh = mesh_of(&vertices, &faces);
    let laplacian = Laplacian::new(&mesh).unwrap();
    inputs::sound_operator(&laplacian, mesh.is_regular());
    let basis =
        sgmds_core::spectrum::eigenbasis::Eigenbasis::new(&laplacian, 12, &|| false).unwrap();
    // Waves along a band of length 40: (2πm/40)², twice each; area 40, so times 40.
    for (i, value) in basis.values.iter().enumerate() {
        let m = i.div_ceil(2) as f64;
        let exact = 40.0 * (std::f64::consts::TAU * m / 40.0).powi(2);
        // The embedding stretches the band's borders by up to (1/2)/radius = 8 %, both ways.
        assert!(
            (value - exact).abs() <= 0.01 * exact + 1e-9,
            "{i}: {value} {exact}"
        );
    }
}

#[test]
fn vertices_on_straight_edges_do_not_slit_the_surface() {
    let (vertices, faces) = crate::common::lumpy(3);
    let whole = mesh_of(&vertices, &faces);
    let (mut v, mut f) = (vertices.clone(), faces.clone());
    for i in (0..faces.len()).step_by(4) {
        let [a, b, c] = faces[i];
        let (p, q) = (v[a as usize], v[b as usize]);
        let m = v.len() as i64;
        v.push([0, 1, 2].map(|k| f64::midpoint(p[k], q[k])));
        f[i] = [a, m, c];
        f.extend([[m, b, c], [a, b, m]]);
    }
    let mended = mesh_of(&v, &f);
    assert!(!mended.is_regular());
    assert_eq!(mended.report.bridging_faces, faces.len().div_ceil(4));
    assert_eq!(mended.report.boundary_edges, 0);
    let spectrum = |mesh: &Mesh| {
        let laplacian = Laplacian::new(mesh).unwrap();
        sgmds_core::spectrum::eigenbasis::Eigenbasis::new(&laplacian, 20, &|| false)
            .unwrap()
            .values
    };
    for (a, b) in spectrum(&whole).iter().zip(&spectrum(&mended)) {
        // More vertices on the same surface: only the discretisation changes.
        assert!((a - b).abs() <= 0.03 * a + 1e-9, "{a} {b}");
    }
}

#[test]
fn a_million_loose_triangles_are_counted_and_dropped() {
    let (mut vertices, mut faces) = crate::common::lumpy(3);
    let n = vertices.len();
    for i in 0..1_000_000 {
        let p = [f64::from(i) * 1e-6, f64::from(i % 1000) * 1e-3, 5.0];
        let first = vertices.len() as i64;
        vertices.extend([p, [p[0], p[1] + 1e-4, 5.0], [p[0] + 1e-4, p[1], 5.0]]);
        faces.push([first, first + 1, first + 2]);
    }
    let mesh = mesh_of(&vertices, &faces);
    assert_eq!(mesh.vertices.len(), n);
    assert_eq!(mesh.report.dropped_components, 1_000_000);
    assert_eq!(mesh.report.dropped_component_vertices, 3_000_000);
}

#[test]
fn a_ground_plane_larger_than_the_body_is_dropped() {
    let (mut vertices, mut faces) = crate::common::lumpy(3);
    let alone = mesh_of(&vertices, &faces);
    let (n, m) = (vertices.len(), faces.len());
    let plane = [[-50.0, -50.0], [50.0, -50.0], [50.0, 50.0], [-50.0, 50.0]];
    vertices.splice(0..0, plane.map(|[x, y]| [x, y, -3.0]));
    for v in faces.iter_mut().flatten() {
        *v += 4;
    }
    faces.splice(0..0, [[0, 1, 2], [0, 2, 3]]);
    let mesh = mesh_of(&vertices, &faces);
    assert_eq!(mesh.report.dropped_components, 1);
    assert_eq!(mesh.report.dropped_component_vertices, 4);
    let words = left_out("target", &mesh.report).unwrap();
    assert!(words.contains("one") && words.contains("4 vertices"));
    assert!(mesh.input_vertex.iter().map(|v| v.0).eq(4..4 + n as u32));
    assert!(mesh.input_face.iter().copied().eq(2..2 + m as u32));
    for (p, q) in mesh.vertices.iter().zip(&alone.vertices) {
        assert!(p.iter().zip(q).all(|(a, b)| (a - b).abs() < 1e-12));
    }
    // Of parts that are large enough the one with more area stays.
    let (large, triangles) = crate::common::icosphere(1);
    let first = vertices.len() as i64;
    vertices.extend(large.iter().map(|p| p.map(|x| 20.0 * x)));
    faces.extend(triangles.iter().map(|f| f.map(|v| v + first)));
    let mesh = mesh_of(&vertices, &faces);
    assert_eq!(mesh.vertices.len(), large.len());
    assert_eq!(mesh.report.dropped_components, 2);
    assert_eq!(mesh.report.dropped_component_vertices, 4 + n);
}

#[test]
fn messages_say_where_and_what_to_do() {
    let (mut vertices, mut faces) = crate::common::icosphere(2);
    faces.push([0, 1, 900]);
    let refused = |v: &[[f64; 3]], f: &[[i64; 3]]| Mesh::new(v, f).unwrap_err();
    let error = refused(&vertices, &faces);
    assert_eq!(
        error,
        Error::FaceIndexOutOfRange {
            face: 320,
            index: 900,
            vertices: 162
        }
    );
    assert!(error.to_string().contains("repair"));
    faces.pop();
    vertices[9][2] = f64::NAN;
    assert_eq!(refused(&vertices, &faces), Error::NotFinite { vertex: 9 });
    assert!(matches!(refused(&[], &[]), Error::EmptyMesh { .. }));
}
