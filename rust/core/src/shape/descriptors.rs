//! What a point looks like on its own surface: wave kernel signature and mean curvature.

use faer::{Mat, MatRef};

use crate::algebra::dense::{self, Rows};
use crate::algebra::vector;
use crate::error::{Result, System};
use crate::mesh::{self, Mesh};
use crate::shape::settings::DESCRIPTORS;
use crate::spectrum::eigenbasis::Eigenbasis;
use crate::spectrum::laplacian::Laplacian;
use crate::watch::progress::Check;

/// Energies at which the wave kernel is evaluated.
pub const WAVE_ENERGIES: usize = 60;
/// Heat times of curvatures: from a finger's width to a limb's.
pub const HEAT_TIMES: [f64; 4] = [3e-4, 1e-3, 3e-3, 1e-2];
/// How many of these curvatures the detail begins with; they help the refinement.
pub const DETAIL_CURVATURES: usize = HEAT_TIMES.len();

/// Pointwise descriptors of every vertex.
#[derive(Debug, Clone)]
pub struct Descriptors {
    /// `(n, 61)`: 60 logarithmic wave kernel values, then smoothed mean curvature.
    pub rows: Rows,
    /// `(n, 14)`: mean curvatures √t h of the surface smoothed over times t, and a tenth of the wave
    /// kernel, weighted for the refinement.
    pub detail: Mat<f32>,
    /// `(n, 3)`: mean curvatures √t h less what the wave kernel says of them. What is left cannot be told from
    /// distances on the surface: where a back bulges and a belly is hollow.
    pub extrinsic: Mat<f32>,
}

impl Descriptors {
    /// Wave kernel signature and mean curvature ½ n·(A⁻¹WV), in the unit of the metric: A holds
    /// its areas and `length_factors`, `(n)`, its lengths relative to those of the positions. `coordinates` are `ΦᵀA` V,
    /// `(k, 3)`.
    ///
    /// # Source
    /// Aubry, Schlickewei, Cremers, "The Wave Kernel Signature", 2011, here normalised by the area
    /// mean and on a logarithmic scale.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`] when `check` says so.
    pub fn new(
        mesh: &Mesh,
        laplacian: &Laplacian,
        length_factors: &[f64],
        basis: &Eigenbasis,
        coordinates: MatRef<'_, f64>,
        check: Check<'_>,
    ) -> Result<Self> {
        let n = mesh.vertices.len();
        let mass = laplacian.mass.as_slice();
        let (values, functions) = (basis.values.as_slice(), basis.functions.as_ref());
        let waves = wave_kernel(mass, values, functions, check)?;
        check()?;
        let raw = mean_curvature(mesh, laplacian, length_factors);
        let coarse = diffused(
            &raw,
            mass,
            values,
            functions,
            DESCRIPTORS.curvature_heat_time,
        );
        let power: f64 = mass.iter().zip(&coarse).map(|(a, h)| a * h * h).sum();
        let scale = if power > 0.0 { power.sqrt() } else { 1.0 };
        let mut rows = Rows::zeros(n, WAVE_ENERGIES + 1);
        for i in 0..n {
            let row = rows.row_mut(i);
            for (r, out) in row.iter_mut().take(WAVE_ENERGIES).enumerate() {
                *out = waves[(i, r)] as f32;
            }
            row[WAVE_ENERGIES] = (coarse[i] / scale) as f32;
        }
        check()?;
        let curvatures = smoothed_curvatures(mesh, basis, coordinates);
        let wave_weight =
            DESCRIPTORS.detail_wave_weight * (DESCRIPTORS.detail_wave_step as f64).sqrt();
        let detail = Mat::from_fn(
            n,
            DETAIL_CURVATURES + WAVE_ENERGIES / DESCRIPTORS.detail_wave_step,
            |i, c| {
                let value = if c < DETAIL_CURVATURES {
                    DESCRIPTORS.detail_curvature_weight * curvatures[(i, c)]
                } else {
                    wave_weight * waves[(i, DESCRIPTORS.detail_wave_step * (c - DETAIL_CURVATURES))]
                };
                value as f32
            },
        );
        Ok(Self {
            rows,
            detail,
            extrinsic: unexplained(
                mass,
                waves.as_ref(),
                curvatures.subcols(0, DESCRIPTORS.extrinsic_curvatures),
            )?,
        })
    }
}

/// What is left of curvatures after the best fit, by area, of a quadratic polynomial in each wave kernel value.
fn unexplained(
    mass: &[f64],
    waves: MatRef<'_, f64>,
    curvatures: MatRef<'_, f64>,
) -> Result<Mat<f32>> {
    let (n, used) = (
        waves.nrows(),
        WAVE_ENERGIES / DESCRIPTORS.explaining_wave_step,
    );
    let unit = (WAVE_ENERGIES as f64).sqrt();
    let explaining = Mat::from_fn(n, 2 * used + 1, |i, c| {
        let wave = |at: usize| unit * waves[(i, DESCRIPTORS.explaining_wave_step * at)];
        match c / used {
            0 => wave(c),
            1 => wave(c - used).powi(2),
            _ => 1.0,
        }
    });
    let weighted = Mat::from_fn(n, explaining.ncols(), |i, c| mass[i] * explaining[(i, c)]);
    let gram = dense::product(weighted.transpose(), explaining.as_ref());
    let right = dense::product(weighted.transpose(), curvatures);
    let fit = dense::solve_with_ridge(
        System::Shape,
        gram,
        |_| DESCRIPTORS.explaining_ridge,
        right.as_ref(),
    )?;
    let explained = dense::product(explaining.as_ref(), fit.as_ref());
    Ok(Mat::from_fn(n, curvatures.ncols(), |i, c| {
        (curvatures[(i, c)] - explained[(i, c)]) as f32
    }))
}

/// √t ½ n·(A⁻¹WV) of the surface V smoothed by e^{−Λt}, n its normals: without a unit, `(n, 4)`.
fn smoothed_curvatures(
    mesh: &Mesh,
    Eigenbasis {
        values, functions, ..
    }: &Eigenbasis,
    coordinates: MatRef<'_, f64>,
) -> Mat<f64> {
    let n = mesh.vertices.len();
    let sign = mesh.volume_sign();
    // Of each time smoothed positions and, beside them, what the operator makes of them: the basis is read once.
    let filtered = Mat::from_fn(values.len(), 6 * HEAT_TIMES.len(), |i, c| {
        let kept = (-values[i] * HEAT_TIMES[c / 6]).exp();
        coordinates[(i, c % 3)] * if c % 6 < 3 { kept } else { kept * values[i] }
    });
    let smooth = dense::product(functions.as_ref(), filtered.as_ref());
    let mut curvatures = Mat::zeros(n, HEAT_TIMES.len());
    for (column, time) in HEAT_TIMES.into_iter().enumerate() {
        let at = |i: usize, from: usize| [0, 1, 2].map(|c| smooth[(i, 6 * column + from + c)]);
        let positions: Vec<_> = (0..n).map(|i| at(i, 0)).collect();
        let normals = mesh::normals_of(&positions, &mesh.faces);
        for (i, normal) in normals.into_iter().enumerate() {
            curvatures[(i, column)] = time.sqrt() * 0.5 * sign * vector::dot(normal, at(i, 3));
        }
    }
    curvatures
}

/// ln of the wave kernel relative to its area mean, `(n, 60)`, of unit variance in all.
fn wave_kernel(
    mass: &[f64],
    values: &[f64],
    functions: MatRef<'_, f64>,
    check: Check<'_>,
) -> Result<Mat<f64>> {
    let n = functions.nrows();
    let pairs = DESCRIPTORS.wave_pairs.min(values.len());
    let logs: Vec<f64> = values[1..pairs].iter().map(|l| l.max(1e-12).ln()).collect();
    let low = logs[0];
    let high = logs[logs.len() - 1] / 1.02;
    let width = DESCRIPTORS.wave_band_steps * (high - low) / WAVE_ENERGIES as f64;
    let mut bands = Mat::<f64>::zeros(pairs - 1, WAVE_ENERGIES);
    for r in 0..WAVE_ENERGIES {
        let energy = low + (high - low) * r as f64 / (WAVE_ENERGIES - 1) as f64;
        let weights: Vec<f64> = logs
            .iter()
            .map(|l| (-(energy - l).powi(2) / (2.0 * width * width)).exp())
            .collect();
        let total: f64 = weights.iter().sum();
        for (i, w) in weights.iter().enumerate() {
            bands[(i, r)] = w / total;
        }
    }
    let squares = Mat::from_fn(n, pairs - 1, |i, j| functions[(i, j + 1)].powi(2));
    check()?;
    let mut waves = dense::product(squares.as_ref(), bands.as_ref());
    let mut variance = 0.0;
    for r in 0..WAVE_ENERGIES {
        check()?;
        let column = waves.col_as_slice_mut(r);
        let mean: f64 = mass.iter().zip(&*column).map(|(a, w)| a * w).sum();
        dense::vectorised(
            #[inline(always)]
            || {
                for w in column.iter_mut() {
                    *w = dense::ln(*w / mean + DESCRIPTORS.wave_floor);
                }
            },
        );
        let centre: f64 = mass.iter().zip(&*column).map(|(a, w)| a * w).sum();
        variance += mass
            .iter()
            .zip(&*column)
            .map(|(a, w)| a * (w - centre).powi(2))
            .sum::<f64>();
    }
    let scale = if variance > 0.0 {
        1.0 / variance.sqrt()
    } else {
        1.0
    };
    for r in 0..WAVE_ENERGIES {
        for w in waves.col_as_slice_mut(r) {
            *w *= scale;
        }
    }
    Ok(waves)
}

/// ½ n·(A⁻¹WV), positive where the surface bulges outward, clipped.
fn mean_curvature(mesh: &Mesh, laplacian: &Laplacian, length_factors: &[f64]) -> Vec<f64> {
    let Laplacian { stiffness, mass } = laplacian;
    let normals = mesh.vertex_normals();
    let sign = mesh.volume_sign();
    stiffness
        .outer_iterator()
        .enumerate()
        .map(|(i, row)| {
            let mut flow = [0.0; 3];
            for (j, &w) in row.iter() {
                flow = vector::add(flow, vector::scaled(mesh.vertices[j], w));
            }
            let h = 0.5 * sign * vector::dot(normals[i], flow) / mass[i] * length_factors[i];
            h.clamp(-DESCRIPTORS.curvature_limit, DESCRIPTORS.curvature_limit)
        })
        .collect()
}

/// Φ e^{−Λt} `ΦᵀA` f.
fn diffused(
    values_at: &[f64],
    mass: &[f64],
    values: &[f64],
    functions: MatRef<'_, f64>,
    time: f64,
) -> Vec<f64> {
    let weighted = Mat::from_fn(values_at.len(), 1, |i, _| mass[i] * values_at[i]);
    let mut coefficients = dense::product(functions.transpose(), weighted.as_ref());
    for (i, lambda) in values.iter().enumerate() {
        coefficients[(i, 0)] *= (-lambda * time).exp();
    }
    let smooth = dense::product(functions, coefficients.as_ref());
    smooth.col_as_slice(0).to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{RINGS, torus};

    #[test]
    fn what_is_left_of_curvatures_is_uncorrelated_with_the_wave_kernel() {
        let shape = torus(RINGS);
        let Descriptors {
            rows, extrinsic, ..
        } = &shape.descriptors;
        let sum = |term: &dyn Fn(usize) -> f64| -> f64 {
            (0..extrinsic.nrows())
                .map(|v| shape.mass[v] * term(v))
                .sum()
        };
        for scale in 0..extrinsic.ncols() {
            let left = |v: usize| f64::from(extrinsic[(v, scale)]);
            let power = sum(&|v| left(v).powi(2));
            assert!(power > 0.0);
            for energy in (0..WAVE_ENERGIES).step_by(DESCRIPTORS.explaining_wave_step) {
                let wave = |v: usize| f64::from(rows.row(v)[energy]);
                let bound = (power * sum(&|v| wave(v).powi(2))).sqrt();
                // The ridge leaves 1e-6 times coefficients of some hundreds.
                assert!(sum(&|v| left(v) * wave(v)).abs() < 1e-3 * bound);
            }
        }
    }
}
