//! Which lengths a surface has: those in space, or those that no local scaling changes.

use crate::algebra::vector;
use crate::error::Result;
use crate::geodesics::FastMarching;
use crate::geodesics::settings::METRIC;
use crate::mesh::Mesh;
use crate::spectrum::laplacian::Laplacian;

/// How lengths on a surface are measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Metric {
    /// Lengths in space.
    #[default]
    Euclidean,
    /// Lengths in space times √|K|, K the Gaussian curvature.
    ScaleInvariant,
}

impl Metric {
    /// Name by which it is asked for and stored.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Euclidean => "euclidean",
            Self::ScaleInvariant => "scale-invariant",
        }
    }
}

/// Operator and distances of a mesh in a metric, at unit area there.
#[derive(Debug)]
pub struct Measured {
    /// How lengths are measured.
    pub metric: Metric,
    /// Length of one unit here: in given units, or without unit in the scale-invariant metric.
    pub unit: f64,
    /// Operator; its masses sum to 1.
    pub laplacian: Laplacian,
    /// Marching.
    pub marching: FastMarching,
    /// Lengths around each vertex relative to those of the mesh's positions, `(n)`.
    pub length_factors: Vec<f64>,
}

impl Measured {
    /// Measures a checked mesh.
    ///
    /// The scale-invariant metric is |K| g, with K smoothed and |K| kept above zero. Each face has
    /// one length factor for all directions, so that its angles stay, and with them the cotangent
    /// weights: a conformal change of metric leaves W as it is and multiplies areas by the squares.
    ///
    /// # Errors
    /// Those of [`Laplacian::new`].
    ///
    /// # Source
    /// Aflalo, Kimmel, Raviv, "Scale invariant geometry for nonrigid shapes", SIAM J. Imaging
    /// Sciences 6 (2013).
    pub fn new(mesh: &Mesh, metric: Metric) -> Result<Self> {
        let laplacian = Laplacian::new(mesh)?;
        if metric == Metric::Euclidean {
            return Ok(Self {
                metric,
                unit: mesh.scale,
                marching: FastMarching::new(mesh),
                length_factors: vec![1.0; mesh.vertices.len()],
                laplacian,
            });
        }
        let (faces, areas) = scale_invariant(mesh, &laplacian);
        let laplacian = laplacian.with_areas_times(areas.iter().copied());
        // Not the sum of the faces' areas, since those of obtuse faces are shared out unevenly.
        let area: f64 = laplacian.mass.iter().sum();
        let unit = area.sqrt();
        let faces: Vec<f64> = faces.iter().map(|length| length / unit).collect();
        Ok(Self {
            metric,
            unit,
            marching: FastMarching::stretched(mesh, &faces),
            length_factors: areas.iter().map(|a| a.sqrt() / unit).collect(),
            laplacian: laplacian.with_areas_times(std::iter::repeat(1.0 / area)),
        })
    }
}

/// Length factor √|K| of each face and area factor |K| of each vertex.
fn scale_invariant(mesh: &Mesh, laplacian: &Laplacian) -> (Vec<f64>, Vec<f64>) {
    let at_vertices: Vec<f64> = smoothed_curvature(mesh, laplacian)
        .iter()
        .map(|k| k.hypot(METRIC.curvature_floor))
        .collect();
    let mut areas = vec![(0.0, 0.0); mesh.vertices.len()];
    let lengths = mesh
        .faces
        .iter()
        .enumerate()
        .map(|(f, corners)| {
            let factor = corners
                .iter()
                .map(|&v| at_vertices[v as usize])
                .sum::<f64>()
                / 3.0;
            for &v in corners {
                let (sum, total) = &mut areas[v as usize];
                *sum += mesh.face_area(f) * factor;
                *total += mesh.face_area(f);
            }
            factor.sqrt()
        })
        .collect();
    // A vertex of flat faces only has no area to average over.
    let areas = areas
        .iter()
        .zip(&at_vertices)
        .map(|((sum, total), own)| if *total > 0.0 { sum / total } else { *own })
        .collect();
    (lengths, areas)
}

/// Gaussian curvature at every vertex, diffused for a short time: (A + tW) K = A K₀.
fn smoothed_curvature(mesh: &Mesh, laplacian: &Laplacian) -> Vec<f64> {
    // Below a vertex's share of the area there is nothing but the mesh.
    let time = METRIC.curvature_heat_time.max(1.0 / laplacian.len() as f64);
    let apply = |x: &[f64]| -> Vec<f64> {
        laplacian
            .stiffness
            .outer_iterator()
            .enumerate()
            .map(|(i, row)| {
                let flow: f64 = row.iter().map(|(j, &w)| w * x[j]).sum();
                laplacian.mass[i] * x[i] + time * flow
            })
            .collect()
    };
    let diagonal: Vec<f64> = (0..laplacian.len())
        .map(|i| laplacian.mass[i] + time * laplacian.stiffness[[i, i]])
        .collect();
    conjugate_gradients(apply, &diagonal, angle_defects(mesh))
}

/// Solves Mx = b for a symmetric positive definite M with the given diagonal.
///
/// # Source
/// Hestenes, Stiefel, "Methods of conjugate gradients for solving linear systems", 1952.
fn conjugate_gradients(
    apply: impl Fn(&[f64]) -> Vec<f64>,
    diagonal: &[f64],
    mut residual: Vec<f64>,
) -> Vec<f64> {
    /// The diffusion reaches over few edges, so that some dozens do.
    const STEPS: usize = 1000;
    /// Of the squared residual; the curvature itself is known to some percent.
    const ACCURACY: f64 = 1e-16;
    let inner = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(x, y)| x * y).sum() };
    let condition =
        |r: &[f64]| -> Vec<f64> { r.iter().zip(diagonal).map(|(x, d)| x / d).collect() };
    let mut x = vec![0.0; residual.len()];
    let mut direction = condition(&residual);
    let mut power = inner(&residual, &direction);
    let enough = ACCURACY * power;
    for _ in 0..STEPS {
        if power <= enough {
            break;
        }
        let image = apply(&direction);
        let step = power / inner(&direction, &image);
        for i in 0..x.len() {
            x[i] += step * direction[i];
            residual[i] -= step * image[i];
        }
        let conditioned = condition(&residual);
        let next = inner(&residual, &conditioned);
        for (d, c) in direction.iter_mut().zip(&conditioned) {
            *d = c + next / power * *d;
        }
        power = next;
    }
    x
}

/// Integrated Gaussian curvature of each vertex: what its angles lack to a full turn; zero on the
/// boundary.
fn angle_defects(mesh: &Mesh) -> Vec<f64> {
    let mut defects = vec![std::f64::consts::TAU; mesh.vertices.len()];
    let mut edges: Vec<(u32, u32)> = Vec::with_capacity(3 * mesh.faces.len());
    for f in &mesh.faces {
        for i in 0..3 {
            let [a, b, c] = [f[i], f[(i + 1) % 3], f[(i + 2) % 3]];
            let at = |v: u32| vector::sub(mesh.vertices[v as usize], mesh.vertices[a as usize]);
            let (u, v) = (at(b), at(c));
            defects[a as usize] -= vector::norm(vector::cross(u, v)).atan2(vector::dot(u, v));
            edges.push((a.min(b), a.max(b)));
        }
    }
    edges.sort_unstable();
    for run in edges.chunk_by(|a, b| a == b).filter(|run| run.len() != 2) {
        defects[run[0].0 as usize] = 0.0;
        defects[run[0].1 as usize] = 0.0;
    }
    defects
}
