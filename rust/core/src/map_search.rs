//! Initial maps: a beam search over sign patterns, scored by geodesic distortion.
//!
//! The paper starts its optimisation from a given map. Here the eigenfunctions of both shapes are
//! aligned one by one: each new column of the map may keep or turn its sign, both children are
//! fitted through point maps, and the ones that distort geodesic distances least survive.

use faer::{Mat, MatRef, Side};
use rayon::prelude::*;

use crate::closest::closest;
use crate::dense::{self, LANES, squared_distance, vectorised};
use crate::distance_operator;
use crate::error::{Error, Result};
use crate::hints::Which;
use crate::orientation::{FUNCTIONS, TangentGradients, better_signs, orientation, shares};
use crate::pair::{Mirror, Pair, Part, Shares};
use crate::progress::Progress;
use crate::shape::Shape;

/// Eigenfunctions of the seeds.
const SEED_SIZE: usize = 7;
/// Eigenfunctions of the finished candidates.
pub const CANDIDATE_SIZE: usize = 24;
/// Sign and order patterns kept of all that are tried.
const SIGN_SEEDS: usize = 48;
/// Coordinates of the spectral multidimensional scaling.
const SCALING_DIMS: usize = 5;
/// Eigenfunctions from which those coordinates are taken.
const SCALING_FUNCTIONS: usize = 30;
/// Weight of the descriptors beside the eigenfunctions.
const DESCRIPTOR_WEIGHT: f32 = 0.7;
/// Weight of the distance from the own mirror image beside the eigenfunctions. Between cats and horses 2
/// leaves legs and tail exchanged, 8 shifts the limbs.
const OFFSET_WEIGHT: f32 = 4.0;
/// Tikhonov weight of a fit, per sample.
const FIT_RIDGE: f64 = 1e-3;
/// Maps closer than this, as a mean geodesic distance at unit area, lie in one basin.
const BASIN: f64 = 0.08;
/// Ratio of neighbouring eigenvalues below which their functions may come mixed.
const NEARLY_DOUBLE: f64 = 1.15;
/// Number of eigenfunctions from which on maps are also tried with their front and back turned,
/// and how often.
const TURNED_FROM: usize = 12;
const TURNED_EVERY: usize = 4;
/// Eigenfunctions whose bivectors tell direct from mirrored maps.
const ORIENTATION_FUNCTIONS: usize = 8;
/// Below this size the orientation of a right map is as good as random.
const ORIENTED_FROM: usize = 15;
/// How far behind the best a candidate may be, by rank, once orientation counts: right ones stay below 1.15 at the end.
pub const RANKED_WITHIN: Reach = Reach {
    times: 1.6,
    floor: 0.01,
};
/// A map's energy is weighted by this less its orientation.
const ORIENTATION_OFFSET: f64 = 1.2;
/// Maps closer than this are the same.
const SAME: f64 = 0.03;

/// A multiple of the best figure. Equal maps of one shape differ by their samples only, the best
/// of them by nothing: all figures up to the floor are as good as it.
#[derive(Debug, Clone, Copy)]
pub struct Reach {
    /// Of the best, or of the floor.
    pub times: f64,
    /// Least figure that counts.
    pub floor: f64,
}

impl Reach {
    /// Up to where figures are in reach of the best.
    #[must_use]
    pub fn from(&self, best: f64) -> f64 {
        self.times * best.max(self.floor)
    }
}

/// How wide to search.
#[derive(Debug, Clone, Copy)]
pub struct Width {
    /// Candidates kept of the seeds.
    first: usize,
    /// Candidates kept afterwards.
    beam: usize,
    /// Samples whose images are sought.
    asking: usize,
    /// Samples among which they are sought.
    answering: usize,
}

impl Width {
    /// One candidate, to see what the search contributes.
    pub const SINGLE: Self = Self {
        first: 1,
        beam: 1,
        ..Self::USUAL
    };
    /// A first look, enough for poses of one body.
    pub const NARROW: Self = Self {
        first: 20,
        beam: 8,
        asking: 120,
        answering: 300,
    };
    /// Enough for most pairs.
    pub const USUAL: Self = Self {
        first: 32,
        beam: 16,
        asking: 200,
        answering: 500,
    };
    /// For pairs where the usual width finds nothing convincing.
    pub const WIDE: Self = Self {
        first: 96,
        beam: 40,
        ..Self::USUAL
    };
}

/// A map between the low ends of two spectra, with its images on the samples.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// `(kₛ, kₜ)`: target coefficients → source coefficients, so that Φₛ C ≈ Φₜ at matched points.
    pub matrix: Mat<f64>,
    /// Number of the source sample for each asking target sample.
    pub on_source: Vec<u32>,
    /// Number of the target sample for each asking source sample.
    pub on_target: Vec<u32>,
    /// Geodesic distortion times the root of the descriptor mismatch.
    pub energy: f64,
    /// Orientation score, negative for a mirrored map; 1 where there are too few eigenfunctions to tell.
    pub orientation: f64,
    /// Energy raised where the orientation is doubtful: by this the beam is ordered.
    pub rank: f64,
}

/// Everything of a pair that the search reads, on the samples only.
#[derive(Debug)]
pub struct SampledPair<'a> {
    pair: Pair<'a>,
    width: Width,
    side_target: Sampled,
    side_source: Sampled,
}

/// One shape's samples, and the fixed part of the cost of answering on it.
#[derive(Debug)]
struct Sampled {
    /// Basis at the samples, `(s, k)`.
    basis: Mat<f64>,
    /// The same in single precision.
    single: Mat<f32>,
    /// Distances between the samples, `(s, s)`.
    distances: Mat<f32>,
    /// Descriptor part of the squared distance, `(own samples, other's asking samples)`.
    fixed: Mat<f32>,
    /// Mismatch of the descriptors as judged, same shape.
    mismatch: Mat<f32>,
    gradients: TangentGradients,
    asking: usize,
}

impl<'a> SampledPair<'a> {
    /// Gathers the samples of both shapes.
    #[must_use]
    pub fn new(pair: Pair<'a>, width: Width) -> Self {
        let (side_target, side_source) = rayon::join(
            || Sampled::new(&pair, Which::Target, width),
            || Sampled::new(&pair, Which::Source, width),
        );
        Self {
            pair,
            width,
            side_target,
            side_source,
        }
    }

    /// Candidate maps of [`CANDIDATE_SIZE`] eigenfunctions, best first.
    ///
    /// # Errors
    /// [`Error::Cancelled`]; [`Error::NoMap`] when no seed gives a finite energy.
    pub fn search(&self, progress: &Progress) -> Result<Vec<Candidate>> {
        let width = self.width;
        let largest = self.largest();
        let first = SEED_SIZE.min(largest);
        let mut seeds = self.sign_seeds(first);
        seeds.extend(self.scaling_seeds(first));
        let seeds = each(&seeds, |seed| self.refitted(seed, first))?;
        let mut beam = self.pruned(seeds, width.first, BASIN);
        for k in first + 1..=largest {
            progress.check()?;
            if k % TURNED_EVERY == 0 && k >= TURNED_FROM && self.pair.uses(Part::Orientation) {
                let turned = each(&beam, |parent| self.reoriented(parent))?;
                beam.extend(turned.into_iter().flatten());
            }
            let children = each(&beam, |parent| {
                let child = self.refitted(parent, k)?;
                let mut siblings = vec![self.turned(&child, &[(k - 1, k - 1, -1.0)])?];
                if k > first + 1 && self.nearly_double(k) {
                    for sign in [1.0, -1.0] {
                        let exchange = [(k - 2, k - 1, sign), (k - 1, k - 2, sign)];
                        siblings.push(self.turned(&child, &exchange)?);
                    }
                }
                siblings.push(child);
                Ok(siblings)
            })?;
            beam = self.pruned(children.into_iter().flatten().collect(), width.beam, BASIN);
            if let Some(best) = beam.first().filter(|_| k >= ORIENTED_FROM) {
                // A mirrored map that distorts less says that one shape is a mirror image.
                let (rank, energy) = (RANKED_WITHIN.from(best.rank), best.energy);
                beam.retain(|candidate| candidate.rank <= rank || candidate.energy < energy);
            }
        }
        for _ in 0..2 {
            beam = each(&beam, |parent| self.refitted(parent, largest))?;
        }
        let beam = self.pruned(beam, width.beam, SAME);
        if beam.is_empty() {
            return Err(Error::NoMap {
                reason: "no candidate has a finite distortion; check the shapes' scale and holes"
                    .into(),
            });
        }
        Ok(beam)
    }

    /// Eigenfunctions of the finished candidates.
    fn largest(&self) -> usize {
        CANDIDATE_SIZE
            .min(self.side_source.basis.ncols())
            .min(self.side_target.basis.ncols())
    }

    /// The best sign patterns as candidates.
    fn sign_seeds(&self, size: usize) -> Vec<Candidate> {
        let mut seeds = sign_patterns(
            self.pair.target.distance_operator.as_ref(),
            self.pair.source.distance_operator.as_ref(),
            size,
            true,
        );
        seeds.truncate(SIGN_SEEDS);
        seeds.into_par_iter().map(|m| self.judged(m)).collect()
    }

    /// All sign patterns of the main coordinates of a classical multidimensional scaling in the
    /// spectral domain: dropping the constant from α centres it twice.
    fn scaling_seeds(&self, size: usize) -> Vec<Candidate> {
        let coordinates = |shape: &Shape, side: &Sampled| {
            let k = SCALING_FUNCTIONS.min(shape.distance_operator.nrows());
            let block = shape.distance_operator.get(1..k, 1..k);
            let decomposition = block.self_adjoint_eigen(Side::Lower).ok()?;
            let dims = SCALING_DIMS.min(k - 1);
            let scaled = Mat::from_fn(k - 1, dims, |i, j| {
                // Eigenvalues ascend, so the most negative ones come first.
                decomposition.U()[(i, j)] * (-decomposition.S()[j]).max(0.0).sqrt()
            });
            let at_samples = dense::product(side.basis.get(.., 1..k), scaled.as_ref());
            Some(dense::in_single(at_samples.as_ref()))
        };
        let (Some(target), Some(source)) = (
            coordinates(self.pair.target, &self.side_target),
            coordinates(self.pair.source, &self.side_source),
        ) else {
            return Vec::new();
        };
        let dims = target.ncols().min(source.ncols());
        (0..1usize << dims)
            .into_par_iter()
            .map(|bits| {
                let turned = Mat::from_fn(source.nrows(), dims, |i, j| {
                    if bits >> j & 1 == 1 {
                        -source[(i, j)]
                    } else {
                        source[(i, j)]
                    }
                });
                let target = target.get(.., ..dims);
                Candidate {
                    on_source: closest(
                        target.get(..self.side_target.asking, ..),
                        turned.as_ref(),
                        None,
                        1.0,
                    ),
                    on_target: closest(
                        turned.get(..self.side_source.asking, ..),
                        target,
                        None,
                        1.0,
                    ),
                    matrix: Mat::zeros(size, size),
                    energy: f64::INFINITY,
                    orientation: 0.0,
                    rank: f64::INFINITY,
                }
            })
            .collect()
    }

    /// Point maps of a matrix: on the source and on the target.
    fn images(&self, matrix: MatRef<'_, f64>) -> (Vec<u32>, Vec<u32>) {
        let (ks, kt) = (matrix.nrows(), matrix.ncols());
        let target = self.side_target.single.get(.., ..kt);
        let turned = dense::product(self.side_source.basis.get(.., ..ks), matrix);
        let source = dense::in_single(turned.as_ref());
        rayon::join(
            || {
                closest(
                    target.get(..self.side_target.asking, ..),
                    source.as_ref(),
                    Some(&self.side_source.fixed),
                    1.0 / kt as f32,
                )
            },
            || {
                closest(
                    source.get(..self.side_source.asking, ..),
                    target,
                    Some(&self.side_target.fixed),
                    1.0 / kt as f32,
                )
            },
        )
    }

    /// Point maps and energy of a matrix.
    fn judged(&self, matrix: Mat<f64>) -> Candidate {
        let ks = matrix.nrows();
        let (on_source, on_target) = self.images(matrix.as_ref());
        let energy = self.energy(&on_source, &on_target);
        let is_oriented = ks >= ORIENTED_FROM.min(self.largest());
        let orientation = if self.pair.uses(Part::Orientation) && is_oriented {
            let pairs = on_source.iter().enumerate();
            let measured = orientation(
                &self.side_target.gradients,
                &self.side_source.gradients,
                matrix.as_ref(),
                pairs.map(|(i, &j)| (i, j as usize)),
                ORIENTATION_FUNCTIONS,
            );
            self.wanted_sign() * measured
        } else {
            1.0
        };
        Candidate {
            matrix,
            orientation,
            rank: energy
                * (ORIENTATION_OFFSET
                    - if !on_source.is_empty() && ks >= ORIENTED_FROM {
                        orientation
                    } else {
                        0.0
                    }),
            on_source,
            on_target,
            energy,
        }
    }

    /// Which orientation is looked for.
    fn wanted_sign(&self) -> f64 {
        if self.pair.mirror == Mirror::Only {
            -1.0
        } else {
            1.0
        }
    }

    /// Fit at k from a candidate's point maps, with new point maps.
    fn refitted(&self, candidate: &Candidate, k: usize) -> Result<Candidate> {
        self.fitted(&candidate.on_source, &candidate.on_target, k)
    }

    /// Fit at k from point maps, with new point maps.
    fn fitted(&self, on_source: &[u32], on_target: &[u32], k: usize) -> Result<Candidate> {
        let matrix = fit(
            self.side_target.basis.as_ref(),
            self.side_source.basis.as_ref(),
            on_source,
            on_target,
            self.pair.shares,
            k,
        )?;
        Ok(self.judged(matrix))
    }

    /// A candidate with some columns replaced, `(column, by which, times)`, and fitted anew.
    fn turned(&self, candidate: &Candidate, columns: &[(usize, usize, f64)]) -> Result<Candidate> {
        let mut matrix = candidate.matrix.clone();
        for &(to, from, sign) in columns {
            for i in 0..matrix.nrows() {
                matrix[(i, to)] = sign * candidate.matrix[(i, from)];
            }
        }
        let size = matrix.ncols();
        let (on_source, on_target) = self.images(matrix.as_ref());
        self.fitted(&on_source, &on_target, size)
    }

    /// Whether the last two of k eigenvalues are so close on either shape that their functions may
    /// come mixed: then a reflection of the surface is no longer a change of one sign.
    fn nearly_double(&self, k: usize) -> bool {
        [self.pair.target, self.pair.source]
            .iter()
            .any(|s| s.basis.values[k - 1] < NEARLY_DOUBLE * s.basis.values[k - 2])
    }

    /// The same map with the columns turned that speak against its orientation: thin parts are
    /// nearly symmetric from front to back, and their functions turn together.
    fn reoriented(&self, candidate: &Candidate) -> Result<Option<Candidate>> {
        let shares = shares(
            &self.side_target.gradients,
            &self.side_source.gradients,
            candidate.matrix.as_ref(),
            candidate
                .on_source
                .iter()
                .enumerate()
                .map(|(i, &j)| (i, j as usize)),
            candidate.matrix.ncols() - 1,
        );
        let signs = better_signs((self.wanted_sign() * shares).as_ref());
        if signs.iter().all(|&s| s > 0.0) {
            return Ok(None);
        }
        let (rows, columns) = (candidate.matrix.nrows(), candidate.matrix.ncols());
        let turned = Mat::from_fn(rows, columns, |i, j| signs[j] * candidate.matrix[(i, j)]);
        let (on_source, on_target) = self.images(turned.as_ref());
        self.fitted(&on_source, &on_target, columns).map(Some)
    }

    /// Root mean square change of distances between samples, times the root of the mean
    /// descriptor mismatch.
    fn energy(&self, on_source: &[u32], on_target: &[u32]) -> f64 {
        let distortion = self.pair.shares.mean(
            self.side_source.distortion(on_source, &self.side_target),
            self.side_target.distortion(on_target, &self.side_source),
        );
        let mismatch = self.pair.shares.mean(
            self.side_source.mean_mismatch(on_source),
            self.side_target.mean_mismatch(on_target),
        );
        let distortion = if self.pair.uses(Part::Geodesic) {
            distortion
        } else {
            1.0
        };
        (distortion * mismatch).sqrt()
    }

    /// Mean distance on the source between the images of two candidates.
    fn apart(&self, a: &Candidate, b: &Candidate) -> f64 {
        let sum: f64 = a
            .on_source
            .iter()
            .zip(&b.on_source)
            .map(|(&p, &q)| f64::from(self.side_source.distances[(p as usize, q as usize)]))
            .sum();
        sum / a.on_source.len() as f64
    }

    /// The best candidates: up to half of them from different basins, the rest merely different.
    fn pruned(&self, mut all: Vec<Candidate>, size: usize, basin: f64) -> Vec<Candidate> {
        // Among the maps of a shape to itself there is always the identity.
        all.retain(|c| {
            c.rank.is_finite() && (self.pair.mirror != Mirror::Only || c.orientation >= 0.0)
        });
        all.sort_by(|a, b| a.rank.total_cmp(&b.rank));
        let mut chosen: Vec<usize> = Vec::new();
        for (distance, most) in [(basin, size / 2), (SAME, size)] {
            for i in 0..all.len() {
                if chosen.len() >= most {
                    break;
                }
                if chosen
                    .iter()
                    .all(|&j| i != j && self.apart(&all[i], &all[j]) > distance)
                {
                    chosen.push(i);
                }
            }
        }
        chosen.sort_unstable();
        let mut keep = vec![false; all.len()];
        for i in chosen {
            keep[i] = true;
        }
        let mut flags = keep.into_iter();
        all.retain(|_| flags.next() == Some(true));
        all
    }
}

impl Sampled {
    fn new(pair: &Pair<'_>, which: Which, width: Width) -> Self {
        let opposite = which.other();
        let (own, other) = (pair.shape(which), pair.shape(opposite));
        let samples = own.farthest_points(width.answering);
        let questions = other.farthest_points(width.asking);
        let known = pair.hints.in_search(which, own, samples);
        let asked = pair.hints.in_search(opposite, other, questions);
        let offsets = pair.mirror_offsets.map(|[target, source]| match which {
            Which::Target => (target, source),
            Which::Source => (source, target),
        });
        let mine = own.descriptors.rows.gather(samples);
        let theirs = other.descriptors.rows.gather(questions);
        let basis = dense::gather_rows(
            own.basis.functions.as_ref(),
            samples,
            own.distance_operator.nrows(),
        );
        let distances = distance_operator::between(
            own.distance_operator.as_ref(),
            basis.as_ref(),
            basis.as_ref(),
        );
        let waves = mine.dims - 1;
        let mut to_waves = vec![0.0; mine.count()];
        let mut fixed = Mat::zeros(mine.count(), theirs.count());
        let mut mismatch = Mat::zeros(mine.count(), theirs.count());
        for j in 0..theirs.count() {
            let b = theirs.row(j);
            vectorised(
                #[inline(always)]
                || {
                    for (i, distance) in to_waves.iter_mut().enumerate() {
                        let (a, b) = (&mine.row(i)[..waves], &b[..waves]);
                        *distance = squared_distance(a, b, f32::INFINITY);
                    }
                },
            );
            let fixed = fixed.col_as_slice_mut(j).iter_mut();
            let mismatch = mismatch.col_as_slice_mut(j).iter_mut();
            for (i, (fixed, mismatch)) in fixed.zip(mismatch).enumerate() {
                let bend = mine.row(i)[waves] - b[waves];
                let hinted: f32 = known
                    .col_as_slice(i)
                    .iter()
                    .zip(asked.col_as_slice(j))
                    .map(|(x, y)| (x - y) * (x - y))
                    .sum();
                let hinted = hinted
                    + offsets.map_or(0.0, |(own, other)| {
                        let change = own[samples[i] as usize] - other[questions[j] as usize];
                        (OFFSET_WEIGHT * change).powi(2)
                    });
                let (wave, bend) = if pair.uses(Part::Descriptors) {
                    (to_waves[i], bend)
                } else {
                    (1.0, 0.0)
                };
                *fixed = DESCRIPTOR_WEIGHT * DESCRIPTOR_WEIGHT * (wave + bend * bend) + hinted;
                *mismatch = wave.sqrt() + bend.abs() + hinted.sqrt();
            }
        }
        Self {
            distances: Mat::from_fn(basis.nrows(), basis.nrows(), |i, j| {
                if i == j {
                    0.0
                } else {
                    distances[(i, j)] as f32
                }
            }),
            single: dense::in_single(basis.as_ref()),
            basis,
            fixed,
            mismatch,
            gradients: TangentGradients::new(own, samples, FUNCTIONS),
            asking: own.farthest_points(width.asking).len(),
        }
    }

    /// Mean squared difference between distances of asking points and of their images here.
    fn distortion(&self, images: &[u32], asking: &Self) -> f64 {
        let mut sum = 0.0;
        for (j, &image) in images.iter().enumerate() {
            let here = self.distances.col_as_slice(image as usize);
            let there = asking.distances.col_as_slice(j);
            // Distances are symmetric, and a point has none from itself.
            let (ids, there) = (images[..j].chunks(LANES), there.chunks(LANES));
            let mut lanes = [0f32; LANES];
            for (ids, there) in ids.zip(there) {
                for ((lane, &i), d) in lanes.iter_mut().zip(ids).zip(there) {
                    let change = here[i as usize] - d;
                    *lane += change * change;
                }
            }
            sum += f64::from(dense::sum_of_lanes(lanes));
        }
        2.0 * sum / (images.len() * images.len()) as f64
    }

    fn mean_mismatch(&self, images: &[u32]) -> f64 {
        let sum: f64 = images
            .iter()
            .enumerate()
            .map(|(j, &i)| f64::from(self.mismatch[(i as usize, j)]))
            .sum();
        sum / images.len() as f64
    }
}

/// Signed orders of the first eigenfunctions by how well they take one distance operator to the
/// other, best first: all signs, and with `exchanges` also two neighbours exchanged.
fn sign_patterns(
    target: MatRef<'_, f64>,
    source: MatRef<'_, f64>,
    size: usize,
    exchanges: bool,
) -> Vec<Mat<f64>> {
    let mut patterns = Vec::new();
    for exchange in 0..if exchanges { size - 1 } else { 1 } {
        let mut order: Vec<usize> = (0..size).collect();
        if exchange > 0 {
            order.swap(exchange, exchange + 1);
        }
        for bits in 0..1usize << (size - 1) {
            let sign = |i: usize| {
                if i > 0 && bits >> (i - 1) & 1 == 1 {
                    -1.0
                } else {
                    1.0
                }
            };
            let mut cost = 0.0;
            for i in 0..size {
                for j in 0..size {
                    let carried = sign(i) * sign(j) * target[(order[i], order[j])];
                    cost += (carried - source[(i, j)]).powi(2);
                }
            }
            let matrix = Mat::from_fn(size, size, |i, j| if order[i] == j { sign(i) } else { 0.0 });
            patterns.push((cost, matrix));
        }
    }
    patterns.sort_by(|a, b| a.0.total_cmp(&b.0));
    patterns.into_iter().map(|(_, matrix)| matrix).collect()
}

/// The sign pattern of the first eigenfunctions that fits two distance operators best.
#[must_use]
pub fn best_signs(target: MatRef<'_, f64>, source: MatRef<'_, f64>) -> Mat<f64> {
    let size = SEED_SIZE.min(target.nrows());
    sign_patterns(target, source, size, false).swap_remove(0)
}

/// Bijective least squares: C with Φₛ C ≈ Φₜ at the pairs of both point maps.
///
/// Bases are given at samples; `on_source` are source samples for the first target samples,
/// `on_target` target samples for the first source samples. Returns `(k, k)`.
///
/// # Errors
/// [`Error::NotFactorised`] when the pairs do not determine the map.
pub fn fit(
    target: MatRef<'_, f64>,
    source: MatRef<'_, f64>,
    on_source: &[u32],
    on_target: &[u32],
    shares: Shares,
    k: usize,
) -> Result<Mat<f64>> {
    let (first, second) = (on_source.len(), on_target.len());
    let [target_root, source_root] = [shares.target.sqrt(), shares.source.sqrt()];
    let roots = [vec![target_root; first], vec![source_root; second]].concat();
    let weighted_rows = |basis: MatRef<'_, f64>, ids: Vec<u32>| {
        let mut rows = Mat::zeros(ids.len(), k);
        for j in 0..k {
            let out = rows.col_as_slice_mut(j).iter_mut();
            for ((out, root), &id) in out.zip(&roots).zip(&ids) {
                *out = root * basis[(id as usize, j)];
            }
        }
        rows
    };
    let p = weighted_rows(
        source,
        on_source.iter().copied().chain(0..second as u32).collect(),
    );
    let q = weighted_rows(
        target,
        (0..first as u32).chain(on_target.iter().copied()).collect(),
    );
    let (gram, right) = rayon::join(
        || dense::product(p.transpose(), p.as_ref()),
        || dense::product(p.transpose(), q.as_ref()),
    );
    dense::solve_with_ridge(gram, |_| FIT_RIDGE * first as f64, right.as_ref())
}

/// Applies a fallible step to all candidates in parallel, in order.
fn each<T: Sync, R: Send>(
    items: &[T],
    step: impl Fn(&T) -> Result<R> + Sync + Send,
) -> Result<Vec<R>> {
    items.par_iter().map(step).collect()
}
