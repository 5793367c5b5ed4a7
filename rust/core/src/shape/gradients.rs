//! Tells the direct map from the mirrored one.
//!
//! An orientation-preserving map carries ∇f × ∇g along; a mirrored one turns its sign. The score
//! is the mean cosine between the bivectors of low eigenfunctions on the target and of their
//! counterparts on the source. Needs consistently wound faces.
//!
//! # Source
//! The idea follows Ren, Poulenard, Wonka, Ovsjanikov, "Continuous and Orientation-preserving
//! Correspondences via Functional Maps", 2018; here with bivectors of eigenfunctions.

use faer::{Mat, MatRef};

use crate::algebra::dense::vectorised;
use crate::algebra::vector::{self, Point};
use crate::shape::Shape;

/// Keeps the cosine of two vanishing bivectors defined.
const COSINE_FLOOR: f64 = 1e-30;

/// Tangent gradients of the first eigenfunctions at some vertices of a shape.
#[derive(Debug)]
pub struct TangentGradients {
    functions: usize,
    /// Coordinates in an arbitrary right-handed tangent frame, one row of functions a vertex; all
    /// share one positive factor within a vertex.
    rows: Vec<[f64; 2]>,
    /// Whether the vertex has a normal.
    defined: Vec<bool>,
    values: Vec<f64>,
    volume_sign: f64,
}

impl TangentGradients {
    /// Gradients of the first so many eigenfunctions at `vertices`.
    #[must_use]
    pub fn new(shape: &Shape, vertices: &[u32], functions: usize) -> Self {
        let functions = functions.min(shape.basis.values.len());
        let mut rows = Vec::with_capacity(vertices.len() * functions);
        let mut defined = Vec::with_capacity(vertices.len());
        let mut sums = [vec![0.0; functions], vec![0.0; functions]];
        for &v in vertices {
            let normal = shape.normals[v as usize];
            defined.push(vector::dot(normal, normal) > 0.0);
            vectorised(
                #[inline(always)]
                || sum_gradients(shape, v, vector::tangent_frame(normal), &mut sums),
            );
            let [first, second] = &sums;
            rows.extend(first.iter().zip(second).map(|(&x, &y)| [x, y]));
        }
        Self {
            functions,
            rows,
            defined,
            values: shape.basis.values[..functions].to_vec(),
            volume_sign: shape.volume_sign,
        }
    }

    fn row(&self, i: usize) -> &[[f64; 2]] {
        &self.rows[i * self.functions..(i + 1) * self.functions]
    }
}

/// Score in [−1, 1]: near 1 for a direct map, negative for a mirrored one.
///
/// `matrix` (kₛ × kₜ) takes target coefficients to source coefficients, `pairs` are numbers of
/// vertices within the gradients of source and target, `functions` eigenfunctions of the target are compared.
#[must_use]
pub fn orientation(
    source: &TangentGradients,
    target: &TangentGradients,
    matrix: MatRef<'_, f64>,
    pairs: impl Iterator<Item = (usize, usize)>,
    functions: usize,
) -> f64 {
    let coverage = coverage(source, target, matrix, pairs, functions);
    let mut sum = 0.0;
    for a in 0..coverage.nrows() {
        for b in 0..a {
            sum += coverage[(a, b)];
        }
    }
    sum
}

/// What each pair of columns of a map contributes to its orientation, symmetric.
///
/// Turning the signs of some columns turns the signs of their coverage and changes nothing else, so
/// that the orientation is the quadratic form ½ sᵀMs of the signs. Row and column 0 are zero.
#[must_use]
pub fn coverage(
    source: &TangentGradients,
    target: &TangentGradients,
    matrix: MatRef<'_, f64>,
    pairs: impl Iterator<Item = (usize, usize)>,
    functions: usize,
) -> Mat<f64> {
    let last = functions.min(matrix.ncols() - 1).min(target.functions - 1);
    let used = matrix.nrows().min(source.functions);
    let root: Vec<f64> = target.values.iter().map(|l| 1.0 / l.sqrt()).collect();
    let by_rows: Vec<f64> = (0..used)
        .flat_map(|r| (0..=last).map(move |a| matrix[(r, a)]))
        .collect();
    let mut carried = [vec![0.0; last + 1], vec![0.0; last + 1]];
    let mut products = vec![0.0; (last + 1) * (last + 1)];
    let mut sums = vec![0.0; (last + 1) * (last + 1)];
    let mut count = 0.0;
    for (image, asking) in pairs {
        if !target.defined[asking] || !source.defined[image] {
            continue;
        }
        let (here, there) = (target.row(asking), source.row(image));
        carry(&by_rows, &there[..used], &mut carried);
        let (mut own, mut other) = (0.0, 0.0);
        for a in 1..=last {
            for b in 1..a {
                let weight = root[a] * root[b];
                let x = weight * (here[a][0] * here[b][1] - here[a][1] * here[b][0]);
                let y = weight * (carried[0][a] * carried[1][b] - carried[1][a] * carried[0][b]);
                products[a * (last + 1) + b] = x * y;
                own += x * x;
                other += y * y;
            }
        }
        let scale = 1.0 / ((own * other).sqrt() + COSINE_FLOOR);
        for (sum, product) in sums.iter_mut().zip(&products) {
            *sum += scale * product;
        }
        count += 1.0;
    }
    let scale = target.volume_sign * source.volume_sign / f64::max(count, 1.0);
    Mat::from_fn(last + 1, last + 1, |a, b| {
        scale * sums[a.max(b) * (last + 1) + a.min(b)]
    })
}

/// Both coordinates of the gradients that a matrix, given by rows, takes some gradients to.
fn carry(matrix: &[f64], gradients: &[[f64; 2]], [first, second]: &mut [Vec<f64>; 2]) {
    first.fill(0.0);
    second.fill(0.0);
    for (row, [x, y]) in matrix.chunks_exact(first.len()).zip(gradients) {
        for ((c, u), v) in row.iter().zip(&mut *first).zip(&mut *second) {
            *u += c * x;
            *v += c * y;
        }
    }
}

/// Signs of the columns, found one by one, that raise the orientation until no single one does.
#[must_use]
pub fn better_signs(coverage: MatRef<'_, f64>) -> Vec<f64> {
    let size = coverage.nrows();
    let mut signs = vec![1.0; size];
    loop {
        let gain = |a: usize| -> f64 {
            -(0..size)
                .map(|b| signs[a] * signs[b] * coverage[(a, b)])
                .sum::<f64>()
        };
        let best = (1..size)
            .map(|a| (gain(a), a))
            .max_by(|x, y| x.0.total_cmp(&y.0));
        match best {
            Some((gain, a)) if gain > 1e-9 => signs[a] = -signs[a],
            _ => return signs,
        }
    }
}

/// Area-weighted sums of the face gradients around a vertex, times two: along either axis of a frame.
#[inline(always)]
fn sum_gradients(shape: &Shape, vertex: u32, frame: [Point; 2], sums: &mut [Vec<f64>; 2]) {
    let mesh = &shape.mesh;
    let [first, second] = sums;
    first.fill(0.0);
    second.fill(0.0);
    for &face in shape.vertex_faces.row(vertex as usize) {
        if mesh.is_flat(face as usize) {
            continue;
        }
        let corners = mesh.faces[face as usize];
        let unit = vector::normalised(mesh.face_cross(face as usize));
        for i in 0..3 {
            let [from, to] = [corners[(i + 1) % 3], corners[(i + 2) % 3]];
            let opposite = vector::sub(mesh.vertices[to as usize], mesh.vertices[from as usize]);
            let turned = vector::cross(unit, opposite);
            let [x, y] = frame.map(|axis| vector::dot(turned, axis));
            let values = shape.rows.row(corners[i] as usize);
            for ((u, v), &value) in first.iter_mut().zip(&mut *second).zip(values) {
                *u += x * f64::from(value);
                *v += y * f64::from(value);
            }
        }
    }
}
