//! Laplace–Beltrami operator of a mesh: cotangent stiffness `W` and lumped mass `A`.
//!
//! `W` is positive *semi-definite* throughout this crate: `fᵀWf = ∫|∇f|² ≥ 0`, off-diagonal
//! entries are `−½(cot α + cot β)`. (libigl's `cotmatrix` has the other sign.) Eigenfunctions solve
//! `W φ = λ A φ` with `λ ≥ 0`.

use sprs::CsMat;

use crate::algebra::vector;
use crate::error::Result;
use crate::mesh::Mesh;
use crate::spectrum::intrinsic_triangulation::{IntrinsicTriangulation, double_area};

/// Smallest mass of a vertex as a fraction of the total: keeps `A⁻¹` finite at vertices that only
/// touch slivers.
const LEAST_RELATIVE_MASS: f64 = 1e-12;

/// Discrete Laplace–Beltrami operator `A⁻¹W`.
#[derive(Debug, Clone)]
pub struct Laplacian {
    /// Stiffness `W`, `(n, n)`, symmetric, positive semi-definite, rows sum to zero. No unit:
    /// independent of scale.
    pub stiffness: CsMat<f64>,
    /// Diagonal of the lumped mass `A`, `(n)`, positive. Unit: area; sums to the mesh's area.
    pub mass: Vec<f64>,
}

impl Laplacian {
    /// Operator of a mesh: on its triangles where [`Mesh::is_regular`], otherwise on the intrinsic
    /// Delaunay triangulation of its cover, where off-diagonal entries are never positive.
    ///
    /// # Errors
    /// None at present: every checked mesh has an operator.
    ///
    /// # Source
    /// Meyer, Desbrun, Schröder, Barr, "Discrete differential-geometry operators for triangulated
    /// 2-manifolds", 2003, equations 8 (weights) and figure 4 (mixed areas).
    pub fn new(mesh: &Mesh) -> Result<Self> {
        if mesh.is_regular() {
            Ok(Self::on_triangles(mesh))
        } else {
            Ok(Self::on_cover(mesh))
        }
    }

    /// Cotangent weights of the triangles as they are.
    fn on_triangles(mesh: &Mesh) -> Self {
        let corners: Vec<Corner> = mesh
            .faces
            .iter()
            .flat_map(|face| {
                let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
                let squares = [(b, c), (c, a), (a, b)].map(|(p, q)| {
                    let d = vector::sub(p, q);
                    vector::dot(d, d)
                });
                let double_area = vector::norm(vector::cross(vector::sub(b, a), vector::sub(c, a)));
                face_corners(*face, squares, double_area)
            })
            .collect();
        Self::assemble(mesh.vertices.len(), &corners, f64::NEG_INFINITY)
    }

    /// Cotangent weights of the intrinsic Delaunay triangulation; each sheet counts its share.
    fn on_cover(mesh: &Mesh) -> Self {
        let triangulation = IntrinsicTriangulation::delaunay(mesh);
        let share = 1.0 / triangulation.sheets as f64;
        let corners: Vec<Corner> = triangulation
            .faces
            .iter()
            .zip(&triangulation.lengths)
            .flat_map(|(&face, &[ab, bc, ca])| {
                face_corners(face, [bc, ca, ab].map(|l| l * l), double_area([ab, bc, ca]))
            })
            .map(|corner| Corner {
                half_cotangent: share * corner.half_cotangent,
                area: share * corner.area,
                ..corner
            })
            .collect();
        // An edge is not Delaunay where flipping it would make a triangle that vanishes in rounding.
        let mut made = Self::assemble(mesh.vertices.len(), &corners, 0.0);
        // Mollified sides are longer, at needles by far; the area stays that of the mesh.
        let given: f64 = (0..mesh.faces.len()).map(|f| mesh.face_area(f)).sum();
        let found: f64 = made.mass.iter().sum();
        for area in &mut made.mass {
            *area *= given / found;
        }
        made
    }

    /// Operator of corners, no edge weighing less than `least`.
    fn assemble(n: usize, corners: &[Corner], least: f64) -> Self {
        let mut mass = vec![0.0; n];
        for corner in corners {
            mass[corner.vertex as usize] += corner.area;
        }
        let floor = LEAST_RELATIVE_MASS * mass.iter().sum::<f64>();
        for area in &mut mass {
            *area = area.max(floor);
        }
        Self {
            stiffness: stiffness(n, corners, least),
            mass,
        }
    }

    /// The operator in a metric whose areas are `factors` times as large, `(n)`.
    ///
    /// A conformal change of metric leaves ∫|∇f|² and so `W` as it is.
    #[must_use]
    pub fn with_areas_times(mut self, factors: impl Iterator<Item = f64>) -> Self {
        for (area, factor) in self.mass.iter_mut().zip(factors) {
            *area *= factor;
        }
        self
    }

    /// Number of vertices.
    #[must_use]
    pub fn len(&self) -> usize {
        self.mass.len()
    }

    /// Whether there is no vertex.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.mass.is_empty()
    }
}

/// What one corner of a triangle adds: its cotangent to the edge opposite, an area to its vertex.
#[derive(Debug, Clone, Copy)]
struct Corner {
    vertex: u32,
    opposite: [u32; 2],
    half_cotangent: f64,
    area: f64,
}

/// Corners of a triangle from its squared edge lengths; `squares[i]` is opposite corner `i`.
fn face_corners(face: [u32; 3], squares: [f64; 3], double_area: f64) -> [Corner; 3] {
    let half_cotangents = [0, 1, 2].map(|i| {
        let (before, after) = (squares[(i + 1) % 3], squares[(i + 2) % 3]);
        (before + after - squares[i]) / (4.0 * double_area)
    });
    let obtuse = half_cotangents.iter().position(|&c| c < 0.0);
    [0, 1, 2].map(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let area = match obtuse {
            // Voronoi region: its two edges, each with the cotangent opposite.
            None => (squares[j] * half_cotangents[j] + squares[k] * half_cotangents[k]) / 4.0,
            Some(o) if o == i => double_area / 4.0,
            Some(_) => double_area / 8.0,
        };
        Corner {
            vertex: face[i],
            opposite: [face[j], face[k]],
            half_cotangent: half_cotangents[i],
            area,
        }
    })
}

/// Sums the corners into `W`. Both halves of an edge are summed in face order, so that `W` is
/// symmetric to the last bit.
fn stiffness(n: usize, corners: &[Corner], least: f64) -> CsMat<f64> {
    // A side from a vertex to itself carries nothing.
    let corners = || corners.iter().filter(|c| c.opposite[0] != c.opposite[1]);
    let mut starts = vec![0usize; n + 1];
    for v in corners().flat_map(|c| c.opposite) {
        starts[v as usize + 1] += 1;
    }
    for i in 0..n {
        starts[i + 1] += starts[i];
    }
    let mut fill = starts.clone();
    let mut halves = vec![(0u32, 0.0f64); starts[n]];
    for corner in corners() {
        let [a, b] = corner.opposite;
        for (from, to) in [(a, b), (b, a)] {
            halves[fill[from as usize]] = (to, corner.half_cotangent);
            fill[from as usize] += 1;
        }
    }

    let mut pointers = Vec::with_capacity(n + 1);
    let mut indices = Vec::with_capacity(halves.len() / 2 + n);
    let mut weights = Vec::with_capacity(halves.len() / 2 + n);
    pointers.push(0);
    for i in 0..n {
        let row = &mut halves[starts[i]..starts[i + 1]];
        row.sort_by_key(|&(j, _)| j);
        let begin = indices.len();
        let mut diagonal = None;
        let mut sum = 0.0;
        for run in row.chunk_by(|a, b| a.0 == b.0) {
            let j = run[0].0 as usize;
            if j > i && diagonal.is_none() {
                diagonal = Some(indices.len());
                indices.push(i);
                weights.push(0.0);
            }
            let weight = run.iter().map(|&(_, w)| w).sum::<f64>().max(least);
            indices.push(j);
            weights.push(-weight);
            sum += weight;
        }
        let at = diagonal.unwrap_or_else(|| {
            indices.push(i);
            weights.push(0.0);
            indices.len() - 1
        });
        debug_assert!(at >= begin);
        weights[at] = sum;
        pointers.push(indices.len());
    }
    CsMat::new((n, n), pointers, indices, weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equilateral_triangle_weighs_one_over_twice_root_three() {
        let double_area = 3.0f64.sqrt() / 2.0;
        let corners = face_corners([0, 1, 2], [1.0; 3], double_area);
        let laplacian = Laplacian::assemble(3, &corners, f64::NEG_INFINITY);
        let weight = 1.0 / (2.0 * 3.0f64.sqrt());
        for i in 0..3 {
            assert!((laplacian.mass[i] - double_area / 6.0).abs() < 1e-15);
            for j in 0..3 {
                let expected = if i == j { 2.0 * weight } else { -weight };
                assert!((laplacian.stiffness[[i, j]] - expected).abs() < 1e-15);
            }
        }
    }

    /// A flat grid of right triangles is Delaunay: nothing is flipped, and both sheets of the cover
    /// carry the same weights.
    #[test]
    fn cover_of_a_delaunay_mesh_has_its_cotangent_weights() {
        let side = 8i64;
        let vertices: Vec<_> = (0..side * side)
            .map(|v| [(v % side) as f64, (v / side) as f64, 0.0])
            .collect();
        let faces: Vec<_> = (0..side * (side - 1))
            .filter(|v| v % side < side - 1)
            .flat_map(|v| [[v, v + 1, v + side], [v + 1, v + side + 1, v + side]])
            .collect();
        let mesh = Mesh::new(&vertices, &faces).unwrap();
        assert!(mesh.is_regular());
        let (plain, cover) = (Laplacian::on_triangles(&mesh), Laplacian::on_cover(&mesh));
        for (i, row) in plain.stiffness.outer_iterator().enumerate() {
            assert!((plain.mass[i] - cover.mass[i]).abs() < 1e-15);
            for (j, &weight) in row.iter() {
                // Angles from lengths instead of positions: rounding.
                assert!((cover.stiffness[[i, j]] - weight).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn obtuse_triangle_gives_half_its_area_to_the_obtuse_corner() {
        // Corners (0,0), (4,0), (2,1): obtuse at the last.
        let corners = face_corners([0, 1, 2], [5.0, 5.0, 16.0], 4.0);
        let laplacian = Laplacian::assemble(3, &corners, f64::NEG_INFINITY);
        assert_eq!(laplacian.mass, [0.5, 0.5, 1.0]);
        assert!((laplacian.stiffness[[0, 1]] - 0.375).abs() < 1e-15);
    }
}
