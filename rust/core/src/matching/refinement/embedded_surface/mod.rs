//! Final refinement: spectrum, low-passed surface and its normals together.
//!
//! One surface, low-passed to k eigenfunctions, is deformed onto the other by a smooth displacement: a part onto
//! the whole, some of which has nowhere to go on the part, else the target onto the source. Positions and
//! normals then disambiguate what the spectrum alone leaves open. k grows until fingers and ears are there,
//! twice: what slid along a limb comes back a little each time. At first a second way starts from fewer
//! eigenfunctions, which turns back twisted limbs and twists others, and each region is taken from the way that
//! is better there. Fingers that lie on their neighbours are moved then. At last the surface itself is drawn onto the other, as rigidly as possible, and refines the
//! map once more in the same way; then it slides along the other, deformed by maps that are affine on each part.
//!
//! # Source
//! Eisenberger, Lähner, Cremers, "Smooth Shells", 2020, for the product embedding; fits, schedule
//! and the propagated nearest neighbours are this project's.

mod embedding;
mod fits;
mod mending;
mod point_to_plane;
mod rigid_steps;
mod schedule;
mod spectral_steps;
mod starting;
mod state;

use faer::MatRef;

use crate::algebra::vector;
use crate::deformation::piecewise_affine::PiecewiseAffine;
use crate::deformation::rigid_surface::RigidSurface;
use crate::error::Result;
use crate::matching::problem::pair::{Mirror, Pair, Part};
use crate::matching::problem::point_map::PointMaps;
use crate::matching::problem::which::Which;
use crate::matching::refinement::coinciding::{Placed, coinciding};
use crate::matching::refinement::piece::Piece;
use crate::matching::refinement::relative_length::relative_length;
use crate::matching::refinement::side::Surface;
use crate::shape::Shape;
use crate::watch::progress::Check;

pub use schedule::{FULL, ISOMETRIC, OF_PART, SHORT, Schedule};
pub use state::Refined;

use embedding::{COINCIDING, WHOLE};
use spectral_steps::CLIMB;
use state::as_matrix;

/// The moving surface at rest, before the last steps deform it.
struct AtRest<'a> {
    rigid: RigidSurface<'a>,
    sliding: Option<PiecewiseAffine<'a>>,
}

/// Refines a `(kₛ, kₜ)` map of low eigenfunctions, target coefficients → source coefficients.
///
/// `samples` are the images of the farthest-point samples of both shapes, where they are known. `report` is told the
/// fraction done.
///
/// # Errors
/// [`crate::Error::Cancelled`], [`crate::Error::NotFactorised`].
pub fn refined<'a>(
    pair: &Pair<'a>,
    matrix: MatRef<'_, f64>,
    samples: Option<PointMaps<&[u32]>>,
    schedule: Schedule,
    report: &(dyn Fn(f64) -> Result<()> + Sync),
) -> Result<Refined<'a>> {
    let start = || report(0.0);
    let state = Refined::start(pair, matrix, samples, schedule.drawn, &start)?;
    state.refined(pair, schedule, report)
}

/// Refines the images of all vertices of both shapes by deforming either.
///
/// # Errors
/// Those of [`refined`].
pub fn refined_images<'a>(
    pair: &Pair<'a>,
    moving: Which,
    images: PointMaps<Vec<u32>>,
    schedule: Schedule,
    report: &(dyn Fn(f64) -> Result<()> + Sync),
) -> Result<Refined<'a>> {
    Refined::by_images(pair, moving, images).refined(pair, schedule, report)
}

/// Where surfaces lie that lie on one another as they were given. Nothing where they do not.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn in_place(pair: &Pair<'_>, check: Check<'_>) -> Result<Option<Placed>> {
    if pair.mirror == Mirror::Only || !pair.uses(Part::Extrinsic) || !pair.uses(Part::InPlace) {
        return Ok(None);
    }
    coinciding(pair.source, pair.target, check)
}

/// The nearest points of surfaces that lie on one another, and what their places tell of the pair: which is a part, and
/// their lengths.
///
/// # Errors
/// [`crate::Error::Cancelled`], [`crate::Error::NotFactorised`].
pub fn of_places<'a>(
    pair: &Pair<'a>,
    placed: &Placed,
    check: Check<'_>,
) -> Result<(Pair<'a>, Refined<'a>)> {
    let (target, source) = (pair.target, pair.source);
    let pair = Pair {
        coverage: placed.coverage,
        lengths: target.unit / source.unit,
        ..*pair
    };
    let most = target.basis.values.len().min(source.basis.values.len());
    let mut state = Refined::by_images(&pair, placed.moving, placed.images.clone());
    state.deformed = as_matrix(&placed.places);
    let at_images = state.at_images(most);
    (state.matrix, state.shared) = state.mapped(&at_images, check)?;
    state.embed(Surface::Whole, COINCIDING, check)?;
    Ok((pair, state))
}

impl<'a> AtRest<'a> {
    /// Of a shape that is moved along another, so many units of whose length one of its own is.
    fn new(moving: &'a Shape, lengths: f64, slides: bool) -> Result<Self> {
        let (rigidity, graph) = rayon::join(
            || moving.rigidity(),
            || slides.then(|| moving.deformation_graph()).transpose(),
        );
        let rest = moving.mesh.vertices.iter();
        let rest = rest.map(|&p| vector::scaled(p, lengths)).collect();
        Ok(Self {
            rigid: RigidSurface::new(rigidity?, rest),
            sliding: graph?.map(PiecewiseAffine::new),
        })
    }
}

impl<'a> Refined<'a> {
    /// Goes through a schedule from the present images; `report` is told the fraction done.
    fn refined(
        mut self,
        pair: &Pair<'a>,
        schedule: Schedule,
        report: &(dyn Fn(f64) -> Result<()> + Sync),
    ) -> Result<Self> {
        if schedule.drawn.is_none() && !pair.knows_lengths() {
            self.lengths = self.moving_is.seen(relative_length(pair, self.maps()));
        }
        self.place_moving_on_still();
        let before = if schedule.two_ways { CLIMB.len() } else { 0 };
        let steps = (before + schedule.sizes.len() + schedule.rigid_sizes.len()) as f64;
        let settles = !schedule.rigid_sizes.is_empty()
            && pair.uses(Part::Extrinsic)
            && pair.uses(Part::Rigid);
        // What is missing from a part would be filled, and its inside is not known.
        let whole = pair.coverage.part().is_none();
        let slides = whole && pair.uses(Part::Sliding);
        let moving = self.moving.shape;
        let lengths = self.lengths;
        let (climbed, surface) = rayon::join(
            || {
                if schedule.two_ways {
                    self.take_two_ways(pair.uses(Part::Detour), &|step| {
                        report(step as f64 / steps)
                    })?;
                }
                self.climb(schedule.sizes, schedule.detail, &|step| {
                    report((before + step) as f64 / steps)
                })
            },
            || settles.then(|| AtRest::new(moving, lengths, slides)),
        );
        climbed?;
        if let Some(AtRest { rigid, sliding }) = surface.transpose()? {
            if whole && pair.uses(Part::Fingers) {
                self.set_fingers_right(&|| report((before + schedule.sizes.len()) as f64 / steps))?;
            }
            self.settle_whole_surface(rigid, schedule.rigid_sizes, &|step| {
                report((before + schedule.sizes.len() + step) as f64 / steps)
            })?;
            let coincide = self.settle_coinciding(&|| report(1.0))?;
            if let Some(sliding) = sliding.filter(|_| !coincide) {
                self.settle_parts(sliding, pair.uses(Part::Convexity), &|| report(1.0))?;
            }
        }
        Ok(self)
    }

    /// What was refined with the part on a piece in place of the whole, as a map of the whole: what lies off the
    /// piece goes with the nearest vertex of it, as far away as it is.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`], [`crate::Error::NotFactorised`].
    pub(super) fn spread_from_piece(
        pair: &Pair<'a>,
        piece: &Piece,
        refined: &Refined<'_>,
        check: Check<'_>,
    ) -> Result<Self> {
        check()?;
        let mut state = Self::unknown(pair, refined.moving_is, None);
        let (part, whole) = (&mut state.moving, &mut state.still);
        let (mesh, nearest) = (&piece.shape.mesh, &piece.nearest);
        let images = refined.moving.images.vertex.iter();
        part.images.vertex = images.map(|&v| piece.vertices[v as usize]).collect();
        part.rows.clone_from(&refined.moving.rows);
        let images = &refined.still.images.vertex;
        whole.images.vertex = nearest.iter().map(|&v| images[v as usize]).collect();
        whole.rows = refined.still.rows.gather(nearest);
        for (v, (&p, &near)) in whole.shape.mesh.vertices.iter().zip(nearest).enumerate() {
            let off = vector::sub(mesh.as_own(p), mesh.vertices[near as usize]);
            for (x, off) in whole.rows.row_mut(v).iter_mut().zip(&off) {
                *x += (WHOLE.positions * off) as f32;
            }
        }
        let deformed = (0..part.asking.len()).map(|v| mesh.as_given(refined.deformed_at(v)));
        state.deformed = as_matrix(&deformed.collect::<Vec<_>>());
        let most = state.moving.most().min(state.still.most());
        let at_images = state.at_images(most);
        (state.matrix, state.shared) = state.mapped(&at_images, check)?;
        Ok(state)
    }
}
