//! The paper's objective: S-GMDS energy, its constraints and its minimisation.

use std::collections::VecDeque;

use faer::{Mat, MatRef};

use crate::algebra::dense;
use crate::baselines::settings::SPECTRAL_GMDS;
use crate::error::Result;
use crate::watch::progress::Progress;

/// Weights μ₁ of the spectrum and μ₂ of orthogonality beside the distance term.
#[derive(Debug, Clone, Copy)]
pub struct Weights {
    /// μ₁, dimensionless.
    pub spectrum: f64,
    /// μ₂, dimensionless.
    pub orthogonality: f64,
}

impl Default for Weights {
    fn default() -> Self {
        Self {
            spectrum: 0.1,
            orthogonality: 0.1,
        }
    }
}

/// ‖Cα₂ − α₁C‖²/‖α₂‖² + μ₁‖CᵀΛ₁C − Λ₂‖²/‖Λ₂‖² + μ₂‖CᵀC − I‖²/k.
///
/// Shape 1 is the source, 2 the target; C `(k, k)` takes coefficients on 2 to coefficients on 1.
/// Mass is preserved when C takes the constant's coefficients to the constant's and Cᵀ back; with
/// `ΦᵀAΦ` = I, the constant first and unit area these are e₁ on both shapes, so that the constraint
/// fixes the first row and column of C to e₁ and leaves `(k − 1)²` unknowns.
///
/// # Source
/// Aflalo, Dubrovina, Kimmel, "Spectral Generalized Multi-Dimensional Scaling", arXiv:1311.2187;
/// the terms are made dimensionless here.
#[derive(Debug)]
pub struct Objective<'a> {
    /// α₁.
    pub source_operator: MatRef<'a, f64>,
    /// α₂.
    pub target_operator: MatRef<'a, f64>,
    /// Λ₁, ascending.
    pub source_values: &'a [f64],
    /// Λ₂, ascending.
    pub target_values: &'a [f64],
    /// μ₁, μ₂.
    pub weights: Weights,
}

/// How a minimisation ended.
#[derive(Debug, Clone)]
pub struct Minimum {
    /// The map `(k, k)`.
    pub matrix: Mat<f64>,
    /// Energy there.
    pub energy: f64,
    /// Euclidean norm of the gradient over the unknowns.
    pub gradient_norm: f64,
    /// Steps taken.
    pub steps: usize,
    /// Whether the gradient or the decrease fell below its bound before the steps ran out.
    pub converged: bool,
}

impl Objective<'_> {
    /// Energy and gradient; the gradient is zero on the constrained first row and column.
    #[must_use]
    pub fn value(&self, c: MatRef<'_, f64>) -> (f64, Mat<f64>) {
        let k = c.nrows();
        let (a1, a2) = (self.source_operator, self.target_operator);
        let commutator = &dense::product(c, a2) - &dense::product(a1, c);
        let weighted = Mat::from_fn(k, k, |i, j| self.source_values[i] * c[(i, j)]);
        let mut spectrum = dense::product(c.transpose(), weighted.as_ref());
        let mut metric = dense::product(c.transpose(), c);
        for i in 0..k {
            spectrum[(i, i)] -= self.target_values[i];
            metric[(i, i)] -= 1.0;
        }
        let scale_distance = 1.0 / dense::squared_norm(a2);
        let values_norm: f64 = self.target_values[..k].iter().map(|l| l * l).sum();
        let scale_spectrum = self.weights.spectrum / values_norm;
        let scale_metric = self.weights.orthogonality / k as f64;
        let energy = scale_distance * dense::squared_norm(commutator.as_ref())
            + scale_spectrum * dense::squared_norm(spectrum.as_ref())
            + scale_metric * dense::squared_norm(metric.as_ref());

        let by_distance = &dense::product(commutator.as_ref(), a2.transpose())
            - &dense::product(a1.transpose(), commutator.as_ref());
        let by_spectrum = dense::product(weighted.as_ref(), spectrum.as_ref());
        let by_metric = dense::product(c, metric.as_ref());
        let gradient = Mat::from_fn(k, k, |i, j| {
            if i == 0 || j == 0 {
                return 0.0;
            }
            2.0 * scale_distance * by_distance[(i, j)]
                + 4.0 * scale_spectrum * by_spectrum[(i, j)]
                + 4.0 * scale_metric * by_metric[(i, j)]
        });
        (energy, gradient)
    }

    /// Nearest matrix that satisfies the mass constraints: first row and column e₁.
    #[must_use]
    pub fn mass_preserving(&self, c: MatRef<'_, f64>) -> Mat<f64> {
        Mat::from_fn(c.nrows(), c.ncols(), |i, j| match (i, j) {
            (0, 0) => 1.0,
            (0, _) | (_, 0) => 0.0,
            _ => c[(i, j)],
        })
    }

    /// Minimises from a start by limited-memory quasi-Newton steps (L-BFGS).
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    ///
    /// # Source
    /// Liu, Nocedal, "On the limited memory BFGS method for large scale optimization", 1989.
    pub fn minimised(&self, start: MatRef<'_, f64>, progress: &Progress) -> Result<Minimum> {
        let mut at = self.mass_preserving(start);
        let (mut energy, mut gradient) = self.value(at.as_ref());
        let mut memory: VecDeque<(Mat<f64>, Mat<f64>, f64)> = VecDeque::new();
        let mut steps = 0;
        let mut converged = false;
        while steps < SPECTRAL_GMDS.steps {
            progress.check()?;
            if inner(&gradient, &gradient).sqrt() <= SPECTRAL_GMDS.gradient_bound * (1.0 + energy) {
                converged = true;
                break;
            }
            let direction = descent(&gradient, &memory);
            let Some((next, value, slope)) = self.stepped(&at, energy, &gradient, &direction)
            else {
                if memory.is_empty() {
                    break;
                }
                // The curvature in memory misleads: start over along the gradient.
                memory.clear();
                continue;
            };
            steps += 1;
            let (step, turn) = (&next - &at, &slope - &gradient);
            let curvature = inner(&step, &turn);
            if curvature > 1e-12 * inner(&turn, &turn) {
                memory.push_back((step, turn, curvature));
                if memory.len() > SPECTRAL_GMDS.memory {
                    memory.pop_front();
                }
            }
            let decrease = energy - value;
            (at, energy, gradient) = (next, value, slope);
            if decrease <= SPECTRAL_GMDS.decrease_bound * (1.0 + energy) {
                converged = true;
                break;
            }
        }
        Ok(Minimum {
            gradient_norm: inner(&gradient, &gradient).sqrt(),
            matrix: at,
            energy,
            steps,
            converged,
        })
    }

    /// First point along a direction that lowers the energy enough (Armijo), halving from 1.
    fn stepped(
        &self,
        at: &Mat<f64>,
        energy: f64,
        gradient: &Mat<f64>,
        direction: &Mat<f64>,
    ) -> Option<(Mat<f64>, f64, Mat<f64>)> {
        let slope = inner(gradient, direction);
        let mut length = 1.0;
        for _ in 0..SPECTRAL_GMDS.halvings {
            let next = Mat::from_fn(at.nrows(), at.ncols(), |i, j| {
                at[(i, j)] + length * direction[(i, j)]
            });
            let (value, next_gradient) = self.value(next.as_ref());
            if value <= energy + SPECTRAL_GMDS.sufficient * length * slope {
                return Some((next, value, next_gradient));
            }
            length *= 0.5;
        }
        None
    }
}

/// Start of the paper's method: the best sign pattern of the first functions, continued one
/// function at a time by the sign that fits the distance operators best. `(k, k)`.
#[must_use]
pub fn continued_signs(
    seed: MatRef<'_, f64>,
    source_operator: MatRef<'_, f64>,
    target_operator: MatRef<'_, f64>,
) -> Mat<f64> {
    let (k, first) = (target_operator.nrows(), seed.nrows());
    let mut c = Mat::zeros(k, k);
    for j in 0..first {
        for i in 0..first {
            c[(i, j)] = seed[(i, j)];
        }
    }
    for j in first..k {
        let mut agreement = 0.0;
        for a in 0..j {
            for b in 0..j {
                agreement += source_operator[(j, a)] * c[(a, b)] * target_operator[(b, j)];
            }
        }
        c[(j, j)] = if agreement < 0.0 { -1.0 } else { 1.0 };
    }
    c
}

fn inner(a: &Mat<f64>, b: &Mat<f64>) -> f64 {
    let mut sum = 0.0;
    for j in 0..a.ncols() {
        for i in 0..a.nrows() {
            sum += a[(i, j)] * b[(i, j)];
        }
    }
    sum
}

/// −H·gradient by the two-loop recursion.
fn descent(gradient: &Mat<f64>, memory: &VecDeque<(Mat<f64>, Mat<f64>, f64)>) -> Mat<f64> {
    let mut q = gradient.clone();
    let mut coverage = Vec::with_capacity(memory.len());
    for (step, turn, curvature) in memory.iter().rev() {
        let share = inner(step, &q) / curvature;
        q = &q - faer::Scale(share) * turn;
        coverage.push(share);
    }
    if let Some((_, turn, curvature)) = memory.back() {
        q = faer::Scale(curvature / inner(turn, turn)) * &q;
    }
    for ((step, turn, curvature), share) in memory.iter().zip(coverage.iter().rev()) {
        let correction = share - inner(turn, &q) / curvature;
        q = &q + faer::Scale(correction) * step;
    }
    faer::Scale(-1.0) * q
}
