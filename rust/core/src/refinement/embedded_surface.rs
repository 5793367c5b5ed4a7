//! Final refinement: spectrum, low-passed surface and its normals together.
//!
//! One surface, low-passed to k eigenfunctions, is deformed onto the other by a smooth displacement: a part onto
//! the whole, some of which has nowhere to go on the part, else the target onto the source. Positions and
//! normals then disambiguate what the spectrum alone leaves open. k grows until fingers and ears are there,
//! twice: what slid along a limb comes back a little each time. At first a second way starts from fewer
//! eigenfunctions, which turns back twisted limbs and twists others, and each region is taken from the way that
//! is better there. At last the surface itself is drawn onto the other, as rigidly as possible, and refines the
//! map once more in the same way; then it slides along the other, deformed by maps that are affine on each part.
//!
//! # Source
//! Eisenberger, Lähner, Cremers, "Smooth Shells", 2020, for the product embedding; fits, schedule
//! and the propagated nearest neighbours are this project's.

use faer::{Mat, MatRef};
use rayon::prelude::*;

use crate::deformation::piecewise_affine::{PiecewiseAffine, Pull};
use crate::deformation::rigid_surface::RigidSurface;
use crate::dense::{self, Rows};
use crate::error::Result;
use crate::hints::Which;
use crate::mesh::Adjacency;
use crate::pair::{Mirror, Pair, Part};
use crate::pointwise_map::{EmbeddedTriangles, SurfacePoint, projected};
use crate::progress::Check;
use crate::refinement::coinciding::{COINCIDENT, Coinciding, STRAY, coinciding};
use crate::refinement::covered::Piece;
use crate::refinement::parts::{self, Foot};
use crate::refinement::propagation::Images;
use crate::refinement::regions;
use crate::refinement::relative_length::relative_length;
use crate::refinement::side::{Side, Surface, Weights};
use crate::shape::Shape;
use crate::similarity::Similarity;
use crate::vector::{self, Point};

/// With low-passed surfaces.
const LOW_PASSED: Weights = Weights {
    positions: 0.9,
    normals: 0.045,
    looks: 0.9,
    functions: usize::MAX,
};
/// With whole surfaces, whose normals are rougher and whose positions say more.
const WHOLE: Weights = Weights {
    positions: 0.9,
    normals: 0.04,
    looks: 0.55,
    functions: usize::MAX,
};
/// With surfaces that coincide, where the nearest point is the image; normals tell the sides of what is
/// thin.
const COINCIDING: Weights = Weights {
    positions: 20.0,
    normals: 0.1,
    looks: 0.0,
    functions: usize::MAX,
};
/// Root mean square distance between matched points of surfaces that are moved onto each other, above
/// which they are in other poses: maps are right to 0.02. After an affine map bodies of different build in one pose
/// leave 0.02 to 0.045, other poses 0.06 and more.
const SAME_POSE: f64 = 0.05;
/// With one surface deformed onto the other, along which it slides: the nearest point as there, with somewhat more of
/// the normals, and so much of the spectrum that parts that touch are not taken for one another.
const SLIDING: Weights = Weights {
    positions: 20.0,
    normals: 0.2,
    looks: 0.0,
    functions: 20,
};
/// Where it slid to, in other poses: places say less than before they were drawn to what the spectrum says.
const AFTER_SLIDING: Weights = Weights {
    positions: 0.5,
    ..WHOLE
};
/// By how much more than before a surface that slid may stretch edges: where parts bend too sharply for it and maps
/// become worse it is 1.26 to 1.32 times as much, elsewhere 0.75 to 1.15 times.
const MOST_STRETCHED: f64 = 1.2;
/// Rounds of sliding at most. With four, fingers of `MakeHuman` bodies more often land beside their own.
const SLIDES: usize = 5;
/// Last of them, in which images are points of triangles, in those before the vertices nearest to them: in all
/// rounds by vertices, errors are two per cent larger.
const SLIDES_WITHIN_TRIANGLES: usize = 2;
/// How far beyond where it is drawn a surface goes on in all rounds between the first and the last, relative to the way
/// there: without it the same errors take eight rounds, with half and three quarters of it six.
const BEYOND: f64 = 0.8;
/// Share of the images that change in a round below which they have slid.
const SLID: f64 = 0.03;
/// Steps with the whole surface where it slid to, in other poses: without them errors are a twentieth larger, and rise
/// where nothing has to slide.
const STEPS_AFTER_SLIDING: usize = 2;
/// Times that coinciding surfaces are moved onto each other.
const MOVES: usize = 6;
/// Ridge of the displacement fit, relative to Λ/λ₂₀.
const DISPLACEMENT_RIDGE: f64 = 2e-4;
/// Ridge of the map fit.
const MAP_RIDGE: f64 = 1e-3;
/// Eigenvalue that sets the scale of the displacement's smoothness.
const SMOOTHNESS_PAIR: usize = 20;
/// Sweeps of the nearest neighbours at each step.
const SWEEPS: usize = 3;

/// Share of the images that change in a step on the whole surface below which it has come to rest.
const AT_REST: f64 = 0.015;

/// Numbers of eigenfunctions, one a step, from the map that is given to fingers and ears.
const CLIMB: &[usize] = &[60, 80, 100, 120];
/// Those of the second way before it climbs.
const DETOUR: &[usize] = &[15, 20, 30, 40, 15, 20, 30, 40];
/// What surfaces are low-passed to at least, so that a limb is no line, which has no sides. The first way's
/// climb keeps a gorilla's leg from being twisted by doing without.
const DETAIL: usize = 100;

/// Which vertices take part in the fits, and for which numbers of eigenfunctions.
#[derive(Debug, Clone, Copy)]
pub struct Schedule {
    /// Whether two ways climb first.
    pub two_ways: bool,
    /// Eigenfunctions to which surfaces are low-passed at least.
    pub detail: usize,
    /// Numbers of eigenfunctions, one a step.
    pub sizes: &'static [usize],
    /// Numbers of eigenfunctions of the steps on the whole surface afterwards.
    pub rigid_sizes: &'static [usize],
    /// Only this many vertices of each shape ask, all when `None`.
    pub drawn: Option<usize>,
}

/// The full schedule: two ways, 60 to 150 eigenfunctions in equal ratios, then on the whole surface.
pub const FULL: Schedule = Schedule {
    two_ways: true,
    detail: DETAIL,
    sizes: &[60, 75, 95, 120, 150],
    rigid_sizes: &[80, 120, 150, 150],
    drawn: None,
};

/// Of a map that keeps distances: a second way would find nothing better, and the second climb and the steps on the
/// whole surface have less to do.
pub const ISOMETRIC: Schedule = Schedule {
    two_ways: false,
    sizes: &[80, 110, 150],
    rigid_sizes: &[150, 150],
    ..FULL
};

/// The short one, by which candidates are compared.
pub const SHORT: Schedule = Schedule {
    two_ways: false,
    detail: 0,
    sizes: &[60, 76, 95, 120, 120],
    rigid_sizes: &[],
    drawn: Some(800),
};

/// The one by which first maps of a part are compared, of some twenty eigenfunctions and lengths that are known.
pub const OF_PART: Schedule = Schedule {
    sizes: &[20, 25, 32, 40, 50, 60, 76, 95, 120],
    ..SHORT
};

/// The moving surface at rest, before the last steps deform it.
struct AtRest<'a> {
    rigid: RigidSurface<'a>,
    sliding: Option<PiecewiseAffine<'a>>,
}

/// Where a refinement stands.
#[derive(Debug, Clone)]
pub struct Refined<'a> {
    /// The shape that is deformed: the part, else the target.
    moving: Side<'a>,
    /// The shape that stays.
    still: Side<'a>,
    /// Which of the pair is deformed.
    moving_is: Which,
    /// The moving shape as it lies on the other in the last step, `(n, 3)`.
    deformed: Mat<f64>,
    /// Map of the last step, coefficients of the moving shape → those of the other.
    matrix: Mat<f64>,
    /// R² of each of the moving shape's eigenfunctions, `(k)`: how much of it the map finds on the other.
    shared: Vec<f64>,
    /// Units of length of the other shape that one of the moving shape is.
    lengths: f64,
}

/// Refines a `(kₛ, kₜ)` map of low eigenfunctions, target coefficients → source coefficients.
///
/// `samples` are the images of the target's farthest-point samples on the source and of the source's on the target, where
/// they are known. `report` is told the fraction done.
///
/// # Errors
/// [`crate::Error::Cancelled`], [`crate::Error::NotFactorised`].
pub fn refined<'a>(
    pair: &Pair<'a>,
    matrix: MatRef<'_, f64>,
    samples: Option<&[Vec<u32>; 2]>,
    schedule: Schedule,
    report: &(dyn Fn(f64) -> Result<()> + Sync),
) -> Result<Refined<'a>> {
    let start = || report(0.0);
    let state = Refined::start(pair, matrix, samples, schedule.drawn, &start)?;
    state.refined(pair, schedule, report)
}

/// Refines the images of all vertices: those of the target's on the source, and of the source's on the target, by
/// deforming either.
///
/// # Errors
/// Those of [`refined`].
pub fn refined_images<'a>(
    pair: &Pair<'a>,
    moving: Which,
    images: [Vec<u32>; 2],
    schedule: Schedule,
    report: &(dyn Fn(f64) -> Result<()> + Sync),
) -> Result<Refined<'a>> {
    Refined::by_images(pair, moving, images).refined(pair, schedule, report)
}

/// The nearest points of surfaces that lie on one another as they were given, and what their places tell of
/// the pair: which is a part, and their lengths. Nothing where they do not lie so.
///
/// # Errors
/// [`crate::Error::Cancelled`], [`crate::Error::NotFactorised`].
pub fn in_place<'a>(pair: &Pair<'a>, check: Check<'_>) -> Result<Option<(Pair<'a>, Refined<'a>)>> {
    let (target, source) = (pair.target, pair.source);
    if pair.mirror == Mirror::Only || !pair.uses(Part::Extrinsic) {
        return Ok(None);
    }
    let Some(found) = coinciding(target, source, check)? else {
        return Ok(None);
    };
    let Coinciding {
        placed,
        images: [on_source, on_target],
        shares,
    } = found;
    let pair = Pair {
        shares,
        lengths: target.unit / source.unit,
        ..*pair
    };
    let most = target.basis.values.len().min(source.basis.values.len());
    let mut state = Refined::by_images(&pair, Which::Target, [on_source, on_target]);
    state.deformed = as_matrix(&placed);
    let at_images = state.at_images(most);
    (state.matrix, state.shared) = state.mapped(&at_images, check)?;
    state.embed(Surface::Whole, COINCIDING, check)?;
    Ok(Some((pair, state)))
}

impl<'a> AtRest<'a> {
    /// Of a shape that is moved along another, so many units of whose length one of its own is.
    fn new(moving: &'a Shape, lengths: f64, slides: bool) -> Result<Self> {
        let (rigidity, parts) = rayon::join(
            || moving.rigidity(),
            || slides.then(|| moving.parts()).transpose(),
        );
        let rest = moving.mesh.vertices.iter();
        let rest = rest.map(|&p| vector::scaled(p, lengths)).collect();
        Ok(Self {
            rigid: RigidSurface::new(rigidity?, rest),
            sliding: parts?.map(PiecewiseAffine::new),
        })
    }
}

impl<'a> Refined<'a> {
    /// Where no image is known yet.
    fn unknown(pair: &Pair<'a>, moving_is: Which, drawn: Option<usize>) -> Self {
        let (moving, still) = rayon::join(
            || Side::new(pair, moving_is, drawn),
            || Side::new(pair, moving_is.other(), drawn),
        );
        Self {
            moving,
            still,
            moving_is,
            deformed: Mat::zeros(0, 3),
            matrix: Mat::zeros(0, 0),
            shared: Vec::new(),
            lengths: moving_is.seen(pair.lengths),
        }
    }

    /// Where all vertices ask and have these images; nothing else is known yet.
    pub(super) fn by_images(
        pair: &Pair<'a>,
        moving_is: Which,
        [on_source, on_target]: [Vec<u32>; 2],
    ) -> Self {
        let mut state = Self::unknown(pair, moving_is, None);
        let [target, source] = state.sides_mut();
        target.images.vertex = on_source;
        source.images.vertex = on_target;
        state
    }

    fn start(
        pair: &Pair<'a>,
        matrix: MatRef<'_, f64>,
        samples: Option<&[Vec<u32>; 2]>,
        drawn: Option<usize>,
        check: Check<'_>,
    ) -> Result<Self> {
        check()?;
        let [of_target, of_source] = [0, 1].map(|i| samples.map(|samples| samples[i].as_slice()));
        let moving_is = pair.shares.part().unwrap_or(Which::Target);
        let mut state = Self::unknown(pair, moving_is, drawn);
        let [target, source] = state.sides_mut();
        (source.rows, target.rows) = rayon::join(
            || pair.source.rows.times(matrix),
            || pair.target.rows.first(matrix.ncols()),
        );
        let (on_source, on_target) = rayon::join(
            || {
                first_images(
                    &mut target.images,
                    &target.asking,
                    (pair.target, of_target),
                    (&target.rows, &target.neighbours),
                    (pair.source, &source.rows),
                    check,
                )
            },
            || {
                first_images(
                    &mut source.images,
                    &source.asking,
                    (pair.source, of_source),
                    (&source.rows, &source.neighbours),
                    (pair.target, &target.rows),
                    check,
                )
            },
        );
        on_source.and(on_target)?;
        Ok(state)
    }

    /// The target's side.
    #[must_use]
    pub fn target(&self) -> &Side<'a> {
        self.side(Which::Target)
    }

    /// The source's side.
    #[must_use]
    pub fn source(&self) -> &Side<'a> {
        self.side(Which::Source)
    }

    /// The side of either.
    pub(crate) fn side(&self, which: Which) -> &Side<'a> {
        if which == self.moving_is {
            &self.moving
        } else {
            &self.still
        }
    }

    /// Target and source.
    fn sides_mut(&mut self) -> [&mut Side<'a>; 2] {
        match self.moving_is {
            Which::Target => [&mut self.moving, &mut self.still],
            Which::Source => [&mut self.still, &mut self.moving],
        }
    }

    /// Units of length of the source that one of the target is.
    #[must_use]
    pub fn lengths(&self) -> f64 {
        self.moving_is.seen(self.lengths)
    }

    /// Goes through a schedule from the present images; `report` is told the fraction done.
    fn refined(
        mut self,
        pair: &Pair<'a>,
        schedule: Schedule,
        report: &(dyn Fn(f64) -> Result<()> + Sync),
    ) -> Result<Self> {
        if schedule.drawn.is_none() && !pair.knows_lengths() {
            let [on_source, on_target] =
                [self.target(), self.source()].map(|side| &side.images.vertex);
            self.lengths = self
                .moving_is
                .seen(relative_length(pair, on_source, on_target));
        }
        self.place_moving_on_still();
        let before = if schedule.two_ways { CLIMB.len() } else { 0 };
        let steps = (before + schedule.sizes.len() + schedule.rigid_sizes.len()) as f64;
        let settles = !schedule.rigid_sizes.is_empty()
            && pair.uses(Part::Extrinsic)
            && pair.uses(Part::Rigid);
        // What is missing from a part would be filled, and its inside is not known.
        let slides = pair.shares.part().is_none();
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
            self.settle_whole_surface(rigid, schedule.rigid_sizes, &|step| {
                report((before + schedule.sizes.len() + step) as f64 / steps)
            })?;
            let coincide = self.settle_coinciding(&|| report(1.0))?;
            if let Some(sliding) = sliding.filter(|_| !coincide) {
                self.settle_parts(sliding, &|| report(1.0))?;
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

    /// The map of the last step between `k` eigenfunctions, fewer of a part, `(kₛ, kₜ)`: target coefficients →
    /// source coefficients.
    ///
    /// # Errors
    /// [`crate::Error::NotFactorised`].
    pub fn low_map(&self, k: usize) -> Result<Mat<f64>> {
        let [k_moving, k_still] = self.sizes(k);
        match self.moving_is {
            Which::Target => {
                let (rows, columns) = self.matrix.shape();
                let low = self
                    .matrix
                    .get(..k_still.min(rows), ..k_moving.min(columns));
                Ok(low.to_owned())
            }
            Which::Source => Ok(fitted(
                [(&self.still, k_still), (&self.moving, k_moving)],
                [
                    &self.still.at_images(&self.moving, k_moving),
                    &self.moving.at_images(&self.still, k_still),
                ],
                &|| Ok(()),
            )?
            .0),
        }
    }

    /// How far apart each target vertex and its image are where one surface lies on the other.
    #[must_use]
    pub fn gaps(&self) -> Vec<f64> {
        let target = &self.target().shape.mesh.vertices;
        let source = &self.source().shape.mesh.vertices;
        let images = self.target().images.vertex.iter().enumerate();
        images
            .map(|(v, &image)| match self.moving_is {
                Which::Target => vector::distance(self.deformed_at(v), source[image as usize]),
                Which::Source => vector::distance(self.deformed_at(image as usize), target[v]),
            })
            .collect()
    }

    /// Where a vertex of the moving shape lies on the other in the last step.
    fn deformed_at(&self, v: usize) -> Point {
        [0, 1, 2].map(|c| self.deformed[(v, c)])
    }

    /// Climbs as it stands and by way of few eigenfunctions, and joins what is better of both.
    fn take_two_ways(
        &mut self,
        detour: bool,
        report: &(dyn Fn(usize) -> Result<()> + Sync),
    ) -> Result<()> {
        // What is given climbs on from where it stands.
        let given = self.target().rows.dims;
        let climbed = CLIMB.partition_point(|&k| k <= given);
        let straight = &CLIMB[climbed.min(CLIMB.len() - 1)..];
        // On the first way and the second climb fewer askers save nothing, since their images are spread again.
        let mut other = detour.then(|| self.thinned());
        let (climbed, came_around) = rayon::join(
            || self.climb(straight, 0, report),
            || {
                other.as_mut().map_or(Ok(()), |other| {
                    other.climb(DETOUR, DETAIL, &|_| report(0))?;
                    other.climb(CLIMB, DETAIL, &|_| report(0))
                })
            },
        );
        climbed.and(came_around)?;
        if let Some(other) = other {
            let others = other.images_of_all(self, &|| report(CLIMB.len()))?;
            self.adopt_better_regions(&others);
        }
        Ok(())
    }

    /// The same where only some vertices of each shape ask for all.
    fn thinned(&self) -> Self {
        Self {
            moving: self.moving.thinned(),
            still: self.still.thinned(),
            moving_is: self.moving_is,
            deformed: self.deformed.clone(),
            matrix: self.matrix.clone(),
            shared: self.shared.clone(),
            lengths: self.lengths,
        }
    }

    /// Images of all the moving shape's vertices and of all the other's, of which these were asked for.
    fn images_of_all(&self, all: &Self, check: Check<'_>) -> Result<[Vec<u32>; 2]> {
        let (moving, still) = rayon::join(
            || {
                let all = &all.moving;
                self.moving.images_of_all(all, &self.still, SWEEPS, check)
            },
            || {
                let all = &all.still;
                self.still.images_of_all(all, &self.moving, SWEEPS, check)
            },
        );
        Ok([moving?, still?])
    }

    fn climb(
        &mut self,
        sizes: &[usize],
        detail: usize,
        report: &(dyn Fn(usize) -> Result<()> + Sync),
    ) -> Result<()> {
        let most = self.moving.most().min(self.still.most());
        for (step, &size) in sizes.iter().enumerate() {
            self.advance(size.min(most), detail, &|| report(step))?;
        }
        Ok(())
    }

    /// Takes over the images that another refinement of this pair gave the moving shape where they are better, and
    /// those that it gave the other's vertices that lie there on either map.
    fn adopt_better_regions(&mut self, [on_still, on_moving]: &[Vec<u32>; 2]) {
        let own = &mut self.moving.images.vertex;
        let better = regions::better_elsewhere(
            self.moving.shape,
            self.still.shape,
            self.lengths,
            own,
            on_still,
        );
        for ((image, &there), &better) in own.iter_mut().zip(on_still).zip(&better) {
            if better {
                *image = there;
            }
        }
        let own = &mut self.still.images.vertex;
        for (image, &there) in own.iter_mut().zip(on_moving) {
            if better[*image as usize] || better[there as usize] {
                *image = there;
            }
        }
    }

    /// One step at k eigenfunctions: displacement of surfaces low-passed to k, or to more where the
    /// `detail` is, map, embeddings, images.
    fn advance(&mut self, k: usize, detail: usize, check: Check<'_>) -> Result<()> {
        check()?;
        let [k_moving, k_still] = self.sizes(k.max(detail));
        let (moving, still) = (&mut self.moving, &mut self.still);
        rayon::join(|| moving.low_pass(k_moving), || still.low_pass(k_still));
        let at_images = self.at_images(k);
        let (deformed, matrix) = rayon::join(
            || self.displaced(&at_images, check),
            || self.mapped(&at_images, check),
        );
        self.deformed = deformed?;
        (self.matrix, self.shared) = matrix?;
        self.embed(Surface::Smoothed, LOW_PASSED, check)
    }

    /// Steps in which the moving surface itself, not low-passed, is drawn onto the other as rigidly as
    /// possible, and takes the place of the low-passed surface in the embedding.
    fn settle_whole_surface(
        &mut self,
        mut surface: RigidSurface<'_>,
        sizes: &[usize],
        report: &(dyn Fn(usize) -> Result<()> + Sync),
    ) -> Result<()> {
        let most = self.matrix.nrows();
        surface.positions = (0..self.deformed.nrows())
            .map(|v| self.deformed_at(v))
            .collect();
        for (step, &size) in sizes.iter().enumerate() {
            let check = || report(step);
            let (pulls, at_images) = (self.pulls(), self.at_images(size.min(most)));
            // The other's embedding needs the map, but not the surface that is drawn.
            let (drawn, embedded) = rayon::join(
                || surface.drawn_to(&pulls, &check),
                || {
                    (self.matrix, self.shared) = self.mapped(&at_images, &check)?;
                    self.write_still_rows(Surface::Whole, WHOLE);
                    Ok(())
                },
            );
            drawn.and(embedded)?;
            self.deformed = as_matrix(&surface.positions);
            self.write_moving_rows(WHOLE);
            let before = self.images();
            self.find_images(SWEEPS, &check)?;
            if size.min(most) == most && self.changed_since(&before) < AT_REST {
                break;
            }
        }
        Ok(())
    }

    /// The moving surface [slides](Self::slide) along the other. Between bodies of different build in one pose this is the
    /// last word. In other poses spectrum and looks have it, and nothing changes where edges would be stretched much more
    /// than before.
    fn settle_parts(&mut self, surface: PiecewiseAffine<'_>, check: Check<'_>) -> Result<()> {
        let (moving, still) = (self.moving.shape, self.still.shape);
        let matched: Vec<(Point, Point, f64)> = (self.moving.images.vertex.iter().enumerate())
            .map(|(v, &image)| {
                let place = still.mesh.vertices[image as usize];
                (moving.mesh.vertices[v], place, moving.mass[v])
            })
            .collect();
        let same_pose = parts::off_affine(&matched).is_some_and(|off| off <= SAME_POSE);
        if same_pose {
            return self.slide(surface, check);
        }
        let lengths = self.lengths;
        let stretch = |images: &Images| {
            let all = 0..images.vertex.len() as u32;
            regions::edge_misfit(moving, still, lengths, &images.vertex, all)
        };
        let kept = self.kept();
        let before = stretch(&self.moving.images);
        self.slide(surface, check)?;
        if stretch(&self.moving.images) > MOST_STRETCHED * before {
            self.put_back(kept);
            return Ok(());
        }
        for _ in 0..STEPS_AFTER_SLIDING {
            let at_images = self.at_images(self.matrix.nrows());
            (self.matrix, self.shared) = self.mapped(&at_images, check)?;
            self.embed(Surface::Whole, AFTER_SLIDING, check)?;
        }
        Ok(())
    }

    /// Rounds in which the moving surface is deformed by maps that are affine on each part, and drawn onto the tangent
    /// planes at its images, along which it slides.
    fn slide(&mut self, mut surface: PiecewiseAffine<'_>, check: Check<'_>) -> Result<()> {
        let (moving, still) = (self.moving.shape, self.still.shape);
        let (mut anchors, mut drawn): (Option<Vec<Point>>, Option<Vec<Point>>) = (None, None);
        for round in 0..SLIDES {
            let images = self.image_points(round + SLIDES_WITHIN_TRIANGLES >= SLIDES, check)?;
            let feet: Vec<Foot> =
                (images.par_iter().map(|image| Foot::new(still, image))).collect();
            let anchors = anchors.get_or_insert_with(|| feet.iter().map(|f| f.place).collect());
            // What the rigid surface left within the other body is not swallowed.
            let placed = |v: usize| (round > 0).then(|| self.deformed_at(v));
            let pulls: Vec<Pull> = (feet.par_iter().zip(&*anchors).enumerate())
                .map(|(v, (foot, anchor))| {
                    foot.pull(moving.mass[v] * moving.bulging[v], placed(v), *anchor)
                })
                .collect();
            let places = surface.drawn_to(&pulls, check)?;
            let last = round + 1 == SLIDES;
            let from = drawn.as_ref().filter(|_| !last).unwrap_or(&places);
            self.deformed = Mat::from_fn(places.len(), 3, |v, c| {
                places[v][c] + BEYOND * (places[v][c] - from[v][c])
            });
            drawn = Some(places);
            let before = self.images();
            if round == 0 {
                self.write_rows(Surface::Whole, SLIDING);
            } else {
                self.write_moving_rows(SLIDING);
            }
            self.find_images(SWEEPS, check)?;
            if self.changed_since(&before) < SLID {
                break;
            }
        }
        Ok(())
    }

    /// Images of the moving shape's vertices: points of triangles, or the vertices nearest to them.
    fn image_points(&self, within_triangles: bool, check: Check<'_>) -> Result<Vec<SurfacePoint>> {
        let (still, images) = (self.still.shape, &self.moving.images.vertex);
        if within_triangles {
            let triangles = EmbeddedTriangles::new(still, &self.still.rows);
            projected(&self.moving.rows, &triangles, images, check)
        } else {
            let at_vertex = |&image: &u32| SurfacePoint::at_vertex(still, image);
            Ok(images.iter().map(at_vertex).collect())
        }
    }

    /// The deformed surface and the images of both sides, to be [put back](Self::put_back).
    fn kept(&self) -> (Mat<f64>, [Images; 2]) {
        let images = [self.moving.images.clone(), self.still.images.clone()];
        (self.deformed.clone(), images)
    }

    /// Goes back to what was kept of a state on the whole surface.
    fn put_back(&mut self, (deformed, images): (Mat<f64>, [Images; 2])) {
        self.deformed = deformed;
        [self.moving.images, self.still.images] = images;
        self.write_rows(Surface::Whole, WHOLE);
    }

    /// Images of the moving shape's asking vertices and of the other's.
    fn images(&self) -> [Vec<u32>; 2] {
        [&self.moving, &self.still].map(|side| side.images.vertex.clone())
    }

    /// Share of the images that are not those of before.
    fn changed_since(&self, before: &[Vec<u32>; 2]) -> f64 {
        let (mut changed, mut all) = (0, 0);
        for (side, before) in [&self.moving, &self.still].into_iter().zip(before) {
            let images = side.images.vertex.iter().zip(before);
            changed += images.filter(|(now, before)| now != before).count();
            all += before.len();
        }
        changed as f64 / all as f64
    }

    /// Embeddings by the present map and the deformed surface beside one of the still shape's, and the images in them.
    fn embed(&mut self, of_still: Surface<'_>, weights: Weights, check: Check<'_>) -> Result<()> {
        check()?;
        self.write_rows(of_still, weights);
        self.find_images(SWEEPS, check)
    }

    /// Embeddings by the present map and surfaces.
    fn write_rows(&mut self, of_still: Surface<'_>, weights: Weights) {
        let (moving, still) = (&mut self.moving, &mut self.still);
        let deformed = Surface::Deformed(self.deformed.as_ref());
        let (matrix, shared) = (self.matrix.as_ref(), weights.of(&self.shared));
        rayon::join(
            || moving.embed(None, shared, deformed, weights),
            || still.embed(Some(matrix), shared, of_still, weights),
        );
    }

    /// The moving shape's alone.
    fn write_moving_rows(&mut self, weights: Weights) {
        let deformed = Surface::Deformed(self.deformed.as_ref());
        let shared = weights.of(&self.shared);
        self.moving.embed(None, shared, deformed, weights);
    }

    /// The still shape's alone.
    fn write_still_rows(&mut self, surface: Surface<'_>, weights: Weights) {
        let (matrix, shared) = (self.matrix.as_ref(), weights.of(&self.shared));
        self.still.embed(Some(matrix), shared, surface, weights);
    }

    /// Where on the still shape both maps see each vertex of the moving one, with the weight of that.
    fn pulls(&self) -> Vec<(f64, Point)> {
        let still = &self.still.shape.mesh.vertices;
        let mut pulls = vec![(0.0, [0.0; 3]); self.deformed.nrows()];
        let mut pull = |vertex: u32, weight: f64, to: u32| {
            let (sum, moment) = &mut pulls[vertex as usize];
            *sum += weight;
            *moment = vector::add(*moment, vector::scaled(still[to as usize], weight));
        };
        for (side, moves) in [(&self.moving, true), (&self.still, false)] {
            for (i, (&own, &image)) in side.asking.iter().zip(&side.images.vertex).enumerate() {
                if moves {
                    pull(own, side.weights[i], image);
                } else {
                    pull(image, side.weights[i], own);
                }
            }
        }
        pulls
    }

    /// Settles the images of both sides in the present embeddings; those of landmarks are given.
    fn find_images(&mut self, sweeps: usize, check: Check<'_>) -> Result<()> {
        let Self { moving, still, .. } = self;
        let (moving_rows, still_rows) = (&moving.rows, &still.rows);
        let (on_moving, on_still) = (&moving.shape.neighbours, &still.shape.neighbours);
        let (asked, answered) = rayon::join(
            || {
                moving.images.settle(
                    &moving.asking,
                    (moving_rows, &moving.neighbours),
                    (still_rows, on_still),
                    sweeps,
                    check,
                )
            },
            || {
                still.images.settle(
                    &still.asking,
                    (still_rows, &still.neighbours),
                    (moving_rows, on_moving),
                    sweeps,
                    check,
                )
            },
        );
        asked.and(answered)?;
        moving.answer_landmarks();
        still.answer_landmarks();
        Ok(())
    }

    /// √w times k eigenfunctions, or fewer of a part, at the images of the moving shape and of the other, for the
    /// fits.
    fn at_images(&self, k: usize) -> [Rows; 2] {
        let [k_moving, k_still] = self.sizes(k);
        let (m, s) = (&self.moving, &self.still);
        let (asked, answered) =
            rayon::join(|| m.at_images(s, k_still), || s.at_images(m, k_moving));
        [asked, answered]
    }

    /// Numbers of eigenfunctions of the moving shape and of the other up to one eigenvalue: they grow with the area
    /// (Weyl's law), and a part has less of it than the whole.
    ///
    /// # Source
    /// Rodolà, Cosmo, Bronstein, Torsello, Cremers, "Partial functional correspondence", 2017.
    fn sizes(&self, k: usize) -> [usize; 2] {
        let area = self.lengths * self.lengths;
        [area, 1.0 / area].map(|ratio| (k as f64 * ratio.min(1.0)).round().max(1.0) as usize)
    }

    /// Low-passed surface plus the smooth displacement that brings it onto the other.
    fn displaced(&self, [_, answered]: &[Rows; 2], check: Check<'_>) -> Result<Mat<f64>> {
        let (m, s) = (&self.moving, &self.still);
        let own_shift = m.shifts(m.smoothed.as_ref(), s.smoothed.as_ref());
        let back = s.shifts(s.smoothed.as_ref(), m.smoothed.as_ref());
        check()?;
        let k = answered.dims;
        let gram = m.own_gram(k) + &dense::gram(answered.as_columns());
        check()?;
        let products = |functions: MatRef<'_, f32>, shift: &Mat<f64>| {
            let shift = Rows::from_matrix(shift.as_ref(), 3);
            dense::sum_of_products(functions, shift.as_columns())
        };
        let right = products(m.own(k), &own_shift) - products(answered.as_columns(), &back);
        let values = &m.shape.basis.values;
        let scale = DISPLACEMENT_RIDGE / values[SMOOTHNESS_PAIR.min(values.len() - 1)];
        let shift = dense::solve_with_ridge(gram, |i| scale * values[i] + 1e-12, right.as_ref())?;
        let mut deformed = m.smoothed.clone();
        dense::add_product(deformed.as_mut(), m.basis(k), shift.as_ref());
        Ok(deformed)
    }

    /// The map of this step, and R² of each column.
    fn mapped(
        &self,
        [asked, answered]: &[Rows; 2],
        check: Check<'_>,
    ) -> Result<(Mat<f64>, Vec<f64>)> {
        let sides = [(&self.moving, answered.dims), (&self.still, asked.dims)];
        fitted(sides, [asked, answered], check)
    }

    /// Rotates, scales and moves the moving shape's low-passed surface so that matched points come together.
    fn place_moving_on_still(&mut self) {
        let placing = Similarity {
            scale: self.lengths,
            ..Similarity::fitted(&self.matched(), false)
        };
        self.moving.place(&placing);
    }

    /// Point of the moving shape, point of the other and weight of all matches, both ways.
    fn matched(&self) -> Vec<(Point, Point, f64)> {
        let (m, s) = (&self.moving, &self.still);
        let at = |side: &Side, v: u32| side.shape.mesh.vertices[v as usize];
        let asked = (0..m.asking.len())
            .map(|i| (at(m, m.asking[i]), at(s, m.images.vertex[i]), m.weights[i]));
        let answered = (0..s.asking.len())
            .map(|i| (at(m, s.images.vertex[i]), at(s, s.asking[i]), s.weights[i]));
        asked.chain(answered).collect()
    }

    /// Two meshes of one shape in one pose, however placed, are moved onto each other, and the nearest
    /// point there is the image. Changes nothing where the surfaces do not coincide, and tells whether they do.
    ///
    /// # Source
    /// Besl, `McKay`, "A method for registration of 3-D shapes", 1992, from the map found.
    fn settle_coinciding(&mut self, check: Check<'_>) -> Result<bool> {
        let matched = self.matched();
        let motion = Similarity::fitted(&matched, false);
        let (mut total, mut square) = (0.0, 0.0);
        for (p, q, w) in matched {
            total += w;
            square += w * vector::distance(motion.apply(p), q).powi(2);
        }
        if square > SAME_POSE.powi(2) * total {
            return Ok(false);
        }
        let kept = self.kept();
        for _ in 0..MOVES {
            let motion = Similarity::fitted(&self.matched(), false);
            let places = &self.moving.shape.mesh.vertices;
            let moved: Vec<Point> = places.iter().map(|&p| motion.apply(p)).collect();
            self.deformed = as_matrix(&moved);
            self.embed(Surface::Whole, COINCIDING, check)?;
        }
        let coincides = self.coincides();
        if !coincides {
            self.put_back(kept);
        }
        Ok(coincides)
    }

    /// Whether the deformed surface lies on the other but for a few vertices.
    fn coincides(&self) -> bool {
        let still = self.still.shape;
        let strays = |&(v, &image): &(usize, &u32)| {
            let off = vector::sub(self.deformed_at(v), still.mesh.vertices[image as usize]);
            vector::dot(still.normals[image as usize], off).abs() > COINCIDENT
        };
        let images = &self.moving.images.vertex;
        let strayed = images.iter().enumerate().filter(strays).count();
        strayed as f64 <= STRAY * images.len() as f64
    }
}

/// Bijective least squares for the map from so many coefficients of one side to so many of another, and R² of each
/// column: from rows of the eigenfunctions, `asked` of the second's at the first's images, `answered` of the first's
/// at the second's.
fn fitted(
    [(from, k_from), (to, k_to)]: [(&Side<'_>, usize); 2],
    [asked, answered]: [&Rows; 2],
    check: Check<'_>,
) -> Result<(Mat<f64>, Vec<f64>)> {
    check()?;
    let ((asked_gram, asked_right), (to_right, answered)) = rayon::join(
        || {
            let asked = asked.as_columns();
            let right = dense::sum_of_products(asked, from.own(k_from));
            (dense::gram(asked), right)
        },
        || {
            let right = dense::sum_of_products(to.own(k_to), answered.as_columns());
            (right, answered.squares())
        },
    );
    check()?;
    let right = asked_right + to_right;
    let gram = asked_gram + to.own_gram(k_to);
    let matrix = dense::solve_with_ridge(gram, |_| MAP_RIDGE, right.as_ref())?;
    let squares = from.own_squares(k_from).iter().zip(&answered);
    let shared = squares
        .enumerate()
        .map(|(j, (own, answered))| {
            let found = matrix.col(j).transpose() * right.col(j);
            let all = f64::from(own + answered).max(f64::MIN_POSITIVE);
            (found / all).clamp(0.0, 1.0)
        })
        .collect();
    Ok((matrix, shared))
}

/// Nearest of all where few ask; where all do, for the farthest-point samples whose images are not known, and spread from
/// there.
fn first_images(
    images: &mut Images,
    asking: &[u32],
    (own, samples): (&Shape, Option<&[u32]>),
    (own_rows, neighbours): (&Rows, &Adjacency),
    (other, other_rows): (&Shape, &Rows),
    check: Check<'_>,
) -> Result<()> {
    let nearest = |vertices: &[u32]| {
        let queries = own_rows.gather(vertices);
        other.cells.nearest(&queries, other_rows, check)
    };
    if asking.len() == own.mesh.vertices.len() {
        let searched = if samples.is_none() {
            nearest(&own.farthest)?
        } else {
            Vec::new()
        };
        let found = samples.unwrap_or(&searched);
        for (&v, &image) in own.farthest.iter().zip(found) {
            images.vertex[v as usize] = image;
        }
        images.settle(
            asking,
            (own_rows, neighbours),
            (other_rows, &other.neighbours),
            SWEEPS,
            check,
        )?;
    } else {
        images.vertex = nearest(asking)?;
    }
    Ok(())
}

fn as_matrix(points: &[Point]) -> Mat<f64> {
    Mat::from_fn(points.len(), 3, |i, c| points[i][c])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hints::Hints;
    use crate::pair::Shares;
    use crate::testing::{self, RINGS, torus};

    #[test]
    fn a_shape_shares_its_eigenfunctions_with_itself_and_none_by_scattered_images() {
        let shape = torus(RINGS);
        let hints = Hints::default();
        let pair = testing::pair(&shape, &shape, Shares::BOTH, &hints);
        let shared_by = |image: &dyn Fn(u32) -> u32| {
            let images: Vec<u32> = (0..shape.mass.len() as u32).map(image).collect();
            let state = Refined::by_images(&pair, Which::Target, [images.clone(), images]);
            let at_images = state.at_images(30);
            state.mapped(&at_images, &|| Ok(())).expect("regular").1
        };
        // The ridge takes 1e-3 of a Gram matrix of at least 1.
        assert!(shared_by(&|v| v).iter().all(|&r| r > 0.998));
        // 30 functions explain 3 % of noise at 960 vertices, twice that where both ways agree; the constant
        // is the same everywhere.
        let mixed = |v: u32| {
            let high = v.wrapping_add(1).wrapping_mul(0x9e37_79b9);
            (high ^ (high >> 15)).wrapping_mul(0x85eb_ca6b)
        };
        let mut order: Vec<u32> = (0..shape.mass.len() as u32).collect();
        order.sort_by_key(|&v| mixed(v));
        let scattered = shared_by(&|v| order[v as usize]);
        assert!(scattered[0] > 0.998, "{}", scattered[0]);
        assert!(scattered[1..].iter().all(|&r| r < 0.25), "{scattered:?}");
    }

    #[test]
    fn either_shape_moved_gives_the_same_map() {
        let shape = torus(RINGS);
        let hints = Hints::default();
        let pair = testing::pair(&shape, &shape, Shares::BOTH, &hints);
        let count = shape.mass.len() as u32;
        let turn = count / RINGS as u32 * 5;
        let on_source: Vec<u32> = (0..count).map(|v| (v + turn) % count).collect();
        let on_target: Vec<u32> = (0..count).map(|v| (v + count - turn) % count).collect();
        let [by_target, by_source] = [Which::Target, Which::Source].map(|moving_is| {
            let images = [on_source.clone(), on_target.clone()];
            let mut state = Refined::by_images(&pair, moving_is, images);
            let at_images = state.at_images(20);
            (state.matrix, state.shared) = state.mapped(&at_images, &|| Ok(())).expect("regular");
            let still = &state.still.shape.mesh.vertices;
            let images = &state.moving.images.vertex;
            state.deformed =
                Mat::from_fn(images.len(), 3, |v, c| still[images[v] as usize][c] + 0.3);
            // Moved by 0.3 along each axis.
            let away = 0.3 * 3f64.sqrt();
            assert!(state.gaps().iter().all(|gap| (gap - away).abs() < 1e-9));
            state.low_map(20).expect("regular")
        });
        // Turned functions are no mirror image of functions turned back.
        assert!((&by_target - by_target.transpose()).norm_max() > 0.5);
        // Single precision sums over 960 vertices.
        assert!((&by_target - &by_source).norm_max() < 1e-4);
    }
}
