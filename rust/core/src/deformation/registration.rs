//! Non-rigid registration of two surfaces that stand near one another in space.
//!
//! In every round each sample of either surface asks for the sample of the other that is nearest in position and normal,
//! and the moving surface is drawn onto the tangent planes there, held together by maps that are
//! [affine on each part](super::piecewise_affine) and change little from part to part. It yields more from round to round,
//! so that at first it is stretched as a whole and at last limb by limb.
//!
//! # Source
//! Amberg, Romdhani, Vetter, "Optimal step nonrigid ICP algorithms for surface registration", 2007, for a stiffness that falls
//! from round to round; Chen, Medioni, "Object modelling by registration of multiple range images", 1992, for tangent planes.
//! Here few affine parts hold the surface instead of one map a vertex, and both surfaces ask.

use faer::Mat;

use crate::algebra::closest::closest;
use crate::algebra::vector::{self, Point};
use crate::deformation::piecewise_affine::{DeformationGraph, PiecewiseAffine, Pull};
use crate::error::Result;
use crate::mesh::normals_of;
use crate::mesh::numbering::Sample;
use crate::watch::progress::Check;

/// How a surface is drawn onto another.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Rounds, two at least.
    pub rounds: usize,
    /// Weight of what draws the surface, all together, beside what holds it: of the first round and of the last, in equal
    /// ratios between.
    pub pull: [f64; 2],
    /// Of that the share that draws to the place of the image, the rest to its tangent plane.
    pub to_place: f64,
    /// Length that a unit normal counts beside positions.
    pub normal: f64,
    /// Whether samples of the still surface ask too: not where the other one is a part of it.
    pub both_ask: bool,
    /// Least cosine between the normals of a sample and its image, which is else not drawn.
    pub agreeing: f64,
    /// Weight of what draws known vertices, all together, to where they belong, in every round.
    pub known: f64,
}

/// A surface in the frame of both, with the vertices that ask and answer.
#[derive(Debug, Clone, Copy)]
pub struct Sampled<'a> {
    /// Vertices, `(n)`.
    pub places: &'a [Point],
    /// Outward unit normals, `(n)`.
    pub normals: &'a [Point],
    /// Those that ask and answer.
    pub samples: &'a [u32],
}

/// What holds a surface together.
#[derive(Debug, Clone, Copy)]
pub struct Held<'a> {
    /// Its parts; at rest it may stand elsewhere and have another size.
    pub graph: &'a DeformationGraph,
    /// Its faces.
    pub faces: &'a [[u32; 3]],
    /// +1 when they are wound outward, else −1.
    pub volume_sign: f64,
}

/// A registered surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Registered {
    /// Where its vertices have come to lie, `(n)`.
    pub places: Vec<Point>,
    /// Outward unit normals there, `(n)`.
    pub normals: Vec<Point>,
}

/// Draws one surface onto another, known vertices of it to their places.
///
/// # Errors
/// [`crate::Error::NotFactorised`], [`crate::Error::Cancelled`].
pub fn registered(
    moving: Sampled<'_>,
    held: Held<'_>,
    still: Sampled<'_>,
    known: &[(u32, Point)],
    settings: &Settings,
    check: Check<'_>,
) -> Result<Registered> {
    let mut surface = PiecewiseAffine::new(held.graph);
    let mut now = Registered {
        places: moving.places.to_vec(),
        normals: moving.normals.to_vec(),
    };
    for round in 0..settings.rounds {
        let done = round as f64 / (settings.rounds - 1) as f64;
        let [first, last] = settings.pull;
        let weight = first.powf(1.0 - done) * last.powf(done);
        let mut pulls = pulls(now.sampled(moving.samples), still, weight, settings);
        for &(v, place) in known {
            let weight = settings.known / known.len() as f64;
            let (matrix, moment) = &mut pulls[v as usize];
            for c in 0..3 {
                matrix[c][c] += weight;
                moment[c] += weight * place[c];
            }
        }
        let places = surface.drawn_to(&pulls, check)?;
        let normals = normals_of(&places, held.faces).into_iter();
        now.normals = normals
            .map(|normal| vector::scaled(normal, held.volume_sign))
            .collect();
        now.places = places;
    }
    Ok(now)
}

impl Registered {
    /// The surface with some samples.
    #[must_use]
    pub fn sampled<'a>(&'a self, samples: &'a [u32]) -> Sampled<'a> {
        Sampled {
            places: &self.places,
            normals: &self.normals,
            samples,
        }
    }
}

/// For each sample of both surfaces the number of the nearest of the other, in positions and normals of this weight.
#[must_use]
pub fn nearest_samples(own: Sampled<'_>, other: Sampled<'_>, normal: f64) -> [Vec<Sample>; 2] {
    let (own, other) = (own.features(normal), other.features(normal));
    let (asked, answered) = rayon::join(
        || Sample::each(closest(own.as_ref(), other.as_ref(), None, 1.0)),
        || Sample::each(closest(other.as_ref(), own.as_ref(), None, 1.0)),
    );
    [asked, answered]
}

/// For each sample of a surface the number of the nearest of another, in positions and normals of this weight.
fn nearest_of(own: Sampled<'_>, other: Sampled<'_>, normal: f64) -> Vec<Sample> {
    let (own, other) = (own.features(normal), other.features(normal));
    Sample::each(closest(own.as_ref(), other.as_ref(), None, 1.0))
}

/// Mean distance between the samples of both surfaces and the nearest of the other, in positions and normals of this weight.
#[must_use]
pub fn misfit(own: Sampled<'_>, other: Sampled<'_>, normal: f64) -> f64 {
    let [asked, answered] = nearest_samples(own, other, normal);
    let mean = |from: Sampled<'_>, to: Sampled<'_>, images: &[Sample]| {
        let distances = from.samples.iter().zip(images).map(|(&v, &image)| {
            let (v, image) = (v as usize, to.samples[image.index()] as usize);
            let apart = vector::distance(from.places[v], to.places[image]);
            let turned = normal * vector::distance(from.normals[v], to.normals[image]);
            apart.hypot(turned)
        });
        distances.sum::<f64>() / images.len() as f64
    };
    f64::midpoint(mean(own, other, &asked), mean(other, own, &answered))
}

impl Sampled<'_> {
    /// Positions and weighted normals of the samples, `(s, 6)`.
    fn features(&self, normal: f64) -> Mat<f32> {
        Mat::from_fn(self.samples.len(), 6, |i, c| {
            let v = self.samples[i] as usize;
            let value = if c < 3 {
                self.places[v][c]
            } else {
                normal * self.normals[v][c - 3]
            };
            value as f32
        })
    }
}

/// What draws each vertex of a surface to another: its samples to their images, and to the samples of which they are
/// images.
fn pulls(own: Sampled<'_>, still: Sampled<'_>, weight: f64, settings: &Settings) -> Vec<Pull> {
    let (asked, answered) = if settings.both_ask {
        let [asked, answered] = nearest_samples(own, still, settings.normal);
        (asked, answered)
    } else {
        (nearest_of(own, still, settings.normal), Vec::new())
    };
    let half = if settings.both_ask { 0.5 } else { 1.0 };
    let share = |count: usize| half * weight / count as f64;
    let shares = [own.samples.len(), still.samples.len()].map(share);
    let asked = own.samples.iter().zip(&asked);
    let asked = asked.map(|(&v, &image)| (v, still.samples[image.index()], shares[0]));
    let answered = still.samples.iter().zip(&answered);
    let answered = answered.map(|(&image, &v)| (own.samples[v.index()], image, shares[1]));
    let mut pulls: Vec<Pull> = vec![([[0.0; 3]; 3], [0.0; 3]); own.places.len()];
    for (v, image, share) in asked.chain(answered) {
        let (v, image) = (v as usize, image as usize);
        let (normal, place) = (still.normals[image], still.places[image]);
        if vector::dot(own.normals[v], normal) < settings.agreeing {
            continue;
        }
        let to_place = share * settings.to_place;
        let to_plane = share - to_place;
        let height = to_plane * vector::dot(normal, place);
        let (matrix, moment) = &mut pulls[v];
        for c in 0..3 {
            matrix[c] = vector::add(matrix[c], vector::scaled(normal, to_plane * normal[c]));
            matrix[c][c] += to_place;
            moment[c] += height * normal[c] + to_place * place[c];
        }
    }
    pulls
}
