//! Distance operator and S-GMDS objective against closed forms.

use std::f64::consts::PI;

use faer::Mat;
use sgmds_core::baselines::spectral_gmds::{Objective, Weights};
use sgmds_core::geodesics::distance_operator::{self};
use sgmds_core::geodesics::settings::DISTANCE_OPERATOR;
use sgmds_core::mesh::Mesh;
use sgmds_core::spectrum::eigenbasis::Eigenbasis;
use sgmds_core::spectrum::laplacian::Laplacian;
use sgmds_core::watch::progress::Progress;

use crate::common::icosphere;

struct Sphere {
    basis: Eigenbasis,
    mass: Vec<f64>,
    samples: Vec<u32>,
    /// Exact great-circle distances from the samples at unit area, `(n, m)`.
    fields: Mat<f32>,
}

impl Sphere {
    fn operator(&self) -> Mat<f64> {
        distance_operator::from_fields(
            self.basis.functions.as_ref(),
            &self.basis.values,
            &self.mass,
            &self.samples,
            self.fields.as_ref(),
            &|| Ok(()),
        )
        .unwrap()
    }
}

fn sphere(pairs: usize) -> Sphere {
    let (vertices, faces) = icosphere(4);
    let mesh = Mesh::new(&vertices, &faces).unwrap();
    let laplacian = Laplacian::new(&mesh).unwrap();
    let basis = Eigenbasis::new(&laplacian, pairs, &|| false).unwrap();
    // The first vertices are those of the coarser icospheres: evenly spread.
    let samples: Vec<u32> = (0..162).collect();
    let radius = 1.0 / (4.0 * PI).sqrt();
    let fields = Mat::from_fn(vertices.len(), samples.len(), |i, j| {
        let (p, q) = (vertices[i], vertices[j]);
        let cosine: f64 = (0..3).map(|c| p[c] * q[c]).sum();
        (radius * cosine.clamp(-1.0, 1.0).acos()) as f32
    });
    Sphere {
        basis,
        mass: laplacian.mass,
        samples,
        fields,
    }
}

/// Eigenvalues of the operator of great-circle distances on the unit sphere are 2π² for ℓ = 0,
/// −π²/2 for ℓ = 1 and 0 for even ℓ ≥ 2 (Funk–Hecke); α scales with length³, the unit-area
/// sphere has radius 1/√(4π).
fn check_against_funk_hecke(alpha: &Mat<f64>, tolerance: f64) {
    let scale = (4.0 * PI).powf(1.5);
    let block = |from: usize, to: usize| -> f64 {
        (from..to).map(|i| scale * alpha[(i, i)]).sum::<f64>() / (to - from) as f64
    };
    assert!((block(0, 1) - 2.0 * PI * PI).abs() < tolerance * 2.0 * PI * PI);
    assert!((block(1, 4) + PI * PI / 2.0).abs() < tolerance * PI * PI / 2.0);
    assert!(block(4, 9).abs() < tolerance * PI * PI / 2.0);
}

#[test]
fn operator_of_the_sphere_from_whole_fields() {
    let s = sphere(25);
    let alpha = s.operator();
    // The chords of the icosphere are half a percent shorter than the arcs.
    check_against_funk_hecke(&alpha, 0.01);
    for i in 0..25 {
        for j in 0..25 {
            assert_eq!(alpha[(i, j)], alpha[(j, i)]);
        }
    }
}

#[test]
fn operator_of_the_sphere_from_samples_alone() {
    let s = sphere(25);
    let m = s.samples.len();
    let at_samples = Mat::from_fn(m, 25, |i, j| s.basis.functions[(s.samples[i] as usize, j)]);
    let distances = Mat::from_fn(m, m, |i, j| f64::from(s.fields[(s.samples[i] as usize, j)]));
    let alpha = distance_operator::from_samples(
        at_samples.as_ref(),
        &s.basis.values,
        distances.as_ref(),
        DISTANCE_OPERATOR.data_penalty,
    )
    .unwrap();
    // The Dirichlet term lowers coefficient ij by 1/(1 + (λᵢ + λⱼ)/μ), for ℓ = 1 at unit area by
    // 16π/10⁴; sampling at 162 points adds about a percent.
    check_against_funk_hecke(&alpha, 0.03);
}

fn objective(s: &Sphere, alpha: &Mat<f64>, weights: Weights) -> (f64, Mat<f64>, Mat<f64>) {
    let k = alpha.nrows();
    let objective = Objective {
        target_operator: alpha.as_ref(),
        source_operator: alpha.as_ref(),
        target_values: &s.basis.values[..k],
        source_values: &s.basis.values[..k],
        weights,
    };
    // Any matrix that keeps the mass.
    let c = Mat::from_fn(k, k, |i, j| match (i, j) {
        (0, 0) => 1.0,
        (0, _) | (_, 0) => 0.0,
        _ => f64::from(u8::from(i == j)) + 0.1 * ((3 * i + 5 * j) as f64).sin(),
    });
    let (energy, gradient) = objective.value(c.as_ref());
    let step = 1e-6;
    let slopes = Mat::from_fn(k, k, |i, j| {
        if i == 0 || j == 0 {
            return 0.0;
        }
        let at = |h: f64| {
            let mut moved = c.clone();
            moved[(i, j)] += h;
            objective.value(moved.as_ref()).0
        };
        (at(step) - at(-step)) / (2.0 * step)
    });
    (energy, gradient, slopes)
}

#[test]
fn gradient_agrees_with_differences_of_the_energy() {
    let s = sphere(10);
    let alpha = s.operator();
    let (energy, gradient, slopes) = objective(&s, &alpha, Weights::default());
    for i in 0..10 {
        for j in 0..10 {
            // Central differences at 1e-6 leave about 1e-10 of the energy's size.
            let difference = (gradient[(i, j)] - slopes[(i, j)]).abs();
            assert!(
                difference < 1e-8 * (1.0 + energy),
                "({i}, {j}): {difference}"
            );
        }
    }
}

#[test]
fn minimiser_keeps_the_mass_and_reaches_zero_on_a_shape_and_itself() {
    let s = sphere(10);
    let alpha = s.operator();
    let objective = Objective {
        target_operator: alpha.as_ref(),
        source_operator: alpha.as_ref(),
        target_values: &s.basis.values,
        source_values: &s.basis.values,
        weights: Weights::default(),
    };
    let start = Mat::from_fn(10, 10, |i, j| {
        f64::from(u8::from(i == j)) + 0.05 * ((i + 2 * j) as f64).cos()
    });
    let end = objective
        .minimised(start.as_ref(), &Progress::default())
        .unwrap();
    assert!(end.energy < 1e-8, "{}", end.energy);
    for i in 1..10 {
        assert_eq!((end.matrix[(0, i)], end.matrix[(i, 0)]), (0.0, 0.0));
    }
    assert_eq!(end.matrix[(0, 0)], 1.0);
}
