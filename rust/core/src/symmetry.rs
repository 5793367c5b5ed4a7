//! How far each point of a surface lies from its own mirror image, where the body is symmetric.
//!
//! Tails and heads lie on the plane of symmetry, limbs beside it: what distances alone confuse when
//! proportions differ, this tells apart.

use faer::Mat;

use crate::dense::{self, Rows};
use crate::error::{Error, Result};
use crate::hints::Hints;
use crate::map_search::{SampledPair, Width};
use crate::nearest::nearest;
use crate::pair::{LeftOut, Mirror, Pair, Shares};
use crate::progress::Progress;
use crate::refinement::upsampling;
use crate::shape::Shape;

/// Mean change of distances up to which a surface's map to itself counts as a symmetry.
const SYMMETRIC: f64 = 0.04;
/// How clearly it has to reverse the orientation.
const REVERSING: f64 = 0.3;
/// Mean distance between a point and the image of its image up to which it does.
const INVOLUTIVE: f64 = 0.06;
/// Ridge of the smooth function through the samples' offsets, per sample.
const RIDGE: f64 = 1e-3;

/// Distance of each vertex from its mirror image, √area; `None` for a surface without a mirror symmetry.
///
/// # Errors
/// [`Error::Cancelled`].
pub fn mirror_offsets(shape: &Shape, progress: &Progress) -> Result<Option<Vec<f32>>> {
    let hints = Hints::default();
    let pair = Pair {
        target: shape,
        source: shape,
        shares: Shares::BOTH,
        mirror: Mirror::Only,
        hints: &hints,
        left_out: LeftOut::default(),
        mirror_offsets: None,
    };
    let candidates = match SampledPair::new(pair, Width::NARROW).search(progress) {
        Err(Error::NoMap { .. }) => return Ok(None),
        found => found?,
    };
    let Some(best) = candidates
        .first()
        .filter(|best| best.orientation > REVERSING)
    else {
        return Ok(None);
    };
    let matrix = upsampling::upsampled(&pair, best)?;
    let k = matrix.ncols();
    let samples = &shape.farthest;
    let basis = dense::gather_rows(shape.basis.functions.as_ref(), samples, k);
    let turned = dense::product(basis.as_ref(), matrix.as_ref());
    let images = nearest(
        &Rows::from_matrix(basis.as_ref(), k),
        &Rows::from_matrix(turned.as_ref(), k),
    );
    let distances = shape.spectral_distances(samples, samples);
    let m = samples.len();
    let at = |i: usize, j: usize| if i == j { 0.0 } else { distances[(i, j)] };
    let image = |i: usize| images[i] as usize;
    let mut change = 0.0;
    for j in 0..m {
        for i in 0..m {
            change += (at(i, j) - at(image(i), image(j))).abs();
        }
    }
    change /= (m * m) as f64;
    let back = (0..m).map(|i| at(i, image(image(i)))).sum::<f64>() / m as f64;
    let offset: Vec<f64> = (0..m).map(|i| at(i, image(i))).collect();
    if change > SYMMETRIC || back > INVOLUTIVE {
        return Ok(None);
    }
    let gram = dense::product(basis.transpose(), basis.as_ref());
    let right = dense::product(
        basis.transpose(),
        Mat::from_fn(m, 1, |i, _| offset[i]).as_ref(),
    );
    let coefficients = dense::solve_with_ridge(gram, |_| RIDGE * m as f64, right.as_ref())?;
    let smooth = dense::product(shape.functions(k), coefficients.as_ref());
    Ok(Some(
        smooth.col(0).iter().map(|&s| s.max(0.0) as f32).collect(),
    ))
}
