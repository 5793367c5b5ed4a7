//! How far each point of a surface lies from its own mirror image, where the body is symmetric, and how it is like itself
//! turned.
//!
//! Tails and heads lie on the plane of symmetry, limbs beside it: what distances alone confuse when
//! proportions differ, this tells apart. How far out a limb reaches differs with the proportions, so all far
//! points count alike.

use faer::Mat;

use crate::algebra::dense::{self, Rows};
use crate::error::{Error, Result, System};
use crate::matching::problem::constraints::Constraints;
use crate::matching::problem::pair::{Coverage, LeftOut, Mirror, Pair};
use crate::matching::refinement::upsampling;
use crate::matching::search::{self, Width};
use crate::matching::settings::SYMMETRY;
use crate::mesh::numbering::Sample;
use crate::shape::Shape;
use crate::shape::nearest::nearest;
use crate::watch::progress::Progress;

/// Distance of each vertex from its mirror image, √area; `None` for a surface without a mirror symmetry.
///
/// # Errors
/// [`Error::Cancelled`].
pub fn mirror_offsets(shape: &Shape, progress: &Progress) -> Result<Option<Vec<f32>>> {
    let Some((map, orientation)) = to_itself(shape, Mirror::Only, progress)? else {
        return Ok(None);
    };
    let k = map.ncols();
    let samples = &shape.farthest;
    let basis = dense::gather_rows(shape.basis.functions.as_ref(), samples, k);
    let turned = dense::product(basis.as_ref(), map.as_ref());
    let images = Sample::each(nearest(
        &Rows::from_matrix(basis.as_ref(), k),
        &Rows::from_matrix(turned.as_ref(), k),
    ));
    let mut distances = shape.spectral_distances(samples, samples);
    for i in 0..samples.len() {
        distances[(i, i)] = 0.0;
    }
    if !is_symmetry(&images, &distances, orientation) {
        return Ok(None);
    }
    // The offsets of the samples, as a smooth function everywhere.
    let offsets = Mat::from_fn(samples.len(), 1, |i, _| distances[(i, images[i].index())]);
    let gram = dense::product(basis.transpose(), basis.as_ref());
    let right = dense::product(basis.transpose(), offsets.as_ref());
    let ridge = SYMMETRY.ridge * samples.len() as f64;
    let coefficients = dense::solve_with_ridge(System::Map, gram, |_| ridge, right.as_ref())?;
    let smooth = dense::product(shape.functions(k), coefficients.as_ref());
    let above_zero = smooth.col(0).iter().map(|&s| s.max(0.0) as f32);
    Ok(Some(above_zero.collect()))
}

/// What a distance s from the mirror image counts in comparing two shapes: FAR · (1 − exp(−s / FAR)).
#[must_use]
pub fn counted(offset: f32) -> f32 {
    -SYMMETRY.far * (-offset / SYMMETRY.far).exp_m1()
}

/// The best map of a shape to itself that keeps the orientation and is far from the identity, `(60, 60)`; `None` where the search
/// keeps none. A person turned front to back and left to right at once changes short distances little.
///
/// # Errors
/// [`Error::Cancelled`], [`Error::NotFactorised`].
pub fn turning_map(shape: &Shape, progress: &Progress) -> Result<Option<Mat<f64>>> {
    let found = to_itself(shape, Mirror::Away, progress)?;
    Ok(found.map(|(map, _)| map))
}

/// The best map of a shape to itself of some kind, `(60, 60)`, and how clearly it keeps or reverses the orientation.
fn to_itself(
    shape: &Shape,
    mirror: Mirror,
    progress: &Progress,
) -> Result<Option<(Mat<f64>, f64)>> {
    let constraints = Constraints::default();
    let pair = Pair {
        target: shape,
        source: shape,
        coverage: Coverage::BOTH,
        mirror,
        constraints: &constraints,
        left_out: LeftOut::default(),
        lengths: 1.0,
        mirror_offsets: None,
    };
    let candidates = match search::candidates(&pair, Width::NARROW, progress) {
        Err(Error::NoMap { .. }) => return Ok(None),
        found => found?,
    };
    candidates
        .first()
        .map(|best| Ok((upsampling::upsampled(&pair, best)?, best.orientation)))
        .transpose()
}

/// Whether images of points among themselves keep distances and are their own inverse.
fn is_symmetry(images: &[Sample], distances: &Mat<f64>, orientation: f64) -> bool {
    let count = images.len();
    let (mut change, mut back) = (0.0, 0.0);
    for (j, &image) in images.iter().enumerate() {
        back += distances[(j, images[image.index()].index())];
        for (i, &other) in images.iter().enumerate() {
            change += (distances[(i, j)] - distances[(other.index(), image.index())]).abs();
        }
    }
    change /= (count * count) as f64;
    change < SYMMETRY.symmetric
        && change < SYMMETRY.reversing * orientation
        && back < SYMMETRY.involutive * count as f64
}
