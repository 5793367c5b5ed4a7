//! How much memory a computation will take, from sizes alone.
//!
//! Counted from what the stages hold at their peaks; `docs/reliability.md` compares with measured
//! peaks, which stay below.

use crate::shape::settings::SHAPE;

/// Bytes of a double.
const DOUBLE: u64 = 8;
/// Basis vectors of the eigensolver for each eigenpair wanted, with those of the result.
const KRYLOV_VECTORS: u64 = 3;
/// Entries of the factor for each vertex and each doubling of their number: nested separators of a
/// surface give about ten.
const FACTOR_ENTRIES: u64 = 12;
/// Everything that each vertex and face has of its own: positions, ids, neighbours, place on the
/// working mesh.
const MESH_BYTES: u64 = 600;
/// Descriptors, and doubles while they are made.
const DESCRIPTOR_DOUBLES: u64 = 250;
/// Doubles of a vertex for each eigenpair while a map is refined: embeddings of two ways and, of a part, weighted rows of both bases, in
/// single precision.
const REFINEMENT_DOUBLES: u64 = 4;
/// Completed at the same time: close hypotheses.
const REFINED_TOGETHER: u64 = 2;
/// Points, weights and confidence of a vertex of the given mesh, while they are found.
const POINT_BYTES: u64 = 400;
/// Tables over samples, and the program itself.
const FIXED: u64 = 120_000_000;

/// Vertices of the mesh on which a mesh of `vertices` is matched.
fn working(vertices: u64) -> u64 {
    if vertices > SHAPE.simplified_above as u64 {
        SHAPE.simplified as u64
    } else if vertices < SHAPE.refined_below as u64 {
        (SHAPE.refined as u64).min(SHAPE.refined_times as u64 * vertices)
    } else {
        vertices
    }
}

/// Eigenpairs, distances and descriptors.
fn spectral(vertices: u64) -> u64 {
    let doublings = u64::from(vertices.max(2).ilog2()) + 1;
    let eigenpairs = SHAPE.eigenpairs as u64;
    let eigensolver = KRYLOV_VECTORS * eigenpairs + FACTOR_ENTRIES * doublings;
    let fields = 2 * SHAPE.marched as u64;
    let doubles = eigensolver.max(eigenpairs + fields + DESCRIPTOR_DOUBLES);
    vertices.saturating_mul(DOUBLE * doubles)
}

fn surface(vertices: u64, faces: u64) -> u64 {
    vertices.saturating_add(faces).saturating_mul(MESH_BYTES)
}

/// Peak while meshes of these vertices and faces are prepared together; the input is not counted.
#[must_use]
pub fn to_prepare(sizes: &[(u64, u64)]) -> u64 {
    sizes.iter().fold(FIXED, |sum, &(vertices, faces)| {
        sum.saturating_add(spectral(working(vertices)))
            .saturating_add(surface(vertices, faces))
    })
}

/// Peak beyond what two prepared shapes hold while they are matched.
#[must_use]
pub fn to_match(source: u64, target: u64) -> u64 {
    let refined = working(source) + working(target);
    let doubles = REFINEMENT_DOUBLES * SHAPE.eigenpairs as u64;
    source
        .saturating_add(target)
        .saturating_mul(POINT_BYTES)
        .saturating_add(refined * REFINED_TOGETHER * DOUBLE * doubles)
        .saturating_add(FIXED)
}

/// Peak beyond what a simplified shape holds while the spectrum of its given mesh is computed.
#[must_use]
pub fn for_spectrum(vertices: u64, faces: u64) -> u64 {
    spectral(vertices)
        .saturating_add(surface(vertices, faces))
        .saturating_add(FIXED)
}
