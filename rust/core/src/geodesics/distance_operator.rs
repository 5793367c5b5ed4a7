//! Geodesic distances in the eigenbasis: α with D ≈ Φ α Φᵀ.

use faer::{Mat, MatRef, Side};

use crate::algebra::dense;
use crate::error::{Error, Result, System};
use crate::geodesics::settings::DISTANCE_OPERATOR;
use crate::watch::progress::Check;

/// α from distances of m samples to every vertex.
///
/// `basis` is `(n, k)` with `ΦᵀAΦ` = I, `values` the k eigenvalues, `mass` the n vertex areas,
/// `samples` the m vertices, `fields` the distances `(n, m)`. The projection of each field on the
/// basis is exact; only the sampled argument is interpolated, by penalised least squares with the
/// Dirichlet energy. Returns `(k, k)`, symmetric, in units of length³.
///
/// # Errors
/// [`Error::NotFactorised`] when the samples do not determine the interpolation;
/// [`Error::Cancelled`].
pub fn from_fields(
    basis: MatRef<'_, f64>,
    values: &[f64],
    mass: &[f64],
    samples: &[u32],
    fields: MatRef<'_, f32>,
    check: Check<'_>,
) -> Result<Mat<f64>> {
    /// Fields held in double precision at a time.
    const BLOCK: usize = 16;
    let (n, k) = (basis.nrows(), basis.ncols());
    let at_samples = dense::gather_rows(basis, samples, k);
    let mut projected = Mat::zeros(samples.len(), k);
    let mut block = Mat::zeros(n, BLOCK);
    for from in (0..samples.len()).step_by(BLOCK) {
        check()?;
        let count = BLOCK.min(samples.len() - from);
        for j in 0..count {
            let field = fields.col(from + j);
            for ((out, d), a) in block.col_mut(j).iter_mut().zip(field.iter()).zip(mass) {
                *out = a * f64::from(*d);
            }
        }
        projected
            .subrows_mut(from, count)
            .copy_from(&dense::product(block.subcols(0, count).transpose(), basis));
    }
    let gram = dense::product(at_samples.transpose(), at_samples.as_ref());
    let right = dense::product(at_samples.transpose(), projected.as_ref());
    let weight = DISTANCE_OPERATOR.dirichlet_weight * samples.len() as f64 / values[k - 1];
    let alpha = dense::solve_with_ridge(
        System::Shape,
        gram,
        |i| weight * values[i] + 1e-9,
        right.as_ref(),
    )?;
    Ok(symmetrised(alpha.as_ref()))
}

/// α from distances between m samples only, the paper's spectral interpolation.
///
/// Minimises the Dirichlet energy of Φ α Φᵀ in both arguments, tr(αᵀΛα) + tr(αΛαᵀ), plus
/// μ · mean squared deviation at the samples, in closed form: with G = `Φ_SᵀΦ_S/m` and the pencil
/// ΛZ = GZ diag(s), `ZᵀGZ` = I, the solution is Z [μ `R̃_ij/(μ` + `s_i` + `s_j`)] Zᵀ where
/// R̃ = `ZᵀΦ_SᵀDΦ_SZ/m²`.
///
/// # Errors
/// [`Error::NotFactorised`] when the pencil is singular.
///
/// # Source
/// Aflalo, Dubrovina, Kimmel, "Spectral Generalized Multi-Dimensional Scaling",
/// arXiv:1311.2187, section on spectral interpolation of the distances.
pub fn from_samples(
    at_samples: MatRef<'_, f64>,
    values: &[f64],
    distances: MatRef<'_, f64>,
    data_penalty: f64,
) -> Result<Mat<f64>> {
    /// Keeps G invertible when there are few samples.
    const GRAM_FLOOR: f64 = 1e-9;
    let (m, k) = (at_samples.nrows(), at_samples.ncols());
    let failed = |what: &str| Error::NotFactorised {
        of: System::Shape,
        reason: format!("distance operator from {m} samples and {k} eigenfunctions: {what}"),
    };
    let mut gram = dense::product(at_samples.transpose(), at_samples);
    for j in 0..k {
        for i in 0..k {
            gram[(i, j)] /= m as f64;
        }
        gram[(j, j)] += GRAM_FLOOR;
    }
    // G = LLᵀ turns the pencil into L⁻¹ΛL⁻ᵀ y = s y with Z = L⁻ᵀY.
    let factor = gram.llt(Side::Lower).map_err(|_| failed("Gram matrix"))?;
    let lower = factor.L().to_owned();
    let mut scaled = Mat::from_fn(k, k, |i, j| if i == j { values[i] } else { 0.0 });
    lower.solve_lower_triangular_in_place(scaled.as_mut());
    let mut pencil = scaled.transpose().to_owned();
    lower.solve_lower_triangular_in_place(pencil.as_mut());
    let decomposition = symmetrised(pencil.as_ref())
        .self_adjoint_eigen(Side::Lower)
        .map_err(|_| failed("eigenvalues"))?;
    let mut z = decomposition.U().to_owned();
    lower
        .transpose()
        .solve_upper_triangular_in_place(z.as_mut());
    let s: Vec<f64> = decomposition.S().column_vector().iter().copied().collect();

    let sampled = dense::product(at_samples, z.as_ref());
    let right = dense::product(distances, sampled.as_ref());
    let mut r = dense::product(sampled.transpose(), right.as_ref());
    let pairs = (m * m) as f64;
    for j in 0..k {
        for i in 0..k {
            r[(i, j)] *= data_penalty / pairs / (data_penalty + s[i].max(0.0) + s[j].max(0.0));
        }
    }
    let half = dense::product(z.as_ref(), r.as_ref());
    Ok(symmetrised(
        dense::product(half.as_ref(), z.transpose()).as_ref(),
    ))
}

/// Distances Φ(a) α Φ(b)ᵀ between rows of basis values, never negative.
#[must_use]
pub fn between(alpha: MatRef<'_, f64>, a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let half = dense::product(a, alpha);
    let mut out = dense::product(half.as_ref(), b.transpose());
    for j in 0..out.ncols() {
        for value in out.col_mut(j).iter_mut() {
            *value = value.max(0.0);
        }
    }
    out
}

/// [`between`] two lists of vertices, `basis` `(n, ≥ k)`.
#[must_use]
pub fn between_vertices(
    alpha: MatRef<'_, f64>,
    basis: MatRef<'_, f64>,
    a: &[u32],
    b: &[u32],
) -> Mat<f64> {
    let rows = |ids: &[u32]| dense::gather_rows(basis, ids, alpha.nrows());
    between(alpha, rows(a).as_ref(), rows(b).as_ref())
}

fn symmetrised(matrix: MatRef<'_, f64>) -> Mat<f64> {
    Mat::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
        f64::midpoint(matrix[(i, j)], matrix[(j, i)])
    })
}
